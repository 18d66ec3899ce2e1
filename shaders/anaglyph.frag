#version 330 core
// A stereo pair for glasses with a red filter before the left eye and a cyan one before the right.
//
// The matrices are those that Dubois publishes for such glasses and a common display ("Conversion of a stereo pair to
// anaglyph with the least-squares projection method", 2009): the colour that, through each filter, comes nearest to what that
// eye should see. They are for linear light; the display's curve is taken as a square, which is quick.
const mat3 LEFT = mat3(0.437, 0.449, 0.164,
                       -0.062, -0.062, -0.024,
                       -0.048, -0.050, -0.017);
const mat3 RIGHT = mat3(-0.011, -0.032, -0.007,
                        0.377, 0.761, 0.009,
                        -0.026, -0.093, 1.234);

uniform sampler2D pair;  // the left eye's picture, and the right eye's beside it

layout(location = 0) out vec4 picture;

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    vec3 left = texelFetch(pair, pixel, 0).rgb;
    vec3 right = texelFetch(pair, pixel + ivec2(textureSize(pair, 0).x / 2, 0), 0).rgb;
    // Each column above is a row of the published matrix: one channel of the result.
    picture = vec4(sqrt(clamp((left * left) * LEFT + (right * right) * RIGHT, 0.0, 1.0)), 1.0);
}
