/* hard_cases.c - the inputs on which renderers fail, each with the bound that it must keep.

   Each case is one call of hard_row, which prints a row of the table in docs/accuracy.md and is
   the assertion as well; `make accuracy` puts the rows into the page. Bounds are promises of
   scatter.h and of docs/accuracy.md, or come from the error analysis beside them:

     PROMISE_16, PROMISE_64   error of images of smooth media at 16 and 64 nodes
     DEPTH                    relative error of scatter_density and scatter_optical_depth
     ULP                      2^-24: what rounding to float may change, relative

   The truth is tests/reference.c, a closed formula, or the same picture taken in another way. Each
   kind of check is also given something wrong, which it must refuse: see hard_fault. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#define SCATTER_IMPLEMENTATION
#include "../scatter.h"
#include "check.h"
#include "reference.h"

#include <sys/mman.h>
#include <unistd.h>

#define PROMISE_16 5e-3
#define PROMISE_64 1e-4
#define DEPTH 1e-5
#define ULP 5.97e-8

enum { WIDE = 24, HIGH = 16, PIXELS = WIDE * HIGH, FLOATS = 3 * PIXELS };

/* -------------------------------------------------------- >>rows */

static int broken; /* rows above their bound since the last call of rows_hold */

/* NaN is above every bound. */
static int exceeds(double measured, double bound) { return !(measured <= bound); }

/* The row of one case: printed, and remembered if it is above its bound. */
static void hard_row(const char *name, const char *risk, double bound, double measured) {
    printf("row | %s | %s | %.2g | %.2g |\n", name, risk, bound, measured);
    broken += exceeds(measured, bound);
}

/* The same check on something wrong, which must be above the bound. */
static void hard_fault(const char *name, double bound, double measured) {
    printf("planted: %s: %.2g against %.2g\n", name, measured, bound);
    assert_true(exceeds(measured, bound));
}

static void rows_hold(void) {
    int n = broken;
    broken = 0;
    assert_int_equal(n, 0);
}

/* ------------------------------------------------------ >>scenes */

static const scatter_vec3 white = {4.0f, 4.0f, 4.0f};

static scatter_vec3 grey(float v) { return check_v3(v, v, v); }

static scatter_light *add_lamp(check_world *w, float x, float y, float z) {
    return check_add_light(w, SCATTER_LIGHT_POINT, check_v3(x, y, z), white);
}

/* Four puffs in the unit cube, opaque enough to shadow each other, no lights. */
static void open_puffs(check_world *w) {
    check_world_open(w);
    check_add_gaussians(w, 4, 1.5f, 4.0f, 31);
}

/* A cube of constant fog, no lights. */
static void open_cube(check_world *w) {
    check_world_open(w);
    w->scene.medium.constant = 1;
    check_bound(w, check_cube(0, 1));
}

static scatter_view look(float x, float y, float z, scatter_vec3 target, float fov) {
    return scatter_view_perspective(check_v3(x, y, z), target, check_v3(0, 1, 0), fov,
                                    (float)WIDE / HIGH);
}

/* At the unit cube, from before it. */
static scatter_view front_view(void) {
    return look(0.5f, 0.6f, -2.0f, check_v3(0.5f, 0.5f, 0.5f), 0.7f);
}

/* Rays side by side through the points near `target`, from `away` m before it. */
static scatter_view beam(scatter_vec3 target, scatter_vec3 along, float away, float height) {
    return scatter_view_orthographic(check_along(target, -away, along), target,
                                     check_v3(0.1f, 1, 0.2f), height, (float)WIDE / HIGH);
}

static scatter_quality nodes(int n) {
    scatter_quality q;
    memset(&q, 0, sizeof q);
    q.depth = SCATTER_DEPTH_CLOSED;
    q.density = SCATTER_DENSITY_EXACT;
    q.nodes = n;
    return q;
}

static scatter_quality volumes(scatter_depth_method depth, int grid) {
    scatter_quality q = nodes(64);
    q.depth = depth;
    q.grid = grid;
    return q;
}

/* ---------------------------------------------------- >>pictures */

static void render(const scatter_context *context, scatter_view view, float *rgb) {
    scatter_image image;
    memset(&image, 0, sizeof image);
    image.width = WIDE;
    image.height = HIGH;
    image.rgb = rgb;
    assert_int_equal(scatter_render(context, &view, &image), SCATTER_OK);
}

static void shoot(const scatter_scene *scene, scatter_view view, scatter_quality q, float *rgb) {
    scatter_context *context = check_open_context(scene, &q);
    render(context, view, rgb);
    scatter_destroy(context);
}

/* Relative RMSE, as docs/accuracy.md defines it; the reference's NaN or infinity is no number. */
static double image_error(const float *rgb, const float *truth) {
    check_error e = check_no_error();
    int i;
    for (i = 0; i < FLOATS; i++)
        check_add(&e, rgb[i], truth[i]);
    return check_rms(&e);
}

static void see_truth(const scatter_scene *scene, scatter_view view, float *rgb) {
    assert_int_equal(reference_image(scene, &view, WIDE, HIGH, rgb, 2), 0);
}

static double error_against(const float *truth, const check_world *w, scatter_view view,
                            scatter_quality q) {
    static float rgb[FLOATS];
    shoot(&w->scene, view, q, rgb);
    return image_error(rgb, truth);
}

static double error_of(const check_world *w, scatter_view view, scatter_quality q) {
    static float truth[FLOATS];
    see_truth(&w->scene, view, truth);
    return error_against(truth, w, view, q);
}

/* Difference of the pictures of two scenes. */
static double difference(const check_world *a, scatter_view view_a, const check_world *b,
                         scatter_view view_b, scatter_quality q) {
    static float first[FLOATS];
    shoot(&a->scene, view_a, q, first);
    return error_against(first, b, view_b, q);
}

/* Two rows: the picture at 16 and at 64 nodes keeps what is promised for smooth media. */
static void promise_rows(const char *name, const char *risk, const check_world *w,
                         scatter_view view) {
    static float truth[FLOATS];
    char label[160];
    see_truth(&w->scene, view, truth);
    snprintf(label, sizeof label, "%s, 16 nodes", name);
    hard_row(label, risk, PROMISE_16, error_against(truth, w, view, nodes(16)));
    snprintf(label, sizeof label, "%s, 64 nodes", name);
    hard_row(label, risk, PROMISE_64, error_against(truth, w, view, nodes(64)));
}

/* Values that are not finite and >= 0. */
static int count_bad(const float *rgb) {
    int i, bad = 0;
    for (i = 0; i < FLOATS; i++)
        bad += !(isfinite(rgb[i]) && rgb[i] >= 0);
    return bad;
}

static int bad_pixels(const check_world *w, scatter_view view, scatter_quality q) {
    static float rgb[FLOATS];
    shoot(&w->scene, view, q, rgb);
    return count_bad(rgb);
}

/* ------------------------------------- >>planted faults of pictures */

static void test_measures_can_fail(void **state) {
    static float good[FLOATS], bad[FLOATS];
    int i;
    (void)state;
    for (i = 0; i < FLOATS; i++)
        good[i] = bad[i] = 1;
    assert_false(exceeds(1, 1));
    assert_true(exceeds(1.01, 1) && exceeds((double)NAN, 1));
    assert_true(image_error(good, bad) == 0 && count_bad(good) == 0);
    bad[7] = -1e-30f;
    assert_int_equal(count_bad(bad), 1);
    bad[8] = INFINITY;
    assert_int_equal(count_bad(bad), 2);
    assert_true(exceeds(image_error(bad, good), 1e30));
    bad[8] = NAN;
    assert_int_equal(count_bad(bad), 2);
    assert_true(exceeds(image_error(bad, good), 1e30) && exceeds(image_error(good, bad), 1e30));
}

static void fault_light(check_world *w) { w->lights[0].intensity.y *= 1.01f; }
static void fault_place(check_world *w) { w->lights[0].position.x += 0.001f; }
static void fault_radius(check_world *w) { w->lights[0].radius = 0.05f; }
static void fault_center(check_world *w) { w->gaussians[1].center.y += 0.002f; }
static void fault_width(check_world *w) { w->gaussians[2].a *= 1.003f; }
static void fault_albedo(check_world *w) { w->scene.medium.albedo.z -= 0.01f; }
static void fault_phase(check_world *w) { w->scene.medium.phase.g = 0.01f; }

/* The comparison of pictures sees that the reference was given another scene. */
static void test_pictures_can_fail(void **state) {
    static void (*const faults[])(check_world *) = {fault_light, fault_place, fault_radius,
                                                    fault_center, fault_width, fault_albedo,
                                                    fault_phase};
    static float truth[FLOATS];
    check_world w;
    size_t i;
    (void)state;
    open_puffs(&w);
    w.scene.medium.phase.kind = SCATTER_PHASE_HG;
    add_lamp(&w, 0.5f, 0.9f, 0.3f);
    see_truth(&w.scene, front_view(), truth);
    assert_at_most(error_against(truth, &w, front_view(), nodes(64)), PROMISE_64);
    for (i = 0; i < CHECK_COUNT(faults); i++) {
        check_world other;
        open_puffs(&other);
        other.scene.medium.phase.kind = SCATTER_PHASE_HG;
        add_lamp(&other, 0.5f, 0.9f, 0.3f);
        faults[i](&other);
        hard_fault("another scene", PROMISE_64,
                   error_against(truth, &other, front_view(), nodes(64)));
    }
}

/* ------------------------------------------------------ >>lights */

