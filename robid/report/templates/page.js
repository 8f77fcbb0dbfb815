"use strict";
// What all figures share: data, colours of the theme, axes, redrawing.
const robid = (() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const drawings = [];
  const value = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
  // A name is that of a colour in the style sheet, the only place with colours; `names` are lists of them there.
  const colour = value;
  const names = (list) => value(list).split(" ");
  // The buttons are named one by one because the default set can send a chart to a server.
  const offline = { plotlyServerURL: "", showSendToCloud: false, displaylogo: false };
  const still = { ...offline, staticPlot: true, displayModeBar: false };
  const hover = { ...offline, displayModeBar: false };
  const zoomable = { ...offline, displayModeBar: true, modeBarButtons: [["toImage", "zoom2d", "pan2d", "resetScale2d"]] };

  function axis(extra) {
    return {
      gridcolor: colour("line"), linecolor: colour("rule"), zeroline: false, showline: false, ticks: "",
      tickfont: { size: 11, color: colour("muted") }, automargin: false, fixedrange: true, ...extra,
    };
  }

  function layout(extra) {
    return {
      paper_bgcolor: colour("clear"), plot_bgcolor: colour("clear"), showlegend: false, dragmode: false,
      font: { family: getComputedStyle(document.body).fontFamily, size: 12, color: colour("ink") },
      hoverlabel: { bgcolor: colour("panel"), bordercolor: colour("rule"), font: { color: colour("ink"), size: 12 } },
      ...extra,
    };
  }

  function title(text) {
    return { text, font: { size: 12, color: colour("muted") } };
  }

  function logTicks(low, high, steps = [1, 2, 5]) {
    const values = [];
    for (let decade = Math.floor(Math.log10(low)); decade <= Math.log10(high); decade += 1) {
      for (const step of steps) {
        const value = step * 10 ** decade;
        if (value >= low * 0.999 && value <= high * 1.001) values.push(Number(value.toPrecision(3)));
      }
    }
    return values;
  }

  function element(tag, attributes = {}, ...children) {
    const node = document.createElement(tag);
    for (const [name, value] of Object.entries(attributes)) {
      if (name.startsWith("on")) node.addEventListener(name.slice(2), value);
      else node.setAttribute(name, value);
    }
    node.append(...children);
    return node;
  }

  function onDraw(draw) {
    drawings.push(draw);
    draw();
  }

  // Sets up every figure of a kind, and draws it now and whenever the page changes.
  function onFigures(kind, prepare) {
    document.querySelectorAll("[data-figure]").forEach((host) => {
      const figure = data.figures[Number(host.dataset.figure)];
      if (figure.kind === kind) onDraw(prepare(host, figure));
    });
  }

  function palette(count) {
    const series = names("series");
    if (count <= series.length) return series.slice(0, count).map(colour);
    // Golden-angle hues: neighbours in the legend are far apart.
    return Array.from({ length: count }, (_, index) => `hsl(${(210 + 137.5 * index) % 360}, ${value(index % 2 ? "many-odd" : "many-even")})`);
  }

  function colourscale(list = "scale") {
    const stops = names(list);
    return stops.map((stop, index) => [index / (stops.length - 1), stop]);
  }

  // What the shapes of a figure mean, as classes of the style sheet.
  function key(items) {
    return element("span", { class: "key" }, ...items.map(({ shape, label, style = "" }) => element("span", {}, element("i", { class: shape, style }), label)));
  }

  document.addEventListener("toggle", () => redraw(), true);
  const redraw = () => drawings.forEach((draw) => draw());
  let waiting = 0;
  let width = window.innerWidth;
  window.addEventListener("resize", () => {
    if (window.innerWidth === width) return;
    width = window.innerWidth;
    window.clearTimeout(waiting);
    waiting = window.setTimeout(redraw, 120);
  });
  window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);
  window.matchMedia("print").addEventListener("change", redraw);

  return { data, redraw, colour, names, still, hover, zoomable, axis, layout, title, logTicks, element, key, onDraw, onFigures, palette, colourscale };
})();
