/* test_reference.c - the reference checks itself, so that it can check scatter.h. MIT licence.

   Three kinds of proof: closed formulas against adaptive quadrature; whole rays against formulas of
   the textbook; whole rays against a plain midpoint sum, which shares only the functions for
   points and segments with the reference. Each kind is shown to notice a planted fault. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "reference.h"

#include "check.h"

#include <gsl/gsl_integration.h>

/* Rounding of positions to float moves a value by about this much, relatively: ten times the
   precision of float. */
#define FLOAT_NOISE 1e-6

/* ---------------------------------------------------------------------- >>depth */

static double relative(double value, double reference) {
    return value == reference ? 0 : fabs(value - reference) / fabs(reference);
}

/* Worst relative difference of closed form and quadrature of the two media on random segments.
   Depths under 1e-9 of the largest are compared with that: the quadrature of a grid that is cut
   at a corner cannot be better. */
static double depth_difference(const scatter_medium *closed, const scatter_medium *summed,
                               float size, int segments) {
    uint64_t seed = 7;
    double worst = 0;
    int i;
    for (i = 0; i < segments; i++) {
        scatter_vec3 p = check_point(&seed, -size, size), q = check_point(&seed, -size, size);
        double a = reference_optical_depth(closed, p, q);
        double b = reference_optical_depth_adaptive(summed, p, q);
        worst = fmax(worst, fabs(a - b) / fmax(fabs(b), 1e-9));
    }
    return worst;
}

static void open_mixed(check_world *w) {
    check_world_open(w);
    w->scene.medium.constant = 0.2f;
    check_add_height(w, 0.7f, -0.3f, 0.4f);
    check_add_gaussians(w, 5, 1.0f, 12.0f, 3);
    check_add_grid(w, 5, 4, 7, check_cube(-0.8f, 0.9f), 4);
    check_bound(w, check_cube(-1.1f, 1.2f));
}

/* Smooth terms agree to 1e-9, the tolerance of the quadrature; kinks of voxels cost it a digit. */
static void depth_of_each_term(void **state) {
    check_world w;
    (void)state;
    check_world_open(&w);
    w.scene.medium.constant = 0.2f;
    assert_at_most(depth_difference(&w.scene.medium, &w.scene.medium, 3, 100), 1e-9);
    check_world_open(&w);
    check_add_height(&w, 2.0f, 0.5f, 0.3f);
    assert_at_most(depth_difference(&w.scene.medium, &w.scene.medium, 3, 100), 1e-9);
    check_world_open(&w);
    check_add_gaussian(&w, check_v3(0.2f, 0.1f, -0.3f), 5, 2);
    assert_at_most(depth_difference(&w.scene.medium, &w.scene.medium, 2, 300), 1e-9);
    check_world_open(&w);
    check_add_grid(&w, 6, 1, 9, check_cube(-1, 1), 5);
    assert_at_most(depth_difference(&w.scene.medium, &w.scene.medium, 1.5f, 30), 1e-8);
}

static void depth_of_a_mixture(void **state) {
    check_world w;
    (void)state;
    open_mixed(&w);
    assert_at_most(depth_difference(&w.scene.medium, &w.scene.medium, 1.5f, 30), 1e-8);
}

/* One thousandth more of anything is seen. */
static void depth_check_notices_faults(void **state) {
    check_world good, bad;
    (void)state;
    open_mixed(&good);
    open_mixed(&bad);
    bad.gaussians[2].a *= 1.001f;
    assert_at_least(depth_difference(&good.scene.medium, &bad.scene.medium, 1.5f, 5), 1e-6);
    open_mixed(&bad);
    bad.heights[0].scale *= 1.001f;
    assert_at_least(depth_difference(&good.scene.medium, &bad.scene.medium, 1.5f, 5), 1e-6);
    open_mixed(&bad);
    bad.voxels[0][70] += 0.1f;
    assert_at_least(depth_difference(&good.scene.medium, &bad.scene.medium, 1.5f, 5), 1e-6);
    open_mixed(&bad);
    bad.scene.medium.bounds.min.x += 0.001f;
    assert_at_least(depth_difference(&good.scene.medium, &bad.scene.medium, 1.5f, 5), 1e-6);
}

/* tau(p,q) = tau(q,p), tau(p,q) = tau(p,m) + tau(m,q). The middle is rounded to float, which
   bends the way by up to 1e-7 m where the density changes by up to 30 per metre. */
static void depth_is_symmetric_and_additive(void **state) {
    check_world w;
    uint64_t seed = 11;
    double turned = 0, parted = 0;
    int i;
    (void)state;
    open_mixed(&w);
    for (i = 0; i < 1000; i++) {
        scatter_vec3 p = check_point(&seed, -1.5f, 1.5f), q = check_point(&seed, -1.5f, 1.5f), m;
        double whole = reference_optical_depth(&w.scene.medium, p, q);
        m = check_v3((p.x + q.x) / 2, (p.y + q.y) / 2, (p.z + q.z) / 2);
        turned = fmax(turned, fabs(reference_optical_depth(&w.scene.medium, q, p) - whole));
        parted = fmax(parted, fabs(reference_optical_depth(&w.scene.medium, p, m) +
                                   reference_optical_depth(&w.scene.medium, m, q) - whole));
    }
    assert_at_most(turned, 1e-13);
    assert_at_most(parted, 3 * FLOAT_NOISE);
}

