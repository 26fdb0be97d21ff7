/* test_gl_view.c - the pictures of scatter_gl.h against those of scatter.h: cameras, depth conventions,
   lights in batches, shadow maps, reduced resolution, froxels, surfaces and debug views, in every
   kind of context. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#define SCATTER_IMPLEMENTATION
#include "../scatter_gl.h"
#include "../examples/files.h"
#include "check.h"
#include "gl_state.h"
#include "gl_host.h"
#include "gl_leaks.h"
#include "gl_rig.h"

#define WIDTH 40
#define HEIGHT 28
#define PIXELS (WIDTH * HEIGHT)
#define SKY 64 /* lights of a constellation, at most */

/* ----------------------------------------------------------------------------------- >>cameras */

/* A camera as OpenGL and as scatter.h have it. */
typedef struct camera {
    const char *name;
    float view[16], projection[16];
    int reversed, zero_to_one;
    scatter_view rays;
} camera;

typedef enum camera_kind { PLAIN, INFINITE, OFF_AXIS, PARALLEL, PARALLEL_REVERSED, CAMERAS } camera_kind;

/* Looks from `eye` to the origin; the frustum's edges at distance 1 (or, parallel, in metres). */
static void aim(camera *c, scatter_vec3 eye, const float *edges, int parallel) {
    const scatter_vec3 back = scatteri_unit(eye);
    const scatter_vec3 right = scatteri_unit(scatteri_cross(check_v3(0, 1, 0), back));
    const scatter_vec3 up = scatteri_cross(back, right);
    const float width = edges[1] - edges[0], height = edges[3] - edges[2];
    const float m[16] = {right.x, up.x, back.x, 0, right.y, up.y, back.y, 0,
                         right.z, up.z, back.z, 0, -scatteri_dot(right, eye),
                         -scatteri_dot(up, eye), -scatteri_dot(back, eye), 1};
    const scatter_vec3 corner = scatteri_add(scatteri_scale(right, edges[0]), scatteri_scale(up, edges[3]));
    memcpy(c->view, m, sizeof m);
    memset(&c->rays, 0, sizeof c->rays);
    c->rays.origin = eye;
    c->rays.direction = scatteri_scale(back, -1.0f);
    if (parallel) {
        c->rays.origin = scatteri_add(eye, corner);
        c->rays.origin_dx = scatteri_scale(right, width);
        c->rays.origin_dy = scatteri_scale(up, -height);
    } else {
        c->rays.direction = scatteri_add(c->rays.direction, corner);
        c->rays.direction_dx = scatteri_scale(right, width);
        c->rays.direction_dy = scatteri_scale(up, -height);
    }
}

/* Clip z as a + b z_camera (parallel), or (a + b z_camera) / -z_camera. */
static void project(camera *c, const float *edges, int parallel, float a, float b) {
    float *p = c->projection;
    memset(p, 0, sizeof c->projection);
    p[0] = 2.0f / (edges[1] - edges[0]);
    p[5] = 2.0f / (edges[3] - edges[2]);
    p[parallel ? 12 : 8] = (edges[1] + edges[0]) / (edges[1] - edges[0]) * (parallel ? -1.0f : 1.0f);
    p[parallel ? 13 : 9] = (edges[3] + edges[2]) / (edges[3] - edges[2]) * (parallel ? -1.0f : 1.0f);
    p[10] = b;
    p[14] = a;
    p[parallel ? 15 : 11] = parallel ? 1.0f : -1.0f;
}

static camera make_camera(camera_kind kind) {
    static const float straight[4] = {-0.5f, 0.5f, -0.35f, 0.35f}, off[4] = {-0.3f, 0.6f, -0.45f, 0.2f};
    static const float wide[4] = {-2.0f, 2.0f, -1.4f, 1.4f};
    static const char *const names[] = {"plain", "infinite, reversed, 0..1", "off axis", "parallel",
                                        "parallel, reversed, 0..1"};
    const float near = 0.5f, far = 40.0f;
    const scatter_vec3 eye = {0.9f, 1.1f, 4.0f};
    const int parallel = kind >= PARALLEL;
    const float *edges = parallel ? wide : kind == OFF_AXIS ? off : straight;
    camera c;
    memset(&c, 0, sizeof c);
    c.name = names[kind];
    c.reversed = c.zero_to_one = kind == INFINITE || kind == PARALLEL_REVERSED;
    aim(&c, eye, edges, parallel);
    if (kind == INFINITE)
        project(&c, edges, 0, near, 0.0f);
    else if (kind == PARALLEL)
        project(&c, edges, 1, -(far + near) / (far - near), -2.0f / (far - near));
    else if (kind == PARALLEL_REVERSED)
        project(&c, edges, 1, far / (far - near), 1.0f / (far - near));
    else
        project(&c, edges, 0, -2.0f * far * near / (far - near), -(far + near) / (far - near));
    if (parallel) /* rays of a parallel camera begin at its near plane */
        c.rays.origin = scatteri_along(c.rays.origin, c.rays.direction, near);
    return c;
}

/* What a depth buffer holds for the world point. */
static float depth_of(const camera *c, scatter_vec3 x) {
    const float at[4] = {x.x, x.y, x.z, 1.0f};
    double seen[4], clip[4];
    int row, k;
    for (row = 0; row < 4; row++)
        for (seen[row] = 0, k = 0; k < 4; k++)
            seen[row] += (double)c->view[4 * k + row] * (double)at[k];
    for (row = 0; row < 4; row++)
        for (clip[row] = 0, k = 0; k < 4; k++)
            clip[row] += (double)c->projection[4 * k + row] * seen[k];
    return (float)(c->zero_to_one ? clip[2] / clip[3] : 0.5 + 0.5 * clip[2] / clip[3]);
}

static scatter_ray pixel_ray(const camera *c, int x, int y) {
    scatter_ray r = scatter_view_ray(&c->rays, ((float)x + 0.5f) / WIDTH, ((float)y + 0.5f) / HEIGHT);
    r.direction = scatteri_unit(r.direction);
    return r;
}

/* ---------------------------------------------------------------------------------- >>pictures */

typedef struct picture {
    float rgba[4 * PIXELS]; /* rows from below, as OpenGL has them */
} picture;

/* What the host has: its picture, and where its surfaces are. */
typedef struct stage {
    gl_rig *rig;
    scatter_gl *fog;
    GLuint framebuffer, color, depth;
    float distance[PIXELS]; /* rows from above; 0: sky */
    float scene[3 * PIXELS];
} stage;

static void say(void *user, scatter_result result, const char *sentence) {
    (void)user;
    fprintf(stderr, "  %d: %s\n", (int)result, sentence);
}

static GLuint make_texture(const gl_functions *gl, GLint internal, int width, int height,
                           GLenum format, const void *values) {
    GLuint name;
    gl->GenTextures(1, &name);
    gl->BindTexture(GL_TEXTURE_2D, name);
    gl->TexImage2D(GL_TEXTURE_2D, 0, internal, width, height, 0, format, GL_FLOAT, values);
    gl->TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_NEAREST);
    gl->TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_NEAREST);
    return name;
}

static void open_stage(stage *s, gl_rig *rig) {
    const gl_functions *gl = &rig->host.gl;
    scatter_gl_desc desc;
    int i;
    memset(s, 0, sizeof *s);
    memset(&desc, 0, sizeof desc);
    s->rig = rig;
    desc.host.log = say;
    desc.get_proc_address = rig->context.get_proc_address;
    desc.max_lights = SKY;
    assert_int_equal(scatter_gl_create(&desc, &s->fog), SCATTER_OK);
    s->color = make_texture(gl, GL_RGBA32F, WIDTH, HEIGHT, GL_RGBA, NULL);
    gl->GenFramebuffers(1, &s->framebuffer);
    gl->BindFramebuffer(GL_FRAMEBUFFER, s->framebuffer);
    gl->FramebufferTexture2D(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_TEXTURE_2D, s->color, 0);
    for (i = 0; i < 3 * PIXELS; i++)
        s->scene[i] = 0.2f + 0.1f * (float)(i % 3);
}

static void close_stage(stage *s) {
    const gl_functions *gl = &s->rig->host.gl;
    assert_int_equal(gl->GetError(), GL_NO_ERROR);
    scatter_gl_destroy(s->fog);
    gl->DeleteTextures(1, &s->color);
    gl->DeleteTextures(1, &s->depth);
    gl->DeleteFramebuffers(1, &s->framebuffer);
}

static void put_world(stage *s, const check_world *w, const scatter_gl_shadow *shadow,
                      const scatter_quality *q, const scatter_vec3 *eye) {
    scatter_gl_light lights[CHECK_COUNT(w->lights)];
    size_t i;
    memset(lights, 0, sizeof lights);
    for (i = 0; i < w->scene.light_count; i++) {
        lights[i].light = w->lights[i];
        if (shadow != NULL)
            lights[i].shadow = *shadow;
    }
    assert_int_equal(scatter_gl_set_medium(s->fog, &w->scene.medium), SCATTER_OK);
    assert_int_equal(scatter_gl_set_lights(s->fog, lights, w->scene.light_count), SCATTER_OK);
    assert_int_equal(scatter_gl_update(s->fog, q, eye), SCATTER_OK);
}

/* The host's depth buffer of the plane at height y, where rays meet it; sky elsewhere. */
static void put_plane(stage *s, const camera *c, float y) {
    static float values[PIXELS];
    int i, j;
    for (j = 0; j < HEIGHT; j++)
        for (i = 0; i < WIDTH; i++) {
            const scatter_ray r = pixel_ray(c, i, j);
            const float t = (y - r.origin.y) / r.direction.y;
            const int some = t > 0.6f && t < 30.0f;
            s->distance[j * WIDTH + i] = some ? t : 0.0f;
            values[(HEIGHT - 1 - j) * WIDTH + i] =
                some ? depth_of(c, scatteri_along(r.origin, r.direction, t))
                     : (c->reversed ? 0.0f : 1.0f);
        }
    s->rig->host.gl.DeleteTextures(1, &s->depth);
    s->depth = make_texture(&s->rig->host.gl, GL_R32F, WIDTH, HEIGHT, GL_RED, values);
}

