#version 330 core
// Some views of one row, shifted across by what the focus asks, cubic between pixels, and summed up by weight.
#include "bicubic.glsl"

const int MOST = 16;

uniform sampler2D views;      // many, tile beside tile
uniform ivec2 size;           // of one
uniform int count;
uniform ivec2 tiles[MOST];    // first pixel of each
uniform float shifts[MOST];   // px
uniform float weights[MOST];

layout(location = 0) out vec4 sum;

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    int last = size.x - 1;
    vec3 row = vec3(0.0);
    for (int k = 0; k < count; ++k) {
        float whole = floor(shifts[k]);
        vec4 taps = weights[k] * cubic_taps(shifts[k] - whole);
        int x = pixel.x + int(whole);
        ivec2 start = tiles[k] + ivec2(0, pixel.y);
        row += taps.x * texelFetch(views, start + ivec2(clamp(x - 1, 0, last), 0), 0).rgb
             + taps.y * texelFetch(views, start + ivec2(clamp(x, 0, last), 0), 0).rgb
             + taps.z * texelFetch(views, start + ivec2(clamp(x + 1, 0, last), 0), 0).rgb
             + taps.w * texelFetch(views, start + ivec2(clamp(x + 2, 0, last), 0), 0).rgb;
    }
    sum = vec4(row, 1.0);
}
