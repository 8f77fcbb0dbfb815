"use strict";
// Values over their nominal ones, in panels on one scale, with intervals and the truth.
(() => {
  const { colour, axis, layout, title, logTicks, element, key, hover, onFigures } = robid;

  function ratioRange(panels) {
    const kept = panels.flatMap((panel) => panel.rows).flatMap((row) => [row.estimate, row.truth, ...(row.identifiable ? [row.lower, row.upper] : [])]);
    const logs = [1, ...kept].filter((value) => value !== null && value > 0).map((value) => Math.log10(value));
    const low = Math.max(Math.min(...logs), -3), high = Math.min(Math.max(...logs), 3);
    const pad = Math.max(0.08 * (high - low), 0.03);
    return [low - pad, high + pad];
  }

  function ratioTicks(range) {
    const fine = [1, 1.1, 1.2, 1.3, 1.4, 1.6, 1.8, 2, 2.5, 3, 4, 5, 6, 7, 8, 9];
    const steps = [[1], [1, 2, 5], [1, 1.5, 2, 3, 5, 7], fine];
    const choices = steps.map((step) => logTicks(10 ** range[0], 10 ** range[1], step));
    return choices.find((values) => values.length >= 4) || choices[choices.length - 1];
  }

  function ratioTraces(panel, axes, range) {
    const floor = 10 ** (range[0] - 1);
    const part = (identifiable) => panel.rows.filter((row) => row.identifiable === identifiable);
    const dots = (rows, name) => ({
      ...axes, type: "scatter", mode: "markers", x: rows.map((row) => row.estimate), y: rows.map((row) => row.name),
      marker: { color: colour(name), size: 8 }, customdata: rows.map((row) => [row.text, row.lower, row.upper]),
      error_x: {
        type: "data", symmetric: false, color: colour(name), thickness: 1.6, width: 4,
        array: rows.map((row) => row.upper - row.estimate), arrayminus: rows.map((row) => row.estimate - Math.max(row.lower, floor)),
      },
      hovertemplate: "%{y}: %{customdata[0]}<br>%{x:.3g} × nominal (%{customdata[1]:.3g} … %{customdata[2]:.3g})<extra></extra>",
    });
    const known = panel.rows.filter((row) => row.truth !== null);
    return [
      dots(part(true), "measured"), dots(part(false), "faint"),
      { ...axes, type: "scatter", mode: "markers", x: known.map((row) => row.truth), y: known.map((row) => row.name),
        marker: { symbol: "diamond-open", size: 11, color: colour("model"), line: { width: 1.8 } },
        hovertemplate: "%{y}: truth %{x:.4g} × nominal<extra></extra>" },
    ];
  }

  function draw(host, panels) {
    const width = host.clientWidth;
    const across = width > 760 ? panels.length : 1;
    const rows = Math.max(...panels.map((panel) => panel.rows.length));
    const count = panels.length / across;
    const panelHeight = Math.max(rows * 24 + 12, 60), between = 92;
    const margin = { l: 108, r: 10, t: 30, b: 46 };
    const height = margin.t + margin.b + count * panelHeight + (count - 1) * between;
    const figure = layout({ width, height, margin, annotations: [], shapes: [] });
    const all = [];
    const range = ratioRange(panels);
    const inner = width - margin.l - margin.r, tall = height - margin.t - margin.b;
    panels.forEach((panel, index) => {
      const suffix = index === 0 ? "" : String(index + 1);
      const column = across > 1 ? index : 0, row = across > 1 ? 0 : index;
      const share = (inner - (across - 1) * 116) / across / inner;
      const left = column * (share + 116 / inner), top = 1 - (row * (panelHeight + between)) / tall;
      const values = ratioTicks(range);
      figure[`xaxis${suffix}`] = axis({ type: "log", domain: [left, Math.min(left + share, 1)], anchor: `y${suffix}`, range, tickvals: values, ticktext: values.map(String), title: title("Estimate relative to nominal"), showline: true });
      figure[`yaxis${suffix}`] = axis({ domain: [Math.max(top - panelHeight / tall, 0), Math.min(top, 1)], anchor: `x${suffix}`, type: "category", categoryorder: "array", categoryarray: panel.rows.map((one) => one.name), range: [panel.rows.length - 0.4, -0.6], tickfont: { size: 12, color: colour("ink") } });
      figure.annotations.push({ text: `<b>${panel.title}</b>`, showarrow: false, xref: "paper", yref: "paper", x: left, y: top, yanchor: "bottom", xanchor: "left", yshift: 6, font: { size: 13 } });
      figure.shapes.push({ type: "line", xref: `x${suffix}`, yref: `y${suffix} domain`, x0: 1, x1: 1, y0: 0, y1: 1, line: { color: colour("muted"), width: 1 }, layer: "below" });
      all.push(...ratioTraces(panel, { xaxis: `x${suffix}`, yaxis: `y${suffix}` }, range));
    });
    Plotly.react(host, all, figure, hover);
  }

  function legend(figure) {
    const rows = figure.panels.flatMap((panel) => panel.rows);
    return key([
      { shape: "whisker", label: `estimate with ${figure.interval}` },
      ...(rows.some((row) => !row.identifiable) ? [{ shape: "whisker grey", label: "not identifiable" }] : []),
      ...(rows.some((row) => row.truth !== null) ? [{ shape: "diamond", label: "truth" }] : []),
    ]);
  }

  onFigures("ratios", (host, { interval, panels: named }) => {
    const figure = { interval, panels: named.map(([title, rows]) => ({ title, rows })) };
    host.before(element("div", { class: "controls" }, legend(figure)));
    return () => draw(host, figure.panels);
  });
})();
