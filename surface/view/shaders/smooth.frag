// Edges smoothed after the fact, for the fast picture with its one sample per pixel: a pixel that stands out
// from its neighbours is drawn towards their mean (the sub-pixel term of FXAA, without the search along edges).
uniform sampler2D picture;     // nearest, clamped to its edge
uniform vec2 pixel;             // 1 / size

out vec4 colour;

void main() {
    vec2 at = gl_FragCoord.xy * pixel;
    vec3 middle = texture(picture, at).rgb;
    vec3 north = textureOffset(picture, at, ivec2(0, 1)).rgb;
    vec3 south = textureOffset(picture, at, ivec2(0, -1)).rgb;
    vec3 east = textureOffset(picture, at, ivec2(1, 0)).rgb;
    vec3 west = textureOffset(picture, at, ivec2(-1, 0)).rgb;
    // Green stands for brightness: skin, eyes and background differ in it most.
    float range = max(max(max(north.g, south.g), max(east.g, west.g)), middle.g)
        - min(min(min(north.g, south.g), min(east.g, west.g)), middle.g);
    vec3 mean = 0.25 * (north + south + east + west);
    float apart = abs(mean.g - middle.g) / (range + 0.02);
    colour = vec4(mix(middle, mean, clamp(1.6 * apart, 0.0, 0.6)), 1.0);
}
