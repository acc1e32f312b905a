// Skin worked out per vertex, all of it.
#define SMEARED 0.15  // of the gloss, in place of NARROW: between vertices a narrow highlight smears, and looks like wax

uniform mat4 view_projection;
uniform vec3 camera;

in vec3 position;
in vec3 normal;
in vec4 albedo_occlusion;
in vec4 around;               // which way the surroundings lie, as baked
in vec4 surface_uv_gloss;
#ifdef FOLD
in vec2 fold;                 // as in skin.vert
uniform vec2 fold_left;
#endif
#ifdef WRINKLES
in vec4 furrow;               // as in skin.vert
#endif
#ifdef PANELS
in float lamp;                // how much of the lamps' light it sends out

out vec3 v_light;
out vec2 v_uv;
out float v_lamp;
#elif defined(TEXTURE)
in vec2 texture_uv;           // in the head's own skin texture

out vec3 v_light;
out vec2 v_texture;
#else
out vec3 v_colour;
#endif

void main() {
    gl_Position = view_projection * vec4(position, 1.0);
    vec3 v = normalize(camera - position);
    vec3 albedo = albedo_occlusion.rgb * albedo_occlusion.rgb;
    float wide = lobe(dot(normal, normalize(key_direction + v)), WIDE_SHARPNESS);
    float narrow = wide * wide;
    narrow *= narrow;
    float sun = reaching(around, key_at_rest);
    float shine = highlight(normal, v) * albedo_occlusion.a * sun * surface_uv_gloss.z
        * (WIDE * wide + SMEARED * narrow);
    vec3 lit = diffuse(normal, v, albedo, albedo_occlusion.a, sun, reaching(around, rim_at_rest), surface_uv_gloss.w);
    lit += shine * key_colour + satin(normal, v, albedo.r, albedo_occlusion.a, surface_uv_gloss.z);
#ifdef FOLD
    lit *= folded_softly(fold.x, abs(fold.y) * (fold.y < 0.0 ? fold_left.y : fold_left.x));
#endif
#ifdef WRINKLES
    lit *= furrowed(furrow);
#endif
#ifdef PANELS
    v_light = lit;
    v_uv = surface_uv_gloss.xy;
    v_lamp = lamp;
#elif defined(TEXTURE)
    v_light = lit;
    v_texture = texture_uv;
#else
    v_colour = encode(lit);
#endif
}
