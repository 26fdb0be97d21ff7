/* peers.h - POV-Ray and OpenVDB's vdb_render on our scenes, beside ours. MIT licence.

   `make bench-peers` runs it and writes docs/peers.md, and the points of the charts to
   build/bench/SCENE.peers.csv. POV-Ray 3.7 is told our scenes by what its source says of media:
   - A ray is cut into `intervals`, each with one sample in its middle (method 2, samples 1):
     within an interval it takes extinction for constant, so only more intervals converge. The
     same number serves eye and shadow rays.
   - Its phase functions have no 1/(4 pi), which goes into the lights; `extinction` multiplies
     scattering, so 1/albedo makes it ours.
   - `fade_power 2` gives 2 C/(1 + (r/d0)^2): with d0 the lamp's radius and C = I/(2 d0^2) that is
     our I/(r^2 + R^2).
   - Shadow rays see a medium only where they cross its surface: a lamp inside needs a bubble. The
     bubble must be larger than its shadow tolerance of 1 mm, or the picture is speckled.
   - Rays end and go on at every surface, and each part gets `intervals` of its own: three empty
     spheres round a lamp that is inside put the samples where the light is, which made it over
     five times as accurate in the same time. */
#ifndef SCATTER_BENCH_PEERS_H
#define SCATTER_BENCH_PEERS_H

#include "cloud.h"
#include "image.h"

enum { PEERS_SIZE = 256, PEERS_ROUNDS = 3, PEERS_WAYS = 16, PEERS_SCENES = 3 };

#define PEERS_SLOW 3e3    /* ms; what takes longer is measured once */
#define PEERS_LONG 15e3   /* ms; what takes longer is measured with one thread only */
#define PEERS_LIMIT 120e3 /* ms; what would take longer is left out */
#define PEERS_REACH 3.4   /* widths 1/a of a Gaussian in POV-Ray's container: exp(-11.6) is left */
#define PEERS_BUBBLE 1.5e-3 /* m; radius of the hole round a lamp */
#define PEERS_PI 3.14159265358979

typedef enum peers_kind { PEERS_OURS, PEERS_POV, PEERS_VDB } peers_kind;

static const char *const peers_names[] = {"scatter", "POV-Ray", "vdb_render"};

/* One way to make the image. */
typedef struct peers_way {
    peers_kind kind;
    int steps, grid;     /* nodes and cells of ours, intervals of POV-Ray */
    const char *options; /* of vdb_render */
} peers_way;

/* A scene, its peer, and how much faster than the peer we want to be at `budget`, on one thread. */
typedef struct peers_scene {
    const char *path;
    int pixels; /* along the edge of the lattice on which the error is taken */
    double budget, times;
    peers_way way[PEERS_WAYS];
} peers_scene;

static const peers_scene peers_scenes[PEERS_SCENES] = {
    {"examples/scenes/one_gaussian.scatter",
     256,
     0.005,
     300,
     {{PEERS_OURS, 4, 0, ""},
      {PEERS_OURS, 8, 0, ""},
      {PEERS_OURS, 12, 0, ""},
      {PEERS_OURS, 16, 0, ""},
      {PEERS_OURS, 24, 0, ""},
      {PEERS_POV, 8, 0, ""},
      {PEERS_POV, 12, 0, ""},
      {PEERS_POV, 16, 0, ""},
      {PEERS_POV, 24, 0, ""},
      {PEERS_POV, 32, 0, ""},
      {PEERS_POV, 40, 0, ""}}},
    {"bench/eight_two.scatter",
     256,
     0.005,
     600,
     {{PEERS_OURS, 4, 0, ""},
      {PEERS_OURS, 8, 0, ""},
      {PEERS_OURS, 12, 0, ""},
      {PEERS_OURS, 16, 0, ""},
      {PEERS_OURS, 24, 0, ""},
      {PEERS_OURS, 32, 0, ""},
      {PEERS_POV, 2, 0, ""},
      {PEERS_POV, 3, 0, ""},
      {PEERS_POV, 4, 0, ""},
      {PEERS_POV, 6, 0, ""},
      {PEERS_POV, 8, 0, ""},
      {PEERS_POV, 12, 0, ""}}},
    {"bench/cloud.scatter",
     64,
     0.02,
     1,
     {{PEERS_OURS, 8, 96, ""},
      {PEERS_OURS, 8, 128, ""},
      {PEERS_OURS, 16, 128, ""},
      {PEERS_OURS, 16, 192, ""},
      {PEERS_OURS, 32, 256, ""},
      {PEERS_VDB, 0, 0, " -step 4 -shadowstep 4"},
      {PEERS_VDB, 0, 0, " -step 2 -shadowstep 3"},
      {PEERS_VDB, 0, 0, " -step 1 -shadowstep 3"},
      {PEERS_VDB, 0, 0, " -step 1 -shadowstep 1"},
      {PEERS_VDB, 0, 0, " -step 1 -shadowstep 0.5"},
      {PEERS_VDB, 0, 0, " -step 0.5 -shadowstep 0.5"},
      {PEERS_VDB, 0, 0, " -step 0.25 -shadowstep 0.25"}}}};

