/* What lies beside the convolutions of the small pair of networks (lfcore.compact; lfcore.compact_parts has the same by torch).
 *
 * "Pixels" here are those of half the resolution, each with four phases: of pixel (y, x), phase 2 dy + dx lies at (2 y + dy,
 * 2 x + dx) of the whole picture. Values of the networks, "halved", are bfloat16, else float32.
 */
#include "common.h"

#define INPUTS 4
#define PHASES 4
#define NEIGHBOURS 9
#define SPREAD 48 /* four weights for each neighbour, filled up to whole registers */
#define BOX 2 /* how far the deviation around a pixel reaches */
#define GATHERED 64 /* channels that the colour network takes */

PART void as_floats(const void *source, Py_ssize_t first, Py_ssize_t count, int halved, float *restrict out) {
    if (halved) {
        const uint16_t *values = (const uint16_t *)source + first;
        for (Py_ssize_t i = 0; i < count; ++i) out[i] = float_of((uint32_t)values[i] << 16);
    } else
        memcpy(out, (const float *)source + first, count * sizeof(float));
}

PART void from_floats(const float *restrict values, Py_ssize_t count, int halved, void *out, Py_ssize_t first) {
    if (halved) {
        uint16_t *restrict result = (uint16_t *)out + first;
        for (Py_ssize_t i = 0; i < count; ++i) result[i] = (uint16_t)rounded(bits_of(values[i]));
    } else
        memcpy((float *)out + first, values, count * sizeof(float));
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

PART float greatest_of(Sixteen values) {
    const Four four = quarters_greatest(values);
    const float low = four[0] > four[1] ? four[0] : four[1], high = four[2] > four[3] ? four[2] : four[3];
    return low > high ? low : high;
}

PART Four sum_of_quarters(Sixteen values) {
    Four quarters[4];
    memcpy(quarters, &values, sizeof quarters);
    return (quarters[0] + quarters[1]) + (quarters[2] + quarters[3]);
}

PART float sum_of(Sixteen values) {
    const Four four = sum_of_quarters(values);
    return (four[0] + four[1]) + (four[2] + four[3]);
}

PART Sixteen four_times(Four four) {
    const Four quarters[4] = {four, four, four, four};
    Sixteen sixteen;
    memcpy(&sixteen, quarters, sizeof sixteen);
    return sixteen;
}

/* e to the x for x <= 0, to a part in 5 million; below -87 and not a number as at -87. */
PART Sixteen exponential(Sixteen x) {
    const Sixteen zero = {0.0f}, bounded = greater_of_sixteen(x, zero - 87.0f);
    const SixteenWhole power = __builtin_convertvector(bounded * 1.44269504f - 0.5f, SixteenWhole);
    const Sixteen whole = __builtin_convertvector(power, Sixteen);
    const Sixteen r = (bounded - whole * 0.693359375f) + whole * 2.12194440e-4f; /* less ln 2 so many times, in two parts */
    const Sixteen high = r * (1.0f / 24 + r * (1.0f / 120 + r * (1.0f / 720)));
    return (1.0f + r * (1.0f + r * (0.5f + r * (1.0f / 6 + high)))) * (Sixteen)((power + 127) << 23);
}

/* Products of four pixels' channels with the columns of a matrix (channels, outputs), outputs a multiple of 16: (4, outputs). */
PART void four_products(const float *const pixels[4], Py_ssize_t channels, const float *matrix, const float *bias,
                        Py_ssize_t outputs, float *restrict out) {
    for (Py_ssize_t first = 0; first < outputs; first += 16) {
        Sixteen sums[4];
        for (int i = 0; i < 4; ++i) sums[i] = sixteen_at(bias + first);
        for (Py_ssize_t c = 0; c < channels; ++c) {
            const Sixteen weights = sixteen_at(matrix + c * outputs + first);
            for (int i = 0; i < 4; ++i) sums[i] += weights * pixels[i][c];
        }
        for (int i = 0; i < 4; ++i) memcpy(out + i * outputs + first, &sums[i], sizeof sums[i]);
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
    Sixteen best = sixteen_at(scores), whole = {0.0f}, sum = {0.0f};
    for (Py_ssize_t i = 16; i < outputs; i += 16) best = greater_of_sixteen(best, sixteen_at(scores + i));
    const float greatest = greatest_of(best);
    for (Py_ssize_t i = 0; i < outputs; i += 16) {
        const Sixteen shares = exponential(sixteen_at(scores + i) - greatest);
        whole += shares;
        sum += shares * sixteen_at(values + i);
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
    for (int i = 0; i < SPREAD; i += 16) {
        const Sixteen shares = exponential(sixteen_at(scores + i) - four_times(best));
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

typedef struct {
    const float *corners; /* (INPUTS, source_height, source_width, 4): three channels and one unused */
    Py_ssize_t source_height, source_width;
    const float *disparity; /* (PHASES, height, width), px */
    const float *offsets; /* (INPUTS, 2): what a pixel of disparity moves the place of sampling by, along x and y */
    Py_ssize_t height, width, reach; /* reach: of the whole picture's first pixel from the corners' edges, px */
    float a; /* of the cubic kernel */
    float u, v; /* as the colour network takes them */
    void *gathered; /* (height, width, GATHERED) */
    int halved;
    float *warped; /* (height, width, PHASES, INPUTS, 4) */
} Warp;

/* Places nearer than a pixel to the edge, or not numbers, are moved there: the corners are continued by more than that. */
PART float inner_place(float place, Py_ssize_t size) {
    const float bounded = place > 1.0f ? place : 1.0f, last = (float)(size - 3);
    return bounded < last ? bounded : last;
}

PART Four sample_colours(const float *corner, Py_ssize_t height, Py_ssize_t width, float x, float y, float a) {
    const float near_x = inner_place(x, width), near_y = inner_place(y, height);
    const Py_ssize_t whole_x = (int32_t)near_x, whole_y = (int32_t)near_y;
    const Four across = cubic_taps(near_x - (float)whole_x, a), down = cubic_taps(near_y - (float)whole_y, a);
    const float *place = corner + 4 * ((whole_y - 1) * width + whole_x - 1);
    const Sixteen sum = down[0] * sixteen_at(place) + down[1] * sixteen_at(place + 4 * width) +
                        down[2] * sixteen_at(place + 8 * width) + down[3] * sixteen_at(place + 12 * width);
    Four columns[4];
    memcpy(columns, &sum, sizeof columns);
    return across[0] * columns[0] + across[1] * columns[1] + across[2] * columns[2] + across[3] * columns[3];
}

/* The least or greatest (with its sign turned) disparity of the three rows around y, by column. */
PART void widest_of_rows(const Warp *warp, Py_ssize_t y, float sign, float *restrict widest) {
    const Py_ssize_t w = warp->width;
    for (Py_ssize_t x = 0; x < w; ++x) widest[x] = -INFINITY;
    for (Py_ssize_t near = at_least(y - 1, 0); near <= at_most(y + 1, warp->height - 1); ++near)
        for (int phase = 0; phase < PHASES; ++phase) {
            const float *restrict row = warp->disparity + (phase * warp->height + near) * w;
            for (Py_ssize_t x = 0; x < w; ++x) widest[x] = sign * row[x] > widest[x] ? sign * row[x] : widest[x];
        }
}

PART float widest_around(const float *widest, Py_ssize_t x, Py_ssize_t width) {
    const float left = widest[within(x - 1, width)], right = widest[within(x + 1, width)];
    const float sides = left > right ? left : right;
    return sides > widest[x] ? sides : widest[x];
}

PART void warp_row(const Warp *warp, Py_ssize_t y, float *restrict greatest, float *restrict least) {
    const Py_ssize_t w = warp->width, source = 4 * warp->source_height * warp->source_width;
    widest_of_rows(warp, y, 1.0f, greatest);
    widest_of_rows(warp, y, -1.0f, least);
    for (Py_ssize_t x = 0; x < w; ++x) {
        float *restrict warped = warp->warped + (y * w + x) * PHASES * INPUTS * 4;
        float gathered[GATHERED]; /* three channels are written as four; what comes after overwrites the fourth */
        float total = 0.0f;
        for (int phase = 0; phase < PHASES; ++phase) {
            const float disparity = warp->disparity[(phase * warp->height + y) * w + x];
            const float column = (float)(2 * x + phase % 2 + warp->reach), row = (float)(2 * y + phase / 2 + warp->reach);
            Four samples[INPUTS], mean = {0.0f};
            total += disparity;
            for (int n = 0; n < INPUTS; ++n) {
                samples[n] = sample_colours(warp->corners + n * source, warp->source_height, warp->source_width,
                                            column + warp->offsets[2 * n] * disparity,
                                            row + warp->offsets[2 * n + 1] * disparity, warp->a);
                mean += samples[n];
            }
            memcpy(warped + phase * INPUTS * 4, samples, sizeof samples);
            mean *= 0.25f;
            memcpy(gathered + 15 * phase, &mean, sizeof mean);
            for (int n = 0; n < INPUTS; ++n) {
                const Four difference = samples[n] - mean;
                memcpy(gathered + 15 * phase + 3 * (n + 1), &difference, sizeof difference);
            }
        }
        gathered[60] = warp->u;
        gathered[61] = warp->v;
        gathered[62] = 0.25f * total;
        gathered[63] = widest_around(greatest, x, w) + widest_around(least, x, w);
        from_floats(gathered, GATHERED, warp->halved, warp->gathered, (y * w + x) * GATHERED);
    }
}

MANY_PROCESSORS
static int warp_rows(const Warp *warp, Py_ssize_t begin, Py_ssize_t end) {
    float *widest = malloc(2 * warp->width * sizeof(float));
    if (widest == NULL) return -1;
    for (Py_ssize_t y = begin; y < end; ++y) warp_row(warp, y, widest, widest + warp->width);
    free(widest);
    return 0;
}

static int whole_warp(const Warp *warp, int threads) {
    const Py_ssize_t parts = at_most(threads * PARTS_PER_THREAD, warp->height);
    int failed = 0;
#pragma omp parallel for num_threads(threads) schedule(dynamic, 1) reduction(| : failed)
    for (Py_ssize_t part = 0; part < parts; ++part)
        failed |= warp_rows(warp, warp->height * part / parts, warp->height * (part + 1) / parts);
    return failed;
}

PyObject *compact_warp(PyObject *Py_UNUSED(module), PyObject *arguments) {
    Warp warp;
    unsigned long long corners, disparity, offsets, gathered, warped;
    int threads;
    if (!PyArg_ParseTuple(arguments, "KKKKKnnnnnfffpi", &corners, &disparity, &offsets, &gathered, &warped, &warp.source_height,
                          &warp.source_width, &warp.height, &warp.width, &warp.reach, &warp.a, &warp.u, &warp.v, &warp.halved,
                          &threads))
        return NULL;
    warp.corners = at_address(corners);
    warp.disparity = at_address(disparity);
    warp.offsets = at_address(offsets);
    warp.gathered = at_address(gathered);
    warp.warped = at_address(warped);
    int failed;
    Py_BEGIN_ALLOW_THREADS
    failed = whole_warp(&warp, threads);
    Py_END_ALLOW_THREADS
    if (failed) return PyErr_NoMemory();
    Py_RETURN_NONE;
}

typedef struct {
    const void *logits; /* (height, width, INPUTS, PHASES) */
    const void *residual, *straight; /* (height, width, PHASES, 3) */
    int halved;
    const float *warped; /* (height, width, PHASES, INPUTS, 4) */
    const float *nearness; /* (INPUTS): added to the logits */
    Py_ssize_t height, width;
    float middle, weight, toe; /* what was taken off the warped inputs, what the residual counts, of the root tone */
    float *picture; /* (picture_height, picture_width, 3), stored values */
    Py_ssize_t picture_height, picture_width; /* at most twice the pixels */
} Blend;

/* The inverse of the root tone, within 0 and 1; not a number becomes 0. */
PART float stored(float toned, float toe) {
    const float value = toned * toned - toe, positive = value > 0.0f ? value : 0.0f;
    return positive < 1.0f ? positive : 1.0f;
}

PART void blend_pixel(const Blend *b, Py_ssize_t y, Py_ssize_t x, const Sixteen nearness) {
    const Py_ssize_t pixel = y * b->width + x;
    float scores[INPUTS * PHASES], residual[3 * PHASES + 1], straight[3 * PHASES + 1]; /* three channels are read as four */
    as_floats(b->logits, pixel * INPUTS * PHASES, INPUTS * PHASES, b->halved, scores);
    as_floats(b->residual, pixel * 3 * PHASES, 3 * PHASES, b->halved, residual);
    as_floats(b->straight, pixel * 3 * PHASES, 3 * PHASES, b->halved, straight);
    residual[3 * PHASES] = straight[3 * PHASES] = 0.0f;
    const Sixteen sums = sixteen_at(scores) + nearness;
    const Sixteen shares = exponential(sums - four_times(quarters_greatest(sums)));
    const Four whole = sum_of_quarters(shares);
    for (int phase = 0; phase < PHASES; ++phase) {
        const Py_ssize_t row = 2 * y + phase / 2, column = 2 * x + phase % 2;
        if (row >= b->picture_height || column >= b->picture_width) continue;
        const float *warped = b->warped + (pixel * PHASES + phase) * INPUTS * 4;
        Four sum = {0.0f};
        for (int n = 0; n < INPUTS; ++n) sum += shares[PHASES * n + phase] * four_at(warped + 4 * n);
        const Four added = four_at(residual + 3 * phase) + four_at(straight + 3 * phase);
        const Four toned = sum / whole[phase] + b->middle + b->weight * added;
        float *out = b->picture + (row * b->picture_width + column) * 3;
        for (int c = 0; c < 3; ++c) out[c] = stored(toned[c], b->toe);
    }
}

MANY_PROCESSORS
static void blend_rows(const Blend *b, Py_ssize_t begin, Py_ssize_t end) {
    float scores[INPUTS * PHASES];
    for (int i = 0; i < INPUTS * PHASES; ++i) scores[i] = b->nearness[i / PHASES];
    const Sixteen nearness = sixteen_at(scores);
    for (Py_ssize_t y = begin; y < end; ++y)
        for (Py_ssize_t x = 0; x < b->width; ++x) blend_pixel(b, y, x, nearness);
}

static void whole_blend(const Blend *b, int threads) {
    const Py_ssize_t parts = at_most(threads * PARTS_PER_THREAD, b->height);
#pragma omp parallel for num_threads(threads) schedule(dynamic, 1)
    for (Py_ssize_t part = 0; part < parts; ++part)
        blend_rows(b, b->height * part / parts, b->height * (part + 1) / parts);
}

PyObject *compact_blend(PyObject *Py_UNUSED(module), PyObject *arguments) {
    Blend b;
    unsigned long long logits, residual, straight, warped, nearness, picture;
    int threads;
    if (!PyArg_ParseTuple(arguments, "KKKKKKnnnnfffpi", &logits, &residual, &straight, &warped, &nearness, &picture, &b.height,
                          &b.width, &b.picture_height, &b.picture_width, &b.middle, &b.weight, &b.toe, &b.halved, &threads))
        return NULL;
    b.logits = at_address(logits);
    b.residual = at_address(residual);
    b.straight = at_address(straight);
    b.warped = at_address(warped);
    b.nearness = at_address(nearness);
    b.picture = at_address(picture);
    Py_BEGIN_ALLOW_THREADS
    whole_blend(&b, threads);
    Py_END_ALLOW_THREADS
    Py_RETURN_NONE;
}
