/* test_skip.c - empty space: the map of distances against brute force, that it is conservative, and
   that passing empty space and masking steps changes no image. Needs no reference: the measure is
   the same library with quality.no_distance_map and no_mask set. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#define SCATTER_IMPLEMENTATION
#include "../examples/scene.h"
#include "../scatter.h"
#include "check.h"

enum { MASK_ROOM = 4096 };

/* ---------------------------------------------------------- >>masks */

/* A grid whose voxels are 0 or not, with its map. */
typedef struct mask {
    float voxels[MASK_ROOM];
    scatter_grid grid;
    scatteri_field field;
    void *memory;
} mask;

static void mask_open(mask *m, int nx, int ny, int nz, scatter_vec3 edge) {
    memset(m, 0, sizeof *m);
    m->grid.density = m->voxels;
    m->grid.nx = nx;
    m->grid.ny = ny;
    m->grid.nz = nz;
    m->grid.box.max = check_v3((float)nx * edge.x, (float)ny * edge.y, (float)nz * edge.z);
    m->field = scatteri_field_of(&m->grid);
    m->memory = malloc(scatteri_map_bytes(&m->grid));
    assert_true(m->memory != NULL);
}

static void mask_map(mask *m) {
    scatter_host host;
    memset(&host, 0, sizeof host);
    scatteri_map_distances(&host, &m->field, m->memory);
}

static void mask_close(mask *m) { free(m->memory); }

static int mask_voxels(const mask *m) { return m->grid.nx * m->grid.ny * m->grid.nz; }

/* Sides of 1 to 20 voxels with edges up to 4 to 1, a share of them not empty. */
static void mask_random(mask *m, uint64_t *seed) {
    float share = check_uniform(seed, -3.5f, 0.2f);
    int n[3], i;
    for (i = 0; i < 3; i++)
        n[i] = (int)check_uniform(seed, 1.0f, 20.99f);
    if (n[0] * n[1] * n[2] > MASK_ROOM)
        n[2] = MASK_ROOM / (n[0] * n[1]);
    mask_open(m, n[0], n[1], n[2], check_point(seed, 0.25f, 1.0f));
    for (i = 0; i < mask_voxels(m); i++)
        m->voxels[i] = check_uniform(seed, 0.0f, 1.0f) < powf(10.0f, share) ? 1.0f : 0.0f;
    mask_map(m);
}

/* Distance of x on one axis from the support of voxel i, which reaches one voxel to either side and
   to the face of the box where that is nearer. */
static double mask_gap(double x, int i, int n, double edge) {
    double low = i <= 1 ? 0 : ((double)i - 0.5) * edge;
    double high = i >= n - 2 ? (double)n * edge : ((double)i + 1.5) * edge;
    return x < low ? low - x : x > high ? x - high : 0;
}

/* From x to where the field is not 0; HUGE_VAL: it is 0 everywhere. Brute force. */
static double mask_distance(const mask *m, const double *x) {
    const scatter_grid *g = &m->grid;
    double ex = (double)g->box.max.x / g->nx, ey = (double)g->box.max.y / g->ny;
    double ez = (double)g->box.max.z / g->nz, least = HUGE_VAL;
    int i, j, k;
    for (k = 0; k < g->nz; k++)
        for (j = 0; j < g->ny; j++)
            for (i = 0; i < g->nx; i++) {
                double a, b, c, square;
                if (!(scatteri_voxel(g, i, j, k) > 0.0f))
                    continue;
                a = mask_gap(x[0], i, g->nx, ex);
                b = mask_gap(x[1], j, g->ny, ey);
                c = mask_gap(x[2], k, g->nz, ez);
                square = a * a + b * b + c * c;
                least = square < least ? square : least;
            }
    return sqrt(least);
}

/* |h|^2/4 of the axes along which there is more than one voxel. */
static double mask_less(const mask *m) {
    const scatter_grid *g = &m->grid;
    double x = g->nx > 1 ? (double)g->box.max.x / g->nx : 0;
    double y = g->ny > 1 ? (double)g->box.max.y / g->ny : 0;
    double z = g->nz > 1 ? (double)g->box.max.z / g->nz : 0;
    return 0.25 * (x * x + y * y + z * z);
}

