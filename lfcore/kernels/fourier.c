/* Fourier transforms of tiles of 16 x 16 pixels, and back, for lfcore.fourier, which multiplies between them.
 *
 * Sixteen channels lie in the lanes of a register, so that the transforms are plain arithmetic on registers.
 */
#include "shares.h"
#include "tiled.h"

#define LANES 16
#define SIZE 16 /* of a tile, px */

/* As wide as the widest registers, which plain arithmetic gains from. */
typedef float Sixteen __attribute__((vector_size(4 * LANES)));

PART Sixteen sixteen_at(const float *values) {
    Sixteen sixteen;
    memcpy(&sixteen, values, sizeof sixteen);
    return sixteen;
}

/* Of the angles 2 pi n / 16. */
static const float COSINES[10] = {1.0f,           0.92387953251f,  0.70710678119f,  0.38268343236f, 0.0f,
                                  -0.38268343236f, -0.70710678119f, -0.92387953251f, -1.0f,          -0.92387953251f};
static const float SINES[10] = {0.0f,           0.38268343236f, 0.70710678119f, 0.92387953251f, 1.0f,
                                0.92387953251f, 0.70710678119f, 0.38268343236f, 0.0f,           -0.38268343236f};

/* Transform of four complex numbers, in place. The inverse, here and below: with re and im exchanged. */
PART void four(Sixteen *re, Sixteen *im, int a, int b, int c, int d) {
    const Sixteen r0 = re[a] + re[c], r1 = re[a] - re[c], r2 = re[b] + re[d], r3 = re[b] - re[d];
    const Sixteen i0 = im[a] + im[c], i1 = im[a] - im[c], i2 = im[b] + im[d], i3 = im[b] - im[d];
    re[a] = r0 + r2, im[a] = i0 + i2;
    re[b] = r1 + i3, im[b] = i1 - r3;
    re[c] = r0 - r2, im[c] = i0 - i2;
    re[d] = r1 - i3, im[d] = i1 + r3;
}

/* Times exp(-i angle). */
PART void turn(Sixteen *re, Sixteen *im, float cosine, float sine) {
    const Sixteen r = *re, i = *im;
    *re = r * cosine + i * sine;
    *im = i * cosine - r * sine;
}

/* Transform of 16 complex numbers, in place: frequency k comes out at PLACE(k). */
#define PLACE(k) (4 * ((k) % 4) + (k) / 4)
PART void sixteen_complex(Sixteen *re, Sixteen *im) {
    for (int n = 0; n < 4; ++n) four(re, im, n, n + 4, n + 8, n + 12);
    for (int n = 1; n < 4; ++n)
        for (int k = 1; k < 4; ++k) turn(re + n + 4 * k, im + n + 4 * k, COSINES[n * k], SINES[n * k]);
    for (int k = 0; k < 4; ++k) four(re, im, 4 * k, 4 * k + 1, 4 * k + 2, 4 * k + 3);
}

/* Transform of 16 real numbers, in place: frequencies 0 and 8, which are real, come out at 0 and 1, frequency k between them at
 * 2 k and 2 k + 1. The even ones are those of 8 real numbers, x(n) + x(n + 8); the odd ones, with x(n) - x(n + 8), those of 4
 * complex ones. The former likewise. */
PART void sixteen_real(Sixteen *x) {
    Sixteen re[4], im[4], sums[8], sums_of_four[4];
    for (int n = 0; n < 4; ++n) {
        re[n] = x[n] - x[n + 8], im[n] = x[n + 12] - x[n + 4];
        turn(re + n, im + n, COSINES[n], SINES[n]);
    }
    for (int n = 0; n < 8; ++n) sums[n] = x[n] + x[n + 8];
    four(re, im, 0, 1, 2, 3); /* frequencies 1, 5, 9, 13; the last two are those of 7 and 3, conjugated */
    x[2] = re[0], x[3] = im[0], x[10] = re[1], x[11] = im[1];
    x[14] = re[2], x[15] = -im[2], x[6] = re[3], x[7] = -im[3];
    const Sixteen r0 = sums[0] - sums[4], i0 = sums[6] - sums[2];
    Sixteen r1 = sums[1] - sums[5], i1 = sums[7] - sums[3];
    turn(&r1, &i1, COSINES[2], SINES[2]);
    x[4] = r0 + r1, x[5] = i0 + i1, x[12] = r0 - r1, x[13] = i1 - i0; /* 2, and 6 as 10 conjugated */
    for (int n = 0; n < 4; ++n) sums_of_four[n] = sums[n] + sums[n + 4];
    const Sixteen even = sums_of_four[0] + sums_of_four[2], odd = sums_of_four[1] + sums_of_four[3];
    x[8] = sums_of_four[0] - sums_of_four[2], x[9] = sums_of_four[3] - sums_of_four[1];
    x[0] = even + odd, x[1] = even - odd;
}

