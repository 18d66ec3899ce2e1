// Absolute difference, mean of the channels, in false colour; the last colour at 1 / gain.
#include "error_colours.glsl"

uniform float gain;

vec3 shown(vec3 difference) {
    return error_colour(dot(abs(difference), vec3(1.0 / 3.0)) * gain);
}
