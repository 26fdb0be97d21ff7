/* test_suns.c - many directional lights: depth on the lattice that they share, light of several of
   them read together, and volumes redone in turn. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#define SCATTER_IMPLEMENTATION
#include "../scatter.h"
#include "check.h"

#define SIDE 24
#define FLOATS (SIDE * SIDE * 3)
#define POINTS 3000
#define MANY 64

static const scatter_vec3 directions[] = {
    {0, -1, 0},          {0.3f, -1, 0.2f}, {1, 0.1f, -0.3f},     {-0.4f, 0.2f, 1},
    {0.02f, -1, 0.001f}, {1, 1, 1},        {-0.9f, -1, -0.999f}, {0.5f, 0.7f, -0.1f}};

static scatter_source sun(scatter_vec3 direction)
{
    scatter_source s = {1, {0, 0, 0}, {0, 0, 0}};
    s.direction = direction;
    return s;
}

static scatter_quality quality_of(scatter_depth_method depth, int grid)
{
    scatter_quality q;
    memset(&q, 0, sizeof q);
    q.depth = depth;
    q.grid = grid;
    return q;
}

/* ------------------------------------------------------- >>depth */

/* From far up the light to x. */
static double truth(const scatter_medium *m, scatter_vec3 direction, scatter_vec3 x)
{
    scatter_vec3 up = check_along(x, -100.0f, scatteri_unit(direction));
    return (double)scatter_optical_depth(m, up, x);
}

/* Relative RMS error of depth in the box low..high; the truth is of a light turned by `turn`. */
static double depth_error(const scatter_medium *m, scatter_vec3 w, int grid, float low, float high,
                          float turn)
{
    scatter_quality q = quality_of(SCATTER_DEPTH_POLAR, grid);
    scatter_source source = sun(w);
    scatter_depth *depth = NULL;
    check_error e = check_no_error();
    uint64_t seed = 5;
    int i;
    assert_int_equal(scatter_depth_create(NULL, &depth), SCATTER_OK);
    assert_int_equal(scatter_depth_update(depth, m, &source, &q), SCATTER_OK);
    w.x += turn * (float)sqrt(check_dot(w, w));
    for (i = 0; i < POINTS; i++) {
        scatter_vec3 x = check_point(&seed, low, high);
        check_add(&e, (double)scatter_depth_at(depth, x), truth(m, w, x));
    }
    scatter_depth_destroy(depth);
    return check_relative_rms(&e);
}

/* Gaussians are smooth: linear interpolation between the points is the largest error, and of second
   order for every direction. Points 0.035 apart and a = 5 err by a^2 h^2/6 = 0.5 % at a peak. */
static void test_depth_is_second_order(void **state)
{
    check_world w;
    double least = 9, most = 0, worst = 0, wrong;
    size_t i;
    (void)state;
    check_world_open(&w);
    check_add_gaussians(&w, 12, 2.0f, 5.0f, 3);
    for (i = 0; i < CHECK_COUNT(directions); i++) {
        double coarse = depth_error(&w.scene.medium, directions[i], 48, 0, 1, 0);
        double fine = depth_error(&w.scene.medium, directions[i], 96, 0, 1, 0);
        least = fmin(least, check_order(coarse, fine));
        most = fmax(most, check_order(coarse, fine));
        worst = fmax(worst, fine);
    }
    wrong = check_order(depth_error(&w.scene.medium, directions[1], 48, 0, 1, 0.01f),
                        depth_error(&w.scene.medium, directions[1], 96, 0, 1, 0.01f));
    printf("  order %.2f to %.2f, error %.1e; planted: a light turned by 0.01, order %.2f\n", least,
           most, worst, wrong);
    assert_at_least(least, 1.85);
    assert_at_most(most, 2.3);
    assert_at_most(worst, 5e-3);
    assert_at_most(wrong, 1.5);
}

/* Random voxels have kinks at every voxel and steps at the faces of their box: still second order,
   as linear interpolation of a function with kinks is. */
static void test_depth_of_voxels(void **state)
{
    check_world w;
    double least = 9, worst = 0;
    size_t i;
    (void)state;
    check_world_open(&w);
    check_add_grid(&w, 9, 10, 11, check_cube(0, 1), 4);
    for (i = 0; i < CHECK_COUNT(directions); i++) {
        double coarse = depth_error(&w.scene.medium, directions[i], 60, 0.02f, 0.98f, 0);
        double fine = depth_error(&w.scene.medium, directions[i], 120, 0.02f, 0.98f, 0);
        least = fmin(least, check_order(coarse, fine));
        worst = fmax(worst, fine);
    }
    printf("  order at least %.2f, error %.1e\n", least, worst);
    assert_at_least(least, 1.2);
    assert_at_most(worst, 4e-3);
}

