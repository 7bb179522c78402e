// Unpacks plotly.js, which the page carries whole and compressed, and starts it.

async function loadPlotly() {
  const packed = Uint8Array.from(atob(document.getElementById("plotly-packed").textContent), (letter) => letter.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
  // The page's policy names this script by its hash, and lets no other in.
  const script = document.createElement("script");
  script.textContent = await new Response(stream).text();
  document.body.append(script);
  return window.Plotly;
}
