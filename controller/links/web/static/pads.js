// A square that a finger or the arrow keys move a point in: two numbers, each from -1 to 1.
import { make } from "/controls.js";

export class Pad {
  constructor(element, { name, ends, act }) {
    this.element = element;
    this.act = act;
    this.name = name;
    this.dot = make("i");
    element.append(this.dot, ...ends.map((text) => make("small", { text })));
    for (const [key, value] of Object.entries({ tabindex: 0, role: "slider", "aria-valuemin": -100, "aria-valuemax": 100, "aria-orientation": "horizontal" })) element.setAttribute(key, value);
    element.removeAttribute("aria-labelledby");
    this.place(0, 0);
    element.addEventListener("pointerdown", (event) => { element.setPointerCapture(event.pointerId); this.#from(event); });
    element.addEventListener("pointermove", (event) => { if (element.hasPointerCapture(event.pointerId)) this.#from(event); });
    element.addEventListener("keydown", (event) => this.#key(event));
  }

  #from(event) {
    const box = this.element.getBoundingClientRect();
    this.#move(2 * (event.clientX - box.left) / box.width - 1, 1 - 2 * (event.clientY - box.top) / box.height);
  }

  #key(event) {
    const step = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, 0.1], ArrowDown: [0, -0.1] }[event.key];
    if (!step) return;
    event.preventDefault();
    this.#move(this.x + step[0], this.y + step[1]);
  }

  #move(x, y) {
    this.place(x, y);
    this.act(this.x, this.y);
  }

  place(x, y) {
    [this.x, this.y] = [x, y].map((value) => Math.min(Math.max(value, -1), 1));
    this.dot.style.left = `${50 + 46 * this.x}%`;
    this.dot.style.top = `${50 - 46 * this.y}%`;
    const text = `${Math.round(100 * this.x)} across, ${Math.round(100 * this.y)} up`;
    this.element.setAttribute("aria-valuenow", Math.round(100 * this.x));
    this.element.setAttribute("aria-valuetext", text);
    this.element.setAttribute("aria-label", this.name);
  }
}
