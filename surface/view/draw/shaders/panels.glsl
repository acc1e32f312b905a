// A robot's shell: a light face plate with darker skull, jaw and neck round it, joints between the panels, and lamps.
uniform vec3 lamps;

// 1 in a joint `away` from a place, 0 beside it.
float joint(float away, float half_width) {
    return 1.0 - smoothstep(half_width, half_width + max(0.006, 1.5 * fwidth(away)), abs(away));
}

// Below 0 on the face plate; `at` in radians on the skull.
float plate(vec2 at) {
    float side = abs(at.x);
    float around = length(vec2(side / 0.80, (at.y + 0.06) / 0.80)) - 1.0;
    return max(around, 0.22 * (side - 0.30) - (at.y + 0.66));   // cut off below, at the sides of the chin
}

// How light the shell is.
float shell(vec2 at) {
    float bust = smoothstep(-1.36, -1.38, at.y);
    return mix(mix(1.0, 0.12, smoothstep(-0.004, 0.004, plate(at))), 0.07, bust);
}

float joints(vec2 at) {
    float side = abs(at.x);
    float edge = plate(at);
    float inside = step(edge, -0.01);
    float brow = inside * step(0.47, at.y) * joint(side - 0.24 - 0.25 * (at.y - 0.30), 0.003);
    float cheek = inside * step(0.33, side) * joint(at.y + 0.20 + 0.30 * (side - 0.33), 0.003);
    float chin = inside * step(at.y, -0.50) * joint(side - 0.20, 0.003);
    float crown = step(0.01, edge) * step(-0.2, at.y) * max(joint(side - 0.13, 0.004), joint(at.y - 1.05, 0.004));
    float temple = step(0.01, edge) * joint(side - 1.02, 0.004) * step(-0.6, at.y);
    float neck = max(joint(at.y + 1.06, 0.004), joint(at.y + 1.16, 0.004));
    neck = max(neck, max(joint(at.y + 1.26, 0.004), joint(at.y + 1.37, 0.006)));
    return max(max(joint(edge, 0.007), max(brow, cheek)), max(max(chin, crown), max(temple, neck)));
}

// What is seen of the light that a shell of one colour would send out.
vec3 robot(vec3 lit, vec2 at, float lamp) {
    return lit * shell(at) * (1.0 - 0.88 * min(joints(at), 1.0)) + lamp * lamps;
}
