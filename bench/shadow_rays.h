/* shadow_rays.h - the plainest baseline: a uniform march on the eye ray and, at every sample and
   for every light, a uniform march to the light (Navarro et al. 2008 without their optimisations).
   Plain loops over 16 rays, compiled as the library's. MIT licence. */
#ifndef SCATTER_BENCH_SHADOW_RAYS_H
#define SCATTER_BENCH_SHADOW_RAYS_H

#include "measure.h"

enum { SHADOW_LANES = 16 };

#define SHADOW_REACH 3.4f  /* widths 1/a of a Gaussian: exp(-11.6) is left */
#define SHADOW_OPAQUE 8.0f /* endless fog is followed to where exp(-8) of the light is left */

/* What is rendered: density is the sum of the constant, the Gaussians and the grid. */
typedef struct shadow_scene {
    const scatter_scene *scene;
    const scatter_gaussian *gaussians; /* summed at every sample */
    size_t gaussian_count;
    const float *values; /* or read from voxels, trilinearly; NULL: none */
    int n[3];
    float scale;
    scatter_box box;   /* of the voxels */
    scatter_box reach; /* where there is medium; of endless fog none */
    int endless;
    scatteri_lobes lobes;
} shadow_scene;

typedef struct shadow_points {
    float x[SHADOW_LANES], y[SHADOW_LANES], z[SHADOW_LANES];
} shadow_points;

SCATTERI_HOT static void shadow_add_gaussians(const shadow_scene *s, const shadow_points *p,
                                              float *density)
{
    for (size_t i = 0; i < s->gaussian_count; i++) {
        const scatter_gaussian g = s->gaussians[i];
        for (int l = 0; l < SHADOW_LANES; l++) {
            float dx = p->x[l] - g.center.x, dy = p->y[l] - g.center.y, dz = p->z[l] - g.center.z;
            density[l] += g.c * scatteri_exp(-g.a * g.a * (dx * dx + dy * dy + dz * dz));
        }
    }
}

/* Place between voxel centres on one axis: index of the lower voxel, and the fraction above it. */
SCATTERI_FN float shadow_place(float x, float low, float high, int n, int *index)
{
    float at = (x - low) / (high - low) * (float)n - 0.5f;
    at = scatteri_min(scatteri_max(at, 0.0f), (float)n - 1.0f);
    *index = (int)scatteri_min(at, (float)n - 2.0f);
    return at - (float)*index;
}

SCATTERI_HOT static void shadow_add_voxels(const shadow_scene *s, const shadow_points *p,
                                           float *density)
{
    const int row = s->n[0], slice = s->n[0] * s->n[1];
    for (int l = 0; l < SHADOW_LANES; l++) {
        int i, j, k;
        float fx = shadow_place(p->x[l], s->box.min.x, s->box.max.x, s->n[0], &i);
        float fy = shadow_place(p->y[l], s->box.min.y, s->box.max.y, s->n[1], &j);
        float fz = shadow_place(p->z[l], s->box.min.z, s->box.max.z, s->n[2], &k);
        const float *v = s->values + (k * slice + j * row + i);
        density[l] +=
            s->scale * scatteri_trilinear(v[0], v[1], v[row], v[row + 1], v[slice], v[slice + 1],
                                          v[slice + row], v[slice + row + 1], fx, fy, fz);
    }
}

static void shadow_density(const shadow_scene *s, const shadow_points *p, float *density)
{
    for (int l = 0; l < SHADOW_LANES; l++)
        density[l] = s->scene->medium.constant;
    shadow_add_gaussians(s, p, density);
    if (s->values)
        shadow_add_voxels(s, p, density);
}

/* The part of a segment on which there is medium; none: t0 = t1. */
static void shadow_clip(const shadow_scene *s, const shadow_points *o, const shadow_points *d,
                        float *t0, float *t1)
{
    const scatter_box b = s->reach;
    for (int l = 0; l < SHADOW_LANES && !s->endless; l++) {
        float ax = (b.min.x - o->x[l]) / d->x[l], bx = (b.max.x - o->x[l]) / d->x[l];
        float ay = (b.min.y - o->y[l]) / d->y[l], by = (b.max.y - o->y[l]) / d->y[l];
        float az = (b.min.z - o->z[l]) / d->z[l], bz = (b.max.z - o->z[l]) / d->z[l];
        float near = fmaxf(fminf(ax, bx), fmaxf(fminf(ay, by), fminf(az, bz)));
        float far = fminf(fmaxf(ax, bx), fminf(fmaxf(ay, by), fmaxf(az, bz)));
        t0[l] = fmaxf(t0[l], near);
        t1[l] = fmaxf(t0[l], fminf(t1[l], far));
    }
}

