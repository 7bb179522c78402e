// Handle mouse, touch, wheel and keys on the map and on the profile.

import { plain } from "/axes.js";
import { byWorst, heightWords, legStates } from "/map.js";

const STEP = 10, FAR = 100, UP = 5;
// Maximum number of legs that are named where several lie over each other.
const MOST_LEGS = 3;

export class Hands {
  // app: model(), link, map, profile, grid(), select(k), hint(lines, x, y), commit(message), begin(k), cancel()
  constructor(app) {
    this.app = app;
    this.pointers = new Map();
    const { root } = app.map;
    root.addEventListener("pointerdown", (event) => this.down(event));
    root.addEventListener("pointermove", (event) => this.move(event));
    root.addEventListener("pointerup", (event) => this.up(event));
    root.addEventListener("pointercancel", (event) => this.up(event, true));
    root.addEventListener("pointerleave", () => { if (!this.drag) app.leave(); });
    root.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
    root.addEventListener("dblclick", (event) => event.preventDefault());
    root.addEventListener("focusin", (event) => {
      const k = event.target.dataset?.k;
      if (k !== undefined) app.select(Number(k), true);
    });
    const side = app.profile.root;
    side.addEventListener("pointerdown", (event) => this.sideDown(event));
    side.addEventListener("pointermove", (event) => this.sideMove(event));
    side.addEventListener("pointerup", (event) => this.sideUp(event));
    side.addEventListener("pointercancel", (event) => this.sideUp(event, true));
    addEventListener("keydown", (event) => this.key(event));
  }

  at(event, root) {
    // During a drag the page does not move, so reuse the box: measuring it would lay out the whole page again.
    const held = this.drag || this.side, box = (held?.root === root && held.box) || root.getBoundingClientRect();
    if (held) Object.assign(held, { root, box });
    return [event.clientX - box.left, event.clientY - box.top];
  }

  // ---- the map

  down(event) {
    if (event.button > 0 || !this.app.model()) return;
    const { map } = this.app, [x, y] = this.at(event, map.root);
    map.root.setPointerCapture(event.pointerId);
    this.pointers.set(event.pointerId, [x, y]);
    if (this.pointers.size === 2) return this.pinch();
    const hit = map.hit(x, y, event.pointerType === "touch");
    if (hit && hit.item !== undefined) {
      this.drag = { k: hit.item, rev: this.app.rev(), from: [x, y], moved: false };
      this.app.select(hit.item);
    } else if (hit) {
      this.drag = { after: hit.after, rev: this.app.rev(), from: [x, y], to: [x, y], moved: false };
    } else {
      this.drag = { pan: true, last: [x, y], from: [x, y], moved: false };
    }
  }

  move(event) {
    const { app } = this, { map } = app, [x, y] = this.at(event, map.root);
    if (this.pointers.has(event.pointerId)) this.pointers.set(event.pointerId, [x, y]);
    if (this.spread && this.pointers.size === 2) return this.pinching();
    const { drag } = this;
    if (event.pointerType !== "touch") app.showPlace(map.view.eastAt(x), map.view.northAt(y));
    if (!drag) return this.hover(x, y, event.pointerType);
    if (!drag.moved && Math.hypot(x - drag.from[0], y - drag.from[1]) < 3) return;
    drag.moved = true;
    if (drag.pan) {
      map.view.pan(x - drag.last[0], y - drag.last[1]);
      drag.last = [x, y];
      map.layOut();
    } else if (drag.k !== undefined) {
      this.drop = { k: drag.k, east: map.view.eastAt(x), north: map.view.northAt(y) };
      app.begin(drag.k);
      map.dragged(drag.k, this.drop.east, this.drop.north);
      app.link.drag({ rev: drag.rev, ...this.drop });
      this.words(drag.k, x, y, this.drop);
    } else {
      drag.to = [x, y];
      app.hint(["insert a waypoint here"], x, y);
    }
  }

  up(event, cancelled) {
    const { app, drag } = this;
    this.pointers.delete(event.pointerId);
    if (this.spread) {
      if (this.pointers.size === 0) this.spread = this.drag = null;
      return;
    }
    this.drag = null;
    if (!drag) return;
    if (drag.k !== undefined && drag.moved) {
      if (cancelled) return app.cancel();
      app.commit({ kind: "move", rev: drag.rev, ...this.drop });
    } else if (drag.after !== undefined && !cancelled) {
      const [x, y] = drag.to;
      app.selectAfter(drag.after);
      app.commit({ kind: "insert", rev: drag.rev, after: drag.after, east: app.map.view.eastAt(x), north: app.map.view.northAt(y) });
    } else if (drag.pan && !drag.moved) {
      app.select(null);
    }
    app.hint(null);
  }

