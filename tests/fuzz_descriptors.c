/* fuzz_descriptors.c - libFuzzer target: every struct of scatter.h is filled from the input, mostly
   with sensible values and now and then with NaN, infinity, denormals, absurd sizes or unknown enum
   values. Whatever the call, there must be no crash and no sanitizer finding; a failure is logged
   once, in one sentence; a success is not logged, and what it delivers is finite; nothing leaks.

   With FUZZ_PLANT the allocator hands out one float too little, which ASan must find. */
#define SCATTER_IMPLEMENTATION
#include "../scatter.h"

#include <float.h>
#include <limits.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define MEMORY_LIMIT ((size_t)64 << 20)
#define TAME 256u /* no byte is as large */
#define COUNT(array) (sizeof(array) / sizeof((array)[0]))

/* ------------------------------------------------------------------------------------ >>checks */

static void demand(int good, const char *what) {
    if (good)
        return;
    fprintf(stderr, "fuzz_descriptors: %s\n", what);
    abort();
}

static void demand_between(const float *values, size_t count, float low, float high,
                           const char *what) {
    size_t i;
    for (i = 0; i < count; i++) {
        if (!(values[i] >= low && values[i] <= high))
            fprintf(stderr, "fuzz_descriptors: value %d is %.9g\n", (int)i, (double)values[i]);
        demand(values[i] >= low && values[i] <= high, what);
    }
}

static void demand_finite(const float *values, size_t count, const char *what) {
    demand_between(values, count, -FLT_MAX, FLT_MAX, what);
}

static void demand_unit(const float *values, size_t count, const char *what) {
    demand_between(values, count, 0.0f, 1.0f, what);
}

/* ------------------------------------------------------------------------------------- >>input */

typedef struct input {
    const uint8_t *data;
    size_t size;
    unsigned odd_from; /* bytes from here to 255 ask for an odd value */
} input;

/* The next byte, 0 after the end: so the shortest inputs are the tamest. */
static unsigned next(input *in) {
    if (in->size == 0)
        return 0;
    in->size--;
    return *in->data++;
}

static float raw_float(input *in) {
    uint32_t bits = next(in);
    float value;
    bits = bits << 8 | next(in);
    bits = bits << 8 | next(in);
    bits = bits << 8 | next(in);
    memcpy(&value, &bits, sizeof value);
    return value;
}

/* A third of the scenes is tame throughout, a third has few odd values, a third many. */
static void choose_temper(input *in) {
    static const unsigned tempers[] = {TAME, 254, 240};
    in->odd_from = tempers[next(in) % COUNT(tempers)];
}

/* Mostly between low and high, where the temper allows something else. */
static float number(input *in, float low, float high) {
    static const float odd[] = {0.0f,  -0.0f,  1.0f,     -1.0f,   NAN,      INFINITY, -INFINITY,
                                1e-9f, 1e-45f, -1e-45f,  3.4e38f, -3.4e38f, 1e18f,    -1e18f,
                                1e6f,  1e-18f, 1.2e-38f, 1e9f,    -1e9f,    0.5f,     -1e-18f};
    unsigned kind = next(in);
    if (kind >= in->odd_from && kind & 1u)
        return raw_float(in);
    if (kind >= in->odd_from)
        return odd[next(in) % COUNT(odd)];
    return low + (high - low) * (float)next(in) / 255.0f;
}

static int whole(input *in, int low, int high) {
    static const int odd[] = {0,    1,    -1,   INT_MAX, INT_MIN, 256,    257,
                              1024, 1025, 4096, 46341,   65536,   1 << 30};
    unsigned kind = next(in);
    if (kind >= in->odd_from)
        return odd[next(in) % COUNT(odd)];
    return low + (int)(next(in) % (unsigned)(high - low + 1));
}

static scatter_vec3 vector(input *in, float low, float high) {
    scatter_vec3 v;
    v.x = number(in, low, high);
    v.y = number(in, low, high);
    v.z = number(in, low, high);
    return v;
}

