// Draw the panels next to the map: verdict with suggestions, table of waypoints, planner, settings, files.

import { clear, element, groundAt, plain } from "/axes.js";
import { RANGES } from "/link.js";
import { cornerStates } from "/map.js";
import { buildSettings, field, isParameters, sendParameters } from "/settings.js";

const $ = (id) => document.getElementById(id);
const TABS = ["verdict", "items", "plan", "settings", "files"];
const FORMS = [["waypoints", ".waypoints", "QGC WPL 110: Mission Planner, QGroundControl, MAVProxy"], ["plan", ".plan", "QGroundControl, with fence and rally points"], ["plan.json", "plan.json", "planfly, with scenario and certificate"], ["kml", ".kml", "a map for Google Earth and others"]];
const MOST_ROWS = 600;
// Questions that take many flights: kind of the message, and title of the answer.
export const QUESTIONS = { returns: "Return to launch", campaign: "Flights in this weather", battery: "Battery", ground_risk: "Ground risk", window: "Times of take-off" };
// Number of paths that one search returns.
const WAYS = 6;

// Return the answer of a verdict, with the same words in the header and on its card.
export function answerText(verdict, stale) {
  const failed = verdict.state === "fail" && verdict.failed ? `: ${verdict.failed} ${verdict.failed === 1 ? "finding" : "findings"}` : "";
  return `${verdict.answer}${failed}${stale ? ", changed since" : ""}`;
}

// Return the title of a list of findings, according to their states.
function titleOf(findings, where) {
  const words = [[false, "fails"], [null, "is not judged"]].filter(([ok]) => findings.some((one) => one.ok === ok)).map((one) => one[1]);
  return `What ${words.join(" or ")}${where}`;
}

export class Panel {
  constructor(app) {
    this.app = app;
    this.boxes = Object.fromEntries(TABS.map((name) => [name, $(`panel-${name}`)]));
    this.tabs = TABS.map((name) => $(`tab-${name}`));
    this.tabs.forEach((tab, i) => {
      tab.addEventListener("click", () => this.show(TABS[i]));
      tab.addEventListener("keydown", (event) => {
        const by = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
        if (!by) return;
        event.preventDefault();
        const next = (i + by + TABS.length) % TABS.length;
        this.show(TABS[next]);
        this.tabs[next].focus();
      });
    });
    // The server's value replaces a number that was entered, but not a number that is being typed.
    for (const box of Object.values(this.boxes)) {
      box.addEventListener("input", (event) => { event.target.entered = false; });
      box.addEventListener("change", ({ target }) => {
        target.entered = true;
        // A required number that was cleared returns to its value.
        if (target.required && target.value === "") target.value = target.defaultValue;
      });
    }
    this.shown = "verdict";
    this.files = [];
    this.saveForm = "waypoints";
    this.answers = {};
    // Questions asked on this page, whose answers are scrolled into view when they arrive.
    this.asked = new Set();
  }

  show(name) {
    this.shown = name;
    this.tabs.forEach((tab, i) => {
      tab.setAttribute("aria-selected", String(TABS[i] === name));
      tab.tabIndex = TABS[i] === name ? 0 : -1;
      this.boxes[TABS[i]].hidden = TABS[i] !== name;
    });
    this.drawItems();
  }

  // Show a panel, and scroll to it if it is outside the window.
  reveal(name) {
    this.show(name);
    if (this.boxes[name].getBoundingClientRect().top > innerHeight - 120) this.boxes[name].scrollIntoView({ block: "start" });
  }

  // ---- messages from the server

  choices(message) {
    this.offered = message;
    this.files = message.files;
    this.folder = message.folder;
    this.drawFiles();
    this.drawPlan();
  }

  world(world) {
    this.about = world;
    this.drawSettings();
  }

  // Another mission was opened: discard the results for the previous one.
  forget() {
    this.flight = undefined;
    this.answers = {};
    this.asked.clear();
    this.file = undefined;
    if (this.lossBox) clear(this.lossBox);
  }