typedef struct peers_point {
    int skipped;
    double rmse;
    timing ms;
} peers_point;

typedef struct peers_bench {
    const peers_scene *scene;
    char name[64];
    int ways;
    scene_file file;
    scatter_view view;
    double exposure; /* of POV-Ray's picture, so that its 16 bits hold the brightest pixel */
    float *rgb, *few, *reference;
    float *picture[2];                /* the most accurate of ours, and of the peer */
    double best[2];                   /* their errors */
    peers_point point[2][PEERS_WAYS]; /* with one and with two threads */
} peers_bench;

/* ----------------------------------------------------------------------------------- POV-Ray */

static void pov_vector(FILE *out, const char *before, scatter_vec3 v, double scale)
{
    fprintf(out, "%s<%.9g, %.9g, %.9g>", before, scale * (double)v.x, scale * (double)v.y,
            scale * (double)v.z);
}

static void pov_camera(FILE *out, const scatter_view *v)
{
    scatter_vec3 middle;
    middle.x = v->direction.x + 0.5f * (v->direction_dx.x + v->direction_dy.x);
    middle.y = v->direction.y + 0.5f * (v->direction_dx.y + v->direction_dy.y);
    middle.z = v->direction.z + 0.5f * (v->direction_dx.z + v->direction_dy.z);
    pov_vector(out, "camera { perspective location ", v->origin, 1);
    pov_vector(out, " direction ", middle, 1);
    pov_vector(out, " right ", v->direction_dx, 1);
    pov_vector(out, " up ", v->direction_dy, -1);
    fputs(" }\n", out);
}

static void pov_light(FILE *out, const scatter_light *l, double exposure)
{
    double r = (double)l->radius;
    pov_vector(out, "light_source { ", l->position, 1);
    pov_vector(out, " color rgb ", l->intensity, exposure / (4 * PEERS_PI * 2 * r * r));
    fprintf(out, " fade_distance %.9g fade_power 2 }\n", r);
}

static int pov_is_inside(const scatter_medium *m, scatter_vec3 p)
{
    for (size_t i = 0; i < m->gaussian_count; i++) {
        const scatter_gaussian *g = &m->gaussians[i];
        if (hypot(hypot((double)(p.x - g->center.x), (double)(p.y - g->center.y)),
                  (double)(p.z - g->center.z)) < PEERS_REACH / (double)g->a)
            return 1;
    }
    return 0;
}

