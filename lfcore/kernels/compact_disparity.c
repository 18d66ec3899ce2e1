/* The last steps of the disparity network of the small pair: scores of levels to the disparity of every pixel. */
#include "compact_disparity.h"

PART float greatest_of(Eight values) {
    float greatest = values[0];
    for (int i = 1; i < 8; ++i) greatest = values[i] > greatest ? values[i] : greatest;
    return greatest;
}

PART float sum_of(Eight v) { return ((v[0] + v[4]) + (v[1] + v[5])) + ((v[2] + v[6]) + (v[3] + v[7])); }

/* Products of four pixels' channels with the columns of a matrix (channels, outputs), outputs a multiple of 16: (4, outputs). */
PART void four_products(const float *const pixels[4], Py_ssize_t channels, const float *matrix, const float *bias,
                        Py_ssize_t outputs, float *restrict out) {
    for (Py_ssize_t first = 0; first < outputs; first += 16) {
        Eight low[4], high[4];
        for (int i = 0; i < 4; ++i) low[i] = eight_at(bias + first), high[i] = eight_at(bias + first + 8);
        for (Py_ssize_t c = 0; c < channels; ++c) {
            const Eight of_low = eight_at(matrix + c * outputs + first), of_high = eight_at(matrix + c * outputs + first + 8);
            for (int i = 0; i < 4; ++i) {
                low[i] += of_low * pixels[i][c];
                high[i] += of_high * pixels[i][c];
            }
        }
        for (int i = 0; i < 4; ++i) {
            memcpy(out + i * outputs + first, &low[i], sizeof low[i]);
            memcpy(out + i * outputs + first + 8, &high[i], sizeof high[i]);
        }
    }
}

/* Values of the room that `row_products` needs for a row of pixels, in float32 or for the matrix unit. */
PART Py_ssize_t room_for_pixels(const Disparity *d) {
    return at_least(d->width * d->channels, (amx_room(d->width, d->channels) + 1) / 2);
}

/* Of row y: (width, outputs), and room for three pixels more. pixels: `room_for_pixels`. */
PART void row_products(
    const Disparity *d, Py_ssize_t y, const Matrix *matrix, Py_ssize_t outputs, float *restrict pixels, float *restrict out) {
    const Py_ssize_t w = d->width, channels = d->channels;
    if (matrix->packed != NULL) {
        amx_row_products((const uint16_t *)d->pixels + y * w * channels, w, channels, matrix->packed, outputs / COLUMNS,
                         matrix->bias, (uint16_t *)pixels, out);
        return;
    }
    if (matrix->halved != NULL) {
        halved_products((const uint16_t *)d->pixels + y * w * channels, w, channels / 2, matrix->halved, outputs / COLUMNS,
                        matrix->bias, out);
        return;
    }
    as_floats(d->pixels, y * w * channels, w * channels, d->halved, pixels);
    for (Py_ssize_t first = 0; first < w; first += 4) {
        const float *four[4];
        for (int i = 0; i < 4; ++i) four[i] = pixels + within(first + i, w) * channels;
        four_products(four, channels, matrix->weights, matrix->bias, outputs, out + first * outputs);
    }
}

/* The deviations of row y, summed over the rows around it, at columns from -BOX on: zero beyond the edges. */
PART void sum_rows(const Disparity *d, Py_ssize_t y, float *restrict sums) {
    const Py_ssize_t w = d->width, outputs = d->outputs, row = w * d->levels;
    const Py_ssize_t begin = at_least(y - BOX, 0), end = at_most(y + BOX + 1, d->height);
    memset(sums, 0, (w + 2 * BOX) * outputs * sizeof(float));
    for (Py_ssize_t x = 0; x < w; ++x) {
        const Py_ssize_t first = begin * row + x * d->levels;
        float *restrict here = sums + (x + BOX) * outputs;
        Py_ssize_t level = 0;
        for (; level + 8 <= d->levels; level += 8) {
            Eight sum = eight_of(d->deviations, first + level, d->halved);
            for (Py_ssize_t near = 1; near < end - begin; ++near)
                sum += eight_of(d->deviations, first + level + near * row, d->halved);
            memcpy(here + level, &sum, sizeof sum);
        }
        for (; level < d->levels; ++level)
            for (Py_ssize_t near = 0; near < end - begin; ++near) {
                float value;
                as_floats(d->deviations, first + level + near * row, 1, d->halved, &value);
                here[level] += value;
            }
    }
}

PART float expected(const float *scores, const float *values, Py_ssize_t outputs) {
    Eight best = eight_at(scores), whole = {0.0f}, sum = {0.0f};
    for (Py_ssize_t i = 8; i < outputs; i += 8) best = greater_of_eight(best, eight_at(scores + i));
    const float greatest = greatest_of(best);
    for (Py_ssize_t i = 0; i < outputs; i += 8) {
        const Eight shares = exponential(eight_at(scores + i) - greatest);
        whole += shares;
        sum += shares * eight_at(values + i);
    }
    return sum_of(sum) / sum_of(whole);
}

