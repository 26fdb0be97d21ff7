/* suns.h - benchmark: many directional lights, light volumes against shadow rays; volumes redone in
 * turn. MIT licence. */
#ifndef SCATTER_BENCH_SUNS_H
#define SCATTER_BENCH_SUNS_H

#include "chart.h"
#include "cloud.h"
#include "plans.h"

#define SUNS_SMOKE "../shared/data/volumes/ispc_smoke_48x64x48.vol.txt"

enum {
    SUNS_MEDIA = 2,
    SUNS_COUNTS = 4, /* and 20 */
    SUNS_GRIDS = 4,
    SUNS_NODES = 3,
    SUNS_SETTINGS = SUNS_GRIDS * SUNS_NODES,
    SUNS_SHADOWS = 3, /* settings with shadow rays */
    SUNS_MOST = 64,   /* lights */
    SUNS_FINE = 256,  /* voxels along an axis of the second medium */
    SUNS_TILE = 16,   /* pixels */
    SUNS_STEP = 128,  /* pixels from tile to tile of the sample */
    SUNS_BEST = 64,   /* nodes of the reference */
    SUNS_BLOCK = 4,   /* pixels of a tile that are compared */
    SUNS_TURNS = 6,
    SUNS_SMOKE_SIDE = 48
};

static const int suns_counts[SUNS_COUNTS] = {1, 4, 16, 64};
static const int suns_grids[SUNS_GRIDS] = {96, 128, 192, 256};
static const int suns_nodes[SUNS_NODES] = {8, 16, 32};
static const int suns_shadows[SUNS_SHADOWS] = {8, 16, 32}; /* nodes */

typedef struct suns_bench {
    const char *title, *name;
    scene_file file;
    scatter_scene scene;
    scatter_grid grid;
    float *fine; /* voxels of the second medium */
    scatter_light lights[SUNS_MOST];
    scatter_view view;
    float *rgb, *reference;
    setting volume[SUNS_SETTINGS], shadow[SUNS_SHADOWS];
} suns_bench;

static int suns_size(void)
{
    return by_level(128, 256, 512);
}

static size_t suns_floats(void)
{
    return (size_t)3 * (size_t)suns_size() * (size_t)suns_size();
}

static int suns_used_settings(void)
{
    return by_level(1, 6, SUNS_SETTINGS);
}

static int suns_used_shadows(void)
{
    return by_level(1, 2, SUNS_SHADOWS);
}

/* ------------------------------------------------------------------------------------ lights */

/* A sky: directions spread evenly, intensities between 1 and 3, 4 pi W/m2 altogether. */
static void suns_fill_sky(scatter_light *lights, int count)
{
    float sum = 0;
    memset(lights, 0, (size_t)count * sizeof *lights);
    for (int i = 0; i < count; i++) {
        float z = 1 - 2 * ((float)i + 0.5f) / (float)count, phi = 2.3999632f * (float)i;
        float r = sqrtf(1 - z * z), e = 2 + sinf(3 * (float)i);
        lights[i].kind = SCATTER_LIGHT_DIRECTIONAL;
        lights[i].direction = scatter_v3(r * cosf(phi), -0.1f - 0.9f * z, r * sinf(phi));
        lights[i].intensity = scatter_v3(e, 0.9f * e, 0.8f * e);
        sum += e;
    }
    for (int i = 0; i < count; i++)
        lights[i].intensity = scatteri_scale(lights[i].intensity, 12.566371f / sum);
}

/* About the y axis. */
static void suns_turn(scatter_light *lights, int count, double angle)
{
    float c = (float)cos(angle), s = (float)sin(angle);
    for (int i = 0; i < count; i++) {
        scatter_vec3 d = lights[i].direction;
        lights[i].direction = scatter_v3(c * d.x + s * d.z, d.y, c * d.z - s * d.x);
    }
}

/* ------------------------------------------------------------------------------------ sample */

