// Values become light on screen to the power of one over gamma.
uniform float exposure;
uniform float gamma;

vec3 toned(vec3 value) {
    return pow(clamp(value * exposure, 0.0, 1.0), vec3(1.0 / gamma));
}
