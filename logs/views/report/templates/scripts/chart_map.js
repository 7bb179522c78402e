// The map: ground in relief, threats, zones, plan and flights from above, in km.

function mapFigure(map, { scene, ground, flights }, theme, width) {
  const km = (metres) => (metres === null ? null : metres / 1000);
  const traces = [], images = [];
  function add(points, look, more) {
    traces.push({
      type: "scatter", mode: "lines", x: points.map((point) => point && km(point[0])), y: points.map((point) => point && km(point[1])),
      line: { color: theme.colour(look), width: 1.5 }, hoverinfo: "skip", showlegend: true, legendgroup: more.name, ...more,
    });
  }
  if (ground) groundOfMap(ground, theme, traces, images, km);
  if (map.area) add(ring(map.area), "quiet", { name: "edge of the area", line: { color: theme.colour("quiet"), width: 1, dash: "10px,4px" } });
  threatsOfMap(scene.threats, map.reach, map.entered, theme, add);
  for (const zone of scene.zones || []) for (const walls of zone.rings) add(walls.map((corner) => corner[1]), "zone", {
    name: zone.keep_out ? "zone to keep out of" : "edge of a zone to stay in", line: { color: theme.colour("zone"), width: zone.keep_out ? 1.5 : 3 },
    fill: zone.keep_out ? "toself" : "none", fillcolor: theme.faint("zone", 0.18), text: plainName(zone.name), hoverinfo: "text", hoveron: "points+fills",
  });
  for (const leg of scene.failing.legs) add([scene.plan[leg], scene.plan[leg + 1]], "fail", {
    name: "leg that fails", line: { color: theme.colour("fail"), width: 11 },
  });
  if (map.searched) add(map.searched, "quiet", { name: "plan as searched", line: { color: theme.colour("quiet"), width: 1.5, dash: "dashdot" } });
  add(scene.plan, "planned", { name: map.routeName, line: { color: theme.colour("planned"), width: 4 } });
  for (const flight of flights) add(flight.east.map((east, k) => [east, flight.north[k]]), flight.look, {
    name: plainName(flight.name), text: flight.time.map((_, k) => flownWords(flight, k)), hoverinfo: "text",
    line: { color: theme.colour(flight.look), width: 1.8, dash: flight.dashed ? "6px,3px" : "solid" },
  });
  waypointsOfMap(scene, map, theme, add, width);
  const names = nameOnce(traces), layout = chartLayout(theme, width, names);
  const [[west, east], [south, north]] = map.shown.map((side) => side.map(km));
  const inner = width - layout.margin.l - layout.margin.r, aspect = (north - south) / (east - west);
  const tall = Math.min(Math.max(inner * aspect, 160), 780);
  layout.margin.t -= 28;
  setHeight(layout, tall);
  layout.hovermode = "closest";
  layout.images = images;
  layout.xaxis = chartAxis(theme, { range: [west, east], title: { text: `east of ${map.origin} (km)` }, constrain: "domain", showgrid: false, hoverformat: ".3f" });
  layout.yaxis = chartAxis(theme, {
    range: [south, north], title: { text: "north (km)", standoff: 4 }, scaleanchor: "x", scaleratio: 1, constrain: "domain", showgrid: false, hoverformat: ".3f",
  });
  return { traces, layout };
}

function ring([[west, east], [south, north]]) { return [[west, south], [east, south], [east, north], [west, north], [west, south]]; }

function groundOfMap(ground, theme, traces, images, km) {
  const { columns, rows, west, south, pitchEast, pitchNorth, low, high } = ground;
  images.push({
    source: reliefPicture(ground, theme), xref: "x", yref: "y", layer: "below", sizing: "stretch",
    x: km(west - pitchEast / 2), y: km(south + (rows - 0.5) * pitchNorth), sizex: km(columns * pitchEast), sizey: km(rows * pitchNorth),
  });
  // Every other crossing is fine enough to point at.
  const step = Math.max(1, Math.ceil(Math.max(columns, rows) / 125)), x = [], y = [], z = [];
  for (let c = 0; c < columns; c += step) x.push(km(west + c * pitchEast));
  for (let r = 0; r < rows; r += step) {
    y.push(km(south + r * pitchNorth));
    const row = [];
    for (let c = 0; c < columns; c += step) {
      const height = ground.heights[r * columns + c];
      row.push(Number.isNaN(height) ? null : Math.round(height * 10) / 10);
    }
    z.push(row);
  }
  traces.push({ type: "heatmap", x, y, z, opacity: 0, showscale: false, hovertemplate: "ground %{z:.0f} m AMSL<extra></extra>" });
  if (high - low < 1) return;
  const size = [1, 2, 5, 10, 20, 50, 100, 200, 500].find((value) => (high - low) / value <= 10) || 1000;
  traces.push({
    type: "contour", x, y, z, showscale: false, hoverinfo: "skip", name: `contours every ${size} m AMSL`, showlegend: true,
    legendgroup: `contours every ${size} m AMSL`, line: { width: 0.6, color: theme.colour("contour") },
    contours: { coloring: "none", start: Math.ceil(low / size) * size, end: high, size, showlabels: true, labelfont: { size: 9, color: theme.colour("contour") } },
  });
}

