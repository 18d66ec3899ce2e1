/* Parts of a synthesis that torch has no fast operation for. Optional: where this is not compiled, the same is computed in torch
 * (lfcore.planesweep and lfcore.warp say what, lfcore.kernels hands it over). For gcc and clang, whose vectors it uses.
 *
 * Threads are OpenMP's. Torch has been loaded before, so that its OpenMP is found and its threads are used: others would have to
 * wait until those stop spinning.
 *
 * Nothing here knows Python's objects but the module at the end: the functions take plain arrays, whose sizes lfcore.kernels
 * has checked.
 */
#define PY_SSIZE_T_CLEAN
#include <Python.h>
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

/* One function, compiled for several generations of x86; the loader takes what the processor has. */
#if defined(__x86_64__) && defined(__linux__) && defined(__GLIBC__) && defined(__GNUC__) && !defined(__clang__) && __GNUC__ >= 11
#define MANY_PROCESSORS __attribute__((target_clones("arch=x86-64-v4", "arch=x86-64-v3", "default")))
#else
#define MANY_PROCESSORS
#endif

/* Parts of such a function must become parts of each of its versions. */
#define PART static inline __attribute__((always_inline))

#define PARTS_PER_THREAD 8
#define PIXELS_AT_ONCE 16 /* whose channels are written together: so many lines of the nearest cache */

typedef struct {
    const float *luma; /* (inputs, batch, height, width) */
    const int32_t *whole; /* (inputs, levels, 2): whole pixels of each shift along x and y */
    const float *taps; /* (inputs, levels, 2, 4): weights of the samples at -1, 0, 1, 2 past it */
    const int32_t *valid; /* (inputs, levels, 2, 2): along x and y the first place that counts, and the one past the last */
    void *out; /* (batch, rows, columns, 2 levels), the last contiguous */
    Py_ssize_t inputs, batch, height, width, levels, top, left, columns;
    Py_ssize_t out_batch, out_row, out_pixel; /* strides in values */
    int halved; /* whether `out` is bfloat16, not float32 */
} Sweep;

PART Py_ssize_t at_most(Py_ssize_t value, Py_ssize_t most) { return value < most ? value : most; }
PART Py_ssize_t at_least(Py_ssize_t value, Py_ssize_t least) { return value > least ? value : least; }
PART Py_ssize_t within(Py_ssize_t value, Py_ssize_t size) { return at_least(at_most(value, size - 1), 0); }

/* The taps along y, for `count` columns from `first` on, which may lie beyond the picture: its edge is repeated. */
PART void taps_down(const float *picture, Py_ssize_t height, Py_ssize_t width, Py_ssize_t row, const float *taps,
                    Py_ssize_t first, Py_ssize_t count, float *restrict result) {
    const float *a = picture + within(row, height) * width, *b = picture + within(row + 1, height) * width;
    const float *c = picture + within(row + 2, height) * width, *d = picture + within(row + 3, height) * width;
    const float ta = taps[0], tb = taps[1], tc = taps[2], td = taps[3];
    Py_ssize_t begin = at_most(at_least(-first, 0), count), end = at_least(at_most(width - first, count), begin);
    for (Py_ssize_t x = begin; x < end; ++x) {
        const Py_ssize_t s = first + x;
        result[x] = ta * a[s] + tb * b[s] + tc * c[s] + td * d[s];
    }
    for (Py_ssize_t x = 0; x < begin; ++x) result[x] = ta * a[0] + tb * b[0] + tc * c[0] + td * d[0];
    for (Py_ssize_t x = end; x < count; ++x)
        result[x] = ta * a[width - 1] + tb * b[width - 1] + tc * c[width - 1] + td * d[width - 1];
}

PART void taps_across(const float *restrict source, const float *taps, Py_ssize_t count, float *restrict result) {
    const float ta = taps[0], tb = taps[1], tc = taps[2], td = taps[3];
    for (Py_ssize_t x = 0; x < count; ++x)
        result[x] = ta * source[x] + tb * source[x + 1] + tc * source[x + 2] + td * source[x + 3];
}

