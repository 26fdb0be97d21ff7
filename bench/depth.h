/* depth.h - benchmark: optical depth in n^3 cells, every method, error against time. MIT licence.
 */
#ifndef SCATTER_BENCH_DEPTH_H
#define SCATTER_BENCH_DEPTH_H

#include "limit_loops.h"
#include "report.h"

enum {
    DEPTH_GAUSSIANS = 16,
    DEPTH_POINTS = 16384, /* cells and points at which errors are taken */
    DEPTH_METHODS = 7,
    DEPTH_SIZES = 4,
    DEPTH_SOURCES = 3,
    DEPTH_ROUNDS = 7,
    DEPTH_PROPAGATIONS = 15
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
    return by_level(1, 3, source == 0 ? DEPTH_SIZES : DEPTH_SIZES - 1);
}

/* The size that the targets name, 64^3; a test has only the first. */
static int depth_target_size(void)
{
    return by_level(0, 2, 2);
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
    float sum; /* of what was read: keeps the compiler from dropping the reads */
    timing copy[DEPTH_SIZES];
    limits limit;
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
    for (int round = 0; round < by_level(1, 3, n > 64 ? 2 : DEPTH_ROUNDS); round++) {
        depth_round(b, result, n, round);
        limits_copy(&b->copy[size], n, 3);
        limits_round(&b->limit);
    }
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

/* A closed volume asks one exp and two erfs for each cell and Gaussian; nothing else does. */
static void depth_limit_cells(report *r, const depth_bench *b, int size, int m, double ms)
{
    double pairs = DEPTH_GAUSSIANS * pow(depth_sizes[size], 3);
    evaluations e = {2 * pairs, pairs};
    report_cell(r, "%.3g", 100 * timing_median(&b->copy[size]) / ms);
    if (depth_methods[m].method == SCATTER_DEPTH_CLOSED_VOLUME)
        report_cell(r, "%.3g", 100 * limits_ms(&b->limit, e) / ms);
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
    depth_limit_cells(r, b, size, m, ms);
    report_row(r, size == depth_target_size() && s == 0);
}

static void depth_copy_row(report *r, const timing *copy, int size)
{
    int n = depth_sizes[size];
    report_cell(r, "memcpy of a volume");
    report_cell(r, "%s", "");
    report_cell(r, "%d", n);
    for (int i = 0; i < 3; i++)
        report_cell(r, "%s", "");
    report_cell(r, "%.3g%s", timing_median(copy), timing_flag(copy));
    report_cell(r, "%.3g", timing_min(copy));
    report_cell(r, "%s", "");
    report_cell(r, "%.3g", timing_median(copy) * 1e6 / ((double)n * n * n));
    report_row(r, size == depth_target_size());
}

static void depth_table(report *r, const depth_bench *b)
{
    report_table(r, "depth",
                 "method|source|n|error at cells %|error between %|order|ms|min ms|"
                 "source moved ms|ns/cell|times as fast as march|ns/read|memcpy speed %|"
                 "erf and exp speed %");
    for (int s = 0; s < DEPTH_SOURCES; s++)
        for (int size = 0; size < depth_size_count(s); size++) {
            for (int m = 0; m < DEPTH_METHODS; m++)
                depth_row(r, b, s, size, m);
            if (s == 0)
                depth_copy_row(r, &b->copy[size], size);
        }
    report_end(r);
}

/* ------------------------------------------------------------------------------- propagation */

/* Polar propagation alone, of one kind of medium in one size, beside memcpy. */
typedef struct depth_speed {
    timing polar, copy;
} depth_speed;

/* The medium of b as n^3 voxels. Free the voxels. */
static scatter_medium depth_voxels(const depth_bench *b, int n, scatter_grid *grid)
{
    scatter_volume volume = {floats((size_t)n * (size_t)n * (size_t)n), n, n, n, b->medium.bounds};
    scatter_medium medium = b->medium;
    must(scatter_inject(NULL, &b->medium, &volume), "scatter_inject");
    memset(grid, 0, sizeof *grid);
    grid->density = volume.values;
    grid->nx = grid->ny = grid->nz = n;
    grid->box = b->medium.bounds;
    medium.gaussian_count = 0;
    medium.grids = grid;
    medium.grid_count = 1;
    return medium;
}

static void depth_propagate(depth_bench *b, const scatter_medium *medium, int n, depth_speed *t)
{
    scatter_quality quality;
    memset(&quality, 0, sizeof quality);
    quality.depth = SCATTER_DEPTH_POLAR;
    quality.grid = n;
    for (int round = 0; round < by_level(2, 7, DEPTH_PROPAGATIONS); round++) {
        depth_disturb(b, round, 0);
        double start = thread_ms();
        must(scatter_depth_update(b->depth[0], medium, &b->source, &quality),
             "scatter_depth_update");
        if (round > 0) /* the first one allocates */
            timing_add(&t->polar, thread_ms() - start);
        limits_copy(&t->copy, n, 3);
    }
}

static double depth_share(const depth_speed *t)
{
    return timing_median(&t->copy) / timing_median(&t->polar);
}

static double depth_speed_ns(const depth_speed *t, int n)
{
    return timing_median(&t->polar) * 1e6 / ((double)n * n * n);
}

static void depth_speed_row(report *r, const depth_speed *t, const char *medium, int n)
{
    report_cell(r, "%s", medium);
    report_cell(r, "%d", n);
    report_cell(r, "%.3g%s", timing_median(&t->polar), timing_flag(&t->polar));
    report_cell(r, "%.3g", timing_min(&t->polar));
    report_cell(r, "%.3g", depth_speed_ns(t, n));
    report_cell(r, "%.3g%s", timing_median(&t->copy), timing_flag(&t->copy));
    report_cell(r, "%.3g", 100 * depth_share(t));
    report_row(r, 1);
}

/* Of voxels and of Gaussians, at 64^3 and 128^3. */
static void depth_propagation(report *r, depth_bench *b)
{
    depth_speed voxels[2], sums[2];
    memset(voxels, 0, sizeof voxels);
    memset(sums, 0, sizeof sums);
    b->source = depth_source(0);
    for (int i = 0; i < 2; i++) {
        scatter_grid grid;
        scatter_medium medium = depth_voxels(b, 64 << i, &grid);
        depth_propagate(b, &medium, 64 << i, &voxels[i]);
        depth_propagate(b, &b->medium, 64 << i, &sums[i]);
        free((void *)(uintptr_t)grid.density);
    }
    report_text(r,
                "Polar propagation alone (only the lamp, outside, has moved) beside memcpy of the "
                "two volumes that it reads and writes; medium: the same 16 Gaussians, as such and "
                "as n^3 voxels.");
    report_table(r, "propagation", "medium|n|ms|min ms|ns/cell|memcpy ms|memcpy speed %");
    for (int i = 0; i < 2; i++) {
        depth_speed_row(r, &voxels[i], "voxels", 64 << i);
        depth_speed_row(r, &sums[i], "Gaussians", 64 << i);
    }
    report_end(r);
    report_target(r, depth_share(&voxels[0]) >= 0.25 && depth_share(&sums[0]) >= 0.25,
                  "polar propagation, 64^3: at >= 25 % of memcpy speed",
                  "%.3g %% for voxels, %.3g %% for Gaussians", 100 * depth_share(&voxels[0]),
                  100 * depth_share(&sums[0]));
    report_target(r,
                  depth_speed_ns(&voxels[1], 128) <= depth_speed_ns(&voxels[0], 64) &&
                      depth_speed_ns(&sums[1], 128) <= depth_speed_ns(&sums[0], 64),
                  "polar propagation, 128^3: no slower per cell than 64^3",
                  "%.3g against %.3g ns for voxels, %.3g against %.3g for Gaussians",
                  depth_speed_ns(&voxels[1], 128), depth_speed_ns(&voxels[0], 64),
                  depth_speed_ns(&sums[1], 128), depth_speed_ns(&sums[0], 64));
}

/* ----------------------------------------------------------------------------------- targets */

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
        const depth_result *d = &b->result[s][depth_target_size()][m];
        const depth_result *march = &b->result[s][depth_target_size()][DEPTH_METHODS - 1];
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
    report_claim(r, "64^3 closed volume, 16 Gaussians", "0.1 % in 10 ms",
                 "%.2g %% at cells, %.3g %% between them, %.2f ms", 100 * closed.cells,
                 100 * closed.points, closed.ms);
    report_claim(r, "64^3 polar volume, 16 Gaussians", "1 % in 2 ms",
                 "%.3g %% in %.2f ms, %.1f times as fast as marching",
                 100 * worse_of(polar.cells, polar.points), polar.ms, polar.speedup);
}

