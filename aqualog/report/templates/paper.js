// Panels over one time axis on paper. The end of a sheet would part one picture of all of them, so each becomes a picture.
const TITLE = 24, TIME = 24; // [px] of a panel's title, and of the numbers along the time axis

// What a plot has between two heights [px]; of its axes those that are kept.
function cutOut(plot, from, to, isKept) {
  const { width } = plot._fullLayout, picture = document.createElementNS("http://www.w3.org/2000/svg", "svg");
  for (const [name, value] of [["width", width], ["height", to - from], ["viewBox", `0 ${from} ${width} ${to - from}`]]) {
    picture.setAttribute(name, value);
  }
  for (const layer of plot.querySelectorAll(".main-svg > g, .main-svg > defs")) {
    const isAxes = layer.matches(".cartesianlayer"), copy = layer.cloneNode(!isAxes);
    if (isAxes) for (const axes of layer.children) if (isKept(axes.classList)) copy.append(axes.cloneNode(true));
    picture.append(copy);
  }
  return picture;
}

// Each panel of a plot with its title above and the numbers of the time axis below.
function cutUp(plot, rows) {
  const { t, b } = plot._fullLayout.margin, { height } = plot._fullLayout;
  const name = function (row) { return "x" + row.axis.replace("axis", ""); };
  const top = function (row) { return t + (1 - plot.layout[row.axis].domain[1]) * (height - t - b) - TITLE; };
  const times = cutOut(plot, height - b - 1, height - b + TIME, function (c) { return c.contains(name(rows[rows.length - 1])); });
  return rows.map(function (row, k) {
    const sheet = document.createElement("div");
    sheet.className = "sheet";
    const end = k + 1 < rows.length ? top(rows[k + 1]) : height - b;
    const isKept = function (c) { return c.contains(name(row)) || (k === 0 && c.contains("x2y")); };
    sheet.append(cutOut(plot, k ? top(row) : 0, end, isKept), times.cloneNode(true));
    const bar = plot.parentNode.querySelector(`.panel-bar[data-axis="${row.axis}"]`);
    if (bar && bar.dataset.beyond) {
      const beyond = document.createElement("div");
      beyond.textContent = bar.dataset.beyond;
      sheet.prepend(beyond);
    }
    return sheet;
  });
}
