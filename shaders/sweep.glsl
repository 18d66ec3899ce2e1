// The plane sweep at one level, as the disparity network sees it (lfcore.planesweep): the luminance of the corner views in the
// root tone (lfcore.tone), warped by one disparity; samples outside the picture do not count.
#include "warp.glsl"

uniform float level;  // px over the baseline

const vec3 LUMINANCE = vec3(0.2989, 0.5870, 0.1140);
const float TOE = 0.004;

float root_luminance(int corner, ivec2 at) {
    return sqrt(max(dot(LUMINANCE, texelFetch(corner_views, ivec3(at, corner), 0).rgb), 0.0) + TOE);
}

float shifted(int corner, vec2 s) {
    ivec2 last = textureSize(corner_views, 0).xy - 1;
    vec2 base = floor(s);
    vec4 across = cubic_taps(s.x - base.x), down = cubic_taps(s.y - base.y);
    ivec2 first = ivec2(base) - 1;
    float sum = 0.0;
    for (int j = 0; j < 4; ++j) {
        int y = clamp(first.y + j, 0, last.y);
        vec4 row;
        for (int i = 0; i < 4; ++i) {
            row[i] = root_luminance(corner, ivec2(clamp(first.x + i, 0, last.x), y));
        }
        sum += down[j] * dot(across, row);
    }
    return sum;
}

// Mean and standard deviation (N - 1) over the inputs that count; 0 where too few do.
vec2 swept(vec2 s) {
    vec4 seen, counts;
    for (int k = 0; k < 4; ++k) {
        vec2 source = warp_source(k, s, level);
        counts[k] = inside_picture(source) ? 1.0 : 0.0;
        seen[k] = counts[k] > 0.0 ? shifted(k, source) : 0.0;
    }
    float number = dot(counts, vec4(1.0));
    float mean = dot(counts, seen) / max(number, 1.0);
    vec4 difference = counts * (seen - mean);
    return vec2(mean, sqrt(dot(difference, difference) / max(number - 1.0, 1.0)));
}
