// Draw the map: ground, zones, threats, the route with the path that the autopilot flies, and the waypoints.

import { Labels, View, clear, groundAt, plain, step, svg } from "/axes.js";

const DENSE = 80;
// Closeness of a state without a near limit, which is sent as null.
const FAR = 1e9;
// Number of straight legs drawn as one shape; a drag redraws only the shapes of the dragged item.
const CHUNK = 6;
// Height of legend, compass and scale at the lower edge, pixels.
const TOOLS = 76;
// Distance within which a leg is below the pointer, and difference within which two legs are equally close, pixels.
const REACH = 9, SAME = 3;

export class MapView {
  constructor(root) {
    this.root = root;
    this.view = new View();
    // Ground, zones and threats are a separate picture below, which is not repainted during a drag.
    this.below = svg("svg", { class: "below", "aria-hidden": "true" });
    root.before(this.below);
    this.land = svg("g", { class: "world" }, this.below);
    this.ground = svg("image", { preserveAspectRatio: "none", transform: "scale(1 -1)" }, this.land);
    this.shapes = svg("g", {}, this.land);
    this.world = svg("g", { class: "world" }, root);
    this.legsUnder = svg("g", { class: "under" }, this.world);
    this.ways = svg("g", { class: "ways" }, this.world);
    this.straight = svg("g", {}, this.world);
    this.legs = svg("g", { class: "legs" }, this.world);
    // Draw the worst state last, so that a later lap does not hide a leg that fails in an earlier lap.
    this.layers = Object.fromEntries([...ORDER].reverse().map((state) => [state, svg("g", {}, this.legs)]));
    this.track = svg("path", { class: "track" }, this.world);
    this.names = svg("g", { class: "names", "aria-hidden": "true" }, root);
    this.diamonds = svg("g", { class: "diamonds" }, root);
    this.markers = svg("g", { class: "markers" }, root);
    this.scale = svg("g", { class: "scale", "aria-hidden": "true" }, root);
    this.legParts = [];
    this.marks = [];
    this.model = null;
  }

  resize(width, height) {
    Object.assign(this.view, { width, height });
    for (const one of [this.root, this.below]) one.setAttribute("viewBox", `0 0 ${width} ${height}`);
  }

  setWorld(world) {
    this.about = world;
    clear(this.shapes);
    if (world.bounds) {
      const [[w, e], [s, n]] = world.bounds;
      svg("rect", { x: w, y: s, width: e - w, height: n - s, class: "area" }, this.shapes);
    }
    this.zoneShapes = world.zones.map((zone) => {
      const d = zone.rings.map((ring) => `M${ring.map((p) => p.join(" ")).join("L")}Z`).join("");
      return svg("path", { d, class: `zone ${zone.kind}`, "fill-rule": "evenodd" }, this.shapes);
    });
    this.threatShapes = world.threats.map((threat) => {
      const group = svg("g", { class: "threat" }, this.shapes), [cx, cy] = threat.at;
      if (threat.detection) svg("circle", { cx, cy, r: threat.detection, class: "radar" }, group);
      if (threat.kill) svg("circle", { cx, cy, r: threat.kill, class: "missile" }, group);
      return group;
    });
  }

  setPicture(picture) {
    if (!picture) return this.ground.removeAttribute("href");
    const [[w, e], [s, n]] = [picture.east, picture.north];
    for (const [key, value] of Object.entries({ x: w, y: -n, width: e - w, height: n - s, href: picture.url })) {
      this.ground.setAttribute(key, value);
    }
    return undefined;
  }

  // Draw a mission: route, path of each leg, states and items.
  show(model) {
    const fresh = !this.model || this.model.path.length !== model.path.length || this.model.items.length !== model.items.length;
    this.model = model;
    this.at = new Map(model.items.map((item) => [item.k, item.at]));
    if (fresh) this.build(model);
    this.colour();
    this.drawStraight(model.route);
    this.layOut();
  }

