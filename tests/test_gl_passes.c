/* test_gl_passes.c - each pass of scatter_gl.h that fills a volume, against its twin in scatter.h,
   value by value, in every kind of context. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#define SCATTER_IMPLEMENTATION
#include "../scatter_gl.h"
#include "check.h"
#include "gl_state.h"
#include "gl_host.h"
#include "gl_leaks.h"
#include "gl_rig.h"

#define CELLS 24

/* ---------------------------------------------------- >>a fog, and what it holds */

static void say(void *user, scatter_result result, const char *sentence) {
    (void)user;
    fprintf(stderr, "  %d: %s\n", (int)result, sentence);
}

static scatter_gl *open_fog(gl_rig *rig, int half_float) {
    scatter_gl_desc desc;
    scatter_gl *fog = NULL;
    memset(&desc, 0, sizeof desc);
    desc.host.log = say;
    desc.get_proc_address = rig->context.get_proc_address;
    desc.half_float = half_float;
    assert_int_equal(scatter_gl_create(&desc, &fog), SCATTER_OK);
    return fog;
}

static scatter_quality quality_of(scatter_depth_method depth, scatter_density_method density,
                                  int grid) {
    scatter_quality q;
    memset(&q, 0, sizeof q);
    q.depth = depth;
    q.density = density;
    q.grid = grid;
    return q;
}

/* Medium and lights of the world into the fog. */
static void fill_fog(scatter_gl *fog, const check_world *w, const scatter_quality *q,
                     const scatter_vec3 *eye) {
    scatter_gl_light lights[CHECK_COUNT(w->lights)];
    size_t i;
    memset(lights, 0, sizeof lights);
    for (i = 0; i < w->scene.light_count; i++)
        lights[i].light = w->lights[i];
    assert_int_equal(scatter_gl_set_medium(fog, &w->scene.medium), SCATTER_OK);
    assert_int_equal(scatter_gl_set_lights(fog, lights, w->scene.light_count), SCATTER_OK);
    assert_int_equal(scatter_gl_update(fog, q, eye), SCATTER_OK);
}

/* RGBA of all texels of a volume, layer by layer. */
static float *read_volume(gl_rig *rig, const scatteri_gl_texture *t) {
    const gl_functions *gl = &rig->host.gl;
    const size_t layer = 4 * (size_t)t->width * (size_t)t->height;
    float *values = (float *)malloc(layer * (size_t)t->depth * sizeof(float));
    GLuint framebuffer;
    int i;
    assert_true(values != NULL && t->name != 0);
    gl->GenFramebuffers(1, &framebuffer);
    gl->BindFramebuffer(GL_READ_FRAMEBUFFER, framebuffer);
    for (i = 0; i < t->depth; i++) {
        gl->FramebufferTextureLayer(GL_READ_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, t->name, 0,
                                    t->first + i);
        assert_int_equal(gl->CheckFramebufferStatus(GL_READ_FRAMEBUFFER), GL_FRAMEBUFFER_COMPLETE);
        gl->ReadBuffer(GL_COLOR_ATTACHMENT0);
        gl->ReadPixels(0, 0, t->width, t->height, GL_RGBA, GL_FLOAT, values + layer * (size_t)i);
    }
    gl->BindFramebuffer(GL_READ_FRAMEBUFFER, 0);
    gl->DeleteFramebuffers(1, &framebuffer);
    assert_int_equal(gl->GetError(), GL_NO_ERROR);
    return values;
}

/* ------------------------------------------------------------------------ >>worlds */

/* 16 Gaussians of widths 1/12..1/4 in the unit cube, which bounds them or not. */
static void open_cloud(check_world *w, int bounded) {
    check_world_open(w);
    check_add_gaussians(w, 16, 4.0f, 12.0f, 3);
    if (bounded)
        check_bound(w, check_cube(0.0f, 1.0f));
}

static void thicken(check_world *w, float times) {
    size_t i;
    for (i = 0; i < w->scene.medium.gaussian_count; i++)
        w->gaussians[i].c *= times;
}

/* Smooth voxels: |second difference| is small beside the value. */
static void add_smooth_grid(check_world *w, int n, scatter_box box) {
    scatter_grid *g = check_add_grid(w, n, n, n, box, 1);
    float *v = w->voxels[g - w->grids];
    int i, j, k;
    for (k = 0; k < n; k++)
        for (j = 0; j < n; j++)
            for (i = 0; i < n; i++)
                v[(k * n + j) * n + i] = 1.0f + sinf(0.5f * (float)i) * cosf(0.4f * (float)(j - k));
    g->scale = 1.5f;
}

/* Sources of all kinds: inside, on a face, on an edge of the unit cube, outside near and far. */
static void add_lights(check_world *w, int from, int to) {
    static const struct {
        scatter_light_kind kind;
        scatter_vec3 where;
    } lights[] = {{SCATTER_LIGHT_POINT, {0.43f, 0.61f, 0.37f}},
                  {SCATTER_LIGHT_DIRECTIONAL, {0.5f, -0.8f, 0.33f}},
                  {SCATTER_LIGHT_SPOT, {1.4f, 1.3f, 0.2f}},
                  {SCATTER_LIGHT_POINT, {0.5f, 1.0f, 0.5f}},
                  {SCATTER_LIGHT_DIRECTIONAL, {0.0f, -1.0f, 0.0f}},
                  {SCATTER_LIGHT_POINT, {0.52083333f, 0.52083333f, 0.52083333f}},
                  {SCATTER_LIGHT_SPOT, {-7.0f, 12.0f, -9.0f}},
                  {SCATTER_LIGHT_POINT, {0.0f, 0.0f, 1.0f}}};
    int i;
    for (i = from; i < to; i++) {
        scatter_light *l = check_add_light(w, lights[i].kind, lights[i].where, check_v3(1, 1, 1));
        if (lights[i].kind == SCATTER_LIGHT_SPOT) {
            l->direction = check_v3(-1, -1, 0.2f);
            l->inner = 0.3f;
            l->outer = 0.5f;
        }
    }
}

/* ------------------------------------------------------------------------ >>twins */

/* What is wrong with a twin on purpose: the comparison must see it. */
typedef enum fault {
    RIGHT,
    SHIFTED,   /* half a cell along x */
    MIRRORED,  /* y the wrong way round */
    UNDIVIDED, /* depth where depth over distance should be */
    NEXT,      /* the next source's channel */
    FAULTS
} fault;

static const char *const fault_names[] = {"right", "half a cell off", "mirrored", "not divided",
                                          "channel of the next"};

/* Value of cell (i, j, k) of nx * ny * nz. */
static double value_of(const float *v, int nx, int ny, int i, int j, int k, fault what) {
    const size_t row =
        ((size_t)k * (size_t)ny + (size_t)(what == MIRRORED ? ny - 1 - j : j)) * (size_t)nx;
    if (what == SHIFTED)
        return 0.5 * ((double)v[row + (size_t)i] + (double)v[row + (size_t)(i > 0 ? i - 1 : 0)]);
    return (double)v[row + (size_t)i];
}

/* The medium's local terms in the cells of its local box, by scatter.h. */
static float *injected_twin(const scatter_medium *m, int n, scatter_box *box) {
    const scatter_host host = scatteri_host_or_default(NULL);
    scatteri_medium medium;
    scatter_volume volume;
    scatteri_stage stage;
    float *values = (float *)malloc((size_t)(n * n * n) * sizeof(float));
    assert_true(values != NULL);
    memset(&medium, 0, sizeof medium);
    memset(&stage, 0, sizeof stage);
    stage.host = &host;
    assert_int_equal(scatteri_prepare(&host, &medium, m), SCATTER_OK);
    volume.box = medium.local;
    volume.nx = volume.ny = volume.nz = n;
    volume.values = values;
    assert_int_equal(scatteri_inject(&stage, &medium.desc, &volume, 0), SCATTER_OK);
    scatteri_drop_medium(&host, &medium);
    *box = volume.box;
    return values;
}

