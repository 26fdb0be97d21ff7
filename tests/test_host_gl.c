/* test_host_gl.c - the renderer that stands for a host of scatter_gl.h, examples/host_gl.h, against
   scatter_render, without any fog: its surfaces, its depth and its shadow maps. What scatter_gl.h is
   measured with must be right itself. MIT licence, see LICENSE.

   Without EGL or OSMesa the tests are skipped. Run from the root of the project. */
#define _POSIX_C_SOURCE 200809L
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#define SCATTER_IMPLEMENTATION
#include "../examples/gl_context.h"
#include "../examples/host_gl.h"
#include "check.h"

/* For the leak sanitizer: what drivers lose themselves. */
const char *__lsan_default_suppressions(void);
const char *__lsan_default_suppressions(void)
{
    return "leak:libOSMesa.so\nleak:libEGL\nleak:_dri.so\n";
}

static const host_gl_options small = {64, NULL}; /* shadow maps */
static const char *const scenes[] = {"window", "spot", "horizon", "fire", "smoke", "mixed"};

/* What no scene in examples/ has: a parallel projection, a sheet, a lamp below the ground, one in a
   lampshade, a spot light of more than half a sphere, a sun at the zenith. */
static const char mixed[] = "image 64 48\n"
                            "camera orthographic 2 6 9  0 0.7 0  0 1 0  5\n"
                            "medium 0 0 0  1 1 1\n"
                            "light point 0.4 -2 1  50 60 70\n"
                            "light point -1.5 0.6 -0.4  9 9 7\n"
                            "light spot 1.5 2.2 0.5  -0.4 -1 0.2  30 100  20 22 30\n"
                            "light directional 0 -1 0  1 1.5 2\n"
                            "light spot 2.5 2.5 2.5  -1 -0.9 -1  20 25  60 50 40\n"
                            "plane 0 1 0 0  0.5 0.5 0.5\n"
                            "box -2 0.1 -1 -1 1.2 0  0.8 0.7 0.6\n"
                            "box 0.5 0 0.1 0.5 0.9 1  0.8 0.2 0.2\n"
                            "sphere 0 0.7 -0.3 0.6  0.3 0.4 0.9\n"
                            "background 0.2 0.3 0.4\n";
enum { WIDTH = 96, HEIGHT = 72, PIXELS = WIDTH * HEIGHT };

/* ----------------------------------------------------------------------------------- >>helpers */

typedef struct stage {
    scene_file file;
    gl_context context;
    host_gl host;
} stage;

/* The scene without its medium, in a context of that API. */
static void stage_open(stage *s, const char *api, const char *name, const host_gl_options *options)
{
    char path[64];
    snprintf(path, sizeof path, "examples/scenes/%s.scatter", name);
    if (!gl_context_open(&s->context, api, NULL)) {
        printf("%s\n", s->context.error);
        skip();
    }
    assert_int_equal(strcmp(name, "mixed") == 0
                         ? scene_parse(&s->file, mixed, sizeof mixed - 1, NULL)
                         : scene_read(&s->file, path),
                     0);
    s->file.scene.medium.extinction = s->file.scene.medium.emission = scatter_v3(0, 0, 0);
    if (host_gl_open(&s->host, s->context.get_proc_address, &s->file, WIDTH, HEIGHT, options) ||
        host_gl_surface(&s->host, NULL))
        fail_msg("%s", s->host.error);
    host_gl_draw(&s->host);
}

static void stage_close(stage *s)
{
    host_gl_close(&s->host);
    gl_context_close(&s->context);
    scene_free(&s->file);
}

/* The depth of the picture or of a shadow map. */
static void read_depth(stage *s, unsigned framebuffer, int width, int height, float *out)
{
    s->host.gl.BindFramebuffer(HOST_GL_FRAMEBUFFER, framebuffer);
    s->host.gl.ReadPixels(0, 0, width, height, HOST_GL_DEPTH_COMPONENT, HOST_GL_FLOAT, out);
}

/* ----------------------------------------------------------------------------------- >>picture */

