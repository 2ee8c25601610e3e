// A scene with what belongs to it on a page: views, legend, full screen, and the touch that wakes it.
//   const viewport = createViewport(root, content)   null without WebGL, after the page has said so; see createScene for the content
//   viewport.scene, viewport.button   the scene, and the button that records a video of it
//   viewport.close()                  ends the scene, before its elements are taken out of the page
//   viewport.onFollow = act           is called when the view begins or ceases to follow
"use strict";
const createViewport = (root, content) => {
  const part = name => root.querySelector(".replay-" + name);
  const element = part("scene"), wake = part("wake"), full = part("full");
  const scene = createScene(element, content);
  if (!scene) {
    part("missing").hidden = false;
    part("shown").hidden = true;
    return null;
  }
  const life = new AbortController();
  const viewport = {scene, element, button: part("film"), onFollow: () => {}, close() { life.abort(); scene.dispose(); }};

  // A page scrolls over the scene until the scene is touched.
  wake.addEventListener("click", () => root.classList.add("awake"));
  element.addEventListener("pointerdown", () => root.classList.add("awake"), true);
  element.addEventListener("wheel", event => {
    if (!root.classList.contains("awake")) event.stopImmediatePropagation();
  }, true);
  document.addEventListener("pointerdown", event => {
    if (!root.contains(event.target)) root.classList.remove("awake");
  }, {signal: life.signal});

  part("views").addEventListener("click", ({target}) => {
    const button = target.closest("button");
    if (!button) return;
    if (button.dataset.view !== "follow") {
      scene.setView(button.dataset.view);
      return;
    }
    scene.follows = button.getAttribute("aria-pressed") !== "true";
    button.setAttribute("aria-pressed", scene.follows);
    viewport.onFollow();
  });
  part("legend").addEventListener("click", ({target}) => {
    const button = target.closest("button");
    if (!button) return;
    const shown = button.getAttribute("aria-pressed") !== "true";
    button.setAttribute("aria-pressed", shown);
    scene.setVisible(button.dataset.label, shown);
  });
  full.hidden = !document.fullscreenEnabled;
  full.addEventListener("click", () => document.fullscreenElement ? document.exitFullscreen()
    : part("shown").requestFullscreen());
  page.onColours(() => life.signal.aborted || scene.updateColours());
  return viewport;
};