  sheet(sheet) {
    this.now = sheet;
    // The stated losses are those of the saved mission.
    if (this.file && this.file.rev !== sheet.rev) {
      const state = sheet.unsaved ? ", without the changes since" : "";
      clear(this.lossBox).append(element("p", { class: "more" }, `${this.file.text}${state}.`));
    }
    if (this.waysOf !== undefined && this.waysOf !== sheet.rev) {
      this.waysOf = undefined;
      this.app.ways([]);
      clear(this.wayBox);
    }
    this.drawVerdict();
    this.drawItems();
    this.drawPlanEnds();
    this.drawFiles();
  }

  flown(flown) {
    this.flight = flown;
    this.drawVerdict();
  }

  // Show the suggestions that passed their trials, by geometry or in flight.
  tried(message) {
    if (message.job === "trials" && this.flight?.rev === message.rev) this.flight.findings = message.findings;
    this.drawVerdict();
  }

  select(k) {
    this.boxes.items.querySelectorAll("tr[data-k]").forEach((row) => row.classList.toggle("selected", Number(row.dataset.k) === k));
  }

  // ---- verdict

  drawVerdict() {
    keepFocus(this.boxes.verdict, () => this.buildVerdict());
  }

  buildVerdict() {
    const { now, flight } = this;
    if (!now) return undefined;
    const box = clear(this.boxes.verdict), stale = flight && flight.rev !== now.rev;
    if (now.planning) return box.append(element("section", { class: "card" }, element("h2", {}, "Planning a path"), element("p", { class: "more" }, "or drag an end to plan by hand")));
    box.append(this.answerOf("Geometry", answerText(now.verdict), now.verdict, "each leg and corner compared with the aircraft's limits"));
    if (flight) {
      const part = this.answerOf("Flown", answerText(flight.verdict, stale), flight.verdict, `${flight.autopilot}, ${duration(flight.seconds)}${stale ? ", before the last change" : ""}`);
      part.classList.toggle("stale", Boolean(stale));
      if (flight.changes.length) part.append(element("p", {}, element("b", {}, "Since the last flight")), element("ul", { class: "changes" }, ...flight.changes.map((text) => element("li", {}, text))));
      box.append(part);
    }
    // List a place that the flight judged only with the flight, and an unreached place with its geometric suggestions.
    const isFlown = flight && !stale, flownFailed = isFlown ? flight.findings.filter((one) => one.ok !== true) : [];
    const same = (one) => (other) => other.title === one.title && other.where === one.where;
    const failed = now.findings.filter((one) => one.ok !== true && !flownFailed.some(same(one)));
    if (failed.length) box.append(element("h2", {}, titleOf(failed, "")), element("ul", { class: "findings" }, ...failed.map((one) => this.finding(one, false, isFlown && one))));
    if (flownFailed.length) {
      const planned = (one) => one.ok === null && !one.offers.length && now.findings.find((other) => other.ok !== true && same(one)(other));
      const trying = this.app.now.work.trials ? element("p", { class: "more" }, "Changes that would help are being flown \u2026") : null;
      box.append(element("h2", {}, titleOf(flownFailed, " in flight")), ...(trying ? [trying] : []), element("ul", { class: "findings" }, ...flownFailed.map((one) => this.finding(one, true, planned(one)))));
    }
    const passed = (isFlown ? flight : now).findings.filter((one) => one.ok);
    if (passed.length) box.append(element("h2", {}, `Closest to its limit ${isFlown ? "in flight" : "by geometry"}, by rule`), element("ul", { class: "findings passed" }, ...passed.map((one) => this.finding(one, isFlown))));
    if (now.notes.length) box.append(element("h2", {}, "Notes"), element("ul", { class: "notes" }, ...now.notes.slice(0, 20).map((text) => element("li", {}, text))));
    box.append(element("div", { class: "asks" },
      element("h2", {}, "Ask more"),
      ...this.ask("returns", "Can it return home?", "a return to launch from every point of the route"),
      ...this.ask("campaign", "How likely in this weather?", "24 flights with varied conditions"),
      ...this.ask("battery", "How large a battery?", "24 flights with their returns; the reserve is kept in 95 of 100"),
      ...this.ask("ground_risk", "Whom does it fly over?", "12 flights: volumes by SORA 2.5"),
      ...(this.about?.settings.forecast ? this.ask("window", "When can I take off?", "10 flights at each hour of the next 12 in the forecast") : [])));
    return undefined;
  }

