/* gl_suns.h - benchmark: many directional lights in voxels: what a light costs, against shadow rays
   from every sample; a sky that turns; voxels that change every frame; tone mapping. MIT licence. */
#ifndef SCATTER_BENCH_GL_SUNS_H
#define SCATTER_BENCH_GL_SUNS_H

#include "gl_shadow.h"

enum { GL_SUNS_MOST = 64, GL_SUNS_NODES = 16 };

/* A scene with a cloud of n^3 voxels and a sky of lights in the place of its own; the file owns them. */
typedef struct gl_suns {
    gl_scene s;
    scatter_grid *grid;
    scatter_gl_light sky[GL_SUNS_MOST];
    int size;
} gl_suns;

/* ------------------------------------------------------------------------------------- the scene */

/* A ball with three octaves of waves on it, empty where they are low. */
static void gl_suns_cloud(float *voxels, int n)
{
    for (int k = 0; k < n; k++)
        for (int j = 0; j < n; j++)
            for (int i = 0; i < n; i++) {
                float x = (2 * (float)i + 1) / (float)n - 1, y = (2 * (float)j + 1) / (float)n - 1;
                float z = (2 * (float)k + 1) / (float)n - 1;
                float value = 0.7f - 1.2f * (x * x + y * y + z * z);
                for (int octave = 0; octave < 3; octave++) {
                    float f = 5.1f * (float)(1 << octave);
                    value += 0.5f / (float)(1 << octave) * sinf(f * x + 1.3f * (float)octave) *
                             sinf(f * y + 0.7f) * sinf(f * z);
                }
                voxels[((size_t)k * (size_t)n + (size_t)j) * (size_t)n + (size_t)i] =
                    scatteri_clamp(4 * value, 0, 1);
            }
}

/* `count` lights all over the sky, turned about the vertical; together always as bright. */
static void gl_suns_turn(gl_suns *g, int count, float angle)
{
    memset(g->sky, 0, sizeof g->sky);
    for (int i = 0; i < count; i++) {
        scatter_light *l = &g->s.file.lights[i];
        float height = 2 * ((float)i + 0.5f) / (float)count - 1, turn = 2.4f * (float)i + angle;
        float flat = sqrtf(1 - height * height), part = 12.0f / (float)count;
        memset(l, 0, sizeof *l);
        l->kind = SCATTER_LIGHT_DIRECTIONAL;
        l->direction = scatter_v3(-flat * cosf(turn), -height, -flat * sinf(turn));
        l->intensity = scatter_v3(part, part * (0.6f + 0.4f * height), part);
        g->sky[i].light = *l;
    }
    g->s.file.scene.light_count = (size_t)count;
    must(scatter_gl_set_lights(g->s.fog, g->sky, (size_t)count), "scatter_gl_set_lights");
}

static void *gl_suns_memory(size_t bytes)
{
    void *memory = calloc(1, bytes);
    if (!memory)
        must(SCATTER_OUT_OF_MEMORY, "calloc");
    return memory;
}

/* The place of the file's own medium and lights. */
static void gl_suns_replace(scene_file *file, int n)
{
    scatter_medium *m = &file->scene.medium;
    float *voxels = (float *)gl_suns_memory((size_t)n * (size_t)n * (size_t)n * sizeof *voxels);
    gl_suns_cloud(voxels, n);
    free(file->lights);
    file->lights = (scatter_light *)gl_suns_memory(GL_SUNS_MOST * sizeof *file->lights);
    file->grids = (scatter_grid *)gl_suns_memory(sizeof *file->grids);
    file->grids->density = voxels;
    file->grids->nx = file->grids->ny = file->grids->nz = n;
    file->grids->box.min = scatter_v3(-1.7f, -1.7f, -1.7f);
    file->grids->box.max = scatter_v3(1.7f, 1.7f, 1.7f);
    file->scene.lights = file->lights;
    file->scene.background = scatter_v3(0, 0, 0);
    m->gaussian_count = 0;
    m->extinction = scatter_v3(4, 4, 4);
    m->grids = file->grids;
    m->grid_count = 1;
}

