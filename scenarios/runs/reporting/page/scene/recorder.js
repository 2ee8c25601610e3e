// Records a video of what a scene shows, with its background, its scale and a line of text, and saves it. It lasts as long
// as it takes to record it.
//   const recorder = createRecorder(viewport, text, {begin, end})   null, and no button, where the browser records nothing
//     text()   what stands in the video's corner
//     begin()  is called when a video begins, end() when the button ends it; one without end() goes on until then
//   recorder.stop()   ends a video, if one is recorded, and saves it
"use strict";
const createRecorder = (viewport, text, {begin = () => {}, end = null} = {}) => {
  const FORMATS = ["video/mp4;codecs=avc1.640028", "video/webm;codecs=vp9", "video/webm;codecs=vp8", "video/webm", "video/mp4"];
  const BITS_PER_SECOND = 8e6;
  const LAST_FRAME = 300;  // ms that it stays
  const button = viewport.button, {scene, element} = viewport;
  const format = globalThis.MediaRecorder && HTMLCanvasElement.prototype.captureStream
    && FORMATS.find(f => MediaRecorder.isTypeSupported(f));
  if (!button || !format) return null;
  const suffix = /mp4/.test(format) ? "mp4" : "webm", name = {mp4: "MP4", webm: "WebM"}[suffix];
  let recorder = null, frame = null;

  function showOnButton(isRecording) {
    button.textContent = isRecording ? "stop and save" : `record a video (${name})`;
    const span = end ? "as it plays from its beginning to its end" : "from now on until you stop it";
    button.title = isRecording ? `stops recording and saves the video (${name})`
      : `records the scene, without plots, ${span}, and saves the video (${name})`;
    button.setAttribute("aria-pressed", isRecording);
  }

  // CSS's ellipse that reaches the farthest corner.
  function drawBackground(context, wide, high, style) {
    const value = name => style.getPropertyValue("--scene-" + name).trim();
    const [x, y] = [["x", wide], ["y", high]].map(([name, size]) => parseFloat(value(name)) / 100 * size);
    const gradient = context.createRadialGradient(0, 0, 0, 0, 0, Math.SQRT2);
    gradient.addColorStop(0, value("bright"));
    gradient.addColorStop(1, value("deep"));
    context.save();
    context.translate(x, y);
    context.scale(Math.max(x, wide - x), Math.max(y, high - y));
    context.fillStyle = gradient;
    context.fillRect(-2, -2, 4, 4);
    context.restore();
  }

  // The axes and the bar, which are a drawing of lines, paths and texts beside the canvas.
  function drawAxesAndScaleBar(context, wide, high) {
    const drawing = element.querySelector(".scene-scale");
    const [own, around] = [drawing, element].map(part => part.getBoundingClientRect());
    context.save();
    context.scale(wide / around.width, high / around.height);
    context.translate(own.left - around.left, own.top - around.top);
    for (const part of drawing.children) {
      const look = getComputedStyle(part), number = name => Number(part.getAttribute(name));
      Object.assign(context, {globalAlpha: look.opacity, strokeStyle: look.stroke, fillStyle: look.fill, font: look.font});
      context.lineWidth = parseFloat(look.strokeWidth);
      if (part.tagName === "text") context.fillText(part.textContent, number("x"), number("y"));
      else if (part.tagName === "path") context.stroke(new Path2D(part.getAttribute("d") ?? ""));
      else context.stroke(new Path2D(`M${number("x1")} ${number("y1")}L${number("x2")} ${number("y2")}`));
    }
    context.restore();
  }

  function compose() {
    const {width, height} = frame, context = frame.getContext("2d"), style = getComputedStyle(element);
    drawBackground(context, width, height, style);
    context.drawImage(scene.canvas, 0, 0, width, height);
    drawAxesAndScaleBar(context, width, height);
    const letters = 16 * height / element.clientHeight;
    context.font = `${letters}px system-ui, sans-serif`;
    context.fillStyle = style.color;
    context.fillText(text(), letters, 1.8 * letters);
  }

  function save(blob) {
    const link = document.createElement("a"), url = URL.createObjectURL(blob);
    link.href = url;
    link.download = `${document.title.split(":")[0]}.${suffix}`;
    link.click();
    setTimeout(() => URL.revokeObjectURL(url), 60_000);
  }

  function start() {
    frame = document.createElement("canvas");
    [frame.width, frame.height] = [scene.canvas.width, scene.canvas.height].map(n => n & ~1);  // as H.264 wants it
    const parts = [];
    recorder = new MediaRecorder(frame.captureStream(), {mimeType: format, videoBitsPerSecond: BITS_PER_SECOND});
    recorder.addEventListener("dataavailable", ({data}) => parts.push(data));
    recorder.addEventListener("stop", () => {
      button.disabled = false;
      if (parts.some(part => part.size)) save(new Blob(parts, {type: format}));
    });
    showOnButton(true);
    const begun = recorder;
    scene.onAfterRender = () => {
      compose();
      begun.start();
      scene.onAfterRender = compose;
    };
    begin();
    scene.updateColours();  // renders a frame
  }

  function stop() {
    const ended = recorder;
    if (!ended) return;
    recorder = null;
    showOnButton(false);
    button.disabled = true;
    setTimeout(() => {
      scene.onAfterRender = () => {};
      if (ended.state === "inactive") button.disabled = false;
      else ended.stop();
    }, LAST_FRAME);
  }

  showOnButton(false);
  button.hidden = false;
  button.addEventListener("click", () => recorder ? (end ?? stop)() : start());
  return {stop, get recording() { return Boolean(recorder); }};
};