/* Rays that pass an ideal lamp at 1.4e-6 m and more, from 0.25 m away. */
static void test_light_near_ray(void **state) {
    static const scatter_vec3 along[] = {{0, 0, 1}, {0.36f, -0.48f, 0.8f}};
    static const char *names[] = {"ideal lamp 1e-6 m beside rays along an axis",
                                  "ideal lamp 1e-6 m beside oblique rays"};
    check_world w;
    int i;
    (void)state;
    for (i = 0; i < 2; i++) {
        scatter_view view = beam(check_v3(0, 0, 0), along[i], 0.25f, 16e-6f);
        open_puffs(&w);
        add_lamp(&w, 0, 0, 0)->radius = 0;
        /* L ~ 1/d. A unit vector of floats has a length wrong by 1.5e-7 + 2 ULP (rsqrt, products)
           and points beside by 2 ULP: at 0.25 m the ray is off by 0.25 (3e-7 + 4 ULP) = 1.4e-7 m of
           the 1.4e-6 m */
        hard_row(names[i], "position on the ray cancels in t - t0, 1/d explodes", 0.1,
                 error_of(&w, view, nodes(64)));
        w.lights[0].radius = 0.01f;
        promise_rows(i ? "lamp of 1 cm 1e-6 m beside oblique rays"
                       : "lamp of 1 cm 1e-6 m beside rays along an axis",
                     "the same, tamed by the radius", &w, view);
    }
    rows_hold();
}

/* A floor y = 0 of grey paint. */
static int floor_below(void *user, scatter_vec3 o, scatter_vec3 d, scatter_surface *hit) {
    float length = sqrtf(d.x * d.x + d.y * d.y + d.z * d.z);
    (void)user;
    if (!(d.y < 0 && o.y > 0))
        return 0;
    memset(hit, 0, sizeof *hit);
    hit->distance = -o.y / d.y * length;
    hit->normal = check_v3(0, 1, 0);
    hit->albedo = check_v3(0.8f, 0.5f, 0.2f);
    return 1;
}

static void test_light_near_surface(void **state) {
    scatter_view view = beam(check_v3(0, 0, 0), check_v3(0.36f, -0.8f, 0.48f), 0.25f, 16e-6f);
    check_world w;
    (void)state;
    open_puffs(&w);
    w.scene.surface = floor_below;
    add_lamp(&w, 0, 1e-6f, 0)->radius = 0;
    /* the floor is lit as I h/r^3, r >= h the way to the lamp: 0.25 m of ray put the point beside
       by 0.25 (1.5e-7 + 4 ULP) = 1e-7 m (rsqrt, roundings), which h and r^3 feel four times */
    hard_row("ideal lamp 1e-6 m above a surface", "its height over the point that is hit cancels",
             0.4, error_of(&w, view, nodes(64)));
    view = beam(check_v3(0, 0, 0), check_v3(0.36f, -0.8f, 0.48f), 0.25f, 16e-3f);
    w.lights[0].position.y = 1e-3f;
    hard_row("ideal lamp 1e-3 m above a surface", "the same, 1000 times less",
             PROMISE_64 + 0.4e-3, error_of(&w, view, nodes(64)));
    w.lights[0].radius = 1e-3f;
    promise_rows("lamp of 1 mm there", "the same, tamed by the radius", &w, view);
    rows_hold();
}

static void test_light_near_center(void **state) {
    check_world w;
    (void)state;
    open_puffs(&w);
    add_lamp(&w, w.gaussians[1].center.x, w.gaussians[1].center.y, w.gaussians[1].center.z);
    w.lights[0].position.x += 1e-6f;
    promise_rows("lamp 1e-6 m beside the centre of a Gaussian",
                 "the foot of the perpendicular has no direction", &w, front_view());
    w.lights[0].radius = 0;
    promise_rows("ideal lamp there", "the same with a singular irradiance", &w, front_view());
    rows_hold();
}

static void test_lamp_radius(void **state) {
    static const float radii[] = {0, 1e-6f, 100};
    static const char *names[] = {"lamp of radius 0", "lamp of radius 1e-6 m",
                                  "lamp of radius 100 m"};
    static const char *risks[] = {"division by 0", "a peak that no node meets",
                                  "the map of the ray is nearly straight, R^2 swallows r^2"};
    check_world w;
    int i;
    (void)state;
    for (i = 0; i < 3; i++) {
        open_puffs(&w);
        add_lamp(&w, 0.53f, 0.7f, 0.4f)->radius = radii[i];
        promise_rows(names[i], risks[i], &w, front_view());
    }
    rows_hold();
}

static void test_light_at_eye(void **state) {
    scatter_view view = look(0.5f, 0.5f, -1, check_v3(0.5f, 0.5f, 0.5f), 0.7f);
    check_world w;
    (void)state;
    open_cube(&w);
    add_lamp(&w, 0.5f, 0.5f, -1)->radius = 0;
    promise_rows("light and eye at one point, medium ahead", "every ray meets the lamp at t = 0",
                 &w, view);
    w.scene.medium.bounds = check_cube(-2, 2);
    w.lights[0].radius = 0.01f;
    promise_rows("light and eye at one point in the medium", "the peak is cut in half by the eye",
                 &w, view);
    w.lights[0].radius = 0;
    /* the truth is infinite there */
    hard_row("the same with an ideal lamp: pixels that are not finite", "0/0", 0,
             bad_pixels(&w, view, nodes(16)));
    rows_hold();
}

/* The cube lit from somewhere around it. */
static void test_light_places(void **state) {
    static const char *names[] = {"light outside the bounds", "light on a face of the bounds",
                                  "light on an edge", "light in a corner"};
    static const scatter_vec3 places[] = {{2, 1.5f, -0.5f}, {0.5f, 1, 0.25f}, {0, 1, 0.25f},
                                          {1, 1, 1}};
    check_world w;
    int i;
    (void)state;
    for (i = 0; i < 4; i++) {
        open_puffs(&w);
        w.scene.medium.constant = 0.25f;
        check_bound(&w, check_cube(0, 1));
        add_lamp(&w, places[i].x, places[i].y, places[i].z);
        promise_rows(names[i], "segments to it are clipped to nothing, or not at all", &w,
                     front_view());
    }
    rows_hold();
}

/* A point light at 1e6 m of I = E r^2, seen as the directional light of E that it becomes. */
static void test_light_far(void **state) {
    static float truth[FLOATS];
    const float far = 1e6f;
    check_world w;
    (void)state;
    open_puffs(&w);
    check_add_light(&w, SCATTER_LIGHT_DIRECTIONAL, check_v3(-0.6f, -0.8f, 0), grey(2));
    see_truth(&w.scene, front_view(), truth);
    w.lights[0].kind = SCATTER_LIGHT_POINT;
    w.lights[0].position = check_v3(0.6f * far, 0.8f * far, 0);
    w.lights[0].intensity = grey(2 * far * far);
    /* the scene's 2 m change irradiance and direction by 4e-6 */
    hard_row("light at 1e6 m, against a directional one", "1/r^2 and the direction lose digits",
             PROMISE_64 + 4e-6, error_against(truth, &w, front_view(), nodes(64)));
    w.lights[0].position = check_v3(0.6f * far, 0.81f * far, 0);
    hard_fault("another sun", PROMISE_64 + 4e-6, error_against(truth, &w, front_view(), nodes(64)));
    rows_hold();
}

static void many_lights(check_world *w, scatter_light *lights, int count) {
    uint64_t seed = 64;
    int i;
    memset(lights, 0, (size_t)count * sizeof *lights);
    for (i = 0; i < count; i++) {
        lights[i].kind = (scatter_light_kind)(i % 3);
        lights[i].position = check_point(&seed, -0.5f, 1.5f);
        lights[i].direction = check_minus(grey(0.5f), lights[i].position);
        lights[i].intensity = check_point(&seed, 0, 0.2f);
        lights[i].radius = 0.01f;
        lights[i].outer = 3;
    }
    w->scene.lights = lights;
    w->scene.light_count = (size_t)count;
}

static void test_many_lights(void **state) {
    static scatter_light lights[64];
    check_world w;
    (void)state;
    open_puffs(&w);
    many_lights(&w, lights, 64);
    promise_rows("64 lights of all kinds", "sums of many terms, nodes shared by lights", &w,
                 front_view());
    rows_hold();
}

/* ------------------------------------------- >>thin and opaque */

static void test_thin(void **state) {
    check_world w;
    float tau;
    double truth;
    (void)state;
    open_puffs(&w);
    add_lamp(&w, 0.5f, 0.9f, 0.3f);
    w.scene.medium.extinction = grey(1e-8f);
    promise_rows("optical depth 1e-8: the light it scatters", "1 - T is 0 in float", &w,
                 front_view());
    open_puffs(&w);
    w.gaussians[0].c = w.gaussians[1].c = w.gaussians[2].c = w.gaussians[3].c = 1e-8f;
    tau = scatter_optical_depth(&w.scene.medium, check_v3(0.2f, 0.4f, -1), check_v3(0.7f, 0.5f, 2));
    truth = reference_optical_depth(&w.scene.medium, check_v3(0.2f, 0.4f, -1),
                                    check_v3(0.7f, 0.5f, 2));
    hard_row("optical depth 1e-8: scatter_optical_depth", "differences of erf lose small depths",
             DEPTH, fabs(tau / truth - 1));
    hard_fault("a depth a ten-thousandth too large", DEPTH, fabs(1.0001 * tau / truth - 1));
    rows_hold();
}

static double brightest(const check_world *w, scatter_view view, scatter_quality q) {
    static float rgb[FLOATS];
    double most = 0;
    int i;
    shoot(&w->scene, view, q, rgb);
    for (i = 0; i < FLOATS; i++)
        most = rgb[i] > most || isnan(rgb[i]) ? rgb[i] : most;
    return most;
}

/* A cube of depth 1e4, seen from the lit side and from behind. */
static void test_opaque(void **state) {
    check_world w;
    (void)state;
    open_cube(&w);
    w.scene.medium.extinction = grey(1e4f);
    add_lamp(&w, 0.4f, 0.7f, -1);
    /* all light comes from the first 1e-4 m, 2 m to 2.7 m away: where the ray enters, where the node
       is and where its light enters are each one rounding of such a length, times 1e4/m */
    hard_row("depth 1e4 of constant fog, lit from the front", "positions cancel: 1e-4 m at 2 m",
             PROMISE_64 + 1e4 * 3 * 2.7 * ULP, error_of(&w, front_view(), nodes(64)));
    w.lights[0].position.z = 2;
    /* exp of anything beyond 87 is at most 1.7e-38 in each node: 4 W/sr at 1 m and 256 nodes */
    hard_row("depth 1e4 from behind: brightest pixel", "underflow leaves noise or NaN", 4 * 1.7e-34,
             brightest(&w, front_view(), nodes(64)));
    open_puffs(&w);
    w.scene.medium.extinction = grey(1e4f);
    add_lamp(&w, 0.4f, 0.7f, -1);
    /* docs/theory.md: what is dropped of a Gaussian is at most exp(-14) m deep, times 1e4/m */
    hard_row("Gaussians of depth 1e4, lit from the front", "what is cut off is opaque as well",
             PROMISE_64 + 1e4 * exp(-14), error_of(&w, front_view(), nodes(64)));
    hard_row("Gaussians of depth 1e4: pixels that are not finite", "underflow, NaN", 0,
             bad_pixels(&w, front_view(), nodes(16)));
    rows_hold();
}

