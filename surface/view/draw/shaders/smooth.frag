// Edges smoothed after the fact, for the picture with one sample per pixel. Where brightness steps, the step is
// followed along its row or column to both ends, and the pixel takes as much of its neighbour across the edge as a
// straight line between those ends covers of it (after Lottes, "FXAA", 2009). Strands, which end in single pixels
// without order, have an alpha below 1; where they meet something else, pixels take the weighted mean of nine.
#define EDGE 0.035  // difference of brightness above which it is smoothed, wholly at twice that
#define STEP_ENDS 0.25  // of the difference across an edge: a change along it that ends it
#define SINGLE 0.7  // most that a pixel which stands out alone gives away
uniform sampler2D picture;
uniform int reach;  // pixels that an edge is followed to each side; were it a constant, drivers would take all steps always

out vec4 colour;

vec4 fetch(ivec2 at) {
    return texelFetch(picture, clamp(at, ivec2(0), textureSize(picture, 0) - 1), 0);
}

// Brightness: skin, eyes and background differ most in green.
float bright(ivec2 at) {
    return fetch(at).g;
}

void main() {
    ivec2 at = ivec2(gl_FragCoord.xy);
    vec4 middle = fetch(at);
    vec4 north = fetch(at + ivec2(0, 1));
    vec4 south = fetch(at - ivec2(0, 1));
    vec4 east = fetch(at + ivec2(1, 0));
    vec4 west = fetch(at - ivec2(1, 0));
    vec4 most = max(max(max(north, south), max(east, west)), middle);
    vec4 range = most - min(min(min(north, south), min(east, west)), middle);
    colour = vec4(middle.rgb, 1.0);
    if (range.g < EDGE) {
        return;
    }
    vec4 sides = north + south + east + west;
    if (most.a < 0.75) {  // within hair
        float apart = abs(0.25 * sides.g - middle.g) / (range.g + 0.02);
        colour.rgb = mix(middle.rgb, 0.25 * sides.rgb, clamp(1.6 * apart, 0.0, 0.6));
        return;
    }
    vec4 north_east = fetch(at + 1);
    vec4 north_west = fetch(at + ivec2(-1, 1));
    vec4 south_east = fetch(at + ivec2(1, -1));
    vec4 south_west = fetch(at - 1);
    vec4 corners = north_east + north_west + south_east + south_west;
    if (range.a > 0.1) {
        colour.rgb = (4.0 * middle.rgb + 2.0 * sides.rgb + corners.rgb) / 16.0;
        return;
    }
    float rows = 2.0 * abs(north.g + south.g - 2.0 * middle.g) + abs(north_east.g + south_east.g - 2.0 * east.g)
        + abs(north_west.g + south_west.g - 2.0 * west.g);
    float columns = 2.0 * abs(east.g + west.g - 2.0 * middle.g) + abs(north_east.g + north_west.g - 2.0 * north.g)
        + abs(south_east.g + south_west.g - 2.0 * south.g);
    bool level = rows >= columns;
    ivec2 along = level ? ivec2(1, 0) : ivec2(0, 1);
    ivec2 across = level ? ivec2(0, 1) : ivec2(1, 0);
    vec4 ahead = level ? north : east;
    vec4 behind = level ? south : west;
    bool back = abs(behind.g - middle.g) > abs(ahead.g - middle.g);
    across = back ? -across : across;
    vec4 beside = back ? behind : ahead;
    float between = 0.5 * (middle.g + beside.g);
    float ends = STEP_ENDS * abs(beside.g - middle.g);
    float before = 0.0;
    float after = 0.0;
    int left = 0;
    int right = 0;
    while (left < reach && abs(before) < ends) {
        left += 1;
        before = 0.5 * (bright(at - left * along) + bright(at - left * along + across)) - between;
    }
    while (right < reach && abs(after) < ends) {
        right += 1;
        after = 0.5 * (bright(at + right * along) + bright(at + right * along + across)) - between;
    }
    float end = left < right ? before : after;
    // The line crosses this pixel only at that end where the neighbour's colour goes on.
    bool crossed = abs(end) >= ends && (end < 0.0) != (middle.g < between);
    float share = crossed ? 0.5 - (float(min(left, right)) - 0.5) / float(left + right - 1) : 0.0;
    float single = clamp(abs((2.0 * sides.g + corners.g) / 12.0 - middle.g) / range.g, 0.0, 1.0);
    single = smoothstep(0.0, 1.0, single);
    float clear = clamp(range.g / EDGE - 1.0, 0.0, 1.0);
    colour.rgb = mix(middle.rgb, beside.rgb, clear * max(share, SINGLE * single * single));
}
