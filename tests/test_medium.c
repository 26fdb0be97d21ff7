/* test_medium.c - density, optical depth, phase functions and injection of scatter.h against the
   double-precision reference and against mathematics.

   A check is a function that measures a subject; the library is one subject, and for each check
   there is a faulty one that must be caught. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#define SCATTER_IMPLEMENTATION
#include "../scatter.h"
#include "check.h"
#include "reference.h"

typedef double (*density_of)(const scatter_medium *, scatter_vec3);
typedef double (*depth_of)(const scatter_medium *, scatter_vec3, scatter_vec3);

/* ------------------------------------------------------- >>media */

static void medium_constant(check_world *w) { w->scene.medium.constant = 0.7f; }

static void medium_slab(check_world *w) {
    w->scene.medium.constant = 0.7f;
    check_bound(w, check_cube(0.125f, 0.75f));
}

static void medium_height(check_world *w) {
    check_add_height(w, 0.8f, 0.1f, 0.3f);
    check_add_height(w, 0.2f, -1.0f, 20.0f);
}

static void medium_gaussian(check_world *w) {
    check_add_gaussian(w, check_v3(0.5f, 0.25f, 0.375f), 3.0f, 1.5f);
}

static void medium_gaussians(check_world *w) { check_add_gaussians(w, 16, 4.0f, 12.0f, 1); }

static void medium_wide_and_narrow(check_world *w) {
    check_add_gaussian(w, check_v3(0.5f, 0.5f, 0.5f), 1e-3f, 0.1f);
    check_add_gaussian(w, check_v3(0.25f, 0.5f, 0.5f), 100.0f, 50.0f);
}

static void medium_voxel(check_world *w) { check_add_grid(w, 1, 1, 1, check_cube(0.0f, 1.0f), 2); }

static void medium_grid(check_world *w) {
    scatter_box box = check_cube(-0.25f, 1.25f);
    box.max.y = 0.75f;
    check_add_grid(w, 7, 5, 3, box, 3)->scale = 2.5f;
}

/* Voxel centres at odd, faces at even multiples of 1/16. */
static void medium_lattice(check_world *w) {
    check_add_grid(w, 8, 8, 8, check_cube(0.0f, 1.0f), 8);
}

static void medium_needle(check_world *w) {
    check_add_grid(w, 2, 1, 300, check_cube(0.0f, 1.0f), 4);
}

static void medium_mix(check_world *w) {
    w->scene.medium.constant = 0.05f;
    check_add_height(w, 0.2f, 0.5f, 0.5f);
    check_add_gaussians(w, 5, 1.0f, 6.0f, 5);
    check_add_grid(w, 8, 8, 8, check_cube(0.25f, 1.5f), 6);
    check_add_grid(w, 3, 9, 4, check_cube(-0.5f, 0.5f), 7);
}

static void medium_bounded_mix(check_world *w) {
    medium_mix(w);
    check_bound(w, check_cube(0.125f, 0.875f));
}

static void medium_empty(check_world *w) { (void)w; }

typedef struct medium_case {
    const char *name;
    void (*build)(check_world *);
} medium_case;

static const medium_case media[] = {
    {"empty", medium_empty},
    {"constant", medium_constant},
    {"slab", medium_slab},
    {"height", medium_height},
    {"gaussian", medium_gaussian},
    {"gaussians", medium_gaussians},
    {"wide and narrow", medium_wide_and_narrow},
    {"voxel", medium_voxel},
    {"grid", medium_grid},
    {"lattice", medium_lattice},
    {"needle", medium_needle},
    {"mix", medium_mix},
    {"bounded mix", medium_bounded_mix},
};

static const scatter_medium *open_medium(check_world *w, const medium_case *c) {
    check_world_open(w);
    c->build(w);
    return &w->scene.medium;
}

/* What rounding does to a density: a Gaussian below 1e-9 of its amplitude is nothing; a coordinate
   among n voxels is rounded to n 1e-7 voxels, and the value may change by `scale` from voxel to
   voxel. */
