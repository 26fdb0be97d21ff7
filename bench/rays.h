/* rays.h - benchmark: images of every scene by every depth method, ray method and quality: time,
 * error, memory. MIT licence. */
#ifndef SCATTER_BENCH_RAYS_H
#define SCATTER_BENCH_RAYS_H

#include "chart.h"
#include "image.h"
#include <dirent.h>

enum {
    RAYS_LATTICE = 64, /* errors are taken at so many pixels of each row and column */
    RAYS_QUOTED = 256, /* pixels of a row of the images that times are quoted for */
    RAYS_FEW = 8,      /* Gaussians up to which, if there is nothing else, images are large */
    RAYS_MANY = 512,   /* Gaussians beyond which they are small, or it takes minutes */
    RAYS_SCENES = 32,
    RAYS_DEPTHS = 7,
    RAYS_STEPS = 15,
    RAYS_SETTINGS = 1 + RAYS_DEPTHS * RAYS_STEPS,
    RAYS_ROUNDS = 9,
    RAYS_SLOW = 50,      /* ms: what takes longer is timed twice, three times as long: once */
    RAYS_SLOWEST = 600,  /* ms: what is expected to take longer is left out */
    RAYS_BUDGET = 120000 /* ms, of all scenes; after the third, no round begins that does not fit */
};

/* The closed form first: the others are compared with it. */
static const scatter_depth_method rays_depths[RAYS_DEPTHS] = {
    SCATTER_DEPTH_CLOSED, SCATTER_DEPTH_CLOSED_VOLUME, SCATTER_DEPTH_POLAR, SCATTER_DEPTH_SHORT,
    SCATTER_DEPTH_UPWIND, SCATTER_DEPTH_EQ6,           SCATTER_DEPTH_MARCH};

/* From coarse to fine. Without a grid: for the closed form only. */
typedef struct rays_step {
    scatter_ray_method ray;
    int nodes, grid;
} rays_step;

static const rays_step rays_steps[RAYS_STEPS] = {
    {SCATTER_RAY_QUADRATURE, 4, 32},   {SCATTER_RAY_QUADRATURE, 8, 32},
    {SCATTER_RAY_QUADRATURE, 12, 64},  {SCATTER_RAY_QUADRATURE, 16, 64},
    {SCATTER_RAY_QUADRATURE, 16, 128}, {SCATTER_RAY_QUADRATURE, 32, 128},
    {SCATTER_RAY_QUADRATURE, 64, 0},   {SCATTER_RAY_QUADRATURE, 64, 192},
    {SCATTER_RAY_MARCH, 16, 32},       {SCATTER_RAY_MARCH, 32, 32},
    {SCATTER_RAY_MARCH, 64, 32},       {SCATTER_RAY_MARCH, 64, 64},
    {SCATTER_RAY_MARCH, 128, 64},      {SCATTER_RAY_MARCH, 256, 128},
    {SCATTER_RAY_MARCH, 512, 0}};

/* -------------------------------------------------------------------------------- the scenes */

typedef struct scene_list {
    char path[RAYS_SCENES][512];
    int count;
} scene_list;

static int path_order(const void *a, const void *b)
{
    return strcmp((const char *)a, (const char *)b);
}

/* Adds scene files with this text in them, "# smooth" for example, in the order of their names. */
static void list_scenes(scene_list *list, const char *folder, const char *text)
{
    DIR *directory = opendir(folder);
    struct dirent *entry;
    int first = list->count;
    if (!directory)
        report_die("cannot read", folder);
    while ((entry = readdir(directory)) != NULL && list->count < RAYS_SCENES) {
        char *path = list->path[list->count];
        size_t length = strlen(entry->d_name);
        if (length < 8 || strcmp(entry->d_name + length - 8, ".scatter") != 0)
            continue;
        snprintf(path, sizeof list->path[0], "%s/%s", folder, entry->d_name);
        list->count += scene_holds(path, text);
    }
    closedir(directory);
    if (list->count == first)
        report_die("no scenes in", folder);
    qsort(list->path + first, (size_t)(list->count - first), sizeof list->path[0], path_order);
}

