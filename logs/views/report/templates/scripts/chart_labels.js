// Places the labels of a chart beside their points so that they cover neither each other nor the path.

const LABEL_SIZE = 11;
// Places beside a point as plotly.js names them, the best first.
const LABEL_SIDES = ["top right", "top left", "bottom right", "bottom left", "top center", "bottom center", "middle right", "middle left"];
// Gap between a point and its label, px: plotly.js adds a quarter to the marker's radius, and 1.
const LABEL_MARKER = 10, LABEL_GAP = LABEL_MARKER / 1.6 + 1;
// Half the side of a dot, px, and the gap between two labels, without which they read as one.
const DOT_HALF = 5, LABEL_SPACE = 3;
// Cost of a covered dot and of a label that leaves the frame, in covered legs.
const DOT_COST = 2, FRAME_COST = 4;
// A label that would cover this much is left out.
const COST_LIMIT = 3;

// labels: [text, x, y, role], the most important first; their places are chosen by `arrangeLabels`.
function labelTraces(labels, axes, theme, scale = 1) {
  if (!labels.length) return [];
  return [{
    type: "scatter", mode: "markers+text", meta: { labels: labels.map((label) => `<b>${plainName(label[0])}</b>`), widths: labels.map(labelWidth) },
    marker: { size: LABEL_MARKER, color: theme.clear }, ...axes, x: labels.map((label) => label[1] * scale), y: labels.map((label) => label[2] * scale),
    text: [], textposition: [], showlegend: false, hoverinfo: "skip",
    textfont: { size: LABEL_SIZE, color: labels.map((label) => theme.colour(label[3])) }, cliponaxis: false,
  }];
}

function labelWidth([text]) {
  const ink = document.createElement("canvas").getContext("2d");
  ink.font = `bold ${LABEL_SIZE}px ${CHART_FONT}`;
  return ink.measureText(text).width;
}

// Choose text and place of each label for the axes as they are; a label without room is left out until a reader zooms in.
function arrangeLabels(traces, layout) {
  for (const trace of traces) {
    if (!trace.meta || !trace.meta.labels) continue;
    const pixels = pixelScale(trace, layout);
    if (!pixels) continue;
    const points = trace.x.map((x, k) => pixels(x, trace.y[k])), shown = points.map(([x, y]) => x >= 0 && y >= 0 && x <= pixels.width && y <= pixels.height);
    const paths = traces.filter((one) => one.meta === "path" && one.xaxis === trace.xaxis && one.yaxis === trace.yaxis);
    const legs = paths.flatMap((path) => path.x.slice(1).map((x, k) => [pixels(path.x[k], path.y[k]), pixels(x, path.y[k + 1])]));
    const taken = [];
    trace.textposition = points.map(() => LABEL_SIDES[0]);
    trace.text = trace.meta.labels.map((text, k) => {
      if (!shown[k]) return "";
      let best = null, least = COST_LIMIT;
      LABEL_SIDES.forEach((side, rank) => {
        const box = labelBox(points[k], trace.meta.widths[k], side);
        if (taken.some((other) => overlap(box, other))) return;
        const isOutside = box[0] < 0 || box[1] < 0 || box[2] > pixels.width || box[3] > pixels.height;
        const cost = 0.05 * rank + legs.filter(([from, to]) => crosses(box, from, to)).length + FRAME_COST * isOutside
          + DOT_COST * points.filter(([x, y], j) => j !== k && shown[j] && overlap(box, [x - DOT_HALF, y - DOT_HALF, x + DOT_HALF, y + DOT_HALF])).length;
        if (cost < least) [best, least, trace.textposition[k]] = [box, cost, side];
      });
      if (!best) return "";
      taken.push([best[0] - LABEL_SPACE, best[1], best[2] + LABEL_SPACE, best[3]]);
      return text;
    });
  }
}

// From data to pixels right of and below the upper left corner of a trace's panel; null without ranges.
function pixelScale(trace, layout) {
  const [across, upright] = [[trace.xaxis, "x"], [trace.yaxis, "y"]].map(([name, letter]) => layout[(name || letter).replace(letter, letter + "axis")]);
  if (!across.range || !upright.range) return null;
  const inner = [layout.width - layout.margin.l - layout.margin.r, layout.height - layout.margin.t - layout.margin.b];
  let [wide, tall] = [across, upright].map(({ domain, range }, k) => inner[k] * (domain ? domain[1] - domain[0] : 1) / (range[1] - range[0]));
  // Equal scales leave room beside the map.
  if (upright.scaleanchor) wide = tall = Math.min(wide, tall);
  const pixels = (x, y) => [(x - across.range[0]) * wide, (upright.range[1] - y) * tall];
  return Object.assign(pixels, { width: (across.range[1] - across.range[0]) * wide, height: (upright.range[1] - upright.range[0]) * tall });
}

function labelBox([x, y], width, side) {
  const [row, column] = side.split(" ");
  const left = x + { left: -LABEL_GAP - width, center: -width / 2, right: LABEL_GAP }[column];
  const base = y + 0.75 * LABEL_SIZE + { top: -LABEL_GAP - LABEL_SIZE, middle: -LABEL_SIZE / 2, bottom: LABEL_GAP }[row];
  return [left, base - LABEL_SIZE, left + width, base + 0.25 * LABEL_SIZE];
}

function overlap(one, other) {
  return one[0] < other[2] && other[0] < one[2] && one[1] < other[3] && other[1] < one[3];
}

// True if a straight line enters a box (Liang and Barsky, 1984).
function crosses(box, from, to) {
  let first = 0, last = 1;
  for (const axis of [0, 1]) {
    const along = to[axis] - from[axis];
    const ends = [box[axis], box[axis + 2]].map((edge) => (edge - from[axis]) / along);
    if (along === 0) {
      if (from[axis] < box[axis] || from[axis] > box[axis + 2]) return false;
    } else [first, last] = [Math.max(first, Math.min(...ends)), Math.min(last, Math.max(...ends))];
  }
  return first <= last;
}
