/* test_environment.c - constellations of environment maps: energy, directions, suns, symmetries,
   awkward maps; the lights turned; radiance of a map. References are integrals in double over every
   texel, written independently of the header. Names with "planted" put a fault in and must see it.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#define SCATTER_IMPLEMENTATION
#include "../scatter.h"
#include "check.h"
#include "hdr.h"

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

/* ------------------------------------------------------ >>median cut */

/* Largest over smallest luminance of the lights. */
static double spread(const scatter_light *lights, int count) {
    double least = HUGE_VAL, most = 0;
    int i;
    for (i = 0; i < count; i++) {
        scatter_vec3 c = lights[i].intensity;
        double y = 0.2126 * c.x + 0.7152 * c.y + 0.0722 * c.z;
        least = fmin(least, y);
        most = fmax(most, y);
    }
    return most / least;
}

/* A map without black texels, so that a cut misses the half by no more than the energy of one row
   or column. Those of a part of n by n texels hold at most 10 pi/2 times 1/n of it (10: the range
   of the texels, pi/2: of the sine over a row); 16 parts of 512 by 256 texels come from cuts of
   512, 256, 256 and 128. Averages over a row of texels make that much less: 1.04 is asserted,
   below 1.3. The parts of k-means are no such parts, which is the planted fault. */
static void test_equal_energies(void **state) {
    scatter_environment map = open_map(512, 256);
    scatter_light lights[16];
    uint64_t seed = 5;
    int i;
    (void)state;
    for (i = 0; i < 512 * 256; i++) {
        float grey = check_uniform(&seed, 0.1f, 1.0f);
        set_texel(&map, i % 512, i / 512, grey, grey, grey);
    }
    assert_int_equal(scatter_constellation(NULL, &map, methods[0], 16, lights), SCATTER_OK);
    assert_at_most(spread(lights, 16), 1.04);
    assert_int_equal(scatter_constellation(NULL, &map, methods[1], 16, lights), SCATTER_OK);
    assert_at_least(spread(lights, 16), 1.1);
    close_map(&map);
}

/* Azimuth between the first two lights. */
static double azimuth_between(const scatter_light *lights) {
    scatter_vec3 a = lights[0].direction, b = lights[1].direction;
    return fabs(
        atan2((double)a.x * b.z - (double)a.z * b.x, (double)a.x * b.x + (double)a.z * b.z));
}

/* 60 degrees of azimuth by 14 degrees: near the pole that is higher than wide and the cut is
   horizontal, half way down (planted) it is vertical and the halves lie 30 degrees apart. */
static void test_longer_side(void **state) {
    static const int top[] = {0, 32};
    double turn[2];
    int i, x, y;
    (void)state;
    for (i = 0; i < 2; i++) {
        scatter_environment map = open_map(256, 128);
        scatter_light lights[2];
        for (y = top[i]; y < top[i] + 10; y++)
            for (x = 100; x < 143; x++)
                set_texel(&map, x, y, 1, 1, 1);
        assert_int_equal(scatter_constellation(NULL, &map, methods[0], 2, lights), SCATTER_OK);
        turn[i] = azimuth_between(lights);
        close_map(&map);
    }
    assert_at_most(turn[0], 0.01);
    assert_at_least(turn[1], 0.5);
}

/* --------------------------------------------------- >>directions */

/* Distance of a light's direction from that of a moment: where its light comes from. */
static double direction_error(const scatter_light *light, const double m[3]) {
    double length = sqrt(m[0] * m[0] + m[1] * m[1] + m[2] * m[2]);
    double x = light->direction.x + m[0] / length, y = light->direction.y + m[1] / length,
           z = light->direction.z + m[2] / length;
    return sqrt(x * x + y * y + z * z);
}

/* One light stands for all: its direction is the centroid's. Floats of the columns' sines and of
   the luminance: 1e-6 where the centroid is not near 0. Planted: the centroid without the sine. */
static void test_centroid(void **state) {
    uint64_t seed;
    int m;
    (void)state;
    for (seed = 1; seed <= 8; seed++) {
        scatter_environment map = random_map(60, 31, seed);
        scatter_light light;
        integral all;
        double flat[3];
        int x, y;
        for (y = 0; y < 31; y++)
            for (x = 0; x < 60; x++)
                if (x > 40 || y > 17)
                    set_texel(&map, x, y, 0.02f, 0.02f, 0.02f);
        all = integrate(&map);
        memcpy(flat, all.moment, sizeof flat);
        flat[1] *= CHECK_PI / 2;
        for (m = 0; m < 2; m++) {
            assert_int_equal(scatter_constellation(NULL, &map, methods[m], 1, &light), SCATTER_OK);
            assert_at_most(direction_error(&light, all.moment), 1e-6);
            assert_at_least(direction_error(&light, flat), 1e-2);
        }
        close_map(&map);
    }
}

