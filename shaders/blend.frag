#version 330 core
// The step `blend`: the corner views averaged by nearness to the viewpoint, before any disparity is known.
#include "warp.glsl"
#include "tone.glsl"

layout(location = 0) out vec4 picture;

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    vec4 share = nearness();
    vec3 sum = vec3(0.0);
    for (int k = 0; k < 4; ++k) {
        sum += share[k] * texelFetch(corner_views, ivec3(pixel, k), 0).rgb;
    }
    picture = vec4(toned(sum), 1.0);
}
