/* render.c - scatter-render: renders a scene file, measures the time and the error. MIT licence,
   see LICENSE.

   Sections: options, measuring, GPU, output, main. */
#define _POSIX_C_SOURCE 200809L
#define SCATTER_IMPLEMENTATION
#define PROGRAM_NAME "scatter-render"
#include "program.h"
#include "render_gl.h"
#include "scene.h"

static const char usage[] =
    "usage: scatter-render SCENE [options]\n"
    "  --out FILE        .pfm and .hdr: linear RGB, .png: tone-mapped sRGB\n"
    "  --tonemap         .pfm and .hdr, too: Reinhard's photographic operator, still linear RGB\n"
    "  --size WxH        pixels instead of the scene's; the field of view stays\n"
    "  --rotate-env DEG  turns the lights of environments about +y: +z goes to +x (0)\n"
    "  --depth METHOD    auto closed closed-volume eq6 upwind short polar march\n"
    "  --ray METHOD      quadrature march\n"
    "  --density METHOD  auto exact volume\n"
    "  --nodes N         per panel of the quadrature, or steps of the march (16)\n"
    "  --grid N          cells along each axis of depth and density volumes (0: as the scene needs)\n"
    "  --no-distance-map march through empty voxels as well: same picture, more time\n"
    "  --no-mask         no search for what rays need not look at: same picture, more time\n"
    "  --budget E        1% or 0.01: chooses those five so that the relative RMSE stays below\n"
    "  --threads N       default: one for each processor\n"
    "  --repeat N        measure N times and report medians (1)\n"
    "  --reference FILE  .pfm to compare with\n"
    "  --json            report one line of JSON\n"
    "  --gl              through scatter_gl.h, on the GPU that the driver finds\n"
    "  --api NAME        with --gl: gl33 gl45 es30 osmesa (gl33)\n"
    "  --divide N        with --gl: fog at full, half or quarter resolution: 1 2 4 (1)\n"
    "  --shadow-map N    with --gl: texels to a side, of cubes half of it (2048, or less)\n";

/* ----------------------------------------------------------------------------------- >>options */

typedef struct options {
    const char *scene, *out, *reference;
    int width, height; /* 0: the scene's */
    int threads, repeat, json, tonemap;
    float degrees; /* that the skies turn */
    scatter_quality quality;
    float budget;              /* relative RMSE; 0: none, the quality is as asked for */
    scatter_forecast forecast; /* for the budget */
    int gl;
    render_gl_options on_gl;
} options;

/* A share, or percent with a % behind the number. */
static int budget_option(options *o, const char *text) {
    char *end;
    double value = strtod(text, &end);
    if (end != text && *end == '%') {
        value *= 0.01;
        end++;
    }
    o->budget = (float)value;
    if (end == text || *end || !(o->budget >= 1e-5f && o->budget <= 1.0f))
        return complain(2, "--budget: expected 0.001%% to 100%%, found '%s'", text);
    return 0;
}

static int method_option(options *o, const char *name, const char *text) {
    if (strcmp(name, "--depth") == 0 && scene_depth_method(text, &o->quality.depth))
        return complain(
            2,
            "--depth: expected auto, closed, closed-volume, eq6, upwind, short, polar or march, "
            "found '%s'",
            text);
    if (strcmp(name, "--ray") == 0 && scene_ray_method(text, &o->quality.ray))
        return complain(2, "--ray: expected quadrature or march, found '%s'", text);
    if (strcmp(name, "--density") == 0 && scene_density_method(text, &o->quality.density))
        return complain(2, "--density: expected auto, exact or volume, found '%s'", text);
    return 0;
}

static int api_option(options *o, const char *text) {
    static const char *const names[] = {"gl33", "gl45", "es30", "osmesa"};
    o->on_gl.api = text;
    if (scene_name(names, sizeof names / sizeof *names, text) < 0)
        return complain(2, "--api: expected gl33, gl45, es30 or osmesa, found '%s'", text);
    return 0;
}

