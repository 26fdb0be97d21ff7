/* scene.h - reads scene files (*.scatter) into a scatter_scene. MIT licence, see LICENSE.

   The format is a line for each camera, medium term, light and surface; see scenes/ for examples. A
   program that uses this reader defines _POSIX_C_SOURCE 200809L and SCATTER_IMPLEMENTATION where it
   should be.

       scene_file file;
       if (scene_read(&file, "fog.scatter"))
           puts(file.error);                                  // "fog.scatter:3: expected ..."
       else
           scatter_update(context, &file.scene, NULL), ...;
       scene_free(&file);

   Sections: types, names, reading numbers, directives, the reader, camera, skies, surfaces. */
#ifndef SCATTER_EXAMPLES_SCENE_H
#define SCATTER_EXAMPLES_SCENE_H

#include "../scatter.h"
#include "files.h"

#include <float.h>

/* ------------------------------------------------------------------------------------- >>types */

typedef enum scene_shape_kind { SCENE_BOX, SCENE_SPHERE, SCENE_PLANE } scene_shape_kind;

typedef struct scene_shape {
    scene_shape_kind kind;
    scatter_vec3 a, b; /* box: min, max; sphere: a is the centre; plane: a is the unit normal n */
    float radius;      /* sphere: radius; plane: n.x on the plane, m */
    scatter_vec3 albedo;
} scene_shape;

/* A photographed sky. Only its lights are in the scene; who wants to show it has the map. */
typedef struct scene_sky {
    scatter_environment map;
    size_t first, count; /* of scene_file.lights */
} scene_sky;

typedef struct scene_file {
    scatter_scene scene; /* scene.user is this struct: set it again if the struct moves */
    int width, height;   /* of `image` */
    scatter_view view;   /* at that size */
    int orthographic;    /* the camera, see scene_view */
    scatter_vec3 eye, target, up;
    float extent; /* perspective: vertical field of view, radians; orthographic: height, m */
    scene_shape *shapes;
    size_t shape_count;
    scene_sky *skies;
    size_t sky_count;
    scatter_light *lights; /* the arrays that `scene` points to, with the voxels of the grids */
    scatter_height *heights;
    scatter_gaussian *gaussians;
    scatter_grid *grids;
    char error[600];
} scene_file;

/* 0, or else `error` holds "path:line: expected ..." and the rest is empty. */
static inline int scene_read(scene_file *out, const char *path);
/* From memory. Paths of grids and skies are relative to `path`; NULL refuses both. */
static inline int scene_parse(scene_file *out, const char *text, size_t bytes, const char *path);
/* Needed after success only, harmless after failure. */
static inline void scene_free(scene_file *file);

/* The camera at another size: the field of view stays, the aspect becomes width / height. */
static inline scatter_view scene_view(const scene_file *file, int width, int height);

/* The lights of the skies turned about +y, right-handed: +z goes to +x. A full turn is none. `turned`
   has the size of file->lights, which it may be; other lights in it are left alone. */
static inline void scene_turn_skies(const scene_file *file, float degrees, scatter_light *turned);
/* Radiance of the skies, so turned, where `direction` looks to. */
static inline scatter_vec3 scene_sky_radiance(const scene_file *file, float degrees,
                                              scatter_vec3 direction);

/* What scene.surface and scene.visible of a file with shapes are; `user` is the scene_file. */
static inline int scene_surface(void *user, scatter_vec3 origin, scatter_vec3 direction,
                                scatter_surface *hit);
static inline int scene_visible(void *user, scatter_vec3 p, scatter_vec3 q);

/* ------------------------------------------------------------------------------------- >>names */

/* In the order of the enumerations. */
static const char *const scene_depth_names[] = {"auto",   "closed", "closed-volume", "eq6",
                                                "upwind", "short",  "polar",         "march"};
static const char *const scene_density_names[] = {"auto", "exact", "volume"};
static const char *const scene_ray_names[] = {"quadrature", "march"};

/* Index of a name, or -1. */
static inline int scene_name(const char *const *names, size_t count, const char *name) {
    for (size_t i = 0; i < count; i++)
        if (strcmp(names[i], name) == 0)
            return (int)i;
    return -1;
}

static inline const char *scene_depth_name(scatter_depth_method method) {
    return scene_depth_names[method];
}

static inline const char *scene_density_name(scatter_density_method method) {
    return scene_density_names[method];
}

static inline const char *scene_ray_name(scatter_ray_method method) {
    return scene_ray_names[method];
}

/* From a name: 0, or 1 for an unknown one. */
static inline int scene_depth_method(const char *name, scatter_depth_method *out) {
    int i =
        scene_name(scene_depth_names, sizeof scene_depth_names / sizeof *scene_depth_names, name);
    *out = i < 0 ? SCATTER_DEPTH_AUTO : (scatter_depth_method)i;
    return i < 0;
}

static inline int scene_density_method(const char *name, scatter_density_method *out) {
    int i = scene_name(scene_density_names,
                       sizeof scene_density_names / sizeof *scene_density_names, name);
    *out = i < 0 ? SCATTER_DENSITY_AUTO : (scatter_density_method)i;
    return i < 0;
}

static inline int scene_ray_method(const char *name, scatter_ray_method *out) {
    int i = scene_name(scene_ray_names, sizeof scene_ray_names / sizeof *scene_ray_names, name);
    *out = i < 0 ? SCATTER_RAY_QUADRATURE : (scatter_ray_method)i;
    return i < 0;
}

/* ----------------------------------------------------------------------------------- >>reading */

/* The line being read. */
typedef struct scene_reader {
    scene_file *out;
    const char *path;      /* NULL: text from memory */
    const char *at, *end;  /* what is left of the line */
    const char *directive; /* its first word */
    int line;
    unsigned seen; /* bit i: scene_directives[i] was there */
    float v[16];   /* its numbers */
} scene_reader;