/* scatter.h chooses how often it samples a grid for 16 columns together, the GPU for each alone:
   columns anew, one in all lanes. */
static void fill_single_columns(scatter_depth *d) {
    scatteri_shells *work = (scatteri_shells *)malloc(sizeof *work);
    float *scratch = (float *)malloc((size_t)d->nx * (size_t)d->ny * (size_t)d->nz * sizeof(float));
    int i, j, k;
    assert_true(work != NULL && scratch != NULL);
    for (i = 0; i < d->nx; i++) {
        scatter_depth one = *d;
        one.nx = i + 1;
        one.values = scratch;
        for (j = 0; j < d->ny; j++)
            scatteri_fill_columns(&one, i, j, work);
        for (k = 0; k < d->nz; k++)
            for (j = 0; j < d->ny; j++)
                d->values[scatteri_cell_index(d, i, j, k)] =
                    scratch[scatteri_cell_index(&one, i, j, k)];
    }
    free(scratch);
    free(work);
}

/* scatter.h keeps the depth of directional sources in a lattice: the twin of our columns is made here. */
static int is_parallel(const scatter_depth *d) {
    return d->method == SCATTER_DEPTH_POLAR && d->source.directional;
}

/* Column (i, j): where it begins, where it goes to, how far. */
static void column_ray(const scatter_depth *d, int i, int j, scatter_vec3 *from, scatter_vec3 *to,
                       float *length) {
    scatteri_rays rays;
    if (is_parallel(d)) {
        *to = d->axis_w;
        *from = scatteri_along(d->box.min, d->axis_w, d->low_r);
        *from = scatteri_along(*from, d->axis_u, d->low_u + (float)i * d->step_u);
        *from = scatteri_along(*from, d->axis_v, d->low_v + (float)j * d->step_v);
        *length = (float)(d->nz - 1) * d->step_r;
        return;
    }
    scatteri_columns(d, i, j, &rays);
    *from = scatteri_add(rays.ref, scatteri_ray_origin(&rays, 0));
    *to = scatteri_ray_direction(&rays, 0);
    *length = rays.t1[0];
}

/* Depth of the grids between two shells, by middle values about as far apart as voxels. */
static double between_shells(const scatter_depth *d, scatter_vec3 from, float a, float b) {
    scatter_medium grids = d->medium->desc;
    const scatter_grid *g = grids.grids;
    scatter_vec3 size;
    float rate;
    double sum = 0;
    int samples, s;
    if (grids.grid_count == 0)
        return 0;
    size = scatteri_sub(g->box.max, g->box.min);
    rate = scatteri_max(scatteri_abs(d->axis_w.x) * (float)g->nx / size.x,
                        scatteri_max(scatteri_abs(d->axis_w.y) * (float)g->ny / size.y,
                                     scatteri_abs(d->axis_w.z) * (float)g->nz / size.z));
    samples = (int)(0.75f * rate * d->step_r) + 1;
    grids.gaussian_count = 0;
    for (s = 0; s < samples && b > a; s++) {
        const float t = a + ((float)s + 0.5f) * (b - a) / (float)samples;
        sum += (double)scatter_density(&grids, scatteri_along(from, d->axis_w, t));
    }
    return sum * (double)(b - a) / samples;
}

static void fill_parallel_column(scatter_depth *d, int i, int j) {
    scatter_medium smooth = d->medium->desc;
    scatter_vec3 from, to;
    float a = 0, b, before;
    double run = 0;
    int k, meets;
    column_ray(d, i, j, &from, &to, &b);
    meets = !smooth.bounded || scatteri_clip(smooth.bounds, from, to, &a, &b);
    smooth.grid_count = 0;
    before = a;
    for (k = 0; k < d->nz; k++) {
        const float t = scatteri_clamp((float)k * d->step_r, a, b);
        run += meets ? between_shells(d, from, before, t) : 0;
        before = t;
        d->values[scatteri_cell_index(d, i, j, k)] =
            !meets ? 0.0f
                   : (float)(run + (double)scatter_optical_depth(&smooth,
                                                                 scatteri_along(from, to, a),
                                                                 scatteri_along(from, to, t)));
    }
}

static void fill_columns(scatter_depth *d) {
    int i, j;
    if (!is_parallel(d)) {
        fill_single_columns(d);
        return;
    }
    for (j = 0; j < d->ny; j++)
        for (i = 0; i < d->nx; i++)
            fill_parallel_column(d, i, j);
}

static void lay_out_columns(scatter_depth *d, const scatter_quality *q) {
    const scatter_host host = scatteri_host_or_default(NULL);
    size_t bytes;
    scatteri_gl_shape(d, q->grid);
    scatteri_gl_parallel_columns(d);
    bytes = (size_t)d->nx * (size_t)d->ny * (size_t)d->nz * sizeof(float);
    assert_int_equal(scatteri_reserve(&host, &d->memory, bytes, "columns"), SCATTER_OK);
    d->values = (float *)d->memory.data;
}

/* Between the values of parallel columns. */
static double between_columns(const scatter_depth *d, scatter_vec3 x) {
    const scatter_vec3 o = scatteri_sub(x, d->box.min);
    const int n[3] = {d->nx, d->ny, d->nz};
    float g[3];
    double sum = 0;
    int at[3], axis, corner;
    g[0] = (scatteri_dot(o, d->axis_u) - d->low_u) / d->step_u;
    g[1] = (scatteri_dot(o, d->axis_v) - d->low_v) / d->step_v;
    g[2] = (scatteri_dot(o, d->axis_w) - d->low_r) / d->step_r;
    for (axis = 0; axis < 3; axis++) {
        g[axis] = scatteri_clamp(g[axis], 0.0f, (float)(n[axis] - 1));
        at[axis] = scatteri_clamp_int((int)g[axis], 0, n[axis] - 2);
    }
    for (corner = 0; corner < 8; corner++) {
        double weight = 1;
        for (axis = 0; axis < 3; axis++) {
            const double f = (double)(g[axis] - (float)at[axis]);
            weight *= corner >> axis & 1 ? f : 1 - f;
        }
        sum += weight * (double)d->values[scatteri_cell_index(d, at[0] + (corner & 1),
                                                              at[1] + (corner >> 1 & 1),
                                                              at[2] + (corner >> 2))];
    }
    return sum;
}

/* Depth of one source by scatter.h. */
static scatter_depth *depth_twin(const scatter_medium *m, scatter_source source,
                                 const scatter_quality *q) {
    scatter_depth *depth = NULL;
    assert_int_equal(scatter_depth_create(NULL, &depth), SCATTER_OK);
    assert_int_equal(scatter_depth_update(depth, m, &source, q), SCATTER_OK);
    if (is_parallel(depth))
        lay_out_columns(depth, q);
    if (is_parallel(depth) || (q->depth == SCATTER_DEPTH_POLAR && m->grid_count > 0))
        fill_columns(depth);
    return depth;
}

/* Distance of a value from its source; 1 if that is directional. */
static double distance_of(const scatter_depth *d, int i, int j, int k) {
    if (d->source.directional)
        return 1;
    if (d->method == SCATTER_DEPTH_POLAR)
        return (double)(d->low_r + (float)k * d->step_r);
    return check_distance(scatteri_cell(d, i, j, k), d->source.position);
}

/* Whether rounding decides if a column runs in a face of the bounds or beside it: from a source there, or parallel to an
   axis. */
