/* gl_bench.h - what the benchmarks of scatter_gl.h share: one context, clocks, scenes with their
   fog. MIT licence, see LICENSE. */
#ifndef SCATTER_BENCH_GL_BENCH_H
#define SCATTER_BENCH_GL_BENCH_H

#include "../examples/gl_context.h"
#include "../examples/host_gl.h"
#include "chart.h"

enum { GL_BENCH_TIMESTAMP = 0x8E28, GL_BENCH_RESULT = 0x8866 };

/* Which clock: a GPU's own, processor time of all threads where the driver is software, so that
   others on the machine do not count, or else the wall. */
typedef enum gl_clock { GL_CLOCK_QUERIES, GL_CLOCK_PROCESSOR, GL_CLOCK_WALL } gl_clock;

static const char *const gl_clock_names[] = {"the GPU's timer queries",
                                             "processor time of all threads of the process",
                                             "time on the wall until glFinish returns"};

typedef struct gl_bench {
    gl_context context;
    gl_clock clock;
    char renderer[128], vendor[128], version[128];
    void (*GenQueries)(int count, unsigned *names);
    void (*QueryCounter)(unsigned query, unsigned target);
    void (*GetQueryObjectui64v)(unsigned query, unsigned what, uint64_t *value);
    void (*Finish)(void);
    unsigned query[2];
    double start;
} gl_bench;

/* All benchmarks draw in one context. */
static gl_bench *the_gl(void);

/* -------------------------------------------------------------------------------------- clocks */

static int gl_is_software(const char *renderer)
{
    static const char *const names[] = {"llvmpipe", "softpipe", "swrast", "SwiftShader"};
    for (int i = 0; i < 4; i++)
        if (strstr(renderer, names[i]))
            return 1;
    return 0;
}

static void gl_start(void)
{
    gl_bench *g = the_gl();
    if (g->clock == GL_CLOCK_QUERIES) {
        g->QueryCounter(g->query[0], GL_BENCH_TIMESTAMP);
        return;
    }
    g->Finish();
    g->start = clock_ms(g->clock == GL_CLOCK_WALL ? CLOCK_MONOTONIC : CLOCK_PROCESS_CPUTIME_ID);
}

/* ms since gl_start, of the GPU where it tells. */
static double gl_stop(void)
{
    gl_bench *g = the_gl();
    uint64_t ns[2] = {0, 0};
    if (g->clock != GL_CLOCK_QUERIES) {
        g->Finish();
        return clock_ms(g->clock == GL_CLOCK_WALL ? CLOCK_MONOTONIC : CLOCK_PROCESS_CPUTIME_ID) -
               g->start;
    }
    g->QueryCounter(g->query[1], GL_BENCH_TIMESTAMP);
    for (int i = 0; i < 2; i++)
        g->GetQueryObjectui64v(g->query[i], GL_BENCH_RESULT, &ns[i]);
    return (double)(ns[1] - ns[0]) * 1e-6;
}

/* ------------------------------------------------------------------------------------- context */

static void gl_must(int failed, const char *what, const char *why)
{
    if (!failed)
        return;
    fprintf(stderr, "bench: %s: %s\n", what, why);
    exit(1);
}

static void gl_name(const gl_bench *g, unsigned what, char *text, size_t room)
{
    const unsigned char *(*get)(unsigned) =
        (const unsigned char *(*)(unsigned))g->context.get_proc_address("glGetString");
    const unsigned char *name = get(what);
    snprintf(text, room, "%s", name ? (const char *)name : "unknown");
}

static void gl_find_clock(gl_bench *g)
{
    gl_context_proc (*get)(const char *) = g->context.get_proc_address;
    g->Finish = (void (*)(void))get("glFinish");
    g->GenQueries = (void (*)(int, unsigned *))get("glGenQueries");
    g->QueryCounter = (void (*)(unsigned, unsigned))get("glQueryCounter");
    g->GetQueryObjectui64v = (void (*)(unsigned, unsigned, uint64_t *))get("glGetQueryObjectui64v");
    g->clock = gl_is_software(g->renderer)                ? GL_CLOCK_PROCESSOR
               : !g->context.es && g->GetQueryObjectui64v ? GL_CLOCK_QUERIES
                                                          : GL_CLOCK_WALL;
    if (g->clock == GL_CLOCK_QUERIES)
        g->GenQueries(2, g->query);
}

static gl_bench *the_gl(void)
{
    static gl_bench g;
    if (g.Finish)
        return &g;
    setenv("LP_NUM_THREADS", "1", 0); /* llvmpipe: one core, as the other benchmarks */
    gl_must(!gl_context_open(&g.context, "gl33", NULL), "no OpenGL", g.context.error);
    gl_name(&g, 0x1F00, g.vendor, sizeof g.vendor);
    gl_name(&g, HOST_GL_RENDERER, g.renderer, sizeof g.renderer);
    gl_name(&g, HOST_GL_VERSION, g.version, sizeof g.version);
    gl_find_clock(&g);
    return &g;
}

static int gl_software(void)
{
    return the_gl()->clock == GL_CLOCK_PROCESSOR;
}

/* Pixels of the edge of a square picture, and how many of each row and column errors are taken at:
   a GPU needs larger pictures to be busy. */
static int gl_size(void)
{
    return gl_software() ? by_level(32, 128, 256) : 1024;
}

/* Repeats; a GPU is quick. */
static int gl_rounds(int of_software)
{
    return gl_software() ? by_level(1, 1, of_software) : 15;
}

static int gl_lattice(void)
{
    return by_level(16, 32, 64);
}

/* -------------------------------------------------------------------------------------- scenes */

