/* rays.h - benchmark 2: images of all smooth scenes, every depth and ray method, error against
 * time. MIT licence. */
#ifndef SCATTER_BENCH_RAYS_H
#define SCATTER_BENCH_RAYS_H

#include "image.h"
#include <dirent.h>

enum {
    RAYS_SIZE = 128, /* pixels along the edge of the square images */
    RAYS_SMALL = 32, /* the same where Gaussians are so many that the reference takes minutes */
    RAYS_MANY = 64,  /* Gaussians beyond which that is so */
    RAYS_SCENES = 32,
    RAYS_DEPTHS = 3,
    RAYS_STEPS = 11,
    RAYS_SETTINGS = RAYS_DEPTHS * RAYS_STEPS
};

static const scatter_depth_method rays_depths[RAYS_DEPTHS] = {
    SCATTER_DEPTH_CLOSED, SCATTER_DEPTH_CLOSED_VOLUME, SCATTER_DEPTH_POLAR};

static const int rays_nodes[RAYS_STEPS] = {4, 8, 16, 32, 64, 16, 32, 64, 128, 256, 512};

typedef struct scene_list {
    char path[RAYS_SCENES][256];
    int count;
} scene_list;

static int path_order(const void *a, const void *b)
{
    return strcmp((const char *)a, (const char *)b);
}

/* Smooth scenes carry a comment `# smooth`. */
static int is_smooth(const char *path)
{
    file_error error;
    char *text;
    size_t bytes;
    if (file_read(path, SIZE_MAX, &text, &bytes, &error) != 0)
        report_die("cannot read", path);
    int found = strstr(text, "# smooth") != NULL;
    free(text);
    return found;
}

static void list_smooth_scenes(scene_list *list, const char *folder)
{
    DIR *directory = opendir(folder);
    struct dirent *entry;
    list->count = 0;
    if (!directory)
        report_die("cannot read", folder);
    while ((entry = readdir(directory)) != NULL && list->count < RAYS_SCENES) {
        char *path = list->path[list->count];
        size_t length = strlen(entry->d_name);
        if (length < 8 || strcmp(entry->d_name + length - 8, ".scatter") != 0)
            continue;
        snprintf(path, sizeof list->path[0], "%s/%s", folder, entry->d_name);
        if (is_smooth(path))
            list->count++;
    }
    closedir(directory);
    if (list->count == 0)
        report_die("no smooth scenes in", folder);
    qsort(list->path, (size_t)list->count, sizeof list->path[0], path_order);
}

/* ------------------------------------------------------------------ one scene, all settings */

/* The largest error of the closed form by quadrature over all scenes, and where. */
typedef struct rays_worst {
    double rmse;
    char scene[64];
} rays_worst;

typedef struct rays_bench {
    setting s[RAYS_SETTINGS];
    float *rgb, *reference;
    rays_worst at16, at64; /* nodes */
    int images, broken;    /* rendered so far, and those with a value that is not a number */
    int size;              /* of this scene's images */
    double budget_ms;      /* for the repeats of one scene */
} rays_bench;

static void rays_settings(rays_bench *b)
{
    for (int d = 0; d < RAYS_DEPTHS; d++)
        for (int i = 0; i < RAYS_STEPS; i++)
            b->s[d * RAYS_STEPS + i] =
                setting_of(rays_depths[d], i < 5 ? SCATTER_RAY_QUADRATURE : SCATTER_RAY_MARCH,
                           rays_nodes[i], 64);
}

/* Doubling the nodes doubles the time at most; what would take over two seconds is left out. */
static int rays_too_slow(const rays_bench *b, int i)
{
    const setting *half = &b->s[i - 1];
    if (i % RAYS_STEPS == 0 || half->quality.ray != b->s[i].quality.ray)
        return 0;
    return half->skipped || timing_min(&half->rays) > 1000;
}

static double rays_round(rays_bench *b, const scene_file *file, const scatter_view *view, int first)
{
    double start = wall_ms();
    scatter_image image = image_of(b->rgb, b->size, b->size);
    for (int i = 0; i < RAYS_SETTINGS; i++) {
        setting *s = &b->s[i];
        if (first)
            s->skipped = rays_too_slow(b, i);
        if (s->skipped)
            s->rmse = NAN; /* unknown is not good */
        if (s->skipped || (!first && timing_min(&s->rays) > 250))
            continue;
        render_timed(s, &file->scene, view, &image);
        if (first)
            setting_compare(s, b->rgb, b->reference, (size_t)(3 * b->size * b->size));
    }
    return wall_ms() - start;
}

