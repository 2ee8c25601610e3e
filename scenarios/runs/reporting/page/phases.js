// Shades the phases of time plots and names them: `layout.meta.phases` is a list of {from, to, name}. Names are level
// where they fit; a name that fits nowhere stands once, upright, over its longest phase (as in plotting.py). In a plot with
// data-brief or `layout.meta.brief`, which has no height to spare, such a name is level where it is not much wider than its
// phase and meets no other, and else missing.
"use strict";
(() => {
  const LETTER = 6.6, UPRIGHT = 15, MARGINS = 70, BUTTONS = 150, HIGH = 22;  // px

  function decorate(div, layout) {
    const phases = layout.meta?.phases;
    if (!phases || !phases.length) return;
    const [low, high] = layout.xaxis.range ?? [phases[0].from, phases[phases.length - 1].to];
    const pixels = Math.max(div.clientWidth - MARGINS, 1) / (high - low);
    const spans = phases.filter(p => p.to > low && p.from < high);
    layout.shapes = [...(layout.shapes ?? []), ...phases.flatMap((p, k) => k % 2 ? [shade(p)] : [])];
    let up = 0, right = 0;  // px that the longest upright name takes, and from the left how far names reach
    const isBare = "brief" in div.dataset, brief = isBare || layout.meta.brief;
    const end = (high - low) * pixels - (isBare ? 0 : BUTTONS);  // Plotly's buttons come over what stands right of it
    const {level, upright} = named(spans, low, high, pixels);
    if (brief) {
      const reach = p => LETTER * p.name.length / 2 + 3;  // to either side of its middle
      for (const p of upright.splice(0)) {
        const [from, to] = [p.middle * pixels - reach(p), p.middle * pixels + reach(p)];
        const isFree = level.every(other => Math.abs(other.middle - p.middle) * pixels >= reach(other) + reach(p));
        if (reach(p) <= p.long * pixels && from >= 0 && to <= end && isFree) level.push(p);
      }
    }
    const put = (p, angle, wide) => {
      right = Math.max(right, p.middle * pixels + wide / 2);
      return name(p, low + p.middle, angle);
    };
    layout.annotations = [
      ...(layout.annotations ?? []),
      ...level.map(p => put(p, 0, LETTER * p.name.length)),
      ...upright.map(p => {
        up = Math.max(up, LETTER * p.name.length - 14);
        return put(p, -90, UPRIGHT);
      }),
    ];
    if (!brief && right > end) up += HIGH;
    layout.margin = {...layout.margin, t: 30 + up};
    div.dataset.more = up;
  }

  // Returns the phases that are named level and upright, each with its middle, s after `low`. Where upright names would
  // lie over each other, the longer phase keeps its own.
  function named(spans, low, high, pixels) {
    const seen = spans.filter(p => p.name).map(p => {
      const from = Math.max(p.from, low), to = Math.min(p.to, high);
      return {name: p.name, middle: (from + to) / 2 - low, long: to - from};
    });
    const level = seen.filter(p => p.long * pixels > LETTER * p.name.length + 6);
    const written = new Set(level.map(p => p.name)), upright = [];
    for (const p of seen.sort((a, b) => b.long - a.long)) {
      if (written.has(p.name)) continue;
      written.add(p.name);
      if (upright.every(other => Math.abs(other.middle - p.middle) * pixels >= UPRIGHT)) upright.push(p);
    }
    return {level, upright};
  }

  function shade(p) {
    return {type: "rect", layer: "below", xref: "x", yref: "paper", x0: p.from, x1: p.to, y0: 0, y1: 1,
      fillcolor: page.colours().shade, line: {width: 0}};
  }

  function name(p, x, angle) {
    return {text: p.name, x, xref: "x", y: 1, yref: "paper", yanchor: "bottom", yshift: 1, textangle: angle, showarrow: false, font: {size: 12, color: page.colours().soft}};
  }

  page.onDraw(decorate);
})();
