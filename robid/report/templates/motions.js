"use strict";
// Arms that swing slowly about their rest: drag to turn, a button to stop.
(() => {
  const { element, key, choices, onFigures } = robid;
  const PERIOD_MS = 2600, TIPS = 2;
  const media = (query) => window.matchMedia(query);
  const calm = media("(prefers-reduced-motion: reduce)"), paper = media("print");

  function svg(tag, attributes) {
    const node = document.createElementNS("http://www.w3.org/2000/svg", tag);
    for (const [name, value] of Object.entries(attributes)) node.setAttribute(name, value);
    return node;
  }

  // Where points are at a phase of a motion.
  function at(points, motion, phase) {
    const [c, s] = [Math.cos(phase), Math.sin(phase)];
    return points.map((point, index) => point.map((value, axis) => value + c * motion.cosine[index][axis] + s * motion.sine[index][axis]));
  }

  // Corners of a piece of floor about the base, from low x and y on.
  function ground(points) {
    const [x, y] = points[0], half = 0.3 * Math.max(...points.map((point) => Math.hypot(...point.map((value, axis) => value - points[0][axis]))));
    return [[x - half, y - half, 0], [x + half, y + half, 0]].map((corner) => [corner[0], corner[1], Math.min(0, points[0][2])]);
  }

  // What is in view: a ball about everything, so that nothing is cut however the arm is turned.
  function ball(points, motion) {
    const [[x0, y0, z], [x1, y1]] = ground(points);
    const swung = motion ? [0, 1, 2, 3].flatMap((quarter) => at(points, motion, (quarter * Math.PI) / 2)) : [];
    const all = [...points, ...swung, [x0, y0, z], [x0, y1, z], [x1, y0, z], [x1, y1, z]];
    const ends = [0, 1, 2].map((axis) => all.map((point) => point[axis])).map((values) => [Math.min(...values), Math.max(...values)]);
    const middle = ends.map(([low, high]) => (low + high) / 2);
    return { middle, radius: Math.max(...all.map((point) => Math.hypot(...point.map((value, axis) => value - middle[axis])))) };
  }

  // An orthographic view from an azimuth and an elevation.
  function projection({ middle, radius }, view, width, height) {
    const [ca, sa, ce, se] = [Math.cos(view.azimuth), Math.sin(view.azimuth), Math.cos(view.elevation), Math.sin(view.elevation)];
    const scale = (0.47 * Math.min(width, height)) / radius;
    const right = [-sa, ca, 0], up = [-se * ca, -se * sa, ce];
    const along = (point, way) => point.reduce((sum, value, axis) => sum + (value - middle[axis]) * way[axis], 0);
    const turned = (way) => [right, up].map((side) => side.reduce((sum, value, axis) => sum + value * way[axis], 0));
    return { place: (point) => [width / 2 + scale * along(point, right), height / 2 - scale * along(point, up)], turned };
  }

  const path = (pairs) => pairs.map(([x, y], index) => `${index ? "L" : "M"}${x.toFixed(1)} ${y.toFixed(1)}`).join("");

  // The line along an arm and the two axes of its tool, as one path.
  function outline(points, place) {
    const along = points.slice(0, points.length - TIPS), tool = along[along.length - 1];
    return path(along.map(place)) + points.slice(-TIPS).map((tip) => path([tool, tip].map(place))).join("");
  }

  function floor(points, place) {
    const [[x0, y0, z], [x1, y1]] = ground(points);
    const lines = [0, 0.25, 0.5, 0.75, 1].flatMap((share) => {
      const [x, y] = [x0 + share * (x1 - x0), y0 + share * (y1 - y0)];
      return [[[x, y0, z], [x, y1, z]], [[x0, y, z], [x1, y, z]]];
    });
    return lines.map((ends) => path(ends.map(place))).join("");
  }

  // Which way x, y and z point, in a corner.
  function axes(turned, height) {
    return ["x", "y", "z"].flatMap((name, axis) => {
      const [right, up] = turned([0, 1, 2].map((other) => (other === axis ? 1 : 0)));
      const [u, v] = [34 + 24 * right, height - 34 - 24 * up];
      const label = svg("text", { x: 34 + 32 * right, y: height - 34 - 32 * up, class: "axis-name" });
      label.textContent = name;
      return [svg("path", { d: `M34 ${height - 34}L${u.toFixed(1)} ${v.toFixed(1)}`, class: "axis" }), label];
    });
  }

  onFigures("motions", (host, figure) => {
    const arms = figure.names.map((name, index) => ({ name, points: figure.points[index], motions: figure.motions[index] }));
    const view = { azimuth: -0.9, elevation: 0.3 };
    const controls = element("div", { class: "controls" }), told = element("p", { class: "motion-text", "aria-live": "polite" });
    const state = { playing: !calm.matches, seen: false, since: 0, phase: 0, next: 0 };
    let move = () => {};
    host.classList.add("motions");
    host.before(controls);
    host.after(told);

    // Without motion, and on paper, the arm stands where it swings out most.
    const still = () => paper.matches || !state.playing;
    function frame(now) {
      if (still() || !state.seen || document.hidden) { state.since = 0; return; }
      if (state.since) state.phase += (2 * Math.PI * Math.min(now - state.since, 100)) / PERIOD_MS;
      state.since = now;
      move(state.phase);
      state.next = window.requestAnimationFrame(frame);
    }
    function run() {
      button.textContent = state.playing ? "❚❚ Pause" : "▶ Play";
      button.setAttribute("aria-pressed", state.playing);
      window.cancelAnimationFrame(state.next);
      if (still()) { state.phase = 0; move(0); }
      else state.next = window.requestAnimationFrame(frame);
    }

    function draw() {
      if (!host.clientWidth) return;
      const arm = arms[chosen.state.configuration], motion = arm.motions[chosen.state.mode];
      const width = host.clientWidth, height = Math.max(Math.min(0.75 * width, 460), 240), space = ball(arm.points, motion);
      const { place, turned } = projection(space, view, width, height);
      told.textContent = motion ? motion.text : "No mode lies in or near the measured band.";
      const picture = svg("svg", { viewBox: `0 0 ${width} ${height}`, width, height, role: "img", "aria-label": told.textContent });
      const dots = (points, look) => points.slice(0, points.length - TIPS).map((point) => { const [cx, cy] = place(point); return svg("circle", { cx, cy, r: 3, class: look }); });
      picture.append(svg("path", { d: floor(arm.points, place), class: "floor" }), svg("path", { d: outline(arm.points, place), class: "rest" }), ...dots(arm.points, "rest"), ...axes(turned, height));
      host.replaceChildren(picture);
      if (!motion) { move = () => {}; return; }
      for (const phase of [0, Math.PI]) picture.append(svg("path", { d: outline(at(arm.points, motion, phase), place), class: "reach" }));
      const swinging = svg("path", { class: "swing" }), joints = dots(arm.points, "swing");
      picture.append(swinging, ...joints);
      move = (phase) => {
        const points = at(arm.points, motion, phase);
        swinging.setAttribute("d", outline(points, place));
        joints.forEach((joint, index) => { const [cx, cy] = place(points[index]); joint.setAttribute("cx", cx); joint.setAttribute("cy", cy); });
      };
      move(state.phase);
      run();
    }

    function turn(event) {
      if (!event.buttons) return;
      view.azimuth -= event.movementX / 140;
      view.elevation = Math.max(-0.2, Math.min(1.5, view.elevation + event.movementY / 140));
      draw();
    }
    host.addEventListener("pointerdown", (event) => host.setPointerCapture(event.pointerId));
    host.addEventListener("pointermove", turn);

    const button = element("button", { type: "button", onclick: () => { state.playing = !state.playing; run(); } });
    const chosen = choices(controls, [
      { key: "configuration", label: "Configuration", look: "steps", options: () => arms.map((arm) => arm.name) },
      { key: "mode", label: "Mode", look: "steps", after: "configuration", options: ({ configuration }) => arms[configuration].motions.map((motion) => motion.name) },
    ], draw);
    controls.append(button, key([
      { shape: "line", style: "border-top: 3px solid var(--measured)", label: "the mode, drawn enlarged" },
      { shape: "line", style: "border-top: 2px dotted var(--measured)", label: "where it swings out most" },
      { shape: "line", style: "border-top: 2px solid var(--faint)", label: "at rest" },
    ]));

    // A link to a mode shows it.
    function follow() {
      const name = window.location.hash.slice(1);
      arms.forEach((arm, configuration) => arm.motions.forEach((motion, mode) => {
        if (motion.anchor !== name) return;
        chosen.set({ configuration });
        chosen.set({ mode });
        controls.scrollIntoView({ block: "start" });
      }));
    }
    window.addEventListener("hashchange", follow);
    document.addEventListener("click", ({ target }) => { if (target.hash && target.hash === window.location.hash) follow(); });
    new IntersectionObserver(([{ isIntersecting }]) => { state.seen = isIntersecting; run(); }).observe(host);
    window.setTimeout(follow);
    return draw;
  });
})();
