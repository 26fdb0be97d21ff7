/* isa.c - the whole library compiled for one instruction set, without its own choice of one. The
   Makefile compiles this once for each, with ISA_RENDER as the name of the only function. MIT
   licence. */
#define SCATTER_STATIC
#define SCATTER_NO_DISPATCH
#define SCATTER_IMPLEMENTATION
#include "../scatter.h"
#include "isa_render.h"

isa_render ISA_RENDER;

scatter_result ISA_RENDER(const scatter_scene *scene, const scatter_quality *quality,
                          const scatter_view *view, const scatter_image *image,
                          double (*clock_ms)(void), double *ms)
{
    scatter_context *context = NULL;
    scatter_result result = scatter_create(NULL, &context);
    double start = clock_ms();
    if (!result)
        result = scatter_update(context, scene, quality);
    if (!result)
        result = scatter_render(context, view, image);
    *ms = clock_ms() - start;
    scatter_destroy(context);
    return result;
}
