// A picture at its place in a window, pixel by pixel.

uniform sampler2D picture;
uniform vec2 origin;   // its lower left corner, pixels

out vec4 colour;

void main() {
    colour = vec4(texelFetch(picture, ivec2(gl_FragCoord.xy - origin), 0).rgb, 1.0);
}
