// What is seen from the viewpoint: the corner views, warped there by the carried disparity.
#include "carry.glsl"
#include "warped_corners.glsl"

vec3 seen(vec2 s) {
    return warped_corners(s, carried_disparity(s, viewpoint));
}
