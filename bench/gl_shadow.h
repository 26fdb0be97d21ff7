/* gl_shadow.h - benchmark: the view pass beside a fragment shader that marches a shadow ray from
   every step of its eye ray, both at 0.5 %. MIT licence.

   The baseline is what shadow_rays.h does, as GLSL: uniform steps, middle values, both rays
   clipped to the box of the medium, density by the Gaussians themselves or by the voxels, numbers
   of Gaussians and lights known to the compiler, phase function and its constants from the library.
   It computes L + T background itself and blends nothing. */
#ifndef SCATTER_BENCH_GL_SHADOW_H
#define SCATTER_BENCH_GL_SHADOW_H

#include "gl_bench.h"
#include "shadow_rays.h"

enum { GL_SHADOW_ROOM = 64, GL_SHADOW_LIGHTS = 64, GL_SHADOW_UNIT = 1 };

static const char gl_shadow_density[] =
    "uniform vec3 low, high;\n"
    "#if GAUSSIANS\n"
    "uniform vec3 center[GAUSSIANS], shape[GAUSSIANS];\n" /* c, a^2 */
    "float density(vec3 x) {\n"
    "    float sum = 0.0;\n"
    "    for (int i = 0; i < GAUSSIANS; i++) {\n"
    "        vec3 d = x - center[i];\n"
    "        sum += shape[i].x * exp(-shape[i].y * dot(d, d));\n"
    "    }\n"
    "    return sum;\n"
    "}\n"
    "#else\n"
    "uniform highp sampler3D voxels;\n"
    "uniform float scale;\n"
    "float density(vec3 x) {\n"
    "    return scale * textureLod(voxels, (x - low) / (high - low), 0.0).x;\n"
    "}\n"
    "#endif\n"
    "vec2 clip(vec3 o, vec3 d, float far) {\n"
    "    vec3 a = (low - o) / d, b = (high - o) / d, near3 = min(a, b), far3 = max(a, b);\n"
    "    float near = max(max(near3.x, near3.y), max(near3.z, 0.0));\n"
    "    return vec2(near, max(near, min(min(far3.x, far3.y), min(far3.z, far))));\n"
    "}\n";

static const char gl_shadow_main[] =
    "uniform vec3 ray[6], extinction, scattering, background, lobes[2];\n"
    "uniform vec2 pixels;\n"
    "uniform int steps, shadow_steps;\n"
    "uniform vec3 place[LIGHTS], color[LIGHTS], more[LIGHTS];\n" /* radius^2, directional */
    "out vec4 picture;\n"
    "float shadow(vec3 x, vec3 to, float distance) {\n"
    "    vec2 t = clip(x, to, distance);\n"
    "    float h = (t.y - t.x) / float(shadow_steps), sum = 0.0;\n"
    "    for (int i = 0; i < shadow_steps; i++)\n"
    "        sum += density(x + (t.x + (float(i) + 0.5) * h) * to);\n"
    "    return h * sum;\n"
    "}\n"
    "vec3 sent(int l, vec3 x, vec3 d, float before) {\n"
    "    vec3 off = place[l] - x;\n"
    "    bool sun = more[l].y > 0.5;\n"
    "    float r2 = sun ? 1.0 : max(dot(off, off), 1e-20), r = sqrt(r2);\n"
    "    vec3 to = sun ? place[l] : off / r;\n"
    "    float depth = before + shadow(x, to, sun ? 1e6 : r);\n"
    "    scatteri_lobes two = scatteri_lobes(lobes[0].x, lobes[0].y, lobes[0].z, lobes[1].x, "
    "lobes[1].y);\n"
    "    float fall = scatteri_phase(two, 1.0 - dot(to, d)) / (sun ? 1.0 : r2 + more[l].x);\n"
    "    return fall * color[l] * exp(-extinction * depth);\n"
    "}\n"
    "void main() {\n"
    "    vec2 c = gl_FragCoord.xy / pixels;\n"
    "    vec3 o = ray[0] + c.x * ray[1] + c.y * ray[2];\n"
    "    vec3 d = normalize(ray[3] + c.x * ray[4] + c.y * ray[5]);\n"
    "    vec2 t = clip(o, d, 1e6);\n"
    "    float h = (t.y - t.x) / float(steps), depth = 0.0;\n"
    "    vec3 sum = vec3(0.0);\n"
    "    for (int k = 0; k < steps; k++) {\n"
    "        vec3 x = o + (t.x + (float(k) + 0.5) * h) * d;\n"
    "        float part = h * density(x);\n"
    "        depth += 0.5 * part;\n"
    "        if (part > 0.0)\n"
    "            for (int l = 0; l < LIGHTS; l++)\n"
    "                sum += part * sent(l, x, d, depth);\n"
    "        depth += 0.5 * part;\n"
    "    }\n"
    "    picture = vec4(scattering * sum + exp(-extinction * depth) * background, 1.0);\n"
    "}\n";

