"use strict";
// Curves or points over one axis, with a legend.
(() => {
  const { colour, names, axis, layout, title, logTicks, hover, onFigures } = robid;
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

  // Labels in place of numbers at 0, 1, ...; all of them where there is room.
  function labelled(labels) {
    const places = labels.map((_, index) => index);
    return axis({ showgrid: false, showline: true, range: [-0.6, labels.length - 0.4], ...(labels.length > 30 ? {} : { tickvals: places, ticktext: labels }) });
  }

  function trace(curve, index) {
    const series = names("series"), shade = colour(series[index % series.length]);
    const hovertemplate = curve.texts ? "%{text}<extra></extra>" : `${curve.name}: %{y:.3g}<extra></extra>`;
    const drawn = { type: "scatter", name: curve.name, x: curve.x, y: curve.y, text: curve.texts, hovertemplate };
    return curve.points ? { ...drawn, mode: "markers", marker: { size: 9, color: shade } }
      : { ...drawn, mode: "lines", line: { color: shade, width: 1.8, dash: DASHES[index % DASHES.length] } };
  }

  function draw(host, figure) {
    const x = figure.curves.flatMap((curve) => curve.x), y = figure.curves.flatMap((curve) => curve.y);
    Plotly.react(host, figure.curves.map(trace), layout({
      width: host.clientWidth, height: figure.height, hovermode: figure.curves.some((curve) => curve.points) ? "closest" : "x", showlegend: figure.legend,
      margin: { l: figure.y_title ? 72 : 46, r: 10, t: figure.legend ? 34 : 6, b: figure.x_title ? 46 : 26 },
      legend: { orientation: "h", x: 0, y: 1.02, yanchor: "bottom", font: { size: 12 } },
      xaxis: figure.x_labels.length ? { ...labelled(figure.x_labels), title: title(figure.x_title) } : { ...scale(x, figure.log_x, figure.x_title), hoverformat: ".4~r" },
      yaxis: scale(y, figure.log_y, figure.y_title, figure.y_range),
    }), hover);
  }

  onFigures("curves", (host, figure) => () => draw(host, figure));
})();