  // Draw a question, with its answer below.
  ask(job, words, more) {
    const ask = () => { this.asked.add(job); this.app.send({ kind: job }); };
    const question = element("p", {}, element("button", { type: "button", "data-job": job, onclick: ask }, words), element("small", {}, more));
    return this.answers?.[job] ? [question, this.result(job, this.answers[job])] : [question];
  }

  answerOf(name, answer, verdict, more) {
    const lines = verdict.lines.slice(0, 6);
    return element("section", { class: "card", "data-state": verdict.state },
      element("h2", {}, `${name}: ${answer}`), element("p", { class: "more" }, more),
      verdict.state === "ok" ? null : element("p", {}, verdict.reasons),
      lines.length ? element("details", {}, element("summary", {}, "In full"), ...lines.map((line) => element("p", { class: "line" }, line))) : null);
  }

  // planned: the same finding of the geometric verdict, if its suggestions are offered; otherwise undefined.
  finding(one, flown, planned) {
    const { rev } = this.now, from = planned || one, offers = from.offers.map((each, which) => element("li", {},
      each.apply ? element("button", { type: "button", class: "apply", onclick: () => this.app.commit({ kind: "apply", rev, finding: from.number, which, flown: flown && !planned }) }, "Apply") : element("span", { class: "hand" }, "by hand"),
      element("span", {}, planned && each.apply ? `${each.text} (${this.flight.early ? "not tried in flight, because the flight ended before it" : "by geometry, not flown"})` : each.text)));
    const whole = ["flight", "mission", "plan"].includes(one.place.kind) && !/\d/.test(one.where);
    const place = whole ? "" : one.place.index === null ? element("b", {}, one.where) : element("button", { type: "button", class: "place", title: "Show it on the map", onclick: () => this.app.goTo(one) }, one.where);
    return element("li", { "data-state": one.state },
      element("p", {}, element("span", { class: "rule" }, one.title), " ", place), element("p", { class: "reason" }, one.reason, one.ok && one.passes ? element("small", {}, ` (limit ${one.passes})`) : null),
      offers.length ? element("ul", { class: "suggestions" }, ...offers) : null);
  }

  // ---- waypoints

  drawItems() {
    if (this.now && this.shown === "items") keepFocus(this.boxes.items, () => this.buildItems());
  }

  buildItems() {
    const { now, app } = this, { rev } = now;
    const by = element("input", { type: "number", required: true, value: this.raiseBy || "10", step: "5", onchange: () => { this.raiseBy = by.value || by.defaultValue; }, "aria-label": "Metres to raise or lower by", id: "raise-by" });
    const raise = (sign, all) => () => {
      const value = sign * Math.abs(Number(by.value));
      if (!Number.isFinite(value) || !value) return;
      const ks = all ? null : [app.selected()];
      if (!all && ks[0] === null) return app.complain("Choose a waypoint first.");
      app.commit({ kind: "raise", rev, by: value, ...(all ? {} : { ks }) });
    };
    const box = clear(this.boxes.items);
    box.append(element("div", { class: "bar" }, element("label", { for: "raise-by" }, "Heights of all"), by, " m",
      element("button", { type: "button", onclick: raise(1, true) }, "Raise"), element("button", { type: "button", onclick: raise(-1, true) }, "Lower")));
    const worst = cornerStates(now, true), grid = app.grid();
    const places = now.items.slice(0, MOST_ROWS), last = places.length < now.items.length ? places[places.length - 1].k : Infinity;
    const all = [...places, ...now.commands.filter((one) => one.k < last)].sort((a, b) => a.k - b.k);
    const rows = all.map((item) => (item.at ? this.row(item, worst, grid) : commandRow(item)));
    const head = element("tr", {}, ...["#", "What", "Height, m AMSL", "Over ground", "Closest to a limit", ""].map((text) => element("th", { scope: "col" }, text)));
    box.append(element("div", { class: "scroll" }, element("table", {}, element("thead", {}, head), element("tbody", {}, ...rows))));
    if (now.items.length > MOST_ROWS) box.append(element("p", {}, `The first ${MOST_ROWS} of ${now.items.length} items are listed.`));
  }

