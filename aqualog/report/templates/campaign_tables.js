// Tables: quality, speeds, matrix, detections, runs.
const PAGE = 100; // rows of the table of runs at a time
const MOST = 300; // runs that a problem names
const BIN = 10; // [km/h] of the detections over speed
const table = { sort: 0, down: false, page: 0, text: "", only: null, rows: [] };
let haystack = null;

// The folder that all runs share adds no information, and would push the end of the name out of sight.
const shared = (function () {
  const first = runs.name[0] ?? "", cut = first.lastIndexOf("/") + 1;
  return runs.name.every(function (n) { return n.startsWith(first.slice(0, cut)); }) ? cut : 0;
})();

function link(i) { return make("a", { href: runs.page[i], textContent: runs.name[i].slice(shared) }); }

function buildProblems() {
  const box = byId("problem-list");
  D.problems.forEach(function ([weight, title, means, hits]) {
    const line = make("details", { className: weight },
      make("summary", null, make("b", { textContent: String(hits.length) }), hits.length === 1 ? "run: " : "runs: ", title,
        means ? make("span", { className: "muted", textContent: " – " + means }) : null));
    line.addEventListener("toggle", function () {
      if (!line.open || line.childElementCount > 1) return;
      const show = make("button", { type: "button", textContent: "show them in the table of runs" });
      show.addEventListener("click", function () {
        table.only = { title: title, runs: new Set(hits.map(function (h) { return h[0]; })) };
        table.page = 0;
        drawRuns();
        byId("runs-section").scrollIntoView();
      });
      const list = make("ul");
      for (const [i, text] of hits.slice(0, MOST)) list.append(make("li", null, link(i), text ? ` ${text}` : ""));
      if (hits.length > MOST) list.append(make("li", { textContent: `and ${hits.length - MOST} more` }));
      line.append(show, list);
    });
    box.append(line);
  });
}

function speedCell(n) {
  const [v, low, high, place, why] = n, where = place ? make("small", { textContent: placeName(place) }) : null;
  if (v === null) {
    if (low === null && high === null) return make("td", { className: "num none", title: why, textContent: "–" });
    const bound = low === null ? `<\u00a0${high.toFixed(0)}` : `>\u00a0${low.toFixed(0)}`;
    return make("td", { className: "num none", title: `${why}; 95 %: ${bound} km/h` }, bound, " ", where);
  }
  const ci = low === null && high === null ? "" : ` (${low === null ? "…" : low.toFixed(0)}–${high === null ? "…" : high.toFixed(0)})`;
  return make("td", { className: "num", title: why }, make("b", { textContent: v.toFixed(0) }),
    make("small", { textContent: ci }), " ", where);
}

function drawAnswers() {
  const head = ["Configuration", "Runs", "Full aquaplaning, from the slip slope", "Full aquaplaning, from minor spin-downs",
    "Full aquaplaning, from spin-downs", "Full aquaplaning, foretold", `Resistance reaches ${D.level} m/s²`, "Half of the dry slip slope"];
  const body = make("tbody");
  for (const a of D.answers) {
    if (!now.groups.has(a[0])) continue;
    const n = now.runs.filter(function (i) { return runs.group[i] === a[0]; }).length;
    body.append(make("tr", null, make("th", { scope: "row", textContent: D.groups[a[0]][0] }),
      make("td", { className: "num", textContent: String(n) }), ...a.slice(1).map(speedCell)));
  }
  byId("answers").replaceChildren(header(head), body);
}

function header(names) {
  return make("thead", null, make("tr", null, ...names.map(function (n, i) {
    return make("th", { className: i ? "num" : "", scope: "col", textContent: n });
  })));
}

function matrixCells() {
  const cells = new Map(), { rows, column } = D.matrix;
  for (let i = 0; i < count; i++) {
    const row = rows.map(function (f) { return runs.facets[f][i]; }), c = column < 0 ? 0 : runs.facets[column][i];
    const key = JSON.stringify(row);
    if (!cells.has(key)) cells.set(key, { row: row, of: new Map() });
    const of = cells.get(key).of;
    if (!of.has(c)) of.set(c, []);
    of.get(c).push(i);
  }
  for (const gap of D.matrix.gaps) { // rows of which nothing was driven would only be gaps
    const own = cells.get(JSON.stringify(gap.slice(0, rows.length)));
    if (own) own.of.set(gap[rows.length] ?? 0, null);
  }
  return [...cells.values()].sort(function (a, b) {
    for (let i = 0; i < a.row.length; i++) if (a.row[i] !== b.row[i]) return a.row[i] - b.row[i];
    return 0;
  });
}