static void list_smooth_scenes(scene_list *list, const char *folder)
{
    list->count = 0;
    list_scenes(list, folder, "# smooth");
}

/* All of examples/scenes/, and two that other programs render, too. */
static void list_all_scenes(scene_list *list)
{
    list->count = 0;
    list_scenes(list, "examples/scenes", "image");
    snprintf(list->path[list->count++], sizeof list->path[0], "bench/cloud.scatter");
    snprintf(list->path[list->count++], sizeof list->path[0], "bench/eight_two.scatter");
}

/* Of the two clouds it is the other that other programs render, so that one is called just so. */
static const char *rays_name(const char *path, char *name, size_t room)
{
    scene_short(path, name, room);
    if (strcmp(path, "examples/scenes/cloud.scatter") == 0)
        snprintf(name, room, "cloud_two_suns");
    return name;
}

/* ------------------------------------------------------------------ one scene, all settings */

/* The largest error of the closed form by quadrature over all smooth scenes, and where. */
typedef struct rays_worst {
    double rmse;
    char scene[64];
} rays_worst;

typedef struct rays_bench {
    setting s[RAYS_SETTINGS];
    int settings; /* that make a difference to this scene */
    scene_file file;
    scatter_view view;
    int size, lattice;            /* pixels of a row: of the image, and where errors are taken */
    float *rgb, *few, *reference; /* the image, its lattice, what that should be */
    rays_worst at16, at64;        /* nodes */
    int images, broken;           /* rendered so far, and those with a value that is not a number */
    int scenes, rounds;
    double spent; /* ms, of the budget */
} rays_bench;

/* Is a step of use? Fog has no depth method; the closed form has no grid; the methods that sweep or
   march from cell to cell take seconds for finer grids; the finest grid is for voxels. */
static int rays_is_useful(const scatter_medium *m, scatter_depth_method depth, int i)
{
    const rays_step *step = &rays_steps[i];
    int limit = m->grid_count > 0 ? 192 : 128;
    if (depth == SCATTER_DEPTH_CLOSED)
        return i == 0 || step->ray != rays_steps[i - 1].ray ||
               step->nodes != rays_steps[i - 1].nodes;
    if (depth != SCATTER_DEPTH_CLOSED_VOLUME && depth != SCATTER_DEPTH_POLAR)
        limit = 64;
    return m->gaussian_count + m->grid_count > 0 && step->grid > 0 &&
           step->grid <= by_level(32, 64, limit);
}

static void rays_settings(rays_bench *b)
{
    const scatter_medium *m = &b->file.scene.medium;
    b->s[0] = setting_of(SCATTER_DEPTH_AUTO, SCATTER_RAY_QUADRATURE, 0, 0); /* the defaults */
    b->settings = 1;
    for (int d = 0; d < RAYS_DEPTHS; d++)
        for (int i = 0; i < RAYS_STEPS; i++)
            if (rays_is_useful(m, rays_depths[d], i))
                b->s[b->settings++] =
                    setting_of(rays_depths[d], rays_steps[i].ray, rays_steps[i].nodes,
                               d > 0 ? rays_steps[i].grid : 0);
}

/* Is it expected to take too long, from the last setting of the same depth method that ran? */
static int rays_too_slow(const rays_bench *b, int i)
{
    const scatter_quality *q = &b->s[i].quality;
    for (int k = i - 1; k >= 0 && b->s[k].quality.depth == q->depth; k--) {
        const setting *last = &b->s[k];
        double finer = q->grid > 0 ? (double)q->grid / last->quality.grid : 1;
        double more = (double)q->nodes / last->quality.nodes;
        if (!last->skipped)
            return timing_min(&last->setup) * finer * finer * finer +
                       timing_min(&last->rays) * more >
                   RAYS_SLOWEST;
    }
    return 0;
}

/* Of one repeat, as it was measured. */
static double rays_ms(const setting *s)
{
    return timing_median(&s->setup) + timing_median(&s->rays);
}

static void rays_first(rays_bench *b, setting *s, const scatter_image *image)
{
    size_t values = (size_t)(3 * b->lattice * b->lattice);
    render_timed(s, &b->file.scene, &b->view, image);
    image_lattice(b->rgb, b->size, b->lattice, b->few);
    setting_compare(s, b->few, b->reference, values);
    b->images++;
    b->broken += !isfinite(s->rmse);
}