static double density_rounding(const scatter_medium *m) {
    double sum = 0;
    size_t i;
    for (i = 0; i < m->gaussian_count; i++)
        sum += 1e-9 * m->gaussians[i].c;
    for (i = 0; i < m->grid_count; i++) {
        const scatter_grid *g = &m->grids[i];
        int n = g->nx + g->ny + g->nz;
        sum += 1e-7 * n * (g->scale > 0 ? g->scale : 1.0f);
    }
    return sum;
}

/* The same for a depth, over boxes of 1 m. Coordinates of size 1 are rounded by 1e-7 m, which moves
   faces by that much, and a Gaussian's exponent by 2 a h 1e-7: below 1e-7 of its deepest path
   wherever that is not below 1e-5 of the depth itself (a up to 12/m). */
static double depth_rounding(const scatter_medium *m) {
    double sum = 1e-7 + density_rounding(m);
    size_t i;
    for (i = 0; i < m->gaussian_count; i++)
        sum += 1e-7 * sqrt(CHECK_PI) * m->gaussians[i].c / m->gaussians[i].a;
    return sum;
}

/* ---------------------------------------------------- >>subjects */

static double library_density(const scatter_medium *m, scatter_vec3 x) {
    return scatter_density(m, x);
}

static double library_depth(const scatter_medium *m, scatter_vec3 p, scatter_vec3 q) {
    return scatter_optical_depth(m, p, q);
}

/* Faulty: everything 5e-5 too dense, five times what is promised. */
static double faulty_density(const scatter_medium *m, scatter_vec3 x) {
    return 1.00005 * scatter_density(m, x);
}

static double faulty_depth_scaled(const scatter_medium *m, scatter_vec3 p, scatter_vec3 q) {
    return 1.00005 * scatter_optical_depth(m, p, q);
}

/* Faulty: forgets the bounds. */
static double faulty_depth_unbounded(const scatter_medium *m, scatter_vec3 p, scatter_vec3 q) {
    scatter_medium open = *m;
    open.bounded = 0;
    return scatter_optical_depth(&open, p, q);
}

/* Faulty: the density at the middle times the length. */
static double faulty_depth_middle(const scatter_medium *m, scatter_vec3 p, scatter_vec3 q) {
    scatter_vec3 middle = check_along(p, 0.5f, check_minus(q, p));
    return scatter_density(m, middle) * check_distance(p, q);
}

/* Faulty: takes the density at its first end, so the direction matters. */
static double faulty_depth_first(const scatter_medium *m, scatter_vec3 p, scatter_vec3 q) {
    return scatter_density(m, p) * check_distance(p, q);
}

/* ----------------------------------------------------- >>density */

/* The worst relative error of a density at points in and around the unit cube. */
static double density_error(const scatter_medium *m, density_of subject) {
    check_error e = check_no_error();
    uint64_t seed = 11;
    int i;
    for (i = 0; i < 4000; i++) {
        scatter_vec3 x = check_point(&seed, -1.0f, 2.0f);
        check_add_floor(&e, subject(m, x), reference_density(m, x), density_rounding(m));
    }
    return e.worst;
}

static void test_density(void **state) {
    check_world w;
    size_t i;
    (void)state;
    for (i = 0; i < CHECK_COUNT(media); i++) {
        double error = density_error(open_medium(&w, &media[i]), library_density);
        if (!check_at_most(media[i].name, error, 1e-5)) /* the header's promise */
            assert_true(0);
    }
    check_world_open(&w);
    medium_mix(&w);
    assert_at_least(density_error(&w.scene.medium, faulty_density), 1e-5);
}

static void test_density_known_values(void **state) {
    check_world w;
    const scatter_medium *m;
    (void)state;
    check_world_open(&w);
    m = &w.scene.medium;
    assert_true(scatter_density(m, check_v3(1, 2, 3)) == 0.0f);
    medium_gaussian(&w);
    assert_true(scatter_density(m, check_v3(0.5f, 0.25f, 0.375f)) == 1.5f);
    w.scene.medium.constant = 0.5f;
    assert_true(scatter_density(m, check_v3(50, 0, 0)) == 0.5f);
    check_bound(&w, check_cube(-1, 1));
    assert_true(scatter_density(m, check_v3(50, 0, 0)) == 0.0f);
}

