// A picture drawn smaller with one sample per pixel, brought to its full size: linear between its pixels, and where
// four of them differ, on edges, drawn towards their mean.
uniform sampler2D picture;
uniform vec2 share;             // its size / full size

out vec4 colour;

void main() {
    vec2 at = gl_FragCoord.xy * share - 0.5;
    vec2 part = fract(at);
    ivec2 low = max(ivec2(floor(at)), 0);
    ivec2 high = min(ivec2(floor(at)) + 1, textureSize(picture, 0) - 1);
    vec3 a = texelFetch(picture, low, 0).rgb;
    vec3 b = texelFetch(picture, ivec2(high.x, low.y), 0).rgb;
    vec3 c = texelFetch(picture, ivec2(low.x, high.y), 0).rgb;
    vec3 d = texelFetch(picture, high, 0).rgb;
    // Green stands for brightness: skin, eyes and background differ in it most.
    float range = max(max(a.g, b.g), max(c.g, d.g)) - min(min(a.g, b.g), min(c.g, d.g));
    vec3 between = mix(mix(a, b, part.x), mix(c, d, part.x), part.y);
    colour = vec4(mix(between, 0.25 * (a + b + c + d), 0.5 * clamp(6.0 * range, 0.0, 1.0)), 1.0);
}
