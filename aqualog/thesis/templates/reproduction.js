"use strict";
(function () {
  const chips = Array.from(document.querySelectorAll(".chip"));
  const rows = Array.from(document.querySelectorAll("#claims tbody"));
  const search = document.getElementById("search");
  const shown = document.getElementById("shown");
  const texts = rows.map(function (r) { return (r.id + " " + r.textContent).toLowerCase(); });

  function apply() {
    const on = new Set(chips.filter(function (c) { return c.getAttribute("aria-pressed") === "true"; })
      .map(function (c) { return c.dataset.verdict; }));
    const words = search.value.toLowerCase().split(/\s+/).filter(Boolean);
    let count = 0;
    rows.forEach(function (row, i) {
      const isShown = on.has(row.dataset.verdict) && words.every(function (w) { return texts[i].includes(w); });
      row.hidden = !isShown;
      if (isShown) count += 1;
    });
    shown.textContent = count === rows.length ? "" : count + " of " + rows.length + " claims shown";
  }

  for (const chip of chips) {
    chip.addEventListener("click", function () {
      chip.setAttribute("aria-pressed", String(chip.getAttribute("aria-pressed") !== "true"));
      apply();
    });
  }
  search.addEventListener("input", apply);
  apply();
})();