SCATTERI_HOT static void shadow_walk(const shadow_points *o, const shadow_points *d,
                                     const float *SCATTERI_RESTRICT t,
                                     shadow_points *SCATTERI_RESTRICT x)
{
    for (int l = 0; l < SHADOW_LANES; l++) {
        x->x[l] = o->x[l] + t[l] * d->x[l];
        x->y[l] = o->y[l] + t[l] * d->y[l];
        x->z[l] = o->z[l] + t[l] * d->z[l];
    }
}

/* Sum of the density in the middles of `steps` equal steps. */
static void shadow_march(const shadow_scene *s, const shadow_points *o, const shadow_points *d,
                         const float *t0, const float *t1, int steps, float *depth)
{
    float t[SHADOW_LANES], density[SHADOW_LANES];
    memset(depth, 0, SHADOW_LANES * sizeof *depth);
    for (int i = 0; i < steps; i++) {
        shadow_points x;
        for (int l = 0; l < SHADOW_LANES; l++)
            t[l] = t0[l] + ((float)i + 0.5f) * (t1[l] - t0[l]) / (float)steps;
        shadow_walk(o, d, t, &x);
        shadow_density(s, &x, density);
        for (int l = 0; l < SHADOW_LANES; l++)
            depth[l] += density[l] * (t1[l] - t0[l]) / (float)steps;
    }
}

/* Directions to the light, and p/(r^2 + R^2), or p for a directional one. */
SCATTERI_HOT static void shadow_light(const shadow_scene *s, const scatter_light *light,
                                      const shadow_points *x, const shadow_points *eye,
                                      shadow_points *to, float *r, float *fall)
{
    const int local = light->kind != SCATTER_LIGHT_DIRECTIONAL;
    const scatter_vec3 sun = scatteri_scale(scatteri_normalize(light->direction), -1.0f);
    for (int l = 0; l < SHADOW_LANES; l++) {
        float dx = light->position.x - x->x[l], dy = light->position.y - x->y[l];
        float dz = light->position.z - x->z[l], r2 = dx * dx + dy * dy + dz * dz;
        float inverse = scatteri_rsqrt(scatteri_max(r2, 1e-20f));
        to->x[l] = local ? dx * inverse : sun.x;
        to->y[l] = local ? dy * inverse : sun.y;
        to->z[l] = local ? dz * inverse : sun.z;
        float cosine = to->x[l] * eye->x[l] + to->y[l] * eye->y[l] + to->z[l] * eye->z[l];
        r[l] = local ? r2 * inverse : 1e6f;
        fall[l] = scatteri_phase(s->lobes, 1.0f - cosine) /
                  (local ? r2 + light->radius * light->radius : 1.0f);
    }
}

/* Adds value e^(-sigma depth) for one channel. */
SCATTERI_HOT static void shadow_add(float *SCATTERI_RESTRICT sum, float scale, float sigma,
                                    const float *SCATTERI_RESTRICT value,
                                    const float *SCATTERI_RESTRICT depth)
{
    for (int l = 0; l < SHADOW_LANES; l++)
        sum[l] += scale * value[l] * scatteri_exp(-sigma * depth[l]);
}

/* One sample on the eye rays: every light through its own shadow ray. */
static void shadow_sample(const shadow_scene *s, const shadow_points *x, const shadow_points *d,
                          const float *weight, const float *before, int steps,
                          float rgb[3][SHADOW_LANES])
{
    const scatter_medium *m = &s->scene->medium;
    for (size_t i = 0; i < s->scene->light_count; i++) {
        const scatter_light *light = &s->scene->lights[i];
        const scatter_vec3 k =
            scatteri_mul(scatteri_mul(light->intensity, m->albedo), m->extinction);
        shadow_points to;
        float t0[SHADOW_LANES], r[SHADOW_LANES], value[SHADOW_LANES], depth[SHADOW_LANES];
        shadow_light(s, light, x, d, &to, r, value);
        memset(t0, 0, sizeof t0);
        shadow_clip(s, x, &to, t0, r);
        shadow_march(s, x, &to, t0, r, steps, depth);
        for (int l = 0; l < SHADOW_LANES; l++) {
            value[l] *= weight[l];
            depth[l] += before[l];
        }
        shadow_add(rgb[0], k.x, m->extinction.x, value, depth);
        shadow_add(rgb[1], k.y, m->extinction.y, value, depth);
        shadow_add(rgb[2], k.z, m->extinction.z, value, depth);
    }
}

