/* The disparity of the small pair, moved to where its inputs agree best (lfcore.alignment). */
#include "compact_places.h"

#define AROUND 3 /* px around each over which agreement is looked at */
#define TAPS (2 * AROUND + 1)

typedef struct {
    const float *luma; /* (INPUTS, source_height, source_width) */
    Py_ssize_t source_height, source_width;
    const float *disparity; /* (PHASES, height, width), px */
    const float *offsets; /* (2, INPUTS): what disparity moves the place of sampling by, along x, then y */
    const float *moves; /* (2, INPUTS): by what it is moved anyhow, px */
    Py_ssize_t height, width, reach; /* reach: of the whole picture's first pixel from the edges of luma, px */
    float a; /* of the cubic kernel */
    float flat; /* see lfcore.alignment.FLAT */
    float most; /* px by which a disparity is changed at most */
    const float *weights; /* (TAPS), of the rows and columns around */
    float *warped; /* (2 height, INPUTS, 2 width + 2): its first and last columns stand twice */
    float *products; /* (2 height, 2, 2 width): of differences and slopes, and the squares of slopes */
    float *aligned; /* (PHASES, height, width) */
} Alignment;

PART Py_ssize_t index_of(const Alignment *to, Py_ssize_t y, Py_ssize_t x) {
    return ((2 * (y % 2) + x % 2) * to->height + y / 2) * to->width + x / 2;
}

/* Row y of the inputs warped by the disparity. */
PART void warp_luma(const Alignment *to, Py_ssize_t y) {
    const Py_ssize_t columns = 2 * to->width, stride = columns + 2;
    const Four offsets_x = four_at(to->offsets), offsets_y = four_at(to->offsets + INPUTS);
    const Four moves_x = four_at(to->moves), moves_y = four_at(to->moves + INPUTS);
    float *restrict row = to->warped + y * INPUTS * stride;
    for (Py_ssize_t x = 0; x < columns; ++x) {
        const float disparity = to->disparity[index_of(to, y, x)];
        const Places across = inner_places((float)(x + to->reach) + moves_x + offsets_x * disparity, to->source_width, to->a);
        const Places down = inner_places((float)(y + to->reach) + moves_y + offsets_y * disparity, to->source_height, to->a);
        for (int n = 0; n < INPUTS; ++n) {
            const Four taps_x = {across.taps[0][n], across.taps[1][n], across.taps[2][n], across.taps[3][n]};
            const Four taps_y = {down.taps[0][n], down.taps[1][n], down.taps[2][n], down.taps[3][n]};
            const Py_ssize_t first = (n * to->source_height + down.first[n]) * to->source_width + across.first[n];
            row[n * stride + x + 1] = sample_inside(to->luma + first, to->source_width, taps_x, taps_y);
        }
    }
    for (int n = 0; n < INPUTS; ++n) {
        row[n * stride] = row[n * stride + 1];
        row[n * stride + columns + 1] = row[n * stride + columns];
    }
}

MANY_PROCESSORS
static void warp_luma_rows(const Alignment *to, Py_ssize_t begin, Py_ssize_t end) {
    for (Py_ssize_t y = begin; y < end; ++y) warp_luma(to, y);
}

/* In row y, how the differences of the inputs from their mean and of their slopes go together. */
PART void multiply(const Alignment *to, Py_ssize_t y) {
    const Py_ssize_t columns = 2 * to->width, stride = columns + 2, rows = 2 * to->height;
    const float *restrict above = to->warped + within(y - 1, rows) * INPUTS * stride + 1;
    const float *restrict here = to->warped + y * INPUTS * stride + 1;
    const float *restrict below = to->warped + within(y + 1, rows) * INPUTS * stride + 1;
    float *restrict mixed = to->products + 2 * y * columns, *restrict squared = mixed + columns;
    float half_x[INPUTS], half_y[INPUTS];
    for (int n = 0; n < INPUTS; ++n) half_x[n] = 0.5f * to->offsets[n], half_y[n] = 0.5f * to->offsets[INPUTS + n];
    for (Py_ssize_t x = 0; x < columns; ++x) {
        float slopes[INPUTS], mean = 0.0f, slope = 0.0f, product = 0.0f, square = 0.0f;
        for (int n = 0; n < INPUTS; ++n) {
            const Py_ssize_t at = n * stride + x;
            slopes[n] = half_x[n] * (here[at + 1] - here[at - 1]) + half_y[n] * (below[at] - above[at]);
            mean += here[at];
            slope += slopes[n];
        }
        mean *= 0.25f;
        slope *= 0.25f;
        for (int n = 0; n < INPUTS; ++n) {
            product += (here[n * stride + x] - mean) * (slopes[n] - slope);
            square += (slopes[n] - slope) * (slopes[n] - slope);
        }
        mixed[x] = product;
        squared[x] = square;
    }
}

