// A robot's shell whose light was worked out per vertex.
in vec3 v_light;
in vec2 v_uv;
in float v_lamp;

out vec4 colour;

void main() {
    vec3 shown = encode(robot(v_light, v_uv / DETAIL_PER_RADIAN, v_lamp));
    colour = vec4(gl_FrontFacing ? shown : INSIDE * shown, 1.0);
}
