// Run the page: draw what the server sends, and send what the user does.

import { clear, element, groundAt, plain } from "/axes.js";
import { Hands } from "/hands.js";
import { drawCompass, drawLegend } from "/legend.js";
import { Link } from "/link.js";
import { MapView } from "/map.js";
import { Panel, QUESTIONS, answerText } from "/panel.js";
import { Profile } from "/profile.js";
import { Scene } from "/scene.js";

const $ = (id) => document.getElementById(id);
const STOPPED = "Stopped; earlier results stay.";
// Storage key of edits made while the server did not answer, for a page that is opened with the next server's token.
const WAITING = "planfly-studio-waiting";
const HISTORY = ["undo", "redo", "revert"];
const map = new MapView($("map")), profile = new Profile($("profile"));
const now = { world: null, sheet: null, model: null, grid: null, flown: null, selected: null, dragging: null, fault: "", work: {}, committed: null, queue: [], doubtful: null, lost: "" };
let fitted = 0, scene = null;

// ---- messages from the server

function onWorld(world) {
  now.world = world;
  map.setWorld(world);
  setGround();
  panel.world(world);
  drawLegend($("legend").querySelector("ul"), world);
  turnCompass();
  if (now.model) drawAll();
}

// Draw the compass of the map, or of the scene while it is shown.
function turnCompass() {
  if (now.world) drawCompass($("compass"), now.world.settings, inScene() ? scene.northward() : 0);
}

function inScene() {
  return scene && !$("scene").hidden;
}

// Show hints on editing until the first edit.
function showBegin() {
  $("begin").hidden = inScene() || Boolean(now.sheet?.undo || now.sheet?.redo);
}

// Set the ground, unless it belongs to another world.
function setGround() {
  const { world, heights, picture } = now;
  const own = (one) => one && world?.ground && JSON.stringify([one.east, one.north]) === JSON.stringify(world.shown);
  now.grid = own(heights) ? heights : null;
  map.setPicture(own(picture) ? picture : null);
  scene?.show(now);
  panel.drawItems();
}

function onSheet(sent) {
  const before = now.sheet || takeWaiting(sent.document), sheet = sent.planning ? unjudged(sent) : sent;
  sessionStorage.removeItem(WAITING);
  now.sent = sent;
  now.lost = "";
  const same = sameItems(before, sheet), opened = before && isOther(before, sheet);
  // An accepted edit clears the previous fault.
  if (now.committed) complain("");
  now.sheet = sheet;
  now.committed = null;
  if (opened) {
    now.flown = null;
    panel.forget();
  }
  now.model = withFlight(sheet);
  catchUp(before, sheet, same);
  if (hands.onSheet(same, sheet.rev)) hold();
  else {
    now.fault = "";
    link.settle();
    now.dragging = null;
    map.root.classList.remove("dragging");
    $("panel-verdict").classList.remove("before");
  }
  if (now.after !== undefined) {
    const items = sheet.items, i = items.findIndex((one) => one.k === now.after);
    if (i >= 0 && items[i + 1] && before && before.items.length < items.length) now.selected = items[i + 1].k;
    now.after = undefined;
  }
  if (!sheet.items.some((one) => one.k === now.selected)) now.selected = null;
  drawAll();
  if (fitted !== sheet.document) {
    fitted = sheet.document;
    map.fit();
  }
  answers();
  panel.sheet(sheet);
  showName(sheet.name, sheet.unsaved);
  for (const side of ["undo", "redo"]) {
    $(side).disabled = !sheet[side];
    $(side).title = sheet[side] ? `${side === "undo" ? "Undo" : "Redo"}: ${sheet[side]}` : side === "undo" ? "Nothing to undo" : "Nothing to redo";
  }
  say(sheet.planning ? "Planning a path" : `Geometry: ${sheet.verdict.headline}`);
  document.documentElement.dataset.rev = sheet.rev;
  showBegin();
  if (now.nudged && !now.queue.length) app.flush();
  else pump();
}

