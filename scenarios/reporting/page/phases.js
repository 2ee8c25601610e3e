// Shades the phases of time plots and names them: `layout.meta.phases` is a list of {from, to, name}.
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
    layout.annotations = [...(layout.annotations ?? []), ...spans.flatMap(p => {
      const from = Math.max(p.from, low), to = Math.min(p.to, high), wide = (to - from) * pixels;
      const middle = ((from + to) / 2 - low) * pixels, level = wide > LETTER * p.name.length + 6;
      if (!level && wide < UPRIGHT) return [];
      right = Math.max(right, middle + (level ? LETTER * p.name.length : UPRIGHT) / 2);
      if (level) return [name(p, (from + to) / 2, 0)];
      up = Math.max(up, LETTER * p.name.length - 14);
      return [name(p, (from + to) / 2, -90)];
    })];
    if (right > (high - low) * pixels - BUTTONS) up += HIGH;  // Plotly's buttons come over what stands there
    layout.margin = {...layout.margin, t: 30 + up};
    div.dataset.more = up;
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
