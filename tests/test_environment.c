/* test_environment.c - constellations of environment maps: energy, directions, suns, symmetries,
   awkward maps; the lights turned; radiance of a map. References are integrals in double over every
   texel, written independently of the header. Names with "planted" put a fault in and must see it. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#define SCATTER_IMPLEMENTATION
#include "../scatter.h"
#include "check.h"

#define MOST 256

static const scatter_constellation_method methods[2] = {SCATTER_CONSTELLATION_MEDIAN_CUT,
                                                        SCATTER_CONSTELLATION_KMEANS};

/* ---------------------------------------------------------- >>maps */

static scatter_environment open_map(int width, int height) {
    scatter_environment map = {NULL, 0, 0, 0};
    map.width = width;
    map.height = height;
    map.rgb = (const float *)calloc((size_t)width * (size_t)height * 3, sizeof(float));
    assert_true(map.rgb != NULL);
    return map;
}

static void close_map(scatter_environment *map) {
    free((void *)(uintptr_t)map->rgb);
    map->rgb = NULL;
}

static float *texel(const scatter_environment *map, int x, int y) {
    return (float *)(uintptr_t)map->rgb + 3 * ((size_t)y * (size_t)map->width + (size_t)x);
}

static void set_texel(const scatter_environment *map, int x, int y, float r, float g, float b) {
    float *t = texel(map, x, y);
    t[0] = r, t[1] = g, t[2] = b;
}

/* Texels within a factor of 10 of each other, a quarter of them black. */
static scatter_environment random_map(int width, int height, uint64_t seed) {
    scatter_environment map = open_map(width, height);
    int x, y;
    for (y = 0; y < height; y++)
        for (x = 0; x < width; x++) {
            float black = check_uniform(&seed, 0, 1) < 0.25f ? 0.0f : 1.0f;
            scatter_vec3 c = check_point(&seed, 0.1f, 1.0f);
            set_texel(&map, x, y, black * c.x, black * c.y, black * c.z);
        }
    return map;
}

/* ----------------------------------------------------- >>reference */

typedef struct integral {
    double rgb[3], energy, moment[3]; /* of radiance; of luminance times 1 and direction */
} integral;

/* Of one texel, by Gauss's rule of three nodes in height and azimuth: steps of up to 0.17 rad
   are integrated to 1e-12. */
static void add_texel(integral *sum, const scatter_environment *map, int x, int y) {
    static const double node[3] = {-0.7745966692414834, 0, 0.7745966692414834};
    static const double weight[3] = {5.0 / 18, 8.0 / 18, 5.0 / 18};
    double tall = CHECK_PI / map->height, wide = 2 * CHECK_PI / map->width;
    const float *c = texel(map, x, y);
    double luminance = 0.2126 * c[0] + 0.7152 * c[1] + 0.0722 * c[2];
    int i, j, k;
    for (i = 0; i < 3; i++)
        for (j = 0; j < 3; j++) {
            double theta = tall * (y + 0.5 + 0.5 * node[i]);
            double phi = wide * (x + 0.5 + 0.5 * node[j]) - CHECK_PI;
            double area = weight[i] * weight[j] * tall * wide * sin(theta);
            double d[3];
            d[0] = sin(theta) * sin(phi), d[1] = cos(theta), d[2] = -sin(theta) * cos(phi);
            sum->energy += area * luminance;
            for (k = 0; k < 3; k++) {
                sum->rgb[k] += area * c[k];
                sum->moment[k] += area * luminance * d[k];
            }
        }
}

static integral integrate(const scatter_environment *map) {
    integral sum = {{0, 0, 0}, 0, {0, 0, 0}};
    int x, y;
    for (y = 0; y < map->height; y++)
        for (x = 0; x < map->width; x++)
            add_texel(&sum, map, x, y);
    return sum;
}

/* -------------------------------------------------------- >>energy */

/* Largest relative difference of the sum of the intensities, times `factor`, from the integral. */
static double energy_error(const integral *all, const scatter_light *lights, int count,
                           double factor) {
    double sum[3] = {0, 0, 0}, worst = 0;
    int i;
    for (i = 0; i < count; i++) {
        sum[0] += lights[i].intensity.x;
        sum[1] += lights[i].intensity.y;
        sum[2] += lights[i].intensity.z;
    }
    for (i = 0; i < 3; i++)
        worst = fmax(worst, fabs(factor * sum[i] - all->rgb[i]) / all->rgb[i]);
    return worst;
}

