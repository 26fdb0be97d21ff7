/* glsl_glm.cpp - one shader of scatter_gl.h as C++. GLM_TEXT is the file that tests/glsl_text.c made
   of it, GLM_NAME its name in tests/glsl_glm.h. Only what C++ says otherwise than GLSL is defined
   here: types and functions are those of GLM, samplers are tests/fake_samplers.h. */
#include "fake_samplers.h"

#include <cstring>

namespace
{

using namespace glm;

const float *take(vec4 *to, int count, const float *from)
{
    for (int i = 0; i < count; i++, from += 4)
        to[i] = vec4(from[0], from[1], from[2], from[3]);
    return from;
}

vec4 gl_FragCoord;

/* A uniform block is a namespace whose members are seen from outside, too. */
#define layout(packing) inline namespace
#define uniform
#define highp

#include GLM_TEXT

vec3 v3(const float *v)
{
    return vec3(v[0], v[1], v[2]);
}

void set_block(int which, const float *values)
{
    if (which == 0)
        set_medium(values);
    else if (which == 1)
        set_lights(values);
    else
        set_view(values);
}

void bind(const char *name, const fake_texture *texture)
{
#define BIND(sampler)                                                                              \
    if (std::strcmp(name, #sampler) == 0)                                                          \
        sampler.texture = texture;
    BIND(scatteri_gaussians)
    BIND(scatteri_rules)
    BIND(scatteri_volume)
    BIND(scatteri_scene)
#ifdef SCATTERI_FIELD
    BIND(scatteri_field)
#endif
#if defined(SCATTERI_SHADOWS) || defined(SCATTERI_SHADOW_2D_0)
    BIND(scatteri_shadow0)
    BIND(scatteri_shadow1)
    BIND(scatteri_shadow2)
#endif
}

void pixel(float x, float y, float *rgba)
{
    gl_FragCoord = vec4(x, y, 0.5f, 1.0f);
    main();
    for (int c = 0; c < 4; c++)
        rgba[c] = scatteri_color[c];
}

#ifdef SCATTERI_FOG
float fog_density(const float *x)
{
    return scatteri_fog_density(v3(x));
}

float fog_depth(const float *x, const float *to, float segment)
{
    return scatteri_fog_depth(v3(x), v3(to), segment);
}
#else
#define fog_density nullptr
#define fog_depth nullptr
#endif

#ifdef SCATTERI_FIELD
float field_density(const float *x)
{
    return scatteri_field_density(v3(x));
}
#else
#define field_density nullptr
#endif

float closed_depth(const float *x, const float *to, float segment)
{
    return scatteri_closed_depth(v3(x), v3(to), segment);
}

float depth_to(int light, const float *x, const float *to, float distance)
{
    return scatteri_depth_to(light, v3(x), v3(to), distance);
}

void cone_edges(int light, const float *origin, const float *direction, float k, float *t)
{
    scatteri_o = v3(origin);
    scatteri_d = v3(direction);
    const vec2 edges = scatteri_cone_edges(light, k);
    t[0] = edges.x;
    t[1] = edges.y;
}

#if defined(SCATTERI_SHADOWS) || defined(SCATTERI_SHADOW_2D_0)
bool visible(int light, const float *x)
{
    return scatteri_visible(light, v3(x));
}
#else
#define visible nullptr
#endif

} // namespace

extern const glm_shader GLM_NAME = {GLM_TITLE,   set_block,  bind,          pixel,
                                    fog_density, fog_depth,  field_density, closed_depth,
                                    depth_to,    cone_edges, visible};
