/* Products of bfloat16 by the matrix unit of processors that have one (Intel's AMX). Elsewhere `takes_amx` is 0, and nothing
 * else here may be called.
 *
 * A product takes rows of values where they lie: row i of a block of 16 begins `stride` bytes after row i - 1, and its values
 * lie in pieces of 32, each at an offset that is the same for all rows. So a convolution multiplies a picture's own pixels, and
 * nothing is gathered. Matrices are packed (`amx_packed` in __init__.py): (groups, pieces, 16, COLUMNS, 2), zeros beyond the last
 * value and column.
 */
#ifndef LFCORE_KERNELS_AMX_H
#define LFCORE_KERNELS_AMX_H

#include "halved.h"

#define ROWS 16 /* of a block */
#define PIECE 32 /* values that are multiplied at once */
#define TILE_BYTES 1024

/* Whether this processor has a matrix unit, and the system lets this process use it. */
int takes_amx(void);

/* Values of the room that `amx_row_products` needs. */
PART Py_ssize_t amx_room(Py_ssize_t count, Py_ssize_t values) { return (count + ROWS - 1) / ROWS * ROWS * values + PIECE; }

/* Rows of bfloat16 by a packed matrix, plus a bias. rows: (count, values). bias: (groups * COLUMNS). room: `amx_room` values. out:
 * (count, groups * COLUMNS). */
void amx_row_products(const uint16_t *rows, Py_ssize_t count, Py_ssize_t values, const void *packed, Py_ssize_t groups,
                      const float *bias, uint16_t *room, float *out);

#if defined(HALVED_COMPILED) && defined(__linux__)
#define AMX_COMPILED 1

#define AMX HALVED_TARGET ",amx-tile,amx-bf16"
#define AMX_PART static inline __attribute__((always_inline, target(AMX)))

/* What a thread's matrix unit is set to. Torch's library keeps in mind what it has set, so that is put back afterwards. A loop of
 * OpenMP is not for the unit's instructions: some compilers make a function of it that is for the oldest processors. */
typedef struct {
    uint8_t bytes[64];
} TileShapes;

void begin_tiles(TileShapes *before);
void end_tiles(const TileShapes *before);

/* Where a product finds its values. */
typedef struct {
    Py_ssize_t stride; /* bytes from one row of a block to the next */
    const Py_ssize_t *offsets; /* of the pieces, bytes from a row's beginning */
    Py_ssize_t pieces;
} Pieces;

/* Gcc is not told that tiles are loaded from memory: without this it might write what they are to hold after that. */
#define WRITTEN __asm__ volatile("" ::: "memory")

/* Two blocks by two groups of columns. bias: of both groups. out: (2, ROWS, 2, COLUMNS). */
AMX_PART void two_by_two(const Pieces *p, const char *const blocks[2], const char *matrix, const float *bias, float *out) {
    const char *other = matrix + p->pieces * TILE_BYTES;
    WRITTEN;
    _tile_loadd(0, bias, 0);
    _tile_loadd(1, bias + COLUMNS, 0);
    _tile_loadd(2, bias, 0);
    _tile_loadd(3, bias + COLUMNS, 0);
    for (Py_ssize_t piece = 0; piece < p->pieces; ++piece) {
        _tile_loadd(4, blocks[0] + p->offsets[piece], p->stride);
        _tile_loadd(6, matrix + piece * TILE_BYTES, 64);
        _tile_loadd(5, blocks[1] + p->offsets[piece], p->stride);
        _tile_loadd(7, other + piece * TILE_BYTES, 64);
        _tile_dpbf16ps(0, 4, 6);
        _tile_dpbf16ps(2, 5, 6);
        _tile_dpbf16ps(1, 4, 7);
        _tile_dpbf16ps(3, 5, 7);
    }
    const Py_ssize_t row = 2 * COLUMNS * sizeof(float);
    _tile_stored(0, out, row);
    _tile_stored(1, out + COLUMNS, row);
    _tile_stored(2, out + ROWS * 2 * COLUMNS, row);
    _tile_stored(3, out + ROWS * 2 * COLUMNS + COLUMNS, row);
    WRITTEN;
}

/* Four blocks by one group. out: (4, ROWS, COLUMNS). */
AMX_PART void four_by_one(const Pieces *p, const char *const blocks[4], const char *matrix, const float *bias, float *out) {
    WRITTEN;
    _tile_loadd(0, bias, 0);
    _tile_loadd(1, bias, 0);
    _tile_loadd(2, bias, 0);
    _tile_loadd(3, bias, 0);
    for (Py_ssize_t piece = 0; piece < p->pieces; ++piece) {
        _tile_loadd(6, matrix + piece * TILE_BYTES, 64);
        _tile_loadd(4, blocks[0] + p->offsets[piece], p->stride);
        _tile_loadd(5, blocks[1] + p->offsets[piece], p->stride);
        _tile_dpbf16ps(0, 4, 6);
        _tile_loadd(7, blocks[2] + p->offsets[piece], p->stride);
        _tile_dpbf16ps(1, 5, 6);
        _tile_loadd(4, blocks[3] + p->offsets[piece], p->stride);
        _tile_dpbf16ps(2, 7, 6);
        _tile_dpbf16ps(3, 4, 6);
    }
    const Py_ssize_t row = COLUMNS * sizeof(float);
    _tile_stored(0, out, row);
    _tile_stored(1, out + ROWS * COLUMNS, row);
    _tile_stored(2, out + 2 * ROWS * COLUMNS, row);
    _tile_stored(3, out + 3 * ROWS * COLUMNS, row);
    WRITTEN;
}

#endif
#endif