static void shadow_rays(const shadow_scene *s, const shadow_points *o, const shadow_points *d,
                        int steps, int shadow_steps, float rgb[3][SHADOW_LANES])
{
    const scatter_medium *m = &s->scene->medium;
    float t0[SHADOW_LANES], t1[SHADOW_LANES], t[SHADOW_LANES], density[SHADOW_LANES];
    float depth[SHADOW_LANES], weight[SHADOW_LANES], one[SHADOW_LANES];
    memset(depth, 0, sizeof depth);
    memset(t0, 0, sizeof t0);
    memset(rgb, 0, 3 * sizeof *rgb);
    for (int l = 0; l < SHADOW_LANES; l++) {
        t1[l] = s->endless
                    ? SHADOW_OPAQUE / (m->constant *
                                       scatteri_min(m->extinction.x,
                                                    scatteri_min(m->extinction.y, m->extinction.z)))
                    : 1e6f;
        one[l] = 1;
    }
    shadow_clip(s, o, d, t0, t1);
    for (int i = 0; i < steps; i++) {
        shadow_points x;
        for (int l = 0; l < SHADOW_LANES; l++)
            t[l] = t0[l] + ((float)i + 0.5f) * (t1[l] - t0[l]) / (float)steps;
        shadow_walk(o, d, t, &x);
        shadow_density(s, &x, density);
        for (int l = 0; l < SHADOW_LANES; l++) {
            weight[l] = density[l] * (t1[l] - t0[l]) / (float)steps;
            depth[l] += 0.5f * weight[l];
        }
        shadow_sample(s, &x, d, weight, depth, shadow_steps, rgb);
        for (int l = 0; l < SHADOW_LANES; l++)
            depth[l] += 0.5f * weight[l];
    }
    shadow_add(rgb[0], s->scene->background.x, m->extinction.x, one, depth);
    shadow_add(rgb[1], s->scene->background.y, m->extinction.y, one, depth);
    shadow_add(rgb[2], s->scene->background.z, m->extinction.z, one, depth);
}

/* A square picture of size^2 pixels, 16 of a row at a time; size is a multiple of 16. */
static inline void shadow_image(const shadow_scene *s, const scatter_view *view, int size, int steps,
                         int shadow_steps, float *image)
{
    for (int first = 0; first < size * size; first += SHADOW_LANES) {
        shadow_points o, d;
        float rgb[3][SHADOW_LANES];
        for (int l = 0; l < SHADOW_LANES; l++) {
            int x = (first + l) % size, y = (first + l) / size;
            scatter_ray ray = scatter_view_ray(view, ((float)x + 0.5f) / (float)size,
                                               ((float)y + 0.5f) / (float)size);
            scatter_vec3 u = scatteri_normalize(ray.direction);
            o.x[l] = ray.origin.x, o.y[l] = ray.origin.y, o.z[l] = ray.origin.z;
            d.x[l] = u.x, d.y[l] = u.y, d.z[l] = u.z;
        }
        shadow_rays(s, &o, &d, steps, shadow_steps, rgb);
        for (int l = 0; l < SHADOW_LANES; l++)
            for (int c = 0; c < 3; c++)
                image[3 * (first + l) + c] = rgb[c][l];
    }
}

/* ---------------------------------------------------------------------------------- the scene */

static void shadow_widen(scatter_box *box, scatter_vec3 low, scatter_vec3 high)
{
    box->min.x = fminf(box->min.x, low.x), box->max.x = fmaxf(box->max.x, high.x);
    box->min.y = fminf(box->min.y, low.y), box->max.y = fmaxf(box->max.y, high.y);
    box->min.z = fminf(box->min.z, low.z), box->max.z = fmaxf(box->max.z, high.z);
}

/* Gaussians are summed where they stand; a scene has one grid at most. */
static shadow_scene shadow_scene_of(const scatter_scene *scene)
{
    const scatter_medium *m = &scene->medium;
    shadow_scene s;
    memset(&s, 0, sizeof s);
    s.scene = scene;
    s.lobes = scatteri_lobes_of(&m->phase);
    s.endless = m->constant > 0;
    s.gaussians = m->gaussians;
    s.gaussian_count = m->gaussian_count;
    s.reach.min = scatter_v3(1e30f, 1e30f, 1e30f);
    s.reach.max = scatter_v3(-1e30f, -1e30f, -1e30f);
    for (size_t i = 0; i < m->gaussian_count; i++) {
        const scatter_gaussian g = m->gaussians[i];
        const scatter_vec3 reach = scatteri_scale(scatter_v3(1, 1, 1), SHADOW_REACH / g.a);
        shadow_widen(&s.reach, scatteri_sub(g.center, reach), scatteri_add(g.center, reach));
    }
    if (m->grid_count) {
        const scatter_grid *g = m->grids;
        s.values = g->density;
        s.n[0] = g->nx, s.n[1] = g->ny, s.n[2] = g->nz;
        s.scale = g->scale > 0 ? g->scale : 1;
        s.box = g->box;
        shadow_widen(&s.reach, g->box.min, g->box.max);
    }
    return s;
}

/* The Gaussians injected into n^3 cells, which the rays read instead. `values` takes n^3. */
static inline void shadow_inject(shadow_scene *s, int n, float *values)
{
    scatter_medium local = s->scene->medium;
    scatter_volume volume = {values, n, n, n, s->reach};
    local.constant = 0;
    must(scatter_inject(NULL, &local, &volume), "scatter_inject");
    s->gaussian_count = 0;
    s->values = values;
    s->n[0] = s->n[1] = s->n[2] = n;
    s->scale = 1;
    s->box = s->reach;
}

#endif
