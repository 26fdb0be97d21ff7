/* gl_frames.h - benchmarks: update and view pass of whole frames at the usual sizes, and what
   lights, Gaussians, formats and reduced resolution cost. MIT licence. */
#ifndef SCATTER_BENCH_GL_FRAMES_H
#define SCATTER_BENCH_GL_FRAMES_H

#include "gl_bench.h"

enum { GL_FRAMES_METHODS = 4, GL_FRAMES_NODES = 12, GL_FRAMES_LIGHTS = 3 };

static const char gl_frames_path[] = "bench/eight_four.scatter";

static const scatter_depth_method gl_frames_methods[GL_FRAMES_METHODS] = {
    SCATTER_DEPTH_CLOSED, SCATTER_DEPTH_CLOSED_VOLUME, SCATTER_DEPTH_POLAR, SCATTER_DEPTH_UPWIND};

/* The scene with its first lights alone. */
static void gl_frames_open(gl_scene *s, int width, int height)
{
    gl_scene_open(s, gl_frames_path, width, height);
    s->file.scene.light_count = GL_FRAMES_LIGHTS;
    must(scatter_gl_set_lights(s->fog, s->host.lights, GL_FRAMES_LIGHTS), "scatter_gl_set_lights");
}

/* Update with and without the eye, and draw, in turn. */
static void gl_frames_measure(gl_scene *s, setting *way, timing *with_eye)
{
    int rounds = gl_rounds(1);
    with_eye->n = 0;
    gl_measure(s, way, rounds);
    for (int i = 0; i <= rounds; i++) {
        double ms = gl_update_ms(s, &way->quality, &s->file.eye);
        if (i > 0) /* the first one compiles */
            timing_add(with_eye, ms);
    }
}

static void gl_frames_row(report *r, const setting *way, const timing *with_eye, const char *size)
{
    double ratio = timing_median(with_eye) / timing_median(&way->rays);
    report_cell(r, "%s", scene_depth_name(way->quality.depth));
    report_cell(r, "%s", size);
    report_cell(r, "%.3g%s", timing_median(&way->setup), timing_flag(&way->setup));
    report_cell(r, "%.3g%s", timing_median(with_eye), timing_flag(with_eye));
    report_cell(r, "%.4g%s", timing_median(&way->rays), timing_flag(&way->rays));
    report_cell(r, "%.4g", setting_ms(way));
    report_cell(r, "%.3g", 100 * way->rmse);
    report_cell(r, "%.3f", ratio);
    report_row(r, 1);
}

/* Errors of the setting in a square picture of the same scene. */
static void gl_frames_error(setting *way)
{
    gl_scene s;
    gl_truth t;
    gl_frames_open(&s, gl_size(), gl_size());
    t.size = gl_size();
    t.lattice = gl_lattice();
    t.view = view_lattice(scene_view(&s.file, t.size, t.size), t.size, t.lattice);
    t.reference = floats(gl_truth_values(&t));
    t.few = floats(gl_truth_values(&t));
    reference_cached(&s.file.scene, "three of four lights",
                     hash_file(HASH_START, gl_frames_path) + GL_FRAMES_LIGHTS, &t.view, t.lattice,
                     t.reference);
    must(scatter_gl_update(s.fog, &way->quality, NULL), "scatter_gl_update");
    gl_draw_ms(&s);
    gl_compare(&s, &t, way);
    gl_truth_close(&t);
    gl_scene_close(&s);
}

