/* compact_warp.c for processors with AVX-512: the four phases of a pixel, each with four inputs, are the lanes of a register, and so
 * are four neighbouring samples of a row with their channels. */
#include "compact_warp.h"

#ifdef HALVED_COMPILED

#define TAPS 4
#define LANES 16

/* Where the phases of a pixel sample the inputs: by phase, then input. */
typedef struct {
    int32_t first[LANES]; /* of the sixteen samples around, the first: its pixel in the corners */
    float across[LANES][TAPS], down[LANES][TAPS];
} Samples;

/* Numbers of lanes, by which values are moved. */
HALVED_PART __m512i lanes(int by_four, int by_one) {
    const __m512i lane = _mm512_set_epi32(15, 14, 13, 12, 11, 10, 9, 8, 7, 6, 5, 4, 3, 2, 1, 0);
    const __m512i four = _mm512_srli_epi32(lane, 2), one = _mm512_and_si512(lane, _mm512_set1_epi32(3));
    return _mm512_add_epi32(_mm512_mullo_epi32(four, _mm512_set1_epi32(by_four)), _mm512_mullo_epi32(one, _mm512_set1_epi32(by_one)));
}

/* Along an axis: the first of four pixels, not nearer than a pixel to the edge, and what each counts. */
HALVED_PART __m512i find_taps(__m512 places, Py_ssize_t size, float a, float taps[LANES][TAPS]) {
    /* What is not a number is moved to the first place: these take their second operand then. */
    const __m512 inner = _mm512_min_ps(_mm512_max_ps(places, _mm512_set1_ps(1.0f)), _mm512_set1_ps((float)(size - 3)));
    const __m512i whole = _mm512_cvttps_epi32(inner);
    const __m512 t = inner - _mm512_cvtepi32_ps(whole), rest = 1.0f - t;
    const __m512 before = 1.0f + t, after = 2.0f - t;
    const __m512 weights[TAPS] = {
        ((a * before - 5.0f * a) * before + 8.0f * a) * before - 4.0f * a,
        ((a + 2.0f) * t - (a + 3.0f)) * t * t + 1.0f,
        ((a + 2.0f) * rest - (a + 3.0f)) * rest * rest + 1.0f,
        ((a * after - 5.0f * a) * after + 8.0f * a) * after - 4.0f * a,
    };
    const __m512 low[2] = {_mm512_unpacklo_ps(weights[0], weights[1]), _mm512_unpacklo_ps(weights[2], weights[3])};
    const __m512 high[2] = {_mm512_unpackhi_ps(weights[0], weights[1]), _mm512_unpackhi_ps(weights[2], weights[3])};
    /* Of each part of four lanes, the taps of its first to last. */
    const __m512 of_lane[4] = {
        _mm512_shuffle_ps(low[0], low[1], 0x44), _mm512_shuffle_ps(low[0], low[1], 0xEE),
        _mm512_shuffle_ps(high[0], high[1], 0x44), _mm512_shuffle_ps(high[0], high[1], 0xEE)};
    for (int lane = 0; lane < 4; ++lane) {
        _mm_storeu_ps(taps[lane], _mm512_castps512_ps128(of_lane[lane]));
        _mm_storeu_ps(taps[4 + lane], _mm512_extractf32x4_ps(of_lane[lane], 1));
        _mm_storeu_ps(taps[8 + lane], _mm512_extractf32x4_ps(of_lane[lane], 2));
        _mm_storeu_ps(taps[12 + lane], _mm512_extractf32x4_ps(of_lane[lane], 3));
    }
    return _mm512_sub_epi32(whole, _mm512_set1_epi32(1));
}

HALVED_PART __m512 four_samples(const uint16_t *values) {
    return _mm512_cvtph_ps(_mm256_loadu_si256((const __m256i *)values));
}

/* The columns of four, each with its weight. */
HALVED_PART __m512 weighted_columns(const Warp *warp, const Samples *samples, int lane) {
    const uint16_t *first = (const uint16_t *)warp->corners + 4 * (Py_ssize_t)samples->first[lane];
    const float *down = samples->down[lane];
    __m512 sum = down[0] * four_samples(first);
    for (int k = 1; k < TAPS; ++k) sum += down[k] * four_samples(first + 4 * k * warp->source_width);
    const __m512 across = _mm512_broadcast_f32x4(_mm_loadu_ps(samples->across[lane]));
    return sum * _mm512_permutevar_ps(across, lanes(1, 0));
}

