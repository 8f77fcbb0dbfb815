"use strict";
// Stacked bars of a section, upright or lying.
(() => {
  const { axis, layout, title, hover, onFigures, palette } = robid;

  function draw(host, figure) {
    const colours = palette(figure.parts.length), many = figure.parts.length > 1;
    const all = figure.parts.map((part, index) => ({
      type: "bar", name: part.name, orientation: figure.flat ? "h" : "v",
      x: figure.flat ? part.values : figure.labels, y: figure.flat ? figure.labels : part.values,
      marker: { color: colours[index], opacity: 0.88 },
      hovertemplate: `%{${figure.flat ? "y" : "x"}}${many ? `, ${part.name}` : ""}: %{${figure.flat ? "x" : "y"}:.3g}<extra></extra>`,
    }));
    const labels = axis({ type: "category", showgrid: false, showline: true, title: title(figure.label_title), ...(figure.flat ? { autorange: "reversed" } : { tickangle: figure.labels.length > 24 ? -90 : 0 }) });
    const values = axis({ title: title(figure.value_title), rangemode: "tozero" });
    const longest = Math.max(...figure.labels.map((label) => label.length));
    const entry = 46 + 7 * Math.max(...figure.parts.map((part) => part.name.length));
    const top = many ? 16 + 19 * Math.ceil((entry * figure.parts.length) / (host.clientWidth - 40)) : 8;
    Plotly.react(host, all, layout({
      width: host.clientWidth, height: figure.flat ? top + 50 + 24 * figure.labels.length : 270 + top, barmode: "stack", bargap: 0.35,
      showlegend: many, legend: { orientation: "h", x: 0, y: 1.02, yanchor: "bottom", traceorder: "normal", font: { size: 12 } },
      margin: { l: figure.flat ? 24 + 6.6 * longest : 62, r: 12, t: top, b: 46 },
      xaxis: figure.flat ? values : labels, yaxis: figure.flat ? labels : values,
    }), hover);
  }

  onFigures("bars", draw);
})();
