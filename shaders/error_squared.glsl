// Squared difference, channel by channel; white where the difference is 1 / gain.
uniform float gain;

vec3 shown(vec3 difference) {
    return difference * difference * (gain * gain);
}
