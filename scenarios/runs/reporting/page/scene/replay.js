// Plays a run in space: time, phase, speed. The scene with its views and legend is viewport.js's; traces come from replay_section.py.
// The page's plots over time share its cursor (page.onTime).
"use strict";
const replays = [];  // {element, scene} of each, for who looks from outside
for (const replay of document.querySelectorAll(".replay")) {
  const element = replay.querySelector(".replay-scene");
  const [play, slider, readout, speed] = ["play", "time", "told", "speed"]
    .map(name => replay.querySelector(".replay-" + name));
  const run = page.data(replay);
  const time = page.array(run.time);
  replayShapes.unpack(run);
  const last = time.length - 1;
  let scene = null;
  let u = 0;            // frames after the first
  let playing = 0;      // the request of the next frame of the animation
  let recorder = null;  // of a video, which lasts as long as it plays

  function timeAt(frame) {
    const k = Math.min(Math.floor(frame), last), f = frame - k;
    return f ? time[k] + f * (time[k + 1] - time[k]) : time[k];
  }

  function show() {
    const t = timeAt(u);
    readout.value = replayShapes.timeText(run, t);
    slider.value = Math.round(u);
    slider.setAttribute("aria-valuetext", readout.value);
    scene.show(u);
    element.dataset.frame = u;
    page.setTime(t, replay);
  }

  function stop() {
    cancelAnimationFrame(playing);
    playing = 0;
    play.textContent = "\u25b6\ufe0e";
    play.setAttribute("aria-label", "play");
    recorder?.stop();
  }

  function start() {
    if (u >= last) u = 0;
    play.textContent = "\u275a\u275a";
    play.setAttribute("aria-label", "pause");
    let before = null;
    const step = now => {
      const passed = before === null ? 0 : (now - before) / 1000 * Number(speed.value);
      before = now;
      u = replayShapes.frameAt(time, timeAt(u) + passed);
      show();
      if (u >= last) stop();
      else playing = requestAnimationFrame(step);
    };
    playing = requestAnimationFrame(step);
  }

  const viewport = createViewport(replay, run);
  if (!viewport) continue;
  scene = viewport.scene;
  viewport.onFollow = show;
  recorder = createRecorder(viewport, () => readout.value, {
    begin() {
      cancelAnimationFrame(playing);
      u = 0;
      show();
      start();
    },
    end: stop,
  });
  replays.push(viewport);
  play.addEventListener("click", () => playing ? stop() : start());
  slider.addEventListener("input", () => { stop(); u = Number(slider.value); show(); });
  page.onTime((t, from) => {
    if (from === replay) return;
    stop();
    u = replayShapes.frameAt(time, t);
    show();
  });
  show();
}
