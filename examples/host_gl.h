/* host_gl.h - a small renderer as a host of scatter_gl.h has one: it draws the boxes, spheres and
   planes of a scene file with OpenGL 3.3 or OpenGL ES 3.0, and their shadow maps. MIT licence, see
   LICENSE.

       host_gl host;
       if (host_gl_open(&host, get_proc_address, &file, 640, 480, NULL) ||
           host_gl_surface(&host, scatter_gl_surface_glsl(fog)))     // NULL: no fog
           puts(host.error);
       scatter_gl_set_lights(fog, host.lights, file.scene.light_count);
       ...
       host_gl_draw(&host);                                          // colour and depth
       scatter_gl_draw(fog, &host.fog_view);                         // the fog over it
       host_gl_read(&host, &picture);
       host_gl_close(&host);

   Every pixel casts its ray at the shapes and writes the depth of what it finds, so silhouettes and
   distances are as exact as floats are, and so are the shadows on surfaces: what differs from
   scatter_render is then what the fog does. Shadow maps are for the fog.

   Include "../scatter_gl.h" and "scene.h" before. Functions return 0, or 1 with a sentence in
   `error`. Sections: types, GL, programs, textures, camera, shaders, lights, picture, opening. */
#ifndef SCATTER_EXAMPLES_HOST_GL_H
#define SCATTER_EXAMPLES_HOST_GL_H

#include "../scatter_gl.h"
#include "scene.h"

/* ------------------------------------------------------------------------------------- >>types */

/* name, result, arguments: what this file calls of OpenGL. */
#define HOST_GL_FUNCTIONS(X)                                                                       \
    X(ActiveTexture, void, (unsigned unit))                                                        \
    X(AttachShader, void, (unsigned program, unsigned shader))                                     \
    X(BindFramebuffer, void, (unsigned target, unsigned framebuffer))                              \
    X(BindTexture, void, (unsigned target, unsigned texture))                                      \
    X(BindVertexArray, void, (unsigned array))                                                     \
    X(CheckFramebufferStatus, unsigned, (unsigned target))                                         \
    X(ClearBufferfv, void, (unsigned what, int which, const float *value))                         \
    X(CompileShader, void, (unsigned shader))                                                      \
    X(CreateProgram, unsigned, (void))                                                             \
    X(CreateShader, unsigned, (unsigned kind))                                                     \
    X(DeleteFramebuffers, void, (int count, const unsigned *names))                                \
    X(DeleteProgram, void, (unsigned program))                                                     \
    X(DeleteShader, void, (unsigned shader))                                                       \
    X(DeleteTextures, void, (int count, const unsigned *names))                                    \
    X(DeleteVertexArrays, void, (int count, const unsigned *names))                                \
    X(DepthFunc, void, (unsigned function))                                                        \
    X(DepthMask, void, (unsigned char write))                                                      \
    X(DrawArrays, void, (unsigned mode, int first, int count))                                     \
    X(DrawBuffers, void, (int count, const unsigned *buffers))                                     \
    X(Disable, void, (unsigned what))                                                              \
    X(Enable, void, (unsigned what))                                                               \
    X(Finish, void, (void))                                                                        \
    X(FramebufferTexture2D, void,                                                                  \
      (unsigned target, unsigned attachment, unsigned kind, unsigned texture, int level))          \
    X(GenFramebuffers, void, (int count, unsigned *names))                                         \
    X(GenTextures, void, (int count, unsigned *names))                                             \
    X(GenVertexArrays, void, (int count, unsigned *names))                                         \
    X(GetError, unsigned, (void))                                                                  \
    X(GetIntegerv, void, (unsigned what, int *value))                                              \
    X(GetProgramInfoLog, void, (unsigned program, int room, int *length, char *text))              \
    X(GetProgramiv, void, (unsigned program, unsigned what, int *value))                           \
    X(GetShaderInfoLog, void, (unsigned shader, int room, int *length, char *text))                \
    X(GetShaderiv, void, (unsigned shader, unsigned what, int *value))                             \
    X(GetString, const unsigned char *, (unsigned what))                                           \
    X(GetUniformLocation, int, (unsigned program, const char *name))                               \
    X(LinkProgram, void, (unsigned program))                                                       \
    X(ReadPixels, void,                                                                            \
      (int x, int y, int width, int height, unsigned format, unsigned type, void *pixels))         \
    X(ShaderSource, void,                                                                          \
      (unsigned shader, int count, const char *const *text, const int *lengths))                   \
    X(TexImage2D, void,                                                                            \
      (unsigned target, int level, int kind, int width, int height, int border, unsigned format,   \
       unsigned type, const void *pixels))                                                         \
    X(TexParameteri, void, (unsigned target, unsigned what, int value))                            \
    X(Uniform1f, void, (int at, float x))                                                          \
    X(Uniform1i, void, (int at, int x))                                                            \
    X(Uniform2f, void, (int at, float x, float y))                                                 \
    X(Uniform3fv, void, (int at, int count, const float *values))                                  \
    X(Uniform4fv, void, (int at, int count, const float *values))                                  \
    X(UniformMatrix4fv, void, (int at, int count, unsigned char turned, const float *values))      \
    X(UseProgram, void, (unsigned program))                                                        \
    X(Viewport, void, (int x, int y, int width, int height))

typedef struct host_gl_functions {
#define HOST_GL_MEMBER(name, result, arguments) result(*name) arguments;
    HOST_GL_FUNCTIONS(HOST_GL_MEMBER)
#undef HOST_GL_MEMBER
} host_gl_functions;

/* What the depth buffer holds. */
typedef struct host_gl_depth {
    int reversed, zero_to_one; /* as in scatter_gl_view */
    double near, far;          /* m; far 0: infinitely far away, of a perspective only */
} host_gl_depth;

/* Zero, or NULL for a pointer to this, is the default. */
typedef struct host_gl_options {
    int shadow_map;             /* texels to a side, of cubes half of it; 0: 2048, or less */
    const host_gl_depth *depth; /* NULL: the most exact one */
} host_gl_options;

/* Rays through a picture: at u, v in 0..1 from the lower left, where GL begins to count, they start
   from v[0] + u v[1] + v v[2] along v[3] + u v[4] + v v[5]. */
typedef struct host_gl_rays {
    scatter_vec3 v[6];
} host_gl_rays;

typedef struct host_gl {
    host_gl_functions gl;
    const scene_file *file;
    int es, shadow_map;
    char error[1200];
    unsigned array;                      /* a vertex array without arrays */
    unsigned rows;                       /* the shapes and lights as a texture */
    unsigned framebuffer, color, depth;  /* the picture */
    unsigned shadow_framebuffer, shadow; /* and the program that fills it */
    unsigned program;                    /* of the picture */
    host_gl_depth convention;            /* of its depth */
    float view[16], projection[16];      /* its camera */
    scatter_gl_view fog_view;            /* where the fog is to be drawn */
    scatter_gl_light *lights;            /* those of the file with their shadow maps */
} host_gl;