static void rays_row(report *r, const rays_bench *b, int i, const char *scene)
{
    const setting *s = &b->s[i];
    int front = on_front(s, b->s, RAYS_SETTINGS);
    report_cell(r, "%s", scene);
    report_cell(r, "%d", b->size);
    report_cell(r, "%s", scene_depth_name(s->quality.depth));
    report_cell(r, "%s", scene_ray_name(s->quality.ray));
    report_cell(r, "%d", s->quality.nodes);
    if (s->skipped) {
        report_cell(r, "skipped");
        report_row(r, 0);
        return;
    }
    report_cell(r, "%.3g", timing_median(&s->setup));
    report_cell(r, "%.3g%s", timing_median(&s->rays), timing_flag(&s->rays));
    report_cell(r, "%.3g", timing_min(&s->rays));
    report_cell(r, "%d", s->rays.n);
    report_cell(r, "%.3g", 100 * s->rmse);
    report_cell(r, "%.3g", 100 * s->worst);
    report_cell(r, "%s", front ? "*" : "");
    report_row(r, front);
}

static void rays_count_broken(rays_bench *b)
{
    for (int i = 0; i < RAYS_SETTINGS; i++) {
        b->images += !b->s[i].skipped;
        b->broken += !b->s[i].skipped && !isfinite(b->s[i].rmse);
    }
}

static void rays_scene(rays_bench *b, const char *path)
{
    scene_file file;
    scatter_view view;
    scene_must_read(&file, path);
    b->size = file.scene.medium.gaussian_count > RAYS_MANY ? RAYS_SMALL : RAYS_SIZE;
    view = scene_view(&file, b->size, b->size);
    rays_settings(b);
    reference_of_file(&file, path, &view, b->size, b->reference);
    double spent = rays_round(b, &file, &view, 1), last = 0;
    for (int round = 1; round < 7 && (round < 2 || spent + last < b->budget_ms); round++)
        spent += last = rays_round(b, &file, &view, 0);
    scene_free(&file);
}

static void rays_note_worst(rays_worst *w, const setting *s, const char *scene)
{
    if (isnan(w->rmse) || s->rmse <= w->rmse)
        return;
    w->rmse = s->rmse;
    snprintf(w->scene, sizeof w->scene, "%s", scene);
}

static void rays_targets(report *r, const rays_bench *b)
{
    report_target(r, b->at16.rmse <= 0.005,
                  "closed form, quadrature, 16 nodes: RMSE <= 0.5 % on smooth scenes",
                  "%.3g %% at worst (%s)", 100 * b->at16.rmse, b->at16.scene);
    report_target(r, b->at64.rmse <= 1e-4,
                  "closed form, quadrature, 64 nodes: RMSE <= 0.01 % on smooth scenes",
                  "%.3g %% at worst (%s)", 100 * b->at64.rmse, b->at64.scene);
    report_target(r, b->broken == 0, "every pixel of every image is a number",
                  "%d of %d images are broken", b->broken, b->images);
}

static void rays_run(report *r)
{
    scene_list list;
    rays_bench b;
    memset(&b, 0, sizeof b);
    b.rgb = floats(3 * RAYS_SIZE * RAYS_SIZE);
    b.reference = floats(3 * RAYS_SIZE * RAYS_SIZE);
    list_smooth_scenes(&list, "examples/scenes");
    b.budget_ms = 60e3 / list.count;
    report_text(r, "## 2. Smooth scenes");
    report_text(r,
                "All scenes of `examples/scenes/` that are marked `# smooth`, one thread, grid "
                "64; image is the edge of the square picture, small where the reference would "
                "take minutes. Errors against the double-precision reference: RMSE and largest "
                "error over the mean of the reference. Shown are the settings on the front of "
                "each scene: none is as fast (setup + rays) and as accurate. "
                "`build/bench/rays.csv` has all %d settings of each scene.",
                RAYS_SETTINGS);
    report_table(r, "rays",
                 "scene|image|depth|rays|nodes|setup ms|rays ms|min ms|n|RMSE %|largest %|front");
    for (int i = 0; i < list.count; i++) {
        char name[64];
        scene_short(list.path[i], name, sizeof name);
        rays_scene(&b, list.path[i]);
        for (int s = 0; s < RAYS_SETTINGS; s++)
            rays_row(r, &b, s, name);
        rays_count_broken(&b);
        rays_note_worst(&b.at16, &b.s[2], name);
        rays_note_worst(&b.at64, &b.s[4], name);
    }
    report_end(r);
    rays_targets(r, &b);
    free(b.rgb);
    free(b.reference);
}

#endif
