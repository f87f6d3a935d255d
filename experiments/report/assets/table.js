/* Tables that sort by a click on a head, and that a button saves as CSV. */
function cellValue(row, column) {
  const text = row.cells[column] ? row.cells[column].innerText.trim() : "";
  const number = Number(text.replace("−", "-"));
  return text !== "" && !Number.isNaN(number) ? number : text;
}
function sortTable(table, column) {
  const head = table.tHead.rows[0].cells[column], body = table.tBodies[0];
  const sign = head.getAttribute("aria-sort") === "ascending" ? -1 : 1;
  for (const cell of table.tHead.rows[0].cells) cell.removeAttribute("aria-sort");
  head.setAttribute("aria-sort", sign > 0 ? "ascending" : "descending");
  const rows = [...body.rows].map(row => [cellValue(row, column), row]);
  rows.sort(([a], [b]) => sign * (typeof a === "number" && typeof b === "number" ? a - b
    : String(a).localeCompare(String(b))));
  body.append(...rows.map(([, row]) => row));
}
function tableText(table) {
  const quoted = text => /[",\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text;
  return [...table.rows].map(row => [...row.cells].map(cell => quoted(cell.innerText.trim())).join(",")).join("\n") + "\n";
}
function prepareTables() {
  for (const table of document.querySelectorAll("table.sortable")) {
    [...table.tHead.rows[0].cells].forEach((head, column) => {
      head.tabIndex = 0;
      head.onclick = () => sortTable(table, column);
      head.onkeydown = event => { if (event.key === "Enter") sortTable(table, column); };
    });
  }
  for (const button of document.querySelectorAll("button.csv")) {
    button.onclick = () => {
      saveText(tableText(document.getElementById(button.dataset.table)), button.dataset.table);
    };
  }
  for (const field of document.querySelectorAll("input.filter")) {
    field.oninput = () => {
      const words = field.value.toLowerCase().split(/\s+/).filter(Boolean);
      for (const row of document.getElementById(field.dataset.table).tBodies[0].rows)
        row.hidden = !words.every(word => row.textContent.toLowerCase().includes(word));
    };
  }
}
