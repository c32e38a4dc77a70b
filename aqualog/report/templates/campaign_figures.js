// Figures over speed: one panel per configuration without the key that the colours stand for.
const COLOURS = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#7F6BB3", "#8C6D31"];
const RIGHT = ["rr", "fr", "right"]; // thin with diamonds; else thick with dots
const DASH_NAMES = { rr: "┈┈┈", right: "┈┈┈", fl: "━ ━", fr: "━ ┈" };
const WAYS = {
  slip_slope: ["from the slip slope", "#0072B2", "circle"],
  minor_spin_down: ["from minor spin-downs", "#009E73", "square"],
  spin_down: ["from spin-downs", "#D55E00", "diamond"],
  margin: ["foretold", "#CC79A7", "cross"],
};
const FEW = 9; // panels that are drawn without being asked for
const drawn = new Map(); // id -> function that draws it
const stale = new Set();
let observer = null, colourKey = -1, paperWidth;
const all = { slopes: false, resistance: false };

function see(colour, opacity) {
  const n = parseInt(colour.slice(1), 16);
  return `rgba(${n >> 16},${(n >> 8) & 255},${n & 255},${opacity})`;
}

function axis(title, range) {
  const a = {
    title: { text: title, font: { size: 12 } }, gridcolor: "rgba(128,128,128,0.22)", zerolinecolor: "@muted",
    linecolor: "@muted", tickcolor: "@muted", tickfont: { size: 11 }, automargin: true,
  };
  if (range) a.range = range;
  return a;
}

function layout(title, x, y, height) {
  return {
    title: { text: plotText(title), font: { size: 13 }, x: 0.01, y: 0.985, yanchor: "top" }, showlegend: true,
    font: { color: "@ink", size: 12, family: 'system-ui, "Segoe UI", Helvetica, Arial, sans-serif' },
    paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)", height: height,
    margin: { l: 56, r: 14, t: 34, b: 46 }, hovermode: "closest",
    legend: { orientation: "h", x: 0, y: -0.2, yanchor: "top", font: { size: 11 } },
    modebar: { bgcolor: "rgba(0,0,0,0)", color: "@muted", activecolor: "@ink" }, xaxis: x, yaxis: y,
  };
}

function show(id, data, lay) { return paint(byId(id), coloured(data), coloured(lay), sharedConfig, paperWidth); }

// Drawn when it comes into view: a campaign has more panels than a screen. Its height is kept free, so that nothing moves.
function later(id, height, draw) {
  byId(id).style.height = height + "px";
  drawn.set(id, draw);
  stale.add(id);
  if (observer) {
    observer.unobserve(byId(id));
    observer.observe(byId(id));
  }
}

function drawNow(id) {
  if (!stale.delete(id) || !drawn.has(id) || !byId(id)) return;
  drawn.get(id)();
}

function startFigures() {
  observer = new IntersectionObserver(function (entries) {
    for (const e of entries) if (e.isIntersecting) drawNow(e.target.id);
  }, { rootMargin: "400px" });
  for (const id of stale) observer.observe(byId(id));
  redrawn(function (width) {
    paperWidth = width;
    for (const [id, draw] of drawn) {
      if (width) draw();
      else later(id, byId(id).clientHeight, draw);
      if (width) stale.delete(id);
    }
  });
}

function isTold(curve) { return curve[2].some(function (p) { return p[3] !== null; }); }

function curvesShown(kind) {
  return D[kind].filter(function (c) { return now.groups.has(c[0]) && isPlaceShown(c[1]); });
}

function panelName(g) {
  const last = function (k) { return facets[k].key === "vehicle"; };
  const keys = D.keys.filter(function (k) { return k !== colourKey; }).sort(function (a, b) { return last(a) - last(b); });
  const parts = keys.map(function (k) {
    const v = D.groups[g][1][k];
    return v < 0 ? "" : facets[k].values[v];
  });
  return parts.filter(function (p) { return p && !p.startsWith("0 kg"); }).join(" · ") || "all runs";
}

function colourOf(g) {
  const v = colourKey < 0 ? 0 : Math.max(0, D.groups[g][1][colourKey]);
  return COLOURS[v % COLOURS.length];
}

function colourName(g) {
  return colourKey < 0 || D.groups[g][1][colourKey] < 0 ? "" : facets[colourKey].values[D.groups[g][1][colourKey]];
}

