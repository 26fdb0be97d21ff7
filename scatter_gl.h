/* scatter_gl.h - the shared formulas of scatter.h as GLSL text. MIT licence, see LICENSE.

   Do this in ONE C or C++ file, and include the header plainly everywhere else:

       #define SCATTER_IMPLEMENTATION
       #include "scatter_gl.h"                     // includes scatter.h

   and put the chapters that a shader needs between its #version line and its own code:

       const char *source[] = {"#version 330\n", scatter_gl_glsl("prelude"),
                               scatter_gl_glsl("vector"), scatter_gl_glsl("phase"), my_shader};

   What it does
   - Hands out the core of scatter.h (phase functions, erf, depth of Gaussians and height fog,
     quadrature nodes, octahedral map, tone curve) as text that GLSL 130 to 450 and GLSL ES 300 and
     310 accept: one text for both languages, so that shaders and the CPU compute the same formulas.
   What it does not do (yet): touch OpenGL. There are no passes, textures or programs here.

   Chapters, in the order in which they may be joined:
     prelude     what the others need from GLSL; always first
     vector      add, scale, dot, cross, length, normalize
     erf         exp(-x^2), erfc(x) exp(x^2), erf
     span        differences of erf without cancellation                (erf)
     quick       erf for inner loops
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

/* ------------------------------------------------------------------------------------------ >>types */

typedef void (*scatter_gl_proc)(void);

/* One fog. Zero is the default of every field but get_proc_address. */
typedef struct scatter_gl_desc {
    scatter_host host; /* allocate, release and log count; see scatter.h */
    /* Address of a GL function in the current context: eglGetProcAddress, glfwGetProcAddress, OSMesaGetProcAddress
       as they are, SDL_GL_GetProcAddress with a cast. */
    scatter_gl_proc (*get_proc_address)(const char *name);
    int max_lights;    /* room for lights; 0: 16 */
    int max_gaussians; /* room for Gaussians; 0: 4096 */
    int half_float;    /* not 0: volumes of 16 instead of 32 bits: half the memory, see "errors" */
    int keep_state;    /* not 0: do not save and restore the GL state listed above */
    int timers;        /* not 0: measure the GPU time of each pass, see scatter_gl_get_times */
} scatter_gl_desc;

typedef enum scatter_gl_shadow_kind {
    SCATTER_GL_SHADOW_NONE = 0,
    SCATTER_GL_SHADOW_2D,    /* GL_TEXTURE_2D: directional and spot lights */
    SCATTER_GL_SHADOW_ARRAY, /* GL_TEXTURE_2D_ARRAY: one layer, or cascades in order of preference */
    SCATTER_GL_SHADOW_CUBE   /* GL_TEXTURE_CUBE_MAP around a point light */
} scatter_gl_shadow_kind;

/* A shadow map of the host: how geometry stops a light. Depth is read without comparison and filtering, whatever
   the texture's parameters say. */
typedef struct scatter_gl_shadow {
    scatter_gl_shadow_kind kind;
    unsigned texture;
    int layer;          /* array: layer of the first cascade */
    int cascades;       /* array: 1..4 layers; 0: 1. A point takes the first one whose square holds it */
    float matrix[4][16]; /* 2D, array: world to texture, column-major: x, y, z / w in 0..1 are where and how deep */
    int reversed;       /* not 0: larger stored values are nearer */
    float bias;         /* >= 0, of stored depth: a point is lit if it is not deeper than the map by more */
    float near, far;    /* cube, far > near > 0: each face holds the depth 0..1 of a perspective projection between
                           them; near 0: the distance from the light over `far` */
} scatter_gl_shadow;

typedef struct scatter_gl_light {
    scatter_light light;
    scatter_gl_shadow shadow; /* zero: the host's geometry does not stop it */
} scatter_gl_light;

