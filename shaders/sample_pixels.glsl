// At 1:1, and when magnified so much that single pixels are to be seen.
vec3 sampled(sampler2D picture, vec2 point) {
    return texelFetch(picture, ivec2(point), 0).rgb;
}