/* ---------------------------------------------------- >>Gaussians */

static void test_wide_gaussian(void **state) {
    check_world w;
    (void)state;
    check_world_open(&w);
    check_add_gaussian(&w, check_v3(3, -2, 5), 1e-3f, 1.5f);
    check_bound(&w, check_cube(0, 1));
    add_lamp(&w, 0.4f, 0.7f, 0.3f);
    /* docs/accuracy.md: the depth is wrong by 4e-7 of the Gaussian's on the whole line, which is
       c sqrt(pi)/a, on the way of the light and on that of the eye */
    hard_row("Gaussian 1000 times wider than the bounds", "differences of nearly equal erf",
             PROMISE_64 + 2 * 4e-7 * 1.5 * sqrt(CHECK_PI) * 1e3,
             error_of(&w, front_view(), nodes(64)));
    rows_hold();
}

/* Amplitude times extinction is what counts. */
static void test_large_amplitude(void **state) {
    check_world w;
    size_t i;
    (void)state;
    open_puffs(&w);
    for (i = 0; i < 4; i++)
        w.gaussians[i].c *= 1e6f;
    w.scene.medium.extinction = grey(1e-6f);
    add_lamp(&w, 0.5f, 0.9f, 0.3f);
    promise_rows("amplitude 1e6, extinction 1e-6", "cut-offs in density instead of depth", &w,
                 front_view());
    w.scene.medium.extinction = grey(1);
    w.lights[0].position = check_v3(0.4f, 0.7f, -3);
    promise_rows("amplitude 1e6, extinction 1", "visible out to five widths, opaque at four", &w,
                 front_view());
    rows_hold();
}

static void test_overlapping(void **state) {
    check_world w;
    (void)state;
    check_world_open(&w);
    check_add_gaussians(&w, 30, 1.0f, 3.0f, 30);
    w.scene.medium.extinction = grey(0.2f);
    add_lamp(&w, 0.5f, 0.9f, 0.3f);
    promise_rows("30 overlapping Gaussians", "sums of many terms", &w, front_view());
    rows_hold();
}

/* A Gaussian 1000 times narrower than the 64th part of the cube, on the axis of the picture. */
static void test_narrow_gaussian(void **state) {
    const float a = 64000;
    scatter_view view = beam(check_v3(0.5f, 0.5f, 0.5f), check_v3(0, 0, 1), 2, 2e-4f);
    check_world w;
    (void)state;
    check_world_open(&w);
    check_add_gaussian(&w, check_v3(0.5f, 0.5f, 0.5f), a, a);
    add_lamp(&w, 0.5f, 0.9f, 0.3f);
    /* 2 m of ray in floats are 2 ULP off, 1.2e-7 m of the 1.6e-5 m width */
    hard_row("Gaussian 1000 times narrower than a cell, alone", "no node meets it",
             PROMISE_64 + 2 * ULP * (double)a, error_of(&w, view, nodes(64)));
    hard_row("its picture from 64^3 volumes: pixels that are not finite", "one cell holds it all",
             0, bad_pixels(&w, view, volumes(SCATTER_DEPTH_POLAR, 64)));
    rows_hold();
}

/* Among the puffs, seen so near that it fills the picture. */
static double narrow_error(float a, int n) {
    scatter_vec3 b = {0.5f, 0.52f, 0.47f};
    check_world w;
    open_puffs(&w);
    check_add_gaussian(&w, b, a, a);
    add_lamp(&w, 0.5f, 0.9f, 0.3f);
    return error_of(&w, beam(b, check_v3(0.1f, 0.2f, 0.97f), 2, 12 / a), nodes(n));
}

/* What the picture is worth if it is not seen at all. */
static double narrow_missed(float a) {
    static float truth[FLOATS];
    scatter_vec3 b = {0.5f, 0.52f, 0.47f};
    scatter_view view = beam(b, check_v3(0.1f, 0.2f, 0.97f), 2, 12 / a);
    check_world w;
    open_puffs(&w);
    add_lamp(&w, 0.5f, 0.9f, 0.3f);
    check_add_gaussian(&w, b, a, a);
    see_truth(&w.scene, view, truth);
    w.scene.medium.gaussian_count--;
    return error_against(truth, &w, view, nodes(64));
}

static void test_narrow_among_wide(void **state) {
    int i;
    (void)state;
    hard_row("Gaussian 1000 times narrower than the ray, among wide ones, 16 nodes",
             "no node meets it", PROMISE_16, narrow_error(500, 16));
    hard_row("Gaussian 1000 times narrower than the ray, among wide ones, 64 nodes",
             "no node meets it", PROMISE_64, narrow_error(500, 64));
    /* README.md: resolved up to about a thousand times narrower than the ray. Beyond that it is
       missed, or a node that meets it counts for its neighbourhood: of 3.5 m of ray in 256 panels
       the nodes of Gauss and Legendre are pi/2 parts wide, the Gaussian sqrt(pi)/a */
    for (i = 0; i < 2; i++) {
        int n = i ? 32 : 16;
        double spark = 3.5 / 256 / n * 0.5 * CHECK_PI * 64000 / sqrt(CHECK_PI);
        hard_row(i ? "Gaussian 1000 times narrower than a cell, among wide ones, 32 nodes"
                   : "Gaussian 1000 times narrower than a cell, among wide ones, 16 nodes",
                 "sparks", spark * narrow_missed(64000), narrow_error(64000, n));
    }
    rows_hold();
}

/* Injection samples at cell centres: on a centre the narrow Gaussian counts whole, else not. */
static void test_narrow_injected(void **state) {
    static float values[64 * 64 * 64];
    scatter_volume volume = {values, 64, 64, 64, {{0, 0, 0}, {1, 1, 1}}};
    check_world w;
    double worst = 0, sum = 0;
    int i;
    (void)state;
    open_puffs(&w);
    check_add_gaussian(&w, check_v3(32.5f / 64, 20.5f / 64, 7.5f / 64), 64000, 10);
    check_add_gaussian(&w, grey(0.5f), 64000, 1000);
    assert_int_equal(scatter_inject(NULL, &w.scene.medium, &volume), SCATTER_OK);
    for (i = 0; i < 64 * 64 * 64; i++) {
        double x = (i % 64 + 0.5) / 64, y = (i / 64 % 64 + 0.5) / 64, z = (i / 4096 + 0.5) / 64;
        double d = reference_density(&w.scene.medium, check_v3((float)x, (float)y, (float)z));
        worst = fmax(worst, fabs(values[i] - d));
        sum = fmax(sum, d);
    }
    /* Gaussians are cut off at exp(-14) of their peak, 8.4e-7: four of at most 3 */
    hard_row("Gaussians 1000 times narrower than a cell, injected", "smeared, or in another cell",
             DEPTH * sum + 4 * 3 * 8.4e-7, worst);
    values[123] += 0.001f;
    hard_fault("one cell off", DEPTH * sum + 4 * 3 * 8.4e-7,
               fabs(values[123] - reference_density(&w.scene.medium, check_v3(123.5f / 64, 0.5f / 64,
                                                                              0.5f / 64))));
    rows_hold();
}

/* ------------------------------------------ >>albedo and phase */

static void test_albedo(void **state) {
    check_world w;
    (void)state;
    open_puffs(&w);
    add_lamp(&w, 0.5f, 0.9f, 0.3f);
    w.scene.medium.albedo = grey(1);
    promise_rows("albedo 1", "more out than in", &w, front_view());
    w.scene.medium.albedo = grey(0);
    hard_row("albedo 0: brightest pixel", "light from nowhere", 0,
             brightest(&w, front_view(), nodes(16)));
    w.scene.medium.albedo = grey(1e-6f);
    hard_fault("albedo 1e-6", 0, brightest(&w, front_view(), nodes(16)));
    rows_hold();
}

/* Into and away from a lamp behind the puffs, and a sun that stands in the picture. */
static void test_phase_value(void **state) {
    static const float g[] = {0, 0.99f, -0.99f, 0.9999f, -0.9999f};
    double worst = 0;
    size_t i;
    int k;
    (void)state;
    for (i = 0; i < CHECK_COUNT(g); i++) {
        scatter_phase phase = {SCATTER_PHASE_HG, 0, 0, 0};
        phase.g = g[i];
        for (k = 0; k <= 400; k++) {
            float c = (float)ldexp(1, -k / 8), cosine = (k & 1 ? -1.0f : 1.0f) * (1 - c);
            double truth = reference_phase(&phase, cosine);
            worst = fmax(worst, fabs(scatter_phase_value(&phase, cosine) / truth - 1));
        }
    }
    /* scatter.h states 1e-6 for its formula; g near 1 is a float, and 1 - g keeps ULP/1e-4 */
    hard_row("g up to 0.9999: scatter_phase_value", "1 - cos of small angles, 1 + cos of large ones",
             1e-6, worst);
    {
        scatter_phase phase = {SCATTER_PHASE_HG, 0.99f, 0, 0}, other = {SCATTER_PHASE_HG, 0.98999f, 0, 0};
        hard_fault("another g", 1e-6, fabs(scatter_phase_value(&phase, 1) / reference_phase(&other, 1) - 1));
    }
    rows_hold();
}

