// Linear values become light on screen as IEC 61966-2-1 (sRGB) encodes them.
uniform float exposure;

vec3 toned(vec3 value) {
    value = clamp(value * exposure, 0.0, 1.0);
    return mix(1.055 * pow(value, vec3(1.0 / 2.4)) - 0.055, 12.92 * value, lessThanEqual(value, vec3(0.0031308)));
}
