"use strict";
// Figures of a study's sections: named curves over one axis, with a legend.
(() => {
  const { colour, axis, layout, title, logTicks, hover, onFigures } = robid;
  const DASHES = ["solid", "dash", "dot", "dashdot"];

  function scale(values, isLog, text, given) {
    const known = (given || values).filter((value) => value !== null && (!isLog || value > 0));
    const low = Math.min(...known), high = Math.max(...known);
    if (!known.length || !isLog) return axis({ title: title(text), showline: true, ...(given ? { range: given } : {}) });
    const ends = [Math.log10(low), Math.log10(high)];
    const pad = Math.max(0.04 * (ends[1] - ends[0]), 0.01);
    const ticks = high / low > 1e3 ? logTicks(low / 2, high * 2, [1]) : logTicks(low / 2, high * 2);
    return axis({ title: title(text), showline: true, type: "log", range: [ends[0] - pad, ends[1] + pad], tickvals: ticks, ticktext: ticks.map(String) });
  }

  function draw(host, figure) {
    const names = ["measured", "model", "even", "odd", "other", "ink"];
    const x = figure.curves.flatMap((curve) => curve.x), y = figure.curves.flatMap((curve) => curve.y);
    const all = figure.curves.map((curve, index) => ({
      type: "scatter", mode: "lines", name: curve.name, x: curve.x, y: curve.y,
      line: { color: colour(names[index % names.length]), width: 1.8, dash: DASHES[index % DASHES.length] },
      hovertemplate: `${curve.name}: %{y:.3g}<extra></extra>`,
    }));
    Plotly.react(host, all, layout({
      width: host.clientWidth, height: figure.height, hovermode: "x", showlegend: figure.legend,
      margin: { l: figure.y_title ? 72 : 46, r: 10, t: figure.legend ? 34 : 6, b: figure.x_title ? 46 : 26 },
      legend: { orientation: "h", x: 0, y: 1.02, yanchor: "bottom", font: { size: 12 } },
      xaxis: { ...scale(x, figure.log_x, figure.x_title), hoverformat: ".4~r" },
      yaxis: scale(y, figure.log_y, figure.y_title, figure.y_range),
    }), hover);
  }

  onFigures("curves", draw);
})();
