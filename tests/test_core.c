/* test_core.c - the shared core of scatter.h: the error that each comment states, measured.

   References are long double functions of libm, which one test holds against MPFR. Every kind of
   check is also applied to something wrong (names with "planted"), and must say so. */
#define SCATTER_IMPLEMENTATION
#include "../scatter.h"

#include <float.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "check.h"

#if !defined(__i386__) /* where a 32-bit MPFR is rarely installed */
#define TEST_MPFR
#include <mpfr.h>
#endif

#define PI 3.141592653589793238462643383279502884L
#define STRIDE 3001u /* every 3001st float: about seven hundred thousand of them */

/* Relative error; a result below FLT_MIN may be 0. NaN counts as infinite. */
static double relative_error(float value, long double truth) {
    double e;
    if (fabsl(truth) < FLT_MIN)
        return fabsf(value) <= FLT_MIN ? 0.0 : HUGE_VAL;
    e = (double)fabsl((long double)value / truth - 1.0L);
    return e >= 0.0 ? e : HUGE_VAL;
}

static double larger(double a, double b) { return b > a ? b : a; }

/* Says what was measured, so that the figures in the comments can be read off a test run. */
static void assert_bound(const char *what, double error, double bound) {
    print_message("             %-18s error %.2g, stated %.2g\n", what, error, bound);
    assert_true(error <= bound);
}

/* --------------------------------------------------------------------- >>functions of one float */

typedef float function(float x);
typedef long double truth(long double x);

static long double bell_truth(long double x) { return expl(-x * x); }
static long double decay_truth(long double x) { return expl(-x); }
static long double rsqrt_truth(long double x) { return 1.0L / sqrtl(x); }
static long double exprel_truth(long double x) { return x == 0.0L ? 1.0L : expm1l(x) / x; }

/* expl overflows above 100; there the asymptotic series has more digits than are asked for. */
static long double erfcx_truth(long double x) {
    long double z = 1.0L / (x * x);
    if (x < 100.0L)
        return expl(x * x) * erfcl(x);
    return (1.0L - z * (0.5L - z * (0.75L - z * 1.875L))) / (x * sqrtl(PI));
}

typedef struct unary {
    const char *name;
    function *f;
    truth *f_truth;
    float low, high; /* not negative */
    int signs;       /* -1, 1: the arguments are of that sign; 0: of both */
    double bound;
} unary;

static const unary unaries[] = {
    {"exp", scatteri_exp, expl, 0.0f, 88.36f, 1, 1.0e-7},
    {"exp below 0", scatteri_exp, expl, 0.0f, 3.4e38f, -1, 1.0e-7},
    {"decay", scatteri_decay, decay_truth, 0.0f, 87.0f, 1, 1.0e-7},
    {"rsqrt", scatteri_rsqrt, rsqrt_truth, FLT_MIN, FLT_MAX, 1, 1.5e-7},
    {"sqrt", scatteri_sqrt, sqrtl, FLT_MIN, FLT_MAX, 1, 1.7e-7},
    {"log", scatteri_log, logl, FLT_MIN, FLT_MAX, 1, 1.2e-7},
    {"bell", scatteri_bell, bell_truth, 0.0f, FLT_MAX, 0, 2.0e-7},
    {"erfcx", scatteri_erfcx, erfcx_truth, 0.0f, 1.0e30f, 1, 3.0e-7},
    {"erf", scatteri_erf, erfl, 0.0f, FLT_MAX, 0, 2.0e-7},
    {"exprel", scatteri_exprel, exprel_truth, 0.0f, 80.0f, 1, 2.0e-7},
    {"exprel below 0", scatteri_exprel, exprel_truth, 0.0f, 1.0e30f, -1, 2.0e-7},
    {"asinh", scatteri_asinh, asinhl, 0.0f, 1.0e18f, 0, 3.5e-7},
    {"sinh", scatteri_sinh, sinhl, 0.0f, 88.0f, 0, 2.0e-7},
    {"cosh", scatteri_cosh, coshl, 0.0f, 88.0f, 0, 2.0e-7},
};

static double error_at(const unary *t, float x) {
    double e = 0.0;
    if (t->signs >= 0)
        e = larger(e, relative_error(t->f(x), t->f_truth(x)));
    if (t->signs <= 0)
        e = larger(e, relative_error(t->f(-x), t->f_truth(-x)));
    return e;
}

/* The largest error on dense samples, at the ends, beside every power of 2 and every integer. */
static double unary_error(const unary *t) {
    double e = larger(error_at(t, t->low), error_at(t, t->high));
    unsigned u, last = scatteri_bits(t->high);
    int i;
    for (u = scatteri_bits(t->low); u < last; u += STRIDE)
        e = larger(e, error_at(t, scatteri_from_bits(u)));
    for (i = 0; i < 255 * 3; i++) {
        float power = scatteri_from_bits(((unsigned)(i / 3) << 23) + (unsigned)(i % 3) - (i >= 3));
        float whole = (float)(i / 3) * scatteri_from_bits(0x3F7FFFFFu + (unsigned)(i % 3));
        if (power >= t->low && power <= t->high)
            e = larger(e, error_at(t, power));
        if (whole >= t->low && whole <= t->high)
            e = larger(e, error_at(t, whole));
    }
    return e;
}