/* Far from the centre the depth of a Gaussian is tiny but keeps its digits: both ends beyond the
   centre, and a short segment, which quadrature has to a few roundings. */
static void depth_in_the_tails(void **state) {
    check_world w;
    float x;
    (void)state;
    check_world_open(&w);
    check_add_gaussian(&w, check_v3(0, 0, 0), 3, 1);
    for (x = 0; x < 8; x += 0.5f) {
        scatter_vec3 p = check_v3(x, 0.1f, 0), far = check_v3(x + 4, 0.1f, 0);
        scatter_vec3 close = check_v3(x + 1e-6f, 0.1f, 0);
        double a = reference_optical_depth(&w.scene.medium, p, far);
        double b = reference_optical_depth(&w.scene.medium, p, close);
        double c = reference_optical_depth(&w.scene.medium, close, p);
        assert_at_most(relative(a, reference_optical_depth_adaptive(&w.scene.medium, p, far)),
                       1e-10);
        assert_at_most(relative(b, reference_optical_depth_adaptive(&w.scene.medium, p, close)),
                       1e-12);
        assert_at_most(relative(b, c), 1e-12);
    }
}

/* Hand-made values of a 2x1x1 grid over [0,4]x[0,1]x[0,1]: centres at x = 1 and 3. */
static void grid_follows_its_definition(void **state) {
    static const float voxels[2] = {1, 3};
    check_world w;
    scatter_grid *g;
    scatter_medium *m = &w.scene.medium;
    (void)state;
    check_world_open(&w);
    g = check_add_grid(&w, 2, 1, 1, check_cube(0, 1), 1);
    g->density = voxels;
    g->box.max.x = 4;
    assert_at_most(fabs(reference_density(m, check_v3(0.5f, 0.1f, 0.9f)) - 1), 0);
    assert_at_most(fabs(reference_density(m, check_v3(2, 0.5f, 0.5f)) - 2), 0);
    assert_at_most(fabs(reference_density(m, check_v3(2.5f, 0.5f, 0.5f)) - 2.5), 0);
    assert_at_most(fabs(reference_density(m, check_v3(4, 0.5f, 0.5f)) - 3), 0);
    assert_at_most(reference_density(m, check_v3(-0.01f, 0.5f, 0.5f)), 0);
    assert_at_most(reference_density(m, check_v3(2, 1.01f, 0.5f)), 0);
    g->scale = 2;
    /* 1 m of 1, 2 m rising to 3, 1 m of 3, twice that */
    assert_at_most(
        fabs(reference_optical_depth(m, check_v3(-1, 0.5f, 0.5f), check_v3(5, 0.5f, 0.5f)) -
             2 * (1 + 4 + 3)),
        1e-14);
}

/* A light infinitely far away is the limit of a distant point; endless fog is opaque. */
static void depth_from_infinity(void **state) {
    check_world w;
    scatter_source sun;
    scatter_vec3 x = check_v3(0.1f, -0.2f, 0.3f);
    double near, far;
    (void)state;
    check_world_open(&w);
    check_add_gaussians(&w, 3, 1, 4, 9);
    check_add_height(&w, 0.5f, 0, 2);
    memset(&sun, 0, sizeof sun);
    sun.directional = 1;
    sun.direction = check_v3(1, -2, 0.5f);
    far = reference_source_depth(&w.scene.medium, &sun, x);
    near =
        reference_optical_depth(&w.scene.medium, x, check_v3(x.x - 1000, x.y + 2000, x.z - 500));
    assert_at_most(relative(near, far), FLOAT_NOISE);
    sun.direction.y = 0;
    assert_true(isinf(reference_source_depth(&w.scene.medium, &sun, x)));
    check_bound(&w, check_cube(-1, 1));
    assert_true(isfinite(reference_source_depth(&w.scene.medium, &sun, x)));
}

/* ---------------------------------------------------------------------- >>phase */

typedef struct moment {
    scatter_phase phase;
    int power; /* of the cosine */
} moment;

/* In s with cos = 1 - s^2, d cos = 2 s ds: the forward peak is flat there. */
static double moment_at(double s, void *data) {
    const moment *m = (const moment *)data;
    double cosine = 1 - s * s;
    return 4 * CHECK_PI * s * pow(cosine, m->power) * reference_phase(&m->phase, cosine);
}

/* Mean of cos^power over the sphere. */
static double phase_moment(scatter_phase phase, int power) {
    gsl_integration_workspace *space = gsl_integration_workspace_alloc(2000);
    double sum, error;
    gsl_function f;
    moment m;
    m.phase = phase;
    m.power = power;
    f.function = moment_at;
    f.params = &m;
    gsl_integration_qag(&f, 0, sqrt(2.0), 1e-10, 0, 2000, GSL_INTEG_GAUSS61, space, &sum, &error);
    gsl_integration_workspace_free(space);
    return sum;
}

static scatter_phase phase_of(scatter_phase_kind kind, float g, float alpha, float diameter) {
    scatter_phase p;
    p.kind = kind;
    p.g = g;
    p.alpha = alpha;
    p.diameter_um = diameter;
    return p;
}

/* Every phase function integrates to one; the mean cosine of Henyey-Greenstein is g. At g = 0.9999
   the rounding of the cosine, 1e-16, stands against (1 - g)^2 = 1e-8. */
