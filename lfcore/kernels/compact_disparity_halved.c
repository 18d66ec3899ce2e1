/* What follows the products in compact_disparity.c, for processors with AVX-512. */
#include "compact_disparity.h"

#ifdef HALVED_COMPILED

#define LANES 16

/* The deviations of row y, summed over the rows around it, at columns from -BOX on: zero beyond the edges. */
HALVED_PART void sum_rows(const Disparity *d, Py_ssize_t y, float *restrict sums) {
    const Py_ssize_t w = d->width, outputs = d->outputs, row = w * d->levels;
    const Py_ssize_t begin = at_least(y - BOX, 0), end = at_most(y + BOX + 1, d->height);
    memset(sums, 0, BOX * outputs * sizeof *sums);
    memset(sums + (BOX + w) * outputs, 0, BOX * outputs * sizeof *sums);
    for (Py_ssize_t x = 0; x < w; ++x) {
        const uint16_t *first = (const uint16_t *)d->deviations + begin * row + x * d->levels;
        for (Py_ssize_t level = 0; level < outputs; level += LANES) {
            const __mmask16 counting = (__mmask16)lanes_within(d->levels - level, LANES);
            __m512 sum = floats_at(first + level, counting);
            for (Py_ssize_t near = 1; near < end - begin; ++near) sum += floats_at(first + level + near * row, counting);
            _mm512_storeu_ps(sums + (x + BOX) * outputs + level, sum);
        }
    }
}

HALVED_PART float expected(const float *scores, const float *values, Py_ssize_t outputs) {
    __m512 best = _mm512_loadu_ps(scores), whole = _mm512_setzero_ps(), sum = _mm512_setzero_ps();
    for (Py_ssize_t i = LANES; i < outputs; i += LANES) best = _mm512_max_ps(best, _mm512_loadu_ps(scores + i));
    const float greatest = _mm512_reduce_max_ps(best);
    for (Py_ssize_t i = 0; i < outputs; i += LANES) {
        const __m512 shares = exponential_of_sixteen(_mm512_loadu_ps(scores + i) - greatest);
        whole += shares;
        sum += shares * _mm512_loadu_ps(values + i);
    }
    return _mm512_reduce_add_ps(sum) / _mm512_reduce_add_ps(whole);
}

__attribute__((HALVED)) void coarse_of_sixteens(const Disparity *d, Py_ssize_t y, float *sums, float *scores) {
    const Py_ssize_t w = d->width, outputs = d->outputs;
    const Py_ssize_t rows = at_most(y + BOX, d->height - 1) - at_least(y - BOX, 0) + 1;
    sum_rows(d, y, sums);
    for (Py_ssize_t x = 0; x < w; ++x) {
        const Py_ssize_t columns = at_most(x + BOX, w - 1) - at_least(x - BOX, 0) + 1;
        const float weight = d->sharpness / (float)(rows * columns), *near = sums + x * outputs;
        float *own = scores + x * outputs;
        for (Py_ssize_t i = 0; i < outputs; i += LANES) {
            __m512 sum = _mm512_loadu_ps(near + i);
            for (int k = 1; k <= 2 * BOX; ++k) sum += _mm512_loadu_ps(near + k * outputs + i);
            _mm512_storeu_ps(own + i, _mm512_loadu_ps(own + i) - weight * sum);
        }
        d->coarse[y * w + x] = expected(own, d->values, outputs);
    }
}

/* The coarse disparities of the three rows around y, from column -1 on, each edge repeated. coarse: `room_for_coarse`. */
PART void copy_coarse(const Disparity *d, Py_ssize_t y, float *restrict coarse) {
    const Py_ssize_t w = d->width;
    for (Py_ssize_t k = 0; k < 3; ++k, coarse += w + 2) {
        const float *row = d->coarse + within(y + k - 1, d->height) * w;
        coarse[0] = row[0];
        memcpy(coarse + 1, row, w * sizeof *row);
        coarse[w + 1] = row[w - 1];
    }
    coarse[0] = coarse[1] = 0.0f; /* which are read with the last pixel, and do not count */
}

/* The disparities of nine neighbours, each for the four phases. Those from the ninth on are the ninth. */
HALVED_PART void nine_neighbours(const float *coarse, Py_ssize_t to_next_row, __m512 neighbours[3]) {
    const __m512i first = _mm512_set_epi32(4, 4, 4, 4, 2, 2, 2, 2, 1, 1, 1, 1, 0, 0, 0, 0);
    const __m512i second = _mm512_set_epi32(9, 9, 9, 9, 8, 8, 8, 8, 6, 6, 6, 6, 5, 5, 5, 5);
    __m512 rows = _mm512_castps128_ps512(_mm_loadu_ps(coarse));
    rows = _mm512_insertf32x4(rows, _mm_loadu_ps(coarse + to_next_row), 1);
    rows = _mm512_insertf32x4(rows, _mm_loadu_ps(coarse + 2 * to_next_row), 2);
    neighbours[0] = _mm512_permutexvar_ps(first, rows);
    neighbours[1] = _mm512_permutexvar_ps(second, rows);
    neighbours[2] = _mm512_permutexvar_ps(_mm512_set1_epi32(10), rows);
}

__attribute__((HALVED)) void phases_of_sixteens(const Disparity *d, Py_ssize_t y, const float *scores, float *coarse) {
    const Py_ssize_t w = d->width;
    copy_coarse(d, y, coarse);
    for (Py_ssize_t x = 0; x < w; ++x) {
        __m512 neighbours[3], own[3], whole = _mm512_setzero_ps(), sum = _mm512_setzero_ps();
        nine_neighbours(coarse + x, w + 2, neighbours);
        for (int k = 0; k < 3; ++k) own[k] = _mm512_loadu_ps(scores + x * SPREAD + k * LANES);
        own[2] = _mm512_mask_blend_ps((__mmask16)lanes_within(PHASES, LANES), own[0], own[2]); /* beyond the ninth, no greater than the greatest */
        const __m512 best = greatest_of_parts(_mm512_max_ps(_mm512_max_ps(own[0], own[1]), own[2]));
        for (int k = 0; k < 3; ++k) {
            const __mmask16 counting = (__mmask16)lanes_within((NEIGHBOURS - k * PHASES) * PHASES, LANES);
            const __m512 shares = _mm512_maskz_mov_ps(counting, exponential_of_sixteen(own[k] - best));
            whole += shares;
            sum += shares * neighbours[k];
        }
        float phases[LANES];
        _mm512_storeu_ps(phases, sum_of_parts(sum) / sum_of_parts(whole));
        for (int phase = 0; phase < PHASES; ++phase) d->disparity[(phase * d->height + y) * w + x] = phases[phase];
    }
}

#else

void coarse_of_sixteens(const Disparity *Py_UNUSED(d), Py_ssize_t Py_UNUSED(y), float *Py_UNUSED(sums), float *Py_UNUSED(scores)) {}
void phases_of_sixteens(const Disparity *Py_UNUSED(d), Py_ssize_t Py_UNUSED(y), const float *Py_UNUSED(scores),
                        float *Py_UNUSED(coarse)) {}

#endif
