// A stand-in for the module of MediaPipe's tasks-vision in tests: the same calls, and no model. It sees a bright square
// in a dark picture, and answers a hand whose palm is there, as far away as the square is small; a dim square is a fist.
// Before that it loads and compiles its files as the true one does, and tries to report to its makers, as the true one does.
const {open, fist, focal, side, makers} = JSON.parse(`HANDS`);

export class HandLandmarker {
  static async createFromOptions(files, {baseOptions}) {
    const model = new TextDecoder("latin1").decode(baseOptions.modelAssetBuffer);
    if (model.includes("broken")) throw new Error("the model's graph has no landmarks");
    await fetch(makers, {mode: "no-cors"}).catch(() => null);
    await import(files.wasmLoaderPath);
    await WebAssembly.compile(await (await fetch(files.wasmBinaryPath)).arrayBuffer());
    if (!self.ModuleFactory) throw new Error("ModuleFactory not set.");
    return new HandLandmarker();
  }

  detectForVideo(picture, time) {
    if (!(time > (this.time ?? -1))) throw new Error("Packet timestamp mismatch");
    this.time = time;
    const {width, height} = picture, canvas = new OffscreenCanvas(width, height), context = canvas.getContext("2d");
    context.drawImage(picture, 0, 0);
    const {data} = context.getImageData(0, 0, width, height);
    let n = 0, x = 0, y = 0, light = 0;
    for (let i = 0; i < width * height; i++) {
      if (data[4 * i + 1] < 90) continue;
      n++;
      x += i % width;
      y += Math.floor(i / width);
      light += data[4 * i + 1];
    }
    if (n < 100) return {landmarks: [], worldLandmarks: []};
    const f = focal * width, depth = f * side / Math.sqrt(n), hand = light / n > 180 ? open : fist;
    const at = ([X, Y, Z]) => ({x: (x / n + f * X / (Z + depth)) / width, y: (y / n + f * Y / (Z + depth)) / height, z: Z});
    return {landmarks: [hand.map(at)], worldLandmarks: [hand.map(([x, y, z]) => ({x, y, z}))]};
  }
}