function circle([east, north], radius) {
  return Array.from({ length: 73 }, (_, k) => [east + radius * Math.cos(k * Math.PI / 36), north + radius * Math.sin(k * Math.PI / 36)]);
}

function threatsOfMap(threats, reach, entered, theme, add) {
  threats.forEach((threat, k) => {
    const words = `${plainName(threat.name)}${threat.kill > 0 ? `<br>missile: ${numberText(threat.kill, 0)} m` : ""}` +
      `${threat.detection > 0 ? `<br>radar: ${numberText(threat.detection, 0)} m` : ""}`;
    const seen = { text: words, hoverinfo: "text", hoveron: "points+fills" };
    if (threat.detection > 0) add(circle(threat.at, threat.detection), "radar", {
      name: "radar: sphere's radius", line: { color: theme.colour("radar"), width: 1.3, dash: "5px,4px" },
    });
    if (reach[k] > 0) add(circle(threat.at, reach[k]), "missile", {
      name: "missile: its reach at path height", line: { width: 0, color: theme.colour("missile") }, fill: "toself", fillcolor: theme.faint("missile", 0.3), ...seen,
    });
    if (threat.kill > 0) add(circle(threat.at, threat.kill), entered.includes(k) ? "fail" : "missile", entered.includes(k) ?
      { name: "threat entered", line: { color: theme.colour("fail"), width: 3 } } :
      { name: "missile: sphere's radius", line: { color: theme.colour("missile"), width: 1.3 } });
    add([threat.at], "ink", { name: "", showlegend: false, mode: "markers", marker: { symbol: "x-thin", size: 6, line: { width: 1, color: theme.colour("ink") } }, ...seen });
  });
}

function waypointsOfMap(scene, map, theme, add, width) {
  const step = Math.max(1, Math.ceil(scene.plan.length / (isNarrow(width) ? 15 : 40)));
  const failing = new Set(scene.failing.waypoints), dot = { size: 7, color: theme.colour("paper"), line: { width: 1.5, color: theme.colour("second") } };
  add(scene.plan, "second", {
    name: "waypoint, numbered", mode: "markers+text", marker: dot, hovertext: map.waypoints, hoverinfo: "text",
    text: scene.plan.map((_, k) => (k % step === 0 || failing.has(k) ? `<b>${k}</b>` : "")), textposition: "top right",
    textfont: { size: 11, color: theme.colour("second") },
  });
  if (failing.size) add([...failing].map((k) => scene.plan[k]), "fail", {
    name: "waypoint that fails", mode: "markers", marker: { symbol: "circle-open", size: 16, color: theme.colour("fail"), line: { width: 2.5 } },
  });
  for (const [name, symbol, size] of [["start", "triangle-up", 14], ["destination", "star", 17]]) add([map[name]], "ink", {
    name, mode: "markers", marker: { symbol, size, color: theme.colour("marker"), line: { width: 1, color: "#000000" } }, text: name, hoverinfo: "text",
  });
}

function flownWords(flight, k) {
  const above = flight.above[k] === null ? "" : `, ${numberText(flight.above[k], 0)} m above ground`;
  return `${plainName(flight.name)}: ${numberText(flight.time[k], 1)} s<br>${flight.legs[flight.leg[k]] || "leg " + flight.leg[k]}<br>` +
    `${numberText(flight.up[k], 0)} m AMSL${above}<br>${numberText(flight.airspeed[k], 1)} m/s, bank ${numberText(flight.bank[k], 1)}°`;
}
