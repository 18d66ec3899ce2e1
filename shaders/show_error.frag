#version 330 core
// Absolute difference of the picture on screen and the captured view, times a gain.
#include "placement.glsl"
#include "sampled.glsl"

uniform sampler2D picture;
uniform sampler2D captured;
uniform float gain;

layout(location = 0) out vec4 colour;

void main() {
    vec2 point = picture_point();
    colour = vec4(abs(sampled(picture, point) - sampled(captured, point)) * gain, 1.0);
}
