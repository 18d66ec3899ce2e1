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
#include "shares.h"

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

/* A product is begun with a bias, piece by piece added to, and ended with its sums in memory. What processors do beside it between
 * the pieces costs nothing: most of the time they wait for the unit.
 *
 * Two blocks by two groups of columns. bias: of both groups. matrix: of the first group, the second one follows. sums: (2, ROWS,
 * 2, COLUMNS). */
AMX_PART void begin_two_by_two(const float *bias) {
    WRITTEN;
    _tile_loadd(0, bias, 0);
    _tile_loadd(1, bias + COLUMNS, 0);
    _tile_loadd(2, bias, 0);
    _tile_loadd(3, bias + COLUMNS, 0);
}

AMX_PART void add_two_by_two(const Pieces *p, const char *const blocks[2], const char *matrix, Py_ssize_t piece) {
    _tile_loadd(4, blocks[0] + p->offsets[piece], p->stride);
    _tile_loadd(6, matrix + piece * TILE_BYTES, 64);
    _tile_loadd(5, blocks[1] + p->offsets[piece], p->stride);
    _tile_loadd(7, matrix + (p->pieces + piece) * TILE_BYTES, 64);
    _tile_dpbf16ps(0, 4, 6);
    _tile_dpbf16ps(2, 5, 6);
    _tile_dpbf16ps(1, 4, 7);
    _tile_dpbf16ps(3, 5, 7);
}

AMX_PART void end_two_by_two(float *sums) {
    const Py_ssize_t row = 2 * COLUMNS * sizeof(float);
    _tile_stored(0, sums, row);
    _tile_stored(1, sums + COLUMNS, row);
    _tile_stored(2, sums + ROWS * 2 * COLUMNS, row);
    _tile_stored(3, sums + ROWS * 2 * COLUMNS + COLUMNS, row);
    WRITTEN;
}

/* Four blocks by one group. sums: (4, ROWS, COLUMNS). */
AMX_PART void begin_four_by_one(const float *bias) {
    WRITTEN;
    _tile_loadd(0, bias, 0);
    _tile_loadd(1, bias, 0);
    _tile_loadd(2, bias, 0);
    _tile_loadd(3, bias, 0);
}

