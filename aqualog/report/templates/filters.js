// Which events a reader wants to see: by detector, by wheel or side, while braking or not.
const BRAKING = "while braking"; // as the evidence says it

// Choices before a table; `texts` gives detector, place and evidence of an event. Returns whether an event is wanted.
function eventFilters(table, count, texts, changed) {
  const bar = document.createElement("p"), status = document.createElement("span"), asked = [];
  const all = Array.from({ length: count }, function (_, i) { return texts(i); });
  const isKept = function (i) { return asked.every(function ([pick, of]) { return !pick.value || of(all[i]) === pick.value; }); };
  const tell = function () {
    const kept = all.filter(function (_, i) { return isKept(i); }).length;
    status.textContent = kept < count ? `${kept} of ${count}` : "";
  };
  for (const [title, of] of [
    ["Detector", function (t) { return t[0]; }], ["Where", function (t) { return t[1]; }],
    ["Braking", function (t) { return t[2].includes(BRAKING) ? BRAKING : "not " + BRAKING; }],
  ]) {
    const values = [...new Set(all.map(of))].sort();
    if (values.length < 2) continue;
    const label = document.createElement("label"), pick = document.createElement("select");
    pick.append(new Option("all", ""), ...values.map(function (v) { return new Option(v, v); }));
    pick.addEventListener("change", function () { tell(); changed(); });
    asked.push([pick, of]);
    label.append(title + " ", pick);
    bar.append(label);
  }
  bar.id = table.id + "-filters";
  bar.className = "controls";
  status.setAttribute("role", "status");
  bar.append(status);
  if (asked.length) table.closest(".scroll").before(bar);
  return isKept;
}