static int grazes(const scatter_depth *twin, int i, int j) {
    const scatter_medium *m = &twin->medium->desc;
    const scatter_vec3 grain = check_v3(1e-5f, 1e-5f, 1e-5f);
    scatter_box small = m->bounds, large = m->bounds;
    float a0 = 0, a1, b0 = 0, b1;
    scatter_vec3 from, to;
    int a, b;
    if (!m->bounded || twin->method != SCATTER_DEPTH_POLAR)
        return 0;
    column_ray(twin, i, j, &from, &to, &a1);
    b1 = a1;
    small.min = scatteri_add(small.min, grain);
    small.max = scatteri_sub(small.max, grain);
    large.min = scatteri_sub(large.min, grain);
    large.max = scatteri_add(large.max, grain);
    a = scatteri_clip(small, from, to, &a0, &a1);
    b = scatteri_clip(large, from, to, &b0, &b1);
    return (b ? b1 - b0 : 0.0f) - (a ? a1 - a0 : 0.0f) > 0.01f;
}

/* Relative RMS error of a channel of a volume against a twin's values. */
static double channel_error(const scatteri_gl_texture *t, const float *values, int channel,
                            const scatter_depth *twin, fault what) {
    check_error e = check_no_error();
    int i, j, k, left_out = 0;
    for (k = 0; k < twin->nz; k++)
        for (j = 0; j < twin->ny; j++)
            for (i = 0; i < twin->nx; i++) {
                const size_t row = ((size_t)k * (size_t)t->height + (size_t)j) * (size_t)t->width;
                const double value = (double)values[4 * (row + (size_t)i) + (size_t)channel];
                double truth = value_of(twin->values, twin->nx, twin->ny, i, j, k, what);
                if (what == UNDIVIDED)
                    truth *= distance_of(twin, i, j, k);
                if (grazes(twin, i, j))
                    left_out++;
                else
                    check_add(&e, value, truth);
            }
    assert_true(left_out * 4 <= twin->nx * twin->ny * twin->nz); /* 0.16 at most here */
    return check_relative_rms(&e);
}

/* The worst of all sources of a fog, or the best where something is wrong. Sources for which that
   fault is none (a directional one is not divided) do not count. */
static double depth_error(gl_rig *rig, scatter_gl *fog, const scatter_medium *m,
                          const scatter_quality *q, fault what) {
    double worst = 0, best = 1e9;
    int batch, channel;
    for (batch = 0; batch < fog->batch_count; batch++) {
        const scatteri_gl_texture volume = scatteri_gl_volume_of(fog, batch);
        float *values = read_volume(rig, &volume);
        for (channel = 0; channel < 4; channel++) {
            const int next = what == NEXT ? channel + 1 : channel;
            const scatteri_gl_lamp *lamp =
                next < 4 ? scatteri_gl_source_in(fog, batch, next) : NULL;
            scatter_depth *twin;
            double error;
            if (lamp == NULL ||
                (what == UNDIVIDED && lamp->desc.light.kind == SCATTER_LIGHT_DIRECTIONAL))
                continue;
            twin = depth_twin(m, scatteri_source_of(&lamp->desc.light), q);
            error = channel_error(&volume, values, channel, twin, what);
            if (!(error <= worst))
                worst = error;
            best = error < best ? error : best;
            scatter_depth_destroy(twin);
        }
        free(values);
    }
    return what == RIGHT ? worst : best;
}

/* ----------------------------------------------------------------------- >>injection */

/* Largest error of the field over its largest value. */
static double field_error(gl_rig *rig, scatter_gl *fog, const scatter_medium *m, int n,
                          fault what) {
    scatter_box box;
    float *values = read_volume(rig, &fog->field), *twin = injected_twin(m, n, &box);
    double most = 0, worst = 0;
    int i, j, k;
    assert_int_equal(fog->field.width, n);
    for (k = 0; k < n; k++)
        for (j = 0; j < n; j++)
            for (i = 0; i < n; i++) {
                const double truth = value_of(twin, n, n, i, j, k, what);
                const double miss = fabs((double)values[4 * ((k * n + j) * n + i)] - truth);
                most = fmax(most, truth);
                if (!(miss <= worst))
                    worst = miss;
            }
    free(values);
    free(twin);
    return worst / most;
}

/* Both ways to inject Gaussians. */
static void inject(gl_rig *rig, const check_world *w, int half_float, double limit) {
    scatter_gl *fog = open_fog(rig, half_float);
    const scatter_quality q = quality_of(SCATTER_DEPTH_POLAR, SCATTER_DENSITY_VOLUME, CELLS);
    int quads, what;
    fill_fog(fog, w, &q, NULL);
    for (quads = 0; quads < 2; quads++) {
        scatteri_gl_state state;
        double worst;
        scatteri_gl_save(fog, &state);
        assert_int_equal(scatteri_gl_inject_by(fog, quads), SCATTER_OK);
        scatteri_gl_restore(fog, &state);
        worst = field_error(rig, fog, &w->scene.medium, CELLS, RIGHT);
        printf("  %s: off by %.1e of the largest\n", quads ? "quads" : "gathered", worst);
        assert_at_most(worst, limit);
        for (what = SHIFTED; what <= MIRRORED; what++)
            assert_at_least(field_error(rig, fog, &w->scene.medium, CELLS, (fault)what),
                            10 * limit);
    }
    scatter_gl_destroy(fog);
}

static void open_mixture(check_world *w) {
    open_cloud(w, 0);
    add_smooth_grid(w, 9, check_cube(0.1f, 0.8f));
    add_smooth_grid(w, 7, check_cube(0.3f, 1.1f));
}

static void test_injection(gl_rig *rig) {
    check_world w;
    open_mixture(&w);
    inject(rig, &w, 0, 1e-5);
    open_cloud(&w, 1);
    inject(rig, &w, 0, 1e-5);
}

/* 16 bits: each of the 2 grids and 16 Gaussians that are added to a cell may cut off up to 2^-10 of
   the sum, on average half of that, and so may the grids' voxels. */
static void test_half_injection(gl_rig *rig) {
    check_world w;
    open_mixture(&w);
    inject(rig, &w, 1, (2 + 16 + 1) * ldexp(1, -11));
}

/* --------------------------------------------------------------------------- >>depth */

typedef struct depth_case {
    const char *name;
    scatter_depth_method method;
    int grids;
    int roundings; /* of values that are held in 16 bits, on their way to the depth */
} depth_case;

static const depth_case depth_cases[] = {{"closed volume", SCATTER_DEPTH_CLOSED_VOLUME, 0, 1},
                                         {"upwind", SCATTER_DEPTH_UPWIND, 0, 17},
                                         {"upwind through a grid", SCATTER_DEPTH_UPWIND, 1, 19},
                                         {"polar", SCATTER_DEPTH_POLAR, 0, 1},
                                         {"polar through a grid", SCATTER_DEPTH_POLAR, 1, 2}};

/* Lights from..to of the list, in a medium that is bounded or not. Some get the planted faults. */
static double run_depth(gl_rig *rig, const depth_case *c, int bounded, int from, int to,
                        const scatter_vec3 *eye, int half_float, double limit) {
    const scatter_quality q = quality_of(c->method, SCATTER_DENSITY_EXACT, CELLS);
    scatter_gl *fog = open_fog(rig, half_float);
    double worst;
    check_world w;
    int what;
    open_cloud(&w, bounded);
    if (c->grids)
        add_smooth_grid(&w, 9, check_cube(0.1f, 0.8f));
    if (to == 8) /* thick enough for the form that keeps its digits in the tails */
        thicken(&w, 500.0f);
    if (eye) /* the least that OpenGL ES has */
        fog->draw_buffers = 4;
    add_lights(&w, from, to);
    fill_fog(fog, &w, &q, eye);
    worst = depth_error(rig, fog, &w.scene.medium, &q, RIGHT);
    assert_at_most(worst, limit);
    for (what = SHIFTED; what < FAULTS && from == 0 && !half_float; what++)
        if (!check_at_least(fault_names[what],
                            depth_error(rig, fog, &w.scene.medium, &q, (fault)what), 10 * limit))
            fail();
    scatter_gl_destroy(fog);
    return worst;
}

