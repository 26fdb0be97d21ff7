/* promises.h - benchmark: no allocation while rendering, the same bits with any number of
 * threads. MIT licence. */
#ifndef SCATTER_BENCH_PROMISES_H
#define SCATTER_BENCH_PROMISES_H

#include "cloud.h"
#include "image.h"
#include "rays.h"

enum { PROMISES_WIDTH = 61, PROMISES_HEIGHT = 47, PROMISES_THREADS = 3 };

static const int promises_threads[PROMISES_THREADS] = {1, 2, 7};

typedef struct promises {
    size_t rendering, updating; /* allocations in scatter_render, in scatter_update */
    int images, different;      /* images compared, and those whose bits differ from one thread's */
    int settings_equal; /* images of other nodes that have the same bits: the comparison is blind */
} promises;

static void promises_render(promises *p, const scene_file *file, const scatter_quality *quality,
                            int threads, float *rgb)
{
    bench_host books = {0, threads};
    scatter_host host = host_of(&books);
    scatter_view view = scene_view(file, PROMISES_WIDTH, PROMISES_HEIGHT);
    scatter_image image = image_of(rgb, PROMISES_WIDTH, PROMISES_HEIGHT);
    scatter_context *context = NULL;
    must(scatter_create(&host, &context), "scatter_create");
    books.allocations = 0;
    must(scatter_update(context, &file->scene, quality), "scatter_update");
    p->updating += books.allocations;
    books.allocations = 0;
    must(scatter_render(context, &view, &image), "scatter_render");
    p->rendering += books.allocations;
    scatter_destroy(context);
}

static void promises_setting(promises *p, const scene_file *file, const scatter_quality *quality)
{
    size_t n = (size_t)3 * PROMISES_WIDTH * PROMISES_HEIGHT;
    float *one = floats(n), *other = floats(n);
    scatter_quality finer = *quality;
    promises_render(p, file, quality, 1, one);
    for (int t = 1; t < PROMISES_THREADS; t++) {
        promises_render(p, file, quality, promises_threads[t], other);
        p->images++;
        p->different += memcmp(one, other, n * sizeof *one) != 0;
    }
    finer.nodes = 2 * quality->nodes - 1;
    promises_render(p, file, &finer, 1, other);
    p->settings_equal += memcmp(one, other, n * sizeof *one) == 0;
    free(one);
    free(other);
}

static void promises_scene(promises *p, const char *path)
{
    static const scatter_depth_method methods[3] = {SCATTER_DEPTH_AUTO, SCATTER_DEPTH_CLOSED_VOLUME,
                                                    SCATTER_DEPTH_POLAR};
    scene_file file;
    scatter_quality quality;
    memset(&quality, 0, sizeof quality);
    scene_must_read(&file, path);
    quality.grid = 32;
    for (int i = 0; i < 3; i++) {
        quality.depth = methods[i];
        quality.ray = i == 2 ? SCATTER_RAY_MARCH : SCATTER_RAY_QUADRATURE;
        quality.density = i == 2 ? SCATTER_DENSITY_VOLUME : SCATTER_DENSITY_AUTO;
        quality.nodes = i == 2 ? 40 : 8;
        promises_setting(p, &file, &quality);
    }
    scene_free(&file);
}

static void promises_run(report *r)
{
    scene_list list;
    promises p;
    memset(&p, 0, sizeof p);
    list_smooth_scenes(&list, "examples/scenes");
    for (int i = 0; i < by_level(1, 3, list.count); i++)
        promises_scene(&p, list.path[i]);
    if (level == LEVEL_FULL && cloud_is_there())
        promises_scene(&p, cloud_paths[0]);
    report_text(r, "## Promises");
    report_text(r,
                "All smooth scenes, and the cloud where its data is, each with three "
                "combinations of methods, %dx%d pixels.",
                PROMISES_WIDTH, PROMISES_HEIGHT);
    report_target(r, p.rendering == 0 && p.updating > 0, "allocations in scatter_render: 0",
                  "%lu (the same counter saw %lu in scatter_update)", (unsigned long)p.rendering,
                  (unsigned long)p.updating);
    report_target(r, p.different == 0 && p.settings_equal == 0, "same bits with 1, 2 and 7 threads",
                  "%d of %d images differ (and %d do not where the nodes differ)", p.different,
                  p.images, p.settings_equal);
    report_claim(r, "allocations while rendering", "0", "%lu", (unsigned long)p.rendering);
    report_claim(r, "images whose bits differ between 1, 2 and 7 threads", "0", "%d of %d",
                 p.different, p.images);
}

#endif
