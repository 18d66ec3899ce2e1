/* The inputs of the small pair warped by its disparity, as its colour network takes them. */
#include "compact_places.h"
#include "compact_warp.h"

PART void from_floats(const float *restrict values, Py_ssize_t count, int halved, void *out, Py_ssize_t first) {
    if (halved) {
        uint16_t *restrict result = (uint16_t *)out + first;
        for (Py_ssize_t i = 0; i < count; ++i) result[i] = (uint16_t)rounded(bits_of(values[i]));
    } else
        memcpy((float *)out + first, values, count * sizeof(float));
}

PART Four sample_colours(const Warp *warp, int input, const Places *across, const Places *down) {
    const Py_ssize_t width = warp->source_width;
    const float *place = (const float *)warp->corners + 4 * ((input * warp->source_height + down->first[input]) * width + across->first[input]);
    Four columns[4];
    for (int half = 0; half < 2; ++half) {
        const float *two = place + 8 * half;
        Eight sum = down->taps[0][input] * eight_at(two);
        for (int k = 1; k < 4; ++k) sum += down->taps[k][input] * eight_at(two + 4 * k * width);
        memcpy(columns + 2 * half, &sum, sizeof sum);
    }
    Four colours = across->taps[0][input] * columns[0];
    for (int k = 1; k < 4; ++k) colours += across->taps[k][input] * columns[k];
    return colours;
}

PART void warp_row(const Warp *warp, Py_ssize_t y, float *restrict widest) {
    const Py_ssize_t w = warp->width;
    const Four offsets_x = four_at(warp->offsets), offsets_y = four_at(warp->offsets + INPUTS);
    const Four moves_x = four_at(warp->moves), moves_y = four_at(warp->moves + INPUTS);
    spreads_of_row(warp, y, widest);
    for (Py_ssize_t x = 0; x < w; ++x) {
        float *restrict warped = (float *)warp->warped + (y * w + x) * PHASES * INPUTS * 4;
        float gathered[GATHERED]; /* three channels are written as four; what comes after overwrites the fourth */
        float total = 0.0f;
        for (int phase = 0; phase < PHASES; ++phase) {
            const float disparity = warp->disparity[(phase * warp->height + y) * w + x];
            const float column = (float)(2 * x + phase % 2 + warp->reach), row = (float)(2 * y + phase / 2 + warp->reach);
            Four samples[INPUTS], mean = {0.0f};
            total += disparity;
            const Places across = inner_places(column + moves_x + offsets_x * disparity, warp->source_width, warp->a);
            const Places down = inner_places(row + moves_y + offsets_y * disparity, warp->source_height, warp->a);
            for (int n = 0; n < INPUTS; ++n) {
                samples[n] = sample_colours(warp, n, &across, &down);
                mean += samples[n];
            }
            memcpy(warped + phase * INPUTS * 4, samples, sizeof samples);
            mean *= 0.25f;
            memcpy(gathered + 15 * phase, &mean, sizeof mean);
            for (int n = 0; n < INPUTS; ++n) {
                const Four difference = samples[n] - mean;
                memcpy(gathered + 15 * phase + 3 * (n + 1), &difference, sizeof difference);
            }
        }
        gathered[60] = warp->u;
        gathered[61] = warp->v;
        gathered[62] = 0.25f * total;
        gathered[63] = spread_at(widest, x, w);
        from_floats(gathered, GATHERED, warp->halved, warp->gathered, (y * w + x) * GATHERED);
    }
}

MANY_PROCESSORS
static int warp_rows(const Warp *warp, Py_ssize_t begin, Py_ssize_t end) {
    float *widest = malloc(2 * warp->width * sizeof(float));
    if (widest == NULL) return -1;
    for (Py_ssize_t y = begin; y < end; ++y) warp_row(warp, y, widest);
    free(widest);
    return 0;
}

static int whole_warp(const Warp *warp, int threads) {
    const Py_ssize_t parts = at_most(threads * PARTS_PER_THREAD, warp->height);
    Shares shares;
    share_out(&shares, parts, threads);
    int failed = 0;
#pragma omp parallel num_threads(threads) reduction(| : failed)
    EACH_SHARED(part, &shares)
        failed |= (warp->shortened ? warp_rows_in_halves : warp_rows)(
            warp, warp->height * part / parts, warp->height * (part + 1) / parts);
    return failed;
}

PyObject *compact_warp(PyObject *Py_UNUSED(module), PyObject *arguments) {
    Warp warp;
    unsigned long long corners, disparity, offsets, gathered, warped;
    int threads;
    if (!PyArg_ParseTuple(arguments, "KKKKKnnnnnfffppi", &corners, &disparity, &offsets, &gathered, &warped, &warp.source_height,
                          &warp.source_width, &warp.height, &warp.width, &warp.reach, &warp.a, &warp.u, &warp.v, &warp.halved,
                          &warp.shortened, &threads))
        return NULL;
    warp.corners = at_address(corners);
    warp.disparity = at_address(disparity);
    warp.offsets = at_address(offsets); /* the moves lie behind them */
    warp.moves = warp.offsets + 2 * INPUTS;
    warp.gathered = at_address(gathered);
    warp.warped = at_address(warped);
    int failed;
    Py_BEGIN_ALLOW_THREADS
    failed = whole_warp(&warp, threads);
    Py_END_ALLOW_THREADS
    if (failed) return PyErr_NoMemory();
    Py_RETURN_NONE;
}
