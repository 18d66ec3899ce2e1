/* Whether there is a matrix unit (amx.h), and the products between Fourier transforms by it (lfcore.fourier). */
#include "amx.h"

#ifdef AMX_COMPILED

#include <cpuid.h>
#include <sys/syscall.h>
#include <unistd.h>

#define REQUEST_PERMISSION 0x1023 /* of arch_prctl, Linux 5.16 */
#define TILE_DATA 18 /* the state for which permission is asked */
#define MOST_PIECES 64 /* of rows that lie behind one another: AMX_MOST_VALUES in __init__.py */
#define AMX_BITS ((1u << 22) | (1u << 24)) /* AMX-BF16, AMX-TILE */

int takes_amx(void) {
    unsigned a, b, c, d;
    if (!takes_halves() || !__get_cpuid_count(7, 0, &a, &b, &c, &d) || (d & AMX_BITS) != AMX_BITS) return 0;
    return syscall(SYS_arch_prctl, REQUEST_PERMISSION, TILE_DATA) == 0;
}

/* The only palette there is; of each tile the bytes of a row, as two bytes, and the rows. A constant: gcc believes that the
 * instruction reads 8 bytes, and would leave out what is written to the others just before. */
#define OF_EIGHT(...) __VA_ARGS__, __VA_ARGS__, __VA_ARGS__, __VA_ARGS__, __VA_ARGS__, __VA_ARGS__, __VA_ARGS__, __VA_ARGS__
static const TileShapes SHAPES = {{1, [16] = OF_EIGHT(64, 0), [48] = OF_EIGHT(ROWS)}};

__attribute__((target(AMX))) void begin_tiles(TileShapes *before) {
    _tile_storeconfig(before);
    _tile_loadconfig(&SHAPES);
}

__attribute__((target(AMX))) void end_tiles(const TileShapes *before) {
    if (before->bytes[0])
        _tile_loadconfig(before);
    else
        _tile_release();
}

/* The pieces of rows of so many values that lie behind one another. */
PART Pieces evenly(Py_ssize_t values, Py_ssize_t *offsets) {
    const Py_ssize_t pieces = (values + PIECE - 1) / PIECE;
    for (Py_ssize_t piece = 0; piece < pieces; ++piece) offsets[piece] = piece * PIECE * 2;
    return (Pieces){values * 2, offsets, pieces};
}

typedef struct {
    const char *rows; /* (matrices, count, values), bfloat16, and a block more after the last */
    const char *packed; /* (matrices, groups, pieces, 16, COLUMNS, 2) */
    uint16_t *out; /* (matrices, count, columns) */
    const float *zeros; /* 2 * COLUMNS of them */
    Py_ssize_t count, values, columns, groups;
    Pieces pieces;
} Products;

/* Rows of a block to `out`, where they count. from: floats from one row of the block to the next, `width` of which count. */
AMX_PART void put_rows(const float *block, Py_ssize_t rows, int from, Py_ssize_t width, uint16_t *out, Py_ssize_t to) {
    const __mmask16 first = width >= COLUMNS ? 0xFFFF : (__mmask16)((1u << width) - 1);
    const __mmask16 second = width >= 2 * COLUMNS ? 0xFFFF : width > COLUMNS ? (__mmask16)((1u << (width - COLUMNS)) - 1) : 0;
    for (Py_ssize_t row = 0; row < rows; ++row) {
        _mm256_mask_storeu_epi16(out + row * to, first, (__m256i)_mm512_cvtneps_pbh(_mm512_loadu_ps(block + row * from)));
        if (second)
            _mm256_mask_storeu_epi16(out + row * to + COLUMNS, second,
                                     (__m256i)_mm512_cvtneps_pbh(_mm512_loadu_ps(block + row * from + COLUMNS)));
    }
}

AMX_PART void multiply_two_groups(const Products *p, const char *rows, const char *matrix, uint16_t *out, Py_ssize_t width) {
    _Alignas(64) float products[2 * ROWS * 2 * COLUMNS];
    const Py_ssize_t bytes = ROWS * p->values * 2;
    for (Py_ssize_t row = 0; row < p->count; row += 2 * ROWS) {
        /* Of an odd number of blocks the last one is computed twice. */
        const int both = row + ROWS < p->count;
        const char *const blocks[2] = {rows + row / ROWS * bytes, rows + (row / ROWS + both) * bytes};
        two_by_two(&p->pieces, blocks, matrix, p->zeros, products);
        for (int block = 0; block <= both; ++block)
            put_rows(products + block * ROWS * 2 * COLUMNS, at_most(ROWS, p->count - row - block * ROWS), 2 * COLUMNS, width,
                     out + (row + block * ROWS) * p->columns, p->columns);
    }
}