/* "path:line: sentence" (of a long path only the end) into out->error; returns 1. */
static inline int scene_fail(scene_reader *r, const char *format, ...) {
    char sentence[560];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(sentence, sizeof sentence, format, arguments);
    va_end(arguments);
    const char *path = r->path ? r->path : "scene";
    size_t length = strlen(path), most = sizeof r->out->error - strlen(sentence) - 16;
    snprintf(r->out->error, sizeof r->out->error, "%s:%d: %s",
             path + (length > most ? length - most : 0), r->line, sentence);
    return 1;
}

static inline void scene_skip_blanks(scene_reader *r) {
    while (r->at < r->end && (*r->at == ' ' || *r->at == '\t'))
        r->at++;
}

/* The next word of the line, shortened to `room`-1 characters; empty at the end of the line. */
static inline size_t scene_word(scene_reader *r, char *word, size_t room) {
    size_t length = 0;
    scene_skip_blanks(r);
    for (; r->at < r->end && *r->at != ' ' && *r->at != '\t'; r->at++, length++)
        if (length + 1 < room)
            word[length] = *r->at;
    word[length < room ? length : room - 1] = 0;
    return length;
}

/* One number that fits into a float and is followed by a blank or the end. */
static inline int scene_number(scene_reader *r, float *value) {
    char word[32];
    double number = 0;
    scene_skip_blanks(r);
    const char *begin = r->at;
    int missing = file_number(&r->at, r->end, &number);
    if (!missing && r->at < r->end && *r->at != ' ' && *r->at != '\t')
        missing = 1;
    if (missing) {
        r->at = begin;
        scene_word(r, word, sizeof word);
        return scene_fail(r, "expected a number, found '%s'", word);
    }
    if (fabs(number) > (double)FLT_MAX)
        return scene_fail(r, "expected a number below 3.4e38, found one too large");
    *value = (float)number;
    return 0;
}

/* Exactly the numbers named in `names` (separated by blanks) up to the end of the line; a name in
   [] may be left out. They go to v[0] and on; returns 0 or 1. */
static inline int scene_numbers(scene_reader *r, const char *names) {
    int i = 0;
    for (const char *name = names; *name; name += *name == ' ') {
        size_t length = strcspn(name, " ");
        scene_skip_blanks(r);
        if (r->at == r->end && *name == '[')
            return 0;
        if (r->at == r->end)
            return scene_fail(r, "expected '%s %s', %.*s is missing", r->directive, names,
                              (int)length, name);
        if (scene_number(r, &r->v[i++]))
            return 1;
        name += length;
    }
    scene_skip_blanks(r);
    return r->at < r->end
               ? scene_fail(r, "expected '%s %s' and nothing behind", r->directive, names)
               : 0;
}

static inline scatter_vec3 scene_vec3(const float *v) {
    return scatter_v3(v[0], v[1], v[2]);
}

/* All three numbers between `low` and `high`? */
static inline int scene_within(const float *v, float low, float high) {
    return v[0] >= low && v[0] <= high && v[1] >= low && v[1] <= high && v[2] >= low &&
           v[2] <= high;
}

static inline int scene_all_less(const float *a, const float *b) {
    return a[0] < b[0] && a[1] < b[1] && a[2] < b[2];
}

static inline float scene_radians(float degrees) {
    return (float)((double)degrees * 3.14159265358979323846 / 180.0);
}

static inline double scene_dot(const double *a, const double *b) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static inline void scene_doubles(scatter_vec3 v, double *out) {
    out[0] = (double)v.x;
    out[1] = (double)v.y;
    out[2] = (double)v.z;
}

/* Space for one more item in an array of `count` items that grows by doubling; NULL without memory.
   */
static inline void *scene_append(scene_reader *r, void *array, size_t count, size_t item) {
    void *more = array;
    if ((count & (count - 1)) == 0) {
        size_t capacity = count ? 2 * count : 1;
        more = capacity <= SIZE_MAX / item ? realloc(array, capacity * item) : NULL;
    }
    if (!more)
        scene_fail(r, "out of memory");
    return more;
}

/* -------------------------------------------------------------------------------- >>directives */

static inline int scene_image(scene_reader *r) {
    if (scene_numbers(r, "W H"))
        return 1;
    for (int i = 0; i < 2; i++)
        if (!(r->v[i] >= 1 && r->v[i] <= 65536 && r->v[i] == floorf(r->v[i])))
            return scene_fail(r, "expected a width and height in whole pixels, 1 to 65536");
    r->out->width = (int)r->v[0];
    r->out->height = (int)r->v[1];
    return 0;
}

/* Whether eye, target and up span a plane. */
static inline int scene_is_camera(const float *v) {
    double f[3], u[3], c[3];
    for (int i = 0; i < 3; i++) {
        f[i] = (double)v[3 + i] - (double)v[i];
        u[i] = (double)v[6 + i];
    }
    for (int i = 0; i < 3; i++)
        c[i] = f[(i + 1) % 3] * u[(i + 2) % 3] - f[(i + 2) % 3] * u[(i + 1) % 3];
    return scene_dot(c, c) > 1e-10 * scene_dot(f, f) * scene_dot(u, u);
}