/* Voxel values at voxel centres, linear between them, constant in the outer half voxel, 0 outside.
 */
static void test_grid_meaning(void **state) {
    check_world w;
    const scatter_medium *m;
    scatter_grid *g;
    (void)state;
    check_world_open(&w);
    m = &w.scene.medium;
    g = check_add_grid(&w, 2, 1, 1, check_cube(0, 1), 1);
    w.voxels[0][0] = 1.0f;
    w.voxels[0][1] = 3.0f;
    g->scale = 2.0f;
    assert_true(scatter_density(m, check_v3(0.25f, 0.5f, 0.5f)) == 2.0f);
    assert_true(scatter_density(m, check_v3(0.75f, 0.9f, 0.1f)) == 6.0f);
    assert_true(scatter_density(m, check_v3(0.5f, 0.5f, 0.5f)) == 4.0f);
    assert_true(scatter_density(m, check_v3(0.01f, 0.5f, 0.5f)) == 2.0f);
    assert_true(scatter_density(m, check_v3(0.99f, 0.5f, 0.5f)) == 6.0f);
    assert_true(scatter_density(m, check_v3(1.01f, 0.5f, 0.5f)) == 0.0f);
    assert_true(scatter_density(m, check_v3(0.5f, -0.01f, 0.5f)) == 0.0f);
}

/* ---------------------------------------------------- >>segments */

typedef struct segment {
    scatter_vec3 p, q;
} segment;

static segment random_segment(uint64_t *seed) {
    segment s;
    s.p = check_point(seed, -1.0f, 2.0f);
    s.q = check_point(seed, -1.0f, 2.0f);
    return s;
}

static float *component(scatter_vec3 *v, int axis) {
    return axis == 0 ? &v->x : axis == 1 ? &v->y : &v->z;
}

static segment axis_segment(uint64_t *seed) {
    segment s = random_segment(seed);
    int axis = (int)(check_bits(seed) % 3);
    float end = *component(&s.q, axis);
    s.q = s.p;
    *component(&s.q, axis) = end;
    return s;
}

/* In a plane x, y or z = k/16: faces and centres of voxels of 1/8, centres of Gaussians. Planes on
   which a grid or the bounds begin or end are left out: there the density jumps, and either side is
   right. */
static segment grazing_segment(uint64_t *seed) {
    static const float planes[] = {0.0625f, 0.1875f, 0.3125f, 0.375f, 0.4375f, 0.5625f, 0.6875f};
    segment s = random_segment(seed);
    int axis = (int)(check_bits(seed) % 3);
    float at = planes[check_bits(seed) % CHECK_COUNT(planes)];
    *component(&s.p, axis) = at;
    *component(&s.q, axis) = at;
    return s;
}

/* Nearly in such a plane: crossings far apart and badly conditioned. */
static segment slanting_segment(uint64_t *seed) {
    segment s = grazing_segment(seed);
    float tilt = check_uniform(seed, -1e-5f, 1e-5f);
    s.q = check_v3(s.q.x + tilt, s.q.y - tilt, s.q.z + tilt);
    return s;
}

static segment short_segment(uint64_t *seed) {
    segment s = random_segment(seed);
    s.q = check_along(s.p, 1e-3f, check_direction(seed));
    return s;
}

/* From voxel centre to voxel centre of the lattice: through edges and corners of the trilinear
 * cells. */
static segment corner_segment(uint64_t *seed) {
    segment s;
    int i;
    for (i = 0; i < 3; i++) {
        *component(&s.p, i) = (float)(2 * (check_bits(seed) % 8) + 1) / 16.0f;
        *component(&s.q, i) = (float)(2 * (check_bits(seed) % 8) + 1) / 16.0f;
    }
    return s;
}

typedef segment (*segment_of)(uint64_t *);
static const segment_of segments[] = {random_segment,   axis_segment,  grazing_segment,
                                      slanting_segment, short_segment, corner_segment};