static int divide_option(options *o, const char *text) {
    if (number_option("--divide", text, 1, 4, &o->on_gl.divide))
        return 1;
    return o->on_gl.divide == 3 ? complain(2, "--divide: expected 1, 2 or 4, found 3") : 0;
}

static int file_option(const char *name, const char *text, const char *endings, const char **file) {
    const char *dot = strrchr(text, '.');
    *file = text;
    if (!dot || !strstr(endings, dot) || strlen(dot) != 4)
        return complain(2, "%s: expected a file name ending in%s, found '%s'", name, endings, text);
    return 0;
}

static int option_with_value(options *o, const char *name, const char *value) {
    if (strcmp(name, "--out") == 0)
        return file_option(name, value, " .pfm .png .hdr", &o->out);
    if (strcmp(name, "--reference") == 0)
        return file_option(name, value, " .pfm", &o->reference);
    if (strcmp(name, "--size") == 0)
        return size_option(value, &o->width, &o->height);
    if (strcmp(name, "--rotate-env") == 0)
        return degrees_option(name, value, &o->degrees);
    if (strcmp(name, "--nodes") == 0)
        return number_option(name, value, 1, 4096, &o->quality.nodes);
    if (strcmp(name, "--grid") == 0)
        return number_option(name, value, 0, 1024, &o->quality.grid);
    if (strcmp(name, "--budget") == 0)
        return budget_option(o, value);
    if (strcmp(name, "--threads") == 0)
        return number_option(name, value, 1, 1024, &o->threads);
    if (strcmp(name, "--repeat") == 0)
        return number_option(name, value, 1, 10000, &o->repeat);
    if (strcmp(name, "--api") == 0)
        return api_option(o, value);
    if (strcmp(name, "--divide") == 0)
        return divide_option(o, value);
    if (strcmp(name, "--shadow-map") == 0)
        return number_option(name, value, 16, 16384, &o->on_gl.shadow_map);
    return method_option(o, name, value);
}

/* Whether an option exists and takes a value. */
static int takes_value(const char *name) {
    static const char *const names[] = {"--out",    "--size",      "--depth",  "--ray",
                                        "--density", "--nodes",     "--grid",   "--threads",
                                        "--repeat",  "--reference", "--budget", "--api",
                                        "--divide",  "--shadow-map", "--rotate-env"};
    return scene_name(names, sizeof names / sizeof *names, name) >= 0;
}

/* What an option without a value sets to 1; NULL: it is not one. */
static int *flag_option(options *o, const char *name) {
    static const char *const names[] = {"--json", "--gl", "--tonemap", "--no-distance-map",
                                        "--no-mask"};
    int *const flags[] = {&o->json, &o->gl, &o->tonemap, &o->quality.no_distance_map,
                          &o->quality.no_mask};
    int i = scene_name(names, sizeof names / sizeof *names, name);
    return i < 0 ? NULL : flags[i];
}

static int parse_options(int count, char **arguments, options *o) {
    for (int i = 1; i < count; i++) {
        const char *name = arguments[i];
        int *flag = flag_option(o, name);
        if (flag)
            *flag = 1;
        else if (takes_value(name)) {
            if (i + 1 == count)
                return complain(2, "%s: expected a value behind it", name);
            if (option_with_value(o, name, arguments[++i]))
                return 2;
        } else if (name[0] == '-')
            return complain(2, "unknown option '%s'; --help lists the options", name);
        else if (o->scene)
            return complain(2, "expected one scene, found '%s' and '%s'", o->scene, name);
        else
            o->scene = name;
    }
    if (o->budget > 0 && (o->quality.depth || o->quality.ray || o->quality.density ||
                          o->quality.nodes || o->quality.grid))
        return complain(2, "--budget: chooses depth, ray, density, nodes and grid itself");
    if (!o->gl && (o->on_gl.api || o->on_gl.divide || o->on_gl.shadow_map))
        return complain(2, "--api, --divide and --shadow-map: expected --gl as well");
    if (!o->scene)
        return complain(2, "expected a scene file; --help lists the options");
    if (o->quality.ray == SCATTER_RAY_QUADRATURE && o->quality.nodes > 256)
        return complain(2, "--nodes: expected at most 256 for the quadrature, found %d",
                        o->quality.nodes);
    return 0;
}

