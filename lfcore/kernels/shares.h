/* How threads share out the parts of a picture.
 *
 * Each has a run of neighbouring parts, in the same place of the picture in every layer: so it reads what it wrote itself, and not
 * what lies in the other core's caches. One that has done its own run takes what is left of others, so that a thread that another
 * program holds up does not hold up all.
 */
#ifndef LFCORE_KERNELS_SHARES_H
#define LFCORE_KERNELS_SHARES_H

#include "common.h"

#ifdef _OPENMP
#include <omp.h>
#endif

#define MOST_RUNS 64
#define LINE_OF_A_CACHE 64 /* bytes; two threads should not count in the same */

typedef struct {
    _Alignas(LINE_OF_A_CACHE) Py_ssize_t next;
    Py_ssize_t end;
} Run;

typedef struct {
    Run runs[MOST_RUNS];
    int count;
} Shares;

/* Parts 0 to `parts`, shared out among so many threads. */
PART void share_out(Shares *shares, Py_ssize_t parts, int threads) {
    shares->count = (int)at_least(at_most(threads, MOST_RUNS), 1);
    for (Py_ssize_t k = 0; k < shares->count; ++k)
        shares->runs[k].next = parts * k / shares->count, shares->runs[k].end = parts * (k + 1) / shares->count;
}

/* The run of this thread. */
PART int own_run(const Shares *shares) {
#ifdef _OPENMP
    return omp_get_thread_num() % shares->count;
#else
    (void)shares;
    return 0;
#endif
}

/* A part that nobody has taken, of `run`, or, where that is done, of a run after it; -1 where there is none. */
PART Py_ssize_t take(Shares *shares, int *run) {
    for (int tried = 0; tried < shares->count; ++tried) {
        Run *from = &shares->runs[*run];
        const Py_ssize_t part = __atomic_fetch_add(&from->next, 1, __ATOMIC_RELAXED);
        if (part < from->end) return part;
        *run = (*run + 1) % shares->count;
    }
    return -1;
}

/* In each thread of a team: the parts that fall to it, one by one. The outer loop is there for its variables, and runs once. */
#define EACH_SHARED(part, shares)                                                                                              \
    for (int run_ = own_run(shares), go_on_ = 1; go_on_; go_on_ = 0)                                                           \
        for (Py_ssize_t part; (part = take(shares, &run_)) >= 0;)

#endif
