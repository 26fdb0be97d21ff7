/* glsl_glm.h - the shaders of scatter_gl.h that are compiled as C++ and run on the CPU, and what each
   of them hands to tests/test_glm.cpp. */
#ifndef GLSL_GLM_H
#define GLSL_GLM_H

#define GLM_CLOSED "GAUSSIANS FEW_THIN CLOSED COLORED ONE_LOBE SPOT DIRECTIONAL"
#define GLM_THICK "GAUSSIANS CLOSED SPOT DIRECTIONAL"
#define GLM_SMOOTH "GAUSSIANS FEW_THIN CLOSED EMISSION DIRECTIONAL"
#define GLM_CELLS "GAUSSIANS FEW_THIN EMISSION TWO_LOBES SPOT DIRECTIONAL CELLS"
#define GLM_EYE "GAUSSIANS FEW_THIN DIRECTIONAL CELLS EYE"
#define GLM_POLAR "GAUSSIANS FEW_THIN FIELD BOUNDED SPOT POLAR"
#define GLM_PARALLEL "GAUSSIANS FEW_THIN FIELD BOUNDED DIRECTIONAL POLAR"
#define GLM_FOG "GAUSSIANS FEW_THIN CLOSED FOG BOUNDED SPOT DIRECTIONAL"
#define GLM_OPEN_FOG "FOG COLORED SPOT DIRECTIONAL"
#define GLM_MAPS "SHADOW_2D_0 SHADOW_ARRAY_1 SHADOW_CUBE_2"
#define GLM_SHADOWS "GAUSSIANS FEW_THIN CLOSED SPOT DIRECTIONAL " GLM_MAPS
#define GLM_MARCH "GAUSSIANS FEW_THIN FIELD FOG SPOT POLAR MARCH"
#define GLM_THROUGH "GAUSSIANS FEW_THIN CLOSED COLORED ONE_LOBE TRANSMITTANCE"
#define GLM_SHOW "GAUSSIANS FEW_THIN CLOSED COLORED ONE_LOBE SPOT DIRECTIONAL SHOW"
#define GLM_ALL \
    "GAUSSIANS FEW_THIN FIELD FOG BOUNDED COLORED EMISSION TWO_LOBES SPOT DIRECTIONAL CELLS " GLM_MAPS

/* Shaders of the view pass: name, features; planted fault: text of a chapter, what takes its place. */
#define GLM_SHADERS(S) \
    S(closed, GLM_CLOSED, "", "") \
    S(thick, GLM_THICK, "", "") \
    S(smooth, GLM_SMOOTH, "", "") \
    S(cells, GLM_CELLS, "", "") \
    S(eye, GLM_EYE, "", "") \
    S(polar, GLM_POLAR, "", "") \
    S(parallel, GLM_PARALLEL, "", "") \
    S(fog, GLM_FOG, "", "") \
    S(open_fog, GLM_OPEN_FOG, "", "") \
    S(shadows, GLM_SHADOWS, "", "") \
    S(march, GLM_MARCH, "", "") \
    S(through, GLM_THROUGH, "", "") \
    S(show, GLM_SHOW, "", "") \
    S(all, GLM_ALL, "", "") \
    S(bad_gaussian, GLM_CLOSED, "g.w * (t - m)", "g.w * (t + m)") \
    S(bad_cone, GLM_CLOSED, "k * k * ou", "k * ou") \
    S(bad_cells, GLM_CELLS, "mirrored * off)", "mirrored * off + 0.5)") \
    S(bad_polar, GLM_POLAR, "- 1.0) + 0.5;", "- 1.0);") \
    S(bad_parallel, GLM_PARALLEL, "- 1.0) + 0.5;", "- 1.0);") \
    S(bad_fog, GLM_FOG, "(h.y - x.y) / h.z", "(h.y + x.y) / h.z") \
    S(bad_shadow, GLM_SHADOWS, "far * (z - near)", "far * (z + near)")

#ifdef __cplusplus

/* A picture, a volume, the layers of an array or the faces of a cube (+x, -x, +y, -y, +z, -z). */
struct fake_texture {
    int width, height, depth; /* depth: slices, layers, faces */
    int row, slice;           /* texels from one to the next */
    int channels;
    bool smooth;              /* linear between texels; else the nearest */
    const float *texels;
};

struct glm_shader {
    const char *name;
    void (*set_block)(int which, const float *values); /* 0 medium, 1 lights, 2 view */
    void (*bind)(const char *sampler, const fake_texture *texture);
    void (*pixel)(float x, float y, float *rgba); /* gl_FragCoord in, scatteri_color out */
    /* Single functions; NULL where the shader has not got them. Positions relative to `ref`. */
    float (*fog_density)(const float *x);
    float (*fog_depth)(const float *x, const float *to, float segment);
    float (*field_density)(const float *x);
    float (*closed_depth)(const float *x, const float *to, float segment);
    float (*depth_to)(int light, const float *x, const float *to, float distance);
    void (*cone_edges)(int light, const float *origin, const float *direction, float k, float *t);
    bool (*visible)(int light, const float *x);
};

#define GLM_DECLARE(name, features, fault, instead) extern const glm_shader glm_##name;
GLM_SHADERS(GLM_DECLARE)

#endif
#endif
