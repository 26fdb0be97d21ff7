/* test_depth.c - the optical depth from a source, by every method of scatter.h: errors, convergence
   orders, awkward sources. The magnitudes asserted are those that the project measured for the
   methods in double precision before it was written (16 random Gaussians in the unit cube). */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#define SCATTER_IMPLEMENTATION
#include "../scatter.h"
#include "check.h"
#include "reference.h"

#define POINTS 4096

typedef struct method {
    const char *name;
    scatter_depth_method id;
    double at_32; /* twice the relative RMS error measured for 32 cells: room for other Gaussians
                     and lights */
} method;

static const method methods[] = {
    {"closed", SCATTER_DEPTH_CLOSED, 1e-5}, {"closed volume", SCATTER_DEPTH_CLOSED_VOLUME, 0.006},
    {"eq6", SCATTER_DEPTH_EQ6, 1.10},       {"upwind", SCATTER_DEPTH_UPWIND, 0.26},
    {"short", SCATTER_DEPTH_SHORT, 0.106},  {"polar", SCATTER_DEPTH_POLAR, 0.076},
    {"march", SCATTER_DEPTH_MARCH, 0.0174},
};

/* The medium of the measurements: 16 Gaussians, a = 4..12, in the unit cube. */
static const scatter_medium *open_cloud(check_world *w, uint64_t seed) {
    check_world_open(w);
    check_add_gaussians(w, 16, 4.0f, 12.0f, seed);
    check_bound(w, check_cube(0.0f, 1.0f));
    return &w->scene.medium;
}

static scatter_source point_source(float x, float y, float z) {
    scatter_source s = {0, {0, 0, 0}, {0, 0, 0}};
    s.position = check_v3(x, y, z);
    return s;
}

static scatter_source sun(float x, float y, float z) {
    scatter_source s = {1, {0, 0, 0}, {0, 0, 0}};
    s.direction = check_v3(x, y, z);
    return s;
}

/* ----------------------------------------------------------------------------- >>the error of a
 * method */

typedef struct trial {
    const scatter_medium *medium;
    scatter_source source;
    scatter_vec3 points[POINTS];
    double truth[POINTS];
} trial;

/* Points anywhere in low..high, so that the reading between cells counts, and the true depths. */
static void open_trial(trial *t, const scatter_medium *m, scatter_source source, float low,
                       float high) {
    uint64_t seed = 7;
    int i;
    t->medium = m;
    t->source = source;
    for (i = 0; i < POINTS; i++) {
        t->points[i] = check_point(&seed, low, high);
        t->truth[i] = reference_source_depth(m, &source, t->points[i]);
    }
}

static scatter_quality quality_of(scatter_depth_method id, int grid) {
    scatter_quality q;
    memset(&q, 0, sizeof q);
    q.depth = id;
    q.grid = grid;
    return q;
}

/* Relative RMS error of a method on n^3 cells; NaN if it fails. */
static double error_of(const trial *t, scatter_depth_method id, int n) {
    scatter_quality q = quality_of(id, n);
    scatter_depth *depth = NULL;
    check_error e = {0, 0, 0, 0};
    int i;
    if (scatter_depth_create(NULL, &depth) != SCATTER_OK)
        return NAN;
    if (scatter_depth_update(depth, t->medium, &t->source, &q) == SCATTER_OK)
        for (i = 0; i < POINTS; i++)
            check_add(&e, scatter_depth_at(depth, t->points[i]), t->truth[i]);
    scatter_depth_destroy(depth);
    return check_rms(&e); /* 0/0 if nothing was added */
}

typedef struct ladder {
    double at_16, at_32, at_64;
} ladder;

static ladder climb(const trial *t, const method *m) {
    ladder e;
    e.at_16 = error_of(t, m->id, 16);
    e.at_32 = error_of(t, m->id, 32);
    e.at_64 = error_of(t, m->id, 64);
    printf("  %-13s %9.5f %9.5f %9.5f   order %.2f\n", m->name, e.at_16, e.at_32, e.at_64,
           check_order(e.at_16, e.at_64) / 2);
    return e;
}

/* ----------------------------------------------------------------------------- >>orders */

/* Mean order over two doublings. */
static double order_of(ladder e) { return check_order(e.at_16, e.at_64) / 2; }

static int is_second_order(ladder e) { return order_of(e) >= 1.7 && e.at_64 < e.at_32; }

