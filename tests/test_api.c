/* test_api.c - what scatter.h promises a host: bad input is refused with one sentence that names
   the field, memory that fails is no harm, the same bits with any number of threads, nothing redone
   that did not change, regions, compositing, cancelling, tone mapping. Needs no reference. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#define SCATTER_IMPLEMENTATION
#include "../scatter.h"
#include "check.h"

#include <float.h>

#define WIDTH 24
#define HEIGHT 17
#define FLOATS (WIDTH * HEIGHT * 3)

/* -------------------------------------- >>a scene with everything */

static void open_full(check_world *w) {
    scatter_light *spot;
    check_world_open(w);
    w->scene.medium.constant = 0.02f;
    check_add_height(w, 0.1f, 0.0f, 0.5f);
    check_add_height(w, 0.05f, 0.5f, 2.0f);
    check_add_gaussians(w, 4, 2.0f, 5.0f, 1);
    check_add_grid(w, 4, 3, 5, check_cube(0.1f, 0.9f), 2);
    check_add_grid(w, 6, 6, 6, check_cube(-0.4f, 0.4f), 3);
    w->grids[0].scale = w->grids[1].scale = 1.0f;
    check_bound(w, check_cube(-0.5f, 1.5f));
    w->scene.medium.extinction = check_v3(0.8f, 1.0f, 1.3f);
    w->scene.medium.emission = check_v3(0.01f, 0.0f, 0.0f);
    w->scene.medium.phase.kind = SCATTER_PHASE_HG;
    w->scene.medium.phase.g = 0.4f;
    w->scene.background = check_v3(0.1f, 0.2f, 0.3f);
    check_add_light(w, SCATTER_LIGHT_POINT, check_v3(1.2f, 1.3f, -0.4f), check_v3(4, 3, 2));
    spot = check_add_light(w, SCATTER_LIGHT_SPOT, check_v3(0.5f, 2.5f, 0.5f), check_v3(5, 5, 5));
    spot->direction = check_v3(0, -1, 0);
    spot->inner = 0.2f;
    spot->outer = 0.5f;
    check_add_light(w, SCATTER_LIGHT_DIRECTIONAL, check_v3(-1, -2, 1), check_v3(1, 1, 2));
}

/* Without voxels, whose sampling jumps when a ray is rounded the other way. */
static void open_smooth(check_world *w) {
    open_full(w);
    w->scene.medium.grid_count = 0;
}

/* Every stage that stores something does. */
static scatter_quality stored_quality(void) {
    scatter_quality q;
    memset(&q, 0, sizeof q);
    q.depth = SCATTER_DEPTH_POLAR;
    q.density = SCATTER_DENSITY_VOLUME;
    q.nodes = 8;
    q.grid = 12;
    return q;
}

typedef struct picture {
    float rgb[FLOATS], transmittance[FLOATS];
    scatter_image image;
} picture;

/* An image whose pixels all hold a pattern, so that untouched ones show. */
static scatter_image *open_picture(picture *p) {
    memset(p, 0, sizeof *p);
    memset(p->rgb, 0xa5, sizeof p->rgb);
    memset(p->transmittance, 0xa5, sizeof p->transmittance);
    p->image.width = WIDTH;
    p->image.height = HEIGHT;
    p->image.rgb = p->rgb;
    p->image.transmittance = p->transmittance;
    return &p->image;
}

static scatter_view front_view(void) {
    return scatter_view_perspective(check_v3(0.5f, 0.6f, -2.5f), check_v3(0.5f, 0.5f, 0.5f),
                                    check_v3(0, 1, 0), 0.7f, (float)WIDTH / HEIGHT);
}

static scatter_result shoot(const scatter_context *context, picture *p) {
    scatter_view view = front_view();
    return scatter_render(context, &view, open_picture(p));
}

static int same_pictures(const picture *a, const picture *b) {
    return memcmp(a->rgb, b->rgb, sizeof a->rgb) == 0 &&
           memcmp(a->transmittance, b->transmittance, sizeof a->transmittance) == 0;
}

static int is_untouched(const picture *p) {
    static picture clean;
    open_picture(&clean);
    return same_pictures(p, &clean);
}

/* The picture that a fresh context makes of a scene. */
static void shoot_fresh(const check_world *w, const scatter_quality *q, picture *p) {
    scatter_context *context = NULL;
    assert_int_equal(scatter_create(NULL, &context), SCATTER_OK);
    assert_int_equal(scatter_update(context, &w->scene, q), SCATTER_OK);
    assert_int_equal(shoot(context, p), SCATTER_OK);
    scatter_destroy(context);
}

/* ----------------------------------------- >>bad input: the check */

/* A refusal is a result, and one sentence to the log that names the field. */
static int is_refused(const check_host *books, scatter_result got, scatter_result wanted,
                      const char *field) {
    int good = got == wanted && books->sentences == 1 && books->logged == wanted &&
               strstr(books->sentence, field) != NULL && strchr(books->sentence, '\n') == NULL;
    if (!good)
        fprintf(stderr, "%s: result %d, wanted %d, %d sentences: \"%s\"\n", field, (int)got,
                (int)wanted, books->sentences, books->sentences ? books->sentence : "");
    return good;
}

/* A bad update is refused, the context then renders nothing, and after a good one it is as good as
 * new. */
static int update_refuses(const check_world *bad, const scatter_quality *quality,
                          scatter_result wanted, const char *field) {
    static picture before, after;
    static check_world good;
    check_host books;
    scatter_host host = check_host_open(&books, 0);
    scatter_quality q = stored_quality();
    scatter_context *context = NULL;
    int fine;
    open_full(&good);
    assert_int_equal(scatter_create(&host, &context), SCATTER_OK);
    assert_int_equal(scatter_update(context, &good.scene, &q), SCATTER_OK);
    assert_int_equal(shoot(context, &before), SCATTER_OK);
    fine = is_refused(&books, scatter_update(context, &bad->scene, quality ? quality : &q), wanted,
                      field);
    fine = fine && shoot(context, &after) != SCATTER_OK && is_untouched(&after);
    fine = fine && scatter_update(context, &good.scene, &q) == SCATTER_OK;
    fine = fine && shoot(context, &after) == SCATTER_OK && same_pictures(&before, &after);
    scatter_destroy(context);
    return fine && books.live == 0;
}

/* ------------------------------------------- >>bad input: scenes */

enum { NEGATIVE = 1, ZERO = 2, ABOVE_ONE = 4, ABOVE_PI = 8, BELOW_MINUS_ONE = 16 };

typedef struct bad_number {
    const char *field;
    size_t offset; /* of a float in check_world */
    int refused;   /* besides NaN and infinity, which always are */
} bad_number;

#define MEDIUM(member) #member, offsetof(check_world, scene.medium.member)
#define ITEM(member) #member, offsetof(check_world, member)

static const bad_number bad_numbers[] = {
    {"extinction", offsetof(check_world, scene.medium.extinction.x), NEGATIVE},
    {"extinction", offsetof(check_world, scene.medium.extinction.z), NEGATIVE},
    {"albedo", offsetof(check_world, scene.medium.albedo.x), NEGATIVE | ABOVE_ONE},
    {"albedo", offsetof(check_world, scene.medium.albedo.y), NEGATIVE | ABOVE_ONE},
    {"emission", offsetof(check_world, scene.medium.emission.y), NEGATIVE},
    {MEDIUM(phase.g), ABOVE_ONE | BELOW_MINUS_ONE},
    {"bounds", offsetof(check_world, scene.medium.bounds.min.x), 0},
    {"bounds", offsetof(check_world, scene.medium.bounds.max.z), 0},
    {MEDIUM(constant), NEGATIVE},
    {ITEM(heights[1].density), NEGATIVE},
    {ITEM(heights[1].y0), 0},
    {ITEM(heights[0].scale), NEGATIVE | ZERO},
    {"gaussians[3].center", offsetof(check_world, gaussians[3].center.x), 0},
    {"gaussians[0].center", offsetof(check_world, gaussians[0].center.z), 0},
    {ITEM(gaussians[3].a), NEGATIVE | ZERO},
    {ITEM(gaussians[2].c), NEGATIVE},
    {"grids[1].box", offsetof(check_world, grids[1].box.min.y), 0},
    {"grids[0].box", offsetof(check_world, grids[0].box.max.x), 0},
    {ITEM(grids[1].scale), NEGATIVE},
    {"grids[1].density", offsetof(check_world, voxels[1][77]), NEGATIVE},
    {"background", offsetof(check_world, scene.background.y), NEGATIVE},
    {"lights[0].position", offsetof(check_world, lights[0].position.x), 0},
    {"lights[1].position", offsetof(check_world, lights[1].position.z), 0},
    {"lights[0].intensity", offsetof(check_world, lights[0].intensity.y), NEGATIVE},
    {"lights[2].intensity", offsetof(check_world, lights[2].intensity.z), NEGATIVE},
    {ITEM(lights[0].radius), NEGATIVE},
    {"lights[1].direction", offsetof(check_world, lights[1].direction.x), 0},
    {"lights[1].direction", offsetof(check_world, lights[1].direction.y), ZERO},
    {"lights[2].direction", offsetof(check_world, lights[2].direction.x), 0},
    {ITEM(lights[1].inner), NEGATIVE | ABOVE_ONE}, /* beyond `outer` */
    {ITEM(lights[1].outer), ABOVE_PI},
};

static int update_refuses_value(const bad_number *row, float value) {
    static check_world w;
    open_full(&w);
    memcpy((char *)&w + row->offset, &value, sizeof value);
    if (update_refuses(&w, NULL, SCATTER_BAD_ARGUMENT, row->field))
        return 1;
    fprintf(stderr, "  with %s = %g\n", row->field, value);
    return 0;
}

static int refuses_values_of(const bad_number *row) {
    int good = update_refuses_value(row, NAN);
    good &= update_refuses_value(row, INFINITY);
    good &= update_refuses_value(row, -INFINITY);
    good &= !(row->refused & NEGATIVE) || update_refuses_value(row, -0.5f);
    good &= !(row->refused & NEGATIVE) || update_refuses_value(row, -FLT_MIN);
    good &= !(row->refused & ZERO) || update_refuses_value(row, 0.0f);
    good &= !(row->refused & ABOVE_ONE) || update_refuses_value(row, 1.0001f);
    good &= !(row->refused & BELOW_MINUS_ONE) || update_refuses_value(row, -1.0f);
    good &= !(row->refused & ABOVE_PI) || update_refuses_value(row, 3.2f);
    return good;
}