/* One setting of the baseline. */
typedef struct gl_shadow_way {
    int steps, shadow_steps;
    double rmse;
    timing ms;
} gl_shadow_way;

typedef struct gl_shadow {
    gl_scene *scene;
    shadow_scene medium;
    host_gl host; /* a picture of its own */
    unsigned program, voxels;
    float *rgb;
} gl_shadow;

/* ------------------------------------------------------------------------------------- program */

static void gl_shadow_vectors(const gl_shadow *b, const char *name, int count,
                              const scatter_vec3 *v)
{
    b->host.gl.Uniform3fv(host_gl_at(&b->host, b->program, name), count, &v->x);
}

static void gl_shadow_compile(gl_shadow *b)
{
    char head[128];
    const char *text[] = {host_gl_version(&b->host),
                          head,
                          scatter_gl_glsl("prelude"),
                          scatter_gl_glsl("vector"),
                          scatter_gl_glsl("phase"),
                          gl_shadow_density,
                          gl_shadow_main};
    snprintf(head, sizeof head, "#define GAUSSIANS %d\n#define LIGHTS %d\n",
             (int)b->medium.gaussian_count, (int)b->medium.scene->light_count);
    b->program = host_gl_program(&b->host, text, 7);
    gl_must(!b->program, b->scene->path, b->host.error);
    b->host.gl.UseProgram(b->program);
}

static void gl_shadow_send_gaussians(const gl_shadow *b)
{
    scatter_vec3 center[GL_SHADOW_ROOM], shape[GL_SHADOW_ROOM];
    int count = (int)b->medium.gaussian_count;
    for (int i = 0; i < count; i++) {
        const scatter_gaussian g = b->medium.gaussians[i];
        center[i] = g.center;
        shape[i] = scatter_v3(g.c, g.a * g.a, 0);
    }
    if (count > 0) {
        gl_shadow_vectors(b, "center", count, center);
        gl_shadow_vectors(b, "shape", count, shape);
    }
}

static void gl_shadow_send_lights(const gl_shadow *b)
{
    scatter_vec3 place[GL_SHADOW_LIGHTS], color[GL_SHADOW_LIGHTS], more[GL_SHADOW_LIGHTS];
    int count = (int)b->medium.scene->light_count;
    for (int i = 0; i < count; i++) {
        const scatter_light *l = &b->medium.scene->lights[i];
        int sun = l->kind == SCATTER_LIGHT_DIRECTIONAL;
        place[i] = sun ? scatteri_scale(scatteri_normalize(l->direction), -1) : l->position;
        color[i] = l->intensity;
        more[i] = scatter_v3(l->radius * l->radius, sun ? 1.0f : 0.0f, 0);
    }
    gl_shadow_vectors(b, "place", count, place);
    gl_shadow_vectors(b, "color", count, color);
    gl_shadow_vectors(b, "more", count, more);
}

static void gl_shadow_send_medium(const gl_shadow *b)
{
    const scatter_medium *m = &b->medium.scene->medium;
    const scatteri_lobes w = b->medium.lobes;
    const scatter_vec3 lobes[2] = {{w.g1, w.alpha1, w.g2}, {w.alpha2, w.weight, 0}};
    const scatter_vec3 scattering = scatteri_mul(m->extinction, m->albedo);
    gl_shadow_vectors(b, "low", 1, &b->medium.reach.min);
    gl_shadow_vectors(b, "high", 1, &b->medium.reach.max);
    gl_shadow_vectors(b, "extinction", 1, &m->extinction);
    gl_shadow_vectors(b, "scattering", 1, &scattering);
    gl_shadow_vectors(b, "background", 1, &b->medium.scene->background);
    gl_shadow_vectors(b, "lobes", 2, lobes);
    b->host.gl.Uniform1i(host_gl_at(&b->host, b->program, "voxels"), GL_SHADOW_UNIT);
    b->host.gl.Uniform1f(host_gl_at(&b->host, b->program, "scale"), b->medium.scale);
}