static void functions_of_one_float(void **state) {
    size_t i;
    (void)state;
    for (i = 0; i < sizeof unaries / sizeof unaries[0]; i++)
        assert_bound(unaries[i].name, unary_error(&unaries[i]), unaries[i].bound);
}

/* Abramowitz and Stegun 7.1.26: good to 1.5e-7, but not in relative terms near 0. */
static float planted_erf(float x) {
    float t = 1.0f / (1.0f + 0.3275911f * fabsf(x));
    float p =
        t * (0.254829592f +
             t * (-0.284496736f + t * (1.421413741f + t * (-1.453152027f + t * 1.061405429f))));
    return copysignf(1.0f - p * expf(-x * x), x);
}

static float planted_exp(float x) { return scatteri_exp(x) * 1.0000003f; }
static float planted_exprel(float x) { return x == 0.0f ? 1.0f : (expf(x) - 1.0f) / x; }
static float planted_asinh(float x) { return logf(x + sqrtf(x * x + 1.0f)); }

static void functions_of_one_float_planted(void **state) {
    static const unary planted[] = {
        {"erf", planted_erf, erfl, 0.0f, FLT_MAX, 0, 2.0e-7},
        {"exp", planted_exp, expl, 0.0f, 88.36f, 1, 1.0e-7},
        {"exprel", planted_exprel, exprel_truth, 0.0f, 80.0f, 1, 2.0e-7},
        {"asinh", planted_asinh, asinhl, 0.0f, 1.0e18f, 0, 3.5e-7},
    };
    size_t i;
    (void)state;
    for (i = 0; i < sizeof planted / sizeof planted[0]; i++)
        assert_false(unary_error(&planted[i]) <= planted[i].bound);
}

/* What the comments of exp, sqrt and bell say about the ends. */
static void ends_of_the_range(void **state) {
    (void)state;
    assert_true(scatteri_exp(-87.34f) == 0.0f && scatteri_exp(-1.0e30f) == 0.0f);
    assert_true(scatteri_exp(-HUGE_VALF) == 0.0f);
    assert_true(scatteri_exp(-87.33f) >= FLT_MIN);
    assert_true(scatteri_exp(1.0e30f) == scatteri_exp(88.38f));
    assert_true(scatteri_exp(HUGE_VALF) > 2.3e38f && scatteri_exp(HUGE_VALF) < HUGE_VALF);
    assert_true(scatteri_decay(0.0f) == 1.0f && scatteri_decay(HUGE_VALF) < 1.7e-38f);
    assert_true(scatteri_sqrt(0.0f) == 0.0f && scatteri_sqrt(1.0e-40f) == 0.0f);
    assert_true(scatteri_rsqrt(0.0f) < HUGE_VALF);
    assert_true(scatteri_bell(9.35f) == 0.0f && scatteri_bell(HUGE_VALF) == 0.0f);
    assert_true(scatteri_erf(HUGE_VALF) == 1.0f && scatteri_erf(-HUGE_VALF) == -1.0f);
}

static void selections(void **state) {
    static const float values[] = {-HUGE_VALF, -3.5f,    -1.0f, -1.0e-40f, -0.0f,
                                   0.0f,       1.0e-40f, 1.0f,  2.75f,     HUGE_VALF};
    size_t i, j, n = sizeof values / sizeof values[0];
    (void)state;
    for (i = 0; i < n; i++)
        for (j = 0; j < n; j++) {
            float x = values[i], y = values[j];
            assert_true(scatteri_choose(x, y, 1.0f, 2.0f) == (x < y ? 1.0f : 2.0f));
            assert_true(scatteri_min(x, y) == fminf(x, y) && scatteri_max(x, y) == fmaxf(x, y));
            if (!signbit(y)) {
                assert_true(scatteri_cap(x, y) == fminf(x, y));
                assert_true(scatteri_within(x, y) == fmaxf(fminf(x, y), -y));
            }
        }
    for (i = 1; i + 1 < n; i++)
        assert_true(scatteri_abs(values[i]) == fabsf(values[i]) &&
                    scatteri_floor(values[i]) == floorf(values[i]));
    assert_true(scatteri_floor(1.0e9f) == 1.0e9f && scatteri_floor(-2.5f) == -3.0f &&
                scatteri_floor(7.0f) == 7.0f);
}

#ifdef TEST_MPFR
/* The reference functions against 200 bits. */
static long double by_mpfr(int (*f)(mpfr_t, const mpfr_t, mpfr_rnd_t), float x) {
    long double result;
    mpfr_t a;
    mpfr_init2(a, 200);
    mpfr_set_flt(a, x, MPFR_RNDN);
    f(a, a, MPFR_RNDN);
    result = mpfr_get_ld(a, MPFR_RNDN);
    mpfr_clear(a);
    return result;
}

static int mpfr_bell(mpfr_t r, const mpfr_t x, mpfr_rnd_t round) {
    mpfr_sqr(r, x, round);
    mpfr_neg(r, r, round);
    return mpfr_exp(r, r, round);
}

static int mpfr_erfcx(mpfr_t r, const mpfr_t x, mpfr_rnd_t round) {
    mpfr_t square;
    mpfr_init2(square, 200);
    mpfr_sqr(square, x, round);
    mpfr_exp(square, square, round);
    mpfr_erfc(r, x, round);
    mpfr_mul(r, r, square, round);
    mpfr_clear(square);
    return 0;
}

