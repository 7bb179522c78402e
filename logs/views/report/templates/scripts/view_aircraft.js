// The aircraft in the 3-D view: the model of the log, turned as it flew, of one size on the screen.

// Forward, left and up of the aircraft in east, north, up.
function bodyAxes(headingDeg, pitchDeg, bankDeg) {
  const [heading, pitch, bank] = [headingDeg, pitchDeg, bankDeg].map((angle) => (angle || 0) * Math.PI / 180);
  const forward = [Math.sin(heading) * Math.cos(pitch), Math.cos(heading) * Math.cos(pitch), Math.sin(pitch)];
  const level = [-Math.cos(heading), Math.sin(heading), 0];
  const above = [
    forward[1] * level[2] - forward[2] * level[1],
    forward[2] * level[0] - forward[0] * level[2],
    forward[0] * level[1] - forward[1] * level[0],
  ];
  // To bank right is to raise the left wing.
  const left = level.map((part, axis) => part * Math.cos(bank) + above[axis] * Math.sin(bank));
  const up = above.map((part, axis) => part * Math.cos(bank) - level[axis] * Math.sin(bank));
  return [forward, left, up];
}

// model: corners [[forward, left, up] x 3] and colours by triangle, one unit wide.  span: its width in the view's units.
function aircraftShape(model, moment, frame, span, stretch) {
  const [forward, left, up] = bodyAxes(moment.heading, moment.pitch, moment.bank);
  const place = frame.put([moment.east, moment.north, moment.up]);
  const at = [], normal = [], tint = [], index = [];
  function turned([f, l, u]) { return [0, 1, 2].map((axis) => f * forward[axis] + l * left[axis] + u * up[axis]); }
  model.corners.forEach((triangle, k) => {
    const [a, b, c] = triangle.map(turned);
    const ab = b.map((part, axis) => part - a[axis]), ac = c.map((part, axis) => part - a[axis]);
    const out = [ab[1] * ac[2] - ab[2] * ac[1], ab[2] * ac[0] - ab[0] * ac[2], ab[0] * ac[1] - ab[1] * ac[0]];
    const facing = out[2] < 0 ? -1 : 1;
    for (const corner of [a, b, c]) {
      // Heights are stretched when drawn; the aircraft is not.
      at.push(place[0] + span * corner[0], place[1] + span * corner[1], place[2] + span * corner[2] / stretch);
      normal.push(facing * out[0] / stretch, facing * out[1] / stretch, facing * out[2]);
      tint.push(...model.colours[k]);
    }
    index.push(3 * k, 3 * k + 1, 3 * k + 2);
  });
  return { at, normal, tint, index };
}
