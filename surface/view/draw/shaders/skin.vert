// Skin whose soft light is worked out per vertex; the pixel adds grain and highlights.
uniform mat4 view_projection;
uniform vec3 camera;

in vec3 position;
in vec3 normal;
in vec4 albedo_occlusion;   // square root of the linear albedo, occlusion
in vec4 around;               // which way the surroundings lie, as baked
in vec4 surface_uv_gloss;   // detail texture coordinates, gloss, how thin

out vec3 v_diffuse;
out vec4 v_normal_wide;     // normal, strength of the wide highlight
out vec4 v_half_narrow;     // half way between key light and viewer, strength of the narrow highlight
out vec2 v_uv;
#ifdef FRECKLES
in float freckles;          // how many grow here, 0..1
out float v_freckles;
#endif
#ifdef LIPS
in float lips;              // 1 on lips, 0.5 at their edge
out float v_lips;
#endif
#ifdef FOLD
in vec2 fold;               // height over the crease of the upper lid, mm; how deep it is, below 0 at the right eye
uniform vec2 fold_left;     // how deep both are now, of what they are at rest
out vec2 v_fold;
#endif
#ifdef WRINKLES
in vec4 furrow;             // which wrinkles reach the vertex, see furrowed()
#endif
#ifdef TEXTURE
in vec2 texture_uv;         // in the head's own skin texture
out vec2 v_texture;
#endif
#ifdef PANELS
in float lamp;              // how much of the lamps' light it sends out
out float v_lamp;
#endif

void main() {
    gl_Position = view_projection * vec4(position, 1.0);
    vec3 v = normalize(camera - position);
    vec3 albedo = albedo_occlusion.rgb * albedo_occlusion.rgb;
    float sun = reaching(around, key_at_rest);
    float strength = highlight(normal, v) * albedo_occlusion.a * sun * surface_uv_gloss.z;
    v_diffuse = diffuse(normal, v, albedo, albedo_occlusion.a, sun, reaching(around, rim_at_rest), surface_uv_gloss.w)
        + satin(normal, v, albedo.r, albedo_occlusion.a, surface_uv_gloss.z);
#ifdef WRINKLES
    vec3 shade = furrowed(furrow);
    v_diffuse *= shade;
    strength *= shade.g;
#endif
    v_normal_wide = vec4(normal, WIDE * strength);
    v_half_narrow = vec4(normalize(key_direction + v), NARROW * strength);
    v_uv = surface_uv_gloss.xy;
#ifdef FRECKLES
    v_freckles = freckles;
#endif
#ifdef LIPS
    v_lips = lips;
#endif
#ifdef FOLD
    v_fold = vec2(fold.x, abs(fold.y) * (fold.y < 0.0 ? fold_left.y : fold_left.x));
#endif
#ifdef TEXTURE
    v_texture = texture_uv;
#endif
#ifdef PANELS
    v_lamp = lamp;
#endif
}
