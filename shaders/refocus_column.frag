#version 330 core
// What refocus_row.frag has summed up, shifted down by what the focus asks; it is added to the sum of the other rows.
#include "bicubic.glsl"

uniform sampler2D row;
uniform float shift;  // px

layout(location = 0) out vec4 sum;

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    int last = textureSize(row, 0).y - 1;
    float whole = floor(shift);
    vec4 taps = cubic_taps(shift - whole);
    int y = pixel.y + int(whole);
    sum = taps.x * texelFetch(row, ivec2(pixel.x, clamp(y - 1, 0, last)), 0)
        + taps.y * texelFetch(row, ivec2(pixel.x, clamp(y, 0, last)), 0)
        + taps.z * texelFetch(row, ivec2(pixel.x, clamp(y + 1, 0, last)), 0)
        + taps.w * texelFetch(row, ivec2(pixel.x, clamp(y + 2, 0, last)), 0);
}
