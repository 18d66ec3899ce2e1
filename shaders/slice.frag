#version 330 core
// An epipolar slice: one line of the picture, seen from viewpoints that lie in a row along it.
#include "slice_source.glsl"
#include "placement.glsl"
#include "tone.glsl"

uniform vec2 window_size;
uniform vec2 through;   // picture point through which the line goes
uniform vec2 axis;      // of the line: (1, 0) across, (0, 1) down
uniform float start;    // window pixel at which the slice begins, at right angles to the line
uniform float extent;   // window pixels to where it ends
uniform vec2 range;     // u, or v, at its beginning and end

layout(location = 0) out vec4 colour;

void main() {
    vec2 window_point = vec2(gl_FragCoord.x, window_size.y - gl_FragCoord.y);
    vec2 other = 1.0 - axis;
    vec2 point = axis * picture_point + other * through;
    float place = mix(range.x, range.y, (dot(other, window_point) - start) / extent);
    colour = vec4(toned(sliced(point, axis, place)), 1.0);
}
