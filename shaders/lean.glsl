// Four shares as a colour: the mean of the inputs' colours.
uniform vec3 corner_colours[4];  // in the order of lightfield.CORNERS

vec3 lean_colour(vec4 share) {
    return share[0] * corner_colours[0] + share[1] * corner_colours[1] + share[2] * corner_colours[2]
         + share[3] * corner_colours[3];
}