/* Where the medium is: round all Gaussians, without the bubbles. */
static void pov_container(FILE *out, const scene_file *file)
{
    const scatter_medium *m = &file->scene.medium;
    fputs(m->gaussian_count > 1 ? "difference { merge {\n" : "difference { object {\n", out);
    for (size_t i = 0; i < m->gaussian_count; i++) {
        pov_vector(out, "sphere { ", m->gaussians[i].center, 1);
        fprintf(out, ", %.9g }\n", PEERS_REACH / (double)m->gaussians[i].a);
    }
    fputs("}\n", out);
    for (size_t i = 0; i < file->scene.light_count; i++) {
        if (!pov_is_inside(m, file->lights[i].position))
            continue;
        pov_vector(out, "sphere { ", file->lights[i].position, 1);
        fprintf(out, ", %g }\n", PEERS_BUBBLE);
    }
}

/* Empty spheres round the lamps that are inside. */
static void pov_shells(FILE *out, const scene_file *file)
{
    static const double radii[3] = {2, 8, 24}; /* of the lamp */
    for (size_t i = 0; i < file->scene.light_count; i++)
        for (int k = 0; k < 3 && pov_is_inside(&file->scene.medium, file->lights[i].position);
             k++) {
            pov_vector(out, "sphere { ", file->lights[i].position, 1);
            fprintf(out, ", %g hollow pigment { rgbt 1 } finish { ambient 0 diffuse 0 } }\n",
                    radii[k] * (double)file->lights[i].radius);
        }
}

static void pov_term(FILE *out, double factor, const char *of)
{
    if (factor != 0)
        fprintf(out, "%+.12g*%s", factor, of);
}

/* The density over `most`: it has to stay below 1. Each Gaussian is one exponential of a quadratic
   in x, y, z and q, their squares' sum: the fewest operations for the interpreter of functions,
   which takes most of the time. */
static void pov_sum(FILE *out, const scatter_medium *m, double most, const char *q)
{
    for (size_t i = 0; i < m->gaussian_count; i++) {
        const scatter_gaussian *g = &m->gaussians[i];
        double bx = (double)g->center.x, by = (double)g->center.y, bz = (double)g->center.z;
        double a2 = (double)g->a * (double)g->a;
        fprintf(out, "%sexp(%.12g", i ? "\n+" : "",
                log((double)g->c / most) - a2 * (bx * bx + by * by + bz * bz));
        pov_term(out, -a2, q);
        pov_term(out, 2 * a2 * bx, "x");
        pov_term(out, 2 * a2 * by, "y");
        pov_term(out, 2 * a2 * bz, "z");
        fputs(")", out);
    }
}

/* A function of its own pays where q is needed more than once. */
static void pov_density(FILE *out, const scatter_medium *m, double most)
{
    if (m->gaussian_count > 1) {
        fputs("#declare D = function(x, y, z, q) { ", out);
        pov_sum(out, m, most, "q");
        fputs(" }\n#declare Density = density { function { D(x, y, z, x*x+y*y+z*z) } }\n", out);
    } else {
        fputs("#declare Density = density { function { ", out);
        pov_sum(out, m, most, "(x*x+y*y+z*z)");
        fputs(" } }\n", out);
    }
}

static void pov_medium(FILE *out, const scene_file *file, int intervals)
{
    const scatter_medium *m = &file->scene.medium;
    double most = 0;
    for (size_t i = 0; i < m->gaussian_count; i++)
        most += (double)m->gaussians[i].c;
    pov_density(out, m, most);
    pov_container(out, file);
    fprintf(out,
            "hollow pigment { rgbt 1 } finish { ambient 0 diffuse 0 } interior { media { method 2 "
            "intervals %d samples 1, 1\nscattering { 5, ",
            intervals);
    pov_vector(out, "rgb ", m->extinction, most * (double)m->albedo.x);
    fprintf(out, " eccentricity %.9g extinction %.9g }\n", (double)m->phase.g,
            1 / (double)m->albedo.x);
    fputs("density { Density } } } }\n", out);
}

