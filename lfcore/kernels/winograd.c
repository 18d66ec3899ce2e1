/* Convolution with 3 x 3 kernels by Winograd's transforms F(4 x 4, 3 x 3) (Lavin and Gray 2016); lfcore.winograd says more.
 *
 * For processors whose registers hold eight values (AVX2): eight channels lie in the lanes of a register, so that the transforms
 * are plain arithmetic on registers. Threads take blocks of tiles, small enough that what is between the transforms stays in the
 * nearest caches.
 */
#include "tiled.h"

#define SIZE 6 /* of a tile, px */
#define STEP 4 /* of its result */
#define PLACES (SIZE * SIZE)
#define TILES 24 /* of a block: a multiple of ROWS */
#define ROWS 6 /* tiles that are multiplied at once: with two registers each, sums fill twelve of sixteen registers */
#define LANES 8
#define COLUMNS (2 * LANES) /* outputs that are multiplied at once */

typedef struct {
    Tiling tiling; /* of the result */
    const float *in; /* (height, width, channels) */
    Py_ssize_t height, width, channels;
    Py_ssize_t padding; /* px of zeros around it */
    int of_positive; /* whether negative values of it count as 0 */
    const float *weights; /* (PLACES, groups, channels, COLUMNS): of the outputs, filled up with zeros */
    Py_ssize_t groups;
    const float *bias; /* (outputs) */
    const float *added; /* to the result, a picture like it, or NULL */
    float *out; /* (result height, result width, outputs) */
    Py_ssize_t outputs;
    int positive; /* whether negative values of the result become 0 */
} Winograd;

PART Eight not_negative(Eight values) {
    const Eight none = {0.0f};
    return (Eight)((EightWhole)values & (EightWhole)(values > none));
}

/* The transform of six samples, in place. */
PART void six(Eight *x) {
    const Eight near = x[4] - 4.0f * x[2], far = x[3] - 4.0f * x[1], half = x[4] - x[2], twice = 2.0f * (x[3] - x[1]);
    x[0] = 4.0f * x[0] - 5.0f * x[2] + x[4];
    x[5] = 4.0f * x[1] - 5.0f * x[3] + x[5];
    x[1] = near + far, x[2] = near - far;
    x[3] = half + twice, x[4] = half - twice;
}

/* The transform of six products back to four samples, which come first. */
PART void four(Eight *x) {
    const Eight sum = x[1] + x[2], difference = x[1] - x[2], outer_sum = x[3] + x[4], outer = x[3] - x[4];
    x[0] = x[0] + sum + outer_sum;
    x[1] = difference + 2.0f * outer;
    x[2] = sum + 4.0f * outer_sum;
    x[3] = difference + 8.0f * outer + x[5];
}

/* Floats from one of the places of a tile to the next, `least` or more: an odd number of cache lines, so that they do not all
 * fall on the same places of a cache. */
PART Py_ssize_t spaced(Py_ssize_t least) { return 16 * ((least + 15) / 16 | 1); }
PART Py_ssize_t inputs_of_a_place(const Winograd *w) { return spaced(TILES * w->channels); }
PART Py_ssize_t products_of_a_place(const Winograd *w) { return spaced(TILES * w->groups * COLUMNS); }

PART void read_row(const Winograd *w, Place at, int y, Py_ssize_t channel, Eight *out) {
    const Py_ssize_t d = w->tiling.dilation, row = at.top - w->padding + y * d, left = at.left - w->padding;
    const float *pixel = w->in + (row * w->width + left) * w->channels + channel;
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
        six(work[y]);
    }
    for (int x = 0; x < SIZE; ++x) {
        for (int y = 0; y < SIZE; ++y) lane[y] = work[y][x];
        six(lane);
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
        four(lane);
        for (int y = 0; y < STEP; ++y) work[y][x] = lane[y];
    }
    const Eight bias = eight_at(w->bias + channel);
    const Py_ssize_t rows = pixels_within(t, at.top, t->height), columns = pixels_within(t, at.left, t->width);
    for (Py_ssize_t y = 0; y < rows; ++y) {
        four(work[y]);
        for (Py_ssize_t x = 0; x < columns; ++x) {
            const Py_ssize_t pixel = (at.top + y * t->dilation) * t->width + at.left + x * t->dilation;
            Eight value = work[y][x] + bias;
            if (w->added != NULL) value += eight_at(w->added + pixel * w->outputs + channel);
            if (w->positive) value = not_negative(value);
            memcpy(w->out + pixel * w->outputs + channel, &value, sizeof value);
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
        multiply(w, inputs + place * inputs_of_a_place(w), w->weights + place * weights, products + place * products_of_a_place(w));
    for (Py_ssize_t tile = 0; tile < tiles; ++tile)
        EACH_GROUP(channel, w->outputs, LANES)
            transform_back(w, places[tile], channel, products + tile * w->groups * COLUMNS);
}

static int convolve(const Winograd *w, int threads) {
    const Py_ssize_t tiles = tile_count(&w->tiling);
    int failed = 0;
#pragma omp parallel num_threads(threads) reduction(| : failed)
    {
        /* Zeros, for a block that is not full has rows that nobody sets. */
        float *inputs = calloc(PLACES * inputs_of_a_place(w), sizeof(float));
        float *products = malloc(PLACES * products_of_a_place(w) * sizeof(float));
        failed = inputs == NULL || products == NULL;
#pragma omp for schedule(dynamic, 1)
        for (Py_ssize_t first = 0; first < tiles; first += TILES)
            if (!failed) convolve_block(w, first, at_most(TILES, tiles - first), inputs, products);
        free(inputs);
        free(products);
    }
    return failed;
}

PyObject *winograd_convolution(PyObject *Py_UNUSED(module), PyObject *arguments) {
    Winograd w = {.tiling = {.step = STEP}};
    Tiling *t = &w.tiling;
    unsigned long long in, weights, bias, added, out;
    int threads;
    if (!PyArg_ParseTuple(arguments, "KKKKKnnnnnnnnnppi", &in, &weights, &bias, &added, &out, &w.height, &w.width, &w.channels,
                          &w.padding, &w.groups, &w.outputs, &t->height, &t->width, &t->dilation, &w.of_positive, &w.positive,
                          &threads))
        return NULL;
    w.in = at_address(in);
    w.weights = at_address(weights);
    w.bias = at_address(bias);
    w.added = at_address(added);
    w.out = at_address(out);
    int failed;
    Py_BEGIN_ALLOW_THREADS
    failed = convolve(&w, threads);
    Py_END_ALLOW_THREADS
    if (failed) return PyErr_NoMemory();
    Py_RETURN_NONE;
}
