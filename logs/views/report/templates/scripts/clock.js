// The moment that the page shows: one number, set by slider, by playing or by a chart, and told to all who listen.

function makeClock(start, end) {
  const listeners = [];
  let now = start, playing = false, rate = 1, before = 0;
  function set(time) {
    now = Math.min(Math.max(time, start), end);
    listeners.forEach((tell) => tell(now));
  }
  function step(stamp) {
    if (!playing) return;
    // A page that was away for long goes on where it was.
    const passed = Math.min((stamp - before) / 1000, 1);
    before = stamp;
    const next = now + rate * passed;
    playing = next < end;
    set(next);
    if (playing) window.requestAnimationFrame(step);
  }
  function play(on) {
    if (on === playing) return;
    playing = on;
    if (on) {
      if (now >= end) now = start;
      before = performance.now();
      window.requestAnimationFrame(step);
    }
    set(now);
  }
  return {
    start, end, set, play,
    now: () => now,
    playing: () => playing,
    setRate: (value) => { rate = value; },
    onChange: (tell) => listeners.push(tell),
  };
}