/* The picture shows nothing but the medium: it is opened without lights. */
static void gl_suns_open(gl_suns *g, int n, int size, int half_float)
{
    memset(g, 0, sizeof *g);
    g->size = size;
    gl_scene_open(&g->s, "bench/eight.scatter", size, size);
    gl_suns_replace(&g->s.file, n);
    g->grid = g->s.file.grids;
    g->s.file.scene.light_count = 0;
    gl_scene_picture(&g->s, size, size);
    gl_scene_fog(&g->s, GL_SUNS_MOST, 16, half_float);
}

static void gl_suns_close(gl_suns *g)
{
    g->s.file.scene.light_count = 0;
    gl_scene_close(&g->s);
}

static scatter_quality gl_suns_quality(int grid, int lights_per_update)
{
    scatter_quality q;
    memset(&q, 0, sizeof q);
    q.depth = SCATTER_DEPTH_POLAR;
    q.nodes = GL_SUNS_NODES;
    q.grid = grid;
    q.lights_per_update = lights_per_update;
    return q;
}

/* ---------------------------------------------------------------------------- speed against error */

/* Shadow rays in the pixels where errors are taken, two lights at a time: llvmpipe ends the loops of a pixel after 65535
   turns. The background is black, so that pictures can be added. Into t->few, with its error. */
static void gl_suns_rays(gl_suns *g, const gl_truth *t, gl_shadow_way *w)
{
    scatter_scene *scene = &g->s.file.scene;
    size_t count = scene->light_count, values = gl_truth_values(t);
    float *sum = floats(values);
    double ms = 0;
    memset(sum, 0, values * sizeof *sum);
    for (size_t first = 0; first < count; first += 2) {
        gl_shadow b;
        scene->lights = g->s.file.lights + first;
        scene->light_count = count - first < 2 ? count - first : 2;
        gl_shadow_open(&b, &g->s, g->size);
        gl_shadow_try(&b, w, t); /* compiles */
        gl_shadow_try(&b, w, t);
        ms += timing_min(&w->ms);
        for (size_t i = 0; i < values; i++)
            sum[i] += t->few[i];
        gl_shadow_close(&b);
    }
    scene->lights = g->s.file.lights;
    scene->light_count = count;
    memcpy(t->few, sum, values * sizeof *sum);
    free(sum);
    w->rmse = relative_rmse(t->few, t->reference, values);
    w->ms.n = 0;
    timing_add(&w->ms, ms);
}

/* By more steps than voxels. */
static void gl_suns_truth(gl_suns *g, gl_truth *t)
{
    int n = g->grid->nx;
    gl_shadow_way fine = {2 * n, n, 0, {{0}, 0}};
    memset(t, 0, sizeof *t);
    t->size = g->size;
    t->lattice = by_level(8, 16, 32);
    t->view = view_lattice(scene_view(&g->s.file, t->size, t->size), t->size, t->lattice);
    t->reference = floats(gl_truth_values(t));
    t->few = floats(gl_truth_values(t));
    memset(t->reference, 0, gl_truth_values(t) * sizeof(float));
    gl_suns_rays(g, t, &fine);
    memcpy(t->reference, t->few, gl_truth_values(t) * sizeof(float));
}

static void gl_suns_ours(report *r, gl_suns *g, const gl_truth *t, const char *name, FILE *points)
{
    static const int ways[5][2] = {
        {64, 16}, {64, 8}, {32, 16}, {96, 24}, {128, 16}}; /* cells, nodes */
    int count = (int)g->s.file.scene.light_count;
    for (int i = 0; i < by_level(1, 3, 5); i++) {
        setting way = setting_of(SCATTER_DEPTH_POLAR, SCATTER_RAY_QUADRATURE, ways[i][1],
                                 by_level(8, ways[i][0], ways[i][0]));
        gl_measure(&g->s, &way, 1);
        gl_compare(&g->s, t, &way);
        chart_setting(points, name, &way);
        report_cell(r, "%d", count);
        report_cell(r, "%d^3 cells, %d nodes", way.quality.grid, way.quality.nodes);
        report_cell(r, "%.4g", timing_median(&way.setup));
        report_cell(r, "%.4g", timing_median(&way.rays));
        report_cell(r, "%.3g", timing_median(&way.rays) / count);
        report_cell(r, "%.3g", 100 * way.rmse);
        report_row(r, 1);
    }
}