/* Every light is rounded once to a float, and for k-means each cell: 6e-8 each; and no light is
   NaN, negative, of another kind or without direction. */
static void assert_energy(const scatter_environment *map, scatter_constellation_method method,
                          int count, const integral *all) {
    scatter_light lights[MOST];
    int i;
    assert_int_equal(scatter_constellation(NULL, map, method, count, lights), SCATTER_OK);
    assert_at_most(energy_error(all, lights, count, 1), 1.2e-7);
    for (i = 0; i < count; i++) {
        scatter_light l = lights[i];
        assert_int_equal(l.kind, SCATTER_LIGHT_DIRECTIONAL);
        assert_at_most(fabs(check_dot(l.direction, l.direction) - 1), 1e-6);
        assert_true(l.intensity.x >= 0 && l.intensity.y >= 0 && l.intensity.z >= 0);
    }
}

static void test_energy_of_every_count(void **state) {
    static const int sizes[][3] = {{37, 19, 1}, {64, 32, 51}, {300, 151, 85}};
    size_t s;
    int m, count;
    (void)state;
    for (s = 0; s < CHECK_COUNT(sizes); s++) {
        scatter_environment map = random_map(sizes[s][0], sizes[s][1], s);
        integral all = integrate(&map);
        for (m = 0; m < 2; m++)
            for (count = 1; count <= MOST; count += sizes[s][2])
                assert_energy(&map, methods[m], count, &all);
        close_map(&map);
    }
}

/* Planted: solid angles without the sine, and a map whose last row is forgotten. */
static void test_energy_planted(void **state) {
    scatter_environment map = random_map(64, 32, 1), less;
    integral all = integrate(&map), other;
    scatter_light lights[20];
    (void)state;
    assert_int_equal(scatter_constellation(NULL, &map, methods[0], 20, lights), SCATTER_OK);
    assert_at_least(energy_error(&all, lights, 20, CHECK_PI / 2), 0.1);
    less = map;
    less.height--;
    other = integrate(&less);
    assert_at_least(energy_error(&other, lights, 20, 1), 1e-3);
    close_map(&map);
}

/* ------------------------------------------------------ >>refusals */

static int refuses(const scatter_environment *map, int method, int count, scatter_light *lights,
                   scatter_result result, const char *field) {
    check_host books;
    scatter_host host = check_host_open(&books, 0);
    scatter_result got =
        scatter_constellation(&host, map, (scatter_constellation_method)method, count, lights);
    if (got == result && books.sentences == 1 && strstr(books.sentence, field) && !books.live)
        return 1;
    fprintf(stderr, "result %d, \"%s\" instead of %d, %s\n", got, books.sentence, result, field);
    return 0;
}

static void test_refusals(void **state) {
    scatter_environment map = random_map(100, 50, 1), bad = map;
    scatter_light lights[MOST];
    float spoilt[3] = {NAN, -1e-30f, INFINITY};
    int i;
    (void)state;
    assert_true(refuses(NULL, 0, 20, lights, SCATTER_BAD_ARGUMENT, "map.rgb"));
    assert_true(refuses(&map, 0, 20, NULL, SCATTER_BAD_ARGUMENT, "lights"));
    assert_true(refuses(&map, 0, 0, lights, SCATTER_BAD_ARGUMENT, "count"));
    assert_true(refuses(&map, 0, 257, lights, SCATTER_BAD_ARGUMENT, "count"));
    assert_true(refuses(&map, 2, 20, lights, SCATTER_BAD_ARGUMENT, "method"));
    bad.rgb = NULL;
    assert_true(refuses(&bad, 0, 20, lights, SCATTER_BAD_ARGUMENT, "map.rgb"));
    bad = map;
    bad.width = 0;
    assert_true(refuses(&bad, 0, 20, lights, SCATTER_BAD_ARGUMENT, "map.width"));
    bad.width = 46341;
    bad.height = 46341;
    assert_true(refuses(&bad, 0, 20, lights, SCATTER_TOO_LARGE, "width * height"));
    bad.width = INT_MAX;
    assert_true(refuses(&bad, 0, 20, lights, SCATTER_TOO_LARGE, "map.width"));
    bad = map;
    bad.scale = NAN;
    assert_true(refuses(&bad, 0, 20, lights, SCATTER_BAD_ARGUMENT, "map.scale"));
    for (i = 0; i < 3; i++) {
        texel(&map, 70, 30)[1] = spoilt[i];
        assert_true(refuses(&map, i & 1, 20, lights, SCATTER_BAD_ARGUMENT, "column 70 of row 30"));
    }
    fprintf(stderr, "the next line is the check at work on a planted fault:\n");
    assert_false(refuses(&map, 0, 20, lights, SCATTER_BAD_ARGUMENT, "column 30 of row 70"));
    close_map(&map);
}

