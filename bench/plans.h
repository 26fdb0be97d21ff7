/* plans.h - benchmark 7: what scatter_plan predicts, what is measured, and what a full search
 * finds; the error estimate of every render; the weights of the cost model. MIT licence. */
#ifndef SCATTER_BENCH_PLANS_H
#define SCATTER_BENCH_PLANS_H

#include "image.h"
#include "rays.h"

enum {
    PLANS_SCENES = 100, /* random ones */
    PLANS_SIZE = 48,    /* pixels along the edge of their images */
    PLANS_GAUSSIANS = 2000,
    PLANS_LIGHTS = 3,
    PLANS_FILE_SIZE = 64,  /* the same of scene files */
    PLANS_FILE_SMALL = 32, /* with many Gaussians, where the reference takes minutes */
    PLANS_LARGE = 256,     /* the same where the time of an estimate is measured */
    PLANS_NODES = 64,      /* of the yardstick */
    PLANS_CHECKED = 10,    /* random scenes whose yardstick is compared with the reference */
    PLANS_FEW = 40,        /* Gaussians up to which the reference is fast enough for that */
    PLANS_LATTICE = 16,    /* its pixels along an edge */
    PLANS_BUDGETS = 3,
    PLANS_GRIDS = 3,
    PLANS_FITTED = 4096 /* timed images for the cost model */
};

static const float plans_budgets[PLANS_BUDGETS] = {0.005f, 0.01f, 0.05f};

/* -------------------------------------------------------------------------- random scenes */

typedef struct plans_scene {
    scatter_scene scene;
    scatter_view view;
    scatter_gaussian gaussians[PLANS_GAUSSIANS];
    scatter_light lights[PLANS_LIGHTS];
} plans_scene;

static float random_log(uint64_t *seed, double low, double high)
{
    return (float)(low * pow(high / low, random_unit(seed)));
}

/* Uniform in a cube around 0. */
static scatter_vec3 random_around(uint64_t *seed, double half)
{
    scatter_vec3 p;
    p.x = random_between(seed, -half, half);
    p.y = random_between(seed, -half, half);
    p.z = random_between(seed, -half, half);
    return p;
}

/* `distance` from 0, in any direction. */
static scatter_vec3 random_away(uint64_t *seed, double distance)
{
    scatter_vec3 p = random_around(seed, 1);
    double length = sqrt((double)(p.x * p.x + p.y * p.y + p.z * p.z)) + 1e-3;
    float scale = (float)(distance / length);
    return scatter_v3(p.x * scale, p.y * scale, p.z * scale);
}

static scatter_vec3 random_color(uint64_t *seed, double low, double high)
{
    scatter_vec3 c;
    c.x = random_between(seed, low, high);
    c.y = random_between(seed, low, high);
    c.z = random_between(seed, low, high);
    return c;
}

static void plans_light(scatter_light *light, uint64_t *seed)
{
    int inside = random_unit(seed) < 0.4;
    float distance = random_between(seed, inside ? 0 : 1.5, inside ? 0.8 : 4);
    memset(light, 0, sizeof *light);
    light->kind = (scatter_light_kind)(random_unit(seed) * 3);
    light->position = random_away(seed, (double)distance);
    light->direction = scatter_v3(-light->position.x, -light->position.y, -light->position.z);
    light->intensity = random_color(seed, 0.5, 1);
    if (light->kind == SCATTER_LIGHT_DIRECTIONAL)
        return;
    light->intensity.x *= 1 + distance * distance;
    light->intensity.y *= 1 + distance * distance;
    light->intensity.z *= 1 + distance * distance;
    light->radius = random_unit(seed) < 0.2 ? 0 : random_log(seed, 0.003, 0.1);
    light->outer = random_between(seed, 0.3, 1.2);
    light->inner = light->outer * random_between(seed, 0, 0.9);
}

/* Gaussians about as wide as their distance, in a cube of 2 m; extinction such that the whole has
   an optical depth from thin to opaque. */