static inline int scene_camera(scene_reader *r) {
    char kind[16];
    scene_word(r, kind, sizeof kind);
    r->out->orthographic = strcmp(kind, "orthographic") == 0;
    if (!r->out->orthographic && strcmp(kind, "perspective") != 0)
        return scene_fail(r, "expected 'camera perspective' or 'camera orthographic'");
    r->directive = r->out->orthographic ? "camera orthographic" : "camera perspective";
    if (scene_numbers(r, r->out->orthographic ? "EX EY EZ TX TY TZ UX UY UZ HEIGHT"
                                              : "EX EY EZ TX TY TZ UX UY UZ FOVY"))
        return 1;
    if (!scene_is_camera(r->v))
        return scene_fail(
            r, "expected a target away from the eye and an up direction across the view");
    if (!(r->v[9] > 0) || (!r->out->orthographic && !(r->v[9] < 180)))
        return scene_fail(r, r->out->orthographic
                                 ? "expected a height above 0 m"
                                 : "expected a field of view between 0 and 180 degrees");
    r->out->eye = scene_vec3(r->v);
    r->out->target = scene_vec3(r->v + 3);
    r->out->up = scene_vec3(r->v + 6);
    r->out->extent = r->out->orthographic ? r->v[9] : scene_radians(r->v[9]);
    return 0;
}

static inline int scene_medium(scene_reader *r) {
    if (scene_numbers(r, "ST_R ST_G ST_B AL_R AL_G AL_B"))
        return 1;
    if (!scene_within(r->v, 0, FLT_MAX) || !scene_within(r->v + 3, 0, 1))
        return scene_fail(r, "expected extinctions >= 0 and albedos from 0 to 1");
    r->out->scene.medium.extinction = scene_vec3(r->v);
    r->out->scene.medium.albedo = scene_vec3(r->v + 3);
    return 0;
}

static inline int scene_emission(scene_reader *r) {
    if (scene_numbers(r, "R G B"))
        return 1;
    if (!scene_within(r->v, 0, FLT_MAX))
        return scene_fail(r, "expected an emission >= 0");
    r->out->scene.medium.emission = scene_vec3(r->v);
    return 0;
}

static inline int scene_phase_hg(scene_reader *r, scatter_phase *phase, int draine) {
    phase->kind = draine ? SCATTER_PHASE_DRAINE : SCATTER_PHASE_HG;
    r->directive = draine ? "phase draine" : "phase hg";
    if (scene_numbers(r, draine ? "G ALPHA" : "G"))
        return 1;
    if (!(fabsf(r->v[0]) <= 0.9999f))
        return scene_fail(r, "expected G from -0.9999 to 0.9999");
    if (draine && !(r->v[1] >= 0))
        return scene_fail(r, "expected ALPHA >= 0");
    phase->g = r->v[0];
    phase->alpha = draine ? r->v[1] : 0;
    return 0;
}

static inline int scene_phase(scene_reader *r) {
    scatter_phase *phase = &r->out->scene.medium.phase;
    char kind[16];
    scene_word(r, kind, sizeof kind);
    if (strcmp(kind, "hg") == 0 || strcmp(kind, "draine") == 0)
        return scene_phase_hg(r, phase, kind[0] == 'd');
    if (strcmp(kind, "droplets") == 0) {
        phase->kind = SCATTER_PHASE_DROPLETS;
        r->directive = "phase droplets";
        if (scene_numbers(r, "DIAMETER_UM"))
            return 1;
        phase->diameter_um = r->v[0];
        return r->v[0] > 0 && r->v[0] <= 50
                   ? 0
                   : scene_fail(r, "expected a diameter above 0, at most 50 um");
    }
    phase->kind = strcmp(kind, "rayleigh") == 0 ? SCATTER_PHASE_RAYLEIGH : SCATTER_PHASE_ISOTROPIC;
    if (phase->kind == SCATTER_PHASE_ISOTROPIC && strcmp(kind, "isotropic") != 0)
        return scene_fail(r,
                          "expected 'phase isotropic', 'hg', 'rayleigh', 'draine' or 'droplets'");
    r->directive = phase->kind == SCATTER_PHASE_RAYLEIGH ? "phase rayleigh" : "phase isotropic";
    return scene_numbers(r, "");
}

static inline int scene_bounds(scene_reader *r) {
    if (scene_numbers(r, "X0 Y0 Z0 X1 Y1 Z1"))
        return 1;
    if (!scene_all_less(r->v, r->v + 3))
        return scene_fail(r, "expected X0 < X1, Y0 < Y1 and Z0 < Z1");
    r->out->scene.medium.bounded = 1;
    r->out->scene.medium.bounds.min = scene_vec3(r->v);
    r->out->scene.medium.bounds.max = scene_vec3(r->v + 3);
    return 0;
}

static inline int scene_constant(scene_reader *r) {
    if (scene_numbers(r, "D0"))
        return 1;
    float sum = r->out->scene.medium.constant + r->v[0];
    if (!(r->v[0] >= 0) || !(sum <= FLT_MAX))
        return scene_fail(r, "expected a density >= 0, all constants together below 3.4e38");
    r->out->scene.medium.constant = sum;
    return 0;
}

static inline int scene_height(scene_reader *r) {
    scatter_height height;
    if (scene_numbers(r, "D0 Y0 SCALE"))
        return 1;
    if (!(r->v[0] >= 0) || !(r->v[2] > 0))
        return scene_fail(r, "expected a density >= 0 and a scale above 0 m");
    height.density = r->v[0];
    height.y0 = r->v[1];
    height.scale = r->v[2];
    size_t *count = &r->out->scene.medium.height_count;
    void *more = scene_append(r, r->out->heights, *count, sizeof height);
    if (!more)
        return 1;
    r->out->heights = (scatter_height *)more;
    r->out->heights[(*count)++] = height;
    return 0;
}