static void phase_moments(void **state) {
    static const float g[7] = {-0.9999f, -0.7f, 0, 0.3f, 0.9f, 0.99f, 0.9999f};
    static const float d[9] = {0.02f, 0.1f, 0.3f, 1.2f, 1.5f, 3, 5, 20, 50};
    int i;
    (void)state;
    for (i = 0; i < 7; i++) {
        scatter_phase hg = phase_of(SCATTER_PHASE_HG, g[i], 0, 0);
        scatter_phase draine = phase_of(SCATTER_PHASE_DRAINE, g[i], 3, 0);
        assert_at_most(fabs(phase_moment(hg, 0) - 1), 1e-8);
        assert_at_most(fabs(phase_moment(hg, 1) - g[i]), 1e-8);
        assert_at_most(fabs(phase_moment(draine, 0) - 1), 1e-8);
    }
    for (i = 0; i < 9; i++) {
        scatter_phase fog = phase_of(SCATTER_PHASE_DROPLETS, 0, 0, d[i]);
        assert_at_most(fabs(phase_moment(fog, 0) - 1), 1e-9);
    }
    assert_at_most(fabs(phase_moment(phase_of(SCATTER_PHASE_ISOTROPIC, 0, 0, 0), 0) - 1), 1e-12);
    assert_at_most(fabs(phase_moment(phase_of(SCATTER_PHASE_RAYLEIGH, 0, 0, 0), 0) - 1), 1e-12);
    assert_at_most(fabs(phase_moment(phase_of(SCATTER_PHASE_RAYLEIGH, 0, 0, 0), 2) - 0.4), 1e-12);
}

/* Draine's function has the other two as limits; the moments notice a wrong sign of g. */
static void phase_limits(void **state) {
    scatter_phase hg = phase_of(SCATTER_PHASE_HG, 0.6f, 0, 0);
    scatter_phase draine = phase_of(SCATTER_PHASE_DRAINE, 0.6f, 0, 0);
    scatter_phase rayleigh = phase_of(SCATTER_PHASE_RAYLEIGH, 0, 0, 0);
    scatter_phase limit = phase_of(SCATTER_PHASE_DRAINE, 0, 1, 0);
    double c;
    (void)state;
    for (c = -1; c <= 1; c += 0.125) {
        assert_at_most(relative(reference_phase(&draine, c), reference_phase(&hg, c)), 1e-15);
        assert_at_most(relative(reference_phase(&limit, c), reference_phase(&rayleigh, c)),
                       1e-15);
    }
    hg.g = -0.6f;
    assert_at_least(fabs(phase_moment(hg, 1) - 0.6), 1);
}

/* The four ranges of the fit for droplets meet within 5 % away from the forward peak (which the
   authors let jump); a badly mistyped constant tears them apart. */
static void droplet_ranges_meet(void **state) {
    static const float joint[3] = {0.1f, 1.5f, 5};
    int i;
    (void)state;
    for (i = 0; i < 3; i++) {
        scatter_phase below = phase_of(SCATTER_PHASE_DROPLETS, 0, 0, joint[i] * 0.99999f);
        scatter_phase above = phase_of(SCATTER_PHASE_DROPLETS, 0, 0, joint[i] * 1.00001f);
        scatter_phase wrong = phase_of(SCATTER_PHASE_DROPLETS, 0, 0, joint[i] * 2);
        double c, torn = 0;
        for (c = -1; c <= 0.75; c += 0.25) {
            double p = reference_phase(&below, c);
            assert_at_most(relative(reference_phase(&above, c), p), 0.05);
            torn = fmax(torn, relative(reference_phase(&wrong, c), p));
        }
        assert_at_least(torn, 0.1);
    }
}

/* ---------------------------------------------------------------------- >>formulas */

static scatter_ray ray_of(scatter_vec3 origin, scatter_vec3 direction) {
    scatter_ray ray;
    ray.origin = origin;
    ray.direction = direction;
    return ray;
}

static double red(const check_world *w, scatter_vec3 origin, scatter_vec3 direction) {
    scatter_ray ray = ray_of(origin, direction);
    double rgb[3] = {NAN, NAN, NAN};
    assert_int_equal(reference_radiance(&w->scene, &ray, rgb, NULL, NULL), 0);
    return rgb[0];
}

/* Homogeneous fog under a slanted sun: the depth from the light is linear along the ray. The fog
   fills -1 < x < 1 up to y = 2; the sun stands at cos = 3/5 from the zenith. */
static void homogeneous_fog_and_sun(void **state) {
    check_world w;
    scatter_vec3 o = check_v3(-3, 0.25f, 0), u = check_v3(0.75f, 0.25f, 0);
    double s = sqrt(0.625), sigma = 3 * 0.5, entry = 2 * s / 0.75, y, rate, value;
    (void)state;
    check_world_open(&w);
    w.scene.medium.constant = 0.5f;
    w.scene.medium.extinction = check_v3(3, 3, 3);
    check_bound(&w, check_cube(-100, 100));
    w.scene.medium.bounds.min.x = -1;
    w.scene.medium.bounds.max.x = 1;
    w.scene.medium.bounds.max.y = 2;
    check_add_light(&w, SCATTER_LIGHT_DIRECTIONAL, check_v3(0, -3, 4), check_v3(2, 2, 2));
    y = 0.25 + entry * 0.25 / s;
    rate = sigma * (1 - 0.25 / s * 5 / 3.0); /* eye depth grows, depth from the light falls */
    value = exp(-sigma * (2 - y) * 5 / 3.0) * -expm1(-rate * entry) / rate;
    value *= 2 * sigma * (double)0.9f / (4 * CHECK_PI);
    assert_at_most(relative(red(&w, o, u), value), 1e-8);
    w.lights[0].intensity.x = 1.999f; /* the check notices a lamp that is a little weaker */
    assert_at_least(relative(red(&w, o, u), value), 1e-4);
}

