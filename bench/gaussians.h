/* gaussians.h - benchmark: one to 27,000 Gaussians, injection and rays. MIT licence. */
#ifndef SCATTER_BENCH_GAUSSIANS_H
#define SCATTER_BENCH_GAUSSIANS_H

#include "image.h"

enum {
    MANY_MOST = 27000,
    MANY_COUNTS = 5,
    MANY_GRID = 64,
    MANY_SIZE = 128,
    MANY_ROUNDS = 5,
    MANY_PROBES = 256 /* cells at which the overlap is counted */
};

static const int many_counts[MANY_COUNTS] = {1, 125, 1000, 8000, 27000};

/* Number and width of the Gaussians, and what that cost. */
typedef struct many_case {
    int count;
    float a;
    double overlap; /* Gaussians within 3/a of a cell, at the mean */
    timing inject;
    setting s;
} many_case;

typedef struct many_bench {
    scatter_gaussian gaussians[MANY_MOST];
    scatter_light light;
    scatter_scene scene;
    scatter_view view;
    many_case constant_overlap[MANY_COUNTS], constant_width[MANY_COUNTS];
    float *cells, *rgb;
} many_bench;

/* The same mass of medium in the unit cube for any number and width. */
static void many_fill(many_bench *b, const many_case *c)
{
    uint64_t seed = 27;
    float amplitude = c->a * c->a * c->a / ((float)c->count * 5.568328f); /* pi^(3/2) */
    for (int i = 0; i < c->count; i++) {
        b->gaussians[i].center = random_point(&seed);
        b->gaussians[i].a = c->a;
        b->gaussians[i].c = amplitude;
    }
    if (c->count == 1)
        b->gaussians[0].center = scatter_v3(0.5f, 0.5f, 0.5f);
    b->scene.medium.gaussian_count = (size_t)c->count;
}

static double many_overlap(const many_bench *b, const many_case *c)
{
    uint64_t seed = 3;
    double inside = 0;
    for (int i = 0; i < MANY_PROBES; i++) {
        scatter_vec3 x = random_point(&seed);
        for (int k = 0; k < c->count; k++) {
            scatter_vec3 g = b->gaussians[k].center;
            float dx = g.x - x.x, dy = g.y - x.y, dz = g.z - x.z;
            inside += c->a * c->a * (dx * dx + dy * dy + dz * dz) < 9.0f;
        }
    }
    return inside / MANY_PROBES;
}

static void many_open(many_bench *b)
{
    memset(b, 0, sizeof *b);
    b->cells = floats((size_t)MANY_GRID * MANY_GRID * MANY_GRID);
    b->rgb = floats((size_t)3 * MANY_SIZE * MANY_SIZE);
    b->light.position = scatter_v3(1.6f, 1.9f, -0.4f);
    b->light.intensity = scatter_v3(20, 20, 20);
    b->light.radius = 0.01f;
    b->scene.lights = &b->light;
    b->scene.light_count = 1;
    b->scene.medium.extinction = scatter_v3(2, 2, 2);
    b->scene.medium.albedo = scatter_v3(0.9f, 0.9f, 0.9f);
    b->scene.medium.bounded = 1;
    b->scene.medium.bounds.max = scatter_v3(1, 1, 1);
    b->scene.medium.gaussians = b->gaussians;
    b->view = scatter_view_perspective(scatter_v3(0.5f, 0.7f, -2), scatter_v3(0.5f, 0.5f, 0.5f),
                                       scatter_v3(0, 1, 0), 0.6f, 1);
    for (int i = 0; i < MANY_COUNTS; i++) {
        many_case c;
        memset(&c, 0, sizeof c);
        c.count = many_counts[i];
        c.a = 2.0f * cbrtf((float)c.count);
        c.s = setting_of(SCATTER_DEPTH_POLAR, SCATTER_RAY_QUADRATURE, 16, MANY_GRID);
        c.s.quality.density = SCATTER_DENSITY_VOLUME;
        b->constant_overlap[i] = c;
        c.a = 20;
        b->constant_width[i] = c;
    }
}