/* Renders a tile in each square of SUNS_STEP pixels; `side`: of what is rendered of it. */
static void suns_render_sample(const scatter_context *c, const scatter_view *view, int side,
                               float *rgb)
{
    scatter_image image = image_of(rgb, suns_size(), suns_size());
    for (int y = 0; y < suns_size(); y += SUNS_STEP)
        for (int x = 0; x < suns_size(); x += SUNS_STEP) {
            image.x0 = x + SUNS_STEP / 2 - SUNS_TILE / 2;
            image.y0 = y + SUNS_STEP / 2 - SUNS_TILE / 2;
            image.x1 = image.x0 + side;
            image.y1 = image.y0 + side;
            must(scatter_render(c, view, &image), "scatter_render");
        }
}

/* The pixels that are compared, one after another; returns how many values. */
static size_t suns_pick(const float *rgb, float *out)
{
    size_t n = 0;
    for (int y = SUNS_STEP / 2 - SUNS_TILE / 2; y < suns_size(); y += SUNS_STEP)
        for (int x = SUNS_STEP / 2 - SUNS_TILE / 2; x < suns_size(); x += SUNS_STEP)
            for (int i = 0; i < SUNS_BLOCK; i++, n += 3 * SUNS_BLOCK)
                memcpy(out + n, rgb + 3 * ((y + i) * suns_size() + x),
                       3 * SUNS_BLOCK * sizeof *out);
    return n;
}

/* Setup in a fresh context and rays of the sample; with shadow rays only of what is compared. */
static void suns_measure(suns_bench *b, setting *s)
{
    bench_host books = {0, 1};
    scatter_host host = host_of(&books);
    scatter_context *c = NULL;
    int side = s->quality.depth == SCATTER_DEPTH_CLOSED ? SUNS_BLOCK : SUNS_TILE;
    must(scatter_create(&host, &c), "scatter_create");
    double start = thread_ms();
    must(scatter_update(c, &b->scene, &s->quality), "scatter_update");
    double ready = thread_ms();
    suns_render_sample(c, &b->view, side, b->rgb);
    timing_add(&s->rays, thread_ms() - ready);
    timing_add(&s->setup, ready - start);
    s->scale = (double)(SUNS_STEP * SUNS_STEP) / (side * side);
    s->bytes = scatter_get_stats(c).bytes;
    scatter_destroy(c);
}

static void suns_compare(const suns_bench *b, setting *s)
{
    float *value = floats(suns_floats()), *truth = floats(suns_floats());
    suns_pick(b->rgb, value);
    setting_compare(s, value, truth, suns_pick(b->reference, truth));
    free(value);
    free(truth);
}

/* --------------------------------------------------------------------------- volumes and rays */

static void suns_reference(suns_bench *b)
{
    setting s = setting_of(SCATTER_DEPTH_CLOSED, SCATTER_RAY_QUADRATURE, SUNS_BEST, 0);
    float *rgb = b->rgb;
    b->rgb = b->reference;
    suns_measure(b, &s);
    b->rgb = rgb;
}

static void suns_row(report *r, const suns_bench *b, const setting *s)
{
    report_cell(r, "%s", b->title);
    report_cell(r, "%d", (int)b->scene.light_count);
    report_cell(r, "%s", s->quality.depth == SCATTER_DEPTH_CLOSED ? "shadow rays" : "volumes");
    report_cell(r, "%d", s->quality.nodes);
    report_cell(r, "%d", s->quality.grid);
    report_cell(r, "%.4g", timing_median(&s->setup));
    report_cell(r, "%.4g", timing_median(&s->rays) * s->scale);
    report_cell(r, "%.4g", setting_ms(s));
    report_cell(r, "%.3g", 100 * s->rmse);
    report_cell(r, "%.1f", (double)s->bytes / 1048576);
    report_row(r, s->quality.depth == SCATTER_DEPTH_CLOSED ||
                      on_front(s, b->volume, suns_used_settings()));
}

