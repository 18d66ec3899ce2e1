#version 330 core
// Which warped input the picture is most like, pixel by pixel: a share falls with the squared difference from the picture.
#include "warp.glsl"
#include "lean.glsl"

uniform sampler2D disparity;  // for the viewpoint on screen
uniform sampler2D picture;    // as stored

layout(location = 0) out vec4 colour;

const float TOLERANCE = 0.02;  // differences much smaller than this count as none

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    float here = texelFetch(disparity, pixel, 0).r;
    vec3 seen = texelFetch(picture, pixel, 0).rgb;
    vec4 distances;
    for (int k = 0; k < 4; ++k) {
        vec2 source = warp_source(k, vec2(pixel), here);
        vec3 difference = bicubic(corner_views, k, source) - seen;
        distances[k] = inside_picture(source) ? dot(difference, difference) : 1e3;
    }
    float least = min(min(distances.x, distances.y), min(distances.z, distances.w));
    vec4 share = exp((least - distances) / (2.0 * TOLERANCE * TOLERANCE));
    colour = vec4(lean_colour(share / dot(share, vec4(1.0))), 1.0);
}
