#version 330 core
// The step `instant`: the four warped corner views, weighted by nearness to the viewpoint and by how far they agree.
#include "warp.glsl"

uniform sampler2D disparity;  // for the viewpoint on screen

layout(location = 0) out vec4 image;

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    vec2 s = vec2(pixel);
    float d = texelFetch(disparity, pixel, 0).r;
    vec4 share = nearness();
    vec3 seen[4];
    vec3 mean = vec3(0.0);
    float total = 0.0;
    for (int k = 0; k < 4; ++k) {
        vec2 source = warp_source(k, s, d);
        seen[k] = bicubic(corner_views, k, source);
        share[k] *= inside_picture(source) ? 1.0 : 1e-3;
        mean += share[k] * seen[k];
        total += share[k];
    }
    mean /= total;
    share /= total;
    // Views that disagree beyond noise see different things there; the side with more weight is believed.
    float tolerance = 0.02 + 0.12 * dot(mean, vec3(1.0 / 3.0));
    vec3 sum = vec3(0.0);
    total = 0.0;
    for (int i = 0; i < 4; ++i) {
        float agreement = 0.01;
        for (int j = 0; j < 4; ++j) {
            vec3 difference = seen[i] - seen[j];
            agreement += share[j] * exp(-0.5 * dot(difference, difference) / (tolerance * tolerance));
        }
        float weight = share[i] * agreement * agreement * agreement;
        sum += weight * seen[i];
        total += weight;
    }
    image = vec4(clamp(sum / total, 0.0, 1.0), 1.0);
}