/* Pixels that differ by more than `limit` of their value. */
static int count_wrong(const float *picture, const float *reference, float limit)
{
    int wrong = 0;
    for (int i = 0; i < PIXELS; i++)
        for (int k = 0; k < 3; k++)
            if (!(fabsf(picture[3 * i + k] - reference[3 * i + k]) <=
                  limit * fabsf(reference[3 * i + k]) + 1e-7f)) {
                wrong++;
                break;
            }
    return wrong;
}

static void turn_upside_down(float *rgb)
{
    for (int i = 0; i < 3 * PIXELS / 2; i++) {
        int other = 3 * WIDTH * (HEIGHT - 1 - i / (3 * WIDTH)) + i % (3 * WIDTH);
        float value = rgb[i];
        rgb[i] = rgb[other];
        rgb[other] = value;
    }
}

static void render_reference(const stage *s, float *rgb)
{
    scatter_image image;
    scatter_view view = scene_view(&s->file, WIDTH, HEIGHT);
    scatter_context *context = check_open_context(&s->file.scene, NULL);
    memset(&image, 0, sizeof image);
    image.width = WIDTH;
    image.height = HEIGHT;
    image.rgb = rgb;
    assert_int_equal(scatter_render(context, &view, &image), SCATTER_OK);
    scatter_destroy(context);
}

/* Floats on both sides: a grazing cosine loses up to three digits of seven, and the edge of a shadow
   or shape may fall on the other side of the centre of a pixel: 4 of 6912 at most. */
static void check_pictures(const char *api)
{
    static float reference[3 * PIXELS], rgb[3 * PIXELS];
    const file_picture picture = {rgb, WIDTH, HEIGHT};
    for (size_t i = 0; i < CHECK_COUNT(scenes); i++) {
        stage s;
        stage_open(&s, api, scenes[i], &small);
        assert_int_equal(host_gl_read(&s.host, &picture), 0);
        render_reference(&s, reference);
        assert_at_most(count_wrong(rgb, reference, 1e-3f), 4);
        turn_upside_down(reference); /* planted fault */
        assert_at_least(count_wrong(rgb, reference, 1e-3f), PIXELS / 4);
        stage_close(&s);
    }
}

static void test_pictures_gl33(void **state)
{
    (void)state;
    check_pictures("gl33");
}

static void test_pictures_gl45(void **state)
{
    (void)state;
    check_pictures("gl45");
}

static void test_pictures_es30(void **state)
{
    (void)state;
    check_pictures("es30");
}

static void test_pictures_osmesa(void **state)
{
    (void)state;
    check_pictures("osmesa");
}

/* ------------------------------------------------------------------------------------- >>depth */

/* What the depth buffer should hold at the middle of a pixel, counted from the lower left. */
static double expected_depth(const stage *s, int x, int y, double *distance)
{
    scatter_view view = scene_view(&s->file, WIDTH, HEIGHT);
    scatter_ray ray =
        scatter_view_ray(&view, ((float)x + 0.5f) / WIDTH, 1 - ((float)y + 0.5f) / HEIGHT);
    const host_gl_depth *c = &s->host.convention;
    scatter_surface hit;
    *distance = 0;
    if (!scene_surface((void *)&s->file, ray.origin, ray.direction, &hit))
        return c->reversed ? 0 : 1;
    *distance = (double)hit.distance;
    double d[3], f[3], eye[3], low = c->zero_to_one ? 0 : -1;
    scene_doubles(ray.direction, d);
    scene_doubles(s->file.target, f);
    scene_doubles(s->file.eye, eye);
    for (int i = 0; i < 3; i++)
        f[i] -= eye[i];
    host_gl_unit(f);
    double z = *distance * scene_dot(d, f) / host_gl_unit(d);
    double over = c->far > 0 ? 1 / c->far : 0;
    double share = (1 / c->near - 1 / z) / (1 / c->near - over); /* 0 near, 1 far */
    double ndc = c->reversed ? 1 + (low - 1) * share : low + (1 - low) * share;
    return c->zero_to_one ? ndc : 0.5 + 0.5 * ndc;
}