typedef struct witness {
    truth *reference;
    int (*f)(mpfr_t, const mpfr_t, mpfr_rnd_t);
    float low, high;
} witness;

static double witness_error(const witness *w, truth *reference) {
    double e = 0.0;
    unsigned u;
    for (u = scatteri_bits(w->low); u <= scatteri_bits(w->high); u += 300007u) {
        float x = scatteri_from_bits(u);
        e = larger(e, (double)fabsl(reference(x) / by_mpfr(w->f, x) - 1.0L));
    }
    return e;
}

/* 1e-13: a millionth of the smallest error that is measured with them. */
static void references_against_mpfr(void **state) {
    static const witness witnesses[] = {
        {expl, mpfr_exp, 1.0e-30f, 88.0f},       {logl, mpfr_log, 1.0e-30f, 1.0e30f},
        {erfl, mpfr_erf, 1.0e-30f, 20.0f},       {erfcl, mpfr_erfc, 1.0e-30f, 13.0f},
        {bell_truth, mpfr_bell, 1.0e-9f, 9.0f},  {erfcx_truth, mpfr_erfcx, 1.0e-30f, 1000.0f},
        {asinhl, mpfr_asinh, 1.0e-30f, 1.0e18f}, {sinhl, mpfr_sinh, 1.0e-30f, 88.0f},
        {coshl, mpfr_cosh, 1.0e-30f, 88.0f},     {expm1l, mpfr_expm1, 1.0e-30f, 88.0f},
    };
    size_t i;
    (void)state;
    for (i = 0; i < sizeof witnesses / sizeof witnesses[0]; i++)
        assert_true(witness_error(&witnesses[i], witnesses[i].reference) < 1.0e-13);
    assert_false(witness_error(&witnesses[7], coshl) < 1.0e-13); /* planted: cosh is not sinh */
}
#endif

/* ------------------------------------------------------------------------- >>differences of erf */

/* erf(m + r) - erf(m - r) in long double; very short intervals by the middle value. */
static long double span_truth(long double x, long double y) {
    long double m = 0.5L * (x + y), r = 0.5L * (y - x);
    if (r * (1.0L + fabsl(m)) < 1.0e-6L)
        return 4.0L * r * expl(-m * m) / sqrtl(PI);
    if (x > 0.3L)
        return erfcl(x) - erfcl(y);
    if (y < -0.3L)
        return erfcl(-y) - erfcl(-x);
    return erfl(y) - erfl(x);
}

typedef float difference(float x, float y);

/* Over pairs x <= y: both signs, all lengths from 1e-7 of x on, up to `limit`. */
static double difference_error(difference *f, float limit) {
    uint64_t seed = 7;
    double e = 0.0;
    int i;
    for (i = 0; i < 150000; i++) {
        float x = check_uniform(&seed, -limit, limit) *
                  (i % 3 ? 1.0f : powf(10.0f, check_uniform(&seed, -20, 0)));
        float length = powf(10.0f, check_uniform(&seed, -7.0f, 2.0f)) * (i % 2 ? 1.0f : fabsf(x));
        float y = x + length;
        if (fabsf(y) < limit || i % 4 == 0)
            e = larger(e, relative_error(f(x, y), span_truth(x, y)));
    }
    return e;
}

static float planted_difference(float x, float y) { return scatteri_erf(y) - scatteri_erf(x); }

/* Up to 8.5, where erfc is 3e-33: beyond, the farther end is lost to underflow first. */
static void erf_difference(void **state) {
    (void)state;
    assert_bound("erf_difference", difference_error(scatteri_erf_difference, 8.5f), 5.0e-7);
    assert_false(difference_error(planted_difference, 8.5f) <= 5.0e-7);
    assert_false(difference_error(planted_difference, 1.0f) <= 5.0e-7);
    assert_true(scatteri_erf_difference(-HUGE_VALF, HUGE_VALF) == 2.0f);
    assert_true(scatteri_erf_difference(3.0f, 3.0f) == 0.0f &&
                scatteri_erf_difference(12.0f, 1e30f) == 0.0f);
}

/* The largest absolute error of the fit for inner loops within its clamp. */
static void erf_over_under(void **state) {
    double e = 0.0;
    int i;
    (void)state;
    for (i = -36000; i <= 36000; i++) {
        float x = (float)i * 1.0e-4f;
        float y = scatteri_erf_over(x, x * x) / scatteri_erf_under(x * x);
        e = larger(e, (double)fabsl(y - erfl(x)));
    }
    assert_bound("erf_over/under", e, 6.0e-7);
}

/* ------------------------------------------------------------------------ >>depth of a Gaussian */

typedef float gauss(float a, float c, float h2, float m, float len);

typedef struct segment {
    float a, c, h2, m, len;
} segment;

static segment random_segment(uint64_t *seed) {
    segment s;
    float h = check_uniform(seed, 0.0f, 5.0f);
    s.a = powf(10.0f, check_uniform(seed, -3.0f, 3.0f));
    s.c = powf(10.0f, check_uniform(seed, -3.0f, 3.0f));
    s.h2 = h * h / (s.a * s.a);
    s.m = check_uniform(seed, -6.0f, 6.0f) / s.a;
    s.len = powf(10.0f, check_uniform(seed, -7.0f, 4.0f)) / s.a;
    return s;
}

