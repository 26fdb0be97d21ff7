/* tables.h - the scaling of Giroud and Biri's tables 2 and 3, theirs beside ours. MIT licence.

   Their frames a second (2012, GeForce GTX 280, 800x600) against ours (one processor, a smaller
   picture): only ratios to the first column are comparable, and only roughly, because a processor
   and a graphics card divide the time differently between volumes and rays. */
#ifndef SCATTER_BENCH_TABLES_H
#define SCATTER_BENCH_TABLES_H

#include "gaussians.h"

enum { TABLES_SIZES = 4, TABLES_LIGHTS = 4, TABLES_COUNTS = 5, TABLES_ROUNDS = 3 };

/* Frames a second of table 2: the first column with volumes kept, then 1, 2, 4 and 8 lights with
   volumes renewed; and of table 3: dynamic and static, at 20^3. */
static const int tables_sizes[TABLES_SIZES] = {15, 20, 30, 40};
static const int tables_lights[TABLES_LIGHTS] = {1, 2, 4, 8};
static const double tables_two[TABLES_SIZES][TABLES_LIGHTS + 1] = {
    {320, 62, 62, 51, 34}, {251, 38, 37, 35, 22}, {203, 17, 17, 16, 9}, {120, 9, 9, 9, 5}};
static const double tables_three[2][TABLES_COUNTS] = {{38, 36, 35, 22, 9},
                                                      {251, 250, 252, 215, 142}};

/* The paper's pipeline, and ours with the same cells. */
typedef struct tables_way {
    const char *name;
    scatter_quality quality;
} tables_way;

enum { TABLES_WAYS = 2 };

static const tables_way tables_ways[TABLES_WAYS] = {
    {"their method, our code",
     {.depth = SCATTER_DEPTH_EQ6,
      .density = SCATTER_DENSITY_VOLUME,
      .ray = SCATTER_RAY_MARCH,
      .nodes = 64}},
    {"polar and quadrature",
     {.depth = SCATTER_DEPTH_POLAR,
      .density = SCATTER_DENSITY_VOLUME,
      .ray = SCATTER_RAY_QUADRATURE,
      .nodes = 16}}};

typedef struct tables_bench {
    many_bench *scene;
    scatter_light lights[8];
    timing kept, renewed; /* ms of a frame */
} tables_bench;

/* One frame with everything new, and one with nothing new. */
static void tables_frames(tables_bench *b, const scatter_quality *quality)
{
    scatter_image image = image_of(b->scene->rgb, MANY_SIZE, MANY_SIZE);
    scatter_context *context = NULL;
    must(scatter_create(NULL, &context), "scatter_create");
    must(scatter_update(context, &b->scene->scene, quality), "scatter_update"); /* allocates */
    b->kept.n = b->renewed.n = 0;
    for (int round = 0; round < TABLES_ROUNDS; round++)
        for (int kept = 0; kept < 2; kept++) {
            b->scene->gaussians[0].c *= kept ? 1 : 1.0001f;
            double start = thread_ms();
            must(scatter_update(context, &b->scene->scene, quality), "scatter_update");
            must(scatter_render(context, &b->scene->view, &image), "scatter_render");
            timing_add(kept ? &b->kept : &b->renewed, thread_ms() - start);
        }
    scatter_destroy(context);
}

static void tables_fill(tables_bench *b, int count, int lights)
{
    many_case c;
    memset(&c, 0, sizeof c);
    c.count = count;
    c.a = 2.0f * cbrtf((float)count);
    many_fill(b->scene, &c);
    for (int i = 0; i < lights; i++) {
        b->lights[i] = b->scene->light;
        b->lights[i].position.z += 0.3f * (float)i;
    }
    b->scene->scene.lights = b->lights;
    b->scene->scene.light_count = (size_t)lights;
}

