// Where the points of a replay's lines and tubes are, and its bodies' poses, u frames after the first; u may lie between
// two. What has a single row stays where it is.
//   replayShapes.unpack(run)         makes arrays of what replay_section.py has packed; returns those that hold places, in
//                                    the order of the scene: [{of, key}, ...]
//   replayShapes.frameAt(time, t)    the frame at time t, s, of frames at those times
//   replayShapes.timeText(run, t)    time and phase
//   replayShapes.interpolate(track, width, u)   a row of `width` numbers between the rows of a track
//   replayShapes.writeTube(part, u, positions)  writes the points of a tube's surface; false where it is hidden
"use strict";
const replayShapes = (() => {
  const sides = 16;
  const caps = [[-1, 0.02], [-0.87, 0.5], [-0.5, 0.87]];  // of a rounded end: along the axis, from the axis

  function unpack(run) {
    const places = [];
    const unpackArray = (of, key) => {
      if (!of[key]) return;
      of[key] = page.array(of[key]);
      if (["points", "p", "q"].includes(key)) places.push({of, key});
    };
    for (const trace of run.traces) {
      unpackArray(trace, "points");
      for (const part of trace.parts ?? []) for (const key of ["points", "vertices", "triangles", "p", "q"]) unpackArray(part, key);
    }
    return places;
  }

  function frameAt(time, t) {
    const last = time.length - 1;
    if (!last || t <= time[0]) return 0;
    let low = 0, high = last;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (time[middle] <= t) low = middle; else high = middle;
    }
    return Math.min(last, low + (t - time[low]) / (time[high] - time[low]));
  }

  function timeText(run, t) {
    const phase = run.phases.filter(([begin]) => begin <= t + 1e-6).at(-1)?.[1];
    return `${t.toFixed(1)} s${phase ? ", " + phase : ""}`;
  }

  function interpolate(track, width, u) {
    const rows = track.length / width;
    const k = Math.min(Math.floor(u), rows - 1), f = k + 1 < rows ? u - k : 0;
    const row = new Float64Array(width);
    for (let i = 0; i < width; i++) {
      const a = track[k * width + i];
      row[i] = f ? a + f * (track[(k + 1) * width + i] - a) : a;
    }
    return row;
  }

  const minus = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  function unit(a) {
    const n = Math.hypot(...a);
    return n > 1e-9 ? a.map(c => c / n) : null;
  }

  // Writes rings about each point, square to the tube, that do not twist, and at both ends those that round it off;
  // returns false, and writes nothing, where a point is not finite.
  function writeTube(part, u, positions) {
    const n = part.radii.length, row = interpolate(part.points, 3 * n, u);
    if (!row.every(Number.isFinite)) return false;
    const points = Array.from({length: n}, (_, i) => [row[3 * i], row[3 * i + 1], row[3 * i + 2]]);
    let at = 0, along = [0, 0, 1], across = null;
    for (let i = 0; i < n; i++) {
      along = unit(minus(points[Math.min(i + 1, n - 1)], points[Math.max(i - 1, 0)])) ?? along;
      const least = along.map(Math.abs).indexOf(Math.min(...along.map(Math.abs)));
      across ??= unit(cross(along, [0, 1, 2].map(k => +(k === least))));
      const left = unit(cross(along, across)) ?? [1, 0, 0];
      across = cross(left, along);
      const r = part.radii[i];
      const here = [[0, 1]];
      if (i === 0) here.unshift(...caps);
      if (i === n - 1) here.push(...caps.map(([a, w]) => [-a, w]).reverse());
      for (const [ahead, wide] of here) {
        for (let s = 0; s < sides; s++) {
          const a = 2 * Math.PI * s / sides, c = r * wide * Math.cos(a), d = r * wide * Math.sin(a);
          for (let k = 0; k < 3; k++) positions[at++] = points[i][k] + r * ahead * along[k] + c * across[k] + d * left[k];
        }
      }
    }
    return true;
  }

  const rings = part => part.radii.length + 2 * caps.length;

  // How many points a tube's surface has, and its triangles.
  const tubePointCount = part => rings(part) * sides;
  function tubeTriangles(part) {
    const found = [];
    for (let i = 0; i + 1 < rings(part); i++) {
      for (let s = 0; s < sides; s++) {
        const a = i * sides + s, b = i * sides + (s + 1) % sides;
        found.push(a, b, a + sides, b, b + sides, a + sides);
      }
    }
    return found;
  }

  // The points of a line, x, y, z after each other; of a trail, the way of its point until u.
  function linePoints(trace, u) {
    if (!trace.trail) return interpolate(trace.points, 3 * trace.n, u);
    const end = Math.min(Math.floor(u), trace.points.length / 3 - 1);
    return Float64Array.from([...trace.points.slice(0, 3 * (end + 1)), ...interpolate(trace.points, 3, u)]);
  }

  return {unpack, frameAt, timeText, interpolate, tubePointCount, tubeTriangles, writeTube, linePoints};
})();