/* A sky over black ground, the same in all azimuths: the light shines straight down with 2 pi L. */
static void test_hemisphere(void **state) {
    scatter_environment map = open_map(200, 100);
    scatter_light light;
    int x, y, m;
    (void)state;
    for (y = 0; y < 50; y++)
        for (x = 0; x < 200; x++)
            set_texel(&map, x, y, 2, 3, 4);
    map.scale = 0.5f;
    for (m = 0; m < 2; m++) {
        assert_int_equal(scatter_constellation(NULL, &map, methods[m], 1, &light), SCATTER_OK);
        assert_at_most(check_distance(light.direction, check_v3(0, -1, 0)), 1e-6);
        assert_at_most(fabs(light.intensity.y / (3 * CHECK_PI) - 1), 1e-6);
    }
    close_map(&map);
}

/* ----------------------------------------------------- >>symmetry */

/* The map whose columns are moved to the left: the sky turned about +y. */
static scatter_environment moved(const scatter_environment *map, int columns) {
    scatter_environment turned = open_map(map->width, map->height);
    int x, y;
    for (y = 0; y < map->height; y++)
        for (x = 0; x < map->width; x++)
            memcpy(texel(&turned, x, y), texel(map, (x + columns) % map->width, y),
                   3 * sizeof(float));
    return turned;
}

/* Largest difference of lights in direction, and relative in intensity. */
static double difference(const scatter_light *a, const scatter_light *b, int count) {
    double worst = 0;
    int i;
    for (i = 0; i < count; i++) {
        worst = fmax(worst, check_distance(a[i].direction, b[i].direction));
        worst = fmax(worst, fabs(a[i].intensity.y / (double)b[i].intensity.y - 1));
    }
    return worst;
}

/* A map moved by whole columns (k-means: cells, here of 2 columns) gives the lights turned, in the
   same order, to the rounding of the lights and the columns' sines. Planted: turned the other way.
 */
static void test_turned_map(void **state) {
    static const int steps[] = {2, 90, 128, 254};
    scatter_environment map = random_map(256, 128, 9);
    scatter_light lights[40], expected[40];
    size_t s;
    int m;
    (void)state;
    for (m = 0; m < 2; m++)
        for (s = 0; s < CHECK_COUNT(steps); s++) {
            scatter_environment turned = moved(&map, steps[s]);
            float angle = (float)(2 * CHECK_PI * steps[s] / map.width);
            assert_int_equal(scatter_constellation(NULL, &map, methods[m], 40, expected), 0);
            assert_int_equal(scatter_constellation(NULL, &turned, methods[m], 40, lights), 0);
            scatter_turn_lights(expected, 40, check_v3(0, 1, 0), angle, expected);
            assert_at_most(difference(lights, expected, 40), 2e-6);
            if (steps[s] != 128) {
                scatter_turn_lights(expected, 40, check_v3(0, 1, 0), -2 * angle, expected);
                assert_at_least(difference(lights, expected, 40), 1e-2);
            }
            close_map(&turned);
        }
    close_map(&map);
}

/* Turned about any axis there and back; about the axis itself nothing moves. */
static void test_turns(void **state) {
    uint64_t seed = 3;
    int i;
    (void)state;
    for (i = 0; i < 100; i++) {
        scatter_light light, turned;
        scatter_vec3 axis = check_direction(&seed);
        float angle = check_uniform(&seed, -7, 7);
        memset(&light, 0, sizeof light);
        light.kind = SCATTER_LIGHT_SPOT;
        light.direction = check_direction(&seed);
        light.position = axis;
        scatter_turn_lights(&light, 1, axis, angle, &turned);
        assert_at_most(check_distance(turned.position, axis), 1e-6);
        assert_at_most(fabs(check_dot(turned.direction, axis) - check_dot(light.direction, axis)),
                       1e-6);
        scatter_turn_lights(&turned, 1, axis, -angle, &turned);
        assert_at_most(check_distance(turned.direction, light.direction), 1e-6);
    }
}

/* ---------------------------------------------------------- >>suns */

