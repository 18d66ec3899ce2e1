/* winograd.h in float32, for processors whose registers hold eight values (AVX2). */
#include "winograd.h"

#define ROWS 6 /* tiles that are multiplied at once: with two registers each, sums fill twelve of sixteen registers */
#define LANES 8

/* Floats from one of the places of a tile to the next. */
PART Py_ssize_t inputs_of_a_place(const Winograd *w) { return spaced(TILES * w->channels * 4) / 4; }
PART Py_ssize_t products_of_a_place(const Winograd *w) { return spaced(TILES * w->groups * COLUMNS * 4) / 4; }

PART Eight not_negative(Eight values) {
    const Eight none = {0.0f};
    return (Eight)((EightWhole)values & (EightWhole)(values > none));
}

PART void read_row(const Winograd *w, Place at, int y, Py_ssize_t channel, Eight *out) {
    const Py_ssize_t d = w->tiling.dilation, row = at.top - w->padding + y * d, left = at.left - w->padding;
    const float *pixel = (const float *)w->in + (row * w->width + left) * w->channels + channel;
    const int inside = row >= 0 && row < w->height;
    if (inside && left >= 0 && left + (SIZE - 1) * d < w->width)
        for (int x = 0; x < SIZE; ++x) out[x] = eight_at(pixel + x * d * w->channels);
    else
        for (int x = 0; x < SIZE; ++x) {
            const Py_ssize_t column = left + x * d;
            out[x] = (Eight){0.0f};
            if (inside && column >= 0 && column < w->width) out[x] = eight_at(pixel + x * d * w->channels);
        }
    if (w->of_positive)
        for (int x = 0; x < SIZE; ++x) out[x] = not_negative(out[x]);
}

PART void transform(const Winograd *w, Place at, Py_ssize_t channel, float *restrict inputs) {
    Eight work[SIZE][SIZE], lane[SIZE];
    const Py_ssize_t place = inputs_of_a_place(w);
    for (int y = 0; y < SIZE; ++y) {
        read_row(w, at, y, channel, work[y]);
        FORWARD(work[y]);
    }
    for (int x = 0; x < SIZE; ++x) {
        for (int y = 0; y < SIZE; ++y) lane[y] = work[y][x];
        FORWARD(lane);
        for (int y = 0; y < SIZE; ++y) memcpy(inputs + (y * SIZE + x) * place + channel, &lane[y], sizeof lane[y]);
    }
}

PART void multiply(const Winograd *w, const float *restrict inputs, const float *restrict weights, float *restrict products) {
    const Py_ssize_t channels = w->channels, outputs = w->groups * COLUMNS;
    for (Py_ssize_t group = 0; group < w->groups; ++group)
        for (int tile = 0; tile < TILES; tile += ROWS) {
            const float *restrict of_group = weights + group * channels * COLUMNS, *restrict rows = inputs + tile * channels;
            Eight low[ROWS], high[ROWS];
            for (int i = 0; i < ROWS; ++i) low[i] = high[i] = (Eight){0.0f};
            for (Py_ssize_t channel = 0; channel < channels; ++channel) {
                const Eight first = eight_at(of_group + channel * COLUMNS), second = eight_at(of_group + channel * COLUMNS + LANES);
                for (int i = 0; i < ROWS; ++i) {
                    low[i] += first * rows[i * channels + channel];
                    high[i] += second * rows[i * channels + channel];
                }
            }
            for (int i = 0; i < ROWS; ++i) {
                float *own = products + (tile + i) * outputs + group * COLUMNS;
                memcpy(own, &low[i], sizeof low[i]);
                memcpy(own + LANES, &high[i], sizeof high[i]);
            }
        }
}