static int is_first_order(ladder e) { return order_of(e) >= 0.7 && order_of(e) <= 1.3; }

/* An error floor: large, and the same on the finer grid. */
static int is_inconsistent(ladder e) { return e.at_64 > 0.3 && fabs(e.at_64 / e.at_32 - 1) < 0.2; }

static void assert_orders(const trial *t) {
    ladder closed_volume = climb(t, &methods[1]), eq6 = climb(t, &methods[2]);
    ladder upwind = climb(t, &methods[3]), diagonal = climb(t, &methods[4]);
    ladder polar = climb(t, &methods[5]), march = climb(t, &methods[6]);
    assert_true(is_second_order(closed_volume));
    assert_true(is_second_order(polar));
    assert_at_least(order_of(march), 1.7);
    assert_at_most(order_of(march), 2.6);
    assert_true(is_first_order(upwind));
    assert_at_least(order_of(diagonal), 0.8); /* measured 1 to 1.2 */
    assert_true(is_inconsistent(eq6));
    assert_at_most(closed_volume.at_64, 0.001);
    assert_at_most(polar.at_64, 0.01);
    /* what the methods cost in accuracy orders them */
    assert_true(closed_volume.at_64 < polar.at_64 && polar.at_64 < diagonal.at_64);
    assert_true(diagonal.at_64 < upwind.at_64 && upwind.at_64 < eq6.at_64);
    /* the checks can fail: no method passes for another */
    assert_false(is_second_order(upwind) || is_second_order(eq6) || is_second_order(diagonal));
    assert_false(is_first_order(polar) || is_first_order(eq6));
    assert_false(is_inconsistent(upwind) || is_inconsistent(polar));
}

static void test_orders_light_outside(void **state) {
    static trial t;
    check_world w;
    (void)state;
    open_trial(&t, open_cloud(&w, 1), point_source(1.4f, 1.3f, -0.5f), 0.0f, 1.0f);
    assert_orders(&t);
}

static void test_orders_light_inside(void **state) {
    static trial t;
    check_world w;
    (void)state;
    open_trial(&t, open_cloud(&w, 2), point_source(0.41f, 0.57f, 0.36f), 0.0f, 1.0f);
    assert_orders(&t);
}

static void test_orders_sun(void **state) {
    static trial t;
    check_world w;
    (void)state;
    open_trial(&t, open_cloud(&w, 3), sun(-0.4f, -1.0f, 0.3f), 0.0f, 1.0f);
    assert_orders(&t);
}

/* ----------------------------------------------------------------------------- >>closed form */

static void test_closed_is_exact(void **state) {
    static trial t;
    check_world w;
    uint64_t seed = 5;
    int i;
    (void)state;
    for (i = 0; i < 8; i++) {
        scatter_vec3 s = check_point(&seed, -1.0f, 2.0f);
        open_trial(&t, open_cloud(&w, (uint64_t)i + 10), point_source(s.x, s.y, s.z), -0.5f, 1.5f);
        assert_at_most(error_of(&t, SCATTER_DEPTH_CLOSED, 16), 1e-5);
    }
}

/* Automatic is closed for few Gaussians and polar for many, by value. */
static void test_automatic(void **state) {
    static trial t;
    check_world w;
    (void)state;
    open_trial(&t, open_cloud(&w, 1), point_source(1.4f, 1.3f, -0.5f), 0.0f, 1.0f);
    assert_true(error_of(&t, SCATTER_DEPTH_AUTO, 32) == error_of(&t, SCATTER_DEPTH_CLOSED, 32));
    check_add_gaussians(&w, 9, 4.0f, 12.0f, 99); /* 25 */
    open_trial(&t, &w.scene.medium, point_source(1.4f, 1.3f, -0.5f), 0.0f, 1.0f);
    assert_true(error_of(&t, SCATTER_DEPTH_AUTO, 32) == error_of(&t, SCATTER_DEPTH_POLAR, 32));
}

/* ----------------------------------------------------------------------------- >>eq6 and its
 * consistent form */

/* One voxel of density 1 over the cube, the light in a corner: what upwind sees is the distance,
   what eq. 6 as printed sees is the distance along the axes. Distances are relative to cells of
   1/n. */
