// The pose of a hand from its landmarks in a camera's picture, as MediaPipe's hand landmarker gives them; arithmetic alone.
//   handLandmarks.pose(landmarks, world, {width, height, right})   {p_CH, R_CH, spread, angles}, or null where they tell none
//     landmarks    21 points of the picture, {x, y} from 0 to 1 of its width and height
//     world        the same points in space, {x, y, z} in m, about the hand's middle, along the axes of C
//     width, height, right    of the picture, in pixels; whether it is a right hand
//   handLandmarks.AXES     of a view that nothing is seen in
//   handLandmarks.guide({start, right})   turns such samples, one after the other, into where a hand is wanted
//     guide.take(t, landmarks, world, size, axes)   {p_WH, q_WH, closed, angles}, or null; t in s, axes of the view in W;
//       a hand that is closed at the start, as around an object, stays so, without angles, until a fist has been seen
// C is the camera's frame: x to the right of the picture, y down, z away from the camera. H is the hand's, see
// hand_kinematics.py: x along straight fingers, y to a right hand's thumb, z out of the back of the hand.
// The picture is a pinhole's, distortion is left out. A camera on a screen looks at who looks at the screen, so the right
// of the view is -x of C, its top -y, and towards the eye is z: what is drawn follows the hand as a hand in the scene.
"use strict";
const handLandmarks = (() => {
  const WRIST = 0, KNUCKLES = [5, 9, 13, 17], TIPS = [8, 12, 16, 20], PALM = [WRIST, ...KNUCKLES];
  // Assumed: wrist to middle knuckle of an adult, m, and the field of view over the picture's longer side, degrees. A hand
  // that is 10 % longer seems 10 % nearer, and its motions 10 % smaller.
  const PALM_LENGTH = 0.09, FIELD = 60;
  const PALM_MIDDLE = [-0.03, 0, 0.036];  // in H, m, as in hand_kinematics.py
  // Of the mean distance of fingertips from the palm's middle, in palm lengths: about 1.35 of a straight hand, 0.4 of a fist.
  const CLOSES = 0.75, OPENS = 1.0;
  // The one-euro filter of Casiez, Roussel and Vogel 2012: a low pass whose cutoff is `still` Hz at rest and grows by `quick`
  // times the speed, which is itself low-passed at 1 Hz. At 0.5 m/s the palm lags by 21 ms, at rest by 0.1 s.
  const FILTERS = {p: {still: 1.5, quick: 12}, q: {still: 1.5, quick: 4}, angles: {still: 1.5, quick: 1}}, SPEED_CUTOFF = 1;
  const AXES = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
  const LOST = 0.5;  // s without a hand after which it may come back elsewhere, as a mouse that was lifted

  const sub = (a, b) => a.map((x, i) => x - b[i]), dot = (a, b) => a.reduce((sum, x, i) => sum + x * b[i], 0);
  const norm = a => Math.sqrt(dot(a, a)), scaled = (s, a) => a.map(x => s * x), added = (a, b) => a.map((x, i) => x + b[i]);
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const mean = points => scaled(1 / points.length, points.reduce(added));
  const between = (a, b) => Math.atan2(norm(cross(a, b)), dot(a, b));
  const bent = angle => Math.min(Math.max(angle, 0), Math.PI / 2);

  // Axes of H from the palm's plane; as columns. Of a left hand, y is away from its thumb: the hand that is led is a right one.
  function axesOf(world, right) {
    const ahead = sub(mean([world[5], world[17]]), world[WRIST]), aside = sub(world[5], world[17]);
    const x = scaled(1 / norm(ahead), ahead);
    const across = sub(aside, scaled(dot(aside, x), x));
    const y = scaled((right ? 1 : -1) / norm(across), across);
    return [x, y, cross(x, y)];
  }

  // Where the origin of `points`, m, is in C: with its direction known, the projections of all points are linear in it,
  // t_x - a t_z = a Z - X and t_y - b t_z = b Z - Y, by least squares. Depth is from how wide the points are apart.
  function translation(points, rays) {
    const c = points.map(([X, Y, Z], i) => [rays[i][0] * Z - X, rays[i][1] * Z - Y]);
    const rays0 = mean(rays), c0 = mean(c);
    let above = 0, below = 0;
    rays.forEach((ray, i) => {
      const from = sub(ray, rays0);
      above -= dot(from, sub(c[i], c0));
      below += dot(from, from);
    });
    const z = above / below;
    return [c0[0] + rays0[0] * z, c0[1] + rays0[1] * z, z];
  }

  // The 14 joints: of a finger, how far its first bone is bent out of the palm's plane, then from bone to bone.
  function jointAngles(world, [x, , z]) {
    const bones = (...at) => at.slice(1).map((to, i) => sub(world[to], world[at[i]]));
    const [t0, t1, t2] = bones(1, 2, 3, 4);
    const fingers = KNUCKLES.flatMap(at => {
      const [b0, b1, b2] = bones(at, at + 1, at + 2, at + 3);
      return [Math.atan2(-dot(b0, z), dot(b0, x)), between(b0, b1), between(b1, b2)];
    });
    return [between(t0, t1), between(t1, t2), ...fingers].map(bent);
  }

  function pose(landmarks, world, {width, height, right}) {
    if (landmarks?.length !== 21 || world?.length !== 21) return null;
    const given = world.map(({x, y, z}) => [x, y, z]), length = norm(sub(given[9], given[WRIST]));
    const points = given.map(point => scaled(PALM_LENGTH / length, point));
    const focal = Math.max(width, height) / 2 / Math.tan(FIELD * Math.PI / 360);
    const rays = PALM.map(i => [(landmarks[i].x - 0.5) * width / focal, (landmarks[i].y - 0.5) * height / focal]);
    const R_CH = axesOf(points, right), t = translation(PALM.map(i => points[i]), rays);
    const palm = mean([points[WRIST], mean(KNUCKLES.map(i => points[i]))]);
    const toPalm = PALM_MIDDLE.map((_, i) => dot(PALM_MIDDLE, R_CH.map(axis => axis[i])));
    const found = {
      p_CH: sub(added(palm, t), toPalm),
      R_CH,
      spread: TIPS.reduce((sum, i) => sum + norm(sub(points[i], palm)), 0) / TIPS.length / PALM_LENGTH,
      angles: jointAngles(points, R_CH),
    };
    const finite = [...found.p_CH, ...R_CH.flat(), found.spread, ...found.angles].every(Number.isFinite);
    return finite && t[2] > 0 ? found : null;
  }

  // The quaternion, scalar first, of a rotation whose columns are given; by its largest element, which loses no digits.
  function quaternion([[xx, xy, xz], [yx, yy, yz], [zx, zy, zz]]) {
    const squares = [1 + xx + yy + zz, 1 + xx - yy - zz, 1 - xx + yy - zz, 1 - xx - yy + zz];
    const rows = [
      [squares[0], yz - zy, zx - xz, xy - yx], [yz - zy, squares[1], xy + yx, zx + xz],
      [zx - xz, xy + yx, squares[2], yz + zy], [xy - yx, zx + xz, yz + zy, squares[3]],
    ];
    const row = rows[squares.indexOf(Math.max(...squares))];
    return scaled(1 / norm(row), row);
  }

  function oneEuro({still, quick}) {
    const weight = (cutoff, dt) => 1 / (1 + 1 / (2 * Math.PI * cutoff * dt));
    let value = null, rate = null;
    return (given, dt) => {
      if (!value) [value, rate] = [given, given.map(() => 0)];
      else {
        const to = sub(given, value);
        rate = added(rate, scaled(weight(SPEED_CUTOFF, dt), sub(scaled(1 / dt, to), rate)));
        value = added(value, scaled(weight(still + quick * norm(rate), dt), to));
      }
      return value;
    };
  }

  function guide({start, right = true}) {
    let wanted = start.p_WH, closed = start.closed, last = -Infinity, origin = null, filters = {}, q = null;
    let holds = start.closed;  // what the person has not taken over yet by a fist

    function take(t, landmarks, world, size, axes) {
      const seen = pose(landmarks, world, {...size, right});
      if (!seen || !(t > last)) return null;
      const inW = ([x, y, z]) => added(added(scaled(-x, axes[0]), scaled(-y, axes[1])), scaled(z, axes[2]));
      const there = inW(seen.p_CH);
      if (t - last > LOST) {  // it goes on from where the hand is wanted, wherever in the picture it is seen
        origin = sub(wanted, there);
        q = null;
        for (const [name, constants] of Object.entries(FILTERS)) filters[name] = oneEuro(constants);
      }
      const dt = t - last, turned = quaternion(seen.R_CH.map(inW));
      const near = q && dot(q, turned) < 0 ? scaled(-1, turned) : turned;
      const p = filters.p(added(there, origin), dt), raw = filters.q(near, dt), angles = filters.angles(seen.angles, dt);
      const from = sub(p, start.centre), far = norm(from);
      wanted = far > start.radius ? added(start.centre, scaled(start.radius / far, from)) : p;
      q = scaled(1 / norm(raw), raw);
      holds &&= seen.spread >= CLOSES;
      closed = holds || seen.spread < (closed ? OPENS : CLOSES);
      last = t;
      return {p_WH: wanted, q_WH: q, closed, ...(holds ? {} : {angles})};
    }
    return {take};
  }
  return {pose, guide, AXES, PALM_LENGTH, FIELD, CLOSES, OPENS};
})();