static long double line_truth(const segment *s) {
    long double a = s->a;
    return s->c * expl(-a * a * s->h2) * sqrtl(PI) / (2.0L * a);
}

static long double gauss_truth(const segment *s) {
    long double a = s->a;
    return line_truth(s) * span_truth(-a * s->m, a * ((long double)s->len - s->m));
}

/* a^2 times the squared distance of the segment from the centre: the exponent there, whose rounding
   is an error that grows with it. */
static double closest(const segment *s) {
    double along = s->m < 0.0f ? -(double)s->m : s->m > s->len ? (double)s->m - s->len : 0.0;
    return (double)s->a * s->a * (s->h2 + along * along);
}

/* Largest error, relative to 1 + the exponent at the point closest to the centre. */
static double gauss_error(gauss *f) {
    uint64_t seed = 3;
    double e = 0.0;
    int i;
    for (i = 0; i < 150000; i++) {
        segment s = random_segment(&seed);
        if (closest(&s) < 70.0)
            e = larger(e, relative_error(f(s.a, s.c, s.h2, s.m, s.len), gauss_truth(&s)) /
                              (1.0 + closest(&s)));
    }
    return e;
}

/* As the formula is printed: cancels in the tails, and 0 times infinity is possible. */
static float planted_gauss(float a, float c, float h2, float m, float len) {
    float s = scatteri_erf(a * (len - m)) + scatteri_erf(a * m);
    return c * scatteri_exp(-a * a * h2) * 0.88622693f / a * s;
}

static void gauss_depth(void **state) {
    (void)state;
    assert_bound("gauss_depth", gauss_error(scatteri_gauss_depth), 5.0e-7);
    assert_false(gauss_error(planted_gauss) <= 5.0e-7);
}

/* Nothing is NaN, and nothing finite becomes infinite, for any mixture of extremes. */
static int is_finite_for_extremes(gauss *f) {
    static const float values[] = {0.0f, 1.0e-30f, 1.0e-15f, 1.0f, 1.0e6f, 1.0e15f, 1.0e18f};
    static const float inverse_widths[] = {1.0e-15f, 1.0e-6f, 1.0f, 1.0e6f, 1.0e15f};
    size_t i, n = sizeof values / sizeof values[0];
    for (i = 0; i < 5 * n * n * n * 2; i++) {
        float a = inverse_widths[i % 5], h2 = values[i / 5 % n], len = values[i / (5 * n) % n];
        float m = values[i / (5 * n * n) % n] * (i >= 5 * n * n * n ? -1.0f : 1.0f);
        float depth = f(a, 1.0f, h2, m, len);
        if (!(depth >= 0.0f && depth <= 1.7724540f / a))
            return 0;
        if (len == 0.0f && depth > 0.0f)
            return 0;
    }
    return 1;
}

/* With factors that overflow although their product does not. */
static float planted_overflow(float a, float c, float h2, float m, float len) {
    return scatteri_gauss_depth(a, c, 0.0f, m, len) * (1.0f / expf(a * a * h2 * h2)) *
           expf(a * a * h2 * (h2 - 1.0f));
}

static void gauss_depth_of_extremes(void **state) {
    (void)state;
    assert_true(is_finite_for_extremes(scatteri_gauss_depth));
    assert_false(is_finite_for_extremes(planted_overflow));
    assert_true(scatteri_gauss_depth(2.0f, 0.0f, 1.0f, 1.0f, 2.0f) == 0.0f);
}

/* ------------------------------------------------------------------------ >>depth of height fog */

typedef float height(float density, float y0, float scale, float y, float dy, float len);

typedef struct climb {
    float y0, scale, y, dy, len;
} climb;

static climb random_climb(uint64_t *seed) {
    climb c;
    c.y0 = check_uniform(seed, -50.0f, 50.0f);
    c.scale = powf(10.0f, check_uniform(seed, 0.5f, 3.0f));
    c.y = check_uniform(seed, -50.0f, 1000.0f);
    c.dy = check_uniform(seed, -1.0f, 1.0f);
    if (check_uniform(seed, 0.0f, 1.0f) < 0.5f)
        c.dy *= powf(10.0f, check_uniform(seed, -30.0f, 0.0f));
    c.len = powf(10.0f, check_uniform(seed, -6.0f, 6.0f));
    return c;
}

static long double climb_truth(const climb *c) {
    long double x = -(long double)c->dy * c->len / c->scale;
    long double start = -((long double)c->y - c->y0) / c->scale;
    return c->len * (x > 1e3L ? expl(start + x - logl(x)) : expl(start) * exprel_truth(x));
}

/* Relative to 1 + the heights in units of the scale, which is what the exponent is made of. */
static double height_error(height *f) {
    uint64_t seed = 11;
    double e = 0.0;
    int i;
    for (i = 0; i < 150000; i++) {
        climb c = random_climb(&seed);
        double far = fabs((double)c.y0) + fabs((double)c.y) + fabs((double)c.dy * c.len);
        float depth = f(1.0f, c.y0, c.scale, c.y, c.dy, c.len);
        float highest = (c.y0 - fminf(c.y, c.y + c.dy * c.len)) / c.scale;
        long double wanted = climb_truth(&c);
        if (highest < 88.0f && highest > -87.0f && wanted < 3.0e38L)
            e = larger(e, relative_error(depth, wanted) / (1.0 + far / c.scale));
    }
    return e;
}

