/* check.h - what the unit tests of scatter.h share: random numbers with a fixed seed, error
   measures, a host that counts and fails on demand, and a scene with its arrays in one struct.

   Include it after cmocka.h and scatter.h. Everything is static inline, so a test uses what it
   needs. Of cmocka only assert_true, assert_false, assert_int_equal, cmocka_unit_test and
   cmocka_run_group_tests are used. */
#ifndef CHECK_H
#define CHECK_H

#include <math.h>
#include <pthread.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define CHECK_PI 3.14159265358979323846
#define CHECK_COUNT(array) (sizeof(array) / sizeof((array)[0]))

/* ------------------------------------------------- >>comparisons */

static inline int check_at_most(const char *what, double value, double limit) {
    if (value <= limit)
        return 1;
    fprintf(stderr, "%s is %.9g, not at most %.9g\n", what, value, limit);
    return 0; /* also for NaN */
}

static inline int check_at_least(const char *what, double value, double limit) {
    if (value >= limit)
        return 1;
    fprintf(stderr, "%s is %.9g, not at least %.9g\n", what, value, limit);
    return 0;
}

#define assert_at_most(value, limit) assert_true(check_at_most(#value, (value), (limit)))
#define assert_at_least(value, limit) assert_true(check_at_least(#value, (value), (limit)))

/* The error of many values against their references. */
typedef struct check_error {
    double square, sum, norm, worst; /* sums of error^2, |reference|, reference^2 */
    size_t count;
} check_error;

static inline check_error check_no_error(void) {
    check_error e = {0, 0, 0, 0, 0};
    return e;
}

/* One more pair; the worst relative error counts the error beyond `floor`, which is absolute. */
static inline void check_add_floor(check_error *e, double value, double reference, double floor) {
    double miss = fabs(value - reference), relative = 0;
    e->square += miss * miss;
    e->sum += fabs(reference);
    e->norm += reference * reference;
    e->count++;
    if (!(miss <= floor))
        relative = (miss - floor) / fabs(reference);
    if (isnan(relative) || relative > e->worst) /* a NaN stays: nothing compares above it */
        e->worst = relative;
}

static inline void check_add(check_error *e, double value, double reference) {
    check_add_floor(e, value, reference, 0);
}

/* Root mean square error over the mean of the reference: the measure of images. */
static inline double check_rms(const check_error *e) {
    double n = (double)e->count;
    return sqrt(e->square / n) / (e->sum / n);
}

/* Root mean square error over the root mean square of the reference. */
static inline double check_relative_rms(const check_error *e) { return sqrt(e->square / e->norm); }

/* p of error ~ n^-p when n doubles. */
static inline double check_order(double coarse, double fine) { return log2(coarse / fine); }

/* ------------------------------------------------------ >>random */

/* splitmix64 (Steele, Lea, Flood 2014): every seed is a good one. */
static inline uint64_t check_bits(uint64_t *seed) {
    uint64_t z = (*seed += 0x9e3779b97f4a7c15u);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return z ^ (z >> 31);
}

static inline float check_uniform(uint64_t *seed, float low, float high) {
    return low + (high - low) * ((float)(check_bits(seed) >> 40) / 16777216.0f);
}

static inline scatter_vec3 check_point(uint64_t *seed, float low, float high) {
    scatter_vec3 p;
    p.x = check_uniform(seed, low, high);
    p.y = check_uniform(seed, low, high);
    p.z = check_uniform(seed, low, high);
    return p;
}

/* Uniform on the unit sphere. */
static inline scatter_vec3 check_direction(uint64_t *seed) {
    float z = check_uniform(seed, -1.0f, 1.0f), phi = check_uniform(seed, 0.0f, 6.2831853f);
    float r = sqrtf(1.0f - z * z);
    scatter_vec3 d;
    d.x = r * cosf(phi);
    d.y = r * sinf(phi);
    d.z = z;
    return d;
}

/* ----------------------------------------------------- >>vectors */

static inline scatter_vec3 check_v3(float x, float y, float z) {
    scatter_vec3 v;
    v.x = x;
    v.y = y;
    v.z = z;
    return v;
}

