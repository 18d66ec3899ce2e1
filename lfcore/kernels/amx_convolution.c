/* Convolution by the matrix unit (amx.h): sixteen neighbouring pixels are the rows of a block, and the channels under a kernel
 * its values, where they lie. Threads take bands of rows, of which each first copies what it reads, with zeros around. */
#include "amx.h"

#ifdef AMX_COMPILED

typedef struct {
    const uint16_t *in; /* (height, width, channels) */
    Py_ssize_t height, width, channels;
    Py_ssize_t kernel, stride, padding, dilation; /* px along both axes; px of zeros around the picture */
    int of_positive; /* whether negative values of the picture count as 0 */
    const char *packed; /* (groups, pieces, 16, COLUMNS, 2) */
    const float *bias; /* (groups * COLUMNS) */
    const uint16_t *added; /* to the result, a picture like it, or NULL */
    uint16_t *out; /* (result height, result width, outputs) */
    Py_ssize_t result_height, result_width, outputs;
    int positive; /* whether negative values of the result become 0 */
    Py_ssize_t band; /* rows of the result that are computed together */
} Convolution;

#define CACHE_LINE 64
#define BAND_BYTES (512 * 1024) /* of what a band reads: it should stay in a core's second cache */

/* Values of a row of the copy: as far as the last block reaches, which may end beyond the result. */
PART Py_ssize_t values_of_row(const Convolution *c) {
    const Py_ssize_t blocks = (c->result_width + ROWS - 1) / ROWS, last = (blocks * ROWS - 1) * c->stride;
    const Py_ssize_t pixels = at_least(last + (c->kernel - 1) * c->dilation + 1, c->width + 2 * c->padding);
    return (pixels * c->channels + PIECE - 1) / PIECE * PIECE;
}

PART Py_ssize_t rows_of_band(const Convolution *c, Py_ssize_t band) {
    return (band - 1) * c->stride + (c->kernel - 1) * c->dilation + 1;
}

/* At most as many rows as fit into the cache, so that each thread has equally many bands, and more than one. */
PART Py_ssize_t best_band(const Convolution *c, int threads) {
    const Py_ssize_t fitting = BAND_BYTES / (2 * values_of_row(c)) - (c->kernel - 1) * c->dilation - 1;
    const Py_ssize_t most = at_least(fitting / c->stride + 1, 1), height = c->result_height;
    const Py_ssize_t of_thread = at_least((height + most * threads - 1) / (most * threads), 2);
    return (height + of_thread * threads - 1) / (of_thread * threads);
}

HALVED_PART void copy_values(const uint16_t *in, Py_ssize_t count, int of_positive, uint16_t *out) {
    if (!of_positive) {
        memcpy(out, in, count * sizeof *in);
        return;
    }
    Py_ssize_t value = 0;
    /* Their first bit is the sign, as that of whole numbers. */
    for (; value + 32 <= count; value += 32)
        _mm512_storeu_si512(out + value, _mm512_max_epi16(_mm512_loadu_si512(in + value), _mm512_setzero_si512()));
    for (; value < count; ++value) out[value] = in[value] & 0x8000 ? 0 : in[value];
}

/* The rows that the result's rows from `first` on need, with zeros beside the picture. */
HALVED_PART void copy_band(const Convolution *c, Py_ssize_t first, Py_ssize_t band, uint16_t *copy) {
    const Py_ssize_t of_row = c->width * c->channels;
    for (Py_ssize_t row = 0; row < rows_of_band(c, band); ++row) {
        uint16_t *out = copy + row * values_of_row(c);
        const Py_ssize_t from = first * c->stride + row - c->padding;
        if (from < 0 || from >= c->height) {
            memset(out, 0, values_of_row(c) * sizeof *out);
            continue;
        }
        const Py_ssize_t left = c->padding * c->channels;
        memset(out, 0, left * sizeof *out);
        copy_values(c->in + from * of_row, of_row, c->of_positive, out + left);
        memset(out + left + of_row, 0, (values_of_row(c) - left - of_row) * sizeof *out);
    }
}

