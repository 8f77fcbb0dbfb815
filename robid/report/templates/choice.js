"use strict";
// What is shown: one mechanism for the choices that a reader makes in figures, tables and the enlarged element.
robid.choices = (() => {
  const { element } = robid;

  // Each choice has a `key`, its `options` for a state, and a `look`: `list`, `steps` (a list with arrows), `buttons`, or
  // none where something else sets it. `label` names it. Where its options follow those of `after`, it begins anew with them.
  function choices(host, list, changed) {
    const state = Object.fromEntries(list.map(({ key }) => [key, 0]));
    const options = (key) => list.find((one) => one.key === key).options(state);
    const refreshers = [];

    function set(chosen, tell = true) {
      Object.assign(state, chosen);
      list.filter((one) => one.after in chosen).forEach((one) => { state[one.key] = 0; });
      refreshers.forEach((refresh) => refresh());
      if (tell) changed();
    }

    const can = (key, by) => options(key)[state[key] + by] !== undefined;
    const step = (key, by) => { if (can(key, by)) set({ [key]: state[key] + by }); };
    const around = (key, by) => set({ [key]: (state[key] + by + options(key).length) % options(key).length });

    function selector({ key, label }) {
      const select = element("select", { "aria-label": label.toLowerCase(), onchange: () => set({ [key]: Number(select.value) }) });
      refreshers.push(() => {
        select.replaceChildren(...options(key).map((text, index) => element("option", { value: index }, text)));
        select.value = String(state[key]);
      });
      return select;
    }

    const looks = {
      list: (one) => element("label", {}, one.label, selector(one)),
      steps: (one) => element("label", {}, one.label, element("span", { class: "stepper" }, selector(one),
        element("button", { type: "button", "aria-label": `previous ${one.label.toLowerCase()}`, onclick: () => around(one.key, -1) }, "\u2190"),
        element("button", { type: "button", "aria-label": `next ${one.label.toLowerCase()}`, onclick: () => around(one.key, 1) }, "\u2192"))),
      buttons: ({ key }) => {
        const buttons = options(key).map((text, index) => element("button", { type: "button", onclick: () => set({ [key]: index }) }, text));
        refreshers.push(() => buttons.forEach((button, index) => button.setAttribute("aria-pressed", index === state[key])));
        return element("span", { class: "segments" }, ...buttons);
      },
    };
    list.filter((one) => one.look && (one.look !== "list" || options(one.key).length > 1)).forEach((one) => host.append(looks[one.look](one)));
    set({}, false);
    return { state, set, step, can };
  }

  // Rows of a table.
  document.querySelectorAll("table[data-choice]").forEach((table) => {
    const host = table.parentElement.previousElementSibling;
    const rows = [...table.querySelectorAll("tr[data-choice]")];
    const labels = [...new Set(rows.map((row) => row.dataset.choice))];
    if (labels.length < 2) { host.remove(); return; }
    const made = choices(host, [{ key: "row", label: table.dataset.choice, look: "list", options: () => ["all", ...labels] }], () => {
      rows.forEach((row) => { row.hidden = made.state.row > 0 && row.dataset.choice !== labels[made.state.row - 1]; });
    });
    // A link to a row that is not shown shows all.
    window.addEventListener("hashchange", () => {
      const row = rows.find((one) => one.hidden && one.id && `#${one.id}` === window.location.hash);
      if (row) { made.set({ row: 0 }); row.scrollIntoView({ block: "center" }); }
    });
  });

  // Parts of which one is shown; figures are drawn when they come into sight.
  document.querySelectorAll("[data-options]").forEach((frame) => {
    const host = frame.firstElementChild;
    const parts = [...frame.children].slice(1);
    const show = () => {
      parts.forEach((part, index) => { part.hidden = index !== made.state.option; });
      robid.redraw();
    };
    const made = choices(host, [{ key: "option", label: frame.dataset.options, look: "steps", options: () => parts.map((part) => part.dataset.option) }], show);
    if (parts.length < 2) host.remove();
    show();
  });

  // Parts of which one is shown by several choices, in any combination.
  document.querySelectorAll("[data-choices]").forEach((frame) => {
    const host = frame.firstElementChild;
    const parts = [...frame.children].slice(1);
    const names = parts.map((part) => JSON.parse(part.dataset.names));
    const list = JSON.parse(frame.dataset.choices).map((label, place) => {
      const options = [...new Set(names.map((each) => each[place]))];
      return { key: `choice-${place}`, label, look: options.length > 1 ? "steps" : "", options: () => options };
    });
    const show = () => {
      const chosen = list.map((one) => one.options()[made.state[one.key]]);
      parts.forEach((part, index) => { part.hidden = names[index].some((name, place) => name !== chosen[place]); });
      robid.redraw();
    };
    const made = choices(host, list, show);
    if (parts.length < 2) host.remove();
    show();
  });

  return choices;
})();
