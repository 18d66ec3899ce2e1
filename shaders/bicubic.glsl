// Cubic interpolation with a = -0.5 (Keys 1981), as in lfcore.warp.

// Weights of the samples at -1, 0, 1, 2 around a position t in [0, 1) past sample 0.
vec4 cubic_taps(float t) {
    float t2 = t * t;
    float t3 = t2 * t;
    return vec4(-0.5 * t3 + t2 - 0.5 * t,
                1.5 * t3 - 2.5 * t2 + 1.0,
                -1.5 * t3 + 2.0 * t2 + 0.5 * t,
                0.5 * t3 - 0.5 * t2);
}

// The picture in one layer at s, in pixels with pixel centres at whole numbers; taps beyond the edge repeat it. They are sampled
// at pixels.
vec3 bicubic(sampler2DArray pictures, int layer, vec2 s) {
    vec2 pixel = 1.0 / vec2(textureSize(pictures, 0).xy);
    vec2 base = floor(s);
    vec4 across = cubic_taps(s.x - base.x);
    vec4 down = cubic_taps(s.y - base.y);
    vec2 first = base - 0.5;
    vec3 sum = vec3(0.0);
    for (int j = 0; j < 4; ++j) {
        vec3 row = vec3(0.0);
        for (int i = 0; i < 4; ++i) {
            vec2 place = (first + vec2(i, j)) * pixel;
            row += across[i] * textureLod(pictures, vec3(place, float(layer)), 0.0).rgb;
        }
        sum += down[j] * row;
    }
    return sum;
}
