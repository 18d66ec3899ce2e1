/* Triangles as OpenGL draws them, blended over what is there: what imgui's panels consist of. */
#include "corners.h"

#define PART_OF_PIXEL 256 /* corners lie at multiples of it, as software rasterisers have them */

typedef struct {
    uint32_t *pixels; /* blue first */
    Py_ssize_t width, height;
} Sheet;

typedef struct {
    const uint32_t *pixels; /* red first */
    Py_ssize_t width, height;
    int white; /* whether they differ only in how much they cover */
} Texture;

/* What changes evenly over a triangle: red, green, blue and covering of 0 to 255. */
typedef struct {
    Four at_first, across, down; /* at the centre of the sheet's first pixel, and from one pixel to the next */
} Slope;

/* The same of the place in the texture, in its pixels from the first one's centre. */
typedef struct {
    float at_first[2], across[2], down[2];
} Place;

PART Four channels_of(uint32_t pixel) {
    return (Four){(float)(pixel & 0xFFu), (float)(pixel >> 8 & 0xFFu), (float)(pixel >> 16 & 0xFFu), (float)(pixel >> 24)};
}

/* A place between four pixels, at multiples of 1/256 as graphics have them; at the edges these. */
typedef struct {
    const uint32_t *at;
    Py_ssize_t next, below; /* from there to the pixel beside it, and to that below it */
    int32_t share_x, share_y; /* of these */
} Between;

PART Between place_in(const Texture *t, float x, float y) {
    const float right = (float)(t->width - 1), low = (float)(t->height - 1);
    const int32_t whole_x = (int32_t)(bounded(x, 0.0f, right) * PART_OF_PIXEL + 0.5f);
    const int32_t whole_y = (int32_t)(bounded(y, 0.0f, low) * PART_OF_PIXEL + 0.5f);
    const Py_ssize_t column = whole_x / PART_OF_PIXEL, row = whole_y / PART_OF_PIXEL;
    return (Between){t->pixels + row * t->width + column, column + 1 < t->width, row + 1 < t->height ? t->width : 0,
                     whole_x % PART_OF_PIXEL, whole_y % PART_OF_PIXEL};
}

PART Four mixed_of(Four one, Four other, int32_t share) { return one + (float)share / PART_OF_PIXEL * (other - one); }

PART Four sampled(const Texture *t, float x, float y) {
    const Between p = place_in(t, x, y);
    return mixed_of(mixed_of(channels_of(p.at[0]), channels_of(p.at[p.next]), p.share_x),
                    mixed_of(channels_of(p.at[p.below]), channels_of(p.at[p.below + p.next]), p.share_x), p.share_y);
}

/* How much it covers there, of 255 * PART_OF_PIXEL * PART_OF_PIXEL. */
PART uint32_t covering(const Texture *t, float x, float y) {
    const Between p = place_in(t, x, y);
    const uint32_t share_x = (uint32_t)p.share_x, share_y = (uint32_t)p.share_y;
    const uint32_t above = (p.at[0] >> 24) * (PART_OF_PIXEL - share_x) + (p.at[p.next] >> 24) * share_x;
    const uint32_t below = (p.at[p.below] >> 24) * (PART_OF_PIXEL - share_x) + (p.at[p.below + p.next] >> 24) * share_x;
    return above * (PART_OF_PIXEL - share_y) + below * share_y;
}

PART uint32_t rounded_255th(uint32_t value) { return (value + 128 + ((value + 128) >> 8)) >> 8; }

/* A colour of 0 to 255, blue first, over a pixel that it covers by so much of 255. */
PART uint32_t blended(uint32_t colour, uint32_t below, uint32_t cover) {
    uint32_t result = 0xFF000000u;
    for (int shift = 0; shift < 24; shift += 8)
        result |= rounded_255th((colour >> shift & 0xFFu) * cover + (below >> shift & 0xFFu) * (255 - cover)) << shift;
    return result;
}

PART uint32_t byte_of(float value) { return (uint32_t)(int32_t)(bounded(value, 0.0f, 255.0f) + 0.5f); }