static void suns_chart(const suns_bench *b)
{
    char scene[64];
    snprintf(scene, sizeof scene, "suns_%s_%d", b->name, (int)b->scene.light_count);
    FILE *csv = chart_open(scene, "points");
    fprintf(csv, "# %s, directional lights: %d, %dx%d\n", b->title, (int)b->scene.light_count,
            suns_size(), suns_size());
    for (int i = 0; i < suns_used_settings(); i++)
        chart_setting(csv, scene, &b->volume[i]);
    for (int i = 0; i < suns_used_shadows(); i++)
        chart_setting(csv, scene, &b->shadow[i]);
    chart_close(csv);
}

/* The fastest of some settings with at most this error; NULL: none. */
static const setting *suns_fastest(const setting *s, int n, double error)
{
    const setting *best = NULL;
    for (int i = 0; i < n; i++)
        if (s[i].rmse <= error && (!best || setting_ms(&s[i]) < setting_ms(best)))
            best = &s[i];
    return best;
}

static void suns_target(report *r, const suns_bench *b)
{
    const setting *v = suns_fastest(b->volume, suns_used_settings(), 0.01);
    const setting *s = suns_fastest(b->shadow, suns_used_shadows(), 0.01);
    char target[160];
    snprintf(target, sizeof target,
             "%s, directional lights: %d: volumes 50 times as fast as shadow rays at 1 %%",
             b->title, (int)b->scene.light_count);
    if (!v || !s)
        report_target(r, 0, target, "%s keep 1 %%", v ? "no shadow rays" : "no volumes");
    else
        report_target(r, setting_ms(s) >= 50 * setting_ms(v), target,
                      "%.0f times (%.4g ms, %.2g %%; %.4g ms, %.2g %%)",
                      setting_ms(s) / setting_ms(v), setting_ms(v), 100 * v->rmse, setting_ms(s),
                      100 * s->rmse);
}

static void suns_count(report *r, suns_bench *b, int count)
{
    suns_fill_sky(b->lights, count);
    b->scene.light_count = (size_t)count;
    suns_reference(b);
    for (int i = 0; i < suns_used_shadows(); i++) {
        b->shadow[i] = setting_of(SCATTER_DEPTH_CLOSED, SCATTER_RAY_QUADRATURE, suns_shadows[i], 0);
        suns_measure(b, &b->shadow[i]);
        suns_compare(b, &b->shadow[i]);
    }
    for (int i = 0; i < suns_used_settings(); i++) {
        b->volume[i] = setting_of(SCATTER_DEPTH_POLAR, SCATTER_RAY_QUADRATURE,
                                  suns_nodes[i % SUNS_NODES], suns_grids[i / SUNS_NODES]);
        suns_measure(b, &b->volume[i]);
        suns_compare(b, &b->volume[i]);
    }
    for (int i = 0; i < suns_used_shadows(); i++)
        suns_row(r, b, &b->shadow[i]);
    for (int i = 0; i < suns_used_settings(); i++)
        suns_row(r, b, &b->volume[i]);
    suns_chart(b);
}

/* ------------------------------------------------------------------------------------- media */

/* The cloud, and the same resampled to SUNS_FINE^3 voxels. */
static void suns_open(suns_bench *b, int fine)
{
    scatter_volume volume;
    memset(b, 0, sizeof *b);
    b->title = fine ? "cloud as 256^3" : "cloud";
    b->name = fine ? "fine" : "cloud";
    scene_must_read(&b->file, cloud_paths[0]);
    b->scene = b->file.scene;
    b->scene.lights = b->lights;
    b->view = scene_view(&b->file, suns_size(), suns_size());
    b->rgb = floats(suns_floats());
    b->reference = floats(suns_floats());
    if (!fine)
        return;
    b->fine = floats((size_t)SUNS_FINE * SUNS_FINE * SUNS_FINE);
    volume.values = b->fine;
    volume.nx = volume.ny = volume.nz = SUNS_FINE;
    volume.box = b->file.grids[0].box;
    must(scatter_inject(NULL, &b->scene.medium, &volume), "scatter_inject");
    b->grid = b->file.grids[0];
    b->grid.density = b->fine;
    b->grid.nx = b->grid.ny = b->grid.nz = SUNS_FINE;
    b->grid.scale = 0;
    b->scene.medium.grids = &b->grid;
}