/* The voxels of the grid as a texture, read between their centres. */
static void gl_shadow_upload(gl_shadow *b)
{
    enum { TEXTURE_3D = 0x806F, R32F = 0x822E, RED = 0x1903, LINEAR = 0x2601, WRAP_R = 0x8072 };
    static const int what[5] = {HOST_GL_MIN_FILTER, HOST_GL_MAG_FILTER, HOST_GL_WRAP_S,
                                HOST_GL_WRAP_T, WRAP_R};
    void (*image)(unsigned, int, int, int, int, int, int, unsigned, unsigned, const void *) =
        (void (*)(unsigned, int, int, int, int, int, int, unsigned, unsigned, const void *))the_gl()
            ->context.get_proc_address("glTexImage3D");
    b->host.gl.ActiveTexture(HOST_GL_TEXTURE0 + GL_SHADOW_UNIT);
    b->host.gl.GenTextures(1, &b->voxels);
    b->host.gl.BindTexture(TEXTURE_3D, b->voxels);
    for (int i = 0; i < 5; i++)
        b->host.gl.TexParameteri(TEXTURE_3D, (unsigned)what[i],
                                 i < 2 ? LINEAR : HOST_GL_CLAMP_TO_EDGE);
    image(TEXTURE_3D, 0, R32F, b->medium.n[0], b->medium.n[1], b->medium.n[2], 0, RED,
          HOST_GL_FLOAT, b->medium.values);
}

static void gl_shadow_open(gl_shadow *b, gl_scene *s, int size)
{
    memset(b, 0, sizeof *b);
    b->scene = s;
    b->medium = shadow_scene_of(&s->file.scene);
    b->rgb = floats((size_t)(3 * size * size));
    gl_must(host_gl_open(&b->host, the_gl()->context.get_proc_address, &s->file, size, size, NULL),
            s->path, b->host.error);
    gl_shadow_compile(b);
    gl_shadow_send_gaussians(b);
    gl_shadow_send_lights(b);
    gl_shadow_send_medium(b);
    if (b->medium.values)
        gl_shadow_upload(b);
}

static void gl_shadow_close(gl_shadow *b)
{
    b->host.gl.DeleteProgram(b->program);
    b->host.gl.DeleteTextures(1, &b->voxels);
    host_gl_close(&b->host);
    free(b->rgb);
}

/* ------------------------------------------------------------------------------- one rendering */

/* The rays of a view in the lower left size^2 pixels; returns ms. */
static double gl_shadow_draw(gl_shadow *b, const gl_shadow_way *w, const scatter_view *view,
                             int size)
{
    const host_gl_functions *gl = &b->host.gl;
    host_gl_rays rays = host_gl_camera_rays(view);
    gl->UseProgram(b->program);
    gl_shadow_vectors(b, "ray", 6, rays.v);
    gl->Uniform2f(host_gl_at(&b->host, b->program, "pixels"), (float)size, (float)size);
    gl->Uniform1i(host_gl_at(&b->host, b->program, "steps"), w->steps);
    gl->Uniform1i(host_gl_at(&b->host, b->program, "shadow_steps"), w->shadow_steps);
    if (b->voxels) {
        gl->ActiveTexture(HOST_GL_TEXTURE0 + GL_SHADOW_UNIT);
        gl->BindTexture(0x806F, b->voxels);
    }
    return gl_program_ms(&b->host, b->program, size);
}

/* The lattice, with its error. Returns ms spent. */
static double gl_shadow_try(gl_shadow *b, gl_shadow_way *w, const gl_truth *t)
{
    file_picture picture;
    double ms = gl_shadow_draw(b, w, &t->view, t->lattice);
    memset(&picture, 0, sizeof picture);
    picture.width = picture.height = t->lattice;
    picture.rgb = t->few;
    gl_must(host_gl_read(&b->host, &picture), b->scene->path, b->host.error);
    w->rmse = relative_rmse(t->few, t->reference, gl_truth_values(t));
    w->ms.n = 0;
    timing_add(&w->ms, ms * t->size * t->size / (t->lattice * t->lattice));
    return ms;
}

/* ------------------------------------------------------------------------------------- search */

#define GL_SHADOW_ERROR 0.005
#define GL_SHADOW_BUDGET 12e3 /* ms of drawing for the search in one scene */

