// Draws the signals that one chooses. Data: {span: [from, to], signals: [{name, unit, about, items, columns}]}, a column
// being {of, value} or {of, t, y, held} with float32 in base64.
"use strict";
(() => {
  const MOST_AXES = 6, HEIGHT = 230, GAP = 28, ITEM = 18;  // px: of an axis, between two, and of an enumeration's item at it
  const STROKES = ["solid", "dash", "dot"];  // of an array's elements: what coincides is seen
  const root = document.querySelector(".explorer");
  if (!root) return;
  const {span, signals} = page.data(root);
  const byName = new Map(signals.map(s => [s.name, s]));
  const search = root.querySelector("input"), select = root.querySelector("select"), shown = root.querySelector(".shown");
  const chosen = new Set();
  const about = Object.assign(document.createElement("div"), {className: "about soft"});
  let div = null;

  // Lists what is found, and what is shown besides: a click shows another signal instead, with Ctrl in addition.
  function list() {
    const words = search.value.toLowerCase().split(/\s+/).filter(Boolean);
    const found = signals.filter(s => words.every(w => `${s.name} ${s.unit} ${s.about}`.toLowerCase().includes(w)));
    const groups = new Map();
    for (const s of signals.filter(s => chosen.has(s.name) && !found.includes(s))) put(groups, "shown", s, s.name);
    for (const s of found) {
      const unit = s.name.split(".")[0];
      put(groups, unit, s, s.name.slice(unit.length + 1));
    }
    select.replaceChildren(...groups.values());
  }

  function put(groups, label, s, name) {
    if (!groups.has(label)) groups.set(label, Object.assign(document.createElement("optgroup"), {label}));
    const option = new Option(name + (s.unit ? ` (${s.unit})` : ""), s.name, false, chosen.has(s.name));
    option.title = s.about;
    groups.get(label).append(option);
  }

  // Returns a figure with an axis for each unit, arrays and enumerations on axes of their own.
  function figureOf(names) {
    const axes = new Map();
    for (const name of names) {
      const s = byName.get(name);
      const named = Object.keys(s.items).length > 0;
      const key = named || s.columns.length > 1 ? name : s.unit;
      if (!axes.has(key)) axes.set(key, {unit: s.unit, items: named ? s.items : null, signals: []});
      axes.get(key).signals.push(s);
    }
    const rows = [...axes.values()].slice(0, MOST_AXES);
    const layout = {
      meta: {time: true}, hovermode: "x unified", showlegend: true,
      xaxis: {title: {text: "time (s)"}, range: span, unifiedhovertitle: {text: "%{x:.4~f} s"}},
    };
    if (rows.length > 1) layout.xaxis.anchor = `y${rows.length}`;
    const data = [];
    let colour = 0, of = 0, above = 0;
    const heights = rows.map(({items}) => Math.max(HEIGHT, items ? ITEM * Object.keys(items).length + 60 : 0));
    layout.meta.height = heights.reduce((sum, high) => sum + high, 20);
    rows.forEach((row, k) => {
      const n = k ? k + 1 : "";
      layout[`yaxis${n}`] = axisOf(row, above, heights[k] - (k < rows.length - 1 ? GAP : 0), layout.meta.height - 20);
      above += heights[k];
      for (const s of row.signals)
        s.columns.forEach((c, i) => {
          if (s.columns.length <= 3 || i % 3 === 0) of = colour++ % 9;  // of many elements three have one, as in plots
          data.push(traceOf(s, c, `y${n}`, `var(--c${of})`, STROKES[i % 3]));
        });
    });
    return {data, layout};
  }

  function axisOf(row, above, high, all) {
    const axis = {domain: [Math.max(1 - (above + high) / all, 0), 1 - above / all], title: {text: titleOf(row)}, exponentformat: "power"};
    if (row.items)
      Object.assign(axis, {tickvals: Object.keys(row.items).map(Number), ticktext: Object.values(row.items).map(tidy)});
    return axis;
  }

  function titleOf(row) {
    const name = row.signals.length === 1 ? row.signals[0].name : "";
    return [name, row.unit && `(${row.unit})`].filter(Boolean).join(name.length > 20 ? "<br>" : " ");
  }

  const tidy = name => name.toLowerCase().replaceAll("_", " ");

  function traceOf(s, c, yaxis, color, dash) {
    const constant = !("t" in c);
    const x = constant ? span : floats(c.t), y = constant ? [c.value, c.value] : floats(c.y);
    const named = Object.keys(s.items).length > 0;
    const trace = {
      type: "scatter", mode: "lines", x, y, yaxis, name: s.name + (c.of ? `[${c.of}]` : ""),
      line: {shape: constant || c.held ? "hv" : "linear", width: 1.6, color, dash},
      hovertemplate: named ? "%{text}" : `%{y:.5~g}${s.unit ? " " + s.unit : ""}`,
    };
    if (named) trace.text = Array.from(y, v => tidy(s.items[v] ?? String(v)));
    return trace;
  }

  const floats = bdata => page.array({dtype: "f4", bdata});

  function show() {
    if (!div) {
      div = document.createElement("div");
      div.className = "plot";
      shown.append(div, about);
    }
    const figure = figureOf([...chosen]);
    about.replaceChildren(...[...chosen].map(name => byName.get(name)).filter(s => s.about).map(describe));
    div.dataset.height = figure.layout.meta.height;
    div.style.height ||= div.dataset.height + "px";
    return page.draw(div, figure);
  }

  function describe(s) {
    const line = document.createElement("p"), name = document.createElement("code");
    name.textContent = s.name;
    line.append(name, ` ${s.about}`);
    return line;
  }

  search.addEventListener("input", list);
  select.addEventListener("change", () => {
    if (!select.selectedOptions.length) return;
    chosen.clear();
    for (const option of select.selectedOptions) chosen.add(option.value);
    show();
  });
  chosen.add(signals[0].name);
  list();
  page.onReady(show);
})();