/* The worst error of the depth over the picture, and of the distance that it tells. */
static void depth_errors(stage *s, double *worst, double *worst_distance)
{
    static float depth[PIXELS];
    double distance;
    read_depth(s, s->host.framebuffer, WIDTH, HEIGHT, depth);
    *worst = *worst_distance = 0;
    for (int i = 0; i < PIXELS; i++) {
        double expected = expected_depth(s, i % WIDTH, i / WIDTH, &distance);
        *worst = fmax(*worst, fabs((double)depth[i] - expected));
        if (distance > 0 && distance < 1e4)
            *worst_distance = fmax(*worst_distance, fabs((double)depth[i] / expected - 1));
    }
}

/* Rays through pixel centres that graze the far ground err by more, so scenes without a horizon.
   Depth in 0..1 as a float, computed in floats: some 2^-22. */
static void test_depth(void **state)
{
    static const host_gl_depth conventions[] = {{0, 0, 0.1, 100}, {0, 0, 0.1, 0},
                                                {0, 1, 0.1, 100}, {1, 0, 0.1, 100},
                                                {1, 1, 0.1, 100}, {1, 1, 0.1, 0}};
    (void)state;
    for (size_t i = 0; i < CHECK_COUNT(conventions); i++) {
        const host_gl_options options = {64, &conventions[i]};
        double worst, distance;
        stage s;
        stage_open(&s, "gl33", "window", &options);
        depth_errors(&s, &worst, &distance);
        assert_at_most(worst, 1e-6);
        s.host.convention.near *= 1.01; /* planted fault */
        depth_errors(&s, &worst, &distance);
        assert_at_least(worst, 2e-5);
        stage_close(&s);
    }
}

/* The default is reversed and infinite: as many digits of the distance as a float has. */
static void test_default_depth_is_exact(void **state)
{
    (void)state;
    double worst, distance;
    stage s;
    stage_open(&s, "gl33", "window", &small);
    depth_errors(&s, &worst, &distance);
    assert_at_most(distance, 2e-6);
    stage_close(&s);
}

/* ----------------------------------------------------------------------------------- >>shadows */

/* The shadow maps of a stage, read back; the cube's six faces behind each other. */
typedef struct maps {
    float *depth[8];
} maps;

static void read_maps(stage *s, maps *m)
{
    int side = s->host.shadow_map;
    for (size_t i = 0; i < s->file.scene.light_count; i++) {
        const scatter_gl_shadow *shadow = &s->host.lights[i].shadow;
        int cube = shadow->kind == SCATTER_GL_SHADOW_CUBE, n = cube ? side / 2 : side;
        m->depth[i] = (float *)malloc((size_t)n * (size_t)n * (cube ? 6 : 1) * sizeof(float));
        for (unsigned face = 0; face < (cube ? 6u : 1u) && shadow->kind; face++) {
            s->host.gl.BindFramebuffer(HOST_GL_FRAMEBUFFER, s->host.shadow_framebuffer);
            s->host.gl.FramebufferTexture2D(HOST_GL_FRAMEBUFFER, HOST_GL_DEPTH_ATTACHMENT,
                                            cube ? HOST_GL_CUBE_FACE + face : HOST_GL_TEXTURE_2D,
                                            shadow->texture, 0);
            read_depth(s, s->host.shadow_framebuffer, n, n, m->depth[i] + face * (unsigned)(n * n));
        }
    }
}

/* Where p falls on a 2D map: x, y, z over w. */
static int project(const scatter_gl_shadow *shadow, const double *p, double *at)
{
    const float *m = shadow->matrix[0];
    double clip[4];
    for (int i = 0; i < 4; i++)
        clip[i] = (double)m[i] * p[0] + (double)m[4 + i] * p[1] + (double)m[8 + i] * p[2] +
                  (double)m[12 + i];
    for (int i = 0; i < 3; i++)
        at[i] = clip[i] / clip[3];
    return clip[3] > 0 && at[0] >= 0 && at[0] < 1 && at[1] >= 0 && at[1] < 1 && at[2] >= 0 &&
           at[2] <= 1;
}