static scatter_vec3 texel_direction(const scatter_environment *map, int x, int y) {
    double theta = CHECK_PI * (y + 0.5) / map->height;
    double phi = 2 * CHECK_PI * (x + 0.5) / map->width - CHECK_PI;
    return check_v3((float)(sin(theta) * sin(phi)), (float)cos(theta),
                    (float)(-sin(theta) * cos(phi)));
}

/* Texels within 0.8 of a row's height around a direction get a radiance; returns what they send. */
static integral add_sun(const scatter_environment *map, scatter_vec3 d, float radiance) {
    integral sun = {{0, 0, 0}, 0, {0, 0, 0}};
    double reach = 2 * sin(0.4 * CHECK_PI / map->height);
    int x, y;
    for (y = 0; y < map->height; y++)
        for (x = 0; x < map->width; x++)
            if (check_distance(texel_direction(map, x, y), d) <= reach) {
                set_texel(map, x, y, radiance, 0.9f * radiance, 0.8f * radiance);
                add_texel(&sun, map, x, y);
            }
    return sun;
}

static double sun_energy_error(const scatter_light *light, const integral *sun) {
    return fmax(fabs(light->intensity.x / sun->rgb[0] - 1),
                fabs(light->intensity.z / sun->rgb[2] - 1));
}

static const scatter_vec3 sun_places[] = {
    {0, 0, 1},  {0.02f, 0.3f, 1}, {-0.02f, -0.5f, 1},     {0, 1, 0},
    {0, -1, 0}, {0.01f, 1, 0},    {-0.013f, -1, -0.004f}, {0.015f, 1, -0.015f},
    {0, 0, -1}, {1, 1, 1},        {1, 0.05f, 0},          {-1, -2, 0.5f}};

static scatter_vec3 unit(scatter_vec3 v) {
    return check_along(check_v3(0, 0, 0), (float)(1 / sqrt(check_dot(v, v))), v);
}

/* 84,000 times the mean of the rest, at the seam, at the poles and elsewhere: the first light is
   the sun, all of it and nothing else, with the direction of its texels' centroid. Planted: the sun
   without its texels on the other side of the seam. */
static void test_sun(void **state) {
    static const int counts[] = {8, 20, 256};
    scatter_light lights[MOST];
    size_t p, c;
    int m;
    (void)state;
    for (p = 0; p < CHECK_COUNT(sun_places); p++) {
        scatter_environment map = random_map(256, 128, p);
        integral rest = integrate(&map), sun;
        float mean = (float)(rest.energy / (4 * CHECK_PI));
        sun = add_sun(&map, unit(sun_places[p]), 84000 * mean);
        for (m = 0; m < 2; m++)
            for (c = 0; c < CHECK_COUNT(counts); c++) {
                assert_int_equal(scatter_constellation(NULL, &map, methods[m], counts[c], lights),
                                 SCATTER_OK);
                assert_at_most(sun_energy_error(&lights[0], &sun), 1.2e-7);
                assert_at_most(direction_error(&lights[0], sun.moment), 1e-6);
            }
        close_map(&map);
    }
}

static void test_sun_planted(void **state) {
    scatter_environment map = random_map(256, 128, 1);
    scatter_light lights[20];
    integral half = {{0, 0, 0}, 0, {0, 0, 0}};
    int x, y;
    (void)state;
    add_sun(&map, check_v3(0, 0, 1), 40000);
    for (y = 0; y < 128; y++)
        for (x = 0; x < 128; x++)
            if (texel(&map, x, y)[0] > 1)
                add_texel(&half, &map, x, y);
    assert_int_equal(scatter_constellation(NULL, &map, methods[0], 20, lights), SCATTER_OK);
    assert_at_least(sun_energy_error(&lights[0], &half), 0.1);
    assert_at_least(direction_error(&lights[0], half.moment), 1e-3);
    close_map(&map);
}

/* Two suns, the second half as bright: the first two lights, in this order. */
static void test_two_suns(void **state) {
    scatter_light lights[20];
    size_t p, q;
    int m;
    (void)state;
    for (p = 0; p < CHECK_COUNT(sun_places); p++)
        for (q = 0; q < CHECK_COUNT(sun_places); q++) {
            scatter_vec3 a = unit(sun_places[p]), b = unit(sun_places[q]);
            scatter_environment map;
            integral first, second;
            if (check_distance(a, b) < 0.15) /* within 8 degrees they may be one lamp */
                continue;
            map = random_map(256, 128, p);
            first = add_sun(&map, a, 40000);
            second = add_sun(&map, b, 20000);
            for (m = 0; m < 2; m++) {
                assert_int_equal(scatter_constellation(NULL, &map, methods[m], 20, lights), 0);
                assert_at_most(sun_energy_error(&lights[0], &first), 1.2e-7);
                assert_at_most(sun_energy_error(&lights[1], &second), 1.2e-7);
                assert_at_most(direction_error(&lights[0], first.moment), 1e-6);
                assert_at_most(direction_error(&lights[1], second.moment), 1e-6);
            }
            close_map(&map);
        }
}

