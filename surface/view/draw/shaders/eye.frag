#define CORNEA 1.327             // radius of the cornea's sphere, in radii of the iris (Gullstrand)
#define REFRACTION 0.749         // of air against aqueous humour
#define DEEP 0.10                // of the iris behind the limbus, in its radii
#define SMALLER 1.06             // what the cornea enlarges, made up for
#define FLATTEST 0.45            // slope of a look inside it: a flatter one would see the pupil beside the limbus
#define SINKING 1.7              // of what a lamp mirrors, with the height of a gaze below the horizon

uniform sampler2D detail;
uniform mat3 eye_rotation;            // eye's own frame to world
uniform vec3 lid_upper[LID_POINTS];   // lid margins now, world, mm
uniform vec3 lid_lower[LID_POINTS];
uniform float lids;                   // 1 where the head has lid margins
uniform vec3 iris_colour;
uniform vec3 sclera_colour;
uniform float glow;                   // of the iris itself
uniform float iris_radius;            // sine of the iris' half angle
uniform float pupil_radius;
#ifdef TEXTURE
uniform sampler2D head_texture;
uniform vec4 texture_rectangle;       // left, top, right, bottom of the eye's front; without an area where it has none
#endif

in vec3 v_local;
in vec3 v_view;
in vec3 v_position;

out vec4 colour;

float to_segment(vec3 a, vec3 b) {
    vec3 ab = b - a;
    vec3 ap = v_position - a;
    vec3 off = ap - ab * clamp(dot(ap, ab) / (dot(ab, ab) + 1e-6), 0.0, 1.0);
    return dot(off, off);
}

// mm to the upper lid, to the lower lid, and to the lower one without its ends, which go round the corners: by pixel, for
// an eyeball's triangles are larger than what lies along a lid.
vec3 to_lids() {
    vec3 near = vec3(1e4);
    for (int i = 0; i + 1 < LID_POINTS; ++i) {
        float lower = to_segment(lid_lower[i], lid_lower[i + 1]);
        near.xy = min(near.xy, vec2(to_segment(lid_upper[i], lid_upper[i + 1]), lower));
        near.z = min(near.z, i > 1 && i + 3 < LID_POINTS ? lower : 1e4);
    }
    return mix(vec3(20.0), sqrt(near), lids);
}

vec3 sclera(vec3 d, float r) {
    float vein = texture(detail, d.xy * 0.55).w + texture(detail, d.yx * vec2(0.21, 0.9)).w - 1.0;
    float rim = smoothstep(0.60, 1.0, r);
    vec3 base = sclera_colour * mix(vec3(1.0), vec3(0.92, 0.70, 0.62), rim);
    base = mix(base, base * vec3(1.02, 0.80, 0.76), smoothstep(0.45, 0.95, abs(d.x)));
    return base * (1.0 - clamp(vein, 0.0, 1.0) * (0.25 + rim) * vec3(0.05, 0.45, 0.50));
}

// Fibres run out from the pupil; `t` is 0 at the pupil's edge and 1 at the limbus.
vec3 iris(vec2 p, float t) {
    float angle = atan(p.y, p.x) * 0.31831;
    float fibre = texture(detail, vec2(angle * 3.0, t * 0.22)).w + texture(detail, vec2(angle * 7.0, t * 0.10)).x;
    float collarette = (1.0 - smoothstep(0.18, 0.42, abs(t - 0.26)));
    float pale = clamp(dot(iris_colour, vec3(0.2126, 0.7152, 0.0722)) * 12.0, 0.0, 1.0);  // pigment hides the ring of dark eyes
    vec3 tint = iris_colour * (0.35 + 1.1 * fibre) + vec3(0.10, 0.065, 0.03) * pale * collarette * fibre;
    return tint * (1.0 - 0.8 * smoothstep(0.72, 1.0, t)) * smoothstep(-0.06, 0.12, t);
}

// Two upright windows where the key light is, in sines of angles from its middle: 1 in a pane, soft at its frame.
float windows(vec3 mirrored) {
    vec3 side = normalize(cross(vec3(0.0, 1.0, 0.0), key_direction) + vec3(1e-4, 0.0, 0.0));
    vec2 at = abs(vec2(dot(mirrored, side), dot(mirrored, cross(key_direction, side))));
    float pane = 1.0 - smoothstep(0.085, 0.125, abs(at.x - 0.135));
    return pane * (1.0 - smoothstep(0.21, 0.27, at.y));
}

