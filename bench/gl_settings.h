/* gl_settings.h - benchmark: pictures by every depth method, nodes, steps and cells: time of update
   and view pass, error. MIT licence. */
#ifndef SCATTER_BENCH_GL_SETTINGS_H
#define SCATTER_BENCH_GL_SETTINGS_H

#include "gl_bench.h"

enum {
    GL_SETTINGS_SCENES = 4,
    GL_SETTINGS_ROOM = 48,
    GL_SETTINGS_SLOW = 150 /* ms; what takes longer is measured once */
};

static const char *const gl_settings_paths[GL_SETTINGS_SCENES] = {
    "bench/eight.scatter", "bench/eight_four.scatter", "examples/scenes/dense_core.scatter",
    "bench/cloud.scatter"};

typedef struct gl_settings {
    setting s[GL_SETTINGS_ROOM];
    int count;
} gl_settings;

static void gl_settings_add(gl_settings *l, scatter_depth_method depth, scatter_ray_method ray,
                            int nodes, int grid)
{
    l->s[l->count++] = setting_of(depth, ray, nodes, grid);
}

static void gl_settings_closed(gl_settings *l)
{
    static const int nodes[] = {4, 6, 8, 10, 12, 16, 24, 32, 64}, steps[] = {16, 32, 64, 128, 256};
    for (int i = 0; i < by_level(2, 5, 9); i++)
        gl_settings_add(l, SCATTER_DEPTH_CLOSED, SCATTER_RAY_QUADRATURE, nodes[i], 0);
    for (int i = 0; i < by_level(1, 3, 5); i++)
        gl_settings_add(l, SCATTER_DEPTH_CLOSED, SCATTER_RAY_MARCH, steps[i], 0);
}

static void gl_settings_volume(gl_settings *l, scatter_depth_method depth, int voxels)
{
    static const int grids[] = {16, 32, 64, 128, 192}, steps[] = {32, 64, 128, 256, 512};
    for (int i = voxels; i < by_level(2, 3, 4 + voxels); i++)
        gl_settings_add(l, depth, SCATTER_RAY_QUADRATURE, 16, grids[i]);
    gl_settings_add(l, depth, SCATTER_RAY_QUADRATURE, 8, by_level(16, 64, 64));
    gl_settings_add(l, depth, SCATTER_RAY_QUADRATURE, 32, by_level(16, 64, voxels ? 192 : 128));
    for (int i = voxels; i < by_level(1, 2, depth == SCATTER_DEPTH_UPWIND ? 0 : 4 + voxels); i++)
        gl_settings_add(l, depth, SCATTER_RAY_MARCH, steps[i], 64);
}

static void gl_settings_list(gl_settings *l, int voxels)
{
    l->count = 0;
    if (!voxels) {
        gl_settings_closed(l);
        gl_settings_volume(l, SCATTER_DEPTH_CLOSED_VOLUME, 0);
    }
    gl_settings_volume(l, SCATTER_DEPTH_POLAR, voxels);
    gl_settings_volume(l, SCATTER_DEPTH_UPWIND, voxels);
}

static void gl_settings_row(report *r, const gl_scene *s, const setting *way)
{
    report_cell(r, "%s", s->name);
    report_cell(r, "%s", scene_depth_name(way->quality.depth));
    report_cell(r, "%s", scene_ray_name(way->quality.ray));
    report_cell(r, "%d", way->quality.nodes);
    report_cell(r, "%d", way->quality.grid);
    report_cell(r, "%.3g%s", timing_median(&way->setup), timing_flag(&way->setup));
    report_cell(r, "%.3g%s", timing_median(&way->rays), timing_flag(&way->rays));
    report_cell(r, "%d", way->rays.n);
    report_cell(r, "%.3g", 100 * way->rmse);
    report_cell(r, "%.3g", 100 * way->p99);
    report_row(r, 1);
}

/* Once, and twice more unless it is slow. */
static void gl_settings_measure(gl_scene *s, const gl_truth *t, setting *way)
{
    gl_measure(s, way, 1);
    gl_compare(s, t, way);
    for (int i = 0; i < gl_rounds(3) - 1 && setting_ms(way) < GL_SETTINGS_SLOW; i++) {
        timing_add(&way->setup, gl_update_ms(s, &way->quality, NULL));
        timing_add(&way->rays, gl_draw_ms(s));
    }
}

static void gl_settings_scene(report *r, const char *path)
{
    gl_scene s;
    gl_truth t;
    gl_settings l;
    gl_scene_open(&s, path, gl_size(), gl_size());
    gl_truth_open(&t, &s, gl_size(), gl_lattice());
    gl_settings_list(&l, s.file.scene.medium.grid_count > 0);
    FILE *points = chart_open(s.name, "points");
    fprintf(points, "# %s on %s, %dx%d\n", s.name, the_gl()->renderer, gl_size(), gl_size());
    for (int i = 0; i < l.count; i++) {
        gl_settings_measure(&s, &t, &l.s[i]);
        chart_setting(points, s.name, &l.s[i]);
        gl_settings_row(r, &s, &l.s[i]);
    }
    chart_close(points);
    gl_truth_close(&t);
    gl_scene_close(&s);
}

static void gl_settings_run(report *r)
{
    report_text(r, "## Settings");
    report_text(r,
                "Pictures of %dx%d pixels. `update`: from a changed medium to volumes that are "
                "ready; `view`: the draw.",
                gl_size(), gl_size());
    report_table(r, "gl_settings",
                 "scene|depth|ray|nodes|cells|update ms|view ms|n|RMSE %|99th percentile %");
    for (int i = 0; i < by_level(1, 2, GL_SETTINGS_SCENES); i++)
        if (scene_has_data(gl_settings_paths[i]))
            gl_settings_scene(r, gl_settings_paths[i]);
        else
            report_text(r, "%s: skipped: no data", gl_settings_paths[i]);
    report_end(r);
}

#endif
