// What all charts share: colours, letters, legend and the bar of buttons.

const CHART_FONT = 'system-ui, -apple-system, "Segoe UI", Roboto, "Helvetica Neue", Arial, sans-serif';

// Pixels that the bar of buttons takes above the legend.
const CHART_BUTTONS = 28;

function isNarrow(width) { return width < 620; }

// Rows that a legend takes above a chart so many pixels wide.
function legendRows(names, width) {
  let rows = 1, used = 0;
  for (const name of names) {
    const wide = 52 + 6.6 * name.length;
    if (used && used + wide > width) { rows += 1; used = 0; }
    used += wide;
  }
  return names.length ? rows : 0;
}

// names: of the legend, which stands above the charts and covers nothing.
function chartLayout(theme, width, names) {
  const narrow = isNarrow(width), rows = legendRows(names, width - 20), touch = window.matchMedia("(pointer: coarse)").matches;
  return {
    width,
    paper_bgcolor: theme.clear,
    plot_bgcolor: theme.colour("plot"),
    font: { family: CHART_FONT, size: narrow ? 11 : 12, color: theme.colour("ink") },
    hoverlabel: {
      bgcolor: theme.colour("paper"), bordercolor: theme.colour("quiet"), namelength: -1,
      font: { family: CHART_FONT, size: 12, color: theme.colour("ink") },
    },
    // From above: the buttons, the legend, names of legs and of the first panel.
    margin: { l: narrow ? 44 : 58, r: 14, t: CHART_BUTTONS + 19 * rows + 36, b: 46 },
    showlegend: names.length > 0,
    legend: {
      orientation: "h", x: 0, xanchor: "left", y: 1, yanchor: "top", yref: "container", xref: "container",
      font: { size: narrow ? 11 : 12 }, bgcolor: theme.clear, itemsizing: "constant", tracegroupgap: 0,
    },
    modebar: {
      orientation: "h", bgcolor: theme.clear, color: theme.colour("quiet"), activecolor: theme.colour("ink"),
    },
    // A finger scrolls the page; with the buttons it zooms.
    dragmode: touch ? false : "zoom",
    shapes: [],
    annotations: [],
  };
}

function chartAxis(theme, more) {
  return {
    gridcolor: theme.colour("rule"), linecolor: theme.colour("quiet"), zerolinecolor: theme.colour("quiet"),
    zeroline: false, showline: true, ticks: "outside", tickcolor: theme.colour("quiet"), automargin: false, ...more,
  };
}

// Gives a chart its height, by that of what it draws, and the legend its place under the buttons.
function setHeight(layout, inner) {
  layout.height = inner + layout.margin.t + layout.margin.b;
  layout.legend.y = 1 - CHART_BUTTONS / layout.height;
}

const CHART_CONFIG = {
  displaylogo: false,
  displayModeBar: true,
  modeBarButtons: [["zoom2d", "pan2d", "zoomIn2d", "zoomOut2d", "resetScale2d"]],
  scrollZoom: false,
  doubleClick: "reset",
};