static void constant_cube_errors(scatter_depth_method id, int n, double *euclid,
                                 double *manhattan) {
    scatter_source s = point_source(0, 0, 0);
    scatter_quality q = quality_of(id, n);
    scatter_depth *depth = NULL;
    check_error straight = {0, 0, 0, 0}, axes = {0, 0, 0, 0};
    check_world w;
    uint64_t seed = 3;
    int i;
    check_world_open(&w);
    check_add_grid(&w, 1, 1, 1, check_cube(0, 1), 1);
    w.voxels[0][0] = 1.0f;
    assert_int_equal(scatter_depth_create(NULL, &depth), SCATTER_OK);
    assert_int_equal(scatter_depth_update(depth, &w.scene.medium, &s, &q), SCATTER_OK);
    for (i = 0; i < POINTS; i++) {
        scatter_vec3 x = check_point(&seed, 0.1f, 1.0f);
        double tau = scatter_depth_at(depth, x);
        check_add(&straight, tau, check_distance(x, s.position));
        check_add(&axes, tau, (double)x.x + x.y + x.z);
    }
    scatter_depth_destroy(depth);
    *euclid = check_rms(&straight);
    *manhattan = check_rms(&axes);
}

static void test_manhattan(void **state) {
    double euclid_32, euclid_64, manhattan_32, manhattan_64;
    (void)state;
    constant_cube_errors(SCATTER_DEPTH_EQ6, 64, &euclid_64, &manhattan_64);
    /* one cell more or less at the light, of a mean length of 1.65: 1/64/1.65 = 1 %, twice for the
     * reading */
    assert_at_most(manhattan_64, 0.02);
    assert_at_least(euclid_64, 0.4); /* (sqrt(3)+...)/... : about 50 % too deep */
    constant_cube_errors(SCATTER_DEPTH_UPWIND, 32, &euclid_32, &manhattan_32);
    constant_cube_errors(SCATTER_DEPTH_UPWIND, 64, &euclid_64, &manhattan_64);
    assert_at_most(euclid_64, 0.03);
    assert_at_most(euclid_64 / euclid_32, 0.62); /* first order: 2^-0.7 */
    assert_at_least(manhattan_64, 0.3);
}

/* ----------------------------------------------------------------------------- >>awkward sources
 */

static void assert_source_works(const scatter_medium *m, scatter_source s) {
    static trial t;
    size_t i;
    open_trial(&t, m, s, 0.0f, 1.0f);
    for (i = 0; i < CHECK_COUNT(methods); i++)
        if (!check_at_most(methods[i].name, error_of(&t, methods[i].id, 32), methods[i].at_32))
            assert_true(0);
}

static void test_source_on_cell(void **state) {
    check_world w;
    const scatter_medium *m = open_cloud(&w, 4);
    (void)state;
    assert_source_works(m, point_source(16.5f / 32, 9.5f / 32, 20.5f / 32)); /* centre */
    assert_source_works(m, point_source(0.5f, 0.5f, 0.5f));            /* corner of eight cells */
    assert_source_works(m, point_source(0.5f, 9.5f / 32, 20.5f / 32)); /* face */
}

static void test_source_on_gaussian(void **state) {
    check_world w;
    const scatter_medium *m = open_cloud(&w, 5);
    scatter_vec3 b = w.gaussians[3].center;
    (void)state;
    assert_source_works(m, point_source(b.x, b.y, b.z));
}

static void test_source_on_boundary(void **state) {
    check_world w;
    const scatter_medium *m = open_cloud(&w, 6);
    (void)state;
    assert_source_works(m, point_source(0.0f, 0.4f, 0.6f)); /* face */
    assert_source_works(m, point_source(0.0f, 1.0f, 0.6f)); /* edge */
    assert_source_works(m, point_source(1.0f, 0.0f, 1.0f)); /* corner */
}

static void test_sun_along_axes(void **state) {
    check_world w;
    const scatter_medium *m = open_cloud(&w, 7);
    (void)state;
    assert_source_works(m, sun(0, -1, 0));
    assert_source_works(m, sun(1, 0, 0));
    assert_source_works(m, sun(0, 3, 3)); /* in an axis plane, not of unit length */
    assert_source_works(m, sun(-1, 1, -1));
}