static void plans_medium(plans_scene *s, uint64_t *seed)
{
    scatter_medium *m = &s->scene.medium;
    int count = (int)random_log(seed, 1, PLANS_GAUSSIANS + 0.99);
    float narrow = random_log(seed, 0.7, 2.5), mass = 0, depth = random_log(seed, 0.05, 30);
    for (int i = 0; i < count; i++) {
        scatter_gaussian *g = &s->gaussians[i];
        g->center = random_around(seed, 1);
        g->a = narrow * cbrtf((float)count) * random_log(seed, 0.6, 1.7);
        g->c = random_log(seed, 0.3, 3);
        mass += g->c * 5.568328f / (g->a * g->a * g->a); /* pi^(3/2) */
    }
    float gray = depth * 4 / mass; /* mean depth across the cube: mass / 4 m^2 */
    m->extinction = scatter_v3(gray, gray, gray);
    if (random_unit(seed) < 0.3)
        m->extinction = scatter_v3(0.7f * gray, gray, 1.4f * gray);
    m->albedo = random_color(seed, 0.7, 1);
    m->phase.kind = random_unit(seed) < 0.5 ? SCATTER_PHASE_HG : SCATTER_PHASE_ISOTROPIC;
    m->phase.g = random_between(seed, -0.3, 0.8);
    m->gaussians = s->gaussians;
    m->gaussian_count = (size_t)count;
}

/* The same scene for the same number, on any machine. */
static void plans_make(plans_scene *s, int number)
{
    uint64_t seed = (uint64_t)(number + 1) * 0x9e3779b97f4a7c15u;
    memset(s, 0, sizeof *s);
    plans_medium(s, &seed);
    s->scene.light_count = (size_t)(1 + random_unit(&seed) * PLANS_LIGHTS);
    s->scene.lights = s->lights;
    for (size_t i = 0; i < s->scene.light_count; i++)
        plans_light(&s->lights[i], &seed);
    if (random_unit(&seed) < 0.2)
        s->scene.background = random_color(&seed, 0, 0.05);
    int inside = random_unit(&seed) < 0.3;
    scatter_vec3 eye = random_away(&seed, inside ? 0.6 : 4);
    s->view = scatter_view_perspective(eye, random_around(&seed, 0.3), scatter_v3(0, 1, 0),
                                       inside ? 1.2f : 0.6f, 1);
}

/* ---------------------------------------------------------------------------- cost model */

/* Work that was counted, and the time that it took. */
typedef struct plans_fit {
    int count;
    double work[PLANS_FITTED][SCATTERI_WORKS], ns[PLANS_FITTED];
} plans_fit;

/* Counts the work of the image; takes as long as rendering it. */
static void plans_count(const scatter_context *context, const scatter_view *view,
                        const scatter_image *image, double *work)
{
    scatteri_picture job;
    scatteri_eye eye;
    scatteri_seen seen;
    must(scatteri_begin_picture(&context->host, view, image, &job), "view");
    job.context = context;
    for (int i = 0; i < SCATTERI_WORKS; i++)
        work[i] = 0;
    for (int y = 0; y < image->height; y += SCATTERI_SIDE)
        for (int x = 0; x < image->width; x += SCATTERI_SIDE) {
            scatteri_see(&job, x, y, &eye, &seen);
            for (int i = 0; i < SCATTERI_WORKS; i++)
                work[i] += eye.nodes.work[i];
        }
}

static void plans_note(plans_fit *fit, const double *work, double ms)
{
    if (fit->count == PLANS_FITTED || !(ms > 0))
        return;
    memcpy(fit->work[fit->count], work, sizeof fit->work[0]);
    fit->ns[fit->count++] = ms * 1e6;
}