static void test_bad_numbers(void **state) {
    size_t i;
    int bad = 0;
    (void)state;
    for (i = 0; i < CHECK_COUNT(bad_numbers); i++)
        bad += !refuses_values_of(&bad_numbers[i]);
    assert_int_equal(bad, 0);
}

/* The parameters of the phase functions that the scene above does not use. */
static void test_bad_phase(void **state) {
    static check_world w;
    static const scatter_phase phases[] = {
        {SCATTER_PHASE_DRAINE, 0, -1, 0},      {SCATTER_PHASE_DRAINE, 0, NAN, 0},
        {SCATTER_PHASE_DROPLETS, 0, 0, 0},     {SCATTER_PHASE_DROPLETS, 0, 0, -1},
        {SCATTER_PHASE_DROPLETS, 0, 0, 50.1f}, {SCATTER_PHASE_DROPLETS, 0, 0, INFINITY},
        {(scatter_phase_kind)17, 0, 0, 0},
    };
    static const char *fields[] = {"phase.alpha",       "phase.alpha",       "phase.diameter_um",
                                   "phase.diameter_um", "phase.diameter_um", "phase.diameter_um",
                                   "phase.kind"};
    size_t i;
    (void)state;
    for (i = 0; i < CHECK_COUNT(phases); i++) {
        open_full(&w);
        w.scene.medium.phase = phases[i];
        assert_true(update_refuses(&w, NULL, SCATTER_BAD_ARGUMENT, fields[i]));
    }
}

static void no_gaussians(check_world *w) { w->scene.medium.gaussians = NULL; }
static void no_heights(check_world *w) { w->scene.medium.heights = NULL; }
static void no_grids(check_world *w) { w->scene.medium.grids = NULL; }
static void no_lights(check_world *w) { w->scene.lights = NULL; }
static void no_voxels(check_world *w) { w->grids[1].density = NULL; }
static void zero_voxels(check_world *w) { w->grids[1].nx = 0; }
static void minus_voxels(check_world *w) { w->grids[0].ny = -3; }
static void many_voxels(check_world *w) {
    w->grids[1].nx = w->grids[1].ny = w->grids[1].nz = 1 << 21; /* 2^63 values */
}
static void many_gaussians(check_world *w) { w->scene.medium.gaussian_count = (size_t)-1; }
static void many_heights(check_world *w) { w->scene.medium.height_count = (size_t)-1 / 4; }
static void many_lights(check_world *w) { w->scene.light_count = (size_t)-1; }
static void many_grids(check_world *w) { w->scene.medium.grid_count = (size_t)-1; }
static void flat_grid(check_world *w) { w->grids[0].box.max.y = w->grids[0].box.min.y; }
static void inverted_grid(check_world *w) { w->grids[1].box.max.z = -7; }
static void flat_bounds(check_world *w) {
    w->scene.medium.bounds.max.x = w->scene.medium.bounds.min.x;
}
static void inverted_bounds(check_world *w) { w->scene.medium.bounds.min.y = 9; }
static void unknown_light(check_world *w) { w->lights[1].kind = (scatter_light_kind)42; }
static void still_sun(check_world *w) { w->lights[2].direction = check_v3(0, 0, 0); }

typedef struct bad_scene {
    const char *field;
    void (*spoil)(check_world *);
    scatter_result result;
} bad_scene;

static const bad_scene bad_scenes[] = {
    {"gaussians", no_gaussians, SCATTER_BAD_ARGUMENT},
    {"heights", no_heights, SCATTER_BAD_ARGUMENT},
    {"grids", no_grids, SCATTER_BAD_ARGUMENT},
    {"lights", no_lights, SCATTER_BAD_ARGUMENT},
    {"grids[1].density", no_voxels, SCATTER_BAD_ARGUMENT},
    {"grids[1].nx", zero_voxels, SCATTER_BAD_ARGUMENT},
    {"grids[0].ny", minus_voxels, SCATTER_BAD_ARGUMENT},
    {"grids[1]", many_voxels, SCATTER_TOO_LARGE},
    {"gaussian_count", many_gaussians, SCATTER_TOO_LARGE},
    {"height_count", many_heights, SCATTER_TOO_LARGE},
    {"light_count", many_lights, SCATTER_TOO_LARGE},
    {"grid_count", many_grids, SCATTER_TOO_LARGE},
    {"grids[0].box", flat_grid, SCATTER_BAD_ARGUMENT},
    {"grids[1].box", inverted_grid, SCATTER_BAD_ARGUMENT},
    {"bounds", flat_bounds, SCATTER_BAD_ARGUMENT},
    {"bounds", inverted_bounds, SCATTER_BAD_ARGUMENT},
    {"lights[1].kind", unknown_light, SCATTER_BAD_ARGUMENT},
    {"lights[2].direction", still_sun, SCATTER_BAD_ARGUMENT},
};

static void test_bad_scenes(void **state) {
    static check_world w;
    size_t i;
    int bad = 0;
    (void)state;
    for (i = 0; i < CHECK_COUNT(bad_scenes); i++) {
        open_full(&w);
        bad_scenes[i].spoil(&w);
        bad += !update_refuses(&w, NULL, bad_scenes[i].result, bad_scenes[i].field);
    }
    assert_int_equal(bad, 0);
}

/* The check itself: a good scene is not refused, and a sentence about another field is not
 * accepted. */
static void test_refusals_can_fail(void **state) {
    static check_world w;
    check_host books;
    (void)state;
    fprintf(stderr, "the next four lines are the check at work on planted faults:\n");
    open_full(&w);
    assert_false(update_refuses(&w, NULL, SCATTER_BAD_ARGUMENT, "gaussians[3].a"));
    w.gaussians[3].a = NAN;
    assert_false(update_refuses(&w, NULL, SCATTER_BAD_ARGUMENT, "gaussians[2].a"));
    assert_false(update_refuses(&w, NULL, SCATTER_TOO_LARGE, "gaussians[3].a"));
    check_host_open(&books, 0);
    assert_false(is_refused(&books, SCATTER_BAD_ARGUMENT, SCATTER_BAD_ARGUMENT, "")); /* silence */
}

/* What is not used is not looked at: bounds of an unbounded medium, parameters of other phase
 * functions. */
static void test_unused_fields(void **state) {
    static check_world w;
    scatter_context *context = NULL;
    (void)state;
    open_full(&w);
    w.scene.medium.bounded = 0;
    w.scene.medium.bounds = check_cube(1, -1);
    w.scene.medium.phase.diameter_um = -1;
    w.lights[0].direction = check_v3(0, 0, 0);
    w.lights[0].outer = -1;
    assert_int_equal(scatter_create(NULL, &context), SCATTER_OK);
    assert_int_equal(scatter_update(context, &w.scene, NULL), SCATTER_OK);
    scatter_destroy(context);
}

/* ------------------------------------------- >>bad input: quality */

typedef struct bad_quality {
    const char *field;
    scatter_quality quality;
} bad_quality;

static const bad_quality bad_qualities[] = {
    {"depth", {.depth = (scatter_depth_method)-1}},
    {"depth", {.depth = (scatter_depth_method)8}},
    {"density", {.density = (scatter_density_method)3}},
    {"ray", {.ray = (scatter_ray_method)2}},
    {"nodes", {.nodes = -1}},
    {"nodes", {.nodes = 257}},
    {"nodes", {.ray = SCATTER_RAY_MARCH, .nodes = 4097}},
    {"grid", {.grid = -1}},
    {"grid", {.grid = 1}},
    {"grid", {.grid = 1025}},
    {"lights_per_update", {.lights_per_update = -1}},
};

static void test_bad_quality(void **state) {
    static check_world w;
    size_t i;
    int bad = 0;
    (void)state;
    open_full(&w);
    for (i = 0; i < CHECK_COUNT(bad_qualities); i++)
        bad += !update_refuses(&w, &bad_qualities[i].quality, SCATTER_BAD_ARGUMENT,
                               bad_qualities[i].field);
    assert_int_equal(bad, 0);
}

/* The ends of the ranges are allowed. */
static void test_quality_limits(void **state) {
    static const int limits[][3] = {{1, 2, SCATTER_RAY_QUADRATURE},
                                    {256, 16, SCATTER_RAY_QUADRATURE},
                                    {1, 2, SCATTER_RAY_MARCH},
                                    {4096, 3, SCATTER_RAY_MARCH}};
    static check_world w;
    static picture p;
    size_t i;
    int k;
    (void)state;
    open_full(&w);
    for (i = 0; i < CHECK_COUNT(limits); i++) {
        scatter_quality q = stored_quality();
        q.nodes = limits[i][0];
        q.grid = limits[i][1];
        q.ray = (scatter_ray_method)limits[i][2];
        shoot_fresh(&w, &q, &p);
        for (k = 0; k < FLOATS; k++)
            assert_true(p.rgb[k] >= 0 && p.rgb[k] < 100);
    }
}

/* -------------------------------------- >>bad input: rays, images */

typedef struct shot {
    scatter_view view;
    scatter_image image;
    scatter_ray ray;
    scatter_surface hit;
    float pixels[FLOATS];
} shot;

static void open_shot(shot *s) {
    scatter_surface hit = {2.0f, {0, 0, -1}, {0.5f, 0.5f, 0.5f}, {0.1f, 0.1f, 0.1f}, 5.0f};
    scatter_ray ray = {{0.5f, 0.5f, -2}, {0, 0, 1}};
    memset(s, 0, sizeof *s);
    memset(s->pixels, 0xa5, sizeof s->pixels);
    s->view = front_view();
    s->image.width = WIDTH;
    s->image.height = HEIGHT;
    s->image.rgb = s->pixels;
    s->hit = hit;
    s->ray = ray;
}

