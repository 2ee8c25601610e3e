// Leads a hand by a webcam; pictures go to a thread of this page and nowhere else, and none is kept.
//   const watched = handCamera({video, axes, start, right, onSample, onTold})
//     video        the element that shows what the camera sees
//     axes         returns the directions of the view in W: to its right, up, towards the eye; null while nothing is led
//     start        {p_WH, closed, centre, radius}, see handInput
//     right        whether the right hand is to be seen
//     onSample     is called with a sample for each picture with a hand; where none is seen, the sample before ages
//     onTold       is called with how it is: "asks" for the camera, "loads" MediaPipe, "seeks" a hand, "sees" one, or
//                  "fails", and then with why the webcam cannot lead
//   watched.restart(start)   leads another hand from now on
//   watched.end()            lets go of the camera
"use strict";
const handCamera = ({video, axes, start, right, onSample, onTold}) => {
  const REASONS = {
    NotAllowedError: "the browser was not allowed to use the camera; allow it beside the page's address and choose it again",
    NotFoundError: "no camera is connected",
    NotReadableError: "the camera cannot be read; another program may be using it",
    OverconstrainedError: "the camera gives no picture of 640 by 480 or so",
  };
  let guide = handLandmarks.guide({start, right});
  let worker = null, stream = null, over = false, busy = false, sees = null;

  function fail(why) {
    if (over) return;
    end();
    onTold("fails", why);
  }

  // Tells once that a hand comes into the picture or leaves it.
  function tellSeen(seen) {
    if (seen === sees) return;
    sees = seen;
    onTold(seen ? "sees" : "seeks");
  }

  function take({data}) {
    if (data.failed) fail(`MediaPipe failed: ${data.failed.split("\n")[0].slice(0, 300)}`);
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
    if (!navigator.mediaDevices?.getUserMedia) return fail("this browser gives pages at this address no camera");
    if (!video.requestVideoFrameCallback) return fail("this browser does not tell when pictures were taken");
    onTold("asks");
    try {
      const wish = {width: {ideal: 640}, height: {ideal: 480}, frameRate: {ideal: 60}, facingMode: "user"};
      stream = await navigator.mediaDevices.getUserMedia({audio: false, video: wish});
    } catch (error) {
      return fail(REASONS[error.name] ?? `${error.name}: ${error.message}`);
    }
    if (over) return end();
    stream.getVideoTracks()[0].addEventListener("ended", () => fail("the camera was taken away"));
    video.srcObject = stream;
    video.hidden = false;
    onTold("loads");
    worker = new Worker("webcam/worker.js", {type: "module"});
    worker.addEventListener("message", take);
    worker.addEventListener("error", event => fail(`its program could not be loaded${event.message ? `: ${event.message}` : ""}`));
    try {
      await video.play();
    } catch (error) {
      fail(error.message);
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
