/* A picture at another size, between neighbouring pixels: shaders/show_image.frag for the processor. */
#include "painting.h"

#define WHOLE 128 /* a share of one; 255 of them fit into 15 bits */

typedef uint8_t Bytes16 __attribute__((vector_size(16)));
typedef uint16_t Short8 __attribute__((vector_size(16))); /* two pixels, or the shares of both */

typedef struct {
    const int32_t *first; /* which pixel each one lies after */
    const float *share; /* of the next one */
    Py_ssize_t count;
} Places;

/* Two neighbouring pixels of a row, as numbers. */
PART Short8 two_pixels(const uint32_t *place) {
    Bytes16 bytes = {0};
    memcpy(&bytes, place, 8);
    const Bytes16 none = {0};
#if defined(__clang__) || __GNUC__ >= 12
    return (Short8)__builtin_shufflevector(bytes, none, 0, 16, 1, 17, 2, 18, 3, 19, 4, 20, 5, 21, 6, 22, 7, 23);
#else
    return (Short8)__builtin_shuffle(bytes, none, (Bytes16){0, 16, 1, 17, 2, 18, 3, 19, 4, 20, 5, 21, 6, 22, 7, 23});
#endif
}

/* A row of pixels with blue and red exchanged, its last one twice. */
MANY_PROCESSORS
static void blue_first(const uint32_t *restrict row, uint32_t *restrict out, Py_ssize_t width) {
    for (Py_ssize_t x = 0; x < width; ++x)
        out[x] = (row[x] & 0xFF00FF00u) | ((row[x] >> 16) & 0xFFu) | ((row[x] & 0xFFu) << 16);
    out[width] = out[width - 1];
}

/* The row at the places along it, times WHOLE. */
MANY_PROCESSORS
static void along_row(const uint32_t *row, const Places *columns, const Short8 *shares, uint16_t *out) {
    for (Py_ssize_t x = 0; x < columns->count; ++x) {
        const Short8 both = two_pixels(row + columns->first[x]) * shares[x];
        uint64_t halves[2];
        memcpy(halves, &both, sizeof both);
        halves[0] += halves[1]; /* no channel's sum is greater than its 16 bits */
        memcpy(out + x * CHANNELS, halves, sizeof *halves);
    }
}

/* Between two such rows; `share` of WHOLE is that of the one below. */
MANY_PROCESSORS
static void between_rows(const uint16_t *restrict above, const uint16_t *restrict below, int share, uint8_t *restrict out,
                         Py_ssize_t count) {
    const int16_t factor = (int16_t)(at_most(share, WHOLE - 1) * (32768 / WHOLE));
    for (Py_ssize_t i = 0; i < count; ++i) {
        const int16_t way = (int16_t)(below[i] - above[i]), part = (int16_t)((way * factor) >> 16);
        out[i] = (uint8_t)((uint16_t)(above[i] + 2 * part + WHOLE / 2) / WHOLE);
    }
}

PART uint16_t whole_share(float share) { return (uint16_t)(share * WHOLE + 0.5f); }

typedef struct {
    const uint32_t *pixels; /* (height, width), CHANNELS bytes each */
    Py_ssize_t height, width;
    Places rows, columns;
    uint8_t *out; /* (rows, columns, CHANNELS) */
    Py_ssize_t to_next; /* bytes from one row of it to the next */
} Enlarging;

/* Memory for the work. */
typedef struct {
    Short8 *shares; /* of each column */
    uint32_t *row; /* of the picture, blue first, its last pixel twice */
    uint16_t *along[2]; /* the two rows worked on last */
    Py_ssize_t which[2]; /* rows of the picture they are */
} Scratch;

/* A row of the picture at the places along it; the one that is not `other` is overwritten where it is not there. */
static const uint16_t *row_at(const Enlarging *e, Scratch *s, Py_ssize_t row, Py_ssize_t other) {
    for (int k = 0; k < 2; ++k)
        if (s->which[k] == row) return s->along[k];
    const int k = s->which[0] == other;
    blue_first(e->pixels + row * e->width, s->row, e->width);
    along_row(s->row, &e->columns, s->shares, s->along[k]);
    s->which[k] = row;
    return s->along[k];
}

