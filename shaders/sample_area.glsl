// Made much smaller: the mean of what one window pixel covers.
vec3 sampled(sampler2D picture, vec2 point) {
    vec2 size = vec2(textureSize(picture, 0));
    int taps = clamp(int(ceil(0.75 / scale)), 2, 8);
    vec3 sum = vec3(0.0);
    for (int j = 0; j < taps; ++j) {
        for (int i = 0; i < taps; ++i) {
            vec2 offset = ((vec2(i, j) + 0.5) / float(taps) - 0.5) / scale;
            sum += textureLod(picture, (point + offset) / size, 0.0).rgb;
        }
    }
    return sum / float(taps * taps);
}
