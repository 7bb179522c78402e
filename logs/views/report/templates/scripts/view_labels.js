// Names in the 3-D view: upright and of one size however it is turned, moved aside where two would cover each other.

// Where a name may stand, in rows above (or below) its place and half widths beside it; the first free one is taken.
const LABEL_PLACES = [[0, 1], [0, -1.6], [0.6, 1.3], [-0.6, 1.3], [0, 2.2], [0.6, 2.5], [-0.6, 2.5], [0, -2.8], [0, 3.4], [0, 4.6]];
const LABEL_ROW = 14;

// labels: [{key, text, at, look, bold, always}], the most important first.
function makeLabels(ink, theme) {
  // Where each name stood last: it stays there as long as it can.
  const stood = new Map();
  let across = 0;
  function boxAt(label, [x, y], wide, place) {
    const [beside, rows] = LABEL_PLACES[place], half = wide / 2 + 3;
    // Whole, beside the picture's edge too.
    const middle = Math.min(Math.max(x + beside * wide, half), Math.max(across - half, half)), base = y - rows * LABEL_ROW + (rows > 0 ? 4 : 0);
    return { middle, base, box: [middle - wide / 2 - 2, base - 12, middle + wide / 2 + 2, base + 3] };
  }
  function covered(box, taken) {
    return taken.some((other) => box[0] < other[2] && other[0] < box[2] && box[1] < other[3] && other[1] < box[3]);
  }
  function choose(label, at, wide, taken) {
    const last = stood.get(label.key) || 0;
    const order = [last, ...LABEL_PLACES.keys()];
    const free = order.find((place) => !covered(boxAt(label, at, wide, place).box, taken));
    return free === undefined && label.always ? last : free;
  }
  function draw(labels, project, width, height, ratio) {
    ink.setTransform(ratio, 0, 0, ratio, 0, 0);
    ink.clearRect(0, 0, width, height);
    ink.textAlign = "center";
    ink.lineJoin = "round";
    const taken = [], shown = [];
    across = width;
    for (const label of labels) {
      const at = project(label.at);
      if (!at || at[0] < 0 || at[0] > width || at[1] < 0 || at[1] > height) continue;
      ink.font = (label.bold ? "bold " : "") + "12px system-ui, sans-serif";
      const wide = ink.measureText(label.text).width, place = choose(label, at, wide, taken);
      if (place === undefined) continue;
      stood.set(label.key, place);
      const put = boxAt(label, at, wide, place);
      taken.push(put.box);
      shown.push(label.text);
      if (place > 1) lead(at, put, label);
      ink.lineWidth = 3.5; ink.strokeStyle = theme.faint("sky", 0.9); ink.fillStyle = theme.colour(label.look);
      ink.strokeText(label.text, put.middle, put.base);
      ink.fillText(label.text, put.middle, put.base);
    }
    return shown;
  }
  // A thin line from a name that was moved aside to its place.
  function lead(at, put, label) {
    ink.beginPath();
    ink.moveTo(at[0], at[1]);
    ink.lineTo(put.middle, put.base + (put.base < at[1] ? 3 : -11));
    ink.lineWidth = 0.8; ink.strokeStyle = theme.colour(label.look);
    ink.stroke();
  }
  return { draw };
}

function sceneLabels(scene, frame) {
  const last = scene.plan.length - 1, found = [], numbers = new Map(scene.numbers);
  function add(text, at, look, bold, always) { found.push({ key: found.length, text, at, look, bold, always }); }
  add("start", scene.plan[0], "ink", true, true);
  add("destination", scene.plan[last], "ink", true, true);
  for (const k of scene.failing.waypoints) if (scene.plan[k]) add("✗ " + (numbers.get(k) ?? k), scene.plan[k], "fail", true, true);
  for (const k of scene.failing.legs) {
    const middle = scene.plan[k].map((value, axis) => (value + scene.plan[k + 1][axis]) / 2);
    add("✗ leg " + k, middle, "fail", true, scene.failing.legs.length <= 6);
  }
  for (const threat of scene.threats) add(threat.name.slice(0, 24), threat.at, "ink", false, false);
  for (const zone of scene.zones || []) add(zone.name.slice(0, 24), zone.rings[0][0][1], "zone", false, false);
  const [e, n] = frame.middle;
  for (const [text, at] of [["N", [e, frame.north]], ["S", [e, frame.south]], ["E", [frame.east, n]], ["W", [frame.west, n]]])
    add(text, [...at, frame.low], "ink", true, false);
  for (const [k, number] of numbers) if (k && k < last && !scene.failing.waypoints.includes(k)) add(String(number), scene.plan[k], "second", true, false);
  return found;
}