enum { GL_SHADOW_SCENES = 6, GL_SHADOW_COARSE = 9, GL_SHADOW_OURS = 12, GL_SHADOW_ROUNDS = 5 };

static const char *const gl_shadow_paths[GL_SHADOW_SCENES] = {
    "bench/eight.scatter",     "bench/eight_four.scatter",           "bench/eight_core.scatter",
    "bench/eight_two.scatter", "examples/scenes/dense_core.scatter", "bench/cloud.scatter"};

static int gl_shadow_better(const gl_shadow_way *a, const gl_shadow_way *b)
{
    int reaches = a->rmse <= GL_SHADOW_ERROR, reached = b->rmse <= GL_SHADOW_ERROR;
    if (!b->steps || reaches != reached)
        return !b->steps || reaches;
    return reaches ? timing_min(&a->ms) < timing_min(&b->ms) : a->rmse < b->rmse;
}

/* More and more steps on the eye ray for these on the shadow rays. Returns ms spent. */
static double gl_shadow_raise(gl_shadow *b, const gl_truth *t, int shadow_steps, double budget,
                              gl_shadow_way *best, FILE *points)
{
    double spent = 0, last = 0, before = INFINITY;
    for (int steps = 8; steps <= 4096 && spent + 1.5 * last < budget; steps += steps / 2) {
        gl_shadow_way w = {steps, shadow_steps, 0, {{0}, 0}};
        char way[32];
        spent += last = gl_shadow_try(b, &w, t);
        snprintf(way, sizeof way, "%d, %d", steps, shadow_steps);
        chart_point(points, b->scene->name, "shadow rays", way, timing_min(&w.ms), w.rmse);
        if (gl_shadow_better(&w, best))
            *best = w;
        if (w.rmse <= GL_SHADOW_ERROR || (steps >= 64 && fabs(w.rmse - before) < 0.02 * before))
            break;
        before = w.rmse;
    }
    return spent;
}

/* The fastest setting of the baseline that keeps the error, else the most accurate one. */
static gl_shadow_way gl_shadow_search(gl_shadow *b, const gl_truth *t)
{
    static const int coarse[GL_SHADOW_COARSE] = {4, 6, 8, 12, 16, 24, 32, 64, 128};
    gl_shadow_way best = {0, 0, 0, {{0}, 0}}, first = {8, 4, 0, {{0}, 0}};
    FILE *points = chart_open(b->scene->name, "shadow");
    double spent = 0, budget = by_level(1, 4, 12) * GL_SHADOW_BUDGET / 12;
    gl_shadow_try(b, &first, t); /* compiles */
    for (int i = 0; i < GL_SHADOW_COARSE && spent < budget; i++) {
        double was = timing_min(&best.ms);
        int reached = best.steps && best.rmse <= GL_SHADOW_ERROR;
        spent += gl_shadow_raise(b, t, coarse[i], budget - spent, &best, points);
        if (reached && timing_min(&best.ms) >= was)
            break;
    }
    chart_close(points);
    return best;
}

/* ---------------------------------------------------------------------------------------- ours */

/* Settings of ours from the fastest on: closed form, and columns where there are voxels. */
static int gl_shadow_settings(const gl_scene *s, setting *all)
{
    static const int nodes[] = {5, 6, 7, 8, 9, 10, 11, 12, 14, 16, 20, 24};
    static const int grids[][2] = {{64, 8},   {128, 8},  {64, 16},  {128, 16}, {192, 16},
                                   {128, 32}, {192, 32}, {256, 32}, {192, 64}};
    int voxels = s->file.scene.medium.grid_count > 0, count = voxels ? 9 : 12;
    for (int i = 0; i < count; i++)
        all[i] = voxels ? setting_of(SCATTER_DEPTH_POLAR, SCATTER_RAY_QUADRATURE, grids[i][1],
                                     grids[i][0])
                        : setting_of(SCATTER_DEPTH_CLOSED, SCATTER_RAY_QUADRATURE, nodes[i], 0);
    return count;
}

/* The first setting that keeps the error, else the most accurate one. */
static setting gl_shadow_ours(gl_scene *s, const gl_truth *t)
{
    setting all[GL_SHADOW_OURS], best = {0};
    int count = gl_shadow_settings(s, all);
    for (int i = 0; i < count; i++) {
        gl_measure(s, &all[i], 1);
        gl_compare(s, t, &all[i]);
        if (i == 0 || all[i].rmse < best.rmse)
            best = all[i];
        if (all[i].rmse <= GL_SHADOW_ERROR)
            break;
    }
    return best;
}

