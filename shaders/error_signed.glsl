// Difference with its sign, channel by channel: grey where there is none, black at -1 / gain, white at 1 / gain.
uniform float gain;

vec3 shown(vec3 difference) {
    return 0.5 + 0.5 * gain * difference;
}
