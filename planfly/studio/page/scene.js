// Draw the mission in three dimensions: shaded ground, with path and flight above it; a drag turns the view.

import { groundAt } from "/axes.js";

const FACES = 90, RISE = 3;

export class Scene {
  // onTurn: called when the view has turned.
  constructor(canvas, onTurn) {
    this.canvas = canvas;
    this.onTurn = onTurn;
    Object.assign(this, { turn: -0.5, tilt: 0.55, zoom: 1 });
    const held = { on: false };
    canvas.addEventListener("pointerdown", (event) => { canvas.setPointerCapture(event.pointerId); Object.assign(held, { on: true, x: event.clientX, y: event.clientY }); });
    canvas.addEventListener("pointermove", (event) => {
      if (!held.on) return;
      this.turn += (event.clientX - held.x) * 0.008;
      this.tilt = Math.min(1.5, Math.max(0.12, this.tilt + (event.clientY - held.y) * 0.006));
      Object.assign(held, { x: event.clientX, y: event.clientY });
      this.later();
      this.onTurn();
    });
    for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, () => { held.on = false; });
    canvas.addEventListener("wheel", (event) => { event.preventDefault(); this.enlarge(Math.exp(-event.deltaY * 0.0014)); }, { passive: false });
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.later());
  }

  resize(width, height) {
    const fine = Math.min(2, devicePixelRatio || 1);
    Object.assign(this.canvas, { width: Math.round(width * fine), height: Math.round(height * fine) });
    Object.assign(this, { width, height, fine });
  }

  show(now) {
    this.now = now;
    this.later();
  }

  later() {
    if (this.asked || this.canvas.hidden) return;
    this.asked = true;
    requestAnimationFrame(() => { this.asked = false; this.draw(); });
  }

  enlarge(factor) {
    this.zoom = Math.min(12, Math.max(0.4, this.zoom * factor));
    this.later();
  }

  // Return the direction of north in a view from above, degrees clockwise from up.
  northward() {
    return (-180 * this.turn) / Math.PI;
  }

  colour(name) {
    return getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
  }

  // Compute the centre and the scale of the view, for the path with some ground around it.
  frame() {
    const { model, world } = this.now, points = model.route;
    const side = (axis) => [Math.min(...points.map((p) => p[axis])), Math.max(...points.map((p) => p[axis]))];
    const [east, north] = [side(0), side(1)], rim = 0.15 * Math.max(east[1] - east[0], north[1] - north[0], 1500);
    const clip = ([low, high], [least, most]) => [Math.max(low - rim, least), Math.min(high + rim, most)];
    const shown = world.shown;
    this.east = clip(east, shown[0]);
    this.north = clip(north, shown[1]);
    const grid = this.now.grid, ups = points.map((p) => p[2]);
    this.base = grid ? Math.min(...ups, groundAt(grid, (this.east[0] + this.east[1]) / 2, (this.north[0] + this.north[1]) / 2)) : Math.min(...ups);
    const span = Math.max(this.east[1] - this.east[0], this.north[1] - this.north[0]);
    this.scale = (0.92 * Math.min(this.width, 1.5 * this.height) * this.zoom) / span;
  }

  // Return x and y in pixels, and the distance behind the centre.
  point(east, north, up) {
    const e = east - (this.east[0] + this.east[1]) / 2, n = north - (this.north[0] + this.north[1]) / 2;
    const cos = Math.cos(this.turn), sin = Math.sin(this.turn), across = e * cos - n * sin, deep = e * sin + n * cos;
    const y = deep * Math.sin(this.tilt) + (up - this.base) * RISE * Math.cos(this.tilt);
    return [this.width / 2 + across * this.scale, this.height * 0.55 - y * this.scale, deep];
  }

  draw() {
    if (!this.now?.model || !this.now.world || !this.width) return;
    const pen = this.canvas.getContext("2d");
    this.frame();
    pen.setTransform(this.fine, 0, 0, this.fine, 0, 0);
    pen.fillStyle = this.colour("sky");
    pen.fillRect(0, 0, this.width, this.height);
    this.drawGround(pen);
    this.drawWay(pen);
    pen.fillStyle = this.colour("quiet");
    pen.font = "12px system-ui, sans-serif";
    pen.fillText(`heights ${RISE} times; drag to turn, wheel to zoom`, 12, this.height - 12);
  }

  drawGround(pen) {
    const { grid } = this.now;
    if (!grid) return;
    const ramp = [0, 1, 2, 3, 4].map((k) => hex(this.colour(`ground-${k}`)));
    const e = (i) => this.east[0] + ((this.east[1] - this.east[0]) * i) / FACES, n = (j) => this.north[0] + ((this.north[1] - this.north[0]) * j) / FACES;
    const heights = [], points = [];
    let low = Infinity, high = -Infinity;
    for (let j = 0; j <= FACES; j++) for (let i = 0; i <= FACES; i++) {
      const up = groundAt(grid, e(i), n(j));
      heights.push(up);
      points.push(this.point(e(i), n(j), up));
      if (up < low) low = up;
      if (up > high) high = up;
    }
    const faces = [], de = (this.east[1] - this.east[0]) / FACES, dn = (this.north[1] - this.north[0]) / FACES;
    for (let j = 0; j < FACES; j++) for (let i = 0; i < FACES; i++) {
      const at = j * (FACES + 1) + i, corners = [at, at + 1, at + FACES + 2, at + FACES + 1];
      if (corners.some((one) => Number.isNaN(heights[one]))) continue;
      const slopeE = (RISE * (heights[at + 1] - heights[at])) / de, slopeN = (RISE * (heights[at + FACES + 1] - heights[at])) / dn;
      const lit = 0.62 + 0.38 * ((0.5 * slopeE - 0.5 * slopeN + 0.8) / Math.hypot(1, slopeE, slopeN));
      faces.push([points[at][2], corners, mixed(ramp, (heights[at] - low) / Math.max(1, high - low), lit)]);
    }
    faces.sort((a, b) => b[0] - a[0]);
    pen.lineWidth = 0.7;
    for (const [, corners, colour] of faces) {
      pen.beginPath();
      corners.forEach((one, k) => (k ? pen.lineTo(points[one][0], points[one][1]) : pen.moveTo(points[one][0], points[one][1])));
      pen.closePath();
      pen.fillStyle = pen.strokeStyle = colour;
      pen.fill();
      pen.stroke();
    }
  }

  drawWay(pen) {
    const { model, flown, grid } = this.now, colours = { ok: "planned", near: "commanded", open: "quiet", fail: "fail" };
    pen.lineCap = pen.lineJoin = "round";
    for (const zone of this.now.world.zones) this.walls(pen, zone);
    for (const threat of this.now.world.threats) if (threat.kill) this.ball(pen, threat);
    pen.strokeStyle = this.colour("pole");
    pen.lineWidth = 0.8;
    for (const [east, north, up] of model.route) {
      const ground = groundAt(grid, east, north);
      if (!Number.isNaN(ground)) this.line(pen, [[east, north, ground], [east, north, up]]);
    }
    // Draw in the order of `colours`, the worst state last.
    const legs = Object.keys(colours).flatMap((state) => model.path.filter((_, k) => model.states.legs[k][0] === state).map((flat) => [state, flat]));
    for (const [state, flat] of legs) {
      const points = [];
      for (let i = 0; i < flat.length; i += 3) points.push([flat[i], flat[i + 1], flat[i + 2]]);
      pen.strokeStyle = this.colour(colours[state]);
      pen.lineWidth = state === "fail" ? 5 : 4;
      this.line(pen, points);
    }
    pen.strokeStyle = this.colour("quiet");
    pen.lineWidth = 1.5;
    pen.setLineDash([5, 4]);
    for (const item of model.items.filter((one) => one.touchdown)) {
      const end = model.of.indexOf(item.k);
      if (end > 0 && item.at[2] !== model.route[end][2]) this.line(pen, [model.route[end - 1], item.at]);
    }
    pen.setLineDash([]);
    pen.strokeStyle = this.colour("flown");
    pen.lineWidth = 1.3;
    if (flown?.track?.length) this.line(pen, flown.track);
  }

  ball(pen, { at, kill }) {
    const [x, y] = this.point(...at);
    pen.beginPath();
    pen.ellipse(x, y, kill * this.scale, kill * this.scale * Math.hypot(Math.sin(this.tilt), RISE * Math.cos(this.tilt)), 0, 0, 2 * Math.PI);
    pen.strokeStyle = pen.fillStyle = this.colour("missile");
    pen.lineWidth = 1;
    pen.globalAlpha = 0.07;
    pen.fill();
    pen.globalAlpha = 0.55;
    pen.stroke();
    pen.globalAlpha = 1;
  }

  // Draw the walls of a zone; each wall has a lower and an upper end at each corner.
  walls(pen, { kind, walls }) {
    pen.strokeStyle = pen.fillStyle = this.colour(kind === "inclusion" ? "stay-in" : "zone");
    pen.lineWidth = 1.2;
    for (const wall of walls) {
      const ends = [...wall, wall[0]].map((corner) => corner.map((end) => this.point(...end)));
      pen.globalAlpha = kind === "inclusion" ? 0.04 : 0.13;
      for (let k = 1; k < ends.length; k++) {
        pen.beginPath();
        pen.moveTo(...ends[k - 1][0].slice(0, 2));
        for (const end of [ends[k - 1][1], ends[k][1], ends[k][0]]) pen.lineTo(end[0], end[1]);
        pen.fill();
      }
      pen.globalAlpha = 0.8;
      for (const edge of [0, 1]) this.line(pen, [...wall, wall[0]].map((corner) => corner[edge]));
    }
    pen.globalAlpha = 1;
  }

  line(pen, points) {
    pen.beginPath();
    points.forEach((p, k) => {
      const [x, y] = this.point(p[0], p[1], p[2]);
      if (k) pen.lineTo(x, y);
      else pen.moveTo(x, y);
    });
    pen.stroke();
  }
}

function hex(text) {
  return [1, 3, 5].map((at) => parseInt(text.slice(at, at + 2), 16));
}

function mixed(ramp, share, lit) {
  const at = Math.min(0.999, Math.max(0, share)) * (ramp.length - 1), k = Math.floor(at), t = at - k;
  const part = (c) => ((Math.min(1, lit) * (ramp[k][c] * (1 - t) + ramp[k + 1][c] * t)) / 255).toFixed(3);
  return `color(srgb ${part(0)} ${part(1)} ${part(2)})`;
}
