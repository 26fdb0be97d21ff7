/* depth.h - benchmark 1: optical depth in n^3 cells, every method, error against time. MIT licence.
 */
#ifndef SCATTER_BENCH_DEPTH_H
#define SCATTER_BENCH_DEPTH_H

#include "measure.h"
#include "report.h"

enum {
    DEPTH_GAUSSIANS = 16,
    DEPTH_POINTS = 16384, /* cells and points at which errors are taken */
    DEPTH_METHODS = 7,
    DEPTH_SIZES = 4,
    DEPTH_SOURCES = 3,
    DEPTH_ROUNDS = 7
};

typedef struct depth_method {
    const char *name;
    scatter_depth_method method;
} depth_method;

static const depth_method depth_methods[DEPTH_METHODS] = {
    {"closed, per query", SCATTER_DEPTH_CLOSED},
    {"closed volume", SCATTER_DEPTH_CLOSED_VOLUME},
    {"eq. 6 as printed", SCATTER_DEPTH_EQ6},
    {"upwind", SCATTER_DEPTH_UPWIND},
    {"short characteristics", SCATTER_DEPTH_SHORT},
    {"polar", SCATTER_DEPTH_POLAR},
    {"march", SCATTER_DEPTH_MARCH}};

static const int depth_sizes[DEPTH_SIZES] = {16, 32, 64, 128};

static const char *const depth_source_names[DEPTH_SOURCES] = {"lamp outside", "lamp inside", "sun"};

/* The largest size is for the first source only: it takes long and the others tell the same. */
static int depth_size_count(int source)
{
    return source == 0 ? DEPTH_SIZES : DEPTH_SIZES - 1;
}

/* What one method did at one size with one source. */
typedef struct depth_result {
    double cells, points; /* relative RMS errors at cell centres and at random points */
    double read_ns;       /* of scatter_depth_at */
    timing all, moved;    /* ms: medium and source changed; only the source changed */
} depth_result;

typedef struct depth_bench {
    scatter_gaussian gaussians[DEPTH_GAUSSIANS];
    scatter_medium medium;
    scatter_source source;
    scatter_vec3 cell[DEPTH_POINTS], point[DEPTH_POINTS];
    double at_cell[DEPTH_POINTS], at_point[DEPTH_POINTS]; /* closed form in double precision */
    scatter_depth *depth[DEPTH_METHODS];
    float sum;   /* of what was read: keeps the compiler from dropping the reads */
    timing copy; /* memcpy of as many floats */
    depth_result result[DEPTH_SOURCES][DEPTH_SIZES][DEPTH_METHODS];
} depth_bench;

/* 16 Gaussians with a = 4..12 in the unit cube, which bounds them. */
static void depth_medium(depth_bench *b)
{
    uint64_t seed = 2012;
    memset(b, 0, sizeof *b);
    for (int i = 0; i < DEPTH_GAUSSIANS; i++) {
        b->gaussians[i].center = random_point(&seed);
        b->gaussians[i].a = random_between(&seed, 4, 12);
        b->gaussians[i].c = random_between(&seed, 0.5, 3);
    }
    b->medium.extinction = b->medium.albedo = scatter_v3(1, 1, 1);
    b->medium.bounded = 1;
    b->medium.bounds.max = scatter_v3(1, 1, 1);
    b->medium.gaussians = b->gaussians;
    b->medium.gaussian_count = DEPTH_GAUSSIANS;
}

static scatter_source depth_source(int kind)
{
    scatter_source source;
    memset(&source, 0, sizeof source);
    source.directional = kind == 2;
    source.position = kind == 0 ? scatter_v3(-0.3f, 1.4f, 0.2f) : scatter_v3(0.43f, 0.52f, 0.61f);
    source.direction = scatter_v3(0.4f, -1.0f, 0.3f);
    return source;
}

static float cell_center(uint64_t *seed, int n)
{
    return ((float)(int)(random_unit(seed) * n) + 0.5f) / (float)n;
}

/* Where errors are taken: cells of n^3 and points anywhere, with their true depths. */
static void depth_truth(depth_bench *b, int n)
{
    uint64_t seed = 7;
    for (int i = 0; i < DEPTH_POINTS; i++) {
        b->cell[i].x = cell_center(&seed, n);
        b->cell[i].y = cell_center(&seed, n);
        b->cell[i].z = cell_center(&seed, n);
        b->point[i] = random_point(&seed);
        b->at_cell[i] = reference_source_depth(&b->medium, &b->source, b->cell[i]);
        b->at_point[i] = reference_source_depth(&b->medium, &b->source, b->point[i]);
    }
}

/* Root of the mean square error over the root of the mean square depth. */
static double depth_error(const scatter_depth *depth, const scatter_vec3 *x, const double *truth)
{
    double error = 0, size = 0;
    for (int i = 0; i < DEPTH_POINTS; i++) {
        double d = (double)scatter_depth_at(depth, x[i]) - truth[i];
        error += d * d;
        size += truth[i] * truth[i];
    }
    return sqrt(error / size);
}