static void enlarge(const Enlarging *e, Scratch *s) {
    for (Py_ssize_t x = 0; x < e->columns.count; ++x) {
        const uint16_t next = whole_share(e->columns.share[x]), own = (uint16_t)(WHOLE - next);
        s->shares[x] = (Short8){own, own, own, own, next, next, next, next};
    }
    const Py_ssize_t values = e->columns.count * CHANNELS;
    s->which[0] = s->which[1] = -1;
    for (Py_ssize_t y = 0; y < e->rows.count; ++y) {
        const Py_ssize_t first = e->rows.first[y], next = at_most(first + 1, e->height - 1);
        const uint16_t *above = row_at(e, s, first, next), *below = row_at(e, s, next, first);
        between_rows(above, below, whole_share(e->rows.share[y]), e->out + y * e->to_next, values);
    }
}

/* Whether all places lie in a picture of that size; else an exception is set. */
static int lie_within(const Places *places, Py_ssize_t size) {
    for (Py_ssize_t i = 0; i < places->count; ++i)
        if (places->first[i] < 0 || places->first[i] >= size || !(places->share[i] >= 0.0f && places->share[i] <= 1.0f)) {
            PyErr_SetString(PyExc_ValueError, "a place lies beyond the picture");
            return 0;
        }
    return 1;
}

static int enlarge_in_scratch(const Enlarging *e) {
    const size_t row = (size_t)(e->columns.count * CHANNELS) * sizeof(uint16_t);
    Scratch s = {malloc((size_t)e->columns.count * sizeof(Short8)), malloc((size_t)(e->width + 1) * CHANNELS),
                 {malloc(row), malloc(row)}, {-1, -1}};
    const int room = s.shares && s.row && s.along[0] && s.along[1];
    if (room) {
        Py_BEGIN_ALLOW_THREADS
        enlarge(e, &s);
        Py_END_ALLOW_THREADS
    } else
        PyErr_NoMemory();
    free(s.shares);
    free(s.row);
    free(s.along[0]);
    free(s.along[1]);
    return room;
}

/* Whether pixels of so many rows and columns can be written there, whose rows may lie apart; else an exception is set. */
static int are_pixels(const Py_buffer *out, Py_ssize_t rows, Py_ssize_t columns) {
    const int laid_out = out->ndim == 3 && out->shape[2] == CHANNELS && out->strides[2] == 1 && out->strides[1] == CHANNELS;
    if (laid_out && out->shape[0] == rows && out->shape[1] == columns) return 1;
    PyErr_Format(PyExc_ValueError, "%zd bytes laid out otherwise were handed over in place of %zd x %zd pixels", out->len, rows,
                 columns);
    return 0;
}

static Places places_in(const Py_buffer *first, const Py_buffer *share) {
    return (Places){first->buf, share->buf, first->len / (Py_ssize_t)sizeof(int32_t)};
}

PyObject *enlarged(PyObject *Py_UNUSED(module), PyObject *arguments) {
    Enlarging e;
    Py_buffer pixels, rows, row_shares, columns, column_shares, out = {0};
    PyObject *written;
    if (!PyArg_ParseTuple(arguments, "nny*(y*y*)(y*y*)O", &e.height, &e.width, &pixels, &rows, &row_shares, &columns,
                          &column_shares, &written))
        return NULL;
    e.rows = places_in(&rows, &row_shares);
    e.columns = places_in(&columns, &column_shares);
    int right = PyObject_GetBuffer(written, &out, PyBUF_WRITABLE | PyBUF_STRIDES) == 0 && e.height > 0 && e.width > 0 &&
                holds(&pixels, e.height * e.width * CHANNELS) && holds(&row_shares, rows.len) &&
                holds(&column_shares, columns.len) && are_pixels(&out, e.rows.count, e.columns.count) &&
                lie_within(&e.rows, e.height) && lie_within(&e.columns, e.width);
    if (right) {
        e.pixels = pixels.buf;
        e.out = out.buf;
        e.to_next = out.strides[0];
        right = enlarge_in_scratch(&e);
    }
    for (int k = 0; k < 6; ++k) PyBuffer_Release((Py_buffer *[]){&pixels, &rows, &row_shares, &columns, &column_shares, &out}[k]);
    if (!right) return NULL;
    Py_RETURN_NONE;
}
