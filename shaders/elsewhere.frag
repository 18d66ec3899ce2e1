#version 330 core
// What is seen from another viewpoint than that on screen, for one tile of a texture of several.
#include "seen.glsl"
#include "tone.glsl"

uniform ivec2 tile;   // its first pixel
uniform vec2 shift;   // px by which the picture is moved to smaller x and y

layout(location = 0) out vec4 picture;

void main() {
    picture = vec4(toned(seen(gl_FragCoord.xy - 0.5 - vec2(tile) + shift)), 1.0);
}