static void test_depth_of(gl_rig *rig, const depth_case *c) {
    const scatter_vec3 eye = check_v3(0.7f, 0.2f, -0.4f);
    double worst = 0;
    int bounded;
    for (bounded = 0; bounded < 2; bounded++) {
        worst = fmax(worst, run_depth(rig, c, bounded, 0, 4, NULL, 0, 1e-4));
        worst = fmax(worst, run_depth(rig, c, bounded, 3, 8, NULL, 0, 1e-4));
        worst = fmax(worst, run_depth(rig, c, bounded, 1, 5, &eye, 0, 1e-4));
    }
    printf("  %s: relative RMS error %.1e\n", c->name, worst);
}

static void test_closed(gl_rig *rig) { test_depth_of(rig, &depth_cases[0]); }

static void test_upwind(gl_rig *rig) {
    test_depth_of(rig, &depth_cases[1]);
    test_depth_of(rig, &depth_cases[2]);
}

/* Sums of Gaussians against their integrals in double precision: scatter.h sums at even steps where
   these are small, within 3e-4 of c/a; the GPU has erfs within 6e-7 of a whole Gaussian,
   up to 16 of them on a line. */
static double column_error(const scatteri_gl_texture *t, const float *values, int channel,
                           const scatter_depth *twin) {
    const double start = twin->source.directional ? 0 : (double)twin->low_r;
    check_error e = check_no_error();
    int i, j, k;
    for (k = 1; k < twin->nz; k++)
        for (j = 0; j < twin->ny; j += 3)
            for (i = 0; i < twin->nx; i += 3) {
                const size_t at = ((size_t)k * (size_t)t->height + (size_t)j) * (size_t)t->width;
                const double along = (double)k * (double)twin->step_r;
                scatter_vec3 from, way, to;
                float length;
                column_ray(twin, i, j, &from, &way, &length);
                to = scatteri_along(from, way, (float)(start + along));
                check_add(&e,
                          (double)values[4 * (at + (size_t)i) + (size_t)channel] *
                              (twin->source.directional ? 1 : start + along),
                          (double)scatter_optical_depth(&twin->medium->desc, from, to));
            }
    return check_relative_rms(&e);
}

static void test_columns(gl_rig *rig) {
    const scatter_quality q = quality_of(SCATTER_DEPTH_POLAR, SCATTER_DENSITY_EXACT, CELLS);
    scatter_gl *fog = open_fog(rig, 0);
    double worst = 0;
    check_world w;
    float *values;
    int i;
    open_cloud(&w, 0);
    add_lights(&w, 0, 4);
    fill_fog(fog, &w, &q, NULL);
    values = read_volume(rig, &fog->volumes[0]);
    for (i = 0; i < 4; i++) {
        scatter_depth *twin = depth_twin(&w.scene.medium, scatteri_source_of(&w.lights[i]), &q);
        worst = fmax(worst, column_error(&fog->volumes[0], values, i, twin));
        scatter_depth_destroy(twin);
    }
    printf("  columns against integrals: relative RMS error %.1e\n", worst);
    assert_at_most(worst, 1e-5);
    free(values);
    scatter_gl_destroy(fog);
}

static void test_polar(gl_rig *rig) {
    test_depth_of(rig, &depth_cases[3]);
    test_depth_of(rig, &depth_cases[4]);
}

/* 16 bits hold each value within 2^-10 of itself (a driver may cut off instead of rounding): depth,
   voxels, and with quads each of 16 sums of Gaussians. */
static void test_half_depth(gl_rig *rig) {
    size_t i;
    for (i = 0; i < CHECK_COUNT(depth_cases); i++) {
        const depth_case *c = &depth_cases[i];
        printf("  %s: relative RMS error %.1e\n", c->name,
               run_depth(rig, c, 0, 0, 4, NULL, 1, 1e-4 + c->roundings * ldexp(1, -10)));
    }
}

/* Density from a volume: columns are those of a medium that is one grid, the injected one. */
static double volume_column_error(const scatteri_gl_texture *t, const float *values, int channel,
                                  const check_world *w, const scatter_grid *grid,
                                  const scatter_quality *q) {
    const scatter_host host = scatteri_host_or_default(NULL);
    scatter_depth *twin = depth_twin(&w->scene.medium, scatteri_source_of(&w->lights[channel]), q);
    scatter_medium desc = w->scene.medium;
    scatteri_medium medium;
    double error;
    desc.gaussian_count = 0;
    desc.grids = grid;
    desc.grid_count = 1;
    memset(&medium, 0, sizeof medium);
    assert_int_equal(scatteri_prepare(&host, &medium, &desc), SCATTER_OK);
    twin->medium = &medium;
    fill_columns(twin);
    error = channel_error(t, values, channel, twin, RIGHT);
    twin->medium = &twin->own;
    scatter_depth_destroy(twin);
    scatteri_drop_medium(&host, &medium);
    return error;
}

static void test_polar_volume(gl_rig *rig) {
    const scatter_quality q = quality_of(SCATTER_DEPTH_POLAR, SCATTER_DENSITY_VOLUME, CELLS);
    scatter_gl *fog = open_fog(rig, 0);
    scatter_grid grid;
    check_world w;
    float *density, *values;
    double worst = 0;
    int i;
    open_mixture(&w); /* two grids: one would be read itself */
    add_lights(&w, 0, 4);
    fill_fog(fog, &w, &q, NULL);
    memset(&grid, 0, sizeof grid);
    density = injected_twin(&w.scene.medium, CELLS, &grid.box);
    grid.density = density;
    grid.nx = grid.ny = grid.nz = CELLS;
    values = read_volume(rig, &fog->volumes[0]);
    for (i = 0; i < 4; i++)
        worst = fmax(worst, volume_column_error(&fog->volumes[0], values, i, &w, &grid, &q));
    printf("  polar from a volume: relative RMS error %.1e\n", worst);
    assert_at_most(worst, 1e-4);
    free(values);
    free(density);
    scatter_gl_destroy(fog);
}

/* ------------------------------------------------------------------------- >>reading */

enum { PICTURE = 64 }; /* points to a side */

/* Point i, in and around the unit cube: the same floats here and in GLSL. */
static scatter_vec3 point_of(int i) {
    const float x = (float)i * 0.81917251f, y = (float)i * 0.67104361f, z = (float)i * 0.54970047f;
    return check_v3(2.0f * (x - floorf(x)) - 0.5f, 2.0f * (y - floorf(y)) - 0.5f,
                    2.0f * (z - floorf(z)) - 0.5f);
}

static const char reading[] =
    "out vec4 depth;\n"
    "uniform vec4 ref;\n"
    "void main() {\n"
    "    float i = floor(gl_FragCoord.y) * 64.0 + floor(gl_FragCoord.x);\n"
    "    vec3 p = i * vec3(0.81917251, 0.67104361, 0.54970047);\n"
    "    vec3 x = 2.0 * (p - floor(p)) - 0.5 - ref.xyz;\n"
    "    for (int l = 0; l < 4; l++) {\n"
    "        vec4 to = scatteri_face(l, x);\n"
    "        float segment = scatteri_segment_to(x, to.xyz, to.w);\n"
    "        depth[l] = scatteri_read_here(l, x, to.xyz, to.w, segment);\n"
    "    }\n"
    "}\n";