/* What the pixels show. */
typedef enum scatter_gl_show {
    SCATTER_GL_SHOW_FOG = 0,       /* L + T scene */
    SCATTER_GL_SHOW_DENSITY,       /* integral of D along the ray, m, as grey */
    SCATTER_GL_SHOW_LIGHT_DEPTH,   /* mean optical depth to the light `show_light`, over the ray's density, as grey */
    SCATTER_GL_SHOW_TRANSMITTANCE, /* T */
    SCATTER_GL_SHOW_RADIANCE,      /* L */
    SCATTER_GL_SHOW_NODES,         /* nodes evaluated on the ray, over 256 */
    SCATTER_GL_SHOW_ERROR          /* |L - L with twice the nodes| */
} scatter_gl_show;

/* A camera and where its picture goes. Matrices are column-major: clip = projection * view * world. */
typedef struct scatter_gl_view {
    const float *view;       /* 16: world to camera */
    const float *projection; /* 16: camera to clip; any: reversed, infinite, off-axis, orthographic */
    int reversed;          /* not 0: the depth buffer is cleared to 0 and nearer values are larger; else cleared to 1 */
    int zero_to_one;       /* not 0: clip z is 0..1 (glClipControl), else -1..1 */
    unsigned framebuffer;  /* drawn to; 0: the default one. Linear colour in its first attachment, any samples */
    int x, y, width, height; /* pixels of the framebuffer that the camera covers */
    unsigned depth_texture; /* 2D, not multisampled, texel (i, j) is the framebuffer's pixel (i, j): where rays end.
                               0: nowhere. Sky is where it holds the clear value; NaN counts as sky */
    int divide;            /* 0, 1: every pixel; 2, 4: half, quarter resolution, depth-aware upsampling */
    scatter_gl_show show;
    int show_light;        /* for SCATTER_GL_SHOW_LIGHT_DEPTH */
} scatter_gl_view;

/* A view-aligned volume of the fog, for transparent things: L and optical depth between the eye and the middle of
   nx*ny*nz froxels, slices spaced evenly in the logarithm of the distance between near and far. */
typedef struct scatter_gl_froxels {
    int nx, ny, nz;  /* 0: 160, 90, 64 */
    float near, far; /* m, 0 < near < far; behind far the last slice goes on */
} scatter_gl_froxels;

/* GPU milliseconds of the last measured passes; -1: not measured, or not finished yet. */
typedef struct scatter_gl_times {
    float inject, depth, view, upsample, froxels;
} scatter_gl_times;

/* What the passes did since scatter_gl_create. */
typedef struct scatter_gl_stats {
    unsigned injections;   /* of the medium into the density volume */
    unsigned propagations; /* of optical depth, one for each batch of four sources */
    unsigned programs;     /* compiled */
    unsigned textures;     /* created */
    size_t texture_bytes;  /* held now, about */
} scatter_gl_stats;

typedef struct scatter_gl scatter_gl;

/* -------------------------------------------------------------------------------------- >>functions
   Each needs the context current for which the fog was made, or one that shares its objects. */

SCATTER_API scatter_result scatter_gl_create(const scatter_gl_desc *desc, scatter_gl **fog);
/* Deletes what the fog holds in the current context. */
SCATTER_API void scatter_gl_destroy(scatter_gl *fog);
/* The same after the context was lost: gives back memory, calls no GL. */
SCATTER_API void scatter_gl_abandon(scatter_gl *fog);

/* Takes over a medium; arrays are copied, voxels are uploaded when their grid's `version` or address changed. */
SCATTER_API scatter_result scatter_gl_set_medium(scatter_gl *fog, const scatter_medium *medium);
SCATTER_API scatter_result scatter_gl_set_lights(scatter_gl *fog, const scatter_gl_light *lights,
                                                 size_t count);
/* Fills the volumes that the methods of `quality` need (NULL: defaults), only where something changed since the last
   call. eye: not NULL: optical depth from there goes into the volumes as well, and draw reads it instead of
   integrating it (right only for a camera that stands there). */
SCATTER_API scatter_result scatter_gl_update(scatter_gl *fog, const scatter_quality *quality,
                                             const scatter_vec3 *eye);