/* Grey albedo, point lights and Gaussians only. */
static void pov_write(const peers_bench *b, const char *path, int intervals)
{
    FILE *out = fopen(path, "w");
    if (!out)
        report_die("cannot write", path);
    fputs("#version 3.7;\nglobal_settings { assumed_gamma 1 adc_bailout 0 max_trace_level 64 }\n",
          out);
    pov_vector(out, "background { rgb ", b->file.scene.background, b->exposure);
    fputs(" }\n", out);
    pov_camera(out, &b->view);
    for (size_t i = 0; i < b->file.scene.light_count; i++)
        pov_light(out, &b->file.lights[i], b->exposure);
    pov_medium(out, &b->file, intervals);
    pov_shells(out, &b->file);
    if (fclose(out) != 0)
        report_die("cannot write", path);
}

/* Its own figures, ms: on one thread the processor time of tracing, else tracing on the wall; 0:
   it failed. */
static double pov_run_ms(const char *command, int threads)
{
    char line[1024], *at;
    double wall = 0, busy = 0;
    FILE *pipe = popen(command, "r");
    if (!pipe)
        return 0;
    while (fgets(line, sizeof line, pipe)) {
        if (strstr(line, "Trace Time:") && (at = strrchr(line, '(')))
            wall = strtod(at + 1, NULL);
        if (strstr(line, "CPU-seconds total") && (at = strstr(line, "with ")))
            busy = strtod(at + 5, NULL);
    }
    return pclose(pipe) == 0 ? 1e3 * (threads > 1 ? wall : busy) : 0;
}

/* A binary PPM of 8 or 16 bits, 0..1. A saturated value is an error: it is not what was traced. */
static int ppm_read(const char *path, int size, float *rgb)
{
    char *text;
    size_t bytes, n = (size_t)3 * (size_t)size * (size_t)size, brightest = 0;
    file_error error;
    if (file_read(path, SIZE_MAX, &text, &bytes, &error) != 0)
        return 0;
    int wide = bytes > 2 * n;
    const unsigned char *at = (const unsigned char *)text + bytes - (wide ? 2 * n : n);
    for (size_t i = 0; bytes > n && i < n; i++) {
        size_t value = wide ? 256u * at[2 * i] + at[2 * i + 1] : at[i];
        brightest = value > brightest ? value : brightest;
        rgb[i] = (float)value / (wide ? 65535.0f : 255.0f);
    }
    free(text);
    return bytes > n && brightest < (wide ? 65535 : 255);
}

/* Milliseconds; 0: it failed. */
static double pov_render(peers_bench *b, const peers_way *way, int threads)
{
    char command[512];
    snprintf(command, sizeof command,
             "povray build/bench/peer.pov +W%d +H%d -D +WT%d Output_File_Type=P Bits_Per_Color=16 "
             "File_Gamma=1.0 +Obuild/bench/peer.ppm 2>&1 </dev/null",
             PEERS_SIZE, PEERS_SIZE, threads);
    pov_write(b, "build/bench/peer.pov", way->steps);
    double ms = pov_run_ms(command, threads);
    if (!(ms > 0) || !ppm_read("build/bench/peer.ppm", PEERS_SIZE, b->rgb))
        return 0;
    for (size_t i = 0; i < (size_t)3 * PEERS_SIZE * PEERS_SIZE; i++)
        b->rgb[i] = (float)((double)b->rgb[i] / b->exposure);
    return ms;
}

/* -------------------------------------------------------------------------------- vdb_render */

/* Its picture is cut off to 8 bits: the middle of what a byte stands for, but nothing for 0. */
static double vdb_render(peers_bench *b, const peers_way *way, int threads)
{
    cloud_peer peer;
    peer_way as = {"", way->options, threads};
    peer_command(&peer, &b->file, &as);
    double ms = peer_run_ms(&peer);
    if (!(ms > 0) || !ppm_read(CLOUD_PPM, PEERS_SIZE, b->rgb))
        return 0;
    for (size_t i = 0; i < (size_t)3 * PEERS_SIZE * PEERS_SIZE; i++)
        b->rgb[i] += b->rgb[i] > 0 ? 0.5f / 255.0f : 0.0f;
    return ms;
}

/* -------------------------------------------------------------------------------------- ours */

