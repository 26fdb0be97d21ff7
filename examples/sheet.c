/* sheet.c - scatter-sheet OUT.png IN.png...: the pictures of the gallery as thumbnails with their
   names. MIT licence, see LICENSE. Pictures that cannot be read are left out and named on the error
   output. */
#define _POSIX_C_SOURCE 200809L
#include "files.h"

#if defined(__GNUC__)
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wconversion"
#pragma GCC diagnostic ignored "-Wshadow"
#pragma GCC diagnostic ignored "-Wunused-function"
#endif
#define STB_IMAGE_IMPLEMENTATION
#include <stb/stb_image.h>
#define STB_IMAGE_RESIZE_STATIC
#define STB_IMAGE_RESIZE_IMPLEMENTATION
#include <stb/stb_image_resize.h>
#include <stb/stb_easy_font.h>
#if defined(__GNUC__)
#pragma GCC diagnostic pop
#endif

enum {
    CELL_WIDTH = 320,
    CELL_HEIGHT = 240,
    LABEL = 26,
    GAP = 8,
    GROUND = 24,
    INK = 200,
    COLUMNS_MOST = 4
};

typedef struct sheet {
    unsigned char *rgb;
    int width, height, columns;
} sheet;

static int make_sheet(sheet *s, int count) {
    s->columns = count < COLUMNS_MOST ? count : COLUMNS_MOST;
    int rows = (count + s->columns - 1) / s->columns;
    s->width = GAP + s->columns * (CELL_WIDTH + GAP);
    s->height = GAP + rows * (CELL_HEIGHT + LABEL + GAP);
    size_t bytes = (size_t)s->width * (size_t)s->height * 3;
    s->rgb = (unsigned char *)malloc(bytes);
    if (s->rgb)
        memset(s->rgb, GROUND, bytes);
    return s->rgb == NULL;
}

/* Fits the picture into the cell whose corner is x, y. */
static int put_picture(sheet *s, const unsigned char *rgb, int width, int height, int x, int y) {
    double scale = fmin((double)CELL_WIDTH / width, (double)CELL_HEIGHT / height);
    int w = (int)fmax(width * scale, 1), h = (int)fmax(height * scale, 1);
    x += (CELL_WIDTH - w) / 2;
    y += (CELL_HEIGHT - h) / 2;
    unsigned char *to = s->rgb + ((size_t)y * (size_t)s->width + (size_t)x) * 3;
    return !stbir_resize_uint8_srgb(rgb, width, height, 0, to, w, h, s->width * 3, 3,
                                    STBIR_ALPHA_CHANNEL_NONE, 0);
}

/* One corner of the font's rectangles: three floats and a colour, as stb_easy_font writes them. */
typedef struct font_corner {
    float x, y, z;
    unsigned char color[4];
} font_corner;

/* Text of height 14, made of rectangles of four corners each, drawn twice as large. */
static void put_text(sheet *s, const char *text, int x, int y) {
    static font_corner corners[4 * 1000];
    char copy[60];
    snprintf(copy, sizeof copy, "%s", text);
    int count = stb_easy_font_print(0, 0, copy, NULL, corners, sizeof corners);
    for (int i = 0; i < count; i++) {
        int x0 = x + (int)(corners[4 * i].x * 2), x1 = x + (int)(corners[4 * i + 2].x * 2);
        int y0 = y + (int)(corners[4 * i].y * 2), y1 = y + (int)(corners[4 * i + 2].y * 2);
        for (int v = y0; v < y1 && v < s->height; v++)
            for (int u = x0; u < x1 && u < s->width; u++)
                memset(s->rgb + ((size_t)v * (size_t)s->width + (size_t)u) * 3, INK, 3);
    }
}

/* "build/gallery/cloud.png" becomes "cloud", at most as long as a cell is wide. */
static void file_title(const char *path, char *title, size_t room) {
    const char *slash = strrchr(path, '/'), *name = slash ? slash + 1 : path;
    snprintf(title, room, "%.*s", (int)strcspn(name, "."), name);
}

/* 0 if there was such a picture. */
static int put_file(sheet *s, const char *path, int cell) {
    int width, height, channels, failed = 1;
    unsigned char *rgb = stbi_load(path, &width, &height, &channels, 3);
    char title[24];
    if (rgb) {
        int x = GAP + cell % s->columns * (CELL_WIDTH + GAP);
        int y = GAP + cell / s->columns * (CELL_HEIGHT + LABEL + GAP);
        failed = put_picture(s, rgb, width, height, x, y);
        file_title(path, title, sizeof title);
        put_text(s, title, x, y + CELL_HEIGHT + 6);
    }
    if (failed)
        fprintf(stderr, "scatter-sheet: %s: left out: %s\n", path,
                rgb ? "out of memory" : stbi_failure_reason());
    stbi_image_free(rgb);
    return failed;
}

/* How many of the files are there; only they get a cell. */
static int count_files(char **paths, int count) {
    int there = 0;
    for (int i = 0; i < count; i++)
        there += access(paths[i], R_OK) == 0;
    return there;
}

int main(int count, char **arguments) {
    file_error error;
    sheet s;
    stbi_write_png_compression_level = 64; /* it is for a web page */
    int used = 0, there = count_files(arguments + 2, count - 2);
    if (count < 3) {
        fputs("usage: scatter-sheet OUT.png IN.png...\n", stderr);
        return 2;
    }
    if (there == 0 || make_sheet(&s, there)) {
        fputs(there ? "scatter-sheet: out of memory\n"
                    : "scatter-sheet: none of the pictures is there\n",
              stderr);
        return 1;
    }
    for (int i = 2; i < count && used < there; i++)
        used += !put_file(&s, arguments[i], used);
    int failed = used ? file_png_write(arguments[1], s.rgb, s.width, s.height, &error)
                      : file_fail(&error, arguments[1], "no picture could be read");
    free(s.rgb);
    if (failed)
        fprintf(stderr, "scatter-sheet: %s\n", error.text);
    return failed;
}
