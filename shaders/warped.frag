#version 330 core
// One of the four warped inputs, as the colour network reads it.
#include "warp.glsl"
#include "tone.glsl"

uniform sampler2D disparity;  // for the viewpoint on screen
uniform int corner;
uniform ivec2 tile;           // where the picture lies in the target, which is larger for the sheet of all four

layout(location = 0) out vec4 picture;

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy) - tile;
    picture = vec4(toned(warped(corner, vec2(pixel), texelFetch(disparity, pixel, 0).r)), 1.0);
}
