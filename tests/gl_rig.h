/* gl_rig.h - runs every case of a suite in every kind of context: gl33, gl45, es30, osmesa. Include
   it after gl_host.h. */
#ifndef GL_RIG_H
#define GL_RIG_H

#include "../examples/gl_context.h"

/* For the leak sanitizer: what drivers lose themselves. */
const char *__lsan_default_suppressions(void);
const char *__lsan_default_suppressions(void)
{
    return "leak:libOSMesa.so\nleak:libEGL\nleak:_dri.so\n";
}

typedef struct gl_rig {
    const char *api;
    gl_context context;
    gl_host host;
    gl_state before, after;
} gl_rig;

typedef struct gl_case {
    const char *name;
    void (*run)(gl_rig *);
} gl_case;

/* One case in one context, as cmocka's initial state. */
typedef struct gl_run {
    gl_case what;
    const char *api;
    char name[64];
} gl_run;

static inline void gl_rig_run(void **state)
{
    const gl_run *run = (const gl_run *)*state;
    gl_rig *rig = (gl_rig *)calloc(1, sizeof *rig);
    assert_true(rig != NULL);
    rig->api = run->api;
    if (!gl_context_open(&rig->context, run->api, NULL)) {
        printf("  skipped: %s: %s\n", run->api, rig->context.error);
        free(rig);
        skip();
    }
    gl_host_open(&rig->host, rig->context.get_proc_address);
    run->what.run(rig);
    gl_host_rest(&rig->host);
    gl_context_close(&rig->context);
    free(rig);
}

static inline int gl_rig_run_all(const gl_case *cases, size_t count)
{
    static const char *const apis[] = {"gl33", "gl45", "es30", "osmesa"};
    static gl_run runs[128];
    static struct CMUnitTest tests[128];
    size_t i;
    assert_true(4 * count <= CHECK_COUNT(tests));
    for (i = 0; i < 4 * count; i++) {
        runs[i].what = cases[i / 4];
        runs[i].api = apis[i % 4];
        snprintf(runs[i].name, sizeof runs[i].name, "%s, %s", cases[i / 4].name, apis[i % 4]);
        tests[i].name = runs[i].name;
        tests[i].test_func = gl_rig_run;
        tests[i].initial_state = &runs[i];
    }
    return _cmocka_run_group_tests("opengl", tests, 4 * count, NULL, NULL);
}

/* 1 where everything is as `before` has it, and no error is pending. */
static inline int gl_rig_kept(gl_rig *rig, const char *what)
{
    gl_state_take(&rig->host.gl, &rig->host.objects, &rig->after);
    return gl_state_same(&rig->before, &rig->after, what);
}

static inline void gl_rig_mark(gl_rig *rig)
{
    gl_state_take(&rig->host.gl, &rig->host.objects, &rig->before);
}

#endif /* GL_RIG_H */
