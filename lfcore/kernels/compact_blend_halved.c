/* compact_blend.c for processors with AVX-512: the four phases of a pixel are the four parts of a register. */
#include "compact_blend.h"

#ifdef HALVED_COMPILED

/* What each input (a part) counts at each phase (a lane of it). */
HALVED_PART __m512 shares_of(__m512 scores) {
    const __m512 shares = exponential_of_sixteen(scores - greatest_of_parts(scores));
    return shares / sum_of_parts(shares);
}

/* Three channels each of two phases side by side, of which `columns` lie within the picture. */
HALVED_PART void put_row(const Blend *b, Py_ssize_t row, Py_ssize_t column, Py_ssize_t columns, __m512 channels) {
    _mm512_mask_storeu_ps(b->picture + (row * b->picture_width + column) * 3, columns > 1 ? 0x3F : 0x07, channels);
}

HALVED_PART void blend_pixel(const Blend *b, Py_ssize_t y, Py_ssize_t x, __m512 nearness) {
    const Py_ssize_t pixel = y * b->width + x;
    const uint16_t *outputs = (const uint16_t *)b->outputs + pixel * OUTPUTS;
    const uint16_t *warped = (const uint16_t *)b->warped + pixel * PHASES * INPUTS * 4;
    const __m512 shares = shares_of(floats_at(outputs, 0xFFFF) + nearness);
    __m512 weighted[PHASES];
    for (int phase = 0; phase < PHASES; ++phase) {
        const __m512i own = _mm512_set_epi32(12, 12, 12, 12, 8, 8, 8, 8, 4, 4, 4, 4, 0, 0, 0, 0);
        const __m512 counts = _mm512_permutexvar_ps(_mm512_add_epi32(own, _mm512_set1_epi32(phase)), shares);
        const __m256i inputs = _mm256_loadu_si256((const __m256i *)(warped + phase * INPUTS * 4));
        weighted[phase] = counts * _mm512_cvtph_ps(inputs);
    }
    const uint16_t *straight = (const uint16_t *)b->straight + pixel * 3 * PHASES;
    const __m512 residual = floats_at(outputs + LOGITS, 0x0FFF) + floats_at(straight, 0x0FFF);
    const __m512i with_fourth = _mm512_set_epi32(15, 11, 10, 9, 15, 8, 7, 6, 15, 5, 4, 3, 15, 2, 1, 0);
    const __m512 toned = sums_of_parts(weighted) + b->middle + b->weight * _mm512_permutexvar_ps(with_fourth, residual);
    /* What is not a number becomes 0: the greatest is the second operand then. */
    const __m512 positive = _mm512_max_ps(toned * toned - b->toe, _mm512_setzero_ps());
    const __m512 stored = _mm512_min_ps(positive, _mm512_set1_ps(1.0f));
    const Py_ssize_t row = 2 * y, column = 2 * x, columns = b->picture_width - column;
    const __m512i without_fourth = _mm512_set_epi32(15, 15, 15, 15, 14, 13, 12, 10, 9, 8, 6, 5, 4, 2, 1, 0);
    const __m512 packed = _mm512_permutexvar_ps(without_fourth, stored);
    const __m512i below = _mm512_set_epi32(15, 15, 15, 15, 15, 15, 15, 15, 15, 15, 11, 10, 9, 8, 7, 6);
    if (columns > 0 && row < b->picture_height) put_row(b, row, column, columns, packed);
    if (columns > 0 && row + 1 < b->picture_height) put_row(b, row + 1, column, columns, _mm512_permutexvar_ps(below, packed));
}

__attribute__((HALVED)) void blend_rows_in_halves(const Blend *b, Py_ssize_t begin, Py_ssize_t end) {
    const __m512i of_input = _mm512_set_epi32(3, 3, 3, 3, 2, 2, 2, 2, 1, 1, 1, 1, 0, 0, 0, 0);
    const __m512 nearness = _mm512_permutexvar_ps(of_input, _mm512_castps128_ps512(_mm_loadu_ps(b->nearness)));
    for (Py_ssize_t y = begin; y < end; ++y)
        for (Py_ssize_t x = 0; x < b->width; ++x) blend_pixel(b, y, x, nearness);
}

#else

void blend_rows_in_halves(const Blend *Py_UNUSED(b), Py_ssize_t Py_UNUSED(begin), Py_ssize_t Py_UNUSED(end)) {}

#endif