  // Redraw only the legs and corners that the verdict of a drag has changed.
  update(model) {
    if (!this.model || this.model.path.length !== model.path.length || this.model.items.length !== model.items.length) return this.show(model);
    this.model = model;
    this.at = new Map(model.items.map((item) => [item.k, item.at]));
    this.colour();
    this.drawStraight(model.route);
    return this.placeMarks();
  }

  build(model) {
    for (const layer of Object.values(this.layers)) clear(layer);
    clear(this.legsUnder);
    clear(this.markers);
    this.drawn = model.path.map(() => [null, ""]);
    this.marked = model.items.map(() => "");
    this.places = [];
    this.legParts = model.path.map(() => [svg("path", {}, this.legsUnder), svg("path", {}, this.layers.ok)]);
    this.marks = model.items.map((item) => {
      const group = svg("g", { class: "mark", tabindex: -1, role: "button", "data-k": item.k }, this.markers);
      svg("circle", { r: 18, class: "hold" }, group);
      svg("circle", { r: 6.5, class: "dot" }, group);
      return group;
    });
  }

  colour() {
    const { model } = this;
    const bad = { threats: new Set(model.violated.threats), zones: new Set(model.violated.zones) };
    this.legParts.forEach(([under, over], k) => {
      const flat = model.path[k], parts = [], drawn = this.drawn[k], state = model.states.legs[k][0];
      if (drawn[0] === flat && drawn[1] === state) return;
      if (over.parentNode !== this.layers[state]) this.layers[state].append(over);
      this.drawn[k] = [flat, state];
      for (let i = 0; i < flat.length; i += 3) parts.push(`${flat[i]} ${flat[i + 1]}`);
      const d = parts.length ? `M${parts.join("L")}` : "";
      under.setAttribute("d", d);
      over.setAttribute("d", d);
      under.setAttribute("class", `leg-under ${state}`);
      over.setAttribute("class", `leg ${state}`);
    });
    this.threatShapes?.forEach((group, k) => group.classList.toggle("entered", bad.threats.has(k)));
    this.zoneShapes?.forEach((path, k) => path.classList.toggle("entered", bad.zones.has(k)));
    const worst = cornerStates(model), all = cornerStates(model, true);
    this.marks.forEach((group, i) => {
      const item = model.items[i], state = worst.get(item.k)?.[0] || "ok", heard = all.get(item.k)?.[0];
      const shown = `${item.k} ${item.seq} ${item.what} ${state} ${heard} ${item.k === this.selected} ${item.at[2]}`;
      if (this.marked[i] === shown) return;
      this.marked[i] = shown;
      group.setAttribute("class", `mark ${state}${item.k === this.selected ? " selected" : ""}`);
      group.setAttribute("data-k", item.k);
      group.setAttribute("aria-label", spoken(item, heard));
    });
  }

  select(k) {
    this.selected = k;
    this.marked?.fill("");
    this.marks.forEach((group, i) => {
      const own = this.model.items[i].k === k;
      group.classList.toggle("selected", own);
      group.setAttribute("tabindex", own || (k === null && i === 0) ? 0 : -1);
    });
  }

  drawStraight(points) {
    const parts = this.straight.children;
    for (let i = 0, k = 0; i + 1 < points.length; i += CHUNK, k++) {
      const d = `M${points.slice(i, i + CHUNK + 1).map((p) => `${p[0]} ${p[1]}`).join("L")}`;
      renew(parts[k] || svg("path", { class: "straight" }, this.straight), "d", d);
    }
    while (parts.length > Math.ceil((points.length - 1) / CHUNK)) parts[parts.length - 1].remove();
  }

  // Move an item with the pointer before the server has answered.
  dragged(k, east, north) {
    const item = this.at.get(k);
    if (!item) return;
    this.at.set(k, [east, north, item[2]]);
    const once = this.once(k);
    const points = this.model.route.map((p, i) => (once && this.model.of[i] === k ? [east, north] : p));
    this.drawStraight(points);
    this.placeMarks();
  }

