uniform mat4 view_projection;
uniform vec3 camera;
uniform mat3 eye_rotation;            // eye's own frame to world
uniform vec3 lid_upper[LID_POINTS];   // lid margins now, world, mm
uniform vec3 lid_lower[LID_POINTS];
uniform float lids;                   // 1 where the head has lid margins

in vec3 position;
in vec3 local;                        // direction in the eye's own frame, +z = pupil

out vec3 v_local;
out vec3 v_view;
out vec2 v_lid;                       // mm to the upper and the lower lid

float to_segment(vec3 a, vec3 b) {
    vec3 ab = b - a;
    vec3 ap = position - a;
    vec3 off = ap - ab * clamp(dot(ap, ab) / (dot(ab, ab) + 1e-6), 0.0, 1.0);
    return dot(off, off);
}

void main() {
    gl_Position = view_projection * vec4(position, 1.0);
    v_local = local;
    v_view = camera - position;
    vec2 near = vec2(1e4);
    for (int i = 0; i + 1 < LID_POINTS; ++i) {
        near.x = min(near.x, to_segment(lid_upper[i], lid_upper[i + 1]));
        near.y = min(near.y, to_segment(lid_lower[i], lid_lower[i + 1]));
    }
    v_lid = mix(vec2(20.0), sqrt(near), lids);
}
