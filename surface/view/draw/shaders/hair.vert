// Lashes and brows: strips whose u runs along them and v from root to tip.
uniform mat4 view_projection;
uniform vec3 albedo;
uniform vec3 lamps;  // light of its own

const float BEFORE_MM = 1.5;

in vec3 position;
in vec3 normal;
in vec3 along;      // along, across, how strong

out vec3 v_colour;
out vec2 v_along;
out float v_strength;

void main() {
    gl_Position = view_projection * vec4(position, 1.0);
    // Compared as if it stood nearer: skin that bulges over a root, as where lids are shut, does not cut hairs off.
    vec3 away = vec3(view_projection[0][3], view_projection[1][3], view_projection[2][3]);
    vec4 nearer = gl_Position - BEFORE_MM * (view_projection * vec4(away, 0.0));
    gl_Position.z = nearer.z / nearer.w * gl_Position.w;
    vec3 light = ambient(normal) + key_colour * (0.25 + 0.35 * clamp(dot(normal, key_direction), 0.0, 1.0));
    v_colour = encode(albedo * light + lamps);
    v_along = along.xy;
    v_strength = along.z;
}
