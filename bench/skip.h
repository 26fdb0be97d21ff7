/* skip.h - benchmark: empty space passed by a map of distances and a mask, as in table 1 of Navarro,
   Gutierrez and Seron 2008, then light volumes instead of shadow rays, and what the map costs. MIT
   licence. */
#ifndef SCATTER_BENCH_SKIP_H
#define SCATTER_BENCH_SKIP_H

#include "image.h"

#define SKIP_CLOUD "../shared/data/volumes/wdas_cloud_sixteenth_126x86x154_u8.raw"
#define SKIP_SMOKE "../shared/data/volumes/ispc_smoke_48x64x48.vol.txt"

enum {
    SKIP_SIZE = 512,
    SKIP_TILE = 8,
    SKIP_EVERY = 8, /* one tile in so many, along rows and columns, is rendered */
    SKIP_LIGHTS = 20,
    SKIP_LIGHTINGS = 3,
    SKIP_VARIANTS = 3,
    SKIP_VOLUMES = 7,
    SKIP_SLOW = 1500 /* ms; what takes longer is timed once */
};

static const char *const skip_lightings[SKIP_LIGHTINGS] = {"alpha", "primary", "self-shadow"};
static const char *const skip_variants[SKIP_VARIANTS] = {"none", "mask", "mask + distance"};

/* Speed-ups of the paper's table 1: its data (i) and (ii), see skip_lightings and skip_variants. */
static const double skip_paper[2][SKIP_LIGHTINGS][SKIP_VARIANTS] = {
    {{1, 0.9, 3.3}, {1, 1.1, 3.9}, {1, 2.4, 8.2}}, {{1, 0.8, 3.0}, {1, 0.9, 3.1}, {1, 1.8, 6.6}}};

typedef struct skip_data {
    const char *name;
    float *voxels;
    scatter_grid grid;
    scatter_light lights[SKIP_LIGHTS];
    scatter_scene scene;
    scatter_view view;
    double filled, covered; /* share of voxels that are not 0, of the picture behind the box */
} skip_data;

/* ------------------------------------------------------------------------------------ data */

static int skip_read_cloud(skip_data *d)
{
    const size_t n = (size_t)126 * 86 * 154;
    FILE *file = fopen(SKIP_CLOUD, "rb");
    unsigned char *bytes = (unsigned char *)malloc(n);
    int read = file && bytes && fread(bytes, 1, n, file) == n;
    d->name = "Disney cloud";
    d->voxels = floats(n);
    for (size_t i = 0; i < n && read; i++)
        d->voxels[i] = (float)bytes[i] / 255.0f;
    d->grid.nx = 126, d->grid.ny = 86, d->grid.nz = 154;
    d->scene.medium.extinction = scatter_v3(12, 12, 12);
    free(bytes);
    if (file)
        fclose(file);
    return read;
}

static int skip_read_smoke(skip_data *d)
{
    const size_t n = (size_t)48 * 64 * 48;
    FILE *file = fopen(SKIP_SMOKE, "r");
    int read = file && fscanf(file, "%d %d %d", &d->grid.nx, &d->grid.ny, &d->grid.nz) == 3 &&
               d->grid.nx == 48 && d->grid.ny == 64 && d->grid.nz == 48;
    d->name = "ISPC smoke";
    d->voxels = floats(n);
    for (size_t i = 0; i < n && read; i++)
        read = fscanf(file, "%f", &d->voxels[i]) == 1;
    d->scene.medium.extinction = scatter_v3(40, 40, 40);
    if (file)
        fclose(file);
    return read;
}

/* Even directions on the sphere: a spiral. */
static void skip_light(skip_data *d, int i)
{
    scatter_light *light = &d->lights[i];
    float y = 1.0f - 2.0f * ((float)i + 0.5f) / SKIP_LIGHTS, r = sqrtf(1.0f - y * y);
    light->kind = SCATTER_LIGHT_DIRECTIONAL;
    light->direction = scatter_v3(r * cosf(2.4f * (float)i), y, r * sinf(2.4f * (float)i));
    light->intensity = scatter_v3(1, 1, 1);
}