/* Every setting once; those that take long in the first rounds only. Returns the time, ms. */
static double rays_round(rays_bench *b, int round)
{
    double start = thread_ms();
    scatter_image image = image_of(b->rgb, b->size, b->size);
    for (int i = 0; i < b->settings; i++) {
        setting *s = &b->s[i];
        if (round == 0)
            s->skipped = rays_too_slow(b, i);
        if (s->skipped)
            s->rmse = NAN; /* unknown is not good */
        else if (round == 0)
            rays_first(b, s, &image);
        else if (rays_ms(s) <= (round == 1 ? 3 : 1) * RAYS_SLOW)
            render_timed(s, &b->file.scene, &b->view, &image);
    }
    return thread_ms() - start;
}

/* Pixels of a row: as many as let all settings run in a few seconds. Where the image is small, the
   reference's lattice is, too. */
static void rays_size(rays_bench *b)
{
    const scatter_medium *m = &b->file.scene.medium;
    int few = m->gaussian_count > 0 && m->gaussian_count <= RAYS_FEW && b->file.shape_count == 0;
    int large = few || b->file.width == RAYS_QUOTED; /* as other programs render it */
    int many = m->gaussian_count > RAYS_MANY;
    b->size = by_level(16, 64, large ? RAYS_QUOTED : many ? 64 : 128);
    b->lattice = by_level(8, 32, many ? RAYS_LATTICE / 2 : RAYS_LATTICE);
    b->view = scene_view(&b->file, b->size, b->size);
    for (int i = 0; i < b->settings; i++)
        b->s[i].scale = (double)(RAYS_QUOTED * RAYS_QUOTED) / (b->size * b->size);
}

/* As many rounds as fit into `budget` ms, three at least. */
static void rays_scene(rays_bench *b, const char *path, double budget)
{
    scene_must_read(&b->file, path);
    rays_settings(b);
    rays_size(b);
    scatter_view few = view_lattice(b->view, b->size, b->lattice);
    reference_of_file(&b->file, path, &few, b->lattice, b->reference);
    double spent = rays_round(b, 0), last = 0;
    int round = 1;
    for (; round < RAYS_ROUNDS && (round < by_level(1, 2, 3) || spent + last < budget); round++)
        spent += last = rays_round(b, round);
    b->spent += spent;
    b->scenes++;
    b->rounds += round;
}

/* ------------------------------------------------------------------------------------- report */

static void rays_times(report *r, const setting *s)
{
    report_cell(r, "%.4g", setting_ms(s));
    report_cell(r, "%.4g%s", timing_median(&s->setup), timing_flag(&s->setup));
    report_cell(r, "%.4g", timing_min(&s->setup));
    report_cell(r, "%.4g%s", timing_median(&s->rays), timing_flag(&s->rays));
    report_cell(r, "%.4g", timing_min(&s->rays));
    report_cell(r, "%.2g", 100 * timing_spread(&s->rays));
    report_cell(r, "%d", s->rays.n);
}

static void rays_row(report *r, const rays_bench *b, int i, const char *scene)
{
    const setting *s = &b->s[i];
    report_cell(r, "%s", scene);
    report_cell(r, "%d", b->size);
    report_cell(r, "%s", scene_depth_name(s->quality.depth));
    report_cell(r, "%s", scene_ray_name(s->quality.ray));
    report_cell(r, "%d", s->quality.nodes);
    report_cell(r, "%d", s->quality.grid);
    if (s->skipped) {
        report_cell(r, "left out: too slow");
    } else {
        rays_times(r, s);
        report_cell(r, "%.4g", 100 * s->rmse);
        report_cell(r, "%.4g", 100 * s->p99);
        report_cell(r, "%.4g", 100 * s->worst);
        report_cell(r, "%.2g", 100 * s->bias);
        report_cell(r, "%lu", (unsigned long)s->bytes);
        report_cell(r, "%s", on_front(s, b->s, b->settings) ? "*" : "");
    }
    report_row(r, i == 0);
}

