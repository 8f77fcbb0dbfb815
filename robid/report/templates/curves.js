"use strict";
// Curves or points over one axis, with bands, straight lines and a legend.
(() => {
  const { colour, names, axis, layout, title, logTicks, hover, onFigures } = robid;
  const DASHES = ["solid", "dash", "dot", "dashdot"];
  const SYMBOLS = { dot: "circle", small: "circle", cross: "x-thin", ring: "circle-open", square: "square", diamond: "diamond" };
  const BAND = 0.2;
  const MOST_DECADES = 8;

  function scale(values, isLog, text, given) {
    const known = (given || values).filter((value) => value !== null && (!isLog || value > 0));
    const low = Math.min(...known), high = Math.max(...known);
    if (!known.length || !isLog) return axis({ title: title(text), showline: true, ...(given ? { range: given } : {}) });
    const ends = [Math.log10(low), Math.log10(high)];
    const pad = Math.max(0.04 * (ends[1] - ends[0]), 0.01);
    const decades = logTicks(low / 2, high * 2, [1]), every = Math.ceil(decades.length / MOST_DECADES);
    const ticks = high / low > 1e3 ? decades.filter((_, index) => index % every === 0) : logTicks(low / 2, high * 2);
    return axis({ title: title(text), showline: true, type: "log", range: [ends[0] - pad, ends[1] + pad], tickvals: ticks, ticktext: ticks.map((tick) => (tick >= 1e-3 && tick < 1e5 ? String(tick) : `10<sup>${Math.round(Math.log10(tick))}</sup>`)) });
  }

  // Labels in place of numbers at 0, 1, ...; all of them where there is room.
  function labelled(labels) {
    const places = labels.map((_, index) => index);
    return axis({ showgrid: false, showline: true, range: [-0.6, labels.length - 0.4], ...(labels.length > 30 ? {} : { tickvals: places, ticktext: labels }) });
  }

  function shadeOf(curve, index) {
    const series = names("series"), place = curve.shade === undefined ? index : curve.shade;
    return colour(series[place % series.length]);
  }

  function trace(curve, index) {
    const shade = shadeOf(curve, index), symbol = curve.symbol || "dot";
    const hovertemplate = curve.texts ? "%{text}<extra></extra>" : `${curve.name}: %{y:.3g}<extra></extra>`;
    const drawn = { type: "scatter", name: curve.name, x: curve.x, y: curve.y, text: curve.texts, hovertemplate };
    if (!curve.points) return { ...drawn, mode: "lines", line: { color: shade, width: curve.width || 1.8, dash: curve.shade === undefined ? DASHES[index % DASHES.length] : DASHES[curve.dashed ? 1 : 0] } };
    return { ...drawn, mode: "markers", marker: { size: symbol === "small" ? 4 : 9, color: shade, symbol: SYMBOLS[symbol], line: { color: shade, width: ["dot", "small"].includes(symbol) ? 0 : 1.8 } } };
  }

  // The outline of a band, one for each run without a gap.
  function bandOf(curve, index) {
    if (!curve.lower) return [];
    const x = [], y = [];
    let start = 0;
    for (let end = 0; end <= curve.x.length; end += 1) {
      if (end < curve.x.length && curve.lower[end] !== null && curve.upper[end] !== null) continue;
      if (end - start > 1) {
        x.push(...curve.x.slice(start, end), ...curve.x.slice(start, end).reverse(), null);
        y.push(...curve.upper.slice(start, end), ...curve.lower.slice(start, end).reverse(), null);
      }
      start = end + 1;
    }
    return [{ type: "scatter", mode: "lines", x, y, fill: "toself", fillcolor: shadeOf(curve, index), opacity: BAND, line: { width: 0 }, hoverinfo: "skip", showlegend: false }];
  }

  function straight(line) {
    const [own, other] = line.along === "x" ? ["x", "y"] : ["y", "x"];
    return { type: "line", [`${own}ref`]: own, [`${other}ref`]: "paper", [`${own}0`]: line.at, [`${own}1`]: line.at, [`${other}0`]: 0, [`${other}1`]: 1, line: { color: colour("muted"), width: 1, dash: "dot" } };
  }

  // Names of upright lines stand at their right, as far as there is room.
  function labelOf(line, isLog, index, room) {
    const at = isLog ? Math.log10(line.at) : line.at, fits = room(at) > 6 * line.name.length;
    const across = fits ? { x: at, xref: "x", xanchor: "left", xshift: 3 } : { x: 1, xref: "paper", xanchor: "right" };
    const place = line.along === "x" ? { ...across, y: 1, yref: "paper", yanchor: "top", yshift: -15 * index } : { y: at, yref: "y", x: 1, xref: "paper", xanchor: "right", yanchor: "bottom" };
    return { ...place, text: line.name, showarrow: false, bgcolor: colour("veil"), font: { size: 11, color: colour("muted") } };
  }

  function draw(host, figure) {
    if (!host.clientWidth) return;
    const x = figure.curves.flatMap((curve) => curve.x);
    const y = figure.curves.flatMap((curve) => [...curve.y, ...(curve.lower || []), ...(curve.upper || [])]);
    const across = figure.x_labels.length ? { ...labelled(figure.x_labels), title: title(figure.x_title) } : { ...scale(x, figure.log_x, figure.x_title, figure.x_range), hoverformat: ".4~r" };
    const upright = scale(y, figure.log_y, figure.y_title, figure.y_range);
    const bands = figure.curves.flatMap(bandOf);
    const ends = (figure.x_range || x).filter((value) => value !== null && (!figure.log_x || value > 0)).map((value) => (figure.log_x ? Math.log10(value) : value));
    const [low, high] = [Math.min(...ends), Math.max(...ends)];
    const room = (at) => (host.clientWidth - 82) * (high - at) / (high - low);
    Plotly.react(host, [...bands, ...figure.curves.map(trace)], layout({
      width: host.clientWidth, height: figure.height, hovermode: figure.curves.some((curve) => curve.points) ? "closest" : "x", showlegend: figure.legend,
      margin: { l: figure.y_title ? 72 : 46, r: 10, t: figure.legend ? 34 : 6, b: figure.x_title ? 46 : 26 },
      legend: { orientation: "h", x: 0, y: 1.02, yanchor: "bottom", font: { size: 12 } },
      shapes: figure.lines.map(straight),
      annotations: figure.lines.filter((line) => line.name).map((line, index) => labelOf(line, line.along === "x" ? figure.log_x : figure.log_y, index, room)),
      xaxis: across,
      yaxis: figure.equal ? { ...upright, scaleanchor: "x", scaleratio: 1 } : upright,
    }), hover);
  }

  onFigures("curves", (host, figure) => () => draw(host, figure));
})();
