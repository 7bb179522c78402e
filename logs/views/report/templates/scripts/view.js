// The 3-D view: ground, threats, zones, plan, flight and the aircraft where the clock has it.

const AIRCRAFT_SIZE = 0.09; // of the distance that it is seen from

function startView(root, { scene, ground, moments, model, theme, clock }) {
  const canvas = root.querySelector("canvas.ground"), over = root.querySelector("canvas.labels");
  const painter = makePainter(canvas);
  if (!painter) return; // the still picture stays
  const frame = makeFrame(scene, ground), camera = makeCamera(scene, frame);
  const labels = makeLabels(over.getContext("2d"), theme), names = sceneLabels(scene, frame);
  const stretchWords = root.querySelector(".stretch");
  let meshes = [], walls = [], lines = [];

  // Lines lie on each other in this order; ghost: how strongly one shows behind a ridge.
  function build() {
    [...meshes, ...walls, ...lines.map((line) => line.held)].forEach(painter.free);
    meshes = ground ? [painter.upload(groundShape(ground, frame, groundTint(theme)))] : [];
    walls = []; lines = [];
    function line(paths, look, width, ghost, alpha = 1) {
      const held = painter.uploadLine(linePieces(paths, frame.put));
      lines.push({ held, width, ghost, colour: [...theme.shares(look), alpha] });
    }
    const missiles = scene.threats.filter((threat) => threat.kill > 0);
    for (const threat of missiles) walls.push(painter.upload(domeShape(threat.at, threat.kill, theme.shares("missile"), frame)));
    for (const zone of scene.zones || []) for (const ring of zone.rings) {
      if (zone.keep_out) walls.push(painter.upload(wallShape(ring, theme.shares("zone"), frame)));
      for (const edge of [0, 1])
        line([ring.map((corner) => corner[edge])], "zone", zone.keep_out ? 1.6 : 2.6, 0.25, 0.4 + 0.6 * edge);
    }
    const { west, east, south, north, low } = frame;
    if (!ground) line([[[west, south, low], [east, south, low], [east, north, low], [west, north, low], [west, south, low]]], "quiet", 1.5, 0);
    const radars = scene.threats.filter((threat) => threat.detection > 0);
    line(dashed(radars.flatMap((threat) => sphereRings(threat.at, threat.detection))), "radar", 1.2, 0.15, 0.8);
    line(missiles.flatMap((threat) => sphereRings(threat.at, threat.kill)), "missile", 1.4, 0.3);
    line(scene.plan.map((point) => [point, [point[0], point[1], groundUnder(point)]]), "quiet", 1.1, 0.2, 0.9);
    line(scene.failing.legs.map((k) => [scene.plan[k], scene.plan[k + 1]]), "fail", 11, 0.5, 0.9);
    line([scene.plan], "planned", 6, 0.35);
    if (scene.track.length) line([scene.track], "flown", 2.2, 0.35);
  }
  function groundUnder([e, n]) { return ground ? ground.under(e, n) : frame.low; }

  function drawAircraft(m, ratio, aspect) {
    const moment = moments.at(clock.now()), place = [moment.east, moment.north, moment.up];
    const pole = painter.uploadLine(linePieces([[place, [place[0], place[1], groundUnder(place)]]], frame.put));
    painter.drawLine(pole, m, camera.stretch(), 2 * ratio, [...theme.shares("aircraft"), 1], 0.004);
    const span = AIRCRAFT_SIZE * camera.distance(aspect);
    const mesh = painter.upload(aircraftShape(model, moment, frame, span, camera.stretch()));
    painter.onTop();
    painter.drawMesh(mesh, m, camera.stretch(), 1);
    painter.free(pole); painter.free(mesh);
  }
  function draw() {
    const ratio = Math.min(window.devicePixelRatio || 1, 2), width = root.clientWidth, height = root.clientHeight;
    if (!width || !height) return;
    for (const one of [canvas, over]) { one.width = Math.round(width * ratio); one.height = Math.round(height * ratio); }
    const m = camera.matrix(width / height), stretch = camera.stretch();
    function drawLine({ held, width: wide, colour }, share, k) {
      painter.drawLine(held, m, stretch, wide * ratio, [...colour.slice(0, 3), colour[3] * share], 0.0005 * (1 + k));
    }
    painter.clear(theme.shares("sky"));
    meshes.forEach((mesh) => painter.drawMesh(mesh, m, stretch, 1));
    // What a ridge hides shines faintly through it.
    painter.behind();
    lines.forEach((line, k) => { if (line.ghost) drawLine(line, line.ghost, k); });
    painter.before();
    lines.forEach((line, k) => drawLine(line, 1, k));
    painter.through();
    walls.forEach((wall) => painter.drawMesh(wall, m, stretch, 0.2));
    if (moments) drawAircraft(m, ratio, width / height);
    const shown = labels.draw(names, (point) => camera.project(m, point, width, height), width, height, ratio);
    root.dataset.labels = shown.join("|");
    stretchWords.textContent = "heights × " + stretch;
  }
  let waiting = false;
  function redraw() {
    if (waiting) return;
    waiting = true;
    window.requestAnimationFrame(() => { waiting = false; draw(); });
  }
  // Paper gets a copy of both canvases: one that was drawn by WebGL may be empty when it is printed.
  window.addEventListener("beforeprint", () => {
    draw();
    const paper = root.querySelector("canvas.paper"), pen = paper.getContext("2d");
    paper.width = canvas.width; paper.height = canvas.height;
    for (const layer of [canvas, over]) pen.drawImage(layer, 0, 0);
  });
  bindHands(over, root.parentNode.querySelectorAll("button[data-do]"), camera, redraw);
  canvas.addEventListener("webglcontextlost", (event) => {
    event.preventDefault();
    document.documentElement.classList.remove("live3d");
  });
  window.addEventListener("resize", redraw);
  theme.onChange(() => { build(); redraw(); });
  if (moments) clock.onChange(redraw);
  build();
  document.documentElement.classList.add("live3d");
  draw();
}
