// Panels over one time axis: which values they show, and above each its values under the pointer and buttons for its range.
const OVER_LIMIT = 10; // a panel with a limit shows up to so many times the limit, where twice as much would come
const OVER_MOST = 10; // any other leaves out what is farther from nearly all values than so many times their range

const NARROW = 620; // [px] below, titles are without their captions and names of lanes small

function makeNarrow(layout, rows) {
  layout.margin.l = 92;
  for (const title of layout.annotations) title.text = title.text.replace(/^(<b>.*?<\/b>) – .*$/, "$1");
  for (const row of rows) if (!row.has_lines) layout[row.axis].tickfont.size = 9;
}

// The range of values without peaks that would press all else flat.
function withoutPeaks(low, high, some, limits) {
  if (limits.length) {
    const most = OVER_LIMIT * Math.max(...limits.map(Math.abs));
    return most > 0 && Math.max(high, -low) > 2 * most ? [Math.max(low, -most), Math.min(high, most)] : [low, high];
  }
  const sorted = Float64Array.from(some).sort(), at = function (share) { return sorted[Math.round(share * (sorted.length - 1))]; };
  const first = at(0.005), last = at(0.995), range = last - first;
  if (!(range > 0)) return [low, high];
  return [first - low > OVER_MOST * range ? first - range : low, high - last > OVER_MOST * range ? last + range : high];
}

function panelBars(plot, rows, act) {
  const format = function (v, row) { return Number.isNaN(v) ? "–" : v.toFixed(row.decimals).replace("-", "−"); };
  let asked = null;

  function button(text, label, action) {
    const made = document.createElement("button");
    Object.assign(made, { type: "button", textContent: text, tabIndex: -1 });
    made.setAttribute("aria-label", label);
    made.addEventListener("click", action);
    return made;
  }

  const bars = rows.map(function (row, k) {
    if (!row.has_lines) return null;
    const node = document.createElement("div"), values = document.createElement("span"), tools = document.createElement("span");
    const fit = button("", "", function () { act.fit(k); });
    const zooms = [["+", "in", 0.5], ["−", "out", 2]].map(function ([sign, way, factor]) {
      return button(sign, `zoom ${way}, ${row.title}`, function () { act.zoom(k, factor); });
    });
    node.className = "panel-bar";
    node.dataset.axis = row.axis;
    values.className = "values";
    tools.className = "tools";
    tools.setAttribute("role", "toolbar");
    tools.setAttribute("aria-label", `range of ${row.title}`);
    fit.className = "fit";
    fit.hidden = true;
    tools.append(fit, ...zooms);
    zooms[0].tabIndex = 0; // one stop of the tab key for each panel; arrows go on to the other buttons
    tools.addEventListener("keydown", function (e) {
      const by = { ArrowRight: 1, ArrowLeft: -1 }[e.key], all = Array.from(tools.children).filter(function (b) { return !b.hidden; });
      if (by) all[(all.indexOf(document.activeElement) + by + all.length) % all.length].focus();
    });
    node.append(values, tools);
    plot.parentNode.append(node);
    return { node: node, values: values, fit: fit };
  });

  return {
    place: function () {
      const { t, b } = plot._fullLayout.margin, inner = plot._fullLayout.height - t - b;
      rows.forEach(function (row, k) {
        if (!bars[k]) return;
        bars[k].node.classList.toggle("narrow", plot.clientWidth < NARROW); // there the title needs the whole line
        if (k === 0) bars[k].node.style.right = plot.clientWidth < NARROW ? "" : "150px"; // beside plotly's own buttons
        bars[k].node.style.top = t + (1 - plot.layout[row.axis].domain[1]) * inner - (k ? 24 : 41) + "px";
      });
    },
    // `beyond` are values that the panel does not show.
    tell: function (k, beyond, isFree) {
      const { fit, node } = bars[k], told = beyond.filter(function (v) { return v !== null && v !== undefined; });
      const peaks = told.map(function (v) { return String(Number(v.toPrecision(3))).replace("-", "−"); }).join(" and ");
      fit.hidden = !isFree && !peaks;
      fit.textContent = isFree ? "fit" : `not shown: to ${peaks}`;
      fit.setAttribute("aria-label", isFree ? `fit, ${rows[k].title}` : `full range of ${rows[k].title}, to ${peaks}`);
      node.dataset.beyond = isFree || !peaks ? "" : fit.textContent; // for paper, which has no buttons
    },
    // Values of all panels at a time; none without one.
    show: function (x) {
      const wasAsked = asked !== null;
      asked = [x];
      if (!wasAsked) requestAnimationFrame(function () {
        const [at] = asked;
        asked = null;
        bars.forEach(function (bar, k) {
          if (bar) bar.values.replaceChildren(...(at === null ? [] : act.values(k, at)).map(function ([trace, v]) {
            const value = document.createElement("span"), dot = document.createElement("i");
            dot.className = "dot";
            dot.style.background = coloured(trace.line.color);
            value.append(dot, `${trace.name} ${format(v, rows[k])}`);
            return value;
          }));
        });
      });
    },
  };
}
