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

const sharedConfig = { ...plotConfig, modeBarButtonsToRemove: ["select2d", "lasso2d", "autoScale2d"] };
