// Mouse, fingers, keys and buttons of the 3-D view.

function bindHands(over, buttons, camera, redraw) {
  const deeds = {
    left: () => camera.turn(-0.12, 0), right: () => camera.turn(0.12, 0),
    up: () => camera.turn(0, 0.08), down: () => camera.turn(0, -0.08),
    near: () => camera.zoom(0.85), far: () => camera.zoom(1 / 0.85),
    home: camera.goHome, stretch: camera.nextStretch, top: camera.fromAbove, side: camera.fromTheSide,
  };
  const keys = {
    ArrowLeft: "left", ArrowRight: "right", ArrowUp: "up", ArrowDown: "down", "+": "near", "=": "near", "-": "far",
    0: "home", Home: "home", t: "top", s: "side", h: "stretch",
  };
  const panned = { left: [40, 0], right: [-40, 0], up: [0, 40], down: [0, -40] };
  function pan(dx, dy) { camera.pan(dx, dy, over.clientHeight); }

  const held = new Map();
  let spread = 0, middle = null;
  function letGo(event) { held.delete(event.pointerId); spread = 0; middle = null; }
  over.addEventListener("pointerdown", (event) => {
    held.set(event.pointerId, [event.clientX, event.clientY]);
    spread = 0; middle = null;
    over.setPointerCapture(event.pointerId);
    over.focus({ preventScroll: true });
  });
  over.addEventListener("pointermove", (event) => {
    const before = held.get(event.pointerId);
    if (!before) return;
    const dx = event.clientX - before[0], dy = event.clientY - before[1];
    held.set(event.pointerId, [event.clientX, event.clientY]);
    const [a, b] = [...held.values()];
    if (b) {
      const apart = Math.hypot(a[0] - b[0], a[1] - b[1]), centre = [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2];
      if (spread && apart) camera.zoom(spread / apart);
      if (middle) pan(centre[0] - middle[0], centre[1] - middle[1]);
      spread = apart; middle = centre;
    } else if (event.shiftKey || (event.buttons & 2)) pan(dx, dy);
    else camera.turn(dx * 0.007, dy * 0.006);
    redraw();
  });
  over.addEventListener("pointerup", letGo);
  over.addEventListener("pointercancel", letGo);
  over.addEventListener("contextmenu", (event) => event.preventDefault());
  over.addEventListener("wheel", (event) => {
    // The page scrolls as everywhere, until the view was clicked.
    if (document.activeElement !== over && !event.ctrlKey) return;
    event.preventDefault();
    camera.zoom(Math.exp(event.deltaY * 0.0012));
    redraw();
  }, { passive: false });
  over.addEventListener("keydown", (event) => {
    const deed = keys[event.key];
    if (!deed || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    if (event.shiftKey && panned[deed]) pan(...panned[deed]); else deeds[deed]();
    redraw();
  });
  for (const button of buttons) button.addEventListener("click", () => { deeds[button.dataset.do](); redraw(); });
}