/* Nanoseconds of one scatter_depth_at. */
static double depth_read_ns(depth_bench *b, const scatter_depth *depth)
{
    double start = thread_ms();
    for (int i = 0; i < DEPTH_POINTS; i++)
        b->sum += scatter_depth_at(depth, b->point[i]);
    return (thread_ms() - start) * 1e6 / DEPTH_POINTS;
}

static double depth_timed_update(depth_bench *b, int m, int n)
{
    scatter_quality quality;
    memset(&quality, 0, sizeof quality);
    quality.depth = depth_methods[m].method;
    quality.grid = n;
    double start = thread_ms();
    must(scatter_depth_update(b->depth[m], &b->medium, &b->source, &quality),
         "scatter_depth_update");
    return thread_ms() - start;
}

/* Moves the source, or the medium too, by so little that no error changes and nothing can be
 * reused. */
static void depth_disturb(depth_bench *b, int round, int medium_too)
{
    float step = (round & 1) ? 1.0e-6f : -1.0e-6f;
    b->source.position.x += step;
    b->source.direction.x += step;
    if (medium_too)
        b->gaussians[0].c *= 1.0f + step;
}

/* One round: every method once with everything new, once with a new source only. */
static void depth_round(depth_bench *b, depth_result *result, int n, int round)
{
    for (int m = 0; m < DEPTH_METHODS; m++) {
        depth_disturb(b, round, 1);
        timing_add(&result[m].all, depth_timed_update(b, m, n));
        depth_disturb(b, round + 1, 0);
        timing_add(&result[m].moved, depth_timed_update(b, m, n));
    }
}

static void depth_copy(timing *t, int n)
{
    size_t bytes = (size_t)n * (size_t)n * (size_t)n * sizeof(float);
    char *from = (char *)malloc(bytes), *to = (char *)malloc(bytes);
    if (!from || !to)
        must(SCATTER_OUT_OF_MEMORY, "malloc");
    memset(from, 1, bytes);
    memset(to, 2, bytes);
    for (int i = 0; i < DEPTH_ROUNDS; i++) {
        double start = thread_ms();
        memcpy(to, from, bytes);
        from[i] = to[i + 1]; /* each copy differs, so none can be left out */
        timing_add(t, thread_ms() - start);
    }
    free(from);
    free(to);
}

static void depth_measure(depth_bench *b, int s, int size)
{
    int n = depth_sizes[size];
    depth_result *result = b->result[s][size];
    b->source = depth_source(s);
    depth_truth(b, n);
    for (int m = 0; m < DEPTH_METHODS; m++) {
        depth_timed_update(b, m, n); /* allocates: not counted */
        result[m].cells = depth_error(b->depth[m], b->cell, b->at_cell);
        result[m].points = depth_error(b->depth[m], b->point, b->at_point);
        result[m].read_ns = depth_read_ns(b, b->depth[m]);
    }
    for (int round = 0; round < (n > 64 ? 2 : DEPTH_ROUNDS); round++)
        depth_round(b, result, n, round);
}

/* Order of convergence at random points from half the cells an axis; the closed form has none. */
static void depth_order_cell(report *r, const depth_bench *b, int s, int size, int m)
{
    if (size == 0 || depth_methods[m].method == SCATTER_DEPTH_CLOSED)
        report_cell(r, "%s", "");
    else
        report_cell(r, "%.2f",
                    log2(b->result[s][size - 1][m].points / b->result[s][size][m].points));
}

static void depth_row(report *r, const depth_bench *b, int s, int size, int m)
{
    const depth_result *d = &b->result[s][size][m], *march = &b->result[s][size][DEPTH_METHODS - 1];
    int n = depth_sizes[size], closed = depth_methods[m].method == SCATTER_DEPTH_CLOSED;
    double cells = (double)n * n * n, ms = timing_median(&d->all);
    if (closed)
        ms = d->read_ns * cells * 1e-6; /* what asking for every cell would take */
    report_cell(r, "%s", depth_methods[m].name);
    report_cell(r, "%s", depth_source_names[s]);
    report_cell(r, "%d", n);
    report_cell(r, "%.4g", 100 * d->cells);
    report_cell(r, "%.4g", 100 * d->points);
    depth_order_cell(r, b, s, size, m);
    report_cell(r, "%.3g%s", ms, closed ? "" : timing_flag(&d->all));
    report_cell(r, "%.3g", closed ? ms : timing_min(&d->all));
    report_cell(r, "%.3g", closed ? ms : timing_median(&d->moved));
    report_cell(r, "%.3g", ms * 1e6 / cells);
    report_cell(r, "%.3g", timing_median(&march->all) / ms);
    report_cell(r, "%.0f", d->read_ns);
    report_row(r, n == 64 || s == 0);
}