static float *floats(input *in, size_t count) {
    float *values = (float *)malloc(sizeof(float) * count);
    size_t i;
    for (i = 0; values && i < count; i++)
        values[i] = number(in, 0.0f, 4.0f);
    return values;
}

static scatter_box box(input *in) {
    scatter_box b;
    b.min = vector(in, -1.0f, 0.0f);
    b.max = vector(in, 1.0f, 2.0f);
    return b;
}

/* How many of `room` array elements there are: sometimes more than any memory holds. */
static size_t amount(input *in, size_t room) {
    unsigned kind = next(in);
    if (kind == 255 && kind >= in->odd_from)
        return SIZE_MAX / (next(in) + 1u);
    return kind % (room + 1);
}

/* An array, or oddly NULL. */
static const void *array(input *in, const void *memory) {
    return next(in) >= in->odd_from ? NULL : memory;
}

/* -------------------------------------------------------------------------------------- >>host */

typedef struct books {
    size_t live, bytes;
    int sentences;
    scatter_result logged;
    unsigned patience; /* reports of progress until it cancels; 0: never */
} books;

typedef union block {
    size_t bytes;
    long double align;
    void *pointer;
} block;

static void *take(void *user, size_t bytes) {
    books *b = (books *)user;
    block *memory;
    if (bytes > MEMORY_LIMIT - b->bytes)
        return NULL;
#ifdef FUZZ_PLANT
    memory = (block *)malloc(sizeof(block) + bytes - sizeof(float));
#else
    memory = (block *)malloc(sizeof(block) + bytes);
#endif
    if (!memory)
        return NULL;
    memory->bytes = bytes;
    b->bytes += bytes;
    b->live++;
    memset(memory + 1, 0xff, bytes > 4 ? bytes - 4 : 0); /* NaN, for who reads what nobody wrote */
    return memory + 1;
}

static void give(void *user, void *memory) {
    books *b = (books *)user;
    block *start = (block *)memory - 1;
    if (!memory)
        return;
    b->bytes -= start->bytes;
    b->live--;
    free(start);
}

static void log_sentence(void *user, scatter_result result, const char *sentence) {
    books *b = (books *)user;
    b->sentences++;
    b->logged = result;
    demand(sentence && sentence[0] && !strchr(sentence, '\n'), "the log is not one sentence");
}

static int progress(void *user, float fraction) {
    books *b = (books *)user;
    demand(fraction >= 0.0f && fraction <= 1.0f, "progress outside 0..1");
    return b->patience && --b->patience == 0;
}

static int succeeded(books *b, scatter_result result) {
    demand(b->sentences == (result != SCATTER_OK), "a failure is logged once, a success never");
    demand(b->sentences == 0 || b->logged == result, "another result was logged");
    b->sentences = 0;
    return result == SCATTER_OK;
}

/* ------------------------------------------------------------------------------------- >>scene */

typedef struct world {
    scatter_scene scene;
    scatter_quality quality;
    scatter_light lights[4];
    scatter_gaussian gaussians[6];
    scatter_height heights[2];
    scatter_grid grids[2];
    float *voxels[2];
    scatter_surface surface;
    unsigned pattern;
} world;

/* Light and shadow in layers, as the bits of the pattern say. */
static int is_visible(void *user, scatter_vec3 p, scatter_vec3 q) {
    const world *w = (const world *)user;
    float layer = fabsf(p.x + p.y);
    demand_finite(&p.x, 3, "visible() was asked about a point that is not finite");
    demand_finite(&q.x, 3, "visible() was asked about a point that is not finite");
    return (int)(w->pattern >> (layer < 8.0f ? (unsigned)layer : 0u) & 1u);
}

