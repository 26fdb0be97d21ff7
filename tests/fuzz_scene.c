/* fuzz_scene.c - libFuzzer target: scene files, PFM and HDR pictures, grids from memory. MIT
   licence, see LICENSE. No file is opened: a scene without a path refuses grids and skies. */
#define _POSIX_C_SOURCE 200809L
#define SCATTER_IMPLEMENTATION
#include "../scatter.h"
#define FILE_VOXELS_MAX (1u << 16) /* so that no input takes long */
#include "../examples/scene.h"

static void demand(int truth) {
    if (!truth)
        abort();
}

/* Whatever is accepted must be drawable by the documented rules: finite rays, and arrays that are
   there. */
static void check_scene(const scene_file *file) {
    scatter_surface hit;
    scatter_ray ray = scatter_view_ray(&file->view, 0.3f, 0.7f);
    demand(file->width >= 1 && file->height >= 1);
    demand(!file->scene.light_count || file->scene.lights);
    demand(!file->scene.medium.gaussian_count || file->scene.medium.gaussians);
    if (!file->scene.surface)
        return;
    if (file->scene.surface(file->scene.user, ray.origin, ray.direction, &hit))
        demand(hit.distance >= 0 && isfinite(hit.distance));
    file->scene.visible(file->scene.user, file->eye, file->target);
}

static void fuzz_text(const char *text, size_t bytes) {
    scene_file file;
    if (scene_parse(&file, text, bytes, NULL) == 0)
        check_scene(&file);
    else
        demand(strncmp(file.error, "scene:", 6) == 0 && strlen(file.error) > 10);
    scene_free(&file);
}

typedef int (*picture_parser)(const char *data, size_t bytes, const char *path, file_picture *out,
                              file_error *error);

static void fuzz_picture(picture_parser parse, const char *data, size_t bytes) {
    file_picture picture;
    file_error error;
    if (parse(data, bytes, "picture", &picture, &error) == 0)
        demand(picture.width >= 1 && picture.height >= 1 && isfinite(picture.rgb[0]));
    free(picture.rgb);
}

typedef int (*grid_parser)(const char *data, size_t bytes, const char *path, file_grid *out,
                           file_error *error);

static void fuzz_grid(grid_parser parse, const char *data, size_t bytes) {
    file_grid grid;
    file_error error;
    if (parse(data, bytes, "grid", &grid, &error) == 0)
        demand(grid.nx >= 1 && grid.ny >= 1 && grid.nz >= 1 && isfinite(grid.density[0]));
    file_grid_free(&grid);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes);
int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes) {
    const char *text = (const char *)data;
    file_error error;
    if (bytes >= 2 && memcmp(text, "PF", 2) == 0)
        fuzz_picture(file_pfm_parse, text, bytes);
    else if (bytes >= 2 && memcmp(text, "#?", 2) == 0)
        fuzz_picture(file_hdr_parse, text, bytes);
    else if (bytes >= 8 && memcmp(text, "NanoVDB0", 8) == 0)
        fuzz_grid(file_nvdb_parse, text, bytes);
    else if (bytes >= 1 && *text >= '0' && *text <= '9') /* no directive begins so */
        fuzz_grid(file_vol_parse, text, bytes);
    else if (bytes >= 4 && memcmp(text, " BDV", 4) == 0)
        (void)file_vdb_check(text, bytes, "grid", &error);
    else
        fuzz_text(text, bytes);
    return 0;
}
