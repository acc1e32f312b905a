// Cloth: soft light and a sheen at grazing angles, per vertex.
uniform mat4 view_projection;
uniform vec3 camera;

in vec3 position;
in vec3 normal;
in vec4 albedo_gloss;         // square root of the linear albedo, gloss
in vec4 strands;              // texture coordinates across and along, unused, how open it lies

out vec3 v_colour;
out vec2 v_uv;

void main() {
    gl_Position = view_projection * vec4(position, 1.0);
    vec3 v = normalize(camera - position);
    float facing = dot(normal, v);
    vec3 n = facing < -0.35 ? -normal : normal;  // the inside; at the outline normals of the outside face away, too
    vec3 albedo = albedo_gloss.rgb * albedo_gloss.rgb;
    float open = strands.w * (1.0 - 0.7 * smoothstep(-0.05, 0.12, -facing));  // little light gets inside
    float edge = 1.0 - clamp(dot(n, v), 0.0, 1.0);
    edge *= edge * edge;
    vec3 light = key_colour * clamp(0.85 * dot(n, key_direction) + 0.15, 0.0, 1.0);
    light += fill_colour * clamp(0.8 * dot(n, fill_direction) + 0.2, 0.0, 1.0);
    light += rim_colour * clamp(dot(n, rim_direction), 0.0, 1.0);
    light += ambient(n);
    vec3 sheen = 0.10 * albedo_gloss.a * edge * (ambient(n) + rim_colour * clamp(dot(n, rim_direction) + 0.3, 0.0, 1.0));
    v_colour = (albedo * light + sheen) * open;
    v_uv = strands.xy;
}
