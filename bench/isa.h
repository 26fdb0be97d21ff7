/* isa.h - benchmark: one binary, several instruction sets: how far their images differ, and what
 * each is worth. MIT licence. */
#ifndef SCATTER_BENCH_ISA_H
#define SCATTER_BENCH_ISA_H

#include "isa_render.h"
#include "rays.h"

#if defined(BENCH_ISA) && defined(__x86_64__)

enum { ISA_SETS = 4, ISA_SMALL = 64, ISA_LARGE = 512 };

/* The last one is the library as everybody compiles it: it chooses by itself. */
static const char *const isa_names[ISA_SETS] = {"SSE2 (x86-64)", "AVX2 (x86-64-v3)",
                                                "AVX-512 (x86-64-v4)", "as compiled: chooses"};

typedef struct isa_bench {
    float *rgb[ISA_SETS];
    timing ms[ISA_SETS];
    image_errors off[ISA_SETS]; /* from the last one's images, the worst of all scenes */
} isa_bench;

static scatter_result isa_own(const scatter_scene *scene, const scatter_quality *quality,
                              const scatter_view *view, const scatter_image *image,
                              double (*clock)(void), double *ms)
{
    scatter_context *context = NULL;
    must(scatter_create(NULL, &context), "scatter_create");
    double start = clock();
    must(scatter_update(context, scene, quality), "scatter_update");
    must(scatter_render(context, view, image), "scatter_render");
    *ms = clock() - start;
    scatter_destroy(context);
    return SCATTER_OK;
}

static isa_render *const isa_renders[ISA_SETS] = {isa_render_sse2, isa_render_avx2,
                                                  isa_render_avx512, isa_own};

static int isa_runs_here(int i)
{
    __builtin_cpu_init();
    if (i == 1)
        return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
    return i != 2 || (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
                      __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl"));
}

/* All of them once, in turn. */
static void isa_round(isa_bench *b, const scene_file *file, int size, int nodes, int timed)
{
    scatter_view view = scene_view(file, size, size);
    scatter_quality quality;
    memset(&quality, 0, sizeof quality);
    quality.nodes = nodes;
    for (int i = 0; i < ISA_SETS; i++) {
        scatter_image image = image_of(b->rgb[i], size, size);
        double ms;
        if (!isa_runs_here(i))
            continue;
        must(isa_renders[i](&file->scene, &quality, &view, &image, thread_ms, &ms), isa_names[i]);
        if (timed)
            timing_add(&b->ms[i], ms);
    }
}

/* Every pixel of every smooth scene. */
static void isa_differences(isa_bench *b, const scene_list *list)
{
    size_t values = (size_t)3 * ISA_SMALL * ISA_SMALL;
    for (int k = 0; k < by_level(1, list->count, list->count); k++) {
        scene_file file;
        scene_must_read(&file, list->path[k]);
        isa_round(b, &file, ISA_SMALL, 16, 0);
        for (int i = 0; i < ISA_SETS; i++) {
            if (!isa_runs_here(i))
                continue;
            image_errors e = errors_of(b->rgb[i], b->rgb[ISA_SETS - 1], values);
            b->off[i].rmse = worse_of(b->off[i].rmse, e.rmse);
            b->off[i].most = worse_of(b->off[i].most, e.most);
        }
        scene_free(&file);
    }
}

static void isa_table(report *r, const isa_bench *b)
{
    report_table(r, "isa",
                 "instructions|ms|min ms|n|times as fast as SSE2|RMS difference %|"
                 "largest difference %");
    for (int i = 0; i < ISA_SETS; i++) {
        report_cell(r, "%s", isa_names[i]);
        if (!isa_runs_here(i)) {
            report_cell(r, "skipped: this processor has it not");
            report_row(r, 1);
            continue;
        }
        report_cell(r, "%.1f%s", timing_median(&b->ms[i]), timing_flag(&b->ms[i]));
        report_cell(r, "%.1f", timing_min(&b->ms[i]));
        report_cell(r, "%d", b->ms[i].n);
        report_cell(r, "%.2f", timing_median(&b->ms[0]) / timing_median(&b->ms[i]));
        report_cell(r, "%.2g", 100 * b->off[i].rmse);
        report_cell(r, "%.2g", 100 * b->off[i].most);
        report_row(r, 1);
    }
    report_end(r);
}

static void isa_targets(report *r, const isa_bench *b)
{
    double most = 0, rmse = 0, fastest = 1e30;
    for (int i = 0; i < ISA_SETS; i++) {
        most = worse_of(most, b->off[i].most);
        rmse = worse_of(rmse, b->off[i].rmse);
        if (isa_runs_here(i))
            fastest = fmin(fastest, timing_median(&b->ms[i]));
    }
    report_target(r, rmse <= 1e-4, "images of SSE2, AVX2, AVX-512: RMS difference <= 0.01 %",
                  "%.2g %%, of a single pixel %.2g %%", 100 * rmse, 100 * most);
    report_target(r, timing_median(&b->ms[ISA_SETS - 1]) <= 1.05 * fastest,
                  "the choice at run time costs <= 5 % of the fastest build",
                  "%.1f against %.1f ms", timing_median(&b->ms[ISA_SETS - 1]), fastest);
}

static void isa_run(report *r)
{
    static const char path[] = "bench/eight.scatter";
    isa_bench b;
    scene_list list;
    scene_file file;
    int size = by_level(ISA_SMALL, 256, ISA_LARGE);
    memset(&b, 0, sizeof b);
    for (int i = 0; i < ISA_SETS; i++)
        b.rgb[i] = floats((size_t)3 * ISA_LARGE * ISA_LARGE);
    list_smooth_scenes(&list, "examples/scenes");
    report_text(r, "## Instruction sets");
    report_text(r,
                "The library compiled for one instruction set each, and as it is: `%s`, 512x512, "
                "12 nodes, all in turn. Differences are from the last one's images of all smooth "
                "scenes, %dx%d with 16 nodes, over their mean.",
                path, ISA_SMALL, ISA_SMALL);
    isa_differences(&b, &list);
    scene_must_read(&file, path);
    for (int round = 0; round < by_level(1, 5, 15); round++)
        isa_round(&b, &file, size, 12, 1);
    scene_free(&file);
    isa_table(r, &b);
    isa_targets(r, &b);
    for (int i = 0; i < ISA_SETS; i++)
        free(b.rgb[i]);
}

#else

static void isa_run(report *r)
{
    report_text(r, "## Instruction sets");
    report_text(r, "skipped: not x86-64");
}

#endif
#endif
