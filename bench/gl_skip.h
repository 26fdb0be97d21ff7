/* gl_skip.h - benchmark: empty space skipped on the GPU. Table 1 of Navarro, Gutierrez and Seron 2008
   as ratios, light volumes instead of shadow rays, and what distance maps cost. MIT licence.

   Twenty directional lights, which are five batches: without the mask each draws the whole picture.
   Everything is the library's own march; the uniform one is the library with no_mask and
   no_distance_map. */
#ifndef SCATTER_BENCH_GL_SKIP_H
#define SCATTER_BENCH_GL_SKIP_H

#include "gl_bench.h"

enum { GL_SKIP_LIGHTS = 20, GL_SKIP_SCENES = 2, GL_SKIP_ROUNDS = 3 };

/* How samples are lit, as in the paper. */
typedef enum gl_skip_shading {
    GL_SKIP_ALPHA,   /* not at all */
    GL_SKIP_PRIMARY, /* without shadows of the medium on itself */
    GL_SKIP_SHADOWS, /* a ray to each light from each sample */
    GL_SKIP_SHADINGS
} gl_skip_shading;

typedef enum gl_skip_how { GL_SKIP_NONE, GL_SKIP_MASK, GL_SKIP_BOTH, GL_SKIP_HOWS } gl_skip_how;

static const char *const gl_skip_shadings[GL_SKIP_SHADINGS] = {"alpha", "primary", "self-shadow"};

/* What the paper has: mask, mask and distance, over neither; data sets (i) and (ii). */
static const double gl_skip_theirs[GL_SKIP_SCENES][GL_SKIP_SHADINGS][2] = {
    {{0.9, 3.3}, {1.1, 3.9}, {2.4, 8.2}}, {{0.8, 3.0}, {0.9, 3.1}, {1.8, 6.6}}};

/* llvmpipe ends a pixel's loops after 65535 turns: `steps` times four lights with two turns a voxel to the end of the box
   stay below, else pictures would differ. */
typedef struct gl_skip_data {
    const char *name, *voxels, *text;
    float min[3], max[3], scale;
    int steps;
} gl_skip_data;

static const gl_skip_data gl_skip_list[GL_SKIP_SCENES] = {
    {"Disney cloud",
     "../shared/data/volumes/wdas_cloud_sixteenth_126x86x154_u8.raw",
     "image 64 64\ncamera perspective 420 200 560 -11.6667 71.6667 -45 0 1 0 50\n"
     "medium 0.06 0.06 0.06 0.95 0.95 0.95\n",
     {-221.666667f, -71.666667f, -301.666667f},
     {198.333333f, 215, 211.666667f},
     1,
     64},
    {"ISPC smoke",
     "../shared/data/volumes/ispc_smoke_48x64x48.vol.txt",
     "image 64 64\ncamera perspective 0 2.4 8 0 2 0 0 1 0 40\nmedium 16 16 16 0.9 0.9 0.9\n",
     {-1.5f, 0, -1.5f},
     {1.5f, 4, 1.5f},
     1,
     64}};

typedef struct gl_skip {
    gl_scene scene;
    const gl_skip_data *data;
    int size;
    float *few; /* the picture without skipping */
    timing ms[GL_SKIP_HOWS];
    double off; /* largest difference of the pictures, over the largest value */
} gl_skip;

/* --------------------------------------------------------------------------------------- scene */

/* Lights all around, spread evenly by the golden angle. */
static void gl_skip_lights(scatter_light *lights)
{
    for (int i = 0; i < GL_SKIP_LIGHTS; i++) {
        float y = 1 - 2 * ((float)i + 0.5f) / GL_SKIP_LIGHTS, r = sqrtf(1 - y * y);
        float turn = 2.39996323f * (float)i;
        memset(&lights[i], 0, sizeof lights[i]);
        lights[i].kind = SCATTER_LIGHT_DIRECTIONAL;
        lights[i].direction = scatter_v3(-r * cosf(turn), -y, -r * sinf(turn));
        lights[i].intensity = scatter_v3(1, 1, 1);
    }
}

