#version 330 core
// A view in between, for one tile of a large texture of many.
#include "seen.glsl"

uniform ivec2 tile;  // its first pixel

layout(location = 0) out vec4 picture;

void main() {
    picture = vec4(seen(gl_FragCoord.xy - 0.5 - vec2(tile)), 1.0);
}
