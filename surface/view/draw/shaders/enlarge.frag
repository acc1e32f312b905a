// A smoothed picture brought to its full size, linear between its pixels.
uniform sampler2D picture;

in vec2 v_at;

out vec4 colour;

void main() {
    colour = texture(picture, 0.5 * v_at + 0.5);
}