/* Blends the fog over the picture: L + T scene, alpha as of premultiplied colour. */
SCATTER_API scatter_result scatter_gl_draw(scatter_gl *fog, const scatter_gl_view *view);
/* Fills the view-aligned volume for scatter_fog() in the host's shaders. */
SCATTER_API scatter_result scatter_gl_fill_froxels(scatter_gl *fog, const scatter_gl_view *view,
                                                   const scatter_gl_froxels *froxels);
/* Makes room for pictures of that size at reduced resolution, so that draw creates nothing. */
SCATTER_API scatter_result scatter_gl_resize(scatter_gl *fog, int width, int height);
/* Compiles what update, draw and fill_froxels will need for the present medium, lights and quality. */
SCATTER_API scatter_result scatter_gl_warm_up(scatter_gl *fog, const scatter_quality *quality,
                                              const scatter_gl_view *view);

/* For the host's own shaders: text to put between #version and the shader, with
     vec3 scatter_light_transmittance(int light, vec3 world)   T(P, S) between a surface and a light
     vec4 scatter_fog(vec4 premultiplied, vec3 world)          a transparent fragment seen through the fog */
SCATTER_API const char *scatter_gl_surface_glsl(const scatter_gl *fog);
/* Binds what that text reads: six texture units from first_unit on, uniform blocks at first_block and first_block + 1,
   and sets the program's uniforms. This one changes the host's state, and leaves `program` in use. */
SCATTER_API scatter_result scatter_gl_bind_surface(scatter_gl *fog, unsigned program, int first_unit,
                                                   int first_block);

SCATTER_API scatter_gl_times scatter_gl_get_times(scatter_gl *fog);
SCATTER_API scatter_gl_stats scatter_gl_get_stats(const scatter_gl *fog);

/* The GLSL text of a chapter, with static lifetime; NULL if there is no chapter of that name. */
SCATTER_API const char *scatter_gl_glsl(const char *chapter);

#ifdef __cplusplus
}
#endif
#endif /* SCATTER_GL_H */

#if defined(SCATTER_IMPLEMENTATION) && !defined(SCATTER_GL_IMPLEMENTED)
#define SCATTER_GL_IMPLEMENTED

/* --------------------------------------------------------------------------------------- >>glsl */

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

static const char scatteri_gl_vector[] =
    "SCATTERI_FN scatter_vec3 scatteri_add(scatter_vec3 a, scatter_vec3 b) {\n"
    "    return scatteri_v3(a.x + b.x, a.y + b.y, a.z + b.z);\n"
    "}\n"
    "SCATTERI_FN scatter_vec3 scatteri_sub(scatter_vec3 a, scatter_vec3 b) {\n"
    "    return scatteri_v3(a.x - b.x, a.y - b.y, a.z - b.z);\n"
    "}\n"
    "SCATTERI_FN scatter_vec3 scatteri_scale(scatter_vec3 v, float s) {\n"
    "    return scatteri_v3(v.x * s, v.y * s, v.z * s);\n"
    "}\n"
    "SCATTERI_FN scatter_vec3 scatteri_mul(scatter_vec3 a, scatter_vec3 b) {\n"
    "    return scatteri_v3(a.x * b.x, a.y * b.y, a.z * b.z);\n"
    "}\n"
    "SCATTERI_FN float scatteri_dot(scatter_vec3 a, scatter_vec3 b) {\n"
    "    return a.x * b.x + a.y * b.y + a.z * b.z;\n"
    "}\n"
    "SCATTERI_FN scatter_vec3 scatteri_cross(scatter_vec3 a, scatter_vec3 b) {\n"
    "    return scatteri_v3(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x);\n"
    "}\n"
    "SCATTERI_FN float scatteri_length(scatter_vec3 v) {\n"
    "    return scatteri_sqrt(scatteri_dot(v, v));\n"
    "}\n"
    "SCATTERI_FN scatter_vec3 scatteri_normalize(scatter_vec3 v) {\n"
    "    return scatteri_scale(v, scatteri_rsqrt(scatteri_dot(v, v)));\n"
    "}\n";

