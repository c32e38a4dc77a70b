// The figures of a page, each in the element of its name.
(function () {
  const figures = JSON.parse(document.getElementById("figure-data").textContent);

  // A narrow window breaks the legend into more lines than were reckoned with.
  function fitLegend(plot) {
    const legend = plot.querySelector(".legend"), layout = plot.layout;
    const axis = layout.scene ? 0 : 52; // [px] below the plot for the axis
    const lacking = legend ? Math.ceil(legend.getBoundingClientRect().height) + axis - layout.margin.b : 0;
    if (lacking <= 0) return null;
    plot.style.height = layout.height + lacking + "px";
    return Plotly.relayout(plot, { height: layout.height + lacking, "margin.b": layout.margin.b + lacking });
  }

  // One after the other, so that the page can be read while the last ones are drawn.
  function build(width) {
    return Object.keys(figures).reduce(function (before, id) {
      return before.then(function () {
        const figure = coloured(figures[id]);
        const plot = document.getElementById(id);
        return paint(plot, figure.data, figure.layout, plotConfig, width).then(function () { return fitLegend(plot); });
      });
    }, Promise.resolve());
  }

  figuresDrawn = build();
  figuresDrawn.then(function () { document.body.dataset.ready = "true"; });
  redrawn(build);
})();
