// Servos as bars within their limits (filled: wanted, line: measured), with plots; and links as a table.
import { $, make } from "/controls.js";
import { Plot } from "/plot.js";

const SVG = "http://www.w3.org/2000/svg";
const shape = (name, attributes) => {
  const element = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  return element;
};
const number = (value, unit, digits = 0) => (value == null ? "" : `${value.toFixed(digits)} ${unit}`);

export class Servos {
  #rows = new Map();

  show(servos, visible) {
    $("servo-note").textContent = servos.length ? "" : "This stage has no servos.";
    for (const servo of servos) {
      const key = `${servo.bus}/${servo.id}`;
      const row = this.#rows.get(key) ?? this.#make(key, servo);
      row.plot.add(servo.wanted_deg, servo.measured_deg);
      row.servo = servo;
    }
    if (visible) this.draw();
  }

  draw() {
    for (const row of this.#rows.values()) this.#fill(row, row.servo);
  }

  #make(key, servo) {
    const bar = shape("svg", { viewBox: "0 0 100 18", preserveAspectRatio: "none", "aria-hidden": "true" });
    const wanted = shape("rect", { class: "wanted", y: 4, height: 10, width: 2 });
    const measured = shape("line", { class: "measured", y1: 1, y2: 17, "vector-effect": "non-scaling-stroke" });
    bar.append(shape("rect", { class: "bar", x: 0, y: 4, width: 100, height: 10 }), wanted, measured);
    const figures = make("span"), canvas = make("canvas", { "aria-hidden": "true" }), fault = make("p", { class: "fault" });
    const title = make("p", {}, make("strong", { text: servo.name }), figures);
    $("servo-list").append(make("div", { class: "servo" }, title, bar, canvas, fault));
    const row = { wanted, measured, figures, fault, plot: new Plot(canvas, servo.low_deg, servo.high_deg) };
    this.#rows.set(key, row);
    return row;
  }

  #fill(row, servo) {
    const across = (angle) => 100 * Math.min(Math.max((angle - servo.low_deg) / (servo.high_deg - servo.low_deg), 0), 1);
    row.wanted.setAttribute("x", Math.min(Math.max(across(servo.wanted_deg) - 1, 0), 98));
    row.measured.setAttribute("visibility", servo.measured_deg == null ? "hidden" : "visible");
    if (servo.measured_deg != null) { const x = across(servo.measured_deg); row.measured.setAttribute("x1", x); row.measured.setAttribute("x2", x); }
    const off = servo.measured_deg == null ? null : servo.measured_deg - servo.wanted_deg;
    row.figures.textContent = [number(servo.wanted_deg, "°", 1), off == null ? "" : `${off.toFixed(1)} ° away`, number(servo.temperature_c, "°C"), servo.torque === false ? "motor off" : ""].filter(Boolean).join(" · ");
    row.fault.textContent = servo.error;
    row.plot.draw();
  }
}

export class Links {
  #before = new Map(); #at = 0;

  show(links, seconds, visible) {
    const span = seconds - this.#at, rates = links.map((link, i) => {
      const before = this.#before.get(i);
      this.#before.set(i, link.accepted ?? 0);
      return before == null || span <= 0 ? 0 : ((link.accepted ?? 0) - before) / span;
    });
    this.#at = seconds;
    if (!visible) return;
    const head = make("tr", {}, ...["In", "Jitter", "Lost", "Age", "Refused"].map((text) => make("th", { scope: "col", text })));
    const state = (link) => link.fault || link.error || link.send_error || (link.clients == null ? "good" : `${link.clients} connected`);
    const rows = links.flatMap((link, i) => [
      make("tr", {}, make("th", { scope: "colgroup", colspan: 5, text: `${link.port ?? ""} · ${state(link)}` })),
      make("tr", {}, make("td", { text: `${(link.rate_hz ?? rates[i]).toFixed(0)} /s` }),
      make("td", { text: number(link.jitter_ms, "ms", 1) }), make("td", { text: String(link.lost ?? "") }), make("td", { text: number(link.age_s, "s", 1) }),
      make("td", { text: String(Object.values(link.refused ?? {}).reduce((a, b) => a + b, 0)) }))]);
    $("link-list").replaceChildren(make("table", {}, make("thead", {}, head), make("tbody", {}, ...rows)));
  }
}
