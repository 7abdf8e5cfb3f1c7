"use strict";
// Filter and order of the table of machines.
const get = (id) => document.getElementById(id);
const body = document.querySelector("table.machines tbody");
const rows = Array.from(body.rows);
const orders = {
  difference: (row) => -row.dataset.difference, gap: (row) => -row.dataset.gap,
  closure: (row) => +row.dataset.closure, p: (row) => +row.dataset.p, name: () => 0,
};
function update() {
  const by = get("by").value, words = get("find").value.toLowerCase(), status = get("status").value;
  const missing = (row) => (by === "name" || row.dataset[by] !== "" ? 0 : 1);
  rows.sort((a, b) => missing(a) - missing(b) || orders[by](a) - orders[by](b)
    || a.dataset.name.localeCompare(b.dataset.name, undefined, { numeric: true }));
  let shown = 0;
  for (const row of rows) {
    row.hidden = !(row.textContent.toLowerCase().includes(words) && (!status || row.dataset.status === status));
    shown += row.hidden ? 0 : 1;
    body.append(row);
  }
  get("shown").textContent = shown === rows.length ? "" : `${shown} of ${rows.length}`;
}
for (const id of ["find", "status", "by"]) get(id).addEventListener("input", update);
for (const link of document.querySelectorAll("[data-find]")) {
  link.addEventListener("click", () => { get("find").value = link.dataset.find; update(); });
}
const form = document.querySelector(".controls");
form.hidden = false;
form.addEventListener("submit", (event) => event.preventDefault());
