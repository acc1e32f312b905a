// Threads: noise stretched along both of them.
uniform sampler2D detail;

in vec3 v_colour;
in vec2 v_uv;

out vec4 colour;

void main() {
#ifdef GRAIN_TEXELS
    ivec2 at = ivec2(v_uv * GRAIN_TEXELS);
    float thread = texelFetch(detail, at & (int(GRAIN_TEXELS) - 1), 1).x;
#else
    float thread = texture(detail, v_uv).x;
#endif
    colour = vec4(encode(v_colour * (0.80 + 0.40 * thread)), 1.0);
}