function drawMatrix() {
  const { rows, column } = D.matrix, shown = new Set(now.runs), columns = column < 0 ? ["runs"] : facets[column].values;
  const cells = matrixCells();
  const most = Math.max(1, ...cells.flatMap(function (r) { return [...r.of.values()].map(function (x) { return x ? x.length : 0; }); }));
  const body = make("tbody");
  for (const { row, of } of cells) {
    const name = row.map(function (v, n) { return [facets[rows[n]].key === "vehicle", facets[rows[n]].values[v]]; })
      .sort(function (a, b) { return a[0] - b[0]; }).map(function (x) { return x[1]; })
      .filter(function (t) { return !t.startsWith("0 kg"); }).join(" · ") || "all runs";
    const line = make("tr", null, make("th", { scope: "row", textContent: name }));
    columns.forEach(function (_, c) {
      const hits = of.get(c);
      if (hits === undefined) return line.append(make("td"));
      if (hits === null) return line.append(make("td", { className: "missing" }, make("span", { textContent: "missing" })));
      const left = hits.filter(function (i) { return shown.has(i); });
      line.append(make("td", { className: "cell" }, cellButton(hits, left, most, row, c)));
    });
    body.append(line);
  }
  byId("matrix").replaceChildren(header([column < 0 ? "Configuration" : `configuration \\ ${facets[column].title}`, ...columns]), body);
}

function cellButton(hits, left, most, row, c) {
  const v = left.map(function (i) { return runs.v[i]; }).filter(function (x) { return x !== null; });
  const range = v.length ? `${Math.round(Math.min(...v))}–${Math.round(Math.max(...v))}` : "";
  const sets = D.matrix.rows.map(function (f, n) { return [chosen[f], row[n]]; });
  if (D.matrix.column >= 0) sets.push([chosen[D.matrix.column], c]);
  const isOn = sets.length > 0 && sets.every(function ([set, value]) { return set.size === 1 && set.has(value); });
  const button = make("button", {
    type: "button", "aria-pressed": String(isOn), title: `${left.length} of ${hits.length} runs, ${range} km/h on the lane`,
  }, left.length === hits.length ? String(hits.length) : `${left.length} / ${hits.length}`,
  range ? make("small", { textContent: range }) : null);
  const strength = left.length ? 0.12 + 0.5 * left.length / most : 0;
  button.style.background = left.length && hits.length < 3 ? "rgba(230,159,0,0.28)" : `rgba(0,114,178,${strength})`;
  button.addEventListener("click", function () {
    sets.forEach(function ([set, value]) {
      set.clear();
      if (!isOn) set.add(value);
    });
    update();
  });
  return button;
}

function isJudged(i, d) { return runs.state[i] === 0 && !runs.unavailable[runs.gone[i]].includes(d); }

function countOf(i, d, column) {
  return runs.events[i].reduce(function (n, e) {
    return n + ((d < 0 || e[0] === d) && isPlaceShown(e[1]) ? e[column] : 0);
  }, 0);
}

function passesOf(list, d) {
  const judged = list.filter(function (i) { return runs.v[i] !== null && isJudged(i, d); });
  return [judged.filter(function (i) { return countOf(i, d, 2) > 0; }).length, judged.length];
}

function wilson(k, n) {
  const z = 1.96, p = k / n, q = z * z / n, middle = (p + q / 2) / (1 + q);
  const half = z * Math.sqrt(p * (1 - p) / n + q / (4 * n)) / (1 + q);
  return [Math.max(0, middle - half), Math.min(1, middle + half)];
}

function byar(k) {
  const side = function (n, z) { return n * Math.pow(1 - 1 / (9 * n) + z / (3 * Math.sqrt(n)), 3); };
  return [k ? side(k, -1.96) : 0, side(k + 1, 1.96)];
}