static void many_measure(many_bench *b, many_case *c, int round)
{
    scatter_volume volume = {b->cells, MANY_GRID, MANY_GRID, MANY_GRID, b->scene.medium.bounds};
    scatter_image image = image_of(b->rgb, MANY_SIZE, MANY_SIZE);
    many_fill(b, c);
    if (round == 0)
        c->overlap = many_overlap(b, c);
    double start = thread_ms();
    must(scatter_inject(NULL, &b->scene.medium, &volume), "scatter_inject");
    timing_add(&c->inject, thread_ms() - start);
    render_timed(&c->s, &b->scene, &b->view, &image);
}

/* Nanoseconds of injection for each cell that a Gaussian overlaps. */
static double many_ns(const many_case *c)
{
    double cells = (double)MANY_GRID * MANY_GRID * MANY_GRID;
    return timing_median(&c->inject) * 1e6 / (cells * fmax(c->overlap, 1));
}

static void many_row(report *r, const many_case *c, const char *series)
{
    report_cell(r, "%s", series);
    report_cell(r, "%d", c->count);
    report_cell(r, "%.1f", (double)c->a);
    report_cell(r, "%.3g", c->overlap);
    report_cell(r, "%.3g%s", timing_median(&c->inject), timing_flag(&c->inject));
    report_cell(r, "%.3g", many_ns(c));
    report_cell(r, "%.3g%s", timing_median(&c->s.setup), timing_flag(&c->s.setup));
    report_cell(r, "%.3g%s", timing_median(&c->s.rays), timing_flag(&c->s.rays));
    report_cell(r, "%.3g", timing_min(&c->s.rays));
    report_row(r, 1);
}

static void many_targets(report *r, const many_bench *b)
{
    const many_case *overlap = b->constant_overlap, *width = b->constant_width;
    double grown = timing_median(&overlap[4].inject) / timing_median(&overlap[2].inject);
    double dearer = many_ns(&width[4]) / many_ns(&width[2]);
    double least = 1e30, most = 0;
    for (int i = 1; i < MANY_COUNTS; i++) { /* one narrow Gaussian leaves most pixels empty */
        double o = timing_median(&overlap[i].s.rays), w = timing_median(&width[i].s.rays);
        least = fmin(least, fmin(o, w));
        most = fmax(most, fmax(o, w));
    }
    report_target(r, grown <= 2,
                  "27 times the Gaussians at the same overlap: injection takes <= 2 times as long",
                  "%.2f times", grown);
    report_target(r, dearer <= 1.25,
                  "27 times the Gaussians of the same width: no dearer per overlapped cell "
                  "(25 % allowed)",
                  "%.2f times", dearer);
    report_target(r, most <= 1.25 * least,
                  "rays do not depend on the number, 125 and more, once injected (25 % allowed)",
                  "%.1f..%.1f ms", least, most);
}

static void many_run(report *r)
{
    many_bench *b = (many_bench *)malloc(sizeof *b);
    if (!b)
        must(SCATTER_OUT_OF_MEMORY, "malloc");
    many_open(b);
    report_text(r, "## One to 27,000 Gaussians");
    report_text(r,
                "The same mass of medium as n random Gaussians in the unit cube, one thread. "
                "Injection into %d^3 cells (scatter_inject); an image of %dx%d with injected "
                "density, polar depth and 16 nodes. Overlap: Gaussians within 3/a of a cell. "
                "Setup holds injection and propagation.",
                MANY_GRID, MANY_SIZE, MANY_SIZE);
    for (int round = 0; round < by_level(1, 2, MANY_ROUNDS); round++)
        for (int i = 0; i < MANY_COUNTS; i++) {
            many_measure(b, &b->constant_overlap[i], round);
            many_measure(b, &b->constant_width[i], round);
        }
    report_table(r, "gaussians",
                 "series|n|a|overlap|inject ms|ns/overlapped cell|setup ms|rays ms|min ms");
    for (int i = 0; i < MANY_COUNTS; i++)
        many_row(r, &b->constant_overlap[i], "same overlap");
    for (int i = 0; i < MANY_COUNTS; i++)
        many_row(r, &b->constant_width[i], "same width");
    report_end(r);
    many_targets(r, b);
    free(b->cells);
    free(b->rgb);
    free(b);
}

#endif
