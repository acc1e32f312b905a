// Numbers of triangles, seen from far away, for those that can be seen at all.
uniform mat4 view_projection;
uniform vec3 nearer;            // towards the viewer

in vec3 position;
in vec4 number;

flat out vec4 v_number;

void main() {
    v_number = number;
    gl_Position = view_projection * vec4(position + nearer, 1.0);
}