static inline int scene_gaussian(scene_reader *r) {
    scatter_gaussian gaussian;
    if (scene_numbers(r, "CX CY CZ A C"))
        return 1;
    if (!(r->v[3] > 0) || !(r->v[4] >= 0))
        return scene_fail(r, "expected an inverse width A above 0 and a density C >= 0");
    gaussian.center = scene_vec3(r->v);
    gaussian.a = r->v[3];
    gaussian.c = r->v[4];
    size_t *count = &r->out->scene.medium.gaussian_count;
    void *more = scene_append(r, r->out->gaussians, *count, sizeof gaussian);
    if (!more)
        return 1;
    r->out->gaussians = (scatter_gaussian *)more;
    r->out->gaussians[(*count)++] = gaussian;
    return 0;
}

/* `name` relative to the directory of the scene file; 1 if that is longer than `room`. */
static inline int scene_path(const scene_reader *r, const char *name, char *path, size_t room) {
    const char *slash = strrchr(r->path, '/');
    int directory = slash && name[0] != '/' ? (int)(slash + 1 - r->path) : 0;
    int length = snprintf(path, room, "%.*s%s", directory, r->path, name);
    return length < 0 || (size_t)length >= room;
}

/* A word of the line that is a file, as a path: relative to the scene file. */
static inline int scene_file_name(scene_reader *r, const char *expected, char *path, size_t room) {
    char name[PATH_MAX];
    size_t length = scene_word(r, name, sizeof name);
    if (length == 0 || length >= sizeof name)
        return scene_fail(r, "expected '%s'", expected);
    if (!r->path)
        return scene_fail(r, "expected a scene without files, for it comes from memory");
    return scene_path(r, name, path, room) ? scene_fail(r, "expected a shorter path") : 0;
}

/* Reads the voxels and appends the grid. A SCALE of 0 is stored as voxels of 0, for
   scatter_grid.scale = 0 would mean 1. */
static inline int scene_append_grid(scene_reader *r, const char *path) {
    size_t *count = &r->out->scene.medium.grid_count;
    void *more = scene_append(r, r->out->grids, *count, sizeof(scatter_grid));
    file_grid voxels;
    file_error error;
    if (!more)
        return 1;
    r->out->grids = (scatter_grid *)more;
    if (file_grid_read(path, &voxels, &error))
        return scene_fail(r, "%s", error.text);
    size_t cells = (size_t)voxels.nx * (size_t)voxels.ny * (size_t)voxels.nz;
    if (!(r->v[6] > 0))
        memset(voxels.density, 0, cells * sizeof(float));
    scatter_grid grid;
    memset(&grid, 0, sizeof grid);
    grid.density = voxels.density;
    grid.nx = voxels.nx;
    grid.ny = voxels.ny;
    grid.nz = voxels.nz;
    grid.box.min = scene_vec3(r->v);
    grid.box.max = scene_vec3(r->v + 3);
    grid.scale = r->v[6];
    r->out->grids[(*count)++] = grid;
    return 0;
}

static inline int scene_grid(scene_reader *r) {
    char path[PATH_MAX];
    if (scene_file_name(r, "grid FILE X0 Y0 Z0 X1 Y1 Z1 SCALE", path, sizeof path))
        return 1;
    r->directive = "grid FILE";
    if (scene_numbers(r, "X0 Y0 Z0 X1 Y1 Z1 SCALE"))
        return 1;
    if (!scene_all_less(r->v, r->v + 3) || !(r->v[6] >= 0))
        return scene_fail(r, "expected X0 < X1, Y0 < Y1, Z0 < Z1 and SCALE >= 0");
    return scene_append_grid(r, path);
}

static inline int scene_append_light(scene_reader *r, const scatter_light *light) {
    if (!(light->intensity.x >= 0 && light->intensity.y >= 0 && light->intensity.z >= 0))
        return scene_fail(r, "expected an intensity >= 0");
    if (!(light->radius >= 0))
        return scene_fail(r, "expected a RADIUS >= 0 m");
    void *more = scene_append(r, r->out->lights, r->out->scene.light_count, sizeof *light);
    if (!more)
        return 1;
    r->out->lights = (scatter_light *)more;
    r->out->lights[r->out->scene.light_count++] = *light;
    return 0;
}

static inline int scene_is_zero(const float *v) {
    return !(fabsf(v[0]) > 0 || fabsf(v[1]) > 0 || fabsf(v[2]) > 0);
}

static inline int scene_light_point(scene_reader *r, scatter_light *light) {
    r->directive = "light point";
    r->v[6] = 0.01f;
    if (scene_numbers(r, "X Y Z R G B [RADIUS]"))
        return 1;
    light->kind = SCATTER_LIGHT_POINT;
    light->position = scene_vec3(r->v);
    light->intensity = scene_vec3(r->v + 3);
    light->radius = r->v[6];
    return scene_append_light(r, light);
}

static inline int scene_light_spot(scene_reader *r, scatter_light *light) {
    r->directive = "light spot";
    r->v[11] = 0.01f;
    if (scene_numbers(r, "X Y Z DX DY DZ INNER OUTER R G B [RADIUS]"))
        return 1;
    if (scene_is_zero(r->v + 3))
        return scene_fail(r, "expected a direction that is not 0 0 0");
    if (!(r->v[6] >= 0 && r->v[6] <= r->v[7] && r->v[7] <= 180))
        return scene_fail(r, "expected angles 0 <= INNER <= OUTER <= 180 degrees");
    light->kind = SCATTER_LIGHT_SPOT;
    light->position = scene_vec3(r->v);
    light->direction = scene_vec3(r->v + 3);
    light->inner = scene_radians(r->v[6]);
    light->outer = scene_radians(r->v[7]);
    light->intensity = scene_vec3(r->v + 8);
    light->radius = r->v[11];
    return scene_append_light(r, light);
}

