/* Convolutions that are computed tile by tile after a transform: where tiles lie, how pixels are read and written. */
#ifndef LFCORE_KERNELS_TILED_H
#define LFCORE_KERNELS_TILED_H

#include "common.h"

/* A picture, and how tiles cover the result of a convolution of it. */
typedef struct {
    void *pixels; /* (height, width, channels): of what is read, or of the result */
    int halved; /* whether it is bfloat16; else float32 */
    Py_ssize_t height, width, channels;
    Py_ssize_t result_height, result_width; /* which the tiles cover */
    Py_ssize_t step; /* pixels of the result that a tile gives along each axis */
} Tiling;

typedef struct {
    Py_ssize_t top, left;
} Place;

/* Where a tile begins: row by row. */
PART Place tile_place(const Tiling *t, Py_ssize_t tile) {
    const Py_ssize_t columns = (t->result_width + t->step - 1) / t->step;
    return (Place){tile / columns * t->step, tile % columns * t->step};
}

typedef uint32_t SixteenBits __attribute__((vector_size(64)));
typedef uint16_t SixteenHalves __attribute__((vector_size(32)));

PART Sixteen from_halves(const uint16_t *values) {
    SixteenHalves halves;
    memcpy(&halves, values, sizeof halves);
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

/* `SIZE` neighbours in a row of a tile, sixteen channels from `channel` on: zeros beyond the picture. */
PART void read_row(const Tiling *t, Py_ssize_t row, Py_ssize_t left, Py_ssize_t channel, int size, Sixteen *out) {
    const Sixteen none = {0.0f};
    for (int i = 0; i < size; ++i) {
        const Py_ssize_t column = left + i, place = (row * t->width + column) * t->channels + channel;
        if (row < 0 || row >= t->height || column < 0 || column >= t->width)
            out[i] = none;
        else
            out[i] = t->halved ? from_halves((const uint16_t *)t->pixels + place) : sixteen_at((const float *)t->pixels + place);
    }
}

#endif
