// Colours of skin in the head's own texture, as ratios to the tone that its vertices have.
uniform sampler2D head_texture;
uniform vec3 texture_tone;      // linear; texels of this colour leave the skin as it is

in vec2 v_texture;

vec3 textured() {
    return decoded(texture(head_texture, v_texture).rgb) / texture_tone;
}
