#version 330 core
// Where the warped inputs disagree: the root of the mean over red, green and blue of their variance (N - 1). Inputs that have
// no sample here do not count; where fewer than two have one, there is no disagreement.
#include "warp.glsl"

uniform sampler2D disparity;  // for the viewpoint on screen

layout(location = 0) out float deviation;

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    float here = texelFetch(disparity, pixel, 0).r;
    vec3 seen[4];
    vec4 counts;
    vec3 mean = vec3(0.0);
    for (int k = 0; k < 4; ++k) {
        vec2 source = warp_source(k, vec2(pixel), here);
        counts[k] = inside_picture(source) ? 1.0 : 0.0;
        seen[k] = counts[k] * bicubic(corner_views, k, source);
        mean += seen[k];
    }
    float number = dot(counts, vec4(1.0));
    mean /= max(number, 1.0);
    float squares = 0.0;
    for (int k = 0; k < 4; ++k) {
        vec3 difference = counts[k] * (seen[k] - mean);
        squares += dot(difference, difference);
    }
    deviation = sqrt(squares / (3.0 * max(number - 1.0, 1.0)));
}
