// Absolute difference, channel by channel; white at 1 / gain.
uniform float gain;

vec3 shown(vec3 difference) {
    return abs(difference) * gain;
}