static void image_width(shot *s) { s->image.width = 0; }
static void image_height(shot *s) { s->image.height = -4; }
static void image_large(shot *s) { s->image.width = s->image.height = 1 << 30; }
static void image_rgb(shot *s) { s->image.rgb = NULL; }
static void image_x0(shot *s) { s->image.x0 = -1, s->image.x1 = 2, s->image.y1 = 2; }
static void image_x1(shot *s) { s->image.x1 = WIDTH + 1, s->image.y1 = 2; }
static void image_y0(shot *s) { s->image.y0 = 5, s->image.y1 = 5, s->image.x1 = 3; }
static void image_y1(shot *s) { s->image.y1 = HEIGHT + 1, s->image.x1 = 1; }
static void view_origin(shot *s) { s->view.origin.y = NAN; }
static void view_origin_dx(shot *s) { s->view.origin_dx.x = INFINITY; }
static void view_direction(shot *s) { s->view.direction.z = NAN; }
static void view_direction_dy(shot *s) { s->view.direction_dy.z = -INFINITY; }
static void view_still(shot *s) {
    s->view.direction = s->view.direction_dx = s->view.direction_dy = check_v3(0, 0, 0);
}

static void ray_origin(shot *s) { s->ray.origin.x = NAN; }
static void ray_direction(shot *s) { s->ray.direction.y = INFINITY; }
static void ray_still(shot *s) { s->ray.direction = check_v3(0, 0, 0); }
static void hit_distance(shot *s) { s->hit.distance = NAN; }
static void hit_behind(shot *s) { s->hit.distance = -1; }
static void hit_normal(shot *s) { s->hit.normal.x = NAN; }
static void hit_albedo(shot *s) { s->hit.albedo.y = -1; }
static void hit_specular(shot *s) { s->hit.specular.z = INFINITY; }
static void hit_shininess(shot *s) { s->hit.shininess = -2; }

typedef struct bad_shot {
    const char *field;
    void (*spoil)(shot *);
    scatter_result result;
} bad_shot;

static const bad_shot bad_images[] = {
    {"width", image_width, SCATTER_BAD_ARGUMENT},
    {"height", image_height, SCATTER_BAD_ARGUMENT},
    {"width", image_large, SCATTER_TOO_LARGE},
    {"rgb", image_rgb, SCATTER_BAD_ARGUMENT},
    {"x0", image_x0, SCATTER_BAD_ARGUMENT},
    {"x1", image_x1, SCATTER_BAD_ARGUMENT},
    {"y0", image_y0, SCATTER_BAD_ARGUMENT},
    {"y1", image_y1, SCATTER_BAD_ARGUMENT},
    {"view.origin", view_origin, SCATTER_BAD_ARGUMENT},
    {"view.origin_dx", view_origin_dx, SCATTER_BAD_ARGUMENT},
    {"view.direction", view_direction, SCATTER_BAD_ARGUMENT},
    {"view.direction_dy", view_direction_dy, SCATTER_BAD_ARGUMENT},
    {"view.direction", view_still, SCATTER_BAD_ARGUMENT},
};

static const bad_shot bad_rays[] = {
    {"ray.origin", ray_origin, SCATTER_BAD_ARGUMENT},
    {"ray.direction", ray_direction, SCATTER_BAD_ARGUMENT},
    {"ray.direction", ray_still, SCATTER_BAD_ARGUMENT},
    {"hit.distance", hit_distance, SCATTER_BAD_ARGUMENT},
    {"hit.distance", hit_behind, SCATTER_BAD_ARGUMENT},
    {"hit.normal", hit_normal, SCATTER_BAD_ARGUMENT},
    {"hit.albedo", hit_albedo, SCATTER_BAD_ARGUMENT},
    {"hit.specular", hit_specular, SCATTER_BAD_ARGUMENT},
    {"hit.shininess", hit_shininess, SCATTER_BAD_ARGUMENT},
};

static scatter_context *open_logged(check_host *books, const check_world *w,
                                    const scatter_quality *q) {
    scatter_host host = check_host_open(books, 0);
    scatter_context *context = NULL;
    assert_int_equal(scatter_create(&host, &context), SCATTER_OK);
    assert_int_equal(scatter_update(context, &w->scene, q), SCATTER_OK);
    return context;
}

static void test_bad_images(void **state) {
    static check_world w;
    static shot s, clean;
    check_host books;
    scatter_quality q = stored_quality();
    scatter_context *context;
    size_t i;
    int bad = 0;
    (void)state;
    open_full(&w);
    open_shot(&clean);
    context = open_logged(&books, &w, &q);
    for (i = 0; i < CHECK_COUNT(bad_images); i++) {
        open_shot(&s);
        bad_images[i].spoil(&s);
        books.sentences = 0;
        bad += !is_refused(&books, scatter_render(context, &s.view, &s.image), bad_images[i].result,
                           bad_images[i].field);
        bad += memcmp(s.pixels, clean.pixels, sizeof s.pixels) != 0;
    }
    scatter_destroy(context);
    assert_int_equal(bad, 0);
}

static void test_bad_rays(void **state) {
    static check_world w;
    static shot s;
    check_host books;
    scatter_quality q = stored_quality();
    scatter_context *context;
    scatter_sample sample;
    size_t i;
    int bad = 0;
    (void)state;
    open_full(&w);
    context = open_logged(&books, &w, &q);
    for (i = 0; i < CHECK_COUNT(bad_rays); i++) {
        open_shot(&s);
        bad_rays[i].spoil(&s);
        books.sentences = 0;
        bad += !is_refused(&books, scatter_radiance(context, &s.ray, &s.hit, &sample),
                           bad_rays[i].result, bad_rays[i].field);
    }
    scatter_destroy(context);
    assert_int_equal(bad, 0);
}

/* ---------------------------------- >>bad input: the other stages */

static void test_bad_volumes(void **state) {
    static check_world w;
    static float values[64];
    static const char *fields[] = {"values", "nx", "ny", "nz", "box", "box", "nx"};
    scatter_volume bad[7];
    check_host books;
    int i;
    (void)state;
    open_full(&w);
    for (i = 0; i < 7; i++) {
        scatter_volume v = {NULL, 4, 4, 4, {{0, 0, 0}, {1, 1, 1}}};
        v.values = values;
        bad[i] = v;
    }
    bad[0].values = NULL;
    bad[1].nx = 0;
    bad[2].ny = -1;
    bad[3].nz = -2147483647 - 1;
    bad[4].box.max.x = 0;
    bad[5].box.min.z = NAN;
    bad[6].nx = bad[6].ny = bad[6].nz = 1 << 21;
    for (i = 0; i < 7; i++) {
        scatter_host host = check_host_open(&books, 0);
        scatter_result wanted = i == 6 ? SCATTER_TOO_LARGE : SCATTER_BAD_ARGUMENT;
        assert_true(
            is_refused(&books, scatter_inject(&host, &w.scene.medium, &bad[i]), wanted, fields[i]));
    }
    for (i = 0; i < 64; i++)
        assert_true(values[i] == 0); /* nothing was written */
}

static void test_bad_sources(void **state) {
    static check_world w;
    static const scatter_source bad[] = {{0, {NAN, 0, 0}, {0, 0, 0}},
                                         {0, {0, 0, INFINITY}, {0, 0, 0}},
                                         {1, {0, 0, 0}, {0, 0, 0}},
                                         {1, {0, 0, 0}, {0, NAN, 0}}};
    static const char *fields[] = {"position", "position", "direction", "direction"};
    check_host books;
    scatter_host host = check_host_open(&books, 0);
    scatter_source good = {0, {2, 2, 2}, {0, 0, 0}};
    scatter_depth *depth = NULL;
    int i;
    (void)state;
    open_full(&w);
    assert_int_equal(scatter_depth_create(&host, &depth), SCATTER_OK);
    for (i = 0; i < 4; i++) {
        books.sentences = 0;
        assert_true(is_refused(&books, scatter_depth_update(depth, &w.scene.medium, &bad[i], NULL),
                               SCATTER_BAD_ARGUMENT, fields[i]));
    }
    w.gaussians[1].a = 0;
    books.sentences = 0;
    assert_true(is_refused(&books, scatter_depth_update(depth, &w.scene.medium, &good, NULL),
                           SCATTER_BAD_ARGUMENT, "gaussians[1].a"));
    w.gaussians[1].a = 1;
    assert_int_equal(scatter_depth_update(depth, &w.scene.medium, &good, NULL), SCATTER_OK);
    assert_true(scatter_depth_at(depth, check_v3(0, 0, 0)) > 0);
    scatter_depth_destroy(depth);
    assert_int_equal(books.live, 0);
}

/* Missing arguments are refused, not followed. */
static void test_null_arguments(void **state) {
    static check_world w;
    static shot s;
    check_host books;
    scatter_host host = check_host_open(&books, 0);
    scatter_quality q = stored_quality();
    scatter_context *context;
    scatter_sample sample;
    scatter_source source = {0, {2, 2, 2}, {0, 0, 0}};
    scatter_depth *depth = NULL;
    (void)state;
    open_full(&w);
    open_shot(&s);
    context = open_logged(&books, &w, &q);
    assert_int_equal(scatter_depth_create(&host, &depth), SCATTER_OK);
    books.sentences = 0;
    assert_int_equal(scatter_create(&host, NULL), SCATTER_BAD_ARGUMENT);
    assert_int_equal(scatter_depth_create(&host, NULL), SCATTER_BAD_ARGUMENT);
    assert_int_equal(scatter_inject(&host, NULL, NULL), SCATTER_BAD_ARGUMENT);
    assert_int_equal(scatter_depth_update(depth, NULL, &source, NULL), SCATTER_BAD_ARGUMENT);
    assert_int_equal(scatter_depth_update(depth, &w.scene.medium, NULL, NULL),
                     SCATTER_BAD_ARGUMENT);
    assert_int_equal(scatter_render(context, NULL, &s.image), SCATTER_BAD_ARGUMENT);
    assert_int_equal(scatter_render(context, &s.view, NULL), SCATTER_BAD_ARGUMENT);
    assert_int_equal(scatter_radiance(context, NULL, NULL, &sample), SCATTER_BAD_ARGUMENT);
    assert_int_equal(scatter_radiance(context, &s.ray, NULL, NULL), SCATTER_BAD_ARGUMENT);
    assert_int_equal(scatter_update(context, NULL, NULL), SCATTER_BAD_ARGUMENT);
    assert_int_equal(books.sentences, 10);
    assert_int_equal(scatter_update(NULL, &w.scene, NULL),
                     SCATTER_BAD_ARGUMENT); /* nobody to tell */
    assert_int_equal(scatter_render(NULL, &s.view, &s.image), SCATTER_BAD_ARGUMENT);
    scatter_destroy(context);
    scatter_depth_destroy(depth);
    scatter_destroy(NULL);
    scatter_depth_destroy(NULL);
}