/* A lamp of 16 degrees that holds nearly everything is no sun, nor a heap of suns: the median cut
   gives all lights the same share of it, to half a part of its 16 by 8 texels. */
static void test_lamp_is_no_sun(void **state) {
    scatter_environment map = open_map(256, 128);
    scatter_light lights[16];
    int x, y;
    (void)state;
    for (y = 0; y < 128; y++)
        for (x = 0; x < 256; x++) {
            float l = y >= 60 && y < 68 && x >= 248 ? 1000.0f
                      : y >= 60 && y < 68 && x < 8  ? 1010
                                                    : 0;
            set_texel(&map, x, y, l, l, l);
        }
    assert_int_equal(scatter_constellation(NULL, &map, methods[0], 16, lights), SCATTER_OK);
    assert_at_most(spread(lights, 16), 1.05);
    close_map(&map);
}

/* ---------------------------------------------------- >>awkward maps */

static void test_black(void **state) {
    scatter_environment map = open_map(50, 30);
    scatter_light lights[MOST];
    int m, i;
    (void)state;
    for (m = 0; m < 2; m++) {
        assert_int_equal(scatter_constellation(NULL, &map, methods[m], MOST, lights), SCATTER_OK);
        for (i = 0; i < MOST; i++) {
            scatter_vec3 c = lights[i].intensity;
            assert_true(c.x == 0.0f && c.y == 0.0f && c.z == 0.0f);
            assert_at_most(check_distance(lights[i].direction, check_v3(0, -1, 0)), 0);
        }
    }
    close_map(&map);
}

/* One row, one column, one texel: cut finer, they are maps like others. */
static void test_few_texels(void **state) {
    static const int sizes[][2] = {{1, 1}, {1, 7}, {9, 1}, {2, 2}, {1, 300}, {300, 1}};
    scatter_light lights[MOST];
    size_t s;
    int m, count;
    (void)state;
    for (s = 0; s < CHECK_COUNT(sizes); s++) {
        scatter_environment map = open_map(sizes[s][0], sizes[s][1]);
        integral all;
        int i;
        for (i = 0; i < map.width * map.height; i++)
            set_texel(&map, i % map.width, i / map.width, 1.5f, 2, 2.5f);
        for (count = 1; count <= MOST; count = count * 3 + 1)
            for (m = 0; m < 2; m++) {
                assert_int_equal(scatter_constellation(NULL, &map, methods[m], count, lights), 0);
                for (i = 0; i < 3; i++)
                    all.rgb[i] = 4 * CHECK_PI * (1.5 + 0.5 * i);
                assert_at_most(energy_error(&all, lights, count, 1), 1.2e-7);
                assert_at_most(spread(lights, count), m ? 4 : 2.2);
            }
        close_map(&map);
    }
}

/* One bright texel and nothing else: one light has it all, the others are black and shine down. */
static void test_lonely_texel(void **state) {
    scatter_environment map = open_map(300, 150);
    scatter_light lights[20];
    integral all;
    int m, i;
    (void)state;
    set_texel(&map, 299, 40, 3, 2, 1);
    all = integrate(&map);
    for (m = 0; m < 2; m++) {
        assert_int_equal(scatter_constellation(NULL, &map, methods[m], 20, lights), SCATTER_OK);
        assert_at_most(energy_error(&all, lights, 1, 1), 1.2e-7);
        assert_at_most(direction_error(&lights[0], all.moment), 1e-6);
        for (i = 1; i < 20; i++)
            assert_true(lights[i].intensity.x == 0 && lights[i].direction.y == -1.0f);
    }
    close_map(&map);
}

