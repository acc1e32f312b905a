// Hair, hats, glasses: triangles that turn with the head.
uniform mat4 view_projection;

const float BEFORE_MM = 0.8;

in vec3 position;
in vec3 normal;
in vec2 uv;
in float shade;                 // how open to light it lies

out vec2 v_uv;
out float v_shade;
#ifdef PER_VERTEX
out vec3 v_light;
out vec3 v_shine;
#else
out vec3 v_normal;
out vec3 v_view;
#endif

void main() {
    vec3 at = position;
    vec3 n = normal;
    if (angle != 0.0) {
        at = pivot + turned(position - pivot);
        n = turned(normal);
    }
    gl_Position = view_projection * vec4(at, 1.0);
    // Compared as if it stood nearer: a fitted scalp is a little off its mesh, and must not come through tight hair.
    vec3 away = vec3(view_projection[0][3], view_projection[1][3], view_projection[2][3]);
    vec4 nearer = gl_Position - BEFORE_MM * (view_projection * vec4(away, 0.0));
    gl_Position.z = nearer.z / nearer.w * gl_Position.w;
    v_uv = uv;
    v_shade = shade;
#ifdef PER_VERTEX
    vec3 v = normalize(camera - at);
    n = soft < 0.5 && dot(n, v) < -0.35 ? -n : n;  // the inside; at the outline normals of the outside face away, too
    v_light = lit(n, v);
    v_shine = shine(n, v);
#else
    v_normal = n;
    v_view = camera - at;
#endif
}