/* Worst relative error of rays along the light of a sun behind the eye. Every point lies as deep
   below the sun as before the eye, so the ray sums up to omega E p (1 - T^2) / 2 in any medium. */
static double backlight_error(check_world *w, int rays) {
    uint64_t seed = 5;
    double worst = 0;
    int i;
    check_add_light(w, SCATTER_LIGHT_DIRECTIONAL, check_v3(0, 0, 1), check_v3(1, 1, 1));
    for (i = 0; i < rays; i++) {
        scatter_vec3 o = check_v3(check_uniform(&seed, -1, 1), check_uniform(&seed, -1, 1), -9);
        scatter_ray ray = ray_of(o, check_minus(check_point(&seed, -0.7f, 0.7f), o));
        double p = reference_phase(&w->scene.medium.phase, -1), rgb[3], t[3];
        w->lights[0].direction = ray.direction;
        assert_int_equal(reference_radiance(&w->scene, &ray, rgb, t, NULL), 0);
        p *= (double)w->scene.medium.albedo.x * (1 - t[0] * t[0]) / 2;
        worst = fmax(worst, relative(rgb[0], p));
    }
    return worst;
}

/* From thin to opaque; smooth media to the 1e-8 asked of the quadrature. */
static void sun_behind_the_eye(void **state) {
    static const float sigma[4] = {0.01f, 1, 30, 1000};
    check_world w;
    int i;
    (void)state;
    for (i = 0; i < 4; i++) {
        check_world_open(&w);
        w.scene.medium.extinction = check_v3(sigma[i], sigma[i], sigma[i]);
        w.scene.medium.phase = phase_of(SCATTER_PHASE_HG, -0.5f, 0, 0);
        check_add_gaussians(&w, 12, 1, 30, 41);
        assert_at_most(backlight_error(&w, 10), 1e-8);
    }
    open_mixed(&w);
    assert_at_most(backlight_error(&w, 10), 1e-8);
}

/* Endless height fog: with v = D scale, looking up under a sun at zenith angle z the exponent is
   v0 - v + v / cos z, linear in v. */
static void height_fog_and_sun(void **state) {
    check_world w;
    double v0 = (double)0.8f * 0.5, k = 5 / 4.0 - 1, value;
    (void)state;
    check_world_open(&w);
    check_add_height(&w, 0.8f, 0, 0.5f);
    check_add_light(&w, SCATTER_LIGHT_DIRECTIONAL, check_v3(0, -4, 3), check_v3(1, 1, 1));
    value = (double)0.9f / (4 * CHECK_PI) * exp(-v0) * -expm1(-k * v0) / k;
    assert_at_most(relative(red(&w, check_v3(0, 0, 0), check_v3(0, 1, 0)), value), 1e-8);
}

/* Fog without extinction to speak of and a lamp: the integral of 1/(h^2 + R^2 + t^2) is an arc
   tangent. The fog is integrated to 1e7 m, which leaves out 1e-7 of it; its extinction takes
   1e-9 from the light on the first 1e3 m. */
static void thin_fog_and_lamp(void **state) {
    static const float h[4] = {10, 1, 0.01f, 0};
    check_world w;
    int i;
    (void)state;
    check_world_open(&w);
    w.scene.medium.constant = 1e-12f;
    check_add_light(&w, SCATTER_LIGHT_POINT, check_v3(5, 0, 0), check_v3(1, 1, 1));
    for (i = 0; i < 4; i++) {
        double d = sqrt((double)h[i] * h[i] + (double)0.01f * (double)0.01f);
        double value =
            (CHECK_PI / 2 + atan(5 / d)) / d / (4 * CHECK_PI) * (double)0.9f * (double)1e-12f;
        double got = red(&w, check_v3(0, h[i], 0), check_v3(1, 0, 0));
        assert_at_most(relative(got, value), h[i] > 1 ? 1e-5 : 1e-6);
    }
}

/* Power that a thin Gaussian takes from a sun comes out again: an orthographic picture sums up to
   sigma_s E p times the integral of D, c (sqrt(pi)/a)^3. The trapezoidal sum of a Gaussian is
   exact to rounding; the extinction of 1e-8 bends it by less than 1e-7. */
static void energy_of_a_thin_gaussian(void **state) {
    check_world w;
    double sum = 0, value = (double)1e-8f * (double)0.9f / (4 * CHECK_PI) * 2;
    int i, j;
    (void)state;
    check_world_open(&w);
    w.scene.medium.extinction = check_v3(1e-8f, 1e-8f, 1e-8f);
    check_add_gaussian(&w, check_v3(0, 0, 0), 1, 2);
    check_add_light(&w, SCATTER_LIGHT_DIRECTIONAL, check_v3(1, 1, 3), check_v3(1, 1, 1));
    for (i = -12; i <= 12; i++)
        for (j = -12; j <= 12; j++)
            sum +=
                red(&w, check_v3((float)i * 0.5f, (float)j * 0.5f, -20), check_v3(0, 0, 1)) / 4;
    assert_at_most(relative(sum, value * pow(CHECK_PI, 1.5)), 1e-6);
}

