// Talks to omote over the WebSocket API: connects again by itself, and says when it does not hear the robot.
const EVERYBODY = new Set(["hello", "list", "stop", "start"]);  // these are for all heads of a stage
const SILENCE_MS = 2500, CHECK_MS = 250, PAUSES_MS = [300, 600, 1200, 2500, 5000];

export function token() {
  const given = new URLSearchParams(location.hash.slice(1)).get("token");
  if (given) {
    sessionStorage.setItem("token", given);
    history.replaceState(null, "", location.pathname);
  }
  return sessionStorage.getItem("token");
}

export class Robot extends EventTarget {
  #socket = null; #attempt = 0; #heard = 0; #id = 0; #asked = new Map(); #pending = new Map(); #drawing = false;

  constructor(secret) {
    super();
    this.secret = secret;
    this.names = [];
    this.head = "";
    this.connect();
    this.checked = performance.now();
    setInterval(() => this.#watch(), CHECK_MS);
  }

  connect() {
    const query = this.secret ? `?token=${encodeURIComponent(this.secret)}` : "";
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    const socket = this.#socket = new WebSocket(`${scheme}://${location.host}/ws${query}`);
    socket.onopen = () => this.#greet();
    socket.onmessage = (event) => this.#take(JSON.parse(event.data));
    socket.onclose = () => { if (this.#socket === socket) this.#lose(); };
  }

  async #greet() {
    this.#heard = performance.now();
    if (this.stopping) this.stop();
    const welcome = await this.ask({ type: "hello", version: 1 });
    this.names = Object.keys(welcome.parameters);
    if (!(welcome.heads ?? []).includes(this.head)) this.head = "";
    this.emit("hello", welcome);
    this.#listen();
  }

  #listen() {
    this.send({ type: "subscribe", rate_hz: 60, form: "numbers" });
    this.send({ type: "watch", rate_hz: 5 });
  }

  // From now on what is sent is for a head of this name, and what is heard is of it.
  turnTo(head) {
    this.#setPending();  // what was moved before is the other head's
    this.head = head;
    this.#listen();
  }

  #addressed(message) {
    if (!this.head || EVERYBODY.has(message.type)) return message;
    return message.type === "show" ? { head: this.head, ...message } : { to: this.head, ...message };
  }

  #take(message) {
    this.#heard = performance.now();
    if (this.#attempt || !this.good) { this.#attempt = 0; this.#state(true); }
    const asked = this.#asked.get(message.id);
    if (asked) {
      this.#asked.delete(message.id);
      if (message.type === "error") asked.refuse(new Error(message.message)); else asked.resolve(message);
    } else this.emit(message.type, message);
  }

  #watch() {
    const now = performance.now();
    if (now - this.checked > 3 * CHECK_MS) this.#heard = now;  // this page was busy: what came meanwhile is still to be read
    this.checked = now;
    if (this.good && performance.now() - this.#heard > SILENCE_MS) { this.#socket.close(); this.#lose(); }
  }

  #lose() {
    const old = this.#socket;
    this.#socket = null;
    old?.close();
    this.#asked.clear();
    this.#state(false);
    setTimeout(() => this.connect(), PAUSES_MS[Math.min(this.#attempt++, PAUSES_MS.length - 1)]);
  }

  #state(good) { if (this.good !== good) { this.good = good; this.emit("link", { good }); } }

  emit(type, detail) { this.dispatchEvent(new CustomEvent(type, { detail })); }

  on(type, act) { this.addEventListener(type, (event) => act(event.detail)); }

  send(message) {
    if (this.#socket?.readyState !== WebSocket.OPEN) return false;
    this.#socket.send(JSON.stringify(this.#addressed(message)));
    return true;
  }

  ask(message) {
    const id = ++this.#id;
    return new Promise((resolve, refuse) => {
      this.#asked.set(id, { resolve, refuse });
      if (!this.send({ ...message, id })) { this.#asked.delete(id); refuse(new Error("not connected")); }
    });
  }

  act(message) { this.ask(message).catch((error) => this.emit("refused", error)); }

  // A stop that cannot be sent goes out before anything else when the robot is heard again.
  stop() {
    this.stopping = !this.send({ type: "stop" });
    return !this.stopping;
  }

  // What a finger moves between two frames goes out as one message.
  set(name, value) {
    this.#pending.set(name, value);
    if (this.#drawing) return;
    this.#drawing = true;
    requestAnimationFrame(() => {
      this.#drawing = false;
      this.#setPending();
    });
  }

  #setPending() {
    if (!this.#pending.size) return;
    this.act({ type: "set", parameters: Object.fromEntries(this.#pending) });
    this.#pending.clear();
  }
}
