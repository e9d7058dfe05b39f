"use strict";
// Draws every chart of the page from its JSON element. A chart inside a closed <details> has no
// size, so it is drawn when the element opens. Before printing, all elements are opened and all
// charts are redrawn at the width of the paper.
(() => {
  const plots = Array.from(document.querySelectorAll(".plot"));
  const drawn = new Set();

  // SVG text does not wrap, so an axis title that is wider than the axis is split into lines. A character has a width of
  // about 7 px at a font size of 13 px. The width of the axis is known after drawing.
  const CHARACTER_PX = 7;
  const breakTitle = (plot) => {
    const { title, _length: width } = plot._fullLayout.xaxis;
    const words = (title.text ?? "").split(" ");
    let lines = words.shift();
    for (const word of words) {
      const last = lines.slice(lines.lastIndexOf("<br>") + 1);
      const fits = (last.length + word.length) * CHARACTER_PX <= width;
      lines += (fits ? " " : "<br>") + word;
    }
    if (lines !== title.text) Plotly.relayout(plot, { "xaxis.title.text": lines });
  };

  const draw = (plot) => {
    if (drawn.has(plot) || plot.closest("details:not([open])")) return;
    drawn.add(plot);
    const figure = JSON.parse(document.getElementById(plot.id + "-data").textContent);
    Plotly.newPlot(plot, figure.data, figure.layout, figure.config).then(breakTitle);
  };

  plots.forEach(draw);
  for (const details of document.querySelectorAll("details")) {
    details.addEventListener("toggle", () => plots.forEach(draw));
  }

  // Lower charts on paper leave less empty space at the end of a page.
  const PRINTED_HEIGHT = 0.8;
  const size = (plot, scale, width) => {
    const height = Math.round(scale * plot.dataset.height);
    plot.style.height = height + "px";
    Plotly.relayout(plot, { autosize: width === null, width, height });
  };

  let opened = [];
  addEventListener("beforeprint", () => {
    opened = Array.from(document.querySelectorAll("details:not([open])"));
    opened.forEach((details) => { details.open = true; });
    plots.forEach((plot) => {
      draw(plot);
      size(plot, PRINTED_HEIGHT, Number(plot.dataset.printWidth));
    });
  });
  addEventListener("afterprint", () => {
    plots.forEach((plot) => size(plot, 1, null));
    opened.forEach((details) => { details.open = false; });
  });
})();