static const char scatteri_gl_erf[] =
    "SCATTERI_FN float scatteri_bell(float x) {\n"
    "    float y = scatteri_cap(scatteri_abs(x), 10.0f);\n"
    "    float c = scatteri_floor(y * 256.0f) * 0.00390625f;\n"
    "    float r = (y - c) * (y + c);\n"
    "    float e = 1.0f - r * (1.0f - r * (0.5f - r * (0.16666667f - r * 0.041666667f)));\n"
    "    return scatteri_exp(-c * c) * e;\n"
    "}\n"
    "SCATTERI_FN float scatteri_erfcx(float x) {\n"
    "    float t = 1.0f / (x + 2.0f);\n"
    "    float s = (x - 2.0f) * t;\n"
    "    float p = 8.554996982e-5f;\n"
    "    p = p * s + 7.334352529e-5f;\n"
    "    p = p * s - 6.021006906e-4f;\n"
    "    p = p * s - 8.617089491e-4f;\n"
    "    p = p * s + 0.003061419881f;\n"
    "    p = p * s + 0.00648721553f;\n"
    "    p = p * s - 0.02150439534f;\n"
    "    p = p * s - 0.03644342555f;\n"
    "    p = p * s + 0.2794716099f;\n"
    "    p = p * s - 0.6871606318f;\n"
    "    p = p * s + 1.021582711f;\n"
    "    return p * t;\n"
    "}\n"
    "SCATTERI_FN float scatteri_erf(float x) {\n"
    "    float y = scatteri_cap(scatteri_abs(x), 10.0f);\n"
    "    float z = y * y;\n"
    "    float p = 7.875875063e-5f;\n"
    "    p = p * z - 0.0008016864287f;\n"
    "    p = p * z + 0.005189087423f;\n"
    "    p = p * z - 0.02685421201f;\n"
    "    p = p * z + 0.1128359472f;\n"
    "    p = p * z - 0.3761262667f;\n"
    "    p = y * (p * z + 1.128379166f);\n"
    "    p = scatteri_choose(y, 1.0f, p, 1.0f - scatteri_bell(y) * scatteri_erfcx(y));\n"
    "    return scatteri_choose(x, 0.0f, -p, p);\n"
    "}\n";

static const char scatteri_gl_span[] =
    "SCATTERI_FN float scatteri_bell_mean(float m, float r) {\n"
    "    float p = r * r;\n"
    "    float q = (m * r) * (m * r);\n"
    "    float s1 = 4.0f * q - 2.0f * p;\n"
    "    float s2 = (16.0f * q - 48.0f * p) * q + 12.0f * p * p;\n"
    "    float s3 = ((64.0f * q - 480.0f * p) * q + 720.0f * p * p) * q - 120.0f * p * p * p;\n"
    "    float s4 = (((256.0f * q - 3584.0f * p) * q + 13440.0f * p * p) * q - 13440.0f * p * p * p) * q;\n"
    "    s4 = s4 + 1680.0f * p * p * p * p;\n"
    "    float high = s3 * 1.984127e-4f + s4 * 2.7557319e-6f;\n"
    "    return 1.0f + (s1 * 0.16666667f + s2 * 0.0083333333f + high);\n"
    "}\n"
    "SCATTERI_FN float scatteri_erf_span(float x, float y, float r) {\n"
    "    float m = 0.5f * (x + y);\n"
    "    float c = scatteri_abs(m);\n"
    "    float a = scatteri_choose(m, 0.0f, -y, x);\n"
    "    float b = scatteri_cap(scatteri_choose(m, 0.0f, -x, y), 10.0f);\n"
    "    float d = scatteri_cap(scatteri_abs(a), 10.0f);\n"
    "    float size = scatteri_max(r * 0.71428571f, c * r);\n"
    "    float e = scatteri_bell(scatteri_choose(size, 0.25f, c, d));\n"
    "    float inner = e * scatteri_erfcx(d);\n"
    "    float outer = scatteri_bell(b) * scatteri_erfcx(b);\n"
    "    float wide = scatteri_choose(a, 0.0f, (2.0f - inner) - outer, inner - outer);\n"
    "    float slip = m * ((x - m) + (y - m));\n"
    "    float mean = scatteri_bell_mean(c, r) * (1.0f - slip);\n"
    "    return scatteri_choose(size, 0.25f, 2.2567583f * r * e * mean, wide);\n"
    "}\n"
    "SCATTERI_FN float scatteri_erf_difference(float x, float y) {\n"
    "    return scatteri_erf_span(x, y, 0.5f * (y - x));\n"
    "}\n";