/* Even density in a box: depth is the length in the box, linear between the edges' shadows. What
   comes in through the sides, or glances off them, has no error but near these. */
static void test_depth_of_a_block(void **state)
{
    static const double limits[] = {1e-5, 0.012, 0.012, 0.012, 0.06, 0.012, 0.012, 0.012};
    check_world w;
    size_t i, k;
    (void)state;
    check_world_open(&w);
    check_add_grid(&w, 2, 2, 2, check_cube(0, 1), 4);
    for (k = 0; k < 8; k++)
        w.voxels[0][k] = 1.0f;
    for (i = 0; i < CHECK_COUNT(directions); i++) {
        double error = depth_error(&w.scene.medium, directions[i], 64, 0, 1, 0);
        printf("  %.1e", error);
        assert_at_most(error, limits[i]);
    }
    printf("\n");
}

/* A grid with other sides than cubes: the lattice's points are as far apart on all axes. */
static void test_depth_in_a_long_box(void **state)
{
    check_world w;
    scatter_box box = check_cube(0, 1);
    scatteri_lattice g;
    size_t i;
    (void)state;
    check_world_open(&w);
    box.max = check_v3(4, 1, 0.25f);
    check_add_gaussian(&w, check_v3(1, 0.5f, 0.1f), 1.0f, 1.0f);
    check_bound(&w, box);
    memset(&g, 0, sizeof g);
    scatteri_lay_lattice(&g, box, 129);
    assert_int_equal(g.n[0], 129);
    assert_int_equal(g.n[1], 33);
    assert_int_equal(g.n[2], 9);
    for (i = 0; i < CHECK_COUNT(directions); i++)
        /* measured 0.016: eight steps for the kinks behind the edges of a box that cuts the Gaussian */
        assert_at_most(depth_error(&w.scene.medium, directions[i], 129, 0.09f, 0.19f, 0), 0.025);
}

/* ------------------------------------------------------ >>images */

static scatter_view front_view(void)
{
    return scatter_view_perspective(check_v3(0.6f, 0.9f, -2.2f), check_v3(0.5f, 0.5f, 0.5f),
                                    check_v3(0, 1, 0), 0.7f, 1);
}

static void draw(const scatter_context *c, float *rgb)
{
    scatter_view view = front_view();
    scatter_image image;
    memset(&image, 0, sizeof image);
    image.width = image.height = SIDE;
    image.rgb = rgb;
    assert_int_equal(scatter_render(c, &view, &image), SCATTER_OK);
}

static void draw_scene(const scatter_scene *scene, const scatter_quality *q, float *rgb)
{
    scatter_context *c = check_open_context(scene, q);
    draw(c, rgb);
    scatter_destroy(c);
}

static double difference(const float *a, const float *b)
{
    check_error e = check_no_error();
    int i;
    for (i = 0; i < FLOATS; i++)
        check_add(&e, (double)a[i], (double)b[i]);
    return check_rms(&e);
}

static scatter_light light_of(scatter_light_kind kind, scatter_vec3 where, float intensity)
{
    scatter_light l;
    memset(&l, 0, sizeof l);
    l.kind = kind;
    l.position = l.direction = where;
    l.outer = 1.0f;
    l.intensity = check_v3(intensity, 0.8f * intensity, 1.1f * intensity);
    return l;
}

/* `count` suns of all directions. */
static void fill_sky(scatter_light *lights, int count, float all)
{
    uint64_t seed = 11;
    int i;
    for (i = 0; i < count; i++)
        lights[i] = light_of(SCATTER_LIGHT_DIRECTIONAL, check_direction(&seed), all / (float)count);
}

static void open_cloud(check_world *w)
{
    check_world_open(w);
    check_add_gaussians(w, 8, 2.5f, 6.0f, 21);
    w->scene.medium.extinction = check_v3(3, 3, 3);
}

