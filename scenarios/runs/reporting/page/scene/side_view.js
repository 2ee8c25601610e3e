// A second, smaller view of a scene, across the first one's, which shows how far away things are.
//   const side = createSideView(element, scene, content, [front, back])
//     element, scene      what holds both views, and the first, of that content; see createScene
//     front, back         labels: the side is that on which the one is, from the other, lest this hides it
//   side.show()           takes where everything is
//   side.shown = true     whether it is seen
//   side.close()          ends it
"use strict";
const createSideView = (element, first, content, [front, back]) => {
  const LEVEL = 0.12;  // how far the eye is above what it looks at, over how far it is from there
  const TURNED = 0.01;  // rad between two frames from which on it turns with the first view
  const ROOM = 0.08;  // on each side, as a share of the longest
  const inset = document.createElement("div"), name = document.createElement("span");
  inset.className = "replay-inset";
  inset.setAttribute("aria-hidden", "true");  // it shows nothing that the first view does not
  name.textContent = "from the side";
  inset.append(name);
  const PERIOD = 100;  // ms between two frames at least: the first view's, and a camera's, come before
  const LOOK = 1000;  // ms after which it is looked at once more whether all is seen: that goes through all points
  let scene = null, azimuth = NaN, shownAt = 0, lookedAt = 0, ends = [];

  // Whether anything that is drawn now has left what the view holds, which then grows to hold it, with some room.
  function grow() {
    const points = content.traces.flatMap(trace => first.points(trace.label)).filter(p => p.every(Number.isFinite));
    if (points.every(p => ends.length && p.every((x, i) => ends[i][0] <= x && x <= ends[i][1]))) return false;
    const all = points.concat(ends.length ? [0, 1].map(k => ends.map(end => end[k])) : []);
    const tight = [0, 1, 2].map(i => [Math.min(...all.map(p => p[i])), Math.max(...all.map(p => p[i]))]);
    const room = ROOM * Math.max(...tight.map(([low, high]) => high - low));
    ends = tight.map(([low, high]) => [low - room, high + room]);
    return true;
  }
  const corners = () => [0, 1, 2, 3, 4, 5, 6, 7].map(n => ends.map(([low, high], i) => n >> i & 1 ? high : low));

  // Looks from the first view's right or left, whose azimuth is a quarter turn from its eye's.
  function follow() {
    const now = first.spherical().azimuth;
    if (!scene || Math.abs(now - azimuth) < TURNED) return;
    azimuth = now;
    const right = [-Math.sin(azimuth), Math.cos(azimuth)];
    const meanOf = label => first.points(label).reduce((sum, p, _, all) => sum + (right[0] * p[0] + right[1] * p[1]) / all.length, 0);
    const to = meanOf(front) < meanOf(back) ? -1 : 1;
    scene.lookFrom([to * right[0], to * right[1], LEVEL]);
  }
  const api = {
    show() {
      if (performance.now() - shownAt < PERIOD) return;
      shownAt = performance.now();
      if (scene && shownAt - lookedAt > LOOK) {
        lookedAt = shownAt;
        if (grow()) {
          scene.hold(corners());
          azimuth = NaN;
          follow();
        }
      }
      scene?.show(Infinity);
    },
    get shown() { return scene !== null; },
    set shown(yes) {
      if (yes === api.shown) return;
      if (yes) {
        element.append(inset);
        ends = [];
        grow();
        scene = createScene(inset, {...content, held: corners()});
        azimuth = NaN;
        follow();
        api.show();
      } else {
        scene?.dispose();
        scene = null;
        inset.querySelectorAll("canvas, svg").forEach(node => node.remove());
        inset.remove();
      }
    },
    close() {
      first.onBeforeRender = () => {};
      api.shown = false;
    },
  };
  first.onBeforeRender = follow;
  api.shown = true;
  return api;
};
