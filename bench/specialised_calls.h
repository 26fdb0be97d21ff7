/* specialised_calls.h - the copy of the library that specialise.sh makes, behind one struct. MIT
 * licence. */
#ifndef SCATTER_BENCH_SPECIALISED_CALLS_H
#define SCATTER_BENCH_SPECIALISED_CALLS_H

#include "../scatter.h"

typedef struct specialised_calls {
    scatter_result (*create)(const scatter_host *host, scatter_context **context);
    void (*destroy)(scatter_context *context);
    scatter_result (*update)(scatter_context *context, const scatter_scene *scene,
                             const scatter_quality *quality);
    scatter_result (*render)(const scatter_context *context, const scatter_view *view,
                             const scatter_image *image);
} specialised_calls;

extern const specialised_calls specialised;

#endif