/* a + s b */
static inline scatter_vec3 check_along(scatter_vec3 a, float s, scatter_vec3 b) {
    return check_v3(a.x + s * b.x, a.y + s * b.y, a.z + s * b.z);
}

static inline scatter_vec3 check_minus(scatter_vec3 a, scatter_vec3 b) {
    return check_along(a, -1, b);
}

static inline double check_dot(scatter_vec3 a, scatter_vec3 b) {
    return (double)a.x * b.x + (double)a.y * b.y + (double)a.z * b.z;
}

static inline double check_distance(scatter_vec3 a, scatter_vec3 b) {
    double x = (double)a.x - b.x, y = (double)a.y - b.y, z = (double)a.z - b.z;
    return sqrt(x * x + y * y + z * z);
}

static inline scatter_box check_cube(float low, float high) {
    scatter_box box;
    box.min = check_v3(low, low, low);
    box.max = check_v3(high, high, high);
    return box;
}

/* -------------------------------------------------------- >>host */

/* A host that keeps books. Threads: `threads` below 2 is a plain loop; `reverse` runs the last task
 * first. */
typedef struct check_host {
    size_t live, bytes, calls; /* blocks and bytes held, allocations so far */
    size_t fail_at; /* the number of the allocation that fails, and all later ones; 0: none */
    int sentences;  /* of the log */
    scatter_result logged;
    char sentence[512];
    int threads, reverse;
    int reports, backward, outside, foreign; /* of the progress: calls, and what must not happen */
    int cancel_at;                           /* the number of the report that cancels; 0: none */
    float fraction;
    pthread_t caller;
} check_host;

typedef union check_block {
    size_t bytes;
    long double align;
    void *pointer;
} check_block;

static inline void *check_allocate(void *user, size_t bytes) {
    check_host *h = (check_host *)user;
    check_block *block;
    h->calls++;
    if ((h->fail_at && h->calls >= h->fail_at) || bytes > ((size_t)1 << 31))
        return NULL;
    block = (check_block *)malloc(sizeof(check_block) + bytes);
    if (!block)
        return NULL;
    block->bytes = bytes;
    h->live++;
    h->bytes += bytes;
    memset(block + 1, 0xa5, bytes); /* whoever reads memory that nobody wrote shall see it */
    return block + 1;
}

static inline void check_release(void *user, void *memory) {
    check_host *h = (check_host *)user;
    check_block *block = (check_block *)memory - 1;
    if (!memory)
        return;
    h->live--;
    h->bytes -= block->bytes;
    free(block);
}

static inline void check_log(void *user, scatter_result result, const char *sentence) {
    check_host *h = (check_host *)user;
    h->sentences++;
    h->logged = result;
    snprintf(h->sentence, sizeof h->sentence, "%s", sentence);
}

static inline int check_progress(void *user, float fraction) {
    check_host *h = (check_host *)user;
    h->reports++;
    h->backward += fraction < h->fraction;
    h->outside += !(fraction >= 0.0f && fraction <= 1.0f);
    h->foreign += !pthread_equal(pthread_self(), h->caller);
    h->fraction = fraction;
    return h->cancel_at != 0 && h->reports >= h->cancel_at;
}

typedef struct check_share {
    int first, step, count, reverse;
    void (*task)(void *, int);
    void *data;
} check_share;

static inline void *check_thread(void *argument) {
    check_share *s = (check_share *)argument;
    int i;
    for (i = s->first; i < s->count; i += s->step)
        s->task(s->data, s->reverse ? s->count - 1 - i : i);
    return NULL;
}

/* Thread t of n takes the tasks t, t+n, t+2n... */
static inline void check_parallel_for(void *user, int count, void (*task)(void *, int),
                                      void *data) {
    check_host *h = (check_host *)user;
    pthread_t thread[16];
    check_share share[16];
    int i, n = h->threads < 1 ? 1 : h->threads, made[16];
    for (i = 0; i < n; i++) {
        check_share s = {0, 0, 0, 0, NULL, NULL};
        s.first = i;
        s.step = n;
        s.count = count;
        s.reverse = h->reverse;
        s.task = task;
        s.data = data;
        share[i] = s;
        made[i] = i > 0 && pthread_create(&thread[i], NULL, check_thread, &share[i]) == 0;
    }
    for (i = 0; i < n; i++)
        if (!made[i])
            check_thread(&share[i]);
    for (i = 1; i < n; i++)
        if (made[i])
            pthread_join(thread[i], NULL);
}

