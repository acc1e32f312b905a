// Three directional lights, a sky and a ground; shared by every material. All colours linear.
uniform vec3 key_direction;
uniform vec3 fill_direction;
uniform vec3 rim_direction;
uniform vec3 key_colour;
uniform vec3 fill_colour;
uniform vec3 rim_colour;
uniform vec3 sky;
uniform vec3 ground;

vec3 ambient(vec3 normal) {
    return mix(ground, sky, 0.5 + 0.5 * normal.y);
}

// Light that bends round the terminator, per channel: the cheap look of light scattered under the surface.
vec3 wrapped(float cosine, vec3 wrap) {
    vec3 t = clamp((vec3(cosine) + wrap) / (vec3(1.0) + wrap), 0.0, 1.0);
    return t * mix(t, vec3(1.0), 0.45);
}

// Spherical Gaussian highlight: exp(sharpness * (n.h - 1)).
float lobe(float cosine, float sharpness) {
    return exp2(1.4427 * sharpness * (cosine - 1.0));
}

// sRGB to linear light, a cubic instead of a power.
vec3 decoded(vec3 c) {
    return c * (c * (c * 0.305306011 + 0.682171111) + 0.012522878);
}

// Filmic curve with the display's 2.2 gamma folded in (Hejl and Burgess-Dawson): one division, no pow.
vec3 encode(vec3 linear) {
    vec3 x = max(vec3(0.0), linear - 0.004);
    return (x * (6.2 * x + 0.5)) / (x * (6.2 * x + 1.7) + 0.06);
}
