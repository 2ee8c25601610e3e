// A campaign's page: shows the chosen metric, sorts tables by the column that is clicked, and filters their rows.
"use strict";
(() => {
  for (const chooser of document.querySelectorAll(".chooser")) {
    const plot = chooser.querySelector(".plot");
    const figure = page.data(plot);
    const choices = JSON.parse(chooser.querySelector("script.choices").textContent);
    const select = chooser.querySelector("select");
    const axis = chooser.dataset.axis;
    select.addEventListener("change", () => {
      const choice = choices[select.selectedIndex];
      chooser.querySelector(".description").textContent = choice.description;
      page.draw(plot, {
        data: figure.data.map((trace, k) => ({...trace, ...choice.traces[k]})),
        layout: {...figure.layout, [axis]: {...figure.layout[axis], title: {text: choice.axis}}},
      });
    });
  }

  const keyOf = cell => cell.dataset.key === undefined ? cell.textContent.trim() : Number(cell.dataset.key);
  const order = (a, b) => typeof a === "number" && typeof b === "number"
    ? (isNaN(a) ? 1 : isNaN(b) ? -1 : a - b)
    : String(a).localeCompare(String(b), undefined, {numeric: true});

  for (const table of document.querySelectorAll("table.sortable")) {
    const heads = [...table.tHead.rows[0].cells];
    heads.forEach((head, column) => head.querySelector("button").addEventListener("click", () => {
      const down = head.getAttribute("aria-sort") === "ascending";
      for (const other of heads) other.removeAttribute("aria-sort");
      head.setAttribute("aria-sort", down ? "descending" : "ascending");
      const body = table.tBodies[0];
      const keyed = [...body.rows].map(row => [keyOf(row.cells[column]), row]);
      keyed.sort((a, b) => down ? order(b[0], a[0]) : order(a[0], b[0]));
      body.append(...keyed.map(([, row]) => row));
    }));
  }

  // Says how many rows are shown, and that there are more than one sees at once.
  function count(box) {
    const rows = [...box.querySelector("tbody").rows], left = rows.filter(row => !row.hidden).length;
    const scrolled = box.querySelector(".scroll");
    const beyond = scrolled.scrollHeight > scrolled.clientHeight + 1 || scrolled.scrollWidth > scrolled.clientWidth + 1;
    const all = rows.length === 1 ? "1 run" : `${rows.length} runs`;
    document.querySelector(`[data-counts="${box.id}"]`).textContent =
      (left < rows.length ? `${left} of ${all}` : all) + (beyond ? "; the table scrolls" : "");
  }

  for (const field of document.querySelectorAll("input[data-filters]")) {
    const box = document.getElementById(field.dataset.filters);
    const body = box.querySelector("tbody");
    field.addEventListener("input", () => {
      const words = field.value.toLowerCase().split(/\s+/).filter(Boolean);
      for (const row of body.rows) {
        const text = row.textContent.toLowerCase();
        row.hidden = !words.every(word => text.includes(word));
      }
      count(box);
    });
    new ResizeObserver(() => count(box)).observe(box);
  }
})();