/* Mean and deviation of one row at one level, over the inputs that count at each place. */
PART void level_row(const Sweep *sweep, Py_ssize_t k, Py_ssize_t level, Py_ssize_t y, float *restrict moved,
                    float *restrict shifted, float *restrict counted, float *restrict mean, float *restrict deviation) {
    const Py_ssize_t w = sweep->columns, left = sweep->left;
    memset(mean, 0, w * sizeof(float));
    memset(deviation, 0, w * sizeof(float));
    memset(counted, 0, w * sizeof(float));
    for (Py_ssize_t n = 0; n < sweep->inputs; ++n) {
        const Py_ssize_t place = n * sweep->levels + level;
        const int32_t *valid = sweep->valid + 4 * place, *whole = sweep->whole + 2 * place;
        const float *taps = sweep->taps + 8 * place;
        if (y < valid[2] || y >= valid[3]) continue;
        const Py_ssize_t begin = at_least(valid[0] - left, 0), end = at_most(valid[1] - left, w);
        if (end <= begin) continue;
        const float *picture = sweep->luma + (n * sweep->batch + k) * sweep->height * sweep->width;
        taps_down(picture, sweep->height, sweep->width, y + whole[1] - 1, taps + 4, left + begin + whole[0] - 1, end - begin + 3,
                  moved);
        float *restrict here = shifted + n * w;
        taps_across(moved, taps, end - begin, here + begin);
        for (Py_ssize_t x = begin; x < end; ++x) {
            mean[x] += here[x];
            counted[x] += 1.0f;
        }
    }
    for (Py_ssize_t x = 0; x < w; ++x) mean[x] /= counted[x] > 1.0f ? counted[x] : 1.0f;
    for (Py_ssize_t n = 0; n < sweep->inputs; ++n) {
        const int32_t *valid = sweep->valid + 4 * (n * sweep->levels + level);
        if (y < valid[2] || y >= valid[3]) continue;
        const Py_ssize_t begin = at_least(valid[0] - left, 0), end = at_most(valid[1] - left, w);
        const float *restrict here = shifted + n * w;
        for (Py_ssize_t x = begin; x < end; ++x) {
            const float away = here[x] - mean[x];
            deviation[x] += away * away;
        }
    }
    for (Py_ssize_t x = 0; x < w; ++x)
        deviation[x] = sqrtf(deviation[x] / (counted[x] > 2.0f ? counted[x] - 1.0f : 1.0f));
}

PART uint32_t bits_of(float value) {
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    return bits;
}

/* The upper half of a float32, rounded to the nearest, to the even one of two: bfloat16. */
PART uint32_t rounded(uint32_t bits) { return (bits + 0x7FFFu + ((bits >> 16) & 1u)) >> 16; }

/* Rows of channels (channels, w), an even number of them, to pixels of channels. */
PART void write_halved(const float *restrict rows, Py_ssize_t channels, Py_ssize_t w, uint16_t *out, Py_ssize_t pixel) {
    for (Py_ssize_t first = 0; first < w; first += PIXELS_AT_ONCE) {
        const Py_ssize_t end = at_most(first + PIXELS_AT_ONCE, w);
        for (Py_ssize_t c = 0; c < channels; c += 2) {
            const float *restrict low = rows + c * w, *restrict high = low + w;
            for (Py_ssize_t x = first; x < end; ++x) {
                const uint16_t pair[2] = {(uint16_t)rounded(bits_of(low[x])), (uint16_t)rounded(bits_of(high[x]))};
                memcpy(out + x * pixel + c, pair, sizeof pair);
            }
        }
    }
}

PART void write_whole(const float *restrict rows, Py_ssize_t channels, Py_ssize_t w, float *out, Py_ssize_t pixel) {
    for (Py_ssize_t first = 0; first < w; first += PIXELS_AT_ONCE) {
        const Py_ssize_t end = at_most(first + PIXELS_AT_ONCE, w);
        for (Py_ssize_t c = 0; c < channels; ++c)
            for (Py_ssize_t x = first; x < end; ++x) out[x * pixel + c] = rows[c * w + x];
    }
}

