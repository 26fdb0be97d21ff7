/* environment.h - benchmark: constellations of photographed skies: time, and the error of the
   constellation itself against every texel of the map in a thin medium. MIT licence. */
#ifndef SCATTER_BENCH_ENVIRONMENT_H
#define SCATTER_BENCH_ENVIRONMENT_H

#include "chart.h"

#include "../tests/hdr.h"

enum {
    ENV_COUNTS = 8,
    ENV_METHODS = 2,
    ENV_PHASES = 3,
    ENV_LANES = 16,
    ENV_GAUSSIANS = 8,
    ENV_RAYS = 64,
    ENV_NODES = 12, /* on each ray */
    ENV_ROUNDS = 7,
    ENV_LARGE = 4096, /* columns of the upscaled map */
    ENV_LARGE_ROUNDS = 3,
    ENV_AT_20 = 3 /* the place of 20 lights in env_counts */
};

static const int env_counts[ENV_COUNTS] = {4, 8, 16, 20, 32, 64, 128, 256};
static const float env_phases[ENV_PHASES] = {0.0f, 0.5f, 0.85f};
static const char *const env_methods[ENV_METHODS] = {"median cut", "k-means"};

static const char *env_headings(const char *first)
{
    static char text[128];
    int length = snprintf(text, sizeof text, "%s", first);
    for (int i = 0; i < ENV_COUNTS; i++)
        length += snprintf(text + length, sizeof text - (size_t)length, "|%d", env_counts[i]);
    return text;
}

static void env_constellation(const scatter_environment *map, int method, int count,
                              scatter_light *lights)
{
    must(scatter_constellation(NULL, map, (scatter_constellation_method)method, count, lights),
         "scatter_constellation");
}

/* -------------------------------------------------------------------------------------- time */

static timing env_time(const scatter_environment *map, int method, int count)
{
    scatter_light lights[256];
    timing t = {{0}, 0};
    int most = map->width < ENV_LARGE ? ENV_ROUNDS : ENV_LARGE_ROUNDS;
    for (int i = 0; i < by_level(1, 3, most); i++) {
        double start = thread_ms();
        env_constellation(map, method, count, lights);
        timing_add(&t, thread_ms() - start);
    }
    return t;
}

/* The same sky in more texels, each looked up. */
static scatter_environment env_enlarged(const scatter_environment *map, int width)
{
    scatter_environment large = {NULL, width, width / 2, 0};
    float *rgb = floats((size_t)width * (size_t)width / 2 * 3);
    large.rgb = rgb;
    for (int y = 0; y < large.height; y++)
        for (int x = 0; x < width; x++, rgb += 3) {
            double theta = 3.141592653589793 * (y + 0.5) / large.height;
            double phi = 6.283185307179586 * ((x + 0.5) / width - 0.5);
            scatter_vec3 c = scatter_environment_radiance(
                map, scatter_v3((float)(sin(theta) * sin(phi)), (float)cos(theta),
                                (float)(-sin(theta) * cos(phi))));
            rgb[0] = c.x, rgb[1] = c.y, rgb[2] = c.z;
        }
    return large;
}

/* One row for each method; returns the larger median for 20 lights. */
static double env_time_rows(report *r, const char *name, const scatter_environment *map)
{
    double worst = 0;
    for (int m = 0; m < ENV_METHODS; m++) {
        report_cell(r, "%s, %d x %d, %s", name, map->width, map->height, env_methods[m]);
        for (int c = 0; c < ENV_COUNTS; c++) {
            timing t = env_time(map, m, env_counts[c]);
            report_cell(r, "%.2f%s", timing_median(&t), timing_flag(&t));
            if (c == ENV_AT_20)
                worst = worse_of(timing_median(&t), worst);
        }
        report_row(r, 1);
    }
    return worst;
}

