/* The last steps of the disparity network of the small pair: scores of levels to the disparity of every pixel. */
#include "compact.h"

#define NEIGHBOURS 9
#define SPREAD 48 /* four weights for each neighbour, filled up to whole registers */
#define BOX 2 /* how far the deviation around a pixel reaches */

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

typedef struct {
    const void *pixels; /* (height, width, channels), not negative */
    const void *features; /* (height, width, 2 levels): of the sweep, the latter half its deviations */
    int halved;
    Py_ssize_t height, width, channels, levels, outputs; /* outputs: the levels, filled up to a multiple of 16 */
    const float *score, *score_bias; /* (channels, outputs), (outputs), what is filled up never to be chosen */
    const float *values; /* (outputs), px */
    const float *spread, *spread_bias; /* (channels, SPREAD), (SPREAD): by neighbour, then phase */
    float sharpness; /* how steeply a level's score falls with its deviation */
    float *coarse; /* (height, width), px */
    float *disparity; /* (PHASES, height, width), px */
} Disparity;

/* The deviations of row y, summed over the rows around it, at columns from -BOX on: zero beyond the edges. */
PART void sum_rows(const Disparity *d, Py_ssize_t y, float *restrict row, float *restrict sums) {
    const Py_ssize_t w = d->width, outputs = d->outputs;
    memset(sums, 0, (w + 2 * BOX) * outputs * sizeof(float));
    for (Py_ssize_t near = at_least(y - BOX, 0); near <= at_most(y + BOX, d->height - 1); ++near)
        for (Py_ssize_t x = 0; x < w; ++x) {
            float *restrict here = sums + (x + BOX) * outputs;
            as_floats(d->features, (near * w + x) * 2 * d->levels + d->levels, d->levels, d->halved, row);
            for (Py_ssize_t level = 0; level < d->levels; ++level) here[level] += row[level];
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

/* Of row y: the mean of the levels, each with a probability from its score. */
PART void coarse_row(const Disparity *d, Py_ssize_t y, float *restrict pixels, float *restrict sums, float *restrict scores) {
    const Py_ssize_t w = d->width, outputs = d->outputs;
    sum_rows(d, y, scores, sums);
    as_floats(d->pixels, y * w * d->channels, w * d->channels, d->halved, pixels);
    const Py_ssize_t rows = at_most(y + BOX, d->height - 1) - at_least(y - BOX, 0) + 1;
    for (Py_ssize_t first = 0; first < w; first += 4) {
        const float *four[4];
        for (int i = 0; i < 4; ++i) four[i] = pixels + within(first + i, w) * d->channels;
        four_products(four, d->channels, d->score, d->score_bias, outputs, scores);
        for (Py_ssize_t x = first; x < at_most(first + 4, w); ++x) {
            const Py_ssize_t columns = at_most(x + BOX, w - 1) - at_least(x - BOX, 0) + 1;
            const float weight = d->sharpness / (float)(rows * columns);
            const float *restrict near = sums + x * outputs;
            float *restrict own = scores + (x - first) * outputs;
            for (Py_ssize_t i = 0; i < outputs; ++i)
                own[i] -= weight * (near[i] + near[i + outputs] + near[i + 2 * outputs] + near[i + 3 * outputs] +
                                    near[i + 4 * outputs]);
            d->coarse[y * w + x] = expected(own, d->values, outputs);
        }
    }
}

/* Of a pixel, its four phases: each a mean of the nine coarse disparities around, weighed by their scores. */
PART Four spread_out(const Disparity *d, Py_ssize_t y, Py_ssize_t x, float *restrict scores) {
    Four best = four_at(scores), whole = {0.0f}, sum = {0.0f};
    for (int k = 1; k < NEIGHBOURS; ++k) best = greater(best, four_at(scores + 4 * k));
    for (int i = 0; i < SPREAD; i += 8) {
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

PART void fine_row(const Disparity *d, Py_ssize_t y, float *restrict pixels, float *restrict scores) {
    const Py_ssize_t w = d->width;
    as_floats(d->pixels, y * w * d->channels, w * d->channels, d->halved, pixels);
    for (Py_ssize_t first = 0; first < w; first += 4) {
        const float *four[4];
        for (int i = 0; i < 4; ++i) four[i] = pixels + within(first + i, w) * d->channels;
        four_products(four, d->channels, d->spread, d->spread_bias, SPREAD, scores);
        for (Py_ssize_t x = first; x < at_most(first + 4, w); ++x) {
            const Four phases = spread_out(d, y, x, scores + (x - first) * SPREAD);
            for (int phase = 0; phase < PHASES; ++phase) d->disparity[(phase * d->height + y) * w + x] = phases[phase];
        }
    }
}

MANY_PROCESSORS
static int coarse_rows(const Disparity *d, Py_ssize_t begin, Py_ssize_t end) {
    const Py_ssize_t pixels = d->width * d->channels, sums = (d->width + 2 * BOX) * d->outputs;
    float *memory = malloc((pixels + sums + 4 * d->outputs) * sizeof(float));
    if (memory == NULL) return -1;
    for (Py_ssize_t y = begin; y < end; ++y) coarse_row(d, y, memory, memory + pixels, memory + pixels + sums);
    free(memory);
    return 0;
}

MANY_PROCESSORS
static int fine_rows(const Disparity *d, Py_ssize_t begin, Py_ssize_t end) {
    float scores[4 * SPREAD], *pixels = malloc(d->width * d->channels * sizeof(float));
    if (pixels == NULL) return -1;
    for (Py_ssize_t y = begin; y < end; ++y) fine_row(d, y, pixels, scores);
    free(pixels);
    return 0;
}

static int whole_disparity(const Disparity *d, int threads) {
    const Py_ssize_t parts = at_most(threads * PARTS_PER_THREAD, d->height);
    int failed = 0;
#pragma omp parallel num_threads(threads) reduction(| : failed)
    {
#pragma omp for schedule(dynamic, 1)
        for (Py_ssize_t part = 0; part < parts; ++part)
            failed |= coarse_rows(d, d->height * part / parts, d->height * (part + 1) / parts);
#pragma omp for schedule(dynamic, 1)
        for (Py_ssize_t part = 0; part < parts; ++part)
            failed |= fine_rows(d, d->height * part / parts, d->height * (part + 1) / parts);
    }
    return failed;
}

PyObject *compact_disparity(PyObject *Py_UNUSED(module), PyObject *arguments) {
    Disparity d;
    unsigned long long pixels, features, score, score_bias, values, spread, spread_bias, coarse, disparity;
    int threads;
    if (!PyArg_ParseTuple(arguments, "KKKKKKKKKnnnnnfpi", &pixels, &features, &score, &score_bias, &values, &spread, &spread_bias,
                          &coarse, &disparity, &d.height, &d.width, &d.channels, &d.levels, &d.outputs, &d.sharpness, &d.halved,
                          &threads))
        return NULL;
    d.pixels = at_address(pixels);
    d.features = at_address(features);
    d.score = at_address(score);
    d.score_bias = at_address(score_bias);
    d.values = at_address(values);
    d.spread = at_address(spread);
    d.spread_bias = at_address(spread_bias);
    d.coarse = at_address(coarse);
    d.disparity = at_address(disparity);
    int failed;
    Py_BEGIN_ALLOW_THREADS
    failed = whole_disparity(&d, threads);
    Py_END_ALLOW_THREADS
    if (failed) return PyErr_NoMemory();
    Py_RETURN_NONE;
}