// What has an interval sets the scale, so that a slope of two runs at the limit of estimation does not.
function largest(curves, level) {
  const of = function (isSure) {
    return curves.flatMap(function (c) {
      return c[2].filter(function (p) { return p[3] !== null && (!isSure || p[4] !== null); }).map(function (p) { return p[3]; });
    });
  };
  const sure = of(true), values = (sure.length ? sure : of(false)).concat(curves.map(function (c) { return c[3] ?? 0; }));
  const tops = curves.flatMap(function (c) { return c[2].map(function (p) { return p[5] ?? 0; }); });
  const top = Math.max(level ?? 0, ...values);
  if (D.is_dry) return Math.max(top, ...tops); // around zero
  return Math.min(1.3 * top, Math.max(top, ...tops)) || 1;
}

function speeds(curves) {
  const low = Math.min(...curves.flatMap(function (c) { return c[2].map(function (p) { return p[0]; }); }));
  const high = Math.max(...curves.flatMap(function (c) { return c[2].map(function (p) { return p[1]; }); }));
  return [low - 2, high + 2];
}

function band(points) {
  const x = [], y = [];
  let part = [];
  function close() {
    if (part.length > 1) {
      x.push(...part.map(function (p) { return p[2]; }), ...part.map(function (p) { return p[2]; }).reverse(), null);
      y.push(...part.map(function (p) { return p[5]; }), ...part.map(function (p) { return p[4]; }).reverse(), null);
    }
    part = [];
  }
  for (const p of points) {
    if (p[4] === null || p[5] === null) close();
    else part.push(p);
  }
  close();
  return [x, y];
}

function digits(v) { return v === null ? "–" : Math.abs(v) >= 10 ? v.toFixed(1) : v.toFixed(3); }

function tracesOf(curve, unit, colourText, isFirst) {
  const [g, place, points] = curve, colour = colourOf(g), told = points.filter(function (p) { return p[3] !== null; });
  const name = plotText([colourText, placeName(place)].filter(Boolean).join(" ") || "mean"), id = plotText(colourText);
  const isRight = RIGHT.includes(place), dot = isRight ? "diamond" : "circle";
  const [bx, by] = band(told);
  const traces = [{
    type: "scatter", mode: "none", x: bx, y: by, fill: "toself", fillcolor: see(colour, 0.16), hoverinfo: "skip",
    showlegend: false, legendgroup: id,
  }, {
    type: "scatter", mode: "lines+markers", name: plotText(colourText), legendgroup: id, meta: "values",
    showlegend: isFirst,
    x: told.map(function (p) { return p[2]; }), y: told.map(function (p) { return p[3]; }),
    line: { color: colour, width: isRight ? 1.1 : 2.4 },
    marker: { color: colour, size: 7, symbol: told.map(function (p) { return p[4] === null ? dot + "-open" : dot; }) },
    error_y: {
      type: "data", symmetric: false, thickness: 1, width: 3, color: colour,
      array: told.map(function (p) { return p[5] === null ? 0 : p[5] - p[3]; }),
      arrayminus: told.map(function (p) { return p[4] === null ? 0 : p[3] - p[4]; }),
    },
    customdata: told.map(function (p) {
      const ci = p[4] === null ? plotText(p[9]) : `95 % ${digits(p[4])} … ${digits(p[5])}`;
      return [`${p[0]}–${p[1]} km/h`, `${digits(p[3])} ${unit}`, ci, `${p[6]} runs, ${p[7]} samples`,
        p[8] === null ? "" : `<br>model ${digits(p[8])}`];
    }),
    hovertemplate: "%{customdata[0]}: <b>%{customdata[1]}</b><br>%{customdata[2]}<br>%{customdata[3]}%{customdata[4]}" +
      `<extra>${name}</extra>`,
  }];
  const model = points.filter(function (p) { return p[8] !== null; });
  if (model.length > 1) traces.push({
    type: "scatter", mode: "lines", x: model.map(function (p) { return p[2]; }),
    y: model.map(function (p) { return p[8]; }), line: { color: colour, width: 1.2, dash: "dash" }, opacity: 0.75,
    showlegend: false, legendgroup: id, hoverinfo: "skip", meta: "model",
  });
  return traces;
}

function legendLines(curves) {
  return Math.ceil(new Set(curves.map(function (c) { return colourName(c[0]); })).size / 4);
}

// What a panel's range leaves out, in words: values, ends of intervals, the model's curve.
function leftOut(curves, [low, high]) {
  const points = curves.flatMap(function (c) { return c[2].filter(function (p) { return p[3] !== null; }); });
  const models = curves.flatMap(function (c) { return c[2]; });
  const beyond = function (some, of) {
    return some.map(of).filter(function (v) { return v !== null && (v > high || v < low); });
  };
  const told = function (found, one, many) {
    if (!found.length) return "";
    const farthest = found.reduce(function (a, b) { return Math.abs(b) > Math.abs(a) ? b : a; });
    return `${found.length} ${found.length > 1 ? many : one} to ${digits(farthest)}`;
  };
  const parts = [
    told(beyond(points, function (p) { return p[3]; }), "value", "values"),
    told(beyond(points, function (p) { return p[4]; }).concat(beyond(points, function (p) { return p[5]; })),
      "end of an interval", "ends of intervals"),
    told(beyond(models, function (p) { return p[8]; }), "value of the model", "values of the model"),
  ].filter(Boolean);
  return parts.length ? `not shown: ${parts.join(", ")}` : "";
}

