#version 330 core
// A few of the views, shifted by whole pixels and averaged: the first picture of a new focus.
#include "tone.glsl"

const int COUNT = 10;

uniform sampler2D views;      // many, tile beside tile
uniform ivec2 size;           // of one
uniform ivec2 tiles[COUNT];   // first pixel of each
uniform ivec2 shifts[COUNT];  // px
uniform float weights[COUNT]; // of sum 1

layout(location = 0) out vec4 picture;

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    vec3 sum = vec3(0.0);
    for (int k = 0; k < COUNT; ++k) {
        sum += weights[k] * texelFetch(views, tiles[k] + clamp(pixel + shifts[k], ivec2(0), size - 1), 0).rgb;
    }
    picture = vec4(toned(sum), 1.0);
}
