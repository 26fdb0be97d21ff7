/* image.h - what the image benchmarks share: scenes, cached references, timed renderings, fronts.
 * MIT licence. */
#ifndef SCATTER_BENCH_IMAGE_H
#define SCATTER_BENCH_IMAGE_H

#include "../examples/files.h"
#include "../examples/scene.h"
#include "measure.h"
#include "report.h"

/* ---------------------------------------------------------------------------------- settings */

/* One way to make an image. */
typedef struct setting {
    scatter_quality quality;
    int threads;
    int on_wall; /* which clock: on the wall, or the processor time of the one thread */
    int skipped; /* it would have taken too long */
    double rmse, worst, p99, bias; /* as in image_errors */
    timing setup, rays;            /* ms: scatter_update in a fresh context, scatter_render */
    double scale; /* pixels of the image that times are quoted for, over pixels rendered */
    size_t bytes; /* that the context holds */
} setting;

static setting setting_of(scatter_depth_method depth, scatter_ray_method ray, int nodes, int grid)
{
    setting s;
    memset(&s, 0, sizeof s);
    s.quality.depth = depth;
    s.quality.ray = ray;
    s.quality.nodes = nodes;
    s.quality.grid = grid;
    s.threads = 1;
    s.scale = 1;
    return s;
}

static double setting_ms(const setting *s)
{
    return timing_median(&s->setup) + timing_median(&s->rays) * s->scale;
}

/* Does none of them beat it? */
static inline int on_front(const setting *s, const setting *all, int n)
{
    int beaten = s->skipped || isnan(s->rmse);
    for (int i = 0; i < n && !beaten; i++)
        beaten = !all[i].skipped && beats(setting_ms(&all[i]), all[i].rmse, setting_ms(s), s->rmse);
    return !beaten;
}

/* ---------------------------------------------------------------------------------- pictures */

static inline scatter_image image_of(float *rgb, int width, int height)
{
    scatter_image image;
    memset(&image, 0, sizeof image);
    image.width = width;
    image.height = height;
    image.rgb = rgb;
    return image;
}

/* Update in a fresh context and render, both timed. */
static inline void render_timed(setting *s, const scatter_scene *scene, const scatter_view *view,
                         const scatter_image *image)
{
    bench_host books = {0, s->threads};
    scatter_host host = host_of(&books);
    scatter_context *context = NULL;
    clockid_t id = s->on_wall ? CLOCK_MONOTONIC : CLOCK_THREAD_CPUTIME_ID;
    must(scatter_create(&host, &context), "scatter_create");
    double start = clock_ms(id);
    must(scatter_update(context, scene, &s->quality), "scatter_update");
    double ready = clock_ms(id);
    must(scatter_render(context, view, image), "scatter_render");
    timing_add(&s->rays, clock_ms(id) - ready);
    timing_add(&s->setup, ready - start);
    s->bytes = scatter_get_stats(context).bytes;
    scatter_destroy(context);
}

static void setting_compare(setting *s, const float *rgb, const float *reference, size_t values)
{
    image_errors e = errors_of(rgb, reference, values);
    s->rmse = e.rmse;
    s->worst = e.most;
    s->p99 = e.p99;
    s->bias = e.bias;
}

/* The view whose count x count pixel centres are every (size/count)-th pixel centre of a size x
 * size image. */
static scatter_view view_lattice(scatter_view view, int size, int count)
{
    int stride = size / count;
    float shift = (float)((stride / 2 + 0.5) / size - 0.5 / count);
    scatter_view out = view;
    out.origin = scatter_v3(view.origin.x + shift * (view.origin_dx.x + view.origin_dy.x),
                            view.origin.y + shift * (view.origin_dx.y + view.origin_dy.y),
                            view.origin.z + shift * (view.origin_dx.z + view.origin_dy.z));
    out.direction =
        scatter_v3(view.direction.x + shift * (view.direction_dx.x + view.direction_dy.x),
                   view.direction.y + shift * (view.direction_dx.y + view.direction_dy.y),
                   view.direction.z + shift * (view.direction_dx.z + view.direction_dy.z));
    return out;
}

