// A picture at its place in a window, pixel by pixel. Sampled, not fetched: a software renderer samples pixels of eight
// bits on a path of its own, which is quicker.

uniform sampler2D picture;

in vec2 v_at;

out vec4 colour;

void main() {
    colour = vec4(texture(picture, 0.5 * v_at + 0.5).rgb, 1.0);
}
