// Leads a hand by a webcam; pictures go to a thread of this page and nowhere else, and none is kept.
//   const camera = handCamera({video, axes, start, right, onSample, onStatus})
//     video        the element that shows what the camera sees
//     axes         returns the directions of the view in W: to its right, up, towards the eye; null while nothing is led
//     start        {p_WH, closed, centre, radius}, see handInput
//     right        whether the right hand is to be seen
//     onSample     is called with a sample for each picture with a hand; where none is seen, the sample before ages
//     onStatus     is called with the status: "asks" for the camera, "loads" MediaPipe, "seeks" a hand, "sees" one, or
//                  "fails", and then with the fault: its name, one of FAULT_TEXTS, the detail that is known besides, and its
//                  text in English; a page in other languages has translations by the name
//   camera.restart(start)    leads another hand from now on
//   camera.end()             lets go of the camera
"use strict";
const handCamera = ({video, axes, start, right, onSample, onStatus}) => {
  const FAULTS = {NotAllowedError: "refused", NotFoundError: "absent", NotReadableError: "busy", OverconstrainedError: "unfit"};
  const FAULT_TEXTS = {
    refused: () => "the browser was not allowed to use the camera; allow it beside the page's address, then try again",
    absent: () => "no camera is connected",
    busy: () => "the camera cannot be read; another program may be using it",
    unfit: () => "the camera gives no picture of 640 by 480 or so",
    no_access: () => "this browser gives pages at this address no camera",
    no_times: () => "this browser does not tell when pictures were taken",
    unplugged: () => "the camera was taken away",
    unloaded: detail => `the program that finds a hand could not be loaded${detail && `: ${detail}`}`,
    failed: detail => `MediaPipe, which finds a hand, has failed: ${detail}`,
    unknown: detail => `the browser says ${detail}`,
  };
  let guide = handLandmarks.guide({start, right});
  let worker = null, stream = null, over = false, busy = false, sees = null;

  function fail(fault, detail = "") {
    if (over) return;
    end();
    onStatus("fails", {name: fault, detail, text: FAULT_TEXTS[fault](detail)});
  }

  // Reports once that a hand comes into the picture or leaves it.
  function reportSeen(seen) {
    if (seen === sees) return;
    sees = seen;
    onStatus(seen ? "sees" : "seeks");
  }

  function take({data}) {
    if (data.failed) fail("failed", data.failed.split("\n")[0].slice(0, 300));
    else if (data.ready) {
      reportSeen(false);
      follow();
    } else if (!over) {
      busy = false;
      const size = {width: video.videoWidth, height: video.videoHeight}, t = data.at / 1000;
      const view = axes();
      const hand = data.landmarks ? guide.take(t, data.landmarks, data.world, size, view ?? handLandmarks.AXES) : null;
      reportSeen(hand !== null);
      if (hand && view) onSample({...hand, stamp: t, sent: performance.now() / 1000, device: right ? "webcam" : "webcam, left hand"});
    }
  }

  // Hands every picture that comes while the thread is idle to it, with the time at which the camera took it.
  function follow() {
    video.requestVideoFrameCallback(async (now, {captureTime}) => {
      if (over) return;
      follow();
      if (busy) return;
      busy = true;
      try {
        const picture = await createImageBitmap(video);
        worker?.postMessage({picture, at: captureTime ?? now}, [picture]);
      } catch (error) {
        busy = false;
      }
    });
  }

  async function begin() {
    if (!navigator.mediaDevices?.getUserMedia) return fail("no_access");
    if (!video.requestVideoFrameCallback) return fail("no_times");
    onStatus("asks");
    try {
      const wish = {width: {ideal: 640}, height: {ideal: 480}, frameRate: {ideal: 60}, facingMode: "user"};
      stream = await navigator.mediaDevices.getUserMedia({audio: false, video: wish});
    } catch (error) {
      return fail(FAULTS[error.name] ?? "unknown", `${error.name}: ${error.message}`);
    }
    if (over) return end();
    stream.getVideoTracks()[0].addEventListener("ended", () => fail("unplugged"));
    video.srcObject = stream;
    video.hidden = false;
    onStatus("loads");
    worker = new Worker("webcam/worker.js", {type: "module"});
    worker.addEventListener("message", take);
    worker.addEventListener("error", event => fail("unloaded", event.message ?? ""));
    try {
      await video.play();
    } catch (error) {
      fail("unknown", error.message);
    }
  }

  function end() {
    over = true;
    worker?.terminate();
    worker = null;
    stream?.getTracks().forEach(track => track.stop());
    video.srcObject = null;
    video.hidden = true;
  }

  begin();
  return {end, restart: from => { guide = handLandmarks.guide({start: from, right}); }};
};