function drawDetections() {
  const groups = [...now.groups].sort(function (a, b) { return a - b; });
  const members = new Map(groups.map(function (g) { return [g, []]; }));
  for (const i of now.runs) members.get(runs.group[i]).push(i);
  const live = D.detectors.map(function (_, d) { return d; })
    .filter(function (d) { return now.runs.some(function (i) { return isJudged(i, d); }); });
  const body = make("tbody");
  for (const [name, list] of [["all that the filters leave", now.runs], ...groups.map(function (g) { return [D.groups[g][0], members.get(g)]; })]) {
    if (!list.length) continue;
    const line = make("tr", null, make("th", { scope: "row", textContent: name }));
    for (const d of live) {
      const [k, n] = passesOf(list, d);
      const cell = make("td", { textContent: n ? `${k} / ${n}` : "–", className: k ? "" : "none" });
      if (n) {
        const ci = wilson(k, n);
        cell.title = `${Math.round(100 * k / n)} % (95 % ${Math.round(100 * ci[0])} … ${Math.round(100 * ci[1])} %)`;
        if (k) cell.style.background = `rgba(213,94,0,${0.08 + 0.4 * k / n})`;
      }
      line.append(cell);
    }
    line.append(alarmCell(list));
    body.append(line);
  }
  byId("detections-table").replaceChildren(
    header(["Configuration", ...live.map(function (d) { return D.detectors[d]; }), "Off water, per 100 km"]), body);
  byId("detections").hidden = !now.runs.some(function (i) { return runs.v[i] !== null; });
  later("detections", 110 + 26 * Math.max(2, live.length), function () { return drawDetectionsOverSpeed(live); });
}

function alarmCell(list) {
  const known = list.filter(function (i) { return runs.dry[i] !== null; });
  const way = known.reduce(function (s, i) { return s + runs.dry[i]; }, 0);
  if (!way) return make("td", { className: "none", textContent: "–" });
  const k = known.reduce(function (s, i) { return s + countOf(i, -1, 3); }, 0), ci = byar(k);
  const per = function (x) { const r = 100 * x / way; return r >= 10 ? r.toFixed(0) : r.toFixed(1); };
  return make("td", { className: k ? "" : "none", title: `${k} events in ${way.toFixed(1)} km`,
    textContent: `${per(k)} (${per(ci[0])}–${per(ci[1])})` });
}

function drawDetectionsOverSpeed(live) {
  const bins = [...new Set(now.runs.filter(function (i) { return runs.v[i] !== null; })
    .map(function (i) { return Math.floor(runs.v[i] / BIN); }))].sort(function (a, b) { return a - b; });
  const lists = bins.map(function (b) {
    return now.runs.filter(function (i) { return runs.v[i] !== null && Math.floor(runs.v[i] / BIN) === b; });
  });
  const counts = live.map(function (d) { return lists.map(function (l) { return passesOf(l, d); }); });
  const data = [{
    type: "heatmap", meta: "detections", x: bins.map(function (b) { return `${b * BIN}–${(b + 1) * BIN}`; }),
    y: live.map(function (d) { return D.detectors[d]; }), zmin: 0, zmax: 1, xgap: 1, ygap: 1, showscale: false,
    z: counts.map(function (r) { return r.map(function (c) { return c[1] ? c[0] / c[1] : null; }); }),
    text: counts.map(function (r) { return r.map(function (c) { return c[1] ? `${c[0]}/${c[1]}` : ""; }); }),
    texttemplate: "%{text}", hovertemplate: "%{y}, %{x} km/h: %{text} passes<extra></extra>", hoverongaps: false,
    colorscale: [[0, "rgba(128,128,128,0.10)"], [0.001, "#FBE3D0"], [1, "#D55E00"]],
  }];
  const x = axis("mean speed on the lane [km/h]"), y = axis("");
  x.type = y.type = "category";
  y.autorange = "reversed";
  return show("detections", data, layout("passes with at least one event, over speed", x, y, 110 + 26 * Math.max(2, live.length)));
}

function eventWords(i) {
  const words = D.detectors.map(function (name, d) { return [name, countOf(i, d, 2)]; })
    .filter(function (w) { return w[1]; });
  return words.map(function (w) { return w[1] > 1 ? `${w[0]} ${w[1]}×` : w[0]; }).join(", ");
}

// Events of a run on or off water; -1 where the lane is not known, whose events are counted all the same.
function sum(i, column) { return countOf(i, -1, 4) ? -1 : countOf(i, -1, column); }
function sumText(column) {
  return function (i) {
    const n = sum(i, column);
    return n >= 0 ? String(n) : column === 2 ? `${countOf(i, -1, 4)} somewhere` : "–";
  };
}