/* One light of E, and N of E/N from the same side: 2 and more are read together, one is not. */
static void test_superposition(void **state)
{
    static float one[FLOATS], many[FLOATS];
    scatter_quality q = quality_of(SCATTER_DEPTH_POLAR, 40);
    scatter_light lights[MANY];
    check_world w;
    double worst = 0;
    int n, i;
    (void)state;
    open_cloud(&w);
    w.scene.lights = lights;
    for (n = 1; n <= 12; n++) {
        for (i = 0; i < n; i++)
            lights[i] = light_of(SCATTER_LIGHT_DIRECTIONAL, directions[1], 4.0f / (float)n);
        w.scene.light_count = (size_t)n;
        draw_scene(&w.scene, &q, n == 1 ? one : many);
        worst = n > 1 ? fmax(worst, difference(many, one)) : 0;
    }
    printf("  %.1e\n", worst);
    assert_at_most(worst, 2e-6);
    lights[3].intensity.x *= 1.001f;
    draw_scene(&w.scene, &q, many);
    assert_at_least(difference(many, one), 2e-5);
}

static void test_order_of_lights_does_not_matter(void **state)
{
    static float a[FLOATS], b[FLOATS];
    scatter_quality q = quality_of(SCATTER_DEPTH_POLAR, 40);
    scatter_light lights[MANY];
    check_world w;
    int i;
    (void)state;
    open_cloud(&w);
    w.scene.lights = lights;
    w.scene.light_count = 23;
    fill_sky(lights, 23, 6.0f);
    draw_scene(&w.scene, &q, a);
    for (i = 0; i < 11; i++) {
        scatter_light other = lights[i];
        lights[i] = lights[22 - i];
        lights[22 - i] = other;
    }
    draw_scene(&w.scene, &q, b);
    assert_at_most(difference(a, b), 2e-6);
    lights[5].direction = lights[6].direction;
    draw_scene(&w.scene, &q, b);
    assert_at_least(difference(a, b), 1e-3);
}

/* --- each light alone, added up --- */

static void add_alone(const check_world *w, const scatter_quality *q, size_t i, float *sum)
{
    static float rgb[FLOATS];
    scatter_scene scene = w->scene;
    int k;
    scene.lights = w->scene.lights + i;
    scene.light_count = 1;
    draw_scene(&scene, q, rgb);
    for (k = 0; k < FLOATS; k++)
        sum[k] += rgb[k];
}

/* Relative RMS difference between lights together and each alone; `without`: leaves one out. */
static double together_against_alone(const check_world *w, const scatter_quality *q, int without)
{
    static float all[FLOATS], sum[FLOATS];
    size_t i;
    memset(sum, 0, sizeof sum);
    for (i = 0; i < w->scene.light_count; i++)
        if ((int)i != without)
            add_alone(w, q, i, sum);
    draw_scene(&w->scene, q, all);
    return difference(all, sum);
}

static void fill_mixed(scatter_light *lights, int count)
{
    uint64_t seed = 31;
    int i;
    for (i = 0; i < count; i++)
        lights[i] = i % 4 == 1   ? light_of(SCATTER_LIGHT_POINT, check_v3(1.5f, 2, -0.3f), 2)
                    : i % 4 == 3 ? light_of(SCATTER_LIGHT_SPOT, check_v3(-0.6f, -1, -0.7f), 5)
                                 : light_of(SCATTER_LIGHT_DIRECTIONAL, check_direction(&seed), 1);
    for (i = 3; i < count; i += 4)
        lights[i].position = check_v3(1, 2, 1);
}

static void test_mixed_lights(void **state)
{
    scatter_quality q = quality_of(SCATTER_DEPTH_POLAR, 32);
    scatter_light lights[MANY];
    check_world w;
    double worst = 0;
    int n;
    (void)state;
    open_cloud(&w);
    w.scene.lights = lights;
    for (n = 1; n <= 9; n++) {
        fill_mixed(lights, n);
        w.scene.light_count = (size_t)n;
        worst = fmax(worst, together_against_alone(&w, &q, -1));
    }
    printf("  %.1e, without one %.1e\n", worst, together_against_alone(&w, &q, 6));
    assert_at_most(worst, 2e-6);
    assert_at_least(together_against_alone(&w, &q, 6), 1e-3);
}

static const scatter_phase phases[] = {
    {SCATTER_PHASE_ISOTROPIC, 0, 0, 0},    {SCATTER_PHASE_HG, 0.7f, 0, 0},
    {SCATTER_PHASE_HG, -0.5f, 0, 0},       {SCATTER_PHASE_RAYLEIGH, 0, 0, 0},
    {SCATTER_PHASE_DRAINE, 0.4f, 0.8f, 0}, {SCATTER_PHASE_DROPLETS, 0, 0, 9}};

