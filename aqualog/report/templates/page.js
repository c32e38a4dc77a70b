"use strict";
(function () {
  const data = JSON.parse(document.getElementById("drive-data").textContent);
  const plot = document.getElementById("plots");
  const POINTS = 3000; // per line in view: about two per pixel

  // --- samples ------------------------------------------------------------------------------------------------

  function bytes(base64) {
    const text = atob(base64);
    const out = new Uint8Array(text.length);
    for (let i = 0; i < text.length; i++) out[i] = text.charCodeAt(i);
    return out.buffer;
  }

  // Minima and maxima outside the windows and every sample inside them, in order of time.
  function unpack(line) {
    const full = new Float32Array(bytes(line.full));
    const index = new Uint32Array(bytes(line.index));
    const value = new Float32Array(bytes(line.value));
    const t = new Float64Array(full.length + index.length);
    const y = new Float32Array(t.length);
    let n = 0, k = 0, f = 0;
    const takeUntil = function (end) {
      for (; k < index.length && index[k] < end; k++, n++) { t[n] = index[k] * data.dt; y[n] = value[k]; }
    };
    for (const [begin, end] of data.windows) {
      takeUntil(begin);
      for (let i = begin; i < end; i++, n++) { t[n] = i * data.dt; y[n] = full[f++]; }
    }
    takeUntil(Infinity);
    return { t: t, y: y, row: line.row };
  }

  function firstAtOrAfter(t, x) {
    let a = 0, b = t.length;
    while (a < b) { const m = (a + b) >> 1; if (t[m] < x) a = m + 1; else b = m; }
    return a;
  }

  // Samples from index a to b, or first, least, greatest, last and a gap of each of as many stretches as are visible.
  function picked(line, a, b) {
    const x = [], y = [];
    const take = function (i) { x.push(line.t[i]); y.push(Number.isNaN(line.y[i]) ? null : line.y[i]); };
    if (b - a <= POINTS) { for (let i = a; i < b; i++) take(i); return [x, y]; }
    const stretches = POINTS / 4;
    for (let s = 0; s < stretches; s++) {
      const from = a + Math.floor((b - a) * s / stretches), to = a + Math.floor((b - a) * (s + 1) / stretches);
      let low = -1, high = -1, gap = -1;
      for (let i = from; i < to; i++) {
        const v = line.y[i];
        if (Number.isNaN(v)) { if (gap < 0) gap = i; continue; }
        if (low < 0 || v < line.y[low]) low = i;
        if (high < 0 || v > line.y[high]) high = i;
      }
      const chosen = [from, low, high, gap, to - 1].filter(function (i) { return i >= 0; });
      chosen.sort(function (p, q) { return p - q; });
      chosen.forEach(function (i, j) { if (j === 0 || i !== chosen[j - 1]) take(i); });
    }
    return [x, y];
  }

  // --- lanes --------------------------------------------------------------------------------------------------

  const traces = data.figure ? data.figure.data : [];
  const lanes = traces.filter(function (trace) { return trace.type === "bar"; });
  const laneHover = traces.findIndex(function (trace) { return trace.meta === "lanes"; });

  // What is on in each of some hundred slices of the view; a slice takes in everything that touches it.
  function slices(range) {
    const count = 400, width = (range[1] - range[0]) / count;
    const shown = lanes.filter(function (lane) { return !hidden.has(lane.legendgroup); });
    const next = shown.map(function () { return 0; });
    const x = [], y = [], text = [];
    for (let s = 0; s < count; s++) {
      const from = range[0] + s * width, to = from + width, on = [];
      shown.forEach(function (lane, i) {
        while (next[i] < lane.x.length && lane.base[next[i]] + lane.x[next[i]] <= from) next[i]++;
        let last = next[i];
        while (last < lane.x.length && lane.base[last] < to) last++;
        const found = last - next[i];
        if (found > 0) on.push(lane.name + ": " + (found > 1 ? found + " detections" : lane.customdata[next[i]]));
      });
      x.push(from + 0.5 * width);
      y.push(1);
      text.push(on.join("<br>") || "all clear");
    }
    return { x: x, y: y, customdata: text };
  }

  // --- view ---------------------------------------------------------------------------------------------------

  const whole = [0, Math.max(data.n || 0, 1) * (data.dt || 1)];
  const lines = (data.lines || []).map(unpack);
  const lineIndices = lines.map(function (_, i) { return i; });
  const hidden = new Set();
  const held = {}; // y axes that the user has scaled, until "show all"
  let view = whole.slice();
  let selected = -1;

  function isHidden(i) { return hidden.has(data.figure.data[i].legendgroup); }

  function valueRange(k, range) {
    let low = Infinity, high = -Infinity;
    lines.forEach(function (line, i) {
      if (line.row !== k || isHidden(i)) return;
      const a = Math.max(0, firstAtOrAfter(line.t, range[0]) - 1);
      const b = Math.min(line.t.length, firstAtOrAfter(line.t, range[1]) + 1);
      for (let j = a; j < b; j++) {
        const v = line.y[j];
        if (v < low) low = v;
        if (v > high) high = v;
      }
    });
    if (low > high) { low = 0; high = 0; }
    for (const v of data.rows[k].include) { low = Math.min(low, v); high = Math.max(high, v); }
    const short = 0.5 * (data.rows[k].least_span - (high - low));
    if (short > 0) { low -= short; high += short; }
    const span = high - low || Math.max(1, Math.abs(high)) * 0.1;
    return [low - 0.06 * span, high + 0.1 * span];
  }

  function selectionShape() {
    if (selected < 0) return [];
    const event = data.events[selected];
    return [{
      type: "rect", xref: "x", x0: event[0], x1: event[1], yref: "paper", y0: 0, y1: 1, layer: "above",
      fillcolor: "rgba(0,0,0,0)", line: { width: 1.5, color: colours()["@accent"], dash: "dot" },
    }];
  }

  function draw(range) {
    view = range;
    const width = range[1] - range[0];
    const xs = [], ys = [];
    for (const line of lines) {
      // half a view more on both sides, so that panning does not pull in blank paper
      const a = Math.max(0, firstAtOrAfter(line.t, range[0] - 0.5 * width) - 1);
      const b = Math.min(line.t.length, firstAtOrAfter(line.t, range[1] + 0.5 * width) + 1);
      const xy = picked(line, a, b);
      xs.push(xy[0]);
      ys.push(xy[1]);
    }
    const layout = { "xaxis.range": range.slice(), "xaxis2.range": range.slice(), shapes: shapes.concat(selectionShape()) };
    data.rows.forEach(function (row, k) {
      if (row.has_lines && !held[row.axis]) layout[row.axis + ".range"] = valueRange(k, range);
    });
    document.getElementById("view").textContent =
      range[0].toFixed(2) + " – " + range[1].toFixed(2) + " s (" + width.toFixed(2) + " s)";
    const change = { x: xs, y: ys }, indices = lineIndices.slice();
    if (laneHover >= 0) {
      const hover = slices(range);
      change.customdata = lines.map(function () { return null; }).concat([hover.customdata]);
      xs.push(hover.x);
      ys.push(hover.y);
      indices.push(laneHover);
    }
    return Plotly.update(plot, change, layout, indices);
  }

  function showAll() {
    for (const name of Object.keys(held)) delete held[name];
    mark(-1);
    return draw(whole.slice());
  }

  function onRelayout(change) {
    const range = change["xaxis.range"] || change["xaxis2.range"];
    let a = range ? range[0] : change["xaxis.range[0]"], b = range ? range[1] : change["xaxis.range[1]"];
    if (a === undefined) a = change["xaxis2.range[0]"];
    if (b === undefined) b = change["xaxis2.range[1]"];
    for (const name of Object.keys(change)) {
      const axis = /^(yaxis\d*)\.range/.exec(name);
      if (axis) held[axis[1]] = true;
    }
    if (change["xaxis.autorange"] || change["xaxis2.autorange"]) { showAll(); return; }
    if (a !== undefined || b !== undefined) draw([a === undefined ? view[0] : +a, b === undefined ? view[1] : +b]);
  }

  // --- events -------------------------------------------------------------------------------------------------

  const rows = Array.from(document.querySelectorAll("#events tbody tr"));

  function mark(index) {
    selected = index;
    for (const row of rows) row.setAttribute("aria-selected", String(Number(row.dataset.event) === index));
  }

  function zoomTo(index, scroll) {
    const event = data.events[index];
    const margin = Math.max(1, 0.35 * (event[1] - event[0]));
    mark(index);
    for (const name of Object.keys(held)) delete held[name];
    if (plot) {
      draw([Math.max(whole[0], event[0] - margin), Math.min(whole[1], event[1] + margin)]);
      const bar = document.getElementById("toolbar").getBoundingClientRect();
      if (scroll && bar.top > 0.6 * window.innerHeight) document.getElementById("plot-section").scrollIntoView();
    }
  }

  function step(by) {
    const order = Array.from(document.querySelectorAll("#events tbody tr")).map(function (r) { return Number(r.dataset.event); });
    const at = order.indexOf(selected);
    const next = at < 0 ? (by > 0 ? 0 : order.length - 1) : (at + by + order.length) % order.length;
    zoomTo(order[next], false);
  }

  for (const row of rows) {
    row.addEventListener("click", function () { zoomTo(Number(row.dataset.event), true); });
    row.addEventListener("keydown", function (e) {
      if (e.key === "Enter" || e.key === " ") { e.preventDefault(); zoomTo(Number(row.dataset.event), true); }
      const other = e.key === "ArrowDown" ? row.nextElementSibling : e.key === "ArrowUp" ? row.previousElementSibling : null;
      if (other) { e.preventDefault(); other.focus(); }
    });
  }

  // --- sorting ------------------------------------------------------------------------------------------------

  function sortBy(table, head, column) {
    const down = head.getAttribute("aria-sort") === "ascending";
    const body = table.tBodies[0];
    const key = function (row) { return row.cells[column].dataset.key; };
    const isNumber = head.classList.contains("num");
    const sorted = Array.from(body.rows).sort(function (p, q) {
      const order = isNumber ? Number(key(p)) - Number(key(q)) : key(p).localeCompare(key(q), "en");
      return down ? -order : order;
    });
    for (const other of head.parentNode.cells) other.removeAttribute("aria-sort");
    head.setAttribute("aria-sort", down ? "descending" : "ascending");
    body.append.apply(body, sorted);
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

  if (!plot) return;

  // --- colours ------------------------------------------------------------------------------------------------

  function colours() {
    const style = getComputedStyle(document.documentElement);
    const get = function (name) { return style.getPropertyValue(name).trim(); };
    return { "@ink": get("--ink"), "@muted": get("--muted"), "@paper": get("--paper"), "@accent": get("--accent") };
  }

  function coloured(value) {
    const known = colours();
    return JSON.parse(JSON.stringify(value), function (_, v) {
      return typeof v === "string" && Object.hasOwn(known, v) ? known[v] : v;
    });
  }

  // --- start --------------------------------------------------------------------------------------------------

  let shapes = [];

  const PRINT_WIDTH = 700; // [px] inside the margins of A4 and Letter

  function build(width) {
    const figure = coloured(data.figure);
    shapes = figure.layout.shapes;
    if (width) figure.layout.width = width;
    figure.data.forEach(function (trace) { trace.visible = !hidden.has(trace.legendgroup); });
    const config = {
      displaylogo: false, responsive: true, doubleClick: false, showTips: false, plotlyServerURL: "",
      showSendToCloud: false, showEditInChartStudio: false,
      modeBarButtonsToRemove: ["select2d", "lasso2d", "autoScale2d", "resetScale2d"],
    };
    return Plotly.react(plot, figure.data, figure.layout, config).then(function () { return draw(view); });
  }

  for (const button of document.querySelectorAll(".toggle")) {
    button.addEventListener("click", function () {
      const group = button.dataset.group, show = hidden.has(group);
      if (show) hidden.delete(group); else hidden.add(group);
      button.setAttribute("aria-pressed", String(show));
      const indices = [];
      data.figure.data.forEach(function (trace, i) { if (trace.legendgroup === group) indices.push(i); });
      Plotly.restyle(plot, { visible: show }, indices).then(function () { draw(view); });
    });
  }
  document.getElementById("show-all").addEventListener("click", showAll);
  for (const [id, by] of [["previous", -1], ["next", 1]]) {
    const button = document.getElementById(id);
    if (button) button.addEventListener("click", function () { step(by); });
  }

  build().then(function () {
    plot.on("plotly_relayout", onRelayout);
    plot.on("plotly_doubleclick", showAll);
    plot.dataset.ready = "true";
  });
  window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", function () { build(); });
  window.addEventListener("beforeprint", function () { build(PRINT_WIDTH); });
  // without a width plotly keeps the last one until it is told to measure again
  window.addEventListener("afterprint", function () { build().then(function () { Plotly.Plots.resize(plot); }); });
})();
