/* program.h - what the example programs share: complaints and numbers of the command line, a
   scatter_host with threads that counts what is allocated, pictures as they are shown. MIT licence,
   see LICENSE.

   A program defines PROGRAM_NAME, _POSIX_C_SOURCE 200809L and, where it should be,
   SCATTER_IMPLEMENTATION before.

   Sections: command line, host, pictures. */
#ifndef SCATTER_EXAMPLES_PROGRAM_H
#define SCATTER_EXAMPLES_PROGRAM_H

#include "../scatter.h"
#include "files.h"

#include <pthread.h>
#include <time.h>

/* ------------------------------------------------------------------------------ >>command line */

/* "scatter-render: sentence" to the error output; returns `status`. */
static inline int complain(int status, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    fputs(PROGRAM_NAME ": ", stderr);
    vfprintf(stderr, format, arguments);
    fputc('\n', stderr);
    va_end(arguments);
    return status;
}

/* A whole number from low to high with nothing behind but `end`; *text moves behind `end`. */
static inline int whole_number(const char **text, char end, int low, int high, int *value)
{
    const char *p = *text;
    long long n = 0;
    for (; *p >= '0' && *p <= '9' && n <= high; p++)
        n = n * 10 + (*p - '0');
    if (p == *text || *p != end || n < low || n > high)
        return 1;
    *value = (int)n;
    *text = end ? p + 1 : p;
    return 0;
}

static inline int number_option(const char *name, const char *text, int low, int high, int *value)
{
    if (whole_number(&text, 0, low, high, value))
        return complain(2, "%s: expected a whole number from %d to %d, found '%s'", name, low, high,
                        text);
    return 0;
}

static inline int size_option(const char *text, int *width, int *height)
{
    const char *at = text;
    if (whole_number(&at, 'x', 1, 65536, width) || whole_number(&at, 0, 1, 65536, height))
        return complain(2, "--size: expected WxH with 1 to 65536 pixels each, found '%s'", text);
    return 0;
}

static inline int degrees_option(const char *name, const char *text, float *degrees)
{
    const char *at = text, *end = text + strlen(text);
    double value = 0;
    if (file_number(&at, end, &value) || at != end || !(fabs(value) <= 1e6))
        return complain(2, "%s: expected -1000000 to 1000000 degrees, found '%s'", name, text);
    *degrees = (float)value;
    return 0;
}

/* The number of processors, as threads. */
static inline int all_processors(void)
{
    long processors = sysconf(_SC_NPROCESSORS_ONLN);
    return processors > 1 ? (int)(processors < 1024 ? processors : 1024) : 1;
}

/* -------------------------------------------------------------------------------------- >>host */

/* What the library is given to live in. */
typedef struct host_state {
    int threads;
    pthread_mutex_t lock; /* of the three counts */
    size_t bytes, peak;   /* allocated now and at most */
    size_t allocations;   /* since the beginning */
    char sentence[512];   /* the last one logged */
    const char *scene;    /* name shown with the progress */
    double start;         /* of the measurement, ms */
    int shown;            /* progress was printed and must be wiped out */
} host_state;

static inline double now_ms(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec * 1e3 + (double)t.tv_nsec * 1e-6;
}

/* In front of each block: its size. As large as the strictest alignment. */
typedef union block_header {
    size_t bytes;
    long double align_number;
    void *align_pointer;
} block_header;

static inline void count_bytes(host_state *state, size_t more, size_t less)
{
    pthread_mutex_lock(&state->lock);
    state->bytes = state->bytes + more - less;
    state->allocations += more > 0;
    if (state->bytes > state->peak)
        state->peak = state->bytes;
    pthread_mutex_unlock(&state->lock);
}

static inline void *host_allocate(void *user, size_t bytes)
{
    block_header *block =
        bytes <= SIZE_MAX - sizeof *block ? (block_header *)malloc(sizeof *block + bytes) : NULL;
    if (!block)
        return NULL;
    block->bytes = bytes;
    count_bytes((host_state *)user, bytes, 0);
    return block + 1;
}

static inline void host_release(void *user, void *memory)
{
    if (!memory)
        return;
    block_header *block = (block_header *)memory - 1;
    count_bytes((host_state *)user, 0, block->bytes);
    free(block);
}

static inline void host_log(void *user, scatter_result result, const char *sentence)
{
    host_state *state = (host_state *)user;
    (void)result;
    snprintf(state->sentence, sizeof state->sentence, "%s", sentence);
}

