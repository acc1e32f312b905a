// The sums of Eq. (1) and of its derivatives, over the control points that reach a vertex.
uniform sampler2D points;       // control points, mm
uniform sampler2D weights;      // factors for position, derivative in u and in v; number of the point

in int first;                   // of the vertex' entries in `weights`
in int count;

void sum(out vec3 s, out vec3 su, out vec3 sv) {
    s = su = sv = vec3(0.0);
    for (int i = first; i < first + count; ++i) {
        vec4 w = texelFetch(weights, ivec2(i % WIDTH, i / WIDTH), 0);
        int k = int(w.w + 0.5);
        vec3 p = texelFetch(points, ivec2(k % WIDTH, k / WIDTH), 0).xyz;
        s += w.x * p;
        su += w.y * p;
        sv += w.z * p;
    }
}