static scatter_gl_view view_of(const stage *s, const camera *c) {
    scatter_gl_view v;
    memset(&v, 0, sizeof v);
    v.view = c->view;
    v.projection = c->projection;
    v.reversed = c->reversed;
    v.zero_to_one = c->zero_to_one;
    v.framebuffer = s->framebuffer;
    v.width = WIDTH;
    v.height = HEIGHT;
    v.depth_texture = s->depth;
    return v;
}

/* The fog over the host's picture. */
static void draw(stage *s, const scatter_gl_view *v, picture *out) {
    const gl_functions *gl = &s->rig->host.gl;
    gl->BindFramebuffer(GL_FRAMEBUFFER, s->framebuffer);
    gl->ClearColor(s->scene[0], s->scene[1], s->scene[2], 0.25f);
    gl->Clear(GL_COLOR_BUFFER_BIT);
    assert_int_equal(scatter_gl_draw(s->fog, v), SCATTER_OK);
    gl->ReadBuffer(GL_COLOR_ATTACHMENT0);
    gl->ReadPixels(0, 0, WIDTH, HEIGHT, GL_RGBA, GL_FLOAT, out->rgba);
    assert_int_equal(gl->GetError(), GL_NO_ERROR);
}

/* The same by scatter.h; transmittance may be NULL. */
static void render(const stage *s, const check_world *w, const camera *c, const scatter_quality *q,
                   float *rgb, float *transmittance) {
    scatter_context *context = check_open_context(&w->scene, q);
    scatter_image image;
    memset(&image, 0, sizeof image);
    image.width = WIDTH;
    image.height = HEIGHT;
    image.rgb = rgb;
    image.transmittance = transmittance;
    image.distance = s->distance;
    image.color = s->scene;
    assert_int_equal(scatter_render(context, &c->rays, &image), SCATTER_OK);
    scatter_destroy(context);
}

/* Relative RMSE: over the mean of the reference. */
static double compare(const picture *p, const float *rgb) {
    double square = 0, sum = 0;
    int x, y, k;
    for (y = 0; y < HEIGHT; y++)
        for (x = 0; x < WIDTH; x++)
            for (k = 0; k < 3; k++) {
                const double a = (double)p->rgba[4 * ((HEIGHT - 1 - y) * WIDTH + x) + k];
                const double b = (double)rgb[3 * (y * WIDTH + x) + k];
                square += (a - b) * (a - b);
                sum += b;
            }
    return sqrt(square / (3.0 * PIXELS)) / (sum / (3.0 * PIXELS));
}

static double difference(const float *rgb, const float *reference) {
    double square = 0, sum = 0;
    int i;
    for (i = 0; i < 3 * PIXELS; i++) {
        square += ((double)rgb[i] - (double)reference[i]) * ((double)rgb[i] - (double)reference[i]);
        sum += (double)reference[i];
    }
    return sqrt(square / (3.0 * PIXELS)) / (sum / (3.0 * PIXELS));
}

static scatter_quality quality_of(scatter_depth_method depth, int nodes) {
    scatter_quality q;
    memset(&q, 0, sizeof q);
    q.depth = depth;
    q.nodes = nodes;
    return q;
}

/* A few soft Gaussians around the origin and a lamp. */
static void open_puffs(check_world *w) {
    check_world_open(w);
    w->scene.medium.extinction = check_v3(0.8f, 1.0f, 1.3f);
    w->scene.medium.albedo = check_v3(0.9f, 0.8f, 0.7f);
    w->scene.medium.phase.kind = SCATTER_PHASE_HG;
    w->scene.medium.phase.g = 0.3f;
    check_add_gaussian(w, check_v3(0, 0.2f, 0), 1.3f, 1.5f);
    check_add_gaussian(w, check_v3(0.8f, -0.3f, -0.4f), 2.0f, 2.5f);
    check_add_gaussian(w, check_v3(-0.9f, 0.1f, 0.5f), 1.7f, 1.0f);
    check_add_light(w, SCATTER_LIGHT_POINT, check_v3(1.6f, 2.0f, 0.8f), check_v3(9, 8, 7));
    w->lights[0].radius = 0.05f;
}

/* What both sides may differ by where they do the same: 32 nodes are within 1e-5 of the truth here, and sums of
   floats over them, blending and the depth buffer's own rounding stay below 1e-4. */
#define SAME 1e-4

/* Under directional lights with polar depth scatter.h reads between the values of a lattice, the GPU between those of
   columns; both are 0.1 m apart here, and a line between them misses (a h)^2/8, 0.5 %, of the Gaussian of a = 2/m. */
#define OTHER_VALUES 5e-3

/* ------------------------------------------------------------------------------------- >>tests */

static void every_camera(gl_rig *rig) {
    const scatter_quality q = quality_of(SCATTER_DEPTH_CLOSED, 32);
    static float rgb[3 * PIXELS];
    static picture p;
    check_world w;
    stage s;
    int kind;
    open_puffs(&w);
    open_stage(&s, rig);
    put_world(&s, &w, NULL, &q, NULL);
    for (kind = 0; kind < CAMERAS; kind++) {
        const camera c = make_camera((camera_kind)kind);
        scatter_gl_view v;
        put_plane(&s, &c, -0.4f);
        v = view_of(&s, &c);
        draw(&s, &v, &p);
        render(&s, &w, &c, &q, rgb, NULL);
        if (!check_at_most(c.name, compare(&p, rgb), SAME))
            fail();
        v.zero_to_one = !v.zero_to_one; /* planted: the wrong convention */
        draw(&s, &v, &p);
        assert_at_least(compare(&p, rgb), 100 * SAME);
    }
    close_stage(&s);
}

/* A host whose clip y points down in the window sees the same picture from below. */
static void origin_at_the_top(gl_rig *rig) {
    const gl_functions *gl = &rig->host.gl;
    const scatter_quality q = quality_of(SCATTER_DEPTH_CLOSED, 16);
    const camera c = make_camera(OFF_AXIS);
    static picture plain, turned;
    scatter_gl_view v;
    check_world w;
    stage s;
    int i, y;
    if (rig->context.es || 10 * rig->context.major + rig->context.minor < 45)
        return; /* there is no glClipControl */
    open_puffs(&w);
    open_stage(&s, rig);
    put_world(&s, &w, NULL, &q, NULL);
    v = view_of(&s, &c);
    draw(&s, &v, &plain);
    gl->ClipControl(GL_UPPER_LEFT, GL_NEGATIVE_ONE_TO_ONE);
    draw(&s, &v, &turned);
    for (y = 0; y < HEIGHT; y++)
        for (i = 0; i < 4 * WIDTH; i++)
            assert_at_most(fabs((double)plain.rgba[4 * WIDTH * y + i] -
                                (double)turned.rgba[4 * WIDTH * (HEIGHT - 1 - y) + i]),
                           1e-5);
    gl->ClipControl(GL_LOWER_LEFT, GL_NEGATIVE_ONE_TO_ONE);
    close_stage(&s);
}

/* Far from the origin: the same picture, moved by 2^14 m, which costs floats 11 of 24 bits. */
static void far_away(gl_rig *rig) {
    const scatter_quality q = quality_of(SCATTER_DEPTH_CLOSED, 32);
    const float shift = 16384.0f;
    static float rgb[3 * PIXELS];
    static picture p;
    check_world w;
    camera c = make_camera(PLAIN);
    scatter_gl_view v;
    stage s;
    int i;
    open_puffs(&w);
    open_stage(&s, rig);
    render(&s, &w, &c, &q, rgb, NULL);
    for (i = 0; i < 3; i++)
        w.gaussians[i].center.x += shift;
    w.lights[0].position.x += shift;
    for (i = 0; i < 3; i++)
        c.view[12 + i] -= shift * c.view[i];
    put_world(&s, &w, NULL, &q, NULL);
    v = view_of(&s, &c);
    draw(&s, &v, &p);
    assert_at_most(compare(&p, rgb), 1.5 * 16384.0 * 6e-8 * 8); /* steepness of the picture: 8 per metre */
    close_stage(&s);
}

/* A NaN in the depth buffer is sky, and stays in its pixel. */
static void nan_in_depth(gl_rig *rig) {
    const scatter_quality q = quality_of(SCATTER_DEPTH_CLOSED, 16);
    const camera c = make_camera(PLAIN);
    static float values[PIXELS];
    static picture sky, holes;
    scatter_gl_view v;
    check_world w;
    stage s;
    int i;
    open_puffs(&w);
    open_stage(&s, rig);
    put_world(&s, &w, NULL, &q, NULL);
    v = view_of(&s, &c);
    draw(&s, &v, &sky);
    for (i = 0; i < PIXELS; i++)
        values[i] = i % 7 == 0 ? NAN : i % 7 == 1 ? INFINITY : i % 7 == 2 ? -1.0f : 1.0f;
    s.depth = make_texture(&rig->host.gl, GL_R32F, WIDTH, HEIGHT, GL_RED, values);
    for (v.divide = 1; v.divide <= 4; v.divide *= 2) {
        v.depth_texture = 0;
        draw(&s, &v, &sky);
        v.depth_texture = s.depth;
        draw(&s, &v, &holes);
        assert_memory_equal(&sky, &holes, sizeof sky);
    }
    close_stage(&s);
}