/* Weights, none negative, with the least mean square of the relative error: coordinate descent. */
static void plans_solve(const plans_fit *fit, double *weight)
{
    for (int k = 0; k < SCATTERI_WORKS; k++)
        weight[k] = 0;
    for (int round = 0; round < 3000; round++)
        for (int k = 0; k < SCATTERI_WORKS; k++) {
            double up = 0, down = 0;
            for (int i = 0; i < fit->count; i++) {
                double a = fit->work[i][k] / fit->ns[i], rest = 1;
                if (a == 0)
                    continue;
                for (int j = 0; j < SCATTERI_WORKS; j++)
                    rest -= j != k ? fit->work[i][j] / fit->ns[i] * weight[j] : 0;
                up += a * rest;
                down += a * a;
            }
            weight[k] = down > 0 ? fmax(up / down, 0) : 0;
        }
}

/* -------------------------------------------------------------------------- one picture */

typedef struct plans_bench {
    plans_scene random;
    const scatter_scene *scene; /* the one at hand, its view and the edge of its image */
    scatter_view view;
    int size;
    float reference[3 * PLANS_FILE_SIZE * PLANS_FILE_SIZE], *rgb;
    plans_fit fit;
    int number; /* of timed images so far: some of them are for the cost model */
} plans_bench;

static scatter_image plans_image(const plans_bench *b)
{
    return image_of(b->rgb, b->size, b->size);
}

static double plans_error(const plans_bench *b)
{
    return relative_rmse(b->rgb, b->reference, (size_t)(3 * b->size * b->size));
}

/* The least of a few, fewer of what takes long, ms. */
static double plans_time_rays(const scatter_context *context, const scatter_view *view,
                              const scatter_image *image)
{
    timing t = {{0}, 0};
    while (t.n < 5 && (t.n == 0 || t.ms[0] * t.n < 8)) {
        double start = thread_ms();
        must(scatter_render(context, view, image), "scatter_render");
        timing_add(&t, thread_ms() - start);
    }
    return timing_min(&t);
}

static double plans_time_update(scatter_context *context, const scatter_scene *scene,
                                const scatter_quality *quality)
{
    double start = thread_ms();
    must(scatter_update(context, scene, quality), "scatter_update");
    return thread_ms() - start;
}

/* -------------------------------------------------------------------------- full search */

/* The cheapest setting so far that keeps each budget. */
typedef struct plans_best {
    double ms[PLANS_BUDGETS];
    scatter_quality quality[PLANS_BUDGETS];
} plans_best;

static void plans_take(plans_best *best, const scatter_quality *q, double error, double ms)
{
    for (int k = 0; k < PLANS_BUDGETS; k++)
        if (error <= (double)plans_budgets[k] && ms < best->ms[k]) {
            best->ms[k] = ms;
            best->quality[k] = *q;
        }
}

static void plans_note_image(plans_bench *b, const scatter_context *context, double rays)
{
    double work[SCATTERI_WORKS];
    scatter_image image = plans_image(b);
    plans_count(context, &b->view, &image, work);
    plans_note(&b->fit, work, rays);
}

static void plans_note_rules(plans_bench *b, const scatter_context *context, double setup)
{
    double rules[SCATTERI_WORKS] = {0};
    rules[SCATTERI_WORK_RULE] = (double)context->quality.nodes * (double)context->quality.nodes;
    if (context->quality.ray == SCATTER_RAY_QUADRATURE)
        plans_note(&b->fit, rules, setup);
}

/* One ladder of rays with one kind of depth, up to what is surely dearer than the cheapest for the
   strictest budget. `filled`: ms of the volumes. */
static void plans_climb(plans_bench *b, scatter_context *context, scatter_quality q, double filled,
                        plans_best *best)
{
    const int *ladder = scatteri_ladder[q.ray == SCATTER_RAY_MARCH];
    scatter_image image = plans_image(b);
    for (int i = 0; i < SCATTERI_LADDER; i++) {
        q.nodes = ladder[i];
        double setup = plans_time_update(context, b->scene, &q);
        double rays = plans_time_rays(context, &b->view, &image);
        plans_take(best, &q, plans_error(b), setup + filled + rays);
        if (b->number++ % 4 == 0) {
            plans_note_image(b, context, rays);
            plans_note_rules(b, context, setup);
        }
        if (rays + filled > best->ms[0] || rays > 3000)
            break;
    }
}

