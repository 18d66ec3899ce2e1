// How values become light on screen: as stored, or as the paper's authors show dark captures, which is ^(1/1.5) and then
// saturation (HSV) times 1.5.
uniform float tone_exponent;    // 1: as stored
uniform float tone_saturation;  // 1: as stored

vec3 toned(vec3 value) {
    value = pow(clamp(value, 0.0, 1.0), vec3(tone_exponent));
    float largest = max(value.r, max(value.g, value.b));
    float smallest = min(value.r, min(value.g, value.b));
    float saturation = (largest - smallest) / max(largest, 1e-6);
    float more = min(tone_saturation, 1.0 / max(saturation, 1e-6));
    return largest - (largest - value) * more;
}
