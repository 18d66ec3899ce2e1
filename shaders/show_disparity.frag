#version 330 core
// The disparity map in false colour.
#include "placement.glsl"
#include "sampled.glsl"

uniform sampler2D disparity;
uniform sampler2D colours;  // one row, low values first
uniform vec2 range;         // disparities of the first and the last colour

layout(location = 0) out vec4 colour;

void main() {
    float value = sampled(disparity, picture_point).r;
    float t = clamp((value - range.x) / max(range.y - range.x, 1e-6), 0.0, 1.0);
    float steps = float(textureSize(colours, 0).x);
    colour = vec4(texture(colours, vec2((t * (steps - 1.0) + 0.5) / steps, 0.5)).rgb, 1.0);
}