// Return a placeholder mission with all states undecided, for the straight line shown while the first path is planned.
function unjudged(sheet) {
  const open = (states) => states.map(() => ["open", ""]);
  return {
    ...sheet, findings: [], violated: { threats: [], zones: [] }, verdict: { ...sheet.verdict, state: "none", lines: [], headline: "" },
    states: { legs: open(sheet.states.legs), corners: open(sheet.states.corners) },
  };
}

// If the search has ended without a path, judge the straight line like any other mission.
function planningEnded(job) {
  if (job === "plan" && now.sheet?.planning) onSheet({ ...now.sent, planning: false });
}

// Return true if both missions have the same items, with at most one moved item, so that indices mean the same in both.
function sameItems(before, sheet) {
  if (!before || isOther(before, sheet) || before.items.length !== sheet.items.length) return false;
  let moved = 0;
  return before.items.every((one, i) => {
    const other = sheet.items[i];
    moved += one.lat !== other.lat || one.lon !== other.lon;
    return one.k === other.k && one.what === other.what && moved < 2;
  });
}

// Return true if another mission was opened, or its opening was undone.
function isOther(before, sheet) {
  return before.document !== sheet.document || before.name !== sheet.name;
}

// Move waiting edits on to a new mission if its indices mean the same; otherwise discard them.
function catchUp(before, sheet, same) {
  // An edit that was being sent when the connection was lost was applied if the items have changed since.
  if (now.doubtful && same && JSON.stringify(before.items) === JSON.stringify(sheet.items)) now.queue.unshift(now.doubtful);
  now.doubtful = null;
  const waiting = now.queue.length, other = before && isOther(before, sheet);
  now.queue = now.queue.filter((one) => (one.rev === undefined ? !(other && isEdit(one)) : same && one.rev === before.rev && (one.kind !== "apply" || one.rev === sheet.rev)));
  for (const one of now.queue) if (one.rev !== undefined) one.rev = sheet.rev;
  let left = now.queue.length < waiting;
  if (now.nudged && same) {
    now.nudged.rev = sheet.rev;
    now.model = placed(sheet, now.nudged.k, now.nudged);
  } else if (now.nudged) {
    now.nudged = null;
    left = true;
  }
  if (left) complain("The mission has changed in the meantime, so the last edit was not made.");
}

// Return a model with an item moved.
function placed(model, k, to) {
  return { ...model, items: model.items.map((one) => (one.k === k ? { ...one, at: [to.east ?? one.at[0], to.north ?? one.at[1], to.up ?? one.at[2]] } : one)) };
}

// Send one edit at a time; the next one waits for the mission that results.
// Edits that cannot be sent to the server wait, too; other requests are discarded.
function pump() {
  while (!now.committed && now.queue.length) {
    if (now.lost || !link.send(now.queue[0])) return sayLost(now.lost || "The studio does not answer.");
    const message = now.queue.shift();
    now.committed = message.rev === undefined ? null : message;
  }
  return undefined;
}

function isEdit({ rev, kind }) {
  return rev !== undefined || kind === "settings" || HISTORY.includes(kind);
}

// The connection is lost: state what happens to the edits.
function sayLost(text) {
  now.lost = text;
  now.doubtful = now.committed || now.doubtful;
  now.committed = null;
  now.queue = now.queue.filter(isEdit);
  const { sheet, queue, doubtful } = now, count = queue.length + (doubtful ? 1 : 0);
  if (!hands.drag?.moved && !hands.side?.moved) app.cancel();
  if (!sheet) return complain(text, true);
  if (!count) return complain(`${text} Your edits are saved.`, true);
  const { rev, name, items } = sheet;
  sessionStorage.setItem(WAITING, JSON.stringify({ sheet: { rev, name, items }, queue, doubtful }));
  const edits = count === 1 ? "1 edit is not saved: it is" : `${count} edits are not saved: they are`;
  return complain(`${text} ${edits} sent when the studio answers again in this tab.`, true);
}

