// Charts of panels: what `logs.views.charts` describes, as traces and layout of plotly.js.

const PANEL_GAP = 26, PANEL_GAP_OWN_AXIS = 60;

function limitTrace([name, value], x, axes, theme) {
  return {
    type: "scatter", mode: "lines", x, y: [value, value], ...axes, name, showlegend: name !== "", legendgroup: name,
    hoverinfo: "skip", line: theme.line("limit"),
  };
}

function panelFigure(chart, theme, width) {
  const traces = [], axes = {}, panels = chart.panels;
  panels.forEach((panel, k) => {
    const number = k ? String(k + 1) : "", levelAxis = chart.shared ? "x" : "x" + number;
    const on = { xaxis: levelAxis, yaxis: "y" + number };
    const template = `%{y}${panel.unit ? (panel.unit === "°" ? "°" : " " + panel.unit) : ""}`;
    for (const layer of panel.layers) {
      const where = chart.along || !layer.name ? "" : `${panel.along} %{x}<br>${layer.name}: `;
      traces.push(...layerTraces(layer, on, where + template + (chart.shared && chart.panels.length > 0 ? "" : "<extra></extra>"), theme));
    }
    traces.push(...labelTraces(panel.labels, on, theme));
    const all = panel.layers.flatMap((layer) => layer.x).filter((value) => value !== null);
    const ends = [Math.min(...all), Math.max(...all)];
    traces.push(...panel.limits.map((limit) => limitTrace(limit, ends, on, theme)));
    axes["yaxis" + number] = chartAxis(theme, {
      anchor: levelAxis,
      hoverformat: ".4~g", nticks: chart.tall > 200 ? 10 : 5, range: panel.span, fixedrange: chart.shared && panels.length > 2,
    });
    if (!chart.shared) axes["xaxis" + number] = chartAxis(theme, {
      anchor: "y" + number, range: [ends[0] - 0.8, ends[1] + 0.8], title: { text: panel.along, standoff: 2 }, nticks: 20, tickformat: "d",
    });
  });
  const layout = chartLayout(theme, width, nameOnce(traces));
  placePanels(chart, layout, axes, theme);
  if (chart.shared) {
    axes.xaxis = chartAxis(theme, {
      anchor: panels.length > 1 ? "y" + panels.length : "y", range: reach(chart),
      title: { text: `${chart.along} (${chart.unit})`, standoff: 8 }, hoverformat: ".2f", unifiedhovertitle: { text: `%{x} ${chart.unit}` },
    });
    layout.hovermode = "x unified";
    layout.hoversubplots = "axis";
    markLegs(chart, layout, theme, width);
  } else layout.hovermode = "closest";
  return { traces, layout: { ...layout, ...axes, barmode: "overlay" } };
}

// From the first to the last value along the axis that the panels share.
function reach(chart) {
  let low = Infinity, high = -Infinity;
  for (const panel of chart.panels) for (const layer of panel.layers) for (const value of layer.x) if (value !== null) {
    low = Math.min(low, value); high = Math.max(high, value);
  }
  const room = chart.marks.length ? 0 : 0.02 * (high - low);
  return [low - room, high + room];
}

// Panels of one height from top to bottom, each with its name above it.
function placePanels(chart, layout, axes, theme) {
  const count = chart.panels.length, gap = chart.shared ? PANEL_GAP : PANEL_GAP_OWN_AXIS;
  const inner = count * chart.tall + (count - 1) * gap;
  setHeight(layout, inner);
  chart.panels.forEach((panel, k) => {
    const top = 1 - k * (chart.tall + gap) / inner, note = panel.note ? `; ${panel.note}` : "";
    layout.annotations.push({
      text: panel.title + (panel.unit ? ` (${panel.unit})` : "") + note, x: 0, xref: "paper", xanchor: "left", xshift: 0, y: top, yref: "paper",
      yanchor: "bottom", yshift: k || !chart.marks.length ? 1 : 14, showarrow: false, font: { size: 12, color: theme.colour("ink") },
    });
    axes["yaxis" + (k ? k + 1 : "")].domain = [Math.max(0, top - chart.tall / inner), top];
  });
}

// A thin line where each leg begins, and as many of their names as there is room for.
function markLegs(chart, layout, theme, width) {
  const look = { type: "line", yref: "paper", y0: 0, y1: 1, layer: "below", line: { color: theme.colour("rule"), width: 1 } };
  const [low, high] = layout.xaxis ? layout.xaxis.range : reach(chart), pixels = (width - 72) / ((high - low) || 1);
  let free = -Infinity;
  chart.marks.forEach(([value, words], k) => {
    layout.shapes.push({ ...look, x0: value, x1: value });
    if (value * pixels < free) return;
    free = value * pixels + (k ? 22 : 38);
    layout.annotations.push({
      x: value, y: 1, yref: "paper", yanchor: "bottom", xanchor: "left", showarrow: false, font: { size: 10, color: theme.colour("quiet") },
      text: k ? words.replace("leg ", "") : words,
    });
  });
}
