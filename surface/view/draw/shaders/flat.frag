// The colour was worked out per vertex.
in vec3 v_colour;
out vec4 colour;

void main() {
#ifdef INSIDE
    colour = vec4(gl_FrontFacing ? v_colour : INSIDE * v_colour, 1.0);
#else
    colour = vec4(v_colour, 1.0);
#endif
}
