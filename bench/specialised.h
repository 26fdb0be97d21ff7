/* specialised.h - benchmark 8: only what a scene needs. The library against a copy of itself that
   knows its one class of scenes when it is compiled, and what static parts cost. MIT licence. */
#ifndef SCATTER_BENCH_SPECIALISED_H
#define SCATTER_BENCH_SPECIALISED_H

#include "image.h"
#include "specialised_calls.h"

enum {
    SPECIAL_SIZE = 256,
    SPECIAL_SCENES = 3,
    SPECIAL_ROUNDS = 15,
    SPECIAL_LIGHTS = 8,
    SPECIAL_CHANGES = 4
};

static const char *const special_paths[SPECIAL_SCENES] = {
    "examples/scenes/one_gaussian.scatter", "bench/eight.scatter", "bench/eight_four.scatter"};

/* The scene as the class wants it: grey extinction, isotropic. */
static void special_simplify(scatter_medium *m)
{
    memset(&m->phase, 0, sizeof m->phase);
    m->extinction.x = m->extinction.z = m->extinction.y;
}

static const specialised_calls special_whole = {scatter_create, scatter_destroy, scatter_update,
                                                scatter_render};

/* ms of rays in a context of its own. */
static double special_render(const specialised_calls *calls, const scatter_scene *scene,
                             const scatter_view *view, const scatter_image *image)
{
    scatter_context *context = NULL;
    must(calls->create(NULL, &context), "scatter_create");
    must(calls->update(context, scene, NULL), "scatter_update");
    double start = thread_ms();
    must(calls->render(context, view, image), "scatter_render");
    double ms = thread_ms() - start;
    calls->destroy(context);
    return ms;
}

typedef struct special_case {
    char name[64];
    timing whole, special;
    double difference; /* largest, over the mean of the picture */
    double outside;    /* the same with a phase function that the class does not have */
} special_case;

static double special_difference(const float *one, const float *other)
{
    setting s = setting_of(SCATTER_DEPTH_AUTO, SCATTER_RAY_QUADRATURE, 0, 0);
    setting_compare(&s, one, other, (size_t)3 * SPECIAL_SIZE * SPECIAL_SIZE);
    return s.worst;
}

/* Both in turn, the first one now this and now that. */
static void special_measure(special_case *c, const char *path)
{
    const size_t values = (size_t)3 * SPECIAL_SIZE * SPECIAL_SIZE;
    float *one = floats(values), *other = floats(values);
    scene_file file;
    memset(c, 0, sizeof *c);
    scene_short(path, c->name, sizeof c->name);
    scene_must_read(&file, path);
    special_simplify(&file.scene.medium);
    scatter_view view = scene_view(&file, SPECIAL_SIZE, SPECIAL_SIZE);
    scatter_image a = image_of(one, SPECIAL_SIZE, SPECIAL_SIZE);
    scatter_image b = image_of(other, SPECIAL_SIZE, SPECIAL_SIZE);
    for (int i = 0; i < 2 * SPECIAL_ROUNDS; i++)
        if ((i ^ i >> 1) & 1)
            timing_add(&c->special, special_render(&specialised, &file.scene, &view, &b));
        else
            timing_add(&c->whole, special_render(&special_whole, &file.scene, &view, &a));
    c->difference = special_difference(one, other);
    file.scene.medium.phase.kind = SCATTER_PHASE_HG;
    file.scene.medium.phase.g = 0.3f;
    special_render(&special_whole, &file.scene, &view, &a);
    special_render(&specialised, &file.scene, &view, &b);
    c->outside = special_difference(one, other);
    scene_free(&file);
    free(one);
    free(other);
}

static double special_row(report *r, const special_case *c)
{
    double ratio = timing_median(&c->whole) / timing_median(&c->special);
    report_cell(r, "%s", c->name);
    report_cell(r, "%.4g%s", timing_median(&c->whole), timing_flag(&c->whole));
    report_cell(r, "%.4g%s", timing_median(&c->special), timing_flag(&c->special));
    report_cell(r, "%d", c->whole.n);
    report_cell(r, "%.2f", 100 * (ratio - 1));
    report_cell(r, "%.2f", 100 * (timing_min(&c->whole) / timing_min(&c->special) - 1));
    report_cell(r, "%.2g", c->difference);
    report_row(r, 1);
    return ratio;
}

static void special_rays(report *r)
{
    special_case c;
    double most = 0, difference = 0, outside = INFINITY;
    report_table(r, "specialised",
                 "scene|library ms|specialised ms|n|library longer %|of the minima %|difference");
    for (int i = 0; i < SPECIAL_SCENES; i++) {
        special_measure(&c, special_paths[i]);
        most = fmax(most, special_row(r, &c));
        difference = worse_of(difference, c.difference);
        outside = fmin(outside, c.outside);
    }
    report_end(r);
    report_target(r, most <= 1.03, "within 3 % of a program that knows its scenes",
                  "%.2f %% longer at most", 100 * (most - 1));
    report_target(r, difference <= 2e-6 && outside > 0.01,
                  "the same pictures, to 2e-6 of their mean, and others outside the class",
                  "%.2g, and %.2g with another phase function", difference, outside);
}

/* ------------------------------------------------------------------------------ static parts */

