/* cloud.h - benchmark: the Disney cloud, beside OpenVDB's vdb_render. MIT licence. */
#ifndef SCATTER_BENCH_CLOUD_H
#define SCATTER_BENCH_CLOUD_H

#include "image.h"

#define CLOUD_DATA "../shared/data/volumes/wdas_cloud_sixteenth.vdb"
#define CLOUD_PPM "build/bench/vdb_render.ppm"

enum {
    CLOUD_SCENES = 2,
    CLOUD_WAYS = 10,
    CLOUD_SETTINGS = 2 * CLOUD_WAYS, /* each with one and with two threads */
    CLOUD_PEERS = 3,
    CLOUD_SLOW = 1500 /* ms; what takes longer is timed once */
};

static const char *const cloud_paths[CLOUD_SCENES] = {"bench/cloud.scatter",
                                                      "bench/cloud_dense.scatter"};

typedef struct cloud_way {
    scatter_depth_method depth;
    scatter_density_method density;
    scatter_ray_method ray;
    int nodes, grid;
} cloud_way;

static const cloud_way cloud_ways[CLOUD_WAYS] = {
    {SCATTER_DEPTH_POLAR, SCATTER_DENSITY_EXACT, SCATTER_RAY_QUADRATURE, 16, 64},
    {SCATTER_DEPTH_POLAR, SCATTER_DENSITY_EXACT, SCATTER_RAY_QUADRATURE, 8, 128},
    {SCATTER_DEPTH_POLAR, SCATTER_DENSITY_EXACT, SCATTER_RAY_QUADRATURE, 16, 128},
    {SCATTER_DEPTH_POLAR, SCATTER_DENSITY_EXACT, SCATTER_RAY_QUADRATURE, 32, 128},
    {SCATTER_DEPTH_POLAR, SCATTER_DENSITY_EXACT, SCATTER_RAY_QUADRATURE, 16, 192},
    {SCATTER_DEPTH_POLAR, SCATTER_DENSITY_EXACT, SCATTER_RAY_QUADRATURE, 32, 192},
    {SCATTER_DEPTH_POLAR, SCATTER_DENSITY_EXACT, SCATTER_RAY_MARCH, 128, 128},
    {SCATTER_DEPTH_POLAR, SCATTER_DENSITY_EXACT, SCATTER_RAY_MARCH, 256, 192},
    {SCATTER_DEPTH_POLAR, SCATTER_DENSITY_VOLUME, SCATTER_RAY_QUADRATURE, 16, 128},
    {SCATTER_DEPTH_CLOSED_VOLUME, SCATTER_DENSITY_EXACT, SCATTER_RAY_QUADRATURE, 16, 64}};

/* One way to run vdb_render. Its default steps are 1 voxel on the eye's ray, 3 on shadow rays. */
typedef struct peer_way {
    const char *title, *options;
    int threads;
} peer_way;

static const peer_way peer_ways[CLOUD_PEERS] = {
    {"default steps", "", 1}, {"default steps", "", 2}, {"shadow step 1", " -shadowstep 1", 1}};

typedef struct cloud_peer {
    char command[512];
    double rmse;
    timing ms;
} cloud_peer;

typedef struct cloud_bench {
    const char *path;
    scene_file file;
    scatter_view view;
    float *rgb, *few, *reference;
    setting s[CLOUD_SETTINGS];
    cloud_peer peer[CLOUD_PEERS]; /* as peer_ways */
    int has_peer;
} cloud_bench;

static int cloud_size(void)
{
    return by_level(32, 256, 256);
}

/* The error is taken at every fourth pixel in both directions. */
static int cloud_lattice(void)
{
    return cloud_size() / 4;
}

static size_t cloud_values(void)
{
    return (size_t)(3 * cloud_lattice() * cloud_lattice());
}

static int cloud_settings(void)
{
    return by_level(2, 6, CLOUD_SETTINGS);
}

static int cloud_is_there(void)
{
    return access(CLOUD_DATA, R_OK) == 0;
}

/* -------------------------------------------------------------------------------- vdb_render */

/* Its coefficients are for a voxel, its light is radiance: the phase function 1/(4 pi) goes into
   the light, the sun's direction is turned round, and gain 0 makes its shadows those of physics. */
