// Shows runs under way, one after the other, and controls their pace. live_page.py sends: texts with a JSON object that
// has one of begun, state, time with phase, plots, pictures, ended, refused; and after each time the places of all that is drawn,
// as 64-bit floats. Other scripts of a page use:
//   live.send(command, value)   sends a command
//   live.on(name, act)          calls act(value) when an object comes that has the name; "shown" when a run's scene is there,
//                               "lost" when the connection has ended
//   live.isUnderWay             whether a run goes on, as far as is known here
//   live.scene, live.run        of the run that is shown: its scene, and what was told as it began
//   live.session                set by the page of a session of runs, whose connection outlasts them
//   live.hand                   the hand that is led in it, see handInput; null or undefined where none is
"use strict";
const live = (() => {
  const root = document.querySelector(".live"), host = document.getElementById("scene");
  const byId = id => document.getElementById(id);
  const readout = root.querySelector(".replay-told"), plots = byId("plots");
  const ASKING = "#pause, #step, #stop, #pace, #signal, #chosen button, .play :is(button, input, select), #runs button";
  const chosen = [], listeners = {};
  const api = {
    scene: null, run: null, session: false, send, on(name, act) { (listeners[name] ??= []).push(act); }, get hand() { return lead?.hand; },
    get isUnderWay() { return Boolean(api.run) && !over && !isLost; },
  };
  const beside = byId("plot-beside"), choice = byId("plot-choice");  // in a session: a plot of choice beside the scene
  let parts = [], wanted = "";  // plots with their headings; the title of the one beside the scene
  let hints = null, viewport = null, slots = [], size = 0, paused = true, link = null, over = false, isLost = false, lead = null, side = null;

  // Puts the scene of a run in the place of the one before, seen from where that was seen, unless a hand is led only now.
  function beginRun(run) {
    const before = lead || !run.hand ? viewport?.scene.viewpoint() : null;
    hints?.close();
    side?.close();
    viewport?.close();
    viewport = null;
    lead?.close();
    over = false;
    const content = {...run.scene, live: true, ghost: run.hand ? "hand" : ""};
    slots = run.scene ? replayShapes.unpack(run.scene) : [];
    size = slots.reduce((sum, {of, key}) => sum + (of.trail ? 3 : of[key].length), 0);
    host.replaceChildren();
    if (run.scene) {
      host.append(byId("scene-of-run").content.cloneNode(true));
      for (const part of ["views", "legend"]) host.querySelector(".replay-" + part).outerHTML = run[part];
      viewport = createViewport(root, content);
      if (viewport) createRecorder(viewport, () => readout.value);
      if (before) viewport?.scene.setViewpoint(before);
    }
    const isLed = run.hand && viewport;
    lead = isLed ? createHandControl(viewport.element, viewport.scene.camera) : null;
    side = isLed ? createSideView(viewport.element.parentElement, viewport.scene, content, sidesOfHandover(viewport.scene)) : null;
    if (side) side.shown = byId("hand-side-view").checked;
    hints = isLed ? createHandHints(viewport, content.low[2]) : null;
    byId("hand").hidden = byId("hand-help").hidden = !lead;
    byId("task").hidden = !lead || !run.task;
    byId("task").textContent = run.task;
    Object.assign(api, {run, scene: viewport?.scene ?? null});
    if (run.title) document.title = document.querySelector("h1").textContent = run.title;
    byId("signals").replaceChildren(...run.signals.map(name => Object.assign(document.createElement("option"), {value: name})));
    byId("cameras").replaceChildren();
    byId("cameras").hidden = true;
    byId("push-help").hidden = !(viewport && run.pushes?.length);
    byId("push-help").textContent = (run.pushes ?? []).map(({bodies, greatest}) =>
      `Press on ${bodies.join(" or ")} and drag to push, with up to ${greatest} N.`).join(" ");
    byId("verdict").hidden = byId("waiting").hidden = true;
    byId("told").textContent = "";
    progress.restart();
    for (const id of ["pause", "step", "stop", "pace", "signal"]) byId(id).disabled = false;
    delete root.dataset.ended;
    root.dataset.frames = 0;
    root.dataset.begun = Number(root.dataset.begun ?? 0) + 1;
    send("choose", chosen.filter(name => run.signals.includes(name)));
  }

  // Takes where everything is; the point of a trail is added to its way.
  function setPlaces(numbers) {
    if (numbers.length !== size) return;
    let at = 0;
    for (const {of, key} of slots) {
      const size = of.trail ? 3 : of[key].length, values = numbers.subarray(at, at + size);
      at += size;
      if (of.trail) of.points = extended(of.points, values);
      else of[key] = Float64Array.from(values);
    }
    api.scene?.show(Infinity);
    side?.show();
  }
  function extended(points, more) {
    if (points.length + 3 > 3 * sceneObjects.maxTrailPoints) points = points.filter((_, i) => Math.floor(i / 3) % 2 === 0);
    const all = new Float64Array(points.length + 3);
    all.set(points);
    all.set(more, points.length);
    return all;
  }

  // Tells beside the wanted pace which one is reached, where that is less. Times come late now and then, as behind a plot:
  // the pace is that between the least late ones of two halves of the last seconds.
  const progress = (() => {
    const SPAN = 4000, SHARE = 0.95;  // ms; of the wanted pace, from which on nothing is said
    const told = byId("reached");
    let times = [];
    const leastLate = (some, pace) => some.reduce((a, b) => pace * (b.now - a.now) > 1000 * (b.t - a.t) ? a : b);
    return {
      restart() {
        times = [];
        told.value = "";
      },
      add(t) {
        const now = performance.now(), pace = Number(byId("pace").value);
        times = [...times.filter((one, i) => now - one.now < SPAN || i === times.length - 1), {now, t}];
        if (!pace || paused || now - times[0].now < SPAN / 2) return;
        const [early, late] = [true, false].map(first => times.filter(one => (one.now < (times[0].now + now) / 2) === first));
        const [a, b] = [early, late].map(some => leastLate(some, pace)), reached = 1000 * (b.t - a.t) / (b.now - a.now);
        told.value = reached < SHARE * pace ? `reached ${Number(reached.toPrecision(2))}\u00d7` : "";
      },
    };
  })();

  function send(command, value) {
    if (link?.readyState === WebSocket.OPEN) link.send(JSON.stringify({command, value}));
  }

  function receive(message) {
    for (const name of Object.keys(message)) for (const act of listeners[name] ?? []) act(message[name]);
    if (message.begun) {
      beginRun(message.begun);
      for (const act of listeners.shown ?? []) act();
    }
    else if (message.state) {
      if (message.state.paused !== paused || message.state.pace !== Number(byId("pace").value)) progress.restart();
      paused = message.state.paused;
      byId("pause").textContent = paused ? "\u25b6\ufe0e" : "\u275a\u275a";
      byId("pause").setAttribute("aria-label", paused ? "go on" : "pause");
      const pace = String(message.state.pace), select = byId("pace");
      if (![...select.options].some(o => o.value === pace)) select.add(new Option(`${pace}\u00d7`, pace), 0);
      select.value = pace;
    } else if ("time" in message) {
      progress.add(message.time);
      hints?.show(over ? null : message.hint);
      readout.value = `${message.time.toFixed(2)} s${message.phase ? ", " + message.phase : ""}`;
    } else if (message.plots) drawPlots(message.plots);
    else if (message.pictures) showPictures(message.pictures);
    else if (message.ended) endRun(message.ended);
    else if (message.refused) byId("told").textContent = message.refused;
  }

  // Shows what the cameras see; pictures come a few times a second.
  function showPictures({time, cameras}) {
    const names = Object.keys(cameras), host = byId("cameras");
    host.hidden = false;
    if (host.children.length !== names.length) {
      host.replaceChildren(...names.map(() => {
        const figure = document.createElement("figure");
        figure.append(document.createElement("img"), document.createElement("figcaption"));
        figure.lastChild.className = "soft";
        return figure;
      }));
    }
    names.forEach((name, i) => {
      const [picture, caption] = host.children[i].children;
      picture.src = `data:image/jpeg;base64,${cameras[name]}`;
      picture.alt = `picture of ${name}`;
      caption.textContent = `${name}, ${time.toFixed(1)} s`;
    });
    host.dataset.pictures = Number(host.dataset.pictures ?? 0) + 1;
  }

  function createPlot(title) {
    const part = document.createElement("div"), heading = document.createElement("h3"), plot = document.createElement("div");
    heading.textContent = title;
    plot.className = "plot";
    plot.style.height = "280px";
    part.append(heading, plot);
    seen.observe(part);
    return part;
  }

  // Draws those plots that are seen; the server sends no others, since drawing takes long.
  function drawPlots(figures) {
    const before = parts, left = [...parts];
    parts = figures.map(({title}) => {
      const k = left.findIndex(part => titleOf(part) === title);
      return k < 0 ? createPlot(title) : left.splice(k, 1)[0];
    });
    for (const part of left) part.remove();
    if (left.length || parts.some((part, i) => part !== before[i])) arrange();
    figures.forEach(({figure}, i) => { if (figure) page.draw(parts[i].lastChild, JSON.parse(figure)); });
  }

  const titleOf = part => part.firstChild.textContent;

  // Puts the wanted plot beside the scene where the page has a place for it, and the others below.
  function arrange() {
    const near = beside ? parts.find(part => titleOf(part) === wanted) ?? parts[0] : undefined;
    parts.filter(part => part !== near).forEach((part, i) => {
      delete part.lastChild.dataset.brief;
      if (plots.children[i] !== part) plots.insertBefore(part, plots.children[i] ?? null);
    });
    if (beside) {
      if (near) near.lastChild.dataset.brief = "";
      if (near !== beside.firstChild) beside.replaceChildren(...near ? [near] : []);
      choice.replaceChildren(...parts.map(part => new Option(titleOf(part), undefined, false, part === near)));
      choice.closest("section").hidden = !near;
    }
    sendSeen();
  }

  const shown = new Set();
  const seen = new IntersectionObserver(entries => {
    for (const {target, isIntersecting} of entries) shown[isIntersecting ? "add" : "delete"](target);
    sendSeen();
  });

  function sendSeen() {
    send("see", [...shown].map(part => parts.indexOf(part)).filter(i => i >= 0));
  }

  function endRun({judged, success, reason, report, again}) {
    over = true;
    hints?.show(null);
    const verdict = byId("verdict");
    verdict.hidden = false;
    byId("waiting").hidden = byId("push-help").hidden = byId("task").hidden = true;
    progress.restart();
    verdict.className = `verdict ${success ? "good" : "bad"}`;
    verdict.innerHTML = "<b></b> ";
    verdict.firstChild.textContent = success ? "Succeeded:" : judged ? "Failed:" : "No verdict:";
    verdict.append(...page.typeset(`${reason}.`));
    if (api.session) {
      const button = Object.assign(document.createElement("button"), {type: "button", textContent: "again"});
      button.addEventListener("click", () => byId("again").click());
      verdict.append(" ", button);
    } else if (again) verdict.append(" ", ...page.typeset(`Again: \`${again}\`.`));
    byId("told").textContent = report ? `Its report: ${report}` : "The run has ended.";
    for (const id of ["pause", "step", "stop"]) byId(id).disabled = true;
    root.dataset.ended = success;
  }

  function chooseSignal(name) {
    if (!name || !api.run) return;
    const isThere = api.run.signals.includes(name);
    byId("told").textContent = isThere ? `The plot of ${name} is ${beside ? "beside the scene" : "the first one below"}.`
      : `There is no signal ${name}; those of the run are offered as one types.`;
    if (!isThere) return;
    wanted = name;
    byId("signal").value = "";
    if (chosen.includes(name)) return arrange();
    chosen.unshift(name);
    const chip = document.createElement("button");
    chip.type = "button";
    chip.textContent = `${name} \u00d7`;
    chip.addEventListener("click", () => {
      chosen.splice(chosen.indexOf(name), 1);
      chip.remove();
      send("choose", chosen);
    });
    byId("chosen").prepend(chip);
    send("choose", chosen);
  }

  byId("hand-side-view").addEventListener("change", ({target}) => { if (side) side.shown = target.checked; });
  byId("signal").addEventListener("change", ({target}) => chooseSignal(target.value));
  choice?.addEventListener("change", () => {
    wanted = choice.value;
    arrange();
  });
  byId("pause").addEventListener("click", () => send(paused ? "go" : "pause"));
  byId("step").addEventListener("click", () => send("step"));
  byId("stop").addEventListener("click", () => send("stop"));
  byId("pace").addEventListener("change", ({target}) => {
    send("pace", Number(target.value));
    if (lead) target.blur();  // keys are the hand's again
  });

  link = new WebSocket(`ws://${location.host}/run`);
  link.binaryType = "arraybuffer";
  link.addEventListener("message", ({data}) => {
    if (typeof data === "string") receive(JSON.parse(data));
    else {
      setPlaces(new Float64Array(data));
      root.dataset.frames = Number(root.dataset.frames ?? 0) + 1;
    }
  });
  // The server of a single run ends with it; that of a session goes on until somebody ends it.
  link.addEventListener("close", ({code, reason}) => {
    isLost = true;
    for (const act of listeners.lost ?? []) act();
    if (over && !api.session && code !== 1013) return;
    const [of, why] = api.session ? ["session", "its command has ended, and what its runs recorded is in their folders"]
      : ["run", "what serves this page has ended, and the run goes on without it"];
    const verdict = byId("verdict");
    verdict.hidden = false;
    verdict.className = "verdict bad";
    verdict.textContent = `The connection to the ${of} is lost: ${reason || why}.`;
    byId("waiting").hidden = byId("push-help").hidden = byId("task").hidden = true;
    progress.restart();
    byId("told").textContent = "";
    for (const entry of document.querySelectorAll(ASKING)) entry.disabled = true;  // nobody is there who would do it
  });
  return api;
})();