/* Before the first update there is no scene. */
static void test_render_before_update(void **state) {
    static picture p;
    check_host books;
    scatter_host host = check_host_open(&books, 0);
    scatter_context *context = NULL;
    (void)state;
    assert_int_equal(scatter_create(&host, &context), SCATTER_OK);
    assert_int_equal(shoot(context, &p), SCATTER_BAD_ARGUMENT);
    assert_int_equal(books.sentences, 1);
    assert_true(is_untouched(&p));
    scatter_destroy(context);
}

/* Whether the pixels in the middle of the image are numbers, not negative, and transmittance 0..1.
 */
static int middle_is_finite(const scatter_context *context) {
    static picture p;
    scatter_view view = front_view();
    int i, x, good = 1;
    open_picture(&p);
    p.image.x0 = 11;
    p.image.x1 = 13;
    p.image.y0 = 7;
    p.image.y1 = 9;
    if (scatter_render(context, &view, &p.image) != SCATTER_OK)
        return 0;
    for (i = 7; i < 9; i++)
        for (x = 3 * (i * WIDTH + 11); x < 3 * (i * WIDTH + 13); x++)
            good &= isfinite(p.rgb[x]) && p.rgb[x] >= 0 && p.transmittance[x] >= 0 &&
                    p.transmittance[x] <= 1;
    return good;
}

/* Numbers of any magnitude: refused with a sentence, or finite pixels. Nothing in between. */
static int survives(const bad_number *row, float value) {
    static check_world w;
    check_host books;
    scatter_host host = check_host_open(&books, 0);
    scatter_quality q = stored_quality();
    scatter_context *context = NULL;
    int good;
    q.nodes = 1; /* opaque media get a thousand panels for each ray */
    open_full(&w);
    memcpy((char *)&w + row->offset, &value, sizeof value);
    assert_int_equal(scatter_create(&host, &context), SCATTER_OK);
    if (scatter_update(context, &w.scene, &q) != SCATTER_OK)
        good = books.sentences == 1;
    else
        good = middle_is_finite(context);
    scatter_destroy(context);
    if (!good || books.live)
        fprintf(stderr, "  %s = %g: not finite, or no sentence\n", row->field, value);
    return good && books.live == 0;
}

static void test_extreme_numbers(void **state) {
    static const float values[] = {3.4e38f, -3.4e38f, 1e20f,  -1e20f, 1e10f,
                                   -1e10f,  1e-10f,   1e-38f, 1e-45f, 0.0f};
    size_t i, k;
    int bad = 0;
    (void)state;
    for (i = 0; i < CHECK_COUNT(bad_numbers); i++)
        for (k = 0; k < CHECK_COUNT(values); k++)
            bad += !survives(&bad_numbers[i], values[k]);
    assert_int_equal(bad, 0);
}

/* -------------------------------------------------- >>bad pixels */

/* A surface that some rays meet badly: at NaN, before the eye, without a normal. */
static int bad_surface(void *user, scatter_vec3 o, scatter_vec3 d, scatter_surface *hit) {
    (void)user, (void)o;
    memset(hit, 0, sizeof *hit);
    hit->distance = d.x > 0.1f ? NAN : d.x < -0.1f ? -1.0f : 2.0f;
    hit->normal = d.y > 0.1f ? check_v3(NAN, 0, 0) : check_v3(0, 0, -1);
    hit->albedo = check_v3(0.5f, 0.5f, 0.5f);
    return 1;
}

static int good_surface(void *user, scatter_vec3 o, scatter_vec3 d, scatter_surface *hit) {
    bad_surface(user, o, d, hit);
    hit->distance = 2.0f;
    hit->normal = check_v3(0, 0, -1);
    return 1;
}

/* One bad value stays in its pixel. */
static void test_bad_values_stay(void **state) {
    static check_world w;
    static picture bad, good;
    scatter_quality q = stored_quality();
    scatter_view view = front_view();
    int x, y, same = 0;
    (void)state;
    open_full(&w);
    w.scene.surface = bad_surface;
    shoot_fresh(&w, &q, &bad);
    w.scene.surface = good_surface;
    shoot_fresh(&w, &q, &good);
    for (y = 0; y < HEIGHT; y++)
        for (x = 0; x < WIDTH; x++) {
            scatter_ray r =
                scatter_view_ray(&view, ((float)x + 0.5f) / WIDTH, ((float)y + 0.5f) / HEIGHT);
            float length = (float)check_distance(r.direction, check_v3(0, 0, 0)),
                  at = r.direction.x / length;
            size_t i = (size_t)(3 * (y * WIDTH + x));
            if (fabsf(at) > 0.09f || r.direction.y / length > 0.09f)
                continue;
            assert_true(memcmp(&bad.rgb[i], &good.rgb[i], 3 * sizeof(float)) == 0);
            same++;
        }
    assert_true(same > 30);
}

/* Values of the picture that are not finite, or negative. */
static int bad_values(const picture *p) {
    int i, bad = 0;
    for (i = 0; i < FLOATS; i++)
        bad += !(isfinite(p->rgb[i]) && p->rgb[i] >= 0) ||
               !(p->transmittance[i] >= 0 && p->transmittance[i] <= 1);
    return bad;
}

/* Worst relative difference of two pictures. */
static double worst_difference(const picture *a, const picture *b) {
    check_error e = check_no_error();
    int i;
    for (i = 0; i < FLOATS; i++)
        check_add(&e, a->rgb[i], b->rgb[i]);
    return e.worst;
}

static int surface_with_normal(void *user, scatter_vec3 o, scatter_vec3 d, scatter_surface *hit) {
    good_surface(NULL, o, d, hit);
    hit->normal = *(const scatter_vec3 *)user;
    return 1;
}

static void shoot_normal(scatter_vec3 normal, picture *p) {
    static check_world w;
    scatter_quality q = stored_quality();
    open_smooth(&w);
    w.scene.surface = surface_with_normal;
    w.scene.user = &normal;
    shoot_fresh(&w, &q, p);
}

/* A normal of any length but 0 is as good as one of length 1, from denormal to almost infinite. */
static void test_normals_of_any_length(void **state) {
    static const float lengths[] = {0x1p-135f, 0x1p-40f, 0x1p60f, 0x1p127f};
    static picture unit, p;
    size_t i;
    (void)state;
    shoot_normal(check_v3(0, 0.5f, -1), &unit);
    assert_int_equal(bad_values(&unit), 0);
    for (i = 0; i < CHECK_COUNT(lengths); i++) {
        shoot_normal(check_v3(0, 0.5f * lengths[i], -lengths[i]), &p);
        assert_int_equal(bad_values(&p), 0);
        assert_at_most(worst_difference(&p, &unit), 1e-6);
    }
    shoot_normal(check_v3(0, 0.6f, -1), &p); /* another direction is seen */
    assert_at_least(worst_difference(&p, &unit), 1e-6);
    p.rgb[5] = NAN; /* and so is a bad value */
    assert_int_equal(bad_values(&p), 1);
}

/* A view whose direction is 0 in the middle of the picture: that pixel looks along x. */
static void test_view_without_direction(void **state) {
    static check_world w;
    static picture p;
    check_host books;
    scatter_quality q = stored_quality();
    scatter_view view = front_view();
    scatter_ray along_x = {{0.5f, 0.6f, -2.5f}, {1, 0, 0}};
    scatter_sample s;
    scatter_context *context;
    const float *middle;
    (void)state;
    open_smooth(&w);
    along_x.origin = view.origin = check_v3(0.1f, 0.6f, 0.5f);
    context = open_logged(&books, &w, &q);
    view.direction = check_v3(0.5f, -0.5f, 0); /* 0 at x = y = 1/2, where a pixel has its centre */
    view.direction_dx = check_v3(-1, 0, 0);
    view.direction_dy = check_v3(0, 1, 0);
    open_picture(&p)->width = WIDTH - 1; /* an odd number of columns and rows; the rest stays 0 */
    memset(p.rgb, 0, sizeof p.rgb);
    memset(p.transmittance, 0, sizeof p.transmittance);
    assert_int_equal(scatter_render(context, &view, &p.image), SCATTER_OK);
    assert_int_equal(bad_values(&p), 0);
    middle = &p.transmittance[3 * ((HEIGHT / 2) * (WIDTH - 1) + (WIDTH - 1) / 2)];
    assert_int_equal(scatter_radiance(context, &along_x, NULL, &s), SCATTER_OK);
    assert_at_most(fabs((double)middle[0] / s.transmittance.x - 1), 1e-5);
    along_x.direction = check_v3(1, 0.1f, 0); /* another direction is seen */
    assert_int_equal(scatter_radiance(context, &along_x, NULL, &s), SCATTER_OK);
    assert_at_least(fabs((double)middle[0] / s.transmittance.x - 1), 1e-5);
    scatter_destroy(context);
}

/* A picture from directions of some length. */
static void shoot_straight(const scatter_context *context, float length, picture *p) {
    scatter_view view = front_view();
    view.direction = check_v3(0, 0, length);
    view.direction_dx = check_v3(length, 0, 0);
    view.direction_dy = check_v3(0, -length, 0);
    assert_int_equal(scatter_render(context, &view, open_picture(p)), SCATTER_OK);
}

/* Directions of denormal length are directions, in rays and in views. */
static void test_denormal_directions(void **state) {
    static check_world w;
    static picture p, small;
    check_host books;
    scatter_quality q = stored_quality();
    scatter_ray plain = {{0.5f, 0.6f, -2.5f}, {0, 0.25f, 1}};
    scatter_ray denormal = {{0.5f, 0.6f, -2.5f}, {0, 0x1p-142f, 0x1p-140f}};
    scatter_ray least = {{0.5f, 0.6f, -2.5f}, {0, 0, 0x1p-149f}};
    scatter_sample a, b;
    scatter_context *context;
    (void)state;
    open_full(&w);
    context = open_logged(&books, &w, &q);
    assert_int_equal(scatter_radiance(context, &plain, NULL, &a), SCATTER_OK);
    assert_int_equal(scatter_radiance(context, &denormal, NULL, &b), SCATTER_OK);
    assert_true(memcmp(&a, &b, sizeof a) == 0); /* powers of two are the same direction */
    assert_int_equal(scatter_radiance(context, &least, NULL, &b), SCATTER_OK);
    assert_true(isfinite(b.radiance.x) && b.radiance.x > 0 && memcmp(&a, &b, sizeof a) != 0);
    shoot_straight(context, 1, &p);
    assert_int_equal(bad_values(&p), 0);
    shoot_straight(context, 0x1p-149f, &small);
    assert_true(same_pictures(&p, &small));
    scatter_destroy(context);
}

