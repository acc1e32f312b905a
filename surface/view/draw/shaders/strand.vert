// Hair: soft light per vertex; with quality "fast" the highlights, too.
uniform mat4 view_projection;
uniform vec3 camera;
uniform mat3 head_rotation;

const vec3 MIDDLE = vec3(0.0, 15.0, 0.0);  // of the hair, mm
const vec3 FEATHER = vec3(0.75, 0.5, 1.0);  // of the cover, what is gone at the outline; from which slant on, and where all

in vec3 position;
in vec3 normal;
in vec4 albedo_gloss;         // square root of the linear albedo, gloss
in vec4 strands;              // texture coordinates across and along, cover, how open it lies
in vec3 along;                // direction of the strands at rest
in float roots;               // mm from the parting

#ifdef PER_VERTEX
centroid out vec3 v_colour;
#else
centroid out vec4 v_colour;            // and mm from the parting
#endif
centroid out vec4 v_strand;            // texture coordinates, cover; sine of the angle half way, with PER_VERTEX mm from the parting
#ifndef PER_VERTEX
centroid out vec3 v_through;  // colour of the highlight that went through the fibre
centroid out vec3 v_surface;  // of the other
#endif

void main() {
    gl_Position = view_projection * vec4(position, 1.0);
    vec3 v = normalize(camera - position);
    float facing = dot(normal, v);
    vec3 n = facing < 0.0 ? -normal : normal;
    // Looked at along the sheets one sees single strands against what is behind, not the edge of a film.
    float cover = strands.z - FEATHER.x * smoothstep(FEATHER.y, FEATHER.z, 1.0 - abs(facing));
    n = normalize(n + 1.1 * normalize(position - MIDDLE));  // locks are shaded as the whole that they make
    vec3 t = head_rotation * along;
    vec3 albedo = albedo_gloss.rgb * albedo_gloss.rgb;
    float open = strands.w;
    vec3 colour = albedo * strand_diffuse(n, t, v, open);
    float sine = dot(t, normalize(key_direction + v));
    float lit = clamp(1.6 * dot(n, key_direction) + 0.25, 0.0, 1.0) * open * open * albedo_gloss.a;
    vec3 through = 0.85 * lit * key_colour * sqrt(albedo) * (0.05 + albedo);
    // It stands out on dark hair, and takes a little of the hair's colour: white alone would lie on brown hair as a veil.
    vec3 tint = sqrt(albedo / max(max(albedo.r, albedo.g), max(albedo.b, 1e-4)));
    vec3 surface = (0.095 - 0.06 * clamp(6.0 * albedo.g, 0.0, 1.0)) * lit * key_colour * tint;
#ifdef PER_VERTEX
    colour += through * shine(sine, THROUGH) + surface * shine(sine, SURFACE);
#else
    v_through = through;
    v_surface = surface;
#endif
#ifdef PER_VERTEX
    v_colour = colour;
    v_strand = vec4(strands.xy, cover, roots);
#else
    v_colour = vec4(colour, roots);
    v_strand = vec4(strands.xy, cover, sine);
#endif
}
