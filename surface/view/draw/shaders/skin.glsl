// How skin answers the lights, per vertex.
#define WIDE_SHARPNESS 11.0     // the narrow lobe is the wide one to the fourth power
#define WIDE 0.150              // of the gloss, as NARROW
#define NARROW 0.27
#define SATIN 0.85              // of the gloss, for sky and fill light, in skin so dark that hardly any spreads under it
#define SATIN_COLOUR vec3(1.0, 0.88, 0.78)  // or the sky's blue makes it grey, like wax
#define SATIN_MOST 0.24         // of the gloss, that counts: lips have theirs

uniform vec3 wrap;
uniform vec3 through;           // colour of light that comes through thin skin
uniform float gloss_scale;
uniform vec3 key_at_rest;       // the lights as the head at rest would see them, for what was baked there
uniform vec3 rim_at_rest;

float grazing(vec3 n, vec3 v) {
    float edge = 1.0 - clamp(dot(n, v), 0.0, 1.0);
    edge *= edge;
    return edge * edge;
}

// How much of a light reaches a vertex past the rest of the head; `around` as baked, 0..1 for -2..2.
float reaching(vec4 around, vec3 light) {
    float seen = dot(around - 0.5, vec4(4.0, 4.0 * light));
    return smoothstep(0.05, 0.95, seen);
}

// Everything but the key light's highlights; `sun` is how much of the key light arrives.
vec3 diffuse(vec3 n, vec3 v, vec3 albedo, float occlusion, float sun, float back, float thin) {
    // Melanin lies above the blood and absorbs what spreads under the skin: the darker it is, the less it glows.
    float glowing = clamp(2.2 * albedo.r, 0.4, 1.0);
    vec3 spread = wrap * glowing;
    // Blood colours what little light leaves a crevice: occlusion bites less in red.
    vec3 bled = mix(vec3(0.15), vec3(0.60, 0.15, 0.05), glowing);
    vec3 open = occlusion + (1.0 - occlusion) * (occlusion * bled + vec3(0.10, 0.035, 0.025));
    // Light spreads into a shadow's edge under the skin, red the furthest.
    vec3 lit = sun * mix(vec3(1.0), vec3(sun), 0.5 * (1.0 - spread));
    float rim = dot(n, rim_direction);
    vec3 light = key_colour * wrapped(dot(n, key_direction), spread) * (0.12 + 0.88 * lit);
    light += fill_colour * wrapped(dot(n, fill_direction), spread) * open;
    light += rim_colour * wrapped(rim, spread) * back;
    light += ambient(n) * open;
    vec3 glow = key_colour * clamp(0.10 - dot(n, key_direction), 0.0, 1.0) + rim_colour * clamp(0.10 - rim, 0.0, 1.0);
    light += thin * occlusion * occlusion * through * glow;
    vec3 sheen = 0.16 * ambient(n) + 0.12 * rim_colour * back * clamp(rim + 0.4, 0.0, 1.0);
    return albedo * light * mix(vec3(1.0), open, 0.35) + grazing(n, v) * occlusion * sheen;
}

// The surface itself mirrors, softly, what comes from above and from before: where melanin takes the light that spreads
// below it, that shows cheekbone, brow and temple.
vec3 satin(vec3 n, vec3 v, float red, float occlusion, float gloss) {
    float mirrored = max(dot(n, normalize(v + key_direction + 0.5 * fill_direction + vec3(0.0, 0.4, 0.0))), 0.0);
    mirrored *= mirrored;
    mirrored *= mirrored;
    mirrored *= mirrored;
    float dark = clamp(1.0 - 2.2 * red, 0.0, 0.6);
    return SATIN * min(gloss, SATIN_MOST) * dark * occlusion * mirrored * mirrored * SATIN_COLOUR * (sky + fill_colour);
}

// Scale of the key light's highlights: none in the shade, more at grazing angles.
float highlight(vec3 n, vec3 v) {
    return gloss_scale * (1.0 + 5.0 * grazing(n, v)) * clamp(4.0 * dot(n, key_direction), 0.0, 1.0);
}

#ifdef FOLD
float bell(float x) {
    return exp2(-x * x);
}

// Light that skin at a height over the crease of an upper lid, mm, sends out, of what it would without: in the crease
// hardly any but red, on the lid under the fold less, on the fold above it more.
vec3 folded(float over, float deep) {
    float crease = bell(over * 2.2) + 0.5 * bell((over + 0.4) * 0.85);
    float under = over < 0.0 ? bell(over * 0.40) : bell(over * 1.6);
    float above = bell((over - 2.4) * 0.55);
    return exp2(-deep * (crease * vec3(0.78, 1.06, 1.08) + deep * under * vec3(0.19, 0.25, 0.26) - above * 0.16));
}

// The same where only vertices know of it, some of which lie beside the crease.
vec3 folded_softly(float over, float deep) {
    return exp2(-deep * (bell((over + 0.2) * 0.62) * vec3(0.80, 1.10, 1.14) - 0.14 * bell((over - 2.6) * 0.55)));
}
#endif

#ifdef WRINKLES
#define FURROW_MM 0.70          // about how deep a furrow is whose floor lacks half of what the deepest lack
#define FURROW_SOFT_MM 0.25     // below about this depth hardly anything is lacking, so that its sides are soft

uniform float wrinkle_depths[WRINKLES];     // where a vertex has the share 1 of it, mm

// Light that skin in furrows sends out, of what it would beside them: their floors see less of what is around, and blood
// colours what comes back. furrow : the number of a wrinkle in 255ths and its share, and those of another.
vec3 furrowed(vec4 furrow) {
    ivec2 which = ivec2(furrow.xz * 255.0 + 0.5);
    float deep = furrow.y * wrinkle_depths[which.x] + furrow.w * wrinkle_depths[which.y];
    float lost = deep * deep / (deep * deep + FURROW_MM * (deep + FURROW_SOFT_MM));
    return 1.0 - lost * vec3(0.47, 0.60, 0.64);
}
#endif