static void env_times(report *r)
{
    double worst = 0;
    report_text(r, "Milliseconds of scatter_constellation on one core, by the number of lights:");
    report_table(r, "environment_time", env_headings("sky, size, method"));
    for (int i = 0; i < by_level(1, 2, HDR_MAPS); i++) {
        scatter_environment map, large;
        if (!hdr_read(hdr_names[i], &map))
            continue;
        worst = worse_of(env_time_rows(r, hdr_names[i], &map), worst);
        if (i == 0) {
            large = env_enlarged(&map, by_level(1100, 2048, ENV_LARGE));
            env_time_rows(r, hdr_names[i], &large);
            free((void *)(uintptr_t)large.rgb);
        }
        hdr_free(&map);
    }
    report_end(r);
    report_target(r, worst > 0 && worst <= 10, "1024 x 512 texels to 20 lights: <= 10 ms",
                  "%.2f ms, the slowest sky and method", worst);
    report_claim(r, "an HDR sky of 1024 x 512 texels to 20 lights, one core", "10 ms", "%.2f ms",
                 worst);
}

/* ------------------------------------------------------------------------------------- error */

/* What shines, as directions to look and irradiances: all texels of a map, or lights. Padded with
   darkness to whole lanes. */
typedef struct env_sources {
    float *x, *y, *z, *e[3];
    int count;
} env_sources;

static env_sources env_open_sources(int room)
{
    env_sources s;
    size_t n = ((size_t)room + ENV_LANES - 1) / ENV_LANES * ENV_LANES;
    s.x = floats(6 * n);
    memset(s.x, 0, 6 * n * sizeof *s.x);
    s.y = s.x + n;
    s.z = s.y + n;
    for (int i = 0; i < 3; i++)
        s.e[i] = s.z + (size_t)(i + 1) * n;
    s.count = (int)n;
    return s;
}

static void env_set_source(env_sources *s, int i, scatter_vec3 to, double r, double g, double b)
{
    s->x[i] = to.x;
    s->y[i] = to.y;
    s->z[i] = to.z;
    s->e[0][i] = (float)r;
    s->e[1][i] = (float)g;
    s->e[2][i] = (float)b;
}

static env_sources env_texels(const scatter_environment *map)
{
    env_sources s = env_open_sources(map->width * map->height);
    const double tall = 3.141592653589793 / map->height, wide = 6.283185307179586 / map->width;
    for (int y = 0; y < map->height; y++) {
        double theta = tall * (y + 0.5), area = 2 * wide * sin(theta) * sin(0.5 * tall);
        for (int x = 0; x < map->width; x++) {
            double phi = wide * (x + 0.5) - 3.141592653589793;
            const float *c = map->rgb + 3 * ((size_t)y * (size_t)map->width + (size_t)x);
            scatter_vec3 to = scatter_v3((float)(sin(theta) * sin(phi)), (float)cos(theta),
                                         (float)(-sin(theta) * cos(phi)));
            env_set_source(&s, y * map->width + x, to, area * c[0], area * c[1], area * c[2]);
        }
    }
    return s;
}

static env_sources env_lights(const scatter_light *lights, int count)
{
    env_sources s = env_open_sources(count);
    for (int i = 0; i < count; i++) {
        scatter_vec3 d = lights[i].direction, e = lights[i].intensity;
        env_set_source(&s, i, scatter_v3(-d.x, -d.y, -d.z), e.x, e.y, e.z);
    }
    return s;
}

/* A little cloud, grey, extinction 1/m. */
static void env_cloud(scatter_gaussian *g)
{
    uint64_t seed = 2008;
    for (int i = 0; i < ENV_GAUSSIANS; i++) {
        scatter_vec3 p = random_point(&seed);
        g[i].center = scatter_v3(p.x - 0.5f, p.y - 0.5f, p.z - 0.5f);
        g[i].a = random_between(&seed, 2, 4);
        g[i].c = random_between(&seed, 0.2, 0.6);
    }
}

