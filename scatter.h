/* scatter.h - physically based fog, smoke and clouds on the CPU. MIT licence, see the end of the file.

   Do this in ONE C or C++ file, and include the header plainly everywhere else:

       #define SCATTER_IMPLEMENTATION
       #include "scatter.h"

   The smallest program:

       scatter_gaussian puff = {{0, 0, 0}, 1.0f, 1.0f};              // centre, inverse width a, amplitude c
       scatter_light lamp = {0};
       lamp.position = scatter_v3(2, 2, -1);
       lamp.intensity = scatter_v3(40, 40, 40);                      // W/sr
       scatter_scene scene = {0};
       scene.medium.extinction = scatter_v3(1, 1, 1);                // 1/m per unit of density
       scene.medium.albedo = scatter_v3(0.9f, 0.9f, 0.9f);
       scene.medium.gaussians = &puff;  scene.medium.gaussian_count = 1;
       scene.lights = &lamp;            scene.light_count = 1;

       scatter_context *fog;
       scatter_create(NULL, &fog);
       scatter_update(fog, &scene, NULL);                            // again whenever the scene changes
       scatter_view view = scatter_view_perspective(scatter_v3(0, 0, -5), scatter_v3(0, 0, 0),
                                                    scatter_v3(0, 1, 0), 0.7f, 1.0f);
       scatter_image image = {0};
       image.width = image.height = 256;
       image.rgb = pixels;                                           // 3*256*256 floats of your own
       scatter_render(fog, &view, &image);
       scatter_destroy(fog);

   What it does
   - Media: constant fog, exponential height fog, any number of Gaussians, voxel grids, all added up, with
     optional bounds; coloured extinction and albedo, emission; isotropic, Henyey-Greenstein, Rayleigh,
     Draine and water-droplet phase functions.
   - Lights: point, spot and directional, any number, shadowed by the medium and by the host's geometry.
   - HDR environment maps as constellations of directional lights.
   - Single scattering, exactly or to a stated error; surfaces lit and seen through the medium.
   - Empty space in voxels is passed, by a map of distances that is renewed with the voxels, without a change of any bit.
   - The same bits for the same input on the same machine and build, with any number of threads.
   - Plans the cheapest quality for a given error, and tells the error of an image.
   What it does not do (yet): multiple scattering, refraction.

   Conventions
   - Lengths in metres, angles in radians, axes right-handed, colours linear RGB.
   - Vectors are structs of three floats. Arrays of cells and voxels are x fastest, then y, then z; the value
     of cell (i,j,k) belongs to the centre of the cell. Image row 0 is the top row, RGB interleaved.
   - `direction` of a light or a ray is where the light or the ray travels to.

     quantity              symbol   unit              in the code
     density               D        1                 constant, height.density, gaussian.c, grid values
     extinction            sigma_t  1/m per unit D    medium.extinction
     albedo                omega    1, 0..1           medium.albedo
     emission              epsilon  W/(m3 sr) per D   medium.emission
     optical depth         tau      m (times D)       "depth": the integral of D along a segment
     transmittance         T        1, 0..1           exp(-sigma_t tau)
     phase function        p        1/sr              integrates to 1 over the sphere
     radiant intensity     I        W/sr              light.intensity of point and spot lights
     irradiance            E        W/m2              light.intensity of directional lights
     radiance              L        W/(m2 sr)         every pixel

   Step by step
   1. Fill a scatter_medium and scatter_lights, put both into a scatter_scene. Zero means the default that is
      stated beside each field, so start from {0}.
   2. scatter_create once; scatter_update when something changed. It compares the scene with the last one and
      redoes only what depends on the change: nothing for a static scene, the depth of one light if only that
      light moved, the injection of the medium if the medium changed. Voxel values are compared by the grid's
      `version`, everything else by value. Arrays and voxels that the scene points to are copied, except the
      voxels, which stay yours and must stay alive and unchanged until the next update.
      quality.lights_per_update spreads that over updates: of the depth volumes that are out of date only so many are
      redone, those first that have been so for longest, so that all are current after lights / lights_per_update
      updates (rounded up). A light that waits keeps its depth of the medium and direction of then; its irradiance and
      phase function, and the density that is seen, are current. What never had a volume is always filled; all are if
      quality.depth or quality.grid changes, or a medium outgrows the box that the volumes of directional lights are for.
   3. scatter_render for images, scatter_radiance for single rays, scatter_depth_* and scatter_inject for the
      stages on their own.
   4. Instead of choosing a scatter_quality, name an error: scatter_plan finds the cheapest quality that keeps it.

   Errors: every call that can fail returns a scatter_result; the reason is handed as one sentence that names
   the field to `host.log`. The library prints nothing. A failed call changes nothing but what it says.
   Memory: through host.allocate/release (default malloc/free), only in scatter_create, scatter_depth_create,
   scatter_update and scatter_depth_update, and there only when something became larger. scatter_render,
   scatter_radiance, scatter_inject and scatter_depth_at never allocate. At most 300 KB of stack. scatter_plan allocates and
   releases a context of its own, scatter_constellation what it works on.
   Threads: none of its own. Long loops are handed to host.parallel_for if there is one. scatter_radiance,
   scatter_depth_at and all functions without a context may be called from any number of threads.
   Determinism: the same bits on the same machine and build for any number of threads; on another processor
   the compiler's choice of instructions (fused multiply-add) moves the last bits.
   Limits: images, grids and volumes are limited by memory and by 2^31-1 cells per axis product.

   Configuration, before including
     SCATTER_IMPLEMENTATION  compile the implementation here
     SCATTER_STATIC          make all functions static: no exported symbols, several copies may coexist; with clang
                             it implies SCATTER_NO_DISPATCH
     SCATTER_NO_DISPATCH     do not compile hot loops for several instruction sets (see "configuration")
*/
#ifndef SCATTER_H
#define SCATTER_H

#include <stddef.h>

#if defined(SCATTER_STATIC) && defined(__GNUC__) && !defined(__TINYC__)
#define SCATTER_API static __attribute__((unused))
#elif defined(SCATTER_STATIC)
#define SCATTER_API static
#else
#define SCATTER_API extern
#endif

#ifdef __cplusplus
extern "C" {
#endif

/* ------------------------------------------------------------------------------------------ >>types */

/* Three floats: a position or vector in metres, or linear RGB. */
typedef struct scatter_vec3 {
    float x, y, z;
} scatter_vec3;

typedef struct scatter_box {
    scatter_vec3 min, max;
} scatter_box;

typedef enum scatter_result {
    SCATTER_OK = 0,
    SCATTER_BAD_ARGUMENT,  /* a field holds a value that has no meaning */
    SCATTER_TOO_LARGE,     /* a product of sizes does not fit into size_t or int */
    SCATTER_OUT_OF_MEMORY, /* host.allocate returned NULL; the object is as before the call or empty */
    SCATTER_CANCELLED,     /* host.progress asked to stop */
    SCATTER_UNSUPPORTED    /* scatter_gl.h: the GL context lacks what the call needs */
} scatter_result;

/* What the library asks of the program around it. Every member may be NULL. */
typedef struct scatter_host {
    void *user; /* handed to all functions below */
    void *(*allocate)(void *user, size_t bytes); /* NULL: malloc; alignment as malloc gives it */
    void (*release)(void *user, void *memory);   /* NULL: free */
    void (*log)(void *user, scatter_result result, const char *sentence);
    /* Call task(data, i) for each i in 0..count-1, on any threads, and return when all are done.
       NULL: a plain loop. */
    void (*parallel_for)(void *user, int count, void (*task)(void *data, int index), void *data);
    /* Called on the calling thread with 0 <= fraction <= 1; a return other than 0 cancels. */
    int (*progress)(void *user, float fraction);
} scatter_host;

/* D(x) = c exp(-a^2 |x - center|^2) */
typedef struct scatter_gaussian {
    scatter_vec3 center;
    float a; /* inverse width, 1/m, > 0; the standard deviation is 1/(sqrt(2) a) */
    float c; /* density at the centre, >= 0 */
} scatter_gaussian;

/* D(x) = density exp(-(x.y - y0) / scale) */
typedef struct scatter_height {
    float density; /* at y0, >= 0 */
    float y0;      /* m */
    float scale;   /* m, > 0: the density falls by e over this height */
} scatter_height;

/* Voxels spread over a box: trilinear between voxel centres, constant in the outer half voxel, zero outside. */
typedef struct scatter_grid {
    const float *density; /* nx*ny*nz values >= 0, x fastest; stays the host's */
    int nx, ny, nz;       /* >= 1 */
    scatter_box box;      /* m */
    float scale;          /* density = value * scale; 0: 1 */
    unsigned version;     /* change it when the values change: what is made from them is made anew */
} scatter_grid;

typedef enum scatter_phase_kind {
    SCATTER_PHASE_ISOTROPIC = 0,
    SCATTER_PHASE_HG,       /* Henyey-Greenstein, g */
    SCATTER_PHASE_RAYLEIGH,
    SCATTER_PHASE_DRAINE,   /* g, alpha: alpha 0 is Henyey-Greenstein; g 0, alpha 1 is Rayleigh */
    SCATTER_PHASE_DROPLETS  /* water droplets by diameter: Jendersie and d'Eon 2023 */
} scatter_phase_kind;

typedef struct scatter_phase {
    scatter_phase_kind kind;
    float g;           /* mean cosine of HG, -0.9999..0.9999 */
    float alpha;       /* of Draine, >= 0 */
    float diameter_um; /* of droplets, micrometres, 0 < d <= 50 */
} scatter_phase;

/* All terms add up. At most one phase function, one extinction and one albedo for all of them. */
typedef struct scatter_medium {
    scatter_vec3 extinction; /* sigma_t, 1/m per unit of density, >= 0 */
    scatter_vec3 albedo;     /* omega, 0..1 */
    scatter_vec3 emission;   /* radiance per metre and unit of density, W/(m3 sr), >= 0 */
    scatter_phase phase;
    int bounded;             /* not 0: the medium is zero outside `bounds` */
    scatter_box bounds;
    float constant;          /* density everywhere, >= 0 */
    const scatter_height *heights;
    size_t height_count;
    const scatter_gaussian *gaussians;
    size_t gaussian_count;
    const scatter_grid *grids;
    size_t grid_count;
} scatter_medium;

typedef enum scatter_light_kind {
    SCATTER_LIGHT_POINT = 0,
    SCATTER_LIGHT_SPOT,
    SCATTER_LIGHT_DIRECTIONAL
} scatter_light_kind;

typedef struct scatter_light {
    scatter_light_kind kind;
    scatter_vec3 position;  /* m; point and spot */
    scatter_vec3 direction; /* spot and directional; any length but 0 */
    scatter_vec3 intensity; /* RGB, >= 0: W/sr of point and spot, W/m2 of directional lights */
    float radius;           /* R of the lamp, m: irradiance I/(r^2 + R^2); 0: an ideal point */
    float inner, outer;     /* half-angles of a spot, 0 <= inner <= outer <= pi: full inside `inner`,
                               smoothstep in the cosine to 0 at `outer` */
} scatter_light;

/* The nearest opaque surface on a ray. Lambert plus Phong: albedo/pi + specular (shininess+2)/(2 pi) cos^shininess
   of the angle to the mirror direction. */
typedef struct scatter_surface {
    float distance; /* along the unit direction of the ray, m, >= 0 */
    scatter_vec3 normal; /* towards the eye; any length but 0 */
    scatter_vec3 albedo;
    scatter_vec3 specular; /* 0: Lambert only */
    float shininess;       /* >= 0 */
} scatter_surface;

/* What surrounds a scene, infinitely far away, as a latitude-longitude map: row 0 looks up (+y),
   the middle column along -z, the columns to its right towards +x. */
typedef struct scatter_environment {
    const float *rgb; /* width*height*3, radiance, W/(m2 sr), linear, 0..1e12 */
    int width, height; /* 1..65536 */
    float scale;       /* of the radiance, 0..1e4; 0: 1 */
} scatter_environment;

/* How an environment becomes directional lights; both take suns out first. With k-means the same
   number of lights has less error (docs/report.md, Skies). */
typedef enum scatter_constellation_method {
    SCATTER_CONSTELLATION_MEDIAN_CUT = 0, /* Debevec 2005: parts of equal energy */
    SCATTER_CONSTELLATION_KMEANS          /* Kollig and Keller 2003: least energy times distance */
} scatter_constellation_method;

/* Everything that sends, scatters or stops light. The callbacks may be called from several threads. */
typedef struct scatter_scene {
    scatter_medium medium;
    const scatter_light *lights;
    size_t light_count;
    scatter_vec3 background; /* radiance behind rays that end nowhere */
    /* Not 0 if nothing opaque lies between p and q (q may be 1e6 m away for a directional light).
       NULL: nothing throws shadows. */
    int (*visible)(void *user, scatter_vec3 p, scatter_vec3 q);
    /* Not 0 if the ray meets a surface, which is then described in *hit. NULL: no surfaces. */
    int (*surface)(void *user, scatter_vec3 origin, scatter_vec3 direction, scatter_surface *hit);
    void *user; /* handed to both */
} scatter_scene;

/* How the optical depth between a light and a point is found. Constant and height fog are always in closed
   form; the method is about Gaussians and grids. Errors are measured in docs/accuracy.md. */
typedef enum scatter_depth_method {
    SCATTER_DEPTH_AUTO = 0,      /* closed for at most 256 Gaussians and no grid, else polar */
    SCATTER_DEPTH_CLOSED,        /* per query, exact: O(Gaussians) and O(voxels on the segment) */
    SCATTER_DEPTH_CLOSED_VOLUME, /* closed form at n^3 cell centres, trilinear in between */
    SCATTER_DEPTH_EQ6,           /* Giroud and Biri 2012 as printed: the inconsistent baseline */
    SCATTER_DEPTH_UPWIND,        /* its consistent form, first order */
    SCATTER_DEPTH_SHORT,         /* short characteristics, bilinear on the upwind face */
    SCATTER_DEPTH_POLAR,         /* running sums along directions around the light, second order; directional lights
                                    share points along the axes: n on the longest side, 4 bytes a light and point (16
                                    for each four lights begun, if more than one), and 4 for the density of all */
    SCATTER_DEPTH_MARCH          /* every cell marches to the light in steps of one cell */
} scatter_depth_method;

/* Where the density on the eye ray comes from. */
typedef enum scatter_density_method {
    SCATTER_DENSITY_AUTO = 0, /* exact for at most 2048 Gaussians, else volume */
    SCATTER_DENSITY_EXACT,    /* the medium itself */
    SCATTER_DENSITY_VOLUME    /* Gaussians and grids injected into n^3 cells: cost independent of their number */
} scatter_density_method;

/* How the integral along the eye ray is taken. */
typedef enum scatter_ray_method {
    SCATTER_RAY_QUADRATURE = 0, /* Gauss-Legendre in panels that follow the medium, sinh map for local lights */
    SCATTER_RAY_MARCH           /* uniform steps, as the papers do */
} scatter_ray_method;

/* Zero, or NULL for a pointer to this, is the default. */
typedef struct scatter_quality {
    scatter_depth_method depth;
    scatter_density_method density;
    scatter_ray_method ray;
    int nodes; /* quadrature: nodes per panel, 1..256; march: steps per ray, 1..4096; 0: 16 */
    int grid;  /* n of depth volumes and of the injected density, 2..1024; 0: 64, 128 for more than 256
                  Gaussians, 3/2 of the voxels along the longest axis of a grid, at most 256; less for many
                  directional lights with polar depth, so that n^3 of all together is 2^26 values, 256 MB */
    int no_distance_map; /* not 0: rays go through empty voxels one by one, instead of passing them by a map of distances
                            (2 bytes a voxel, made anew when the voxels change). Slower, same image: for comparison */
    int no_mask;         /* not 0: light is gathered where there is no density, too: in the march before the first and
                            behind the last density on a ray. Slower, same image: for comparison */
    int lights_per_update; /* depth volumes redone in one scatter_update at most, 0: all that are out of date */
} scatter_quality;

typedef struct scatter_ray {
    scatter_vec3 origin;
    scatter_vec3 direction; /* any length but 0 */
} scatter_ray;

/* What arrives at the origin of a ray. */
typedef struct scatter_sample {
    scatter_vec3 radiance;      /* scattered and emitted by the medium towards the origin, W/(m2 sr) */
    scatter_vec3 transmittance; /* of the medium between the origin and the surface, or to the far end */
    scatter_vec3 surface;       /* radiance leaving the surface, lit through the medium; background if none */
} scatter_sample;               /* seen: radiance + transmittance * surface */

/* Rays of an image: pixel coordinates x, y in 0..1 from the top left give origin + x origin_dx + y origin_dy
   and likewise the direction (any length). Covers perspective, off-axis and orthographic cameras. */
typedef struct scatter_view {
    scatter_vec3 origin, origin_dx, origin_dy;
    scatter_vec3 direction, direction_dx, direction_dy;
} scatter_view;

/* How wrong an image is: RMSE over all pixels and channels, over their mean. */
typedef struct scatter_estimate {
    float error;       /* 0.01: 1 % */
    float uncertainty; /* its standard error: it rests on a sample of the pixels */
    int trusted;       /* 0: the error is larger than 20 %, or gathers in few pixels of the sample, or cells or nodes
                          are far too few for the narrowest features, or the sample is too small */
} scatter_estimate;

typedef struct scatter_image {
    int width, height;      /* pixels of the whole image, >= 1 */
    int x0, y0, x1, y1;     /* region to render, x0 <= x < x1; all zero: everything. Pixels outside stay untouched */
    float *rgb;             /* out: width*height*3, radiance + transmittance * (what lies behind) */
    float *transmittance;   /* out: width*height*3, or NULL */
    const float *distance;  /* in: width*height metres along the pixel's ray at which the host's own picture ends
                               the ray; not > 0, infinite or NaN: it does not. NULL: scene.surface decides */
    const float *color;     /* in: width*height*3, the host's own picture, seen through the medium. NULL:
                               the lit scene.surface and the background */
    scatter_estimate *estimate; /* out: how wrong the region is; costs up to 30 % more time. NULL: not asked for */
} scatter_image;

/* What scatter_plan found. */
typedef struct scatter_forecast {
    scatter_quality quality;   /* for scatter_update */
    scatter_estimate estimate; /* of the image with this quality */
    int kept;                  /* 0: nothing that was tried keeps the budget; this is the most accurate of it */
    float setup_ms, image_ms;  /* of scatter_update and scatter_render, on one core like that of docs/report.md; what
                                  all settings share (checks, copies) is left out */
    float planning_ms;         /* what the planning itself cost, in the same measure */
} scatter_forecast;

/* Values at the centres of nx*ny*nz cells of a box, x fastest; memory of the host. */
typedef struct scatter_volume {
    float *values;
    int nx, ny, nz;
    scatter_box box;
} scatter_volume;

/* Where optical depth is counted from: a light, or an eye. */
typedef struct scatter_source {
    int directional;        /* not 0: infinitely far away, light travels along `direction` */
    scatter_vec3 position;  /* m, if not directional */
    scatter_vec3 direction; /* any length but 0, if directional */
} scatter_source;

typedef struct scatter_tone {
    float key;         /* grey that the log-average luminance becomes; 0: 0.18 */
    float white;       /* scaled luminance that becomes 1; 0: none, only infinity does */
    float log_average; /* of the luminance; 0: taken from the image. Keep it to avoid flicker between images */
} scatter_tone;

/* Counters since scatter_create: what was really redone. */
typedef struct scatter_stats {
    unsigned injections;   /* of the medium into the density volume */
    unsigned propagations; /* of optical depth, one for each light */
    size_t bytes;          /* held now */
} scatter_stats;

typedef struct scatter_context scatter_context;
typedef struct scatter_depth scatter_depth;

/* -------------------------------------------------------------------------------------- >>functions */

/* Components in order. */
SCATTER_API scatter_vec3 scatter_v3(float x, float y, float z);

/* Density D at x, 1. O(terms). Relative error below 1e-5 of each term. */
SCATTER_API float scatter_density(const scatter_medium *medium, scatter_vec3 x);

/* Optical depth tau between p and q, m (times density): the exact integral of D, closed form for constant,
   height fog and Gaussians, cell by cell for grids. Relative error below 1e-5; on a grid of n voxels along an axis
   up to n 1e-7 of a voxel's change more, because voxel coordinates are floats.
   O(terms + voxels on the segment). */
SCATTER_API float scatter_optical_depth(const scatter_medium *medium, scatter_vec3 p, scatter_vec3 q);

/* Phase function p(cos_theta), 1/sr; cos_theta is between the directions of travel before and after. */
SCATTER_API float scatter_phase_value(const scatter_phase *phase, float cos_theta);

/* Samples the density of the medium at the cell centres of the volume (not averaged over cells).
   Gaussians are culled to their support, so the cost is that of the cells they overlap: one
   multiplication per overlapped cell, plus one pass over the volume for constant, height fog and grids. */
SCATTER_API scatter_result scatter_inject(const scatter_host *host, const scatter_medium *medium,
                                          const scatter_volume *volume);

/* Optical depth from one source to any point, by one of the methods. `host` may be NULL and is copied. */
SCATTER_API scatter_result scatter_depth_create(const scatter_host *host, scatter_depth **depth);
SCATTER_API void scatter_depth_destroy(scatter_depth *depth);
/* Prepares the method for this medium and source (quality.depth and quality.grid count; NULL: defaults).
   The medium's arrays are copied, its voxels are not. Cost and memory: docs/accuracy.md. */
SCATTER_API scatter_result scatter_depth_update(scatter_depth *depth, const scatter_medium *medium,
                                                const scatter_source *source, const scatter_quality *quality);
/* Optical depth between the source and x, m (times density). */
SCATTER_API float scatter_depth_at(const scatter_depth *depth, scatter_vec3 x);

/* `count` (1..256) directional lights that stand for an environment. Each gets a part of the map:
   its intensity is the integral of the radiance over the part's solid angle, its direction the
   centroid by luminance. So the intensities add up to the integral of the map, whatever the count.
   A sun (within 2 degrees at least as much light as each other light gets) becomes a light of its
   own, first in the list. Lights that nothing is left for are black and shine down.
   Moving the map by whole columns turns the lights of the median cut; those of k-means, too, by
   whole cells (1/128 of the width). Allocates, and releases again, 4 bytes per texel (16 in maps
   of less than 128 by 64, which are cut finer first), 0.3 MB for k-means, and tables of rows and
   columns. O(texels log count), on the calling thread; times are in docs/report.md. `host` may be
   NULL. On failure `lights` stay as they are. */
SCATTER_API scatter_result scatter_constellation(const scatter_host *host,
                                                 const scatter_environment *map,
                                                 scatter_constellation_method method, int count,
                                                 scatter_light *lights);

/* The lights turned about an axis through the origin (any length; 0: not turned) by `angle`, rad,
   right-handed: their directions, and the positions of point and spot lights. So a sky turns
   without a new constellation. `turned` may be `lights`. */
SCATTER_API void scatter_turn_lights(const scatter_light *lights, size_t count, scatter_vec3 axis,
                                     float angle, scatter_light *turned);

/* Radiance that comes from where `direction` (any length but 0) looks to, W/(m2 sr): bilinear
   between the centres of texels, around the seam, constant beyond the outermost rows. */
SCATTER_API scatter_vec3 scatter_environment_radiance(const scatter_environment *map,
                                                      scatter_vec3 direction);

/* A context holds one scene, prepared for rays. `host` may be NULL and is copied. */
SCATTER_API scatter_result scatter_create(const scatter_host *host, scatter_context **context);
SCATTER_API void scatter_destroy(scatter_context *context);
/* Takes over a scene; redoes only what changed. On failure the context renders nothing until the next
   successful update. */
SCATTER_API scatter_result scatter_update(scatter_context *context, const scatter_scene *scene,
                                          const scatter_quality *quality);
SCATTER_API scatter_stats scatter_get_stats(const scatter_context *context);

/* One ray through the scene; `hit` ends it at a surface of the host, NULL asks scene.surface. */
SCATTER_API scatter_result scatter_radiance(const scatter_context *context, const scatter_ray *ray,
                                            const scatter_surface *hit, scatter_sample *sample);

/* An image or a region of it, through pixel centres. */
SCATTER_API scatter_result scatter_render(const scatter_context *context, const scatter_view *view,
                                          const scatter_image *image);

/* The cheapest quality (depth method and grid, ray method and nodes; setup and one image together) that keeps the error
   of an image within `budget`, relative RMSE, 1e-5..1; 0.01: 1 %. Tries settings on a sample of the image's packets:
   that costs a few images where they are small, one or two where they are large; see forecast.planning_ms.
   image: as for scatter_render; the pixels of its region serve as scratch memory, `estimate` and `transmittance` stay
   untouched. `host` may be NULL; allocates what scatter_create and scatter_update do and releases it. Same bits
   with any number of threads. */
SCATTER_API scatter_result scatter_plan(const scatter_host *host, const scatter_scene *scene,
                                        const scatter_view *view, const scatter_image *image,
                                        float budget, scatter_forecast *forecast);

/* Views. fov_y: vertical field of view, radians, 0..pi; height: of the view, m; aspect: width / height.
   Image right is forward x up. */
SCATTER_API scatter_view scatter_view_perspective(scatter_vec3 eye, scatter_vec3 target, scatter_vec3 up,
                                                  float fov_y, float aspect);
SCATTER_API scatter_view scatter_view_orthographic(scatter_vec3 eye, scatter_vec3 target, scatter_vec3 up,
                                                   float height, float aspect);
/* The ray through x, y in 0..1 from the top left. */
SCATTER_API scatter_ray scatter_view_ray(const scatter_view *view, float x, float y);

/* Reinhard's photographic operator on `pixels` RGB triples, in place allowed; the result is linear, 0..1 where
   the luminance is below `white`. */
SCATTER_API void scatter_tone_map(const scatter_tone *tone, const float *rgb, size_t pixels, float *out);
/* exp of the mean log luminance of the pixels brighter than 0; 0 if there is none. */
SCATTER_API float scatter_log_average(const float *rgb, size_t pixels);
/* Linear 0..1 to an sRGB byte; values outside are clamped, NaN is 0. */
SCATTER_API unsigned char scatter_srgb8(float linear);

#ifdef __cplusplus
}

/* C++: from whatever has x, y and z, such as glm::vec3. */
extern "C++" {
template <class V> inline scatter_vec3 scatter_v3(const V &v)
{
    return scatter_v3(static_cast<float>(v.x), static_cast<float>(v.y), static_cast<float>(v.z));
}
}
#endif
#endif /* SCATTER_H */

/* ========================================================================================== IMPLEMENTATION
   Data flows one way through the chapters:
   core -> log -> memory -> environment -> medium -> depth -> source -> ray -> image ->
   validation -> plan -> public. */
#ifdef SCATTER_IMPLEMENTATION
#ifndef SCATTER_IMPLEMENTED
#define SCATTER_IMPLEMENTED

#include <float.h>
#include <limits.h>
#include <math.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* ---------------------------------------------------------------------------------- >>configuration */

#if defined(__GNUC__) || defined(_MSC_VER)
#define SCATTERI_RESTRICT __restrict
#elif defined(__cplusplus) || defined(__TINYC__)
#define SCATTERI_RESTRICT
#else
#define SCATTERI_RESTRICT restrict
#endif

/* Hot loops are compiled for SSE2, AVX2+FMA and AVX-512, and the loader picks one, where gcc and clang offer
   that (x86-64 glibc). Sanitizers run before such a choice can be made, so they get the plain code. */
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define SCATTERI_SANITIZED
#elif defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer) || __has_feature(memory_sanitizer)
#define SCATTERI_SANITIZED
#endif
#endif
#if defined(__clang__) /* it gives what chooses among the copies of a static function a name that all units share */
#if __clang_major__ >= 14 && !defined(SCATTER_STATIC)
#define SCATTERI_CAN_DISPATCH
#endif
#elif defined(__GNUC__)
#if __GNUC__ >= 12
#define SCATTERI_CAN_DISPATCH
#endif
#endif
#if defined(SCATTERI_CAN_DISPATCH) && !defined(SCATTERI_SANITIZED) && !defined(SCATTER_NO_DISPATCH) && \
    defined(__x86_64__) && defined(__GLIBC__)
#define SCATTERI_HOT __attribute__((target_clones("default", "arch=x86-64-v3", "arch=x86-64-v4")))
#else
#define SCATTERI_HOT
#endif

enum {
    SCATTERI_LANES = 16,    /* rays or points that the hot loops work on at a time: one AVX-512 register */
    SCATTERI_ROWS = 16,     /* nodes of a ray at a time */
    SCATTERI_POINTS = SCATTERI_ROWS * SCATTERI_LANES,
    SCATTERI_PAGE = 128,    /* Gaussians prepared for 16 rays at a time */
    SCATTERI_NODES = 256,   /* nodes of one panel */
    SCATTERI_PROFILE = 768, /* samples of voxel density along one ray */
    SCATTERI_STEPS = 4096,  /* of the march */
    SCATTERI_CHUNKS = 50,   /* reports of progress in one stage */
    SCATTERI_SLABS = 16,    /* parts of a volume that are filled one by one, or by so many threads */
    SCATTERI_NONE = 65535   /* distance in an empty grid */
};

#define SCATTERI_FAR 1e30f    /* length of a segment that never ends: finite, so that 0 * far is 0 */
#define SCATTERI_HORIZON 1e6f /* m: beyond this, unbounded media are cut off */
#define SCATTERI_QUICK 32.0f  /* sigma_t times half a Gaussian's depth up to which its erf may be off by 4e-7 */
#define SCATTERI_VOXELS 16.0f /* voxels to a panel of `nodes` nodes */
#define SCATTERI_NARROW 0.9f  /* g from which on a ray is never one panel, see scatteri_one_panel */
#define SCATTERI_OPAQUE 18.0f /* sigma_t tau at which the rest of a ray is dropped: T = 1.5e-8 */

/* ------------------------------------------------------------------------------------ >>prelude */

/* What the core needs from the language; GLSL has its own prelude in scatter_gl.h. The elementary
   functions call no libm and do not branch, so that gcc and clang vectorise loops over them with
   their default flags. Errors here and in the core are relative, and for normal floats: results
   below 1.2e-38 may be 0. tests/test_core.c measures each of them. */
#include <math.h>
#include <string.h>

#if defined(__GNUC__) && !defined(__TINYC__)
#define SCATTERI_FN static __inline__ __attribute__((always_inline, unused))
#else
#define SCATTERI_FN static __inline
#endif

#define SCATTERI_STRUCT(name) \
    typedef struct name name; \
    struct name
#define SCATTERI_FLOAT(x) ((float)(x))
#define SCATTERI_REAL(x) ((double)(x))
typedef double scatteri_real; /* float in GLSL; for what is computed once, not per node */

typedef struct scatteri_vec2 {
    float x, y;
} scatteri_vec2;

SCATTERI_FN scatteri_vec2 scatteri_v2(float x, float y) {
    scatteri_vec2 v;
    v.x = x, v.y = y;
    return v;
}

SCATTERI_FN scatter_vec3 scatteri_v3(float x, float y, float z) {
    scatter_vec3 v;
    v.x = x, v.y = y, v.z = z;
    return v;
}

SCATTERI_FN unsigned scatteri_bits(float x) {
    unsigned u;
    memcpy(&u, &x, sizeof u);
    return u;
}

SCATTERI_FN float scatteri_from_bits(unsigned u) {
    float x;
    memcpy(&x, &u, sizeof x);
    return x;
}

/* a if x < y, else b. Both are computed; said with bits, because gcc moves the arms of ?: into
   branches and then does not vectorise. */
SCATTERI_FN float scatteri_choose(float x, float y, float a, float b) {
    unsigned mask = 0u - (unsigned)(x < y);
    return scatteri_from_bits((scatteri_bits(a) & mask) | (scatteri_bits(b) & ~mask));
}

SCATTERI_FN float scatteri_abs(float x) {
    return scatteri_from_bits(scatteri_bits(x) & 0x7FFFFFFFu);
}

SCATTERI_FN float scatteri_min(float a, float b) {
    return scatteri_choose(a, b, a, b);
}

SCATTERI_FN float scatteri_max(float a, float b) {
    return scatteri_choose(b, a, a, b);
}

/* min(x, top) for top >= 0: positive floats are ordered as their bits, negative ones below. */
SCATTERI_FN float scatteri_cap(float x, float top) {
    int b = (int)scatteri_bits(x);
    int t = (int)scatteri_bits(top);
    return scatteri_from_bits((unsigned)(b < t ? b : t));
}

/* Nearest to x in [-top, top], top >= 0. The bits of negative floats, taken as unsigned, are above those of positive
   ones and ordered by size. */
SCATTERI_FN float scatteri_within(float x, float top) {
    unsigned b = scatteri_bits(scatteri_cap(x, top));
    unsigned low = scatteri_bits(-top);
    return scatteri_from_bits(b < low ? b : low);
}

/* Largest integer <= x; |x| < 2^31. */
SCATTERI_FN float scatteri_floor(float x) {
    float t = (float)(int)x;
    return t - scatteri_choose(x, t, 1.0f, 0.0f);
}

/* e^f for |f| <= log(2)/2. */
SCATTERI_FN float scatteri_exp_near_0(float f) {
    float p = 0.001392618359f;
    p = p * f + 0.008363179053f;
    p = p * f + 0.04166655462f;
    p = p * f + 0.1666657699f;
    p = p * f + 0.5f;
    p = p * f + 1.0f;
    return p * f + 1.0f;
}

/* e^x = 2^n e^f with |f| <= log(2)/2. Error 1e-7; 0 below x = -87.336, 2.4e38 above x = 88.37.
   The bits of x/log(2) + 1.5 2^23 hold n; it is read from there, not from the sum, which x87 keeps
   unrounded. */
SCATTERI_FN float scatteri_exp(float x) {
    float y = scatteri_choose(x, -87.336f, -88.0f, scatteri_cap(x, 88.37f));
    unsigned b = scatteri_bits(y * 1.44269504f + 12582912.0f);
    float n = (float)(int)(b - 0x4B400000u);
    float f = (y - n * 0.693359375f) + n * 2.12194440e-4f;
    return scatteri_exp_near_0(f) * scatteri_from_bits((b + 127u) << 23);
}

/* e^-x for x >= 0, without the care for other x: error 1e-7 up to 87, then 1.7e-38 instead of 0. */
SCATTERI_FN float scatteri_decay(float x) {
    float y = scatteri_cap(x, 87.0f);
    unsigned b = scatteri_bits(y * -1.44269504f + 12582912.0f);
    float n = (float)(int)(b - 0x4B400000u);
    float f = n * 2.12194440e-4f - (y + n * 0.693359375f);
    return scatteri_exp_near_0(f) * scatteri_from_bits((b + 127u) << 23);
}

/* 1/sqrt(x) for 1.2e-38 <= x <= 3.4e38, error 1.5e-7; finite at 0. */
SCATTERI_FN float scatteri_rsqrt(float x) {
    float y = scatteri_from_bits(0x5F375A86u - (scatteri_bits(x) >> 1));
    float r = 1.0f - (x * y) * y;
    y = y + y * (r * (0.5f + 0.375f * r));
    r = 1.0f - (x * y) * y;
    return y + y * (0.5f * r);
}

/* sqrt(x) for 0 <= x <= 3.4e38, error 1.7e-7; 0 below 1.2e-38. */
SCATTERI_FN float scatteri_sqrt(float x) {
    float s = x * scatteri_rsqrt(x);
    return scatteri_choose(x, 1.175494351e-38f, 0.0f, s);
}

/* log(x) for 1.2e-38 <= x <= 3.4e38, error 1.2e-7: x = 2^n (1 + f), sqrt(1/2) <= 1 + f < sqrt(2).
   The polynomials here and below are own fits, nearly minimax, where no source is named. */
SCATTERI_FN float scatteri_log(float x) {
    unsigned u = scatteri_bits(x) - 0x3F3504F3u;
    float n = (float)((int)((u >> 23) ^ 0x100u) - 0x100);
    float f = scatteri_from_bits((u & 0x7FFFFFu) + 0x3F3504F3u) - 1.0f;
    float p = 0.06971611471f;
    p = p * f - 0.1147973385f;
    p = p * f + 0.1168541992f;
    p = p * f - 0.1242568733f;
    p = p * f + 0.1424905765f;
    p = p * f - 0.1666780232f;
    p = p * f + 0.2000071575f;
    p = p * f - 0.2499999696f;
    p = p * f + 0.3333333118f;
    p = p * f * f * f - 0.5f * f * f;
    return (p - n * 2.12194440e-4f + f) + n * 0.693359375f;
}

/* --------------------------------------------------------------------------------------- >>core */

/* >>core begin: everything down to ">>core end" is C99 and GLSL at once: scalars and small structs
   by value, functions instead of operators on vectors, no pointers. `make glsl` copies it into
   scatter_gl.h; the stated errors are those of C, GLSL adds those of its own exp, log and so on. */

/* >>core: vector */

SCATTERI_FN scatter_vec3 scatteri_add(scatter_vec3 a, scatter_vec3 b) {
    return scatteri_v3(a.x + b.x, a.y + b.y, a.z + b.z);
}

SCATTERI_FN scatter_vec3 scatteri_sub(scatter_vec3 a, scatter_vec3 b) {
    return scatteri_v3(a.x - b.x, a.y - b.y, a.z - b.z);
}

SCATTERI_FN scatter_vec3 scatteri_scale(scatter_vec3 v, float s) {
    return scatteri_v3(v.x * s, v.y * s, v.z * s);
}

SCATTERI_FN scatter_vec3 scatteri_mul(scatter_vec3 a, scatter_vec3 b) {
    return scatteri_v3(a.x * b.x, a.y * b.y, a.z * b.z);
}

SCATTERI_FN float scatteri_dot(scatter_vec3 a, scatter_vec3 b) {
    return a.x * b.x + a.y * b.y + a.z * b.z;
}

SCATTERI_FN scatter_vec3 scatteri_cross(scatter_vec3 a, scatter_vec3 b) {
    return scatteri_v3(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x);
}

SCATTERI_FN float scatteri_length(scatter_vec3 v) {
    return scatteri_sqrt(scatteri_dot(v, v));
}

/* Unit length to 4e-7; for lengths 1e-19..1e19. */
SCATTERI_FN scatter_vec3 scatteri_normalize(scatter_vec3 v) {
    return scatteri_scale(v, scatteri_rsqrt(scatteri_dot(v, v)));
}

/* >>core: erf */

/* exp(-x^2), error 2e-7, 0 for |x| > 9.34. x^2 is split into the exact square of 12 bits and a
   rest: rounded as a whole it would cost x^2 units in the last place. */
SCATTERI_FN float scatteri_bell(float x) {
    float y = scatteri_cap(scatteri_abs(x), 10.0f);
    float c = scatteri_floor(y * 256.0f) * 0.00390625f;
    float r = (y - c) * (y + c);
    float e = 1.0f - r * (1.0f - r * (0.5f - r * (0.16666667f - r * 0.041666667f)));
    return scatteri_exp(-c * c) * e;
}

/* exp(x^2) erfc(x) for 0 <= x <= 1e30, error 3e-7: (x + 2) times it is fitted by a polynomial in
   (x - 2)/(x + 2). */
SCATTERI_FN float scatteri_erfcx(float x) {
    float t = 1.0f / (x + 2.0f);
    float s = (x - 2.0f) * t;
    float p = 8.554996982e-5f;
    p = p * s + 7.334352529e-5f;
    p = p * s - 6.021006906e-4f;
    p = p * s - 8.617089491e-4f;
    p = p * s + 0.003061419881f;
    p = p * s + 0.00648721553f;
    p = p * s - 0.02150439534f;
    p = p * s - 0.03644342555f;
    p = p * s + 0.2794716099f;
    p = p * s - 0.6871606318f;
    p = p * s + 1.021582711f;
    return p * t;
}

/* erf(x), error 2e-7: odd polynomial below 1, complement above. */
SCATTERI_FN float scatteri_erf(float x) {
    float y = scatteri_cap(scatteri_abs(x), 10.0f);
    float z = y * y;
    float p = 7.875875063e-5f;
    p = p * z - 0.0008016864287f;
    p = p * z + 0.005189087423f;
    p = p * z - 0.02685421201f;
    p = p * z + 0.1128359472f;
    p = p * z - 0.3761262667f;
    p = y * (p * z + 1.128379166f);
    p = scatteri_choose(y, 1.0f, p, 1.0f - scatteri_bell(y) * scatteri_erfcx(y));
    return scatteri_choose(x, 0.0f, -p, p);
}

/* >>core: span */

/* Integral of exp(-s^2) over [m - r, m + r] divided by 2 r exp(-m^2), for r < 0.35 and m r < 0.25:
   the Taylor series in r, the sum of H_2k(m) r^2k / (2k + 1)! with Hermite's polynomials, written
   in q = (m r)^2 and p = r^2. */
SCATTERI_FN float scatteri_bell_mean(float m, float r) {
    float p = r * r;
    float q = (m * r) * (m * r);
    float s1 = 4.0f * q - 2.0f * p;
    float s2 = (16.0f * q - 48.0f * p) * q + 12.0f * p * p;
    float s3 = ((64.0f * q - 480.0f * p) * q + 720.0f * p * p) * q - 120.0f * p * p * p;
    float s4 = (((256.0f * q - 3584.0f * p) * q + 13440.0f * p * p) * q - 13440.0f * p * p * p) * q;
    s4 = s4 + 1680.0f * p * p * p * p;
    float high = s3 * 1.984127e-4f + s4 * 2.7557319e-6f;
    return 1.0f + (s1 * 0.16666667f + s2 * 0.0083333333f + high);
}

/* erf(y) - erf(x) for x <= y with the half length r = (y - x)/2 given apart, because a short one
   has no digits left in x and y. Short intervals by their mean, the others by erfc of both ends,
   which cancels in no tail. */
SCATTERI_FN float scatteri_erf_span(float x, float y, float r) {
    float m = 0.5f * (x + y);
    float c = scatteri_abs(m);
    float a = scatteri_choose(m, 0.0f, -y, x);
    float b = scatteri_cap(scatteri_choose(m, 0.0f, -x, y), 10.0f);
    float d = scatteri_cap(scatteri_abs(a), 10.0f);
    float size = scatteri_max(r * 0.71428571f, c * r);
    float e = scatteri_bell(scatteri_choose(size, 0.25f, c, d));
    float inner = e * scatteri_erfcx(d);
    float outer = scatteri_bell(b) * scatteri_erfcx(b);
    float wide = scatteri_choose(a, 0.0f, (2.0f - inner) - outer, inner - outer);
    float slip = m * ((x - m) + (y - m)); /* what the rounding of m costs */
    float mean = scatteri_bell_mean(c, r) * (1.0f - slip);
    return scatteri_choose(size, 0.25f, 2.2567583f * r * e * mean, wide);
}

/* erf(y) - erf(x) for x <= y, error 5e-7 as long as the end nearer to 0 is within 8.5. */
SCATTERI_FN float scatteri_erf_difference(float x, float y) {
    return scatteri_erf_span(x, y, 0.5f * (y - x));
}

/* >>core: quick */

/* erf(x) = over/under at z = x^2 for |x| <= 3.6, where erf is 1 - 3.6e-7: an own rational fit for
   inner loops. The error, 6e-7, is absolute, not relative. Differences of two take one division. */
SCATTERI_FN float scatteri_erf_over(float x, float z) {
    float p = -1.35163461e-6f;
    p = p * z + 2.17444422e-4f;
    p = p * z + 0.00823691029f;
    p = p * z + 0.065270427f;
    p = p * z + 0.315476252f;
    return x * (p * z + 1.128378f);
}

SCATTERI_FN float scatteri_erf_under(float z) {
    float q = 0.00195366527f;
    q = q * z + 0.0237960973f;
    q = q * z + 0.162197119f;
    q = q * z + 0.612903195f;
    return q * z + 1.0f;
}

/* >>core: integrals */

/* Integral over t in [0, len] of c exp(-a^2 (h2 + (t - m)^2)): optical depth of a Gaussian on a
   segment, m along the segment to the point closest to the centre, h2 the squared distance there,
   1e-15 <= a <= 1e15. Error 5e-7 (1 + E) where E is the exponent, a^2 times the squared distance,
   at the nearest point of the segment: as much as the rounding of the arguments costs. */
SCATTERI_FN float scatteri_gauss_depth(float a, float c, float h2, float m, float len) {
    float e = scatteri_exp(-(a * (a * h2)));
    float s = scatteri_erf_span(-a * m, a * (len - m), 0.5f * a * len);
    return c * e * s * (0.88622693f / a);
}

/* (exp(x) - 1)/x, 1 at 0, for -1e30 <= x <= 80; error 2e-7. */
SCATTERI_FN float scatteri_exprel(float x) {
    float size = scatteri_abs(x);
    float y = scatteri_choose(size, 0.5f, x, 0.0f);
    float d = scatteri_choose(size, 0.5f, 1.0f, x);
    float p = 0.0001996217623f;
    p = p * y + 0.001399777338f;
    p = p * y + 0.008333182072f;
    p = p * y + 0.04166530419f;
    p = p * y + 0.1666666714f;
    p = p * y + 0.5000000426f;
    p = p * y + 1.0f;
    return scatteri_choose(size, 0.5f, p, (scatteri_exp(x) - 1.0f) / d);
}

/* Integral over t in [0, len] of density exp(-(y + dy t - y0)/scale), from the lower and denser
   end. Error 4e-7 (1 + E), E = (|y0| + |y| + |dy| len)/scale, while the exponent stays below 88. */
SCATTERI_FN float scatteri_height_depth(float density, float y0, float scale, float y, float dy,
                                        float len) {
    float low = scatteri_min(y, y + dy * len);
    float e = scatteri_exp((y0 - low) / scale);
    return density * e * (len * scatteri_exprel(-scatteri_abs(dy) * len / scale));
}

/* >>core: phase */

/* One or two Draine lobes: (1 - weight) lobe 1 + weight lobe 2. */
SCATTERI_STRUCT(scatteri_lobes) {
    float g1, alpha1, g2, alpha2, weight;
};

/* Draine's phase function, 1/sr, of omc = 1 - cos theta, which keeps the digits of narrow lobes;
   |g| <= 0.9999, error 1e-6. alpha 0: Henyey-Greenstein; g 0, alpha 1: Rayleigh. Draine 2003,
   "Scattering by Interstellar Dust Grains. I. Optical and Ultraviolet". */
SCATTERI_FN float scatteri_draine(float g, float alpha, float omc) {
    float h = scatteri_abs(g);
    float o = scatteri_choose(g, 0.0f, 2.0f - omc, omc);
    float r = scatteri_rsqrt((1.0f - h) * (1.0f - h) + 2.0f * h * o);
    float k = 1.0f - omc;
    float n = (1.0f - h) * (1.0f + h) * (1.0f + alpha * k * k);
    return 0.079577472f * n * (r * r * r) / (1.0f + alpha * (1.0f + 2.0f * g * g) * 0.33333333f);
}

SCATTERI_FN float scatteri_phase(scatteri_lobes p, float omc) {
    return (1.0f - p.weight) * scatteri_draine(p.g1, p.alpha1, omc) +
           p.weight * scatteri_draine(p.g2, p.alpha2, omc);
}

/* 1 - cos of the angle between unit vectors, without cancellation for small angles. */
SCATTERI_FN float scatteri_omc(scatter_vec3 a, scatter_vec3 b) {
    scatter_vec3 d = scatteri_sub(a, b);
    return 0.5f * scatteri_dot(d, d);
}

/* A single lobe. */
SCATTERI_FN scatteri_lobes scatteri_lobe(float g, float alpha) {
    scatteri_lobes p;
    p.g1 = g;
    p.alpha1 = alpha;
    p.g2 = 0.0f;
    p.alpha2 = 0.0f;
    p.weight = 0.0f;
    return p;
}

/* >>core: droplets */

/* From numbers in the language's own precision. */
SCATTERI_FN scatteri_lobes scatteri_two_lobes(scatteri_real g1, scatteri_real g2,
                                              scatteri_real alpha2, scatteri_real weight) {
    scatteri_lobes p;
    p.g1 = SCATTERI_FLOAT(g1);
    p.alpha1 = 0.0f;
    p.g2 = SCATTERI_FLOAT(g2);
    p.alpha2 = SCATTERI_FLOAT(alpha2);
    p.weight = SCATTERI_FLOAT(weight);
    return p;
}

/* Water droplets of diameter d in micrometres, 0 < d <= 50: Henyey-Greenstein plus Draine by
   Jendersie and d'Eon 2023, "An Approximate Mie Scattering Function for Fog and Cloud Rendering".
   Their four ranges; l is log d. */
SCATTERI_FN scatteri_lobes scatteri_droplets_mist(scatteri_real d, scatteri_real l) {
    scatteri_real g2 = 1.1456f * d * sin(9.29044f * d);
    return scatteri_two_lobes(13.8f * d * d, g2, 250.0f, 0.252977f - 312.983f * exp(4.3f * l));
}

SCATTERI_FN scatteri_lobes scatteri_droplets_small(scatteri_real l) {
    scatteri_real wave = cos((l - 0.238604f) * (l + 1.00667f) / (0.507522f - 0.15677f * l));
    scatteri_real g2 = 0.379685f * cos(1.19692f * wave + 1.37932f * l + 0.0625835f) + 0.344213f;
    scatteri_real weight = 0.146209f * cos(3.38707f * l + 2.11193f) + 0.316072f + 0.0778917f * l;
    return scatteri_two_lobes(0.862f - 0.143f * l * l, g2, 250.0f, weight);
}

SCATTERI_FN scatteri_lobes scatteri_droplets_middle(scatteri_real l) {
    scatteri_real g2 = 0.500411f - 0.081287f / (-2.0f * l + tan(l) + 1.27551f);
    scatteri_real wave = cos(5.68947f * (log(l) - 0.0292149f));
    return scatteri_two_lobes(0.0604931f * log(l) + 0.940256f, g2, 7.30354f * l + 6.31675f,
                              0.026914f * (l - wave) + 0.376475f);
}

SCATTERI_FN scatteri_lobes scatteri_droplets_large(scatteri_real d) {
    scatteri_real g2 = exp(-2.20679f / (d + 3.91029f) - 0.428934f);
    scatteri_real alpha2 = exp(3.62489f - 8.29288f / (d + 5.52825f));
    scatteri_real weight = exp(-0.599085f / (d - 0.641583f) - 0.665888f);
    return scatteri_two_lobes(exp(-0.0990567f / (d - 1.67154f)), g2, alpha2, weight);
}

SCATTERI_FN scatteri_lobes scatteri_droplets(float diameter_um) {
    scatteri_real d = diameter_um;
    scatteri_real l = log(d);
    if (diameter_um <= 0.1f)
        return scatteri_droplets_mist(d, l);
    if (diameter_um < 1.5f)
        return scatteri_droplets_small(l);
    if (diameter_um < 5.0f)
        return scatteri_droplets_middle(l);
    return scatteri_droplets_large(d);
}

/* >>core: maps */

/* The map of the eye ray: t = t0 + d sinh(u), dt = d cosh(u) du. */

/* asinh(x), |x| <= 1e18, error 3.5e-7. */
SCATTERI_FN float scatteri_asinh(float x) {
    float y = scatteri_abs(x);
    float z = scatteri_cap(y * y, 1.0f);
    float p = -0.01307441524f;
    p = p * z + 0.02806019724f;
    p = p * z - 0.04435832065f;
    p = p * z + 0.07498380894f;
    p = p * z - 0.1666663246f;
    p = y * (p * z + 0.9999999988f);
    p = scatteri_choose(y, 0.5f, p, scatteri_log(y + scatteri_sqrt(y * y + 1.0f)));
    return scatteri_choose(x, 0.0f, -p, p);
}

/* sinh(u), |u| <= 88, error 2e-7. */
SCATTERI_FN float scatteri_sinh(float u) {
    float z = scatteri_cap(u * u, 1.0f);
    float p = 2.819018793e-6f;
    p = p * z + 1.983571388e-4f;
    p = p * z + 8.333353206e-3f;
    p = p * z + 0.1666666642f;
    p = u + u * z * p;
    return scatteri_choose(u * u, 1.0f, p, 0.5f * scatteri_exp(u) - 0.5f * scatteri_exp(-u));
}

/* cosh(u), |u| <= 88, error 2e-7. */
SCATTERI_FN float scatteri_cosh(float u) {
    return 0.5f * scatteri_exp(u) + 0.5f * scatteri_exp(-u);
}

/* Node in (-1, 1), ascending with i = 0..n-1, and weight (they sum to 2) of Gauss-Legendre
   quadrature with n = 1..256 nodes: Newton's method from Tricomi's guess. O(n). */
SCATTERI_FN scatteri_vec2 scatteri_legendre(int i, int n) {
    scatteri_real m = SCATTERI_REAL(n);
    scatteri_real x = -cos(3.14159265f * (SCATTERI_REAL(i) + 0.75f) / (m + 0.5f)) *
                      (1.0f - (m - 1.0f) / (8.0f * m * m * m));
    scatteri_real slope = 1.0f;
    for (int turn = 0; turn < 4; turn++) {
        scatteri_real before = 0.0f;
        scatteri_real p = 1.0f;
        for (int k = 0; k < n; k++) {
            scatteri_real j = SCATTERI_REAL(k);
            scatteri_real after = ((2.0f * j + 1.0f) * x * p - j * before) / (j + 1.0f);
            before = p;
            p = after;
        }
        slope = m * (x * p - before) / (x * x - 1.0f);
        x = x - p / slope;
    }
    return scatteri_v2(SCATTERI_FLOAT(x), SCATTERI_FLOAT(2.0f / ((1.0f - x * x) * slope * slope)));
}

/* Direction, lengths 1e-30..1e30, to the square [-1, 1]^2: the octahedron, its lower half folded
   outward (Meyer et al. 2010, "On Floating-Point Normal Vectors"). */
SCATTERI_FN scatteri_vec2 scatteri_oct_encode(scatter_vec3 d) {
    float s = scatteri_abs(d.x) + scatteri_abs(d.y) + scatteri_abs(d.z);
    float u = d.x / scatteri_max(s, 1.0e-30f);
    float v = d.y / scatteri_max(s, 1.0e-30f);
    float fu = (1.0f - scatteri_abs(v)) * (u < 0.0f ? -1.0f : 1.0f);
    float fv = (1.0f - scatteri_abs(u)) * (v < 0.0f ? -1.0f : 1.0f);
    return scatteri_v2(scatteri_choose(d.z, 0.0f, fu, u), scatteri_choose(d.z, 0.0f, fv, v));
}

/* Square [-1, 1]^2 to unit direction; there and back within 4e-7. */
SCATTERI_FN scatter_vec3 scatteri_oct_decode(scatteri_vec2 uv) {
    float z = 1.0f - scatteri_abs(uv.x) - scatteri_abs(uv.y);
    float t = scatteri_max(-z, 0.0f);
    float x = uv.x + scatteri_choose(uv.x, 0.0f, t, -t);
    float y = uv.y + scatteri_choose(uv.y, 0.0f, t, -t);
    return scatteri_normalize(scatteri_v3(x, y, z));
}

/* a at f = 0, b at f = 1. */
SCATTERI_FN float scatteri_lerp(float a, float b, float f) {
    return a + (b - a) * f;
}

/* Between the eight corners vxyz of a cell; fx, fy, fz in 0..1. */
SCATTERI_FN float scatteri_trilinear(float v000, float v100, float v010, float v110, float v001,
                                     float v101, float v011, float v111, float fx, float fy,
                                     float fz) {
    float z0 = scatteri_lerp(scatteri_lerp(v000, v100, fx), scatteri_lerp(v010, v110, fx), fy);
    float z1 = scatteri_lerp(scatteri_lerp(v001, v101, fx), scatteri_lerp(v011, v111, fx), fy);
    return scatteri_lerp(z0, z1, fz);
}

/* >>core: tone */

/* Luminance of linear Rec. 709 RGB. */
SCATTERI_FN float scatteri_luminance(scatter_vec3 rgb) {
    return 0.2126f * rgb.x + 0.7152f * rgb.y + 0.0722f * rgb.z;
}

/* Reinhard et al. 2002, eq. 4: l (1 + l/white^2)/(1 + l); white <= 0: l/(1 + l). */
SCATTERI_FN float scatteri_reinhard(float l, float white) {
    float w = white > 0.0f ? white : 1.0f;
    float k = scatteri_choose(0.0f, white, l / (w * w), 0.0f);
    return l * (1.0f + k) / (1.0f + l);
}

/* 0 below e0, 1 above e1, 3t^2 - 2t^3 between; a step where e0 = e1. */
SCATTERI_FN float scatteri_smoothstep(float e0, float e1, float x) {
    float d = e1 > e0 ? e1 - e0 : 1.0f;
    float s = scatteri_choose(e0, e1, (x - e0) / d, x < e1 ? 0.0f : 1.0f);
    float t = scatteri_min(scatteri_max(s, 0.0f), 1.0f);
    return t * t * (3.0f - 2.0f * t);
}

/* Fraction of a spot's intensity at cosine c to its axis. */
SCATTERI_FN float scatteri_spot(float cos_inner, float cos_outer, float c) {
    return scatteri_smoothstep(cos_outer, cos_inner, c);
}

/* >>core end */

/* -------------------------------------------------------------------------------------------- >>log */

/* Every refusal passes through here: set a breakpoint. */
static scatter_result scatteri_fail(const scatter_host *host, scatter_result result,
                                    const char *format, ...)
{
    char sentence[256];
    va_list arguments;
    if (host != NULL && host->log != NULL) {
        va_start(arguments, format);
        vsnprintf(sentence, sizeof sentence, format, arguments);
        va_end(arguments);
        host->log(host->user, result, sentence);
    }
    return result;
}

/* ----------------------------------------------------------------------------------------- >>memory */

static scatter_host scatteri_host_or_default(const scatter_host *host)
{
    scatter_host none;
    memset(&none, 0, sizeof none);
    return host != NULL ? *host : none;
}

static void *scatteri_allocate(const scatter_host *host, size_t bytes)
{
    return host->allocate != NULL ? host->allocate(host->user, bytes) : malloc(bytes);
}

static void scatteri_release(const scatter_host *host, void *memory)
{
    if (memory == NULL)
        return;
    if (host->release != NULL)
        host->release(host->user, memory);
    else
        free(memory);
}

/* Memory that only grows; its content is lost when it does. */
typedef struct scatteri_buffer {
    void *data;
    size_t bytes;
} scatteri_buffer;

static scatter_result scatteri_reserve(const scatter_host *host, scatteri_buffer *buffer,
                                       size_t bytes, const char *purpose)
{
    void *data;
    if (bytes <= buffer->bytes)
        return SCATTER_OK;
    data = scatteri_allocate(host, bytes);
    if (data == NULL)
        return scatteri_fail(host, SCATTER_OUT_OF_MEMORY, "host.allocate gave no %lu bytes for %s",
                             (unsigned long)bytes, purpose);
    scatteri_release(host, buffer->data);
    buffer->data = data;
    buffer->bytes = bytes;
    return SCATTER_OK;
}

static void scatteri_drop(const scatter_host *host, scatteri_buffer *buffer)
{
    scatteri_release(host, buffer->data);
    buffer->data = NULL;
    buffer->bytes = 0;
}

/* a*b*c*size, or 0 if that is more than fits into an int of elements or a size_t of bytes. */
static size_t scatteri_bytes(size_t a, size_t b, size_t c, size_t size)
{
    const size_t most = (size_t)INT_MAX < SIZE_MAX / size ? (size_t)INT_MAX : SIZE_MAX / size;
    if (a == 0 || b == 0 || c == 0 || a > most || b > most / a || c > most / a / b)
        return 0;
    return a * b * c * size;
}

/* A part of a long call, and which part of its progress this is. */
typedef struct scatteri_stage {
    const scatter_host *host;
    float low, high;
} scatteri_stage;

/* Task numbers first..first+count of a job. */
typedef struct scatteri_chunk {
    void (*task)(void *, int);
    void *data;
    int first;
} scatteri_chunk;

static void scatteri_do_task(void *data, int index)
{
    const scatteri_chunk *chunk = (const scatteri_chunk *)data;
    chunk->task(chunk->data, chunk->first + index);
}

/* All tasks; in chunks, so that progress can be told and the host can cancel, if it asked for that. */
static scatter_result scatteri_parallel(const scatteri_stage *stage, int count,
                                        void (*task)(void *, int), void *data)
{
    const scatter_host *host = stage->host;
    const int step = host->progress != NULL ? (count - 1) / SCATTERI_CHUNKS + 1 : count;
    scatteri_chunk chunk;
    int i;
    chunk.task = task;
    chunk.data = data;
    for (chunk.first = 0; chunk.first < count; chunk.first += step) {
        const int some = count - chunk.first < step ? count - chunk.first : step;
        const float fraction =
            stage->low + (stage->high - stage->low) * (float)chunk.first / (float)count;
        if (host->progress != NULL && host->progress(host->user, fraction) != 0)
            return scatteri_fail(host, SCATTER_CANCELLED, "host.progress cancelled");
        if (host->parallel_for != NULL)
            host->parallel_for(host->user, some, scatteri_do_task, &chunk);
        for (i = 0; i < some && host->parallel_for == NULL; i++)
            scatteri_do_task(&chunk, i);
    }
    if (host->progress != NULL && stage->high >= 1.0f)
        (void)host->progress(host->user, 1.0f);
    return SCATTER_OK;
}

/* ------------------------------------------------------------------------------------ >>environment
   A radiance map becomes directional lights. Radiance is constant in each texel, and everything is
   integrated exactly over the solid angles of the texels: energy (luminance times solid angle) and
   its first moment (energy times direction), which is a product of a factor of the row and one of
   the column. Compact bright spots (suns) are taken out first; the rest is cut (median cut) or
   clustered (k-means). */

enum {
    SCATTERI_LIGHTS = 256,     /* of a constellation, at most */
    SCATTERI_MAP_EDGE = 65536, /* texels along an edge of a map, at most */
    SCATTERI_FINE = 128,       /* columns of cells, and what a map needs; half of it rows */
    SCATTERI_DISCS = 1024,     /* bright spots that are looked at, at most */
    SCATTERI_RELAX = 8,        /* Lloyd steps after each insertion */
    SCATTERI_ROUNDS = 24       /* of insertions, at most: 8 if none of the lights is lost again */
};

#define SCATTERI_PI 3.14159265358979323846
#define SCATTERI_RADIANT 1e12f    /* W/(m2 sr), the brightest texel: irradiances stay below 1e18 */
#define SCATTERI_SUN_ANGLE 0.0349 /* rad: 2 degrees, within which a sun lies; at least 2 texels */
#define SCATTERI_SUN_EDGE 0.1f    /* of its brightest texel, the faintest that belongs to a sun */
#define SCATTERI_SUN_RING 0.05    /* of its energy, what may lie around it */
#define SCATTERI_TAKEN (-FLT_MAX) /* luminance of a texel that belongs to a sun */

/* What comes from a part of the map: irradiance, and luminance times solid angle times 1 and
   direction. */
typedef struct scatteri_part {
    double rgb[3], energy, moment[3];
} scatteri_part;

/* Integrals over theta in one row: solid angle of a texel, horizontal part of the direction (to be
   multiplied by that of the column), vertical part. */
typedef struct scatteri_band {
    double area, flat, up;
} scatteri_band;

/* A rectangle of texels; it may go over the seam. */
typedef struct scatteri_patch {
    int x0, y0, nx, ny; /* 0 <= x0 < width; x0 + nx may be larger than the width */
    double energy;
    int whole; /* it cannot be cut */
} scatteri_patch;

/* k-means works on these. */
typedef struct scatteri_cells {
    int count;        /* a multiple of SCATTERI_LANES */
    int sx, sy;       /* texels along the edges of a cell */
    int columns;      /* of cells */
    float *x, *y, *z; /* first moment */
    float *size;      /* its length: nearly the energy */
    float *best;      /* product of the moment and the direction of the nearest centre */
    float *rgb;       /* irradiance */
    int *owner;       /* number of the nearest centre */
} scatteri_cells;

typedef struct scatteri_sky {
    const scatter_host *host;
    const scatter_environment *given;
    scatter_environment map; /* the same radiance, perhaps in smaller texels */
    /* in `refined`: the texels of the map if they are smaller; in `tables`: */
    scatteri_band *band;  /* of each row */
    double *row, *column; /* energy of the rows and columns of a patch */
    float *east, *north;  /* of each column: integrals of sin and cos of its azimuth */
    float *brightest;     /* of each row: luminance of the brightest texel not looked at */
    /* in `texels`: */
    float *luminance; /* SCATTERI_TAKEN in suns, negative where the search for suns has been */
    /* in `clusters`: */
    scatteri_cells cells;
    scatteri_buffer refined, tables, texels, clusters;
    double energy; /* outside suns */
    int seam;      /* column at which the median cut begins */
} scatteri_sky;

/* --- texels --- */

/* Not 0 if all values are finite, not negative and not huge. */
SCATTERI_HOT static int scatteri_is_radiance(const float *value, size_t count)
{
    int bad[SCATTERI_LANES] = {0}, any = 0, i;
    size_t n = 0;
    for (; n + SCATTERI_LANES <= count; n += SCATTERI_LANES)
        for (i = 0; i < SCATTERI_LANES; i++)
            bad[i] |= !(value[n + (size_t)i] >= 0.0f) | !(value[n + (size_t)i] <= SCATTERI_RADIANT);
    for (; n < count; n++)
        any |= !(value[n] >= 0.0f && value[n] <= SCATTERI_RADIANT);
    for (i = 0; i < SCATTERI_LANES; i++)
        any |= bad[i];
    return !any;
}

SCATTERI_HOT static void scatteri_read_luminance(const float *SCATTERI_RESTRICT rgb, int count,
                                                 float *SCATTERI_RESTRICT luminance)
{
    int i;
    for (i = 0; i < count; i++)
        luminance[i] = scatteri_luminance(scatteri_v3(rgb[3 * i], rgb[3 * i + 1], rgb[3 * i + 2]));
}

SCATTERI_HOT static float scatteri_brightest(const float *value, int count)
{
    float top[SCATTERI_LANES] = {0}, most = 0.0f;
    int n = 0, i;
    for (; n + SCATTERI_LANES <= count; n += SCATTERI_LANES)
        for (i = 0; i < SCATTERI_LANES; i++)
            top[i] = value[n + i] > top[i] ? value[n + i] : top[i];
    for (; n < count; n++)
        most = value[n] > most ? value[n] : most;
    for (i = 0; i < SCATTERI_LANES; i++)
        most = top[i] > most ? top[i] : most;
    return most;
}

/* Adds weight * luminance to the columns and returns the sum of what was added. */
SCATTERI_HOT static double scatteri_add_columns(const float *SCATTERI_RESTRICT luminance, int count,
                                                double weight, double *SCATTERI_RESTRICT column)
{
    double sum[SCATTERI_LANES] = {0}, all = 0.0;
    int n = 0, i;
    for (; n + SCATTERI_LANES <= count; n += SCATTERI_LANES)
        for (i = 0; i < SCATTERI_LANES; i++) {
            const double e = weight * (luminance[n + i] > 0.0f ? luminance[n + i] : 0.0f);
            column[n + i] += e;
            sum[i] += e;
        }
    for (; n < count; n++) {
        const double e = weight * (luminance[n] > 0.0f ? luminance[n] : 0.0f);
        column[n] += e;
        sum[0] += e;
    }
    for (i = 0; i < SCATTERI_LANES; i++)
        all += sum[i];
    return all;
}

/* Sums over texels of a row that are in no sun. */
typedef struct scatteri_row_sum {
    double red, green, blue, luminance, east, north;
} scatteri_row_sum;

SCATTERI_FN void scatteri_add_texel(scatteri_row_sum *s, const float *rgb, float luminance,
                                    float east, float north)
{
    const double keep = luminance >= 0.0f ? 1.0 : 0.0, y = keep * luminance;
    s->red += keep * rgb[0];
    s->green += keep * rgb[1];
    s->blue += keep * rgb[2];
    s->luminance += y;
    s->east += y * east;
    s->north += y * north;
}

enum { SCATTERI_SUMS = 8 }; /* texels of a row that are summed beside each other */

SCATTERI_HOT static void scatteri_sum_row(const float *SCATTERI_RESTRICT rgb,
                                          const float *SCATTERI_RESTRICT luminance,
                                          const float *SCATTERI_RESTRICT east,
                                          const float *SCATTERI_RESTRICT north, int count,
                                          scatteri_row_sum *SCATTERI_RESTRICT sum)
{
    double lane[6][SCATTERI_SUMS] = {{0.0}};
    int n = 0, i;
    for (; n + SCATTERI_SUMS <= count; n += SCATTERI_SUMS)
        for (i = 0; i < SCATTERI_SUMS; i++) {
            const double keep = luminance[n + i] >= 0.0f ? 1.0 : 0.0;
            const double y = keep * (double)luminance[n + i];
            lane[0][i] += keep * (double)rgb[3 * (n + i)];
            lane[1][i] += keep * (double)rgb[3 * (n + i) + 1];
            lane[2][i] += keep * (double)rgb[3 * (n + i) + 2];
            lane[3][i] += y;
            lane[4][i] += y * (double)east[n + i];
            lane[5][i] += y * (double)north[n + i];
        }
    for (; n < count; n++)
        scatteri_add_texel(sum, rgb + 3 * n, luminance[n], east[n], north[n]);
    for (i = 0; i < SCATTERI_SUMS; i++) {
        sum->red += lane[0][i], sum->green += lane[1][i], sum->blue += lane[2][i];
        sum->luminance += lane[3][i], sum->east += lane[4][i], sum->north += lane[5][i];
    }
}

static void scatteri_add_to_part(scatteri_part *part, const scatteri_band *band,
                                 const scatteri_row_sum *sum)
{
    part->rgb[0] += band->area * sum->red;
    part->rgb[1] += band->area * sum->green;
    part->rgb[2] += band->area * sum->blue;
    part->energy += band->area * sum->luminance;
    part->moment[0] += band->flat * sum->east;
    part->moment[1] += band->up * sum->luminance;
    part->moment[2] -= band->flat * sum->north;
}

/* Texels of row y, `count` of them from column x0 on, around the seam if need be. */
static void scatteri_add_span(const scatteri_sky *sky, int y, int x0, int count,
                              scatteri_part *part)
{
    const size_t row = (size_t)y * (size_t)sky->map.width;
    scatteri_row_sum sum;
    memset(&sum, 0, sizeof sum);
    while (count > 0) {
        const int some = count < sky->map.width - x0 ? count : sky->map.width - x0;
        const size_t first = row + (size_t)x0;
        scatteri_sum_row(sky->map.rgb + 3 * first, sky->luminance + first, sky->east + x0,
                         sky->north + x0, some, &sum);
        count -= some;
        x0 = 0;
    }
    scatteri_add_to_part(part, &sky->band[y], &sum);
}

static double scatteri_length3(const double v[3])
{
    return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
}

/* The light that stands for a part of the map. Where nothing comes from, or as much from
   everywhere, its direction is down. */
static scatter_light scatteri_light_of(const scatteri_sky *sky, const scatteri_part *part)
{
    const double *m = part->moment, length = scatteri_length3(m);
    const double scale = sky->map.scale != 0.0f ? (double)sky->map.scale : 1.0;
    scatter_light light;
    memset(&light, 0, sizeof light);
    light.kind = SCATTER_LIGHT_DIRECTIONAL;
    light.direction = scatteri_v3(0.0f, -1.0f, 0.0f);
    if (length > 1e-6 * part->energy)
        light.direction =
            scatteri_v3((float)(-m[0] / length), (float)(-m[1] / length), (float)(-m[2] / length));
    light.intensity = scatteri_v3((float)(scale * part->rgb[0]), (float)(scale * part->rgb[1]),
                                  (float)(scale * part->rgb[2]));
    return light;
}

/* --- preparation --- */

static void scatteri_set_bands(scatteri_sky *sky)
{
    const double step = SCATTERI_PI / sky->map.height, turn = 2.0 * SCATTERI_PI / sky->map.width;
    int y;
    for (y = 0; y < sky->map.height; y++) {
        const double middle = step * (y + 0.5);
        scatteri_band *b = &sky->band[y];
        b->area = turn * 2.0 * sin(middle) * sin(0.5 * step);
        b->flat = 0.5 * (step - cos(2.0 * middle) * sin(step));
        b->up = turn * 0.5 * sin(2.0 * middle) * sin(step);
    }
}

static void scatteri_set_azimuths(scatteri_sky *sky)
{
    const double turn = 2.0 * SCATTERI_PI / sky->map.width, width = 2.0 * sin(0.5 * turn);
    int x;
    for (x = 0; x < sky->map.width; x++) {
        const double azimuth = turn * (x + 0.5) - SCATTERI_PI;
        sky->east[x] = (float)(width * sin(azimuth));
        sky->north[x] = (float)(width * cos(azimuth));
    }
}

/* A map of few texels becomes one of more, with the same radiance everywhere. */
static scatter_result scatteri_refine(scatteri_sky *sky)
{
    const scatter_environment old = sky->map;
    const int fx = (SCATTERI_FINE - 1) / old.width + 1,
              fy = (SCATTERI_FINE / 2 - 1) / old.height + 1;
    const int width = fx * old.width, height = fy * old.height;
    scatter_result result;
    float *rgb;
    int x, y;
    if (fx == 1 && fy == 1)
        return SCATTER_OK;
    result = scatteri_reserve(sky->host, &sky->refined,
                              scatteri_bytes((size_t)width, (size_t)height, 3, sizeof *rgb),
                              "a refined environment");
    if (result != SCATTER_OK)
        return result;
    rgb = (float *)sky->refined.data;
    for (y = 0; y < height; y++)
        for (x = 0; x < width; x++, rgb += 3)
            memcpy(rgb, old.rgb + 3 * ((size_t)(y / fy) * (size_t)old.width + (size_t)(x / fx)),
                   3 * sizeof *rgb);
    sky->map.rgb = (const float *)sky->refined.data;
    sky->map.width = width;
    sky->map.height = height;
    return SCATTER_OK;
}

static scatter_result scatteri_reserve_tables(scatteri_sky *sky)
{
    const size_t width = (size_t)sky->map.width, height = (size_t)sky->map.height;
    const size_t doubles = 4 * height + width, singles = 2 * width + height;
    scatter_result result =
        scatteri_reserve(sky->host, &sky->tables,
                         doubles * sizeof(double) + singles * sizeof(float), "rows and columns");
    if (result == SCATTER_OK)
        result = scatteri_reserve(sky->host, &sky->texels, width * height * sizeof(float),
                                  "the luminance of an environment");
    if (result != SCATTER_OK)
        return result;
    sky->band = (scatteri_band *)sky->tables.data;
    sky->row = (double *)(sky->band + height);
    sky->column = sky->row + height;
    sky->east = (float *)(sky->column + width);
    sky->north = sky->east + width;
    sky->brightest = sky->north + width;
    sky->luminance = (float *)sky->texels.data;
    return SCATTER_OK;
}

static scatter_result scatteri_refuse_texel(const scatteri_sky *sky, int y)
{
    const float *row = sky->map.rgb + 3 * (size_t)y * (size_t)sky->map.width;
    int i = 0;
    while (i + 1 < 3 * sky->map.width && row[i] >= 0.0f && row[i] <= SCATTERI_RADIANT)
        i++;
    return scatteri_fail(sky->host, SCATTER_BAD_ARGUMENT,
                         "map.rgb in column %d of row %d is %g, it must be 0..1e12",
                         i / 3 / (sky->map.width / sky->given->width),
                         y / (sky->map.height / sky->given->height), (double)row[i]);
}

/* The column at which the map is cut open: opposite to where most of its light comes from, so that
   nothing depends on the column that it begins with. */
static int scatteri_find_seam(const scatteri_sky *sky)
{
    const int width = sky->map.width;
    double east = 0.0, north = 0.0, turn;
    int x;
    for (x = 0; x < width; x++) {
        east += sky->column[x] * sky->east[x];
        north += sky->column[x] * sky->north[x];
    }
    turn = atan2(east, north) / (2.0 * SCATTERI_PI); /* -1/2..1/2, 0 at the middle column */
    return (int)(turn * width + width + 0.5) % width;
}

/* Luminance and energy of all texels, and the seam. */
static scatter_result scatteri_read_map(scatteri_sky *sky)
{
    const size_t width = (size_t)sky->map.width;
    int y;
    memset(sky->column, 0, width * sizeof *sky->column);
    for (y = 0; y < sky->map.height; y++) {
        const float *rgb = sky->map.rgb + 3 * (size_t)y * width;
        float *luminance = sky->luminance + (size_t)y * width;
        if (!scatteri_is_radiance(rgb, 3 * width))
            return scatteri_refuse_texel(sky, y);
        scatteri_read_luminance(rgb, sky->map.width, luminance);
        sky->brightest[y] = scatteri_brightest(luminance, sky->map.width);
        sky->energy +=
            scatteri_add_columns(luminance, sky->map.width, sky->band[y].area, sky->column);
    }
    sky->seam = scatteri_find_seam(sky);
    return SCATTER_OK;
}

static scatter_result scatteri_open_sky(scatteri_sky *sky, const scatter_host *host,
                                        const scatter_environment *map)
{
    scatter_result result;
    memset(sky, 0, sizeof *sky);
    sky->host = host;
    sky->given = map;
    sky->map = *map;
    result = scatteri_refine(sky);
    if (result == SCATTER_OK)
        result = scatteri_reserve_tables(sky);
    if (result != SCATTER_OK)
        return result;
    scatteri_set_bands(sky);
    scatteri_set_azimuths(sky);
    return scatteri_read_map(sky);
}

static void scatteri_close_sky(scatteri_sky *sky)
{
    scatteri_drop(sky->host, &sky->refined);
    scatteri_drop(sky->host, &sky->tables);
    scatteri_drop(sky->host, &sky->texels);
    scatteri_drop(sky->host, &sky->clusters);
}

/* --- suns --- */

/* Texels whose centres lie within an angle around that of the texel x, y. */
typedef struct scatteri_disc {
    int x, y;
    double radius;
    float edge; /* luminance of the faintest that count */
} scatteri_disc;

/* Columns on each side of disc->x that lie within it in row y; -1: none. */
static int scatteri_disc_reach(const scatteri_sky *sky, const scatteri_disc *disc, int y)
{
    const double step = SCATTERI_PI / sky->map.height;
    const double a = step * (disc->y + 0.5), b = step * (y + 0.5);
    const double cosine = (cos(disc->radius) - cos(a) * cos(b)) / (sin(a) * sin(b));
    if (cosine > 1.0)
        return -1;
    if (cosine <= -1.0)
        return sky->map.width / 2;
    return (int)(acos(cosine) * sky->map.width / (2.0 * SCATTERI_PI));
}

/* First and last row that may lie within it. */
static int scatteri_disc_row(const scatteri_sky *sky, const scatteri_disc *disc, int last)
{
    const int reach = (int)(disc->radius * sky->map.height / SCATTERI_PI) + 1;
    const int y = last ? disc->y + reach : disc->y - reach;
    return y < 0 ? 0 : y < sky->map.height ? y : sky->map.height - 1;
}

/* The columns of the disc in row y: returns their number, *x0 is the first. */
static int scatteri_disc_span(const scatteri_sky *sky, const scatteri_disc *disc, int y, int *x0)
{
    const int reach = scatteri_disc_reach(sky, disc, y), width = sky->map.width;
    const int count = 2 * reach + 1 < width ? 2 * reach + 1 : width;
    *x0 = (disc->x - reach + width) % width;
    return count;
}

/* What comes from the bright texels of a disc. */
static scatteri_part scatteri_disc_part(const scatteri_sky *sky, const scatteri_disc *disc)
{
    scatteri_part part;
    int y, i, x;
    memset(&part, 0, sizeof part);
    for (y = scatteri_disc_row(sky, disc, 0); y <= scatteri_disc_row(sky, disc, 1); y++) {
        const size_t row = (size_t)y * (size_t)sky->map.width;
        const int count = scatteri_disc_span(sky, disc, y, &x);
        scatteri_row_sum sum;
        memset(&sum, 0, sizeof sum);
        for (i = 0; i < count; i++, x = x + 1 < sky->map.width ? x + 1 : 0) {
            const float l = sky->luminance[row + (size_t)x], size = l < 0.0f ? -l : l;
            if (size >= disc->edge && l > SCATTERI_TAKEN)
                scatteri_add_texel(&sum, sky->map.rgb + 3 * (row + (size_t)x), size, sky->east[x],
                                   sky->north[x]);
        }
        scatteri_add_to_part(&part, &sky->band[y], &sum);
    }
    return part;
}

/* The search for suns leaves out the bright texels of a disc from now on, taken or not. */
static void scatteri_leave_disc(scatteri_sky *sky, const scatteri_disc *disc, int taken)
{
    int y, i, x;
    for (y = scatteri_disc_row(sky, disc, 0); y <= scatteri_disc_row(sky, disc, 1); y++) {
        float *row = sky->luminance + (size_t)y * (size_t)sky->map.width;
        const int count = scatteri_disc_span(sky, disc, y, &x);
        for (i = 0; i < count; i++, x = x + 1 < sky->map.width ? x + 1 : 0) {
            const float size = row[x] < 0.0f ? -row[x] : row[x];
            if (size >= disc->edge && row[x] > SCATTERI_TAKEN)
                row[x] = taken ? SCATTERI_TAKEN : -size;
        }
        sky->brightest[y] = scatteri_brightest(row, sky->map.width);
    }
}

/* The brightest texel that the search has not been to, and what is around it. */
static scatteri_disc scatteri_next_disc(const scatteri_sky *sky, double radius)
{
    const float *row;
    scatteri_disc disc = {0, 0, 0.0, 0.0f};
    int y;
    for (y = 1; y < sky->map.height; y++)
        if (sky->brightest[y] > sky->brightest[disc.y])
            disc.y = y;
    row = sky->luminance + (size_t)disc.y * (size_t)sky->map.width;
    while (disc.x + 1 < sky->map.width && row[disc.x] < sky->brightest[disc.y])
        disc.x++;
    disc.radius = radius;
    disc.edge = SCATTERI_SUN_EDGE * sky->brightest[disc.y];
    return disc;
}

static void scatteri_end_search(scatteri_sky *sky)
{
    const size_t count = (size_t)sky->map.width * (size_t)sky->map.height;
    float *l = sky->luminance;
    size_t i;
    for (i = 0; i < count; i++)
        l[i] = l[i] < 0.0f && l[i] > SCATTERI_TAKEN ? -l[i] : l[i];
}

/* Takes suns out of the map and returns their number. A sun has at least the energy that each other
   light would get, and ends within 2 degrees of its brightest texel: nearly nothing as bright is in
   the ring around it. */
static int scatteri_take_suns(scatteri_sky *sky, int count, scatter_light *lights)
{
    const double tall = SCATTERI_PI / sky->map.height, wide = 2.0 * SCATTERI_PI / sky->map.width;
    const double texel = tall > wide ? tall : wide;
    const double radius = SCATTERI_SUN_ANGLE > 2.0 * texel ? SCATTERI_SUN_ANGLE : 2.0 * texel;
    const double area = 2.0 * SCATTERI_PI * (1.0 - cos(radius + texel));
    int found = 0, look;
    for (look = 0; look < SCATTERI_DISCS && found < count - 1; look++) {
        scatteri_disc disc = scatteri_next_disc(sky, radius);
        const double share = sky->energy / (count - found);
        const double top = sky->brightest[disc.y];
        scatteri_part part;
        int is_sun;
        if (!(top > 0.0 && top * area >= share))
            break;
        part = scatteri_disc_part(sky, &disc);
        disc.radius = radius + 1.5 * texel;
        is_sun = part.energy >= share &&
                 scatteri_disc_part(sky, &disc).energy <= (1.0 + SCATTERI_SUN_RING) * part.energy;
        disc.radius = radius;
        scatteri_leave_disc(sky, &disc, is_sun);
        if (is_sun)
            lights[found++] = scatteri_light_of(sky, &part);
        sky->energy -= is_sun ? part.energy : 0.0;
    }
    if (look > found)
        scatteri_end_search(sky);
    return found;
}

/* --- median cut --- */

/* Energy of each row and column of a patch. */
static void scatteri_project(scatteri_sky *sky, const scatteri_patch *p)
{
    const int width = sky->map.width, some = p->nx < width - p->x0 ? p->nx : width - p->x0;
    int y;
    memset(sky->column, 0, (size_t)p->nx * sizeof *sky->column);
    for (y = 0; y < p->ny; y++) {
        const float *row = sky->luminance + (size_t)(p->y0 + y) * (size_t)width;
        const double area = sky->band[p->y0 + y].area;
        sky->row[y] = scatteri_add_columns(row + p->x0, some, area, sky->column);
        if (some < p->nx)
            sky->row[y] += scatteri_add_columns(row, p->nx - some, area, sky->column + some);
    }
}

static double scatteri_sum_of(const double *value, int count)
{
    double sum = 0.0;
    int i;
    for (i = 0; i < count; i++)
        sum += value[i];
    return sum;
}

/* Where to cut so that both sides have the same energy, as nearly as it goes: 1..count-1. */
static int scatteri_even_cut(const double *energy, int count)
{
    const double all = scatteri_sum_of(energy, count);
    double sum = 0.0, least = -1.0;
    int i, best = 1;
    for (i = 1; i < count; i++) {
        double uneven;
        sum += energy[i - 1];
        uneven = fabs(2.0 * sum - all);
        if (least < 0.0 || uneven < least) {
            least = uneven;
            best = i;
        }
    }
    return best;
}

/* Leaves out dark rows or columns at both ends: returns how many at the beginning. */
static int scatteri_skip_dark(const double *energy, int *count)
{
    int first = 0;
    while (*count > 1 && !(energy[*count - 1] > 0.0))
        --*count;
    while (first + 1 < *count && !(energy[first] > 0.0))
        first++;
    *count -= first;
    return first;
}

/* Not 0 if a patch is to be cut across its columns: if it is longer that way. */
static int scatteri_is_wide(const scatteri_sky *sky, const scatteri_patch *p)
{
    const double tall = SCATTERI_PI / sky->map.height;
    const double top = tall * p->y0, bottom = tall * (p->y0 + p->ny);
    const double mean_sine = (cos(top) - cos(bottom)) / (bottom - top);
    const double width = 2.0 * SCATTERI_PI / sky->map.width * p->nx * mean_sine;
    return p->ny == 1 || (p->nx > 1 && width >= tall * p->ny);
}

/* The part of a patch behind the cut becomes *rest. */
static void scatteri_cut_patch(scatteri_sky *sky, scatteri_patch *p, scatteri_patch *rest)
{
    const double *energy;
    int x, y, wide, count, at;
    scatteri_project(sky, p);
    x = scatteri_skip_dark(sky->column, &p->nx);
    y = scatteri_skip_dark(sky->row, &p->ny);
    p->x0 = (p->x0 + x) % sky->map.width;
    p->y0 += y;
    p->whole = p->nx == 1 && p->ny == 1;
    if (p->whole)
        return;
    wide = scatteri_is_wide(sky, p);
    energy = wide ? sky->column + x : sky->row + y;
    count = wide ? p->nx : p->ny;
    at = scatteri_even_cut(energy, count);
    *rest = *p;
    rest->energy = scatteri_sum_of(energy + at, count - at);
    rest->x0 = wide ? (p->x0 + at) % sky->map.width : p->x0;
    rest->y0 = wide ? p->y0 : p->y0 + at;
    *(wide ? &rest->nx : &rest->ny) = count - at;
    p->energy = scatteri_sum_of(energy, at);
    *(wide ? &p->nx : &p->ny) = at;
}

/* The patch with the greatest energy of those that can be cut, or -1. */
static int scatteri_greatest(const scatteri_patch *p, int count)
{
    int i, best = -1;
    for (i = 0; i < count; i++)
        if (!p[i].whole && p[i].energy > 0.0 && (best < 0 || p[i].energy > p[best].energy))
            best = i;
    return best;
}

/* Debevec's median cut: patches of the same energy. */
static void scatteri_median_cut(scatteri_sky *sky, int count, scatter_light *lights)
{
    scatteri_patch patch[SCATTERI_LIGHTS] = {{0, 0, 0, 0, 0.0, 0}};
    int n = 1, i, y;
    patch[0].nx = sky->map.width;
    patch[0].ny = sky->map.height;
    patch[0].energy = 1.0;
    patch[0].x0 = sky->seam;
    while (n < count && (i = scatteri_greatest(patch, n)) >= 0) {
        scatteri_cut_patch(sky, &patch[i], &patch[n]);
        n += !patch[i].whole;
    }
    for (i = 0; i < count; i++) {
        scatteri_part part;
        memset(&part, 0, sizeof part);
        for (y = 0; i < n && y < patch[i].ny; y++)
            scatteri_add_span(sky, patch[i].y0 + y, patch[i].x0, patch[i].nx, &part);
        lights[i] = scatteri_light_of(sky, &part);
    }
}

/* --- k-means --- */

static scatter_result scatteri_reserve_cells(scatteri_sky *sky)
{
    scatteri_cells *c = &sky->cells;
    size_t n;
    scatter_result result;
    c->sx = (sky->map.width - 1) / SCATTERI_FINE + 1;
    c->sy = (sky->map.height - 1) / (SCATTERI_FINE / 2) + 1;
    c->columns = (sky->map.width - 1) / c->sx + 1;
    c->count = c->columns * ((sky->map.height - 1) / c->sy + 1);
    c->count = (c->count + SCATTERI_LANES - 1) / SCATTERI_LANES * SCATTERI_LANES;
    n = (size_t)c->count;
    result = scatteri_reserve(sky->host, &sky->clusters, n * (8 * sizeof(float) + sizeof(int)),
                              "the cells of an environment");
    if (result != SCATTER_OK)
        return result;
    c->x = (float *)sky->clusters.data;
    c->y = c->x + n;
    c->z = c->y + n;
    c->size = c->z + n;
    c->best = c->size + n;
    c->rgb = c->best + n;
    c->owner = (int *)(c->rgb + 3 * n);
    return SCATTER_OK;
}

/* The cells at the end, which fill up the last lanes, are dark. */
static void scatteri_set_cell(const scatteri_sky *sky, int cell)
{
    const scatteri_cells *c = &sky->cells;
    const int x0 = cell % c->columns * c->sx, y0 = cell / c->columns * c->sy;
    const int nx = c->sx < sky->map.width - x0 ? c->sx : sky->map.width - x0;
    scatteri_part part;
    int y;
    memset(&part, 0, sizeof part);
    for (y = y0; y < y0 + c->sy && y < sky->map.height; y++)
        scatteri_add_span(sky, y, x0, nx, &part);
    c->x[cell] = (float)part.moment[0];
    c->y[cell] = (float)part.moment[1];
    c->z[cell] = (float)part.moment[2];
    c->size[cell] = (float)scatteri_length3(part.moment);
    for (y = 0; y < 3; y++)
        c->rgb[3 * cell + y] = (float)part.rgb[y];
}

/* Directions of the lights so far. */
typedef struct scatteri_centers {
    int count;
    float x[SCATTERI_LIGHTS], y[SCATTERI_LIGHTS], z[SCATTERI_LIGHTS];
} scatteri_centers;

/* The nearest centre of each cell: the one with the greatest product with the cell's moment. */
SCATTERI_HOT static void scatteri_find_owners(const scatteri_cells *c,
                                              const scatteri_centers *center)
{
    const float *SCATTERI_RESTRICT x = c->x, *SCATTERI_RESTRICT y = c->y,
                                   *SCATTERI_RESTRICT z = c->z;
    int cell, i, k;
    for (cell = 0; cell < c->count; cell += SCATTERI_LANES) {
        float best[SCATTERI_LANES];
        int owner[SCATTERI_LANES];
        for (i = 0; i < SCATTERI_LANES; i++) {
            best[i] = -FLT_MAX;
            owner[i] = 0;
        }
        for (k = 0; k < center->count; k++) {
            const float cx = center->x[k], cy = center->y[k], cz = center->z[k];
            for (i = 0; i < SCATTERI_LANES; i++) {
                const float d = x[cell + i] * cx + y[cell + i] * cy + z[cell + i] * cz;
                owner[i] = d > best[i] ? k : owner[i];
                best[i] = d > best[i] ? d : best[i];
            }
        }
        memcpy(c->best + cell, best, sizeof best);
        memcpy(c->owner + cell, owner, sizeof owner);
    }
}

/* A Lloyd step's second half: every centre moves to the centroid of its cells, if it has one; those
   without light go. */
static void scatteri_move_centers(const scatteri_cells *c, scatteri_centers *center)
{
    double sum[SCATTERI_LIGHTS][4];
    int i, k, n = 0;
    memset(sum, 0, sizeof sum);
    for (i = 0; i < c->count; i++) {
        double *s = sum[c->owner[i]];
        s[0] += c->x[i], s[1] += c->y[i], s[2] += c->z[i], s[3] += c->size[i];
    }
    for (k = 0; k < center->count; k++) {
        const double *s = sum[k], length = scatteri_length3(s);
        const int moves = length > 0.0;
        if (!(s[3] > 0.0))
            continue;
        center->x[n] = moves ? (float)(s[0] / length) : center->x[k];
        center->y[n] = moves ? (float)(s[1] / length) : center->y[k];
        center->z[n++] = moves ? (float)(s[2] / length) : center->z[k];
    }
    center->count = n;
}

static void scatteri_relax(const scatteri_cells *c, scatteri_centers *center, int steps)
{
    while (steps-- > 0) {
        scatteri_find_owners(c, center);
        scatteri_move_centers(c, center);
    }
    scatteri_find_owners(c, center);
}

/* What a cell loses by its centre's direction: energy times 1 - cos, if more than rounding. */
static float scatteri_cell_loss(const scatteri_cells *c, int i)
{
    const float loss = c->size[i] - c->best[i];
    return loss > 1e-5f * c->size[i] ? loss : 0.0f;
}

static void scatteri_add_center(scatteri_centers *center, const scatteri_cells *c, int i)
{
    center->x[center->count] = c->x[i] / c->size[i];
    center->y[center->count] = c->y[i] / c->size[i];
    center->z[center->count++] = c->z[i] / c->size[i];
}

/* In every centre's share the cell that loses most; then the worst of these become centres, too:
   returns their number. */
static int scatteri_insert(const scatteri_cells *c, scatteri_centers *center, int most)
{
    float loss[SCATTERI_LIGHTS] = {0};
    int worst[SCATTERI_LIGHTS], i, k, n, first = center->count;
    for (i = 0; i < c->count; i++) {
        const float l = scatteri_cell_loss(c, i);
        if (l > loss[c->owner[i]]) {
            loss[c->owner[i]] = l;
            worst[c->owner[i]] = i;
        }
    }
    for (n = 0; n < most; n++) {
        for (i = 0, k = 1; k < first; k++)
            i = loss[k] > loss[i] ? k : i;
        if (!(loss[i] > 0.0f))
            break;
        scatteri_add_center(center, c, worst[i]);
        loss[i] = 0.0f;
    }
    return n;
}

static void scatteri_add_cell(const scatteri_cells *c, int i, scatteri_part *part)
{
    int k;
    for (k = 0; k < 3; k++)
        part->rgb[k] += c->rgb[3 * i + k];
    part->energy += c->size[i];
    part->moment[0] += c->x[i], part->moment[1] += c->y[i], part->moment[2] += c->z[i];
}

/* Kollig and Keller's way: lights are put where most is lost, at most one into each light's share
   at a time, and relaxed by Lloyd steps, until there are enough. */
static void scatteri_kmeans(scatteri_sky *sky, int count, scatter_light *lights)
{
    const scatteri_cells *c = &sky->cells;
    scatteri_centers center = {1, {0.0f}, {1.0f}, {0.0f}};
    scatteri_part part[SCATTERI_LIGHTS];
    int i, k, rounds = SCATTERI_ROUNDS, missing;
    memset(part, 0, sizeof part);
    for (i = 0; i < c->count; i++)
        scatteri_set_cell(sky, i);
    scatteri_relax(c, &center, 1);
    while ((missing = count - center.count) > 0 && rounds-- > 0 &&
           scatteri_insert(c, &center, missing) > 0)
        scatteri_relax(c, &center, SCATTERI_RELAX);
    for (i = 0; i < c->count; i++)
        scatteri_add_cell(c, i, &part[c->owner[i]]);
    for (k = 0; k < count; k++)
        lights[k] = scatteri_light_of(sky, &part[k]);
}

/* --- turning, looking up --- */

/* Rodrigues: v turned about the unit vector k. */
static scatter_vec3 scatteri_turn(scatter_vec3 v, const double k[3], double sine, double cosine)
{
    const double along = (1.0 - cosine) * (k[0] * v.x + k[1] * v.y + k[2] * v.z);
    return scatteri_v3((float)(cosine * v.x + sine * (k[1] * v.z - k[2] * v.y) + along * k[0]),
                       (float)(cosine * v.y + sine * (k[2] * v.x - k[0] * v.z) + along * k[1]),
                       (float)(cosine * v.z + sine * (k[0] * v.y - k[1] * v.x) + along * k[2]));
}

/* Radiance at a place of the map, counted in texels from the middle of the first one; 0 <= y. */
static scatter_vec3 scatteri_bilinear(const scatter_environment *map, double x, double y)
{
    const double left = floor(x), top = floor(y);
    const int x0 = ((int)left + map->width) % map->width, x1 = (x0 + 1) % map->width;
    const int y0 = (int)top, y1 = y0 + 1 < map->height ? y0 + 1 : y0;
    const float *upper = map->rgb + 3 * (size_t)y0 * (size_t)map->width;
    const float *lower = map->rgb + 3 * (size_t)y1 * (size_t)map->width;
    const double u = x - left, v = y - top, scale = map->scale != 0.0f ? (double)map->scale : 1.0;
    double c[3];
    int i;
    for (i = 0; i < 3; i++)
        c[i] = scale * ((1.0 - v) * ((1.0 - u) * upper[3 * x0 + i] + u * upper[3 * x1 + i]) +
                        v * ((1.0 - u) * lower[3 * x0 + i] + u * lower[3 * x1 + i]));
    return scatteri_v3((float)c[0], (float)c[1], (float)c[2]);
}

/* ----------------------------------------------------------------------------------------- >>medium
   Density D(x) of all terms, its integral along segments in closed form, and its injection into volumes.
   "Analytic" terms are constant and height fog, "local" ones Gaussians and grids. */

static float scatteri_get(scatter_vec3 v, int axis)
{
    return axis == 0 ? v.x : axis == 1 ? v.y : v.z;
}

/* Part of the ray origin + t direction inside the box: shrinks [*t0, *t1]; 0 if nothing is left. */
static int scatteri_clip(scatter_box box, scatter_vec3 origin, scatter_vec3 direction, float *t0,
                         float *t1)
{
    int axis;
    for (axis = 0; axis < 3; axis++) {
        const float o = scatteri_get(origin, axis), u = scatteri_get(direction, axis);
        const float lo = scatteri_get(box.min, axis) - o, hi = scatteri_get(box.max, axis) - o;
        float enter = SCATTERI_FAR, leave = -SCATTERI_FAR;
        if (u != 0.0f) {
            enter = (u > 0.0f ? lo : hi) / u;
            leave = (u > 0.0f ? hi : lo) / u;
        } else if (lo <= 0.0f && hi >= 0.0f) {
            continue;
        }
        *t0 = enter > *t0 ? enter : *t0;
        *t1 = leave < *t1 ? leave : *t1;
    }
    return *t0 < *t1;
}

static int scatteri_inside(scatter_box box, scatter_vec3 x)
{
    return x.x >= box.min.x && x.x <= box.max.x && x.y >= box.min.y && x.y <= box.max.y &&
           x.z >= box.min.z && x.z <= box.max.z;
}

static scatter_vec3 scatteri_along(scatter_vec3 origin, scatter_vec3 direction, float t)
{
    return scatteri_add(origin, scatteri_scale(direction, t));
}

/* --- voxels --- */

/* A grid prepared for sampling, with a map of the distances to what it holds. */
typedef struct scatteri_field {
    scatter_grid grid;
    scatter_vec3 per_metre; /* voxels per metre */
    scatter_vec3 edge;      /* of a voxel, m */
    float scale;
    const uint16_t *distances; /* of each voxel, see "distance map"; NULL: no map */
    float unit;                /* of the distances, m */
} scatteri_field;

static scatteri_field scatteri_field_of(const scatter_grid *grid)
{
    scatteri_field field;
    memset(&field, 0, sizeof field);
    field.grid = *grid;
    field.per_metre = scatteri_v3((float)grid->nx / (grid->box.max.x - grid->box.min.x),
                                  (float)grid->ny / (grid->box.max.y - grid->box.min.y),
                                  (float)grid->nz / (grid->box.max.z - grid->box.min.z));
    field.edge =
        scatteri_v3(1.0f / field.per_metre.x, 1.0f / field.per_metre.y, 1.0f / field.per_metre.z);
    field.scale = grid->scale != 0.0f ? grid->scale : 1.0f;
    field.unit = scatteri_length(scatteri_sub(grid->box.max, grid->box.min)) / (float)SCATTERI_NONE;
    return field;
}

static float scatteri_voxel(const scatter_grid *grid, int i, int j, int k)
{
    return grid->density[((size_t)k * (size_t)grid->ny + (size_t)j) * (size_t)grid->nx + (size_t)i];
}

SCATTERI_FN int scatteri_clamp_int(int value, int low, int high)
{
    return value < low ? low : value > high ? high : value;
}

SCATTERI_FN float scatteri_clamp(float value, float low, float high)
{
    return scatteri_min(scatteri_max(value, low), high);
}

/* Trilinear value at voxel-centre coordinates g (voxel i at g = i), clamped to the outermost centres. */
static float scatteri_voxels_at(const scatter_grid *grid, scatter_vec3 g)
{
    const float gx = scatteri_clamp(g.x, 0.0f, (float)(grid->nx - 1));
    const float gy = scatteri_clamp(g.y, 0.0f, (float)(grid->ny - 1));
    const float gz = scatteri_clamp(g.z, 0.0f, (float)(grid->nz - 1));
    const int i = (int)gx, j = (int)gy, k = (int)gz;
    const int i1 = i + 1 < grid->nx ? i + 1 : i, j1 = j + 1 < grid->ny ? j + 1 : j;
    const int k1 = k + 1 < grid->nz ? k + 1 : k;
    return scatteri_trilinear(scatteri_voxel(grid, i, j, k), scatteri_voxel(grid, i1, j, k),
                              scatteri_voxel(grid, i, j1, k), scatteri_voxel(grid, i1, j1, k),
                              scatteri_voxel(grid, i, j, k1), scatteri_voxel(grid, i1, j, k1),
                              scatteri_voxel(grid, i, j1, k1), scatteri_voxel(grid, i1, j1, k1),
                              gx - (float)i, gy - (float)j, gz - (float)k);
}

static scatter_vec3 scatteri_voxel_coordinates(const scatteri_field *field, scatter_vec3 x)
{
    const scatter_vec3 g = scatteri_mul(scatteri_sub(x, field->grid.box.min), field->per_metre);
    return scatteri_sub(g, scatteri_v3(0.5f, 0.5f, 0.5f));
}

static float scatteri_field_at(const scatteri_field *field, scatter_vec3 x)
{
    if (!scatteri_inside(field->grid.box, x))
        return 0.0f;
    return field->scale * scatteri_voxels_at(&field->grid, scatteri_voxel_coordinates(field, x));
}

SCATTERI_FN double scatteri_smaller(double a, double b)
{
    return a < b ? a : b;
}

SCATTERI_FN double scatteri_larger(double a, double b)
{
    return a > b ? a : b;
}

/* A segment whose geometry is computed in double, so that a far end costs no digits at the near one. */
typedef struct scatteri_segment {
    double origin[3], direction[3], length; /* direction: unit */
} scatteri_segment;

static scatteri_segment scatteri_segment_between(scatter_vec3 p, scatter_vec3 q)
{
    scatteri_segment s;
    int i;
    s.length = 0.0;
    for (i = 0; i < 3; i++) {
        s.origin[i] = (double)scatteri_get(p, i);
        s.direction[i] = (double)scatteri_get(q, i) - s.origin[i];
        s.length += s.direction[i] * s.direction[i];
    }
    s.length = sqrt(s.length);
    for (i = 0; i < 3; i++)
        s.direction[i] /= s.length > 0.0 ? s.length : 1.0;
    return s;
}

/* The part of the segment inside the box; 0 if there is none. */
static int scatteri_cut_segment(scatteri_segment *s, scatter_box box)
{
    double t0 = 0.0, t1 = s->length;
    int i;
    for (i = 0; i < 3; i++) {
        const double low = (double)scatteri_get(box.min, i) - s->origin[i];
        const double high = (double)scatteri_get(box.max, i) - s->origin[i], d = s->direction[i];
        if (d == 0.0) {
            if (low > 0.0 || high < 0.0)
                return 0;
            continue;
        }
        t0 = scatteri_larger(t0, (d > 0.0 ? low : high) / d);
        t1 = scatteri_smaller(t1, (d > 0.0 ? high : low) / d);
    }
    if (!(t0 < t1))
        return 0;
    for (i = 0; i < 3; i++)
        s->origin[i] += t0 * s->direction[i];
    s->length = t1 - t0;
    return 1;
}

/* How far around voxel coordinates g, above -1, the field is certainly 0, m; not > 0: not known. */
SCATTERI_FN float scatteri_clear_at(const scatteri_field *field, const double *g)
{
    const scatter_grid *grid = &field->grid;
    const int i = scatteri_clamp_int((int)(g[0] + 0.5), 0, grid->nx - 1);
    const int j = scatteri_clamp_int((int)(g[1] + 0.5), 0, grid->ny - 1);
    const int k = scatteri_clamp_int((int)(g[2] + 0.5), 0, grid->nz - 1);
    const size_t row = (size_t)k * (size_t)grid->ny + (size_t)j;
    const scatter_vec3 off = scatteri_v3((float)(g[0] - (double)i), (float)(g[1] - (double)j),
                                         (float)(g[2] - (double)k));
    if (field->distances == NULL || field->distances[row * (size_t)grid->nx + (size_t)i] == 0)
        return 0.0f;
    return (float)field->distances[row * (size_t)grid->nx + (size_t)i] * field->unit -
           scatteri_length(scatteri_mul(off, field->edge));
}

/* A segment on its way through the voxels, whose centres lie at whole numbers. */
typedef struct scatteri_walk {
    double g[3], dg[3]; /* voxel coordinates at its start, and what they grow by in a metre */
    double inverse[3];  /* 1/dg; where that is 0, a plane is never reached */
    double plane[3];    /* through voxel centres, the next one on each axis */
    double way[3];      /* from one plane to the next */
    int n[3];
} scatteri_walk;

/* Finds the planes behind t. The segment is inside the box, above -1. */
SCATTERI_FN void scatteri_find_planes(scatteri_walk *walk, double t)
{
    int i;
    for (i = 0; i < 3; i++) {
        const double at = walk->g[i] + t * walk->dg[i], n = (double)walk->n[i];
        const int above = (int)(at + 1e-9 + 1.0), below = walk->n[i] - (int)(n - at + 1e-9) - 1;
        walk->plane[i] = (double)(walk->way[i] > 0.0 ? above : below);
    }
}

SCATTERI_FN double scatteri_plane_at(const scatteri_walk *walk, int i)
{
    return (walk->plane[i] - walk->g[i]) * walk->inverse[i];
}

SCATTERI_FN double scatteri_first_plane(const scatteri_walk *walk)
{
    return scatteri_smaller(
        scatteri_plane_at(walk, 0),
        scatteri_smaller(scatteri_plane_at(walk, 1), scatteri_plane_at(walk, 2)));
}

/* Without a branch: which plane comes next is hard to predict. */
SCATTERI_FN void scatteri_pass_planes(scatteri_walk *walk, double t)
{
    int i;
    for (i = 0; i < 3; i++)
        walk->plane[i] += walk->way[i] * (double)(scatteri_plane_at(walk, i) <= t);
}

SCATTERI_FN double scatteri_on_axis(double g, int n)
{
    return scatteri_larger(0.0, scatteri_smaller(g, (double)(n - 1)));
}

/* Trilinear value at g in the cell of voxel centres i, j, k with the voxels v. */
SCATTERI_FN double scatteri_cell_value(const float *v, const double *g, const int *n, int i, int j,
                                       int k)
{
    return (double)scatteri_trilinear(v[0], v[1], v[2], v[3], v[4], v[5], v[6], v[7],
                                      (float)(scatteri_on_axis(g[0], n[0]) - (double)i),
                                      (float)(scatteri_on_axis(g[1], n[1]) - (double)j),
                                      (float)(scatteri_on_axis(g[2], n[2]) - (double)k));
}

/* Mean of the field on the part of the walk within `half` of `middle` in one cell of voxel centres, where the field along
   a straight line is a cubic polynomial, which two Gauss-Legendre points integrate exactly. */
SCATTERI_FN double scatteri_cell_mean(const scatter_grid *grid, const scatteri_walk *walk,
                                      const double *middle, double half)
{
    const double gauss = 0.57735026918962576 * half; /* 1/sqrt 3 */
    const int *n = walk->n;
    const int i = (int)scatteri_on_axis(middle[0], n[0]),
              j = (int)scatteri_on_axis(middle[1], n[1]);
    const int k = (int)scatteri_on_axis(middle[2], n[2]);
    const size_t x = i + 1 < n[0], y = j + 1 < n[1] ? (size_t)n[0] : 0;
    const size_t z = k + 1 < n[2] ? (size_t)n[0] * (size_t)n[1] : 0;
    const float *c =
        grid->density + ((size_t)k * (size_t)n[1] + (size_t)j) * (size_t)n[0] + (size_t)i;
    const float v[8] = {c[0], c[x], c[y], c[y + x], c[z], c[z + x], c[z + y], c[z + y + x]};
    double a[3], b[3];
    int axis;
    for (axis = 0; axis < 3; axis++) {
        a[axis] = middle[axis] - gauss * walk->dg[axis];
        b[axis] = middle[axis] + gauss * walk->dg[axis];
    }
    return 0.5 * (scatteri_cell_value(v, a, n, i, j, k) + scatteri_cell_value(v, b, n, i, j, k));
}

SCATTERI_FN void scatteri_begin_walk(const scatteri_field *field, const scatteri_segment *s,
                                     scatteri_walk *walk)
{
    const scatter_grid *grid = &field->grid;
    int i;
    walk->n[0] = grid->nx;
    walk->n[1] = grid->ny;
    walk->n[2] = grid->nz;
    for (i = 0; i < 3; i++) {
        const double per = (double)scatteri_get(field->per_metre, i);
        walk->g[i] = (s->origin[i] - (double)scatteri_get(grid->box.min, i)) * per - 0.5;
        walk->dg[i] = s->direction[i] * per;
        walk->way[i] = walk->dg[i] < 0.0 ? -1.0 : 1.0;
        walk->inverse[i] = walk->dg[i] != 0.0 ? 1.0 / walk->dg[i] : (double)SCATTERI_FAR;
    }
    scatteri_find_planes(walk, 0.0);
}

/* Goes on from t as far as the field is certainly 0. */
SCATTERI_FN double scatteri_pass_empty(const scatteri_field *field, scatteri_walk *walk, double t,
                                       double end)
{
    const scatter_vec3 edge = field->edge;
    const float least = 0.5f * scatteri_min(edge.x, scatteri_min(edge.y, edge.z));
    const double start = t;
    float clear = 1.0f;
    while (t < end && clear > 0.0f) {
        const double g[3] = {walk->g[0] + t * walk->dg[0], walk->g[1] + t * walk->dg[1],
                             walk->g[2] + t * walk->dg[2]};
        clear = scatteri_clear_at(field, g);
        clear = clear > least ? clear : 0.0f;
        t += (double)clear;
    }
    if (t > start && t < end)
        scatteri_find_planes(walk, t);
    return t;
}

/* Integral of the field over the segment, exact. Empty cells add 0 exactly, so that passing them changes no bit. The map is
   asked behind two empty cells: most holes are no wider. Adds the cells that were not passed to *cells. */
SCATTERI_HOT static float scatteri_field_depth(const scatteri_field *field, scatteri_segment s,
                                               int *cells)
{
    scatteri_walk walk;
    double sum = 0.0, t = 0.0;
    int empty = 0;
    if (!scatteri_cut_segment(&s, field->grid.box))
        return 0.0f;
    scatteri_begin_walk(field, &s, &walk);
    while (t < s.length) {
        double next, middle[3], mean;
        int i;
        if (empty >= 2 && field->distances != NULL)
            t = scatteri_pass_empty(field, &walk, t, s.length);
        if (t >= s.length)
            break;
        next = scatteri_smaller(s.length, scatteri_first_plane(&walk));
        for (i = 0; i < 3; i++)
            middle[i] = walk.g[i] + 0.5 * (t + next) * walk.dg[i];
        mean = scatteri_cell_mean(&field->grid, &walk, middle, 0.5 * (next - t));
        sum += (next - t) * mean;
        empty = mean > 0.0 ? 0 : empty + 1;
        ++*cells;
        t = next;
        scatteri_pass_planes(&walk, t);
    }
    return field->scale * (float)sum;
}

static scatter_box scatteri_box_from(scatter_box box, scatter_vec3 ref)
{
    scatter_box moved;
    moved.min = scatteri_sub(box.min, ref);
    moved.max = scatteri_sub(box.max, ref);
    return moved;
}

/* Adds the field at 16 points, coordinates relative to `ref`. */
SCATTERI_FN void scatteri_field_lanes_inline(const scatteri_field *field, scatter_vec3 ref,
                                             const float *SCATTERI_RESTRICT x,
                                             const float *SCATTERI_RESTRICT y,
                                             const float *SCATTERI_RESTRICT z,
                                             float *SCATTERI_RESTRICT density)
{
    const scatter_box box = scatteri_box_from(field->grid.box, ref);
    const scatter_vec3 per = field->per_metre;
    const float *voxels = field->grid.density;
    const int nx = field->grid.nx, ny = field->grid.ny, nz = field->grid.nz, slice = nx * ny;
    const float mx = (float)(nx - 1), my = (float)(ny - 1), mz = (float)(nz - 1);
    int base[SCATTERI_LANES], step_x[SCATTERI_LANES], step_y[SCATTERI_LANES],
        step_z[SCATTERI_LANES], l;
    float fx[SCATTERI_LANES], fy[SCATTERI_LANES], fz[SCATTERI_LANES], scale[SCATTERI_LANES];
    for (l = 0; l < SCATTERI_LANES; l++) {
        const float gx = scatteri_clamp((x[l] - box.min.x) * per.x - 0.5f, 0.0f, mx);
        const float gy = scatteri_clamp((y[l] - box.min.y) * per.y - 0.5f, 0.0f, my);
        const float gz = scatteri_clamp((z[l] - box.min.z) * per.z - 0.5f, 0.0f, mz);
        const int i = (int)gx, j = (int)gy, k = (int)gz;
        const int inside = (x[l] >= box.min.x) & (x[l] <= box.max.x) & (y[l] >= box.min.y) &
                           (y[l] <= box.max.y) & (z[l] >= box.min.z) & (z[l] <= box.max.z);
        base[l] = k * slice + j * nx + i;
        step_x[l] = i + 1 < nx;
        step_y[l] = nx & -(j + 1 < ny);
        step_z[l] = slice & -(k + 1 < nz);
        fx[l] = gx - (float)i;
        fy[l] = gy - (float)j;
        fz[l] = gz - (float)k;
        scale[l] = field->scale * (float)inside;
    }
    for (l = 0; l < SCATTERI_LANES; l++) {
        const int b = base[l], sx = step_x[l], sy = step_y[l], sz = step_z[l];
        density[l] += scale[l] * scatteri_trilinear(voxels[b], voxels[b + sx], voxels[b + sy],
                                                    voxels[b + sy + sx], voxels[b + sz],
                                                    voxels[b + sz + sx], voxels[b + sz + sy],
                                                    voxels[b + sz + sy + sx], fx[l], fy[l], fz[l]);
    }
}

/* --- distance map ---
   For each voxel the Euclidean distance d from its centre to where the trilinear field is not 0: the union of boxes that
   reach one voxel to either side of each voxel that is not 0. Squared distances are sums over the axes, so d^2 is found
   axis by axis, exactly and in linear time: along z by counting, along y and x as the lower envelope of parabolas
   (Felzenszwalb and Huttenlocher 2012), many columns at a time. What is stored is

       g = sqrt(max(d^2 - |h|^2/4, 0)),  h: edges of a voxel (0 along an axis with one voxel),

   which is conservative under trilinear interpolation: with r the true distance of a point x and weights w_i of the
   corners around it, sum w_i d_i^2 <= r^2 + V, V <= |h|^2/4 the variance of the corners, and
   - for r >= |h|/2: sqrt(y - k) <= (y - k + r^2)/(2 r) at all corners, k = |h|^2/4, the mean is at most r;
   - for r < |h|/2: sqrt(y - k) <= y/|h|, the mean is at most (r^2 + V)/|h| <= r (docs/theory.md).
   A lookup at the nearest voxel costs an eighth and is what the rays here do: d changes by no more than the way, so x
   is at least g - |x - centre| from all density. 16 bits hold a distance to 1/65535 of the diagonal, half the memory
   traffic of floats; one unit less than g is stored, more than all rounding. */

typedef struct scatteri_mapping {
    const scatter_grid *grid;
    uint16_t *distances;
    float *scratch;
    size_t room; /* floats of scratch memory for one slab */
    int slabs;
    float z_to_y, y_to_x; /* squared ratios of edges */
    float less, units;    /* |h|^2/4 in squares of, and number of units in, an edge along x */
} scatteri_mapping;

/* Counts voxels since the last one that is not 0. */
SCATTERI_HOT static void scatteri_count_up(const float *density, const uint16_t *before, int n,
                                           uint16_t *count)
{
    int i;
    for (i = 0; i < n; i++) {
        const int next = before[i] + 1, most = SCATTERI_NONE;
        count[i] = (uint16_t)((next < most ? next : most) * (density[i] == 0.0f));
    }
}

/* The same from the other side. */
SCATTERI_HOT static void scatteri_count_down(const uint16_t *before, int n, uint16_t *count)
{
    int i;
    for (i = 0; i < n; i++) {
        const int next = before[i] + 1, here = count[i];
        count[i] = (uint16_t)(next < here ? next : here);
    }
}

/* Along z, for all voxels of row j. */
static void scatteri_map_z(void *data, int j)
{
    const scatteri_mapping *job = (const scatteri_mapping *)data;
    const int nx = job->grid->nx, nz = job->grid->nz;
    const size_t slice = (size_t)nx * (size_t)job->grid->ny, row = (size_t)j * (size_t)nx;
    uint16_t *at = job->distances + row;
    int k;
    memset(at, 0xFF, (size_t)nx * sizeof *at);
    for (k = 0; k < nz; k++, at += slice)
        scatteri_count_up(job->grid->density + row + (size_t)k * slice, k > 0 ? at - slice : at, nx,
                          at);
    for (at -= slice, k = nz - 1; k > 0; k--, at -= slice)
        scatteri_count_down(at, nx, at - slice);
}

/* Work space for 32 columns of up to n values: rows 0..n+1 of 32, row i + 1 holds value i of each. Parabolas on the
   envelope are a list: from the last one, `before` leads to the one before it, `from` is where each begins to be the
   lowest. Row 0 ends the lists. */
typedef struct scatteri_columns_work {
    float *f, *wide, *from;
    int *before;
} scatteri_columns_work;

enum { SCATTERI_COLUMNS = 32, SCATTERI_COLUMN_ARRAYS = 4 }; /* 16 and 64 columns are slower */

static scatteri_columns_work scatteri_columns_in(float *memory, int longest)
{
    const size_t size = ((size_t)longest + 2) * SCATTERI_COLUMNS;
    scatteri_columns_work c;
    c.f = memory;
    c.wide = memory + size;
    c.from = memory + 2 * size;
    c.before = (int *)(void *)(memory + 3 * size);
    return c;
}

/* The last parabola of each list. */
typedef struct scatteri_lasts {
    int at[SCATTERI_COLUMNS];
    float f[SCATTERI_COLUMNS], from[SCATTERI_COLUMNS];
} scatteri_lasts;

SCATTERI_FN void scatteri_begin_lists(const scatteri_columns_work *c, scatteri_lasts *last)
{
    int l;
    for (l = 0; l < SCATTERI_COLUMNS; l++) {
        last->at[l] = c->before[l] = 0;
        last->f[l] = c->wide[l] = SCATTERI_FAR;
        last->from[l] = c->from[l] = -2.0f * SCATTERI_FAR;
    }
}

/* Goes back in the lists that are to. */
SCATTERI_FN void scatteri_go_back(const scatteri_columns_work *c, const int *SCATTERI_RESTRICT back,
                                  scatteri_lasts *SCATTERI_RESTRICT last)
{
    const float *f = c->wide, *from = c->from;
    const int *before = c->before;
    int to[SCATTERI_COLUMNS], l;
    for (l = 0; l < SCATTERI_COLUMNS; l++) {
        const int at = last->at[l], earlier = before[at * SCATTERI_COLUMNS + l];
        to[l] = at + ((earlier - at) & -back[l]);
    }
    for (l = 0; l < SCATTERI_COLUMNS; l++) {
        last->at[l] = to[l];
        last->f[l] = f[to[l] * SCATTERI_COLUMNS + l];
        last->from[l] = from[to[l] * SCATTERI_COLUMNS + l];
    }
}

/* Least of each value and its neighbours: the support reaches one voxel further than the voxels. */
SCATTERI_FN void scatteri_widen(const scatteri_columns_work *c, int n)
{
    int i, l;
    for (l = 0; l < SCATTERI_COLUMNS; l++)
        c->f[l] = c->f[(n + 1) * SCATTERI_COLUMNS + l] = SCATTERI_FAR;
    for (i = SCATTERI_COLUMNS; i < (n + 1) * SCATTERI_COLUMNS; i++)
        c->wide[i] = scatteri_min(scatteri_min(c->f[i - SCATTERI_COLUMNS], c->f[i]),
                                  c->f[i + SCATTERI_COLUMNS]);
    for (l = 0; l < SCATTERI_COLUMNS; l++)
        c->wide[(n + 1) * SCATTERI_COLUMNS + l] = SCATTERI_FAR;
}

/* Which columns need parabola i beside its own place: where it is not above that of a neighbour on the side of that
   neighbour, and both together do not hide it. */
SCATTERI_FN int scatteri_needs_parabola(const float *SCATTERI_RESTRICT f,
                                        int *SCATTERI_RESTRICT counts)
{
    int l, some = 0;
    for (l = 0; l < SCATTERI_COLUMNS; l++) {
        const float here = f[l], below = f[l - SCATTERI_COLUMNS], above = f[l + SCATTERI_COLUMNS];
        counts[l] =
            (here + 1.0f < scatteri_max(below, above)) & (2.0f * here - below - above <= 2.0f);
        some |= counts[l];
    }
    return some;
}

/* Where parabola i becomes lower than the last one of each list; returns whether it hides some of these, in `back`. */
SCATTERI_FN int scatteri_begin_parabola(const float *SCATTERI_RESTRICT f, int i,
                                        const int *SCATTERI_RESTRICT counts,
                                        const scatteri_lasts *SCATTERI_RESTRICT last,
                                        float *SCATTERI_RESTRICT start, int *SCATTERI_RESTRICT back)
{
    int l, some = 0;
    for (l = 0; l < SCATTERI_COLUMNS; l++) {
        const float there = (float)last->at[l], here = (float)i;
        const float meet = 0.5f * (here + there + (f[l] - last->f[l]) / (here - there));
        start[l] = scatteri_choose(0.5f, there, meet, -SCATTERI_FAR);
        back[l] = counts[l] & (start[l] <= last->from[l]);
        some |= back[l];
    }
    return some;
}

/* Lists of the parabolas on the envelopes of 32 columns, from below to above. */
SCATTERI_FN void scatteri_list_parabolas(const scatteri_columns_work *c, int n,
                                         scatteri_lasts *last)
{
    float start[SCATTERI_COLUMNS];
    int counts[SCATTERI_COLUMNS], back[SCATTERI_COLUMNS], i, l;
    for (i = 1; i <= n; i++) {
        const int row = i * SCATTERI_COLUMNS;
        if (!scatteri_needs_parabola(c->wide + row, counts))
            continue;
        while (scatteri_begin_parabola(c->wide + row, i, counts, last, start, back))
            scatteri_go_back(c, back, last);
        for (l = 0; l < SCATTERI_COLUMNS; l++) {
            c->before[row + l] = last->at[l];
            c->from[row + l] = start[l];
            last->at[l] = counts[l] ? i : last->at[l];
            last->f[l] = counts[l] ? c->wide[row + l] : last->f[l];
            last->from[l] = counts[l] ? start[l] : last->from[l];
        }
    }
}

/* Which lists hold a parabola that is lowest at i further back. */
SCATTERI_FN int scatteri_is_behind(const scatteri_lasts *last, int i, int *back)
{
    int l, some = 0;
    for (l = 0; l < SCATTERI_COLUMNS; l++) {
        back[l] = last->from[l] > (float)i;
        some |= back[l];
    }
    return some;
}

/* f of 32 columns becomes the least of f[j] + (i - j)^2 over all j, after widening; SCATTERI_FAR: nothing there. */
SCATTERI_HOT static void scatteri_lower_envelopes(const scatteri_columns_work *c, int n)
{
    scatteri_lasts last;
    int back[SCATTERI_COLUMNS], i, l;
    scatteri_widen(c, n);
    scatteri_begin_lists(c, &last);
    scatteri_list_parabolas(c, n, &last);
    for (i = n; i > 0; i--) {
        while (scatteri_is_behind(&last, i, back))
            scatteri_go_back(c, back, &last);
        for (l = 0; l < SCATTERI_COLUMNS; l++) {
            const float off = (float)(i - last.at[l]);
            c->f[i * SCATTERI_COLUMNS + l] =
                scatteri_min(c->wide[i * SCATTERI_COLUMNS + l], last.f[l] + off * off);
        }
    }
}

/* Squared distance in another unit; what has none keeps it. */
SCATTERI_FN float scatteri_rescale(float square, float ratio)
{
    return scatteri_choose(square, SCATTERI_FAR, scatteri_min(square * ratio, 1e29f), SCATTERI_FAR);
}

/* Along y, 32 columns of one slice from i on; `squares` takes squares in edges along x. */
SCATTERI_HOT static void scatteri_map_y(const scatteri_mapping *job, const uint16_t *counts, int i,
                                        const scatteri_columns_work *c, float *squares)
{
    const int nx = job->grid->nx, ny = job->grid->ny;
    const int some = nx - i < SCATTERI_COLUMNS ? nx - i : (int)SCATTERI_COLUMNS;
    int j, l;
    for (j = 0; j < ny; j++) {
        float *f = c->f + (j + 1) * SCATTERI_COLUMNS;
        for (l = 0; l < some; l++) {
            const int count = counts[j * nx + i + l];
            const float z = scatteri_max((float)count - 1.0f, 0.0f);
            const float square = scatteri_min(z * z * job->z_to_y, 1e29f);
            f[l] = scatteri_choose((float)count, (float)SCATTERI_NONE, square, SCATTERI_FAR);
        }
        for (; l < SCATTERI_COLUMNS; l++)
            f[l] = SCATTERI_FAR;
    }
    scatteri_lower_envelopes(c, ny);
    for (j = 0; j < ny; j++)
        for (l = 0; l < some; l++)
            squares[j * nx + i + l] =
                scatteri_rescale(c->f[(j + 1) * SCATTERI_COLUMNS + l], job->y_to_x);
}

SCATTERI_FN float scatteri_to_units(const scatteri_mapping *job, float square)
{
    const float g = scatteri_sqrt(scatteri_max(square - job->less, 0.0f)) * job->units - 1.0f;
    const float kept = scatteri_max(scatteri_cap(g, (float)SCATTERI_NONE - 1.0f), 0.0f);
    return scatteri_choose(square, SCATTERI_FAR, kept, (float)SCATTERI_NONE);
}

/* Along x, 32 rows of one slice from j on. */
SCATTERI_HOT static void scatteri_map_x(const scatteri_mapping *job, const float *squares, int j,
                                        const scatteri_columns_work *c, uint16_t *distances)
{
    const int nx = job->grid->nx, ny = job->grid->ny;
    const int some = ny - j < SCATTERI_COLUMNS ? ny - j : (int)SCATTERI_COLUMNS;
    int i, l;
    for (l = 0; l < SCATTERI_COLUMNS; l++) {
        const float *row = squares + (j + (l < some ? l : some - 1)) * nx;
        for (i = 0; i < nx; i++)
            c->f[(i + 1) * SCATTERI_COLUMNS + l] = row[i];
    }
    scatteri_lower_envelopes(c, nx);
    for (i = SCATTERI_COLUMNS; i < (nx + 1) * SCATTERI_COLUMNS; i++)
        c->f[i] = scatteri_to_units(job, c->f[i]);
    for (l = 0; l < some; l++)
        for (i = 0; i < nx; i++)
            distances[(j + l) * nx + i] = (uint16_t)(int)c->f[(i + 1) * SCATTERI_COLUMNS + l];
}

/* Along y and x, slices of one slab. */
static void scatteri_map_slab(void *data, int slab)
{
    const scatteri_mapping *job = (const scatteri_mapping *)data;
    const scatter_grid *grid = job->grid;
    const int longest = grid->nx > grid->ny ? grid->nx : grid->ny;
    const size_t slice = (size_t)grid->nx * (size_t)grid->ny;
    float *squares = job->scratch + (size_t)slab * job->room;
    const scatteri_columns_work columns = scatteri_columns_in(squares + slice, longest);
    int i, j, k;
    for (k = (int)((int64_t)grid->nz * slab / job->slabs);
         k < (int)((int64_t)grid->nz * (slab + 1) / job->slabs); k++) {
        uint16_t *distances = job->distances + (size_t)k * slice;
        for (i = 0; i < grid->nx; i += SCATTERI_COLUMNS)
            scatteri_map_y(job, distances, i, &columns, squares);
        for (j = 0; j < grid->ny; j += SCATTERI_COLUMNS)
            scatteri_map_x(job, squares, j, &columns, distances);
    }
}

static float scatteri_square_ratio(double a, double b)
{
    return (float)scatteri_smaller(a / b * (a / b), 1e29);
}

static scatteri_mapping scatteri_mapping_of(const scatter_grid *grid)
{
    const double x = ((double)grid->box.max.x - (double)grid->box.min.x) / grid->nx;
    const double y = ((double)grid->box.max.y - (double)grid->box.min.y) / grid->ny;
    const double z = ((double)grid->box.max.z - (double)grid->box.min.z) / grid->nz;
    const int longest = grid->nx > grid->ny ? grid->nx : grid->ny;
    scatteri_mapping job;
    memset(&job, 0, sizeof job);
    job.grid = grid;
    job.slabs = grid->nz < SCATTERI_SLABS ? grid->nz : SCATTERI_SLABS;
    job.room = (size_t)grid->nx * (size_t)grid->ny +
               SCATTERI_COLUMN_ARRAYS * ((size_t)longest + 2) * SCATTERI_COLUMNS;
    job.z_to_y = scatteri_square_ratio(z, y);
    job.y_to_x = scatteri_square_ratio(y, x);
    job.less =
        0.25f * ((float)(grid->nx > 1) + (float)(grid->ny > 1) * scatteri_square_ratio(y, x) +
                 (float)(grid->nz > 1) * scatteri_square_ratio(z, x));
    job.units = (float)(x / (double)scatteri_field_of(grid).unit);
    return job;
}

/* Bytes of the map and of what it is made with; 0: more than size_t holds. */
static size_t scatteri_map_bytes(const scatter_grid *grid)
{
    const scatteri_mapping job = scatteri_mapping_of(grid);
    const size_t voxels = (size_t)grid->nx * (size_t)grid->ny * (size_t)grid->nz;
    return (voxels + 1) / 2 * 2 * sizeof(uint16_t) + (size_t)job.slabs * job.room * sizeof(float);
}

/* Makes the map in `memory` of scatteri_map_bytes. */
static void scatteri_map_distances(const scatter_host *host, scatteri_field *field, void *memory)
{
    const size_t voxels = (size_t)field->grid.nx * (size_t)field->grid.ny * (size_t)field->grid.nz;
    scatteri_mapping job = scatteri_mapping_of(&field->grid);
    scatter_host quiet = *host;
    const scatteri_stage stage = {&quiet, 0.0f, 1.0f};
    quiet.progress = NULL;
    job.distances = (uint16_t *)memory;
    job.scratch = (float *)memory + (voxels + 1) / 2;
    (void)scatteri_parallel(&stage, field->grid.ny, scatteri_map_z, &job);
    (void)scatteri_parallel(&stage, job.slabs, scatteri_map_slab, &job);
    field->distances = job.distances;
}

/* --- one term at a time --- */

/* a^2 r^2 beyond which a Gaussian is dropped: exp(-14) = 8e-7 of its centre, less for large amplitudes, so that
   what is dropped stays below 1e-6 of a metre of optical depth. */
static float scatteri_reach(scatter_gaussian g)
{
    const float amplitude = g.c * 1.77245385f / g.a;
    return 14.0f + (amplitude > 1.0f ? scatteri_log(amplitude) : 0.0f);
}

static float scatteri_analytic_density(const scatter_medium *medium, float y)
{
    float density = medium->constant;
    size_t i;
    for (i = 0; i < medium->height_count; i++) {
        const scatter_height h = medium->heights[i];
        const float exponent = (h.y0 - y) / h.scale;
        density += h.density * scatteri_exp(exponent < 80.0f ? exponent : 80.0f);
    }
    return density;
}

static float scatteri_analytic_depth(const scatter_medium *medium, float y, float dy, float length)
{
    float depth = medium->constant * length;
    size_t i;
    for (i = 0; i < medium->height_count; i++) {
        const scatter_height h = medium->heights[i];
        depth += scatteri_height_depth(h.density, h.y0, h.scale, y, dy, length);
    }
    return depth < SCATTERI_FAR ? depth : SCATTERI_FAR;
}

static float scatteri_gaussian_depth(scatter_gaussian g, const scatteri_segment *s)
{
    const double x = (double)g.center.x - s->origin[0], y = (double)g.center.y - s->origin[1];
    const double z = (double)g.center.z - s->origin[2], a = (double)g.a;
    const double m = x * s->direction[0] + y * s->direction[1] + z * s->direction[2];
    const double px = x - m * s->direction[0], py = y - m * s->direction[1],
                 pz = z - m * s->direction[2];
    const float e =
        scatteri_exp((float)-scatteri_smaller(a * a * (px * px + py * py + pz * pz), 1e4));
    const float low = (float)scatteri_larger(scatteri_smaller(-a * m, 1e6), -1e6);
    const float high = (float)scatteri_larger(scatteri_smaller(a * (s->length - m), 1e6), -1e6);
    const float half = (float)scatteri_smaller(0.5 * a * s->length, 1e6);
    return g.c * e * scatteri_erf_span(low, high, half) * (0.88622693f / g.a);
}

/* Depth of the local terms along the segment. */
static float scatteri_local_depth(const scatter_medium *medium, const scatteri_segment *s)
{
    float depth = 0.0f;
    int cells = 0;
    size_t i;
    for (i = 0; i < medium->gaussian_count; i++)
        depth += scatteri_gaussian_depth(medium->gaussians[i], s);
    for (i = 0; i < medium->grid_count; i++) {
        const scatteri_field field = scatteri_field_of(&medium->grids[i]);
        depth += scatteri_field_depth(&field, *s, &cells);
    }
    return depth;
}

static int scatteri_bounded(const scatter_medium *medium, scatter_vec3 p, scatter_vec3 direction,
                            float *t0, float *t1)
{
    return !medium->bounded || scatteri_clip(medium->bounds, p, direction, t0, t1);
}

SCATTER_API float scatter_density(const scatter_medium *medium, scatter_vec3 x)
{
    float density = scatteri_analytic_density(medium, x.y);
    size_t i;
    if (medium->bounded && !scatteri_inside(medium->bounds, x))
        return 0.0f;
    for (i = 0; i < medium->gaussian_count; i++) {
        const scatter_gaussian g = medium->gaussians[i];
        const scatter_vec3 d = scatteri_scale(scatteri_sub(x, g.center), g.a);
        density += g.c * scatteri_exp(-scatteri_dot(d, d));
    }
    for (i = 0; i < medium->grid_count; i++) {
        const scatteri_field field = scatteri_field_of(&medium->grids[i]);
        density += scatteri_field_at(&field, x);
    }
    return density;
}

SCATTER_API float scatter_optical_depth(const scatter_medium *medium, scatter_vec3 p,
                                        scatter_vec3 q)
{
    scatteri_segment s = scatteri_segment_between(p, q);
    if (!(s.length > 0.0) || (medium->bounded && !scatteri_cut_segment(&s, medium->bounds)))
        return 0.0f;
    return scatteri_analytic_depth(medium, (float)s.origin[1], (float)s.direction[1],
                                   (float)s.length) +
           scatteri_local_depth(medium, &s);
}

/* --- the prepared medium --- */

/* Gaussians as arrays, padded to whole lanes with entries that reach nowhere. */
typedef struct scatteri_gaussians {
    int count, padded;
    float *x, *y, *z, *a, *c, *reach;
} scatteri_gaussians;

typedef struct scatteri_medium {
    scatter_medium desc; /* arrays point into `memory`, voxels to the host's */
    scatteri_gaussians gaussians;
    scatteri_field *fields; /* one for each grid */
    scatteri_lobes lobes;
    float turn;        /* -1: the lobes are of the opposite angle */
    scatter_box local; /* outside, the local terms are 0 */
    int has_local, has_analytic, gray;
    float sigma_least; /* of the channels with extinction; 0 if none has */
    float sigma_most;
    scatteri_buffer memory, distances;
} scatteri_medium;

static scatteri_lobes scatteri_lobes_of(const scatter_phase *phase)
{
    switch (phase->kind) {
    case SCATTER_PHASE_HG: return scatteri_lobe(phase->g, 0.0f);
    case SCATTER_PHASE_RAYLEIGH: return scatteri_lobe(0.0f, 1.0f);
    case SCATTER_PHASE_DRAINE: return scatteri_lobe(phase->g, phase->alpha);
    case SCATTER_PHASE_DROPLETS: return scatteri_droplets(phase->diameter_um);
    case SCATTER_PHASE_ISOTROPIC: break;
    }
    return scatteri_lobe(0.0f, 0.0f);
}

/* Makes a lobe that points backwards one of the opposite angle, p(cos; g) = p(-cos; -g), so that 1 - cos keeps the
   digits of narrow ones; -1 then, else 1. */
static float scatteri_turn_lobes(scatteri_lobes *lobes)
{
    if (lobes->weight > 0.0f || !(lobes->g1 < 0.0f))
        return 1.0f;
    lobes->g1 = -lobes->g1;
    return -1.0f;
}

SCATTER_API float scatter_phase_value(const scatter_phase *phase, float cos_theta)
{
    scatteri_lobes lobes = scatteri_lobes_of(phase);
    const float turn = scatteri_turn_lobes(&lobes);
    return scatteri_phase(lobes, 1.0f - turn * scatteri_clamp(cos_theta, -1.0f, 1.0f));
}

static void scatteri_grow(scatter_box *box, scatter_vec3 low, scatter_vec3 high)
{
    box->min.x = low.x < box->min.x ? low.x : box->min.x;
    box->min.y = low.y < box->min.y ? low.y : box->min.y;
    box->min.z = low.z < box->min.z ? low.z : box->min.z;
    box->max.x = high.x > box->max.x ? high.x : box->max.x;
    box->max.y = high.y > box->max.y ? high.y : box->max.y;
    box->max.z = high.z > box->max.z ? high.z : box->max.z;
}

static void scatteri_shrink(scatter_box *box, scatter_box by)
{
    box->min.x = by.min.x > box->min.x ? by.min.x : box->min.x;
    box->min.y = by.min.y > box->min.y ? by.min.y : box->min.y;
    box->min.z = by.min.z > box->min.z ? by.min.z : box->min.z;
    box->max.x = by.max.x < box->max.x ? by.max.x : box->max.x;
    box->max.y = by.max.y < box->max.y ? by.max.y : box->max.y;
    box->max.z = by.max.z < box->max.z ? by.max.z : box->max.z;
}

/* Box of the Gaussians' supports and the grids, cut to the bounds. */
static void scatteri_find_local(scatteri_medium *medium)
{
    const scatter_medium *desc = &medium->desc;
    const scatter_vec3 beyond = {SCATTERI_FAR, SCATTERI_FAR, SCATTERI_FAR};
    size_t i;
    medium->local.min = beyond;
    medium->local.max = scatteri_scale(beyond, -1.0f);
    for (i = 0; i < desc->gaussian_count; i++) {
        const scatter_gaussian g = desc->gaussians[i];
        const float r = scatteri_sqrt(scatteri_reach(g)) / g.a;
        const scatter_vec3 reach = {r, r, r};
        if (g.c > 0.0f)
            scatteri_grow(&medium->local, scatteri_sub(g.center, reach),
                          scatteri_add(g.center, reach));
    }
    for (i = 0; i < desc->grid_count; i++)
        scatteri_grow(&medium->local, desc->grids[i].box.min, desc->grids[i].box.max);
    if (desc->bounded)
        scatteri_shrink(&medium->local, desc->bounds);
    medium->has_local = medium->local.min.x < medium->local.max.x &&
                        medium->local.min.y < medium->local.max.y &&
                        medium->local.min.z < medium->local.max.z;
}

static void scatteri_fill_gaussians(scatteri_gaussians *out, const scatter_gaussian *in,
                                    float *memory)
{
    const size_t n = (size_t)out->padded;
    int i;
    out->x = memory;
    out->y = memory + n;
    out->z = memory + 2 * n;
    out->a = memory + 3 * n;
    out->c = memory + 4 * n;
    out->reach = memory + 5 * n;
    for (i = 0; i < out->padded; i++) {
        const int real = i < out->count && in[i].c > 0.0f;
        out->x[i] = real ? in[i].center.x : 0.0f;
        out->y[i] = real ? in[i].center.y : 0.0f;
        out->z[i] = real ? in[i].center.z : 0.0f;
        out->a[i] = real ? in[i].a : 1.0f;
        out->c[i] = real ? in[i].c : 0.0f;
        out->reach[i] = real ? scatteri_reach(in[i]) : -1.0f;
    }
}

/* Colour and phase, which no volume depends on. */
static void scatteri_take_optics(scatteri_medium *medium, const scatter_medium *desc)
{
    const scatter_vec3 s = desc->extinction;
    const float least_xy = s.x > 0.0f && (s.x < s.y || !(s.y > 0.0f)) ? s.x : s.y;
    medium->desc.extinction = s;
    medium->desc.albedo = desc->albedo;
    medium->desc.emission = desc->emission;
    medium->desc.phase = desc->phase;
    medium->lobes = scatteri_lobes_of(&desc->phase);
    medium->turn = scatteri_turn_lobes(&medium->lobes);
    medium->gray = s.x == s.y && s.y == s.z;
    medium->sigma_least = least_xy > 0.0f && (least_xy < s.z || !(s.z > 0.0f)) ? least_xy : s.z;
    medium->sigma_most = s.x > s.y ? s.x : s.y;
    medium->sigma_most = s.z > medium->sigma_most ? s.z : medium->sigma_most;
}

/* Maps of distances for all grids. */
static scatter_result scatteri_map_medium(const scatter_host *host, scatteri_medium *medium)
{
    size_t bytes = 0, i;
    scatter_result result;
    char *memory;
    for (i = 0; i < medium->desc.grid_count; i++)
        bytes += scatteri_map_bytes(&medium->desc.grids[i]);
    result = scatteri_reserve(host, &medium->distances, bytes, "the distances to voxels");
    memory = (char *)medium->distances.data;
    for (i = 0; i < medium->desc.grid_count && result == SCATTER_OK; i++) {
        scatteri_map_distances(host, &medium->fields[i], memory);
        memory += scatteri_map_bytes(&medium->desc.grids[i]);
    }
    return result;
}

/* Copies the description and prepares it, without maps of distances. */
static scatter_result scatteri_prepare(const scatter_host *host, scatteri_medium *medium,
                                       const scatter_medium *desc)
{
    const size_t padded =
        (desc->gaussian_count + SCATTERI_LANES - 1) / SCATTERI_LANES * SCATTERI_LANES;
    const size_t gaussians = desc->gaussian_count * sizeof(scatter_gaussian);
    const size_t heights = desc->height_count * sizeof(scatter_height);
    const size_t grids = desc->grid_count * sizeof(scatter_grid);
    const size_t fields = desc->grid_count * sizeof(scatteri_field);
    const size_t arrays = padded * 6 * sizeof(float);
    const scatter_result result = scatteri_reserve(
        host, &medium->memory, fields + grids + gaussians + heights + arrays + sizeof(float),
        "the medium");
    char *memory = (char *)medium->memory.data;
    size_t i;
    if (result != SCATTER_OK)
        return result;
    medium->desc = *desc;
    medium->has_analytic = desc->constant > 0.0f || desc->height_count > 0;
    scatteri_take_optics(medium, desc);
    medium->fields = (scatteri_field *)(void *)memory;
    memory += fields;
    if (grids > 0)
        medium->desc.grids = (const scatter_grid *)memcpy(memory, desc->grids, grids);
    memory += grids;
    if (gaussians > 0)
        medium->desc.gaussians =
            (const scatter_gaussian *)memcpy(memory, desc->gaussians, gaussians);
    memory += gaussians;
    if (heights > 0)
        medium->desc.heights = (const scatter_height *)memcpy(memory, desc->heights, heights);
    memory += heights;
    medium->gaussians.count = (int)desc->gaussian_count;
    medium->gaussians.padded = (int)padded;
    scatteri_fill_gaussians(&medium->gaussians, desc->gaussians, (float *)(void *)memory);
    scatteri_find_local(medium);
    for (i = 0; i < desc->grid_count; i++)
        medium->fields[i] = scatteri_field_of(&medium->desc.grids[i]);
    return SCATTER_OK;
}

static int scatteri_same(const void *a, const void *b, size_t count, size_t size)
{
    return count == 0 || memcmp(a, b, count * size) == 0;
}

static int scatteri_same_box(scatter_box a, scatter_box b)
{
    return a.min.x == b.min.x && a.min.y == b.min.y && a.min.z == b.min.z && a.max.x == b.max.x &&
           a.max.y == b.max.y && a.max.z == b.max.z;
}

static int scatteri_same_grid(const scatter_grid *a, const scatter_grid *b)
{
    return a->density == b->density && a->nx == b->nx && a->ny == b->ny && a->nz == b->nz &&
           scatteri_same_box(a->box, b->box) && a->scale == b->scale && a->version == b->version;
}

/* Whether density is the same everywhere, as far as the descriptions tell. */
static int scatteri_same_density(const scatter_medium *a, const scatter_medium *b)
{
    size_t i;
    if (a->bounded != b->bounded || (a->bounded && !scatteri_same_box(a->bounds, b->bounds)) ||
        a->constant != b->constant || a->height_count != b->height_count ||
        a->gaussian_count != b->gaussian_count || a->grid_count != b->grid_count ||
        !scatteri_same(a->heights, b->heights, a->height_count, sizeof(scatter_height)) ||
        !scatteri_same(a->gaussians, b->gaussians, a->gaussian_count, sizeof(scatter_gaussian)))
        return 0;
    for (i = 0; i < a->grid_count; i++)
        if (!scatteri_same_grid(&a->grids[i], &b->grids[i]))
            return 0;
    return 1;
}

static void scatteri_drop_medium(const scatter_host *host, scatteri_medium *medium)
{
    scatteri_drop(host, &medium->memory);
    scatteri_drop(host, &medium->distances);
}

/* --- inject --- */

typedef struct scatteri_injection {
    const scatter_medium *medium;
    scatter_volume volume;
    scatter_vec3 cell; /* m */
    int analytic;      /* with constant and height fog */
    int slabs;
} scatteri_injection;

enum { SCATTERI_ROW = 512 };

static float scatteri_cell_center(float low, float cell, int i)
{
    return low + ((float)i + 0.5f) * cell;
}

/* First and one past the last cell whose centre is within r of x on one axis. */
static void scatteri_overlap(float x, float r, float low, float cell, int n, int *first, int *end)
{
    const float a = scatteri_clamp((x - low - r) / cell - 0.5f, 0.0f, (float)n);
    const float b = scatteri_clamp((x - low + r) / cell + 0.5f, 0.0f, (float)n);
    *first = (int)ceil((double)a);
    *end = (int)ceil((double)b);
}

/* The Gaussian is a product of one factor for each axis: an exponential for each row, not for each cell. */
SCATTERI_HOT static void scatteri_splat(const scatteri_injection *job, scatter_gaussian g, int z0,
                                        int z1)
{
    const scatter_volume *v = &job->volume;
    const float r = scatteri_sqrt(scatteri_reach(g)) / g.a, a2 = g.a * g.a;
    float factor[SCATTERI_ROW];
    int i0, i1, j0, j1, k0, k1, start, i, j, k;
    scatteri_overlap(g.center.x, r, v->box.min.x, job->cell.x, v->nx, &i0, &i1);
    scatteri_overlap(g.center.y, r, v->box.min.y, job->cell.y, v->ny, &j0, &j1);
    scatteri_overlap(g.center.z, r, v->box.min.z, job->cell.z, v->nz, &k0, &k1);
    k0 = k0 > z0 ? k0 : z0;
    k1 = k1 < z1 ? k1 : z1;
    for (start = i0; k0 < k1 && start < i1; start += SCATTERI_ROW) {
        const int count = i1 - start < SCATTERI_ROW ? i1 - start : SCATTERI_ROW;
        for (i = 0; i < count; i++) {
            const float dx =
                scatteri_cell_center(v->box.min.x - g.center.x, job->cell.x, start + i);
            factor[i] = scatteri_exp(-a2 * dx * dx);
        }
        for (k = k0; k < k1; k++)
            for (j = j0; j < j1; j++) {
                const float dy = scatteri_cell_center(v->box.min.y - g.center.y, job->cell.y, j);
                const float dz = scatteri_cell_center(v->box.min.z - g.center.z, job->cell.z, k);
                const float yz = g.c * scatteri_exp(-a2 * (dy * dy + dz * dz));
                float *row =
                    v->values + ((size_t)k * (size_t)v->ny + (size_t)j) * (size_t)v->nx + start;
                for (i = 0; i < count; i++)
                    row[i] += yz * factor[i];
            }
    }
}

/* Centre of a cell, relative to the corner of the volume: far from 0 it is no float. */
static scatter_vec3 scatteri_cell_of(const scatteri_injection *job, int i, int j, int k)
{
    return scatteri_v3(scatteri_cell_center(0.0f, job->cell.x, i),
                       scatteri_cell_center(0.0f, job->cell.y, j),
                       scatteri_cell_center(0.0f, job->cell.z, k));
}

/* Everything but the Gaussians. */
static void scatteri_inject_row(const scatteri_injection *job, int j, int k, float *row)
{
    const scatter_volume *v = &job->volume;
    const float y = scatteri_cell_center(v->box.min.y, job->cell.y, j);
    size_t term;
    int i;
    for (i = 0; i < v->nx; i++)
        row[i] = job->analytic ? scatteri_analytic_density(job->medium, y) : 0.0f;
    for (term = 0; term < job->medium->grid_count; term++) {
        scatteri_field field = scatteri_field_of(&job->medium->grids[term]);
        field.grid.box = scatteri_box_from(field.grid.box, v->box.min);
        for (i = 0; i < v->nx; i++)
            row[i] += scatteri_field_at(&field, scatteri_cell_of(job, i, j, k));
    }
}

static void scatteri_empty_outside(const scatteri_injection *job, int j, int k, float *row)
{
    const scatter_volume *v = &job->volume;
    const scatter_box bounds = scatteri_box_from(job->medium->bounds, v->box.min);
    int i;
    for (i = 0; i < v->nx; i++)
        row[i] = scatteri_inside(bounds, scatteri_cell_of(job, i, j, k)) ? row[i] : 0.0f;
}

static void scatteri_inject_slab(void *data, int slab)
{
    const scatteri_injection *job = (const scatteri_injection *)data;
    const scatter_volume *v = &job->volume;
    const int z0 = (int)((int64_t)v->nz * slab / job->slabs),
              z1 = (int)((int64_t)v->nz * (slab + 1) / job->slabs);
    const size_t nx = (size_t)v->nx, ny = (size_t)v->ny;
    size_t g;
    int j, k;
    for (k = z0; k < z1; k++)
        for (j = 0; j < v->ny; j++)
            scatteri_inject_row(job, j, k, v->values + ((size_t)k * ny + (size_t)j) * nx);
    for (g = 0; g < job->medium->gaussian_count; g++)
        scatteri_splat(job, job->medium->gaussians[g], z0, z1);
    for (k = z0; k < z1 && job->medium->bounded; k++)
        for (j = 0; j < v->ny; j++)
            scatteri_empty_outside(job, j, k, v->values + ((size_t)k * ny + (size_t)j) * nx);
}

static scatter_result scatteri_inject(const scatteri_stage *stage, const scatter_medium *medium,
                                      const scatter_volume *volume, int analytic)
{
    scatteri_injection job;
    job.medium = medium;
    job.volume = *volume;
    job.cell = scatteri_v3((volume->box.max.x - volume->box.min.x) / (float)volume->nx,
                           (volume->box.max.y - volume->box.min.y) / (float)volume->ny,
                           (volume->box.max.z - volume->box.min.z) / (float)volume->nz);
    job.analytic = analytic;
    job.slabs = volume->nz < SCATTERI_SLABS ? volume->nz : SCATTERI_SLABS;
    return scatteri_parallel(stage, job.slabs, scatteri_inject_slab, &job);
}

/* --- Gaussians along 16 rays ---
   Neighbouring rays go together, one in each lane. On a ray a Gaussian is c exp(-a^2 (h^2 + (t - m)^2)), m where it is
   closest and h the distance there. The Gaussians that reach the rays are gathered into a page; its constants serve
   all nodes. */

/* Position of ray l at t: ref + (ox, oy, oz)[l] + t (dx, dy, dz)[l]. What the lanes compute with is relative to `ref`,
   the origin of the first ray, so that a scene far from 0 loses no digits. */
typedef struct scatteri_rays {
    scatter_vec3 ref;
    float ox[SCATTERI_LANES], oy[SCATTERI_LANES], oz[SCATTERI_LANES];
    float dx[SCATTERI_LANES], dy[SCATTERI_LANES], dz[SCATTERI_LANES]; /* unit */
    float t0[SCATTERI_LANES], t1[SCATTERI_LANES];                     /* t0 = t1: nothing to do */
} scatteri_rays;

static scatter_vec3 scatteri_ray_origin(const scatteri_rays *rays, int l)
{
    return scatteri_v3(rays->ox[l], rays->oy[l], rays->oz[l]);
}

static scatter_vec3 scatteri_ray_direction(const scatteri_rays *rays, int l)
{
    return scatteri_v3(rays->dx[l], rays->dy[l], rays->dz[l]);
}

static float scatteri_least(const float *lanes)
{
    float least = lanes[0];
    int l;
    for (l = 1; l < SCATTERI_LANES; l++)
        least = lanes[l] < least ? lanes[l] : least;
    return least;
}

static float scatteri_most(const float *lanes)
{
    float most = lanes[0];
    int l;
    for (l = 1; l < SCATTERI_LANES; l++)
        most = lanes[l] > most ? lanes[l] : most;
    return most;
}

/* How much earlier than at their full reach Gaussians end, in units of a^2 r^2. A rule of few nodes errs by more than
   their thin rims hold. */
typedef struct scatteri_trim {
    float rays;  /* the stretch of an eye ray that takes nodes; the depth across it stays whole */
    float depth; /* whole Gaussians are left out of depth and density */
} scatteri_trim;

/* A box with its own axes, low <= axis . x <= high, x relative to `ref`. */
typedef struct scatteri_slabs {
    scatter_vec3 ref, axis[3];
    float low[3], high[3];
} scatteri_slabs;

/* Around both ends of all rays. */
SCATTERI_HOT static void scatteri_hold_rays(scatteri_slabs *SCATTERI_RESTRICT slabs,
                                            const scatteri_rays *SCATTERI_RESTRICT rays)
{
    int i, l;
    slabs->ref = rays->ref;
    for (i = 0; i < 3; i++) {
        const scatter_vec3 n = slabs->axis[i];
        float a[SCATTERI_LANES], b[SCATTERI_LANES];
        for (l = 0; l < SCATTERI_LANES; l++) {
            const float o = n.x * rays->ox[l] + n.y * rays->oy[l] + n.z * rays->oz[l];
            const float d = n.x * rays->dx[l] + n.y * rays->dy[l] + n.z * rays->dz[l];
            const float first = o + d * rays->t0[l], last = o + d * rays->t1[l];
            a[l] = scatteri_min(first, last);
            b[l] = scatteri_max(first, last);
        }
        slabs->low[i] = scatteri_least(a);
        slabs->high[i] = scatteri_most(b);
    }
}

/* Which of 16 Gaussians reach the box. */
SCATTERI_FN int scatteri_near_slabs(const scatteri_gaussians *g, const scatteri_slabs *slabs,
                                    float trim, int first, int *SCATTERI_RESTRICT keep)
{
    float worst[SCATTERI_LANES];
    int i, l, any = 0;
    for (l = 0; l < SCATTERI_LANES; l++)
        worst[l] = 0.0f;
    for (i = 0; i < 3; i++) {
        const scatter_vec3 n = slabs->axis[i], o = slabs->ref;
        const float low = slabs->low[i], high = slabs->high[i];
        for (l = 0; l < SCATTERI_LANES; l++) {
            const float d = n.x * (g->x[first + l] - o.x) + n.y * (g->y[first + l] - o.y) +
                            n.z * (g->z[first + l] - o.z);
            worst[l] = scatteri_max(worst[l], scatteri_max(low - d, d - high));
        }
    }
    for (l = 0; l < SCATTERI_LANES; l++) {
        keep[l] =
            g->a[first + l] * g->a[first + l] * worst[l] * worst[l] < g->reach[first + l] - trim;
        any |= keep[l];
    }
    return any;
}

typedef struct scatteri_page {
    scatteri_trim trim; /* set before Gaussians are gathered */
    int count;
    int next;     /* the first Gaussian that was not looked at */
    int complete; /* all that reach the rays are here */
    float a[SCATTERI_PAGE], c[SCATTERI_PAGE];
    float reach[SCATTERI_PAGE]; /* where the stretch with nodes ends */
    float scale[SCATTERI_PAGE]; /* c sqrt(pi)/(2a) */
    float m[SCATTERI_PAGE][SCATTERI_LANES];
    float fade[SCATTERI_PAGE][SCATTERI_LANES]; /* a^2 h^2 */
    float before[SCATTERI_PAGE]
                [SCATTERI_LANES]; /* depth from t0 to t is before + scale q for t < m, */
    float behind[SCATTERI_PAGE]
                [SCATTERI_LANES]; /* behind - scale q else; q = erfc(a|t - m|) exp(-a^2 h^2) */
} scatteri_page;

/* Puts Gaussian number `from` at the end of the page if it reaches a ray. */
SCATTERI_FN void scatteri_add_to_page(const scatteri_gaussians *g, int from,
                                      const scatteri_rays *rays, scatteri_page *page)
{
    const float x = g->x[from] - rays->ref.x, y = g->y[from] - rays->ref.y,
                z = g->z[from] - rays->ref.z;
    const float a = g->a[from], reach = g->reach[from] - page->trim.depth;
    const float scale = g->c[from] * 0.886226925f / a;
    const int i = page->count;
    float *m = page->m[i], *fade = page->fade[i], *before = page->before[i],
          *behind = page->behind[i];
    int l, any = 0;
    for (l = 0; l < SCATTERI_LANES; l++) {
        const float px = x - rays->ox[l], py = y - rays->oy[l], pz = z - rays->oz[l];
        const float along = px * rays->dx[l] + py * rays->dy[l] + pz * rays->dz[l];
        const float hx = px - along * rays->dx[l], hy = py - along * rays->dy[l],
                    hz = pz - along * rays->dz[l];
        const float past =
            scatteri_max(scatteri_max(rays->t0[l] - along, along - rays->t1[l]), 0.0f);
        m[l] = along;
        fade[l] = a * a * (hx * hx + hy * hy + hz * hz);
        any |= (fade[l] + a * a * past * past < reach) & (rays->t0[l] < rays->t1[l]);
    }
    if (!any)
        return;
    for (l = 0; l < SCATTERI_LANES; l++) {
        const float s = a * (rays->t0[l] - m[l]);
        const float q = scale * scatteri_erfcx(scatteri_abs(s)) * scatteri_decay(fade[l] + s * s);
        const float whole = 2.0f * scale * scatteri_decay(fade[l]);
        before[l] = scatteri_choose(s, 0.0f, -q, q - whole); /* t may lie before t0 */
        behind[l] = scatteri_choose(s, 0.0f, whole - q, q);
    }
    page->a[i] = a;
    page->c[i] = g->c[from];
    page->reach[i] = g->reach[from] - page->trim.rays;
    page->scale[i] = scale;
    page->count++;
}

/* Fills the page with Gaussians that reach the rays, from number `first` on. */
SCATTERI_HOT static void scatteri_gather(const scatteri_gaussians *g, const scatteri_rays *rays,
                                         const scatteri_slabs *slabs, int first,
                                         scatteri_page *page)
{
    const int from_start = first == 0;
    int keep[SCATTERI_LANES], l;
    page->count = 0;
    for (; first < g->padded && page->count <= SCATTERI_PAGE - SCATTERI_LANES;
         first += SCATTERI_LANES) {
        if (!scatteri_near_slabs(g, slabs, page->trim.depth, first, keep))
            continue;
        for (l = 0; l < SCATTERI_LANES; l++)
            if (keep[l])
                scatteri_add_to_page(g, first + l, rays, page);
    }
    page->next = first;
    page->complete = from_start && first >= g->padded;
}

static scatter_vec3 scatteri_perpendicular(scatter_vec3 w)
{
    const scatter_vec3 x = {1.0f, 0.0f, 0.0f}, y = {0.0f, 1.0f, 0.0f};
    return scatteri_normalize(scatteri_cross(w, scatteri_abs(w.x) < 0.6f ? x : y));
}

/* Neighbouring rays are long and thin together: a box along the first one. */
static scatteri_slabs scatteri_slabs_of_rays(const scatteri_rays *rays)
{
    scatteri_slabs slabs;
    slabs.axis[0] = scatteri_ray_direction(rays, 0);
    slabs.axis[1] = scatteri_perpendicular(slabs.axis[0]);
    slabs.axis[2] = scatteri_cross(slabs.axis[0], slabs.axis[1]);
    scatteri_hold_rays(&slabs, rays);
    return slabs;
}

/* Adds density and depth (from t0) of Gaussians from..end of the page at `count` points, point i on ray i % 16 at t[i] >= t0. The exponential
   of the density is also that of the erfc in the depth, so both cost one. */
SCATTERI_HOT static void scatteri_add_some(const scatteri_page *page, int from, int end, int count,
                                           const float *SCATTERI_RESTRICT t,
                                           float *SCATTERI_RESTRICT density,
                                           float *SCATTERI_RESTRICT depth)
{
    int first, g, l;
    for (first = 0; first < count; first += SCATTERI_LANES) {
        float d[SCATTERI_LANES], tau[SCATTERI_LANES], at[SCATTERI_LANES];
        for (l = 0; l < SCATTERI_LANES; l++) {
            at[l] = t[first + l];
            d[l] = density[first + l];
            tau[l] = depth[first + l];
        }
        for (g = from; g < end; g++) {
            const float a = page->a[g], c = page->c[g], scale = page->scale[g];
            const float *m = page->m[g], *fade = page->fade[g], *before = page->before[g],
                        *behind = page->behind[g];
            for (l = 0; l < SCATTERI_LANES; l++) {
                const float x = a * (at[l] - m[l]);
                const float e = scatteri_decay(fade[l] + x * x);
                const float q = scale * scatteri_erfcx(scatteri_abs(x)) * e;
                d[l] += c * e;
                tau[l] += scatteri_choose(x, 0.0f, before[l] + q, behind[l] - q);
            }
        }
        for (l = 0; l < SCATTERI_LANES; l++) {
            density[first + l] = d[l];
            depth[first + l] = tau[l];
        }
    }
}

/* All Gaussians at the points; gathers page after page if one does not hold them all. */
static void scatteri_add_gaussians(const scatteri_gaussians *g, const scatteri_rays *rays,
                                   scatteri_page *page, int count, const float *t, float *density,
                                   float *depth)
{
    scatteri_slabs slabs;
    if (page->complete) {
        scatteri_add_some(page, 0, page->count, count, t, density, depth);
        return;
    }
    slabs = scatteri_slabs_of_rays(rays);
    page->next = 0;
    while (page->next < g->padded) {
        scatteri_gather(g, rays, &slabs, page->next, page);
        scatteri_add_some(page, 0, page->count, count, t, density, depth);
    }
    page->complete = 0;
}

/* How far around the points at t on 16 rays the field is certainly 0, m; not > 0: not known. Lowers `clear` to it. */
SCATTERI_HOT static void scatteri_clear_lanes(const scatteri_field *field,
                                              const scatteri_rays *SCATTERI_RESTRICT rays,
                                              const float *SCATTERI_RESTRICT t,
                                              float *SCATTERI_RESTRICT clear)
{
    const scatter_box box = scatteri_box_from(field->grid.box, rays->ref);
    const scatter_vec3 per = field->per_metre;
    const float ex = field->edge.x, ey = field->edge.y, ez = field->edge.z;
    const int nx = field->grid.nx, ny = field->grid.ny, nz = field->grid.nz;
    const float mx = (float)(nx - 1), my = (float)(ny - 1), mz = (float)(nz - 1);
    float off[SCATTERI_LANES], inside[SCATTERI_LANES], known[SCATTERI_LANES], slip[SCATTERI_LANES];
    int at[SCATTERI_LANES], l;
    for (l = 0; l < SCATTERI_LANES; l++) {
        const float ox = rays->ox[l], oy = rays->oy[l], oz = rays->oz[l];
        const float x = ox + t[l] * rays->dx[l] - box.min.x, wx = box.max.x - box.min.x;
        const float y = oy + t[l] * rays->dy[l] - box.min.y, wy = box.max.y - box.min.y;
        const float z = oz + t[l] * rays->dz[l] - box.min.z, wz = box.max.z - box.min.z;
        const float gx = scatteri_clamp(x * per.x - 0.5f, 0.0f, mx);
        const float gy = scatteri_clamp(y * per.y - 0.5f, 0.0f, my);
        const float gz = scatteri_clamp(z * per.z - 0.5f, 0.0f, mz);
        const int i = (int)(gx + 0.5f), j = (int)(gy + 0.5f), k = (int)(gz + 0.5f);
        const float px = (gx - (float)i) * ex, qx = x - scatteri_clamp(x, 0.0f, wx);
        const float py = (gy - (float)j) * ey, qy = y - scatteri_clamp(y, 0.0f, wy);
        const float pz = (gz - (float)k) * ez, qz = z - scatteri_clamp(z, 0.0f, wz);
        const float outside = qx * qx + qy * qy + qz * qz;
        inside[l] = (float)(outside == 0.0f);
        off[l] =
            scatteri_sqrt(scatteri_choose(0.0f, outside, outside, px * px + py * py + pz * pz));
        at[l] = (k * ny + j) * nx + i;
        /* points far from the first ray's origin are rounded */
        slip[l] = 5e-7f * (scatteri_abs(ox) + scatteri_abs(oy) + scatteri_abs(oz) +
                           scatteri_abs(rays->t1[l]));
    }
    for (l = 0; l < SCATTERI_LANES; l++)
        known[l] = (float)field->distances[at[l]];
    for (l = 0; l < SCATTERI_LANES; l++) {
        const float here =
            scatteri_choose(0.5f, inside[l], known[l] * field->unit - off[l], off[l]);
        clear[l] = scatteri_min(clear[l], here - slip[l]);
    }
}

/* How many of the points t, t + step, t + 2 step... on 16 rays, or those of them with a step, certainly are where all
   fields are 0. */
static int scatteri_empty_steps(const scatteri_field *fields, int count, const scatteri_rays *rays,
                                const float *t, const float *step)
{
    float clear[SCATTERI_LANES], steps = 1e6f;
    int f, l;
    for (l = 0; l < SCATTERI_LANES; l++)
        clear[l] = SCATTERI_FAR;
    for (f = 0; f < count; f++) {
        if (fields[f].distances == NULL)
            return 0;
        scatteri_clear_lanes(&fields[f], rays, t, clear);
    }
    for (l = 0; l < SCATTERI_LANES; l++)
        if (step[l] > 0.0f)
            steps = scatteri_min(steps, clear[l] > 0.0f ? 1.0f + clear[l] / step[l] : 0.0f);
    return (int)steps;
}

/* ------------------------------------------------------------------------------------------ >>depth
   Optical depth tau(S, x) of the local terms between a source and a point; constant and height fog are added in
   closed form. A point is always looked at from its own end: direction and length of the segment to the source
   (cut to the bounds). */

/* Points on lines along the axes, where directional sources keep their depth. */
typedef struct scatteri_lattice {
    scatter_box box; /* the outermost points lie on its faces */
    int n[3];        /* points, at least 2 */
    float step[3];   /* m */
    float *density;  /* of the local terms */
    float *work;     /* of so many lights at a time: */
    int crew;
} scatteri_lattice;

struct scatter_depth {
    scatter_host host;
    const scatteri_medium *medium; /* `own` or the context's */
    scatteri_medium own;
    scatter_source source; /* direction of unit length */
    scatter_depth_method method;
    int ready;
    scatteri_buffer memory;
    float *values;   /* mean density tau/r of a local source, tau of a directional one */
    float at_source; /* what tau/r tends to at a local source: the density there */
    int nx, ny, nz;  /* cells; polar: directions, directions, radii */
    scatter_box box;
    scatter_vec3 cell;
    const scatteri_lattice
        *lattice; /* of a directional source, polar; `own_lattice` or the context's */
    scatteri_lattice own_lattice;
    int stride; /* of `values` on the lattice: points of so many sources lie side by side */
    const scatteri_field
        *injected; /* of the same cells, for methods that read density from a volume */
    scatteri_field own_injected;
    scatteri_buffer own_memory;
    scatter_vec3 axis_u, axis_v, axis_w; /* polar: frame of the directions */
    float low_u, low_v, step_u, step_v;  /* first column and distance of columns */
    float low_r, step_r;                 /* first shell and distance of shells */
};

/* Points, and where their source is seen from them. */
typedef struct scatteri_points {
    scatter_vec3 ref;
    float x[SCATTERI_POINTS], y[SCATTERI_POINTS], z[SCATTERI_POINTS]; /* relative to `ref` */
    float dx[SCATTERI_POINTS], dy[SCATTERI_POINTS],
        dz[SCATTERI_POINTS];         /* unit, towards the source */
    float distance[SCATTERI_POINTS]; /* of the source; SCATTERI_FAR if directional */
    float length[SCATTERI_POINTS];   /* of the segment inside the bounds */
} scatteri_points;

SCATTERI_FN float scatteri_not_zero(float d)
{
    return scatteri_choose(scatteri_abs(d), 1e-20f, 1e-20f, d);
}

SCATTERI_FN float scatteri_exit(float x, float d, float low, float high)
{
    const float safe = scatteri_not_zero(d);
    return scatteri_max((scatteri_choose(0.0f, safe, high, low) - x) / safe, 0.0f);
}

/* Fills dx..length from x, y, z. */
SCATTERI_HOT static void scatteri_face_source(const scatter_source *source,
                                              const scatter_medium *medium, int count,
                                              scatteri_points *p)
{
    const scatter_vec3 s = scatteri_sub(source->position, p->ref), w = source->direction;
    const scatter_box b = scatteri_box_from(medium->bounds, p->ref);
    const int directional = source->directional, bounded = medium->bounded;
    int first, l;
    for (first = 0; first < count; first += SCATTERI_LANES) {
        for (l = first; l < first + SCATTERI_LANES; l++) {
            const float x = s.x - p->x[l], y = s.y - p->y[l], z = s.z - p->z[l];
            const float r2 = x * x + y * y + z * z;
            const float inverse = scatteri_choose(1e-37f, r2, scatteri_rsqrt(r2), 0.0f);
            p->dx[l] = directional ? -w.x : x * inverse;
            p->dy[l] = directional ? -w.y : y * inverse;
            p->dz[l] = directional ? -w.z : z * inverse;
            p->distance[l] = directional ? SCATTERI_FAR : r2 * inverse;
            p->length[l] = p->distance[l];
        }
        if (!bounded)
            continue;
        for (l = first; l < first + SCATTERI_LANES; l++) {
            const float ex = scatteri_exit(p->x[l], p->dx[l], b.min.x, b.max.x);
            const float ey = scatteri_exit(p->y[l], p->dy[l], b.min.y, b.max.y);
            const float ez = scatteri_exit(p->z[l], p->dz[l], b.min.z, b.max.z);
            p->length[l] = scatteri_min(scatteri_min(p->length[l], ex), scatteri_min(ey, ez));
        }
    }
}

/* --- closed form ---
   Gaussians that do not reach the segments from the points to the source are left out. */

typedef struct scatteri_shadows {
    const scatteri_medium *medium;
    float trim;                                                 /* see scatteri_trim.depth */
    scatteri_slabs slabs;                                       /* hold the segments */
    int count, next, complete;                                  /* as in scatteri_page */
    int total;                                                  /* gathered so far */
    int cells;                                                  /* voxels passed on the way */
    float x[SCATTERI_PAGE], y[SCATTERI_PAGE], z[SCATTERI_PAGE]; /* centre, relative to slabs.ref */
    float a[SCATTERI_PAGE], scale[SCATTERI_PAGE];               /* scale: c sqrt(pi)/(2a) */
    int inside[SCATTERI_PAGE]; /* segments can end inside the Gaussian's support */
    scatter_vec3 source;       /* relative to slabs.ref */
    scatter_vec3 way;          /* to a directional source, unit */
    int directional, clipped;  /* clipped: segments end at the bounds */
} scatteri_shadows;

static scatter_vec3 scatteri_unit_or_zero(scatter_vec3 v)
{
    const float square = scatteri_dot(v, v);
    return scatteri_scale(v, square > 1e-24f ? scatteri_rsqrt(square) : 0.0f);
}

/* The segments fill about a triangle (a strip, if directional): axes square to its plane, towards the source, and
   across. */
static scatteri_slabs scatteri_slabs_to_source(const scatteri_rays *rays,
                                               const scatter_source *source)
{
    const scatter_vec3 u = scatteri_ray_direction(rays, 0),
                       s = scatteri_sub(source->position, rays->ref);
    const scatter_vec3 middle =
        scatteri_along(scatteri_ray_origin(rays, 0), u, 0.5f * (rays->t0[0] + rays->t1[0]));
    const scatter_vec3 to =
        source->directional ? scatteri_scale(source->direction, -1.0f) : scatteri_sub(s, middle);
    const float away = scatteri_length(to);
    scatteri_slabs slabs;
    scatter_vec3 normal;
    int i;
    slabs.axis[0] = away > 1e-12f ? scatteri_scale(to, 1.0f / away) : scatteri_perpendicular(u);
    normal = scatteri_cross(slabs.axis[0], u);
    slabs.axis[1] = scatteri_dot(normal, normal) > 1e-6f ? scatteri_normalize(normal)
                                                         : scatteri_perpendicular(slabs.axis[0]);
    slabs.axis[2] = scatteri_cross(slabs.axis[0], slabs.axis[1]);
    scatteri_hold_rays(&slabs, rays);
    if (source->directional)
        slabs.high[0] = SCATTERI_FAR;
    for (i = 0; i < 3 && !source->directional; i++) {
        const float d = scatteri_dot(slabs.axis[i], s);
        slabs.low[i] = scatteri_min(slabs.low[i], d);
        slabs.high[i] = scatteri_max(slabs.high[i], d);
    }
    return slabs;
}

/* Whether Gaussian i still has density at the source: 2 * 14 leaves room for the slant of segments that pass it at
   the edge of its support. */
static int scatteri_near_source(const scatteri_shadows *s, int i)
{
    const float x = s->x[i] - s->source.x, y = s->y[i] - s->source.y, z = s->z[i] - s->source.z;
    return s->a[i] * s->a[i] * (x * x + y * y + z * z) < 30.0f;
}

SCATTERI_HOT static void scatteri_gather_shadows(scatteri_shadows *s, int first)
{
    const scatteri_gaussians *g = &s->medium->gaussians;
    const scatter_vec3 ref = s->slabs.ref;
    const int from_start = first == 0;
    int keep[SCATTERI_LANES], l;
    s->count = 0;
    for (; first < g->padded && s->count <= SCATTERI_PAGE - SCATTERI_LANES;
         first += SCATTERI_LANES) {
        if (!scatteri_near_slabs(g, &s->slabs, s->trim, first, keep))
            continue;
        for (l = 0; l < SCATTERI_LANES; l++) {
            const int i = s->count;
            if (!keep[l])
                continue;
            s->x[i] = g->x[first + l] - ref.x;
            s->y[i] = g->y[first + l] - ref.y;
            s->z[i] = g->z[first + l] - ref.z;
            s->a[i] = g->a[first + l];
            s->scale[i] = g->c[first + l] * 0.886226925f / g->a[first + l];
            s->inside[i] = s->clipped || (!s->directional && scatteri_near_source(s, i));
            s->count++;
        }
    }
    s->next = first;
    s->complete = from_start && first >= g->padded;
    s->total = from_start ? s->count : s->total + s->count;
}

/* Points on the rays between t0 and t1 will ask for their depth. */
static void scatteri_begin_shadows(scatteri_shadows *s, const scatteri_medium *medium,
                                   const scatter_source *source, const scatteri_rays *rays,
                                   float trim)
{
    s->trim = trim;
    s->medium = medium;
    s->slabs = scatteri_slabs_to_source(rays, source);
    s->source = scatteri_sub(source->position, rays->ref);
    s->way = scatteri_scale(source->direction, -1.0f);
    s->directional = source->directional;
    s->clipped = medium->desc.bounded &&
                 (source->directional || !scatteri_inside(medium->desc.bounds, source->position));
    scatteri_gather_shadows(s, 0);
}

/* Rays and source lie in a plane, for each ray: the axis is the ray towards a local source, and the way to a
   directional one; `side` is square to it. A point on the ray is s from the foot, the point of its stretch closest to a
   local source, so that s keeps the digits of t however far the source is. */
typedef struct scatteri_sight {
    float fx[SCATTERI_LANES], fy[SCATTERI_LANES],
        fz[SCATTERI_LANES]; /* foot, relative to the rays' ref */
    float ax[SCATTERI_LANES], ay[SCATTERI_LANES], az[SCATTERI_LANES]; /* axis */
    float ex[SCATTERI_LANES], ey[SCATTERI_LANES],
        ez[SCATTERI_LANES]; /* side; 0 if ray and source are in line */
    float away
        [SCATTERI_LANES]; /* distance of a local source across the ray; sine to a directional one */
    float ahead[SCATTERI_LANES]; /* of a local source along the ray */
    float slant[SCATTERI_LANES]; /* cosine of ray and way to a directional source */
    int directional;
    float base[SCATTERI_LANES]; /* t of the foot */
    float s[SCATTERI_POINTS],
        inverse[SCATTERI_POINTS]; /* of the points; 1/distance of a local source */
    const float *length;          /* of the segments to the source */
    float distance[SCATTERI_POINTS];
} scatteri_sight;

/* Splits v into its part along a unit axis, which is returned, and a rest. */
SCATTERI_FN float scatteri_split(scatter_vec3 v, scatter_vec3 axis, scatter_vec3 *rest)
{
    const float along = scatteri_dot(v, axis);
    *rest = scatteri_sub(v, scatteri_scale(axis, along));
    return along;
}

SCATTERI_HOT static void scatteri_set_frame(const scatteri_rays *SCATTERI_RESTRICT rays,
                                            scatter_vec3 source, scatter_vec3 way, int directional,
                                            scatteri_sight *SCATTERI_RESTRICT sight)
{
    const float parallel = (float)directional;
    int l;
    sight->directional = directional;
    for (l = 0; l < SCATTERI_LANES; l++) {
        const scatter_vec3 o = scatteri_v3(rays->ox[l], rays->oy[l], rays->oz[l]);
        const scatter_vec3 d = scatteri_v3(rays->dx[l], rays->dy[l], rays->dz[l]);
        const scatter_vec3 to = scatteri_sub(source, o);
        const float t0 = (1.0f - parallel) * scatteri_dot(to, d);
        const scatter_vec3 off = scatteri_sub(to, scatteri_scale(d, t0));
        const float base = scatteri_min(scatteri_max(t0, rays->t0[l]), rays->t1[l]);
        const float slant = scatteri_dot(d, way);
        const scatter_vec3 drift = scatteri_sub(d, scatteri_scale(way, slant));
        const scatter_vec3 across = scatteri_v3(scatteri_choose(parallel, 0.5f, off.x, drift.x),
                                                scatteri_choose(parallel, 0.5f, off.y, drift.y),
                                                scatteri_choose(parallel, 0.5f, off.z, drift.z));
        const float square = scatteri_dot(across, across);
        const float inverse = scatteri_choose(1e-36f, square, scatteri_rsqrt(square), 0.0f);
        sight->fx[l] = o.x + base * d.x;
        sight->fy[l] = o.y + base * d.y;
        sight->fz[l] = o.z + base * d.z;
        sight->ax[l] = scatteri_choose(parallel, 0.5f, d.x, way.x);
        sight->ay[l] = scatteri_choose(parallel, 0.5f, d.y, way.y);
        sight->az[l] = scatteri_choose(parallel, 0.5f, d.z, way.z);
        sight->ex[l] = across.x * inverse;
        sight->ey[l] = across.y * inverse;
        sight->ez[l] = across.z * inverse;
        sight->away[l] = square * inverse;
        sight->ahead[l] = t0 - base;
        sight->slant[l] = slant;
        sight->base[l] = base;
    }
}

/* Points at t on the rays; point i is on ray i % 16. */
SCATTERI_HOT static void scatteri_set_points(int count, const float *SCATTERI_RESTRICT t,
                                             scatteri_sight *SCATTERI_RESTRICT sight)
{
    const float parallel = (float)sight->directional;
    int first, l;
    for (first = 0; first < count; first += SCATTERI_LANES)
        for (l = 0; l < SCATTERI_LANES; l++) {
            const float s = t[first + l] - sight->base[l], along = sight->ahead[l] - s;
            const float r2 = along * along + sight->away[l] * sight->away[l];
            const float inverse = scatteri_choose(1e-36f, r2, scatteri_rsqrt(r2), 0.0f);
            sight->s[first + l] = s;
            sight->inverse[first + l] = scatteri_choose(parallel, 0.5f, inverse, 1.0f);
            sight->distance[first + l] =
                scatteri_choose(parallel, 0.5f, r2 * inverse, SCATTERI_FAR);
        }
    sight->length = sight->distance;
}

/* A Gaussian as seen along 16 rays. With m where it is closest on the segment to the source and h its distance there,
   r m = c0 + s (c1 + c2 s), r h = k0 + k1 s in the plane (r = 1 if directional), and a h out of it is `apart`'s root. */
typedef struct scatteri_foot {
    float c0[SCATTERI_LANES], c1[SCATTERI_LANES], k0[SCATTERI_LANES], k1[SCATTERI_LANES];
    float apart[SCATTERI_LANES];
} scatteri_foot;

SCATTERI_FN void scatteri_find_foot(const scatteri_shadows *s, int g, const scatteri_sight *sight,
                                    scatteri_foot *foot)
{
    const scatter_vec3 center = scatteri_v3(s->x[g], s->y[g], s->z[g]);
    const float a = s->a[g], parallel = (float)sight->directional;
    int l;
    for (l = 0; l < SCATTERI_LANES; l++) {
        const scatter_vec3 axis = scatteri_v3(sight->ax[l], sight->ay[l], sight->az[l]);
        const scatter_vec3 side = scatteri_v3(sight->ex[l], sight->ey[l], sight->ez[l]);
        const scatter_vec3 p =
            scatteri_sub(center, scatteri_v3(sight->fx[l], sight->fy[l], sight->fz[l]));
        const float away = sight->away[l], ahead = sight->ahead[l];
        scatter_vec3 across, apart;
        const float along = scatteri_split(p, axis, &across);
        const float aside = scatteri_split(across, side, &apart);
        foot->c0[l] = scatteri_choose(parallel, 0.5f, along * ahead + aside * away, along);
        foot->c1[l] = scatteri_choose(parallel, 0.5f, -along - ahead, -sight->slant[l]);
        foot->k0[l] = scatteri_choose(parallel, 0.5f, along * away - aside * ahead, aside);
        foot->k1[l] = scatteri_choose(parallel, 0.5f, aside, 0.0f) - away;
        foot->apart[l] = a * a * scatteri_dot(apart, apart);
    }
}

/* a m and a^2 h^2 for 16 points. */
SCATTERI_FN void scatteri_shadow_foot(float a, float curve, const scatteri_foot *foot,
                                      const float *SCATTERI_RESTRICT s,
                                      const float *SCATTERI_RESTRICT inverse,
                                      float *SCATTERI_RESTRICT m, float *SCATTERI_RESTRICT fade)
{
    int l;
    for (l = 0; l < SCATTERI_LANES; l++) {
        const float scale = a * inverse[l];
        const float h = (foot->k0[l] + foot->k1[l] * s[l]) * scale;
        m[l] = (foot->c0[l] + s[l] * (foot->c1[l] + curve * s[l])) * scale;
        fade[l] = foot->apart[l] + h * h;
    }
}

/* Depth by the difference of two erfs: error 6e-7 of the Gaussian's whole depth on that line. m: a m. */
SCATTERI_FN void scatteri_shadow_quick(float a, float scale, const float *SCATTERI_RESTRICT length,
                                       const float *SCATTERI_RESTRICT m,
                                       const float *SCATTERI_RESTRICT fade,
                                       float *SCATTERI_RESTRICT sum)
{
    int l;
    for (l = 0; l < SCATTERI_LANES; l++) {
        const float x = scatteri_within(-m[l], 3.6f),
                    y = scatteri_within(a * length[l] - m[l], 3.6f);
        const float qx = scatteri_erf_under(x * x), qy = scatteri_erf_under(y * y);
        const float s = scatteri_erf_over(y, y * y) * qx - scatteri_erf_over(x, x * x) * qy;
        sum[l] += scale * scatteri_decay(fade[l]) * (s / (qx * qy));
    }
}

/* The same where the Gaussian has no density at the source: it lies on the segment or behind the source, and the
   second erf is 1 or does not matter. */
SCATTERI_FN void scatteri_shadow_whole(float a, float scale, const float *SCATTERI_RESTRICT length,
                                       const float *SCATTERI_RESTRICT m,
                                       const float *SCATTERI_RESTRICT fade,
                                       float *SCATTERI_RESTRICT sum)
{
    int l;
    for (l = 0; l < SCATTERI_LANES; l++) {
        const float x = scatteri_within(m[l], 3.6f), q = scatteri_erf_under(x * x);
        const float depth =
            scale * scatteri_decay(fade[l]) * ((q + scatteri_erf_over(x, x * x)) / q);
        sum[l] += scatteri_choose(m[l], a * length[l], depth, 0.0f);
    }
}

/* Depth by erfc of both ends, each as erfcx times the density at that end: neither under- nor overflows and keeps
   its digits in the tails, where a dense Gaussian still counts. */
SCATTERI_FN void scatteri_shadow_exact(float a, float scale, const float *SCATTERI_RESTRICT length,
                                       const float *SCATTERI_RESTRICT m,
                                       const float *SCATTERI_RESTRICT fade,
                                       float *SCATTERI_RESTRICT sum)
{
    int l;
    for (l = 0; l < SCATTERI_LANES; l++) {
        const float x = m[l], y = scatteri_min(a * length[l] - m[l], 1e6f);
        const float p = scatteri_erfcx(scatteri_abs(x)) * scatteri_decay(fade[l] + x * x);
        const float q = scatteri_erfcx(scatteri_abs(y)) * scatteri_decay(fade[l] + y * y);
        const float between = scatteri_choose(0.0f, x, scatteri_choose(y, 0.0f, 0.0f, 2.0f), 0.0f);
        const float ends = scatteri_choose(0.0f, x, -p, p) + scatteri_choose(y, 0.0f, q, -q);
        sum[l] += scale * scatteri_max(between * scatteri_decay(fade[l]) + ends, 0.0f);
    }
}

/* Adds depth of the gathered Gaussians between the points and the source. */
SCATTERI_HOT static void scatteri_add_gathered(const scatteri_shadows *s, int count,
                                               const scatteri_sight *sight,
                                               float *SCATTERI_RESTRICT depth)
{
    const float sigma = s->medium->sigma_most, curve = sight->directional ? 0.0f : 1.0f;
    float m[SCATTERI_LANES], fade[SCATTERI_LANES];
    scatteri_foot foot;
    int first, g;
    for (g = 0; g < s->count; g++) {
        const float a = s->a[g], scale = s->scale[g];
        const int exact = sigma * scale >= SCATTERI_QUICK, whole = !exact && !s->inside[g];
        scatteri_find_foot(s, g, sight, &foot);
        for (first = 0; first < count; first += SCATTERI_LANES) {
            const float *length = sight->length + first;
            float *sum = depth + first;
            scatteri_shadow_foot(a, curve, &foot, sight->s + first, sight->inverse + first, m,
                                 fade);
            if (whole)
                scatteri_shadow_whole(a, scale, length, m, fade, sum);
            else if (!exact)
                scatteri_shadow_quick(a, scale, length, m, fade, sum);
            else
                scatteri_shadow_exact(a, scale, length, m, fade, sum);
        }
    }
}

/* The segment from a point to its source, inside the bounds. */
static scatteri_segment scatteri_segment_of(const scatteri_points *p, int i)
{
    scatteri_segment s;
    s.origin[0] = (double)p->ref.x + (double)p->x[i];
    s.origin[1] = (double)p->ref.y + (double)p->y[i];
    s.origin[2] = (double)p->ref.z + (double)p->z[i];
    s.direction[0] = (double)p->dx[i];
    s.direction[1] = (double)p->dy[i];
    s.direction[2] = (double)p->dz[i];
    s.length = (double)p->length[i];
    return s;
}

/* Depth of the grids by exact traversal: slow, and exact. Returns the voxels on the way. */
static int scatteri_add_field_depths(const scatteri_medium *medium, int count,
                                     const scatteri_points *p, float *depth)
{
    size_t f;
    int i, cells = 0;
    for (f = 0; f < medium->desc.grid_count; f++)
        for (i = 0; i < count; i++)
            depth[i] += scatteri_field_depth(&medium->fields[f], scatteri_segment_of(p, i), &cells);
    return cells;
}

/* Points at t on the rays that the shadows began with. Where segments end at the bounds, and for grids, the points
   must be placed and face the source. */
static void scatteri_add_shadows(scatteri_shadows *s, const scatteri_rays *rays, int count,
                                 const float *t, const scatteri_points *p, float *depth)
{
    scatteri_sight sight;
    int next = 0;
    scatteri_set_frame(rays, s->source, s->way, s->directional, &sight);
    scatteri_set_points(count, t, &sight);
    if (s->clipped)
        sight.length = p->length;
    if (s->complete) {
        scatteri_add_gathered(s, count, &sight, depth);
        next = s->medium->gaussians.padded;
    }
    for (; next < s->medium->gaussians.padded; next = s->next) {
        scatteri_gather_shadows(s, next);
        scatteri_add_gathered(s, count, &sight, depth);
    }
    s->cells = scatteri_add_field_depths(s->medium, count, p, depth);
}

/* --- volumes of cells --- */

static scatter_vec3 scatteri_cell(const scatter_depth *d, int i, int j, int k)
{
    return scatteri_v3(scatteri_cell_center(d->box.min.x, d->cell.x, i),
                       scatteri_cell_center(d->box.min.y, d->cell.y, j),
                       scatteri_cell_center(d->box.min.z, d->cell.z, k));
}

static size_t scatteri_cell_index(const scatter_depth *d, int i, int j, int k)
{
    return ((size_t)k * (size_t)d->ny + (size_t)j) * (size_t)d->nx + (size_t)i;
}

/* What tau is multiplied by before it is stored: 1/r of a local source. */
static float scatteri_stored(const scatter_depth *d, float depth, float r)
{
    return d->source.directional ? depth : r > 0.0f ? depth / r : 0.0f;
}

/* Local density at x, for the limit of the mean density at the source. */
static float scatteri_local_density(const scatteri_medium *medium, scatter_vec3 x)
{
    scatter_medium local = medium->desc;
    local.constant = 0.0f;
    local.height_count = 0;
    return scatter_density(&local, x);
}

/* A row of cells as one ray in all lanes, for the search of Gaussians. */
static scatteri_rays scatteri_row(const scatter_depth *d, int j, int k)
{
    scatteri_rays row;
    int l;
    row.ref = d->box.min;
    for (l = 0; l < SCATTERI_LANES; l++) {
        row.ox[l] = 0.0f;
        row.oy[l] = ((float)j + 0.5f) * d->cell.y;
        row.oz[l] = ((float)k + 0.5f) * d->cell.z;
        row.dy[l] = row.dz[l] = 0.0f;
        row.dx[l] = 1.0f;
        row.t0[l] = 0.5f * d->cell.x;
        row.t1[l] = ((float)d->nx - 0.5f) * d->cell.x;
    }
    return row;
}

static void scatteri_closed_row(scatter_depth *d, int j, int k, scatteri_points *p,
                                scatteri_shadows *shadows)
{
    const scatteri_rays row = scatteri_row(d, j, k);
    /* The depth of a shorter segment is the rounding of two erfs. */
    const float shortest =
        0.01f * scatteri_min(d->cell.x, scatteri_min(d->cell.y, d->cell.z));
    float depth[SCATTERI_POINTS];
    int start, i;
    scatteri_begin_shadows(shadows, d->medium, &d->source, &row, 0.0f);
    p->ref = row.ref;
    for (start = 0; start < d->nx; start += SCATTERI_POINTS) {
        const int left = d->nx - start < SCATTERI_POINTS ? d->nx - start : SCATTERI_POINTS;
        const int count = (left + SCATTERI_LANES - 1) / SCATTERI_LANES * SCATTERI_LANES;
        float *out = d->values + scatteri_cell_index(d, start, j, k);
        for (i = 0; i < count; i++) {
            p->x[i] = ((float)(start + (i < left ? i : left - 1)) + 0.5f) * d->cell.x;
            p->y[i] = row.oy[0];
            p->z[i] = row.oz[0];
            depth[i] = 0.0f;
        }
        scatteri_face_source(&d->source, &d->medium->desc, count, p);
        scatteri_add_shadows(shadows, &row, count, p->x, p, depth);
        for (i = 0; i < left; i++)
            out[i] = p->distance[i] > shortest
                         ? scatteri_stored(d, scatteri_max(depth[i], 0.0f), p->distance[i])
                         : d->at_source;
    }
}

static void scatteri_closed_slice(void *data, int k)
{
    scatter_depth *d = (scatter_depth *)data;
    scatteri_points points;
    scatteri_shadows shadows;
    int j;
    for (j = 0; j < d->ny; j++)
        scatteri_closed_row(d, j, k, &points, &shadows);
}

/* Steps that are certainly empty from t on. */
static int scatteri_steps_ahead(const scatteri_field *field, scatter_vec3 from,
                                scatter_vec3 direction, float t, float step)
{
    const scatter_vec3 x =
        scatteri_voxel_coordinates(field, scatteri_along(from, direction, t));
    const double g[3] = {(double)x.x, (double)x.y, (double)x.z};
    const float clear = scatteri_clear_at(field, g);
    return clear > 0.0f ? 1 + (int)scatteri_min(clear / step, 1e6f) : 0;
}

/* Steps of one cell from the cell to the source through the injected density: a shadow ray for each cell. */
SCATTERI_HOT static float scatteri_march_to(const scatter_depth *d, scatter_vec3 from,
                                            scatter_vec3 direction, float t0, float t1)
{
    const float h = scatteri_min(d->cell.x, scatteri_min(d->cell.y, d->cell.z));
    const int steps = (int)scatteri_max((t1 - t0) / h + 0.5f, 1.0f);
    const float step = (t1 - t0) / (float)steps;
    float x[SCATTERI_LANES], y[SCATTERI_LANES], z[SCATTERI_LANES], density[SCATTERI_LANES],
        sum = 0.0f;
    int first = 0, ahead, l;
    while (first < steps) {
        const float start = t0 + step * ((float)first + 0.5f);
        ahead = scatteri_steps_ahead(d->injected, from, direction, start, step);
        if (ahead > 0) {
            first += ahead;
            continue;
        }
        for (l = 0; l < SCATTERI_LANES; l++) {
            const float t = t0 + step * ((float)(first + l) + 0.5f);
            x[l] = t * direction.x;
            y[l] = t * direction.y;
            z[l] = t * direction.z;
            density[l] = 0.0f;
        }
        scatteri_field_lanes_inline(d->injected, from, x, y, z, density);
        for (l = 0; l < SCATTERI_LANES; l++)
            sum += first + l < steps ? density[l] : 0.0f;
        first += SCATTERI_LANES;
    }
    return sum * step;
}

static void scatteri_march_slice(void *data, int k)
{
    scatter_depth *d = (scatter_depth *)data;
    int i, j;
    for (j = 0; j < d->ny; j++)
        for (i = 0; i < d->nx; i++) {
            const scatter_vec3 x = scatteri_cell(d, i, j, k);
            const scatter_vec3 to = scatteri_sub(d->source.position, x);
            const float r = d->source.directional ? SCATTERI_FAR : scatteri_length(to);
            const scatter_vec3 direction = d->source.directional
                                               ? scatteri_scale(d->source.direction, -1.0f)
                                               : scatteri_scale(to, r > 0.0f ? 1.0f / r : 0.0f);
            float t0 = 0.0f, t1 = r, depth = 0.0f;
            const size_t at = scatteri_cell_index(d, i, j, k);
            if (scatteri_clip(d->box, x, direction, &t0, &t1))
                depth = scatteri_march_to(d, x, direction, t0, t1);
            d->values[at] = r > 0.0f ? scatteri_stored(d, depth, r) : d->injected->grid.density[at];
        }
}

/* --- one sweep away from the source, each cell once ---
   On each axis the cells are visited by their distance from the source, so that the neighbour towards the source
   is always done. On the axis on which a cell is the nearest one to the source, that neighbour would lie behind
   the source: it is left out (the direction to the source is nearly square to that axis). */

typedef struct scatteri_axis {
    int order[1024];
    int nearest; /* -1: the source is outside on this axis, or directional */
} scatteri_axis;

static void scatteri_order_axis(scatteri_axis *axis, int n, float low, float cell, float s,
                                int directional, float w)
{
    const float at = scatteri_clamp((s - low) / cell - 0.5f, -1.0f, (float)n);
    int below, above, i;
    above = directional ? (w >= 0.0f ? 0 : n) : scatteri_clamp_int((int)ceil((double)at), 0, n);
    below = above - 1;
    axis->nearest = -1;
    for (i = 0; i < n; i++) {
        const int up = below < 0 || (above < n && (float)above - at <= at - (float)below);
        axis->order[i] = up ? above++ : below--;
    }
    if (!directional && at > -0.5f && at < (float)n - 0.5f)
        axis->nearest = axis->order[0];
}

typedef struct scatteri_cell_view {
    scatter_vec3 u; /* unit, away from the source */
    float r;
    int at[3], back[3]; /* indices of the cell and of the step towards the source, 0 if left out */
} scatteri_cell_view;

static float scatteri_value_at(const scatter_depth *d, const int *at)
{
    if (at[0] < 0 || at[1] < 0 || at[2] < 0 || at[0] >= d->nx || at[1] >= d->ny || at[2] >= d->nz)
        return 0.0f;
    return d->values[scatteri_cell_index(d, at[0], at[1], at[2])];
}

static float scatteri_injected_at(const scatter_depth *d, const int *at)
{
    if (at[0] < 0 || at[1] < 0 || at[2] < 0 || at[0] >= d->nx || at[1] >= d->ny || at[2] >= d->nz)
        return 0.0f;
    return d->injected->scale *
           d->injected->grid.density[scatteri_cell_index(d, at[0], at[1], at[2])];
}

static float scatteri_distance(const scatter_depth *d, const int *at)
{
    return d->source.directional ? 1.0f
                                 : scatteri_length(scatteri_sub(
                                       scatteri_cell(d, at[0], at[1], at[2]), d->source.position));
}

static scatteri_cell_view scatteri_view_cell(const scatter_depth *d, const scatteri_axis *axes,
                                             int i, int j, int k)
{
    scatteri_cell_view c;
    int axis;
    c.at[0] = i;
    c.at[1] = j;
    c.at[2] = k;
    c.u = d->source.direction;
    c.r = 1.0f;
    if (!d->source.directional) {
        const scatter_vec3 away = scatteri_sub(scatteri_cell(d, i, j, k), d->source.position);
        c.r = scatteri_length(away);
        c.u = scatteri_scale(away, c.r > 0.0f ? 1.0f / c.r : 0.0f);
    }
    for (axis = 0; axis < 3; axis++) {
        const float u = scatteri_get(c.u, axis);
        c.back[axis] = axes[axis].nearest == c.at[axis] ? 0 : u > 0.0f ? -1 : u < 0.0f ? 1 : 0;
    }
    return c;
}

/* Giroud and Biri 2012, eq. 6, as printed: one full cell of density is added for each step along an axis, which
   gives Manhattan lengths. Kept as the baseline. */
static float scatteri_eq6(const scatter_depth *d, const scatteri_cell_view *c)
{
    const float h = (d->cell.x + d->cell.y + d->cell.z) / 3.0f;
    float weights = 0.0f, sum = 0.0f;
    int axis;
    for (axis = 0; axis < 3; axis++) {
        const float w = scatteri_abs(scatteri_get(c->u, axis));
        int from[3];
        if (c->back[axis] == 0) /* what is in memory there was not written yet */
            continue;
        memcpy(from, c->at, sizeof from);
        from[axis] += c->back[axis];
        weights += w;
        sum += w * scatteri_value_at(d, from) * scatteri_distance(d, from);
    }
    return h * scatteri_injected_at(d, c->at) + (weights > 0.0f ? sum / weights : 0.0f);
}

/* First-order upwind differences of u . grad tau = D. */
static float scatteri_upwind(const scatter_depth *d, const scatteri_cell_view *c)
{
    float weights = 0.0f, sum = scatteri_injected_at(d, c->at);
    int axis;
    for (axis = 0; axis < 3; axis++) {
        const float w = scatteri_abs(scatteri_get(c->u, axis)) / scatteri_get(d->cell, axis);
        int from[3];
        if (c->back[axis] == 0)
            continue;
        memcpy(from, c->at, sizeof from);
        from[axis] += c->back[axis];
        weights += w;
        sum += w * scatteri_value_at(d, from) * scatteri_distance(d, from);
    }
    return weights > 0.0f ? sum / weights : sum * c->r;
}

/* Short characteristics: back along the ray to the plane of cell centres on the dominant axis, mean density
   bilinear between the four cells there, the trapezoidal rule in between. */
static float scatteri_short(const scatter_depth *d, const scatteri_cell_view *c)
{
    float step[3], f[2] = {0.0f, 0.0f}, mean = 0.0f, density = 0.0f, length, rest;
    int dominant = 0, minor[2], axis, corner;
    for (axis = 0; axis < 3; axis++) {
        step[axis] = scatteri_abs(scatteri_get(c->u, axis)) / scatteri_get(d->cell, axis);
        dominant = step[axis] > step[dominant] ? axis : dominant;
    }
    length = step[dominant] > 0.0f ? 1.0f / step[dominant] : 0.0f;
    if (c->back[dominant] == 0 || (!d->source.directional && length >= c->r))
        return scatteri_injected_at(d, c->at) * c->r;
    for (axis = 0; axis < 2; axis++) {
        minor[axis] = (dominant + 1 + axis) % 3;
        f[axis] = c->back[minor[axis]] != 0 ? step[minor[axis]] * length : 0.0f;
    }
    for (corner = 0; corner < 4; corner++) {
        const int p = corner & 1, q = corner >> 1;
        const float w = (p ? f[0] : 1.0f - f[0]) * (q ? f[1] : 1.0f - f[1]);
        int from[3];
        memcpy(from, c->at, sizeof from);
        from[dominant] += c->back[dominant];
        from[minor[0]] += p ? c->back[minor[0]] : 0;
        from[minor[1]] += q ? c->back[minor[1]] : 0;
        if (w > 0.0f) {
            mean += w * scatteri_value_at(d, from);
            density += w * scatteri_injected_at(d, from);
        }
    }
    rest = d->source.directional ? 1.0f : c->r - length;
    return mean * rest + 0.5f * length * (density + scatteri_injected_at(d, c->at));
}

static void scatteri_sweep(void *data, int task)
{
    scatter_depth *d = (scatter_depth *)data;
    scatteri_axis axes[3];
    const scatter_source *s = &d->source;
    int i, j, k;
    (void)task; /* there is one: each cell needs those before it */
    scatteri_order_axis(&axes[0], d->nx, d->box.min.x, d->cell.x, s->position.x, s->directional,
                        s->direction.x);
    scatteri_order_axis(&axes[1], d->ny, d->box.min.y, d->cell.y, s->position.y, s->directional,
                        s->direction.y);
    scatteri_order_axis(&axes[2], d->nz, d->box.min.z, d->cell.z, s->position.z, s->directional,
                        s->direction.z);
    for (k = 0; k < d->nz; k++)
        for (j = 0; j < d->ny; j++)
            for (i = 0; i < d->nx; i++) {
                const scatteri_cell_view c = scatteri_view_cell(d, axes, axes[0].order[i],
                                                                axes[1].order[j], axes[2].order[k]);
                const float depth = d->method == SCATTER_DEPTH_EQ6      ? scatteri_eq6(d, &c)
                                    : d->method == SCATTER_DEPTH_UPWIND ? scatteri_upwind(d, &c)
                                                                        : scatteri_short(d, &c);
                const size_t at = scatteri_cell_index(d, c.at[0], c.at[1], c.at[2]);
                d->values[at] = s->directional ? depth
                                : c.r > 0.0f   ? depth / c.r
                                               : d->injected->scale * d->injected->grid.density[at];
            }
}

/* --- polar: columns that start at the source ---
   Directions on the square of an octahedral map, cut to the cone that holds the local box, times shells. Along a
   column each shell has one neighbour towards the source, with weight 1: depth is a running sum, and for Gaussians
   the sum is an erf. Directional sources: see "lattice". */

static scatter_vec3 scatteri_corner(scatter_box b, int i)
{
    return scatteri_v3(i & 1 ? b.max.x : b.min.x, i & 2 ? b.max.y : b.min.y,
                       i & 4 ? b.max.z : b.min.z);
}

static void scatteri_polar_frame(scatter_depth *d, scatter_vec3 w)
{
    d->axis_w = w;
    d->axis_u = scatteri_perpendicular(w);
    d->axis_v = scatteri_cross(w, d->axis_u);
}

static void scatteri_polar_steps(scatter_depth *d, float high_u, float high_v, float high_r)
{
    d->step_u = scatteri_max((high_u - d->low_u) / (float)(d->nx - 1), 1e-30f);
    d->step_v = scatteri_max((high_v - d->low_v) / (float)(d->ny - 1), 1e-30f);
    d->step_r = scatteri_max((high_r - d->low_r) / (float)(d->nz - 1), 1e-30f);
}

static void scatteri_polar_columns(scatter_depth *d)
{
    const scatter_vec3 s = d->source.position;
    const scatter_vec3 middle = scatteri_scale(scatteri_add(d->box.min, d->box.max), 0.5f);
    const scatter_vec3 entry = {scatteri_clamp(s.x, d->box.min.x, d->box.max.x),
                               scatteri_clamp(s.y, d->box.min.y, d->box.max.y),
                               scatteri_clamp(s.z, d->box.min.z, d->box.max.z)};
    scatter_vec3 w = scatteri_unit_or_zero(scatteri_sub(middle, s));
    float tangent = 0.0f, high_r = 0.0f, spread = 1.0f;
    int i;
    w = scatteri_dot(w, w) > 0.5f ? w : scatteri_v3(0.0f, 0.0f, 1.0f);
    scatteri_polar_frame(d, w);
    for (i = 0; i < 8; i++) {
        const scatter_vec3 to = scatteri_sub(scatteri_corner(d->box, i), s);
        const float along = scatteri_dot(to, w),
                    off = scatteri_length(scatteri_sub(to, scatteri_scale(w, along)));
        high_r = scatteri_max(high_r, scatteri_length(to));
        tangent = scatteri_max(tangent, along > 0.0f ? off / along : SCATTERI_FAR);
    }
    if (!scatteri_inside(d->box, s) && tangent < 20.0f)
        spread = scatteri_min(1.001f * tangent / (1.0f + tangent), 1.0f);
    d->low_u = d->low_v = -spread;
    d->low_r = scatteri_length(scatteri_sub(entry, s));
    scatteri_polar_steps(d, spread, spread, high_r);
}

/* Columns (i..i+15, j), t from the first shell on. */
SCATTERI_HOT static void scatteri_columns(const scatter_depth *SCATTERI_RESTRICT d, int i, int j,
                                          scatteri_rays *SCATTERI_RESTRICT rays)
{
    const scatter_vec3 axis_u = d->axis_u, axis_v = d->axis_v, axis_w = d->axis_w;
    const float v = d->low_v + (float)j * d->step_v, last = (float)(d->nx - 1);
    const float low_u = d->low_u, step_u = d->step_u, start = d->low_r;
    const float end = start + (float)(d->nz - 1) * d->step_r;
    int l;
    rays->ref = d->source.position;
    for (l = 0; l < SCATTERI_LANES; l++) {
        const float u = low_u + scatteri_min((float)(i + l), last) * step_u;
        const scatter_vec3 q =
            scatteri_oct_decode(scatteri_v2(scatteri_within(u, 1.0f), scatteri_within(v, 1.0f)));
        rays->ox[l] = rays->oy[l] = rays->oz[l] = 0.0f;
        rays->dx[l] = axis_u.x * q.x + axis_v.x * q.y + axis_w.x * q.z;
        rays->dy[l] = axis_u.y * q.x + axis_v.y * q.y + axis_w.y * q.z;
        rays->dz[l] = axis_u.z * q.x + axis_v.z * q.y + axis_w.z * q.z;
        rays->t0[l] = start;
        rays->t1[l] = end;
    }
}

/* Most voxels that a step of `length` along any ray crosses. */
static float scatteri_voxels_along(const scatteri_field *field, const scatteri_rays *rays,
                                   float length)
{
    const scatter_vec3 n = field->per_metre;
    float most = 0.0f;
    int l;
    for (l = 0; l < SCATTERI_LANES; l++)
        most = scatteri_max(most, scatteri_max(n.x * scatteri_abs(rays->dx[l]),
                                               scatteri_max(n.y * scatteri_abs(rays->dy[l]),
                                                            n.z * scatteri_abs(rays->dz[l]))));
    return most * length;
}

/* Adds the field at t on 16 rays. */
SCATTERI_HOT static void scatteri_sample_field(const scatteri_field *field,
                                               const scatteri_rays *rays, const float *t,
                                               float *density)
{
    float x[SCATTERI_LANES], y[SCATTERI_LANES], z[SCATTERI_LANES];
    int l;
    for (l = 0; l < SCATTERI_LANES; l++) {
        x[l] = rays->ox[l] + t[l] * rays->dx[l];
        y[l] = rays->oy[l] + t[l] * rays->dy[l];
        z[l] = rays->oz[l] + t[l] * rays->dz[l];
    }
    scatteri_field_lanes_inline(field, rays->ref, x, y, z, density);
}

/* Running sum of the fields along 16 columns: adds what lies between the shells at radii `before` and `here`, sampled
   about once a voxel. */
static void scatteri_sum_fields(const scatter_depth *d, const scatteri_rays *rays,
                                const float *before, const float *here, float *running)
{
    size_t f;
    int s, l;
    for (f = 0; f < d->medium->desc.grid_count; f++) {
        const scatteri_field *field = &d->medium->fields[f];
        const int samples =
            (int)scatteri_clamp(0.75f * scatteri_voxels_along(field, rays, d->step_r), 0.0f, 1e4f) +
            1;
        const float part = 1.0f / (float)samples;
        for (s = 0; s < samples; s++) {
            float at[SCATTERI_LANES], density[SCATTERI_LANES], step[SCATTERI_LANES];
            for (l = 0; l < SCATTERI_LANES; l++) {
                step[l] = part * (here[l] - before[l]);
                at[l] = before[l] + ((float)s + 0.5f) * step[l];
                density[l] = 0.0f;
            }
            if (scatteri_empty_steps(field, 1, rays, at, step) > 0)
                continue;
            scatteri_sample_field(field, rays, at, density);
            for (l = 0; l < SCATTERI_LANES; l++)
                running[l] += density[l] * part * (here[l] - before[l]);
        }
    }
}

/* The columns' stretches inside the bounds; what lies outside counts as the ends of that. A column that misses the
   bounds, from a source as good as on their face, goes on outside: what is read near the face lies between it and one
   that goes along the face. */
static void scatteri_cut_columns(const scatter_depth *d, scatteri_rays *rays)
{
    const scatter_medium *medium = &d->medium->desc;
    const int touches = d->low_r <= 0.1f * d->step_r;
    int l;
    if (!medium->bounded)
        return;
    for (l = 0; l < SCATTERI_LANES; l++) {
        const scatter_vec3 o = scatteri_add(rays->ref, scatteri_ray_origin(rays, l));
        float t0 = rays->t0[l], t1 = rays->t1[l];
        const int some = scatteri_bounded(medium, o, scatteri_ray_direction(rays, l), &t0, &t1);
        rays->t0[l] = some ? t0 : rays->t0[l];
        rays->t1[l] = some ? t1 : touches ? rays->t1[l] : rays->t0[l];
    }
}

/* Work space of one task. */
typedef struct scatteri_shells {
    scatteri_rays rays;
    scatteri_page page;
    float t[SCATTERI_POINTS], depth[SCATTERI_POINTS], density[SCATTERI_POINTS];
    float whole[SCATTERI_LANES]; /* depth of the page's Gaussians on the rays */
    float last[SCATTERI_LANES], running[SCATTERI_LANES];
} scatteri_shells;

/* A Gaussian at even steps: a step multiplies the density by a ratio that itself changes by a constant factor, and depth is
   the sum of Euler and Maclaurin: trapezoids, and at their ends four corrections, Hermite's polynomials times density. A
   step is at most one width 1/a: depth errs by less than 3e-4 of c/a there, 2e-5 at half a width. It starts anew from the
   closed form in each group of 8 rows, before the rounding of the ratio has added up. */
#define SCATTERI_EVEN 1.0f

enum { SCATTERI_GROUP = 8, SCATTERI_MIDDLE = 4 };

SCATTERI_FN void scatteri_add_row(const float *SCATTERI_RESTRICT row, float *SCATTERI_RESTRICT sum)
{
    int l;
    for (l = 0; l < SCATTERI_LANES; l++)
        sum[l] += row[l];
}

/* Constants of one Gaussian at steps of `delta` widths. */
typedef struct scatteri_even {
    float delta, slower;  /* factor of the ratio after each step */
    float c1, c3, c5, c7; /* corrections at an end: step density (c1 x + c3 x^3 + ...) */
} scatteri_even;

static scatteri_even scatteri_even_of(float delta)
{
    const float d2 = delta * delta;
    const float h3 = delta * d2 / 720.0f, h5 = h3 * d2 / 42.0f, h7 = -h5 * d2 / 40.0f;
    scatteri_even even;
    even.delta = delta;
    even.slower = scatteri_exp(-2.0f * d2);
    even.c1 = delta / 6.0f + 12.0f * h3 + 120.0f * h5 - 1680.0f * h7;
    even.c3 = -8.0f * h3 - 160.0f * h5 + 3360.0f * h7;
    even.c5 = 32.0f * h5 - 1344.0f * h7;
    even.c7 = 128.0f * h7;
    return even;
}

SCATTERI_FN float scatteri_even_end(scatteri_even even, float x)
{
    const float z = x * x;
    return x * (even.c1 + z * (even.c3 + z * (even.c5 + z * even.c7)));
}

/* Adds the depth of Gaussian g at 8 even steps on the rays; `t`: of the middle row. */
SCATTERI_HOT static void scatteri_add_group(const scatteri_page *SCATTERI_RESTRICT page, int g,
                                            scatteri_even even, float t, float step,
                                            float *SCATTERI_RESTRICT depth)
{
    const float a = page->a[g], c = page->c[g], scale = page->scale[g];
    int k, l;
    for (l = 0; l < SCATTERI_LANES; l++) {
        const float x0 = a * (t - page->m[g][l]), exponent = page->fade[g][l] + x0 * x0;
        const float e = scatteri_decay(exponent), q = scale * scatteri_erfcx(scatteri_abs(x0)) * e;
        const float d0 = scatteri_choose(exponent, 80.0f, c * e, 0.0f);
        const float end = scatteri_even_end(even, x0),
                    up = scatteri_exp(-(2.0f * x0 + even.delta) * even.delta);
        const float tau = scatteri_choose(x0, 0.0f, page->before[g][l] + q, page->behind[g][l] - q);
        const float above = tau - step * d0 * (0.5f + end), below = tau + step * d0 * (0.5f - end);
        float x = x0, density = d0, ratio = up, sum = d0;
        depth[(int)SCATTERI_MIDDLE * SCATTERI_LANES + l] += tau;
        for (k = SCATTERI_MIDDLE + 1; k < SCATTERI_GROUP; k++) {
            x += even.delta;
            density *= ratio;
            ratio *= even.slower;
            sum += density;
            depth[k * SCATTERI_LANES + l] +=
                above + step * (sum + density * (scatteri_even_end(even, x) - 0.5f));
        }
        x = x0, density = sum = d0, ratio = even.slower / up;
        for (k = SCATTERI_MIDDLE - 1; k >= 0; k--) {
            x -= even.delta;
            density *= ratio;
            ratio *= even.slower;
            sum += density;
            depth[k * SCATTERI_LANES + l] +=
                below - step * (sum - density * (scatteri_even_end(even, x) + 0.5f));
        }
    }
}

static void scatteri_add_even(const scatteri_page *page, int g, float start, float step, int rows,
                              float *depth)
{
    const scatteri_even even = scatteri_even_of(page->a[g] * step);
    int first;
    for (first = 0; first < rows; first += SCATTERI_GROUP)
        scatteri_add_group(page, g, even, start + (float)(first + SCATTERI_MIDDLE) * step, step,
                           depth + first * SCATTERI_LANES);
}

/* Whether Gaussian g has density between t and `end` on a ray; where it lies before t, its whole depth is added to
   `passed`. */
SCATTERI_HOT static int scatteri_has_density(const scatteri_page *page, int g, float t, float end,
                                             float *SCATTERI_RESTRICT passed)
{
    const float a = page->a[g], reach = page->reach[g];
    float behind[SCATTERI_LANES];
    int l, some = 0;
    for (l = 0; l < SCATTERI_LANES; l++) {
        const float m = page->m[g][l], off = scatteri_max(scatteri_max(t - m, m - end), 0.0f);
        some |= page->fade[g][l] + a * a * off * off < reach;
        behind[l] = scatteri_choose(m, t, page->behind[g][l], 0.0f);
    }
    if (!some)
        scatteri_add_row(behind, passed);
    return some;
}

/* Depth of the page's Gaussians at even shells. The depth of those that were passed is the same at all of them. */
static void scatteri_fill_even(const scatteri_page *page, float start, float step, int rows,
                               const float *t, float *density, float *depth)
{
    const float end = start + (float)(rows - 1) * step;
    float passed[SCATTERI_LANES];
    int k, g;
    memset(passed, 0, sizeof passed);
    for (g = 0; g < page->count; g++)
        if (scatteri_has_density(page, g, start, end, passed)) {
            if (page->a[g] * step <= SCATTERI_EVEN)
                scatteri_add_even(page, g, start, step, rows, depth);
            else
                scatteri_add_some(page, g, g + 1, rows * SCATTERI_LANES, t, density, depth);
        }
    for (k = 0; k < rows; k++)
        scatteri_add_row(passed, depth + k * SCATTERI_LANES);
}

/* t of the shells on each ray, within the ray. */
SCATTERI_HOT static void scatteri_place_shells(const scatteri_rays *SCATTERI_RESTRICT rays,
                                               float start, float step, int rows,
                                               float *SCATTERI_RESTRICT t)
{
    int k, l;
    for (k = 0; k < rows; k++)
        for (l = 0; l < SCATTERI_LANES; l++) {
            const float r = start + (float)k * step;
            t[k * SCATTERI_LANES + l] = scatteri_min(scatteri_max(r, rays->t0[l]), rays->t1[l]);
        }
}

/* Before a ray begins there is no depth, behind its end no more than the whole. */
SCATTERI_HOT static void scatteri_end_shells(const scatteri_rays *SCATTERI_RESTRICT rays,
                                             const float *SCATTERI_RESTRICT whole, float start,
                                             float step, int rows, float *SCATTERI_RESTRICT depth)
{
    int k, l;
    for (k = 0; k < rows; k++)
        for (l = 0; l < SCATTERI_LANES; l++) {
            const float r = start + (float)k * step, at = depth[k * SCATTERI_LANES + l];
            const float begun = scatteri_choose(r, rays->t0[l], 0.0f, at);
            depth[k * SCATTERI_LANES + l] = scatteri_choose(rays->t1[l], r, whole[l], begun);
        }
}

/* Depth at `rows` shells from number `first` on. */
static void scatteri_fill_shells(const scatter_depth *d, int first, int rows, scatteri_shells *w)
{
    const float start = d->low_r + (float)first * d->step_r;
    int k, l;
    scatteri_place_shells(&w->rays, start, d->step_r, rows, w->t);
    memset(w->depth, 0, (size_t)rows * SCATTERI_LANES * sizeof(float));
    memset(w->density, 0, (size_t)rows * SCATTERI_LANES * sizeof(float));
    if (w->page.complete) {
        scatteri_fill_even(&w->page, start, d->step_r, rows, w->t, w->density, w->depth);
        if (d->medium->desc.bounded)
            scatteri_end_shells(&w->rays, w->whole, start, d->step_r, rows, w->depth);
    } else {
        scatteri_add_gaussians(&d->medium->gaussians, &w->rays, &w->page, rows * SCATTERI_LANES,
                               w->t, w->density, w->depth);
    }
    for (k = 0; k < rows && d->medium->desc.grid_count > 0; k++) {
        const float *here = w->t + k * SCATTERI_LANES;
        scatteri_sum_fields(d, &w->rays, w->last, here, w->running);
        memcpy(w->last, here, sizeof w->last);
        for (l = 0; l < SCATTERI_LANES; l++)
            w->depth[k * SCATTERI_LANES + l] += w->running[l];
    }
}

SCATTERI_HOT static void scatteri_store_row(const float *SCATTERI_RESTRICT depth, float factor,
                                            int count, float *SCATTERI_RESTRICT out)
{
    int l;
    for (l = 0; l < count; l++)
        out[l] = factor * scatteri_max(depth[l], 0.0f);
}

/* Columns (i..i+15, j). */
static void scatteri_fill_columns(const scatter_depth *d, int i, int j, scatteri_shells *w)
{
    const float start = d->low_r;
    const int some = d->nx - i < SCATTERI_LANES ? d->nx - i : SCATTERI_LANES;
    scatteri_slabs slabs;
    int first, k, l;
    scatteri_columns(d, i, j, &w->rays);
    scatteri_cut_columns(d, &w->rays);
    slabs = scatteri_slabs_of_rays(&w->rays);
    w->page.trim.rays = w->page.trim.depth = 0.0f;
    scatteri_gather(&d->medium->gaussians, &w->rays, &slabs, 0, &w->page);
    memset(w->whole, 0, sizeof w->whole);
    if (w->page.complete && d->medium->desc.bounded)
        scatteri_add_some(&w->page, 0, w->page.count, SCATTERI_LANES, w->rays.t1, w->density,
                          w->whole);
    memcpy(w->last, w->rays.t0, sizeof w->last);
    memset(w->running, 0, sizeof w->running);
    for (first = 0; first < d->nz; first += SCATTERI_ROWS) {
        const int rows = d->nz - first < SCATTERI_ROWS ? d->nz - first : SCATTERI_ROWS;
        scatteri_fill_shells(d, first, rows, w);
        for (k = 0; k < rows; k++) {
            const float r = start + (float)(first + k) * d->step_r;
            const float factor = r > 0.0f ? 1.0f / r : 0.0f;
            float *out =
                d->values + ((size_t)(first + k) * (size_t)d->ny + (size_t)j) * (size_t)d->nx + i;
            scatteri_store_row(w->depth + k * SCATTERI_LANES, factor, some, out);
        }
    }
    for (l = 0; l < some && !(start > 0.0f); l++)
        d->values[(size_t)j * (size_t)d->nx + (size_t)(i + l)] = d->at_source;
}

static void scatteri_fill_column_row(void *data, int j)
{
    const scatter_depth *d = (const scatter_depth *)data;
    scatteri_shells work;
    int i;
    for (i = 0; i < d->nx; i += SCATTERI_LANES)
        scatteri_fill_columns(d, i, j, &work);
}

/* --- directional sources: running sums through a lattice ---
   All directional sources share the points of one lattice along the axes of the world, so that what reads them finds the
   same corners for all. A source has parallel columns. They go from layer to layer of the lattice, square to the axis
   that the light is nearest to, and move by the same fraction of a step each time: density at the columns, and depth
   back at the points, are sums of neighbours with the same four weights in each direction. Nothing but density is ever
   interpolated on the way, so nothing is smeared. */

enum {
    SCATTERI_TOGETHER = 4,  /* sources that are read at once */
    SCATTERI_LAYERS = 16,   /* of a light along x, written at once */
    SCATTERI_CREW = 8,      /* sources filled at once, each with work space of its own */
    SCATTERI_LATTICE = 1024 /* points on one axis at most */
};

static int scatteri_on_lattice(scatter_depth_method method, const scatter_source *source)
{
    return method == SCATTER_DEPTH_POLAR && source->directional;
}

/* n points along the longest side, as far apart along the others. */
static void scatteri_lay_lattice(scatteri_lattice *g, scatter_box box, int n)
{
    const scatter_vec3 size = scatteri_sub(box.max, box.min);
    const float step = scatteri_max(size.x, scatteri_max(size.y, size.z)) / (float)(n - 1);
    int i;
    g->box = box;
    for (i = 0; i < 3; i++) {
        const float side = scatteri_get(size, i);
        g->n[i] = scatteri_clamp_int((int)ceil((double)(0.999f * side / step)) + 1, 2, n);
        g->step[i] = scatteri_max(side / (float)(g->n[i] - 1), 1e-30f);
    }
}

static size_t scatteri_lattice_points(const scatteri_lattice *g)
{
    return (size_t)g->n[0] * (size_t)g->n[1] * (size_t)g->n[2];
}

static scatter_vec3 scatteri_lattice_step(const scatteri_lattice *g)
{
    return scatteri_v3(g->step[0], g->step[1], g->step[2]);
}

/* Two voxels around a point of the lattice on one axis, and their weights: 0 where the grid has ended. */
typedef struct scatteri_pair {
    int low, high;
    float weight[2];
} scatteri_pair;

static scatteri_pair scatteri_pair_of(const scatteri_lattice *g, const scatteri_field *f, int axis,
                                      int i)
{
    const int voxels = axis == 0 ? f->grid.nx : axis == 1 ? f->grid.ny : f->grid.nz;
    const float x = scatteri_get(g->box.min, axis) - scatteri_get(f->grid.box.min, axis) +
                    (float)i * g->step[axis];
    const float at = x * scatteri_get(f->per_metre, axis) - 0.5f;
    const float inside =
        (float)((at > -0.501f) & (at < (float)voxels - 0.499f)); /* faces count, rounded */
    const float on = scatteri_clamp(at, 0.0f, (float)(voxels - 1));
    scatteri_pair pair;
    pair.low = (int)on;
    pair.high = pair.low + 1 < voxels ? pair.low + 1 : pair.low;
    pair.weight[1] = inside * (on - (float)pair.low);
    pair.weight[0] = inside - pair.weight[1];
    return pair;
}

/* Those of all points on the x axis. */
typedef struct scatteri_pairs {
    int low[SCATTERI_LATTICE], high[SCATTERI_LATTICE];
    float weight[2][SCATTERI_LATTICE];
} scatteri_pairs;

static void scatteri_pair_up(const scatteri_lattice *g, const scatteri_field *f,
                             scatteri_pairs *pairs)
{
    int i;
    for (i = 0; i < g->n[0]; i++) {
        const scatteri_pair pair = scatteri_pair_of(g, f, 0, i);
        pairs->low[i] = pair.low;
        pairs->high[i] = pair.high;
        pairs->weight[0][i] = pair.weight[0];
        pairs->weight[1][i] = pair.weight[1];
    }
}

/* Adds `weight` times a row of voxels to a row of the lattice. */
SCATTERI_HOT static void scatteri_add_voxels(const scatteri_pairs *SCATTERI_RESTRICT pairs, int n,
                                             const float *SCATTERI_RESTRICT voxels, float weight,
                                             float *SCATTERI_RESTRICT row)
{
    int i;
    for (i = 0; i < n; i++)
        row[i] += weight * (pairs->weight[0][i] * voxels[pairs->low[i]] +
                            pairs->weight[1][i] * voxels[pairs->high[i]]);
}

/* Adds the field to row j, k of the lattice. */
static void scatteri_add_voxel_rows(const scatteri_lattice *g, const scatteri_field *f,
                                    const scatteri_pairs *pairs, int j, int k, float *row)
{
    const scatteri_pair y = scatteri_pair_of(g, f, 1, j), z = scatteri_pair_of(g, f, 2, k);
    int corner;
    for (corner = 0; corner < 4; corner++) {
        const int b = corner & 1, c = corner >> 1;
        const size_t at =
            (size_t)(c ? z.high : z.low) * (size_t)f->grid.ny + (size_t)(b ? y.high : y.low);
        const float weight = f->scale * y.weight[b] * z.weight[c];
        if (weight > 0.0f)
            scatteri_add_voxels(pairs, g->n[0], f->grid.density + at * (size_t)f->grid.nx, weight,
                                row);
    }
}

typedef struct scatteri_sowing {
    const scatteri_medium *medium;
    const scatteri_lattice *lattice;
    scatteri_injection gaussians;
} scatteri_sowing;

/* Local density at the points of layers z0.. of the lattice. */
static void scatteri_sow_slab(void *data, int slab)
{
    const scatteri_sowing *job = (const scatteri_sowing *)data;
    const scatteri_lattice *g = job->lattice;
    const int z0 = (int)((int64_t)g->n[2] * slab / SCATTERI_SLABS),
              z1 = (int)((int64_t)g->n[2] * (slab + 1) / SCATTERI_SLABS);
    const size_t nx = (size_t)g->n[0], slice = nx * (size_t)g->n[1];
    scatteri_pairs pairs;
    size_t i;
    int j, k;
    memset(g->density + slice * (size_t)z0, 0, slice * (size_t)(z1 - z0) * sizeof(float));
    for (i = 0; i < job->medium->desc.gaussian_count; i++) {
        scatter_gaussian gaussian = job->medium->desc.gaussians[i];
        gaussian.center = scatteri_sub(gaussian.center, g->box.min);
        scatteri_splat(&job->gaussians, gaussian, z0, z1);
    }
    for (i = 0; i < job->medium->desc.grid_count; i++) {
        scatteri_pair_up(g, &job->medium->fields[i], &pairs);
        for (k = z0; k < z1; k++)
            for (j = 0; j < g->n[1]; j++)
                scatteri_add_voxel_rows(g, &job->medium->fields[i], &pairs, j, k,
                                        g->density + slice * (size_t)k + nx * (size_t)j);
    }
}

static scatter_result scatteri_sow(const scatteri_stage *stage, const scatteri_medium *medium,
                                   const scatteri_lattice *g)
{
    const scatter_vec3 half = scatteri_scale(scatteri_lattice_step(g), 0.5f);
    scatteri_sowing job;
    memset(&job, 0, sizeof job);
    job.medium = medium;
    job.lattice = g;
    job.gaussians.cell = scatteri_lattice_step(g);
    job.gaussians.volume.values = g->density;
    job.gaussians.volume.nx = g->n[0];
    job.gaussians.volume.ny = g->n[1];
    job.gaussians.volume.nz = g->n[2];
    /* points are the centres of its cells; relative to the lattice, as far from 0 half a step is no float */
    job.gaussians.volume.box.min = scatteri_scale(half, -1.0f);
    job.gaussians.volume.box.max = scatteri_add(scatteri_sub(g->box.max, g->box.min), half);
    return scatteri_parallel(stage, SCATTERI_SLABS, scatteri_sow_slab, &job);
}

/* The columns of one source. They count from `first` in both directions, and stand `offset` from the points. */
typedef struct scatteri_sheaf {
    const scatteri_lattice *g;
    int axis;               /* the layers' */
    int nu, nv, layers;     /* points: in a row, rows, layers */
    size_t su, sv, sl;      /* between them in the lattice's arrays */
    int backward;           /* layers are passed from the last to the first */
    float shift_u, shift_v; /* of columns, points per layer */
    float length;           /* of a column between two layers, m */
    int first_u, first_v, wide;
    float *depth, *density; /* of the columns at the last layer */
    float *in, *out;        /* SCATTERI_LAYERS layers of lights along x, rows along y, */
    size_t plane;           /* so far apart */
    float *values;
    int stride;
} scatteri_sheaf;

/* Whole and fractional part of where columns stand in layer m. */
static int scatteri_offset(float shift, int m, float *fraction)
{
    const double at = (double)shift * m, whole = floor(at);
    *fraction = (float)(at - whole);
    return (int)whole;
}

/* Memory of a layer square to x: an odd number of cache lines, or all of them would fall on the same places in a cache. */
static size_t scatteri_plane(const scatteri_lattice *g)
{
    return (((size_t)g->n[1] * (size_t)g->n[2] + 15) / 16 | 1) * 16;
}

/* The most that the columns through a layer need beyond its points: a point of the weights on one side, two on the
   other, and the points that columns move by on their way through all layers. */
static size_t scatteri_sheaf_room(const scatteri_lattice *g)
{
    size_t most = 0;
    int i;
    for (i = 0; i < 3; i++) {
        const size_t n = (size_t)g->n[i];
        const size_t u = (size_t)g->n[(i + 1) % 3], v = (size_t)g->n[(i + 2) % 3];
        const size_t room = 2 * (u + n + 4) * (v + n + 4);
        most = room > most ? room : most;
    }
    return most + 2 * (size_t)SCATTERI_LAYERS * scatteri_plane(g);
}

/* What moves by less than a thousandth of a point on the whole way counts as at rest. */
static float scatteri_shift(float shift)
{
    return scatteri_abs(shift) * (float)SCATTERI_LATTICE > 1e-3f ? shift : 0.0f;
}

static scatteri_sheaf scatteri_bind(const scatteri_lattice *g, scatter_vec3 w, float *work)
{
    const size_t stride[3] = {1, (size_t)g->n[0], (size_t)g->n[0] * (size_t)g->n[1]};
    float per[3], fraction;
    scatteri_sheaf s;
    int i, u, v, moved;
    memset(&s, 0, sizeof s);
    for (i = 0; i < 3; i++) {
        per[i] = scatteri_get(w, i) / g->step[i];
        s.axis = scatteri_abs(per[i]) > scatteri_abs(per[s.axis]) ? i : s.axis;
    }
    u = s.axis == 0 ? 1 : 0;
    v = s.axis == 2 ? 1 : 2;
    s.g = g;
    s.nu = g->n[u], s.nv = g->n[v], s.layers = g->n[s.axis];
    s.su = stride[u], s.sv = stride[v], s.sl = stride[s.axis];
    s.backward = per[s.axis] < 0.0f;
    s.shift_u = scatteri_shift(per[u] / scatteri_abs(per[s.axis]));
    s.shift_v = scatteri_shift(per[v] / scatteri_abs(per[s.axis]));
    s.length = 1.0f / scatteri_abs(per[s.axis]);
    moved = scatteri_offset(s.shift_u, s.layers - 1, &fraction);
    s.first_u = -2 - (moved > 0 ? moved : 0);
    s.wide = s.nu + 3 + (moved > 0 ? moved : -moved);
    moved = scatteri_offset(s.shift_v, s.layers - 1, &fraction);
    s.first_v = -2 - (moved > 0 ? moved : 0);
    s.in = work;
    s.plane = scatteri_plane(g);
    s.out = s.in + (size_t)SCATTERI_LAYERS * s.plane;
    s.depth = s.out + (size_t)SCATTERI_LAYERS * s.plane;
    s.density = s.depth + (size_t)s.wide * (size_t)(s.nv + 3 + (moved > 0 ? moved : -moved));
    return s;
}

/* Lagrange's weights of the points -1, 0, 1, 2 at f in 0..1. */
static void scatteri_cubic(float f, float *weight)
{
    weight[0] = -f * (f - 1.0f) * (f - 2.0f) * 0.166666667f;
    weight[1] = (f + 1.0f) * (f - 1.0f) * (f - 2.0f) * 0.5f;
    weight[2] = -(f + 1.0f) * f * (f - 2.0f) * 0.5f;
    weight[3] = (f + 1.0f) * f * (f - 1.0f) * 0.166666667f;
}

/* out = sum of weight times a, b, c, d. */
SCATTERI_HOT static void
scatteri_blend(const float *SCATTERI_RESTRICT a, const float *SCATTERI_RESTRICT b,
               const float *SCATTERI_RESTRICT c, const float *SCATTERI_RESTRICT d,
               const float *SCATTERI_RESTRICT weight, int n, float *SCATTERI_RESTRICT out)
{
    const float p = weight[0], q = weight[1], r = weight[2], s = weight[3];
    int i;
    for (i = 0; i < n; i++)
        out[i] = p * a[i] + q * b[i] + r * c[i] + s * d[i];
}

/* A layer: where its columns stand. `row` i is that of the columns around point i; so are columns in a row. */
typedef struct scatteri_layer {
    int m, whole_u, whole_v;
    float part_u, part_v;
    float to_u[4], to_v[4], back_u[4], back_v[4]; /* weights: from points to columns, and back */
    const float *points;                          /* density */
    size_t row;                                   /* between its rows */
    float since[SCATTERI_LATTICE +
                8]; /* layers since the columns of a row came in through a side, at u = -2.. */
} scatteri_layer;

/* Columns that come in later lack no more than so many layers: beyond, light glances off the face. */
#define SCATTERI_SHORT -4.0f

/* Layers since a column at u came in through a side; many if it never does. */
static float scatteri_since(float u, float shift, int n)
{
    const float inside = shift > 0.0f ? u : u - (float)(n - 1);
    return shift != 0.0f ? scatteri_max(inside / shift, SCATTERI_SHORT) : 1e9f;
}

static void scatteri_begin_layer(const scatteri_sheaf *s, int m, scatteri_layer *layer)
{
    int i;
    layer->m = m;
    layer->whole_u = scatteri_offset(s->shift_u, m, &layer->part_u);
    layer->whole_v = scatteri_offset(s->shift_v, m, &layer->part_v);
    scatteri_cubic(layer->part_u, layer->to_u);
    scatteri_cubic(layer->part_v, layer->to_v);
    scatteri_cubic(1.0f - layer->part_u, layer->back_u);
    scatteri_cubic(1.0f - layer->part_v, layer->back_v);
    for (i = 0; i < s->nu + 3; i++)
        layer->since[i] = scatteri_since((float)(i - 2) + layer->part_u, s->shift_u, s->nu);
}

/* Running sum along a row of columns. Outside, density goes on as at the face: a column starts from what it is short of
   when it comes in, so that depth is smooth across the face where light enters, and where it leaves. */
SCATTERI_HOT static void scatteri_grow_columns(int n, float length, float since_v,
                                               const float *SCATTERI_RESTRICT since_u,
                                               const float *SCATTERI_RESTRICT here,
                                               float *SCATTERI_RESTRICT density,
                                               float *SCATTERI_RESTRICT depth)
{
    int i;
    for (i = 0; i < n; i++) {
        const float since = scatteri_min(since_u[i], since_v), d = here[i];
        const float mean = 0.5f * length * (d + density[i]);
        const float inside = scatteri_max(depth[i], 0.0f) + scatteri_min(since, 1.0f) * mean;
        depth[i] = scatteri_choose(0.0f, since, inside, since * length * d);
        density[i] = d;
    }
}

static float *scatteri_column_row(const scatteri_sheaf *s, const scatteri_layer *layer, int row,
                                  float *columns)
{
    return columns + (size_t)(row - layer->whole_v - s->first_v) * (size_t)s->wide +
           (-2 - layer->whole_u - s->first_u);
}

static const float *scatteri_point_row(const scatteri_sheaf *s, const scatteri_layer *layer,
                                       int row)
{
    return layer->points + (size_t)scatteri_clamp_int(row, 0, s->nv - 1) * layer->row;
}

/* The columns around row `row`, from the layer before to this one. */
static void scatteri_advance_row(const scatteri_sheaf *s, const scatteri_layer *layer, int row)
{
    float points[SCATTERI_LATTICE + 8], here[SCATTERI_LATTICE + 8];
    const float since = scatteri_since((float)row + layer->part_v, s->shift_v, s->nv);
    int i;
    scatteri_blend(scatteri_point_row(s, layer, row - 1), scatteri_point_row(s, layer, row),
                   scatteri_point_row(s, layer, row + 1), scatteri_point_row(s, layer, row + 2),
                   layer->to_v, s->nu, points + 3);
    for (i = 0; i < 3; i++) {
        points[i] = points[3];
        points[s->nu + 3 + i] = points[s->nu + 2];
    }
    scatteri_blend(points, points + 1, points + 2, points + 3, layer->to_u, s->nu + 3, here);
    scatteri_grow_columns(s->nu + 3, s->length, scatteri_min(since, (float)layer->m), layer->since,
                          here, scatteri_column_row(s, layer, row, s->density),
                          scatteri_column_row(s, layer, row, s->depth));
}

SCATTERI_HOT static void scatteri_put_row(const float *SCATTERI_RESTRICT row, int n, size_t stride,
                                          float *SCATTERI_RESTRICT out)
{
    int i;
    for (i = 0; i < n; i++)
        out[(size_t)i * stride] = scatteri_max(row[i], 0.0f);
}

/* Depth from the columns back to the points of a row. */
static void scatteri_write_row(const scatteri_sheaf *s, const scatteri_layer *layer, int row,
                               size_t stride, float *out)
{
    float columns[SCATTERI_LATTICE + 8], points[SCATTERI_LATTICE + 8];
    scatteri_blend(scatteri_column_row(s, layer, row - 2, s->depth),
                   scatteri_column_row(s, layer, row - 1, s->depth),
                   scatteri_column_row(s, layer, row, s->depth),
                   scatteri_column_row(s, layer, row + 1, s->depth), layer->back_v, s->nu + 3,
                   columns);
    scatteri_blend(columns, columns + 1, columns + 2, columns + 3, layer->back_u, s->nu, points);
    scatteri_put_row(points, s->nu, stride, out);
}

/* A layer whose rows go to `out`, `row` apart. */
static void scatteri_pass_layer(const scatteri_sheaf *s, const scatteri_layer *layer, size_t stride,
                                size_t row, float *out)
{
    int i;
    for (i = -2; i <= s->nv; i++) {
        scatteri_advance_row(s, layer, i);
        if (i > 0)
            scatteri_write_row(s, layer, i - 1, stride, out + (size_t)(i - 1) * row);
    }
}

/* Between layers square to x and the lattice, where they are far apart: point by point of a few of them. */
SCATTERI_HOT static void scatteri_turn_layers(const scatteri_sheaf *s, int first, int count,
                                              int out)
{
    const size_t plane = (size_t)s->nu * (size_t)s->nv;
    float *values = s->values + (size_t)first * (size_t)s->stride;
    const float *density = s->g->density + first;
    size_t i;
    int t;
    for (i = 0; i < plane; i++)
        if (out)
            for (t = 0; t < count; t++)
                values[((size_t)t + i * s->su) * (size_t)s->stride] =
                    s->out[(size_t)t * s->plane + i];
        else
            for (t = 0; t < count; t++)
                s->in[(size_t)t * s->plane + i] = density[(size_t)t + i * s->su];
}

/* Layers first..first+count, in the order of the light. */
static void scatteri_pass_layers(const scatteri_sheaf *s, int first, int count)
{
    const size_t stride = (size_t)s->stride;
    scatteri_layer layer;
    int t;
    if (s->axis == 0)
        scatteri_turn_layers(s, first, count, 0);
    for (t = 0; t < count; t++) {
        const int on = s->backward ? count - 1 - t : t, at = first + on;
        scatteri_begin_layer(s, s->backward ? s->layers - 1 - at : at, &layer);
        if (s->axis == 0) {
            layer.points = s->in + (size_t)on * s->plane;
            layer.row = (size_t)s->nu;
            scatteri_pass_layer(s, &layer, 1, (size_t)s->nu, s->out + (size_t)on * s->plane);
        } else {
            layer.points = s->g->density + (size_t)at * s->sl;
            layer.row = s->sv;
            scatteri_pass_layer(s, &layer, stride, s->sv * stride,
                                s->values + (size_t)at * s->sl * stride);
        }
    }
    if (s->axis == 0)
        scatteri_turn_layers(s, first, count, 1);
}

static void scatteri_fill_lattice(const scatter_depth *d, float *work)
{
    scatteri_sheaf s = scatteri_bind(d->lattice, d->source.direction, work);
    int done;
    s.values = d->values;
    s.stride = d->stride;
    for (done = 0; done < s.layers; done += SCATTERI_LAYERS) {
        const int left = s.layers - done, count = left < SCATTERI_LAYERS ? left : SCATTERI_LAYERS;
        scatteri_pass_layers(&s, s.backward ? left - count : done, count);
    }
}

/* --- reading --- */

/* Cell and fraction on an axis of n values at 0..n-1; beyond the ends by at most half a cell, linearly. */
SCATTERI_FN int scatteri_lower(float at, int n)
{
    const int i = (int)scatteri_clamp(at, 0.0f, (float)(n - 2));
    return i;
}

SCATTERI_FN float scatteri_gather8(const float *v, int base, int sy, int sz, float fx, float fy,
                                   float fz)
{
    return scatteri_trilinear(v[base], v[base + 1], v[base + sy], v[base + sy + 1], v[base + sz],
                              v[base + sz + 1], v[base + sz + sy], v[base + sz + sy + 1], fx, fy,
                              fz);
}

/* A point outside the box moves along its segment by `shift` to where the segment enters the box; `inside` is 0 where it
   never does, else 1. */
SCATTERI_FN void scatteri_enter_box(scatter_box b, const scatteri_points *p, int first,
                                    float *SCATTERI_RESTRICT shift, float *SCATTERI_RESTRICT inside)
{
    int l;
    for (l = 0; l < SCATTERI_LANES; l++) {
        const int i = first + l;
        const float length = scatteri_min(p->length[i], SCATTERI_FAR);
        const float dx = scatteri_not_zero(p->dx[i]), dy = scatteri_not_zero(p->dy[i]),
                    dz = scatteri_not_zero(p->dz[i]);
        const float nearx = (scatteri_choose(0.0f, dx, b.min.x, b.max.x) - p->x[i]) / dx;
        const float neary = (scatteri_choose(0.0f, dy, b.min.y, b.max.y) - p->y[i]) / dy;
        const float nearz = (scatteri_choose(0.0f, dz, b.min.z, b.max.z) - p->z[i]) / dz;
        const float farx = (scatteri_choose(0.0f, dx, b.max.x, b.min.x) - p->x[i]) / dx;
        const float fary = (scatteri_choose(0.0f, dy, b.max.y, b.min.y) - p->y[i]) / dy;
        const float farz = (scatteri_choose(0.0f, dz, b.max.z, b.min.z) - p->z[i]) / dz;
        const float enter = scatteri_max(scatteri_max(nearx, neary), scatteri_max(nearz, 0.0f));
        const float leave = scatteri_min(scatteri_min(farx, fary), scatteri_min(farz, length));
        shift[l] = scatteri_min(enter, 1e9f);
        inside[l] = scatteri_choose(leave, enter, 0.0f, 1.0f);
    }
}

/* Depth at 16 points from a volume of cells. */
SCATTERI_FN void scatteri_read_cells(const scatter_depth *d, const scatteri_points *p, int first,
                                     float *SCATTERI_RESTRICT depth)
{
    const scatter_box b = scatteri_box_from(d->box, p->ref);
    const int nx = d->nx, ny = d->ny, nz = d->nz, directional = d->source.directional;
    const float sx = 1.0f / d->cell.x, sy = 1.0f / d->cell.y, sz = 1.0f / d->cell.z;
    int base[SCATTERI_LANES], l;
    float fx[SCATTERI_LANES], fy[SCATTERI_LANES], fz[SCATTERI_LANES], factor[SCATTERI_LANES];
    float shift[SCATTERI_LANES], inside[SCATTERI_LANES];
    scatteri_enter_box(b, p, first, shift, inside);
    for (l = 0; l < SCATTERI_LANES; l++) {
        const int i = first + l;
        const float gx = (p->x[i] + shift[l] * p->dx[i] - b.min.x) * sx - 0.5f;
        const float gy = (p->y[i] + shift[l] * p->dy[i] - b.min.y) * sy - 0.5f;
        const float gz = (p->z[i] + shift[l] * p->dz[i] - b.min.z) * sz - 0.5f;
        const int cx = scatteri_lower(gx, nx), cy = scatteri_lower(gy, ny),
                  cz = scatteri_lower(gz, nz);
        base[l] = (cz * ny + cy) * nx + cx;
        fx[l] = scatteri_clamp(gx - (float)cx, -0.5f, 1.5f);
        fy[l] = scatteri_clamp(gy - (float)cy, -0.5f, 1.5f);
        fz[l] = scatteri_clamp(gz - (float)cz, -0.5f, 1.5f);
        factor[l] = inside[l] * (directional ? 1.0f : p->distance[i] - shift[l]);
    }
    for (l = 0; l < SCATTERI_LANES; l++)
        depth[first + l] += scatteri_max(
            factor[l] * scatteri_gather8(d->values, base[l], nx, nx * ny, fx[l], fy[l], fz[l]),
            0.0f);
}

/* Depth at 16 points from columns. Behind the last shell nothing is added any more. */
SCATTERI_FN void scatteri_read_columns(const scatter_depth *d, const scatteri_points *p, int first,
                                       float *SCATTERI_RESTRICT depth)
{
    const int nu = d->nx, nv = d->ny, nr = d->nz;
    const scatter_vec3 u = d->axis_u, v = d->axis_v, w = d->axis_w;
    const scatter_vec3 o = scatteri_sub(p->ref, d->source.position);
    const float iu = 1.0f / d->step_u, iv = 1.0f / d->step_v, ir = 1.0f / d->step_r;
    const float last = d->low_r + (float)(nr - 1) * d->step_r;
    int base[SCATTERI_LANES], l;
    float fr[SCATTERI_LANES], fu[SCATTERI_LANES], fv[SCATTERI_LANES], factor[SCATTERI_LANES];
    for (l = 0; l < SCATTERI_LANES; l++) {
        const float x = o.x + p->x[first + l], y = o.y + p->y[first + l], z = o.z + p->z[first + l];
        const scatteri_vec2 e = scatteri_oct_encode(scatteri_v3(
            u.x * x + u.y * y + u.z * z, v.x * x + v.y * y + v.z * z, w.x * x + w.y * y + w.z * z));
        const float r = scatteri_min(p->distance[first + l], last);
        const float gu = scatteri_clamp((e.x - d->low_u) * iu, 0.0f, (float)(nu - 1));
        const float gv = scatteri_clamp((e.y - d->low_v) * iv, 0.0f, (float)(nv - 1));
        const float gr = scatteri_clamp((r - d->low_r) * ir, 0.0f, (float)(nr - 1));
        const int cu = scatteri_lower(gu, nu), cv = scatteri_lower(gv, nv),
                  cr = scatteri_lower(gr, nr);
        base[l] = (cr * nv + cv) * nu + cu;
        fu[l] = gu - (float)cu;
        fv[l] = gv - (float)cv;
        fr[l] = gr - (float)cr;
        factor[l] = r;
    }
    for (l = 0; l < SCATTERI_LANES; l++)
        depth[first + l] +=
            factor[l] * scatteri_gather8(d->values, base[l], nu, nu * nv, fu[l], fv[l], fr[l]);
}

/* Points on a lattice: the lowest of the eight around each, and how far it is from there. */
typedef struct scatteri_spots {
    int base[SCATTERI_POINTS];
    float fx[SCATTERI_POINTS], fy[SCATTERI_POINTS], fz[SCATTERI_POINTS];
} scatteri_spots;

/* 16 points, relative to `ref`. */
SCATTERI_FN void scatteri_find_spots(const scatteri_lattice *g, scatter_vec3 ref,
                                     const float *SCATTERI_RESTRICT x,
                                     const float *SCATTERI_RESTRICT y,
                                     const float *SCATTERI_RESTRICT z, int first,
                                     scatteri_spots *SCATTERI_RESTRICT spots)
{
    const scatter_vec3 o = scatteri_sub(g->box.min, ref);
    const int nx = g->n[0], ny = g->n[1], nz = g->n[2];
    const float sx = 1.0f / g->step[0], sy = 1.0f / g->step[1], sz = 1.0f / g->step[2];
    int l;
    for (l = 0; l < SCATTERI_LANES; l++) {
        const float gx = scatteri_clamp((x[l] - o.x) * sx, 0.0f, (float)(nx - 1));
        const float gy = scatteri_clamp((y[l] - o.y) * sy, 0.0f, (float)(ny - 1));
        const float gz = scatteri_clamp((z[l] - o.z) * sz, 0.0f, (float)(nz - 1));
        const int i = scatteri_lower(gx, nx), j = scatteri_lower(gy, ny),
                  k = scatteri_lower(gz, nz);
        spots->base[first + l] = (k * ny + j) * nx + i;
        spots->fx[first + l] = gx - (float)i;
        spots->fy[first + l] = gy - (float)j;
        spots->fz[first + l] = gz - (float)k;
    }
}

SCATTERI_HOT static void scatteri_find_all_spots(const scatteri_lattice *g, int count,
                                                 const scatteri_points *p, scatteri_spots *spots)
{
    int first;
    for (first = 0; first < count; first += SCATTERI_LANES)
        scatteri_find_spots(g, p->ref, p->x + first, p->y + first, p->z + first, first, spots);
}

/* Depth at 16 points from a lattice. */
SCATTERI_FN void scatteri_read_lattice(const scatter_depth *d, const scatteri_points *p, int first,
                                       float *SCATTERI_RESTRICT depth)
{
    const scatteri_lattice *g = d->lattice;
    const int stride = d->stride, sy = g->n[0], sz = g->n[0] * g->n[1];
    float x[SCATTERI_LANES], y[SCATTERI_LANES], z[SCATTERI_LANES];
    float shift[SCATTERI_LANES], inside[SCATTERI_LANES];
    scatteri_spots s;
    int l;
    scatteri_enter_box(scatteri_box_from(g->box, p->ref), p, first, shift, inside);
    for (l = 0; l < SCATTERI_LANES; l++) {
        x[l] = p->x[first + l] + shift[l] * p->dx[first + l];
        y[l] = p->y[first + l] + shift[l] * p->dy[first + l];
        z[l] = p->z[first + l] + shift[l] * p->dz[first + l];
    }
    scatteri_find_spots(g, p->ref, x, y, z, 0, &s);
    for (l = 0; l < SCATTERI_LANES; l++) {
        const float *v = d->values + (size_t)s.base[l] * (size_t)stride;
        const ptrdiff_t ax = stride, ay = (ptrdiff_t)sy * stride, az = (ptrdiff_t)sz * stride;
        depth[first + l] +=
            inside[l] * scatteri_trilinear(v[0], v[ax], v[ay], v[ay + ax], v[az], v[az + ax],
                                           v[az + ay], v[az + ay + ax], s.fx[l], s.fy[l], s.fz[l]);
    }
}

/* Sorts what lies side by side by its sources. */
SCATTERI_HOT static void scatteri_sort_out(int count, const float *SCATTERI_RESTRICT all,
                                           float *SCATTERI_RESTRICT a, float *SCATTERI_RESTRICT b,
                                           float *SCATTERI_RESTRICT c, float *SCATTERI_RESTRICT d)
{
    int i;
    for (i = 0; i < count; i++) {
        a[i] = all[SCATTERI_TOGETHER * i];
        b[i] = all[SCATTERI_TOGETHER * i + 1];
        c[i] = all[SCATTERI_TOGETHER * i + 2];
        d[i] = all[SCATTERI_TOGETHER * i + 3];
    }
}

/* Depth at points from a lattice, of all sources whose values lie side by side. */
SCATTERI_HOT static void scatteri_read_together(const scatteri_lattice *g, const float *values,
                                                int count,
                                                const scatteri_spots *SCATTERI_RESTRICT s,
                                                float (*depth)[SCATTERI_POINTS])
{
    const size_t sy = (size_t)g->n[0] * SCATTERI_TOGETHER, sz = sy * (size_t)g->n[1];
    float all[(int)SCATTERI_POINTS * (int)SCATTERI_TOGETHER];
    int i, c;
    for (i = 0; i < count; i++) {
        const float *SCATTERI_RESTRICT v = values + (size_t)s->base[i] * SCATTERI_TOGETHER;
        const float fx = s->fx[i], fy = s->fy[i], fz = s->fz[i];
        for (c = 0; c < SCATTERI_TOGETHER; c++) {
            const float *p = v + c, *q = p + SCATTERI_TOGETHER;
            all[i * SCATTERI_TOGETHER + c] = scatteri_trilinear(
                p[0], q[0], p[sy], q[sy], p[sz], q[sz], p[sz + sy], q[sz + sy], fx, fy, fz);
        }
    }
    scatteri_sort_out(count, all, depth[0], depth[1], depth[2], depth[3]);
}

SCATTERI_HOT static void scatteri_read_depth(const scatter_depth *d, int count,
                                             const scatteri_points *p, float *depth)
{
    int first;
    if (!d->medium->has_local)
        return;
    for (first = 0; first < count; first += SCATTERI_LANES) {
        if (scatteri_on_lattice(d->method, &d->source))
            scatteri_read_lattice(d, p, first, depth);
        else if (d->method == SCATTER_DEPTH_POLAR)
            scatteri_read_columns(d, p, first, depth);
        else
            scatteri_read_cells(d, p, first, depth);
    }
}

/* Adds constant and height fog between the points and the source. */
SCATTERI_HOT static void scatteri_add_analytic(const scatter_medium *medium, int count,
                                               const scatteri_points *p,
                                               float *SCATTERI_RESTRICT depth)
{
    size_t h;
    int first, l;
    for (first = 0; first < count; first += SCATTERI_LANES) {
        for (l = first; l < first + SCATTERI_LANES; l++)
            depth[l] += medium->constant * p->length[l];
        for (h = 0; h < medium->height_count; h++) {
            const scatter_height fog = medium->heights[h];
            const float y0 = fog.y0 - p->ref.y;
            for (l = first; l < first + SCATTERI_LANES; l++)
                depth[l] += scatteri_height_depth(fog.density, y0, fog.scale, p->y[l], p->dy[l],
                                                  p->length[l]);
        }
        for (l = first; l < first + SCATTERI_LANES; l++)
            depth[l] = scatteri_min(depth[l], SCATTERI_FAR);
    }
}

/* Adds density and depth (from t0) of constant and height fog at points t of 16 rays. */
SCATTERI_HOT static void scatteri_add_fog(const scatter_medium *medium, const scatteri_rays *rays,
                                          int count, const float *SCATTERI_RESTRICT t,
                                          float *SCATTERI_RESTRICT density,
                                          float *SCATTERI_RESTRICT depth)
{
    size_t h;
    int first, l;
    for (first = 0; first < count; first += SCATTERI_LANES) {
        for (l = 0; l < SCATTERI_LANES; l++) {
            density[first + l] += medium->constant;
            depth[first + l] += medium->constant * (t[first + l] - rays->t0[l]);
        }
        for (h = 0; h < medium->height_count; h++) {
            const scatter_height fog = medium->heights[h];
            const float y0 = fog.y0 - rays->ref.y;
            for (l = 0; l < SCATTERI_LANES; l++) {
                const float y = rays->oy[l] + t[first + l] * rays->dy[l];
                const float start = rays->oy[l] + rays->t0[l] * rays->dy[l],
                            length = t[first + l] - rays->t0[l];
                density[first + l] +=
                    fog.density * scatteri_exp(scatteri_min((y0 - y) / fog.scale, 80.0f));
                depth[first + l] +=
                    scatteri_height_depth(fog.density, y0, fog.scale, start, rays->dy[l], length);
            }
        }
    }
}

/* --- preparing --- */

static int scatteri_reads_injected(scatter_depth_method method)
{
    return method == SCATTER_DEPTH_EQ6 || method == SCATTER_DEPTH_UPWIND ||
           method == SCATTER_DEPTH_SHORT || method == SCATTER_DEPTH_MARCH;
}

static scatter_depth_method scatteri_choose_depth(scatter_depth_method method,
                                                  const scatter_medium *medium)
{
    if (method != SCATTER_DEPTH_AUTO)
        return method;
    return medium->gaussian_count <= 256 && medium->grid_count == 0 ? SCATTER_DEPTH_CLOSED
                                                                    : SCATTER_DEPTH_POLAR;
}

/* Points of the lattices of all directional lights by default: 2^26 values, 256 MB. */
#define SCATTERI_SKY 67108864.0f

static int scatteri_choose_grid(int grid, const scatter_medium *medium, size_t directional)
{
    int n = medium->gaussian_count > 256 ? 128 : 64;
    size_t i;
    if (grid != 0)
        return grid;
    for (i = 0; i < medium->grid_count; i++) {
        const scatter_grid *g = &medium->grids[i];
        const int most =
            g->nx > g->ny ? (g->nx > g->nz ? g->nx : g->nz) : (g->ny > g->nz ? g->ny : g->nz);
        n = scatteri_clamp_int(most + most / 2, n, 256);
    }
    while (directional > 0 && n > 32 &&
           (float)n * (float)n * (float)n * (float)directional > SCATTERI_SKY)
        n--;
    return n;
}

/* Polar volumes take the n^3 values as sqrt2 n x sqrt2 n directions and n/2 shells: beyond the middle of the volume
   directions are farther apart than shells. Voxels fill every shell with detail: n shells. */
static void scatteri_shape(scatter_depth *d, int n)
{
    const int columns = (int)(1.41421356f * (float)n + 0.5f);
    const int shells = n / 2 > 2 ? n / 2 : 2;
    d->nx = d->ny = d->nz = n;
    if (d->method != SCATTER_DEPTH_POLAR)
        return;
    d->nx = d->ny = columns < 1024 ? columns : 1024;
    d->nz = d->medium->desc.grid_count > 0 ? n : shells;
}

/* Where the cells of about n^3 lie. */
static void scatteri_lay_out(scatter_depth *d, int n)
{
    scatteri_shape(d, n);
    d->box = d->medium->local;
    d->cell = scatteri_v3((d->box.max.x - d->box.min.x) / (float)n,
                          (d->box.max.y - d->box.min.y) / (float)n,
                          (d->box.max.z - d->box.min.z) / (float)n);
    if (d->method == SCATTER_DEPTH_POLAR)
        scatteri_polar_columns(d);
}

static scatter_result scatteri_fill(const scatteri_stage *stage, scatter_depth *d)
{
    switch (d->method) {
    case SCATTER_DEPTH_POLAR: return scatteri_parallel(stage, d->ny, scatteri_fill_column_row, d);
    case SCATTER_DEPTH_CLOSED_VOLUME:
        return scatteri_parallel(stage, d->nz, scatteri_closed_slice, d);
    case SCATTER_DEPTH_MARCH: return scatteri_parallel(stage, d->nz, scatteri_march_slice, d);
    case SCATTER_DEPTH_EQ6:
    case SCATTER_DEPTH_UPWIND:
    case SCATTER_DEPTH_SHORT: return scatteri_parallel(stage, 1, scatteri_sweep, d);
    case SCATTER_DEPTH_AUTO:
    case SCATTER_DEPTH_CLOSED: break;
    }
    return SCATTER_OK;
}

/* Too many cells for an int. */
static scatter_result scatteri_too_fine(const scatter_host *host, int n)
{
    return scatteri_fail(host, SCATTER_TOO_LARGE,
                         "quality.grid %d needs more cells than an int counts", n);
}

/* A lattice that is laid gets density and work space for so many sources at a time. */
static scatter_result scatteri_build_lattice(const scatteri_stage *stage,
                                             const scatteri_medium *medium, int n, int crew,
                                             scatteri_buffer *memory, scatteri_lattice *g)
{
    scatter_result result;
    size_t points, room;
    points = scatteri_bytes((size_t)g->n[0], (size_t)g->n[1], (size_t)g->n[2], 1);
    if (points == 0 || scatteri_bytes(points, SCATTERI_TOGETHER, 1, sizeof(float)) == 0)
        return scatteri_too_fine(stage->host, n);
    room = scatteri_sheaf_room(g);
    result = scatteri_reserve(stage->host, memory, (points + (size_t)crew * room) * sizeof(float),
                              "density and work space of directional lights");
    if (result != SCATTER_OK)
        return result;
    g->density = (float *)memory->data;
    g->work = g->density + points;
    g->crew = crew;
    return scatteri_sow(stage, medium, g);
}

/* One directional source on a lattice of its own. */
static scatter_result scatteri_build_alone(const scatteri_stage *stage, scatter_depth *d, int n)
{
    scatter_result result;
    scatteri_lay_lattice(&d->own_lattice, d->medium->local, n);
    result = scatteri_build_lattice(stage, d->medium, n, 1, &d->own_memory, &d->own_lattice);
    if (result == SCATTER_OK)
        result = scatteri_reserve(&d->host, &d->memory,
                                  scatteri_lattice_points(&d->own_lattice) * sizeof(float),
                                  "a depth volume");
    if (result != SCATTER_OK)
        return result;
    d->lattice = &d->own_lattice;
    d->values = (float *)d->memory.data;
    d->stride = 1;
    scatteri_fill_lattice(d, d->own_lattice.work);
    return SCATTER_OK;
}

/* d->medium, source, method and (where it is read) injected are set. */
static scatter_result scatteri_build_depth(const scatteri_stage *stage, scatter_depth *d, int n)
{
    scatter_result result;
    size_t bytes;
    if (d->method == SCATTER_DEPTH_CLOSED || !d->medium->has_local)
        return SCATTER_OK;
    if (scatteri_on_lattice(d->method, &d->source))
        return scatteri_build_alone(stage, d, n);
    scatteri_lay_out(d, n);
    bytes = scatteri_bytes((size_t)d->nx, (size_t)d->ny, (size_t)d->nz, sizeof(float));
    if (bytes == 0)
        return scatteri_too_fine(&d->host, n);
    result = scatteri_reserve(&d->host, &d->memory, bytes, "a depth volume");
    if (result != SCATTER_OK)
        return result;
    d->values = (float *)d->memory.data;
    d->at_source =
        d->source.directional ? 0.0f : scatteri_local_density(d->medium, d->source.position);
    return scatteri_fill(stage, d);
}

/* The medium's local terms in n^3 cells of its local box, as a field; with a map of distances if `map`. */
static scatter_result scatteri_build_injected(const scatteri_stage *stage,
                                              const scatteri_medium *medium, int n, int map,
                                              scatteri_buffer *memory, scatteri_field *field)
{
    const scatter_host *host = stage->host;
    const size_t values = scatteri_bytes((size_t)n, (size_t)n, (size_t)n, sizeof(float));
    scatter_volume volume;
    scatter_grid grid;
    scatter_result result;
    memset(&grid, 0, sizeof grid);
    grid.nx = grid.ny = grid.nz = volume.nx = volume.ny = volume.nz = n;
    grid.box = volume.box = medium->local;
    *field = scatteri_field_of(&grid);
    if (values == 0)
        return scatteri_too_fine(host, n);
    result = scatteri_reserve(host, memory, values + (map ? scatteri_map_bytes(&grid) : 0),
                              "the injected density");
    if (result != SCATTER_OK)
        return result;
    volume.values = (float *)memory->data;
    field->grid.density = volume.values;
    result = scatteri_inject(stage, &medium->desc, &volume, 0);
    if (result == SCATTER_OK && map)
        scatteri_map_distances(host, field, (char *)memory->data + values);
    return result;
}

/* Local depth at 16 times the same point. */
static float scatteri_depth_at_point(const scatter_depth *d, const scatteri_points *p)
{
    float depth[SCATTERI_LANES];
    if (d->method == SCATTER_DEPTH_CLOSED) {
        const scatteri_segment s = scatteri_segment_of(p, 0);
        return scatteri_local_depth(&d->medium->desc, &s);
    }
    memset(depth, 0, sizeof depth);
    scatteri_read_depth(d, SCATTERI_LANES, p, depth);
    return depth[0];
}

/* Moves a point outside the bounds to where its segment to the source enters them; 0 if it never does. */
static int scatteri_enter_bounds(const scatter_depth *d, scatter_vec3 *x)
{
    const scatter_medium *medium = &d->medium->desc;
    const scatter_vec3 to = d->source.directional ? scatteri_scale(d->source.direction, -1.0f)
                                                  : scatteri_sub(d->source.position, *x);
    float t0 = 0.0f, t1 = d->source.directional ? SCATTERI_FAR : 1.0f;
    if (!medium->bounded || scatteri_inside(medium->bounds, *x))
        return 1;
    if (!scatteri_clip(medium->bounds, *x, to, &t0, &t1))
        return 0;
    *x = scatteri_along(*x, to, t0);
    return 1;
}

SCATTER_API float scatter_depth_at(const scatter_depth *d, scatter_vec3 x)
{
    scatteri_points p;
    float analytic[SCATTERI_LANES];
    if (d == NULL || !d->ready || !scatteri_enter_bounds(d, &x))
        return 0.0f;
    p.ref = x;
    memset(p.x, 0, SCATTERI_LANES * sizeof(float));
    memset(p.y, 0, SCATTERI_LANES * sizeof(float));
    memset(p.z, 0, SCATTERI_LANES * sizeof(float));
    memset(analytic, 0, sizeof analytic);
    scatteri_face_source(&d->source, &d->medium->desc, SCATTERI_LANES, &p);
    scatteri_add_analytic(&d->medium->desc, SCATTERI_LANES, &p, analytic);
    return analytic[0] + scatteri_depth_at_point(d, &p);
}

/* ----------------------------------------------------------------------------------------- >>source
   What points send towards the eye: direct light, through the medium, times the phase function. Points lie in rows:
   point i belongs to ray i % 16. */

typedef struct scatteri_light {
    scatter_light desc; /* direction of unit length */
    scatter_source source;
    float cos_inner, cos_outer;
    int in_rim; /* of the Gaussians: density at the light lies where rays are trimmed; -1: not known */
    scatter_depth depth; /* its source is that of when it was filled */
    unsigned medium,
        due; /* number of the medium that it holds, of the update since which it is out of date; 0: it is not */
    int chosen, filled;    /* to be filled in this update; it was, with more than analytic terms */
    int slot;              /* number of a directional light on the lattice; -1: it is not there */
    int resident;          /* light number i: of the light in slot i, */
    scatteri_buffer batch; /* and the values of slots 4i..4i+3 */
} scatteri_light;

/* Gauss-Legendre on -1..1. */
typedef struct scatteri_rule {
    int count;
    float node[SCATTERI_NODES], weight[SCATTERI_NODES];
} scatteri_rule;

enum { SCATTERI_EIGHTH = 8, SCATTERI_RULES = 20 };

struct scatter_context {
    scatter_host host;
    scatteri_medium medium;
    scatter_scene scene; /* callbacks and background; medium and lights are above and below */
    scatteri_light *lights;
    int light_count, light_room;
    int suns; /* directional lights on the lattice */
    scatteri_lattice lattice;
    scatteri_buffer lattice_memory;
    int sown;                /* the lattice holds the density of the medium */
    unsigned media, updates; /* so far */
    scatter_quality quality; /* resolved: no zeros */
    scatteri_field injected;
    scatteri_buffer injected_memory;
    int has_injected;
    const scatteri_field *fields; /* sampled along eye rays: the grids, or the injected density */
    int field_count;
    int exact;                           /* Gaussians are evaluated at the nodes */
    int twin;                            /* 1: the audit's better twin, see "plan"; else 0 */
    scatteri_rule rules[SCATTERI_RULES]; /* rule i has about (i + 1)/8 of `nodes` nodes */
    scatteri_trim trim;
    int ready;
    scatter_stats stats;
};

/* Kinds of work, counted for forecasts of cost. */
enum {
    SCATTERI_WORK_PACKET,   /* 16 rays begun and ended */
    SCATTERI_WORK_TEST,     /* 16 Gaussians looked at, whether they reach the rays */
    SCATTERI_WORK_PAGE,     /* Gaussian prepared for 16 rays */
    SCATTERI_WORK_NODE,     /* rows: 16 nodes placed and filled */
    SCATTERI_WORK_GAUSSIAN, /* Gaussian and row: density and depth */
    SCATTERI_WORK_BIN,      /* Gaussian and ray: features in bins */
    SCATTERI_WORK_VOXEL,    /* grid and row: density sampled */
    SCATTERI_WORK_GATHER,   /* light and up to 16 rows: Gaussians in between gathered */
    SCATTERI_WORK_LIGHT,    /* light and row: scattered and attenuated */
    SCATTERI_WORK_SHADOW,   /* Gaussian and row: depth to the light in closed form */
    SCATTERI_WORK_CROSSING, /* voxel on the way of 16 nodes to a light, in closed form */
    SCATTERI_WORK_READ,     /* light and row: depth read from a volume */
    SCATTERI_WORK_TOGETHER, /* four directional lights and row: depth read, scattered and attenuated */
    SCATTERI_WORK_CALL,     /* host's callbacks */
    SCATTERI_WORK_CELL,     /* 16 cells of a volume filled */
    SCATTERI_WORK_POINT,    /* 16 points of a lattice passed by a directional light */
    SCATTERI_WORK_RULE,     /* square of the nodes of a panel */
    SCATTERI_WORK_STRAIN, /* none, but a sign: nodes were fewer than features */
    SCATTERI_WORKS
};

/* Nanoseconds of each kind of work, one core; `make bench` measures them and prints its own beside these. */
static const float scatteri_nanoseconds[SCATTERI_WORKS] = {
    100.0f,  /* packet */
    71.0f,   /* test */
    82.0f,   /* page */
    91.0f,   /* node */
    6.9f,    /* gaussian */
    31.0f,   /* bin */
    100.0f,  /* voxel */
    555.0f,  /* gather */
    10.0f,   /* light */
    13.7f,   /* shadow */
    700.0f,  /* crossing */
    138.0f,  /* read */
    130.0f,  /* together */
    120.0f,  /* call */
    19.0f,   /* cell */
    110.0f,  /* point */
    1280.0f, /* rule */
    0.0f     /* strain */
};

static double scatteri_cost(const double *work)
{
    double sum = 0.0;
    int i;
    for (i = 0; i < SCATTERI_WORKS; i++)
        sum += work[i] * (double)scatteri_nanoseconds[i];
    return sum;
}

/* Looks at 16 Gaussians each that find those on some rays. */
static double scatteri_tests(const scatteri_gaussians *g)
{
    return (double)g->padded / (double)SCATTERI_LANES;
}

/* Nodes of a quadrature on 16 eye rays, and what the medium is there. */
typedef struct scatteri_nodes {
    int count;                                         /* points: rows times 16 */
    float t[SCATTERI_POINTS], weight[SCATTERI_POINTS]; /* m */
    float cell
        [SCATTERI_POINTS]; /* length of the cell around the node in which density counts as constant; 0: none */
    float density[SCATTERI_POINTS], depth[SCATTERI_POINTS]; /* depth from the eye */
    scatteri_points points;
    double work[SCATTERI_WORKS]; /* done so far on these rays */
} scatteri_nodes;

/* How a light is seen from the rays: foot of the perpendicular and distance. */
typedef struct scatteri_map {
    int local;                 /* else directional, or no light */
    int bent;                  /* t = t0 + d sinh(u), else u = t: not local, or too far to matter */
    float t0[SCATTERI_LANES];  /* ray parameter closest to the light */
    float d2[SCATTERI_LANES];  /* squared distance there */
    float d[SCATTERI_LANES];   /* sqrt(d2 + R^2), R limited, never 0 */
    float turn;                /* of the medium's lobes */
    float omc[SCATTERI_LANES]; /* 1 - turn cos of the scattering angle of a directional light */
} scatteri_map;

/* Whether the light of ray l is nearer than 64 times what the ray is long. Beyond that 1/r^2 hardly changes, and
   t0 + d sinh(u) would lose the digits of t. */
static int scatteri_is_near(const scatteri_rays *rays, const scatteri_map *map, int l)
{
    const float length = 64.0f * (rays->t1[l] - rays->t0[l]);
    const float beyond = map->t0[l] - scatteri_clamp(map->t0[l], rays->t0[l], rays->t1[l]);
    return scatteri_max(map->d[l], scatteri_abs(beyond)) < length;
}

SCATTERI_HOT static void scatteri_map_light(const scatteri_rays *rays, const scatteri_light *light,
                                            float turn, scatteri_map *map)
{
    const scatter_vec3 s = scatteri_sub(light->desc.position, rays->ref), w = light->desc.direction;
    int l;
    map->local = !light->source.directional;
    map->bent = 0;
    map->turn = turn;
    for (l = 0; l < SCATTERI_LANES; l++) {
        const scatter_vec3 u = scatteri_v3(rays->dx[l], rays->dy[l], rays->dz[l]);
        const scatter_vec3 to =
            scatteri_v3(s.x - rays->ox[l], s.y - rays->oy[l], s.z - rays->oz[l]);
        const float t0 = scatteri_dot(to, u);
        const scatter_vec3 off = scatteri_sub(to, scatteri_scale(u, t0));
        const float d2 = scatteri_dot(off, off);
        /* shadows and angles change fast near a lamp, however large it is */
        const float r = scatteri_min(light->desc.radius, 0.0625f * (rays->t1[l] - rays->t0[l]));
        map->t0[l] = t0;
        map->d2[l] = d2;
        map->d[l] =
            scatteri_max(scatteri_sqrt(d2 + r * r), 1e-6f * scatteri_max(1e-3f, scatteri_abs(t0)));
        map->omc[l] = scatteri_omc(w, scatteri_scale(u, -turn));
    }
    for (l = 0; l < SCATTERI_LANES && map->local && !map->bent; l++)
        map->bent = scatteri_is_near(rays, map, l);
}

/* t and dt/du at u on the way to a local light. */
SCATTERI_FN scatteri_vec2 scatteri_stretch(float t0, float d, float u)
{
    const float up = 0.5f * scatteri_exp(u), down = 0.25f / up;
    return scatteri_v2(t0 + d * (up - down), d * (up + down));
}

SCATTERI_FN float scatteri_to_u(const scatteri_map *map, int l, float t)
{
    return map->bent ? scatteri_asinh((t - map->t0[l]) / map->d[l]) : t;
}

SCATTERI_FN float scatteri_to_t(const scatteri_map *map, int l, float u)
{
    return map->bent ? scatteri_stretch(map->t0[l], map->d[l], u).x : u;
}

SCATTERI_HOT static void scatteri_place_points(const scatteri_rays *rays, scatteri_nodes *n)
{
    int first, l;
    n->points.ref = rays->ref;
    for (first = 0; first < n->count; first += SCATTERI_LANES)
        for (l = 0; l < SCATTERI_LANES; l++) {
            n->points.x[first + l] = rays->ox[l] + n->t[first + l] * rays->dx[l];
            n->points.y[first + l] = rays->oy[l] + n->t[first + l] * rays->dy[l];
            n->points.z[first + l] = rays->oz[l] + n->t[first + l] * rays->dz[l];
        }
}

static int scatteri_in_closed_form(const scatter_context *c, const scatteri_light *light)
{
    return c->twin || light->depth.method == SCATTER_DEPTH_CLOSED;
}

/* Gaussians alone in closed form are seen from the rays as a whole; all else asks where each point is. */
static int scatteri_needs_points(const scatter_context *c, const scatteri_light *light)
{
    return !scatteri_in_closed_form(c, light) || light->desc.kind == SCATTER_LIGHT_SPOT ||
           c->medium.desc.bounded || c->medium.has_analytic || c->medium.desc.grid_count > 0 ||
           c->scene.visible != NULL;
}

/* Depth from the points to the light: Gaussians and grids by the light's method, the rest closed. A volume that is out of
   date is read where its source was. */
static void scatteri_light_depth(const scatter_context *c, const scatteri_light *light,
                                 const scatteri_rays *span, scatteri_nodes *n, float *depth)
{
    const double rows = (double)(n->count / SCATTERI_LANES);
    const int closed = scatteri_in_closed_form(c, light);
    int i;
    memset(depth, 0, (size_t)n->count * sizeof(float));
    if (scatteri_needs_points(c, light)) {
        scatteri_place_points(span, n);
        scatteri_face_source(closed ? &light->source : &light->depth.source, &c->medium.desc,
                             n->count, &n->points);
    }
    for (i = 0; i < n->count && c->medium.desc.grid_count > 0; i++)
        n->points.length[i] = n->weight[i] > 0.0f ? n->points.length[i] : 0.0f;
    n->work[SCATTERI_WORK_LIGHT] += rows;
    if (c->medium.has_analytic)
        scatteri_add_analytic(&c->medium.desc, n->count, &n->points, depth);
    if (closed) {
        scatteri_shadows shadows;
        scatteri_begin_shadows(&shadows, &c->medium, &light->source, span, c->trim.depth);
        scatteri_add_shadows(&shadows, span, n->count, n->t, &n->points, depth);
        n->work[SCATTERI_WORK_GATHER] += 1.0;
        n->work[SCATTERI_WORK_TEST] += scatteri_tests(&c->medium.gaussians);
        n->work[SCATTERI_WORK_SHADOW] += rows * shadows.total;
        n->work[SCATTERI_WORK_CROSSING] += (double)shadows.cells / (double)SCATTERI_LANES;
    } else {
        n->work[SCATTERI_WORK_READ] += rows;
        scatteri_read_depth(&light->depth, n->count, &n->points, depth);
        if (light->due != 0 &&
            light->desc.kind == SCATTER_LIGHT_SPOT) /* its cone is where it is now */
            scatteri_face_source(&light->source, &c->medium.desc, n->count, &n->points);
    }
}

/* Weight times density times irradiance per intensity times phase function. */
SCATTERI_HOT static void scatteri_scatter(const scatteri_light *light, const scatteri_map *map,
                                          scatteri_lobes lobes, const scatteri_nodes *n,
                                          float *SCATTERI_RESTRICT out)
{
    const scatter_vec3 w = light->desc.direction;
    const float r2 = light->desc.radius * light->desc.radius;
    const int spot = light->desc.kind == SCATTER_LIGHT_SPOT;
    int first, l;
    for (first = 0; first < n->count; first += SCATTERI_LANES) {
        float omc[SCATTERI_LANES], fall[SCATTERI_LANES];
        for (l = 0; l < SCATTERI_LANES; l++) {
            omc[l] = map->omc[l];
            fall[l] = n->weight[first + l] * n->density[first + l];
        }
        if (map->local)
            for (l = 0; l < SCATTERI_LANES; l++) {
                const float s = n->t[first + l] - map->t0[l];
                const float q2 = scatteri_max(map->d2[l] + s * s, 1e-30f),
                            inverse = scatteri_rsqrt(q2), q = q2 * inverse;
                const float back = map->d2[l] * inverse / (q + scatteri_abs(s));
                omc[l] =
                    scatteri_choose(map->turn * s, 0.0f, back, 1.0f + scatteri_abs(s) * inverse);
                fall[l] /= q2 + r2;
            }
        if (spot)
            for (l = 0; l < SCATTERI_LANES; l++) {
                const int i = first + l;
                const float cosine =
                    -(n->points.dx[i] * w.x + n->points.dy[i] * w.y + n->points.dz[i] * w.z);
                fall[l] *= scatteri_spot(light->cos_inner, light->cos_outer, cosine);
            }
        if (lobes.weight > 0.0f)
            for (l = 0; l < SCATTERI_LANES; l++)
                fall[l] *= scatteri_phase(lobes, omc[l]);
        else if (lobes.g1 > 0.0f ||
                 lobes.alpha1 > 0.0f) /* turned forward, see scatteri_turn_lobes */
            for (l = 0; l < SCATTERI_LANES; l++)
                fall[l] *= scatteri_draine(lobes.g1, lobes.alpha1, omc[l]);
        else
            for (l = 0; l < SCATTERI_LANES; l++)
                fall[l] *= 0.0795774715f;
        for (l = 0; l < SCATTERI_LANES; l++)
            out[first + l] = fall[l];
    }
}

/* Adds to each ray the sum over its nodes of value times transmittance, for one channel. In a cell of constant density D
   and length w the mean transmittance is that at its entry times (1 - exp(-x))/x, x = sigma D w: no opaque cell is
   too dark or too bright. */
SCATTERI_HOT static void scatteri_add_attenuated(const scatteri_nodes *n, float sigma, int cells,
                                                 const float *SCATTERI_RESTRICT value,
                                                 const float *SCATTERI_RESTRICT light_depth,
                                                 float *SCATTERI_RESTRICT sum)
{
    int first, l;
    for (first = 0; first < n->count; first += SCATTERI_LANES) {
        float factor[SCATTERI_LANES], depth[SCATTERI_LANES];
        for (l = 0; l < SCATTERI_LANES; l++) {
            factor[l] = value[first + l];
            depth[l] = n->depth[first + l];
        }
        if (cells)
            for (l = 0; l < SCATTERI_LANES; l++) {
                const float x = n->density[first + l] * n->cell[first + l];
                depth[l] = scatteri_max(depth[l] - 0.5f * x, 0.0f);
                factor[l] *= scatteri_exprel(-sigma * x);
            }
        for (l = 0; l < SCATTERI_LANES; l++)
            sum[l] += factor[l] * scatteri_decay(sigma * (depth[l] + light_depth[first + l]));
    }
}

/* Radiance of 16 rays, channel by channel. */
typedef struct scatteri_radiance {
    float r[SCATTERI_LANES], g[SCATTERI_LANES], b[SCATTERI_LANES];
} scatteri_radiance;

/* Adds gain times the attenuated sum; one channel serves all three where extinction has no colour. */
static void scatteri_add_rgb(const scatter_context *c, const scatteri_nodes *n, const float *value,
                             const float *light_depth, scatter_vec3 gain,
                             scatteri_radiance *radiance)
{
    const scatter_vec3 s = c->medium.desc.extinction;
    const int cells = c->field_count > 0;
    float r[SCATTERI_LANES], g[SCATTERI_LANES], b[SCATTERI_LANES];
    int l;
    memset(r, 0, sizeof r);
    memset(g, 0, sizeof g);
    memset(b, 0, sizeof b);
    scatteri_add_attenuated(n, s.x, cells, value, light_depth, r);
    if (!c->medium.gray) {
        scatteri_add_attenuated(n, s.y, cells, value, light_depth, g);
        scatteri_add_attenuated(n, s.z, cells, value, light_depth, b);
    }
    for (l = 0; l < SCATTERI_LANES; l++) {
        radiance->r[l] += gain.x * r[l];
        radiance->g[l] += gain.y * (c->medium.gray ? r[l] : g[l]);
        radiance->b[l] += gain.z * (c->medium.gray ? r[l] : b[l]);
    }
}

/* --- directional lights together --- */

/* Whether the directional lights are read from the lattice at the same nodes. */
static int scatteri_together(const scatter_context *c)
{
    return c->suns > 1 && c->medium.has_local && !c->twin && c->scene.visible == NULL &&
           !c->medium.has_analytic;
}

/* What the lights of a batch send along 16 rays, where nothing is in between. */
typedef struct scatteri_beams {
    float intensity[SCATTERI_TOGETHER][3];
    float phase[SCATTERI_TOGETHER][SCATTERI_LANES]; /* 1/sr */
} scatteri_beams;

static void scatteri_aim_beams(const scatter_context *c, const scatteri_rays *rays, int batch,
                               scatteri_beams *beams)
{
    int i, l;
    memset(beams, 0, sizeof *beams);
    for (i = 0; i < SCATTERI_TOGETHER && batch * SCATTERI_TOGETHER + i < c->suns; i++) {
        const scatter_light *light =
            &c->lights[c->lights[batch * SCATTERI_TOGETHER + i].resident].desc;
        beams->intensity[i][0] = light->intensity.x;
        beams->intensity[i][1] = light->intensity.y;
        beams->intensity[i][2] = light->intensity.z;
        for (l = 0; l < SCATTERI_LANES; l++)
            beams->phase[i][l] = scatteri_phase(
                c->medium.lobes,
                scatteri_omc(light->direction,
                             scatteri_scale(scatteri_ray_direction(rays, l), -c->medium.turn)));
    }
}

/* What arrives at the nodes of one light. */
SCATTERI_HOT static void scatteri_arrive(int count, float sigma,
                                         const float *SCATTERI_RESTRICT phase,
                                         const float *SCATTERI_RESTRICT depth,
                                         float *SCATTERI_RESTRICT arrives)
{
    int row, l;
    for (row = 0; row < count; row += SCATTERI_LANES)
        for (l = 0; l < SCATTERI_LANES; l++)
            arrives[row + l] = phase[l] * scatteri_decay(sigma * depth[row + l]);
}

SCATTERI_HOT static void scatteri_add_scaled(int count, float scale,
                                             const float *SCATTERI_RESTRICT value,
                                             float *SCATTERI_RESTRICT sum)
{
    int i;
    for (i = 0; i < count; i++)
        sum[i] += scale * value[i];
}

/* Adds one light to the channels; one exponential serves all of them where extinction has no colour. */
static void scatteri_shine(const scatteri_medium *m, const scatteri_beams *beams, int i, int count,
                           const float *depth, float (*light)[SCATTERI_POINTS])
{
    float arrives[SCATTERI_POINTS];
    int channel;
    for (channel = 0; channel < 3; channel++) {
        if (channel == 0 || !m->gray)
            scatteri_arrive(count, scatteri_get(m->desc.extinction, channel), beams->phase[i],
                            depth, arrives);
        scatteri_add_scaled(count, beams->intensity[i][channel], arrives, light[channel]);
    }
}

/* Light of all directional sources at the nodes, per steradian. */
static void scatteri_gather_beams(const scatter_context *c, const scatteri_rays *rays,
                                  scatteri_nodes *n, float (*light)[SCATTERI_POINTS])
{
    float depth[SCATTERI_TOGETHER][SCATTERI_POINTS];
    scatteri_spots spots;
    scatteri_beams beams;
    int b, i;
    scatteri_place_points(rays, n);
    scatteri_find_all_spots(&c->lattice, n->count, &n->points, &spots);
    for (b = 0; b * SCATTERI_TOGETHER < c->suns; b++) {
        scatteri_read_together(&c->lattice, (const float *)c->lights[b].batch.data, n->count,
                               &spots, depth);
        scatteri_aim_beams(c, rays, b, &beams);
        for (i = 0; i < SCATTERI_TOGETHER && b * SCATTERI_TOGETHER + i < c->suns; i++)
            scatteri_shine(&c->medium, &beams, i, n->count, depth[i], light);
        n->work[SCATTERI_WORK_TOGETHER] += (double)(n->count / SCATTERI_LANES);
    }
}

/* Adds what the medium scatters of it. */
static void scatteri_add_beams(const scatter_context *c, const scatteri_rays *rays,
                               scatteri_nodes *n, scatteri_radiance *radiance)
{
    const scatter_vec3 s = c->medium.desc.extinction, gain = scatteri_mul(s, c->medium.desc.albedo);
    float light[3][SCATTERI_POINTS], none[SCATTERI_POINTS];
    float sum[3][SCATTERI_LANES];
    int channel, i, l;
    for (i = 0; i < n->count; i++)
        none[i] = light[0][i] = light[1][i] = light[2][i] = 0.0f;
    scatteri_gather_beams(c, rays, n, light);
    memset(sum, 0, sizeof sum);
    for (channel = 0; channel < 3; channel++) {
        for (i = 0; i < n->count; i++)
            light[channel][i] *= n->weight[i] * n->density[i];
        scatteri_add_attenuated(n, scatteri_get(s, channel), c->field_count > 0, light[channel],
                                none, sum[channel]);
    }
    for (l = 0; l < SCATTERI_LANES; l++) {
        radiance->r[l] += gain.x * sum[0][l];
        radiance->g[l] += gain.y * sum[1][l];
        radiance->b[l] += gain.z * sum[2][l];
    }
}

static int scatteri_lit(const scatter_context *c, const scatteri_light *light, scatter_vec3 x)
{
    const scatter_vec3 to = light->source.directional
                                ? scatteri_along(x, light->desc.direction, -SCATTERI_HORIZON)
                                : light->desc.position;
    return c->scene.visible == NULL || c->scene.visible(c->scene.user, x, to) != 0;
}

static scatter_vec3 scatteri_transmittance(const scatteri_medium *m, float depth)
{
    const scatter_vec3 s = m->desc.extinction;
    scatter_vec3 t;
    t.x = scatteri_exp(-s.x * depth);
    t.y = m->gray ? t.x : scatteri_exp(-s.y * depth);
    t.z = m->gray ? t.x : scatteri_exp(-s.z * depth);
    return t;
}

/* --------------------------------------------------------------------------------------------- >>ray
   The integral along the eye rays. A ray is cut where the medium is not smooth (bounds, voxels, cones of spots, edges of
   shadows), the pieces are cut into panels as the medium needs, a panel takes `nodes` nodes. Each ray makes its own
   list of panels; then panel p of all 16 rays is evaluated at once. */

/* Widths 1/a of the narrowest Gaussian, or of a light's peak, in one panel. */
#define SCATTERI_PANEL 10.0f
#define SCATTERI_TWIN_PANEL 5.0f /* for the twin of the audit */
/* Features of a light's own peak in a unit of u: measured beside lamps in dense media. */
#define SCATTERI_PEAK 2.0f
/* Range of u from which on a ray is never one panel: its ends, where t grows by e in each unit, need panels of their own. */
#define SCATTERI_STRETCH 8.0f
/* Distances of a light from a ray up to which its glow is followed on both sides: 5/6 of the light in even fog. */
#define SCATTERI_GLOW 4.0f

enum {
    SCATTERI_BINS = 32,
    SCATTERI_PROBES = 64,
    SCATTERI_TWIN_PROBES = 256,
    SCATTERI_BISECTIONS = 16,
    SCATTERI_PANELS = 64
};

/* Lists of panels of 16 rays. */
typedef struct scatteri_panels {
    int count[SCATTERI_LANES];
    float ua[SCATTERI_PANELS][SCATTERI_LANES], ub[SCATTERI_PANELS][SCATTERI_LANES];
    float cells[SCATTERI_PANELS]
               [SCATTERI_LANES]; /* 1: nodes are the middles of equal cells, 0: Gauss-Legendre */
} scatteri_panels;

/* What is integrated over the same nodes: emission, one local light, or directional lights. */
typedef struct scatteri_pass {
    int emission;
    int first, end;            /* lights; local ones only alone */
    const scatteri_light *cut; /* the one light whose cone and shadows cut the ray, or NULL */
    scatteri_map map;
    float from[SCATTERI_LANES], to[SCATTERI_LANES]; /* Gaussians count in between */
} scatteri_pass;

typedef struct scatteri_eye {
    const scatter_context *context;
    scatteri_rays rays; /* depth counts from rays.t0 */
    scatteri_page page;
    int gathered;                                       /* Gaussians on the rays, in all pages */
    float hull0[SCATTERI_LANES], hull1[SCATTERI_LANES]; /* Gaussians, trimmed, reach the ray */
    float features[SCATTERI_LANES];                     /* most features a metre, see "panels" */
    int samples; /* cells of the profile: voxel depth along the rays */
    float profile0[SCATTERI_LANES], profile1[SCATTERI_LANES], step[SCATTERI_LANES],
        voxel[SCATTERI_LANES];
    float profile[SCATTERI_PROFILE + 2][SCATTERI_LANES];
    int first[SCATTERI_LANES], last[SCATTERI_LANES]; /* steps of the march that are lit; -1: none */
    scatteri_pass pass;
    scatteri_shadows
        cast; /* by the light of the pass, if it cuts the rays and its depth is closed */
    scatteri_panels panels;
    scatteri_nodes nodes;
    scatteri_radiance radiance;
} scatteri_eye;

/* How far fog is followed: to where it is opaque, or has thinned out, or ends, or (where it has no bounds) to the
   horizon. */
static float scatteri_horizon(const scatteri_medium *m, scatter_vec3 o, scatter_vec3 u, float end)
{
    float reach = m->desc.bounded ? end : scatteri_min(end, SCATTERI_HORIZON);
    float low = 1e-9f * reach, scale = 0.0f;
    size_t i;
    int step;
    for (i = 0; i < m->desc.height_count; i++)
        scale = scatteri_max(scale, m->desc.heights[i].scale);
    if (u.y > 0.0f && !(m->desc.constant > 0.0f))
        reach = scatteri_min(reach, 16.0f * scale / u.y);
    if (!(m->sigma_least * scatteri_analytic_depth(&m->desc, o.y, u.y, reach) > SCATTERI_OPAQUE))
        return reach;
    for (step = 0; step < 14; step++) {
        const float middle = scatteri_sqrt(low) * scatteri_sqrt(reach);
        if (m->sigma_least * scatteri_analytic_depth(&m->desc, o.y, u.y, middle) > SCATTERI_OPAQUE)
            reach = middle;
        else
            low = middle;
    }
    return reach;
}

/* Features a metre of a Gaussian on a ray: one in each width 1/a, more at the edge of an opaque one. */
SCATTERI_FN float scatteri_rate(float a, float sigma, float behind)
{
    return a * (1.0f + 0.2f * scatteri_log(1.0f + sigma * behind));
}

/* Widens the hull to where the page's Gaussians reach each ray, and raises the most features a metre. */
SCATTERI_HOT static void scatteri_widen_hull(scatteri_eye *eye, float sigma)
{
    const scatteri_page *page = &eye->page;
    int g, l;
    for (g = 0; g < page->count; g++) {
        const float a = page->a[g], inverse = 1.0f / a, reach = page->reach[g];
        for (l = 0; l < SCATTERI_LANES; l++) {
            const float half =
                scatteri_sqrt(scatteri_max(reach - page->fade[g][l], 0.0f)) * inverse;
            const float m = page->m[g][l], rate = scatteri_rate(a, sigma, page->behind[g][l]);
            const float low = scatteri_choose(0.0f, half, m - half, SCATTERI_FAR);
            const float high = scatteri_choose(0.0f, half, m + half, -SCATTERI_FAR);
            eye->hull0[l] = scatteri_min(eye->hull0[l], low);
            eye->hull1[l] = scatteri_max(eye->hull1[l], high);
            eye->features[l] =
                scatteri_max(eye->features[l], scatteri_choose(0.0f, half, rate, 0.0f));
        }
    }
}

/* Gathers the Gaussians on the rays, page after page; the last page stays. */
static void scatteri_gather_eye(scatteri_eye *eye)
{
    const scatteri_medium *m = &eye->context->medium;
    const scatteri_slabs slabs = scatteri_slabs_of_rays(&eye->rays);
    eye->page.trim = eye->context->trim;
    eye->page.next = 0;
    do {
        scatteri_gather(&m->gaussians, &eye->rays, &slabs, eye->page.next, &eye->page);
        eye->gathered += eye->page.count;
        scatteri_widen_hull(eye, m->sigma_most);
    } while (eye->page.next < m->gaussians.padded);
}

/* --- profile of voxel density: its running integral along the rays, once for all lights --- */

/* The stretch of ray l inside the fields' boxes, and the length of a voxel along it. */
static void scatteri_profile_range(scatteri_eye *eye, int l)
{
    const scatter_context *c = eye->context;
    const scatter_vec3 d = scatteri_ray_direction(&eye->rays, l);
    int f;
    eye->profile0[l] = SCATTERI_FAR;
    eye->profile1[l] = -SCATTERI_FAR;
    eye->voxel[l] = SCATTERI_FAR;
    for (f = 0; f < c->field_count; f++) {
        const scatteri_field *field = &c->fields[f];
        const scatter_vec3 rate = scatteri_mul(d, field->per_metre);
        const float most = scatteri_max(scatteri_abs(rate.x),
                                        scatteri_max(scatteri_abs(rate.y), scatteri_abs(rate.z)));
        float t0 = eye->rays.t0[l], t1 = eye->rays.t1[l];
        if (!scatteri_clip(scatteri_box_from(field->grid.box, eye->rays.ref),
                           scatteri_ray_origin(&eye->rays, l), d, &t0, &t1))
            continue;
        eye->profile0[l] = scatteri_min(eye->profile0[l], t0);
        eye->profile1[l] = scatteri_max(eye->profile1[l], t1);
        eye->voxel[l] = scatteri_min(eye->voxel[l], 1.0f / most);
    }
    if (!(eye->profile0[l] < eye->profile1[l]))
        eye->profile0[l] = eye->profile1[l] = eye->rays.t0[l];
}

/* Adds the cells i of the profile; returns whether a ray still sees through. */
static int scatteri_extend_profile(scatteri_eye *eye, int i)
{
    const scatter_context *c = eye->context;
    float t[SCATTERI_LANES], density[SCATTERI_LANES], least = SCATTERI_FAR;
    int l, f;
    for (l = 0; l < SCATTERI_LANES; l++) {
        t[l] = eye->profile0[l] + ((float)i + 0.5f) * eye->step[l];
        density[l] = 0.0f;
    }
    for (f = 0; f < c->field_count; f++)
        scatteri_sample_field(&c->fields[f], &eye->rays, t, density);
    for (l = 0; l < SCATTERI_LANES; l++) {
        eye->profile[i + 1][l] = eye->profile[i][l] + density[l] * eye->step[l];
        least = scatteri_min(least, eye->step[l] > 0.0f ? eye->profile[i + 1][l] : SCATTERI_FAR);
    }
    return c->medium.sigma_least * least < SCATTERI_OPAQUE;
}

/* Passes cells of the profile that are certainly empty; returns the first one that may not be. */
static int scatteri_pass_cells(scatteri_eye *eye, int i, int samples)
{
    const scatter_context *c = eye->context;
    float t[SCATTERI_LANES];
    int l, end;
    for (l = 0; l < SCATTERI_LANES; l++)
        t[l] = eye->profile0[l] + ((float)i + 0.5f) * eye->step[l];
    end = i + scatteri_empty_steps(c->fields, c->field_count, &eye->rays, t, eye->step);
    for (; i < end && i < samples; i++)
        memcpy(eye->profile[i + 1], eye->profile[i], sizeof eye->profile[i]);
    return i;
}

static void scatteri_take_profile(scatteri_eye *eye)
{
    const scatter_context *c = eye->context;
    float voxels = 0.0f;
    int i, l, samples;
    if (c->field_count == 0)
        return;
    for (l = 0; l < SCATTERI_LANES; l++) {
        scatteri_profile_range(eye, l);
        voxels = scatteri_max(voxels, (eye->profile1[l] - eye->profile0[l]) / eye->voxel[l]);
        eye->profile[0][l] = 0.0f;
    }
    if (!(voxels > 0.0f))
        return;
    samples = (int)scatteri_clamp(voxels * (float)c->quality.nodes / SCATTERI_VOXELS, 0.0f,
                                  (float)SCATTERI_PROFILE - 1.0f) +
              1;
    for (l = 0; l < SCATTERI_LANES; l++)
        eye->step[l] = (eye->profile1[l] - eye->profile0[l]) / (float)samples;
    for (i = scatteri_pass_cells(eye, 0, samples); i < samples;
         i = scatteri_pass_cells(eye, i + 1, samples))
        if (!scatteri_extend_profile(eye, i))
            break;
    eye->samples = i < samples ? i + 1 : samples;
    eye->nodes.work[SCATTERI_WORK_VOXEL] += (double)eye->samples * c->field_count;
    for (l = 0; l < SCATTERI_LANES; l++) {
        eye->profile1[l] = eye->profile0[l] + (float)eye->samples * eye->step[l];
        eye->profile[eye->samples + 1][l] = eye->profile[eye->samples][l];
    }
}

/* Adds the profile's density and depth at points: density linear between the middles of its cells, depth between
   their ends. */
SCATTERI_HOT static void scatteri_add_profile(const scatteri_eye *eye, int count,
                                              const float *SCATTERI_RESTRICT t,
                                              float *SCATTERI_RESTRICT density,
                                              float *SCATTERI_RESTRICT depth)
{
    const float top = (float)eye->samples;
    const float *profile = &eye->profile[0][0];
    int first, l;
    for (first = 0; first < count; first += SCATTERI_LANES)
        for (l = 0; l < SCATTERI_LANES; l++) {
            const float step = scatteri_max(eye->step[l], 1e-30f),
                        at = (t[first + l] - eye->profile0[l]) / step;
            const float g = scatteri_clamp(at, 0.0f, top),
                        h = scatteri_clamp(g - 0.5f, 0.0f, top - 1.0f);
            const int i = (int)scatteri_min(g, top - 1.0f),
                      j = (int)scatteri_min(h, scatteri_max(top - 2.0f, 0.0f));
            const float *p = profile + l, low = p[i * SCATTERI_LANES],
                        high = p[(i + 1) * SCATTERI_LANES];
            const float c0 = p[(j + 1) * SCATTERI_LANES] - p[j * SCATTERI_LANES];
            const float c1 = p[(j + 2) * SCATTERI_LANES] - p[(j + 1) * SCATTERI_LANES];
            const float inside = (float)((at >= 0.0f) & (at <= top));
            density[first + l] += inside * scatteri_lerp(c0, c1, h - (float)j) / step;
            depth[first + l] += scatteri_lerp(low, high, g - (float)i);
        }
}

/* --- evaluation --- */

/* Positions of the nodes, their density and depth. */
static void scatteri_fill_nodes(scatteri_eye *eye)
{
    const scatter_context *c = eye->context;
    const scatteri_rays *rays = &eye->rays;
    scatteri_nodes *n = &eye->nodes;
    const double rows = (double)(n->count / SCATTERI_LANES);
    n->work[SCATTERI_WORK_NODE] += rows;
    n->work[SCATTERI_WORK_GAUSSIAN] += rows * eye->gathered;
    if (!eye->page.complete) { /* gathered again */
        n->work[SCATTERI_WORK_TEST] += scatteri_tests(&c->medium.gaussians);
        n->work[SCATTERI_WORK_PAGE] += (double)eye->gathered;
    }
    memset(n->density, 0, (size_t)n->count * sizeof(float));
    memset(n->depth, 0, (size_t)n->count * sizeof(float));
    if (c->exact && c->medium.gaussians.count > 0)
        scatteri_add_gaussians(&c->medium.gaussians, rays, &eye->page, n->count, n->t, n->density,
                               n->depth);
    if (eye->samples > 0)
        scatteri_add_profile(eye, n->count, n->t, n->density, n->depth);
    if (c->medium.has_analytic)
        scatteri_add_fog(&c->medium.desc, rays, n->count, n->t, n->density, n->depth);
}

/* A row of nodes: Gauss-Legendre `node` and `weight`, or, where cells is 1, the cell around `middle` with its `share`. */
SCATTERI_FN void scatteri_place_row(const float *SCATTERI_RESTRICT ua,
                                    const float *SCATTERI_RESTRICT ub,
                                    const float *SCATTERI_RESTRICT cells, scatteri_vec2 node,
                                    scatteri_vec2 cell, float *SCATTERI_RESTRICT t,
                                    float *SCATTERI_RESTRICT w)
{
    int l;
    for (l = 0; l < SCATTERI_LANES; l++) {
        const float half = 0.5f * (ub[l] - ua[l]);
        t[l] = ua[l] + half * (1.0f + node.x + cells[l] * (cell.x - node.x));
        w[l] = half * (node.y + cells[l] * (cell.y - node.y));
    }
}

/* The row on a local light's map. */
SCATTERI_FN void scatteri_stretch_row(const scatteri_map *map, float *SCATTERI_RESTRICT t,
                                      float *SCATTERI_RESTRICT w)
{
    int l;
    for (l = 0; l < SCATTERI_LANES; l++) {
        const scatteri_vec2 at = scatteri_stretch(map->t0[l], map->d[l], t[l]);
        t[l] = at.x;
        w[l] *= at.y;
    }
}

SCATTERI_FN void scatteri_multiply_row(const float *SCATTERI_RESTRICT a,
                                       const float *SCATTERI_RESTRICT b,
                                       float *SCATTERI_RESTRICT product)
{
    int l;
    for (l = 0; l < SCATTERI_LANES; l++)
        product[l] = a[l] * b[l];
}

/* Rows first..first+rows of the nodes of panel p. */
SCATTERI_HOT static void scatteri_place_nodes(const scatteri_rule *rule, const scatteri_map *map,
                                              const scatteri_panels *panels, int p, int first,
                                              int rows, scatteri_nodes *n)
{
    const float *ua = panels->ua[p], *ub = panels->ub[p], *cells = panels->cells[p];
    const float share = 2.0f / (float)rule->count;
    int k;
    n->count = rows * SCATTERI_LANES;
    for (k = 0; k < rows; k++) {
        const scatteri_vec2 node = scatteri_v2(rule->node[first + k], rule->weight[first + k]);
        const scatteri_vec2 cell = scatteri_v2(share * ((float)(first + k) + 0.5f) - 1.0f, share);
        float *t = n->t + k * SCATTERI_LANES, *w = n->weight + k * SCATTERI_LANES;
        scatteri_place_row(ua, ub, cells, node, cell, t, w);
        if (map->bent)
            scatteri_stretch_row(map, t, w);
        scatteri_multiply_row(cells, w, n->cell + k * SCATTERI_LANES);
    }
}

static int scatteri_in_pass(const scatter_context *c, const scatteri_pass *pass, int light)
{
    const scatter_vec3 i = c->lights[light].desc.intensity;
    return c->lights[light].source.directional != pass->map.local &&
           (i.x > 0.0f || i.y > 0.0f || i.z > 0.0f);
}

static void scatteri_add_emission(scatteri_eye *eye)
{
    const scatteri_nodes *n = &eye->nodes;
    float value[SCATTERI_POINTS], none[SCATTERI_POINTS];
    int i;
    for (i = 0; i < n->count; i++) {
        value[i] = n->weight[i] * n->density[i];
        none[i] = 0.0f;
    }
    scatteri_add_rgb(eye->context, n, value, none, eye->context->medium.desc.emission,
                     &eye->radiance);
}

/* `probe`: ask for geometry between each node and the light. */
static void scatteri_add_light(scatteri_eye *eye, const scatteri_light *light,
                               const scatteri_map *map, const scatteri_rays *span, int probe)
{
    const scatter_context *c = eye->context;
    scatteri_nodes *n = &eye->nodes;
    float value[SCATTERI_POINTS], depth[SCATTERI_POINTS];
    int i;
    scatteri_light_depth(c, light, span, n, depth);
    scatteri_scatter(light, map, c->medium.lobes, n, value);
    n->work[SCATTERI_WORK_CALL] += probe ? (double)n->count : 0.0;
    for (i = 0; probe && i < n->count; i++) {
        const scatter_vec3 x = scatteri_v3(n->points.x[i], n->points.y[i], n->points.z[i]);
        if (value[i] > 0.0f && !scatteri_lit(c, light, scatteri_add(n->points.ref, x)))
            value[i] = 0.0f;
    }
    scatteri_add_rgb(c, n, value, depth,
                     scatteri_mul(scatteri_mul(light->desc.intensity, c->medium.desc.albedo),
                                  c->medium.desc.extinction),
                     &eye->radiance);
}

/* 0 where nothing more can be seen: no density, or opaque in front of all rays. */
SCATTERI_HOT static int scatteri_matters(const scatteri_nodes *n, float sigma)
{
    float most[SCATTERI_LANES], least[SCATTERI_LANES];
    int first, l, some = 0;
    for (l = 0; l < SCATTERI_LANES; l++) {
        most[l] = 0.0f;
        least[l] = scatteri_choose(0.0f, n->weight[l], n->depth[l], SCATTERI_FAR);
    }
    for (first = 0; first < n->count; first += SCATTERI_LANES)
        for (l = 0; l < SCATTERI_LANES; l++)
            most[l] += n->density[first + l] * n->weight[first + l];
    for (l = 0; l < SCATTERI_LANES; l++)
        some |= (most[l] > 0.0f) & (sigma * least[l] < SCATTERI_OPAQUE);
    return some;
}

/* Leaves out nodes without density: where a ray has none the weight becomes 0, rows without any go. */
SCATTERI_HOT static void scatteri_drop_empty(scatteri_nodes *n)
{
    int from, to = 0, l;
    for (from = 0; from < n->count; from += SCATTERI_LANES) {
        float most = 0.0f;
        for (l = 0; l < SCATTERI_LANES; l++) {
            const float density = n->density[from + l];
            n->t[to + l] = n->t[from + l];
            n->weight[to + l] = scatteri_choose(0.0f, density, n->weight[from + l], 0.0f);
            n->cell[to + l] = n->cell[from + l];
            n->depth[to + l] = n->depth[from + l];
            n->density[to + l] = density;
            most = scatteri_max(most, density);
        }
        to += most > 0.0f ? (int)SCATTERI_LANES : 0;
    }
    n->count = to;
}

/* The rays between the first and the last of the nodes. */
static scatteri_rays scatteri_span_of(const scatteri_eye *eye)
{
    const scatteri_nodes *n = &eye->nodes;
    scatteri_rays span = eye->rays;
    memcpy(span.t0, n->t, sizeof span.t0);
    memcpy(span.t1, n->t + n->count - SCATTERI_LANES, sizeof span.t1);
    return span;
}

static void scatteri_evaluate_panel(scatteri_eye *eye, int p, const scatteri_rule *rule)
{
    const scatter_context *c = eye->context;
    const scatteri_pass *pass = &eye->pass;
    const int together = pass->cut == NULL && scatteri_together(c);
    int first, i;
    for (first = 0; first < rule->count; first += SCATTERI_ROWS) {
        const int left = rule->count - first;
        scatteri_rays span;
        scatteri_place_nodes(rule, &pass->map, &eye->panels, p, first,
                             left < SCATTERI_ROWS ? left : (int)SCATTERI_ROWS, &eye->nodes);
        scatteri_fill_nodes(eye);
        if (!scatteri_matters(&eye->nodes, c->medium.sigma_least))
            continue;
        if (!c->quality.no_mask && eye->samples > 0) /* only voxels leave nodes empty */
            scatteri_drop_empty(&eye->nodes);
        span = scatteri_span_of(eye);
        if (pass->emission)
            scatteri_add_emission(eye);
        if (together)
            scatteri_add_beams(c, &eye->rays, &eye->nodes, &eye->radiance);
        for (i = pass->first; i < pass->end && !together; i++) {
            scatteri_map map = pass->map;
            if (!scatteri_in_pass(c, pass, i))
                continue;
            if (!map.local)
                scatteri_map_light(&eye->rays, &c->lights[i], c->medium.turn, &map);
            scatteri_add_light(eye, &c->lights[i], &map, &span, 0);
        }
    }
}

/* Evaluates and empties all lists. */
static void scatteri_flush(scatteri_eye *eye)
{
    scatteri_panels *panels = &eye->panels;
    int most = 0, p, l;
    for (l = 0; l < SCATTERI_LANES; l++)
        most = panels->count[l] > most ? panels->count[l] : most;
    for (l = 0; l < SCATTERI_LANES; l++)
        for (p = panels->count[l]; p < most; p++) {
            panels->ua[p][l] = panels->ub[p][l] = scatteri_to_u(&eye->pass.map, l, eye->rays.t0[l]);
            panels->cells[p][l] = 0.0f;
        }
    for (p = 0; p < most; p++)
        scatteri_evaluate_panel(eye, p, &eye->context->rules[SCATTERI_EIGHTH - 1]);
    memset(panels->count, 0, sizeof panels->count);
}

static void scatteri_add_panel(scatteri_eye *eye, int l, float ua, float ub, int cells)
{
    scatteri_panels *panels = &eye->panels;
    if (panels->count[l] == SCATTERI_PANELS)
        scatteri_flush(eye);
    panels->ua[panels->count[l]][l] = ua;
    panels->ub[panels->count[l]][l] = ub;
    panels->cells[panels->count[l]][l] = (float)cells;
    panels->count[l]++;
}

/* --- panels ---
   A piece of a ray is divided into bins. A bin's rate says how many features (widths of the narrowest Gaussian, of the
   light's peak, e-foldings of fog, voxels) fit into a unit of u; panels hold SCATTERI_PANEL of them. */

typedef struct scatteri_bins {
    float u0, width;
    float low[SCATTERI_BINS], high[SCATTERI_BINS]; /* t of the ends */
    float stretch[SCATTERI_BINS];                  /* dt/du in the middle */
    float rate[SCATTERI_BINS];
} scatteri_bins;

SCATTERI_HOT static void scatteri_rate_gaussians(const scatteri_page *page, int l, float sigma,
                                                 scatteri_bins *bins)
{
    int g, b;
    for (g = 0; g < page->count; g++) {
        const float half =
            scatteri_sqrt(scatteri_max(page->reach[g] - page->fade[g][l], 0.0f)) / page->a[g];
        const float low = page->m[g][l] - half, high = page->m[g][l] + half;
        const float rate = scatteri_rate(page->a[g], sigma, page->behind[g][l]);
        for (b = 0; b < SCATTERI_BINS; b++) {
            const float here =
                rate * bins->stretch[b] * (float)((low < bins->high[b]) & (high > bins->low[b]));
            bins->rate[b] = scatteri_max(bins->rate[b], here);
        }
    }
}

/* Middles of the bins on ray l, relative to the rays' ref, and where the source is seen from them. */
typedef struct scatteri_marks {
    float x[SCATTERI_BINS], y[SCATTERI_BINS], z[SCATTERI_BINS];
    float dx[SCATTERI_BINS], dy[SCATTERI_BINS], dz[SCATTERI_BINS]; /* unit */
    float inverse[SCATTERI_BINS]; /* 1/distance of the source, 0 if directional */
    float sine[SCATTERI_BINS];    /* of the angle between ray and source */
} scatteri_marks;

SCATTERI_HOT static void scatteri_mark_bins(const scatteri_rays *rays, int l,
                                            const scatter_source *source,
                                            const scatteri_bins *SCATTERI_RESTRICT bins,
                                            scatteri_marks *SCATTERI_RESTRICT marks)
{
    const scatter_vec3 s = scatteri_sub(source->position, rays->ref), w = source->direction;
    const scatter_vec3 o = scatteri_ray_origin(rays, l), d = scatteri_ray_direction(rays, l);
    const float parallel = (float)source->directional;
    int b;
    for (b = 0; b < SCATTERI_BINS; b++) {
        const float t = 0.5f * (bins->low[b] + bins->high[b]);
        const float x = o.x + t * d.x, y = o.y + t * d.y, z = o.z + t * d.z;
        const float sx = s.x - x, sy = s.y - y, sz = s.z - z;
        const float r2 = scatteri_max(sx * sx + sy * sy + sz * sz, 1e-30f),
                    inverse = scatteri_rsqrt(r2);
        const float dx = scatteri_choose(0.5f, parallel, -w.x, sx * inverse);
        const float dy = scatteri_choose(0.5f, parallel, -w.y, sy * inverse);
        const float dz = scatteri_choose(0.5f, parallel, -w.z, sz * inverse);
        const float cosine = d.x * dx + d.y * dy + d.z * dz;
        marks->x[b] = x, marks->y[b] = y, marks->z[b] = z;
        marks->dx[b] = dx, marks->dy[b] = dy, marks->dz[b] = dz;
        marks->inverse[b] = scatteri_choose(0.5f, parallel, 0.0f, inverse);
        marks->sine[b] = scatteri_sqrt(scatteri_max(1.0f - cosine * cosine, 0.0f));
    }
}

/* Shadows that Gaussians cast across ray l: their edges are features of the light. h: distance of a centre from the
   segment between the middle of a bin and the source; slope: how fast it changes along the ray. */
SCATTERI_HOT static void scatteri_rate_shadows(const scatteri_shadows *cast,
                                               const scatteri_marks *SCATTERI_RESTRICT marks,
                                               scatteri_bins *SCATTERI_RESTRICT bins)
{
    const float sigma = cast->medium->sigma_most;
    int g, b;
    for (g = 0; g < cast->count; g++) {
        const float a = cast->a[g], radius = 3.8f / a, depth = sigma * cast->scale[g];
        const float rate = depth > 1e-3f ? scatteri_rate(a, sigma, cast->scale[g]) : 0.0f;
        const float x = cast->x[g], y = cast->y[g], z = cast->z[g];
        for (b = 0; b < SCATTERI_BINS; b++) {
            const float gx = x - marks->x[b], gy = y - marks->y[b], gz = z - marks->z[b];
            const float m = gx * marks->dx[b] + gy * marks->dy[b] + gz * marks->dz[b];
            const float hx = gx - m * marks->dx[b], hy = gy - m * marks->dy[b],
                        hz = gz - m * marks->dz[b];
            const float part = m * marks->inverse[b]; /* of the way to the source */
            const float slope = marks->sine[b] * scatteri_abs(1.0f - part);
            const float wide = radius + slope * 0.5f * (bins->high[b] - bins->low[b]);
            const int hit = (m > 0.0f) & (part < 1.0f) &
                            (hx * hx + hy * hy + hz * hz < wide * wide) & (bins->rate[b] > 0.0f);
            bins->rate[b] =
                scatteri_max(bins->rate[b], rate * slope * bins->stretch[b] * (float)hit);
        }
    }
}

/* Constant and height fog fill all bins: features are e-foldings of light and of density. */
SCATTERI_HOT static void scatteri_rate_fog(const scatteri_medium *medium, const scatteri_rays *rays,
                                           int l, scatteri_bins *SCATTERI_RESTRICT bins)
{
    const float sigma = medium->sigma_most, up = rays->dy[l], constant = medium->desc.constant;
    const float start = rays->ref.y + rays->oy[l];
    float density[SCATTERI_BINS], least = 1e-30f;
    size_t i;
    int b;
    for (b = 0; b < SCATTERI_BINS; b++)
        density[b] = constant;
    for (i = 0; i < medium->desc.height_count; i++) {
        const scatter_height h = medium->desc.heights[i];
        const float inverse = 1.0f / h.scale;
        least = scatteri_max(least, scatteri_abs(up) * inverse);
        for (b = 0; b < SCATTERI_BINS; b++) {
            const float y = start + 0.5f * (bins->low[b] + bins->high[b]) * up;
            density[b] += h.density * scatteri_exp(scatteri_min((h.y0 - y) * inverse, 80.0f));
        }
    }
    for (b = 0; b < SCATTERI_BINS; b++) {
        const float rate = 0.4f * scatteri_max(sigma * density[b], least);
        bins->rate[b] = scatteri_max(bins->rate[b], rate * bins->stretch[b]);
    }
}

/* Ends and middles of the bins. */
SCATTERI_HOT static void scatteri_place_bins(const scatteri_map *map, int l, float ua, float ub,
                                             scatteri_bins *bins)
{
    const float width = (ub - ua) / (float)SCATTERI_BINS, t0 = map->t0[l], d = map->d[l];
    int b;
    bins->u0 = ua;
    bins->width = width;
    for (b = 0; b < SCATTERI_BINS; b++) {
        bins->low[b] = ua + (float)b * width;
        bins->high[b] = bins->low[b] + width;
        bins->stretch[b] = 1.0f;
    }
    if (!map->bent)
        return;
    for (b = 0; b < SCATTERI_BINS; b++) {
        const scatteri_vec2 middle = scatteri_stretch(t0, d, bins->low[b] + 0.5f * width);
        bins->low[b] = scatteri_stretch(t0, d, bins->low[b]).x;
        bins->high[b] = scatteri_stretch(t0, d, bins->high[b]).x;
        bins->stretch[b] = middle.y;
    }
}

/* Keeps the bins around the light from being empty. */
static void scatteri_rate_glow(const scatteri_map *map, int l, scatteri_bins *bins)
{
    const float low = map->t0[l] - SCATTERI_GLOW * map->d[l];
    const float high = map->t0[l] + SCATTERI_GLOW * map->d[l];
    int b;
    for (b = 0; b < SCATTERI_BINS && map->local; b++)
        if (low < bins->high[b] && high > bins->low[b])
            bins->rate[b] = scatteri_max(bins->rate[b], 1e-30f);
}

static void scatteri_fill_bins(scatteri_eye *eye, int l, float ua, float ub, int cells,
                               scatteri_bins *bins)
{
    const scatter_context *c = eye->context;
    const float voxels = cells ? SCATTERI_PANEL / (SCATTERI_VOXELS * eye->voxel[l]) : 0.0f;
    int b;
    scatteri_place_bins(&eye->pass.map, l, ua, ub, bins);
    for (b = 0; b < SCATTERI_BINS; b++)
        bins->rate[b] = voxels * bins->stretch[b];
    if (c->medium.has_analytic)
        scatteri_rate_fog(&c->medium, &eye->rays, l, bins);
    eye->nodes.work[SCATTERI_WORK_BIN] += (double)eye->page.count + 1.0;
    if (eye->page.complete)
        scatteri_rate_gaussians(&eye->page, l, c->medium.sigma_most, bins);
    for (b = 0; b < SCATTERI_BINS && !eye->page.complete; b++)
        bins->rate[b] = scatteri_max(bins->rate[b], eye->features[l] * bins->stretch[b]);
    if (eye->pass.cut != NULL && eye->pass.cut->in_rim)
        scatteri_rate_glow(&eye->pass.map, l, bins);
    if (eye->pass.cut != NULL && scatteri_in_closed_form(c, eye->pass.cut)) {
        scatteri_marks marks;
        scatteri_mark_bins(&eye->rays, l, &eye->pass.cut->source, bins, &marks);
        scatteri_rate_shadows(&eye->cast, &marks, bins);
        eye->nodes.work[SCATTERI_WORK_BIN] += (double)eye->cast.count;
    }
    for (b = 0; b < SCATTERI_BINS && eye->pass.map.bent; b++)
        bins->rate[b] = bins->rate[b] > 0.0f ? scatteri_max(bins->rate[b], SCATTERI_PEAK) : 0.0f;
}

static float scatteri_panel(const scatter_context *c)
{
    return c->twin ? SCATTERI_TWIN_PANEL : SCATTERI_PANEL;
}

/* A run of bins that are not empty: panels of at most SCATTERI_PANEL widths of the narrowest feature in them, up to
   eight panels in a bin. */
static void scatteri_add_run(scatteri_eye *eye, int l, const scatteri_bins *bins, int first,
                             int end, int cells)
{
    const float width = bins->width, panel = scatteri_panel(eye->context);
    float rate = 0.0f;
    int b, start = first, i, parts;
    for (b = first; b < end; b++) {
        const float with = scatteri_max(rate, bins->rate[b]);
        if (b > start && with * width * (float)(b + 1 - start) > panel) {
            scatteri_add_panel(eye, l, bins->u0 + (float)start * width, bins->u0 + (float)b * width,
                               cells);
            start = b;
            rate = bins->rate[b];
        } else {
            rate = with;
        }
        eye->nodes.work[SCATTERI_WORK_STRAIN] += bins->rate[b] * width > 8.0f * panel ? 1.0 : 0.0;
        parts = (int)scatteri_clamp(bins->rate[b] * width / panel, 0.0f, 7.0f) + 1;
        for (i = 0; parts > 1 && i < parts; i++)
            scatteri_add_panel(eye, l, bins->u0 + ((float)b + (float)i / (float)parts) * width,
                               bins->u0 + ((float)b + (float)(i + 1) / (float)parts) * width,
                               cells);
        if (parts > 1) {
            start = b + 1;
            rate = 0.0f;
        }
    }
    if (start < end)
        scatteri_add_panel(eye, l, bins->u0 + (float)start * width, bins->u0 + (float)end * width,
                           cells);
}

/* A piece of ray l on which only the medium's smooth shape counts. Few features fit into one panel at once. */
static void scatteri_add_piece(scatteri_eye *eye, int l, float ta, float tb)
{
    const scatter_context *c = eye->context;
    const float middle = 0.5f * (ta + tb);
    const int cells = eye->samples > 0 && middle > eye->profile0[l] && middle < eye->profile1[l];
    const float ua = scatteri_to_u(&eye->pass.map, l, ta),
                ub = scatteri_to_u(&eye->pass.map, l, tb);
    scatteri_bins bins;
    int b = 0, end;
    if (!cells && !c->medium.has_analytic && !(c->medium.lobes.g1 > SCATTERI_NARROW) &&
        scatteri_max(eye->features[l] * (tb - ta),
                     eye->pass.map.bent ? SCATTERI_PEAK * (ub - ua) : 0.0f) <= scatteri_panel(c)) {
        scatteri_add_panel(eye, l, ua, ub, 0);
        return;
    }
    scatteri_fill_bins(eye, l, ua, ub, cells, &bins);
    while (b < SCATTERI_BINS) {
        for (; b < SCATTERI_BINS && !(bins.rate[b] > 0.0f); b++)
            ;
        for (end = b; end < SCATTERI_BINS && bins.rate[end] > 0.0f; end++)
            ;
        if (b < end)
            scatteri_add_run(eye, l, &bins, b, end, cells);
        b = end;
    }
}

/* --- pieces --- */

static scatter_vec3 scatteri_ray_point(const scatteri_rays *rays, int l, float t)
{
    return scatteri_add(rays->ref, scatteri_along(scatteri_ray_origin(rays, l),
                                                  scatteri_ray_direction(rays, l), t));
}

static int scatteri_lit_at(const scatteri_eye *eye, int l, float t)
{
    return scatteri_lit(eye->context, eye->pass.cut, scatteri_ray_point(&eye->rays, l, t));
}

/* Where light and shadow meet between a (in state `lit`) and b (in the other). */
static float scatteri_shadow_edge(const scatteri_eye *eye, int l, float a, float b, int lit)
{
    int step;
    for (step = 0; step < SCATTERI_BISECTIONS; step++) {
        const float middle = 0.5f * (a + b);
        if (scatteri_lit_at(eye, l, middle) == lit)
            a = middle;
        else
            b = middle;
    }
    return 0.5f * (a + b);
}

/* The lit parts of a piece, found by probes and bisection. Probes gather at a local light, or at the eye. */
static void scatteri_add_lit(scatteri_eye *eye, int l, float ta, float tb)
{
    const float ua = scatteri_to_u(&eye->pass.map, l, ta),
                ub = scatteri_to_u(&eye->pass.map, l, tb);
    const int probes = eye->context->twin ? SCATTERI_TWIN_PROBES : SCATTERI_PROBES;
    float start = ta, before = ta;
    int probe, lit = 0, now;
    eye->nodes.work[SCATTERI_WORK_CALL] += probes;
    for (probe = 0; probe < probes; probe++) {
        const float even = ((float)probe + 0.5f) / (float)probes;
        const float at = eye->pass.map.bent ? even : even * even;
        const float t = scatteri_to_t(&eye->pass.map, l, ua + at * (ub - ua));
        now = scatteri_lit_at(eye, l, t) != 0;
        if (probe == 0) {
            lit = now;
        } else if (now != lit) {
            const float edge = scatteri_shadow_edge(eye, l, before, t, lit);
            if (lit)
                scatteri_add_piece(eye, l, start, edge);
            start = edge;
            lit = now;
        }
        before = t;
    }
    if (lit)
        scatteri_add_piece(eye, l, start, tb);
}

/* Break points of one ray, in order. */
typedef struct scatteri_edges {
    int count;
    float t[16];
} scatteri_edges;

static void scatteri_add_edge(scatteri_edges *edges, float t)
{
    int i;
    if (!(t > edges->t[0] && t < edges->t[edges->count - 1]))
        return;
    for (i = edges->count; edges->t[i - 1] > t; i--)
        edges->t[i] = edges->t[i - 1];
    edges->t[i] = t;
    edges->count++;
}

/* Where ray l crosses the cone of cosine k (both nappes) around the light's axis. */
static void scatteri_add_cone(scatteri_edges *edges, const scatteri_rays *rays, int l,
                              const scatteri_light *light, float k)
{
    const scatter_vec3 d = scatteri_ray_direction(rays, l), w = light->desc.direction;
    const scatter_vec3 to =
        scatteri_sub(scatteri_ray_origin(rays, l), scatteri_sub(light->desc.position, rays->ref));
    const double uw = (double)scatteri_dot(d, w), ow = (double)scatteri_dot(to, w);
    const double k2 = (double)k * (double)k, ou = (double)scatteri_dot(to, d);
    const double a = uw * uw - k2, b = uw * ow - k2 * ou,
                 c = ow * ow - k2 * (double)scatteri_dot(to, to);
    const double root = b * b - a * c;
    double q;
    if (root <= 0.0)
        return;
    q = b >= 0.0 ? -(b + sqrt(root)) : -(b - sqrt(root));
    if (a != 0.0)
        scatteri_add_edge(edges, (float)(q / a));
    if (q != 0.0)
        scatteri_add_edge(edges, (float)(c / q));
}

static int scatteri_in_cone(const scatteri_eye *eye, int l, float t)
{
    const scatteri_light *light = eye->pass.cut;
    const scatter_vec3 from = scatteri_unit_or_zero(
        scatteri_sub(scatteri_ray_point(&eye->rays, l, t), light->desc.position));
    return light->desc.kind != SCATTER_LIGHT_SPOT ||
           scatteri_dot(from, light->desc.direction) > light->cos_outer;
}

static int scatteri_filled(const scatteri_eye *eye, int l, float t)
{
    return eye->context->medium.has_analytic || (t > eye->pass.from[l] && t < eye->pass.to[l]) ||
           (eye->samples > 0 && t > eye->profile0[l] && t < eye->profile1[l]);
}

static void scatteri_find_edges(const scatteri_eye *eye, int l, scatteri_edges *edges)
{
    const scatteri_light *light = eye->pass.cut;
    edges->count = 2;
    edges->t[0] = eye->rays.t0[l];
    edges->t[1] = eye->rays.t1[l];
    scatteri_add_edge(edges, eye->pass.from[l]);
    scatteri_add_edge(edges, eye->pass.to[l]);
    if (eye->samples > 0) {
        scatteri_add_edge(edges, eye->profile0[l]);
        scatteri_add_edge(edges, eye->profile1[l]);
    }
    if (light != NULL && light->desc.kind == SCATTER_LIGHT_SPOT) {
        scatteri_add_cone(edges, &eye->rays, l, light, light->cos_outer);
        scatteri_add_cone(edges, &eye->rays, l, light, light->cos_inner);
    }
}

static void scatteri_cut_ray(scatteri_eye *eye, int l)
{
    const scatteri_light *light = eye->pass.cut;
    scatteri_edges edges;
    int i;
    scatteri_find_edges(eye, l, &edges);
    for (i = 1; i < edges.count; i++) {
        const float ta = edges.t[i - 1], tb = edges.t[i], middle = 0.5f * (ta + tb);
        if (!(ta < tb) || !scatteri_filled(eye, l, middle) ||
            (light != NULL && !scatteri_in_cone(eye, l, middle)))
            continue;
        if (light != NULL && eye->context->scene.visible != NULL)
            scatteri_add_lit(eye, l, ta, tb);
        else
            scatteri_add_piece(eye, l, ta, tb);
    }
}

/* Puts each ray into one panel, if nothing cuts them; returns the most features on one, or SCATTERI_FAR. A narrow lobe
   sends most from the far end of a ray that passes a lamp, where one panel's nodes are widest apart: bins see that. */
SCATTERI_HOT static float scatteri_one_panel(scatteri_eye *eye)
{
    const scatter_context *c = eye->context;
    const scatteri_light *light = eye->pass.cut;
    scatteri_panels *panels = &eye->panels;
    const scatteri_map *map = &eye->pass.map;
    float features[SCATTERI_LANES];
    int l;
    if (c->medium.has_analytic || eye->samples > 0 || c->medium.lobes.g1 > SCATTERI_NARROW ||
        (light != NULL && (light->desc.kind == SCATTER_LIGHT_SPOT || c->scene.visible != NULL)))
        return SCATTERI_FAR;
    for (l = 0; l < SCATTERI_LANES; l++) {
        panels->ua[0][l] = eye->pass.from[l];
        panels->ub[0][l] = eye->pass.to[l];
        panels->cells[0][l] = 0.0f;
        features[l] = eye->features[l] * (panels->ub[0][l] - panels->ua[0][l]);
    }
    if (!map->bent)
        return scatteri_most(features);
    for (l = 0; l < SCATTERI_LANES; l++) {
        const float ua = scatteri_asinh((panels->ua[0][l] - map->t0[l]) / map->d[l]);
        const float ub = scatteri_asinh((panels->ub[0][l] - map->t0[l]) / map->d[l]);
        panels->ua[0][l] = ua;
        panels->ub[0][l] = ub;
        features[l] = scatteri_max(features[l], SCATTERI_PEAK * (ub - ua));
        features[l] = scatteri_choose(SCATTERI_STRETCH, ub - ua, SCATTERI_FAR, features[l]);
    }
    return scatteri_most(features);
}

/* The rule with as many nodes as `features` need; NULL if that is too many for one panel. */
static const scatteri_rule *scatteri_rule_for(const scatter_context *c, float features)
{
    const int need = (int)scatteri_min((float)SCATTERI_EIGHTH * features / SCATTERI_PANEL, 1e6f);
    const int least = need > 2 ? need : 2, i = c->twin ? 2 * least + 1 : least;
    const scatteri_rule *rule = i < SCATTERI_RULES ? &c->rules[i] : NULL;
    return rule != NULL && rule->count > 0 ? rule : NULL;
}

/* Around a light in the rim of the medium the glow counts, however thin the medium is there. */
static void scatteri_add_glow(scatteri_eye *eye)
{
    scatteri_pass *pass = &eye->pass;
    int l;
    for (l = 0; l < SCATTERI_LANES; l++) {
        const float low = pass->map.t0[l] - SCATTERI_GLOW * pass->map.d[l];
        const float high = pass->map.t0[l] + SCATTERI_GLOW * pass->map.d[l];
        const float from = pass->from[l] < pass->to[l] ? scatteri_min(pass->from[l], low) : low;
        const float to = pass->from[l] < pass->to[l] ? scatteri_max(pass->to[l], high) : high;
        pass->from[l] = scatteri_clamp(from, eye->rays.t0[l], eye->rays.t1[l]);
        pass->to[l] = scatteri_clamp(to, eye->rays.t0[l], eye->rays.t1[l]);
    }
}

static void scatteri_run_pass(scatteri_eye *eye)
{
    const scatteri_rule *rule;
    int l;
    memcpy(eye->pass.from, eye->hull0, sizeof eye->hull0);
    memcpy(eye->pass.to, eye->hull1, sizeof eye->hull1);
    if (eye->pass.cut != NULL && eye->pass.cut->in_rim && eye->pass.map.local)
        scatteri_add_glow(eye);
    rule = scatteri_rule_for(eye->context, scatteri_one_panel(eye));
    if (rule != NULL) {
        scatteri_evaluate_panel(eye, 0, rule);
        return;
    }
    if (eye->pass.cut != NULL)
        scatteri_begin_shadows(&eye->cast, &eye->context->medium, &eye->pass.cut->source,
                               &eye->rays, eye->context->trim.depth);
    for (l = 0; l < SCATTERI_LANES; l++)
        if (eye->rays.t0[l] < eye->rays.t1[l])
            scatteri_cut_ray(eye, l);
    scatteri_flush(eye);
}

static int scatteri_glows(const scatter_context *c)
{
    const scatter_vec3 e = c->medium.desc.emission;
    return e.x > 0.0f || e.y > 0.0f || e.z > 0.0f;
}

/* Emission and all directional lights share nodes, unless geometry or shadows in fog cut the ray differently for each. */
static void scatteri_integrate(scatteri_eye *eye)
{
    const scatter_context *c = eye->context;
    scatteri_pass *pass = &eye->pass;
    const int shared = c->scene.visible == NULL && !c->medium.has_analytic;
    int i, directional = 0;
    for (i = 0; i < c->light_count; i++)
        directional |= c->lights[i].source.directional;
    memset(&pass->map, 0, sizeof pass->map);
    pass->emission = scatteri_glows(c);
    pass->cut = NULL;
    pass->first = 0;
    pass->end = shared ? c->light_count : 0;
    if (pass->emission || (directional && pass->end > 0))
        scatteri_run_pass(eye);
    pass->emission = 0;
    for (i = 0; i < c->light_count; i++) {
        pass->first = i;
        pass->end = i + 1;
        pass->cut = &c->lights[i];
        scatteri_map_light(&eye->rays, &c->lights[i], c->medium.turn, &pass->map);
        if ((pass->map.local || !shared) && scatteri_in_pass(c, pass, i))
            scatteri_run_pass(eye);
    }
}

/* --- whole rays --- */

/* Depth of each ray from t0 to t1. */
static void scatteri_end_depth(scatteri_eye *eye, float *depth)
{
    scatteri_nodes *n = &eye->nodes;
    n->count = SCATTERI_LANES;
    memcpy(n->t, eye->rays.t1, sizeof eye->rays.t1);
    scatteri_fill_nodes(eye);
    memcpy(depth, n->depth, SCATTERI_LANES * sizeof(float));
}

/* Shortens all rays to what is inside the box, relative to rays->ref; nothing: t0 = t1. */
SCATTERI_HOT static void scatteri_clip_rays(scatter_box b, scatteri_rays *rays)
{
    int l;
    for (l = 0; l < SCATTERI_LANES; l++) {
        const float dx = scatteri_not_zero(rays->dx[l]), dy = scatteri_not_zero(rays->dy[l]);
        const float dz = scatteri_not_zero(rays->dz[l]);
        const float ax = (b.min.x - rays->ox[l]) / dx, bx = (b.max.x - rays->ox[l]) / dx;
        const float ay = (b.min.y - rays->oy[l]) / dy, by = (b.max.y - rays->oy[l]) / dy;
        const float az = (b.min.z - rays->oz[l]) / dz, bz = (b.max.z - rays->oz[l]) / dz;
        const float enter = scatteri_max(scatteri_min(ax, bx),
                                        scatteri_max(scatteri_min(ay, by), scatteri_min(az, bz)));
        const float leave = scatteri_min(scatteri_max(ax, bx),
                                       scatteri_min(scatteri_max(ay, by), scatteri_max(az, bz)));
        const float t0 = scatteri_max(rays->t0[l], enter), t1 = scatteri_min(rays->t1[l], leave);
        rays->t0[l] = scatteri_choose(t0, t1, t0, 0.0f);
        rays->t1[l] = scatteri_choose(t0, t1, t1, 0.0f);
    }
}

/* The stretches of the rays where there is medium; nothing: t0 = t1. */
static void scatteri_cut_to_medium(const scatteri_medium *m, scatteri_rays *rays)
{
    int l;
    if (m->desc.bounded)
        scatteri_clip_rays(scatteri_box_from(m->desc.bounds, rays->ref), rays);
    if (!m->has_analytic && m->has_local)
        scatteri_clip_rays(scatteri_box_from(m->local, rays->ref), rays);
    for (l = 0; l < SCATTERI_LANES && !m->has_local; l++)
        rays->t1[l] = m->has_analytic ? rays->t1[l] : rays->t0[l];
    for (l = 0; l < SCATTERI_LANES && m->has_analytic; l++)
        if (rays->t0[l] < rays->t1[l])
            rays->t1[l] = scatteri_min(
                rays->t1[l],
                rays->t0[l] + scatteri_horizon(m, scatteri_ray_point(rays, l, rays->t0[l]),
                                               scatteri_ray_direction(rays, l),
                                               rays->t1[l] - rays->t0[l]));
}

/* Gathers what lies on the rays; 0 if nothing does. */
static int scatteri_begin_eye(scatteri_eye *eye)
{
    const scatter_context *c = eye->context;
    int l, some = 0;
    eye->samples = 0;
    eye->page.count = eye->gathered = 0;
    eye->page.complete = 1;
    memset(eye->nodes.work, 0, sizeof eye->nodes.work);
    eye->nodes.work[SCATTERI_WORK_PACKET] = 1.0;
    memset(&eye->radiance, 0, sizeof eye->radiance);
    memset(eye->panels.count, 0, sizeof eye->panels.count);
    scatteri_cut_to_medium(&c->medium, &eye->rays);
    for (l = 0; l < SCATTERI_LANES; l++) {
        eye->hull0[l] = SCATTERI_FAR;
        eye->hull1[l] = -SCATTERI_FAR;
        eye->features[l] = 0.0f;
        some |= eye->rays.t0[l] < eye->rays.t1[l];
    }
    if (some && c->exact && c->medium.gaussians.count > 0)
        scatteri_gather_eye(eye);
    eye->nodes.work[SCATTERI_WORK_PAGE] = (double)eye->gathered;
    eye->nodes.work[SCATTERI_WORK_TEST] =
        some && c->exact ? scatteri_tests(&c->medium.gaussians) : 0.0;
    for (l = 0; l < SCATTERI_LANES; l++) {
        eye->hull0[l] = scatteri_clamp(eye->hull0[l], eye->rays.t0[l], eye->rays.t1[l]);
        eye->hull1[l] = scatteri_clamp(eye->hull1[l], eye->hull0[l], eye->rays.t1[l]);
    }
    return some;
}

/* --- march: uniform steps with running sums, as in the papers ---
   Step k of a ray is the k-th of `nodes` equal parts. The mask says which steps of each ray are lit: those from the first
   to the last one with density (Navarro et al. 2008). The map of distances lets it pass empty steps and, where it is on,
   too, leave out those in between. Fog has density everywhere. */

static float scatteri_march_step(const scatteri_eye *eye, int l)
{
    return (eye->rays.t1[l] - eye->rays.t0[l]) / (float)eye->context->quality.nodes;
}

static float scatteri_march_t(const scatteri_eye *eye, int l, int k)
{
    return eye->rays.t0[l] + ((float)k + 0.5f) * scatteri_march_step(eye, l);
}

/* How far t is from where Gaussians reach ray l. */
static float scatteri_off_hull(const scatteri_eye *eye, int l, float t)
{
    return eye->hull0[l] < eye->hull1[l] ? scatteri_max(eye->hull0[l] - t, t - eye->hull1[l])
                                         : SCATTERI_FAR;
}

/* How many steps from k on, up or down, are certainly empty on all rays that count. */
static int scatteri_pass_steps(const scatteri_eye *eye, int k, const int *counts)
{
    const scatter_context *c = eye->context;
    float t[SCATTERI_LANES], step[SCATTERI_LANES], steps = 1e6f;
    int l, empty;
    for (l = 0; l < SCATTERI_LANES; l++) {
        float off;
        t[l] = scatteri_march_t(eye, l, k);
        step[l] = counts[l] ? scatteri_march_step(eye, l) : 0.0f;
        off = scatteri_off_hull(eye, l, t[l]);
        if (step[l] > 0.0f)
            steps = scatteri_min(steps, off > 0.0f ? 1.0f + off / step[l] : 0.0f);
    }
    empty = scatteri_empty_steps(c->fields, c->field_count, &eye->rays, t, step);
    return scatteri_clamp_int((int)steps, 0, empty);
}

/* Voxel density at step k of 16 rays; `filled`: which rays have any density there. Returns whether one has. */
static int scatteri_sample_step(scatteri_eye *eye, int k, float *voxels, int *filled)
{
    const scatter_context *c = eye->context;
    float t[SCATTERI_LANES];
    int f, l, some = 0;
    for (l = 0; l < SCATTERI_LANES; l++) {
        t[l] = scatteri_march_t(eye, l, k);
        voxels[l] = 0.0f;
    }
    for (f = 0; f < c->field_count; f++)
        scatteri_sample_field(&c->fields[f], &eye->rays, t, voxels);
    eye->nodes.work[SCATTERI_WORK_VOXEL] += (double)c->field_count;
    for (l = 0; l < SCATTERI_LANES; l++) {
        filled[l] = (eye->rays.t0[l] < eye->rays.t1[l]) &
                    (voxels[l] > 0.0f || !(scatteri_off_hull(eye, l, t[l]) > 0.0f));
        some |= filled[l];
    }
    return some;
}

/* First steps of the rays with density, in the direction `way`; rays that `seek` and find none keep what is there. */
static void scatteri_find_step(scatteri_eye *eye, int k, int way, int *seek, int *found)
{
    const int nodes = eye->context->quality.nodes;
    float voxels[SCATTERI_LANES];
    int filled[SCATTERI_LANES], l, left = 0;
    for (l = 0; l < SCATTERI_LANES; l++)
        left += seek[l];
    while (left > 0 && k >= 0 && k < nodes) {
        const int empty = scatteri_pass_steps(eye, k, seek);
        if (empty > 0) {
            k += way * empty;
            continue;
        }
        (void)scatteri_sample_step(eye, k, voxels, filled);
        for (l = 0; l < SCATTERI_LANES; l++)
            if (seek[l] && filled[l]) {
                found[l] = k;
                seek[l] = 0;
                left--;
            }
        k += way;
    }
}

/* Fills eye->first and eye->last; of rays that meet no medium -1. */
static void scatteri_find_mask(scatteri_eye *eye)
{
    const scatter_context *c = eye->context;
    const int masked =
        !c->quality.no_mask && !c->medium.has_analytic && (c->light_count > 0 || scatteri_glows(c));
    int seek[SCATTERI_LANES], l;
    for (l = 0; l < SCATTERI_LANES; l++) {
        seek[l] = eye->rays.t0[l] < eye->rays.t1[l];
        eye->first[l] = masked || !seek[l] ? -1 : 0;
        eye->last[l] = masked || !seek[l] ? -1 : c->quality.nodes - 1;
    }
    if (!masked)
        return;
    scatteri_find_step(eye, 0, 1, seek, eye->first);
    for (l = 0; l < SCATTERI_LANES; l++)
        seek[l] = eye->first[l] >= 0;
    scatteri_find_step(eye, c->quality.nodes - 1, -1, seek, eye->last);
}

/* Places step k as one more row of nodes. */
static void scatteri_place_step(scatteri_eye *eye, int k, int row)
{
    scatteri_nodes *n = &eye->nodes;
    int l;
    for (l = 0; l < SCATTERI_LANES; l++) {
        const int i = row * SCATTERI_LANES + l, lit = k >= eye->first[l] && k <= eye->last[l];
        n->t[i] = scatteri_march_t(eye, l, k);
        n->weight[i] = lit ? scatteri_march_step(eye, l) : 0.0f;
        n->cell[i] = 0.0f;
    }
}

/* Lights up to 16 steps whose voxel density is known. */
static void scatteri_light_steps(scatteri_eye *eye, int rows, const float *voxels, float *running)
{
    const scatter_context *c = eye->context;
    scatteri_nodes *n = &eye->nodes;
    scatteri_rays span;
    int i;
    n->count = rows * SCATTERI_LANES;
    scatteri_fill_nodes(eye);
    for (i = 0; i < n->count; i++) {
        float *sum = &running[i % SCATTERI_LANES];
        n->density[i] += voxels[i];
        n->depth[i] = *sum + 0.5f * n->weight[i] * n->density[i];
        *sum += n->weight[i] * n->density[i];
    }
    if (!c->quality.no_mask && !c->quality.no_distance_map)
        scatteri_drop_empty(n);
    if (n->count == 0)
        return;
    span = scatteri_span_of(eye);
    if (scatteri_glows(c))
        scatteri_add_emission(eye);
    if (scatteri_together(c))
        scatteri_add_beams(c, &eye->rays, n, &eye->radiance);
    for (i = 0; i < c->light_count; i++) {
        scatteri_map map;
        if (c->lights[i].source.directional && scatteri_together(c))
            continue;
        scatteri_map_light(&eye->rays, &c->lights[i], c->medium.turn, &map);
        scatteri_add_light(eye, &c->lights[i], &map, &span, c->scene.visible != NULL);
    }
}

static void scatteri_march_eye(scatteri_eye *eye, float *depth)
{
    const scatter_context *c = eye->context;
    const int passes = !c->quality.no_distance_map && !c->medium.has_analytic;
    float voxels[SCATTERI_POINTS];
    int filled[SCATTERI_LANES], counts[SCATTERI_LANES];
    int l, k = c->quality.nodes, next, last = -1, row = 0;
    memset(depth, 0, SCATTERI_LANES * sizeof(float));
    scatteri_find_mask(eye);
    for (l = 0; l < SCATTERI_LANES; l++) {
        counts[l] = eye->first[l] >= 0;
        k = counts[l] && eye->first[l] < k ? eye->first[l] : k;
        last = eye->last[l] > last ? eye->last[l] : last;
    }
    while (k <= last) {
        const int empty = passes ? scatteri_pass_steps(eye, k, counts) : 0;
        if (empty == 0 &&
            (scatteri_sample_step(eye, k, voxels + row * SCATTERI_LANES, filled) || !passes))
            scatteri_place_step(eye, k, row++);
        next = k + (empty > 0 ? empty : 1);
        if (row > 0 && next / SCATTERI_ROWS > k / SCATTERI_ROWS) {
            scatteri_light_steps(eye, row, voxels, depth);
            row = 0;
        }
        k = next;
    }
    if (row > 0)
        scatteri_light_steps(eye, row, voxels, depth);
}

SCATTERI_HOT static void scatteri_decay_lanes(float sigma, const float *SCATTERI_RESTRICT depth,
                                              float *SCATTERI_RESTRICT through)
{
    int l;
    for (l = 0; l < SCATTERI_LANES; l++)
        through[l] = scatteri_exp(-sigma * depth[l]);
}

/* Radiance and transmittance of the medium on 16 rays between their origins and rays.t1. */
static void scatteri_look(scatteri_eye *eye, scatter_sample *samples)
{
    const scatter_vec3 s = eye->context->medium.desc.extinction;
    scatteri_radiance through;
    float depth[SCATTERI_LANES];
    int l;
    memset(depth, 0, sizeof depth);
    if (scatteri_begin_eye(eye)) {
        if (eye->context->quality.ray == SCATTER_RAY_MARCH) {
            scatteri_march_eye(eye, depth);
        } else {
            scatteri_take_profile(eye);
            scatteri_end_depth(eye, depth);
            scatteri_integrate(eye);
        }
    }
    scatteri_decay_lanes(s.x, depth, through.r);
    scatteri_decay_lanes(s.y, depth, through.g);
    scatteri_decay_lanes(s.z, depth, through.b);
    for (l = 0; l < SCATTERI_LANES; l++) {
        samples[l].radiance =
            scatteri_v3(eye->radiance.r[l], eye->radiance.g[l], eye->radiance.b[l]);
        samples[l].transmittance = scatteri_v3(through.r[l], through.g[l], through.b[l]);
    }
}

/* --- surfaces --- */

/* Unit vector of a vector of any length but 0. */
static scatter_vec3 scatteri_unit(scatter_vec3 v)
{
    const float most =
        scatteri_max(scatteri_abs(v.x), scatteri_max(scatteri_abs(v.y), scatteri_abs(v.z)));
    if (!(most > 0.0f))
        return v;
    /* divided, not scaled: 1/most of a denormal is infinite */
    return scatteri_normalize(scatteri_v3(v.x / most, v.y / most, v.z / most));
}

/* Irradiance factor of a light at x on a plane square to its direction, before visibility and depth; *to: unit. */
static float scatteri_fall(const scatteri_light *light, scatter_vec3 x, scatter_vec3 *to)
{
    scatter_vec3 away;
    float r2;
    if (light->source.directional) {
        *to = scatteri_scale(light->desc.direction, -1.0f);
        return 1.0f;
    }
    away = scatteri_sub(light->desc.position, x);
    r2 = scatteri_dot(away, away);
    *to = scatteri_unit_or_zero(away);
    r2 = 1.0f / scatteri_max(r2 + light->desc.radius * light->desc.radius, 1e-30f);
    return light->desc.kind != SCATTER_LIGHT_SPOT
               ? r2
               : r2 * scatteri_spot(light->cos_inner, light->cos_outer,
                                    -scatteri_dot(*to, light->desc.direction));
}

/* BRDF times cosine: Lambert plus Phong. */
static scatter_vec3 scatteri_brdf(const scatter_surface *s, scatter_vec3 ray, scatter_vec3 to)
{
    const float cosine = scatteri_max(scatteri_dot(s->normal, to), 0.0f);
    const scatter_vec3 mirror =
        scatteri_sub(ray, scatteri_scale(s->normal, 2.0f * scatteri_dot(ray, s->normal)));
    const float gloss = scatteri_max(scatteri_dot(mirror, to), 0.0f);
    const float phong =
        gloss > 0.0f ? (s->shininess + 2.0f) * 0.159154943f *
                           scatteri_exp(s->shininess * scatteri_log(scatteri_max(gloss, 1e-30f)))
                     : 0.0f;
    return scatteri_scale(
        scatteri_add(scatteri_scale(s->albedo, 0.318309886f), scatteri_scale(s->specular, phong)),
        cosine);
}

static float scatteri_depth_to(const scatter_context *c, const scatteri_light *light,
                               scatter_vec3 x)
{
    scatter_depth exact;
    if (!c->twin)
        return scatter_depth_at(&light->depth, x);
    exact = light->depth;
    exact.source = light->source;
    exact.method = SCATTER_DEPTH_CLOSED;
    return scatter_depth_at(&exact, x);
}

/* Radiance that the surface point sends back along the ray, lit through the medium. */
static scatter_vec3 scatteri_shade(const scatter_context *c, const scatter_surface *hit,
                                   scatter_vec3 origin, scatter_vec3 ray)
{
    const scatter_vec3 x = scatteri_along(origin, ray, hit->distance);
    scatter_vec3 sum = {0.0f, 0.0f, 0.0f};
    scatter_surface s = *hit;
    int i;
    s.normal = scatteri_unit(hit->normal);
    for (i = 0; i < c->light_count; i++) {
        const scatteri_light *light = &c->lights[i];
        scatter_vec3 to, value, through;
        const float fall = scatteri_fall(light, x, &to);
        value = scatteri_brdf(&s, ray, to);
        value = scatteri_scale(scatteri_mul(value, light->desc.intensity), fall);
        if (!(value.x > 0.0f || value.y > 0.0f || value.z > 0.0f) || !scatteri_lit(c, light, x))
            continue;
        through = scatteri_transmittance(&c->medium, scatteri_depth_to(c, light, x));
        sum = scatteri_add(sum, scatteri_mul(value, through));
    }
    return sum;
}

/* ------------------------------------------------------------------------------------------- >>image */

enum {
    SCATTERI_SIDE = 4,
    SCATTERI_TILE = 16,
    SCATTERI_SAMPLED = 64 /* tiles whose cost is counted at most, if it is asked for */
};

typedef struct scatteri_picture {
    const scatter_context *context;
    scatter_view view;
    scatter_image image;
    int tile_x, tile_y; /* corner of the first tile */
    int across;         /* tiles in a row */
    int sparse;         /* one ray of each packet speaks for it */
    double *costs;      /* of every `stride`-th tile, ns; NULL: not asked for */
    int tiles, stride;
} scatteri_picture;

/* What a packet shows. */
typedef struct scatteri_seen {
    scatter_vec3 rgb[SCATTERI_LANES], through[SCATTERI_LANES];
    size_t at[SCATTERI_LANES];  /* number of the pixel */
    int counts[SCATTERI_LANES]; /* pixels that the ray speaks for: 0 outside the region */
} scatteri_seen;

/* Ray number l of a packet; `end`: where a surface ends it. */
static void scatteri_set_ray(scatteri_rays *rays, int l, scatter_vec3 origin,
                             scatter_vec3 direction, float end)
{
    if (l == 0)
        rays->ref = origin;
    rays->ox[l] = origin.x - rays->ref.x;
    rays->oy[l] = origin.y - rays->ref.y;
    rays->oz[l] = origin.z - rays->ref.z;
    rays->dx[l] = direction.x;
    rays->dy[l] = direction.y;
    rays->dz[l] = direction.z;
    rays->t0[l] = 0.0f;
    rays->t1[l] = end;
}

static void scatteri_put(float *pixels, size_t at, scatter_vec3 rgb)
{
    pixels[3 * at] = rgb.x;
    pixels[3 * at + 1] = rgb.y;
    pixels[3 * at + 2] = rgb.z;
}

/* Rays through the centres of the 4x4 pixels from x, y on; beyond the edge of the image the nearest pixel. */
SCATTERI_HOT static void scatteri_aim(const scatteri_picture *job, int x, int y,
                                      scatteri_rays *rays)
{
    const scatter_view v = job->view;
    const float right = (float)job->image.width - 0.5f, bottom = (float)job->image.height - 0.5f;
    const float across = 1.0f / (float)job->image.width, down = 1.0f / (float)job->image.height;
    int l;
    rays->ref = v.origin;
    for (l = 0; l < SCATTERI_LANES; l++) {
        const float px = (float)(x + (l & (SCATTERI_SIDE - 1))) + 0.5f;
        const float py = (float)(y + l / SCATTERI_SIDE) + 0.5f;
        const float a = scatteri_min(px, right) * across, b = scatteri_min(py, bottom) * down;
        const float dx = v.direction.x + (v.direction_dx.x * a + v.direction_dy.x * b);
        const float dy = v.direction.y + (v.direction_dx.y * a + v.direction_dy.y * b);
        const float dz = v.direction.z + (v.direction_dx.z * a + v.direction_dy.z * b);
        const float square = dx * dx + dy * dy + dz * dz, inverse = scatteri_rsqrt(square);
        rays->ox[l] = v.origin_dx.x * a + v.origin_dy.x * b;
        rays->oy[l] = v.origin_dx.y * a + v.origin_dy.y * b;
        rays->oz[l] = v.origin_dx.z * a + v.origin_dy.z * b;
        /* a pixel whose direction is 0 looks along x */
        rays->dx[l] = scatteri_choose(square, 1e-30f, 1.0f, dx * inverse);
        rays->dy[l] = scatteri_choose(square, 1e-30f, 0.0f, dy * inverse);
        rays->dz[l] = scatteri_choose(square, 1e-30f, 0.0f, dz * inverse);
        rays->t0[l] = 0.0f;
        rays->t1[l] = SCATTERI_FAR;
    }
}

/* Ends ray l where the host's picture or a surface of the scene does. Returns whether a surface does. */
static int scatteri_end_ray(const scatteri_picture *job, int x, int y, int l, scatteri_rays *rays,
                            scatter_surface *hit)
{
    const scatter_scene *scene = &job->context->scene;
    const scatter_image *image = &job->image;
    const int px = scatteri_clamp_int(x + l % SCATTERI_SIDE, 0, image->width - 1);
    const int py = scatteri_clamp_int(y + l / SCATTERI_SIDE, 0, image->height - 1);
    const int solid = image->distance == NULL && scene->surface != NULL &&
                      scene->surface(scene->user, scatteri_ray_point(rays, l, 0.0f),
                                     scatteri_ray_direction(rays, l), hit) != 0;
    const float distance = solid ? hit->distance
                           : image->distance != NULL
                               ? image->distance[(size_t)py * (size_t)image->width + (size_t)px]
                               : 0.0f;
    if ((solid || distance > 0.0f) && distance < SCATTERI_FAR)
        rays->t1[l] = scatteri_max(distance, 0.0f);
    return solid;
}

/* What lies behind the medium: the host's picture, the lit surface or the background. */
static scatter_vec3 scatteri_behind(const scatteri_picture *job, size_t at,
                                    const scatter_surface *hit, const scatteri_rays *rays, int l)
{
    const float *color = job->image.color;
    if (color != NULL)
        return scatteri_v3(color[3 * at], color[3 * at + 1], color[3 * at + 2]);
    if (hit == NULL)
        return job->context->scene.background;
    return scatteri_shade(job->context, hit, scatteri_ray_point(rays, l, 0.0f),
                          scatteri_ray_direction(rays, l));
}

/* The view with directions of a length that can be squared. */
static scatter_view scatteri_scaled_view(const scatter_view *view)
{
    const scatter_vec3 d[3] = {view->direction, view->direction_dx, view->direction_dy};
    scatter_view scaled = *view;
    float most = 0.0f;
    int i;
    for (i = 0; i < 3; i++)
        most = scatteri_max(most,
                            scatteri_max(scatteri_abs(d[i].x),
                                         scatteri_max(scatteri_abs(d[i].y), scatteri_abs(d[i].z))));
    scaled.direction = scatteri_v3(d[0].x / most, d[0].y / most, d[0].z / most);
    scaled.direction_dx = scatteri_v3(d[1].x / most, d[1].y / most, d[1].z / most);
    scaled.direction_dy = scatteri_v3(d[2].x / most, d[2].y / most, d[2].z / most);
    return scaled;
}

/* Where the pixels of a packet are, and which are in the region. */
static void scatteri_locate(const scatteri_picture *job, int x, int y, scatteri_seen *seen)
{
    const scatter_image *image = &job->image;
    int l;
    for (l = 0; l < SCATTERI_LANES; l++) {
        const int px = x + l % SCATTERI_SIDE, py = y + l / SCATTERI_SIDE;
        seen->at[l] = (size_t)py * (size_t)image->width + (size_t)px;
        seen->counts[l] = px >= image->x0 && px < image->x1 && py >= image->y0 && py < image->y1;
    }
}

/* Lets one ray of the region speak for all, and shuts the others; another one in each packet. */
static void scatteri_thin_out(int x, int y, scatteri_rays *rays, scatteri_seen *seen)
{
    int l, all = 0, left, one = -1;
    for (l = 0; l < SCATTERI_LANES; l++)
        all += seen->counts[l];
    left = (x / SCATTERI_SIDE * 7 + y / SCATTERI_SIDE * 5) % all;
    for (l = 0; l < SCATTERI_LANES && one < 0; l++)
        if (seen->counts[l] && left-- == 0)
            one = l;
    for (l = 0; l < SCATTERI_LANES; l++) {
        seen->counts[l] = l == one ? all : 0;
        rays->t1[l] = l == one ? rays->t1[l] : 0.0f;
    }
}

/* 4x4 pixels. Those outside the region are computed with the others, so that a region has the same bits as the whole
   image. */
static void scatteri_see(const scatteri_picture *job, int x, int y, scatteri_eye *eye,
                         scatteri_seen *seen)
{
    scatter_surface hits[SCATTERI_LANES];
    scatter_sample samples[SCATTERI_LANES];
    scatteri_rays rays;
    const int ends = job->image.distance != NULL || job->context->scene.surface != NULL;
    int solid[SCATTERI_LANES], l;
    scatteri_aim(job, x, y, &rays);
    memset(solid, 0, sizeof solid);
    for (l = 0; l < SCATTERI_LANES && ends; l++)
        solid[l] = scatteri_end_ray(job, x, y, l, &rays, &hits[l]);
    scatteri_locate(job, x, y, seen);
    if (job->sparse)
        scatteri_thin_out(x, y, &rays, seen);
    eye->context = job->context;
    eye->rays = rays;
    scatteri_look(eye, samples);
    for (l = 0; l < SCATTERI_LANES; l++) {
        scatter_vec3 behind;
        if (!seen->counts[l])
            continue;
        behind = scatteri_behind(job, seen->at[l], solid[l] ? &hits[l] : NULL, &rays, l);
        seen->through[l] = samples[l].transmittance;
        seen->rgb[l] = scatteri_add(samples[l].radiance, scatteri_mul(seen->through[l], behind));
    }
}

static void scatteri_render_packet(const scatteri_picture *job, int x, int y, scatteri_eye *eye)
{
    const scatter_image *image = &job->image;
    scatteri_seen seen;
    int l;
    scatteri_see(job, x, y, eye, &seen);
    for (l = 0; l < SCATTERI_LANES; l++) {
        if (!seen.counts[l])
            continue;
        scatteri_put(image->rgb, seen.at[l], seen.rgb[l]);
        if (image->transmittance != NULL)
            scatteri_put(image->transmittance, seen.at[l], seen.through[l]);
    }
}

static void scatteri_render_tile(void *data, int task)
{
    const scatteri_picture *job = (const scatteri_picture *)data;
    const int x0 = job->tile_x + task % job->across * SCATTERI_TILE;
    const int y0 = job->tile_y + task / job->across * SCATTERI_TILE;
    scatteri_eye eye;
    double cost = 0.0;
    int x, y;
    for (y = y0; y < job->image.y1 && y < y0 + SCATTERI_TILE; y += SCATTERI_SIDE)
        for (x = x0; x < job->image.x1 && x < x0 + SCATTERI_TILE; x += SCATTERI_SIDE)
            if (x + SCATTERI_SIDE > job->image.x0 && y + SCATTERI_SIDE > job->image.y0) {
                scatteri_render_packet(job, x, y, &eye);
                cost += job->costs != NULL ? scatteri_cost(eye.nodes.work) : 0.0;
            }
    if (job->costs != NULL && task % job->stride == 0)
        job->costs[task / job->stride] = cost;
}

static scatter_result scatteri_render_tiles(scatteri_picture *job)
{
    const scatteri_stage stage = {&job->context->host, 0.0f, 1.0f};
    const int left = job->image.x0 / SCATTERI_TILE, top = job->image.y0 / SCATTERI_TILE;
    const int wide = (job->image.x1 - 1) / SCATTERI_TILE + 1 - left,
              high = (job->image.y1 - 1) / SCATTERI_TILE + 1 - top;
    job->tile_x = left * SCATTERI_TILE;
    job->tile_y = top * SCATTERI_TILE;
    job->across = wide;
    job->tiles = wide * high;
    job->stride = (job->tiles - 1) / SCATTERI_SAMPLED + 1;
    return scatteri_parallel(&stage, job->tiles, scatteri_render_tile, job);
}

SCATTER_API float scatter_log_average(const float *rgb, size_t pixels)
{
    double sum = 0.0;
    size_t bright = 0, i;
    for (i = 0; i < pixels; i++) {
        const float l = scatteri_luminance(scatteri_v3(rgb[3 * i], rgb[3 * i + 1], rgb[3 * i + 2]));
        if (l > 0.0f && l <= FLT_MAX) {
            sum += log((double)l);
            bright++;
        }
    }
    return bright > 0 ? (float)exp(sum / (double)bright) : 0.0f;
}

SCATTER_API void scatter_tone_map(const scatter_tone *tone, const float *rgb, size_t pixels,
                                  float *out)
{
    const float key = tone != NULL && tone->key > 0.0f ? tone->key : 0.18f;
    const float white = tone != NULL ? tone->white : 0.0f;
    const float given = tone != NULL ? tone->log_average : 0.0f;
    const float average = given > 0.0f ? given : scatter_log_average(rgb, pixels);
    const float scale = average > 0.0f ? key / average : 0.0f;
    size_t i;
    for (i = 0; i < pixels; i++) {
        const scatter_vec3 in =
            scatteri_scale(scatteri_v3(rgb[3 * i], rgb[3 * i + 1], rgb[3 * i + 2]), scale);
        const float l = scatteri_luminance(in);
        const float gain = l > 0.0f ? scatteri_reinhard(l, white) / l : 1.0f;
        scatteri_put(out, i, scatteri_scale(in, gain));
    }
}

SCATTER_API unsigned char scatter_srgb8(float linear)
{
    const double v = linear > 0.0f ? (linear < 1.0f ? (double)linear : 1.0) : 0.0;
    const double s = v <= 0.0031308 ? 12.92 * v : 1.055 * pow(v, 1.0 / 2.4) - 0.055;
    return (unsigned char)(255.0 * s + 0.5);
}

static scatter_view scatteri_view_of(scatter_vec3 eye, scatter_vec3 target, scatter_vec3 up,
                                     float half_height, float aspect, int perspective)
{
    const scatter_vec3 forward = scatteri_unit(scatteri_sub(target, eye));
    const scatter_vec3 side = scatteri_cross(forward, scatteri_unit(up));
    const scatter_vec3 right =
        scatteri_unit(scatteri_dot(side, side) > 1e-12f ? side : scatteri_perpendicular(forward));
    const scatter_vec3 above = scatteri_cross(right, forward), none = {0.0f, 0.0f, 0.0f};
    const scatter_vec3 dx = scatteri_scale(right, 2.0f * half_height * aspect);
    const scatter_vec3 dy = scatteri_scale(above, -2.0f * half_height);
    const scatter_vec3 corner = scatteri_scale(scatteri_add(dx, dy), -0.5f);
    scatter_view view;
    view.origin = perspective ? eye : scatteri_add(eye, corner);
    view.origin_dx = perspective ? none : dx;
    view.origin_dy = perspective ? none : dy;
    view.direction = perspective ? scatteri_add(forward, corner) : forward;
    view.direction_dx = perspective ? dx : none;
    view.direction_dy = perspective ? dy : none;
    return view;
}

SCATTER_API scatter_view scatter_view_perspective(scatter_vec3 eye, scatter_vec3 target,
                                                  scatter_vec3 up, float fov_y, float aspect)
{
    return scatteri_view_of(eye, target, up, (float)tan(0.5 * (double)fov_y), aspect, 1);
}

SCATTER_API scatter_view scatter_view_orthographic(scatter_vec3 eye, scatter_vec3 target,
                                                   scatter_vec3 up, float height, float aspect)
{
    return scatteri_view_of(eye, target, up, 0.5f * height, aspect, 0);
}

SCATTER_API scatter_ray scatter_view_ray(const scatter_view *view, float x, float y)
{
    scatter_ray ray;
    ray.origin = scatteri_add(view->origin, scatteri_add(scatteri_scale(view->origin_dx, x),
                                                         scatteri_scale(view->origin_dy, y)));
    ray.direction = scatteri_unit(
        scatteri_add(view->direction, scatteri_add(scatteri_scale(view->direction_dx, x),
                                                   scatteri_scale(view->direction_dy, y))));
    return ray;
}

/* -------------------------------------------------------------------------------------- >>validation
   Everything from outside is looked at here, once, before anything is changed. */

/* Names a field: array and index, or the plain member if index < 0. */
typedef struct scatteri_where {
    const scatter_host *host;
    const char *array;
    long index;
} scatteri_where;

static int scatteri_refuse(const scatteri_where *at, const char *member, float value,
                           const char *must)
{
    if (at->index < 0)
        scatteri_fail(at->host, SCATTER_BAD_ARGUMENT, "%s%s is %g, it must be %s", at->array,
                      member, (double)value, must);
    else
        scatteri_fail(at->host, SCATTER_BAD_ARGUMENT, "%s[%ld]%s is %g, it must be %s", at->array,
                      at->index, member, (double)value, must);
    return 0;
}

static int scatteri_finite(float value)
{
    return value >= -FLT_MAX && value <= FLT_MAX;
}

static int scatteri_check(const scatteri_where *at, const char *member, float value, float low,
                          float high, const char *must)
{
    return value >= low && value <= high ? 1 : scatteri_refuse(at, member, value, must);
}

static int scatteri_check_amount(const scatteri_where *at, const char *member, float value)
{
    return scatteri_check(at, member, value, 0.0f, 1e18f, "0..1e18");
}

static int scatteri_check_positive(const scatteri_where *at, const char *member, float value)
{
    return scatteri_check(at, member, value, 1e-18f, 1e18f, "1e-18..1e18");
}

static int scatteri_check_point(const scatteri_where *at, const char *member, scatter_vec3 v)
{
    const float most = 1e15f;
    return scatteri_check(at, member, v.x, -most, most, "finite, at most 1e15 m from 0") &&
           scatteri_check(at, member, v.y, -most, most, "finite, at most 1e15 m from 0") &&
           scatteri_check(at, member, v.z, -most, most, "finite, at most 1e15 m from 0");
}

static int scatteri_check_direction(const scatteri_where *at, const char *member, scatter_vec3 v)
{
    if (!scatteri_finite(v.x) || !scatteri_finite(v.y) || !scatteri_finite(v.z))
        return scatteri_refuse(
            at, member, scatteri_finite(v.x) ? scatteri_finite(v.y) ? v.z : v.y : v.x, "finite");
    return v.x != 0.0f || v.y != 0.0f || v.z != 0.0f
               ? 1
               : scatteri_refuse(at, member, 0.0f, "longer than 0");
}

static int scatteri_check_color(const scatteri_where *at, const char *member, scatter_vec3 v,
                                float most, const char *must)
{
    return scatteri_check(at, member, v.x, 0.0f, most, must) &&
           scatteri_check(at, member, v.y, 0.0f, most, must) &&
           scatteri_check(at, member, v.z, 0.0f, most, must);
}

static int scatteri_check_box(const scatteri_where *at, const char *member, scatter_box b)
{
    if (!scatteri_check_point(at, member, b.min) || !scatteri_check_point(at, member, b.max))
        return 0;
    if (!(b.max.x > b.min.x))
        return scatteri_refuse(at, member, b.max.x - b.min.x, "larger in max.x than in min.x");
    if (!(b.max.y > b.min.y))
        return scatteri_refuse(at, member, b.max.y - b.min.y, "larger in max.y than in min.y");
    return b.max.z > b.min.z
               ? 1
               : scatteri_refuse(at, member, b.max.z - b.min.z, "larger in max.z than in min.z");
}

static scatter_result scatteri_check_array(const scatteri_where *at, const char *member,
                                           const void *array, const char *number, size_t count)
{
    if (count > (size_t)INT_MAX / 64)
        return scatteri_fail(at->host, SCATTER_TOO_LARGE, "%s%s is %.0f, it must be smaller",
                             at->array, number, (double)count);
    if (count == 0 || array != NULL)
        return SCATTER_OK;
    scatteri_refuse(at, member, 0.0f, "an array: its count is not 0");
    return SCATTER_BAD_ARGUMENT;
}

/* Voxels: every value finite and not negative. */
static scatter_result scatteri_check_grid(const scatteri_where *at, const scatter_grid *g)
{
    size_t count, i;
    if (g->nx < 1 || g->ny < 1 || g->nz < 1) {
        const int least = g->nx < 1 ? g->nx : g->ny < 1 ? g->ny : g->nz;
        scatteri_refuse(at,
                        g->nx < 1   ? ".nx"
                        : g->ny < 1 ? ".ny"
                                    : ".nz",
                        (float)least, "at least 1");
        return SCATTER_BAD_ARGUMENT;
    }
    count = scatteri_bytes((size_t)g->nx, (size_t)g->ny, (size_t)g->nz, 1);
    if (count == 0)
        return scatteri_fail(at->host, SCATTER_TOO_LARGE,
                             "%s[%ld].nx * ny * nz is more than an int counts", at->array,
                             at->index);
    if (scatteri_check_array(at, ".density", g->density, "", 1) != SCATTER_OK ||
        !scatteri_check_box(at, ".box", g->box) || !scatteri_check_amount(at, ".scale", g->scale))
        return SCATTER_BAD_ARGUMENT;
    for (i = 0; i < count; i++)
        if (!(g->density[i] >= 0.0f && g->density[i] <= 1e18f)) {
            scatteri_refuse(at, ".density", g->density[i], "0..1e18 in every voxel");
            return SCATTER_BAD_ARGUMENT;
        }
    return SCATTER_OK;
}

static int scatteri_check_phase(const scatteri_where *at, const scatter_phase *phase)
{
    if ((int)phase->kind < 0 || (int)phase->kind > (int)SCATTER_PHASE_DROPLETS)
        return scatteri_refuse(at, ".phase.kind", (float)phase->kind, "one of scatter_phase_kind");
    if (phase->kind == SCATTER_PHASE_DROPLETS)
        return scatteri_check(at, ".phase.diameter_um", phase->diameter_um, 1e-3f, 50.0f,
                              "0.001..50 micrometres");
    return scatteri_check(at, ".phase.g", phase->g, -0.9999f, 0.9999f, "-0.9999..0.9999") &&
           scatteri_check_amount(at, ".phase.alpha", phase->alpha);
}

static int scatteri_check_terms(const scatter_host *host, const scatter_medium *m)
{
    scatteri_where at = {NULL, "medium.heights", 0};
    size_t i;
    at.host = host;
    for (i = 0; i < m->height_count; i++) {
        at.index = (long)i;
        if (!scatteri_check_amount(&at, ".density", m->heights[i].density) ||
            !scatteri_check(&at, ".y0", m->heights[i].y0, -1e15f, 1e15f,
                            "finite, at most 1e15 m from 0") ||
            !scatteri_check_positive(&at, ".scale", m->heights[i].scale))
            return 0;
    }
    at.array = "medium.gaussians";
    for (i = 0; i < m->gaussian_count; i++) {
        at.index = (long)i;
        if (!scatteri_check_point(&at, ".center", m->gaussians[i].center) ||
            !scatteri_check(&at, ".a", m->gaussians[i].a, 1e-12f, 1e12f, "1e-12..1e12 per metre") ||
            !scatteri_check_amount(&at, ".c", m->gaussians[i].c))
            return 0;
    }
    return 1;
}

static scatter_result scatteri_check_environment(const scatter_host *host,
                                                 const scatter_environment *map)
{
    scatteri_where at = {NULL, "map", -1};
    at.host = host;
    if (map == NULL || map->rgb == NULL)
        return scatteri_fail(host, SCATTER_BAD_ARGUMENT,
                             "map.rgb is NULL, it must hold width*height*3 floats");
    if (map->width < 1 || map->height < 1)
        return scatteri_fail(host, SCATTER_BAD_ARGUMENT, "map.%s is %d, it must be at least 1",
                             map->width < 1 ? "width" : "height",
                             map->width < 1 ? map->width : map->height);
    if (map->width > SCATTERI_MAP_EDGE || map->height > SCATTERI_MAP_EDGE ||
        scatteri_bytes((size_t)map->width, (size_t)map->height, 3, sizeof(float)) == 0)
        return scatteri_fail(host, SCATTER_TOO_LARGE,
                             "map.width or map.height is more than %d, or width * height * 3 more "
                             "than an int counts",
                             SCATTERI_MAP_EDGE);
    return scatteri_check(&at, ".scale", map->scale, 0.0f, 1e4f, "0..1e4") ? SCATTER_OK
                                                                         : SCATTER_BAD_ARGUMENT;
}

static scatter_result scatteri_check_medium(const scatter_host *host, const scatter_medium *m)
{
    scatteri_where at = {NULL, "medium", -1};
    scatteri_where grid = {NULL, "medium.grids", 0};
    scatter_result result;
    size_t i;
    at.host = grid.host = host;
    if (m == NULL)
        return scatteri_fail(host, SCATTER_BAD_ARGUMENT,
                             "medium is NULL, it must point to a scatter_medium");
    if (!scatteri_check_color(&at, ".extinction", m->extinction, 1e18f, "0..1e18") ||
        !scatteri_check_color(&at, ".albedo", m->albedo, 1.0f, "0..1") ||
        !scatteri_check_color(&at, ".emission", m->emission, 1e18f, "0..1e18") ||
        !scatteri_check_phase(&at, &m->phase) ||
        (m->bounded && !scatteri_check_box(&at, ".bounds", m->bounds)) ||
        !scatteri_check_amount(&at, ".constant", m->constant))
        return SCATTER_BAD_ARGUMENT;
    result = scatteri_check_array(&at, ".heights", m->heights, ".height_count", m->height_count);
    if (result == SCATTER_OK)
        result = scatteri_check_array(&at, ".gaussians", m->gaussians, ".gaussian_count",
                                      m->gaussian_count);
    if (result == SCATTER_OK)
        result = scatteri_check_array(&at, ".grids", m->grids, ".grid_count", m->grid_count);
    if (result == SCATTER_OK && !scatteri_check_terms(host, m))
        result = SCATTER_BAD_ARGUMENT;
    for (i = 0; i < m->grid_count && result == SCATTER_OK; i++) {
        grid.index = (long)i;
        result = scatteri_check_grid(&grid, &m->grids[i]);
    }
    return result;
}

static int scatteri_check_light(const scatteri_where *at, const scatter_light *light)
{
    const float pi = 3.1415928f;
    if ((int)light->kind < 0 || (int)light->kind > (int)SCATTER_LIGHT_DIRECTIONAL)
        return scatteri_refuse(at, ".kind", (float)light->kind, "one of scatter_light_kind");
    if (!scatteri_check_color(at, ".intensity", light->intensity, 1e18f, "0..1e18") ||
        (light->kind != SCATTER_LIGHT_POINT &&
         !scatteri_check_direction(at, ".direction", light->direction)) ||
        (light->kind != SCATTER_LIGHT_DIRECTIONAL &&
         (!scatteri_check_point(at, ".position", light->position) ||
          !scatteri_check_amount(at, ".radius", light->radius))))
        return 0;
    return light->kind != SCATTER_LIGHT_SPOT ||
           (scatteri_check(at, ".outer", light->outer, 0.0f, pi, "0..pi") &&
            scatteri_check(at, ".inner", light->inner, 0.0f, light->outer, "0..outer"));
}

static int scatteri_check_quality(const scatter_host *host, const scatter_quality *q)
{
    scatteri_where at = {NULL, "quality", -1};
    at.host = host;
    if ((int)q->depth < 0 || (int)q->depth > (int)SCATTER_DEPTH_MARCH)
        return scatteri_refuse(&at, ".depth", (float)q->depth, "one of scatter_depth_method");
    if ((int)q->density < 0 || (int)q->density > (int)SCATTER_DENSITY_VOLUME)
        return scatteri_refuse(&at, ".density", (float)q->density, "one of scatter_density_method");
    if ((int)q->ray < 0 || (int)q->ray > (int)SCATTER_RAY_MARCH)
        return scatteri_refuse(&at, ".ray", (float)q->ray, "one of scatter_ray_method");
    if (q->nodes < 0 ||
        q->nodes > (q->ray == SCATTER_RAY_MARCH ? (int)SCATTERI_STEPS : (int)SCATTERI_NODES))
        return scatteri_refuse(&at, ".nodes", (float)q->nodes,
                               "1..256 for quadrature, 1..4096 for the march, or 0");
    if (q->grid != 0 && (q->grid < 2 || q->grid > 1024))
        return scatteri_refuse(&at, ".grid", (float)q->grid, "2..1024, or 0");
    if (q->lights_per_update < 0)
        return scatteri_refuse(&at, ".lights_per_update", (float)q->lights_per_update, ">= 0");
    return 1;
}

static scatter_result scatteri_check_scene(const scatter_host *host, const scatter_scene *scene)
{
    scatteri_where at = {NULL, "scene", -1};
    scatter_result result;
    size_t i;
    at.host = host;
    if (scene == NULL)
        return scatteri_fail(host, SCATTER_BAD_ARGUMENT,
                             "scene is NULL, it must point to a scatter_scene");
    result = scatteri_check_medium(host, &scene->medium);
    if (result != SCATTER_OK)
        return result;
    if (!scatteri_check_color(&at, ".background", scene->background, FLT_MAX,
                              "finite and not negative"))
        return SCATTER_BAD_ARGUMENT;
    result =
        scatteri_check_array(&at, ".lights", scene->lights, ".light_count", scene->light_count);
    if (result != SCATTER_OK)
        return result;
    at.array = "lights";
    for (i = 0; i < scene->light_count; i++) {
        at.index = (long)i;
        if (!scatteri_check_light(&at, &scene->lights[i]))
            return SCATTER_BAD_ARGUMENT;
    }
    return SCATTER_OK;
}

static int scatteri_check_hit(const scatteri_where *at, const scatter_surface *hit)
{
    return scatteri_check_amount(at, ".distance", hit->distance) &&
           scatteri_check_direction(at, ".normal", hit->normal) &&
           scatteri_check_color(at, ".albedo", hit->albedo, 1.0f, "0..1") &&
           scatteri_check_color(at, ".specular", hit->specular, 1.0f, "0..1") &&
           scatteri_check(at, ".shininess", hit->shininess, 0.0f, 1e6f, "0..1e6");
}

static scatter_result scatteri_check_volume(const scatter_host *host, const scatter_volume *v)
{
    scatteri_where at = {NULL, "volume", -1};
    at.host = host;
    if (v == NULL || v->values == NULL)
        return scatteri_fail(host, SCATTER_BAD_ARGUMENT,
                             "volume.values is NULL, it must hold nx*ny*nz floats");
    if (v->nx < 1 || v->ny < 1 || v->nz < 1) {
        const int least = v->nx < 1 ? v->nx : v->ny < 1 ? v->ny : v->nz;
        scatteri_refuse(&at,
                        v->nx < 1   ? ".nx"
                        : v->ny < 1 ? ".ny"
                                    : ".nz",
                        (float)least, "at least 1");
        return SCATTER_BAD_ARGUMENT;
    }
    if (scatteri_bytes((size_t)v->nx, (size_t)v->ny, (size_t)v->nz, sizeof(float)) == 0)
        return scatteri_fail(host, SCATTER_TOO_LARGE,
                             "volume.nx * ny * nz is more than an int counts");
    return scatteri_check_box(&at, ".box", v->box) ? SCATTER_OK : SCATTER_BAD_ARGUMENT;
}

static int scatteri_check_view(const scatter_host *host, const scatter_view *v)
{
    scatteri_where at = {NULL, "view", -1};
    at.host = host;
    if (v == NULL)
        return scatteri_refuse(&at, "", 0.0f, "a scatter_view");
    return scatteri_check_point(&at, ".origin", v->origin) &&
           scatteri_check_point(&at, ".origin_dx", v->origin_dx) &&
           scatteri_check_point(&at, ".origin_dy", v->origin_dy) &&
           scatteri_check_direction(&at, ".direction", v->direction) &&
           scatteri_check_point(&at, ".direction_dx", v->direction_dx) &&
           scatteri_check_point(&at, ".direction_dy", v->direction_dy);
}

static scatter_result scatteri_check_image(const scatter_host *host, const scatter_image *i)
{
    if (i == NULL || i->rgb == NULL)
        return scatteri_fail(host, SCATTER_BAD_ARGUMENT,
                             "image.rgb is NULL, it must hold width*height*3 floats");
    if (i->width < 1 || i->height < 1)
        return scatteri_fail(host, SCATTER_BAD_ARGUMENT, "image.%s is %d, it must be at least 1",
                             i->width < 1 ? "width" : "height",
                             i->width < 1 ? i->width : i->height);
    if (scatteri_bytes((size_t)i->width, (size_t)i->height, 3, sizeof(float)) == 0)
        return scatteri_fail(host, SCATTER_TOO_LARGE,
                             "image.width * height is more than an int counts");
    if (i->x0 < 0 || i->x1 > i->width || i->x0 >= i->x1)
        return scatteri_fail(host, SCATTER_BAD_ARGUMENT,
                             "image.x0, x1 are %d, %d, they must be 0 <= x0 < x1 <= width", i->x0,
                             i->x1);
    if (i->y0 < 0 || i->y1 > i->height || i->y0 >= i->y1)
        return scatteri_fail(host, SCATTER_BAD_ARGUMENT,
                             "image.y0, y1 are %d, %d, they must be 0 <= y0 < y1 <= height", i->y0,
                             i->y1);
    return SCATTER_OK;
}

/* -------------------------------------------------------------------------------------------- >>plan
   How wrong is an image, and what would it cost? The audit renders a sample of the image's packets (4x4 pixels) again,
   by a better twin of the quality in use: depth and density in closed form, twice the nodes (four times the steps of a
   march), four times the probes for shadows. Errors gather in few pixels, most of all next to lights. So half of the
   sample is drawn evenly over the image, the rest near lights and where the picture is bright, and each packet counts
   with the inverse of its probability (Hansen and Hurwitz 1943): the mean square error has no bias.
   The plan changes the roles: a good twin is the reference, and ever dearer settings are tried against it. */

enum {
    SCATTERI_PICKS = 256,      /* packets in a sample at most */
    SCATTERI_LEAST = 8,        /* draws without which no estimate is trusted, */
    SCATTERI_LEAST_SHAFTS = 64 /* and where geometry throws shafts */
};

/* What the audit may cost, of the image; 0.3 are promised, the rest is for weights that are not exact. */
#define SCATTERI_AUDIT_SHARE 0.11
/* An estimate beyond this is no longer one: the twin is in doubt as well. */
#define SCATTERI_ASTRAY 0.2f

/* One packet of the sample. */
typedef struct scatteri_pick {
    int x, y;           /* its first pixel */
    int times;          /* how often it was drawn */
    double probability; /* of one draw */
    double square, sum; /* over pixels and channels: squared difference, and value */
    double work[SCATTERI_WORKS];
} scatteri_pick;

typedef struct scatteri_audit {
    scatteri_picture job;        /* of the twin; image.rgb holds what is compared with */
    int rendered;                /* the image holds a picture, not only what is compared with */
    double nearness, brightness; /* to lights, of the picture: sums over all packets */
    int packets;                 /* of the image */
    double half;                 /* of a packet's width, per metre of distance */
    int least;                   /* draws without which no estimate is trusted */
    int first, count;            /* picks: those before `first` are done */
    double draws;
    scatteri_pick picks[SCATTERI_PICKS];
} scatteri_audit;

/* --- the sample --- */

/* How near a ray passes a local light, 1 at it; half: half a packet's width, per metre of distance. */
static double scatteri_nearness_to(const scatteri_light *light, scatter_vec3 origin,
                                   scatter_vec3 direction, double half)
{
    const scatter_vec3 to = scatteri_sub(light->desc.position, origin);
    const double ahead = (double)scatteri_max(scatteri_dot(to, direction), 0.0f);
    const double along2 = ahead * ahead / ((double)scatteri_dot(direction, direction) + 1e-30);
    const double w2 = along2 * half * half;
    const double share = w2 / (w2 + fabs((double)scatteri_dot(to, to) - along2) + 1e-30);
    return light->source.directional ? 0.0 : share * share;
}

static double scatteri_nearness(const scatteri_audit *audit, int x, int y)
{
    const scatteri_picture *job = &audit->job;
    const scatter_view *v = &job->view;
    const float a = ((float)x + 0.5f * (float)SCATTERI_SIDE) / (float)job->image.width;
    const float b = ((float)y + 0.5f * (float)SCATTERI_SIDE) / (float)job->image.height;
    const scatter_vec3 origin =
        scatteri_along(scatteri_along(v->origin, v->origin_dx, a), v->origin_dy, b);
    const scatter_vec3 direction =
        scatteri_along(scatteri_along(v->direction, v->direction_dx, a), v->direction_dy, b);
    double sum = 0.0;
    int i;
    for (i = 0; i < job->context->light_count; i++)
        sum += scatteri_nearness_to(&job->context->lights[i], origin, direction, audit->half);
    return sum;
}

/* Of the picture in a packet, from its diagonal; 0 if there is no picture yet. */
static double scatteri_brightness(const scatteri_audit *audit, int x, int y)
{
    const scatter_image *image = &audit->job.image;
    double sum = 0.0;
    int i;
    for (i = 0; i < SCATTERI_SIDE && audit->rendered; i++) {
        const int px = scatteri_clamp_int(x + i, image->x0, image->x1 - 1);
        const int py = scatteri_clamp_int(y + i, image->y0, image->y1 - 1);
        const float *rgb = image->rgb + 3 * ((size_t)py * (size_t)image->width + (size_t)px);
        const float bright = rgb[0] + rgb[1] + rgb[2];
        sum += bright > 0.0f && bright < SCATTERI_FAR ? (double)bright : 0.0;
    }
    return sum;
}

/* `rendered`: the image holds a picture, whose bright packets are drawn more often. */
static void scatteri_begin_audit(scatteri_audit *audit, const scatteri_picture *job, int rendered)
{
    const scatter_image *image = &job->image;
    int x, y;
    audit->job = *job;
    audit->rendered = rendered;
    /* errors of shafts that geometry throws lie along lines: few packets miss them */
    audit->least = job->context->scene.visible != NULL ? SCATTERI_LEAST_SHAFTS : SCATTERI_LEAST;
    audit->half = 0.25 * (double)SCATTERI_SIDE *
                  ((double)scatteri_length(job->view.direction_dx) / image->width +
                   (double)scatteri_length(job->view.direction_dy) / image->height);
    audit->nearness = audit->brightness = audit->draws = 0.0;
    audit->first = audit->count = audit->packets = 0;
    for (y = image->y0 - image->y0 % SCATTERI_SIDE; y < image->y1; y += SCATTERI_SIDE)
        for (x = image->x0 - image->x0 % SCATTERI_SIDE; x < image->x1; x += SCATTERI_SIDE) {
            audit->nearness += scatteri_nearness(audit, x, y);
            audit->brightness += scatteri_brightness(audit, x, y);
            audit->packets++;
        }
}

/* Draws `draws` packets: at even distances of the running sum of their probabilities, so they spread over the image. */
static void scatteri_draw(scatteri_audit *audit, int draws)
{
    const scatter_image *image = &audit->job.image;
    const double even = audit->packets, some = audit->rendered ? 0.5 * even : even;
    const double nearby = some / scatteri_larger(audit->nearness, 1.0);
    const double bright = audit->brightness > 0.0 ? some / audit->brightness : 0.0;
    const double all = even + nearby * audit->nearness + bright * audit->brightness;
    const double step = all / draws;
    double running = 0.0, next = 0.5 * step;
    int x, y, times;
    audit->draws += draws;
    for (y = image->y0 - image->y0 % SCATTERI_SIDE; y < image->y1; y += SCATTERI_SIDE)
        for (x = image->x0 - image->x0 % SCATTERI_SIDE; x < image->x1; x += SCATTERI_SIDE) {
            const double share = 1.0 + nearby * scatteri_nearness(audit, x, y) +
                                 bright * scatteri_brightness(audit, x, y);
            running += share;
            for (times = 0; running > next; times++)
                next += step;
            if (times > 0 && audit->count < SCATTERI_PICKS) {
                scatteri_pick *pick = &audit->picks[audit->count++];
                pick->x = x;
                pick->y = y;
                pick->times = times;
                pick->probability = share / all;
            }
        }
}

/* Adds a pixel that speaks for `count`, and what the image holds there. */
static void scatteri_compare(scatteri_pick *pick, scatter_vec3 rgb, const float *had, int count)
{
    const double r = (double)rgb.x, g = (double)rgb.y, b = (double)rgb.z;
    const double dr = r - (double)had[0], dg = g - (double)had[1], db = b - (double)had[2];
    pick->square += count * (dr * dr + dg * dg + db * db);
    pick->sum += count * (r + g + b);
}

/* Renders a pick and compares it with the image. Voxels cost much in closed form: then one pixel speaks for the
   packet. */
static void scatteri_try_pick(void *data, int index)
{
    scatteri_audit *audit = (scatteri_audit *)data;
    scatteri_pick *pick = &audit->picks[audit->first + index];
    const scatteri_picture *job = &audit->job;
    scatteri_seen seen;
    scatteri_eye eye;
    int l;
    eye.context = job->context;
    scatteri_see(job, pick->x, pick->y, &eye, &seen);
    memcpy(pick->work, eye.nodes.work, sizeof pick->work);
    pick->square = pick->sum = 0.0;
    for (l = 0; l < SCATTERI_LANES; l++)
        if (seen.counts[l] > 0)
            scatteri_compare(pick, seen.rgb[l], job->image.rgb + 3 * seen.at[l], seen.counts[l]);
}

/* --- what the sample says --- */

/* How many packets of the image a pick speaks for. */
static double scatteri_weight(const scatteri_audit *audit, const scatteri_pick *pick)
{
    return pick->times / (audit->draws * pick->probability);
}

static double scatteri_values(const scatter_image *i)
{
    return 3.0 * (i->x1 - i->x0) * (i->y1 - i->y0);
}

/* Variance of the sum of squared errors. A packet that is drawn for sure adds none. */
static double scatteri_variance(const scatteri_audit *audit)
{
    double mean = 0.0, variance = 0.0, chance = 0.0;
    int i, pass;
    for (pass = 0; pass < 2; pass++)
        for (i = 0; i < audit->count; i++) {
            const scatteri_pick *pick = &audit->picks[i];
            const double expected = audit->draws * pick->probability;
            const double value = pick->square / expected;
            if (expected >= 1.0)
                continue;
            if (pass == 0) {
                mean += value;
                chance += 1.0;
            } else {
                variance += (1.0 - expected) * (value - mean / chance) * (value - mean / chance);
            }
        }
    return chance > 1.0 ? variance * chance / (chance - 1.0) : variance;
}

static scatter_estimate scatteri_judge(const scatteri_audit *audit)
{
    double square = 0.0, sum = 0.0;
    scatter_estimate estimate = {0.0f, 0.0f, 0};
    int i;
    for (i = 0; i < audit->count; i++) {
        const scatteri_pick *pick = &audit->picks[i];
        square += scatteri_weight(audit, pick) * pick->square;
        sum += scatteri_weight(audit, pick) * pick->sum;
    }
    if (sum > 0.0)
        estimate.error = (float)(sqrt(square * scatteri_values(&audit->job.image)) / sum);
    if (square > 0.0)
        estimate.uncertainty =
            (float)(0.5 * sqrt(scatteri_variance(audit)) / square) * estimate.error;
    estimate.trusted = audit->draws >= audit->least && estimate.error < SCATTERI_ASTRAY &&
                       estimate.uncertainty <= 0.5f * estimate.error + 1e-5f;
    return estimate;
}

/* Work on the whole image, as far as the sample tells. */
static void scatteri_sum_work(const scatteri_audit *audit, double *work)
{
    int i, k;
    for (k = 0; k < SCATTERI_WORKS; k++)
        work[k] = 0.0;
    for (i = 0; i < audit->count; i++)
        for (k = 0; k < SCATTERI_WORKS; k++)
            work[k] += scatteri_weight(audit, &audit->picks[i]) * audit->picks[i].work[k];
}

/* --- the estimate of a rendered image --- */

/* Whether a ray of the sample had more features than nodes. */
static int scatteri_strained(const scatteri_audit *audit)
{
    int i, strained = 0;
    for (i = 0; i < audit->count; i++)
        strained |= audit->picks[i].work[SCATTERI_WORK_STRAIN] > 0.0;
    return strained;
}

/* Whether a volume's cells are five times as wide as a Gaussian that matters: a sample may well have missed it. */
static int scatteri_too_coarse(const scatter_context *c)
{
    const scatter_vec3 size = scatteri_sub(c->medium.local.max, c->medium.local.min);
    const float cell = scatteri_max(size.x, scatteri_max(size.y, size.z)) / (float)c->quality.grid;
    const scatteri_gaussians *g = &c->medium.gaussians;
    int i;
    if (c->exact && c->quality.depth == SCATTER_DEPTH_CLOSED)
        return 0;
    for (i = 0; i < g->count; i++)
        if (g->a[i] * cell > 5.0f && c->medium.sigma_most * g->c[i] > 1e-3f * g->a[i])
            return 1;
    return 0;
}

/* Nanoseconds of the image, from the tiles that were counted. */
static double scatteri_image_cost(const scatteri_picture *job)
{
    const int counted = (job->tiles - 1) / job->stride + 1;
    double sum = 0.0;
    int i;
    for (i = 0; i < counted; i++)
        sum += job->costs[i];
    return sum * job->tiles / counted;
}

static void scatteri_make_twin(const scatter_context *c, scatter_context *twin)
{
    const int march = c->quality.ray == SCATTER_RAY_MARCH;
    *twin = *c;
    twin->twin = 1;
    twin->quality.nodes = scatteri_clamp_int(c->quality.nodes * (march ? 4 : 2), 1, SCATTERI_STEPS);
    twin->trim.rays = twin->trim.depth = 0.0f;
    twin->exact = 1;
    twin->fields = c->medium.fields;
    twin->field_count = (int)c->medium.desc.grid_count;
}

/* Nanoseconds that the sample took. Voxels on the way to lights were crossed by one ray only of a sparse packet, which
   costs about an eighth of 16. */
static double scatteri_sample_cost(const scatteri_audit *audit)
{
    const double crossed = audit->job.sparse ? 0.125 : 1.0;
    double sum = 0.0;
    int i;
    for (i = 0; i < audit->count; i++) {
        double work[SCATTERI_WORKS];
        memcpy(work, audit->picks[i].work, sizeof work);
        work[SCATTERI_WORK_CROSSING] *= crossed;
        sum += scatteri_cost(work);
    }
    return sum;
}

/* How many packets may be drawn next: those so far tell what one costs, but may have met nothing but sky, so their
   number is doubled at most. */
static int scatteri_affordable(const scatteri_audit *audit, double image_cost)
{
    const double spent = scatteri_larger(scatteri_sample_cost(audit), 1.0);
    const double share = (SCATTERI_AUDIT_SHARE * image_cost - spent) * audit->count / spent;
    const int room = SCATTERI_PICKS - audit->count;
    return (int)scatteri_smaller(share, room < audit->count ? room : audit->count);
}

/* A first small draw tells the cost of a twin packet, more follow until the share is spent. */
static scatter_result scatteri_audit_image(const scatteri_picture *job)
{
    const scatteri_stage stage = {&job->context->host, 1.0f, 1.0f};
    scatter_context twin;
    scatteri_audit audit;
    scatter_result result = SCATTER_OK;
    int draws;
    scatteri_make_twin(job->context, &twin);
    scatteri_begin_audit(&audit, job, 1);
    audit.job.context = &twin;
    audit.job.sparse = twin.field_count > 0;
    draws = scatteri_clamp_int(audit.packets / 64, 1, 8);
    while (draws > 0 && result == SCATTER_OK) {
        audit.first = audit.count;
        scatteri_draw(&audit, draws);
        result = scatteri_parallel(&stage, audit.count - audit.first, scatteri_try_pick, &audit);
        draws = scatteri_affordable(&audit, scatteri_image_cost(job));
    }
    if (result != SCATTER_OK)
        return result;
    *job->image.estimate = scatteri_judge(&audit);
    job->image.estimate->trusted &=
        !scatteri_strained(&audit) && !scatteri_too_coarse(job->context);
    return SCATTER_OK;
}

/* --- the search --- */

/* Settings of one kind of ray in order of cost. */
enum { SCATTERI_LADDER = 9, SCATTERI_GRIDS = 7 };
static const int scatteri_ladder[2][SCATTERI_LADDER] = {{4, 6, 8, 12, 16, 24, 32, 48, 64},
                                                        {8, 16, 32, 48, 64, 96, 128, 256, 512}};
static const int scatteri_grids[SCATTERI_GRIDS] = {32, 48, 64, 96, 128, 192, 256};

/* Nodes of the reference, doubled by its being a twin. */
#define SCATTERI_BEST_NODES 32

typedef struct scatteri_planner {
    scatter_host host; /* of the caller; that of the context reports no progress */
    int pilots;
    scatter_context *context;
    const scatter_scene *scene;
    float budget;
    double spent; /* ns, so far */
    scatter_forecast best;
    double best_cost;            /* ns, of setup and one image; 0: none yet */
    double work[SCATTERI_WORKS]; /* of the image, by the last pilot */
    scatteri_audit audit;
} scatteri_planner;

/* Whether a setting surely costs more than one that keeps the budget. */
static int scatteri_too_dear(const scatteri_planner *p, double cost)
{
    return p->best.kept && cost >= p->best_cost;
}

/* Gaussians that reach 16 columns of a volume. */
static int scatteri_count_column(const scatter_context *c, const scatter_depth *d, int i, int j,
                                 scatteri_shells *shells)
{
    const scatteri_gaussians *g = &c->medium.gaussians;
    scatteri_slabs slabs;
    int sum = 0;
    scatteri_columns(d, i, j, &shells->rays);
    scatteri_cut_columns(d, &shells->rays);
    slabs = scatteri_slabs_of_rays(&shells->rays);
    shells->page.trim.rays = shells->page.trim.depth = 0.0f;
    for (shells->page.next = 0; shells->page.next < g->padded; sum += shells->page.count)
        scatteri_gather(g, &shells->rays, &slabs, shells->page.next, &shells->page);
    return sum;
}

/* Adds the work of filling a volume, from a sample of its columns. What does not fit into one page is gathered again
   for every 16 shells; voxels are sampled several times on the way from shell to shell. */
static void scatteri_count_columns(const scatter_context *c, const scatteri_light *light, int n,
                                   double *work)
{
    scatter_depth d = light->depth;
    double pairs = 0.0, pages = 0.0, gathers = 0.0, share;
    scatteri_shells shells;
    int i, rows;
    d.medium = &c->medium;
    d.source = light->source;
    d.method = SCATTER_DEPTH_POLAR;
    scatteri_lay_out(&d, n);
    rows = (d.nx - 1) / SCATTERI_LANES + 1;
    for (i = 0; i < SCATTERI_SAMPLED; i++) {
        const int j = (2 * i + 1) * d.ny / (2 * SCATTERI_SAMPLED);
        const int found = scatteri_count_column(c, &d, i * 7 % rows * SCATTERI_LANES, j, &shells);
        const double again = found > SCATTERI_PAGE ? (double)((d.nz - 1) / SCATTERI_ROWS + 1) : 1.0;
        pairs += (double)found * d.nz;
        pages += found * again;
        gathers += again;
    }
    share = (double)rows * d.ny / (double)SCATTERI_SAMPLED;
    work[SCATTERI_WORK_TEST] += share * gathers * scatteri_tests(&c->medium.gaussians);
    work[SCATTERI_WORK_PAGE] += share * pages;
    work[SCATTERI_WORK_GAUSSIAN] += share * pairs;
    work[SCATTERI_WORK_CELL] +=
        (double)rows * d.ny * d.nz * (1.0 + 10.0 * (double)c->medium.desc.grid_count);
}

static int scatteri_count_directional(const scatter_context *c)
{
    int count = 0, i;
    for (i = 0; i < c->light_count; i++)
        count += c->lights[i].source.directional;
    return count;
}

/* Adds the work of filling polar volumes and the lattice of all lights. */
static void scatteri_count_lights(const scatter_context *c, int n, double *work)
{
    const int suns = scatteri_count_directional(c);
    scatteri_lattice lattice;
    double points;
    int i;
    for (i = 0; i < c->light_count; i++)
        if (!c->lights[i].source.directional)
            scatteri_count_columns(c, &c->lights[i], n, work);
    if (suns == 0)
        return;
    scatteri_lay_lattice(&lattice, c->medium.local, n);
    points = (double)scatteri_lattice_points(&lattice) / (double)SCATTERI_LANES;
    work[SCATTERI_WORK_CELL] += points * (1.0 + 10.0 * (double)c->medium.desc.grid_count);
    work[SCATTERI_WORK_POINT] += points * suns;
}

/* Nanoseconds of scatter_update in a fresh context, without what all settings share. */
static double scatteri_setup_cost(const scatter_context *c, const scatter_quality *q)
{
    const double n = (double)q->nodes;
    double work[SCATTERI_WORKS] = {0.0};
    if (q->ray == SCATTER_RAY_QUADRATURE)
        work[SCATTERI_WORK_RULE] = n * n;
    if (q->depth == SCATTER_DEPTH_POLAR)
        scatteri_count_lights(c, q->grid, work);
    if (q->density == SCATTER_DENSITY_VOLUME)
        work[SCATTERI_WORK_CELL] += (double)q->grid * q->grid * q->grid / (double)SCATTERI_LANES;
    return scatteri_cost(work);
}

/* Tells the host that something was done; it may cancel. How much is left nobody knows. */
static scatter_result scatteri_report(scatteri_planner *p)
{
    const float fraction = 1.0f - 4.0f / (4.0f + (float)p->pilots);
    p->pilots++;
    if (p->host.progress != NULL && p->host.progress(p->host.user, fraction) != 0)
        return scatteri_fail(&p->host, SCATTER_CANCELLED, "host.progress cancelled");
    return SCATTER_OK;
}

static void scatteri_render_pick(void *data, int index)
{
    scatteri_audit *audit = (scatteri_audit *)data;
    scatteri_pick *pick = &audit->picks[index];
    scatteri_eye eye;
    scatteri_render_packet(&audit->job, pick->x, pick->y, &eye);
    memcpy(pick->work, eye.nodes.work, sizeof pick->work);
}

/* Draws the sample and puts the reference into the image. */
static scatter_result scatteri_prepare_sample(scatteri_planner *p, const scatteri_picture *job)
{
    const scatteri_stage stage = {&p->context->host, 1.0f, 1.0f};
    scatter_quality quality;
    scatter_result result = scatteri_report(p);
    memset(&quality, 0, sizeof quality);
    quality.depth = SCATTER_DEPTH_CLOSED;
    quality.density = SCATTER_DENSITY_EXACT;
    quality.nodes = SCATTERI_BEST_NODES;
    if (result == SCATTER_OK)
        result = scatter_update(p->context, p->scene, &quality);
    if (result != SCATTER_OK)
        return result;
    p->context->twin = 1;
    p->context->quality.nodes *= 2;
    scatteri_begin_audit(&p->audit, job, 0);
    p->audit.job.sparse = p->context->field_count > 0;
    scatteri_draw(&p->audit, scatteri_clamp_int(p->audit.packets / 4, 32, SCATTERI_PICKS));
    result = scatteri_parallel(&stage, p->audit.count, scatteri_render_pick, &p->audit);
    p->spent += scatteri_sample_cost(&p->audit);
    return result;
}

/* Renders the sample with these settings and compares it with the reference, which the image holds. */
static scatter_result scatteri_pilot(scatteri_planner *p, const scatter_quality *quality,
                                     scatter_forecast *out)
{
    const scatteri_stage stage = {&p->context->host, 1.0f, 1.0f};
    double setup;
    scatter_result result = scatteri_report(p);
    if (result == SCATTER_OK)
        result = scatter_update(p->context, p->scene, quality);
    if (result != SCATTER_OK)
        return result;
    result = scatteri_parallel(&stage, p->audit.count, scatteri_try_pick, &p->audit);
    if (result != SCATTER_OK)
        return result;
    scatteri_sum_work(&p->audit, p->work);
    setup = scatteri_setup_cost(p->context, quality);
    out->quality = *quality;
    out->estimate = scatteri_judge(&p->audit);
    out->estimate.trusted &= !scatteri_too_coarse(p->context);
    out->kept = out->estimate.error + 2.0f * out->estimate.uncertainty <= p->budget;
    out->setup_ms = (float)(1e-6 * setup);
    out->image_ms = (float)(1e-6 * scatteri_cost(p->work));
    p->spent += setup + scatteri_sample_cost(&p->audit);
    return SCATTER_OK;
}

/* Takes a setting if it is the cheapest that keeps the budget, or the most accurate as long as none does. */
static void scatteri_consider(scatteri_planner *p, const scatter_forecast *f)
{
    const double cost = 1e6 * ((double)f->setup_ms + (double)f->image_ms);
    const int better = p->best.kept ? f->kept && cost < p->best_cost
                                    : f->kept || f->estimate.error < p->best.estimate.error;
    if (p->best_cost > 0.0 && !better)
        return;
    p->best = *f;
    p->best_cost = cost;
}

/* Nanoseconds of an image if its depths came from volumes; directional lights are read together, if more than one is and
   nothing cuts the rays for each. */
static double scatteri_volume_cost(const scatteri_planner *p, const double *work)
{
    const scatter_context *c = p->context;
    const int suns = scatteri_count_directional(c);
    const int together = suns > 1 && c->scene.visible == NULL && !c->medium.has_analytic;
    const double share = together ? (double)suns / c->light_count : 0.0;
    double with[SCATTERI_WORKS];
    memcpy(with, work, sizeof with);
    with[SCATTERI_WORK_SHADOW] = with[SCATTERI_WORK_CROSSING] = 0.0;
    with[SCATTERI_WORK_TEST] = with[SCATTERI_WORK_GATHER] = 0.0;
    with[SCATTERI_WORK_TOGETHER] = share / (double)SCATTERI_TOGETHER * with[SCATTERI_WORK_LIGHT];
    with[SCATTERI_WORK_LIGHT] *= 1.0 - share;
    with[SCATTERI_WORK_READ] = with[SCATTERI_WORK_LIGHT];
    return scatteri_cost(with);
}

/* Depth in closed form with ever more nodes, until the budget is kept, or more nodes do not help, or what follows is
   too dear even if volumes replace the closed form. Returns the step in *kept, or -1. */
static scatter_result scatteri_climb(scatteri_planner *p, scatter_quality *quality, int *kept)
{
    float before = FLT_MAX;
    int i, stuck = 0;
    *kept = -1;
    for (i = 0; i < SCATTERI_LADDER && *kept < 0 && stuck < 2; i++) {
        scatter_forecast f;
        scatter_result result;
        quality->nodes = scatteri_ladder[quality->ray == SCATTER_RAY_MARCH][i];
        result = scatteri_pilot(p, quality, &f);
        if (result != SCATTER_OK)
            return result;
        scatteri_consider(p, &f);
        *kept = f.kept ? i : -1;
        stuck = before < SCATTERI_ASTRAY && f.estimate.error > 0.95f * before ? stuck + 1 : 0;
        before = f.estimate.error;
        if (scatteri_too_dear(p, scatteri_volume_cost(p, p->work)))
            break;
    }
    return SCATTER_OK;
}

/* Depth in volumes of ever more cells, with the nodes that closed form needed. Grids that are too coarse even if errors
   fall with the square of the cells are left out. */
static scatter_result scatteri_try_volumes(scatteri_planner *p, scatter_quality quality)
{
    const double rays = scatteri_volume_cost(p, p->work);
    float need = 0.0f;
    int i;
    quality.depth = SCATTER_DEPTH_POLAR;
    for (i = 0; i < SCATTERI_GRIDS; i++) {
        scatter_forecast f;
        scatter_result result;
        quality.grid = scatteri_grids[i];
        if ((float)quality.grid < need)
            continue;
        if (scatteri_too_dear(p, rays + scatteri_setup_cost(p->context, &quality)))
            break;
        result = scatteri_pilot(p, &quality, &f);
        if (result != SCATTER_OK)
            return result;
        scatteri_consider(p, &f);
        if (f.kept)
            break;
        need = (float)quality.grid * scatteri_sqrt(f.estimate.error / p->budget);
    }
    return SCATTER_OK;
}

static scatter_result scatteri_search(scatteri_planner *p, scatter_density_method density)
{
    scatter_result result = SCATTER_OK;
    int ray, kept;
    for (ray = 0; ray < 2 && result == SCATTER_OK; ray++) {
        scatter_quality quality;
        memset(&quality, 0, sizeof quality);
        quality.depth = SCATTER_DEPTH_CLOSED;
        quality.density = density;
        quality.ray = ray ? SCATTER_RAY_MARCH : SCATTER_RAY_QUADRATURE;
        quality.grid = scatteri_choose_grid(0, &p->scene->medium, 0);
        result = scatteri_climb(p, &quality, &kept);
        if (result == SCATTER_OK && kept >= 0 && p->context->medium.has_local)
            result = scatteri_try_volumes(p, quality);
    }
    return result;
}

/* The reference, then all that is worth trying. */
static scatter_result scatteri_plan(scatteri_planner *p, const scatteri_picture *job)
{
    scatter_result result = scatteri_prepare_sample(p, job);
    int strained, many;
    if (result != SCATTER_OK)
        return result;
    many = p->scene->medium.gaussian_count > 2048;
    strained = scatteri_strained(&p->audit);
    if (many)
        result = scatteri_search(p, SCATTER_DENSITY_VOLUME);
    if (result == SCATTER_OK && (!many || !p->best.kept))
        result = scatteri_search(p, SCATTER_DENSITY_EXACT);
    p->best.estimate.trusted &= !strained;
    p->best.planning_ms = (float)(1e-6 * p->spent);
    if (result == SCATTER_OK && p->host.progress != NULL)
        (void)p->host.progress(p->host.user, 1.0f);
    return result;
}

/* ------------------------------------------------------------------------------------------ >>public */

SCATTER_API scatter_vec3 scatter_v3(float x, float y, float z)
{
    return scatteri_v3(x, y, z);
}

SCATTER_API scatter_result scatter_inject(const scatter_host *host, const scatter_medium *medium,
                                          const scatter_volume *volume)
{
    const scatter_host h = scatteri_host_or_default(host);
    scatteri_stage stage = {NULL, 0.0f, 1.0f};
    scatter_result result = scatteri_check_medium(&h, medium);
    if (result == SCATTER_OK)
        result = scatteri_check_volume(&h, volume);
    stage.host = &h;
    return result == SCATTER_OK ? scatteri_inject(&stage, medium, volume, 1) : result;
}

static scatter_quality scatteri_resolve(const scatter_quality *quality,
                                        const scatter_medium *medium, size_t directional)
{
    scatter_quality q;
    memset(&q, 0, sizeof q);
    if (quality != NULL)
        q = *quality;
    q.depth = scatteri_choose_depth(q.depth, medium);
    if (q.density == SCATTER_DENSITY_AUTO)
        q.density = medium->gaussian_count <= 2048 ? SCATTER_DENSITY_EXACT : SCATTER_DENSITY_VOLUME;
    q.nodes = q.nodes != 0 ? q.nodes : 16;
    q.grid = scatteri_choose_grid(q.grid, medium, q.depth == SCATTER_DEPTH_POLAR ? directional : 0);
    return q;
}

static scatter_source scatteri_unit_source(const scatter_source *source)
{
    scatter_source s = *source;
    s.directional = s.directional != 0;
    if (s.directional)
        s.direction = scatteri_unit(s.direction);
    return s;
}

/* --- environments --- */

static scatter_result scatteri_check_constellation(const scatter_host *host,
                                                   const scatter_environment *map,
                                                   scatter_constellation_method method, int count,
                                                   const scatter_light *lights)
{
    const scatter_result result = scatteri_check_environment(host, map);
    if (result != SCATTER_OK)
        return result;
    if ((int)method < 0 || (int)method > (int)SCATTER_CONSTELLATION_KMEANS)
        return scatteri_fail(host, SCATTER_BAD_ARGUMENT,
                             "method is %d, it must be one of scatter_constellation_method",
                             (int)method);
    if (count < 1 || count > SCATTERI_LIGHTS)
        return scatteri_fail(host, SCATTER_BAD_ARGUMENT, "count is %d, it must be 1..256", count);
    if (lights == NULL)
        return scatteri_fail(host, SCATTER_BAD_ARGUMENT,
                             "lights is NULL, it must have room for count lights");
    return SCATTER_OK;
}

SCATTER_API scatter_result scatter_constellation(const scatter_host *host,
                                                 const scatter_environment *map,
                                                 scatter_constellation_method method, int count,
                                                 scatter_light *lights)
{
    const scatter_host h = scatteri_host_or_default(host);
    scatter_result result = scatteri_check_constellation(&h, map, method, count, lights);
    scatteri_sky sky;
    if (result != SCATTER_OK)
        return result;
    result = scatteri_open_sky(&sky, &h, map);
    if (result == SCATTER_OK && method == SCATTER_CONSTELLATION_KMEANS)
        result = scatteri_reserve_cells(&sky);
    if (result == SCATTER_OK) {
        const int suns = scatteri_take_suns(&sky, count, lights);
        if (method == SCATTER_CONSTELLATION_KMEANS)
            scatteri_kmeans(&sky, count - suns, lights + suns);
        else
            scatteri_median_cut(&sky, count - suns, lights + suns);
    }
    scatteri_close_sky(&sky);
    return result;
}

SCATTER_API void scatter_turn_lights(const scatter_light *lights, size_t count, scatter_vec3 axis,
                                     float angle, scatter_light *turned)
{
    const double x = axis.x, y = axis.y, z = axis.z, length = sqrt(x * x + y * y + z * z);
    const double sine = length > 0.0 ? sin((double)angle) : 0.0;
    const double cosine = length > 0.0 ? cos((double)angle) : 1.0;
    double k[3] = {0.0, 0.0, 0.0};
    size_t i;
    if (length > 0.0)
        k[0] = x / length, k[1] = y / length, k[2] = z / length;
    for (i = 0; i < count; i++) {
        scatter_light light = lights[i];
        if (light.kind != SCATTER_LIGHT_POINT)
            light.direction = scatteri_turn(light.direction, k, sine, cosine);
        if (light.kind != SCATTER_LIGHT_DIRECTIONAL)
            light.position = scatteri_turn(light.position, k, sine, cosine);
        turned[i] = light;
    }
}

SCATTER_API scatter_vec3 scatter_environment_radiance(const scatter_environment *map,
                                                      scatter_vec3 direction)
{
    const double x = direction.x, y = direction.y, z = direction.z;
    const double flat = sqrt(x * x + z * z);
    double u, v;
    if (!(flat + fabs(y) > 0.0))
        return scatteri_v3(0.0f, 0.0f, 0.0f);
    u = (atan2(x, -z) / (2.0 * SCATTERI_PI) + 0.5) * map->width - 0.5;
    v = atan2(flat, y) / SCATTERI_PI * map->height - 0.5;
    v = v < 0.0 ? 0.0 : v;
    v = v > map->height - 1 ? map->height - 1 : v;
    return scatteri_bilinear(map, u, v);
}

/* --- depth objects --- */

SCATTER_API scatter_result scatter_depth_create(const scatter_host *host, scatter_depth **depth)
{
    const scatter_host h = scatteri_host_or_default(host);
    if (depth == NULL)
        return scatteri_fail(&h, SCATTER_BAD_ARGUMENT,
                             "depth is NULL, it must point to where the object goes");
    *depth = (scatter_depth *)scatteri_allocate(&h, sizeof **depth);
    if (*depth == NULL)
        return scatteri_fail(&h, SCATTER_OUT_OF_MEMORY,
                             "host.allocate gave no memory for a scatter_depth");
    memset(*depth, 0, sizeof **depth);
    (*depth)->host = h;
    return SCATTER_OK;
}

static void scatteri_drop_depth(scatter_depth *depth)
{
    scatteri_drop(&depth->host, &depth->memory);
    scatteri_drop(&depth->host, &depth->own_memory);
    scatteri_drop_medium(&depth->host, &depth->own);
}

SCATTER_API void scatter_depth_destroy(scatter_depth *depth)
{
    scatter_host host;
    if (depth == NULL)
        return;
    host = depth->host;
    scatteri_drop_depth(depth);
    scatteri_release(&host, depth);
}

static scatter_result scatteri_check_source(const scatter_host *host, const scatter_source *source)
{
    scatteri_where at = {NULL, "source", -1};
    at.host = host;
    if (source == NULL)
        return scatteri_fail(host, SCATTER_BAD_ARGUMENT,
                             "source is NULL, it must point to a scatter_source");
    return (source->directional ? scatteri_check_direction(&at, ".direction", source->direction)
                                : scatteri_check_point(&at, ".position", source->position))
               ? SCATTER_OK
               : SCATTER_BAD_ARGUMENT;
}

SCATTER_API scatter_result scatter_depth_update(scatter_depth *depth, const scatter_medium *medium,
                                                const scatter_source *source,
                                                const scatter_quality *quality)
{
    scatteri_stage stage = {NULL, 0.0f, 1.0f};
    scatter_result result;
    scatter_quality q;
    if (depth == NULL)
        return SCATTER_BAD_ARGUMENT;
    stage.host = &depth->host;
    depth->ready = 0;
    result = scatteri_check_medium(&depth->host, medium);
    if (result == SCATTER_OK)
        result = scatteri_check_source(&depth->host, source);
    if (result == SCATTER_OK && quality != NULL && !scatteri_check_quality(&depth->host, quality))
        result = SCATTER_BAD_ARGUMENT;
    if (result != SCATTER_OK)
        return result;
    q = scatteri_resolve(quality, medium, 1);
    result = scatteri_prepare(&depth->host, &depth->own, medium);
    if (result == SCATTER_OK && !q.no_distance_map)
        result = scatteri_map_medium(&depth->host, &depth->own);
    if (result != SCATTER_OK)
        return result;
    depth->medium = &depth->own;
    depth->source = scatteri_unit_source(source);
    depth->method = q.depth;
    if (scatteri_reads_injected(q.depth) && depth->own.has_local) {
        depth->injected = &depth->own_injected;
        stage.high = 0.5f;
        result = scatteri_build_injected(&stage, &depth->own, q.grid,
                                         !q.no_distance_map && q.depth == SCATTER_DEPTH_MARCH,
                                         &depth->own_memory, &depth->own_injected);
        stage.low = stage.high;
        stage.high = 1.0f;
    }
    if (result == SCATTER_OK)
        result = scatteri_build_depth(&stage, depth, q.grid);
    depth->ready = result == SCATTER_OK;
    return result;
}

/* --- contexts --- */

SCATTER_API scatter_result scatter_create(const scatter_host *host, scatter_context **context)
{
    const scatter_host h = scatteri_host_or_default(host);
    if (context == NULL)
        return scatteri_fail(&h, SCATTER_BAD_ARGUMENT,
                             "context is NULL, it must point to where the object goes");
    *context = (scatter_context *)scatteri_allocate(&h, sizeof **context);
    if (*context == NULL)
        return scatteri_fail(&h, SCATTER_OUT_OF_MEMORY,
                             "host.allocate gave no memory for a scatter_context");
    memset(*context, 0, sizeof **context);
    (*context)->host = h;
    return SCATTER_OK;
}

SCATTER_API void scatter_destroy(scatter_context *c)
{
    scatter_host host;
    int i;
    if (c == NULL)
        return;
    host = c->host;
    for (i = 0; i < c->light_room; i++) {
        scatteri_drop_depth(&c->lights[i].depth);
        scatteri_drop(&host, &c->lights[i].batch);
    }
    scatteri_drop(&host, &c->lattice_memory);
    scatteri_release(&host, c->lights);
    scatteri_drop_medium(&host, &c->medium);
    scatteri_drop(&host, &c->injected_memory);
    scatteri_release(&host, c);
}

/* Room for more lights; those that are there keep their volumes. */
static scatter_result scatteri_reserve_lights(scatter_context *c, int count)
{
    scatteri_light *lights;
    if (count <= c->light_room)
        return SCATTER_OK;
    lights = (scatteri_light *)scatteri_allocate(&c->host, (size_t)count * sizeof *lights);
    if (lights == NULL)
        return scatteri_fail(&c->host, SCATTER_OUT_OF_MEMORY,
                             "host.allocate gave no memory for %d lights", count);
    memset(lights, 0, (size_t)count * sizeof *lights);
    if (c->light_room > 0)
        memcpy(lights, c->lights, (size_t)c->light_room * sizeof *lights);
    scatteri_release(&c->host, c->lights);
    c->lights = lights;
    c->light_room = count;
    return SCATTER_OK;
}

static scatter_source scatteri_source_of(const scatter_light *light)
{
    scatter_source s;
    memset(&s, 0, sizeof s);
    s.directional = light->kind == SCATTER_LIGHT_DIRECTIONAL;
    if (s.directional)
        s.direction = scatteri_unit(light->direction);
    else
        s.position = light->position;
    return s;
}

static int scatteri_same_source(const scatter_source *a, const scatter_source *b)
{
    return memcmp(&a->position, &b->position, sizeof a->position) == 0 &&
           memcmp(&a->direction, &b->direction, sizeof a->direction) == 0 &&
           a->directional == b->directional;
}

/* Takes over one light, but not its depth. */
static void scatteri_take_light(scatteri_light *light, const scatter_light *desc)
{
    light->desc = *desc;
    light->source = scatteri_source_of(desc);
    if (desc->kind != SCATTER_LIGHT_POINT)
        light->desc.direction = scatteri_unit(desc->direction);
    if (desc->kind == SCATTER_LIGHT_DIRECTIONAL)
        light->desc.radius = 0.0f;
    light->cos_inner = (float)cos((double)desc->inner);
    light->cos_outer = (float)cos((double)desc->outer);
    light->in_rim = -1;
}

/* Values of a point on the lattice: one light is read alone, the others four at a time. */
static int scatteri_stride(const scatter_context *c)
{
    return c->suns > 1 ? (int)SCATTERI_TOGETHER : 1;
}

/* Sees whether the depth of a light is out of date, or of something else altogether (then it is chosen at once). */
static void scatteri_date_light(scatter_context *c, scatteri_light *light, int slot)
{
    scatter_depth *d = &light->depth;
    const int known = d->ready && d->source.directional == light->source.directional &&
                      light->slot == slot && (slot < 0 || d->stride == scatteri_stride(c)) &&
                      (light->filled || !c->medium.has_local);
    const int same =
        known && light->medium == c->media && scatteri_same_source(&d->source, &light->source);
    light->slot = slot;
    light->chosen =
        !known ||
        (!same && (c->quality.lights_per_update == 0 || d->method == SCATTER_DEPTH_CLOSED));
    light->due = same ? 0 : light->due != 0 ? light->due : c->updates;
}

/* Slots on the lattice for directional lights, in their order, and what of all depths is out of date. */
static void scatteri_date_lights(scatter_context *c)
{
    int i, slot = 0;
    c->suns = 0;
    for (i = 0; i < c->light_count; i++)
        c->suns += scatteri_on_lattice(c->quality.depth, &c->lights[i].source);
    for (i = 0; i < c->light_count; i++) {
        const int on = scatteri_on_lattice(c->quality.depth, &c->lights[i].source);
        scatteri_date_light(c, &c->lights[i], on ? slot : -1);
        if (on)
            c->lights[slot++].resident = i;
    }
    for (; i < c->light_room; i++)
        c->lights[i].depth.ready = 0; /* others may take its slot */
}

/* Of the lights that are out of date, those that have been so for longest. */
static void scatteri_choose_lights(scatter_context *c)
{
    int left = c->quality.lights_per_update, i;
    for (; left > 0; left--) {
        scatteri_light *first = NULL;
        for (i = 0; i < c->light_count; i++) {
            scatteri_light *light = &c->lights[i];
            if (light->due != 0 && !light->chosen && (first == NULL || light->due < first->due))
                first = light;
        }
        if (first == NULL)
            return;
        first->chosen = 1;
    }
}

static void scatteri_begin_fill(scatter_context *c, scatteri_light *light)
{
    scatter_depth *d = &light->depth;
    d->ready = 0;
    d->host = c->host;
    d->medium = &c->medium;
    d->injected = &c->injected;
    d->method = c->quality.depth;
    d->source = light->source;
}

static void scatteri_end_fill(scatter_context *c, scatteri_light *light)
{
    light->depth.ready = 1;
    light->filled = c->medium.has_local;
    light->medium = c->media;
    light->due = 0;
    light->chosen = 0;
    c->stats.propagations += c->medium.has_local && light->depth.method != SCATTER_DEPTH_CLOSED;
}

/* Part `part` of an update of so many lights: the medium, then each light. */
static scatteri_stage scatteri_stage_of(const scatter_context *c, size_t lights, int part)
{
    scatteri_stage stage;
    stage.host = &c->host;
    stage.low = (float)part / (float)(lights + 1);
    stage.high = (float)(part + 1) / (float)(lights + 1);
    return stage;
}

static scatter_result scatteri_update_medium(scatter_context *c, const scatter_scene *scene)
{
    const scatteri_stage stage = scatteri_stage_of(c, scene->light_count, 0);
    const scatter_quality *q = &c->quality;
    scatter_result result = scatteri_prepare(&c->host, &c->medium, &scene->medium);
    if (result == SCATTER_OK && !q->no_distance_map)
        result = scatteri_map_medium(&c->host, &c->medium);
    c->media++;
    c->sown = 0;
    c->has_injected = c->medium.has_local && (q->density == SCATTER_DENSITY_VOLUME ||
                                              scatteri_reads_injected(q->depth));
    if (result != SCATTER_OK || !c->has_injected)
        return result;
    c->stats.injections++;
    return scatteri_build_injected(&stage, &c->medium, q->grid,
                                   !q->no_distance_map && (q->density == SCATTER_DENSITY_VOLUME ||
                                                           q->depth == SCATTER_DEPTH_MARCH),
                                   &c->injected_memory, &c->injected);
}

static void scatteri_choose_fields(scatter_context *c)
{
    c->exact = c->quality.density == SCATTER_DENSITY_EXACT;
    c->fields = c->exact ? c->medium.fields : &c->injected;
    c->field_count = c->exact ? (int)c->medium.desc.grid_count : c->has_injected;
}

/* A rule of more nodes than one panel takes stays empty. */
static void scatteri_update_rules(scatter_context *c)
{
    int r, i;
    for (r = 0; r < SCATTERI_RULES && c->quality.ray == SCATTER_RAY_QUADRATURE; r++) {
        const int n = (c->quality.nodes * (r + 1) + SCATTERI_EIGHTH - 1) / SCATTERI_EIGHTH;
        c->rules[r].count = n <= SCATTERI_NODES ? n : 0;
        for (i = 0; i < c->rules[r].count; i++) {
            const scatteri_vec2 node = scatteri_legendre(i, n);
            c->rules[r].node[i] = node.x;
            c->rules[r].weight[i] = node.y;
        }
    }
}

/* How much of the Gaussians' rims is left out, in units of a^2 r^2: the less, the more the rims can weigh beside the core
   that fills the picture, in media of large extinction and with narrow phase functions.
   Few nodes: e^-6 of a Gaussian is left out, e^-14 from 26 nodes on. What is left out of depth stays below 1e-4 of
   transmittance, since `reach` holds the Gaussian's own depth but not sigma. */
static scatteri_trim scatteri_trim_of(const scatteri_medium *medium, const scatter_quality *quality)
{
    const float dense = scatteri_log(scatteri_max(medium->sigma_most, 1.0f));
    const float peak = 12.5663706f * scatteri_phase(medium->lobes, 0.0f);
    const float sharp = scatteri_log(scatteri_max(0.4f * peak, 1.0f));
    const float few = scatteri_clamp(13.0f - 0.5f * (float)quality->nodes, 0.0f, 8.0f);
    scatteri_trim trim;
    trim.rays = scatteri_max(few - dense - sharp, 0.0f);
    if (quality->ray == SCATTER_RAY_MARCH)
        trim.rays = -4.0f; /* its mask must not be seen in the image: e^-18 */
    trim.depth = scatteri_max(trim.rays - 4.5f, 0.0f);
    return trim;
}

/* Whether a Gaussian reaches the point, but none so far that rays beside the point would be sure to count it. */
static int scatteri_in_rim(const scatteri_gaussians *g, float trim, scatter_vec3 x)
{
    int i, some = 0;
    for (i = 0; i < g->padded; i++) {
        const scatter_vec3 d = scatteri_sub(scatteri_v3(g->x[i], g->y[i], g->z[i]), x);
        const float e = g->a[i] * g->a[i] * scatteri_dot(d, d);
        some |= e < g->reach[i];
        if (e < g->reach[i] - trim - 2.0f)
            return 0;
    }
    return some && trim > 0.0f;
}

static void scatteri_update_trim(scatter_context *c)
{
    const scatteri_trim before = c->trim;
    int i;
    c->trim = scatteri_trim_of(&c->medium, &c->quality);
    for (i = 0; i < c->light_count; i++)
        if (c->lights[i].in_rim < 0 || before.rays != c->trim.rays)
            c->lights[i].in_rim =
                scatteri_in_rim(&c->medium.gaussians, c->trim.rays, c->lights[i].desc.position);
}

static int scatteri_same_lattice(const scatteri_lattice *a, const scatteri_lattice *b)
{
    return scatteri_same_box(a->box, b->box) && memcmp(a->n, b->n, sizeof a->n) == 0;
}

static int scatteri_holds(scatter_box box, scatter_box other)
{
    return scatteri_inside(box, other.min) && scatteri_inside(box, other.max);
}

/* Where lights wait for their turn the lattice stays as it is while the medium is inside: what they hold would be lost. */
static void scatteri_place_lattice(scatter_context *c)
{
    scatteri_lattice next = c->lattice;
    int i;
    if (c->quality.lights_per_update > 0 && c->lattice.n[0] > 0 &&
        scatteri_holds(c->lattice.box, c->medium.local))
        return;
    scatteri_lay_lattice(&next, c->medium.local, c->quality.grid);
    if (scatteri_same_lattice(&next, &c->lattice))
        return;
    for (i = 0; i < c->light_room; i++)
        c->lights[i].depth.ready &= c->lights[i].slot < 0;
    c->lattice = next;
    c->sown = 0;
}

/* The lights of one crew. */
typedef struct scatteri_crew {
    scatter_context *context;
    int count, light[SCATTERI_CREW];
} scatteri_crew;

static void scatteri_fill_sun(void *data, int i)
{
    const scatteri_crew *crew = (const scatteri_crew *)data;
    const scatteri_lattice *g = &crew->context->lattice;
    scatteri_fill_lattice(&crew->context->lights[crew->light[i]].depth,
                          g->work + (size_t)i * scatteri_sheaf_room(g));
}

/* Where a light's values go. Slots without a light are read with the others, so they hold numbers, too. */
static scatter_result scatteri_begin_sun(scatter_context *c, scatteri_light *light)
{
    const size_t stride = (size_t)scatteri_stride(c);
    const size_t bytes = scatteri_lattice_points(&c->lattice) * stride * sizeof(float);
    scatteri_buffer *batch = &c->lights[light->slot / SCATTERI_TOGETHER].batch;
    const int larger = batch->bytes < bytes;
    const scatter_result result = scatteri_reserve(&c->host, batch, bytes, "depth volumes");
    if (result != SCATTER_OK)
        return result;
    if (larger)
        memset(batch->data, 0, bytes);
    scatteri_begin_fill(c, light);
    light->depth.lattice = &c->lattice;
    light->depth.stride = (int)stride;
    light->depth.values = (float *)batch->data + light->slot % SCATTERI_TOGETHER;
    return SCATTER_OK;
}

/* Fills and empties the crew. */
static scatter_result scatteri_fill_crew(const scatteri_stage *stage, scatteri_crew *crew)
{
    const scatter_result result = scatteri_parallel(stage, crew->count, scatteri_fill_sun, crew);
    for (; crew->count > 0 && result == SCATTER_OK; crew->count--)
        scatteri_end_fill(crew->context, &crew->context->lights[crew->light[crew->count - 1]]);
    return result;
}

static scatter_result scatteri_fill_local(scatter_context *c, scatteri_light *light,
                                          const scatteri_stage *stage)
{
    scatter_result result;
    scatteri_begin_fill(c, light);
    result = scatteri_build_depth(stage, &light->depth, c->quality.grid);
    if (result == SCATTER_OK)
        scatteri_end_fill(c, light);
    return result;
}

/* Fills what was chosen: directional lights crew by crew, the others one by one. */
static scatter_result scatteri_fill_lights(scatter_context *c)
{
    scatter_result result = SCATTER_OK;
    scatteri_crew crew;
    int i;
    crew.context = c;
    crew.count = 0;
    for (i = 0; i < c->light_count && result == SCATTER_OK; i++) {
        scatteri_light *light = &c->lights[i];
        const int sun = light->slot >= 0 && c->medium.has_local;
        scatteri_stage stage = scatteri_stage_of(c, (size_t)c->light_count, i + 1), before = stage;
        if (!sun)
            before.high = before.low;
        if (sun && light->chosen) {
            result = scatteri_begin_sun(c, light);
            crew.light[crew.count++] = i;
        }
        if (result == SCATTER_OK && crew.count > 0 &&
            (crew.count == SCATTERI_CREW || i + 1 == c->light_count))
            result = scatteri_fill_crew(&before, &crew);
        if (result == SCATTER_OK && light->chosen && !sun)
            result = scatteri_fill_local(c, light, &stage);
    }
    return result;
}

/* Density on the lattice, and work space. */
static scatter_result scatteri_prepare_lattice(scatter_context *c)
{
    const int crew = c->suns < SCATTERI_CREW ? c->suns : (int)SCATTERI_CREW;
    scatteri_stage stage = scatteri_stage_of(c, (size_t)c->light_count, 1);
    scatter_result result = SCATTER_OK;
    stage.high = stage.low;
    if (c->suns == 0 || !c->medium.has_local || (c->sown && crew <= c->lattice.crew))
        return SCATTER_OK;
    c->sown = 0;
    result = scatteri_build_lattice(&stage, &c->medium, c->quality.grid, crew, &c->lattice_memory,
                                    &c->lattice);
    c->sown = result == SCATTER_OK;
    return result;
}

/* `anew`: nothing that lights hold is of use any more. */
static scatter_result scatteri_update_lights(scatter_context *c, const scatter_scene *scene,
                                             int anew)
{
    scatter_result result = scatteri_reserve_lights(c, (int)scene->light_count);
    int i;
    c->light_count = result == SCATTER_OK ? (int)scene->light_count : 0;
    if (result != SCATTER_OK)
        return result;
    for (i = 0; i < c->light_count; i++) {
        scatteri_take_light(&c->lights[i], &scene->lights[i]);
        c->lights[i].depth.ready &= !anew;
    }
    if (c->quality.depth == SCATTER_DEPTH_POLAR && c->medium.has_local)
        scatteri_place_lattice(c);
    scatteri_date_lights(c);
    scatteri_choose_lights(c);
    result = scatteri_prepare_lattice(c);
    return result == SCATTER_OK ? scatteri_fill_lights(c) : result;
}

static size_t scatteri_count_suns(const scatter_scene *scene)
{
    size_t count = 0, i;
    for (i = 0; i < scene->light_count; i++)
        count += scene->lights[i].kind == SCATTER_LIGHT_DIRECTIONAL;
    return count;
}

SCATTER_API scatter_result scatter_update(scatter_context *c, const scatter_scene *scene,
                                          const scatter_quality *quality)
{
    scatter_quality before;
    scatter_result result;
    int was_ready, anew, moved;
    if (c == NULL)
        return SCATTER_BAD_ARGUMENT;
    was_ready = c->ready;
    c->ready = 0;
    result = scatteri_check_scene(&c->host, scene);
    if (result == SCATTER_OK && quality != NULL && !scatteri_check_quality(&c->host, quality))
        result = SCATTER_BAD_ARGUMENT;
    if (result != SCATTER_OK)
        return result;
    before = c->quality;
    c->quality = scatteri_resolve(quality, &scene->medium, scatteri_count_suns(scene));
    anew = !was_ready || before.depth != c->quality.depth || before.grid != c->quality.grid;
    moved = anew || before.density != c->quality.density ||
            before.no_distance_map != c->quality.no_distance_map ||
            !scatteri_same_density(&c->medium.desc, &scene->medium);
    c->updates++;
    if (moved)
        result = scatteri_update_medium(c, scene);
    else
        scatteri_take_optics(&c->medium, &scene->medium);
    if (result == SCATTER_OK)
        result = scatteri_update_lights(c, scene, anew);
    if (result != SCATTER_OK)
        return result;
    if (!was_ready || before.nodes != c->quality.nodes || before.ray != c->quality.ray)
        scatteri_update_rules(c);
    scatteri_update_trim(c);
    scatteri_choose_fields(c);
    c->scene = *scene;
    c->twin = 0;
    c->ready = 1;
    return SCATTER_OK;
}

SCATTER_API scatter_stats scatter_get_stats(const scatter_context *c)
{
    scatter_stats stats;
    int i;
    memset(&stats, 0, sizeof stats);
    if (c == NULL)
        return stats;
    stats = c->stats;
    stats.bytes = sizeof *c + (size_t)c->light_room * sizeof *c->lights + c->medium.memory.bytes +
                  c->medium.distances.bytes + c->injected_memory.bytes + c->lattice_memory.bytes;
    for (i = 0; i < c->light_room; i++)
        stats.bytes += c->lights[i].depth.memory.bytes + c->lights[i].batch.bytes;
    return stats;
}

static int scatteri_ready(const scatter_context *c)
{
    if (c == NULL)
        return 0;
    if (!c->ready)
        scatteri_fail(&c->host, SCATTER_BAD_ARGUMENT,
                      "context holds no scene, call scatter_update before");
    return c->ready;
}

SCATTER_API scatter_result scatter_radiance(const scatter_context *c, const scatter_ray *ray,
                                            const scatter_surface *hit, scatter_sample *sample)
{
    scatteri_where at = {NULL, "ray", -1};
    scatter_sample samples[SCATTERI_LANES];
    scatter_surface found;
    scatter_vec3 direction;
    scatteri_eye eye;
    int l;
    if (!scatteri_ready(c))
        return SCATTER_BAD_ARGUMENT;
    at.host = &c->host;
    if (ray == NULL || sample == NULL)
        return scatteri_fail(at.host, SCATTER_BAD_ARGUMENT, "%s is NULL",
                             ray == NULL ? "ray" : "sample");
    if (!scatteri_check_point(&at, ".origin", ray->origin) ||
        !scatteri_check_direction(&at, ".direction", ray->direction))
        return SCATTER_BAD_ARGUMENT;
    at.array = "hit";
    if (hit != NULL && !scatteri_check_hit(&at, hit))
        return SCATTER_BAD_ARGUMENT;
    direction = scatteri_unit(ray->direction);
    if (hit == NULL && c->scene.surface != NULL &&
        c->scene.surface(c->scene.user, ray->origin, direction, &found))
        hit = &found;
    eye.context = c;
    for (l = 0; l < SCATTERI_LANES; l++)
        scatteri_set_ray(&eye.rays, l, ray->origin, direction,
                         hit != NULL ? hit->distance : SCATTERI_FAR);
    scatteri_look(&eye, samples);
    *sample = samples[0];
    sample->surface = c->scene.background;
    if (hit != NULL)
        sample->surface = scatteri_shade(c, hit, ray->origin, direction);
    return SCATTER_OK;
}

/* Checks view and image, and completes the region. */
static scatter_result scatteri_begin_picture(const scatter_host *host, const scatter_view *view,
                                             const scatter_image *image, scatteri_picture *job)
{
    memset(job, 0, sizeof *job);
    if (!scatteri_check_view(host, view))
        return SCATTER_BAD_ARGUMENT;
    if (image == NULL)
        return scatteri_fail(host, SCATTER_BAD_ARGUMENT,
                             "image is NULL, it must point to a scatter_image");
    job->view = scatteri_scaled_view(view);
    job->image = *image;
    if (image->x0 == 0 && image->y0 == 0 && image->x1 == 0 && image->y1 == 0) {
        job->image.x1 = image->width;
        job->image.y1 = image->height;
    }
    return scatteri_check_image(host, &job->image);
}

SCATTER_API scatter_result scatter_render(const scatter_context *c, const scatter_view *view,
                                          const scatter_image *image)
{
    double costs[SCATTERI_SAMPLED];
    scatteri_picture job;
    scatter_result result;
    if (!scatteri_ready(c))
        return SCATTER_BAD_ARGUMENT;
    result = scatteri_begin_picture(&c->host, view, image, &job);
    if (result != SCATTER_OK)
        return result;
    job.context = c;
    job.costs = image->estimate != NULL ? costs : NULL;
    result = scatteri_render_tiles(&job);
    return result == SCATTER_OK && image->estimate != NULL ? scatteri_audit_image(&job) : result;
}

SCATTER_API scatter_result scatter_plan(const scatter_host *host, const scatter_scene *scene,
                                        const scatter_view *view, const scatter_image *image,
                                        float budget, scatter_forecast *forecast)
{
    scatter_host h = scatteri_host_or_default(host);
    scatteri_planner planner;
    scatteri_picture job;
    scatter_result result;
    memset(&planner, 0, sizeof planner);
    planner.host = h;
    h.progress = NULL;
    if (forecast == NULL)
        return scatteri_fail(&h, SCATTER_BAD_ARGUMENT,
                             "forecast is NULL, it must point to a scatter_forecast");
    if (!(budget >= 1e-5f && budget <= 1.0f))
        return scatteri_fail(&h, SCATTER_BAD_ARGUMENT, "budget is %g, it must be 1e-5..1",
                             (double)budget);
    result = scatteri_begin_picture(&h, view, image, &job);
    if (result == SCATTER_OK)
        result = scatter_create(&h, &planner.context);
    if (result != SCATTER_OK)
        return result;
    job.context = planner.context;
    job.image.transmittance = NULL;
    planner.scene = scene;
    planner.budget = budget;
    result = scatteri_plan(&planner, &job);
    if (result == SCATTER_OK)
        *forecast = planner.best;
    scatter_destroy(planner.context);
    return result;
}

#endif /* SCATTER_IMPLEMENTED */
#endif /* SCATTER_IMPLEMENTATION */

/*
MIT License

Copyright (c) 2026 the Scatter authors

Permission is hereby granted, free of charge, to any person obtaining a copy of this software and associated
documentation files (the "Software"), to deal in the Software without restriction, including without limitation the
rights to use, copy, modify, merge, publish, distribute, sublicense, and/or sell copies of the Software, and to permit
persons to whom the Software is furnished to do so, subject to the following conditions:

The above copyright notice and this permission notice shall be included in all copies or substantial portions of the
Software.

THE SOFTWARE IS PROVIDED "AS IS", WITHOUT WARRANTY OF ANY KIND, EXPRESS OR IMPLIED, INCLUDING BUT NOT LIMITED TO THE
WARRANTIES OF MERCHANTABILITY, FITNESS FOR A PARTICULAR PURPOSE AND NONINFRINGEMENT. IN NO EVENT SHALL THE AUTHORS OR
COPYRIGHT HOLDERS BE LIABLE FOR ANY CLAIM, DAMAGES OR OTHER LIABILITY, WHETHER IN AN ACTION OF CONTRACT, TORT OR
OTHERWISE, ARISING FROM, OUT OF OR IN CONNECTION WITH THE SOFTWARE OR THE USE OR OTHER DEALINGS IN THE SOFTWARE.
*/