static void suns_close(suns_bench *b)
{
    scene_free(&b->file);
    free(b->fine);
    free(b->rgb);
    free(b->reference);
}

/* ------------------------------------------------------------------------------- whole images */

/* Nanoseconds for four lights and a node, from two images that differ in their lights alone. */
static void suns_limit(report *r, suns_bench *b)
{
    setting s[2];
    double rows[2]; /* of nodes, with four lights each */
    for (int i = 0; i < 2; i++) {
        double work[SCATTERI_WORKS];
        scatter_context *c = NULL;
        scatter_image image = image_of(b->rgb, suns_size(), suns_size());
        b->scene.light_count = i ? 64 : 4;
        suns_fill_sky(b->lights, (int)b->scene.light_count);
        s[i] = setting_of(SCATTER_DEPTH_POLAR, SCATTER_RAY_QUADRATURE, 16, 128);
        render_timed(&s[i], &b->scene, &b->view, &image);
        must(scatter_create(NULL, &c), "scatter_create");
        must(scatter_update(c, &b->scene, &s[i].quality), "scatter_update");
        plans_count(c, &b->view, &image, work);
        rows[i] = work[SCATTERI_WORK_TOGETHER];
        scatter_destroy(c);
    }
    double nodes = 16 * (rows[1] - rows[0]);
    double ns = 1e6 * (timing_median(&s[1].rays) - timing_median(&s[0].rays)) / nodes;
    report_text(r,
                "Four lights at a node take %.2g ns (from 4 and 64 lights, %.3g million nodes, "
                "grid 128): eight loads of 16 bytes, %.3g GB/s, and about 200 floating-point "
                "operations (84 interpolate, 80 are the exponentials), %.3g GFlop/s.",
                ns, 1e-6 * nodes / 15, 128 / ns, 200 / ns);
}

static void suns_whole(report *r, suns_bench *b)
{
    report_text(
        r, "%s, 20 lights, %dx%d, whole images (grid 0: the default; two threads: on the wall):",
        b->title, suns_size(), suns_size());
    report_table(r, b->name[0] == 'f' ? "suns_whole_fine" : "suns_whole_cloud",
                 "medium|lights|nodes|grid|threads|setup ms|image ms|memory MB");
    suns_fill_sky(b->lights, 20);
    b->scene.light_count = 20;
    for (int i = 0; i < by_level(1, 2, 6); i++) {
        static const int grids[3] = {0, 128, 96};
        scatter_image image = image_of(b->rgb, suns_size(), suns_size());
        setting s = setting_of(SCATTER_DEPTH_POLAR, SCATTER_RAY_QUADRATURE, 16, grids[i / 2]);
        s.threads = i % 2 + 1;
        s.on_wall = s.threads > 1;
        for (int round = 0; round < by_level(1, 1, 3); round++)
            render_timed(&s, &b->scene, &b->view, &image);
        report_cell(r, "%s", b->title);
        report_cell(r, "20");
        report_cell(r, "%d", s.quality.nodes);
        report_cell(r, "%d", s.quality.grid);
        report_cell(r, "%d", s.threads);
        report_cell(r, "%.4g%s", timing_median(&s.setup), timing_flag(&s.setup));
        report_cell(r, "%.4g%s", timing_median(&s.rays), timing_flag(&s.rays));
        report_cell(r, "%.1f", (double)s.bytes / 1048576);
        report_row(r, 1);
    }
    report_end(r);
}

/* ----------------------------------------------------------------------------------- in turn */

/* The smoke in a cube of 1 m, which it fills to 3/4 across. */
typedef struct suns_smoke {
    float *still, *moved;
    scatter_grid grid, source;
    scatter_scene scene;
    scatter_light lights[20];
    scatter_view view;
} suns_smoke;

