// The four corner views, warped by a disparity and weighted by nearness to the viewpoint and by how far they agree.
#include "warp.glsl"

float alike(vec3 difference, float sharpness) {
    return exp(sharpness * dot(difference, difference));
}

vec3 warped_corners(vec2 s, float disparity) {
    vec4 share = nearness();
    vec3 seen[4];
    vec3 mean = vec3(0.0);
    float total = 0.0;
    for (int k = 0; k < 4; ++k) {
        vec2 source = warp_source(k, s, disparity);
        seen[k] = bicubic(corner_views, k, source);
        share[k] *= inside_picture(source) ? 1.0 : 1e-3;
        mean += share[k] * seen[k];
        total += share[k];
    }
    mean /= total;
    share /= total;
    // Views that disagree beyond noise see different things there; the side with more weight is believed.
    float tolerance = 0.02 + 0.12 * dot(mean, vec3(1.0 / 3.0));
    float sharpness = -0.5 / (tolerance * tolerance);
    // Each pair once, and no loop over it: software rasterisers would go through memory for every index.
    float ab = alike(seen[0] - seen[1], sharpness), ac = alike(seen[0] - seen[2], sharpness);
    float ad = alike(seen[0] - seen[3], sharpness), bc = alike(seen[1] - seen[2], sharpness);
    float bd = alike(seen[1] - seen[3], sharpness), cd = alike(seen[2] - seen[3], sharpness);
    vec4 agreement = 0.01 + share.x * vec4(1.0, ab, ac, ad) + share.y * vec4(ab, 1.0, bc, bd)
                          + share.z * vec4(ac, bc, 1.0, cd) + share.w * vec4(ad, bd, cd, 1.0);
    vec4 weight = share * agreement * agreement * agreement;
    vec3 sum = weight[0] * seen[0] + weight[1] * seen[1] + weight[2] * seen[2] + weight[3] * seen[3];
    return clamp(sum / (weight[0] + weight[1] + weight[2] + weight[3]), 0.0, 1.0);
}
