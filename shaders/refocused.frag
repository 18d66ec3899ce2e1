#version 330 core
// The sum of all views, shown.
#include "tone.glsl"

uniform sampler2D sum;

layout(location = 0) out vec4 picture;

void main() {
    picture = vec4(toned(clamp(texelFetch(sum, ivec2(gl_FragCoord.xy), 0).rgb, 0.0, 1.0)), 1.0);
}