static void test_anisotropy(void **state) {
    static const float g[] = {0, 0.99f, -0.99f, 0.9999f, -0.9999f};
    check_world w;
    char name[64];
    size_t i;
    (void)state;
    for (i = 0; i < CHECK_COUNT(g); i++) {
        open_puffs(&w);
        w.scene.medium.phase.kind = SCATTER_PHASE_HG;
        w.scene.medium.phase.g = g[i];
        add_lamp(&w, 0.5f, 0.52f, 1.7f);
        snprintf(name, sizeof name, "g = %g, lamp in the picture", (double)g[i]);
        promise_rows(name, "the lobe is narrower than the nodes", &w, front_view());
        w.lights[0].kind = SCATTER_LIGHT_DIRECTIONAL;
        w.lights[0].direction = check_v3(0, 0.05f, g[i] < 0 ? 1.0f : -1.0f);
        /* p ~ ((1 - g)^2 + theta^2)^(-3/2) changes by at most 1.5/(1 - |g|) per radian; two unit
           vectors of floats make an angle that is 2 ULP each wrong */
        snprintf(name, sizeof name, "g = %g, sun in the picture, 64 nodes", (double)g[i]);
        hard_row(name, "cos of small angles", PROMISE_64 + 1.5 * 4 * ULP / (1 - fabs((double)g[i])),
                 error_of(&w, front_view(), nodes(64)));
    }
    rows_hold();
}

/* ------------------------------------------ >>places and scales */

/* Every stage whose numbers are places: puffs, two kinds of fog, voxels, bounds, two lights. All
   places are multiples of 1/16 m, which a float holds up to 2^20 m. */
static void open_town(check_world *w, float at) {
    uint64_t seed = 5;
    int i;
    check_world_open(w);
    for (i = 0; i < 5; i++) {
        scatter_vec3 b = check_point(&seed, 0, 1);
        b = check_v3(at + roundf(16 * b.x) / 16, at + roundf(16 * b.y) / 16,
                     at + roundf(16 * b.z) / 16);
        check_add_gaussian(w, b, 2 + (float)i, 1);
    }
    check_add_height(w, 0.2f, at, 0.5f);
    check_bound(w, check_cube(at - 0.5f, at + 1.5f));
    add_lamp(w, at + 1.25f, at + 1.5f, at - 0.25f);
    check_add_light(w, SCATTER_LIGHT_DIRECTIONAL, check_v3(0.25f, -1, 0.5f), grey(1));
}

static scatter_view town_view(float at) {
    return look(at + 0.5f, at + 0.5f, at - 2, grey(at + 0.5f), 0.7f);
}

/* The town at 0 and far away. */
static double offset_error(float at, scatter_quality q, int voxels) {
    static check_world near, far;
    open_town(&near, 0);
    open_town(&far, at);
    if (voxels) {
        check_add_grid(&near, 8, 8, 8, check_cube(0, 1), 77);
        check_add_grid(&far, 8, 8, 8, check_cube(at, at + 1), 77);
    }
    return difference(&near, town_view(0), &far, town_view(at), q);
}

/* 1e-3 is asked for; places that floats hold lose nothing else but last digits. */
static void test_offset(void **state) {
    static const float places[] = {1e5f, 1e6f};
    static check_world near, far;
    scatter_quality injected;
    char name[80];
    int i;
    (void)state;
    for (i = 0; i < 2; i++) {
        snprintf(name, sizeof name, "scene moved by %.0e m", (double)places[i]);
        hard_row(name, "floats end at 0.06 m there", 1e-3, offset_error(places[i], nodes(16), 0));
        snprintf(name, sizeof name, "scene with voxels moved by %.0e m", (double)places[i]);
        hard_row(name, "voxel coordinates", 1e-3, offset_error(places[i], nodes(16), 1));
        snprintf(name, sizeof name, "scene with polar volumes moved by %.0e m", (double)places[i]);
        hard_row(name, "columns start at the light", 1e-3,
                 offset_error(places[i], volumes(SCATTER_DEPTH_POLAR, 32), 1));
        snprintf(name, sizeof name, "scene with closed volumes moved by %.0e m", (double)places[i]);
        hard_row(name, "cell centres are not floats there", 1e-3,
                 offset_error(places[i], volumes(SCATTER_DEPTH_CLOSED_VOLUME, 32), 1));
        snprintf(name, sizeof name, "scene with injected density moved by %.0e m", (double)places[i]);
        injected = volumes(SCATTER_DEPTH_CLOSED, 32);
        injected.density = SCATTER_DENSITY_VOLUME;
        hard_row(name, "the same", 1e-3, offset_error(places[i], injected, 1));
    }
    open_town(&near, 0);
    open_town(&far, 1e6f);
    far.gaussians[2].center.x += 0.0625f; /* one float further */
    hard_fault("one Gaussian moved by one float", 1e-3,
               difference(&near, town_view(0), &far, town_view(1e6f), nodes(16)));
    rows_hold();
}

static void scale_point(scatter_vec3 *p, float k) { *p = check_v3(k * p->x, k * p->y, k * p->z); }

/* Lengths k times as large, everything per length divided by it. */
static void scale_world(check_world *w, float k) {
    scatter_medium *m = &w->scene.medium;
    size_t i;
    scale_point(&m->extinction, 1 / k);
    scale_point(&m->bounds.min, k);
    scale_point(&m->bounds.max, k);
    for (i = 0; i < m->gaussian_count; i++) {
        scale_point(&w->gaussians[i].center, k);
        w->gaussians[i].a /= k;
    }
    for (i = 0; i < m->height_count; i++) {
        w->heights[i].y0 *= k;
        w->heights[i].scale *= k;
    }
    for (i = 0; i < w->scene.light_count; i++) {
        scale_point(&w->lights[i].position, k);
        w->lights[i].radius *= k;
        if (w->lights[i].kind != SCATTER_LIGHT_DIRECTIONAL)
            scale_point(&w->lights[i].intensity, k * k);
    }
}

static void test_scale(void **state) {
    static const float scales[] = {1e3f, 1e-3f, 1e6f, 1e-6f};
    static const char *names[] = {"metres to millimetres", "metres to kilometres",
                                  "metres to micrometres", "metres to 1000 kilometres"};
    static check_world a, b;
    scatter_view near = town_view(0);
    int i;
    (void)state;
    for (i = 0; i < 4; i++) {
        scatter_view far = near;
        open_town(&a, 0);
        open_town(&b, 0);
        scale_world(&b, scales[i]);
        scale_point(&far.origin, scales[i]);
        /* inputs are rounded to 2 ULP; a Gaussian (a x)^2 <= 14 makes 4 * 14 of it, and the depth
           of a few is as much again */
        hard_row(names[i], "lengths in metres hidden in the code", 200 * ULP,
                 difference(&a, near, &b, far, nodes(16)));
        b.gaussians[0].a *= 1.01f;
        hard_fault("another scale of one Gaussian", 200 * ULP,
                   difference(&a, near, &b, far, nodes(16)));
    }
    rows_hold();
}

/* -------------------------------------------------------- >>rays */

static scatter_ray ray_of(scatter_vec3 origin, scatter_vec3 direction) {
    scatter_ray r;
    r.origin = origin;
    r.direction = direction;
    return r;
}

static scatter_sample sample_of(const scatter_context *context, scatter_ray ray) {
    scatter_sample s;
    assert_int_equal(scatter_radiance(context, &ray, NULL, &s), SCATTER_OK);
    return s;
}

/* Relative RMSE of what is seen along some rays. */
static double rays_error(const check_world *w, const scatter_ray *rays, int count,
                         scatter_quality q) {
    scatter_context *context = check_open_context(&w->scene, &q);
    check_error e = check_no_error();
    int i;
    for (i = 0; i < count; i++) {
        double medium[3], through[3], behind[3];
        scatter_sample s = sample_of(context, rays[i]);
        assert_int_equal(reference_radiance(&w->scene, &rays[i], medium, through, behind), 0);
        check_add(&e, s.radiance.y + (double)s.transmittance.y * s.surface.y,
                  medium[1] + through[1] * behind[1]);
    }
    scatter_destroy(context);
    return check_rms(&e);
}

/* Difference of a sample from one of light and transmittance. */
static double sample_error(scatter_sample s, double light, double through) {
    return fmax(fabs(s.radiance.x - light), fabs(s.transmittance.x - through));
}

static void test_zero_length(void **state) {
    static const float lengths[] = {0, 1e-40f};
    scatter_surface hit = {0, {0, 0, -1}, {0, 0, 0}, {0, 0, 0}, 0};
    scatter_ray ray = {{0.4f, 0.5f, 0.6f}, {0.1f, 0.2f, 1}};
    scatter_quality q = nodes(16);
    scatter_context *context;
    check_world w;
    double worst = 0;
    int i;
    (void)state;
    open_town(&w, 0);
    context = check_open_context(&w.scene, &q);
    for (i = 0; i < 2; i++) {
        scatter_sample s;
        hit.distance = lengths[i];
        assert_int_equal(scatter_radiance(context, &ray, &hit, &s), SCATTER_OK);
        worst = fmax(worst, sample_error(s, 0, 1));
    }
    worst = fmax(worst, scatter_optical_depth(&w.scene.medium, ray.origin, ray.origin));
    hard_row("rays of length 0 and 1e-40 m", "0/0", 1e-37, worst);
    hard_fault("a ray that goes on", 1e-37, sample_error(sample_of(context, ray), 0, 1));
    scatter_destroy(context);
    rows_hold();
}

/* Along a face of a cube of fog: 1e-6 m inside, in it, 1e-6 m outside. */
static void test_grazing_bounds(void **state) {
    scatter_quality q = nodes(64);
    scatter_ray ray = {{0.3f, 0, -1}, {0, 0, 1}};
    scatter_context *context;
    scatter_sample in, on, out;
    check_world w;
    (void)state;
    open_cube(&w);
    w.scene.medium.bounds.min.y = 0;
    add_lamp(&w, 0.5f, 0.5f, -0.5f);
    context = check_open_context(&w.scene, &q);
    on = sample_of(context, ray);
    ray.origin.y = -1e-6f;
    out = sample_of(context, ray);
    ray.origin.y = 1e-6f;
    in = sample_of(context, ray);
    scatter_destroy(context);
    hard_row("ray 1e-6 m inside a face of the bounds", "clipped by rounding", PROMISE_64,
             rays_error(&w, &ray, 1, q));
    hard_row("ray 1e-6 m outside a face", "not clipped", 0, sample_error(out, 0, 1));
    hard_row("ray in the face: inside or outside, not between", "0/0 in a slab",
             PROMISE_64, fmin(sample_error(on, 0, 1),
                              sample_error(on, in.radiance.x, in.transmittance.x)));
    hard_fault("half a ray", PROMISE_64,
               fmin(sample_error(in, 0, 1), fabs(0.5 * in.radiance.x - in.radiance.x)));
    rows_hold();
}

