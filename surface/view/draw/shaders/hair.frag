// Hairs thin out towards the tips and, on a brow, towards the strip's ends.
#define LEAN vec3(0.04, 0.26, 0.10)  // tiles by which hairs of a brow lean outwards: at its inner end, more at the outer one, and at tips
#define FINER 1.9  // times as many thin hairs, between the strong ones
#define GROUND 0.22  // cover of the down between them
#define HAIR 0.40  // of hairs' heights, over which each fades
uniform sampler2D detail;
uniform float edges;    // 1 where the strip's long sides fade too
uniform vec4 fade;      // cover at the root, cover at the tip, share of the length over which each end fades, opacity of a brow's hairs

in vec3 v_colour;
in vec2 v_along;
in float v_strength;

out vec4 colour;

void main() {
    float ends = clamp(min(v_along.x, 1.0 - v_along.x) / max(fade.z, 1e-3), 0.0, 1.0);
    float cover = mix(fade.x, fade.y, v_along.y * v_along.y) * ends;
    if (edges > 0.5) {
        // Brows have no edge: hairs grow in sparsely from below and run out above. They rise at the inner end, where
        // they are few, and lie the flatter, the further out they grow.
        float across = 2.3 * v_along.x - (LEAN.x + LEAN.y * v_along.x + LEAN.z * v_along.y) * v_along.y;
        float hair = texture(detail, vec2(across, 0.06 * v_along.y)).x + 0.6 * texture(detail, vec2(0.37 * across, 0.3)).w - 0.30;
        float rows = smoothstep(0.0, 0.40, v_along.y) * (1.0 - 0.85 * smoothstep(0.52, 1.0, v_along.y));
        float full = cover * rows + 0.12 * min(1.0, 2.5 * ends) * rows;
        float fine = texture(detail, vec2(FINER * across, 0.06 * v_along.y + 0.5)).x + 0.15;
        float grown = max(smoothstep(-HAIR, HAIR, full + hair - 0.94), 0.75 * smoothstep(-HAIR, HAIR, full + fine - 0.94));
        cover = fade.w * max(grown, GROUND * rows * ends) * min(1.0, 3.0 * ends);
    }
    colour = vec4(v_colour, clamp(cover, 0.0, 1.0) * v_strength);
}
