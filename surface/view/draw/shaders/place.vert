// Eq. (1) on the graphics processor: a vertex and its normal from the control points that reach it.
uniform sampler2D points;       // control points, mm
uniform sampler2D weights;      // factors for position, derivative in u and in v; number of the point
uniform vec3 axis;              // the head's rotation
uniform float angle;
uniform vec3 pivot;

in int first;                   // of the vertex' entries in `weights`
in int count;
in float share;                 // of the head's rotation

out vec3 out_position;
out vec3 out_normal;

vec3 turned(vec3 p) {
    float c = cos(share * angle);
    return c * p + sin(share * angle) * cross(axis, p) + (1.0 - c) * dot(axis, p) * axis;
}

void main() {
    vec3 s = vec3(0.0);
    vec3 su = vec3(0.0);
    vec3 sv = vec3(0.0);
    for (int i = first; i < first + count; ++i) {
        vec4 w = texelFetch(weights, ivec2(i % WIDTH, i / WIDTH), 0);
        int k = int(w.w + 0.5);
        vec3 p = texelFetch(points, ivec2(k % WIDTH, k / WIDTH), 0).xyz;
        s += w.x * p;
        su += w.y * p;
        sv += w.z * p;
    }
    vec3 n = cross(su, sv);
    out_position = pivot + turned(s - pivot);
    out_normal = turned(n * inversesqrt(dot(n, n) + 1e-30));
}