static void depth_copy_row(report *r, const timing *copy, int n)
{
    report_cell(r, "memcpy of one volume");
    report_cell(r, "%s", "");
    report_cell(r, "%d", n);
    for (int i = 0; i < 3; i++)
        report_cell(r, "%s", "");
    report_cell(r, "%.3g%s", timing_median(copy), timing_flag(copy));
    report_cell(r, "%.3g", timing_min(copy));
    report_cell(r, "%s", "");
    report_cell(r, "%.3g", timing_median(copy) * 1e6 / ((double)n * n * n));
    report_row(r, 1);
}

static void depth_table(report *r, depth_bench *b)
{
    report_table(r, "depth",
                 "method|source|n|error at cells %|error between %|order|ms|min ms|"
                 "source moved ms|ns/cell|times as fast as march|ns/read");
    for (int s = 0; s < DEPTH_SOURCES; s++)
        for (int size = 0; size < depth_size_count(s); size++) {
            for (int m = 0; m < DEPTH_METHODS; m++)
                depth_row(r, b, s, size, m);
            if (s)
                continue;
            memset(&b->copy, 0, sizeof b->copy);
            depth_copy(&b->copy, depth_sizes[size]);
            depth_copy_row(r, &b->copy, depth_sizes[size]);
        }
    report_end(r);
}

/* The worst of the three sources at 64^3. */
typedef struct depth_worst {
    double cells, points, ms; /* errors at cell centres and between them */
    double speedup;           /* over march */
    double more_accurate;     /* march's error over this one's, each at the same places */
} depth_worst;

static depth_worst depth_find_worst(const depth_bench *b, int m)
{
    depth_worst w = {0, 0, 0, 1e30, 1e30};
    for (int s = 0; s < DEPTH_SOURCES; s++) {
        const depth_result *d = &b->result[s][2][m], *march = &b->result[s][2][DEPTH_METHODS - 1];
        double ms = timing_median(&d->all);
        w.cells = worse_of(w.cells, d->cells);
        w.points = worse_of(w.points, d->points);
        w.ms = fmax(w.ms, ms);
        w.speedup = fmin(w.speedup, timing_median(&march->all) / ms);
        w.more_accurate =
            fmin(w.more_accurate, fmin(march->cells / d->cells, march->points / d->points));
    }
    return w;
}

static void depth_targets(report *r, const depth_bench *b)
{
    depth_worst closed = depth_find_worst(b, 1), polar = depth_find_worst(b, 5);
    report_target(r, worse_of(closed.cells, closed.points) <= 0.001 && closed.ms <= 10,
                  "closed volume, 64^3, 16 Gaussians: error <= 0.1 % in <= 10 ms",
                  "%.2g %% at cells, %.3g %% between, %.2f ms", 100 * closed.cells,
                  100 * closed.points, closed.ms);
    report_target(r, closed.more_accurate > 1 && closed.speedup > 1,
                  "closed volume more accurate than march of the same cells, and faster",
                  "error %.2f times smaller, %.1f times as fast", closed.more_accurate,
                  closed.speedup);
    report_target(r, worse_of(polar.cells, polar.points) <= 0.01 && polar.ms <= 2,
                  "polar, 64^3, 16 Gaussians: error <= 1 % in <= 2 ms",
                  "%.3g %% at cells, %.3g %% between, %.2f ms", 100 * polar.cells,
                  100 * polar.points, polar.ms);
    report_target(r, polar.speedup >= 20, "polar at least 20 times as fast as march", "%.1f times",
                  polar.speedup);
}

static void depth_run(report *r)
{
    depth_bench *b = (depth_bench *)malloc(sizeof *b);
    bench_host books = {0, 1};
    scatter_host host = host_of(&books);
    if (!b)
        must(SCATTER_OUT_OF_MEMORY, "malloc");
    depth_medium(b);
    report_text(r, "## 1. Optical depth in a volume");
    report_text(r,
                "%d random Gaussians (a = 4..12) in the unit cube, one thread. Errors are RMS "
                "over RMS of the closed form in double precision, at %d cells and at %d points "
                "between them. ms is the median with medium and source new, in rounds that take "
                "every method in turn; `~` marks a median over 10 %% above the minimum. Targets "
                "take the worst of the three sources and of the two errors.",
                DEPTH_GAUSSIANS, DEPTH_POINTS, DEPTH_POINTS);
    for (int m = 0; m < DEPTH_METHODS; m++)
        must(scatter_depth_create(&host, &b->depth[m]), "scatter_depth_create");
    for (int s = 0; s < DEPTH_SOURCES; s++)
        for (int size = 0; size < depth_size_count(s); size++)
            depth_measure(b, s, size);
    depth_table(r, b);
    depth_targets(r, b);
    for (int m = 0; m < DEPTH_METHODS; m++)
        scatter_depth_destroy(b->depth[m]);
    free(b);
}

#endif