MANY_PROCESSORS
static void multiply_rows(const Alignment *to, Py_ssize_t begin, Py_ssize_t end) {
    for (Py_ssize_t y = begin; y < end; ++y) multiply(to, y);
}

/* Row y of the disparity. sums: (2, 2 width + 2 AROUND), whose first and last AROUND values are 0. */
PART void align(const Alignment *to, Py_ssize_t y, float *restrict sums) {
    const Py_ssize_t columns = 2 * to->width, stride = columns + 2 * AROUND;
    for (int part = 0; part < 2; ++part) {
        float *restrict sum = sums + part * stride + AROUND;
        memset(sum, 0, columns * sizeof(float));
        for (Py_ssize_t near = at_least(y - AROUND, 0); near <= at_most(y + AROUND, 2 * to->height - 1); ++near) {
            const float weight = to->weights[near - y + AROUND];
            const float *restrict row = to->products + (2 * near + part) * columns;
            for (Py_ssize_t x = 0; x < columns; ++x) sum[x] += weight * row[x];
        }
    }
    for (Py_ssize_t x = 0; x < columns; ++x) {
        float product = 0.0f, square = 0.0f;
        for (int k = 0; k < TAPS; ++k) {
            product += to->weights[k] * sums[x + k];
            square += to->weights[k] * sums[stride + x + k];
        }
        float step = -product / (square + to->flat);
        step = step < to->most ? step : to->most;
        step = step > -to->most ? step : -to->most;
        to->aligned[index_of(to, y, x)] = to->disparity[index_of(to, y, x)] + step;
    }
}

MANY_PROCESSORS
static int align_rows(const Alignment *to, Py_ssize_t begin, Py_ssize_t end) {
    float *sums = calloc(2 * (2 * to->width + 2 * AROUND), sizeof(float));
    if (sums == NULL) return -1;
    for (Py_ssize_t y = begin; y < end; ++y) align(to, y, sums);
    free(sums);
    return 0;
}

static int whole_alignment(const Alignment *to, int threads) {
    const Py_ssize_t rows = 2 * to->height, parts = at_most(threads * PARTS_PER_THREAD, rows);
    Shares warps, products, sums;
    share_out(&warps, parts, threads);
    share_out(&products, parts, threads);
    share_out(&sums, parts, threads);
    int failed = 0;
#pragma omp parallel num_threads(threads) reduction(| : failed)
    {
        EACH_SHARED(part, &warps) warp_luma_rows(to, rows * part / parts, rows * (part + 1) / parts);
#pragma omp barrier
        EACH_SHARED(part, &products) multiply_rows(to, rows * part / parts, rows * (part + 1) / parts);
#pragma omp barrier
        EACH_SHARED(part, &sums) failed |= align_rows(to, rows * part / parts, rows * (part + 1) / parts);
    }
    return failed;
}

PyObject *compact_align(PyObject *Py_UNUSED(module), PyObject *arguments) {
    Alignment to;
    unsigned long long luma, disparity, offsets, weights, warped, products, aligned;
    int threads;
    if (!PyArg_ParseTuple(arguments, "KKKKKKKnnnnnfffi", &luma, &disparity, &offsets, &weights, &warped, &products, &aligned,
                          &to.source_height, &to.source_width, &to.height, &to.width, &to.reach, &to.a, &to.flat, &to.most,
                          &threads))
        return NULL;
    to.luma = at_address(luma);
    to.disparity = at_address(disparity);
    to.offsets = at_address(offsets); /* the moves lie behind them */
    to.moves = to.offsets + 2 * INPUTS;
    to.weights = at_address(weights);
    to.warped = at_address(warped);
    to.products = at_address(products);
    to.aligned = at_address(aligned);
    int failed;
    Py_BEGIN_ALLOW_THREADS
    failed = whole_alignment(&to, threads);
    Py_END_ALLOW_THREADS
    if (failed) return PyErr_NoMemory();
    Py_RETURN_NONE;
}
