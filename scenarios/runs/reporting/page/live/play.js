// Fields for the parameters of a scenario, and the table of a session's runs. play_page.py sends fields (once), choice
// (what is asked for, and what is wrong with it) and runs; a change is sent when it has been left alone for a moment.
"use strict";
(() => {
  const PAUSE = 350;  // ms after the last change until a run is asked for
  const GREATEST_SEED = Number.MAX_SAFE_INTEGER;  // a larger one would be sent as another number
  const byId = id => document.getElementById(id);
  const fields = new Map();  // by name: {field, root, entries, set(text), text()}
  let seed = null, push = null, waiting = 0, busy = false;
  let told = {};  // what the session says is wrong, by the parameter's name

  const createElement = (name, properties = {}, ...children) => {
    const node = Object.assign(document.createElement(name), properties);
    node.append(...children);
    return node;
  };

  // Numbers as short as they are: 0.1, not 0.1000000001.
  const short = number => String(Number(Number(number).toPrecision(7)));
  const sameNumbers = (a, b) => {
    const [one, other] = [a, b].map(text => text.split(",").map(Number));
    return one.length === other.length && one.every((x, i) => x === other[i]);
  };

  function scheduleRun() {
    clearTimeout(waiting);
    busy = true;
    waiting = setTimeout(requestRun, PAUSE);
  }

  function requestRun() {
    clearTimeout(waiting);
    busy = Boolean(seedFault());
    showFaults();
    if (busy) return;
    const set = [...fields.values()].filter(f => !f.isDefault()).map(f => [f.field.name, f.text()]);
    live.send("set", {parameters: Object.fromEntries(set), seed: seed ? Number(seed.value) || 0 : null,
      push: Boolean(push?.checked)});
  }

  function seedFault() {
    if (!seed) return "";
    const range = `from 0 to ${GREATEST_SEED}`, number = Number(seed.value);
    if (seed.value === "") return `seed: expected a whole number ${range}`;
    if (!Number.isInteger(number)) return `seed: ${seed.value} is not a whole number: expected one ${range}`;
    return number >= 0 && number <= GREATEST_SEED ? "" : `seed: ${seed.value} is out of range: a whole number ${range}`;
  }

  // What is wrong stands beside its field; on top, which fields these are, and what is not a field's.
  function showFaults() {
    for (const [name, it] of fields) it.blame(told[name]);
    const wrong = Object.keys(told).filter(name => fields.has(name)).map(name => [name, `field-${name}`]);
    if (seed) {
      const fault = byId("seed-fault");
      fault.textContent = seedFault();
      fault.hidden = !fault.textContent;
      seed.closest(".field").classList.toggle("wrong", !fault.hidden);
      if (!fault.hidden) wrong.push(["seed", "seed"]);
    }
    const links = wrong.flatMap(([name, id], i) => [i ? ", " : "", createElement("a", {href: `#${id}`, textContent: name})]);
    const others = Object.entries(told).filter(([name]) => !fields.has(name)).map(([, text]) => text).join("; ");
    byId("fault").replaceChildren(...(wrong.length ? ["No run was begun: see ", ...links] : []), wrong.length && others ? "; " : "", ...page.typeset(others));
    byId("fault").hidden = !wrong.length && !others;
  }

  // A slider with a number field beside it.
  function createNumberEntry(field, [low, high, step], label) {
    const slider = createElement("input", {type: "range", min: low, max: high, step: step || "any", disabled: !(high > low)});
    const box = createElement("input", {type: "number", step: field.kind === "whole" ? 1 : "any"});
    slider.setAttribute("aria-label", `${label}, slider`);
    box.setAttribute("aria-label", label);
    slider.addEventListener("input", () => { box.value = short(slider.value); change(field.name); });
    box.addEventListener("input", () => { slider.value = box.value; change(field.name); });
    return {
      nodes: [slider, box],
      get: () => box.value,
      set(text) { box.value = text === "" ? "" : short(text); slider.value = text; },
    };
  }

  function createPlainEntry(field) {
    if (field.kind === "choice") {
      const select = createElement("select", {}, ...field.items.map(item => new Option(item, item)));
      return {nodes: [select], on: "change", get: () => select.value, set(text) { select.value = text; }};
    }
    if (field.kind === "switch") {
      const box = createElement("input", {type: "checkbox"});
      return {nodes: [box], on: "change", get: () => String(box.checked), set(text) { box.checked = text === "true"; }};
    }
    const box = createElement("input", {type: "text", spellcheck: false});
    return {nodes: [box], on: "change", get: () => box.value, set(text) { box.value = text; }};
  }

  function createField(field) {
    const axes = field.sliders.length > 1 ? [..."xyzw"].slice(0, field.sliders.length) : [""];
    const entries = field.sliders.length
      ? field.sliders.map((range, i) => createNumberEntry(field, range, `${field.name} ${field.sliders.length > 1 ? i + 1 : ""}`.trim()))
      : [createPlainEntry(field)];
    const reset = createElement("button", {type: "button", className: "reset", textContent: "default"});
    const label = createElement("label", {textContent: field.name.split(".").at(-1)});
    const fault = createElement("p", {className: "fault", hidden: true});
    const rows = entries.map(entry => createElement("div", {className: "entry"}, ...entry.nodes,
      ...(field.unit ? [createElement("span", {className: "unit", textContent: field.unit})] : [])));
    const head = createElement("div", {className: "field-head"}, label);
    const inline = ["choice", "switch"].includes(field.kind);
    if (inline) head.append(...entries[0].nodes);
    head.append(reset);
    const about = [field.description, field.range].filter(Boolean).join("; ");
    const root = createElement("div", {className: "field"}, head, ...(inline ? [] : rows),
      ...(about ? [createElement("p", {className: "field-about"}, ...page.typeset(about))] : []), fault);
    root.dataset.name = field.name;
    const first = entries[0].nodes.at(-1);
    first.id = `field-${field.name}`;
    label.htmlFor = first.id;
    const numeric = field.sliders.length > 0;
    const it = {
      field, root, axes,
      text: () => entries.map(e => e.get()).join(","),
      set(text) {
        const parts = numeric ? text.split(",") : [text];
        entries.forEach((e, i) => e.set(parts[i] ?? ""));
        it.mark();
      },
      isDefault: () => numeric || /^[-+.\d,e]+$/.test(field.default) ? sameNumbers(it.text(), shortened(field.default, numeric))
        : it.text() === field.default,
      mark() { root.classList.toggle("changed", !it.isDefault()); },
      blame(text) {
        fault.replaceChildren(...page.typeset(text ?? ""));
        fault.hidden = !text;
        root.classList.toggle("wrong", Boolean(text));
        if (text) root.closest("details").open = true;
      },
    };
    for (const entry of entries) if (entry.on) entry.nodes[0].addEventListener(entry.on, () => change(field.name));
    reset.addEventListener("click", () => { it.set(field.default); scheduleRun(); });
    it.set(field.default);
    return it;
  }
  const shortened = (text, numeric) => numeric ? text.split(",").map(short).join(",") : text;

  function change(name) {
    fields.get(name).mark();
    scheduleRun();
  }

  live.session = true;
  live.on("fields", ({groups, seeded, pushable}) => {
    if (fields.size) return;
    const host = byId("groups");
    for (const group of groups) {
      const part = createElement("details", {open: group.open}, createElement("summary", {textContent: group.title}));
      for (const field of group.fields) {
        const it = createField(field);
        fields.set(field.name, it);
        part.append(it.root);
      }
      host.append(part);
    }
    if (seeded) {
      seed = createElement("input", {type: "number", min: 0, step: 1, id: "seed", value: 0});
      const fault = createElement("p", {className: "fault", id: "seed-fault", hidden: true});
      seed.addEventListener("input", scheduleRun);
      const next = createElement("button", {type: "button", textContent: "another seed"});
      next.addEventListener("click", () => {
        seed.value = seedFault() ? 1 : (Number(seed.value) + 1) % GREATEST_SEED;
        scheduleRun();
      });
      host.prepend(createElement("div", {className: "field"}, createElement("div", {className: "field-head"},
        createElement("label", {textContent: "seed of all random numbers", htmlFor: "seed"}), seed, next), fault));
    }
    if (pushable) {
      push = createElement("input", {type: "checkbox", id: "push"});
      push.addEventListener("change", scheduleRun);
      host.prepend(createElement("div", {className: "field"}, createElement("div", {className: "field-head"},
        createElement("label", {textContent: "push by hand, in the scene", htmlFor: "push"}), push)));
    }
  });

  live.on("choice", choice => {
    if (!busy) for (const [name, it] of fields) it.set(choice.parameters[name] ?? it.field.default);
    if (seed && !busy) seed.value = choice.seed ?? 0;
    if (push && !busy) push.checked = choice.push;
    told = choice.faults;
    showFaults();
  });

  byId("again").addEventListener("click", requestRun);
  byId("defaults").addEventListener("click", () => {
    for (const it of fields.values()) it.set(it.field.default);
    if (seed) seed.value = 0;
    requestRun();
  });
  byId("search").addEventListener("input", ({target}) => {
    const words = target.value.toLowerCase().split(/\s+/).filter(Boolean);
    for (const part of byId("groups").querySelectorAll("details")) {
      let shown = 0;
      for (const root of part.querySelectorAll(".field")) {
        const {name, description} = fields.get(root.dataset.name).field, text = `${name} ${description}`.toLowerCase();
        root.hidden = !words.every(word => text.includes(word));
        shown += !root.hidden;
      }
      part.hidden = !shown;
      part.dataset.open ??= part.open;
      part.open = words.length ? true : part.dataset.open === "true";
      if (!words.length) delete part.dataset.open;
    }
  });

  const STATE_CLASSES = {"under way": "", succeeded: "good", failed: "bad", lost: "bad", "ended by a change": "soft"};
  live.on("runs", ({rows, seen}) => {
    const names = [...new Map(rows.flatMap(row => row.metrics.map(m => [m.name, m.about])))];
    byId("runs").hidden = byId("runs-heading").hidden = !rows.length;
    const shown = rows.find(row => row.number === seen);
    byId("command").hidden = !shown;
    if (shown) byId("command").querySelector("code").textContent = shown.command;
    const seeds = new Set(rows.map(row => row.seed)).size > 1;
    const heads = ["run", "changed", ...(seeds ? ["seed"] : []), "verdict", "", ...names.map(([name]) => name.replaceAll("_", " "))];
    byId("runs").tHead.replaceChildren(createElement("tr", {}, ...heads.map((text, i) => {
      const about = names[i - heads.length + names.length]?.[1];
      return createElement("th", {scope: "col", textContent: text, title: about ?? ""});
    })));
    byId("runs").tBodies[0].replaceChildren(...rows.toReversed().map(row => {
      const changed = Object.entries(row.parameters).map(([name, text]) => `${name} = ${text}`);
      if (row.pushed) changed.push("pushed by hand");
      const cells = [
        createElement("td", {textContent: row.number}),
        createElement("td", {className: "set", textContent: changed.join(", ") || "nothing"}),
        ...(seeds ? [createElement("td", {textContent: row.seed ?? ""})] : []),
        createElement("td", {className: "reason"}, createElement("b", {className: STATE_CLASSES[row.state], textContent: row.state}),
          ...page.typeset(row.reason ? `: ${row.reason}` : "")),
        createElement("td", {className: "acts"}, ...createActions(row, seen)),
        ...names.map(([name]) => createElement("td", {className: "number", textContent: row.metrics.find(m => m.name === name)?.text ?? ""})),
      ];
      cells.forEach((cell, i) => { cell.dataset.label = heads[i]; });
      const line = createElement("tr", {className: row.number === seen ? "seen" : ""}, ...cells);
      line.dataset.state = row.state;
      return line;
    }));
  });

  function createActions(row, seen) {
    if (["under way", "lost"].includes(row.state)) return [];
    const show = createElement("button", {type: "button", textContent: row.number === seen ? "show again" : "show it"});
    show.addEventListener("click", () => { live.send("show", row.number); scrollTo({top: 0, behavior: "smooth"}); });
    if (row.report)
      return [show, " ", createElement("a", {href: `/report/${row.number}`, target: "_blank", textContent: "open the report"})];
    const write = createElement("button", {type: "button", textContent: "write a report"});
    write.addEventListener("click", () => {
      write.disabled = true;
      write.textContent = "being written";
      live.send("report", row.number);
    });
    return [show, " ", write];
  }
})();
