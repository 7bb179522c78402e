// Draw the profile: ground, required clearance, threats, zones, path and flight, with altitudes to drag.

import { clear, groundAt, plain, svg, ticks } from "/axes.js";
import { cornerStates } from "/map.js";

const SIDES = { left: 52, right: 14, top: 12, bottom: 24 };
const SAMPLES = 360;
// Number of items above which all dots of a state are one shape.
const MANY = 60;

export class Profile {
  constructor(root) {
    this.root = root;
    this.back = svg("g", { class: "profile-back" }, root);
    this.front = svg("g", { class: "profile-front" }, root);
    this.dots = svg("g", { class: "profile-dots" }, root);
    this.model = null;
  }

  resize(width, height) {
    Object.assign(this, { width, height });
    this.root.setAttribute("viewBox", `0 0 ${width} ${height}`);
    if (this.model) this.draw();
  }

  show(model, world, grid, flown) {
    Object.assign(this, { model, world, grid, flown });
    if (this.width) this.draw();
  }

  distances() {
    const at = [0], { route } = this.model;
    for (let i = 1; i < route.length; i++) at.push(at[i - 1] + Math.hypot(route[i][0] - route[i - 1][0], route[i][1] - route[i - 1][1]));
    return at;
  }

  x(distance) { return SIDES.left + (distance / this.length) * (this.width - SIDES.left - SIDES.right); }
  y(up) { return this.height - SIDES.bottom - ((up - this.low) / (this.high - this.low)) * (this.height - SIDES.top - SIDES.bottom); }
  upAt(y) { return this.low + ((this.height - SIDES.bottom - y) / (this.height - SIDES.top - SIDES.bottom)) * (this.high - this.low); }
  metresPerPixel() { return (this.high - this.low) / (this.height - SIDES.top - SIDES.bottom); }

