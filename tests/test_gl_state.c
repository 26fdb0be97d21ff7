/* test_gl_state.c - scatter_gl.h leaves OpenGL as it found it. The first half tests the measuring:
   planted leaks must be seen. */
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

#define SEEDS 12 /* random states */
#define FOGS 2   /* random scenes: shaders are compiled for each */

/* -------------------------------------------------- >>the measuring */

/* Reading the state changes nothing, and every value can be asked for in this version. */
static void test_reading(gl_rig *rig)
{
    uint64_t seed;
    for (seed = 0; seed <= SEEDS; seed++) {
        if (seed)
            gl_state_randomize(&rig->host, seed);
        assert_int_equal(rig->host.gl.GetError(), GL_NO_ERROR);
        gl_rig_mark(rig);
        assert_true(gl_rig_kept(rig, "reading the state"));
    }
}

/* Whether an item of that name, or of any if NULL, differs between the two. */
static int differs(const gl_rig *rig, const char *name)
{
    int i = gl_state_difference(&rig->before, &rig->after, 0);
    while (i >= 0 && name && strcmp(rig->before.item[i].name, name) != 0)
        i = gl_state_difference(&rig->before, &rig->after, (size_t)i + 1);
    return i >= 0;
}

/* How many of the names have an item that `reached` marks. */
static int is_reached(const gl_rig *rig, const unsigned char *reached, const char *name)
{
    size_t i;
    for (i = 0; i < rig->before.count; i++)
        if (reached[i] && strcmp(rig->before.item[i].name, name) == 0)
            return 1;
    return 0;
}

/* These stay: they are not settings, or a value has no room for another one. */
static int is_fixed(const char *name)
{
    static const char *const fixed[] = {"DEBUG_GROUP_STACK_DEPTH",
                                        "PRIMITIVE_BOUNDING_BOX",
                                        "SAMPLES_PASSED",
                                        "ANY_SAMPLES_PASSED_CONSERVATIVE",
                                        "PRIMITIVES_GENERATED",
                                        "BUFFER_CONTENTS",
                                        "EXISTS",
                                        "FRAMEBUFFER_ATTACHMENT",
                                        "TEXTURE_BORDER_COLOR",
                                        "TEXTURE_BASE_LEVEL",
                                        "IMAGE_BINDING_LEVEL",
                                        "POLYGON_OFFSET_CLAMP"};
    size_t i;
    for (i = 0; i < CHECK_COUNT(fixed); i++)
        if (strcmp(name, fixed[i]) == 0)
            return 1;
    return 0;
}

/* The random state differs from the one that OpenGL begins with in every setting there is. */
static void test_randomizing(gl_rig *rig)
{
    static unsigned char reached[GL_STATE_ROOM];
    uint64_t seed;
    size_t i;
    int k, missed = 0;
    memset(reached, 0, sizeof reached);
    gl_rig_mark(rig);
    for (seed = 1; seed <= SEEDS; seed++) {
        gl_state_randomize(&rig->host, seed);
        gl_state_take(&rig->host.gl, &rig->host.objects, &rig->after);
        for (k = -1; (k = gl_state_difference(&rig->before, &rig->after, (size_t)(k + 1))) >= 0;)
            reached[k] = 1;
    }
    for (i = 0; i < rig->before.count; i++)
        if (!is_fixed(rig->before.item[i].name) &&
            !is_reached(rig, reached, rig->before.item[i].name)) {
            if (i == 0 || rig->before.item[i].name != rig->before.item[i - 1].name)
                gl_item_print(&rig->before.item[i], "never random");
            missed++;
        }
    printf("  %d values of OpenGL %d\n", (int)rig->before.count, rig->host.gl.version);
    assert_int_equal(missed, 0);
}

/* Every planted leak is seen and named, from the state that OpenGL begins with and from a random
   one. */