/* Emission alone: the sum of D emission T over the ray; midpoints meet the edges of box and grid
   within 1e-4 m. */
static void emission_of_a_mixture(void **state) {
    enum { N = 20000 };
    check_world w;
    double sum = 0;
    int i;
    (void)state;
    open_mixed(&w);
    w.scene.medium.emission = check_v3(0.7f, 0, 0);
    for (i = 0; i < N; i++) {
        scatter_vec3 o = check_v3(-2, 0.1f, 0.2f),
                     x = check_v3(-2 + 4 * ((float)i + 0.5f) / N, o.y, o.z);
        sum += reference_density(&w.scene.medium, x) *
               exp(-reference_optical_depth(&w.scene.medium, o, x)) * 4 / N;
    }
    assert_at_most(
        relative(red(&w, check_v3(-2, 0.1f, 0.2f), check_v3(1, 0, 0)), (double)0.7f * sum), 1e-4);
    assert_at_most(red(&w, check_v3(-2, 5, 0.2f), check_v3(1, 0, 0)), 0);
}

/* ---------------------------------------------------------------------- >>midpoint sum */

typedef enum fault { NONE, NO_LIGHT_DEPTH, NO_SHADOW, NO_PHASE, NO_SPOT, NO_RADIUS } fault;

static double naive_spot(const scatter_light *light, scatter_vec3 x) {
    scatter_vec3 d = check_minus(x, light->position);
    double cosine = check_dot(d, light->direction) / sqrt(check_dot(d, d)) /
                    sqrt(check_dot(light->direction, light->direction));
    double a = cos((double)light->outer), b = cos((double)light->inner),
           s = (cosine - a) / (b - a);
    s = s < 0 ? 0 : s > 1 ? 1 : s;
    return s * s * (3 - 2 * s);
}

static scatter_vec3 naive_target(const scatter_light *l, scatter_vec3 x) {
    return l->kind == SCATTER_LIGHT_DIRECTIONAL ? check_along(x, -100, l->direction)
                                                : l->position;
}

/* Irradiance at x of a light of intensity 1, with its shadows but without the medium. */
static double naive_light(const scatter_scene *s, const scatter_light *l, scatter_vec3 x,
                          fault f) {
    double r = check_distance(l->position, x), radius = f == NO_RADIUS ? 0 : (double)l->radius,
           e = 1;
    if (f != NO_SHADOW && s->visible && !s->visible(s->user, x, naive_target(l, x)))
        return 0;
    if (l->kind != SCATTER_LIGHT_DIRECTIONAL)
        e = 1 / (r * r + radius * radius);
    return l->kind == SCATTER_LIGHT_SPOT && f != NO_SPOT ? e * naive_spot(l, x) : e;
}

static double naive_cosine(const scatter_light *l, scatter_vec3 x, scatter_vec3 u) {
    scatter_vec3 d = check_minus(l->position, x);
    if (l->kind == SCATTER_LIGHT_DIRECTIONAL)
        d = check_v3(-l->direction.x, -l->direction.y, -l->direction.z);
    return check_dot(d, u) / sqrt(check_dot(d, d)) / sqrt(check_dot(u, u));
}

static double naive_depth(const scatter_scene *s, const scatter_light *l, scatter_vec3 x) {
    scatter_source source;
    source.directional = l->kind == SCATTER_LIGHT_DIRECTIONAL;
    source.position = l->position;
    source.direction = l->direction;
    return reference_source_depth(&s->medium, &source, x);
}

/* The source of the first light at x, per metre, before its colour. */
static void naive_point(const scatter_scene *s, scatter_ray ray, scatter_vec3 x, fault f,
                        double sum[3]) {
    const scatter_light *l = s->lights;
    double k = reference_density(&s->medium, x) * naive_light(s, l, x, f), tau;
    const float *sigma = &s->medium.extinction.x;
    int c;
    if (k > 0) {
        tau = reference_optical_depth(&s->medium, ray.origin, x);
        tau += f == NO_LIGHT_DEPTH ? 0 : naive_depth(s, l, x);
        k *= f == NO_PHASE ? 0.25 / CHECK_PI
                           : reference_phase(&s->medium.phase, naive_cosine(l, x, ray.direction));
        for (c = 0; c < 3; c++)
            sum[c] += k * exp(-(double)sigma[c] * tau);
    }
}

/* Light of the first lamp that the medium scatters to the origin, up to `far`, by n midpoints. */
static void naive_radiance(const scatter_scene *s, scatter_ray ray, double far, int n, fault f,
                           double rgb[3]) {
    const scatter_medium *m = &s->medium;
    double length = sqrt(check_dot(ray.direction, ray.direction)), sum[3] = {0, 0, 0};
    int i;
    for (i = 0; i < n; i++) {
        double t = far * (i + 0.5) / n / length;
        naive_point(s, ray, check_along(ray.origin, (float)t, ray.direction), f, sum);
    }
    rgb[0] = sum[0] * far / n * (double)m->extinction.x * (double)m->albedo.x *
             (double)s->lights->intensity.x;
    rgb[1] = sum[1] * far / n * (double)m->extinction.y * (double)m->albedo.y *
             (double)s->lights->intensity.y;
    rgb[2] = sum[2] * far / n * (double)m->extinction.z * (double)m->albedo.z *
             (double)s->lights->intensity.z;
}