/* Of row y: the mean of the levels, each with a probability from its score, which is changed. */
PART void coarse_from_scores(const Disparity *d, Py_ssize_t y, float *restrict sums, float *restrict scores) {
    const Py_ssize_t w = d->width, outputs = d->outputs;
    sum_rows(d, y, sums);
    const Py_ssize_t rows = at_most(y + BOX, d->height - 1) - at_least(y - BOX, 0) + 1;
    for (Py_ssize_t x = 0; x < w; ++x) {
        const Py_ssize_t columns = at_most(x + BOX, w - 1) - at_least(x - BOX, 0) + 1;
        const float weight = d->sharpness / (float)(rows * columns);
        const float *restrict near = sums + x * outputs;
        float *restrict own = scores + x * outputs;
        for (Py_ssize_t i = 0; i < outputs; i += 8) {
            Eight sum = eight_at(near + i);
            for (int k = 1; k <= 2 * BOX; ++k) sum += eight_at(near + k * outputs + i);
            const Eight score = eight_at(own + i) - weight * sum;
            memcpy(own + i, &score, sizeof score);
        }
        d->coarse[y * w + x] = expected(own, d->values, outputs);
    }
}

/* Of a pixel, its four phases: each a mean of the nine coarse disparities around, weighed by their scores. */
PART Four spread_out(const Disparity *d, Py_ssize_t y, Py_ssize_t x, float *restrict scores) {
    Four best = four_at(scores), whole = {0.0f}, sum = {0.0f};
    for (int k = 1; k < NEIGHBOURS; ++k) best = greater(best, four_at(scores + 4 * k));
    for (int i = 0; i < 4 * NEIGHBOURS; i += 8) {
        const Eight shares = exponential(eight_at(scores + i) - twice(best));
        memcpy(scores + i, &shares, sizeof shares);
    }
    for (int k = 0; k < NEIGHBOURS; ++k) {
        const Four share = four_at(scores + 4 * k);
        whole += share;
        sum += share * d->coarse[within(y + k / 3 - 1, d->height) * d->width + within(x + k % 3 - 1, d->width)];
    }
    return sum / whole;
}

PART void phases_from_scores(const Disparity *d, Py_ssize_t y, float *restrict scores) {
    const Py_ssize_t w = d->width;
    for (Py_ssize_t x = 0; x < w; ++x) {
        const Four phases = spread_out(d, y, x, scores + x * SPREAD);
        for (int phase = 0; phase < PHASES; ++phase) d->disparity[(phase * d->height + y) * w + x] = phases[phase];
    }
}

MANY_PROCESSORS
static int coarse_rows(const Disparity *d, Py_ssize_t begin, Py_ssize_t end) {
    const Py_ssize_t pixels = room_for_pixels(d);
    float *memory = malloc((pixels + room_for_sums(d) + (d->width + 3) * d->outputs) * sizeof(float));
    if (memory == NULL) return -1;
    float *sums = memory + pixels, *scores = sums + room_for_sums(d);
    for (Py_ssize_t y = begin; y < end; ++y) {
        row_products(d, y, &d->score, d->outputs, memory, scores);
        if (d->wide)
            coarse_of_sixteens(d, y, sums, scores);
        else
            coarse_from_scores(d, y, sums, scores);
    }
    free(memory);
    return 0;
}

MANY_PROCESSORS
static int fine_rows(const Disparity *d, Py_ssize_t begin, Py_ssize_t end) {
    const Py_ssize_t pixels = room_for_pixels(d);
    float *memory = malloc((pixels + room_for_coarse(d) + (d->width + 3) * SPREAD) * sizeof(float));
    if (memory == NULL) return -1;
    float *coarse = memory + pixels, *scores = coarse + room_for_coarse(d);
    for (Py_ssize_t y = begin; y < end; ++y) {
        row_products(d, y, &d->spread, SPREAD, memory, scores);
        if (d->wide)
            phases_of_sixteens(d, y, scores, coarse);
        else
            phases_from_scores(d, y, scores);
    }
    free(memory);
    return 0;
}

static int whole_disparity(const Disparity *d, int threads) {
    const Py_ssize_t parts = at_most(threads * PARTS_PER_THREAD, d->height);
    Shares coarse, fine;
    share_out(&coarse, parts, threads);
    share_out(&fine, parts, threads);
    int failed = 0;
#pragma omp parallel num_threads(threads) reduction(| : failed)
    {
        EACH_SHARED(part, &coarse)
            failed |= coarse_rows(d, d->height * part / parts, d->height * (part + 1) / parts);
#pragma omp barrier
        EACH_SHARED(part, &fine)
            failed |= fine_rows(d, d->height * part / parts, d->height * (part + 1) / parts);
    }
    return failed;
}

static Matrix matrix_at(const unsigned long long a[4]) {
    return (Matrix){at_address(a[0]), at_address(a[1]), at_address(a[2]), at_address(a[3])};
}

PyObject *compact_disparity(PyObject *Py_UNUSED(module), PyObject *arguments) {
    Disparity d;
    unsigned long long pixels, deviations, score[4], values, spread[4], coarse, disparity;
    int threads;
    if (!PyArg_ParseTuple(arguments, "KK(KKKK)K(KKKK)KKnnnnnfppi", &pixels, &deviations, score, score + 1, score + 2, score + 3,
                          &values, spread, spread + 1, spread + 2, spread + 3, &coarse, &disparity, &d.height, &d.width, &d.channels, &d.levels,
                          &d.outputs, &d.sharpness, &d.halved, &d.wide, &threads))
        return NULL;
    d.pixels = at_address(pixels);
    d.deviations = at_address(deviations);
    d.score = matrix_at(score);
    d.values = at_address(values);
    d.spread = matrix_at(spread);
    d.coarse = at_address(coarse);
    d.disparity = at_address(disparity);
    int failed;
    Py_BEGIN_ALLOW_THREADS
    failed = whole_disparity(&d, threads);
    Py_END_ALLOW_THREADS
    if (failed) return PyErr_NoMemory();
    Py_RETURN_NONE;
}
