// Two pictures of one size, each with its share.
uniform sampler2D before;
uniform sampler2D after;
uniform float share;   // of the second

out vec4 colour;

void main() {
    ivec2 at = ivec2(gl_FragCoord.xy);
    colour = vec4(mix(texelFetch(before, at, 0).rgb, texelFetch(after, at, 0).rgb, share), 1.0);
}
