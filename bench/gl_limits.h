/* gl_limits.h - benchmark: how far the view pass is from what its texture fetches, or its
   exponentials and error functions, cost alone. MIT licence. */
#ifndef SCATTER_BENCH_GL_LIMITS_H
#define SCATTER_BENCH_GL_LIMITS_H

#include "gl_bench.h"

enum { GL_LIMITS_LOOPS = 3, GL_LIMITS_TIMES = 64 };

/* What is left of a pixel when everything else is taken away. `count` is no constant, so that
   nothing is computed ahead. */
static const char *const gl_limits_loops[GL_LIMITS_LOOPS] = {
    "sum += textureLod(cells, vec3(at, x), 0.0).x;\n",
    /* A Gaussian at a node: density and depth on the eye ray, depth to the light. */
    "float e = exp(-x * at.x);\n"
    "sum += e * (at.y + scatteri_erfcx(x * at.y));\n",
    "float q = scatteri_erf_under(x), p = scatteri_erf_under(at.y * x);\n"
    "sum += exp(-x * at.y) *\n"
    "       (scatteri_erf_over(at.x, x) * p - scatteri_erf_over(at.y, x) * q) / (p * q);\n"};

static const char *const gl_limits_names[GL_LIMITS_LOOPS] = {
    "a fetch of four channels between 64^3 cells", "eye: exp and erfcx", "light: exp and two erfs"};

typedef struct gl_limits {
    host_gl host;
    unsigned program[GL_LIMITS_LOOPS], cells;
    timing ms[GL_LIMITS_LOOPS];
} gl_limits;

static unsigned gl_limits_program(gl_limits *b, const char *loop)
{
    static const char head[] = "uniform highp sampler3D cells;\nuniform int count;\n"
                               "uniform vec2 pixels;\nout vec4 picture;\nvoid main() {\n"
                               "    vec2 at = gl_FragCoord.xy / pixels;\n    float sum = 0.0;\n"
                               "    for (int i = 0; i < count; i++) {\n"
                               "        float x = fract(0.37 * float(i) + at.x);\n";
    static const char tail[] = "    }\n    picture = vec4(sum);\n}\n";
    const char *text[] = {host_gl_version(&b->host),
                          scatter_gl_glsl("prelude"),
                          scatter_gl_glsl("erf"),
                          scatter_gl_glsl("quick"),
                          head,
                          loop,
                          tail};
    unsigned program = host_gl_program(&b->host, text, 7);
    gl_must(!program, "limits", b->host.error);
    return program;
}

/* 64^3 texels of four floats, read between their centres. */
static void gl_limits_upload(gl_limits *b, int n)
{
    enum { TEXTURE_3D = 0x806F, LINEAR = 0x2601 };
    void (*image)(unsigned, int, int, int, int, int, int, unsigned, unsigned, const void *) =
        (void (*)(unsigned, int, int, int, int, int, int, unsigned, unsigned, const void *))the_gl()
            ->context.get_proc_address("glTexImage3D");
    float *values = (float *)calloc((size_t)(4 * n) * (size_t)(n * n), sizeof *values);
    b->host.gl.GenTextures(1, &b->cells);
    b->host.gl.ActiveTexture(HOST_GL_TEXTURE0);
    b->host.gl.BindTexture(TEXTURE_3D, b->cells);
    b->host.gl.TexParameteri(TEXTURE_3D, HOST_GL_MIN_FILTER, LINEAR);
    b->host.gl.TexParameteri(TEXTURE_3D, HOST_GL_MAG_FILTER, LINEAR);
    image(TEXTURE_3D, 0, HOST_GL_RGBA32F, n, n, n, 0, HOST_GL_RGBA, HOST_GL_FLOAT, values);
    free(values);
}

static double gl_limits_ms(gl_limits *b, unsigned program, int size)
{
    const host_gl_functions *gl = &b->host.gl;
    gl->UseProgram(program);
    gl->Uniform1i(host_gl_at(&b->host, program, "count"), GL_LIMITS_TIMES);
    gl->Uniform1i(host_gl_at(&b->host, program, "cells"), 0);
    gl->Uniform2f(host_gl_at(&b->host, program, "pixels"), (float)size, (float)size);
    gl->ActiveTexture(HOST_GL_TEXTURE0);
    gl->BindTexture(0x806F, b->cells);
    return gl_program_ms(&b->host, program, size);
}

