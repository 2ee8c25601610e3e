// Draws the figures of a page in its colours. Other scripts of a page use:
//   page.colours()          the page's colours by their names in page.css: {ink, soft, line, card, c0, ...}
//   page.onColours(act)     calls `act` when they have changed
//   page.draw(div, figure)  draws a Plotly figure, and again when the colours change; returns a promise
//   page.onDraw(change)     calls `change(div, layout)` before a figure is drawn
//   page.onReady(act)       calls `act` when the figures that are in the page have been drawn; waits for its promise
//   page.setTime(t, from)   moves the cursor in all plots over time to t, s; `from` is who moves it
//   page.onTime(act)        calls `act(t, from)` when it has been moved
//   page.array(packed)      a typed array of one that Plotly has packed: {dtype, bdata}; where it has {low, step}, too, its
//                           numbers are low + n * step, and 65535 stands for NaN
//   page.data(element)      the content of the JSON script within an element
//   page.typeset(text)      a text as nodes: what stands between two backticks is code
"use strict";
const page = (() => {
  const names = ["ink", "soft", "line", "page", "card", "shade", "good", "bad", "link",
    "c0", "c1", "c2", "c3", "c4", "c5", "c6", "c7", "c8"];
  const touch = matchMedia("(pointer: coarse)").matches;
  const figures = new Map();
  let span = null;  // the range of time that was chosen
  let cursor = null;  // the time that plots and replay show, s
  const listeners = [], changes = [], starts = [], clocks = [];

  function colours() {
    const style = getComputedStyle(document.documentElement);
    return Object.fromEntries(names.map(name => [name, style.getPropertyValue("--" + name).trim()]));
  }

  function template() {
    const c = colours();
    const axis = {
      gridcolor: c.line, linecolor: c.soft, zerolinecolor: c.line, automargin: true, zeroline: false,
      title: {standoff: 8}, tickfont: {color: c.soft},
    };
    const depth = {...axis, backgroundcolor: "rgba(0,0,0,0)", showbackground: false};
    return {layout: {
      colorway: [c.c0, c.c1, c.c2, c.c3, c.c4, c.c5, c.c6, c.c7, c.c8],
      font: {color: c.ink, family: "system-ui, sans-serif", size: 13},
      paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)",
      margin: {l: 56, r: 12, t: 30, b: 44},
      xaxis: axis, yaxis: axis,
      scene: {xaxis: depth, yaxis: depth, zaxis: depth},
      hoverlabel: {bgcolor: c.card, bordercolor: c.line, font: {color: c.ink, family: "system-ui, sans-serif"}},
      legend: {orientation: "h", x: 0, xanchor: "left", y: 0, yref: "container", yanchor: "bottom"},
      dragmode: touch ? false : "zoom",
      modebar: {bgcolor: "rgba(0,0,0,0)", color: c.soft, activecolor: c.ink},
    }};
  }

  // Puts the page's colours in place of their names in a figure.
  function coloured(part, c) {
    if (typeof part === "string") {
      const name = /^var\(--(\w+)\)$/.exec(part);
      return name ? c[name[1]] : part;
    }
    if (Array.isArray(part)) return part.map(p => coloured(p, c));
    if (part === null || typeof part !== "object" || ArrayBuffer.isView(part)) return part;
    return Object.fromEntries(Object.entries(part).map(([k, p]) => [k, k === "bdata" ? p : coloured(p, c)]));
  }

  const settings = {
    displaylogo: false, displayModeBar: touch ? false : "hover", scrollZoom: false,
    modeBarButtonsToRemove: ["select2d", "lasso2d", "autoScale2d", "zoomIn2d", "zoomOut2d"],
    showSendToCloud: false, plotlyServerURL: "",  // a page sends nothing to anyone
  };

  function draw(div, figure) {
    if (!figures.has(div)) widths.observe(div);
    figures.set(div, figure);
    const {data, layout, config} = coloured(figure, colours());
    const shown = {...layout, template: template(), autosize: true};
    if (figure.layout.meta?.time) asOthers(shown);
    if (div.clientWidth < 560) narrow(div, data, shown);
    else if (layout.meta?.list) delete div.dataset.more;
    for (const change of changes) change(div, shown);
    div.dataset.height ??= parseFloat(div.style.height);
    div.dataset.width = div.clientWidth;
    const first = !div.layout;
    return Plotly.react(div, data, shown, {...settings, ...config}).then(() => {
      if (first) {
        div.on("plotly_relayout", change => follow(div, change));
        if (figure.layout.meta?.time) div.on("plotly_click", ({points}) => setTime(points[0].x, div));
      }
      return fit(div);
    }).then(() => mark(div));
  }

  function setTime(t, from) {
    cursor = t;
    for (const div of figures.keys()) mark(div);
    for (const act of clocks) act(t, from);
  }

  // Stands a line at the cursor's time in a plot over time. It lies over the plot, since Plotly takes long to draw one.
  function mark(div) {
    if (!clocks.length || !figures.get(div).layout.meta?.time || !div._fullLayout) return;
    const {xaxis: x, _size: all} = div._fullLayout;
    let line = div.querySelector(".cursor");
    if (!line) {
      line = document.createElement("i");
      line.className = "cursor";
      div.append(line);
    }
    const at = x.l2p(cursor);
    line.hidden = cursor === null || !(at >= 0 && at <= x._length);
    Object.assign(line.style, {left: `${x._offset + at}px`, top: `${all.t}px`, height: `${all.h}px`});
  }

  // Lets a figure show the range of time that was chosen in one of them; all heights are theirs.
  function asOthers(layout) {
    layout.xaxis = span ? {...layout.xaxis, range: [...span], autorange: false} : {...layout.xaxis};
    for (const key of Object.keys(layout).filter(k => /^yaxis\d*$/.test(k)))
      layout[key] = {...layout[key], fixedrange: true};
  }

  function follow(div, change) {
    if (!figures.get(div).layout.meta?.time) return;
    if (change["xaxis.autorange"]) span = null;
    else if ("xaxis.range[0]" in change) span = [change["xaxis.range[0]"], change["xaxis.range[1]"]];
    else if (change["xaxis.range"]) span = change["xaxis.range"];
    else return;
    redraw(figure => figure.layout.meta?.time);
  }

  const LEAST_ROW = 66, MOST_ROW = 96, NAME = 38;  // heights of a list's row with its name above it, and of a name, pixels

  // On a phone: few ticks, small margins and letters, and the names of a list above its rows instead of beside them.
  function narrow(div, data, layout) {
    for (const key of Object.keys(layout).filter(k => /^[xy]axis\d*$/.test(k)))
      layout[key] = {nticks: key[0] === "x" ? 5 : 6, ...layout[key]};
    layout.margin = {l: 44, r: 6, t: 30, b: 40, ...layout.margin};
    layout.font = {size: 12, ...layout.font};
    if (layout.meta?.time)  // the titles of panels
      layout.annotations = layout.annotations?.map(title => ({
        ...title, text: wrapped(title.text, div.clientWidth / 8), align: "left", xshift: -36, font: {...title.font, size: 13},
      }));
    if (layout.meta?.list) {
      const {tickvals, ticktext} = layout.yaxis;
      const spread = Math.max(0, ...data.flatMap(({y = []}) => Array.from(array(y), v => Math.abs(v - Math.round(v)))));
      const row = Math.min(MOST_ROW, Math.max(LEAST_ROW, NAME / Math.max(1 - 2 * spread, 0.01)));
      layout.annotations = tickvals.map((y, k) => ({
        text: wrapped(ticktext[k].replaceAll("<br>", " "), div.clientWidth / 7),
        x: 0, xref: "paper", xanchor: "left", y, yanchor: "bottom", yshift: spread * row + 4, align: "left", showarrow: false,
      }));
      layout.yaxis = {...layout.yaxis, showticklabels: false};
      layout.margin.l = 6;
      div.dataset.more = Math.max(0, row * tickvals.length - parseFloat(div.dataset.height ?? div.style.height));
    }
  }

  // Returns a text in lines of so many characters at most, where its words allow it.
  function wrapped(text, most) {
    const lines = [""];
    for (const word of text.split(" ")) {
      const last = lines.at(-1);
      if (!last || last.length + word.length < most) lines[lines.length - 1] = last ? `${last} ${word}` : word;
      else lines.push(word);
    }
    return lines.join("<br>");
  }

  // Makes room below a figure for its legend, so that the axes keep their height.
  function fit(div) {
    const legend = div.querySelector("g.legend");
    const more = legend ? Math.ceil(legend.getBBox().height) : 0;
    const height = Number(div.dataset.height) + Number(div.dataset.more ?? 0) + more;
    if (Math.abs(parseFloat(div.style.height) - height) < 2 && !more) return null;
    div.style.height = height + "px";
    return Plotly.relayout(div, more ? {autosize: true, "margin.b": 48 + more} : {autosize: true});
  }

  const arrays = {
    f8: Float64Array, f4: Float32Array, i4: Int32Array, u4: Uint32Array, i2: Int16Array, u2: Uint16Array,
    i1: Int8Array, u1: Uint8Array,
  };
  function array(packed) {
    if (Array.isArray(packed) || ArrayBuffer.isView(packed)) return packed;
    const text = atob(packed.bdata);
    const bytes = Uint8Array.from(text, c => c.charCodeAt(0));
    const numbers = new arrays[packed.dtype](bytes.buffer);
    if (packed.step === undefined) return numbers;
    return Float64Array.from(numbers, n => n === 65535 ? NaN : packed.low + n * packed.step);
  }

  function data(element) {
    return JSON.parse(element.querySelector('script[type="application/json"]').textContent);
  }

  function redraw(which = () => true) {
    return Promise.all([...figures].filter(([, f]) => which(f)).map(([div, figure]) => draw(div, figure)));
  }

  const widths = new ResizeObserver(entries => {
    for (const {target} of entries)
      if (target.clientWidth && target.clientWidth !== Number(target.dataset.width)) draw(target, figures.get(target));
  });

  function recolour() {
    for (const act of listeners) act();
    redraw();
  }

  async function drawAll() {
    for (const div of document.querySelectorAll(".plot")) {
      const figure = data(div);
      await draw(div, figure);
      await new Promise(done => setTimeout(done));  // the page answers between figures
    }
    for (const start of starts) await start();
    document.documentElement.dataset.drawn = "all";
  }

  const typeset = text => text.split("`").map((part, i, all) =>
    i % 2 && i < all.length - 1 ? Object.assign(document.createElement("code"), {textContent: part}) : i % 2 ? "`" + part : part);

  document.addEventListener("DOMContentLoaded", drawAll);  // when the page's other scripts have run
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", recolour);
  matchMedia("print").addEventListener("change", recolour);
  addEventListener("beforeprint", () => { for (const part of document.querySelectorAll("details.printed")) part.open = true; });
  return {
    colours, draw, array, data, typeset, setTime, onTime: act => clocks.push(act),
    onColours: act => listeners.push(act), onDraw: act => changes.push(act), onReady: act => starts.push(act),
  };
})();