/* -------------------------------------------------------------------------------------- report */

/* Both in turn, at full size. */
static void gl_shadow_measure(gl_shadow *b, setting *ours, gl_shadow_way *w)
{
    int size = b->host.fog_view.width;
    scatter_view view = scene_view(&b->scene->file, size, size);
    double sampled = timing_min(&w->ms);
    int rounds = sampled > 1e3 ? 1 : gl_rounds(GL_SHADOW_ROUNDS);
    ours->rays.n = ours->setup.n = 0;
    timing_add(&ours->setup, gl_update_ms(b->scene, &ours->quality, NULL));
    w->ms.n = 0;
    for (int i = 0; i < rounds; i++) {
        timing_add(&ours->rays, gl_draw_ms(b->scene));
        timing_add(&w->ms, sampled > 30e3 ? sampled : gl_shadow_draw(b, w, &view, size));
    }
}

static void gl_shadow_row(report *r, const gl_shadow *b, const setting *ours,
                          const gl_shadow_way *w)
{
    char target[160];
    double ratio = timing_median(&w->ms) / timing_median(&ours->rays);
    int reached = w->rmse <= GL_SHADOW_ERROR;
    report_cell(r, "%s", b->scene->name);
    report_cell(r, "%d", ours->quality.nodes);
    report_cell(r, "%.3g", 100 * ours->rmse);
    report_cell(r, "%.2f", timing_median(&ours->setup));
    report_cell(r, "%.2f%s", timing_median(&ours->rays), timing_flag(&ours->rays));
    report_cell(r, "%d x %d", w->steps, w->shadow_steps);
    report_cell(r, "%.3g", 100 * w->rmse);
    report_cell(r, "%.1f%s", timing_median(&w->ms), timing_flag(&w->ms));
    report_cell(r, "%d", ours->rays.n);
    report_cell(r, "%s%.1f", reached ? "" : "> ", ratio);
    report_row(r, 1);
    snprintf(target, sizeof target, "%s: view pass at 0.5 %% >= 20 times as fast as shadow rays",
             b->scene->name);
    report_target(r, ours->rmse <= GL_SHADOW_ERROR && ratio >= 20, target,
                  "%s%.1f times (%.3g %% in %.2f ms, %.3g %% in %.1f ms)",
                  reached ? "" : "more than ", ratio, 100 * ours->rmse, timing_median(&ours->rays),
                  100 * w->rmse, timing_median(&w->ms));
}

static void gl_shadow_scene(report *r, const char *path)
{
    gl_scene s;
    gl_truth t;
    gl_shadow b;
    gl_scene_open(&s, path, gl_size(), gl_size());
    gl_truth_open(&t, &s, gl_size(), gl_lattice());
    gl_shadow_open(&b, &s, gl_size());
    gl_shadow_way w = gl_shadow_search(&b, &t);
    setting ours = gl_shadow_ours(&s, &t);
    gl_shadow_measure(&b, &ours, &w);
    gl_shadow_row(r, &b, &ours, &w);
    gl_shadow_close(&b);
    gl_truth_close(&t);
    gl_scene_close(&s);
}

static void gl_shadow_run(report *r)
{
    report_text(r, "## Beside shadow rays");
    report_text(r,
                "The view pass against a fragment shader that marches the eye ray in uniform steps "
                "and from each step a shadow ray to each light, both in the fastest setting found "
                "that errs by at most 0.5 %%, %dx%d pixels, the draw alone (`update` beside it). "
                "The baseline is searched over both numbers of steps; `>`: it does not reach the "
                "error in the time of the search, and its most accurate setting is compared.",
                gl_size(), gl_size());
    report_table(r, "gl_shadow",
                 "scene|nodes|RMSE %|update ms|view ms|shadow rays|RMSE %|ms|n|times as fast");
    for (int i = 0; i < by_level(1, 3, GL_SHADOW_SCENES); i++)
        if (scene_has_data(gl_shadow_paths[i]))
            gl_shadow_scene(r, gl_shadow_paths[i]);
        else
            report_text(r, "%s: skipped: no data", gl_shadow_paths[i]);
    report_end(r);
}

#endif