  // A new mission has arrived: continue a drag if it has the same items, otherwise end the drag.  Returns true if one continues.
  onSheet(same, rev) {
    const held = [this.drag, this.side].filter((one) => one && one.rev !== undefined);
    if (same) for (const one of held) one.rev = rev;
    else if (held.length) {
      this.stopDrag();
      this.app.complain("The mission has changed in the meantime, so the drag was not applied.");
    }
    return same && held.some((one) => one.moved);
  }

  stopDrag() {
    this.drag = this.side = null;
    this.app.profile.hold(false);
    this.app.hint(null);
  }

  pinch() {
    if (this.drag?.k !== undefined && this.drag.moved) this.app.cancel();
    this.drag = null;
    const [a, b] = [...this.pointers.values()];
    this.spread = { size: Math.hypot(a[0] - b[0], a[1] - b[1]), middle: [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2] };
  }

  pinching() {
    const [a, b] = [...this.pointers.values()], { view } = this.app.map;
    const size = Math.hypot(a[0] - b[0], a[1] - b[1]), middle = [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2];
    view.pan(middle[0] - this.spread.middle[0], middle[1] - this.spread.middle[1]);
    view.zoom(size / Math.max(1, this.spread.size), ...middle);
    this.spread = { size, middle };
    this.app.map.layOut();
  }

  wheel(event) {
    event.preventDefault();
    const { map } = this.app, by = event.deltaMode === 1 ? 16 * event.deltaY : event.deltaY;
    map.view.zoom(Math.exp(-by * 0.0016), ...this.at(event, map.root));
    map.layOut();
  }

  hover(x, y, kind) {
    const { app } = this, model = app.model();
    if (!model || kind === "touch") return;
    const hit = app.map.hit(x, y, false);
    app.map.root.classList.toggle("on-item", hit?.item !== undefined);
    app.map.root.classList.toggle("on-middle", hit?.after !== undefined);
    if (hit?.item !== undefined) return this.words(hit.item, x, y);
    if (hit) return app.hint(["insert a waypoint here"], x, y);
    const legs = app.map.legsAt(x, y);
    if (!legs.length) return app.hint(null);
    const [[name, text], ...others] = legs.slice(0, MOST_LEGS).map((leg) => legWords(model, leg));
    app.hint([name, text, ...others.map((words) => words.filter(Boolean).join(": "))], x, y, model.states.legs[legs[0]][0]);
  }

  // Show numbers next to the pointer: heights, and the closest limits of the item's corner and legs.
  words(k, x, y, place) {
    this.said = [k, x, y, place];
    const { app } = this, model = app.model(), item = model.items.find((one) => one.k === k);
    if (!item) return;
    // An item with a height above ground moves vertically with the terrain: take its height from the newest route.
    const passed = place ? model.of.indexOf(k) : -1, up = place?.up ?? (passed < 0 || item.touchdown ? item.at[2] : model.route[passed][2]);
    const [east, north] = place ? [place.east, place.north] : item.at;
    const unseen = model.of.includes(k) || item.at[2] === null ? [] : ["not flown"];
    const rows = model.states.corners.filter((_, i) => model.of[i] === k).concat(legStates(model, k));
    rows.sort(byWorst);
    const worst = rows.length ? rows[0][0] : "ok", lines = [...new Set(rows.filter((row) => row[1]).map((row) => row[1]))];
    const fault = app.dragFault();
    app.hint([`${item.seq}: ${heightWords(app.grid(), east, north, up)}`, ...(fault ? [fault] : unseen.concat(lines.slice(0, 3)))], x, y, fault ? "fail" : worst);
  }

  // Show the numbers of a drag again after its verdict has arrived.
  again() {
    if ((this.drag?.moved && this.drag.k !== undefined) || this.side?.moved) this.words(...this.said);
  }

  // ---- the profile

  sideDown(event) {
    if (event.button > 0 || !this.app.model()) return;
    const { profile } = this.app, [x, y] = this.at(event, profile.root);
    const hit = profile.hit(x, y, event.pointerType === "touch");
    if (!hit) return;
    profile.root.setPointerCapture(event.pointerId);
    this.app.select(hit.k);
    this.side = { ...hit, rev: this.app.rev(), from: y, moved: false };
  }