AMX_PART void add_four_by_one(const Pieces *p, const char *const blocks[4], const char *matrix, Py_ssize_t piece) {
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

AMX_PART void end_four_by_one(float *sums) {
    const Py_ssize_t row = COLUMNS * sizeof(float);
    _tile_stored(0, sums, row);
    _tile_stored(1, sums + ROWS * COLUMNS, row);
    _tile_stored(2, sums + 2 * ROWS * COLUMNS, row);
    _tile_stored(3, sums + 3 * ROWS * COLUMNS, row);
    WRITTEN;
}

/* Blocks of rows that a product takes: `across` of them, and as many again in each of `down` lines. */
typedef struct {
    const char *first;
    Py_ssize_t across, down, to_next, to_next_line; /* bytes from one block to the next, and to that below it */
} Blocks;

/* Where a product goes: (down, width, outputs), of bfloat16 or, where that is NULL, of float32. */
typedef struct {
    uint16_t *halves;
    float *floats;
    Py_ssize_t width, outputs; /* rows of a line; the last block's may be more */
    const uint16_t *added; /* to the result, like it, or NULL; for bfloat16 alone */
    int positive; /* whether negative values of the result become 0 */
} Result;

/* Sums of blocks that are not in the result yet. */
typedef struct {
    const float *sums; /* (blocks, ROWS, groups, COLUMNS) */
    Py_ssize_t rows; /* of all blocks, 0 where nothing is left */
    struct {
        Py_ssize_t count, place; /* rows that lie within the result, the first one's first value there */
    } of_block[4];
    uint32_t counting; /* which of the groups' columns lie within it */
} Pending;

/* What comes after the sums of sixteen columns. */
HALVED_PART __m512 finished(const Result *r, __m512 sums, __m256i added) {
    if (r->added != NULL) sums = _mm512_add_ps(sums, floats_of(added));
    return r->positive ? _mm512_max_ps(sums, _mm512_setzero_ps()) : sums;
}

/* A row's sums of one group or two side by side to the result. */
HALVED_PART void put_row(const Result *r, const Pending *pending, Py_ssize_t row, const int groups) {
    const Py_ssize_t block = row / ROWS, of_block = row % ROWS;
    if (of_block >= pending->of_block[block].count) return;
    const Py_ssize_t place = pending->of_block[block].place + of_block * r->outputs;
    const float *sums = pending->sums + row * groups * COLUMNS;
    const uint32_t counting = pending->counting;
    if (r->halves == NULL)
        for (int g = 0; g < groups; ++g)
            _mm512_mask_storeu_ps(r->floats + place + g * COLUMNS, (__mmask16)(counting >> g * COLUMNS),
                                  finished(r, _mm512_loadu_ps(sums + g * COLUMNS), _mm256_setzero_si256()));
    else if (groups == 1) {
        const __mmask16 own = (__mmask16)counting;
        const __m256i added = r->added == NULL ? _mm256_setzero_si256() : _mm256_maskz_loadu_epi16(own, r->added + place);
        const __m512 values = finished(r, _mm512_loadu_ps(sums), added);
        _mm256_mask_storeu_epi16(r->halves + place, own, (__m256i)_mm512_cvtneps_pbh(values));
    } else {
        const __m512i added = r->added == NULL ? _mm512_setzero_si512() : _mm512_maskz_loadu_epi16(counting, r->added + place);
        const __m512 low = finished(r, _mm512_loadu_ps(sums), _mm512_castsi512_si256(added));
        const __m512 high = finished(r, _mm512_loadu_ps(sums + COLUMNS), _mm512_extracti64x4_epi64(added, 1));
        _mm512_mask_storeu_epi16(r->halves + place, counting, (__m512i)_mm512_cvtne2ps_pbh(high, low));
    }
}

/* One group of columns or two, a constant. Sums are put into the result while the next ones are computed; of the last blocks some
 * are computed again. Blocks of lines below one another come after one another, since those of a picture share rows. matrix, bias: the group's own. room: (2, 4 * ROWS * COLUMNS). */
AMX_PART void multiply_groups(const Blocks *b, const Pieces *pieces, const char *matrix, const float *bias, const Result *r,
                              Py_ssize_t group, const int groups, float *room) {
    const int together = groups == 2 ? 2 : 4;
    const Py_ssize_t blocks = b->across * b->down, at_once = (together * ROWS + pieces->pieces - 1) / pieces->pieces;
    Pending pending = {.counting = lanes_within(r->outputs - group * COLUMNS, groups * COLUMNS)};
    for (Py_ssize_t block = 0; block < blocks; block += together) {
        const char *places[4];
        for (int k = 0; k < together; ++k) {
            const Py_ssize_t own = at_most(block + k, blocks - 1);
            places[k] = b->first + own % b->down * b->to_next_line + own / b->down * b->to_next;
        }
        if (groups == 2)
            begin_two_by_two(bias);
        else
            begin_four_by_one(bias);
        for (Py_ssize_t piece = 0, row = 0; piece < pieces->pieces; ++piece) {
            if (groups == 2)
                add_two_by_two(pieces, places, matrix, piece);
            else
                add_four_by_one(pieces, places, matrix, piece);
            for (const Py_ssize_t end = at_most(row + at_once, pending.rows); row < end; ++row) put_row(r, &pending, row, groups);
        }
        float *sums = room + block / together % 2 * 4 * ROWS * COLUMNS;
        if (groups == 2)
            end_two_by_two(sums);
        else
            end_four_by_one(sums);
        pending.sums = sums;
        pending.rows = at_most(together, blocks - block) * ROWS;
        for (int k = 0; k < together; ++k) {
            const Py_ssize_t line = (block + k) % b->down, row = (block + k) / b->down * ROWS;
            pending.of_block[k].count = at_most(ROWS, r->width - row);
            pending.of_block[k].place = (line * r->width + row) * r->outputs + group * COLUMNS;
        }
    }
    for (Py_ssize_t row = 0; row < pending.rows; ++row) put_row(r, &pending, row, groups);
}

/* Blocks by a packed matrix (groups, pieces, 16, COLUMNS, 2), plus a bias (groups * COLUMNS). */
AMX_PART void multiply_blocks(const Blocks *b, const Pieces *pieces, const char *packed, const float *bias, const Result *r) {
    _Alignas(64) float room[2 * 4 * ROWS * COLUMNS];
    const Py_ssize_t groups = (r->outputs + COLUMNS - 1) / COLUMNS;
    for (Py_ssize_t group = 0; group < groups; group += 2) {
        const char *matrix = packed + group * pieces->pieces * TILE_BYTES;
        if (group + 1 < groups)
            multiply_groups(b, pieces, matrix, bias + group * COLUMNS, r, group, 2, room);
        else
            multiply_groups(b, pieces, matrix, bias + group * COLUMNS, r, group, 1, room);
    }
}

#endif
#endif