static inline int scene_light_directional(scene_reader *r, scatter_light *light) {
    r->directive = "light directional";
    if (scene_numbers(r, "DX DY DZ R G B"))
        return 1;
    if (scene_is_zero(r->v))
        return scene_fail(r, "expected a direction that is not 0 0 0");
    light->kind = SCATTER_LIGHT_DIRECTIONAL;
    light->direction = scene_vec3(r->v);
    light->intensity = scene_vec3(r->v + 3);
    return scene_append_light(r, light);
}

static inline void scene_log(void *user, scatter_result result, const char *sentence) {
    (void)result;
    scene_fail((scene_reader *)user, "%s", sentence);
}

/* The lights of the sky, behind those that are there. */
static inline int scene_append_sky(scene_reader *r, const scatter_environment *map, int count) {
    scatter_light lights[256];
    scatter_host host;
    scene_sky sky = {*map, r->out->scene.light_count, (size_t)count};
    memset(&host, 0, sizeof host);
    host.user = r;
    host.log = scene_log;
    void *more = scene_append(r, r->out->skies, r->out->sky_count, sizeof sky);
    if (!more)
        return 1;
    r->out->skies = (scene_sky *)more;
    if (scatter_constellation(&host, map, SCATTER_CONSTELLATION_KMEANS, count, lights))
        return 1;
    for (int i = 0; i < count; i++)
        if (scene_append_light(r, &lights[i]))
            return 1;
    r->out->skies[r->out->sky_count++] = sky;
    return 0;
}

static inline int scene_light_environment(scene_reader *r) {
    char path[PATH_MAX];
    file_picture picture;
    file_error error;
    if (scene_file_name(r, "light environment FILE SCALE COUNT", path, sizeof path))
        return 1;
    r->directive = "light environment FILE";
    if (scene_numbers(r, "SCALE COUNT"))
        return 1;
    if (!(r->v[0] > 0))
        return scene_fail(r, "expected a SCALE above 0");
    if (!(r->v[1] >= 1 && r->v[1] <= 256 && r->v[1] == floorf(r->v[1])))
        return scene_fail(r, "expected a COUNT of 1 to 256 lights");
    if (file_hdr_read(path, &picture, &error))
        return scene_fail(r, "%s", error.text);
    scatter_environment map = {picture.rgb, picture.width, picture.height, r->v[0]};
    int failed = scene_append_sky(r, &map, (int)r->v[1]);
    if (failed)
        free(picture.rgb);
    return failed;
}

static inline int scene_light(scene_reader *r) {
    scatter_light light;
    char kind[16];
    memset(&light, 0, sizeof light);
    scene_word(r, kind, sizeof kind);
    if (strcmp(kind, "point") == 0)
        return scene_light_point(r, &light);
    if (strcmp(kind, "spot") == 0)
        return scene_light_spot(r, &light);
    if (strcmp(kind, "directional") == 0)
        return scene_light_directional(r, &light);
    if (strcmp(kind, "environment") == 0)
        return scene_light_environment(r);
    return scene_fail(r, "expected 'light point', 'spot', 'directional' or 'environment'");
}

static inline int scene_append_shape(scene_reader *r, const scene_shape *shape) {
    const float albedo[3] = {shape->albedo.x, shape->albedo.y, shape->albedo.z};
    if (!scene_within(albedo, 0, 1))
        return scene_fail(r, "expected an albedo R G B from 0 to 1");
    void *more = scene_append(r, r->out->shapes, r->out->shape_count, sizeof *shape);
    if (!more)
        return 1;
    r->out->shapes = (scene_shape *)more;
    r->out->shapes[r->out->shape_count++] = *shape;
    return 0;
}

/* A box may be flat: a wall of no thickness. */
static inline int scene_box(scene_reader *r) {
    scene_shape shape = {SCENE_BOX, {0, 0, 0}, {0, 0, 0}, 0, {0, 0, 0}};
    if (scene_numbers(r, "X0 Y0 Z0 X1 Y1 Z1 R G B"))
        return 1;
    if (!(r->v[0] <= r->v[3] && r->v[1] <= r->v[4] && r->v[2] <= r->v[5]))
        return scene_fail(r, "expected X0 <= X1, Y0 <= Y1 and Z0 <= Z1");
    shape.a = scene_vec3(r->v);
    shape.b = scene_vec3(r->v + 3);
    shape.albedo = scene_vec3(r->v + 6);
    return scene_append_shape(r, &shape);
}

static inline int scene_sphere(scene_reader *r) {
    scene_shape shape = {SCENE_SPHERE, {0, 0, 0}, {0, 0, 0}, 0, {0, 0, 0}};
    if (scene_numbers(r, "CX CY CZ RADIUS R G B"))
        return 1;
    if (!(r->v[3] > 0))
        return scene_fail(r, "expected a RADIUS above 0 m");
    shape.a = scene_vec3(r->v);
    shape.radius = r->v[3];
    shape.albedo = scene_vec3(r->v + 4);
    return scene_append_shape(r, &shape);
}

/* n.x = OFFSET for the normal as given; both are divided by its length. */
static inline int scene_plane(scene_reader *r) {
    scene_shape shape = {SCENE_PLANE, {0, 0, 0}, {0, 0, 0}, 0, {0, 0, 0}};
    if (scene_numbers(r, "NX NY NZ OFFSET R G B"))
        return 1;
    if (scene_is_zero(r->v))
        return scene_fail(r, "expected a normal that is not 0 0 0");
    double n[3], length;
    scene_doubles(scene_vec3(r->v), n);
    length = sqrt(scene_dot(n, n));
    shape.a = scatter_v3((float)(n[0] / length), (float)(n[1] / length), (float)(n[2] / length));
    shape.radius = (float)((double)r->v[3] / length);
    if (!isfinite(shape.radius))
        return scene_fail(r, "expected a plane that passes less than 3.4e38 m from the origin");
    shape.albedo = scene_vec3(r->v + 4);
    return scene_append_shape(r, &shape);
}