  row(item, worst, grid) {
    const { app, now } = this, ground = groundAt(grid, item.at[0], item.at[1]);
    const { rev } = now, [state, text] = worst.get(item.k) || ["open", "not flown"];
    const height = element("input", { type: "number", required: true, step: "1", value: item.at[2] === null ? "" : Math.round(item.at[2] * 10) / 10, "aria-label": `Height of item ${item.seq}, metres above mean sea level` });
    height.addEventListener("change", () => {
      const up = Number(height.value), [low, high] = RANGES.up;
      if (height.value === "") return undefined;
      if (up >= low && up <= high) return app.commit({ kind: "move", rev, k: item.k, up });
      height.value = height.defaultValue;
      return app.complain(`Item ${item.seq}: ${up} m: a height is from ${low} to ${high} m above mean sea level.`);
    });
    const go = element("button", { type: "button", class: "place", onclick: () => { app.select(item.k, true); } }, String(item.seq));
    const remove = element("button", { type: "button", class: "remove", "aria-label": `Delete item ${item.seq}`, title: "Delete", onclick: () => app.commit({ kind: "delete", rev, ks: [item.k] }) }, "\u00d7");
    return element("tr", { "data-k": item.k, "data-state": state, class: item.k === app.selected() ? "selected" : "" },
      element("td", {}, go), element("td", {}, item.what), element("td", {}, height),
      element("td", { class: "number" }, Number.isNaN(ground) || item.at[2] === null ? "\u2013" : plain(item.at[2] - ground)),
      element("td", { class: "limit" }, element("span", { title: text || null }, text || "\u2013")), element("td", {}, remove));
  }

  // ---- planner

  drawPlan() {
    const box = clear(this.boxes.plan), { offered, app } = this;
    if (!offered) return;
    this.seed = element("input", { type: "number", required: true, min: "0", value: "1", id: "plan-seed" });
    this.algorithm = element("select", { id: "plan-algorithm" }, element("option", { value: "" }, "the default"), ...Object.keys(offered.algorithms).map((name) => element("option", { value: name, title: offered.algorithms[name] }, name)));
    this.first = element("select", { id: "plan-first" });
    this.last = element("select", { id: "plan-last" });
    const plan = (ways) => {
      const asked = { kind: "plan", seed: Math.max(0, Math.round(Number(this.seed.value) || 0)), ways };
      if ((this.first.value === "") !== (this.last.value === "")) return app.complain("Choose both ends of the part to plan, or none for the whole mission.");
      if (this.algorithm.value && ways === 1) asked.algorithm = this.algorithm.value;
      this.waysAsked = ways;
      if (this.first.value !== "" && this.last.value !== "") Object.assign(asked, { first: Number(this.first.value), last: Number(this.last.value) });
      return app.send(asked);
    };
    this.wayBox = element("div", { class: "ways" });
    box.append(element("p", { class: "more" }, "The planner searches for a path that the aircraft can fly, clear of ground, threats and zones."),
      field("From", this.first), field("To", this.last), field("Seed", this.seed), field("Algorithm", this.algorithm),
      element("p", {}, element("button", { type: "button", class: "main", "data-job": "plan", "data-ways": 1, onclick: () => plan(1) }, "Plan from here"), " ",
        element("button", { type: "button", "data-job": "plan", "data-ways": WAYS, id: "other-ways", title: "Several plans from one search with the default algorithm; none is better than another in every respect", onclick: () => plan(WAYS) }, "Other paths")), this.wayBox);
    this.drawPlanEnds();
  }

  drawPlanEnds() {
    const { now } = this;
    if (!now || !this.first) return;
    const places = now.items.slice(0, MOST_ROWS);
    // In a mission without a scenario, a path can only be planned between items.
    const ends = this.about?.ends ? ["the scenario's start", "the scenario's destination"] : ["choose an item", "choose an item"];
    for (const [box, words] of [[this.first, ends[0]], [this.last, ends[1]]]) {
      const kept = box.value;
      clear(box).append(element("option", { value: "" }, words), ...places.map((item) => element("option", { value: item.k }, `item ${item.seq}`)));
      if ([...box.options].some((one) => one.value === kept)) box.value = kept;
    }
  }

