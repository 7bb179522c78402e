// The page: what the server sends is drawn, and what hands do is sent.

import { clear, element, groundAt, plain } from "/axes.js";
import { Hands } from "/hands.js";
import { Link } from "/link.js";
import { MapView } from "/map.js";
import { Panel } from "/panel.js";
import { Profile } from "/profile.js";
import { Scene } from "/scene.js";

const $ = (id) => document.getElementById(id);
const map = new MapView($("map")), profile = new Profile($("profile"));
const now = { world: null, sheet: null, model: null, grid: null, flown: null, selected: null, dragging: null, fault: "", work: {}, committed: false, queue: [] };
let fitted = "", scene = null;

// ---- what the server sends

function onWorld(world) {
  now.world = world;
  map.setWorld(world);
  panel.world(world);
  if (now.model) drawAll();
}

function onSheet(sheet) {
  const before = now.sheet;
  now.sheet = now.model = sheet;
  now.fault = "";
  link.settle();
  now.dragging = null;
  map.root.classList.remove("dragging");
  $("panel-verdict").classList.remove("before");
  if (now.after !== undefined) {
    const items = sheet.items, i = items.findIndex((one) => one.k === now.after);
    if (i >= 0 && items[i + 1] && before && before.items.length < items.length) now.selected = items[i + 1].k;
    now.after = undefined;
  }
  if (!sheet.items.some((one) => one.k === now.selected)) now.selected = null;
  drawAll();
  if (fitted !== sheet.name) {
    fitted = sheet.name;
    map.fit();
  }
  answers();
  panel.sheet(sheet);
  $("name").textContent = sheet.name + (sheet.changed ? " \u2022" : "");
  $("name").title = sheet.changed ? `${sheet.name}, changed` : sheet.name;
  document.title = `${sheet.changed ? "\u2022 " : ""}${sheet.name} \u2013 planfly studio`;
  for (const side of ["undo", "redo"]) {
    $(side).disabled = !sheet[side];
    $(side).title = sheet[side] ? `${side === "undo" ? "Undo" : "Redo"}: ${sheet[side]}` : side === "undo" ? "Nothing to undo" : "Nothing to redo";
  }
  say(`Geometry: ${sheet.verdict.headline}`);
  document.documentElement.dataset.rev = sheet.rev;
  now.committed = false;
  if (now.queue.length) app.commit(now.queue.shift());
}

// A verdict on a drag: of all, or of the legs about the item, which are put in their places.
function onPreview(message) {
  if (!now.dragging || message.rev !== now.sheet.rev) return;
  now.fault = message.fault || "";
  if (message.fault) {
    document.documentElement.dataset.shown = message.n;
    return answers();
  }
  if (message.sheet) {
    now.model = { ...now.sheet, ...message.sheet };
    now.checking = false;
  } else {
    now.checking = true;
    if (message.total_legs !== now.model.path.length) {
      document.documentElement.dataset.shown = message.n;
      return answers();
    }
    now.model = merged(now.model, message.windows);
  }
  hold();
  if (message.sheet) map.show(now.model);
  else map.update(now.model);
  profile.show(now.model, now.world, now.grid, shownFlight());
  answers();
  hands.again();
  document.documentElement.dataset.shown = message.n;
}

function merged(model, windows) {
  const copy = { ...model, profile: null, route: [...model.route], path: [...model.path] };
  copy.states = { legs: [...model.states.legs], corners: [...model.states.corners] };
  for (const one of windows) {
    copy.route.splice(one.first, one.route.length, ...one.route);
    copy.path.splice(one.first, one.path.length, ...one.path);
    copy.states.legs.splice(one.first, one.states.legs.length, ...one.states.legs);
    copy.states.corners.splice(one.first, one.states.corners.length, ...one.states.corners);
  }
  return copy;
}

// The dragged item stays below the hand, whatever the server has seen of it.
function hold() {
  const drop = now.dragging?.drop;
  if (!drop) return;
  now.model = { ...now.model, items: now.model.items.map((item) => (item.k === now.dragging.k ? { ...item, at: [drop.east, drop.north, drop.up ?? item.at[2]] } : item)) };
}

