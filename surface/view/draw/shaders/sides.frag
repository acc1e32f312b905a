flat in vec4 v_number;

out vec4 colour;

void main() {
    colour = vec4(v_number.rgb, gl_FrontFacing ? 1.0 : 0.0);
}
