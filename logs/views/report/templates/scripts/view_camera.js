// Where the 3-D view is seen from: angles, distance and place, and what that makes of a point.

function makeCamera(scene, frame) {
  const stretches = [1, 1.5, 2, 3, 4, 6];
  const [from, to] = [scene.plan[0], scene.plan[scene.plan.length - 1]];
  // Seen across the way from start to destination, from its southern side.
  let across = Math.atan2(to[1] - from[1], to[0] - from[0]) - Math.PI / 2;
  if (Math.sin(across) > 0) across += Math.PI;
  const narrow = Math.min(frame.east - frame.west, frame.north - frame.south) / frame.size;
  const home = { azimuth: across, elevation: 0.62, far: 0.9 + 0.44 * Math.min(1, narrow / 0.7), e: 0, n: 0, stretch: scene.stretch };
  const now = { ...home };

  function multiply(a, b) {
    const out = new Float32Array(16);
    for (let c = 0; c < 4; c++) for (let r = 0; r < 4; r++)
      out[4 * c + r] = a[r] * b[4 * c] + a[4 + r] * b[4 * c + 1] + a[8 + r] * b[4 * c + 2] + a[12 + r] * b[4 * c + 3];
    return out;
  }
  function dot(a, b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
  // How far away the middle is, in the view's units: farther in a narrow picture.
  function distance(aspect) { return now.far * (aspect < 1.25 ? 1.25 / aspect : 1); }
  // The matrix from the view's units to the screen's, columns one after the other.
  function matrix(aspect) {
    const ce = Math.cos(now.elevation), se = Math.sin(now.elevation);
    const ca = Math.cos(now.azimuth), sa = Math.sin(now.azimuth);
    const forward = [-ca * ce, -sa * ce, -se], right = [-sa, ca, 0], up = [-ca * se, -sa * se, ce], away = distance(aspect);
    const middle = [now.e, now.n, now.stretch * 0.35 * (frame.high - frame.low) / frame.size];
    const eye = middle.map((value, axis) => value - forward[axis] * away);
    const look = [
      right[0], up[0], -forward[0], 0, right[1], up[1], -forward[1], 0, right[2], up[2], -forward[2], 0,
      -dot(right, eye), -dot(up, eye), dot(forward, eye), 1,
    ];
    const lens = 1 / Math.tan(0.36), near = away * 0.02, far = away + 4;
    return multiply([
      lens / aspect, 0, 0, 0, 0, lens, 0, 0, 0, 0, (far + near) / (near - far), -1, 0, 0, 2 * far * near / (near - far), 0,
    ], look);
  }
  // A point (m) on a screen of so many pixels; null behind the eye.
  function project(m, point, width, height) {
    const [x, y, up] = frame.put(point), z = up * now.stretch;
    const w = m[3] * x + m[7] * y + m[11] * z + m[15];
    if (w <= 0.001) return null;
    return [
      ((m[0] * x + m[4] * y + m[8] * z + m[12]) / w + 1) / 2 * width,
      (1 - (m[1] * x + m[5] * y + m[9] * z + m[13]) / w) / 2 * height,
    ];
  }
  function within(value, low, high) { return Math.min(Math.max(value, low), high); }
  function turn(azimuth, elevation) {
    now.azimuth -= azimuth;
    now.elevation = within(now.elevation + elevation, 0.03, 1.55);
  }
  function zoom(by) { now.far = within(now.far * by, 0.12, 4); }
  // By pixels of a picture so many of them high.
  function pan(dx, dy, height) {
    const k = now.far / height, ca = Math.cos(now.azimuth), sa = Math.sin(now.azimuth);
    now.e = within(now.e + k * (sa * dx - ca * dy), -0.6, 0.6);
    now.n = within(now.n - k * (ca * dx + sa * dy), -0.6, 0.6);
  }
  return {
    matrix, project, distance, turn, zoom, pan,
    stretch: () => now.stretch,
    nextStretch: () => { now.stretch = stretches[(stretches.indexOf(now.stretch) + 1) % stretches.length]; },
    goHome: () => Object.assign(now, home),
    fromAbove: () => { now.azimuth = -Math.PI / 2; now.elevation = 1.55; },
    fromTheSide: () => { now.elevation = 0.12; },
  };
}