/* get_proc_address of the current context. The file stays with the caller. */
static inline int host_gl_open(host_gl *host, scatter_gl_proc (*get)(const char *name),
                               const scene_file *file, int width, int height,
                               const host_gl_options *options);
static inline void host_gl_close(host_gl *host);
/* Compiles the picture's program around `vec3 scatter_light_transmittance(int light, vec3 world)`;
   NULL: it is 1. */
static inline int host_gl_surface(host_gl *host, const char *glsl);
/* Colour and depth of the shapes. host->program may have textures in units from 1 on. */
static inline void host_gl_draw(host_gl *host);
static inline int host_gl_read(host_gl *host, const file_picture *picture);

/* ---------------------------------------------------------------------------------------- >>GL */

enum {
    HOST_GL_NONE = 0,
    HOST_GL_TRIANGLE_STRIP = 5,
    HOST_GL_LESS = 0x0201,
    HOST_GL_GREATER = 0x0204,
    HOST_GL_ALWAYS = 0x0207,
    HOST_GL_DEPTH_TEST = 0x0B71,
    HOST_GL_MAX_TEXTURE_SIZE = 0x0D33,
    HOST_GL_TEXTURE_2D = 0x0DE1,
    HOST_GL_FLOAT = 0x1406,
    HOST_GL_DEPTH = 0x1801,
    HOST_GL_DEPTH_COMPONENT = 0x1902,
    HOST_GL_RGBA = 0x1908,
    HOST_GL_RENDERER = 0x1F01,
    HOST_GL_VERSION = 0x1F02,
    HOST_GL_NEAREST = 0x2600,
    HOST_GL_MAG_FILTER = 0x2800,
    HOST_GL_MIN_FILTER = 0x2801,
    HOST_GL_WRAP_S = 0x2802,
    HOST_GL_WRAP_T = 0x2803,
    HOST_GL_CLAMP_TO_EDGE = 0x812F,
    HOST_GL_TEXTURE0 = 0x84C0,
    HOST_GL_TEXTURE_CUBE_MAP = 0x8513,
    HOST_GL_CUBE_FACE = 0x8515, /* +x; five more follow */
    HOST_GL_RGBA32F = 0x8814,
    HOST_GL_FRAGMENT_SHADER = 0x8B30,
    HOST_GL_VERTEX_SHADER = 0x8B31,
    HOST_GL_COMPILE_STATUS = 0x8B81,
    HOST_GL_LINK_STATUS = 0x8B82,
    HOST_GL_DEPTH_COMPONENT32F = 0x8CAC,
    HOST_GL_FRAMEBUFFER_COMPLETE = 0x8CD5,
    HOST_GL_COLOR_ATTACHMENT0 = 0x8CE0,
    HOST_GL_DEPTH_ATTACHMENT = 0x8D00,
    HOST_GL_FRAMEBUFFER = 0x8D40
};

static inline int host_gl_fail(host_gl *host, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(host->error, sizeof host->error, format, arguments);
    va_end(arguments);
    return 1;
}

static inline const char *host_gl_string(const host_gl *host, unsigned what)
{
    const char *text = (const char *)host->gl.GetString(what);
    return text ? text : "unknown";
}

