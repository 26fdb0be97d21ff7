/* papers.h - the papers' own methods as baselines: the cheapest setting of each that reaches 1 %,
   against ours; and the scaling of Giroud and Biri's tables. MIT licence.

   1. Giroud and Biri 2012: density in n^3 cells, eq. 6 as printed, uniform march that reads both.
   2. Kajiya and Von Herzen 1984: each cell marches to the light, then the same uniform march.
   3. Shadow rays: a uniform march, at every sample a uniform march to each light (Navarro et al.
      2008 without their optimisations), see shadow_rays.h.
   The first two are methods of the library, vectorised as the rest of it. */
#ifndef SCATTER_BENCH_PAPERS_H
#define SCATTER_BENCH_PAPERS_H

#include "cloud.h"
#include "gaussians.h"
#include "image.h"
#include "rays.h"
#include "shadow_rays.h"

enum {
    PAPERS_SIZE = 256,   /* pixels along the edge of the pictures that times are quoted for */
    PAPERS_LATTICE = 64, /* of the baselines' pictures: every fourth pixel in both directions */
    PAPERS_FEW = 32,     /* the same where the reference takes long */
    PAPERS_COARSE = 8,
    PAPERS_ROUNDS = 3,
    PAPERS_GAUSSIANS = 64 /* up to so many are summed by shadow rays, more are injected */
};

#define PAPERS_ERROR 0.01
#define PAPERS_BUDGET 25e3 /* ms for the search of a baseline in one scene */
#define PAPERS_OWN 5e3     /* the same for a variant of ours */
#define PAPERS_SLOW 2e3    /* ms; what takes longer is measured once */

typedef enum papers_method {
    PAPERS_OURS,
    PAPERS_GIROUD,
    PAPERS_KAJIYA,
    PAPERS_SHADOW,
    PAPERS_METHODS
} papers_method;

static const char *const papers_names[PAPERS_METHODS] = {"scatter", "Giroud & Biri",
                                                         "Kajiya & Von Herzen", "shadow rays"};

/* What is fixed while the steps on the eye ray grow: cells, or steps of a shadow ray. 1: none, ours
   in closed form; 0: the end. */
static const int papers_coarse[PAPERS_METHODS][PAPERS_COARSE] = {
    {64, 96, 128, 192, 256, 1},
    {16, 32, 48, 64, 96, 128, 192, 256},
    {16, 32, 48, 64, 96, 128, 192, 256},
    {4, 8, 16, 32, 64, 128, 256, 512}};

/* Ours is searched with each of these, and closed or polar depth. */
enum { PAPERS_VARIANTS = 4 };

typedef struct papers_variant {
    const char *name;
    scatter_density_method density;
    scatter_ray_method ray;
} papers_variant;

static const papers_variant papers_variants[PAPERS_VARIANTS] = {
    {"quadrature", SCATTER_DENSITY_EXACT, SCATTER_RAY_QUADRATURE},
    {"quadrature, injected", SCATTER_DENSITY_VOLUME, SCATTER_RAY_QUADRATURE},
    {"march", SCATTER_DENSITY_EXACT, SCATTER_RAY_MARCH},
    {"march, injected", SCATTER_DENSITY_VOLUME, SCATTER_RAY_MARCH}};

/* One setting and what it did. Times are for PAPERS_SIZE^2 pixels. */
typedef struct papers_way {
    papers_method method;
    int variant;       /* of ours, see papers_variants */
    int coarse, steps; /* steps on the eye ray; of ours the nodes */
    double rmse;
    timing setup, rays;
} papers_way;

typedef struct papers_bench {
    const char *path;
    char name[64];
    scene_file file;
    scatter_view view, few_view;
    int lattice;
    float *rgb, *few, *reference, *values; /* values: of injected Gaussians */
    papers_way best[PAPERS_METHODS];
    int never[PAPERS_METHODS]; /* finer settings no longer help: it never reaches the error */
    scatter_context *kept;     /* of the search, for the methods of the library */
    double kept_ms;            /* its first update */
    FILE *points;              /* all that was tried, for the charts */
} papers_bench;