function onFlown(flown) {
  now.flown = flown;
  now.work.fly = null;
  progress();
  if (now.model) {
    profile.show(now.model, now.world, now.grid, shownFlight());
    map.setTrack(flown.track, isStale());
    scene?.show(now);
  }
  document.documentElement.dataset.flown = flown.rev;
  answers();
  panel.flown(flown, isStale());
  if (!isStale()) say(`Flown: ${flown.verdict.headline}`);
}

function onWorking(work) {
  now.work[work.job] = work;
  progress();
  answers();
  panel.working(work);
}

function onStopped({ job }) {
  now.work[job] = null;
  progress();
  answers();
  panel.stopped(job);
}

function isStale() {
  return !now.flown || !now.sheet || now.flown.rev !== now.sheet.rev || Boolean(now.dragging);
}

function shownFlight() {
  return now.flown ? { ...now.flown, stale: isStale() } : null;
}

function drawAll() {
  if (!now.world || !now.model) return;
  profile.selected = now.selected;
  map.show(now.model);
  map.select(now.selected);
  map.setTrack(now.flown?.track, isStale());
  profile.show(now.model, now.world, now.grid, shownFlight());
  scene?.show(now);
}

// ---- the answers in the header

const SHORT = { ok: "flyable", open: "not judged in full", fail: "not flyable" };

function answers() {
  const { model, flown } = now;
  if (!model) return;
  const unplanned = model.items.length === 2 && now.work.plan;
  const state = now.fault ? "fail" : model.verdict.state;
  const failing = [...model.states.legs, ...model.states.corners].filter((one) => one[0] === "fail").length;
  let words = SHORT[state];
  let shown = state;
  if (now.dragging && now.checking && !now.fault) {
    shown = failing ? "fail" : "checking";
    words = failing ? `${failing} ${failing === 1 ? "place fails" : "places fail"}` : "checking \u2026";
  } else if (state === "fail" && !now.fault) words = `not flyable: ${model.verdict.failed} ${model.verdict.failed === 1 ? "finding" : "findings"}`;
  setAnswer("geometry", unplanned ? "none" : shown, unplanned ? "planning \u2026" : now.fault || words, model.verdict.headline);
  const work = now.work.fly;
  if (work && !now.dragging) setAnswer("flown", "checking", `flying ${Math.round(100 * (work.share || 0))} %`, work.text || "");
  else if (!flown) setAnswer("flown", "none", "not yet", "");
  else if (isStale()) setAnswer("flown", "stale", "changed since", flown.verdict.headline);
  else setAnswer("flown", flown.verdict.state, SHORT[flown.verdict.state], flown.verdict.headline);
}

function setAnswer(id, state, words, title) {
  const box = $(id);
  box.dataset.state = state;
  box.title = title || words;
  box.querySelector("span").textContent = words;
}

function progress() {
  const works = Object.values(now.work).filter(Boolean);
  $("stop").hidden = !works.length;
  const long = works.find((one) => one.job !== "fly") || works[0];
  $("progress").hidden = !long;
  if (long) $("progress").firstElementChild.style.width = `${Math.round(100 * (long.share || 0.02))}%`;
}

let saidTimer = 0;
function say(text) {
  clearTimeout(saidTimer);
  saidTimer = setTimeout(() => { $("live").textContent = text; }, 200);
}

let faultTimer = 0;
function complain(text, stays) {
  const box = $("message");
  box.textContent = text;
  box.hidden = !text;
  clearTimeout(faultTimer);
  if (text && !stays) faultTimer = setTimeout(() => { box.hidden = true; }, 9000);
}

// ---- what hands do