static int find_surface(void *user, scatter_vec3 origin, scatter_vec3 direction,
                        scatter_surface *hit) {
    world *w = (world *)user;
    (void)origin;
    *hit = w->surface;
    return direction.x > 0.1f * (float)(w->pattern & 7u);
}

/* Voxels in a block of exactly their size, so that ASan sees a read beside it. Larger sizes become
   such that their product must be refused before any voxel is read. */
static float *fill_voxels(input *in, scatter_grid *g) {
    double product = (double)g->nx * g->ny * g->nz;
    int possible = g->nx > 0 && g->ny > 0 && g->nz > 0 && product <= 4096;
    float *voxels = floats(in, possible ? (size_t)product : 1);
    if (product > 4096)
        g->nx = g->ny = g->nz = INT_MAX;
    g->density = (const float *)array(in, voxels);
    return voxels;
}

static void fill_terms(input *in, world *w) {
    size_t i;
    for (i = 0; i < COUNT(w->gaussians); i++) {
        w->gaussians[i].center = vector(in, -1.0f, 1.0f);
        w->gaussians[i].a = number(in, 0.5f, 8.0f);
        w->gaussians[i].c = number(in, 0.0f, 4.0f);
    }
    for (i = 0; i < COUNT(w->heights); i++) {
        w->heights[i].density = number(in, 0.0f, 1.0f);
        w->heights[i].y0 = number(in, -1.0f, 1.0f);
        w->heights[i].scale = number(in, 0.1f, 4.0f);
    }
    for (i = 0; i < COUNT(w->grids); i++) {
        w->grids[i].nx = whole(in, 1, 5);
        w->grids[i].ny = whole(in, 1, 5);
        w->grids[i].nz = whole(in, 1, 5);
        w->grids[i].box = box(in);
        w->grids[i].scale = number(in, 0.0f, 2.0f);
        w->grids[i].version = next(in);
        w->voxels[i] = fill_voxels(in, &w->grids[i]);
    }
}

static scatter_phase phase(input *in) {
    scatter_phase p;
    p.kind = (scatter_phase_kind)whole(in, SCATTER_PHASE_ISOTROPIC, SCATTER_PHASE_DROPLETS);
    p.g = number(in, -0.95f, 0.95f);
    p.alpha = number(in, 0.0f, 2.0f);
    p.diameter_um = number(in, 0.05f, 40.0f);
    return p;
}

static void fill_medium(input *in, world *w) {
    scatter_medium *m = &w->scene.medium;
    m->gaussian_count = amount(in, COUNT(w->gaussians));
    m->height_count = amount(in, COUNT(w->heights));
    m->grid_count = amount(in, COUNT(w->grids));
    m->gaussians = (const scatter_gaussian *)array(in, w->gaussians);
    m->heights = (const scatter_height *)array(in, w->heights);
    m->grids = (const scatter_grid *)array(in, w->grids);
    m->extinction = vector(in, 0.5f, 2.0f); /* thin fog makes long rays, which are slow */
    m->albedo = vector(in, 0.0f, 1.0f);
    m->emission = vector(in, 0.0f, 1.0f);
    m->phase = phase(in);
    m->bounded = (int)(next(in) & 1u);
    m->bounds = box(in);
    m->constant = number(in, 0.0f, 1.0f);
}

static void fill_light(input *in, scatter_light *l) {
    l->kind = (scatter_light_kind)whole(in, SCATTER_LIGHT_POINT, SCATTER_LIGHT_DIRECTIONAL);
    l->position = vector(in, -2.0f, 2.0f);
    l->direction = vector(in, -1.0f, 1.0f);
    l->intensity = vector(in, 0.0f, 10.0f);
    l->radius = number(in, 0.0f, 0.1f);
    l->inner = number(in, 0.0f, 0.5f);
    l->outer = number(in, 0.5f, 3.0f);
}