/* More stars than lights, all of them candidates for suns: nothing is lost. */
static void test_stars(void **state) {
    scatter_environment map = open_map(512, 256);
    integral all;
    uint64_t seed = 1;
    int i, m;
    (void)state;
    for (i = 0; i < 4000; i++)
        set_texel(&map, (int)(check_bits(&seed) % 512), (int)(check_bits(&seed) % 256),
                  check_uniform(&seed, 0, 1000), 500, 400);
    all = integrate(&map);
    for (m = 0; m < 2; m++)
        for (i = 1; i <= MOST; i *= 4)
            assert_energy(&map, methods[m], i, &all);
    close_map(&map);
}

/* -------------------------------------------------- >>convergence */

/* What a constellation loses: energy times 1 - cos to the nearest light, over the energy. */
static double distortion(const scatter_environment *map, const scatter_light *lights, int count) {
    double all = 0, lost = 0;
    int x, y, i;
    for (y = 0; y < map->height; y++)
        for (x = 0; x < map->width; x++) {
            scatter_vec3 d = texel_direction(map, x, y);
            const float *c = texel(map, x, y);
            double e = sin(CHECK_PI * (y + 0.5) / map->height) *
                       (0.2126 * c[0] + 0.7152 * c[1] + 0.0722 * c[2]);
            double nearest = -1;
            for (i = 0; i < count; i++)
                nearest = fmax(nearest, -check_dot(d, lights[i].direction));
            all += e;
            lost += e * (1 - nearest);
        }
    return lost / all;
}

/* Light scattered by g = 0.5 into 64 directions: relative RMS error of the sum over the lights. */
static double phase_error(const scatter_environment *map, const scatter_light *lights, int count) {
    scatter_phase phase = {SCATTER_PHASE_HG, 0.5f, 0, 0};
    check_error e = check_no_error();
    uint64_t seed = 1;
    int n, i, x, y;
    for (n = 0; n < 64; n++) {
        scatter_vec3 out = check_direction(&seed);
        double sum = 0, truth = 0;
        for (i = 0; i < count; i++)
            sum += lights[i].intensity.y *
                   scatter_phase_value(&phase, (float)check_dot(lights[i].direction, out));
        for (y = 0; y < map->height; y++)
            for (x = 0; x < map->width; x++)
                truth +=
                    4 * CHECK_PI / map->width * sin(CHECK_PI * (y + 0.5) / map->height) *
                    sin(CHECK_PI / 2 / map->height) * texel(map, x, y)[1] *
                    scatter_phase_value(&phase, -(float)check_dot(texel_direction(map, x, y), out));
        check_add(&e, sum, truth);
    }
    return check_relative_rms(&e);
}

/* A sky with a few wide lobes. */
static scatter_environment smooth_map(int width, int height, uint64_t seed) {
    scatter_environment map = open_map(width, height);
    scatter_vec3 lobe[6];
    int x, y, i;
    for (i = 0; i < 6; i++)
        lobe[i] = check_direction(&seed);
    for (y = 0; y < height; y++)
        for (x = 0; x < width; x++) {
            float l = 0.1f;
            for (i = 0; i < 6; i++)
                l += (float)exp(8 * (check_dot(lobe[i], texel_direction(&map, x, y)) - 1));
            set_texel(&map, x, y, l, l, l);
        }
    return map;
}

/* Parts shrink as 1/sqrt(n), and a light at the centroid misses the second moment of its part:
   order 1 in n. Planted: lights that stay 4. */
static void test_convergence(void **state) {
    scatter_environment map = smooth_map(128, 64, 4);
    scatter_light lights[MOST];
    int m, i, count;
    (void)state;
    for (m = 0; m < 2; m++) {
        double error[4];
        for (i = 0, count = 4; i < 4; i++, count *= 4) {
            assert_int_equal(scatter_constellation(NULL, &map, methods[m], count, lights), 0);
            error[i] = phase_error(&map, lights, count);
        }
        printf("  4, 16, 64, 256 lights: %.5f %.5f %.5f %.5f   orders %.2f %.2f %.2f\n", error[0],
               error[1], error[2], error[3], check_order(error[0], error[1]) / 2,
               check_order(error[1], error[2]) / 2, check_order(error[2], error[3]) / 2);
        assert_at_least(check_order(error[0], error[3]) / 6, 0.8);
        assert_true(error[1] < error[0] && error[2] < error[1] && error[3] < error[2]);
        assert_false(phase_error(&map, lights, 4) < error[0]);
    }
    close_map(&map);
}

