// Rotates what follows the head by its share of the angle.
uniform vec3 axis;              // the head's rotation
uniform float angle;
uniform vec3 pivot;

in float share;                 // of the head's rotation

vec3 turned(vec3 p) {
    float c = cos(share * angle);
    return c * p + sin(share * angle) * cross(axis, p) + (1.0 - c) * dot(axis, p) * axis;
}