/* ----------------------------------------------- >>optical depth */

/* The worst relative error of a depth on segments of one kind. */
static double depth_error(const scatter_medium *m, depth_of subject, segment_of kind) {
    check_error e = check_no_error();
    uint64_t seed = 21;
    int i;
    for (i = 0; i < 500; i++) {
        segment s = kind(&seed);
        double truth = reference_optical_depth(m, s.p, s.q);
        check_add_floor(&e, subject(m, s.p, s.q), truth, depth_rounding(m));
    }
    return e.worst;
}

static void test_optical_depth(void **state) {
    check_world w;
    size_t i, k;
    (void)state;
    for (i = 0; i < CHECK_COUNT(media); i++)
        for (k = 0; k < CHECK_COUNT(segments); k++) {
            double error = depth_error(open_medium(&w, &media[i]), library_depth, segments[k]);
            if (!check_at_most(media[i].name, error, 1e-5)) { /* the header's promise */
                fprintf(stderr, "  on segments of kind %d\n", (int)k);
                assert_true(0);
            }
        }
}

static void test_optical_depth_faults(void **state) {
    check_world w;
    (void)state;
    check_world_open(&w);
    medium_bounded_mix(&w);
    assert_at_least(depth_error(&w.scene.medium, faulty_depth_scaled, random_segment), 1e-5);
    assert_at_least(depth_error(&w.scene.medium, faulty_depth_unbounded, random_segment), 1e-5);
    assert_at_least(depth_error(&w.scene.medium, faulty_depth_middle, random_segment), 1e-5);
}

/* Anchors that need no reference: length, clipped length, the full Gaussian c sqrt(pi)/a, the
   column of height fog, one voxel. */
static void test_known_depths(void **state) {
    check_world w;
    const scatter_medium *m = &w.scene.medium;
    check_error e = check_no_error();
    (void)state;
    check_world_open(&w);
    medium_constant(&w);
    check_add(&e, scatter_optical_depth(m, check_v3(0, 0, 0), check_v3(2, 3, 6)), 0.7 * 7);
    check_world_open(&w);
    medium_slab(&w);
    check_add(&e, scatter_optical_depth(m, check_v3(-9, 0.5f, 0.5f), check_v3(9, 0.5f, 0.5f)),
              0.7 * 0.625);
    check_world_open(&w);
    medium_gaussian(&w);
    check_add(&e, scatter_optical_depth(m, check_v3(0.5f, -9, 0.375f), check_v3(0.5f, 9, 0.375f)),
              1.5 * sqrt(CHECK_PI) / 3);
    check_world_open(&w);
    check_add_height(&w, 0.8f, 1.0f, 0.5f);
    check_add(&e, scatter_optical_depth(m, check_v3(3, 1, 2), check_v3(3, 1e5f, 2)), 0.8 * 0.5);
    check_world_open(&w);
    medium_voxel(&w);
    w.voxels[0][0] = 1;
    check_add(&e, scatter_optical_depth(m, check_v3(-1, -1, -1), check_v3(2, 2, 2)), sqrt(3.0));
    assert_at_most(e.worst, 1e-5);
}

static void test_zero_length(void **state) {
    check_world w;
    uint64_t seed = 31;
    size_t i;
    int k;
    (void)state;
    for (i = 0; i < CHECK_COUNT(media); i++) {
        const scatter_medium *m = open_medium(&w, &media[i]);
        for (k = 0; k < 100; k++) {
            scatter_vec3 p = check_point(&seed, -1.0f, 2.0f);
            assert_true(scatter_optical_depth(m, p, p) == 0.0f);
        }
        assert_true(scatter_optical_depth(m, check_v3(0.5f, 0.25f, 0.375f),
                                          check_v3(0.5f, 0.25f, 0.375f)) == 0.0f);
    }
}

