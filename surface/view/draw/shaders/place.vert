// Eq. (1) on the graphics processor: a vertex and its normal from the control points that reach it.
void main() {
    vec3 s, su, sv;
    sum(s, su, sv);
    finish(s, su, sv);
}
