/* What lies beside the convolutions of the small pair of networks (lfcore.compact; lfcore.compact_parts has the same by torch).
 *
 * "Pixels" here are those of half the resolution, each with four phases: of pixel (y, x), phase 2 dy + dx lies at (2 y + dy,
 * 2 x + dx) of the whole picture. Values of the networks, "halved", are bfloat16, else float32. Pictures that only compact_warp.c and
 * compact_blend.c read and write, "shortened", are half-precision floats, half the memory, where they are for AVX-512
 * (compact_*_halved.c), else float32.
 */
#ifndef LFCORE_KERNELS_COMPACT_H
#define LFCORE_KERNELS_COMPACT_H

#include "halved.h"
#include "shares.h"

typedef int32_t FourWhole __attribute__((vector_size(16)));
typedef uint16_t EightHalves __attribute__((vector_size(16)));

#define INPUTS 4
#define PHASES 4

PART void as_floats(const void *source, Py_ssize_t first, Py_ssize_t count, int halved, float *restrict out) {
    if (halved) {
        const uint16_t *values = (const uint16_t *)source + first;
        for (Py_ssize_t i = 0; i < count; ++i) out[i] = float_of((uint32_t)values[i] << 16);
    } else
        memcpy(out, (const float *)source + first, count * sizeof(float));
}

PART Eight eight_of(const void *source, Py_ssize_t first, int halved) {
    if (!halved) return eight_at((const float *)source + first);
    EightHalves halves;
    memcpy(&halves, (const uint16_t *)source + first, sizeof halves);
    return (Eight)(__builtin_convertvector(halves, EightWhole) << 16);
}

PART Four greater(Four a, Four b) {
    for (int k = 0; k < 4; ++k) a[k] = a[k] > b[k] ? a[k] : b[k];
    return a;
}

/* Comparisons of vectors are -1 where they hold, else 0. */
PART Eight greater_of_eight(Eight a, Eight b) {
    const EightWhole chosen = a > b;
    return (Eight)(((EightWhole)a & chosen) | ((EightWhole)b & ~chosen));
}

PART Four first_half(Eight v) { return (Four){v[0], v[1], v[2], v[3]}; }
PART Four second_half(Eight v) { return (Four){v[4], v[5], v[6], v[7]}; }
PART Eight twice(Four four) { return (Eight){four[0], four[1], four[2], four[3], four[0], four[1], four[2], four[3]}; }

/* e to the x for x <= 0, to a part in 4 million; below -87 and not a number as at -87. */
PART Eight exponential(Eight x) {
    const Eight zero = {0.0f}, bounded = greater_of_eight(x, zero - 87.0f);
    const EightWhole power = __builtin_convertvector(bounded * 1.44269504f - 0.5f, EightWhole);
    const Eight whole = __builtin_convertvector(power, Eight);
    const Eight r = (bounded - whole * 0.693359375f) + whole * 2.12194440e-4f; /* less ln 2 so many times, in two parts */
    const Eight high = r * (1.0f / 24 + r * (1.0f / 120 + r * (1.0f / 720)));
    return (1.0f + r * (1.0f + r * (0.5f + r * (1.0f / 6 + high)))) * (Eight)((power + 127) << 23);
}

#ifdef HALVED_COMPILED

/* The same of sixteen, to a part in 400,000. */
HALVED_PART __m512 exponential_of_sixteen(__m512 x) {
    const __m512 bounded = _mm512_max_ps(x, _mm512_set1_ps(-87.0f)); /* which it is where x is not a number */
    const __m512 whole = _mm512_roundscale_ps(bounded * 1.44269504f, 0);
    const __m512 r = (bounded - whole * 0.693359375f) + whole * 2.12194440e-4f;
    const __m512 high = r * (1.0f / 24 + r * (1.0f / 120));
    return _mm512_scalef_ps(1.0f + r * (1.0f + r * (0.5f + r * (1.0f / 6 + high))), whole);
}

HALVED_PART __m512 floats_at(const uint16_t *halves, __mmask16 counting) {
    return floats_of(_mm256_maskz_loadu_epi16(counting, halves));
}

/* The greatest of four parts of four, in each of them. */
HALVED_PART __m512 greatest_of_parts(__m512 values) {
    const __m512 two = _mm512_max_ps(values, _mm512_shuffle_f32x4(values, values, 0x4E));
    return _mm512_max_ps(two, _mm512_shuffle_f32x4(two, two, 0xB1));
}

/* Four vectors of four parts of four, to the sums over the parts, one after another. */
HALVED_PART __m512 sums_of_parts(const __m512 of[4]) {
    const __m512 first = _mm512_shuffle_f32x4(of[0], of[1], 0x88) + _mm512_shuffle_f32x4(of[0], of[1], 0xDD);
    const __m512 second = _mm512_shuffle_f32x4(of[2], of[3], 0x88) + _mm512_shuffle_f32x4(of[2], of[3], 0xDD);
    return _mm512_shuffle_f32x4(first, second, 0x88) + _mm512_shuffle_f32x4(first, second, 0xDD);
}

/* The sum over four parts of four, in each of them. */
HALVED_PART __m512 sum_of_parts(__m512 values) {
    const __m512 two = values + _mm512_shuffle_f32x4(values, values, 0x4E);
    return two + _mm512_shuffle_f32x4(two, two, 0xB1);
}

#endif

#endif