/* Colours, phase functions, emission, fog and voxels, by quadrature and by march. Emission counts
   once in the sum of n pictures, so it is off here. */
static void test_media(void **state)
{
    scatter_quality q = quality_of(SCATTER_DEPTH_POLAR, 32);
    scatter_light lights[MANY];
    double worst = 0;
    size_t i;
    int kind;
    (void)state;
    fill_sky(lights, 6, 5.0f);
    for (i = 0; i < CHECK_COUNT(phases); i++)
        for (kind = 0; kind < 8; kind++) {
            check_world w;
            open_cloud(&w);
            w.scene.lights = lights;
            w.scene.light_count = 6;
            w.scene.medium.phase = phases[i];
            if (kind & 1)
                w.scene.medium.extinction = check_v3(1, 3, 6);
            if (kind & 2)
                check_add_grid(&w, 6, 6, 6, check_cube(0.1f, 0.9f), 2);
            if (kind & 4)
                check_add_height(&w, 0.3f, 0, 0.5f);
            q.ray = kind & 2 ? SCATTER_RAY_MARCH : SCATTER_RAY_QUADRATURE;
            worst = fmax(worst, together_against_alone(&w, &q, -1));
        }
    printf("  %.1e\n", worst);
    assert_at_most(worst, 3e-6);
}

/* Sixty-four suns against depth in closed form: what is left is the error of the lattice. */
static void test_sky_against_closed_form(void **state)
{
    static float exact[FLOATS], rgb[FLOATS];
    scatter_quality closed = quality_of(SCATTER_DEPTH_CLOSED, 0);
    scatter_light lights[MANY];
    check_world w;
    double error[3], wrong;
    int i;
    (void)state;
    open_cloud(&w);
    w.scene.lights = lights;
    w.scene.light_count = MANY;
    fill_sky(lights, MANY, 8.0f);
    draw_scene(&w.scene, &closed, exact);
    for (i = 0; i < 3; i++) {
        scatter_quality q = quality_of(SCATTER_DEPTH_POLAR, 16 << i);
        draw_scene(&w.scene, &q, rgb);
        error[i] = difference(rgb, exact);
    }
    fill_sky(lights, MANY - 1, 8.0f);
    draw_scene(&w.scene, &closed, rgb);
    wrong = difference(rgb, exact);
    printf("  %.1e %.1e %.1e, planted: a light less, %.1e\n", error[0], error[1], error[2], wrong);
    assert_at_most(error[2], 4e-3); /* a^2 h^2/6 with a = 6 and points 0.025 apart */
    assert_at_least(check_order(error[0], error[2]) / 2, 1.6);
    assert_at_least(wrong, 4e-3);
}

/* ---------------------------------------------------- >>surfaces */

/* A glossy floor behind a block of even density, seen from below the block through nothing. */
static scatter_surface floor_of(scatter_vec3 albedo)
{
    scatter_surface s;
    memset(&s, 0, sizeof s);
    s.distance = 1.5f;
    s.normal = check_v3(0.1f, 1, -0.2f);
    s.albedo = albedo;
    s.specular = check_v3(0.2f, 0.3f, 0.1f);
    s.shininess = 12.0f;
    return s;
}

/* Lambert and Phong as scatter_surface says, in double precision. */
static double reflected(const scatter_surface *s, scatter_vec3 ray, scatter_vec3 light)
{
    double n = sqrt(check_dot(s->normal, s->normal));
    double cosine = fmax(-check_dot(s->normal, light) / n / sqrt(check_dot(light, light)), 0);
    scatter_vec3 mirror =
        check_along(ray, (float)(-2 * check_dot(ray, s->normal) / (n * n)), s->normal);
    double gloss = fmax(-check_dot(mirror, light) / sqrt(check_dot(light, light)), 0);
    return cosine *
           ((double)s->albedo.x / CHECK_PI + (double)s->specular.x * ((double)s->shininess + 2) /
                                                 (2 * CHECK_PI) * pow(gloss, (double)s->shininess));
}

