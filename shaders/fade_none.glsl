// Nothing is left of the synthesis before.
uniform sampler2DArray syntheses;
uniform int newest;  // layer of `syntheses`

vec3 faded(vec3 seen, vec2 s, float disparity, vec2 viewpoint) {
    return seen;
}
