/* test_gl_api.c - scatter_gl.h as its hosts use and misuse it: lost contexts, several fogs, nothing
   to draw, arguments that are refused, contexts that lack something, memory that runs out, frames
   that allocate nothing. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#define SCATTER_IMPLEMENTATION
#include "../scatter_gl.h"
#include "check.h"
#include "gl_state.h"
#include "gl_host.h"
#include "gl_leaks.h"
#include "gl_rig.h"
#include "gl_fog.h"

/* Of gl_fog_call. */
enum {
    CREATE,
    SET_MEDIUM,
    SET_LIGHTS,
    WARM_UP,
    UPDATE,
    DRAW = 6,
    RESIZE,
    DRAW_HALF,
    SURFACE_GLSL = 11,
    TONE_MAP = 13
};

/* ----------------------------------------------------------------------------------- >>helpers */

/* Gaussians, height fog and two lights; with a grid: columns around the lights. */
static void put_scene(gl_fog *f, int grids, uint64_t seed)
{
    int i;
    check_world_open(&f->world);
    check_add_gaussians(&f->world, 4, 1, 4, seed);
    check_add_height(&f->world, 0.2f, -1, 1);
    for (i = 0; i < grids; i++)
        check_add_grid(&f->world, 5, 4, 3, check_cube(-1, 1), seed + (uint64_t)i);
    for (i = 0; i < 2; i++) {
        memset(&f->lights[i], 0, sizeof f->lights[i]);
        f->lights[i].light.position = check_point(&seed, -2, 2);
        f->lights[i].light.intensity = check_v3(2, 1, 0.5f);
        f->lights[i].light.radius = 0.05f;
    }
    memset(&f->quality, 0, sizeof f->quality);
    f->quality.depth = grids ? SCATTER_DEPTH_POLAR : SCATTER_DEPTH_CLOSED;
    f->quality.density = grids ? SCATTER_DENSITY_VOLUME : SCATTER_DENSITY_EXACT;
    f->quality.grid = 9; /* two lights: see gl_fog_light_count */
    f->quality.nodes = 4;
}

static void assert_result(const gl_fog *f, const char *what, scatter_result result,
                          scatter_result expected)
{
    if (result != expected)
        fprintf(stderr, "%s gives %d, not %d: %s\n", what, (int)result, (int)expected,
                f->books.sentence);
    assert_int_equal(result, expected);
}

static void assert_call(gl_fog *f, size_t call)
{
    assert_result(f, gl_fog_calls[call], gl_fog_call(f, call), SCATTER_OK);
}

static void start(gl_fog *f)
{
    static const size_t calls[] = {CREATE, SET_MEDIUM, SET_LIGHTS, UPDATE};
    size_t i;
    for (i = 0; i < CHECK_COUNT(calls); i++)
        assert_call(f, calls[i]);
}

static gl_picture target_of(gl_rig *rig, const gl_fog *f)
{
    gl_picture p;
    gl_host_read(&rig->host, f->target, &p);
    return p;
}

/* The fog over a fresh target. */
static gl_picture picture_of(gl_rig *rig, gl_fog *f, int divide)
{
    gl_fog_fill_target(rig, f);
    assert_result(f, "draw", gl_fog_draw(f, divide, SCATTER_GL_SHOW_FOG), SCATTER_OK);
    assert_int_equal(rig->host.gl.GetError(), GL_NO_ERROR);
    return target_of(rig, f);
}

static gl_picture picture_without_fog(gl_rig *rig, gl_fog *f)
{
    gl_fog_fill_target(rig, f);
    return target_of(rig, f);
}

static int is_same(const gl_picture *a, const gl_picture *b)
{
    return memcmp(a, b, sizeof *a) == 0;
}

/* The largest difference of two pixels, in steps of 1/255. */
static int farthest(const gl_picture *a, const gl_picture *b)
{
    int most = 0;
    size_t i;
    for (i = 0; i < sizeof a->pixel; i++) {
        const int miss = abs((int)a->pixel[i] - (int)b->pixel[i]);
        most = miss > most ? miss : most;
    }
    return most;
}

static void stop(gl_rig *rig, gl_fog *f)
{
    scatter_gl_destroy(f->fog);
    f->fog = NULL;
    assert_int_equal(rig->host.gl.GetError(), GL_NO_ERROR);
    assert_int_equal(f->books.live, 0);
}

/* The picture of a fog that is alone. */
static gl_picture picture_alone(gl_rig *rig, gl_fog *f)
{
    gl_picture p;
    start(f);
    p = picture_of(rig, f, 1);
    stop(rig, f);
    return p;
}

/* ------------------------------------------------------------------------------------ >>driver
   get_proc_address of a driver that counts calls, hides extensions, lacks functions. */

static struct {
    scatter_gl_proc (*get)(const char *name); /* the real one */
    const gl_functions *gl;
    int calls;             /* of the functions below */
    const char *version;   /* of GL_VERSION; NULL: the real one */
    const char *hidden[3]; /* extensions */
    const char *missing;   /* function */
    char asked[128][32];   /* names that were asked for */
    int asked_count;
} driver;

#define COUNTED_FUNCTIONS(F)                                                                       \
    F(BindTexture, (GLenum target, GLuint name), (target, name))                                   \
    F(DeleteBuffers, (GLsizei n, const GLuint *names), (n, names))                                 \
    F(DeleteFramebuffers, (GLsizei n, const GLuint *names), (n, names))                            \
    F(DeleteProgram, (GLuint name), (name))                                                        \
    F(DeleteQueries, (GLsizei n, const GLuint *names), (n, names))                                 \
    F(DeleteSamplers, (GLsizei n, const GLuint *names), (n, names))                                \
    F(DeleteTextures, (GLsizei n, const GLuint *names), (n, names))                                \
    F(DeleteVertexArrays, (GLsizei n, const GLuint *names), (n, names))                            \
    F(GetIntegerv, (GLenum name, GLint * values), (name, values))                                  \
    F(UseProgram, (GLuint name), (name))

#define COUNTED_DEFINE(name, parameters, arguments)                                                \
    static void APIENTRY counted_##name parameters                                                 \
    {                                                                                              \
        driver.calls++;                                                                            \
        driver.gl->name arguments;                                                                 \
    }
COUNTED_FUNCTIONS(COUNTED_DEFINE)

