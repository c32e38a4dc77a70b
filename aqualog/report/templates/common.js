// Shared by the pages: colours of the scheme, text and settings for plotly.
const plotConfig = {
  displaylogo: false, responsive: true, showTips: false, plotlyServerURL: "", showSendToCloud: false,
  showEditInChartStudio: false,
};

// The colours of @media print in page.css, which count only once the browser has laid the paper out.
const PAPER = { "@ink": "#000", "@muted": "#555", "@paper": "#fff", "@accent": "#0b5cad" };
const PRINT_WIDTH = 700; // [px] inside the margins of A4 and Letter
let isOnPaper = false;

function schemeColours() {
  if (isOnPaper) return PAPER;
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

let figuresDrawn = Promise.resolve(); // the figures of figures.js

// A figure in its element, as wide as the paper or as the element, whose height plotly measures.
function paint(plot, data, layout, config, width) {
  plot.style.height = layout.height + "px";
  return Plotly.react(plot, data, width ? { ...layout, width: width } : layout, config).then(function () {
    // without a width plotly keeps the last one until it has to measure
    const isKept = !width && plot.clientWidth && Math.abs(plot._fullLayout.width - plot.clientWidth) > 1;
    return isKept ? Plotly.Plots.resize(plot) : null;
  });
}

// Figures again when the scheme changes, with the width of the paper before printing, and on the screen after it.
function redrawn(draw) {
  window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", function () { if (!isOnPaper) draw(); });
  window.addEventListener("beforeprint", function () { isOnPaper = true; draw(PRINT_WIDTH); });
  window.addEventListener("afterprint", function () { isOnPaper = false; draw(); });
}