const STATES = ["done", "failed", "to do"];
const VERDICTS = ["yes", "none", "cannot be judged"]; // in the order of the document
const columns = [
  ["#", "num", function (i) { return i + 1; }],
  ["Run", "", function (i) { return runs.name[i]; }],
  ["Aquaplaning", "", function (i) { return (runs.verdict[i] + 4) % 4; },
    function (i) { return ["", ...VERDICTS][runs.verdict[i] + 1] + (runs.doubtful[i] ? "; doubtful, check the inputs first" : ""); }],
  ["Episodes", "num", function (i) { return runs.verdict[i] === 0 || runs.verdict[i] === 1 ? runs.episodes[i] : -1; },
    function (i) { return runs.verdict[i] === 0 || runs.verdict[i] === 1 ? String(runs.episodes[i]) : "–"; }],
  ["Lane [km/h]", "num", function (i) { return runs.v[i] ?? -1; }, function (i) { return runs.v[i] === null ? "–" : runs.v[i].toFixed(0); }],
  ["On water", "num", function (i) { return sum(i, 2); }, sumText(2)],
  ["Off", "num", function (i) { return sum(i, 3); }, sumText(3)],
  ["Full", "num", function (i) { return runs.full[i]; }],
  ["Events on water", "", eventWords],
  ...facets.map(function (f, n) {
    return [f.title, "", function (i) { return runs.facets[n][i]; }, function (i) { return f.values[runs.facets[n][i]]; }];
  }),
  ["State", "", function (i) { return runs.state[i]; }, function (i) { return STATES[runs.state[i]]; }],
];

function buildRuns() {
  const row = make("tr");
  columns.forEach(function ([title, kind], c) {
    const cell = make("th", { scope: "col", className: `${kind} sorter`, tabIndex: 0, textContent: title });
    const sort = function () {
      table.down = table.sort === c && !table.down;
      table.sort = c;
      table.page = 0;
      drawRuns();
    };
    cell.addEventListener("click", sort);
    cell.addEventListener("keydown", function (e) {
      if (e.key !== "Enter" && e.key !== " ") return;
      e.preventDefault();
      sort();
    });
    row.append(cell);
  });
  byId("runs").append(make("thead", null, row), make("tbody"));
  byId("search").addEventListener("input", function () {
    table.text = byId("search").value.trim().toLowerCase();
    table.page = 0;
    drawRuns();
  });
  byId("page-back").addEventListener("click", function () { table.page--; fillRuns(); });
  byId("page-on").addEventListener("click", function () { table.page++; fillRuns(); });
  followers.push(function () { table.page = 0; drawRuns(); });
}

function isFound(i) {
  if (table.only && !table.only.runs.has(i)) return false;
  if (!table.text) return true;
  haystack ??= runs.name.map(function (name, r) {
    return [name, ...facets.map(function (f, n) { return f.values[runs.facets[n][r]]; }), STATES[runs.state[r]]].join(" ").toLowerCase();
  });
  return table.text.split(/\s+/).every(function (word) { return haystack[i].includes(word); });
}

function drawRuns() {
  const key = columns[table.sort][2], keys = new Map();
  table.rows = now.runs.filter(isFound);
  for (const i of table.rows) keys.set(i, key(i));
  table.rows.sort(function (a, b) {
    const x = keys.get(a), y = keys.get(b);
    const order = typeof x === "string" ? x.localeCompare(y) : x - y;
    return (table.down ? -order : order) || a - b;
  });
  const chip = byId("problem-filter");
  chip.replaceChildren();
  if (table.only) {
    const clear = make("button", { type: "button", className: "pill", "aria-pressed": "true", textContent: `only: ${table.only.title} ✕` });
    clear.addEventListener("click", function () { table.only = null; drawRuns(); });
    chip.append(clear);
  }
  document.querySelectorAll("#runs th").forEach(function (th, c) {
    if (c === table.sort) th.setAttribute("aria-sort", table.down ? "descending" : "ascending");
    else th.removeAttribute("aria-sort");
  });
  fillRuns();
}

function fillRuns() {
  const pages = Math.max(1, Math.ceil(table.rows.length / PAGE));
  table.page = Math.min(Math.max(0, table.page), pages - 1);
  const begin = table.page * PAGE, part = table.rows.slice(begin, begin + PAGE);
  document.querySelector("#runs tbody").replaceChildren(...part.map(function (i) {
    const line = make("tr", { className: runs.state[i] ? "bad" : "" });
    columns.forEach(function ([, kind, key, text], c) {
      if (c === 1) return line.append(make("td", { title: runs.name[i] }, link(i)));
      const shown = String((text || key)(i));
      line.append(make("td", { className: kind, textContent: shown, title: shown.length > 14 ? shown : "" }));
    });
    return line;
  }));
  byId("run-count").textContent = table.rows.length
    ? `${begin + 1}–${begin + part.length} of ${table.rows.length} runs` : "no run";
  byId("page-back").disabled = table.page === 0;
  byId("page-on").disabled = table.page >= pages - 1;
}

function start() {
  recall();
  buildFilters();
  buildProblems();
  followers.push(drawAnswers, drawMatrix);
  buildFigures();
  followers.push(drawDetections);
  buildRuns();
  update();
  withPlotly(function () {
    startFigures();
    document.body.dataset.ready = "true";
  });
}
start();