/* What the map should hold for a voxel, in its units: one less than g. */
static double mask_expected(const mask *m, int i, int j, int k) {
    const scatter_grid *g = &m->grid;
    double x[3], d;
    x[0] = ((double)i + 0.5) * (double)g->box.max.x / g->nx;
    x[1] = ((double)j + 0.5) * (double)g->box.max.y / g->ny;
    x[2] = ((double)k + 0.5) * (double)g->box.max.z / g->nz;
    d = mask_distance(m, x);
    if (d == HUGE_VAL)
        return SCATTERI_NONE;
    d = sqrt(fmax(d * d - mask_less(m), 0)) / (double)m->field.unit - 1;
    return fmax(floor(d), 0);
}

/* Worst difference between map and brute force, in units. */
static double map_error(const mask *m) {
    const uint16_t *at = m->field.distances;
    double worst = 0;
    int i, j, k;
    for (k = 0; k < m->grid.nz; k++)
        for (j = 0; j < m->grid.ny; j++)
            for (i = 0; i < m->grid.nx; i++)
                worst = fmax(worst, fabs((double)*at++ - mask_expected(m, i, j, k)));
    return worst;
}

/* The map with all distances one (smallest) edge of a voxel larger, but 0 stays. */
static void map_exaggerate(mask *m) {
    scatter_vec3 e = m->field.edge;
    float more = fminf(e.x, fminf(e.y, e.z)) / m->field.unit;
    int i;
    for (i = 0; i < mask_voxels(m); i++)
        if (m->field.distances[i] > 0 && m->field.distances[i] + more < SCATTERI_NONE)
            ((uint16_t *)m->memory)[i] = (uint16_t)((float)m->field.distances[i] + more);
}

/* ------------------------------------------------------- >>exactness */

/* The rounding of a float in d^2 is 1e-7 of at most 60^2 edges, 4e-4 units of the diagonal, and may
   move the value to the next unit. */
#define MAP_TOLERANCE 1.0

static void test_exact(void **state) {
    uint64_t seed = 11;
    int i, caught = 0, large = 0;
    (void)state;
    for (i = 0; i < 400; i++) {
        mask m;
        mask_random(&m, &seed);
        assert_at_most(map_error(&m), MAP_TOLERANCE);
        map_exaggerate(&m);
        large += map_error(&m) > 0;
        caught += map_error(&m) > MAP_TOLERANCE;
        mask_close(&m);
    }
    assert_int_equal(caught, large);
    assert_at_least(caught, 100);
}

static void check_shape(int nx, int ny, int nz, int stride) {
    mask m;
    int i;
    mask_open(&m, nx, ny, nz, check_v3(0.5f, 0.25f, 1.0f));
    for (i = 0; i < mask_voxels(&m) && stride > 0; i += stride)
        m.voxels[i] = 0.5f;
    mask_map(&m);
    assert_at_most(map_error(&m), MAP_TOLERANCE);
    mask_close(&m);
}

/* One voxel, rows, layers, empty, full, lone voxels, sides on both sides of 16. */
static void test_shapes(void **state) {
    static const int n[] = {1, 2, 15, 16, 17, 33};
    size_t i;
    (void)state;
    for (i = 0; i < CHECK_COUNT(n); i++) {
        int stride;
        for (stride = 0; stride < 3; stride++) {
            check_shape(n[i], 1, 1, stride);
            check_shape(1, n[i], 1, stride);
            check_shape(1, 1, n[i], stride);
            check_shape(1, n[i], 7, stride);
            check_shape(7, 1, n[i], stride * 1000);
            check_shape(n[i], 7, 1, stride * 1000);
            check_shape(n[i], 11, 5, stride * 1000);
        }
    }
    check_shape(1, 1, 4000, 3999);
    check_shape(4000, 1, 1, 3999);
    check_shape(1, 4000, 1, 3999);
}

/* Edges of very different lengths, and boxes far from 1 m: not too large is all that is asked. */
static void test_extreme_edges(void **state) {
    static const float edge[] = {1e-15f, 1e-6f, 1.0f, 1e6f, 1e12f};
    size_t a, b;
    (void)state;
    for (a = 0; a < CHECK_COUNT(edge); a++)
        for (b = 0; b < CHECK_COUNT(edge); b++) {
            mask m;
            int i, j, k, at = 0;
            mask_open(&m, 9, 5, 7, check_v3(edge[a], edge[b], 1.0f));
            m.voxels[0] = m.voxels[200] = 1.0f;
            mask_map(&m);
            for (k = 0; k < 7; k++)
                for (j = 0; j < 5; j++)
                    for (i = 0; i < 9; i++, at++)
                        assert_at_most(m.field.distances[at], mask_expected(&m, i, j, k) + 1);
            mask_close(&m);
        }
}