  once(k) {
    return this.model.of.filter((one) => one === k).length === 1;
  }

  setTrack(points, stale) {
    this.track.setAttribute("d", points && points.length ? `M${points.map((p) => `${p[0]} ${p[1]}`).join("L")}` : "");
    this.track.classList.toggle("stale", Boolean(stale));
  }

  setWays(ways, shown) {
    clear(this.ways);
    ways.forEach((way, k) => {
      const d = `M${way.points.map((p) => `${p[0]} ${p[1]}`).join("L")}`;
      svg("path", { d, class: `way${k === shown ? " shown" : ""}` }, this.ways);
    });
  }

  focus(k) {
    this.marks.find((mark) => Number(mark.dataset.k) === k)?.focus({ preventScroll: true });
  }

  // Update everything that depends on the view.
  layOut() {
    for (const one of [this.world, this.land]) one.setAttribute("transform", this.view.transform());
    // If waypoints are closer than the width of their dots, use small dots, so that the colours of the legs stay visible.
    const places = this.model.items.map((item) => this.at.get(item.k)), apart = places.slice(1).map((p, i) => Math.hypot(p[0] - places[i][0], p[1] - places[i][1]));
    const middle = apart.sort((a, b) => a - b)[apart.length >> 1] || 0;
    this.markers.classList.toggle("dense", middle * this.view.scale < 13);
    this.placeMarks();
    this.placeDiamonds();
    this.placeNames();
    this.drawScale();
  }

  placeMarks() {
    this.marks.forEach((group, i) => {
      const [east, north] = this.at.get(this.model.items[i].k);
      const x = this.view.x(east), y = this.view.y(north);
      if (this.places[i] === `${x} ${y}`) return;
      this.places[i] = `${x} ${y}`;
      // A transform for each element would take the browser longer than everything else.
      for (const circle of group.children) {
        circle.setAttribute("cx", x);
        circle.setAttribute("cy", y);
      }
    });
  }

  // Draw a diamond for inserting a waypoint between two items, if the leg is long enough.
  placeDiamonds() {
    clear(this.diamonds);
    this.middles = [];
    const { items } = this.model;
    for (let i = 0; i + 1 < items.length; i++) {
      const [a, b] = [this.at.get(items[i].k), this.at.get(items[i + 1].k)];
      const east = (a[0] + b[0]) / 2, north = (a[1] + b[1]) / 2, x = this.view.x(east), y = this.view.y(north);
      if (Math.hypot(a[0] - b[0], a[1] - b[1]) * this.view.scale < 64 || !this.inside(x, y, 10)) continue;
      this.middles.push({ x, y, after: items[i].k });
      svg("path", { d: "M0-5.5 5.5 0 0 5.5-5.5 0Z", transform: `translate(${x} ${y})` }, this.diamonds);
    }
  }

  inside(x, y, rim) {
    return x > rim && y > rim && x < this.view.width - rim && y < this.view.height - rim;
  }

