/* winograd.h in bfloat16, for processors with AVX-512 and its products of pairs of bfloat16. The transforms are computed in
 * float32; what lies between them is rounded. */
#include "winograd.h"

#ifdef HALVED_COMPILED

#define LANES 16
#define ALL 0xFFFF /* lanes */
#define AHEAD 1 /* tiles, for which memory is fetched beforehand */

typedef float Sixteen __attribute__((vector_size(64)));

typedef struct {
    const uint16_t *samples[SIZE][SIZE]; /* where the channels of each begin: outside the picture there are zeros */
} Tile;

/* Channels are multiplied in pairs; of an odd number the last pair's second is 0. */
PART Py_ssize_t pairs(const Winograd *w) { return (w->channels + 1) / 2; }

/* Inputs are (PLACES, TILES, pairs, 2), products (TILES, PLACES, groups * COLUMNS). Values from one to the next: */
PART Py_ssize_t inputs_of_a_place(const Winograd *w) { return spaced(TILES * pairs(w) * 4) / 2; }
PART Py_ssize_t products_of_a_tile(const Winograd *w) { return spaced(PLACES * w->groups * COLUMNS * 4) / 4; }

HALVED_PART Sixteen not_negative(Sixteen values) { return (Sixteen)_mm512_max_ps((__m512)values, _mm512_setzero_ps()); }

HALVED_PART Sixteen floats_at(const uint16_t *values, uint16_t counting) {
    const __m256i narrow =
        counting == ALL ? _mm256_loadu_si256((const __m256i *)values) : _mm256_maskz_loadu_epi16(counting, values);
    return (Sixteen)floats_of(narrow);
}

HALVED_PART void put(uint16_t *out, uint16_t counting, Sixteen values) {
    const __m256i narrow = (__m256i)_mm512_cvtneps_pbh((__m512)values);
    if (counting == ALL)
        _mm256_storeu_si256((__m256i *)out, narrow);
    else
        _mm256_mask_storeu_epi16(out, counting, narrow);
}

PART void fetch(const void *picture, Py_ssize_t pixel, Py_ssize_t channels) {
    const char *first = (const char *)picture + 2 * pixel * channels;
    for (Py_ssize_t byte = 0; byte < 2 * channels; byte += 64) __builtin_prefetch(first + byte);
}

/* Has those samples fetched that the tile to the left does not have. Processors do not foresee so many rows. */
PART void fetch_samples(const Winograd *w, Place at) {
    const Py_ssize_t d = w->tiling.dilation, top = at.top - w->padding, left = at.left - w->padding;
    for (Py_ssize_t y = 0; y < SIZE; ++y)
        for (Py_ssize_t x = SIZE - STEP; x < SIZE; ++x)
            fetch(w->in, within(top + y * d, w->height) * w->width + within(left + x * d, w->width), w->channels);
}

PART void fetch_result(const Winograd *w, Place at) {
    const Tiling *t = &w->tiling;
    for (Py_ssize_t y = at.top; y < at_most(at.top + STEP * t->dilation, t->height); y += t->dilation)
        for (Py_ssize_t x = at.left; x < at_most(at.left + STEP * t->dilation, t->width); x += t->dilation)
            fetch(w->out, y * t->width + x, w->outputs);
}

PART Tile tile_at(const Winograd *w, Place at, const uint16_t *zeros) {
    const Py_ssize_t d = w->tiling.dilation, top = at.top - w->padding, left = at.left - w->padding;
    Tile tile;
    for (int y = 0; y < SIZE; ++y)
        for (int x = 0; x < SIZE; ++x) {
            const Py_ssize_t row = top + y * d, column = left + x * d;
            const int inside = row >= 0 && row < w->height && column >= 0 && column < w->width;
            tile.samples[y][x] = inside ? (const uint16_t *)w->in + (row * w->width + column) * w->channels : zeros;
        }
    return tile;
}

/* Of sixteen channels at most: those that count. */
HALVED_PART void transform_sixteen(
    const Winograd *w, const Tile *tile, Py_ssize_t channel, uint16_t counting, uint16_t *restrict inputs) {
    Sixteen work[SIZE][SIZE], lane[SIZE];
    for (int y = 0; y < SIZE; ++y) {
        for (int x = 0; x < SIZE; ++x) {
            work[y][x] = floats_at(tile->samples[y][x] + channel, counting);
            if (w->of_positive) work[y][x] = not_negative(work[y][x]);
        }
        FORWARD(work[y]);
    }
    for (int x = 0; x < SIZE; ++x) {
        for (int y = 0; y < SIZE; ++y) lane[y] = work[y][x];
        FORWARD(lane);
        for (int y = 0; y < SIZE; ++y) put(inputs + (y * SIZE + x) * inputs_of_a_place(w) + channel, counting, lane[y]);
    }
}