static double papers_ms(const papers_way *w)
{
    return timing_median(&w->setup) + timing_median(&w->rays);
}

/* ------------------------------------------------------------------------------ one rendering */

static scatter_quality papers_quality(const papers_way *w)
{
    scatter_quality q;
    memset(&q, 0, sizeof q);
    q.nodes = w->steps;
    q.grid = w->coarse;
    if (w->method == PAPERS_OURS) {
        q.depth = w->coarse > 1 ? SCATTER_DEPTH_POLAR : SCATTER_DEPTH_CLOSED;
        q.density = papers_variants[w->variant].density;
        q.ray = papers_variants[w->variant].ray;
        q.grid = w->coarse > 1 ? w->coarse : 0;
    } else {
        q.depth = w->method == PAPERS_GIROUD ? SCATTER_DEPTH_EQ6 : SCATTER_DEPTH_MARCH;
        q.density = SCATTER_DENSITY_VOLUME;
        q.ray = SCATTER_RAY_MARCH;
    }
    return q;
}

/* Rays of the small picture, scaled to the large one. */
static double papers_scaled(const papers_bench *b, double ms)
{
    return ms * PAPERS_SIZE * PAPERS_SIZE / (b->lattice * b->lattice);
}

/* By the library, in a fresh context. */
static void papers_by_library(papers_bench *b, papers_way *w, int large)
{
    int size = large ? PAPERS_SIZE : b->lattice;
    setting s = setting_of(SCATTER_DEPTH_AUTO, SCATTER_RAY_QUADRATURE, 0, 0);
    scatter_image image = image_of(large ? b->rgb : b->few, size, size);
    double ms;
    s.quality = papers_quality(w);
    render_timed(&s, &b->file.scene, large ? &b->view : &b->few_view, &image);
    ms = timing_median(&s.rays);
    timing_add(&w->setup, timing_median(&s.setup));
    timing_add(&w->rays, large ? ms : papers_scaled(b, ms));
}

/* By the library in the kept context, where only the first update does the volumes. */
static void papers_by_kept(papers_bench *b, papers_way *w)
{
    scatter_quality quality = papers_quality(w);
    scatter_image image = image_of(b->few, b->lattice, b->lattice);
    double start = thread_ms();
    must(scatter_update(b->kept, &b->file.scene, &quality), "scatter_update");
    double ready = thread_ms();
    must(scatter_render(b->kept, &b->few_view, &image), "scatter_render");
    b->kept_ms = fmax(b->kept_ms, ready - start);
    timing_add(&w->setup, b->kept_ms);
    timing_add(&w->rays, papers_scaled(b, thread_ms() - ready));
}

static void papers_by_shadow_rays(papers_bench *b, papers_way *w)
{
    shadow_scene s = shadow_scene_of(&b->file.scene);
    double start = thread_ms();
    if (s.gaussian_count > PAPERS_GAUSSIANS)
        shadow_inject(&s, 128, b->values);
    double ready = thread_ms();
    shadow_image(&s, &b->few_view, b->lattice, w->steps, w->coarse, b->few);
    timing_add(&w->setup, ready - start);
    timing_add(&w->rays, papers_scaled(b, thread_ms() - ready));
}

/* The small picture, with its error. Returns ms spent. */
static double papers_render(papers_bench *b, papers_way *w)
{
    double start = thread_ms();
    if (w->method == PAPERS_SHADOW)
        papers_by_shadow_rays(b, w);
    else if (b->kept)
        papers_by_kept(b, w);
    else
        papers_by_library(b, w, 0);
    w->rmse = relative_rmse(b->few, b->reference, (size_t)(3 * b->lattice * b->lattice));
    return thread_ms() - start;
}

/* ------------------------------------------------------------------------------------- search */

/* The cheaper of those that reach the error, else the more accurate. */
static int papers_is_better(const papers_way *a, const papers_way *b)
{
    int reaches = a->rmse <= PAPERS_ERROR, reached = b->rmse <= PAPERS_ERROR;
    if (reaches != reached || !reaches)
        return reaches > reached || (reaches == reached && a->rmse < b->rmse);
    return papers_ms(a) < papers_ms(b);
}