static void test_leaks(gl_rig *rig)
{
    size_t i;
    int caught = 0, missed = 0;
    for (i = 0; i < 2 * CHECK_COUNT(gl_leaks); i++) {
        const gl_leak *leak = &gl_leaks[i / 2];
        if (!gl_has(&rig->host.gl, leak->gl, leak->es))
            continue;
        gl_host_rest(&rig->host);
        gl_context_close(&rig->context);
        assert_true(gl_context_open(&rig->context, rig->api, NULL));
        gl_host_open(&rig->host, rig->context.get_proc_address);
        if (i % 2)
            gl_state_randomize(&rig->host, i);
        gl_rig_mark(rig);
        leak->leak(&rig->host);
        gl_state_take(&rig->host.gl, &rig->host.objects, &rig->after);
        caught += differs(rig, leak->name);
        if (!differs(rig, leak->name)) {
            fprintf(stderr, "not seen: %s, state %d\n", leak->name, (int)i);
            missed++;
        }
    }
    printf("  %d planted leaks, %d caught\n", caught + missed, caught);
    assert_int_equal(missed, 0);
}

/* A copy of one picture for each of many random states, most of which show something. */
static void test_picture(gl_rig *rig)
{
    gl_picture a, b;
    uint64_t seed;
    int seen = 0, plain;
    size_t i;
    for (seed = 1; seed <= SEEDS; seed++) {
        gl_state_randomize(&rig->host, seed);
        gl_host_make_visible(&rig->host);
        gl_host_draw(&rig->host, &a);
        gl_rig_mark(rig);
        gl_host_draw(&rig->host, &b);
        assert_true(gl_rig_kept(rig, "drawing"));
        assert_int_equal(memcmp(&a, &b, sizeof a), 0);
        for (i = 4, plain = 1; i < sizeof a.pixel; i++)
            plain &= a.pixel[i] == a.pixel[i - 4];
        seen += !plain;
    }
    printf("  %d of %d pictures show something\n", seen, SEEDS);
    assert_true(2 * seen >= SEEDS);
}

/* ------------------------------------------------------- >>the fog */

/* One call from a random state. Returns whether the state is as before. */
static int is_kept(gl_rig *rig, gl_fog *f, size_t call, uint64_t seed)
{
    gl_state_randomize(&rig->host, seed);
    gl_fog_plain_maps(rig, f);
    gl_rig_mark(rig);
    if (gl_fog_call(f, call) != SCATTER_OK) {
        fprintf(stderr, "%s: %s\n", gl_fog_calls[call], f->books.sentence);
        return 0;
    }
    return gl_rig_kept(rig, gl_fog_calls[call]);
}

/* In the fog that skips, update has made a distance map and draw a mask. */
static int has_skipped(const gl_fog *f, size_t call, uint64_t seed)
{
    return seed != FOGS || call != 6 ||
           (scatter_gl_get_stats(f->fog).distance_maps > 0 && f->fog->mask.name != 0);
}

/* Every call, in the order in which a host makes them, each from another state. */
static void test_fog_keeps_state(gl_rig *rig)
{
    gl_census before;
    gl_census after;
    gl_fog f;
    uint64_t seed;
    size_t call;
    gl_fog_open(rig, &f);
    for (seed = 1; seed <= SEEDS; seed++)
        gl_state_randomize(&rig->host, seed); /* names become objects when they are first used */
    before = gl_count_objects(&rig->host.gl);
    for (seed = 1; seed <= FOGS; seed++) {
        gl_fog_random(&f, seed);
        f.desc.timers = (int)(seed & 1);
        f.desc.half_float = (int)(seed >> 1 & 1);
        if (seed == FOGS)
            gl_fog_skip(&f);
        for (call = 0; call < CHECK_COUNT(gl_fog_calls); call++)
            assert_true(is_kept(rig, &f, call, 100 * seed + call) && has_skipped(&f, call, seed));
        after = gl_count_objects(&rig->host.gl);
        assert_int_equal(memcmp(&before, &after, sizeof before), 0);
        assert_int_equal(f.books.live, 0);
    }
}

/* With desc.keep_state the fog leaves what it set: the measuring sees that. */
static void test_fog_without_saving(gl_rig *rig)
{
    gl_fog f;
    gl_fog_open(rig, &f);
    f.desc.keep_state = 1;
    assert_int_equal(gl_fog_start(&f), SCATTER_OK);
    gl_state_randomize(&rig->host, 3);
    gl_rig_mark(rig);
    assert_int_equal(gl_fog_call(&f, 6), SCATTER_OK);
    gl_state_take(&rig->host.gl, &rig->host.objects, &rig->after);
    assert_true(differs(rig, "CURRENT_PROGRAM") || differs(rig, "BLEND_SRC_RGB"));
    assert_true(differs(rig, "TEXTURE_BINDING_2D"));
    scatter_gl_destroy(f.fog);
}