/* Of 32 channels, whose even ones are the lower halves of registers: they come out first, then the odd ones. */
HALVED_PART void transform_many(const Winograd *w, const Tile *tile, Py_ssize_t channel, uint16_t *restrict inputs) {
    Sixteen even[SIZE][SIZE], odd[SIZE][SIZE], even_lane[SIZE], odd_lane[SIZE];
    const __m512i upper = _mm512_set1_epi32((int32_t)0xFFFF0000);
    for (int y = 0; y < SIZE; ++y) {
        for (int x = 0; x < SIZE; ++x) {
            __m512i both = _mm512_loadu_si512(tile->samples[y][x] + channel);
            /* Their first bit is the sign, as that of whole numbers. */
            if (w->of_positive) both = _mm512_max_epi16(both, _mm512_setzero_si512());
            even[y][x] = (Sixteen)_mm512_castsi512_ps(_mm512_slli_epi32(both, 16));
            odd[y][x] = (Sixteen)_mm512_castsi512_ps(_mm512_and_si512(both, upper));
        }
        FORWARD(even[y]);
        FORWARD(odd[y]);
    }
    for (int x = 0; x < SIZE; ++x) {
        for (int y = 0; y < SIZE; ++y) even_lane[y] = even[y][x], odd_lane[y] = odd[y][x];
        FORWARD(even_lane);
        FORWARD(odd_lane);
        for (int y = 0; y < SIZE; ++y) {
            const __m512i both = (__m512i)_mm512_cvtne2ps_pbh((__m512)odd_lane[y], (__m512)even_lane[y]);
            _mm512_storeu_si512(inputs + (y * SIZE + x) * inputs_of_a_place(w) + channel, both);
        }
    }
}

HALVED_PART void transform(const Winograd *w, Place at, const uint16_t *zeros, uint16_t *restrict inputs) {
    const Tile tile = tile_at(w, at, zeros);
    Py_ssize_t channel = 0;
    for (; channel + 2 * LANES <= w->channels; channel += 2 * LANES) transform_many(w, &tile, channel, inputs);
    for (; channel + LANES <= w->channels; channel += LANES) transform_sixteen(w, &tile, channel, ALL, inputs);
    if (channel < w->channels) transform_sixteen(w, &tile, channel, (uint16_t)lanes_within(w->channels - channel, LANES), inputs);
}

HALVED_PART void transform_back(
    const Winograd *w, Place at, Py_ssize_t channel, uint16_t counting, const float *restrict products) {
    Sixteen work[STEP][SIZE], lane[SIZE];
    const Tiling *t = &w->tiling;
    for (int x = 0; x < SIZE; ++x) {
        for (int y = 0; y < SIZE; ++y)
            lane[y] = (Sixteen)_mm512_loadu_ps(products + (y * SIZE + x) * w->groups * COLUMNS + channel);
        BACK(lane);
        for (int y = 0; y < STEP; ++y) work[y][x] = lane[y];
    }
    const Sixteen bias = (Sixteen)_mm512_maskz_loadu_ps(counting, w->bias + channel);
    const Py_ssize_t rows = pixels_within(t, at.top, t->height), columns = pixels_within(t, at.left, t->width);
    for (Py_ssize_t y = 0; y < rows; ++y) {
        BACK(work[y]);
        for (Py_ssize_t x = 0; x < columns; ++x) {
            const Py_ssize_t pixel = (at.top + y * t->dilation) * t->width + at.left + x * t->dilation;
            const Py_ssize_t first = pixel * w->outputs + channel;
            Sixteen value = work[y][x] + bias;
            if (w->added != NULL) value += floats_at((const uint16_t *)w->added + first, counting);
            if (w->positive) value = not_negative(value);
            put((uint16_t *)w->out + first, counting, value);
        }
    }
}

__attribute__((HALVED)) static void convolve_block(
    const Winograd *w, Py_ssize_t first, Py_ssize_t tiles, const uint16_t *zeros, uint16_t *inputs, float *products) {
    Place places[TILES];
    for (Py_ssize_t tile = 0; tile < tiles; ++tile) places[tile] = tile_place(&w->tiling, first + tile);
    for (Py_ssize_t tile = 0; tile < tiles; ++tile) {
        if (tile + AHEAD < tiles) fetch_samples(w, places[tile + AHEAD]);
        transform(w, places[tile], zeros, inputs + tile * 2 * pairs(w));
    }
    const Py_ssize_t weights = w->groups * COLUMNS * 2 * pairs(w);
    for (int place = 0; place < PLACES; ++place)
        all_products(inputs + place * inputs_of_a_place(w), tiles, pairs(w), (const uint16_t *)w->weights + place * weights,
                     w->groups, NULL, products + place * w->groups * COLUMNS, products_of_a_tile(w));
    for (Py_ssize_t tile = 0; tile < tiles; ++tile) {
        if (tile + AHEAD < tiles) fetch_result(w, places[tile + AHEAD]);
        const float *own = products + tile * products_of_a_tile(w);
        Py_ssize_t channel = 0;
        for (; channel + LANES <= w->outputs; channel += LANES) transform_back(w, places[tile], channel, ALL, own);
        if (channel < w->outputs) transform_back(w, places[tile], channel, (uint16_t)lanes_within(w->outputs - channel, LANES), own);
    }
}

int winograd_in_halves(const Winograd *w, int threads) {
    const Py_ssize_t tiles = tile_count(&w->tiling);
    uint16_t *zeros = calloc(2 * pairs(w), sizeof(uint16_t));
    Shares blocks;
    share_out(&blocks, (tiles + TILES - 1) / TILES, threads);
    int failed = zeros == NULL;
#pragma omp parallel num_threads(threads) reduction(| : failed)
    {
        /* Zeros, for the second of a last pair is set by nobody. */
        uint16_t *inputs = calloc(PLACES * inputs_of_a_place(w), sizeof(uint16_t));
        float *products = malloc(TILES * products_of_a_tile(w) * sizeof(float));
        failed |= inputs == NULL || products == NULL;
        EACH_SHARED(block, &blocks)
            if (!failed) convolve_block(w, block * TILES, at_most(TILES, tiles - block * TILES), zeros, inputs, products);
        free(inputs);
        free(products);
    }
    free(zeros);
    return failed;
}

#else

int winograd_in_halves(const Winograd *Py_UNUSED(w), int Py_UNUSED(threads)) { return 0; }

#endif