static void gl_frames_size(report *r, setting *ways, int width, int height)
{
    gl_scene s;
    timing with_eye;
    char size[32];
    snprintf(size, sizeof size, "%dx%d", width, height);
    gl_frames_open(&s, width, height);
    for (int i = 0; i < GL_FRAMES_METHODS; i++) {
        setting *way = &ways[i];
        way->setup.n = way->rays.n = 0;
        gl_frames_measure(&s, way, &with_eye);
        gl_frames_row(r, way, &with_eye, size);
        if (height == 720 && way->quality.depth != SCATTER_DEPTH_CLOSED) {
            char target[160];
            snprintf(target, sizeof target,
                     "update of %d^3 cells, 3 lights + eye (%s) < view pass at 1280x720",
                     way->quality.grid, scene_depth_name(way->quality.depth));
            report_target(r, timing_median(&with_eye) < timing_median(&way->rays), target,
                          "%.3g ms against %.4g ms", timing_median(&with_eye),
                          timing_median(&way->rays));
        }
    }
    gl_scene_close(&s);
}

/* The fastest whole frame that errs by 1 % at most. A target for GPUs only. */
static void gl_frames_target(report *r, const setting *ways)
{
    const setting *best = NULL;
    for (int i = 0; i < GL_FRAMES_METHODS; i++)
        if (ways[i].rmse <= 0.01 && (!best || setting_ms(&ways[i]) < setting_ms(best)))
            best = &ways[i];
    if (!best)
        report_target(r, 0, "1920x1080, 64^3, 3 lights: <= 1 %", "no method keeps it");
    else if (gl_software())
        report_text(r,
                    "1920x1080, 64^3, 3 lights, <= 1 %%: %s, %.3g %% in %.4g ms (the 0.5 ms "
                    "that are asked for are those of a GPU).",
                    scene_depth_name(best->quality.depth), 100 * best->rmse, setting_ms(best));
    else
        report_target(r, setting_ms(best) <= 0.5,
                      "1920x1080, 64^3, 3 lights, <= 1 %: update + draw <= 0.5 ms",
                      "%.3g %% in %.3g ms (%s)", 100 * best->rmse, setting_ms(best),
                      scene_depth_name(best->quality.depth));
}

static void gl_frames_run(report *r)
{
    setting ways[GL_FRAMES_METHODS];
    int grid = by_level(16, 32, 64);
    report_text(r, "## Frames");
    report_text(r,
                "`eight_four` with three of its lights, %d nodes, %d^3 cells. The eye as a "
                "fourth source is in `with eye`; `whole` is update (without the eye) and view; "
                "the error is that of a picture of %dx%d pixels.",
                GL_FRAMES_NODES, grid, gl_size(), gl_size());
    report_table(r, "gl_frames",
                 "depth|picture|update ms|with eye ms|view ms|whole ms|RMSE %|with eye over view");
    for (int i = 0; i < GL_FRAMES_METHODS; i++) {
        ways[i] = setting_of(gl_frames_methods[i], SCATTER_RAY_QUADRATURE, GL_FRAMES_NODES, grid);
        gl_frames_error(&ways[i]);
    }
    gl_frames_size(r, ways, by_level(64, 640, 1280), by_level(36, 360, 720));
    if (level == LEVEL_FULL)
        gl_frames_size(r, ways, 1920, 1080);
    report_end(r);
    if (level == LEVEL_FULL)
        gl_frames_target(r, ways);
}

/* --------------------------------------------------------------------------------------- costs */

/* What one row of the table of costs is measured with. */
typedef struct gl_cost {
    const char *what;
    scatter_quality quality;
    int lights, gaussians, half_float, divide;
} gl_cost;

/* `count` Gaussians of about the same density everywhere, in a ball. */
static void gl_costs_gaussians(scatter_gaussian *g, int count)
{
    uint64_t state = 7;
    float a = 1.6f * cbrtf((float)count / 8.0f);
    for (int i = 0; i < count; i++) {
        scatter_vec3 p = random_point(&state);
        g[i].center = scatter_v3(3 * p.x - 1.5f, 3 * p.y - 1.5f, 3 * p.z - 1.5f);
        g[i].a = a;
        g[i].c = 2.0f;
    }
}