/* One grid and its lights into a file without any; 0 if there are no voxels. */
static int gl_skip_read(scene_file *file, const gl_skip_data *d)
{
    file_error error;
    file_grid voxels;
    if (file_grid_read(d->voxels, &voxels, &error))
        return 0;
    gl_must(scene_parse(file, d->text, strlen(d->text), NULL), d->name, file->error);
    file->grids = (scatter_grid *)calloc(1, sizeof *file->grids);
    file->lights = (scatter_light *)calloc(GL_SKIP_LIGHTS, sizeof *file->lights);
    gl_must(!file->grids || !file->lights, d->name, "no memory");
    file->grids[0].density = voxels.density;
    file->grids[0].nx = voxels.nx;
    file->grids[0].ny = voxels.ny;
    file->grids[0].nz = voxels.nz;
    file->grids[0].box.min = scatter_v3(d->min[0], d->min[1], d->min[2]);
    file->grids[0].box.max = scatter_v3(d->max[0], d->max[1], d->max[2]);
    file->grids[0].scale = d->scale;
    gl_skip_lights(file->lights);
    file->scene.medium.grids = file->grids;
    file->scene.medium.grid_count = 1;
    file->scene.lights = file->lights;
    file->scene.light_count = GL_SKIP_LIGHTS;
    return 1;
}

static int gl_skip_size(void)
{
    return gl_software() ? by_level(8, 32, 64) : by_level(64, 256, 512);
}

static int gl_skip_open(gl_skip *b, const gl_skip_data *d)
{
    memset(b, 0, sizeof *b);
    b->data = d;
    b->size = gl_skip_size();
    b->scene.path = d->name;
    snprintf(b->scene.name, sizeof b->scene.name, "%s", d->name);
    if (!gl_skip_read(&b->scene.file, d))
        return 0;
    gl_scene_picture(&b->scene, b->size, b->size);
    gl_scene_fog(&b->scene, GL_SKIP_LIGHTS, 16, 0);
    b->few = floats((size_t)(3 * b->size * b->size));
    return 1;
}

static void gl_skip_close(gl_skip *b)
{
    gl_scene_close(&b->scene);
    free(b->few);
}

/* ------------------------------------------------------------------------------------- drawing */

static scatter_quality gl_skip_quality(const gl_skip *b, gl_skip_how how)
{
    scatter_quality q;
    memset(&q, 0, sizeof q);
    q.depth = SCATTER_DEPTH_CLOSED;
    q.density = SCATTER_DENSITY_EXACT;
    q.ray = SCATTER_RAY_MARCH;
    q.nodes = b->data->steps;
    q.no_mask = how == GL_SKIP_NONE;
    q.no_distance_map = how != GL_SKIP_BOTH;
    return q;
}

/* What scatter_gl_draw does, without rays to the lights. */
static void gl_skip_draw_primary(scatter_gl *f, const scatter_gl_view *v)
{
    scatteri_gl_state state;
    must(scatteri_gl_check_view(f, v), "scatteri_gl_check_view");
    scatteri_gl_save(f, &state);
    scatteri_gl_bind_scene(f, v);
    must(scatteri_gl_draw_whole(f, v, scatteri_gl_medium_features(f) & ~SCATTERI_GL_HAS(RAYS)),
         "scatteri_gl_draw_whole");
    scatteri_gl_restore(f, &state);
}

static double gl_skip_draw_ms(gl_skip *b, gl_skip_shading shading)
{
    host_gl_draw(&b->scene.host);
    gl_start();
    if (shading == GL_SKIP_PRIMARY)
        gl_skip_draw_primary(b->scene.fog, &b->scene.host.fog_view);
    else
        must(scatter_gl_draw(b->scene.fog, &b->scene.host.fog_view), "scatter_gl_draw");
    return gl_stop();
}

/* Shaders are compiled before, into a picture of few pixels. */
static void gl_skip_compile(gl_skip *b, gl_skip_shading shading)
{
    scatter_gl_view *v = &b->scene.host.fog_view;
    v->width = v->height = 1;
    gl_skip_draw_ms(b, shading);
    v->width = v->height = b->size;
}

static double gl_skip_off(const gl_skip *b)
{
    const float *rgb = b->scene.rgb;
    double off = 0, most = 0;
    for (int i = 0; i < 3 * b->size * b->size; i++) {
        off = fmax(off, fabs((double)rgb[i] - (double)b->few[i]));
        most = fmax(most, (double)b->few[i]);
    }
    return off / most;
}

