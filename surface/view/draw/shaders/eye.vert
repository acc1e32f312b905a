uniform mat4 view_projection;
uniform vec3 camera;

in vec3 position;
in vec3 local;                        // direction in the eye's own frame, +z = pupil

out vec3 v_local;
out vec3 v_view;
out vec3 v_position;

void main() {
    gl_Position = view_projection * vec4(position, 1.0);
    v_local = local;
    v_view = camera - position;
    v_position = position;
}