static const char read_stored[] =
    "float scatteri_read_here(int l, vec3 x, vec3 to, float distance, float segment) {\n"
    "    return scatteri_volume_depth(l, x, to, distance, segment);\n"
    "}\n";

static const char read_closed[] =
    "float scatteri_read_here(int l, vec3 x, vec3 to, float distance, float segment) {\n"
    "    float depth = scatteri_closed_depth(x, to, segment);\n"
    "#ifdef SCATTERI_FOG\n"
    "    depth += scatteri_fog_depth(x, to, segment);\n"
    "#endif\n"
    "    return depth;\n"
    "}\n";

/* A program of the library's chapters and a main of ours. */
static unsigned reading_program(scatter_gl *fog, scatteri_gl_features features, const char *what) {
    static const char chapters[] =
        "prelude vector erf span quick integrals maps blocks table gaussians density "
        "one_volume volume facing";
    scatteri_gl_source source;
    scatteri_gl_key key;
    unsigned vertex, fragment, program;
    int linked = 0;
    memset(&key, 0, sizeof key);
    key.features = features;
    key.slices = 1;
    scatteri_gl_assemble(scatteri_gl_version_text(fog), key, chapters, &source);
    source.parts[source.count++] = what;
    source.parts[source.count++] = reading;
    fragment = scatteri_gl_compile(fog, SCATTERI_GL_FRAGMENT, "reading", &source);
    scatteri_gl_assemble(scatteri_gl_version_text(fog), key, "prelude whole", &source);
    vertex = scatteri_gl_compile(fog, SCATTERI_GL_VERTEX, "reading", &source);
    program = fog->gl.CreateProgram();
    fog->gl.AttachShader(program, vertex);
    fog->gl.AttachShader(program, fragment);
    fog->gl.LinkProgram(program);
    fog->gl.GetProgramiv(program, SCATTERI_GL_LINKED, &linked);
    assert_true(linked && fragment != 0 && vertex != 0);
    fog->gl.DeleteShader(vertex);
    fog->gl.DeleteShader(fragment);
    scatteri_gl_set_inputs(fog, program);
    fog->gl.UseProgram(0);
    return program;
}

/* Depth of four sources at all points, by what the view reads. */
static float *read_points(gl_rig *rig, scatter_gl *fog, const char *what) {
    const scatteri_gl_features features = scatteri_gl_medium_features(fog);
    const unsigned program = reading_program(fog, features, what);
    const gl_functions *gl = &rig->host.gl;
    scatteri_gl_texture picture;
    scatteri_gl_layer layer;
    scatteri_gl_state state;
    float *values;
    scatteri_gl_save(fog, &state);
    memset(&picture, 0, sizeof picture);
    /* two layers, so that it is read back like a volume */
    assert_int_equal(
        scatteri_gl_size_texture(fog, &picture, SCATTERI_GL_RGBA32F, PICTURE, PICTURE, 2),
        SCATTER_OK);
    layer.texture = &picture;
    layer.layer = 0;
    assert_int_equal(scatteri_gl_target(fog, &layer, 1), SCATTER_OK);
    fog->gl.UseProgram(program);
    gl->Uniform4f(gl->GetUniformLocation(program, "ref"), fog->ref.x, fog->ref.y, fog->ref.z, 0.0f);
    fog->gl.BindBufferBase(SCATTERI_GL_UNIFORM_BUFFER, 1, fog->light_buffers[0]);
    scatteri_gl_read_texels(fog, SCATTERI_GL_UNIT_GAUSSIANS, &fog->gaussians);
    scatteri_gl_read_smooth(fog, SCATTERI_GL_UNIT_VOLUME, &fog->volumes[0]);
    fog->gl.DrawArrays(SCATTERI_GL_TRIANGLES, 0, 3);
    scatteri_gl_restore(fog, &state);
    values = read_volume(rig, &picture);
    scatteri_gl_drop_texture(fog, &picture);
    fog->gl.DeleteProgram(program);
    return values;
}

/* Relative RMS error at points inside the bounds, if there are some. */
static double reading_error(gl_rig *rig, scatter_gl *fog, const check_world *w,
                            const scatter_quality *q, const char *what) {
    const scatter_medium *m = &w->scene.medium;
    float *values = read_points(rig, fog, what);
    double worst = 0;
    int l, i;
    for (l = 0; l < 4; l++) {
        scatter_depth *twin = depth_twin(m, scatteri_source_of(&w->lights[l]), q);
        check_error e = check_no_error();
        for (i = 0; i < PICTURE * PICTURE; i++) {
            const scatter_vec3 x = point_of(i);
            if (!m->bounded || scatteri_inside(m->bounds, x))
                check_add(&e, (double)values[4 * i + l], is_parallel(twin) ? between_columns(twin, x)
                                            : (double)scatter_depth_at(twin, x));
        }
        if (!(check_relative_rms(&e) <= worst))
            worst = check_relative_rms(&e);
        scatter_depth_destroy(twin);
    }
    free(values);
    return worst;
}

/* What the view reads, between the cells and outside of them. */
static void test_reading(gl_rig *rig) {
    static const scatter_depth_method methods[] = {SCATTER_DEPTH_CLOSED,
                                                   SCATTER_DEPTH_CLOSED_VOLUME,
                                                   SCATTER_DEPTH_UPWIND, SCATTER_DEPTH_POLAR};
    size_t i;
    int bounded;
    for (i = 0; i < CHECK_COUNT(methods); i++)
        for (bounded = 0; bounded < 2; bounded++) {
            const int closed = methods[i] == SCATTER_DEPTH_CLOSED;
            const scatter_quality q = quality_of(methods[i], SCATTER_DENSITY_EXACT, CELLS);
            scatter_gl *fog = open_fog(rig, 0);
            check_world w;
            double error;
            open_cloud(&w, bounded);
            if (closed) {
                w.scene.medium.constant = 0.1f;
                check_add_height(&w, 0.5f, 0.2f, 0.3f);
            }
            add_lights(&w, 0, 4);
            fill_fog(fog, &w, &q, NULL);
            error = reading_error(rig, fog, &w, &q, closed ? read_closed : read_stored);
            printf("  method %d, %s: relative RMS error %.1e\n", (int)methods[i],
                   bounded ? "bounded" : "unbounded", error);
            assert_at_most(error, 1e-4);
            scatter_gl_destroy(fog);
        }
}

/* ------------------------------------------------------------------------------ >>tone */

/* A picture and where it is drawn to. */
typedef struct toned {
    gl_rig *rig;
    scatter_gl *fog;
    GLuint source, target, framebuffer;
    int width, height;
    float *rgba, *rgb, *out, *twin; /* out: RGBA, as drawn; twin: RGB by scatter.h */
} toned;

static GLuint float_texture(const gl_functions *gl, int width, int height, const float *rgba) {
    GLuint name;
    gl->GenTextures(1, &name);
    gl->BindTexture(GL_TEXTURE_2D, name);
    gl->TexImage2D(GL_TEXTURE_2D, 0, GL_RGBA32F, width, height, 0, GL_RGBA, GL_FLOAT, rgba);
    gl->BindTexture(GL_TEXTURE_2D, 0);
    return name;
}

/* Luminances evenly spread over the decades 1e-6..1e6, every 16th pixel black. */
static void open_toned(toned *t, gl_rig *rig, scatter_gl *fog, int width, int height) {
    const gl_functions *gl = &rig->host.gl;
    const size_t count = (size_t)width * (size_t)height;
    uint64_t seed = 7;
    size_t i;
    memset(t, 0, sizeof *t);
    t->rig = rig;
    t->fog = fog;
    t->width = width;
    t->height = height;
    t->rgba = (float *)malloc(14 * count * sizeof(float));
    assert_true(t->rgba != NULL);
    t->out = t->rgba + 4 * count;
    t->rgb = t->out + 4 * count;
    t->twin = t->rgb + 3 * count;
    for (i = 0; i < 4 * count; i++)
        t->rgba[i] = i / 4 % 16 == 3 ? 0.0f : powf(10.0f, check_uniform(&seed, -6, 6));
    t->target = float_texture(gl, width, height, NULL);
    gl->GenFramebuffers(1, &t->framebuffer);
    gl->BindFramebuffer(GL_FRAMEBUFFER, t->framebuffer);
    gl->FramebufferTexture2D(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_TEXTURE_2D, t->target, 0);
}