/* Worst relative difference of reference and midpoint sum; random rays from z = -3 inwards. */
static double ray_difference(const scatter_scene *s, int rays, int n, fault f) {
    uint64_t seed = 21;
    double worst = 0, a[3], b[3], surface[3], transmittance[3];
    int i, c;
    for (i = 0; i < rays; i++) {
        scatter_vec3 o = check_v3(check_uniform(&seed, -1, 1), check_uniform(&seed, -1, 1), -3);
        scatter_ray ray = ray_of(o, check_minus(check_point(&seed, -0.7f, 0.7f), o));
        assert_int_equal(reference_radiance(s, &ray, a, transmittance, surface), 0);
        naive_radiance(s, ray, 12, n, f, b);
        for (c = 0; c < 3; c++)
            worst = fmax(worst, fabs(a[c] - b[c]) / b[c]);
    }
    return worst;
}

static void open_smooth(check_world *w) {
    check_world_open(w);
    w->scene.medium.extinction = check_v3(0.4f, 1, 1.7f);
    w->scene.medium.albedo = check_v3(0.9f, 0.5f, 1);
    w->scene.medium.phase = phase_of(SCATTER_PHASE_HG, 0.6f, 0, 0);
    check_add_gaussians(w, 6, 0.8f, 4, 31);
    check_add_light(w, SCATTER_LIGHT_POINT, check_v3(0.7f, 0.9f, -0.8f), check_v3(3, 2, 1));
    w->lights[0].radius = 0.1f;
}

/* Smooth media: the midpoint sum of 20000 is good to (12/20000/0.1)^2/24 = 2e-6 near the lamp. */
static void rays_in_smooth_media(void **state) {
    check_world w;
    (void)state;
    open_smooth(&w);
    assert_at_most(ray_difference(&w.scene, 6, 20000, NONE), 3 * FLOAT_NOISE);
    assert_at_least(ray_difference(&w.scene, 2, 2000, NO_LIGHT_DEPTH), 1e-2);
    assert_at_least(ray_difference(&w.scene, 2, 2000, NO_PHASE), 1e-2);
    assert_at_least(ray_difference(&w.scene, 2, 2000, NO_RADIUS), 1e-4);
    w.lights[0].kind = SCATTER_LIGHT_DIRECTIONAL;
    w.lights[0].direction = check_v3(0.4f, -1, 0.2f);
    assert_at_most(ray_difference(&w.scene, 6, 20000, NONE), 3 * FLOAT_NOISE);
}

/* Constant fog and grids jump at faces, spots bend at their cones: 20000 midpoints meet an edge
   within 3e-4 m, of which the tolerance is a small multiple. */
static void rays_with_edges(void **state) {
    check_world w;
    (void)state;
    open_smooth(&w);
    w.scene.medium.constant = 0.3f;
    check_add_height(&w, 0.5f, -0.5f, 0.3f);
    check_bound(&w, check_cube(-1.1f, 1.2f));
    assert_at_most(ray_difference(&w.scene, 4, 20000, NONE), 5e-4);
    w.lights[0].kind = SCATTER_LIGHT_SPOT;
    w.lights[0].direction = check_v3(-0.7f, -0.9f, 0.8f);
    w.lights[0].inner = 0.3f;
    w.lights[0].outer = 0.6f;
    assert_at_most(ray_difference(&w.scene, 4, 20000, NONE), 5e-4);
    assert_at_least(ray_difference(&w.scene, 2, 2000, NO_SPOT), 1e-2);
    check_add_grid(&w, 3, 2, 4, check_cube(-0.9f, 0.8f), 6);
    assert_at_most(ray_difference(&w.scene, 4, 20000, NONE), 5e-4);
}

/* A grid whose outermost voxels are empty, so that its density does not jump at the box. */
static void add_soft_grid(check_world *w, scatter_box box, uint64_t seed) {
    float *v = w->voxels[w->scene.medium.grid_count];
    int i, j, k;
    check_add_grid(w, 10, 10, 12, box, seed);
    for (k = 0; k < 12; k++)
        for (j = 0; j < 10; j++)
            for (i = 0; i < 10; i++)
                if (i % 9 == 0 || j % 9 == 0 || k % 11 == 0)
                    v[i + 10 * (j + 10 * k)] = 0;
}

static void open_voxels(check_world *w) {
    int i;
    check_world_open(w);
    w->scene.medium.extinction = check_v3(1, 3, 9);
    for (i = 0; i < 4; i++)
        add_soft_grid(w, check_cube(-1 - 0.01f * (float)i, 1 + 0.02f * (float)i),
                      8 + (uint64_t)i);
    check_add_gaussian(w, check_v3(0, 0, 0), 5, 3);
    check_add_light(w, SCATTER_LIGHT_DIRECTIONAL, check_v3(1, -2, 0.5f), check_v3(1, 1, 1));
}

/* More than 48 voxel planes on each ray: Gauss-Legendre in every cell, promised to 1e-4. */
static void rays_through_voxels(void **state) {
    check_world w;
    (void)state;
    open_voxels(&w);
    assert_at_most(ray_difference(&w.scene, 4, 20000, NONE), 1e-4);
    w.lights[0].kind = SCATTER_LIGHT_POINT;
    w.lights[0].position = check_v3(0.3f, 0.5f, -0.2f);
    w.lights[0].radius = 0.05f;
    assert_at_most(ray_difference(&w.scene, 4, 20000, NONE), 1e-4);
    assert_at_least(ray_difference(&w.scene, 2, 2000, NO_LIGHT_DEPTH), 1e-2);
}

