// Draw the legend of the map's lines, and a compass with the wind.

import { clear, element, svg } from "/axes.js";

const LINES = [
  ["leg ok", "passes"], ["leg near", "near a limit"], ["leg open", "not judged in full"], ["leg fail", "fails"], ["track", "flown"],
  ["straight", "between waypoints"],
];

// Draw the lines that occur in this world, each once.
export function drawLegend(box, world) {
  const kinds = new Set(world.zones.map((zone) => zone.kind));
  const shown = [
    ...LINES,
    ...(world.threats.some((one) => one.kill) ? [["missile", "missile\u2019s reach"]] : []),
    ...(world.threats.some((one) => one.detection) ? [["radar", "radar\u2019s reach"]] : []),
    ...(kinds.has("exclusion") ? [["zone exclusion", "zone to stay out of"]] : []),
    ...(kinds.has("inclusion") ? [["zone inclusion", "zone to stay in"]] : []),
    ...(world.bounds ? [["area", "edge of the area"]] : []),
  ];
  clear(box).append(...shown.map(([look, words]) => {
    const line = svg("svg", { viewBox: "0 0 28 10", class: "world", "aria-hidden": "true" });
    svg("path", { d: "M1 5H27", class: look }, line);
    return element("li", {}, line, words);
  }));
}

// Draw a compass, whose arrow points where the wind blows to.  north: direction of north, degrees clockwise from up.
export function drawCompass(box, { wind_speed: speed, wind_from: from, forecast }, north = 0) {
  const words = speed > 0 ? `wind ${speed.toFixed(1)} m/s from ${bearing(from)}` : "no wind", more = forecast ? "mean at the start" : "";
  const dial = svg("svg", { viewBox: "-32 -32 64 64", "aria-hidden": "true" });
  svg("circle", { r: 20 }, dial);
  const turned = svg("g", { class: "north", transform: `rotate(${north})` }, dial);
  svg("path", { d: "M0-20V-13" }, turned);
  svg("text", { "text-anchor": "middle", "dominant-baseline": "central", transform: `translate(0 -26) rotate(${-north})` }, turned).textContent = "N";
  if (speed > 0) svg("path", { d: "M0-14V14M-5 7 0 14 5 7", class: "wind", transform: `rotate(${from})` }, turned);
  clear(box).append(dial, element("span", {}, words, ...(more ? [element("small", {}, more)] : [])));
  const side = bearing(north) === bearing(0) ? "up" : `${bearing(north)} clockwise from up`;
  box.setAttribute("aria-label", `North is ${side}; ${[words, more].filter(Boolean).join(", ")}`);
}

function bearing(degrees) {
  return `${String(((Math.round(degrees) % 360) + 360) % 360).padStart(3, "0")}\u00b0`;
}