PART uint32_t blue_first(Four colour) { return byte_of(colour[0]) << 16 | byte_of(colour[1]) << 8 | byte_of(colour[2]); }

PART void blend(uint32_t *pixel, Four colour) {
    const uint32_t cover = byte_of(colour[3]);
    if (cover) *pixel = blended(blue_first(colour), *pixel, cover);
}

/* Pixels of a row: from `left` to `right`, without it. */
typedef struct {
    Py_ssize_t left, right;
} Span;

PART int64_t floor_of(int64_t value, int64_t by) { return value >= 0 ? value / by : -((by - 1 - value) / by); }

/* A line from one corner of a triangle to the next, where inside is to its right: not negative inside, of a pixel (x, y)
 * `start - x * across + y * down`. Of pixels whose centre lies on it those to the right of it or below it are inside, so that two
 * triangles share none. */
typedef struct {
    int64_t start, across, down;
} Side;

PART Side side_of(const int32_t from[2], const int32_t to[2]) {
    const int64_t across = to[0] - from[0], down = to[1] - from[1], half = PART_OF_PIXEL / 2;
    const int includes = down < 0 || (down == 0 && across > 0);
    return (Side){across * (half - from[1]) - down * (half - from[0]) - !includes, down * PART_OF_PIXEL, across * PART_OF_PIXEL};
}

/* What of a span of row y lies inside. */
PART void cut(Span *s, const Side *side, int64_t y) {
    const int64_t start = side->start + y * side->down;
    if (side->across > 0)
        s->right = at_most(s->right, (Py_ssize_t)floor_of(start, side->across) + 1);
    else if (side->across < 0)
        s->left = at_least(s->left, (Py_ssize_t)-floor_of(start, -side->across));
    else if (start < 0)
        s->right = s->left;
}

#define NARROW 12 /* pixels: looking at each of so many is faster than three divisions */

/* The same of all three sides. */
PART void cut_narrow(Span *s, const Side sides[3], int64_t y) {
    int64_t at[3];
    for (int i = 0; i < 3; ++i) at[i] = sides[i].start + y * sides[i].down - (int64_t)s->left * sides[i].across;
    Span inside = {s->right, s->right};
    for (Py_ssize_t x = s->left; x < s->right; ++x) {
        if ((at[0] | at[1] | at[2]) >= 0) {
            if (inside.left == s->right) inside.left = x;
            inside.right = x + 1;
        } else if (inside.left < s->right)
            break;
        for (int i = 0; i < 3; ++i) at[i] -= sides[i].across;
    }
    if (inside.left == s->right) inside.right = inside.left;
    *s = inside;
}

typedef struct {
    const Corner *of[3];
    int32_t at[3][2]; /* places of the corners in parts of a pixel; inside is to the right of the way round */
} Triangle;

PART int32_t parts_of(float place) { return (int32_t)lrintf(bounded(place, -FARTHEST, FARTHEST) * PART_OF_PIXEL); }

/* Whether it has any inside. */
PART int set_up(Triangle *t, const Corner *a, const Corner *b, const Corner *c) {
    t->of[0] = a, t->of[1] = b, t->of[2] = c;
    for (int i = 0; i < 3; ++i) {
        t->at[i][0] = parts_of(t->of[i]->x);
        t->at[i][1] = parts_of(t->of[i]->y);
    }
    const int64_t area = (int64_t)(t->at[1][0] - t->at[0][0]) * (t->at[2][1] - t->at[0][1]) -
                         (int64_t)(t->at[2][0] - t->at[0][0]) * (t->at[1][1] - t->at[0][1]);
    if (area >= 0) return area > 0;
    const Triangle before = *t;
    t->of[1] = before.of[2], t->of[2] = before.of[1];
    memcpy(t->at[1], before.at[2], sizeof t->at[1]);
    memcpy(t->at[2], before.at[1], sizeof t->at[2]);
    return 1;
}

/* Shares of the second and the third corner, at the centre of the sheet's first pixel and from one pixel to the next. */
typedef struct {
    float at_first[2], across[2], down[2];
} Shares;

