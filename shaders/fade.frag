#version 330 core
// The cross-fade from the instant picture to the synthesis.
uniform sampler2D before;
uniform sampler2D after;
uniform float share;  // of `after`

layout(location = 0) out vec4 image;

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    image = mix(texelFetch(before, pixel, 0), texelFetch(after, pixel, 0), share);
}