static void gl_skip_measure(gl_skip *b, gl_skip_shading shading)
{
    size_t lights = shading == GL_SKIP_ALPHA ? 0 : GL_SKIP_LIGHTS;
    must(scatter_gl_set_lights(b->scene.fog, b->scene.host.lights, lights),
         "scatter_gl_set_lights");
    b->off = 0;
    for (int how = 0; how < GL_SKIP_HOWS; how++) {
        scatter_quality q = gl_skip_quality(b, (gl_skip_how)how);
        must(scatter_gl_update(b->scene.fog, &q, NULL), "scatter_gl_update");
        gl_skip_compile(b, shading);
        b->ms[how].n = 0;
        do
            timing_add(&b->ms[how], gl_skip_draw_ms(b, shading));
        while (b->ms[how].n < GL_SKIP_ROUNDS && timing_min(&b->ms[how]) < 2e3);
        gl_picture(&b->scene);
        if (how == GL_SKIP_NONE)
            memcpy(b->few, b->scene.rgb, (size_t)(3 * b->size * b->size) * sizeof *b->few);
        b->off = fmax(b->off, gl_skip_off(b));
    }
}

/* --------------------------------------------------------------------------------- shadow rays */

static void gl_skip_row(report *r, const gl_skip *b, gl_skip_shading shading)
{
    const double *theirs = gl_skip_theirs[b->data - gl_skip_list][shading];
    double none = timing_median(&b->ms[GL_SKIP_NONE]);
    report_cell(r, "%s", b->data->name);
    report_cell(r, "%s", gl_skip_shadings[shading]);
    report_cell(r, "%.3g%s", none, timing_flag(&b->ms[GL_SKIP_NONE]));
    for (int how = GL_SKIP_MASK; how < GL_SKIP_HOWS; how++) {
        report_cell(r, "%.2f%s", none / timing_median(&b->ms[how]), timing_flag(&b->ms[how]));
        report_cell(r, "%.1f", theirs[how - 1]);
    }
    report_cell(r, "%d", b->ms[GL_SKIP_BOTH].n);
    report_cell(r, "%.1e", b->off);
    report_row(r, 1);
}

static void gl_skip_targets(report *r, const gl_skip *b)
{
    char target[160];
    double ratio = timing_median(&b->ms[GL_SKIP_NONE]) / timing_median(&b->ms[GL_SKIP_BOTH]);
    snprintf(target, sizeof target,
             "%s: mask and distance map, self-shadowed: >= 8.2 times as fast", b->data->name);
    report_target(r, ratio >= 8.2, target, "%.1f times", ratio);
    snprintf(target, sizeof target, "%s: skipped and unskipped pictures equal to 1e-6",
             b->data->name);
    report_target(r, b->off <= 1e-6, target, "%.1e", b->off);
}

static void gl_skip_table(report *r)
{
    report_table(r, "gl_skip",
                 "scene|shading|neither ms|mask|paper|mask and distance|paper|n|off by");
    for (int i = 0; i < GL_SKIP_SCENES; i++) {
        gl_skip b;
        if (!gl_skip_open(&b, &gl_skip_list[i])) {
            report_text(r, "%s: skipped: no data", gl_skip_list[i].name);
            continue;
        }
        for (int shading = 0; shading < GL_SKIP_SHADINGS; shading++) {
            gl_skip_measure(&b, (gl_skip_shading)shading);
            gl_skip_row(r, &b, (gl_skip_shading)shading);
        }
        gl_skip_targets(r, &b);
        gl_skip_close(&b);
    }
    report_end(r);
}

/* ------------------------------------------------------------------------------- light volumes */

#define GL_SKIP_ERROR 0.01

enum { GL_SKIP_VOLUMES = 5 };

/* Cells along an axis of the volumes, nodes. */
static const int gl_skip_volumes[GL_SKIP_VOLUMES][2] = {
    {64, 8}, {64, 16}, {64, 32}, {96, 32}, {128, 32}};

/* Every so many pixels by scatter.h: depth exact in each cell, many nodes. */
typedef struct gl_skip_truth {
    int lattice;
    float *reference, *few;
} gl_skip_truth;

static size_t gl_skip_truth_values(const gl_skip_truth *t)
{
    return (size_t)(3 * t->lattice * t->lattice);
}

static void gl_skip_open_truth(gl_skip_truth *t, const gl_skip *b)
{
    t->lattice = by_level(4, 8, 16);
    t->reference = floats(gl_skip_truth_values(t));
    t->few = floats(gl_skip_truth_values(t));
    scatter_view view =
        view_lattice(scene_view(&b->scene.file, b->size, b->size), b->size, t->lattice);
    scatter_image image = image_of(t->reference, t->lattice, t->lattice);
    setting exact = setting_of(SCATTER_DEPTH_CLOSED, SCATTER_RAY_QUADRATURE, 32, 0);
    render_timed(&exact, &b->scene.file.scene, &view, &image);
}