static double surface_error(int voxels, double *wrong)
{
    scatter_quality q = quality_of(SCATTER_DEPTH_POLAR, 96);
    scatter_surface s = floor_of(check_v3(0.6f, 0.5f, 0.4f));
    scatter_light lights[MANY];
    scatter_ray ray = {{0.45f, 1.2f, 0.55f}, {0, -1, 0}};
    scatter_context *c;
    scatter_sample sample;
    check_world w;
    double sum = 0, bare = 0;
    int i;
    check_world_open(&w);
    if (voxels)
        check_add_grid(&w, 2, 2, 2, check_cube(0, 1), 4);
    else
        check_add_gaussian(&w, check_v3(0.5f, 0.5f, 0.5f), 3.0f, 1.5f);
    for (i = 0; i < 8 && voxels; i++)
        w.voxels[0][i] = 0.7f;
    w.scene.lights = lights;
    w.scene.light_count = MANY;
    fill_sky(lights, MANY, 8.0f);
    c = check_open_context(&w.scene, &q);
    assert_int_equal(scatter_radiance(c, &ray, &s, &sample), SCATTER_OK);
    scatter_destroy(c);
    for (i = 0; i < MANY; i++) {
        double sent =
            (double)lights[i].intensity.x * reflected(&s, ray.direction, lights[i].direction);
        sum +=
            sent * exp(-truth(&w.scene.medium, lights[i].direction, check_v3(0.45f, -0.3f, 0.55f)));
        bare += sent;
    }
    *wrong = fabs(bare / sum - 1);
    return fabs((double)sample.surface.x / sum - 1);
}

/* The floor lies below the box: depth is read where the way to each light leaves the medium. */
static void test_surface_under_a_sky(void **state)
{
    double bare_block, bare_cloud;
    double block = surface_error(1, &bare_block), cloud = surface_error(0, &bare_cloud);
    (void)state;
    printf("  behind a block %.1e, a Gaussian %.1e; without them %.1e, %.1e\n", block, cloud,
           bare_block, bare_cloud);
    assert_at_most(block, 2e-3);
    assert_at_most(cloud, 1e-3);
    assert_at_least(bare_block, 0.05);
    assert_at_least(bare_cloud, 0.05);
}

/* ----------------------------------------------------- >>in turn */

static const scatter_depth_method volumes[] = {SCATTER_DEPTH_POLAR,  SCATTER_DEPTH_CLOSED_VOLUME,
                                               SCATTER_DEPTH_UPWIND, SCATTER_DEPTH_SHORT,
                                               SCATTER_DEPTH_EQ6,    SCATTER_DEPTH_MARCH};

static unsigned redone(scatter_context *c, const scatter_scene *scene, const scatter_quality *q)
{
    unsigned before = scatter_get_stats(c).propagations;
    assert_int_equal(scatter_update(c, scene, q), SCATTER_OK);
    return scatter_get_stats(c).propagations - before;
}

/* Seven lights, at most three in an update: all at first, then 3 + 3 + 1 for a change; the others
   keep what they held, and in the end the picture is that of a fresh context. */
static void test_lights_in_turn(void **state)
{
    static float fresh[FLOATS], rgb[FLOATS];
    scatter_light lights[MANY];
    size_t m;
    (void)state;
    for (m = 0; m < CHECK_COUNT(volumes); m++) {
        scatter_quality q = quality_of(volumes[m], 14), all = q;
        check_world w;
        scatter_context *c;
        float held;
        open_cloud(&w);
        w.scene.lights = lights;
        w.scene.light_count = 7;
        fill_mixed(lights, 7);
        q.lights_per_update = 3;
        c = check_open_context(&w.scene, &q);
        assert_int_equal(scatter_get_stats(c).propagations, 7);
        assert_int_equal(redone(c, &w.scene, &q), 0);
        held = scatter_depth_at(&c->lights[6].depth, check_v3(0.5f, 0.4f, 0.6f));
        w.gaussians[0].c *= 3.0f;
        draw_scene(&w.scene, &all, fresh);
        assert_int_equal(redone(c, &w.scene, &q), 3);
        assert_true(scatter_depth_at(&c->lights[6].depth, check_v3(0.5f, 0.4f, 0.6f)) == held);
        draw(c, rgb);
        assert_at_least(difference(rgb, fresh), 1e-3);
        assert_int_equal(redone(c, &w.scene, &q), 3);
        assert_int_equal(redone(c, &w.scene, &q), 1);
        assert_true(scatter_depth_at(&c->lights[6].depth, check_v3(0.5f, 0.4f, 0.6f)) != held);
        draw(c, rgb);
        assert_true(memcmp(rgb, fresh, sizeof rgb) == 0);
        assert_int_equal(redone(c, &w.scene, &q), 0);
        scatter_destroy(c);
    }
}

/* The medium changes in every update: no light waits longer than ceil(9/2) updates, and those that
   waited longest come first. */