/* The n-th allocation fails: that is told, nothing is lost, the lights stay. */
static void test_allocations(void **state) {
    scatter_environment map = random_map(100, 50, 1);
    scatter_light lights[20], before[20];
    check_host books;
    int m, tries;
    (void)state;
    memset(before, 0x5a, sizeof before);
    for (m = 0; m < 2; m++) {
        scatter_host host = check_host_open(&books, 0);
        memcpy(lights, before, sizeof lights);
        for (tries = 1; tries < 20; tries++) {
            books.calls = 0;
            books.fail_at = (size_t)tries;
            if (scatter_constellation(&host, &map, methods[m], 20, lights) == SCATTER_OK)
                break;
            assert_int_equal(books.logged, SCATTER_OUT_OF_MEMORY);
            assert_true(memcmp(lights, before, sizeof lights) == 0);
            assert_int_equal(books.live, 0);
        }
        assert_int_equal(books.live, 0);
        assert_int_equal(tries, 4 + m); /* refined map, tables, luminance, cells: each failed once */
    }
    close_map(&map);
}

/* ------------------------------------------------ >>looking, turning */

/* What a map of random texels says in the directions of its texels' centres is the texel. */
static void test_radiance_at_centres(void **state) {
    scatter_environment map = random_map(37, 19, 3);
    int x, y, k;
    (void)state;
    map.scale = 3;
    for (y = 0; y < map.height; y++)
        for (x = 0; x < map.width; x++) {
            double theta = CHECK_PI * (y + 0.5) / map.height;
            double phi = 2 * CHECK_PI * (x + 0.5) / map.width - CHECK_PI;
            scatter_vec3 d = check_v3((float)(7 * sin(theta) * sin(phi)), (float)(7 * cos(theta)),
                                      (float)(-7 * sin(theta) * cos(phi)));
            scatter_vec3 c = scatter_environment_radiance(&map, d);
            float got[3];
            got[0] = c.x, got[1] = c.y, got[2] = c.z;
            for (k = 0; k < 3; k++) /* the direction's rounding moves it by 1e-6 of a texel */
                assert_at_most(fabs(got[k] - 3.0 * texel(&map, x, y)[k]), 1e-5);
        }
    close_map(&map);
}

static void assert_direction(scatter_vec3 d, float x, float y, float z) {
    assert_at_most(check_distance(d, check_v3(x, y, z)), 1e-6);
}

/* About +y by a right angle: +z goes to +x; a point light moves, a spot moves and turns. */
static void test_turn_by_a_right_angle(void **state) {
    scatter_light lights[3];
    (void)state;
    memset(lights, 0, sizeof lights);
    lights[0].kind = SCATTER_LIGHT_DIRECTIONAL;
    lights[1].kind = SCATTER_LIGHT_SPOT;
    lights[0].direction = lights[1].direction = lights[2].direction = check_v3(0, 1, 2);
    lights[0].position = lights[1].position = lights[2].position = check_v3(3, 0, 4);
    scatter_turn_lights(lights, 3, check_v3(0, 5, 0), 1.57079633f, lights);
    assert_direction(lights[0].direction, 2, 1, 0);
    assert_direction(lights[0].position, 3, 0, 4);
    assert_direction(lights[1].direction, 2, 1, 0);
    assert_direction(lights[1].position, 4, 0, -3);
    assert_direction(lights[2].direction, 0, 1, 2);
    assert_direction(lights[2].position, 4, 0, -3);
    scatter_turn_lights(lights, 3, check_v3(0, 0, 0), 1.57079633f, lights);
    assert_direction(lights[0].direction, 2, 1, 0);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_energy_of_every_count),
        cmocka_unit_test(test_energy_planted),
        cmocka_unit_test(test_refusals),
        cmocka_unit_test(test_allocations),
        cmocka_unit_test(test_radiance_at_centres),
        cmocka_unit_test(test_turn_by_a_right_angle),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
