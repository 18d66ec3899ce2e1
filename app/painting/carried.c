/* Syntheses, carried by a disparity to another viewpoint: shaders/carried.frag for the processor. */
#include "painting.h"

#define STRIP 128 /* neighbouring pixels of a row that are worked on together; what belongs to them stays in the nearest cache */
#define MARGIN 3 /* pixels that a spread picture is continued by beyond its edges: from there on nothing else is sampled */
#define TAPS 4

typedef struct {
    const float *pixels; /* spread: (height + 2 MARGIN, width + 2 MARGIN, CHANNELS) */
    float across, down; /* how far a disparity of 1 px moves what is seen */
} Layer;

typedef struct {
    Layer newest, older;
    float share; /* of the newest; the rest is the older one */
    const float *disparity; /* (height, width), the newest's */
    float nearest; /* the smallest of them */
    int steps; /* how often a disparity is looked up again where it led to */
    uint8_t *out; /* (height, width, CHANNELS) */
    Py_ssize_t width, height;
} Carrying;

/* Pixels of a row. */
typedef struct {
    Py_ssize_t left, y;
    int count;
} Strip;

/* The map where each disparity of a strip leads to from its place; beyond an edge that edge. */
PART void look_up(const Carrying *c, Strip s, const float *restrict led_by, float *restrict found) {
    int32_t at[STRIP];
    const float last_x = (float)(c->width - 1), last_y = (float)(c->height - 1);
    const float middle_x = (float)s.left + 0.5f, middle_y = (float)s.y + 0.5f;
    const int32_t width = (int32_t)c->width;
    for (int i = 0; i < STRIP; ++i) {
        const float x = bounded(middle_x + (float)i + c->newest.across * led_by[i], 0.0f, last_x);
        const float y = bounded(middle_y + c->newest.down * led_by[i], 0.0f, last_y);
        at[i] = (int32_t)y * width + (int32_t)x;
    }
    for (int i = 0; i < s.count; ++i) found[i] = c->disparity[at[i]];
}

/* The disparity of a strip as the other viewpoint sees it; shaders/carry.glsl says why. */
PART void carry(const Carrying *c, Strip s, float from_here[STRIP]) {
    float from_near[STRIP] = {0.0f}, before[STRIP];
    const float *own = c->disparity + s.y * c->width + s.left;
    for (int i = 0; i < STRIP; ++i) {
        from_here[i] = i < s.count ? own[i] : 0.0f;
        before[i] = c->nearest;
    }
    look_up(c, s, before, from_near);
    memcpy(before, from_near, sizeof before);
    for (int step = 0; step < c->steps; ++step) {
        float led_by[STRIP];
        memcpy(led_by, from_here, sizeof led_by);
        memcpy(before, from_near, sizeof before);
        look_up(c, s, led_by, from_here);
        look_up(c, s, before, from_near);
    }
    for (int i = 0; i < STRIP; ++i) {
        const float nearer = from_near[i] < from_here[i] ? from_near[i] : from_here[i];
        from_here[i] = fabsf(from_near[i] - before[i]) < 0.5f ? nearer : from_here[i];
    }
}

/* Of each place along an axis the first of four samples and their weights (cubic, a = -0.5). `size`: of the picture. From one
 * pixel beyond either edge on all four are that edge, and the last of them is the last that a spread picture has. */
PART void place(float first, float each, float moved_by, const float *restrict disparity, Py_ssize_t size, int32_t *restrict whole,
                float (*restrict taps)[STRIP]) {
    const float farthest = (float)size;
    for (int i = 0; i < STRIP; ++i) {
        const float at = bounded(first + each * (float)i + moved_by * disparity[i], -2.0f, farthest) + 2.0f;
        const int32_t below = (int32_t)at;
        const float t = at - (float)below;
        whole[i] = below; /* counted from -2, so the first sample of a picture that begins at -MARGIN */
        taps[0][i] = ((-0.5f * t + 1.0f) * t - 0.5f) * t;
        taps[1][i] = (1.5f * t - 2.5f) * t * t + 1.0f;
        taps[2][i] = ((-1.5f * t + 2.0f) * t + 0.5f) * t;
        taps[3][i] = (0.5f * t - 0.5f) * t * t;
    }
}

