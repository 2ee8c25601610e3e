// Makes what a scene draws, as three.js objects; scene.js shows them.
//   sceneObjects.createTrace(trace, dot, hasGhost)   [{label, object, setFrame, worldPoints}, ...]: the bodies and tubes of a
//                                          trace of replay_section.py, which may shine through what hides them, or its line
//     object             of three.js, to be added to a scene
//     setFrame(u)        moves it to where it is u frames after the first
//     worldPoints()      [[x, y, z], ...] of its points in W, m
//   sceneObjects.createFloor(height, centre, reach, cell)   {group, plane, setGridColour}: a floor that shadows fall on, and
//                                          a grid with cells so wide, m
//   sceneObjects.createStars(distance, dot)
//   sceneObjects.createDotTexture()        a round dot, for `dot`; a scene has its own, as it keeps its renderer in memory
//   sceneObjects.distanceAlong(mesh, origin, direction)     how far along a ray it hits a mesh, m; Infinity where it misses
//   sceneObjects.maxTrailPoints            of a way that grows
"use strict";
const sceneObjects = (() => {
  const MAX_TRAIL_POINTS = 4000;
  const GREATER_DEPTH = 6;  // THREE.GreaterDepth, which three.min.js has without its name
  const SHARP = Math.cos(35 * Math.PI / 180);  // of the angle between two faces from which on their edge is drawn

  function createSolidMaterial({colour, opacity}) {
    return new THREE.MeshStandardMaterial({
      color: colour, transparent: opacity < 1, opacity, roughness: 0.62, metalness: 0.02, side: THREE.DoubleSide,
    });
  }

  // The same surface once more, faint, where something lies before it.
  function createGhost({geometry}, {colour}) {
    const material = createSolidMaterial({colour, opacity: 0.35});
    const ghost = new THREE.Mesh(geometry, Object.assign(material, {depthFunc: GREATER_DEPTH, depthWrite: false}));
    ghost.frustumCulled = false;
    return ghost;
  }

  // A body keeps its geometry and is moved; p_WB that is not finite hides it.
  function createBody(part, material) {
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(Float32Array.from(part.vertices), 3));
    geometry.setIndex(Array.from(part.triangles));
    geometry.computeVertexNormals();
    const mesh = new THREE.Mesh(geometry, material);
    mesh.castShadow = mesh.receiveShadow = true;
    mesh.add(createEdges(part, material));
    return {
      object: mesh,
      setFrame(u) {
        const p = replayShapes.interpolate(part.p, 3, u);
        const shown = p.every(Number.isFinite);
        mesh.scale.setScalar(shown ? 1 : 0);
        if (!shown) return;
        mesh.position.set(...p);
        if (!part.q) return;
        const [w, x, y, z] = replayShapes.interpolate(part.q, 4, u);
        mesh.quaternion.set(x, y, z, w).normalize();
      },
      worldPoints: () => {
        mesh.updateMatrixWorld();
        const v = part.vertices;
        return Array.from({length: v.length / 3}, (_, i) =>
          new THREE.Vector3(v[3 * i], v[3 * i + 1], v[3 * i + 2]).applyMatrix4(mesh.matrixWorld).toArray());
      },
    };
  }

  // The sharp edges of a body, a little darker, so that faces of like brightness are told apart. Its triangles may
  // share no vertices: those at the same place are the same.
  function createEdges({vertices: v, triangles}, material) {
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
  function createTube(part, material) {
    const geometry = new THREE.BufferGeometry(), positions = new Float32Array(3 * replayShapes.tubePointCount(part));
    geometry.setAttribute("position", new THREE.BufferAttribute(positions, 3));
    geometry.setIndex(replayShapes.tubeTriangles(part));
    const mesh = new THREE.Mesh(geometry, material);
    mesh.castShadow = mesh.receiveShadow = true;
    mesh.frustumCulled = false;
    return {
      object: mesh,
      setFrame(u) {
        if (mesh.userData.u === u && mesh.userData.of === part.points) return;
        Object.assign(mesh.userData, {u, of: part.points});
        mesh.scale.setScalar(replayShapes.writeTube(part, u, positions) ? 1 : 0);
        geometry.attributes.position.needsUpdate = true;
        geometry.computeVertexNormals();
      },
      worldPoints: () => triples(positions),
    };
  }

  const triples = flat => Array.from({length: flat.length / 3}, (_, i) => Array.from(flat.slice(3 * i, 3 * i + 3)));

  // A line of pixels' width with gaps where a point is not finite, and dots where the trace asks for markers.
  function createLine(trace, dot) {
    const group = new THREE.Group();
    const capacity = trace.trail ? Math.max(trace.points.length / 3 + 1, MAX_TRAIL_POINTS) : trace.n;
    const colouring = {color: trace.colour, transparent: trace.opacity < 1, opacity: trace.opacity};
    let line = null, dots = null, last = [];
    if (capacity > 1) {
      line = new THREE.LineSegments2(new THREE.LineSegmentsGeometry(),
        new THREE.LineMaterial({...colouring, linewidth: trace.width * 0.75}));
      line.geometry.setPositions(new Float32Array(6 * (capacity - 1)));
      line.frustumCulled = false;
      group.add(line);
    }
    if (trace.markers || capacity === 1) {
      const size = (trace.markers ? 1.2 : 1.6) * trace.width;  // three.js multiplies by the pixels of a CSS pixel
      const material = new THREE.PointsMaterial({...colouring, size, sizeAttenuation: false, map: dot, alphaTest: 0.5});
      const geometry = new THREE.BufferGeometry();
      geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(3 * capacity), 3));
      dots = new THREE.Points(geometry, material);
      dots.frustumCulled = false;
      group.add(dots);
    }
    const finite = p => p.every(Number.isFinite);
    return {
      object: group,
      setFrame(u) {
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
      worldPoints: () => last,
    };
  }

  // A triangle is hit where origin + t direction = a + u b + v c.
  function distanceAlong(mesh, origin, direction) {
    mesh.updateMatrixWorld();
    const {position} = mesh.geometry.attributes, index = mesh.geometry.index.array;
    const at = i => new THREE.Vector3().fromBufferAttribute(position, i).applyMatrix4(mesh.matrixWorld);
    let nearest = Infinity;
    for (let k = 0; k < index.length; k += 3) {
      const [a, b, c] = [0, 1, 2].map(i => at(index[k + i]));
      b.sub(a);
      c.sub(a);
      const normal = direction.clone().cross(c), det = b.dot(normal);
      if (Math.abs(det) < 1e-15) continue;
      const to = origin.clone().sub(a), u = to.dot(normal) / det, across = to.cross(b), v = direction.dot(across) / det;
      const t = c.dot(across) / det;
      if (u >= 0 && v >= 0 && u + v <= 1 && t > 0) nearest = Math.min(nearest, t);
    }
    return nearest;
  }

  function createDotTexture() {
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
  function createFloor(height, centre, reach, cell) {
    const group = new THREE.Group();
    const plane = new THREE.Mesh(new THREE.PlaneGeometry(8 * reach, 8 * reach), new THREE.ShadowMaterial({opacity: 0.28}));
    plane.receiveShadow = true;
    plane.position.set(centre[0], centre[1], height);
    const n = Math.ceil(2.2 * reach / cell), corners = [], colours = [];
    const [x0, y0] = [0, 1].map(k => Math.round(centre[k] / cell) * cell);
    const put = (i, j) => {
      const away = Math.hypot(i, j) / n;
      corners.push(x0 + i * cell, y0 + j * cell, height);
      colours.push(1, 1, 1, 0.8 * Math.max(0, 1 - away * away));
    };
    for (let i = -n; i <= n; i++) for (let j = -n; j < n; j++) { put(i, j); put(i, j + 1); put(j, i); put(j + 1, i); }
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(corners), 3));
    geometry.setAttribute("color", new THREE.BufferAttribute(new Float32Array(colours), 4));
    const grid = new THREE.LineSegments(geometry,
      new THREE.LineBasicMaterial({vertexColors: true, transparent: true, depthWrite: false}));
    group.add(plane, grid);
    return {group, plane, setGridColour: colour => grid.material.color.set(colour)};
  }

  function createStars(distance, dot) {
    let seed = 1;
    const random = () => (seed = seed * 16807 % 2147483647) / 2147483647;
    const corners = [], colours = [];
    for (let i = 0; i < 900; i++) {
      const z = 2 * random() - 1, a = 2 * Math.PI * random(), r = Math.sqrt(1 - z * z), bright = 0.25 + 0.75 * random() ** 3;
      corners.push(distance * r * Math.cos(a), distance * r * Math.sin(a), distance * z);
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

  function createTrace(trace, dot, hasGhost) {
    const objects = trace.parts
      ? trace.parts.map(part => (part.radii ? createTube : createBody)(part, createSolidMaterial(trace)))
      : [createLine(trace, dot)];
    if (hasGhost && trace.parts) for (const {object} of objects) object.add(createGhost(object, trace));
    return objects.map(of => ({label: trace.label, ...of}));
  }

  return {createTrace, createFloor, createStars, createDotTexture, distanceAlong, maxTrailPoints: MAX_TRAIL_POINTS - 1};
})();