/* Past a Gaussian where it is cut off, against what its centre sends. */
static void test_grazing_gaussian(void **state) {
    scatter_quality q = nodes(64);
    scatter_context *context;
    scatter_ray ray = {{0, 0, -4}, {0, 0, 1}};
    check_world w;
    double center, medium[3], worst = 0, wrong;
    float h;
    (void)state;
    check_world_open(&w);
    check_add_gaussian(&w, check_v3(0, 0, 0), 2, 0.5f);
    add_lamp(&w, 0, 3, 0);
    context = check_open_context(&w.scene, &q);
    center = sample_of(context, ray).radiance.x;
    for (h = 1.5f; h < 2.5f; h += 0.01f) {
        ray.origin.y = -h;
        assert_int_equal(reference_radiance(&w.scene, &ray, medium, NULL, NULL), 0);
        worst = fmax(worst, fabs(sample_of(context, ray).radiance.x - medium[0]) / center);
    }
    ray.origin.y = -1.5f;
    assert_int_equal(reference_radiance(&w.scene, &ray, medium, NULL, NULL), 0);
    ray.origin.y = -1.51f;
    wrong = fabs(sample_of(context, ray).radiance.x - medium[0]) / center;
    scatter_destroy(context);
    hard_row("rays past the cut-off of a Gaussian", "its edge shows", exp(-14), worst);
    hard_fault("the ray beside", exp(-14), wrong);
    rows_hold();
}

/* Both ways along the axes, through the centre and along cell faces and edges. */
static void axis_rays(scatter_ray *rays) {
    int i;
    for (i = 0; i < 24; i++) {
        float sign = i & 1 ? -1.0f : 1.0f, place[4] = {0.5f, 0.25f, 0.375f, 0.3f};
        int axis = i / 2 % 3, where = i / 6;
        scatter_vec3 d = check_v3(axis == 0 ? sign : 0, axis == 1 ? sign : 0, axis == 2 ? sign : 0);
        rays[i] = ray_of(check_along(grey(place[where]), -3, d), d);
    }
}

static void test_axis_parallel(void **state) {
    static scatter_ray rays[24];
    check_world w;
    double worst = 0;
    int i;
    (void)state;
    axis_rays(rays);
    open_town(&w, 0);
    hard_row("rays along the axes, through centres and edges", "0 in a direction is divided by",
             PROMISE_64, rays_error(&w, rays, 24, nodes(64)));
    check_add_grid(&w, 8, 8, 8, check_cube(0, 1), 8);
    for (i = 0; i < 24; i++) {
        scatter_vec3 end = check_along(rays[i].origin, 6, rays[i].direction);
        double truth = reference_optical_depth(&w.scene.medium, rays[i].origin, end);
        worst = fmax(worst,
                     fabs(scatter_optical_depth(&w.scene.medium, rays[i].origin, end) / truth - 1));
    }
    hard_row("depth along the axes, in faces and edges of voxels", "planes of voxels missed or met twice",
             DEPTH + 8e-7, worst);
    rows_hold();
}

static void test_reversed(void **state) {
    check_world w;
    uint64_t seed = 12;
    double worst = 0, wrong = 0;
    int i;
    (void)state;
    open_town(&w, 0);
    check_add_grid(&w, 7, 11, 5, check_cube(0, 1), 8);
    for (i = 0; i < 200; i++) {
        scatter_vec3 p = check_point(&seed, -1, 2), q = check_point(&seed, -1, 2);
        float there = scatter_optical_depth(&w.scene.medium, p, q);
        float back = scatter_optical_depth(&w.scene.medium, q, p);
        if (!(there > 0))
            continue;
        worst = fmax(worst, fabs((double)back / there - 1));
        wrong = fmax(wrong, fabs((double)back / there * 1.0001 - 1));
    }
    hard_row("depth there and back", "which end is the origin", 2 * DEPTH, worst);
    hard_fault("one way a ten-thousandth deeper", 2 * DEPTH, wrong);
    rows_hold();
}

/* ----------------------------------------------------- >>cameras */

/* Seen past the edge of the lens: the middle of the picture is `shift` pictures aside. */
static scatter_view off_axis(scatter_view v, float shift) {
    v.direction = check_along(v.direction, shift, v.direction_dx);
    v.direction = check_along(v.direction, -shift, v.direction_dy);
    return v;
}

static void test_cameras(void **state) {
    check_world w;
    scatter_view far = look(0.5f, 0.5f, -600, grey(0.5f), 0.1f * 3.14159265f / 180);
    (void)state;
    open_puffs(&w);
    w.scene.background = check_v3(0.1f, 0.2f, 0.3f);
    add_lamp(&w, 0.5f, 0.9f, 0.3f);
    promise_rows("orthographic camera", "rays that do not share an origin", &w,
                 beam(grey(0.5f), check_v3(0.48f, -0.6f, 0.64f), 3, 2));
    promise_rows("off-axis camera, by half a picture", "the target is not in the middle", &w,
                 off_axis(look(-1.5f, 2.5f, -2, grey(0.5f), 0.7f), 0.5f));
    promise_rows("camera of 179 degrees in the medium", "directions of very different length", &w,
                 look(0.4f, 0.6f, 0.2f, grey(0.5f), 179 * 3.14159265f / 180));
    /* 600 m of ray are 36 um in a float: the light's peak d = 0.5 m, the medium's widths of 0.25 m
       and 3 roundings make 4 times 3 times that of it */
    hard_row("camera of 0.1 degrees at 600 m, 64 nodes", "neighbouring rays are nearly the same",
             PROMISE_64 + 4 * 3 * 600 * ULP, error_of(&w, far, nodes(64)));
    rows_hold();
}

/* ------------------------------------------------- >>depth buffers */

typedef enum projection { STANDARD, STANDARD_INFINITE, REVERSED, REVERSED_INFINITE } projection;

/* Depth as a buffer holds it, 0..1, of a point z metres ahead: (A z + B)/z. */
static void projection_terms(projection kind, double near, double far, double *a, double *b) {
    static const double reversed[4] = {0, 0, 1, 1}, infinite[4] = {0, 1, 0, 1};
    *a = infinite[kind] > 0 ? 1 : far / (far - near); /* standard: 0 at near, 1 at far */
    *b = -near * *a;
    if (reversed[kind] > 0) {
        *a = 1 - *a;
        *b = -*b;
    }
}

/* The inverse of the 4x4 matrix m, row-major, by Gauss and Jordan. */
static void invert(const double m[16], double inverse[16]) {
    double a[4][8];
    int i, j, k;
    for (i = 0; i < 4; i++)
        for (j = 0; j < 8; j++)
            a[i][j] = j < 4 ? m[4 * i + j] : j - 4 == i;
    for (i = 0; i < 4; i++) {
        int pivot = i;
        for (k = i + 1; k < 4; k++)
            pivot = fabs(a[k][i]) > fabs(a[pivot][i]) ? k : pivot;
        for (j = 0; j < 8; j++) {
            double swap = a[i][j];
            a[i][j] = a[pivot][j];
            a[pivot][j] = swap;
        }
        for (k = 0; k < 4; k++) {
            double f = k == i ? 0 : a[k][i] / a[i][i];
            for (j = 0; j < 8; j++)
                a[k][j] -= f * a[i][j];
        }
    }
    for (i = 0; i < 16; i++)
        inverse[i] = a[i / 4][4 + i % 4] / a[i / 4][i / 4];
}

/* World to clip space of a camera at `eye` that looks along z, x to the left (right = forward x up),
   rows for clip x, y, z, w. */
static void clip_matrix(projection kind, scatter_vec3 eye, double near, double m[16]) {
    double f = 1 / tan(0.35), a, b;
    memset(m, 0, 16 * sizeof *m);
    projection_terms(kind, near, 100, &a, &b);
    m[0] = -f * HIGH / WIDE;
    m[3] = f * HIGH / WIDE * eye.x;
    m[5] = f;
    m[7] = -f * eye.y;
    m[10] = a;
    m[11] = b - a * eye.z;
    m[14] = 1;
    m[15] = -eye.z;
}

/* Distance from the eye of what a depth buffer holds in pixel x, y; 0: nothing, the sky. */
static float distance_of_depth(const double inverse[16], scatter_vec3 eye, int x, int y,
                               double depth, double sky) {
    double clip[4], p[4];
    int i, j;
    if (depth == sky)
        return 0;
    clip[0] = 2 * (x + 0.5) / WIDE - 1;
    clip[1] = 1 - 2 * (y + 0.5) / HIGH;
    clip[2] = depth;
    clip[3] = 1;
    for (i = 0; i < 4; i++)
        for (p[i] = 0, j = 0; j < 4; j++)
            p[i] += inverse[4 * i + j] * clip[j];
    p[0] = p[0] / p[3] - eye.x;
    p[1] = p[1] / p[3] - eye.y;
    p[2] = p[2] / p[3] - eye.z;
    return (float)sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2]);
}

/* A black slanted wall, z = 0.5 + 0.3 y, for y < 0.8; sky above. */
static int slanted_wall(void *user, scatter_vec3 o, scatter_vec3 d, scatter_surface *hit) {
    double t = (0.5 + 0.3 * o.y - o.z) / ((double)d.z - 0.3 * d.y);
    (void)user;
    memset(hit, 0, sizeof *hit);
    hit->distance = (float)(t * sqrt(check_dot(d, d)));
    hit->normal = check_v3(0, 0, -1);
    return t > 0 && o.y + t * d.y < 0.8;
}

/* The wall as a depth buffer of floats, near plane at 0.1 m, and its distances out of that again by a
   matrix with the near plane at `near`. */
