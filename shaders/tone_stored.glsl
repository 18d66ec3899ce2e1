// Values become light on screen as they are stored.
vec3 toned(vec3 value) {
    return value;
}