/* A loop shared by threads, which take pieces of it from the front. */
typedef struct shared_loop {
    void (*task)(void *data, int index);
    void *data;
    int count, piece, next;
    pthread_mutex_t lock;
} shared_loop;

static inline void *run_pieces(void *argument)
{
    shared_loop *loop = (shared_loop *)argument;
    for (;;) {
        pthread_mutex_lock(&loop->lock);
        int first = loop->next, left = loop->count - first;
        int end = first + (left < loop->piece ? left : loop->piece);
        loop->next = end;
        pthread_mutex_unlock(&loop->lock);
        if (first == end)
            return NULL;
        for (int i = first; i < end; i++)
            loop->task(loop->data, i);
    }
}

/* Starts the threads for this loop only: some 20 microseconds each, against milliseconds of work.
   */
static inline void host_parallel_for(void *user, int count, void (*task)(void *data, int index),
                                     void *data)
{
    enum { MOST = 1024 };
    pthread_t threads[MOST];
    int wanted = ((host_state *)user)->threads - 1, started = 0;
    shared_loop loop;
    memset(&loop, 0, sizeof loop);
    loop.task = task;
    loop.data = data;
    loop.count = count;
    loop.piece = count / (64 * (wanted + 1)) + 1;
    pthread_mutex_init(&loop.lock, NULL);
    while (started < wanted && started < MOST && started + 1 < count &&
           pthread_create(&threads[started], NULL, run_pieces, &loop) == 0)
        started++;
    run_pieces(&loop);
    while (started > 0)
        pthread_join(threads[--started], NULL);
    pthread_mutex_destroy(&loop.lock);
}

/* Only on a terminal, and only for what takes more than a second. */
static inline int host_progress(void *user, float fraction)
{
    host_state *state = (host_state *)user;
    if (isatty(2) && now_ms() - state->start > 1000) {
        fprintf(stderr, "\r%s: %3.0f %%", state->scene, (double)fraction * 100);
        state->shown = 1;
    }
    return 0;
}

static inline scatter_host make_host(host_state *state)
{
    scatter_host host;
    memset(&host, 0, sizeof host);
    host.user = state;
    host.allocate = host_allocate;
    host.release = host_release;
    host.log = host_log;
    host.progress = host_progress;
    if (state->threads > 1)
        host.parallel_for = host_parallel_for;
    return host;
}

/* ---------------------------------------------------------------------------------- >>pictures */

static inline double luminance(const float *rgb)
{
    return 0.2126 * (double)rgb[0] + 0.7152 * (double)rgb[1] + 0.0722 * (double)rgb[2];
}

/* The exposure of a picture. Pixels count in the log-average by the square root of their luminance,
   so that neither an empty dark background nor a small lamp decides alone. As Reinhard proposes,
   the brightest pixel becomes white, unless all are equally dim. */
static inline scatter_tone choose_tone(const file_picture *picture)
{
    size_t pixels = (size_t)picture->width * (size_t)picture->height;
    scatter_tone tone;
    double brightest = 0, weight = 0, sum = 0;
    memset(&tone, 0, sizeof tone);
    for (size_t i = 0; i < pixels; i++) {
        double l = luminance(picture->rgb + 3 * i);
        if (!(l > 0))
            continue;
        brightest = fmax(brightest, l);
        weight += sqrt(l);
        sum += sqrt(l) * log(l);
    }
    if (weight > 0) {
        tone.key = 0.18f;
        tone.log_average = (float)exp(sum / weight);
        tone.white = (float)fmin(fmax(0.18 * brightest / exp(sum / weight), 0.4), 1e6);
    }
    return tone;
}

/* Memory for width*height pixels; free(picture->rgb). */
static inline int new_picture(file_picture *picture, int width, int height)
{
    double bytes = (double)width * height * 3 * sizeof(float);
    picture->width = width;
    picture->height = height;
    picture->rgb = bytes < (double)(SIZE_MAX / 2) ? (float *)malloc((size_t)bytes) : NULL;
    return picture->rgb == NULL;
}

/* As sRGB; what lies outside of 0..1 is clamped. */
static inline int write_png(const char *path, const file_picture *picture, file_error *error)
{
    size_t values = (size_t)picture->width * (size_t)picture->height * 3;
    unsigned char *bytes = (unsigned char *)malloc(values);
    if (!bytes)
        return file_fail(error, path, "out of memory");
    for (size_t i = 0; i < values; i++)
        bytes[i] = scatter_srgb8(picture->rgb[i]);
    int failed = file_png_write(path, bytes, picture->width, picture->height, error);
    free(bytes);
    return failed;
}

#endif
