// What is seen from the viewpoint: a synthesis that was made for it.
#include "bicubic.glsl"

uniform sampler2DArray pictures;
uniform int layer;

vec3 seen(vec2 s) {
    return clamp(bicubic(pictures, layer, s), 0.0, 1.0);
}
