// What is seen from the viewpoint: the newest synthesis, carried there.
#include "carried_from.glsl"

uniform vec2 viewpoint;

vec3 seen(vec2 s) {
    return seen_from(s, viewpoint);
}
