// Edges smoothed after the fact, for the picture with one sample per pixel: a pixel that stands out
// from its neighbours is drawn towards their mean (the sub-pixel term of FXAA, without the search along edges).
uniform sampler2D picture;

out vec4 colour;

void main() {
    ivec2 at = ivec2(gl_FragCoord.xy);
    ivec2 low = max(at - 1, 0);
    ivec2 high = min(at + 1, textureSize(picture, 0) - 1);
    vec3 middle = texelFetch(picture, at, 0).rgb;
    vec3 north = texelFetch(picture, ivec2(at.x, high.y), 0).rgb;
    vec3 south = texelFetch(picture, ivec2(at.x, low.y), 0).rgb;
    vec3 east = texelFetch(picture, ivec2(high.x, at.y), 0).rgb;
    vec3 west = texelFetch(picture, ivec2(low.x, at.y), 0).rgb;
    // Green stands for brightness: skin, eyes and background differ in it most.
    float range = max(max(max(north.g, south.g), max(east.g, west.g)), middle.g)
        - min(min(min(north.g, south.g), min(east.g, west.g)), middle.g);
    vec3 mean = 0.25 * (north + south + east + west);
    float apart = abs(mean.g - middle.g) / (range + 0.02);
    colour = vec4(mix(middle, mean, clamp(1.6 * apart, 0.0, 0.6)), 1.0);
}
