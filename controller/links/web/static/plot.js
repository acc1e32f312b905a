// A scrolling plot of two lines over the last seconds: wanted and measured angle of a servo.
const SAMPLES = 150;

export class Plot {
  #rows = [];

  constructor(canvas, low, high) { Object.assign(this, { canvas, low, high }); }

  add(wanted, measured) {
    this.#rows.push([wanted, measured]);
    if (this.#rows.length > SAMPLES) this.#rows.shift();
  }

  draw() {
    const { canvas } = this, ratio = Math.min(devicePixelRatio, 2);
    const width = canvas.clientWidth, height = canvas.clientHeight;
    if (!width) return;
    if (canvas.width !== Math.round(width * ratio)) [canvas.width, canvas.height] = [width * ratio, height * ratio].map(Math.round);
    const pen = canvas.getContext("2d"), style = getComputedStyle(document.documentElement);
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, width, height);
    for (const [column, colour, thick] of [[0, "--accent", 2.5], [1, "--text", 1.2]]) this.#line(pen, column, style.getPropertyValue(colour), thick, width, height);
  }

  #line(pen, column, colour, thick, width, height) {
    const span = Math.max(this.high - this.low, 1e-6);
    pen.strokeStyle = colour;
    pen.lineWidth = thick;
    pen.beginPath();
    let drawing = false;
    this.#rows.forEach((row, i) => {
      if (row[column] == null) { drawing = false; return; }
      const x = width * (i + SAMPLES - this.#rows.length) / SAMPLES;
      const y = height - 2 - (height - 4) * (row[column] - this.low) / span;
      if (drawing) pen.lineTo(x, y); else pen.moveTo(x, y);
      drawing = true;
    });
    pen.stroke();
  }
}
