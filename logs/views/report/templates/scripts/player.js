// The time slider: play and pause, how fast, and the read-out of the moment.

function startPlayer(root, clock, moments, legs) {
  const button = root.querySelector("button"), slider = root.querySelector("input"), speed = root.querySelector("select");
  const readout = root.querySelector("dl");
  slider.min = clock.start; slider.max = clock.end;
  slider.step = "any";
  const cells = momentWords(moments.at(clock.start), legs).map(([word]) => {
    const name = document.createElement("dt"), value = document.createElement("dd"), pair = document.createElement("div");
    name.textContent = word;
    pair.append(name, value);
    readout.append(pair);
    return value;
  });
  // The slowest of the speeds with which the flight takes at most a minute.
  const rates = [...speed.options].map((option) => Number(option.value));
  speed.value = String(rates.find((rate) => (clock.end - clock.start) / rate <= 60) || rates[rates.length - 1]);
  function show(now) {
    const words = momentWords(moments.at(now), legs);
    words.forEach(([, value], k) => { cells[k].textContent = value; });
    slider.value = now;
    slider.setAttribute("aria-valuetext", words.slice(0, 3).map(([, value]) => value).join(", "));
    button.textContent = clock.playing() ? "❚❚ Pause" : "▶ Play";
  }
  // A hundredth of the flight is too coarse for a key, a hundredth of a second too fine.
  const keys = { ArrowRight: 1, ArrowUp: 1, ArrowLeft: -1, ArrowDown: -1, PageUp: 10, PageDown: -10 };
  slider.addEventListener("keydown", (event) => {
    if (!(event.key in keys) || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    clock.set(clock.now() + keys[event.key]);
  });
  slider.addEventListener("input", () => { clock.play(false); clock.set(Number(slider.value)); });
  button.addEventListener("click", () => clock.play(!clock.playing()));
  speed.addEventListener("change", () => clock.setRate(Number(speed.value)));
  clock.setRate(Number(speed.value));
  clock.onChange(show);
  show(clock.now());
}