static void depth_buffer(projection kind, double near, scatter_view view, float *distance) {
    const scatter_vec3 eye = view.origin;
    double m[16], inverse[16], sky = kind >= REVERSED ? 0 : 1;
    int i;
    clip_matrix(kind, eye, near, m);
    invert(m, inverse);
    clip_matrix(kind, eye, 0.1, m);
    for (i = 0; i < PIXELS; i++) {
        int x = i % WIDE, y = i / WIDE;
        scatter_ray r =
            scatter_view_ray(&view, ((float)x + 0.5f) / WIDE, ((float)y + 0.5f) / HIGH);
        scatter_surface hit;
        float depth = (float)sky;
        if (slanted_wall(NULL, r.origin, r.direction, &hit)) {
            double z = eye.z + (double)hit.distance * r.direction.z; /* directions are unit vectors */
            depth = (float)((m[10] * z + m[11]) / (m[14] * z + m[15]));
        }
        distance[i] = distance_of_depth(inverse, eye, x, y, depth, sky);
    }
}

static void test_depth_buffers(void **state) {
    static const char *names[] = {"depth buffer, standard", "depth buffer, standard, infinite",
                                  "depth buffer, reversed-Z", "depth buffer, reversed-Z, infinite"};
    static float truth[FLOATS], rgb[FLOATS], distance[PIXELS];
    scatter_quality q = nodes(16);
    scatter_view view = look(0.5f, 0.5f, -2, check_v3(0.5f, 0.5f, 1), 0.7f);
    scatter_context *context;
    scatter_image image;
    check_world w;
    int kind;
    (void)state;
    open_puffs(&w);
    add_lamp(&w, 0.5f, 0.9f, -0.3f);
    w.scene.surface = slanted_wall;
    shoot(&w.scene, view, q, truth);
    context = check_open_context(&w.scene, &q);
    memset(&image, 0, sizeof image);
    image.width = WIDE;
    image.height = HIGH;
    image.rgb = rgb;
    image.distance = distance;
    for (kind = STANDARD; kind <= REVERSED_INFINITE; kind++) {
        depth_buffer((projection)kind, 0.1, view, distance);
        assert_int_equal(scatter_render(context, &view, &image), SCATTER_OK);
        /* an ulp of a standard depth is z^2/near 2^-24 = 4e-6 m at 2.6 m; light gathers over half a
           metre or more, so radiance feels twice that. Reversed depths have more digits */
        hard_row(names[kind], "distances from depths lose digits far away",
                 2 * 2.6 * 2.6 / 0.1 * ULP, image_error(rgb, truth));
    }
    depth_buffer(STANDARD, 0.1001, view, distance);
    assert_int_equal(scatter_render(context, &view, &image), SCATTER_OK);
    hard_fault("a near plane 0.1 mm aside", 2 * 2.6 * 2.6 / 0.1 * ULP, image_error(rgb, truth));
    scatter_destroy(context);
    rows_hold();
}

/* ------------------------------------------------------- >>voxels */

static void test_grids(void **state) {
    static const int sizes[][3] = {{1, 1, 1}, {2, 1, 300}, {7, 31, 3}};
    static const char *names[] = {"grid 1 x 1 x 1", "grid 2 x 1 x 300", "grid 7 x 31 x 3"};
    check_world w;
    char label[80];
    int i, k;
    (void)state;
    for (i = 0; i < 3; i++) {
        uint64_t seed = 3;
        double worst = 0;
        check_world_open(&w);
        check_add_grid(&w, sizes[i][0], sizes[i][1], sizes[i][2], check_cube(0, 1), 21);
        w.voxels[0][0] = 0.7f;
        add_lamp(&w, 0.4f, 1.5f, -0.6f);
        for (k = 0; k < 100; k++) {
            scatter_vec3 p = check_point(&seed, -0.5f, 1.5f), q = check_point(&seed, 0, 1);
            double truth = reference_optical_depth(&w.scene.medium, p, q);
            worst = fmax(worst, fabs(scatter_optical_depth(&w.scene.medium, p, q) - truth) / truth);
        }
        snprintf(label, sizeof label, "%s: scatter_optical_depth", names[i]);
        hard_row(label, "neighbours that do not exist", DEPTH + 1e-7 * sizes[i][2], worst);
        /* four samples a voxel: where the density bends, on average by 0.57 a voxel of a mean of
           0.37 in random voxels, h^2/8 of that is missed, h = 1/4: 1.2 % of a voxel, and three or
           more of them with random signs; a single voxel does not bend */
        snprintf(label, sizeof label, "%s: picture, 64 nodes", names[i]);
        hard_row(label, "the same", i == 0 ? PROMISE_64 : 7e-3,
                 error_of(&w, front_view(), nodes(64)));
    }
    rows_hold();
}

/* One voxel in a grid of others of density `rest`. */
static void lone_voxel(int x, int y, int z, float rest, float *rgb) {
    check_world w;
    int i;
    check_world_open(&w);
    check_add_grid(&w, 10, 10, 10, check_cube(0, 1), 21);
    for (i = 0; i < 1000; i++)
        w.voxels[0][i] = rest;
    w.voxels[0][(z * 10 + y) * 10 + x] = 5;
    add_lamp(&w, 0.4f, 1.5f, -0.6f);
    shoot(&w.scene, front_view(), nodes(16), rgb);
}

/* Rays pass empty voxels; a lone voxel reaches into the cells around it. With next to nothing in the
   other voxels none is empty. */
static void test_lone_voxel(void **state) {
    static const int places[][3] = {{7, 7, 7}, {8, 8, 8}, {7, 8, 7}, {0, 9, 8}};
    static float sparse[FLOATS], full[FLOATS];
    double worst = 0;
    int i;
    (void)state;
    for (i = 0; i < 4; i++) {
        lone_voxel(places[i][0], places[i][1], places[i][2], 0, sparse);
        lone_voxel(places[i][0], places[i][1], places[i][2], 1e-20f, full);
        worst = fmax(worst, image_error(sparse, full));
    }
    hard_row("a lone voxel in empty space", "voxels that are not empty are passed", ULP,
             worst);
    lone_voxel(0, 9, 7, 1e-20f, full);
    hard_fault("another voxel", ULP, image_error(sparse, full));
    rows_hold();
}

/* 512^3 voxels of 1 + sin(2 pi z/8)/2, 512 MB of addresses for 8 slices of memory: the same file is
   mapped 64 times. NULL if there is no room for so many addresses. */
static float *map_voxels(size_t part, int parts) {
    FILE *file = tmpfile();
    float *slices = (float *)malloc(part), *voxels;
    size_t i;
    int k, good;
    assert_true(file != NULL && slices != NULL);
    for (i = 0; i < part / sizeof(float); i++)
        slices[i] = (float)(1 + 0.5 * sin(2 * CHECK_PI * (double)(i >> 18) / 8));
    good = fwrite(slices, part, 1, file) == 1 && fflush(file) == 0;
    free(slices);
    assert_true(good);
    voxels = (float *)mmap(NULL, part * (size_t)parts, PROT_READ, MAP_SHARED, fileno(file), 0);
    good = voxels != MAP_FAILED;
    for (k = 0; k < parts && good; k++)
        good = mmap((char *)voxels + part * (size_t)k, part, PROT_READ, MAP_SHARED | MAP_FIXED,
                    fileno(file), 0) != MAP_FAILED;
    fclose(file);
    return good ? voxels : NULL;
}

static void test_large_grid(void **state) {
    static const scatter_ray rays[3] = {{{1.2f, 0.95f, 0.85f}, {-0.5f, 0.01f, 0.2f}},
                                        {{0.85f, 0.85f, 1.25f}, {0.2f, 0.2f, -0.6f}},
                                        {{0.95f, 1.25f, 0.97f}, {0.02f, -1, -0.1f}}};
    const size_t part = (size_t)8 << 20;
    float *voxels = map_voxels(part, 64);
    double worst = 0;
    check_world w;
    int i;
    (void)state;
    assert_true(voxels != NULL);
    check_world_open(&w);
    check_add_grid(&w, 1, 1, 1, check_cube(0, 1), 1);
    w.grids[0].nx = w.grids[0].ny = w.grids[0].nz = 512;
    w.grids[0].density = voxels;
    check_bound(&w, check_cube(0.9f, 1)); /* so that the reference is done in seconds */
    add_lamp(&w, 1.2f, 1.1f, 1.3f);
    for (i = 0; i < 3; i++) {
        scatter_vec3 end = check_along(rays[i].origin, 2, rays[i].direction);
        double truth = reference_optical_depth(&w.scene.medium, rays[i].origin, end);
        worst = fmax(worst,
                     fabs(scatter_optical_depth(&w.scene.medium, rays[i].origin, end) / truth - 1));
    }
    /* scatter.h: n 1e-7 of a voxel's change, pi/8, more */
    hard_row("grid 512^3: scatter_optical_depth", "indices beyond 2^31 bytes, lost voxel coordinates",
             DEPTH + 512e-7 * CHECK_PI / 8, worst);
    /* one sample a voxel: where a panel of 16 voxels ends, the midpoint rule is h^2/24 of the slope
       off, and a slope is pi/8 a voxel at most: two ends for 16 voxels of density 1 */
    hard_row("grid 512^3: rays, 16 nodes", "the same", 2 * CHECK_PI / 8 / 24 / 16,
             rays_error(&w, rays, 3, nodes(16)));
    munmap(voxels, part * 64);
    rows_hold();
}

/* ----------------------------------------------------- >>denormals */

/* A denormal number in one field must do what 0 does. */
typedef struct tiny_field {
    const char *name;
    size_t offset; /* of a float in check_world */
} tiny_field;