static void test_nobody_starves(void **state)
{
    scatter_quality q = quality_of(SCATTER_DEPTH_POLAR, 8);
    scatter_light lights[MANY];
    check_world w;
    scatter_context *c;
    unsigned oldest = 0;
    int i, update;
    (void)state;
    open_cloud(&w);
    w.scene.lights = lights;
    w.scene.light_count = 9;
    fill_mixed(lights, 9);
    q.lights_per_update = 2;
    c = check_open_context(&w.scene, &q);
    for (update = 0; update < 30; update++) {
        w.gaussians[0].c *= 1.01f;
        assert_int_equal(redone(c, &w.scene, &q), 2);
        for (i = 0; i < 9; i++)
            oldest =
                c->media - c->lights[i].medium > oldest ? c->media - c->lights[i].medium : oldest;
    }
    for (update = 0; update < 4; update++)
        assert_int_equal(redone(c, &w.scene, &q), update < 3 ? 2 : 1);
    assert_int_equal(oldest, 4);
    scatter_destroy(c);
}

/* In a thin medium depth is nothing, so a sky that turns must look as it does now at once; `spot`:
   so must the cone of a spot light that turns. */
static void test_phase_is_current(void **state)
{
    static float fresh[FLOATS], rgb[FLOATS], before[FLOATS];
    scatter_quality q = quality_of(SCATTER_DEPTH_POLAR, 12);
    scatter_light lights[MANY];
    check_world w;
    scatter_context *c;
    int i;
    (void)state;
    open_cloud(&w);
    w.scene.medium.extinction = check_v3(1e-5f, 1e-5f, 1e-5f);
    w.scene.medium.phase = phases[1];
    w.scene.lights = lights;
    w.scene.light_count = 8;
    fill_mixed(lights, 8);
    q.lights_per_update = 1;
    c = check_open_context(&w.scene, &q);
    draw(c, before);
    for (i = 0; i < 8; i++) {
        lights[i].direction = check_along(lights[i].direction, 0.3f, check_v3(0.5f, 0.6f, -1));
        lights[i].position.x += 0.1f;
    }
    assert_int_equal(redone(c, &w.scene, &q), 1);
    draw(c, rgb);
    draw_scene(&w.scene, &q, fresh);
    printf("  turned %.1e, against the sky before %.1e\n", difference(rgb, fresh),
           difference(before, fresh));
    assert_at_most(difference(rgb, fresh), 1e-5);
    assert_at_least(difference(before, fresh), 1e-2);
    scatter_destroy(c);
}

/* New lights and lights of another kind are filled at once, whoever waits. */
static void test_new_lights_do_not_wait(void **state)
{
    scatter_quality q = quality_of(SCATTER_DEPTH_POLAR, 10);
    scatter_light lights[MANY];
    check_world w;
    scatter_context *c;
    (void)state;
    open_cloud(&w);
    w.scene.lights = lights;
    w.scene.light_count = 5;
    fill_sky(lights, MANY, 5.0f);
    q.lights_per_update = 1;
    c = check_open_context(&w.scene, &q);
    w.gaussians[1].c *= 0.5f;
    w.scene.light_count = 8;
    assert_int_equal(redone(c, &w.scene, &q), 3 + 1);
    lights[7].kind = SCATTER_LIGHT_POINT;
    assert_int_equal(redone(c, &w.scene, &q), 1 + 1);
    q.grid = 12; /* nothing fits any more */
    assert_int_equal(redone(c, &w.scene, &q), 8);
    w.gaussians[1].center.x += 5.0f; /* out of the lattice's box: all suns */
    assert_int_equal(redone(c, &w.scene, &q), 7 + 1);
    scatter_destroy(c);
}

/* ------------------------------------------------------- >>hosts */

/* Whatever changes in whatever order: nothing is read that was not written (memory holds NaN), and
   once all is redone the picture has the bits of a fresh context's. */
static void shake(check_world *w, scatter_light *lights, scatter_quality *q, uint64_t *seed)
{
    int i;
    switch (check_bits(seed) % 8) {
    case 0: w->scene.light_count = check_bits(seed) % 12; break;
    case 1: fill_mixed(lights, 12); break;
    case 2: fill_sky(lights, 12, 3); break;
    case 3: lights[check_bits(seed) % 12].direction = check_direction(seed); break;
    case 4: q->grid = 2 + (int)(check_bits(seed) % 12); break;
    case 5:
        i = (int)(check_bits(seed) % 8);
        w->gaussians[i].center = check_point(seed, -0.5f, 1.5f);
        break;
    case 6: w->scene.medium.gaussian_count = check_bits(seed) % 3 ? 8 : 0; break;
    case 7: q->depth = volumes[check_bits(seed) % 3]; break;
    }
    q->lights_per_update = (int)(check_bits(seed) % 4);
}