/* Nothing is met: exactly nothing, not a small negative number. */
static void test_misses(void **state) {
    check_world w;
    scatter_vec3 p = check_v3(-2, 1.75f, -2), q = check_v3(2, 1.75f, 2);
    (void)state;
    check_world_open(&w);
    medium_grid(&w);
    assert_true(scatter_optical_depth(&w.scene.medium, p, q) == 0.0f);
    check_world_open(&w);
    medium_bounded_mix(&w);
    assert_true(scatter_optical_depth(&w.scene.medium, p, q) == 0.0f);
}

/* tau(p,q) against tau(q,p), relative. */
static double reciprocity_error(const scatter_medium *m, depth_of subject) {
    check_error e = check_no_error();
    uint64_t seed = 41;
    int i;
    for (i = 0; i < 1000; i++) {
        segment s = segments[i % 6](&seed);
        check_add_floor(&e, subject(m, s.p, s.q), subject(m, s.q, s.p), 2 * depth_rounding(m));
    }
    return e.worst;
}

/* tau(p,q) against tau(p,x) + tau(x,q) with x between, relative. x is off the line by its own
   rounding, which costs no more than depth_rounding allows. */
static double additivity_error(const scatter_medium *m, depth_of subject) {
    check_error e = check_no_error();
    uint64_t seed = 51;
    int i;
    for (i = 0; i < 1000; i++) {
        segment s = random_segment(&seed);
        scatter_vec3 x = check_along(s.p, check_uniform(&seed, 0, 1), check_minus(s.q, s.p));
        double parts = subject(m, s.p, x) + subject(m, x, s.q);
        check_add_floor(&e, parts, subject(m, s.p, s.q), 3 * depth_rounding(m));
    }
    return e.worst;
}

static void test_reciprocity_and_additivity(void **state) {
    check_world w;
    size_t i;
    (void)state;
    for (i = 0; i < CHECK_COUNT(media); i++) {
        const scatter_medium *m = open_medium(&w, &media[i]);
        /* 2 and 3 values, each good to 1e-5 */
        assert_at_most(reciprocity_error(m, library_depth), 2e-5);
        assert_at_most(additivity_error(m, library_depth), 3e-5);
    }
    assert_at_least(reciprocity_error(&w.scene.medium, faulty_depth_first), 2e-5);
    assert_at_least(additivity_error(&w.scene.medium, faulty_depth_middle), 3e-5);
}

/* Everything moved by a vector that changes no coordinate difference: a result that depends on
   where the origin lies shows. Coordinates are multiples of 1/1024, so moving by 8 is exact in
   float. */
static scatter_vec3 dyadic(scatter_vec3 v) {
    return check_v3(floorf(v.x * 1024.0f) / 1024.0f, floorf(v.y * 1024.0f) / 1024.0f,
                    floorf(v.z * 1024.0f) / 1024.0f);
}

static void move_world(check_world *w, scatter_vec3 by) {
    scatter_medium *m = &w->scene.medium;
    size_t i;
    for (i = 0; i < m->gaussian_count; i++)
        w->gaussians[i].center = check_along(dyadic(w->gaussians[i].center), 1, by);
    for (i = 0; i < m->height_count; i++)
        w->heights[i].y0 += by.y;
    for (i = 0; i < m->grid_count; i++) {
        w->grids[i].box.min = check_along(w->grids[i].box.min, 1, by);
        w->grids[i].box.max = check_along(w->grids[i].box.max, 1, by);
    }
    m->bounds.min = check_along(m->bounds.min, 1, by);
    m->bounds.max = check_along(m->bounds.max, 1, by);
}

static void test_translation(void **state) {
    check_world here, there;
    check_error e = check_no_error();
    scatter_vec3 by = check_v3(8, -8, 8);
    uint64_t seed = 61;
    int i;
    (void)state;
    check_world_open(&here);
    medium_bounded_mix(&here);
    here.heights[0].y0 = 0.5f;
    move_world(&here, check_v3(0, 0, 0));
    check_world_open(&there);
    medium_bounded_mix(&there);
    there.heights[0].y0 = 0.5f;
    move_world(&there, by);
    for (i = 0; i < 1000; i++) {
        segment s = random_segment(&seed);
        scatter_vec3 p = dyadic(s.p), q = dyadic(s.q);
        double moved = scatter_optical_depth(&there.scene.medium, check_along(p, 1, by),
                                             check_along(q, 1, by));
        /* coordinates are nine times as large, and so is their rounding along the segment */
        check_add_floor(&e, moved, scatter_optical_depth(&here.scene.medium, p, q),
                        9 * depth_rounding(&here.scene.medium));
    }
    assert_at_most(e.worst, 2e-5);
}

