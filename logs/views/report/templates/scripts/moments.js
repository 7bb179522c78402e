// The flight moment by moment: columns of numbers by name, and what lies between two rows.

function makeMoments(flight) {
  const time = flight.time, last = time.length - 1;
  function rowBefore(t) {
    let low = 0, high = last;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (time[middle] <= t) low = middle; else high = middle;
    }
    return low;
  }
  // The shorter way round from one angle to another, degrees.
  function turnBetween(a, b) { return ((b - a + 540) % 360) - 180; }
  function at(t) {
    const k = rowBefore(t), next = Math.min(k + 1, last), span = time[next] - time[k];
    const share = span > 0 ? Math.min(Math.max((t - time[k]) / span, 0), 1) : 0;
    const found = { time: t, leg: flight.leg[share < 1 ? k : next] };
    for (const name of ["east", "north", "up", "above", "airspeed", "climb", "pitch"]) {
      const a = flight[name][k], b = flight[name][next];
      found[name] = a === null || b === null ? a : a + share * (b - a);
    }
    for (const name of ["bank", "heading"]) {
      const a = flight[name][k], b = flight[name][next];
      found[name] = a === null || b === null ? a : a + share * turnBetween(a, b);
    }
    found.heading = found.heading === null ? null : (found.heading + 360) % 360;
    return found;
  }
  return { at, start: time[0], end: time[last] };
}

// What the read-out and the charts say of a moment: words, value, unit.
function momentWords(moment, legs) {
  const side = Math.abs(moment.bank) < 0.05 ? "" : moment.bank > 0 ? " right" : " left";
  return [
    ["time", numberText(moment.time, 1) + " s"],
    ["leg", legs[moment.leg] || String(moment.leg)],
    ["altitude", numberText(moment.up, 0) + " m AMSL"],
    ["above ground", moment.above === null ? "–" : numberText(moment.above, 0) + " m"],
    ["airspeed", numberText(moment.airspeed, 1) + " m/s"],
    ["climb", numberText(moment.climb, 1) + " m/s"],
    ["bank", moment.bank === null ? "–" : numberText(Math.abs(moment.bank), 1) + "°" + side],
    ["heading", moment.heading === null ? "–" : numberText(moment.heading, 0).padStart(3, "0") + "°"],
  ];
}