/* Lights of all kinds in two batches; alone, with the eye's depth in the volumes, and with their own depth volumes. */
static void many_lights(gl_rig *rig) {
    static const scatter_vec3 places[] = {{1.6f, 2.0f, 0.8f}, {-2, 1, 1},  {0, 2.5f, 0.3f},
                                          {0.2f, 0.1f, 0.3f}, {1, 1.5f, 2}, {-1, 2, -1}};
    const scatter_light_kind kinds[] = {SCATTER_LIGHT_POINT,       SCATTER_LIGHT_SPOT,
                                        SCATTER_LIGHT_DIRECTIONAL, SCATTER_LIGHT_POINT,
                                        SCATTER_LIGHT_DIRECTIONAL, SCATTER_LIGHT_SPOT};
    const camera c = make_camera(PLAIN);
    static float rgb[3 * PIXELS];
    static picture p;
    check_world w;
    scatter_gl_view v;
    stage s;
    int i;
    open_puffs(&w);
    w.scene.light_count = 0;
    for (i = 0; i < 6; i++) {
        scatter_light *l = check_add_light(&w, kinds[i], places[i], check_v3(4, 3, 5));
        l->radius = 0.05f;
        l->direction = scatteri_scale(places[i], -1.0f);
        l->inner = 0.2f;
        l->outer = 0.4f;
    }
    open_stage(&s, rig);
    put_plane(&s, &c, -0.4f);
    v = view_of(&s, &c);
    for (i = 0; i < 3; i++) {
        const scatter_depth_method methods[] = {SCATTER_DEPTH_CLOSED, SCATTER_DEPTH_CLOSED_VOLUME,
                                                SCATTER_DEPTH_POLAR};
        const scatter_quality q = quality_of(methods[i], 32);
        put_world(&s, &w, NULL, &q, NULL);
        draw(&s, &v, &p);
        render(&s, &w, &c, &q, rgb, NULL);
        assert_at_most(compare(&p, rgb), methods[i] == SCATTER_DEPTH_POLAR ? OTHER_VALUES : SAME);
    }
    { /* a volume of the eye's depth is off by 0.4 % of the picture at 64^3 (numerics of the methods), not the same */
        const scatter_quality q = quality_of(SCATTER_DEPTH_CLOSED_VOLUME, 32);
        const scatter_vec3 eye = {0.9f, 1.1f, 4.0f};
        put_world(&s, &w, NULL, &q, &eye);
        draw(&s, &v, &p);
        render(&s, &w, &c, &q, rgb, NULL);
        assert_at_most(compare(&p, rgb), 5e-3);
        assert_at_least(compare(&p, rgb), 1e-6);
    }
    close_stage(&s);
}

/* One layer of voxels is still a volume: even voxels, whose density has no error on either side. */
static void flat_grid(gl_rig *rig) {
    const scatter_box box = {{-1.5f, -0.6f, -0.5f}, {1.5f, 0.8f, 0.4f}};
    const scatter_quality q = quality_of(SCATTER_DEPTH_POLAR, 64);
    const camera c = make_camera(PLAIN);
    static float rgb[3 * PIXELS];
    static picture p;
    scatter_gl_view v;
    check_world w;
    stage s;
    int i;
    open_puffs(&w);
    w.scene.medium.gaussian_count = 0;
    check_add_grid(&w, 3, 2, 1, box, 1);
    for (i = 0; i < 6; i++)
        w.voxels[0][i] = 1.2f;
    open_stage(&s, rig);
    put_world(&s, &w, NULL, &q, NULL);
    v = view_of(&s, &c);
    draw(&s, &v, &p);
    render(&s, &w, &c, &q, rgb, NULL);
    assert_at_most(compare(&p, rgb), 2e-3);
    close_stage(&s);
}

/* Constant and height fog to the horizon, between ground and sky, in bounds and without. */
static void fog_to_the_horizon(gl_rig *rig) {
    const scatter_quality q = quality_of(SCATTER_DEPTH_AUTO, 32);
    static float rgb[3 * PIXELS];
    static picture p;
    check_world w;
    stage s;
    int bounded;
    for (bounded = 0; bounded < 2; bounded++) {
        const camera c = make_camera(PLAIN);
        scatter_gl_view v;
        check_world_open(&w);
        w.scene.medium.extinction = check_v3(0.02f, 0.03f, 0.05f);
        w.scene.medium.albedo = check_v3(0.9f, 0.9f, 0.9f);
        check_add_height(&w, 2.0f, -0.4f, 3.0f);
        w.scene.medium.constant = bounded ? 1.0f : 0.0f;
        if (bounded)
            check_bound(&w, check_cube(-6.0f, 6.0f));
        check_add_light(&w, SCATTER_LIGHT_DIRECTIONAL, check_v3(0, 0, 0), check_v3(3, 2, 1));
        w.lights[0].direction = check_v3(0.3f, -1, 0.2f);
        check_add_light(&w, SCATTER_LIGHT_POINT, check_v3(0.3f, 0.4f, 0.2f), check_v3(3, 2, 1));
        open_stage(&s, rig);
        put_plane(&s, &c, -0.4f);
        put_world(&s, &w, NULL, &q, NULL);
        v = view_of(&s, &c);
        draw(&s, &v, &p);
        render(&s, &w, &c, &q, rgb, NULL);
        assert_at_most(compare(&p, rgb), SAME);
        close_stage(&s);
    }
}

/* --- shadow maps --- */

static int lit_right(void *user, scatter_vec3 p, scatter_vec3 q) {
    (void)user;
    (void)q;
    return p.x > 0.1f;
}

/* A wall that stops everything on one side of x = 0.1: maps hold 0 there and 1 elsewhere. */
static GLuint wall_map(const gl_functions *gl, scatter_gl_shadow_kind kind) {
    enum { SIDE = 256, SPLIT = 128 };
    static float texels[SIDE * SIDE];
    const GLenum target = kind == SCATTER_GL_SHADOW_2D ? GL_TEXTURE_2D : GL_TEXTURE_2D_ARRAY;
    GLuint name;
    int i;
    for (i = 0; i < SIDE * SIDE; i++)
        texels[i] = i % SIDE < SPLIT ? 0.0f : 1.0f;
    gl->GenTextures(1, &name);
    gl->BindTexture(target, name);
    if (kind == SCATTER_GL_SHADOW_2D) {
        gl->TexImage2D(target, 0, GL_R32F, SIDE, SIDE, 0, GL_RED, GL_FLOAT, texels);
    } else {
        gl->TexImage3D(target, 0, GL_R32F, SIDE, SIDE, 3, 0, GL_RED, GL_FLOAT, NULL);
        for (i = 1; i < 3; i++)
            gl->TexSubImage3D(target, 0, 0, 0, i, SIDE, SIDE, 1, GL_RED, GL_FLOAT, texels);
    }
    gl->BindTexture(target, 0);
    return name;
}

/* World x from 0.1 - reach to 0.1 + reach is u from 0 to 1; everything is at v = z = 0.5. */
static void flatten(float *m, float reach) {
    memset(m, 0, 16 * sizeof(float));
    m[0] = 0.5f / reach;
    m[12] = 0.5f - 0.1f * 0.5f / reach;
    m[13] = m[14] = 0.5f;
    m[15] = 1.0f;
}

static void flat_shadow_maps(gl_rig *rig) {
    const scatter_gl_shadow_kind kinds[] = {SCATTER_GL_SHADOW_2D, SCATTER_GL_SHADOW_ARRAY};
    const scatter_quality q = quality_of(SCATTER_DEPTH_CLOSED, 32);
    const camera c = make_camera(PLAIN);
    static float rgb[3 * PIXELS], dark[3 * PIXELS];
    static picture p;
    int i;
    for (i = 0; i < 2; i++) {
        scatter_gl_shadow shadow;
        scatter_gl_view v;
        check_world w;
        stage s;
        memset(&shadow, 0, sizeof shadow);
        open_puffs(&w);
        open_stage(&s, rig);
        shadow.kind = kinds[i];
        shadow.texture = wall_map(&rig->host.gl, kinds[i]);
        shadow.layer = i;
        shadow.cascades = 2 * i;
        flatten(shadow.matrix[0], i == 0 ? 8.0f : 0.6f); /* the first cascade is too small */
        flatten(shadow.matrix[1], 8.0f);
        put_plane(&s, &c, -0.4f);
        put_world(&s, &w, &shadow, &q, NULL);
        v = view_of(&s, &c);
        draw(&s, &v, &p);
        render(&s, &w, &c, &q, rgb, NULL);
        assert_at_least(compare(&p, rgb), 0.02); /* without the wall it is another picture */
        w.scene.visible = lit_right;
        render(&s, &w, &c, &q, dark, NULL);
        assert_at_most(compare(&p, dark), SAME);
        shadow.reversed = 1; /* nothing is in front of 0, and 1 is in front of everything */
        put_world(&s, &w, &shadow, &q, NULL);
        draw(&s, &v, &p);
        assert_at_least(compare(&p, dark), 0.02);
        rig->host.gl.DeleteTextures(1, &shadow.texture);
        close_stage(&s);
    }
}

static int lit_not_above(void *user, scatter_vec3 p, scatter_vec3 q) {
    const scatter_vec3 d = check_minus(p, q);
    (void)user; /* the face below the light is blocked beyond 1 m */
    return !(-d.y > fabsf(d.x) && -d.y > fabsf(d.z) && -d.y > 1.0f);
}

/* A cube whose lower face holds a wall 1 m from the light, as perspective depth and as distance. */
static void cube_shadow_map(gl_rig *rig) {
    const gl_functions *gl = &rig->host.gl;
    const scatter_quality q = quality_of(SCATTER_DEPTH_CLOSED, 32);
    const camera c = make_camera(PLAIN);
    static float rgb[3 * PIXELS], texels[64 * 64];
    static picture p;
    scatter_gl_shadow shadow;
    scatter_gl_view v;
    check_world w;
    stage s;
    int face, i;
    open_puffs(&w);
    open_stage(&s, rig);
    memset(&shadow, 0, sizeof shadow);
    shadow.kind = SCATTER_GL_SHADOW_CUBE;
    shadow.z_near = 0.1f;
    shadow.z_far = 50.0f;
    gl->GenTextures(1, &shadow.texture);
    gl->BindTexture(GL_TEXTURE_CUBE_MAP, shadow.texture);
    for (face = 0; face < 6; face++) {
        for (i = 0; i < 64 * 64; i++)
            texels[i] = face == 3 ? 50.0f * (1.0f - 0.1f) / (1.0f * (50.0f - 0.1f)) : 1.0f;
        gl->TexImage2D(GL_TEXTURE_CUBE_MAP_POSITIVE_X + (GLenum)face, 0, GL_R32F, 64, 64, 0, GL_RED,
                       GL_FLOAT, texels);
    }
    gl->BindTexture(GL_TEXTURE_CUBE_MAP, 0);
    put_plane(&s, &c, -0.4f);
    put_world(&s, &w, &shadow, &q, NULL);
    v = view_of(&s, &c);
    draw(&s, &v, &p);
    w.scene.visible = lit_not_above;
    render(&s, &w, &c, &q, rgb, NULL);
    assert_at_most(compare(&p, rgb), SAME);
    w.scene.visible = NULL;
    render(&s, &w, &c, &q, rgb, NULL);
    assert_at_least(compare(&p, rgb), 0.02);
    gl->DeleteTextures(1, &shadow.texture);
    close_stage(&s);
}