  placeNames() {
    clear(this.names);
    const { items, route } = this.model, points = route.map(([east, north]) => [this.view.x(east), this.view.y(north)]);
    const labels = new Labels(points.slice(1).map((to, i) => [points[i], to]));
    for (const item of items) {
      const [east, north] = this.at.get(item.k);
      labels.block(this.view.x(east), this.view.y(north), 7);
    }
    for (const one of this.middles) labels.block(one.x, one.y, 6);
    // Reserve the space of the scale with the compass above it, and of the legend.
    labels.taken.push([this.view.width - 200, this.view.height - TOOLS, this.view.width, this.view.height]);
    labels.taken.push([0, this.view.height - TOOLS, 110, this.view.height]);
    const by = items.length > DENSE ? Math.ceil(items.length / 40) : 1;
    items.forEach((item, i) => {
      const [east, north] = this.at.get(item.k), state = this.marks[i].classList;
      if (i % by && item.k !== this.selected && !state.contains("fail")) return;
      this.name(labels, this.view.x(east), this.view.y(north), String(item.seq), "number", 11);
    });
    const about = this.about;
    if (!about) return;
    if (about.threats.length <= DENSE) {
      for (const threat of about.threats) this.name(labels, this.view.x(threat.at[0]), this.view.y(threat.at[1]), threat.name, "threat-name", 0);
    }
    if (about.zones.length <= DENSE) {
      for (const zone of about.zones) {
        const ring = zone.rings[0], n = ring.length;
        const east = ring.reduce((sum, p) => sum + p[0], 0) / n, north = ring.reduce((sum, p) => sum + p[1], 0) / n;
        this.name(labels, this.view.x(east), this.view.y(north), zone.name, "zone-name", 0);
      }
    }
  }

  name(labels, x, y, text, kind, away) {
    if (!this.inside(x, y, 2)) return;
    const width = (kind === "number" ? 7.8 : 6.4) * text.length + 4, height = 14;
    const [right, left, up, down, near] = [away, -away - width, -away - height, away, 0.7 * away];
    const offsets = away
      ? [[right, -height / 2], [left, -height / 2], [-width / 2, up], [-width / 2, down], [near, -near - height], [-near - width, -near - height], [near, near], [-near - width, near]]
      : [[-width / 2, -height / 2]];
    const places = offsets.map(([dx, dy]) => [x + dx, y + dy]).filter(([px, py]) => this.inside(px, py, 0) && this.inside(px + width, py + height, 0));
    const box = labels.take(places, width, height);
    if (box) svg("text", { x: box[0] + 2, y: box[1] + 11, class: kind }, this.names).textContent = text;
  }

  drawScale() {
    clear(this.scale);
    const { width, height, scale } = this.view, metres = step(110 / scale, 1), length = metres * scale;
    const bar = length > 170 ? metres / 2 : metres, pixels = bar * scale;
    const x = width - 16 - pixels, y = height - 14;
    svg("path", { d: `M${x} ${y - 5}V${y}H${x + pixels}V${y - 5}` }, this.scale);
    const text = svg("text", { x: x + pixels / 2, y: y - 6, "text-anchor": "middle" }, this.scale);
    text.textContent = bar >= 1000 ? `${bar / 1000} km` : `${bar} m`;
  }

  // Return what is below the pointer: the nearest waypoint, or else the nearest diamond.
  hit(x, y, touch) {
    const near = (list, most) => {
      let best = null, least = most;
      for (const one of list) {
        const away = Math.hypot(one.x - x, one.y - y);
        if (away <= least) [best, least] = [one, away];
      }
      return best;
    };
    const points = this.model.items.map((item) => {
      const [east, north] = this.at.get(item.k);
      return { k: item.k, x: this.view.x(east), y: this.view.y(north) };
    });
    const point = near(points, touch ? 26 : 16);
    if (point) return { item: point.k };
    const middle = near(this.middles || [], touch ? 20 : 11);
    return middle ? { after: middle.after } : null;
  }

  // Return the legs below the pointer, the worst first: legs of all laps that are as close as the nearest leg.
  legsAt(x, y) {
    const found = [], { legs } = this.model.states;
    this.model.path.forEach((flat, k) => {
      let least = REACH;
      for (let i = 0; i + 5 < flat.length; i += 3) {
        const ax = this.view.x(flat[i]), ay = this.view.y(flat[i + 1]), bx = this.view.x(flat[i + 3]), by = this.view.y(flat[i + 4]);
        const dx = bx - ax, dy = by - ay, size = dx * dx + dy * dy || 1;
        const t = Math.min(1, Math.max(0, ((x - ax) * dx + (y - ay) * dy) / size));
        least = Math.min(least, Math.hypot(ax + t * dx - x, ay + t * dy - y));
      }
      if (least < REACH) found.push({ k, away: least });
    });
    const nearest = Math.min(...found.map((one) => one.away));
    return found.filter((one) => one.away <= nearest + SAME).map((one) => one.k).sort((a, b) => byWorst(legs[a], legs[b]));
  }