/* From the nearer end, as it is usually printed. */
static float planted_height(float density, float y0, float scale, float y, float dy, float len) {
    float x = -dy * len / scale;
    return density * expf((y0 - y) / scale) * len *
           (fabsf(x) < 1e-6f ? 1.0f : (expf(x) - 1.0f) / x);
}

static void height_depth(void **state) {
    (void)state;
    assert_bound("height_depth", height_error(scatteri_height_depth), 4.0e-7);
    assert_false(height_error(planted_height) <= 4.0e-7);
    assert_true(scatteri_height_depth(1, 0, 10, 1e6f, -1, 1e6f) >
                9.9f); /* starts in 0, ends in 1: no 0 inf */
    assert_true(scatteri_height_depth(1, 0, 10, 0, 0, 0) == 0.0f);
    assert_true(scatteri_height_depth(2, 0, 10, 0, 0, 1e9f) == 2e9f);
    assert_true(fabsf(scatteri_height_depth(2, 0, 10, 0, 1, 1e18f) - 20.0f) < 1e-5f);
}

/* ---------------------------------------------------------------------------- >>phase functions */

/* Integral of p cos^k over the sphere: p is a function of 1 - cos and as narrow as (1 - |g|)^2, so
   1 - cos is delta (e^v - 1) with 64 nodes on each of 8 pieces of v. */
static double moment(scatteri_lobes p, double delta, int k) {
    static scatteri_vec2 nodes[64];
    double sum = 0.0, end = log1p(2.0 / delta);
    int i;
    for (i = 0; i < 64 && nodes[63].y == 0.0f; i++)
        nodes[i] = scatteri_legendre(i, 64);
    for (i = 0; i < 8 * 64; i++) {
        double v = end * ((double)(i / 64) + 0.5 + 0.5 * (double)nodes[i % 64].x) / 8.0;
        float omc = (float)(delta * expm1(v));
        double value = scatteri_phase(p, omc) * delta * exp(v);
        sum += value * pow(1.0 - (double)omc, k) * (double)nodes[i % 64].y * end / 16.0;
    }
    return 2.0 * (double)PI * sum;
}

static double narrowness(float g) { return (1.0 - fabs((double)g)) * (1.0 - fabs((double)g)); }

static const float all_g[] = {-0.9f, -0.5f, 0.0f, 0.1f, 0.8f, 0.9f, 0.99f, 0.999f, 0.9999f};
static const float all_alpha[] = {0.0f, 0.5f, 1.0f, 30.0f, 250.0f};

/* Mean cosine of Draine's function in closed form; g for Henyey-Greenstein. */
static double mean_cosine(double g, double alpha) {
    return g * (1.0 + alpha * (3.0 + 2.0 * g * g) / 5.0) /
           (1.0 + alpha * (1.0 + 2.0 * g * g) / 3.0);
}

/* 2e-6: 512 roundings of the sum and of the function. Below g = -0.9 the backward lobe comes close
   to the spacing of floats near 1 - cos = 2; there the mirror test stands in. */
static int phase_is_normalised(scatteri_lobes p, double delta) {
    return fabs(moment(p, delta, 0) - 1.0) < 2.0e-6;
}

static void phase_functions(void **state) {
    size_t i, j;
    (void)state;
    for (i = 0; i < sizeof all_g / sizeof all_g[0]; i++)
        for (j = 0; j < sizeof all_alpha / sizeof all_alpha[0]; j++) {
            scatteri_lobes p = scatteri_lobe(all_g[i], all_alpha[j]);
            double delta = narrowness(all_g[i]);
            assert_true(phase_is_normalised(p, delta));
            assert_true(fabs(moment(p, delta, 1) - mean_cosine(all_g[i], all_alpha[j])) < 2.0e-6);
            p.weight = 1e-4f; /* planted: one part in ten thousand goes to nowhere */
            p.g2 = 1.0f;
            assert_false(phase_is_normalised(p, delta));
        }
}

typedef float lobe(float g, float alpha, float omc);

static long double draine_truth(long double g, long double alpha, long double omc) {
    long double k = 1.0L - omc, d = (1.0L - g) * (1.0L - g) + 2.0L * g * omc;
    long double norm = 4.0L * PI * (1.0L + alpha * (1.0L + 2.0L * g * g) / 3.0L);
    return (1.0L - g * g) * (1.0L + alpha * k * k) / (norm * d * sqrtl(d));
}

static double lobe_error(lobe *f) {
    uint64_t seed = 13;
    double e = 0.0;
    int i;
    for (i = 0; i < 150000; i++) {
        float g = 1.0f - powf(10.0f, check_uniform(&seed, -4.0f, 0.0f));
        float alpha = check_uniform(&seed, 0.0f, 1.0f) * 250.0f;
        float omc = 2.0f * powf(10.0f, check_uniform(&seed, -12.0f, 0.0f));
        e = larger(e, relative_error(f(g, alpha, omc), draine_truth(g, alpha, omc)));
        e = larger(e, relative_error(f(-g, alpha, omc), draine_truth(-g, alpha, omc)));
    }
    return e;
}

