/* Products of bfloat16 for processors with AVX-512 and its instruction for pairs of them. Elsewhere `takes_halves` is 0, and
 * nothing else here may be called. */
#ifndef LFCORE_KERNELS_HALVED_H
#define LFCORE_KERNELS_HALVED_H

#include "common.h"

#define COLUMNS 16 /* of a matrix, which are multiplied together */

/* Whether this processor has what the rest needs. */
int takes_halves(void);

/* Rows of values, two a pair, by a matrix, plus a bias. rows: (count, pairs, 2). matrix: (groups, pairs, COLUMNS, 2). bias and
 * each row of out: (groups * COLUMNS). */
void halved_products(const uint16_t *rows, Py_ssize_t count, Py_ssize_t pairs, const uint16_t *matrix, Py_ssize_t groups,
                     const float *bias, float *out);

#if defined(__x86_64__) && defined(__GNUC__) && (defined(__clang__) || __GNUC__ >= 11)
#define HALVED_COMPILED 1
#include <immintrin.h>

/* Parts become parts of a function for these instructions only if they are for these, too. */
#define HALVED_TARGET "avx512f,avx512bw,avx512dq,avx512vl,avx512bf16,avx2,fma,bmi,bmi2"
#define HALVED target(HALVED_TARGET)
#define HALVED_PART static inline __attribute__((always_inline, HALVED))

/* Sixteen of bfloat16. */
HALVED_PART __m512 floats_of(__m256i halves) {
    return _mm512_castsi512_ps(_mm512_slli_epi32(_mm512_cvtepu16_epi32(halves), 16));
}

/* The lanes that count where so many values are left. */
PART uint32_t lanes_within(Py_ssize_t values, int most) {
    return (uint32_t)((UINT64_C(1) << at_least(at_most(values, most), 0)) - 1);
}

#define SUMS 24 /* registers of them, which leaves as many as a product needs of 32 */

/* Numbers of rows and of groups that are constants. bias: NULL for none. to_next: floats from one row of `out` to the next. */
HALVED_PART void some_products(
    const uint16_t *restrict rows, Py_ssize_t pairs, const uint16_t *restrict matrix, const float *bias, float *restrict out,
    Py_ssize_t to_next, const int count, const int groups) {
    __m512 sums[SUMS];
    for (int i = 0; i < count; ++i)
        for (int g = 0; g < groups; ++g)
            sums[i * groups + g] = bias == NULL ? _mm512_setzero_ps() : _mm512_loadu_ps(bias + g * COLUMNS);
    for (Py_ssize_t pair = 0; pair < pairs; ++pair) {
        __m512bh of_group[4];
        for (int g = 0; g < groups; ++g) of_group[g] = (__m512bh)_mm512_loadu_si512(matrix + (g * pairs + pair) * 2 * COLUMNS);
        for (int i = 0; i < count; ++i) {
            int32_t both;
            memcpy(&both, rows + (i * pairs + pair) * 2, sizeof both);
            const __m512bh everywhere = (__m512bh)_mm512_set1_epi32(both);
            for (int g = 0; g < groups; ++g)
                sums[i * groups + g] = _mm512_dpbf16_ps(sums[i * groups + g], everywhere, of_group[g]);
        }
    }
    for (int i = 0; i < count; ++i)
        for (int g = 0; g < groups; ++g) _mm512_storeu_ps(out + i * to_next + g * COLUMNS, sums[i * groups + g]);
}

/* `most` rows at a time, with as many sums as there are registers for, then one by one. */
#define PRODUCTS(most, of_groups)                                                                                              \
    for (Py_ssize_t row = 0; row < count;)                                                                                     \
        if (row + (most) <= count) {                                                                                           \
            some_products(rows + row * 2 * pairs, pairs, own, own_bias, own_out + row * to_next, to_next, most, of_groups);    \
            row += (most);                                                                                                     \
        } else {                                                                                                               \
            some_products(rows + row * 2 * pairs, pairs, own, own_bias, own_out + row * to_next, to_next, 1, of_groups);       \
            ++row;                                                                                                             \
        }

HALVED_PART void all_products(
    const uint16_t *restrict rows, Py_ssize_t count, Py_ssize_t pairs, const uint16_t *restrict matrix, Py_ssize_t groups,
    const float *bias, float *restrict out, Py_ssize_t to_next) {
    for (Py_ssize_t group = 0; group < groups; group += 4) {
        const uint16_t *own = matrix + group * pairs * 2 * COLUMNS;
        const float *own_bias = bias == NULL ? NULL : bias + group * COLUMNS;
        float *own_out = out + group * COLUMNS;
        switch (groups - group) {
        case 1: PRODUCTS(12, 1); break; /* of more rows, their places would not fit into registers */
        case 2: PRODUCTS(12, 2); break;
        case 3: PRODUCTS(8, 3); break;
        default: PRODUCTS(6, 4);
        }
    }
}

#endif
#endif
