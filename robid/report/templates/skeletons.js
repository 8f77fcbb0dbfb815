"use strict";
// Arms in space on their floor: drag to turn.
(() => {
  const { colour, layout, hover, onFigures, palette } = robid;
  const HEIGHT = 560;

  function range(values, pad) {
    return [Math.min(...values) - pad, Math.max(...values) + pad];
  }

  function draw(host, figure) {
    const colours = palette(figure.arms.length);
    const heaviest = Math.max(...figure.arms.map((arm) => arm.weight));
    const all = figure.arms.map((arm, index) => ({
      type: "scatter3d", mode: "lines+markers", name: arm.name,
      x: arm.points[0], y: arm.points[1], z: arm.points[2],
      line: { color: colours[index], width: 3 + (7 * arm.weight) / heaviest },
      marker: { color: colours[index], size: arm.points[0].map((_, point) => (point === arm.points[0].length - 1 ? 6 : 3)) },
      hovertemplate: `${arm.name}<br>%{x:.2f}, %{y:.2f}, %{z:.2f} m<extra></extra>`,
    }));
    if (figure.others.length) all.push({
      type: "scatter3d", mode: "markers", name: "tool, other candidates", x: figure.others[0], y: figure.others[1], z: figure.others[2],
      marker: { color: colour("faint"), size: 1.8, opacity: 0.55 }, hoverinfo: "skip",
    });
    const along = [0, 1, 2].map((axis) => figure.arms.flatMap((arm) => arm.points[axis]).concat(figure.others[axis] || []));
    const ends = [range(along[0], 0.15), range(along[1], 0.15), range(along[2].concat([0]), 0.05)];
    const spans = ends.map(([low, high]) => high - low), widest = Math.max(...spans);
    all.push({
      type: "mesh3d", x: [ends[0][0], ends[0][1], ends[0][1], ends[0][0]], y: [ends[1][0], ends[1][0], ends[1][1], ends[1][1]], z: [0, 0, 0, 0],
      i: [0, 0], j: [1, 2], k: [2, 3], color: colour("rule"), opacity: 0.35, hoverinfo: "skip", showlegend: false,
    });
    const axis = (name, values) => ({
      title: { text: `${name} [m]`, font: { size: 12, color: colour("muted") } }, range: values, showbackground: false, zeroline: false, showspikes: false,
      gridcolor: colour("line"), linecolor: colour("rule"), tickfont: { size: 10, color: colour("muted") },
    });
    Plotly.react(host, all, layout({
      width: host.clientWidth, height: HEIGHT, showlegend: true, uirevision: "kept", margin: { l: 0, r: 0, t: 0, b: 0 },
      legend: { x: 1, xanchor: "right", y: 0.98, font: { size: 12 }, bgcolor: colour("clear"), itemsizing: "constant" },
      scene: {
        xaxis: axis("x", ends[0]), yaxis: axis("y", ends[1]), zaxis: axis("z", ends[2]), dragmode: "turntable", uirevision: "kept",
        aspectmode: "manual", aspectratio: { x: spans[0] / widest, y: spans[1] / widest, z: spans[2] / widest },
        camera: { eye: { x: 1.05, y: -1.15, z: 0.5 }, center: { x: 0, y: 0, z: -0.17 } },
      },
    }), hover);
  }

  const columns = (points) => [0, 1, 2].map((axis) => points.map((point) => point[axis]));

  onFigures("skeletons", (host, figure) => {
    const arms = figure.names.map((name, index) => ({ name, weight: figure.weights[index], points: columns(figure.points[index]) }));
    return () => draw(host, { arms, others: figure.others.length ? columns(figure.others) : [] });
  });
})();
