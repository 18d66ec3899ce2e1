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
    const float *zeros; /* (groups * COLUMNS) */
    uint16_t *out; /* (matrices, count, columns) */
    Py_ssize_t count, values, columns, groups;
    Pieces pieces;
} Products;

/* Blocks of `count` rows that lie behind one another. */
PART Blocks blocks_behind(const void *rows, Py_ssize_t count, Py_ssize_t values) {
    return (Blocks){rows, (count + ROWS - 1) / ROWS, 1, ROWS * values * 2, 0};
}

__attribute__((target(AMX))) static void multiply(const Products *p, Py_ssize_t index) {
    const Blocks blocks = blocks_behind(p->rows + index * p->count * p->values * 2, p->count, p->values);
    const Result result = {p->out + index * p->count * p->columns, NULL, p->count, p->columns, NULL, 0};
    multiply_blocks(&blocks, &p->pieces, p->packed + index * p->groups * p->pieces.pieces * TILE_BYTES, p->zeros, &result);
}

static void multiply_all(const Products *p, Py_ssize_t matrices, int threads) {
    Shares shares;
    share_out(&shares, matrices, threads);
#pragma omp parallel num_threads(threads)
    {
        TileShapes before;
        begin_tiles(&before);
        EACH_SHARED(index, &shares) multiply(p, index);
        end_tiles(&before);
    }
}

__attribute__((target(AMX))) void amx_row_products(
    const uint16_t *rows, Py_ssize_t count, Py_ssize_t values, const void *packed, Py_ssize_t groups, const float *bias,
    uint16_t *room, float *out) {
    Py_ssize_t offsets[MOST_PIECES];
    const Pieces pieces = evenly(values, offsets);
    /* What is read beyond the rows must be there, and zeros. */
    memcpy(room, rows, count * values * sizeof *rows);
    memset(room + count * values, 0, (amx_room(count, values) - count * values) * sizeof *rows);
    const Blocks blocks = blocks_behind(room, count, values);
    const Result result = {NULL, out, count, groups * COLUMNS, NULL, 0};
    TileShapes before;
    begin_tiles(&before);
    multiply_blocks(&blocks, &pieces, packed, bias, &result);
    end_tiles(&before);
}

PyObject *amx_products(PyObject *Py_UNUSED(module), PyObject *arguments) {
    Products p;
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
    float *zeros = calloc(p.groups * COLUMNS, sizeof *zeros);
    if (zeros == NULL) return PyErr_NoMemory();
    p.zeros = zeros;
    Py_BEGIN_ALLOW_THREADS
    multiply_all(&p, matrices, threads);
    Py_END_ALLOW_THREADS
    free(zeros);
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
