// The panel: joins what the robot says with what is shown, and what is touched with what the robot is asked.
import { $, make, percent, Sliders, tabs, words } from "/controls.js";
import { Face } from "/face.js";
import { Pad } from "/pads.js";
import { Robot, token } from "/robot.js";
import { Links, Servos } from "/servos.js";

const GAZE_DEG = [35, 25];
const secret = token();
const robot = new Robot(secret), sliders = new Sliders(robot), servos = new Servos(), links = new Links();
let latest = null, noteTimer = 0, shown = "", face = null;

tabs({ express: "Express", sliders: "Sliders", shows: "Shows", servos: "Servos", links: "Links" }, (name) => { if (name === "servos") servos.draw(); });

function note(text, seconds = 4) {
  $("note").textContent = text;
  clearTimeout(noteTimer);
  if (text && seconds) noteTimer = setTimeout(() => { $("note").textContent = ""; }, 1000 * seconds);
}

function stopped(by) {
  document.body.classList.toggle("stopped", Boolean(by));
  $("start").hidden = !by;
  const text = by ? `Servos are off: stopped by ${by}` : "";
  if ($("stopped").textContent !== text) $("stopped").textContent = text;
}

function stop() {
  if (!robot.stop()) note("Not connected: the robot is stopped as soon as it is heard", 10);
}

$("stop").addEventListener("pointerdown", stop);  // pressing is enough, as with the button of a machine
$("stop").addEventListener("click", stop);  // keys and screen readers
$("start").addEventListener("click", () => { robot.stopping = false; robot.act({ type: "start" }); });
$("neutral").addEventListener("click", () => { mood.place(0, 0); robot.act({ type: "neutral" }); });
$("release").addEventListener("click", () => robot.act({ type: "release" }));
$("head").addEventListener("change", () => robot.turnTo($("head").value));
$("search").addEventListener("input", () => sliders.search($("search").value));
$("gaze-off").addEventListener("click", () => robot.act({ type: "gaze_off" }));
$("intensity").addEventListener("input", () => { $("intensity-value").textContent = percent($("intensity").value); if (shown) express(shown); });
$("life").addEventListener("input", () => { $("life-value").textContent = percent($("life").value); robot.act({ type: "life", amount: Number($("life").value) }); });
for (const action of ["play", "pause", "stop"]) $(`show-${action}`).addEventListener("click", () => robot.act({ type: "show", action }));
addEventListener("keydown", (event) => { if (event.key === "Escape") stop(); });

const mood = new Pad($("mood"), { name: "Mood: valence across, arousal up", ends: ["aroused", "calm", "sad", "glad"], act: (valence, arousal) => robot.act({ type: "emotion", valence, arousal, intensity: Number($("intensity").value) }) });
// The picture shows the face from the front: its own left is on the right.
const gaze = new Pad($("gaze"), { name: "Gaze: across and up", ends: ["up", "down", "", ""], act: (x, y) => robot.act({ type: "gaze", yaw_deg: x * GAZE_DEG[0], pitch_deg: y * GAZE_DEG[1] }) });

function express(name) { robot.act({ type: "expression", name, intensity: Number($("intensity").value) }); }

function pressed(name) {
  shown = name;
  for (const button of $("expressions").children) button.setAttribute("aria-pressed", button.dataset.name === name);
}

robot.on("hello", async (welcome) => {
  const heads = welcome.heads ?? [];
  $("heads").hidden = heads.length < 2;
  $("head").replaceChildren(...heads.map((name) => make("option", { value: name, text: name })));
  $("head").value = robot.head || heads[0] || "";
  sliders.build(welcome.parameters);
  sliders.search($("search").value);
  $("expressions").replaceChildren(...welcome.expressions.map((name) => make("button", { type: "button", "data-name": name, "aria-pressed": "false", text: words(name), onclick: () => { pressed(name); express(name); } })));
  const { names } = await robot.ask({ type: "list", what: "shows" });
  $("show-list").replaceChildren(...names.map((name) => make("button", { type: "button", text: words(name), onclick: () => robot.act({ type: "show", name }) })));
});
robot.on("frame", (frame) => { latest = frame; stopped(frame.stopped_by); });
robot.on("overview", (overview) => {
  const { status } = overview;
  sliders.hold(overview.held, overview.holders);
  servos.show(overview.servos, !$("servos").hidden);
  links.show(overview.links, overview.time_s, !$("links").hidden);
  $("show-now").textContent = overview.show === "off" ? "No show plays." : `Show: ${overview.show}`;
  pressed(status.expression);
  if (document.activeElement !== $("life")) { $("life").value = status.life; $("life-value").textContent = percent(status.life); }
  if (document.activeElement !== gaze.element) { const [yaw, pitch] = status.gaze === "off" ? [0, 0] : status.gaze.split(",").map(Number); gaze.place(yaw / GAZE_DEG[0], pitch / GAZE_DEG[1]); }
  if (!$("links").hidden) $("status-list").replaceChildren(...Object.entries(status).flatMap(([key, value]) => [make("dt", { text: key }), make("dd", { text: String(value) })]));
});
robot.on("link", ({ good }) => {
  document.body.classList.toggle("lost", !good);
  $("link").dataset.state = good ? "good" : "lost";
  $("link").textContent = good ? "connected" : "robot not heard, trying again";
});
robot.on("refused", (error) => note(error.message));
robot.on("error", (error) => note(error.message));

function tick() {
  requestAnimationFrame(tick);
  if (latest) {
    face?.pose(robot.names, latest.values);
    face?.live(latest.life ?? [0, 0]);
    if (!$("sliders").hidden) sliders.show(robot.names, latest.values);
  }
  face?.draw();
}

try {
  face = new Face($("face"));
  globalThis.omote = { face, robot };
  tick();
  note("Loading the face", 0);
  await face.load(secret, (text) => note(text, 0));
  note("");
} catch (error) {
  note(`The face cannot be drawn here: ${error.message}`, 0);
  if (!face) tick();
}
