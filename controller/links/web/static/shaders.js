// How the face answers light, as omote draws it (surface/view/draw/shaders): soft light is worked out per vertex, pixels
// add highlights, so that a small computer without a graphics processor can draw it, too.
import * as THREE from "/three.min.js";

const direction = (yaw, pitch) => {
  const [a, b] = [yaw, pitch].map((degrees) => degrees * Math.PI / 180);
  return new THREE.Vector3(Math.sin(a) * Math.cos(b), Math.sin(b), Math.cos(a) * Math.cos(b));
};
const vec = (...xyz) => ({ value: new THREE.Vector3(...xyz) });

// Shared by all materials; turn and pivot are those of the head.
export const shared = {
  key_direction: { value: direction(-34, 32) }, fill_direction: { value: direction(48, 6) }, rim_direction: { value: direction(152, 28) },
  key_colour: vec(1.18, 1.06, 0.92), fill_colour: vec(0.16, 0.18, 0.215), rim_colour: vec(0.80, 0.84, 0.94),
  sky: vec(0.20, 0.21, 0.235), ground: vec(0.115, 0.085, 0.072),
  key_at_rest: { value: direction(-34, 32) }, rim_at_rest: { value: direction(152, 28) },
  turn: { value: new THREE.Matrix3() }, pivot: vec(0, 0, 0), middle: vec(0, 0.015, 0), eye_axis: vec(0, 0, 1),
  between_lips: { value: 1 },
  lungs: { value: 0 }, wider: { value: 0 }, iris: { value: [0, 0] },  // the last is each eye's own
};

const LIGHT = `
uniform vec3 key_direction, fill_direction, rim_direction, key_colour, fill_colour, rim_colour, sky, ground;
vec3 ambient(vec3 n) { return mix(ground, sky, 0.5 + 0.5 * n.y); }
vec3 wrapped(float cosine, vec3 wrap) {
  vec3 t = clamp((vec3(cosine) + wrap) / (vec3(1.0) + wrap), 0.0, 1.0);
  return t * mix(t, vec3(1.0), 0.45);
}
float lobe(float cosine, float sharpness) { return exp2(1.4427 * sharpness * (cosine - 1.0)); }
vec3 decoded(vec3 c) { return c * (c * (c * 0.305306011 + 0.682171111) + 0.012522878); }
vec3 encode(vec3 linear) {
  vec3 x = max(vec3(0.0), linear - 0.004);
  return (x * (6.2 * x + 0.5)) / (x * (6.2 * x + 1.7) + 0.06);
}`;

const PLACE = `
attribute float share;
uniform mat3 turn; uniform vec3 pivot;
#ifdef BREATHES
attribute vec3 breath, breath_normal;
uniform float lungs;
#endif
vec3 world, n, v;
void place() {
  vec3 p = position;
  n = normal;
  #ifdef BREATHES
  p += lungs * breath;
  n += lungs * breath_normal;
  #endif
  #ifdef BENDS
  p = mix(p, turn * (p - pivot) + pivot, share);
  n = mix(n, turn * n, share);
  #endif
  world = (modelMatrix * vec4(p, 1.0)).xyz;
  n = normalize(mat3(modelMatrix) * n);
  v = normalize(cameraPosition - world);
  gl_Position = projectionMatrix * viewMatrix * vec4(world, 1.0);
}`;