/* What is different since the last update. */
typedef enum special_change {
    SPECIAL_ALL,
    SPECIAL_NOTHING,
    SPECIAL_LIGHT,
    SPECIAL_MEDIUM
} special_change;

static const char *const special_changes[SPECIAL_CHANGES] = {"everything new", "nothing",
                                                             "one light of eight", "one Gaussian"};

typedef struct special_update {
    timing ms;
    unsigned injections, propagations; /* of one update */
} special_update;

typedef struct special_static {
    scene_file file;
    scatter_light lights[SPECIAL_LIGHTS];
    scatter_quality quality;
    special_update change[SPECIAL_CHANGES];
} special_static;

static void special_open_static(special_static *s)
{
    memset(s, 0, sizeof *s);
    scene_must_read(&s->file, "bench/eight.scatter");
    for (int i = 0; i < SPECIAL_LIGHTS; i++) {
        s->lights[i] = s->file.lights[0];
        s->lights[i].position.x += 0.2f * (float)i;
    }
    s->file.scene.lights = s->lights;
    s->file.scene.light_count = SPECIAL_LIGHTS;
    s->quality.depth = SCATTER_DEPTH_POLAR;
    s->quality.density = SCATTER_DENSITY_VOLUME;
    s->quality.grid = 64;
}

static void special_apply(special_static *s, special_change change)
{
    if (change == SPECIAL_LIGHT)
        s->lights[3].position.y += 1e-3f;
    if (change == SPECIAL_MEDIUM || change == SPECIAL_ALL)
        s->file.gaussians[0].c *= 1.001f;
    for (int i = 0; i < SPECIAL_LIGHTS && change == SPECIAL_ALL; i++)
        s->lights[i].position.y += 1e-3f;
}

static void special_update_once(special_static *s, scatter_context *context, special_change change)
{
    special_update *u = &s->change[change];
    scatter_stats before = scatter_get_stats(context);
    special_apply(s, change);
    double start = thread_ms();
    must(scatter_update(context, &s->file.scene, &s->quality), "scatter_update");
    timing_add(&u->ms, thread_ms() - start);
    scatter_stats after = scatter_get_stats(context);
    u->injections = after.injections - before.injections;
    u->propagations = after.propagations - before.propagations;
}

static void special_static_row(report *r, const special_static *s, int change)
{
    const special_update *u = &s->change[change];
    report_cell(r, "%s", special_changes[change]);
    report_cell(r, "%.3g%s", timing_median(&u->ms), timing_flag(&u->ms));
    report_cell(r, "%.3g", timing_min(&u->ms));
    report_cell(r, "%d", u->ms.n);
    report_cell(r, "%u", u->injections);
    report_cell(r, "%u", u->propagations);
    report_row(r, 1);
}

static void special_static_targets(report *r, const special_static *s)
{
    const special_update *all = &s->change[SPECIAL_ALL], *none = &s->change[SPECIAL_NOTHING];
    const special_update *light = &s->change[SPECIAL_LIGHT];
    report_target(r,
                  none->injections == 0 && none->propagations == 0 && all->injections > 0 &&
                      timing_median(&none->ms) <= 0.01 * timing_median(&all->ms),
                  "a static scene: no injection, no propagation, <= 1 % of a whole update",
                  "%u, %u, %.3g %%", none->injections, none->propagations,
                  100 * timing_median(&none->ms) / timing_median(&all->ms));
    report_target(r, light->injections == 0 && light->propagations == 1,
                  "one light of eight moved: only its depth is redone",
                  "%u injections, %u propagations, %.3g of the whole", light->injections,
                  light->propagations, timing_median(&light->ms) / timing_median(&all->ms));
}

static void special_static_parts(report *r)
{
    special_static s;
    scatter_context *context = NULL;
    special_open_static(&s);
    must(scatter_create(NULL, &context), "scatter_create");
    must(scatter_update(context, &s.file.scene, &s.quality), "scatter_update"); /* allocates */
    for (int round = 0; round < SPECIAL_ROUNDS; round++)
        for (int change = 0; change < SPECIAL_CHANGES; change++)
            special_update_once(&s, context, (special_change)change);
    report_text(r,
                "`scatter_update` of `bench/eight.scatter` with %d lights, polar depth and "
                "injected density in 64^3 cells, after a change:",
                SPECIAL_LIGHTS);
    report_table(r, "static", "changed|ms|min ms|n|injections|propagations");
    for (int change = 0; change < SPECIAL_CHANGES; change++)
        special_static_row(r, &s, change);
    report_end(r);
    special_static_targets(r, &s);
    scatter_destroy(context);
    scene_free(&s.file);
}

static void special_run(report *r)
{
    report_text(r, "## 8. Only what a scene needs");
    report_text(r,
                "The library against a copy of it that is compiled for one class of scenes: "
                "Gaussians, point lights, grey extinction, isotropic phase, and nothing else "
                "(`bench/specialise.sh` writes these facts into its source and ray chapters, and "
                "the compiler drops the rest). %dx%d pixels, default quality, one thread, "
                "processor time of the rays, in turn.",
                SPECIAL_SIZE, SPECIAL_SIZE);
    special_rays(r);
    special_static_parts(r);
}

#endif