  // Return the ground below the path: the server's samples of the mission, or the coarse grid during a drag.
  groundLine() {
    const { profile, route } = this.model;
    if (profile) return profile.ground ? profile.x.map((x, i) => [x, profile.ground[i]]) : [];
    if (!this.grid) return [];
    const found = [];
    for (let i = 0, leg = 0; i <= SAMPLES; i++) {
      const s = (i / SAMPLES) * this.length;
      while (leg + 2 < route.length && this.at[leg + 1] < s) leg++;
      const size = this.at[leg + 1] - this.at[leg] || 1, t = Math.min(1, Math.max(0, (s - this.at[leg]) / size));
      const [a, b] = [route[leg], route[leg + 1]];
      found.push([s, groundAt(this.grid, a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1]))]);
    }
    return found;
  }

  // Keep the axis during a drag of an altitude, so that the dot stays below the pointer.
  hold(held) { this.held = held; }

  draw() {
    this.at = this.distances();
    this.length = Math.max(1, this.at[this.at.length - 1]);
    const ground = knownParts(this.groundLine());
    if (!this.held) this.range(ground.flat());
    clear(this.back);
    clear(this.front);
    this.axes();
    this.cuts();
    for (const part of ground) this.drawGround(part);
    this.drawCeiling(ground.length);
    this.way();
    this.drawDots();
  }

  // Return the altitude at which an item's dot lies, m: that of the touchdown for a landing, above which the route ends.
  dotAltitude(k, i) {
    const item = this.model.items.find((one) => one.k === k);
    return item?.touchdown ? item.at[2] : this.model.route[i][2];
  }

  range(ground) {
    const touchdowns = this.model.items.filter((one) => one.touchdown).map((one) => one.at[2]);
    const ups = [...this.model.route.map((p) => p[2]), ...touchdowns];
    const heights = [...ups, ...ground.map((p) => p[1]), ...(this.flown?.track || []).map((p) => p[2])];
    const low = Math.min(...heights), high = Math.max(...heights), rim = Math.max(20, 0.1 * (high - low));
    this.low = low - rim;
    this.high = high + rim;
    const ceiling = this.world?.ceiling;
    if (ceiling && ceiling < this.high + 0.6 * (this.high - this.low)) this.high = Math.max(this.high, ceiling + rim / 2);
  }

  axes() {
    const grid = svg("g", { class: "grid" }, this.back);
    for (const up of ticks(this.low, this.high, Math.max(3, Math.round(this.height / 48)))) {
      svg("path", { d: `M${SIDES.left} ${this.y(up)}H${this.width - SIDES.right}` }, grid);
      svg("text", { x: SIDES.left - 6, y: this.y(up) + 3.5, "text-anchor": "end" }, grid).textContent = plain(up);
    }
    for (const km of ticks(0, this.length / 1000, Math.max(3, Math.round(this.width / 110)))) {
      const last = this.x(km * 1000) > this.width - 40;
      svg("text", { x: this.x(km * 1000), y: this.height - 7, "text-anchor": last ? "end" : "middle" }, grid).textContent = `${Number(km.toFixed(3))}${km === 0 ? " km" : ""}`;
    }
  }

  cuts() {
    for (const cut of this.model.profile?.cuts || []) {
      let upper = [], lower = [];
      const flush = () => {
        if (upper.length > 1) svg("path", { d: `M${[...upper, ...lower.reverse()].join("L")}Z`, class: `cut ${cut.role}` }, this.back);
        [upper, lower] = [[], []];
      };
      cut.x.forEach((x, i) => {
        if (cut.top[i] === null || cut.low[i] === null) return flush();
        const clamp = (v) => Math.min(this.high, Math.max(this.low, v));
        upper.push(`${this.x(x)} ${this.y(clamp(cut.top[i]))}`);
        lower.push(`${this.x(x)} ${this.y(clamp(cut.low[i]))}`);
      });
      flush();
    }
  }

  // ground: a part of the path below which the ground is known.
  drawGround(ground) {
    const line = (more) => ground.map((p) => `${this.x(p[0]).toFixed(1)} ${this.y(p[1] + more).toFixed(1)}`);
    const base = this.height - SIDES.bottom, clearance = this.world?.clearance || 0;
    const ends = [this.x(ground[ground.length - 1][0]), this.x(ground[0][0])];
    svg("path", { d: `M${line(clearance).join("L")}L${ends[0]} ${base}L${ends[1]} ${base}Z`, class: "clearance" }, this.back);
    svg("path", { d: `M${line(0).join("L")}L${ends[0]} ${base}L${ends[1]} ${base}Z`, class: "ground" }, this.back);
    svg("path", { d: `M${line(clearance).join("L")}`, class: "clearance-line" }, this.back);
  }

  drawCeiling(shown) {
    if (shown && this.world?.ceiling && this.world.ceiling < this.high) {
      svg("path", { d: `M${SIDES.left} ${this.y(this.world.ceiling)}H${this.width - SIDES.right}`, class: "ceiling" }, this.back);
      svg("text", { x: this.width - SIDES.right - 4, y: this.y(this.world.ceiling) - 4, "text-anchor": "end", class: "unit" }, this.back).textContent = "ceiling";
    }
  }

  way() {
    // Draw the unit over everything behind the path.
    svg("text", { x: SIDES.left + 6, y: SIDES.top + 9, class: "unit" }, this.back).textContent = "m AMSL";
    const { route, states } = this.model, parts = { ok: [], near: [], open: [], fail: [] };
    for (let i = 0; i + 1 < route.length; i++) {
      const ends = [i, i + 1].map((k) => `${this.x(this.at[k]).toFixed(1)} ${this.y(route[k][2]).toFixed(1)}`);
      parts[states.legs[i][0]].push(`M${ends.join("L")}`);
    }
    for (const kind of ["leg-under", "leg"]) for (const [state, legs] of Object.entries(parts)) {
      if (legs.length) svg("path", { d: legs.join(""), class: `${kind} ${state}` }, this.front);
    }
    if (this.flown?.track?.length) {
      const points = this.flown.track.map((p, i) => `${this.x(Math.min(this.length, this.flown.along[i])).toFixed(1)} ${this.y(p[2]).toFixed(1)}`);
      svg("path", { d: `M${points.join("L")}`, class: `track${this.flown.stale ? " stale" : ""}` }, this.front);
    }
  }

  // Draw one dot for each item, where the path first passes it.
  drawDots() {
    clear(this.dots);
    const worst = cornerStates(this.model), seen = new Set(), many = this.model.items.length > MANY ? {} : null;
    this.places = [];
    this.model.of.forEach((k, i) => {
      if (k < 0 || seen.has(k)) return;
      seen.add(k);
      const up = this.dotAltitude(k, i), x = this.x(this.at[i]), y = this.y(up);
      this.places.push({ k, x, y, up });
      if (i && up !== this.model.route[i][2]) {
        const start = `${this.x(this.at[i - 1]).toFixed(1)} ${this.y(this.model.route[i - 1][2]).toFixed(1)}`;
        const glide = svg("path", { d: `M${start}L${x.toFixed(1)} ${y.toFixed(1)}`, class: "glide" }, this.dots);
        svg("title", {}, glide).textContent = "glide to the touchdown";
      }
      const state = worst.get(k)?.[0] || "ok";
      if (many && k !== this.selected) (many[state] ||= []).push(`M${x.toFixed(1)} ${y.toFixed(1)}h.01`);
      else svg("circle", { cx: x, cy: y, r: 5.5, class: `dot ${state}${k === this.selected ? " selected" : ""}` }, this.dots);
    });
    for (const [state, points] of Object.entries(many || {})) svg("path", { d: points.join(""), class: `dot many ${state}` }, this.dots);
    const item = this.places.find((one) => one.k === this.selected);
    if (item) {
      const text = svg("text", { x: Math.min(this.width - 60, item.x + 9), y: item.y - 8, class: "number" }, this.dots);
      text.textContent = `${this.model.items.find((one) => one.k === item.k)?.seq}: ${plain(item.up)} m`;
    }
  }

  select(k) {
    this.selected = k;
    if (this.model && this.width) this.drawDots();
  }

  hit(x, y, touch) {
    let best = null, least = touch ? 26 : 15;
    for (const one of this.places || []) {
      const away = Math.hypot(one.x - x, one.y - y);
      if (away <= least) [best, least] = [one, away];
    }
    return best;
  }
}

// Return the parts of a line of [distance, height] whose heights are known.
function knownParts(line) {
  const parts = [[]];
  for (const point of line) {
    if (Number.isFinite(point[1])) parts[parts.length - 1].push(point);
    else if (parts[parts.length - 1].length) parts.push([]);
  }
  return parts.filter((part) => part.length);
}
