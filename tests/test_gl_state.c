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

#define SEEDS 8

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

/* Every planted leak is seen and named, from the state that OpenGL begins with and from random
   ones. */
static void test_leaks(gl_rig *rig)
{
    size_t i;
    int caught = 0, missed = 0;
    for (i = 0; i < 3 * CHECK_COUNT(gl_leaks); i++) {
        const gl_leak *leak = &gl_leaks[i / 3];
        if (!gl_has(&rig->host.gl, leak->gl, leak->es))
            continue;
        gl_host_rest(&rig->host);
        gl_context_close(&rig->context);
        assert_true(gl_context_open(&rig->context, rig->api, NULL));
        gl_host_open(&rig->host, rig->context.get_proc_address);
        if (i % 3)
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

/* ------------------------------------------------------------------ */

int main(void)
{
    static const gl_case cases[] = {
        {"reading the state changes nothing", test_reading},
        {"everything is randomized", test_randomizing},
        {"planted leaks are seen", test_leaks},
        {"the host's picture stays", test_picture},
    };
    return gl_rig_run_all(cases, CHECK_COUNT(cases));
}
