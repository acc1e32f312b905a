// A vertex and its normal from its sums, rotated with the head.
uniform vec3 axis;              // the head's rotation
uniform float angle;
uniform vec3 pivot;

in float share;                 // of the head's rotation

out vec3 out_position;
out vec3 out_normal;

vec3 turned(vec3 p) {
    float c = cos(share * angle);
    return c * p + sin(share * angle) * cross(axis, p) + (1.0 - c) * dot(axis, p) * axis;
}

void finish(vec3 s, vec3 su, vec3 sv) {
    vec3 n = cross(su, sv);
    out_position = pivot + turned(s - pivot);
    out_normal = turned(n * inversesqrt(dot(n, n) + 1e-30));
}