static void gl_suns_theirs(report *r, gl_suns *g, const gl_truth *t, const char *name, FILE *points)
{
    static const int steps[3][2] = {{32, 8}, {64, 16}, {128, 32}};
    int count = (int)g->s.file.scene.light_count;
    for (int i = 0; i < by_level(1, 2, 3); i++) {
        gl_shadow_way w = {steps[i][0], steps[i][1], 0, {{0}, 0}};
        char way[32];
        gl_suns_rays(g, t, &w); /* of the lattice, times its share of the pixels */
        snprintf(way, sizeof way, "%d, %d", w.steps, w.shadow_steps);
        chart_point(points, name, "shadow rays", way, timing_min(&w.ms), w.rmse);
        report_cell(r, "%d", count);
        report_cell(r, "shadow rays %d x %d", w.steps, w.shadow_steps);
        report_cell(r, "0");
        report_cell(r, "%.4g", timing_min(&w.ms));
        report_cell(r, "%.3g", timing_min(&w.ms) / count);
        report_cell(r, "%.3g", 100 * w.rmse);
        report_row(r, 1);
    }
}

static void gl_suns_lights(report *r, gl_suns *g, int count)
{
    gl_truth t;
    char name[32];
    FILE *points;
    snprintf(name, sizeof name, "gl_suns_%d", count);
    gl_suns_turn(g, count, 0);
    gl_suns_truth(g, &t);
    points = chart_open(name, "suns");
    gl_suns_ours(r, g, &t, name, points);
    gl_suns_theirs(r, g, &t, name, points);
    chart_close(points);
    gl_truth_close(&t);
}

static void gl_suns_table(report *r)
{
    static const int counts[] = {20, 1, 4, 16, 64};
    gl_suns g;
    int n = by_level(16, 48, 96), size = by_level(32, 64, 128);
    report_text(r,
                "A procedural cloud of %d^3 voxels, %dx%d pixels. Errors are those "
                "against shadow rays with a step to a voxel and two on the eye ray; times of "
                "shadow rays are those of every so many pixels, scaled.",
                n, size, size);
    report_table(r, "gl_suns", "lights|way|update ms|view ms|view ms a light|RMSE %");
    gl_suns_open(&g, n, size, 0);
    for (int i = 0; i < by_level(2, 3, 5); i++)
        gl_suns_lights(r, &g, counts[i]);
    gl_suns_close(&g);
    report_end(r);
}

/* ------------------------------------------------------------------------------------ whole frames */

/* One frame of a sky that turns: lights, volumes, view. */
static void gl_suns_frame(gl_suns *g, int count, int frame, const scatter_quality *q,
                          timing *update, timing *view)
{
    gl_start();
    gl_suns_turn(g, count, 0.05f * (float)frame);
    must(scatter_gl_update(g->s.fog, q, NULL), "scatter_gl_update");
    double ms = gl_stop(), drawn = gl_draw_ms(&g->s);
    if (frame < 2) /* the first ones compile */
        return;
    timing_add(update, ms);
    timing_add(view, drawn);
}

static void gl_suns_sky_row(report *r, gl_suns *g, int count, int grid, int lights_per_update)
{
    const scatter_quality q = gl_suns_quality(grid, lights_per_update);
    timing update = {{0}, 0}, view = {{0}, 0};
    for (int frame = 0; frame < 2 + by_level(1, 1, 3); frame++)
        gl_suns_frame(g, count, frame, &q, &update, &view);
    report_cell(r, "%d", count);
    report_cell(r, "%d^3", grid);
    report_cell(r, "%d", lights_per_update);
    report_cell(r, "%.4g%s", timing_median(&update), timing_flag(&update));
    report_cell(r, "%.4g%s", timing_median(&view), timing_flag(&view));
    report_cell(r, "%.1f", (double)scatter_gl_get_stats(g->s.fog).texture_bytes / 1048576);
    report_row(r, 1);
}

static void gl_suns_sky(report *r)
{
    gl_suns g;
    int n = by_level(16, 64, 256), size = by_level(32, 128, 512), grid = by_level(8, 32, 64);
    report_text(r,
                "A sky that turns every frame over a cloud of %d^3 voxels, %dx%d pixels: what "
                "set_lights and update cost, and the view; all volumes anew, or those of four "
                "lights in a frame (`lights_per_update`).",
                n, size, size);
    report_table(r, "gl_suns_sky", "lights|cells|lights_per_update|update ms|view ms|textures MiB");
    gl_suns_open(&g, n, size, 0);
    gl_suns_sky_row(r, &g, 20, grid, 0);
    gl_suns_sky_row(r, &g, 20, grid, 4);
    if (level == LEVEL_FULL)
        gl_suns_sky_row(r, &g, 64, grid, 4);
    gl_suns_close(&g);
    report_end(r);
}