PART void transform_back(const Winograd *w, Place at, Py_ssize_t channel, const float *restrict products) {
    Eight work[STEP][SIZE], lane[SIZE];
    const Tiling *t = &w->tiling;
    const Py_ssize_t place = products_of_a_place(w);
    for (int x = 0; x < SIZE; ++x) {
        for (int y = 0; y < SIZE; ++y) lane[y] = eight_at(products + (y * SIZE + x) * place + channel);
        BACK(lane);
        for (int y = 0; y < STEP; ++y) work[y][x] = lane[y];
    }
    const Eight bias = eight_at(w->bias + channel);
    const Py_ssize_t rows = pixels_within(t, at.top, t->height), columns = pixels_within(t, at.left, t->width);
    for (Py_ssize_t y = 0; y < rows; ++y) {
        BACK(work[y]);
        for (Py_ssize_t x = 0; x < columns; ++x) {
            const Py_ssize_t pixel = (at.top + y * t->dilation) * t->width + at.left + x * t->dilation;
            const Py_ssize_t first = pixel * w->outputs + channel;
            Eight value = work[y][x] + bias;
            if (w->added != NULL) value += eight_at((const float *)w->added + first);
            if (w->positive) value = not_negative(value);
            memcpy((float *)w->out + first, &value, sizeof value);
        }
    }
}

MANY_PROCESSORS
static void convolve_block(const Winograd *w, Py_ssize_t first, Py_ssize_t tiles, float *inputs, float *products) {
    Place places[TILES];
    for (Py_ssize_t tile = 0; tile < tiles; ++tile) {
        places[tile] = tile_place(&w->tiling, first + tile);
        EACH_GROUP(channel, w->channels, LANES) transform(w, places[tile], channel, inputs + tile * w->channels);
    }
    const Py_ssize_t weights = w->groups * w->channels * COLUMNS;
    for (int place = 0; place < PLACES; ++place)
        multiply(w, inputs + place * inputs_of_a_place(w), (const float *)w->weights + place * weights,
                 products + place * products_of_a_place(w));
    for (Py_ssize_t tile = 0; tile < tiles; ++tile)
        EACH_GROUP(channel, w->outputs, LANES)
            transform_back(w, places[tile], channel, products + tile * w->groups * COLUMNS);
}

static int in_floats(const Winograd *w, int threads) {
    const Py_ssize_t tiles = tile_count(&w->tiling);
    Shares blocks;
    share_out(&blocks, (tiles + TILES - 1) / TILES, threads);
    int failed = 0;
#pragma omp parallel num_threads(threads) reduction(| : failed)
    {
        /* Zeros, for a block that is not full has rows that nobody sets. */
        float *inputs = calloc(PLACES * inputs_of_a_place(w), sizeof(float));
        float *products = malloc(PLACES * products_of_a_place(w) * sizeof(float));
        failed = inputs == NULL || products == NULL;
        EACH_SHARED(block, &blocks)
            if (!failed) convolve_block(w, block * TILES, at_most(TILES, tiles - block * TILES), inputs, products);
        free(inputs);
        free(products);
    }
    return failed;
}

PyObject *winograd_convolution(PyObject *Py_UNUSED(module), PyObject *arguments) {
    Winograd w = {.tiling = {.step = STEP}};
    Tiling *t = &w.tiling;
    unsigned long long in, weights, bias, added, out;
    int halved, threads;
    if (!PyArg_ParseTuple(arguments, "KKKKKnnnnnnnnnpppi", &in, &weights, &bias, &added, &out, &w.height, &w.width, &w.channels,
                          &w.padding, &w.groups, &w.outputs, &t->height, &t->width, &t->dilation, &w.of_positive, &w.positive,
                          &halved, &threads))
        return NULL;
    w.in = at_address(in);
    w.weights = at_address(weights);
    w.bias = at_address(bias);
    w.added = at_address(added);
    w.out = at_address(out);
    int failed;
    Py_BEGIN_ALLOW_THREADS
    failed = halved ? winograd_in_halves(&w, threads) : in_floats(&w, threads);
    Py_END_ALLOW_THREADS
    if (failed) return PyErr_NoMemory();
    Py_RETURN_NONE;
}