/* A lamp 10 km away is a sun: the direction turns by 1e-4 over a metre, and so does the depth. */
static void test_far_source(void **state) {
    static const scatter_vec3 direction = {-0.48f, -0.8f, 0.36f}; /* unit length */
    scatter_source far = point_source(0.48e4f, 0.8e4f, -0.36e4f);
    static trial t;
    check_world w;
    (void)state;
    open_trial(&t, open_cloud(&w, 8), sun(direction.x, direction.y, direction.z), 0.0f, 1.0f);
    t.source = far;
    assert_at_most(error_of(&t, SCATTER_DEPTH_CLOSED, 32), 1e-3);
    assert_source_works(t.medium, far);
}

/* ----------------------------------------------------------------------------- >>properties */

/* Depth between the source and x, or NaN. */
static double depth_between(const scatter_medium *m, scatter_source s, scatter_vec3 x,
                            scatter_depth_method id) {
    scatter_quality q = quality_of(id, 32);
    scatter_depth *depth = NULL;
    double tau = NAN;
    if (scatter_depth_create(NULL, &depth) != SCATTER_OK)
        return NAN;
    if (scatter_depth_update(depth, m, &s, &q) == SCATTER_OK)
        tau = scatter_depth_at(depth, x);
    scatter_depth_destroy(depth);
    return tau;
}

static void test_depth_at_source_is_zero(void **state) {
    check_world w;
    const scatter_medium *m = open_cloud(&w, 9);
    scatter_vec3 b = w.gaussians[0].center;
    size_t i;
    (void)state;
    for (i = 0; i < CHECK_COUNT(methods); i++) {
        scatter_vec3 cell = check_v3(0.515625f, 0.515625f, 0.515625f), out = check_v3(2, 2, 2);
        scatter_depth_method id = methods[i].id;
        assert_true(depth_between(m, point_source(cell.x, cell.y, cell.z), cell, id) == 0);
        assert_true(depth_between(m, point_source(b.x, b.y, b.z), b, id) == 0);
        assert_true(depth_between(m, point_source(2, 2, 2), out, id) == 0);
        /* where the sun's light enters there is nothing behind; a volume blurs that over its cell
         * of 1/32 */
        assert_at_most(depth_between(m, sun(0, -1, 0), check_v3(0.5f, 1, 0.5f), id), 0.1);
        assert_true(depth_between(m, sun(0, -1, 0), check_v3(0.5f, 9, 0.5f), id) == 0);
    }
}

/* The eye is one more source: T(O,X) = T(X,O), so the depth from O at X is the depth from X at O.
 */
static void test_eye_is_a_source(void **state) {
    check_world w;
    const scatter_medium *m = open_cloud(&w, 9);
    uint64_t seed = 12;
    size_t k;
    int i;
    (void)state;
    for (k = 0; k < CHECK_COUNT(methods); k++) {
        check_error e = {0, 0, 0, 0};
        for (i = 0; i < 16; i++) {
            scatter_vec3 o = check_point(&seed, 0.05f, 0.95f), x = check_point(&seed, 0.05f, 0.95f);
            double there = depth_between(m, point_source(o.x, o.y, o.z), x, methods[k].id);
            check_add(&e, there, depth_between(m, point_source(x.x, x.y, x.z), o, methods[k].id));
        }
        /* two values, each with the method's error; 16 pairs scatter more than 4096 points */
        assert_at_most(check_rms(&e), 4 * methods[k].at_32);
    }
}

/* Outside the bounds there is no medium: the depth is that of the way out. */
static void test_points_outside(void **state) {
    static trial t;
    check_world w;
    const scatter_medium *m = open_cloud(&w, 13);
    size_t i;
    (void)state;
    open_trial(&t, m, point_source(0.41f, 0.57f, 0.36f), -3.0f, 4.0f);
    for (i = 0; i < CHECK_COUNT(methods); i++)
        if (!check_at_most(methods[i].name, error_of(&t, methods[i].id, 32), methods[i].at_32))
            assert_true(0);
    open_trial(&t, m, sun(0.3f, -1.0f, 0.2f), -3.0f, 4.0f);
    for (i = 0; i < CHECK_COUNT(methods); i++)
        if (!check_at_most(methods[i].name, error_of(&t, methods[i].id, 32), methods[i].at_32))
            assert_true(0);
}