/* --------------------------------------------------------------------------------- >>measuring */

typedef struct timing {
    double setup, rays, total; /* ms */
} timing;

static int compare_doubles(const void *a, const void *b) {
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* Median of the member at `offset` of all timings. */
static double median(const timing *timings, int count, size_t offset, double *scratch) {
    for (int i = 0; i < count; i++)
        memcpy(&scratch[i], (const char *)&timings[i] + offset, sizeof(double));
    qsort(scratch, (size_t)count, sizeof *scratch, compare_doubles);
    return (scratch[(count - 1) / 2] + scratch[count / 2]) / 2;
}

/* One image with a fresh context. */
static scatter_result render_once(const options *o, const scene_file *file, host_state *state,
                                  const file_picture *picture, timing *t) {
    scatter_host host = make_host(state);
    scatter_view view = scene_view(file, picture->width, picture->height);
    scatter_context *context = NULL;
    scatter_image image;
    memset(&image, 0, sizeof image);
    image.width = picture->width;
    image.height = picture->height;
    image.rgb = picture->rgb;
    state->start = now_ms();
    scatter_result result = scatter_create(&host, &context);
    if (result == SCATTER_OK)
        result = scatter_update(context, &file->scene, &o->quality);
    double ready = now_ms();
    if (result == SCATTER_OK)
        result = scatter_render(context, &view, &image);
    double end = now_ms();
    scatter_destroy(context);
    t->setup = ready - state->start;
    t->rays = end - ready;
    t->total = end - state->start;
    return result;
}

/* Lets the library choose the quality, if there is a budget. */
static int plan(options *o, const scene_file *file, host_state *state,
                const file_picture *picture) {
    scatter_host host = make_host(state);
    scatter_view view = scene_view(file, picture->width, picture->height);
    scatter_image image;
    if (!(o->budget > 0))
        return 0;
    memset(&image, 0, sizeof image);
    image.width = picture->width;
    image.height = picture->height;
    image.rgb = picture->rgb;
    state->start = now_ms();
    if (scatter_plan(&host, &file->scene, &view, &image, o->budget, &o->forecast) != SCATTER_OK)
        return complain(1, "%s: %s", o->scene, state->sentence);
    o->forecast.quality.no_distance_map = o->quality.no_distance_map;
    o->forecast.quality.no_mask = o->quality.no_mask;
    o->quality = o->forecast.quality;
    return 0;
}

/* What a renderer on the GPU tells about itself. */
typedef struct gpu_report {
    char renderer[128], driver[128]; /* as OpenGL names them */
    double first;                    /* ms from nothing to the first picture, with compiling */
    scatter_gl_times passes;
    size_t texture_bytes;
} gpu_report;

/* One update with everything to do, and one picture of the fog. The surfaces are not counted. */
static scatter_result render_once_on_gpu(render_gl *gl, timing *t) {
    int failed = render_gl_forget(gl);
    double start = now_ms();
    failed = failed || render_gl_update(gl);
    double ready = now_ms();
    failed = failed || render_gl_scene(gl);
    double lit = now_ms();
    failed = failed || render_gl_fog(gl);
    t->setup = ready - start;
    t->rays = now_ms() - lit;
    t->total = t->setup + t->rays;
    return failed ? SCATTER_UNSUPPORTED : SCATTER_OK;
}

/* All repeats, on the GPU if there is one; leaves the medians in *t. */
static int render(const options *o, const scene_file *file, host_state *state,
                  const file_picture *picture, render_gl *gl, timing *t) {
    size_t count = (size_t)o->repeat;
    timing *timings = (timing *)malloc(count * sizeof *timings);
    double *scratch = (double *)malloc(count * sizeof *scratch);
    scatter_result result = timings && scratch ? SCATTER_OK : SCATTER_OUT_OF_MEMORY;
    for (int i = 0; i < o->repeat && result == SCATTER_OK; i++)
        result = gl ? render_once_on_gpu(gl, &timings[i])
                    : render_once(o, file, state, picture, &timings[i]);
    if (result == SCATTER_OK) {
        t->setup = median(timings, o->repeat, offsetof(timing, setup), scratch);
        t->rays = median(timings, o->repeat, offsetof(timing, rays), scratch);
        t->total = median(timings, o->repeat, offsetof(timing, total), scratch);
    }
    free(timings);
    free(scratch);
    if (state->shown)
        fputs("\r\033[K", stderr);
    if (result != SCATTER_OK)
        return complain(1, "%s: %s", o->scene,
                        state->sentence[0] ? state->sentence : "out of memory");
    return 0;
}

/* Opens the GPU and shows it the picture once. */
static int start_gpu(const options *o, const scene_file *file, host_state *state,
                     const file_picture *picture, render_gl *gl, gpu_report *gpu) {
    scatter_host host = make_host(state);
    int failed = render_gl_open(gl, file, picture->width, picture->height, &o->quality, &o->on_gl);
    double start = state->start = now_ms();
    failed = failed || render_gl_create(gl, &host) || render_gl_update(gl) ||
             render_gl_scene(gl) || render_gl_fog(gl);
    gpu->first = now_ms() - start;
    if (failed)
        return complain(1, "%s: %s", o->scene,
                        render_gl_why(gl)[0] ? render_gl_why(gl) : state->sentence);
    snprintf(gpu->renderer, sizeof gpu->renderer, "%s",
             host_gl_string(&gl->scene, HOST_GL_RENDERER));
    snprintf(gpu->driver, sizeof gpu->driver, "%s", host_gl_string(&gl->scene, HOST_GL_VERSION));
    return 0;
}

static int render_on_gpu(const options *o, const scene_file *file, host_state *state,
                         const file_picture *picture, gpu_report *gpu, timing *t) {
    render_gl gl;
    int status = start_gpu(o, file, state, picture, &gl, gpu);
    if (!status)
        status = render(o, file, state, picture, &gl, t);
    if (!status) {
        gpu->passes = gl.passes;
        gpu->texture_bytes = scatter_gl_get_stats(gl.fog).texture_bytes;
        if (host_gl_read(&gl.scene, picture))
            status = complain(1, "%s: %s", o->scene, render_gl_why(&gl));
    }
    render_gl_close(&gl);
    return status;
}

typedef struct difference {
    int known;
    double rel_rmse; /* root of the mean square difference, over the mean of the reference */
    double max_abs;
} difference;

static difference compare_pictures(const file_picture *picture, const file_picture *reference) {
    size_t count = (size_t)picture->width * (size_t)picture->height * 3;
    double squares = 0, sum = 0;
    difference d = {1, 0, 0};
    for (size_t i = 0; i < count; i++) {
        double delta = (double)picture->rgb[i] - (double)reference->rgb[i];
        squares += delta * delta;
        sum += (double)reference->rgb[i];
        d.max_abs = fmax(d.max_abs, fabs(delta));
    }
    double rmse = sqrt(squares / (double)count);
    d.rel_rmse = rmse <= 0 ? 0 : rmse / (sum / (double)count);
    return d;
}

/* A picture that is wrong is not shown in silence. */
static int check_picture(const options *o, const file_picture *picture) {
    size_t pixels = (size_t)picture->width * (size_t)picture->height, wrong = 0;
    for (size_t i = 0; i < pixels; i++)
        if (!isfinite(picture->rgb[3 * i] + picture->rgb[3 * i + 1] + picture->rgb[3 * i + 2]))
            wrong++;
    if (wrong)
        return complain(1, "%s: %.0f pixels are not finite, which is a fault of %s",
                        o->scene, (double)wrong, o->gl ? "scatter_gl.h" : "scatter.h");
    return 0;
}

static int compare_with_reference(const options *o, const file_picture *picture, difference *d) {
    file_picture reference;
    file_error error;
    if (!o->reference)
        return 0;
    if (file_pfm_read(o->reference, &reference, &error))
        return complain(1, "%s", error.text);
    int same = reference.width == picture->width && reference.height == picture->height;
    if (same)
        *d = compare_pictures(picture, &reference);
    int width = reference.width, height = reference.height;
    free(reference.rgb);
    if (!same)
        return complain(1, "%s: expected %dx%d pixels, found %dx%d", o->reference, picture->width,
                        picture->height, width, height);
    return 0;
}

/* ------------------------------------------------------------------------------------ >>output */

/* By the ending of the name. */
static int write_linear(const char *path, const file_picture *picture) {
    file_error error;
    int failed;
    if (file_ends_with(path, ".pfm"))
        failed = file_pfm_write(path, picture, &error);
    else if (file_ends_with(path, ".hdr"))
        failed = file_hdr_write(path, picture, &error);
    else
        failed = write_png(path, picture, &error);
    return failed ? complain(1, "%s", error.text) : 0;
}

/* What is shown on a screen is tone-mapped. */
static int write_picture(const options *o, const file_picture *picture) {
    file_picture toned;
    if (!o->out)
        return 0;
    if (!o->tonemap && !file_ends_with(o->out, ".png"))
        return write_linear(o->out, picture);
    if (new_picture(&toned, picture->width, picture->height))
        return complain(1, "%s: out of memory", o->out);
    scatter_tone tone = choose_tone(picture);
    scatter_tone_map(&tone, picture->rgb, (size_t)picture->width * (size_t)picture->height,
                     toned.rgb);
    int status = write_linear(o->out, &toned);
    free(toned.rgb);
    return status;
}

/* A JSON string with its quotes. */
static void print_string(const char *text) {
    putchar('"');
    for (; *text; text++) {
        unsigned char c = (unsigned char)*text;
        if (c == '"' || c == '\\')
            printf("\\%c", c);
        else if (c < 32)
            printf("\\u%04x", c);
        else
            putchar(c);
    }
    putchar('"');
}

/* A JSON number; what JSON cannot say is null. */
static void print_number(const char *name, double value, int known) {
    if (known && isfinite(value))
        printf(", \"%s\": %.6g", name, value);
    else
        printf(", \"%s\": null", name);
}

/* What --gl adds: ms_rays of the GPU is the time of the draw, gpu_* what its own timers say. */
static void print_gpu(const options *o, const gpu_report *gpu) {
    const scatter_gl_times *p = &gpu->passes;
    printf(", \"api\": \"%s\", \"renderer\": ", o->on_gl.api ? o->on_gl.api : "gl33");
    print_string(gpu->renderer);
    printf(", \"driver\": ");
    print_string(gpu->driver);
    printf(", \"divide\": %d", o->on_gl.divide ? o->on_gl.divide : 1);
    print_number("ms_first", gpu->first, 1);
    print_number("gpu_inject", (double)p->inject, p->inject >= 0);
    print_number("gpu_depth", (double)p->depth, p->depth >= 0);
    print_number("gpu_view", (double)p->view, p->view >= 0);
    print_number("gpu_upsample", (double)p->upsample, p->upsample >= 0);
    printf(", \"texture_bytes\": %.0f", (double)gpu->texture_bytes);
}

static void print_json(const options *o, const file_picture *picture, const timing *t,
                       const difference *d, const gpu_report *gpu, const host_state *state) {
    const scatter_quality *q = &o->quality;
    printf("{\"scene\": ");
    print_string(o->scene);
    printf(", \"depth\": \"%s\", \"ray\": \"%s\", \"density\": \"%s\"", scene_depth_name(q->depth),
           scene_ray_name(q->ray), scene_density_name(q->density));
    printf(", \"nodes\": %d, \"grid\": %d, \"threads\": %d", q->nodes ? q->nodes : 16, q->grid,
           o->threads);
    printf(", \"width\": %d, \"height\": %d", picture->width, picture->height);
    print_number("ms_setup", t->setup, 1);
    print_number("ms_rays", t->rays, 1);
    print_number("ms", t->total, 1);
    printf(", \"repeats\": %d", o->repeat);
    print_number("budget", (double)o->budget, o->budget > 0);
    print_number("predicted", (double)o->forecast.estimate.error, o->budget > 0);
    print_number("rel_rmse", d->rel_rmse, d->known);
    print_number("max_abs", d->max_abs, d->known);
    printf(", \"bytes\": %.0f", (double)state->peak);
    if (o->gl)
        print_gpu(o, gpu);
    puts("}");
}

static void print_report(const options *o, const file_picture *picture, const timing *t,
                         const difference *d) {
    const scatter_forecast *f = &o->forecast;
    if (o->budget > 0)
        printf("%s: %s, %s, %d nodes, grid %d: %.2g %% predicted%s%s\n", o->scene,
               scene_depth_name(f->quality.depth), scene_ray_name(f->quality.ray), f->quality.nodes,
               f->quality.grid, 100 * (double)f->estimate.error,
               f->kept ? "" : ", beyond the budget", f->estimate.trusted ? "" : ", not trusted");
    printf("%s: %dx%d, setup %.1f ms, rays %.1f ms", o->scene, picture->width, picture->height,
           t->setup, t->rays);
    if (d->known)
        printf(", relative RMSE %.4g, largest difference %.4g", d->rel_rmse, d->max_abs);
    printf("%s%s\n", o->out ? ", written to " : "", o->out ? o->out : "");
}

/* -------------------------------------------------------------------------------------- >>main */

/* Renders, compares, writes and reports; the exit status. */
static int run(options *o, const scene_file *file, const file_picture *picture) {
    host_state state;
    timing t = {0, 0, 0};
    difference d = {0, 0, 0};
    gpu_report gpu;
    memset(&gpu, 0, sizeof gpu);
    memset(&state, 0, sizeof state);
    state.threads = o->threads;
    state.scene = o->scene;
    pthread_mutex_init(&state.lock, NULL);
    int status = plan(o, file, &state, picture);
    if (!status)
        status = o->gl ? render_on_gpu(o, file, &state, picture, &gpu, &t)
                       : render(o, file, &state, picture, NULL, &t);
    if (!status)
        status = check_picture(o, picture);
    if (!status)
        status = compare_with_reference(o, picture, &d);
    if (!status)
        status = write_picture(o, picture);
    if (!status && o->json)
        print_json(o, picture, &t, &d, &gpu, &state);
    else if (!status)
        print_report(o, picture, &t, &d);
    pthread_mutex_destroy(&state.lock);
    return status;
}

static int run_scene(options *o, const scene_file *file) {
    file_picture picture;
    int status = new_picture(&picture, o->width ? o->width : file->width,
                             o->height ? o->height : file->height)
                     ? complain(1, "%s: out of memory", o->scene)
                     : run(o, file, &picture);
    free(picture.rgb);
    return status;
}

int main(int count, char **arguments) {
    options o;
    scene_file file;
    memset(&o, 0, sizeof o);
    o.repeat = 1;
    o.threads = all_processors();
    if (count == 2 && strcmp(arguments[1], "--help") == 0)
        return fputs(usage, stdout) < 0;
    int status = parse_options(count, arguments, &o);
    if (status)
        return status;
    if (scene_read(&file, o.scene))
        return complain(1, "%s", file.error);
    scene_turn_skies(&file, o.degrees, file.lights);
    status = run_scene(&o, &file);
    scene_free(&file);
    return status;
}
