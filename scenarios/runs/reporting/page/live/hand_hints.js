// What helps who leads a hand, over the scene: lines down from the hand and from where it is to be, a ring there, and in
// words how far and in which direction of the view the one is from the other. See HandHint in live_inputs.py.
//   const hints = createHandHints(viewport, floor)   floor: height to which the lines go, m
//   hints.show(hint)     takes the newest; null shows nothing
//   hints.close()        ends them
"use strict";
const createHandHints = ({scene, element}, floor) => {
  const ENOUGH = 0.01;  // m; nearer along an axis of the view, nothing is said of it
  const RING = 0.03;  // m, the ring's radius
  const svg = (name, className) => {
    const node = document.createElementNS("http://www.w3.org/2000/svg", name);
    node.setAttribute("class", className);
    return node;
  };
  const drawing = svg("svg", "hand-hints"), words = document.createElement("p");
  const [ofHand, ofGoal, between, ring] = ["drop hand", "drop goal", "between", "ring"].map(name => svg("path", name));
  drawing.append(ofHand, ofGoal, between, ring);
  drawing.setAttribute("aria-hidden", "true");
  words.className = "hand-words";
  element.parentElement.append(drawing, words);
  let hint = null, request = 0;

  // Too far left, too low, too far away, as the hand is seen from the goal along the axes of the view; the farthest first.
  function distances() {
    const camera = scene.camera, e = [0, 1, 2].map(() => new THREE.Vector3());
    camera.updateMatrixWorld();
    camera.matrixWorld.extractBasis(...e);
    const off = new THREE.Vector3(...hint.p_WH).sub(new THREE.Vector3(...hint.goal));
    return [["too far right", "too far left"], ["too high", "too low"], ["too near to you", "too far away"]]
      .map((texts, i) => ({far: Math.abs(off.dot(e[i])), text: texts[off.dot(e[i]) > 0 ? 0 : 1]}))
      .filter(({far}) => far > ENOUGH).sort((a, b) => b.far - a.far).map(({far, text}) => `${Math.round(1000 * far)} mm ${text}`);
  }

  const path = points => "M" + points.map(p => scene.toPixels(p).map(x => x.toFixed(1)).join(" ")).join("L");
  const drop = ([x, y, z]) => path([[x, y, z], [x, y, floor], [x - 0.02, y, floor], [x + 0.02, y, floor], [x, y, floor], [x, y - 0.02, floor], [x, y + 0.02, floor]]);
  function draw() {
    request = 0;
    drawing.style.display = hint ? "" : "none";
    words.hidden = !hint?.advice;
    if (!hint) return;
    const {p_WH, goal, within_reach: within, holds, advice} = hint;
    const state = holds ? "holds" : within ? "within" : "";
    drawing.dataset.state = words.dataset.state = within ? "within" : state;
    ofHand.setAttribute("d", drop(p_WH));
    for (const node of [ofGoal, between, ring]) node.style.display = goal ? "" : "none";
    if (goal) {
      ofGoal.setAttribute("d", drop(goal));
      between.setAttribute("d", path([p_WH, goal]));
      const [x, y] = scene.toPixels(goal), [u, v] = scene.toPixels(goal.map((c, i) => c + scene.acrossView(RING, 0)[i]));
      const r = Math.hypot(u - x, v - y);
      ring.setAttribute("d", `M${x - r} ${y}a${r} ${r} 0 1 0 ${2 * r} 0a${r} ${r} 0 1 0 ${-2 * r} 0`);
    }
    words.textContent = [advice, goal && !within ? distances().join(", ") : ""].filter(Boolean).join(" ");
  }
  const requestDraw = () => { request ||= requestAnimationFrame(draw); };
  const controls = new ResizeObserver(requestDraw);
  controls.observe(element);
  element.addEventListener("pointermove", requestDraw);
  element.addEventListener("wheel", requestDraw, {passive: true});
  return {
    show(newest) {
      hint = newest;
      requestDraw();
    },
    close() {
      cancelAnimationFrame(request);
      controls.disconnect();
      element.removeEventListener("pointermove", requestDraw);
      element.removeEventListener("wheel", requestDraw);
      drawing.remove();
      words.remove();
    },
  };
};