/* Those pixels of the large image. */
static void image_lattice(const float *rgb, int size, int count, float *out)
{
    int stride = size / count, first = stride / 2;
    for (int y = 0; y < count; y++)
        for (int x = 0; x < count; x++)
            memcpy(out + 3 * (y * count + x),
                   rgb + 3 * ((first + y * stride) * size + first + x * stride), 3 * sizeof *out);
}

/* -------------------------------------------------------------------------------- references */

#define HASH_START 14695981039346656037ull

/* FNV-1a, 64 bits. */
static uint64_t hash_bytes(uint64_t hash, const void *bytes, size_t n)
{
    for (size_t i = 0; i < n; i++)
        hash = (hash ^ ((const unsigned char *)bytes)[i]) * 1099511628211ull;
    return hash;
}

static uint64_t hash_file(uint64_t hash, const char *path)
{
    file_error error;
    char *text;
    size_t bytes;
    if (file_read(path, SIZE_MAX, &text, &bytes, &error) != 0)
        report_die("cannot read", path);
    hash = hash_bytes(hash, text, bytes);
    free(text);
    return hash;
}

/* Renders the reference once; it is kept in build/bench/ under a name that changes with `key`, with
   the reference's own source and with the view. `rgb` takes 3 size^2 floats. */
static void reference_cached(const scatter_scene *scene, const char *title, uint64_t key,
                             const scatter_view *view, int size, float *rgb)
{
    char name[128];
    file_picture kept;
    file_error error;
    uint64_t hash = hash_bytes(hash_file(key, "tests/reference.c"), view, sizeof *view);
    snprintf(name, sizeof name, "build/bench/reference-%016llx-%d.pfm", (unsigned long long)hash,
             size);
    if (file_pfm_read(name, &kept, &error) == 0) {
        memcpy(rgb, kept.rgb, (size_t)size * (size_t)size * 3 * sizeof *rgb);
        free(kept.rgb);
        return;
    }
    double start = wall_ms();
    fprintf(stderr, "reference of %s, %dx%d ...", title, size, size);
    if (reference_image(scene, view, size, size, rgb, processors()) != 0)
        must(SCATTER_OUT_OF_MEMORY, "reference_image");
    fprintf(stderr, " %.1f s\n", (wall_ms() - start) * 1e-3);
    kept.rgb = rgb;
    kept.width = kept.height = size;
    if (file_pfm_write(name, &kept, &error) != 0)
        report_die("cannot write", name);
}

static void reference_of_file(const scene_file *file, const char *path, const scatter_view *view,
                              int size, float *rgb)
{
    reference_cached(&file->scene, path, hash_file(HASH_START, path), view, size, rgb);
}

static inline int scene_holds(const char *path, const char *words)
{
    char *text = report_file(path);
    int found = strstr(text, words) != NULL;
    free(text);
    return found;
}

/* Are the voxels there that its lines "grid FILE ..." name, relative to the scene file? */
static int scene_has_data(const char *path)
{
    char *text = report_file(path), file[256], there[512];
    const char *slash = strrchr(path, '/');
    int found = 1;
    for (char *at = strstr(text, "\ngrid "); at && found; at = strstr(at + 1, "\ngrid ")) {
        found = sscanf(at, " grid %255s", file) == 1;
        snprintf(there, sizeof there, "%.*s%s", slash ? (int)(slash + 1 - path) : 0, path, file);
        found = found && access(there, R_OK) == 0;
    }
    free(text);
    return found;
}

static void scene_must_read(scene_file *file, const char *path)
{
    if (scene_read(file, path) == 0)
        return;
    fprintf(stderr, "bench: %s\n", file->error);
    exit(1);
}

/* The file's name without folder and ending. */
static const char *scene_short(const char *path, char *name, size_t room)
{
    const char *slash = strrchr(path, '/');
    snprintf(name, room, "%s", slash ? slash + 1 : path);
    name[strcspn(name, ".")] = '\0';
    return name;
}

#endif
