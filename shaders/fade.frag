#version 330 core
// The cross-fade between two pictures.
uniform sampler2D before;
uniform sampler2D after;
uniform float share;  // of `after`

layout(location = 0) out vec4 picture;

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    picture = mix(texelFetch(before, pixel, 0), texelFetch(after, pixel, 0), share);
}
