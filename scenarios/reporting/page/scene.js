// Draws bodies, tubes and lines in space, with three.js; what they are comes from replay_section.py.
//   const scene = sceneIn(element, {traces, low, high, held, eye, weightless, floor, follow, played, live})
//                                 held: [[x, y, z], ...], m, what a view just shows; without it, the box from low to high
//                                 played: a person acts in it, so that pictures come fast also where no graphics card
//                                 draws them, and shadows fall straight down
//                                 live: pictures follow a run under way: those that come late are drawn with fewer pixels,
//                                 then without shadows (data-coarse of the element counts the steps)
//   scene.show(u)                 everything u frames after the first; u may lie between two
//   scene.turn(view)              looks from one of scene.views: "start", "front", "side", "top";
//                                 side is from that end of x which the eye is nearer to at the start
//   scene.lookFrom([x, y, z])     looks from that side, along a vector of W that points to the eye
//   scene.follows = true          the view moves with the body of that label from now on
//   scene.setVisible(label, yes)
//   scene.recolour()              takes the page's colours anew
//   scene.points(label)           [[x, y, z], ...] of what is drawn under a label, m, in W
//   scene.looksAt()              [x, y, z] of what the eye looks at, m, in W
//   sceneIn.longestTrail          points that a way which grows may have
//   scene.canvas, scene.camera
//   scene.wake()                  has a picture drawn
//   scene.beforePicture = act     is called before each picture is drawn; may call scene.place(u), which is show without
//                                 a picture
//   scene.onPicture = act         is called when a picture has been drawn, while the canvas still has it
//   scene.pick(x, y, labels)      {label, point} of what is seen at a place of the window, in pixels, if its label is one of these
//   scene.toBody(label, point)    a point of W in the frame of a label's first body; toWorld takes it back
//   scene.toPixels(point)         where a point of W is seen, from the element's upper left corner
//   scene.acrossView(right, up)   the vector of W that points so far to the right and up in the view
//   scene.viewpoint()             where the eye is and what it looks at, {position, target}, m, in W; scene.lookAs takes it
//   scene.dispose()               ends it; the browser has few such canvases
//   scene.view()                  {azimuth, elevation, distance} of the eye from what it looks at, rad and m
// Pictures are drawn when something has changed, never in vain. W is as in the record, z upwards.
"use strict";
const sceneIn = (() => {
  const FIELD = 36 * Math.PI / 180, ROOM = 0.94;  // of the view from top to bottom, and the share of it for the box
  const LATE = 50, FORGOTTEN = 3000;  // ms from when a picture is wanted until it is drawn: too long; not because of what it costs
  const LONGEST_TRAIL = 4000;  // points of a way that grows
  const VIEWS = {front: () => [0, -1, 0.12], side: ([x]) => [x < 0 ? -1 : 1, 0, 0.12], top: () => [0, -0.001, 1]};
  const SHARP = Math.cos(35 * Math.PI / 180);  // of the angle between two faces from which on their edge is drawn
  const hasWebGl = () => Boolean(document.createElement("canvas").getContext("webgl2"));
  function drawsBySoftware() {
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

  // A body keeps its geometry and is moved; p_WB that is not finite hides it.
  function bodyOf(part, material) {
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(Float32Array.from(part.vertices), 3));
    geometry.setIndex(Array.from(part.triangles));
    geometry.computeVertexNormals();
    const mesh = new THREE.Mesh(geometry, material);
    mesh.castShadow = mesh.receiveShadow = true;
    mesh.add(edgesOf(part, material));
    return {
      object: mesh,
      set(u) {
        const p = replayShapes.between(part.p, 3, u);
        const shown = p.every(Number.isFinite);
        mesh.scale.setScalar(shown ? 1 : 0);
        if (!shown) return;
        mesh.position.set(...p);
        if (!part.q) return;
        const [w, x, y, z] = replayShapes.between(part.q, 4, u);
        mesh.quaternion.set(x, y, z, w).normalize();
      },
      points: () => {
        mesh.updateMatrixWorld();
        const v = part.vertices;
        return Array.from({length: v.length / 3}, (_, i) =>
          new THREE.Vector3(v[3 * i], v[3 * i + 1], v[3 * i + 2]).applyMatrix4(mesh.matrixWorld).toArray());
      },
    };
  }

  // The sharp edges of a body, a little darker, so that faces of like brightness are told apart. Its triangles may
  // share no vertices: those at the same place are the same.
  function edgesOf({vertices: v, triangles}, material) {
    const named = i => [0, 1, 2].map(k => Math.round(1e6 * v[3 * i + k])).join();
    const corner = i => new THREE.Vector3(v[3 * i], v[3 * i + 1], v[3 * i + 2]);
    const sides = new Map(), places = [];
    for (let k = 0; k < triangles.length; k += 3) {
      const three = [0, 1, 2].map(i => triangles[k + i]), [a, b, c] = three.map(corner);
      const normal = b.sub(a).cross(c.sub(a)).normalize();
      three.forEach((i, n) => {
        const j = three[(n + 1) % 3], name = [named(i), named(j)].sort().join(" ");
        const before = sides.get(name);
        if (!before) sides.set(name, normal);
        else if (before.dot(normal) < SHARP) places.push(...corner(i).toArray(), ...corner(j).toArray());
      });
    }
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(places), 3));
    const {color, transparent, opacity} = material;
    return new THREE.LineSegments(geometry,
      new THREE.LineBasicMaterial({color: color.clone().multiplyScalar(0.45), transparent, opacity}));
  }

  // A tube's surface is laid anew along its points.
  function tubeOf(part, material) {
    const geometry = new THREE.BufferGeometry(), positions = new Float32Array(3 * replayShapes.count(part));
    geometry.setAttribute("position", new THREE.BufferAttribute(positions, 3));
    geometry.setIndex(replayShapes.triangles(part));
    const mesh = new THREE.Mesh(geometry, material);
    mesh.castShadow = mesh.receiveShadow = true;
    mesh.frustumCulled = false;
    return {
      object: mesh,
      set(u) {
        if (mesh.userData.u === u && mesh.userData.of === part.points) return;
        Object.assign(mesh.userData, {u, of: part.points});
        mesh.scale.setScalar(replayShapes.tube(part, u, positions) ? 1 : 0);
        geometry.attributes.position.needsUpdate = true;
        geometry.computeVertexNormals();
      },
      points: () => triples(positions),
    };
  }

  const triples = flat => Array.from({length: flat.length / 3}, (_, i) => Array.from(flat.slice(3 * i, 3 * i + 3)));

  // A line of pixels' width with gaps where a point is not finite, and dots where they are wanted.
  function lineOf(trace, dot) {
    const group = new THREE.Group();
    const most = trace.trail ? Math.max(trace.points.length / 3 + 1, LONGEST_TRAIL) : trace.n;
    const look = {color: trace.colour, transparent: trace.opacity < 1, opacity: trace.opacity};
    let line = null, dots = null, last = [];
    if (most > 1) {
      line = new THREE.LineSegments2(new THREE.LineSegmentsGeometry(),
        new THREE.LineMaterial({...look, linewidth: trace.width * 0.75}));
      line.geometry.setPositions(new Float32Array(6 * (most - 1)));
      line.frustumCulled = false;
      group.add(line);
    }
    if (trace.markers || most === 1) {
      const size = (trace.markers ? 1.2 : 1.6) * trace.width;  // three.js multiplies by the pixels of a CSS pixel
      const material = new THREE.PointsMaterial({...look, size, sizeAttenuation: false, map: dot, alphaTest: 0.5});
      const geometry = new THREE.BufferGeometry();
      geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(3 * most), 3));
      dots = new THREE.Points(geometry, material);
      dots.frustumCulled = false;
      group.add(dots);
    }
    const finite = p => p.every(Number.isFinite);
    return {
      object: group,
      set(u) {
        last = triples(replayShapes.linePoints(trace, u));
        if (line) {
          const to = line.geometry.attributes.instanceStart.data;
          let count = 0;
          for (let i = 0; i + 1 < last.length; i++)
            if (finite(last[i]) && finite(last[i + 1])) to.array.set([...last[i], ...last[i + 1]], 6 * count++);
          to.needsUpdate = true;
          line.geometry.instanceCount = count;
        }
        if (dots) {
          const shown = last.filter(finite), to = dots.geometry.attributes.position;
          shown.forEach((p, i) => to.array.set(p, 3 * i));
          to.needsUpdate = true;
          dots.geometry.setDrawRange(0, shown.length);
        }
      },
      points: () => last,
    };
  }

  // How far along a ray a mesh is, m; Infinity where the ray misses it. Each triangle is met where t along = a - from + u b + v c.
  function distanceTo(mesh, from, along) {
    mesh.updateMatrixWorld();
    const {position} = mesh.geometry.attributes, index = mesh.geometry.index.array;
    const at = i => new THREE.Vector3().fromBufferAttribute(position, i).applyMatrix4(mesh.matrixWorld);
    let nearest = Infinity;
    for (let k = 0; k < index.length; k += 3) {
      const [a, b, c] = [0, 1, 2].map(i => at(index[k + i]));
      b.sub(a);
      c.sub(a);
      const normal = along.clone().cross(c), det = b.dot(normal);
      if (Math.abs(det) < 1e-15) continue;
      const to = from.clone().sub(a), u = to.dot(normal) / det, across = to.cross(b), v = along.dot(across) / det;
      const t = c.dot(across) / det;
      if (u >= 0 && v >= 0 && u + v <= 1 && t > 0) nearest = Math.min(nearest, t);
    }
    return nearest;
  }

  function roundDot() {
    const canvas = document.createElement("canvas");
    canvas.width = canvas.height = 64;
    const context = canvas.getContext("2d");
    context.fillStyle = "#fff";
    context.beginPath();
    context.arc(32, 32, 30, 0, 2 * Math.PI);
    context.fill();
    return new THREE.CanvasTexture(canvas);
  }

  // A floor that shadows fall on, with a grid whose lines fade away.
  function floorOf(at, centre, reach, cell) {
    const group = new THREE.Group();
    const plane = new THREE.Mesh(new THREE.PlaneGeometry(8 * reach, 8 * reach), new THREE.ShadowMaterial({opacity: 0.28}));
    plane.receiveShadow = true;
    plane.position.set(centre[0], centre[1], at);
    const n = Math.ceil(2.2 * reach / cell), corners = [], colours = [];
    const [x0, y0] = [0, 1].map(k => Math.round(centre[k] / cell) * cell);
    const put = (i, j) => {
      const away = Math.hypot(i, j) / n;
      corners.push(x0 + i * cell, y0 + j * cell, at);
      colours.push(1, 1, 1, 0.8 * Math.max(0, 1 - away * away));
    };
    for (let i = -n; i <= n; i++) for (let j = -n; j < n; j++) { put(i, j); put(i, j + 1); put(j, i); put(j + 1, i); }
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(corners), 3));
    geometry.setAttribute("color", new THREE.BufferAttribute(new Float32Array(colours), 4));
    const grid = new THREE.LineSegments(geometry,
      new THREE.LineBasicMaterial({vertexColors: true, transparent: true, depthWrite: false}));
    group.add(plane, grid);
    return {group, plane, recolour: colour => grid.material.color.set(colour)};
  }

  function stars(far, dot) {
    let seed = 1;
    const random = () => (seed = seed * 16807 % 2147483647) / 2147483647;
    const corners = [], colours = [];
    for (let i = 0; i < 900; i++) {
      const z = 2 * random() - 1, a = 2 * Math.PI * random(), r = Math.sqrt(1 - z * z), bright = 0.25 + 0.75 * random() ** 3;
      corners.push(far * r * Math.cos(a), far * r * Math.sin(a), far * z);
      colours.push(bright, bright, Math.min(1, 1.15 * bright));
    }
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(corners), 3));
    geometry.setAttribute("color", new THREE.BufferAttribute(new Float32Array(colours), 3));
    const points = new THREE.Points(geometry,
      new THREE.PointsMaterial({vertexColors: true, size: 2, sizeAttenuation: false, map: dot, alphaTest: 0.3}));
    points.frustumCulled = false;
    return points;
  }

  // Axes of W in the corner, and a bar as long as it says at the distance of what is looked at.
  function legendOf(element) {
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
    return (camera, perMetre) => {
      const back = camera.quaternion.clone().invert();
      axes.forEach(({line, letter}, i) => {
        const a = new THREE.Vector3(+(i === 0), +(i === 1), +(i === 2)).applyQuaternion(back);
        const [x, y] = [36 + 24 * a.x, 34 - 24 * a.y];
        for (const [key, value] of Object.entries({x1: 36, y1: 34, x2: x, y2: y})) line.setAttribute(key, value);
        letter.setAttribute("x", 36 + 32 * a.x - 3);
        letter.setAttribute("y", 34 - 32 * a.y + 4);
        line.style.opacity = letter.style.opacity = 0.85 + 0.15 * a.z;
      });
      const length = round125(130 / perMetre);
      bar.setAttribute("d", `M12 82v6h${(length * perMetre).toFixed(1)}v-6`);
      text.textContent = lengthText(length);
    };
  }

  const made = (element, {traces, low, high, held, eye, weightless = false, floor = low[2], follow = "", played = false, live = false}) => {
    if (!hasWebGl()) return null;
    const sides = high.map((x, i) => x - low[i]), centre = high.map((x, i) => (x + low[i]) / 2);
    const reach = Math.hypot(...sides) / 2;
    const scene = new THREE.Scene();
    const camera = new THREE.PerspectiveCamera(FIELD * 180 / Math.PI, 1, reach / 100, 60 * reach);
    camera.up.set(0, 0, 1);
    const plain = (played || live) && drawsBySoftware();
    const renderer = new THREE.WebGLRenderer({antialias: !plain, alpha: true});
    renderer.setPixelRatio(plain ? 0.75 : Math.min(devicePixelRatio, 2));
    renderer.shadowMap.enabled = true;
    renderer.shadowMap.type = THREE.PCFShadowMap;
    element.append(renderer.domElement);
    element.classList.toggle("weightless", weightless);
    const controls = new THREE.OrbitControls(camera, renderer.domElement);
    controls.minDistance = reach / 20;
    controls.maxDistance = 12 * reach;
    const ruler = legendOf(element);

    scene.add(new THREE.HemisphereLight("#ffffff", weightless ? "#8f98b0" : "#b9b2a8", 1.7));
    const sun = new THREE.DirectionalLight("#fff6e8", 2.1);
    const from = Math.atan2(eye[1], eye[0]) - 1.2;  // from the viewer's left, lest shadows hide behind what throws them
    sun.position.set(centre[0] + 1.9 * reach * Math.cos(from), centre[1] + 1.9 * reach * Math.sin(from), centre[2] + 2.6 * reach);
    if (played) sun.position.set(centre[0] - 0.02 * reach, centre[1], centre[2] + 3.2 * reach);
    sun.target.position.set(...centre);
    sun.castShadow = true;
    sun.shadow.mapSize.setScalar(plain ? 512 : 2048);
    sun.shadow.bias = plain ? -0.004 : -0.0005;
    sun.shadow.normalBias = reach / 400;
    const span = 1.25 * reach;
    Object.assign(sun.shadow.camera, {left: -span, right: span, bottom: -span, top: span, near: 0.2 * reach, far: 7 * reach});
    scene.add(sun, sun.target);
    // A little below what stands on it: two faces in one plane would flicker.
    const ground = weightless ? null : floorOf(floor - reach / 500, centre, reach, round125(Math.max(...sides) / 6));
    const dot = roundDot();
    scene.add(ground ? ground.group : stars(50 * reach, dot));

    const drawn = traces.flatMap(trace => {
      const shared = {color: trace.colour, transparent: trace.opacity < 1, opacity: trace.opacity};
      const made = trace.parts ? trace.parts.map(part => (part.radii ? tubeOf : bodyOf)(part,
        new THREE.MeshStandardMaterial({...shared, roughness: 0.62, metalness: 0.02, side: THREE.DoubleSide})))
        : [lineOf(trace, dot)];
      return made.map(thing => ({...thing, label: trace.label}));
    });
    for (const {object} of drawn) scene.add(object);

    // What is given up, one after the other, where pictures come late.
    const savings = !live ? [] : [
      () => setPixelRatio(Math.min(renderer.getPixelRatio(), 0.75)),
      () => {
        sun.castShadow = false;
        if (ground) ground.plane.visible = false;
      },
      () => setPixelRatio(0.5),
    ];
    const delays = [];
    function setPixelRatio(ratio) {
      renderer.setPixelRatio(ratio);
      renderer.setSize(element.clientWidth, element.clientHeight, false);
    }
    // Takes how long a picture was waited for, ms; a page that was not seen waited for nothing.
    function economise(delay) {
      if (!savings.length || document.hidden || delay > FORGOTTEN) return;
      delays.push(delay);
      if (delays.length < 6) return;
      const middle = delays.sort((a, b) => a - b)[3];
      delays.length = 0;
      if (middle < LATE) return;
      savings.shift()();
      element.dataset.coarse = Number(element.dataset.coarse ?? 0) + 1;
    }

    let wanted = 0, follows = false, asked = 0;
    const target = new THREE.Vector3(...centre);
    const perMetre = () => element.clientHeight / (2 * Math.tan(FIELD / 2) * camera.position.distanceTo(controls.target));
    function draw() {
      wanted = 0;
      economise(performance.now() - asked);
      api.beforePicture();
      renderer.render(scene, camera);
      ruler(camera, perMetre());
      api.onPicture();
      element.dataset.pictures = Number(element.dataset.pictures ?? 0) + 1;
    }
    const request = () => {
      if (wanted) return;
      asked = performance.now();
      wanted = requestAnimationFrame(draw);
    };

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
      target.set(...centre).addScaledVector(right, x).addScaledVector(over, y);
      controls.target.copy(target);
      camera.position.copy(target).addScaledVector(back, Math.max(far, farther));
      controls.update();
      request();
    }

    function place(label) {
      const points = drawn.filter(d => d.label === label).flatMap(d => d.points()).filter(p => p.every(Number.isFinite));
      if (!points.length) return null;
      const sum = points.reduce((a, p) => [a[0] + p[0], a[1] + p[1], a[2] + p[2]], [0, 0, 0]);
      return new THREE.Vector3(...sum).divideScalar(points.length);
    }

    function resize() {
      const {clientWidth: wide, clientHeight: high} = element;
      if (!wide || !high) return;
      camera.aspect = wide / high;
      camera.updateProjectionMatrix();
      renderer.setSize(wide, high, false);
      request();
    }

    const api = {
      views: ["start", ...Object.keys(VIEWS)],
      canvas: renderer.domElement,
      camera,
      beforePicture() {},
      onPicture() {},
      place(u) { for (const thing of drawn) thing.set(u); },
      wake: request,
      show(u) {
        api.place(u);
        const there = follows && place(follow);
        if (there) {
          camera.position.add(there).sub(controls.target);
          controls.target.copy(there);
          controls.update();
        }
        request();
      },
      lookFrom,
      turn: view => lookFrom(VIEWS[view]?.(eye) ?? eye),
      get follows() { return follows; },
      set follows(yes) { follows = Boolean(yes && follow); },
      setVisible(label, yes) {
        for (const thing of drawn) if (thing.label === label) thing.object.visible = yes;
        request();
      },
      visible: label => drawn.filter(d => d.label === label).map(d => d.object.visible),
      points: label => drawn.filter(d => d.label === label).flatMap(d => d.points()),
      recolour() {
        ground?.recolour(getComputedStyle(element).getPropertyValue("--scene-grid").trim());
        request();
      },
      view() {
        const [x, y, z] = camera.position.clone().sub(controls.target).toArray();
        return {azimuth: Math.atan2(y, x), elevation: Math.atan2(z, Math.hypot(x, y)), distance: Math.hypot(x, y, z)};
      },
      looksAt: () => controls.target.toArray(),
      pick(x, y, labels) {
        const {left, top, width, height} = renderer.domElement.getBoundingClientRect();
        const there = new THREE.Vector3(2 * (x - left) / width - 1, 1 - 2 * (y - top) / height, 0.5).unproject(camera);
        const from = camera.position, along = there.sub(from).normalize();
        let nearest = Infinity, seen = null;
        for (const {object, label} of drawn) {
          const far = object.isMesh && object.visible && object.scale.x ? distanceTo(object, from, along) : Infinity;
          if (far < nearest) [nearest, seen] = [far, label];
        }
        return labels.includes(seen) ? {label: seen, point: from.clone().addScaledVector(along, nearest).toArray()} : null;
      },
      toBody(label, point) {
        const {object} = drawn.find(d => d.label === label);
        return object.worldToLocal(new THREE.Vector3(...point)).toArray();
      },
      toWorld(label, point) {
        const {object} = drawn.find(d => d.label === label);
        return object.localToWorld(new THREE.Vector3(...point)).toArray();
      },
      toPixels(point) {
        camera.updateMatrixWorld();  // it may have been turned since the last picture
        const {x, y} = new THREE.Vector3(...point).project(camera), {clientWidth: wide, clientHeight: high} = element;
        return [(x + 1) / 2 * wide, (1 - y) / 2 * high];
      },
      acrossView(right, up) {
        const [x, y] = [0, 1].map(k => new THREE.Vector3().setFromMatrixColumn(camera.matrixWorld, k));
        return x.multiplyScalar(right).addScaledVector(y, up).toArray();
      },
      viewpoint: () => ({position: camera.position.toArray(), target: controls.target.toArray()}),
      lookAs({position, target}) {
        camera.position.set(...position);
        controls.target.set(...target);
        controls.update();
        request();
      },
      dispose() {
        cancelAnimationFrame(wanted);
        sizes.disconnect();
        controls.dispose();
        renderer.dispose();
        renderer.forceContextLoss();
      },
    };
    controls.addEventListener("change", request);
    const sizes = new ResizeObserver(resize);
    sizes.observe(element);
    resize();
    api.show(0);
    api.turn("start");
    api.recolour();
    return api;
  };
  made.longestTrail = LONGEST_TRAIL - 1;
  return made;
})();