function drawPanel(id, curves, limits, unit, yTitle, level) {
  const lay = layout("", axis("speed [km/h]", limits.x), axis(yTitle, limits.y), 300);
  lay.margin.t = 8;
  const beyond = leftOut(curves, limits.y);
  if (beyond) {
    lay.margin.t = 24;
    lay.annotations = [...(lay.annotations || []), { text: beyond, xref: "paper", yref: "paper", x: 0, y: 1, xanchor: "left",
      yanchor: "bottom", showarrow: false, font: { size: 11, color: "@muted" } }];
  }
  const names = new Set();
  lay.shapes = [];
  const levels = new Set();
  for (const c of curves) {
    if (c[3] === null || levels.has(c[3])) continue;
    levels.add(c[3]);
    lay.shapes.push({ type: "line", xref: "paper", x0: 0, x1: 1, y0: c[3], y1: c[3],
      line: { color: "@muted", width: 1.2, dash: "dot" } });
  }
  if (level !== null) lay.shapes.push({ type: "line", xref: "paper", x0: 0, x1: 1, y0: level, y1: level,
    line: { color: "#B2182B", width: 1.2 } });
  const data = curves.flatMap(function (c) {
    const name = colourName(c[0]);
    const first = !names.has(name);
    names.add(name);
    return tracesOf(c, unit, name, first);
  });
  const lines = legendLines(curves);
  lay.margin.b = 58 + 24 * lines;
  lay.height = 270 + 24 * lines;
  lay.legend.y = -44 / (lay.height - lay.margin.b - lay.margin.t);
  lay.showlegend = colourKey >= 0;
  return show(id, data, lay);
}

function drawPanels(kind, unit, yTitle, level) {
  const box = byId(kind), shown = curvesShown(kind), told = shown.filter(isTold), panels = new Map();
  for (const c of told) {
    const name = panelName(c[0]);
    if (!panels.has(name)) panels.set(name, []);
    panels.get(name).push(c);
  }
  for (const id of [...drawn.keys()].filter(function (k) { return k.startsWith(kind + "-"); })) {
    if (window.Plotly && byId(id)) Plotly.purge(byId(id));
    drawn.delete(id);
    stale.delete(id);
  }
  box.replaceChildren();
  const places = [...new Set(told.map(function (c) { return c[1]; }))].sort();
  const limits = told.length ? { x: speeds(told), y: [Math.min(0, lowest(told)), 1.06 * largest(told, level)] } : null;
  const most = all[kind] ? Infinity : FEW;
  [...panels].slice(0, most).forEach(function ([name, curves], n) {
    const id = `${kind}-${n}`;
    box.append(make("div", null, make("h3", { textContent: name }), make("div", { id: id, className: "panel" })));
    later(id, 270 + 24 * legendLines(curves), function () { return drawPanel(id, curves, limits, unit, yTitle, level); });
  });
  if (panels.size > most) {
    const more = make("button", { type: "button", className: "more", textContent: `Show all ${panels.size} panels` });
    more.addEventListener("click", function () { all[kind] = true; update(); });
    box.append(more);
  }
  const key = byId(kind + "-key");
  key.textContent = places.length > 1
    ? places.map(function (p) { return `${placeName(p)} ${DASH_NAMES[p] || "━━━"}`; }).join(", ") : placeName(places[0] ?? "");
  const silent = new Set(shown.filter(function (c) { return !isTold(c); }).map(function (c) { return c[0]; }));
  for (const c of told) silent.delete(c[0]);
  byId(kind + "-silent").textContent = silent.size ? `Not available: ${[...silent].map(function (g) {
    const points = shown.find(function (c) { return c[0] === g; })[2];
    return `${D.groups[g][0]} (${points.length ? points[points.length - 1][9] : "no samples"})`;
  }).join("; ")}` : told.length ? "" : "The runs that the filters leave give no estimate.";
}

function lowest(curves) {
  return Math.min(...curves.flatMap(function (c) {
    return c[2].map(function (p) { return p[4] === null ? 0 : Math.min(p[4], p[3]); });
  })) * 1.1;
}