  sideMove(event) {
    const { app, side } = this, { profile } = app, [x, y] = this.at(event, profile.root);
    if (!side) {
      const hit = app.model() && profile.hit(x, y, false);
      profile.root.classList.toggle("on-item", Boolean(hit));
      if (hit) this.words(hit.k, event.clientX - app.map.root.getBoundingClientRect().left, event.clientY - app.map.root.getBoundingClientRect().top);
      else app.hint(null);
      return;
    }
    if (!side.moved && Math.abs(y - side.from) < 3) return;
    side.moved = true;
    const item = app.model().items.find((one) => one.k === side.k);
    profile.hold(true);
    side.to = Math.max(-500, Math.min(9000, side.up + (side.from - y) * profile.metresPerPixel()));
    app.begin(side.k);
    app.raised(side.k, side.to);
    const place = { k: side.k, east: item.at[0], north: item.at[1], up: side.to };
    app.link.drag({ rev: side.rev, ...place });
    const box = app.map.root.getBoundingClientRect();
    this.words(side.k, event.clientX - box.left, event.clientY - box.top, place);
  }

  sideUp(_event, cancelled) {
    const { app, side } = this;
    this.side = null;
    app.profile.hold(false);
    app.hint(null);
    if (!side || !side.moved) return;
    if (cancelled) app.cancel();
    else app.commit({ kind: "move", rev: side.rev, k: side.k, up: side.to });
  }

  // ---- keys

  key(event) {
    const { app } = this, control = event.ctrlKey || event.metaKey;
    const typing = event.target.closest?.("input, select, textarea");
    if (control && event.key.toLowerCase() === "z" && !typing) {
      event.preventDefault();
      return app.send({ kind: event.shiftKey ? "redo" : "undo" });
    }
    if (control && event.key.toLowerCase() === "y" && !typing) {
      event.preventDefault();
      return app.send({ kind: "redo" });
    }
    if (control && event.key.toLowerCase() === "s") {
      event.preventDefault();
      return app.save();
    }
    if (event.key === "Escape") {
      if (this.drag?.moved || this.side?.moved) {
        this.stopDrag();
        app.cancel();
      }
      return app.hint(null);
    }
    // All other keys are for the map and the profile; keys typed into a field must not change a waypoint.
    if (control || event.altKey || !app.model() || !event.target.closest?.("#map, #profile")) return undefined;
    return this.keyOnMap(event);
  }

  keyOnMap(event) {
    const { app } = this, { items } = app.model(), k = app.selected(), i = items.findIndex((one) => one.k === k), item = items[i];
    const others = { n: Math.min(i + 1, items.length - 1), p: Math.max(i - 1, 0), Home: 0, End: items.length - 1 };
    const other = others[event.key.length === 1 ? event.key.toLowerCase() : event.key];
    if (other !== undefined) {
      event.preventDefault();
      return app.select(items[other].k);
    }
    if (!item) return undefined;
    const far = event.shiftKey ? FAR : STEP;
    const sides = { ArrowUp: [0, far], ArrowDown: [0, -far], ArrowLeft: [-far, 0], ArrowRight: [far, 0] };
    if (sides[event.key]) {
      event.preventDefault();
      const [east, north] = sides[event.key];
      return app.nudge(k, { east: item.at[0] + east, north: item.at[1] + north });
    }
    if (event.key === "PageUp" || event.key === "PageDown") {
      event.preventDefault();
      const by = (event.key === "PageUp" ? 1 : -1) * (event.shiftKey ? 50 : UP);
      if (item.at[2] === null) return app.complain(`Item ${item.seq} is not flown, so it has no height here.`);
      return app.nudge(k, { up: Math.max(-500, Math.min(9000, item.at[2] + by)) });
    }
    if (event.key === "Delete" || event.key === "Backspace") {
      event.preventDefault();
      return app.commit({ kind: "delete", ks: [k] });
    }
    if (event.key === "Insert") {
      event.preventDefault();
      const next = items[i + 1];
      if (!next) return undefined;
      app.selectAfter(k);
      return app.commit({ kind: "insert", after: k, east: (item.at[0] + next.at[0]) / 2, north: (item.at[1] + next.at[1]) / 2 });
    }
    return undefined;
  }
}

// Return the name of a leg, and its closest limit.
function legWords(model, leg) {
  const [state, text] = model.states.legs[leg], to = model.items.find((one) => one.k === model.of[leg + 1]);
  return [to ? `leg ${leg} (to item ${to.seq})` : `leg ${leg}`, text || (state === "ok" ? "passes" : "")];
}

export const words = plain;
