#version 330 core
// Which warped input the picture is most like: a share falls with the mean squared difference around the pixel.
#include "lean.glsl"

uniform sampler2D distances;  // of every second pixel
uniform int reach;        // so many of these to each side
uniform float tolerance;  // differences much smaller than this count as none

layout(location = 0) out vec4 colour;

void main() {
    ivec2 here = ivec2(gl_FragCoord.xy) / 2, last = textureSize(distances, 0) - 1;
    ivec2 first = max(here - reach, ivec2(0)), end = min(here + reach, last);
    vec4 sum = vec4(0.0);
    for (int y = first.y; y <= end.y; ++y) {
        for (int x = first.x; x <= end.x; ++x) {
            sum += texelFetch(distances, ivec2(x, y), 0);
        }
    }
    ivec2 number = end - first + 1;
    vec4 mean = sum / float(number.x * number.y);
    float least = min(min(mean.x, mean.y), min(mean.z, mean.w));
    vec4 share = exp((least - mean) / (2.0 * tolerance * tolerance));
    colour = vec4(lean_colour(share / dot(share, vec4(1.0))), 1.0);
}
