"use strict";
// Distortion, noise and coherence of the measured response, beside the Bode matrix and with its choices.
robid.quality = (() => {
  const { colour, palette, colourscale, axis, layout, title, logTicks, hover } = robid;
  const KINDS = [
    { name: "odd", shade: "odd", dash: "solid", label: "odd distortion" },
    { name: "even", shade: "even", dash: "solid", label: "even distortion" },
    { name: "noise", shade: "other", dash: "dot", label: "noise" },
  ];

  const level = (chosen, name, row, column) => chosen[name][row].map((value, index) => (value === null || chosen.factor[column][index] === null ? null : value + chosen.factor[column][index]));

  // The deviation that noise gives an element; where no periods tell noise, its whole one.
  function deviation(chosen, row, column) {
    if (chosen.noise) return level(chosen, "noise", row, column);
    return chosen.radius[row][column].map((radius, index) => (radius === null || !radius ? null : chosen.magnitude[row][column][index] + 20 * Math.log10(radius / chosen.spread)));
  }

  function key(figure) {
    const any = (test) => figure.responses.some((response) => response.configurations.some(test));
    const line = (shade, dash, label) => ({ shape: "line", label, style: `border-top: 2px ${dash} var(--${shade})` });
    const shown = KINDS.filter(({ name }) => any((one) => one[name])).map(({ shade, dash, label }) => line(shade, dash === "dot" ? "dotted" : "solid", label));
    return any((one) => one.uncompensated) ? [...shown, line("faint", "dashed", "before compensation")] : shown;
  }

  function describe(chosen) {
    const distorted = chosen.odd || chosen.even
      ? " Distortion: what the lines that were not excited show, corrected for feedback and noise included, as a deviation of the averaged response." : "";
    return distorted + (chosen.noise ? " Noise: the deviation that the periods' scatter gives." : "");
  }

  // Edges halfway between the lines, on the logarithmic axis.
  function edges(x) {
    const logs = x.map(Math.log10);
    if (logs.length < 2) return [10 ** (logs[0] - 0.01), 10 ** (logs[0] + 0.01)];
    const inner = logs.slice(1).map((value, index) => (value + logs[index]) / 2);
    return [2 * logs[0] - inner[0], ...inner, 2 * logs[logs.length - 1] - inner[inner.length - 1]].map((value) => 10 ** value);
  }

  function frequencyAxis(frequency) {
    const outer = edges(frequency);
    const ticks = logTicks(frequency[0], frequency[frequency.length - 1]);
    return axis({ type: "log", range: [Math.log10(outer[0]), Math.log10(outer[outer.length - 1])], tickvals: ticks, ticktext: ticks.map(String), title: title("Frequency [Hz]"), showgrid: false });
  }

  function drawRatio(host, response, chosen) {
    const pairs = [], values = [];
    response.outputs.forEach((output, row) => response.inputs.forEach((input, column) => {
      pairs.push(`${output} / ${input}`);
      const noise = deviation(chosen, row, column);
      values.push(chosen.magnitude[row][column].map((value, index) => (value === null || noise[index] === null ? null : Math.round(10 * (value - noise[index])) / 10)));
    }));
    const height = Math.max(pairs.length * 13, 110) + 54;
    const figure = layout({
      width: host.clientWidth, height, margin: { l: 128, r: 92, t: 8, b: 46 },
      xaxis: frequencyAxis(response.frequency),
      yaxis: axis({ tickvals: pairs.map((_, index) => index), ticktext: pairs, range: [pairs.length - 0.5, -0.5], showgrid: false, tickfont: { size: pairs.length > 12 ? 9 : 11, color: colour("muted") } }),
    });
    Plotly.react(host, [{
      type: "heatmap", x: edges(response.frequency), y: pairs.map((_, index) => index), z: values, zmin: 0, zmax: 80, colorscale: colourscale(),
      customdata: pairs.map((pair) => response.frequency.map((hz) => [pair, hz])),
      colorbar: { title: { text: "dB", font: { size: 11, color: colour("muted") } }, thickness: 12, tickfont: { size: 11, color: colour("muted") }, outlinewidth: 0 },
      hovertemplate: "%{customdata[0]} at %{customdata[1]:.4~r} Hz: %{z:.1f} dB<extra></extra>",
    }], figure, hover);
  }

  function drawCoherence(host, response, chosen) {
    const figure = layout({
      showlegend: response.outputs.length > 1, legend: { font: { size: 11, color: colour("muted") }, x: 1.01, xanchor: "left", y: 1, tracegroupgap: 0 },
      width: host.clientWidth, height: 190, margin: { l: 128, r: 92, t: 8, b: 46 },
      xaxis: frequencyAxis(response.frequency),
      yaxis: axis({ type: "log", title: title("1 − coherence"), exponentformat: "power", dtick: 1 }),
    });
    const colours = palette(response.outputs.length);
    Plotly.react(host, response.outputs.map((name, row) => ({
      type: "scatter", mode: "lines", x: response.frequency, y: chosen.incoherence[row].map((value) => (value === null ? null : Math.max(value, 1e-12))), name,
      line: { width: 1.2, color: colours[row] },
      hovertemplate: `${name} %{y:.2~e}<extra></extra>`,
    })), figure, hover);
  }

  function draw(block, response, chosen) {
    for (const [role, present, drawing] of [["ratio", chosen.noise || (chosen.spread && chosen.radius), drawRatio], ["coherence", chosen.incoherence, drawCoherence]]) {
      const host = block.querySelector(`[data-role="${role}"]`);
      host.parentElement.hidden = !present;
      if (present) drawing(host, response, chosen);
    }
  }

  return { KINDS, level, key, describe, draw };
})();
