// The page of one drive.
(function () {
  const data = JSON.parse(document.getElementById("drive-data").textContent);
  const plot = document.getElementById("plots");
  const SOME = 1000; // values per line by which peaks are known
  const collator = new Intl.Collator("en");

  // --- spans: bars of the lanes, strips, shades ---------------------------------------------------------------------

  const traces = data.figure ? data.figure.data : [];
  const firstLane = (data.lines || []).length;
  const laneHover = traces.findIndex(function (trace) { return trace.meta === "lanes"; });

  function seconds(x) { return x.toFixed(2); }

  const lanes = (data.lanes || []).map(function (lane, i) {
    const trace = traces[firstLane + i];
    return Object.assign(spansOf(lane.spans, data.dt), { level: lane.level, name: trace.name, group: trace.legendgroup });
  });
  const strips = (data.rows || []).map(function (row) { return row.strips && spansOf(row.strips.spans, data.dt); });

  // Union of what wanted events of one level shade: 0 no aquaplaning, 1 partial, 2 full.
  function shaded(level) {
    const begin = [], end = [];
    const shown = data.events.map(function (e, i) { return [...data.shaded[i], e[2]]; })
      .filter(function (_, i) { return isWanted(i); });
    for (const [a, b, own] of shown.sort(function (p, q) { return p[0] - q[0]; })) {
      const last = end.length - 1;
      if (own !== level) continue;
      if (last >= 0 && a <= end[last]) end[last] = Math.max(end[last], b);
      else { begin.push(a); end.push(b); }
    }
    return { begin: begin, end: end };
  }
  let isWanted = function () { return true; }; // an event, by the filters
  function allShades() { return { other: shaded(0), partial: shaded(1), full: shaded(2) }; }
  let shades = allShades();

  function shadesAndStrips(from, to, unseen) {
    const found = ["other", "partial", "full"].flatMap(function (severity) {
      return rectangles(inside(shades[severity], from, to, unseen, 2 * unseen), "paper", 1, data.shades[severity]);
    });
    data.rows.forEach(function (row, k) {
      // a strip along the bottom, which the colours of the events do not mix with
      const yref = row.axis.replace("axis", "") + " domain";
      if (strips[k]) found.push(...rectangles(inside(strips[k], from, to, unseen), yref, 0.05, row.strips.colour));
    });
    return found;
  }

  // What is on in each of some hundred slices of the view; a slice takes in everything that touches it.
  function slices(range) {
    const count = 400, width = (range[1] - range[0]) / count;
    const shown = lanes.filter(function (lane) { return !hidden.has(lane.group); });
    const next = shown.map(function (lane) { return firstAtOrAfter(lane.end, range[0]); });
    const x = [], y = [], text = [];
    for (let s = 0; s < count; s++) {
      const from = range[0] + s * width, to = from + width, on = [];
      shown.forEach(function (lane, i) {
        while (next[i] < lane.end.length && lane.end[next[i]] <= from) next[i]++;
        const first = next[i], found = firstAtOrAfter(lane.begin, to) - first;
        if (found > 1) on.push(lane.name + ": " + found + " detections");
        else if (found === 1) {
          const a = lane.begin[first], b = lane.end[first];
          on.push(`${lane.name}: ${seconds(a)} – ${seconds(b)} s (${seconds(b - a)} s)`);
        }
      });
      x.push(from + 0.5 * width);
      y.push(1);
      text.push(on.join("<br>") || "all clear");
    }
    return { x: x, y: y, customdata: text };
  }

  // --- view ---------------------------------------------------------------------------------------------------

  const whole = [0, Math.max(data.n || 0, 1) * (data.dt || 1)];
  const lines = (data.lines || []).map(function (line) { return unpack(line, data.windows, data.dt); });
  const hidden = new Set();
  const held = {}; // y axes that the user has scaled, until "show all"
  const inFull = new Set(); // panels that show their peaks too
  let bars = null; // above the panels
  let view = whole.slice();
  let selected = ["", -1]; // table and row

  function isHidden(i) { return hidden.has(data.figure.data[i].legendgroup); }

  // The range that a panel shows, and what lies beyond it.
  function valueRange(k, range) {
    let low = Infinity, high = -Infinity;
    const some = [];
    lines.forEach(function (line, i) {
      if (line.row !== k || isHidden(i)) return;
      const a = Math.max(0, firstAtOrAfter(line.t, range[0]) - 1);
      const b = Math.min(line.t.length, firstAtOrAfter(line.t, range[1]) + 1);
      const every = Math.ceil((b - a) / SOME);
      for (let j = a; j < b; j++) {
        const v = line.y[j];
        if (v < low) low = v;
        if (v > high) high = v;
        if ((j - a) % every === 0 && !Number.isNaN(v)) some.push(v);
      }
    });
    if (low > high) { low = 0; high = 0; }
    const least = low, greatest = high;
    if (!inFull.has(k)) [low, high] = withoutPeaks(low, high, some, data.rows[k].thresholds);
    const beyond = [least < low ? least : null, greatest > high ? greatest : null];
    for (const v of data.rows[k].include) { low = Math.min(low, v); high = Math.max(high, v); }
    const short = 0.5 * (data.rows[k].least_span - (high - low));
    if (short > 0) { low -= short; high += short; }
    const span = high - low || Math.max(1, Math.abs(high)) * 0.1;
    return [[low - 0.06 * span, high + 0.1 * span], beyond];
  }

  function selectionShape() {
    if (selected[1] < 0) return [];
    const event = choices[selected[0]].spans[selected[1]];
    return [{
      type: "rect", xref: "x", x0: event[0], x1: event[1], yref: "paper", y0: 0, y1: 1, layer: "above",
      fillcolor: "rgba(0,0,0,0)", line: { width: 1.5, color: schemeColours()["@accent"], dash: "dot" },
    }];
  }

  // What a view shows: samples and bars of each trace by its index, and what changes of the layout.
  function contents(range) {
    const width = range[1] - range[0], change = new Map(), layout = { shapes: shapes.slice() };
    // half a view more on both sides, so that panning does not pull in blank paper
    const from = range[0] - 0.5 * width, to = range[1] + 0.5 * width, unseen = width / POINTS;
    lines.forEach(function (line, i) {
      const a = Math.max(0, firstAtOrAfter(line.t, from) - 1);
      const b = Math.min(line.t.length, firstAtOrAfter(line.t, to) + 1);
      const [x, y] = picked(line, a, b);
      change.set(i, { x: x, y: y });
    });
    lanes.forEach(function (lane, i) {
      const [x, y] = outlines(inside(lane, from, to, unseen), lane.level);
      change.set(firstLane + i, { x: x, y: y });
    });
    if (laneHover >= 0) change.set(laneHover, slices(range));
    layout.shapes.unshift(...shadesAndStrips(from, to, unseen));
    layout.shapes.push(...selectionShape());
    for (const axis of ["xaxis", "xaxis2"]) layout[axis + ".range"] = range.slice();
    data.rows.forEach(function (row, k) {
      if (!row.has_lines || held[row.axis]) return;
      const [shown, beyond] = valueRange(k, range);
      layout[row.axis + ".range"] = shown;
      if (bars) bars.tell(k, beyond, inFull.has(k));
    });
    return [change, layout];
  }

  function tellView() {
    document.getElementById("view").textContent =
      view[0].toFixed(2) + " – " + view[1].toFixed(2) + " s (" + (view[1] - view[0]).toFixed(2) + " s)";
  }

  function draw(range) {
    view = range;
    tellView();
    const [change, layout] = contents(range), all = Array.from(change.values());
    const update = { visible: Array.from(change.keys(), function (i) { return !isHidden(i); }) };
    for (const key of ["x", "y", "customdata"]) update[key] = all.map(function (c) { return c[key] || null; });
    return Plotly.update(plot, update, layout, Array.from(change.keys()));
  }

  function showAll() {
    for (const name of Object.keys(held)) delete held[name];
    inFull.clear();
    mark("", -1);
    return draw(whole.slice());
  }

  function onRelayout(change) {
    const range = change["xaxis.range"] || change["xaxis2.range"];
    let a = range ? range[0] : change["xaxis.range[0]"], b = range ? range[1] : change["xaxis.range[1]"];
    if (a === undefined) a = change["xaxis2.range[0]"];
    if (b === undefined) b = change["xaxis2.range[1]"];
    for (const name of Object.keys(change)) {
      const axis = /^(yaxis\d*)\.range/.exec(name);
      if (!axis) continue;
      held[axis[1]] = true;
      bars.tell(data.rows.findIndex(function (row) { return row.axis === axis[1]; }), [], true);
    }
    if (change["xaxis.autorange"] || change["xaxis2.autorange"]) { showAll(); return; }
    if (a !== undefined || b !== undefined) draw([a === undefined ? view[0] : +a, b === undefined ? view[1] : +b]);
  }

  // --- events -------------------------------------------------------------------------------------------------

  // Tables whose rows are spans of the drive. The arrows step through the one that the reader used last.
  const choices = {};
  for (const [id, spans] of Object.entries({ ...data.episodes, events: data.events })) {
    const table = document.getElementById(id);
    if (table) choices[id] = { body: table.tBodies[0], spans: spans };
  }
  let stepped = Object.keys(choices)[0];
  const eventTable = document.getElementById("events");
  const eventBody = eventTable ? eventTable.tBodies[0] : null;
  const PAGE = 200; // rows of a long table of events at a time
  // A long table is filled by its pages; `order` has the events that the search leaves, as they are sorted.
  const long = data.table ? { order: data.events.map(function (_, i) { return i; }), first: 0, words: null } : null;

  function mark(id, index) {
    selected = [id, index];
    for (const [name, choice] of Object.entries(choices)) {
      for (const row of choice.body.rows) {
        row.setAttribute("aria-selected", String(name === id && Number(row.dataset.row) === index));
      }
    }
  }

  function zoomTo(id, index, scroll) {
    const event = choices[id].spans[index];
    const margin = Math.max(1, 0.35 * (event[1] - event[0]));
    stepped = id;
    mark(id, index);
    for (const name of Object.keys(held)) delete held[name];
    if (plot) {
      draw([Math.max(whole[0], event[0] - margin), Math.min(whole[1], event[1] + margin)]);
      const bar = document.getElementById("toolbar").getBoundingClientRect();
      if (scroll && bar.top > 0.6 * window.innerHeight) document.getElementById("plot-section").scrollIntoView();
    }
  }

  function step(by) {
    const isLong = long && stepped === "events";
    const rows = choices[stepped].body.rows;
    const seen = Array.from(rows).filter(function (r) { return !r.hidden; });
    const order = isLong ? long.order : seen.map(function (r) { return Number(r.dataset.row); });
    if (!order.length) return;
    const at = selected[0] === stepped ? order.indexOf(selected[1]) : -1;
    const next = at < 0 ? (by > 0 ? 0 : order.length - 1) : (at + by + order.length) % order.length;
    if (isLong && (next < long.first || next >= long.first + PAGE)) fillEvents(next - next % PAGE);
    zoomTo(stepped, order[next], false);
  }

  for (const [id, choice] of Object.entries(choices)) {
    choice.body.addEventListener("click", function (e) {
      const row = e.target.closest("tr");
      if (row) zoomTo(id, Number(row.dataset.row), true);
    });
    choice.body.addEventListener("keydown", function (e) {
      const row = e.target.closest("tr");
      if (e.key === "Enter" || e.key === " ") { e.preventDefault(); zoomTo(id, Number(row.dataset.row), true); }
      const other = e.key === "ArrowDown" ? row.nextElementSibling : e.key === "ArrowUp" ? row.previousElementSibling : null;
      if (other) { e.preventDefault(); other.focus(); }
    });
  }

  // --- a long table of events ---------------------------------------------------------------------------------

  function make(tag, properties, ...children) {
    const element = Object.assign(document.createElement(tag), properties);
    element.append(...children);
    return element;
  }

  function minus(text) { return text.replace("-", "−"); }

  // Text of a cell and what it is sorted by, as the page has them in a short table.
  const columns = [
    function (i) { return [data.table.detectors[data.table.detector[i]]]; },
    function (i) { return [data.table.places[data.table.place[i]][0]]; },
    function (i) { return [minus(seconds(data.events[i][0])), data.events[i][0]]; },
    function (i) { return [minus(seconds(data.events[i][1])), data.events[i][1]]; },
    function (i) { const d = data.events[i][1] - data.events[i][0]; return [minus(seconds(d)), d]; },
    function (i) { return [data.table.severities[data.table.severity[i]]]; },
    function (i) { return [data.table.peak[i], data.table.ratio[i]]; },
    function (i) { return [data.table.speed[i] < 0 ? "–" : data.table.speed[i].toFixed(0), data.table.speed[i]]; },
    function (i) { return [data.table.evidence[i]]; },
  ];

  function eventRow(i) {
    const line = make("tr", { tabIndex: 0 });
    line.dataset.row = i;
    line.setAttribute("aria-selected", String(selected[0] === "events" && i === selected[1]));
    columns.forEach(function (column, c) {
      const text = column(i)[0], colour = c === 1 ? data.table.places[data.table.place[i]][1] : "";
      const isNumber = eventTable.tHead.rows[0].cells[c].classList.contains("num");
      const cell = make("td", { className: isNumber ? "num" : c === 8 ? "wide" : "" });
      if (colour) cell.append(make("i", { className: "dot" }));
      if (colour) cell.firstChild.style.background = colour;
      cell.append(c === 5 ? make("span", { className: "tag " + (text === "full" ? "full" : "partial"), textContent: text }) : text);
      line.append(cell);
    });
    return line;
  }

  function fillEvents(first, most) {
    const count = long.order.length, part = long.order.slice(first, first + (most || PAGE));
    long.first = first;
    eventBody.replaceChildren(...part.map(eventRow));
    eventTable.parentNode.scrollTop = 0;
    document.getElementById("events-count").textContent = count
      ? `${first + 1}–${first + part.length} of ${count}` + (count < data.events.length ? ` found among ${data.events.length}` : "")
      : "no event";
    document.getElementById("events-back").disabled = first === 0;
    document.getElementById("events-on").disabled = first + part.length >= count;
  }

  function orderEvents() {
    stepped = "events";
    const words = document.getElementById("events-search").value.trim().toLowerCase().split(/\s+/);
    long.words = long.words || data.events.map(function (_, i) {
      return columns.map(function (column) { return column(i)[0]; }).join(" ").toLowerCase();
    });
    const found = data.events.map(function (_, i) { return i; }).filter(function (i) {
      return isWanted(i) && words.every(function (word) { return long.words[i].includes(word); });
    });
    const heads = Array.from(eventTable.tHead.rows[0].cells);
    const column = heads.findIndex(function (head) { return head.hasAttribute("aria-sort"); });
    if (column >= 0) {
      const sign = heads[column].getAttribute("aria-sort") === "ascending" ? 1 : -1;
      const keys = data.events.map(function (_, i) { const c = columns[column](i); return c.length > 1 ? c[1] : c[0]; });
      const compare = heads[column].classList.contains("num")
        ? function (p, q) { return keys[p] - keys[q]; } : function (p, q) { return collator.compare(keys[p], keys[q]); };
      found.sort(function (p, q) { return sign * compare(p, q); });
    }
    long.order = found;
    fillEvents(0);
  }

  if (long) {
    document.getElementById("events-search").addEventListener("input", orderEvents);
    document.getElementById("events-back").addEventListener("click", function () { fillEvents(long.first - PAGE); });
    document.getElementById("events-on").addEventListener("click", function () { fillEvents(long.first + PAGE); });
    document.getElementById("events-controls").hidden = false;
    fillEvents(0);
    let first = 0;
    window.addEventListener("beforeprint", function () { first = long.first; fillEvents(0, Infinity); });
    window.addEventListener("afterprint", function () { fillEvents(first); });
  }

  // --- filters ------------------------------------------------------------------------------------------------

  if (eventBody) {
    const rows = Array.from(eventBody.rows).sort(function (p, q) { return p.dataset.row - q.dataset.row; });
    const texts = function (i) {
      const cells = [0, 1, 8];
      if (long) return cells.map(function (c) { return columns[c](i)[0]; });
      return cells.map(function (c) { return rows[i].cells[c].textContent.trim(); });
    };
    isWanted = eventFilters(eventTable, data.events.length, texts, function () {
      if (long) orderEvents();
      else for (const row of rows) row.hidden = !isWanted(Number(row.dataset.row));
      shades = allShades();
      if (plot) draw(view);
    });
  }

  // --- sorting ------------------------------------------------------------------------------------------------

  function sortBy(table, head, column) {
    const down = head.getAttribute("aria-sort") === "ascending";
    for (const other of head.parentNode.cells) other.removeAttribute("aria-sort");
    head.setAttribute("aria-sort", down ? "descending" : "ascending");
    if (long && table === eventTable) { orderEvents(); return; }
    if (choices[table.id]) stepped = table.id;
    const body = table.tBodies[0];
    const key = function (row) { return row.cells[column].dataset.key; };
    const isNumber = head.classList.contains("num");
    const sorted = Array.from(body.rows).sort(function (p, q) {
      const order = isNumber ? Number(key(p)) - Number(key(q)) : collator.compare(key(p), key(q));
      return down ? -order : order;
    });
    body.append(...sorted);
  }

  for (const table of document.querySelectorAll("table.sortable")) {
    Array.from(table.tHead.rows[0].cells).forEach(function (head, column) {
      head.tabIndex = 0;
      head.addEventListener("click", function () { sortBy(table, head, column); });
      head.addEventListener("keydown", function (e) {
        if (e.key === "Enter" || e.key === " ") { e.preventDefault(); sortBy(table, head, column); }
      });
    });
  }

  if (!plot) { document.body.dataset.ready = "true"; return; }

  // --- start --------------------------------------------------------------------------------------------------

  let shapes = [];

  function build(width) {
    const figure = coloured(data.figure);
    shapes = figure.layout.shapes;
    if ((width || plot.clientWidth) < NARROW) makeNarrow(figure.layout, data.rows);
    figure.data.forEach(function (trace) { trace.visible = !hidden.has(trace.legendgroup); });
    tellView();
    const [change, layout] = contents(view);
    change.forEach(function (values, i) { Object.assign(figure.data[i], values); });
    for (const axis of Object.keys(held)) layout[axis + ".range"] = plot.layout[axis].range.slice();
    for (const [key, value] of Object.entries(layout)) {
      const [axis, range] = key.split(".");
      if (range) figure.layout[axis].range = value;
      else figure.layout[axis] = value;
    }
    const config = {
      ...plotConfig, doubleClick: false, displayModeBar: plot.clientWidth < NARROW ? false : "hover",
      modeBarButtonsToRemove: ["select2d", "lasso2d", "autoScale2d", "resetScale2d"],
    };
    return paint(plot, figure.data, figure.layout, config, width);
  }

  for (const button of document.querySelectorAll(".toggle")) {
    button.addEventListener("click", function () {
      const group = button.dataset.group, show = hidden.has(group);
      if (show) hidden.delete(group); else hidden.add(group);
      button.setAttribute("aria-pressed", String(show));
      draw(view);
    });
  }
  document.getElementById("show-all").addEventListener("click", showAll);
  for (const [id, by] of [["previous", -1], ["next", 1]]) {
    const button = document.getElementById(id);
    if (button) button.addEventListener("click", function () { step(by); });
  }

  // Values of a panel's lines at a time, with their colours.
  function valuesAt(k, x) {
    return lines.flatMap(function (line, i) {
      if (line.row !== k || isHidden(i) || !line.t.length) return [];
      const after = Math.min(firstAtOrAfter(line.t, x), line.t.length - 1), before = Math.max(0, after - 1);
      return [[traces[i], line.y[x - line.t[before] < line.t[after] - x ? before : after]]];
    });
  }

  bars = panelBars(plot, data.rows, {
    values: valuesAt,
    zoom: function (k, factor) {
      const axis = data.rows[k].axis, [low, high] = plot.layout[axis].range;
      const middle = low <= 0 && high > 0 ? 0 : 0.5 * (low + high);
      Plotly.relayout(plot, { [axis + ".range"]: [middle + (low - middle) * factor, middle + (high - middle) * factor] });
    },
    fit: function (k) {
      const isFree = inFull.has(k) || held[data.rows[k].axis];
      delete held[data.rows[k].axis];
      if (isFree) inFull.delete(k); else inFull.add(k);
      draw(view);
    },
  });

  const route = document.getElementById("route");
  if (route) figuresDrawn.then(function () {
    route.on("plotly_click", function (e) {
      const found = e.points.map(function (p) { return p.customdata; }).find(function (c) { return c && choices[c[0]]; });
      if (found) zoomTo(found[0], found[1], true);
    });
  });

  build().then(function () {
    bars.place();
    plot.on("plotly_hover", function (e) { bars.show(e.xvals[0]); });
    plot.on("plotly_unhover", function () { bars.show(null); });
    plot.on("plotly_relayout", onRelayout);
    plot.on("plotly_doubleclick", showAll);
    plot.dataset.ready = document.body.dataset.ready = "true";
  });
  const sheets = document.createElement("div");
  sheets.id = "sheets";
  plot.after(sheets);
  let wasNarrow = plot.clientWidth < NARROW;
  window.addEventListener("resize", function () {
    if (plot.clientWidth < NARROW === wasNarrow || isOnPaper) return;
    wasNarrow = !wasNarrow;
    build().then(bars.place);
  });
  redrawn(function (width) {
    build(width);
    sheets.replaceChildren(...(width ? cutUp(plot, data.rows) : []));
  });
})();