__attribute__((target(AMX))) static void convolve_band(
    const Convolution *c, const Pieces *pieces, Py_ssize_t first, Py_ssize_t rows, uint16_t *copy) {
    copy_band(c, first, rows, copy);
    const Blocks blocks = {(const char *)copy, (c->result_width + ROWS - 1) / ROWS, rows, ROWS * c->stride * c->channels * 2,
                           c->stride * values_of_row(c) * 2};
    const Py_ssize_t place = first * c->result_width * c->outputs;
    const uint16_t *added = c->added == NULL ? NULL : c->added + place;
    const Result result = {c->out + place, NULL, c->result_width, c->outputs, added, c->positive};
    multiply_blocks(&blocks, pieces, c->packed, c->bias, &result);
}

#define MOST_PIECES 512 /* AMX_MOST_PIECES in __init__.py */

/* Kernels without gaps have the values of a row of pixels side by side; else each pixel's are taken by themselves. */
static Py_ssize_t find_pieces(const Convolution *c, Py_ssize_t offsets[MOST_PIECES]) {
    const Py_ssize_t runs = c->dilation == 1 ? 1 : c->kernel, run = c->kernel / runs * c->channels;
    Py_ssize_t count = 0;
    for (Py_ssize_t y = 0; y < c->kernel; ++y)
        for (Py_ssize_t x = 0; x < runs; ++x)
            for (Py_ssize_t value = 0; value < run && count < MOST_PIECES; value += PIECE)
                offsets[count++] = 2 * (y * c->dilation * values_of_row(c) + x * c->dilation * c->channels + value);
    return count;
}

static int convolve(const Convolution *c, int threads) {
    Py_ssize_t offsets[MOST_PIECES];
    const Pieces pieces = {c->stride * c->channels * 2, offsets, find_pieces(c, offsets)};
    Shares bands;
    share_out(&bands, (c->result_height + c->band - 1) / c->band, threads);
    int failed = 0;
#pragma omp parallel num_threads(threads) reduction(| : failed)
    {
        /* With zeros at the end for what the last piece reads beyond the last pixel. */
        const Py_ssize_t values = rows_of_band(c, c->band) * values_of_row(c);
        uint16_t *copy = aligned_alloc(CACHE_LINE, (values + PIECE) * sizeof *copy);
        failed |= copy == NULL;
        if (!failed) memset(copy + values, 0, PIECE * sizeof *copy);
        TileShapes before;
        begin_tiles(&before);
        EACH_SHARED(index, &bands) {
            const Py_ssize_t first = index * c->band;
            if (!failed) convolve_band(c, &pieces, first, at_most(c->band, c->result_height - first), copy);
        }
        end_tiles(&before);
        free(copy);
    }
    return failed;
}

PyObject *amx_convolution(PyObject *Py_UNUSED(module), PyObject *arguments) {
    Convolution c = {0};
    unsigned long long in, packed, bias, added, out;
    int threads;
    if (!PyArg_ParseTuple(arguments, "KKKKKnnnnnnnnnnppi", &in, &packed, &bias, &added, &out, &c.height, &c.width, &c.channels,
                          &c.kernel, &c.stride, &c.padding, &c.dilation, &c.outputs, &c.result_height,
                          &c.result_width, &c.of_positive, &c.positive, &threads))
        return NULL;
    c.in = at_address(in);
    c.packed = at_address(packed);
    c.bias = at_address(bias);
    c.added = at_address(added);
    c.out = at_address(out);
    c.band = best_band(&c, threads);
    int failed;
    Py_BEGIN_ALLOW_THREADS
    failed = convolve(&c, threads);
    Py_END_ALLOW_THREADS
    if (failed) return PyErr_NoMemory();
    Py_RETURN_NONE;
}

#else

PyObject *amx_convolution(PyObject *Py_UNUSED(module), PyObject *Py_UNUSED(arguments)) { Py_RETURN_NOTIMPLEMENTED; }

#endif
