// Values become light on screen as they are stored, exposed.
uniform float exposure;

vec3 toned(vec3 value) {
    return value * exposure;
}
