// A textured accessory: solid, with holes where its texture is clear, or blended with what is behind.
uniform sampler2D picture;
uniform vec4 tint;              // by which the texture is multiplied
uniform float cutoff;           // opacity below which nothing is drawn
uniform int alpha;              // 1 with holes, 2 blended: what is nearly solid, 3 blended: the rest
uniform bool multisampled;      // alpha then decides how many samples of a pixel are covered

const float NEARLY = 0.85;

in vec2 v_uv;
in float v_shade;
#ifdef PER_VERTEX
in vec3 v_light;
in vec3 v_shine;
#else
in vec3 v_normal;
in vec3 v_view;
#endif

out vec4 colour;

// Opacity of a texture, made up for what its smaller versions lose: averaged, fine locks fall below every cutoff, and
// hair that is far away would thin out (B. Golus, "Anti-aliased Alpha Test: The Esoteric Alpha To Coverage", 2017).
float kept(float opacity) {
    vec2 at = v_uv * vec2(textureSize(picture, 0));
    vec2 right = dFdx(at), up = dFdy(at);
    float smaller = max(0.0, 0.5 * log2(max(dot(right, right), dot(up, up)) + 1e-9));
    return opacity * (1.0 + 0.25 * smaller);
}

void main() {
    vec4 texel = texture(picture, v_uv);
#ifdef SOLID
    float cover = 1.0;  // nothing is discarded, so that depth is tested before pixels are shaded
#else
    float cover = texel.a * tint.a;
    if (alpha == 1) {
        cover = kept(cover);
        cover = multisampled ? clamp((cover - cutoff) / max(fwidth(cover), 0.02) + 0.5, 0.0, 1.0) : step(cutoff, cover);
    } else if (alpha == 2) {
        cover = step(NEARLY, cover);
    } else if (cover >= NEARLY) {
        cover = 0.0;
    }
    if (cover <= 0.004) {
        discard;
    }
#endif
#ifdef PER_VERTEX
    vec3 light = v_light;
    vec3 shines = v_shine;
#else
    vec3 v = normalize(v_view);
    vec3 n = normalize(v_normal);
    n = soft < 0.5 && !gl_FrontFacing ? -n : n;
    vec3 light = lit(n, v);
    vec3 shines = shine(n, v);
#endif
    colour = vec4(encode((decoded(texel.rgb) * tint.rgb * light + shines) * v_shade), cover);
}
