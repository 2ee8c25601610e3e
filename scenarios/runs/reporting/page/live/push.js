// Pushes bodies of the scene by hand, where the run lets it: press on one and drag. The force lies in the plane of the view
// and is as large as the drag is long, up to the greatest; an arrow shows it until the body is released.
"use strict";
(() => {
  const FULL = 0.3;     // share of the scene's height that one drags for the greatest force
  const PERIOD = 33;    // ms between two messages, at least
  const root = document.querySelector(".live");
  let pushed = null;    // what is pushed: {scene, label, frame, point, greatest, force, from, to, drawing}
  let sent = 0;

  const svg = (name, attributes) => {
    const node = document.createElementNS("http://www.w3.org/2000/svg", name);
    for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, value);
    return node;
  };

  // The body at a place of the window, if it can be pushed.
  function bodyAt({clientX, clientY}) {
    for (const {bodies, greatest} of live.run?.pushes ?? []) {
      const hit = live.scene?.pick(clientX, clientY, bodies);
      if (hit) return {...hit, frame: bodies[0], greatest};
    }
    return null;
  }

  function forceOfDrag({from, to, greatest}, high) {
    const [right, down] = [to[0] - from[0], to[1] - from[1]];
    const long = Math.hypot(right, down), newtons = Math.min(greatest, greatest * long / (FULL * high));
    return long ? live.scene.acrossView(newtons * right / long, -newtons * down / long) : [0, 0, 0];
  }

  function drawArrow() {
    if (!pushed || pushed.scene !== live.scene) return;
    const {frame, point, force, drawing} = pushed, scene = live.scene;
    const [x, y] = scene.toPixels(scene.toWorld(frame, point));
    const newtons = Math.hypot(...force), long = newtons / pushed.greatest * FULL * drawing.clientHeight;
    const [dx, dy] = [pushed.to[0] - pushed.from[0], pushed.to[1] - pushed.from[1]], d = Math.hypot(dx, dy) || 1;
    const [ux, uy] = [dx / d, dy / d], [tx, ty] = [x + long * ux, y + long * uy];
    const wing = side => `${tx - 11 * ux - side * 7 * uy} ${ty - 11 * uy + side * 7 * ux}`;
    const [line, dot, text] = drawing.children;
    line.setAttribute("d", `M${x} ${y}L${tx} ${ty}` + (long > 4 ? `M${wing(1)}L${tx} ${ty}L${wing(-1)}` : ""));
    dot.setAttribute("cx", x);
    dot.setAttribute("cy", y);
    text.setAttribute("x", tx + 10);
    text.setAttribute("y", ty - 10);
    text.textContent = `${newtons.toFixed(1)} N`;
    requestAnimationFrame(drawArrow);
  }

  function sendPush() {
    sent = performance.now();
    live.send("push", {body: pushed.label, point: pushed.point, force: pushed.force});
  }

  function release() {
    if (!pushed) return;
    pushed.drawing.remove();
    pushed = null;
    delete root.dataset.pushed;
    live.send("push", null);
  }

  for (const name of ["begun", "ended", "lost"]) live.on(name, release);
  live.on("shown", () => {
    const element = root.querySelector(".replay-scene");
    if (!element || !live.run.pushes.length) return;
    // Before the scene's own controls, which else turn the view.
    element.addEventListener("pointerdown", event => {
      const body = event.isPrimary && event.button === 0 && live.isUnderWay && bodyAt(event);
      if (!body) return;
      event.stopPropagation();
      const at = [event.clientX, event.clientY], drawing = svg("svg", {class: "push-arrow"});
      drawing.append(svg("path", {}), svg("circle", {r: 5}), svg("text", {}));
      element.append(drawing);
      pushed = {...body, scene: live.scene, point: live.scene.toBody(body.frame, body.point), force: [0, 0, 0], from: at, to: at, drawing};
      root.dataset.pushed = body.label;
      event.target.setPointerCapture(event.pointerId);
      drawArrow();
    }, true);
    element.addEventListener("pointermove", event => {
      if (!pushed) {
        const isOffered = event.pointerType === "mouse" && !event.buttons && live.isUnderWay;
        element.classList.toggle("can-push", isOffered && Boolean(bodyAt(event)));
        return;
      }
      event.stopPropagation();
      pushed.to = [event.clientX, event.clientY];
      pushed.force = forceOfDrag(pushed, element.clientHeight);
      if (performance.now() - sent >= PERIOD) sendPush();
    }, true);
    for (const name of ["pointerup", "pointercancel", "lostpointercapture"]) element.addEventListener(name, release, true);
  });
  // The last move of a drag counts, too.
  setInterval(() => { if (pushed && performance.now() - sent >= PERIOD) sendPush(); }, PERIOD);
  addEventListener("blur", release);
  addEventListener("keydown", ({key}) => { if (key === "Escape") release(); });
})();
