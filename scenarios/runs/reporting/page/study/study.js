// The page of a study: shows the screens that the server's protocol tells, one after the other, and a round's run.
// Messages of both sides are in seat.py, the words of buttons in page_words.toml.
"use strict";
(() => {
  const root = document.querySelector(".study"), {words} = page.data(root);
  const byId = id => document.getElementById(id);
  const main = byId("screen");
  let shown = null, play = null, input = null, test = null, taskShownAt = 0, over = false, ready = false, drawn = [], hasTracker = false, held = [];
  let still = {pose: "", since: 0, isMentioned: false};  // since when the hand has been where it is, and whether the page says so
  let camera = null, cameraStatus = "", cameraFault = null;  // the webcam's, see hand_camera.js
  const STILL = 30000, SETTLING = 1200;  // ms until a hand counts as still; and until a rating is taken
  const INPUTS = {mouse: "pointer", touch: "pointer", gamepad: "gamepad"};  // the others send samples by themselves
  const TURNS = {"+roll": "roll_right", "-roll": "roll_left", "+pitch": "fingers_down", "-pitch": "fingers_up",
    "+yaw": "fingers_left", "-yaw": "fingers_right"};
  const KEYS = {"+roll": "E", "-roll": "Q", "+pitch": "W", "-pitch": "S", "+yaw": "A", "-yaw": "D"};  // see hand_input.js
  const hasKeys = () => device() !== "touch";
  const device = () => shown?.device ?? "";

  // A word of the page in the language of the study, else `otherwise`, with values in place of {names}.
  function word(name, values = {}, otherwise = name) {
    const ofLanguage = words[shown?.language] ?? Object.values(words)[0];
    return (ofLanguage[name] ?? otherwise).replace(/\{(\w+)\}/g, (_, key) => values[key] ?? "");
  }

  function node(name, attributes = {}, ...children) {
    const element = document.createElement(name);
    for (const [key, value] of Object.entries(attributes)) {
      if (key.startsWith("on")) element.addEventListener(key.slice(2), value);
      else if (key in element && typeof value === "boolean") element[key] = value;
      else element.setAttribute(key, value);
    }
    element.append(...children);
    return element;
  }
  const paragraphs = text => text.trim().split(/\n\s*\n/).map(part => node("p", {}, part.replace(/\s*\n\s*/g, " ")));

  const link = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}${location.pathname}seat`);
  link.binaryType = "arraybuffer";
  const send = message => link.readyState === WebSocket.OPEN && link.send(JSON.stringify(message));
  const act = (action, value = null) => send({act: {action, value}});

  function button(name, action, {first = false, values = {}} = {}) {
    const element = node("button", {type: "button", ...(first ? {class: "first"} : {})}, word(name, values));
    element.addEventListener("click", once(action));
    return element;
  }
  // What a screen asks for is done once: its buttons wait for the next screen, or for the refusal.
  const once = action => () => {
    held = [...main.querySelectorAll("button:enabled")];
    held.forEach(b => { b.disabled = true; });
    action();
  };
  function release() {
    held.forEach(b => { b.disabled = false; });
    held = [];
  }
  const actions = (...buttons) => node("div", {class: "actions"}, ...buttons);

  const screens = {
    who: s => [node("h1", {}, word("who")), node("p", {}, word("who_help")), actions(
      ...s.unfinished.map(of => button("continue_session", () => act("continue", of.number), {values: of})),
      ...(s.new ? [button("new_participant", () => act("new"), {values: {participant: s.new}})] : []))],
    language: s => [node("h1", {}, word("choose_language")), node("div", {class: "study-choices"},
      ...Object.entries(s.languages).map(([name, text]) => node("button",
        {type: "button", class: "study-choice", lang: name, onclick: once(() => act("language", name))}, text)))],
    consent: s => [node("h1", {}, word("welcome")), ...paragraphs(s.welcome), node("h2", {}, word("consent")),
      ...paragraphs(s.consent),
      actions(button("agree", () => act("consent", true), {first: true}), button("disagree", () => act("consent", false)))],
    eligibility(s) {
      const boxes = s.eligibility.map(text => node("label", {class: "study-check"},
        node("input", {type: "checkbox"}), node("span", {}, text)));
      const ticked = () => boxes.map(box => box.firstChild.checked);
      const all = button("eligibility_all", () => act("eligibility", ticked()), {first: true});
      const allow = () => { all.disabled = !ticked().every(Boolean); };
      boxes.forEach(box => box.addEventListener("change", allow));
      allow();
      const none = button("eligibility_not", () => act("eligibility", boxes.map(() => false)));
      return [node("h1", {}, word("eligibility")), ...boxes, actions(all, none)];
    },
    declined: () => [node("h1", {}, word("declined_title")), node("p", {}, word("declined")),
      actions(button("next_participant", () => act("next")))],
    device: s => [node("h1", {}, word("device")), node("div", {class: "study-choices"},
      ...Object.keys(s.devices).map(name => node("button", {type: "button", class: "study-choice", "data-device": name,
        onclick: once(() => act("device", {device: name, settings: settings()}))},
        node("b", {}, word(`device_${name}`)), node("span", {}, word(`help_${name}`)))))],
    practice: s => [node("h1", {}, word("practice")), ...paragraphs(s.practice),
      ...(s.reason ? [node("p", {}, word("practice_again", {reason: reasonOf(s)}))] : []),
      node("p", {}, word(`help_${device()}`)),
      node("p", {}, s.seconds < 90 ? word("practice_seconds", {seconds: Math.round(s.seconds)})
        : word("practice_for", {minutes: Number((s.seconds / 60).toFixed(1)).toLocaleString(s.language)})), ...deviceLines(),
      actions(button("begin", () => act("begin"), {first: true}), button("other_device", () => act("other_device")))],
    instruction: s => [...(s.practice_over ? [node("p", {class: "soft"}, word("practice_over"))] : []),
      node("h1", {}, s.name), ...paragraphs(s.instruction), node("p", {class: "soft"}, word(`help_${device()}`)), ...deviceLines(),
      actions(button("begin", () => act("begin"), {first: true}))],
    practising: s => [node("h1", {}, word("practice")), ...paragraphs(s.practice), ...waiting()],
    round: s => [node("h1", {}, s.name), ...paragraphs(s.instruction), ...waiting()],
    void: s => [node("h1", {}, word("void")), node("p", {}, word(s.again ? "void_again" : "void_on", {reason: reasonOf(s)})),
      actions(button("next", () => act("next"), {first: true}))],
    rating,
    questions,
    thanks: s => [node("h1", {}, word("thanks")), ...paragraphs(s.thanks),
      actions(button("next_participant", () => act("next")))],
    withdrawn: s => [node("h1", {}, word("thanks")), node("p", {}, word("withdrawn", s)),
      actions(button("next_participant", () => act("next")))],
    complete: () => [node("h1", {}, word("thanks")), node("p", {}, word("complete"))],
  };
  // Why what was played does not count, in the language of the study where it has words for it.
  const reasonOf = s => s.cause ? word(`void_${s.cause}`) : s.reason;

  // A tracker connects by itself: before it is there, nothing begins.
  const trackerLine = () => device() === "tracker" ? [node("p", {id: "tracker", role: "status"})] : [];
  function showTrackerStatus() {
    const line = byId("tracker");
    if (!line) return;
    const address = `${location.protocol === "https:" ? "wss" : "ws"}://${location.host}${location.pathname}hand`;
    line.textContent = word(hasTracker ? "tracker_there" : "tracker_missing", {address});
    main.querySelectorAll("button.first").forEach(b => { b.disabled = !hasTracker; });
  }

  // The webcam is on from the practice to the last round; it leads the hand while a run goes on.
  const WATCHED = new Set(["practice", "practising", "instruction", "round", "void", "rating"]);
  const NOWHERE = {p_WH: [0, 0, 0], closed: false, centre: [0, 0, 0], radius: 1};
  function updateCamera() {
    const isWanted = device() === "webcam" && WATCHED.has(shown.screen);
    if (isWanted && !camera) startCamera();
    else if (!isWanted) stopCamera();
  }
  function startCamera() {
    stopCamera();
    if (!byId("video")) return onCameraStatus("fails", {name: "not_offered"});
    byId("video").setAttribute("aria-label", word("camera_mirror"));
    const axes = () => input?.axes() ?? null;
    camera = handCamera({video: byId("video"), axes, start: NOWHERE, right: true, onSample: lead, onStatus: onCameraStatus});
  }
  function stopCamera() {
    camera?.end();
    camera = null;
  }
  function onCameraStatus(status, fault = null) {
    [cameraStatus, cameraFault] = [status, fault];
    showCameraStatus();
    if (status === "sees") letGo();
  }
  function showCameraStatus() {
    if (device() !== "webcam") return;
    const why = cameraFault && word(`camera_${cameraFault.name}`, cameraFault, cameraFault.text);
    const text = word(`camera_${cameraStatus}`, {why}), isReady = ["seeks", "sees"].includes(cameraStatus);
    byId("help").textContent = cameraStatus === "sees" ? word("help_webcam") : text;
    const line = byId("camera");
    if (!line) return;
    line.textContent = text;
    byId("camera-again").hidden = cameraStatus !== "fails";
    main.querySelectorAll("button.first").forEach(b => { b.disabled = !isReady; });
  }
  const cameraLines = () => device() !== "webcam" ? [] : [node("p", {id: "camera", role: "status"}),
    node("button", {type: "button", id: "camera-again", hidden: true, onclick: startCamera}, word("camera_again"))];
  const deviceLines = () => [...trackerLine(), ...cameraLines()];
  const showDeviceStatus = () => { showTrackerStatus(); showCameraStatus(); };
  const waiting = () => [node("p", {class: "study-wait"}, node("span", {}, word("getting_ready")))];
  const settings = () => ({width: innerWidth, height: innerHeight, pixel_ratio: devicePixelRatio});

  function rating(s) {
    const {lowest, highest} = s.scale;
    const steps = Array.from({length: highest - lowest + 1}, (_, i) => lowest + i);
    const sets = Object.entries(s.statements).map(([name, text]) => node("fieldset", {class: "study-rating", "data-name": name},
      node("legend", {}, text),
      node("div", {class: "scale", style: `--steps: ${steps.length}`}, ...steps.map(step => node("label", {},
        node("input", {type: "radio", name, value: step}), String(step)))),
      node("p", {class: "ends"}, node("span", {}, `${lowest}: ${s.scale.low}`), node("span", {}, `${highest}: ${s.scale.high}`))));
    const value = set => Number(set.querySelector(":checked")?.value ?? NaN);
    const done = button("send", () => act("rate", Object.fromEntries(sets.map(set => [set.dataset.name, value(set)]))),
      {first: true});
    const allow = () => { done.disabled = !sets.every(set => Number.isFinite(value(set))); };
    sets.forEach(set => set.addEventListener("change", allow));
    allow();
    sets.forEach(set => { set.disabled = true; });  // lest a click or a key that was meant for the hand rates
    setTimeout(() => sets.forEach(set => { set.disabled = false; }), SETTLING);
    keys = event => {
      const set = sets.find(of => !Number.isFinite(value(of)));
      const box = set?.querySelector(`input[value="${event.key}"]`);
      if (!box || set.disabled || event.target.closest?.("textarea")) return;
      box.checked = true;
      box.focus();
      allow();
      if (!done.disabled) done.focus();
    };
    return [node("h1", {}, word("rating")),
      node("p", {}, [word("round_over"), word("rate_all", s.scale), ...(hasKeys() ? [word("rate_keys", s.scale)] : [])].join(" ")),
      ...sets, actions(done)];
  }

  function questions(s) {
    const asked = s.questions.map(({name, text, choices}) => choices.length
      ? node("fieldset", {class: "study-question", "data-name": name}, node("legend", {}, text),
        ...choices.map(c => node("label", {class: "option"}, node("input", {type: "radio", name, value: c.value}), c.text)))
      : node("div", {class: "study-question", "data-name": name}, node("label", {for: `q-${name}`}, text),
        node("textarea", {id: `q-${name}`, maxlength: 5000})));
    const answer = of => of.querySelector(":checked")?.value ?? of.querySelector("textarea")?.value ?? "";
    return [node("h1", {}, word("questions")), node("p", {class: "soft"}, word("no_answer")), ...asked, actions(
      button("send", () => act("answer", Object.fromEntries(asked.map(of => [of.dataset.name, answer(of)]))), {first: true}))];
  }

  let keys = null;
  addEventListener("keydown", event => {
    if (!event.ctrlKey && !event.metaKey && !event.altKey) keys?.(event);
  });

  function show(screen) {
    shown = screen;
    keys = null;
    held = [];
    document.documentElement.lang = screen.language;
    document.title = screen.title;
    showMessage("");
    const playing = screen.screen === "round" || screen.screen === "practising";
    if (!playing) endPlay();
    byId("who").textContent = screen.participant ? word("participant", screen) : "";
    byId("progress").textContent = screen.round ? word("round", screen) : "";
    const sits = Boolean(screen.participant) && !["thanks", "withdrawn", "complete"].includes(screen.screen);
    byId("withdraw").hidden = !sits;
    byId("withdraw").textContent = word("withdraw");
    main.replaceChildren(...screens[screen.screen](screen));
    main.hidden = false;
    updateCamera();
    showDeviceStatus();
    root.dataset.screen = screen.screen;
    main.focus({preventScroll: true});
    scrollTo(0, 0);
  }
  // Asked in the page: a question of the browser's own would stop the samples of the hand until it is answered.
  byId("withdraw").addEventListener("click", () => {
    byId("sure-text").textContent = word("withdraw_sure");
    byId("sure-yes").textContent = word("withdraw");
    byId("sure-no").textContent = word("withdraw_not");
    byId("sure").showModal();
  });
  byId("sure-no").addEventListener("click", () => byId("sure").close());
  byId("sure-yes").addEventListener("click", () => {
    byId("sure").close();
    act("withdraw");
    showMessage(word("one_moment"));  // a run that is under way takes a second or two to end
  });

  function showMessage(text) {
    byId("told").textContent = text;
    byId("told").hidden = !text;
  }

  // Draws the run's first state, leads the hand from now on, and then lets the run go.
  function beginPlay(content, start) {
    endPlay();
    main.hidden = true;
    byId("play").hidden = false;
    play = studyScene(content, {eye: byId("eye"), side: byId("side"), photodiode: byId("photodiode"), onDrawn: recordLatency});
    if (!play) {
      showMessage(word("no_webgl"));
      return;
    }
    play.sideShown = wantsSide();
    showViewsButton();
    byId("help").textContent = word(`help_${device()}`);
    camera?.restart(start);
    showCameraStatus();
    byId("task").textContent = shown.name ?? word("free_play");
    for (const id of ["eye", "side"]) byId(id).setAttribute("aria-label", word(id === "eye" ? "view_eye" : "view_side"));
    const onChange = closed => { byId("grasp").textContent = word(closed ? "open_hand" : "close_hand"); };
    byId("grasp").hidden = device() !== "touch";
    onChange(start.closed);
    input = handInput({element: byId("pad"), camera: play.scene.camera, start, onSample: lead, onChange});
    input.choose(INPUTS[device()] ?? "nothing");
    byId("pad").focus({preventScroll: true});
    keys = event => { if (event.key === "v" || event.key === "V") turnViews(); };
    ready = false;
    requestAnimationFrame(() => requestAnimationFrame(() => {
      ready = true;
      letGo();
    }));
  }
  function lead(hand) {
    if (link.bufferedAmount < 4000) send({hand});
    const pose = JSON.stringify([hand.p_WH, hand.closed]), now = performance.now();
    if (pose !== still.pose) {
      if (still.isMentioned) showMessage("");
      still = {pose, since: now, isMentioned: false};
    } else if (!still.isMentioned && now - still.since > STILL) {
      still.isMentioned = true;
      showMessage(word(shown.screen === "practising" ? "hand_still_practice" : "hand_still"));
    }
  }

  // A run begins when its scene has been drawn and, with a webcam, a hand is seen: until then nothing would lead it.
  function letGo() {
    if (!ready || (device() === "webcam" && cameraStatus !== "sees")) return;
    ready = false;
    still.since = performance.now();
    send({ready: true});
  }

  function endPlay() {
    ready = false;
    sendLatencies();
    input?.end();
    play?.dispose();
    input = play = null;
    byId("play").hidden = true;
  }
  const wantsSide = () => (sessionStorage.getItem("views") ?? "2") === "2";
  function turnViews() {
    sessionStorage.setItem("views", wantsSide() ? "1" : "2");
    if (play) play.sideShown = wantsSide();
    showViewsButton();
  }
  const showViewsButton = () => {
    byId("views").textContent = word(wantsSide() ? "one_view" : "two_views") + (hasKeys() ? " (V)" : "");
  };
  byId("grasp").addEventListener("click", () => input?.grasp(!input.pose().closed));
  byId("views").addEventListener("click", () => { turnViews(); byId("pad").focus({preventScroll: true}); });

  // Times from samples to pictures, which the server keeps with the round while it lasts: those of its last pictures are lost.
  function recordLatency(ms) {
    drawn.push(Math.round(100 * Math.max(0, ms)) / 100);
    root.dataset.drawn = Number(root.dataset.drawn ?? 0) + 1;
    if (drawn.length >= 5) sendLatencies();
  }
  function sendLatencies() {
    if (drawn.length) send({drawn});
    drawn = [];
  }

  function showTarget(asked) {
    test = asked;
    play?.target(test.place);
    showTask();
  }

  // What is asked for; of a place also how far the hand still is from it, since one hides the other.
  function showTask() {
    taskShownAt = performance.now();
    const name = test.place ? "place_to_go" : TURNS[test.name] ?? (test.name ? "make_fist" : "free_play");
    const at = play?.hand().p_WH ?? [];
    const far = test.place && at.length ? Math.hypot(...at.map((x, i) => x - test.place[i])) : NaN;
    const texts = [word(name, test)];
    if (Number.isFinite(far)) texts.push(word("still_away", {distance: Math.round(100 * far)}));
    if (KEYS[test.name] && device() === "mouse") texts.push(word("by_key", {key: KEYS[test.name]}));
    byId("task").textContent = texts.join(" ");
  }

  link.addEventListener("message", ({data}) => {
    if (typeof data !== "string") {
      play?.take(data);
      if (test?.place && shown.screen === "practising" && performance.now() - taskShownAt > 200) showTask();
      return;
    }
    const message = JSON.parse(data);
    if (message.screen) show(message.screen);
    else if (message.scene) beginPlay(message.scene, message.hand);
    else if (message.target) showTarget(message.target);
    else if (message.again) byId("task").textContent = word("object_comes_back");
    else if ("tracker" in message) {
      hasTracker = message.tracker;
      showTrackerStatus();
    } else if (message.wait) showMessage(word(message.wait));
    else if (message.refused) {
      showMessage(message.refused);
      release();
      showDeviceStatus();
    }
    else if (message.gone) {
      over = true;
      endPlay();
      stopCamera();
      main.replaceChildren(node("h1", {}, word("not_here")), node("p", {}, word(message.gone)),
        actions(button("reload", () => location.reload(), {first: true})));
      main.hidden = false;
      root.dataset.screen = message.gone;
    }
  });
  setInterval(() => device() === "tracker" && send({clock: performance.now() / 1000}), 500);
  link.addEventListener("close", ({reason}) => {
    stopCamera();
    if (over) return;
    root.querySelectorAll("button").forEach(b => { b.disabled = true; });  // nobody is there who would do it
    showMessage(word("lost_connection") + (reason && ` (${reason})`));
  });
  window.study = {send, get play() { return play; }, get screen() { return shown?.screen; }};
})();