/* ------------------------------------------------------ >>memory */

/* With `scene` taken over, the n-th allocation fails; then, with memory, everything works as if it
 * never had. */
static scatter_result update_with_failure(const check_world *small, const check_world *w, size_t n,
                                          const picture *wanted) {
    static picture p;
    check_host books;
    scatter_host host = check_host_open(&books, 0);
    scatter_quality q = stored_quality();
    scatter_context *context = NULL;
    scatter_result result;
    assert_int_equal(scatter_create(&host, &context), SCATTER_OK);
    if (small)
        assert_int_equal(scatter_update(context, &small->scene, &q), SCATTER_OK);
    books.fail_at = books.calls + n;
    result = scatter_update(context, &w->scene, &q);
    books.fail_at = 0;
    assert_int_equal(books.sentences, result == SCATTER_OK ? 0 : 1);
    if (result != SCATTER_OK) {
        assert_int_equal(books.logged, result);
        assert_true(shoot(context, &p) != SCATTER_OK && is_untouched(&p));
    }
    assert_int_equal(scatter_update(context, &w->scene, &q), SCATTER_OK);
    assert_int_equal(shoot(context, &p), SCATTER_OK);
    assert_true(same_pictures(&p, wanted));
    scatter_destroy(context);
    assert_int_equal(books.live, 0);
    assert_int_equal(books.bytes, 0);
    return result;
}

static size_t failures_until_success(const check_world *small, const check_world *w) {
    static picture wanted;
    scatter_quality q = stored_quality();
    scatter_result result = SCATTER_OUT_OF_MEMORY;
    size_t n = 0;
    shoot_fresh(w, &q, &wanted);
    while (result != SCATTER_OK) {
        result = update_with_failure(small, w, ++n, &wanted);
        assert_true(result == SCATTER_OK || result == SCATTER_OUT_OF_MEMORY);
        assert_true(n < 1000);
    }
    return n - 1;
}

static void test_allocation_fails_in_update(void **state) {
    static check_world w, small;
    (void)state;
    open_full(&w);
    assert_true(failures_until_success(NULL, &w) >= 1); /* the loop tested something */
    check_world_open(&small);
    check_add_gaussian(&small, check_v3(0, 0, 0), 1, 1);
    assert_true(failures_until_success(&small, &w) >= 1); /* the same when a small scene grows */
}

static void test_allocation_fails_in_create(void **state) {
    check_host books;
    scatter_host host = check_host_open(&books, 0);
    scatter_context *context = (scatter_context *)&books;
    scatter_depth *depth = (scatter_depth *)&books;
    (void)state;
    books.fail_at = 1;
    assert_int_equal(scatter_create(&host, &context), SCATTER_OUT_OF_MEMORY);
    assert_true(context == NULL);
    assert_int_equal(books.sentences, 1);
    assert_int_equal(scatter_depth_create(&host, &depth), SCATTER_OUT_OF_MEMORY);
    assert_true(depth == NULL);
    assert_int_equal(books.sentences, 2);
    assert_int_equal(books.live, 0);
}

static scatter_result depth_with_failure(const check_world *w, scatter_depth_method method,
                                         size_t n) {
    check_host books;
    scatter_host host = check_host_open(&books, 0);
    scatter_quality q = stored_quality();
    scatter_source source = {0, {1.2f, 1.3f, -0.4f}, {0, 0, 0}};
    scatter_depth *depth = NULL;
    scatter_result result;
    q.depth = method;
    assert_int_equal(scatter_depth_create(&host, &depth), SCATTER_OK);
    books.fail_at = books.calls + n;
    result = scatter_depth_update(depth, &w->scene.medium, &source, &q);
    books.fail_at = 0;
    assert_int_equal(books.sentences, result == SCATTER_OK ? 0 : 1);
    assert_int_equal(scatter_depth_update(depth, &w->scene.medium, &source, &q), SCATTER_OK);
    assert_true(scatter_depth_at(depth, check_v3(0.5f, 0.5f, 0.5f)) > 0);
    scatter_depth_destroy(depth);
    assert_int_equal(books.live, 0);
    return result;
}

static void test_allocation_fails_in_depth(void **state) {
    static check_world w;
    int method;
    (void)state;
    open_full(&w);
    for (method = SCATTER_DEPTH_CLOSED; method <= SCATTER_DEPTH_MARCH; method++) {
        size_t n = 1;
        while (depth_with_failure(&w, (scatter_depth_method)method, n) != SCATTER_OK)
            assert_true(++n < 1000);
        assert_true(n > 1); /* the medium's arrays at least are copied */
    }
}

/* No allocation for each frame: rays, images, and an update to a scene that is not larger. */
static void test_frames_do_not_allocate(void **state) {
    static check_world w;
    static picture p;
    check_host books;
    scatter_quality q = stored_quality();
    scatter_context *context;
    scatter_ray ray = {{0.5f, 0.5f, -2}, {0, 0, 1}};
    scatter_sample sample;
    size_t calls, bytes;
    (void)state;
    open_full(&w);
    context = open_logged(&books, &w, &q);
    calls = books.calls;
    bytes = books.bytes;
    assert_true(calls > 0); /* the counter counts */
    assert_true(scatter_get_stats(context).bytes <= bytes && scatter_get_stats(context).bytes > 0);
    assert_int_equal(shoot(context, &p), SCATTER_OK);
    assert_int_equal(scatter_radiance(context, &ray, NULL, &sample), SCATTER_OK);
    assert_int_equal(scatter_update(context, &w.scene, &q), SCATTER_OK);
    w.lights[0].position.x += 0.1f;
    w.gaussians[0].center.y += 0.1f;
    assert_int_equal(scatter_update(context, &w.scene, &q), SCATTER_OK);
    assert_int_equal(shoot(context, &p), SCATTER_OK);
    assert_int_equal(books.calls, calls);
    assert_int_equal(books.bytes, bytes);
    scatter_destroy(context);
}

/* ------------------------------------------------------- >>stack */

enum { STACK = 4 << 20, STACK_PROMISED = 300 << 10 }; /* scatter.h: "At most 300 KB of stack" */

static int always_visible(void *user, scatter_vec3 p, scatter_vec3 q) {
    (void)user, (void)p, (void)q;
    return 1;
}

/* What one thread does on a stack of its own. */
typedef struct stack_job {
    void (*work)(struct stack_job *);
    scatter_context *context;
    const check_world *world;
    scatter_quality quality;
    picture picture;
} stack_job;

static void *run_stack_job(void *data) {
    stack_job *job = (stack_job *)data;
    job->work(job);
    return NULL;
}

/* Bytes of its stack that the thread has written: from the lowest that is no longer as painted. */
static size_t stack_of(stack_job *job, void (*work)(stack_job *)) {
    unsigned char *stack = NULL;
    pthread_attr_t attributes;
    pthread_t thread;
    size_t untouched = 0;
    void *memory = NULL;
    assert_int_equal(posix_memalign(&memory, 1 << 16, STACK), 0);
    stack = (unsigned char *)memory;
    memset(stack, 0xa5, STACK);
    job->work = work;
    assert_int_equal(pthread_attr_init(&attributes), 0);
    assert_int_equal(pthread_attr_setstack(&attributes, stack, STACK), 0);
    assert_int_equal(pthread_create(&thread, &attributes, run_stack_job, job), 0);
    assert_int_equal(pthread_join(thread, NULL), 0);
    pthread_attr_destroy(&attributes);
    while (untouched < STACK && stack[untouched] == 0xa5)
        untouched++;
    free(memory);
    return STACK - untouched;
}

static void stack_nothing(stack_job *job) { (void)job; }

static void stack_update(stack_job *job) {
    scatter_update(job->context, &job->world->scene, &job->quality);
}

static void stack_render(stack_job *job) { shoot(job->context, &job->picture); }

static void stack_radiance(stack_job *job) {
    scatter_ray ray = {{0.5f, 0.6f, -2.5f}, {0.01f, 0, 1}};
    scatter_sample sample;
    scatter_radiance(job->context, &ray, NULL, &sample);
}

static void stack_estimate(stack_job *job) {
    scatter_estimate estimate;
    scatter_view view = front_view();
    open_picture(&job->picture)->estimate = &estimate;
    scatter_render(job->context, &view, &job->picture.image);
    job->picture.image.estimate = NULL;
}

static void stack_plan(stack_job *job) {
    scatter_forecast forecast;
    scatter_view view = front_view();
    scatter_plan(NULL, &job->world->scene, &view, &job->picture.image, 0.05f, &forecast);
}

static void stack_array(stack_job *job) {
    volatile unsigned char bytes[STACK_PROMISED + 4096];
    memset((void *)(uintptr_t)bytes, 1, sizeof bytes);
    job->quality.grid = bytes[job->quality.grid];
}

/* Most of the calls, without what a thread needs that does nothing. */
static size_t stack_of_calls(stack_job *job, size_t idle) {
    static void (*const calls[])(stack_job *) = {stack_update, stack_render, stack_radiance,
                                                  stack_estimate};
    size_t most = 0, i;
    for (i = 0; i < CHECK_COUNT(calls); i++) {
        size_t used = stack_of(job, calls[i]) - idle;
        most = used > most ? used : most;
    }
    return most;
}

/* What scatter.h says of its stack, with every method, and with shadows and surfaces. Sanitizers
   put other things on the stack. */
