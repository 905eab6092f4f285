"use strict";
// Sorts the table by the column whose title is clicked, and marks the row of a point that is clicked.

(function () {
  const body = document.querySelector("tbody"), heads = [...document.querySelectorAll("thead th")];

  function key(row, column, numbers) {
    const cell = row.children[column], value = cell.dataset.value ?? cell.textContent;
    return value === "" ? null : numbers ? Number(value) : value;
  }

  heads.forEach((head, column) => head.querySelector("button").addEventListener("click", event => {
    const numbers = event.target.dataset.numbers === "1", sign = head.ariaSort === "ascending" ? -1 : 1;
    heads.forEach(other => other.removeAttribute("aria-sort"));
    head.ariaSort = sign > 0 ? "ascending" : "descending";
    [...body.rows].sort((one, other) => {
      const [a, b] = [one, other].map(row => key(row, column, numbers));
      // Rows without a value are the last ones in both orders.
      if (a === null || b === null) return (a === null) - (b === null);
      return sign * (numbers ? a - b : a.localeCompare(b));
    }).forEach(row => body.append(row));
  }));

  document.getElementById("curves").on("plotly_click", event => {
    document.querySelectorAll("tr.chosen").forEach(row => row.classList.remove("chosen"));
    const row = document.getElementById("row-" + event.points[0].x);
    row.classList.add("chosen");
    row.scrollIntoView({ block: "center" });
  });
})();