/* A scene file with its fog and a picture. The struct must not be moved. */
typedef struct gl_scene {
    scene_file file;
    const char *path;
    char name[64];
    host_gl host;
    scatter_gl *fog;
    bench_host books;
    float *rgb;
} gl_scene;

static void gl_log(void *user, scatter_result result, const char *sentence)
{
    (void)user;
    fprintf(stderr, "bench: scatter_gl result %d: %.400s\n", (int)result, sentence);
}

/* lights, gaussians: room for more than the file has. */
static void gl_scene_fog(gl_scene *s, int lights, int gaussians, int half_float)
{
    scatter_gl_desc desc;
    memset(&desc, 0, sizeof desc);
    desc.host.log = gl_log;
    desc.get_proc_address = the_gl()->context.get_proc_address;
    desc.max_lights = lights;
    desc.max_gaussians = gaussians;
    desc.half_float = half_float;
    desc.timers = 1;
    scatter_gl_destroy(s->fog);
    must(scatter_gl_create(&desc, &s->fog), "scatter_gl_create");
    must(scatter_gl_set_lights(s->fog, s->host.lights, s->file.scene.light_count),
         "scatter_gl_set_lights");
    must(scatter_gl_set_medium(s->fog, &s->file.scene.medium), "scatter_gl_set_medium");
}

static void gl_scene_picture(gl_scene *s, int width, int height)
{
    host_gl_close(&s->host);
    free(s->rgb);
    s->rgb = floats((size_t)(3 * width * height));
    gl_must(
        host_gl_open(&s->host, the_gl()->context.get_proc_address, &s->file, width, height, NULL) ||
            host_gl_surface(&s->host, NULL),
        s->path, s->host.error);
}

static void gl_scene_open(gl_scene *s, const char *path, int width, int height)
{
    memset(s, 0, sizeof *s);
    s->path = path;
    scene_short(path, s->name, sizeof s->name);
    scene_must_read(&s->file, path);
    gl_scene_picture(s, width, height);
    gl_scene_fog(s, 16, 4096, 0);
}

static void gl_scene_close(gl_scene *s)
{
    scatter_gl_destroy(s->fog);
    host_gl_close(&s->host);
    free(s->rgb);
    scene_free(&s->file);
}

/* --------------------------------------------------------------------------------------- times */

/* Everything that the quality needs, from the medium on: ms. */
static double gl_update_ms(gl_scene *s, const scatter_quality *quality, const scatter_vec3 *eye)
{
    static const scatter_medium none;
    must(scatter_gl_set_medium(s->fog, &none), "scatter_gl_set_medium");
    must(scatter_gl_update(s->fog, quality, NULL), "scatter_gl_update");
    gl_start();
    must(scatter_gl_set_medium(s->fog, &s->file.scene.medium), "scatter_gl_set_medium");
    must(scatter_gl_update(s->fog, quality, eye), "scatter_gl_update");
    return gl_stop();
}

/* The fog over the background: ms of the fog. */
static double gl_draw_ms(gl_scene *s)
{
    host_gl_draw(&s->host);
    gl_start();
    must(scatter_gl_draw(s->fog, &s->host.fog_view), "scatter_gl_draw");
    return gl_stop();
}

/* A program of host_gl_program, in use, in the lower left size^2 pixels: ms. */
static double gl_program_ms(const host_gl *host, unsigned program, int size)
{
    static const float whole[4] = {0, 0, 1, 1};
    host->gl.Uniform4fv(host_gl_at(host, program, "cover"), 1, whole);
    host->gl.BindFramebuffer(HOST_GL_FRAMEBUFFER, host->framebuffer);
    host->gl.Viewport(0, 0, size, size);
    host->gl.BindVertexArray(host->array);
    gl_start();
    host->gl.DrawArrays(HOST_GL_TRIANGLE_STRIP, 0, 4);
    return gl_stop();
}

/* The picture, rows from the top. */
static const float *gl_picture(gl_scene *s)
{
    file_picture picture;
    memset(&picture, 0, sizeof picture);
    picture.width = s->host.fog_view.width;
    picture.height = s->host.fog_view.height;
    picture.rgb = s->rgb;
    gl_must(host_gl_read(&s->host, &picture), s->path, s->host.error);
    return s->rgb;
}

/* Update and draw `rounds` times (both once before, so that shaders are compiled), into s. */
static void gl_measure(gl_scene *s, setting *way, int rounds)
{
    gl_update_ms(s, &way->quality, NULL);
    gl_draw_ms(s);
    for (int i = 0; i < rounds; i++) {
        timing_add(&way->setup, gl_update_ms(s, &way->quality, NULL));
        timing_add(&way->rays, gl_draw_ms(s));
    }
}

/* --------------------------------------------------------------------------------- references */

/* Where errors are taken: every so many pixels of a square picture. */
typedef struct gl_truth {
    int size, lattice;
    scatter_view view; /* of the lattice */
    float *reference, *few;
} gl_truth;

static size_t gl_truth_values(const gl_truth *t)
{
    return (size_t)(3 * t->lattice * t->lattice);
}

static void gl_truth_open(gl_truth *t, const gl_scene *s, int size, int lattice)
{
    t->size = size;
    t->lattice = lattice;
    t->view = view_lattice(scene_view(&s->file, size, size), size, lattice);
    t->reference = floats(gl_truth_values(t));
    t->few = floats(gl_truth_values(t));
    reference_of_file(&s->file, s->path, &t->view, lattice, t->reference);
}

static void gl_truth_close(gl_truth *t)
{
    free(t->reference);
    free(t->few);
}

/* Errors of the picture that was drawn last. */
static void gl_compare(gl_scene *s, const gl_truth *t, setting *way)
{
    image_lattice(gl_picture(s), t->size, t->lattice, t->few);
    setting_compare(way, t->few, t->reference, gl_truth_values(t));
}

#endif
