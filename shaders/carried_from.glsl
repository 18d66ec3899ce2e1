// The newest synthesis, carried by its own disparity to any viewpoint.
#include "carry.glsl"
#include "bicubic.glsl"

uniform sampler2DArray syntheses;
uniform int newest;  // layer of `syntheses`

vec3 seen_from(vec2 s, vec2 q) {
    return clamp(bicubic(syntheses, newest, s + (made_at - q) * carried_disparity(s, q)), 0.0, 1.0);
}