/* A point on a ray, and what belongs to it. */
typedef struct env_point {
    const scatter_gaussian *cloud;
    scatter_vec3 x, ray;
} env_point;

/* Closed-form transmittance from x to infinity along 16 directions. */
SCATTERI_FN void env_transmittance(const env_point *p, const env_sources *s, int first, float *t)
{
    float depth[ENV_LANES] = {0};
    for (int k = 0; k < ENV_GAUSSIANS; k++) {
        const scatter_gaussian g = p->cloud[k];
        const float vx = g.center.x - p->x.x, vy = g.center.y - p->x.y, vz = g.center.z - p->x.z;
        const float v2 = vx * vx + vy * vy + vz * vz, half = g.c * 0.88622693f / g.a;
        for (int i = 0; i < ENV_LANES; i++) {
            float along = vx * s->x[first + i] + vy * s->y[first + i] + vz * s->z[first + i];
            float bell = scatteri_exp(-g.a * g.a * (v2 - along * along));
            depth[i] += half * bell * (1.0f + scatteri_erf(g.a * along));
        }
    }
    for (int i = 0; i < ENV_LANES; i++)
        t[i] = scatteri_exp(-depth[i]);
}

/* Henyey-Greenstein for 16 directions of light, looking along the ray. */
SCATTERI_FN void env_phase(const env_point *p, const env_sources *s, int first, float g,
                           float *value)
{
    const scatter_vec3 w = p->ray;
    for (int i = 0; i < ENV_LANES; i++) {
        float c = w.x * s->x[first + i] + w.y * s->y[first + i] + w.z * s->z[first + i];
        float root = scatteri_rsqrt(1.0f + g * g - 2.0f * g * c);
        value[i] = 0.07957747f * (1.0f - g * g) * root * root * root;
    }
}

/* Scattered radiance per metre and unit of density, for each phase: sum of E p T over all. Rows of
   64 lanes are summed in float, the rest in double. */
SCATTERI_HOT static void env_scatter(const env_point *p, const env_sources *s,
                                     double sum[ENV_PHASES][3])
{
    memset(sum, 0, sizeof(double[ENV_PHASES][3]));
    for (int row = 0; row < s->count; row += 64 * ENV_LANES) {
        int end = row + 64 * ENV_LANES < s->count ? row + 64 * ENV_LANES : s->count;
        float lane[ENV_PHASES][3][ENV_LANES] = {{{0}}};
        for (int first = row; first < end; first += ENV_LANES) {
            float t[ENV_LANES], phase[ENV_LANES];
            env_transmittance(p, s, first, t);
            for (int k = 0; k < ENV_PHASES; k++) {
                env_phase(p, s, first, env_phases[k], phase);
                for (int c = 0; c < 3; c++)
                    for (int i = 0; i < ENV_LANES; i++)
                        lane[k][c][i] += s->e[c][first + i] * t[i] * phase[i];
            }
        }
        for (int k = 0; k < ENV_PHASES; k++)
            for (int c = 0; c < 3; c++)
                for (int i = 0; i < ENV_LANES; i++)
                    sum[k][c] += lane[k][c][i];
    }
}

typedef struct env_rays {
    scatter_gaussian cloud[ENV_GAUSSIANS];
    scatter_medium medium;
    scatter_ray ray[ENV_RAYS];
    int rays, nodes;
    double depth; /* mean optical depth of the rays */
} env_rays;