/* --- targets --- */

/* Two eyes side by side in one framebuffer; what lies between them stays as it was. */
static void two_views_in_one_target(gl_rig *rig) {
    enum { HALF = 16, GAP = WIDTH - 2 * HALF };
    const scatter_quality q = quality_of(SCATTER_DEPTH_CLOSED, 16);
    const camera c = make_camera(PLAIN);
    static picture both, left;
    scatter_gl_view v;
    check_world w;
    stage s;
    int x, y;
    open_puffs(&w);
    open_stage(&s, rig);
    put_world(&s, &w, NULL, &q, NULL);
    v = view_of(&s, &c);
    v.width = HALF;
    draw(&s, &v, &left);
    v.x = HALF + GAP;
    assert_int_equal(scatter_gl_draw(s.fog, &v), SCATTER_OK);
    rig->host.gl.ReadPixels(0, 0, WIDTH, HEIGHT, GL_RGBA, GL_FLOAT, both.rgba);
    for (y = 0; y < HEIGHT; y++) {
        const float *row = both.rgba + 4 * y * WIDTH;
        assert_memory_equal(row, left.rgba + 4 * y * WIDTH, 4 * HALF * sizeof(float));
        assert_memory_equal(row, row + 4 * (HALF + GAP), 4 * HALF * sizeof(float));
        for (x = HALF; x < HALF + GAP; x++)
            assert_memory_equal(row + 4 * x, s.scene, 3 * sizeof(float));
    }
    close_stage(&s);
}

/* Premultiplied alpha: 1 - T over a clear target, and over one that was 1/4 opaque. */
static void alpha_is_opacity(gl_rig *rig) {
    const scatter_quality q = quality_of(SCATTER_DEPTH_CLOSED, 16);
    const camera c = make_camera(PLAIN);
    static float rgb[3 * PIXELS], through[3 * PIXELS];
    static picture p;
    scatter_gl_view v;
    check_world w;
    stage s;
    int gray, x, y;
    for (gray = 0; gray < 2; gray++) {
        open_puffs(&w);
        if (gray)
            w.scene.medium.extinction = check_v3(1, 1, 1);
        open_stage(&s, rig);
        put_world(&s, &w, NULL, &q, NULL);
        v = view_of(&s, &c);
        draw(&s, &v, &p);
        render(&s, &w, &c, &q, rgb, through);
        for (y = 0; y < HEIGHT; y++)
            for (x = 0; x < WIDTH; x++) {
                const float *t = through + 3 * ((HEIGHT - 1 - y) * WIDTH + x);
                const float mean = (t[0] + t[1] + t[2]) / 3.0f;
                const float alpha = 1.0f - mean * (1.0f - 0.25f);
                assert_at_most(fabsf(p.rgba[4 * (y * WIDTH + x) + 3] - alpha), 1e-5);
            }
        close_stage(&s);
    }
}

/* A multisampled target holds the same fog in every sample. */
static void multisampled_target(gl_rig *rig) {
    const gl_functions *gl = &rig->host.gl;
    const scatter_quality q = quality_of(SCATTER_DEPTH_CLOSED, 16);
    const camera c = make_camera(PLAIN);
    static picture p, resolved;
    GLuint framebuffer, buffer;
    scatter_gl_view v;
    check_world w;
    stage s;
    int i;
    open_puffs(&w);
    open_stage(&s, rig);
    put_world(&s, &w, NULL, &q, NULL);
    v = view_of(&s, &c);
    draw(&s, &v, &p);
    gl->GenRenderbuffers(1, &buffer);
    gl->BindRenderbuffer(GL_RENDERBUFFER, buffer);
    gl->RenderbufferStorageMultisample(GL_RENDERBUFFER, 4, GL_RGBA16F, WIDTH, HEIGHT);
    gl->GenFramebuffers(1, &framebuffer);
    gl->BindFramebuffer(GL_FRAMEBUFFER, framebuffer);
    gl->FramebufferRenderbuffer(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_RENDERBUFFER, buffer);
    assert_int_equal(gl->CheckFramebufferStatus(GL_FRAMEBUFFER), GL_FRAMEBUFFER_COMPLETE);
    gl->ClearColor(s.scene[0], s.scene[1], s.scene[2], 0.25f);
    gl->Clear(GL_COLOR_BUFFER_BIT);
    v.framebuffer = framebuffer;
    assert_int_equal(scatter_gl_draw(s.fog, &v), SCATTER_OK);
    gl->DeleteTextures(1, &s.color); /* resolving asks for the same format */
    s.color = make_texture(gl, GL_RGBA16F, WIDTH, HEIGHT, GL_RGBA, NULL);
    gl->BindFramebuffer(GL_FRAMEBUFFER, s.framebuffer);
    gl->FramebufferTexture2D(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_TEXTURE_2D, s.color, 0);
    gl->BindFramebuffer(GL_READ_FRAMEBUFFER, framebuffer);
    gl->BlitFramebuffer(0, 0, WIDTH, HEIGHT, 0, 0, WIDTH, HEIGHT, GL_COLOR_BUFFER_BIT, GL_NEAREST);
    gl->BindFramebuffer(GL_FRAMEBUFFER, s.framebuffer);
    gl->ReadPixels(0, 0, WIDTH, HEIGHT, GL_RGBA, GL_FLOAT, resolved.rgba);
    for (i = 0; i < 4 * PIXELS; i++) /* three cuts to 11 bits: cleared, times T, plus L */
        assert_at_most(fabsf(resolved.rgba[i] - p.rgba[i]), 3 * 0x1p-10 * p.rgba[i]);
    gl->DeleteFramebuffers(1, &framebuffer);
    gl->DeleteRenderbuffers(1, &buffer);
    close_stage(&s);
}

/* Half and quarter resolution: smooth fog is interpolated, and surfaces at other distances do not bleed. */
static void reduced_resolution(gl_rig *rig) {
    const scatter_quality q = quality_of(SCATTER_DEPTH_CLOSED, 16);
    const camera c = make_camera(PLAIN);
    static float rgb[3 * PIXELS];
    static picture p;
    double error[2][3];
    scatter_gl_view v;
    check_world w;
    stage s;
    int plane, i;
    open_puffs(&w);
    open_stage(&s, rig);
    put_world(&s, &w, NULL, &q, NULL);
    for (plane = 0; plane < 2; plane++) {
        if (plane)
            put_plane(&s, &c, 0.3f);
        v = view_of(&s, &c);
        render(&s, &w, &c, &q, rgb, NULL);
        for (i = 0; i < 3; i++) {
            v.divide = 1 << i;
            draw(&s, &v, &p);
            error[plane][i] = compare(&p, rgb);
        }
        assert_at_most(error[plane][0], 10 * SAME);
    }
    /* Between values h apart a line misses a Gaussian's peak by (a h)^2/4 of it: 4 % at 2 pixels of 0.1 m for a = 2/m.
       At the edge of the plane up to one row of pixels finds no neighbour on its own side. */
    assert_at_most(error[0][1], 0.04);
    assert_at_least(check_order(error[0][2], error[0][1]), 1.5);
    assert_at_most(error[1][1], 0.04);
    assert_at_most(error[1][2], 0.16);
    close_stage(&s);
}

/* --- empty space --- */

/* Voxels that are mostly empty: a ball, a bar and a lone one in a box whose voxels are not cubes. */
static void add_sparse_grid(check_world *w) {
    enum { NX = 14, NY = 10, NZ = 8 };
    const scatter_box box = {{-1.4f, -0.8f, -1.1f}, {1.5f, 1.0f, 0.9f}};
    scatter_grid *g = check_add_grid(w, NX, NY, NZ, box, 1);
    float *v = w->voxels[g - w->grids];
    int i, j, k;
    for (k = 0; k < NZ; k++)
        for (j = 0; j < NY; j++)
            for (i = 0; i < NX; i++) {
                const int r2 = (i - 4) * (i - 4) + (j - 4) * (j - 4) + (k - 3) * (k - 3);
                const int bar = j == 8 && k == 5 && i > 3, lone = i == 11 && j == 2 && k == 2;
                v[(k * NY + j) * NX + i] = r2 <= 5 ? 6.0f - (float)r2 : bar || lone ? 3.0f : 0.0f;
            }
    g->scale = 0.7f;
}

/* What lies beside the voxels. */
typedef enum beside { NOTHING, COLOR, PUFFS, FOG, BESIDES } beside;

/* Six lights, which are two batches. */
static void open_voxels(check_world *w, beside what) {
    const scatter_light_kind kinds[] = {SCATTER_LIGHT_DIRECTIONAL, SCATTER_LIGHT_POINT, SCATTER_LIGHT_SPOT};
    int i;
    check_world_open(w);
    add_sparse_grid(w);
    if (what == COLOR)
        w->scene.medium.extinction = check_v3(0.8f, 1.0f, 1.3f);
    if (what == PUFFS) {
        check_add_gaussian(w, check_v3(0.5f, 0.5f, 0.5f), 2.0f, 1.0f);
        check_add_gaussian(w, check_v3(-2.0f, 0.5f, 0.5f), 2.5f, 2.0f);
    }
    if (what == FOG)
        check_add_height(w, 0.2f, -0.4f, 0.5f);
    for (i = 0; i < 6; i++) {
        scatter_light *l = check_add_light(w, kinds[i % 3], check_v3(1.0f - 0.4f * (float)i, 1.8f, 1.0f),
                                           check_v3(4, 3, 5));
        l->direction = check_v3(-0.2f * (float)i, -1.0f, 0.3f);
        l->inner = 0.3f;
        l->outer = 0.6f;
    }
}

/* Largest difference of two pictures over the largest value. */
static double most_off(const picture *a, const picture *b) {
    double off = 0, most = 0;
    int i;
    for (i = 0; i < 4 * PIXELS; i++) {
        const double miss = fabs((double)a->rgba[i] - (double)b->rgba[i]);
        if (!(miss <= off))
            off = miss;
        most = fmax(most, fabs((double)a->rgba[i]));
    }
    return off / most;
}