static papers_way papers_way_of(papers_method method, int variant, int coarse, int steps)
{
    papers_way w;
    memset(&w, 0, sizeof w);
    w.method = method;
    w.variant = variant;
    w.coarse = coarse;
    w.steps = steps;
    return w;
}

/* How steps grow: nodes of the quadrature slowly, steps of marches by half. */
static int papers_more_steps(const papers_way *w)
{
    int few = w->method == PAPERS_OURS && papers_variants[w->variant].ray == SCATTER_RAY_QUADRATURE;
    int next = w->steps ? w->steps + (few ? 1 + w->steps / 4 : w->steps / 2) : few ? 4 : 8;
    return next <= (few ? 128 : 4096) ? next : 0;
}

/* Is this as far as more steps lead? Few steps may be wrong in ways that do not change either. */
static int papers_is_flat(const papers_way *w, double before)
{
    return w->steps >= 64 && fabs(w->rmse - before) < 0.02 * before;
}

static void papers_note(papers_bench *b, const papers_way *w)
{
    papers_way *best = &b->best[w->method];
    fprintf(b->points, "%s,%s,\"%d, %d\",%.6g,%.6g\n", b->name, papers_names[w->method], w->coarse,
            w->steps, papers_ms(w), w->rmse);
    if (!best->steps || papers_is_better(w, best))
        *best = *w;
}

/* More steps until the error is reached or no longer falls. Returns ms spent; the smallest error
   goes to *low. */
static double papers_raise_steps(papers_bench *b, papers_way w, double budget, double *low)
{
    double spent = 0, last = 0, before = INFINITY;
    *low = INFINITY;
    b->kept_ms = 0;
    if (w.method != PAPERS_SHADOW)
        must(scatter_create(NULL, &b->kept), "scatter_create");
    while ((w.steps = papers_more_steps(&w)) > 0 && spent + 1.5 * (last - b->kept_ms) < budget) {
        w.setup.n = w.rays.n = 0;
        spent += last = papers_render(b, &w);
        papers_note(b, &w);
        *low = fmin(*low, w.rmse);
        if (w.rmse <= PAPERS_ERROR || papers_is_flat(&w, before))
            break;
        before = w.rmse;
    }
    scatter_destroy(b->kept);
    b->kept = NULL;
    return spent;
}

/* Is the next `coarse` worth a try? Not when the last one made it dearer, or no more accurate. Ours
   is searched to the end, where the closed form is. */
static int papers_goes_on(const papers_way *best, int coarse, double was_ms, double low,
                          double before)
{
    if (best->method == PAPERS_OURS)
        return 1;
    if (best->rmse <= PAPERS_ERROR)
        return papers_ms(best) < was_ms;
    return coarse < 64 || low < 0.9 * before;
}

/* Finer and finer, as long as that makes it better and time is left. */
static void papers_search(papers_bench *b, papers_method method, int variant)
{
    const double budget = method == PAPERS_OURS ? PAPERS_OWN : PAPERS_BUDGET;
    papers_way *best = &b->best[method];
    double spent = 0, before = INFINITY;
    for (int i = 0; i < PAPERS_COARSE && spent < budget; i++) {
        int coarse = papers_coarse[method][i];
        double low, was_ms = best->steps && best->rmse <= PAPERS_ERROR ? papers_ms(best) : INFINITY;
        if (coarse == 0 || (coarse == 1 && b->file.scene.medium.grid_count))
            break; /* voxels have no closed form that is worth it */
        spent +=
            papers_raise_steps(b, papers_way_of(method, variant, coarse, 0), budget - spent, &low);
        if (!papers_goes_on(best, coarse, was_ms, low, before)) {
            b->never[method] = best->rmse > PAPERS_ERROR;
            break;
        }
        before = low;
    }
}

/* --------------------------------------------------------------------------------- one scene */

