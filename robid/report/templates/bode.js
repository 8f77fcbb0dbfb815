"use strict";
// The Bode matrix, what of it is shown, and the enlarged element.
(() => {
  const { colour, names, axis, layout, title, logTicks, element, key, choices, onDraw, onFigures } = robid;
  const VIEWS = ["Magnitude", "Phase"], PHASE = 1;
  const FLOOR_DB = -40;
  const ALONE = 1.006;

  // Splits a wrapped phase into runs without jumps, with a gap between them.
  function broken(x, y) {
    const outX = [], outY = [];
    y.forEach((value, index) => {
      if (index > 0 && value !== null && y[index - 1] !== null && Math.abs(value - y[index - 1]) > 180) {
        outX.push(x[index]);
        outY.push(null);
      }
      outX.push(x[index]);
      outY.push(value);
    });
    return { x: outX, y: outY };
  }

  // Closed outlines of the band, one per run without jump or missing value.
  function outline(x, lower, upper, jump) {
    const outX = [], outY = [];
    let start = 0;
    const close = (end) => {
      if (end > start) {
        // A line without neighbours has a band as wide as its point.
        const alone = end - start === 1;
        const run = (values) => (alone ? [values[start], values[start]] : values.slice(start, end));
        const across = alone ? [x[start] / ALONE, x[start] * ALONE] : run(x);
        outX.push(...across, ...[...across].reverse(), null);
        outY.push(...run(upper), ...run(lower).reverse(), null);
      }
      start = end;
    };
    for (let index = 0; index < x.length; index += 1) {
      if (lower[index] === null) { close(index); start = index + 1; }
      else if (index > start && Math.abs(upper[index] - upper[index - 1]) > jump) close(index);
    }
    close(x.length);
    return { x: outX, y: outY };
  }

  function curves(response, chosen, view, row, column) {
    const x = response.frequency;
    const phase = view === PHASE;
    const of = (curve) => (phase ? curve.phase : curve.magnitude)[row][column];
    const band = (curve, at) => bandOf(at, of(curve), curve.radius ? curve.radius[row][column] : null, phase);
    const models = chosen.models.map((model, index) => ({ name: response.models[index], ...(phase ? broken(x, of(model)) : { x, y: of(model) }) }));
    const overlays = chosen.overlays.map((overlay, index) => {
      const { name, frequency } = response.overlays[index];
      return { name, x: frequency, y: of(overlay), band: band(overlay, frequency) };
    });
    return { x, measured: of(chosen), band: band(chosen, x), models, overlays };
  }

  // Outline of the circles that hold the true response, in dB or degrees.
  function bandOf(x, y, radius, phase) {
    if (!radius) return { x: [], y: [] };
    const half = radius.map((r) => (r === null ? null : r < 1 ? (Math.asin(r) * 180) / Math.PI : 180));
    const lower = y.map((value, i) => (radius[i] === null || value === null ? null
      : phase ? value - half[i] : value + Math.max(20 * Math.log10(Math.max(1 - radius[i], 1e-9)), FLOOR_DB)));
    const upper = y.map((value, i) => (lower[i] === null ? null : phase ? value + half[i] : value + 20 * Math.log10(1 + radius[i])));
    return outline(x, lower, upper, phase ? 180 : Infinity);
  }

  const modelName = (index) => names("series").slice(1)[index % (names("series").length - 1)];
  const modelColour = (index) => colour(modelName(index));

  function traces(drawn, axes, size, measured) {
    const area = { ...axes, type: "scatter", mode: "lines", fill: "toself", line: { width: 0 }, hoverinfo: "skip" };
    return [
      { ...drawn.band, ...area, fillcolor: colour("band") },
      { x: drawn.x, y: drawn.measured, ...axes, type: "scatter", mode: "markers", marker: { color: colour("measured"), size: size.dot, line: { width: 0 } }, name: measured, hovertemplate: `${measured} %{y:.2f}<extra></extra>` },
      ...drawn.overlays.flatMap(({ name, x, y, band }, index) => [
        { ...band, ...area, fillcolor: modelColour(index), opacity: 0.2 },
        { x, y, ...axes, type: "scatter", mode: "markers", marker: { symbol: "circle-open", color: modelColour(index), size: size.dot + 1, line: { width: 1.2 } }, name, hovertemplate: `${name} %{y:.2f}<extra></extra>` },
      ]),
      ...drawn.models.map(({ name, ...curve }, index) => ({ ...curve, ...axes, type: "scatter", mode: "lines", line: { color: modelColour(index), width: size.line }, name, hovertemplate: `${name} %{y:.2f}<extra></extra>` })),
    ];
  }

  // Levels of distortion and noise in the response's unit, and the response before compensation.
  function levels(response, chosen, view, row, column, axes, width) {
    if (view === PHASE) return [];
    const lines = robid.quality.KINDS.filter(({ name }) => chosen[name]).map(({ name, shade, dash, label }) => ({
      ...axes, x: response.frequency, y: robid.quality.level(chosen, name, row, column), type: "scatter", mode: "lines",
      line: { color: colour(shade), width, dash }, hovertemplate: `${label} %{y:.1f}<extra></extra>`,
    }));
    if (chosen.uncompensated) lines.push({
      ...axes, x: response.frequency, y: chosen.uncompensated[row][column], type: "scatter", mode: "lines",
      line: { color: colour("faint"), width, dash: "dash" }, hovertemplate: "before compensation %{y:.2f}<extra></extra>",
    });
    return lines;
  }

  // Crosses at the bottom, where lines told too little of the input.
  function gaps(lost, axes, bottom, size) {
    if (!lost.length) return [];
    return [{
      ...axes, x: lost, y: lost.map(() => bottom), type: "scatter", mode: "markers", cliponaxis: false,
      marker: { symbol: "x-thin", size: size.dot + 2, line: { width: 1.2, color: colour("faint") } }, hovertemplate: "dropped<extra></extra>",
    }];
  }

  function magnitudeRange(response, chosen) {
    const below = robid.quality.KINDS.filter(({ name }) => chosen[name])
      .flatMap(({ name }) => response.outputs.flatMap((_, row) => response.inputs.flatMap((__, column) => robid.quality.level(chosen, name, row, column))));
    const all = [chosen, ...chosen.models, ...chosen.overlays].flatMap((curve) => curve.magnitude.flat(2)).concat(below).filter((y) => y !== null && y > -500);
    if (!all.length) return [-60, 0];
    const low = Math.min(...all), high = Math.max(...all);
    const pad = Math.max(0.04 * (high - low), 2);
    return [low - pad, high + pad];
  }

  function frequencyEnds(response) {
    const every = [response.frequency, ...response.overlays.map((overlay) => overlay.frequency)].flat();
    return [Math.min(...every), Math.max(...every)];
  }

  function frequencyRange(response) {
    const [low, high] = frequencyEnds(response).map(Math.log10);
    const pad = Math.max(0.03 * (high - low), 0.01);
    return [low - pad, high + pad];
  }

  function decibelStep(range, height) {
    const wanted = ((range[1] - range[0]) * 15) / height;
    return [2, 5, 10, 20, 40, 60, 100].find((step) => step >= wanted) || 100;
  }

  function geometry(response, width) {
    const outputs = response.outputs.length, inputs = response.inputs.length;
    const margin = { l: 76, r: 6, t: 24, b: 42 };
    const gap = outputs > 3 || inputs > 3 ? 6 : 16;
    const cellWidth = (width - margin.l - margin.r - gap * (inputs - 1)) / inputs;
    const cellHeight = Math.max(Math.min(cellWidth * 0.72, outputs > 3 ? 128 : 260), 60);
    const height = margin.t + margin.b + outputs * cellHeight + (outputs - 1) * gap;
    return { margin, gap, cellWidth, cellHeight, height, width, outputs, inputs };
  }

  function matrix(response, chosen, view, place, measured) {
    const annotations = [], all = [];
    const figure = layout({ margin: place.margin, width: place.width, height: place.height });
    const plotWidth = place.width - place.margin.l - place.margin.r, plotHeight = place.height - place.margin.t - place.margin.b;
    const range = view === PHASE ? [-200, 200] : magnitudeRange(response, chosen);
    const ticks = logTicks(...frequencyEnds(response));
    for (let row = 0; row < place.outputs; row += 1) {
      for (let column = 0; column < place.inputs; column += 1) {
        const number = row * place.inputs + column + 1;
        const suffix = number === 1 ? "" : String(number);
        const left = (column * (place.cellWidth + place.gap)) / plotWidth, right = left + place.cellWidth / plotWidth;
        const top = 1 - (row * (place.cellHeight + place.gap)) / plotHeight, bottom = top - place.cellHeight / plotHeight;
        const frame = { showline: true, mirror: true, linecolor: row === column ? colour("faint") : colour("line"), linewidth: 1 };
        figure[`xaxis${suffix}`] = axis({ ...frame, type: "log", domain: [left, right], anchor: `y${suffix}`, range: frequencyRange(response), tickvals: ticks, ticktext: ticks.map(String), tickangle: 0, showticklabels: row === place.outputs - 1 });
        figure[`yaxis${suffix}`] = axis({ ...frame, domain: [Math.max(bottom, 0), Math.min(top, 1)], anchor: `x${suffix}`, range, dtick: view === PHASE ? 90 : decibelStep(range, place.cellHeight), tick0: 0, showticklabels: column === 0 });
        const axes = { xaxis: `x${suffix}`, yaxis: `y${suffix}` };
        const size = place.cellWidth < 260 ? { line: 1.1, dot: 3.6 } : { line: 1.4, dot: 5 };
        all.push(...traces(curves(response, chosen, view, row, column), axes, size, measured));
        all.push(...gaps(chosen.dropped[column], axes, range[0] + 0.03 * (range[1] - range[0]), size));
        all.push(...levels(response, chosen, view, row, column, axes, place.cellWidth < 260 ? 0.8 : 1.1));
      }
    }
    const label = { showarrow: false, xref: "paper", yref: "paper", font: { size: 12, color: colour("ink") } };
    response.inputs.forEach((name, column) => annotations.push({ ...label, text: name, x: (column * (place.cellWidth + place.gap) + place.cellWidth / 2) / plotWidth, xanchor: "center", y: 1, yanchor: "bottom", yshift: 3 }));
    response.outputs.forEach((name, row) => annotations.push({ ...label, text: name, textangle: -90, x: 0, xshift: -62, y: 1 - (row * (place.cellHeight + place.gap) + place.cellHeight / 2) / plotHeight, yanchor: "middle", xanchor: "center" }));
    annotations.push({ ...label, text: view === PHASE ? "°" : "dB", font: { size: 11, color: colour("muted") }, x: 0, xanchor: "right", xshift: -4, y: 1, yanchor: "bottom", yshift: 3 });
    annotations.push({ ...label, text: "Frequency [Hz]", font: { size: 12, color: colour("muted") }, x: 0.5, xanchor: "center", y: 0, yanchor: "top", yshift: -22 });
    return { traces: all, layout: { ...figure, annotations } };
  }

  // ---------------------------------------------------------------- enlarged element
  const dialog = document.getElementById("enlarged");
  let shown = null;
  const place = choices(null, [
    { key: "output", options: () => (shown ? shown.response.outputs : []) },
    { key: "input", options: () => (shown ? shown.response.inputs : []) },
  ], drawEnlarged);

  function elementName(figure, response, row, column) {
    return `${response.outputs[row]} ${figure.output_quantity} per ${response.inputs[column]} ${figure.input_quantity}`;
  }

  function drawEnlarged() {
    if (!shown || !dialog.open) return;
    const { figure: matrix, response, configuration } = shown;
    const { output: row, input: column } = place.state;
    const chosen = response.configurations[configuration];
    const style = { line: 1.6, dot: 6 };
    document.getElementById("enlarged-title").textContent = `${elementName(matrix, response, row, column)}, configuration ${chosen.label}`;
    document.getElementById("enlarged-key").replaceChildren(legend(matrix));
    const marks = chosen.marks.filter(([channel]) => channel === response.outputs[row] && (response.inputs[column] === channel || response.inputs.length === 1));
    document.getElementById("enlarged-caption").textContent = describe(matrix, response, chosen, PHASE)
      + (marks.length ? ` Dotted lines: ${response.mark_title}.` : "");
    const [lowest, highest] = frequencyEnds(response);
    const ticks = logTicks(lowest / 2, highest * 2);
    const shared = { type: "log", range: frequencyRange(response), tickvals: ticks, ticktext: ticks.map(String), fixedrange: false };
    const figure = layout({
      width: dialog.clientWidth - 52, height: Math.min(Math.max(window.innerHeight * 0.66, 360), 640),
      margin: { l: 62, r: 10, t: 30, b: 46 }, hovermode: "x", dragmode: "zoom",
      modebar: { bgcolor: colour("clear"), color: colour("faint"), activecolor: colour("ink") },
      xaxis: axis({ ...shared, domain: [0, 1], anchor: "y2", title: title("Frequency [Hz]"), hoverformat: ".4~r" }),
      yaxis: axis({ domain: [0.42, 1], anchor: "x", title: title(`Magnitude [dB re 1 ${response.unit}]`), fixedrange: false }),
      yaxis2: axis({ domain: [0, 0.36], anchor: "x", title: title("Phase [°]"), range: [-200, 200], dtick: 90, fixedrange: false }),
      shapes: marks.map(([, hz]) => ({ type: "line", xref: "x", yref: "paper", x0: hz, x1: hz, y0: 0, y1: 1, line: { color: colour("faint"), width: 1, dash: "dot" } })),
    });
    const all = [
      ...traces(curves(response, chosen, 0, row, column), { xaxis: "x", yaxis: "y" }, style, matrix.measured),
      ...traces(curves(response, chosen, PHASE, row, column), { xaxis: "x", yaxis: "y2" }, style, matrix.measured),
      ...gaps(chosen.dropped[column], { xaxis: "x", yaxis: "y2" }, -190, style),
      ...levels(response, chosen, 0, row, column, { xaxis: "x", yaxis: "y" }, 1.3),
    ];
    Plotly.react("enlarged-plot", all, figure, robid.zoomable);
    dialog.querySelectorAll("[data-move]").forEach((button) => {
      const [down, right] = button.dataset.move.split(",").map(Number);
      button.disabled = !(down ? place.can("output", down) : place.can("input", right));
    });
  }

  function move(down, right) {
    if (down) place.step("output", down);
    else place.step("input", right);
  }

  dialog.querySelectorAll("[data-move]").forEach((button) => button.addEventListener("click", () => move(...button.dataset.move.split(",").map(Number))));
  dialog.querySelector("[data-close]").addEventListener("click", () => dialog.close());
  dialog.addEventListener("click", (event) => { if (event.target === dialog) dialog.close(); });
  dialog.addEventListener("keydown", (event) => {
    const steps = { ArrowLeft: [0, -1], ArrowRight: [0, 1], ArrowUp: [-1, 0], ArrowDown: [1, 0] };
    if (event.key in steps) { event.preventDefault(); move(...steps[event.key]); }
  });

  function describe(figure, response, chosen, view) {
    const band = chosen.radius
      ? `Shaded: the circle that holds the true response with ${figure.level} probability, cut off at ${-FLOOR_DB} dB below the measurement.`
      : "No covariance is known for these data, so there is no uncertainty band.";
    return view === PHASE ? band : `Magnitude in dB relative to 1 ${response.unit}. ${band}${robid.quality.describe(chosen)}`;
  }

  // ---------------------------------------------------------------- the matrix on the page
  function legend(figure) {
    const models = [...new Set(figure.responses.flatMap((response) => response.models))];
    const overlays = [...new Set(figure.responses.flatMap((response) => response.overlays.map(({ name }) => name)))];
    const dropped = figure.responses.some((response) => response.configurations.some((one) => one.dropped.flat().length));
    return key([
      { shape: "dot", label: figure.measured },
      ...overlays.map((label, index) => ({ shape: "ring", label, style: `border-color: var(--${modelName(index)})` })),
      { shape: "area", label: `${figure.level} band` }, ...(dropped ? [{ shape: "text", label: "× dropped line" }] : []),
      ...models.map((label, index) => ({ shape: "stroke", label, style: `background: var(--${modelName(index)})` })),
      ...robid.quality.key(figure),
    ]);
  }

  onFigures("bode", (block, figure) => {
    const find = (role) => block.querySelector(`[data-role="${role}"]`);
    const host = find("matrix");
    const plot = element("div");
    const cells = element("div");
    host.append(plot, cells);

    function cover(response, configuration, g) {
      cells.replaceChildren(...response.outputs.flatMap((_, row) => response.inputs.map((__, column) => element("button", {
        type: "button", class: "cell", "aria-label": `enlarge ${elementName(figure, response, row, column)}`,
        style: `left:${g.margin.l + column * (g.cellWidth + g.gap)}px;top:${g.margin.t + row * (g.cellHeight + g.gap)}px;width:${g.cellWidth}px;height:${g.cellHeight}px`,
        onclick: () => { shown = { figure, response, configuration }; dialog.showModal(); place.set({ output: row, input: column }); },
      }))));
    }

    function draw() {
      const { response: which, configuration, view } = chosen.state;
      const response = figure.responses[which], one = response.configurations[configuration];
      const smallest = response.inputs.length > 3 && !window.matchMedia("print").matches ? 700 : 280;
      const g = geometry(response, Math.max(host.parentElement.clientWidth, smallest));
      host.style.width = `${g.width}px`;
      const drawn = matrix(response, one, view, g, figure.measured);
      Plotly.react(plot, drawn.traces, drawn.layout, robid.still);
      cover(response, configuration, g);
      find("caption").textContent = describe(figure, response, one, view);
      robid.quality.draw(block, response, one);
    }

    const chosen = choices(find("controls"), [
      { key: "response", label: "Data", look: "list", options: () => figure.responses.map((response) => response.label) },
      { key: "configuration", label: "Configuration", look: "steps", after: "response", options: (state) => figure.responses[state.response].configurations.map((one) => one.label) },
      { key: "view", label: "View", look: "buttons", options: () => VIEWS },
    ], draw);
    find("controls").append(legend(figure));
    return draw;
  });
  onDraw(drawEnlarged);
})();