/* The inverse of `sixteen_real`, times 16. */
PART void real_sixteen(Sixteen *x) {
    Sixteen re[4] = {x[2], x[10], x[14], x[6]}, im[4] = {x[3], x[11], -x[15], -x[7]};
    four(im, re, 0, 1, 2, 3);
    for (int n = 0; n < 4; ++n) turn(im + n, re + n, 2.0f * COSINES[n], 2.0f * SINES[n]);
    const Sixteen r0 = 2.0f * (x[4] + x[12]), i0 = 2.0f * (x[5] - x[13]);
    Sixteen r1 = x[4] - x[12], i1 = x[5] + x[13];
    turn(&i1, &r1, 2.0f * COSINES[2], 2.0f * SINES[2]);
    const Sixteen low = x[0] + x[1], high = x[0] - x[1], r = 2.0f * x[8], i = 2.0f * x[9];
    const Sixteen fours[4] = {low + r, high - i, low - r, high + i}, eights[4] = {r0, r1, -i0, -i1};
    for (int n = 0; n < 4; ++n) {
        const Sixteen first = fours[n] + eights[n], second = fours[n] - eights[n];
        x[n] = first + re[n], x[n + 8] = first - re[n];
        x[n + 4] = second - im[n], x[n + 12] = second + im[n];
    }
}

/* Frequencies of a tile: of columns 1 to 7 all 16; then 1 to 8 of column 0, and 0 to 8 of column 8, which are those of real
 * numbers. What is left is the sum of all pixels, kept by itself. */
#define FIRST_EDGE (7 * SIZE)
#define LAST_EDGE (FIRST_EDGE + 8)
#define FREQUENCIES (LAST_EDGE + 9)

typedef struct {
    Tiling tiling; /* of the result */
    void *pixels; /* (height, width, channels): what is convolved, or the result, which is rectified */
    int halved; /* whether pixels and spectra are bfloat16; else float32 */
    Py_ssize_t height, width, channels;
    void *spectra; /* (FREQUENCIES, tiles, 2 channels): real, then imaginary parts */
    float *sums; /* (tiles, channels): frequency 0, which is large, and in bfloat16 would lose most */
    const float *bias; /* (channels); backward only */
    Py_ssize_t first, tiles; /* of the tiles */
} Fourier;

typedef uint32_t SixteenBits __attribute__((vector_size(4 * LANES)));
typedef uint16_t SixteenHalves __attribute__((vector_size(2 * LANES)));

PART Sixteen read_sixteen(const void *values, Py_ssize_t place, int halved) {
    if (!halved) return sixteen_at((const float *)values + place);
    SixteenHalves halves;
    memcpy(&halves, (const uint16_t *)values + place, sizeof halves);
    return (Sixteen)(__builtin_convertvector(halves, SixteenBits) << 16);
}

PART void write_sixteen(Sixteen values, void *out, Py_ssize_t place, int halved) {
    if (halved) {
        const SixteenBits bits = (SixteenBits)values;
        const SixteenHalves halves = __builtin_convertvector((bits + 0x7FFFu + ((bits >> 16) & 1u)) >> 16, SixteenHalves);
        memcpy((uint16_t *)out + place, &halves, sizeof halves);
    } else {
        memcpy((float *)out + place, &values, sizeof values);
    }
}

/* Row y of a tile: zeros beyond the picture. */
PART void read_row(const Fourier *f, Place at, int y, Py_ssize_t channel, Sixteen *out) {
    const Py_ssize_t row = at.top + y, place = (row * f->width + at.left) * f->channels + channel;
    const Py_ssize_t columns = row < f->height ? at_most(SIZE, f->width - at.left) : 0;
    for (Py_ssize_t x = 0; x < columns; ++x) out[x] = read_sixteen(f->pixels, place + x * f->channels, f->halved);
    for (Py_ssize_t x = columns; x < SIZE; ++x) out[x] = (Sixteen){0.0f};
}

