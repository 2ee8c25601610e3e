// Finds a hand in pictures, by the lab's files of MediaPipe's tasks-vision, in a thread of its own; see hand_camera.js.
// It gets {picture, at}, a bitmap and its time, and answers {at, landmarks, world} without landmarks where no hand is;
// before that {ready: true}, or {failed: why}. webcam.py serves it with a policy by which it may load those files alone.
import {HandLandmarker} from "./vision_bundle.mjs";

let landmarker = null, last = 0;

async function load() {
  const wasm = {wasmLoaderPath: "./vision_wasm_module_internal.js", wasmBinaryPath: "./vision_wasm_module_internal.wasm"};
  const files = Object.fromEntries(Object.entries(wasm).map(([name, path]) => [name, new URL(path, import.meta.url).href]));
  const model = await fetch(new URL("./hand_landmarker.task", import.meta.url));
  if (!model.ok) throw new Error(`the model was not served: ${model.status}`);
  landmarker = await HandLandmarker.createFromOptions(files, {
    baseOptions: {modelAssetBuffer: new Uint8Array(await model.arrayBuffer()), delegate: "CPU"},
    runningMode: "VIDEO",
    numHands: 1,
  });
}

addEventListener("message", ({data: {picture, at}}) => {
  try {
    last = Math.max(performance.now(), last + 1);  // it takes no picture at the time of the one before
    const {landmarks, worldLandmarks} = landmarker.detectForVideo(picture, last);
    postMessage({at, landmarks: landmarks[0], world: worldLandmarks[0]});
  } catch (error) {
    postMessage({failed: String(error?.message ?? error)});
  } finally {
    picture.close();
  }
});

load().then(() => postMessage({ready: true}), error => postMessage({failed: String(error?.message ?? error)}));