static void close_toned(toned *t) {
    const gl_functions *gl = &t->rig->host.gl;
    assert_int_equal(gl->GetError(), GL_NO_ERROR);
    gl->DeleteTextures(1, &t->source);
    gl->DeleteTextures(1, &t->target);
    gl->DeleteFramebuffers(1, &t->framebuffer);
    free(t->rgba);
}

/* The picture by the GPU, and by scatter.h into t->twin. */
static void tone_map(toned *t, const scatter_tone *tone, int linear) {
    const gl_functions *gl = &t->rig->host.gl;
    const size_t count = (size_t)t->width * (size_t)t->height;
    scatter_gl_tone desc;
    size_t i;
    gl->DeleteTextures(1, &t->source);
    t->source = float_texture(gl, t->width, t->height, t->rgba);
    memset(&desc, 0, sizeof desc);
    desc.tone = *tone;
    desc.source = t->source;
    desc.framebuffer = t->framebuffer;
    desc.width = t->width;
    desc.height = t->height;
    desc.linear = linear;
    assert_int_equal(scatter_gl_tone_map(t->fog, &desc), SCATTER_OK);
    gl->BindFramebuffer(GL_FRAMEBUFFER, t->framebuffer);
    gl->ReadBuffer(GL_COLOR_ATTACHMENT0);
    gl->ReadPixels(0, 0, t->width, t->height, GL_RGBA, GL_FLOAT, t->out);
    for (i = 0; i < 3 * count; i++)
        t->rgb[i] = t->rgba[i / 3 * 4 + i % 3];
    scatter_tone_map(tone, t->rgb, count, t->twin);
}

/* Largest relative difference of the two; NaN must meet NaN. */
static double tone_difference(const toned *t) {
    const size_t count = 3 * (size_t)t->width * (size_t)t->height;
    double worst = 0;
    size_t i;
    for (i = 0; i < count; i++) {
        const double a = (double)t->out[i / 3 * 4 + i % 3], b = (double)t->twin[i];
        if (isnan(a) != isnan(b))
            return INFINITY;
        if (a != b && !isnan(a))
            worst = fmax(worst, fabs(a - b) / fabs(b));
    }
    return worst;
}

/* Of the tone mapped values: each level of blocks adds 7 + 7 times, each addition rounds the sum so far by 2^-24 at most;
   GLSL's log errs by 2^-21 or 3 2^-24 of itself, exp by (3 + 2|x|) 2^-24. A relative error of the average becomes up to
   twice itself by the burn-out term; 16 roundings of what follows. */
static double tone_tolerance(const toned *t) {
    double size = t->width > t->height ? t->width : t->height, levels = 1, mean = 0;
    const size_t count = (size_t)t->width * (size_t)t->height;
    const double grain = ldexp(1, -24);
    size_t i, bright = 0;
    for (; size > 8; size /= 8)
        levels++;
    for (i = 0; i < count; i++) {
        const float *c = t->rgba + 4 * i;
        const double l = 0.2126 * (double)c[0] + 0.7152 * (double)c[1] + 0.0722 * (double)c[2];
        if (l > 0 && l <= 3e38) {
            mean += fabs(log(l));
            bright++;
        }
    }
    mean = bright ? mean / (double)bright : 0;
    return 2 * ((14 * levels + 5) * mean * grain + 11 * grain) + 16 * grain;
}

static void test_tone(gl_rig *rig) {
    static const int sizes[][2] = {{1, 1},  {1, 300},  {300, 1},   {7, 9},    {8, 8},
                                   {9, 64}, {65, 513}, {257, 131}, {640, 363}};
    static const scatter_tone tones[] = {{0, 0, 0}, {0.36f, 2.0f, 0}, {0.18f, 0, 3.0f}};
    scatter_gl *fog = open_fog(rig, 0);
    size_t i, k;
    for (i = 0; i < CHECK_COUNT(sizes); i++) {
        toned t;
        open_toned(&t, rig, fog, sizes[i][0], sizes[i][1]);
        for (k = 0; k < CHECK_COUNT(tones); k++) {
            char what[64];
            snprintf(what, sizeof what, "%d x %d, tone %d", t.width, t.height, (int)k);
            tone_map(&t, &tones[k], 1);
            if (!check_at_most(what, tone_difference(&t), tone_tolerance(&t)))
                fail();
        }
        assert_true(t.out[3] == t.rgba[3]); /* alpha stays */
        close_toned(&t);
    }
    scatter_gl_destroy(fog);
}

/* Planted: averages that leave out an odd last row, or count black pixels, are farther away than rounding. */
static void test_tone_faults(gl_rig *rig) {
    scatter_gl *fog = open_fog(rig, 0);
    scatter_tone tone = {0, 0, 0};
    size_t i, count, bright = 0;
    float all, some;
    toned t;
    open_toned(&t, rig, fog, 256, 9);
    count = (size_t)t.width * (size_t)t.height;
    tone_map(&t, &tone, 1);
    all = scatter_log_average(t.rgb, count);
    some = scatter_log_average(t.rgb, count / 9 * 8);
    for (i = 0; i < count; i++)
        bright += t.rgb[3 * i] > 0.0f;
    tone.log_average = some;
    scatter_tone_map(&tone, t.rgb, count, t.twin);
    assert_at_least(tone_difference(&t), 10 * tone_tolerance(&t));
    tone.log_average = powf(all, (float)bright / (float)count);
    scatter_tone_map(&tone, t.rgb, count, t.twin);
    assert_at_least(tone_difference(&t), 10 * tone_tolerance(&t));
    tone.log_average = all;
    scatter_tone_map(&tone, t.rgb, count, t.twin);
    assert_at_most(tone_difference(&t), tone_tolerance(&t));
    close_toned(&t);
    scatter_gl_destroy(fog);
}

/* Pixels that are no numbers, infinite, negative or black count as little as on the CPU, and come out the same. */
static void test_tone_odd_pixels(gl_rig *rig) {
    static const float odd[] = {NAN, INFINITY, -INFINITY, -3.0f, 0.0f, 1e30f};
    const scatter_tone tone = {0, 0, 0};
    scatter_gl *fog = open_fog(rig, 0);
    toned t;
    size_t i, bright = 0, none = 0;
    open_toned(&t, rig, fog, 37, 11);
    for (i = 0; i < 4 * 37 * 11; i++)
        if (i % 5 == 0)
            t.rgba[i] = odd[i / 5 % CHECK_COUNT(odd)];
    tone_map(&t, &tone, 1);
    for (i = 0; i < 4 * 37 * 11; i++) {
        bright += t.out[i] > 0.0f;
        none += isnan(t.out[i]) ? 1 : 0;
    }
    assert_true(bright > 400 && none > 100); /* planted: there are both */
    assert_at_most(tone_difference(&t), tone_tolerance(&t));
    for (i = 0; i < 4 * 37 * 11; i++)
        t.rgba[i] = i % 2 ? 0.0f : -1.0f;
    tone_map(&t, &tone, 1);
    for (i = 0; i < 4 * 37 * 11; i++)
        assert_true(i % 4 == 3 || t.out[i] == 0.0f);
    close_toned(&t);
    scatter_gl_destroy(fog);
}

