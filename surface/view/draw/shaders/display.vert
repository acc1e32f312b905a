// What lies in a robot's mouth shows one flat display behind the lips, whatever its own shape is.
#define BEHIND_MM 4.0

uniform mat4 view_projection;
uniform vec3 camera;
uniform vec3 opening_centre;
uniform vec3 opening_side;   // from its centre towards a corner of the mouth
uniform vec3 opening_area;   // vector area of the lips' opening, mm^2

in vec3 position;

out vec2 v_place;

void main() {
    gl_Position = view_projection * vec4(position, 1.0);
    vec3 out_of = normalize(opening_area + vec3(0.0, 0.0, 1e-3));
    vec3 along = normalize(opening_side - out_of * dot(opening_side, out_of));
    vec3 v = normalize(camera - position);
    vec3 off = position - opening_centre + BEHIND_MM * out_of;
    off -= v * (dot(off, out_of) / max(dot(v, out_of), 0.3));   // where the line of sight meets the display
    v_place = vec2(dot(off, along), dot(off, cross(out_of, along)));
}
