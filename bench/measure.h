/* measure.h - clock, repeats, errors, and the host that the benchmark gives to the library. MIT
 * licence. */
#ifndef SCATTER_BENCH_MEASURE_H
#define SCATTER_BENCH_MEASURE_H

#include "../scatter.h"
#include "../tests/reference.h"
#include <math.h>
#include <pthread.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

/* ------------------------------------------------------------------------------------- level */

/* How much a run does. TEST asks only whether everything still works: its figures mean nothing. */
typedef enum bench_level { LEVEL_TEST, LEVEL_QUICK, LEVEL_FULL } bench_level;

static bench_level level = LEVEL_FULL; /* main sets it once */

static int by_level(int test, int quick, int full)
{
    return level == LEVEL_FULL ? full : level == LEVEL_QUICK ? quick : test;
}

/* -------------------------------------------------------------------------------------- time */

static double clock_ms(clockid_t id)
{
    struct timespec t;
    clock_gettime(id, &t);
    return (double)t.tv_sec * 1e3 + (double)t.tv_nsec * 1e-6;
}

/* Time on the wall. */
static double wall_ms(void)
{
    return clock_ms(CLOCK_MONOTONIC);
}

/* Processor time of this thread: what one thread costs, however busy the machine is. */
static inline double thread_ms(void)
{
    return clock_ms(CLOCK_THREAD_CPUTIME_ID);
}

enum { TIMING_MAX = 32 };

/* Repeats of one thing, ms. */
typedef struct timing {
    double ms[TIMING_MAX];
    int n;
} timing;

static void timing_add(timing *t, double ms)
{
    int i = t->n < TIMING_MAX ? t->n++ : TIMING_MAX - 1;
    for (; i > 0 && t->ms[i - 1] > ms; i--)
        t->ms[i] = t->ms[i - 1];
    t->ms[i] = ms; /* kept in order */
}

static double timing_min(const timing *t)
{
    return t->n ? t->ms[0] : 0.0;
}

static double timing_median(const timing *t)
{
    return t->n ? 0.5 * (t->ms[(t->n - 1) / 2] + t->ms[t->n / 2]) : 0.0;
}

/* How far the median lies above the minimum: 0.1 is 10 %. */
static double timing_spread(const timing *t)
{
    return t->n ? timing_median(t) / timing_min(t) - 1.0 : 0.0;
}

/* A mark behind times that another run may not reproduce. */
static const char *timing_flag(const timing *t)
{
    return timing_spread(t) > 0.1 ? "~" : "";
}

/* ---------------------------------------------------------------------------- random numbers */

/* xorshift64*, uniform in [0, 1). The state must not be 0. */
static double random_unit(uint64_t *state)
{
    *state ^= *state >> 12;
    *state ^= *state << 25;
    *state ^= *state >> 27;
    return (double)((*state * 2685821657736338717ull) >> 11) / 9007199254740992.0;
}

static float random_between(uint64_t *state, double low, double high)
{
    return (float)(low + (high - low) * random_unit(state));
}

static scatter_vec3 random_point(uint64_t *state)
{
    scatter_vec3 p;
    p.x = random_between(state, 0, 1);
    p.y = random_between(state, 0, 1);
    p.z = random_between(state, 0, 1);
    return p;
}

/* ------------------------------------------------------------------------------------ errors */

/* The larger one, or the one that is not a number: a broken result must stay visible. */
static double worse_of(double a, double b)
{
    return isnan(a) || a > b ? a : b; /* b, too, if it is not a number */
}

/* RMSE / mean of the reference, over all values. */
static double relative_rmse(const float *value, const float *reference, size_t n)
{
    double squares = 0, sum = 0;
    for (size_t i = 0; i < n; i++) {
        double d = (double)value[i] - (double)reference[i];
        squares += d * d;
        sum += (double)reference[i];
    }
    return sqrt(squares / (double)n) / (sum / (double)n);
}

static double largest_error(const float *value, const float *reference, size_t n)
{
    double most = 0;
    for (size_t i = 0; i < n; i++)
        most = worse_of(most, fabs((double)value[i] - (double)reference[i]));
    return most;
}

static double mean_of(const float *value, size_t n)
{
    double sum = 0;
    for (size_t i = 0; i < n; i++)
        sum += (double)value[i];
    return sum / (double)n;
}

