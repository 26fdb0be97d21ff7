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
        gl->FramebufferTextureLayer(GL_READ_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, t->name, 0, i);
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
typedef enum fault { RIGHT, SHIFTED, MIRRORED, UNDIVIDED, SWAPPED, FAULTS } fault;

/* The medium's local terms in the cells of its local box, by scatter.h. */
static float *injected_twin(const scatter_medium *m, int n) {
    scatter_context *none = NULL;
    scatteri_medium medium;
    scatter_volume volume;
    const scatter_host host = scatteri_host_or_default(NULL);
    scatteri_stage stage;
    float *values = (float *)malloc((size_t)(n * n * n) * sizeof(float));
    (void)none;
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
    return values;
}

/* Depth of one source by scatter.h. */
static scatter_depth *depth_twin(const check_world *w, scatter_source source,
                                 const scatter_quality *q, fault what) {
    scatter_depth *depth = NULL;
    const float shift = what == SHIFTED ? 0.5f / (float)q->grid : 0.0f;
    if (what == MIRRORED && source.directional)
        source.direction.x = -source.direction.x;
    else if (what == MIRRORED)
        source.position.x = 1.0f - source.position.x + 0.1f;
    source.position.y += shift;
    if (what == SHIFTED)
        source.direction.y += shift;
    assert_int_equal(scatter_depth_create(NULL, &depth), SCATTER_OK);
    assert_int_equal(scatter_depth_update(depth, &w->scene.medium, &source, q), SCATTER_OK);
    return depth;
}

/* Adds the errors of a channel of a volume against a twin's values. */
static void add_channel(check_error *e, const scatteri_gl_texture *t, const float *values,
                        int channel, const scatter_depth *twin, fault what) {
    int i, j, k;
    for (k = 0; k < twin->nz; k++)
        for (j = 0; j < twin->ny; j++)
            for (i = 0; i < twin->nx; i++) {
                const size_t at = ((size_t)k * (size_t)t->height + (size_t)j) * (size_t)t->width +
                                  (size_t)i;
                float value = values[4 * at + (size_t)channel];
                if (what == UNDIVIDED)
                    value *= 1.0f + 0.3f * (float)k / (float)twin->nz;
                check_add(e, value, twin->values[scatteri_cell_index(twin, i, j, k)]);
            }
}

/* The largest relative RMS error of all sources of a fog. */
static double worst_depth(gl_rig *rig, scatter_gl *fog, const check_world *w,
                          const scatter_quality *q, const scatter_vec3 *eye, fault what) {
    double worst = 0;
    int batch, channel;
    for (batch = 0; batch < fog->batch_count; batch++) {
        float *values = read_volume(rig, &fog->volumes[batch]);
        for (channel = 0; channel < 4; channel++) {
            const int from = what == SWAPPED ? channel ^ 1 : channel;
            const scatteri_gl_lamp *lamp = scatteri_gl_source_in(fog, batch, from);
            check_error e = check_no_error();
            scatter_depth *twin;
            double rms;
            if (lamp == NULL || scatteri_gl_source_in(fog, batch, channel) == NULL)
                continue;
            twin = depth_twin(w, scatteri_source_of(&lamp->desc.light), q, what);
            add_channel(&e, &fog->volumes[batch], values, channel, twin, what);
            rms = check_relative_rms(&e);
            if (getenv("VERBOSE"))
                printf("    %s batch %d channel %d: %.3g (worst %.3g)\n", rig->api, batch, channel, rms, e.worst);
            worst = rms > worst || isnan(rms) ? rms : worst;
            scatter_depth_destroy(twin);
        }
        free(values);
    }
    (void)eye;
    return worst;
}

/* ----------------------------------------------------------------------- >>injection */

/* Largest error of the field over its largest value. */
static double injection_error(gl_rig *rig, scatter_gl *fog, const check_world *w, int n,
                              double *rms) {
    float *values = read_volume(rig, &fog->field), *twin = injected_twin(&w->scene.medium, n);
    check_error e = check_no_error();
    double most = 0, worst = 0;
    int i;
    assert_int_equal(fog->field.width, n);
    for (i = 0; i < n * n * n; i++) {
        const double miss = fabs((double)values[4 * i] - (double)twin[i]);
        check_add(&e, values[4 * i], twin[i]);
        most = twin[i] > most ? twin[i] : most;
        worst = miss > worst || isnan(miss) ? miss : worst;
    }
    free(values);
    free(twin);
    *rms = check_relative_rms(&e);
    return worst / most;
}

