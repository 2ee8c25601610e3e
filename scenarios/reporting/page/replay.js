// Plays a run in space. Traces, their look and their motion come from replay_section.py, colours of the axes from page.js.
"use strict";
const VIEW = Math.PI / 4, ROOM = 0.92;  // angle of Plotly's view from top to bottom, and the share of it for the box
for (const replay of document.querySelectorAll(".replay")) {
  const scene = replay.querySelector(".replay-scene");
  const [play, slider, told, speed, reset, wake] = ["play", "time", "told", "speed", "reset", "wake"]
    .map(name => replay.querySelector(".replay-" + name));
  const run = page.data(replay);
  const time = page.array(run.time);
  for (const trace of run.traces) {
    if (trace.points) trace.points = page.array(trace.points);
    for (const part of trace.parts ?? [])
      for (const key of ["points", "vertices", "triangles", "p", "q"]) if (part[key]) part[key] = page.array(part[key]);
  }
  const moving = run.traces.map((_, i) => i).filter(i => replayShapes.moves(run.traces[i]));
  const last = time.length - 1;
  let u = 0;            // frames after the first
  let drawing = false;  // Plotly is at it
  let wanted = false;   // and is to draw again
  let playing = 0;      // the request of the next picture
  let held = 0;         // the view is being turned or zoomed until this is called off

  const hasWebGl = () => {
    const canvas = document.createElement("canvas");
    return Boolean(canvas.getContext("webgl2") ?? canvas.getContext("webgl"));
  };

  function look(trace) {
    const shared = {name: trace.label, opacity: trace.opacity, hoverinfo: "skip", showlegend: false};
    const {x, y, z} = replayShapes.places(trace, u, run.low);
    if (!trace.parts) {
      const mode = trace.n === 1 && !trace.trail ? "markers" : trace.markers ? "lines+markers" : "lines";
      return {...shared, type: "scatter3d", mode, x, y, z, line: {color: trace.colour, width: trace.width},
        marker: {color: trace.colour, size: mode === "markers" ? trace.width : 1.2 * trace.width, line: {width: 0}}};
    }
    const corners = [[], [], []];
    let first = 0;
    for (const part of trace.parts) {
      replayShapes.triangles(part).forEach((vertex, at) => corners[at % 3].push(first + vertex));
      first += replayShapes.count(part);
    }
    const [i, j, k] = corners;
    return {...shared, type: "mesh3d", x, y, z, i, j, k, color: trace.colour,
      lighting: {ambient: 0.6, diffuse: 0.65, specular: 0.12, roughness: 0.7, fresnel: 0.05},
      lightposition: {x: -2000, y: -3000, z: 6000}};
  }

  // Equal scales: the sides of the box are to each other as in space.
  const sides = run.high.map((high, i) => high - run.low[i]);
  const scale = Math.sqrt(3) / Math.hypot(...sides);
  const xyz = values => ({x: values[0], y: values[1], z: values[2]});

  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const cross = (a, b) => [0, 1, 2].map(i => a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3]);
  const unit = a => a.map(x => x / Math.hypot(...a));

  // Looks from the side of `run.eye`, from where the whole box is just seen, with the names of its axes.
  function camera() {
    const back = unit(run.eye), up = Math.hypot(back[0], back[1]) < 0.1 ? [0, 1, 0] : [0, 0, 1];
    const right = unit(cross(up, back)), over = cross(back, right);
    const corners = [0, 1, 2, 3, 4, 5, 6, 7].map(n => sides.map((side, i) => ((n >> i & 1) - 0.5) * side * scale));
    // Along one side of the picture: where the middle is, and how far the eye has to be.
    const fit = (along, slope) => {
      const least = Math.min(...corners.map(c => dot(along, c) - slope * dot(back, c)));
      const most = Math.max(...corners.map(c => dot(along, c) + slope * dot(back, c)));
      return [(least + most) / 2, (most - least) / (2 * slope)];
    };
    const high = ROOM * Math.tan(VIEW / 2);
    const [x, far] = fit(right, high * scene.clientWidth / scene.clientHeight), [y, farther] = fit(over, high);
    const center = [0, 1, 2].map(i => x * right[i] + y * over[i]), away = Math.max(far, farther);
    return {eye: xyz(center.map((c, i) => c + away * back[i])), center: xyz(center), up: xyz(up)};
  }

  function layout() {
    const c = page.colours();
    const most = 5 * Math.min(1, scene.clientWidth / 600) / Math.max(...sides);
    const axis = i => ({
      title: {text: "xyz"[i] + " (m)", font: {size: 12}}, range: [run.low[i], run.high[i]], autorange: false,
      nticks: Math.max(2, Math.round(most * sides[i])), gridcolor: c.line, zerolinecolor: c.line, linecolor: c.soft,
      tickfont: {size: 11, color: c.soft}, color: c.soft, showbackground: false, showspikes: false,
    });
    return {
      paper_bgcolor: "rgba(0,0,0,0)", font: {color: c.ink, family: "system-ui, sans-serif"}, autosize: true,
      margin: {l: 0, r: 0, t: 0, b: 0}, showlegend: false, uirevision: "kept",
      scene: {
        xaxis: axis(0), yaxis: axis(1), zaxis: axis(2), camera: camera(), dragmode: "turntable", hovermode: false,
        aspectmode: "manual", aspectratio: xyz(sides.map(side => side * scale)),
      },
    };
  }

  function frameAt(t) {
    let low = 0, high = last;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (time[middle] <= t) low = middle; else high = middle;
    }
    return last ? Math.min(last, low + (t - time[low]) / (time[high] - time[low])) : 0;
  }

  function timeAt(frame) {
    const k = Math.min(Math.floor(frame), last), f = frame - k;
    return f ? time[k] + f * (time[k + 1] - time[k]) : time[k];
  }

  function tell() {
    const t = timeAt(u);
    const phase = run.phases.filter(([begin]) => begin <= t + 1e-6).at(-1)?.[1];
    told.value = `${t.toFixed(1)} s${phase ? ", " + phase : ""}`;
    slider.setAttribute("aria-valuetext", told.value);
  }

  async function show() {
    tell();
    wanted = drawing || held;
    if (wanted || !moving.length) return;
    drawing = true;
    do {
      wanted = false;
      const places = moving.map(i => replayShapes.places(run.traces[i], u, run.low));
      const axis = k => places.map(p => p[k]);
      await Plotly.restyle(scene, {x: axis("x"), y: axis("y"), z: axis("z")}, moving);
    } while (wanted && !held);
    drawing = false;
    scene.dataset.frame = u;
  }

  function stop() {
    cancelAnimationFrame(playing);
    playing = 0;
    play.textContent = "\u25b6\ufe0e";
    play.setAttribute("aria-label", "play");
  }

  function start() {
    if (u >= last) u = 0;
    play.textContent = "\u275a\u275a";
    play.setAttribute("aria-label", "pause");
    let before = null;
    const step = now => {
      const passed = before === null ? 0 : (now - before) / 1000 * Number(speed.value);
      before = now;
      u = frameAt(timeAt(u) + passed);
      slider.value = Math.round(u);
      show();
      if (u >= last) stop();
      else playing = requestAnimationFrame(step);
    };
    playing = requestAnimationFrame(step);
  }

  // With each picture Plotly sets its camera upright anew, which takes half a second in which it hears no mouse; that
  // it is upright once is enough. (plotly.js has no public name for this.)
  function hear() {
    const space = scene._fullLayout.scene._scene, setMode = space.updateFx;
    space.updateFx = (mode, hover) => { if (space.camera.mode !== mode) setMode.call(space, mode, hover); };
  }

  // Each picture puts the view where Plotly last saved it, which is at the end of a turn: time goes on, pictures wait.
  function follow() {
    const hold = () => { clearTimeout(held); held = Infinity; };
    const release = () => {
      clearTimeout(held);
      held = setTimeout(() => { held = 0; if (wanted) show(); }, 150);
    };
    scene.addEventListener("pointerdown", hold, true);
    scene.addEventListener("wheel", release, true);
    for (const end of ["pointerup", "pointercancel"])
      document.addEventListener(end, () => { if (held === Infinity) release(); }, true);
    scene.on("plotly_relayouting", change => {
      if (change["scene.camera"]) scene.layout.scene.camera = change["scene.camera"];
    });
  }

  // A page scrolls over the scene until the scene is touched.
  function guard() {
    wake.addEventListener("click", () => replay.classList.add("awake"));
    scene.addEventListener("pointerdown", () => replay.classList.add("awake"));
    scene.addEventListener("wheel", event => {
      if (!replay.classList.contains("awake")) event.stopImmediatePropagation();
    }, true);
    document.addEventListener("pointerdown", event => {
      if (!replay.contains(event.target)) replay.classList.remove("awake");
    });
  }

  function toggle(button) {
    const shown = button.getAttribute("aria-pressed") !== "true";
    button.setAttribute("aria-pressed", shown);
    const which = run.traces.map((_, i) => i).filter(i => run.traces[i].label === button.dataset.label);
    Plotly.restyle(scene, {visible: shown}, which);
  }

  async function draw() {
    await Plotly.newPlot(scene, run.traces.map(look), layout(),
      {displayModeBar: false, responsive: true, scrollZoom: true, doubleClick: false});
    hear();
    follow();
    guard();
    tell();
    play.addEventListener("click", () => playing ? stop() : start());
    slider.addEventListener("input", () => { stop(); u = Number(slider.value); show(); });
    reset.addEventListener("click", () => Plotly.relayout(scene, {"scene.camera": camera()}));
    for (const button of replay.querySelectorAll(".replay-legend button"))
      button.addEventListener("click", () => toggle(button));
    page.onColours(() => {
      const {scene: {xaxis, yaxis, zaxis}, font} = layout();
      Plotly.relayout(scene, {font, "scene.xaxis": xaxis, "scene.yaxis": yaxis, "scene.zaxis": zaxis});
    });
    scene.dataset.frame = 0;
  }

  if (hasWebGl()) draw();
  else {
    replay.querySelector(".replay-missing").hidden = false;
    replay.querySelector(".replay-shown").hidden = true;
  }
}