  ways({ ways, rev, at_once: atOnce }) {
    this.stopped("plan");
    if (atOnce || !this.wayBox) return;
    const { app } = this, box = clear(this.wayBox);
    app.ways(ways, 0);
    if (!ways.length) return;
    const of = this.waysOf = rev ?? this.now.rev;
    box.append(element("h2", {}, ways.length === 1 ? "Found" : `${ways.length} paths found`));
    ways.forEach((way, k) => {
      const figures = [["Length", way.length / 1000, 2, "km"], ["Radar exposure, weighted", way.exposure, 0, "s"], ["Above ground at least", way.clearance, 0, "m"], ["Time", way.seconds, 0, "s"], ["Energy", way.energy, 0, "Wh"]];
      const rows = figures.filter((one) => one[1] !== null).map(([name, value, digits, unit]) => [name, `${plain(value, digits)} ${unit}`]);
      const take = element("button", { type: "button", onclick: () => { app.ways([]); app.commit({ kind: "choose", rev: of, which: k }); } }, "Use this path");
      const card = element("section", { class: "card", "data-state": way.state === "safe" ? "ok" : "fail", onpointerenter: () => app.ways(ways, k) },
        element("h3", {}, `Path ${k + 1}: ${[way.state, ...way.best].join(", ")}`), element("dl", {}, ...rows.flatMap(([name, value]) => [element("dt", {}, name), element("dd", {}, value)])),
        ...way.problems.map((text) => element("p", {}, text)), take);
      box.append(card);
    });
  }

  // ---- settings

  drawSettings() {
    if (this.about && this.offered) keepFocus(this.boxes.settings, () => buildSettings(this.boxes.settings, this.about.settings, this.offered, this.app));
  }

  // ---- files

  drawFiles() {
    keepFocus(this.boxes.files, () => this.buildFiles());
  }

  buildFiles() {
    const box = clear(this.boxes.files), { app, now } = this;
    const over = now?.over ? element("p", {}, element("button", { type: "button", class: "main", onclick: () => this.save() }, `Save over ${now.name}`), element("small", {}, "Ctrl+S")) : null;
    this.lossBox = this.lossBox || element("div", { role: "status" });
    box.append(element("h2", {}, "Save"), this.lossBox, ...(over ? [over] : []), ...FORMS.map(([form, name, more]) => element("p", {}, element("button", { type: "button", onclick: () => app.send({ kind: "save", form }) }, name), element("small", {}, more))));
    const pick = element("input", { type: "file", id: "pick", onchange: (event) => event.target.files[0] && this.openFile(event.target.files[0]) });
    box.append(element("h2", {}, "Open"), element("p", { class: "more" }, "Drop a file anywhere, or choose one: a mission (.waypoints, .plan, plan.json), a flight log whose mission is opened (.mcap, .bin, .tlog, .ulg, .gpx with a route, .igc with a task), or the autopilot's parameters (.parm, .param)."), element("p", {}, element("label", { for: "pick", class: "hidden" }, "File to open"), pick));
    if (this.folder) box.append(...this.byPath());
    box.append(element("h2", {}, "Back"), element("p", {}, element("button", { type: "button", disabled: !now?.unsaved, onclick: () => app.send({ kind: "revert" }) }, "Revert to the file"), element("small", {}, "undo brings the changes back")));
  }

  // Choose a file in the server's folder, by its path or from a list.
  byPath() {
    const { app } = this, path = element("input", { id: "open-path", placeholder: "survey/mission.plan", autocomplete: "off", spellcheck: "false", onkeydown: (event) => event.key === "Enter" && open() });
    const open = () => path.value.trim() && app.send({ kind: "open", name: path.value.trim() });
    const found = this.files.map((name) => element("li", {}, element("button", { type: "button", class: "place", onclick: () => app.send({ kind: "open", name }) }, name)));
    return [element("p", { class: "more" }, `Or enter its path in ${this.folder}:`), element("p", {}, element("label", { for: "open-path", class: "hidden" }, "Path of a file to open"), path, element("button", { type: "button", onclick: open }, "Open")), element("ul", { class: "files" }, ...found)];
  }

  save() {
    if (this.now?.over) this.app.send({ kind: "save", form: "waypoints", over: true });
    else this.app.send({ kind: "save", form: "waypoints" });
  }

