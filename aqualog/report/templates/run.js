const D = JSON.parse(document.getElementById("run-data").textContent);
const ROWS = [
  ["speed", "speed [km/h]", 3], ["slip", "slip extremes [%]", 2.2], ["traction", "traction [–]", 1.8],
  ["resistance", "resistance [m/s²]", 1.8], ["events", "events", 0],
];
const GAP = 0.03;

function line(row, name, wheel, x, y, extra) {
  const colour = D.colours[wheel] || "@ink";
  return Object.assign({
    type: "scatter", mode: "lines", x: x, y: y, name: name, legendgroup: wheel || "vehicle", yaxis: row,
    line: { color: colour, width: wheel ? 1.3 : 2 }, hovertemplate: "%{y}<extra>%{fullData.name}</extra>",
  }, extra);
}

function build() {
  const lanes = [...new Set(D.events.map(function (e) { return e[2]; }))].sort();
  const shown = ROWS.filter(function (r) {
    if (r[0] === "events") return lanes.length;
    return (r[0] === "slip" ? D.lines.low.concat(D.lines.high) : D.lines[r[0]]).length;
  });
  const weights = shown.map(function (r) { return r[2] || 0.5 + 0.22 * lanes.length; });
  const total = weights.reduce(function (a, b) { return a + b; }, 0);
  const data = [], legend = new Set();
  const layout = {
    font: { color: "@ink", size: 12, family: 'system-ui, "Segoe UI", Helvetica, Arial, sans-serif' },
    paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)", height: 120 + 84 * total, hovermode: "x unified",
    margin: { l: 130, r: 16, t: 30, b: 46 }, legend: { orientation: "h", x: 0, y: 1.0, yanchor: "bottom" },
    modebar: { bgcolor: "rgba(0,0,0,0)", color: "@muted", activecolor: "@ink" }, shapes: [],
    hoverlabel: { bgcolor: "@paper", font: { color: "@ink" } },
    xaxis: { title: { text: "time [s]" }, gridcolor: "rgba(128,128,128,0.22)", zeroline: false, linecolor: "@muted",
      tickcolor: "@muted", anchor: "y" + (shown.length > 1 ? shown.length : "") },
  };
  let top = 1;
  shown.forEach(function ([kind, title], n) {
    const name = n ? `y${n + 1}` : "y", height = (1 - GAP * (shown.length - 1)) * weights[n] / total;
    layout[n ? `yaxis${n + 1}` : "yaxis"] = {
      title: { text: title, font: { size: 11 } }, domain: [Math.max(0, top - height), top], gridcolor: "rgba(128,128,128,0.22)",
      zerolinecolor: "@muted", tickfont: { size: 10 },
    };
    const axis = layout[n ? `yaxis${n + 1}` : "yaxis"];
    top -= height + GAP;
    const add = function (t) {
      t.showlegend = !legend.has(t.legendgroup);
      legend.add(t.legendgroup);
      data.push(t);
    };
    if (kind === "events") {
      axis.tickvals = lanes.map(function (_, i) { return i; });
      axis.ticktext = lanes.map(plotText);
      axis.range = [lanes.length - 0.5, -0.5];
      axis.title.text = "";
      for (const e of D.events) data.push({
        type: "scatter", mode: "lines+markers", x: [e[0], Math.max(e[1], e[0] + 0.02)], yaxis: name, showlegend: false,
        y: [lanes.indexOf(e[2]), lanes.indexOf(e[2])], line: { color: e[3], width: 9 },
        marker: { color: e[3], size: 5, symbol: "square" }, name: plotText(e[2]),
        hovertemplate: `${e[0].toFixed(2)} – ${e[1].toFixed(2)} s, ${plotText(e[4])}<extra>${plotText(e[2])}</extra>`,
      });
    } else if (kind === "slip") {
      for (const part of ["low", "high"]) for (const l of D.lines[part]) add(line(name, l[0], l[1], D.t, l[2]));
    } else for (const l of D.lines[kind]) add(line(name, kind === "resistance" ? "vehicle" : l[0] === "v_x" ? "v_x" : l[0], l[1], D.t, l[2]));
  });
  for (const [a, b] of D.lane) layout.shapes.push({
    type: "rect", xref: "x", yref: "paper", x0: a, x1: b, y0: 0, y1: 1, line: { width: 0 },
    fillcolor: "rgba(58,155,220,0.13)", layer: "below",
  });
  return [data, layout];
}

function draw(width) {
  const plot = document.getElementById("plots");
  if (plot) {
    const [data, layout] = build();
    return paint(plot, coloured(data), coloured(layout), sharedConfig, width).then(function () {
      document.body.dataset.ready = "true";
    });
  }
  document.body.dataset.ready = "true";
}

withPlotly(draw);
redrawn(function (width) { if (window.Plotly) draw(width); });