/* Update and rays; the clock is the one that the peer is measured with. */
static double ours_render(peers_bench *b, const peers_way *way, int threads)
{
    setting s = setting_of(SCATTER_DEPTH_AUTO, SCATTER_RAY_QUADRATURE, way->steps, way->grid);
    scatter_image image = image_of(b->rgb, PEERS_SIZE, PEERS_SIZE);
    s.threads = threads;
    s.on_wall = threads > 1 || b->scene->way[b->ways - 1].kind == PEERS_VDB;
    render_timed(&s, &b->file.scene, &b->view, &image);
    return setting_ms(&s);
}

/* ----------------------------------------------------------------------------------- a scene */

static void peers_open(peers_bench *b, const peers_scene *scene)
{
    size_t all = (size_t)3 * PEERS_SIZE * PEERS_SIZE, few;
    double brightest = 0;
    memset(b, 0, sizeof *b);
    b->scene = scene;
    scene_short(scene->path, b->name, sizeof b->name);
    scene_must_read(&b->file, scene->path);
    few = (size_t)(3 * scene->pixels * scene->pixels);
    b->rgb = floats(all);
    b->few = floats(few);
    b->reference = floats(few);
    for (int peer = 0; peer < 2; peer++) {
        b->picture[peer] = floats(all);
        b->best[peer] = INFINITY;
    }
    b->view = scene_view(&b->file, PEERS_SIZE, PEERS_SIZE);
    scatter_view view = view_lattice(b->view, PEERS_SIZE, scene->pixels);
    reference_of_file(&b->file, scene->path, &view, scene->pixels, b->reference);
    for (size_t i = 0; i < few; i++)
        brightest = fmax(brightest, (double)b->reference[i]);
    b->exposure = 0.5 / brightest;
    while (b->ways < PEERS_WAYS && scene->way[b->ways].options)
        b->ways++;
}

static void peers_close(peers_bench *b)
{
    scene_free(&b->file);
    free(b->rgb);
    free(b->few);
    free(b->reference);
    free(b->picture[0]);
    free(b->picture[1]);
}

/* Twice the intervals take four times as long: each sample sends shadow rays. Two threads are only
   measured where one does not take long. */
static int peers_too_slow(const peers_bench *b, int threads, int i)
{
    const peers_way *way = &b->scene->way[i];
    if (threads > 1 && (b->point[0][i].skipped || timing_min(&b->point[0][i].ms) > PEERS_LONG))
        return 1;
    if (i == 0 || way[-1].kind != way->kind || way->kind != PEERS_POV)
        return 0;
    const peers_point *last = &b->point[threads - 1][i - 1];
    double more = (double)way->steps / way[-1].steps;
    return last->skipped || timing_min(&last->ms) * more * more > PEERS_LIMIT;
}

static void peers_keep_picture(peers_bench *b, int peer, double rmse)
{
    if (rmse >= b->best[peer])
        return;
    b->best[peer] = rmse;
    memcpy(b->picture[peer], b->rgb, (size_t)3 * PEERS_SIZE * PEERS_SIZE * sizeof *b->rgb);
}

static int peers_measure(peers_bench *b, int threads, int i)
{
    static double (*const render[])(peers_bench *, const peers_way *,
                                    int) = {ours_render, pov_render, vdb_render};
    const peers_way *way = &b->scene->way[i];
    peers_point *point = &b->point[threads - 1][i];
    double ms = render[way->kind](b, way, threads);
    if (!(ms > 0))
        return 0;
    timing_add(&point->ms, ms);
    image_lattice(b->rgb, PEERS_SIZE, b->scene->pixels, b->few);
    point->rmse =
        relative_rmse(b->few, b->reference, (size_t)(3 * b->scene->pixels * b->scene->pixels));
    peers_keep_picture(b, way->kind != PEERS_OURS, point->rmse);
    return 1;
}

