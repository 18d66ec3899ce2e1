// From the newest synthesis, carried by its own disparity to each viewpoint.
#include "carry.glsl"
#include "bicubic.glsl"

uniform sampler2DArray syntheses;
uniform int newest;  // layer of `syntheses`
uniform vec2 viewpoint;

vec3 sliced(vec2 point, vec2 axis, float place) {
    vec2 q = axis * place + (1.0 - axis) * viewpoint;
    vec2 s = point - 0.5;
    return clamp(bicubic(syntheses, newest, s + (made_at - q) * carried_disparity(s, q)), 0.0, 1.0);
}
