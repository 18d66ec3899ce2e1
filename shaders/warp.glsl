// Backward warp of a corner view: sampled at s + (p_i - q) D(s), as lfcore.warp has it; nothing outside the picture.
#include "bicubic.glsl"

uniform sampler2DArray corner_views;  // in the order of lightfield.CORNERS
uniform vec2 corner_positions[4];     // p_i as (u, v)
uniform vec2 viewpoint;               // q as (u, v)

vec2 warp_source(int corner, vec2 s, float disparity) {
    return s + (corner_positions[corner] - viewpoint) * disparity;
}

bool inside_picture(vec2 s) {
    vec2 last = vec2(textureSize(corner_views, 0).xy - 1);
    return all(greaterThanEqual(s, vec2(0.0))) && all(lessThanEqual(s, last));
}

vec3 warped(int corner, vec2 s, float disparity) {
    vec2 source = warp_source(corner, s, disparity);
    return inside_picture(source) ? bicubic(corner_views, corner, source) : vec3(0.0);
}

// Share of each corner in a bilinear blend at the viewpoint; outside [0, 1] as on the nearest edge.
vec4 nearness() {
    vec2 q = clamp(viewpoint, 0.0, 1.0);
    vec4 share;
    for (int k = 0; k < 4; ++k) {
        vec2 near = 1.0 - abs(corner_positions[k] - q);
        share[k] = near.x * near.y;
    }
    return share;
}
