// The figures of a page, each in the element of its name.
(function () {
  const figures = JSON.parse(document.getElementById("figure-data").textContent);

  // A narrow window breaks the legend into more lines than were reckoned with.
  function fitted(plot, layout) {
    const legend = plot.querySelector(".legend"), axis = layout.scene ? 0 : 52; // [px] below the plot for the axis
    const lacking = legend ? Math.ceil(legend.getBoundingClientRect().height) + axis - layout.margin.b : 0;
    return lacking <= 0 ? null : {
      ...layout, height: layout.height + lacking, margin: { ...layout.margin, b: layout.margin.b + lacking },
    };
  }

  // One after the other, so that the page can be read while the last ones are drawn.
  function build(width) {
    return Object.keys(figures).reduce(function (before, id) {
      return before.then(function () {
        const { data, layout } = coloured(figures[id]), plot = document.getElementById(id);
        return paint(plot, data, layout, plotConfig, width).then(function () {
          const larger = fitted(plot, layout);
          return larger ? paint(plot, data, larger, plotConfig, width) : null;
        });
      });
    }, Promise.resolve());
  }

  figuresDrawn = build();
  figuresDrawn.then(function () { document.body.dataset.ready = "true"; });
  redrawn(build);

  // In another width the legends have other lines.
  let width = window.innerWidth, waiting = 0;
  window.addEventListener("resize", function () {
    if (isOnPaper || window.innerWidth === width) return;
    width = window.innerWidth;
    clearTimeout(waiting);
    waiting = setTimeout(function () { if (!isOnPaper) figuresDrawn = figuresDrawn.then(function () { return build(); }); }, 200);
  });
})();
