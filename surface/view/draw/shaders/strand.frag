// Strands: locks part and thin out where their cover falls below a strand's height.
#define SOFT vec2(0.9, 0.3)  // of strands' heights, over which each fades: few, as at a hairline, and many together
#define STEADY 0.2  // a strand keeps its height along its length, so that no piece of it is left by itself
#define PARTING vec4(-0.8, 1.4, 3.4, 0.42)  // mm from the roots: scalp, hair; how unevenly strands begin; most of the scalp seen
#define SCALP vec3(0.62, 0.56, 0.51)  // of skin between hair, which lights it warmly
#define STAGGERED 1.37  // texels along the strands, by which each row of texels lies further than the one beside it
#ifdef GRAIN_TEXELS
#define WIDE 1.15  // texels across strands for one of the smaller texture: finer ones are smaller than a pixel and sparkle
#define SHADES vec3(0.45, 0.6, 0.5)  // brightness of strands, and by how much it differs; less where pixels are unfiltered
#else
#define SHADES vec3(0.15, 0.9, 0.8)
#endif
#define STRAND 0.5  // an alpha by which smooth.frag knows strands
uniform sampler2D detail;
uniform vec3 scalp;  // how much brighter than hair the skin at a parting is
uniform bool multisampled;  // alpha then decides how many samples of a pixel a strand covers

#ifdef PER_VERTEX
centroid in vec3 v_colour;  // at the edge of a triangle, the middle of a pixel may lie outside of it
centroid in vec4 v_strand;  // with mm from the parting last
#else
centroid in vec4 v_colour;  // with mm from the parting last
centroid in vec4 v_strand;
#endif
#ifndef PER_VERTEX
centroid in vec3 v_through;
centroid in vec3 v_surface;
#endif

out vec4 colour;

void main() {
#ifdef GRAIN_TEXELS
    // One texel: filtering costs a software renderer more. Where they end side by side, their edges would show as steps.
    vec2 at = v_strand.xy * vec2(WIDE, 2.0 * STEADY) * GRAIN_TEXELS;
    at.y += STAGGERED * floor(at.x);
    vec4 noise = texelFetch(detail, ivec2(floor(at)) & (2 * int(GRAIN_TEXELS) - 1), 0);
    float height = 0.5 + 1.25 * (noise.w - 0.5) + 0.75 * (noise.x - 0.5);
#else
    vec4 noise = texture(detail, v_strand.xy * vec2(1.0, STEADY));
    vec4 fine = texture(detail, v_strand.xy * vec2(2.9, 0.5));
    float single = 1.0 - smoothstep(0.1, 0.9, v_strand.z);  // where strands end they are hairs, not teeth of a saw
    float height = 0.5 + (1.0 - 0.72 * single) * (noise.w - 0.5) + (0.6 - 0.2 * single) * (noise.x - 0.5)
        + (0.5 + 0.6 * single) * (fine.x - 0.5);
    noise = mix(noise, fine, 0.5);
#endif
    float over = v_strand.z - height;
#ifdef GRAIN_TEXELS
    // Texels that differ from pixel to pixel, in an order without pattern, end a strand softly.
    float order = fract(52.983 * fract(dot(gl_FragCoord.xy, vec2(0.06711, 0.00584))));
    float cover = step((order - 0.5) * max(0.0, 0.45 - 0.5 * v_strand.z), over);
#else
    float cover;
    float soft = mix(SOFT.x, SOFT.y, clamp(1.6 * v_strand.z, 0.0, 1.0));
    if (multisampled) {
        cover = clamp(over / max(fwidth(over), soft) + 0.5, 0.0, 1.0);
    } else {
        // With one sample a strand fades pixel by pixel, in an order without pattern, which smooth.frag levels.
        float order = fract(52.983 * fract(dot(gl_FragCoord.xy, vec2(0.06711, 0.00584))));
        cover = step((order - 0.5) * soft, over);
    }
#endif
    if (cover <= 0.0) {
        discard;
    }
    vec3 lit = v_colour.rgb * (SHADES.x + SHADES.y * noise.y + SHADES.z * noise.w);
#ifndef PER_VERTEX
    float sine = v_strand.w + 0.42 * (noise.z - 0.5);
    lit += v_through * shine(sine, THROUGH) * (0.3 + 1.4 * noise.x);
    lit += v_surface * (shine(sine, SURFACE) * (0.25 + 2.2 * noise.y * noise.y));
#endif
#ifdef PER_VERTEX
    float roots = v_strand.w;
#else
    float roots = v_colour.a;
#endif
    if (roots < 4.0) {  // few pixels
        float bare = PARTING.w * (1.0 - smoothstep(PARTING.x, PARTING.y, roots + PARTING.z * (noise.w - 0.5)));
        lit = mix(lit, SCALP * scalp * v_colour.rgb, bare);
    }
    colour = vec4(encode(lit), multisampled ? cover : STRAND);
}