static void rays_points(const rays_bench *b, const char *scene)
{
    FILE *csv = chart_open(scene, "points");
    fprintf(csv, "# %s: %dx%d pixels\n", scene, RAYS_QUOTED, RAYS_QUOTED);
    for (int i = 0; i < b->settings; i++)
        if (!b->s[i].skipped)
            chart_setting(csv, scene, &b->s[i]);
    chart_close(csv);
}

static void rays_note_worst(rays_worst *w, const rays_bench *b, int nodes, const char *scene)
{
    for (int i = 0; i < b->settings; i++) {
        const setting *s = &b->s[i];
        if (s->quality.depth == SCATTER_DEPTH_CLOSED && s->quality.ray == SCATTER_RAY_QUADRATURE &&
            s->quality.nodes == nodes && !s->skipped && !(s->rmse <= w->rmse)) {
            w->rmse = worse_of(w->rmse, s->rmse);
            snprintf(w->scene, sizeof w->scene, "%s", scene);
        }
    }
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
    report_claim(r, "smooth scenes, 16 nodes", "0.5 %", "%.3g %% at worst", 100 * b->at16.rmse);
    report_claim(r, "smooth scenes, 64 nodes", "0.01 %", "%.3g %% at worst", 100 * b->at64.rmse);
}

static void rays_explain(report *r)
{
    report_text(r, "## Every scene, depth method, ray method and quality");
    report_text(r,
                "All scenes of `examples/scenes/`, and two that other programs render, too; one "
                "thread. Measured are square images with this many pixels in a row (image); times "
                "in charts and tables of fronts are for %dx%d pixels: setup, and the time of the "
                "rays times the number of pixels. Errors are against the double-precision "
                "reference at %dx%d pixels of the image, over the mean of the reference: root mean "
                "square (RMSE), 99th percentile, largest, mean difference (bias). Shown are the "
                "defaults (0: the library chooses); `build/bench/rays.csv` has every setting.",
                RAYS_QUOTED, RAYS_QUOTED, RAYS_LATTICE, RAYS_LATTICE);
}

static const char rays_headings[] =
    "scene|image|depth|rays|nodes|grid|256x256, ms|setup ms|setup min ms|rays ms|rays min ms|"
    "rays spread %|n|RMSE %|99th percentile %|largest %|bias %|bytes|front";

static void rays_measure(report *r, rays_bench *b, const char *path, double budget)
{
    char name[64];
    rays_name(path, name, sizeof name);
    if (!scene_has_data(path)) {
        report_text(r, "%s: skipped: no data", name);
        return;
    }
    rays_scene(b, path, budget);
    for (int i = 0; i < b->settings; i++)
        rays_row(r, b, i, name);
    rays_points(b, name);
    if (scene_holds(path, "# smooth")) {
        rays_note_worst(&b->at16, b, 16, name);
        rays_note_worst(&b->at64, b, 64, name);
    }
    scene_free(&b->file);
}

/* A quick run takes every third scene, a test only one. */
static void rays_run(report *r)
{
    scene_list list;
    rays_bench b;
    memset(&b, 0, sizeof b);
    b.rgb = floats(3 * RAYS_QUOTED * RAYS_QUOTED);
    b.few = floats(3 * RAYS_LATTICE * RAYS_LATTICE);
    b.reference = floats(3 * RAYS_LATTICE * RAYS_LATTICE);
    list_all_scenes(&list);
    rays_explain(r);
    report_table(r, "rays", rays_headings);
    int count = by_level(2, list.count, list.count), step = by_level(1, 3, 1);
    double budget = by_level(0, RAYS_BUDGET / 10, RAYS_BUDGET);
    for (int i = by_level(1, 1, 0); i < count; i += step)
        rays_measure(r, &b, list.path[i], (budget - b.spent) * step / (count - i));
    report_end(r);
    report_text(r, "%d scenes, %d images, each setting %.1f times at the mean.", b.scenes, b.images,
                (double)b.rounds / b.scenes);
    rays_targets(r, &b);
    free(b.rgb);
    free(b.few);
    free(b.reference);
}

#endif