/* Bytes of a screen are those of scatter_srgb8, but where the difference of tone_tolerance rounds the other way: a value's
   slope there is at most 255 * 12.92, and its size 1. */
static void test_tone_srgb(gl_rig *rig) {
    const scatter_tone tone = {0.18f, 4.0f, 0};
    scatter_gl *fog = open_fog(rig, 0);
    const double grain = ldexp(1, -24);
    double worst = 0, apart = 0;
    toned t;
    size_t i;
    open_toned(&t, rig, fog, 64, 33);
    t.rgba[5] = NAN;
    t.rgba[9] = INFINITY;
    tone_map(&t, &tone, 0);
    for (i = 0; i < 3 * 64 * 33; i++) {
        const double v = fmin(fmax((double)t.twin[i], 0), 1); /* NaN: 0 */
        const double s = v <= 0.0031308 ? 12.92 * v : 1.055 * pow(v, 1 / 2.4) - 0.055;
        worst = fmax(worst, fabs((double)t.out[i / 3 * 4 + i % 3] - s));
        apart = fmax(apart, fabs((double)t.out[i / 3 * 4 + i % 3] - v));
    }
    assert_at_most(worst, 12.92 * (tone_tolerance(&t) + 32 * grain)); /* pow is exp2 of log2 */
    assert_at_least(apart, 0.1); /* planted: linear values are others */
    close_toned(&t);
    scatter_gl_destroy(fog);
}

/* A part of a texture into a part of a framebuffer; the rest of it stays. */
static void test_tone_window(gl_rig *rig) {
    const gl_functions *gl = &rig->host.gl;
    scatter_gl *fog = open_fog(rig, 0);
    const scatter_tone tone = {0, 0, 1.0f};
    scatter_gl_tone desc;
    toned t;
    int x, y;
    open_toned(&t, rig, fog, 40, 30);
    tone_map(&t, &tone, 1); /* the twin of every pixel */
    gl->ClearColor(-1, -1, -1, -1);
    gl->Clear(GL_COLOR_BUFFER_BIT);
    memset(&desc, 0, sizeof desc);
    desc.tone = tone;
    desc.source = t.source;
    desc.framebuffer = t.framebuffer;
    desc.source_x = 9, desc.source_y = 3, desc.x = 2, desc.y = 5;
    desc.width = 20, desc.height = 10;
    desc.linear = 1;
    assert_int_equal(scatter_gl_tone_map(fog, &desc), SCATTER_OK);
    gl->ReadPixels(0, 0, 40, 30, GL_RGBA, GL_FLOAT, t.out);
    for (y = 0; y < 30; y++)
        for (x = 0; x < 40; x++) {
            const float value = t.out[4 * (y * 40 + x)];
            const int inside = x >= 2 && x < 22 && y >= 5 && y < 15;
            const float twin = inside ? t.twin[3 * ((y - 2) * 40 + x + 7)] : -1.0f;
            assert_at_most(fabs((double)(value - twin)), 1e-6 * fabs((double)twin));
        }
    close_toned(&t);
    scatter_gl_destroy(fog);
}

/* -------------------------------------------------------------------- >>distance */

enum { NEAR_X = 43, NEAR_Y = 5, NEAR_Z = 5, REACH = 32 };

/* Few voxels hold something: one of `rarity`. */
static void open_rare_voxels(check_world *w, scatter_box box, int rarity, uint64_t seed) {
    int i;
    check_world_open(w);
    check_add_grid(w, NEAR_X, NEAR_Y, NEAR_Z, box, 1);
    for (i = 0; i < NEAR_X * NEAR_Y * NEAR_Z; i++)
        w->voxels[0][i] = check_uniform(&seed, 0, 1) * (float)rarity < 1 ? 1.5f : 0.0f;
}

/* What is wrong with the truth on purpose. */
typedef enum near_fault { NEAR_RIGHT, NEAR_NARROW, NEAR_FAR, NEAR_FAULTS } near_fault;

/* Distance, metres, from x (in voxels, 0 at the centre of the first) to the nearest box between the neighbours of a voxel
   that holds something. NEAR_NARROW: to the voxel's centre, one voxel too far. */
static double true_distance(const check_world *w, const scatter_vec3 edge, const double *x, near_fault what) {
    double least = 1e30;
    int i, j, k, a;
    for (k = 0; k < NEAR_Z; k++)
        for (j = 0; j < NEAR_Y; j++)
            for (i = 0; i < NEAR_X; i++) {
                const double at[3] = {i, j, k};
                double sum = 0;
                for (a = 0; a < 3; a++) {
                    const double off = fabs(x[a] - at[a]) - (what == NEAR_NARROW ? 0.0 : 1.0);
                    const double h = (double)scatteri_get(edge, a);
                    sum += off > 0 ? off * off * h * h : 0;
                }
                if (w->voxels[0][(k * NEAR_Y + j) * NEAR_X + i] > 0.0f && sum < least)
                    least = sum;
            }
    return sqrt(least);
}

/* What the map must hold there, metres, up to 32 voxels; NEAR_FAR: without what keeps it below the distance between voxels. */
static double true_room(const check_world *w, scatter_vec3 edge, int i, int j, int k, near_fault what) {
    const double longest = fmax((double)edge.x, fmax((double)edge.y, (double)edge.z));
    const double x[3] = {i, j, k}, d = fmin(true_distance(w, edge, x, what), REACH * longest);
    const double off = what == NEAR_FAR ? 0.0 : 0.25 * (double)scatteri_dot(edge, edge);
    return sqrt(fmax(d * d - off, 0));
}

static scatter_vec3 edges_of(const scatter_box *b) {
    const scatter_vec3 size = scatteri_sub(b->max, b->min);
    return check_v3(size.x / NEAR_X, size.y / NEAR_Y, size.z / NEAR_Z);
}

/* Largest errors of the map, below and above the truth, over the longest edge. */
static void distance_errors(const check_world *w, const scatteri_gl_texture *t, const float *values,
                            near_fault what, double *below, double *above) {
    const scatter_vec3 edge = edges_of(&w->grids[0].box);
    const double unit = fmax((double)edge.x, fmax((double)edge.y, (double)edge.z));
    int i, j, k;
    *below = *above = 0;
    for (k = 0; k < t->depth; k++)
        for (j = 0; j < t->height; j++)
            for (i = 0; i < t->width; i++) {
                const float *texel = values + 4 * ((k * t->height + j) * t->width + i);
                const double truth = true_room(w, edge, i, j, k, what) / unit;
                const double miss = (double)texel[1] - truth;
                assert_true(texel[0] == w->voxels[0][(k * NEAR_Y + j) * NEAR_X + i]);
                *below = fmax(*below, -miss / fmax(truth, 1.0));
                *above = fmax(*above, miss / fmax(truth, 1.0));
            }
}

/* The map between its values, metres, as texture units read it. */
static double read_between(const scatteri_gl_texture *t, const float *values, const double *x, double unit) {
    const int size[3] = {t->width, t->height, t->depth};
    double sum = 0;
    int corner, a;
    for (corner = 0; corner < 8; corner++) {
        int at[3];
        double weight = 1;
        for (a = 0; a < 3; a++) {
            const double g = fmin(fmax(x[a], 0.0), size[a] - 1.0);
            const int low = g < size[a] - 1.0 ? (int)g : size[a] - 1, side = corner >> a & 1;
            at[a] = low + side < size[a] ? low + side : low;
            weight *= side ? g - low : 1 - (g - low);
        }
        sum += weight * (double)values[4 * ((at[2] * size[1] + at[1]) * size[0] + at[0]) + 1];
    }
    return sum * unit;
}