static void plans_note_volume(plans_bench *b, const scatter_context *context, double ms)
{
    double work[SCATTERI_WORKS] = {0};
    if (context->quality.depth != SCATTER_DEPTH_POLAR || !context->medium.has_local)
        return;
    scatteri_count_lights(context, context->quality.grid, work);
    plans_note(&b->fit, work, ms);
}

/* Both kinds of rays with one kind of depth; returns the ms that the volumes took. */
static double plans_search_depth(plans_bench *b, scatter_depth_method depth, int grid,
                                 plans_best *best)
{
    scatter_context *context = NULL;
    scatter_quality q;
    memset(&q, 0, sizeof q);
    q.depth = depth;
    q.grid = grid;
    q.ray = SCATTER_RAY_MARCH; /* has no rules: the first update fills volumes and nothing else */
    must(scatter_create(NULL, &context), "scatter_create");
    double filled = plans_time_update(context, b->scene, &q);
    plans_note_volume(b, context, filled);
    for (int ray = 0; ray < 2 && filled < best->ms[0]; ray++) {
        q.ray = ray ? SCATTER_RAY_MARCH : SCATTER_RAY_QUADRATURE;
        plans_climb(b, context, q, filled, best);
    }
    scatter_destroy(context);
    return filled;
}

/* Closed form, polar and closed volumes. Twice the cells along an edge take more than four times as
 * long to fill. */
static void plans_search(plans_bench *b, plans_best *best)
{
    static const scatter_depth_method methods[2] = {SCATTER_DEPTH_POLAR,
                                                    SCATTER_DEPTH_CLOSED_VOLUME};
    for (int k = 0; k < PLANS_BUDGETS; k++)
        best->ms[k] = 1e30;
    plans_search_depth(b, SCATTER_DEPTH_CLOSED, 64, best);
    for (int m = 0; m < 2; m++) {
        double filled = 0;
        for (int g = 0; g < PLANS_GRIDS && 4 * filled < best->ms[0]; g++)
            filled = plans_search_depth(b, methods[m], 32 << g, best);
    }
}

/* -------------------------------------------------------------------------------- plans */

/* What was planned, and what is measured with it. */
typedef struct plans_result {
    scatter_forecast forecast;
    double error, setup, rays, planning; /* ms */
} plans_result;

static void plans_try(plans_bench *b, float budget, plans_result *result)
{
    scatter_image image = plans_image(b);
    scatter_context *context = NULL;
    double start = thread_ms();
    must(scatter_plan(NULL, b->scene, &b->view, &image, budget, &result->forecast), "scatter_plan");
    result->planning = thread_ms() - start;
    must(scatter_create(NULL, &context), "scatter_create");
    result->setup = plans_time_update(context, b->scene, &result->forecast.quality);
    result->rays = plans_time_rays(context, &b->view, &image);
    result->error = plans_error(b);
    plans_note_image(b, context, result->rays);
    scatter_destroy(context);
}

/* Setting, prediction and measurement. */
static void plans_cells(report *r, const plans_result *p, float budget)
{
    const scatter_quality *q = &p->forecast.quality;
    const scatter_estimate *e = &p->forecast.estimate;
    report_cell(r, "%g", 100 * (double)budget);
    report_cell(r, "%s", scene_depth_name(q->depth));
    report_cell(r, "%s", scene_ray_name(q->ray));
    report_cell(r, "%d", q->nodes);
    report_cell(r, "%d", q->grid);
    report_cell(r, "%.3g", 100 * (double)e->error);
    report_cell(r, "%.2g", 100 * (double)e->uncertainty);
    report_cell(r, "%s", !p->forecast.kept ? "beyond" : e->trusted ? "yes" : "no");
    report_cell(r, "%.3g", 100 * p->error);
    report_cell(r, "%.3g", (double)(p->forecast.setup_ms + p->forecast.image_ms));
    report_cell(r, "%.3g", p->setup + p->rays);
    report_cell(r, "%.3g", p->planning);
}

