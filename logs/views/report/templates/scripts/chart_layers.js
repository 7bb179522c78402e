// Layers as plotly.js traces: what `logs.views.charts` describes, for panels and map alike.

// axes: names of the level and the upright axis.  template: what the read-out says of a value, "" where a layer has
// words of its own or none.  scale: of lengths.  flights: those whose moments a layer shows.
function layerTraces(given, axes, template, theme, scale = 1, flights = []) {
  const flight = given.flight === undefined ? null : flights[given.flight];
  const [xs, ys] = flight ? [flight.east, flight.north] : [given.x, given.y];
  const x = scaled(xs, scale), y = scaled(ys, scale);
  const layer = { ...given, x, y, name: plainName(given.name), legend: plainName(given.legend || given.name) };
  const look = LOOKS[layer.role], shown = layer.name !== "";
  const common = { type: "scatter", x, y, ...axes, name: layer.name, legendgroup: layer.legend, showlegend: shown, connectgaps: false };
  const hover = readOut(layer, flight, template, shown);
  const unseen = { showlegend: false, opacity: 0, mode: "markers", marker: { color: theme.colour(layer.role), size: 8 } };
  switch (layer.kind) {
    case "band": {
      const [outX, outY] = bandOutline(layer);
      return [
        { ...common, x: outX, y: outY, ...areaLook(layer, theme), hoverinfo: "skip" },
        ...(layer.quiet ? [] : [{ ...common, ...unseen, mode: "lines", line: { color: theme.colour(layer.role) }, ...hover }]),
      ];
    }
    case "area":
      return [{ ...common, ...areaLook(layer, theme), ...hover, hoveron: "points+fills" }];
    case "bars":
      return [{ ...common, ...hover, type: "bar", width: 0.62, marker: { color: theme.colour(layer.role) } }];
    case "dots":
      return [{ ...common, ...hover, mode: "markers", marker: dotLook(look, layer.role, theme) }];
    case "rings": {
      const ring = { color: theme.colour(layer.role), size: look.size, symbol: "circle-open", line: { width: look.width } };
      return [{ ...common, ...hover, mode: "markers", marker: ring }];
    }
    case "dashes": {
      const endsX = x.flatMap((value) => [value - 0.42, value + 0.42, null]), endsY = y.flatMap((value) => [value, value, null]);
      return [
        { ...common, x: endsX, y: endsY, mode: "lines", line: { color: theme.colour(layer.role), width: 2.5 }, hoverinfo: "skip" },
        { ...common, ...hover, ...unseen },
      ];
    }
    default:
      return [{ ...common, ...hover, mode: "lines", line: theme.line(layer.role, layer.dashed), ...(layer.role === "planned" ? { meta: "path" } : {}) }];
  }
}

function scaled(values, scale) { return values.map((value) => (value === null ? null : value * scale)); }

// What the page says of a layer when it is pointed at: its words, the flight's moments, or its values.
function readOut(layer, flight, template, shown) {
  if (flight) return { text: flight.time.map((_, k) => flownWords(flight, k)), hoverinfo: "text" };
  if (layer.words) {
    const words = layer.words.map((text) => plainName(text).replace(/\n/g, "<br>"));
    return { [layer.kind === "dots" ? "hovertext" : "text"]: words.length > 1 ? words : words[0], hoverinfo: "text" };
  }
  return shown && !layer.quiet && template ? { hovertemplate: template } : { hoverinfo: "skip" };
}

function areaLook({ role }, theme) {
  const look = LOOKS[role];
  return { mode: "lines", fill: "toself", fillcolor: theme.faint(role, look.fill), line: { ...theme.line(role), color: theme.colour(look.edge) } };
}

function dotLook(look, role, theme) {
  const rim = look.face === role ? { width: 0 } : { width: Math.max(1, look.width), color: theme.colour(role) };
  if (look.symbol.endsWith("thin")) rim.width = look.width;
  return {
    color: theme.colour(look.face), size: look.size, symbol: look.symbol, opacity: look.size < 4 ? Math.max(look.fill, 0.3) : 1,
    line: look.symbol.endsWith("thin") ? { width: look.width, color: theme.colour(role) } : rim,
  };
}

// Once around each part of a band that has values, one after the other.
function bandOutline({ x, y, low }) {
  const outX = [], outY = [];
  for (let k = 0; k < x.length; k++) {
    if (y[k] === null || low[k] === null) continue;
    let end = k;
    while (end + 1 < x.length && y[end + 1] !== null && low[end + 1] !== null) end += 1;
    for (let j = k; j <= end; j++) { outX.push(x[j]); outY.push(y[j]); }
    for (let j = end; j >= k; j--) { outX.push(x[j]); outY.push(low[j]); }
    outX.push(x[k], null); outY.push(y[k], null);
    k = end;
  }
  return [outX, outY];
}

// The first of the traces of one name stands in the legend for all.
function nameOnce(traces) {
  const seen = new Set();
  for (const trace of traces) {
    if (!trace.showlegend) continue;
    trace.name = trace.legendgroup;
    trace.showlegend = !seen.has(trace.legendgroup);
    seen.add(trace.legendgroup);
  }
  return [...seen];
}
