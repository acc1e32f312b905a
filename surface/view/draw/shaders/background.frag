uniform vec3 top;       // sRGB
uniform vec3 bottom;

in vec2 v_at;

out vec4 colour;

void main() {
    float fall = 1.0 - 0.16 * dot(v_at, v_at);
    // A breath of noise (the plastic number's lattice), else the gradient shows its 8-bit steps.
    float noise = fract(dot(gl_FragCoord.xy, vec2(0.75487767, 0.56984029))) * (1.0 / 255.0);
    colour = vec4(mix(bottom, top, 0.5 + 0.5 * v_at.y) * fall + noise, 1.0);
}