static const tiny_field tiny_fields[] = {
    {"extinction", offsetof(check_world, scene.medium.extinction.x)},
    {"albedo", offsetof(check_world, scene.medium.albedo.y)},
    {"emission", offsetof(check_world, scene.medium.emission.z)},
    {"g", offsetof(check_world, scene.medium.phase.g)},
    {"bounds", offsetof(check_world, scene.medium.bounds.min.x)},
    {"constant", offsetof(check_world, scene.medium.constant)},
    {"height density", offsetof(check_world, heights[0].density)},
    {"height y0", offsetof(check_world, heights[0].y0)},
    {"center", offsetof(check_world, gaussians[1].center.x)},
    {"amplitude", offsetof(check_world, gaussians[2].c)},
    {"voxel", offsetof(check_world, voxels[0][100])},
    {"background", offsetof(check_world, scene.background.x)},
    {"light position", offsetof(check_world, lights[0].position.y)},
    {"sun direction", offsetof(check_world, lights[1].direction.x)},
    {"intensity", offsetof(check_world, lights[0].intensity.x)},
    {"radius", offsetof(check_world, lights[0].radius)},
};

static void shoot_with(size_t offset, float value, float *rgb) {
    check_world w;
    open_town(&w, 0);
    check_add_grid(&w, 8, 8, 8, check_cube(0, 1), 8);
    w.scene.medium.phase.kind = SCATTER_PHASE_HG;
    w.scene.medium.emission = grey(0.1f);
    memcpy((char *)&w + offset, &value, sizeof value);
    shoot(&w.scene, town_view(0), nodes(16), rgb);
}

static void test_denormals(void **state) {
    static float zero[FLOATS], tiny[FLOATS];
    double worst = 0;
    size_t i;
    (void)state;
    for (i = 0; i < CHECK_COUNT(tiny_fields); i++) {
        shoot_with(tiny_fields[i].offset, 0, zero);
        shoot_with(tiny_fields[i].offset, 1e-40f, tiny);
        worst = fmax(worst, image_error(tiny, zero));
    }
    /* sums of a few hundred terms of the same sign may end in another last digit */
    hard_row("a denormal in any field, against 0 there", "1/1e-40, flushed or not", 10 * ULP, worst);
    shoot_with(tiny_fields[9].offset, 1e-3f, tiny);
    shoot_with(tiny_fields[9].offset, 0, zero);
    hard_fault("a thousandth of an amplitude", 10 * ULP, image_error(tiny, zero));
    rows_hold();
}

static void test_denormal_view(void **state) {
    static float truth[FLOATS], rgb[FLOATS];
    scatter_view view = town_view(0);
    check_world w;
    (void)state;
    open_town(&w, 0);
    shoot(&w.scene, view, nodes(16), truth);
    scale_point(&view.direction, 0x1p-137f);
    scale_point(&view.direction_dx, 0x1p-137f);
    scale_point(&view.direction_dy, 0x1p-137f);
    shoot(&w.scene, view, nodes(16), rgb);
    /* 2^-137 leaves 12 bits of directions near 1: 2^-13 radians, of 0.7 in 16 rows; the picture
       changes by at most its contrast, some 3 per row of 0.04 radians */
    hard_row("a view of denormal directions", "1/length is infinite", 0x1p-13 * 3 / 0.04,
             image_error(rgb, truth));
    view.direction.x += 0x1p-137f * 0.1f;
    shoot(&w.scene, view, nodes(16), rgb);
    hard_fault("a view turned by 0.1", 0x1p-13 * 3 / 0.04, image_error(rgb, truth));
    rows_hold();
}

/* ------------------------------------------------- >>depth volumes */

/* The nearest half-float: 11 bits, multiples of 2^-24 below 2^-14, infinity from 65520 on. */
static float half(float x) {
    int e;
    double scale;
    if (!(fabsf(x) < 65520))
        return x > 0 ? INFINITY : x < 0 ? -INFINITY : x;
    frexp(x, &e);
    scale = ldexp(1, 11 - (e < -13 ? -13 : e));
    return (float)(nearbyint(x * scale) / scale);
}

static void test_half(void **state) {
    (void)state;
    assert_true(half(1) == 1 && half(1 + 0x1p-10f) == 1 + 0x1p-10f && half(1 + 0x1p-11f) == 1);
    assert_true(half(65504) == 65504 && half(65519) == 65504 && isinf(half(65520)));
    assert_true(half(0x1p-24f) == 0x1p-24f && half(0x1p-26f) == 0 && half(0x1.8p-24f) == 0x1p-23f);
    assert_true(half(-3.3333333f) < -3.33f && half(0) == 0);
}

/* The twin of a picture: the depth volumes of all lights went through half-floats. */
static double half_error(const check_world *w, scatter_depth_method method) {
    static float truth[FLOATS], rgb[FLOATS];
    scatter_quality q = volumes(method, 64);
    scatter_context *context = check_open_context(&w->scene, &q);
    int i;
    render(context, front_view(), truth);
    for (i = 0; i < context->light_count; i++) {
        scatter_depth *d = &context->lights[i].depth;
        size_t k, count = (size_t)d->nx * (size_t)d->ny * (size_t)d->nz;
        for (k = 0; k < count; k++)
            d->values[k] = half(d->values[k]);
    }
    render(context, front_view(), rgb);
    scatter_destroy(context);
    return image_error(rgb, truth);
}

/* Rounding to 11 bits changes depth by at most 2^-12, so L by sigma tau 2^-12 where it is seen. */
static void test_half_depth(void **state) {
    static const float opacities[] = {1, 10, 100};
    check_world w;
    char name[100];
    int i;
    (void)state;
    for (i = 0; i < 3; i++) {
        double depth;
        open_puffs(&w);
        add_lamp(&w, 0.5f, 2.0f, 0.3f);
        w.scene.medium.extinction = grey(opacities[i]);
        depth = opacities[i] * reference_optical_depth(&w.scene.medium, w.lights[0].position,
                                                       check_v3(0.5f, 0, 0.3f));
        snprintf(name, sizeof name, "depth stored in half-floats, sigma tau up to %.0f", depth);
        /* light that is seen at all came through sigma tau <= 18 */
        hard_row(name, "11 bits in an exponent", fmin(depth, 18) * 0x1p-12,
                 half_error(&w, i == 1 ? SCATTER_DEPTH_CLOSED_VOLUME : SCATTER_DEPTH_POLAR));
    }
    /* where half-floats must not be used: mean densities below 6e-5 lose digits, below 3e-8 they
       are lost, above 65504 they are infinite */
    for (i = 0; i < 4; i++)
        w.gaussians[i].c *= 1e-8f;
    w.scene.medium.extinction = grey(1e8f);
    hard_fault("half-floats of mean densities of 1e-8", 18 * 0x1p-12,
               half_error(&w, SCATTER_DEPTH_POLAR));
    for (i = 0; i < 4; i++)
        w.gaussians[i].c *= 1e14f;
    w.scene.medium.extinction = grey(1e-6f);
    hard_fault("half-floats of mean densities of 1e6", 18 * 0x1p-12,
               half_error(&w, SCATTER_DEPTH_POLAR));
    rows_hold();
}

/* Brightness must not depend on where the cells are: two Gaussians of next to no density, between whose
   far ends the volume is spread, move by parts of a cell. Worst difference from the first picture. */
static double flicker(scatter_depth_method depth, int directional, int grid) {
    static float first[FLOATS];
    check_world w;
    double worst = 0;
    int i;
    for (i = 0; i < 8; i++) {
        float shift = 2.0f / (float)grid * (float)i / 8;
        check_world_open(&w);
        check_add_gaussians(&w, 8, 4.0f, 6.0f, 31);
        check_add_gaussian(&w, grey(-0.5f + shift), 40, 1e-12f);
        check_add_gaussian(&w, grey(1.5f + shift), 40, 1e-12f);
        if (directional)
            check_add_light(&w, SCATTER_LIGHT_DIRECTIONAL, check_v3(0.3f, -1, 0.2f), grey(1));
        else
            add_lamp(&w, 0.5f, 1.8f, 0.3f);
        if (i == 0)
            shoot(&w.scene, front_view(), volumes(depth, grid), first);
        else
            worst = fmax(worst, error_against(first, &w, front_view(), volumes(depth, grid)));
    }
    return worst;
}

static void test_flicker(void **state) {
    (void)state;
    /* docs/accuracy.md: 0.3 % between cells for Gaussians as narrow as five cells, here 1/6 m in 64
       cells of 2.2 m */
    hard_row("closed volume moved by parts of a cell", "brightness depends on the cells", 3e-3,
             flicker(SCATTER_DEPTH_CLOSED_VOLUME, 0, 64));
    hard_row("the same with a directional light", "brightness depends on the cells", 3e-3,
             flicker(SCATTER_DEPTH_CLOSED_VOLUME, 1, 64));
    /* README: 64^3 polar volume 1 % */
    hard_row("polar volume moved by parts of a cell", "brightness depends on the cells", 1e-2,
             flicker(SCATTER_DEPTH_POLAR, 0, 64));
    hard_row("the same with a directional light, polar", "brightness depends on the cells", 1e-2,
             flicker(SCATTER_DEPTH_POLAR, 1, 64));
    hard_fault("ten cells", 3e-3, flicker(SCATTER_DEPTH_CLOSED_VOLUME, 0, 10));
    rows_hold();
}

/* Whether the estimate of a picture with this quality is trusted: puffs, and a narrow one, 1/80 m, that throws a shadow
   through them. */
static int is_trusted(scatter_quality q) {
    enum { SIDE = 128 };
    static float rgb[3 * SIDE * SIDE];
    scatter_estimate estimate = {0, 0, 0};
    scatter_view view = front_view();
    scatter_image image;
    scatter_context *context;
    check_world w;
    open_puffs(&w);
    check_add_gaussian(&w, check_v3(0.47f, 0.71f, 0.33f), 80, 200);
    check_bound(&w, check_cube(0, 1));
    add_lamp(&w, 0.5f, 1.5f, 0.3f);
    context = check_open_context(&w.scene, &q);
    memset(&image, 0, sizeof image);
    image.width = image.height = SIDE;
    image.rgb = rgb;
    image.estimate = &estimate;
    assert_int_equal(scatter_render(context, &view, &image), SCATTER_OK);
    scatter_destroy(context);
    return estimate.trusted;
}

/* Cells ten times the smallest feature: an error estimate must flag them, whatever figure it has. The row counts
   those that it does not flag; closed form, which has no cells, is not flagged. */
