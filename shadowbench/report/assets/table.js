// Sorting and filtering of the tables.

function startTables() {
  for (const table of $$("table.sortable")) {
    $$("thead th", table).forEach((head, column) => head.querySelector("button")?.addEventListener("click", () => sort(table, column)));
  }
  $("filter").addEventListener("input", filterRows);
  for (const box of $$("#columns input")) box.addEventListener("change", () => showColumn(Number(box.value), box.checked));
  $("save-table").addEventListener("click", saveTable);
  onChange(() => {
    filterRows();
    for (const row of $$("#measurement-table tbody tr")) {
      row.classList.toggle("now", FRAMES.length > 1 && Number(row.dataset.frame) === chosen.frame);
    }
  });
}

const valueOf = (row, column) => row.cells[column].dataset.value ?? row.cells[column].textContent;

/** Sort by a column: numbers from the smallest, words by the alphabet, the other way round at the next click; gaps last. */
function sort(table, column) {
  const head = table.tHead.rows[0].cells[column];
  const descending = head.getAttribute("aria-sort") === "ascending";
  for (const other of table.tHead.rows[0].cells) other.removeAttribute("aria-sort");
  head.setAttribute("aria-sort", descending ? "descending" : "ascending");
  const compare = (first, second) => {
    const [a, b] = [valueOf(first, column), valueOf(second, column)];
    if (a === "" || b === "") return (a === "") - (b === "");
    const numbers = !Number.isNaN(Number(a)) && !Number.isNaN(Number(b));
    return (descending ? -1 : 1) * (numbers ? a - b : a.localeCompare(b));
  };
  table.tBodies[0].append(...[...table.tBodies[0].rows].sort(compare));
}

/** Show the rows that hold every word of the filter and belong to a method that is shown. */
function filterRows() {
  const words = $("filter").value.toLowerCase().split(/\s+/).filter(Boolean);
  const rows = $$("#measurement-table tbody tr");
  let n = 0;
  for (const row of rows) {
    const text = `frame ${row.dataset.frame} ${row.textContent.toLowerCase()} ${row.className}`;
    const shown = words.every((word) => text.includes(word)) && !chosen.hidden.has(Number(row.dataset.series));
    row.hidden = !shown;
    n += shown;
  }
  $("n-rows").textContent = n === rows.length ? `${n} rows` : `${n} of ${rows.length} rows`;
}

function showColumn(column, visible) {
  for (const row of $("measurement-table").rows) row.cells[column].hidden = !visible;
}

function saveTable() {
  const quoted = (text) => (/[",\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text);
  const rows = [...$("measurement-table").rows].filter((row) => !row.hidden);
  const texts = rows.map((row) => [...row.cells].filter((cell) => !cell.hidden)
    .map((cell) => quoted(String(cell.dataset.value ?? cell.textContent.trim()))).join(","));
  save("table.csv", texts.join("\n") + "\n", "text/csv");
}