/* --------------------------------------------------- >>conservative */

/* Trilinear interpolation of the map at voxel coordinates, m. With `whole`, of d instead of g: what
   the map would be without the |h|^2/4. */
static double map_trilinear(const mask *m, const double *at, int whole) {
    const int n[3] = {m->grid.nx, m->grid.ny, m->grid.nz};
    double sum = 0;
    int corner, axis;
    for (corner = 0; corner < 8; corner++) {
        size_t index = 0;
        double weight = 1, d;
        for (axis = 2; axis >= 0; axis--) {
            double g = fmin(fmax(at[axis], 0), n[axis] - 1);
            int low = (int)g, up = corner >> axis & 1;
            int i = low + up < n[axis] ? low + up : low;
            weight *= up ? g - low : 1 - (g - low);
            index = index * (size_t)n[axis] + (size_t)i;
        }
        d = (double)m->field.distances[index] * (double)m->field.unit;
        sum += weight * (whole && d > 0 ? sqrt(d * d + mask_less(m)) : d);
    }
    return sum;
}

/* How far the map goes beyond the truth at a random point, over the diagonal: trilinear, whole
   distances trilinear, at the nearest voxel. */
static void map_excess(const mask *m, uint64_t *seed, double excess[3]) {
    const scatter_grid *g = &m->grid;
    const double edge[3] = {(double)g->box.max.x / g->nx, (double)g->box.max.y / g->ny,
                            (double)g->box.max.z / g->nz};
    double at[3], x[3], truth, scale = 1 / ((double)m->field.unit * SCATTERI_NONE);
    const int n[3] = {g->nx, g->ny, g->nz};
    int i;
    for (i = 0; i < 3; i++) {
        at[i] = (double)check_uniform(seed, -0.5f, (float)n[i] - 0.5f);
        x[i] = (at[i] + 0.5) * edge[i];
    }
    truth = mask_distance(m, x);
    if (truth == HUGE_VAL)
        return;
    excess[0] = fmax(excess[0], (map_trilinear(m, at, 0) - truth) * scale);
    excess[1] = fmax(excess[1], (map_trilinear(m, at, 1) - truth) * scale);
    excess[2] = fmax(excess[2], ((double)scatteri_clear_at(&m->field, at) - truth) * scale);
}

/* 3000 masks with 20 points each. The unit that is taken off is more than all rounding: nothing is
   allowed on top. */
static void test_conservative(void **state) {
    uint64_t seed = 12;
    double good[3] = {0, 0, 0}, bad[3] = {0, 0, 0};
    int i, p;
    (void)state;
    for (i = 0; i < 3000; i++) {
        mask m;
        mask_random(&m, &seed);
        for (p = 0; p < 20; p++)
            map_excess(&m, &seed, good);
        map_exaggerate(&m);
        for (p = 0; p < 20 && i < 300; p++)
            map_excess(&m, &seed, bad);
        mask_close(&m);
    }
    assert_at_most(good[0], 0);
    assert_at_most(good[2], 0);
    assert_at_least(good[1], 1e-3); /* without |h|^2/4 it is not conservative */
    assert_at_least(bad[0], 1e-3);
    assert_at_least(bad[2], 1e-3);
}

/* ------------------------------------------------------- >>segments */

static double segment_error(const mask *m, const scatteri_field *without, scatter_vec3 p,
                            scatter_vec3 q) {
    const scatteri_segment s = scatteri_segment_between(p, q);
    int cells = 0, all = 0;
    double a = (double)scatteri_field_depth(&m->field, s, &cells);
    double b = (double)scatteri_field_depth(without, s, &all);
    assert_true(cells <= all + 1);
    return fabs(a - b);
}