static void test_stack(void **state) {
    static check_world w;
    static stack_job job;
    size_t idle, plan, most = 0;
    int method;
    (void)state;
#ifdef SCATTERI_SANITIZED
    skip();
#endif
    open_full(&w);
    w.scene.surface = good_surface;
    w.scene.visible = always_visible;
    job.world = &w;
    idle = stack_of(&job, stack_nothing);
    for (method = SCATTER_DEPTH_AUTO; method <= SCATTER_DEPTH_MARCH; method++) {
        size_t used;
        job.quality = stored_quality();
        job.quality.depth = (scatter_depth_method)method;
        job.quality.ray = method % 2 ? SCATTER_RAY_MARCH : SCATTER_RAY_QUADRATURE;
        assert_int_equal(scatter_create(NULL, &job.context), SCATTER_OK);
        used = stack_of_calls(&job, idle);
        most = used > most ? used : most;
        scatter_destroy(job.context);
    }
    plan = stack_of(&job, stack_plan) - idle;
    printf("  stack: %.0f KB, of plans %.0f KB\n", (double)most / 1024, (double)plan / 1024);
    assert_at_most((double)plan, STACK_PROMISED);
    assert_at_most((double)most, STACK_PROMISED);
    assert_at_least((double)most, STACK_PROMISED / 2); /* the calls were made on that stack */
    assert_at_least((double)(stack_of(&job, stack_array) - idle), STACK_PROMISED);
}

/* ------------------------------------------------- >>determinism */

static void shoot_with(const check_world *w, const scatter_quality *q, int threads, int reverse,
                       picture *p) {
    check_host books;
    scatter_host host = check_host_open(&books, threads);
    scatter_context *context = NULL;
    books.reverse = reverse;
    assert_int_equal(scatter_create(&host, &context), SCATTER_OK);
    assert_int_equal(scatter_update(context, &w->scene, q), SCATTER_OK);
    assert_int_equal(shoot(context, p), SCATTER_OK);
    scatter_destroy(context);
    assert_int_equal(books.live, 0);
}

static void test_threads_change_no_bit(void **state) {
    static check_world w;
    static picture alone, together;
    static const int threads[] = {1, 2, 7};
    scatter_quality q = stored_quality();
    size_t i;
    int method;
    (void)state;
    open_full(&w);
    for (method = SCATTER_DEPTH_AUTO; method <= SCATTER_DEPTH_MARCH; method++) {
        q.depth = (scatter_depth_method)method;
        q.ray = method % 2 ? SCATTER_RAY_MARCH : SCATTER_RAY_QUADRATURE;
        shoot_with(&w, &q, 0, 0, &alone);
        for (i = 0; i < 2 * CHECK_COUNT(threads); i++) {
            shoot_with(&w, &q, threads[i / 2], (int)(i % 2), &together);
            assert_true(same_pictures(&alone, &together));
        }
    }
    w.gaussians[2].c *= 1.001f; /* the comparison can fail */
    shoot_with(&w, &q, 0, 0, &together);
    assert_false(same_pictures(&alone, &together));
}

/* ---------------------------------------------- >>what is redone */

static void change_nothing(check_world *w) { (void)w; }
static void change_colour(check_world *w) { w->lights[0].intensity.x = 9; }
static void change_radius(check_world *w) { w->lights[0].radius = 0.2f; }
static void change_position(check_world *w) { w->lights[0].position.y += 0.25f; }
static void change_cone(check_world *w) { w->lights[1].outer = 0.6f; }
static void change_aim(check_world *w) { w->lights[1].direction.x = 0.3f; }
static void change_sun(check_world *w) { w->lights[2].direction.x = 0.3f; }
static void change_all_lights(check_world *w) {
    change_position(w);
    change_sun(w);
    w->lights[1].position.z += 0.25f;
}
static void change_light_count(check_world *w) { w->scene.light_count = 2; }
static void change_new_light(check_world *w) {
    check_add_light(w, SCATTER_LIGHT_POINT, check_v3(-1, 0.3f, 0.2f), check_v3(2, 2, 2));
}
static void change_gaussian(check_world *w) { w->gaussians[1].center.x += 0.2f; }
static void change_gaussian_count(check_world *w) { w->scene.medium.gaussian_count = 3; }
static void change_voxels(check_world *w) {
    w->voxels[0][7] = 5;
    w->grids[0].version++;
}
static void change_bounds(check_world *w) { w->scene.medium.bounds.min.x = 0.1f; }
static void change_albedo(check_world *w) { w->scene.medium.albedo.x = 0.3f; }
static void change_extinction(check_world *w) { w->scene.medium.extinction.x = 2.0f; }
static void change_emission(check_world *w) { w->scene.medium.emission.z = 0.2f; }
static void change_phase(check_world *w) { w->scene.medium.phase.g = -0.3f; }
static void change_background(check_world *w) { w->scene.background.x = 0.5f; }

typedef struct change {
    const char *name;
    void (*apply)(check_world *);
    unsigned injections, propagations;
} change;

static const change changes[] = {
    {"nothing", change_nothing, 0, 0},
    {"colour of a light", change_colour, 0, 0},
    {"radius of a lamp", change_radius, 0, 0},
    {"position of a light", change_position, 0, 1},
    {"cone of a spot", change_cone, 0, 0},
    {"aim of a spot", change_aim, 0, 0},
    {"direction of a sun", change_sun, 0, 1},
    {"all lights", change_all_lights, 0, 3},
    {"a light less", change_light_count, 0, 0},
    {"a light more", change_new_light, 0, 1},
    {"a Gaussian moved", change_gaussian, 1, 3},
    {"a Gaussian less", change_gaussian_count, 1, 3},
    {"voxels", change_voxels, 1, 3},
    {"bounds", change_bounds, 1, 3},
    {"albedo", change_albedo, 0, 0},
    {"extinction", change_extinction, 0, 0},
    {"emission", change_emission, 0, 0},
    {"phase function", change_phase, 0, 0},
    {"background", change_background, 0, 0},
};

/* After the change the counters have moved as they must, and the picture is that of a fresh
 * context. */
static int redoes(const change *c, scatter_quality q, unsigned injections, unsigned propagations) {
    static check_world w;
    static picture updated, fresh;
    check_host books;
    scatter_context *context;
    scatter_stats before, after;
    open_full(&w);
    context = open_logged(&books, &w, &q);
    assert_int_equal(shoot(context, &updated), SCATTER_OK);
    before = scatter_get_stats(context);
    c->apply(&w);
    assert_int_equal(scatter_update(context, &w.scene, &q), SCATTER_OK);
    assert_int_equal(shoot(context, &updated), SCATTER_OK);
    after = scatter_get_stats(context);
    scatter_destroy(context);
    shoot_fresh(&w, &q, &fresh);
    if (same_pictures(&updated, &fresh) && after.injections - before.injections == injections &&
        after.propagations - before.propagations == propagations)
        return 1;
    fprintf(stderr, "%s: %u injections (%u), %u propagations (%u), pictures %s\n", c->name,
            after.injections - before.injections, injections,
            after.propagations - before.propagations, propagations,
            same_pictures(&updated, &fresh) ? "equal" : "differ");
    return 0;
}

static void test_only_what_changed_is_redone(void **state) {
    size_t i;
    int bad = 0;
    (void)state;
    for (i = 0; i < CHECK_COUNT(changes); i++)
        bad +=
            !redoes(&changes[i], stored_quality(), changes[i].injections, changes[i].propagations);
    assert_int_equal(bad, 0);
    fprintf(stderr, "the next line is the check at work on a planted fault:\n");
    assert_false(redoes(&changes[3], stored_quality(), 0, 0));
}

/* A scene pays only for what it has: exact density and closed depth store nothing. */
static void test_exact_methods_store_nothing(void **state) {
    scatter_quality q = stored_quality();
    size_t i;
    int bad = 0;
    (void)state;
    q.depth = SCATTER_DEPTH_CLOSED;
    q.density = SCATTER_DENSITY_EXACT;
    for (i = 0; i < CHECK_COUNT(changes); i++)
        bad += !redoes(&changes[i], q, 0, 0);
    assert_int_equal(bad, 0);
}

/* There and back again: the first picture, bit for bit. */
static void test_changes_are_forgotten(void **state) {
    static check_world w;
    static picture first, last;
    check_host books;
    scatter_quality q = stored_quality(), fine = stored_quality();
    scatter_context *context;
    size_t i;
    (void)state;
    fine.grid = 20;
    open_full(&w);
    context = open_logged(&books, &w, &q);
    assert_int_equal(shoot(context, &first), SCATTER_OK);
    for (i = 0; i < CHECK_COUNT(changes); i++) {
        changes[i].apply(&w);
        assert_int_equal(scatter_update(context, &w.scene, i % 2 ? &fine : &q), SCATTER_OK);
    }
    open_full(&w);
    w.grids[0].version = 2;
    assert_int_equal(scatter_update(context, &w.scene, &q), SCATTER_OK);
    assert_int_equal(shoot(context, &last), SCATTER_OK);
    assert_true(same_pictures(&first, &last));
    scatter_destroy(context);
    assert_int_equal(books.live, 0);
}

/* The scene is copied: what the host does to its arrays afterwards (voxels apart) changes nothing.
 */
static void test_scene_is_copied(void **state) {
    static check_world w;
    static picture first, last;
    check_host books;
    scatter_quality q = stored_quality();
    scatter_context *context;
    (void)state;
    q.depth = SCATTER_DEPTH_CLOSED;
    q.density = SCATTER_DENSITY_EXACT;
    open_full(&w);
    context = open_logged(&books, &w, &q);
    assert_int_equal(shoot(context, &first), SCATTER_OK);
    memset(w.gaussians, 0xff, sizeof w.gaussians);
    memset(w.heights, 0xff, sizeof w.heights);
    memset(w.grids, 0xff, sizeof w.grids);
    memset(w.lights, 0xff, sizeof w.lights);
    memset(&w.scene, 0xff, sizeof w.scene);
    assert_int_equal(shoot(context, &last), SCATTER_OK);
    assert_true(same_pictures(&first, &last));
    scatter_destroy(context);
}

/* ------------------------------------------------------ >>images */

typedef struct region {
    int x0, y0, x1, y1;
} region;

/* Renders a region of the image that is described in p, over a fresh pattern. */
static void shoot_region(const scatter_context *context, picture *p, const scatter_image *like,
                         region r) {
    scatter_view view = front_view();
    const float *color = like->color, *distance = like->distance; /* `like` may be in p */
    open_picture(p);
    p->image.color = color;
    p->image.distance = distance;
    p->image.x0 = r.x0;
    p->image.y0 = r.y0;
    p->image.x1 = r.x1;
    p->image.y1 = r.y1;
    assert_int_equal(scatter_render(context, &view, &p->image), SCATTER_OK);
}

