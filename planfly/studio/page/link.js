// Connect to the server: send the token and the newest position of a drag, and reconnect after a lost connection.

const REST = 150;
const KEY = "planfly-studio-token";

function token() {
  const given = new URLSearchParams(location.hash.slice(1)).get("t");
  if (given) {
    sessionStorage.setItem(KEY, given);
    history.replaceState(null, "", "/");
  }
  return sessionStorage.getItem(KEY) || "";
}

// Ranges of the numbers that the server accepts, m, except the seed.
export const RANGES = { east: [-6e5, 6e5], north: [-6e5, 6e5], up: [-500, 9000], by: [-9000, 9000], seed: [0, 2 ** 31 - 1] };

function bounded(message) {
  const copy = { ...message };
  for (const [name, [low, high]] of Object.entries(RANGES)) {
    if (typeof copy[name] === "number") copy[name] = Math.min(high, Math.max(low, copy[name]));
  }
  return copy;
}

export class Link {
  // handlers: by kind of message, and "picture" and "heights" of the ground, "open" and "lost" of the connection.
  constructor(handlers) {
    this.handlers = handlers;
    this.token = token();
    this.number = 0;
    this.place = null;
    this.tries = 0;
    this.dark = matchMedia("(prefers-color-scheme: dark)");
    this.dark.addEventListener("change", () => this.send({ kind: "look", dark: this.dark.matches }));
    // An address with a new token in an open page only changes the hash, so reload the page.
    addEventListener("hashchange", () => location.hash.startsWith("#t=") && location.reload());
    this.connect();
  }

  connect() {
    if (!this.token) {
      this.handlers.lost("Open the address that planfly studio printed: it contains the key to this page.", true);
      return;
    }
    const socket = new WebSocket(`ws://${location.host}/session`);
    socket.binaryType = "arraybuffer";
    this.socket = socket;
    socket.onopen = () => socket.send(JSON.stringify({ kind: "hello", token: this.token, dark: this.dark.matches }));
    socket.onmessage = (event) => this.hear(event.data);
    socket.onclose = (event) => this.lost(event.code);
  }

  lost(code) {
    if (code === 4403) return this.handlers.lost("This key belongs to another run of the studio: open the address that this run printed in this tab.", true);
    if (code === 4429) return this.handlers.lost("Four pages are already open: close one, then reload this one.", true);
    this.tries += 1;
    this.handlers.lost("The studio does not answer: start it again with the same file.", false);
    setTimeout(() => this.connect(), Math.min(5000, 300 * this.tries));
  }

  send(message) {
    if (this.socket && this.socket.readyState === 1) {
      this.socket.send(JSON.stringify(bounded(message)));
      return true;
    }
    return false;
  }

  hear(data) {
    if (typeof data !== "string") return this.binary(data);
    const message = JSON.parse(data);
    if (message.kind === "world") {
      this.tries = 0;
      this.handlers.open();
    }
    if (message.kind === "preview") return this.previewed(message);
    const handler = this.handlers[message.kind];
    if (handler) handler(message);
    // Kind of the previous message: a failed task is first reported as stopped, and then with its fault.
    this.before = message.kind;
  }

  binary(data) {
    const bytes = new Uint8Array(data), size = new DataView(data).getUint32(1, true);
    const head = JSON.parse(new TextDecoder().decode(bytes.subarray(5, 5 + size)));
    const body = data.slice(5 + size);
    if (bytes[0] === 71) this.handlers.picture({ ...head, url: URL.createObjectURL(new Blob([body], { type: "image/webp" })) });
    else this.handlers.heights({ ...head, heights: new Float32Array(body) });
  }

  // Send each position of a dragged item at once: the server judges only the newest position that has arrived.
  // Request the verdict on the whole mission when the pointer rests.
  drag(place) {
    this.number += 1;
    // Store the requested and the shown number in the page, for measurements.
    document.documentElement.dataset.asked = this.number;
    this.place = { kind: "drag", ...place };
    clearTimeout(this.rest);
    this.rest = setTimeout(() => this.send({ ...this.place, whole: true, n: ++this.number }), REST);
    this.send({ ...this.place, n: this.number });
  }

  // Ignore an answer on an older mission (stale).
  previewed(message) {
    if (this.place && !message.stale) this.handlers.preview(message);
  }

  // The drag has ended, in whatever way.
  settle() {
    clearTimeout(this.rest);
    this.place = null;
  }
}
