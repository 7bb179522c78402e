// Draw SVG elements, and convert lengths to pixels.

const SVG = "http://www.w3.org/2000/svg";

export function svg(name, attributes, parent) {
  const made = document.createElementNS(SVG, name);
  for (const key in attributes) made.setAttribute(key, attributes[key]);
  if (parent) parent.append(made);
  return made;
}

export function element(name, attributes = {}, ...children) {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) {
    if (key.startsWith("on")) made.addEventListener(key.slice(2), value);
    else if (value === true) made.setAttribute(key, "");
    else if (value !== false && value !== null && value !== undefined) made.setAttribute(key, value);
  }
  made.append(...children.filter((one) => one !== null && one !== undefined));
  return made;
}

export function clear(parent) {
  parent.replaceChildren();
  return parent;
}

// Map view with equal scales, north up: `scale` pixels per metre, `east` and `north` of the upper left corner, m.
export class View {
  constructor() {
    Object.assign(this, { east: 0, north: 0, scale: 0.05, width: 1, height: 1 });
  }
  x(east) { return (east - this.east) * this.scale; }
  y(north) { return (this.north - north) * this.scale; }
  eastAt(x) { return this.east + x / this.scale; }
  northAt(y) { return this.north - y / this.scale; }
  transform() {
    const { east, north, scale } = this;
    return `translate(${-east * scale} ${north * scale}) scale(${scale} ${-scale})`;
  }
  // rim: pixels left free above and below.
  fit([[west, east], [south, north]], rim = 28) {
    const wide = Math.max(1, east - west), tall = Math.max(1, north - south);
    const free = [Math.max(40, this.width - 2 * 28), Math.max(40, this.height - 2 * rim)];
    this.scale = Math.min(free[0] / wide, free[1] / tall);
    this.east = (west + east) / 2 - this.width / 2 / this.scale;
    this.north = (south + north) / 2 + this.height / 2 / this.scale;
  }
  zoom(factor, x, y) {
    const east = this.eastAt(x), north = this.northAt(y);
    this.scale = Math.min(20, Math.max(0.0005, this.scale * factor));
    this.east = east - x / this.scale;
    this.north = north + y / this.scale;
  }
  pan(dx, dy) {
    this.east -= dx / this.scale;
    this.north += dy / this.scale;
  }
}

// Return a step of 1, 2 or 5 times a power of ten that divides a span into at most `parts` steps.
export function step(span, parts) {
  const raw = Math.max(span, 1e-9) / parts, power = 10 ** Math.floor(Math.log10(raw));
  return [1, 2, 5, 10].find((one) => one * power >= raw * (1 - 1e-9)) * power;
}

export function ticks(low, high, parts) {
  const by = step(high - low, parts), found = [];
  for (let k = Math.ceil(low / by - 1e-9); k * by <= high + 1e-9 * by; k++) found.push(k * by);
  return found;
}

// Return a number as text; a dash if it is unknown.
export function plain(value, digits = 0) {
  if (value === null || !Number.isFinite(value)) return "\u2013";
  return value.toFixed(digits).replace("-", "\u2212");
}

// Return the ground height on the grid that the server sent; NaN if it is unknown.
export function groundAt(grid, east, north) {
  if (!grid) return NaN;
  const { rows, columns, heights } = grid;
  const c = ((east - grid.east[0]) / (grid.east[1] - grid.east[0])) * (columns - 1);
  const r = ((north - grid.north[0]) / (grid.north[1] - grid.north[0])) * (rows - 1);
  if (!(c >= 0 && r >= 0 && c <= columns - 1 && r <= rows - 1)) return NaN;
  const c0 = Math.min(columns - 2, Math.floor(c)), r0 = Math.min(rows - 2, Math.floor(r));
  const at = r0 * columns + c0, x = c - c0, y = r - r0;
  const low = heights[at] * (1 - x) + heights[at + 1] * x;
  return low * (1 - y) + (heights[at + columns] * (1 - x) + heights[at + columns + 1] * x) * y;
}

// Place labels where no label is yet, away from the legs if there is room; important labels must be placed first.
export class Labels {
  // legs: both ends [[x, y], [x, y]] of each leg, which labels should not cover.
  constructor(legs = []) {
    this.taken = [];
    this.legs = legs;
  }
  // Return the first of the places [x, y] that covers no label and no leg, or else no label; undefined without one.
  take(places, width, height) {
    const boxes = places.map(([x, y]) => [x, y, x + width, y + height]);
    const free = boxes.filter((box) => !this.taken.some((one) => box[0] < one[2] && one[0] < box[2] && box[1] < one[3] && one[1] < box[3]));
    const best = free.find((box) => !this.legs.some(([from, to]) => crosses(box, from, to))) || free[0];
    if (best) this.taken.push(best);
    return best;
  }
  block(x, y, half) { this.taken.push([x - half, y - half, x + half, y + half]); }
}

// Return true if a straight line enters a box (Liang and Barsky, 1984).
function crosses(box, from, to) {
  let first = 0, last = 1;
  for (const axis of [0, 1]) {
    const along = to[axis] - from[axis];
    if (along === 0) {
      if (from[axis] < box[axis] || from[axis] > box[axis + 2]) return false;
      continue;
    }
    const ends = [box[axis], box[axis + 2]].map((edge) => (edge - from[axis]) / along);
    first = Math.max(first, Math.min(...ends));
    last = Math.min(last, Math.max(...ends));
  }
  return first <= last;
}