/* From a sphere of 3 m around the cloud to points within it. */
static void env_open_rays(env_rays *e)
{
    uint64_t seed = 42;
    memset(e, 0, sizeof *e);
    env_cloud(e->cloud);
    e->medium.gaussians = e->cloud;
    e->medium.gaussian_count = ENV_GAUSSIANS;
    e->medium.extinction = scatter_v3(1, 1, 1);
    e->rays = by_level(2, 16, ENV_RAYS);
    e->nodes = by_level(2, 8, ENV_NODES);
    for (int i = 0; i < e->rays; i++) {
        double z = 2 * random_unit(&seed) - 1, turn = 6.283185307179586 * random_unit(&seed);
        double flat = 3 * sqrt(1 - z * z);
        scatter_vec3 target = random_point(&seed), o, d;
        o = scatter_v3((float)(flat * cos(turn)), (float)(flat * sin(turn)), (float)(3 * z));
        d = scatter_v3(target.x - 0.5f - o.x, target.y - 0.5f - o.y, target.z - 0.5f - o.z);
        e->ray[i].origin = o;
        e->ray[i].direction = scatteri_unit(d);
    }
}

static scatter_vec3 env_along(const scatter_ray *ray, float t)
{
    return scatteri_add(ray->origin, scatteri_scale(ray->direction, t));
}

/* The closed form above against the library's, in all directions from inside the cloud. */
static void env_check_depth(const env_rays *e, const env_sources *s)
{
    env_point p = {e->cloud, {0.1f, -0.2f, 0.3f}, {0, 0, 1}};
    for (int first = 0; first + ENV_LANES <= s->count;
         first += s->count / 64 / ENV_LANES * ENV_LANES + ENV_LANES) {
        float t[ENV_LANES];
        env_transmittance(&p, s, first, t);
        for (int i = 0; i < ENV_LANES; i++) {
            scatter_ray ray = {p.x, {s->x[first + i], s->y[first + i], s->z[first + i]}};
            float depth = scatter_optical_depth(&e->medium, p.x, env_along(&ray, 100));
            if (!(fabs(t[i] - exp(-depth)) <= 1e-5))
                report_die("its closed form is wrong", "in environment.h");
        }
    }
}

/* Radiances of the rays, RGB, for each phase: the midpoint rule on both sides. */
static void env_radiances(env_rays *e, const env_sources *s, float *rgb[ENV_PHASES])
{
    double depth = 0;
    for (int i = 0; i < e->rays; i++) {
        const scatter_ray *ray = &e->ray[i];
        double all[ENV_PHASES][3] = {{0}}, sum[ENV_PHASES][3];
        float step = 4.0f / (float)e->nodes; /* the cloud lies 1 to 5 m away */
        for (int n = 0; n < e->nodes; n++) {
            env_point p = {e->cloud, {0, 0, 0}, ray->direction};
            p.x = env_along(ray, 1 + ((float)n + 0.5f) * step);
            double weight = step * scatter_density(&e->medium, p.x) *
                            exp(-scatter_optical_depth(&e->medium, ray->origin, p.x));
            env_scatter(&p, s, sum);
            for (int k = 0; k < ENV_PHASES * 3; k++)
                all[k / 3][k % 3] += weight * sum[k / 3][k % 3];
        }
        depth += scatter_optical_depth(&e->medium, ray->origin, env_along(ray, 6));
        for (int k = 0; k < ENV_PHASES * 3; k++)
            rgb[k / 3][3 * i + k % 3] = (float)all[k / 3][k % 3];
    }
    e->depth = depth / e->rays;
}

typedef struct env_errors {
    double rmse[HDR_MAPS][ENV_METHODS][ENV_COUNTS][ENV_PHASES];
} env_errors;

/* Relative RMSE of all constellations of one map. */
static void env_measure(env_errors *errors, int map_index, const scatter_environment *map,
                        env_rays *e)
{
    size_t n = (size_t)e->rays * 3;
    float *truth[ENV_PHASES], *value[ENV_PHASES], *memory = floats(2 * ENV_PHASES * n);
    scatter_light lights[256];
    env_sources s = env_texels(map);
    for (int k = 0; k < ENV_PHASES; k++) {
        truth[k] = memory + (size_t)k * n;
        value[k] = memory + (size_t)(k + ENV_PHASES) * n;
    }
    env_check_depth(e, &s);
    env_radiances(e, &s, truth);
    free(s.x);
    for (int m = 0; m < ENV_METHODS; m++)
        for (int c = 0; c < ENV_COUNTS; c++) {
            env_constellation(map, m, env_counts[c], lights);
            s = env_lights(lights, env_counts[c]);
            env_radiances(e, &s, value);
            free(s.x);
            for (int k = 0; k < ENV_PHASES; k++)
                errors->rmse[map_index][m][c][k] = relative_rmse(value[k], truth[k], n);
        }
    free(memory);
}

