/* What all compiled parts share, those of app/painting too. They are parts of a synthesis that torch has no fast operation for,
 * and optional: where they are not compiled, the same is computed in torch (lfcore.planesweep, lfcore.warp and
 * lfcore.compact_parts say what, __init__.py hands it over). For gcc and clang, whose vectors they use.
 *
 * Threads are OpenMP's. Torch has been loaded before, so that its OpenMP is found and its threads are used: others would have to
 * wait until those stop spinning.
 *
 * Python's objects are known only to the function at the end of each file: the others take plain arrays, whose sizes __init__.py
 * has checked.
 */
#ifndef LFCORE_KERNELS_COMMON_H
#define LFCORE_KERNELS_COMMON_H

#define PY_SSIZE_T_CLEAN
#include <Python.h>
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

/* One function, compiled for several generations of x86; the loader takes what the processor has. */
#if defined(__x86_64__) && defined(__linux__) && defined(__GLIBC__) && defined(__GNUC__) && !defined(__clang__) && __GNUC__ >= 11
#define MANY_PROCESSORS __attribute__((target_clones("arch=x86-64-v4", "arch=x86-64-v3", "default")))
#else
#define MANY_PROCESSORS
#endif

/* Parts of such a function must become parts of each of its versions. */
#define PART static inline __attribute__((always_inline))

/* Work is cut into parts small enough that a thread that another program holds up does not hold up all. */
#define PARTS_PER_THREAD 8

PART Py_ssize_t at_most(Py_ssize_t value, Py_ssize_t most) { return value < most ? value : most; }
PART Py_ssize_t at_least(Py_ssize_t value, Py_ssize_t least) { return value > least ? value : least; }
PART Py_ssize_t within(Py_ssize_t value, Py_ssize_t size) { return at_least(at_most(value, size - 1), 0); }

PART uint32_t bits_of(float value) {
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    return bits;
}

PART float float_of(uint32_t bits) {
    float value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

/* The upper half of a float32, rounded to the nearest, to the even one of two: bfloat16. */
PART uint32_t rounded(uint32_t bits) { return (bits + 0x7FFFu + ((bits >> 16) & 1u)) >> 16; }

/* Four neighbours along a row, the channels of a pixel (the last one unused), or what belongs to each of them. */
typedef float Four __attribute__((vector_size(16)));

PART Four four_at(const float *values) {
    Four four;
    memcpy(&four, values, sizeof four);
    return four;
}

/* As wide as the registers of most processors. What is wider is slow on them: compilers then take it apart through memory. */
typedef float Eight __attribute__((vector_size(32)));
typedef int32_t EightWhole __attribute__((vector_size(32)));

/* The lanes of two vectors that are named; those of the second are counted on from the first's. */
#if defined(__clang__) || __GNUC__ >= 12
#define SHUFFLE(a, b, ...) __builtin_shufflevector(a, b, __VA_ARGS__)
#else
#define SHUFFLE(a, b, ...) __builtin_shuffle(a, b, (EightWhole){__VA_ARGS__})
#endif

PART Eight eight_at(const float *values) {
    Eight eight;
    memcpy(&eight, values, sizeof eight);
    return eight;
}

/* Weights of the samples at -1, 0, 1, 2 around a place t in [0, 1) past sample 0 (Keys 1981): a cubic in their distances, one
 * for the outer two and one for the inner two. */
PART Four cubic_taps(float t, float a) {
    const Four distance = {1.0f + t, t, 1.0f - t, 2.0f - t};
    const Four third = {a, a + 2.0f, a + 2.0f, a}, second = {-5.0f * a, -a - 3.0f, -a - 3.0f, -5.0f * a};
    const Four first = {8.0f * a, 0.0f, 0.0f, 8.0f * a}, none = {-4.0f * a, 1.0f, 1.0f, -4.0f * a};
    return ((third * distance + second) * distance + first) * distance + none;
}

/* The same for four places at once: weight k of each of them. */
PART void cubic_taps_of_four(Four t, float a, Four taps[4]) {
    const Four outer[2] = {1.0f + t, 2.0f - t}, inner[2] = {t, 1.0f - t};
    for (int side = 0; side < 2; ++side) {
        taps[3 * side] = ((a * outer[side] - 5.0f * a) * outer[side] + 8.0f * a) * outer[side] - 4.0f * a;
        taps[1 + side] = ((a + 2.0f) * inner[side] - (a + 3.0f)) * inner[side] * inner[side] + 1.0f;
    }
}

/* A sample of one channel, from the first of the sixteen values around it; `width`: from one row of them to the next. */
PART float sample_inside(const float *place, Py_ssize_t width, Four across, const Four down) {
    const Four sum = down[0] * four_at(place) + down[1] * four_at(place + width) + down[2] * four_at(place + 2 * width) +
                     down[3] * four_at(place + 3 * width);
    const Four weighed = across * sum;
    return (weighed[0] + weighed[1]) + (weighed[2] + weighed[3]);
}

PART int32_t whole_below(float place) {
    const int32_t towards_zero = (int32_t)place;
    return towards_zero - ((float)towards_zero > place);
}

/* An address that Python hands over as a whole number. */
PART void *at_address(unsigned long long address) { return (void *)(uintptr_t)address; }

#endif
