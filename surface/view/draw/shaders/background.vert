// Rectangles of the picture, at the far end of depth.
in vec2 corner;

out vec2 v_at;

void main() {
    v_at = corner;
    gl_Position = vec4(corner, 1.0, 1.0);
}
