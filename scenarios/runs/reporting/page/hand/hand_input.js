// A hand in a scene that is moved by mouse, touch, keys or gamepad; its samples are those of hand_messages.py.
//   const hand = handInput({element, camera, start, onSample, onChange})
//     element      what the pointer moves over; its canvas shows what the camera sees, without borders
//     camera       of three.js
//     start        {p_WH, q_WH, closed, centre, radius}: where the hand is wanted, and how far it goes, m
//     onSample     is called with a sample, some sixty times a second, while a device is chosen and the page is seen
//     onChange     is called when the hand is closed or opened, with whether it is closed
//   hand.choose(device)     "pointer" (mouse, touch and keys), "gamepad"; of any other name, nothing here leads it
//   hand.grasp(closed)      closes or opens it
//   hand.pose()             {p_WH, q_WH, closed}
//   hand.place(pose)        takes in where another device has led it
//   hand.start              as given
//   hand.axes()             directions of the view in W: to its right, up, towards the eye
//   hand.end()              lets go of the element
// The mouse moves the hand in the plane of the picture, at the hand's depth: it is where the pointer is. The wheel moves
// it towards the eye and away. A finger on a screen takes it along, two change its depth. With Alt the pointer is the view's.
"use strict";
const handInput = (() => {
  const PERIOD = 12;  // ms between two samples at least
  const WHEEL = 0.00015, PINCH = 0.002;  // m a pixel; a notch of a wheel, 100 pixels, is 1.5 cm: less than half an object
  const SPEED = 0.4, TURN = 1.2;  // m/s, rad/s
  const DEAD = 0.12;  // of a gamepad's stick
  const KEYS = {
    ArrowRight: ["move", 0, 1], ArrowLeft: ["move", 0, -1], ArrowUp: ["move", 1, 1], ArrowDown: ["move", 1, -1],
    PageDown: ["move", 2, 1], PageUp: ["move", 2, -1],
    KeyS: ["turn", 0, 1], KeyW: ["turn", 0, -1], KeyA: ["turn", 1, 1], KeyD: ["turn", 1, -1], KeyQ: ["turn", 2, 1], KeyE: ["turn", 2, -1],
  };
  const HERE = new Set(["pointer", "gamepad"]);
  const live = x => Math.abs(x ?? 0) > DEAD ? x : 0;

  return ({element, camera, start, onSample, onChange = () => {}}) => {
    const p = new THREE.Vector3(...start.p_WH), centre = new THREE.Vector3(...start.centre);
    const Quaternion = camera.quaternion.constructor;  // the page's three.js names only what scenes need
    const [w, x, y, z] = start.q_WH, q = new Quaternion(x, y, z, w);
    const held = new Set(), fingers = new Map();
    let closed = start.closed, device = "nothing", kind = "mouse", sent = 0, stamped = 0, before = performance.now(), pressed = false;

    // Directions of the picture in W: to its right, up, and towards the eye.
    function axes() {
      camera.updateMatrixWorld();
      const e = [new THREE.Vector3(), new THREE.Vector3(), new THREE.Vector3()];
      camera.matrixWorld.extractBasis(...e);
      return e;
    }

    // The point under a pixel in the plane through the hand that is parallel to the picture.
    function under(clientX, clientY) {
      const box = element.getBoundingClientRect(), back = axes()[2];
      const at = new THREE.Vector3(2 * (clientX - box.left) / box.width - 1, 1 - 2 * (clientY - box.top) / box.height, 0.5);
      const eye = new THREE.Vector3().setFromMatrixPosition(camera.matrixWorld);
      const along = at.unproject(camera).sub(eye), depth = along.dot(back);
      const far = p.clone().sub(eye).dot(back) / depth;
      return far > 0 ? eye.addScaledVector(along, far) : p.clone();
    }

    function goTo(there) {
      p.copy(there).sub(centre).clampLength(0, start.radius).add(centre);
    }

    function send(stamp = performance.now()) {
      if (!HERE.has(device) || document.hidden || stamp - sent < PERIOD) return;
      sent = stamp;
      stamped = Math.max(stamp, stamped + 0.1);  // a click may come before a move that was stamped later than it
      onSample({...api.pose(), stamp: stamped / 1000, device: device === "gamepad" ? "gamepad" : kind});
    }

    function grasp(yes) {
      if (closed === yes) return;
      closed = yes;
      onChange(closed);
      sent = 0;
      send();
    }

    // Moves and turns by rates between -1 and 1, along and about the axes of the picture.
    function drive(move, turn, dt) {
      const e = axes(), there = p.clone();
      move.forEach((rate, i) => there.addScaledVector(e[i], SPEED * dt * rate));
      goTo(there);
      turn.forEach((rate, i) => rate && q.premultiply(new Quaternion().setFromAxisAngle(e[i], TURN * dt * rate)).normalize());
    }

    function tick() {
      const t = performance.now(), dt = Math.min(t - before, 100) / 1000;
      before = t;
      if (device === "gamepad") {
        const pad = [...navigator.getGamepads()].find(Boolean);
        if (!pad) return;  // no samples: the hand stops
        const button = i => pad.buttons[i]?.value ?? 0;
        const [a, b, c, d] = [0, 1, 2, 3].map(i => live(pad.axes[i]));
        drive([a, -b, button(7) - button(6)], [d, -c, button(4) - button(5)], dt);
        const down = button(0) > 0.5;
        if (down && !pressed) grasp(!closed);
        pressed = down;
      } else if (held.size) {
        const rates = {move: [0, 0, 0], turn: [0, 0, 0]};
        for (const code of held) rates[KEYS[code][0]][KEYS[code][1]] += KEYS[code][2];
        drive(rates.move, rates.turn, dt);
      }
      send(t);
    }

    const ours = event => device === "pointer" && !event.altKey;
    const listeners = {
      pointermove(event) {
        if (!ours(event)) return;
        kind = event.pointerType || "mouse";
        if (kind === "touch") drag(event);
        else if (!(event.buttons & ~1)) goTo(under(event.clientX, event.clientY));  // with other buttons the view is moved
        else return;
        event.stopImmediatePropagation();
        send(Math.max(event.timeStamp, sent + PERIOD));
      },
      pointerdown(event) {
        if (!ours(event) || event.button !== 0) return;
        kind = event.pointerType || "mouse";
        if (kind === "touch") fingers.set(event.pointerId, [event.clientX, event.clientY]);
        else grasp(!closed);
        element.focus({preventScroll: true});
        event.stopImmediatePropagation();
      },
      pointerup: event => fingers.delete(event.pointerId),
      pointercancel: event => fingers.delete(event.pointerId),
      wheel(event) {
        if (!ours(event)) return;
        event.preventDefault();
        event.stopImmediatePropagation();
        const pixels = event.deltaY * (event.deltaMode === 1 ? 30 : 1);
        goTo(p.clone().addScaledVector(axes()[2], WHEEL * pixels));
        send();
      },
    };
    // Keys are the hand's wherever the focus is, but where it takes keys itself; the space bar would press a button.
    const TAKES_KEYS = "select, textarea, input:not([type=checkbox], [type=radio], [type=button], [type=submit])";
    const isKey = event => device === "pointer" && !event.ctrlKey && !event.metaKey && !event.altKey
      && (event.code === "Space" || event.code in KEYS) && !event.target.closest?.(TAKES_KEYS);
    const keyListeners = {
      keydown(event) {
        if (!isKey(event)) return;
        if (event.code !== "Space") held.add(event.code);
        else if (!event.repeat) grasp(!closed);
        event.preventDefault();
      },
      keyup(event) {
        held.delete(event.code);
        if (isKey(event)) event.preventDefault();  // Firefox presses a button now
      },
      blur: () => held.clear(),
    };

    function drag(event) {
      const last = fingers.get(event.pointerId);
      if (!last) return;
      const others = [...fingers].filter(([id]) => id !== event.pointerId).map(([, at]) => at);
      if (others.length) {
        const wide = at => Math.hypot(at[0] - others[0][0], at[1] - others[0][1]);
        goTo(p.clone().addScaledVector(axes()[2], PINCH * (wide([event.clientX, event.clientY]) - wide(last))));
      } else goTo(p.clone().add(under(event.clientX, event.clientY)).sub(under(...last)));
      fingers.set(event.pointerId, [event.clientX, event.clientY]);
    }

    for (const [name, act] of Object.entries(listeners)) element.addEventListener(name, act, {capture: true, passive: false});
    for (const [name, act] of Object.entries(keyListeners)) window.addEventListener(name, act, {capture: name !== "blur"});
    const timer = setInterval(tick, 1000 / 60);
    if (element.tabIndex < 0) element.tabIndex = 0;

    const api = {
      choose(name) {
        device = name;
        held.clear();
        fingers.clear();
        element.style.touchAction = name === "pointer" ? "none" : "";
        if (name === "pointer") element.focus({preventScroll: true});
      },
      grasp,
      place(pose) {
        p.fromArray(pose.p_WH);
        q.set(...pose.q_WH.slice(1), pose.q_WH[0]);
        if (closed !== pose.closed) onChange(closed = pose.closed);
      },
      start,
      axes: () => axes().map(e => e.toArray()),
      pose: () => ({p_WH: p.toArray(), q_WH: [q.w, q.x, q.y, q.z], closed}),
      end() {
        clearInterval(timer);
        device = "nothing";
        for (const [name, act] of Object.entries(listeners)) element.removeEventListener(name, act, {capture: true});
        for (const [name, act] of Object.entries(keyListeners)) window.removeEventListener(name, act, {capture: name !== "blur"});
      },
    };
    return api;
  };
})();
