#version 330 core
// How a picture differs from its partner.
#include "difference.glsl"

uniform sampler2D picture;
uniform sampler2D partner;

layout(location = 0) out vec4 colour;

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    colour = vec4(shown(texelFetch(picture, pixel, 0).rgb - texelFetch(partner, pixel, 0).rgb), 1.0);
}
