#version 330 core
// A picture at its own viewpoint, pixel by pixel.
#include "tone.glsl"

uniform sampler2DArray pictures;
uniform int layer;

layout(location = 0) out vec4 picture;

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    picture = vec4(toned(texelFetch(pictures, ivec3(pixel, layer), 0).rgb), 1.0);
}