#define PLANS_COLUMNS                                                                              \
    "budget %|depth|rays|nodes|grid|predicted %|+-|trusted|measured %|predicted ms|ms|planning ms"

/* ------------------------------------------------------------------------ random scenes */

/* All random scenes with one budget. */
typedef struct plans_tally {
    int scenes, within, silent, untrusted; /* silent: over the budget, and no word of it */
    double ratio[PLANS_SCENES], planning[PLANS_SCENES]; /* to the cheapest of the full search */
    int ratios;
} plans_tally;

static int plans_order(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static void plans_count_result(plans_tally *t, const plans_result *p, float budget, double best_ms)
{
    int word = !p->forecast.kept || !p->forecast.estimate.trusted;
    t->scenes++;
    t->within += p->error <= (double)budget;
    t->silent += !(p->error <= (double)budget) && !word;
    t->untrusted += word;
    if (best_ms > 1e29)
        return;
    t->ratio[t->ratios] = (p->setup + p->rays) / best_ms;
    t->planning[t->ratios++] = p->planning / best_ms;
}

static void plans_render_closed(const plans_bench *b, const scatter_view *view, int size,
                                float *rgb)
{
    scatter_image image = image_of(rgb, size, size);
    scatter_context *context = NULL;
    scatter_quality q;
    memset(&q, 0, sizeof q);
    q.depth = SCATTER_DEPTH_CLOSED;
    q.nodes = PLANS_NODES;
    must(scatter_create(NULL, &context), "scatter_create");
    must(scatter_update(context, b->scene, &q), "scatter_update");
    must(scatter_render(context, view, &image), "scatter_render");
    scatter_destroy(context);
}

static void plans_open_random(plans_bench *b, int number)
{
    plans_make(&b->random, number);
    b->scene = &b->random.scene;
    b->view = b->random.view;
    b->size = PLANS_SIZE;
}

/* The yardstick of random scenes is the library itself; here it is measured. Returns the largest
 * error. */
static double plans_check_yardstick(plans_bench *b, int *checked)
{
    double worst = 0;
    *checked = 0;
    for (int i = 0; i < PLANS_SCENES && *checked < PLANS_CHECKED; i++) {
        float exact[3 * PLANS_LATTICE * PLANS_LATTICE], ours[3 * PLANS_LATTICE * PLANS_LATTICE];
        plans_open_random(b, i);
        if (b->scene->medium.gaussian_count > PLANS_FEW)
            continue;
        uint64_t key = hash_bytes(HASH_START, &b->random.gaussians, sizeof b->random.gaussians);
        key = hash_bytes(key, b->random.lights, sizeof b->random.lights);
        key = hash_bytes(key, &b->scene->medium.extinction, sizeof(scatter_vec3));
        reference_cached(b->scene, "a random scene", key, &b->view, PLANS_LATTICE, exact);
        plans_render_closed(b, &b->view, PLANS_LATTICE, ours);
        worst = worse_of(worst, relative_rmse(ours, exact, 3 * PLANS_LATTICE * PLANS_LATTICE));
        ++*checked;
    }
    return worst;
}

static void plans_random(plans_bench *b, report *r, plans_tally *tally)
{
    for (int i = 0; i < PLANS_SCENES; i++) {
        plans_best best;
        plans_open_random(b, i);
        plans_render_closed(b, &b->view, b->size, b->reference);
        plans_search(b, &best);
        for (int k = 0; k < PLANS_BUDGETS; k++) {
            plans_result p;
            plans_try(b, plans_budgets[k], &p);
            plans_count_result(&tally[k], &p, plans_budgets[k], best.ms[k]);
            report_cell(r, "%d", i);
            report_cell(r, "%d", (int)b->scene->medium.gaussian_count);
            plans_cells(r, &p, plans_budgets[k]);
            report_cell(r, "%.3g", best.ms[k]);
            report_row(r, !(p.error <= (double)plans_budgets[k]));
        }
    }
}

static void plans_targets(report *r, plans_tally *tally)
{
    for (int k = 0; k < PLANS_BUDGETS; k++) {
        plans_tally *t = &tally[k];
        char what[128];
        int last = t->ratios - 1;
        qsort(t->ratio, (size_t)t->ratios, sizeof *t->ratio, plans_order);
        qsort(t->planning, (size_t)t->ratios, sizeof *t->planning, plans_order);
        snprintf(what, sizeof what, "random scenes, budget %g %%: kept in >= 95 of 100",
                 100 * (double)plans_budgets[k]);
        report_target(r, t->within >= 95 * t->scenes / 100, what,
                      "%d of %d; %d over it without a word, %d not trusted", t->within, t->scenes,
                      t->silent, t->untrusted);
        snprintf(what, sizeof what,
                 "random scenes, budget %g %%: <= 2 times the cheapest of a full search, median",
                 100 * (double)plans_budgets[k]);
        report_target(r, t->ratio[last / 2] <= 2, what,
                      "%.2f, nine in ten <= %.2f, at most %.2f; planning takes %.1f such images",
                      t->ratio[last / 2], t->ratio[9 * last / 10], t->ratio[last],
                      t->planning[last / 2]);
    }
}

/* ------------------------------------------------------------------------- scene files */

/* What the estimate of an image says, and what it costs. */
typedef struct plans_estimate {
    scatter_estimate says;
    double error, rays, extra, extra_large; /* ms; extra: share of the time without */
} plans_estimate;

/* Interleaved: with and without an estimate in turn. */
static double plans_extra(const scatter_context *context, const scatter_view *view,
                          scatter_image image, scatter_estimate *estimate, double *ms)
{
    timing with = {{0}, 0}, without = {{0}, 0};
    do {
        image.estimate = NULL;
        double start = thread_ms();
        must(scatter_render(context, view, &image), "scatter_render");
        timing_add(&without, thread_ms() - start);
        image.estimate = estimate;
        start = thread_ms();
        must(scatter_render(context, view, &image), "scatter_render");
        timing_add(&with, thread_ms() - start);
    } while (with.n < 7 && with.n * timing_min(&with) < 300);
    *ms = timing_min(&without);
    return timing_min(&with) / *ms - 1;
}

static void plans_estimate_file(plans_bench *b, const scene_file *file, plans_estimate *e)
{
    scatter_view large = scene_view(file, PLANS_LARGE, PLANS_LARGE);
    scatter_estimate other;
    double ms;
    scatter_context *context = NULL;
    must(scatter_create(NULL, &context), "scatter_create");
    must(scatter_update(context, b->scene, NULL), "scatter_update");
    e->extra = plans_extra(context, &b->view, plans_image(b), &e->says, &e->rays);
    e->error = plans_error(b);
    plans_note_image(b, context, e->rays);
    e->extra_large =
        plans_extra(context, &large, image_of(b->rgb, PLANS_LARGE, PLANS_LARGE), &other, &ms);
    scatter_destroy(context);
}

/* Scenes that are there and whose data is there. */
static void plans_list(scene_list *list)
{
    DIR *directory = opendir("examples/scenes");
    struct dirent *entry;
    list->count = 0;
    while (directory && (entry = readdir(directory)) != NULL && list->count < RAYS_SCENES) {
        size_t length = strlen(entry->d_name);
        scene_file file;
        char *path = list->path[list->count];
        if (length < 8 || strcmp(entry->d_name + length - 8, ".scatter") != 0)
            continue;
        snprintf(path, sizeof list->path[0], "examples/scenes/%s", entry->d_name);
        if (scene_read(&file, path) != 0)
            continue;
        list->count++;
        scene_free(&file);
    }
    if (directory)
        closedir(directory);
    qsort(list->path, (size_t)list->count, sizeof list->path[0], path_order);
}

/* Voxels and geometry cost time in scene files only. */
static void plans_fit_file(plans_bench *b)
{
    static const scatter_quality settings[4] = {
        {.depth = SCATTER_DEPTH_CLOSED,
         .density = SCATTER_DENSITY_EXACT,
         .ray = SCATTER_RAY_QUADRATURE,
         .nodes = 8,
         .grid = 64},
        {.depth = SCATTER_DEPTH_CLOSED,
         .density = SCATTER_DENSITY_EXACT,
         .ray = SCATTER_RAY_MARCH,
         .nodes = 32,
         .grid = 64},
        {.depth = SCATTER_DEPTH_POLAR,
         .density = SCATTER_DENSITY_EXACT,
         .ray = SCATTER_RAY_QUADRATURE,
         .nodes = 8,
         .grid = 64},
        {.depth = SCATTER_DEPTH_POLAR,
         .density = SCATTER_DENSITY_EXACT,
         .ray = SCATTER_RAY_MARCH,
         .nodes = 32,
         .grid = 128}};
    scatter_image image = plans_image(b);
    for (int i = 0; i < 4; i++) {
        scatter_context *context = NULL;
        must(scatter_create(NULL, &context), "scatter_create");
        double filled = plans_time_update(context, b->scene, &settings[i]);
        if (settings[i].ray == SCATTER_RAY_MARCH)
            plans_note_volume(b, context, filled);
        plans_note_image(b, context, plans_time_rays(context, &b->view, &image));
        scatter_destroy(context);
    }
}

static void plans_file(plans_bench *b, report *r, const char *path, plans_estimate *e)
{
    scene_file file;
    char name[64];
    scene_must_read(&file, path);
    b->scene = &file.scene;
    b->size = file.scene.medium.gaussian_count > RAYS_MANY ? PLANS_FILE_SMALL : PLANS_FILE_SIZE;
    b->view = scene_view(&file, b->size, b->size);
    reference_of_file(&file, path, &b->view, b->size, b->reference);
    for (int k = 0; k < PLANS_BUDGETS; k++) {
        plans_result p;
        plans_try(b, plans_budgets[k], &p);
        report_cell(r, "%s", scene_short(path, name, sizeof name));
        report_cell(r, "%d", b->size);
        plans_cells(r, &p, plans_budgets[k]);
        report_row(r, 1);
    }
    plans_estimate_file(b, &file, e);
    plans_fit_file(b);
    scene_free(&file);
}

static void plans_estimates(report *r, const scene_list *list, const plans_estimate *e)
{
    double extra[2 * RAYS_SCENES];
    char name[64];
    report_text(
        r,
        "What every image can say of itself (scatter_image.estimate), default quality. Extra: "
        "time on top of the image without it, at the size of the table above and at %dx%d.",
        PLANS_LARGE, PLANS_LARGE);
    report_table(r, "estimates", "scene|estimate %|+-|trusted|measured %|extra %|extra large %");
    for (int i = 0; i < list->count; i++) {
        report_cell(r, "%s", scene_short(list->path[i], name, sizeof name));
        report_cell(r, "%.3g", 100 * (double)e[i].says.error);
        report_cell(r, "%.2g", 100 * (double)e[i].says.uncertainty);
        report_cell(r, "%s", e[i].says.trusted ? "yes" : "no");
        report_cell(r, "%.3g", 100 * e[i].error);
        report_cell(r, "%.1f", 100 * e[i].extra);
        report_cell(r, "%.1f", 100 * e[i].extra_large);
        report_row(r, 1);
        extra[2 * i] = e[i].extra;
        extra[2 * i + 1] = e[i].extra_large;
    }
    report_end(r);
    qsort(extra, 2 * (size_t)list->count, sizeof *extra, plans_order);
    report_target(r, extra[2 * list->count - 1] <= 0.3, "an error estimate costs <= 30 %",
                  "%.1f %% at the median, %.1f %% at worst", 100 * extra[list->count],
                  100 * extra[2 * list->count - 1]);
}

static void plans_weights(report *r, const plans_fit *fit)
{
    static const char *const names[SCATTERI_WORKS] = {
        "packet", "test",     "page", "node",     "gaussian", "bin",  "voxel", "gather", "light",
        "shadow", "crossing", "read", "together", "call",     "cell", "point", "rule",   "strain"};
    double weight[SCATTERI_WORKS], off[PLANS_FITTED];
    plans_solve(fit, weight);
    for (int i = 0; i < fit->count; i++)
        off[i] = fabs(log(scatteri_cost(fit->work[i]) / fit->ns[i]));
    qsort(off, (size_t)fit->count, sizeof *off, plans_order);
    report_text(r,
                "Weights of the cost model, ns: those in scatter.h, and the best for %d images and "
                "volumes of "
                "this run. With those in scatter.h half of them are predicted within a factor "
                "of %.2f, nine in ten within %.2f.",
                fit->count, exp(off[fit->count / 2]), exp(off[9 * fit->count / 10]));
    report_table(r, "weights", "work|in scatter.h|measured");
    for (int k = 0; k < SCATTERI_WORKS; k++) {
        report_cell(r, "%s", names[k]);
        report_cell(r, "%.3g", (double)scatteri_nanoseconds[k]);
        report_cell(r, "%.3g", weight[k]);
        report_row(r, k != SCATTERI_WORK_STRAIN);
    }
    report_end(r);
}

static void plans_run(report *r)
{
    plans_bench *b = (plans_bench *)calloc(1, sizeof *b);
    plans_estimate estimates[RAYS_SCENES];
    plans_tally tally[PLANS_BUDGETS];
    scene_list list;
    int checked;
    if (!b)
        must(SCATTER_OUT_OF_MEMORY, "malloc");
    memset(tally, 0, sizeof tally);
    b->rgb = floats(3 * PLANS_LARGE * PLANS_LARGE);
    plans_list(&list);
    report_text(r, "## 7. Plans and estimates");
    report_text(r, "scatter_plan for three budgets on the scenes of the repository, against the "
                   "reference. Errors are relative RMSE; ms: setup and one image, one thread.");
    report_table(r, "plans", "scene|image|" PLANS_COLUMNS);
    for (int i = 0; i < list.count; i++)
        plans_file(b, r, list.path[i], &estimates[i]);
    report_end(r);
    plans_estimates(r, &list, estimates);
    double worst = plans_check_yardstick(b, &checked);
    report_text(
        r,
        "%d random scenes, %dx%d: 1 to %d Gaussians, one to %d lights of all kinds, thin to "
        "opaque, eye and lights inside and outside. The yardstick is closed form with %d nodes, "
        "which is "
        "within %.2g %% of the reference on %d of them. The full search takes closed form, polar "
        "and closed volumes of 32, 64 and 128 cells, and all nodes and steps of both ray "
        "methods. Shown are the plans that miss their budget; `build/bench/random.csv` has all.",
        PLANS_SCENES, PLANS_SIZE, PLANS_SIZE, PLANS_GAUSSIANS, PLANS_LIGHTS, PLANS_NODES,
        100 * worst, checked);
    report_table(r, "random", "scene|n|" PLANS_COLUMNS "|cheapest ms");
    plans_random(b, r, tally);
    report_end(r);
    plans_targets(r, tally);
    plans_weights(r, &b->fit);
    free(b->rgb);
    free(b);
}

#endif