static void peer_command(cloud_peer *peer, const scene_file *file, const peer_way *way)
{
    const scatter_medium *m = &file->scene.medium;
    const scatter_light *sun = &file->lights[0];
    const scatter_grid *g = &file->grids[0];
    double voxel = (double)(g->box.max.x - g->box.min.x) / g->nx, scale = (double)g->scale;
    double extinction = (double)m->extinction.x * voxel * (scale > 0 ? scale : 1);
    double scatter = extinction * (double)m->albedo.x, absorb = extinction - scatter;
    double light = (double)sun->intensity.x / (4 * 3.14159265358979);
    snprintf(peer->command, sizeof peer->command,
             "vdb_render %s %s -v -cpus %d -res %dx%d -translate %g,%g,%g -lookat %g,%g,%g -fov %g "
             "-absorb %.6g,%.6g,%.6g -scatter %.6g,%.6g,%.6g -light %g,%g,%g,%g,%g,%g -gain 0%s",
             CLOUD_DATA, CLOUD_PPM, way->threads, cloud_size(), cloud_size(), (double)file->eye.x,
             (double)file->eye.y, (double)file->eye.z, (double)file->target.x,
             (double)file->target.y, (double)file->target.z,
             (double)file->extent * 180 / 3.14159265358979, absorb, absorb, absorb, scatter,
             scatter, scatter, -(double)sun->direction.x, -(double)sun->direction.y,
             -(double)sun->direction.z, light, light, light, way->options);
}

/* The seconds that it reports for ray tracing alone, without start and reading of the file; 0: it
 * failed. */
static double peer_run_ms(const cloud_peer *peer)
{
    char command[600], line[1024], *at;
    double seconds = 0;
    int tracing = 0;
    snprintf(command, sizeof command, "%s 2>&1", peer->command);
    FILE *pipe = popen(command, "r");
    if (!pipe)
        return 0;
    while (fgets(line, sizeof line, pipe)) {
        if (strstr(line, "ray-tracing"))
            tracing = 1;
        at = strstr(line, "completed in ");
        if (tracing && at)
            seconds = strtod(at + strlen("completed in "), NULL);
    }
    return pclose(pipe) == 0 ? seconds * 1e3 : 0;
}

/* Its picture of 8 bits: linear, top row first. 0: there is none. */
static int peer_picture(float *rgb)
{
    char *text;
    size_t bytes, pixels = (size_t)(3 * cloud_size() * cloud_size());
    file_error error;
    if (file_read(CLOUD_PPM, SIZE_MAX, &text, &bytes, &error) != 0)
        return 0;
    int whole = bytes > pixels;
    for (size_t i = 0; whole && i < pixels; i++)
        rgb[i] = (float)(unsigned char)text[bytes - pixels + i] / 255.0f;
    free(text);
    return whole;
}

static int peer_round(cloud_bench *b, int round)
{
    for (int i = 0; i < CLOUD_PEERS; i++) {
        cloud_peer *peer = &b->peer[i];
        if (round == 0)
            peer_command(peer, &b->file, &peer_ways[i]);
        double ms = peer_run_ms(peer);
        if (!(ms > 0) || !peer_picture(b->rgb))
            return 0;
        timing_add(&peer->ms, ms);
        image_lattice(b->rgb, cloud_size(), cloud_lattice(), b->few);
        peer->rmse = relative_rmse(b->few, b->reference, cloud_values());
    }
    return 1;
}

/* -------------------------------------------------------------------------------------- ours */

static void cloud_open(cloud_bench *b, const char *path)
{
    memset(b, 0, sizeof *b);
    b->path = path;
    b->rgb = floats((size_t)(3 * cloud_size() * cloud_size()));
    b->few = floats(cloud_values());
    b->reference = floats(cloud_values());
    scene_must_read(&b->file, path);
    b->view = scene_view(&b->file, cloud_size(), cloud_size());
    scatter_view few = view_lattice(b->view, cloud_size(), cloud_lattice());
    reference_of_file(&b->file, path, &few, cloud_lattice(), b->reference);
    for (int i = 0; i < cloud_settings(); i++) {
        const cloud_way *way = &cloud_ways[i / 2];
        b->s[i] = setting_of(way->depth, way->ray, way->nodes, way->grid);
        b->s[i].quality.density = way->density;
        b->s[i].threads = i % 2 + 1;
        b->s[i].on_wall = 1; /* as vdb_render */
    }
}

static void cloud_close(cloud_bench *b)
{
    scene_free(&b->file);
    free(b->rgb);
    free(b->few);
    free(b->reference);
}

static void cloud_round(cloud_bench *b)
{
    scatter_image image = image_of(b->rgb, cloud_size(), cloud_size());
    for (int i = 0; i < cloud_settings(); i++) {
        if (setting_ms(&b->s[i]) > CLOUD_SLOW)
            continue;
        render_timed(&b->s[i], &b->file.scene, &b->view, &image);
        image_lattice(b->rgb, cloud_size(), cloud_lattice(), b->few);
        setting_compare(&b->s[i], b->few, b->reference, cloud_values());
    }
}

/* Is none of the settings with as many threads better? */
static int cloud_is_shown(const cloud_bench *b, const setting *s)
{
    for (int i = 0; i < cloud_settings(); i++)
        if (b->s[i].threads == s->threads &&
            beats(setting_ms(&b->s[i]), b->s[i].rmse, setting_ms(s), s->rmse))
            return 0;
    return s->threads == 1;
}

