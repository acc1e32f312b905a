// How skin answers the lights, per vertex.
#define WIDE_SHARPNESS 9.0      // the narrow lobe is the wide one to the fourth power
#define WIDE 0.042
#define NARROW 0.17

uniform vec3 wrap;
uniform float gloss_scale;

float grazing(vec3 n, vec3 v) {
    float edge = 1.0 - clamp(dot(n, v), 0.0, 1.0);
    edge *= edge;
    return edge * edge;
}

// Everything but the key light's highlights.
vec3 diffuse(vec3 n, vec3 v, vec3 albedo, float occlusion) {
    // Blood colours what little light leaves a crevice: occlusion bites less in red.
    vec3 open = occlusion + (1.0 - occlusion) * (occlusion * vec3(0.60, 0.15, 0.05) + vec3(0.10, 0.035, 0.025));
    float direct = 0.25 + 0.75 * occlusion;
    float rim = dot(n, rim_direction);
    vec3 light = key_colour * wrapped(dot(n, key_direction), wrap) * direct;
    light += fill_colour * wrapped(dot(n, fill_direction), wrap);
    light += rim_colour * wrapped(rim, wrap) * direct;
    light += ambient(n);
    vec3 sheen = 0.16 * ambient(n) + 0.10 * rim_colour * clamp(rim + 0.4, 0.0, 1.0);
    return albedo * light * open + grazing(n, v) * occlusion * sheen;
}

// Scale of the key light's highlights: none in the shade, more at grazing angles.
float highlight(vec3 n, vec3 v) {
    return gloss_scale * (1.0 + 5.0 * grazing(n, v)) * clamp(4.0 * dot(n, key_direction), 0.0, 1.0);
}