/* Share of the picture that the box covers. */
static double skip_covered(const skip_data *d)
{
    const int n = 64;
    int hits = 0;
    for (int i = 0; i < n * n; i++) {
        scatter_ray ray = scatter_view_ray(&d->view, ((float)(i % n) + 0.5f) / (float)n,
                                           ((float)(i / n) + 0.5f) / (float)n);
        float t0 = 0, t1 = SCATTERI_FAR;
        hits += scatteri_clip(d->grid.box, ray.origin, ray.direction, &t0, &t1);
    }
    return (double)hits / (n * n);
}

/* A field of view in which the box covers half of the picture, as in the paper. */
static void skip_aim(skip_data *d)
{
    float low = 0.1f, high = 2.0f;
    for (int i = 0; i < 12; i++) {
        float middle = 0.5f * (low + high);
        d->view = scatter_view_perspective(scatter_v3(2.2f, 0.7f, 1.2f), scatter_v3(0, 0, 0),
                                           scatter_v3(0, 1, 0), middle, 1);
        d->covered = skip_covered(d);
        if (d->covered > 0.5)
            low = middle;
        else
            high = middle;
    }
}

static int skip_open(skip_data *d, int smoke)
{
    size_t filled = 0;
    memset(d, 0, sizeof *d);
    if (!(smoke ? skip_read_smoke(d) : skip_read_cloud(d)))
        return 0;
    float scale = 0.005f * (smoke ? 126.0f / 48.0f : 1.0f);
    d->grid.density = d->voxels;
    d->grid.box.max =
        scatter_v3(scale * (float)d->grid.nx, scale * (float)d->grid.ny, scale * (float)d->grid.nz);
    d->grid.box.min = scatteri_scale(d->grid.box.max, -1);
    for (int i = 0; i < d->grid.nx * d->grid.ny * d->grid.nz; i++)
        filled += d->voxels[i] > 0;
    d->filled = (double)filled / ((double)d->grid.nx * d->grid.ny * d->grid.nz);
    for (int i = 0; i < SKIP_LIGHTS; i++)
        skip_light(d, i);
    d->scene.medium.albedo = scatter_v3(0.9f, 0.9f, 0.9f);
    d->scene.medium.grids = &d->grid;
    d->scene.medium.grid_count = 1;
    skip_aim(d);
    return 1;
}

/* --------------------------------------------------------------------------------- pictures */

static int skip_steps(void)
{
    return by_level(16, 64, 128);
}

/* The sampled tiles one after the other; rgb: of the sample, `whole`: room for the picture. */
static size_t skip_render(const scatter_context *context, const scatter_view *view, float *whole,
                          float *rgb, double *ms)
{
    scatter_image image = image_of(whole, SKIP_SIZE, SKIP_SIZE);
    const int tiles = SKIP_SIZE / SKIP_TILE, every = SKIP_EVERY;
    size_t n = 0;
    *ms = 0;
    for (int t = 0; t < tiles * tiles; t++) {
        int x = t % tiles, y = t / tiles;
        if (y % every != every / 2 || (x + 3 * (y / every)) % every != every / 2)
            continue;
        image.x0 = x * SKIP_TILE, image.x1 = image.x0 + SKIP_TILE;
        image.y0 = y * SKIP_TILE, image.y1 = image.y0 + SKIP_TILE;
        double start = thread_ms();
        must(scatter_render(context, view, &image), "scatter_render");
        *ms += thread_ms() - start;
        for (y = image.y0; y < image.y1; y++, n += 3 * SKIP_TILE)
            memcpy(rgb + n, whole + 3 * (y * SKIP_SIZE + image.x0), 3 * SKIP_TILE * sizeof *rgb);
    }
    *ms *= (double)every * every; /* of the whole picture */
    return n;
}

/* Lights without shadows read their depth from volumes in which there is nothing. */
static void skip_unshadow(scatter_context *context, scatteri_medium *nothing)
{
    memset(nothing, 0, sizeof *nothing);
    for (int i = 0; i < context->light_count; i++) {
        context->lights[i].depth.medium = nothing;
        context->lights[i].depth.method = SCATTER_DEPTH_POLAR;
    }
}

typedef struct skip_shot {
    timing setup, rays; /* ms; rays: of the whole picture */
    float *rgb;
    size_t n;
} skip_shot;