static double gl_skip_error(gl_skip *b, const gl_skip_truth *t)
{
    image_lattice(gl_picture(&b->scene), b->size, t->lattice, t->few);
    return relative_rmse(t->few, t->reference, gl_skip_truth_values(t));
}

static void gl_skip_volume_row(report *r, const gl_skip *b, const char *way, const setting *s,
                               double brute)
{
    report_cell(r, "%s", b->data->name);
    report_cell(r, "%s", way);
    report_cell(r, "%d", s->quality.nodes);
    report_cell(r, "%d", s->quality.grid);
    report_cell(r, "%.3g%s", timing_median(&s->setup), timing_flag(&s->setup));
    report_cell(r, "%.3g%s", timing_median(&s->rays), timing_flag(&s->rays));
    report_cell(r, "%d", s->rays.n);
    report_cell(r, "%.1f", brute / timing_median(&s->rays));
    report_cell(r, "%.1f", brute / setting_ms(s));
    report_cell(r, "%.3g", 100 * s->rmse);
    report_row(r, 1);
}

/* Shadow rays with and without skipping; returns ms without. */
static double gl_skip_brute(report *r, gl_skip *b, const gl_skip_truth *t)
{
    static const char *const names[GL_SKIP_HOWS] = {"shadow rays", "", "shadow rays, skipping"};
    double brute = 0;
    for (int how = GL_SKIP_NONE; how < GL_SKIP_HOWS; how += GL_SKIP_BOTH) {
        setting s = setting_of(SCATTER_DEPTH_CLOSED, SCATTER_RAY_MARCH, b->data->steps, 0);
        s.quality = gl_skip_quality(b, (gl_skip_how)how);
        gl_measure(&b->scene, &s, how == GL_SKIP_NONE ? 1 : gl_rounds(GL_SKIP_ROUNDS));
        s.rmse = gl_skip_error(b, t);
        brute = how == GL_SKIP_NONE ? timing_median(&s.rays) : brute;
        gl_skip_volume_row(r, b, names[how], &s, brute);
    }
    return brute;
}

static void gl_skip_volumes_of(report *r, gl_skip *b)
{
    gl_skip_truth t;
    char target[160];
    double best = 0, off = 1;
    must(scatter_gl_set_lights(b->scene.fog, b->scene.host.lights, GL_SKIP_LIGHTS),
         "scatter_gl_set_lights");
    gl_skip_open_truth(&t, b);
    double brute = gl_skip_brute(r, b, &t);
    for (int i = 0; i < by_level(1, 3, GL_SKIP_VOLUMES); i++) {
        setting s = setting_of(SCATTER_DEPTH_POLAR, SCATTER_RAY_QUADRATURE, gl_skip_volumes[i][1],
                               gl_skip_volumes[i][0]);
        gl_measure(&b->scene, &s, gl_rounds(GL_SKIP_ROUNDS));
        s.rmse = gl_skip_error(b, &t);
        gl_skip_volume_row(r, b, "volumes", &s, brute);
        if (s.rmse <= GL_SKIP_ERROR && brute / timing_median(&s.rays) > best) {
            best = brute / timing_median(&s.rays);
            off = s.rmse;
        }
    }
    snprintf(target, sizeof target, "%s: light volumes at 1 %%: >= 50 times as fast as shadow rays",
             b->data->name);
    if (best > 0)
        report_target(r, best >= 50, target, "%.1f times at %.3g %%", best, 100 * off);
    else
        report_target(r, 0, target, "no setting of the table errs by so little");
    free(t.reference);
    free(t.few);
}

static void gl_skip_volumes_table(report *r)
{
    report_table(r, "gl_skip_volumes",
                 "scene|light by|nodes|cells|update ms|view ms|n|times as fast|with update|RMSE %");
    for (int i = 0; i < GL_SKIP_SCENES; i++) {
        gl_skip b;
        if (!gl_skip_open(&b, &gl_skip_list[i]))
            continue;
        gl_skip_volumes_of(r, &b);
        gl_skip_close(&b);
    }
    report_end(r);
}

/* ------------------------------------------------------------------------------- distance maps */

enum { GL_SKIP_SIZES = 3 };

static const int gl_skip_sizes[GL_SKIP_SIZES] = {32, 64, 128};

