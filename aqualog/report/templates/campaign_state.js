// What is filtered. Everything else on the page follows from `chosen`, and `update` draws it again.
const D = JSON.parse(document.getElementById("campaign-data").textContent);
const facets = D.facets, runs = D.runs, count = runs.name.length;
const SIDES = { left: ["fl", "rl"], right: ["fr", "rr"] };
const PLACES = { free: "free wheels", "": "" };
const chosen = facets.map(function () { return new Set(); }); // empty: all
const wheels = new Set();
const now = { runs: [], groups: new Set(), mixed: new Set() };
const followers = [];

function byId(id) { return document.getElementById(id); }

// Text only ever becomes a text node: no name is read as markup.
function make(tag, properties, ...children) {
  const node = document.createElement(tag);
  for (const [name, value] of Object.entries(properties || {})) {
    if (name.includes("-") || name === "role" || name === "scope") node.setAttribute(name, value);
    else node[name] = value;
  }
  for (const child of children) if (child !== null && child !== undefined) node.append(child);
  return node;
}

function placeName(place) {
  return Object.hasOwn(PLACES, place) ? PLACES[place] : place.length === 2 ? place.toUpperCase() : place;
}

function isPlaceShown(place) {
  if (!wheels.size || place === "" || place === "free") return true;
  return (SIDES[place] || [place]).some(function (w) { return wheels.has(w); });
}

function isRunShown(i) {
  return chosen.every(function (set, f) { return !set.size || set.has(runs.facets[f][i]); });
}

function look() {
  now.runs = [];
  now.groups = new Set();
  const left = new Set();
  for (let i = 0; i < count; i++) {
    if (isRunShown(i)) {
      now.runs.push(i);
      now.groups.add(runs.group[i]);
    } else left.add(runs.group[i]);
  }
  now.mixed = new Set([...now.groups].filter(function (g) { return left.has(g); }));
}

function update() {
  look();
  remember();
  for (const follow of followers) follow();
}

// The filters stay in the address, so that the way back from a run's page finds them again.
function remember() {
  const kept = {};
  facets.forEach(function (f, i) {
    if (chosen[i].size) kept[f.key] = [...chosen[i]].map(function (v) { return f.values[v]; });
  });
  if (wheels.size) kept[" wheels"] = [...wheels];
  const hash = Object.keys(kept).length ? "#f=" + encodeURIComponent(JSON.stringify(kept)) : "#";
  try { history.replaceState(null, "", hash); } catch { /* some browsers forbid it for pages on a disk */ }
}

function recall() {
  if (!location.hash.startsWith("#f=")) return;
  let kept;
  try { kept = JSON.parse(decodeURIComponent(location.hash.slice(3))); } catch { return; }
  facets.forEach(function (f, i) {
    for (const text of Array.isArray(kept[f.key]) ? kept[f.key] : []) {
      const at = f.values.indexOf(text);
      if (at >= 0) chosen[i].add(at);
    }
  });
  for (const w of Array.isArray(kept[" wheels"]) ? kept[" wheels"] : []) if (D.wheels.includes(w)) wheels.add(w);
}

function toggle(set, value) {
  if (set.has(value)) set.delete(value);
  else set.add(value);
  update();
}

function buildFilters() {
  const body = byId("filter-body"), painters = [];
  function group(title, names, set, values, counted) {
    const box = make("fieldset", null, make("legend", { textContent: title }));
    names.forEach(function (name, v) {
      const pill = make("button", { type: "button", className: "pill", textContent: name, title: name });
      pill.addEventListener("click", function () { toggle(set, values[v]); });
      painters.push(function () {
        pill.setAttribute("aria-pressed", String(set.has(values[v])));
        if (counted) pill.classList.toggle("empty", !counted(v));
      });
      box.append(pill);
    });
    body.append(box);
  }
  facets.forEach(function (f, i) {
    const order = f.values.map(function (_, v) { return v; });
    if (f.values.length > 24) return picker(f, i, body, painters);
    group(f.title, f.values, chosen[i], order, function (v) {
      return now.runs.some(function (r) { return runs.facets[i][r] === v; });
    });
  });
  if (D.wheels.length > 1) {
    group("wheel", D.wheels.map(placeName), wheels, D.wheels);
    for (const [side, members] of Object.entries(SIDES)) {
      const pill = make("button", { type: "button", className: "pill", textContent: side + " side" });
      pill.addEventListener("click", function () {
        const own = members.filter(function (w) { return D.wheels.includes(w); });
        const only = own.length === wheels.size && own.every(function (w) { return wheels.has(w); });
        wheels.clear();
        if (!only) own.forEach(function (w) { wheels.add(w); });
        update();
      });
      body.lastChild.append(pill);
    }
  }
  // Scrolled past, the filters open over the page; their place stays free, so that nothing moves.
  const place = byId("filter-place"), button = byId("open-filters");
  function isPast() { return place.getBoundingClientRect().bottom < byId("filters").getBoundingClientRect().bottom; }
  function tell() {
    button.setAttribute("aria-expanded", String(body.classList.contains("floating") || (!body.hidden && !isPast())));
  }
  function land() {
    body.classList.remove("floating");
    place.style.minHeight = "";
    tell();
  }
  button.addEventListener("click", function () {
    if (body.classList.contains("floating")) return land();
    if (isPast()) {
      body.hidden = false;
      place.style.minHeight = place.offsetHeight + "px";
      body.style.top = byId("filters").getBoundingClientRect().bottom + "px";
      body.classList.add("floating");
    } else body.hidden = !body.hidden;
    tell();
  });
  document.addEventListener("keydown", function (e) {
    if (e.key !== "Escape" || !body.classList.contains("floating")) return;
    land();
    button.focus();
  });
  new IntersectionObserver(function (entries) {
    if (entries[entries.length - 1].isIntersecting && !isPast()) land();
    else tell();
  }, { rootMargin: "-50px 0px 0px 0px" }).observe(place);
  // The address holds the filters, so a jump must not write its own end there.
  for (const jump of document.querySelectorAll(".jump a")) jump.addEventListener("click", function (e) {
    e.preventDefault();
    document.querySelector(jump.getAttribute("href")).scrollIntoView();
  });
  byId("reset").addEventListener("click", function () {
    chosen.forEach(function (set) { set.clear(); });
    wheels.clear();
    update();
  });
  followers.push(function () {
    for (const paint of painters) paint();
    byId("filter-state").textContent =
      `${now.runs.length} of ${count} runs, ${now.groups.size} of ${D.groups.length} configurations`;
    const note = byId("pooled");
    note.hidden = !now.mixed.size;
    const keys = D.keys.map(function (k) { return facets[k].title; }).join(", ");
    note.textContent = `Regressions are per configuration (${keys || "all runs together"}). Filters do not change them: ` +
      `${now.mixed.size} of the ${now.groups.size} drawn also use runs that the filters leave out. ` +
      "Matrix, detections and the table of runs follow the filters exactly. `aqualog report --by` splits further.";
  });
}

function picker(f, i, body, painters) {
  const list = make("select", { "aria-label": f.title });
  list.append(make("option", { value: "", textContent: `all ${f.values.length}` }));
  f.values.forEach(function (name, v) { list.append(make("option", { value: String(v), textContent: name })); });
  list.addEventListener("change", function () {
    chosen[i].clear();
    if (list.value) chosen[i].add(Number(list.value));
    update();
  });
  painters.push(function () { list.value = chosen[i].size ? String([...chosen[i]][0]) : ""; });
  body.append(make("fieldset", null, make("legend", { textContent: f.title }), list));
}