/* By the cosine: no digits of 1 - cos are left in the lobe. */
static float planted_draine(float g, float alpha, float omc) {
    float k = 1.0f - omc, d = 1.0f + g * g - 2.0f * g * k;
    return (1.0f - g * g) * (1.0f + alpha * k * k) /
           (12.566371f * (1.0f + alpha * (1.0f + 2.0f * g * g) / 3.0f) * d * sqrtf(d));
}

static void draine(void **state) {
    scatteri_lobes rayleigh = scatteri_lobe(0.0f, 1.0f), isotropic = scatteri_lobe(0.0f, 0.0f);
    int i;
    (void)state;
    assert_bound("draine", lobe_error(scatteri_draine), 1.0e-6);
    assert_false(lobe_error(planted_draine) <= 1.0e-6);
    for (i = 0; i <= 200; i++) {
        float omc = (float)i * 0.01f, k = 1.0f - omc, back = 2.0f - omc;
        assert_true(fabs((double)scatteri_phase(rayleigh, omc) -
                         3.0 / (16.0 * (double)PI) * (1.0 + k * k)) < 1e-7);
        assert_true(fabs((double)scatteri_phase(isotropic, omc) - 0.25 / (double)PI) < 2e-8);
        assert_true(omc < 1.0f ||
                    scatteri_draine(-0.9999f, 3.0f, omc) == scatteri_draine(0.9999f, 3.0f, back));
    }
}

/* Jendersie and d'Eon 2023, typed a second time, in double. */
static void droplet_truth(double d, double *p) {
    double l = log(d), ll = d > 1.0 ? log(l) : 0.0;
    if (d >= 5.0) {
        p[0] = exp(-0.0990567 / (d - 1.67154)), p[1] = exp(-2.20679 / (d + 3.91029) - 0.428934);
        p[2] = exp(3.62489 - 8.29288 / (d + 5.52825)),
        p[3] = exp(-0.599085 / (d - 0.641583) - 0.665888);
    } else if (d >= 1.5) {
        p[0] = 0.0604931 * ll + 0.940256, p[1] = 0.500411 - 0.081287 / (tan(l) - 2.0 * l + 1.27551);
        p[2] = 7.30354 * l + 6.31675,
        p[3] = 0.376475 + 0.026914 * (l - cos(5.68947 * (ll - 0.0292149)));
    } else if (d > 0.1) {
        double inner = cos((l - 0.238604) * (l + 1.00667) / (0.507522 - 0.15677 * l));
        p[0] = 0.862 - 0.143 * l * l, p[2] = 250.0;
        p[1] = 0.344213 + 0.379685 * cos(1.19692 * inner + 1.37932 * l + 0.0625835);
        p[3] = 0.316072 + 0.0778917 * l + 0.146209 * cos(3.38707 * l + 2.11193);
    } else {
        p[0] = 13.8 * d * d, p[1] = 1.1456 * d * sin(9.29044 * d);
        p[2] = 250.0, p[3] = 0.252977 - 312.983 * pow(d, 4.3);
    }
}

static int is_near(float value, double truth_value) {
    return fabs((double)value - truth_value) <= 2e-6 * (0.1 + fabs(truth_value));
}

static int droplets_agree(float tested, float wanted) {
    scatteri_lobes p = scatteri_droplets(tested);
    double q[4];
    droplet_truth(wanted, q);
    return is_near(p.g1, q[0]) && is_near(p.g2, q[1]) && is_near(p.alpha2, q[2]) &&
           is_near(p.weight, q[3]) && p.alpha1 == 0.0f;
}

static void droplets(void **state) {
    float d;
    (void)state;
    for (d = 0.01f; d <= 50.0f; d *= 1.01f) {
        scatteri_lobes p = scatteri_droplets(d);
        assert_true(droplets_agree(d, d));
        assert_true(p.g1 >= 0.0f && p.g1 < 1.0f && p.g2 > -1.0f && p.g2 < 1.0f);
        assert_true(p.weight >= 0.0f && p.weight <= 1.0f && p.alpha2 >= 0.0f);
        assert_true(phase_is_normalised(p, narrowness(p.g1)));
    }
    assert_true(droplets_agree(50.0f, 50.0f) && droplets_agree(5.0f, 5.0f) &&
                droplets_agree(1.5f, 1.5f));
    assert_false(droplets_agree(5.0f, 4.99f)); /* planted: the wrong range */
}

/* What is known from elsewhere: tiny droplets scatter as Rayleigh (2 %: the fit itself), and cloud
   droplets of 10 um have the mean cosine 0.85..0.87 of Mie theory. */
static void droplets_and_physics(void **state) {
    scatteri_lobes tiny = scatteri_droplets(0.01f), cloud = scatteri_droplets(10.0f);
    int i;
    (void)state;
    for (i = 0; i <= 20; i++) {
        double k = 1.0 - 0.1 * i;
        assert_true(fabs((double)scatteri_phase(tiny, 0.1f * (float)i) /
                             (3.0 / (16.0 * (double)PI) * (1.0 + k * k)) -
                         1.0) < 0.02);
    }
    assert_true(moment(cloud, narrowness(cloud.g1), 1) > 0.85 &&
                moment(cloud, narrowness(cloud.g1), 1) < 0.87);
}

/* ----------------------------------------------------------------------- >>Gauss-Legendre nodes */