static scatter_surface surface(input *in) {
    scatter_surface s;
    s.distance = number(in, 0.0f, 4.0f);
    s.normal = scatter_v3(0.0f, 0.0f, -1.0f);
    if (next(in) > 200)
        s.normal = vector(in, -1.0f, 1.0f);
    s.albedo = vector(in, 0.0f, 1.0f);
    s.specular = vector(in, 0.0f, 1.0f);
    s.shininess = number(in, 0.0f, 50.0f);
    return s;
}

/* What a callback returns goes into the picture as it is. */
static scatter_surface tame_surface(input *in) {
    const unsigned odd_from = in->odd_from;
    scatter_surface s;
    in->odd_from = TAME;
    s = surface(in);
    in->odd_from = odd_from;
    return s;
}

static void fill_world(input *in, world *w) {
    size_t i;
    memset(w, 0, sizeof *w);
    w->quality.depth = (scatter_depth_method)whole(in, SCATTER_DEPTH_AUTO, SCATTER_DEPTH_MARCH);
    w->quality.density =
        (scatter_density_method)whole(in, SCATTER_DENSITY_AUTO, SCATTER_DENSITY_VOLUME);
    w->quality.ray = (scatter_ray_method)whole(in, SCATTER_RAY_QUADRATURE, SCATTER_RAY_MARCH);
    w->quality.nodes = whole(in, 1, 6);
    w->quality.grid = whole(in, 2, 9);
    w->quality.lights_per_update = whole(in, 0, 3);
    fill_medium(in, w);
    w->scene.light_count = amount(in, COUNT(w->lights));
    w->scene.lights = (const scatter_light *)array(in, w->lights);
    for (i = 0; i < COUNT(w->lights); i++)
        fill_light(in, &w->lights[i]);
    w->scene.background = vector(in, 0.0f, 1.0f);
    w->pattern = next(in);
    w->scene.visible = w->pattern & 1u ? is_visible : NULL;
    w->scene.surface = w->pattern & 2u ? find_surface : NULL;
    w->scene.user = w;
    w->surface = tame_surface(in);
    fill_terms(in, w);
}

static void empty_world(world *w) {
    size_t i;
    for (i = 0; i < COUNT(w->voxels); i++)
        free(w->voxels[i]);
}

/* -------------------------------------------------------------------------------------- >>calls */

static void try_ray(input *in, books *b, const scatter_context *context) {
    scatter_ray ray;
    scatter_surface hit = surface(in);
    scatter_sample sample;
    ray.origin = vector(in, -3.0f, 3.0f);
    ray.direction = vector(in, -1.0f, 1.0f);
    if (!succeeded(b, scatter_radiance(context, &ray, next(in) & 1u ? &hit : NULL, &sample)))
        return;
    demand_finite(&sample.radiance.x, 3, "radiance is not finite");
    demand_finite(&sample.surface.x, 3, "surface radiance is not finite");
    demand_unit(&sample.transmittance.x, 3, "transmittance is not in 0..1");
}

static scatter_view view(input *in) {
    scatter_view v;
    unsigned kind = next(in) % 3;
    v.origin = vector(in, -4.0f, 4.0f);
    if (kind == 1)
        return scatter_view_perspective(v.origin, vector(in, -1.0f, 1.0f),
                                        scatter_v3(0.0f, 1.0f, 0.0f), 1.0f, 1.5f);
    if (kind == 2)
        return scatter_view_orthographic(v.origin, scatter_v3(0.0f, 0.0f, 0.0f),
                                         vector(in, -1.0f, 1.0f), 3.0f, 1.5f);
    v.origin_dx = vector(in, -1.0f, 1.0f);
    v.origin_dy = vector(in, -1.0f, 1.0f);
    v.direction = vector(in, -1.0f, 1.0f);
    v.direction_dx = vector(in, -1.0f, 1.0f);
    v.direction_dy = vector(in, -1.0f, 1.0f);
    return v;
}

