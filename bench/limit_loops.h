/* limit_loops.h - what no method can beat: copying its volumes, and evaluating its exponentials and
 * error functions, nothing else. MIT licence. */
#ifndef SCATTER_BENCH_LIMIT_LOOPS_H
#define SCATTER_BENCH_LIMIT_LOOPS_H

#include "image.h"

enum { LIMITS_N = 2048, LIMITS_PASSES = 64 }; /* 2048 floats in and out: they stay in the cache */

/* ms of so many evaluations as limits_evaluations() says. */
typedef struct limits {
    float in[LIMITS_N], out[LIMITS_N];
    float sum; /* of what came out: keeps the compiler from dropping the loops */
    timing erf, exp, libm_erf, libm_exp;
} limits;

static double limits_evaluations(void)
{
    return (double)LIMITS_N * LIMITS_PASSES;
}

/* The library's own functions in its own kind of loop. */
SCATTERI_HOT static void limits_erf(const float *SCATTERI_RESTRICT in, float *SCATTERI_RESTRICT out)
{
    for (int i = 0; i < LIMITS_N; i++)
        out[i] = scatteri_erf_over(in[i], in[i] * in[i]) / scatteri_erf_under(in[i] * in[i]);
}

SCATTERI_HOT static void limits_exp(const float *SCATTERI_RESTRICT in, float *SCATTERI_RESTRICT out)
{
    for (int i = 0; i < LIMITS_N; i++)
        out[i] = scatteri_decay(in[i]);
}

static void limits_libm_erf(const float *SCATTERI_RESTRICT in, float *SCATTERI_RESTRICT out)
{
    for (int i = 0; i < LIMITS_N; i++)
        out[i] = erff(in[i]);
}

static void limits_libm_exp(const float *SCATTERI_RESTRICT in, float *SCATTERI_RESTRICT out)
{
    for (int i = 0; i < LIMITS_N; i++)
        out[i] = expf(-in[i]);
}

static void limits_time(limits *l, timing *t, void (*loop)(const float *in, float *out))
{
    double start = thread_ms();
    for (int pass = 0; pass < LIMITS_PASSES; pass++) {
        loop(l->in, l->out);
        l->sum += l->out[pass];
    }
    timing_add(t, thread_ms() - start);
}

static void limits_open(limits *l)
{
    uint64_t seed = 5;
    memset(l, 0, sizeof *l);
    for (int i = 0; i < LIMITS_N; i++)
        l->in[i] = random_between(&seed, 0, 3);
}

/* Once each, in turn with what they are compared with. */
static void limits_round(limits *l)
{
    limits_time(l, &l->erf, limits_erf);
    limits_time(l, &l->exp, limits_exp);
    limits_time(l, &l->libm_erf, limits_libm_erf);
    limits_time(l, &l->libm_exp, limits_libm_exp);
}

/* How many of each an image or a volume needs. */
typedef struct evaluations {
    double erfs, exps;
} evaluations;

static double limits_ms(const limits *l, evaluations e)
{
    return (e.erfs * timing_median(&l->erf) + e.exps * timing_median(&l->exp)) /
           limits_evaluations();
}

static double limits_libm_ms(const limits *l, evaluations e)
{
    return (e.erfs * timing_median(&l->libm_erf) + e.exps * timing_median(&l->libm_exp)) /
           limits_evaluations();
}

/* Does the ray pass the Gaussian so closely that it counts? As docs/theory.md defines reach. */
static int limits_reaches(const scatter_gaussian *g, const scatter_ray *ray)
{
    double d[3], x[3], length = 0, along = 0, h2 = 0,
                       peak = (double)g->c * 1.7724539 / (double)g->a;
    scene_doubles(ray->direction, d);
    x[0] = (double)g->center.x - (double)ray->origin.x;
    x[1] = (double)g->center.y - (double)ray->origin.y;
    x[2] = (double)g->center.z - (double)ray->origin.z;
    length = sqrt(scene_dot(d, d));
    along = scene_dot(d, x) / length;
    h2 = scene_dot(x, x) - along * along;
    return (double)g->a * (double)g->a * h2 < 14 + log(fmax(1, peak));
}

/* What the formulas ask for an image of Gaussians: at each node for each Gaussian in reach of its
   ray one exp (density) and one erf (depth from the eye); for each light and Gaussian one exp and
   two erfs (depth from the light). Every ray that reaches any counts with `nodes` nodes. */
static evaluations limits_of_image(const scatter_scene *scene, const scatter_view *view, int size,
                                   int nodes)
{
    evaluations e = {0, 0};
    const scatter_medium *m = &scene->medium;
    double lit = (double)m->gaussian_count * (double)scene->light_count * nodes;
    for (int i = 0; i < size * size; i++) {
        scatter_ray ray = scatter_view_ray(view, ((float)(i % size) + 0.5f) / (float)size,
                                           ((float)(i / size) + 0.5f) / (float)size);
        int reached = 0;
        for (size_t k = 0; k < m->gaussian_count; k++)
            reached += limits_reaches(&m->gaussians[k], &ray);
        e.exps += (double)nodes * reached + (reached ? lit : 0);
        e.erfs += (double)nodes * reached + (reached ? 2 * lit : 0);
    }
    return e;
}

/* memcpy of a volume of n^3 floats: reads as much as a density volume holds and writes as much as a
   depth volume. */
static void limits_copy(timing *t, int n, int repeats)
{
    size_t bytes = (size_t)n * (size_t)n * (size_t)n * sizeof(float);
    char *from = (char *)malloc(bytes), *to = (char *)malloc(bytes);
    void *(*volatile copy)(void *, const void *, size_t) =
        memcpy; /* the compiler must not see it */
    if (!from || !to)
        must(SCATTER_OUT_OF_MEMORY, "malloc");
    memset(from, 1, bytes);
    memset(to, 2, bytes);
    for (int i = 0; i < repeats; i++) {
        double start = thread_ms();
        copy(to, from, bytes);
        timing_add(t, thread_ms() - start);
    }
    free(from);
    free(to);
}

#endif
