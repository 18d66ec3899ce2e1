#version 330 core
// The disparity map for the viewpoint on screen.
#include "carry.glsl"

uniform vec2 viewpoint;

layout(location = 0) out float disparity;

void main() {
    disparity = carried_disparity(gl_FragCoord.xy - 0.5, viewpoint);
}
