// plotly.js stands once beside all pages. It is loaded by this script and not by the document, because a browser gives
// pages opened from a disk no origin of their own: the policy trusts what this very script asks for, and nothing else.
function withPlotly(draw) {
  const script = document.createElement("script");
  script.src = document.body.dataset.plotly;
  script.onload = function () {
    if (window.Plotly) draw();
    else script.onerror();
  };
  script.onerror = function () {
    document.getElementById("no-plotly").hidden = false;
    document.body.dataset.ready = "without figures";
  };
  document.head.appendChild(script);
}

const plotConfig = {
  displaylogo: false, responsive: true, showTips: false, plotlyServerURL: "", showSendToCloud: false,
  showEditInChartStudio: false, modeBarButtonsToRemove: ["select2d", "lasso2d", "autoScale2d"],
};

function schemeColours() {
  const style = getComputedStyle(document.documentElement);
  const get = function (name) { return style.getPropertyValue(name).trim(); };
  return { "@ink": get("--ink"), "@muted": get("--muted"), "@paper": get("--paper") };
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