const SKIN = [`
attribute vec4 color, _visible, _skin;
uniform vec3 key_at_rest, rim_at_rest;
varying vec3 v_diffuse; varying vec4 v_normal_wide, v_half_narrow; varying vec2 v_map;
float reaching(vec3 light) { return smoothstep(0.05, 0.95, dot(_visible - 0.5, vec4(4.0, 4.0 * light))); }
float grazing() { float e = 1.0 - clamp(dot(n, v), 0.0, 1.0); e *= e; return e * e; }
void main() {
  place();
  vec3 wrap = vec3(0.42, 0.20, 0.14), through = vec3(0.52, 0.085, 0.035);
  float occlusion = color.a, sun = reaching(key_at_rest), back = reaching(rim_at_rest), rim = dot(n, rim_direction);
  vec3 albedo = color.rgb / sqrt(max(occlusion, 0.02));
  vec3 open = occlusion + (1.0 - occlusion) * (occlusion * vec3(0.60, 0.15, 0.05) + vec3(0.10, 0.035, 0.025));
  vec3 lit = sun * mix(vec3(1.0), vec3(sun), 0.5 * (1.0 - wrap));
  vec3 light = key_colour * wrapped(dot(n, key_direction), wrap) * (0.12 + 0.88 * lit);
  light += fill_colour * wrapped(dot(n, fill_direction), wrap) * open;
  light += rim_colour * wrapped(rim, wrap) * back;
  light += ambient(n) * open;
  vec3 glow = key_colour * clamp(0.10 - dot(n, key_direction), 0.0, 1.0) + rim_colour * clamp(0.10 - rim, 0.0, 1.0);
  light += _skin.y * occlusion * occlusion * through * glow;
  vec3 sheen = 0.16 * ambient(n) + 0.12 * rim_colour * back * clamp(rim + 0.4, 0.0, 1.0);
  v_diffuse = albedo * light * mix(vec3(1.0), open, 0.35) + grazing() * occlusion * sheen;
  float strength = (1.0 + 5.0 * grazing()) * clamp(4.0 * dot(n, key_direction), 0.0, 1.0) * occlusion * sun;
  v_normal_wide = vec4(n, 0.050 * strength);
  v_half_narrow = vec4(normalize(key_direction + v), 0.24 * _skin.x * strength);
  v_map = uv;
}`, `
uniform sampler2D map;
varying vec3 v_diffuse; varying vec4 v_normal_wide, v_half_narrow; varying vec2 v_map;
void main() {
  float wide = lobe(dot(normalize(v_normal_wide.xyz), v_half_narrow.xyz), 9.0), narrow = wide * wide;
  narrow *= narrow;
  vec3 diffuse = v_diffuse;
  #ifdef MAPPED
  diffuse *= decoded(texture2D(map, v_map).rgb);
  #endif
  vec3 lit = encode(diffuse + key_colour * (wide * v_normal_wide.w + narrow * v_half_narrow.w));
  gl_FragColor = vec4(gl_FrontFacing ? lit : 0.25 * lit, 1.0);
}`];

const STRAND = [`
attribute vec4 color;
uniform vec3 middle;
varying vec3 v_colour; varying vec3 v_strand;
void main() {
  place();
  float edge = 1.0 - clamp(dot(n, v), 0.0, 1.0), up = clamp(dot(n, normalize(key_direction + v)), 0.0, 1.0);
  vec3 light = key_colour * clamp(0.62 * dot(n, key_direction) + 0.38, 0.0, 1.0) * 0.85;
  light += fill_colour * clamp(0.6 * dot(n, fill_direction) + 0.4, 0.0, 1.0);
  light += rim_colour * clamp(0.55 * dot(n, rim_direction) + 0.45, 0.0, 1.0) * (0.45 + 0.8 * edge * edge);
  float ring = exp2(-18.0 * (up - 0.86) * (up - 0.86) * 8.0) * clamp(1.6 * dot(n, key_direction) + 0.25, 0.0, 1.0);
  v_colour = color.rgb * (light + 1.15 * ambient(n)) + ring * key_colour * (0.55 * sqrt(color.rgb) * (0.05 + color.rgb) + 0.035);
  v_strand = vec3(uv, color.a);
}`, `
uniform sampler2D map;
varying vec3 v_colour; varying vec3 v_strand;
void main() {
  vec4 noise = texture2D(map, v_strand.xy);
  if (noise.a * v_strand.z < 0.3) discard;
  gl_FragColor = vec4(encode(v_colour * (1.6 * noise.g * noise.g)), 1.0);
}`];

const CLOTH = [`
attribute vec4 color;
varying vec3 v_colour;
void main() {
  place();
  if (dot(n, v) < -0.35) n = -n;
  float edge = 1.0 - clamp(dot(n, v), 0.0, 1.0);
  edge *= edge * edge;
  vec3 light = key_colour * clamp(0.85 * dot(n, key_direction) + 0.15, 0.0, 1.0);
  light += fill_colour * clamp(0.8 * dot(n, fill_direction) + 0.2, 0.0, 1.0);
  light += rim_colour * clamp(dot(n, rim_direction), 0.0, 1.0) + ambient(n);
  vec3 sheen = 0.10 * edge * (ambient(n) + rim_colour * clamp(dot(n, rim_direction) + 0.3, 0.0, 1.0));
  v_colour = encode(color.rgb * light + sheen);
}`, `
varying vec3 v_colour;
void main() { gl_FragColor = vec4(v_colour, 1.0); }`];

