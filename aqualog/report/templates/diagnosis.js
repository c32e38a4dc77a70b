// Residual channels before and after: one panel a channel, all over the same coordinate.
(function () {
  const D = JSON.parse(document.getElementById("view-data").textContent);
  const box = document.getElementById("views");
  if (!box || !D.coordinates.length) { document.body.dataset.views = "ready"; return; }
  const BEFORE = "#D55E00", AFTER = "#0072B2", HEIGHT = 250; // [px]
  const config = { ...plotConfig, modeBarButtonsToRemove: ["select2d", "lasso2d"] };
  const now = { coordinate: D.start, drive: 0, raw: true };
  const byId = function (id) { return document.getElementById(id); };
  const stale = new Set();
  let panels = [], paperWidth;

  function see(colour, opacity) {
    const n = parseInt(colour.slice(1), 16);
    return `rgba(${n >> 16},${(n >> 8) & 255},${n & 255},${opacity})`;
  }

  function axis(title) {
    return {
      title: { text: title, font: { size: 12 } }, gridcolor: "rgba(128,128,128,0.22)", zerolinecolor: "@muted",
      linecolor: "@muted", tickcolor: "@muted", tickfont: { size: 11 }, automargin: true,
    };
  }

  // Bins without enough samples leave a gap in line and band.
  function band(x, low, high, colour) {
    const bx = [], by = [];
    let part = [];
    const close = function () {
      if (part.length > 1) {
        const back = part.slice().reverse();
        bx.push(...part.map(function (i) { return x[i]; }), ...back.map(function (i) { return x[i]; }), null);
        by.push(...part.map(function (i) { return high[i]; }), ...back.map(function (i) { return low[i]; }), null);
      }
      part = [];
    };
    x.forEach(function (_, i) { if (low[i] === null) close(); else part.push(i); });
    close();
    return { type: "scatter", mode: "none", x: bx, y: by, fill: "toself", fillcolor: see(colour, 0.2), hoverinfo: "skip" };
  }

  function traces(view, coordinate, isLine) {
    const x = D.tables[view.coordinates][coordinate], bins = view.bins[coordinate], data = [];
    if (!x) return data;
    const both = [["before", view.before, BEFORE, 1]];
    if (view.after) both.push(["after", view.after, AFTER, 2]);
    if (now.raw) for (const [, y, colour] of both) {
      data.push(isLine
        ? { type: "scatter", mode: "lines", x: x, y: y, line: { color: see(colour, 0.35), width: 0.7 }, hoverinfo: "skip", meta: "raw" }
        : { type: "scatter", mode: "markers", x: x, y: y, marker: { color: see(colour, 0.28), size: x.length > 400 ? 2.5 : 6 }, hoverinfo: "skip", meta: "raw" });
    }
    if (bins) for (const [, , colour, i] of both) if (bins[i]) data.push(band(bins[0], bins[i][1], bins[i][2], colour));
    if (bins) for (const [name, , colour, i] of both) if (bins[i]) {
      data.push({
        type: "scatter", mode: "lines+markers", x: bins[0], y: bins[i][0], name: name, meta: "median",
        line: { color: colour, width: 2 }, marker: { color: colour, size: isLine ? 0.1 : 4 },
        hovertemplate: `%{y:.3g} ${view.unit}<extra>${name}</extra>`,
      });
    }
    return data;
  }

  function draw(panel) {
    stale.delete(panel);
    const view = panel.view, chosen = D.coordinates.find(function (c) { return c[0] === now.coordinate; });
    const y = axis("");
    if (view.limits) y.range = view.limits;
    const layout = {
      title: { text: view.title, font: { size: 13 }, x: 0.01, y: 0.985, yanchor: "top" }, showlegend: false,
      font: { color: "@ink", size: 12, family: 'system-ui, "Segoe UI", Helvetica, Arial, sans-serif' },
      paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)", height: HEIGHT,
      margin: { l: 48, r: 12, t: 30, b: 42 }, hovermode: "x",
      modebar: { bgcolor: "rgba(0,0,0,0)", color: "@muted", activecolor: "@ink" },
      xaxis: axis(chosen[1]), yaxis: y,
    };
    return paint(panel.node, traces(view, now.coordinate, chosen[2]), coloured(layout), config, paperWidth);
  }

  const seen = new IntersectionObserver(function (entries) {
    for (const e of entries) {
      const panel = panels.find(function (p) { return p.node === e.target; });
      if (e.isIntersecting && panel && stale.has(panel)) draw(panel);
    }
  }, { rootMargin: "300px" });

  function lay() {
    for (const p of panels) { seen.unobserve(p.node); if (p.node.data) Plotly.purge(p.node); }
    const own = D.views.filter(function (v) { return v.drive === now.drive; });
    panels = own.map(function (view) {
      const node = document.createElement("div");
      node.style.height = HEIGHT + "px";
      return { view: view, node: node };
    });
    box.replaceChildren(...panels.map(function (p) { return p.node; }));
    byId("after-key").hidden = !own.some(function (v) { return v.after; });
    const steps = [...new Set(own.map(function (v) { return v.every_s; }).filter(Boolean))].sort(function (a, b) { return a - b; });
    byId("views-note").textContent = (steps.length ? `Samples: one every ${steps.join(" / ")} s; medians and bands are of all. ` : "") +
      "Axes leave out the outermost 0.3 %; double click shows all.";
    update();
  }

  function update() {
    for (const button of byId("coordinate-choice").children) {
      button.setAttribute("aria-pressed", String(button.value === now.coordinate));
    }
    for (const p of panels) {
      stale.add(p);
      seen.unobserve(p.node);
      seen.observe(p.node);
    }
    document.body.dataset.views = "ready";
  }

  for (const [name, title] of D.coordinates) {
    const button = document.createElement("button");
    button.type = "button";
    button.value = name;
    button.textContent = title.replace(/ \[.*$/, "");
    button.addEventListener("click", function () { now.coordinate = name; update(); });
    byId("coordinate-choice").append(button);
  }
  D.drives.forEach(function (name, i) { byId("drive-choice").append(new Option(name, String(i))); });
  byId("drive-choice").hidden = D.drives.length < 2;
  byId("drive-choice").addEventListener("change", function (e) { now.drive = Number(e.target.value); lay(); });
  byId("raw-choice").addEventListener("change", function (e) { now.raw = e.target.checked; update(); });
  lay();
  redrawn(function (width) {
    paperWidth = width;
    if (width) panels.forEach(draw);
    else update();
  });
})();