static double skip_ms(const skip_shot *shot)
{
    return timing_median(&shot->setup) + timing_median(&shot->rays);
}

static void skip_shoot(const skip_data *d, int lighting, const scatter_quality *q, float *whole,
                       skip_shot *shot)
{
    scatter_scene scene = d->scene;
    scatteri_medium nothing;
    double ms = 0;
    scene.lights = d->lights;
    scene.light_count = lighting == 0 ? 0 : SKIP_LIGHTS;
    scene.background = lighting == 0 ? scatter_v3(1, 1, 1) : scatter_v3(0, 0, 0);
    shot->rgb = floats((size_t)3 * SKIP_SIZE * SKIP_SIZE);
    shot->setup.n = shot->rays.n = 0;
    for (int round = 0; round < 3 && (round == 0 || ms < SKIP_SLOW * SKIP_EVERY * SKIP_EVERY);
         round++) {
        scatter_context *context = NULL;
        must(scatter_create(NULL, &context), "scatter_create");
        double start = thread_ms();
        must(scatter_update(context, &scene, q), "scatter_update");
        timing_add(&shot->setup, thread_ms() - start);
        if (lighting == 1)
            skip_unshadow(context, &nothing);
        shot->n = skip_render(context, &d->view, whole, shot->rgb, &ms);
        timing_add(&shot->rays, ms);
        scatter_destroy(context);
    }
}

/* ---------------------------------------------------------------------------------- table 1 */

static double skip_difference(const skip_shot *shot, const skip_shot *good)
{
    float most = 1e-30f;
    for (size_t i = 0; i < good->n; i++)
        most = good->rgb[i] > most ? good->rgb[i] : most;
    return largest_error(shot->rgb, good->rgb, good->n) / (double)most;
}

static void skip_row(report *r, const skip_data *d, int data, int lighting, int variant,
                     const skip_shot *shot, const skip_shot *none)
{
    report_cell(r, "%s", d->name);
    report_cell(r, "%s", skip_lightings[lighting]);
    report_cell(r, "%s", skip_variants[variant]);
    report_cell(r, "%.4g%s", timing_median(&shot->rays), timing_flag(&shot->rays));
    report_cell(r, "%.3g", skip_ms(none) / skip_ms(shot));
    report_cell(r, "%.2g", skip_paper[data][lighting][variant]);
    report_cell(r, "%.2g", skip_difference(shot, none));
    report_row(r, 1);
}

/* All of table 1 for one data set; *brute becomes the shadowed picture by brute force. Returns the
   speed-up of that. */
static double skip_table_rows(report *r, const skip_data *d, int data, float *whole,
                              skip_shot *brute, double *worst)
{
    double gain = 0;
    for (int lighting = 0; lighting < SKIP_LIGHTINGS; lighting++) {
        skip_shot none, shot;
        for (int variant = 0; variant < SKIP_VARIANTS; variant++) {
            scatter_quality q = setting_of(SCATTER_DEPTH_CLOSED, SCATTER_RAY_MARCH, 0, 0).quality;
            q.nodes = skip_steps();
            q.no_mask = variant < 1;
            q.no_distance_map = variant < 2;
            skip_shoot(d, lighting, &q, whole, variant ? &shot : &none);
            skip_row(r, d, data, lighting, variant, variant ? &shot : &none, &none);
            if (variant == 0)
                continue;
            gain = skip_ms(&none) / skip_ms(&shot);
            *worst = worse_of(*worst, skip_difference(&shot, &none));
            free(shot.rgb);
        }
        if (lighting < SKIP_LIGHTINGS - 1)
            free(none.rgb);
        else
            *brute = none;
    }
    return gain;
}

/* ---------------------------------------------------------------------------- light volumes */

static const struct skip_volume {
    int nodes, grid;
} skip_volumes[SKIP_VOLUMES] = {{16, 32},  {16, 64},  {32, 64},  {32, 128},
                                {64, 128}, {64, 192}, {128, 192}};

