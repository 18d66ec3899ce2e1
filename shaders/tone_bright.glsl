// Values become light on screen as the paper's authors show dark captures: ^(1/1.5), then saturation (HSV) times 1.5.
uniform float exposure;

vec3 toned(vec3 value) {
    value = pow(clamp(value * exposure, 0.0, 1.0), vec3(1.0 / 1.5));
    float largest = max(value.r, max(value.g, value.b));
    float smallest = min(value.r, min(value.g, value.b));
    float saturation = (largest - smallest) / max(largest, 1e-6);
    float more = min(1.5, 1.0 / max(saturation, 1e-6));
    return largest - (largest - value) * more;
}
