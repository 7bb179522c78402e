// Colours by their roles, from the page's style, one set for light and one for dark; widths and dashes are in LOOKS.

function makeTheme() {
  const dark = window.matchMedia("(prefers-color-scheme: dark)");
  const listeners = [];
  function colour(role) {
    return getComputedStyle(document.documentElement).getPropertyValue("--" + role).trim();
  }
  // Red, green and blue from 0 to 1; the style writes colours as six hexadecimal digits.
  function shares(role) {
    const text = colour(role);
    return [1, 3, 5].map((at) => parseInt(text.slice(at, at + 2), 16) / 255);
  }
  // The colour with an opacity, its eighth and seventh digit.
  function faint(role, opacity) {
    return colour(role) + Math.round(255 * opacity).toString(16).padStart(2, "0");
  }
  function line(role, dashed) {
    const look = LOOKS[role];
    return { color: colour(role), width: look.width, dash: dashed && look.dash === "solid" ? "10px,4px" : look.dash };
  }
  dark.addEventListener("change", () => listeners.forEach((tell) => tell()));
  return { colour, shares, faint, line, clear: "transparent", onChange: (tell) => listeners.push(tell) };
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