static void papers_open(papers_bench *b, const char *path)
{
    char csv[128];
    memset(b, 0, sizeof *b);
    b->path = path;
    scene_short(path, b->name, sizeof b->name);
    scene_must_read(&b->file, path);
    b->lattice = b->file.scene.medium.gaussian_count > RAYS_MANY ? PAPERS_FEW : PAPERS_LATTICE;
    b->rgb = floats((size_t)3 * PAPERS_SIZE * PAPERS_SIZE);
    b->few = floats((size_t)(3 * b->lattice * b->lattice));
    b->reference = floats((size_t)(3 * b->lattice * b->lattice));
    b->values = floats((size_t)128 * 128 * 128);
    b->view = scene_view(&b->file, PAPERS_SIZE, PAPERS_SIZE);
    b->few_view = view_lattice(b->view, PAPERS_SIZE, b->lattice);
    reference_of_file(&b->file, path, &b->few_view, b->lattice, b->reference);
    snprintf(csv, sizeof csv, "build/bench/%s.papers.csv", b->name);
    b->points = fopen(csv, "w");
    if (!b->points)
        report_die("cannot write", csv);
    fputs("scene,family,setting,ms,error\n", b->points);
}

static void papers_close(papers_bench *b)
{
    fclose(b->points);
    scene_free(&b->file);
    free(b->rgb);
    free(b->few);
    free(b->reference);
    free(b->values);
}

/* The chosen settings in turn, ours as the large picture; slow ones keep their first times. */
static void papers_rounds(papers_bench *b)
{
    double part = (double)(b->lattice * b->lattice) / (PAPERS_SIZE * PAPERS_SIZE);
    int again[PAPERS_METHODS];
    for (int m = 0; m < PAPERS_METHODS; m++) {
        papers_way *w = &b->best[m];
        again[m] = m == PAPERS_OURS ||
                   timing_median(&w->setup) + part * timing_median(&w->rays) < PAPERS_SLOW;
        if (again[m])
            w->setup.n = w->rays.n = 0;
    }
    for (int round = 0; round < PAPERS_ROUNDS; round++)
        for (int m = 0; m < PAPERS_METHODS; m++)
            if (m == PAPERS_OURS)
                papers_by_library(b, &b->best[m], 1);
            else if (again[m])
                papers_render(b, &b->best[m]);
}

static double papers_ratio(const papers_bench *b, int method)
{
    return papers_ms(&b->best[method]) / papers_ms(&b->best[PAPERS_OURS]);
}

/* `coarse` in words: cells, steps of a shadow ray, or the method of ours. */
static void papers_coarse_cell(report *r, const papers_way *w)
{
    if (w->method == PAPERS_SHADOW)
        report_cell(r, "%d on shadow rays", w->coarse);
    else if (w->coarse > 1)
        report_cell(r, "%d^3 cells", w->coarse);
    else
        report_cell(r, "closed form");
}

static void papers_row(report *r, const papers_bench *b, int method)
{
    const papers_way *w = &b->best[method];
    report_cell(r, "%s", b->name);
    report_cell(r, "%s%s%s", papers_names[method], method ? "" : ", ",
                method ? "" : papers_variants[w->variant].name);
    papers_coarse_cell(r, w);
    report_cell(r, "%d", w->steps);
    report_cell(r, "%.3g", timing_median(&w->setup));
    report_cell(r, "%.4g%s", timing_median(&w->rays), timing_flag(&w->rays));
    report_cell(r, "%d", w->rays.n);
    report_cell(r, "%.3g", 100 * w->rmse);
    report_cell(r, "%s%.3g",
                w->rmse <= PAPERS_ERROR ? ""
                : b->never[method]      ? "never, "
                                        : "> ",
                papers_ratio(b, method));
    report_row(r, 1);
}

/* The smallest ratio of each method over the scenes in which it can reach 1 %, and where; in how
   many scenes it does, and in how many it never will. */
typedef struct papers_least {
    double ratio[PAPERS_METHODS];
    char scene[PAPERS_METHODS][64];
    int reached[PAPERS_METHODS], never[PAPERS_METHODS], scenes;
} papers_least;

