#version 330 core
// A map of how far two pictures are apart, in the colours of errors; grey where it has no value.
#include "error_colours.glsl"

uniform sampler2D values;
uniform vec2 range;  // values of the first and the last colour
uniform float no_value;

layout(location = 0) out vec4 colour;

void main() {
    float value = texelFetch(values, ivec2(gl_FragCoord.xy), 0).r;
    vec3 found = error_colour((value - range.x) / (range.y - range.x));
    colour = vec4(value <= 0.5 * no_value ? vec3(0.25) : found, 1.0);
}
