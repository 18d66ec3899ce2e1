#version 330 core
// The newest synthesis, carried by its own disparity from the viewpoint for which it was made to the one on screen.
#include "carry.glsl"
#include "bicubic.glsl"
#include "fade.glsl"
#include "tone.glsl"

uniform vec2 viewpoint;

layout(location = 0) out vec4 picture;

void main() {
    vec2 s = gl_FragCoord.xy - 0.5;
    float disparity = carried_disparity(s, viewpoint);
    vec3 seen = bicubic(syntheses, newest, s + (made_at - viewpoint) * disparity);
    picture = vec4(toned(clamp(faded(seen, s, disparity, viewpoint), 0.0, 1.0)), 1.0);
}
