// Shows one frame of a film after another, for who takes them from outside (scenarios/pages/film):
//   film.show(t)   everything at t, s; the promise is kept when it has been rendered
// What is shown depends on t alone, not on what was shown before.
"use strict";
const film = (() => {
  const root = document.querySelector(".film"), content = page.data(root);
  const readout = root.querySelector(".film-time"), run = content.scene;
  const DASHES = {dash: "6 3", longdash: "10 4", longdashdot: "10 3 2 3", dot: "2 3"};  // px
  let scene = null, time = null;

  // Names of curves by samples of their lines, which take less room than Plotly's.
  function createLegend({data, layout}) {
    const legend = document.createElement("div");
    legend.className = "film-legend";
    for (const {name, line} of layout.showlegend ? data : []) {
      const entry = document.createElement("span");
      entry.textContent = name;
      entry.insertAdjacentHTML("afterbegin", '<svg viewBox="0 0 24 8"><path d="M0 4H24" fill="none" stroke-width="2"/></svg>');
      Object.assign(entry.querySelector("path").style, {stroke: line.color, strokeDasharray: DASHES[line.dash] ?? "none"});
      legend.append(entry);
    }
    return legend;
  }

  // Draws figures as high as their places are, with all that stands above their axes, and one's axis below another's.
  async function fill(divs) {
    const plots = divs.map(div => {
      const figure = page.data(div), last = div === divs.at(-1), {layout} = figure;
      div.after(createLegend(figure));
      const margin = {t: layout.meta.phases ? 30 : 12, ...last ? {} : {b: 26}};
      Object.assign(layout, {showlegend: false, margin, xaxis: {...layout.xaxis, ...last ? {} : {title: null}}});
      return {div, figure, high: 0, more: 0};
    });
    for (const plot of plots) plot.high = plot.div.clientHeight;
    for (const {div, high} of plots) Object.assign(div.style, {flex: "none", height: `${high}px`});
    for (let k = 0; k < 2; k++) {
      for (const plot of plots) {
        const {div, figure, high, more} = plot;
        div.dataset.height = high - more;
        div.style.height = `${high}px`;
        await page.draw(div, figure);
        plot.more += parseFloat(div.style.height) - high;
      }
      const left = Math.max(...plots.map(({div}) => div._fullLayout._size.l));
      for (const {figure} of plots) figure.layout.margin.l = left;
    }
  }

  page.onTime(() => {});  // lets plots have a cursor
  page.onReady(async () => {
    await fill([...root.querySelectorAll(".film-plot")]);
    if (!run) return;
    time = page.array(run.time);
    replayShapes.unpack(run);
    scene = createScene(root.querySelector(".replay-scene"), run);
    if (!scene) throw new Error("this browser does not offer WebGL");
    if (content.view === "follow") scene.follows = true;
    else scene.setView(content.view);
  });

  return {
    async show(t) {
      readout.value = replayShapes.timeText(content, t);
      scene?.show(replayShapes.frameAt(time, t));
      page.setTime(t, root);
      for (let k = 0; k < 2; k++) await new Promise(done => requestAnimationFrame(done));
    },
  };
})();