/* The picture with everything that skips, and how far those without the mask, without the distance map and without both
   are from it at most. */
static double skipping_error(stage *s, const check_world *w, scatter_quality q, const scatter_gl_view *v,
                             picture *skipped) {
    static picture p;
    double worst = 0;
    int what;
    for (what = 0; what < 4; what++) {
        q.no_mask = what & 1;
        q.no_distance_map = what >> 1;
        put_world(s, w, NULL, &q, NULL);
        draw(s, v, what == 0 ? skipped : &p);
        if (what > 0)
            worst = fmax(worst, most_off(&p, skipped));
    }
    return worst;
}

/* Ways to render a grid. */
static const struct {
    scatter_depth_method depth;
    scatter_density_method density;
    scatter_ray_method ray;
    int nodes;
} voxel_ways[] = {{SCATTER_DEPTH_CLOSED, SCATTER_DENSITY_EXACT, SCATTER_RAY_MARCH, 50},
                  {SCATTER_DEPTH_CLOSED, SCATTER_DENSITY_EXACT, SCATTER_RAY_QUADRATURE, 9},
                  {SCATTER_DEPTH_POLAR, SCATTER_DENSITY_EXACT, SCATTER_RAY_MARCH, 90},
                  {SCATTER_DEPTH_POLAR, SCATTER_DENSITY_VOLUME, SCATTER_RAY_MARCH, 60},
                  {SCATTER_DEPTH_POLAR, SCATTER_DENSITY_VOLUME, SCATTER_RAY_QUADRATURE, 12}};

enum { WAYS = CHECK_COUNT(voxel_ways) };

static scatter_quality voxel_quality(int way) {
    scatter_quality q = quality_of(voxel_ways[way].depth, voxel_ways[way].nodes);
    q.density = voxel_ways[way].density;
    q.ray = voxel_ways[way].ray;
    q.grid = 24;
    return q;
}

/* Neither mask nor distance map changes a picture, whatever else there is: what they leave out is 0. Every context takes
   a quarter of the combinations, since each of them compiles a dozen shaders. */
static void nothing_is_lost(gl_rig *rig) {
    static int turn;
    const camera c = make_camera(OFF_AXIS);
    static picture p;
    scatter_gl_view v;
    check_world w;
    stage s;
    int what, way;
    turn++;
    open_stage(&s, rig);
    put_plane(&s, &c, -0.4f);
    v = view_of(&s, &c);
    for (what = NOTHING; what < BESIDES; what++)
        for (way = (turn + what) % 4; way < WAYS; way += 4) {
            const scatter_quality q = voxel_quality(way);
            open_voxels(&w, (beside)what);
            for (v.divide = 1; v.divide <= 2; v.divide++)
                assert_at_most(skipping_error(&s, &w, q, &v, &p), 1e-6);
        }
    close_stage(&s);
}

/* The same in clouds and smoke as they come from simulators. */
static void nothing_is_lost_in_real_volumes(gl_rig *rig) {
    static const char *const paths[] = {"../shared/data/volumes/wdas_cloud_sixteenth_126x86x154_u8.raw",
                                        "../shared/data/volumes/ispc_smoke_48x64x48.vol.txt",
                                        "../shared/data/volumes/cuda_bucky_32x32x32_u8.raw"};
    const camera c = make_camera(PLAIN);
    static picture p;
    scatter_gl_view v;
    check_world w;
    stage s;
    size_t i;
    open_stage(&s, rig);
    v = view_of(&s, &c);
    for (i = 0; i < CHECK_COUNT(paths); i++) {
        scatter_quality q = voxel_quality(0);
        file_error error;
        file_grid voxels;
        if (file_grid_read(paths[i], &voxels, &error)) {
            printf("  skipped: no data: %s\n", paths[i]);
            continue;
        }
        q.nodes = 24; /* turns of loops on llvmpipe: see scatter_gl.h */
        open_voxels(&w, NOTHING);
        w.grids[0].density = voxels.density;
        w.grids[0].nx = voxels.nx;
        w.grids[0].ny = voxels.ny;
        w.grids[0].nz = voxels.nz;
        w.grids[0].scale = 4.0f;
        w.grids[0].version = (unsigned)i;
        assert_at_most(skipping_error(&s, &w, q, &v, &p), 1e-6);
        free(voxels.density);
    }
    close_stage(&s);
}

/* Draws with the mask that is there. */
static void draw_with_stale_mask(stage *s, const scatter_gl_view *v, picture *out) {
    scatter_gl *f = s->fog;
    scatteri_gl_state state;
    scatteri_gl_save(f, &state);
    assert_int_equal(scatteri_gl_check_view(f, v), SCATTER_OK);
    scatteri_gl_bind_scene(f, v);
    scatteri_gl_send_view(f, v, 1);
    scatteri_gl_read_texels(f, SCATTERI_GL_UNIT_BEFORE, &f->mask);
    scatteri_gl_target_host(f, v);
    s->rig->host.gl.Clear(GL_COLOR_BUFFER_BIT);
    assert_int_equal(scatteri_gl_draw_radiance(f, scatteri_gl_medium_features(f), 1,
                                               SCATTERI_GL_ONE_MINUS_SRC_ALPHA),
                     SCATTER_OK);
    scatteri_gl_restore(f, &state);
    s->rig->host.gl.BindFramebuffer(GL_FRAMEBUFFER, s->framebuffer);
    s->rig->host.gl.ReadPixels(0, 0, WIDTH, HEIGHT, GL_RGBA, GL_FLOAT, out->rgba);
}

/* Planted: distances a voxel too large, and the mask of another camera. */
static void lost_voxels_are_seen(gl_rig *rig) {
    const camera c = make_camera(PLAIN), other = make_camera(PARALLEL);
    const scatter_quality q = voxel_quality(0);
    static picture right, wrong;
    scatter_gl_view v, aside;
    check_world w;
    stage s;
    open_stage(&s, rig);
    open_voxels(&w, NOTHING);
    put_world(&s, &w, NULL, &q, NULL);
    v = view_of(&s, &c);
    aside = view_of(&s, &other);
    draw(&s, &v, &right);
    draw_with_stale_mask(&s, &v, &wrong);
    assert_true(most_off(&right, &wrong) == 0); /* it is this camera's */
    draw(&s, &aside, &wrong);
    draw_with_stale_mask(&s, &v, &wrong);
    assert_at_least(most_off(&right, &wrong), 1e-2);
    s.fog->medium_block.field_max[3] -= s.fog->medium_block.field_per[3];
    scatteri_gl_send(s.fog, s.fog->medium_buffer, &s.fog->medium_block, sizeof s.fog->medium_block);
    draw(&s, &v, &wrong);
    assert_at_least(most_off(&right, &wrong), 1e-3);
    close_stage(&s);
}

/* Rays to the lights, in steps of half a voxel, against those of scatter.h, which are exact in each cell. Between voxels
   that jump from 0 to their neighbour's value, middle values err by up to h^2/24 of the second derivative at each corner
   of the density: 1.2e-3 of the picture is measured. */
static void rays_through_voxels(gl_rig *rig) {
    const camera c = make_camera(PLAIN);
    static float rgb[3 * PIXELS];
    static picture p;
    scatter_gl_view v;
    check_world w;
    stage s;
    int what;
    open_stage(&s, rig);
    put_plane(&s, &c, -0.4f);
    v = view_of(&s, &c);
    for (what = 0; what < BESIDES; what++) {
        scatter_quality q = voxel_quality(what % 2);
        q.nodes = what % 2 == 0 ? 200 : 48;
        open_voxels(&w, (beside)what);
        put_world(&s, &w, NULL, &q, NULL);
        draw(&s, &v, &p);
        render(&s, &w, &c, &q, rgb, NULL);
        assert_at_most(compare(&p, rgb), 2e-3);
        w.grids[0].scale *= 1.3f; /* planted */
        render(&s, &w, &c, &q, rgb, NULL);
        assert_at_least(compare(&p, rgb), 5e-3);
    }
    close_stage(&s);
}

/* --- the host's own shaders --- */

/* Draws with a fragment shader of the host's that begins with the surface text; uniforms: 4 vec4, or 4 SKY of them. */
static void run_surface_with(stage *s, const char *body, int count, const float *uniforms,
                             picture *out) {
    const gl_functions *gl = &s->rig->host.gl;
    const char *vertex[] = {s->rig->context.es ? "#version 300 es\n" : "#version 330\n",
                            "void main() { vec2 c = vec2(float((gl_VertexID << 1) & 2), "
                            "float(gl_VertexID & 2)); gl_Position = vec4(c * 2.0 - 1.0, 0.0, 1.0); }"};
    const char *fragment[] = {vertex[0], scatter_gl_surface_glsl(s->fog),
                              count > 4 ? "uniform vec4 given[256]; out vec4 color;\n"
                                        : "uniform vec4 given[4]; out vec4 color;\n",
                              body};
    const GLuint program = gl->CreateProgram();
    GLuint shaders[2], array;
    GLint done = 0;
    int i;
    assert_true(fragment[1] != NULL);
    for (i = 0; i < 2; i++) {
        char said[512] = "";
        shaders[i] = gl->CreateShader(i ? GL_FRAGMENT_SHADER : GL_VERTEX_SHADER);
        gl->ShaderSource(shaders[i], i ? 4 : 2, i ? fragment : vertex, NULL);
        gl->CompileShader(shaders[i]);
        gl->GetShaderiv(shaders[i], GL_COMPILE_STATUS, &done);
        gl->GetShaderInfoLog(shaders[i], sizeof said, NULL, said);
        if (!done)
            fprintf(stderr, "%s\n", said);
        assert_true(done);
        gl->AttachShader(program, shaders[i]);
    }
    gl->LinkProgram(program);
    assert_int_equal(scatter_gl_bind_surface(s->fog, program, 3, 5), SCATTER_OK);
    gl->UseProgram(program);
    gl->Uniform4fv(gl->GetUniformLocation(program, "given"), count, uniforms);
    gl->GenVertexArrays(1, &array);
    gl->BindVertexArray(array);
    gl->BindFramebuffer(GL_FRAMEBUFFER, s->framebuffer);
    gl->Viewport(0, 0, WIDTH, HEIGHT);
    gl->DrawArrays(GL_TRIANGLES, 0, 3);
    gl->ReadPixels(0, 0, WIDTH, HEIGHT, GL_RGBA, GL_FLOAT, out->rgba);
    assert_int_equal(gl->GetError(), GL_NO_ERROR);
    gl->UseProgram(0);
    gl->BindVertexArray(0);
    gl->DeleteVertexArrays(1, &array);
    gl->DeleteProgram(program);
    for (i = 0; i < 2; i++)
        gl->DeleteShader(shaders[i]);
}