static void papers_scene(report *r, const char *path, papers_least *least)
{
    papers_bench b;
    papers_open(&b, path);
    for (int variant = 0; variant < PAPERS_VARIANTS; variant++)
        papers_search(&b, PAPERS_OURS, variant);
    for (int m = PAPERS_GIROUD; m < PAPERS_METHODS; m++)
        papers_search(&b, (papers_method)m, 0);
    papers_rounds(&b);
    least->scenes++;
    for (int m = 0; m < PAPERS_METHODS; m++) {
        papers_row(r, &b, m);
        least->reached[m] += b.best[m].rmse <= PAPERS_ERROR;
        least->never[m] += b.never[m];
        if (!b.never[m] && papers_ratio(&b, m) < least->ratio[m]) {
            least->ratio[m] = papers_ratio(&b, m);
            memcpy(least->scene[m], b.name, sizeof b.name);
        }
    }
    papers_close(&b);
}

static void papers_target(report *r, const papers_least *least, int m, double times,
                          const char *where)
{
    int all = least->reached[PAPERS_OURS] == least->scenes;
    char target[160];
    snprintf(target, sizeof target, "%s: at 1 %% at least %g times as fast as %s", where, times,
             papers_names[m]);
    if (least->never[m] < least->scenes)
        report_target(r, all && least->ratio[m] >= times, target,
                      "%.3g times at least (%s); reached in %d of %d scenes, never in %d",
                      least->ratio[m], least->scene[m], least->reached[m], least->scenes,
                      least->never[m]);
    else
        report_target(r, all, target, "finer settings never bring it to 1 %% in any of %d scenes",
                      least->scenes);
}

static void papers_targets(report *r, const papers_least *least, double times, const char *where)
{
    for (int m = PAPERS_GIROUD; m < PAPERS_METHODS; m++)
        papers_target(r, least, m, times, where);
}

static papers_least papers_none(void)
{
    papers_least least;
    memset(&least, 0, sizeof least);
    for (int m = 0; m < PAPERS_METHODS; m++)
        least.ratio[m] = INFINITY;
    return least;
}

#define PAPERS_HEADINGS                                                                            \
    "scene|method|coarse|steps or nodes|setup ms|rays ms|n|RMSE %|times the ms of ours"

static void papers_smooth(report *r)
{
    scene_list list;
    papers_least least = papers_none();
    list_smooth_scenes(&list, "examples/scenes");
    report_table(r, "papers", PAPERS_HEADINGS);
    for (int i = 0; i < list.count; i++)
        papers_scene(r, list.path[i], &least);
    report_end(r);
    papers_targets(r, &least, 100, "smooth scenes");
}

static void papers_cloud(report *r)
{
    papers_least least = papers_none();
    if (!cloud_is_there()) {
        report_text(r, "The cloud: skipped: no data (%s)", CLOUD_DATA);
        return;
    }
    report_table(r, "papers_cloud", PAPERS_HEADINGS);
    papers_scene(r, cloud_paths[0], &least);
    report_end(r);
    papers_targets(r, &least, 10, "cloud");
}

static void papers_run(report *r)
{
    report_text(r, "## 7. The papers' methods at 1 %%");
    report_text(r,
                "For each scene the cheapest setting of each method that keeps a relative RMSE of "
                "1 %%, found by trying finer and finer ones for up to %g s a method. Where none "
                "does, the most accurate one, with the ratio of the times as they are: `>`, if "
                "time ran out; `never`, if finer settings no longer help. One thread, processor "
                "time, pictures of %dx%d pixels; the baselines render %dx%d or %dx%d of them and "
                "their time on rays is scaled, setup counts fully; ours render all. Errors are "
                "taken at those pixels. `build/bench/SCENE.papers.csv` has all that was tried.",
                PAPERS_BUDGET * 1e-3, PAPERS_SIZE, PAPERS_SIZE, PAPERS_LATTICE, PAPERS_LATTICE,
                PAPERS_FEW, PAPERS_FEW);
    papers_smooth(r);
    papers_cloud(r);
}

#endif