// Hardly any light enters between closed lips, and nothing white is seen where their triangles do not quite meet.
const INNER = [`
attribute vec4 color;
uniform float between_lips;
varying vec3 v_colour;
void main() {
  place();
  if (dot(n, v) < 0.0) n = -n;
  vec3 wrap = vec3(0.3, 0.18, 0.18);
  vec3 light = key_colour * wrapped(dot(n, key_direction), wrap) + fill_colour * wrapped(dot(n, fill_direction), wrap) + 1.6 * ambient(n);
  float nh = dot(n, normalize(key_direction + v));
  vec3 lit = 0.9 * color.rgb * light + 0.25 * dot(color.rgb, vec3(0.33)) * (lobe(nh, 60.0) + 0.25 * lobe(nh, 12.0)) * key_colour;
  v_colour = encode(lit * mix(0.03, 1.0, between_lips));
}`, CLOTH[1]];

const HAIR = [`
attribute vec4 color;
varying vec3 v_colour; varying vec3 v_along;
void main() {
  place();
  vec4 nearer = projectionMatrix * viewMatrix * vec4(world + 0.0015 * v, 1.0);  // skin that bulges over a root cuts no hair off
  gl_Position.z = nearer.z / nearer.w * gl_Position.w;
  vec3 light = ambient(n) + key_colour * (0.25 + 0.35 * clamp(dot(n, key_direction), 0.0, 1.0));
  v_colour = encode(color.rgb * light);
  v_along = vec3(uv, color.a);
}`, `
uniform sampler2D map;
varying vec3 v_colour; varying vec3 v_along;
void main() { gl_FragColor = vec4(v_colour, texture2D(map, v_along.xy).a * v_along.z); }`];

const EYE = [`
varying vec2 v_uv; varying vec3 v_normal, v_view, v_world;
void main() {
  place();
  v_uv = uv; v_normal = n; v_view = v; v_world = world;
}`, `
uniform sampler2D map; uniform vec3 eye_axis; uniform vec2 iris; uniform float wider;
varying vec2 v_uv; varying vec3 v_normal, v_view, v_world;
// Where the picture has what is seen here: the iris of a pupil that is wider than the picture's is narrower, all of it.
vec2 seen() {
  vec2 away = v_uv - 0.5;
  float r = length(away), pupil = min(iris.y * (1.0 + wider), 0.75 * iris.x);
  float around = (iris.y + (r - pupil) * (iris.x - iris.y) / (iris.x - pupil)) / max(r, 1e-4);
  return 0.5 + away * (r < pupil ? iris.y / pupil : r < iris.x ? around : 1.0);
}
float windows(vec3 mirrored) {
  vec3 side = normalize(cross(vec3(0.0, 1.0, 0.0), key_direction) + vec3(1e-4, 0.0, 0.0));
  vec2 at = abs(vec2(dot(mirrored, side), dot(mirrored, cross(key_direction, side))));
  float pane = 1.0 - smoothstep(0.085, 0.125, abs(at.x - 0.135));
  return pane * (1.0 - smoothstep(0.21, 0.27, at.y));
}
void main() {
  vec3 n = normalize(v_normal), v = normalize(v_view);
  vec3 albedo = pow(texture2D(map, seen()).rgb, vec3(2.2));
  float r = length(v_uv - 0.5) / 0.47;
  vec3 cornea = normalize(n + 0.9 * (n - eye_axis * dot(n, eye_axis)) * (1.0 - smoothstep(0.25, 1.08, r)));
  float shade = 0.35 + 0.65 * smoothstep(0.62, -0.05, n.y - 0.25 * (1.0 - r));
  vec3 light = key_colour * wrapped(dot(n, key_direction), vec3(0.35, 0.25, 0.22)) + fill_colour * wrapped(dot(n, fill_direction), vec3(0.3)) + ambient(n);
  vec3 mirrored = reflect(-v, cornea);
  float towards = dot(mirrored, key_direction);
  float key = 1.1 * windows(mirrored) * step(0.0, towards) + 0.05 * lobe(towards, 30.0);
  float fill = smoothstep(0.965, 0.990, dot(mirrored, fill_direction)) * 0.5;
  float fresnel = 1.0 - clamp(dot(cornea, v), 0.0, 1.0);
  vec3 lit = albedo * light * shade + key * key_colour + fill * fill_colour;
  lit += (0.03 + 0.5 * fresnel * fresnel * fresnel) * ambient(mirrored) * shade;
  gl_FragColor = vec4(encode(lit), 1.0);
}`];