static void skip_volume_row(report *r, const char *name, const char *way, const scatter_quality *q,
                            const skip_shot *shot, const skip_shot *good, double gain)
{
    report_cell(r, "%s", name);
    report_cell(r, "%s", way);
    report_cell(r, "%d", q->nodes);
    report_cell(r, "%d", q->grid);
    report_cell(r, "%.4g%s", timing_median(&shot->setup), timing_flag(&shot->setup));
    report_cell(r, "%.4g%s", timing_median(&shot->rays), timing_flag(&shot->rays));
    report_cell(r, "%.3g", gain);
    report_cell(r, "%.3g %%", 100 * relative_rmse(shot->rgb, good->rgb, good->n));
    report_row(r, 1);
}

/* The most that volumes gain over brute force with at most 1 % error. */
static double skip_volume_rows(report *r, const skip_data *d, float *whole, const skip_shot *brute)
{
    scatter_quality q = setting_of(SCATTER_DEPTH_CLOSED, SCATTER_RAY_QUADRATURE, 0, 0).quality;
    skip_shot good, shot;
    double best = 0;
    q.nodes = by_level(8, 16, 128);
    skip_shoot(d, 2, &q, whole, &good);
    skip_volume_row(r, d->name, "reference", &q, &good, &good, skip_ms(brute) / skip_ms(&good));
    q.nodes = skip_steps();
    skip_volume_row(r, d->name, "brute force", &q, brute, &good, 1);
    for (int i = 0; i < by_level(2, SKIP_VOLUMES, SKIP_VOLUMES); i++) {
        q = setting_of(SCATTER_DEPTH_POLAR, SCATTER_RAY_QUADRATURE, skip_volumes[i].nodes,
                       skip_volumes[i].grid)
                .quality;
        skip_shoot(d, 2, &q, whole, &shot);
        double gain = skip_ms(brute) / skip_ms(&shot);
        skip_volume_row(r, d->name, "polar, quadrature", &q, &shot, &good, gain);
        if (relative_rmse(shot.rgb, good.rgb, good.n) <= 0.01)
            best = gain > best ? gain : best;
        free(shot.rgb);
    }
    free(good.rgb);
    return best;
}

/* ---------------------------------------------------------------------------- distance maps */

/* Bytes a second of a copy that no cache holds, counting what is read and what is written. */
static double skip_bandwidth(void)
{
    const size_t n = (size_t)1 << 25;
    float *from = floats(n), *to = floats(n);
    timing ms = {0};
    for (int i = 0; i < 5; i++) {
        double start = thread_ms();
        memcpy(to, from, n * sizeof *to);
        timing_add(&ms, thread_ms() - start);
        from[i] += to[n - 1];
    }
    free(from);
    free(to);
    return 2.0 * (double)(n * sizeof(float)) / timing_min(&ms) * 1e3;
}

/* The data sampled at n^3 points. */
static void skip_resample(const skip_data *d, int n, float *values)
{
    scatter_volume volume = {values, n, n, n, d->grid.box};
    must(scatter_inject(NULL, &d->scene.medium, &volume), "scatter_inject");
}

/* Density read once, counts written, read and written again, read and replaced by distances. */
#define SKIP_BYTES 14.0

static double skip_map_row(report *r, const skip_data *d, int n, double bandwidth)
{
    const size_t voxels = (size_t)(n * n * n);
    scatter_grid grid = d->grid;
    scatter_host host;
    timing ms = {0};
    float *values = floats(voxels);
    skip_resample(d, n, values);
    grid.density = values;
    grid.nx = grid.ny = grid.nz = n;
    void *memory = malloc(scatteri_map_bytes(&grid));
    if (!memory)
        must(SCATTER_OUT_OF_MEMORY, "malloc");
    memset(memory, 0, scatteri_map_bytes(&grid));
    memset(&host, 0, sizeof host);
    for (int i = 0; i < 5; i++) {
        scatteri_field field = scatteri_field_of(&grid);
        double start = thread_ms();
        scatteri_map_distances(&host, &field, memory);
        timing_add(&ms, thread_ms() - start);
    }
    double limit = SKIP_BYTES * (double)voxels / bandwidth * 1e3;
    report_cell(r, "%s", d->name);
    report_cell(r, "%d^3", n);
    report_cell(r, "%.3g%s", timing_median(&ms), timing_flag(&ms));
    report_cell(r, "%.3g", timing_median(&ms) * 1e6 / (double)voxels);
    report_cell(r, "%.3g", limit);
    report_cell(r, "%.3g", (double)scatteri_map_bytes(&grid) / (1 << 20));
    report_row(r, 1);
    free(memory);
    free(values);
    return timing_median(&ms);
}

