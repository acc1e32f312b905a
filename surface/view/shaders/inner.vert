// Teeth, gums, tongue and the mouth's lining: lit by what comes in between the lips, per vertex.
uniform mat4 view_projection;
uniform vec3 camera;
uniform vec3 opening_centre;
uniform vec3 opening_area;   // vector area of the lips' opening, mm^2
uniform vec3 albedo;
uniform vec3 wrap;
uniform float wetness;

in vec3 position;
in vec3 normal;
in float occlusion;

out vec3 v_colour;

// Form factor of the opening seen from here, the opening taken as a disc of its area.
float daylight(vec3 n) {
    float area = length(opening_area) + 1e-3;
    vec3 towards = opening_centre - position;
    float square = dot(towards, towards) + 1e-3;
    vec3 direction = towards * inversesqrt(square);
    float facing = abs(dot(opening_area / area, direction));
    float cosine = clamp(0.30 + 0.70 * dot(n, direction), 0.0, 1.0);
    return area * cosine * (0.15 + 0.85 * facing) / (2.2 * square + area);
}

void main() {
    gl_Position = view_projection * vec4(position, 1.0);
    vec3 v = normalize(camera - position);
    vec3 n = dot(normal, v) < 0.0 ? -normal : normal;
    vec3 light = key_colour * wrapped(dot(n, key_direction), wrap)
        + fill_colour * wrapped(dot(n, fill_direction), wrap) + 1.4 * ambient(n);
    float reach = daylight(n) * occlusion;
    float nh = dot(n, normalize(key_direction + v));
    float shine = wetness * (lobe(nh, 60.0) + 0.25 * lobe(nh, 12.0));
    vec3 lit = (albedo * light + shine * key_colour) * reach;
    v_colour = encode(lit);
}