/* The pixels of a layer where the disparities of a strip lead to: values of 0 to 255, and beyond. */
PART void sample(const Carrying *c, const Layer *layer, Strip s, const float *restrict disparity, Four *restrict out) {
    int32_t columns[STRIP], rows[STRIP];
    float across[TAPS][STRIP], down[TAPS][STRIP];
    place((float)s.left, 1.0f, layer->across, disparity, c->width, columns, across);
    place((float)s.y, 0.0f, layer->down, disparity, c->height, rows, down);
    const int32_t padded = (int32_t)c->width + 2 * MARGIN;
    for (int i = 0; i < STRIP; ++i) columns[i] += rows[i] * padded;
    const float *const row_0 = layer->pixels, *const row_1 = row_0 + padded * CHANNELS, *const row_2 = row_1 + padded * CHANNELS,
                *const row_3 = row_2 + padded * CHANNELS;
    for (int i = 0; i < s.count; ++i) {
        const Py_ssize_t at = (Py_ssize_t)columns[i] * CHANNELS, further = at + 2 * CHANNELS;
        const Eight left = down[0][i] * eight_at(row_0 + at) + down[1][i] * eight_at(row_1 + at) +
                           down[2][i] * eight_at(row_2 + at) + down[3][i] * eight_at(row_3 + at);
        const Eight right = down[0][i] * eight_at(row_0 + further) + down[1][i] * eight_at(row_1 + further) +
                            down[2][i] * eight_at(row_2 + further) + down[3][i] * eight_at(row_3 + further);
        Four first[2], last[2]; /* columns */
        memcpy(first, &left, sizeof first);
        memcpy(last, &right, sizeof last);
        out[i] = (across[0][i] * first[0] + across[1][i] * first[1]) + (across[2][i] * last[0] + across[3][i] * last[1]);
    }
}

PART void put(const float *restrict colours, uint8_t *restrict out, int count) {
    for (int k = 0; k < count * CHANNELS; ++k) out[k] = (uint8_t)(int32_t)(bounded(colours[k], 0.0f, 255.0f) + 0.5f);
}

MANY_PROCESSORS
static void carry_row(const Carrying *c, Py_ssize_t y) {
    for (Py_ssize_t left = 0; left < c->width; left += STRIP) {
        const Strip s = {left, y, (int)at_most(STRIP, c->width - left)};
        float disparity[STRIP];
        Four colours[STRIP], before[STRIP];
        carry(c, s, disparity);
        sample(c, &c->newest, s, disparity, colours);
        if (c->share < 1.0f) {
            sample(c, &c->older, s, disparity, before);
            for (int i = 0; i < s.count; ++i) colours[i] = before[i] + c->share * (colours[i] - before[i]);
        }
        put((const float *)colours, c->out + (y * c->width + left) * CHANNELS, s.count);
    }
}

static Py_ssize_t spread_bytes(Py_ssize_t height, Py_ssize_t width) {
    return (height + 2 * MARGIN) * (width + 2 * MARGIN) * CHANNELS * (Py_ssize_t)sizeof(float);
}

PyObject *carried(PyObject *Py_UNUSED(module), PyObject *arguments) {
    Carrying c;
    Py_buffer newest, older, disparity, out;
    if (!PyArg_ParseTuple(arguments, "nny*(ff)y*(ff)fy*fiw*", &c.height, &c.width, &newest, &c.newest.across, &c.newest.down,
                          &older, &c.older.across, &c.older.down, &c.share, &disparity, &c.nearest, &c.steps, &out))
        return NULL;
    const Py_ssize_t pixels = c.height * c.width, spread = spread_bytes(c.height, c.width);
    const int right = holds(&newest, spread) && holds(&older, spread) &&
                      holds(&disparity, pixels * (Py_ssize_t)sizeof(float)) && holds(&out, pixels * CHANNELS);
    if (right) {
        c.newest.pixels = newest.buf;
        c.older.pixels = older.buf;
        c.disparity = disparity.buf;
        c.out = out.buf;
        Py_BEGIN_ALLOW_THREADS
        for (Py_ssize_t y = 0; y < c.height; ++y) carry_row(&c, y);
        Py_END_ALLOW_THREADS
    }
    PyBuffer_Release(&newest);
    PyBuffer_Release(&older);
    PyBuffer_Release(&disparity);
    PyBuffer_Release(&out);
    if (!right) return NULL;
    Py_RETURN_NONE;
}

MANY_PROCESSORS
static void spread_row(const uint8_t *restrict pixels, float *restrict out, Py_ssize_t width) {
    for (Py_ssize_t k = 0; k < width * CHANNELS; ++k) out[MARGIN * CHANNELS + k] = (float)pixels[k];
    for (Py_ssize_t x = 0; x < MARGIN; ++x)
        for (Py_ssize_t k = 0; k < CHANNELS; ++k) {
            out[x * CHANNELS + k] = (float)pixels[k];
            out[(MARGIN + width + x) * CHANNELS + k] = (float)pixels[(width - 1) * CHANNELS + k];
        }
}

PyObject *spread(PyObject *Py_UNUSED(module), PyObject *arguments) {
    Py_ssize_t height, width;
    Py_buffer pixels, out;
    if (!PyArg_ParseTuple(arguments, "nny*w*", &height, &width, &pixels, &out)) return NULL;
    const int right = holds(&pixels, height * width * CHANNELS) && holds(&out, spread_bytes(height, width));
    if (right) {
        Py_BEGIN_ALLOW_THREADS
        for (Py_ssize_t y = 0; y < height + 2 * MARGIN; ++y)
            spread_row((const uint8_t *)pixels.buf + within(y - MARGIN, height) * width * CHANNELS,
                       (float *)out.buf + y * (width + 2 * MARGIN) * CHANNELS, width);
        Py_END_ALLOW_THREADS
    }
    PyBuffer_Release(&pixels);
    PyBuffer_Release(&out);
    if (!right) return NULL;
    Py_RETURN_NONE;
}