static void gl_limits_open(gl_limits *b, const gl_scene *s, int size)
{
    memset(b, 0, sizeof *b);
    gl_must(host_gl_open(&b->host, the_gl()->context.get_proc_address, &s->file, size, size, NULL),
            "limits", b->host.error);
    gl_limits_upload(b, 64);
    for (int i = 0; i < GL_LIMITS_LOOPS; i++)
        b->program[i] = gl_limits_program(b, gl_limits_loops[i]);
    for (int round = 0; round <= gl_rounds(5); round++)
        for (int i = 0; i < GL_LIMITS_LOOPS; i++) {
            double ms = gl_limits_ms(b, b->program[i], size);
            if (round > 0) /* the first one compiles */
                timing_add(&b->ms[i], ms);
        }
}

static void gl_limits_close(gl_limits *b)
{
    for (int i = 0; i < GL_LIMITS_LOOPS; i++)
        b->host.gl.DeleteProgram(b->program[i]);
    b->host.gl.DeleteTextures(1, &b->cells);
    host_gl_close(&b->host);
}

/* Nodes on all rays of the picture, by the debug view. */
static double gl_limits_nodes(gl_scene *s)
{
    double sum = 0;
    size_t pixels = (size_t)s->host.fog_view.width * (size_t)s->host.fog_view.height;
    s->host.fog_view.show = SCATTER_GL_SHOW_NODES;
    gl_draw_ms(s);
    s->host.fog_view.show = SCATTER_GL_SHOW_FOG;
    const float *rgb = gl_picture(s);
    for (size_t i = 0; i < pixels; i++)
        sum += 256 * (double)rgb[3 * i];
    return sum / (double)pixels;
}

static void gl_limits_row(report *r, const gl_limits *b, gl_scene *s, scatter_depth_method depth,
                          int nodes)
{
    setting way = setting_of(depth, SCATTER_RAY_QUADRATURE, nodes, by_level(16, 32, 64));
    double gaussians = (double)s->file.scene.medium.gaussian_count, fetch, eye, light, limit;
    gl_measure(s, &way, gl_rounds(5));
    double used = gl_limits_nodes(s);
    fetch = timing_median(&b->ms[0]) / GL_LIMITS_TIMES * used;
    eye = timing_median(&b->ms[1]) / GL_LIMITS_TIMES * used * gaussians;
    light = timing_median(&b->ms[2]) / GL_LIMITS_TIMES * used * gaussians;
    limit = eye + (depth == SCATTER_DEPTH_CLOSED ? light : fetch);
    report_cell(r, "%s", scene_depth_name(depth));
    report_cell(r, "%d", nodes);
    report_cell(r, "%.2f", used);
    report_cell(r, "%.2f%s", timing_median(&way.rays), timing_flag(&way.rays));
    report_cell(r, "%.2f", eye);
    report_cell(r, "%.2f", depth == SCATTER_DEPTH_CLOSED ? light : 0.0);
    report_cell(r, "%.2f", depth == SCATTER_DEPTH_CLOSED ? 0.0 : fetch);
    report_cell(r, "%.0f", 100 * limit / timing_median(&way.rays));
    report_row(r, 1);
}

static void gl_limits_run(report *r)
{
    static const scatter_depth_method methods[] = {
        SCATTER_DEPTH_CLOSED, SCATTER_DEPTH_CLOSED_VOLUME, SCATTER_DEPTH_POLAR};
    gl_scene s;
    gl_limits b;
    int size = gl_size();
    report_text(r, "## Limits");
    gl_scene_open(&s, "bench/eight.scatter", size, size);
    gl_limits_open(&b, &s, size);
    for (int i = 0; i < GL_LIMITS_LOOPS; i++)
        report_text(r, "Alone, a pixel: %s %.3g ns%s.", gl_limits_names[i],
                    timing_median(&b.ms[i]) * 1e6 / GL_LIMITS_TIMES / size / size,
                    timing_flag(&b.ms[i]));
    report_text(r,
                "`eight`, %dx%d pixels. `nodes used`: a pixel's, by the debug view; then what so "
                "many nodes of 8 Gaussians would cost if they consisted of nothing but these: ms.",
                size, size);
    report_table(r, "gl_limits",
                 "depth|nodes|nodes used|view ms|eye ms|light ms|fetches ms|of the view %");
    for (int m = 0; m < 3; m++)
        for (int i = 0; i < 2; i++)
            gl_limits_row(r, &b, &s, methods[m], i ? 32 : 10);
    report_end(r);
    gl_limits_close(&b);
    gl_scene_close(&s);
}

#endif
