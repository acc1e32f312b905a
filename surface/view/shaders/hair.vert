// Lashes and brows: strips whose u runs along them and v from root to tip.
uniform mat4 view_projection;
uniform vec3 albedo;

in vec3 position;
in vec3 normal;
in vec3 along;      // along, across, how strong

out vec3 v_colour;
out vec2 v_along;
out float v_strength;

void main() {
    gl_Position = view_projection * vec4(position, 1.0);
    vec3 light = ambient(normal) + key_colour * (0.25 + 0.35 * clamp(dot(normal, key_direction), 0.0, 1.0));
    v_colour = encode(albedo * light);
    v_along = along.xy;
    v_strength = along.z;
}