PART Shares shares_of(const Triangle *t) {
    const double scale = PART_OF_PIXEL, x = t->at[0][0] / scale, y = t->at[0][1] / scale;
    const double bx = t->at[1][0] / scale - x, by = t->at[1][1] / scale - y, cx = t->at[2][0] / scale - x, cy = t->at[2][1] / scale - y;
    const double area = bx * cy - cx * by, from_x = 0.5 - x, from_y = 0.5 - y;
    return (Shares){{(float)((from_x * cy - cx * from_y) / area), (float)((bx * from_y - from_x * by) / area)},
                    {(float)(cy / area), (float)(-by / area)},
                    {(float)(-cx / area), (float)(bx / area)}};
}

PART Slope colours_of(const Triangle *t, const Shares *s) {
    const Four first = channels_of(t->of[0]->colour), second = channels_of(t->of[1]->colour) - first,
               third = channels_of(t->of[2]->colour) - first;
    return (Slope){first + s->at_first[0] * second + s->at_first[1] * third, s->across[0] * second + s->across[1] * third,
                   s->down[0] * second + s->down[1] * third};
}

PART Place places_of(const Triangle *t, const Shares *s, const Texture *texture) {
    Place p;
    for (int axis = 0; axis < 2; ++axis) {
        const float size = (float)(axis ? texture->height : texture->width);
        float of[3];
        for (int i = 0; i < 3; ++i) of[i] = (axis ? t->of[i]->v : t->of[i]->u) * size - 0.5f;
        p.at_first[axis] = of[0] + s->at_first[0] * (of[1] - of[0]) + s->at_first[1] * (of[2] - of[0]);
        p.across[axis] = s->across[0] * (of[1] - of[0]) + s->across[1] * (of[2] - of[0]);
        p.down[axis] = s->down[0] * (of[1] - of[0]) + s->down[1] * (of[2] - of[0]);
    }
    return p;
}

PART int alike(const Triangle *t) {
    return t->of[0]->colour == t->of[1]->colour && t->of[0]->colour == t->of[2]->colour;
}

PART int at_one_place(const Triangle *t) {
    return t->of[0]->u == t->of[1]->u && t->of[0]->v == t->of[1]->v && t->of[0]->u == t->of[2]->u && t->of[0]->v == t->of[2]->v;
}

/* One colour over a span. */
PART void fill(uint32_t *row, Span s, Four colour) {
    const uint32_t pixel = blue_first(colour), cover = byte_of(colour[3]);
    if (cover == 255)
        for (Py_ssize_t x = s.left; x < s.right; ++x) row[x] = pixel | 0xFF000000u;
    else
        for (Py_ssize_t x = s.left; x < s.right; ++x) row[x] = blended(pixel, row[x], cover);
}

/* One colour over a span, as far as a white texture covers it: letters. */
PART void fill_through(uint32_t *row, Span s, Py_ssize_t y, Four colour, const Texture *texture, const Place *p) {
    const uint32_t pixel = blue_first(colour), most = byte_of(colour[3]);
    const float u = p->at_first[0] + (float)y * p->down[0], v = p->at_first[1] + (float)y * p->down[1];
    for (Py_ssize_t x = s.left; x < s.right; ++x) {
        const uint32_t covers = covering(texture, u + (float)x * p->across[0], v + (float)x * p->across[1]);
        if (covers == 0) continue;
        const uint32_t whole = (covers + PART_OF_PIXEL * PART_OF_PIXEL / 2) / (PART_OF_PIXEL * PART_OF_PIXEL);
        row[x] = blended(pixel, row[x], most == 255 ? whole : rounded_255th(whole * most));
    }
}

/* What of an axis lies between two places, in parts of a pixel, and within bounds: pixels whose centre does. */
PART Span between(int32_t first, int32_t last, Py_ssize_t least, Py_ssize_t most) {
    const int64_t half = PART_OF_PIXEL / 2 - 1;
    return (Span){at_least(least, (Py_ssize_t)floor_of(first + half, PART_OF_PIXEL)),
                  at_most(most, (Py_ssize_t)floor_of(last + half, PART_OF_PIXEL))};
}

/* What a triangle, or two that make a rectangle, is filled with. */
typedef struct {
    Slope slope;
    Place place;
    int one_place, one_colour;
    Four of_texture; /* where it is one place of it */
} Filling;

