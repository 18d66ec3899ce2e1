#version 330 core
// How much of each warped input is in the picture: the weights of the colour network, carried with the newest synthesis.
#include "carry.glsl"
#include "lean.glsl"

uniform sampler2D weights;
uniform vec2 viewpoint;
uniform float contrast;  // shares are raised to this power

layout(location = 0) out vec4 colour;

void main() {
    vec2 s = gl_FragCoord.xy - 0.5;
    vec2 source = s + (made_at - viewpoint) * carried_disparity(s, viewpoint);
    vec4 share = texture(weights, (source + 0.5) / vec2(textureSize(weights, 0)));
    float most = max(max(share.x, share.y), max(share.z, share.w));
    share = pow(share / max(most, 1e-6), vec4(contrast));
    colour = vec4(lean_colour(share / max(dot(share, vec4(1.0)), 1e-6)), 1.0);
}