/* The quad of the host looks the same before the fog and behind it. */
static void test_picture_beside_fog(gl_rig *rig)
{
    gl_picture a, b;
    gl_fog f;
    uint64_t seed;
    gl_fog_open(rig, &f);
    assert_int_equal(gl_fog_start(&f), SCATTER_OK);
    for (seed = 1; seed <= 2 * FOGS; seed++) {
        gl_state_randomize(&rig->host, seed);
        gl_host_make_visible(&rig->host);
        gl_host_draw(&rig->host, &a);
        assert_int_equal(gl_fog_call(&f, 4), SCATTER_OK);
        assert_int_equal(gl_fog_call(&f, 6), SCATTER_OK);
        assert_int_equal(gl_fog_call(&f, 10), SCATTER_OK);
        gl_host_draw(&rig->host, &b);
        assert_int_equal(memcmp(&a, &b, sizeof a), 0);
    }
    scatter_gl_destroy(f.fog);
}

/* The fog over a fresh target, from a random state, or from what OpenGL begins with (seed 0). */
static gl_picture picture_of_fog(const char *api, uint64_t seed, uint64_t scene,
                                 scatter_gl_proc (*get)(const char *))
{
    gl_rig *rig = (gl_rig *)calloc(1, sizeof *rig);
    gl_picture picture;
    gl_fog f;
    assert_true(gl_context_open(&rig->context, api, NULL));
    gl_host_open(&rig->host, rig->context.get_proc_address);
    gl_fog_open(rig, &f);
    gl_fog_random(&f, scene);
    if (get)
        f.desc.get_proc_address = get;
    if (seed) {
        gl_state_randomize(&rig->host, seed);
        gl_fog_plain_maps(rig, &f);
        if (gl_has(&rig->host.gl, 45, GL_ABSENT)) /* the origin turns the camera: see test_gl_view.c */
            rig->host.gl.ClipControl(GL_LOWER_LEFT, seed % 2 ? GL_ZERO_TO_ONE : GL_NEGATIVE_ONE_TO_ONE);
    }
    assert_int_equal(gl_fog_start(&f), SCATTER_OK);
    gl_host_read(&rig->host, f.target, &picture);
    scatter_gl_destroy(f.fog);
    gl_host_rest(&rig->host);
    gl_context_close(&rig->context);
    free(rig);
    return picture;
}

static scatter_gl_proc (*real_get)(const char *);

static void APIENTRY disable_nothing(GLenum what)
{
    (void)what;
}

/* A context whose glDisable does nothing: a fog that forgets to switch off what it must. */
static scatter_gl_proc careless(const char *name)
{
    return strcmp(name, "glDisable") == 0 ? (scatter_gl_proc)disable_nothing : real_get(name);
}

/* Nothing of the host's settings is seen in the fog. */
static void test_fog_does_not_depend_on_state(gl_rig *rig)
{
    uint64_t seed;
    int spoilt = 0;
    real_get = rig->context.get_proc_address;
    for (seed = 1; seed <= 3 * FOGS; seed += 3) {
        gl_picture a = picture_of_fog(rig->api, 0, seed, NULL);
        gl_picture b = picture_of_fog(rig->api, seed, seed, NULL);
        gl_picture c = picture_of_fog(rig->api, seed, seed, careless);
        if (memcmp(&a, &b, sizeof a) != 0)
            fprintf(stderr, "another picture from state %d\n", (int)seed);
        assert_int_equal(memcmp(&a, &b, sizeof a), 0);
        spoilt += memcmp(&a, &c, sizeof a) != 0;
    }
    printf("  planted: without glDisable %d of %d pictures are spoilt\n", spoilt, FOGS);
    assert_true(spoilt > 0);
    assert_true(gl_context_make_current(&rig->context));
}

/* ------------------------------------------------------------------ */

int main(void)
{
    static const gl_case cases[] = {
        {"reading the state changes nothing", test_reading},
        {"everything is randomized", test_randomizing},
        {"planted leaks are seen", test_leaks},
        {"the host's picture stays", test_picture},
        {"every call keeps the state", test_fog_keeps_state},
        {"without saving, the leak is seen", test_fog_without_saving},
        {"the host's picture stays beside the fog", test_picture_beside_fog},
        {"the fog does not depend on the state", test_fog_does_not_depend_on_state},
    };
    return gl_rig_run_all(cases, CHECK_COUNT(cases));
}
