// Small parts of the panel: elements, buttons, sliders by region.
export const $ = (id) => document.getElementById(id);

export function make(tag, attributes = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (name === "text") element.textContent = value;
    else element.setAttribute(name, value);
  }
  element.append(...children);
  return element;
}

export const percent = (value) => `${Math.round(100 * value)} %`;

// "mouthSmileLeft" as "mouth smile left".
export const words = (name) => name.replace(/([A-Z_])/g, " $1").replace(/_/g, "").toLowerCase();

export function tabs(titles, opened = () => {}) {
  const show = (wanted) => {
    for (const name of Object.keys(titles)) {
      const chosen = name === wanted;
      $(`tab-${name}`).setAttribute("aria-selected", chosen);
      $(`tab-${name}`).tabIndex = chosen ? 0 : -1;
      $(name).hidden = !chosen;
    }
    opened(wanted);
  };
  const names = Object.keys(titles);
  for (const name of names) {
    $("tabs").append(make("button", { id: `tab-${name}`, type: "button", role: "tab", "aria-controls": name, text: titles[name], onclick: () => show(name) }));
  }
  $("tabs").addEventListener("keydown", (event) => {
    const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    if (!step) return;
    const next = names[(names.findIndex((name) => $(`tab-${name}`) === document.activeElement) + step + names.length) % names.length];
    show(next);
    $(`tab-${next}`).focus();
  });
  show(names[0]);
}

const other = (name) => (/Left/.test(name) ? name.replace("Left", "Right") : name.replace("Right", "Left"));

export class Sliders {
  #rows = new Map();

  constructor(robot) { this.robot = robot; }

  build(parameters) {
    $("regions").replaceChildren();
    this.#rows.clear();
    const regions = Map.groupBy ? Map.groupBy(Object.entries(parameters), ([, p]) => p.region) : grouped(parameters);
    for (const [region, entries] of regions) {
      const box = make("details", {}, make("summary", { text: region }));
      box.open = region === "mouth" || region === "eyes";
      for (const [name, range] of entries) box.append(this.#row(name, range));
      $("regions").append(box);
    }
  }

  #row(name, range) {
    const label = words(name), id = `p-${name}`;
    const input = make("input", { id, type: "range", min: range.low, max: range.high, step: 0.01, value: 0 });
    const output = make("output", { for: id, text: "0.00" });
    const free = make("button", { type: "button", class: "free", "aria-label": `Release ${label}`, title: "Release: expressions, idle motion, speech and live faces move it again", text: "×", onclick: () => this.release(name) });
    const row = make("div", { class: "row" }, make("span", {}, make("label", { for: id, text: label })), input, output, free);
    input.addEventListener("input", () => this.move(name, Number(input.value)));
    for (const [event, touched] of [["pointerdown", true], ["pointerup", false], ["pointercancel", false]]) input.addEventListener(event, () => { this.#rows.get(name).touched = touched; });
    free.hidden = true;
    this.#rows.set(name, { row, input, output, free, value: NaN, touched: false, until: 0 });
    return row;
  }

  move(name, value) {
    for (const each of this.#both(name)) {
      this.robot.set(each, value);
      const row = this.#rows.get(each);
      row.until = performance.now() + 400;
      row.value = NaN;  // what comes then is shown, also where it is what was shown before
      row.input.value = value;
      row.output.textContent = value.toFixed(2);
    }
  }

  release(name) { this.robot.act({ type: "release", parameters: this.#both(name) }); }

  #both(name) {
    const pair = other(name);
    const isAngle = /Yaw|Pitch|Roll/.test(name);
    return $("mirror").checked && pair !== name && !isAngle && this.#rows.has(pair) ? [name, pair] : [name];
  }

  show(names, values) {
    const now = performance.now();
    names.forEach((name, i) => {
      const row = this.#rows.get(name);
      if (!row || row.touched || now < row.until || row.value === values[i]) return;
      row.value = values[i];
      row.input.value = values[i];
      row.output.textContent = values[i].toFixed(2);
    });
  }

  // Which ones are held, by whichever client.
  hold(held, holders) {
    for (const [name, { row, free }] of this.#rows) {
      row.classList.toggle("held", name in held);
      row.title = name in held ? "held by hand, or by a command" : holders[name] ? `moved by ${holders[name]}` : "";
      free.hidden = !(name in held);
    }
  }

  search(text) {
    const wanted = text.toLowerCase().split(/\s+/).filter(Boolean);
    for (const [name, { row }] of this.#rows) {
      const label = `${words(name)} ${name.toLowerCase()}`;
      row.hidden = !wanted.every((word) => label.includes(word));
    }
    for (const box of $("regions").children) {
      box.hidden = [...box.querySelectorAll(".row")].every((row) => row.hidden);
      if (wanted.length && !box.hidden) box.open = true;
    }
  }
}

function grouped(parameters) {
  const found = new Map();
  for (const entry of Object.entries(parameters)) {
    const region = entry[1].region;
    found.set(region, [...(found.get(region) ?? []), entry]);
  }
  return found;
}