  saved({ name, losses, where, data }) {
    if (!where) {
      const bytes = Uint8Array.from(atob(data), (ch) => ch.charCodeAt(0));
      const url = URL.createObjectURL(new Blob([bytes]));
      element("a", { href: url, download: name }).click();
      setTimeout(() => URL.revokeObjectURL(url), 10000);
    }
    const lost = losses.length ? element("ul", {}, ...losses.map((text) => element("li", {}, text))) : null;
    const place = `${where ? "saved" : "downloaded"} ${where ? `in ${where}` : "by your browser"}`;
    this.file = { rev: this.now.rev, text: `${name} was ${place}` };
    clear(this.lossBox).append(element("p", {}, element("b", {}, `${name} is ${place}. `), losses.length ? "It lacks:" : "It contains the whole mission."), ...(lost ? [lost] : []));
    if (this.shown !== "files") this.app.complain(`${name} is ${place}.${losses.length ? ` It lacks: ${losses.join("; ")}` : ""}`);
  }

  async openFile(file) {
    if (isParameters(file.name)) {
      this.show("settings");
      return sendParameters(file, this.app);
    }
    if (file.size > 16 * 2 ** 20) return this.app.complain(`${file.name}: larger than 16 MB; open it with planfly studio ${file.name}`);
    const bytes = new Uint8Array(await file.arrayBuffer()), parts = [];
    for (let i = 0; i < bytes.length; i += 32768) parts.push(String.fromCharCode(...bytes.subarray(i, i + 32768)));
    return this.app.send({ kind: "open", name: file.name.slice(-200), data: btoa(parts.join("")) });
  }

  // ---- long tasks

  working({ job, share, text }, begins) {
    if (job === "trials" && begins) this.drawVerdict();
    for (const button of document.querySelectorAll(`button[data-job="${job}"]`)) {
      // Show the progress only on the button of the planner that was pressed.
      if (button.dataset.ways && Number(button.dataset.ways) !== (this.waysAsked || 1)) continue;
      button.dataset.share = `${Math.round(100 * share)} %`;
      button.title = text || "";
    }
  }

  stopped(job) {
    if (job === "trials") this.drawVerdict();
    for (const button of document.querySelectorAll(`button[data-job="${job}"]`)) delete button.dataset.share;
  }

  answered(job, message) {
    this.stopped(job);
    this.answers[job] = message;
    this.drawVerdict();
    if (!this.asked.delete(job) || this.app.now.dragging) return;
    this.boxes.verdict.querySelector(`[data-answer="${job}"]`)?.scrollIntoView({ block: "nearest" });
  }

  result(job, { rev, state, headline, lines }) {
    const stale = rev !== this.now.rev;
    return element("section", { class: stale ? "card stale" : "card", "data-state": state, "data-answer": job }, element("h2", {}, QUESTIONS[job]),
      stale ? element("p", { class: "more" }, "before the last change") : null, element("p", {}, headline), ...lines.slice(0, 16).map((line) => element("p", { class: "line" }, line)));
  }
}

// Return the table row of an item without a position, such as a change of speed or a jump.
function commandRow({ seq, text }) {
  return element("tr", { class: "command" }, element("td", {}, String(seq)), element("td", { colspan: "5" }, text));
}

// Rebuild a box, and restore the focus, with text that was typed but not entered.
function keepFocus(box, build) {
  const had = document.activeElement, name = (one) => one.id || one.getAttribute("aria-label") || one.textContent;
  if (!box.contains(had) || had === box) return build();
  const tools = () => [...box.querySelectorAll("button, input, select, summary")];
  const at = tools().indexOf(had), typed = had.localName === "input" && had.type === "number" && had.value !== had.defaultValue ? had.value : null;
  build();
  const all = tools(), alike = all.filter((one) => one.localName === had.localName && name(one) === name(had));
  const next = alike.sort((a, b) => Math.abs(all.indexOf(a) - at) - Math.abs(all.indexOf(b) - at))[0];
  if (next && typed !== null && !had.entered) {
    next.value = typed;
    // A browser sends no change event for text that a script has set.
    next.addEventListener("blur", () => { if (next.value === typed && !next.entered) next.dispatchEvent(new Event("change", { bubbles: true })); }, { once: true });
  }
  (next || box).focus({ preventScroll: true });
  return undefined;
}

function duration(seconds) {
  const minutes = Math.floor(seconds / 60), rest = Math.round(seconds - 60 * minutes);
  return minutes ? `${minutes} min ${rest} s` : `${rest} s`;
}