/* The same under a sun behind the eye: cells up to several hundred optical depths, all of them cut
   by the jump of the density at the box. */
static void opaque_voxels(void **state) {
    static const float sigma[4] = {1, 10, 100, 1000};
    check_world w;
    scatter_box box = check_cube(-2, 2);
    int i;
    (void)state;
    box.min.z = -8;
    box.max.z = 8;
    for (i = 0; i < 4; i++) {
        check_world_open(&w);
        check_add_grid(&w, 2, 2, 60, box, 13);
        w.scene.medium.extinction = check_v3(sigma[i], sigma[i], sigma[i]);
        assert_at_most(backlight_error(&w, 10), 1e-4);
    }
}

/* From 64 Gaussians on, those that shade a sector of the ray are selected; narrow ones must not be
   overlooked. */
static void rays_among_many_gaussians(void **state) {
    static scatter_gaussian many[200];
    uint64_t seed = 77;
    check_world w;
    int i;
    (void)state;
    check_world_open(&w);
    for (i = 0; i < 200; i++) {
        many[i].center = check_point(&seed, -1, 1);
        many[i].a = check_uniform(&seed, 3, 30);
        many[i].c = check_uniform(&seed, 1, 20);
    }
    w.scene.medium.gaussians = many;
    w.scene.medium.gaussian_count = 200;
    check_add_light(&w, SCATTER_LIGHT_POINT, check_v3(1.5f, 1, -0.5f), check_v3(1, 1, 1));
    assert_at_most(ray_difference(&w.scene, 4, 8000, NONE), 3 * FLOAT_NOISE);
    w.lights[0].kind = SCATTER_LIGHT_DIRECTIONAL;
    w.lights[0].direction = check_v3(-1, -1, 0);
    assert_at_most(ray_difference(&w.scene, 4, 8000, NONE), 3 * FLOAT_NOISE);
}

/* A puff of 1 mm on a ray of 100 m, of depth tau. To first order in tau its light is dimmed by
   tau/2 on the way to the eye and by tau/2/sqrt(2) on the way from the sun at right angles. */
static void a_narrow_gaussian_is_found(void **state) {
    check_world w;
    double tau = sqrt(CHECK_PI) / 1000, value;
    (void)state;
    check_world_open(&w);
    check_add_gaussian(&w, check_v3(-20, 0, 0), 0.1f, 1e-9f);
    check_add_gaussian(&w, check_v3(37.123f, 0, 0), 1000, 1);
    check_add_light(&w, SCATTER_LIGHT_DIRECTIONAL, check_v3(0, 1, 0), check_v3(1, 1, 1));
    value = red(&w, check_v3(-50, 0, 0), check_v3(1, 0, 0));
    w.scene.medium.gaussian_count = 1;
    value -= red(&w, check_v3(-50, 0, 0), check_v3(1, 0, 0));
    value /= (double)0.9f / (4 * CHECK_PI) * tau;
    assert_at_most(fabs(value - (1 - tau * (0.5 + sqrt(0.125)))), tau * tau);
}

/* A small opaque puff throws a shadow of a few centimetres through a wide thin one. */
static void a_narrow_shadow_is_found(void **state) {
    check_world w;
    (void)state;
    check_world_open(&w);
    check_add_gaussian(&w, check_v3(0, 0, 0), 0.5f, 0.1f);
    check_add_gaussian(&w, check_v3(0.1f, 1.5f, -0.2f), 90, 500);
    check_add_light(&w, SCATTER_LIGHT_POINT, check_v3(0.15f, 2.2f, -0.25f), check_v3(1, 1, 1));
    assert_at_most(ray_difference(&w.scene, 20, 6000, NONE), FLOAT_NOISE);
    w.lights[0].kind = SCATTER_LIGHT_DIRECTIONAL;
    w.lights[0].direction = check_v3(-0.2f, -1.5f, 0.2f);
    assert_at_most(ray_difference(&w.scene, 20, 6000, NONE), FLOAT_NOISE);
}

/* ---------------------------------------------------------------------- >>surfaces */

/* A wall in the plane x = 1 with a square window |y|, |z| < 0.2. */
static int window_visible(void *user, scatter_vec3 p, scatter_vec3 q) {
    double s = (1.0 - p.x) / ((double)q.x - p.x), y, z;
    (void)user;
    if ((p.x < 1) == (q.x < 1))
        return 1;
    y = p.y + s * ((double)q.y - p.y);
    z = p.z + s * ((double)q.z - p.z);
    return fabs(y) < 0.2 && fabs(z) < 0.2;
}

/* Shafts of light through a window. The sum of 20000 midpoints misses each of the edges by up to
   2e-4 m, of about 0.5 m of light. */
static void shadow_edges(void **state) {
    check_world w;
    scatter_ray ray = ray_of(check_v3(0, 0.1f, -3), check_v3(0, 0, 1));
    double a[3], b[3];
    (void)state;
    open_smooth(&w);
    w.scene.visible = window_visible;
    w.lights[0].position = check_v3(2, 0, 0);
    assert_int_equal(reference_radiance(&w.scene, &ray, a, NULL, NULL), 0);
    naive_radiance(&w.scene, ray, 8, 20000, NONE, b);
    assert_at_most(relative(a[0], b[0]), 2e-3);
    naive_radiance(&w.scene, ray, 8, 20000, NO_SHADOW, b);
    assert_at_least(relative(a[0], b[0]), 0.1);
}

