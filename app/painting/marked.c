/* What lies in each of the cells that a window is divided into, summed up in a number: where that is another one than a frame
 * before, something has changed. */
#include "corners.h"

typedef struct {
    uint64_t *marks; /* (rows, columns) */
    Py_ssize_t rows, columns, side; /* of a cell, pixels */
} Cells;

/* A number that depends on both, and on which of them came first. */
PART uint64_t followed_by(uint64_t mark, uint64_t value) {
    const uint64_t product = (mark ^ value) * UINT64_C(0x9E3779B97F4A7C15);
    return product ^ product >> 29;
}

PART uint64_t mark_of(const Corner *corner) {
    uint64_t places[2];
    memcpy(places, corner, sizeof places);
    return places[0] * UINT64_C(0xC2B2AE3D27D4EB4F) ^ (places[1] + corner->colour) * UINT64_C(0x165667B19E3779F9) ^
           (uint64_t)corner->colour << 32;
}

/* Within a box that holds pixels of the cells alone. */
MANY_PROCESSORS
static void mark_all(const Cells *cells, Box box, uint64_t beneath, const Corner *corners, const uint32_t *indices, Py_ssize_t count) {
    for (Py_ssize_t i = 0; i + 3 <= count; i += 3) {
        const Corner *a = corners + indices[i], *b = corners + indices[i + 1], *c = corners + indices[i + 2];
        const Box seen = shared_by(bounds_of(a, b, c), box);
        if (!holds_pixels(seen)) continue;
        const uint64_t mark = followed_by(followed_by(followed_by(beneath, mark_of(a)), mark_of(b)), mark_of(c));
        for (Py_ssize_t row = seen.top / cells->side; row <= (seen.bottom - 1) / cells->side; ++row)
            for (Py_ssize_t column = seen.left / cells->side; column <= (seen.right - 1) / cells->side; ++column) {
                uint64_t *cell = cells->marks + row * cells->columns + column;
                *cell = followed_by(*cell, mark);
            }
    }
}

PyObject *marked(PyObject *Py_UNUSED(module), PyObject *arguments) {
    Cells cells;
    Box box;
    unsigned long long beneath;
    Py_buffer marks, corners, indices;
    if (!PyArg_ParseTuple(arguments, "nnnw*(nnnn)Ky*y*", &cells.rows, &cells.columns, &cells.side, &marks, &box.left, &box.top,
                          &box.right, &box.bottom, &beneath, &corners, &indices))
        return NULL;
    const Py_ssize_t count = indices.len / (Py_ssize_t)sizeof(uint32_t);
    const int right = cells.side > 0 && holds(&marks, cells.rows * cells.columns * (Py_ssize_t)sizeof(uint64_t)) &&
                      lie_among(indices.buf, count, corners.len / (Py_ssize_t)sizeof(Corner));
    if (right) {
        cells.marks = marks.buf;
        const Box seen = shared_by(box, (Box){0, 0, cells.columns * cells.side, cells.rows * cells.side});
        if (holds_pixels(seen)) mark_all(&cells, seen, beneath, corners.buf, indices.buf, count);
    }
    for (int k = 0; k < 3; ++k) PyBuffer_Release((Py_buffer *[]){&marks, &corners, &indices}[k]);
    if (!right) {
        if (!PyErr_Occurred()) PyErr_SetString(PyExc_ValueError, "cells without pixels were handed over");
        return NULL;
    }
    Py_RETURN_NONE;
}
