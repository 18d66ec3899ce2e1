// From the captured views: the one nearest to each place.
uniform sampler2D views;  // many, tile beside tile
uniform ivec2 size;       // of one
uniform ivec2 grid;       // columns and rows of them
uniform ivec2 held;       // column and row that do not change along the slice

vec3 sliced(vec2 point, vec2 axis, float place) {
    ivec2 along = ivec2(axis);
    ivec2 last = grid - 1;
    ivec2 view = along * clamp(ivec2(floor(place * vec2(last) + 0.5)), ivec2(0), last) + (1 - along) * held;
    vec2 s = point - 0.5 * axis;  // between the centres of two pixels of the line
    ivec2 pixel = ivec2(floor(s));
    vec3 before = texelFetch(views, view * size + clamp(pixel, ivec2(0), size - 1), 0).rgb;
    vec3 after = texelFetch(views, view * size + clamp(pixel + along, ivec2(0), size - 1), 0).rgb;
    return mix(before, after, dot(axis, s - floor(s)));
}