static void test_coarse_cells(void **state) {
    (void)state;
    hard_row("cells ten times the smallest feature, closed volume: estimate trusted",
             "its shadow falls between cells", 0,
             is_trusted(volumes(SCATTER_DEPTH_CLOSED_VOLUME, 8)));
    hard_row("cells ten times the smallest feature, polar volume: estimate trusted",
             "its shadow falls between columns", 0, is_trusted(volumes(SCATTER_DEPTH_POLAR, 8)));
    hard_fault("closed form is trusted", 0, is_trusted(nodes(32)));
    rows_hold();
}

/* A local light in every awkward place of its depth volumes. */
static void test_volume_places(void **state) {
    static const char *names[] = {"outside", "on a face", "on an edge", "in a corner",
                                  "1 cm outside a corner", "1 mm outside a corner"};
    static const scatter_vec3 places[] = {{2, 1.5f, -0.5f}, {0.5f, 1, 0.25f}, {0, 1, 0.25f},
                                          {1, 1, 1}, {1.01f, 1.01f, 1.01f}, {1.001f, 1.001f, 1.001f}};
    check_world w;
    char label[100];
    int i;
    (void)state;
    for (i = 0; i < 6; i++) {
        double beside;
        open_puffs(&w);
        check_bound(&w, check_cube(0, 1));
        add_lamp(&w, places[i].x, places[i].y, places[i].z);
        /* depth rises from 0 to all of it within the first cm or mm below the faces next to the
           light, less than a cell: three layers of 1/64 of the cube where it may be anything */
        beside = i < 4 ? 0 : 3.0 / 64;
        snprintf(label, sizeof label, "closed volume 64^3, light %s", names[i]);
        hard_row(label, "tau/r where r is 0, cells behind the light",
                 3e-3 + beside, /* docs/accuracy.md */
                 error_of(&w, front_view(), volumes(SCATTER_DEPTH_CLOSED_VOLUME, 64)));
        snprintf(label, sizeof label, "polar volume 64^3, light %s", names[i]);
        hard_row(label, "the cone that holds the bounds degenerates", 1e-2 + beside, /* README.md */
                 error_of(&w, front_view(), volumes(SCATTER_DEPTH_POLAR, 64)));
    }
    rows_hold();
}

/* ----------------------------------------- >>energy and symmetry */

/* The integral of a picture over its plane, red, of height `size` and as wide as that. */
static double sum_of_plane(const scatter_context *context, scatter_vec3 along, float size) {
    enum { SIDE = 40 };
    static float rgb[3 * SIDE * SIDE];
    scatter_image image;
    scatter_vec3 up = fabsf(along.y) < 0.7f ? check_v3(0, 1, 0) : check_v3(1, 0, 0);
    scatter_view view = scatter_view_orthographic(check_along(grey(0.5f), -5, along), grey(0.5f), up,
                                                  size, 1);
    double sum = 0;
    int i;
    memset(&image, 0, sizeof image);
    image.width = image.height = SIDE;
    image.rgb = rgb;
    assert_int_equal(scatter_render(context, &view, &image), SCATTER_OK);
    for (i = 0; i < SIDE * SIDE; i++)
        sum += rgb[3 * i];
    return sum * (double)size * size / (SIDE * SIDE);
}

/* What comes out of the puffs in all directions: 16 Gauss-Legendre cosines around the sun's way,
   five angles around it. */
static double scattered_power(const scatter_context *context, scatter_vec3 sun) {
    scatter_vec3 side = check_v3(sun.y, -sun.x, 0), other;
    double sum = 0;
    int i, k;
    float length = sqrtf((float)check_dot(side, side));
    scale_point(&side, 1 / length);
    other = check_v3(sun.y * side.z - sun.z * side.y, sun.z * side.x - sun.x * side.z,
                     sun.x * side.y - sun.y * side.x);
    for (i = 0; i < 16; i++) {
        scatteri_vec2 node = scatteri_legendre(i, 16);
        float r = sqrtf(1 - node.x * node.x);
        for (k = 0; k < 5; k++) {
            float phi = 6.2831853f * (float)k / 5;
            scatter_vec3 d = check_along(check_v3(0, 0, 0), -node.x, sun);
            d = check_along(check_along(d, r * cosf(phi), side), r * sinf(phi), other);
            sum += node.y * 2 * CHECK_PI / 5 * sum_of_plane(context, d, 8);
        }
    }
    return sum;
}

/* sigma E times the mass of the Gaussians, c (sqrt(pi)/a)^3 each. */
static double removed_power(const check_world *w, double sigma, double e) {
    double mass = 0;
    size_t i;
    for (i = 0; i < w->scene.medium.gaussian_count; i++)
        mass += w->gaussians[i].c * pow(sqrt(CHECK_PI) / w->gaussians[i].a, 3);
    return sigma * e * mass;
}

static void test_energy(void **state) {
    static const scatter_phase phases[] = {{SCATTER_PHASE_ISOTROPIC, 0, 0, 0},
                                           {SCATTER_PHASE_HG, 0.5f, 0, 0},
                                           {SCATTER_PHASE_RAYLEIGH, 0, 0, 0},
                                           {SCATTER_PHASE_DRAINE, 0.3f, 1, 0}};
    const scatter_vec3 sun = {0.48f, -0.6f, 0.64f};
    scatter_quality q = nodes(32);
    check_world w;
    double worst = 0, out = 0;
    size_t i;
    (void)state;
    check_world_open(&w);
    check_add_gaussians(&w, 4, 1.5f, 2.5f, 31);
    w.scene.medium.extinction = grey(1e-6f);
    w.scene.medium.albedo = grey(1);
    check_add_light(&w, SCATTER_LIGHT_DIRECTIONAL, sun, grey(2));
    for (i = 0; i < CHECK_COUNT(phases); i++) {
        scatter_context *context;
        w.scene.medium.phase = phases[i];
        context = check_open_context(&w.scene, &q);
        out = scattered_power(context, sun);
        worst = fmax(worst, fabs(out / removed_power(&w, 1e-6, 2) - 1));
        scatter_destroy(context);
    }
    /* 1e-6 is scattered twice or shadowed; 16 nodes in the cosine leave g^32 */
    hard_row("energy: what a thin medium scatters is what it removes", "a factor of the phase function",
             PROMISE_64 + 1e-5, worst);
    hard_fault("an albedo of 0.999", PROMISE_64 + 1e-5,
               fabs(0.999 * out / removed_power(&w, 1e-6, 2) - 1));
    rows_hold();
}

/* Power from a sun along v, sent along w: sums over the picture's plane. */
static double power_between(check_world *w, scatter_vec3 sun, scatter_vec3 eye) {
    scatter_quality q = nodes(64);
    scatter_context *context;
    double sum;
    w->lights[0].direction = sun;
    context = check_open_context(&w->scene, &q);
    sum = sum_of_plane(context, eye, 8);
    scatter_destroy(context);
    return sum;
}

/* The light's way turned round, in an opaque and lopsided medium: the same power. */
static void test_reciprocity(void **state) {
    static const scatter_vec3 ways[4] = {{0.48f, -0.6f, 0.64f}, {0, 0, 1}, {-0.8f, 0.6f, 0},
                                         {0.36f, 0.48f, -0.8f}};
    check_world w;
    double worst = 0, wrong = 0;
    int i, k;
    (void)state;
    check_world_open(&w);
    check_add_gaussians(&w, 5, 1.5f, 3.0f, 31);
    w.scene.medium.extinction = grey(1.5f);
    w.scene.medium.phase.kind = SCATTER_PHASE_HG;
    w.scene.medium.phase.g = 0.4f;
    check_add_light(&w, SCATTER_LIGHT_DIRECTIONAL, ways[0], grey(2));
    for (i = 0; i < 4; i++)
        for (k = 0; k < i; k++) {
            double there = power_between(&w, ways[i], ways[k]);
            double back = power_between(&w, ways[k], ways[i]);
            worst = fmax(worst, fabs(there / back - 1));
            wrong = fmax(wrong, fabs(power_between(&w, ways[i], ways[(k + 1) % 3]) / back - 1));
        }
    hard_row("reciprocity: sun and eye change places", "one of the two depths", 2 * PROMISE_64, worst);
    hard_fault("another pair", 2 * PROMISE_64, wrong);
    rows_hold();
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_measures_can_fail),
        cmocka_unit_test(test_pictures_can_fail),
        cmocka_unit_test(test_light_near_ray),
        cmocka_unit_test(test_light_near_surface),
        cmocka_unit_test(test_light_near_center),
        cmocka_unit_test(test_lamp_radius),
        cmocka_unit_test(test_light_at_eye),
        cmocka_unit_test(test_light_places),
        cmocka_unit_test(test_light_far),
        cmocka_unit_test(test_many_lights),
        cmocka_unit_test(test_thin),
        cmocka_unit_test(test_opaque),
        cmocka_unit_test(test_wide_gaussian),
        cmocka_unit_test(test_large_amplitude),
        cmocka_unit_test(test_overlapping),
        cmocka_unit_test(test_narrow_gaussian),
        cmocka_unit_test(test_narrow_among_wide),
        cmocka_unit_test(test_narrow_injected),
        cmocka_unit_test(test_albedo),
        cmocka_unit_test(test_phase_value),
        cmocka_unit_test(test_anisotropy),
        cmocka_unit_test(test_offset),
        cmocka_unit_test(test_scale),
        cmocka_unit_test(test_zero_length),
        cmocka_unit_test(test_grazing_bounds),
        cmocka_unit_test(test_grazing_gaussian),
        cmocka_unit_test(test_axis_parallel),
        cmocka_unit_test(test_reversed),
        cmocka_unit_test(test_cameras),
        cmocka_unit_test(test_depth_buffers),
        cmocka_unit_test(test_grids),
        cmocka_unit_test(test_lone_voxel),
        cmocka_unit_test(test_large_grid),
        cmocka_unit_test(test_denormals),
        cmocka_unit_test(test_denormal_view),
        cmocka_unit_test(test_half),
        cmocka_unit_test(test_half_depth),
        cmocka_unit_test(test_flicker),
        cmocka_unit_test(test_coarse_cells),
        cmocka_unit_test(test_volume_places),
        cmocka_unit_test(test_energy),
        cmocka_unit_test(test_reciprocity),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