// Take the edits that waited in this tab for another run of the studio; return the mission that they were made on, or null.
// Each run numbers its documents again, so name and items show if it is the same mission.
function takeWaiting(number) {
  const { sheet = null, queue = [], doubtful = null } = JSON.parse(sessionStorage.getItem(WAITING) || "{}");
  now.queue.unshift(...queue);
  now.doubtful = doubtful;
  return sheet && { ...sheet, document: number };
}

// Show the verdict on a drag: on the whole mission, or on the legs near the item, which replace the old ones.
function onPreview(message) {
  const { dragging } = now;
  if (!dragging || message.rev !== now.sheet.rev || message.k !== dragging.k || message.n < dragging.since) return;
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
    // A route with another number of legs is coloured when the whole mission is judged.
    if (message.total_legs !== now.sheet.path.length) return answers();
    now.model = merged(now.sheet, message.windows);
  }
  hold();
  if (message.sheet) map.show(now.model);
  else map.update(now.model);
  drawProfileSoon();
  answers();
  hands.again();
  document.documentElement.dataset.shown = message.n;
}

// During a drag on the map, draw the profile one frame later, after the colours below the pointer.
let profileWaits = false;
function drawProfileSoon() {
  if (profileWaits) return;
  profileWaits = true;
  requestAnimationFrame(() => setTimeout(() => {
    profileWaits = false;
    profile.show(now.model, now.world, now.grid, shownFlight());
  }));
}

function merged(model, windows) {
  const copy = { ...model, profile: null, route: [...model.route], path: [...model.path] };
  copy.states = { legs: [...model.states.legs], corners: [...model.states.corners] };
  for (const one of windows) {
    copy.route.splice(one.first, one.route.length, ...one.route);
    copy.path.splice(one.first, one.path.length, ...one.path);
    for (const kind of ["legs", "corners"]) {
      one.states[kind].forEach((state, i) => {
        const old = model.states[kind][one.first + i];
        // Bounds are judged only with the whole mission; until then a failure of bounds stays.
        copy.states[kind][one.first + i] = old[0] === "fail" && old[1].startsWith("bounds") && state[0] !== "fail" ? old : state;
      });
    }
  }
  return copy;
}

// Keep the dragged item below the pointer, whatever position the server has judged.
function hold() {
  const drop = now.dragging?.drop;
  if (!drop) return;
  now.model = placed(now.model, now.dragging.k, drop);
}

const SEVERITY = ["ok", "near", "open", "fail"];

// Return a mission with the worse of its states by geometry and by the flight of the same revision.
function withFlight(sheet) {
  const { flown } = now;
  if (!flown || flown.rev !== sheet.rev || sheet.planning) return sheet;
  const worse = (kind) => sheet.states[kind].map((own, i) => {
    const other = flown.states[kind][i];
    return other && SEVERITY.indexOf(other[0]) > SEVERITY.indexOf(own[0]) ? [other[0], `flown: ${other[1]}`, other[2]] : own;
  });
  const both = (kind) => [...new Set([...sheet.violated[kind], ...flown.violated[kind]])];
  return {
    ...sheet, states: { legs: worse("legs"), corners: worse("corners") },
    violated: { threats: both("threats"), zones: both("zones") },
  };
}

