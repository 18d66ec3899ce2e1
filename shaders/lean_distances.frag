#version 330 core
// Squared differences of the four warped inputs from the picture, for every second pixel of every second row; an input that
// has no sample here counts as far off.
#include "warp.glsl"

uniform sampler2D disparity;  // for the viewpoint on screen
uniform sampler2D picture;    // as stored

layout(location = 0) out vec4 distances;

void main() {
    ivec2 pixel = 2 * ivec2(gl_FragCoord.xy);
    float here = texelFetch(disparity, pixel, 0).r;
    vec3 seen = texelFetch(picture, pixel, 0).rgb;
    for (int k = 0; k < 4; ++k) {
        vec2 source = warp_source(k, vec2(pixel), here);
        vec3 difference = bicubic(corner_views, k, source) - seen;
        distances[k] = inside_picture(source) ? dot(difference, difference) : 1.0;
    }
}
