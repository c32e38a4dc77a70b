// Shared by the pages: colours of the scheme, text and settings for plotly.
const plotConfig = {
  displaylogo: false, responsive: true, showTips: false, plotlyServerURL: "", showSendToCloud: false,
  showEditInChartStudio: false,
};

function schemeColours() {
  const style = getComputedStyle(document.documentElement);
  const get = function (name) { return style.getPropertyValue(name).trim(); };
  return { "@ink": get("--ink"), "@muted": get("--muted"), "@paper": get("--paper"), "@accent": get("--accent") };
}

function coloured(value) {
  const known = schemeColours();
  return JSON.parse(JSON.stringify(value), function (_, v) {
    return typeof v === "string" && Object.hasOwn(known, v) ? known[v] : v;
  });
}

// plotly reads <b>, entities and %{...} as markup: those characters become look-alikes.
function plotText(text) {
  return String(text).replaceAll("&", "＆").replaceAll("<", "‹").replaceAll(">", "›").replaceAll("%{", "％{")
    .replaceAll("$", "＄");
}

const PRINT_WIDTH = 700; // [px] inside the margins of A4 and Letter

// When the scheme changes, and before and after printing: `draw` with the width of the paper, or without.
function redrawn(draw, after) {
  window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", function () { draw(); });
  window.addEventListener("beforeprint", function () { draw(PRINT_WIDTH); });
  window.addEventListener("afterprint", after);
}