// Hair, hats, glasses as the meshes they are: their own texture; hair is lit softly from all around it.
const ACCESSORY = [`
attribute vec4 color;
varying vec3 v_light, v_colour, v_shine; varying vec3 v_uv;
void main() {
  place();
  vec4 nearer = projectionMatrix * viewMatrix * vec4(world + 0.0008 * v, 1.0);  // a fitted scalp must not come through
  gl_Position.z = nearer.z / nearer.w * gl_Position.w;
  if (soft < 0.5 && dot(n, v) < -0.35) n = -n;
  float spread = mix(0.15, 0.38, soft);
  v_light = key_colour * clamp(mix(dot(n, key_direction), 1.0, spread), 0.0, 1.0);
  v_light += fill_colour * clamp(mix(dot(n, fill_direction), 1.0, spread), 0.0, 1.0);
  v_light += rim_colour * clamp(mix(dot(n, rim_direction), 1.0, 0.5 * spread), 0.0, 1.0) + ambient(n);
  float edge = 1.0 - clamp(abs(dot(n, v)), 0.0, 1.0);
  vec3 mirrored = key_colour * lobe(dot(n, normalize(v + key_direction)), gloss.y);
  mirrored += rim_colour * lobe(dot(n, normalize(v + rim_direction)), gloss.y);
  v_shine = gloss.x * (mirrored + (0.5 + edge * edge * edge) * ambient(n));
  v_colour = color.rgb;
  v_uv = vec3(uv, color.a);
}`, `
uniform float alpha_test; uniform bool blended;
varying vec3 v_light, v_colour, v_shine; varying vec3 v_uv;
void main() {
  vec4 texel = vec4(1.0);
  #ifdef MAPPED
  texel = texture2D(map, v_uv.xy);
  #endif
  float cover = texel.a * v_uv.z;
  if (cover < alpha_test) discard;
  gl_FragColor = vec4(encode(decoded(texel.rgb) * v_colour * v_light + v_shine), blended ? cover : 1.0);
}`];
export const GLOSS = { hair: [0.045, 9], hat: [0.02, 12], glasses: [0.28, 90], jewellery: [0.6, 120] };

const KINDS = { skin: SKIN, strand: STRAND, tress: STRAND, cloth: CLOTH, brow: HAIR, lash: HAIR, eye: EYE, teeth: INNER, gums: INNER, tongue: INNER, mouth: INNER };

// Hair that blends is cut: blended without an order, locks behind would be drawn over those in front.
function accessory(kind, { map, side, alphaTest, transparent: blends }, moving) {
  const transparent = blends && kind !== "hair", cut = blends ? (transparent ? 0.004 : 0.4) : alphaTest;
  const [vertex, fragment] = ACCESSORY, own = "uniform float soft; uniform vec2 gloss; uniform sampler2D map;";
  return new THREE.ShaderMaterial({
    uniforms: { ...shared, map: { value: map }, soft: { value: kind === "hair" ? 1 : 0 }, gloss: { value: GLOSS[kind] },
      alpha_test: { value: cut }, blended: { value: transparent } },
    side, transparent, depthWrite: !transparent, defines: { ...moving, ...(map ? { MAPPED: 1 } : {}) },
    vertexShader: LIGHT + PLACE + own + vertex, fragmentShader: LIGHT + own + fragment,
  });
}

// The material of a kind of part; what the second argument holds is the file's, `bends` says whether the neck moves it,
// `breathes` whether breath does.
export function material(kind, given, { bends, breathes }) {
  const moving = { ...(bends ? { BENDS: 1 } : {}), ...(breathes ? { BREATHES: 1 } : {}) };
  if (GLOSS[kind]) return accessory(kind, given, moving);
  const { map, side } = given;
  const [vertex, fragment] = KINDS[kind] ?? CLOTH;
  const blended = vertex === HAIR[0];
  return new THREE.ShaderMaterial({
    uniforms: { ...shared, map: { value: map } }, side, transparent: blended, depthWrite: !blended,
    defines: { ...moving, ...(map ? { MAPPED: 1 } : {}) },
    vertexShader: LIGHT + PLACE + vertex, fragmentShader: LIGHT + fragment,
  });
}