static inline int scene_background(scene_reader *r) {
    if (scene_numbers(r, "R G B"))
        return 1;
    if (!scene_within(r->v, 0, FLT_MAX))
        return scene_fail(r, "expected a radiance >= 0");
    r->out->scene.background = scene_vec3(r->v);
    return 0;
}

/* ------------------------------------------------------------------------------------ >>reader */

enum { SCENE_ONCE = 1, SCENE_NEEDED = 2 };

typedef struct scene_directive {
    const char *name;
    int (*read)(scene_reader *r);
    int rule;
} scene_directive;

static const scene_directive scene_directives[] = {
    {"image", scene_image, SCENE_ONCE | SCENE_NEEDED},
    {"camera", scene_camera, SCENE_ONCE | SCENE_NEEDED},
    {"medium", scene_medium, SCENE_ONCE | SCENE_NEEDED},
    {"emission", scene_emission, SCENE_ONCE},
    {"phase", scene_phase, SCENE_ONCE},
    {"bounds", scene_bounds, SCENE_ONCE},
    {"background", scene_background, SCENE_ONCE},
    {"constant", scene_constant, 0},
    {"height", scene_height, 0},
    {"gaussian", scene_gaussian, 0},
    {"grid", scene_grid, 0},
    {"light", scene_light, 0},
    {"box", scene_box, 0},
    {"sphere", scene_sphere, 0},
    {"plane", scene_plane, 0},
};
enum { SCENE_DIRECTIVES = sizeof scene_directives / sizeof *scene_directives };

/* One line, without its end; the text from # on is a comment. */
static inline int scene_line(scene_reader *r) {
    char word[32];
    const char *comment = (const char *)memchr(r->at, '#', (size_t)(r->end - r->at));
    if (memchr(r->at, 0, (size_t)(r->end - r->at)))
        return scene_fail(r, "expected text, found a byte 0");
    if (comment)
        r->end = comment;
    if (r->end > r->at && r->end[-1] == '\r')
        r->end--;
    if (scene_word(r, word, sizeof word) == 0)
        return 0;
    for (int i = 0; i < SCENE_DIRECTIVES; i++) {
        if (strcmp(word, scene_directives[i].name) != 0)
            continue;
        if ((scene_directives[i].rule & SCENE_ONCE) && (r->seen >> i & 1))
            return scene_fail(r, "expected only one '%s', this is the second", word);
        r->seen |= 1u << i;
        r->directive = scene_directives[i].name;
        return scene_directives[i].read(r);
    }
    return scene_fail(r, "expected a directive such as 'gaussian', found '%s'", word);
}

static inline int scene_lines(scene_reader *r, const char *text, size_t bytes) {
    const char *end = text + bytes;
    for (const char *next = text; next < end; next++) {
        const char *newline = (const char *)memchr(next, '\n', (size_t)(end - next));
        r->at = next;
        r->end = newline ? newline : end;
        r->line++;
        next = r->end;
        if (scene_line(r))
            return 1;
    }
    for (int i = 0; i < SCENE_DIRECTIVES; i++)
        if ((scene_directives[i].rule & SCENE_NEEDED) && !(r->seen >> i & 1))
            return scene_fail(r, "expected '%s' before the end of the file",
                              scene_directives[i].name);
    return 0;
}

/* The pointers of the scene to the arrays that are now complete. */
static inline void scene_connect(scene_file *out) {
    out->scene.medium.heights = out->heights;
    out->scene.medium.gaussians = out->gaussians;
    out->scene.medium.grids = out->grids;
    out->scene.lights = out->lights;
    if (out->shape_count) {
        out->scene.surface = scene_surface;
        out->scene.visible = scene_visible;
        out->scene.user = out;
    }
    out->view = scene_view(out, out->width, out->height);
}

static inline void scene_free(scene_file *file) {
    for (size_t i = 0; i < file->scene.medium.grid_count; i++)
        free((void *)file->grids[i].density);
    for (size_t i = 0; i < file->sky_count; i++)
        free((void *)file->skies[i].map.rgb);
    free(file->skies);
    free(file->grids);
    free(file->gaussians);
    free(file->heights);
    free(file->lights);
    free(file->shapes);
    memset(file, 0, offsetof(scene_file, error));
}

static inline int scene_parse(scene_file *out, const char *text, size_t bytes, const char *path) {
    scene_reader r;
    memset(out, 0, sizeof *out);
    memset(&r, 0, sizeof r);
    r.out = out;
    r.path = path;
    if (bytes >= 3 && memcmp(text, "\xef\xbb\xbf", 3) == 0) { /* byte order mark of some editors */
        text += 3;
        bytes -= 3;
    }
    if (scene_lines(&r, text, bytes)) {
        scene_free(out);
        return 1;
    }
    scene_connect(out);
    return 0;
}

static inline int scene_read(scene_file *out, const char *path) {
    char *text;
    size_t bytes;
    file_error error;
    memset(out, 0, sizeof *out);
    if (file_read(path, SIZE_MAX, &text, &bytes, &error)) {
        snprintf(out->error, sizeof out->error, "%s", error.text);
        return 1;
    }
    int failed = scene_parse(out, text, bytes, path);
    free(text);
    return failed;
}

/* ------------------------------------------------------------------------------------ >>camera */

static inline scatter_view scene_view(const scene_file *file, int width, int height) {
    float aspect = (float)width / (float)height;
    return file->orthographic
               ? scatter_view_orthographic(file->eye, file->target, file->up, file->extent, aspect)
               : scatter_view_perspective(file->eye, file->target, file->up, file->extent, aspect);
}