/* A fresh host on `books`; threads 0 leaves parallel_for NULL. */
static inline scatter_host check_host_open(check_host *books, int threads) {
    scatter_host host;
    memset(books, 0, sizeof *books);
    memset(&host, 0, sizeof host);
    books->threads = threads;
    books->caller = pthread_self();
    host.user = books;
    host.allocate = check_allocate;
    host.release = check_release;
    host.log = check_log;
    host.parallel_for = threads ? check_parallel_for : NULL;
    return host;
}

/* ------------------------------------------------------ >>scenes */

/* A scene with its arrays. The scene points into the struct: never copy it. */
typedef struct check_world {
    scatter_scene scene;
    scatter_light lights[8];
    scatter_gaussian gaussians[64];
    scatter_height heights[4];
    scatter_grid grids[4];
    float voxels[4][1200];
} check_world;

/* An empty scene of grey medium, extinction 1/m, albedo 0.9, that has room in its arrays. */
static inline void check_world_open(check_world *w) {
    memset(w, 0, sizeof *w);
    w->scene.lights = w->lights;
    w->scene.medium.gaussians = w->gaussians;
    w->scene.medium.heights = w->heights;
    w->scene.medium.grids = w->grids;
    w->scene.medium.extinction = check_v3(1, 1, 1);
    w->scene.medium.albedo = check_v3(0.9f, 0.9f, 0.9f);
}

/* A context that holds the scene, without a host. */
static inline scatter_context *check_open_context(const scatter_scene *scene,
                                                  const scatter_quality *q) {
    scatter_context *context = NULL;
    assert_int_equal(scatter_create(NULL, &context), SCATTER_OK);
    assert_int_equal(scatter_update(context, scene, q), SCATTER_OK);
    return context;
}

static inline scatter_gaussian *check_add_gaussian(check_world *w, scatter_vec3 center, float a,
                                                   float c) {
    scatter_gaussian *g = &w->gaussians[w->scene.medium.gaussian_count++];
    g->center = center;
    g->a = a;
    g->c = c;
    return g;
}

/* `count` Gaussians with centres in the unit cube. */
static inline void check_add_gaussians(check_world *w, size_t count, float a_low, float a_high,
                                       uint64_t seed) {
    size_t i;
    for (i = 0; i < count; i++) {
        scatter_vec3 center = check_point(&seed, 0.0f, 1.0f);
        float a = check_uniform(&seed, a_low, a_high);
        check_add_gaussian(w, center, a, check_uniform(&seed, 0.5f, 3.0f));
    }
}

static inline void check_add_height(check_world *w, float density, float y0, float scale) {
    scatter_height *h = &w->heights[w->scene.medium.height_count++];
    h->density = density;
    h->y0 = y0;
    h->scale = scale;
}

/* A grid of random voxels in 0..1, about a quarter of them empty. */
static inline scatter_grid *check_add_grid(check_world *w, int nx, int ny, int nz, scatter_box box,
                                           uint64_t seed) {
    size_t n = w->scene.medium.grid_count++;
    scatter_grid *g = &w->grids[n];
    int i, cells = nx * ny * nz;
    for (i = 0; i < cells; i++) {
        float value = check_uniform(&seed, -0.33f, 1.0f);
        w->voxels[n][i] = value < 0.0f ? 0.0f : value;
    }
    g->density = w->voxels[n];
    g->nx = nx;
    g->ny = ny;
    g->nz = nz;
    g->box = box;
    return g;
}

static inline void check_bound(check_world *w, scatter_box box) {
    w->scene.medium.bounded = 1;
    w->scene.medium.bounds = box;
}

static inline scatter_light *check_add_light(check_world *w, scatter_light_kind kind,
                                             scatter_vec3 where, scatter_vec3 intensity) {
    scatter_light *l = &w->lights[w->scene.light_count++];
    l->kind = kind;
    if (kind == SCATTER_LIGHT_DIRECTIONAL)
        l->direction = where;
    else
        l->position = where;
    l->intensity = intensity;
    l->radius = 0.01f;
    return l;
}

#endif /* CHECK_H */