static void gl_costs_lights(gl_scene *s, scatter_gl_light *lights, int count)
{
    for (int i = 0; i < count; i++) {
        float angle = 2.4f * (float)i;
        memset(&lights[i], 0, sizeof lights[i]);
        lights[i].light.position = scatter_v3(3 * cosf(angle), 2.5f, 3 * sinf(angle));
        lights[i].light.intensity = scatter_v3(30.0f / (float)count, 25.0f / (float)count, 20);
    }
    must(scatter_gl_set_lights(s->fog, lights, (size_t)count), "scatter_gl_set_lights");
}

static void gl_costs_row(report *r, gl_scene *s, const gl_cost *c)
{
    static scatter_gaussian gaussians[4096];
    static scatter_gl_light lights[16];
    setting way = setting_of(c->quality.depth, c->quality.ray, c->quality.nodes, c->quality.grid);
    scatter_gaussian *own = s->file.gaussians;
    size_t count = s->file.scene.medium.gaussian_count;
    way.quality = c->quality;
    gl_scene_fog(s, 16, 4096, c->half_float);
    if (c->gaussians) {
        gl_costs_gaussians(gaussians, c->gaussians);
        s->file.scene.medium.gaussians = gaussians;
        s->file.scene.medium.gaussian_count = (size_t)c->gaussians;
    }
    if (c->lights)
        gl_costs_lights(s, lights, c->lights);
    s->host.fog_view.divide = c->divide;
    gl_measure(s, &way, gl_rounds(2));
    s->file.scene.medium.gaussians = own;
    s->file.scene.medium.gaussian_count = count;
    s->host.fog_view.divide = 1;
    report_cell(r, "%s", c->what);
    report_cell(r, "%d", c->lights ? c->lights : (int)s->file.scene.light_count);
    report_cell(r, "%d", c->gaussians ? c->gaussians : (int)count);
    report_cell(r, "%s", scene_depth_name(c->quality.depth));
    report_cell(r, "%.3g%s", timing_median(&way.setup), timing_flag(&way.setup));
    report_cell(r, "%.4g%s", timing_median(&way.rays), timing_flag(&way.rays));
    report_cell(r, "%.2f", (double)scatter_gl_get_stats(s->fog).texture_bytes / 1048576);
    report_row(r, 1);
}

static void gl_costs_of_lights(report *r, gl_scene *s)
{
    static const int counts[] = {1, 2, 3, 4, 8, 16};
    for (int m = 0; m < 2; m++)
        for (int i = 0; i < by_level(2, 4, 6); i++) {
            gl_cost c = {"lights", {0}, counts[i], 0, 0, 1};
            c.quality.depth = m ? SCATTER_DEPTH_POLAR : SCATTER_DEPTH_CLOSED;
            c.quality.nodes = GL_FRAMES_NODES;
            c.quality.grid = by_level(16, 32, 64);
            gl_costs_row(r, s, &c);
        }
}

/* Density and depth in volumes; the update is injection and columns. */
static void gl_costs_of_gaussians(report *r, gl_scene *s)
{
    for (int n = 1; n <= by_level(16, 256, 4096); n *= 4) {
        gl_cost c = {"Gaussians", {0}, 0, 0, 0, 1};
        c.gaussians = n;
        c.quality.depth = SCATTER_DEPTH_POLAR;
        c.quality.density = SCATTER_DENSITY_VOLUME;
        c.quality.nodes = GL_FRAMES_NODES;
        c.quality.grid = by_level(16, 32, 64);
        gl_costs_row(r, s, &c);
    }
}

static void gl_costs_of_formats(report *r, gl_scene *s)
{
    static const scatter_depth_method methods[] = {SCATTER_DEPTH_CLOSED_VOLUME,
                                                   SCATTER_DEPTH_POLAR};
    for (int m = 0; m < 2; m++)
        for (int half = 0; half < 2; half++) {
            gl_cost c = {half ? "16 bits" : "32 bits", {0}, 0, 0, 0, 1};
            c.half_float = half;
            c.quality.depth = methods[m];
            c.quality.nodes = GL_FRAMES_NODES;
            c.quality.grid = by_level(16, 32, 64);
            gl_costs_row(r, s, &c);
        }
}

