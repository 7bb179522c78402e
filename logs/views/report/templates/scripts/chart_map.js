// The map: ground in relief, threats, zones, plan and flights from above, in km.

function mapFigure(map, { ground, flights }, theme, width) {
  const traces = [], images = [], axes = { xaxis: "x", yaxis: "y" };
  if (ground) groundOfMap(ground, theme, traces, images);
  for (const layer of map.layers) traces.push(...layerTraces(layer, axes, "", theme, 0.001, flights));
  traces.push(...labelTraces(map.labels, axes, theme, 0.001));
  const names = nameOnce(traces), layout = chartLayout(theme, width, names);
  const [[west, east], [south, north]] = [map.east, map.north].map((side) => side.map(km));
  const inner = width - layout.margin.l - layout.margin.r, aspect = (north - south) / (east - west);
  // Legend, axes and caption fit the screen together with the map.
  const tall = Math.max(Math.min(inner * aspect, 0.66 * window.innerHeight), 160);
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

function km(metres) { return metres / 1000; }

function groundOfMap(ground, theme, traces, images) {
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

function flownWords(flight, k) {
  const above = flight.above[k] === null ? "" : `, ${numberText(flight.above[k], 0)} m above ground`;
  return `${plainName(flight.name)}: ${numberText(flight.time[k], 1)} s<br>${flight.legs[flight.leg[k]] || "leg " + flight.leg[k]}<br>` +
    `${numberText(flight.up[k], 0)} m AMSL${above}<br>${numberText(flight.airspeed[k], 1)} m/s, bank ${numberText(flight.bank[k], 1)}°`;
}
