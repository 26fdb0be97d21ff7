/* reference_main.c - scatter-reference: renders a scene file with the reference. MIT licence.

   scatter-reference SCENE --out F.pfm [--size WxH] [--threads N] */
#define SCATTER_IMPLEMENTATION /* for the camera; reference.c calls nothing of it */
#include "../examples/files.h"
#include "../examples/scene.h"
#include "../scatter.h"
#include "reference.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char usage[] =
    "usage: scatter-reference SCENE --out F.pfm [--size WxH] [--threads N]\n";

typedef struct options {
    const char *scene, *out;
    int width, height; /* 0: the scene's */
    int threads;
} options;

/* A whole number from 1 to `most` that ends at `end`; 0 if it is none. */
static const char *number(const char *text, char end, int most, int *out) {
    char *stop;
    long n = strtol(text, &stop, 10);
    if (stop == text || *stop != end || n < 1 || n > most)
        return NULL;
    *out = (int)n;
    return stop + 1;
}

static int size_option(const char *text, options *o) {
    const char *height = number(text, 'x', 65536, &o->width);
    return height && number(height, 0, 65536, &o->height);
}

/* 0 if the arguments have no meaning. */
static int read_options(int count, char **argument, options *o) {
    int i, ok = 1;
    for (i = 1; i < count && ok; i++) {
        const char *a = argument[i], *value = i + 1 < count ? argument[i + 1] : "";
        if (!strcmp(a, "--out"))
            o->out = value, i++;
        else if (!strcmp(a, "--size"))
            ok = size_option(value, o), i++;
        else if (!strcmp(a, "--threads"))
            ok = number(value, 0, 64, &o->threads) != NULL, i++;
        else
            ok = a[0] != '-' && !o->scene, o->scene = a;
    }
    return ok && o->scene && o->out && o->out[0];
}

static int save(const options *o, float *rgb, int width, int height) {
    file_picture picture;
    file_error error;
    picture.rgb = rgb;
    picture.width = width;
    picture.height = height;
    if (!file_pfm_write(o->out, &picture, &error))
        return 0;
    fprintf(stderr, "scatter-reference: %s\n", error.text);
    return 1;
}

static int render(const options *o, const scene_file *file) {
    int width = o->width ? o->width : file->width, height = o->height ? o->height : file->height;
    scatter_view view = scene_view(file, width, height);
    float *rgb = malloc((size_t)width * (size_t)height * 3 * sizeof *rgb);
    int failed = 1;
    if (!rgb || reference_image(&file->scene, &view, width, height, rgb, o->threads))
        fprintf(stderr, "scatter-reference: out of memory\n");
    else
        failed = save(o, rgb, width, height);
    free(rgb);
    return failed;
}

int main(int count, char **argument) {
    static scene_file file;
    options o = {NULL, NULL, 0, 0, 1};
    int failed;
    if (!read_options(count, argument, &o)) {
        fputs(usage, stderr);
        return 2;
    }
    if (scene_read(&file, o.scene)) {
        fprintf(stderr, "scatter-reference: %s\n", file.error);
        return 1;
    }
    failed = render(&o, &file);
    scene_free(&file);
    return failed;
}