/* The floor y = -1, half mirror. */
static int floor_surface(void *user, scatter_vec3 o, scatter_vec3 u, scatter_surface *hit) {
    (void)user;
    if (u.y >= 0)
        return 0;
    memset(hit, 0, sizeof *hit);
    hit->distance = (-1 - o.y) / u.y;
    hit->normal = check_v3(0, 1, 0);
    hit->albedo = check_v3(0.5f, 0, 0);
    hit->specular = check_v3(0, 0.25f, 0);
    hit->shininess = 10;
    return 1;
}

/* A lamp 2 m above the floor, seen at 45 degrees: red is Lambert, green Phong. */
static void surfaces_are_lit_through_the_medium(void **state) {
    check_world w;
    scatter_ray ray = ray_of(check_v3(-1, 0, 0), check_v3(1, -1, 0));
    double rgb[3], t[3], surface[3], e = 8 / (4 + (double)0.01f * (double)0.01f);
    (void)state;
    check_world_open(&w);
    w.scene.medium.constant = 0.1f;
    w.scene.surface = floor_surface;
    check_add_light(&w, SCATTER_LIGHT_POINT, check_v3(0, 1, 0), check_v3(8, 8, 8));
    assert_int_equal(reference_radiance(&w.scene, &ray, rgb, t, surface), 0);
    e *= exp(-(double)0.1f * 2);
    assert_at_most(relative(surface[0], e * 0.5 / CHECK_PI), FLOAT_NOISE);
    assert_at_most(relative(surface[1], e * 0.25 * 12 / (2 * CHECK_PI) * pow(0.5, 5)),
                   FLOAT_NOISE);
    assert_at_most(surface[2], 0);
    assert_at_most(relative(t[0], exp(-(double)0.1f * sqrt(2.0))), FLOAT_NOISE);
    ray.direction.y = 1;
    w.scene.background = check_v3(1, 2, 3);
    assert_int_equal(reference_radiance(&w.scene, &ray, rgb, t, surface), 0);
    assert_at_most(fabs(surface[0] - 1) + fabs(surface[1] - 2) + fabs(surface[2] - 3) + t[0], 0);
}

/* ---------------------------------------------------------------------- >>image */

enum { WIDTH = 7, HEIGHT = 5 };

static scatter_view view_of(void) {
    scatter_view v;
    memset(&v, 0, sizeof v);
    v.origin = check_v3(0, 0, -4);
    v.direction = check_v3(-0.5f, 0.25f, 1);
    v.direction_dx = check_v3(1, 0, 0);
    v.direction_dy = check_v3(0, -0.5f, 0);
    return v;
}

/* The same bits from one thread and from three; a pixel is the ray through its centre. */
static void image_of_a_scene(void **state) {
    check_world w;
    scatter_view v = view_of();
    float one[3 * WIDTH * HEIGHT], three[3 * WIDTH * HEIGHT];
    double rgb[3], t[3], surface[3];
    scatter_ray ray;
    (void)state;
    open_smooth(&w);
    w.scene.background = check_v3(0.1f, 0.2f, 0.3f);
    assert_int_equal(reference_image(&w.scene, &v, WIDTH, HEIGHT, one, 1), 0);
    assert_int_equal(reference_image(&w.scene, &v, WIDTH, HEIGHT, three, 3), 0);
    assert_int_equal(memcmp(one, three, sizeof one), 0);
    /* column 2, row 1: x = 2.5/7, y = 1.5/5 */
    ray = ray_of(v.origin, check_v3(-0.5f + 2.5f / 7, 0.25f - 0.5f * 0.3f, 1));
    assert_int_equal(reference_radiance(&w.scene, &ray, rgb, t, surface), 0);
    assert_at_most(relative((double)one[3 * (WIDTH + 2) + 1], rgb[1] + t[1] * surface[1]),
                   FLOAT_NOISE);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(depth_of_each_term),
        cmocka_unit_test(depth_of_a_mixture),
        cmocka_unit_test(depth_check_notices_faults),
        cmocka_unit_test(depth_is_symmetric_and_additive),
        cmocka_unit_test(depth_in_the_tails),
        cmocka_unit_test(grid_follows_its_definition),
        cmocka_unit_test(depth_from_infinity),
        cmocka_unit_test(phase_moments),
        cmocka_unit_test(phase_limits),
        cmocka_unit_test(droplet_ranges_meet),
        cmocka_unit_test(homogeneous_fog_and_sun),
        cmocka_unit_test(sun_behind_the_eye),
        cmocka_unit_test(height_fog_and_sun),
        cmocka_unit_test(thin_fog_and_lamp),
        cmocka_unit_test(energy_of_a_thin_gaussian),
        cmocka_unit_test(emission_of_a_mixture),
        cmocka_unit_test(rays_in_smooth_media),
        cmocka_unit_test(rays_with_edges),
        cmocka_unit_test(rays_through_voxels),
        cmocka_unit_test(opaque_voxels),
        cmocka_unit_test(rays_among_many_gaussians),
        cmocka_unit_test(a_narrow_gaussian_is_found),
        cmocka_unit_test(a_narrow_shadow_is_found),
        cmocka_unit_test(shadow_edges),
        cmocka_unit_test(surfaces_are_lit_through_the_medium),
        cmocka_unit_test(image_of_a_scene),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
