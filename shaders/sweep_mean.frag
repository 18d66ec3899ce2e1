#version 330 core
// The mean of the plane sweep at a level.
#include "sweep.glsl"
#include "tone.glsl"

layout(location = 0) out vec4 picture;

void main() {
    picture = vec4(toned(vec3(swept(gl_FragCoord.xy - 0.5).x)), 1.0);
}
