uniform vec3 top;       // sRGB
uniform vec3 bottom;

in vec2 v_at;

out vec4 colour;

void main() {
    float fall = 1.0 - 0.16 * dot(v_at, v_at);
    vec3 shade = mix(bottom, top, 0.5 + 0.5 * v_at.y) * fall;
    // A breath of noise, else the gradient shows its 8-bit steps.
    float noise = fract(52.9829189 * fract(dot(gl_FragCoord.xy, vec2(0.06711056, 0.00583715))));
    colour = vec4(shade + (noise - 0.5) / 255.0, 1.0);
}