typedef scatteri_vec2 rule(int i, int n);

/* Error for Chebyshev's polynomial of degree k, whose integral is 2/(1 - k^2), or 0 for odd k. */
static double degree_error(const scatteri_vec2 *nodes, int n, int k) {
    double sum = 0.0;
    int i;
    for (i = 0; i < n; i++)
        sum += (double)nodes[i].y * cos(k * acos((double)nodes[i].x));
    return fabs(sum - (k % 2 ? 0.0 : 2.0 / (1.0 - (double)k * k)));
}

/* Exact up to degree `top`; 1e-7 (k + 2): k times the rounding of the nodes, and the weights'. */
static int is_exact(rule *r, int n, int top) {
    scatteri_vec2 nodes[256];
    int i, k;
    for (i = 0; i < n; i++)
        nodes[i] = r(i, n);
    for (k = 0; k <= top; k++)
        if (!(degree_error(nodes, n, k) <= 1.0e-7 * (k + 2)))
            return 0;
    return 1;
}

static scatteri_vec2 planted_rule(int i, int n) {
    return scatteri_v2(((float)i + 0.5f) * 2.0f / (float)n - 1.0f, 2.0f / (float)n);
}

static void legendre(void **state) {
    static const int counts[] = {1, 2, 3, 4, 5, 8, 15, 16, 17, 32, 64, 100, 128, 255, 256};
    size_t j;
    int i;
    (void)state;
    for (j = 0; j < sizeof counts / sizeof counts[0]; j++) {
        int n = counts[j];
        assert_true(is_exact(scatteri_legendre, n, 2 * n - 1));
        assert_false(is_exact(scatteri_legendre, n, 2 * n)); /* planted: one degree too many */
        for (i = 0; i < n; i++) {
            scatteri_vec2 node = scatteri_legendre(i, n),
                          mirrored = scatteri_legendre(n - 1 - i, n);
            assert_true(node.x > (i ? scatteri_legendre(i - 1, n).x : -1.0f) && node.x < 1.0f &&
                        node.y > 0.0f);
            assert_true(fabsf(node.x + mirrored.x) < 1e-7f &&
                        fabsf(node.y - mirrored.y) < 1e-6f * node.y);
        }
    }
    assert_false(is_exact(planted_rule, 16, 31));
}

/* --------------------------------------------------------------------------------------- >>maps */

typedef scatteri_vec2 encode(scatter_vec3 d);

/* Largest distance between unit vectors and what comes back through the square. */
static double round_trip_error(encode *f) {
    uint64_t seed = 17;
    double e = 0.0;
    int i;
    for (i = 0; i < 100000; i++) {
        scatter_vec3 d = check_direction(&seed), back;
        scatteri_vec2 uv;
        if (i < 27)
            d = scatteri_normalize(scatteri_v3((float)(i % 3) - 1.0f, (float)(i / 3 % 3) - 1.0f,
                                               (float)(i / 9) - 1.0f));
        if (i == 13)
            continue; /* the zero vector */
        uv = f(scatteri_scale(d, powf(10.0f, check_uniform(&seed, -6.0f, 6.0f))));
        back = scatteri_oct_decode(uv);
        e = larger(e, check_distance(d, back));
        if (!(fabsf(uv.x) <= 1.0f && fabsf(uv.y) <= 1.0f))
            return HUGE_VAL;
    }
    return e;
}

static scatteri_vec2 planted_encode(scatter_vec3 d) {
    scatteri_vec2 uv = scatteri_oct_encode(d);
    return d.z < 0.0f ? scatteri_v2(uv.y, uv.x) : uv;
}

/* The other way round, and the length of the result. */
static void octahedron(void **state) {
    uint64_t seed = 19;
    double e = 0.0, stretch = 0.0;
    int i;
    (void)state;
    for (i = 0; i < 100000; i++) {
        scatteri_vec2 uv = scatteri_v2(check_uniform(&seed, -1, 1), check_uniform(&seed, -1, 1)),
                      back;
        scatter_vec3 d = scatteri_oct_decode(uv);
        back = scatteri_oct_encode(d);
        stretch = larger(stretch, fabs(sqrt(check_dot(d, d)) - 1.0));
        e = larger(e, fabs((double)uv.x - back.x) + fabs((double)uv.y - back.y));
    }
    assert_bound("oct, square", e, 4.0e-7);
    assert_bound("oct, direction", round_trip_error(scatteri_oct_encode), 4.0e-7);
    assert_bound("oct, length", stretch, 3.0e-7);
    assert_false(round_trip_error(planted_encode) <= 4.0e-7);
}

static float corner(int i) {
    return 1.0f + 2.0f * (float)(i & 1) + 4.0f * (float)(i >> 1 & 1) + 8.0f * (float)(i >> 2);
}

typedef float mix(float v000, float v100, float v010, float v110, float v001, float v101,
                  float v011, float v111, float fx, float fy, float fz);

/* Corners of 1 + 2x + 4y + 8z give that function back. */
static int mixes_linearly(mix *f) {
    uint64_t seed = 23;
    int i;
    for (i = 0; i < 1000; i++) {
        float x = check_uniform(&seed, 0, 1), y = check_uniform(&seed, 0, 1),
              z = check_uniform(&seed, 0, 1);
        float v = f(corner(0), corner(1), corner(2), corner(3), corner(4), corner(5), corner(6),
                    corner(7), x, y, z);
        if (!(fabs((double)v - (1.0 + 2.0 * x + 4.0 * y + 8.0 * z)) <=
              4e-6)) /* 4 roundings of 15 */
            return 0;
    }
    return 1;
}

