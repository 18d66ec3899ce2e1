// What is seen from the viewpoint: the newest synthesis, carried there by its own disparity.
#include "carry.glsl"
#include "bicubic.glsl"

uniform sampler2DArray syntheses;
uniform int newest;  // layer of `syntheses`
uniform vec2 viewpoint;

vec3 seen(vec2 s) {
    return clamp(bicubic(syntheses, newest, s + (made_at - viewpoint) * carried_disparity(s, viewpoint)), 0.0, 1.0);
}