/* How far the map, read anywhere in the box, lies above the distance there at most, over the longest edge. */
static double most_above(const check_world *w, const scatteri_gl_texture *t, const float *values) {
    const scatter_vec3 edge = edges_of(&w->grids[0].box);
    const double unit = fmax((double)edge.x, fmax((double)edge.y, (double)edge.z));
    double worst = -1e30;
    uint64_t seed = 7;
    int n;
    for (n = 0; n < 4000; n++) {
        const double x[3] = {(double)check_uniform(&seed, -0.5f, NEAR_X - 0.5f),
                             (double)check_uniform(&seed, -0.5f, NEAR_Y - 0.5f),
                             (double)check_uniform(&seed, -0.5f, NEAR_Z - 0.5f)};
        const double miss = read_between(t, values, x, unit) - true_distance(w, edge, x, NEAR_RIGHT);
        worst = fmax(worst, miss / unit);
    }
    return worst;
}

/* The map of a world's first grid, as RGBA texels. */
static float *distance_of_grid(gl_rig *rig, scatter_gl *fog, const check_world *w) {
    scatter_quality q = quality_of(SCATTER_DEPTH_CLOSED, SCATTER_DENSITY_EXACT, 0);
    fill_fog(fog, w, &q, NULL);
    return read_volume(rig, &fog->spaced);
}

/* The map against a search over all voxels: voxels that are cubes, flat, long; 32 bits, whose errors are those of a sum,
   a root and a quotient, and 16 bits, rounded down: 2^-9 below at most. */
static void test_distance(gl_rig *rig) {
    static const scatter_box boxes[] = {{{0, 0, 0}, {43, 5, 5}}, {{-1, 2, 0}, {0.7f, 2.2f, 5}}, {{3, 0, 1}, {903, 9, 2}}};
    int half, rarity, i;
    for (half = 0; half < 2; half++) {
        scatter_gl *fog = open_fog(rig, half);
        for (i = 0; i < 9; i++) {
            double below, above;
            check_world w;
            float *values;
            rarity = i / 3 == 0 ? 20 : i / 3 == 1 ? 200 : 100000;
            open_rare_voxels(&w, boxes[i % 3], rarity, (uint64_t)i + 1);
            w.grids[0].version = (unsigned)i;
            values = distance_of_grid(rig, fog, &w);
            distance_errors(&w, &fog->spaced, values, NEAR_RIGHT, &below, &above);
            assert_at_most(above, half ? 0.0 : 1e-6);
            assert_at_most(below, half ? 0x1p-9 : 1e-6);
            assert_at_most(most_above(&w, &fog->spaced, values), half ? 0.0 : 1e-6);
            free(values);
        }
        assert_int_equal(scatter_gl_get_stats(fog).distance_maps, 9);
        scatter_gl_destroy(fog);
    }
}

/* Planted: distances to voxels rather than to what they reach, and such as are right at voxels but not between them. */
static void test_wrong_distance(gl_rig *rig) {
    const scatter_box box = {{0, 0, 0}, {43, 5, 5}};
    const scatter_vec3 edge = {1, 1, 1};
    scatter_gl *fog = open_fog(rig, 0);
    double below, above;
    check_world w;
    float *values;
    int i;
    open_rare_voxels(&w, box, 200, 3);
    values = distance_of_grid(rig, fog, &w);
    distance_errors(&w, &fog->spaced, values, NEAR_NARROW, &below, &above);
    assert_at_least(below, 0.1);
    distance_errors(&w, &fog->spaced, values, NEAR_FAR, &below, &above);
    assert_at_least(below, 0.1);
    for (i = 0; i < NEAR_X * NEAR_Y * NEAR_Z; i++)
        values[4 * i + 1] = (float)true_room(&w, edge, i % NEAR_X, i / NEAR_X % NEAR_Y,
                                             i / (NEAR_X * NEAR_Y), NEAR_FAR);
    assert_at_least(most_above(&w, &fog->spaced, values), 0.1);
    free(values);
    scatter_gl_destroy(fog);
}

/* Where passes cannot draw it, scatter.h makes the map: in steps of 1/65535 of the diagonal, one less than it is. */
static void test_distance_by_processor(gl_rig *rig) {
    const scatter_box box = {{-1, 2, 0}, {0.7f, 2.2f, 5}};
    const scatter_vec3 edge = edges_of(&box);
    const double step = (double)scatteri_length(scatteri_sub(box.max, box.min)) / 65535 / (double)edge.z;
    int half;
    for (half = 0; half < 2; half++) {
        scatter_gl *fog = open_fog(rig, half);
        double below, above;
        check_world w;
        float *values;
        fog->can_draw_float = 0;
        open_rare_voxels(&w, box, 50, 3);
        values = distance_of_grid(rig, fog, &w);
        distance_errors(&w, &fog->spaced, values, NEAR_RIGHT, &below, &above);
        assert_at_most(above, 0.0);
        assert_at_most(below, 2 * step + (half ? 0x1p-9 : 0.0));
        assert_int_equal(scatter_gl_get_stats(fog).distance_maps, 1);
        free(values);
        scatter_gl_destroy(fog);
    }
}

/* Made again when voxels change, and only then; of an injected field, too. */
static void test_distance_is_kept(gl_rig *rig) {
    scatter_quality q = quality_of(SCATTER_DEPTH_CLOSED, SCATTER_DENSITY_EXACT, 0);
    scatter_gl *fog = open_fog(rig, 0);
    unsigned textures = 0;
    check_world w;
    int i;
    open_rare_voxels(&w, check_cube(0, 1), 50, 3);
    add_lights(&w, 0, 3);
    for (i = 0; i < 3; i++) {
        w.lights[0].position.x += 0.1f;
        fill_fog(fog, &w, &q, NULL);
        assert_int_equal(scatter_gl_get_stats(fog).distance_maps, 1);
    }
    for (i = 0; i < 4; i++) {
        w.grids[0].version++;
        fill_fog(fog, &w, &q, NULL);
        assert_int_equal(scatter_gl_get_stats(fog).distance_maps, 2 + i);
        if (i == 0) /* voxels that change have two textures */
            textures = scatter_gl_get_stats(fog).textures;
        assert_int_equal(scatter_gl_get_stats(fog).textures, textures);
    }
    q.no_distance_map = 1;
    w.grids[0].version++;
    fill_fog(fog, &w, &q, NULL);
    assert_int_equal(scatter_gl_get_stats(fog).distance_maps, 5);
    q = quality_of(SCATTER_DEPTH_POLAR, SCATTER_DENSITY_VOLUME, 8);
    q.ray = SCATTER_RAY_MARCH;
    fill_fog(fog, &w, &q, NULL);
    assert_int_equal(scatter_gl_get_stats(fog).distance_maps, 6);
    assert_int_equal(fog->spaced.width, 8);
    scatter_gl_destroy(fog);
}

int main(void) {
    static const gl_case cases[] = {{"injection", test_injection},
                                    {"injection into 16 bits", test_half_injection},
                                    {"closed volume", test_closed},
                                    {"upwind", test_upwind},
                                    {"polar", test_polar},
                                    {"columns", test_columns},
                                    {"polar from a volume", test_polar_volume},
                                    {"depth in 16 bits", test_half_depth},
                                    {"reading", test_reading},
                                    {"tone mapping", test_tone},
                                    {"tone mapping, planted faults", test_tone_faults},
                                    {"tone mapping of odd pixels", test_tone_odd_pixels},
                                    {"tone mapping to sRGB", test_tone_srgb},
                                    {"tone mapping in a window", test_tone_window},
                                    {"distance to density", test_distance},
                                    {"wrong distances are seen", test_wrong_distance},
                                    {"distances by the processor", test_distance_by_processor},
                                    {"the distance map is kept", test_distance_is_kept}};
    return gl_rig_run_all(cases, CHECK_COUNT(cases));
}
