// Skin with a texture, whose light was worked out per vertex.
in vec3 v_light;

out vec4 colour;

void main() {
    vec3 shown = encode(v_light * textured());
    colour = vec4(gl_FrontFacing ? shown : INSIDE * shown, 1.0);
}
