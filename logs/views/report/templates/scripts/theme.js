// Colours by their words, from the page's style: one set for light, one for dark; charts and view ask here.

function makeTheme() {
  const dark = window.matchMedia("(prefers-color-scheme: dark)");
  const listeners = [];
  function colour(word) {
    return getComputedStyle(document.documentElement).getPropertyValue("--" + word).trim();
  }
  // Red, green and blue from 0 to 1; the style writes colours as #rrggbb.
  function shares(word) {
    const text = colour(word);
    return [1, 3, 5].map((at) => parseInt(text.slice(at, at + 2), 16) / 255);
  }
  function faint(word, alpha) {
    return `rgba(${shares(word).map((share) => Math.round(255 * share)).join(",")},${alpha})`;
  }
  dark.addEventListener("change", () => listeners.forEach((tell) => tell()));
  return { colour, shares, faint, onChange: (tell) => listeners.push(tell) };
}

// Colours of the ground from its lowest to its highest place, each [red, green, blue] from 0 to 1.
function groundTint(theme) {
  const stops = [0, 1, 2, 3, 4].map((k) => theme.shares("ground-" + k));
  return (share) => {
    const x = Math.min(Math.max(share, 0), 1) * (stops.length - 1);
    const k = Math.min(Math.floor(x), stops.length - 2);
    return stops[k].map((low, c) => low + (x - k) * (stops[k + 1][c] - low));
  };
}