function drawFull() {
  const rows = D.full.filter(function (f) { return now.groups.has(f[0]) && isPlaceShown(f[1]); });
  const told = rows.filter(function (f) { return f[3] !== null || f[4] !== null; });
  const groups = [...new Set(told.map(function (f) { return f[0]; }))].sort(function (a, b) { return a - b; });
  const silent = new Set(rows.map(function (f) { return f[0]; }));
  for (const g of groups) silent.delete(g);
  byId("full-silent").textContent = silent.size
    ? "Not available: " + [...silent].map(function (g) { return D.groups[g][0]; }).join("; ")
    : told.length ? "" : "The runs that the filters leave give no estimate.";
  byId("full").hidden = !told.length;
  const height = 110 + 34 * Math.max(2, groups.length);
  later("full", height, function () {
    const names = Object.keys(WAYS), data = [], speeds_ = told.map(function (f) { return f[3] ?? f[4]; });
    const most = Math.max(...speeds_, 1); // an end far beyond all speeds would press them together
    const top = Math.max(1.12 * most, ...told.map(function (f) { return Math.min((f[5] ?? 0) + 3, 1.3 * most); }));
    const bottom = Math.min(...told.map(function (f) { return f[4] ?? f[3]; })) - 5;
    for (const way of names) {
      const own = told.filter(function (f) { return f[2] === way; });
      const offset = (names.indexOf(way) - 0.5 * (names.length - 1)) * 0.22;
      const place = function (f) {
        const beside = own.filter(function (o) { return o[0] === f[0]; });
        return groups.indexOf(f[0]) + offset + (beside.length > 1 ? (beside.indexOf(f) / (beside.length - 1) - 0.5) * 0.16 : 0);
      };
      const sure = own.filter(function (f) { return f[3] !== null; });
      const above = own.filter(function (f) { return f[3] === null; });
      data.push({
        type: "scatter", mode: "markers", name: WAYS[way][0], meta: "full", legendgroup: way,
        x: sure.map(function (f) { return f[3]; }), y: sure.map(place),
        marker: { color: WAYS[way][1], symbol: WAYS[way][2], size: 8 },
        error_x: {
          type: "data", symmetric: false, thickness: 1.4, width: 3, color: WAYS[way][1],
          array: sure.map(function (f) { return (f[5] ?? 2 * top) - f[3]; }), // open: out of the picture
          arrayminus: sure.map(function (f) { return f[3] - (f[4] ?? f[3]); }),
        },
        customdata: sure.map(function (f) {
          return [plotText(D.groups[f[0]][0]), placeName(f[1]), `${f[4] === null ? "open" : f[4].toFixed(0)} … ` +
            `${f[5] === null ? "open" : f[5].toFixed(0)}`, plotText(f[6])];
        }),
        hovertemplate: "<b>%{x:.0f} km/h</b> (95 % %{customdata[2]})<br>%{customdata[0]} %{customdata[1]}" +
          "<br>%{customdata[3]}<extra>%{fullData.name}</extra>",
      });
      if (above.length) data.push({
        type: "scatter", mode: "markers", legendgroup: way, showlegend: !sure.length, name: WAYS[way][0] + ", at least",
        x: above.map(function (f) { return f[4]; }), y: above.map(place),
        marker: { color: WAYS[way][1], symbol: "triangle-right-open", size: 8 },
        customdata: above.map(function (f) { return [plotText(D.groups[f[0]][0]), placeName(f[1]), plotText(f[7])]; }),
        hovertemplate: "at least %{x:.0f} km/h<br>%{customdata[0]} %{customdata[1]}<br>%{customdata[2]}<extra></extra>",
      });
    }
    const y = axis("", [groups.length - 0.5, -0.5]);
    y.zeroline = false;
    y.tickvals = groups.map(function (_, i) { return i; });
    y.ticktext = groups.map(function (g) { return plotText(D.groups[g][0].slice(0, 70)); });
    const lay = layout("", axis("speed of full aquaplaning [km/h]", told.length ? [bottom, top] : null), y, height);
    lay.margin.t = 12;
    lay.legend = { orientation: "h", x: 0, y: 1, yanchor: "bottom", font: { size: 11 } };
    lay.margin.t = 36;
    return show("full", data, lay);
  });
}

function buildFigures() {
  const pick = byId("colour-by");
  for (const k of D.keys) pick.append(make("option", { value: String(k), textContent: facets[k].title }));
  const depth = D.keys.find(function (k) { return facets[k].key === "water_depth_mm"; });
  colourKey = depth ?? D.keys[0] ?? -1;
  pick.value = String(colourKey);
  pick.parentElement.hidden = D.keys.length < 2;
  pick.addEventListener("change", function () { colourKey = Number(pick.value); update(); });
  followers.push(
    function () { drawPanels("slopes", "", "slip slope C_s / F_z [–]", null); },
    function () { drawPanels("resistance", "m/s²", "resistance [m/s²]", D.is_dry ? null : D.level); },
    drawFull,
  );
}
