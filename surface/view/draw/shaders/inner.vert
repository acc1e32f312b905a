// Teeth, gums, tongue and the mouth's lining: lit by what comes in between the lips, per vertex.
#define WALLS vec3(0.50, 0.18, 0.16)
#define GUM vec3(0.57, 0.25, 0.23)
#define NEIGHBOURS vec3(0.84, 0.82, 0.80)
#define DEEP_MM vec2(12.0, 40.0)  // behind the lips: where the mouth's inside begins to be deep, and where it is
#define ARCH_MM 45.0              // how far behind the lips the middle of the row of teeth lies
#define ROUND_WALLS vec3(1.0, 0.92, 0.84)
#define CREVICE vec3(0.34, 0.19, 0.15)  // of the light, what is left between two teeth and at the gum
#define OPEN_SHARE 0.55                 // of the sky that a tooth sees, from which on it is in the open

#define CORNER vec3(0.60, 0.50, 0.44)   // of the light, what lips and cheek leave to teeth at the corners of the mouth
#define CORNER_AT vec2(0.45, 1.0)       // of the way there: where they begin to shade them, and where they do
#define BEHIND vec3(0.37, 0.30, 0.28)    // of the light, what the tongue leaves to the inner sides of teeth far back
#define REDDENED 0.30                    // of the walls' colour, what these have of it: they fade into the mouth
#define WIDE_MM2 vec2(200.0, 900.0)     // of the lips' opening: through a narrow one less of it comes to them
#define NARROW vec3(0.62, 0.49, 0.43)   // of that, what comes
#define TONGUE_WET 0.35                  // nothing but a tongue is as wet
#define MIRROR 40.0                     // how sharp the opening of the mouth is mirrored
#define WET 0.34                        // and how bright
#define BEHIND_MM vec2(14.0, 40.0)       // behind the lips: where it begins to lie before them, and where it does

uniform mat4 view_projection;
uniform vec3 camera;
uniform vec3 opening_centre;
uniform vec3 opening_side;   // from its centre towards a corner of the mouth
uniform vec3 opening_area;   // vector area of the lips' opening, mm^2
uniform vec3 albedo;
uniform vec3 wrap;
uniform float wetness;
uniform float two_sided;     // 1 where back faces are drawn, too

in vec3 position;
in vec3 normal;
in vec2 shade;  // occlusion, and how much gum covers a tooth here

out vec3 v_colour;

// Form factor of the opening seen from here: a disc of its area, slid along the mouth to the nearest place.
float daylight(vec3 n) {
    float area = length(opening_area) + 1e-3;
    vec3 off = position - opening_centre;
    vec3 towards = opening_side * clamp(dot(off, opening_side) / dot(opening_side, opening_side), -1.0, 1.0) - off;
    float square = dot(towards, towards) + 1e-3;
    vec3 direction = towards * inversesqrt(square);
    float facing = abs(dot(opening_area / area, direction));
    float cosine = clamp(0.35 + 0.65 * dot(n, direction), 0.0, 1.0);
    return area * cosine * (0.3 + 0.7 * facing) / (2.0 * square + area);
}

void main() {
    gl_Position = view_projection * vec4(position, 1.0);
    vec3 v = normalize(camera - position);
    // Turned over where the back is seen; of what shows no back, single vertices at its outline would be dark.
    vec3 n = normal * (1.0 - 2.0 * two_sided * step(dot(normal, v), 0.0));
    vec3 out_of = opening_area / (length(opening_area) + 1e-3);
    float past = dot(position - opening_centre, out_of);
    // Far in, light has been round the mouth's red walls and comes from everywhere.
    float deep = smoothstep(DEEP_MM.x, DEEP_MM.y, -past);
    float occlusion = shade.x;
    float teeth = smoothstep(0.5, 0.7, albedo.g) * (1.0 - shade.y);
    // Towards the tongue gums reach far up the teeth, and nothing white is near.
    vec3 side = normalize(opening_side);
    vec3 away = position - opening_centre;
    vec3 outwards = normalize(dot(away, side) * side + (past + ARCH_MM) * out_of);
    float inwards = teeth * smoothstep(0.0, 0.5, -dot(n, outwards));
    float behind = teeth * max(deep, inwards * smoothstep(BEHIND_MM.x, BEHIND_MM.y, -past));
    vec3 own = mix(mix(albedo, GUM, shade.y), WALLS, max(0.06 * inwards, REDDENED * behind));
    vec3 own_normal = n;
    // Single cusps of far teeth would read as lumps.
    n = normalize(mix(n, out_of, max((wetness > TONGUE_WET ? 0.4 : 0.55) * deep, 0.9 * behind)));
    vec3 tint = mix(vec3(1.0), ROUND_WALLS, max(deep, inwards) * (1.0 - 0.3 * teeth));
    vec3 light = key_colour * wrapped(dot(n, key_direction), wrap)
        + fill_colour * wrapped(dot(n, fill_direction), wrap) + 1.6 * ambient(n);
    // A tongue past the lips is in the open.
    float open = mix(occlusion, 1.0, max(0.5 * deep, max(0.5 * teeth, 0.6 * shade.y)));
    float area = length(opening_area);
    float direct = mix(daylight(n) * open, 0.28 * area / (area + 400.0), inwards);
    // What is out lets light under itself, and the tongue is the only thing that comes out far.
    float reach = mix(clamp(direct, 0.0, 1.0), 1.0, smoothstep(-2.0 - 10.0 * step(TONGUE_WET, wetness), 4.0, past));
    // Light bounces between here and the red walls of the mouth: the less comes straight in, the more that counts.
    // Teeth pass it on to each other, whiter than those walls do.
    // Gums before the row have teeth beside them, too.
    float before = step(0.2, albedo.g) * (1.0 - inwards) * (1.0 - deep);
    vec3 bounce = mix(0.5 * (own + WALLS), NEIGHBOURS, 0.9 * max(teeth * (1.0 - 0.4 * inwards), 0.8 * before));
    vec3 arrives = reach / (reach + (1.0 - reach) * (1.0 - 0.9 * bounce));
    float creviced = teeth * (1.0 - max(0.35 * behind, 0.5 * inwards));
    arrives *= mix(vec3(1.0), mix(CREVICE, vec3(1.0), smoothstep(0.0, OPEN_SHARE, occlusion)), creviced);
    arrives *= mix(vec3(1.0), BEHIND * mix(NARROW, vec3(1.0), smoothstep(WIDE_MM2.x, WIDE_MM2.y, area)), behind);
    float sideways = (1.0 - deep) * abs(dot(away, side)) / length(opening_side);
    arrives *= mix(vec3(1.0), CORNER, teeth * smoothstep(CORNER_AT.x, CORNER_AT.y, sideways));
    float nh = dot(n, normalize(key_direction + v));
    float shine = wetness * (lobe(nh, 60.0) + 0.25 * lobe(nh, 12.0)) * reach * (1.0 - behind);  // else far teeth glitter
    // What is wet mirrors the opening of the mouth, through which all light comes.
    float mirrored = lobe(dot(own_normal, normalize(normalize(opening_centre - position) + v)), MIRROR);
    shine += wetness * step(TONGUE_WET, wetness) * WET * mirrored * occlusion * (1.0 - smoothstep(-14.0, -4.0, past));
    v_colour = encode(own * tint * light * arrives + shine * key_colour);
}