static void gl_costs_of_pixels(report *r, gl_scene *s)
{
    static const char *const names[] = {"every pixel", "half resolution", "quarter resolution"};
    for (int i = 0; i < 3; i++) {
        gl_cost c = {"", {0}, 0, 0, 0, 1};
        c.what = names[i];
        c.divide = 1 << i;
        c.quality.depth = SCATTER_DEPTH_CLOSED;
        c.quality.nodes = GL_FRAMES_NODES;
        gl_costs_row(r, s, &c);
    }
}

/* Errors of half and quarter resolution, and of 16 bits. */
static void gl_costs_errors(report *r)
{
    gl_scene s;
    gl_truth t;
    gl_scene_open(&s, gl_frames_path, gl_size(), gl_size());
    gl_truth_open(&t, &s, gl_size(), gl_lattice());
    report_table(r, "gl_errors", "what|depth|RMSE %");
    for (int i = 0; i < 5; i++) {
        setting way = setting_of(i < 3 ? SCATTER_DEPTH_CLOSED : SCATTER_DEPTH_CLOSED_VOLUME,
                                 SCATTER_RAY_QUADRATURE, 16, by_level(16, 32, 64));
        gl_scene_fog(&s, 16, 4096, i == 4);
        s.host.fog_view.divide = i < 3 ? 1 << i : 1;
        gl_update_ms(&s, &way.quality, NULL);
        gl_draw_ms(&s);
        gl_compare(&s, &t, &way);
        report_cell(r, i < 3 ? "every %d. pixel" : "%d bits", i < 3 ? 1 << i : i == 4 ? 16 : 32);
        report_cell(r, "%s", scene_depth_name(way.quality.depth));
        report_cell(r, "%.3g", 100 * way.rmse);
        report_row(r, 1);
    }
    report_end(r);
    gl_truth_close(&t);
    gl_scene_close(&s);
}

/* The view-aligned volume. */
static void gl_costs_froxels(report *r, gl_scene *s)
{
    scatter_gl_froxels froxels = {160, 90, 64, 3, 10};
    scatter_quality quality;
    timing ms = {{0}, 0};
    memset(&quality, 0, sizeof quality);
    quality.depth = SCATTER_DEPTH_POLAR;
    gl_scene_fog(s, 16, 4096, 0);
    if (level != LEVEL_FULL)
        froxels.nx = froxels.ny = froxels.nz = 16;
    gl_update_ms(s, &quality, NULL);
    for (int i = 0; i < 3; i++) {
        gl_start();
        must(scatter_gl_fill_froxels(s->fog, &s->host.fog_view, &froxels),
             "scatter_gl_fill_froxels");
        double t = gl_stop();
        if (i > 0)
            timing_add(&ms, t);
    }
    report_text(r, "A view-aligned volume of %d x %d x %d froxels for transparent things: %.3g ms.",
                froxels.nx, froxels.ny, froxels.nz, timing_median(&ms));
}

static void gl_costs_run(report *r)
{
    gl_scene s;
    int size = gl_size();
    report_text(r, "## Costs");
    report_text(
        r,
        "`eight_four` with %d nodes and 64^3 cells, %dx%d pixels, one thing changed at a "
        "time. Gaussians: from so many, each as narrow as fills the same room, with density "
        "and depth in volumes.",
        GL_FRAMES_NODES, size, size);
    gl_scene_open(&s, gl_frames_path, size, size);
    report_table(r, "gl_costs", "what|lights|Gaussians|depth|update ms|view ms|textures MiB");
    gl_costs_of_lights(r, &s);
    gl_costs_of_gaussians(r, &s);
    gl_costs_of_formats(r, &s);
    gl_costs_of_pixels(r, &s);
    report_end(r);
    gl_costs_froxels(r, &s);
    gl_scene_close(&s);
    gl_costs_errors(r);
}

#endif