static int suns_read_smoke(suns_smoke *k)
{
    int n[3] = {0, 0, 0}, i, count = SUNS_SMOKE_SIDE * 64 * SUNS_SMOKE_SIDE;
    FILE *file = fopen(SUNS_SMOKE, "r");
    if (!file)
        return 0;
    for (i = 0; i < 3; i++)
        if (fscanf(file, "%d", &n[i]) != 1)
            break;
    for (i = 0; i < count && n[0] == SUNS_SMOKE_SIDE && n[1] == 64; i++)
        if (fscanf(file, "%f", &k->still[i]) != 1)
            break;
    fclose(file);
    return i == count;
}

static int suns_open_smoke(suns_smoke *k)
{
    memset(k, 0, sizeof *k);
    k->still = floats((size_t)SUNS_SMOKE_SIDE * 64 * SUNS_SMOKE_SIDE);
    k->moved = floats((size_t)64 * 64 * 64);
    k->source.density = k->still;
    k->source.nx = k->source.nz = SUNS_SMOKE_SIDE;
    k->source.ny = 64;
    k->source.box.min = scatter_v3(-0.375f, 0, -0.375f);
    k->source.box.max = scatter_v3(0.375f, 1, 0.375f);
    k->grid.density = k->moved;
    k->grid.nx = k->grid.ny = k->grid.nz = 64;
    k->grid.box.min = scatter_v3(-0.5f, 0, -0.5f);
    k->grid.box.max = scatter_v3(0.5f, 1, 0.5f);
    k->scene.medium.extinction = scatter_v3(40, 40, 40);
    k->scene.medium.albedo = scatter_v3(0.95f, 0.95f, 0.95f);
    k->scene.medium.grids = &k->grid;
    k->scene.medium.grid_count = 1;
    k->scene.lights = k->lights;
    k->scene.light_count = 20;
    k->view = scatter_view_perspective(scatter_v3(0.5f, 0.7f, -2), scatter_v3(0, 0.5f, 0),
                                       scatter_v3(0, 1, 0), 0.6f, 1);
    return suns_read_smoke(k);
}

/* Turns by `angle` and swirls: what is higher is turned by more. */
static void suns_move_smoke(suns_smoke *k, double angle)
{
    scatteri_field field = scatteri_field_of(&k->source);
    float *out = k->moved;
    for (int z = 0; z < 64; z++)
        for (int y = 0; y < 64; y++)
            for (int x = 0; x < 64; x++) {
                scatter_vec3 p = scatter_v3(((float)x + 0.5f) / 64 - 0.5f, ((float)y + 0.5f) / 64,
                                            ((float)z + 0.5f) / 64 - 0.5f);
                double a = angle * (0.5 + (double)p.y);
                float c = (float)cos(a), s = (float)sin(a);
                *out++ = scatteri_field_at(&field,
                                           scatter_v3(c * p.x + s * p.z, p.y, c * p.z - s * p.x));
            }
    k->grid.version++;
}

