#version 330 core
// The standard deviation of the plane sweep at a level.
#include "sweep.glsl"

layout(location = 0) out float deviation;

void main() {
    deviation = swept(gl_FragCoord.xy - 0.5).y;
}
