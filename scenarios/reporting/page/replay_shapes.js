// Where the points of a replay's lines, tubes and rigid bodies are, u frames after the first; u may lie between two.
// What has a single row stays where it is. Functions write x, y, z of points into `to`, from number `at` on.
"use strict";
const replayShapes = (() => {
  const sides = 12;
  const caps = [[-1, 0], [-Math.SQRT1_2, Math.SQRT1_2]];  // of a rounded end: along the axis, from the axis

  // A row of `width` numbers between the rows of a track.
  function between(track, width, u) {
    const rows = track.length / width;
    const k = Math.min(Math.floor(u), rows - 1), f = k + 1 < rows ? u - k : 0;
    const row = new Float64Array(width);
    for (let i = 0; i < width; i++) {
      const a = track[k * width + i];
      row[i] = f ? a + f * (track[(k + 1) * width + i] - a) : a;
    }
    return row;
  }

  function put(to, at, x, y, z) {
    to.x[at] = x; to.y[at] = y; to.z[at] = z;
  }

  // The columns of R_WB of a quaternion, scalar first, of any length.
  function rotation(q) {
    const n = Math.hypot(...q) || 1;
    const [w, x, y, z] = q.map(c => c / n);
    return [
      1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y),
      2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x),
      2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y),
    ];
  }

  // p_WP = p_WB + R_WB p_BP. A body without a position shrinks to a point out of sight.
  function body(part, u, to, at, away) {
    const v = part.vertices, p = between(part.p, 3, u);
    const R = part.q ? rotation(between(part.q, 4, u)) : [1, 0, 0, 0, 1, 0, 0, 0, 1];
    const shown = p.every(Number.isFinite);
    for (let i = 0, n = v.length / 3; i < n; i++) {
      const x = v[3 * i], y = v[3 * i + 1], z = v[3 * i + 2];
      if (shown)
        put(to, at + i, p[0] + R[0] * x + R[3] * y + R[6] * z, p[1] + R[1] * x + R[4] * y + R[7] * z,
          p[2] + R[2] * x + R[5] * y + R[8] * z);
      else put(to, at + i, ...away);
    }
  }

  const minus = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  function unit(a) {
    const n = Math.hypot(...a);
    return n > 1e-9 ? a.map(c => c / n) : null;
  }

  // Rings about each point, square to the tube, that do not twist; and at both ends those that round it off.
  function tube(part, u, to, at, away) {
    const n = part.radii.length, row = between(part.points, 3 * n, u);
    const points = Array.from({length: n}, (_, i) => [row[3 * i], row[3 * i + 1], row[3 * i + 2]]);
    if (!row.every(Number.isFinite)) {
      for (let i = 0; i < rings(part) * sides; i++) put(to, at + i, ...away);
      return;
    }
    let along = [0, 0, 1], across = null;
    for (let i = 0; i < n; i++) {
      along = unit(minus(points[Math.min(i + 1, n - 1)], points[Math.max(i - 1, 0)])) ?? along;
      const least = along.map(Math.abs).indexOf(Math.min(...along.map(Math.abs)));
      across ??= cross(along, [0, 1, 2].map(k => +(k === least)));
      const left = unit(cross(along, across)) ?? [1, 0, 0];
      across = cross(left, along);
      const r = part.radii[i];
      const here = [[0, 1]];
      if (i === 0) here.unshift(...caps);
      if (i === n - 1) here.push(...caps.map(([a, w]) => [-a, w]).reverse());
      for (const [ahead, wide] of here) {
        for (let s = 0; s < sides; s++, at++) {
          const a = 2 * Math.PI * s / sides, c = r * wide * Math.cos(a), d = r * wide * Math.sin(a);
          put(to, at, ...[0, 1, 2].map(k => points[i][k] + r * ahead * along[k] + c * across[k] + d * left[k]));
        }
      }
    }
  }

  const rings = part => part.radii.length + 2 * caps.length;

  // How many points a part of a mesh has, and its triangles.
  function count(part) {
    return part.radii ? rings(part) * sides : part.vertices.length / 3;
  }
  function triangles(part) {
    if (!part.radii) return part.triangles;
    const found = [];
    for (let i = 0; i + 1 < rings(part); i++) {
      for (let s = 0; s < sides; s++) {
        const a = i * sides + s, b = i * sides + (s + 1) % sides;
        found.push(a, b, a + sides, b, b + sides, a + sides);
      }
    }
    return found;
  }

  // x, y, z of a trace; of a trail, the way of its point until u.
  function places(trace, u, away) {
    if (trace.trail) {
      const end = Math.floor(u), last = between(trace.points, 3, u);
      const axis = k => [...Array.from({length: end + 1}, (_, i) => trace.points[3 * i + k]), last[k]];
      return {x: axis(0), y: axis(1), z: axis(2)};
    }
    const total = trace.parts ? trace.parts.reduce((sum, p) => sum + count(p), 0) : trace.n;
    const to = {x: new Float64Array(total), y: new Float64Array(total), z: new Float64Array(total)};
    if (!trace.parts) {
      const row = between(trace.points, 3 * trace.n, u);
      for (let i = 0; i < trace.n; i++) put(to, i, row[3 * i], row[3 * i + 1], row[3 * i + 2]);
      return to;
    }
    let at = 0;
    for (const part of trace.parts) {
      (part.radii ? tube : body)(part, u, to, at, away);
      at += count(part);
    }
    return to;
  }

  function moves(trace) {
    if (trace.trail) return true;
    if (!trace.parts) return trace.points.length > 3 * trace.n;
    return trace.parts.some(p => p.radii ? p.points.length > 3 * p.radii.length
      : p.p.length > 3 || p.q && p.q.length > 4);
  }

  return {count, triangles, places, moves};
})();