static int lit_by_map(const stage *s, const scatter_gl_shadow *shadow, const float *depth,
                      const double *p)
{
    double at[3];
    int side = s->host.shadow_map;
    if (!project(shadow, p, at))
        return 1;
    double held = (double)depth[(int)(at[1] * side) * side + (int)(at[0] * side)];
    return shadow->reversed ? at[2] >= held : at[2] <= held;
}

/* The face and the place on it, from the table of the GL specification. */
static int lit_by_cube(const stage *s, const scatter_gl_light *light, const float *depth,
                       const double *p)
{
    double r[3], lamp[3];
    int side = s->host.shadow_map / 2, axis = 0;
    scene_doubles(light->light.position, lamp);
    for (int i = 0; i < 3; i++)
        r[i] = p[i] - lamp[i];
    for (int i = 1; i < 3; i++)
        axis = fabs(r[i]) > fabs(r[axis]) ? i : axis;
    double sign = r[axis] < 0 ? -1 : 1;
    double across = axis == 0 ? -sign * r[2] : axis == 1 ? r[0] : sign * r[0];
    double down = axis == 1 ? sign * r[2] : -r[1];
    int face = 2 * axis + (sign < 0), x = (int)((across / fabs(r[axis]) + 1) / 2 * side);
    int y = (int)((down / fabs(r[axis]) + 1) / 2 * side);
    x = x < side ? x : side - 1;
    y = y < side ? y : side - 1;
    return sqrt(scene_dot(r, r)) / (double)light->shadow.z_far <=
           (double)depth[(face * side + y) * side + x];
}

static int lit(const stage *s, const scatter_gl_light *light, const float *depth, const double *p)
{
    if (!(light->light.intensity.x > 0))
        return 0;
    if (light->shadow.kind == SCATTER_GL_SHADOW_NONE)
        return 1;
    return light->shadow.kind == SCATTER_GL_SHADOW_CUBE ? lit_by_cube(s, light, depth, p)
                                                        : lit_by_map(s, &light->shadow, depth, p);
}

/* The side of a texel of the map at p, m. */
static double texel(const stage *s, const scatter_gl_light *light, const double *p)
{
    double r[3], at[3], step[3], q[3], size = 0;
    scene_doubles(light->light.position, r);
    for (int i = 0; i < 3; i++)
        r[i] -= p[i];
    if (light->shadow.kind == SCATTER_GL_SHADOW_CUBE)
        return sqrt(scene_dot(r, r)) * 4 / s->host.shadow_map;
    project(&light->shadow, p, at);
    for (int i = 0; i < 3; i++) {
        memcpy(q, p, sizeof q);
        q[i] += 1e-3;
        project(&light->shadow, q, step);
        size = fmax(size, fmax(fabs(step[0] - at[0]), fabs(step[1] - at[1])));
    }
    return 1e-3 / (size * s->host.shadow_map);
}

static int sees(const stage *s, const scatter_light *light, const double *p, const double *move)
{
    scatter_vec3 from =
        scatter_v3((float)(p[0] + move[0]), (float)(p[1] + move[1]), (float)(p[2] + move[2]));
    scatter_vec3 to = light->position;
    if (light->kind == SCATTER_LIGHT_DIRECTIONAL)
        to = check_along(from, -1e6f / sqrtf((float)check_dot(light->direction, light->direction)),
                         light->direction);
    return scene_visible((void *)&s->file, from, to);
}

/* Whether the edge of a shadow passes within two texels of p. */
static int is_at_edge(const stage *s, const scatter_gl_light *light, const double *p, int seen)
{
    double reach = 2 * texel(s, light, p);
    for (int i = 0; i < 27; i++) {
        const double move[3] = {reach * (i % 3 - 1), reach * (i / 3 % 3 - 1), reach * (i / 9 - 1)};
        if (sees(s, &light->light, p, move) != seen)
            return 1;
    }
    return 0;
}

static int in_cone(const scatter_light *light, const double *p)
{
    double r[3], d[3];
    scene_doubles(light->position, r);
    scene_doubles(light->direction, d);
    for (int i = 0; i < 3; i++)
        r[i] = p[i] - r[i];
    return light->kind != SCATTER_LIGHT_SPOT ||
           scene_dot(r, d) > cos((double)light->outer) * host_gl_unit(r) * host_gl_unit(d);
}

