/* The last steps of the colour network of the small pair: weights of the inputs and a residual to the picture. */
#include "compact_blend.h"

/* The inverse of the root tone, within 0 and 1; not a number becomes 0. */
PART float stored(float toned, float toe) {
    const float value = toned * toned - toe, positive = value > 0.0f ? value : 0.0f;
    return positive < 1.0f ? positive : 1.0f;
}

PART void blend_pixel(const Blend *b, Py_ssize_t y, Py_ssize_t x, const float *nearness) {
    const Py_ssize_t pixel = y * b->width + x;
    float scores[OUTPUTS + 1], straight[3 * PHASES + 1]; /* three channels are read as four */
    const float *residual = scores + LOGITS, *of_pixel = (const float *)b->warped + pixel * PHASES * INPUTS * 4;
    as_floats(b->outputs, pixel * OUTPUTS, OUTPUTS, b->halved, scores);
    as_floats(b->straight, pixel * 3 * PHASES, 3 * PHASES, b->halved, straight);
    scores[OUTPUTS] = straight[3 * PHASES] = 0.0f;
    const Eight low = eight_at(scores) + eight_at(nearness), high = eight_at(scores + 8) + eight_at(nearness + 8);
    const Eight best = greater_of_eight(low, high);
    const Four greatest = greater(first_half(best), second_half(best));
    const Eight shares[2] = {exponential(low - twice(greatest)), exponential(high - twice(greatest))}, sums = shares[0] + shares[1];
    const Four whole = first_half(sums) + second_half(sums);
    memcpy(scores, shares, sizeof shares);
    for (int phase = 0; phase < PHASES; ++phase) {
        const Py_ssize_t row = 2 * y + phase / 2, column = 2 * x + phase % 2;
        if (row >= b->picture_height || column >= b->picture_width) continue;
        const float *warped = of_pixel + phase * INPUTS * 4;
        Four sum = {0.0f};
        for (int n = 0; n < INPUTS; ++n) sum += scores[PHASES * n + phase] * four_at(warped + 4 * n);
        const Four added = four_at(residual + 3 * phase) + four_at(straight + 3 * phase);
        const Four toned = sum / whole[phase] + b->middle + b->weight * added;
        float *out = b->picture + (row * b->picture_width + column) * 3;
        for (int c = 0; c < 3; ++c) out[c] = stored(toned[c], b->toe);
    }
}

MANY_PROCESSORS
static void blend_rows(const Blend *b, Py_ssize_t begin, Py_ssize_t end) {
    float nearness[LOGITS];
    for (int i = 0; i < LOGITS; ++i) nearness[i] = b->nearness[i / PHASES];
    for (Py_ssize_t y = begin; y < end; ++y)
        for (Py_ssize_t x = 0; x < b->width; ++x) blend_pixel(b, y, x, nearness);
}

static void whole_blend(const Blend *b, int threads) {
    const Py_ssize_t parts = at_most(threads * PARTS_PER_THREAD, b->height);
    Shares shares;
    share_out(&shares, parts, threads);
#pragma omp parallel num_threads(threads)
    EACH_SHARED(part, &shares)
        (b->shortened ? blend_rows_in_halves : blend_rows)(b, b->height * part / parts, b->height * (part + 1) / parts);
}

PyObject *compact_blend(PyObject *Py_UNUSED(module), PyObject *arguments) {
    Blend b;
    unsigned long long outputs, straight, warped, nearness, picture;
    int threads;
    if (!PyArg_ParseTuple(arguments, "KKKKKnnnnfffppi", &outputs, &straight, &warped, &nearness, &picture, &b.height, &b.width,
                          &b.picture_height, &b.picture_width, &b.middle, &b.weight, &b.toe, &b.halved, &b.shortened,
                          &threads))
        return NULL;
    b.outputs = at_address(outputs);
    b.straight = at_address(straight);
    b.warped = at_address(warped);
    b.nearness = at_address(nearness);
    b.picture = at_address(picture);
    Py_BEGIN_ALLOW_THREADS
    whole_blend(&b, threads);
    Py_END_ALLOW_THREADS
    Py_RETURN_NONE;
}
