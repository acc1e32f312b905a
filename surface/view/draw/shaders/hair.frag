// Hairs thin out towards the tips and, on a brow, towards the strip's ends.
uniform sampler2D detail;
uniform float edges;    // 1 where the strip's long sides fade too
uniform vec4 fade;      // cover at the root, cover at the tip, share of the length over which each end fades, strands

in vec3 v_colour;
in vec2 v_along;
in float v_strength;

out vec4 colour;

void main() {
    float ends = clamp(min(v_along.x, 1.0 - v_along.x) / max(fade.z, 1e-3), 0.0, 1.0);
    float strand = texture(detail, vec2(v_along.x * 2.3 - 0.16 * v_along.y, 0.06 * v_along.y)).x - 0.5;
    float cover = mix(fade.x, fade.y, v_along.y * v_along.y) * ends + fade.w * strand * ends;
    // Brows have no edge: hairs grow in sparsely from below and run out above.
    cover *= mix(1.0, smoothstep(0.0, 0.34, v_along.y) * (1.0 - 0.7 * smoothstep(0.60, 1.0, v_along.y)), edges);
    colour = vec4(v_colour, clamp(cover, 0.0, 1.0) * v_strength);
}
