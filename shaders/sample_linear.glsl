// Magnified a little, or made a little smaller.
vec3 sampled(sampler2D picture, vec2 point) {
    return texture(picture, point / vec2(textureSize(picture, 0))).rgb;
}