#define COUNTED_GIVE(function, parameters, arguments)                                              \
    if (strcmp(name, "gl" #function) == 0)                                                         \
        return (scatter_gl_proc)counted_##function;

static scatter_gl_proc get_counted(const char *name)
{
    COUNTED_FUNCTIONS(COUNTED_GIVE)
    return driver.get(name);
}

static const GLubyte *APIENTRY lying_string(GLenum name)
{
    return name == GL_VERSION && driver.version ? (const GLubyte *)driver.version
                                                : driver.gl->GetString(name);
}

static const GLubyte *APIENTRY lying_strings(GLenum name, GLuint i)
{
    const GLubyte *text = driver.gl->GetStringi(name, i);
    size_t k;
    for (k = 0; k < CHECK_COUNT(driver.hidden); k++)
        if (name == GL_EXTENSIONS && driver.hidden[k] &&
            strcmp((const char *)text, driver.hidden[k]) == 0)
            return (const GLubyte *)"GL_hidden";
    return text;
}

static scatter_gl_proc get_lying(const char *name)
{
    if (driver.asked_count < (int)CHECK_COUNT(driver.asked))
        snprintf(driver.asked[driver.asked_count++], sizeof driver.asked[0], "%s", name);
    if (driver.missing && strcmp(name, driver.missing) == 0)
        return NULL;
    if (strcmp(name, "glGetString") == 0)
        return (scatter_gl_proc)lying_string;
    return strcmp(name, "glGetStringi") == 0 ? (scatter_gl_proc)lying_strings : driver.get(name);
}

static void open_driver(gl_rig *rig, gl_fog *f, scatter_gl_proc (*get)(const char *))
{
    memset(&driver, 0, sizeof driver);
    driver.get = rig->context.get_proc_address;
    driver.gl = &rig->host.gl;
    f->desc.get_proc_address = get;
}

/* -------------------------------------------------------------------------------------- >>lost */

/* The context goes away with everything in it; a fog in the next one looks the same. */
static void test_lost_context(gl_rig *rig)
{
    gl_fog f;
    gl_picture a, b;
    gl_fog_open(rig, &f);
    put_scene(&f, 1, 1);
    open_driver(rig, &f, get_counted);
    f.desc.timers = 1;
    start(&f);
    a = picture_of(rig, &f, 1);
    gl_host_rest(&rig->host);
    gl_context_close(&rig->context);
    driver.calls = 0;
    scatter_gl_abandon(f.fog);
    assert_int_equal(driver.calls, 0);
    assert_int_equal(f.books.live, 0);
    assert_true(gl_context_open(&rig->context, rig->api, NULL));
    gl_host_open(&rig->host, rig->context.get_proc_address);
    gl_fog_open(rig, &f);
    put_scene(&f, 1, 1);
    b = picture_alone(rig, &f);
    assert_true(is_same(&a, &b));
}

/* Planted: destroy instead of abandon calls GL, and its calls are seen. */
static void test_calls_are_counted(gl_rig *rig)
{
    gl_fog f;
    gl_fog_open(rig, &f);
    put_scene(&f, 0, 1);
    open_driver(rig, &f, get_counted);
    start(&f);
    driver.calls = 0;
    stop(rig, &f);
    assert_true(driver.calls > 0);
}

/* ----------------------------------------------------------------------------------- >>several */

/* Two fogs, call by call in turns, each in its rig's context; each looks as if it were alone. */
static void assert_apart(gl_rig *const rigs[2], gl_fog fogs[2], const gl_picture alone[2])
{
    static const size_t calls[] = {CREATE, SET_MEDIUM, SET_LIGHTS, WARM_UP, UPDATE};
    size_t i;
    for (i = 0; i < 2 * CHECK_COUNT(calls); i++) {
        assert_true(gl_context_make_current(&rigs[i % 2]->context));
        assert_call(&fogs[i % 2], calls[i / 2]);
    }
    for (i = 0; i < 6; i++) {
        gl_picture p;
        assert_true(gl_context_make_current(&rigs[i % 2]->context));
        p = picture_of(rigs[i % 2], &fogs[i % 2], 1);
        assert_true(is_same(&p, &alone[i % 2]));
        assert_call(&fogs[i % 2], UPDATE);
    }
    for (i = 0; i < 2; i++) {
        assert_true(gl_context_make_current(&rigs[i]->context));
        stop(rigs[i], &fogs[i]);
    }
}

static void open_pair(gl_rig *const rigs[2], gl_fog fogs[2], gl_picture alone[2])
{
    size_t i;
    for (i = 0; i < 2; i++) {
        assert_true(gl_context_make_current(&rigs[i]->context));
        gl_fog_open(rigs[i], &fogs[i]);
        put_scene(&fogs[i], i == 0, 1 + i);
        alone[i] = picture_alone(rigs[i], &fogs[i]);
    }
    assert_false(is_same(&alone[0], &alone[1])); /* planted: mixed up, they would be seen */
}

static void test_two_contexts(gl_rig *rig)
{
    gl_rig *const rigs[2] = {rig, (gl_rig *)calloc(1, sizeof(gl_rig))};
    gl_picture alone[2];
    gl_fog fogs[2];
    assert_true(rigs[1] != NULL);
    assert_true(gl_context_open(&rigs[1]->context, rig->api, NULL));
    gl_host_open(&rigs[1]->host, rigs[1]->context.get_proc_address);
    open_pair(rigs, fogs, alone);
    assert_apart(rigs, fogs, alone);
    gl_host_rest(&rigs[1]->host);
    gl_context_close(&rigs[1]->context);
    free(rigs[1]);
    assert_true(gl_context_make_current(&rig->context));
}

static void test_two_fogs(gl_rig *rig)
{
    gl_rig *const rigs[2] = {rig, rig};
    gl_picture alone[2];
    gl_fog fogs[2];
    open_pair(rigs, fogs, alone);
    assert_apart(rigs, fogs, alone);
}

/* ----------------------------------------------------------------------------------- >>nothing */

static void test_no_medium(gl_rig *rig)
{
    gl_picture before, after;
    scatter_medium none;
    gl_fog f;
    gl_fog_open(rig, &f);
    put_scene(&f, 1, 1);
    before = picture_without_fog(rig, &f);
    assert_call(&f, CREATE);
    assert_result(&f, "update", scatter_gl_update(f.fog, NULL, NULL), SCATTER_OK);
    after = picture_of(rig, &f, 1); /* no medium was ever set */
    assert_true(is_same(&before, &after));
    assert_call(&f, SET_MEDIUM);
    assert_call(&f, SET_LIGHTS);
    assert_call(&f, UPDATE);
    after = picture_of(rig, &f, 1);
    assert_false(is_same(&before, &after)); /* planted: a fog is seen */
    memset(&none, 0, sizeof none);
    assert_result(&f, "set", scatter_gl_set_medium(f.fog, &none), SCATTER_OK);
    assert_call(&f, UPDATE);
    after = picture_of(rig, &f, 1);
    assert_true(is_same(&before, &after));
    after = picture_of(rig, &f, 2);
    assert_true(is_same(&before, &after));
    assert_result(&f, "froxels", gl_fog_froxels(&f), SCATTER_OK);
    stop(rig, &f);
}

/* Without lights only T is left: the target's rounding is half a step, and T's of its own picture
   is half a step of at most the target's values, 96. */
static void test_no_lights(gl_rig *rig)
{
    gl_picture before, fog, through;
    int bright = 0;
    size_t i;
    gl_fog f;
    gl_fog_open(rig, &f);
    put_scene(&f, 1, 1);
    before = picture_without_fog(rig, &f);
    assert_call(&f, CREATE);
    assert_call(&f, SET_MEDIUM);
    assert_result(&f, "lights", scatter_gl_set_lights(f.fog, NULL, 0), SCATTER_OK);
    assert_call(&f, UPDATE);
    fog = picture_of(rig, &f, 1);
    assert_result(&f, "draw", gl_fog_draw(&f, 1, SCATTER_GL_SHOW_TRANSMITTANCE), SCATTER_OK);
    through = target_of(rig, &f);
    for (i = 0; i < sizeof fog.pixel; i++)
        if (i % 4 < 3) {
            const double seen = before.pixel[i] * (through.pixel[i] / 255.0);
            assert_at_most(fabs(fog.pixel[i] - seen), 0.5 + 0.5 * 96.0 / 255.0 + 1e-3);
        }
    assert_call(&f, SET_LIGHTS);
    assert_call(&f, UPDATE);
    through = picture_of(rig, &f, 1);
    for (i = 0; i < sizeof fog.pixel; i++)
        bright += through.pixel[i] > fog.pixel[i] + 1;
    assert_true(bright > 0); /* planted: lights are seen */
    stop(rig, &f);
}

static void test_no_pixels(gl_rig *rig)
{
    scatter_gl_froxels froxels = {4, 4, 4, 0.5f, 20};
    gl_picture before, after;
    scatter_gl_view v;
    int i;
    gl_fog f;
    gl_fog_open(rig, &f);
    put_scene(&f, 0, 1);
    start(&f);
    before = picture_without_fog(rig, &f);
    for (i = 0; i < 4; i++) {
        v = f.view;
        v.divide = 1 + i / 2;
        v.width = i % 2 ? 0 : v.width;
        v.height = i % 2 ? v.height : 0;
        assert_result(&f, "draw", scatter_gl_draw(f.fog, &v), SCATTER_OK);
        assert_result(&f, "froxels", scatter_gl_fill_froxels(f.fog, &v, &froxels), SCATTER_OK);
    }
    for (i = 0; i < 2; i++) {
        scatter_gl_tone tone = gl_fog_tone(&f);
        *(i ? &tone.width : &tone.height) = 0;
        assert_result(&f, "tone map", scatter_gl_tone_map(f.fog, &tone), SCATTER_OK);
    }
    assert_result(&f, "resize", scatter_gl_resize(f.fog, 0, 0), SCATTER_OK);
    assert_result(&f, "resize", scatter_gl_resize(f.fog, 0, 9), SCATTER_OK);
    assert_result(&f, "warm up", scatter_gl_warm_up(f.fog, &f.quality, &v), SCATTER_OK);
    assert_int_equal(rig->host.gl.GetError(), GL_NO_ERROR);
    after = target_of(rig, &f);
    assert_true(is_same(&before, &after));
    after = picture_of(rig, &f, 1);
    assert_false(is_same(&before, &after));
    stop(rig, &f);
}

/* ----------------------------------------------------------------------------------- >>refused */

/* What a host gives, good; a test spoils one field of it. */
typedef struct arguments {
    scatter_gl_desc desc;
    scatter_medium medium;
    scatter_gaussian gaussians[65]; /* more than there is room for */
    scatter_height heights[9];
    scatter_grid grids[2];
    float voxels[60];
    scatter_gl_light lights[3]; /* a spot with cascades; a point with a cube; a direction */
    size_t light_count;
    scatter_quality quality;
    scatter_vec3 eye;
    scatter_gl_view view;
    float camera[16], projection[16];
    scatter_gl_froxels froxels;
    scatter_gl_tone tone;
    int width, height, unit, block;
    unsigned program;
} arguments;

enum { DO_CREATE, DO_MEDIUM, DO_LIGHTS, DO_UPDATE, DO_DRAW, DO_FROXELS, DO_TONE, DO_RESIZE, DO_BIND };

typedef struct refusal {
    int call;
    scatter_result result;
    const char *says; /* words that the sentence holds */
    char kind;        /* of the field: float, int, size, pointer (to NULL) */
    size_t at;
    double value;
} refusal;

#define BAD(call, says, kind, field, value)                                                        \
    {                                                                                              \
        call, SCATTER_BAD_ARGUMENT, says, kind, offsetof(arguments, field), value                  \
    }
#define LARGE(call, says, kind, field, value)                                                      \
    {                                                                                              \
        call, SCATTER_TOO_LARGE, says, kind, offsetof(arguments, field), value                     \
    }

static const refusal refusals[] = {
    BAD(DO_CREATE, "desc.get_proc_address", 'p', desc.get_proc_address, 0),
    BAD(DO_CREATE, "desc.max_lights", 'i', desc.max_lights, -1),
    BAD(DO_CREATE, "desc.max_lights", 'i', desc.max_lights, 4097),
    BAD(DO_CREATE, "desc.max_gaussians", 'i', desc.max_gaussians, -1),
    BAD(DO_CREATE, "desc.max_gaussians", 'i', desc.max_gaussians, 1048577),
    BAD(DO_MEDIUM, "medium.extinction", 'f', medium.extinction.y, -1),
    BAD(DO_MEDIUM, "medium.extinction", 'f', medium.extinction.y, (double)NAN),
    BAD(DO_MEDIUM, "medium.albedo", 'f', medium.albedo.z, 1.01),
    BAD(DO_MEDIUM, "medium.emission", 'f', medium.emission.x, -1),
    BAD(DO_MEDIUM, "medium.phase.kind", 'i', medium.phase.kind, 99),
    BAD(DO_MEDIUM, "medium.phase.g", 'f', medium.phase.g, 1),
    BAD(DO_MEDIUM, "medium.constant", 'f', medium.constant, -1),
    BAD(DO_MEDIUM, "medium.bounds", 'f', medium.bounds.max.y, -2),
    BAD(DO_MEDIUM, "medium.gaussians is", 'p', medium.gaussians, 0),
    BAD(DO_MEDIUM, "medium.gaussians[1].center", 'f', gaussians[1].center.x, (double)INFINITY),
    BAD(DO_MEDIUM, "medium.gaussians[1].a", 'f', gaussians[1].a, 0),
    BAD(DO_MEDIUM, "medium.gaussians[0].c", 'f', gaussians[0].c, -1),
    BAD(DO_MEDIUM, "medium.heights is", 'p', medium.heights, 0),
    BAD(DO_MEDIUM, "medium.heights[0].scale", 'f', heights[0].scale, 0),
    BAD(DO_MEDIUM, "medium.grids is", 'p', medium.grids, 0),
    BAD(DO_MEDIUM, "medium.grids[1].nx", 'i', grids[1].nx, 0),
    BAD(DO_MEDIUM, "medium.grids[1].density", 'p', grids[1].density, 0),
    BAD(DO_MEDIUM, "medium.grids[0].box", 'f', grids[0].box.max.z, -1),
    BAD(DO_MEDIUM, "medium.grids[0].density", 'f', voxels[59], -1),
    LARGE(DO_MEDIUM, "medium.grids[0].nx", 'i', grids[0].nx, 2147483647),
    LARGE(DO_MEDIUM, "medium.gaussian_count", 'z', medium.gaussian_count, 65),
    LARGE(DO_MEDIUM, "medium.height_count", 'z', medium.height_count, 9),
    BAD(DO_LIGHTS, "lights[1].kind", 'i', lights[1].light.kind, 99),
    BAD(DO_LIGHTS, "lights[1].intensity", 'f', lights[1].light.intensity.y, -1),
    BAD(DO_LIGHTS, "lights[1].position", 'f', lights[1].light.position.z, (double)NAN),
    BAD(DO_LIGHTS, "lights[1].radius", 'f', lights[1].light.radius, -1),
    BAD(DO_LIGHTS, "lights[0].outer", 'f', lights[0].light.outer, 4),
    BAD(DO_LIGHTS, "lights[0].inner", 'f', lights[0].light.inner, 1),
    BAD(DO_LIGHTS, "lights[2].direction", 'f', lights[2].light.direction.y, 0),
    BAD(DO_LIGHTS, "lights[0].shadow.kind", 'i', lights[0].shadow.kind, 99),
    BAD(DO_LIGHTS, "lights[0].shadow.cascades", 'i', lights[0].shadow.cascades, 5),
    BAD(DO_LIGHTS, "lights[0].shadow.cascades", 'i', lights[0].shadow.cascades, -1),
    BAD(DO_LIGHTS, "lights[0].shadow.layer", 'i', lights[0].shadow.layer, -1),
    BAD(DO_LIGHTS, "lights[0].shadow.bias", 'f', lights[0].shadow.bias, -0.1),
    BAD(DO_LIGHTS, "lights[1].shadow.bias", 'f', lights[1].shadow.bias, -0.1),
    BAD(DO_LIGHTS, "lights[1].shadow.z_near", 'f', lights[1].shadow.z_near, -1),
    BAD(DO_LIGHTS, "lights[1].shadow.z_far", 'f', lights[1].shadow.z_far, 0.1),
    LARGE(DO_LIGHTS, "count is 7", 'z', light_count, 7),
    BAD(DO_UPDATE, "quality.depth is 99", 'i', quality.depth, 99),
    BAD(DO_UPDATE, "quality.depth", 'i', quality.depth, SCATTER_DEPTH_EQ6),
    BAD(DO_UPDATE, "quality.depth", 'i', quality.depth, SCATTER_DEPTH_SHORT),
    BAD(DO_UPDATE, "quality.depth", 'i', quality.depth, SCATTER_DEPTH_MARCH),
    BAD(DO_UPDATE, "grids", 'i', quality.depth, SCATTER_DEPTH_CLOSED),
    BAD(DO_UPDATE, "grids", 'i', quality.depth, SCATTER_DEPTH_CLOSED_VOLUME),
    BAD(DO_UPDATE, "quality.density is 99", 'i', quality.density, 99),
    BAD(DO_UPDATE, "quality.density", 'i', quality.density, SCATTER_DENSITY_EXACT),
    BAD(DO_UPDATE, "quality.ray", 'i', quality.ray, -1),
    BAD(DO_UPDATE, "quality.nodes", 'i', quality.nodes, -1),
    BAD(DO_UPDATE, "quality.nodes", 'i', quality.nodes, 257),
    BAD(DO_UPDATE, "quality.grid", 'i', quality.grid, 1),
    BAD(DO_UPDATE, "quality.grid", 'i', quality.grid, 1025),
    BAD(DO_UPDATE, "quality.lights_per_update", 'i', quality.lights_per_update, -1),
    BAD(DO_UPDATE, "eye", 'f', eye.y, (double)NAN),
    BAD(DO_DRAW, "view.view", 'p', view.view, 0),
    BAD(DO_DRAW, "view.projection", 'p', view.projection, 0),
    BAD(DO_DRAW, "view.view", 'f', camera[0], 0), /* singular */
    BAD(DO_DRAW, "view.view", 'f', camera[5], (double)NAN),
    BAD(DO_DRAW, "view.projection", 'f', projection[11], 0), /* singular: no w */
    BAD(DO_DRAW, "width", 'i', view.width, -1),
    BAD(DO_DRAW, "height", 'i', view.height, -1),
    BAD(DO_DRAW, "view.divide", 'i', view.divide, 3),
    BAD(DO_DRAW, "view.divide", 'i', view.divide, -2),
    BAD(DO_DRAW, "view.show", 'i', view.show, 99),
    BAD(DO_FROXELS, "view.projection", 'p', view.projection, 0),
    BAD(DO_FROXELS, "width", 'i', view.width, -1),
    BAD(DO_FROXELS, "froxels.nx", 'i', froxels.nx, -1),
    BAD(DO_FROXELS, "froxels.nx", 'i', froxels.nz, 1),
    BAD(DO_FROXELS, "froxels.z_near", 'f', froxels.z_near, 0),
    BAD(DO_FROXELS, "froxels.z_near", 'f', froxels.z_near, (double)NAN),
    BAD(DO_FROXELS, "z_far", 'f', froxels.z_far, 0.5),
    LARGE(DO_FROXELS, "texture", 'i', froxels.nx, 1000000),
    BAD(DO_TONE, "source", 'i', tone.source, 0),
    BAD(DO_TONE, "source_x", 'i', tone.source_x, -1),
    BAD(DO_TONE, "source_y", 'i', tone.source_y, -1),
    BAD(DO_TONE, "width", 'i', tone.width, -1),
    BAD(DO_TONE, "height", 'i', tone.height, -1),
    LARGE(DO_TONE, "texture", 'i', tone.width, 2147483647),
    BAD(DO_RESIZE, "width", 'i', width, -1),
    BAD(DO_RESIZE, "height", 'i', height, -1),
    LARGE(DO_RESIZE, "texture", 'i', width, 2147483647),
    BAD(DO_BIND, "program", 'i', program, 0),
    BAD(DO_BIND, "first_unit", 'i', unit, -1),
    BAD(DO_BIND, "first_block", 'i', block, -1),
};

static void fill_medium(arguments *a)
{
    int i;
    for (i = 0; i < 65; i++) {
        a->gaussians[i].center = check_v3((float)i, 0, 0);
        a->gaussians[i].a = 2;
        a->gaussians[i].c = 1;
    }
    for (i = 0; i < 9; i++) {
        a->heights[i].density = 0.1f;
        a->heights[i].scale = 1;
    }
    for (i = 0; i < 2; i++) {
        a->grids[i].density = a->voxels;
        a->grids[i].nx = 5;
        a->grids[i].ny = 4;
        a->grids[i].nz = 3;
        a->grids[i].box = check_cube(-1, 1);
    }
    for (i = 0; i < 60; i++)
        a->voxels[i] = 0.01f * (float)i;
    a->medium.extinction = a->medium.albedo = check_v3(1, 0.9f, 0.8f);
    a->medium.gaussians = a->gaussians;
    a->medium.gaussian_count = 2;
    a->medium.heights = a->heights;
    a->medium.height_count = 1;
    a->medium.grids = a->grids;
    a->medium.grid_count = 2;
    a->medium.bounded = 1;
    a->medium.bounds = check_cube(-2, 2);
}

static void fill_lights(arguments *a, const gl_fog *f)
{
    static const scatter_light_kind kinds[] = {SCATTER_LIGHT_SPOT, SCATTER_LIGHT_POINT,
                                               SCATTER_LIGHT_DIRECTIONAL};
    int i;
    for (i = 0; i < 3; i++) {
        a->lights[i].light.kind = kinds[i];
        a->lights[i].light.intensity = check_v3(2, 1, 1);
        a->lights[i].light.direction = check_v3(0, -1, 0);
        a->lights[i].light.position = check_v3(0, 1.5f, 0);
        a->lights[i].light.inner = 0.4f;
        a->lights[i].light.outer = 0.8f;
        a->lights[i].shadow.bias = 0.01f;
    }
    a->lights[0].shadow.kind = SCATTER_GL_SHADOW_ARRAY;
    a->lights[0].shadow.texture = f->shadow[1];
    for (i = 0; i < 16; i++)
        a->lights[0].shadow.matrix[0][i] = i % 5 == 0 ? 0.5f : 0.1f;
    a->lights[1].shadow.kind = SCATTER_GL_SHADOW_CUBE;
    a->lights[1].shadow.texture = f->shadow[2];
    a->lights[1].shadow.z_near = 0.1f;
    a->lights[1].shadow.z_far = 9;
    a->light_count = 3;
}

static void fill_arguments(arguments *a, const gl_fog *f, unsigned program)
{
    memset(a, 0, sizeof *a);
    fill_medium(a);
    fill_lights(a, f);
    a->desc = f->desc;
    a->quality.depth = SCATTER_DEPTH_POLAR;
    a->quality.density = SCATTER_DENSITY_VOLUME;
    a->quality.grid = 8;
    a->quality.nodes = 4;
    a->eye = check_v3(0, 0, 3);
    memcpy(a->camera, f->camera, sizeof a->camera);
    memcpy(a->projection, f->projection, sizeof a->projection);
    a->view = f->view;
    a->view.view = a->camera;
    a->view.projection = a->projection;
    a->froxels.nx = a->froxels.ny = a->froxels.nz = 4;
    a->froxels.z_near = 0.5f;
    a->froxels.z_far = 20;
    a->width = a->height = 8;
    a->tone = gl_fog_tone(f);
    a->program = program;
}

static void spoil(arguments *a, const refusal *r)
{
    char *at = (char *)a + r->at;
    const float real = (float)r->value;
    const int whole = r->kind == 'i' ? (int)r->value : 0;
    const size_t size = r->kind == 'z' ? (size_t)r->value : 0;
    if (r->kind == 'f')
        memcpy(at, &real, sizeof real);
    else if (r->kind == 'i')
        memcpy(at, &whole, sizeof whole);
    else if (r->kind == 'z')
        memcpy(at, &size, sizeof size);
    else
        memset(at, 0, sizeof(void *));
}

static scatter_result do_call(scatter_gl *fog, const arguments *a, int call)
{
    scatter_gl *other = NULL;
    scatter_result result;
    switch (call) {
    case DO_MEDIUM: return scatter_gl_set_medium(fog, &a->medium);
    case DO_LIGHTS: return scatter_gl_set_lights(fog, a->lights, a->light_count);
    case DO_UPDATE: return scatter_gl_update(fog, &a->quality, &a->eye);
    case DO_DRAW: return scatter_gl_draw(fog, &a->view);
    case DO_FROXELS: return scatter_gl_fill_froxels(fog, &a->view, &a->froxels);
    case DO_TONE: return scatter_gl_tone_map(fog, &a->tone);
    case DO_RESIZE: return scatter_gl_resize(fog, a->width, a->height);
    case DO_BIND: return scatter_gl_bind_surface(fog, a->program, a->unit, a->block);
    default:;
    }
    result = scatter_gl_create(&a->desc, &other);
    assert_true(result == SCATTER_OK || other == NULL);
    scatter_gl_destroy(other);
    return result;
}

/* Whether the call gave that result, with a sentence that holds the words. */
static int is_refused(const gl_fog *f, scatter_result result, scatter_result expected,
                      const char *says)
{
    const int ok = result == expected && f->books.sentences > 0 && f->books.logged == expected &&
                   strstr(f->books.sentence, says) != NULL;
    if (!ok)
        fprintf(stderr, "gives %d, not %d with '%s': '%s'\n", (int)result, (int)expected, says,
                f->books.sentence);
    return ok;
}

static void forget_sentence(gl_fog *f)
{
    f->books.sentences = 0;
    f->books.sentence[0] = 0;
}

static void start_with(gl_fog *f, const arguments *a)
{
    int call;
    assert_call(f, CREATE);
    for (call = DO_MEDIUM; call <= DO_BIND; call++)
        assert_result(f, "a good call", do_call(f->fog, a, call), SCATTER_OK);
}

/* Behind each refusal the fog draws what it drew before, perhaps after a good update. */
static void test_refused(gl_rig *rig)
{
    arguments good, bad;
    gl_picture before, after;
    gl_fog f;
    size_t i;
    gl_fog_open(rig, &f);
    f.view.width = f.view.height = 6; /* many pictures follow */
    fill_arguments(&good, &f, rig->host.program);
    start_with(&f, &good);
    rig->host.gl.UseProgram(0);
    before = picture_of(rig, &f, 1);
    for (i = 0; i < CHECK_COUNT(refusals); i++) {
        const refusal *r = &refusals[i];
        fill_arguments(&bad, &f, rig->host.program);
        spoil(&bad, r);
        forget_sentence(&f);
        assert_true(is_refused(&f, do_call(f.fog, &bad, r->call), r->result, r->says));
        assert_int_equal(rig->host.gl.GetError(), GL_NO_ERROR);
        if (r->call == DO_UPDATE) {
            assert_true(is_refused(&f, do_call(f.fog, &good, DO_DRAW), SCATTER_BAD_ARGUMENT,
                                   "scatter_gl_update"));
            assert_result(&f, "update", do_call(f.fog, &good, DO_UPDATE), SCATTER_OK);
        }
        after = picture_of(rig, &f, 1);
        assert_true(is_same(&before, &after));
    }
    stop(rig, &f);
}

/* Planted: a spoilt argument that is legal is not refused. */
static void test_refusals_are_seen(gl_rig *rig)
{
    static const refusal legal[] = {BAD(DO_LIGHTS, "lights", 'f', lights[1].light.radius, 1),
                                    BAD(DO_UPDATE, "quality", 'i', quality.nodes, 9),
                                    BAD(DO_DRAW, "view", 'i', view.divide, 2)};
    arguments a;
    gl_fog f;
    size_t i;
    gl_fog_open(rig, &f);
    fill_arguments(&a, &f, rig->host.program);
    start_with(&f, &a);
    for (i = 0; i < CHECK_COUNT(legal); i++) {
        fill_arguments(&a, &f, rig->host.program);
        spoil(&a, &legal[i]);
        assert_result(&f, "planted", do_call(f.fog, &a, legal[i].call), SCATTER_OK);
        fill_arguments(&a, &f, rig->host.program);
        assert_result(&f, "update", do_call(f.fog, &a, DO_UPDATE), SCATTER_OK);
    }
    stop(rig, &f);
}

static void test_before_update(gl_rig *rig)
{
    static const int calls[] = {DO_DRAW, DO_FROXELS, DO_BIND};
    arguments a;
    gl_fog f;
    size_t i;
    int turn;
    gl_fog_open(rig, &f);
    fill_arguments(&a, &f, rig->host.program);
    assert_call(&f, CREATE);
    for (turn = 0; turn < 3; turn++) { /* after create, set_medium, set_lights */
        for (i = 0; i < CHECK_COUNT(calls); i++) {
            forget_sentence(&f);
            assert_true(is_refused(&f, do_call(f.fog, &a, calls[i]), SCATTER_BAD_ARGUMENT,
                                   "scatter_gl_update"));
        }
        assert_true(scatter_gl_surface_glsl(f.fog) == NULL);
        assert_result(&f, "update", do_call(f.fog, &a, DO_UPDATE), SCATTER_OK);
        assert_result(&f, "draw", do_call(f.fog, &a, DO_DRAW), SCATTER_OK);
        assert_result(&f, "set", do_call(f.fog, &a, DO_MEDIUM + turn % 2), SCATTER_OK);
    }
    assert_int_equal(rig->host.gl.GetError(), GL_NO_ERROR);
    stop(rig, &f);
}

static void test_null(gl_rig *rig)
{
    arguments a;
    gl_fog f;
    int call;
    gl_fog_open(rig, &f);
    fill_arguments(&a, &f, rig->host.program);
    for (call = DO_MEDIUM; call <= DO_BIND; call++)
        assert_int_equal(do_call(NULL, &a, call), SCATTER_BAD_ARGUMENT);
    assert_int_equal(scatter_gl_warm_up(NULL, NULL, NULL), SCATTER_BAD_ARGUMENT);
    assert_true(scatter_gl_surface_glsl(NULL) == NULL);
    assert_int_equal(scatter_gl_get_stats(NULL).programs, 0);
    assert_true(scatter_gl_get_times(NULL).view == -1.0f);
    scatter_gl_destroy(NULL);
    scatter_gl_abandon(NULL);
    assert_int_equal(scatter_gl_create(NULL, &f.fog), SCATTER_BAD_ARGUMENT);
    assert_true(is_refused(&f, scatter_gl_create(&f.desc, NULL), SCATTER_BAD_ARGUMENT, "fog"));
    start_with(&f, &a);
    assert_true(is_refused(&f, scatter_gl_set_medium(f.fog, NULL), SCATTER_BAD_ARGUMENT, "medium"));
    assert_true(
        is_refused(&f, scatter_gl_set_lights(f.fog, NULL, 1), SCATTER_BAD_ARGUMENT, "lights"));
    assert_true(is_refused(&f, scatter_gl_draw(f.fog, NULL), SCATTER_BAD_ARGUMENT, "view"));
    assert_true(is_refused(&f, scatter_gl_tone_map(f.fog, NULL), SCATTER_BAD_ARGUMENT, "tone"));
    assert_true(is_refused(&f, scatter_gl_fill_froxels(f.fog, NULL, &a.froxels),
                           SCATTER_BAD_ARGUMENT, "view"));
    assert_true(is_refused(&f, scatter_gl_fill_froxels(f.fog, &a.view, NULL), SCATTER_BAD_ARGUMENT,
                           "froxels"));
    assert_result(&f, "draw", do_call(f.fog, &a, DO_DRAW), SCATTER_OK);
    assert_int_equal(rig->host.gl.GetError(), GL_NO_ERROR);
    stop(rig, &f);
}

/* ----------------------------------------------------------------------------------- >>lacking */

static void assert_create_fails(gl_fog *f, const char *says)
{
    forget_sentence(f);
    assert_true(is_refused(f, gl_fog_call(f, CREATE), SCATTER_UNSUPPORTED, says));
    assert_true(f->fog == NULL);
    assert_int_equal(f->books.live, 0);
}

static void test_old_versions(gl_rig *rig)
{
    static const char *const versions[] = {"OpenGL ES 2.0 Some", "2.1 Some", "3.2 Some",
                                           "OpenGL ES-CM 1.1"};
    gl_fog f;
    size_t i;
    gl_fog_open(rig, &f);
    open_driver(rig, &f, get_lying);
    for (i = 0; i < CHECK_COUNT(versions); i++) {
        driver.version = versions[i];
        assert_create_fails(&f, versions[i]);
    }
    driver.version = "no version";
    assert_create_fails(&f, "GL_VERSION");
    driver.version = NULL;
    assert_call(&f, CREATE); /* planted: the truth is taken */
    stop(rig, &f);
}

/* Every function that create asks for, missing: its name is said, or it is one of later versions
   and of desktops, as OpenGL ES shows. */
static void test_missing_functions(gl_rig *rig)
{
    int i, count, refused = 0;
    gl_fog f;
    gl_fog_open(rig, &f);
    open_driver(rig, &f, get_lying);
    assert_call(&f, CREATE);
    stop(rig, &f);
    count = driver.asked_count;
    assert_true(count < (int)CHECK_COUNT(driver.asked));
    for (i = 0; i < count; i++) {
        driver.missing = driver.asked[i];
        forget_sentence(&f);
        if (gl_fog_call(&f, CREATE) != SCATTER_OK) {
            assert_true(is_refused(&f, f.books.logged, SCATTER_UNSUPPORTED, driver.missing));
            refused++;
        }
        stop(rig, &f);
    }
    printf("  of %d functions %d are needed\n", count, refused);
    assert_true(refused > 0 && (refused < count || !rig->context.es));
}

/* The names of two extensions, or NULL. */
static void hide(const char *a, const char *b)
{
    driver.hidden[0] = a;
    driver.hidden[1] = b;
}

static void assert_unsupported(gl_fog *f, const char *says)
{
    forget_sentence(f);
    assert_true(is_refused(f, gl_fog_call(f, UPDATE), SCATTER_UNSUPPORTED, says));
}

/* Volumes are refused, each by name; afterwards closed depth at full resolution draws. */
static void assert_no_volumes(gl_fog *f)
{
    static const scatter_depth_method volumes[] = {SCATTER_DEPTH_CLOSED_VOLUME, SCATTER_DEPTH_POLAR,
                                                   SCATTER_DEPTH_UPWIND};
    const scatter_quality quality = f->quality;
    size_t i;
    for (i = 0; i < CHECK_COUNT(volumes); i++) {
        f->quality.depth = volumes[i];
        assert_unsupported(f, "quality.depth");
    }
    f->quality = quality;
    f->quality.density = SCATTER_DENSITY_VOLUME;
    assert_unsupported(f, "quality.density");
    f->quality = quality;
    check_add_grid(&f->world, 5, 4, 3, check_cube(-1, 1), 1);
    assert_call(f, SET_MEDIUM);
    f->quality.depth = SCATTER_DEPTH_AUTO;
    assert_unsupported(f, "quality.depth");
    f->quality.depth = SCATTER_DEPTH_CLOSED; /* one grid, whose distance map is made without passes */
    assert_call(f, UPDATE);
    assert_call(f, DRAW);
    assert_int_equal(scatter_gl_get_stats(f->fog).distance_maps, 1);
    f->quality = quality;
    f->world.scene.medium.grid_count = 0;
    assert_call(f, SET_MEDIUM);
    assert_call(f, UPDATE);
    forget_sentence(f);
    assert_true(is_refused(f, gl_fog_froxels(f), SCATTER_UNSUPPORTED, "EXT_color_buffer_float"));
}

/* Without float targets the average must be given. */
static void assert_tone_unsupported(gl_rig *rig, gl_fog *f)
{
    scatter_gl_tone tone = gl_fog_tone(f);
    forget_sentence(f);
    if (rig->context.es)
        assert_true(is_refused(f, scatter_gl_tone_map(f->fog, &tone), SCATTER_UNSUPPORTED,
                               "tone.log_average"));
    tone.tone.log_average = 0.5f;
    assert_result(f, "tone map", scatter_gl_tone_map(f->fog, &tone), SCATTER_OK);
}

/* OpenGL does not need the extension. */
static void test_no_float_targets(gl_rig *rig)
{
    gl_picture full, half, lacking;
    gl_fog f;
    gl_fog_open(rig, &f);
    put_scene(&f, 0, 1);
    start(&f);
    full = picture_of(rig, &f, 1);
    half = picture_of(rig, &f, 2);
    stop(rig, &f);
    open_driver(rig, &f, get_lying);
    hide("GL_EXT_color_buffer_float", "GL_EXT_color_buffer_half_float");
    start(&f);
    assert_tone_unsupported(rig, &f);
    if (rig->context.es) {
        assert_no_volumes(&f);
        forget_sentence(&f);
        assert_true(is_refused(&f, gl_fog_draw(&f, 2, SCATTER_GL_SHOW_FOG), SCATTER_UNSUPPORTED,
                               "view.divide"));
    }
    assert_call(&f, RESIZE);
    lacking = picture_of(rig, &f, 1);
    assert_true(is_same(&full, &lacking));
    assert_result(&f, "update", scatter_gl_update(f.fog, NULL, NULL), SCATTER_OK);
    picture_of(rig, &f, 1);
    stop(rig, &f);
    hide("GL_EXT_color_buffer_float", NULL); /* half floats stay, where the driver has them */
    start(&f);
    if (gl_fog_draw(&f, 2, SCATTER_GL_SHOW_FOG) == SCATTER_OK) {
        lacking = picture_of(rig, &f, 2);
        assert_true(is_same(&half, &lacking));
    }
    stop(rig, &f);
}

/* A fog whose driver hides an extension, if any: its picture, and what it holds. */
static gl_picture picture_lacking(gl_rig *rig, gl_fog *f, const char *extension, size_t *bytes)
{
    gl_picture p;
    open_driver(rig, f, get_lying);
    hide(extension, NULL);
    start(f);
    p = picture_of(rig, f, 1);
    *bytes = scatter_gl_get_stats(f->fog).texture_bytes;
    stop(rig, f);
    return p;
}

/* 16 bits: an error of 2^-11 of depth, and of density, changes T by at most tau e^-tau 2^-11, below
   1/5000, each: a step of 1/255 where that rounds the other way; the picture's light is below 1. */
static void test_no_linear_filter(gl_rig *rig)
{
    gl_picture full, half, lacking;
    size_t full_bytes, half_bytes, bytes;
    gl_fog f;
    gl_fog_open(rig, &f);
    put_scene(&f, 1, 1);
    full = picture_lacking(rig, &f, NULL, &full_bytes);
    lacking = picture_lacking(rig, &f, "GL_OES_texture_float_linear", &bytes);
    f.desc.half_float = 1;
    half = picture_lacking(rig, &f, NULL, &half_bytes);
    assert_true(half_bytes < full_bytes);
    assert_true(bytes == (rig->context.es ? half_bytes : full_bytes));
    assert_true(is_same(&lacking, rig->context.es ? &half : &full));
    assert_at_most(farthest(&full, &half), 2);
}

/* Gathered instead of splatted, with one grid: the same sums in another order. */
static void test_no_blending(gl_rig *rig)
{
    gl_picture full, lacking;
    size_t full_bytes, bytes;
    int grids;
    gl_fog f;
    gl_fog_open(rig, &f);
    for (grids = 1; grids <= 2; grids++) {
        put_scene(&f, grids, 1);
        check_add_gaussians(&f.world, 60, 12, 16, 2); /* so small that splatting pays */
        full = picture_lacking(rig, &f, NULL, &full_bytes);
        lacking = picture_lacking(rig, &f, "GL_EXT_float_blend", &bytes);
        assert_true((bytes < full_bytes) == (rig->context.es && grids == 2));
        assert_at_most(farthest(&full, &lacking), rig->context.es ? grids : 0);
    }
}

/* ------------------------------------------------------------------------------------ >>memory */

static int is_same_census(const gl_rig *rig, const gl_census *before)
{
    const gl_census now = gl_count_objects(&rig->host.gl);
    return memcmp(before, &now, sizeof now) == 0;
}

/* One fog's life; its n-th allocation and all later ones fail, until that was noticed. The call
   that failed is made again. Returns how many calls failed. */
static int live_with(gl_rig *rig, gl_fog *f, size_t n, gl_picture *picture)
{
    static const size_t calls[] = {CREATE, SET_MEDIUM, SET_LIGHTS, UPDATE, DRAW, SURFACE_GLSL};
    int failed = 0;
    size_t i;
    f->desc.host = check_host_open(&f->books, 0);
    f->books.fail_at = n;
    for (i = 0; i < CHECK_COUNT(calls); i++) {
        const scatter_result result = gl_fog_call(f, calls[i]);
        if (result == SCATTER_OK)
            continue;
        assert_true(is_refused(f, result, SCATTER_OUT_OF_MEMORY, "host.allocate"));
        failed++;
        if (calls[i] == SET_MEDIUM) { /* there is no medium to go on with */
            assert_false(scatter_gl_update(f->fog, &f->quality, NULL) == SCATTER_OK);
            assert_false(gl_fog_draw(f, 1, SCATTER_GL_SHOW_FOG) == SCATTER_OK);
        }
        f->books.fail_at = 0;
        assert_call(f, calls[i]);
    }
    *picture = picture_of(rig, f, 1);
    stop(rig, f);
    return failed;
}

static void test_out_of_memory(gl_rig *rig)
{
    gl_picture first, p;
    gl_census before;
    size_t n;
    int failed = 1;
    gl_fog f;
    gl_fog_open(rig, &f);
    put_scene(&f, 1, 1);
    before = gl_count_objects(&rig->host.gl);
    assert_int_equal(live_with(rig, &f, 0, &first), 0);
    for (n = 1; failed; n++) {
        assert_true(n < 100);
        failed = live_with(rig, &f, n, &p);
        assert_true(failed == 0 || failed == 1);
        assert_true(is_same(&first, &p));
        assert_true(is_same_census(rig, &before));
    }
    printf("  %d allocations can fail\n", (int)n - 2);
    assert_true(n > 8); /* create and set_medium alone make six */
}

/* ----------------------------------------------------------------------------- >>quiet frames */

/* What a frame must leave as it is. */
typedef struct quiet {
    gl_census census;
    scatter_gl_stats stats;
    size_t calls;
} quiet;

static quiet listen_to(const gl_rig *rig, const gl_fog *f)
{
    quiet q;
    q.census = gl_count_objects(&rig->host.gl);
    q.stats = scatter_gl_get_stats(f->fog);
    q.calls = f->books.calls;
    return q;
}

static int is_quiet(const gl_rig *rig, const gl_fog *f, const quiet *before)
{
    const quiet q = listen_to(rig, f);
    return q.calls == before->calls && q.stats.programs == before->stats.programs &&
           q.stats.textures == before->stats.textures && is_same_census(rig, &before->census);
}

/* A light wanders in and out of the medium; every second picture is at half resolution. */
static void test_quiet_frames(gl_rig *rig)
{
    quiet before;
    int grids, i;
    gl_fog f;
    gl_fog_open(rig, &f);
    for (grids = 0; grids < 2; grids++) {
        put_scene(&f, grids, 1);
        start(&f);
        f.view.divide = 2;
        assert_call(&f, WARM_UP);
        assert_call(&f, UPDATE);
        assert_call(&f, DRAW_HALF);
        assert_call(&f, TONE_MAP);
        before = listen_to(rig, &f);
        for (i = 0; i < 8; i++) {
            f.lights[0].light.position.x = 0.4f * (float)i;
            assert_call(&f, SET_LIGHTS);
            assert_call(&f, UPDATE);
            picture_of(rig, &f, 1 + i % 2);
            assert_call(&f, TONE_MAP);
            assert_call(&f, SURFACE_GLSL);
            if (i == 0) /* its text is made once */
                before.calls++;
            assert_true(is_quiet(rig, &f, &before));
        }
        stop(rig, &f);
    }
}

/* Voxels that change each frame, as a simulation gives them: from the third frame on nothing is made, what one frame reads
   the next does not write, and each looks as a fog that knows only its voxels. */
static void stream_frames(gl_rig *rig, int half_float)
{
    gl_fog f, alone;
    GLuint read[3] = {0, 0, 0};
    quiet before;
    uint64_t seed = 5;
    int frame, i;
    gl_fog_open(rig, &f);
    gl_fog_open(rig, &alone);
    f.desc.half_float = alone.desc.half_float = half_float;
    put_scene(&f, 1, 1);
    start(&f);
    for (frame = 0; frame < 6; frame++) {
        gl_picture seen, expected;
        for (i = 0; i < 60; i++)
            f.world.voxels[0][i] = check_uniform(&seed, 0, 2);
        f.world.grids[0].version++;
        if (frame == 2)
            before = listen_to(rig, &f);
        assert_call(&f, SET_MEDIUM);
        assert_call(&f, UPDATE);
        seen = picture_of(rig, &f, 1);
        assert_true(frame < 2 || is_quiet(rig, &f, &before));
        read[frame % 3] = f.fog->grids[0].name;
        assert_true(read[frame % 3] != read[(frame + 2) % 3]);
        put_scene(&alone, 1, 1);
        memcpy(alone.world.voxels[0], f.world.voxels[0], 60 * sizeof(float));
        expected = picture_alone(rig, &alone);
        assert_true(is_same(&seen, &expected));
    }
    f.world.grids[0].nx = 4; /* another size in between */
    assert_call(&f, SET_MEDIUM);
    assert_false(is_quiet(rig, &f, &before)); /* planted: a texture is made and heard */
    f.world.grids[0].nx = 5;
    assert_call(&f, SET_MEDIUM);
    assert_call(&f, UPDATE);
    before = listen_to(rig, &f);
    for (frame = 0; frame < 3; frame++) {
        f.world.grids[0].version++;
        assert_call(&f, SET_MEDIUM);
        assert_call(&f, UPDATE);
        before = frame == 0 ? listen_to(rig, &f) : before;
    }
    assert_true(is_quiet(rig, &f, &before));
    stop(rig, &f);
}

static void test_streaming(gl_rig *rig)
{
    stream_frames(rig, 0);
    stream_frames(rig, 1);
}

/* Voxels that stay are not sent again when something else of the medium changes. */
static void test_voxels_that_stay(gl_rig *rig)
{
    gl_picture a, b;
    unsigned name;
    gl_fog f;
    gl_fog_open(rig, &f);
    put_scene(&f, 2, 1);
    start(&f);
    name = f.fog->grids[0].name;
    f.world.gaussians[0].c *= 2;
    f.world.voxels[1][3] += 1;
    f.world.grids[1].version++;
    assert_call(&f, SET_MEDIUM);
    assert_call(&f, UPDATE);
    a = picture_of(rig, &f, 1);
    assert_int_equal(f.fog->grids[0].name, name);
    assert_int_equal(f.fog->voxels[0].before.name, 0); /* and take no second texture */
    assert_true(f.fog->voxels[1].before.name != 0);
    stop(rig, &f);
    b = picture_alone(rig, &f);
    assert_true(is_same(&a, &b));
}

/* 16 bits: those that C would round to, by the definition of the format. */
static void test_halves(gl_rig *rig)
{
    static const float edges[] = {0, 5.9604645e-8f, 2.9802322e-8f, 2.9802326e-8f, 6.1035156e-5f, 6.1e-5f, 1, 65504,
                                  1.00048828125f, 1.00146484375f, 0.99975586f, 65503.9f};
    uint64_t seed = 3;
    int i;
    (void)rig;
    for (i = 0; i < 20000; i++) {
        const float v = i < (int)CHECK_COUNT(edges)
                            ? edges[i]
                            : fminf(powf(2.0f, check_uniform(&seed, -27, 16)), 65504.0f);
        int exponent;
        double step, nearest;
        const unsigned half = scatteri_gl_half(v), e = half >> 10, m = half & 1023u;
        const double value = e ? ldexp(1024.0 + m, (int)e - 25) : ldexp((double)m, -24);
        frexp((double)v, &exponent);
        step = ldexp(1, exponent < -13 ? -24 : exponent - 11);
        nearest = nearbyint((double)v / step) * step; /* ties to even */
        assert_true(value == nearest);
    }
}

/* An update fills what changed: nothing for colours, depth for lights, all for the medium. */
static void test_quiet_updates(gl_rig *rig)
{
    scatter_gl_stats a, b;
    int what;
    gl_fog f;
    gl_fog_open(rig, &f);
    put_scene(&f, 1, 1);
    start(&f);
    for (what = 0; what < 4; what++) {
        a = scatter_gl_get_stats(f.fog);
        if (what == 1)
            f.world.scene.medium.albedo = check_v3(0.5f, 0.6f, 0.7f);
        if (what == 2)
            f.lights[1].light.position.y += 0.1f;
        if (what == 3)
            f.world.gaussians[0].c *= 2;
        assert_call(&f, SET_MEDIUM);
        assert_call(&f, SET_LIGHTS);
        assert_call(&f, UPDATE);
        b = scatter_gl_get_stats(f.fog);
        assert_int_equal(b.injections - a.injections, what == 3);
        assert_int_equal(b.propagations - a.propagations, what >= 2);
    }
    stop(rig, &f);
}

/* Planted: an allocation, a texture and a program are heard. */
static void test_noise_is_heard(gl_rig *rig)
{
    GLuint texture, program;
    quiet before;
    void *memory;
    gl_fog f;
    gl_fog_open(rig, &f);
    put_scene(&f, 0, 1);
    start(&f);
    before = listen_to(rig, &f);
    assert_true(is_quiet(rig, &f, &before));
    memory = f.desc.host.allocate(f.desc.host.user, 1);
    assert_false(is_quiet(rig, &f, &before));
    f.desc.host.release(f.desc.host.user, memory);
    before = listen_to(rig, &f);
    rig->host.gl.GenTextures(1, &texture);
    rig->host.gl.BindTexture(GL_TEXTURE_2D, texture);
    rig->host.gl.BindTexture(GL_TEXTURE_2D, 0);
    assert_false(is_quiet(rig, &f, &before));
    rig->host.gl.DeleteTextures(1, &texture);
    assert_true(is_quiet(rig, &f, &before));
    program = rig->host.gl.CreateProgram();
    assert_false(is_quiet(rig, &f, &before));
    rig->host.gl.DeleteProgram(program);
    assert_call(&f, DRAW); /* compiles the pass of the picture */
    assert_false(is_quiet(rig, &f, &before));
    stop(rig, &f);
}

/* --------------------------------------------------------------------------------------- >>main */

int main(void)
{
    static const gl_case cases[] = {
        {"a lost context", test_lost_context},
        {"calls are counted", test_calls_are_counted},
        {"two contexts", test_two_contexts},
        {"two fogs", test_two_fogs},
        {"no medium", test_no_medium},
        {"no lights", test_no_lights},
        {"no pixels", test_no_pixels},
        {"refused arguments", test_refused},
        {"legal arguments are not refused", test_refusals_are_seen},
        {"before update", test_before_update},
        {"NULL", test_null},
        {"old versions", test_old_versions},
        {"missing functions", test_missing_functions},
        {"no float targets", test_no_float_targets},
        {"no linear filter", test_no_linear_filter},
        {"no blending", test_no_blending},
        {"out of memory", test_out_of_memory},
        {"quiet frames", test_quiet_frames},
        {"quiet updates", test_quiet_updates},
        {"streaming of voxels", test_streaming},
        {"voxels that stay", test_voxels_that_stay},
        {"rounding to 16 bits", test_halves},
        {"noise is heard", test_noise_is_heard},
    };
    return gl_rig_run_all(cases, CHECK_COUNT(cases));
}
