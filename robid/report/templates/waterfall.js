"use strict";
// Curves one behind the other along a second axis: drag to turn.
(() => {
  const { colour, names, layout, logTicks, hover, onFigures } = robid;

  function trace(figure, layer, index) {
    const x = [], y = [], z = [];
    figure.places.forEach((place, row) => {
      x.push(...layer.x, null);
      y.push(...layer.x.map(() => place), null);
      z.push(...layer.heights[row], null);
    });
    const shade = colour(names("series")[index % names("series").length]);
    const look = layer.drawn === "points"
      ? { mode: "markers", marker: { size: 1.6, color: shade, line: { width: 0 } } }
      : { mode: "lines", line: { width: 3.5, color: shade, dash: layer.drawn === "dashed" ? "dash" : "solid" } };
    return { type: "scatter3d", name: layer.name, x, y, z, connectgaps: false, hovertemplate: `${layer.name}: %{z:.4~g} at %{x:.4~g}, %{y:.4~g}<extra></extra>`, ...look };
  }

  function draw(host, figure) {
    if (!host.clientWidth) return;
    const axis = (text, extra = {}) => ({
      title: { text, font: { size: 12, color: colour("muted") } }, showbackground: false, zeroline: false, showspikes: false,
      gridcolor: colour("line"), linecolor: colour("rule"), tickfont: { size: 10, color: colour("muted") }, ...extra,
    });
    const all = figure.layers.flatMap((layer) => layer.x);
    const ticks = logTicks(Math.min(...all), Math.max(...all));
    const along = figure.log_x ? { type: "log", tickvals: ticks, ticktext: ticks.map(String) } : {};
    Plotly.react(host, figure.layers.map((layer, index) => trace(figure, layer, index)), layout({
      width: host.clientWidth, height: figure.height, showlegend: true, uirevision: "kept", margin: { l: 0, r: 0, t: 0, b: 0 },
      legend: { orientation: "h", x: 0, y: 1, yanchor: "top", font: { size: 12 }, bgcolor: colour("clear"), itemsizing: "constant" },
      scene: {
        xaxis: axis(figure.x_title, along), yaxis: axis(figure.place_title), zaxis: axis(figure.y_title), dragmode: "turntable", uirevision: "kept",
        aspectmode: "manual", aspectratio: { x: 1.25, y: 1, z: 0.8 },
        camera: { eye: { x: -1.05, y: -1.7, z: 0.8 }, center: { x: -0.1, y: 0.06, z: -0.2 } },
      },
    }), hover);
  }

  onFigures("waterfall", (host, figure) => () => draw(host, figure));
})();