static void test_kmeans_loses_less(void **state) {
    static const int counts[] = {2, 5, 20, 64};
    scatter_light cut[MOST], means[MOST];
    uint64_t seed;
    size_t c;
    (void)state;
    for (seed = 1; seed <= 6; seed++) {
        scatter_environment map = seed & 1 ? smooth_map(128, 64, seed) : random_map(150, 64, seed);
        for (c = seed & 1 ? 0 : 1; c < CHECK_COUNT(counts); c++) { /* halves of noise are alike */
            assert_int_equal(scatter_constellation(NULL, &map, methods[0], counts[c], cut), 0);
            assert_int_equal(scatter_constellation(NULL, &map, methods[1], counts[c], means), 0);
            assert_at_most(distortion(&map, means, counts[c]), distortion(&map, cut, counts[c]));
            /* planted: one light less is seen */
            assert_at_least(distortion(&map, means, counts[c] - 1),
                            1.0001 * distortion(&map, means, counts[c]));
        }
        close_map(&map);
    }
}

/* --------------------------------------------------------- >>photographs */

static void test_photographs(void **state) {
    scatter_light cut[20], means[20];
    size_t i;
    int there = 0;
    (void)state;
    for (i = 0; i < HDR_MAPS; i++) {
        scatter_environment map;
        integral all;
        if (!hdr_read(hdr_names[i], &map))
            continue;
        there = 1;
        all = integrate(&map);
        assert_energy(&map, methods[0], 20, &all);
        assert_energy(&map, methods[1], 20, &all);
        assert_int_equal(scatter_constellation(NULL, &map, methods[0], 20, cut), SCATTER_OK);
        assert_int_equal(scatter_constellation(NULL, &map, methods[1], 20, means), SCATTER_OK);
        printf("  %-22s loses %.4f by median cut, %.4f by k-means\n", hdr_names[i],
               distortion(&map, cut, 20), distortion(&map, means, 20));
        assert_at_most(distortion(&map, means, 20), distortion(&map, cut, 20));
        hdr_free(&map);
    }
    if (!there) {
        printf("skipped: no data\n");
        skip();
    }
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
    bad.scale = -1;
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
        assert_int_equal(tries,
                         4 + m); /* refined map, tables, luminance, cells: each failed once */
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

/* Half way between two texels, across the seam and across rows, it is their mean; at the poles what
   the outermost row says. */
static void test_radiance_between(void **state) {
    scatter_environment map = random_map(37, 20, 3);
    int y;
    (void)state;
    for (y = 0; y < 19; y++) {
        double theta = CHECK_PI * (y + 0.5) / 20, below = CHECK_PI * (y + 1) / 20;
        scatter_vec3 seam = check_v3(0, (float)cos(theta), (float)sin(theta));
        scatter_vec3 rows = check_v3(0, (float)cos(below), (float)-sin(below));
        double side = 0.5 * texel(&map, 0, y)[0] + 0.5 * texel(&map, 36, y)[0];
        double mean = 0.5 * texel(&map, 18, y)[0] + 0.5 * texel(&map, 18, y + 1)[0];
        assert_at_most(fabs(scatter_environment_radiance(&map, seam).x - side), 1e-5);
        assert_at_most(fabs(scatter_environment_radiance(&map, rows).x - mean), 1e-5);
    }
    assert_at_most(
        fabs(scatter_environment_radiance(&map, check_v3(0, 9, -1e-6f)).x - texel(&map, 18, 0)[0]),
        0);
    assert_at_most(fabs(scatter_environment_radiance(&map, check_v3(0, -9, -1e-6f)).x -
                        texel(&map, 18, 19)[0]),
                   0);
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
        cmocka_unit_test(test_equal_energies),
        cmocka_unit_test(test_longer_side),
        cmocka_unit_test(test_centroid),
        cmocka_unit_test(test_hemisphere),
        cmocka_unit_test(test_turned_map),
        cmocka_unit_test(test_turns),
        cmocka_unit_test(test_sun),
        cmocka_unit_test(test_sun_planted),
        cmocka_unit_test(test_two_suns),
        cmocka_unit_test(test_lamp_is_no_sun),
        cmocka_unit_test(test_black),
        cmocka_unit_test(test_few_texels),
        cmocka_unit_test(test_lonely_texel),
        cmocka_unit_test(test_stars),
        cmocka_unit_test(test_convergence),
        cmocka_unit_test(test_kmeans_loses_less),
        cmocka_unit_test(test_photographs),
        cmocka_unit_test(test_refusals),
        cmocka_unit_test(test_allocations),
        cmocka_unit_test(test_radiance_at_centres),
        cmocka_unit_test(test_radiance_between),
        cmocka_unit_test(test_turn_by_a_right_angle),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