/* The sizes are small, or such that no memory could hold the picture. */
static void picture_size(input *in, scatter_image *image) {
    image->width = whole(in, 1, 4);
    image->height = whole(in, 1, 4);
    if (image->width > 4 || image->height > 4)
        image->width = image->height = INT_MAX;
    if (next(in) & 1u)
        return;
    image->x0 = whole(in, 0, 2);
    image->y0 = whole(in, 0, 2);
    image->x1 = whole(in, 1, 4);
    image->y1 = whole(in, 1, 4);
}

static void demand_estimate(const scatter_estimate *e) {
    demand_finite(&e->error, 1, "an estimate is not finite");
    demand_finite(&e->uncertainty, 1, "the uncertainty of an estimate is not finite");
    demand(e->error >= 0.0f && e->uncertainty >= 0.0f, "an estimate is negative");
}

/* Rarely: it renders the scene a dozen times. */
static void try_plan(input *in, books *b, const scatter_host *host, const world *w,
                     const scatter_view *camera, const scatter_image *image) {
    scatter_forecast f;
    float budget = number(in, 0.001f, 0.1f);
    if (next(in) % 8 != 0)
        return;
    b->patience = next(in) & 7u;
    if (succeeded(b, scatter_plan(host, &w->scene, camera, image, budget, &f))) {
        demand_estimate(&f.estimate);
        demand(f.quality.nodes > 0 && f.setup_ms >= 0.0f && f.image_ms >= 0.0f &&
                   f.planning_ms >= 0.0f,
               "a plan without nodes or of negative cost");
    }
    b->patience = 0;
}

static void try_picture(input *in, books *b, const scatter_host *host, const world *w,
                        const scatter_context *context) {
    scatter_view camera = view(in);
    scatter_image image;
    scatter_estimate estimate = {0.0f, 0.0f, 0};
    float rgb[48] = {0}, transmittance[48] = {0}, color[48];
    float *distance = floats(in, 16);
    size_t i;
    for (i = 0; i < COUNT(color); i++)
        color[i] = (float)next(in) / 64.0f; /* tame: it goes into the picture as it is */
    memset(&image, 0, sizeof image);
    picture_size(in, &image);
    image.rgb = (float *)(uintptr_t)array(in, rgb);
    image.transmittance = next(in) & 1u ? transmittance : NULL;
    image.color = next(in) & 1u ? color : NULL;
    image.distance = next(in) & 1u ? distance : NULL;
    image.estimate = next(in) & 1u ? &estimate : NULL;
    b->patience = next(in) & 3u;
    if (succeeded(b, scatter_render(context, &camera, &image))) {
        demand_unit(transmittance, 48, "transmittance of a pixel is not in 0..1");
        demand_finite(rgb, 48, "a pixel is not finite");
        demand_estimate(&estimate);
    }
    b->patience = 0;
    try_plan(in, b, host, w, &camera, &image);
    free(distance);
}

static scatter_source source(input *in) {
    scatter_source s;
    s.directional = (int)(next(in) & 1u);
    s.position = vector(in, -2.0f, 2.0f);
    s.direction = vector(in, -1.0f, 1.0f);
    return s;
}

static void try_depth(input *in, books *b, const scatter_host *host, const world *w) {
    scatter_depth *depth = NULL;
    scatter_source s = source(in);
    int i;
    if (!succeeded(b, scatter_depth_create(host, &depth)))
        return;
    if (succeeded(b, scatter_depth_update(depth, &w->scene.medium, &s, &w->quality)))
        for (i = 0; i < 4; i++) {
            float tau = scatter_depth_at(depth, vector(in, -2.0f, 2.0f));
            demand(!(tau < 0.0f), "a negative optical depth");
        }
    scatter_depth_destroy(depth);
}

