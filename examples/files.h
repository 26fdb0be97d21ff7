/* files.h - pictures and voxel grids on disk, for the programs of this project. MIT licence, see
   LICENSE.

   Reads and writes PFM and Radiance HDR, writes PNG (through stb, Debian package libstb-dev), reads
   dense `*_NXxNYxNZ_u8.raw` and `*.vol.txt` grids, `.nvdb` grids (through PNanoVDB.h, package
   libnanovdb-dev) and `.vdb` grids by running `nanovdb_convert` (package libnanovdb-tools).

   POSIX: compile with -D_POSIX_C_SOURCE=200809L or define it before the first #include.

   Functions that can fail return 0 for success; otherwise `error` holds one sentence that names the
   file, and the output holds nothing. Pictures and grids are malloc'ed and belong to the caller,
   who frees them. */
#ifndef SCATTER_EXAMPLES_FILES_H
#define SCATTER_EXAMPLES_FILES_H

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <math.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/types.h>
#include <sys/wait.h>
#include <unistd.h>

/* Other people's headers, with our warnings off and, in PNanoVDB.h, all reads checked against the
   buffer. */
#if defined(__GNUC__)
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wconversion"
#pragma GCC diagnostic ignored "-Wmissing-field-initializers"
#pragma GCC diagnostic ignored "-Wpedantic"
#pragma GCC diagnostic ignored "-Wshadow"
#pragma GCC diagnostic ignored "-Wsign-compare"
#ifndef __cplusplus
#pragma GCC diagnostic ignored "-Wstrict-prototypes"
#endif
#pragma GCC diagnostic ignored "-Wundef"
#pragma GCC diagnostic ignored "-Wunused-function"
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif
#define STB_IMAGE_WRITE_STATIC
#define STB_IMAGE_WRITE_IMPLEMENTATION
#include <stb/stb_image_write.h>
#define PNANOVDB_C
#define PNANOVDB_BUF_BOUNDS_CHECK
#include <nanovdb/PNanoVDB.h>
#if defined(__GNUC__)
#pragma GCC diagnostic pop
#endif

/* The most voxels a grid may have: a sparse file of a few bytes can ask for any number. */
#ifndef FILE_VOXELS_MAX
#define FILE_VOXELS_MAX (1u << 29)
#endif

/* ------------------------------------------------------------------------------------- >>types */

typedef struct file_error {
    char text[512];
} file_error;

/* Linear RGB, interleaved, top row first. */
typedef struct file_picture {
    float *rgb; /* width*height*3 */
    int width, height;
} file_picture;

/* Dense voxels, x fastest. */
typedef struct file_grid {
    float *density; /* nx*ny*nz finite values >= 0 */
    int nx, ny, nz;
} file_grid;

/* ------------------------------------------------------------------------------------ >>errors */

/* Writes "path: sentence" (of a long path only the end), returns 1. */
static inline int file_fail(file_error *error, const char *path, const char *format, ...) {
    char sentence[256];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(sentence, sizeof sentence, format, arguments);
    va_end(arguments);
    size_t length = strlen(path), most = sizeof error->text - sizeof sentence - 2;
    snprintf(error->text, sizeof error->text, "%s: %s", path + (length > most ? length - most : 0),
             sentence);
    return 1;
}

/* Whether the file name ends so. */
static inline int file_ends_with(const char *path, const char *ending) {
    size_t length = strlen(path), tail = strlen(ending);
    return length >= tail && strcmp(path + length - tail, ending) == 0;
}

/* ------------------------------------------------------------------------------------- >>bytes */

/* Reads at most `limit` bytes from where the stream stands; NULL with errno if that fails. */
static inline char *file_read_stream(FILE *stream, size_t limit, size_t *bytes) {
    size_t capacity = 1u << 16, count = 0, got = 1;
    char *data = (char *)malloc(capacity);
    while (data && got && count < limit) {
        size_t room = capacity - 1 - count;
        got = fread(data + count, 1, room < limit - count ? room : limit - count, stream);
        count += got;
        if (count == capacity - 1) {
            char *more = capacity <= SIZE_MAX / 2 ? (char *)realloc(data, capacity *= 2) : NULL;
            if (!more) {
                free(data);
                errno = ENOMEM;
            }
            data = more;
        }
    }
    if (data && ferror(stream)) {
        free(data);
        return NULL;
    }
    if (data)
        data[count] = 0;
    *bytes = count;
    return data;
}

/* The first `limit` bytes of a file (SIZE_MAX: all); one more byte 0 stands behind its `bytes`
   bytes. */
static inline int file_read(const char *path, size_t limit, char **data, size_t *bytes,
                            file_error *error) {
    FILE *stream = fopen(path, "rb");
    *data = NULL;
    *bytes = 0;
    if (!stream)
        return file_fail(error, path, "cannot be opened: %s", strerror(errno));
    *data = file_read_stream(stream, limit, bytes);
    if (!*data)
        file_fail(error, path, "cannot be read: %s", strerror(errno));
    fclose(stream);
    return *data ? 0 : 1;
}

static inline uint32_t file_u32(const char *bytes) {
    const unsigned char *b = (const unsigned char *)bytes;
    return (uint32_t)b[0] | (uint32_t)b[1] << 8 | (uint32_t)b[2] << 16 | (uint32_t)b[3] << 24;
}