// Where a look from `v`, in the eye's own frame, into the cornea at `at` meets the iris, which lies flat behind it.
vec2 on_iris(vec2 at, vec3 v) {
    vec2 rim = at / iris_radius;
    float dome = sqrt(max(CORNEA * CORNEA - dot(rim, rim), CORNEA * CORNEA - 1.0));
    vec3 into = refract(-v, normalize(vec3(rim, dome)), REFRACTION);
    float depth = dome - sqrt(CORNEA * CORNEA - 1.0) + DEEP;
    return SMALLER * iris_radius * (rim + into.xy * depth / max(-into.z, FLATTEST));
}

void main() {
    vec3 d = normalize(v_local);
    vec3 v = normalize(v_view);
    vec3 n = eye_rotation * d;
    float r = length(d.xy);
    vec3 lid = to_lids();

    vec2 p = on_iris(d.xy, v * eye_rotation);
    float q = length(p) / iris_radius;
    float pupil = pupil_radius / iris_radius;
    float t = (q - pupil) / (1.0 - pupil);
    float limbus = smoothstep(0.86, 1.10, r / iris_radius);
    vec3 albedo = mix(iris(p, t), sclera(d, r), limbus);
#ifdef TEXTURE
    vec2 size = texture_rectangle.zw - texture_rectangle.xy;
    if (size.x > 0.0)
        albedo = decoded(texture(head_texture, texture_rectangle.xy + size * (0.5 + 0.5 * vec2(p.x, -p.y))).rgb);
#endif

    // The cornea is rounder than the eyeball: its normals lean out faster, which draws highlights to its middle.
    // They are made from directions alone, since the rim of a modelled cornea would split each lamp's image.
    vec3 axis = eye_rotation[2];
    vec3 cornea = normalize(n + 0.9 * (n - axis * dot(n, axis)) * (1.0 - smoothstep(0.5, 2.2, r / iris_radius)));
    float upper = smoothstep(-0.5, 5.0, lid.x);
    float lower = smoothstep(-0.8, 2.4, lid.y);
    float shade = (0.15 + 0.85 * upper) * (0.45 + 0.55 * lower);

    vec3 light = key_colour * wrapped(dot(n, key_direction), vec3(0.35, 0.25, 0.22))
        + fill_colour * wrapped(dot(n, fill_direction), vec3(0.3)) + ambient(n);
    // Light through the cornea gathers on the iris' far side.
    vec2 lamp = (key_direction * eye_rotation).xy;
    float across = clamp(-dot(normalize(vec3(p, 0.35)).xy, lamp), 0.0, 1.0);
    float caustic = 1.0 + 1.2 * (1.0 - smoothstep(0.5, 1.0, q)) * across;
    vec3 lit = albedo * light * shade * caustic;

    vec3 mirrored = reflect(-v, cornea);
    // The key light mirrors as two windows side by side, the fill as a soft lamp. Above an eye that looks down the lid
    // would cover both, and the eye would look dull: they sink with it, most of the way.
    vec3 lamps = normalize(mirrored + vec3(0.0, SINKING * max(-axis.y - 0.05, 0.0), 0.0));
    float towards_key = dot(lamps, key_direction);
    float key = 1.1 * windows(lamps) * step(0.0, towards_key) + 0.05 * lobe(towards_key, 30.0);
    float fill = smoothstep(0.965, 0.990, dot(lamps, fill_direction)) * 0.5;
    float fresnel = 1.0 - clamp(dot(cornea, v), 0.0, 1.0);
    fresnel = 0.03 + 0.5 * fresnel * fresnel * fresnel;
    lit += (key * key_colour + fill * fill_colour) * smoothstep(0.0, 1.2, lid.x);
    lit += fresnel * ambient(mirrored) * shade;
    // Tears stand along the lower lid, a bright line with a darker one above it.
    float corner = min(distance(v_position, lid_lower[2]), distance(v_position, lid_lower[LID_POINTS - 3]));
    float tears = smoothstep(0.0, 4.0, corner) * (1.0 - smoothstep(0.15, 0.50, lid.z));
    lit *= 1.0 - 0.18 * (smoothstep(0.25, 0.6, lid.z) - smoothstep(0.6, 1.3, lid.z));
    lit += tears * 0.24 * key_colour * clamp(dot(n, key_direction) + 0.3, 0.0, 1.0);
    float ring = smoothstep(0.50, 0.62, q) * (1.0 - smoothstep(0.80, 0.94, q));
    lit += glow * iris_colour * (ring + 0.25 * (1.0 - smoothstep(0.0, 0.30, q)));
    colour = vec4(encode(lit), 1.0);
}