  extentOf(points) {
    const [east, north] = [[Infinity, -Infinity], [Infinity, -Infinity]];
    for (const p of points) [east, north].forEach((side, i) => {
      side[0] = Math.min(side[0], p[i]);
      side[1] = Math.max(side[1], p[i]);
    });
    return [east, north];
  }

  // Fit the view to the whole mission: its items, and the path with its arcs and loiters.
  // The open legend must not cover a waypoint, so the mission is fitted above it.  box: the legend.
  setLegend(box) {
    this.legendHeight = box.open ? box.offsetHeight + 44 : 0;
    const under = box.getBoundingClientRect();
    const covers = ({ left, right, top, bottom }) => left < under.right && under.left < right && top < under.bottom && under.top < bottom;
    if (box.open && this.marks?.some((mark) => covers(mark.lastChild.getBoundingClientRect()))) this.fit();
  }

  fit() {
    const { items, route, path } = this.model, shown = [...items.map((item) => item.at), ...route];
    for (const flat of path) for (let i = 0; i < flat.length; i += 3) shown.push([flat[i], flat[i + 1]]);
    const [east, north] = this.extentOf(shown);
    const rim = 0.04 * Math.max(east[1] - east[0], north[1] - north[0], 400);
    this.view.fit([[east[0] - rim, east[1] + rim], [north[0] - rim, north[1] + rim]], Math.max(TOOLS, this.legendHeight || 0));
    this.layOut();
  }
}

// Set an attribute only if it differs, because a set attribute is repainted.
function renew(part, name, value) {
  if (part.getAttribute(name) !== value) part.setAttribute(name, value);
}

const ORDER = ["fail", "open", "near", "ok"];

// Compare two states [name, text, closeness]: the worse one is first, or else the one closer to its limit.
export function byWorst(a, b) {
  return ORDER.indexOf(a[0]) - ORDER.indexOf(b[0]) || Math.sign((a[2] ?? FAR) - (b[2] ?? FAR));
}

// Return the worst state at each item by its index, of its corners and, if requested, its legs; none for an item without a stop.
export function cornerStates(model, withLegs) {
  const found = new Map(), { corners, legs } = model.states;
  model.of.forEach((k, i) => {
    const states = [corners[i] || ["ok", ""], ...(withLegs ? [legs[i - 1], legs[i]] : [])];
    for (const mine of states.filter(Boolean)) {
      const old = found.get(k), by = old ? byWorst(mine, old) : -1;
      if (by < 0 || (by === 0 && mine[1] && !old[1])) found.set(k, mine);
    }
  });
  return found;
}

// Return the states of the legs to and from an item.
export function legStates(model, k) {
  const found = [];
  model.of.forEach((own, i) => {
    if (own !== k) return;
    if (i > 0) found.push(model.states.legs[i - 1]);
    if (i < model.states.legs.length) found.push(model.states.legs[i]);
  });
  return found;
}

const WORDS = { ok: "passes", near: "near a limit", open: "not judged in full", fail: "fails" };

export function spoken(item, state) {
  const height = item.at[2] === null ? "" : `, ${plain(item.at[2])} m`;
  return `${item.what} ${item.seq}${height}, ${WORDS[state] || "not flown"}`;
}

export function heightWords(grid, east, north, up) {
  if (up === null || up === undefined) return "not flown";
  const ground = groundAt(grid, east, north);
  const above = Number.isNaN(ground) ? "" : `, ${plain(up - ground)} m above ground`;
  return `${plain(up)} m AMSL${above}`;
}