/* `sky`: the sky turns, else the smoke does; 1.2 degrees a frame: 10 s a turn, 30 frames a second. */
static void suns_turn_row(report *r, suns_smoke *k, int sky, int per_update)
{
    enum { SIZE = 96, FIRST = 20 };
    const int frames = FIRST + by_level(2, 6, 20);
    const size_t n = (size_t)3 * SIZE * SIZE;
    scatter_quality q = {.depth = SCATTER_DEPTH_POLAR, .nodes = 8, .grid = 96};
    scatter_context *turns = NULL, *full = NULL;
    float *a = floats(n), *b = floats(n);
    scatter_image image = image_of(a, SIZE, SIZE), truth = image_of(b, SIZE, SIZE);
    timing ms = {{0}, 0}, all = {{0}, 0};
    double error = 0, worst = 0; /* of the last frame and of all */
    must(scatter_create(NULL, &turns), "scatter_create");
    must(scatter_create(NULL, &full), "scatter_create");
    suns_fill_sky(k->lights, 20);
    suns_move_smoke(k, 0);
    for (int frame = 0; frame < frames; frame++) {
        if (sky)
            suns_turn(k->lights, 20, 0.020944);
        else
            suns_move_smoke(k, 0.020944 * frame);
        q.lights_per_update = per_update;
        double start = thread_ms();
        must(scatter_update(turns, &k->scene, &q), "scatter_update");
        double done = thread_ms();
        if (frame < FIRST)
            continue;
        q.lights_per_update = 0;
        double again = thread_ms();
        must(scatter_update(full, &k->scene, &q), "scatter_update");
        timing_add(&all, thread_ms() - again);
        timing_add(&ms, done - start);
        must(scatter_render(turns, &k->view, &image), "scatter_render");
        must(scatter_render(full, &k->view, &truth), "scatter_render");
        error = relative_rmse(a, b, n);
        worst = worse_of(error, worst);
    }
    report_cell(r, "%s", sky ? "sky turns" : "smoke swirls");
    report_cell(r, "%d", per_update);
    report_cell(r, "%.3g%s", timing_median(&ms), timing_flag(&ms));
    report_cell(r, "%.3g%s", timing_median(&all), timing_flag(&all));
    report_cell(r, "%.3g", 100 * error);
    report_cell(r, "%.3g", 100 * worst);
    report_row(r, 1);
    scatter_destroy(turns);
    scatter_destroy(full);
    free(a);
    free(b);
}

static void suns_in_turn(report *r)
{
    static const int turns[SUNS_TURNS] = {1, 2, 5, 10, 20, 0};
    suns_smoke k;
    report_text(r, "### Volumes redone in turn");
    if (suns_open_smoke(&k)) {
        report_text(r,
                    "Smoke (64^3) under 20 directional lights, grid 96, changing by 1.2 degrees a "
                    "frame, against updates of all lights: relative RMSE of the picture, in the "
                    "last frame and the worst after 20 frames.");
        report_table(r, "suns_in_turn",
                     "what moves|lights per update|update ms|of all ms|RMSE %|worst %");
        for (int sky = 0; sky < 2; sky++)
            for (int i = 0; i < by_level(1, SUNS_TURNS, SUNS_TURNS); i++)
                suns_turn_row(r, &k, sky, turns[i]);
        report_end(r);
    } else {
        report_text(r, "skipped: no data (%s)", SUNS_SMOKE);
    }
    free(k.still);
    free(k.moved);
}

static void suns_medium(report *r, int fine)
{
    suns_bench b;
    suns_open(&b, fine);
    report_table(r, fine ? "suns_fine" : "suns_cloud",
                 "medium|lights|depth|nodes|grid|setup ms|rays ms|all ms|RMSE %|memory MB");
    for (int i = 0; i < SUNS_COUNTS; i++)
        if (suns_counts[i] == 4 || (level == LEVEL_FULL && !fine))
            suns_count(r, &b, suns_counts[i]);
    suns_count(r, &b, 20);
    report_end(r);
    suns_target(r, &b);
    suns_whole(r, &b);
    suns_fill_sky(b.lights, 20);
    suns_limit(r, &b);
    suns_close(&b);
}

static void suns_run(report *r)
{
    report_text(r, "## Many directional lights");
    if (!cloud_is_there()) {
        report_text(r, "skipped: no data (%s)", CLOUD_DATA);
        return;
    }
    report_text(
        r,
        "%dx%d under a sky of directional lights, one thread. Depth from volumes (setup: in a "
        "fresh context) or by shadow rays from every node; errors against shadow rays with "
        "%d nodes. Times of rays are those of a tile in each square of %d pixels (with shadow "
        "rays, of %dx%d pixels of it, which are those compared), scaled to the image. Of the "
        "volumes the front is shown.",
        suns_size(), suns_size(), SUNS_BEST, SUNS_STEP, SUNS_BLOCK, SUNS_BLOCK);
    for (int fine = 0; fine < by_level(1, 2, SUNS_MEDIA); fine++)
        suns_medium(r, fine);
    suns_in_turn(r);
}

#endif