PART Py_ssize_t spectrum_place(const Fourier *f, Py_ssize_t frequency, Py_ssize_t tile) {
    return (frequency * f->tiles + tile) * 2 * f->channels;
}

PART void put(const Fourier *f, Py_ssize_t place, Sixteen re, Sixteen im) {
    write_sixteen(re, f->spectra, place, f->halved);
    write_sixteen(im, f->spectra, place + f->channels, f->halved);
}

PART Sixteen spectrum_at(const Fourier *f, Py_ssize_t place) {
    return read_sixteen(f->spectra, place, f->halved);
}

PART void forward_channels(const Fourier *f, Py_ssize_t tile, Place at, Py_ssize_t channel) {
    Sixteen work[SIZE][SIZE], re[SIZE], im[SIZE];
    const Sixteen none = {0.0f};
    for (int y = 0; y < SIZE; ++y) {
        read_row(f, at, y, channel, work[y]);
        sixteen_real(work[y]);
    }
    const Py_ssize_t next = spectrum_place(f, 1, 0), own = spectrum_place(f, 0, tile) + channel;
    for (int k = 1; k < 8; ++k) {
        for (int y = 0; y < SIZE; ++y) re[y] = work[y][2 * k], im[y] = work[y][2 * k + 1];
        sixteen_complex(re, im);
        for (int y = 0; y < SIZE; ++y) put(f, own + ((k - 1) * SIZE + y) * next, re[PLACE(y)], im[PLACE(y)]);
    }
    for (int y = 0; y < SIZE; ++y) re[y] = work[y][0], im[y] = work[y][1];
    sixteen_real(re);
    sixteen_real(im);
    memcpy(f->sums + tile * f->channels + channel, &re[0], sizeof re[0]);
    put(f, own + (LAST_EDGE + 0) * next, im[0], none);
    put(f, own + (FIRST_EDGE + 7) * next, re[1], none);
    put(f, own + (LAST_EDGE + 8) * next, im[1], none);
    for (int k = 1; k < 8; ++k) {
        put(f, own + (FIRST_EDGE + k - 1) * next, re[2 * k], re[2 * k + 1]);
        put(f, own + (LAST_EDGE + k) * next, im[2 * k], im[2 * k + 1]);
    }
}

/* From sums over the channels that were read: their pixels, with the bias, rectified. */
PART void backward_channels(const Fourier *f, Py_ssize_t tile, Place at, Py_ssize_t channel) {
    Sixteen work[SIZE][SIZE], re[SIZE], im[SIZE];
    const Py_ssize_t next = spectrum_place(f, 1, 0), own = spectrum_place(f, 0, tile) + channel;
    for (int k = 1; k < 8; ++k) {
        for (int y = 0; y < SIZE; ++y) {
            const Py_ssize_t place = own + ((k - 1) * SIZE + y) * next;
            re[y] = spectrum_at(f, place), im[y] = spectrum_at(f, place + f->channels);
        }
        sixteen_complex(im, re);
        for (int y = 0; y < SIZE; ++y) work[y][2 * k] = re[PLACE(y)], work[y][2 * k + 1] = im[PLACE(y)];
    }
    re[0] = sixteen_at(f->sums + tile * f->channels + channel), im[0] = spectrum_at(f, own + LAST_EDGE * next);
    re[1] = spectrum_at(f, own + (FIRST_EDGE + 7) * next), im[1] = spectrum_at(f, own + (LAST_EDGE + 8) * next);
    for (int k = 1; k < 8; ++k) {
        const Py_ssize_t first = own + (FIRST_EDGE + k - 1) * next, last = own + (LAST_EDGE + k) * next;
        re[2 * k] = spectrum_at(f, first), re[2 * k + 1] = spectrum_at(f, first + f->channels);
        im[2 * k] = spectrum_at(f, last), im[2 * k + 1] = spectrum_at(f, last + f->channels);
    }
    real_sixteen(re);
    real_sixteen(im);
    for (int y = 0; y < SIZE; ++y) work[y][0] = re[y], work[y][1] = im[y];
    const Sixteen bias = sixteen_at(f->bias + channel), none = {0.0f};
    const Py_ssize_t rows = pixels_within(&f->tiling, at.top, f->height);
    const Py_ssize_t columns = pixels_within(&f->tiling, at.left, f->width);
    for (Py_ssize_t y = 0; y < rows; ++y) {
        real_sixteen(work[y]);
        for (Py_ssize_t x = 0; x < columns; ++x) {
            const Py_ssize_t pixel = (at.top + y) * f->width + at.left + x;
            const Sixteen value = work[y][x] + bias, positive = (Sixteen)((SixteenBits)value & (SixteenBits)(value > none));
            write_sixteen(positive, f->pixels, pixel * f->channels + channel, f->halved);
        }
    }
}