/* Rows `begin` to `end` of the window; 0, or -1 where there is no memory. */
MANY_PROCESSORS
static int sweep_rows(const Sweep *sweep, Py_ssize_t begin, Py_ssize_t end) {
    const Py_ssize_t w = sweep->columns, channels = 2 * sweep->levels;
    float *moved = malloc(((w + 3) + w + sweep->inputs * w + channels * w) * sizeof(float));
    if (moved == NULL) return -1;
    float *counted = moved + w + 3, *shifted = counted + w, *rows = shifted + sweep->inputs * w;
    for (Py_ssize_t k = 0; k < sweep->batch; ++k)
        for (Py_ssize_t y = begin; y < end; ++y) {
            for (Py_ssize_t level = 0; level < sweep->levels; ++level)
                level_row(sweep, k, level, sweep->top + y, moved, shifted, counted, rows + level * w,
                          rows + (sweep->levels + level) * w);
            const Py_ssize_t place = k * sweep->out_batch + y * sweep->out_row;
            if (sweep->halved)
                write_halved(rows, channels, w, (uint16_t *)sweep->out + place, sweep->out_pixel);
            else
                write_whole(rows, channels, w, (float *)sweep->out + place, sweep->out_pixel);
        }
    free(moved);
    return 0;
}

/* All rows, in parts small enough that a thread that another program holds up does not hold up all. */
static int sweep_all(const Sweep *sweep, Py_ssize_t rows, int threads) {
    const Py_ssize_t parts = at_most(threads * PARTS_PER_THREAD, rows);
    int failed = 0;
#pragma omp parallel for num_threads(threads) schedule(dynamic, 1) reduction(| : failed)
    for (Py_ssize_t part = 0; part < parts; ++part)
        failed |= sweep_rows(sweep, rows * part / parts, rows * (part + 1) / parts);
    return failed;
}

static PyObject *plane_sweep(PyObject *Py_UNUSED(module), PyObject *arguments) {
    Sweep sweep;
    unsigned long long luma, whole, taps, valid, out;
    Py_ssize_t rows;
    int threads;
    if (!PyArg_ParseTuple(arguments, "KKKKKnnnnnnnnnnnnpi", &luma, &whole, &taps, &valid, &out, &sweep.inputs, &sweep.batch,
                          &sweep.height, &sweep.width, &sweep.levels, &sweep.top, &sweep.left, &rows, &sweep.columns,
                          &sweep.out_batch, &sweep.out_row, &sweep.out_pixel, &sweep.halved, &threads))
        return NULL;
    sweep.luma = (const float *)(uintptr_t)luma;
    sweep.whole = (const int32_t *)(uintptr_t)whole;
    sweep.taps = (const float *)(uintptr_t)taps;
    sweep.valid = (const int32_t *)(uintptr_t)valid;
    sweep.out = (void *)(uintptr_t)out;
    int failed;
    Py_BEGIN_ALLOW_THREADS
    failed = sweep_all(&sweep, rows, threads);
    Py_END_ALLOW_THREADS
    if (failed) return PyErr_NoMemory();
    Py_RETURN_NONE;
}

typedef struct {
    const float *images; /* (images, channels, height, width) */
    const float *x, *y; /* (images, places): where to sample, px */
    float *out; /* (images, channels, places) */
    Py_ssize_t images_count, channels, height, width, places;
    float a; /* of the cubic kernel */
    int outside; /* whether places outside the picture give its edge, repeated; else they give 0 */
} Samples;

/* Four neighbours along a row, or what belongs to each of them. */
typedef float Four __attribute__((vector_size(16)));

PART Four four_at(const float *values) {
    Four four;
    memcpy(&four, values, sizeof four);
    return four;
}

/* Weights of the samples at -1, 0, 1, 2 around a place t in [0, 1) past sample 0 (Keys 1981): a cubic in their distances, one
 * for the outer two and one for the inner two. */
PART Four cubic_taps(float t, float a) {
    const Four distance = {1.0f + t, t, 1.0f - t, 2.0f - t};
    const Four third = {a, a + 2.0f, a + 2.0f, a}, second = {-5.0f * a, -a - 3.0f, -a - 3.0f, -5.0f * a};
    const Four first = {8.0f * a, 0.0f, 0.0f, 8.0f * a}, none = {-4.0f * a, 1.0f, 1.0f, -4.0f * a};
    return ((third * distance + second) * distance + first) * distance + none;
}

/* From two pixels beyond an edge on there is nothing but that edge. Not a number becomes the first such place. */
PART float near_picture(float place, Py_ssize_t size) {
    const float last = (float)(size + 1), bounded = place > -2.0f ? place : -2.0f;
    return bounded < last ? bounded : last;
}

PART int32_t whole_below(float place) {
    const int32_t towards_zero = (int32_t)place;
    return towards_zero - ((float)towards_zero > place);
}