/* A lamp 10 km away: the depth of the near metre must not drown in the rounding of the far end. */
static void test_far_end(void **state) {
    check_world w;
    check_error e = check_no_error();
    uint64_t seed = 71;
    int i;
    (void)state;
    check_world_open(&w);
    medium_gaussians(&w);
    check_add_grid(&w, 7, 5, 3, check_cube(0.25f, 0.75f), 9);
    for (i = 0; i < 500; i++) {
        scatter_vec3 x = check_point(&seed, 0.0f, 1.0f);
        scatter_vec3 far = check_along(x, 1e4f, check_direction(&seed));
        double truth = reference_optical_depth(&w.scene.medium, x, far);
        check_add_floor(&e, scatter_optical_depth(&w.scene.medium, x, far), truth,
                        depth_rounding(&w.scene.medium));
        check_add_floor(&e, scatter_optical_depth(&w.scene.medium, far, x), truth,
                        depth_rounding(&w.scene.medium));
    }
    assert_at_most(e.worst, 1e-5); /* the header's promise knows no distance */
}

/* ---------------------------------------------------- >>extremes */

/* Finite inputs of any size give a depth that is a number and not negative. */
static void test_extremes(void **state) {
    static const float sizes[] = {1e-30f, 1e-12f, 1e-6f, 1.0f, 1e6f, 1e12f, 1e18f};
    size_t i, k;
    check_world w;
    (void)state;
    for (i = 0; i < CHECK_COUNT(sizes); i++)
        for (k = 0; k < CHECK_COUNT(sizes); k++) {
            uint64_t seed = 81;
            scatter_vec3 p = check_point(&seed, -sizes[i], sizes[i]);
            scatter_vec3 q = check_point(&seed, -sizes[i], sizes[i]);
            check_world_open(&w);
            check_add_gaussian(&w, check_point(&seed, -1, 1), sizes[k], 1.0f);
            check_add_height(&w, 1e-3f, 0.0f, 1.0f / sizes[k]);
            assert_true(scatter_optical_depth(&w.scene.medium, p, q) >= 0.0f); /* not NaN */
            assert_true(scatter_density(&w.scene.medium, p) >= 0.0f);
        }
}

/* --------------------------------------------- >>phase functions */

typedef double (*phase_of)(const scatter_phase *, double);

static double library_phase(const scatter_phase *p, double cosine) {
    return scatter_phase_value(p, (float)cosine);
}

/* Faulty: scatters backwards. */
static double faulty_phase(const scatter_phase *p, double cosine) {
    return scatter_phase_value(p, (float)-cosine);
}

static const scatter_phase phases[] = {
    {SCATTER_PHASE_ISOTROPIC, 0, 0, 0},    {SCATTER_PHASE_HG, 0.0f, 0, 0},
    {SCATTER_PHASE_HG, 0.85f, 0, 0},       {SCATTER_PHASE_HG, -0.6f, 0, 0},
    {SCATTER_PHASE_RAYLEIGH, 0, 0, 0},     {SCATTER_PHASE_DRAINE, 0.5f, 2.0f, 0},
    {SCATTER_PHASE_DRAINE, 0.0f, 1.0f, 0}, {SCATTER_PHASE_DROPLETS, 0, 0, 0.05f},
    {SCATTER_PHASE_DROPLETS, 0, 0, 1.0f},  {SCATTER_PHASE_DROPLETS, 0, 0, 3.0f},
    {SCATTER_PHASE_DROPLETS, 0, 0, 10.0f}, {SCATTER_PHASE_DROPLETS, 0, 0, 50.0f},
};

