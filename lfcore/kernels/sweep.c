/* The plane sweep: mean and deviation of shifted inputs (lfcore.planesweep). */
#include "shares.h"

#define PIXELS_AT_ONCE 16 /* whose channels are written together: so many lines of the nearest cache */

typedef struct {
    const float *luma; /* (inputs, batch, height, width) */
    const int32_t *whole; /* (inputs, levels, 2): whole pixels of each shift along x and y */
    const float *taps; /* (inputs, levels, 2, 4): weights of the samples at -1, 0, 1, 2 past it */
    const int32_t *valid; /* (inputs, levels, 2, 2): along x and y the first place that counts, and the one past the last */
    const int32_t *kept; /* (means), ascending: the levels whose means are put out */
    void *out; /* (batch, rows, columns, means + levels), the last contiguous: these means, then the deviations of all levels */
    Py_ssize_t inputs, batch, height, width, levels, means, top, left, columns;
    Py_ssize_t out_batch, out_row, out_pixel; /* strides in values */
    int halved; /* whether `out` is bfloat16, not float32 */
} Sweep;

/* The taps along y, for `count` columns from `first` on, which may lie beyond the picture: its edge is repeated. */
PART void taps_down(const float *picture, Py_ssize_t height, Py_ssize_t width, Py_ssize_t row, const float *taps,
                    Py_ssize_t first, Py_ssize_t count, float *restrict result) {
    const float *a = picture + within(row, height) * width, *b = picture + within(row + 1, height) * width;
    const float *c = picture + within(row + 2, height) * width, *d = picture + within(row + 3, height) * width;
    const float ta = taps[0], tb = taps[1], tc = taps[2], td = taps[3];
    Py_ssize_t begin = at_most(at_least(-first, 0), count), end = at_least(at_most(width - first, count), begin);
    for (Py_ssize_t x = begin; x < end; ++x) {
        const Py_ssize_t s = first + x;
        result[x] = ta * a[s] + tb * b[s] + tc * c[s] + td * d[s];
    }
    for (Py_ssize_t x = 0; x < begin; ++x) result[x] = ta * a[0] + tb * b[0] + tc * c[0] + td * d[0];
    for (Py_ssize_t x = end; x < count; ++x)
        result[x] = ta * a[width - 1] + tb * b[width - 1] + tc * c[width - 1] + td * d[width - 1];
}

PART void taps_across(const float *restrict source, const float *taps, Py_ssize_t count, float *restrict result) {
    const float ta = taps[0], tb = taps[1], tc = taps[2], td = taps[3];
    for (Py_ssize_t x = 0; x < count; ++x)
        result[x] = ta * source[x] + tb * source[x + 1] + tc * source[x + 2] + td * source[x + 3];
}

/* Columns of the window from `begin` on, `end` not included. */
typedef struct {
    Py_ssize_t begin, end;
} Span;

/* Where input n counts in row y at a level: an empty span at the window's beginning for nowhere. */
PART Span counting(const Sweep *sweep, Py_ssize_t n, Py_ssize_t level, Py_ssize_t y) {
    const int32_t *valid = sweep->valid + 4 * (n * sweep->levels + level);
    if (y < valid[2] || y >= valid[3]) return (Span){0, 0};
    const Py_ssize_t begin = at_least(valid[0] - sweep->left, 0), end = at_most(valid[1] - sweep->left, sweep->columns);
    return begin < end ? (Span){begin, end} : (Span){0, 0};
}

PART Span common(Span a, Span b) {
    const Py_ssize_t begin = at_least(a.begin, b.begin), end = at_most(a.end, b.end);
    return begin < end ? (Span){begin, end} : (Span){0, 0};
}

/* One input's row at one level. moved: room for three more. */
PART void shift_row(const Sweep *sweep, Py_ssize_t k, Py_ssize_t n, Py_ssize_t level, Py_ssize_t y, Span span,
                    float *restrict moved, float *restrict result) {
    const Py_ssize_t place = n * sweep->levels + level, count = span.end - span.begin;
    const int32_t *whole = sweep->whole + 2 * place;
    const float *taps = sweep->taps + 8 * place;
    const float *picture = sweep->luma + (n * sweep->batch + k) * sweep->height * sweep->width;
    taps_down(picture, sweep->height, sweep->width, y + whole[1] - 1, taps + 4, sweep->left + span.begin + whole[0] - 1,
              count + 3, moved);
    taps_across(moved, taps, count, result + span.begin);
}

#define CORNERS 4

/* Mean and deviation where all of four inputs count, which is most of a picture. shifted: (CORNERS, columns). */
PART void of_all(const float *shifted, Py_ssize_t columns, Span span, float *restrict mean, float *restrict deviation) {
    const float *restrict a = shifted, *restrict b = a + columns, *restrict c = b + columns, *restrict d = c + columns;
    for (Py_ssize_t x = span.begin; x < span.end; ++x) {
        const float middle = 0.25f * ((a[x] + b[x]) + (c[x] + d[x]));
        const float from_a = a[x] - middle, from_b = b[x] - middle, from_c = c[x] - middle, from_d = d[x] - middle;
        mean[x] = middle;
        deviation[x] = sqrtf(((from_a * from_a + from_b * from_b) + (from_c * from_c + from_d * from_d)) * (1.0f / 3));
    }
}