/* ------------------------------------------------------------------------------------- >>skies */

static inline void scene_turn_skies(const scene_file *file, float degrees, scatter_light *turned) {
    float angle = scene_radians(fmodf(degrees, 360));
    for (size_t i = 0; i < file->sky_count; i++) {
        const scene_sky *sky = &file->skies[i];
        scatter_turn_lights(file->lights + sky->first, sky->count, scatter_v3(0, 1, 0), angle,
                            turned + sky->first);
    }
}

/* A turned sky looks in one direction as it does, unturned, in the direction turned back. */
static inline scatter_vec3 scene_sky_radiance(const scene_file *file, float degrees,
                                              scatter_vec3 direction) {
    float angle = scene_radians(fmodf(degrees, 360)), c = cosf(angle), s = sinf(angle);
    scatter_vec3 sum = {0, 0, 0}, back = direction;
    back.x = c * direction.x - s * direction.z;
    back.z = s * direction.x + c * direction.z;
    for (size_t i = 0; i < file->sky_count; i++) {
        scatter_vec3 sky = scatter_environment_radiance(&file->skies[i].map, back);
        sum = scatter_v3(sum.x + sky.x, sum.y + sky.y, sum.z + sky.z);
    }
    return sum;
}

/* ---------------------------------------------------------------------------------- >>surfaces */

/* Points come as floats, so a point that was computed to lie on a surface lies near it, by some
   1e-7 of its coordinates and of its distance to the eye. Shapes are tested in double precision; a
   point within this tolerance counts as lying on a surface. The factor 2e-6 is 16 times the
   rounding of a float, 1.2e-7. */
static inline double scene_tolerance(const scene_file *file, const double *p) {
    double eye[3], size = 0;
    scene_doubles(file->eye, eye);
    for (int i = 0; i < 3; i++)
        size = fmax(size, fabs(p[i]) + fabs(p[i] - eye[i]));
    return 2e-6 * size;
}

/* How deep a point lies in a box or sphere, m; negative outside. */
static inline double scene_depth(const scene_shape *shape, const double *p) {
    double low[3], high[3], depth = HUGE_VAL;
    scene_doubles(shape->a, low);
    scene_doubles(shape->b, high);
    if (shape->kind == SCENE_SPHERE) {
        double r[3] = {p[0] - low[0], p[1] - low[1], p[2] - low[2]};
        return (double)shape->radius - sqrt(scene_dot(r, r));
    }
    for (int i = 0; i < 3; i++)
        depth = fmin(depth, fmin(p[i] - low[i], high[i] - p[i]));
    return depth;
}

/* The shortest way through a box or sphere, m: twice the greatest depth. */
static inline double scene_thickness(const scene_shape *shape) {
    double middle[3], high[3];
    scene_doubles(shape->a, middle);
    scene_doubles(shape->b, high);
    for (int i = 0; i < 3 && shape->kind == SCENE_BOX; i++)
        middle[i] = (middle[i] + high[i]) / 2;
    return 2 * scene_depth(shape, middle);
}

static inline double scene_plane_distance(const scene_shape *shape, const double *p) {
    double n[3];
    scene_doubles(shape->a, n);
    return scene_dot(n, p) - (double)shape->radius;
}

/* Where the line o + t d enters (t[0]) and leaves (t[1]) a box shrunk by `margin`; 0 if it misses.
   A box thinner than that becomes a sheet in its middle. *axis is the one through whose faces it
   enters and axis[1] leaves. */
static inline int scene_box_span(const scene_shape *shape, const double *o, const double *d,
                                 double margin, double t[2], int axis[2]) {
    double low[3], high[3];
    scene_doubles(shape->a, low);
    scene_doubles(shape->b, high);
    t[0] = -HUGE_VAL;
    t[1] = HUGE_VAL;
    axis[0] = axis[1] = 0;
    for (int i = 0; i < 3; i++) {
        double shrink = fmin(margin, (high[i] - low[i]) / 2);
        double a = low[i] + shrink - o[i], b = high[i] - shrink - o[i];
        if (!(fabs(d[i]) > 0)) {
            if (a > 0 || b < 0)
                return 0;
            continue;
        }
        double near = (d[i] > 0 ? a : b) / d[i], far = (d[i] > 0 ? b : a) / d[i];
        if (near > t[0]) {
            t[0] = near;
            axis[0] = i;
        }
        if (far < t[1]) {
            t[1] = far;
            axis[1] = i;
        }
    }
    return t[0] <= t[1];
}

/* The same for a sphere: the line comes closest to the centre at t = m, half a chord before and
   behind it are the surface. |o - c + m d|^2 instead of |o - c|^2 - m^2 |d|^2 stays exact far away.
   */
static inline int scene_sphere_span(const scene_shape *shape, const double *o, const double *d,
                                    double margin, double t[2]) {
    double c[3], radius = fmax((double)shape->radius - margin, 0), dd = scene_dot(d, d);
    scene_doubles(shape->a, c);
    for (int i = 0; i < 3; i++)
        c[i] = o[i] - c[i];
    double m = -scene_dot(c, d) / dd;
    for (int i = 0; i < 3; i++)
        c[i] += m * d[i];
    double rest = radius * radius - scene_dot(c, c);
    if (!(rest >= 0))
        return 0;
    t[0] = m - sqrt(rest / dd);
    t[1] = m + sqrt(rest / dd);
    return 1;
}

/* The first of the two ends that lies before the eye: the outer side, or from inside the inner
   side. */
static inline int scene_first(const double t[2]) {
    return t[0] > 0 ? 0 : t[1] > 0 ? 1 : -1;
}

