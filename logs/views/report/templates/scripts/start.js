// Puts the page together: reads its data, starts view, player and charts; what cannot start leaves the pictures.

(function () {
  const scene = pageData("scene-data"), flown = pageData("flight-data"), theme = makeTheme();
  const view = document.getElementById("view3d"), player = document.getElementById("player");
  const ground = scene ? readGround(scene) : null, flight = player ? flown.flights[0] : null;
  const moments = flight ? makeMoments(flight) : null, clock = flight ? makeClock(moments.start, moments.end) : null;
  if (view) {
    scene.track = flight ? flight.time.map((_, k) => [flight.east[k], flight.north[k], flight.up[k]]) : [];
    startView(view, { scene, ground, moments, model: flown.model, theme, clock });
  }
  if (player) startPlayer(player, clock, moments, flight.legs);
  startFolds();
  startCharts(pageData("chart-data"), { scene, ground, flights: flown.flights, theme, clock });
})();
