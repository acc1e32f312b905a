// How strands of hair answer the lights, after Kajiya and Kay, "Rendering fur with three dimensional textures" (1989),
// with the two highlights of Marschner et al., "Light scattering from human hair fibers" (2003): one of the surface,
// shifted towards the root, and one of light that went through the fibre, coloured and shifted towards the tip.
#define SURFACE vec2(0.075, 16.0)     // shift, 1 / width, of the sine of the angle half way
#define THROUGH vec2(-0.13, 4.6)

vec3 strand_diffuse(vec3 n, vec3 t, vec3 v, float open) {
    float along = dot(t, key_direction);
    float round_it = sqrt(max(0.0, 1.0 - along * along));
    float facing = clamp(0.62 * dot(n, key_direction) + 0.38, 0.0, 1.0);
    float edge = 1.0 - clamp(dot(n, v), 0.0, 1.0);
    vec3 light = key_colour * facing * (0.35 + 0.65 * round_it) * open;
    light += fill_colour * clamp(0.6 * dot(n, fill_direction) + 0.4, 0.0, 1.0);
    light += rim_colour * clamp(0.55 * dot(n, rim_direction) + 0.45, 0.0, 1.0) * (0.45 + 0.8 * edge * edge);
    return (light + 1.15 * ambient(n)) * open;
}

float shine(float sine, vec2 shift_and_width) {
    float x = (sine - shift_and_width.x) * shift_and_width.y;
    return exp2(-x * x);
}
