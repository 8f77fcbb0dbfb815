"use strict";
// Tables that are wider than the page: columns leave, the least important first, and a line says which.
document.querySelectorAll("table[data-leaves]").forEach((table) => {
  const { element, onDraw } = robid;
  const heads = [...table.tHead.rows[0].cells].map((head) => head.textContent), scroller = table.parentElement;
  const order = JSON.parse(table.dataset.leaves).filter((head) => heads.includes(head));
  const told = element("span"), button = element("button", { type: "button", onclick: () => { all = !all; fit(); } });
  const line = element("p", { class: "caption left-out" }, told, button);
  let all = false;
  scroller.after(line);

  function show(head, shown) {
    const place = heads.indexOf(head);
    [...table.rows].filter((row) => row.cells.length === heads.length).forEach((row) => { row.cells[place].hidden = !shown; });
  }

  function fit() {
    if (!scroller.clientWidth) return;
    const left = [];
    order.forEach((head) => show(head, true));
    const wide = () => table.scrollWidth > scroller.clientWidth + 1;
    const must = wide();
    for (const head of all ? [] : order) {
      if (!wide()) break;
      show(head, false);
      left.push(head);
    }
    line.hidden = !must;
    told.textContent = left.length ? `No room for: ${left.join(", ")}. ` : "";
    button.textContent = all ? "Fit to the page" : "Show all columns";
  }

  onDraw(fit);
});