/* Distance to the shape along a unit direction, with its normal (towards either side); HUGE_VAL:
   none. */
static inline double scene_hit_box(const scene_shape *shape, const double *o, const double *d,
                                   double *normal) {
    double t[2];
    int axis[2], end = scene_box_span(shape, o, d, 0, t, axis) ? scene_first(t) : -1;
    if (end < 0)
        return HUGE_VAL;
    normal[0] = normal[1] = normal[2] = 0;
    normal[axis[end]] = 1;
    return t[end];
}

static inline double scene_hit_sphere(const scene_shape *shape, const double *o, const double *d,
                                      double *normal) {
    double t[2], c[3];
    int end = scene_sphere_span(shape, o, d, 0, t) ? scene_first(t) : -1;
    if (end < 0)
        return HUGE_VAL;
    scene_doubles(shape->a, c);
    for (int i = 0; i < 3; i++)
        normal[i] = (o[i] + t[end] * d[i] - c[i]) / (double)shape->radius;
    return t[end];
}

static inline double scene_hit_plane(const scene_shape *shape, const double *o, const double *d,
                                     double *normal) {
    scene_doubles(shape->a, normal);
    double t = -scene_plane_distance(shape, o) / scene_dot(normal, d);
    return t > 0 && isfinite(t) ? t : HUGE_VAL;
}

static inline double scene_hit(const scene_shape *shape, const double *o, const double *d,
                               double *normal) {
    switch (shape->kind) {
    case SCENE_BOX: return scene_hit_box(shape, o, d, normal);
    case SCENE_SPHERE: return scene_hit_sphere(shape, o, d, normal);
    default: return scene_hit_plane(shape, o, d, normal);
    }
}

/* The nearest shape on a ray. Boxes and spheres show their inner side to an eye inside. */
static inline int scene_surface(void *user, scatter_vec3 origin, scatter_vec3 direction,
                                scatter_surface *hit) {
    const scene_file *file = (const scene_file *)user;
    double o[3], d[3], n[3] = {0}, normal[3] = {0}, nearest = HUGE_VAL;
    const scene_shape *found = NULL;
    scene_doubles(origin, o);
    scene_doubles(direction, d);
    double length = sqrt(scene_dot(d, d));
    for (int i = 0; i < 3; i++)
        d[i] /= length;
    for (size_t i = 0; i < file->shape_count; i++) {
        double distance = scene_hit(&file->shapes[i], o, d, n);
        if (distance < nearest && distance < (double)FLT_MAX) {
            nearest = distance;
            found = &file->shapes[i];
            memcpy(normal, n, sizeof normal);
        }
    }
    if (!found)
        return 0;
    double side = scene_dot(normal, d) > 0 ? -1 : 1;
    memset(hit, 0, sizeof *hit);
    hit->distance = (float)nearest;
    hit->normal =
        scatter_v3((float)(side * normal[0]), (float)(side * normal[1]), (float)(side * normal[2]));
    hit->albedo = found->albedo;
    return 1;
}

/* Whether some of the segment from p to q lies in a box or sphere shrunk by `margin`. */
static inline int scene_crosses(const scene_shape *shape, const double *p, const double *q,
                                double margin) {
    double t[2], d[3] = {q[0] - p[0], q[1] - p[1], q[2] - p[2]};
    int axis[2], meets = shape->kind == SCENE_BOX ? scene_box_span(shape, p, d, margin, t, axis)
                                                  : scene_sphere_span(shape, p, d, margin, t);
    return meets && t[0] < 1 && t[1] > 0;
}

/* A plane is a thin sheet: it stops what crosses it, unless one end lies on it. */
static inline int scene_plane_blocks(const scene_shape *shape, const double *p, const double *q,
                                     double near_p, double near_q) {
    double a = scene_plane_distance(shape, p), b = scene_plane_distance(shape, q);
    return fabs(a) > near_p && fabs(b) > near_q && (a < 0) != (b < 0);
}

/* A solid stops what crosses its surface. Both ends inside: nothing does, it is convex. One inside,
   one outside: crossed. An end on the surface: the other end inside sees it from inside, and with
   the other end outside only what runs through the solid, shrunk to below that end, is stopped. */
static inline int scene_solid_blocks(const scene_shape *shape, const double *p, const double *q,
                                     double near_p, double near_q) {
    if (!scene_crosses(shape, p, q, 0))
        return 0;
    double a = scene_depth(shape, p), b = scene_depth(shape, q);
    int inside_p = a > near_p, inside_q = b > near_q;
    int on_p = fabs(a) <= near_p, on_q = fabs(b) <= near_q;
    if (inside_p || inside_q)
        return !(inside_p || on_p) || !(inside_q || on_q);
    if (!on_p && !on_q)
        return 1;
    double margin = fmax(on_p ? near_p : 0, on_q ? near_q : 0);
    return scene_thickness(shape) > 2 * margin && scene_crosses(shape, p, q, margin);
}

/* Whether nothing lies between p and q. Either may lie on a surface. */
static inline int scene_visible(void *user, scatter_vec3 p, scatter_vec3 q) {
    const scene_file *file = (const scene_file *)user;
    double a[3], b[3];
    scene_doubles(p, a);
    scene_doubles(q, b);
    double near_a = scene_tolerance(file, a), near_b = scene_tolerance(file, b);
    for (size_t i = 0; i < file->shape_count; i++) {
        const scene_shape *shape = &file->shapes[i];
        int blocks = shape->kind == SCENE_PLANE ? scene_plane_blocks(shape, a, b, near_a, near_b)
                                                : scene_solid_blocks(shape, a, b, near_a, near_b);
        if (blocks)
            return 0;
    }
    return 1;
}

#endif