static void cloud_row(report *r, const cloud_bench *b, const setting *s)
{
    report_cell(r, "scatter");
    report_cell(r, "%s", scene_depth_name(s->quality.depth));
    report_cell(r, "%s", scene_density_name(s->quality.density));
    report_cell(r, "%s", scene_ray_name(s->quality.ray));
    report_cell(r, "%d", s->quality.nodes);
    report_cell(r, "%d", s->quality.grid);
    report_cell(r, "%d", s->threads);
    report_cell(r, "%.3g%s", timing_median(&s->setup), timing_flag(&s->setup));
    report_cell(r, "%.3g%s", timing_median(&s->rays), timing_flag(&s->rays));
    report_cell(r, "%.4g", setting_ms(s));
    report_cell(r, "%.3g", 100 * s->rmse);
    report_row(r, cloud_is_shown(b, s));
}

static void peer_row(report *r, const cloud_peer *peer, const peer_way *way)
{
    report_cell(r, "vdb_render, %s", way->title);
    for (int i = 0; i < 5; i++)
        report_cell(r, "%s", "");
    report_cell(r, "%d", way->threads);
    report_cell(r, "%s", "");
    report_cell(r, "%.4g%s", timing_median(&peer->ms), timing_flag(&peer->ms));
    report_cell(r, "%.4g", timing_median(&peer->ms));
    report_cell(r, "%.3g", 100 * peer->rmse);
    report_row(r, 1);
}

/* The fastest setting with that many threads that keeps 2 %; NULL: none does. */
static const setting *cloud_choice(const cloud_bench *b, int threads)
{
    const setting *best = NULL;
    for (int i = 0; i < cloud_settings(); i++) {
        const setting *s = &b->s[i];
        if (s->threads != threads || !(s->rmse <= 0.02))
            continue;
        if (!best || setting_ms(s) < setting_ms(best))
            best = s;
    }
    return best;
}

static void cloud_target(report *r, const cloud_bench *b, int threads)
{
    const setting *s = cloud_choice(b, threads);
    double peer_ms = timing_median(&b->peer[threads - 1].ms);
    char name[64], target[160];
    snprintf(target, sizeof target,
             "%s, %dx%d, one sun, threads: %d: error <= 2 %%, faster than vdb_render",
             scene_short(b->path, name, sizeof name), cloud_size(), cloud_size(), threads);
    if (!s)
        report_target(r, 0, target, "no setting keeps 2 %%");
    else
        report_target(r, setting_ms(s) < peer_ms, target, "%.2f %% in %.1f ms against %.1f ms",
                      100 * s->rmse, setting_ms(s), peer_ms);
    if (s && threads == 1 && b->path == cloud_paths[0])
        report_claim(r, "Disney cloud 256x256, one sun, one thread", "2 %, faster than vdb_render",
                     "%.3g %% in %.0f ms against %.0f ms", 100 * s->rmse, setting_ms(s), peer_ms);
}

static void cloud_report(report *r, const cloud_bench *b)
{
    char name[64];
    report_table(r, scene_short(b->path, name, sizeof name),
                 "program|depth|density|rays|nodes|grid|threads|setup ms|rays ms|all ms|RMSE %");
    for (int i = 0; i < cloud_settings(); i++)
        cloud_row(r, b, &b->s[i]);
    for (int i = 0; b->has_peer && i < CLOUD_PEERS; i++)
        peer_row(r, &b->peer[i], &peer_ways[i]);
    report_end(r);
    if (!b->has_peer) {
        report_text(r, "Not compared: vdb_render does not run (Debian package libopenvdb-tools).");
        return;
    }
    report_text(r, "`%s`", b->peer[0].command);
    for (int threads = 1; threads <= 2; threads++)
        cloud_target(r, b, threads);
}

static void cloud_scene(report *r, const char *path)
{
    cloud_bench b;
    report_text(r, "`%s`:", path);
    cloud_open(&b, path);
    b.has_peer = 1;
    for (int round = 0; round < by_level(1, 1, 2); round++) {
        cloud_round(&b);
        b.has_peer = b.has_peer && peer_round(&b, round);
    }
    cloud_report(r, &b);
    cloud_close(&b);
}

static void cloud_run(report *r)
{
    report_text(r, "## The Disney cloud");
    if (!cloud_is_there()) {
        report_text(r, "skipped: no data (%s)", CLOUD_DATA);
        return;
    }
    report_text(r,
                "%dx%d, one directional light. Errors against the reference on the same "
                "trilinear field, at every fourth pixel in both directions. Setup and rays on the "
                "wall, in a "
                "fresh context, against the time that vdb_render prints for ray tracing alone, "
                "at its default steps. Its picture has 8 bits. Of ours the front is "
                "shown, with one thread.",
                cloud_size(), cloud_size());
    for (int i = 0; i < by_level(1, 1, CLOUD_SCENES); i++)
        cloud_scene(r, cloud_paths[i]);
}

#endif