/* The same over the inputs that count at each place, which are those in their spans. counted: room for a row. */
PART void of_some(const Sweep *sweep, const Span *spans, const float *shifted, Span span, float *restrict counted,
                  float *restrict mean, float *restrict deviation) {
    for (Py_ssize_t x = span.begin; x < span.end; ++x) mean[x] = deviation[x] = counted[x] = 0.0f;
    for (Py_ssize_t n = 0; n < sweep->inputs; ++n) {
        const float *restrict here = shifted + n * sweep->columns;
        const Span own = common(spans[n], span);
        for (Py_ssize_t x = own.begin; x < own.end; ++x) {
            mean[x] += here[x];
            counted[x] += 1.0f;
        }
    }
    for (Py_ssize_t x = span.begin; x < span.end; ++x) mean[x] /= counted[x] > 1.0f ? counted[x] : 1.0f;
    for (Py_ssize_t n = 0; n < sweep->inputs; ++n) {
        const float *restrict here = shifted + n * sweep->columns;
        const Span own = common(spans[n], span);
        for (Py_ssize_t x = own.begin; x < own.end; ++x) {
            const float away = here[x] - mean[x];
            deviation[x] += away * away;
        }
    }
    for (Py_ssize_t x = span.begin; x < span.end; ++x)
        deviation[x] = sqrtf(deviation[x] / (counted[x] > 2.0f ? counted[x] - 1.0f : 1.0f));
}

/* What a row needs while it is computed. */
typedef struct {
    float *moved, *counted, *mean, *shifted; /* (columns + 3), (columns), (columns), (inputs, columns) */
    Span *spans; /* (inputs) */
} Room;

/* Mean and deviation of one row at one level. */
PART void level_row(const Sweep *sweep, Py_ssize_t k, Py_ssize_t level, Py_ssize_t y, const Room *room, float *restrict mean,
                    float *restrict deviation) {
    const Py_ssize_t w = sweep->columns;
    Span all = {0, sweep->inputs == CORNERS ? w : 0};
    for (Py_ssize_t n = 0; n < sweep->inputs; ++n) {
        const Span own = room->spans[n] = counting(sweep, n, level, y);
        if (own.begin < own.end) shift_row(sweep, k, n, level, y, own, room->moved, room->shifted + n * w);
        all = common(all, own);
    }
    of_some(sweep, room->spans, room->shifted, (Span){0, all.begin}, room->counted, mean, deviation);
    of_all(room->shifted, w, all, mean, deviation);
    of_some(sweep, room->spans, room->shifted, (Span){all.end, w}, room->counted, mean, deviation);
}

/* Eight rows of eight values to as many columns: what lay at [i][j] lies at [j][i]. */
PART void transpose(EightWhole rows[8]) {
    EightWhole pairs[8], fours[8];
    for (int i = 0; i < 8; i += 2) {
        pairs[i] = SHUFFLE(rows[i], rows[i + 1], 0, 8, 1, 9, 4, 12, 5, 13);
        pairs[i + 1] = SHUFFLE(rows[i], rows[i + 1], 2, 10, 3, 11, 6, 14, 7, 15);
    }
    for (int i = 0; i < 8; i += 4)
        for (int k = 0; k < 2; ++k) {
            fours[i + 2 * k] = SHUFFLE(pairs[i + k], pairs[i + k + 2], 0, 1, 8, 9, 4, 5, 12, 13);
            fours[i + 2 * k + 1] = SHUFFLE(pairs[i + k], pairs[i + k + 2], 2, 3, 10, 11, 6, 7, 14, 15);
        }
    for (int i = 0; i < 4; ++i) {
        rows[i] = SHUFFLE(fours[i], fours[i + 4], 0, 1, 2, 3, 8, 9, 10, 11);
        rows[i + 4] = SHUFFLE(fours[i], fours[i + 4], 4, 5, 6, 7, 12, 13, 14, 15);
    }
}

PART EightWhole whole_at(const float *values) {
    EightWhole whole;
    memcpy(&whole, values, sizeof whole);
    return whole;
}

/* `rounded`, of eight. */
PART EightWhole rounded_eight(EightWhole bits) { return (bits + 0x7FFF + ((bits >> 16) & 1)) >> 16 & 0xFFFF; }

/* Of eight pixels a value of 32 bits each: a channel, or two that are rounded. room: floats of a row. */
PART EightWhole values_of_row(const float *rows, Py_ssize_t room, Py_ssize_t value, Py_ssize_t x, int halved) {
    if (!halved) return whole_at(rows + value * room + x);
    const float *low = rows + 2 * value * room + x;
    return rounded_eight(whole_at(low)) | rounded_eight(whole_at(low + room)) << 16;
}

