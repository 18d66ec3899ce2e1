#version 330 core
// Absolute difference of a picture and the captured view, times a gain.
uniform sampler2D picture;
uniform sampler2DArray captured;  // of one layer
uniform float gain;

layout(location = 0) out vec4 colour;

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    vec3 difference = texelFetch(picture, pixel, 0).rgb - texelFetch(captured, ivec3(pixel, 0), 0).rgb;
    colour = vec4(abs(difference) * gain, 1.0);
}
