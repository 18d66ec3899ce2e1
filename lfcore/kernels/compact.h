/* What lies beside the convolutions of the small pair of networks (lfcore.compact; lfcore.compact_parts has the same by torch).
 *
 * "Pixels" here are those of half the resolution, each with four phases: of pixel (y, x), phase 2 dy + dx lies at (2 y + dy,
 * 2 x + dx) of the whole picture. Values of the networks, "halved", are bfloat16, else float32.
 */
#ifndef LFCORE_KERNELS_COMPACT_H
#define LFCORE_KERNELS_COMPACT_H

#include "common.h"

#define INPUTS 4
#define PHASES 4

PART void as_floats(const void *source, Py_ssize_t first, Py_ssize_t count, int halved, float *restrict out) {
    if (halved) {
        const uint16_t *values = (const uint16_t *)source + first;
        for (Py_ssize_t i = 0; i < count; ++i) out[i] = float_of((uint32_t)values[i] << 16);
    } else
        memcpy(out, (const float *)source + first, count * sizeof(float));
}

PART Four greater(Four a, Four b) {
    for (int k = 0; k < 4; ++k) a[k] = a[k] > b[k] ? a[k] : b[k];
    return a;
}

/* Comparisons of vectors are -1 where they hold, else 0. */
PART Sixteen greater_of_sixteen(Sixteen a, Sixteen b) {
    const SixteenWhole chosen = a > b;
    return (Sixteen)(((SixteenWhole)a & chosen) | ((SixteenWhole)b & ~chosen));
}

PART Four quarters_greatest(Sixteen values) {
    Four quarters[4];
    memcpy(quarters, &values, sizeof quarters);
    return greater(greater(quarters[0], quarters[1]), greater(quarters[2], quarters[3]));
}

PART Four sum_of_quarters(Sixteen values) {
    Four quarters[4];
    memcpy(quarters, &values, sizeof quarters);
    return (quarters[0] + quarters[1]) + (quarters[2] + quarters[3]);
}

PART Sixteen four_times(Four four) {
    const Four quarters[4] = {four, four, four, four};
    Sixteen sixteen;
    memcpy(&sixteen, quarters, sizeof sixteen);
    return sixteen;
}

/* e to the x for x <= 0, to a part in 4 million; below -87 and not a number as at -87. */
PART Sixteen exponential(Sixteen x) {
    const Sixteen zero = {0.0f}, bounded = greater_of_sixteen(x, zero - 87.0f);
    const SixteenWhole power = __builtin_convertvector(bounded * 1.44269504f - 0.5f, SixteenWhole);
    const Sixteen whole = __builtin_convertvector(power, Sixteen);
    const Sixteen r = (bounded - whole * 0.693359375f) + whole * 2.12194440e-4f; /* less ln 2 so many times, in two parts */
    const Sixteen high = r * (1.0f / 24 + r * (1.0f / 120 + r * (1.0f / 720)));
    return (1.0f + r * (1.0f + r * (0.5f + r * (1.0f / 6 + high)))) * (Sixteen)((power + 127) << 23);
}

#endif