/* Random segments, along the axes, in planes through voxel centres and on faces of the box. */
static double segments_error(const mask *m, uint64_t *seed) {
    scatteri_field without = m->field;
    const scatter_vec3 e = m->field.edge, top = m->grid.box.max;
    double worst = 0;
    int i;
    without.distances = NULL;
    for (i = 0; i < 40; i++) {
        scatter_vec3 p = check_point(seed, -0.5f, 1.5f), q = check_point(seed, -0.5f, 1.5f);
        p = check_v3(p.x * top.x, p.y * top.y, p.z * top.z);
        q = check_v3(q.x * top.x, q.y * top.y, q.z * top.z);
        if (i % 4 == 1)
            p.x = q.x = (floorf(p.x / e.x) + 0.5f) * e.x;
        if (i % 4 == 2)
            p.y = q.y = i % 8 == 2 ? 0.0f : top.y, p.z = q.z = (floorf(p.z / e.z) + 0.5f) * e.z;
        if (i % 4 == 3)
            p.x = q.x, p.z = q.z;
        worst = fmax(worst, segment_error(m, &without, p, q));
    }
    return worst;
}

/* Empty cells add 0 exactly, so the same bits are asked for. */
static void test_segments(void **state) {
    uint64_t seed = 13;
    double bad = 0;
    int i;
    (void)state;
    for (i = 0; i < 500; i++) {
        mask m;
        mask_random(&m, &seed);
        assert_at_most(segments_error(&m, &seed), 0);
        map_exaggerate(&m);
        bad = fmax(bad, segments_error(&m, &seed));
        mask_close(&m);
    }
    assert_at_least(bad, 1e-3);
}

/* ---------------------------------------------------------- >>images */

enum { SIDE = 24, FLOATS = SIDE * SIDE * 3 };

/* Voxels of a ball in an otherwise empty grid. */
static scatter_grid *add_ball(check_world *w, int n, scatter_box box, float radius) {
    scatter_grid *g = check_add_grid(w, n, n, n, box, 5);
    float *v = w->voxels[w->scene.medium.grid_count - 1];
    int i, j, k;
    for (k = 0; k < n; k++)
        for (j = 0; j < n; j++)
            for (i = 0; i < n; i++, v++) {
                float x = (float)i - 0.3f * (float)n, y = (float)j - 0.6f * (float)n;
                float z = (float)k - 0.5f * (float)n;
                *v = x * x + y * y + z * z < radius * radius ? *v + 0.5f : 0.0f;
            }
    return g;
}

static void add_lights(check_world *w) {
    check_add_light(w, SCATTER_LIGHT_DIRECTIONAL, check_v3(1, -2, 0.5f), check_v3(3, 2, 1));
    check_add_light(w, SCATTER_LIGHT_POINT, check_v3(-1, 2, -1), check_v3(9, 9, 9));
    check_add_light(w, SCATTER_LIGHT_SPOT, check_v3(2, 2, 2), check_v3(20, 30, 40));
    w->lights[2].direction = check_v3(-1, -1, -1);
    w->lights[2].outer = 0.7f;
}

static void world_ball(check_world *w) { add_ball(w, 10, check_cube(-1, 1), 2.6f); }

static void world_two(check_world *w) {
    scatter_box long_box = check_cube(-0.2f, 1.2f);
    long_box.max.x = 2.5f;
    add_ball(w, 10, check_cube(-1, 1), 2.6f);
    add_ball(w, 8, long_box, 1.9f);
    w->scene.medium.emission = check_v3(0.1f, 0.2f, 0.3f);
}

static void world_noise(check_world *w) {
    check_add_grid(w, 9, 12, 11, check_cube(-1, 1), 3);
    w->scene.medium.phase.kind = SCATTER_PHASE_HG;
    w->scene.medium.phase.g = 0.6f;
}

static void world_layer(check_world *w) {
    check_add_grid(w, 20, 1, 20, check_cube(-1, 1), 4);
    w->grids[0].box.max.y = -0.8f;
}

static void world_empty(check_world *w) { add_ball(w, 6, check_cube(-1, 1), 0.0f); }

static void world_bounded(check_world *w) {
    world_two(w);
    check_bound(w, check_cube(-0.7f, 0.9f));
}

static void world_coloured(check_world *w) {
    world_ball(w);
    w->scene.medium.extinction = check_v3(1, 2, 4);
}

static void world_far(check_world *w) {
    scatter_box box = check_cube(-1, 1);
    box.min.x += 4096.0f;
    box.max.x += 4096.0f;
    add_ball(w, 10, box, 2.6f);
}