/* Balls here and there, about a tenth of the box. */
static float *gl_skip_balls(int n)
{
    float *v = floats((size_t)n * (size_t)n * (size_t)n);
    uint64_t seed = 5;
    memset(v, 0, (size_t)n * (size_t)n * (size_t)n * sizeof *v);
    for (int ball = 0; ball < 12; ball++) {
        scatter_vec3 c = random_point(&seed);
        float r = random_between(&seed, 0.05, 0.17);
        for (int i = 0; i < n * n * n; i++) {
            float x = ((float)(i % n) + 0.5f) / (float)n - c.x;
            float y = ((float)(i / n % n) + 0.5f) / (float)n - c.y;
            float z = ((float)(i / n / n) + 0.5f) / (float)n - c.z;
            v[i] += x * x + y * y + z * z < r * r ? 1.0f : 0.0f;
        }
    }
    return v;
}

static double gl_skip_processor_ms(const scatter_medium *medium)
{
    scatter_host host = scatteri_host_or_default(NULL);
    scatteri_medium m;
    memset(&m, 0, sizeof m);
    must(scatteri_prepare(&host, &m, medium), "scatteri_prepare");
    double start = thread_ms();
    must(scatteri_map_medium(&host, &m), "scatteri_map_medium");
    double ms = thread_ms() - start;
    scatteri_drop_medium(&host, &m);
    return ms;
}

/* Drawing the map again of voxels that are there. */
static double gl_skip_map_ms(scatter_gl *f)
{
    scatteri_gl_state state;
    scatteri_gl_save(f, &state);
    gl_start();
    must(scatteri_gl_measure_distance(f), "scatteri_gl_measure_distance");
    double ms = gl_stop();
    scatteri_gl_restore(f, &state);
    return ms;
}

static void gl_skip_map_row(report *r, int n)
{
    scatter_medium medium;
    scatter_grid grid;
    gl_scene s;
    timing gpu = {{0}, 0}, cpu = {{0}, 0};
    scatter_quality q;
    memset(&q, 0, sizeof q);
    q.depth = SCATTER_DEPTH_CLOSED;
    q.density = SCATTER_DENSITY_EXACT;
    memset(&medium, 0, sizeof medium);
    memset(&grid, 0, sizeof grid);
    memset(&s, 0, sizeof s);
    gl_scene_fog(&s, 1, 1, 0);
    float *voxels = gl_skip_balls(n);
    grid.density = voxels;
    grid.nx = grid.ny = grid.nz = n;
    grid.box.max = scatter_v3(1, 1, 1);
    medium.extinction = scatter_v3(1, 1, 1);
    medium.grids = &grid;
    medium.grid_count = 1;
    must(scatter_gl_set_medium(s.fog, &medium), "scatter_gl_set_medium");
    must(scatter_gl_update(s.fog, &q, NULL), "scatter_gl_update");
    for (int i = 0; i < GL_SKIP_ROUNDS; i++) {
        timing_add(&gpu, gl_skip_map_ms(s.fog));
        timing_add(&cpu, gl_skip_processor_ms(&medium));
    }
    report_cell(r, "%d^3", n);
    report_cell(r, "%.3g%s", timing_median(&gpu), timing_flag(&gpu));
    report_cell(r, "%.3g%s", timing_median(&cpu), timing_flag(&cpu));
    report_cell(r, "%d", gpu.n);
    report_row(r, 1);
    scatter_gl_destroy(s.fog);
    free(voxels);
}

static void gl_skip_maps_table(report *r)
{
    report_table(r, "gl_skip_maps", "voxels|passes ms|scatter.h, one thread, ms|n");
    for (int i = 0; i < by_level(1, 2, GL_SKIP_SIZES); i++)
        gl_skip_map_row(r, gl_skip_sizes[i]);
    report_end(r);
}

static void gl_skip_run(report *r)
{
    report_text(r, "## Empty space");
    report_text(r,
                "The march with %d directional lights, %dx%d pixels, %d and %d steps: how "
                "many times as fast as with neither mask nor distance map, beside the figures of "
                "Navarro, Gutierrez and Seron 2008, table 1 (other volumes, 512x512, Quadro FX "
                "3500). `off by`: largest difference of the pictures over their largest value.",
                GL_SKIP_LIGHTS, gl_skip_size(), gl_skip_size(), gl_skip_list[0].steps,
                gl_skip_list[1].steps);
    gl_skip_table(r);
    report_text(r, "Light volumes instead: columns around each light, quadrature. `update`: from a "
                   "changed medium to volumes, and distance maps, that are ready. Errors against "
                   "scatter.h with exact depth and 32 nodes.");
    gl_skip_volumes_table(r);
    report_text(r, "Distance maps of twelve balls, up to 32 voxels, exact: three passes, each "
                   "texel looking along "
                   "one axis as far as something nearer may be, beside the linear transform of "
                   "scatter.h.");
    gl_skip_maps_table(r);
}

#endif