PART float sample_inside(const float *place, Py_ssize_t width, Four across, const Four down) {
    const Four sum = down[0] * four_at(place) + down[1] * four_at(place + width) + down[2] * four_at(place + 2 * width) +
                     down[3] * four_at(place + 3 * width);
    const Four weighed = across * sum;
    return (weighed[0] + weighed[1]) + (weighed[2] + weighed[3]);
}

PART float sample_at_edge(const float *channel, Py_ssize_t height, Py_ssize_t width, Py_ssize_t top, Py_ssize_t left,
                          const Four across, const Four down) {
    float sum = 0.0f;
    for (int k = 0; k < 4; ++k) {
        const float *row = channel + within(top + k, height) * width;
        for (int j = 0; j < 4; ++j) sum += down[k] * across[j] * row[within(left + j, width)];
    }
    return sum;
}

MANY_PROCESSORS
static void sample_places(const Samples *s, Py_ssize_t begin, Py_ssize_t end) {
    const Py_ssize_t width = s->width, height = s->height, area = width * height;
    const float last_x = (float)(width - 1), last_y = (float)(height - 1);
    for (Py_ssize_t n = 0; n < s->images_count; ++n) {
        const float *image = s->images + n * s->channels * area;
        float *out = s->out + n * s->channels * s->places;
        for (Py_ssize_t p = begin; p < end; ++p) {
            const float x = s->x[n * s->places + p], y = s->y[n * s->places + p];
            if (!s->outside && !(x >= 0.0f && x <= last_x && y >= 0.0f && y <= last_y)) {
                for (Py_ssize_t c = 0; c < s->channels; ++c) out[c * s->places + p] = 0.0f;
                continue;
            }
            const float near_x = near_picture(x, width), near_y = near_picture(y, height);
            const int32_t whole_x = whole_below(near_x), whole_y = whole_below(near_y);
            const Py_ssize_t left = whole_x - 1, top = whole_y - 1;
            const Four across = cubic_taps(near_x - (float)whole_x, s->a), down = cubic_taps(near_y - (float)whole_y, s->a);
            if (left >= 0 && top >= 0 && left + 4 <= width && top + 4 <= height)
                for (Py_ssize_t c = 0; c < s->channels; ++c)
                    out[c * s->places + p] = sample_inside(image + c * area + top * width + left, width, across, down);
            else
                for (Py_ssize_t c = 0; c < s->channels; ++c)
                    out[c * s->places + p] = sample_at_edge(image + c * area, height, width, top, left, across, down);
        }
    }
}

static void sample_all(const Samples *samples, int threads) {
    const Py_ssize_t places = samples->places, parts = at_most(threads * PARTS_PER_THREAD, places);
#pragma omp parallel for num_threads(threads) schedule(dynamic, 1)
    for (Py_ssize_t part = 0; part < parts; ++part)
        sample_places(samples, places * part / parts, places * (part + 1) / parts);
}

static PyObject *cubic_sample(PyObject *Py_UNUSED(module), PyObject *arguments) {
    Samples samples;
    unsigned long long images, x, y, out;
    int threads;
    if (!PyArg_ParseTuple(arguments, "KKKKnnnnnfpi", &images, &x, &y, &out, &samples.images_count, &samples.channels,
                          &samples.height, &samples.width, &samples.places, &samples.a, &samples.outside, &threads))
        return NULL;
    samples.images = (const float *)(uintptr_t)images;
    samples.x = (const float *)(uintptr_t)x;
    samples.y = (const float *)(uintptr_t)y;
    samples.out = (float *)(uintptr_t)out;
    Py_BEGIN_ALLOW_THREADS
    sample_all(&samples, threads);
    Py_END_ALLOW_THREADS
    Py_RETURN_NONE;
}

static PyMethodDef methods[] = {
    {"cubic_sample", cubic_sample, METH_VARARGS, "Places of a cubic interpolation, see lfcore.kernels."},
    {"plane_sweep", plane_sweep, METH_VARARGS, "Rows of a plane sweep, see lfcore.kernels."},
    {NULL, NULL, 0, NULL},
};

static struct PyModuleDef definition = {PyModuleDef_HEAD_INIT, "lfcore._kernels", NULL, 0, methods, NULL, NULL, NULL, NULL};

PyMODINIT_FUNC PyInit__kernels(void) { return PyModule_Create(&definition); }
