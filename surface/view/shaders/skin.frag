uniform sampler2D detail;
uniform float detail_strength;

in vec3 v_diffuse;
in vec4 v_normal_wide;
in vec4 v_half_narrow;
in vec2 v_uv;

out vec4 colour;

void main() {
    vec4 grain = (texture(detail, v_uv) - 0.5) * detail_strength;
    vec3 n = normalize(v_normal_wide.xyz + grain.xyz);
    float wide = lobe(dot(n, v_half_narrow.xyz), WIDE_SHARPNESS);
    float narrow = wide * wide;
    narrow *= narrow;
    vec3 lit = v_diffuse * (1.0 + grain.w * vec3(0.7, 1.3, 1.5));
    lit += key_colour * (wide * v_normal_wide.w + narrow * v_half_narrow.w);
    colour = vec4(encode(lit), 1.0);
}