static const char scatteri_gl_quick[] =
    "SCATTERI_FN float scatteri_erf_over(float x, float z) {\n"
    "    float p = -1.35163461e-6f;\n"
    "    p = p * z + 2.17444422e-4f;\n"
    "    p = p * z + 0.00823691029f;\n"
    "    p = p * z + 0.065270427f;\n"
    "    p = p * z + 0.315476252f;\n"
    "    return x * (p * z + 1.128378f);\n"
    "}\n"
    "SCATTERI_FN float scatteri_erf_under(float z) {\n"
    "    float q = 0.00195366527f;\n"
    "    q = q * z + 0.0237960973f;\n"
    "    q = q * z + 0.162197119f;\n"
    "    q = q * z + 0.612903195f;\n"
    "    return q * z + 1.0f;\n"
    "}\n";

static const char scatteri_gl_integrals[] =
    "SCATTERI_FN float scatteri_gauss_depth(float a, float c, float h2, float m, float len) {\n"
    "    float e = scatteri_exp(-(a * (a * h2)));\n"
    "    float s = scatteri_erf_span(-a * m, a * (len - m), 0.5f * a * len);\n"
    "    return c * e * s * (0.88622693f / a);\n"
    "}\n"
    "SCATTERI_FN float scatteri_exprel(float x) {\n"
    "    float size = scatteri_abs(x);\n"
    "    float y = scatteri_choose(size, 0.5f, x, 0.0f);\n"
    "    float d = scatteri_choose(size, 0.5f, 1.0f, x);\n"
    "    float p = 0.0001996217623f;\n"
    "    p = p * y + 0.001399777338f;\n"
    "    p = p * y + 0.008333182072f;\n"
    "    p = p * y + 0.04166530419f;\n"
    "    p = p * y + 0.1666666714f;\n"
    "    p = p * y + 0.5000000426f;\n"
    "    p = p * y + 1.0f;\n"
    "    return scatteri_choose(size, 0.5f, p, (scatteri_exp(x) - 1.0f) / d);\n"
    "}\n"
    "SCATTERI_FN float scatteri_height_depth(float density, float y0, float scale, float y, float dy,\n"
    "                                        float len) {\n"
    "    float low = scatteri_min(y, y + dy * len);\n"
    "    float e = scatteri_exp((y0 - low) / scale);\n"
    "    return density * e * (len * scatteri_exprel(-scatteri_abs(dy) * len / scale));\n"
    "}\n";