/* Every way once, ours and theirs in turn. 0: the peer does not run. */
static int peers_round(peers_bench *b, int round)
{
    for (int i = 0; i < b->ways; i++)
        for (int threads = 1; threads <= 2; threads++) {
            peers_point *point = &b->point[threads - 1][i];
            if (round == 0)
                point->skipped = peers_too_slow(b, threads, i);
            if (point->skipped || (round && timing_min(&point->ms) > PEERS_SLOW))
                continue;
            if (!peers_measure(b, threads, i))
                return 0;
        }
    return 1;
}

/* ------------------------------------------------------------------------------------ report */

/* What the way is called in tables and charts. */
static void peers_label(const peers_way *way, char *label, size_t room)
{
    if (way->kind == PEERS_VDB)
        snprintf(label, room, "%s", way->options + 1);
    else if (way->kind == PEERS_POV)
        snprintf(label, room, "%d intervals", way->steps);
    else if (way->grid)
        snprintf(label, room, "%d nodes, grid %d", way->steps, way->grid);
    else
        snprintf(label, room, "%d nodes", way->steps);
}

static void peers_row(report *r, const peers_bench *b, int threads, int i)
{
    const peers_point *point = &b->point[threads - 1][i];
    char label[64];
    peers_label(&b->scene->way[i], label, sizeof label);
    report_cell(r, "%s", peers_names[b->scene->way[i].kind]);
    report_cell(r, "%s", label);
    report_cell(r, "%d", threads);
    if (point->skipped) {
        report_cell(r, "left out");
        report_row(r, 0);
        return;
    }
    report_cell(r, "%.4g%s", timing_median(&point->ms), timing_flag(&point->ms));
    report_cell(r, "%.4g", timing_min(&point->ms));
    report_cell(r, "%d", point->ms.n);
    report_cell(r, "%.3g", 100 * point->rmse);
    report_row(r, 1);
}

/* For the charts. */
static void peers_points(const peers_bench *b)
{
    char path[128], label[64];
    snprintf(path, sizeof path, "build/bench/%s.peers.csv", b->name);
    FILE *csv = fopen(path, "w");
    if (!csv)
        report_die("cannot write", path);
    fputs("scene,family,setting,ms,error\n", csv);
    for (int threads = 1; threads <= 2; threads++)
        for (int i = 0; i < b->ways; i++) {
            const peers_point *point = &b->point[threads - 1][i];
            peers_label(&b->scene->way[i], label, sizeof label);
            if (!point->skipped && b->scene->way[i].kind != PEERS_OURS)
                fprintf(csv, "%s,\"%s, threads: %d\",\"%s\",%.6g,%.6g\n", b->name,
                        peers_names[b->scene->way[i].kind], threads, label,
                        timing_median(&point->ms), point->rmse);
        }
    if (fclose(csv) != 0)
        report_die("cannot write", path);
}

/* The fastest way that keeps `budget`; if none does, the most accurate; -1: none was measured. */
static int peers_choice(const peers_bench *b, int peer, int threads, double budget)
{
    int best = -1;
    for (int i = 0; i < b->ways; i++) {
        const peers_point *p = &b->point[threads - 1][i];
        if ((b->scene->way[i].kind != PEERS_OURS) != peer || p->skipped)
            continue;
        const peers_point *q = &b->point[threads - 1][best < 0 ? i : best];
        int keeps = p->rmse <= budget, kept = q->rmse <= budget;
        if (best < 0 || (keeps && (!kept || timing_median(&p->ms) < timing_median(&q->ms))) ||
            (!keeps && !kept && p->rmse < q->rmse))
            best = i;
    }
    return best;
}

static void peers_target(report *r, const peers_bench *b, int threads)
{
    const peers_scene *s = b->scene;
    int i = peers_choice(b, 0, threads, s->budget), j = peers_choice(b, 1, threads, s->budget);
    const peers_point *ours = &b->point[threads - 1][i], *theirs = &b->point[threads - 1][j];
    double ratio = timing_median(&theirs->ms) / timing_median(&ours->ms);
    char target[160];
    snprintf(target, sizeof target, "%s, threads: %d: at %g %% at least %g times as fast as %s",
             b->name, threads, 100 * s->budget, s->times, peers_names[s->way[j].kind]);
    report_target(r, ours->rmse <= s->budget && ratio >= s->times, target,
                  "%.3g times: %.3g %% in %.4g ms against %.3g %% in %.4g ms%s", ratio,
                  100 * ours->rmse, timing_median(&ours->ms), 100 * theirs->rmse,
                  timing_median(&theirs->ms),
                  theirs->rmse <= s->budget ? "" : " (its best: never so accurate)");
}

