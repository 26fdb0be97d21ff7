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