static inline int host_gl_load(host_gl *host, scatter_gl_proc (*get)(const char *name))
{
#define HOST_GL_FIND(name, result, arguments)                                                      \
    host->gl.name = (result(*) arguments)get("gl" #name);                                          \
    if (!host->gl.name)                                                                            \
        return host_gl_fail(host, "the driver has no gl" #name);
    HOST_GL_FUNCTIONS(HOST_GL_FIND)
#undef HOST_GL_FIND
    host->es = strncmp(host_gl_string(host, HOST_GL_VERSION), "OpenGL ES", 9) == 0;
    return 0;
}

/* ---------------------------------------------------------------------------------- >>programs */

static inline unsigned host_gl_shader(host_gl *host, unsigned kind, const char *const *text,
                                      int count)
{
    char log[1000];
    int ok = 0;
    unsigned shader = host->gl.CreateShader(kind);
    host->gl.ShaderSource(shader, count, text, NULL);
    host->gl.CompileShader(shader);
    host->gl.GetShaderiv(shader, HOST_GL_COMPILE_STATUS, &ok);
    if (ok)
        return shader;
    host->gl.GetShaderInfoLog(shader, (int)sizeof log, NULL, log);
    host->gl.DeleteShader(shader);
    host_gl_fail(host, "a shader of host_gl.h does not compile: %s", log);
    return 0;
}

static inline unsigned host_gl_link(host_gl *host, unsigned vertex, unsigned fragment)
{
    char log[1000];
    int ok = 0;
    unsigned program = host->gl.CreateProgram();
    host->gl.AttachShader(program, vertex);
    host->gl.AttachShader(program, fragment);
    host->gl.LinkProgram(program);
    host->gl.GetProgramiv(program, HOST_GL_LINK_STATUS, &ok);
    if (ok)
        return program;
    host->gl.GetProgramInfoLog(program, (int)sizeof log, NULL, log);
    host->gl.DeleteProgram(program);
    host_gl_fail(host, "a program of host_gl.h does not link: %s", log);
    return 0;
}

/* A rectangle of the picture, corners in 0..1, at a depth that every convention shows. */
static const char host_gl_cover[] =
    "uniform vec4 cover;\n"
    "void main() {\n"
    "    vec2 corner = vec2(gl_VertexID & 1, gl_VertexID >> 1);\n"
    "    gl_Position = vec4(mix(cover.xy, cover.zw, corner) * 2.0 - 1.0, 0.0, 1.0);\n"
    "}\n";

static inline const char *host_gl_version(const host_gl *host)
{
    return host->es ? "#version 300 es\nprecision highp float;\nprecision highp int;\n"
                    : "#version 330\n";
}

/* A program that runs this text in every pixel; 0 with a sentence. */
static inline unsigned host_gl_program(host_gl *host, const char *const *text, int count)
{
    const char *cover[2] = {host_gl_version(host), host_gl_cover};
    unsigned program = 0, vertex = host_gl_shader(host, HOST_GL_VERTEX_SHADER, cover, 2);
    unsigned fragment = vertex ? host_gl_shader(host, HOST_GL_FRAGMENT_SHADER, text, count) : 0;
    if (fragment)
        program = host_gl_link(host, vertex, fragment);
    host->gl.DeleteShader(vertex);
    host->gl.DeleteShader(fragment);
    return program;
}

static inline int host_gl_at(const host_gl *host, unsigned program, const char *name)
{
    return host->gl.GetUniformLocation(program, name);
}

/* ---------------------------------------------------------------------------------- >>textures */

static inline void host_gl_plain(host_gl *host, unsigned target)
{
    host->gl.TexParameteri(target, HOST_GL_MIN_FILTER, HOST_GL_NEAREST);
    host->gl.TexParameteri(target, HOST_GL_MAG_FILTER, HOST_GL_NEAREST);
    host->gl.TexParameteri(target, HOST_GL_WRAP_S, HOST_GL_CLAMP_TO_EDGE);
    host->gl.TexParameteri(target, HOST_GL_WRAP_T, HOST_GL_CLAMP_TO_EDGE);
}

/* A texture of 32-bit floats: RGBA, or depth. */
static inline unsigned host_gl_texture(host_gl *host, int depth, int width, int height,
                                       const float *pixels)
{
    unsigned name = 0;
    host->gl.GenTextures(1, &name);
    host->gl.ActiveTexture(HOST_GL_TEXTURE0);
    host->gl.BindTexture(HOST_GL_TEXTURE_2D, name);
    host->gl.TexImage2D(HOST_GL_TEXTURE_2D, 0, depth ? HOST_GL_DEPTH_COMPONENT32F : HOST_GL_RGBA32F,
                        width, height, 0, depth ? HOST_GL_DEPTH_COMPONENT : HOST_GL_RGBA,
                        HOST_GL_FLOAT, pixels);
    host_gl_plain(host, HOST_GL_TEXTURE_2D);
    return name;
}

/* Six square depth maps around a point. */
static inline unsigned host_gl_cube(host_gl *host, int side)
{
    unsigned name = 0;
    host->gl.GenTextures(1, &name);
    host->gl.ActiveTexture(HOST_GL_TEXTURE0);
    host->gl.BindTexture(HOST_GL_TEXTURE_CUBE_MAP, name);
    for (unsigned face = 0; face < 6; face++)
        host->gl.TexImage2D(HOST_GL_CUBE_FACE + face, 0, HOST_GL_DEPTH_COMPONENT32F, side, side, 0,
                            HOST_GL_DEPTH_COMPONENT, HOST_GL_FLOAT, NULL);
    host_gl_plain(host, HOST_GL_TEXTURE_CUBE_MAP);
    return name;
}

/* A shape or light is a row of four texels. */
enum { HOST_GL_ROW = 16 };

static inline void host_gl_put(float *row, int texel, scatter_vec3 v, float w)
{
    row[4 * texel] = v.x;
    row[4 * texel + 1] = v.y;
    row[4 * texel + 2] = v.z;
    row[4 * texel + 3] = w;
}

static inline void host_gl_shape_row(const scene_shape *shape, float *row)
{
    host_gl_put(row, 0, shape->a, (float)shape->kind);
    host_gl_put(row, 1, shape->b, shape->radius);
    host_gl_put(row, 2, shape->albedo, 0);
}

static inline void host_gl_light_row(const scatter_light *light, float *row)
{
    scatter_vec3 none = {0, 0, 0};
    float inner = cosf(light->inner), outer = cosf(light->outer);
    double d[3], length;
    scene_doubles(light->direction, d);
    length = sqrt(scene_dot(d, d));
    for (int i = 0; i < 3 && length > 0; i++)
        d[i] /= length;
    host_gl_put(row, 0, light->position, (float)light->kind);
    host_gl_put(row, 1, scatter_v3((float)d[0], (float)d[1], (float)d[2]), light->radius);
    host_gl_put(row, 2, light->intensity, inner);
    host_gl_put(row, 3, none, outer < inner ? outer : inner - 1e-6f); /* smoothstep needs a step */
}

static inline int host_gl_fill_rows(host_gl *host)
{
    const scene_file *file = host->file;
    size_t count = file->shape_count + file->scene.light_count;
    int most = 0;
    host->gl.GetIntegerv(HOST_GL_MAX_TEXTURE_SIZE, &most);
    if (count > (size_t)most)
        return host_gl_fail(host, "expected at most %d shapes and lights, found %.0f", most,
                            (double)count);
    float *rows = (float *)calloc(count + 1, HOST_GL_ROW * sizeof *rows);
    if (!rows)
        return host_gl_fail(host, "out of memory");
    for (size_t i = 0; i < file->shape_count; i++)
        host_gl_shape_row(&file->shapes[i], rows + HOST_GL_ROW * i);
    for (size_t i = 0; i < file->scene.light_count; i++)
        host_gl_light_row(&file->lights[i], rows + HOST_GL_ROW * (file->shape_count + i));
    host->rows = host_gl_texture(host, 0, 4, count ? (int)count : 1, rows);
    free(rows);
    return 0;
}

/* ------------------------------------------------------------------------------------ >>camera */

static inline double host_gl_unit(double *v)
{
    double length = sqrt(scene_dot(v, v));
    for (int i = 0; i < 3; i++)
        v[i] /= length;
    return length;
}

static inline void host_gl_cross(const double *a, const double *b, double *out)
{
    for (int i = 0; i < 3; i++)
        out[i] = a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3];
}

/* Right, up and back of a camera that looks along `forward`. */
static inline void host_gl_axes(const double *forward, const double *up, double axes[3][3])
{
    for (int i = 0; i < 3; i++)
        axes[2][i] = -forward[i];
    host_gl_cross(forward, up, axes[0]);
    host_gl_unit(axes[0]);
    host_gl_cross(axes[2], axes[0], axes[1]);
}

/* World to camera, which looks along -z with +y up. */
static inline void host_gl_view_matrix(const scene_file *file, float *out)
{
    double eye[3], forward[3], up[3], axes[3][3];
    scene_doubles(file->eye, eye);
    scene_doubles(file->target, forward);
    scene_doubles(file->up, up);
    for (int i = 0; i < 3; i++)
        forward[i] -= eye[i];
    host_gl_unit(forward);
    host_gl_axes(forward, up, axes);
    memset(out, 0, 16 * sizeof *out);
    for (int i = 0; i < 3; i++) {
        for (int k = 0; k < 3; k++)
            out[4 * k + i] = (float)axes[i][k];
        out[12 + i] = (float)-scene_dot(axes[i], eye);
    }
    out[15] = 1;
}

/* Floats are densest at 0, so a perspective wants it infinitely far away, where depths lie close to
   each other, and a parallel projection wants it at the eye. */
static inline host_gl_depth host_gl_best_depth(int orthographic)
{
    host_gl_depth perspective = {1, 1, 0.001, 0}, parallel = {0, 1, 0, 1e6};
    return orthographic ? parallel : perspective;
}

/* Clip z = a z + b that is `first` at z = -near and `last` at -far, after the division by -z in a
   perspective. */
static inline void host_gl_depth_row(const host_gl_depth *depth, int orthographic, float *out)
{
    double low = depth->zero_to_one ? 0 : -1;
    double first = depth->reversed ? 1 : low, last = depth->reversed ? low : 1, a, b;
    if (orthographic) {
        a = (first - last) / (depth->far - depth->near);
        b = first + a * depth->near;
    } else {
        double over = depth->far > 0 ? 1 / depth->far : 0;
        b = (first - last) / (1 / depth->near - over);
        a = b * over - last;
    }
    out[10] = (float)a;
    out[14] = (float)b;
}

static inline void host_gl_projection_matrix(const scene_file *file, double aspect,
                                             const host_gl_depth *depth, float *out)
{
    double extent = (double)file->extent;
    double half = file->orthographic ? extent / 2 : tan(extent / 2);
    memset(out, 0, 16 * sizeof *out);
    out[0] = (float)(1 / (half * aspect));
    out[5] = (float)(1 / half);
    out[11] = file->orthographic ? 0 : -1;
    out[15] = file->orthographic ? 1 : 0;
    host_gl_depth_row(depth, file->orthographic, out);
}

/* scatter.h counts from the top, GL from the bottom. */
static inline host_gl_rays host_gl_camera_rays(const scatter_view *v)
{
    host_gl_rays rays = {
        {{v->origin.x + v->origin_dy.x, v->origin.y + v->origin_dy.y, v->origin.z + v->origin_dy.z},
         v->origin_dx,
         {-v->origin_dy.x, -v->origin_dy.y, -v->origin_dy.z},
         {v->direction.x + v->direction_dy.x, v->direction.y + v->direction_dy.y,
          v->direction.z + v->direction_dy.z},
         v->direction_dx,
         {-v->direction_dy.x, -v->direction_dy.y, -v->direction_dy.z}}};
    return rays;
}

/* ----------------------------------------------------------------------------------- >>shaders */

/* The spans of scene.h once more. */
static const char host_gl_spans[] =
    "uniform highp sampler2D rows; // of shapes, then of lights: see host_gl_put in the C text\n"
    "uniform int shapes, lights;\n"
    "uniform vec3 ray[6];\n"
    "uniform vec2 pixels;\n"
    "const float never = 3e38;\n"
    "const int box = 0, sphere = 1, plane = 2;\n"
    "\n"
    "vec4 row(int i, int texel) { return texelFetch(rows, ivec2(texel, i), 0); }\n"
    "int kind(int i) { return int(row(i, 0).w + 0.5); }\n"
    "\n"
    "// Where the line o + t d enters (x) and leaves (y) a box, and through which faces (z, w);\n"
    "// x > y: nowhere.\n"
    "vec4 box_span(int i, vec3 o, vec3 d, float margin) {\n"
    "    vec3 low = row(i, 0).xyz, high = row(i, 1).xyz;\n"
    "    vec4 span = vec4(-never, never, 0.0, 0.0);\n"
    "    for (int k = 0; k < 3; k++) {\n"
    "        float shrink = min(margin, 0.5 * (high[k] - low[k]));\n"
    "        float a = low[k] + shrink - o[k], b = high[k] - shrink - o[k];\n"
    "        if (d[k] == 0.0) {\n"
    "            if (a > 0.0 || b < 0.0)\n"
    "                return vec4(1.0, 0.0, 0.0, 0.0);\n"
    "            continue;\n"
    "        }\n"
    "        float near = (d[k] > 0.0 ? a : b) / d[k], far = (d[k] > 0.0 ? b : a) / d[k];\n"
    "        if (near > span.x)\n"
    "            span.xz = vec2(near, float(k));\n"
    "        if (far < span.y)\n"
    "            span.yw = vec2(far, float(k));\n"
    "    }\n"
    "    return span;\n"
    "}\n"
    "\n"
    "// |o - c + m d| at the closest point stays exact far away.\n"
    "vec2 sphere_span(int i, vec3 o, vec3 d, float margin) {\n"
    "    vec3 c = o - row(i, 0).xyz;\n"
    "    float radius = max(row(i, 1).w - margin, 0.0), dd = dot(d, d), m = -dot(c, d) / dd;\n"
    "    c += m * d;\n"
    "    float rest = radius * radius - dot(c, c);\n"
    "    if (!(rest >= 0.0))\n"
    "        return vec2(1.0, 0.0);\n"
    "    float h = sqrt(rest / dd);\n"
    "    return vec2(m - h, m + h);\n"
    "}\n"
    "\n"
    "vec2 span(int i, vec3 o, vec3 d, float margin) {\n"
    "    return kind(i) == sphere ? sphere_span(i, o, d, margin) : box_span(i, o, d, margin).xy;\n"
    "}\n"
    "\n"
    "void aim(out vec3 o, out vec3 d) {\n"
    "    vec2 at = gl_FragCoord.xy / pixels;\n"
    "    o = ray[0] + at.x * ray[1] + at.y * ray[2];\n"
    "    d = normalize(ray[3] + at.x * ray[4] + at.y * ray[5]);\n"
    "}\n";

/* scene_visible once more. */
static const char host_gl_visible[] =
    "uniform vec3 eye;\n"
    "\n"
    "float plane_distance(int i, vec3 p) { return dot(row(i, 0).xyz, p) - row(i, 1).w; }\n"
    "\n"
    "float tolerance(vec3 p) {\n"
    "    vec3 size = abs(p) + abs(p - eye);\n"
    "    return 2e-6 * max(size.x, max(size.y, size.z));\n"
    "}\n"
    "\n"
    "// How deep a point lies in a box or sphere.\n"
    "float inside(int i, vec3 p) {\n"
    "    vec3 low = row(i, 0).xyz, m = min(p - low, row(i, 1).xyz - p);\n"
    "    return kind(i) == sphere ? row(i, 1).w - length(p - low) : min(m.x, min(m.y, m.z));\n"
    "}\n"
    "\n"
    "bool crosses(int i, vec3 p, vec3 q, float margin) {\n"
    "    vec2 t = span(i, p, q - p, margin);\n"
    "    return t.x <= t.y && t.x < 1.0 && t.y > 0.0;\n"
    "}\n"
    "\n"
    "bool plane_blocks(int i, vec3 p, vec3 q, float near_p, float near_q) {\n"
    "    float a = plane_distance(i, p), b = plane_distance(i, q);\n"
    "    return abs(a) > near_p && abs(b) > near_q && (a < 0.0) != (b < 0.0);\n"
    "}\n"
    "\n"
    "bool solid_blocks(int i, vec3 p, vec3 q, float near_p, float near_q) {\n"
    "    if (!crosses(i, p, q, 0.0))\n"
    "        return false;\n"
    "    float a = inside(i, p), b = inside(i, q);\n"
    "    bool in_p = a > near_p, in_q = b > near_q, on_p = abs(a) <= near_p, on_q = abs(b) <= "
    "near_q;\n"
    "    if (in_p || in_q)\n"
    "        return !(in_p || on_p) || !(in_q || on_q);\n"
    "    if (!on_p && !on_q)\n"
    "        return true;\n"
    "    float margin = max(on_p ? near_p : 0.0, on_q ? near_q : 0.0);\n"
    "    vec3 middle = kind(i) == sphere ? row(i, 0).xyz : 0.5 * (row(i, 0).xyz + row(i, 1).xyz);\n"
    "    return inside(i, middle) > margin && crosses(i, p, q, margin);\n"
    "}\n"
    "\n"
    "bool visible(vec3 p, vec3 q) {\n"
    "    float near_p = tolerance(p), near_q = tolerance(q);\n"
    "    for (int i = 0; i < shapes; i++)\n"
    "        if (kind(i) == plane ? plane_blocks(i, p, q, near_p, near_q)\n"
    "                             : solid_blocks(i, p, q, near_p, near_q))\n"
    "            return false;\n"
    "    return true;\n"
    "}\n";

/* The picture: the nearest shape on each ray, lit. */
static const char host_gl_picture[] =
    "uniform mat4 view, projection;\n"
    "uniform vec3 background;\n"
    "uniform vec2 depth_range; // depth = x ndc + y\n"
    "uniform float sky;        // depth of what is infinitely far away\n"
    "layout(location = 0) out vec4 color;\n"
    "\n"
    "// Distance along the unit direction, or never; the normal, towards either side.\n"
    "float hit(int i, vec3 o, vec3 d, out vec3 normal) {\n"
    "    normal = row(i, 0).xyz;\n"
    "    if (kind(i) == plane) {\n"
    "        float slope = dot(normal, d), t = -plane_distance(i, o) / slope;\n"
    "        return slope != 0.0 && t > 0.0 && t < never ? t : never;\n"
    "    }\n"
    "    vec4 s = kind(i) == box ? box_span(i, o, d, 0.0) : sphere_span(i, o, d, 0.0).xyxx;\n"
    "    float t = s.x > 0.0 ? s.x : s.y;\n"
    "    if (s.x > s.y || t <= 0.0)\n"
    "        return never;\n"
    "    int axis = int((s.x > 0.0 ? s.z : s.w) + 0.5);\n"
    "    vec3 face = vec3(axis == 0, axis == 1, axis == 2);\n"
    "    normal = kind(i) == box ? face : (o + t * d - row(i, 0).xyz) / row(i, 1).w;\n"
    "    return t;\n"
    "}\n"
    "\n"
    "// Irradiance on a plane square to the light, over its intensity.\n"
    "float fall(int k, vec3 p, out vec3 to) {\n"
    "    vec3 away = row(k, 0).xyz - p;\n"
    "    float radius = row(k, 1).w, r2 = dot(away, away);\n"
    "    to = -row(k, 1).xyz;\n"
    "    if (kind(k) == 2)\n"
    "        return 1.0;\n"
    "    to = away / sqrt(max(r2, 1e-30));\n"
    "    float cone = kind(k) == 1 ? smoothstep(row(k, 3).w, row(k, 2).w, -dot(to, row(k, "
    "1).xyz))\n"
    "                              : 1.0;\n"
    "    return cone / max(r2 + radius * radius, 1e-30);\n"
    "}\n"
    "\n"
    "vec3 shade(vec3 p, vec3 normal, vec3 albedo) {\n"
    "    vec3 sum = vec3(0.0), to;\n"
    "    for (int i = 0; i < lights; i++) {\n"
    "        int k = shapes + i;\n"
    "        float e = fall(k, p, to) * max(dot(normal, to), 0.0);\n"
    "        vec3 lamp = kind(k) == 2 ? p + 1e6 * to : row(k, 0).xyz;\n"
    "        if (e > 0.0 && visible(p, lamp))\n"
    "            sum += row(k, 2).xyz * e * scatter_light_transmittance(i, p);\n"
    "    }\n"
    "    return 0.318309886 * albedo * sum;\n"
    "}\n"
    "\n"
    "void main() {\n"
    "    vec3 o, d, n, normal = vec3(0.0);\n"
    "    float nearest = never;\n"
    "    int found = -1;\n"
    "    aim(o, d);\n"
    "    for (int i = 0; i < shapes; i++) {\n"
    "        float t = hit(i, o, d, n);\n"
    "        if (t < nearest) {\n"
    "            nearest = t;\n"
    "            normal = n;\n"
    "            found = i;\n"
    "        }\n"
    "    }\n"
    "    color = vec4(background, 1.0);\n"
    "    gl_FragDepth = sky;\n"
    "    if (found < 0)\n"
    "        return;\n"
    "    vec3 p = o + nearest * d;\n"
    "    color.rgb = shade(p, dot(normal, d) > 0.0 ? -normal : normal, row(found, 2).xyz);\n"
    "    vec4 clip = projection * (view * vec4(p, 1.0));\n"
    "    gl_FragDepth = depth_range.x * (clip.z / clip.w) + depth_range.y;\n"
    "}\n";

/* A solid in a shadow map. Fog is never inside it, so any depth between where the light enters it and
   where it leaves it tells the same; the middle is farthest from both, and needs no bias. */
static const char host_gl_middle[] = "uniform int solid;\n"
                                     "uniform mat4 map;  // world to texture\n"
                                     "uniform float far; // not 0: distance / far instead\n"
                                     "\n"
                                     "void main() {\n"
                                     "    vec3 o, d;\n"
                                     "    aim(o, d);\n"
                                     "    vec2 t = span(solid, o, d, 0.0);\n"
                                     "    float middle = 0.5 * (t.x + t.y);\n"
                                     "    if (t.x > t.y || middle <= 0.0)\n"
                                     "        discard;\n"
                                     "    vec4 at = map * vec4(o + middle * d, 1.0);\n"
                                     "    gl_FragDepth = far > 0.0 ? middle / far : at.z / at.w;\n"
                                     "}\n";

/* ------------------------------------------------------------------------------------ >>lights */

/* Whether a point, or what lies far behind along a direction, is on the far side of a plane or
   within a solid. */
static inline int host_gl_is_in(const scene_shape *shape, const double *p, const double *far)
{
    double n[3];
    scene_doubles(shape->a, n);
    if (shape->kind != SCENE_PLANE)
        return !far && scene_depth(shape, p) > 0;
    return far ? scene_dot(n, far) < 0 : scene_plane_distance(shape, p) < 0;
}

/* All that an eye can see lies on its own side of each plane and each closed surface. So a shape
   with the light on its other side puts all of it into shadow, and one with both on the same side
   casts shadows only if it is a solid and they are outside. */
static inline int host_gl_shut_out(const scene_file *file, const scatter_light *light)
{
    double eye[3], lamp[3], back[3];
    scene_doubles(file->eye, eye);
    scene_doubles(light->position, lamp);
    scene_doubles(light->direction, back);
    for (int i = 0; i < 3; i++)
        back[i] = -back[i];
    for (size_t i = 0; i < file->shape_count; i++) {
        const scene_shape *shape = &file->shapes[i];
        int directional = light->kind == SCATTER_LIGHT_DIRECTIONAL;
        if (host_gl_is_in(shape, eye, NULL) !=
            host_gl_is_in(shape, lamp, directional ? back : NULL))
            return 1;
    }
    return 0;
}

/* What casts shadows, as above: a solid that the eye is not in. */
static inline int host_gl_casts(const scene_file *file, const scene_shape *shape)
{
    double eye[3];
    scene_doubles(file->eye, eye);
    return shape->kind != SCENE_PLANE && !host_gl_is_in(shape, eye, NULL);
}

/* A plane across the light's way: its axes, and the rectangle of it that the shadow map shows. Of a
   directional light in metres, else at the distance 1. */
typedef struct host_gl_frame {
    double origin[3], axes[3][3]; /* right, up, and where the light goes */
    double low[2], high[2];
    double first; /* of a directional light: distance along its way at which the solids begin */
    int directional;
} host_gl_frame;

static inline void host_gl_frame_axes(const scatter_light *light, host_gl_frame *frame)
{
    double up[3] = {0, 1, 0}, forward[3];
    memset(frame, 0, sizeof *frame);
    frame->directional = light->kind == SCATTER_LIGHT_DIRECTIONAL;
    if (!frame->directional)
        scene_doubles(light->position, frame->origin);
    scene_doubles(light->direction, forward);
    host_gl_unit(forward);
    if (fabs(forward[1]) > 0.99) {
        up[0] = 1;
        up[1] = 0;
    }
    host_gl_axes(forward, up, frame->axes);
    memcpy(frame->axes[2], forward, sizeof forward);
}

static inline void host_gl_empty(host_gl_frame *frame)
{
    frame->low[0] = frame->low[1] = frame->first = HUGE_VAL;
    frame->high[0] = frame->high[1] = -HUGE_VAL;
}

/* Widens the rectangle to a point; 0 where that lies behind the light. */
static inline int host_gl_hold_point(host_gl_frame *frame, const double *p)
{
    double r[3] = {p[0] - frame->origin[0], p[1] - frame->origin[1], p[2] - frame->origin[2]};
    double along = scene_dot(frame->axes[2], r), scale = frame->directional ? 1 : 1 / along;
    for (int i = 0; i < 2; i++) {
        double at = scene_dot(frame->axes[i], r) * scale;
        frame->low[i] = fmin(frame->low[i], at);
        frame->high[i] = fmax(frame->high[i], at);
    }
    frame->first = fmin(frame->first, along);
    return frame->directional || along > 1e-3;
}

/* Widens the rectangle to the box around a solid; returns how many of its eight corners lie before
   the light. */
static inline int host_gl_hold_solid(host_gl_frame *frame, const scene_shape *shape)
{
    double low[3], high[3];
    int before = 0;
    scene_doubles(shape->a, low);
    scene_doubles(shape->kind == SCENE_SPHERE ? shape->a : shape->b, high);
    for (int i = 0; i < 3 && shape->kind == SCENE_SPHERE; i++) {
        low[i] -= (double)shape->radius;
        high[i] += (double)shape->radius;
    }
    for (int corner = 0; corner < 8; corner++) {
        double p[3];
        for (int i = 0; i < 3; i++)
            p[i] = corner >> i & 1 ? high[i] : low[i];
        before += host_gl_hold_point(frame, p);
    }
    return before;
}

/* The rectangle that holds all solids, and for a spot light no more than its cone: outside of it
   nothing is in shadow. So the texels go where the edges of shadows are. 0: there are no solids. */
static inline int host_gl_fit(const host_gl *host, const scatter_light *light, host_gl_frame *frame)
{
    const scene_file *file = host->file;
    int behind = 0, solids = 0;
    double cone = frame->directional ? HUGE_VAL : tan((double)light->outer);
    host_gl_empty(frame);
    for (size_t i = 0; i < file->shape_count; i++)
        if (host_gl_casts(file, &file->shapes[i])) {
            behind += 8 - host_gl_hold_solid(frame, &file->shapes[i]);
            solids++;
        }
    for (int i = 0; i < 2; i++) {
        double low = behind ? -cone : fmax(frame->low[i], -cone);
        double high = behind ? cone : fmin(frame->high[i], cone);
        double margin = 2 * (high - low) / (host->shadow_map - 4); /* two texels */
        frame->low[i] = low - margin;
        frame->high[i] = high + margin;
        solids = high > low ? solids : 0;
    }
    return solids > 0;
}

/* The part of the frame that a solid may cover, corners in 0..1; 0: nothing. */
static inline int host_gl_cover_of(const host_gl_frame *frame, const scene_shape *shape,
                                   float cover[4])
{
    host_gl_frame own = *frame;
    host_gl_empty(&own);
    int before = host_gl_hold_solid(&own, shape);
    for (int i = 0; i < 2; i++) {
        double size = frame->high[i] - frame->low[i];
        double low = (own.low[i] - frame->low[i]) / size - 0.001;
        double high = (own.high[i] - frame->low[i]) / size + 0.001;
        cover[i] = before < 8 ? 0 : (float)fmax(low, 0);
        cover[2 + i] = before < 8 ? 1 : (float)fmin(high, 1);
    }
    return before > 0 && cover[0] < cover[2] && cover[1] < cover[3];
}

/* World to texture. A spot light's depth is reversed and reaches infinitely far, for floats are
   densest at 0; a directional light's is 0 at the first solid. */
static inline void host_gl_frame_matrix(const host_gl_frame *frame, float *out)
{
    double rows[4][4];
    memset(rows, 0, sizeof rows);
    for (int k = 0; k < 3; k++) {
        double z = frame->axes[2][k];
        for (int i = 0; i < 2; i++)
            rows[i][k] = (frame->axes[i][k] - (frame->directional ? 0 : frame->low[i] * z)) /
                         (frame->high[i] - frame->low[i]);
        rows[2][k] = frame->directional ? z * 1e-6 : 0;
        rows[3][k] = frame->directional ? 0 : z;
    }
    for (int i = 0; i < 4; i++)
        rows[i][3] = -scene_dot(rows[i], frame->origin);
    for (int i = 0; i < 2 && frame->directional; i++)
        rows[i][3] = -frame->low[i] / (frame->high[i] - frame->low[i]);
    if (frame->directional) {
        rows[2][3] = -frame->first * 1e-6;
        rows[3][3] = 1;
    } else
        rows[2][3] = 0.001;
    for (int i = 0; i < 16; i++)
        out[i] = (float)rows[i % 4][i / 4];
}

static inline scatter_vec3 host_gl_v3(const double *v)
{
    return scatter_v3((float)v[0], (float)v[1], (float)v[2]);
}

static inline host_gl_rays host_gl_frame_rays(const host_gl_frame *frame)
{
    double corner[3], step[2][3];
    host_gl_rays rays;
    memset(&rays, 0, sizeof rays);
    for (int k = 0; k < 3; k++) {
        corner[k] = frame->axes[2][k] * (frame->directional ? frame->first : 1);
        for (int i = 0; i < 2; i++) {
            corner[k] += frame->axes[i][k] * frame->low[i];
            step[i][k] = frame->axes[i][k] * (frame->high[i] - frame->low[i]);
        }
    }
    int moves = frame->directional ? 0 : 3; /* either the origin moves or the direction */
    rays.v[0] = host_gl_v3(frame->origin);
    rays.v[3] = host_gl_v3(frame->axes[2]);
    rays.v[moves] = host_gl_v3(corner);
    rays.v[moves + 1] = host_gl_v3(step[0]);
    rays.v[moves + 2] = host_gl_v3(step[1]);
    return rays;
}

/* A face of a cube around the light, in the order and with the axes that GL gives them. */
static inline host_gl_frame host_gl_face(const scatter_light *light, int face)
{
    static const double axes[6][2][3] = {{{0, 0, -1}, {0, -1, 0}}, {{0, 0, 1}, {0, -1, 0}},
                                         {{1, 0, 0}, {0, 0, 1}},   {{1, 0, 0}, {0, 0, -1}},
                                         {{1, 0, 0}, {0, -1, 0}},  {{-1, 0, 0}, {0, -1, 0}}};
    host_gl_frame frame = {{0}, {{0}}, {-1, -1}, {1, 1}, 0, 0};
    scene_doubles(light->position, frame.origin);
    memcpy(frame.axes, axes[face], sizeof axes[face]);
    frame.axes[2][face / 2] = face % 2 ? -1 : 1;
    return frame;
}

/* All solids into one map, or one face of a cube. */
static inline void host_gl_draw_solids(host_gl *host, const host_gl_frame *frame)
{
    const scene_file *file = host->file;
    for (size_t i = 0; i < file->shape_count; i++) {
        float cover[4];
        if (!host_gl_casts(file, &file->shapes[i]) ||
            !host_gl_cover_of(frame, &file->shapes[i], cover))
            continue;
        host->gl.Uniform4fv(host_gl_at(host, host->shadow, "cover"), 1, cover);
        host->gl.Uniform1i(host_gl_at(host, host->shadow, "solid"), (int)i);
        host->gl.DrawArrays(HOST_GL_TRIANGLE_STRIP, 0, 4);
    }
}

static inline int host_gl_draw_map(host_gl *host, unsigned target, int side,
                                   const host_gl_frame *frame, const scatter_gl_shadow *shadow)
{
    const float empty = shadow->reversed ? 0.0f : 1.0f;
    unsigned program = host->shadow;
    host_gl_rays rays = host_gl_frame_rays(frame);
    host->gl.BindFramebuffer(HOST_GL_FRAMEBUFFER, host->shadow_framebuffer);
    host->gl.FramebufferTexture2D(HOST_GL_FRAMEBUFFER, HOST_GL_DEPTH_ATTACHMENT, target,
                                  shadow->texture, 0);
    if (host->gl.CheckFramebufferStatus(HOST_GL_FRAMEBUFFER) != HOST_GL_FRAMEBUFFER_COMPLETE)
        return host_gl_fail(host, "the driver does not draw shadow maps of %dx%d", side, side);
    host->gl.Viewport(0, 0, side, side);
    host->gl.ClearBufferfv(HOST_GL_DEPTH, 0, &empty);
    host->gl.DepthFunc(shadow->reversed ? HOST_GL_GREATER : HOST_GL_LESS);
    host->gl.BindTexture(HOST_GL_TEXTURE_2D, host->rows);
    host->gl.UseProgram(program);
    host->gl.Uniform2f(host_gl_at(host, program, "pixels"), (float)side, (float)side);
    host->gl.Uniform3fv(host_gl_at(host, program, "ray"), 6, &rays.v[0].x);
    host->gl.UniformMatrix4fv(host_gl_at(host, program, "map"), 1, 0, shadow->matrix[0]);
    host->gl.Uniform1f(host_gl_at(host, program, "far"), shadow->z_far);
    host_gl_draw_solids(host, frame);
    host->gl.DepthFunc(HOST_GL_ALWAYS);
    return 0;
}

static inline int host_gl_cube_map(host_gl *host, scatter_gl_light *light)
{
    int side = (host->shadow_map + 1) / 2, failed = 0;
    light->shadow.kind = SCATTER_GL_SHADOW_CUBE;
    light->shadow.z_far = 1e6f;
    light->shadow.texture = host_gl_cube(host, side);
    for (int face = 0; face < 6 && !failed; face++) {
        host_gl_frame frame = host_gl_face(&light->light, face);
        failed = host_gl_draw_map(host, HOST_GL_CUBE_FACE + (unsigned)face, side, &frame,
                                  &light->shadow);
    }
    return failed;
}

static inline int host_gl_flat_map(host_gl *host, scatter_gl_light *light)
{
    int side = host->shadow_map;
    host_gl_frame frame;
    host_gl_frame_axes(&light->light, &frame);
    if (!host_gl_fit(host, &light->light, &frame))
        return 0;
    light->shadow.kind = SCATTER_GL_SHADOW_2D;
    light->shadow.reversed = !frame.directional;
    light->shadow.texture = host_gl_texture(host, 1, side, side, NULL);
    host_gl_frame_matrix(&frame, light->shadow.matrix[0]);
    return host_gl_draw_map(host, HOST_GL_TEXTURE_2D, side, &frame, &light->shadow);
}

static inline int host_gl_has_casters(const host_gl *host)
{
    for (size_t i = 0; i < host->file->shape_count; i++)
        if (host_gl_casts(host->file, &host->file->shapes[i]))
            return 1;
    return 0;
}

/* The lights as the fog wants them. A spot light too wide for one map gets a cube. */
static inline int host_gl_light_up(host_gl *host)
{
    const scene_file *file = host->file;
    int casters = host_gl_has_casters(host), failed = 0;
    host->lights = (scatter_gl_light *)calloc(file->scene.light_count + 1, sizeof *host->lights);
    if (!host->lights)
        return host_gl_fail(host, "out of memory");
    for (size_t i = 0; i < file->scene.light_count && !failed; i++) {
        scatter_gl_light *light = &host->lights[i];
        light->light = file->lights[i];
        if (host_gl_shut_out(file, &light->light))
            light->light.intensity = scatter_v3(0, 0, 0);
        else if (casters && (light->light.kind == SCATTER_LIGHT_POINT ||
                             (light->light.kind == SCATTER_LIGHT_SPOT && light->light.outer > 1)))
            failed = host_gl_cube_map(host, light);
        else if (casters)
            failed = host_gl_flat_map(host, light);
    }
    return failed;
}

/* ----------------------------------------------------------------------------------- >>picture */

static inline void host_gl_sources(const host_gl *host, unsigned program)
{
    const scene_file *file = host->file;
    host->gl.UseProgram(program);
    host->gl.Uniform1i(host_gl_at(host, program, "rows"), 0);
    host->gl.Uniform1i(host_gl_at(host, program, "shapes"), (int)file->shape_count);
    host->gl.Uniform1i(host_gl_at(host, program, "lights"), (int)file->scene.light_count);
    host->gl.Uniform3fv(host_gl_at(host, program, "eye"), 1, &file->eye.x);
}

static inline int host_gl_surface(host_gl *host, const char *glsl)
{
    static const char none[] =
        "vec3 scatter_light_transmittance(int light, vec3 world) { return vec3(1.0); }\n";
    static const float whole[4] = {0, 0, 1, 1};
    const char *text[] = {host_gl_version(host), glsl ? glsl : none, host_gl_spans, host_gl_visible,
                          host_gl_picture};
    const scene_file *file = host->file;
    int width = host->fog_view.width, height = host->fog_view.height;
    scatter_view view = scene_view(file, width, height);
    host_gl_rays rays = host_gl_camera_rays(&view);
    unsigned program = host_gl_program(host, text, 5);
    if (!program)
        return 1;
    host->gl.DeleteProgram(host->program);
    host->program = program;
    host_gl_sources(host, program);
    host->gl.Uniform4fv(host_gl_at(host, program, "cover"), 1, whole);
    host->gl.Uniform2f(host_gl_at(host, program, "pixels"), (float)width, (float)height);
    host->gl.Uniform3fv(host_gl_at(host, program, "ray"), 6, &rays.v[0].x);
    host->gl.Uniform3fv(host_gl_at(host, program, "background"), 1, &file->scene.background.x);
    host->gl.UniformMatrix4fv(host_gl_at(host, program, "view"), 1, 0, host->view);
    host->gl.UniformMatrix4fv(host_gl_at(host, program, "projection"), 1, 0, host->projection);
    float scale = host->convention.zero_to_one ? 1.0f : 0.5f;
    host->gl.Uniform2f(host_gl_at(host, program, "depth_range"), scale, 1 - scale);
    host->gl.Uniform1f(host_gl_at(host, program, "sky"), host->convention.reversed ? 0.0f : 1.0f);
    return 0;
}

/* Every pixel is written, so nothing is cleared. */
static inline void host_gl_draw(host_gl *host)
{
    host->gl.BindFramebuffer(HOST_GL_FRAMEBUFFER, host->framebuffer);
    host->gl.Viewport(0, 0, host->fog_view.width, host->fog_view.height);
    host->gl.ActiveTexture(HOST_GL_TEXTURE0);
    host->gl.BindTexture(HOST_GL_TEXTURE_2D, host->rows);
    host->gl.BindVertexArray(host->array);
    host->gl.UseProgram(host->program);
    host->gl.DrawArrays(HOST_GL_TRIANGLE_STRIP, 0, 4);
}

static inline int host_gl_read(host_gl *host, const file_picture *picture)
{
    size_t width = (size_t)picture->width, height = (size_t)picture->height;
    float *rgba = (float *)malloc(width * height * 4 * sizeof *rgba);
    if (!rgba)
        return host_gl_fail(host, "out of memory");
    host->gl.BindFramebuffer(HOST_GL_FRAMEBUFFER, host->framebuffer);
    host->gl.ReadPixels(0, 0, picture->width, picture->height, HOST_GL_RGBA, HOST_GL_FLOAT, rgba);
    for (size_t y = 0; y < height; y++)
        for (size_t x = 0; x < width; x++)
            memcpy(picture->rgb + 3 * (y * width + x), rgba + 4 * ((height - 1 - y) * width + x),
                   3 * sizeof(float));
    free(rgba);
    return 0;
}

/* ----------------------------------------------------------------------------------- >>opening */

static inline int host_gl_make_target(host_gl *host)
{
    static const unsigned first = HOST_GL_COLOR_ATTACHMENT0;
    int width = host->fog_view.width, height = host->fog_view.height;
    host->color = host_gl_texture(host, 0, width, height, NULL);
    host->depth = host_gl_texture(host, 1, width, height, NULL);
    host->gl.GenFramebuffers(1, &host->framebuffer);
    host->gl.BindFramebuffer(HOST_GL_FRAMEBUFFER, host->framebuffer);
    host->gl.FramebufferTexture2D(HOST_GL_FRAMEBUFFER, HOST_GL_COLOR_ATTACHMENT0,
                                  HOST_GL_TEXTURE_2D, host->color, 0);
    host->gl.FramebufferTexture2D(HOST_GL_FRAMEBUFFER, HOST_GL_DEPTH_ATTACHMENT, HOST_GL_TEXTURE_2D,
                                  host->depth, 0);
    host->gl.DrawBuffers(1, &first);
    if (host->gl.CheckFramebufferStatus(HOST_GL_FRAMEBUFFER) != HOST_GL_FRAMEBUFFER_COMPLETE)
        return host_gl_fail(host, "the driver does not draw pictures of 32-bit floats, %dx%d",
                            width, height);
    return 0;
}

static inline void host_gl_aim(host_gl *host, const host_gl_options *options)
{
    const scene_file *file = host->file;
    scatter_gl_view *v = &host->fog_view;
    host->convention =
        options && options->depth ? *options->depth : host_gl_best_depth(file->orthographic);
    host_gl_view_matrix(file, host->view);
    host_gl_projection_matrix(file, (double)v->width / v->height, &host->convention,
                              host->projection);
    v->view = host->view;
    v->projection = host->projection;
    v->reversed = host->convention.reversed;
    v->zero_to_one = host->convention.zero_to_one;
    v->framebuffer = host->framebuffer;
    v->depth_texture = host->depth;
}

/* Shadow maps, once the program that fills them is there. */
static inline int host_gl_cast_shadows(host_gl *host)
{
    static const unsigned none = HOST_GL_NONE;
    const char *text[] = {host_gl_version(host), host_gl_spans, host_gl_middle};
    host->shadow = host_gl_program(host, text, 3);
    if (!host->shadow)
        return 1;
    host->gl.GenFramebuffers(1, &host->shadow_framebuffer);
    host->gl.BindFramebuffer(HOST_GL_FRAMEBUFFER, host->shadow_framebuffer);
    host->gl.DrawBuffers(1, &none);
    host_gl_sources(host, host->shadow);
    host->gl.ActiveTexture(HOST_GL_TEXTURE0);
    return host_gl_light_up(host);
}

/* All shadow maps together take 256 MB at most: those of a sky are many. */
static inline int host_gl_map_side(size_t lights)
{
    int side = 2048;
    while (side > 16 && (double)side * side * (double)lights > 1 << 26)
        side /= 2;
    return side;
}

static inline int host_gl_open(host_gl *host, scatter_gl_proc (*get)(const char *name),
                               const scene_file *file, int width, int height,
                               const host_gl_options *options)
{
    memset(host, 0, sizeof *host);
    host->file = file;
    host->shadow_map = options && options->shadow_map ? options->shadow_map
                                                      : host_gl_map_side(file->scene.light_count);
    host->fog_view.width = width;
    host->fog_view.height = height;
    if (host_gl_load(host, get))
        return 1;
    host->gl.GenVertexArrays(1, &host->array);
    host->gl.BindVertexArray(host->array);
    host->gl.Enable(HOST_GL_DEPTH_TEST); /* else no depth is written */
    host->gl.DepthFunc(HOST_GL_ALWAYS);
    host->gl.DepthMask(1);
    int failed = host_gl_fill_rows(host) || host_gl_make_target(host) || host_gl_cast_shadows(host);
    host_gl_aim(host, options);
    return failed;
}

static inline void host_gl_close(host_gl *host)
{
    const unsigned textures[3] = {host->rows, host->color, host->depth};
    const unsigned framebuffers[2] = {host->framebuffer, host->shadow_framebuffer};
    if (!host->array)
        return;
    for (size_t i = 0; host->lights && i < host->file->scene.light_count; i++)
        host->gl.DeleteTextures(1, &host->lights[i].shadow.texture);
    free(host->lights);
    host->gl.DeleteTextures(3, textures);
    host->gl.DeleteFramebuffers(2, framebuffers);
    host->gl.DeleteProgram(host->program);
    host->gl.DeleteProgram(host->shadow);
    host->gl.DeleteVertexArrays(1, &host->array);
    host->array = 0;
}

#endif