static void world_puffs(check_world *w) {
    world_two(w);
    check_add_gaussians(w, 5, 3.0f, 8.0f, 9);
}

static void world_fog(check_world *w) {
    world_ball(w);
    w->scene.medium.constant = 0.05f;
    check_add_height(w, 0.2f, -0.5f, 0.5f);
}

static void world_only_puffs(check_world *w) { check_add_gaussians(w, 5, 3.0f, 8.0f, 9); }

typedef struct world_case {
    const char *name;
    void (*build)(check_world *);
    double tolerance; /* of the brightest value; see test_images */
} world_case;

/* What five Gaussians hold beyond e^-18 of their centres, 1.5e-8, is left out where nothing else
   is. */
#define RIM 2e-7

static const world_case worlds[] = {
    {"ball", world_ball, 0},       {"two grids", world_two, 0},   {"noise", world_noise, 0},
    {"layer", world_layer, 0},     {"empty", world_empty, 0},     {"bounded", world_bounded, 0},
    {"coloured", world_coloured, 0}, {"far", world_far, 0},       {"puffs", world_puffs, RIM},
    {"fog", world_fog, 0},         {"only puffs", world_only_puffs, RIM},
};

static const scatter_quality qualities[] = {
    {.depth = SCATTER_DEPTH_CLOSED,
     .density = SCATTER_DENSITY_EXACT,
     .ray = SCATTER_RAY_MARCH,
     .nodes = 50,
     .grid = 0},
    {.depth = SCATTER_DEPTH_CLOSED,
     .density = SCATTER_DENSITY_EXACT,
     .ray = SCATTER_RAY_QUADRATURE,
     .nodes = 8,
     .grid = 0},
    {.depth = SCATTER_DEPTH_POLAR,
     .density = SCATTER_DENSITY_EXACT,
     .ray = SCATTER_RAY_MARCH,
     .nodes = 33,
     .grid = 12},
    {.depth = SCATTER_DEPTH_MARCH,
     .density = SCATTER_DENSITY_VOLUME,
     .ray = SCATTER_RAY_MARCH,
     .nodes = 40,
     .grid = 12},
    {.depth = SCATTER_DEPTH_MARCH,
     .density = SCATTER_DENSITY_EXACT,
     .ray = SCATTER_RAY_QUADRATURE,
     .nodes = 8,
     .grid = 12},
    {.depth = SCATTER_DEPTH_CLOSED_VOLUME,
     .density = SCATTER_DENSITY_VOLUME,
     .ray = SCATTER_RAY_QUADRATURE,
     .nodes = 16,
     .grid = 12},
};

static scatter_view view_of(const check_world *w, int inside) {
    float x = w->scene.medium.grid_count > 0 && w->grids[0].box.min.x > 100.0f ? 4096.0f : 0.0f;
    return inside ? scatter_view_perspective(check_v3(x, 0, 0), check_v3(x + 1, 1, 1),
                                             check_v3(0, 1, 0), 2.0f, 1)
                  : scatter_view_orthographic(check_v3(x + 2, 0.5f, -3), check_v3(x, 0, 0),
                                              check_v3(0, 1, 0), 3, 1);
}

static void shoot(const scatter_context *context, const scatter_view *view, float *rgb) {
    scatter_image image;
    memset(&image, 0, sizeof image);
    image.width = image.height = SIDE;
    image.rgb = rgb;
    assert_int_equal(scatter_render(context, view, &image), SCATTER_OK);
}

/* Worst difference over the brightest value of `good`. */
static double image_error(const float *image, const float *good) {
    double worst = 0, most = 1e-30;
    int i;
    for (i = 0; i < FLOATS; i++) {
        most = fmax(most, (double)good[i]);
        worst = fmax(worst, fabs((double)image[i] - (double)good[i]));
        assert_true(good[i] >= 0.0f);
    }
    return worst / most;
}

static double variant_error(const check_world *w, scatter_quality q, int inside) {
    static float good[FLOATS], other[FLOATS];
    const scatter_view view = view_of(w, inside);
    double worst = 0;
    int variant;
    for (variant = 0; variant < 4; variant++) {
        scatter_context *context;
        q.no_distance_map = !(variant & 1);
        q.no_mask = !(variant & 2);
        context = check_open_context(&w->scene, &q);
        shoot(context, &view, variant == 0 ? good : other);
        if (variant > 0)
            worst = fmax(worst, image_error(other, good));
        scatter_destroy(context);
    }
    return worst;
}

