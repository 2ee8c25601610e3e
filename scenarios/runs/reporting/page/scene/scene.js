// Shows bodies, tubes and lines in space, with three.js; what they are comes from replay_section.py, scene_objects.js makes them.
//   const scene = createScene(element, {traces, low, high, held, eye, weightless, floor, follow, played, live, ghost})
//                                 held: [[x, y, z], ...], m, what a view just shows; without it, the box from low to high
//                                 played: a person acts in it, so that frames come fast also where no graphics card
//                                 draws them, and shadows fall straight down
//                                 live: frames follow a run under way: those that come late are drawn with fewer pixels,
//                                 then without shadows (data-coarse of the element counts the steps)
//                                 What was drawn coarsely in a scene that is played or live, is drawn once more in full as soon
//                                 as nothing has moved for a while (data-sharp of the element is there until something moves)
//                                 ghost: label of what shines through what hides it
//   scene.show(u)                 everything u frames after the first; u may lie between two
//   scene.setView(name)           looks from one of scene.views: "start", "front", "side", "top";
//                                 side is from that end of x which the eye is nearer to at the start
//   scene.lookFrom([x, y, z])     looks from that side, along a vector of W that points to the eye
//   scene.hold(corners)           what a view just shows from now on, as `held`
//   scene.follows = true          the view moves with the body of that label from now on
//   scene.setVisible(label, yes), scene.visible(label)
//   scene.updateColours()         takes the page's colours anew
//   scene.points(label)           [[x, y, z], ...] of what is drawn under a label, m, in W
//   scene.canvas, scene.camera
//   scene.requestRender()
//   scene.onBeforeRender = act    is called before each render; may call scene.setFrame(u), which is show without a render
//   scene.onAfterRender = act     is called after each render, while the canvas still has it (data-pictures counts them)
//   scene.pick(x, y, labels)      {label, point} of what is seen at a place of the window, px, if its label is one of these
//   scene.toBody(label, point)    a point of W in the frame of a label's first body; toWorld takes it back
//   scene.toPixels(point)         where a point of W is seen, from the element's upper left corner
//   scene.acrossView(right, up)   the vector of W that points so far to the right and up in the view
//   scene.viewpoint()             where the eye is and what it looks at, {position, target}, m, in W
//   scene.setViewpoint(viewpoint)
//   scene.spherical()             {azimuth, elevation, distance} of the eye from its target, rad and m
//   scene.dispose()               ends it; the browser has few such canvases
// Nothing is rendered unless something has changed. W is as in the record, z upwards.
"use strict";
const createScene = (() => {
  const FIELD = 36 * Math.PI / 180, ROOM = 0.94;  // of the view from top to bottom, and the share of it for the box
  const LATE = 50, NOT_SEEN = 3000;  // ms from a request until its render: too long; so long that the page was not seen
  const STILL = 500;  // ms without a request from which on there is time for a sharp picture
  const VIEWS = {front: () => [0, -1, 0.12], side: ([x]) => [x < 0 ? -1 : 1, 0, 0.12], top: () => [0, -0.001, 1]};
  const hasWebGl = () => Boolean(document.createElement("canvas").getContext("webgl2"));
  function rendersInSoftware() {
    const gl = document.createElement("canvas").getContext("webgl2"), about = gl?.getExtension("WEBGL_debug_renderer_info");
    return /swiftshader|llvmpipe|software/i.test(about ? gl.getParameter(about.UNMASKED_RENDERER_WEBGL) : "");
  }
  const svg = (name, attributes = {}) => {
    const node = document.createElementNS("http://www.w3.org/2000/svg", name);
    for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, value);
    return node;
  };

  // 1, 2 or 5 times a power of ten, at most x.
  function round125(x) {
    const ten = 10 ** Math.floor(Math.log10(x));
    return ([5, 2, 1].find(k => k * ten <= x * (1 + 1e-9)) ?? 1) * ten;
  }

  function lengthText(metres) {
    const [value, unit] = metres >= 1 ? [metres, "m"] : metres >= 0.01 ? [100 * metres, "cm"] : [1000 * metres, "mm"];
    return `${Number(value.toPrecision(3))} ${unit}`;
  }

  // Axes of W in the corner, and a bar as long as it says at the distance of what is looked at; returns what updates them.
  function createAxesAndScaleBar(element) {
    const drawing = svg("svg", {class: "scene-scale", "aria-hidden": "true", width: 170, height: 96});
    const bar = svg("path"), text = svg("text", {x: 12, y: 76});
    const axes = ["x", "y", "z"].map(name => {
      const line = svg("line", {class: "axis-" + name}), letter = svg("text", {class: "axis-" + name});
      letter.textContent = name;
      drawing.append(line, letter);
      return {line, letter};
    });
    drawing.append(bar, text);
    element.append(drawing);
    return (camera, pixelsPerMetre) => {
      const back = camera.quaternion.clone().invert();
      axes.forEach(({line, letter}, i) => {
        const a = new THREE.Vector3(+(i === 0), +(i === 1), +(i === 2)).applyQuaternion(back);
        const [x, y] = [36 + 24 * a.x, 34 - 24 * a.y];
        for (const [key, value] of Object.entries({x1: 36, y1: 34, x2: x, y2: y})) line.setAttribute(key, value);
        letter.setAttribute("x", 36 + 32 * a.x - 3);
        letter.setAttribute("y", 34 - 32 * a.y + 4);
        line.style.opacity = letter.style.opacity = 0.85 + 0.15 * a.z;
      });
      const length = round125(130 / pixelsPerMetre);
      bar.setAttribute("d", `M12 82v6h${(length * pixelsPerMetre).toFixed(1)}v-6`);
      text.textContent = lengthText(length);
    };
  }

  // A light that throws shadows in a scene of a size, its `reach`, about its centre.
  function createSun(eye, centre, reach, {overhead, coarse}) {
    const sun = new THREE.DirectionalLight("#fff6e8", 2.1);
    const from = Math.atan2(eye[1], eye[0]) - 1.2;  // from the viewer's left, lest shadows hide behind what throws them
    if (overhead) sun.position.set(centre[0] - 0.02 * reach, centre[1], centre[2] + 3.2 * reach);
    else sun.position.set(centre[0] + 1.9 * reach * Math.cos(from), centre[1] + 1.9 * reach * Math.sin(from), centre[2] + 2.6 * reach);
    sun.target.position.set(...centre);
    sun.castShadow = true;
    sun.shadow.mapSize.setScalar(coarse ? 512 : 2048);
    sun.shadow.bias = coarse ? -0.004 : -0.0005;
    sun.shadow.normalBias = reach / 400;
    const span = 1.25 * reach;
    Object.assign(sun.shadow.camera, {left: -span, right: span, bottom: -span, top: span, near: 0.2 * reach, far: 7 * reach});
    return sun;
  }

  // Takes the next of some savings where the median of the last six delays of renders, ms, is too long.
  function createQualityControl(element, savings) {
    const delays = [];
    return delay => {
      if (!savings.length || document.hidden || delay > NOT_SEEN) return;
      delays.push(delay);
      if (delays.length < 6) return;
      const median = delays.sort((a, b) => a - b)[3];
      delays.length = 0;
      if (median < LATE) return;
      savings.shift()();
      element.dataset.coarse = Number(element.dataset.coarse ?? 0) + 1;
    };
  }

  return (element, content) => {
    const {traces, low, high, eye, weightless = false, floor = low[2], follow = ""} = content;
    let held = content.held;
    const {played = false, live = false, ghost = ""} = content;
    if (!hasWebGl()) return null;
    const sides = high.map((x, i) => x - low[i]), centre = high.map((x, i) => (x + low[i]) / 2);
    const reach = Math.hypot(...sides) / 2;
    const scene = new THREE.Scene();
    const camera = new THREE.PerspectiveCamera(FIELD * 180 / Math.PI, 1, reach / 100, 60 * reach);
    camera.up.set(0, 0, 1);
    const coarse = (played || live) && rendersInSoftware();
    const renderer = new THREE.WebGLRenderer({antialias: !coarse, alpha: true});
    // How it is drawn at rest, and while something moves; without smooth edges, twice as many pixels take their place.
    const sharp = {ratio: coarse ? 2 : Math.min(devicePixelRatio, 2), shadows: true};
    const moving = {...sharp, ratio: coarse ? 0.75 : sharp.ratio};
    renderer.setPixelRatio(moving.ratio);
    renderer.shadowMap.enabled = true;
    renderer.shadowMap.type = THREE.PCFShadowMap;
    element.append(renderer.domElement);
    element.classList.toggle("weightless", weightless);
    const controls = new THREE.OrbitControls(camera, renderer.domElement);
    controls.minDistance = reach / 20;
    controls.maxDistance = 12 * reach;
    const updateAxesAndScaleBar = createAxesAndScaleBar(element);

    const sun = createSun(eye, centre, reach, {overhead: played, coarse});
    scene.add(new THREE.HemisphereLight("#ffffff", weightless ? "#8f98b0" : "#b9b2a8", 1.7), sun, sun.target);
    const dot = sceneObjects.createDotTexture();
    // A little below what stands on it: two faces in one plane would flicker.
    const ground = weightless ? null
      : sceneObjects.createFloor(floor - reach / 500, centre, reach, round125(Math.max(...sides) / 6));
    scene.add(ground ? ground.group : sceneObjects.createStars(50 * reach, dot));
    const drawn = traces.flatMap(trace => sceneObjects.createTrace(trace, dot, trace.label === ghost));
    for (const {object} of drawn) scene.add(object);
    const labelled = label => drawn.filter(d => d.label === label);
    const points = label => labelled(label).flatMap(d => d.worldPoints());

    const controlQuality = createQualityControl(element, !live ? [] : [
      () => { moving.ratio = Math.min(moving.ratio, 0.75); },
      () => { moving.shadows = false; },
      () => { moving.ratio = 0.5; },
    ]);

    let request = 0, requestedAt = 0, rest = 0, follows = false;
    const pixelsPerMetre = () => element.clientHeight / (2 * Math.tan(FIELD / 2) * camera.position.distanceTo(controls.target));
    function render() {
      request = 0;
      clearTimeout(rest);
      controlQuality(performance.now() - requestedAt);
      draw(moving);
      if (moving.ratio < sharp.ratio || !moving.shadows) rest = setTimeout(renderSharp, STILL);
    }
    function renderSharp() {
      if (request) return;
      request = requestAnimationFrame(() => {
        request = 0;
        draw(sharp);
      });
    }
    function draw(quality) {
      const {ratio, shadows} = quality;
      if (renderer.getPixelRatio() !== ratio) {  // which empties the canvas
        renderer.setPixelRatio(ratio);
        renderer.setSize(element.clientWidth, element.clientHeight, false);
      }
      sun.castShadow = shadows;
      if (ground) ground.plane.visible = shadows;
      element.toggleAttribute("data-sharp", quality === sharp);
      api.onBeforeRender();
      renderer.render(scene, camera);
      updateAxesAndScaleBar(camera, pixelsPerMetre());
      api.onAfterRender();
      element.dataset.pictures = Number(element.dataset.pictures ?? 0) + 1;
    }
    function requestRender() {
      if (request) return;
      requestedAt = performance.now();
      request = requestAnimationFrame(render);
    }

    // From the side of `towards`, at a distance from where all that is held, or the whole box, is just seen.
    function lookFrom(towards) {
      const back = new THREE.Vector3(...towards).normalize();
      const right = new THREE.Vector3().crossVectors(camera.up, back).normalize();
      const over = new THREE.Vector3().crossVectors(back, right);
      const corners = held ? held.map(p => new THREE.Vector3(...p).sub(new THREE.Vector3(...centre)))
        : [0, 1, 2, 3, 4, 5, 6, 7].map(n => new THREE.Vector3(...sides.map((side, i) => ((n >> i & 1) - 0.5) * side)));
      const fit = (along, slope) => {
        const least = Math.min(...corners.map(c => along.dot(c) - slope * back.dot(c)));
        const most = Math.max(...corners.map(c => along.dot(c) + slope * back.dot(c)));
        return [(least + most) / 2, (most - least) / (2 * slope)];
      };
      const slope = ROOM * Math.tan(FIELD / 2);
      const [x, far] = fit(right, slope * camera.aspect), [y, farther] = fit(over, slope);
      controls.target.set(...centre).addScaledVector(right, x).addScaledVector(over, y);
      camera.position.copy(controls.target).addScaledVector(back, Math.max(far, farther));
      controls.update();
      requestRender();
    }

    // The mean of all points under a label; null where none is shown.
    function centreOf(label) {
      const finite = points(label).filter(p => p.every(Number.isFinite));
      if (!finite.length) return null;
      const sum = finite.reduce((a, p) => [a[0] + p[0], a[1] + p[1], a[2] + p[2]], [0, 0, 0]);
      return new THREE.Vector3(...sum).divideScalar(finite.length);
    }

    function resize() {
      const {clientWidth: wide, clientHeight: high} = element;
      if (!wide || !high) return;
      camera.aspect = wide / high;
      camera.updateProjectionMatrix();
      renderer.setSize(wide, high, false);
      requestRender();
    }

    const api = {
      views: ["start", ...Object.keys(VIEWS)],
      canvas: renderer.domElement,
      camera,
      onBeforeRender() {},
      onAfterRender() {},
      setFrame(u) { for (const shown of drawn) shown.setFrame(u); },
      requestRender,
      show(u) {
        api.setFrame(u);
        const there = follows && centreOf(follow);
        if (there) {
          camera.position.add(there).sub(controls.target);
          controls.target.copy(there);
          controls.update();
        }
        requestRender();
      },
      lookFrom,
      hold(corners) { held = corners; },
      setView: name => lookFrom(VIEWS[name]?.(eye) ?? eye),
      get follows() { return follows; },
      set follows(yes) { follows = Boolean(yes && follow); },
      setVisible(label, yes) {
        for (const {object} of labelled(label)) object.visible = yes;
        requestRender();
      },
      visible: label => labelled(label).map(d => d.object.visible),
      points,
      updateColours() {
        ground?.setGridColour(getComputedStyle(element).getPropertyValue("--scene-grid").trim());
        requestRender();
      },
      spherical() {
        const [x, y, z] = camera.position.clone().sub(controls.target).toArray();
        return {azimuth: Math.atan2(y, x), elevation: Math.atan2(z, Math.hypot(x, y)), distance: Math.hypot(x, y, z)};
      },
      pick(x, y, labels) {
        const {left, top, width, height} = renderer.domElement.getBoundingClientRect();
        const there = new THREE.Vector3(2 * (x - left) / width - 1, 1 - 2 * (y - top) / height, 0.5).unproject(camera);
        const from = camera.position, along = there.sub(from).normalize();
        let nearest = Infinity, seen = null;
        for (const {object, label} of drawn) {
          const shown = object.isMesh && object.visible && object.scale.x;
          const distance = shown ? sceneObjects.distanceAlong(object, from, along) : Infinity;
          if (distance < nearest) [nearest, seen] = [distance, label];
        }
        return labels.includes(seen) ? {label: seen, point: from.clone().addScaledVector(along, nearest).toArray()} : null;
      },
      toBody: (label, point) => labelled(label)[0].object.worldToLocal(new THREE.Vector3(...point)).toArray(),
      toWorld: (label, point) => labelled(label)[0].object.localToWorld(new THREE.Vector3(...point)).toArray(),
      toPixels(point) {
        camera.updateMatrixWorld();  // it may have been turned since the last render
        const {x, y} = new THREE.Vector3(...point).project(camera), {clientWidth: wide, clientHeight: high} = element;
        return [(x + 1) / 2 * wide, (1 - y) / 2 * high];
      },
      acrossView(right, up) {
        const [x, y] = [0, 1].map(k => new THREE.Vector3().setFromMatrixColumn(camera.matrixWorld, k));
        return x.multiplyScalar(right).addScaledVector(y, up).toArray();
      },
      viewpoint: () => ({position: camera.position.toArray(), target: controls.target.toArray()}),
      setViewpoint({position, target}) {
        camera.position.set(...position);
        controls.target.set(...target);
        controls.update();
        requestRender();
      },
      dispose() {
        cancelAnimationFrame(request);
        clearTimeout(rest);
        sizes.disconnect();
        controls.dispose();
        renderer.dispose();
        renderer.forceContextLoss();
      },
    };
    controls.addEventListener("change", requestRender);
    const sizes = new ResizeObserver(resize);
    sizes.observe(element);
    resize();
    api.show(0);
    api.setView("start");
    api.updateColours();
    return api;
  };
})();