static void run_surface(stage *s, const char *body, const float *uniforms, picture *out) {
    run_surface_with(s, body, 4, uniforms, out);
}

/* T between points on a plane and each of six lights, in two batches, equals that of scatter.h. */
static void light_on_surfaces(gl_rig *rig) {
    const scatter_depth_method methods[] = {SCATTER_DEPTH_CLOSED, SCATTER_DEPTH_CLOSED_VOLUME,
                                            SCATTER_DEPTH_POLAR};
    static picture p;
    check_world w;
    stage s;
    int m, light, i;
    open_puffs(&w);
    w.scene.medium.constant = 0.05f;
    check_bound(&w, check_cube(-3.0f, 3.0f));
    for (i = 1; i < 6; i++) {
        scatter_light *l = check_add_light(&w, i % 2 ? SCATTER_LIGHT_DIRECTIONAL : SCATTER_LIGHT_POINT,
                                           check_v3(-1.5f, 1.0f, 0.4f * (float)i), check_v3(1, 1, 1));
        l->direction = check_v3(0.5f, -1.0f, 0.1f * (float)i);
    }
    open_stage(&s, rig);
    for (m = 0; m < 3; m++)
        for (light = 0; light < 6; light += 5) {
            const scatter_quality q = quality_of(methods[m], 0);
            float given[16] = {0};
            scatter_depth *depth = NULL;
            const scatter_source source = scatteri_source_of(&w.lights[light]);
            put_world(&s, &w, NULL, &q, NULL);
            given[0] = (float)light;
            run_surface(&s,
                        "void main() { color = vec4(scatter_light_transmittance(int(given[0].x), "
                        "vec3(gl_FragCoord.x * 0.1 - 2.0, -0.8, gl_FragCoord.y * 0.1 - 1.5)), 1.0); }",
                        given, &p);
            assert_int_equal(scatter_depth_create(NULL, &depth), SCATTER_OK);
            assert_int_equal(scatter_depth_update(depth, &w.scene.medium, &source, &q), SCATTER_OK);
            for (i = 0; i < PIXELS; i++) {
                const scatter_vec3 x = {((float)(i % WIDTH) + 0.5f) * 0.1f - 2.0f, -0.8f,
                                        ((float)(i / WIDTH) + 0.5f) * 0.1f - 1.5f};
                const float tau = scatter_depth_at(depth, x);
                assert_at_most(fabs((double)p.rgba[4 * i + 1] - exp(-(double)tau)),
                               source.directional && methods[m] == SCATTER_DEPTH_POLAR
                                   ? 2 * OTHER_VALUES * 2.2 /* the deepest Gaussian */
                                   : 2e-5);
            }
            scatter_depth_destroy(depth);
        }
    close_stage(&s);
}

/* --- constellations --- */

/* `count` directional lights from all over the sky, turned about the vertical. */
static void fill_sky(scatter_gl_light *lights, int count, float angle) {
    int i;
    memset(lights, 0, (size_t)count * sizeof *lights);
    for (i = 0; i < count; i++) {
        const float height = ((float)i + 0.5f) / (float)count, turn = 2.4f * (float)i + angle;
        const float flat = sqrtf(1.0f - height * height);
        scatter_light *l = &lights[i].light;
        l->kind = SCATTER_LIGHT_DIRECTIONAL;
        l->direction = check_v3(-flat * cosf(turn), -height, -flat * sinf(turn));
        l->intensity = check_v3(9.0f / (float)count, (float)(i % 5) / (float)count, 0.1f);
    }
}

static void put_sky(stage *s, int count, float angle) {
    scatter_gl_light lights[SKY];
    fill_sky(lights, count, angle);
    assert_int_equal(scatter_gl_set_lights(s->fog, lights, (size_t)count), SCATTER_OK);
}

/* Lambert and Phong: given[2 i] and given[2 i + 1] are the direction towards light i, how many, and what it sends. */
static const char under_a_sky[] =
    "void main() {\n"
    "    vec3 x = vec3(gl_FragCoord.x * 0.1 - 2.0, -0.8, gl_FragCoord.y * 0.1 - 1.5);\n"
    "    vec3 n = normalize(vec3(0.2, 1.0, 0.1)), mirror = reflect(vec3(0.0, -1.0, 0.0), n), sum = vec3(0.0);\n"
    "    for (int i = 0; i < int(given[0].w); i++) {\n"
    "        vec3 to = given[2 * i].xyz;\n"
    "        float gloss = 17.0 / 6.2831853 * pow(max(dot(mirror, to), 1e-30), 15.0);\n"
    "        vec3 brdf = vec3(0.5, 0.4, 0.3) / 3.14159265 + 0.2 * gloss;\n"
    "        sum += max(dot(n, to), 0.0) * brdf * given[2 * i + 1].xyz * scatter_light_transmittance(i, x);\n"
    "    }\n"
    "    color = vec4(sum, 1.0);\n"
    "}\n";

/* Largest difference of the host's shading from that of scatter.h. */
static double sky_difference(stage *s, check_world *w, const scatter_quality *q, int count) {
    const scatter_surface hit = {1.0f, {0.2f, 1, 0.1f}, {0.5f, 0.4f, 0.3f}, {0.2f, 0.2f, 0.2f}, 15};
    static picture p;
    scatter_gl_light sky[SKY];
    scatter_light lights[SKY];
    float given[16 * SKY] = {0};
    scatter_context *context;
    double worst = 0;
    int i;
    fill_sky(sky, count, 0);
    for (i = 0; i < count; i++) {
        const scatter_light *l = &sky[i].light;
        const float row[8] = {-l->direction.x, -l->direction.y, -l->direction.z, (float)count,
                              l->intensity.x,  l->intensity.y,  l->intensity.z,  0};
        lights[i] = *l;
        memcpy(given + 8 * i, row, sizeof row);
    }
    w->scene.lights = lights;
    w->scene.light_count = (size_t)count;
    context = check_open_context(&w->scene, q);
    run_surface_with(s, under_a_sky, 4 * SKY, given, &p);
    for (i = 0; i < PIXELS; i++) {
        const scatter_vec3 from = {((float)(i % WIDTH) + 0.5f) * 0.1f - 2.0f, 0.2f,
                                   ((float)(i / WIDTH) + 0.5f) * 0.1f - 1.5f};
        const scatter_vec3 c = scatteri_shade(context, &hit, from, check_v3(0, -1, 0));
        worst = fmax(worst, fabs((double)(p.rgba[4 * i] - c.x)));
        worst = fmax(worst, fabs((double)(p.rgba[4 * i + 1] - c.y)));
    }
    scatter_destroy(context);
    return worst;
}

/* The host's surfaces under 20 and 64 lights; the batches in one texture, and in four, as where a context has few layers.
   Light of 9 W/m2 through T that is right to 2e-5 (light_on_surfaces), by a BRDF below 2.9/sr. */
static void surfaces_under_a_sky(gl_rig *rig) {
    const double limit = 9 * 2e-5 * 2.9;
    scatter_quality q = quality_of(SCATTER_DEPTH_CLOSED_VOLUME, 0);
    check_world w;
    stage s;
    int turn;
    open_puffs(&w);
    check_bound(&w, check_cube(-3.0f, 3.0f));
    q.grid = 32;
    open_stage(&s, rig);
    assert_int_equal(scatter_gl_set_medium(s.fog, &w.scene.medium), SCATTER_OK);
    for (turn = 0; turn < 4; turn++) {
        const int count = turn % 2 ? SKY : 20;
        if (turn == 2)
            s.fog->max_3d = 128; /* four batches */
        put_sky(&s, count, 0);
        assert_int_equal(scatter_gl_update(s.fog, &q, NULL), SCATTER_OK);
        assert_int_equal(s.fog->volumes[3].name != 0, turn == 3);
        assert_at_most(sky_difference(&s, &w, &q, count), limit);
    }
    put_sky(&s, SKY, 0.1f); /* planted: another sky, and lights that no texture serves */
    assert_int_equal(scatter_gl_update(s.fog, &q, NULL), SCATTER_OK);
    assert_at_least(sky_difference(&s, &w, &q, SKY), 10 * limit);
    put_sky(&s, SKY, 0);
    s.fog->max_3d = 64; /* two batches */
    assert_int_equal(scatter_gl_update(s.fog, &q, NULL), SCATTER_OK);
    assert_at_least(sky_difference(&s, &w, &q, SKY), 10 * limit);
    close_stage(&s);
}

/* The fog is the same however many textures its volumes are in, with lights of all kinds and voxels. */
static void stacks_of_volumes(gl_rig *rig) {
    const camera c = make_camera(PLAIN);
    static const int most[] = {2048, 24, 47, 2048}; /* five batches to a texture, one, two */
    static picture whole, parts;
    scatter_gl_light lights[20];
    scatter_quality q = quality_of(SCATTER_DEPTH_POLAR, 8);
    scatter_gl_view v;
    check_world w;
    stage s;
    int i, k;
    open_puffs(&w);
    check_add_grid(&w, 8, 7, 6, check_cube(-1, 1), 4);
    q.grid = 16;
    open_stage(&s, rig);
    fill_sky(lights, 20, 0);
    for (i = 0; i < 20; i += 3) {
        lights[i].light.kind = i % 2 ? SCATTER_LIGHT_POINT : SCATTER_LIGHT_SPOT;
        lights[i].light.position = scatteri_scale(lights[i].light.direction, -2.0f);
        lights[i].light.outer = 0.8f;
    }
    assert_int_equal(scatter_gl_set_medium(s.fog, &w.scene.medium), SCATTER_OK);
    assert_int_equal(scatter_gl_set_lights(s.fog, lights, 20), SCATTER_OK);
    v = view_of(&s, &c);
    for (i = 0; i < 4; i++) {
        check_error e = check_no_error();
        s.fog->max_3d = most[i];
        q.grid = i == 3 ? 15 : 16; /* planted: other volumes are seen */
        assert_int_equal(scatter_gl_update(s.fog, &q, NULL), SCATTER_OK);
        draw(&s, &v, i == 0 ? &whole : &parts);
        for (k = 0; k < 4 * PIXELS && i > 0; k++)
            check_add(&e, (double)parts.rgba[k], (double)whole.rgba[k]);
        /* A place among 80 layers is rounded to 80 2^-24 of one, over which light changes by less than itself. */
        assert_at_most(i == 1 || i == 2 ? check_relative_rms(&e) : 0, 80.0 / 16777216.0);
        assert_at_least(i == 3 ? check_relative_rms(&e) : 1, 1e-4);
    }
    close_stage(&s);
}