static inline uint64_t file_u64(const char *bytes) {
    return file_u32(bytes) | (uint64_t)file_u32(bytes + 4) << 32;
}

static inline float file_float(uint32_t bits) {
    float value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

/* ----------------------------------------------------------------------------------- >>numbers */

/* mantissa * 10^exponent. Powers up to 10^22 are exact in double, so ordinary numbers are rounded
   once. */
static inline double file_decimal(double mantissa, int exponent) {
    if (mantissa <= 0 || exponent < -400)
        return 0;
    if (exponent > 400)
        return HUGE_VAL;
    for (; exponent > 22; exponent -= 22)
        mantissa *= 1e22;
    for (; exponent < -22; exponent += 22)
        mantissa /= 1e22;
    double power = 1;
    for (int i = abs(exponent); i > 0; i--)
        power *= 10;
    return exponent < 0 ? mantissa / power : mantissa * power;
}

/* Digits into *mantissa (the first 18 count), returns how many there were. Digits behind the point
   lower *exponent, digits that no longer count raise it. */
static inline size_t file_digits(const char **at, const char *end, int fraction, uint64_t *mantissa,
                                 int *exponent) {
    const char *begin = *at;
    for (; *at < end && **at >= '0' && **at <= '9'; ++*at) {
        int counts = *mantissa < 100000000000000000u;
        if (counts)
            *mantissa = *mantissa * 10 + (uint64_t)(**at - '0');
        int step = fraction ? (counts ? -1 : 0) : (counts ? 0 : 1);
        *exponent += abs(*exponent) < 100000 ? step : 0;
    }
    return (size_t)(*at - begin);
}

static inline int file_sign(const char **at, const char *end) {
    int negative = *at < end && **at == '-';
    if (*at < end && (**at == '-' || **at == '+'))
        ++*at;
    return negative;
}

/* Decimal exponent "e-12" after a number; 0 and *at unmoved if there is none. */
static inline int file_exponent(const char **at, const char *end) {
    const char *p = *at;
    if (p >= end || (*p != 'e' && *p != 'E'))
        return 0;
    p++;
    int negative = file_sign(&p, end), unused = 0;
    uint64_t digits = 0;
    if (!file_digits(&p, end, 0, &digits, &unused))
        return 0;
    *at = p;
    int value = digits > 1000000 || unused ? 1000000 : (int)digits;
    return negative ? -value : value;
}

/* A decimal number such as -12.5e-3, the same in every locale; *at moves behind it. Returns 0, or 1
   if there is no number. Too large numbers become infinite. "nan", "inf" and hexadecimal are no
   numbers here. */
static inline int file_number(const char **at, const char *end, double *value) {
    const char *p = *at;
    uint64_t mantissa = 0;
    int exponent = 0, negative = file_sign(&p, end);
    size_t digits = file_digits(&p, end, 0, &mantissa, &exponent);
    if (p < end && *p == '.') {
        p++;
        digits += file_digits(&p, end, 1, &mantissa, &exponent);
    }
    if (!digits)
        return 1;
    exponent += file_exponent(&p, end);
    *value = file_decimal((double)mantissa, exponent) * (negative ? -1 : 1);
    *at = p;
    return 0;
}

/* --------------------------------------------------------------------------------------- >>pfm */

static inline int file_is_space(char c) {
    return c == ' ' || c == '\t' || c == '\n' || c == '\r';
}

/* The next number behind blanks. */
static inline int file_spaced_number(const char **at, const char *end, double *value) {
    while (*at < end && file_is_space(**at))
        ++*at;
    return file_number(at, end, value);
}

/* "PF", width, height and scale, then exactly one blank; *at moves behind it. */
static inline int file_pfm_header(const char **at, const char *end, double value[3]) {
    if (end - *at < 3 || memcmp(*at, "PF", 2) != 0)
        return 1;
    *at += 2;
    for (int i = 0; i < 3; i++) {
        if (*at >= end || !file_is_space(**at) || file_spaced_number(at, end, &value[i]))
            return 1;
    }
    if (*at >= end || !file_is_space(**at))
        return 1;
    ++*at;
    return 0;
}

static inline int file_is_size(double value) {
    return value >= 1 && value <= 1 << 20 && value == floor(value);
}

/* The rows, bottom row first; a negative scale says that the least significant byte comes first. */
static inline int file_pfm_pixels(const char *at, int little, file_picture *out) {
    size_t row = (size_t)out->width * 3;
    for (size_t i = 0; i < row * (size_t)out->height; i++) {
        const char *b = at + 4 * i;
        char reversed[4] = {b[3], b[2], b[1], b[0]};
        float value = file_float(file_u32(little ? b : reversed));
        if (!isfinite(value))
            return 1;
        out->rgb[((size_t)out->height - 1 - i / row) * row + i % row] = value;
    }
    return 0;
}

/* From memory; `path` is for the sentence only. */
static inline int file_pfm_parse(const char *data, size_t bytes, const char *path,
                                 file_picture *out, file_error *error) {
    double v[3] = {0};
    const char *at = data;
    memset(out, 0, sizeof *out);
    if (file_pfm_header(&at, data + bytes, v))
        return file_fail(error, path, "expected a PFM header: PF, width, height, scale");
    if (!file_is_size(v[0]) || !file_is_size(v[1]) || !(fabs(v[2]) > 0))
        return file_fail(error, path,
                         "expected a width and height of 1 to 1048576 and a scale other than 0");
    double expected = v[0] * v[1] * 12, left = (double)(data + bytes - at);
    if (expected != left)
        return file_fail(error, path, "expected %.0f bytes of pixels for %.0fx%.0f, found %.0f",
                         expected, v[0], v[1], left);
    out->width = (int)v[0];
    out->height = (int)v[1];
    out->rgb = (float *)malloc((size_t)expected);
    int failed = !out->rgb ? file_fail(error, path, "out of memory") : 0;
    if (!failed && file_pfm_pixels(at, v[2] < 0, out))
        failed = file_fail(error, path, "expected finite pixels");
    if (failed) {
        free(out->rgb);
        memset(out, 0, sizeof *out);
    }
    return failed;
}

/* Portable float map: linear RGB, either byte order, bottom row first in the file. */
static inline int file_pfm_read(const char *path, file_picture *out, file_error *error) {
    char *data;
    size_t bytes;
    memset(out, 0, sizeof *out);
    if (file_read(path, SIZE_MAX, &data, &bytes, error))
        return 1;
    int failed = file_pfm_parse(data, bytes, path, out, error);
    free(data);
    return failed;
}

/* --------------------------------------------------------------------------------------- >>hdr */

/* The line that *at stands at, without its end; *at moves behind that. 1: the text ends before. */
static inline int file_line(const char **at, const char *end, const char **line, size_t *length) {
    const char *newline = (const char *)memchr(*at, '\n', (size_t)(end - *at));
    if (!newline)
        return 1;
    *line = *at;
    *length = (size_t)(newline - *at);
    *length -= *length > 0 && newline[-1] == '\r';
    *at = newline + 1;
    return 0;
}

/* Whether `line` begins with `key`; *at is then what stands behind it. */
static inline int file_begins(const char *line, size_t length, const char *key, const char **at) {
    size_t bytes = strlen(key);
    *at = line + bytes;
    return length >= bytes && memcmp(line, key, bytes) == 0;
}

/* Lines of a Radiance file up to the empty one: the format must be RGBE, pixels are radiance times
   all exposures. */
static inline int file_hdr_variables(const char **at, const char *end, double *exposure) {
    const char *line, *value;
    size_t length;
    int known = 0;
    *exposure = 1;
    if (file_line(at, end, &line, &length) || !file_begins(line, length, "#?", &value))
        return 1;
    while (!file_line(at, end, &line, &length)) {
        double factor = 0;
        if (length == 0)
            return !known || !(*exposure > 0 && *exposure <= 1e30);
        if (file_begins(line, length, "FORMAT=", &value))
            known = length == 22 && memcmp(value, "32-bit_rle_rgbe", 15) == 0;
        if (file_begins(line, length, "EXPOSURE=", &value) &&
            (file_spaced_number(&value, line + length, &factor) || !((*exposure *= factor) > 0)))
            return 1;
    }
    return 1;
}

/* "-Y height +X width": rows from the top, pixels from the left. */
static inline int file_hdr_size(const char **at, const char *end, double size[2]) {
    const char *line, *p;
    size_t length;
    return file_line(at, end, &line, &length) || !file_begins(line, length, "-Y ", &p) ||
           file_number(&p, line + length, &size[1]) ||
           !file_begins(p, (size_t)(line + length - p), " +X ", &p) ||
           file_number(&p, line + length, &size[0]) || p != line + length;
}

/* One of the four components of a row: a count above 128 stands before a byte that is there
   count - 128 times, another count before that many bytes. */
static inline int file_hdr_component(const char **at, const char *end, char *out, int width) {
    for (int x = 0; x < width;) {
        int count = *at < end ? (unsigned char)*(*at)++ : 0, repeated = count > 128;
        count -= repeated ? 128 : 0;
        if (count == 0 || count > width - x || end - *at < (repeated ? 1 : count))
            return 1;
        for (int i = 0; i < count; i++)
            out[4 * x++] = (*at)[repeated ? 0 : i];
        *at += repeated ? 1 : count;
    }
    return 0;
}

/* A row as RGBE: its components one behind the other, or else pixel by pixel. */
static inline int file_hdr_row(const char **at, const char *end, char *rgbe, int width) {
    const char *b = *at;
    if (width < 8 || width > 32767 || end - b < 4 || b[0] != 2 || b[1] != 2 || b[2] < 0) {
        if (end - b < 4 * (ptrdiff_t)width)
            return 1;
        memcpy(rgbe, b, 4 * (size_t)width);
        *at += 4 * (ptrdiff_t)width;
        return 0;
    }
    if (((unsigned char)b[2] << 8 | (unsigned char)b[3]) != width)
        return 1;
    *at += 4;
    for (int c = 0; c < 4; c++)
        if (file_hdr_component(at, end, rgbe + c, width))
            return 1;
    return 0;
}

/* Mantissas of 8 bits and their common exponent. 2^127 and more would not fit with an exposure. */
static inline int file_hdr_pixel(const char *rgbe, double exposure, float *rgb) {
    int exponent = (unsigned char)rgbe[3];
    double scale = exponent ? ldexp(1 / exposure, exponent - 136) : 0;
    for (int c = 0; c < 3; c++) {
        double value = (unsigned char)rgbe[c] * scale;
        if (!(value < 3e38))
            return 1;
        rgb[c] = (float)value;
    }
    return 0;
}

/* All rows, whose memory is there. */
static inline int file_hdr_pixels(const char *at, const char *end, double exposure, char *rgbe,
                                  file_picture *out) {
    float *rgb = out->rgb;
    for (int y = 0; y < out->height; y++) {
        if (file_hdr_row(&at, end, rgbe, out->width))
            return 1;
        for (int x = 0; x < out->width; x++, rgb += 3)
            if (file_hdr_pixel(rgbe + 4 * (size_t)x, exposure, rgb))
                return 1;
    }
    return 0;
}

/* The least that so many pixels take: 127 equal bytes are two. So a short file cannot ask for much
   memory. */
static inline double file_hdr_least(double width, double height) {
    return height * fmin(4 * width, 4 + 8 * ceil(width / 127));
}

/* From memory; `path` is for the sentence only. */
static inline int file_hdr_parse(const char *data, size_t bytes, const char *path,
                                 file_picture *out, file_error *error) {
    const char *at = data, *end = data + bytes;
    double size[2], exposure;
    memset(out, 0, sizeof *out);
    if (file_hdr_variables(&at, end, &exposure))
        return file_fail(error, path,
                         "expected a Radiance header: #?RADIANCE, FORMAT=32-bit_rle_rgbe, an empty "
                         "line");
    if (file_hdr_size(&at, end, size) || !file_is_size(size[0]) || !file_is_size(size[1]))
        return file_fail(error, path, "expected a size: -Y height +X width, each 1 to 1048576");
    if (file_hdr_least(size[0], size[1]) > (double)(end - at))
        return file_fail(error, path, "the file is truncated");
    out->width = (int)size[0];
    out->height = (int)size[1];
    out->rgb = (float *)malloc((size_t)(size[0] * size[1]) * 3 * sizeof(float));
    char *rgbe = (char *)malloc((size_t)size[0] * 4);
    int failed = !out->rgb || !rgbe ? file_fail(error, path, "out of memory") : 0;
    if (!failed && file_hdr_pixels(at, end, exposure, rgbe, out))
        failed = file_fail(error, path, "the file is truncated or damaged");
    free(rgbe);
    if (failed) {
        free(out->rgb);
        memset(out, 0, sizeof *out);
    }
    return failed;
}

/* Radiance picture: linear RGB, plain or run-length coded. */
static inline int file_hdr_read(const char *path, file_picture *out, file_error *error) {
    char *data;
    size_t bytes;
    memset(out, 0, sizeof *out);
    if (!file_ends_with(path, ".hdr"))
        return file_fail(error, path, "expected a file name ending in .hdr");
    if (file_read(path, SIZE_MAX, &data, &bytes, error))
        return 1;
    int failed = file_hdr_parse(data, bytes, path, out, error);
    free(data);
    return failed;
}

/* ----------------------------------------------------------------------------------- >>writing */

/* A file being written, and whether all went well so far. */
typedef struct file_sink {
    FILE *stream;
    int failed;
} file_sink;

static inline void file_sink_write(void *context, void *data, int bytes) {
    file_sink *sink = (file_sink *)context;
    if (fwrite(data, 1, (size_t)bytes, sink->stream) != (size_t)bytes)
        sink->failed = 1;
}

static inline int file_sink_open(file_sink *sink, const char *path, file_error *error) {
    sink->failed = 0;
    sink->stream = fopen(path, "wb");
    return sink->stream ? 0 : file_fail(error, path, "cannot be created: %s", strerror(errno));
}

/* A full disk is often noticed only here. */
static inline int file_sink_close(file_sink *sink, const char *path, file_error *error) {
    int unsaved = fclose(sink->stream) != 0;
    return unsaved || sink->failed ? file_fail(error, path, "cannot be written completely") : 0;
}

/* One float, least significant byte first. */
static inline void file_put_float(file_sink *sink, float value) {
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    unsigned char b[4] = {(unsigned char)(bits & 255), (unsigned char)(bits >> 8 & 255),
                          (unsigned char)(bits >> 16 & 255), (unsigned char)(bits >> 24)};
    file_sink_write(sink, b, 4);
}

static inline int file_pfm_write(const char *path, const file_picture *picture, file_error *error) {
    file_sink sink;
    if (file_sink_open(&sink, path, error))
        return 1;
    if (fprintf(sink.stream, "PF\n%d %d\n-1.0\n", picture->width, picture->height) < 0)
        sink.failed = 1;
    size_t row = (size_t)picture->width * 3;
    for (int y = picture->height - 1; y >= 0; y--)
        for (size_t x = 0; x < row; x++)
            file_put_float(&sink, picture->rgb[(size_t)y * row + x]);
    return file_sink_close(&sink, path, error);
}

/* Radiance HDR: linear RGB, shared exponent. */
static inline int file_hdr_write(const char *path, const file_picture *picture, file_error *error) {
    file_sink sink;
    if (file_sink_open(&sink, path, error))
        return 1;
    if (!stbi_write_hdr_to_func(file_sink_write, &sink, picture->width, picture->height, 3,
                                picture->rgb))
        sink.failed = 1;
    return file_sink_close(&sink, path, error);
}

/* sRGB bytes, three a pixel, top row first. */
static inline int file_png_write(const char *path, const unsigned char *rgb, int width, int height,
                                 file_error *error) {
    file_sink sink;
    if (width > INT_MAX / 4 / height)
        return file_fail(error, path, "%dx%d pixels are too many for a PNG", width, height);
    if (file_sink_open(&sink, path, error))
        return 1;
    if (!stbi_write_png_to_func(file_sink_write, &sink, width, height, 3, rgb, width * 3))
        sink.failed = 1;
    return file_sink_close(&sink, path, error);
}

/* --------------------------------------------------------------------------------------- >>raw */

static inline void file_grid_free(file_grid *grid) {
    free(grid->density);
    memset(grid, 0, sizeof *grid);
}

/* Memory for nx*ny*nz voxels; each size is 1 to INT_MAX. */
static inline int file_grid_allocate(file_grid *out, double nx, double ny, double nz,
                                     const char *path, file_error *error) {
    memset(out, 0, sizeof *out);
    if (nx * ny * nz > FILE_VOXELS_MAX)
        return file_fail(error, path, "%.0fx%.0fx%.0f voxels, expected at most %u", nx, ny, nz,
                         FILE_VOXELS_MAX);
    out->nx = (int)nx;
    out->ny = (int)ny;
    out->nz = (int)nz;
    out->density = (float *)malloc((size_t)(nx * ny * nz) * sizeof(float));
    return out->density ? 0 : file_fail(error, path, "out of memory");
}

/* A whole number 1..INT_MAX with `before` in front of it; *at moves behind it. */
static inline int file_raw_size(const char **at, const char *before, double *size) {
    size_t length = strlen(before);
    if (strncmp(*at, before, length) != 0)
        return 1;
    *at += length;
    *size = 0;
    for (; **at >= '0' && **at <= '9'; ++*at)
        *size = *size * 10 + (**at - '0');
    return *size < 1 || *size > INT_MAX;
}

/* The sizes in a name like smoke_48x64x48_u8.raw: behind the last _ but one. */
static inline int file_raw_sizes(const char *path, double size[3]) {
    const char *at = path + strlen(path);
    for (int underscores = 0; at > path && underscores < 2;)
        underscores += *--at == '_';
    return file_raw_size(&at, "_", &size[0]) || file_raw_size(&at, "x", &size[1]) ||
           file_raw_size(&at, "x", &size[2]) || strcmp(at, "_u8.raw") != 0;
}

/* Dense bytes, x fastest; a density is byte/255. */
static inline int file_raw_read(const char *path, file_grid *out, file_error *error) {
    double n[3];
    char *data;
    size_t bytes;
    memset(out, 0, sizeof *out);
    if (file_raw_sizes(path, n))
        return file_fail(error, path,
                         "expected a name like *_NXxNYxNZ_u8.raw with sizes of at least 1");
    if (file_grid_allocate(out, n[0], n[1], n[2], path, error))
        return 1;
    size_t expected = (size_t)(n[0] * n[1] * n[2]);
    int failed = file_read(path, expected + 1, &data, &bytes, error);
    if (!failed && bytes != expected)
        failed = file_fail(error, path, "expected %.0f bytes, one a voxel, found %s",
                           (double)expected, bytes < expected ? "less" : "more");
    for (size_t i = 0; !failed && i < expected; i++)
        out->density[i] = (float)(unsigned char)data[i] / 255.0f;
    free(data);
    if (failed)
        file_grid_free(out);
    return failed;
}

/* --------------------------------------------------------------------------------------- >>vol */

/* All voxels, and nothing behind them. */
static inline int file_vol_voxels(const char *at, const char *end, file_grid *out) {
    size_t count = (size_t)out->nx * (size_t)out->ny * (size_t)out->nz;
    for (size_t i = 0; i < count; i++) {
        double value;
        if (file_spaced_number(&at, end, &value) || !(value >= 0 && value <= 3e38))
            return 1;
        out->density[i] = (float)value;
    }
    while (at < end && file_is_space(*at))
        at++;
    return at < end;
}

/* From memory; `path` is for the sentence only. */
static inline int file_vol_parse(const char *data, size_t bytes, const char *path, file_grid *out,
                                 file_error *error) {
    const char *at = data, *end = data + bytes;
    double n[3];
    memset(out, 0, sizeof *out);
    for (int i = 0; i < 3; i++)
        if (file_spaced_number(&at, end, &n[i]) || !file_is_size(n[i]))
            return file_fail(error, path, "expected three sizes of 1 to 1048576 first");
    if (2 * n[0] * n[1] * n[2] > (double)(end - at)) /* a blank and a digit each */
        return file_fail(error, path, "expected %.0f densities, found less", n[0] * n[1] * n[2]);
    if (file_grid_allocate(out, n[0], n[1], n[2], path, error))
        return 1;
    if (!file_vol_voxels(at, end, out))
        return 0;
    file_grid_free(out);
    return file_fail(error, path, "expected %.0f densities >= 0 and nothing behind",
                     n[0] * n[1] * n[2]);
}

/* Text: three sizes, then the densities, x fastest. */
static inline int file_vol_read(const char *path, file_grid *out, file_error *error) {
    char *data;
    size_t bytes;
    memset(out, 0, sizeof *out);
    if (file_read(path, SIZE_MAX, &data, &bytes, error))
        return 1;
    int failed = file_vol_parse(data, bytes, path, out, error);
    free(data);
    return failed;
}

/* -------------------------------------------------------------------------------------- >>nvdb */

/* File: a header of 16 bytes, then for each grid 176 bytes and its name, then the grids themselves.
   */
enum { FILE_NVDB_HEADER = 16, FILE_NVDB_META = 176 };

/* Where one grid of the file lies, and what its name is. */
typedef struct file_nvdb_entry {
    const char *name;
    uint64_t offset, bytes;
    unsigned codec;
} file_nvdb_entry;

/* Directory entry at `meta`; *next becomes the offset of the entry behind it. */
static inline int file_nvdb_entry_at(const char *data, size_t bytes, uint64_t meta,
                                     file_nvdb_entry *entry, uint64_t *next) {
    if (meta > bytes || bytes - meta < FILE_NVDB_META)
        return 1;
    uint64_t name_bytes = file_u32(data + meta + 136);
    *next = meta + FILE_NVDB_META + name_bytes;
    entry->name = data + meta + FILE_NVDB_META;
    entry->bytes = file_u64(data + meta + 8);
    entry->codec = file_u32(data + meta + 168) & 0xffffu;
    return *next > bytes || name_bytes < 1 || data[*next - 1] != 0;
}

/* The grid called "density", else the first one. */
static inline int file_nvdb_find(const char *data, size_t bytes, file_nvdb_entry *found) {
    uint32_t count = file_u32(data + 12) & 0xffffu;
    uint64_t meta = FILE_NVDB_HEADER, start = 0;
    int named = 0;
    memset(found, 0, sizeof *found);
    for (uint32_t i = 0; i < count; i++) {
        file_nvdb_entry entry;
        if (file_nvdb_entry_at(data, bytes, meta, &entry, &meta) || entry.bytes > bytes)
            return 1;
        entry.offset = start;
        start += entry.bytes;
        if (i == 0 || (!named && strcmp(entry.name, "density") == 0)) {
            *found = entry;
            named = strcmp(entry.name, "density") == 0;
        }
    }
    found->offset += meta;
    return count == 0 || start > bytes - meta;
}

/* A grid opened for reading. */
typedef struct file_nvdb {
    pnanovdb_buf_t buffer;
    uint64_t bytes;
    pnanovdb_root_handle_t root;
    pnanovdb_grid_type_t type;
} file_nvdb;

/* How many words the value at `address` takes: a quantised leaf is 512 values of 1 << log2 bits. */
static inline uint32_t file_nvdb_words(const file_nvdb *grid, pnanovdb_address_t address,
                                       uint32_t level) {
    uint32_t log2 = 0;
    if (level > 0 || grid->type == PNANOVDB_GRID_TYPE_FLOAT)
        return 1;
    switch (grid->type) {
    case PNANOVDB_GRID_TYPE_FP4: log2 = 2; break;
    case PNANOVDB_GRID_TYPE_FP8: log2 = 3; break;
    case PNANOVDB_GRID_TYPE_FP16: log2 = 4; break;
    default:
        log2 = pnanovdb_read_uint32(grid->buffer, pnanovdb_address_offset_neg(address, 84)) >> 29;
    }
    return 16u << log2;
}

static inline float file_nvdb_decode(const file_nvdb *grid, pnanovdb_address_t address,
                                     uint32_t level, const pnanovdb_coord_t *at) {
    switch (grid->type) {
    case PNANOVDB_GRID_TYPE_FP4:
        return pnanovdb_root_fp4_read_float(grid->buffer, address, at, level);
    case PNANOVDB_GRID_TYPE_FP8:
        return pnanovdb_root_fp8_read_float(grid->buffer, address, at, level);
    case PNANOVDB_GRID_TYPE_FP16:
        return pnanovdb_root_fp16_read_float(grid->buffer, address, at, level);
    case PNANOVDB_GRID_TYPE_FPN:
        return pnanovdb_root_fpn_read_float(grid->buffer, address, at, level);
    default: return pnanovdb_read_float(grid->buffer, address);
    }
}

/* Density at an index; NaN where the tree points outside the grid, which only a damaged file does.
   */
static inline float file_nvdb_value(const file_nvdb *grid, pnanovdb_readaccessor_t *accessor,
                                    const pnanovdb_coord_t *at) {
    uint32_t level = 0;
    pnanovdb_address_t address = pnanovdb_readaccessor_get_value_address_and_level(
        grid->type, grid->buffer, accessor, at, &level);
    uint64_t word = address.byte_offset / 4, end = grid->bytes / 4;
    if (address.byte_offset % 4 || address.byte_offset < PNANOVDB_GRID_SIZE || word >= end)
        return NAN;
    uint32_t words = file_nvdb_words(grid, address, level);
    if (words > 256 || words > end - word) /* 16 bits a value are the most that exist */
        return NAN;
    return file_nvdb_decode(grid, address, level, at);
}

/* All voxels of the bounding box, x fastest. Negative and non-finite densities are refused. */
static inline int file_nvdb_fill(const file_nvdb *grid, pnanovdb_coord_t low, const char *path,
                                 file_grid *out, file_error *error) {
    pnanovdb_readaccessor_t accessor;
    pnanovdb_readaccessor_init(&accessor, grid->root);
    float *voxel = out->density;
    for (int k = 0; k < out->nz; k++)
        for (int j = 0; j < out->ny; j++)
            for (int i = 0; i < out->nx; i++) {
                pnanovdb_coord_t at = {low.x + i, low.y + j, low.z + k};
                float value = file_nvdb_value(grid, &accessor, &at);
                if (!(value >= 0 && isfinite(value)))
                    return file_fail(error, path,
                                     "expected a finite density >= 0 at voxel %d %d %d", at.x, at.y,
                                     at.z);
                *voxel++ = value;
            }
    return 0;
}

/* Grid header, type and tree root. `words` holds the grid alone, from its first byte. */
static inline int file_nvdb_open(uint32_t *words, uint64_t bytes, const char *path, file_nvdb *grid,
                                 file_error *error) {
    pnanovdb_grid_handle_t handle = {{0}};
    memset(grid, 0, sizeof *grid);
    grid->buffer = pnanovdb_make_buf(words, bytes / 4);
    grid->bytes = bytes;
    grid->type = pnanovdb_grid_get_grid_type(grid->buffer, handle);
    uint32_t version = pnanovdb_grid_get_version(grid->buffer, handle);
    if (bytes < PNANOVDB_GRID_SIZE ||
        pnanovdb_grid_get_magic(grid->buffer, handle) != PNANOVDB_MAGIC_NUMBER ||
        pnanovdb_version_get_major(version) != PNANOVDB_MAJOR_VERSION_NUMBER)
        return file_fail(error, path, "expected a NanoVDB grid of version %d",
                         PNANOVDB_MAJOR_VERSION_NUMBER);
    if (grid->type != PNANOVDB_GRID_TYPE_FLOAT &&
        (grid->type < PNANOVDB_GRID_TYPE_FP4 || grid->type > PNANOVDB_GRID_TYPE_FPN))
        return file_fail(error, path, "expected a grid of type float, Fp4, Fp8, Fp16 or FpN");
    grid->root = pnanovdb_tree_get_root(grid->buffer, pnanovdb_grid_get_tree(grid->buffer, handle));
    uint64_t tiles = pnanovdb_root_get_tile_count(grid->buffer, grid->root);
    uint64_t root_end = grid->root.address.byte_offset;
    if (root_end > bytes || tiles * 32 > bytes - root_end)
        return file_fail(error, path, "the tree points outside the file");
    return 0;
}

/* From the grid's own bytes to dense voxels over the bounding box of the active ones. */
static inline int file_nvdb_grid(uint32_t *words, uint64_t bytes, const char *path, file_grid *out,
                                 file_error *error) {
    file_nvdb grid;
    if (file_nvdb_open(words, bytes, path, &grid, error))
        return 1;
    pnanovdb_coord_t low = pnanovdb_root_get_bbox_min(grid.buffer, grid.root);
    pnanovdb_coord_t high = pnanovdb_root_get_bbox_max(grid.buffer, grid.root);
    double nx = (double)high.x - low.x + 1, ny = (double)high.y - low.y + 1,
           nz = (double)high.z - low.z + 1;
    if (nx < 1 || ny < 1 || nz < 1)
        return file_fail(error, path, "expected a grid with active voxels");
    if (file_grid_allocate(out, nx, ny, nz, path, error))
        return 1;
    int failed = file_nvdb_fill(&grid, low, path, out, error);
    if (failed)
        file_grid_free(out);
    return failed;
}

/* From memory; `path` is for the sentence only. */
static inline int file_nvdb_parse(const char *data, size_t bytes, const char *path, file_grid *out,
                                  file_error *error) {
    file_nvdb_entry entry;
    memset(out, 0, sizeof *out);
    if (bytes < FILE_NVDB_HEADER || file_u64(data) != PNANOVDB_MAGIC_NUMBER)
        return file_fail(error, path, "expected a NanoVDB file (NanoVDB0, little-endian)");
    if (file_u32(data + 8) >> 21 != PNANOVDB_MAJOR_VERSION_NUMBER)
        return file_fail(error, path, "expected NanoVDB version %d", PNANOVDB_MAJOR_VERSION_NUMBER);
    if (file_nvdb_find(data, bytes, &entry))
        return file_fail(error, path, "the file is truncated");
    if (entry.codec != 0)
        return file_fail(error, path,
                         "the grid is compressed; write it with nanovdb_convert without -z and -b");
    uint32_t *words = (uint32_t *)calloc((size_t)entry.bytes / 8 + 1, 8);
    if (!words)
        return file_fail(error, path, "out of memory");
    memcpy(words, data + entry.offset, (size_t)entry.bytes);
    int failed = file_nvdb_grid(words, entry.bytes, path, out, error);
    free(words);
    return failed;
}

static inline int file_nvdb_read(const char *path, file_grid *out, file_error *error) {
    char *data;
    size_t bytes;
    memset(out, 0, sizeof *out);
    if (file_read(path, SIZE_MAX, &data, &bytes, error))
        return 1;
    int failed = file_nvdb_parse(data, bytes, path, out, error);
    free(data);
    return failed;
}

/* --------------------------------------------------------------------------------------- >>vdb */

/* A .vdb file, only to see whether all of it is there: nanovdb_convert takes half a file without a
   word. */
typedef struct file_vdb {
    const char *data;
    uint64_t bytes, at;
    int failed; /* something was outside the file */
} file_vdb;

static inline uint64_t file_vdb_skip(file_vdb *vdb, uint64_t count) {
    uint64_t at = vdb->at;
    if (count > vdb->bytes - vdb->at)
        vdb->failed = 1;
    else
        vdb->at += count;
    return at;
}

static inline uint32_t file_vdb_u32(file_vdb *vdb) {
    uint64_t at = file_vdb_skip(vdb, 4);
    return vdb->failed ? 0 : file_u32(vdb->data + at);
}

/* Name, type and parent name, then the offsets of the grid, of its blocks and of its end; goes to
   the end. */
static inline void file_vdb_skip_grid(file_vdb *vdb) {
    for (int i = 0; i < 3; i++)
        file_vdb_skip(vdb, file_vdb_u32(vdb));
    uint64_t at = file_vdb_skip(vdb, 24);
    uint64_t end = vdb->failed ? 0 : file_u64(vdb->data + at + 16);
    if (end < vdb->at || end > vdb->bytes)
        vdb->failed = 1;
    else
        vdb->at = end;
}

/* Whether header, metadata and all grids lie inside the file. */
static inline int file_vdb_check(const char *data, size_t bytes, const char *path,
                                 file_error *error) {
    file_vdb vdb = {data, bytes, 0, 0};
    if (bytes < 57 || memcmp(data, " BDV\0\0\0\0", 8) != 0 || file_u32(data + 8) < 216)
        return file_fail(error, path, "expected an OpenVDB file of version 216 or later");
    if (data[20] == 0)
        return file_fail(error, path, "expected an OpenVDB file with grid offsets, not a stream");
    vdb.at = 57; /* magic 8, version 4, library 8, has offsets 1, uuid 36 */
    uint32_t entries = file_vdb_u32(&vdb);
    for (uint32_t i = 0; i < entries && !vdb.failed; i++)
        for (int part = 0; part < 3; part++) /* name, type, value */
            file_vdb_skip(&vdb, file_vdb_u32(&vdb));
    uint32_t grids = file_vdb_u32(&vdb);
    for (uint32_t i = 0; i < grids && !vdb.failed; i++)
        file_vdb_skip_grid(&vdb);
    return vdb.failed ? file_fail(error, path, "the file is truncated") : 0;
}

/* Runs nanovdb_convert, silently; its exit status, 127 if it is not installed, -1 if nothing could
   be run. */
static inline int file_convert(const char *from, const char *to) {
    int status = 0;
    pid_t child = fork();
    if (child == 0) {
        int nothing = open("/dev/null", O_RDWR);
        if (nothing >= 0 && dup2(nothing, 1) >= 0 && dup2(nothing, 2) >= 0)
            execlp("nanovdb_convert", "nanovdb_convert", "-f", from, to, (char *)NULL);
        _exit(127);
    }
    while (child > 0 && waitpid(child, &status, 0) < 0)
        if (errno != EINTR)
            return -1;
    return child > 0 && WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

/* Converts into a directory of its own, reads the result and removes both. */
static inline int file_vdb_convert(const char *path, file_grid *out, file_error *error) {
    const char *temporary = getenv("TMPDIR");
    char directory[PATH_MAX], result[PATH_MAX + 16], source[PATH_MAX + 16];
    int length =
        snprintf(directory, sizeof directory, "%s/scatter-XXXXXX", temporary ? temporary : "/tmp");
    if (length < 0 || (size_t)length >= sizeof directory || !mkdtemp(directory))
        return file_fail(error, path, "cannot create a temporary directory in TMPDIR");
    snprintf(result, sizeof result, "%s/grid.nvdb", directory);
    snprintf(source, sizeof source, "%s%s", path[0] == '-' ? "./" : "", path); /* not an option */
    int status = file_convert(source, result), failed;
    if (status == 127)
        failed = file_fail(error, path,
                           "reading .vdb needs nanovdb_convert (Debian package libnanovdb-tools)");
    else if (status != 0)
        failed = file_fail(error, path, "nanovdb_convert cannot read it");
    else
        failed = file_nvdb_read(result, out, error);
    unlink(result);
    rmdir(directory);
    return failed;
}

static inline int file_vdb_read(const char *path, file_grid *out, file_error *error) {
    char *data;
    size_t bytes;
    memset(out, 0, sizeof *out);
    if (strlen(path) >= PATH_MAX)
        return file_fail(error, path, "expected a path shorter than %d characters", PATH_MAX);
    if (file_read(path, SIZE_MAX, &data, &bytes, error))
        return 1;
    int failed = file_vdb_check(data, bytes, path, error);
    free(data);
    return failed ? 1 : file_vdb_convert(path, out, error);
}

/* ------------------------------------------------------------------------------------- >>grids */

/* By the ending of the name: .raw, .vol.txt, .nvdb or .vdb. Sparse grids become dense over the bounding box
   of their active voxels. */
static inline int file_grid_read(const char *path, file_grid *out, file_error *error) {
    memset(out, 0, sizeof *out);
    if (file_ends_with(path, ".raw"))
        return file_raw_read(path, out, error);
    if (file_ends_with(path, ".vol.txt"))
        return file_vol_read(path, out, error);
    if (file_ends_with(path, ".nvdb"))
        return file_nvdb_read(path, out, error);
    if (file_ends_with(path, ".vdb"))
        return file_vdb_read(path, out, error);
    return file_fail(error, path, "expected a file name ending in .raw, .vol.txt, .nvdb or .vdb");
}

#endif
