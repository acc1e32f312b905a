// A picture drawn smaller, brought to its full size.
uniform sampler2D picture;     // linear, clamped to its edge
uniform vec2 pixel;             // 1 / full size

out vec4 colour;

void main() {
    colour = texture(picture, gl_FragCoord.xy * pixel);
}
