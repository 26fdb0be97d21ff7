/* hdr.h - the photographed skies of ../shared/data, for tests and benchmarks: "skipped: no data"
   where they are not. MIT licence, see LICENSE. Include it after scatter.h. */
#ifndef HDR_H
#define HDR_H

#include <stdint.h>
#include <stdio.h>
#include <string.h>

#ifdef __GNUC__
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wconversion"
#pragma GCC diagnostic ignored "-Wshadow"
#pragma GCC diagnostic ignored "-Wunused-function"
#endif
#define STB_IMAGE_IMPLEMENTATION
#define STBI_ONLY_HDR
#include <stb/stb_image.h>
#ifdef __GNUC__
#pragma GCC diagnostic pop
#endif

enum { HDR_MAPS = 4 };

static const char *const hdr_names[HDR_MAPS] = {"kiara_1_dawn_1k", "st_fagans_interior_1k",
                                                "studio_small_03_1k", "venice_sunset_1k"};

/* 0 if the file is not there; hdr_free the map. */
static inline int hdr_read(const char *name, scatter_environment *map) {
    char path[128];
    int channels;
    memset(map, 0, sizeof *map);
    snprintf(path, sizeof path, "../shared/data/hdr/%s.hdr", name);
    map->rgb = stbi_loadf(path, &map->width, &map->height, &channels, 3);
    return map->rgb != NULL;
}

static inline void hdr_free(scatter_environment *map) {
    stbi_image_free((void *)(uintptr_t)map->rgb);
    map->rgb = NULL;
}

#endif