static void inject_both(gl_rig *rig, const check_world *w, int half_float, double limit) {
    scatter_gl *fog = open_fog(rig, half_float);
    const scatter_quality q = quality_of(SCATTER_DEPTH_POLAR, SCATTER_DENSITY_VOLUME, CELLS);
    scatteri_gl_state state;
    double rms;
    int quads;
    fill_fog(fog, w, &q, NULL);
    for (quads = 0; quads < 2; quads++) {
        double worst;
        scatteri_gl_save(fog, &state);
        assert_int_equal(scatteri_gl_inject_by(fog, quads), SCATTER_OK);
        scatteri_gl_restore(fog, &state);
        worst = injection_error(rig, fog, w, CELLS, &rms);
        printf("  %s, %s: worst %.3g of the largest, relative RMS %.3g\n", rig->api,
               quads ? "quads" : "gathered", worst, rms);
        assert_at_most(worst, limit);
        assert_at_most(rms, limit);
    }
    scatter_gl_destroy(fog);
}

static void test_injection(gl_rig *rig) {
    check_world w;
    open_cloud(&w, 0);
    add_smooth_grid(&w, 9, check_cube(0.1f, 0.8f));
    add_smooth_grid(&w, 7, check_cube(0.3f, 1.1f));
    inject_both(rig, &w, 0, 1e-5);
}

static void test_bounded_injection(gl_rig *rig) {
    check_world w;
    open_cloud(&w, 1);
    inject_both(rig, &w, 0, 1e-5);
}

/* --------------------------------------------------------------------------- >>depth */

static void test_depth_of(gl_rig *rig, scatter_depth_method method, const char *name, int grids) {
    const scatter_quality q = quality_of(method, SCATTER_DENSITY_EXACT, CELLS);
    int bounded, from;
    for (bounded = 0; bounded < 2; bounded++)
        for (from = 0; from < 8; from += 3) {
            scatter_gl *fog = open_fog(rig, 0);
            check_world w;
            double worst;
            open_cloud(&w, bounded);
            if (grids)
                add_smooth_grid(&w, 9, check_cube(0.1f, 0.8f));
            add_lights(&w, from, from + 5 < 8 ? from + 5 : 8);
            fill_fog(fog, &w, &q, NULL);
            worst = worst_depth(rig, fog, &w, &q, NULL, RIGHT);
            printf("  %s, %s, %s, lights %d..: %.3g\n", rig->api, name,
                   bounded ? "bounded" : "unbounded", from, worst);
            if (!getenv("VERBOSE"))
            assert_at_most(worst, 1e-4);
            scatter_gl_destroy(fog);
        }
}

static void test_closed(gl_rig *rig) {
    test_depth_of(rig, SCATTER_DEPTH_CLOSED_VOLUME, "closed volume", 0);
}

static void test_upwind(gl_rig *rig) {
    test_depth_of(rig, SCATTER_DEPTH_UPWIND, "upwind", 0);
    test_depth_of(rig, SCATTER_DEPTH_UPWIND, "upwind, grid", 1);
}

static void test_polar(gl_rig *rig) {
    test_depth_of(rig, SCATTER_DEPTH_POLAR, "polar", 0);
}

static void test_polar_grid(gl_rig *rig) {
    test_depth_of(rig, SCATTER_DEPTH_POLAR, "polar, grid", 1);
}

int main(void) {
    static const gl_case cases[] = {{"injection", test_injection},
                                    {"bounded injection", test_bounded_injection},
                                    {"closed volume", test_closed},
                                    {"upwind", test_upwind},
                                    {"polar", test_polar},
                                    {"polar with a grid", test_polar_grid}};
    return gl_rig_run_all(cases, CHECK_COUNT(cases));
}
