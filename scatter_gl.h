/* scatter_gl.h - the shared formulas of scatter.h as GLSL text. MIT licence, see LICENSE.

   Do this in ONE C or C++ file, and include the header plainly everywhere else:

       #define SCATTER_IMPLEMENTATION
       #include "scatter_gl.h"                     // includes scatter.h

   and put the chapters that a shader needs between its #version line and its own code:

       const char *source[] = {"#version 330\n", scatter_gl_glsl("prelude"), scatter_gl_glsl("vector"),
                               scatter_gl_glsl("phase"), my_shader};

   What it does
   - Hands out the core of scatter.h (phase functions, erf, depth of Gaussians and height fog, quadrature nodes,
     octahedral map, tone curve) as text that GLSL 130 to 450 and GLSL ES 300 and 310 accept: one text for both
     languages, so that shaders and the CPU compute the same formulas.
   What it does not do (yet): touch OpenGL. There are no passes, textures or programs here.

   Chapters, in the order in which they may be joined:
     prelude     what the others need from GLSL; always first
     vector      add, scale, dot, cross, length, normalize
     erf         exp(-x^2), erfc(x) exp(x^2), erf
     span        differences of erf without cancellation
     integrals   optical depth of a Gaussian and of height fog          (span)
     phase       Henyey-Greenstein, Rayleigh, Draine                    (vector)
     droplets    water droplets by diameter                             (phase)
     maps        asinh, sinh, cosh, smoothstep, spot, trilinear
     quadrature  Gauss-Legendre nodes
     octahedron  directions to a square and back                        (vector)
     tone        luminance, Reinhard's curve
*/
#ifndef SCATTER_GL_H
#define SCATTER_GL_H

#include "scatter.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The GLSL text of a chapter, with static lifetime; NULL if there is no chapter of that name. */
SCATTER_API const char *scatter_gl_glsl(const char *chapter);

#ifdef __cplusplus
}
#endif
#endif /* SCATTER_GL_H */

#if defined(SCATTER_IMPLEMENTATION) && !defined(SCATTER_GL_IMPLEMENTED)
#define SCATTER_GL_IMPLEMENTED

/* ------------------------------------------------------------------------------------------- >>glsl */

/* The counterpart of the C prelude before the core in scatter.h. */
static const char scatteri_gl_prelude[] =
    "#ifdef GL_ES\n"
    "precision highp float;\n"
    "precision highp int;\n"
    "#endif\n"
    "#define SCATTERI_FN\n"
    "#define SCATTERI_STRUCT(name) struct name\n"
    "#define SCATTERI_FLOAT(x) float(x)\n"
    "#define SCATTERI_REAL(x) float(x)\n"
    "#define scatteri_real float\n"
    "#define scatter_vec3 vec3\n"
    "#define scatteri_vec2 vec2\n"
    "#define scatteri_v2 vec2\n"
    "#define scatteri_v3 vec3\n"
    "#define scatteri_exp exp\n"
    "#define scatteri_log log\n"
    "#define scatteri_sqrt sqrt\n"
    "#define scatteri_rsqrt inversesqrt\n"
    "#define scatteri_floor floor\n"
    "#define scatteri_abs abs\n"
    "#define scatteri_min min\n"
    "#define scatteri_max max\n"
    "#define scatteri_cap min\n"
    "float scatteri_choose(float x, float y, float a, float b) { return x < y ? a : b; }\n";

/* >>glsl core begin: copied from scatter.h by `make glsl`; edit it there */
#define SCATTERI_GL_CORE
/* >>glsl core end */

typedef struct scatteri_gl_chapter {
    const char *name, *text;
} scatteri_gl_chapter;

SCATTER_API const char *scatter_gl_glsl(const char *chapter) {
    static const scatteri_gl_chapter chapters[] = {{"prelude", scatteri_gl_prelude}, SCATTERI_GL_CORE};
    size_t i;
    for (i = 0; i < sizeof chapters / sizeof chapters[0]; i++)
        if (strcmp(chapters[i].name, chapter) == 0)
            return chapters[i].text;
    return NULL;
}

#endif /* SCATTER_IMPLEMENTATION */