static void *allocate_nan(void *user, size_t bytes)
{
    void *memory = malloc(bytes);
    (void)user;
    return memory ? memset(memory, 0xff, bytes) : NULL;
}

static void release_nan(void *user, void *memory)
{
    (void)user;
    free(memory);
}

static void test_any_changes(void **state)
{
    static float rgb[FLOATS], fresh[FLOATS];
    scatter_quality q = quality_of(SCATTER_DEPTH_POLAR, 8);
    scatter_light lights[MANY];
    scatter_host host;
    scatter_context *c = NULL;
    check_world w;
    uint64_t seed = 99;
    int i, k, broken = 0;
    (void)state;
    memset(&host, 0, sizeof host);
    host.allocate = allocate_nan;
    host.release = release_nan;
    open_cloud(&w);
    w.scene.lights = lights;
    w.scene.light_count = 3;
    fill_sky(lights, MANY, 3.0f);
    assert_int_equal(scatter_create(&host, &c), SCATTER_OK);
    for (i = 0; i < 400; i++) {
        shake(&w, lights, &q, &seed);
        assert_int_equal(scatter_update(c, &w.scene, &q), SCATTER_OK);
        draw(c, rgb);
        for (k = 0; k < FLOATS; k++)
            broken += !(rgb[k] >= 0.0f && rgb[k] < 1e6f);
        if (i % 8 != 7)
            continue;
        q.lights_per_update = 0;
        assert_int_equal(scatter_update(c, &w.scene, &q), SCATTER_OK);
        w.gaussians[2].c += 0.01f; /* the lattice's box may have been kept: now it is not */
        w.gaussians[2].center.x += 1e-4f;
        assert_int_equal(scatter_update(c, &w.scene, &q), SCATTER_OK);
        draw(c, rgb);
        draw_scene(&w.scene, &q, fresh);
        assert_true(memcmp(rgb, fresh, sizeof rgb) == 0);
    }
    assert_int_equal(broken, 0);
    scatter_destroy(c);
}

/* Voxels that change every frame, in place or in another array. */
static void test_no_allocation_after_the_first(void **state)
{
    static float rgb[FLOATS], fresh[FLOATS];
    scatter_quality q = quality_of(SCATTER_DEPTH_POLAR, 20);
    scatter_light lights[MANY];
    check_host books;
    scatter_host host = check_host_open(&books, 2);
    scatter_context *c = NULL;
    check_world w;
    size_t calls = 0;
    int frame, i;
    (void)state;
    check_world_open(&w);
    check_add_grid(&w, 9, 9, 9, check_cube(0, 1), 1);
    check_add_grid(&w, 9, 9, 9, check_cube(0, 1), 2);
    w.scene.medium.grid_count = 1;
    w.scene.lights = lights;
    w.scene.light_count = 9;
    fill_sky(lights, 9, 4.0f);
    assert_int_equal(scatter_create(&host, &c), SCATTER_OK);
    for (frame = 0; frame < 8; frame++) {
        q.lights_per_update = frame % 3;
        w.grids[0].density = w.voxels[frame % 2];
        w.grids[0].version += frame % 4 == 3;
        for (i = 0; i < 729 && frame % 4 == 3; i++)
            w.voxels[frame % 2][i] *= 0.8f;
        lights[frame % 9].direction = directions[frame % 8];
        assert_int_equal(scatter_update(c, &w.scene, &q), SCATTER_OK);
        calls = frame == 0 ? books.calls : calls;
    }
    assert_int_equal(books.calls, calls);
    q.lights_per_update = 0;
    assert_int_equal(scatter_update(c, &w.scene, &q), SCATTER_OK);
    draw(c, rgb);
    draw_scene(&w.scene, &q, fresh);
    assert_true(memcmp(rgb, fresh, sizeof rgb) == 0);
    w.grids[0].version++; /* the same version with other values is not seen: the check can fail */
    w.voxels[1][300] += 1.0f;
    assert_int_equal(scatter_update(c, &w.scene, &q), SCATTER_OK);
    draw(c, rgb);
    assert_true(memcmp(rgb, fresh, sizeof rgb) != 0);
    scatter_destroy(c);
    assert_int_equal(books.live, 0);
}

