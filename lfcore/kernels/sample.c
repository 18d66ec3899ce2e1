/* Cubic interpolation at any places (lfcore.warp). */
#include "shares.h"

typedef struct {
    const float *images; /* (images, channels, height, width) */
    const float *x, *y; /* (images, places): where to sample, px */
    float *out; /* (images, channels, places) */
    Py_ssize_t images_count, channels, height, width, places;
    float a; /* of the cubic kernel */
    int outside; /* whether places outside the picture give its edge, repeated; else they give 0 */
} Samples;

/* From two pixels beyond an edge on there is nothing but that edge. Not a number becomes the first such place. */
PART float near_picture(float place, Py_ssize_t size) {
    const float last = (float)(size + 1), bounded = place > -2.0f ? place : -2.0f;
    return bounded < last ? bounded : last;
}

PART float sample_at_edge(const float *channel, Py_ssize_t height, Py_ssize_t width, Py_ssize_t top, Py_ssize_t left,
                          const Four across, const Four down) {
    float sum = 0.0f;
    for (int k = 0; k < 4; ++k) {
        const float *row = channel + within(top + k, height) * width;
        for (int j = 0; j < 4; ++j) sum += down[k] * across[j] * row[within(left + j, width)];
    }
    return sum;
}

MANY_PROCESSORS
static void sample_places(const Samples *s, Py_ssize_t begin, Py_ssize_t end) {
    const Py_ssize_t width = s->width, height = s->height, area = width * height;
    const float last_x = (float)(width - 1), last_y = (float)(height - 1);
    for (Py_ssize_t n = 0; n < s->images_count; ++n) {
        const float *image = s->images + n * s->channels * area;
        float *out = s->out + n * s->channels * s->places;
        for (Py_ssize_t p = begin; p < end; ++p) {
            const float x = s->x[n * s->places + p], y = s->y[n * s->places + p];
            if (!s->outside && !(x >= 0.0f && x <= last_x && y >= 0.0f && y <= last_y)) {
                for (Py_ssize_t c = 0; c < s->channels; ++c) out[c * s->places + p] = 0.0f;
                continue;
            }
            const float near_x = near_picture(x, width), near_y = near_picture(y, height);
            const int32_t whole_x = whole_below(near_x), whole_y = whole_below(near_y);
            const Py_ssize_t left = whole_x - 1, top = whole_y - 1;
            const Four across = cubic_taps(near_x - (float)whole_x, s->a), down = cubic_taps(near_y - (float)whole_y, s->a);
            if (left >= 0 && top >= 0 && left + 4 <= width && top + 4 <= height)
                for (Py_ssize_t c = 0; c < s->channels; ++c)
                    out[c * s->places + p] = sample_inside(image + c * area + top * width + left, width, across, down);
            else
                for (Py_ssize_t c = 0; c < s->channels; ++c)
                    out[c * s->places + p] = sample_at_edge(image + c * area, height, width, top, left, across, down);
        }
    }
}

static void sample_all(const Samples *samples, int threads) {
    const Py_ssize_t places = samples->places, parts = at_most(threads * PARTS_PER_THREAD, places);
    Shares shares;
    share_out(&shares, parts, threads);
#pragma omp parallel num_threads(threads)
    EACH_SHARED(part, &shares)
        sample_places(samples, places * part / parts, places * (part + 1) / parts);
}

PyObject *cubic_sample(PyObject *Py_UNUSED(module), PyObject *arguments) {
    Samples samples;
    unsigned long long images, x, y, out;
    int threads;
    if (!PyArg_ParseTuple(arguments, "KKKKnnnnnfpi", &images, &x, &y, &out, &samples.images_count, &samples.channels,
                          &samples.height, &samples.width, &samples.places, &samples.a, &samples.outside, &threads))
        return NULL;
    samples.images = at_address(images);
    samples.x = at_address(x);
    samples.y = at_address(y);
    samples.out = at_address(out);
    Py_BEGIN_ALLOW_THREADS
    sample_all(&samples, threads);
    Py_END_ALLOW_THREADS
    Py_RETURN_NONE;
}
