#define PORES_DULL 5.0  // how much less pores shine, and the skin between them more: grain is 0.08 at most

uniform sampler2D detail;
uniform float detail_strength;

in vec3 v_diffuse;
in vec4 v_normal_wide;
in vec4 v_half_narrow;
in vec2 v_uv;

out vec4 colour;

#ifdef FRECKLES
in float v_freckles;

#ifdef GRAIN_TEXELS
#define FRECKLED 1.24           // unfiltered noise is higher at its peaks
// One texel of a level at which the freckles' noise, smaller than the grain's, has texels as large as those of the grain.
float noise(vec2 at, int level) {
    int side = 2 * int(GRAIN_TEXELS) >> level;
    return texelFetch(detail, ivec2(at * float(side)) & (side - 1), level).w;
}
#else
#define FRECKLED 1.20
// Finer lines of the noise would draw spots as strokes, and linear filtering as splinters: a cubic B-spline, in four
// linear samples, draws them round.
float noise(vec2 at, int level) {
    float side = float(textureSize(detail, level).x);
    vec2 f = fract(at * side - 0.5), i = at * side - f, e = 1.0 - f;
    vec2 last = f * f * f / 6.0;
    vec2 before = e * e * e / 6.0 + (4.0 - 6.0 * f * f + 3.0 * f * f * f) / 6.0, after = 1.0 - before;
    vec2 low = (i - e * e * e / 6.0 / before) / side, high = (i + 1.0 + last / after) / side;
    return mix(mix(textureLod(detail, low, float(level)).w, textureLod(detail, vec2(high.x, low.y), float(level)).w,
                   after.x),
               mix(textureLod(detail, vec2(low.x, high.y), float(level)).w, textureLod(detail, high, float(level)).w,
                   after.x), after.y);
}
#endif

// Cover of freckles: where two layers of noise, which repeat at different places, are both high.
float freckle() {
    float both = noise(4.37 * v_uv + vec2(0.31, 0.17), 3) + noise(2.63 * v_uv.yx + vec2(0.05, 0.43), 2);
    return smoothstep(FRECKLED, FRECKLED + 0.20, both + 0.16 * v_freckles) * min(2.0 * v_freckles, 1.0);
}
#endif

#ifdef LIPS
#define LIP_EDGE 0.25           // of v_lips to both sides of the edge
#define LIP_MIDDLE 0.55         // of v_lips: the edge, a little within its half way, which spreads where the corners are stretched

uniform vec3 lip_tint;
in float v_lips;

// Vertices have the lips' colour in shares of v_lips, which their triangles would draw as a fringe.
vec3 lips() {
    float share = smoothstep(LIP_MIDDLE - LIP_EDGE, LIP_MIDDLE + LIP_EDGE, v_lips);
    return mix(vec3(1.0), lip_tint, share) / mix(vec3(1.0), lip_tint, v_lips);
}
#endif

#ifdef FOLD
in vec2 v_fold;
#endif

#ifdef PANELS
in float v_lamp;
#endif

#ifdef SEAMS
// The shell of a mask is made of plates: gaps along curves in longitude and latitude of the skull.
float gap(float away, float half_width) {
    return 1.0 - smoothstep(half_width, half_width + max(0.006, 1.5 * fwidth(away)), abs(away));
}

float seams(vec2 at) {
    float side = abs(at.x);
    float plate = length(vec2(side / 0.98, (at.y + 0.10) / 0.94)) - 1.0;
    float above = step(-0.62, at.y);
    float cheek = step(0.46, side) * step(plate, 0.0) * gap(at.y + 0.34 + 0.5 * (side - 0.46), 0.004);
    float crown = step(0.0, plate) * step(0.3, at.y) * gap(side - 0.16, 0.004);
    float neck = gap(at.y + 1.16, 0.005) + gap(at.y + 1.30, 0.005);
    return max(max(above * gap(plate, 0.006), cheek), max(crown, neck));
}
#endif

void main() {
#ifdef GRAIN_TEXELS
    // One texel of the level that is about a pixel wide: filtering costs a software renderer more than shading does.
    vec4 grain = (texelFetch(detail, ivec2(v_uv * GRAIN_TEXELS) & (int(GRAIN_TEXELS) - 1), 1) - 0.5) * detail_strength;
#else
    vec4 grain = (texture(detail, v_uv) - 0.5) * detail_strength;
#endif
    vec3 n = normalize(v_normal_wide.xyz + grain.xyz);
    float wide = lobe(dot(n, v_half_narrow.xyz), WIDE_SHARPNESS);
    float narrow = wide * wide;
    narrow *= narrow;
    vec3 lit = v_diffuse * (1.0 + grain.w * vec3(0.7, 1.3, 1.5));
#ifdef LIPS
    lit *= lips();
#endif
#ifdef TEXTURE
    lit *= textured();
#endif
    lit += key_colour * ((wide * v_normal_wide.w + narrow * v_half_narrow.w) * (1.0 + PORES_DULL * grain.w));
#ifdef FOLD
    lit *= folded(v_fold.x, v_fold.y);
#endif
#ifdef FRECKLES
    lit *= mix(vec3(1.0), vec3(0.76, 0.62, 0.52), freckle());
#endif
#ifdef SEAMS
    lit *= 1.0 - 0.88 * min(seams(v_uv / DETAIL_PER_RADIAN), 1.0);
#endif
#ifdef PANELS
    lit = robot(lit, v_uv / DETAIL_PER_RADIAN, v_lamp);
#endif
    vec3 shown = encode(lit);
    colour = vec4(gl_FrontFacing ? shown : INSIDE * shown, 1.0);
}