AMX_PART void multiply_one_group(const Products *p, const char *rows, const char *matrix, uint16_t *out, Py_ssize_t width) {
    _Alignas(64) float products[4 * ROWS * COLUMNS];
    const Py_ssize_t last = (p->count - 1) / ROWS;
    for (Py_ssize_t first = 0; first <= last; first += 4) {
        const char *blocks[4];
        for (int block = 0; block < 4; ++block) blocks[block] = rows + at_most(first + block, last) * ROWS * p->values * 2;
        four_by_one(&p->pieces, blocks, matrix, p->zeros, products);
        for (int block = 0; block < 4 && first + block <= last; ++block)
            put_rows(products + block * ROWS * COLUMNS, at_most(ROWS, p->count - (first + block) * ROWS), COLUMNS, width,
                     out + (first + block) * ROWS * p->columns, p->columns);
    }
}

__attribute__((target(AMX))) static void multiply(const Products *p, Py_ssize_t index) {
    const char *rows = p->rows + index * p->count * p->values * 2;
    const Py_ssize_t of_group = p->pieces.pieces * TILE_BYTES;
    const char *matrix = p->packed + index * p->groups * of_group;
    uint16_t *out = p->out + index * p->count * p->columns;
    for (Py_ssize_t group = 0; group < p->groups; group += 2) {
        const Py_ssize_t column = group * COLUMNS, width = p->columns - column;
        if (group + 1 < p->groups)
            multiply_two_groups(p, rows, matrix + group * of_group, out + column, width);
        else
            multiply_one_group(p, rows, matrix + group * of_group, out + column, width);
    }
}

static void multiply_all(const Products *p, Py_ssize_t matrices, int threads) {
#pragma omp parallel num_threads(threads)
    {
        TileShapes before;
        begin_tiles(&before);
#pragma omp for schedule(dynamic, 1)
        for (Py_ssize_t index = 0; index < matrices; ++index) multiply(p, index);
        end_tiles(&before);
    }
}

__attribute__((target(AMX))) void amx_row_products(
    const uint16_t *rows, Py_ssize_t count, Py_ssize_t values, const void *packed, Py_ssize_t groups, const float *bias,
    uint16_t *room, float *out) {
    _Alignas(64) float sums[4 * ROWS * COLUMNS];
    Py_ssize_t offsets[MOST_PIECES];
    const Pieces pieces = evenly(values, offsets);
    /* What is read beyond the rows must be there, and zeros. */
    memcpy(room, rows, count * values * sizeof *rows);
    memset(room + count * values, 0, (amx_room(count, values) - count * values) * sizeof *rows);
    TileShapes before;
    begin_tiles(&before);
    const Py_ssize_t last = (count - 1) / ROWS;
    for (Py_ssize_t group = 0; group < groups; ++group)
        for (Py_ssize_t first = 0; first <= last; first += 4) {
            const char *blocks[4];
            for (int k = 0; k < 4; ++k) blocks[k] = (const char *)(room + at_most(first + k, last) * ROWS * values);
            four_by_one(&pieces, blocks, (const char *)packed + group * pieces.pieces * TILE_BYTES, bias + group * COLUMNS, sums);
            const Py_ssize_t own = at_most(4 * ROWS, count - first * ROWS);
            for (Py_ssize_t row = 0; row < own; ++row)
                memcpy(out + ((first * ROWS + row) * groups + group) * COLUMNS, sums + row * COLUMNS, COLUMNS * sizeof *out);
        }
    end_tiles(&before);
}

PyObject *amx_products(PyObject *Py_UNUSED(module), PyObject *arguments) {
    static const float zeros[2 * COLUMNS];
    Products p = {.zeros = zeros};
    unsigned long long rows, packed, out;
    Py_ssize_t matrices, offsets[MOST_PIECES];
    int threads;
    if (!PyArg_ParseTuple(arguments, "KKKnnnni", &rows, &packed, &out, &matrices, &p.count, &p.values, &p.columns, &threads))
        return NULL;
    p.rows = at_address(rows);
    p.packed = at_address(packed);
    p.out = at_address(out);
    p.groups = (p.columns + COLUMNS - 1) / COLUMNS;
    p.pieces = evenly(p.values, offsets);
    Py_BEGIN_ALLOW_THREADS
    multiply_all(&p, matrices, threads);
    Py_END_ALLOW_THREADS
    Py_RETURN_NONE;
}

#else

int takes_amx(void) { return 0; }
void amx_row_products(const uint16_t *Py_UNUSED(rows), Py_ssize_t Py_UNUSED(count), Py_ssize_t Py_UNUSED(values),
                      const void *Py_UNUSED(packed), Py_ssize_t Py_UNUSED(groups), const float *Py_UNUSED(bias),
                      uint16_t *Py_UNUSED(room), float *Py_UNUSED(out)) {}

PyObject *amx_products(PyObject *Py_UNUSED(module), PyObject *Py_UNUSED(arguments)) { Py_RETURN_NOTIMPLEMENTED; }

#endif

PyObject *amx(PyObject *Py_UNUSED(module), PyObject *Py_UNUSED(arguments)) { return PyBool_FromLong(takes_amx()); }