static void env_error_table(report *r, const env_errors *errors, int maps)
{
    report_table(r, "environment_error", env_headings("sky, method, g"));
    for (int i = 0; i < maps; i++)
        for (int m = 0; m < ENV_METHODS; m++)
            for (int k = 0; k < ENV_PHASES; k++) {
                report_cell(r, "%s, %s, %.2f", hdr_names[i], env_methods[m], env_phases[k]);
                for (int c = 0; c < ENV_COUNTS; c++)
                    report_cell(r, "%.3g %%", 100 * errors->rmse[i][m][c][k]);
                report_row(r, 1);
            }
    report_end(r);
}

static void env_chart(report *r, const env_errors *errors, int maps)
{
    FILE *csv = chart_open("environment", "lights");
    chart *c = (chart *)malloc(sizeof *c);
    if (!c)
        must(SCATTER_OUT_OF_MEMORY, "malloc");
    fprintf(csv, "# Constellations in a thin medium, g = %.2f\n", env_phases[1]);
    for (int m = 0; m < ENV_METHODS; m++)
        for (int i = 0; i < maps; i++)
            for (int k = 0; k < ENV_COUNTS; k++) {
                char family[48];
                snprintf(family, sizeof family, "%s, %s", hdr_names[i], env_methods[m]);
                chart_point(csv, "environment", family, "", env_counts[k],
                            errors->rmse[i][m][k][1]);
            }
    chart_close(csv);
    chart_read(c, "environment");
    c->across = "lights";
    if (chart_draw(c, report_charts))
        report_text(r, "![%s](%s/environment.svg)", c->title, report_link);
    else
        report_text(r, "skipped: no chart (gnuplot does not run)");
    free(c);
}

static void env_error(report *r)
{
    env_errors errors;
    env_rays rays;
    int maps = by_level(1, 1, HDR_MAPS);
    double worst[ENV_METHODS] = {0, 0};
    memset(&errors, 0, sizeof errors);
    env_open_rays(&rays);
    for (int i = 0; i < maps; i++) {
        scatter_environment map;
        if (!hdr_read(hdr_names[i], &map))
            return;
        env_measure(&errors, i, &map, &rays);
        hdr_free(&map);
        for (int m = 0; m < ENV_METHODS; m++)
            worst[m] = worse_of(errors.rmse[i][m][ENV_AT_20][0], worst[m]);
    }
    report_text(r,
                "Error of the constellation itself: radiance of %d rays through %d Gaussians (mean "
                "optical depth %.2f), scattered once at %d points on each, lit by the lights, "
                "against all texels of the map, each through the medium in closed form. Relative "
                "RMSE by the number of lights, for Henyey-Greenstein's g:",
                rays.rays, (int)ENV_GAUSSIANS, rays.depth, rays.nodes);
    env_error_table(r, &errors, maps);
    env_chart(r, &errors, maps);
    report_claim(r, "20 lights instead of an HDR sky, thin isotropic medium: error", "-",
                 "at most %.2g %% by median cut, %.2g %% by k-means", 100 * worst[0],
                 100 * worst[1]);
}

static void env_run(report *r)
{
    scatter_environment map;
    report_text(r, "## Skies");
    if (!hdr_read(hdr_names[0], &map)) {
        report_text(r, "skipped: no data (../shared/data/hdr)");
        return;
    }
    hdr_free(&map);
    env_times(r);
    env_error(r);
}

#endif
