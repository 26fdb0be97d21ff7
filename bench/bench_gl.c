/* bench_gl.c - speed against error of scatter_gl.h. MIT licence, see LICENSE.

   `make bench-gl` in the project's directory: prints the tables, writes docs/report_gl.md, the
   charts in docs/charts/gl/, a record for this renderer to bench/results/, and all rows as CSV to
   build/bench/gl/. It needs OpenGL 3.3 without a window and nothing else of the GPU: the same
   program measures a real one and Mesa's software. A missed target is reported, it does not fail
   the run.

   scatter-bench-gl [--quick | --test] [NAME...]: see program.h. */
#ifndef _POSIX_C_SOURCE
#define _POSIX_C_SOURCE 200809L
#endif

#define SCATTER_IMPLEMENTATION
#include "../scatter_gl.h"

#include "fronts.h"
#include "gl_frames.h"
#include "gl_limits.h"
#include "gl_settings.h"
#include "gl_shadow.h"
#include "gl_skip.h"
#include "gl_suns.h"
#include "program.h"
#include <ctype.h>

/* `fronts` comes last: it draws the points that the others have written. */
static const benchmark benchmarks[] = {
    {"shadow", gl_shadow_run, NULL, LEVEL_TEST},     /* against a shader with shadow rays */
    {"skip", gl_skip_run, NULL, LEVEL_TEST},         /* empty space: the paper's table */
    {"settings", gl_settings_run, NULL, LEVEL_TEST}, /* every method, nodes and cells */
    {"frames", gl_frames_run, NULL, LEVEL_TEST},     /* update and view at the usual sizes */
    {"costs", gl_costs_run, NULL, LEVEL_TEST},       /* of lights, Gaussians, formats */
    {"suns", gl_suns_run, NULL, LEVEL_TEST},         /* many lights, streams, tone mapping */
    {"limits", gl_limits_run, NULL, LEVEL_TEST},     /* fetches and arithmetic alone */
    {"fronts", fronts_run, NULL, LEVEL_TEST}         /* charts */
};

static void describe_gl(report *r)
{
    const gl_bench *g = the_gl();
    report_text(r, "# Speed against error of scatter_gl.h");
    report_text(r, "Written by `make bench-gl`; do not edit. Ratios come from interleaved runs in "
                   "one process. Times are medians of n repeats; `~` marks one more than 10 %% "
                   "above the minimum. Errors are those of pictures against the double-precision "
                   "reference, relative RMSE.");
    report_text(r, "Renderer: %s, by %s, OpenGL %s. Clock: %s.", g->renderer, g->vendor, g->version,
                gl_clock_names[g->clock]);
    describe_processor(r);
}

/* The name of the renderer as that of a file: letters and digits. */
static void results_name(char *name, size_t room)
{
    size_t n = 0;
    for (const char *c = the_gl()->renderer; *c && *c != '(' && n + 1 < room; c++)
        if (isalnum((unsigned char)*c))
            name[n++] = (char)tolower((unsigned char)*c);
        else if (n > 0 && name[n - 1] != '_')
            name[n++] = '_';
    while (n > 0 && name[n - 1] == '_')
        n--;
    name[n] = '\0';
}

/* What stands above the tables, the targets with their figures, for one renderer each. */
static void keep_results(report *r)
{
    char name[64], path[128];
    results_name(name, sizeof name);
    snprintf(path, sizeof path, "bench/results/%s.md", name);
    mkdir("bench/results", 0777);
    report_copy(r, REPORT_HEAD, path);
}

int main(int argc, char **argv)
{
    static const program bench = {benchmarks,       sizeof benchmarks / sizeof benchmarks[0],
                                  "build/bench/gl", "docs/report_gl.md",
                                  "docs/charts/gl", "charts/gl",
                                  describe_gl,      keep_results};
    return program_run(&bench, argc, argv);
}