/* Table 2: rows are numbers of cells, columns numbers of lights. */
static void tables_row_of_two(report *r, tables_bench *b, const tables_way *way, int size)
{
    scatter_quality quality = way->quality;
    double first = 0;
    quality.grid = tables_sizes[size];
    report_cell(r, "%s", way->name);
    report_cell(r, "%d^3", tables_sizes[size]);
    for (int i = 0; i < TABLES_LIGHTS; i++) {
        tables_fill(b, 125, tables_lights[i]);
        tables_frames(b, &quality);
        if (i == 0) {
            first = timing_median(&b->kept);
            report_cell(r, "1 (%.3g ms)", first);
        }
        report_cell(r, "%.3f%s", first / timing_median(&b->renewed), timing_flag(&b->renewed));
    }
    report_row(r, 1);
}

static void tables_two_run(report *r, tables_bench *b)
{
    report_table(r, "table2", "table 2|cells|1 light, kept|1 light|2 lights|4 lights|8 lights");
    for (int size = 0; size < TABLES_SIZES; size++) {
        report_cell(r, "the paper");
        report_cell(r, "%d^3", tables_sizes[size]);
        report_cell(r, "1 (%.3g ms)", 1000 / tables_two[size][0]);
        for (int i = 1; i <= TABLES_LIGHTS; i++)
            report_cell(r, "%.3f", tables_two[size][i] / tables_two[size][0]);
        report_row(r, 1);
        for (int way = 0; way < TABLES_WAYS; way++)
            tables_row_of_two(r, b, &tables_ways[way], size);
    }
    report_end(r);
}

/* Table 3: rows are dynamic and static, columns numbers of Gaussians. */
static void tables_rows_of_three(report *r, tables_bench *b, const tables_way *way)
{
    scatter_quality quality = way->quality;
    timing frame[2][TABLES_COUNTS];
    quality.grid = 20;
    for (int i = 0; i < TABLES_COUNTS; i++) {
        tables_fill(b, many_counts[i], 1);
        tables_frames(b, &quality);
        frame[0][i] = b->renewed;
        frame[1][i] = b->kept;
    }
    for (int still = 0; still < 2; still++) {
        double first = timing_median(&frame[still][0]);
        report_cell(r, "%s", way->name);
        report_cell(r, "%s", still ? "static" : "dynamic");
        report_cell(r, "1 (%.3g ms)", first);
        for (int i = 1; i < TABLES_COUNTS; i++)
            report_cell(r, "%.3f%s", first / timing_median(&frame[still][i]),
                        timing_flag(&frame[still][i]));
        report_row(r, 1);
    }
}

static void tables_three_run(report *r, tables_bench *b)
{
    report_table(r, "table3", "table 3|scene|1 Gaussian|125|1000|8000|27000");
    for (int still = 0; still < 2; still++) {
        report_cell(r, "the paper");
        report_cell(r, "%s", still ? "static" : "dynamic");
        report_cell(r, "1 (%.3g ms)", 1000 / tables_three[still][0]);
        for (int i = 1; i < TABLES_COUNTS; i++)
            report_cell(r, "%.3f", tables_three[still][i] / tables_three[still][0]);
        report_row(r, 1);
    }
    for (int way = 0; way < TABLES_WAYS; way++)
        tables_rows_of_three(r, b, &tables_ways[way]);
    report_end(r);
}

static void tables_run(report *r)
{
    tables_bench b;
    memset(&b, 0, sizeof b);
    b.scene = (many_bench *)malloc(sizeof *b.scene);
    if (!b.scene)
        must(SCATTER_OUT_OF_MEMORY, "malloc");
    many_open(b.scene);
    report_text(r, "## 9. How Giroud and Biri's tables scale");
    report_text(r,
                "Frames a second over those of the first column, of tables 2 and 3 in Giroud and "
                "Biri 2012 (GeForce GTX 280, 800x600) and here (one thread, %dx%d, 125 Gaussians "
                "in table 2, 20^3 cells in table 3). Kept: volumes are not renewed, as in their "
                "column (P) and their static scenes. Their method runs here with 64 steps a ray; "
                "the second one is ours with the same cells.",
                MANY_SIZE, MANY_SIZE);
    tables_two_run(r, &b);
    tables_three_run(r, &b);
    free(b.scene->cells);
    free(b.scene->rgb);
    free(b.scene);
}

#endif
