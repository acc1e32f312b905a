// Draws the face: loads it once, then poses it from numbers.
import * as THREE from "/three.min.js";
import { readPose } from "/pose.js";

const EYES = ["eye_left", "eye_right"], HALF = "Half";

// Light bends round the terminator, red the furthest, and the rest of the head shades skin as it was baked at rest.
const SKIN = {
  vertex: ["#include <common>", `#include <common>
    attribute vec4 _visible; attribute vec4 _skin; uniform vec3 keyAtRest; varying vec3 vSkin;`,
  "#include <begin_vertex>", `#include <begin_vertex>
    vSkin = vec3(smoothstep(0.05, 0.95, dot(_visible - 0.5, vec4(4.0, 4.0 * keyAtRest))), _skin.xy);`],
  fragment: ["#include <common>", "#include <common>\n varying vec3 vSkin;",
    "#include <lights_fragment_begin>", `#include <lights_fragment_begin>
    {
      vec3 key = directionalLights[0].direction;
      vec3 t = clamp((vec3(dot(geometryNormal, key)) + SKIN_WRAP) / (vec3(1.0) + SKIN_WRAP), 0.0, 1.0);
      vec3 bent = t * mix(t, vec3(1.0), 0.45) * (0.12 + 0.88 * mix(vec3(1.0), vec3(vSkin.x), 0.5 * (2.0 - SKIN_WRAP)));
      float hard = clamp(dot(geometryNormal, key), 0.0, 1.0);
      reflectedLight.directDiffuse += directionalLights[0].color * (bent - hard) * BRDF_Lambert(material.diffuseColor);
      reflectedLight.directSpecular *= vSkin.x * (0.35 + 1.3 * vSkin.y);
      reflectedLight.directDiffuse += vSkin.z * vec3(0.16, 0.026, 0.011) * clamp(0.1 - dot(geometryNormal, key), 0.0, 1.0);
    }`],
};

export class Face {
  #eyes = []; #meshes = []; #values = null; #names = []; #drag = null;

  constructor(canvas) {
    this.canvas = canvas;
    this.renderer = new THREE.WebGLRenderer({ canvas, alpha: true, antialias: true, powerPreference: "high-performance" });
    this.renderer.toneMapping = THREE.ACESFilmicToneMapping;
    this.renderer.toneMappingExposure = 1.18;
    this.scene = new THREE.Scene();
    this.camera = new THREE.PerspectiveCamera(24, 1, 0.05, 10);
    this.turn = { yaw: 0.12, pitch: 0.03, reach: 1 };
    this.frames = 0;
    this.#light();
    this.#follow();
    new ResizeObserver(() => this.#resize()).observe(canvas);
    canvas.addEventListener("webglcontextlost", (event) => event.preventDefault());
    canvas.addEventListener("webglcontextrestored", () => { this.changed = true; });
  }

  #light() {
    const add = (yaw, pitch, colour, strength) => {
      const light = new THREE.DirectionalLight(new THREE.Color(...colour), strength);
      const [a, b] = [yaw, pitch].map((degrees) => degrees * Math.PI / 180);
      light.position.set(Math.sin(a) * Math.cos(b), Math.sin(b), Math.cos(a) * Math.cos(b));
      this.scene.add(light);
      return light;
    };
    this.key = add(-34, 32, [1, 0.90, 0.78], 3.3);
    add(48, 6, [0.74, 0.84, 1], 0.75);
    add(152, 28, [0.85, 0.9, 1], 1.5);
    this.scene.add(new THREE.HemisphereLight(new THREE.Color(0.85, 0.9, 1), new THREE.Color(0.5, 0.37, 0.31), 0.95));
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
    this.half = gltf.userData.omote?.half ?? [];
    this.head = gltf.scene.getObjectByName("head");
    gltf.scene.traverse((node) => { if (node.isMesh) this.#mesh(node); });
    this.scene.add(gltf.scene);
    this.#frame();
    this.changed = true;
    if (this.#values) this.pose(this.#names, this.#values);
  }

  #mesh(mesh) {
    mesh.frustumCulled = false;
    const kind = mesh.material.name;
    if (mesh.geometry.attributes._visible) this.#asSkin(mesh.material);
    if (kind === "lash" || kind === "brow") { mesh.material.depthWrite = false; mesh.material.polygonOffset = true; mesh.material.polygonOffsetFactor = -2; mesh.material.polygonOffsetUnits = -8; }
    if (EYES.includes(mesh.name)) this.#eyes[EYES.indexOf(mesh.name)] = mesh;
    else if (mesh.morphTargetDictionary) this.#meshes.push(mesh);
  }

  #asSkin(material) {
    if (material.userData.skin) return;
    material.userData.skin = true;
    material.onBeforeCompile = (shader) => {
      shader.uniforms.keyAtRest = { value: this.key.position.clone().normalize() };
      for (const [part, pairs] of Object.entries(SKIN)) {
        for (let i = 0; i < pairs.length; i += 2) shader[`${part}Shader`] = shader[`${part}Shader`].replace(pairs[i], pairs[i + 1]);
      }
      shader.fragmentShader = `#define SKIN_WRAP vec3(0.42, 0.20, 0.14)\n${shader.fragmentShader}`;
    };
  }

  // The middle of the eyes tells where the face is.
  #frame() {
    const at = new THREE.Vector3(), sum = new THREE.Vector3();
    this.scene.updateMatrixWorld(true);
    for (const eye of this.#eyes) sum.add(eye.getWorldPosition(at));
    const apart = this.#eyes.length > 1 ? this.#eyes[0].getWorldPosition(at).distanceTo(this.#eyes[1].getWorldPosition(new THREE.Vector3())) : 0.063;
    this.target = sum.divideScalar(Math.max(this.#eyes.length, 1)).add(new THREE.Vector3(0, -0.55 * apart, -0.9 * apart));
    this.size = apart * 4.6;
  }

  pose(names, values) {
    this.#names = names;
    if (this.#values && values.every((value, i) => value === this.#values[i])) return;
    this.#values = values;
    this.changed = true;
    if (!this.head) return;
    const { weights, eyes, head } = readPose(names, values);
    for (const name of this.half) { const w = weights[name.slice(0, -HALF.length)]; weights[name] = 4 * w * (1 - w); }
    for (const mesh of this.#meshes) {
      for (const [name, i] of Object.entries(mesh.morphTargetDictionary)) mesh.morphTargetInfluences[i] = weights[name] ?? 0;
    }
    eyes.forEach(([yaw, pitch], i) => this.#eyes[i]?.rotation.set(pitch, yaw, 0, "YXZ"));
    this.head.rotation.set(head[1], head[0], head[2], "YXZ");
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