static double phase_error(const scatter_phase *phase, phase_of subject) {
    check_error e = check_no_error();
    int i;
    for (i = 0; i <= 512; i++) {
        double cosine = i / 256.0 - 1; /* exact in float */
        check_add(&e, subject(phase, cosine), reference_phase(phase, cosine));
    }
    return e.worst;
}

static void test_phase(void **state) {
    size_t i;
    (void)state;
    for (i = 0; i < CHECK_COUNT(phases); i++)
        /* The droplet fit's lobe parameters are exponentials of rounded floats; near the forward
           peak p goes as (1-g)^-2, and 1-g of 50 um droplets is 0.002: a rounding of g by 6e-8 is
           6e-5 there. */
        assert_at_most(phase_error(&phases[i], library_phase),
                       phases[i].kind == SCATTER_PHASE_DROPLETS ? 1e-4 : 1e-5);
    assert_at_least(phase_error(&phases[2], faulty_phase), 1e-4);
}

/* ∫ p dΩ = 1, and ∫ p cosθ dΩ = g of Henyey-Greenstein, by the midpoint rule in 1/(1+g^2-2g
   cosθ)^1/2, in which HG is constant: u = (1+g^2-2g cosθ)^-1/2. */
static void test_phase_moments(void **state) {
    static const float gs[] = {-0.9f, -0.3f, 0.5f, 0.95f};
    size_t i;
    int k;
    (void)state;
    for (i = 0; i < CHECK_COUNT(gs); i++) {
        scatter_phase phase = {SCATTER_PHASE_HG, 0, 0, 0};
        double g = gs[i], low = 1 / (1 + fabs(g)), high = 1 / (1 - fabs(g)), one = 0, mean = 0;
        phase.g = gs[i];
        for (k = 0; k < 4000; k++) {
            double u = low + (high - low) * (k + 0.5) / 4000;
            double cosine = (1 + g * g - 1 / (u * u)) / (2 * g);
            double weight = 2 * CHECK_PI * (high - low) / 4000 / (u * u * u * fabs(g));
            one += weight * scatter_phase_value(&phase, (float)cosine);
            mean += weight * cosine * scatter_phase_value(&phase, (float)cosine);
        }
        /* cos_theta is rounded to float: 6e-8 against 1-g = 0.05 is 4e-6 of p at the peak, both
         * signs */
        assert_at_most(fabs(one - 1), 1e-5);
        assert_at_most(fabs(mean - g), 1e-5);
    }
}

/* --------------------------------------------------- >>injection */

#define CELLS_MAX (33 * 17 * 9)

typedef struct cells {
    float values[CELLS_MAX];
    scatter_volume volume;
} cells;

static const scatter_volume *open_cells(cells *c, scatter_box box) {
    int i;
    for (i = 0; i < CELLS_MAX; i++)
        c->values[i] = -1.0f; /* a cell that nobody writes shows */
    c->volume.values = c->values;
    c->volume.nx = 33;
    c->volume.ny = 17;
    c->volume.nz = 9;
    c->volume.box = box;
    return &c->volume;
}

static scatter_vec3 cell_center(const scatter_volume *v, int i, int j, int k, double offset) {
    scatter_vec3 low = v->box.min, high = v->box.max;
    double x = low.x + (high.x - (double)low.x) * (i + offset) / v->nx;
    double y = low.y + (high.y - (double)low.y) * (j + offset) / v->ny;
    double z = low.z + (high.z - (double)low.z) * (k + offset) / v->nz;
    return check_v3((float)x, (float)y, (float)z);
}

/* The largest error of a volume against the density at its cells, over the largest density. */
static double injection_error(const scatter_medium *m, const scatter_volume *v, double offset) {
    double worst = 0, top = 0;
    int i, j, k;
    for (k = 0; k < v->nz; k++)
        for (j = 0; j < v->ny; j++)
            for (i = 0; i < v->nx; i++) {
                double truth = reference_density(m, cell_center(v, i, j, k, offset));
                double miss = fabs(v->values[(k * v->ny + j) * v->nx + i] - truth);
                worst = miss > worst || isnan(miss) ? miss : worst;
                top = truth > top ? truth : top;
            }
    return worst / (top > 0 ? top : 1);
}

