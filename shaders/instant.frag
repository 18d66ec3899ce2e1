#version 330 core
// The four corner views, warped by the newest disparity and weighted by nearness to the viewpoint and by how far they agree.
#include "carry.glsl"
#include "warped_corners.glsl"
#include "tone.glsl"

layout(location = 0) out vec4 picture;

void main() {
    vec2 s = gl_FragCoord.xy - 0.5;
    picture = vec4(toned(warped_corners(s, carried_disparity(s, viewpoint))), 1.0);
}