/* Where density is 0 exactly nothing is added but 0, so the bits are the same. */
static void test_images(void **state) {
    size_t i, j;
    (void)state;
    for (i = 0; i < CHECK_COUNT(worlds); i++)
        for (j = 0; j < CHECK_COUNT(qualities); j++) {
            check_world w;
            double outside, inside;
            check_world_open(&w);
            worlds[i].build(&w);
            add_lights(&w);
            outside = variant_error(&w, qualities[j], 0);
            inside = variant_error(&w, qualities[j], 1);
            if (outside > worlds[i].tolerance || inside > worlds[i].tolerance)
                fprintf(stderr, "%s, quality %d\n", worlds[i].name, (int)j);
            assert_at_most(outside, worlds[i].tolerance);
            assert_at_most(inside, worlds[i].tolerance);
        }
}

/* With distances one voxel too large the image must be another one. */
static void test_images_fault(void **state) {
    static float good[FLOATS], bad[FLOATS];
    check_world w;
    scatter_context *context;
    scatter_view view;
    uint16_t *map;
    float more;
    int i;
    (void)state;
    check_world_open(&w);
    world_ball(&w);
    add_lights(&w);
    context = check_open_context(&w.scene, &qualities[0]);
    view = view_of(&w, 0);
    shoot(context, &view, good);
    map = (uint16_t *)context->medium.distances.data;
    more = context->medium.fields[0].edge.x / context->medium.fields[0].unit;
    for (i = 0; i < 1000; i++)
        map[i] = (uint16_t)(map[i] > 0 ? (float)map[i] + more : 0.0f);
    shoot(context, &view, bad);
    assert_at_least(image_error(bad, good), 1e-4);
    scatter_destroy(context);
}

/* ------------------------------------------------------------ >>mask */

/* Rays through the picture of a world, ready to march. */
static void open_eye(const scatter_context *context, const scatter_view *view, scatteri_eye *eye) {
    int l;
    eye->context = context;
    for (l = 0; l < SCATTERI_LANES; l++) {
        scatter_ray r = scatter_view_ray(view, 0.1f + 0.05f * (float)l, 0.55f);
        scatteri_set_ray(&eye->rays, l, r.origin, r.direction, SCATTERI_FAR);
    }
    assert_true(scatteri_begin_eye(eye));
    scatteri_find_mask(eye);
}

/* Steps with density that the mask leaves out, and masked ends without density. */
static int mask_faults(const scatteri_eye *eye, int *lit) {
    const scatter_context *c = eye->context;
    int faults = 0, k, l;
    for (l = 0; l < SCATTERI_LANES; l++) {
        int first = -1, last = -1;
        for (k = 0; k < c->quality.nodes; k++) {
            scatter_vec3 x = scatteri_ray_point(&eye->rays, l, scatteri_march_t(eye, l, k));
            if (eye->rays.t0[l] < eye->rays.t1[l] && scatter_density(&c->medium.desc, x) > 0) {
                first = first < 0 ? k : first;
                last = k;
            }
        }
        *lit += last >= 0;
        faults += first != eye->first[l] || last != eye->last[l];
    }
    return faults;
}

static void test_mask(void **state) {
    static scatteri_eye eye;
    int map, inside, lit = 0, l;
    (void)state;
    for (map = 0; map < 2; map++)
        for (inside = 0; inside < 2; inside++) {
            check_world w;
            scatter_quality q = qualities[0];
            scatter_context *context;
            scatter_view view;
            check_world_open(&w);
            world_two(&w);
            add_lights(&w);
            q.no_distance_map = !map;
            context = check_open_context(&w.scene, &q);
            view = view_of(&w, inside);
            open_eye(context, &view, &eye);
            assert_int_equal(mask_faults(&eye, &lit), 0);
            for (l = 0; l < SCATTERI_LANES; l++)
                eye.last[l] -= eye.last[l] > 0;
            assert_true(mask_faults(&eye, &lit) > 0);
            scatter_destroy(context);
        }
    assert_at_least(lit, 16);
}

/* ----------------------------------------------------------- >>change */

