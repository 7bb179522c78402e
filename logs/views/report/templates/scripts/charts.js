// Draws the page's charts: each when it comes near the screen, again when width or colours change, all when it prints.

const PRINT_WIDTH = 680; // px, width of A4 between margins of 14 mm

function startCharts(charts, world) {
  const { theme, clock } = world, holders = [...document.querySelectorAll(".chart")].filter((holder) => charts[holder.dataset.chart]);
  if (!holders.length || !("DecompressionStream" in window)) return; // the pictures stay
  const drawn = new Map();
  let library = null, loaded = null, printing = false;
  for (const holder of holders) {
    holder.closest("figure").classList.add("charted");
    // What follows stays where it is when the chart comes.
    const { panels, tall } = charts[holder.dataset.chart];
    holder.style.minHeight = panels ? panels.length * (tall + PANEL_GAP) + 90 + "px" : "300px";
  }
  // Without the library the pictures come back.
  function giveUp(error) {
    for (const holder of holders) holder.closest("figure").classList.remove("charted");
    throw error;
  }

  function load() {
    library = library || loadPlotly().then((plotly) => { loaded = plotly; return plotly; }).catch(giveUp);
    return library;
  }
  async function draw(holder) {
    const width = Math.floor(holder.clientWidth);
    if (printing || !width || drawn.get(holder) === width) return;
    drawn.set(holder, width);
    const plotly = await load();
    if (!printing) await place(plotly, holder, width);
  }
  async function place(plotly, holder, width) {
    const chart = charts[holder.dataset.chart];
    const figure = chart.panels ? panelFigure(chart, theme, width) : mapFigure(chart, world, theme, width);
    if (chart.timed && clock) figure.layout.shapes.push(cursor(figure.layout));
    arrangeLabels(figure.traces, figure.layout);
    await plotly.react(holder, figure.traces, figure.layout, CHART_CONFIG);
    holder.style.minHeight = "";
    holder.dataset.drawn = String(1 + Number(holder.dataset.drawn || 0));
    nameButtons(holder);
    if (!holder.dataset.labelled) {
      holder.dataset.labelled = "yes";
      holder.on("plotly_relayout", (change) => { if (Object.keys(change).some((key) => key.includes("axis"))) moveLabels(plotly, holder); });
    }
    if (chart.timed && clock && !holder.dataset.bound) bind(holder);
  }
  // Labels of a chart that was zoomed or moved.
  function moveLabels(plotly, holder) {
    const at = holder.data.map((trace, k) => (trace.meta && trace.meta.labels ? k : -1)).filter((k) => k >= 0);
    if (!at.length) return;
    arrangeLabels(holder.data, holder.layout);
    plotly.restyle(holder, { text: at.map((k) => holder.data[k].text), textposition: at.map((k) => holder.data[k].textposition) }, at);
  }
  // A line at the moment that the page shows.
  function cursor(layout) {
    return { type: "line", yref: "paper", y0: 0, y1: 1, x0: clock.now(), x1: clock.now(), line: { color: theme.colour("aircraft"), width: 2 }, name: "now" };
  }
  function bind(holder) {
    holder.dataset.bound = "yes";
    holder.on("plotly_click", (event) => { clock.play(false); clock.set(event.points[0].x); });
    let waiting = false;
    clock.onChange(() => {
      if (waiting) return;
      waiting = true;
      window.setTimeout(() => {
        waiting = false;
        const at = holder.layout.shapes.findIndex((shape) => shape.name === "now");
        const box = holder.getBoundingClientRect();
        if (at < 0 || box.bottom < 0 || box.top > window.innerHeight) return;
        window.Plotly.relayout(holder, { [`shapes[${at}].x0`]: clock.now(), [`shapes[${at}].x1`]: clock.now() });
      }, 120);
    });
  }
  // Buttons say in words what they do; those of older plotly.js are links that lead nowhere, and no keyboard finds them.
  function nameButtons(holder) {
    for (const button of holder.querySelectorAll(".modebar-btn")) {
      button.setAttribute("aria-label", button.getAttribute("data-title") || "");
      if (button.tagName === "BUTTON" || button.role === "button") continue;
      button.setAttribute("role", "button");
      button.tabIndex = 0;
      button.addEventListener("keydown", (event) => { if (event.key === "Enter" || event.key === " ") { event.preventDefault(); button.click(); } });
    }
  }
  const near = new IntersectionObserver((seen) => {
    for (const one of seen) if (one.isIntersecting) draw(one.target);
  }, { rootMargin: "400px" });
  function again(forget) {
    for (const holder of holders) {
      if (!drawn.has(holder)) continue;
      if (forget) drawn.set(holder, 0);
      draw(holder);
    }
  }
  holders.forEach((holder) => near.observe(holder));
  // Printing waits for nothing: the library is there before, and each chart is drawn at once in the width of the paper.
  window.addEventListener("load", () => window.setTimeout(load, 500));
  window.addEventListener("beforeprint", () => {
    printing = true;
    for (const holder of holders) {
      if (loaded) place(loaded, holder, PRINT_WIDTH);
      else holder.closest("figure").classList.remove("charted");
    }
  });
  window.addEventListener("afterprint", () => {
    printing = false;
    for (const holder of holders) holder.closest("figure").classList.add("charted");
    for (const holder of holders) drawn.set(holder, 0);
    again(true);
  });
  let later = 0;
  window.addEventListener("resize", () => { window.clearTimeout(later); later = window.setTimeout(() => again(false), 150); });
  theme.onChange(() => again(true));
}