PART Filling filling_of(const Triangle *t, const Texture *texture) {
    const Shares shares = shares_of(t);
    Filling f = {colours_of(t, &shares), places_of(t, &shares, texture), at_one_place(t), alike(t), {0}};
    if (f.one_place) f.of_texture = sampled(texture, f.place.at_first[0], f.place.at_first[1]) / 255.0f;
    return f;
}

PART void paint_span(uint32_t *row, Span s, Py_ssize_t y, const Filling *f, const Texture *texture) {
    if (f->one_colour && f->one_place) {
        fill(row, s, f->slope.at_first * f->of_texture);
        return;
    }
    if (f->one_colour && texture->white) {
        fill_through(row, s, y, f->slope.at_first, texture, &f->place);
        return;
    }
    const float low = (float)y;
    for (Py_ssize_t x = s.left; x < s.right; ++x) {
        const float right = (float)x;
        const Four colour = f->slope.at_first + right * f->slope.across + low * f->slope.down;
        const Four seen = f->one_place ? f->of_texture
                                       : sampled(texture, f->place.at_first[0] + right * f->place.across[0] + low * f->place.down[0],
                                                 f->place.at_first[1] + right * f->place.across[1] + low * f->place.down[1]) /
                                             255.0f;
        blend(row + x, colour * seen);
    }
}

/* Within the box, which lies within the sheet. */
PART void paint_triangle(const Sheet *sheet, Box box, const Texture *texture, const Triangle *t) {
    int32_t first[2], last[2];
    for (int axis = 0; axis < 2; ++axis) {
        first[axis] = last[axis] = t->at[0][axis];
        for (int i = 1; i < 3; ++i) {
            first[axis] = t->at[i][axis] < first[axis] ? t->at[i][axis] : first[axis];
            last[axis] = t->at[i][axis] > last[axis] ? t->at[i][axis] : last[axis];
        }
    }
    /* One more on the far sides: what lies just there is decided by the sides. */
    const Span columns = between(first[0], last[0] + 1, box.left, box.right), rows = between(first[1], last[1] + 1, box.top, box.bottom);
    if (columns.left >= columns.right || rows.left >= rows.right) return;
    const Filling filling = filling_of(t, texture);
    Side sides[3];
    for (int i = 0; i < 3; ++i) sides[i] = side_of(t->at[i], t->at[(i + 1) % 3]);
    for (Py_ssize_t y = rows.left; y < rows.right; ++y) {
        Span s = columns;
        if (columns.right - columns.left <= NARROW)
            cut_narrow(&s, sides, y);
        else
            for (int i = 0; i < 3; ++i) cut(&s, &sides[i], y);
        paint_span(sheet->pixels + y * sheet->width, s, y, &filling, texture);
    }
}

/* Whether four corners, one after the other around it, are an upright rectangle in one colour, and its texture is upright as well. */
PART int is_rectangle(const Corner *a, const Corner *b, const Corner *c, const Corner *d) {
    return a->y == b->y && b->x == c->x && c->y == d->y && d->x == a->x && a->x < c->x && a->y < c->y && a->colour == b->colour &&
           a->colour == c->colour && a->colour == d->colour && a->u == d->u && b->u == c->u && a->v == b->v && c->v == d->v;
}

/* The triangle is half of the rectangle. */
PART void paint_rectangle(const Sheet *sheet, Box box, const Texture *texture, const Triangle *t, const Corner *a, const Corner *c) {
    const Span columns = between(parts_of(a->x), parts_of(c->x), box.left, box.right);
    const Span rows = between(parts_of(a->y), parts_of(c->y), box.top, box.bottom);
    if (columns.left >= columns.right || rows.left >= rows.right) return;
    const Filling filling = filling_of(t, texture);
    for (Py_ssize_t y = rows.left; y < rows.right; ++y)
        paint_span(sheet->pixels + y * sheet->width, columns, y, &filling, texture);
}

/* What is painted of a sheet: boxes within it, of which no two share a pixel. */
typedef struct {
    Sheet sheet;
    const Box *boxes;
    Py_ssize_t count;
} Painting;