static void try_inject(input *in, books *b, const scatter_host *host, const world *w) {
    scatter_volume volume;
    float values[125] = {0};
    volume.nx = whole(in, 1, 5);
    volume.ny = whole(in, 1, 5);
    volume.nz = whole(in, 1, 5);
    if (volume.nx > 5 || volume.ny > 5 || volume.nz > 5)
        volume.nx = volume.ny = volume.nz = INT_MAX;
    volume.box = box(in);
    volume.values = (float *)(uintptr_t)array(in, values);
    if (succeeded(b, scatter_inject(host, &w->scene.medium, &volume)))
        demand_finite(values, COUNT(values), "an injected density is not finite");
}

static void try_tone(input *in) {
    scatter_tone tone;
    float *rgb = floats(in, 12);
    tone.key = number(in, 0.0f, 1.0f);
    tone.white = number(in, 0.0f, 4.0f);
    tone.log_average = number(in, 0.0f, 1.0f);
    if (rgb)
        scatter_tone_map(&tone, rgb, 4, rgb);
    if (rgb)
        (void)scatter_srgb8(rgb[0] + scatter_log_average(rgb, 4));
    free(rgb);
}

/* Few texels and few lights: what is refined and clustered is large enough anyway. */
static void try_environment(input *in, books *b, const scatter_host *host) {
    float rgb[48];
    scatter_environment map;
    scatter_light lights[8];
    scatter_vec3 seen;
    int i, count = whole(in, 1, 8), kind = whole(in, 0, 1);
    for (i = 0; i < 48; i++)
        rgb[i] = number(in, 0.0f, 4.0f);
    map.rgb = (const float *)array(in, rgb);
    map.width = whole(in, 1, 4);
    map.height = whole(in, 1, 4);
    map.scale = number(in, 0.0f, 2.0f);
    if (map.width > 4 || map.height > 4)
        map.width = map.height = INT_MAX;
    if (!succeeded(b, scatter_constellation(host, &map, (scatter_constellation_method)kind,
                                            count > 8 ? INT_MAX : count, lights)))
        return;
    for (i = 0; i < count; i++) {
        const scatter_light *l = &lights[i];
        demand_between(&l->intensity.x, 3, 0.0f, 1e18f, "a light is negative or too bright");
        demand_between(&l->direction.x, 3, -1.0001f, 1.0001f, "a direction is not a unit vector");
    }
    scatter_turn_lights(lights, (size_t)count, vector(in, -1.0f, 1.0f), number(in, -7.0f, 7.0f),
                        lights);
    seen = scatter_environment_radiance(&map, vector(in, -1.0f, 1.0f));
    demand_between(&seen.x, 3, 0.0f, 1e18f, "the radiance of a map is negative or too bright");
}

/* The default has 64^3 cells, too slow here where it samples voxels. */
static const scatter_quality *choose_quality(input *in, const world *w) {
    return next(in) == 255 && w->scene.medium.grid_count == 0 ? NULL : &w->quality;
}

/* A context sees two scenes one after the other, to try what an update keeps from the first. */
static void try_context(input *in, books *b, const scatter_host *host) {
    scatter_context *context = NULL;
    world *w = (world *)malloc(sizeof *w);
    int round;
    if (w && succeeded(b, scatter_create(host, &context))) {
        for (round = 0; round < 2; round++) {
            choose_temper(in);
            fill_world(in, w);
            succeeded(b, scatter_update(context, &w->scene, choose_quality(in, w)));
            try_ray(in, b, context);
            try_picture(in, b, host, w, context);
            try_depth(in, b, host, w);
            try_inject(in, b, host, w);
            empty_world(w);
        }
        scatter_destroy(context);
    }
    free(w);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);
int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    input in = {data, size, TAME};
    books b;
    scatter_host host;
    memset(&b, 0, sizeof b);
    memset(&host, 0, sizeof host);
    host.user = &b;
    host.allocate = take;
    host.release = give;
    host.log = log_sentence;
    host.progress = progress;
    try_context(&in, &b, &host);
    try_tone(&in);
    try_environment(&in, &b, &host);
    demand(b.live == 0, "memory was leaked");
    return 0;
}