static float planted_mix(float v000, float v100, float v010, float v110, float v001, float v101,
                         float v011, float v111, float fx, float fy, float fz) {
    return scatteri_trilinear(v000, v010, v100, v110, v001, v011, v101, v111, fx, fy, fz);
}

static void trilinear(void **state) {
    (void)state;
    assert_true(mixes_linearly(scatteri_trilinear));
    assert_false(mixes_linearly(planted_mix));
    assert_true(scatteri_trilinear(3, 3, 3, 3, 3, 3, 3, 3, 0.3f, 0.7f, 0.1f) == 3.0f);
}

/* Angles pi and 0, equal cosines, the middle, and both sides. */
static void smoothstep_and_spot(void **state) {
    (void)state;
    assert_true(scatteri_smoothstep(1, 3, 0) == 0.0f && scatteri_smoothstep(1, 3, 4) == 1.0f);
    assert_true(scatteri_smoothstep(1, 3, 2) == 0.5f &&
                fabsf(scatteri_smoothstep(0, 1, 0.25f) - 0.15625f) < 1e-7f);
    assert_true(scatteri_spot(0.5f, 0.5f, 0.5f) == 1.0f &&
                scatteri_spot(0.5f, 0.5f, 0.49f) == 0.0f);
    assert_true(scatteri_spot(-1, -1, -1) == 1.0f && scatteri_spot(1, 1, 1) == 1.0f);
    assert_true(scatteri_spot(0.9f, 0.8f, 0.95f) == 1.0f &&
                scatteri_spot(0.9f, 0.8f, 0.7f) == 0.0f);
}

static void tone(void **state) {
    float l;
    (void)state;
    assert_true(fabsf(scatteri_luminance(scatteri_v3(1, 1, 1)) - 1.0f) < 1e-7f);
    assert_true(scatteri_reinhard(0, 2) == 0.0f && fabsf(scatteri_reinhard(2, 2) - 1.0f) < 1e-7f);
    assert_true(scatteri_reinhard(1, 0) == 0.5f && scatteri_reinhard(3, -1) == 0.75f);
    for (l = 1e-6f; l < 1e6f; l *= 1.1f)
        assert_true(scatteri_reinhard(l * 1.1f, 3) > scatteri_reinhard(l, 3) &&
                    scatteri_reinhard(l, 0) <= 1.0f);
}

static void vectors(void **state) {
    uint64_t seed = 29;
    double length = 0.0, angle = 0.0, cross = 0.0;
    int i;
    (void)state;
    for (i = 0; i < 100000; i++) {
        scatter_vec3 a = check_direction(&seed), b = check_direction(&seed),
                     c = scatteri_cross(a, b);
        float size = powf(10.0f, check_uniform(&seed, -15.0f, 15.0f));
        scatter_vec3 n = scatteri_normalize(scatteri_scale(a, size));
        length = larger(length, fabs(sqrt(check_dot(n, n)) - 1.0));
        length = larger(length, fabs((double)(scatteri_length(scatteri_scale(a, size)) / size) -
                                     sqrt(check_dot(a, a))));
        angle = larger(angle, fabs((double)scatteri_omc(a, b) - (1.0 - check_dot(a, b))));
        cross = larger(cross, fabs(check_dot(c, a)) + fabs(check_dot(c, b)));
        cross = larger(cross, fabs(check_dot(c, c) + check_dot(a, b) * check_dot(a, b) - 1.0));
    }
    assert_bound("normalize, length", length, 4.0e-7);
    assert_bound("omc, absolute", angle, 1.0e-6);
    assert_bound("cross, absolute", cross, 1.0e-6);
    assert_true(scatteri_dot(scatteri_mul(scatteri_v3(1, 2, 3), scatteri_v3(4, 5, 6)),
                             scatteri_v3(1, 1, 1)) == 32.0f);
    assert_true(
        scatteri_add(scatteri_v3(1, 2, 3), scatteri_sub(scatteri_v3(1, 1, 1), scatteri_v3(0, 1, 0)))
            .y == 2.0f);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(functions_of_one_float),
        cmocka_unit_test(functions_of_one_float_planted),
        cmocka_unit_test(ends_of_the_range),
        cmocka_unit_test(selections),
#ifdef TEST_MPFR
        cmocka_unit_test(references_against_mpfr),
#endif
        cmocka_unit_test(erf_difference),
        cmocka_unit_test(erf_over_under),
        cmocka_unit_test(gauss_depth),
        cmocka_unit_test(gauss_depth_of_extremes),
        cmocka_unit_test(height_depth),
        cmocka_unit_test(phase_functions),
        cmocka_unit_test(draine),
        cmocka_unit_test(droplets),
        cmocka_unit_test(droplets_and_physics),
        cmocka_unit_test(legendre),
        cmocka_unit_test(octahedron),
        cmocka_unit_test(trilinear),
        cmocka_unit_test(smoothstep_and_spot),
        cmocka_unit_test(tone),
        cmocka_unit_test(vectors),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