static const char scatteri_gl_phase[] =
    "SCATTERI_STRUCT(scatteri_lobes) {\n"
    "    float g1, alpha1, g2, alpha2, weight;\n"
    "};\n"
    "SCATTERI_FN float scatteri_draine(float g, float alpha, float omc) {\n"
    "    float h = scatteri_abs(g);\n"
    "    float o = scatteri_choose(g, 0.0f, 2.0f - omc, omc);\n"
    "    float r = scatteri_rsqrt((1.0f - h) * (1.0f - h) + 2.0f * h * o);\n"
    "    float k = 1.0f - omc;\n"
    "    float n = (1.0f - h) * (1.0f + h) * (1.0f + alpha * k * k);\n"
    "    return 0.079577472f * n * (r * r * r) / (1.0f + alpha * (1.0f + 2.0f * g * g) * 0.33333333f);\n"
    "}\n"
    "SCATTERI_FN float scatteri_phase(scatteri_lobes p, float omc) {\n"
    "    return (1.0f - p.weight) * scatteri_draine(p.g1, p.alpha1, omc) +\n"
    "           p.weight * scatteri_draine(p.g2, p.alpha2, omc);\n"
    "}\n"
    "SCATTERI_FN float scatteri_omc(scatter_vec3 a, scatter_vec3 b) {\n"
    "    scatter_vec3 d = scatteri_sub(a, b);\n"
    "    return 0.5f * scatteri_dot(d, d);\n"
    "}\n"
    "SCATTERI_FN scatteri_lobes scatteri_lobe(float g, float alpha) {\n"
    "    scatteri_lobes p;\n"
    "    p.g1 = g;\n"
    "    p.alpha1 = alpha;\n"
    "    p.g2 = 0.0f;\n"
    "    p.alpha2 = 0.0f;\n"
    "    p.weight = 0.0f;\n"
    "    return p;\n"
    "}\n";

static const char scatteri_gl_droplets[] =
    "SCATTERI_FN scatteri_lobes scatteri_two_lobes(scatteri_real g1, scatteri_real g2,\n"
    "                                              scatteri_real alpha2, scatteri_real weight) {\n"
    "    scatteri_lobes p;\n"
    "    p.g1 = SCATTERI_FLOAT(g1);\n"
    "    p.alpha1 = 0.0f;\n"
    "    p.g2 = SCATTERI_FLOAT(g2);\n"
    "    p.alpha2 = SCATTERI_FLOAT(alpha2);\n"
    "    p.weight = SCATTERI_FLOAT(weight);\n"
    "    return p;\n"
    "}\n"
    "SCATTERI_FN scatteri_lobes scatteri_droplets_mist(scatteri_real d, scatteri_real l) {\n"
    "    scatteri_real g2 = 1.1456f * d * sin(9.29044f * d);\n"
    "    return scatteri_two_lobes(13.8f * d * d, g2, 250.0f, 0.252977f - 312.983f * exp(4.3f * l));\n"
    "}\n"
    "SCATTERI_FN scatteri_lobes scatteri_droplets_small(scatteri_real l) {\n"
    "    scatteri_real wave = cos((l - 0.238604f) * (l + 1.00667f) / (0.507522f - 0.15677f * l));\n"
    "    scatteri_real g2 = 0.379685f * cos(1.19692f * wave + 1.37932f * l + 0.0625835f) + 0.344213f;\n"
    "    scatteri_real weight = 0.146209f * cos(3.38707f * l + 2.11193f) + 0.316072f + 0.0778917f * l;\n"
    "    return scatteri_two_lobes(0.862f - 0.143f * l * l, g2, 250.0f, weight);\n"
    "}\n"
    "SCATTERI_FN scatteri_lobes scatteri_droplets_middle(scatteri_real l) {\n"
    "    scatteri_real g2 = 0.500411f - 0.081287f / (-2.0f * l + tan(l) + 1.27551f);\n"
    "    scatteri_real wave = cos(5.68947f * (log(l) - 0.0292149f));\n"
    "    return scatteri_two_lobes(0.0604931f * log(l) + 0.940256f, g2, 7.30354f * l + 6.31675f,\n"
    "                              0.026914f * (l - wave) + 0.376475f);\n"
    "}\n"
    "SCATTERI_FN scatteri_lobes scatteri_droplets_large(scatteri_real d) {\n"
    "    scatteri_real g2 = exp(-2.20679f / (d + 3.91029f) - 0.428934f);\n"
    "    scatteri_real alpha2 = exp(3.62489f - 8.29288f / (d + 5.52825f));\n"
    "    scatteri_real weight = exp(-0.599085f / (d - 0.641583f) - 0.665888f);\n"
    "    return scatteri_two_lobes(exp(-0.0990567f / (d - 1.67154f)), g2, alpha2, weight);\n"
    "}\n"
    "SCATTERI_FN scatteri_lobes scatteri_droplets(float diameter_um) {\n"
    "    scatteri_real d = diameter_um;\n"
    "    scatteri_real l = log(d);\n"
    "    if (diameter_um <= 0.1f)\n"
    "        return scatteri_droplets_mist(d, l);\n"
    "    if (diameter_um < 1.5f)\n"
    "        return scatteri_droplets_small(l);\n"
    "    if (diameter_um < 5.0f)\n"
    "        return scatteri_droplets_middle(l);\n"
    "    return scatteri_droplets_large(d);\n"
    "}\n";