typedef struct verdict {
    int dark, edges, wrong; /* points in shadow; wrong ones at edges, and elsewhere */
} verdict;

/* A point around a solid, up to its size away. */
static void point_near(const stage *s, uint64_t *seed, double *p)
{
    const scene_shape *shape = &s->file.shapes[check_bits(seed) % s->file.shape_count];
    double low[3], high[3];
    scene_doubles(shape->a, low);
    scene_doubles(shape->kind == SCENE_SPHERE ? shape->a : shape->b, high);
    for (int i = 0; i < 3; i++) {
        double middle = (low[i] + high[i]) / 2, half = (high[i] - low[i]) / 2;
        double reach = shape->kind == SCENE_SPHERE ? (double)shape->radius : fmax(half, 0.1);
        p[i] = middle + 3 * reach * (double)check_uniform(seed, -1, 1);
    }
}

/* Points in the air that the eye sees and the light may reach. */
static verdict judge(const stage *s, const scatter_gl_light *light, const float *depth)
{
    static const double none[3] = {0, 0, 0};
    verdict v = {0, 0, 0};
    uint64_t seed = 7;
    for (int i = 0; i < 20000; i++) {
        double p[3];
        point_near(s, &seed, p);
        scatter_vec3 at = scatter_v3((float)p[0], (float)p[1], (float)p[2]);
        if (!scene_visible((void *)&s->file, s->file.eye, at) || !in_cone(&light->light, p))
            continue;
        int seen = sees(s, &light->light, p, none);
        v.dark += !seen;
        if (lit(s, light, depth, p) == seen)
            continue;
        if (is_at_edge(s, light, p, seen))
            v.edges++;
        else
            v.wrong++;
    }
    return v;
}

/* Shifts a map by a sixteenth, or swaps two faces of a cube. */
static void spoil(const stage *s, scatter_gl_light *light, float *depth)
{
    int half = s->host.shadow_map / 2;
    float *m = light->shadow.matrix[0];
    for (int k = 0; k < 4; k++)
        m[4 * k] += m[4 * k + 3] / 16;
    for (int i = 0; i < half * half && light->shadow.kind == SCATTER_GL_SHADOW_CUBE; i++) {
        float value = depth[i];
        depth[i] = depth[half * half + i];
        depth[half * half + i] = value;
    }
}

/* Away from edges the maps know what scene_visible knows. */
static void check_maps(const char *name, int *dark)
{
    const host_gl_options fine = {512, NULL};
    maps m;
    stage s;
    stage_open(&s, "gl33", name, &fine);
    read_maps(&s, &m);
    for (size_t i = 0; i < s.file.scene.light_count; i++) {
        scatter_gl_light *light = &s.host.lights[i];
        verdict v = judge(&s, light, m.depth[i]);
        printf("%s, light %d: %d of 20000 points in shadow, %d on the wrong side of an edge, "
               "%d wrong\n",
               name, (int)i, v.dark, v.edges, v.wrong);
        assert_int_equal(v.wrong, 0);
        assert_at_most(v.edges, 200);
        *dark += v.dark;
        if (light->shadow.kind != SCATTER_GL_SHADOW_NONE && v.dark > 100) {
            spoil(&s, light, m.depth[i]);
            assert_at_least(judge(&s, light, m.depth[i]).wrong, 10);
        }
        free(m.depth[i]);
    }
    stage_close(&s);
}

static void test_shadow_maps(void **state)
{
    int dark = 0;
    (void)state;
    for (size_t i = 0; i < CHECK_COUNT(scenes); i++)
        check_maps(scenes[i], &dark);
    assert_at_least(dark, 1000);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_pictures_gl33), cmocka_unit_test(test_pictures_gl45),
        cmocka_unit_test(test_pictures_es30), cmocka_unit_test(test_pictures_osmesa),
        cmocka_unit_test(test_depth),         cmocka_unit_test(test_default_depth_is_exact),
        cmocka_unit_test(test_shadow_maps),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