PART int reaches(const Painting *p, Box bounds) {
    for (Py_ssize_t k = 0; k < p->count; ++k)
        if (holds_pixels(shared_by(bounds, p->boxes[k]))) return 1;
    return 0;
}

MANY_PROCESSORS
static void paint_all(const Painting *p, const Texture *texture, const Corner *corners, const uint32_t *indices, Py_ssize_t count) {
    for (Py_ssize_t i = 0; i + 3 <= count; i += 3) {
        const Corner *a = corners + indices[i], *b = corners + indices[i + 1], *c = corners + indices[i + 2];
        Triangle t;
        if (!reaches(p, bounds_of(a, b, c)) || !set_up(&t, a, b, c)) continue;
        const int of_two = i + 6 <= count && indices[i + 3] == indices[i] && indices[i + 4] == indices[i + 2];
        const int is_half = of_two && is_rectangle(a, b, c, corners + indices[i + 5]);
        for (Py_ssize_t k = 0; k < p->count; ++k)
            if (is_half)
                paint_rectangle(&p->sheet, p->boxes[k], texture, &t, a, c);
            else
                paint_triangle(&p->sheet, p->boxes[k], texture, &t);
        if (is_half) i += 3;
    }
}

int lie_among(const uint32_t *indices, Py_ssize_t count, Py_ssize_t corners) {
    for (Py_ssize_t i = 0; i < count; ++i)
        if ((Py_ssize_t)indices[i] >= corners) {
            PyErr_SetString(PyExc_ValueError, "a triangle names a corner that is not there");
            return 0;
        }
    return 1;
}

/* Copies of boxes, as far as they lie within the sheet; else an exception is set. */
static Box *within_sheet(const Py_buffer *boxes, Py_ssize_t count, const Sheet *sheet) {
    Box *copies = malloc((size_t)(count + 1) * sizeof(Box));
    if (!copies) PyErr_NoMemory();
    for (Py_ssize_t k = 0; copies && k < count; ++k) {
        int64_t sides[4];
        memcpy(sides, (const int64_t *)boxes->buf + 4 * k, sizeof sides);
        copies[k] = shared_by((Box){sides[0], sides[1], sides[2], sides[3]}, (Box){0, 0, sheet->width, sheet->height});
    }
    return copies;
}

PyObject *triangles(PyObject *Py_UNUSED(module), PyObject *arguments) {
    Painting p;
    Texture texture;
    Py_buffer pixels, boxes, of_texture, corners, indices;
    if (!PyArg_ParseTuple(arguments, "nnw*ny*nny*py*y*", &p.sheet.height, &p.sheet.width, &pixels, &p.count, &boxes, &texture.height,
                          &texture.width, &of_texture, &texture.white, &corners, &indices))
        return NULL;
    const Py_ssize_t count = indices.len / (Py_ssize_t)sizeof(uint32_t);
    Box *copies = NULL;
    const int right = holds(&pixels, p.sheet.height * p.sheet.width * CHANNELS) && texture.height > 0 && texture.width > 0 &&
                      holds(&of_texture, texture.height * texture.width * CHANNELS) &&
                      holds(&boxes, p.count * 4 * (Py_ssize_t)sizeof(int64_t)) &&
                      lie_among(indices.buf, count, corners.len / (Py_ssize_t)sizeof(Corner)) &&
                      (copies = within_sheet(&boxes, p.count, &p.sheet)) != NULL;
    if (right) {
        p.sheet.pixels = pixels.buf;
        p.boxes = copies;
        texture.pixels = of_texture.buf;
        Py_BEGIN_ALLOW_THREADS
        paint_all(&p, &texture, corners.buf, indices.buf, count);
        Py_END_ALLOW_THREADS
    }
    free(copies);
    for (int k = 0; k < 5; ++k) PyBuffer_Release((Py_buffer *[]){&pixels, &boxes, &of_texture, &corners, &indices}[k]);
    if (!right) {
        if (!PyErr_Occurred()) PyErr_SetString(PyExc_ValueError, "a texture without pixels was handed over");
        return NULL;
    }
    Py_RETURN_NONE;
}
