// A robot's mouth: rows of small lamps behind the lips, brightest half way between them.
#define PITCH_MM 2.3

uniform vec3 lamps;

in vec2 v_place;    // mm, along and across the mouth

out vec4 colour;

void main() {
    vec2 at = v_place / PITCH_MM;
    float lamp = 1.0 - smoothstep(0.30, 0.47, length(fract(at) - 0.5));
    lamp = mix(lamp, 0.38, smoothstep(0.25, 0.6, max(fwidth(at.x), fwidth(at.y))));
    float level = 0.25 + 0.75 * exp2(-0.010 * v_place.y * v_place.y);
    colour = vec4(encode(lamps * (level * lamp + 0.012)), 1.0);
}