/* Samples (INPUTS, 4) of a phase to the mean and the differences from it, three channels each, and one value that does not count. */
HALVED_PART __m256i gathered_of(__m512 samples) {
    const __m512 mean = 0.25f * sum_of_parts(samples);
    const __m512i order = _mm512_set_epi32(16 + 15, 16 + 14, 16 + 13, 16 + 12, 16 + 10, 16 + 9, 16 + 8, 16 + 6, 16 + 5, 16 + 4, 16 + 2,
                                           16 + 1, 16, 2, 1, 0);
    return (__m256i)_mm512_cvtneps_pbh(_mm512_permutex2var_ps(mean, order, samples - mean));
}

__attribute__((HALVED)) static void warp_row(const Warp *warp, Py_ssize_t y, float *restrict widest) {
    const Py_ssize_t w = warp->width, plane = warp->height * w;
    const __m512i by_phase = lanes(1, 0), by_input = lanes(0, 1), one = _mm512_set1_epi32(1);
    const __m512 offsets_x = _mm512_broadcast_f32x4(_mm_loadu_ps(warp->offsets));
    const __m512 offsets_y = _mm512_broadcast_f32x4(_mm_loadu_ps(warp->offsets + INPUTS));
    const __m512 moves_x = _mm512_broadcast_f32x4(_mm_loadu_ps(warp->moves));
    const __m512 moves_y = _mm512_broadcast_f32x4(_mm_loadu_ps(warp->moves + INPUTS));
    const __m512 columns = _mm512_cvtepi32_ps(_mm512_and_si512(by_phase, one)) + moves_x;
    const __m512 rows = _mm512_cvtepi32_ps(_mm512_srli_epi32(by_phase, 1)) + moves_y + (float)(2 * y + warp->reach);
    const __m512i width = _mm512_set1_epi32((int32_t)warp->source_width);
    const __m512i inputs = _mm512_mullo_epi32(by_input, _mm512_set1_epi32((int32_t)(warp->source_height * warp->source_width)));
    spreads_of_row(warp, y, widest);
    for (Py_ssize_t x = 0; x < w; ++x) {
        const float *own = warp->disparity + y * w + x;
        const __m128 phases = _mm_set_ps(own[3 * plane], own[2 * plane], own[plane], own[0]);
        const __m512 disparity = _mm512_permutexvar_ps(by_phase, _mm512_castps128_ps512(phases));
        Samples samples;
        const __m512i left = find_taps(
            columns + (float)(2 * x + warp->reach) + offsets_x * disparity, warp->source_width, warp->a, samples.across);
        const __m512i top = find_taps(rows + offsets_y * disparity, warp->source_height, warp->a, samples.down);
        const __m512i first = _mm512_add_epi32(_mm512_add_epi32(inputs, left), _mm512_mullo_epi32(top, width));
        _mm512_storeu_si512(samples.first, first);
        uint16_t *warped = (uint16_t *)warp->warped + (y * w + x) * PHASES * INPUTS * 4;
        uint16_t *gathered = (uint16_t *)warp->gathered + (y * w + x) * GATHERED;
        for (int phase = 0; phase < PHASES; ++phase) {
            __m512 of_input[INPUTS];
            for (int n = 0; n < INPUTS; ++n) of_input[n] = weighted_columns(warp, &samples, phase * INPUTS + n);
            const __m512 found = sums_of_parts(of_input);
            _mm256_storeu_si256((__m256i *)(warped + phase * INPUTS * 4), _mm512_cvtps_ph(found, 0));
            /* The last value is written over by what comes after. */
            _mm256_storeu_si256((__m256i *)(gathered + 15 * phase), gathered_of(found));
        }
        const float total = ((own[0] + own[plane]) + (own[2 * plane] + own[3 * plane]));
        const __m128 last = _mm_set_ps(spread_at(widest, x, w), 0.25f * total, warp->v, warp->u);
        const __m128i rounded_last = (__m128i)_mm_cvtneps_pbh(last);
        memcpy(gathered + 60, &rounded_last, 8);
    }
}

int warp_rows_in_halves(const Warp *warp, Py_ssize_t begin, Py_ssize_t end) {
    float *widest = malloc(2 * warp->width * sizeof(float));
    if (widest == NULL) return -1;
    for (Py_ssize_t y = begin; y < end; ++y) warp_row(warp, y, widest);
    free(widest);
    return 0;
}

#else

int warp_rows_in_halves(const Warp *Py_UNUSED(warp), Py_ssize_t Py_UNUSED(begin), Py_ssize_t Py_UNUSED(end)) { return -1; }

#endif
