// The scene of a round as the person sees it, in one view or two, and how long it takes until a sample is drawn.
// `photodiode` is an element that changes with each new sample, or null.
//   const play = studyScene(content, {eye, side, photodiode, onDrawn})   null without WebGL; see Trial.scene_content in trial.py
//   play.take(buffer)       a state of the run: time, stamp of the sample that it shows, s, and the places of all
//   play.target(place)      where the ball of the device's test is, [x, y, z] in W, m; null hides it
//   play.sideShown = true   whether there is a second view
//   play.scene, play.time
//   play.hand()             {p_WH, q_WH} as drawn
//   onDrawn(ms)             is called when a newer sample has been drawn: the time since its stamp
"use strict";
const studyScene = (content, {eye, side, photodiode, onDrawn}) => {
  const slots = replayShapes.unpack(content);
  const target = content.traces.find(t => t.label === "place to go");
  const plumbs = content.traces.filter(t => t.label === "depth");
  const moved = slots.filter(({of}) => !plumbs.includes(of) && !target?.parts.includes(of));
  const part = (label, key) => content.traces.find(t => t.label === label && t.parts)?.parts[0]?.[key];
  const floor = content.floor;
  content.played = true;
  const scenes = [];
  let stamp = NaN, drawn = NaN, newest = null, asked = null;
  const stale = new Set();

  // A line from what floats down to the floor: with its shadow it tells how far away that is.
  function setPlumbLine(line, p) {
    if (line && p) line.points = Float64Array.from([...p, p[0], p[1], floor]);
  }

  // States come faster than slow computers draw: only the one is unpacked that is drawn.
  function unpackNewest() {
    if (newest) {
      const numbers = new Float64Array(newest);
      let at = 2;
      for (const {of, key} of moved) {
        const size = of.trail ? 3 : of[key].length;
        of[key] = numbers.subarray(at, at += size);
      }
      setPlumbLine(plumbs[0], part("hand", "p"));
      setPlumbLine(plumbs[1], part("object", "p"));
      stamp = numbers[1];
      newest = null;
    }
    if (target) target.parts[0].points = asked;
  }
  function addView(element) {
    const scene = createScene(element, content);
    if (!scene) return;
    scenes.push(scene);
    scene.onBeforeRender = () => {
      if (!stale.delete(scene)) return;
      unpackNewest();
      scene.setFrame(0);
    };
    requestRender();
  }
  const requestRender = () => scenes.forEach(scene => { stale.add(scene); scene.requestRender(); });
  const ball = p => Float64Array.from(p ? [...p, p[0], p[1], p[2] + 1e-4] : new Array(6).fill(NaN));

  asked = ball(null);
  addView(eye);
  if (!scenes.length) return null;
  scenes[0].onAfterRender = () => {
    if (!Number.isFinite(stamp) || stamp === drawn) return;
    drawn = stamp;
    photodiode?.classList.toggle("lit");
    onDrawn(performance.now() - 1000 * stamp);
  };

  return {
    scene: scenes[0],
    time: 0,
    take(buffer) {
      newest = buffer;
      this.time = new Float64Array(buffer, 0, 1)[0];
      requestRender();
    },
    target(place) {
      asked = ball(place);
      requestRender();
    },
    get sideShown() { return scenes.length > 1; },
    set sideShown(yes) {
      side.hidden = !yes;
      if (yes && scenes.length === 1) {
        addView(side);
        scenes[1].setView("front");
      } else if (!yes && scenes.length > 1) {
        scenes.pop().dispose();
        side.querySelectorAll("canvas, svg").forEach(node => node.remove());
      }
    },
    hand: () => ({p_WH: Array.from(part("hand", "p") ?? []), q_WH: Array.from(part("hand", "q") ?? [])}),
    part,
    dispose() {
      this.sideShown = false;
      scenes[0].dispose();
      eye.querySelectorAll("canvas, svg").forEach(node => node.remove());
    },
  };
};