/* Has a tile's spectra fetched, if not as near as what is in use: processors do not foresee so many places. */
PART void fetch_spectra(const Fourier *f, Py_ssize_t tile) {
    const Py_ssize_t size = f->halved ? 2 : 4, bytes = 2 * f->channels * size;
    for (Py_ssize_t frequency = 0; frequency < FREQUENCIES; ++frequency) {
        const char *spectrum = (const char *)f->spectra + spectrum_place(f, frequency, tile) * size;
        for (Py_ssize_t byte = 0; byte < bytes; byte += 64) __builtin_prefetch(spectrum + byte, 1, 2);
    }
}

/* Has those pixels fetched that the tile to the left does not have. */
PART void fetch_pixels(const Fourier *f, Place at) {
    const Py_ssize_t bytes = f->channels * (f->halved ? 2 : 4);
    for (Py_ssize_t y = at.top; y < at_most(at.top + SIZE, f->height); ++y)
        for (Py_ssize_t x = at.left + SIZE - f->tiling.step; x < at_most(at.left + SIZE, f->width); ++x) {
            const char *pixel = (const char *)f->pixels + (y * f->width + x) * bytes;
            for (Py_ssize_t byte = 0; byte < bytes; byte += 64) __builtin_prefetch(pixel + byte);
        }
}

MANY_PROCESSORS
static void forward(const Fourier *f, Py_ssize_t tile) {
    const Place at = tile_place(&f->tiling, f->first + tile);
    if (tile + 1 < f->tiles) {
        fetch_spectra(f, tile + 1);
        fetch_pixels(f, tile_place(&f->tiling, f->first + tile + 1));
    }
    EACH_GROUP(channel, f->channels, LANES) forward_channels(f, tile, at, channel);
}

MANY_PROCESSORS
static void backward(const Fourier *f, Py_ssize_t tile) {
    const Place at = tile_place(&f->tiling, f->first + tile);
    if (tile + 1 < f->tiles) fetch_spectra(f, tile + 1);
    EACH_GROUP(channel, f->channels, LANES) backward_channels(f, tile, at, channel);
}

static void all_tiles(const Fourier *f, void (*step)(const Fourier *, Py_ssize_t), int threads) {
    Shares shares; /* neighbouring tiles, since each has memory fetched for the next */
    share_out(&shares, f->tiles, threads);
#pragma omp parallel num_threads(threads)
    EACH_SHARED(tile, &shares) step(f, tile);
}

/* Arguments of both, and the step itself. */
static PyObject *transform(PyObject *arguments, void (*step)(const Fourier *, Py_ssize_t)) {
    Fourier f = {.tiling = {.dilation = 1}};
    unsigned long long pixels, spectra, sums, bias;
    int threads;
    if (!PyArg_ParseTuple(arguments, "KKKKnnnnnnnnpi", &pixels, &spectra, &sums, &bias, &f.height, &f.width, &f.channels,
                          &f.tiling.height, &f.tiling.width, &f.tiling.step, &f.first, &f.tiles, &f.halved, &threads))
        return NULL;
    f.pixels = at_address(pixels);
    f.spectra = at_address(spectra);
    f.sums = at_address(sums);
    f.bias = at_address(bias);
    Py_BEGIN_ALLOW_THREADS
    all_tiles(&f, step, threads);
    Py_END_ALLOW_THREADS
    Py_RETURN_NONE;
}

PyObject *fourier_forward(PyObject *Py_UNUSED(module), PyObject *arguments) { return transform(arguments, forward); }

PyObject *fourier_backward(PyObject *Py_UNUSED(module), PyObject *arguments) { return transform(arguments, backward); }