static void test_threads(void **state)
{
    static float one[FLOATS], other[FLOATS];
    static const int threads[] = {1, 2, 7};
    scatter_quality q = quality_of(SCATTER_DEPTH_POLAR, 24);
    scatter_light lights[MANY];
    check_world w;
    int t;
    (void)state;
    open_cloud(&w);
    check_add_grid(&w, 7, 8, 9, check_cube(0.2f, 0.8f), 1);
    w.scene.lights = lights;
    w.scene.light_count = 21;
    fill_mixed(lights, 21);
    draw_scene(&w.scene, &q, one);
    for (t = 0; t < 3; t++) {
        check_host books;
        scatter_host host = check_host_open(&books, threads[t]);
        scatter_context *c = NULL;
        books.reverse = t == 2;
        assert_int_equal(scatter_create(&host, &c), SCATTER_OK);
        assert_int_equal(scatter_update(c, &w.scene, &q), SCATTER_OK);
        draw(c, other);
        scatter_destroy(c);
        assert_true(memcmp(one, other, sizeof one) == 0);
    }
}

/* The n-th allocation fails: the update says so, and the next one works. */
static void test_failing_memory(void **state)
{
    static float fresh[FLOATS], rgb[FLOATS];
    scatter_quality q = quality_of(SCATTER_DEPTH_POLAR, 16);
    scatter_light lights[MANY];
    check_world w;
    size_t n, failed = 0;
    (void)state;
    open_cloud(&w);
    w.scene.lights = lights;
    w.scene.light_count = 10;
    fill_mixed(lights, 10);
    q.lights_per_update = 2;
    draw_scene(&w.scene, &q, fresh);
    for (n = 2; n < 40; n++) {
        check_host books;
        scatter_host host = check_host_open(&books, 0);
        scatter_context *c = NULL;
        assert_int_equal(scatter_create(&host, &c), SCATTER_OK);
        books.fail_at = n;
        failed += scatter_update(c, &w.scene, &q) == SCATTER_OUT_OF_MEMORY;
        books.fail_at = 0;
        assert_int_equal(scatter_update(c, &w.scene, &q), SCATTER_OK);
        draw(c, rgb);
        assert_true(memcmp(rgb, fresh, sizeof rgb) == 0);
        scatter_destroy(c);
        assert_int_equal(books.live, 0);
    }
    assert_at_least((double)failed, 8);
}

/* By default all lattices together are 256 MB at most, and a few lights lose nothing to that. */
static void test_default_grid(void **state)
{
    scatter_medium m;
    scatter_grid grid;
    size_t lights;
    (void)state;
    memset(&m, 0, sizeof m);
    memset(&grid, 0, sizeof grid);
    grid.nx = grid.ny = grid.nz = 256;
    m.grids = &grid;
    m.grid_count = 1;
    assert_int_equal(scatteri_choose_grid(0, &m, 0), 256);
    assert_int_equal(scatteri_choose_grid(0, &m, 4), 256);
    assert_int_equal(scatteri_choose_grid(100, &m, 400), 100);
    for (lights = 1; lights <= 256; lights++) {
        double n = scatteri_choose_grid(0, &m, lights);
        assert_at_most(n * n * n * (double)lights, 67108864);
        assert_at_least((n + 1) * (n + 1) * (n + 1) * (double)lights, n < 256 ? 67108864 : 0);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_depth_is_second_order),
        cmocka_unit_test(test_depth_of_voxels),
        cmocka_unit_test(test_depth_of_a_block),
        cmocka_unit_test(test_depth_in_a_long_box),
        cmocka_unit_test(test_superposition),
        cmocka_unit_test(test_order_of_lights_does_not_matter),
        cmocka_unit_test(test_mixed_lights),
        cmocka_unit_test(test_media),
        cmocka_unit_test(test_sky_against_closed_form),
        cmocka_unit_test(test_surface_under_a_sky),
        cmocka_unit_test(test_lights_in_turn),
        cmocka_unit_test(test_nobody_starves),
        cmocka_unit_test(test_phase_is_current),
        cmocka_unit_test(test_new_lights_do_not_wait),
        cmocka_unit_test(test_any_changes),
        cmocka_unit_test(test_no_allocation_after_the_first),
        cmocka_unit_test(test_threads),
        cmocka_unit_test(test_failing_memory),
        cmocka_unit_test(test_default_grid),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
