/* Tables: a click on a head sorts, buttons copy the table or save it as CSV. */
const amount = /^[<>≤≥≈±]?\s*([−+-]?\d[\d.]*(?:e[+-]?\d+)?)(?=$|[\s%°±])/i;
function cellValue(row, column) {
  const text = row.cells[column] ? row.cells[column].textContent.trim() : "", found = text.match(amount);
  return {text, number: found ? Number(found[1].replace("−", "-")) : NaN};
}
/* Amounts before words, in either direction. */
function compared(a, b, sign) {
  const words = [a, b].map(cell => Number.isNaN(cell.number));
  if (words[0] !== words[1]) return words[0] - words[1];
  return sign * ((words[0] ? 0 : a.number - b.number) || a.text.localeCompare(b.text));
}
/* Rows below a heading within the table stay below it. */
function sortTable(table, column) {
  const head = table.tHead.rows[0].cells[column], body = table.tBodies[0];
  const sign = head.getAttribute("aria-sort") === "ascending" ? -1 : 1, groups = [[null, []]];
  for (const cell of table.tHead.rows[0].cells) cell.removeAttribute("aria-sort");
  head.setAttribute("aria-sort", sign > 0 ? "ascending" : "descending");
  for (const row of body.rows) {
    if (row.classList.contains("kind")) groups.push([row, []]);
    else groups[groups.length - 1][1].push([cellValue(row, column), row]);
  }
  for (const [heading, rows] of groups) {
    rows.sort(([a], [b]) => compared(a, b, sign));
    body.append(...(heading ? [heading] : []), ...rows.map(([, row]) => row));
  }
}
function tableText(table, separator = ",") {
  const quoted = text => separator === "," && /[",\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text;
  const cellText = cell => quoted(separator === "," ? cell.textContent.trim() : cell.textContent.trim().replace(/\s+/g, " "));
  return [...table.rows].filter(row => !row.hidden).map(row => [...row.cells].map(cellText).join(separator)).join("\n") + "\n";
}
/* With tabulators, as spreadsheets take it. */
async function copyTable(table, button) {
  try { await navigator.clipboard.writeText(tableText(table, "\t")); button.textContent = "Copied"; }
  catch { button.textContent = "Not allowed"; }
  setTimeout(() => { button.textContent = "Copy"; }, 1500);
}
function tableButton(text, label, action) {
  const button = document.createElement("button");
  Object.assign(button, {type: "button", className: "csv", textContent: text, onclick: () => action(button)});
  button.setAttribute("aria-label", label);
  return button;
}
function prepareTables() {
  let number = 0;
  for (const table of document.querySelectorAll(".card table")) {
    const heading = table.closest(".card").querySelector("h2").textContent, name = table.id || `table-${++number}`;
    [...table.tHead.rows[0].cells].forEach((head, column) => {
      head.tabIndex = 0;
      head.onclick = () => sortTable(table, column);
      head.onkeydown = event => { if (event.key === "Enter") sortTable(table, column); };
    });
    const buttons = document.createElement("p");
    buttons.className = "of-table";
    buttons.append(
      tableButton("Copy", `Copy the table of “${heading}”`, button => copyTable(table, button)),
      tableButton("CSV", `CSV: save the table of “${heading}”`, () => saveText(tableText(table), name)));
    (table.closest(".scroll") || table).before(buttons);
  }
  for (const field of document.querySelectorAll("input.filter")) {
    field.oninput = () => {
      const words = field.value.toLowerCase().split(/\s+/).filter(Boolean);
      for (const row of document.getElementById(field.dataset.table).tBodies[0].rows)
        row.hidden = !words.every(word => row.textContent.toLowerCase().includes(word));
    };
  }
}