/* The eye's depth is in the volume of every batch. */
static void moving_eye(gl_rig *rig) {
    const scatter_vec3 here = {0.9f, 1.1f, 4.0f}, there = {-3.0f, 0.2f, 1.0f};
    const scatter_quality q = quality_of(SCATTER_DEPTH_CLOSED_VOLUME, 16);
    const camera c = make_camera(PLAIN);
    static picture fresh, moved, other;
    scatter_gl_view v;
    check_world w;
    stage s;
    int i;
    open_puffs(&w);
    for (i = 0; i < 2; i++) {
        open_stage(&s, rig);
        v = view_of(&s, &c);
        assert_int_equal(scatter_gl_set_medium(s.fog, &w.scene.medium), SCATTER_OK);
        put_sky(&s, 8, 0);
        if (i == 1) {
            assert_int_equal(scatter_gl_update(s.fog, &q, &there), SCATTER_OK);
            draw(&s, &v, &other);
        }
        assert_int_equal(scatter_gl_update(s.fog, &q, &here), SCATTER_OK);
        draw(&s, &v, i == 0 ? &fresh : &moved);
        close_stage(&s);
    }
    assert_memory_equal(&fresh, &moved, sizeof fresh);
    assert_true(memcmp(&fresh, &other, sizeof fresh) != 0); /* planted */
}

/* --- volumes redone in turn --- */

static unsigned propagations(const stage *s) {
    return scatter_gl_get_stats(s->fog).propagations;
}

/* An update; how many volumes it redid. */
static unsigned update_in_turn(stage *s, int lights_per_update) {
    scatter_quality q = quality_of(SCATTER_DEPTH_POLAR, 8);
    const unsigned before = propagations(s);
    q.grid = 16;
    q.lights_per_update = lights_per_update;
    assert_int_equal(scatter_gl_update(s->fog, &q, NULL), SCATTER_OK);
    return propagations(s) - before;
}

static int same_fog(stage *a, stage *b) {
    const camera c = make_camera(PLAIN);
    const scatter_gl_view va = view_of(a, &c), vb = view_of(b, &c);
    static picture pa, pb;
    draw(a, &va, &pa);
    draw(b, &vb, &pb);
    return memcmp(&pa, &pb, sizeof pa) == 0;
}

static void open_turns(stage *s, gl_rig *rig, const check_world *w) {
    open_stage(s, rig);
    assert_int_equal(scatter_gl_set_medium(s->fog, &w->scene.medium), SCATTER_OK);
    put_sky(s, 20, 0);
}

/* 20 lights are five volumes. `all` redoes them at once, `turns` four lights at a time. */
static void volumes_in_turn(gl_rig *rig) {
    check_world w;
    stage all, turns;
    unsigned filled[5] = {0};
    int i, k;
    open_puffs(&w);
    open_turns(&all, rig, &w);
    open_turns(&turns, rig, &w);
    assert_int_equal(update_in_turn(&all, 0), 5);
    assert_int_equal(update_in_turn(&turns, 4), 5); /* what holds nothing is filled always */
    assert_true(same_fog(&all, &turns));
    for (i = 1; i <= 6; i++) { /* each update redoes the one that was filled longest ago */
        int redone = -1;
        put_sky(&turns, 20, 0.05f * (float)i);
        assert_int_equal(update_in_turn(&turns, 4), 1);
        for (k = 0; k < 5; k++) {
            const unsigned at = turns.fog->lamps[4 * k].filled_at;
            redone = at != filled[k] && i > 1 ? k : redone;
            filled[k] = at;
        }
        assert_true(i == 1 || redone == (i - 1) % 5);
    }
    put_sky(&all, 20, 0.3f);
    assert_int_equal(update_in_turn(&all, 0), 5);
    assert_false(same_fog(&all, &turns)); /* planted: volumes of earlier lights are seen */
    for (i = 0; i < 4; i++)
        assert_int_equal(update_in_turn(&turns, 1), 1); /* part of a volume is one */
    assert_true(same_fog(&all, &turns));
    assert_int_equal(update_in_turn(&turns, 4), 0);
    put_sky(&turns, 20, 1.0f);
    assert_int_equal(update_in_turn(&turns, 6), 2);
    assert_int_equal(update_in_turn(&turns, 0), 3);
    put_sky(&turns, 24, 1.0f);
    assert_int_equal(update_in_turn(&turns, 4), 6); /* a larger texture */
    w.gaussians[0].c *= 1.5f;
    for (i = 0; i < 7; i++) { /* the medium, too, comes in turn */
        assert_int_equal(scatter_gl_set_medium(turns.fog, &w.scene.medium), SCATTER_OK);
        assert_int_equal(update_in_turn(&turns, 4), i < 6);
    }
    put_sky(&all, 24, 1.0f);
    assert_int_equal(scatter_gl_set_medium(all.fog, &w.scene.medium), SCATTER_OK);
    update_in_turn(&all, 0);
    assert_true(same_fog(&all, &turns));
    close_stage(&all);
    close_stage(&turns);
}

/* Colour and phase function do not wait. */
static void colours_do_not_wait(gl_rig *rig) {
    scatter_gl_light lights[20];
    check_world w;
    stage all, turns;
    int i;
    open_puffs(&w);
    open_turns(&all, rig, &w);
    open_turns(&turns, rig, &w);
    update_in_turn(&all, 0);
    update_in_turn(&turns, 4);
    fill_sky(lights, 20, 0);
    for (i = 0; i < 20; i++)
        lights[i].light.intensity.y += 0.2f;
    w.scene.medium.phase.g = 0.6f;
    for (i = 0; i < 2; i++) {
        stage *s = i ? &turns : &all;
        assert_int_equal(scatter_gl_set_medium(s->fog, &w.scene.medium), SCATTER_OK);
        assert_int_equal(scatter_gl_set_lights(s->fog, lights, 20), SCATTER_OK);
        assert_int_equal(update_in_turn(s, 4), 0);
    }
    assert_true(same_fog(&all, &turns));
    close_stage(&all);
    close_stage(&turns);
}

/* Relative RMS difference of the pictures of two stages. */
static double fog_difference(stage *a, stage *b) {
    const camera c = make_camera(PLAIN);
    const scatter_gl_view va = view_of(a, &c), vb = view_of(b, &c);
    static picture pa, pb;
    check_error e = check_no_error();
    int i;
    draw(a, &va, &pa);
    draw(b, &vb, &pb);
    for (i = 0; i < 4 * PIXELS; i++)
        if (i % 4 < 3)
            check_add(&e, (double)pb.rgba[i], (double)pa.rgba[i]);
    return check_relative_rms(&e);
}

/* A sky that turns by `angle` each frame for ten frames, with one volume of five redone in each: how far that is from all of
   them, and how far volumes are that are as old as the oldest of these. */
static void turn_sky(gl_rig *rig, float angle, double *in_turn, double *old) {
    stage all, turns, frozen;
    check_world w;
    int i, k;
    open_puffs(&w);
    open_turns(&all, rig, &w);
    open_turns(&turns, rig, &w);
    open_turns(&frozen, rig, &w);
    for (i = 0; i <= 10; i++) {
        put_sky(&all, 20, angle * (float)i);
        put_sky(&turns, 20, angle * (float)i);
        put_sky(&frozen, 20, angle * (float)i);
        for (k = 0; k < 20 && i > 6; k++)
            frozen.fog->lamps[k].filled = 1; /* so that they stay as they were at frame 6 */
        update_in_turn(&all, 0);
        update_in_turn(&turns, 4);
        update_in_turn(&frozen, 0);
    }
    *in_turn = fog_difference(&all, &turns);
    *old = fog_difference(&all, &frozen);
    close_stage(&all);
    close_stage(&turns);
    close_stage(&frozen);
}

/* Volumes of 0..4 frames ago are less wrong than such of 4 frames ago alone, and half as wrong if the sky turns half as
   fast. */
static void error_in_turn(gl_rig *rig) {
    double fast, slow, old_fast, old_slow;
    turn_sky(rig, 0.05f, &fast, &old_fast);
    turn_sky(rig, 0.025f, &slow, &old_slow);
    printf("  a sky that turns by 0.05 a frame: off by %.2g %%, volumes four frames old by %.2g %%\n",
           100 * fast, 100 * old_fast);
    assert_at_most(fast, old_fast);
    assert_at_most(slow, old_slow);
    assert_at_least(check_order(fast, slow), 0.8);
    assert_at_least(fast, 1e-6); /* planted: it is seen */
}

/* The shadow of voxels on a surface, by rays: as exact as those are (see rays_through_voxels). */
static void voxels_on_surfaces(gl_rig *rig) {
    const scatter_quality q = voxel_quality(0);
    static picture p;
    const float given[16] = {0};
    scatter_depth *depth = NULL;
    scatter_source source;
    check_world w;
    stage s;
    double worst = 0, darkest = 1;
    int i;
    open_voxels(&w, NOTHING);
    open_stage(&s, rig);
    put_world(&s, &w, NULL, &q, NULL);
    run_surface(&s,
                "void main() { color = vec4(scatter_light_transmittance(0, "
                "vec3(gl_FragCoord.x * 0.1 - 2.0, -0.9, gl_FragCoord.y * 0.1 - 1.5)), 1.0); }",
                given, &p);
    source = scatteri_source_of(&w.lights[0]);
    assert_int_equal(scatter_depth_create(NULL, &depth), SCATTER_OK);
    assert_int_equal(scatter_depth_update(depth, &w.scene.medium, &source, &q), SCATTER_OK);
    for (i = 0; i < PIXELS; i++) {
        const scatter_vec3 x = {((float)(i % WIDTH) + 0.5f) * 0.1f - 2.0f, -0.9f,
                                ((float)(i / WIDTH) + 0.5f) * 0.1f - 1.5f};
        const double through = exp(-(double)scatter_depth_at(depth, x));
        worst = fmax(worst, fabs((double)p.rgba[4 * i + 1] - through));
        darkest = fmin(darkest, through);
    }
    assert_at_most(worst, 4e-3); /* 2.4e-3 is measured */
    assert_at_most(darkest, 0.5); /* without a shadow the first would be seen */
    scatter_depth_destroy(depth);
    close_stage(&s);
}