static void depth_run(report *r)
{
    depth_bench *b = (depth_bench *)malloc(sizeof *b);
    bench_host books = {0, 1};
    scatter_host host = host_of(&books);
    if (!b)
        must(SCATTER_OUT_OF_MEMORY, "malloc");
    depth_medium(b);
    limits_open(&b->limit);
    report_text(r, "## Optical depth in a volume");
    report_text(r,
                "%d random Gaussians (a = 4..12) in the unit cube, one thread. Errors are RMS "
                "over RMS of the closed form in double precision, at %d cells and at %d points "
                "between them. ms is the median with medium and source new, in rounds that take "
                "every method in turn. Shown is 64^3 and the lamp outside; `build/bench/depth.csv` "
                "has other sizes, a lamp "
                "inside and a sun. "
                "Limits: memcpy of a volume of that size, which reads and writes as much as a "
                "method that turns density into depth; for the closed volume its exps and erfs "
                "alone. Targets take the worst of the three sources and of the two errors.",
                DEPTH_GAUSSIANS, DEPTH_POINTS, DEPTH_POINTS);
    for (int m = 0; m < DEPTH_METHODS; m++)
        must(scatter_depth_create(&host, &b->depth[m]), "scatter_depth_create");
    for (int s = 0; s < DEPTH_SOURCES; s++)
        for (int size = 0; size < depth_size_count(s); size++)
            depth_measure(b, s, size);
    depth_table(r, b);
    depth_propagation(r, b);
    depth_targets(r, b);
    for (int m = 0; m < DEPTH_METHODS; m++)
        scatter_depth_destroy(b->depth[m]);
    free(b);
}

#endif
