/* isa_render.h - an image by the library as one instruction set has it: update and render in a
 * fresh context, and the time of both. MIT licence. */
#ifndef SCATTER_BENCH_ISA_RENDER_H
#define SCATTER_BENCH_ISA_RENDER_H

#include "../scatter.h"

typedef scatter_result isa_render(const scatter_scene *scene, const scatter_quality *quality,
                                  const scatter_view *view, const scatter_image *image,
                                  double (*clock_ms)(void), double *ms);

extern isa_render isa_render_sse2, isa_render_avx2, isa_render_avx512;

#endif
