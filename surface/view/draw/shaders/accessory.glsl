// How accessories answer the lights: hard things as plain matter, hair softly from all around it.
uniform vec3 camera;
uniform float soft;             // 1 of hair, 0 of hard things
uniform vec2 gloss;             // how strong its highlight is, and how sharp

vec3 lit(vec3 n, vec3 v) {
    float spread = mix(0.15, 0.38, soft);
    vec3 light = key_colour * clamp(mix(dot(n, key_direction), 1.0, spread), 0.0, 1.0);
    light += fill_colour * clamp(mix(dot(n, fill_direction), 1.0, spread), 0.0, 1.0);
    light += rim_colour * clamp(mix(dot(n, rim_direction), 1.0, 0.5 * spread), 0.0, 1.0);
    return light + ambient(n);
}

// Highlights of key and rim, and the sky as matter mirrors it: what is black is seen by these alone.
vec3 shine(vec3 n, vec3 v) {
    vec3 mirrored = key_colour * lobe(dot(n, normalize(v + key_direction)), gloss.y);
    mirrored += rim_colour * lobe(dot(n, normalize(v + rim_direction)), gloss.y);
    float edge = 1.0 - clamp(abs(dot(n, v)), 0.0, 1.0);
    return gloss.x * (mirrored + (0.5 + edge * edge * edge) * ambient(n));
}