const app = {
  map, profile,
  get link() { return link; },
  model: () => now.model,
  grid: () => now.grid,
  rev: () => now.sheet.rev,
  selected: () => now.selected,
  dragFault: () => now.fault,
  select(k, focused) {
    if (now.selected === k) return;
    now.selected = k;
    map.select(k);
    profile.select(k);
    panel.select(k);
    if (!focused && k !== null) map.marks.find((mark) => Number(mark.dataset.k) === k)?.focus({ preventScroll: true });
  },
  selectAfter(k) { now.after = k; },
  begin(k) {
    if (!now.dragging) {
      now.dragging = { k };
      now.checking = true;
      map.root.classList.add("dragging");
      $("panel-verdict").classList.add("before");
      map.setTrack(now.flown?.track, true);
    }
    now.dragging.drop = hands.drop?.k === k ? hands.drop : null;
  },
  raised(k, up) {
    now.dragging.drop = { ...(now.model.items.find((one) => one.k === k) || {}), k, up };
    const item = now.model.items.find((one) => one.k === k);
    now.dragging.drop = { east: item.at[0], north: item.at[1], up };
    hold();
    now.model = { ...now.model, profile: now.model.profile, route: now.model.route.map((p, i) => (now.model.of[i] === k ? [p[0], p[1], up] : p)) };
    profile.show(now.model, now.world, now.grid, shownFlight());
  },
  cancel() {
    now.dragging = null;
    now.fault = "";
    map.root.classList.remove("dragging");
    $("panel-verdict").classList.remove("before");
    link.settle();
    now.model = now.sheet;
    drawAll();
    answers();
    app.hint(null);
  },
  // One edit at a time is on its way: the next counts from the sheet that it comes to.
  commit(message) {
    link.settle();
    if (now.nudged) {
      const nudged = now.nudged;
      clearTimeout(now.nudgeTimer);
      now.nudged = null;
      app.commit({ kind: "move", ...nudged });
    }
    if (now.committed) now.queue.push(message);
    else if (link.send({ rev: now.sheet.rev, ...message })) now.committed = true;
    else app.cancel();
  },
  refused() {
    now.committed = false;
    now.queue = [];
  },
  // Keys come faster than answers: they add up, and are sent as one.
  nudge(k, to) {
    const item = now.model.items.find((one) => one.k === k);
    now.model = { ...now.model, items: now.model.items.map((one) => (one === item ? { ...one, at: [to.east ?? one.at[0], to.north ?? one.at[1], to.up ?? one.at[2]] } : one)) };
    now.nudged = { ...(now.nudged?.k === k ? now.nudged : { k }), ...to };
    if (to.east !== undefined) map.dragged(k, to.east, to.north);
    clearTimeout(now.nudgeTimer);
    now.nudgeTimer = setTimeout(() => {
      const nudged = now.nudged;
      now.nudged = null;
      if (nudged) app.commit({ kind: "move", ...nudged });
    }, 60);
  },
  hint(lines, x, y, state) {
    const box = $("hint");
    if (!lines) {
      box.hidden = true;
      return;
    }
    clear(box).append(...lines.filter(Boolean).map((line, i) => element(i ? "span" : "b", {}, line)));
    box.dataset.state = state || "";
    box.hidden = false;
    const own = map.root.getBoundingClientRect(), views = $("views").getBoundingClientRect();
    const left = own.left - views.left + x + 18, top = own.top - views.top + y + 16;
    box.style.left = `${Math.max(4, Math.min(left, views.width - box.offsetWidth - 6))}px`;
    box.style.top = `${top + box.offsetHeight > views.height - 4 ? top - box.offsetHeight - 34 : top}px`;
  },
  showPlace(east, north) {
    const ground = groundAt(now.grid, east, north);
    $("place").textContent = `${plain(east / 1000, 2)} km E, ${plain(north / 1000, 2)} km N${Number.isNaN(ground) ? "" : `, ground ${plain(ground)} m`}`;
  },
  send: (message) => link.send(message),
  complain,
  save: () => panel.save(),
  now,
  goTo(finding) {
    const { model } = now;
    let points = [];
    if (finding.kind === "leg" && model.path[finding.index]) points = triplets(model.path[finding.index]);
    else if (finding.kind === "waypoint" && model.route[finding.index]) {
      points = [model.route[finding.index]];
      if (model.of[finding.index] >= 0) app.select(model.of[finding.index], true);
    } else if (["missile", "radar"].includes(finding.kind)) {
      const one = now.world.threats[finding.index], r = one.kill || one.detection;
      points = [[one.at[0] - r, one.at[1] - r], [one.at[0] + r, one.at[1] + r]];
    } else if (["exclusion", "inclusion"].includes(finding.kind)) points = now.world.zones[finding.index].rings[0];
    if (!points.length) return;
    const [east, north] = map.extentOf(points), rim = Math.max(400, 0.7 * Math.max(east[1] - east[0], north[1] - north[0]));
    map.view.fit([[east[0] - rim, east[1] + rim], [north[0] - rim, north[1] + rim]]);
    map.layOut();
  },
  ways(list, shown) { map.setWays(list, shown); },
};