/* A medium with new voxels every frame: the CPU's checks and the copy, what is filled from them. */
static void gl_suns_stream_row(report *r, int n, int half_float)
{
    const scatter_quality q = gl_suns_quality(by_level(8, 32, 64), 0);
    timing set = {{0}, 0}, update = {{0}, 0};
    gl_suns g;
    gl_suns_open(&g, n, 32, half_float);
    gl_suns_turn(&g, 4, 0);
    for (int frame = 0; frame < by_level(3, 4, 8); frame++) {
        g.grid->version++;
        gl_start();
        must(scatter_gl_set_medium(g.s.fog, &g.s.file.scene.medium), "scatter_gl_set_medium");
        double ms = gl_stop();
        gl_start();
        must(scatter_gl_update(g.s.fog, &q, NULL), "scatter_gl_update");
        double filled = gl_stop();
        if (frame < 2)
            continue;
        timing_add(&set, ms);
        timing_add(&update, filled);
    }
    report_cell(r, "%d^3", n);
    report_cell(r, "%d", half_float ? 16 : 32);
    report_cell(r, "%.3g%s", timing_median(&set), timing_flag(&set));
    report_cell(r, "%.3g%s", timing_median(&update), timing_flag(&update));
    report_row(r, 1);
    gl_suns_close(&g);
}

static void gl_suns_stream(report *r)
{
    report_text(r, "Voxels that change every frame, four lights: `scatter_gl_set_medium` (checks, "
                   "search for empty bricks, upload) and what is filled from them.");
    report_table(r, "gl_suns_stream", "voxels|bits|set_medium ms|update ms");
    for (int n = by_level(16, 64, 64); n <= by_level(16, 64, 256); n *= 2)
        for (int half = 0; half < 2; half++)
            gl_suns_stream_row(r, n, half);
    report_end(r);
}

/* ------------------------------------------------------------------------------------- tone mapping */

static double gl_suns_tone_ms(gl_suns *g, unsigned source, float average)
{
    scatter_gl_tone tone;
    memset(&tone, 0, sizeof tone);
    tone.tone.log_average = average;
    tone.source = source;
    tone.framebuffer = g->s.host.framebuffer;
    tone.width = tone.height = g->size;
    gl_start();
    must(scatter_gl_tone_map(g->s.fog, &tone), "scatter_gl_tone_map");
    return gl_stop();
}

static void gl_suns_tone(report *r)
{
    timing ms[2] = {{{0}, 0}, {{0}, 0}};
    unsigned source;
    gl_suns g;
    gl_suns_open(&g, 8, by_level(32, 128, 1024), 0);
    g.s.host.gl.GenTextures(1, &source);
    g.s.host.gl.BindTexture(HOST_GL_TEXTURE_2D, source);
    float *pixels = floats((size_t)(4 * g.size * g.size));
    for (int i = 0; i < 4 * g.size * g.size; i++)
        pixels[i] = 0.01f * (float)(i % 997);
    g.s.host.gl.TexImage2D(HOST_GL_TEXTURE_2D, 0, 0x8814, g.size, g.size, 0, 0x1908, HOST_GL_FLOAT,
                           pixels);
    for (int i = 0; i < 2 * (1 + gl_rounds(5)); i++) {
        double t = gl_suns_tone_ms(&g, source, i % 2 ? 1.0f : 0.0f);
        if (i > 1)
            timing_add(&ms[i % 2], t);
    }
    report_text(
        r, "Tone mapping of %dx%d pixels: %.3g ms, of which %.3g ms where the average is given.",
        g.size, g.size, timing_median(&ms[0]), timing_median(&ms[1]));
    g.s.host.gl.DeleteTextures(1, &source);
    free(pixels);
    gl_suns_close(&g);
}

static void gl_suns_run(report *r)
{
    report_text(r, "## Many lights");
    gl_suns_table(r);
    gl_suns_sky(r);
    gl_suns_stream(r);
    gl_suns_tone(r);
}

#endif