static const char scatteri_gl_maps[] =
    "SCATTERI_FN float scatteri_asinh(float x) {\n"
    "    float y = scatteri_abs(x);\n"
    "    float z = scatteri_cap(y * y, 1.0f);\n"
    "    float p = -0.01307441524f;\n"
    "    p = p * z + 0.02806019724f;\n"
    "    p = p * z - 0.04435832065f;\n"
    "    p = p * z + 0.07498380894f;\n"
    "    p = p * z - 0.1666663246f;\n"
    "    p = y * (p * z + 0.9999999988f);\n"
    "    p = scatteri_choose(y, 0.5f, p, scatteri_log(y + scatteri_sqrt(y * y + 1.0f)));\n"
    "    return scatteri_choose(x, 0.0f, -p, p);\n"
    "}\n"
    "SCATTERI_FN float scatteri_sinh(float u) {\n"
    "    float z = scatteri_cap(u * u, 1.0f);\n"
    "    float p = 2.819018793e-6f;\n"
    "    p = p * z + 1.983571388e-4f;\n"
    "    p = p * z + 8.333353206e-3f;\n"
    "    p = p * z + 0.1666666642f;\n"
    "    p = u + u * z * p;\n"
    "    return scatteri_choose(u * u, 1.0f, p, 0.5f * scatteri_exp(u) - 0.5f * scatteri_exp(-u));\n"
    "}\n"
    "SCATTERI_FN float scatteri_cosh(float u) {\n"
    "    return 0.5f * scatteri_exp(u) + 0.5f * scatteri_exp(-u);\n"
    "}\n"
    "SCATTERI_FN scatteri_vec2 scatteri_legendre(int i, int n) {\n"
    "    scatteri_real m = SCATTERI_REAL(n);\n"
    "    scatteri_real x = -cos(3.14159265f * (SCATTERI_REAL(i) + 0.75f) / (m + 0.5f)) *\n"
    "                      (1.0f - (m - 1.0f) / (8.0f * m * m * m));\n"
    "    scatteri_real slope = 1.0f;\n"
    "    for (int turn = 0; turn < 4; turn++) {\n"
    "        scatteri_real before = 0.0f;\n"
    "        scatteri_real p = 1.0f;\n"
    "        for (int k = 0; k < n; k++) {\n"
    "            scatteri_real j = SCATTERI_REAL(k);\n"
    "            scatteri_real after = ((2.0f * j + 1.0f) * x * p - j * before) / (j + 1.0f);\n"
    "            before = p;\n"
    "            p = after;\n"
    "        }\n"
    "        slope = m * (x * p - before) / (x * x - 1.0f);\n"
    "        x = x - p / slope;\n"
    "    }\n"
    "    return scatteri_v2(SCATTERI_FLOAT(x), SCATTERI_FLOAT(2.0f / ((1.0f - x * x) * slope * slope)));\n"
    "}\n"
    "SCATTERI_FN scatteri_vec2 scatteri_oct_encode(scatter_vec3 d) {\n"
    "    float s = scatteri_abs(d.x) + scatteri_abs(d.y) + scatteri_abs(d.z);\n"
    "    float u = d.x / scatteri_max(s, 1.0e-30f);\n"
    "    float v = d.y / scatteri_max(s, 1.0e-30f);\n"
    "    float fu = (1.0f - scatteri_abs(v)) * (u < 0.0f ? -1.0f : 1.0f);\n"
    "    float fv = (1.0f - scatteri_abs(u)) * (v < 0.0f ? -1.0f : 1.0f);\n"
    "    return scatteri_v2(scatteri_choose(d.z, 0.0f, fu, u), scatteri_choose(d.z, 0.0f, fv, v));\n"
    "}\n"
    "SCATTERI_FN scatter_vec3 scatteri_oct_decode(scatteri_vec2 uv) {\n"
    "    float z = 1.0f - scatteri_abs(uv.x) - scatteri_abs(uv.y);\n"
    "    float t = scatteri_max(-z, 0.0f);\n"
    "    float x = uv.x + scatteri_choose(uv.x, 0.0f, t, -t);\n"
    "    float y = uv.y + scatteri_choose(uv.y, 0.0f, t, -t);\n"
    "    return scatteri_normalize(scatteri_v3(x, y, z));\n"
    "}\n"
    "SCATTERI_FN float scatteri_lerp(float a, float b, float f) {\n"
    "    return a + (b - a) * f;\n"
    "}\n"
    "SCATTERI_FN float scatteri_trilinear(float v000, float v100, float v010, float v110, float v001,\n"
    "                                     float v101, float v011, float v111, float fx, float fy,\n"
    "                                     float fz) {\n"
    "    float z0 = scatteri_lerp(scatteri_lerp(v000, v100, fx), scatteri_lerp(v010, v110, fx), fy);\n"
    "    float z1 = scatteri_lerp(scatteri_lerp(v001, v101, fx), scatteri_lerp(v011, v111, fx), fy);\n"
    "    return scatteri_lerp(z0, z1, fz);\n"
    "}\n";