function triplets(flat) {
  const found = [];
  for (let i = 0; i < flat.length; i += 3) found.push([flat[i], flat[i + 1]]);
  return found;
}

const panel = new Panel(app);
const hands = new Hands(app);
const link = new Link({
  open: () => complain(""),
  lost: (text) => { app.refused(); complain(text, true); },
  world: onWorld,
  sheet: onSheet,
  preview: onPreview,
  flown: onFlown,
  working: onWorking,
  stopped: onStopped,
  choices: (message) => panel.choices(message),
  ways: (message) => { now.work.plan = null; progress(); panel.ways(message); answers(); },
  saved: (message) => panel.saved(message),
  returns: (message) => { now.work.returns = null; progress(); panel.returns(message); },
  campaign: (message) => { now.work.campaign = null; progress(); panel.campaign(message); },
  fault: ({ text }) => { app.refused(); complain(text); if (now.dragging) app.cancel(); },
  stale: () => { app.refused(); complain("Another page has changed the mission: this is how it is now."); },
  picture: (picture) => map.setPicture(picture),
  heights: (grid) => { now.grid = grid; scene?.show(now); },
});

// ---- buttons, sizes, files

$("undo").onclick = () => link.send({ kind: "undo" });
$("redo").onclick = () => link.send({ kind: "redo" });
$("stop").onclick = () => link.send({ kind: "stop" });
for (const [id, factor] of [["zoom-in", 1.5], ["zoom-out", 1 / 1.5]]) {
  $(id).onclick = () => { map.view.zoom(factor, map.view.width / 2, map.view.height / 2); map.layOut(); };
}
$("fit").onclick = () => map.fit();
$("three").onclick = () => {
  const on = $("scene").hidden;
  $("scene").hidden = !on;
  $("three").setAttribute("aria-pressed", String(on));
  if (on && !scene) scene = new Scene($("scene"));
  if (on) { scene.resize(map.view.width, map.view.height); scene.show(now); }
};

function sizes() {
  const box = $("map-box").getBoundingClientRect(), side = $("profile-box").getBoundingClientRect();
  const before = map.view.width;
  const middle = [map.view.eastAt(map.view.width / 2), map.view.northAt(map.view.height / 2)];
  map.resize(Math.max(50, box.width), Math.max(50, box.height));
  if (before > 1) {
    map.view.east = middle[0] - map.view.width / 2 / map.view.scale;
    map.view.north = middle[1] + map.view.height / 2 / map.view.scale;
  }
  profile.resize(Math.max(50, side.width), Math.max(50, side.height));
  if (now.model) map.layOut();
  if (scene && !$("scene").hidden) { scene.resize(map.view.width, map.view.height); scene.show(now); }
}
new ResizeObserver(sizes).observe($("views"));
sizes();

let over = 0;
addEventListener("dragenter", (event) => { event.preventDefault(); over += 1; $("drop").hidden = false; });
addEventListener("dragover", (event) => event.preventDefault());
addEventListener("dragleave", () => { over -= 1; if (over <= 0) { over = 0; $("drop").hidden = true; } });
addEventListener("drop", (event) => {
  event.preventDefault();
  over = 0;
  $("drop").hidden = true;
  const file = event.dataTransfer?.files?.[0];
  if (file) panel.openFile(file);
});
