"use strict";
(() => {
  const charts = [...document.querySelectorAll(".chart")];
  // A finger on a chart scrolls the page, until zooming is chosen from the chart's own bar.
  const touched = matchMedia("(pointer: coarse)").matches;

  const draw = (chart) => {
    if (chart.classList.contains("js-plotly-plot")) return;
    const { data, layout, config } = JSON.parse(chart.nextElementSibling.textContent);
    if (touched) {
      layout.dragmode = false;
      config.displayModeBar = true;
    }
    Plotly.newPlot(chart, data, layout, config);
  };

  // One after another: the first can be read while the next is drawn.
  const next = (position) => {
    if (position === charts.length) {
      performance.mark("charts-drawn");
      return;
    }
    draw(charts[position]);
    setTimeout(next, 0, position + 1);
  };
  next(0);

  // Charts have the width of the screen, paper has another.
  const paper = 680;
  addEventListener("beforeprint", () => charts.forEach((chart) => {
    draw(chart);
    Plotly.relayout(chart, { width: paper });
  }));
  addEventListener("afterprint", () => charts.forEach((chart) => Plotly.relayout(chart, { width: null, autosize: true })));
})();