/* Floats that a row of so many pixels takes: whole squares. */
PART Py_ssize_t row_room(Py_ssize_t pixels) { return (pixels + 7) / 8 * 8; }

/* Rows of channels to `w` pixels of channels, an even number of them, in squares of eight values of 32 bits; the last ones overlap
 * those before. rows: (channels, `row_room`), at least 16 rows. out: of the first pixel; to_next: bytes to the next. */
PART void write_pixels(const float *rows, Py_ssize_t channels, Py_ssize_t w, int halved, char *out, Py_ssize_t to_next) {
    const Py_ssize_t values = halved ? channels / 2 : channels, side = at_most(values, 8);
    for (Py_ssize_t first = 0; first < w; first += PIXELS_AT_ONCE)
        for (Py_ssize_t next = 0; next < values; next += 8)
            for (Py_ssize_t x = first; x < at_most(first + PIXELS_AT_ONCE, w); x += 8) {
                const Py_ssize_t value = at_most(next, values - side);
                char *place = out + x * to_next + 4 * value;
                EightWhole square[8];
                for (int i = 0; i < 8; ++i) square[i] = values_of_row(rows, row_room(w), value + i, x, halved);
                transpose(square);
                for (int i = 0; i < at_most(w - x, 8); ++i) {
                    if (side == 8)
                        memcpy(place + i * to_next, &square[i], sizeof square[i]);
                    else
                        memcpy(place + i * to_next, &square[i], 4 * side);
                }
            }
}

/* Rows `begin` to `end` of the window; 0, or -1 where there is no memory. */
MANY_PROCESSORS
static int sweep_rows(const Sweep *sweep, Py_ssize_t begin, Py_ssize_t end) {
    const Py_ssize_t w = sweep->columns, means = sweep->means, channels = means + sweep->levels, of_row = row_room(w);
    const Py_ssize_t room_floats = (w + 3) + 2 * w + sweep->inputs * w;
    float *memory = malloc((room_floats + at_least(channels, 16) * of_row) * sizeof(float));
    Span *spans = malloc(sweep->inputs * sizeof(Span));
    if (memory == NULL || spans == NULL) {
        free(memory);
        free(spans);
        return -1;
    }
    float *rows = memory + room_floats;
    const Room room = {memory, memory + w + 3, memory + w + 3 + w, memory + w + 3 + 2 * w, spans};
    for (Py_ssize_t k = 0; k < sweep->batch; ++k)
        for (Py_ssize_t y = begin; y < end; ++y) {
            Py_ssize_t put_out = 0; /* of the means */
            for (Py_ssize_t level = 0; level < sweep->levels; ++level) {
                const int keeps = put_out < means && sweep->kept[put_out] == level;
                level_row(sweep, k, level, sweep->top + y, &room, keeps ? rows + put_out * of_row : room.mean,
                          rows + (means + level) * of_row);
                put_out += keeps;
            }
            const Py_ssize_t size = sweep->halved ? 2 : 4, place = k * sweep->out_batch + y * sweep->out_row;
            write_pixels(rows, channels, w, sweep->halved, (char *)sweep->out + place * size, sweep->out_pixel * size);
        }
    free(memory);
    free(spans);
    return 0;
}

static int sweep_all(const Sweep *sweep, Py_ssize_t rows, int threads) {
    const Py_ssize_t parts = at_most(threads * PARTS_PER_THREAD, rows);
    Shares shares;
    share_out(&shares, parts, threads);
    int failed = 0;
#pragma omp parallel num_threads(threads) reduction(| : failed)
    EACH_SHARED(part, &shares)
        failed |= sweep_rows(sweep, rows * part / parts, rows * (part + 1) / parts);
    return failed;
}

PyObject *plane_sweep(PyObject *Py_UNUSED(module), PyObject *arguments) {
    Sweep sweep;
    unsigned long long luma, whole, taps, valid, kept, out;
    Py_ssize_t rows;
    int threads;
    if (!PyArg_ParseTuple(arguments, "KKKKKKnnnnnnnnnnnnnpi", &luma, &whole, &taps, &valid, &kept, &out, &sweep.inputs, &sweep.batch,
                          &sweep.height, &sweep.width, &sweep.levels, &sweep.means, &sweep.top, &sweep.left, &rows, &sweep.columns,
                          &sweep.out_batch, &sweep.out_row, &sweep.out_pixel, &sweep.halved, &threads))
        return NULL;
    sweep.luma = at_address(luma);
    sweep.whole = at_address(whole);
    sweep.taps = at_address(taps);
    sweep.valid = at_address(valid);
    sweep.kept = at_address(kept);
    sweep.out = at_address(out);
    int failed;
    Py_BEGIN_ALLOW_THREADS
    failed = sweep_all(&sweep, rows, threads);
    Py_END_ALLOW_THREADS
    if (failed) return PyErr_NoMemory();
    Py_RETURN_NONE;
}
