// The colours of errors: 0 is none, 1 full scale.
uniform sampler2D colours;  // one row, low values first

vec3 error_colour(float error) {
    float steps = float(textureSize(colours, 0).x);
    return texture(colours, vec2((clamp(error, 0.0, 1.0) * (steps - 1.0) + 0.5) / steps, 0.5)).rgb;
}