/* A transparent thing at given[0].w metres in front of the whole picture. */
static const char through_froxels[] =
    "void main() { vec2 at = gl_FragCoord.xy / vec2(40.0, 28.0); at.y = 1.0 - at.y;\n"
    "vec3 move = at.x * given[2].xyz + at.y * given[3].xyz;\n"
    "vec3 o = given[0].xyz, d = given[1].xyz;\n"
    "if (given[1].w > 0.5) d += move; else o += move;\n"
    "vec3 x = o + given[0].w * normalize(d);\n"
    "color = scatter_fog(vec4(0.2, 0.3, 0.4, 1.0), x); }";

/* A transparent fragment at distance t: the fog in front of it converges to that of the ray as slices become thin. */
static void fog_on_transparent_things(gl_rig *rig) {
    const scatter_quality q = quality_of(SCATTER_DEPTH_CLOSED, 32);
    static float rgb[3 * PIXELS];
    static picture p;
    double errors[2];
    check_world w;
    stage s;
    int kind, turn, i;
    open_puffs(&w);
    w.scene.medium.constant = 0.02f;
    check_bound(&w, check_cube(-20.0f, 20.0f));
    check_add_light(&w, SCATTER_LIGHT_DIRECTIONAL, check_v3(0, 0, 0), check_v3(1, 1, 1));
    w.lights[1].direction = check_v3(0.2f, -1, 0);
    open_stage(&s, rig);
    for (kind = PLAIN; kind <= PARALLEL; kind += PARALLEL - PLAIN) {
        const camera c = make_camera((camera_kind)kind);
        const scatter_gl_view v = view_of(&s, &c);
        const scatter_vec3 o = c.rays.origin, d = c.rays.direction;
        const scatter_vec3 u = kind == PLAIN ? c.rays.direction_dx : c.rays.origin_dx;
        const scatter_vec3 b = kind == PLAIN ? c.rays.direction_dy : c.rays.origin_dy;
        const float given[16] = {o.x, o.y, o.z, 4.3f, d.x, d.y, d.z, (float)(kind == PLAIN),
                                 u.x, u.y, u.z, 0,    b.x, b.y, b.z, 0};
        for (i = 0; i < PIXELS; i++)
            s.distance[i] = 4.3f;
        render(&s, &w, &c, &q, rgb, NULL);
        put_world(&s, &w, NULL, &q, NULL);
        for (turn = 0; turn < 2; turn++) {
            const scatter_gl_froxels f = {WIDTH, HEIGHT, 96 << turn, 0.3f, 9.0f};
            assert_int_equal(scatter_gl_fill_froxels(s.fog, &v, &f), SCATTER_OK);
            run_surface(&s, through_froxels, given, &p);
            errors[turn] = compare(&p, rgb);
        }
        /* one node a slice: second order; a slice of 96 is 1/3 of the narrowest Gaussian at this distance */
        assert_at_most(errors[0], 4e-3);
        assert_at_least(check_order(errors[0], errors[1]), 1.5);
    }
    close_stage(&s);
}

/* Behind the last slice fog goes on, as bright as it was there: there is no visible end. */
static void fog_behind_the_froxels(gl_rig *rig) {
    const scatter_quality q = quality_of(SCATTER_DEPTH_CLOSED, 32);
    const scatter_gl_froxels f = {WIDTH, HEIGHT, 64, 0.3f, 6.0f};
    const camera c = make_camera(PLAIN);
    const scatter_vec3 o = c.rays.origin, d = c.rays.direction;
    const scatter_vec3 u = c.rays.direction_dx, b = c.rays.direction_dy;
    const float given[16] = {o.x, o.y, o.z, 9.0f, d.x, d.y, d.z, 1, u.x, u.y, u.z, 0, b.x, b.y, b.z, 0};
    static float whole[3 * PIXELS], ended[3 * PIXELS];
    static picture p;
    check_world w;
    scatter_gl_view v;
    stage s;
    int i;
    check_world_open(&w);
    w.scene.medium.extinction = check_v3(0.04f, 0.06f, 0.1f);
    w.scene.medium.albedo = check_v3(0.9f, 0.9f, 0.9f);
    check_add_height(&w, 1.5f, -0.4f, 3.0f);
    check_add_light(&w, SCATTER_LIGHT_DIRECTIONAL, check_v3(0, 0, 0), check_v3(9, 8, 7));
    w.lights[0].direction = check_v3(0.2f, -1, 0.3f);
    open_stage(&s, rig);
    for (i = 0; i < PIXELS; i++)
        s.distance[i] = 6.0f;
    render(&s, &w, &c, &q, ended, NULL);
    for (i = 0; i < PIXELS; i++)
        s.distance[i] = 9.0f;
    render(&s, &w, &c, &q, whole, NULL);
    put_world(&s, &w, NULL, &q, NULL);
    v = view_of(&s, &c);
    assert_int_equal(scatter_gl_fill_froxels(s.fog, &v, &f), SCATTER_OK);
    run_surface(&s, through_froxels, given, &p);
    /* A fifth of what an end at the last slice would leave is measured: the light changes over the 3 m behind it. */
    assert_at_most(compare(&p, whole), 0.25 * difference(ended, whole));
    close_stage(&s);
}

/* --- debug views --- */

static void what_is_shown(gl_rig *rig) {
    const scatter_quality q = quality_of(SCATTER_DEPTH_CLOSED_VOLUME, 16);
    const camera c = make_camera(PLAIN);
    static float rgb[3 * PIXELS], through[3 * PIXELS], black[3 * PIXELS];
    static picture p;
    scatter_gl_view v;
    check_world w;
    stage s;
    int x, y;
    double nodes = 0, error = 0;
    open_puffs(&w);
    open_stage(&s, rig);
    put_plane(&s, &c, -0.4f);
    put_world(&s, &w, NULL, &q, NULL);
    memcpy(s.scene, black, sizeof black);
    render(&s, &w, &c, &q, rgb, through);
    v = view_of(&s, &c);
    v.show = SCATTER_GL_SHOW_TRANSMITTANCE;
    draw(&s, &v, &p);
    assert_at_most(compare(&p, through), SAME);
    v.show = SCATTER_GL_SHOW_RADIANCE;
    draw(&s, &v, &p);
    assert_at_most(compare(&p, rgb), 10 * SAME); /* 16 nodes, chosen for 16 rays together or for one */
    v.show = SCATTER_GL_SHOW_DENSITY;
    draw(&s, &v, &p);
    for (y = 0; y < HEIGHT; y++)
        for (x = 0; x < WIDTH; x++) {
            const double t = (double)through[3 * ((HEIGHT - 1 - y) * WIDTH + x) + 1];
            assert_at_most(fabs(exp(-(double)p.rgba[4 * (y * WIDTH + x)]) - t), 1e-5);
        }
    v.show = SCATTER_GL_SHOW_LIGHT_DEPTH;
    draw(&s, &v, &p);
    for (x = 0; x < PIXELS; x++) /* no more than the whole of all Gaussians: sum c sqrt(pi)/a */
        assert_true(p.rgba[4 * x] >= 0.0f && p.rgba[4 * x] < 5.4f);
    v.show_light = 1;
    draw(&s, &v, &p);
    for (x = 0; x < PIXELS; x++) /* there is no second light */
        assert_true(p.rgba[4 * x] == 0.0f);
    v.show = SCATTER_GL_SHOW_NODES;
    draw(&s, &v, &p);
    for (x = 0; x < PIXELS; x++)
        nodes += 256.0 * (double)p.rgba[4 * x] / PIXELS;
    assert_true(nodes > 4 && nodes < 64);
    v.show = SCATTER_GL_SHOW_ERROR;
    draw(&s, &v, &p);
    for (x = 0; x < PIXELS; x++)
        error = fmax(error, (double)p.rgba[4 * x]);
    assert_true(error > 0 && error < 0.01);
    close_stage(&s);
}

int main(void) {
    static const gl_case cases[] = {
        {"every camera", every_camera},
        {"origin at the top", origin_at_the_top},
        {"far away", far_away},
        {"NaN in the depth buffer", nan_in_depth},
        {"many lights", many_lights},
        {"flat grid", flat_grid},
        {"fog to the horizon", fog_to_the_horizon},
        {"flat shadow maps", flat_shadow_maps},
        {"cube shadow map", cube_shadow_map},
        {"two views in one target", two_views_in_one_target},
        {"alpha is opacity", alpha_is_opacity},
        {"multisampled target", multisampled_target},
        {"reduced resolution", reduced_resolution},
        {"nothing is lost", nothing_is_lost},
        {"nothing is lost in real volumes", nothing_is_lost_in_real_volumes},
        {"lost voxels are seen", lost_voxels_are_seen},
        {"rays through voxels", rays_through_voxels},
        {"light on surfaces", light_on_surfaces},
        {"voxels on surfaces", voxels_on_surfaces},
        {"surfaces under a sky", surfaces_under_a_sky},
        {"stacks of volumes", stacks_of_volumes},
        {"moving eye", moving_eye},
        {"volumes in turn", volumes_in_turn},
        {"colours do not wait", colours_do_not_wait},
        {"error of volumes in turn", error_in_turn},
        {"fog on transparent things", fog_on_transparent_things},
        {"fog behind the froxels", fog_behind_the_froxels},
        {"what is shown", what_is_shown}};
    return gl_rig_run_all(cases, CHECK_COUNT(cases));
}
