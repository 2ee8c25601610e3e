// Shows one moment of a run after another, for who films it from outside (scenarios/film):
//   film.show(t)   everything at t, s; the promise is kept when it is seen
// What is shown depends on t alone, not on what was shown before.
"use strict";
const film = (() => {
  const root = document.querySelector(".film"), content = page.data(root);
  const told = root.querySelector(".film-told"), run = content.scene;
  const DASHES = {dash: "dashed", longdash: "dashed", longdashdot: "dashed", dot: "dotted"};
  let scene = null, time = null;

  // Names of curves by samples of their lines, which take less room than Plotly's.
  function legendOf({data, layout}) {
    const legend = document.createElement("div");
    legend.className = "film-legend";
    for (const {name, line} of layout.showlegend ? data : []) {
      const sample = document.createElement("i"), entry = document.createElement("span");
      sample.style.borderTop = `2px ${DASHES[line.dash] ?? "solid"} ${line.color}`;
      entry.append(sample, name);
      legend.append(entry);
    }
    return legend;
  }

  // Draws figures as high as their places are, with all that stands above their axes, and one's axis below another's.
  async function fill(divs) {
    const plots = divs.map(div => {
      const figure = page.data(div), last = div === divs.at(-1), {layout} = figure;
      div.after(legendOf(figure));
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
    scene = sceneIn(root.querySelector(".replay-scene"), run);
    if (!scene) throw new Error("this browser does not offer WebGL");
    if (content.view === "follow") scene.follows = true;
    else scene.turn(content.view);
  });

  return {
    async show(t) {
      told.value = replayShapes.momentText(content, t);
      scene?.show(replayShapes.frameAt(time, t));
      page.setTime(t, root);
      for (let k = 0; k < 2; k++) await new Promise(done => requestAnimationFrame(done));
    },
  };
})();