/* ------------------------------------------------------------------------------------- all */

static void skip_describe(report *r)
{
    report_text(r, "## Empty space");
    report_text(r,
                "Table 1 of Navarro, Gutierrez and Seron 2008 (Quadro FX 3500, 512x512) as ratios: "
                "the march with %d steps, %d directional lights, one thread, %dx%d, of which every "
                "%dth tile in both directions is rendered and counted as the others. The box "
                "covers half of the picture. Alpha: transmittance only. Primary: lights without "
                "shadows. Self-shadow: a shadow ray for each light and step, integrated exactly "
                "from voxel to voxel. Brute force (none) does so at every step of every ray that "
                "meets the box. Difference: the largest one to brute force, over the brightest "
                "value. Speed-ups count scatter_update, with the map of distances, too.",
                skip_steps(), SKIP_LIGHTS, SKIP_SIZE, SKIP_SIZE, SKIP_EVERY);
}

static void skip_maps(report *r, const skip_data *d, int n)
{
    static const int sizes[] = {64, 128, 256};
    double bandwidth = skip_bandwidth(), at_128 = 0;
    report_text(r,
                "The map of distances, made anew on one thread. Limit: %g bytes a voxel at %.3g "
                "GB/s, the speed of a large copy here.",
                SKIP_BYTES, bandwidth * 1e-9);
    report_table(r, "skip_maps", "data|voxels|ms|ns a voxel|limit, ms|MB with scratch memory");
    for (int i = 0; i < n; i++)
        for (int s = 0; s < by_level(1, 3, 3); s++) {
            double ms = skip_map_row(r, &d[i], sizes[s], bandwidth);
            at_128 = sizes[s] == 128 ? worse_of(at_128, ms) : at_128;
        }
    report_end(r);
    report_target(r, at_128 <= 20, "distance map of 128^3 in 20 ms on one core", "%.3g ms", at_128);
}

static void skip_run(report *r)
{
    float *whole = floats((size_t)3 * SKIP_SIZE * SKIP_SIZE);
    double gain[2] = {0, 0}, worst = 0;
    skip_data data[2];
    skip_shot brute[2];
    int n = 0;
    for (int smoke = 0; smoke < 2; smoke++)
        n += skip_open(&data[n], smoke);
    skip_describe(r);
    if (n < 2) {
        report_text(r, "skipped: no data");
        return;
    }
    report_text(r, "Voxels that are not 0: %.1f %% of the cloud, %.1f %% of the smoke.",
                100 * data[0].filled, 100 * data[1].filled);
    report_table(r, "skip", "data|lighting|skipping|ms|speed-up|paper's|difference");
    for (int i = 0; i < n; i++)
        gain[i] = skip_table_rows(r, &data[i], i, whole, &brute[i], &worst);
    report_end(r);
    report_target(r, gain[0] >= 8.2 && gain[1] >= 8.2,
                  "self-shadow, mask and distances: 8.2 times as fast as brute force",
                  "%.3g (cloud), %.3g (smoke)", gain[0], gain[1]);
    report_target(r, worst <= 1e-6, "equal images, to 1e-6", "%.2g", worst);
    report_text(r, "The same pictures with light volumes, made anew for each picture, instead of "
                   "shadow rays. Error: relative RMSE against shadow rays and many nodes.");
    report_table(r, "skip_volumes", "data|way|nodes|grid|setup, ms|rays, ms|speed-up|error");
    for (int i = 0; i < n; i++)
        gain[i] = skip_volume_rows(r, &data[i], whole, &brute[i]);
    report_end(r);
    report_target(r, gain[0] >= 50 && gain[1] >= 50,
                  "light volumes: 50 times as fast as brute force at 1 %",
                  "%.3g (cloud), %.3g (smoke)", gain[0], gain[1]);
    skip_maps(r, data, n);
    for (int i = 0; i < n; i++) {
        free(brute[i].rgb);
        free(data[i].voxels);
    }
    free(whole);
}

#endif