/* A region holds the pixels of the whole image, and nothing else is touched. */
static int region_matches(const scatter_context *context, const picture *whole, region r) {
    static picture part, clean;
    int x, y;
    open_picture(&clean);
    shoot_region(context, &part, &whole->image, r);
    for (y = 0; y < HEIGHT; y++)
        for (x = 0; x < WIDTH; x++) {
            const picture *wanted = x >= r.x0 && x < r.x1 && y >= r.y0 && y < r.y1 ? whole : &clean;
            size_t i = (size_t)(3 * (y * WIDTH + x));
            if (memcmp(&part.rgb[i], &wanted->rgb[i], 3 * sizeof(float)) != 0 ||
                memcmp(&part.transmittance[i], &wanted->transmittance[i], 3 * sizeof(float)) != 0)
                return 0;
        }
    return 1;
}

static region random_region(uint64_t *seed) {
    region r;
    r.x0 = (int)(check_bits(seed) % WIDTH);
    r.y0 = (int)(check_bits(seed) % HEIGHT);
    r.x1 = r.x0 + 1 + (int)(check_bits(seed) % (uint64_t)(WIDTH - r.x0));
    r.y1 = r.y0 + 1 + (int)(check_bits(seed) % (uint64_t)(HEIGHT - r.y0));
    return r;
}

/* A host's picture with a depth for each pixel, some of which end no ray. */
static void host_picture(float *color, float *distance) {
    static const float odd[] = {NAN, INFINITY, 0.0f, -1.0f, -INFINITY};
    uint64_t seed = 6;
    int i;
    for (i = 0; i < WIDTH * HEIGHT; i++) {
        scatter_vec3 c = check_point(&seed, 0, 3);
        color[3 * i] = c.x;
        color[3 * i + 1] = c.y;
        color[3 * i + 2] = c.z;
        distance[i] = i % 3 ? check_uniform(&seed, 0.5f, 5.0f) : odd[i % 5];
    }
}

/* Bit for bit, with and without a host's picture: no ray depends on the rays that are computed
 * beside it. */
static void test_regions(void **state) {
    static check_world w;
    static picture whole;
    static float color[FLOATS], distance[WIDTH * HEIGHT];
    static const region all = {0, 0, WIDTH, HEIGHT}, last = {WIDTH - 1, HEIGHT - 1, WIDTH, HEIGHT};
    check_host books;
    scatter_quality q = stored_quality();
    scatter_context *context;
    uint64_t seed = 5;
    int i, composed;
    (void)state;
    open_full(&w);
    host_picture(color, distance);
    context = open_logged(&books, &w, &q);
    for (composed = 0; composed < 2; composed++) {
        open_picture(&whole);
        whole.image.color = composed ? color : NULL;
        whole.image.distance = composed ? distance : NULL;
        shoot_region(context, &whole, &whole.image, all);
        assert_true(region_matches(context, &whole, all));
        assert_true(region_matches(context, &whole, last));
        for (i = 0; i < 20; i++)
            assert_true(region_matches(context, &whole, random_region(&seed)));
    }
    whole.rgb[3 * (7 * WIDTH + 5)] += 0.25f; /* the check can fail */
    assert_false(region_matches(context, &whole, all));
    scatter_destroy(context);
}

/* The pixel is the ray through its centre. 1e-6: a ray of an image may be computed beside others.
 */
static void test_pixels_are_rays(void **state) {
    static check_world w;
    static picture p;
    check_host books;
    scatter_quality q = stored_quality();
    scatter_context *context;
    scatter_view view = front_view();
    int x, y;
    (void)state;
    q.density = SCATTER_DENSITY_EXACT;
    q.nodes = 32; /* a ray alone and in a packet take different nodes: their error must not show */
    open_smooth(&w);
    context = open_logged(&books, &w, &q);
    assert_int_equal(shoot(context, &p), SCATTER_OK);
    for (y = 0; y < HEIGHT; y++)
        for (x = 0; x < WIDTH; x++) {
            scatter_ray r =
                scatter_view_ray(&view, ((float)x + 0.5f) / WIDTH, ((float)y + 0.5f) / HEIGHT);
            const float *rgb = &p.rgb[3 * (y * WIDTH + x)],
                        *t = &p.transmittance[3 * (y * WIDTH + x)];
            scatter_sample s;
            assert_int_equal(scatter_radiance(context, &r, NULL, &s), SCATTER_OK);
            assert_at_most(fabsf(s.transmittance.y - t[1]), 1e-5);
            assert_at_most(fabsf(s.radiance.y + s.transmittance.y * s.surface.y - rgb[1]),
                           1e-5 * rgb[1]);
        }
    scatter_destroy(context);
}

/* What pixel i of the host's picture must become: L + T color. */
static double composed(const scatter_context *context, int i, float distance, float color) {
    scatter_view view = front_view();
    scatter_ray r = scatter_view_ray(&view, ((float)(i % WIDTH) + 0.5f) / WIDTH,
                                     ((float)(i / WIDTH) + 0.5f) / HEIGHT);
    scatter_surface hit = {0, {0, 0, -1}, {0, 0, 0}, {0, 0, 0}, 0};
    scatter_sample s;
    int ends = distance > 0 && isfinite(distance);
    hit.distance = distance;
    if (scatter_radiance(context, &r, ends ? &hit : NULL, &s) != SCATTER_OK)
        return NAN;
    return s.radiance.z + (double)s.transmittance.z * color;
}

static void test_composite(void **state) {
    static check_world w;
    static picture p;
    static float color[FLOATS], distance[WIDTH * HEIGHT];
    check_host books;
    scatter_quality q = stored_quality();
    scatter_context *context;
    scatter_view view = front_view();
    int i;
    (void)state;
    q.density = SCATTER_DENSITY_EXACT;
    q.nodes = 32; /* a ray alone and in a packet take different nodes: their error must not show */
    open_smooth(&w);
    host_picture(color, distance);
    context = open_logged(&books, &w, &q);
    open_picture(&p);
    p.image.color = color;
    p.image.distance = distance;
    assert_int_equal(scatter_render(context, &view, &p.image), SCATTER_OK);
    for (i = 0; i < WIDTH * HEIGHT; i++) {
        double truth = composed(context, i, distance[i], color[3 * i + 2]);
        assert_at_most(fabs(p.rgb[3 * i + 2] / truth - 1), 1e-5);
        assert_at_least(fabs(p.rgb[3 * i + 2] / composed(context, i, distance[i], 9) - 1), 1e-5);
    }
    scatter_destroy(context);
}

/* A NaN in the host's picture stays where it was. */
static void test_composite_bad_pixel(void **state) {
    static check_world w;
    static picture p;
    static float color[FLOATS], distance[WIDTH * HEIGHT];
    check_host books;
    scatter_quality q = stored_quality();
    scatter_context *context;
    scatter_view view = front_view();
    int i, bad = 0;
    (void)state;
    open_full(&w);
    host_picture(color, distance);
    color[3 * 100] = NAN;
    context = open_logged(&books, &w, &q);
    open_picture(&p);
    p.image.color = color;
    p.image.distance = distance;
    assert_int_equal(scatter_render(context, &view, &p.image), SCATTER_OK);
    for (i = 0; i < FLOATS; i++)
        bad += i != 3 * 100 && !isfinite(p.rgb[i]);
    scatter_destroy(context);
    assert_int_equal(bad, 0);
}

/* Composing in place: `color` and `rgb` may be one array. */
static void test_composite_in_place(void **state) {
    static check_world w;
    static picture p;
    static float color[FLOATS], distance[WIDTH * HEIGHT];
    check_host books;
    scatter_quality q = stored_quality();
    scatter_context *context;
    scatter_view view = front_view();
    (void)state;
    open_full(&w);
    host_picture(color, distance);
    context = open_logged(&books, &w, &q);
    open_picture(&p);
    p.image.color = color;
    p.image.distance = distance;
    assert_int_equal(scatter_render(context, &view, &p.image), SCATTER_OK);
    p.image.rgb = color;
    assert_int_equal(scatter_render(context, &view, &p.image), SCATTER_OK);
    assert_true(memcmp(color, p.rgb, sizeof color) == 0);
    scatter_destroy(context);
}

/* ---------------------------------------------------- >>progress */

/* Renders or updates with the report `cancel_at` cancelling; the result of the call. */
static scatter_result with_progress(int rendering, int cancel_at, check_host *books) {
    static check_world w;
    static picture p, again, fresh;
    scatter_host host = check_host_open(books, 2);
    scatter_quality q = stored_quality();
    scatter_context *context = NULL;
    scatter_result result = SCATTER_OK;
    host.progress = check_progress;
    open_full(&w);
    assert_int_equal(scatter_create(&host, &context), SCATTER_OK);
    books->cancel_at = rendering ? 0 : cancel_at;
    result = scatter_update(context, &w.scene, &q);
    if (rendering) {
        books->reports = books->backward = books->outside = 0;
        books->fraction = 0;
        books->cancel_at = cancel_at;
        result = shoot(context, &p);
    }
    books->cancel_at = 0;
    assert_at_most(books->sentences, 1);
    if (result == SCATTER_CANCELLED && !rendering)
        assert_true(shoot(context, &p) != SCATTER_OK);
    assert_int_equal(scatter_update(context, &w.scene, &q), SCATTER_OK);
    assert_int_equal(shoot(context, &again), SCATTER_OK);
    scatter_destroy(context);
    assert_int_equal(books->live, 0);
    shoot_fresh(&w, &q, &fresh);
    assert_true(same_pictures(&again, &fresh));
    return result;
}

static void test_progress(void **state) {
    check_host books;
    int rendering, n;
    (void)state;
    for (rendering = 0; rendering < 2; rendering++) {
        for (n = 1; with_progress(rendering, n, &books) == SCATTER_CANCELLED; n++)
            assert_true(n < 10000);
        assert_true(n > 1); /* it reported, and was cancelled */
    }
}

/* Fractions from 0 to 1, never backwards, on the thread that called. */
static void test_progress_is_monotone(void **state) {
    static check_world w;
    static picture p;
    check_host books;
    scatter_host host = check_host_open(&books, 2);
    scatter_quality q = stored_quality();
    scatter_context *context = NULL;
    (void)state;
    host.progress = check_progress;
    open_full(&w);
    assert_int_equal(scatter_create(&host, &context), SCATTER_OK);
    assert_int_equal(scatter_update(context, &w.scene, &q), SCATTER_OK);
    assert_true(books.reports > 0 && books.fraction <= 1);
    assert_int_equal(books.backward + books.outside + books.foreign, 0);
    books.fraction = 0;
    books.reports = 0;
    assert_int_equal(shoot(context, &p), SCATTER_OK);
    assert_true(books.reports > 0 && books.fraction > 0.5f);
    assert_int_equal(books.backward + books.outside + books.foreign, 0);
    scatter_destroy(context);
    check_progress(&books, 0.1f); /* the check can fail */
    check_progress(&books, 1.1f);
    assert_true(books.backward == 1 && books.outside == 1);
}