static int double_order(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* The value that a `part` (0..1) of all values do not exceed: the smallest such value. Sorts. */
static double percentile(double *value, size_t n, double part)
{
    size_t rank = (size_t)ceil(part * (double)n);
    qsort(value, n, sizeof *value, double_order);
    return value[rank > 0 ? rank - 1 : 0];
}

/* Errors of an image, all over the mean of the reference. */
typedef struct image_errors {
    double rmse;
    double most, p99; /* of the differences without sign: the largest, the 99th percentile */
    double bias;      /* mean difference: above 0 the image is too bright */
} image_errors;

static image_errors errors_of(const float *value, const float *reference, size_t n)
{
    image_errors e;
    double mean = mean_of(reference, n), *off = (double *)malloc(n * sizeof *off);
    if (!off)
        exit(1);
    for (size_t i = 0; i < n; i++)
        off[i] = fabs((double)value[i] - (double)reference[i]);
    e.rmse = relative_rmse(value, reference, n);
    e.most = largest_error(value, reference, n) / mean;
    e.p99 = isnan(e.most) ? NAN : percentile(off, n, 0.99) / mean; /* NaN cannot be sorted */
    e.bias = (mean_of(value, n) - mean) / mean;
    free(off);
    return e;
}

/* Is a setting of this time and error at least as good as the other in both, and better in one? */
static int beats(double ms, double error, double other_ms, double other_error)
{
    return ms <= other_ms && error <= other_error && (ms < other_ms || error < other_error);
}

/* ---------------------------------------------------------------------------------- self-test */

static int near_to(double value, double truth)
{
    return fabs(value - truth) <= 1e-12 * fabs(truth);
}

static int timing_works(void)
{
    timing t = {{0}, 0};
    timing_add(&t, 3);
    timing_add(&t, 1);
    timing_add(&t, 2);
    return timing_median(&t) == 2.0 && timing_min(&t) == 1.0 && timing_spread(&t) == 1.0 &&
           *timing_flag(&t) == '~';
}

/* 1..199 and one outlier: the percentile is no maximum, the bias has a sign. */
static int errors_work(void)
{
    const float value[3] = {1, 2, 3}, reference[3] = {1, 2, 6}, broken[3] = {1, NAN, 2};
    double list[200];
    image_errors e = errors_of(value, reference, 3), b = errors_of(broken, reference, 3);
    for (int i = 0; i < 200; i++)
        list[i] = i < 199 ? 199 - i : 1000;
    return near_to(relative_rmse(value, reference, 3), sqrt(3.0) / 3.0) &&
           largest_error(value, reference, 3) == 3.0 && near_to(e.rmse, sqrt(3.0) / 3.0) &&
           near_to(e.most, 1.0) && near_to(e.p99, 1.0) && near_to(e.bias, -1.0 / 3.0) &&
           percentile(list, 200, 0.99) == 198.0 && percentile(list, 200, 0.5) == 100.0 &&
           isnan(b.rmse) && isnan(b.most) && isnan(b.p99) && isnan(b.bias) &&
           isnan(worse_of(NAN, 1)) && isnan(worse_of(1, NAN));
}

/* Equal settings do not beat each other, so both stay; what is not a number beats nothing. */
static int front_works(void)
{
    static const double ms[6] = {1, 2, 3, 2, 4, 1}, error[6] = {9, 5, 5, 6, 1, 9};
    static const int front[6] = {1, 1, 0, 0, 1, 1};
    for (int i = 0; i < 6; i++) {
        int beaten = 0;
        for (int k = 0; k < 6; k++)
            beaten |= beats(ms[k], error[k], ms[i], error[i]);
        if (beaten == front[i])
            return 0;
    }
    return !beats(0, NAN, 1, 1) && !beats(NAN, 0, 1, 1);
}

/* The measures measured: a benchmark with wrong yardsticks must not run. */
static void check_measures(void)
{
    if (timing_works() && errors_work() && front_works())
        return;
    fprintf(stderr, "bench: its own measures are wrong\n");
    exit(1);
}

/* -------------------------------------------------------------------------------------- host */

/* Counts what the library allocates, and runs its loops on `threads` threads. */
typedef struct bench_host {
    size_t allocations;
    int threads;
} bench_host;

static void *host_allocate(void *user, size_t bytes)
{
    ((bench_host *)user)->allocations++;
    return malloc(bytes);
}

static void host_release(void *user, void *memory)
{
    (void)user;
    free(memory);
}

static void host_log(void *user, scatter_result result, const char *sentence)
{
    (void)user;
    fprintf(stderr, "bench: scatter result %d: %s\n", (int)result, sentence);
}

typedef struct host_loop {
    pthread_mutex_t lock;
    int next, count;
    void (*task)(void *data, int index);
    void *data;
} host_loop;

static int host_take(host_loop *loop)
{
    pthread_mutex_lock(&loop->lock);
    int index = loop->next < loop->count ? loop->next++ : -1;
    pthread_mutex_unlock(&loop->lock);
    return index;
}

static void *host_work(void *memory)
{
    host_loop *loop = (host_loop *)memory;
    for (int i = host_take(loop); i >= 0; i = host_take(loop))
        loop->task(loop->data, i);
    return NULL;
}

enum { HOST_THREADS = 16 };

static void host_parallel_for(void *user, int count, void (*task)(void *data, int index),
                              void *data)
{
    pthread_t thread[HOST_THREADS];
    host_loop loop = {PTHREAD_MUTEX_INITIALIZER, 0, count, task, data};
    int wanted = ((bench_host *)user)->threads - 1, started = 0;
    while (started < wanted && started < HOST_THREADS &&
           pthread_create(&thread[started], NULL, host_work, &loop) == 0)
        started++;
    host_work(&loop);
    while (started > 0)
        pthread_join(thread[--started], NULL);
}

static scatter_host host_of(bench_host *h)
{
    scatter_host host;
    memset(&host, 0, sizeof host);
    host.user = h;
    host.allocate = host_allocate;
    host.release = host_release;
    host.log = host_log;
    if (h->threads > 1)
        host.parallel_for = host_parallel_for;
    return host;
}

static int processors(void)
{
    long n = sysconf(_SC_NPROCESSORS_ONLN);
    return n < 1 ? 1 : n > HOST_THREADS ? HOST_THREADS : (int)n;
}

/* A failure of the library is a failure of the benchmark. */
static void must(scatter_result result, const char *call)
{
    if (result == SCATTER_OK)
        return;
    fprintf(stderr, "bench: %s failed with %d\n", call, (int)result);
    exit(1);
}

static float *floats(size_t n)
{
    float *memory = (float *)malloc(n * sizeof *memory);
    if (!memory)
        must(SCATTER_OUT_OF_MEMORY, "malloc");
    return memory;
}

#endif