/* Unbounded Gaussians: the volume is the library's to choose, the promise is the same. */
static void test_unbounded(void **state) {
    static trial t;
    check_world w;
    size_t i;
    (void)state;
    open_cloud(&w, 14);
    w.scene.medium.bounded = 0;
    open_trial(&t, &w.scene.medium, point_source(1.4f, 1.3f, -0.5f), -1.0f, 2.0f);
    for (i = 0; i < CHECK_COUNT(methods);
         i++) /* cells are wider: the support reaches beyond the cube */
        if (!check_at_most(methods[i].name, error_of(&t, methods[i].id, 64), methods[i].at_32))
            assert_true(0);
}

/* Constant and height fog are in closed form whatever the method. */
static void test_fog_is_exact(void **state) {
    static trial t;
    check_world w;
    size_t i;
    (void)state;
    check_world_open(&w);
    w.scene.medium.constant = 0.3f;
    check_add_height(&w, 0.5f, 0.2f, 0.4f);
    open_trial(&t, &w.scene.medium, point_source(5, 4, 3), -2.0f, 2.0f);
    for (i = 0; i < CHECK_COUNT(methods); i++)
        assert_at_most(error_of(&t, methods[i].id, 8), 1e-5);
    check_bound(&w, check_cube(-1, 1));
    open_trial(&t, &w.scene.medium, sun(1, -2, 0.5f), -2.0f, 2.0f);
    for (i = 0; i < CHECK_COUNT(methods); i++)
        assert_at_most(error_of(&t, methods[i].id, 8), 1e-5);
}

/* Voxels: every method against the exact cell traversal. The grid is 8^3 random voxels, as rough as
   data get on 32^3 cells: the magnitudes of smooth Gaussians, doubled. */
static void test_voxels(void **state) {
    static trial t;
    check_world w;
    size_t i;
    (void)state;
    check_world_open(&w);
    check_add_grid(&w, 8, 8, 8, check_cube(0, 1), 15);
    open_trial(&t, &w.scene.medium, point_source(1.4f, 1.3f, -0.5f), 0.0f, 1.0f);
    for (i = 0; i < CHECK_COUNT(methods); i++)
        if (!check_at_most(methods[i].name, error_of(&t, methods[i].id, 32), 2 * methods[i].at_32))
            assert_true(0);
}

/* ----------------------------------------------------------------------------- >>updates */

/* The medium's arrays are copied: the host may free them. A second update gives what a fresh object
 * gives. */
static void test_update_copies(void **state) {
    scatter_source a = point_source(2, 2, 2), b = point_source(0.3f, 0.3f, 0.3f);
    scatter_vec3 x = check_v3(0.6f, 0.2f, 0.8f);
    size_t i;
    (void)state;
    for (i = 0; i < CHECK_COUNT(methods); i++) {
        scatter_quality q = quality_of(methods[i].id, 16);
        scatter_depth *depth = NULL;
        check_world w;
        float before, fresh = (float)depth_between(open_cloud(&w, 1), b, x, methods[i].id);
        assert_int_equal(scatter_depth_create(NULL, &depth), SCATTER_OK);
        assert_int_equal(scatter_depth_update(depth, &w.scene.medium, &a, &q), SCATTER_OK);
        before = scatter_depth_at(depth, x);
        memset(w.gaussians, 0, sizeof w.gaussians);
        assert_true(scatter_depth_at(depth, x) == before);
        q.grid = 32;
        open_cloud(&w, 1);
        assert_int_equal(scatter_depth_update(depth, &w.scene.medium, &b, &q), SCATTER_OK);
        assert_true(scatter_depth_at(depth, x) == fresh);
        scatter_depth_destroy(depth);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_orders_light_outside),
        cmocka_unit_test(test_orders_light_inside),
        cmocka_unit_test(test_orders_sun),
        cmocka_unit_test(test_closed_is_exact),
        cmocka_unit_test(test_automatic),
        cmocka_unit_test(test_manhattan),
        cmocka_unit_test(test_source_on_cell),
        cmocka_unit_test(test_source_on_gaussian),
        cmocka_unit_test(test_source_on_boundary),
        cmocka_unit_test(test_sun_along_axes),
        cmocka_unit_test(test_far_source),
        cmocka_unit_test(test_depth_at_source_is_zero),
        cmocka_unit_test(test_eye_is_a_source),
        cmocka_unit_test(test_points_outside),
        cmocka_unit_test(test_unbounded),
        cmocka_unit_test(test_fog_is_exact),
        cmocka_unit_test(test_voxels),
        cmocka_unit_test(test_update_copies),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