/* Voxels that move, with a new version: the same bits as a new context, and no more memory. */
static void test_versions(void **state) {
    static float here[FLOATS], fresh[FLOATS], stale[FLOATS];
    check_world w;
    check_host books;
    scatter_host host = check_host_open(&books, 2);
    scatter_context *context = NULL;
    scatter_quality q = qualities[0];
    scatter_view view;
    size_t calls;
    int step;
    (void)state;
    check_world_open(&w);
    world_ball(&w);
    add_lights(&w);
    view = view_of(&w, 0);
    assert_int_equal(scatter_create(&host, &context), SCATTER_OK);
    assert_int_equal(scatter_update(context, &w.scene, &q), SCATTER_OK);
    calls = books.calls;
    for (step = 1; step < 3; step++) {
        scatter_context *other;
        memmove(w.voxels[0] + 203, w.voxels[0], 797 * sizeof(float));
        memset(w.voxels[0], 0, 203 * sizeof(float));
        shoot(context, &view, stale);
        w.grids[0].version++;
        assert_int_equal(scatter_update(context, &w.scene, &q), SCATTER_OK);
        shoot(context, &view, here);
        other = check_open_context(&w.scene, &q);
        shoot(other, &view, fresh);
        scatter_destroy(other);
        assert_at_most(image_error(here, fresh), 0);
        assert_at_least(image_error(stale, fresh), 1e-4); /* the map of the voxels before */
    }
    assert_int_equal(books.calls, calls);
    scatter_destroy(context);
    assert_int_equal(books.live, 0);
}

/* The same bits in the map with any number of threads. */
static void test_threads(void **state) {
    uint64_t seed = 14;
    mask one, many;
    check_host books;
    scatter_host host = check_host_open(&books, 7);
    int i;
    (void)state;
    for (i = 0; i < 20; i++) {
        mask_random(&one, &seed);
        many = one;
        many.grid.density = one.voxels;
        many.memory = malloc(scatteri_map_bytes(&one.grid));
        scatteri_map_distances(&host, &many.field, many.memory);
        assert_true(memcmp(many.memory, one.memory, (size_t)mask_voxels(&one) * 2) == 0);
        mask_close(&many);
        mask_close(&one);
    }
}

/* ----------------------------------------------------------- >>scenes */

/* Every scene of voxel data. Of a sky the first three lights do: the voxels are what matters. */
static void test_scene_files(void **state) {
    static const char *const names[] = {
        "examples/scenes/cloud.scatter",      "examples/skies/cloud_dawn.scatter",
        "examples/skies/cloud_fagans.scatter", "examples/skies/cloud_studio.scatter",
        "examples/skies/cloud_venice.scatter", "examples/skies/smoke_dawn.scatter",
        "examples/skies/smoke_fagans.scatter", "examples/skies/smoke_studio.scatter",
        "examples/skies/smoke_venice.scatter", "examples/skies/spheres_studio.scatter"};
    static float good[FLOATS], other[FLOATS];
    size_t i;
    int variant, march;
    (void)state;
    for (i = 0; i < CHECK_COUNT(names); i++) {
        scene_file file;
        scatter_view view;
        if (scene_read(&file, names[i]) != 0) {
            printf("skipped: no data for %s\n", names[i]);
            continue;
        }
        if (file.scene.light_count > 3)
            file.scene.light_count = 3;
        view = scene_view(&file, SIDE, SIDE);
        for (march = 0; march < 2; march++)
            for (variant = 0; variant < 4; variant++) {
                scatter_quality q = qualities[march ? 0 : 1];
                scatter_context *context;
                q.no_distance_map = !(variant & 1);
                q.no_mask = !(variant & 2);
                context = check_open_context(&file.scene, &q);
                shoot(context, &view, variant == 0 ? good : other);
                scatter_destroy(context);
                if (variant > 0)
                    assert_at_most(image_error(other, good), 0);
            }
        scene_free(&file);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_exact),         cmocka_unit_test(test_shapes),
        cmocka_unit_test(test_extreme_edges), cmocka_unit_test(test_conservative),
        cmocka_unit_test(test_segments),      cmocka_unit_test(test_images),
        cmocka_unit_test(test_images_fault),  cmocka_unit_test(test_mask),
        cmocka_unit_test(test_versions),      cmocka_unit_test(test_threads),
        cmocka_unit_test(test_scene_files),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