static const char scatteri_gl_tone[] =
    "SCATTERI_FN float scatteri_luminance(scatter_vec3 rgb) {\n"
    "    return 0.2126f * rgb.x + 0.7152f * rgb.y + 0.0722f * rgb.z;\n"
    "}\n"
    "SCATTERI_FN float scatteri_reinhard(float l, float white) {\n"
    "    float w = white > 0.0f ? white : 1.0f;\n"
    "    float k = scatteri_choose(0.0f, white, l / (w * w), 0.0f);\n"
    "    return l * (1.0f + k) / (1.0f + l);\n"
    "}\n"
    "SCATTERI_FN float scatteri_smoothstep(float e0, float e1, float x) {\n"
    "    float d = e1 > e0 ? e1 - e0 : 1.0f;\n"
    "    float s = scatteri_choose(e0, e1, (x - e0) / d, x < e1 ? 0.0f : 1.0f);\n"
    "    float t = scatteri_min(scatteri_max(s, 0.0f), 1.0f);\n"
    "    return t * t * (3.0f - 2.0f * t);\n"
    "}\n"
    "SCATTERI_FN float scatteri_spot(float cos_inner, float cos_outer, float c) {\n"
    "    return scatteri_smoothstep(cos_outer, cos_inner, c);\n"
    "}\n";

#define SCATTERI_GL_CORE \
    {"vector", scatteri_gl_vector}, \
    {"erf", scatteri_gl_erf}, \
    {"span", scatteri_gl_span}, \
    {"quick", scatteri_gl_quick}, \
    {"integrals", scatteri_gl_integrals}, \
    {"phase", scatteri_gl_phase}, \
    {"droplets", scatteri_gl_droplets}, \
    {"maps", scatteri_gl_maps}, \
    {"tone", scatteri_gl_tone},

/* >>glsl core end */

typedef struct scatteri_gl_chapter {
    const char *name, *text;
} scatteri_gl_chapter;

SCATTER_API const char *scatter_gl_glsl(const char *chapter) {
    static const scatteri_gl_chapter chapters[] = {{"prelude", scatteri_gl_prelude},
                                                   SCATTERI_GL_CORE};
    size_t i;
    for (i = 0; i < sizeof chapters / sizeof chapters[0]; i++)
        if (strcmp(chapters[i].name, chapter) == 0)
            return chapters[i].text;
    return NULL;
}

#endif /* SCATTER_IMPLEMENTATION */
