// Leads a hand by a webcam; pictures go to a thread of this page and nowhere else, and none is kept.
//   const watched = handCamera({video, axes, start, right, onSample, onTold})
//     video        the element that shows what the camera sees
//     axes         returns the directions of the view in W: to its right, up, towards the eye; null while nothing is led
//     start        {p_WH, closed, centre, radius}, see handInput
//     right        whether the right hand is to be seen
//     onSample     is called with a sample for each picture with a hand; where none is seen, the sample before ages
//     onTold       is called with how it is: "asks" for the camera, "loads" MediaPipe, "seeks" a hand, "sees" one, or
//                  "fails", and then with the name of the fault, which the page has words for, and what is known besides:
//                  refused, absent, busy, unfit, no_access, no_times, unplugged, unloaded, failed, unknown
//   watched.restart(start)   leads another hand from now on
//   watched.end()            lets go of the camera
"use strict";
const handCamera = ({video, axes, start, right, onSample, onTold}) => {
  const FAULTS = {NotAllowedError: "refused", NotFoundError: "absent", NotReadableError: "busy", OverconstrainedError: "unfit"};
  let guide = handLandmarks.guide({start, right});
  let worker = null, stream = null, over = false, busy = false, sees = null;

  function fail(fault, detail = "") {
    if (over) return;
    end();
    onTold("fails", fault, detail);
  }

  // Tells once that a hand comes into the picture or leaves it.
  function tellSeen(seen) {
    if (seen === sees) return;
    sees = seen;
    onTold(seen ? "sees" : "seeks");
  }

  function take({data}) {
    if (data.failed) fail("failed", data.failed.split("\n")[0].slice(0, 300));
    else if (data.ready) {
      tellSeen(false);
      follow();
    } else if (!over) {
      busy = false;
      const size = {width: video.videoWidth, height: video.videoHeight}, t = data.at / 1000;
      const view = axes();
      const hand = data.landmarks ? guide.take(t, data.landmarks, data.world, size, view ?? handLandmarks.AXES) : null;
      tellSeen(hand !== null);
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
    onTold("asks");
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
    onTold("loads");
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