/* One row of ours, theirs and 20 times the difference, the mean of ours at middle grey. */
static void peers_picture_row(const peers_bench *b, int y, float gain, unsigned char *out)
{
    for (int x = 0; x < 3 * PEERS_SIZE; x++) {
        float ours = b->picture[0][3 * PEERS_SIZE * y + x];
        float theirs = b->picture[1][3 * PEERS_SIZE * y + x];
        out[x] = scatter_srgb8(gain * ours);
        out[x + 3 * PEERS_SIZE] = scatter_srgb8(gain * theirs);
        out[x + 6 * PEERS_SIZE] = scatter_srgb8(20 * gain * fabsf(ours - theirs));
    }
}

static void peers_pictures(report *r, const peers_bench *b)
{
    char path[128];
    file_error error;
    size_t n = (size_t)3 * PEERS_SIZE * PEERS_SIZE;
    unsigned char *out = (unsigned char *)malloc(3 * n);
    double mean = 0;
    if (!out)
        must(SCATTER_OUT_OF_MEMORY, "malloc");
    for (size_t i = 0; i < n; i++)
        mean += (double)b->picture[0][i] / (double)n;
    for (int y = 0; y < PEERS_SIZE; y++)
        peers_picture_row(b, y, (float)(0.18 / mean), out + 9 * PEERS_SIZE * y);
    snprintf(path, sizeof path, "docs/peers_%s.png", b->name);
    if (file_png_write(path, out, 3 * PEERS_SIZE, PEERS_SIZE, &error) != 0)
        report_die("cannot write", path);
    free(out);
    report_text(r, "![ours, %s, and 20 times the difference](peers_%s.png)",
                peers_names[b->scene->way[b->ways - 1].kind], b->name);
}

static void peers_report(report *r, const peers_bench *b)
{
    char csv[96];
    snprintf(csv, sizeof csv, "peers_%s", b->name);
    peers_pictures(r, b);
    report_table(r, csv, "program|setting|threads|ms|min ms|n|RMSE %");
    for (int i = 0; i < b->ways; i++)
        for (int threads = 1; threads <= 2; threads++)
            peers_row(r, b, threads, i);
    report_end(r);
    peers_points(b);
    for (int threads = 1; threads <= 2; threads++)
        peers_target(r, b, threads);
}

static void peers_run(report *r)
{
    report_text(r, "## Beside other programs");
    report_text(r,
                "Written by `make bench-peers`. %dx%d pixels, errors against the "
                "double-precision reference. Times are rays for all, with the setup for ours; on "
                "one thread processor time against POV-Ray's own figure for tracing, otherwise "
                "time on the wall against the program's own figure for tracing. Start and reading "
                "of files are not counted. The pictures show ours, theirs and 20 times the "
                "difference, the most accurate of each.",
                PEERS_SIZE, PEERS_SIZE);
    for (int i = 0; i < PEERS_SCENES; i++) {
        peers_bench b;
        int runs = 1;
        report_text(r, "### `%s`", peers_scenes[i].path);
        if (strcmp(peers_scenes[i].path, cloud_paths[0]) == 0 && !cloud_is_there()) {
            report_text(r, "skipped: no data (%s)", CLOUD_DATA);
            continue;
        }
        peers_open(&b, &peers_scenes[i]);
        for (int round = 0; runs && round < PEERS_ROUNDS; round++)
            runs = peers_round(&b, round);
        if (runs)
            peers_report(r, &b);
        else
            report_text(r, "Not compared: the peer does not run.");
        peers_close(&b);
    }
}

#endif
