"use strict";
// Parameters against nominal, cost per configuration, starts, and the filter of the resonances.
(() => {
  const { data, colour, axis, layout, title, logTicks, element, hover, onDraw } = robid;
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

  function drawRatios(host, panels) {
    if (!panels.length) { host.remove(); return; }
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

  function drawCosts(host, groups) {
    const width = host.clientWidth;
    const figure = layout({ width, height: 270, margin: { l: 62, r: 10, t: 28, b: 46 }, annotations: [], bargap: 0.45, shapes: [] });
    const all = [];
    const shown = groups.filter((group) => group.cost.length);
    const total = shown.reduce((sum, group) => sum + group.cost.length + 1, 0) - 1;
    const top = Math.max(...shown.flatMap((group) => [...group.cost, ...group.expected]).filter((value) => value !== null)) * 1.08;
    let position = 0;
    const ticks = [], labels = [];
    shown.forEach((group) => {
      const x = group.cost.map((_, index) => position + index);
      const shade = colour(group.role === "Validation" ? "measured" : "other");
      all.push({ type: "bar", x, y: group.cost, marker: { color: shade, opacity: 0.85 }, customdata: group.label, hovertemplate: `${group.role} %{customdata}: %{y:.4g}<extra></extra>` });
      all.push({ type: "scatter", mode: "markers", x, y: group.expected, marker: { size: 2, color: colour("ink") }, error_x: { type: "constant", value: 0.36, width: 0, thickness: 2.2, color: colour("ink") }, hovertemplate: "expected %{y:.4g}<extra></extra>" });
      figure.annotations.push({ text: `<b>${group.role}</b>`, showarrow: false, xref: "x", yref: "paper", x: position - 0.4, y: 1, xanchor: "left", yanchor: "bottom", yshift: 6, font: { size: 13, color: shade } });
      ticks.push(...x);
      labels.push(...group.label);
      position += group.cost.length + 1;
    });
    figure.xaxis = axis({ tickvals: ticks, ticktext: labels, range: [-0.6, Math.max(total, 12) - 0.4], title: title("Configuration"), showgrid: false, showline: true });
    figure.yaxis = axis({ title: title("Cost (mark: expected)"), range: [0, top], nticks: 6 });
    Plotly.react(host, all, figure, hover);
  }

  function drawStarts(host, starts) {
    const palette = [colour("measured"), colour("model"), colour("even"), colour("other")];
    const costs = starts.map((start) => start.cost).filter((cost) => cost !== null && cost > 0);
    const wide = costs.length && Math.max(...costs) / Math.min(...costs) > 10;
    const figure = layout({
      width: host.clientWidth, height: 270, margin: { l: 62, r: 10, t: 14, b: 46 },
      xaxis: axis({ title: title("Start, by cost"), showgrid: false, showline: true, tickvals: starts.length > 30 ? undefined : starts.map((_, index) => index), ticktext: starts.map((start) => start.start), range: [-0.6, starts.length - 0.4] }),
      yaxis: axis({ title: title("Cost"), type: wide ? "log" : "linear", rangemode: "tozero", nticks: 6, exponentformat: "power" }),
    });
    Plotly.react(host, [{
      type: "scatter", mode: "markers", x: starts.map((_, index) => index), y: starts.map((start) => start.cost),
      marker: { size: 9, color: starts.map((start) => palette[Math.min(start.minimum, palette.length - 1)]) },
      customdata: starts.map((start) => [start.start, start.minimum + 1, start.status]),
      hovertemplate: "start %{customdata[0]}: %{y:.6g}<br>minimum %{customdata[1]}, %{customdata[2]}<extra></extra>",
    }], figure, hover);
  }

  function filterResonances(article, fit) {
    const table = article.querySelector('[data-role="resonances"]');
    const host = article.querySelector('[data-role="resonance-controls"]');
    const rows = table ? [...table.querySelectorAll("tr[data-configuration]")] : [];
    const present = [...new Set(rows.map((row) => row.dataset.configuration))];
    if (present.length < 2) { if (host) host.remove(); return; }
    const select = element("select", { onchange: () => rows.forEach((row) => { row.hidden = select.value !== "" && row.dataset.configuration !== select.value; }) },
      element("option", { value: "" }, "all"),
      ...present.map((index) => element("option", { value: index }, fit.responses[0].configurations[Number(index)].label)));
    host.append(element("label", {}, "Configuration", select));
  }

  document.querySelectorAll("article[data-fit]").forEach((article) => {
    const fit = data.fits[Number(article.dataset.fit)];
    const draw = (role, drawing, values) => {
      const host = article.querySelector(`[data-role="${role}"]`);
      if (host) onDraw(() => drawing(host, values));
    };
    draw("ratios", drawRatios, fit.ratios);
    draw("costs", drawCosts, fit.costs);
    draw("starts", drawStarts, fit.starts);
    filterResonances(article, fit);
  });
})();
