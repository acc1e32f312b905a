// A vertex and its normal from its sums, rotated with the head.
out vec3 out_position;
out vec3 out_normal;

void finish(vec3 s, vec3 su, vec3 sv) {
    vec3 n = cross(su, sv);
    out_position = pivot + turned(s - pivot);
    out_normal = turned(n * inversesqrt(dot(n, n) + 1e-30));
}
