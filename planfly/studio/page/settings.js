// Draw the settings of a mission's flight.  Values are sent to the server as typed, and the server checks them.

import { clear, element } from "/axes.js";

// Entries of a scenario's [limits]: key, unit, and text if there is no value.
const LIMITS = [["min_clearance_m", "m", ""], ["max_height_m", "m", "no limit"], ["corridor_m", "m", "the autopilot's"], ["max_turn_deg", "°", "the aircraft's"], ["max_climb_deg", "°", "the aircraft's"], ["max_dive_deg", "°", "the aircraft's"]];
const SURVEYS = [["", "as the mission says"], ["lines", "judged as lines"], ["path", "judged as any path"]];
const PARAMETERS = /\.(parm|param|params)$/i;
const MOST = 240 * 1024;

export function field(words, input, id = input.id) {
  return element("div", { class: "field" }, element("label", { for: id }, words), input);
}

// Return true if a file of this name is a parameter file.
export function isParameters(name) {
  return PARAMETERS.test(name);
}

export async function sendParameters(file, app) {
  if (file.size > MOST) return app.complain(`${file.name}: larger than ${MOST / 1024} kB, which is too large for a parameter file`);
  return app.send({ kind: "settings", parameter_file: file.name.slice(-100), parameter_text: await file.text() });
}

export function buildSettings(box, settings, offered, app) {
  const send = (change) => app.send({ kind: "settings", ...change });
  clear(box).append(element("p", { class: "more" }, "Changes here are judged and flown immediately."), ...flown(settings, offered, send),
    element("h2", {}, "Limits"), ...limits(settings, send), element("h2", {}, "Parameters of the autopilot"), ...parameters(settings, app, send));
}

function list(id, values, chosen, change) {
  return element("select", { id, onchange: (event) => change(event.target.value) }, ...values.map(([value, words]) => element("option", { value, selected: value === chosen }, words)));
}

// Return a field for a number; an empty field is null, unless the number is required.
function number(id, value, step, change, placeholder = "", required = false) {
  const shown = typeof value === "number" ? value : "";
  return element("input", { id, type: "number", step, value: shown, placeholder, required, onchange: ({ target }) => {
    if (target.value === "" && target.validity.badInput) target.value = shown;
    else change(target.value === "" ? null : Number(target.value));
  } });
}

function flown(settings, offered, send) {
  const same = (values, own) => [...new Set([own, ...values])].filter(Boolean).map((one) => [one, one]);
  const need = (name) => (value) => send({ [name]: value }), { labels } = settings;
  const needed = (name, value, step) => number(`set-${name}`, value, step, (to) => to !== null && send({ [name]: to }), "", true);
  return [
    field(labels.aircraft, list("set-aircraft", same(settings.aircraft_names, settings.aircraft), settings.aircraft, need("aircraft"))),
    field(labels.autopilot, list("set-autopilot", same(offered.autopilots, settings.autopilot), settings.autopilot, need("autopilot"))),
    field(`${labels.airspeed} (${settings.airspeed_kind}), m/s`, needed("airspeed", settings.airspeed, 0.5)),
    field(`${labels.wind_speed}, m/s`, needed("wind_speed", settings.wind_speed, 0.5)),
    field(`${labels.wind_from}, °`, needed("wind_from", settings.wind_from, 5)),
    ...(settings.forecast ? [element("p", { class: "more" }, `The wind comes from the ${settings.forecast}; the fields above show its mean at the start. A wind entered there replaces it.`)] : []),
    field(labels.turbulence, list("set-turbulence", same(offered.turbulence, settings.turbulence), settings.turbulence, need("turbulence"))),
  ];
}

function limits(settings, send) {
  const { labels } = settings;
  const rows = LIMITS.map(([name, unit, none]) => field(`${labels[name]},\u00a0${unit}`, number(`set-${name}`, settings.limits[name], name.endsWith("_m") ? 5 : 1, (value) => send({ limits: { [name]: value } }), none)));
  const surveys = list("set-surveys", SURVEYS, settings.limits.surveys || "", (value) => send({ limits: { surveys: value || null } }));
  const ceiling = settings.ceiling === null ? [] : [field(`${labels.ceiling}, m AMSL`, number("set-ceiling", settings.ceiling, 10, (value) => value !== null && send({ ceiling: value }), "", true))];
  return [...rows.slice(0, 2), ...ceiling, ...rows.slice(2), field(labels.surveys, surveys)];
}

function parameters(settings, app, send) {
  const known = Object.keys(settings.known);
  if (!known.length) return [element("p", { class: "more" }, "planfly's own guidance has no parameters: choose another autopilot.")];
  const one = element("input", { id: "set-parameter", list: "known-parameters", placeholder: "NAME=VALUE", autocomplete: "off", spellcheck: "false" });
  const enter = () => one.value.trim() && send({ parameter: one.value.trim() });
  one.addEventListener("keydown", (event) => event.key === "Enter" && enter());
  const file = element("input", { id: "set-parameter-file", type: "file", accept: ".parm,.param,.params", onchange: ({ target }) => target.files[0] && sendParameters(target.files[0], app) });
  const set = Object.entries(settings.parameters);
  const rows = set.map(([name, value]) => element("li", {}, element("span", {}, `${name} = ${value}`), element("button", { type: "button", class: "remove", "aria-label": `No longer set ${name}`, onclick: () => send({ without: [name] }) }, "\u00d7")));
  const from = settings.parameter_file ? `Set here or by ${settings.parameter_file}:` : "Set here:";
  return [
    field(settings.labels.parameter, element("span", { class: "with-button" }, one, element("button", { type: "button", onclick: enter }, "Set")), one.id),
    element("datalist", { id: "known-parameters" }, ...known.map((name) => element("option", { value: `${name}=${settings.known[name]}` }))),
    field("From a file", file),
    element("p", { class: "more" }, set.length ? from : `No parameter is set here: ${settings.autopilot_title} flies with the parameters of the aircraft and of ${settings.scenario_parameter_file || "the scenario"}. A file replaces all that are set here.`),
    ...(settings.unused ? [element("p", { class: "more" }, `The simulated autopilot does not use ${settings.unused}.`)] : []),
    ...(set.length ? [element("ul", { class: "parameters" }, ...rows), element("p", {}, element("button", { type: "button", onclick: () => send({ without: set.map(([name]) => name) }) }, "Clear all"), " ", element("button", { type: "button", onclick: () => app.send({ kind: "save", form: "parm" }) }, "Save as .parm"))] : []),
  ];
}
