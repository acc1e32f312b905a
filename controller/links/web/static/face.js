// Draws the face: loads it once, then poses it from numbers.
import * as THREE from "/three.min.js";
import { Part } from "/morph.js";
import { lipsApart, ownAmounts, readPose } from "/pose.js";
import { GLOSS, material, shared } from "/shaders.js";

const EYES = ["eye_left", "eye_right"], HALF = "Half";
const LIT_MM = [0.8, 5];  // how far lips are apart where light begins to enter, and where it does as into an open mouth

// Whether pictures are computed without a graphics processor: smooth edges would cost a third of the time then.
function isSoftware() {
  const gl = document.createElement("canvas").getContext("webgl2"), info = gl?.getExtension("WEBGL_debug_renderer_info");
  const name = info ? gl.getParameter(info.UNMASKED_RENDERER_WEBGL) : "";
  gl?.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|software/i.test(name);
}

export class Face {
  #eyes = []; #parts = []; #worn = []; #values = null; #names = []; #drag = null; #life = [0, 0];

  constructor(canvas) {
    this.canvas = canvas;
    this.renderer = new THREE.WebGLRenderer({ canvas, alpha: true, antialias: !isSoftware(), powerPreference: "high-performance" });
    this.renderer.outputColorSpace = THREE.LinearSRGBColorSpace;  // the shaders encode by themselves
    this.scene = new THREE.Scene();
    this.camera = new THREE.PerspectiveCamera(24, 1, 0.05, 10);
    this.turn = { yaw: 0.12, pitch: 0.03, reach: 1 };
    this.frames = 0;
    this.#follow();
    new ResizeObserver(() => this.#resize()).observe(canvas);
    canvas.addEventListener("webglcontextlost", (event) => event.preventDefault());
    canvas.addEventListener("webglcontextrestored", () => { this.changed = true; });
  }

  // Loads the face; while it is being prepared, asks again each second. `tell` hears of it.
  async load(secret, tell) {
    for (;;) {
      const answer = await fetch("/face.glb", { headers: secret ? { Authorization: `Bearer ${secret}` } : {} }).catch(() => null);
      if (answer?.ok) return this.#take(await answer.arrayBuffer());
      if (answer && answer.status !== 503) throw new Error((await answer.text()).trim());
      tell(answer ? "The face is being prepared" : "Waiting for the robot");
      await new Promise((resolve) => setTimeout(resolve, 1000));
    }
  }

  async #take(buffer) {
    const gltf = await new THREE.GLTFLoader().parseAsync(buffer, "");
    const omote = gltf.userData.omote ?? {}, meshes = [];
    gltf.scene.traverse((node) => { if (node.isMesh) meshes.push(node); });
    this.half = omote.half ?? [];
    this.own = omote.own ?? {};
    this.lips = omote.lips ?? {};
    this.lipsOpen = omote.lips_open ?? true;
    [this.breath, this.breathMm] = Object.entries(omote.breath ?? {})[0] ?? ["", 1];
    this.irises = omote.eyes ?? {};
    this.head = new THREE.Object3D();
    this.head.position.fromArray(omote.neck?.pivot ?? [0, 0, 0]);
    shared.pivot.value.copy(this.head.position);
    this.scene.add(this.head);
    for (const mesh of meshes) this.#add(mesh);
    this.#frame();
    this.changed = true;
    if (this.#values) this.#show(this.#names, this.#values);
  }

  // A part of the file as it is drawn here: positions in metres, shapes by the vertices that they move.
  #add(mesh) {
    const inverse = mesh.skeleton?.boneInverses[0].elements, bends = Boolean(inverse), eye = EYES.indexOf(mesh.name);
    const { map, side, name, alphaTest, transparent } = mesh.material;
    if (map) map.colorSpace = THREE.NoColorSpace;
    const part = new Part(mesh, bends ? inverse[0] : mesh.scale.x, bends ? inverse.slice(12, 15) : [0, 0, 0], this.breath);
    const drawn = new THREE.Mesh(part.geometry, material(name, { map, side, alphaTest, transparent }, { bends, breathes: part.breathes }));
    if (this.irises[mesh.name]) drawn.material.uniforms.iris = { value: this.irises[mesh.name] };
    drawn.frustumCulled = false;
    if (GLOSS[name]) this.#worn.push(part.rest);
    if (bends) this.scene.add(drawn);
    else { drawn.position.copy(mesh.position); this.head.add(drawn); }
    if (eye < 0) { this.#parts.push(part); return; }
    drawn.material.uniforms.eye_axis = { value: new THREE.Vector3(0, 0, 1) };
    this.#eyes[eye] = drawn;
  }

  // The middle of the eyes tells where the face is.
  #frame() {
    const at = new THREE.Vector3(), sum = new THREE.Vector3();
    this.scene.updateMatrixWorld(true);
    for (const eye of this.#eyes) sum.add(eye.getWorldPosition(at));
    const apart = this.#eyes.length > 1 ? this.#eyes[0].getWorldPosition(at).distanceTo(this.#eyes[1].getWorldPosition(new THREE.Vector3())) : 0.063;
    this.target = sum.divideScalar(Math.max(this.#eyes.length, 1));
    const [up, aside] = this.#room(this.target, apart), top = Math.max(1.75 * apart, 1.05 * up);
    const below = (up > 1.75 * apart ? 2.5 : 2.85) * apart;
    this.target.add(new THREE.Vector3(0, (top - below) / 2, -0.9 * apart));
    this.size = Math.min(Math.max(top + below, 2.7 * aside), 7 * apart);
  }

  // How far hair and hats reach, up and to a side of the eyes; what hangs below the lips may hang out of the picture.
  #room(eyes, apart) {
    let up = 0, aside = 0;
    for (const rest of this.#worn) for (let i = 0; i < rest.length; i += 3) {
      if (rest[i + 1] < eyes.y - 1.1 * apart) continue;
      up = Math.max(up, rest[i + 1] - eyes.y);
      aside = Math.max(aside, Math.abs(rest[i] - eyes.x));
    }
    return [up, aside];
  }

  pose(names, values) {
    this.#names = names;
    if (this.#values && values.every((value, i) => value === this.#values[i])) return;
    this.#values = values;
    this.changed = true;
    if (!this.head) return;
    this.#show(names, values);
  }

  // life: mm by which a breath lifts the chest, and the share by which pupils are wider than the light makes them.
  live([rise, pupil]) {
    if (rise === this.#life[0] && pupil === this.#life[1]) return;
    this.#life = [rise, pupil];
    this.changed = true;
    shared.lungs.value = rise / (this.breathMm ?? 1);
    shared.wider.value = pupil;
  }

  #show(names, values) {
    const { weights, eyes, head } = readPose(names, values);
    Object.assign(weights, ownAmounts(names, values, this.own));
    for (const name of this.half) { const w = weights[name.slice(0, -HALF.length)]; weights[name] = 4 * w * (1 - w); }
    for (const part of this.#parts) part.show(weights);
    const lit = (lipsApart(weights, this.lips) - LIT_MM[0]) / (LIT_MM[1] - LIT_MM[0]);
    shared.between_lips.value = this.lipsOpen ? 1 : Math.min(Math.max(lit, 0), 1);
    this.head.rotation.set(head[1], head[0], head[2], "YXZ");
    eyes.forEach(([yaw, pitch], i) => this.#eyes[i]?.rotation.set(pitch, yaw, 0, "YXZ"));
    this.head.updateMatrixWorld(true);
    for (const eye of this.#eyes) eye?.material.uniforms.eye_axis.value.set(0, 0, 1).transformDirection(eye.matrixWorld);
    shared.turn.value.setFromMatrix4(this.head.matrixWorld);
    const back = this.head.quaternion.clone().invert();
    for (const light of ["key", "rim"]) shared[`${light}_at_rest`].value.copy(shared[`${light}_direction`].value).applyQuaternion(back);
  }

  #resize() {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    if (!width || !height) return;
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.changed = true;
  }

  #follow() {
    const canvas = this.canvas;
    canvas.addEventListener("pointerdown", (event) => { this.#drag = [event.clientX, event.clientY]; canvas.setPointerCapture(event.pointerId); });
    canvas.addEventListener("pointermove", (event) => {
      if (!this.#drag) return;
      this.turn.yaw = Math.min(Math.max(this.turn.yaw - (event.clientX - this.#drag[0]) * 0.008, -1.4), 1.4);
      if (event.pointerType === "mouse") this.turn.pitch = Math.min(Math.max(this.turn.pitch + (event.clientY - this.#drag[1]) * 0.008, -0.5), 0.5);
      this.#drag = [event.clientX, event.clientY];
      this.changed = true;
    });
    for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, () => { this.#drag = null; });
    canvas.addEventListener("wheel", (event) => { event.preventDefault(); this.turn.reach = Math.min(Math.max(this.turn.reach * Math.exp(event.deltaY * 0.001), 0.5), 2); this.changed = true; }, { passive: false });
    canvas.addEventListener("dblclick", () => { Object.assign(this.turn, { yaw: 0.12, pitch: 0.03, reach: 1 }); this.changed = true; });
  }

  // Draws where something has changed.
  draw() {
    if (!this.changed || !this.head) return;
    this.changed = false;
    const { yaw, pitch, reach } = this.turn;
    const away = reach * this.size / (2 * Math.tan(this.camera.fov * Math.PI / 360)) * Math.max(1, 0.80 / this.camera.aspect);
    this.camera.position.set(Math.sin(yaw) * Math.cos(pitch), Math.sin(pitch), Math.cos(yaw) * Math.cos(pitch)).multiplyScalar(away).add(this.target);
    this.camera.lookAt(this.target);
    this.renderer.render(this.scene, this.camera);
    this.frames += 1;
  }
}
