// Shapes of the 3-D view in its own units: the longer side of the area is 1, heights are on the same scale.

function makeFrame(scene, ground) {
  const [[west, east], [south, north]] = scene.bounds;
  const size = Math.max(east - west, north - south, 1), ups = scene.plan.map((point) => point[2]);
  let low = Math.min(...ups), high = Math.max(...ups);
  if (ground) { low = Math.min(low, ground.low); high = Math.max(high, ground.high); }
  const middle = [(west + east) / 2, (south + north) / 2];
  return {
    west, east, south, north, size, low, high, middle,
    put: (point) => [(point[0] - middle[0]) / size, (point[1] - middle[1]) / size, (point[2] - low) / size],
  };
}

function groundShape(ground, frame, tint) {
  const { columns, rows } = ground, at = [], normal = [], colours = [], index = [];
  const span = Math.max(ground.high - ground.low, 1);
  for (let r = 0; r < rows; r++) for (let c = 0; c < columns; c++) {
    const k = r * columns + c, height = ground.crossing(c, r);
    at.push(...frame.put([ground.west + c * ground.pitchEast, ground.south + r * ground.pitchNorth, height]));
    normal.push(...ground.normal(c, r));
    colours.push(...tint((height - ground.low) / span));
    const corners = [k, k + 1, k + columns, k + columns + 1];
    if (r + 1 < rows && c + 1 < columns && !corners.some((corner) => Number.isNaN(ground.heights[corner])))
      index.push(k, k + 1, k + columns + 1, k, k + columns + 1, k + columns);
  }
  return { at, normal, tint: colours, index };
}

// The upper half of a sphere.
function domeShape(centre, radius, colour, frame) {
  const at = [], normal = [], tint = [], index = [], around = 36, up = 18;
  for (let v = 0; v <= up; v++) for (let u = 0; u <= around; u++) {
    const polar = 0.5 * Math.PI * v / up, turn = 2 * Math.PI * u / around;
    const out = [Math.sin(polar) * Math.cos(turn), Math.sin(polar) * Math.sin(turn), Math.cos(polar)];
    at.push(...frame.put(centre.map((value, axis) => value + radius * out[axis])));
    normal.push(...out);
    tint.push(...colour);
    const k = v * (around + 1) + u;
    if (v < up && u < around) index.push(k, k + 1, k + around + 2, k, k + around + 2, k + around + 1);
  }
  return { at, normal, tint, index };
}

// The wall about a zone; ring: foot and upper edge of each corner.
function wallShape(ring, colour, frame) {
  const at = [], normal = [], tint = [], index = [];
  for (let k = 0; k + 1 < ring.length; k++) {
    const [foot, top] = ring[k], [nextFoot, nextTop] = ring[k + 1];
    const across = [nextFoot[1] - foot[1], foot[0] - nextFoot[0]], long = Math.hypot(...across) || 1;
    for (const corner of [foot, nextFoot, nextTop, top]) {
      at.push(...frame.put(corner));
      normal.push(across[0] / long, across[1] / long, 0);
      tint.push(...colour);
    }
    index.push(4 * k, 4 * k + 1, 4 * k + 2, 4 * k, 4 * k + 2, 4 * k + 3);
  }
  return { at, normal, tint, index };
}

// A whole circle at the centre's height, and two half circles above it.
function sphereRings(centre, radius) {
  return [0, 1, 2].map((tilt) => Array.from({ length: 65 }, (_, k) => {
    const turn = (tilt === 0 ? 2 : 1) * Math.PI * k / 64, c = radius * Math.cos(turn), s = radius * Math.sin(turn);
    const [e, n, up] = centre;
    return tilt === 0 ? [e + c, n + s, up] : tilt === 1 ? [e + c, n, up + s] : [e, n + c, up + s];
  }));
}

// Every other piece of paths.
function dashed(paths) {
  return paths.flatMap((path) => path.slice(0, -1).flatMap((point, k) => (k % 2 ? [] : [[point, path[k + 1]]])));
}

// Both ends and a corner of each of a piece's two triangles: eight numbers a corner, as the line program reads them.
function linePieces(paths, put) {
  const corners = [[0, -1], [1, -1], [1, 1], [0, -1], [1, 1], [0, 1]], pieces = [];
  for (const path of paths) for (let k = 0; k + 1 < path.length; k++) {
    const a = put(path[k]), b = put(path[k + 1]);
    for (const corner of corners) pieces.push(...a, ...b, ...corner);
  }
  return pieces;
}