/* ------------------------------------------------------- >>views */

static double angle_between(scatter_vec3 a, scatter_vec3 b) {
    double cosine = check_dot(a, b) / sqrt(check_dot(a, a) * check_dot(b, b));
    return acos(fmin(1, fmax(-1, cosine)));
}

static void test_perspective(void **state) {
    scatter_vec3 eye = check_v3(1, 2, 3), target = check_v3(1, 2, 13);
    scatter_view v = scatter_view_perspective(eye, target, check_v3(0, 5, 0), 0.8f, 1.5f);
    scatter_ray middle = scatter_view_ray(&v, 0.5f, 0.5f), top = scatter_view_ray(&v, 0.5f, 0);
    scatter_ray left = scatter_view_ray(&v, 0, 0.5f), right = scatter_view_ray(&v, 1, 0.5f);
    (void)state;
    assert_at_most(check_distance(middle.origin, eye), 1e-6);
    assert_at_most(check_distance(left.origin, eye), 1e-6);
    assert_at_most(angle_between(middle.direction, check_v3(0, 0, 1)), 1e-6);
    /* acos near 1 turns 1e-7 into 4e-4; at 0.4 and 0.56 it is harmless */
    assert_at_most(fabs(angle_between(middle.direction, top.direction) - 0.4), 1e-5);
    assert_at_most(fabs(tan(angle_between(middle.direction, left.direction)) - 1.5 * tan(0.4)),
                   1e-5);
    assert_true(top.direction.y > 0);                           /* row 0 is the top */
    assert_true(left.direction.x > 0 && right.direction.x < 0); /* right is forward x up = -x */
    assert_at_most(fabs(right.direction.y / right.direction.z), 1e-6);
}

static void test_orthographic(void **state) {
    scatter_vec3 eye = check_v3(0, 0, -4);
    scatter_view v =
        scatter_view_orthographic(eye, check_v3(0, 0, 0), check_v3(0, 1, 0), 3.0f, 2.0f);
    scatter_ray a = scatter_view_ray(&v, 0, 0), b = scatter_view_ray(&v, 1, 1);
    (void)state;
    assert_at_most(check_distance(a.origin, check_v3(3, 1.5f, -4)),
                   1e-5); /* left is +x, top is +y */
    assert_at_most(check_distance(b.origin, check_v3(-3, -1.5f, -4)), 1e-5);
    assert_at_most(angle_between(a.direction, b.direction), 1e-6);
    assert_at_most(angle_between(a.direction, check_v3(0, 0, 1)), 1e-6);
}

/* -------------------------------------------------------- >>tone */

static double luminance(const float *rgb) {
    return 0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2];
}

/* Reinhard's operator at work: key/average scales, L (1 + L/white^2) / (1 + L) compresses. */
static void test_tone_values(void **state) {
    scatter_tone tone = {0.36f, 0.0f, 2.0f};
    float in[6] = {2, 2, 2, 0, 0, 0}, out[6];
    (void)state;
    scatter_tone_map(&tone, in, 2, out);
    assert_at_most(fabs(out[0] - 0.36 / 1.36), 1e-6); /* the average becomes the key, compressed */
    assert_true(out[3] == 0 && out[4] == 0 && out[5] == 0);
    tone.white = 0.36f;
    scatter_tone_map(&tone, in, 2, out);
    assert_at_most(fabs(out[1] - 1), 1e-6); /* `white` becomes 1 */
    tone.key = 0;
    tone.white = 0;
    scatter_tone_map(&tone, in, 1, out);
    assert_at_most(fabs(out[2] - 0.18 / 1.18), 1e-6); /* 0: 0.18 */
}

/* Brighter stays brighter, hue stays, results stay below 1, and one array will do. */
static void test_tone_properties(void **state) {
    scatter_tone tone = {0, 0, 1.0f};
    float in[300], out[300], last = 0;
    int i;
    (void)state;
    for (i = 0; i < 100; i++) {
        float v = expf(0.2f * (float)(i - 50));
        in[3 * i] = v;
        in[3 * i + 1] = 0.5f * v;
        in[3 * i + 2] = 0.25f * v;
    }
    scatter_tone_map(&tone, in, 100, out);
    for (i = 0; i < 100; i++) {
        assert_true(out[3 * i] > last);
        assert_at_most(luminance(&out[3 * i]), 1);
        assert_at_most(fabs(out[3 * i + 1] / out[3 * i] - 0.5), 1e-6);
        assert_at_most(fabs(out[3 * i + 2] / out[3 * i] - 0.25), 1e-6);
        last = out[3 * i];
    }
    scatter_tone_map(&tone, in, 100, in);
    assert_true(memcmp(in, out, sizeof in) == 0);
}

/* log_average 0 takes it from the image. */
static void test_tone_average(void **state) {
    scatter_tone tone = {0, 0, 0};
    float in[9] = {1, 1, 1, 4, 4, 4, 0, 0, 0}, a[9], b[9];
    (void)state;
    scatter_tone_map(&tone, in, 3, a);
    tone.log_average = 2.0f;
    scatter_tone_map(&tone, in, 3, b);
    assert_at_most(fabs(a[0] / b[0] - 1), 1e-5);
    assert_at_most(fabs(a[3] / b[3] - 1), 1e-5);
}

static void test_log_average(void **state) {
    float grey[6] = {1, 1, 1, 4, 4, 4}, dark[9] = {0, 0, 0, 3, 3, 3, -1, -1, -1}, bad[6];
    (void)state;
    assert_at_most(fabs(scatter_log_average(grey, 2) - 2), 1e-5);
    assert_at_most(fabs(scatter_log_average(grey, 1) - 1), 1e-6);
    assert_at_most(fabs(scatter_log_average(dark, 3) - 3), 1e-5); /* black pixels do not count */
    assert_true(scatter_log_average(dark, 1) == 0);
    assert_true(scatter_log_average(grey, 0) == 0);
    bad[0] = bad[1] = bad[2] = NAN;
    bad[3] = bad[4] = bad[5] = 2;
    assert_at_most(fabs(scatter_log_average(bad, 2) - 2), 1e-5); /* nor do bad ones */
}

/* A bad pixel does not spread, with its own average or a given one. */
static void test_tone_bad_pixels(void **state) {
    scatter_tone tone = {0, 0, 0};
    float in[9] = {1, 1, 1, NAN, 1, 1, 2, 2, 2}, out[9];
    (void)state;
    scatter_tone_map(&tone, in, 3, out);
    assert_true(out[0] > 0 && out[0] < 1 && out[6] > out[0] && out[6] < 1);
    in[3] = INFINITY;
    scatter_tone_map(&tone, in, 3, out);
    assert_true(out[0] >= 0 && out[0] < 1 && out[6] >= out[0] && out[6] < 1);
}

/* IEC 61966-2-1: every byte comes back from its own linear value. */
static void test_srgb(void **state) {
    int i, last = 0;
    (void)state;
    for (i = 0; i < 256; i++) {
        double s = i / 255.0, linear = s <= 0.04045 ? s / 12.92 : pow((s + 0.055) / 1.055, 2.4);
        assert_int_equal(scatter_srgb8((float)linear), i);
    }
    for (i = 0; i <= 10000; i++) {
        int byte = scatter_srgb8((float)i / 10000.0f);
        assert_true(byte >= last);
        last = byte;
    }
    assert_int_equal(scatter_srgb8(NAN), 0);
    assert_int_equal(scatter_srgb8(-1.0f), 0);
    assert_int_equal(scatter_srgb8(-INFINITY), 0);
    assert_int_equal(scatter_srgb8(2.0f), 255);
    assert_int_equal(scatter_srgb8(INFINITY), 255);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_bad_numbers),
        cmocka_unit_test(test_bad_phase),
        cmocka_unit_test(test_bad_scenes),
        cmocka_unit_test(test_refusals_can_fail),
        cmocka_unit_test(test_unused_fields),
        cmocka_unit_test(test_bad_quality),
        cmocka_unit_test(test_quality_limits),
        cmocka_unit_test(test_bad_images),
        cmocka_unit_test(test_bad_rays),
        cmocka_unit_test(test_bad_volumes),
        cmocka_unit_test(test_bad_sources),
        cmocka_unit_test(test_null_arguments),
        cmocka_unit_test(test_render_before_update),
        cmocka_unit_test(test_extreme_numbers),
        cmocka_unit_test(test_bad_values_stay),
        cmocka_unit_test(test_normals_of_any_length),
        cmocka_unit_test(test_view_without_direction),
        cmocka_unit_test(test_denormal_directions),
        cmocka_unit_test(test_allocation_fails_in_update),
        cmocka_unit_test(test_allocation_fails_in_create),
        cmocka_unit_test(test_allocation_fails_in_depth),
        cmocka_unit_test(test_frames_do_not_allocate),
        cmocka_unit_test(test_stack),
        cmocka_unit_test(test_threads_change_no_bit),
        cmocka_unit_test(test_only_what_changed_is_redone),
        cmocka_unit_test(test_exact_methods_store_nothing),
        cmocka_unit_test(test_changes_are_forgotten),
        cmocka_unit_test(test_scene_is_copied),
        cmocka_unit_test(test_regions),
        cmocka_unit_test(test_pixels_are_rays),
        cmocka_unit_test(test_composite),
        cmocka_unit_test(test_composite_bad_pixel),
        cmocka_unit_test(test_composite_in_place),
        cmocka_unit_test(test_progress),
        cmocka_unit_test(test_progress_is_monotone),
        cmocka_unit_test(test_perspective),
        cmocka_unit_test(test_orthographic),
        cmocka_unit_test(test_tone_values),
        cmocka_unit_test(test_tone_properties),
        cmocka_unit_test(test_tone_average),
        cmocka_unit_test(test_log_average),
        cmocka_unit_test(test_tone_bad_pixels),
        cmocka_unit_test(test_srgb),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
