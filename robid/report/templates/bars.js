"use strict";
// Stacked bars, upright or lying, in groups, with what each is held against.
(() => {
  const { colour, names, axis, layout, title, hover, onFigures, palette } = robid;
  const FEWEST = 12;

  // Where the bars stand, with a gap between groups.
  function positions(figure) {
    const groups = figure.groups.length ? figure.groups : [{ name: "", count: figure.labels.length }];
    let next = 0;
    return groups.map(({ name, count }) => {
      const places = Array.from({ length: count }, (_, index) => next + index);
      next += count + 1;
      return { name, places };
    });
  }

  function bars(figure, groups) {
    const along = figure.flat ? ["y", "x"] : ["x", "y"];
    const colours = palette(figure.parts.length), shades = names("groups"), grouped = figure.groups.length > 0;
    let first = 0;
    return groups.flatMap(({ name, places }, group) => {
      const from = first;
      first += places.length;
      return figure.parts.map((part, index) => {
        const said = [name, "%{customdata}", ...(figure.parts.length > 1 ? [part.name] : [])].filter((text) => text).join(", ");
        return {
          type: "bar", name: part.name, orientation: figure.flat ? "h" : "v", showlegend: group === 0,
          [along[0]]: places, [along[1]]: part.values.slice(from, first), customdata: figure.labels.slice(from, first),
          marker: { color: grouped && figure.parts.length === 1 ? colour(shades[group % shades.length]) : colours[index], opacity: 0.88 },
          hovertemplate: `${said}: %{${along[1]}:.4~g}<extra></extra>`,
        };
      });
    });
  }

  function marks(figure, places) {
    if (!figure.marks.length) return [];
    const along = figure.flat ? ["y", "x"] : ["x", "y"];
    return [{
      type: "scatter", mode: "markers", [along[0]]: places, [along[1]]: figure.marks, marker: { size: 2, color: colour("ink") }, showlegend: false,
      [`error_${along[0]}`]: { type: "constant", value: 0.36, width: 0, thickness: 2.2, color: colour("ink") },
      hovertemplate: `${figure.mark_title} %{${along[1]}:.4~g}<extra></extra>`,
    }];
  }

  function heads(groups) {
    const shades = names("groups");
    return groups.map(({ name, places }, group) => ({
      text: `<b>${name}</b>`, showarrow: false, xref: "x", yref: "paper", x: places[0] - 0.4, y: 1, xanchor: "left", yanchor: "bottom", yshift: 6,
      font: { size: 13, color: colour(shades[group % shades.length]) },
    }));
  }

  function draw(host, figure) {
    const groups = positions(figure), places = groups.flatMap((group) => group.places);
    const many = figure.parts.length > 1, grouped = figure.groups.length > 0;
    const last = Math.max(places[places.length - 1], grouped ? FEWEST - 1 : 0);
    const range = [-0.6, last + 0.6];
    const labels = axis({
      showgrid: false, showline: true, title: title(figure.label_title), tickvals: places, ticktext: figure.labels,
      range: figure.flat ? range.reverse() : range, tickangle: !figure.flat && figure.labels.length > 24 ? -90 : 0,
    });
    const values = axis({ title: title(figure.value_title), rangemode: "tozero", nticks: 6 });
    const longest = Math.max(...figure.labels.map((label) => label.length));
    const entry = 46 + 7 * Math.max(...figure.parts.map((part) => part.name.length));
    const top = many ? 16 + 19 * Math.ceil((entry * figure.parts.length) / (host.clientWidth - 40)) : grouped ? 28 : 8;
    Plotly.react(host, [...bars(figure, groups), ...marks(figure, places)], layout({
      width: host.clientWidth, height: figure.flat ? top + 50 + 24 * figure.labels.length : (grouped ? 242 : 270) + top, barmode: "stack", bargap: grouped ? 0.45 : 0.35,
      showlegend: many, legend: { orientation: "h", x: 0, y: 1.02, yanchor: "bottom", traceorder: "normal", font: { size: 12 } },
      margin: { l: figure.flat ? 24 + 6.6 * longest : 62, r: 12, t: top, b: 46 }, annotations: grouped && !figure.flat ? heads(groups) : [],
      xaxis: figure.flat ? values : labels, yaxis: figure.flat ? labels : values,
    }), hover);
  }

  onFigures("bars", (host, figure) => {
    const parts = figure.parts.map(([name, values]) => ({ name, values }));
    const groups = figure.groups.map(([name, count]) => ({ name, count }));
    return () => draw(host, { ...figure, parts, groups });
  });
})();
