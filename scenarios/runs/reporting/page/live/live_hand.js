// Lets the page lead the hand of a run under way; hand_messages.py says what is sent.
//   const lead = createHandControl(element, eye)   eye: three.js's camera
//   lead.hand      see handInput; null until the server has told where the hand is
//   lead.close()   leads it no more
//   sidesOfHandover(scene)       labels of what a view from the side shows before the other
"use strict";
const sidesOfHandover = scene => scene.points("gripper").length ? ["gripper", "robot"] : ["hand", "object"];

const createHandControl = (element, eye) => {
  const part = name => document.getElementById("hand-" + name);
  const HELP = {
    pointer: "The hand is where the mouse is. The wheel turned down brings it towards you, turned up takes it away; a click, or the space bar, closes and opens it. Q and E "
      + "roll it, W and S tilt its fingers down and up, A and D turn them left and right; arrows move it. A finger takes it along, two fingers change its depth. With Alt, you turn the view instead.",
    gamepad: "The left stick moves the hand, the triggers towards you and away, the right stick turns it, the first button closes and opens it.",
    tracker: `A tracker sends texts such as {"p_WH": [-0.4, 0.1, -0.05], "q_WH": [1, 0, 0, 0], "closed": false, "stamp": 12.5} to `
      + `ws://${location.host}/hand: m in the world, a quaternion with its scalar first, s.`,
    webcam: "Move your hand before the camera as if it were in the scene: palm, fist and depth are taken from its pictures, which stay in this "
      + "page. Where the hand is first seen, it goes on from where it stands; take it out of the picture for a moment to begin elsewhere.",
    nothing: "Nothing leads the hand: it stops, and keeps what it holds.",
  };
  const CAMERA_STATUS = {
    asks: () => "The browser asks whether the camera may be used.",
    loads: () => "MediaPipe's files are loaded.",
    seeks: () => "Show your hand to the camera: until it sees one, the hand stops.",
    sees: () => "The camera sees the hand.",
    fails: fault => `The webcam cannot lead the hand: ${fault.text}. Another device may be chosen.`,
  };
  const lead = {hand: null, close}, closed = new AbortController();
  let link = null, timer = 0, camera = null, cameraStatus = "";

  // Shows for a while what was refused, then again the camera's status, where it leads the hand.
  function showMessage(text) {
    part("told").value = text;
    clearTimeout(timer);
    timer = setTimeout(() => { part("told").value = cameraStatus; }, 4000);
  }
  function showCameraStatus(text) {
    part("told").value = cameraStatus = text;
    clearTimeout(timer);
  }

  function connect() {
    const ours = link = new WebSocket(`ws://${location.host}/hand`);
    ours.addEventListener("message", ({data}) => {
      const message = JSON.parse(data);
      if (message.refused) showMessage(`not taken: ${message.refused}`);
      if (message.hand) begin(message.hand);
    });
    ours.addEventListener("close", ({code, reason}) => {
      if (code === 1009) showMessage(`the connection has ended: ${reason}`);  // a message that is too long
      lead.hand?.choose("nothing");
      if (link !== ours) return;
      stopCamera();
      part("grasp").disabled = true;
    });
  }

  function begin(start) {
    lead.hand?.end();
    lead.hand = handInput({element, camera: eye, start, onSample: send, onChange: showGrasp});
    use(part("device").value);
    part("grasp").disabled = false;
    showGrasp(start.closed);
  }

  function use(device) {
    stopCamera();
    lead.hand?.choose(device);
    if (device === "webcam" && lead.hand) startCamera();
  }

  // The webcam's samples go the way of others', and are where the hand is for the device after it.
  function startCamera() {
    const onSample = sample => {
      lead.hand.place(sample);
      send(sample);
    };
    const start = {...lead.hand.start, ...lead.hand.pose()}, right = part("side").value === "right";
    const onStatus = (status, fault) => showCameraStatus(CAMERA_STATUS[status](fault));
    camera = handCamera({video: part("video"), axes: lead.hand.axes, start, right, onSample, onStatus});
  }
  function stopCamera() {
    camera?.end();
    camera = null;
    if (cameraStatus) showCameraStatus("");
  }

  const send = sample => link?.readyState === WebSocket.OPEN && link.bufferedAmount < 4000 && link.send(JSON.stringify(sample));

  function showGrasp(closed) {
    part("grasp").setAttribute("aria-pressed", closed);
    part("grasp").textContent = closed ? "open the hand" : "close the hand";
  }

  // A tracker needs the seat, which one device has at a time.
  function choose() {
    const device = part("device").value;
    part("help").textContent = HELP[device];
    part("grasp").hidden = device !== "pointer";
    if (part("which")) part("which").hidden = device !== "webcam";
    element.closest(".replay").classList.toggle("awake", device === "pointer");  // the wheel is the hand's, not the page's
    if (device === "tracker") {
      stopCamera();
      const leaves = link;
      link = null;
      leaves?.close();
    } else if (!link || link.readyState > WebSocket.OPEN) connect();
    else use(device);
  }

  function close() {
    closed.abort();
    stopCamera();
    lead.hand?.end();
    link?.close();
  }

  part("device").addEventListener("change", () => {
    part("device").blur();  // keys are the hand's again
    choose();
  }, {signal: closed.signal});
  part("side")?.addEventListener("change", choose, {signal: closed.signal});
  part("grasp").addEventListener("click", () => lead.hand?.grasp(!lead.hand.pose().closed), {signal: closed.signal});
  choose();
  return lead;
};
