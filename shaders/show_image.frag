#version 330 core
// A picture in the window.
#include "placement.glsl"
#include "sampled.glsl"

uniform sampler2D picture;
uniform float dim;  // 1: as it is

layout(location = 0) out vec4 colour;

void main() {
    colour = vec4(sampled(picture, picture_point) * dim, 1.0);
}
