"use strict";
// Values between -1 and 1 of pairs, as a symmetric matrix with its names at both sides; it scrolls where it is narrow.
(() => {
  const { colour, names, axis, layout, element, key, hover, onFigures, colourscale } = robid;
  const LEAST = 12, MOST = 26, LETTER = 6.1, RIGHT = 12;

  function draw(host, inner, figure) {
    if (!host.clientWidth) return;
    const count = figure.names.length, longest = Math.max(...figure.names.map((name) => name.length));
    const side = 16 + LETTER * longest, room = (host.clientWidth - side - RIGHT) / count;
    const cell = Math.max(window.matchMedia("print").matches ? Math.min(room, LEAST) : LEAST, Math.min(room, MOST));
    const places = figure.names.map((_, index) => index), size = { size: Math.min(cell - 1, 11), color: colour("muted") };
    const along = { tickvals: places, ticktext: figure.names, showgrid: false, tickfont: size };
    // Lines between the groups.
    const ends = figure.groups.map((_, index) => figure.groups.slice(0, index + 1).reduce((sum, each) => sum + each, 0) - 0.5).slice(0, -1);
    const line = { type: "line", line: { color: colour("muted"), width: 1 } };
    const shapes = ends.flatMap((end) => [
      { ...line, xref: "x", yref: "paper", x0: end, x1: end, y0: 0, y1: 1 }, { ...line, xref: "paper", yref: "y", x0: 0, x1: 1, y0: end, y1: end },
    ]);
    const width = side + RIGHT + cell * count, height = side + 12 + cell * count;
    inner.style.width = `${width}px`;
    Plotly.react(inner, [{
      type: "heatmap", x: places, y: places, z: figure.values, zmin: -1, zmax: 1, colorscale: colourscale("diverging"), xgap: 1, ygap: 1, hoverongaps: false,
      customdata: figure.names.map((row) => figure.names.map((column) => [row, column])),
      hovertemplate: "%{customdata[0]}, %{customdata[1]}: %{z:.3f}<extra></extra>",
      showscale: false,
    }], layout({
      width, height, margin: { l: side, r: RIGHT, t: side, b: 12 }, shapes,
      xaxis: axis({ ...along, side: "top", tickangle: -90, range: [-0.5, count - 0.5] }),
      yaxis: axis({ ...along, range: [count - 0.5, -0.5] }),
    }), hover);
  }

  onFigures("heatmap", (host, figure) => {
    const inner = element("div"), bar = element("i", { class: "bar" });
    const ends = element("span", {}, `${figure.value_title}: \u22121 `, bar, " 1"), none = { shape: "none", label: "none known" };
    const legend = key(figure.values.flat().includes(null) ? [none] : []);
    legend.prepend(ends);
    host.classList.add("scroller");
    host.before(element("div", { class: "controls" }, legend));
    host.append(inner);
    return () => {
      // Stands above the picture, so that it is seen wherever that is scrolled to.
      bar.style.background = `linear-gradient(to right, ${names("diverging").join(", ")})`;
      draw(host, inner, figure);
    };
  });
})();