function onFlown(flown) {
  now.flown = flown;
  now.work.fly = null;
  progress();
  if (now.model) {
    if (!isStale()) {
      now.model = now.nudged ? placed(withFlight(now.sheet), now.nudged.k, now.nudged) : withFlight(now.sheet);
      map.show(now.model);
    }
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
  const begins = now.work[work.job]?.number !== work.number;
  now.work[work.job] = work;
  // A new task clears the message that the previous task was stopped.
  if (begins && (now.stopping || $("message").textContent === STOPPED)) {
    now.stopping = false;
    complain("");
  }
  progress();
  answers();
  panel.working(work, begins);
}

// Show a fault.  A fault of a task, such as a flight, a search or an autosave, leaves the edits unchanged.
function onFault({ text, job }) {
  complain(text);
  panel.drawSettings();
  planningEnded(job);
  if (job !== undefined || link.before === "stopped") return;
  app.refused();
  if (now.dragging) {
    hands.stopDrag();
    app.cancel();
  }
}

function onStopped({ job }) {
  now.work[job] = null;
  progress();
  if (now.stopping && !Object.values(now.work).some(Boolean)) {
    now.stopping = false;
    complain(STOPPED);
  }
  answers();
  panel.stopped(job);
  planningEnded(job);
}

// Show the suggestions that passed their trials, by geometry or in flight.
function onTried(message) {
  now.work[message.job] = null;
  progress();
  if (message.job === "geometry_trials" && message.rev === now.sheet?.rev) now.sheet.findings = message.findings;
  answers();
  panel.tried(message);
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
  const held = map.markers.contains(document.activeElement);
  map.show(now.model);
  map.select(now.selected);
  if (held && !map.markers.contains(document.activeElement)) {
    if (now.selected === null) map.root.focus({ preventScroll: true });
    else map.focus(now.selected);
  }
  map.setTrack(now.flown?.track, isStale());
  profile.show(now.model, now.world, now.grid, shownFlight());
  scene?.show(now);
}

// ---- the answers in the header

function answers() {
  const { model, flown } = now;
  if (!model) return;
  const state = now.fault ? "fail" : model.verdict.state;
  const failing = [...model.states.legs, ...model.states.corners].filter((one) => one[0] === "fail").length;
  let words = answerText(model.verdict);
  let shown = state;
  if (now.dragging && now.checking && !now.fault) {
    shown = failing ? "fail" : "checking";
    words = failing ? `${failing} ${failing === 1 ? "place fails" : "places fail"}` : "checking \u2026";
  }
  if (model.planning) setAnswer("geometry", "none", "planning \u2026", "");
  else setAnswer("geometry", shown, now.fault || words, model.verdict.headline);
  // Trials of geometric suggestions are shown as the start of the flight.
  const work = now.work.fly || now.work.geometry_trials;
  if (work && !now.dragging) setAnswer("flown", "checking", `flying ${Math.round(100 * (work.share || 0))} %`, work.text || "");
  else if (!flown) setAnswer("flown", "none", "not yet", "");
  else if (isStale()) setAnswer("flown", "stale", answerText(flown.verdict, true), flown.verdict.headline);
  else setAnswer("flown", flown.verdict.state, answerText(flown.verdict), flown.verdict.headline);
}

function setAnswer(id, state, words, title) {
  const box = $(id);
  box.dataset.state = state;
  box.title = title || words;
  box.querySelector("span").textContent = words;
}

function showName(name, unsaved) {
  // The mark is first, so that a long name does not hide it.
  $("name").textContent = (unsaved ? "\u2022 " : "") + name;
  $("name").title = unsaved ? `${name}, not saved` : name;
  document.title = `${unsaved ? "\u2022 " : ""}${name} \u2013 planfly studio`;
}

function progress() {
  const works = Object.values(now.work).filter(Boolean), bar = $("progress");
  $("stop").hidden = !works.length;
  // The end of trial flights is unknown, so they have no bar.
  const long = works.find((one) => !["fly", "trials", "geometry_trials"].includes(one.job)) || now.work.fly;
  bar.hidden = !long;
  if (!long) return;
  // Use a new bar for each task; otherwise the bar would shrink from the end of the previous task.
  if (bar.dataset.number !== String(long.number)) bar.replaceChildren(element("i"));
  bar.dataset.number = long.number;
  bar.firstElementChild.style.width = `${Math.max(2, Math.round(100 * long.share))}%`;
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

// ---- user actions

const app = {
  map, profile,
  get link() { return link; },
  model: () => now.model,
  grid: () => now.grid,
  rev: () => now.sheet.rev,
  selected: () => now.selected,
  dragFault: () => now.fault,
  select(k, focused) {
    if (now.selected !== k) {
      now.selected = k;
      map.select(k);
      profile.select(k);
      panel.select(k);
    }
    if (!focused && k !== null) map.focus(k);
  },
  selectAfter(k) { now.after = k; },
  begin(k) {
    if (now.dragging?.k !== k) {
      now.dragging = { k, since: link.number + 1 };
      now.checking = true;
      map.root.classList.add("dragging");
      $("panel-verdict").classList.add("before");
      map.setTrack(now.flown?.track, true);
    }
    now.dragging.drop = hands.drop?.k === k ? hands.drop : null;
  },
  raised(k, up) {
    const item = now.model.items.find((one) => one.k === k);
    now.dragging.drop = { east: item.at[0], north: item.at[1], up };
    hold();
    // The route ends above a landing, at an altitude that the landing does not change.
    if (item.touchdown) now.model = placed(now.model, k, { up });
    else now.model = { ...now.model, route: now.model.route.map((p, i) => (now.model.of[i] === k ? [p[0], p[1], up] : p)) };
    profile.show(now.model, now.world, now.grid, shownFlight());
  },
  cancel() {
    now.dragging = null;
    now.fault = "";
    map.root.classList.remove("dragging");
    $("panel-verdict").classList.remove("before");
    link.settle();
    // Show moves that wait to be sent where they were made.
    now.model = [now.doubtful, ...now.queue].reduce((model, one) => (one?.kind === "move" ? placed(model, one.k, one) : model), withFlight(now.sheet));
    drawAll();
    answers();
    app.hint(null);
  },
  // Send an edit of the mission on which it was begun; a message without `rev` gets the current revision.
  commit(message) {
    link.settle();
    app.flush();
    const last = now.queue.at(-1);
    // If several moves of one item wait, send only the newest.
    if (message.kind === "move" && last?.kind === "move" && last.k === message.k) Object.assign(last, message, { rev: last.rev });
    else now.queue.push({ rev: now.sheet.rev, ...message });
    pump();
  },
  // Send any other request, after the edits that were made before it.
  send(message) {
    // The hint is about the mission before the request.
    if (HISTORY.includes(message.kind)) app.hint(null);
    app.flush();
    now.queue.push(message);
    pump();
  },
  // Send the accumulated moves by keys.
  flush() {
    const { nudged } = now;
    clearTimeout(now.nudgeTimer);
    now.nudged = null;
    if (nudged) app.commit({ kind: "move", ...nudged });
  },
  refused() {
    now.committed = null;
    now.queue = [];
  },
  // Accumulate moves by keys, which come faster than answers, and send them as one.
  nudge(k, to) {
    if (now.nudged && now.nudged.k !== k) app.flush();
    now.model = placed(now.model, k, to);
    now.nudged = { rev: now.sheet.rev, ...now.nudged, k, ...to };
    if (to.east !== undefined) map.dragged(k, to.east, to.north);
    clearTimeout(now.nudgeTimer);
    now.nudgeTimer = setTimeout(() => { if (!now.committed) app.flush(); }, 60);
  },
  // Draw the hint in the next frame, which lays out the page anyway.
  hint(lines, x, y, state) {
    if (!now.hint) requestAnimationFrame(drawHint);
    now.hint = { lines, x, y, state };
  },
  leave() {
    app.hint(null);
    $("place").textContent = "";
  },
  showPlace(east, north) {
    const ground = groundAt(now.grid, east, north);
    $("place").textContent = `${plain(east / 1000, 2)} km E, ${plain(north / 1000, 2)} km N${Number.isNaN(ground) ? "" : `, ground ${plain(ground)} m`}`;
  },
  complain,
  save: () => panel.save(),
  now,
  goTo({ place }) {
    const { model } = now;
    let points = [];
    if (place.kind === "leg" && model.path[place.index]) points = triplets(model.path[place.index]);
    else if (place.kind === "waypoint" && model.route[place.index]) {
      points = [model.route[place.index]];
      if (model.of[place.index] >= 0) app.select(model.of[place.index], true);
    } else if (["missile", "radar"].includes(place.kind)) {
      const one = now.world.threats[place.index], r = one.kill || one.detection;
      points = [[one.at[0] - r, one.at[1] - r], [one.at[0] + r, one.at[1] + r]];
    } else if (["exclusion", "inclusion"].includes(place.kind)) points = now.world.zones[place.index].rings[0];
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

function drawHint() {
  const { lines, x, y, state } = now.hint, box = $("hint");
  now.hint = null;
  box.hidden = !lines;
  if (!lines) return;
  clear(box).append(...lines.filter(Boolean).map((line, i) => element(i ? "span" : "b", {}, line)));
  box.dataset.state = state || "";
  const own = map.root.getBoundingClientRect(), views = $("views").getBoundingClientRect();
  const left = own.left - views.left + x + 18, top = own.top - views.top + y + 16;
  box.style.left = `${Math.max(4, Math.min(left, views.width - box.offsetWidth - 6))}px`;
  box.style.top = `${top + box.offsetHeight > views.height - 4 ? top - box.offsetHeight - 34 : top}px`;
}

const panel = new Panel(app);
const hands = new Hands(app);
const link = new Link({
  open: () => complain(""),
  // Tasks in progress are reported again after the next connection.
  lost: (text) => { now.work = {}; progress(); app.flush(); sayLost(text); },
  world: onWorld,
  sheet: onSheet,
  preview: onPreview,
  flown: onFlown,
  tried: onTried,
  unsaved: ({ unsaved }) => { now.sheet.unsaved = unsaved; showName(now.sheet.name, unsaved); panel.drawFiles(); },
  working: onWorking,
  stopped: onStopped,
  choices: (message) => panel.choices(message),
  ways: (message) => { now.work.plan = null; progress(); panel.ways(message); answers(); },
  saved: (message) => { complain(""); panel.saved(message); },
  ...Object.fromEntries(Object.entries(QUESTIONS).map(([job, title]) => [job, (message) => {
    now.work[job] = null;
    progress();
    panel.answered(job, message);
    say(`${title}: ${message.headline}`);
  }])),
  fault: onFault,
  stale: () => { app.refused(); complain("Another page has changed the mission; this is its current state."); },
  picture: (picture) => { now.picture = picture; setGround(); },
  heights: (heights) => { now.heights = heights; setGround(); },
});

// ---- buttons, sizes, files

$("undo").onclick = () => app.send({ kind: "undo" });
$("redo").onclick = () => app.send({ kind: "redo" });
$("fly").onclick = () => app.send({ kind: "fly" });
$("save").onclick = () => panel.save();
for (const id of ["geometry", "flown"]) $(id).onclick = () => panel.reveal("verdict");
$("stop").onclick = () => {
  now.stopping = link.send({ kind: "stop" });
  if (now.stopping) complain("Stopping \u2026", true);
};
for (const [id, factor] of [["zoom-in", 1.5], ["zoom-out", 1 / 1.5]]) {
  $(id).onclick = () => {
    if (inScene()) return scene.enlarge(factor);
    map.view.zoom(factor, map.view.width / 2, map.view.height / 2);
    return map.layOut();
  };
}
$("legend").ontoggle = () => map.setLegend($("legend"));
$("fit").onclick = () => (inScene() ? scene.enlarge(1 / scene.zoom) : map.fit());
$("three").onclick = () => {
  const on = $("scene").hidden;
  $("scene").hidden = !on;
  $("three").setAttribute("aria-pressed", String(on));
  if (on && !scene) scene = new Scene($("scene"), turnCompass);
  if (on) { scene.resize(map.view.width, map.view.height); scene.show(now); }
  turnCompass();
  showBegin();
  app.leave();
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
  if (inScene()) { scene.resize(map.view.width, map.view.height); scene.show(now); }
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