/* A box whose cell centres lie on no face of the media's grids and bounds, where the density jumps.
 */
static scatter_box odd_box(void) {
    scatter_box box = {{-0.3f, -0.17f, -0.41f}, {1.31f, 1.1f, 1.7f}};
    return box;
}

static void test_inject(void **state) {
    static cells c;
    check_world w;
    check_host books;
    scatter_host host = check_host_open(&books, 0);
    size_t i;
    (void)state;
    for (i = 0; i < CHECK_COUNT(media); i++) {
        const scatter_medium *m = open_medium(&w, &media[i]);
        open_cells(&c, odd_box());
        assert_int_equal(scatter_inject(&host, m, &c.volume), SCATTER_OK);
        /* Gaussians are built up by recurrences and cut off where they are nothing; a voxel row of
           300 rounds voxel coordinates to 3e-5. All relative to the densest cell. */
        if (!check_at_most(media[i].name, injection_error(m, &c.volume, 0.5), 5e-5))
            assert_true(0);
    }
    assert_int_equal(books.calls, 0); /* scatter_inject never allocates */
    assert_at_least(injection_error(&w.scene.medium, &c.volume, 0.0),
                    5e-5); /* cell corners: a fault */
}

static void test_inject_threads(void **state) {
    static cells one, many;
    static const int threads[] = {1, 2, 7, 16};
    check_world w;
    check_host books;
    size_t i;
    (void)state;
    check_world_open(&w);
    medium_mix(&w);
    open_cells(&one, odd_box());
    assert_int_equal(scatter_inject(NULL, &w.scene.medium, &one.volume), SCATTER_OK);
    for (i = 0; i < 2 * CHECK_COUNT(threads); i++) {
        scatter_host host = check_host_open(&books, threads[i / 2]);
        books.reverse = (int)(i % 2);
        open_cells(&many, odd_box());
        assert_int_equal(scatter_inject(&host, &w.scene.medium, &many.volume), SCATTER_OK);
        assert_true(memcmp(one.values, many.values, sizeof one.values) == 0);
    }
}

/* The mass in the volume is the mass of the Gaussian, c (sqrt(pi)/a)^3: the midpoint rule is exact
   to rounding when a cell is much narrower than the Gaussian. */
static void test_inject_mass(void **state) {
    static cells c;
    check_world w;
    double mass = 0, cell = 2.0 / 33 * 2.0 / 17 * 2.0 / 9;
    int i;
    (void)state;
    check_world_open(&w);
    check_add_gaussian(&w, check_v3(0.03f, -0.02f, 0.01f), 4.5f, 2.0f);
    open_cells(&c, check_cube(-1, 1));
    assert_int_equal(scatter_inject(NULL, &w.scene.medium, &c.volume), SCATTER_OK);
    for (i = 0; i < CELLS_MAX; i++)
        mass += c.values[i] * cell;
    /* nine cells of h = 0.22: the rule's error is 2 exp(-(pi/(a h))^2) = 1e-4 */
    assert_at_most(fabs(mass / (2 * pow(sqrt(CHECK_PI) / 4.5, 3)) - 1), 2e-4);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_density),
        cmocka_unit_test(test_density_known_values),
        cmocka_unit_test(test_grid_meaning),
        cmocka_unit_test(test_optical_depth),
        cmocka_unit_test(test_optical_depth_faults),
        cmocka_unit_test(test_known_depths),
        cmocka_unit_test(test_zero_length),
        cmocka_unit_test(test_misses),
        cmocka_unit_test(test_reciprocity_and_additivity),
        cmocka_unit_test(test_translation),
        cmocka_unit_test(test_far_end),
        cmocka_unit_test(test_extremes),
        cmocka_unit_test(test_phase),
        cmocka_unit_test(test_phase_moments),
        cmocka_unit_test(test_inject),
        cmocka_unit_test(test_inject_threads),
        cmocka_unit_test(test_inject_mass),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
