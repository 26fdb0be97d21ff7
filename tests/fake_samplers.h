/* fake_samplers.h - the samplers of GLSL on the CPU, in float: clamped to the edge, nearest or linear,
   one level. tests/test_glm.cpp has checks of its own for them. */
#ifndef FAKE_SAMPLERS_H
#define FAKE_SAMPLERS_H

#define GLM_FORCE_SWIZZLE
#include <glm/glm.hpp>

#include "glsl_glm.h"

#include <cstdio>
#include <cstdlib>

struct fake_sampler {
    const fake_texture *texture = nullptr;
};
struct sampler2D : fake_sampler {
};
struct sampler3D : fake_sampler {
};
struct sampler2DArray : fake_sampler {
};
struct samplerCube : fake_sampler {
};

/* Reading what nobody bound, or beside the texture, is a fault of the shader. */
inline void fake_stop(const char *what)
{
    std::fprintf(stderr, "fake sampler: %s\n", what);
    std::abort();
}

inline glm::vec4 fake_texel(const fake_texture *t, int i, int j, int k)
{
    glm::vec4 value(0.0f, 0.0f, 0.0f, 1.0f);
    if (i < 0 || i >= t->width || j < 0 || j >= t->height || k < 0 || k >= t->depth)
        fake_stop("a texel outside of the texture");
    for (int c = 0; c < t->channels; c++)
        value[c] =
            t->texels[(size_t)(k * t->slice + j * t->row + i) * (size_t)t->channels + (size_t)c];
    return value;
}

/* Between texels i and j along one axis. */
struct fake_place {
    int i, j;
    float part;
};

inline fake_place fake_along(float at, int size, bool smooth)
{
    const float g = glm::clamp(at * (float)size - (smooth ? 0.5f : 0.0f), 0.0f, (float)size - 1.0f);
    const int i = (int)g;
    fake_place p = {i, i + 1 < size ? i + 1 : i, smooth ? g - (float)i : 0.0f};
    return p;
}

/* At x, y of one slice. */
inline glm::vec4 fake_flat(const fake_texture *t, glm::vec2 at, int k)
{
    const fake_place x = fake_along(at.x, t->width, t->smooth),
                     y = fake_along(at.y, t->height, t->smooth);
    const glm::vec4 low = glm::mix(fake_texel(t, x.i, y.i, k), fake_texel(t, x.j, y.i, k), x.part);
    const glm::vec4 high = glm::mix(fake_texel(t, x.i, y.j, k), fake_texel(t, x.j, y.j, k), x.part);
    return glm::mix(low, high, y.part);
}

inline const fake_texture *fake_bound(const fake_sampler &s)
{
    if (s.texture == nullptr)
        fake_stop("nothing is bound");
    return s.texture;
}

inline glm::vec4 textureLod(const sampler2D &s, glm::vec2 at, float)
{
    return fake_flat(fake_bound(s), at, 0);
}

inline glm::vec4 textureLod(const sampler3D &s, glm::vec3 at, float)
{
    const fake_texture *t = fake_bound(s);
    const fake_place z = fake_along(at.z, t->depth, t->smooth);
    const glm::vec2 flat(at.x, at.y);
    return glm::mix(fake_flat(t, flat, z.i), fake_flat(t, flat, z.j), z.part);
}

inline glm::vec4 textureLod(const sampler2DArray &s, glm::vec3 at, float)
{
    const fake_texture *t = fake_bound(s);
    const int layer = glm::clamp((int)glm::floor(at.z + 0.5f), 0, t->depth - 1);
    return fake_flat(t, glm::vec2(at.x, at.y), layer);
}

/* Table 8.19 of OpenGL 4.6: which face, and where on it. Edges between faces are not filtered. */
inline glm::vec4 textureLod(const samplerCube &s, glm::vec3 d, float)
{
    const glm::vec3 a = glm::abs(d);
    const int axis = a.x >= a.y && a.x >= a.z ? 0 : a.y >= a.z ? 1 : 2;
    const bool minus = d[axis] < 0.0f;
    const float sign = minus ? -1.0f : 1.0f;
    const glm::vec2 at = axis == 0   ? glm::vec2(-sign * d.z, -d.y)
                         : axis == 1 ? glm::vec2(d.x, sign * d.z)
                                     : glm::vec2(sign * d.x, -d.y);
    return fake_flat(fake_bound(s), 0.5f * (at / a[axis] + 1.0f), 2 * axis + (minus ? 1 : 0));
}

inline glm::vec4 texelFetch(const sampler2D &s, glm::ivec2 at, int)
{
    return fake_texel(fake_bound(s), at.x, at.y, 0);
}

inline glm::ivec3 textureSize(const sampler3D &s, int)
{
    const fake_texture *t = fake_bound(s);
    return glm::ivec3(t->width, t->height, t->depth);
}

#endif
