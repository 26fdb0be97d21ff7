/* scatter_gl.h - the fog of scatter.h in any OpenGL program. MIT licence, see LICENSE.

   Do this in ONE C or C++ file, and include the header plainly everywhere else:

       #define SCATTER_IMPLEMENTATION
       #include "scatter_gl.h"                                       // includes scatter.h

   Once, with a GL context current:

       scatter_gl_desc desc = {0};
       desc.get_proc_address = glfwGetProcAddress;                   // or what finds GL functions for you
       scatter_gl *fog;
       scatter_gl_create(&desc, &fog);

   When media or lights change, then every frame, behind your opaque things and in front of transparent ones:

       scatter_gl_set_medium(fog, &medium);                          // scatter_medium, see scatter.h
       scatter_gl_set_lights(fog, lights, count);                    // scatter_gl_light: a light, perhaps a shadow map
       scatter_gl_update(fog, NULL, NULL);                           // fills volumes, only where something changed
       scatter_gl_view view = {0};
       view.view = &camera[0][0];  view.projection = &projection[0][0];
       view.framebuffer = hdr;     view.depth_texture = depth;       // your picture, linear; your depth buffer
       view.width = width;         view.height = height;
       scatter_gl_draw(fog, &view);                                  // L + T scene

   What it does
   - Everything that scatter.h does with media, lights and phase functions, by the same formulas: their text is shared.
   - Point, spot and directional lights, any number, four to a pass; shadowed by the medium and by your shadow maps.
   - Ends rays at your depth buffer; any projection; half and quarter resolution; multisampled targets.
   - Gives your own shaders the light that arrives on a surface through the medium, and fogs transparent things.
   - Leaves your GL state as it was.
   What it does not do: noise, history, a camera of its own. Nothing moves between frames unless you move it.

   OpenGL, GLSL and what they need
     OpenGL 3.3 .. 4.6 core or compatibility   GLSL 330, 410, 450
     OpenGL ES 3.0 .. 3.2, WebGL 2             GLSL 300 es, 310 es; EXT_color_buffer_float, without it: depth
                                               `closed` and full resolution only, one grid, no froxels.
                                               OES_texture_float_linear and EXT_float_blend: without them volumes
                                               have 16 bits, and cells gather instead of being splatted into
   Timer queries: OpenGL only.

   GL state that is touched, saved before each call and restored behind it (unless desc.keep_state):
     program, vertex array, draw framebuffer; viewport 0, scissor test 0; blending, its functions and equations, colour
     masks of all draw buffers; depth, stencil, culling, rasterizer discard, alpha to coverage and to one, sample
     coverage and mask, logic operation, polygon smoothing and mode, clip control, clip distances (all off in between);
     texture units 0..10: 2D, 3D, 2D array and cube bindings and samplers; active unit; uniform buffer bindings 0..2 and
     the general one; pixel unpack buffer and storage.
     Nothing is cached from call to call, and glGetError is never called. Not touched: read framebuffer, array and
     element buffers, renderbuffers, pack state, queries (yours count the passes), transform feedback (it must be
     paused). Your depth texture and shadow maps are read plainly, but for swizzle and GL_DEPTH_STENCIL_TEXTURE_MODE,
     which are the texture's own. Clip control is saved, and GL_UPPER_LEFT understood.
     scatter_gl_bind_surface is there to change your state: it says what it leaves.
     With several draw buffers on OpenGL ES 3.0 your framebuffer must have one colour attachment.

   Conventions: those of scatter.h. Matrices are column-major, clip = projection view world; view right-handed or not.
   Positions are kept relative to the middle of the medium, so that a scene may lie far from the origin; matrices of
   floats are then the limit.
   Fog lies in front of everything between the eye (not the near plane) and the depth buffer's surface.
   Of a multisampled target, the fog of a pixel is the same in all its samples: give a resolved depth texture.

   Step by step
   1. scatter_gl_create, once for each context. scatter_gl_warm_up compiles ahead of the first frame, if you like.
   2. scatter_gl_set_medium, scatter_gl_set_lights: copied. Setting the same again costs a comparison.
   3. scatter_gl_update: quality as in scatter.h. auto depth is closed for up to 16 Gaussians, polar for more and for
      grids; auto density is exact up to 256 Gaussians and one grid, else a volume. eq6, short and march are for the
      CPU. Closed depth of a grid (one, density exact) is a ray to each light from each node, in steps of half a voxel:
      slow, but without a volume.
      Empty voxels cost little: a pass before the lights marks where each ray meets voxels (not with quality.no_mask),
      and the march and rays to lights jump by a map of distances (not with quality.no_distance_map), which is made
      whenever voxels change. Neither changes a bit of the picture. They take 8 bytes a pixel, and 12 a voxel
      (8 with half_float).
   4. scatter_gl_draw, as often as you have views: two for stereo.
   5. Surfaces: put scatter_gl_surface_glsl(fog) behind the #version line of your shaders, multiply each light with
      scatter_light_transmittance(i, world), call scatter_gl_bind_surface before drawing. When that text changes (the
      pointer does), compile again: it depends on the kinds of terms of the medium and on quality.depth.
   6. Transparent things: scatter_gl_fill_froxels, and scatter_fog(color, world) in the same shaders.
   7. Last, scatter_gl_tone_map brings the linear picture to the screen. In a pass of your own: the chapters "prelude",
      "tone" and "photographic" of scatter_gl_glsl.

   Errors: results and log as in scatter.h; SCATTER_UNSUPPORTED where the context lacks something. A shader that does not
   compile is logged whole, with numbered lines. Accuracy is measured in docs/accuracy.md and docs/report_gl.md.
   Volumes of 16 bits (desc.half_float): depth errs by up to 2^-10 of itself more for each value it is summed from.
   Memory: host.allocate only in create, warm_up, surface_glsl, and where programs or grids become more; textures are
   made when limits, quality or sizes grow. A frame after the first like it allocates, compiles and creates nothing.
   Threads: as OpenGL: the thread whose context is current.
   Configuration, before including: that of scatter.h, and
     SCATTER_GL_NO_LOADER    take the gl functions that you have declared; get_proc_address may then be NULL, and what is
                             not in every version (blending per draw buffer, timers...) is found through it only
   Limits: 8 terms of height fog; 64 lights for surfaces, any number in the fog; voxels on every axis as the context
   allows. Mesa's llvmpipe ends the loops of a pixel after 65535 turns without a word: exact density with hundreds of
   Gaussians on one ray, or hundreds of nodes, come out too dark there; a density volume does not.
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
    float z_near, z_far; /* cube, z_far > z_near > 0: each face holds the depth 0..1 of a perspective projection
                           between them; z_near 0: the distance from the light over z_far */
} scatter_gl_shadow;

typedef struct scatter_gl_light {
    scatter_light light;
    scatter_gl_shadow shadow; /* zero: the host's geometry does not stop it */
} scatter_gl_light;

/* What the pixels show. */
typedef enum scatter_gl_show {
    SCATTER_GL_SHOW_FOG = 0,       /* L + T scene */
    SCATTER_GL_SHOW_DENSITY,       /* integral of D along the ray, m, as grey */
    SCATTER_GL_SHOW_LIGHT_DEPTH,   /* mean optical depth to the light `show_light`, over the density of its lit parts, as grey */
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
   nx*ny*nz froxels, slices spaced evenly in the logarithm of the distance between z_near and z_far. */
typedef struct scatter_gl_froxels {
    int nx, ny, nz;  /* 0: 160, 90, 64 */
    float z_near, z_far; /* m, 0 < z_near < z_far; behind z_far the last slice goes on */
} scatter_gl_froxels;

/* A picture from linear HDR to the screen, see scatter_gl_tone_map. */
typedef struct scatter_gl_tone {
    scatter_tone tone;     /* key, white; log_average 0: of this picture, found on the GPU */
    unsigned source;       /* 2D texture, not multisampled: linear colour; not attached to `framebuffer` */
    int source_x, source_y; /* its texel that becomes the lower left pixel */
    unsigned framebuffer;  /* drawn to; 0: the default one */
    int x, y, width, height; /* its pixels; as many texels of the source */
    int linear; /* 0: encoded as sRGB, what a screen shows; not 0: linear, for a framebuffer that encodes by itself
                   (GL_FRAMEBUFFER_SRGB, sRGB formats in OpenGL ES) and for further passes */
} scatter_gl_tone;

/* GPU milliseconds of the last measured passes; -1: not measured, or not finished yet. Ask each frame: a pass is not
   measured again before its time was fetched. */
typedef struct scatter_gl_times {
    float inject, depth, view, upsample, froxels;
} scatter_gl_times;

/* What the passes did since scatter_gl_create. */
typedef struct scatter_gl_stats {
    unsigned injections;   /* of the medium into the density volume */
    unsigned propagations; /* of optical depth, one for each batch of four sources */
    unsigned distance_maps; /* made of voxels */
    unsigned programs;     /* compiled */
    unsigned textures;     /* created */
    size_t texture_bytes;  /* held now, about */
} scatter_gl_stats;

typedef struct scatter_gl scatter_gl;

/* -------------------------------------------------------------------------------------- >>functions
   Each needs the context current in which the fog was made. */

SCATTER_API scatter_result scatter_gl_create(const scatter_gl_desc *desc, scatter_gl **fog);
/* Deletes what the fog holds in the current context. */
SCATTER_API void scatter_gl_destroy(scatter_gl *fog);
/* The same after the context was lost: gives back memory, calls no GL. */
SCATTER_API void scatter_gl_abandon(scatter_gl *fog);

/* Takes over a medium; arrays are copied, voxels are uploaded when their grid's `version`, size or address changed: into a
   buffer with new storage and from there into the texture that the frame before does not read, so that the call waits for
   a copy and, as far as the driver keeps to that, not for the GPU. Grids whose voxels change have two textures; another
   size makes new ones. */
SCATTER_API scatter_result scatter_gl_set_medium(scatter_gl *fog, const scatter_medium *medium);
SCATTER_API scatter_result scatter_gl_set_lights(scatter_gl *fog, const scatter_gl_light *lights,
                                                 size_t count);
/* Fills the volumes that the methods of `quality` need (NULL: defaults), only where something changed since the last
   call. eye: not NULL: optical depth from there goes into the volumes as well, and draw reads it from the closed volume
   and from upwind's instead of integrating it (right only for a camera that stands there, and less exact).
   quality.lights_per_update: volumes of four lights (three beside an eye) are redone whole, the longest out of date first;
   those that wait keep the shadows of earlier directions and an earlier medium, colours and phase function are the present
   ones. Volumes that hold nothing yet are always filled, and an eye that moves redoes all. */
SCATTER_API scatter_result scatter_gl_update(scatter_gl *fog, const scatter_quality *quality,
                                             const scatter_vec3 *eye);
/* Blends the fog over the picture: L + T scene, alpha as of premultiplied colour. */
SCATTER_API scatter_result scatter_gl_draw(scatter_gl *fog, const scatter_gl_view *view);
/* Fills the view-aligned volume for scatter_fog() in the host's shaders. */
SCATTER_API scatter_result scatter_gl_fill_froxels(scatter_gl *fog, const scatter_gl_view *view,
                                                   const scatter_gl_froxels *froxels);
/* scatter_tone_map of a picture: Reinhard's photographic operator; alpha stays. The logarithmic average is reduced on the
   GPU and never read back. It needs no medium. Without float targets (EXT_color_buffer_float) tone.log_average must be
   given. */
SCATTER_API scatter_result scatter_gl_tone_map(scatter_gl *fog, const scatter_gl_tone *tone);
/* Makes room for pictures of that size at reduced resolution and, after an update with voxels, for their masks, so that
   draw creates nothing. */
SCATTER_API scatter_result scatter_gl_resize(scatter_gl *fog, int width, int height);
/* Updates, and compiles what draw will need for the present medium, lights and quality. */
SCATTER_API scatter_result scatter_gl_warm_up(scatter_gl *fog, const scatter_quality *quality,
                                              const scatter_gl_view *view);

/* For the host's own shaders, for the first 64 lights (48 beside an eye; fewer where four textures of the depth volumes do
   not hold as many, see MAX_3D_TEXTURE_SIZE: the others arrive undimmed): text to put between #version and the shader, with
     vec3 scatter_light_transmittance(int light, vec3 world)   T(P, S) between a surface and a light
     vec4 scatter_fog(vec4 premultiplied, vec3 world)          a transparent fragment seen through the fog */
SCATTER_API const char *scatter_gl_surface_glsl(scatter_gl *fog);
/* Binds what that text reads: six texture units from first_unit on, uniform blocks at first_block and first_block + 1,
   and sets the program's uniforms. This one changes the host's state, and leaves `program` in use. */
SCATTER_API scatter_result scatter_gl_bind_surface(scatter_gl *fog, unsigned program, int first_unit,
                                                   int first_block);

SCATTER_API scatter_gl_times scatter_gl_get_times(scatter_gl *fog);
SCATTER_API scatter_gl_stats scatter_gl_get_stats(const scatter_gl *fog);

/* The GLSL text of a chapter, with static lifetime; NULL if there is no chapter of that name. */
SCATTER_API const char *scatter_gl_glsl(const char *chapter);
/* A whole shader, as the passes compile it.
   version: what follows #version: "330 core", "300 es"...
   pass: one of scatter_gl_pass_name for its fragment shader, with ":vertex" behind it for its vertex shader.
   features: some of scatter_gl_feature_name with blanks between them, "" for none; those that the pass does not depend
   on are left out. A number 1..8 among them: layers that the pass fills at once.
   Writes at most `room` bytes to `text` (may be NULL if room is 0), the last of them 0. Returns the length of the whole
   text without that 0; 0: no such pass or feature. Needs no context. */
SCATTER_API size_t scatter_gl_shader(const char *version, const char *pass, const char *features,
                                     char *text, size_t room);
/* Names by index 0, 1...; NULL behind the last. */
SCATTER_API const char *scatter_gl_pass_name(int index);
SCATTER_API const char *scatter_gl_feature_name(int index);

#ifdef __cplusplus
}
#endif
#endif /* SCATTER_GL_H */

#if defined(SCATTER_IMPLEMENTATION) && !defined(SCATTER_GL_IMPLEMENTED)
#define SCATTER_GL_IMPLEMENTED

/* ---------------------------------------------------------------------------------- >>gl functions
   Types, names and functions of OpenGL that are used, so that no GL header is needed and no name of the host's
   loader is touched. */

#if defined(_WIN32) /* where it means something on 32 bits only */
#define SCATTERI_GL_CALL __stdcall
#else
#define SCATTERI_GL_CALL
#endif

typedef unsigned char scatteri_gl_byte;

enum {
    SCATTERI_GL_ACTIVE_TEXTURE = 0x84E0,
    SCATTERI_GL_ARRAY_2D = 0x8C1A,
    SCATTERI_GL_BLEND = 0x0BE2,
    SCATTERI_GL_BLEND_DST_ALPHA = 0x80CA,
    SCATTERI_GL_BLEND_DST_RGB = 0x80C8,
    SCATTERI_GL_BLEND_EQUATION_ALPHA = 0x883D,
    SCATTERI_GL_BLEND_EQUATION_RGB = 0x8009,
    SCATTERI_GL_BLEND_SRC_ALPHA = 0x80CB,
    SCATTERI_GL_BLEND_SRC_RGB = 0x80C9,
    SCATTERI_GL_CLAMP_TO_EDGE = 0x812F,
    SCATTERI_GL_CLIP_DEPTH_MODE = 0x935D,
    SCATTERI_GL_CLIP_ORIGIN = 0x935C,
    SCATTERI_GL_COLOR_0 = 0x8CE0, /* attachment */
    SCATTERI_GL_COLOR_WRITEMASK = 0x0C23,
    SCATTERI_GL_COMPILED = 0x8B81,
    SCATTERI_GL_COMPLETE = 0x8CD5,
    SCATTERI_GL_CUBE = 0x8513,
    SCATTERI_GL_CURRENT_PROGRAM = 0x8B8D,
    SCATTERI_GL_DRAW_BINDING = 0x8CA6,
    SCATTERI_GL_DRAW_FRAMEBUFFER = 0x8CA9,
    SCATTERI_GL_DYNAMIC = 0x88E8,
    SCATTERI_GL_EXTENSIONS = 0x1F03,
    SCATTERI_GL_FLOAT = 0x1406,
    SCATTERI_GL_FRAGMENT = 0x8B30,
    SCATTERI_GL_FUNC_ADD = 0x8006,
    SCATTERI_GL_HALF_FLOAT = 0x140B,
    SCATTERI_GL_LINEAR = 0x2601,
    SCATTERI_GL_LINKED = 0x8B82,
    SCATTERI_GL_MAG_FILTER = 0x2800,
    SCATTERI_GL_LOWER_LEFT = 0x8CA1,
    SCATTERI_GL_MINUS_ONE_TO_ONE = 0x935E,
    SCATTERI_GL_MAX_3D = 0x8073,
    SCATTERI_GL_MAX_DRAW_BUFFERS = 0x8824,
    SCATTERI_GL_MAX_SIZE = 0x0D33,
    SCATTERI_GL_MIN_FILTER = 0x2801,
    SCATTERI_GL_NEAREST = 0x2600,
    SCATTERI_GL_NUM_EXTENSIONS = 0x821D,
    SCATTERI_GL_FILL = 0x1B02,
    SCATTERI_GL_FRONT_AND_BACK = 0x0408,
    SCATTERI_GL_POLYGON_MODE = 0x0B40,
    SCATTERI_GL_ONE = 1,
    SCATTERI_GL_ONE_MINUS_SRC_ALPHA = 0x0303,
    SCATTERI_GL_QUERY_AVAILABLE = 0x8867,
    SCATTERI_GL_QUERY_BUFFER = 0x9192,
    SCATTERI_GL_QUERY_BUFFER_BINDING = 0x9193,
    SCATTERI_GL_QUERY_RESULT = 0x8866,
    SCATTERI_GL_R16F = 0x822D,
    SCATTERI_GL_R32F = 0x822E,
    SCATTERI_GL_RED = 0x1903,
    SCATTERI_GL_RG = 0x8227,
    SCATTERI_GL_RG16F = 0x822F,
    SCATTERI_GL_RG32F = 0x8230,
    SCATTERI_GL_RG32UI = 0x823C,
    SCATTERI_GL_RG_INTEGER = 0x8228,
    SCATTERI_GL_RGBA = 0x1908,
    SCATTERI_GL_RGBA16F = 0x881A,
    SCATTERI_GL_RGBA32F = 0x8814,
    SCATTERI_GL_SAMPLER_BINDING = 0x8919,
    SCATTERI_GL_SCISSOR_TEST = 0x0C11,
    SCATTERI_GL_SRC_ALPHA = 0x0302,
    SCATTERI_GL_SRC_COLOR = 0x0300,
    SCATTERI_GL_STREAM = 0x88E0,
    SCATTERI_GL_TEXTURE_0 = 0x84C0,
    SCATTERI_GL_TEXTURE_2D = 0x0DE1,
    SCATTERI_GL_TEXTURE_3D = 0x806F,
    SCATTERI_GL_TEXTURE_COMPARE_MODE = 0x884C,
    SCATTERI_GL_TIMESTAMP = 0x8E28,
    SCATTERI_GL_TRIANGLES = 4,
    SCATTERI_GL_TRIANGLE_STRIP = 5,
    SCATTERI_GL_UNIFORM_BUFFER = 0x8A11,
    SCATTERI_GL_UNIFORM_BUFFER_SIZE = 0x8A2A,
    SCATTERI_GL_UNIFORM_BUFFER_START = 0x8A29,
    SCATTERI_GL_UNSIGNED_INT = 0x1405,
    SCATTERI_GL_UNPACK_BUFFER = 0x88EC,
    SCATTERI_GL_UNPACK_BUFFER_BINDING = 0x88EF,
    SCATTERI_GL_VERSION = 0x1F02,
    SCATTERI_GL_VERTEX = 0x8B31,
    SCATTERI_GL_VERTEX_ARRAY_BINDING = 0x85B5,
    SCATTERI_GL_VIEWPORT = 0x0BA2,
    SCATTERI_GL_WRAP_R = 0x8072,
    SCATTERI_GL_WRAP_S = 0x2802,
    SCATTERI_GL_WRAP_T = 0x2803,
    SCATTERI_GL_ZERO = 0
};

#define SCATTERI_GL_INVALID_INDEX 0xFFFFFFFFu

/* result, name, arguments; in every version that is supported */
#define SCATTERI_GL_FUNCTIONS(F) \
    F(void, ActiveTexture, (unsigned unit)) \
    F(void, AttachShader, (unsigned program, unsigned shader)) \
    F(void, BindBuffer, (unsigned target, unsigned buffer)) \
    F(void, BindBufferBase, (unsigned target, unsigned index, unsigned buffer)) \
    F(void, BindBufferRange, \
      (unsigned target, unsigned index, unsigned buffer, ptrdiff_t offset, ptrdiff_t size)) \
    F(void, BindFramebuffer, (unsigned target, unsigned framebuffer)) \
    F(void, BindSampler, (unsigned unit, unsigned sampler)) \
    F(void, BindTexture, (unsigned target, unsigned texture)) \
    F(void, BindVertexArray, (unsigned array)) \
    F(void, BlendEquationSeparate, (unsigned rgb, unsigned alpha)) \
    F(void, BlendFuncSeparate, (unsigned rgb, unsigned drgb, unsigned alpha, unsigned dalpha)) \
    F(void, BufferData, (unsigned target, ptrdiff_t size, const void *data, unsigned usage)) \
    F(void, BufferSubData, (unsigned target, ptrdiff_t offset, ptrdiff_t size, const void *data)) \
    F(unsigned, CheckFramebufferStatus, (unsigned target)) \
    F(void, ColorMask, \
      (scatteri_gl_byte r, scatteri_gl_byte g, scatteri_gl_byte b, scatteri_gl_byte a)) \
    F(void, CompileShader, (unsigned shader)) \
    F(unsigned, CreateProgram, (void)) \
    F(unsigned, CreateShader, (unsigned type)) \
    F(void, DeleteBuffers, (int count, const unsigned *buffers)) \
    F(void, DeleteFramebuffers, (int count, const unsigned *framebuffers)) \
    F(void, DeleteProgram, (unsigned program)) \
    F(void, DeleteSamplers, (int count, const unsigned *samplers)) \
    F(void, DeleteShader, (unsigned shader)) \
    F(void, DeleteTextures, (int count, const unsigned *textures)) \
    F(void, DeleteVertexArrays, (int count, const unsigned *arrays)) \
    F(void, Disable, (unsigned what)) \
    F(void, DrawArrays, (unsigned mode, int first, int count)) \
    F(void, DrawArraysInstanced, (unsigned mode, int first, int count, int instances)) \
    F(void, DrawBuffers, (int count, const unsigned *buffers)) \
    F(void, Enable, (unsigned what)) \
    F(void, FramebufferTexture2D, \
      (unsigned target, unsigned attachment, unsigned textarget, unsigned texture, int level)) \
    F(void, FramebufferTextureLayer, \
      (unsigned target, unsigned attachment, unsigned texture, int level, int layer)) \
    F(void, GenBuffers, (int count, unsigned *buffers)) \
    F(void, GenFramebuffers, (int count, unsigned *framebuffers)) \
    F(void, GenSamplers, (int count, unsigned *samplers)) \
    F(void, GenTextures, (int count, unsigned *textures)) \
    F(void, GenVertexArrays, (int count, unsigned *arrays)) \
    F(void, GetBooleanv, (unsigned name, scatteri_gl_byte *values)) \
    F(void, GetIntegeri_v, (unsigned name, unsigned index, int *values)) \
    F(void, GetInteger64i_v, (unsigned name, unsigned index, int64_t *values)) \
    F(void, GetIntegerv, (unsigned name, int *values)) \
    F(void, GetProgramInfoLog, (unsigned program, int room, int *length, char *text)) \
    F(void, GetProgramiv, (unsigned program, unsigned name, int *value)) \
    F(void, GetShaderInfoLog, (unsigned shader, int room, int *length, char *text)) \
    F(void, GetShaderiv, (unsigned shader, unsigned name, int *value)) \
    F(const unsigned char *, GetString, (unsigned name)) \
    F(const unsigned char *, GetStringi, (unsigned name, unsigned index)) \
    F(unsigned, GetUniformBlockIndex, (unsigned program, const char *name)) \
    F(int, GetUniformLocation, (unsigned program, const char *name)) \
    F(scatteri_gl_byte, IsEnabled, (unsigned what)) \
    F(scatteri_gl_byte, IsTexture, (unsigned name)) \
    F(void, LinkProgram, (unsigned program)) \
    F(void, PixelStorei, (unsigned name, int value)) \
    F(void, SamplerParameteri, (unsigned sampler, unsigned name, int value)) \
    F(void, Scissor, (int x, int y, int width, int height)) \
    F(void, ShaderSource, \
      (unsigned shader, int count, const char *const *texts, const int *lengths)) \
    F(void, TexImage2D, \
      (unsigned target, int level, int internal, int width, int height, int border, \
       unsigned format, unsigned type, const void *data)) \
    F(void, TexImage3D, \
      (unsigned target, int level, int internal, int width, int height, int depth, int border, \
       unsigned format, unsigned type, const void *data)) \
    F(void, TexParameteri, (unsigned target, unsigned name, int value)) \
    F(void, TexSubImage2D, \
      (unsigned target, int level, int x, int y, int width, int height, unsigned format, \
       unsigned type, const void *data)) \
    F(void, TexSubImage3D, \
      (unsigned target, int level, int x, int y, int z, int width, int height, int depth, \
       unsigned format, unsigned type, const void *data)) \
    F(void, Uniform1i, (int location, int value)) \
    F(void, Uniform4f, (int location, float x, float y, float z, float w)) \
    F(void, Uniform4i, (int location, int x, int y, int z, int w)) \
    F(void, UniformBlockBinding, (unsigned program, unsigned block, unsigned binding)) \
    F(void, UseProgram, (unsigned program)) \
    F(void, Viewport, (int x, int y, int width, int height))

/* In some versions only: NULL elsewhere. */
#define SCATTERI_GL_OPTIONAL(F) \
    F(void, ClipControl, (unsigned origin, unsigned depth)) \
    F(void, BlendEquationSeparatei, (unsigned buffer, unsigned rgb, unsigned alpha)) \
    F(void, BlendFuncSeparatei, \
      (unsigned buffer, unsigned rgb, unsigned drgb, unsigned alpha, unsigned dalpha)) \
    F(void, ColorMaski, \
      (unsigned buffer, scatteri_gl_byte r, scatteri_gl_byte g, scatteri_gl_byte b, \
       scatteri_gl_byte a)) \
    F(void, Disablei, (unsigned what, unsigned index)) \
    F(void, Enablei, (unsigned what, unsigned index)) \
    F(void, GetBooleani_v, (unsigned name, unsigned index, scatteri_gl_byte *values)) \
    F(void, GetFloati_v, (unsigned name, unsigned index, float *values)) \
    F(scatteri_gl_byte, IsEnabledi, (unsigned what, unsigned index)) \
    F(void, ScissorIndexed, (unsigned index, int x, int y, int width, int height)) \
    F(void, ViewportIndexedf, (unsigned index, float x, float y, float width, float height)) \
    F(void, PolygonMode, (unsigned faces, unsigned mode)) \
    F(void, GenQueries, (int count, unsigned *queries)) \
    F(void, DeleteQueries, (int count, const unsigned *queries)) \
    F(void, QueryCounter, (unsigned query, unsigned what)) \
    F(void, GetQueryObjectiv, (unsigned query, unsigned name, int *value)) \
    F(void, GetQueryObjectui64v, (unsigned query, unsigned name, uint64_t *value))

#define SCATTERI_GL_MEMBER(result, name, arguments) result(SCATTERI_GL_CALL *name) arguments;

typedef struct scatteri_gl_functions {
    SCATTERI_GL_FUNCTIONS(SCATTERI_GL_MEMBER)
    SCATTERI_GL_OPTIONAL(SCATTERI_GL_MEMBER)
} scatteri_gl_functions;

/* -------------------------------------------------------------------------------------- >>context
   What a fog holds on the GPU and beside it. */

enum {
    SCATTERI_GL_BATCH = 4,    /* lights to a depth volume: its channels */
    SCATTERI_GL_GROUP = 8,    /* batches drawn at once: as many lights as the block holds */
    SCATTERI_GL_CASCADES = 4, /* of a shadow map */
    SCATTERI_GL_HEIGHTS = 8,  /* terms of height fog: as in the block */
    SCATTERI_GL_SLICES = 8,   /* layers of a volume that one pass fills, at most */
    SCATTERI_GL_FEW = 64      /* Gaussians up to which their closed forms pay: half the rows of the block */
};

#define SCATTERI_GL_ROW 1024 /* texels in a row of the table of Gaussians; also in GLSL */

/* Texture units of every pass. */
enum {
    SCATTERI_GL_UNIT_GAUSSIANS, /* 2D: centre - ref and a; then c, reach */
    SCATTERI_GL_UNIT_RULES,     /* 2D: row i holds Gauss-Legendre rule i: node, weight */
    SCATTERI_GL_UNIT_FIELD,     /* 3D: density of voxels */
    SCATTERI_GL_UNIT_VOLUME,    /* 3D: optical depth of four sources */
    SCATTERI_GL_UNIT_SCENE,     /* 2D: the host's depth buffer */
    SCATTERI_GL_UNIT_SHADOW,    /* of the four lights: 2D, array or cube */
    SCATTERI_GL_UNIT_BEFORE = SCATTERI_GL_UNIT_SHADOW + SCATTERI_GL_BATCH, /* 2D: an earlier pass */
    SCATTERI_GL_UNIT_BEFORE_TOO,
    SCATTERI_GL_UNITS
};

/* Uniform blocks, one list for C and GLSL. Everything is a vec4, so that std140 adds nothing: V(name) is one, A(name,
   count) an array. In GLSL the names begin with scatteri_. Positions are relative to the fog's `ref`. */
#define SCATTERI_GL_MEDIUM_BLOCK(V, A)                                                             \
    V(extinction) /* rgb; w: the largest */                                                        \
    V(albedo)     /* rgb times extinction; w: the smallest extinction that is not 0 */             \
    V(emission)   /* rgb; w: constant density */                                                   \
    V(lobe_pair)  /* g1, alpha1, g2, alpha2 */                                                     \
    V(lobe_turn)  /* weight of the second lobe, turn */                                            \
    V(counts)     /* of Gaussians, of height fogs, not used */                                     \
    V(bounds_min) /* of the medium; w: not used */                                                 \
    V(bounds_max)                                                                                  \
    V(local_min) /* box of the local terms, where depth volumes lie; w: cells along each axis */   \
    V(local_max)                                                                                   \
    V(field_min)  /* box of the field; w: scale of its values */                                   \
    V(field_max)  /* w: metres by which a distance in it may be too large */                       \
    V(field_per)  /* 1/size of that box; w: metres of a distance of 1 in it */                     \
    V(nodes)      /* in a panel, features in a panel, steps of the march */                        \
    V(trim)       /* of the rays, in units of a^2 r^2 */                                           \
    A(heights, 8) /* density, y0, scale */                                                         \
    A(few, 128)   /* Gaussians 2 i and 2 i + 1 of the table, if they are few and thin */

/* Four lights, or up to 32 of them in batches that are drawn at once; those that are not there have no intensity. */
#define SCATTERI_GL_LIGHTS_BLOCK(V, A) \
    V(batch) /* lights; channel of the first: 1 behind the eye; layers of a batch's volume; first layer */ \
    A(light, 32)     /* position; w: 0 point, 1 spot, 2 directional */ \
    A(direction, 32) /* unit; w: radius */ \
    A(intensity, 32) /* rgb; w: 1 if the light is in the rim of the medium */ \
    A(cone, 32)      /* cosines of inner and outer, density at the light, not used */ \
    A(axis_u, 32)    /* of the polar volume; w: first column */ \
    A(axis_v, 32)    \
    A(axis_w, 32)    /* w: first shell */ \
    A(polar, 32)     /* 1/step of u, v, r; r of the last shell */ \
    A(polar_size, 32) /* columns, columns, shells of this light; w: 1 if directional */ \
    A(anchor, 32)     /* of the wavefront: where waves begin; w: bits of axes on which the source is inside.
                        Of columns: where they begin, 0 if directional */ \
    A(shadow, 4)     /* kind, bias, 1 or -1 (reversed), cascades */ \
    A(shadow_more, 4) /* layer, near, far, not used */ \
    A(shadow_matrix, 64) /* rows of the matrix of light l and cascade c at (l 4 + c) 4 */

/* The rays of a picture: x, y in -1..1 are clip coordinates, z the depth buffer's after (z z_scale + z_offset). */
#define SCATTERI_GL_VIEW_BLOCK(V, A) \
    V(eye)          /* origin of the ray at x = y = 0 */ \
    V(eye_dx) \
    V(eye_dy) \
    V(forward)      /* direction there, not of unit length */ \
    V(forward_dx) \
    V(forward_dy) \
    V(weight)       /* w at x, y, z, 1 */ \
    V(range)        /* t = (range.x z + range.y) |direction| / w; z = range.z depth + range.w */ \
    V(window)       /* x, y of the corner, 2/width, 2/height */ \
    V(picture)      /* clear depth, divide, 1 if there is a depth texture, channel to be shown or -1 */ \
    V(show)         /* one of scatter_gl_show, its light */ \
    V(froxels)      /* nx, ny, nz, log(far / near) */ \
    V(froxel_range) /* near, far */

/* For the host's shaders: what the lights block holds, for 64 slots, and the camera of the froxels. */
#define SCATTERI_GL_SURFACE_BLOCK(V, A) \
    V(surface_batch) /* lights to a batch; 1: the eye is in channel 0; batches to a texture, layers to a batch */ \
    V(surface_ref) \
    V(surface_range) /* near, log(far / near), middle of the first slice and of the last */ \
    V(froxel_eye)    /* w: 1 if perspective */ \
    V(froxel_x) \
    V(froxel_y) \
    V(froxel_w) \
    V(froxel_t) \
    A(light, 64) \
    A(direction, 64) \
    A(axis_u, 64) \
    A(axis_v, 64) \
    A(axis_w, 64) \
    A(polar, 64) \
    A(polar_size, 64) \
    A(anchor, 64)

#define SCATTERI_GL_C_ONE(name) float name[4];
#define SCATTERI_GL_C_ARRAY(name, count) float name[count][4];
#define SCATTERI_GL_TEXT(text) SCATTERI_GL_TEXT_OF(text)
#define SCATTERI_GL_TEXT_OF(text) #text
#define SCATTERI_GL_GLSL_ONE(name) "    vec4 scatteri_" #name ";\n"
#define SCATTERI_GL_GLSL_ARRAY(name, count) \
    "    vec4 scatteri_" #name "[" SCATTERI_GL_TEXT(count) "];\n"

typedef struct scatteri_gl_medium_block {
    SCATTERI_GL_MEDIUM_BLOCK(SCATTERI_GL_C_ONE, SCATTERI_GL_C_ARRAY)
} scatteri_gl_medium_block;

typedef struct scatteri_gl_lights_block {
    SCATTERI_GL_LIGHTS_BLOCK(SCATTERI_GL_C_ONE, SCATTERI_GL_C_ARRAY)
} scatteri_gl_lights_block;

typedef struct scatteri_gl_surface_block {
    SCATTERI_GL_SURFACE_BLOCK(SCATTERI_GL_C_ONE, SCATTERI_GL_C_ARRAY)
} scatteri_gl_surface_block;

typedef struct scatteri_gl_view_block {
    SCATTERI_GL_VIEW_BLOCK(SCATTERI_GL_C_ONE, SCATTERI_GL_C_ARRAY)
} scatteri_gl_view_block;

typedef struct scatteri_gl_texture {
    unsigned name, target;
    int format, width, height, depth; /* internal format; depth 0: 2D */
    int first; /* of a part of another texture: its first layer */
} scatteri_gl_texture;

typedef uint64_t scatteri_gl_features; /* a set of SCATTERI_GL_HAS(...) */

/* What decides about a program's text. */
typedef struct scatteri_gl_key {
    int pass; /* index into scatteri_gl_passes */
    scatteri_gl_features features;
    int slices; /* layers that it fills at once */
    int count;  /* of Gaussians, where loops over them have that many turns; 0: any number */
} scatteri_gl_key;

typedef struct scatteri_gl_program {
    scatteri_gl_key key;
    unsigned name;
    int at;   /* location of the uniform ivec4 scatteri_at: what changes from draw to draw; -1: none */
    int tone; /* of the uniform vec4 scatteri_tone */
} scatteri_gl_program;

enum {
    SCATTERI_GL_TIME_INJECT,
    SCATTERI_GL_TIME_DEPTH,
    SCATTERI_GL_TIME_VIEW,
    SCATTERI_GL_TIME_UPSAMPLE,
    SCATTERI_GL_TIME_FROXELS,
    SCATTERI_GL_TIMES
};

typedef struct scatteri_gl_timer {
    unsigned begin, end; /* queries */
    int pending;
    float ms;
} scatteri_gl_timer;

/* A light on the GPU, and what its channel was filled for. */
typedef struct scatteri_gl_lamp {
    scatter_gl_light desc; /* direction of unit length */
    scatter_depth layout;  /* source, method and where the cells lie, as they were filled; without values */
    int filled;            /* the channel holds this source's depth */
    int held;              /* it holds depth, if only of where the source was, or of the medium before */
    unsigned filled_at;    /* which update filled it */
    int in_rim;            /* see scatteri_in_rim */
} scatteri_gl_lamp;

/* The voxels that a grid's texture holds, and the texture before it, which takes the next ones. */
typedef struct scatteri_gl_voxels {
    scatter_grid held; /* density NULL: none */
    scatteri_gl_texture before;
} scatteri_gl_voxels;

struct scatter_gl {
    scatter_host host;
    scatter_gl_desc desc; /* without zeros */
    scatteri_gl_functions gl;
    int es, version;          /* 330, 450, 300 ... */
    int max_3d, max_2d, draw_buffers;
    int can_blend_float, can_filter_float, can_draw_float, can_draw_half;
    int lost;    /* no GL calls any more */
    int upside_down; /* the host has clip y downwards: GL_UPPER_LEFT */
    int dropped; /* textures were deleted since the state was saved */

    scatteri_medium medium;
    scatter_vec3 ref; /* of all positions on the GPU */
    int medium_version; /* grows with each change of the local terms */
    int has_medium;     /* 0 where the last one could not be taken over */
    scatteri_gl_lamp *lamps; /* max_lights + 1: the last is the eye */
    int lamp_count, batch_count;
    int has_eye;
    scatter_quality quality; /* resolved */
    scatteri_trim trim;
    int ready;               /* volumes and tables are those of medium, lights and quality */
    unsigned updates;

    unsigned vertex_array, framebuffer;
    unsigned medium_buffer, view_buffer, *light_buffers; /* one for each batch */
    unsigned nearest, linear;                            /* samplers */
    scatteri_gl_texture gaussians, rules, *grids, field;
    scatteri_gl_texture *volumes; /* each of `stacked` batches, of `layers` each */
    int stacked, layers;
    scatteri_gl_voxels *voxels; /* of the grids */
    int grid_room;
    unsigned voxel_buffer;
    scatteri_gl_texture running[2], wave[2]; /* of running sums and of the wavefront */
    scatteri_gl_texture reduced[2];           /* L and T at reduced resolution */
    scatteri_gl_texture froxels, froxel_running[2];
    scatteri_gl_texture logs[2];              /* sums of logarithms of luminance, and of how many */
    char *surface_text;
    scatteri_gl_features surface_features;
    unsigned surface_buffer;
    scatteri_gl_surface_block surface_block;
    const scatteri_gl_texture *density;       /* the field that is read: a grid's, or `field` */
    int injected_version;                     /* of the medium in `field` */
    scatteri_gl_texture spaced;       /* density of the field, and distance to voxels with some */
    scatteri_gl_texture distances[2]; /* on the way to it: along x in a few layers, along x and y */
    const scatteri_gl_texture *spaced_of; /* the field that it was made of, */
    int spaced_version;                   /* and the medium */
    scatteri_gl_texture mask; /* of each pixel: where the field begins and ends on its ray */
    int rule_nodes;                           /* `rules` are made for */

    scatteri_gl_program *programs;
    int program_count, program_room;
    scatteri_gl_timer timers[SCATTERI_GL_TIMES];
    scatter_gl_stats stats;
    float *scratch; /* for uploads of tables */
    size_t scratch_floats;
    scatteri_gl_medium_block medium_block;
    scatteri_gl_lights_block lights_block;
    scatteri_gl_view_block view_block;
};

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

/* >>glsl passes: chapters by hand */

static const char scatteri_gl_blocks[] =
    "#define SCATTERI_FAR " SCATTERI_GL_TEXT(SCATTERI_FAR) "\n"
    "#define SCATTERI_OPAQUE " SCATTERI_GL_TEXT(SCATTERI_OPAQUE) "\n"
    "#define SCATTERI_VOXELS " SCATTERI_GL_TEXT(SCATTERI_VOXELS) "\n"
    "layout(std140) uniform scatteri_medium_block {\n" SCATTERI_GL_MEDIUM_BLOCK(
        SCATTERI_GL_GLSL_ONE, SCATTERI_GL_GLSL_ARRAY)
    "};\n"
    "layout(std140) uniform scatteri_lights_block {\n" SCATTERI_GL_LIGHTS_BLOCK(
        SCATTERI_GL_GLSL_ONE, SCATTERI_GL_GLSL_ARRAY)
    "};\n"
    "layout(std140) uniform scatteri_view_block {\n" SCATTERI_GL_VIEW_BLOCK(
        SCATTERI_GL_GLSL_ONE, SCATTERI_GL_GLSL_ARRAY)
    "};\n";

static const char scatteri_gl_surface_blocks[] =
    "#define SCATTERI_FAR " SCATTERI_GL_TEXT(SCATTERI_FAR) "\n"
    "layout(std140) uniform scatteri_medium_block {\n" SCATTERI_GL_MEDIUM_BLOCK(
        SCATTERI_GL_GLSL_ONE, SCATTERI_GL_GLSL_ARRAY)
    "};\n"
    "layout(std140) uniform scatteri_surface_block {\n" SCATTERI_GL_SURFACE_BLOCK(
        SCATTERI_GL_GLSL_ONE, SCATTERI_GL_GLSL_ARRAY)
    "};\n";

static const char scatteri_gl_whole[] =
    "void main() {\n"
    "    vec2 corner = vec2(float((gl_VertexID << 1) & 2), float(gl_VertexID & 2));\n"
    "    gl_Position = vec4(corner * 2.0 - 1.0, 0.0, 1.0);\n"
    "}\n";

/* --- the medium, and depth that is stored in volumes --- */

/* Gaussians by number. */
static const char scatteri_gl_table[] =
    "uniform highp sampler2D scatteri_gaussians;\n"
    "vec4 scatteri_gauss_texel(int i) {\n"
    "    const int row = " SCATTERI_GL_TEXT(SCATTERI_GL_ROW) ";\n"
    "    return texelFetch(scatteri_gaussians, ivec2(i % row, i / row), 0);\n"
    "}\n"
    "#ifdef SCATTERI_FEW_THIN\n"
    "#define SCATTERI_ROW_OF(i) scatteri_few[i]\n"
    "#else\n"
    "#define SCATTERI_ROW_OF(i) scatteri_gauss_texel(i)\n"
    "#endif\n"
    "vec4 scatteri_gauss_place(int i) {\n" /* centre, a */
    "    return SCATTERI_ROW_OF(2 * i);\n"
    "}\n"
    "vec4 scatteri_gauss_weight(int i) {\n" /* c, reach, c sqrt(pi)/(2a), sqrt(reach)/a */
    "    return SCATTERI_ROW_OF(2 * i + 1);\n"
    "}\n";

/* Depth of all Gaussians between x and `segment` metres towards `to`. */
static const char scatteri_gl_gaussians[] =
    "float scatteri_quick_span(float x, float y) {\n"
    "    float qx = scatteri_erf_under(x * x);\n"
    "    float qy = scatteri_erf_under(y * y);\n"
    "    return (scatteri_erf_over(y, y * y) * qx - scatteri_erf_over(x, x * x) * qy) / (qx * qy);\n"
    "}\n"
    /* From a m and a (length - m). Thick Gaussians by the form that keeps its digits in the tails, and so short
       segments, whose mean density would lose them. */
    "float scatteri_gauss_span(float low, float high, float half_length, float thick) {\n"
    "#ifdef SCATTERI_FEW_THIN\n"
    "    return scatteri_quick_span(clamp(low, -3.6, 3.6), clamp(high, -3.6, 3.6));\n"
    "#else\n"
    "    if (thick < " SCATTERI_GL_TEXT(SCATTERI_QUICK) " && half_length > 0.05)\n"
    "        return scatteri_quick_span(clamp(low, -3.6, 3.6), clamp(high, -3.6, 3.6));\n"
    "    return scatteri_erf_span(max(low, -1e6), min(high, 1e6), min(half_length, 1e6));\n"
    "#endif\n"
    "}\n"
    "float scatteri_gauss_depth_to(vec4 g, vec4 c, vec3 x, vec3 to, float segment) {\n"
    "    vec3 d = g.xyz - x;\n"
    "    float m = dot(d, to);\n"
    "    vec3 across = d - m * to;\n"
    "    float fade = g.w * g.w * dot(across, across);\n"
    "    if (fade >= c.y)\n"
    "        return 0.0;\n"
    "    return c.z * exp(-fade) *\n"
    "           scatteri_gauss_span(-g.w * m, g.w * (segment - m), 0.5 * g.w * segment,\n"
    "                               scatteri_extinction.w * c.z);\n"
    "}\n"
    "float scatteri_closed_depth(vec3 x, vec3 to, float segment) {\n"
    "    float depth = 0.0;\n"
    "    for (int i = 0; i < SCATTERI_COUNT; i++)\n"
    "        depth += scatteri_gauss_depth_to(scatteri_gauss_place(i), scatteri_gauss_weight(i), x, to,\n"
    "                                         segment);\n"
    "    return max(depth, 0.0);\n"
    "}\n";

/* Density from the field, constant and height fog, and what part of a ray the bounds leave. */
static const char scatteri_gl_density[] =
    "#ifdef SCATTERI_FIELD\n"
    "uniform highp sampler3D scatteri_field;\n"
    /* Density at x, and metres around it within which there is none, as far as that is known. */
    "vec2 scatteri_field_at(vec3 x) {\n"
    "    vec3 g = (x - scatteri_field_min.xyz) * scatteri_field_per.xyz;\n"
    "    bool inside = all(greaterThanEqual(x, scatteri_field_min.xyz)) &&\n"
    "                  all(lessThanEqual(x, scatteri_field_max.xyz));\n"
    "    vec2 value = textureLod(scatteri_field, g, 0.0).xy;\n"
    "    float room = 0.0;\n"
    "#ifdef SCATTERI_DISTANCE\n"
    "    room = value.y * scatteri_field_per.w - scatteri_field_max.w;\n"
    "#endif\n"
    "    return inside ? vec2(scatteri_field_min.w * value.x, room) : vec2(0.0);\n"
    "}\n"
    "float scatteri_field_density(vec3 x) {\n"
    "    return scatteri_field_at(x).x;\n"
    "}\n"
    "#endif\n"
    "#ifdef SCATTERI_FOG\n"
    "float scatteri_fog_density(vec3 x) {\n"
    "    float density = scatteri_emission.w;\n"
    "    for (int i = 0; i < int(scatteri_counts.y); i++) {\n"
    "        vec4 h = scatteri_heights[i];\n"
    "        density += h.x * exp(min((h.y - x.y) / h.z, 80.0));\n"
    "    }\n"
    "    return density;\n"
    "}\n"
    "float scatteri_fog_depth(vec3 x, vec3 to, float segment) {\n"
    "    float depth = scatteri_emission.w * segment;\n"
    "    for (int i = 0; i < int(scatteri_counts.y); i++) {\n"
    "        vec4 h = scatteri_heights[i];\n"
    "        depth += scatteri_height_depth(h.x, h.y, h.z, x.y, to.y, segment);\n"
    "    }\n"
    "    return min(depth, SCATTERI_FAR);\n"
    "}\n"
    "#endif\n"
    "vec3 scatteri_not_zero3(vec3 d) {\n"
    "    return mix(d, vec3(1e-20), lessThan(abs(d), vec3(1e-20)));\n"
    "}\n"
    /* t of the faces that are met first and last, going along d. */
    "vec3 scatteri_near_faces(vec3 low, vec3 high, vec3 x, vec3 d) {\n"
    "    return (mix(low, high, lessThan(d, vec3(0.0))) - x) / d;\n"
    "}\n"
    "vec3 scatteri_far_faces(vec3 low, vec3 high, vec3 x, vec3 d) {\n"
    "    return (mix(high, low, lessThan(d, vec3(0.0))) - x) / d;\n"
    "}\n"
    "float scatteri_least3(vec3 v) {\n"
    "    return min(v.x, min(v.y, v.z));\n"
    "}\n"
    "float scatteri_most3(vec3 v) {\n"
    "    return max(v.x, max(v.y, v.z));\n"
    "}\n"
    /* Part of the ray x + t d inside a box and between t.x and t.y; empty where t.y <= t.x. A ray that lies in a face
       is inside. */
    "vec2 scatteri_clip_box(vec3 low, vec3 high, vec3 x, vec3 d, vec2 t) {\n"
    "    bvec3 still = equal(d, vec3(0.0));\n"
    "    vec3 safe = mix(d, vec3(1.0), still);\n"
    "    vec3 outside = 1.0 - step(low, x) * step(x, high);\n"
    "    vec3 at = mix(vec3(-SCATTERI_FAR), vec3(SCATTERI_FAR), outside);\n"
    "    vec3 near = mix(scatteri_near_faces(low, high, x, safe), at, still);\n"
    "    vec3 far = mix(scatteri_far_faces(low, high, x, safe), -at, still);\n"
    "    return vec2(max(t.x, scatteri_most3(near)), min(t.y, scatteri_least3(far)));\n"
    "}\n"
    /* Length of the segment from x towards a source, inside the bounds. */
    "float scatteri_segment_to(vec3 x, vec3 to, float distance) {\n"
    "#ifdef SCATTERI_BOUNDED\n"
    "    vec3 ends = scatteri_far_faces(scatteri_bounds_min.xyz, scatteri_bounds_max.xyz, x,\n"
    "                                   scatteri_not_zero3(to));\n"
    "    return min(distance, max(scatteri_least3(ends), 0.0));\n"
    "#else\n"
    "    return distance;\n"
    "#endif\n"
    "}\n";

/* Rays through the field. */
static const char scatteri_gl_rays[] =
    "#ifdef SCATTERI_FIELD\n"
    "#if !defined(SCATTERI_GAUSSIANS) && !defined(SCATTERI_FOG)\n"
    "#define SCATTERI_VOXELS_ONLY\n"
    "#endif\n"
    /* Of the steps of h metres behind a place with that much room around it, those that cannot meet density. */
    "int scatteri_steps_over(float room, float h) {\n"
    "    return room > h ? int(min(ceil(room / h), 65536.0)) - 1 : 0;\n"
    "}\n"
    "#ifdef SCATTERI_RAYS\n"
    /* Depth of the field between x and `segment` metres towards `to`: middle values of steps of half a voxel. */
    "float scatteri_field_ray(vec3 x, vec3 to, float segment) {\n"
    "    vec2 t = scatteri_clip_box(scatteri_field_min.xyz, scatteri_field_max.xyz, x, to,\n"
    "                               vec2(0.0, segment));\n"
    "    vec3 rate = to * scatteri_field_per.xyz;\n"
    "    float size = max(t.y - t.x, 0.0), sum = 0.0;\n"
    "    float voxels = size * scatteri_most3(abs(rate) * vec3(textureSize(scatteri_field, 0)));\n"
    "    float steps = floor(min(2.0 * voxels, 8191.0)) + 1.0, h = size / steps;\n"
    "    vec3 first = (x - scatteri_field_min.xyz) * scatteri_field_per.xyz + (t.x + 0.5 * h) * rate;\n"
    "    vec2 room = vec2(scatteri_field_per.w, scatteri_field_max.w) / max(h, 1.0e-30);\n"
    "    for (float i = 0.0; i < steps; i++) {\n"
    "        vec2 field = textureLod(scatteri_field, first + i * h * rate, 0.0).xy;\n"
    "        sum += field.x;\n"
    "#ifdef SCATTERI_DISTANCE\n"
    "        i += max(ceil(field.y * room.x - room.y) - 1.0, 0.0);\n"
    "#endif\n"
    "    }\n"
    "    return scatteri_field_min.w * h * sum;\n"
    "}\n"
    "#endif\n"
    "#endif\n";

/* What the volume of a batch holds at a place in its texels; slot 4 b + c is channel c of batch b. Batches lie behind each
   other in the layers of a texture; nobody reads beyond the middle of their outermost texels, where they would mix. */
static const char scatteri_gl_one_volume[] =
    "uniform highp sampler3D scatteri_volume;\n"
    "vec4 scatteri_volume_at(int slot, vec3 texel) {\n"
    "    texel.z += scatteri_batch.w + float(slot / 4) * scatteri_batch.z;\n"
    "    return textureLod(scatteri_volume, texel / vec3(textureSize(scatteri_volume, 0)), 0.0);\n"
    "}\n";

/* For surfaces: of all batches that four textures hold. */
static const char scatteri_gl_four_volumes[] =
    "uniform highp sampler3D scatteri_volume0;\n"
    "uniform highp sampler3D scatteri_volume1;\n"
    "uniform highp sampler3D scatteri_volume2;\n"
    "uniform highp sampler3D scatteri_volume3;\n"
    "#define SCATTERI_TEXEL(volume) textureLod(volume, texel / vec3(textureSize(volume, 0)), 0.0)\n"
    "vec4 scatteri_volume_at(int slot, vec3 texel) {\n"
    "    int batch = slot / 4, stack = batch / int(scatteri_surface_batch.z);\n"
    "    int before = batch - stack * int(scatteri_surface_batch.z);\n"
    "    texel.z += float(before) * scatteri_surface_batch.w;\n"
    "    return stack == 0   ? SCATTERI_TEXEL(scatteri_volume0)\n"
    "           : stack == 1 ? SCATTERI_TEXEL(scatteri_volume1)\n"
    "           : stack == 2 ? SCATTERI_TEXEL(scatteri_volume2)\n"
    "                        : SCATTERI_TEXEL(scatteri_volume3);\n"
    "}\n";

/* Depth of the local terms as the volumes hold it, read as scatteri_read_cells and scatteri_read_columns do: between
   values by the texture unit, one fetch, but for cells in the outer half of the outermost ones, where the linear function
   goes on. */
static const char scatteri_gl_volume[] =
    "#ifdef SCATTERI_CELLS\n"
    /* All four sources at x in the local box. */
    "vec4 scatteri_cells_at(int slot, vec3 x) {\n"
    "    vec3 cells = vec3(scatteri_local_min.w);\n"
    "    vec3 size = scatteri_local_max.xyz - scatteri_local_min.xyz;\n"
    "    vec3 g = (x - scatteri_local_min.xyz) / size * cells;\n"
    "    vec3 centre = clamp(g, vec3(0.5), cells - 0.5);\n"
    "    vec3 off = clamp(g - centre, -0.5, 0.5);\n"
    "    vec3 beyond = vec3(notEqual(off, vec3(0.0)));\n"
    "    vec4 sum = vec4(0.0);\n"
    "    int fetches = beyond == vec3(0.0) ? 1 : 8;\n"
    "    for (int i = 0; i < fetches; i++) {\n"
    "        vec3 mirrored = vec3(float(i & 1), float(i >> 1 & 1), float(i >> 2));\n"
    "        vec3 w = 1.0 + beyond - mirrored * (1.0 + 2.0 * beyond);\n"
    "        float weight = w.x * w.y * w.z;\n"
    "        if (weight != 0.0)\n"
    "            sum += weight * scatteri_volume_at(slot, centre - mirrored * off);\n"
    "    }\n"
    "    return sum;\n"
    "}\n"
    "float scatteri_cells_depth(int channel, vec3 x, vec3 to, float distance, float segment) {\n"
    "    vec3 d = scatteri_not_zero3(to);\n"
    "    vec3 near = scatteri_near_faces(scatteri_local_min.xyz, scatteri_local_max.xyz, x, d);\n"
    "    vec3 far = scatteri_far_faces(scatteri_local_min.xyz, scatteri_local_max.xyz, x, d);\n"
    "    float enter = max(scatteri_most3(near), 0.0);\n"
    "    float leave = min(scatteri_least3(far), segment);\n"
    "    if (leave < enter)\n"
    "        return 0.0;\n"
    "    float rest = scatteri_light[channel].w > 1.5 ? 1.0 : distance - enter;\n"
    "    return max(rest * scatteri_cells_at(channel, x + enter * to)[channel & 3], 0.0);\n"
    "}\n"
    "#endif\n"
    "#ifdef SCATTERI_POLAR\n"
    /* From the source for which the columns were filled. */
    "float scatteri_columns_depth(int channel, vec3 x) {\n"
    "    vec4 u = scatteri_axis_u[channel];\n"
    "    vec4 v = scatteri_axis_v[channel];\n"
    "    vec4 w = scatteri_axis_w[channel];\n"
    "    vec4 per = scatteri_polar[channel];\n"
    "    vec4 count = scatteri_polar_size[channel];\n"
    "    vec3 o = x - scatteri_anchor[channel].xyz;\n"
    "    vec3 q = vec3(dot(o, u.xyz), dot(o, v.xyz), dot(o, w.xyz));\n"
    "    bool parallel = count.w > 0.5;\n"
    "    vec2 column = parallel ? q.xy : scatteri_oct_encode(q);\n"
    "    float r = min(parallel ? q.z : length(o), per.w);\n"
    "    vec3 g = (vec3(column, r) - vec3(u.w, v.w, w.w)) * per.xyz;\n"
    "    g = clamp(g, vec3(0.0), count.xyz - 1.0) + 0.5;\n"
    "    float value = scatteri_volume_at(channel, g)[channel & 3];\n"
    "    return parallel ? value : r * value;\n"
    "}\n"
    "#endif\n"
    "#if defined(SCATTERI_CELLS) || defined(SCATTERI_POLAR)\n"
    /* Of source `channel` of the batch; `segment`: part of `distance` inside the bounds. */
    "float scatteri_volume_depth(int channel, vec3 x, vec3 to, float distance, float segment) {\n"
    "#ifdef SCATTERI_POLAR\n"
    "    return scatteri_columns_depth(channel, x);\n"
    "#else\n"
    "    return scatteri_cells_depth(channel, x, to, distance, segment);\n"
    "#endif\n"
    "}\n"
    "#endif\n";

/* --- passes that fill volumes ---
   Each draws several layers at once. scatteri_at.x: the first of them. */

static const char scatteri_gl_slices[] =
    "#ifndef SCATTERI_FIRST\n"
    "#define SCATTERI_FIRST 0\n"
    "#endif\n"
    "layout(location = SCATTERI_FIRST) out vec4 scatteri_slice[SCATTERI_SLICES];\n"
    "uniform ivec4 scatteri_at;\n"
    /* ES takes constant indices only. */
    "void scatteri_write(vec4 values[SCATTERI_SLICES]) {\n"
    "    scatteri_slice[0] = values[0];\n"
    "#if SCATTERI_SLICES > 1\n"
    "    scatteri_slice[1] = values[1];\n"
    "#endif\n"
    "#if SCATTERI_SLICES > 2\n"
    "    scatteri_slice[2] = values[2];\n"
    "#endif\n"
    "#if SCATTERI_SLICES > 3\n"
    "    scatteri_slice[3] = values[3];\n"
    "#endif\n"
    "#if SCATTERI_SLICES > 4\n"
    "    scatteri_slice[4] = values[4];\n"
    "#endif\n"
    "#if SCATTERI_SLICES > 5\n"
    "    scatteri_slice[5] = values[5];\n"
    "#endif\n"
    "#if SCATTERI_SLICES > 6\n"
    "    scatteri_slice[6] = values[6];\n"
    "#endif\n"
    "#if SCATTERI_SLICES > 7\n"
    "    scatteri_slice[7] = values[7];\n"
    "#endif\n"
    "}\n";

static const char scatteri_gl_cells[] =
    "vec3 scatteri_cell_size() {\n"
    "    return (scatteri_local_max.xyz - scatteri_local_min.xyz) / scatteri_local_min.w;\n"
    "}\n"
    /* Centre of a cell of the local box, relative to `from`. */
    "vec3 scatteri_cell_centre(ivec3 cell, vec3 from) {\n"
    "    return (scatteri_local_min.xyz - from) + (vec3(cell) + 0.5) * scatteri_cell_size();\n"
    "}\n";

/* Density of one grid and of all Gaussians, as far as SCATTERI_FIELD and SCATTERI_GAUSSIANS ask for them. */
static const char scatteri_gl_inject_cells[] =
    "#ifdef SCATTERI_GAUSSIANS\n"
    "void scatteri_gather(inout vec4 values[SCATTERI_SLICES]) {\n"
    "    ivec3 cell = ivec3(gl_FragCoord.xy, scatteri_at.x);\n"
    "    float step_z = scatteri_cell_size().z;\n"
    "    for (int i = 0; i < SCATTERI_COUNT; i++) {\n"
    "        vec4 g = scatteri_gauss_place(i);\n"
    "        vec4 c = scatteri_gauss_weight(i);\n"
    "        vec3 d = scatteri_cell_centre(cell, g.xyz);\n"
    "        float last = d.z + float(SCATTERI_SLICES - 1) * step_z;\n"
    "        if (max(max(abs(d.x), abs(d.y)), max(d.z, -last)) > c.w)\n"
    "            continue;\n"
    "        float density = c.x * exp(-g.w * g.w * dot(d.xy, d.xy));\n"
    "        for (int s = 0; s < SCATTERI_SLICES; s++) {\n"
    "            float z = d.z + float(s) * step_z;\n"
    "            if (abs(z) <= c.w)\n"
    "                values[s].x += density * exp(-g.w * g.w * z * z);\n"
    "        }\n"
    "    }\n"
    "}\n"
    "#endif\n"
    "void main() {\n"
    "    vec4 values[SCATTERI_SLICES];\n"
    "    for (int s = 0; s < SCATTERI_SLICES; s++) {\n"
    "        values[s] = vec4(0.0);\n"
    "#ifdef SCATTERI_FIELD\n"
    "        ivec3 cell = ivec3(gl_FragCoord.xy, scatteri_at.x + s);\n"
    "        values[s].x = scatteri_field_density(scatteri_cell_centre(cell, vec3(0.0)));\n"
    "#endif\n"
    "    }\n"
    "#ifdef SCATTERI_GAUSSIANS\n"
    "    scatteri_gather(values);\n"
    "#endif\n"
    "    scatteri_write(values);\n"
    "}\n";

/* A quad for each Gaussian around its support in the layers; nothing where it does not reach them. */
static const char scatteri_gl_splat_quad[] =
    "uniform ivec4 scatteri_at;\n"
    "flat out vec4 scatteri_place;\n"
    "flat out vec4 scatteri_weight_of;\n"
    "void main() {\n"
    "    vec4 g = scatteri_gauss_place(gl_InstanceID);\n"
    "    vec4 c = scatteri_gauss_weight(gl_InstanceID);\n"
    "    vec2 corner = vec2(float(gl_VertexID & 1), float(gl_VertexID >> 1)) * 2.0 - 1.0;\n"
    "    vec3 first = scatteri_cell_centre(ivec3(0, 0, scatteri_at.x), g.xyz);\n"
    "    float last = first.z + float(SCATTERI_SLICES - 1) * scatteri_cell_size().z;\n"
    "    vec2 size = scatteri_local_max.xy - scatteri_local_min.xy;\n"
    "    vec2 at = (g.xy + corner * c.w - scatteri_local_min.xy) / size * 2.0 - 1.0;\n"
    "    bool reaches = first.z <= c.w && last >= -c.w;\n"
    "    gl_Position = reaches ? vec4(at, 0.0, 1.0) : vec4(2.0, 2.0, 2.0, 1.0);\n"
    "    scatteri_place = g;\n"
    "    scatteri_weight_of = c;\n"
    "}\n";

static const char scatteri_gl_splat[] =
    "flat in vec4 scatteri_place;\n"
    "flat in vec4 scatteri_weight_of;\n"
    "void main() {\n"
    "    vec4 values[SCATTERI_SLICES];\n"
    "    float narrow = scatteri_place.w * scatteri_place.w;\n"
    "    float step_z = scatteri_cell_size().z;\n"
    "    ivec3 cell = ivec3(gl_FragCoord.xy, scatteri_at.x);\n"
    "    vec3 d = scatteri_cell_centre(cell, scatteri_place.xyz);\n"
    "    float density = scatteri_weight_of.x * exp(-narrow * dot(d.xy, d.xy));\n"
    "    for (int s = 0; s < SCATTERI_SLICES; s++) {\n"
    "        float z = d.z + float(s) * step_z;\n"
    "        float value = abs(z) <= scatteri_weight_of.w ? density * exp(-narrow * z * z) : 0.0;\n"
    "        values[s] = vec4(value, 0.0, 0.0, 0.0);\n"
    "    }\n"
    "    scatteri_write(values);\n"
    "}\n";

/* Where a source of the batch is seen from x: unit vector towards it, and its distance. */
static const char scatteri_gl_facing[] =
    "vec4 scatteri_face(int channel, vec3 x) {\n"
    "    if (scatteri_light[channel].w > 1.5)\n"
    "        return vec4(-scatteri_direction[channel].xyz, SCATTERI_FAR);\n"
    "    vec3 to = scatteri_light[channel].xyz - x;\n"
    "    float square = dot(to, to);\n"
    "    float inverse = square > 1e-37 ? inversesqrt(square) : 0.0;\n"
    "    return vec4(to * inverse, square * inverse);\n"
    "}\n";

/* Mean density towards local sources, depth of directional ones, in closed form. */
static const char scatteri_gl_closed[] =
    "vec4 scatteri_closed_values(vec3 x) {\n"
    "    int sources = int(scatteri_batch.x);\n"
    "    vec4 to[4];\n"
    "    float segment[4];\n"
    "    vec4 depth = vec4(0.0);\n"
    "    for (int l = 0; l < 4; l++) {\n"
    "        to[l] = scatteri_face(l, x);\n"
    "        segment[l] = scatteri_segment_to(x, to[l].xyz, to[l].w);\n"
    "    }\n"
    "    for (int i = 0; i < SCATTERI_COUNT; i++) {\n"
    "        vec4 g = scatteri_gauss_place(i);\n"
    "        vec4 c = scatteri_gauss_weight(i);\n"
    "        for (int l = 0; l < 4; l++)\n"
    "            if (l < sources)\n"
    "                depth[l] += scatteri_gauss_depth_to(g, c, x, to[l].xyz, segment[l]);\n"
    "    }\n"
    "    for (int l = 0; l < 4; l++) {\n"
    "        float r = scatteri_light[l].w > 1.5 ? 1.0 : to[l].w;\n"
    "        depth[l] = r > 0.0 ? max(depth[l], 0.0) / r : scatteri_cone[l].z;\n"
    "    }\n"
    "    return depth;\n"
    "}\n"
    "void main() {\n"
    "    vec4 values[SCATTERI_SLICES];\n"
    "    for (int s = 0; s < SCATTERI_SLICES; s++) {\n"
    "        ivec3 cell = ivec3(gl_FragCoord.xy, scatteri_at.x + s);\n"
    "        values[s] = scatteri_closed_values(scatteri_cell_centre(cell, vec3(0.0)));\n"
    "    }\n"
    "    scatteri_write(values);\n"
    "}\n";

/* Columns of shells around each source of the batch. */
static const char scatteri_gl_columns[] =
    "#ifdef SCATTERI_FIELD\n"
    "#define SCATTERI_FIRST 1\n"
    "layout(location = 0) out vec4 scatteri_running;\n"
    "uniform highp sampler2D scatteri_before;\n"
    "#endif\n"
    "struct scatteri_column {\n"
    "    vec3 o, d;\n"      /* points o + t d */
    "    float start, step_t;\n" /* t of the first shell, of a step */
    "    vec2 t;\n"         /* what lies inside the bounds */
    "};\n"
    "scatteri_column scatteri_column_at(int channel, vec2 at) {\n"
    "    vec4 u = scatteri_axis_u[channel];\n"
    "    vec4 v = scatteri_axis_v[channel];\n"
    "    vec4 w = scatteri_axis_w[channel];\n"
    "    vec4 per = scatteri_polar[channel];\n"
    "    bool parallel = scatteri_polar_size[channel].w > 0.5;\n"
    "    vec2 p = vec2(u.w, v.w) + at / per.xy;\n"
    "    vec3 q = scatteri_oct_decode(clamp(p, -1.0, 1.0));\n"
    "    vec3 fan = u.xyz * q.x + v.xyz * q.y + w.xyz * q.z;\n"
    "    vec3 side = u.xyz * p.x + v.xyz * p.y + w.xyz * w.w;\n"
    "    scatteri_column c;\n"
    "    c.o = parallel ? side : scatteri_light[channel].xyz;\n"
    "    c.d = parallel ? w.xyz : fan;\n"
    "    c.start = parallel ? 0.0 : w.w;\n"
    "    c.step_t = 1.0 / per.z;\n"
    "    c.t = c.start + vec2(0.0, per.w - w.w);\n"
    "#ifdef SCATTERI_BOUNDED\n"
    /* Columns along the face on which the source lies go on outside, as on the CPU. */
    "    bool touches = !parallel && w.w * per.z <= 0.1;\n"
    "    vec2 cut = scatteri_clip_box(scatteri_bounds_min.xyz, scatteri_bounds_max.xyz, c.o, c.d,\n"
    "                                 c.t);\n"
    "    c.t = cut.x < cut.y ? cut : touches ? c.t : c.t.xx;\n"
    "#endif\n"
    "    return c;\n"
    "}\n"
    "float scatteri_shell_at(scatteri_column c, int shell) {\n"
    "    return clamp(c.start + float(shell) * c.step_t, c.t.x, c.t.y);\n"
    "}\n";

static const char scatteri_gl_sums[] =
    "#ifdef SCATTERI_GAUSSIANS\n"
    "float scatteri_quick_erf(float x) {\n"
    "    float y = clamp(x, -3.6, 3.6);\n"
    "    return scatteri_erf_over(y, y * y) / scatteri_erf_under(y * y);\n"
    "}\n"
    /* Thick Gaussians by the form that keeps its digits in the tails. */
    "float scatteri_thick_span(float a, float m, float from, float t) {\n"
    "    return scatteri_erf_span(max(a * (from - m), -1e6), min(a * (t - m), 1e6),\n"
    "                             min(0.5 * a * (t - from), 1e6));\n"
    "}\n"
    "void scatteri_sum_gaussians(scatteri_column c, float t[SCATTERI_SLICES],\n"
    "                            inout float depth[SCATTERI_SLICES]) {\n"
    "    for (int i = 0; i < SCATTERI_COUNT; i++) {\n"
    "        vec4 g = scatteri_gauss_place(i);\n"
    "        vec4 k = scatteri_gauss_weight(i);\n"
    "        vec3 off = g.xyz - c.o;\n"
    "        float m = dot(off, c.d);\n"
    "        vec3 across = off - m * c.d;\n"
    "        float fade = g.w * g.w * dot(across, across);\n"
    "        if (fade >= k.y || t[SCATTERI_SLICES - 1] < m - k.w)\n"
    "            continue;\n"
    "        float whole = k.z * exp(-fade);\n"
    "        bool thick = scatteri_extinction.w * k.z >= " SCATTERI_GL_TEXT(SCATTERI_QUICK) ";\n"
    "        float begun = scatteri_quick_erf(g.w * (c.t.x - m));\n"
    "        for (int s = 0; s < SCATTERI_SLICES; s++)\n"
    "            depth[s] += whole * (thick ? scatteri_thick_span(g.w, m, c.t.x, t[s])\n"
    "                                       : scatteri_quick_erf(g.w * (t[s] - m)) - begun);\n"
    "    }\n"
    "}\n"
    "#endif\n"
    "#ifdef SCATTERI_FIELD\n"
    /* What the field adds between two shells, sampled about once a voxel. */
    "float scatteri_sum_field(scatteri_column c, float from, float to) {\n"
    "    vec3 voxels = vec3(textureSize(scatteri_field, 0)) * scatteri_field_per.xyz * abs(c.d);\n"
    "    int samples = int(clamp(0.75 * scatteri_most3(voxels) * c.step_t, 0.0, 1e4)) + 1;\n"
    "    float part = (to - from) / float(samples);\n"
    "    float sum = 0.0;\n"
    "    for (int s = 0; s < samples && part > 0.0; s++)\n"
    "        sum += scatteri_field_density(c.o + (from + (float(s) + 0.5) * part) * c.d);\n"
    "    return sum * part;\n"
    "}\n"
    "#endif\n";

static const char scatteri_gl_polar[] =
    "void scatteri_fill_column(int channel, inout vec4 running, inout vec4 values[SCATTERI_SLICES]) {\n"
    "    scatteri_column c = scatteri_column_at(channel, floor(gl_FragCoord.xy));\n"
    "    bool parallel = scatteri_polar_size[channel].w > 0.5;\n"
    "    float t[SCATTERI_SLICES];\n"
    "    float depth[SCATTERI_SLICES];\n"
    "    for (int s = 0; s < SCATTERI_SLICES; s++) {\n"
    "        t[s] = scatteri_shell_at(c, scatteri_at.x + s);\n"
    "        depth[s] = 0.0;\n"
    "    }\n"
    "#ifdef SCATTERI_GAUSSIANS\n"
    "    scatteri_sum_gaussians(c, t, depth);\n"
    "#endif\n"
    "#ifdef SCATTERI_FIELD\n"
    "    float before = scatteri_at.x > 0 ? scatteri_shell_at(c, scatteri_at.x - 1) : c.t.x;\n"
    "    for (int s = 0; s < SCATTERI_SLICES; s++) {\n"
    "        running[channel] += scatteri_sum_field(c, before, t[s]);\n"
    "        before = t[s];\n"
    "        depth[s] += running[channel];\n"
    "    }\n"
    "#endif\n"
    "    for (int s = 0; s < SCATTERI_SLICES; s++) {\n"
    "        float r = c.start + float(scatteri_at.x + s) * c.step_t;\n"
    "        float value = max(depth[s], 0.0) / (parallel ? 1.0 : r > 0.0 ? r : SCATTERI_FAR);\n"
    "        bool at_source = !parallel && !(c.start > 0.0) && scatteri_at.x + s == 0;\n"
    "        values[s][channel] = at_source ? scatteri_cone[channel].z : value;\n"
    "    }\n"
    "}\n"
    "void main() {\n"
    "    vec4 values[SCATTERI_SLICES];\n"
    "    vec4 running = vec4(0.0);\n"
    "    for (int s = 0; s < SCATTERI_SLICES; s++)\n"
    "        values[s] = vec4(0.0);\n"
    "#ifdef SCATTERI_FIELD\n"
    "    if (scatteri_at.x > 0)\n"
    "        running = texelFetch(scatteri_before, ivec2(gl_FragCoord.xy), 0);\n"
    "#endif\n"
    "    for (int channel = 0; channel < 4; channel++)\n"
    "        if (channel < int(scatteri_batch.x))\n"
    "            scatteri_fill_column(channel, running, values);\n"
    "#ifdef SCATTERI_FIELD\n"
    "    scatteri_running = running;\n"
    "#endif\n"
    "    scatteri_write(values);\n"
    "}\n";

/* The wavefront. Wave s of a source is the cells s steps away from the nearest one, the anchor. It is stored as seen along
   z: a square tile of the cells above the anchor and one of those below it, of which some are none. Waves alternate
   between two pictures, so that what one reads and what it writes are never in the same. */
static const char scatteri_gl_waves[] =
    "uniform highp sampler2D scatteri_before;\n"
    "ivec2 scatteri_tile_of(int wave, int side) {\n"
    "    int n = int(scatteri_local_min.w);\n"
    "    int tiles = textureSize(scatteri_before, 0).x / n;\n"
    "    int tile = (wave >> 1) * 2 + side;\n"
    "    return ivec2(tile % tiles, tile / tiles) * n;\n"
    "}\n"
    "int scatteri_wave_of(int channel, ivec3 cell) {\n"
    "    ivec3 steps = abs(cell - ivec3(scatteri_anchor[channel].xyz));\n"
    "    return steps.x + steps.y + steps.z;\n"
    "}\n"
    "ivec2 scatteri_texel_of(int channel, ivec3 cell) {\n"
    "    int side = cell.z < int(scatteri_anchor[channel].z) ? 1 : 0;\n"
    "    return scatteri_tile_of(scatteri_wave_of(channel, cell), side) + cell.xy;\n"
    "}\n";

/* Quads over the tiles of wave scatteri_at.y of source scatteri_at.x. */
static const char scatteri_gl_wave_quad[] =
    "uniform ivec4 scatteri_at;\n"
    "flat out int scatteri_side;\n"
    "void main() {\n"
    "    ivec2 anchor = ivec2(scatteri_anchor[scatteri_at.x].xy);\n"
    "    ivec2 low = max(anchor - scatteri_at.y, 0);\n"
    "    ivec2 high = min(anchor + scatteri_at.y, int(scatteri_local_min.w) - 1) + 1;\n"
    "    vec2 corner = vec2(float(gl_VertexID & 1), float(gl_VertexID >> 1));\n"
    "    vec2 tile = vec2(scatteri_tile_of(scatteri_at.y, gl_InstanceID));\n"
    "    vec2 at = (tile + mix(vec2(low), vec2(high), corner)) / vec2(textureSize(scatteri_before, 0));\n"
    "    gl_Position = vec4(at * 2.0 - 1.0, 0.0, 1.0);\n"
    "    scatteri_side = gl_InstanceID;\n"
    "}\n";

/* First-order upwind differences of u . grad tau = D, see scatteri_upwind. */
static const char scatteri_gl_wave[] =
    "uniform ivec4 scatteri_at;\n"
    "uniform highp sampler3D scatteri_field;\n"
    "flat in int scatteri_side;\n"
    "out vec4 scatteri_value;\n"
    "float scatteri_depth_of(int channel, ivec3 cell) {\n"
    "    int n = int(scatteri_local_min.w);\n"
    "    if (any(lessThan(cell, ivec3(0))) || any(greaterThanEqual(cell, ivec3(n))))\n"
    "        return 0.0;\n"
    "    float value = texelFetch(scatteri_before, scatteri_texel_of(channel, cell), 0)[channel];\n"
    "    if (scatteri_light[channel].w > 1.5)\n"
    "        return value;\n"
    "    return value * length(scatteri_cell_centre(cell, scatteri_light[channel].xyz));\n"
    "}\n"
    "float scatteri_upwind_value(int channel, ivec3 cell) {\n"
    "    vec4 anchor = scatteri_anchor[channel];\n"
    "    bool parallel = scatteri_light[channel].w > 1.5;\n"
    "    vec3 size = scatteri_cell_size();\n"
    "    vec3 away = scatteri_cell_centre(cell, scatteri_light[channel].xyz);\n"
    "    float r = parallel ? 1.0 : length(away);\n"
    "    vec3 u = parallel ? scatteri_direction[channel].xyz : away / max(r, 1e-30);\n"
    "    float density = texelFetch(scatteri_field, cell, 0).x;\n"
    "    float sum = density;\n"
    "    float weights = 0.0;\n"
    "    for (int axis = 0; axis < 3; axis++) {\n"
    "        bool nearest = (int(anchor.w) >> axis & 1) == 1 && float(cell[axis]) == anchor[axis];\n"
    "        if (nearest || u[axis] == 0.0)\n"
    "            continue;\n"
    "        ivec3 from = cell;\n"
    "        from[axis] += u[axis] > 0.0 ? -1 : 1;\n"
    "        float weight = abs(u[axis]) / size[axis];\n"
    "        weights += weight;\n"
    "        sum += weight * scatteri_depth_of(channel, from);\n"
    "    }\n"
    "    float depth = weights > 0.0 ? sum / weights : sum * r;\n"
    "    return parallel ? depth : r > 0.0 ? depth / r : density;\n"
    "}\n"
    "void main() {\n"
    "    ivec3 anchor = ivec3(scatteri_anchor[scatteri_at.x].xyz);\n"
    "    ivec2 xy = ivec2(gl_FragCoord.xy) - scatteri_tile_of(scatteri_at.y, scatteri_side);\n"
    "    int rest = scatteri_at.y - abs(xy.x - anchor.x) - abs(xy.y - anchor.y);\n"
    "    ivec3 cell = ivec3(xy, scatteri_side == 0 ? anchor.z + rest : anchor.z - rest);\n"
    "    if (rest < scatteri_side || cell.z < 0 || cell.z >= int(scatteri_local_min.w))\n"
    "        discard;\n"
    "    scatteri_value = vec4(scatteri_upwind_value(scatteri_at.x, cell));\n"
    "}\n";

/* Each source's cells from the picture of their wave. */
static const char scatteri_gl_merge[] =
    "uniform highp sampler2D scatteri_before_too;\n"
    "void main() {\n"
    "    vec4 values[SCATTERI_SLICES];\n"
    "    for (int s = 0; s < SCATTERI_SLICES; s++) {\n"
    "        ivec3 cell = ivec3(gl_FragCoord.xy, scatteri_at.x + s);\n"
    "        values[s] = vec4(0.0);\n"
    "        for (int channel = 0; channel < int(scatteri_batch.x); channel++) {\n"
    "            ivec2 texel = scatteri_texel_of(channel, cell);\n"
    "            bool even = (scatteri_wave_of(channel, cell) & 1) == 0;\n"
    "            values[s][channel] = even ? texelFetch(scatteri_before, texel, 0)[channel]\n"
    "                                      : texelFetch(scatteri_before_too, texel, 0)[channel];\n"
    "        }\n"
    "    }\n"
    "    scatteri_write(values);\n"
    "}\n";

/* --- distance to voxels that hold something ---
   Trilinear density is 0 but in the boxes between the neighbours of voxels that hold something. The squared distance to
   these boxes is a sum over the axes, so its least value is found along one axis after the other, exactly: each pass
   looks along its axis until no farther place can be nearer. Distances above SCATTERI_REACH end there. Flooding by jumps would be no use: its errors make
   distances too large. */
static const char scatteri_gl_nearest[] =
    "uniform highp sampler3D scatteri_volume;\n"
    /* Longer distances are stored as this many voxels: that bounds the search, and is a long jump still. */
    "const float SCATTERI_REACH = 32.0;\n"
    /* The distance, squared, by what the passes before have found. */
    "float scatteri_known(ivec3 p) {\n"
    "#ifdef SCATTERI_FIELD\n"
    "    return texelFetch(scatteri_field, p, 0).x > 0.0 ? 0.0 : SCATTERI_REACH * SCATTERI_REACH;\n"
    "#else\n"
    "    return texelFetch(scatteri_volume, p, 0).x;\n"
    "#endif\n"
    "}\n"
    /* Edges of a voxel in the unit of the distances, the longest of them. */
    "vec3 scatteri_edges(vec3 size) {\n"
    "    return 1.0 / (scatteri_field_per.xyz * scatteri_field_per.w * size);\n"
    "}\n"
    /* The least along an axis. A box reaches as far as the neighbours' centres: the first voxel costs nothing. */
    "float scatteri_nearest(ivec3 p, ivec3 axis, int size, float edge) {\n"
    "    int i = p.x * axis.x + p.y * axis.y + p.z * axis.z;\n"
    "    float least = scatteri_known(p);\n"
    "    for (int s = 1; s < size; s++) {\n"
    "        float off = edge * float(s - 1);\n"
    "        off *= off;\n"
    "        if (off >= least)\n"
    "            break;\n"
    "        if (s <= i)\n"
    "            least = min(least, off + scatteri_known(p - s * axis));\n"
    "        if (i + s < size)\n"
    "            least = min(least, off + scatteri_known(p + s * axis));\n"
    "    }\n"
    "    return least;\n"
    "}\n";

/* Along x in the field (scatteri_at.x: the first layer), or along y in what that gave. */
static const char scatteri_gl_distance[] =
    "void main() {\n"
    "    vec4 values[SCATTERI_SLICES];\n"
    "#ifdef SCATTERI_FIELD\n"
    "    ivec3 size = textureSize(scatteri_field, 0), axis = ivec3(1, 0, 0);\n"
    "#else\n"
    "    ivec3 size = textureSize(scatteri_volume, 0), axis = ivec3(0, 1, 0);\n"
    "#endif\n"
    "    vec3 edges = scatteri_edges(vec3(size));\n"
    "    for (int s = 0; s < SCATTERI_SLICES; s++) {\n"
    "        ivec3 p = ivec3(gl_FragCoord.xy, min(scatteri_at.x + s, size.z - 1));\n"
    "        float least = axis.x > 0 ? scatteri_nearest(p, axis, size.x, edges.x)\n"
    "                                 : scatteri_nearest(p, axis, size.y, edges.y);\n"
    "        values[s] = vec4(least);\n"
    "    }\n"
    "    scatteri_write(values);\n"
    "}\n";

/* Along z; density, and what is stored of the distance d: read between voxels, sqrt(d^2 - |edges|^2/4) is nowhere
   above the distance there (proof: scatter.h, "distance map"; edges of axes with one voxel do not count). Rounded down where 16 bits hold it (scatteri_at.y). */
static const char scatteri_gl_spaced[] =
    "uniform highp sampler3D scatteri_field;\n"
    "void main() {\n"
    "    vec4 values[SCATTERI_SLICES];\n"
    "    ivec3 size = textureSize(scatteri_field, 0);\n"
    "    vec3 edges = scatteri_edges(vec3(size));\n"
    "    vec3 between = edges * vec3(greaterThan(size, ivec3(1)));\n"
    "    for (int s = 0; s < SCATTERI_SLICES; s++) {\n"
    "        ivec3 p = ivec3(gl_FragCoord.xy, min(scatteri_at.x + s, size.z - 1));\n"
    "        float least = scatteri_nearest(p, ivec3(0, 0, 1), size.z, edges.z);\n"
    "        float room = sqrt(max(least - 0.25 * dot(between, between), 0.0));\n"
    "        room *= scatteri_at.y > 0 ? 1.0 - 1.0 / 1024.0 : 1.0;\n"
    "        values[s] = vec4(texelFetch(scatteri_field, p, 0).x, room, 0.0, 0.0);\n"
    "    }\n"
    "    scatteri_write(values);\n"
    "}\n";

/* --- the eye ray --- */

/* The pass of the mask: there is a field, and pixels of our own texture are those of the picture. */
static const char scatteri_gl_masking[] = "#define SCATTERI_FIELD\n"
                                          "#define SCATTERI_CORNER vec2(0.0)\n";

/* The ray of a pixel and where the host's surface ends it. */
static const char scatteri_gl_camera[] =
    "uniform highp sampler2D scatteri_scene;\n"
    "/* A ray, or what is left of it: depth counts from t0. */\n"
    "vec3 scatteri_o, scatteri_d;\n"
    "float scatteri_t0, scatteri_t1;\n"
    "#ifndef SCATTERI_CORNER\n"
    "#define SCATTERI_CORNER scatteri_window.xy\n"
    "#endif\n"
    "/* Pixels of the picture, perhaps reduced, from its corner to the middle of this fragment. */\n"
    "vec2 scatteri_fragment() {\n"
    "    return scatteri_picture.y > 1.0 ? gl_FragCoord.xy : gl_FragCoord.xy - SCATTERI_CORNER;\n"
    "}\n"
    "/* Pixels from the corner of the picture to the middle of the one that this fragment stands for. */\n"
    "vec2 scatteri_pixel() {\n"
    "    float divide = scatteri_picture.y;\n"
    "    vec2 first = floor(gl_FragCoord.xy) * divide + floor(0.5 * divide) + 0.5;\n"
    "    return divide > 1.0 ? min(first, 2.0 / scatteri_window.zw - 0.5) : scatteri_fragment();\n"
    "}\n"
    "/* Where the host's surface ends the ray through clip coordinates c; far away for sky and NaN. */\n"
    "float scatteri_surface(vec2 pixel, vec2 c, float size) {\n"
    "    float depth = scatteri_picture.x;\n"
    "    if (scatteri_picture.z > 0.5)\n"
    "        depth = texelFetch(scatteri_scene, ivec2(pixel + scatteri_window.xy), 0).x;\n"
    "    float z = scatteri_range.z * depth + scatteri_range.w;\n"
    "    float w = dot(scatteri_weight, vec4(c, z, 1.0));\n"
    "    float t = (scatteri_range.x * z + scatteri_range.y) * size / w;\n"
    "    bool some = depth >= 0.0 && depth <= 1.0 && depth != scatteri_picture.x;\n"
    "    return some && w > 0.0 && t >= 0.0 ? min(t, SCATTERI_FAR) : SCATTERI_FAR;\n"
    "}\n"
    "void scatteri_clip(vec3 low, vec3 high) {\n"
    "    vec2 t = scatteri_clip_box(low, high, scatteri_o, scatteri_d, vec2(scatteri_t0, scatteri_t1));\n"
    "    scatteri_t0 = t.x < t.y ? t.x : 0.0;\n"
    "    scatteri_t1 = t.x < t.y ? t.y : 0.0;\n"
    "}\n"
    "vec3 scatteri_direction_at(vec2 c) {\n"
    "    return scatteri_forward.xyz + c.x * scatteri_forward_dx.xyz + c.y * scatteri_forward_dy.xyz;\n"
    "}\n"
    "void scatteri_begin_ray(vec2 pixel) {\n"
    "    vec2 c = pixel * scatteri_window.zw - 1.0;\n"
    "    vec3 d = scatteri_direction_at(c);\n"
    "    float size = length(d);\n"
    "    scatteri_o = scatteri_eye.xyz + c.x * scatteri_eye_dx.xyz + c.y * scatteri_eye_dy.xyz;\n"
    "    scatteri_d = d / size;\n"
    "    scatteri_t0 = 0.0;\n"
    "    scatteri_t1 = scatteri_surface(pixel, c, size);\n"
    "}\n";

/* Gaussians on the eye ray. */
static const char scatteri_gl_eye[] =
    "float scatteri_from, scatteri_to;                 /* Gaussians reach the ray in between */\n"
    "float scatteri_features;                          /* most features a metre of them */\n"
    "float scatteri_start;                             /* their depth before t0 */\n"
    "float scatteri_in, scatteri_out, scatteri_voxel;  /* the field: ends, metres a voxel */\n"
    "float scatteri_run;                               /* its depth so far */\n"
    "#ifdef SCATTERI_GAUSSIANS\n"
    "/* Density of Gaussian i at t, its depth from far before up to t. One exponential serves both. */\n"
    "vec2 scatteri_gaussian_at(int i, float t) {\n"
    "    vec4 g = scatteri_gauss_place(i), h = scatteri_gauss_weight(i);\n"
    "    vec3 p = g.xyz - scatteri_o;\n"
    "    float m = dot(p, scatteri_d), x = g.w * (t - m);\n"
    "    vec3 q = p - m * scatteri_d;\n"
    "    float fade = g.w * g.w * dot(q, q), e = exp(-fade - x * x);\n"
    "    float part = h.z * scatteri_erfcx(min(abs(x), 1.0e15)) * e;\n"
    "    return vec2(h.x * e, x < 0.0 ? part : 2.0 * h.z * exp(-fade) - part);\n"
    "}\n"
    "#ifndef SCATTERI_FEW_THIN\n"
    "int scatteri_list[96]; /* of many Gaussians those that reach the ray, if they fit; else all */\n"
    "int scatteri_listed;\n"
    "int scatteri_on_ray() {\n"
    "    return scatteri_listed <= 96 ? scatteri_listed : int(scatteri_counts.x);\n"
    "}\n"
    "int scatteri_which(int i) {\n"
    "    return scatteri_listed <= 96 ? scatteri_list[i] : i;\n"
    "}\n"
    "void scatteri_put_on_list(int i) {\n"
    "    if (scatteri_listed < 96)\n"
    "        scatteri_list[scatteri_listed] = i;\n"
    "    scatteri_listed++;\n"
    "}\n"
    "#else\n"
    "int scatteri_on_ray() {\n"
    "    return SCATTERI_COUNT;\n"
    "}\n"
    "int scatteri_which(int i) {\n"
    "    return i;\n"
    "}\n"
    "#endif\n"
    "vec2 scatteri_gaussians_at(float t) {\n"
    "    vec2 sum = vec2(0.0);\n"
    "    for (int i = 0; i < scatteri_on_ray(); i++)\n"
    "        sum += scatteri_gaussian_at(scatteri_which(i), t);\n"
    "    return sum;\n"
    "}\n"
    "void scatteri_find_hull() {\n"
    "#ifndef SCATTERI_FEW_THIN\n"
    "    scatteri_listed = 0;\n"
    "#endif\n"
    "    for (int i = 0; i < SCATTERI_COUNT; i++) {\n"
    "        vec4 g = scatteri_gauss_place(i), h = scatteri_gauss_weight(i);\n"
    "        vec3 p = g.xyz - scatteri_o;\n"
    "        float m = dot(p, scatteri_d), past = max(max(scatteri_t0 - m, m - scatteri_t1), 0.0);\n"
    "        vec3 q = p - m * scatteri_d;\n"
    "        float fade = g.w * g.w * dot(q, q), reach = h.y - scatteri_trim.x - fade;\n"
    "        if (!(g.w * g.w * past * past < h.y - scatteri_trim.y - fade))\n"
    "            continue;\n"
    "#ifndef SCATTERI_FEW_THIN\n"
    "        scatteri_put_on_list(i);\n"
    "#endif\n"
    "        if (!(reach > 0.0))\n"
    "            continue;\n"
    "        float half_way = sqrt(reach) / g.w;\n"
    "        float whole = 2.0 * h.z * exp(-fade);\n"
    "        scatteri_from = min(scatteri_from, m - half_way);\n"
    "        scatteri_to = max(scatteri_to, m + half_way);\n"
    "        scatteri_features = max(\n"
    "            scatteri_features, g.w * (1.0 + 0.2 * log(1.0 + scatteri_extinction.w * whole)));\n"
    "    }\n"
    "}\n"
    "#endif\n";

/* What the mask tells about the eye ray. */
static const char scatteri_gl_masked[] =
    "#ifdef SCATTERI_MASK\n"
    "uniform highp usampler2D scatteri_before;\n"
    "vec2 scatteri_full; /* where the field begins and ends on the ray; below 0: nowhere */\n"
    "void scatteri_read_mask() {\n"
    "    scatteri_full = uintBitsToFloat(texelFetch(scatteri_before, ivec2(scatteri_fragment()), 0).xy);\n"
    "#ifdef SCATTERI_VOXELS_ONLY\n"
    "    scatteri_t1 = scatteri_full.x < 0.0 ? scatteri_t0 : scatteri_t1;\n"
    "#endif\n"
    "}\n"
    "#endif\n"
    "bool scatteri_is_full(float t) {\n"
    "#ifdef SCATTERI_MASK\n"
    "    return t >= scatteri_full.x && t <= scatteri_full.y;\n"
    "#else\n"
    "    return true;\n"
    "#endif\n"
    "}\n"
    "/* Of so many steps of h metres those that may meet the field: the first, and the one behind the last. */\n"
    "ivec2 scatteri_full_steps(float from, float h, int steps) {\n"
    "#ifdef SCATTERI_MASK\n"
    "    vec2 at = (scatteri_full - from) / max(h, 1.0e-30);\n"
    "    vec2 ends = clamp(vec2(floor(at.x - 0.5), ceil(at.y + 0.5)), 0.0, float(steps));\n"
    "    return ivec2(ends);\n"
    "#else\n"
    "    return ivec2(0, steps);\n"
    "#endif\n"
    "}\n";

/* The mask: the first and the last place on the ray where the field is not 0, as bits, since every version can draw
   integers. */
static const char scatteri_gl_mask[] =
    "out highp uvec2 scatteri_marks;\n"
    "/* Metres from x along d without density, at most `far`: cell by cell between the voxels' centres. Where a cell's\n"
    "   middle has none, it has none. */\n"
    "float scatteri_empty(vec3 x, vec3 d, float far) {\n"
    "    vec3 per = scatteri_field_per.xyz * vec3(textureSize(scatteri_field, 0));\n"
    "    vec3 rate = scatteri_not_zero3(d * per), way = sign(rate);\n"
    "    vec3 g = (x - scatteri_field_min.xyz) * per - 0.5;\n"
    "    float t = 0.0;\n"
    "    for (int guard = 0; guard < 16384 && t < far; guard++) {\n"
    "        vec3 faces = way * floor(way * (g + t * rate)) + way;\n"
    "        faces += way * vec3(lessThanEqual((faces - g) / rate, vec3(t)));\n"
    "        float next = min(scatteri_least3((faces - g) / rate), far), middle = 0.5 * (t + next);\n"
    "        vec2 field = scatteri_field_at(x + middle * d);\n"
    "        if (field.x > 0.0)\n"
    "            break;\n"
    "        t = max(next, middle + field.y);\n"
    "    }\n"
    "    return t;\n"
    "}\n"
    "void main() {\n"
    "    scatteri_begin_ray(scatteri_pixel());\n"
    "    scatteri_find_ends();\n"
    "    float size = scatteri_out - scatteri_in, grain = 1.0e-3 * scatteri_voxel + 1.0e-6 * scatteri_out;\n"
    "    float before = scatteri_empty(scatteri_o + scatteri_in * scatteri_d, scatteri_d, size);\n"
    "    vec2 marks = vec2(-1.0);\n"
    "    if (before < size) {\n"
    "        float behind = scatteri_empty(scatteri_o + scatteri_out * scatteri_d, -scatteri_d, size);\n"
    "        marks = vec2(max(scatteri_in + before - grain, 0.0), scatteri_out - behind + grain);\n"
    "    }\n"
    "    scatteri_marks = floatBitsToUint(marks);\n"
    "}\n";

/* Where the medium begins and ends on the eye ray. */
static const char scatteri_gl_ends[] =
    "#ifdef SCATTERI_FOG\n"
    "/* How far fog is followed: to where it is opaque, thinned out, or at the horizon. */\n"
    "float scatteri_horizon(vec3 x, float end) {\n"
    "    float far = min(end, 1.0e6), scale = 0.0, sigma = scatteri_albedo.w;\n"
    "    float low = 1.0e-9 * far;\n"
    "    for (int i = 0; i < int(scatteri_counts.y); i++)\n"
    "        scale = max(scale, scatteri_heights[i].z);\n"
    "    if (scatteri_d.y > 0.0 && !(scatteri_emission.w > 0.0))\n"
    "        far = min(far, 16.0 * scale / scatteri_d.y);\n"
    "    if (!(sigma * scatteri_fog_depth(x, scatteri_d, far) > SCATTERI_OPAQUE))\n"
    "        return far;\n"
    "    for (int i = 0; i < 14; i++) {\n"
    "        float middle = sqrt(low) * sqrt(far);\n"
    "        if (sigma * scatteri_fog_depth(x, scatteri_d, middle) > SCATTERI_OPAQUE)\n"
    "            far = middle;\n"
    "        else\n"
    "            low = middle;\n"
    "    }\n"
    "    return far;\n"
    "}\n"
    "#endif\n"
    "#ifdef SCATTERI_FIELD\n"
    "/* Where the field begins and ends on the ray. */\n"
    "void scatteri_find_field() {\n"
    "    vec2 t = scatteri_clip_box(scatteri_field_min.xyz, scatteri_field_max.xyz, scatteri_o, scatteri_d,\n"
    "                               vec2(scatteri_t0, scatteri_t1));\n"
    "    vec3 rate = abs(scatteri_d) * scatteri_field_per.xyz * vec3(textureSize(scatteri_field, 0));\n"
    "    scatteri_in = t.x;\n"
    "    scatteri_out = t.y;\n"
    "    scatteri_voxel = 1.0 / max(scatteri_most3(rate), 1.0e-30);\n"
    "    if (!(scatteri_in < scatteri_out))\n"
    "        scatteri_in = scatteri_out = scatteri_t0;\n"
    "}\n"
    "/* Depth of the whole field on the ray: as many steps as the quadrature takes there. */\n"
    "float scatteri_whole_field() {\n"
    "    float voxels = (scatteri_out - scatteri_in) / scatteri_voxel, sum = 0.0;\n"
    "    int steps = int(min(voxels * scatteri_nodes.x / SCATTERI_VOXELS, 767.0)) + 1;\n"
    "    float h = (scatteri_out - scatteri_in) / float(steps);\n"
    "    ivec2 full = scatteri_full_steps(scatteri_in, h, steps);\n"
    "    for (int i = full.x; i < full.y && scatteri_albedo.w * sum < SCATTERI_OPAQUE; i++) {\n"
    "        vec2 field = scatteri_field_at(scatteri_o + (scatteri_in + (float(i) + 0.5) * h) * scatteri_d);\n"
    "        sum += h * field.x;\n"
    "        i += scatteri_steps_over(field.y, h);\n"
    "    }\n"
    "    return scatteri_in < scatteri_out ? sum : 0.0;\n"
    "}\n"
    "#endif\n"
    "/* What is left of the ray, and what lies on it. */\n"
    "void scatteri_find_ends() {\n"
    "#ifdef SCATTERI_BOUNDED\n"
    "    scatteri_clip(scatteri_bounds_min.xyz, scatteri_bounds_max.xyz);\n"
    "#endif\n"
    "#ifdef SCATTERI_FOG\n"
    "    vec3 x = scatteri_o + scatteri_t0 * scatteri_d;\n"
    "    if (scatteri_t0 < scatteri_t1)\n"
    "        scatteri_t1 = min(scatteri_t1, scatteri_t0 + scatteri_horizon(x, scatteri_t1 - scatteri_t0));\n"
    "#else\n"
    "    scatteri_clip(scatteri_local_min.xyz, scatteri_local_max.xyz);\n"
    "#endif\n"
    "    scatteri_from = SCATTERI_FAR;\n"
    "    scatteri_to = -SCATTERI_FAR;\n"
    "    scatteri_features = scatteri_start = scatteri_in = scatteri_out = 0.0;\n"
    "#ifdef SCATTERI_GAUSSIANS\n"
    "    scatteri_find_hull();\n"
    "    scatteri_start = scatteri_gaussians_at(scatteri_t0).y;\n"
    "#endif\n"
    "    scatteri_from = clamp(scatteri_from, scatteri_t0, scatteri_t1);\n"
    "    scatteri_to = clamp(scatteri_to, scatteri_from, scatteri_t1);\n"
    "#ifdef SCATTERI_FIELD\n"
    "    scatteri_find_field();\n"
    "#endif\n"
    "}\n";

/* Shadow maps of the host. */
static const char scatteri_gl_shadow_maps[] =
    "#if defined(SCATTERI_SHADOW_2D_0) || defined(SCATTERI_SHADOW_2D_1) || defined(SCATTERI_SHADOW_2D_2) || defined(SCATTERI_SHADOW_2D_3)\n"
    "#define SCATTERI_SHADOWS\n"
    "#endif\n"
    "#if defined(SCATTERI_SHADOW_ARRAY_0) || defined(SCATTERI_SHADOW_ARRAY_1) || defined(SCATTERI_SHADOW_ARRAY_2) || defined(SCATTERI_SHADOW_ARRAY_3)\n"
    "#define SCATTERI_SHADOWS\n"
    "#endif\n"
    "#if defined(SCATTERI_SHADOW_CUBE_0) || defined(SCATTERI_SHADOW_CUBE_1) || defined(SCATTERI_SHADOW_CUBE_2) || defined(SCATTERI_SHADOW_CUBE_3)\n"
    "#define SCATTERI_SHADOWS\n"
    "#endif\n"
    "#ifdef SCATTERI_SHADOWS\n"
    "#ifdef SCATTERI_SHADOW_2D_0\n"
    "uniform highp sampler2D scatteri_shadow0;\n"
    "#elif defined(SCATTERI_SHADOW_ARRAY_0)\n"
    "uniform highp sampler2DArray scatteri_shadow0;\n"
    "#elif defined(SCATTERI_SHADOW_CUBE_0)\n"
    "uniform highp samplerCube scatteri_shadow0;\n"
    "#endif\n"
    "#ifdef SCATTERI_SHADOW_2D_1\n"
    "uniform highp sampler2D scatteri_shadow1;\n"
    "#elif defined(SCATTERI_SHADOW_ARRAY_1)\n"
    "uniform highp sampler2DArray scatteri_shadow1;\n"
    "#elif defined(SCATTERI_SHADOW_CUBE_1)\n"
    "uniform highp samplerCube scatteri_shadow1;\n"
    "#endif\n"
    "#ifdef SCATTERI_SHADOW_2D_2\n"
    "uniform highp sampler2D scatteri_shadow2;\n"
    "#elif defined(SCATTERI_SHADOW_ARRAY_2)\n"
    "uniform highp sampler2DArray scatteri_shadow2;\n"
    "#elif defined(SCATTERI_SHADOW_CUBE_2)\n"
    "uniform highp samplerCube scatteri_shadow2;\n"
    "#endif\n"
    "#ifdef SCATTERI_SHADOW_2D_3\n"
    "uniform highp sampler2D scatteri_shadow3;\n"
    "#elif defined(SCATTERI_SHADOW_ARRAY_3)\n"
    "uniform highp sampler2DArray scatteri_shadow3;\n"
    "#elif defined(SCATTERI_SHADOW_CUBE_3)\n"
    "uniform highp samplerCube scatteri_shadow3;\n"
    "#endif\n"
    "/* What the shadow map of light l holds: p is where in the map, or the direction into a cube. */\n"
    "float scatteri_shadow_map(int l, vec3 p) {\n"
    "#ifdef SCATTERI_SHADOW_2D_0\n"
    "    if (l == 0) return textureLod(scatteri_shadow0, p.xy, 0.0).x;\n"
    "#elif defined(SCATTERI_SHADOW_ARRAY_0) || defined(SCATTERI_SHADOW_CUBE_0)\n"
    "    if (l == 0) return textureLod(scatteri_shadow0, p, 0.0).x;\n"
    "#endif\n"
    "#ifdef SCATTERI_SHADOW_2D_1\n"
    "    if (l == 1) return textureLod(scatteri_shadow1, p.xy, 0.0).x;\n"
    "#elif defined(SCATTERI_SHADOW_ARRAY_1) || defined(SCATTERI_SHADOW_CUBE_1)\n"
    "    if (l == 1) return textureLod(scatteri_shadow1, p, 0.0).x;\n"
    "#endif\n"
    "#ifdef SCATTERI_SHADOW_2D_2\n"
    "    if (l == 2) return textureLod(scatteri_shadow2, p.xy, 0.0).x;\n"
    "#elif defined(SCATTERI_SHADOW_ARRAY_2) || defined(SCATTERI_SHADOW_CUBE_2)\n"
    "    if (l == 2) return textureLod(scatteri_shadow2, p, 0.0).x;\n"
    "#endif\n"
    "#ifdef SCATTERI_SHADOW_2D_3\n"
    "    if (l == 3) return textureLod(scatteri_shadow3, p.xy, 0.0).x;\n"
    "#elif defined(SCATTERI_SHADOW_ARRAY_3) || defined(SCATTERI_SHADOW_CUBE_3)\n"
    "    if (l == 3) return textureLod(scatteri_shadow3, p, 0.0).x;\n"
    "#endif\n"
    "    return 0.0;\n"
    "}\n"
    "#endif\n";

/* Whether geometry stops a light. */
static const char scatteri_gl_visible[] =
    "#ifdef SCATTERI_SHADOWS\n"
    "/* Nearest depth in a cube map's terms of a point at v from the light. */\n"
    "float scatteri_cube_depth(vec3 v, float near, float far) {\n"
    "    float z = max(abs(v.x), max(abs(v.y), abs(v.z)));\n"
    "    return near > 0.0 ? far * (z - near) / (z * (far - near)) : length(v) / far;\n"
    "}\n"
    "/* Whether no geometry lies between x and light l. */\n"
    "bool scatteri_visible(int l, vec3 x) {\n"
    "    vec4 map = scatteri_shadow[l], more = scatteri_shadow_more[l];\n"
    "    if (map.x < 0.5)\n"
    "        return true;\n"
    "    if (map.x > 2.5) {\n"
    "        vec3 v = x - scatteri_light[l].xyz;\n"
    "        float depth = scatteri_cube_depth(v, more.y, more.z);\n"
    "        return map.z * (depth - scatteri_shadow_map(l, v)) <= map.y;\n"
    "    }\n"
    "    for (int c = 0; c < int(map.w); c++) {\n"
    "        int row = (l * 4 + c) * 4;\n"
    "        vec4 at = vec4(x, 1.0);\n"
    "        vec4 p = vec4(dot(scatteri_shadow_matrix[row], at), dot(scatteri_shadow_matrix[row + 1], at),\n"
    "                      dot(scatteri_shadow_matrix[row + 2], at),\n"
    "                      dot(scatteri_shadow_matrix[row + 3], at));\n"
    "        vec3 q = p.xyz / p.w;\n"
    "        bool inside = p.w > 0.0 && all(greaterThanEqual(q.xy, vec2(0.0))) &&\n"
    "                      all(lessThanEqual(q.xy, vec2(1.0)));\n"
    "        if (inside) {\n"
    "            vec3 where = vec3(q.xy, more.x + float(c));\n"
    "            return map.z * (q.z - scatteri_shadow_map(l, where)) <= map.y;\n"
    "        }\n"
    "    }\n"
    "    return true;\n"
    "}\n"
    "#endif\n";

/* Depth between a point and a light. */
static const char scatteri_gl_depth_to[] =
    "/* Depth between x and source l, which lies at `distance` in the direction `to`. */\n"
    "float scatteri_depth_to(int l, vec3 x, vec3 to, float distance) {\n"
    "    float segment = scatteri_segment_to(x, to, distance), sum = 0.0;\n"
    "#if defined(SCATTERI_CELLS) || defined(SCATTERI_POLAR)\n"
    "    sum = scatteri_volume_depth(l, x, to, distance, segment);\n"
    "#elif defined(SCATTERI_CLOSED)\n"
    "    sum = scatteri_closed_depth(x, to, segment);\n"
    "#endif\n"
    "#if defined(SCATTERI_RAYS) && defined(SCATTERI_FIELD)\n"
    "    sum += scatteri_field_ray(x, to, segment);\n"
    "#endif\n"
    "#ifdef SCATTERI_FOG\n"
    "    sum += scatteri_fog_depth(x, to, segment);\n"
    "#endif\n"
    "    return sum;\n"
    "}\n";

/* What a light sends towards the eye. */
static const char scatteri_gl_scattering[] =
    "/* Phase function of 1 - cos of the scattering angle, 1/sr. */\n"
    "float scatteri_phase_of(float omc) {\n"
    "#if defined(SCATTERI_TWO_LOBES)\n"
    "    vec4 pair = scatteri_lobe_pair;\n"
    "    return scatteri_phase(scatteri_lobes(pair.x, pair.y, pair.z, pair.w, scatteri_lobe_turn.x), omc);\n"
    "#elif defined(SCATTERI_ONE_LOBE)\n"
    "    return scatteri_draine(scatteri_lobe_pair.x, scatteri_lobe_pair.y, omc);\n"
    "#else\n"
    "    return 0.0795774715;\n"
    "#endif\n"
    "}\n"
    "bool scatteri_is_directional(int l) {\n"
    "    return scatteri_light[l].w > 1.5;\n"
    "}\n"
    "/* What light l sends at t towards the eye, per intensity, density and metre, before attenuation; its depth in `depth`.\n"
    "   near: distance of light and ray, along: of the foot on the ray. */\n"
    "float scatteri_scattered(int l, float t, float along, float near2, out float depth) {\n"
    "    vec3 x = scatteri_o + t * scatteri_d, to = -scatteri_direction[l].xyz;\n"
    "    float distance = SCATTERI_FAR, turn = scatteri_lobe_turn.y, fall = 1.0, omc;\n"
    "    if (scatteri_is_directional(l)) {\n"
    "        vec3 a = scatteri_direction[l].xyz + turn * scatteri_d;\n"
    "        omc = 0.5 * dot(a, a);\n"
    "    } else {\n"
    "        float s = t - along, q2 = max(near2 + s * s, 1.0e-30), inverse = inversesqrt(q2);\n"
    "        distance = q2 * inverse;\n"
    "        to = (scatteri_light[l].xyz - x) * inverse;\n"
    "        omc = turn * s < 0.0 ? near2 * inverse / (distance + abs(s)) : 1.0 + abs(s) * inverse;\n"
    "        fall = 1.0 / (q2 + scatteri_direction[l].w * scatteri_direction[l].w);\n"
    "#ifdef SCATTERI_SPOT\n"
    "        if (scatteri_light[l].w > 0.5)\n"
    "            fall *= scatteri_spot(scatteri_cone[l].x, scatteri_cone[l].y,\n"
    "                                  -dot(to, scatteri_direction[l].xyz));\n"
    "#endif\n"
    "    }\n"
    "    depth = scatteri_depth_to(l, x, to, distance);\n"
    "    return fall * scatteri_phase_of(omc);\n"
    "}\n";

/* The map of a light along the ray, and one node of the quadrature. */
static const char scatteri_gl_nodes[] =
    "uniform highp sampler2D scatteri_rules;\n"
    "vec3 scatteri_sum;    /* radiance */\n"
    "float scatteri_used;  /* nodes */\n"
    "vec2 scatteri_shown;  /* sums of density and of density times depth to the light that is shown */\n"
    "int scatteri_first, scatteri_end; /* lights of the pass */\n"
    "bool scatteri_joint;  /* emission and all directional lights: shared nodes */\n"
    "/* The map of the pass's light: t = along + near sinh(u), or t = u. */\n"
    "bool scatteri_bent;\n"
    "float scatteri_along, scatteri_near2, scatteri_near;\n"
    "vec2 scatteri_stretch(float u) {\n"
    "    float up = 0.5 * exp(u), down = 0.25 / up;\n"
    "    return scatteri_bent ? vec2(scatteri_along + scatteri_near * (up - down), scatteri_near * (up + down))\n"
    "                         : vec2(u, 1.0);\n"
    "}\n"
    "float scatteri_to_u(float t) {\n"
    "    return scatteri_bent ? scatteri_asinh((t - scatteri_along) / scatteri_near) : t;\n"
    "}\n"
    "void scatteri_map_light(int l) {\n"
    "    vec3 to = scatteri_light[l].xyz - scatteri_o;\n"
    "    float along = dot(to, scatteri_d), size = scatteri_t1 - scatteri_t0;\n"
    "    vec3 off = to - along * scatteri_d;\n"
    "    float r = min(scatteri_direction[l].w, 0.0625 * size);\n"
    "    float beyond = along - clamp(along, scatteri_t0, scatteri_t1);\n"
    "    scatteri_along = along;\n"
    "    scatteri_near2 = dot(off, off);\n"
    "    scatteri_near = max(sqrt(scatteri_near2 + r * r), 1.0e-6 * max(1.0e-3, abs(along)));\n"
    "    scatteri_bent = !scatteri_is_directional(l) && max(scatteri_near, abs(beyond)) < 64.0 * size;\n"
    "}\n"
    "/* Mean transmittance of a piece of depth x over that at its begin: (1 - exp(-x))/x. */\n"
    "vec3 scatteri_mean(vec3 x) {\n"
    "    return vec3(scatteri_exprel(-x.x), scatteri_exprel(-x.y), scatteri_exprel(-x.z));\n"
    "}\n"
    "/* Transmittance of that depth. */\n"
    "vec3 scatteri_through(float depth) {\n"
    "#ifdef SCATTERI_COLORED\n"
    "    return exp(-scatteri_extinction.xyz * depth);\n"
    "#else\n"
    "    return vec3(exp(-scatteri_extinction.w * depth));\n"
    "#endif\n"
    "}\n"
    "/* One node: density and depth at t, weight in metres, cell: length in which density is constant, or 0. */\n"
    "void scatteri_node(float t, float weight, float cell, float density, float depth) {\n"
    "    vec3 gain = vec3(weight * density);\n"
    "    scatteri_used += 1.0;\n"
    "#ifdef SCATTERI_FIELD\n"
    "    if (cell > 0.0) {\n"
    "        gain *= scatteri_mean(scatteri_extinction.xyz * (density * cell));\n"
    "        depth = max(depth - 0.5 * density * cell, 0.0);\n"
    "    }\n"
    "#endif\n"
    "#ifdef SCATTERI_EMISSION\n"
    "    if (scatteri_joint)\n"
    "        scatteri_sum += gain * scatteri_emission.xyz * scatteri_through(depth);\n"
    "#endif\n"
    "    for (int l = scatteri_first; l < scatteri_end; l++) {\n"
    "        float far;\n"
    "        if (scatteri_joint && !scatteri_is_directional(l))\n"
    "            continue;\n"
    "        float sent = scatteri_scattered(l, t, scatteri_along, scatteri_near2, far);\n"
    "        vec3 through = scatteri_through(depth + far);\n"
    "        scatteri_sum += (sent * gain) * scatteri_intensity[l].xyz * scatteri_albedo.xyz * through;\n"
    "#ifdef SCATTERI_SHOW\n"
    "        if (l == int(scatteri_picture.w))\n"
    "            scatteri_shown += weight * density * vec2(1.0, far);\n"
    "#endif\n"
    "    }\n"
    "}\n";

/* Panels of nodes, and how many features a stretch of the ray has. */
static const char scatteri_gl_panels[] =
    "const int SCATTERI_BINS = 32;\n"
    "float scatteri_panel_size; /* features in a panel */\n"
    "/* A node at u, weight in u; cells: density is constant around it. Returns whether light comes from behind it. */\n"
    "bool scatteri_visit(float u, float weight, bool cells, bool lit) {\n"
    "    vec2 at = scatteri_stretch(u);\n"
    "    bool full = cells;\n"
    "#ifdef SCATTERI_MASK\n"
    "    full = cells && scatteri_is_full(at.x);\n"
    "#ifdef SCATTERI_VOXELS_ONLY\n"
    "    if (!full)\n"
    "        return at.x < scatteri_full.y;\n"
    "#endif\n"
    "#endif\n"
    "    float w = weight * at.y, density = 0.0, depth = -scatteri_start;\n"
    "    vec3 x = scatteri_o + at.x * scatteri_d;\n"
    "#ifdef SCATTERI_GAUSSIANS\n"
    "    vec2 g = scatteri_gaussians_at(at.x);\n"
    "    density += g.x;\n"
    "    depth += g.y;\n"
    "#endif\n"
    "#ifdef SCATTERI_EYE\n"
    "    vec3 back = scatteri_light[0].xyz - x;\n"
    "    float r = length(back);\n"
    "    depth = scatteri_volume_depth(0, x, back / max(r, 1.0e-30), r, r);\n"
    "#endif\n"
    "#ifdef SCATTERI_FIELD\n"
    "    float voxels = full ? scatteri_field_density(x) : 0.0;\n"
    "    density += voxels;\n"
    "#ifndef SCATTERI_EYE\n"
    "    depth += scatteri_run + 0.5 * w * voxels;\n"
    "#endif\n"
    "    scatteri_run += w * voxels;\n"
    "#endif\n"
    "#ifdef SCATTERI_FOG\n"
    "    density += scatteri_fog_density(x);\n"
    "    depth += scatteri_fog_depth(scatteri_o + scatteri_t0 * scatteri_d, scatteri_d, at.x - scatteri_t0);\n"
    "#endif\n"
    "    if (scatteri_albedo.w * depth > SCATTERI_OPAQUE)\n"
    "        return false;\n"
    "    if (lit && density > 0.0)\n"
    "        scatteri_node(at.x, w, cells ? w : 0.0, density, max(depth, 0.0));\n"
    "    return true;\n"
    "}\n"
    "/* Nodes of a panel from ua to ub: rule `row` of n nodes, or n equal cells of which depth is summed. */\n"
    "void scatteri_evaluate(float ua, float ub, int row, int n, bool cells, bool lit) {\n"
    "    float middle = 0.5 * (ua + ub), half_way = 0.5 * (ub - ua);\n"
    "    for (int k = 0; k < n; k++) {\n"
    "        vec2 node = cells ? vec2((2.0 * float(k) + 1.0) / float(n) - 1.0, 2.0 / float(n))\n"
    "                          : texelFetch(scatteri_rules, ivec2(k, row), 0).xy;\n"
    "        if (!scatteri_visit(middle + half_way * node.x, half_way * node.y, cells, lit))\n"
    "            return;\n"
    "    }\n"
    "}\n"
    "/* Features in a unit of u between u0 and u1; 0: empty. */\n"
    "float scatteri_rate(float u0, float u1, bool cells, bool glow) {\n"
    "    float low = scatteri_stretch(u0).x, high = scatteri_stretch(u1).x, rate = 0.0;\n"
    "    float stretch = scatteri_stretch(0.5 * (u0 + u1)).y, t = 0.5 * (low + high);\n"
    "    if (cells)\n"
    "        rate = 10.0 / (SCATTERI_VOXELS * scatteri_voxel);\n"
    "#ifdef SCATTERI_FOG\n"
    "    float least = 1.0e-30;\n"
    "    for (int i = 0; i < int(scatteri_counts.y); i++)\n"
    "        least = max(least, abs(scatteri_d.y) / scatteri_heights[i].z);\n"
    "    rate = max(rate, 0.4 * max(scatteri_extinction.w *\n"
    "                               scatteri_fog_density(scatteri_o + t * scatteri_d), least));\n"
    "#endif\n"
    "#ifdef SCATTERI_GAUSSIANS\n"
    "    for (int i = 0; i < scatteri_on_ray(); i++) {\n"
    "        vec4 g = scatteri_gauss_place(scatteri_which(i)), h = scatteri_gauss_weight(scatteri_which(i));\n"
    "        vec3 p = g.xyz - scatteri_o;\n"
    "        float m = dot(p, scatteri_d);\n"
    "        vec3 q = p - m * scatteri_d;\n"
    "        float fade = g.w * g.w * dot(q, q), reach = sqrt(max(h.y - scatteri_trim.x - fade, 0.0)) / g.w;\n"
    "        float whole = 2.0 * h.z * exp(-fade);\n"
    "        if (m - reach < high && m + reach > low)\n"
    "            rate = max(rate, g.w * (1.0 + 0.2 * log(1.0 + scatteri_extinction.w * whole)));\n"
    "    }\n"
    "#endif\n"
    "    if (glow && scatteri_along - 4.0 * scatteri_near < high && scatteri_along + 4.0 * scatteri_near > low)\n"
    "        rate = max(rate, 1.0e-30);\n"
    "    rate *= stretch;\n"
    "    return scatteri_bent && rate > 0.0 ? max(rate, 2.0) : rate;\n"
    "}\n";

/* A smooth stretch of the ray, cut into panels. */
static const char scatteri_gl_pieces[] =
    "int scatteri_row;    /* rule for the one panel that takes the whole ray, or -1 */\n"
    "bool scatteri_glow;  /* the light is in the rim of the medium */\n"
    "int scatteri_rule_nodes(int row) {\n"
    "    return (int(scatteri_nodes.x) * (row + 1) + 7) / 8;\n"
    "}\n"
    "/* A rule of as many nodes as the features of the whole ray need, where nothing cuts it; else -1. */\n"
    "int scatteri_whole_rule(float from, float to, bool cut) {\n"
    "#ifdef SCATTERI_FOG\n"
    "    return -1;\n"
    "#else\n"
    "    float range = scatteri_bent ? scatteri_to_u(to) - scatteri_to_u(from) : 0.0;\n"
    "    float features = max(scatteri_features * (to - from), 2.0 * range);\n"
    "    int row = max(int(min(8.0 * features / scatteri_panel_size, 1.0e6)), 2);\n"
    "    bool can = !cut && scatteri_in >= scatteri_out && range <= 8.0 && scatteri_lobe_pair.x <= 0.9;\n"
    "    return can && row < 20 && scatteri_rule_nodes(row) <= 256 ? row : -1;\n"
    "#endif\n"
    "}\n"
    "/* A stretch of the ray on which only the medium's smooth shape counts: panels follow its features. */\n"
    "void scatteri_piece(float ta, float tb, bool lit) {\n"
    "    float middle = 0.5 * (ta + tb), ua = scatteri_to_u(ta), ub = scatteri_to_u(tb);\n"
    "    bool cells = middle > scatteri_in && middle < scatteri_out, open = false;\n"
    "    float width = (ub - ua) / float(SCATTERI_BINS), rate = 0.0, most = scatteri_panel_size;\n"
    "    int row = scatteri_row >= 0 ? scatteri_row : 7, n = scatteri_rule_nodes(row);\n"
    "    int first = 0, part = 0, parts = 0, b = 0;\n"
    "#ifdef SCATTERI_FOG\n"
    "    bool simple = false;\n"
    "#else\n"
    "    float features = max(scatteri_features * (tb - ta), scatteri_bent ? 2.0 * (ub - ua) : 0.0);\n"
    "    bool simple = scatteri_row >= 0 || (!cells && scatteri_lobe_pair.x <= 0.9 && features <= most);\n"
    "#endif\n"
    "    for (int guard = 0; guard < 512; guard++) {\n"
    "        float from = ua, to = ub;\n"
    "        if (simple) {\n"
    "            if (guard > 0)\n"
    "                break;\n"
    "        } else if (part < parts) { /* of a bin with many features */\n"
    "            from = ua + (float(b - 1) + float(part) / float(parts)) * width;\n"
    "            to = ua + (float(b - 1) + float(part + 1) / float(parts)) * width;\n"
    "            part++;\n"
    "        } else if (b == SCATTERI_BINS) {\n"
    "            if (!open)\n"
    "                break;\n"
    "            from = ua + float(first) * width;\n"
    "            open = false;\n"
    "        } else {\n"
    "            float here = scatteri_rate(ua + float(b) * width, ua + float(b + 1) * width, cells,\n"
    "                                       scatteri_glow);\n"
    "            bool closes = open && (!(here > 0.0) || max(rate, here) * width * float(b + 1 - first) > most);\n"
    "            if (closes) { /* this bin is looked at again */\n"
    "                from = ua + float(first) * width;\n"
    "                to = ua + float(b) * width;\n"
    "                open = false;\n"
    "            } else {\n"
    "                rate = open ? max(rate, here) : here;\n"
    "                first = open ? first : b;\n"
    "                open = here > 0.0;\n"
    "                if (open && here * width > most) {\n"
    "                    parts = int(min(here * width / most, 7.0)) + 1;\n"
    "                    part = 0;\n"
    "                    open = false;\n"
    "                }\n"
    "                b++;\n"
    "                continue;\n"
    "            }\n"
    "        }\n"
    "        scatteri_evaluate(from, to, row, n, cells, lit);\n"
    "    }\n"
    "}\n";

/* What cuts a ray: cones of spots and the edges of shadows. */
static const char scatteri_gl_cuts[] =
    "/* The two places where the ray crosses the cone of cosine k around light l, both nappes. */\n"
    "vec2 scatteri_cone_edges(int l, float k) {\n"
    "    vec3 w = scatteri_direction[l].xyz, from = scatteri_o - scatteri_light[l].xyz;\n"
    "    float uw = dot(scatteri_d, w), ow = dot(from, w), ou = dot(from, scatteri_d);\n"
    "    float a = uw * uw - k * k, b = uw * ow - k * k * ou, c = ow * ow - k * k * dot(from, from);\n"
    "    float root = b * b - a * c;\n"
    "    if (!(root > 0.0))\n"
    "        return vec2(-1.0);\n"
    "    float q = b >= 0.0 ? -(b + sqrt(root)) : -(b - sqrt(root));\n"
    "    return vec2(a != 0.0 ? q / a : -1.0, q != 0.0 ? c / q : -1.0);\n"
    "}\n"
    "bool scatteri_in_cone(int l, float t) {\n"
    "    vec3 from = scatteri_o + t * scatteri_d - scatteri_light[l].xyz;\n"
    "    return dot(from, scatteri_direction[l].xyz) > scatteri_cone[l].y * length(from);\n"
    "}\n"
    "float scatteri_nearer(float edge, float t, float next) {\n"
    "    return edge > t && edge < next ? edge : next;\n"
    "}\n"
    "#ifdef SCATTERI_SHADOWS\n"
    "const int SCATTERI_PROBES = 64;\n"
    "float scatteri_probe(int i, float ta, float tb) {\n"
    "    float even = (float(i) + 0.5) / float(SCATTERI_PROBES), ua = scatteri_to_u(ta);\n"
    "    return scatteri_stretch(ua + (scatteri_bent ? even : even * even) * (scatteri_to_u(tb) - ua)).x;\n"
    "}\n"
    "bool scatteri_lit(float t) {\n"
    "    return scatteri_visible(scatteri_first, scatteri_o + t * scatteri_d);\n"
    "}\n"
    "/* Where light and shadow meet between a (in state `lit`) and b (in the other). */\n"
    "float scatteri_shadow_edge(float a, float b, bool lit) {\n"
    "    for (int i = 0; i < 16; i++) {\n"
    "        float middle = 0.5 * (a + b);\n"
    "        if (scatteri_lit(middle) == lit)\n"
    "            a = middle;\n"
    "        else\n"
    "            b = middle;\n"
    "    }\n"
    "    return 0.5 * (a + b);\n"
    "}\n"
    "#endif\n"
    "/* From ta to tb, cut where the shadows of geometry end. */\n"
    "void scatteri_lit_pieces(float ta, float tb, bool lit) {\n"
    "#ifdef SCATTERI_SHADOWS\n"
    "    int i = 1;\n"
    "    float before = scatteri_probe(0, ta, tb), start = ta;\n"
    "    bool cut = lit && !scatteri_joint && scatteri_shadow[scatteri_first].x > 0.5;\n"
    "    bool now = cut ? scatteri_lit(before) : lit;\n"
    "    for (int guard = 0; guard <= SCATTERI_PROBES; guard++) {\n"
    "        float end = tb;\n"
    "        for (; cut && i < SCATTERI_PROBES && end == tb; i++) {\n"
    "            float t = scatteri_probe(i, ta, tb);\n"
    "            if (scatteri_lit(t) != now)\n"
    "                end = scatteri_shadow_edge(before, t, now);\n"
    "            before = t;\n"
    "        }\n"
    "#ifdef SCATTERI_FIELD\n"
    "        scatteri_piece(start, end, now);\n"
    "#else\n"
    "        if (now)\n"
    "            scatteri_piece(start, end, true);\n"
    "#endif\n"
    "        if (end == tb)\n"
    "            break;\n"
    "        start = end;\n"
    "        now = !now;\n"
    "    }\n"
    "#else\n"
    "    scatteri_piece(ta, tb, lit);\n"
    "#endif\n"
    "}\n";

/* Where Gaussians take nodes, and all of these in one loop where nothing can cut the ray. */
static const char scatteri_gl_smooth[] =
    "#if defined(SCATTERI_FEW_THIN) && defined(SCATTERI_GAUSSIANS) && !defined(SCATTERI_FIELD)\n"
    "#if !defined(SCATTERI_FOG) && !defined(SCATTERI_SHADOWS) && !defined(SCATTERI_SPOT)\n"
    "#define SCATTERI_SMOOTH\n"
    "#endif\n"
    "#endif\n"
    "/* Where Gaussians take nodes, and the glow of a light in their rim. */\n"
    "vec2 scatteri_hull() {\n"
    "    float from = scatteri_from, to = scatteri_to;\n"
    "    float low = scatteri_along - 4.0 * scatteri_near, high = scatteri_along + 4.0 * scatteri_near;\n"
    "    if (!scatteri_glow)\n"
    "        return vec2(from, to);\n"
    "    bool some = from < to;\n"
    "    return clamp(vec2(some ? min(from, low) : low, some ? max(to, high) : high), scatteri_t0,\n"
    "                 scatteri_t1);\n"
    "}\n"
    "#ifdef SCATTERI_SMOOTH\n"
    "/* The same where nothing can cut the ray: one loop over the nodes of all its panels. */\n"
    "void scatteri_smooth_pass() {\n"
    "    vec2 hull = scatteri_hull();\n"
    "    int whole = scatteri_whole_rule(hull.x, hull.y, false), row = whole < 0 ? 7 : whole;\n"
    "    int n = scatteri_rule_nodes(row), k = n;\n"
    "    float size = hull.y - hull.x, panels = ceil(scatteri_features * size / scatteri_panel_size);\n"
    "    float step = whole < 0 ? size / max(panels, 1.0) : 2.0 * size;\n"
    "    float most = whole < 0 && scatteri_bent ? 0.5 * scatteri_panel_size : SCATTERI_FAR;\n"
    "    float ua = 0.0, ub = scatteri_to_u(hull.x), end = scatteri_to_u(hull.y);\n"
    "    for (int guard = 0; guard < 65536; guard++) {\n"
    "        if (k == n) {\n"
    "            if (!(ub < end))\n"
    "                break;\n"
    "            ua = ub;\n"
    "            float next = scatteri_stretch(ua).x + step;\n"
    "            ub = min(ua + most, next < hull.y - 0.01 * step ? scatteri_to_u(next) : end);\n"
    "            k = 0;\n"
    "        }\n"
    "        vec2 node = texelFetch(scatteri_rules, ivec2(k, row), 0).xy;\n"
    "        if (!scatteri_visit(mix(ua, ub, 0.5 + 0.5 * node.x), 0.5 * (ub - ua) * node.y, false, true))\n"
    "            break;\n"
    "        k++;\n"
    "    }\n"
    "}\n"
    "#endif\n";

/* All lights of the batch along the ray. */
static const char scatteri_gl_ray[] =
    "/* Nodes for one pass over the ray: cut where the medium or the light is not smooth. */\n"
    "void scatteri_pass(bool spot) {\n"
    "    vec2 outer = vec2(-1.0), inner = vec2(-1.0), hull = scatteri_hull();\n"
    "    float ta = scatteri_t0, from = hull.x, to = hull.y;\n"
    "    bool cut = spot;\n"
    "    scatteri_run = 0.0;\n"
    "#ifdef SCATTERI_SHADOWS\n"
    "    cut = cut || (!scatteri_joint && scatteri_shadow[scatteri_first].x > 0.5);\n"
    "#endif\n"
    "    scatteri_row = scatteri_whole_rule(from, to, cut);\n"
    "#ifdef SCATTERI_SPOT\n"
    "    if (spot) {\n"
    "        outer = scatteri_cone_edges(scatteri_first, scatteri_cone[scatteri_first].y);\n"
    "        inner = scatteri_cone_edges(scatteri_first, scatteri_cone[scatteri_first].x);\n"
    "    }\n"
    "#endif\n"
    "    for (int guard = 0; guard < 12 && ta < scatteri_t1; guard++) {\n"
    "        float tb = scatteri_nearer(from, ta, scatteri_nearer(to, ta, scatteri_t1));\n"
    "        bool lit = true;\n"
    "#ifdef SCATTERI_FIELD\n"
    "        tb = scatteri_nearer(scatteri_in, ta, scatteri_nearer(scatteri_out, ta, tb));\n"
    "#endif\n"
    "#ifdef SCATTERI_SPOT\n"
    "        tb = scatteri_nearer(outer.x, ta, scatteri_nearer(outer.y, ta, tb));\n"
    "        tb = scatteri_nearer(inner.x, ta, scatteri_nearer(inner.y, ta, tb));\n"
    "        lit = !spot || scatteri_in_cone(scatteri_first, 0.5 * (ta + tb));\n"
    "#endif\n"
    "        float middle = 0.5 * (ta + tb);\n"
    "        bool voxels = middle > scatteri_in && middle < scatteri_out;\n"
    "        bool filled = voxels || (middle > from && middle < to);\n"
    "#ifdef SCATTERI_FOG\n"
    "        filled = true;\n"
    "#endif\n"
    "        if (filled && (lit || voxels))\n"
    "            scatteri_lit_pieces(ta, tb, lit);\n"
    "        ta = tb;\n"
    "    }\n"
    "}\n"
    "/* All lights of the batch. Emission and directional lights share nodes unless something cuts the ray for each. */\n"
    "void scatteri_integrate() {\n"
    "#if defined(SCATTERI_SHADOWS) || defined(SCATTERI_FOG)\n"
    "    bool shared_nodes = false;\n"
    "#else\n"
    "    bool shared_nodes = true;\n"
    "#endif\n"
    "    int first = int(scatteri_batch.y), used = int(scatteri_batch.x);\n"
    "    for (int p = first - 1; p < used; p++) {\n"
    "        bool needed = false;\n"
    "        scatteri_joint = p < first;\n"
    "        scatteri_first = scatteri_joint ? first : p;\n"
    "        scatteri_end = scatteri_joint ? (shared_nodes ? used : first) : p + 1;\n"
    "        scatteri_bent = scatteri_glow = false;\n"
    "        scatteri_along = scatteri_near2 = scatteri_near = 0.0;\n"
    "        if (scatteri_joint) {\n"
    "#ifdef SCATTERI_EMISSION\n"
    "            needed = true;\n"
    "#endif\n"
    "#ifdef SCATTERI_DIRECTIONAL\n"
    "            needed = needed || shared_nodes;\n"
    "#endif\n"
    "        } else {\n"
    "            needed = !(shared_nodes && scatteri_is_directional(p)) &&\n"
    "                     max(scatteri_intensity[p].x, max(scatteri_intensity[p].y, scatteri_intensity[p].z)) > 0.0;\n"
    "            scatteri_map_light(p);\n"
    "            scatteri_glow = scatteri_intensity[p].w > 0.5 && !scatteri_is_directional(p);\n"
    "        }\n"
    "#ifdef SCATTERI_SMOOTH\n"
    "        if (needed)\n"
    "            scatteri_smooth_pass();\n"
    "#else\n"
    "        if (needed)\n"
    "            scatteri_pass(!scatteri_joint && scatteri_light[p].w > 0.5 && scatteri_light[p].w < 1.5);\n"
    "#endif\n"
    "    }\n"
    "}\n";

/* All lights at one place of the ray. */
static const char scatteri_gl_every_light[] =
    "/* Emission and all lights of the batch at one place of the ray: a node that stands for `size` metres, of even density over `cell`. */\n"
    "void scatteri_all_lights(float t, float size, float cell, float density, float depth) {\n"
    "    int first = int(scatteri_batch.y), used = int(scatteri_batch.x);\n"
    "    for (int l = first - 1; l < used; l++) {\n"
    "        scatteri_joint = l < first;\n"
    "        scatteri_first = scatteri_joint ? first : l;\n"
    "        scatteri_end = scatteri_joint ? first : l + 1;\n"
    "        if (!scatteri_joint)\n"
    "            scatteri_map_light(l);\n"
    "#ifdef SCATTERI_SHADOWS\n"
    "        if (!scatteri_joint && !scatteri_visible(l, scatteri_o + t * scatteri_d))\n"
    "            continue;\n"
    "#endif\n"
    "        scatteri_node(t, size, cell, density, depth);\n"
    "    }\n"
    "}\n";

/* Uniform steps. */
static const char scatteri_gl_march[] =
    "/* Uniform steps with running sums, as in the papers; returns the depth of the ray. */\n"
    "float scatteri_march() {\n"
    "    int steps = int(scatteri_nodes.z);\n"
    "    float h = (scatteri_t1 - scatteri_t0) / float(steps), run = 0.0;\n"
    "    ivec2 full = scatteri_full_steps(scatteri_t0, h, steps);\n"
    "    int begin = 0, next = full.x; /* the next step that may meet the field */\n"
    "#ifdef SCATTERI_VOXELS_ONLY\n"
    "    begin = full.x;\n"
    "    steps = full.y;\n"
    "#endif\n"
    "    for (int k = begin; k < steps; k++) {\n"
    "        float t = scatteri_t0 + (float(k) + 0.5) * h, density = 0.0;\n"
    "        vec3 x = scatteri_o + t * scatteri_d;\n"
    "#ifdef SCATTERI_GAUSSIANS\n"
    "        density += scatteri_gaussians_at(t).x;\n"
    "#endif\n"
    "#ifdef SCATTERI_FIELD\n"
    "        if (k >= next && k < full.y) {\n"
    "            vec2 field = scatteri_field_at(x);\n"
    "            density += field.x;\n"
    "            next = k + 1 + scatteri_steps_over(field.y, h);\n"
    "        }\n"
    "#endif\n"
    "#ifdef SCATTERI_FOG\n"
    "        density += scatteri_fog_density(x);\n"
    "#endif\n"
    "#if !defined(SCATTERI_FIELD) || defined(SCATTERI_DISTANCE)\n"
    "        if (density > 0.0) /* without a distance map as in the papers: everywhere */\n"
    "#endif\n"
    "            scatteri_all_lights(t, h, 0.0, density, run + 0.5 * h * density);\n"
    "        run += h * density;\n"
    "#ifdef SCATTERI_VOXELS_ONLY\n"
    "        k = next - 1;\n"
    "#endif\n"
    "    }\n"
    "    return run;\n"
    "}\n";

/* A view-aligned volume, several slices at once. */
static const char scatteri_gl_froxels[] =
    "layout(location = 0) out vec4 scatteri_running;\n"
    "layout(location = 1) out vec4 scatteri_slice1;\n"
    "#if SCATTERI_SLICES > 1\n"
    "layout(location = 2) out vec4 scatteri_slice2;\n"
    "#endif\n"
    "#if SCATTERI_SLICES > 2\n"
    "layout(location = 3) out vec4 scatteri_slice3;\n"
    "#endif\n"
    "#if SCATTERI_SLICES > 3\n"
    "layout(location = 4) out vec4 scatteri_slice4;\n"
    "#endif\n"
    "#if SCATTERI_SLICES > 4\n"
    "layout(location = 5) out vec4 scatteri_slice5;\n"
    "#endif\n"
    "#if SCATTERI_SLICES > 5\n"
    "layout(location = 6) out vec4 scatteri_slice6;\n"
    "#endif\n"
    "#if SCATTERI_SLICES > 6\n"
    "layout(location = 7) out vec4 scatteri_slice7;\n"
    "#endif\n"
    "uniform highp sampler2D scatteri_before;\n"
    "uniform highp ivec4 scatteri_at; /* first slice */\n"
    "/* Distance of the middle of slice k from the eye. */\n"
    "float scatteri_slice_at(int k) {\n"
    "    return k < 0 ? 0.0 : scatteri_froxel_range.x * exp(scatteri_froxels.w * (float(k) + 0.5) / scatteri_froxels.z);\n"
    "}\n"
    "/* Depth from the eye of what has a closed form. */\n"
    "float scatteri_closed_to(float t) {\n"
    "    float depth = -scatteri_start;\n"
    "#ifdef SCATTERI_GAUSSIANS\n"
    "    depth += scatteri_gaussians_at(t).y;\n"
    "#endif\n"
    "#ifdef SCATTERI_FOG\n"
    "    depth += scatteri_fog_depth(scatteri_o + scatteri_t0 * scatteri_d, scatteri_d, t - scatteri_t0);\n"
    "#endif\n"
    "    return depth;\n"
    "}\n"
    "/* Adds the light between the middles of slices k - 1 and k: one node, exact within it where the source is even.\n"
    "   running: depth of the field. */\n"
    "vec4 scatteri_fill_slice(int k) {\n"
    "    float a = clamp(scatteri_slice_at(k - 1), scatteri_t0, scatteri_t1);\n"
    "    float b = clamp(scatteri_slice_at(k), scatteri_t0, scatteri_t1);\n"
    "    float size = b - a, before = scatteri_closed_to(a), closed = scatteri_closed_to(b), voxels = 0.0;\n"
    "#ifdef SCATTERI_FIELD\n"
    "    voxels = scatteri_field_density(scatteri_o + 0.5 * (a + b) * scatteri_d);\n"
    "#endif\n"
    "    float density = voxels + max(closed - before, 0.0) / max(size, 1.0e-30);\n"
    "    float depth = scatteri_run + before;\n"
    "    if (size > 0.0 && density > 0.0)\n"
    "        scatteri_all_lights(0.5 * (a + b), size, size, density, max(depth, 0.0) + 0.5 * density * size);\n"
    "    scatteri_run += voxels * size;\n"
    "#ifdef SCATTERI_MORE\n"
    "    closed = -scatteri_run; /* is there already */\n"
    "#endif\n"
    "    return vec4(scatteri_sum, scatteri_run + closed);\n"
    "}\n";

static const char scatteri_gl_froxels_main[] =
    "void main() {\n"
    "    vec4 before = texelFetch(scatteri_before, ivec2(gl_FragCoord.xy), 0);\n"
    "    int first = scatteri_at.x;\n"
    "    scatteri_begin_ray(gl_FragCoord.xy / scatteri_froxels.xy * 2.0 / scatteri_window.zw);\n"
    "    scatteri_t1 = SCATTERI_FAR;\n"
    "    scatteri_find_ends();\n"
    "    scatteri_sum = first > 0 ? before.xyz : vec3(0.0);\n"
    "    scatteri_run = first > 0 ? before.w : 0.0;\n"
    "    scatteri_used = 0.0;\n"
    "    scatteri_slice1 = scatteri_fill_slice(first);\n"
    "#if SCATTERI_SLICES > 1\n"
    "    scatteri_slice2 = scatteri_fill_slice(first + 1);\n"
    "#endif\n"
    "#if SCATTERI_SLICES > 2\n"
    "    scatteri_slice3 = scatteri_fill_slice(first + 2);\n"
    "#endif\n"
    "#if SCATTERI_SLICES > 3\n"
    "    scatteri_slice4 = scatteri_fill_slice(first + 3);\n"
    "#endif\n"
    "#if SCATTERI_SLICES > 4\n"
    "    scatteri_slice5 = scatteri_fill_slice(first + 4);\n"
    "#endif\n"
    "#if SCATTERI_SLICES > 5\n"
    "    scatteri_slice6 = scatteri_fill_slice(first + 5);\n"
    "#endif\n"
    "#if SCATTERI_SLICES > 6\n"
    "    scatteri_slice7 = scatteri_fill_slice(first + 6);\n"
    "#endif\n"
    "    scatteri_running = vec4(scatteri_sum, scatteri_run);\n"
    "}\n";

/* From reduced resolution to every pixel. */
static const char scatteri_gl_upsample[] =
    "uniform highp sampler2D scatteri_before;\n"
    "out vec4 scatteri_color;\n"
    "float scatteri_distance(vec2 pixel) {\n"
    "    vec2 c = pixel * scatteri_window.zw - 1.0;\n"
    "    return scatteri_surface(pixel, c, length(scatteri_direction_at(c)));\n"
    "}\n"
    "/* Of the four neighbours at reduced resolution, those weigh most whose surfaces are as far away as the pixel's. */\n"
    "void main() {\n"
    "    float divide = scatteri_picture.y;\n"
    "    vec2 middle = floor(0.5 * vec2(divide)), size = 2.0 / scatteri_window.zw;\n"
    "    vec2 pixel = floor(gl_FragCoord.xy - scatteri_window.xy), at = (pixel - middle) / divide;\n"
    "    vec2 base = floor(at), f = at - base, last = ceil(size / divide) - 1.0;\n"
    "    float t = scatteri_distance(pixel + 0.5), weights = 0.0;\n"
    "    vec4 sum = vec4(0.0);\n"
    "    for (int i = 0; i < 4; i++) {\n"
    "        vec2 corner = vec2(float(i & 1), float(i >> 1));\n"
    "        vec2 texel = clamp(base + corner, vec2(0.0), last);\n"
    "        vec2 there = min(texel * divide + middle + 0.5, size - 0.5);\n"
    "        float other = scatteri_distance(there), off = abs(other - t) / min(other, t);\n"
    "        vec2 w = mix(1.0 - f, f, corner);\n"
    "        float weight = (w.x * w.y + 1.0e-4) / (1.0e-3 + min(off * off, 1.0e6));\n"
    "        sum += weight * texelFetch(scatteri_before, ivec2(texel), 0);\n"
    "        weights += weight;\n"
    "    }\n"
    "    scatteri_color = sum / weights;\n"
    "}\n";

/* For the host's shaders. */
static const char scatteri_gl_surface[] =
    "uniform highp sampler3D scatteri_froxel_volume;\n"
    "vec3 scatter_light_transmittance(int light, vec3 world) {\n"
    "    int per = int(scatteri_surface_batch.x), eye = int(scatteri_surface_batch.y);\n"
    "    int slot = light / per * 4 + light - light / per * per + eye;\n"
    "    vec3 x = world - scatteri_surface_ref.xyz, to = -scatteri_direction[slot].xyz;\n"
    "    float distance = SCATTERI_FAR;\n"
    "    if (slot >= 4 * min(16, 4 * int(scatteri_surface_batch.z)))\n"
    "        return vec3(1.0);\n"
    "    if (scatteri_light[slot].w < 1.5) {\n"
    "        vec3 away = scatteri_light[slot].xyz - x;\n"
    "        distance = length(away);\n"
    "        to = away / max(distance, 1.0e-30);\n"
    "    }\n"
    "#ifdef SCATTERI_BOUNDED\n"
    "    vec2 t = scatteri_clip_box(scatteri_bounds_min.xyz, scatteri_bounds_max.xyz, x, to, vec2(0.0, distance));\n"
    "    if (!(t.x < t.y))\n"
    "        return vec3(1.0);\n"
    "    x += t.x * to;\n"
    "    distance = max(distance - t.x, 0.0);\n"
    "#endif\n"
    "    return exp(-scatteri_extinction.xyz * scatteri_depth_to(slot, x, to, distance));\n"
    "}\n"
    "vec4 scatter_fog(vec4 premultiplied, vec3 world) {\n"
    "    vec4 x = vec4(world - scatteri_surface_ref.xyz, 1.0);\n"
    "    float w = dot(scatteri_froxel_w, x);\n"
    "    vec2 at = 0.5 + 0.5 * vec2(dot(scatteri_froxel_x, x), dot(scatteri_froxel_y, x)) / w;\n"
    "    float t = scatteri_froxel_eye.w > 0.5 ? length(x.xyz - scatteri_froxel_eye.xyz) : dot(scatteri_froxel_t, x);\n"
    "    float near = scatteri_surface_range.x, slices = log(max(t, near) / near) / scatteri_surface_range.y;\n"
    "    vec4 fog = textureLod(scatteri_froxel_volume, vec3(at, slices), 0.0);\n"
    "    fog *= clamp(t / scatteri_surface_range.z, 0.0, 1.0); /* in front of the first slice's middle */\n"
    "    vec3 through = exp(-scatteri_extinction.xyz * fog.w);\n"
    "#ifdef SCATTERI_FOG\n"
    /* Behind the last slice constant and height fog go on, as bright as in that slice. */
    "    float far = scatteri_surface_range.w;\n"
    "    if (t > far) {\n"
    "        vec3 d = (x.xyz - scatteri_froxel_eye.xyz) / t;\n"
    "        float before = 1.0 - 1.5 / vec3(textureSize(scatteri_froxel_volume, 0)).z;\n"
    "        vec4 last = textureLod(scatteri_froxel_volume, vec3(at, before), 0.0);\n"
    "        vec3 gone = max(exp(-scatteri_extinction.xyz * last.w) - through, 1.0e-6);\n"
    "        vec3 rest = exp(-scatteri_extinction.xyz *\n"
    "                        scatteri_fog_depth(x.xyz - (t - far) * d, d, t - far));\n"
    "        fog.xyz += max(fog.xyz - last.xyz, 0.0) / gone * through * (1.0 - rest);\n"
    "        through *= rest;\n"
    "    }\n"
    "#endif\n"
    "    return vec4(premultiplied.xyz * through + premultiplied.w * fog.xyz,\n"
    "                premultiplied.w);\n"
    "}\n";

/* The picture. */
static const char scatteri_gl_view[] =
    "out vec4 scatteri_color;\n"
    "/* Depth of the medium on the whole ray. */\n"
    "float scatteri_end_depth() {\n"
    "    float depth = -scatteri_start;\n"
    "#ifdef SCATTERI_GAUSSIANS\n"
    "    depth += scatteri_gaussians_at(scatteri_t1).y;\n"
    "#endif\n"
    "#ifdef SCATTERI_FIELD\n"
    "    depth += scatteri_whole_field();\n"
    "#endif\n"
    "#ifdef SCATTERI_FOG\n"
    "    depth += scatteri_fog_depth(scatteri_o + scatteri_t0 * scatteri_d, scatteri_d, scatteri_t1 - scatteri_t0);\n"
    "#endif\n"
    "    return max(depth, 0.0);\n"
    "}\n"
    "/* Radiance of the ray into scatteri_sum; returns its depth. */\n"
    "float scatteri_look(float panel) {\n"
    "    scatteri_sum = vec3(0.0);\n"
    "    scatteri_used = 0.0;\n"
    "    scatteri_shown = vec2(0.0);\n"
    "    scatteri_panel_size = panel;\n"
    "    if (!(scatteri_t0 < scatteri_t1))\n"
    "        return 0.0;\n"
    "#ifdef SCATTERI_MARCH\n"
    "    return scatteri_march();\n"
    "#else\n"
    "#ifndef SCATTERI_TRANSMITTANCE\n"
    "    scatteri_integrate();\n"
    "#endif\n"
    "    return scatteri_end_depth();\n"
    "#endif\n"
    "}\n"
    "void main() {\n"
    "    scatteri_begin_ray(scatteri_pixel());\n"
    "#ifdef SCATTERI_MASK\n"
    "    scatteri_read_mask();\n"
    "#endif\n"
    "    scatteri_find_ends();\n"
    "    float depth = scatteri_look(scatteri_nodes.y);\n"
    "    vec3 through = scatteri_through(depth);\n"
    "    float mean = dot(through, vec3(0.33333333));\n"
    "#ifdef SCATTERI_TRANSMITTANCE\n"
    "    scatteri_color = vec4(through, mean);\n"
    "#elif defined(SCATTERI_MORE)\n"
    "    scatteri_color = vec4(scatteri_sum, 0.0);\n"
    "#else\n"
    "    scatteri_color = vec4(scatteri_sum, 1.0 - mean);\n"
    "#endif\n"
    "#ifdef SCATTERI_SHOW\n"
    "    int show = int(scatteri_show.x);\n"
    "    vec3 sum = scatteri_sum, shown = sum;\n"
    "    if (show == 1)\n"
    "        shown = vec3(depth);\n"
    "    else if (show == 2)\n"
    "        shown = vec3(scatteri_shown.y / max(scatteri_shown.x, 1.0e-30));\n"
    "    else if (show == 3)\n"
    "        shown = through;\n"
    "    else if (show == 5)\n"
    "        shown = vec3(scatteri_used / 256.0);\n"
    "    else if (show == 6) {\n"
    "        scatteri_look(0.5 * scatteri_nodes.y);\n"
    "        shown = abs(sum - scatteri_sum);\n"
    "    }\n"
    "#ifdef SCATTERI_MORE\n"
    "    scatteri_color = show == 1 || show == 3 ? vec4(0.0) : vec4(shown, 0.0);\n"
    "#else\n"
    "    scatteri_color = vec4(shown, 1.0);\n"
    "#endif\n"
    "#endif\n"
    "}\n";

/* --- tone mapping --- */

/* For any pipeline, behind the chapters prelude and tone: what the three passes below compute. */
static const char scatteri_gl_photographic[] =
    /* Logarithm of a pixel's luminance and 1; nothing where it has none: black, infinite, NaN. */
    "vec2 scatteri_log_luminance(vec3 rgb) {\n"
    "    float l = scatteri_luminance(rgb);\n"
    "    return l > 0.0 && l <= 3.4028234e38 ? vec2(log(l), 1.0) : vec2(0.0);\n"
    "}\n"
    /* From the sums of that over a picture; 0: all of it is black. */
    "float scatteri_log_average(vec2 sums) {\n"
    "    return sums.y > 0.0 ? exp(sums.x / sums.y) : 0.0;\n"
    "}\n"
    "vec3 scatteri_tone_map(vec3 rgb, float key, float white, float average) {\n"
    "    vec3 scaled = (average > 0.0 ? key / average : 0.0) * rgb;\n"
    "    float l = scatteri_luminance(scaled);\n"
    "    return (l > 0.0 ? scatteri_reinhard(l, white) / l : 1.0) * scaled;\n"
    "}\n"
    /* 0 where c is no number. */
    "float scatteri_srgb(float c) {\n"
    "    float v = c > 0.0 ? min(c, 1.0) : 0.0;\n"
    "    return v <= 0.0031308 ? 12.92 * v : 1.055 * pow(v, 1.0 / 2.4) - 0.055;\n"
    "}\n";

static const char scatteri_gl_picture[] =
    "vec2 scatteri_logs_at(ivec2 texel) {\n"
    "    return scatteri_log_luminance(texelFetch(scatteri_before, texel, 0).xyz);\n"
    "}\n";

static const char scatteri_gl_logs[] =
    "vec2 scatteri_logs_at(ivec2 texel) {\n"
    "    return texelFetch(scatteri_before, texel, 0).xy;\n"
    "}\n";

static const char scatteri_gl_before[] = "uniform highp sampler2D scatteri_before;\n";

/* Sums over 8 x 8 texels; scatteri_at: texel to begin at, width and height of what there is. Row by row, so that few
   roundings follow each other. */
static const char scatteri_gl_blocks_of_8[] =
    "uniform highp ivec4 scatteri_at;\n"
    "out vec4 scatteri_sums;\n"
    "void main() {\n"
    "    ivec2 first = 8 * ivec2(gl_FragCoord.xy), last = min(first + 8, scatteri_at.zw);\n"
    "    vec2 sum = vec2(0.0);\n"
    "    for (int y = first.y; y < last.y; y++) {\n"
    "        vec2 row = vec2(0.0);\n"
    "        for (int x = first.x; x < last.x; x++)\n"
    "            row += scatteri_logs_at(scatteri_at.xy + ivec2(x, y));\n"
    "        sum += row;\n"
    "    }\n"
    "    scatteri_sums = vec4(sum, 0.0, 0.0);\n"
    "}\n";

/* scatteri_at: from pixel to texel, 1 for sRGB. scatteri_tone: key, white, log average or 0: of the sums. */
static const char scatteri_gl_tone_picture[] =
    "uniform highp sampler2D scatteri_before_too;\n"
    "uniform highp ivec4 scatteri_at;\n"
    "uniform highp vec4 scatteri_tone;\n"
    "out vec4 scatteri_color;\n"
    "void main() {\n"
    "    vec4 c = texelFetch(scatteri_before, ivec2(gl_FragCoord.xy) + scatteri_at.xy, 0);\n"
    "    float average = scatteri_tone.z;\n"
    "    if (!(average > 0.0))\n"
    "        average = scatteri_log_average(texelFetch(scatteri_before_too, ivec2(0), 0).xy);\n"
    "    c.xyz = scatteri_tone_map(c.xyz, scatteri_tone.x, scatteri_tone.y, average);\n"
    "    if (scatteri_at.z != 0)\n"
    "        c.xyz = vec3(scatteri_srgb(c.x), scatteri_srgb(c.y), scatteri_srgb(c.z));\n"
    "    scatteri_color = c;\n"
    "}\n";

typedef struct scatteri_gl_chapter {
    const char *name, *text;
} scatteri_gl_chapter;

static const scatteri_gl_chapter scatteri_gl_chapters[] = {{"prelude", scatteri_gl_prelude},
                                                           SCATTERI_GL_CORE
                                                           {"blocks", scatteri_gl_blocks},
                                                           {"whole", scatteri_gl_whole},
                                                           {"table", scatteri_gl_table},
                                                           {"gaussians", scatteri_gl_gaussians},
                                                           {"density", scatteri_gl_density},
                                                           {"rays", scatteri_gl_rays},
                                                           {"one_volume", scatteri_gl_one_volume},
                                                           {"four_volumes", scatteri_gl_four_volumes},
                                                           {"volume", scatteri_gl_volume},
                                                           {"slices", scatteri_gl_slices},
                                                           {"cells", scatteri_gl_cells},
                                                           {"inject", scatteri_gl_inject_cells},
                                                           {"quad", scatteri_gl_splat_quad},
                                                           {"splat", scatteri_gl_splat},
                                                           {"facing", scatteri_gl_facing},
                                                           {"closed", scatteri_gl_closed},
                                                           {"columns", scatteri_gl_columns},
                                                           {"sums", scatteri_gl_sums},
                                                           {"polar", scatteri_gl_polar},
                                                           {"waves", scatteri_gl_waves},
                                                           {"wave_quad", scatteri_gl_wave_quad},
                                                           {"wave", scatteri_gl_wave},
                                                           {"merge", scatteri_gl_merge},
                                                           {"nearest", scatteri_gl_nearest},
                                                           {"distance", scatteri_gl_distance},
                                                           {"spaced", scatteri_gl_spaced},
                                                           {"masking", scatteri_gl_masking},
                                                           {"camera", scatteri_gl_camera},
                                                           {"eye", scatteri_gl_eye},
                                                           {"masked", scatteri_gl_masked},
                                                           {"mask", scatteri_gl_mask},
                                                           {"ends", scatteri_gl_ends},
                                                           {"shadow_maps", scatteri_gl_shadow_maps},
                                                           {"visible", scatteri_gl_visible},
                                                           {"depth_to", scatteri_gl_depth_to},
                                                           {"scattering", scatteri_gl_scattering},
                                                           {"nodes", scatteri_gl_nodes},
                                                           {"panels", scatteri_gl_panels},
                                                           {"pieces", scatteri_gl_pieces},
                                                           {"cuts", scatteri_gl_cuts},
                                                           {"smooth", scatteri_gl_smooth},
                                                           {"ray", scatteri_gl_ray},
                                                           {"every_light", scatteri_gl_every_light},
                                                           {"march", scatteri_gl_march},
                                                           {"froxels", scatteri_gl_froxels},
                                                           {"froxels_main", scatteri_gl_froxels_main},
                                                           {"upsample", scatteri_gl_upsample},
                                                           {"surface", scatteri_gl_surface},
                                                           {"surface_blocks", scatteri_gl_surface_blocks},
                                                           {"view", scatteri_gl_view},
                                                           {"photographic", scatteri_gl_photographic},
                                                           {"before", scatteri_gl_before},
                                                           {"picture", scatteri_gl_picture},
                                                           {"logs", scatteri_gl_logs},
                                                           {"blocks_of_8", scatteri_gl_blocks_of_8},
                                                           {"tone_picture", scatteri_gl_tone_picture}};

/* --------------------------------------------------------------------------------------- >>program */

/* What a scene has and needs; each is a macro SCATTERI_name in its shaders. */
#define SCATTERI_GL_FEATURES(F)                                                                    \
    F(GAUSSIANS) /* in closed form */                                                              \
    F(FIELD)     /* density from a 3D texture */                                                   \
    F(FOG)       /* constant and height fog */                                                     \
    F(BOUNDED)                                                                                     \
    F(COLORED) /* extinction differs between the channels */                                       \
    F(EMISSION)                                                                                    \
    F(ONE_LOBE) /* phase function; neither: isotropic */                                           \
    F(TWO_LOBES)                                                                                   \
    F(FEW_THIN) /* Gaussians that a block holds, none of them opaque */                            \
    F(SPOT)     /* kinds of lights in the batch */                                                 \
    F(DIRECTIONAL)                                                                                 \
    F(CLOSED) /* depth of Gaussians to the lights in closed form */                                \
    F(CELLS)  /* from cells of the local box */                                                    \
    F(POLAR)  /* from columns around the lights */                                                 \
    F(EYE)    /* depth to the eye from cells, too */                                               \
    F(MARCH)  /* uniform steps */                                                                  \
    F(SHADOW_2D_0)                                                                                 \
    /* a light has a shadow map */ F(SHADOW_ARRAY_0) F(SHADOW_CUBE_0) F(SHADOW_2D_1)               \
        F(SHADOW_ARRAY_1) F(SHADOW_CUBE_1) F(SHADOW_2D_2) F(SHADOW_ARRAY_2) F(SHADOW_CUBE_2)       \
            F(SHADOW_2D_3) F(SHADOW_ARRAY_3) F(SHADOW_CUBE_3)                                      \
                F(TRANSMITTANCE) /* the pass gives T alone */                                      \
        F(MORE)                  /* a further batch: only L of its lights */                       \
        F(SHOW)                  /* one of scatter_gl_show instead of the picture */               \
        F(DISTANCE)              /* the field's texture holds the distance to density, too */      \
        F(RAYS)                  /* depth of the field to the lights by rays through it */         \
        F(MASK)                  /* a pass before tells where the field begins and ends */

#define SCATTERI_GL_FEATURE_INDEX(name) SCATTERI_GL_INDEX_##name,
#define SCATTERI_GL_FEATURE_NAME(name) #name,

enum { SCATTERI_GL_FEATURES(SCATTERI_GL_FEATURE_INDEX) SCATTERI_GL_FEATURE_COUNT };
#define SCATTERI_GL_HAS(name) ((scatteri_gl_features)1 << SCATTERI_GL_INDEX_##name)

static const char *const scatteri_gl_feature_names[] = {
    SCATTERI_GL_FEATURES(SCATTERI_GL_FEATURE_NAME)};

/* The passes: which chapters make up their two shaders, in order. */
typedef struct scatteri_gl_pass {
    const char *name, *vertex, *fragment;
    scatteri_gl_features knows; /* features that its text depends on */
} scatteri_gl_pass;

enum {
    SCATTERI_GL_PASS_VIEW,
    SCATTERI_GL_PASS_FROXELS,
    SCATTERI_GL_PASS_UPSAMPLE,
    SCATTERI_GL_PASS_INJECT,   /* density of grids and Gaussians in cells */
    SCATTERI_GL_PASS_SPLAT,    /* Gaussians as quads */
    SCATTERI_GL_PASS_CLOSED,   /* depth in closed form in cells */
    SCATTERI_GL_PASS_POLAR,    /* depth in columns around the sources */
    SCATTERI_GL_PASS_WAVE,     /* depth by upwind differences: one wave */
    SCATTERI_GL_PASS_MERGE,    /* all waves into a volume */
    SCATTERI_GL_PASS_DISTANCE, /* to density, squared: along x, then along y */
    SCATTERI_GL_PASS_SPACED,   /* along z; density and distance */
    SCATTERI_GL_PASS_MASK,     /* where the field begins and ends on the rays */
    SCATTERI_GL_PASS_LOGS,     /* of luminance, summed over blocks of a picture */
    SCATTERI_GL_PASS_SUMS,     /* of these, over blocks */
    SCATTERI_GL_PASS_TONE,     /* the picture, by the last of them */
    SCATTERI_GL_PASSES
};

#define SCATTERI_GL_MATHS "prelude vector erf span quick integrals phase maps tone "
#define SCATTERI_GL_RAYS                                                                           \
    SCATTERI_GL_MATHS "blocks table gaussians density rays one_volume volume camera eye masked "   \
                      "ends shadow_maps "                                                          \
                      "visible depth_to scattering nodes every_light "

static const scatteri_gl_pass scatteri_gl_passes[] = {
    {"view", "prelude whole", SCATTERI_GL_RAYS "panels pieces cuts smooth ray march view",
     ~(scatteri_gl_features)0},
    {"froxels", "prelude whole", SCATTERI_GL_RAYS "froxels froxels_main",
     ~(SCATTERI_GL_HAS(SHOW) | SCATTERI_GL_HAS(TRANSMITTANCE) | SCATTERI_GL_HAS(MARCH) |
       SCATTERI_GL_HAS(MASK))},
    {"upsample", "prelude whole", "prelude vector blocks density camera upsample", 0},
    {"inject", "prelude whole", "prelude blocks table density cells slices inject",
     SCATTERI_GL_HAS(GAUSSIANS) | SCATTERI_GL_HAS(FIELD)},
    {"splat", "prelude blocks table cells quad", "prelude blocks cells slices splat", 0},
    {"closed", "prelude whole",
     "prelude vector erf span quick blocks table gaussians density cells facing slices closed",
     SCATTERI_GL_HAS(BOUNDED)},
    {"polar", "prelude whole",
     "prelude vector erf span quick maps blocks table density columns slices sums polar",
     SCATTERI_GL_HAS(GAUSSIANS) | SCATTERI_GL_HAS(FIELD) | SCATTERI_GL_HAS(BOUNDED)},
    {"wave", "prelude blocks waves wave_quad", "prelude blocks waves cells wave", 0},
    {"merge", "prelude whole", "prelude blocks waves slices merge", 0},
    {"distance", "prelude whole", "prelude blocks density nearest slices distance",
     SCATTERI_GL_HAS(FIELD)},
    {"spaced", "prelude whole", "prelude blocks nearest slices spaced", 0},
    {"mask", "prelude whole",
     "prelude vector erf span integrals masking blocks density rays camera eye masked ends mask",
     SCATTERI_GL_HAS(FOG) | SCATTERI_GL_HAS(BOUNDED) | SCATTERI_GL_HAS(DISTANCE)},
    {"logs", "prelude whole", "prelude tone photographic before picture blocks_of_8", 0},
    {"sums", "prelude whole", "prelude before logs blocks_of_8", 0},
    {"tone", "prelude whole", "prelude tone photographic before tone_picture", 0},
};

static const struct {
    const char *chapter;
    scatteri_gl_features features;
} scatteri_gl_needed[] = {
    {"phase", SCATTERI_GL_HAS(ONE_LOBE) | SCATTERI_GL_HAS(TWO_LOBES)},
    {"tone", SCATTERI_GL_HAS(SPOT)},
};

/* A text in parts. */
typedef struct scatteri_gl_source {
    int count;
    const char *parts[64];
    char head[1600]; /* version and macros */
} scatteri_gl_source;

/* Whether `word` is among the words of `list`, which blanks separate; returns where it goes on, or NULL at the end. */
static const char *scatteri_gl_next_word(const char *list, char *word, size_t room)
{
    size_t n = 0;
    while (*list == ' ')
        list++;
    while (*list != ' ' && *list != 0 && n + 1 < room)
        word[n++] = *list++;
    word[n] = 0;
    return n > 0 ? list : NULL;
}

static void scatteri_gl_say(char *text, size_t room, const char *format, ...)
{
    const size_t used = strlen(text);
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text + used, room - used, format, arguments);
    va_end(arguments);
}

/* Passes that know of features need some chapters only where one of those that call for it is there. */
static int scatteri_gl_needs(const char *chapter, scatteri_gl_key key)
{
    size_t i;
    for (i = 0; i < sizeof scatteri_gl_needed / sizeof *scatteri_gl_needed; i++)
        if (strcmp(scatteri_gl_needed[i].chapter, chapter) == 0 &&
            (scatteri_gl_needed[i].features & scatteri_gl_passes[key.pass].knows) != 0)
            return (scatteri_gl_needed[i].features & key.features) != 0;
    return 1;
}

/* Text of a shader: version (if any), macros, and of its chapters those that the features call for. */
static void scatteri_gl_assemble(const char *version, scatteri_gl_key key, const char *chapters,
                                 scatteri_gl_source *source)
{
    const char *rest = chapters;
    char word[32];
    int i;
    source->head[0] = 0;
    if (version != NULL)
        scatteri_gl_say(source->head, sizeof source->head,
                        "#version %s\n#define SCATTERI_SLICES %d\n", version, key.slices);
    scatteri_gl_say(source->head, sizeof source->head, "#define SCATTERI_COUNT %s%.0d\n",
                    key.count > 0 ? "" : "int(scatteri_counts.x)", key.count);
    for (i = 0; i < (int)SCATTERI_GL_FEATURE_COUNT; i++)
        if (key.features >> i & 1)
            scatteri_gl_say(source->head, sizeof source->head, "#define SCATTERI_%s\n",
                            scatteri_gl_feature_names[i]);
    source->count = 0;
    source->parts[source->count++] = source->head;
    while ((rest = scatteri_gl_next_word(rest, word, sizeof word)) != NULL)
        if (scatteri_gl_needs(word, key))
            source->parts[source->count++] = scatter_gl_glsl(word);
}

/* All parts with numbered lines behind what the compiler said. */
static void scatteri_gl_log_source(scatter_gl *f, const char *pass, const char *said,
                                   const scatteri_gl_source *source)
{
    size_t room = strlen(said) + 256;
    char *text, *out;
    int i, line = 1;
    for (i = 0; i < source->count; i++) {
        const char *c;
        room += strlen(source->parts[i]) + 8;
        for (c = source->parts[i]; *c != 0; c++)
            room += *c == '\n' ? 8 : 0;
    }
    text = f->host.log != NULL ? (char *)scatteri_allocate(&f->host, room) : NULL;
    if (text == NULL)
        return;
    out = text +
          sprintf(text, "the shader of pass '%s' does not compile: %s\n%4d  ", pass, said, line);
    for (i = 0; i < source->count; i++) {
        const char *c;
        for (c = source->parts[i]; *c != 0; c++) {
            *out++ = *c;
            if (*c == '\n')
                out += sprintf(out, "%4d  ", ++line);
        }
    }
    *out = 0;
    f->host.log(f->host.user, SCATTER_UNSUPPORTED, text);
    scatteri_release(&f->host, text);
}

static unsigned scatteri_gl_compile(scatter_gl *f, unsigned type, const char *pass,
                                    const scatteri_gl_source *source)
{
    const scatteri_gl_functions *gl = &f->gl;
    const unsigned shader = gl->CreateShader(type);
    char said[2048] = "";
    int done = 0;
    gl->ShaderSource(shader, source->count, source->parts, NULL);
    gl->CompileShader(shader);
    gl->GetShaderiv(shader, SCATTERI_GL_COMPILED, &done);
    if (done)
        return shader;
    gl->GetShaderInfoLog(shader, (int)sizeof said, NULL, said);
    scatteri_gl_log_source(f, pass, said, source);
    gl->DeleteShader(shader);
    return 0;
}

static const char *scatteri_gl_version_text(const scatter_gl *f)
{
    if (f->es)
        return f->version >= 310 ? "310 es" : "300 es";
    return f->version >= 450 ? "450 core" : f->version >= 410 ? "410 core" : "330 core";
}

/* Samplers of a linked program get their units; it becomes current. */
static void scatteri_gl_set_units(scatter_gl *f, unsigned program, const char *const *names,
                                  int count, int first)
{
    int i;
    f->gl.UseProgram(program);
    for (i = 0; i < count; i++) {
        const int location = f->gl.GetUniformLocation(program, names[i]);
        if (location >= 0)
            f->gl.Uniform1i(location, first + i);
    }
}

/* Uniform blocks of a linked program get their bindings. */
static void scatteri_gl_set_blocks(scatter_gl *f, unsigned program, const char *const *names,
                                   int count, int first)
{
    int i;
    for (i = 0; i < count; i++) {
        const unsigned index = f->gl.GetUniformBlockIndex(program, names[i]);
        if (index != SCATTERI_GL_INVALID_INDEX)
            f->gl.UniformBlockBinding(program, index, (unsigned)(first + i));
    }
}

static void scatteri_gl_set_inputs(scatter_gl *f, unsigned program)
{
    static const char *const units[SCATTERI_GL_UNITS] = {
        "scatteri_gaussians", "scatteri_rules",   "scatteri_field",     "scatteri_volume",
        "scatteri_scene",     "scatteri_shadow0", "scatteri_shadow1",   "scatteri_shadow2",
        "scatteri_shadow3",   "scatteri_before",  "scatteri_before_too"};
    static const char *const blocks[] = {"scatteri_medium_block", "scatteri_lights_block",
                                         "scatteri_view_block"};
    scatteri_gl_set_units(f, program, units, SCATTERI_GL_UNITS, 0);
    scatteri_gl_set_blocks(f, program, blocks, 3, 0);
}

static unsigned scatteri_gl_link(scatter_gl *f, scatteri_gl_key key)
{
    const scatteri_gl_functions *gl = &f->gl;
    const scatteri_gl_pass *pass = &scatteri_gl_passes[key.pass];
    scatteri_gl_source source;
    unsigned vertex, fragment, program = 0;
    char said[2048] = "";
    int done = 0;
    scatteri_gl_assemble(scatteri_gl_version_text(f), key, pass->fragment, &source);
    fragment = scatteri_gl_compile(f, SCATTERI_GL_FRAGMENT, pass->name, &source);
    scatteri_gl_assemble(scatteri_gl_version_text(f), key, pass->vertex, &source);
    vertex = scatteri_gl_compile(f, SCATTERI_GL_VERTEX, pass->name, &source);
    if (vertex != 0 && fragment != 0) {
        program = gl->CreateProgram();
        gl->AttachShader(program, vertex);
        gl->AttachShader(program, fragment);
        gl->LinkProgram(program);
        gl->GetProgramiv(program, SCATTERI_GL_LINKED, &done);
    }
    if (vertex != 0)
        gl->DeleteShader(vertex);
    if (fragment != 0)
        gl->DeleteShader(fragment);
    if (done)
        return program;
    if (program != 0) {
        gl->GetProgramInfoLog(program, (int)sizeof said, NULL, said);
        scatteri_fail(&f->host, SCATTER_UNSUPPORTED, "the shaders of pass '%s' do not link: %s",
                      pass->name, said);
        gl->DeleteProgram(program);
    }
    return 0;
}

static scatter_result scatteri_gl_room_for_program(scatter_gl *f)
{
    const int room = f->program_room > 0 ? 2 * f->program_room : 32;
    scatteri_gl_program *programs;
    if (f->program_count < f->program_room)
        return SCATTER_OK;
    programs = (scatteri_gl_program *)scatteri_allocate(&f->host, (size_t)room * sizeof *programs);
    if (programs == NULL)
        return scatteri_fail(&f->host, SCATTER_OUT_OF_MEMORY,
                             "host.allocate gave no memory for %d programs", room);
    if (f->program_count > 0)
        memcpy(programs, f->programs, (size_t)f->program_count * sizeof *programs);
    scatteri_release(&f->host, f->programs);
    f->programs = programs;
    f->program_room = room;
    return SCATTER_OK;
}

/* The program of a key, compiled if there is none yet. */
static scatter_result scatteri_gl_find_program(scatter_gl *f, scatteri_gl_key key,
                                               const scatteri_gl_program **out)
{
    scatteri_gl_program *p;
    scatter_result result;
    int i;
    for (i = 0; i < f->program_count; i++) {
        *out = &f->programs[i];
        if ((*out)->key.pass == key.pass && (*out)->key.features == key.features &&
            (*out)->key.slices == key.slices && (*out)->key.count == key.count)
            return SCATTER_OK;
    }
    result = scatteri_gl_room_for_program(f);
    if (result != SCATTER_OK)
        return result;
    p = &f->programs[f->program_count];
    p->key = key;
    p->name = scatteri_gl_link(f, key);
    if (p->name == 0)
        return SCATTER_UNSUPPORTED;
    scatteri_gl_set_inputs(f, p->name);
    p->at = f->gl.GetUniformLocation(p->name, "scatteri_at");
    p->tone = f->gl.GetUniformLocation(p->name, "scatteri_tone");
    f->program_count++;
    f->stats.programs++;
    *out = p;
    return SCATTER_OK;
}

/* ----------------------------------------------------------------------------------------- >>state
   Everything that the passes touch, saved before and restored after each call. Where versions know state per draw
   buffer, all of them are saved; of viewports only the first is touched. */

enum { SCATTERI_GL_MOST_BUFFERS = 8, SCATTERI_GL_TARGETS = 4 };

static const unsigned scatteri_gl_targets[SCATTERI_GL_TARGETS] = {
    SCATTERI_GL_TEXTURE_2D, SCATTERI_GL_TEXTURE_3D, SCATTERI_GL_ARRAY_2D, SCATTERI_GL_CUBE};
static const unsigned scatteri_gl_target_bindings[SCATTERI_GL_TARGETS] = {0x8069, 0x806A, 0x8C1D,
                                                                          0x8514};

/* Switches that would change or discard what a pass draws; all are off during it. */
static const struct {
    unsigned name;
    int es; /* version of OpenGL ES from which on it is there; 0: never */
} scatteri_gl_switches[] = {{0x0B71, 300}, /* DEPTH_TEST */
                            {0x0B90, 300}, /* STENCIL_TEST */
                            {0x0B44, 300}, /* CULL_FACE */
                            {0x8C89, 300}, /* RASTERIZER_DISCARD */
                            {0x809E, 300}, /* SAMPLE_ALPHA_TO_COVERAGE */
                            {0x80A0, 300}, /* SAMPLE_COVERAGE */
                            {0x809F, 0},   /* SAMPLE_ALPHA_TO_ONE */
                            {0x8E51, 310}, /* SAMPLE_MASK */
                            {0x0BF2, 0},   /* COLOR_LOGIC_OP */
                            {0x0B41, 0},   /* POLYGON_SMOOTH */
                            {0x3000, 0},   /* CLIP_DISTANCE0 and the others */
                            {0x3001, 0},   {0x3002, 0}, {0x3003, 0}, {0x3004, 0},
                            {0x3005, 0},   {0x3006, 0}, {0x3007, 0}};

enum { SCATTERI_GL_SWITCHES = sizeof scatteri_gl_switches / sizeof *scatteri_gl_switches };

/* Pixel storage that an upload depends on, and what it expects. */
static const struct {
    unsigned name;
    int value, es;
} scatteri_gl_unpack[] = {
    {0x0CF5, 2, 1}, /* UNPACK_ALIGNMENT: of rows of 16 bits */
    {0x0CF2, 0, 1}, /* UNPACK_ROW_LENGTH */
    {0x806E, 0, 1}, /* UNPACK_IMAGE_HEIGHT */
    {0x0CF4, 0, 1}, /* UNPACK_SKIP_PIXELS */
    {0x0CF3, 0, 1}, /* UNPACK_SKIP_ROWS */
    {0x806D, 0, 1}, /* UNPACK_SKIP_IMAGES */
    {0x0CF0, 0, 0}, /* UNPACK_SWAP_BYTES */
    {0x0CF1, 0, 0}  /* UNPACK_LSB_FIRST */
};

enum { SCATTERI_GL_UNPACKS = sizeof scatteri_gl_unpack / sizeof *scatteri_gl_unpack };

typedef struct scatteri_gl_state {
    int program, vertex_array, framebuffer, unit, uniform_buffer, unpack_buffer;
    int textures[SCATTERI_GL_UNITS][SCATTERI_GL_TARGETS], samplers[SCATTERI_GL_UNITS];
    int block_buffers[3];
    int64_t block_starts[3], block_sizes[3];
    int viewport[4];
    float viewport_exact[4];
    int polygon_mode[2], clip_origin, clip_depth;
    int blend_functions[SCATTERI_GL_MOST_BUFFERS][4], blend_equations[SCATTERI_GL_MOST_BUFFERS][2];
    int unpack[SCATTERI_GL_UNPACKS];
    scatteri_gl_byte blends[SCATTERI_GL_MOST_BUFFERS], scissor, on[SCATTERI_GL_SWITCHES];
    scatteri_gl_byte mask[SCATTERI_GL_MOST_BUFFERS][4];
} scatteri_gl_state;

static int scatteri_gl_get(const scatter_gl *f, unsigned name)
{
    int value = 0;
    f->gl.GetIntegerv(name, &value);
    return value;
}

static int scatteri_gl_has_switch(const scatter_gl *f, int i)
{
    const int since = scatteri_gl_switches[i].es;
    return !f->es || (since != 0 && f->version >= since);
}

static void scatteri_gl_switch(const scatter_gl *f, unsigned name, int on)
{
    if (on)
        f->gl.Enable(name);
    else
        f->gl.Disable(name);
}

/* Draw buffers whose masks and blending are apart from each other; 1 where versions know only all of them together. */
static int scatteri_gl_indexed(const scatter_gl *f)
{
    return f->gl.ColorMaski != NULL && f->gl.Enablei != NULL ? f->draw_buffers : 1;
}

/* Functions and equations; apart for each draw buffer since OpenGL 4.0. */
static void scatteri_gl_save_blending(const scatter_gl *f, scatteri_gl_state *s)
{
    static const unsigned names[] = {
        SCATTERI_GL_BLEND_SRC_RGB,      SCATTERI_GL_BLEND_DST_RGB,
        SCATTERI_GL_BLEND_SRC_ALPHA,    SCATTERI_GL_BLEND_DST_ALPHA,
        SCATTERI_GL_BLEND_EQUATION_RGB, SCATTERI_GL_BLEND_EQUATION_ALPHA};
    const int apart = f->gl.BlendFuncSeparatei != NULL;
    int i, k;
    for (i = 0; i < (apart ? f->draw_buffers : 1); i++)
        for (k = 0; k < 6; k++) {
            int *to = k < 4 ? &s->blend_functions[i][k] : &s->blend_equations[i][k - 4];
            if (apart)
                f->gl.GetIntegeri_v(names[k], (unsigned)i, to);
            else
                f->gl.GetIntegerv(names[k], to);
        }
}

static void scatteri_gl_restore_blending(const scatter_gl *f, const scatteri_gl_state *s)
{
    const int apart = f->gl.BlendFuncSeparatei != NULL;
    int i;
    for (i = 0; i < (apart ? f->draw_buffers : 1); i++) {
        const unsigned sc = (unsigned)s->blend_functions[i][0],
                       tc = (unsigned)s->blend_functions[i][1];
        const unsigned sa = (unsigned)s->blend_functions[i][2],
                       ta = (unsigned)s->blend_functions[i][3];
        const unsigned c = (unsigned)s->blend_equations[i][0],
                       a = (unsigned)s->blend_equations[i][1];
        if (apart) {
            f->gl.BlendFuncSeparatei((unsigned)i, sc, tc, sa, ta);
            f->gl.BlendEquationSeparatei((unsigned)i, c, a);
        } else {
            f->gl.BlendFuncSeparate(sc, tc, sa, ta);
            f->gl.BlendEquationSeparate(c, a);
        }
    }
}

static void scatteri_gl_save_output(const scatter_gl *f, scatteri_gl_state *s)
{
    const scatteri_gl_functions *gl = &f->gl;
    const int buffers = scatteri_gl_indexed(f);
    int i;
    for (i = 0; i < buffers; i++) {
        if (buffers > 1) {
            s->blends[i] = gl->IsEnabledi(SCATTERI_GL_BLEND, (unsigned)i);
            gl->GetBooleani_v(SCATTERI_GL_COLOR_WRITEMASK, (unsigned)i, s->mask[i]);
        } else {
            s->blends[i] = gl->IsEnabled(SCATTERI_GL_BLEND);
            gl->GetBooleanv(SCATTERI_GL_COLOR_WRITEMASK, s->mask[i]);
        }
    }
    scatteri_gl_save_blending(f, s);
    gl->GetIntegerv(SCATTERI_GL_VIEWPORT, s->viewport);
    if (gl->ViewportIndexedf != NULL)
        gl->GetFloati_v(SCATTERI_GL_VIEWPORT, 0, s->viewport_exact);
    s->scissor = gl->IsEnabled(SCATTERI_GL_SCISSOR_TEST);
    for (i = 0; i < (int)SCATTERI_GL_SWITCHES; i++)
        if (scatteri_gl_has_switch(f, i))
            s->on[i] = gl->IsEnabled(scatteri_gl_switches[i].name);
    if (!f->es)
        gl->GetIntegerv(SCATTERI_GL_POLYGON_MODE, s->polygon_mode);
    s->clip_origin = gl->ClipControl != NULL ? scatteri_gl_get(f, SCATTERI_GL_CLIP_ORIGIN) : 0;
    s->clip_depth = gl->ClipControl != NULL ? scatteri_gl_get(f, SCATTERI_GL_CLIP_DEPTH_MODE) : 0;
}

static void scatteri_gl_save_input(const scatter_gl *f, scatteri_gl_state *s)
{
    const scatteri_gl_functions *gl = &f->gl;
    unsigned i, t;
    s->unit = scatteri_gl_get(f, SCATTERI_GL_ACTIVE_TEXTURE);
    for (i = 0; i < (unsigned)SCATTERI_GL_UNITS; i++) {
        gl->ActiveTexture(SCATTERI_GL_TEXTURE_0 + i);
        for (t = 0; t < (unsigned)SCATTERI_GL_TARGETS; t++)
            gl->GetIntegerv(scatteri_gl_target_bindings[t], &s->textures[i][t]);
        gl->GetIntegerv(SCATTERI_GL_SAMPLER_BINDING, &s->samplers[i]);
    }
    s->uniform_buffer = scatteri_gl_get(f, 0x8A28);
    for (i = 0; i < 3; i++) {
        gl->GetIntegeri_v(0x8A28, i, &s->block_buffers[i]);
        gl->GetInteger64i_v(SCATTERI_GL_UNIFORM_BUFFER_START, i, &s->block_starts[i]);
        gl->GetInteger64i_v(SCATTERI_GL_UNIFORM_BUFFER_SIZE, i, &s->block_sizes[i]);
    }
    s->unpack_buffer = scatteri_gl_get(f, SCATTERI_GL_UNPACK_BUFFER_BINDING);
    for (i = 0; i < (unsigned)SCATTERI_GL_UNPACKS; i++)
        if (!f->es || scatteri_gl_unpack[i].es)
            s->unpack[i] = scatteri_gl_get(f, scatteri_gl_unpack[i].name);
}

static void scatteri_gl_switch_scissor(const scatter_gl *f, int on)
{
    if (f->gl.ScissorIndexed == NULL)
        scatteri_gl_switch(f, SCATTERI_GL_SCISSOR_TEST, on);
    else if (on)
        f->gl.Enablei(SCATTERI_GL_SCISSOR_TEST, 0);
    else
        f->gl.Disablei(SCATTERI_GL_SCISSOR_TEST, 0);
}

static void scatteri_gl_restore_output(const scatter_gl *f, const scatteri_gl_state *s)
{
    const scatteri_gl_functions *gl = &f->gl;
    const int buffers = scatteri_gl_indexed(f);
    int i;
    for (i = 0; i < buffers; i++) {
        const scatteri_gl_byte *m = s->mask[i];
        if (buffers > 1) {
            gl->ColorMaski((unsigned)i, m[0], m[1], m[2], m[3]);
            (s->blends[i] ? gl->Enablei : gl->Disablei)(SCATTERI_GL_BLEND, (unsigned)i);
        } else {
            gl->ColorMask(m[0], m[1], m[2], m[3]);
            scatteri_gl_switch(f, SCATTERI_GL_BLEND, s->blends[i]);
        }
    }
    scatteri_gl_restore_blending(f, s);
    if (gl->ViewportIndexedf != NULL)
        gl->ViewportIndexedf(0, s->viewport_exact[0], s->viewport_exact[1], s->viewport_exact[2],
                             s->viewport_exact[3]);
    else
        gl->Viewport(s->viewport[0], s->viewport[1], s->viewport[2], s->viewport[3]);
    scatteri_gl_switch_scissor(f, s->scissor);
    for (i = 0; i < (int)SCATTERI_GL_SWITCHES; i++)
        if (scatteri_gl_has_switch(f, i))
            scatteri_gl_switch(f, scatteri_gl_switches[i].name, s->on[i]);
    if (!f->es && gl->PolygonMode != NULL)
        gl->PolygonMode(SCATTERI_GL_FRONT_AND_BACK, (unsigned)s->polygon_mode[0]);
    if (gl->ClipControl != NULL)
        gl->ClipControl((unsigned)s->clip_origin, (unsigned)s->clip_depth);
}

static void scatteri_gl_restore_input(const scatter_gl *f, const scatteri_gl_state *s)
{
    const scatteri_gl_functions *gl = &f->gl;
    unsigned i, t;
    for (i = 0; i < (unsigned)SCATTERI_GL_UNITS; i++) {
        gl->ActiveTexture(SCATTERI_GL_TEXTURE_0 + i);
        for (t = 0; t < (unsigned)SCATTERI_GL_TARGETS; t++) {
            const unsigned name = (unsigned)s->textures[i][t];
            /* one of the fog's own, which scatter_gl_bind_surface had bound, may be gone */
            gl->BindTexture(scatteri_gl_targets[t], f->dropped && !gl->IsTexture(name) ? 0 : name);
        }
        gl->BindSampler(i, (unsigned)s->samplers[i]);
    }
    gl->ActiveTexture((unsigned)s->unit);
    for (i = 0; i < 3; i++) {
        const unsigned buffer = (unsigned)s->block_buffers[i];
        if (s->block_sizes[i] > 0)
            gl->BindBufferRange(SCATTERI_GL_UNIFORM_BUFFER, i, buffer,
                                (ptrdiff_t)s->block_starts[i], (ptrdiff_t)s->block_sizes[i]);
        else
            gl->BindBufferBase(SCATTERI_GL_UNIFORM_BUFFER, i, buffer);
    }
    gl->BindBuffer(SCATTERI_GL_UNIFORM_BUFFER, (unsigned)s->uniform_buffer);
    gl->BindBuffer(SCATTERI_GL_UNPACK_BUFFER, (unsigned)s->unpack_buffer);
    for (i = 0; i < (unsigned)SCATTERI_GL_UNPACKS; i++)
        if (!f->es || scatteri_gl_unpack[i].es)
            gl->PixelStorei(scatteri_gl_unpack[i].name, s->unpack[i]);
}

static void scatteri_gl_restore(const scatter_gl *f, const scatteri_gl_state *s)
{
    if (f->desc.keep_state)
        return;
    scatteri_gl_restore_input(f, s);
    scatteri_gl_restore_output(f, s);
    f->gl.UseProgram((unsigned)s->program);
    f->gl.BindVertexArray((unsigned)s->vertex_array);
    f->gl.BindFramebuffer(SCATTERI_GL_DRAW_FRAMEBUFFER, (unsigned)s->framebuffer);
}

/* All channels of the first `count` draw buffers are written, those behind are not. */
static void scatteri_gl_write_buffers(const scatter_gl *f, int count)
{
    const int buffers = scatteri_gl_indexed(f);
    int i;
    if (buffers == 1)
        f->gl.ColorMask(1, 1, 1, 1);
    for (i = 0; i < buffers && buffers > 1; i++) {
        const scatteri_gl_byte on = (scatteri_gl_byte)(i < count);
        f->gl.ColorMaski((unsigned)i, on, on, on, on);
    }
}

/* The state in which passes draw. */
static void scatteri_gl_prepare(scatter_gl *f)
{
    const scatteri_gl_functions *gl = &f->gl;
    int i;
    gl->BindVertexArray(f->vertex_array);
    gl->Disable(SCATTERI_GL_BLEND);
    scatteri_gl_switch_scissor(f, 0);
    for (i = 0; i < (int)SCATTERI_GL_SWITCHES; i++)
        if (scatteri_gl_has_switch(f, i))
            gl->Disable(scatteri_gl_switches[i].name);
    if (!f->es && gl->PolygonMode != NULL)
        gl->PolygonMode(SCATTERI_GL_FRONT_AND_BACK, SCATTERI_GL_FILL);
    if (gl->ClipControl != NULL) {
        f->upside_down = scatteri_gl_get(f, SCATTERI_GL_CLIP_ORIGIN) != SCATTERI_GL_LOWER_LEFT;
        gl->ClipControl(SCATTERI_GL_LOWER_LEFT, SCATTERI_GL_MINUS_ONE_TO_ONE);
    }
    gl->BindBuffer(SCATTERI_GL_UNPACK_BUFFER, 0);
    for (i = 0; i < (int)SCATTERI_GL_UNPACKS; i++)
        if (!f->es || scatteri_gl_unpack[i].es)
            gl->PixelStorei(scatteri_gl_unpack[i].name, scatteri_gl_unpack[i].value);
    gl->BindBufferBase(SCATTERI_GL_UNIFORM_BUFFER, 0, f->medium_buffer);
    gl->BindBufferBase(SCATTERI_GL_UNIFORM_BUFFER, 2, f->view_buffer);
}

static void scatteri_gl_save(scatter_gl *f, scatteri_gl_state *s)
{
    memset(s, 0, sizeof *s);
    f->dropped = 0;
    if (!f->desc.keep_state) {
        s->program = scatteri_gl_get(f, SCATTERI_GL_CURRENT_PROGRAM);
        s->vertex_array = scatteri_gl_get(f, SCATTERI_GL_VERTEX_ARRAY_BINDING);
        s->framebuffer = scatteri_gl_get(f, SCATTERI_GL_DRAW_BINDING);
        scatteri_gl_save_output(f, s);
        scatteri_gl_save_input(f, s);
    }
    scatteri_gl_prepare(f);
}

/* -------------------------------------------------------------------------------------- >>textures */

/* Bytes of a texel. */
static int scatteri_gl_texel(int format)
{
    switch (format) {
    case SCATTERI_GL_R16F: return 2;
    case SCATTERI_GL_R32F:
    case SCATTERI_GL_RG16F: return 4;
    case SCATTERI_GL_RG32F:
    case SCATTERI_GL_RG32UI:
    case SCATTERI_GL_RGBA16F: return 8;
    default: return 16;
    }
}

static unsigned scatteri_gl_channels(int format)
{
    switch (format) {
    case SCATTERI_GL_R16F:
    case SCATTERI_GL_R32F: return SCATTERI_GL_RED;
    case SCATTERI_GL_RG16F:
    case SCATTERI_GL_RG32F: return SCATTERI_GL_RG;
    case SCATTERI_GL_RG32UI: return SCATTERI_GL_RG_INTEGER;
    default: return SCATTERI_GL_RGBA;
    }
}

static unsigned scatteri_gl_values(int format)
{
    return format == SCATTERI_GL_RG32UI ? SCATTERI_GL_UNSIGNED_INT : SCATTERI_GL_FLOAT;
}

static size_t scatteri_gl_texture_bytes(const scatteri_gl_texture *t)
{
    return (size_t)scatteri_gl_texel(t->format) * (size_t)t->width * (size_t)t->height *
           (size_t)(t->depth > 0 ? t->depth : 1);
}

static void scatteri_gl_drop_texture(scatter_gl *f, scatteri_gl_texture *t)
{
    if (t->name != 0 && !f->lost)
        f->gl.DeleteTextures(1, &t->name);
    f->dropped |= t->name != 0;
    if (t->name != 0)
        f->stats.texture_bytes -= scatteri_gl_texture_bytes(t);
    memset(t, 0, sizeof *t);
}

/* Binds a texture and the sampler to a unit. */
static void scatteri_gl_bind(const scatter_gl *f, int unit, unsigned target, unsigned texture,
                             unsigned sampler)
{
    f->gl.ActiveTexture(SCATTERI_GL_TEXTURE_0 + (unsigned)unit);
    f->gl.BindTexture(target, texture);
    f->gl.BindSampler((unsigned)unit, sampler);
}

/* Makes a texture of that size and format, unless it is one already; depth 0 is 2D. */
static scatter_result scatteri_gl_size_texture(scatter_gl *f, scatteri_gl_texture *t, int format,
                                               int width, int height, int depth)
{
    const scatteri_gl_functions *gl = &f->gl;
    const int most = depth > 0 ? f->max_3d : f->max_2d;
    if (t->name != 0 && t->format == format && t->width == width && t->height == height &&
        t->depth == depth)
        return SCATTER_OK;
    if (width > most || height > most || depth > most)
        return scatteri_fail(&f->host, SCATTER_TOO_LARGE,
                             "a texture of %d x %d x %d is needed, this GL context has at most %d",
                             width, height, depth, most);
    scatteri_gl_drop_texture(f, t);
    t->target = depth > 0 ? SCATTERI_GL_TEXTURE_3D : SCATTERI_GL_TEXTURE_2D;
    t->format = format;
    t->width = width;
    t->height = height;
    t->depth = depth;
    gl->GenTextures(1, &t->name);
    scatteri_gl_bind(f, SCATTERI_GL_UNIT_BEFORE, t->target, t->name, 0);
    gl->TexParameteri(t->target, SCATTERI_GL_MIN_FILTER, SCATTERI_GL_NEAREST);
    gl->TexParameteri(t->target, SCATTERI_GL_MAG_FILTER, SCATTERI_GL_NEAREST);
    if (depth > 0)
        gl->TexImage3D(t->target, 0, format, width, height, depth, 0, scatteri_gl_channels(format),
                       scatteri_gl_values(format), NULL);
    else
        gl->TexImage2D(t->target, 0, format, width, height, 0, scatteri_gl_channels(format),
                       scatteri_gl_values(format), NULL);
    f->stats.textures++;
    f->stats.texture_bytes += scatteri_gl_texture_bytes(t);
    return SCATTER_OK;
}

/* Room for pictures of that size. It only grows, so that several views can share it. */
static scatter_result scatteri_gl_grow_texture(scatter_gl *f, scatteri_gl_texture *t, int format,
                                               int width, int height)
{
    if (t->width >= width && t->height >= height)
        return SCATTER_OK;
    return scatteri_gl_size_texture(f, t, format, width > t->width ? width : t->width,
                                    height > t->height ? height : t->height, 0);
}

/* Values for a whole texture. */
static void scatteri_gl_upload(scatter_gl *f, const scatteri_gl_texture *t, int rows,
                               const float *values)
{
    scatteri_gl_bind(f, SCATTERI_GL_UNIT_BEFORE, t->target, t->name, 0);
    if (t->target == SCATTERI_GL_TEXTURE_3D)
        f->gl.TexSubImage3D(t->target, 0, 0, 0, 0, t->width, t->height, t->depth,
                            scatteri_gl_channels(t->format), SCATTERI_GL_FLOAT, values);
    else
        f->gl.TexSubImage2D(t->target, 0, 0, 0, t->width, rows, scatteri_gl_channels(t->format),
                            SCATTERI_GL_FLOAT, values);
}

/* Binds a texture that shaders read between its texels, or NULL. */
static void scatteri_gl_read_smooth(const scatter_gl *f, int unit, const scatteri_gl_texture *t)
{
    if (t != NULL && t->name != 0)
        scatteri_gl_bind(f, unit, t->target, t->name, f->linear);
}

static void scatteri_gl_read_texels(const scatter_gl *f, int unit, const scatteri_gl_texture *t)
{
    if (t != NULL && t->name != 0)
        scatteri_gl_bind(f, unit, t->target, t->name, f->nearest);
}

/* --------------------------------------------------------------------------------------- >>drawing */

/* A target of the fog's own framebuffer: a layer of a 3D texture, or a 2D texture. */
typedef struct scatteri_gl_layer {
    const scatteri_gl_texture *texture;
    int layer;
} scatteri_gl_layer;

static void scatteri_gl_set_viewport(const scatter_gl *f, int x, int y, int width, int height)
{
    if (f->gl.ViewportIndexedf != NULL)
        f->gl.ViewportIndexedf(0, (float)x, (float)y, (float)width, (float)height);
    else
        f->gl.Viewport(x, y, width, height);
}

/* The next draws go into these layers, all of one size. */
static scatter_result scatteri_gl_target(scatter_gl *f, const scatteri_gl_layer *layers, int count)
{
    const scatteri_gl_functions *gl = &f->gl;
    unsigned buffers[SCATTERI_GL_MOST_BUFFERS];
    int i;
    gl->BindFramebuffer(SCATTERI_GL_DRAW_FRAMEBUFFER, f->framebuffer);
    for (i = 0; i < f->draw_buffers; i++) {
        const unsigned at = SCATTERI_GL_COLOR_0 + (unsigned)i;
        if (i >= count)
            gl->FramebufferTexture2D(SCATTERI_GL_DRAW_FRAMEBUFFER, at, SCATTERI_GL_TEXTURE_2D, 0,
                                     0);
        else if (layers[i].texture->target == SCATTERI_GL_TEXTURE_3D)
            gl->FramebufferTextureLayer(SCATTERI_GL_DRAW_FRAMEBUFFER, at, layers[i].texture->name,
                                        0, layers[i].layer);
        else
            gl->FramebufferTexture2D(SCATTERI_GL_DRAW_FRAMEBUFFER, at, SCATTERI_GL_TEXTURE_2D,
                                     layers[i].texture->name, 0);
        buffers[i] = i < count ? at : 0;
    }
    gl->DrawBuffers(count, buffers);
    scatteri_gl_write_buffers(f, count);
    scatteri_gl_set_viewport(f, 0, 0, layers[0].texture->width, layers[0].texture->height);
    if (gl->CheckFramebufferStatus(SCATTERI_GL_DRAW_FRAMEBUFFER) != SCATTERI_GL_COMPLETE)
        return scatteri_fail(&f->host, SCATTER_UNSUPPORTED,
                             "this GL context cannot draw into textures of format 0x%04X",
                             (unsigned)layers[0].texture->format);
    return SCATTER_OK;
}

/* Layers first..first+count-1 of a volume. */
static scatter_result scatteri_gl_target_slices(scatter_gl *f, const scatteri_gl_texture *volume,
                                                int first, int count)
{
    scatteri_gl_layer layers[SCATTERI_GL_MOST_BUFFERS];
    int i;
    for (i = 0; i < count; i++) {
        layers[i].texture = volume;
        layers[i].layer = volume->first + first + i;
    }
    return scatteri_gl_target(f, layers, count);
}

/* Few Gaussians are filled up to a multiple of four by such that hold nothing, so that few numbers of them need programs
   of their own; more than 16 are looped over. */
static int scatteri_gl_few_rows(const scatter_gl *f)
{
    const int count = (f->medium.gaussians.count + 3) / 4 * 4;
    return count <= 16 ? count : 0;
}

/* The program of a pass becomes current. */
static scatter_result scatteri_gl_use(scatter_gl *f, int pass, scatteri_gl_features features,
                                      int slices, const scatteri_gl_program **out)
{
    scatteri_gl_key key;
    scatter_result result;
    key.pass = pass;
    key.features = features & scatteri_gl_passes[pass].knows;
    key.slices = slices;
    key.count = (key.features & SCATTERI_GL_HAS(FEW_THIN)) != 0 ? scatteri_gl_few_rows(f) : 0;
    result = scatteri_gl_find_program(f, key, out);
    if (result == SCATTER_OK)
        f->gl.UseProgram((*out)->name);
    return result;
}

/* One triangle over the whole viewport; x..w reach the shader as scatteri_at. */
static void scatteri_gl_fill(scatter_gl *f, const scatteri_gl_program *program, int x, int y, int z,
                             int w)
{
    if (program->at >= 0)
        f->gl.Uniform4i(program->at, x, y, z, w);
    f->gl.DrawArrays(SCATTERI_GL_TRIANGLES, 0, 3);
}

/* Of all draw buffers. */
static void scatteri_gl_blend(const scatter_gl *f, int source, int target, int alpha_source,
                              int alpha_target)
{
    f->gl.Enable(SCATTERI_GL_BLEND);
    f->gl.BlendFuncSeparate((unsigned)source, (unsigned)target, (unsigned)alpha_source,
                            (unsigned)alpha_target);
    f->gl.BlendEquationSeparate(SCATTERI_GL_FUNC_ADD, SCATTERI_GL_FUNC_ADD);
}

static void scatteri_gl_begin_timer(scatter_gl *f, int which)
{
    scatteri_gl_timer *t = &f->timers[which];
    if (!f->desc.timers || f->gl.QueryCounter == NULL || t->pending)
        return;
    if (t->begin == 0) {
        f->gl.GenQueries(1, &t->begin);
        f->gl.GenQueries(1, &t->end);
    }
    f->gl.QueryCounter(t->begin, SCATTERI_GL_TIMESTAMP);
}

static void scatteri_gl_end_timer(scatter_gl *f, int which)
{
    scatteri_gl_timer *t = &f->timers[which];
    if (t->begin == 0 || t->pending)
        return;
    f->gl.QueryCounter(t->end, SCATTERI_GL_TIMESTAMP);
    t->pending = 1;
}

/* ----------------------------------------------------------------------------------------- >>blocks */

static void scatteri_gl_put(float *to, float x, float y, float z, float w)
{
    to[0] = x;
    to[1] = y;
    to[2] = z;
    to[3] = w;
}

static void scatteri_gl_put3(float *to, scatter_vec3 v, float w)
{
    scatteri_gl_put(to, v.x, v.y, v.z, w);
}

static void scatteri_gl_send(scatter_gl *f, unsigned buffer, const void *block, size_t bytes)
{
    f->gl.BindBuffer(SCATTERI_GL_UNIFORM_BUFFER, buffer);
    f->gl.BufferSubData(SCATTERI_GL_UNIFORM_BUFFER, 0, (ptrdiff_t)bytes, block);
}

/* A box that holds everything, if the medium has none. */
static scatter_box scatteri_gl_box(const scatter_gl *f, int exists, scatter_box box)
{
    const scatter_vec3 horizon = {SCATTERI_FAR, SCATTERI_FAR, SCATTERI_FAR};
    scatter_box all;
    all.min = scatteri_scale(horizon, -1.0f);
    all.max = horizon;
    return exists ? scatteri_box_from(box, f->ref) : all;
}

/* Half the depth of a Gaussian that is passed through its centre. */
static float scatteri_gl_half_depth(const scatteri_gaussians *g, int i)
{
    return g->c[i] * 0.886226925f / g->a[i];
}

/* The two rows of Gaussian i. */
static void scatteri_gl_put_gaussian(const scatter_gl *f, int i, float *to)
{
    const scatteri_gaussians *g = &f->medium.gaussians;
    scatteri_gl_put(to, g->x[i] - f->ref.x, g->y[i] - f->ref.y, g->z[i] - f->ref.z, g->a[i]);
    scatteri_gl_put(to + 4, g->c[i], g->reach[i], scatteri_gl_half_depth(g, i),
                    g->reach[i] > 0.0f ? scatteri_sqrt(g->reach[i]) / g->a[i] : -1.0f);
}

/* Whether the quick erf and the block of few Gaussians serve them all. */
static int scatteri_gl_few_and_thin(const scatter_gl *f)
{
    const scatteri_gaussians *g = &f->medium.gaussians;
    int i, thin = g->count > 0 && g->count <= (int)SCATTERI_GL_FEW;
    for (i = 0; i < g->count && thin; i++)
        thin = f->medium.sigma_most * scatteri_gl_half_depth(g, i) < SCATTERI_QUICK;
    return thin;
}

/* Distances are stored in voxels: the longest edge is 1. What texture units with weights of 8 bits may read too far
   away is 1/256 of a voxel's diagonal at most. */
static void scatteri_gl_put_spacing(scatter_gl *f)
{
    scatteri_gl_medium_block *b = &f->medium_block;
    const float x = 1.0f / (b->field_per[0] * (float)f->density->width);
    const float y = 1.0f / (b->field_per[1] * (float)f->density->height);
    const float z = 1.0f / (b->field_per[2] * (float)f->density->depth);
    b->field_per[3] = scatteri_max(x, scatteri_max(y, z));
    b->field_max[3] = scatteri_sqrt(x * x + y * y + z * z) / 256.0f;
}

static void scatteri_gl_send_medium(scatter_gl *f)
{
    const scatteri_medium *m = &f->medium;
    const scatter_medium *d = &m->desc;
    const scatter_box bounds = scatteri_gl_box(f, d->bounded, d->bounds);
    const scatter_box local = scatteri_gl_box(f, m->has_local, m->local);
    scatteri_gl_medium_block *b = &f->medium_block;
    const size_t few = scatteri_gl_few_and_thin(f) ? (size_t)m->gaussians.count : 0;
    size_t i;
    memset(b, 0, sizeof *b);
    scatteri_gl_put3(b->extinction, d->extinction, m->sigma_most);
    scatteri_gl_put3(b->albedo, scatteri_mul(d->albedo, d->extinction), m->sigma_least);
    scatteri_gl_put3(b->emission, d->emission, d->constant);
    scatteri_gl_put(b->lobe_pair, m->lobes.g1, m->lobes.alpha1, m->lobes.g2, m->lobes.alpha2);
    scatteri_gl_put(b->lobe_turn, m->lobes.weight, m->turn, 0.0f, 0.0f);
    scatteri_gl_put(b->counts, (float)m->gaussians.count, (float)d->height_count, 0.0f, 0.0f);
    scatteri_gl_put3(b->bounds_min, bounds.min, 0.0f);
    scatteri_gl_put3(b->bounds_max, bounds.max, 0.0f);
    scatteri_gl_put3(b->local_min, local.min, (float)f->quality.grid);
    scatteri_gl_put3(b->local_max, local.max, 0.0f);
    if (f->density != NULL && d->grid_count > 0 && f->density != &f->field) {
        const scatteri_field *field = &m->fields[f->density - f->grids];
        const scatter_box box = scatteri_box_from(field->grid.box, f->ref);
        scatteri_gl_put3(b->field_min, box.min, field->scale);
        scatteri_gl_put3(b->field_max, box.max, 0.0f);
    } else {
        scatteri_gl_put3(b->field_min, local.min, 1.0f);
        scatteri_gl_put3(b->field_max, local.max, 0.0f);
    }
    scatteri_gl_put(b->field_per, 1.0f / (b->field_max[0] - b->field_min[0]),
                    1.0f / (b->field_max[1] - b->field_min[1]),
                    1.0f / (b->field_max[2] - b->field_min[2]), 0.0f);
    if (f->density != NULL)
        scatteri_gl_put_spacing(f);
    scatteri_gl_put(b->trim, f->trim.rays, 0.0f, 0.0f, 0.0f);
    scatteri_gl_put(b->nodes, (float)f->quality.nodes, SCATTERI_PANEL, (float)f->quality.nodes,
                    0.0f);
    for (i = 0; i < d->height_count && i < (size_t)SCATTERI_GL_HEIGHTS; i++)
        scatteri_gl_put(b->heights[i], d->heights[i].density, d->heights[i].y0 - f->ref.y,
                        d->heights[i].scale, 0.0f);
    for (i = 0; i < few; i++)
        scatteri_gl_put_gaussian(f, (int)i, &b->few[0][0] + 8 * i);
    scatteri_gl_send(f, f->medium_buffer, b, sizeof *b);
}

/* The cell nearest to a source, where its waves begin; .w: bit of each axis on which the source is inside. */
static void scatteri_gl_put_anchor(float *to, const scatter_depth *d)
{
    const scatter_vec3 at = d->source.position, w = d->source.direction;
    int axis, inside = 0;
    for (axis = 0; axis < 3; axis++) {
        scatteri_axis order;
        scatteri_order_axis(&order, d->nx, scatteri_get(d->box.min, axis),
                            scatteri_get(d->cell, axis), scatteri_get(at, axis),
                            d->source.directional, scatteri_get(w, axis));
        to[axis] = (float)order.order[0];
        inside |= (order.nearest >= 0) << axis;
    }
    to[3] = (float)inside;
}

/* The shadow map of light l of a batch. */
static void scatteri_gl_put_shadow(scatter_gl *f, int l, const scatter_gl_shadow *s)
{
    scatteri_gl_lights_block *b = &f->lights_block;
    int c, row;
    scatteri_gl_put(b->shadow[l], (float)s->kind, s->bias, s->reversed ? -1.0f : 1.0f,
                    (float)(s->cascades > 1 ? s->cascades : 1));
    scatteri_gl_put(b->shadow_more[l], (float)s->layer, s->z_near, s->z_far, 0.0f);
    for (c = 0; c < (int)SCATTERI_GL_CASCADES && s->kind != SCATTER_GL_SHADOW_CUBE; c++)
        for (row = 0; row < 4; row++) {
            const float *m = s->matrix[c];
            float *to = b->shadow_matrix[(l * SCATTERI_GL_CASCADES + c) * 4 + row];
            scatteri_gl_put(to, m[row], m[4 + row], m[8 + row],
                            m[row] * f->ref.x + m[4 + row] * f->ref.y + m[8 + row] * f->ref.z +
                                m[12 + row]);
        }
}

/* Light `lamp` of the fog as number l of the block. */
static void scatteri_gl_put_lamp(scatter_gl *f, int l, const scatteri_gl_lamp *lamp)
{
    scatteri_gl_lights_block *b = &f->lights_block;
    const scatter_light *d = &lamp->desc.light;
    const scatter_gl_shadow *s = &lamp->desc.shadow;
    const scatter_depth *p = &lamp->layout;
    const int directional = d->kind == SCATTER_LIGHT_DIRECTIONAL, parallel = p->source.directional;
    const scatter_vec3 none = {0.0f, 0.0f, 0.0f}, corner = scatteri_sub(p->box.min, f->ref);
    const scatter_vec3 at = directional ? none : scatteri_sub(d->position, f->ref);
    scatteri_gl_put3(b->light[l], at, (float)d->kind);
    scatteri_gl_put3(b->direction[l], d->direction, directional ? 0.0f : d->radius);
    scatteri_gl_put3(b->intensity[l], d->intensity, (float)lamp->in_rim);
    scatteri_gl_put(b->cone[l], (float)cos((double)d->inner), (float)cos((double)d->outer),
                    p->at_source, 0.0f);
    /* Parallel columns count from a corner of the local box. */
    scatteri_gl_put3(b->axis_u[l], p->axis_u,
                     p->low_u + (parallel ? scatteri_dot(corner, p->axis_u) : 0.0f));
    scatteri_gl_put3(b->axis_v[l], p->axis_v,
                     p->low_v + (parallel ? scatteri_dot(corner, p->axis_v) : 0.0f));
    scatteri_gl_put3(b->axis_w[l], p->axis_w,
                     p->low_r + (parallel ? scatteri_dot(corner, p->axis_w) : 0.0f));
    if (p->step_u > 0.0f)
        scatteri_gl_put(b->polar[l], 1.0f / p->step_u, 1.0f / p->step_v, 1.0f / p->step_r,
                        b->axis_w[l][3] + (float)(p->nz - 1) * p->step_r);
    scatteri_gl_put(b->polar_size[l], (float)p->nx, (float)p->ny, (float)p->nz, (float)parallel);
    if (p->method == SCATTER_DEPTH_UPWIND && p->nx > 0)
        scatteri_gl_put_anchor(b->anchor[l], p);
    else
        scatteri_gl_put3(b->anchor[l], parallel ? none : scatteri_sub(p->source.position, f->ref),
                         0.0f);
    if (s->kind != SCATTER_GL_SHADOW_NONE)
        scatteri_gl_put_shadow(f, l, s);
}

/* --------------------------------------------------------------------------------------- >>volumes */

/* Layers that a pass fills at once. */
static int scatteri_gl_slices_of(const scatter_gl *f)
{
    return scatteri_clamp_int(f->draw_buffers, 1, SCATTERI_GL_SLICES);
}

/* Draws all layers of a volume with the current program: one triangle, or a quad for each of `quads`. */
static scatter_result scatteri_gl_fill_volume(scatter_gl *f, const scatteri_gl_program *program,
                                              const scatteri_gl_texture *volume, int quads)
{
    const int slices = scatteri_gl_slices_of(f);
    scatter_result result = SCATTER_OK;
    int first;
    for (first = 0; first < volume->depth && result == SCATTER_OK; first += slices) {
        const int left = volume->depth - first;
        result = scatteri_gl_target_slices(f, volume, first, left < slices ? left : slices);
        f->gl.Uniform4i(program->at, first, 0, 0, 0);
        if (result == SCATTER_OK && quads > 0)
            f->gl.DrawArraysInstanced(SCATTERI_GL_TRIANGLE_STRIP, 0, 4, quads);
        else if (result == SCATTER_OK)
            f->gl.DrawArrays(SCATTERI_GL_TRIANGLES, 0, 3);
    }
    return result;
}

/* The same with the program of a pass. */
static scatter_result scatteri_gl_run_pass(scatter_gl *f, int pass, scatteri_gl_features features,
                                           const scatteri_gl_texture *volume, int quads)
{
    const scatteri_gl_program *program;
    const scatter_result result =
        scatteri_gl_use(f, pass, features, scatteri_gl_slices_of(f), &program);
    return result == SCATTER_OK ? scatteri_gl_fill_volume(f, program, volume, quads) : result;
}

/* --- injection --- */

/* Shaders read density from this grid. */
static void scatteri_gl_read_grid(scatter_gl *f, int grid)
{
    f->density = &f->grids[grid];
    scatteri_gl_send_medium(f);
    scatteri_gl_read_smooth(f, SCATTERI_GL_UNIT_FIELD, f->density);
}

/* Fills f->field with the density of the medium's local terms; Gaussians by quads or gathered by each cell. Only the
   first pass does not add to what is there. */
static scatter_result scatteri_gl_inject_by(scatter_gl *f, int quads)
{
    const int count = f->medium.gaussians.count, grids = (int)f->medium.desc.grid_count;
    const scatteri_gl_features field = grids > 0 ? SCATTERI_GL_HAS(FIELD) : 0;
    const scatteri_gl_features gather = count > 0 && !quads ? SCATTERI_GL_HAS(GAUSSIANS) : 0;
    scatter_result result;
    int i;
    f->density = NULL;
    scatteri_gl_send_medium(f);
    scatteri_gl_read_texels(f, SCATTERI_GL_UNIT_GAUSSIANS, &f->gaussians);
    if (grids > 0)
        scatteri_gl_read_grid(f, 0);
    result = scatteri_gl_run_pass(f, SCATTERI_GL_PASS_INJECT, field | gather, &f->field, 0);
    scatteri_gl_blend(f, SCATTERI_GL_ONE, SCATTERI_GL_ONE, SCATTERI_GL_ONE, SCATTERI_GL_ONE);
    if (result == SCATTER_OK && count > 0 && quads)
        result = scatteri_gl_run_pass(f, SCATTERI_GL_PASS_SPLAT, 0, &f->field, count);
    for (i = 1; i < grids && result == SCATTER_OK; i++) {
        scatteri_gl_read_grid(f, i);
        result = scatteri_gl_run_pass(f, SCATTERI_GL_PASS_INJECT, field, &f->field, 0);
    }
    f->gl.Disable(SCATTERI_GL_BLEND);
    return result;
}

/* Cells on an axis that a Gaussian reaches. */
static float scatteri_gl_reached(float radius, float low, float high, int n)
{
    return scatteri_min(2.0f * radius * (float)n / (high - low), (float)n);
}

/* Whether quads cost less than gathering. Both have been measured (bench): adding to a cell costs up to twice as much as
   looking at a Gaussian from a cell. */
static int scatteri_gl_quads_pay(const scatter_gl *f)
{
    const scatteri_gaussians *g = &f->medium.gaussians;
    const scatter_box b = f->medium.local;
    const int n = f->field.depth;
    float reached = 0.0f;
    int i;
    if (!f->can_blend_float && f->field.format == SCATTERI_GL_R32F)
        return 0;
    for (i = 0; i < g->count; i++) {
        const float radius = scatteri_sqrt(scatteri_max(g->reach[i], 0.0f)) / g->a[i];
        reached += scatteri_gl_reached(radius, b.min.x, b.max.x, n) *
                   scatteri_gl_reached(radius, b.min.y, b.max.y, n) *
                   scatteri_gl_reached(radius, b.min.z, b.max.z, n);
    }
    return 2.0f * reached < (float)g->count * (float)n * (float)n * (float)n;
}

static scatter_result scatteri_gl_inject(scatter_gl *f)
{
    return scatteri_gl_inject_by(f, scatteri_gl_quads_pay(f));
}

/* --- distance to density --- */

/* Of some layers of the field: along x, then along y. */
static scatter_result scatteri_gl_measure_layers(scatter_gl *f, int first, int count)
{
    const int slices = scatteri_gl_slices_of(f);
    const scatteri_gl_program *program;
    scatter_result result =
        scatteri_gl_use(f, SCATTERI_GL_PASS_DISTANCE, SCATTERI_GL_HAS(FIELD), slices, &program);
    if (result == SCATTER_OK)
        result = scatteri_gl_target_slices(f, &f->distances[0], 0, count);
    if (result != SCATTER_OK)
        return result;
    scatteri_gl_fill(f, program, first, 0, 0, 0);
    scatteri_gl_read_texels(f, SCATTERI_GL_UNIT_VOLUME, &f->distances[0]);
    result = scatteri_gl_use(f, SCATTERI_GL_PASS_DISTANCE, 0, slices, &program);
    if (result == SCATTER_OK)
        result = scatteri_gl_target_slices(f, &f->distances[1], first, count);
    if (result == SCATTER_OK)
        scatteri_gl_fill(f, program, 0, 0, 0, 0);
    return result;
}

/* Along z, beside the density. */
static scatter_result scatteri_gl_measure_columns(scatter_gl *f)
{
    const int slices = scatteri_gl_slices_of(f), half = f->spaced.format == SCATTERI_GL_RG16F;
    const scatteri_gl_program *program;
    scatter_result result = scatteri_gl_use(f, SCATTERI_GL_PASS_SPACED, 0, slices, &program);
    int first;
    scatteri_gl_read_texels(f, SCATTERI_GL_UNIT_VOLUME, &f->distances[1]);
    for (first = 0; first < f->spaced.depth && result == SCATTER_OK; first += slices) {
        const int left = f->spaced.depth - first;
        result = scatteri_gl_target_slices(f, &f->spaced, first, left < slices ? left : slices);
        if (result == SCATTER_OK)
            scatteri_gl_fill(f, program, first, half, 0, 0);
    }
    return result;
}

static scatter_result scatteri_gl_size_spaced(scatter_gl *f)
{
    const scatteri_gl_texture *d = f->density;
    const int half = d->format == SCATTERI_GL_R16F;
    scatter_result result = scatteri_gl_size_texture(f, &f->distances[0], SCATTERI_GL_R32F,
                                                     d->width, d->height, scatteri_gl_slices_of(f));
    if (result == SCATTER_OK)
        result = scatteri_gl_size_texture(f, &f->distances[1], SCATTERI_GL_R32F, d->width,
                                          d->height, d->depth);
    if (result == SCATTER_OK)
        result =
            scatteri_gl_size_texture(f, &f->spaced, half ? SCATTERI_GL_RG16F : SCATTERI_GL_RG32F,
                                     d->width, d->height, d->depth);
    return result;
}

/* Fills f->spaced from the field that is read. */
static scatter_result scatteri_gl_measure_distance(scatter_gl *f)
{
    const int slices = scatteri_gl_slices_of(f), layers = f->density->depth;
    scatter_result result = scatteri_gl_size_spaced(f);
    int first;
    scatteri_gl_read_texels(f, SCATTERI_GL_UNIT_FIELD, f->density);
    for (first = 0; first < layers && result == SCATTER_OK; first += slices) {
        const int left = layers - first;
        result = scatteri_gl_measure_layers(f, first, left < slices ? left : slices);
    }
    f->stats.distance_maps++;
    return result == SCATTER_OK ? scatteri_gl_measure_columns(f) : result;
}

/* --- depth: columns --- */

/* Shells of the columns around each source, each cell once. Gaussians in closed form; what a field adds from shell to
   shell goes from pass to pass as a running sum. */
static scatter_result scatteri_gl_sum_columns(scatter_gl *f, const scatteri_gl_texture *volume,
                                              scatteri_gl_features features)
{
    const int sums = (features & SCATTERI_GL_HAS(FIELD)) != 0;
    const int shells = scatteri_clamp_int(f->draw_buffers - sums, 1, SCATTERI_GL_SLICES);
    const scatteri_gl_program *program = NULL;
    scatteri_gl_layer layers[SCATTERI_GL_MOST_BUFFERS];
    scatter_result result = SCATTER_OK;
    int first, i, turn = 0;
    for (i = 0; i < 2 && sums && result == SCATTER_OK; i++)
        result = scatteri_gl_grow_texture(f, &f->running[i], SCATTERI_GL_RGBA32F, volume->width,
                                          volume->height);
    if (result == SCATTER_OK)
        result = scatteri_gl_use(f, SCATTERI_GL_PASS_POLAR, features, shells, &program);
    for (first = 0; first < volume->depth && result == SCATTER_OK; first += shells) {
        const int left = volume->depth - first, count = left < shells ? left : shells;
        layers[0].texture = &f->running[turn];
        layers[0].layer = 0;
        for (i = 0; i < count; i++) {
            layers[sums + i].texture = volume;
            layers[sums + i].layer = volume->first + first + i;
        }
        turn = 1 - turn;
        if (sums)
            scatteri_gl_read_texels(f, SCATTERI_GL_UNIT_BEFORE, &f->running[turn]);
        result = scatteri_gl_target(f, layers, sums + count);
        scatteri_gl_set_viewport(f, 0, 0, volume->width, volume->height);
        if (result == SCATTER_OK)
            scatteri_gl_fill(f, program, first, 0, 0, 0);
    }
    return result;
}

/* --- depth: wavefront --- */

/* Steps to the farthest cell on an axis. */
static int scatteri_gl_most_steps(const float *anchor, int axis, int n)
{
    const int a = (int)anchor[axis];
    return a > n - 1 - a ? a : n - 1 - a;
}

/* One wave of all sources of the batch; each writes its own channel. */
static void scatteri_gl_draw_wave(scatter_gl *f, const scatteri_gl_program *program, int wave)
{
    const scatteri_gl_lights_block *b = &f->lights_block;
    const int n = f->quality.grid;
    int channel;
    for (channel = 0; channel < (int)b->batch[0]; channel++) {
        const float *anchor = b->anchor[channel];
        const int last = scatteri_gl_most_steps(anchor, 0, n) +
                         scatteri_gl_most_steps(anchor, 1, n) +
                         scatteri_gl_most_steps(anchor, 2, n);
        if (wave > last)
            continue;
        f->gl.ColorMask(channel == 0, channel == 1, channel == 2, channel == 3);
        f->gl.Uniform4i(program->at, channel, wave, 0, 0);
        f->gl.DrawArraysInstanced(SCATTERI_GL_TRIANGLE_STRIP, 0, 4, anchor[2] > 0.0f ? 2 : 1);
    }
}

static scatter_result scatteri_gl_run_waves(scatter_gl *f)
{
    const scatteri_gl_program *program;
    scatter_result result = scatteri_gl_use(f, SCATTERI_GL_PASS_WAVE, 0, 1, &program);
    scatteri_gl_layer layer;
    int wave;
    layer.layer = 0;
    for (wave = 0; wave <= 3 * (f->quality.grid - 1) && result == SCATTER_OK; wave++) {
        layer.texture = &f->wave[wave & 1];
        scatteri_gl_read_texels(f, SCATTERI_GL_UNIT_BEFORE, &f->wave[1 - (wave & 1)]);
        result = scatteri_gl_target(f, &layer, 1);
        if (result == SCATTER_OK)
            scatteri_gl_draw_wave(f, program, wave);
    }
    return result;
}

static scatter_result scatteri_gl_sweep(scatter_gl *f, const scatteri_gl_texture *volume)
{
    const int n = volume->depth;
    scatter_result result = SCATTER_OK;
    const int count = 3 * n; /* tiles: two for each of 3n - 2 waves, in two pictures */
    int tiles = 1, i;
    while (tiles * tiles < count)
        tiles++;
    for (i = 0; i < 2 && result == SCATTER_OK; i++)
        result = scatteri_gl_size_texture(f, &f->wave[i], SCATTERI_GL_RGBA32F, tiles * n,
                                          (count + tiles - 1) / tiles * n, 0);
    if (result != SCATTER_OK)
        return result;
    scatteri_gl_read_texels(f, SCATTERI_GL_UNIT_FIELD, &f->field);
    result = scatteri_gl_run_waves(f);
    scatteri_gl_read_texels(f, SCATTERI_GL_UNIT_BEFORE, &f->wave[0]);
    scatteri_gl_read_texels(f, SCATTERI_GL_UNIT_BEFORE_TOO, &f->wave[1]);
    return result == SCATTER_OK ? scatteri_gl_run_pass(f, SCATTERI_GL_PASS_MERGE, 0, volume, 0)
                                : result;
}

/* --- depth --- */

static scatteri_gl_features scatteri_gl_medium_features(const scatter_gl *f);

/* Gaussians up to which columns take them one by one, wherever density comes from: most are found not to reach a column
   by one comparison. */
enum { SCATTERI_GL_MANY = 256 };

/* Whether columns sum up the terms themselves rather than the field that holds them all. */
static int scatteri_gl_columns_exact(const scatter_gl *f)
{
    return f->medium.desc.grid_count <= 1 && f->medium.gaussians.count <= (int)SCATTERI_GL_MANY;
}

static scatteri_gl_features scatteri_gl_column_features(const scatter_gl *f)
{
    const scatteri_gl_features terms = SCATTERI_GL_HAS(GAUSSIANS) | SCATTERI_GL_HAS(FIELD);
    scatteri_gl_features features = scatteri_gl_medium_features(f);
    if (!scatteri_gl_columns_exact(f))
        return features;
    features &= ~terms;
    features |= f->medium.gaussians.count > 0 ? SCATTERI_GL_HAS(GAUSSIANS) : 0;
    return features | (f->medium.desc.grid_count > 0 ? SCATTERI_GL_HAS(FIELD) : 0);
}

static scatter_result scatteri_gl_propagate_columns(scatter_gl *f,
                                                    const scatteri_gl_texture *volume)
{
    const scatteri_gl_texture *density = f->density;
    const int other =
        scatteri_gl_columns_exact(f) && f->medium.desc.grid_count > 0 && density != &f->grids[0];
    scatter_result result;
    if (other)
        scatteri_gl_read_grid(f, 0);
    result = scatteri_gl_sum_columns(f, volume, scatteri_gl_column_features(f));
    f->density = density;
    if (other)
        scatteri_gl_send_medium(f);
    return result;
}

/* Fills the volume of a batch with the depth of its sources, whose block was sent. */
static scatter_result scatteri_gl_propagate(scatter_gl *f, int batch,
                                            const scatteri_gl_texture *volume)
{
    f->gl.BindBufferBase(SCATTERI_GL_UNIFORM_BUFFER, 1, f->light_buffers[batch]);
    scatteri_gl_read_texels(f, SCATTERI_GL_UNIT_GAUSSIANS, &f->gaussians);
    scatteri_gl_read_smooth(f, SCATTERI_GL_UNIT_FIELD, f->density);
    if (f->quality.depth == SCATTER_DEPTH_POLAR)
        return scatteri_gl_propagate_columns(f, volume);
    if (f->quality.depth == SCATTER_DEPTH_UPWIND)
        return scatteri_gl_sweep(f, volume);
    return scatteri_gl_run_pass(f, SCATTERI_GL_PASS_CLOSED, scatteri_gl_medium_features(f), volume,
                                0);
}

/* ----------------------------------------------------------------------------------------- >>update */

/* Whether rays to the lights go through the field. */
static int scatteri_gl_casts_rays(const scatter_gl *f)
{
    return f->density != NULL && f->density != &f->field &&
           f->quality.depth == SCATTER_DEPTH_CLOSED;
}

/* Whether rays jump over empty voxels. */
static int scatteri_gl_jumps(const scatter_gl *f)
{
    return f->density != NULL && !f->quality.no_distance_map &&
           (f->quality.ray == SCATTER_RAY_MARCH || scatteri_gl_casts_rays(f));
}

static scatteri_gl_features scatteri_gl_skip_features(const scatter_gl *f)
{
    scatteri_gl_features features = 0;
    if (scatteri_gl_casts_rays(f))
        features |= SCATTERI_GL_HAS(RAYS);
    if (scatteri_gl_jumps(f))
        features |= SCATTERI_GL_HAS(DISTANCE);
    if (f->density != NULL && !f->quality.no_mask)
        features |= SCATTERI_GL_HAS(MASK);
    return features;
}

static scatteri_gl_features scatteri_gl_medium_features(const scatter_gl *f)
{
    const scatteri_medium *m = &f->medium;
    const scatter_vec3 e = m->desc.emission;
    scatteri_gl_features features = 0;
    if (f->quality.density == SCATTER_DENSITY_EXACT && m->gaussians.count > 0)
        features |= SCATTERI_GL_HAS(GAUSSIANS);
    if (scatteri_gl_few_and_thin(f))
        features |= SCATTERI_GL_HAS(FEW_THIN);
    if (f->density != NULL)
        features |= SCATTERI_GL_HAS(FIELD);
    if (m->has_analytic)
        features |= SCATTERI_GL_HAS(FOG);
    if (m->desc.bounded)
        features |= SCATTERI_GL_HAS(BOUNDED);
    if (!m->gray)
        features |= SCATTERI_GL_HAS(COLORED);
    if (e.x > 0.0f || e.y > 0.0f || e.z > 0.0f)
        features |= SCATTERI_GL_HAS(EMISSION);
    if (m->lobes.weight > 0.0f)
        features |= SCATTERI_GL_HAS(TWO_LOBES);
    else if (m->lobes.g1 > 0.0f || m->lobes.alpha1 > 0.0f)
        features |= SCATTERI_GL_HAS(ONE_LOBE);
    if (f->quality.ray == SCATTER_RAY_MARCH)
        features |= SCATTERI_GL_HAS(MARCH);
    if (m->gaussians.count > 0 && f->quality.depth == SCATTER_DEPTH_CLOSED)
        features |= SCATTERI_GL_HAS(CLOSED);
    if (m->has_local && f->quality.depth == SCATTER_DEPTH_POLAR)
        features |= SCATTERI_GL_HAS(POLAR);
    else if (m->has_local && f->quality.depth != SCATTER_DEPTH_CLOSED)
        features |= SCATTERI_GL_HAS(CELLS);
    if (f->has_eye && (features & SCATTERI_GL_HAS(CELLS)) != 0)
        features |= SCATTERI_GL_HAS(EYE);
    return features | scatteri_gl_skip_features(f);
}

static int scatteri_gl_lights_per_batch(const scatter_gl *f)
{
    return SCATTERI_GL_BATCH - f->has_eye;
}

/* The source in a channel of a batch, or NULL. The eye, if it is a source, has channel 0 of every batch. */
static scatteri_gl_lamp *scatteri_gl_source_in(scatter_gl *f, int batch, int channel)
{
    const int i = batch * scatteri_gl_lights_per_batch(f) + channel - f->has_eye;
    if (f->has_eye && channel == 0)
        return &f->lamps[f->desc.max_lights];
    return i < f->lamp_count ? &f->lamps[i] : NULL;
}

static scatteri_gl_features scatteri_gl_lamp_features(const scatteri_gl_lamp *lamp, int channel)
{
    static const scatteri_gl_features kinds[] = {0, SCATTERI_GL_HAS(SPOT),
                                                 SCATTERI_GL_HAS(DIRECTIONAL)};
    scatteri_gl_features features = kinds[lamp->desc.light.kind];
    if (lamp->desc.shadow.kind != SCATTER_GL_SHADOW_NONE)
        features |= SCATTERI_GL_HAS(SHADOW_2D_0) << (3 * channel + (int)lamp->desc.shadow.kind - 1);
    return features;
}

/* Kinds of the lights of a batch, and of their shadows. */
static scatteri_gl_features scatteri_gl_batch_features(scatter_gl *f, int batch)
{
    scatteri_gl_features features = 0;
    int channel;
    for (channel = f->has_eye; channel < (int)SCATTERI_GL_BATCH; channel++) {
        const scatteri_gl_lamp *lamp = scatteri_gl_source_in(f, batch, channel);
        if (lamp != NULL)
            features |= scatteri_gl_lamp_features(lamp, channel);
    }
    return features;
}

/* Whether a batch can be drawn together with others. Rays to many lights are turns of a loop that llvmpipe ends early. */
static int scatteri_gl_is_plain(scatter_gl *f, int batch)
{
    int channel, shadows = 0;
    for (channel = 0; channel < (int)SCATTERI_GL_BATCH; channel++) {
        const scatteri_gl_lamp *lamp = scatteri_gl_source_in(f, batch, channel);
        shadows |= lamp != NULL && lamp->desc.shadow.kind != SCATTER_GL_SHADOW_NONE;
    }
    return !f->has_eye && !shadows && !scatteri_gl_casts_rays(f);
}

/* Batches from `first` on that are drawn at once: what a ray meets is looked for once then. Their volumes are in one
   texture, and they need no units for shadow maps. */
static int scatteri_gl_group_of(scatter_gl *f, int first)
{
    int next = first + 1;
    while (next - first < (int)SCATTERI_GL_GROUP && next < f->batch_count &&
           (f->layers == 0 || next % f->stacked != 0) && scatteri_gl_is_plain(f, first) &&
           scatteri_gl_is_plain(f, next))
        next++;
    return next - first;
}

static scatteri_gl_features scatteri_gl_group_features(scatter_gl *f, int first)
{
    const int count = scatteri_gl_group_of(f, first);
    scatteri_gl_features features = 0;
    int i;
    for (i = 0; i < count; i++)
        features |= scatteri_gl_batch_features(f, first + i);
    return features;
}

/* The block of the lights of `count` batches. */
static void scatteri_gl_send_lights(scatter_gl *f, int first, int count)
{
    int slot, used = 0;
    memset(&f->lights_block, 0, sizeof f->lights_block);
    for (slot = 0; slot < count * (int)SCATTERI_GL_BATCH; slot++) {
        const scatteri_gl_lamp *lamp = scatteri_gl_source_in(
            f, first + slot / (int)SCATTERI_GL_BATCH, slot % (int)SCATTERI_GL_BATCH);
        if (lamp == NULL)
            break;
        scatteri_gl_put_lamp(f, slot, lamp);
        used = slot + 1;
    }
    scatteri_gl_put(f->lights_block.batch, (float)used, (float)f->has_eye, (float)f->layers,
                    (float)(first % f->stacked * f->layers));
    scatteri_gl_send(f, f->light_buffers[first], &f->lights_block, sizeof f->lights_block);
}

/* --- tables --- */

static void scatteri_gl_send_gaussians(scatter_gl *f)
{
    const scatteri_gaussians *g = &f->medium.gaussians;
    const int rows = (2 * g->count + SCATTERI_GL_ROW - 1) / SCATTERI_GL_ROW;
    int i;
    if (rows == 0)
        return;
    memset(f->scratch, 0, (size_t)rows * SCATTERI_GL_ROW * 4 * sizeof(float));
    for (i = 0; i < g->count; i++)
        scatteri_gl_put_gaussian(f, i, f->scratch + 8 * i);
    scatteri_gl_upload(f, &f->gaussians, rows, f->scratch);
}

/* Rule r has about (r + 1)/8 of the nodes, as on the CPU; a rule of too many is empty. */
static void scatteri_gl_send_rules(scatter_gl *f)
{
    int r, i;
    if (f->rule_nodes == f->quality.nodes || f->quality.ray == SCATTER_RAY_MARCH)
        return;
    memset(f->scratch, 0, (size_t)SCATTERI_NODES * SCATTERI_RULES * 2 * sizeof(float));
    for (r = 0; r < SCATTERI_RULES; r++) {
        const int n = (f->quality.nodes * (r + 1) + SCATTERI_EIGHTH - 1) / SCATTERI_EIGHTH;
        for (i = 0; i < n && n <= SCATTERI_NODES; i++) {
            const scatteri_vec2 node = scatteri_legendre(i, n);
            f->scratch[2 * (r * SCATTERI_NODES + i)] = node.x;
            f->scratch[2 * (r * SCATTERI_NODES + i) + 1] = node.y;
        }
    }
    scatteri_gl_upload(f, &f->rules, SCATTERI_RULES, f->scratch);
    f->rule_nodes = f->quality.nodes;
}

/* --- volumes --- */

static int scatteri_gl_volume_format(const scatter_gl *f)
{
    return f->desc.half_float || !f->can_filter_float ? SCATTERI_GL_RGBA16F : SCATTERI_GL_RGBA32F;
}

static int scatteri_gl_field_format(const scatter_gl *f)
{
    return f->desc.half_float || !f->can_filter_float ? SCATTERI_GL_R16F : SCATTERI_GL_R32F;
}

/* Injects the medium if what is in the field is out of date. */
static scatter_result scatteri_gl_refresh_field(scatter_gl *f)
{
    const int n = f->quality.grid;
    /* Where 32 bits cannot be blended, 16 can. */
    const int halves = f->medium.desc.grid_count > 1 && !f->can_blend_float;
    const int format = halves ? (int)SCATTERI_GL_R16F : scatteri_gl_field_format(f);
    scatter_result result;
    if (f->field.width != n || f->field.format != format)
        f->injected_version = -1;
    result = scatteri_gl_size_texture(f, &f->field, format, n, n, n);
    if (result != SCATTER_OK || f->injected_version == f->medium_version)
        return result;
    scatteri_gl_begin_timer(f, SCATTERI_GL_TIME_INJECT);
    result = scatteri_gl_inject(f);
    scatteri_gl_end_timer(f, SCATTERI_GL_TIME_INJECT);
    f->stats.injections++;
    f->injected_version = result == SCATTER_OK ? f->medium_version : -1;
    return result;
}

/* Which texture density is read from, if any. */
static scatter_result scatteri_gl_update_field(scatter_gl *f)
{
    const int exact = f->quality.density == SCATTER_DENSITY_EXACT;
    scatter_result result = SCATTER_OK;
    f->density = NULL;
    if (!f->medium.has_local)
        return SCATTER_OK;
    if (!exact || f->quality.depth == SCATTER_DEPTH_UPWIND)
        result = scatteri_gl_refresh_field(f);
    f->density = !exact ? &f->field : f->medium.desc.grid_count > 0 ? &f->grids[0] : NULL;
    return result;
}

/* Makes the distance map of that field if there is another one. */
static scatter_result scatteri_gl_update_distance(scatter_gl *f)
{
    const scatteri_gl_texture *d = f->density, *s = &f->spaced;
    scatter_result result;
    if (!scatteri_gl_jumps(f) ||
        (f->spaced_of == d && f->spaced_version == f->medium_version && s->width == d->width))
        return SCATTER_OK;
    result = scatteri_gl_measure_distance(f);
    f->spaced_of = result == SCATTER_OK ? d : NULL;
    f->spaced_version = f->medium_version;
    return result;
}

/* Cells of the volume of a source on each axis. */
static void scatteri_gl_shape(scatter_depth *d, int n)
{
    scatteri_shape(d, n);
    if (d->method == SCATTER_DEPTH_POLAR && d->source.directional && d->medium->desc.grid_count > 0)
        d->nx = d->ny = n;
}

/* Columns of a directional source: along its light, through the local box. */
static void scatteri_gl_parallel_columns(scatter_depth *d)
{
    float high_u = -SCATTERI_FAR, high_v = -SCATTERI_FAR, high_r = -SCATTERI_FAR;
    int i;
    d->box = d->medium->local;
    scatteri_polar_frame(d, d->source.direction);
    d->low_u = d->low_v = d->low_r = SCATTERI_FAR;
    for (i = 0; i < 8; i++) {
        const scatter_vec3 x = scatteri_sub(scatteri_corner(d->box, i), d->box.min);
        const float u = scatteri_dot(x, d->axis_u), v = scatteri_dot(x, d->axis_v),
                    r = scatteri_dot(x, d->axis_w);
        d->low_u = scatteri_min(d->low_u, u);
        d->low_v = scatteri_min(d->low_v, v);
        d->low_r = scatteri_min(d->low_r, r);
        high_u = scatteri_max(high_u, u);
        high_v = scatteri_max(high_v, v);
        high_r = scatteri_max(high_r, r);
    }
    scatteri_polar_steps(d, high_u, high_v, high_r);
}

/* Where the cells or columns of a source lie. */
static void scatteri_gl_lay_out(scatter_gl *f, scatteri_gl_lamp *lamp)
{
    scatter_depth *d = &lamp->layout;
    memset(d, 0, sizeof *d);
    d->medium = &f->medium;
    d->source = scatteri_source_of(&lamp->desc.light);
    d->method = f->quality.depth;
    if (!f->medium.has_local || d->method == SCATTER_DEPTH_CLOSED)
        return;
    scatteri_gl_shape(d, f->quality.grid);
    if (d->method == SCATTER_DEPTH_POLAR && d->source.directional)
        scatteri_gl_parallel_columns(d);
    else
        scatteri_lay_out(d, f->quality.grid);
    d->at_source =
        d->source.directional ? 0.0f : scatteri_local_density(&f->medium, d->source.position);
}

/* --- stacks --- */

enum { SCATTERI_GL_MOST_STACK = 1 << 29 }; /* bytes of a texture of several batches */

/* Cells of the lamp's volume on each axis; 0: it needs none. */
static void scatteri_gl_shape_of(const scatter_gl *f, const scatteri_gl_lamp *lamp, int *size)
{
    scatter_depth d;
    memset(&d, 0, sizeof d);
    d.medium = &f->medium;
    d.method = f->quality.depth;
    d.source.directional = lamp->desc.light.kind == SCATTER_LIGHT_DIRECTIONAL;
    if (f->medium.has_local && d.method != SCATTER_DEPTH_CLOSED)
        scatteri_gl_shape(&d, f->quality.grid);
    size[0] = d.nx;
    size[1] = d.ny;
    size[2] = d.nz;
}

/* All volumes are out of date; not `held`: and of no use. */
static void scatteri_gl_forget_volumes(scatter_gl *f, int held)
{
    int i;
    for (i = 0; i <= f->desc.max_lights; i++) {
        f->lamps[i].filled = 0;
        f->lamps[i].held &= held;
    }
}

static void scatteri_gl_forget_batch(scatter_gl *f, int batch)
{
    int channel;
    for (channel = 0; channel < (int)SCATTERI_GL_BATCH; channel++) {
        scatteri_gl_lamp *lamp = scatteri_gl_source_in(f, batch, channel);
        if (lamp != NULL)
            lamp->filled = lamp->held = 0;
    }
}

/* Whether depth of before can be read: columns know where they lie, cells lie in the local box. */
static int scatteri_gl_still_fits(const scatter_gl *f, const scatteri_gl_lamp *lamp,
                                  const int *size)
{
    const scatter_depth *d = &lamp->layout;
    const int directional = lamp->desc.light.kind == SCATTER_LIGHT_DIRECTIONAL;
    return size[0] == d->nx && size[2] == d->nz && directional == d->source.directional &&
           (d->method == SCATTER_DEPTH_POLAR || scatteri_same_box(d->box, f->medium.local));
}

/* The most cells on each axis that a lamp of the batch needs. What was filled for another shape is of no use. */
static void scatteri_gl_shape_of_batch(scatter_gl *f, int batch, int *size)
{
    int channel, k, other = 0;
    for (channel = 0; channel < (int)SCATTERI_GL_BATCH; channel++) {
        const scatteri_gl_lamp *lamp = scatteri_gl_source_in(f, batch, channel);
        int own[3];
        if (lamp == NULL)
            break;
        scatteri_gl_shape_of(f, lamp, own);
        other |= !scatteri_gl_still_fits(f, lamp, own);
        for (k = 0; k < 3; k++)
            size[k] = own[k] > size[k] ? own[k] : size[k];
    }
    if (other)
        scatteri_gl_forget_batch(f, batch);
}

/* Batches to a texture: as many as its layers and bytes allow. */
static int scatteri_gl_batches_to_a_texture(const scatter_gl *f, const int *size)
{
    const size_t bytes = (size_t)scatteri_gl_texel(scatteri_gl_volume_format(f)) *
                         (size_t)size[0] * (size_t)size[1] * (size_t)size[2];
    const int by_bytes = (int)((size_t)SCATTERI_GL_MOST_STACK / bytes);
    return scatteri_clamp_int(f->max_3d / size[2], 1, by_bytes > 1 ? by_bytes : 1);
}

/* A texture for the batches from `first` on. It only grows while their cells stay as many. */
static scatter_result scatteri_gl_reserve_stack(scatter_gl *f, int first, const int *size)
{
    scatteri_gl_texture *t = &f->volumes[first / f->stacked];
    const int format = scatteri_gl_volume_format(f), left = f->batch_count - first;
    const int batches = left < f->stacked ? left : f->stacked;
    int i;
    if (t->format == format && t->width == size[0] && t->height == size[1] &&
        t->depth >= batches * size[2])
        return SCATTER_OK;
    for (i = 0; i < batches; i++)
        scatteri_gl_forget_batch(f, first + i);
    return scatteri_gl_size_texture(f, t, format, size[0], size[1], batches * size[2]);
}

static int scatteri_gl_most_batches(const scatter_gl *f)
{
    return (f->desc.max_lights + SCATTERI_GL_BATCH - 2) / (SCATTERI_GL_BATCH - 1) + 1;
}

static void scatteri_gl_drop_volumes(scatter_gl *f)
{
    int i;
    for (i = 0; i < scatteri_gl_most_batches(f); i++)
        scatteri_gl_drop_texture(f, &f->volumes[i]);
    scatteri_gl_forget_volumes(f, 0);
}

/* Room for the volumes of all batches. */
static scatter_result scatteri_gl_reserve_volumes(scatter_gl *f)
{
    int batch, stacked, size[3] = {0, 0, 0};
    scatter_result result = SCATTER_OK;
    for (batch = 0; batch < f->batch_count; batch++)
        scatteri_gl_shape_of_batch(f, batch, size);
    stacked = size[0] > 0 ? scatteri_gl_batches_to_a_texture(f, size) : 1;
    if (stacked != f->stacked || size[2] != f->layers)
        scatteri_gl_drop_volumes(f);
    f->stacked = stacked;
    f->layers = size[2];
    for (batch = 0; batch < f->batch_count && size[0] > 0 && result == SCATTER_OK;
         batch += stacked)
        result = scatteri_gl_reserve_stack(f, batch, size);
    return result;
}

/* The layers that belong to a batch, as far as its own lamps need them. */
static scatteri_gl_texture scatteri_gl_volume_of(scatter_gl *f, int batch)
{
    scatteri_gl_texture part = f->volumes[batch / f->stacked];
    int channel;
    part.first = batch % f->stacked * f->layers;
    part.width = part.height = part.depth = 0;
    for (channel = 0; channel < (int)SCATTERI_GL_BATCH; channel++) {
        const scatteri_gl_lamp *lamp = scatteri_gl_source_in(f, batch, channel);
        const scatter_depth *d = lamp != NULL ? &lamp->layout : NULL;
        if (d == NULL)
            break;
        part.width = d->nx > part.width ? d->nx : part.width;
        part.height = d->ny > part.height ? d->ny : part.height;
        part.depth = d->nz > part.depth ? d->nz : part.depth;
    }
    return part;
}

/* --- batches --- */

static scatter_result scatteri_gl_fill_volume_of(scatter_gl *f, int batch)
{
    scatteri_gl_texture volume;
    scatter_result result = SCATTER_OK;
    int channel;
    for (channel = 0; channel < (int)SCATTERI_GL_BATCH; channel++) {
        scatteri_gl_lamp *lamp = scatteri_gl_source_in(f, batch, channel);
        if (lamp != NULL && !lamp->filled)
            scatteri_gl_lay_out(f, lamp);
    }
    scatteri_gl_send_lights(f, batch, 1);
    volume = scatteri_gl_volume_of(f, batch);
    if (volume.width > 0) {
        result = scatteri_gl_propagate(f, batch, &volume);
        f->stats.propagations++;
    }
    for (channel = 0; channel < (int)SCATTERI_GL_BATCH && result == SCATTER_OK; channel++) {
        scatteri_gl_lamp *lamp = scatteri_gl_source_in(f, batch, channel);
        if (lamp != NULL) {
            lamp->filled = lamp->held = 1;
            lamp->filled_at = f->updates;
        }
    }
    return result;
}

/* What its volume lacks: 2: depth of some lamp, 1: depth of where a lamp is now, 0: nothing. */
static int scatteri_gl_lacks(scatter_gl *f, int batch)
{
    int channel, lacks = 0;
    for (channel = 0; channel < (int)SCATTERI_GL_BATCH; channel++) {
        const scatteri_gl_lamp *lamp = scatteri_gl_source_in(f, batch, channel);
        const int here = lamp == NULL || lamp->filled ? 0 : lamp->held ? 1 : 2;
        lacks = here > lacks ? here : lacks;
    }
    return lacks;
}

/* Updates since a batch was filled; the most where it has no lights. */
static unsigned scatteri_gl_age(scatter_gl *f, int batch)
{
    const scatteri_gl_lamp *lamp = scatteri_gl_source_in(f, batch, f->has_eye);
    return lamp != NULL ? f->updates - lamp->filled_at : ~0u;
}

/* Of the batches that are out of date, the one that was filled longest ago; -1: none is. */
static int scatteri_gl_oldest(scatter_gl *f)
{
    int batch, oldest = -1;
    for (batch = 0; batch < f->batch_count; batch++)
        if (scatteri_gl_lacks(f, batch) > 0 &&
            (oldest < 0 || scatteri_gl_age(f, batch) > scatteri_gl_age(f, oldest)))
            oldest = batch;
    return oldest;
}

/* Volumes that hold nothing, and as many of those out of date as quality.lights_per_update allows; the others keep the
   layout with which they were filled. */
static scatter_result scatteri_gl_update_batches(scatter_gl *f)
{
    const int per_batch = scatteri_gl_lights_per_batch(f), lights = f->quality.lights_per_update;
    int batch, left = lights > 0 ? (lights + per_batch - 1) / per_batch : f->batch_count;
    scatter_result result = SCATTER_OK;
    f->updates++;
    for (batch = 0; batch < f->batch_count && result == SCATTER_OK; batch++)
        if (scatteri_gl_lacks(f, batch) == 2)
            result = scatteri_gl_fill_volume_of(f, batch);
    for (; left > 0 && result == SCATTER_OK && (batch = scatteri_gl_oldest(f)) >= 0; left--)
        result = scatteri_gl_fill_volume_of(f, batch);
    for (batch = 0; batch < f->batch_count && result == SCATTER_OK;
         batch += scatteri_gl_group_of(f, batch))
        scatteri_gl_send_lights(f, batch, scatteri_gl_group_of(f, batch));
    return result;
}

/* --- quality --- */

/* Gaussians up to which depth to the lights, and density on the ray, are in closed form unless something else is asked
   for. */
enum { SCATTERI_GL_CLOSED = 16, SCATTERI_GL_EXACT = 256 };

/* Directional lights. */
static size_t scatteri_gl_suns(const scatter_gl *f)
{
    size_t suns = 0;
    int i;
    for (i = 0; i < f->lamp_count; i++)
        suns += f->lamps[i].desc.light.kind == SCATTER_LIGHT_DIRECTIONAL ? 1u : 0u;
    return suns;
}

static scatter_quality scatteri_gl_resolve(const scatter_gl *f, const scatter_quality *quality)
{
    const scatter_medium *m = &f->medium.desc;
    const int exact = m->gaussian_count <= SCATTERI_GL_EXACT && m->grid_count <= 1;
    scatter_quality q;
    memset(&q, 0, sizeof q);
    if (quality != NULL)
        q = *quality;
    if (q.depth == SCATTER_DEPTH_AUTO)
        q.depth =
            m->grid_count == 0 && (m->gaussian_count <= SCATTERI_GL_CLOSED || !f->can_draw_float)
                ? SCATTER_DEPTH_CLOSED
                : SCATTER_DEPTH_POLAR;
    if (q.density == SCATTER_DENSITY_AUTO)
        q.density = exact ? SCATTER_DENSITY_EXACT : SCATTER_DENSITY_VOLUME;
    q.nodes = q.nodes != 0 ? q.nodes : 16;
    q.grid = scatteri_choose_grid(q.grid, m,
                                  q.depth == SCATTER_DEPTH_POLAR ? scatteri_gl_suns(f) : 0);
    return q;
}

static scatter_result scatteri_gl_check_quality(scatter_gl *f, const scatter_quality *q)
{
    const scatter_medium *m = &f->medium.desc;
    if (q->depth == SCATTER_DEPTH_EQ6 || q->depth == SCATTER_DEPTH_SHORT ||
        q->depth == SCATTER_DEPTH_MARCH)
        return scatteri_fail(&f->host, SCATTER_BAD_ARGUMENT,
                             "quality.depth is %d, on the GPU it must be auto, closed, closed "
                             "volume, upwind or polar",
                             (int)q->depth);
    if (m->grid_count > 0 && q->depth <= SCATTER_DEPTH_CLOSED_VOLUME &&
        (q->depth != SCATTER_DEPTH_CLOSED || q->density != SCATTER_DENSITY_EXACT))
        return scatteri_fail(&f->host, SCATTER_BAD_ARGUMENT,
                             "quality.depth is %d, on the GPU grids need polar or upwind, or "
                             "closed with quality.density exact",
                             (int)q->depth);
    if (q->density == SCATTER_DENSITY_EXACT && m->grid_count > 1)
        return scatteri_fail(
            &f->host, SCATTER_BAD_ARGUMENT,
            "quality.density is exact, on the GPU more than one grid needs volume");
    if (q->depth != SCATTER_DEPTH_CLOSED && f->medium.has_local && !f->can_draw_float)
        return scatteri_fail(&f->host, SCATTER_UNSUPPORTED,
                             "this GL context cannot draw into float textures (no "
                             "EXT_color_buffer_float): quality.depth must be closed");
    if (q->density == SCATTER_DENSITY_VOLUME && f->medium.has_local && !f->can_draw_float)
        return scatteri_fail(&f->host, SCATTER_UNSUPPORTED,
                             "this GL context cannot draw into float textures (no "
                             "EXT_color_buffer_float): quality.density must be exact");
    return SCATTER_OK;
}

static int scatteri_gl_same_quality(const scatter_quality *a, const scatter_quality *b)
{
    return a->depth == b->depth && a->density == b->density && a->grid == b->grid;
}

/* The eye as the last lamp. It has a channel in every batch. */
static void scatteri_gl_place_eye(scatter_gl *f, const scatter_vec3 *eye)
{
    scatteri_gl_lamp *lamp = &f->lamps[f->desc.max_lights];
    const int has_eye = eye != NULL;
    const int stays = f->has_eye == has_eye &&
                      (!has_eye || memcmp(&lamp->desc.light.position, eye, sizeof *eye) == 0);
    if (!stays)
        scatteri_gl_forget_volumes(f, 0);
    f->has_eye = has_eye;
    if (!has_eye)
        return;
    memset(&lamp->desc, 0, sizeof lamp->desc);
    lamp->desc.light.position = *eye;
}

/* How much of the rims is left out, as on the CPU. */
static void scatteri_gl_update_trim(scatter_gl *f)
{
    int i;
    f->trim = scatteri_trim_of(&f->medium, &f->quality);
    for (i = 0; i < f->lamp_count; i++)
        f->lamps[i].in_rim =
            scatteri_in_rim(&f->medium.gaussians, f->trim.rays, f->lamps[i].desc.light.position);
}

static scatter_result scatteri_gl_update_all(scatter_gl *f)
{
    scatter_result result;
    const int per_batch = scatteri_gl_lights_per_batch(f);
    f->batch_count = f->lamp_count > 0 ? (f->lamp_count + per_batch - 1) / per_batch : 1;
    scatteri_gl_send_rules(f);
    scatteri_gl_update_trim(f);
    result = scatteri_gl_update_field(f);
    scatteri_gl_send_medium(f);
    if (result == SCATTER_OK)
        result = scatteri_gl_update_distance(f);
    scatteri_gl_begin_timer(f, SCATTERI_GL_TIME_DEPTH);
    if (result == SCATTER_OK)
        result = scatteri_gl_reserve_volumes(f);
    if (result == SCATTER_OK)
        result = scatteri_gl_update_batches(f);
    scatteri_gl_end_timer(f, SCATTERI_GL_TIME_DEPTH);
    return result;
}

SCATTER_API scatter_result scatter_gl_update(scatter_gl *f, const scatter_quality *quality,
                                             const scatter_vec3 *eye)
{
    scatteri_where at = {NULL, "eye", -1};
    scatteri_gl_state state;
    scatter_quality q;
    scatter_result result;
    if (f == NULL)
        return SCATTER_BAD_ARGUMENT;
    at.host = &f->host;
    f->ready = 0;
    if ((quality != NULL && !scatteri_check_quality(&f->host, quality)) ||
        (eye != NULL && !scatteri_check_point(&at, "", *eye)))
        return SCATTER_BAD_ARGUMENT;
    if (!f->has_medium)
        return scatteri_fail(&f->host, SCATTER_BAD_ARGUMENT,
                             "the last scatter_gl_set_medium failed, a successful one is needed");
    q = scatteri_gl_resolve(f, quality);
    result = scatteri_gl_check_quality(f, &q);
    if (result != SCATTER_OK)
        return result;
    if (!scatteri_gl_same_quality(&q, &f->quality))
        scatteri_gl_forget_volumes(f, 0);
    f->quality = q;
    scatteri_gl_place_eye(f, eye);
    scatteri_gl_save(f, &state);
    result = scatteri_gl_update_all(f);
    scatteri_gl_restore(f, &state);
    f->ready = result == SCATTER_OK;
    return result;
}

/* ------------------------------------------------------------------------------------------- >>view */

typedef struct scatteri_gl_matrix {
    double m[16]; /* column-major */
} scatteri_gl_matrix;

static scatteri_gl_matrix scatteri_gl_product(scatteri_gl_matrix a, scatteri_gl_matrix b)
{
    scatteri_gl_matrix p;
    int column, row, k;
    for (column = 0; column < 4; column++)
        for (row = 0; row < 4; row++) {
            p.m[4 * column + row] = 0.0;
            for (k = 0; k < 4; k++)
                p.m[4 * column + row] += a.m[4 * k + row] * b.m[4 * column + k];
        }
    return p;
}

static void scatteri_gl_swap_rows(scatteri_gl_matrix *m, int a, int b)
{
    int column;
    for (column = 0; column < 4; column++) {
        const double v = m->m[4 * column + a];
        m->m[4 * column + a] = m->m[4 * column + b];
        m->m[4 * column + b] = v;
    }
}

/* row `to` -= factor row `from` */
static void scatteri_gl_subtract_row(scatteri_gl_matrix *m, int to, int from, double factor)
{
    int column;
    for (column = 0; column < 4; column++)
        m->m[4 * column + to] -= factor * m->m[4 * column + from];
}

/* Gauss and Jordan with pivots; 0 if there is no inverse. */
static int scatteri_gl_invert(const float *of, scatteri_gl_matrix *inverse)
{
    scatteri_gl_matrix a;
    int i, row, column;
    for (i = 0; i < 16; i++) {
        a.m[i] = (double)of[i];
        inverse->m[i] = i % 5 == 0 ? 1.0 : 0.0;
    }
    for (i = 0; i < 4; i++) {
        int best = i;
        for (row = i; row < 4; row++)
            best = fabs(a.m[4 * i + row]) > fabs(a.m[4 * i + best]) ? row : best;
        if (!(fabs(a.m[4 * i + best]) > 0.0 && fabs(a.m[4 * i + best]) < 1e300))
            return 0;
        scatteri_gl_swap_rows(&a, i, best);
        scatteri_gl_swap_rows(inverse, i, best);
        for (row = 0; row < 4; row++) {
            const double factor = a.m[4 * i + row] / a.m[4 * i + i];
            if (row != i) {
                scatteri_gl_subtract_row(&a, row, i, factor);
                scatteri_gl_subtract_row(inverse, row, i, factor);
            }
        }
    }
    for (row = 0; row < 4; row++)
        for (column = 0; column < 4; column++)
            inverse->m[4 * column + row] /= a.m[4 * row + row];
    return 1;
}

static scatter_vec3 scatteri_gl_column(const scatteri_gl_matrix *m, int column, double scale)
{
    return scatteri_v3((float)(m->m[4 * column] * scale), (float)(m->m[4 * column + 1] * scale),
                       (float)(m->m[4 * column + 2] * scale));
}

/* Rays of a perspective camera. Clip (0, 0, 1, 0) is the eye; seen from there, the direction does not depend on z. */
static void scatteri_gl_perspective(scatter_gl *f, scatteri_gl_matrix m)
{
    scatteri_gl_view_block *b = &f->view_block;
    const double e[3] = {m.m[8] / m.m[11], m.m[9] / m.m[11], m.m[10] / m.m[11]};
    int column, row;
    for (column = 0; column < 4; column++)
        for (row = 0; row < 3; row++)
            m.m[4 * column + row] -= e[row] * m.m[4 * column + 3];
    scatteri_gl_put(b->eye, (float)(e[0] - (double)f->ref.x), (float)(e[1] - (double)f->ref.y),
                    (float)(e[2] - (double)f->ref.z), 0.0f);
    scatteri_gl_put3(b->forward, scatteri_gl_column(&m, 3, 1.0), 0.0f);
    scatteri_gl_put3(b->forward_dx, scatteri_gl_column(&m, 0, 1.0), 0.0f);
    scatteri_gl_put3(b->forward_dy, scatteri_gl_column(&m, 1, 1.0), 0.0f);
    scatteri_gl_put(b->weight, (float)m.m[3], (float)m.m[7], (float)m.m[11], (float)m.m[15]);
    b->range[0] = 0.0f;
    b->range[1] = 1.0f;
}

/* Rays of an orthographic camera begin at the near plane, at clip z `first`, and go to `last`. */
static void scatteri_gl_parallel(scatter_gl *f, scatteri_gl_matrix m, double first, double last)
{
    scatteri_gl_view_block *b = &f->view_block;
    const double inverse = 1.0 / m.m[15], sense = last > first ? 1.0 : -1.0;
    const double origin[3] = {(m.m[12] + first * m.m[8]) * inverse - (double)f->ref.x,
                              (m.m[13] + first * m.m[9]) * inverse - (double)f->ref.y,
                              (m.m[14] + first * m.m[10]) * inverse - (double)f->ref.z};
    scatteri_gl_put(b->eye, (float)origin[0], (float)origin[1], (float)origin[2], 0.0f);
    scatteri_gl_put3(b->eye_dx, scatteri_gl_column(&m, 0, inverse), 0.0f);
    scatteri_gl_put3(b->eye_dy, scatteri_gl_column(&m, 1, inverse), 0.0f);
    scatteri_gl_put3(b->forward, scatteri_gl_column(&m, 2, sense * inverse), 0.0f);
    scatteri_gl_put(b->weight, 0.0f, 0.0f, 0.0f, 1.0f);
    b->range[0] = (float)sense;
    b->range[1] = (float)(-sense * first);
}

static scatter_result scatteri_gl_set_camera(scatter_gl *f, const scatter_gl_view *v)
{
    scatteri_gl_view_block *b = &f->view_block;
    const double low = v->zero_to_one ? 0.0 : -1.0;
    const double first = v->reversed ? 1.0 : low, last = v->reversed ? low : 1.0;
    scatteri_gl_matrix view, projection, m;
    double here, there;
    if (v->view == NULL || v->projection == NULL || !scatteri_gl_invert(v->view, &view) ||
        !scatteri_gl_invert(v->projection, &projection))
        return scatteri_fail(&f->host, SCATTER_BAD_ARGUMENT,
                             "view.view or view.projection is not a matrix that has an inverse");
    memset(b, 0, sizeof *b);
    m = scatteri_gl_product(view, projection);
    here = m.m[11] * first + m.m[15];
    there = m.m[11] * last + m.m[15];
    if (fabs(here - there) > 1e-6 * fabs(here))
        scatteri_gl_perspective(f, m);
    else
        scatteri_gl_parallel(f, m, first, last);
    b->range[2] = v->zero_to_one ? 1.0f : 2.0f;
    b->range[3] = v->zero_to_one ? 0.0f : -1.0f;
    return SCATTER_OK;
}

static scatter_result scatteri_gl_check_view(scatter_gl *f, const scatter_gl_view *v)
{
    if (v == NULL || v->width < 0 || v->height < 0)
        return scatteri_fail(&f->host, SCATTER_BAD_ARGUMENT,
                             "view is NULL, or its width or height is below 0");
    if (v->divide != 0 && v->divide != 1 && v->divide != 2 && v->divide != 4)
        return scatteri_fail(&f->host, SCATTER_BAD_ARGUMENT,
                             "view.divide is %d, it must be 0, 1, 2 or 4", v->divide);
    if ((int)v->show < 0 || (int)v->show > (int)SCATTER_GL_SHOW_ERROR)
        return scatteri_fail(&f->host, SCATTER_BAD_ARGUMENT,
                             "view.show is %d, it must be one of scatter_gl_show", (int)v->show);
    return scatteri_gl_set_camera(f, v);
}

/* Rays of a window in which clip y points down. */
static void scatteri_gl_turn_camera(scatter_gl *f)
{
    scatteri_gl_view_block *b = &f->view_block;
    int i;
    for (i = 0; i < 3; i++) {
        b->eye_dy[i] = -b->eye_dy[i];
        b->forward_dy[i] = -b->forward_dy[i];
    }
    b->weight[1] = -b->weight[1];
}

static void scatteri_gl_send_view(scatter_gl *f, const scatter_gl_view *v, int divide)
{
    scatteri_gl_view_block *b = &f->view_block;
    scatteri_gl_put(b->window, (float)v->x, (float)v->y, 2.0f / (float)v->width,
                    2.0f / (float)v->height);
    scatteri_gl_put(b->picture, v->reversed ? 0.0f : 1.0f, (float)divide,
                    v->depth_texture != 0 ? 1.0f : 0.0f, -1.0f);
    scatteri_gl_put(b->show, (float)v->show, (float)v->show_light, 0.0f, 0.0f);
    scatteri_gl_send(f, f->view_buffer, b, sizeof *b);
}

/* The field as rays read it. */
static const scatteri_gl_texture *scatteri_gl_read_field(const scatter_gl *f)
{
    return scatteri_gl_jumps(f) ? &f->spaced : f->density;
}

static void scatteri_gl_bind_medium(const scatter_gl *f)
{
    scatteri_gl_read_texels(f, SCATTERI_GL_UNIT_GAUSSIANS, &f->gaussians);
    scatteri_gl_read_texels(f, SCATTERI_GL_UNIT_RULES, &f->rules);
    scatteri_gl_read_smooth(f, SCATTERI_GL_UNIT_FIELD, scatteri_gl_read_field(f));
}

/* Lights of a batch, their depth and their shadow maps. */
static void scatteri_gl_bind_batch(scatter_gl *f, int batch)
{
    static const unsigned targets[] = {0, SCATTERI_GL_TEXTURE_2D, SCATTERI_GL_ARRAY_2D,
                                       SCATTERI_GL_CUBE};
    int channel;
    f->gl.BindBufferBase(SCATTERI_GL_UNIFORM_BUFFER, 1, f->light_buffers[batch]);
    scatteri_gl_read_smooth(f, SCATTERI_GL_UNIT_VOLUME, &f->volumes[batch / f->stacked]);
    for (channel = 0; channel < (int)SCATTERI_GL_BATCH; channel++) {
        const scatteri_gl_lamp *lamp = scatteri_gl_source_in(f, batch, channel);
        if (lamp != NULL && lamp->desc.shadow.kind != SCATTER_GL_SHADOW_NONE)
            scatteri_gl_bind(f, SCATTERI_GL_UNIT_SHADOW + channel, targets[lamp->desc.shadow.kind],
                             lamp->desc.shadow.texture, f->nearest);
    }
}

/* Draws T of the rays, times what is there, or in its place. */
static scatter_result scatteri_gl_draw_transmittance(scatter_gl *f, scatteri_gl_features features,
                                                     int over)
{
    const scatteri_gl_program *program;
    const scatter_result result = scatteri_gl_use(
        f, SCATTERI_GL_PASS_VIEW, features | SCATTERI_GL_HAS(TRANSMITTANCE), 1, &program);
    if (result != SCATTER_OK)
        return result;
    f->gl.Disable(SCATTERI_GL_BLEND);
    if (over)
        scatteri_gl_blend(f, SCATTERI_GL_ZERO, SCATTERI_GL_SRC_COLOR, SCATTERI_GL_ZERO,
                          SCATTERI_GL_SRC_ALPHA);
    scatteri_gl_fill(f, program, 0, 0, 0, 0);
    return SCATTER_OK;
}

/* The light to be shown as one of the group that begins with this batch, or none. */
static void scatteri_gl_show_light_of(scatter_gl *f, int batch)
{
    const int per_batch = scatteri_gl_lights_per_batch(f), light = (int)f->view_block.show[1];
    const int slot = light - batch * per_batch;
    const int here =
        slot >= 0 && slot < per_batch * scatteri_gl_group_of(f, batch) && light < f->lamp_count;
    f->view_block.picture[3] = here ? (float)(slot + f->has_eye) : -1.0f;
    scatteri_gl_send(f, f->view_buffer, &f->view_block, sizeof f->view_block);
}

/* Draws L and 1 - T of the rays: added to, over or in the place of what is there. The lights of further batches are
   added. */
static scatter_result scatteri_gl_draw_radiance(scatter_gl *f, scatteri_gl_features features,
                                                int over, int target)
{
    const scatteri_gl_program *program;
    scatter_result result = SCATTER_OK;
    int batch;
    f->gl.Disable(SCATTERI_GL_BLEND);
    if (over)
        scatteri_gl_blend(f, SCATTERI_GL_ONE, target, SCATTERI_GL_ONE, target);
    for (batch = 0; batch < f->batch_count && result == SCATTER_OK;
         batch += scatteri_gl_group_of(f, batch)) {
        const scatteri_gl_features more = batch > 0 ? SCATTERI_GL_HAS(MORE) : 0;
        scatteri_gl_bind_batch(f, batch);
        if ((features & SCATTERI_GL_HAS(SHOW)) != 0)
            scatteri_gl_show_light_of(f, batch);
        result =
            scatteri_gl_use(f, SCATTERI_GL_PASS_VIEW,
                            features | scatteri_gl_group_features(f, batch) | more, 1, &program);
        if (result == SCATTER_OK)
            scatteri_gl_fill(f, program, 0, 0, 0, 0);
        scatteri_gl_blend(f, SCATTERI_GL_ONE, SCATTERI_GL_ONE, SCATTERI_GL_ONE, SCATTERI_GL_ONE);
    }
    return result;
}

static void scatteri_gl_target_host(scatter_gl *f, const scatter_gl_view *v)
{
    f->gl.BindFramebuffer(SCATTERI_GL_DRAW_FRAMEBUFFER, v->framebuffer);
    scatteri_gl_write_buffers(f, 1);
    scatteri_gl_set_viewport(f, v->x, v->y, v->width, v->height);
}

/* Room for the mask. It only grows, so that several views can share it. */
static scatter_result scatteri_gl_reserve_mask(scatter_gl *f, int width, int height)
{
    scatteri_gl_texture *t = &f->mask;
    if (t->width >= width && t->height >= height)
        return SCATTER_OK;
    return scatteri_gl_size_texture(f, t, SCATTERI_GL_RG32UI, width > t->width ? width : t->width,
                                    height > t->height ? height : t->height, 0);
}

/* Draws the mask of a picture of that size, once for all its lights; the passes behind read it. */
static scatter_result scatteri_gl_draw_mask(scatter_gl *f, scatteri_gl_features features, int width,
                                            int height)
{
    const scatteri_gl_program *program;
    scatteri_gl_layer layer;
    scatter_result result;
    layer.texture = &f->mask;
    layer.layer = 0;
    if ((features & SCATTERI_GL_HAS(MASK)) == 0)
        return SCATTER_OK;
    result = scatteri_gl_reserve_mask(f, width, height);
    if (result == SCATTER_OK)
        result = scatteri_gl_target(f, &layer, 1);
    if (result == SCATTER_OK)
        result = scatteri_gl_use(f, SCATTERI_GL_PASS_MASK, features, 1, &program);
    if (result != SCATTER_OK)
        return result;
    scatteri_gl_set_viewport(f, 0, 0, width, height);
    scatteri_gl_fill(f, program, 0, 0, 0, 0);
    scatteri_gl_read_texels(f, SCATTERI_GL_UNIT_BEFORE, &f->mask);
    return SCATTER_OK;
}

/* Every pixel: straight into the host's picture. */
static scatter_result scatteri_gl_draw_whole(scatter_gl *f, const scatter_gl_view *v,
                                             scatteri_gl_features features)
{
    const int colored = (features & SCATTERI_GL_HAS(COLORED)) != 0;
    scatter_result result = SCATTER_OK;
    scatteri_gl_send_view(f, v, 1);
    result = scatteri_gl_draw_mask(f, features, v->width, v->height);
    if (result != SCATTER_OK)
        return result;
    scatteri_gl_target_host(f, v);
    if (v->show != SCATTER_GL_SHOW_FOG)
        return scatteri_gl_draw_radiance(f, features | SCATTERI_GL_HAS(SHOW), 0, SCATTERI_GL_ZERO);
    if (colored)
        result = scatteri_gl_draw_transmittance(f, features, 1);
    if (result == SCATTER_OK)
        result = scatteri_gl_draw_radiance(
            f, features, 1, colored ? SCATTERI_GL_ONE : SCATTERI_GL_ONE_MINUS_SRC_ALPHA);
    return result;
}

/* --- at reduced resolution --- */

static int scatteri_gl_reduced_size(int size, int divide)
{
    return size / divide + (size % divide != 0);
}

/* Room for L and, where it has color, T. */
static scatter_result scatteri_gl_reserve_reduced(scatter_gl *f, int width, int height, int colored)
{
    scatter_result result = SCATTER_OK;
    int i;
    for (i = 0; i <= colored && result == SCATTER_OK; i++)
        result =
            scatteri_gl_grow_texture(f, &f->reduced[i], SCATTERI_GL_RGBA16F, width, height);
    return result;
}

static scatter_result scatteri_gl_target_reduced(scatter_gl *f, int which, int width, int height)
{
    scatteri_gl_layer layer;
    scatter_result result;
    layer.texture = &f->reduced[which];
    layer.layer = 0;
    result = scatteri_gl_target(f, &layer, 1);
    scatteri_gl_set_viewport(f, 0, 0, width, height);
    return result;
}

/* T or L of the reduced picture over the host's. */
static scatter_result scatteri_gl_enlarge(scatter_gl *f, int which, int source, int target,
                                          int alpha_source, int alpha_target)
{
    const scatteri_gl_program *program;
    const scatter_result result = scatteri_gl_use(f, SCATTERI_GL_PASS_UPSAMPLE, 0, 1, &program);
    if (result != SCATTER_OK)
        return result;
    scatteri_gl_read_texels(f, SCATTERI_GL_UNIT_BEFORE, &f->reduced[which]);
    scatteri_gl_blend(f, source, target, alpha_source, alpha_target);
    scatteri_gl_fill(f, program, 0, 0, 0, 0);
    return SCATTER_OK;
}

static scatter_result scatteri_gl_compose_reduced(scatter_gl *f, const scatter_gl_view *v,
                                                  int colored)
{
    const int over = colored ? SCATTERI_GL_ONE : SCATTERI_GL_ONE_MINUS_SRC_ALPHA;
    scatter_result result = SCATTER_OK;
    scatteri_gl_target_host(f, v);
    scatteri_gl_begin_timer(f, SCATTERI_GL_TIME_UPSAMPLE);
    if (colored)
        result = scatteri_gl_enlarge(f, 1, SCATTERI_GL_ZERO, SCATTERI_GL_SRC_COLOR,
                                     SCATTERI_GL_ZERO, SCATTERI_GL_SRC_ALPHA);
    if (result == SCATTER_OK)
        result = scatteri_gl_enlarge(f, 0, SCATTERI_GL_ONE, over, SCATTERI_GL_ONE, over);
    scatteri_gl_end_timer(f, SCATTERI_GL_TIME_UPSAMPLE);
    return result;
}

static scatter_result scatteri_gl_draw_reduced(scatter_gl *f, const scatter_gl_view *v,
                                               scatteri_gl_features features)
{
    const int width = scatteri_gl_reduced_size(v->width, v->divide);
    const int height = scatteri_gl_reduced_size(v->height, v->divide);
    const int colored = (features & SCATTERI_GL_HAS(COLORED)) != 0;
    scatter_result result = scatteri_gl_reserve_reduced(f, width, height, colored);
    scatteri_gl_send_view(f, v, v->divide);
    if (result == SCATTER_OK)
        result = scatteri_gl_draw_mask(f, features, width, height);
    if (result == SCATTER_OK && colored) {
        result = scatteri_gl_target_reduced(f, 1, width, height);
        if (result == SCATTER_OK)
            result = scatteri_gl_draw_transmittance(f, features, 0);
    }
    if (result == SCATTER_OK)
        result = scatteri_gl_target_reduced(f, 0, width, height);
    if (result == SCATTER_OK)
        result = scatteri_gl_draw_radiance(f, features, 0, SCATTERI_GL_ZERO);
    return result == SCATTER_OK ? scatteri_gl_compose_reduced(f, v, colored) : result;
}

static int scatteri_gl_is_reduced(const scatter_gl_view *v)
{
    return v->divide > 1 && v->show == SCATTER_GL_SHOW_FOG;
}

static void scatteri_gl_bind_scene(const scatter_gl *f, const scatter_gl_view *v)
{
    scatteri_gl_bind_medium(f);
    if (v->depth_texture != 0)
        scatteri_gl_bind(f, SCATTERI_GL_UNIT_SCENE, SCATTERI_GL_TEXTURE_2D, v->depth_texture,
                         f->nearest);
}

/* What draw and fill_froxels ask of their view; *empty: there is nothing to do. */
static scatter_result scatteri_gl_begin_view(scatter_gl *f, const scatter_gl_view *v, int *empty)
{
    scatter_result result;
    if (f == NULL)
        return SCATTER_BAD_ARGUMENT;
    if (!f->ready)
        return scatteri_fail(&f->host, SCATTER_BAD_ARGUMENT,
                             "a successful scatter_gl_update is needed first");
    result = scatteri_gl_check_view(f, v);
    *empty = result == SCATTER_OK && (v->width == 0 || v->height == 0);
    return result;
}

static scatter_result scatteri_gl_check_divide(scatter_gl *f, const scatter_gl_view *v)
{
    if (v->divide > 1 && !f->can_draw_half)
        return scatteri_fail(&f->host, SCATTER_UNSUPPORTED,
                             "this GL context cannot draw into float textures (no "
                             "EXT_color_buffer_float): view.divide must be 1");
    return SCATTER_OK;
}

SCATTER_API scatter_result scatter_gl_draw(scatter_gl *f, const scatter_gl_view *v)
{
    scatteri_gl_state state;
    int empty = 0;
    scatter_result result = scatteri_gl_begin_view(f, v, &empty);
    if (result == SCATTER_OK)
        result = scatteri_gl_check_divide(f, v);
    if (result != SCATTER_OK || empty)
        return result;
    scatteri_gl_save(f, &state);
    if (f->upside_down)
        scatteri_gl_turn_camera(f);
    scatteri_gl_begin_timer(f, SCATTERI_GL_TIME_VIEW);
    scatteri_gl_bind_scene(f, v);
    result = scatteri_gl_is_reduced(v)
                 ? scatteri_gl_draw_reduced(f, v, scatteri_gl_medium_features(f))
                 : scatteri_gl_draw_whole(f, v, scatteri_gl_medium_features(f));
    scatteri_gl_end_timer(f, SCATTERI_GL_TIME_VIEW);
    scatteri_gl_restore(f, &state);
    return result;
}

SCATTER_API scatter_result scatter_gl_resize(scatter_gl *f, int width, int height)
{
    scatteri_gl_state state;
    scatter_result result = SCATTER_OK;
    if (f == NULL)
        return SCATTER_BAD_ARGUMENT;
    if (width < 0 || height < 0)
        return scatteri_fail(&f->host, SCATTER_BAD_ARGUMENT,
                             "width, height are %d, %d, they must be at least 0", width, height);
    if (width == 0 || height == 0)
        return SCATTER_OK;
    scatteri_gl_save(f, &state);
    if (f->can_draw_half)
        result = scatteri_gl_reserve_reduced(f, scatteri_gl_reduced_size(width, 2),
                                             scatteri_gl_reduced_size(height, 2), 1);
    if (result == SCATTER_OK && f->ready &&
        (scatteri_gl_medium_features(f) & SCATTERI_GL_HAS(MASK)) != 0)
        result = scatteri_gl_reserve_mask(f, width, height);
    scatteri_gl_restore(f, &state);
    return result;
}

/* ---------------------------------------------------------------------------------------- >>froxels */

/* Running sums, then `count` slices from `first` on: textures of the next draw. */
static scatter_result scatteri_gl_target_froxels(scatter_gl *f, int running, int first, int count)
{
    scatteri_gl_layer layers[SCATTERI_GL_MOST_BUFFERS];
    int i;
    layers[0].texture = &f->froxel_running[running];
    layers[0].layer = 0;
    for (i = 0; i < count; i++) {
        layers[i + 1].texture = &f->froxels;
        layers[i + 1].layer = first + i;
    }
    return scatteri_gl_target(f, layers, count + 1);
}

/* Of the attachments, only the running sums or only the slices are written. */
static void scatteri_gl_write_only(scatter_gl *f, int running, int count)
{
    unsigned buffers[SCATTERI_GL_MOST_BUFFERS];
    int i;
    for (i = 0; i <= count; i++)
        buffers[i] = (i == 0) == running ? SCATTERI_GL_COLOR_0 + (unsigned)i : 0u;
    f->gl.DrawBuffers(count + 1, buffers);
}

/* Slices from `first` on. The lights of a further batch are added, their running sums are not. */
static scatter_result scatteri_gl_fill_slices(scatter_gl *f, const scatteri_gl_program *program,
                                              int turn, int first, int count, int more)
{
    const scatter_result result = scatteri_gl_target_froxels(f, turn & 1, first, count);
    if (result != SCATTER_OK)
        return result;
    scatteri_gl_read_texels(f, SCATTERI_GL_UNIT_BEFORE, &f->froxel_running[(turn + 1) & 1]);
    f->gl.Disable(SCATTERI_GL_BLEND);
    if (more) {
        scatteri_gl_write_only(f, 1, count);
        scatteri_gl_fill(f, program, first, 0, 0, 0);
        scatteri_gl_write_only(f, 0, count);
        scatteri_gl_blend(f, SCATTERI_GL_ONE, SCATTERI_GL_ONE, SCATTERI_GL_ONE, SCATTERI_GL_ONE);
    }
    scatteri_gl_fill(f, program, first, 0, 0, 0);
    return SCATTER_OK;
}

static scatter_result scatteri_gl_fill_batch(scatter_gl *f, int batch)
{
    const scatteri_gl_features features = scatteri_gl_medium_features(f) |
                                          scatteri_gl_group_features(f, batch) |
                                          (batch > 0 ? SCATTERI_GL_HAS(MORE) : 0);
    const int at_once = f->draw_buffers - 1;
    const scatteri_gl_program *program;
    scatter_result result = SCATTER_OK;
    int first, turn = 0;
    scatteri_gl_bind_batch(f, batch);
    for (first = 0; first < f->froxels.depth && result == SCATTER_OK; first += at_once, turn++) {
        const int left = f->froxels.depth - first, count = left < at_once ? left : at_once;
        result = scatteri_gl_use(f, SCATTERI_GL_PASS_FROXELS, features, count, &program);
        if (result == SCATTER_OK)
            result = scatteri_gl_fill_slices(f, program, turn, first, count, batch > 0);
    }
    return result;
}

static scatter_gl_froxels scatteri_gl_resolve_froxels(const scatter_gl_froxels *froxels)
{
    scatter_gl_froxels r = *froxels;
    r.nx = r.nx != 0 ? r.nx : 160;
    r.ny = r.ny != 0 ? r.ny : 90;
    r.nz = r.nz != 0 ? r.nz : 64;
    return r;
}

static scatter_result scatteri_gl_check_froxels(scatter_gl *f, const scatter_gl_froxels *r)
{
    if (r->nx < 0 || r->ny < 0 || r->nz < 0 || r->nz == 1)
        return scatteri_fail(
            &f->host, SCATTER_BAD_ARGUMENT,
            "froxels.nx, ny, nz are %d, %d, %d, they must be 0 or at least 1, 1, 2", r->nx, r->ny,
            r->nz);
    if (!(r->z_near > 0.0f && r->z_far > r->z_near && r->z_far <= 1e18f))
        return scatteri_fail(&f->host, SCATTER_BAD_ARGUMENT,
                             "froxels.z_near, z_far are %g, %g, they must be 0 < z_near < z_far",
                             (double)r->z_near, (double)r->z_far);
    if (!f->can_draw_float)
        return scatteri_fail(&f->host, SCATTER_UNSUPPORTED,
                             "this GL context cannot draw into float textures (no "
                             "EXT_color_buffer_float): there are no froxels");
    return SCATTER_OK;
}

static scatter_result scatteri_gl_size_froxels(scatter_gl *f, const scatter_gl_froxels *r)
{
    scatter_result result =
        scatteri_gl_size_texture(f, &f->froxels, scatteri_gl_volume_format(f), r->nx, r->ny, r->nz);
    int i;
    for (i = 0; i < 2 && result == SCATTER_OK; i++)
        result = scatteri_gl_size_texture(f, &f->froxel_running[i], SCATTERI_GL_RGBA32F, r->nx,
                                          r->ny, 0);
    return result;
}

/* The camera of the froxels, for scatter_fog: world, relative to ref, to clip x, y, w. */
static void scatteri_gl_remember_froxels(scatter_gl *f, const scatter_gl_view *v)
{
    const scatteri_gl_view_block *b = &f->view_block;
    scatteri_gl_surface_block *s = &f->surface_block;
    const scatter_vec3 d = scatteri_v3(b->forward[0], b->forward[1], b->forward[2]);
    const scatter_vec3 n = scatteri_scale(d, 1.0f / scatteri_length(d));
    const int perspective = !(b->range[0] != 0.0f);
    float *rows[3];
    int row, column, k;
    rows[0] = s->froxel_x;
    rows[1] = s->froxel_y;
    rows[2] = s->froxel_w;
    for (row = 0; row < 3; row++) {
        double m[4];
        for (column = 0; column < 4; column++) {
            m[column] = 0.0;
            for (k = 0; k < 4; k++)
                m[column] += (double)v->projection[4 * k + (row == 2 ? 3 : row)] *
                             (double)v->view[4 * column + k];
        }
        m[3] += m[0] * (double)f->ref.x + m[1] * (double)f->ref.y + m[2] * (double)f->ref.z;
        scatteri_gl_put(rows[row], (float)m[0], (float)m[1], (float)m[2], (float)m[3]);
    }
    scatteri_gl_put(s->froxel_eye, b->eye[0], b->eye[1], b->eye[2], (float)perspective);
    scatteri_gl_put3(s->froxel_t, n, -(n.x * b->eye[0] + n.y * b->eye[1] + n.z * b->eye[2]));
    scatteri_gl_put(s->surface_range, b->froxel_range[0], b->froxels[3],
                    b->froxel_range[0] * scatteri_exp(0.5f * b->froxels[3] / b->froxels[2]),
                    b->froxel_range[1] * scatteri_exp(-0.5f * b->froxels[3] / b->froxels[2]));
}

SCATTER_API scatter_result scatter_gl_fill_froxels(scatter_gl *f, const scatter_gl_view *v,
                                                   const scatter_gl_froxels *froxels)
{
    scatteri_gl_state state;
    scatter_gl_froxels r;
    int batch, empty = 0;
    scatter_result result = scatteri_gl_begin_view(f, v, &empty);
    if (result != SCATTER_OK || empty)
        return result;
    if (froxels == NULL)
        return scatteri_fail(&f->host, SCATTER_BAD_ARGUMENT, "froxels is NULL");
    r = scatteri_gl_resolve_froxels(froxels);
    result = scatteri_gl_check_froxels(f, &r);
    if (result != SCATTER_OK)
        return result;
    scatteri_gl_save(f, &state);
    scatteri_gl_begin_timer(f, SCATTERI_GL_TIME_FROXELS);
    scatteri_gl_put(f->view_block.froxels, (float)r.nx, (float)r.ny, (float)r.nz,
                    scatteri_log(r.z_far / r.z_near));
    scatteri_gl_put(f->view_block.froxel_range, r.z_near, r.z_far, 0.0f, 0.0f);
    scatteri_gl_send_view(f, v, 1);
    result = scatteri_gl_size_froxels(f, &r);
    scatteri_gl_bind_medium(f);
    for (batch = 0; batch < f->batch_count && result == SCATTER_OK;
         batch += scatteri_gl_group_of(f, batch))
        result = scatteri_gl_fill_batch(f, batch);
    scatteri_gl_remember_froxels(f, v);
    scatteri_gl_end_timer(f, SCATTERI_GL_TIME_FROXELS);
    scatteri_gl_restore(f, &state);
    return result;
}

/* ------------------------------------------------------------------------------------------- >>tone */

enum { SCATTERI_GL_BLOCK = 8 }; /* texels of a picture that become one; also in GLSL */

/* Sums of the texels of `from` that `at` names: x, y of the first, width, height. Those of the sums take its place. */
static scatter_result scatteri_gl_sum_blocks(scatter_gl *f, int pass, unsigned from, int to, int *at)
{
    const scatteri_gl_program *program;
    const int width = scatteri_gl_reduced_size(at[2], SCATTERI_GL_BLOCK),
              height = scatteri_gl_reduced_size(at[3], SCATTERI_GL_BLOCK);
    scatteri_gl_layer layer;
    scatter_result result =
        scatteri_gl_grow_texture(f, &f->logs[to], SCATTERI_GL_RG32F, width, height);
    layer.texture = &f->logs[to];
    layer.layer = 0;
    if (result == SCATTER_OK)
        result = scatteri_gl_target(f, &layer, 1);
    if (result == SCATTER_OK)
        result = scatteri_gl_use(f, pass, 0, 1, &program);
    if (result != SCATTER_OK)
        return result;
    scatteri_gl_set_viewport(f, 0, 0, width, height);
    scatteri_gl_bind(f, SCATTERI_GL_UNIT_BEFORE, SCATTERI_GL_TEXTURE_2D, from, f->nearest);
    scatteri_gl_fill(f, program, at[0], at[1], at[2], at[3]);
    at[0] = at[1] = 0;
    at[2] = width;
    at[3] = height;
    return SCATTER_OK;
}

/* Logarithms of the source's luminance, summed until one texel holds them all: it is in f->logs[*last]. */
static scatter_result scatteri_gl_sum_logs(scatter_gl *f, const scatter_gl_tone *t, int *last)
{
    int at[4];
    scatter_result result;
    at[0] = t->source_x;
    at[1] = t->source_y;
    at[2] = t->width;
    at[3] = t->height;
    *last = 0;
    result = scatteri_gl_sum_blocks(f, SCATTERI_GL_PASS_LOGS, t->source, 0, at);
    while (result == SCATTER_OK && (at[2] > 1 || at[3] > 1)) {
        *last = 1 - *last;
        result = scatteri_gl_sum_blocks(f, SCATTERI_GL_PASS_SUMS, f->logs[1 - *last].name, *last,
                                        at);
    }
    return result;
}

/* `sums`: of the source's logarithms, or any texture where the average is given. */
static scatter_result scatteri_gl_draw_tone(scatter_gl *f, const scatter_gl_tone *t, unsigned sums)
{
    const scatteri_gl_program *program;
    const scatter_result result = scatteri_gl_use(f, SCATTERI_GL_PASS_TONE, 0, 1, &program);
    if (result != SCATTER_OK)
        return result;
    f->gl.BindFramebuffer(SCATTERI_GL_DRAW_FRAMEBUFFER, t->framebuffer);
    scatteri_gl_write_buffers(f, 1);
    scatteri_gl_set_viewport(f, t->x, t->y, t->width, t->height);
    scatteri_gl_bind(f, SCATTERI_GL_UNIT_BEFORE, SCATTERI_GL_TEXTURE_2D, t->source, f->nearest);
    scatteri_gl_bind(f, SCATTERI_GL_UNIT_BEFORE_TOO, SCATTERI_GL_TEXTURE_2D, sums, f->nearest);
    f->gl.Uniform4f(program->tone, t->tone.key > 0.0f ? t->tone.key : 0.18f, t->tone.white,
                    t->tone.log_average, 0.0f);
    scatteri_gl_fill(f, program, t->source_x - t->x, t->source_y - t->y, !t->linear, 0);
    return SCATTER_OK;
}

SCATTER_API scatter_result scatter_gl_tone_map(scatter_gl *f, const scatter_gl_tone *t)
{
    scatteri_gl_state state;
    scatter_result result = SCATTER_OK;
    int last = 0;
    if (f == NULL)
        return SCATTER_BAD_ARGUMENT;
    if (t == NULL || t->source == 0 || t->source_x < 0 || t->source_y < 0 || t->width < 0 ||
        t->height < 0)
        return scatteri_fail(&f->host, SCATTER_BAD_ARGUMENT,
                             "tone is NULL, or its source is 0, or its source_x, source_y, width or "
                             "height is below 0");
    if (!(t->tone.log_average > 0.0f) && !f->can_draw_float)
        return scatteri_fail(&f->host, SCATTER_UNSUPPORTED,
                             "this GL context cannot draw into float textures (no "
                             "EXT_color_buffer_float): tone.log_average must be given");
    if (t->width == 0 || t->height == 0)
        return SCATTER_OK;
    scatteri_gl_save(f, &state);
    if (!(t->tone.log_average > 0.0f))
        result = scatteri_gl_sum_logs(f, t, &last);
    if (result == SCATTER_OK)
        result = scatteri_gl_draw_tone(
            f, t, t->tone.log_average > 0.0f ? t->source : f->logs[last].name);
    scatteri_gl_restore(f, &state);
    return result;
}

/* --------------------------------------------------------------------------------------- >>surfaces */

enum { SCATTERI_GL_SLOTS = 64 }; /* lights of surfaces; also in GLSL */

static const char scatteri_gl_surface_chapters[] = SCATTERI_GL_MATHS
    "surface_blocks table gaussians density rays four_volumes volume depth_to surface";

/* What the depth between a surface and a light depends on. */
static scatteri_gl_features scatteri_gl_surface_features(const scatter_gl *f)
{
    const scatteri_gl_features features = scatteri_gl_medium_features(f);
    scatteri_gl_features known = SCATTERI_GL_HAS(CLOSED) | SCATTERI_GL_HAS(FOG) |
                                 SCATTERI_GL_HAS(BOUNDED) | SCATTERI_GL_HAS(CELLS) |
                                 SCATTERI_GL_HAS(POLAR) | SCATTERI_GL_HAS(RAYS);
    if ((features & SCATTERI_GL_HAS(RAYS)) != 0)
        known |= SCATTERI_GL_HAS(FIELD) | SCATTERI_GL_HAS(DISTANCE);
    return features & known;
}

SCATTER_API const char *scatter_gl_surface_glsl(scatter_gl *f)
{
    scatteri_gl_source source;
    scatteri_gl_key key;
    size_t bytes = 1;
    char *text;
    int i;
    if (f == NULL || !f->ready)
        return NULL;
    key.pass = 0;
    key.slices = 0;
    key.count = 0;
    key.features = scatteri_gl_surface_features(f);
    if (f->surface_text != NULL && f->surface_features == key.features)
        return f->surface_text;
    scatteri_gl_assemble(NULL, key, scatteri_gl_surface_chapters, &source);
    for (i = 0; i < source.count; i++)
        bytes += strlen(source.parts[i]);
    text = (char *)scatteri_allocate(&f->host, bytes);
    if (text == NULL) {
        scatteri_fail(&f->host, SCATTER_OUT_OF_MEMORY,
                      "host.allocate gave no %lu bytes for the text of surfaces",
                      (unsigned long)bytes);
        return NULL;
    }
    text[0] = 0;
    for (i = 0; i < source.count; i++)
        strcat(text, source.parts[i]);
    scatteri_release(&f->host, f->surface_text);
    f->surface_text = text;
    f->surface_features = key.features;
    return text;
}

/* Lights of the first batches, each in the slot of its batch and channel. */
static void scatteri_gl_send_surface(scatter_gl *f)
{
    scatteri_gl_surface_block *s = &f->surface_block;
    const scatteri_gl_lights_block *l = &f->lights_block;
    int slot;
    scatteri_gl_put(s->surface_batch, (float)scatteri_gl_lights_per_batch(f), (float)f->has_eye,
                    (float)f->stacked, (float)f->layers);
    scatteri_gl_put3(s->surface_ref, f->ref, 0.0f);
    for (slot = 0; slot < (int)SCATTERI_GL_SLOTS; slot++) {
        const int c = slot % SCATTERI_GL_BATCH;
        const scatteri_gl_lamp *lamp = scatteri_gl_source_in(f, slot / SCATTERI_GL_BATCH, c);
        if (lamp == NULL)
            continue;
        scatteri_gl_put_lamp(f, c, lamp);
        memcpy(s->light[slot], l->light[c], sizeof l->light[c]);
        memcpy(s->direction[slot], l->direction[c], sizeof l->direction[c]);
        memcpy(s->axis_u[slot], l->axis_u[c], sizeof l->axis_u[c]);
        memcpy(s->axis_v[slot], l->axis_v[c], sizeof l->axis_v[c]);
        memcpy(s->axis_w[slot], l->axis_w[c], sizeof l->axis_w[c]);
        memcpy(s->polar[slot], l->polar[c], sizeof l->polar[c]);
        memcpy(s->polar_size[slot], l->polar_size[c], sizeof l->polar_size[c]);
        memcpy(s->anchor[slot], l->anchor[c], sizeof l->anchor[c]);
    }
    scatteri_gl_send(f, f->surface_buffer, s, sizeof *s);
}

SCATTER_API scatter_result scatter_gl_bind_surface(scatter_gl *f, unsigned program, int first_unit,
                                                   int first_block)
{
    static const char *const units[] = {"scatteri_gaussians", "scatteri_volume0",
                                        "scatteri_volume1",   "scatteri_volume2",
                                        "scatteri_volume3",   "scatteri_froxel_volume"};
    static const char *const blocks[] = {"scatteri_medium_block", "scatteri_surface_block"};
    static const char *const field[] = {"scatteri_field"}; /* in the place of volumes */
    int i;
    if (f == NULL)
        return SCATTER_BAD_ARGUMENT;
    if (!f->ready || program == 0 || first_unit < 0 || first_block < 0)
        return scatteri_fail(&f->host, SCATTER_BAD_ARGUMENT,
                             "scatter_gl_bind_surface needs a successful scatter_gl_update, a "
                             "program, and first_unit and first_block of at least 0");
    scatteri_gl_send_surface(f);
    scatteri_gl_set_units(f, program, units, 6, first_unit);
    scatteri_gl_set_blocks(f, program, blocks, 2, first_block);
    scatteri_gl_read_texels(f, first_unit, &f->gaussians);
    for (i = 0; i < 4 && i < scatteri_gl_most_batches(f); i++)
        scatteri_gl_read_smooth(f, first_unit + 1 + i, &f->volumes[i]);
    if (scatteri_gl_casts_rays(f)) {
        scatteri_gl_set_units(f, program, field, 1, first_unit + 1);
        scatteri_gl_read_smooth(f, first_unit + 1, scatteri_gl_read_field(f));
    }
    scatteri_gl_read_smooth(f, first_unit + 5, &f->froxels);
    f->gl.BindBufferBase(SCATTERI_GL_UNIFORM_BUFFER, (unsigned)first_block, f->medium_buffer);
    f->gl.BindBufferBase(SCATTERI_GL_UNIFORM_BUFFER, (unsigned)first_block + 1, f->surface_buffer);
    return SCATTER_OK;
}

/* Program and texture of the mask. */
static scatter_result scatteri_gl_warm_mask(scatter_gl *f, const scatter_gl_view *v)
{
    const scatteri_gl_program *program;
    const scatter_result result =
        scatteri_gl_use(f, SCATTERI_GL_PASS_MASK, scatteri_gl_medium_features(f), 1, &program);
    return result == SCATTER_OK ? scatteri_gl_reserve_mask(f, v->width, v->height) : result;
}

/* Everything that update and draw compile, by doing it. */
SCATTER_API scatter_result scatter_gl_warm_up(scatter_gl *f, const scatter_quality *quality,
                                              const scatter_gl_view *view)
{
    scatteri_gl_state state;
    scatter_result result = scatter_gl_update(f, quality, NULL);
    scatteri_gl_features features, more;
    const scatteri_gl_program *program;
    int batch;
    if (result == SCATTER_OK && view != NULL)
        result = scatteri_gl_check_view(f, view);
    if (result == SCATTER_OK && view != NULL)
        result = scatteri_gl_check_divide(f, view);
    if (result != SCATTER_OK || view == NULL)
        return result;
    features = scatteri_gl_medium_features(f);
    scatteri_gl_save(f, &state);
    if ((features & SCATTERI_GL_HAS(MASK)) != 0)
        result = scatteri_gl_warm_mask(f, view);
    if (view->show != SCATTER_GL_SHOW_FOG)
        features |= SCATTERI_GL_HAS(SHOW);
    else if (result == SCATTER_OK && (features & SCATTERI_GL_HAS(COLORED)) != 0)
        result = scatteri_gl_use(f, SCATTERI_GL_PASS_VIEW,
                                 features | SCATTERI_GL_HAS(TRANSMITTANCE), 1, &program);
    for (batch = 0; batch < f->batch_count && result == SCATTER_OK;
         batch += scatteri_gl_group_of(f, batch)) {
        more = batch > 0 ? SCATTERI_GL_HAS(MORE) : 0;
        result =
            scatteri_gl_use(f, SCATTERI_GL_PASS_VIEW,
                            features | more | scatteri_gl_group_features(f, batch), 1, &program);
    }
    if (result == SCATTER_OK && view->divide > 1)
        result = scatteri_gl_use(f, SCATTERI_GL_PASS_UPSAMPLE, 0, 1, &program);
    if (result == SCATTER_OK && view->divide > 1)
        result =
            scatteri_gl_reserve_reduced(f, scatteri_gl_reduced_size(view->width, view->divide),
                                        scatteri_gl_reduced_size(view->height, view->divide), 1);
    scatteri_gl_restore(f, &state);
    return result;
}

/* ---------------------------------------------------------------------------------------- >>public */

#ifdef SCATTER_GL_NO_LOADER
#define SCATTERI_GL_LOAD(result, name, arguments)                                                  \
    gl->name = (result(SCATTERI_GL_CALL *) arguments)gl##name;
#else
#define SCATTERI_GL_LOAD(result, name, arguments)                                                  \
    gl->name = (result(SCATTERI_GL_CALL *) arguments)f->desc.get_proc_address("gl" #name);         \
    if (gl->name == NULL)                                                                          \
        missing = "gl" #name;
#endif
#define SCATTERI_GL_TRY(result, name, arguments)                                                   \
    gl->name = (result(SCATTERI_GL_CALL *) arguments)f->desc.get_proc_address("gl" #name);

static scatter_result scatteri_gl_refuse_loader(const scatter_gl *f, const char *missing)
{
    return scatteri_fail(&f->host, SCATTER_UNSUPPORTED,
                         "desc.get_proc_address gives no %s: is a context current?", missing);
}

static scatter_result scatteri_gl_load(scatter_gl *f)
{
    scatteri_gl_functions *gl = &f->gl;
    const char *missing = NULL;
    SCATTERI_GL_FUNCTIONS(SCATTERI_GL_LOAD)
    if (f->desc.get_proc_address != NULL) {
        SCATTERI_GL_OPTIONAL(SCATTERI_GL_TRY)
    }
    return missing != NULL ? scatteri_gl_refuse_loader(f, missing) : SCATTER_OK;
}

static int scatteri_gl_has_extension(const scatter_gl *f, const char *name)
{
    const int count = scatteri_gl_get(f, SCATTERI_GL_NUM_EXTENSIONS);
    int i;
    for (i = 0; i < count; i++) {
        const unsigned char *e = f->gl.GetStringi(SCATTERI_GL_EXTENSIONS, (unsigned)i);
        if (e != NULL && strcmp((const char *)e, name) == 0)
            return 1;
    }
    return 0;
}

/* Functions that this version does not have, even where their address is known. */
static void scatteri_gl_drop_newer(scatter_gl *f)
{
    scatteri_gl_functions *gl = &f->gl;
    if (f->version < (f->es ? 320 : 400)) {
        gl->BlendFuncSeparatei = NULL;
        gl->BlendEquationSeparatei = NULL;
    }
    if (f->es || f->version < 410) {
        gl->ViewportIndexedf = NULL;
        gl->ScissorIndexed = NULL;
    }
    if (f->es || f->version < 450)
        gl->ClipControl = NULL;
    if (f->es && f->version < 320)
        gl->ColorMaski = NULL;
    if (f->es) {
        gl->PolygonMode = NULL;
        gl->QueryCounter = NULL;
    }
}

/* A function that this version has and the loader does not give, or NULL. */
static const char *scatteri_gl_missing(const scatter_gl *f)
{
    const scatteri_gl_functions *gl = &f->gl;
    const int buffers = !f->es || f->version >= 320,
              blending = buffers && (f->es || f->version >= 400);
    const int viewports = !f->es && f->version >= 410;
#define SCATTERI_GL_NEED(condition, name)                                                          \
    if ((condition) && gl->name == NULL)                                                           \
    return "gl" #name
    SCATTERI_GL_NEED(buffers, ColorMaski);
    SCATTERI_GL_NEED(buffers, Disablei);
    SCATTERI_GL_NEED(buffers, Enablei);
    SCATTERI_GL_NEED(buffers, GetBooleani_v);
    SCATTERI_GL_NEED(buffers, IsEnabledi);
    SCATTERI_GL_NEED(blending, BlendEquationSeparatei);
    SCATTERI_GL_NEED(blending, BlendFuncSeparatei);
    SCATTERI_GL_NEED(viewports, GetFloati_v);
    SCATTERI_GL_NEED(viewports, ScissorIndexed);
    SCATTERI_GL_NEED(viewports, ViewportIndexedf);
    SCATTERI_GL_NEED(!f->es && f->version >= 450, ClipControl);
    SCATTERI_GL_NEED(!f->es, PolygonMode);
    SCATTERI_GL_NEED(!f->es, GenQueries);
    SCATTERI_GL_NEED(!f->es, DeleteQueries);
    SCATTERI_GL_NEED(!f->es, QueryCounter);
    SCATTERI_GL_NEED(!f->es, GetQueryObjectiv);
    SCATTERI_GL_NEED(!f->es, GetQueryObjectui64v);
#undef SCATTERI_GL_NEED
    return NULL;
}

static scatter_result scatteri_gl_look(scatter_gl *f)
{
    const char *text = (const char *)f->gl.GetString(SCATTERI_GL_VERSION);
    const char *digits = text;
    int major = 0, minor = 0;
    while (digits != NULL && *digits != 0 && (*digits < '0' || *digits > '9'))
        digits++;
    if (digits == NULL || sscanf(digits, "%d.%d", &major, &minor) != 2)
        return scatteri_fail(&f->host, SCATTER_UNSUPPORTED,
                             "glGetString(GL_VERSION) gives no version: is a context current?");
    f->es = strncmp(text, "OpenGL ES", 9) == 0;
    f->version = 100 * major + 10 * minor;
    if (f->version < (f->es ? 300 : 330))
        return scatteri_fail(&f->host, SCATTER_UNSUPPORTED,
                             "this is '%s', needed is OpenGL 3.3 or OpenGL ES 3.0", text);
    scatteri_gl_drop_newer(f);
    if (f->desc.get_proc_address != NULL && scatteri_gl_missing(f) != NULL)
        return scatteri_gl_refuse_loader(f, scatteri_gl_missing(f));
    f->max_3d = scatteri_gl_get(f, SCATTERI_GL_MAX_3D);
    f->max_2d = scatteri_gl_get(f, SCATTERI_GL_MAX_SIZE);
    f->draw_buffers = scatteri_clamp_int(scatteri_gl_get(f, SCATTERI_GL_MAX_DRAW_BUFFERS), 1,
                                         SCATTERI_GL_MOST_BUFFERS);
    f->can_draw_float = !f->es || scatteri_gl_has_extension(f, "GL_EXT_color_buffer_float") ||
                        scatteri_gl_has_extension(f, "EXT_color_buffer_float");
    f->can_draw_half = f->can_draw_float ||
                       scatteri_gl_has_extension(f, "GL_EXT_color_buffer_half_float") ||
                       scatteri_gl_has_extension(f, "EXT_color_buffer_half_float");
    f->can_filter_float = !f->es || scatteri_gl_has_extension(f, "GL_OES_texture_float_linear") ||
                          scatteri_gl_has_extension(f, "OES_texture_float_linear");
    f->can_blend_float = !f->es || scatteri_gl_has_extension(f, "GL_EXT_float_blend") ||
                         scatteri_gl_has_extension(f, "EXT_float_blend");
    return SCATTER_OK;
}

static unsigned scatteri_gl_make_sampler(scatter_gl *f, int filter)
{
    const scatteri_gl_functions *gl = &f->gl;
    unsigned sampler = 0;
    gl->GenSamplers(1, &sampler);
    gl->SamplerParameteri(sampler, SCATTERI_GL_MIN_FILTER, filter);
    gl->SamplerParameteri(sampler, SCATTERI_GL_MAG_FILTER, filter);
    gl->SamplerParameteri(sampler, SCATTERI_GL_WRAP_S, SCATTERI_GL_CLAMP_TO_EDGE);
    gl->SamplerParameteri(sampler, SCATTERI_GL_WRAP_T, SCATTERI_GL_CLAMP_TO_EDGE);
    gl->SamplerParameteri(sampler, SCATTERI_GL_WRAP_R, SCATTERI_GL_CLAMP_TO_EDGE);
    gl->SamplerParameteri(sampler, SCATTERI_GL_TEXTURE_COMPARE_MODE, 0);
    return sampler;
}

static unsigned scatteri_gl_make_buffer(scatter_gl *f, size_t bytes)
{
    unsigned buffer = 0;
    f->gl.GenBuffers(1, &buffer);
    f->gl.BindBuffer(SCATTERI_GL_UNIFORM_BUFFER, buffer);
    f->gl.BufferData(SCATTERI_GL_UNIFORM_BUFFER, (ptrdiff_t)bytes, NULL, SCATTERI_GL_DYNAMIC);
    return buffer;
}

static scatter_result scatteri_gl_make_objects(scatter_gl *f)
{
    const int rows = (2 * f->desc.max_gaussians + SCATTERI_GL_ROW - 1) / SCATTERI_GL_ROW;
    scatter_result result;
    int i;
    f->gl.GenVertexArrays(1, &f->vertex_array);
    f->gl.GenFramebuffers(1, &f->framebuffer);
    f->gl.GenBuffers(1, &f->voxel_buffer);
    f->nearest = scatteri_gl_make_sampler(f, SCATTERI_GL_NEAREST);
    f->linear = scatteri_gl_make_sampler(f, SCATTERI_GL_LINEAR);
    f->medium_buffer = scatteri_gl_make_buffer(f, sizeof f->medium_block);
    f->view_buffer = scatteri_gl_make_buffer(f, sizeof f->view_block);
    f->surface_buffer = scatteri_gl_make_buffer(f, sizeof f->surface_block);
    for (i = 0; i < scatteri_gl_most_batches(f); i++)
        f->light_buffers[i] = scatteri_gl_make_buffer(f, sizeof f->lights_block);
    result =
        scatteri_gl_size_texture(f, &f->gaussians, SCATTERI_GL_RGBA32F, SCATTERI_GL_ROW, rows, 0);
    if (result == SCATTER_OK)
        result = scatteri_gl_size_texture(f, &f->rules, SCATTERI_GL_RG32F, SCATTERI_NODES,
                                          SCATTERI_RULES, 0);
    return result;
}

/* Memory for what the limits name. */
static scatter_result scatteri_gl_make_room(scatter_gl *f)
{
    const size_t batches = (size_t)scatteri_gl_most_batches(f);
    const size_t lamps = ((size_t)f->desc.max_lights + 1) * sizeof *f->lamps;
    const size_t rows = (2 * (size_t)f->desc.max_gaussians + SCATTERI_GL_ROW - 1) / SCATTERI_GL_ROW;
    const size_t table = rows * SCATTERI_GL_ROW * 4, rules = 2 * SCATTERI_NODES * SCATTERI_RULES;
    const size_t bytes = batches * (sizeof *f->volumes + sizeof *f->light_buffers);
    f->scratch_floats = table > rules ? table : rules;
    f->lamps = (scatteri_gl_lamp *)scatteri_allocate(&f->host, lamps);
    f->volumes = (scatteri_gl_texture *)scatteri_allocate(&f->host, bytes);
    f->scratch = (float *)scatteri_allocate(&f->host, f->scratch_floats * sizeof(float));
    if (f->lamps == NULL || f->volumes == NULL || f->scratch == NULL)
        return scatteri_fail(&f->host, SCATTER_OUT_OF_MEMORY,
                             "host.allocate gave no memory for %d lights and %d Gaussians",
                             f->desc.max_lights, f->desc.max_gaussians);
    memset(f->lamps, 0, lamps);
    memset(f->volumes, 0, bytes);
    f->light_buffers = (unsigned *)(void *)(f->volumes + batches);
    return SCATTER_OK;
}

static scatter_result scatteri_gl_start(scatter_gl *f)
{
    scatteri_gl_state state;
    scatter_medium none;
    scatter_result result = scatteri_gl_load(f);
    if (result == SCATTER_OK)
        result = scatteri_gl_look(f);
    if (result == SCATTER_OK)
        result = scatteri_gl_make_room(f);
    if (result != SCATTER_OK)
        return result;
    scatteri_gl_save(f, &state);
    result = scatteri_gl_make_objects(f);
    scatteri_gl_restore(f, &state);
    memset(&none, 0, sizeof none);
    f->injected_version = -1;
    return result == SCATTER_OK ? scatter_gl_set_medium(f, &none) : result;
}

SCATTER_API scatter_result scatter_gl_create(const scatter_gl_desc *desc, scatter_gl **fog)
{
    const scatter_host h = scatteri_host_or_default(desc != NULL ? &desc->host : NULL);
    scatter_result result;
    scatter_gl *f;
    if (fog == NULL || desc == NULL)
        return scatteri_fail(&h, SCATTER_BAD_ARGUMENT, "%s is NULL", fog == NULL ? "fog" : "desc");
    *fog = NULL;
#ifndef SCATTER_GL_NO_LOADER
    if (desc->get_proc_address == NULL)
        return scatteri_fail(&h, SCATTER_BAD_ARGUMENT,
                             "desc.get_proc_address is NULL, it must find GL functions");
#endif
    if (desc->max_lights < 0 || desc->max_lights > 4096 || desc->max_gaussians < 0 ||
        desc->max_gaussians > 1 << 20)
        return scatteri_fail(&h, SCATTER_BAD_ARGUMENT,
                             "desc.max_lights is %d, it must be 0..4096, desc.max_gaussians is %d, "
                             "it must be 0..1048576",
                             desc->max_lights, desc->max_gaussians);
    f = (scatter_gl *)scatteri_allocate(&h, sizeof *f);
    if (f == NULL)
        return scatteri_fail(&h, SCATTER_OUT_OF_MEMORY,
                             "host.allocate gave no memory for a scatter_gl");
    memset(f, 0, sizeof *f);
    f->host = h;
    f->desc = *desc;
    f->desc.max_lights = desc->max_lights != 0 ? desc->max_lights : 16;
    f->desc.max_gaussians = desc->max_gaussians != 0 ? desc->max_gaussians : 4096;
    result = scatteri_gl_start(f);
    if (result == SCATTER_OK)
        *fog = f;
    else
        scatter_gl_destroy(f);
    return result;
}

static void scatteri_gl_drop_timers(scatter_gl *f)
{
    int i;
    for (i = 0; i < (int)SCATTERI_GL_TIMES; i++)
        if (f->timers[i].begin != 0) {
            f->gl.DeleteQueries(1, &f->timers[i].begin);
            f->gl.DeleteQueries(1, &f->timers[i].end);
        }
}

static void scatteri_gl_drop_objects(scatter_gl *f)
{
    const scatteri_gl_functions *gl = &f->gl;
    int i;
    for (i = 0; i < f->program_count; i++)
        gl->DeleteProgram(f->programs[i].name);
    gl->DeleteVertexArrays(1, &f->vertex_array);
    gl->DeleteFramebuffers(1, &f->framebuffer);
    gl->DeleteSamplers(1, &f->nearest);
    gl->DeleteSamplers(1, &f->linear);
    gl->DeleteBuffers(1, &f->medium_buffer);
    gl->DeleteBuffers(1, &f->view_buffer);
    gl->DeleteBuffers(1, &f->surface_buffer);
    gl->DeleteBuffers(1, &f->voxel_buffer);
    gl->DeleteBuffers(scatteri_gl_most_batches(f), f->light_buffers);
    scatteri_gl_drop_timers(f);
}

static void scatteri_gl_drop_textures(scatter_gl *f)
{
    int i;
    scatteri_gl_drop_texture(f, &f->gaussians);
    scatteri_gl_drop_texture(f, &f->rules);
    scatteri_gl_drop_texture(f, &f->field);
    scatteri_gl_drop_texture(f, &f->spaced);
    scatteri_gl_drop_texture(f, &f->mask);
    scatteri_gl_drop_texture(f, &f->froxels);
    for (i = 0; i < 2; i++) {
        scatteri_gl_drop_texture(f, &f->running[i]);
        scatteri_gl_drop_texture(f, &f->wave[i]);
        scatteri_gl_drop_texture(f, &f->distances[i]);
        scatteri_gl_drop_texture(f, &f->reduced[i]);
        scatteri_gl_drop_texture(f, &f->froxel_running[i]);
        scatteri_gl_drop_texture(f, &f->logs[i]);
    }
    for (i = 0; i < f->grid_room; i++) {
        scatteri_gl_drop_texture(f, &f->grids[i]);
        scatteri_gl_drop_texture(f, &f->voxels[i].before);
    }
    if (f->light_buffers != NULL) /* the last thing that there is room for */
        scatteri_gl_drop_volumes(f);
}

SCATTER_API void scatter_gl_destroy(scatter_gl *f)
{
    scatter_host host;
    if (f == NULL)
        return;
    host = f->host;
    if (!f->lost && f->vertex_array != 0)
        scatteri_gl_drop_objects(f);
    scatteri_gl_drop_textures(f);
    scatteri_drop_medium(&host, &f->medium);
    scatteri_release(&host, f->lamps);
    scatteri_release(&host, f->volumes);
    scatteri_release(&host, f->scratch);
    scatteri_release(&host, f->grids);
    scatteri_release(&host, f->voxels);
    scatteri_release(&host, f->surface_text);
    scatteri_release(&host, f->programs);
    scatteri_release(&host, f);
}

SCATTER_API void scatter_gl_abandon(scatter_gl *f)
{
    if (f == NULL)
        return;
    f->lost = 1;
    scatter_gl_destroy(f);
}

/* --- medium and lights --- */

static scatter_result scatteri_gl_room_for_grids(scatter_gl *f, int count)
{
    scatteri_gl_texture *grids;
    scatteri_gl_voxels *voxels;
    if (count <= f->grid_room)
        return SCATTER_OK;
    grids = (scatteri_gl_texture *)scatteri_allocate(&f->host, (size_t)count * sizeof *grids);
    voxels = (scatteri_gl_voxels *)scatteri_allocate(&f->host, (size_t)count * sizeof *voxels);
    if (grids == NULL || voxels == NULL) {
        scatteri_release(&f->host, grids);
        scatteri_release(&f->host, voxels);
        return scatteri_fail(&f->host, SCATTER_OUT_OF_MEMORY,
                             "host.allocate gave no memory for %d grids", count);
    }
    memset(grids, 0, (size_t)count * sizeof *grids);
    memset(voxels, 0, (size_t)count * sizeof *voxels);
    if (f->grid_room > 0) {
        memcpy(grids, f->grids, (size_t)f->grid_room * sizeof *grids);
        memcpy(voxels, f->voxels, (size_t)f->grid_room * sizeof *voxels);
    }
    scatteri_release(&f->host, f->grids);
    scatteri_release(&f->host, f->voxels);
    f->grids = grids;
    f->voxels = voxels;
    f->grid_room = count;
    return SCATTER_OK;
}

/* 16 bits hold values up to 65504. */
static scatter_result scatteri_gl_check_range(scatter_gl *f, int grid)
{
    const scatter_grid *g = &f->medium.desc.grids[grid];
    const size_t count = (size_t)g->nx * (size_t)g->ny * (size_t)g->nz;
    size_t i;
    if (scatteri_gl_field_format(f) != SCATTERI_GL_R16F)
        return SCATTER_OK;
    for (i = 0; i < count; i++)
        if (g->density[i] > 65504.0f)
            return scatteri_fail(&f->host, SCATTER_UNSUPPORTED,
                                 "medium.grids[%d].density is %g, textures of 16 bits hold at most "
                                 "65504: use .scale",
                                 grid, (double)g->density[i]);
    return SCATTER_OK;
}

/* The 16 bits nearest to v, which is 0..65504; ties to even. Below 2^-14 the step is that of floats at 1/2. */
static unsigned scatteri_gl_half(float v)
{
    const uint32_t bits = scatteri_bits(v);
    if (v < 6.103515625e-5f)
        return scatteri_bits(v + 0.5f) - scatteri_bits(0.5f);
    return ((bits + 0xFFFu + (bits >> 13 & 1u)) >> 13) - (112u << 10);
}

/* Voxels as 16 bits into the bound buffer: half as much to transfer, and faster than drivers convert (bench). */
static void scatteri_gl_buffer_halves(scatter_gl *f, const float *values, size_t count)
{
    const size_t room = 2 * f->scratch_floats;
    unsigned short *halves = (unsigned short *)(void *)f->scratch;
    size_t first, i;
    f->gl.BufferData(SCATTERI_GL_UNPACK_BUFFER, (ptrdiff_t)(2 * count), NULL, SCATTERI_GL_STREAM);
    for (first = 0; first < count; first += room) {
        const size_t n = count - first < room ? count - first : room;
        for (i = 0; i < n; i++)
            halves[i] = (unsigned short)scatteri_gl_half(values[first + i]);
        f->gl.BufferSubData(SCATTERI_GL_UNPACK_BUFFER, (ptrdiff_t)(2 * first), (ptrdiff_t)(2 * n),
                            halves);
    }
}

/* Voxels for a whole texture, through a buffer that gets new storage: nothing waits for what the GPU still reads. The
   buffer is kept where it `goes_on`. */
static void scatteri_gl_stream(scatter_gl *f, const scatteri_gl_texture *t, const float *values,
                               int goes_on)
{
    const size_t count = (size_t)t->width * (size_t)t->height * (size_t)t->depth;
    const int half = scatteri_gl_field_format(f) == SCATTERI_GL_R16F;
    f->gl.BindBuffer(SCATTERI_GL_UNPACK_BUFFER, f->voxel_buffer);
    if (half)
        scatteri_gl_buffer_halves(f, values, count);
    else
        f->gl.BufferData(SCATTERI_GL_UNPACK_BUFFER, (ptrdiff_t)(count * sizeof *values), values,
                         SCATTERI_GL_STREAM);
    scatteri_gl_bind(f, SCATTERI_GL_UNIT_BEFORE, t->target, t->name, 0);
    f->gl.TexSubImage3D(t->target, 0, 0, 0, 0, t->width, t->height, t->depth, SCATTERI_GL_RED,
                        half ? SCATTERI_GL_HALF_FLOAT : SCATTERI_GL_FLOAT, NULL);
    if (!goes_on)
        f->gl.BufferData(SCATTERI_GL_UNPACK_BUFFER, 0, NULL, SCATTERI_GL_STREAM);
    f->gl.BindBuffer(SCATTERI_GL_UNPACK_BUFFER, 0);
}

static int scatteri_gl_same_voxels(const scatter_grid *a, const scatter_grid *b)
{
    return a->density == b->density && a->nx == b->nx && a->ny == b->ny && a->nz == b->nz &&
           a->version == b->version;
}

/* Voxels that change go into the texture that the frame before does not read; those of a grid that stays have one. */
static scatter_result scatteri_gl_send_grid(scatter_gl *f, int i)
{
    const scatter_grid *g = &f->medium.desc.grids[i];
    scatteri_gl_voxels *v = &f->voxels[i];
    scatteri_gl_texture *t = &f->grids[i];
    const int goes_on = t->name != 0;
    scatter_result result = SCATTER_OK;
    if (scatteri_gl_same_voxels(&v->held, g))
        return SCATTER_OK;
    v->held.density = NULL;
    result = scatteri_gl_check_range(f, i);
    if (result == SCATTER_OK && goes_on) {
        const scatteri_gl_texture now = *t;
        *t = v->before;
        v->before = now;
    }
    if (result == SCATTER_OK)
        result = scatteri_gl_size_texture(f, t, scatteri_gl_field_format(f), g->nx, g->ny, g->nz);
    if (result != SCATTER_OK)
        return result;
    scatteri_gl_stream(f, t, g->density, goes_on);
    v->held = *g;
    return SCATTER_OK;
}

static scatter_result scatteri_gl_send_grids(scatter_gl *f)
{
    const int count = (int)f->medium.desc.grid_count;
    scatter_result result = scatteri_gl_room_for_grids(f, count);
    int i;
    for (i = 0; i < count && result == SCATTER_OK; i++)
        result = scatteri_gl_send_grid(f, i);
    return result;
}

/* Rows of a layer of the grid into f->spaced: density and distance in turn, as many as there is room for. */
static void scatteri_gl_send_spaced_rows(scatter_gl *f, const scatteri_field *field, int k, int j,
                                         int rows)
{
    const scatter_grid *g = &field->grid;
    const size_t n = (size_t)g->nx * (size_t)rows;
    const size_t first = ((size_t)k * (size_t)g->ny + (size_t)j) * (size_t)g->nx;
    const float most = scatteri_max(field->edge.x, scatteri_max(field->edge.y, field->edge.z));
    const int half = f->spaced.format == SCATTERI_GL_RG16F;
    const float unit = field->unit / most * (half ? 1.0f - 1.0f / 1024.0f : 1.0f);
    size_t i;
    for (i = 0; i < n; i++) {
        f->scratch[2 * i] = g->density[first + i];
        f->scratch[2 * i + 1] = (float)field->distances[first + i] * unit;
    }
    f->gl.TexSubImage3D(SCATTERI_GL_TEXTURE_3D, 0, 0, j, k, g->nx, rows, 1, SCATTERI_GL_RG,
                        SCATTERI_GL_FLOAT, f->scratch);
}

/* The distance map of the only grid, by the CPU: while its voxels are at hand, and where passes cannot draw it. */
static scatter_result scatteri_gl_send_distance(scatter_gl *f)
{
    const scatteri_field *field = &f->medium.fields[0];
    const scatter_grid *g = &field->grid;
    const int half = scatteri_gl_field_format(f) == SCATTERI_GL_R16F;
    const int most = scatteri_clamp_int((int)(f->scratch_floats / (2 * (size_t)g->nx)), 1, g->ny);
    scatter_result result = scatteri_map_medium(&f->host, &f->medium);
    int j, k;
    if (result == SCATTER_OK)
        result = scatteri_gl_size_texture(
            f, &f->spaced, half ? SCATTERI_GL_RG16F : SCATTERI_GL_RG32F, g->nx, g->ny, g->nz);
    if (result != SCATTER_OK)
        return result;
    scatteri_gl_bind(f, SCATTERI_GL_UNIT_BEFORE, SCATTERI_GL_TEXTURE_3D, f->spaced.name, 0);
    for (k = 0; k < g->nz; k++)
        for (j = 0; j < g->ny; j += most)
            scatteri_gl_send_spaced_rows(f, field, k, j, g->ny - j < most ? g->ny - j : most);
    f->spaced_of = &f->grids[0];
    f->spaced_version = f->medium_version;
    f->stats.distance_maps++;
    return SCATTER_OK;
}

/* What changes with density: tables, voxels and everything that is filled from them. */
static scatter_result scatteri_gl_take_density(scatter_gl *f, const scatter_medium *medium)
{
    scatteri_gl_state state;
    scatter_result result = scatteri_prepare(&f->host, &f->medium, medium);
    f->has_medium = 0;
    if (result != SCATTER_OK)
        return result;
    f->ref = f->medium.has_local
                 ? scatteri_scale(scatteri_add(f->medium.local.min, f->medium.local.max), 0.5f)
             : medium->bounded
                 ? scatteri_scale(scatteri_add(medium->bounds.min, medium->bounds.max), 0.5f)
                 : scatteri_v3(0.0f, 0.0f, 0.0f);
    f->medium_version++;
    scatteri_gl_forget_volumes(f, 1);
    scatteri_gl_save(f, &state);
    scatteri_gl_send_gaussians(f);
    result = scatteri_gl_send_grids(f);
    if (result == SCATTER_OK && f->medium.desc.grid_count == 1 && !f->can_draw_float)
        result = scatteri_gl_send_distance(f);
    scatteri_gl_restore(f, &state);
    f->has_medium = result == SCATTER_OK;
    return result;
}

SCATTER_API scatter_result scatter_gl_set_medium(scatter_gl *f, const scatter_medium *medium)
{
    scatter_result result;
    if (f == NULL)
        return SCATTER_BAD_ARGUMENT;
    result = scatteri_check_medium(&f->host, medium);
    if (result != SCATTER_OK)
        return result;
    if (medium->gaussian_count > (size_t)f->desc.max_gaussians)
        return scatteri_fail(&f->host, SCATTER_TOO_LARGE,
                             "medium.gaussian_count is %.0f, desc.max_gaussians is %d",
                             (double)medium->gaussian_count, f->desc.max_gaussians);
    if (medium->height_count > (size_t)SCATTERI_GL_HEIGHTS)
        return scatteri_fail(&f->host, SCATTER_TOO_LARGE,
                             "medium.height_count is %.0f, on the GPU it must be at most %d",
                             (double)medium->height_count, (int)SCATTERI_GL_HEIGHTS);
    f->ready = 0;
    if (f->has_medium && scatteri_same_density(&f->medium.desc, medium)) {
        scatteri_take_optics(&f->medium, medium);
        return SCATTER_OK;
    }
    return scatteri_gl_take_density(f, medium);
}

static int scatteri_gl_check_shadow(const scatteri_where *at, const scatter_gl_shadow *s)
{
    if ((int)s->kind < 0 || (int)s->kind > (int)SCATTER_GL_SHADOW_CUBE)
        return scatteri_refuse(at, ".shadow.kind", (float)s->kind, "one of scatter_gl_shadow_kind");
    if (s->kind == SCATTER_GL_SHADOW_NONE)
        return 1;
    if (!scatteri_check(at, ".shadow.bias", s->bias, 0.0f, 1.0f, "0..1"))
        return 0;
    if (s->kind == SCATTER_GL_SHADOW_CUBE)
        return scatteri_check(at, ".shadow.z_near", s->z_near, 0.0f, 1e18f, "0..1e18") &&
               ((s->z_far > s->z_near && s->z_far <= 1e18f) ||
                scatteri_refuse(at, ".shadow.z_far", s->z_far, "above z_near, at most 1e18"));
    return scatteri_check(at, ".shadow.cascades", (float)s->cascades, 0.0f, 4.0f, "0..4") &&
           scatteri_check(at, ".shadow.layer", (float)s->layer, 0.0f, 65535.0f, "0..65535");
}

/* A light as it is kept; its depth stays if its source did. */
static void scatteri_gl_take_light(scatteri_gl_lamp *lamp, const scatter_gl_light *light)
{
    const scatter_source before = scatteri_source_of(&lamp->desc.light);
    scatter_source now;
    scatter_light *l = &lamp->desc.light;
    lamp->desc = *light;
    if (l->kind != SCATTER_LIGHT_POINT)
        l->direction = scatteri_unit(l->direction);
    now = scatteri_source_of(l);
    if (!scatteri_same_source(&before, &now))
        lamp->filled = 0;
}

SCATTER_API scatter_result scatter_gl_set_lights(scatter_gl *f, const scatter_gl_light *lights,
                                                 size_t count)
{
    scatteri_where at = {NULL, "lights", 0};
    size_t i;
    if (f == NULL)
        return SCATTER_BAD_ARGUMENT;
    at.host = &f->host;
    if (count > (size_t)f->desc.max_lights)
        return scatteri_fail(&f->host, SCATTER_TOO_LARGE, "count is %.0f, desc.max_lights is %d",
                             (double)count, f->desc.max_lights);
    if (count > 0 && lights == NULL)
        return scatteri_fail(&f->host, SCATTER_BAD_ARGUMENT, "lights is NULL, count is %.0f",
                             (double)count);
    for (i = 0; i < count; i++) {
        at.index = (long)i;
        if (!scatteri_check_light(&at, &lights[i].light) ||
            !scatteri_gl_check_shadow(&at, &lights[i].shadow))
            return SCATTER_BAD_ARGUMENT;
    }
    f->ready = 0;
    for (i = 0; i < count; i++) {
        scatteri_gl_take_light(&f->lamps[i], &lights[i]);
        f->lamps[i].filled &= (int)i < f->lamp_count;
        f->lamps[i].held &= (int)i < f->lamp_count;
    }
    f->lamp_count = (int)count;
    return SCATTER_OK;
}

/* --- measures --- */

static float scatteri_gl_time(scatter_gl *f, int which)
{
    scatteri_gl_timer *t = &f->timers[which];
    uint64_t begin = 0, end = 0;
    int available = 0;
    if (t->begin == 0)
        return -1.0f;
    if (t->pending)
        f->gl.GetQueryObjectiv(t->end, SCATTERI_GL_QUERY_AVAILABLE, &available);
    if (available) {
        f->gl.GetQueryObjectui64v(t->begin, SCATTERI_GL_QUERY_RESULT, &begin);
        f->gl.GetQueryObjectui64v(t->end, SCATTERI_GL_QUERY_RESULT, &end);
        t->ms = (float)((double)(end - begin) * 1e-6);
        t->pending = 0;
    }
    return t->ms;
}

SCATTER_API scatter_gl_times scatter_gl_get_times(scatter_gl *f)
{
    scatter_gl_times times = {-1.0f, -1.0f, -1.0f, -1.0f, -1.0f};
    int bound = 0;
    if (f == NULL)
        return times;
    if (!f->es && f->version >= 440)
        bound = scatteri_gl_get(f, SCATTERI_GL_QUERY_BUFFER_BINDING);
    if (bound != 0) /* results would go into it */
        f->gl.BindBuffer(SCATTERI_GL_QUERY_BUFFER, 0);
    times.inject = scatteri_gl_time(f, SCATTERI_GL_TIME_INJECT);
    times.depth = scatteri_gl_time(f, SCATTERI_GL_TIME_DEPTH);
    times.view = scatteri_gl_time(f, SCATTERI_GL_TIME_VIEW);
    times.upsample = scatteri_gl_time(f, SCATTERI_GL_TIME_UPSAMPLE);
    times.froxels = scatteri_gl_time(f, SCATTERI_GL_TIME_FROXELS);
    if (bound != 0)
        f->gl.BindBuffer(SCATTERI_GL_QUERY_BUFFER, (unsigned)bound);
    return times;
}

SCATTER_API scatter_gl_stats scatter_gl_get_stats(const scatter_gl *f)
{
    scatter_gl_stats none;
    memset(&none, 0, sizeof none);
    return f != NULL ? f->stats : none;
}

SCATTER_API const char *scatter_gl_glsl(const char *chapter)
{
    size_t i;
    for (i = 0; i < sizeof scatteri_gl_chapters / sizeof scatteri_gl_chapters[0]; i++)
        if (strcmp(scatteri_gl_chapters[i].name, chapter) == 0)
            return scatteri_gl_chapters[i].text;
    return NULL;
}

SCATTER_API const char *scatter_gl_pass_name(int index)
{
    return index >= 0 && index < (int)SCATTERI_GL_PASSES ? scatteri_gl_passes[index].name : NULL;
}

SCATTER_API const char *scatter_gl_feature_name(int index)
{
    return index >= 0 && index < (int)SCATTERI_GL_FEATURE_COUNT ? scatteri_gl_feature_names[index]
                                                                : NULL;
}

/* The pass whose name is the first `length` characters, or -1. */
static int scatteri_gl_find_pass(const char *name, size_t length)
{
    int i;
    for (i = 0; i < (int)SCATTERI_GL_PASSES; i++)
        if (strlen(scatteri_gl_passes[i].name) == length &&
            strncmp(scatteri_gl_passes[i].name, name, length) == 0)
            return i;
    return -1;
}

/* Adds a feature, or sets the number of layers; 0 if the word is neither. */
static int scatteri_gl_add_word(scatteri_gl_key *key, const char *word)
{
    int i;
    if (word[0] >= '1' && word[0] <= '0' + (int)SCATTERI_GL_SLICES && word[1] == 0) {
        key->slices = word[0] - '0';
        return 1;
    }
    for (i = 0; i < (int)SCATTERI_GL_FEATURE_COUNT; i++)
        if (strcmp(word, scatteri_gl_feature_names[i]) == 0) {
            key->features |= (scatteri_gl_features)1 << i;
            return 1;
        }
    return 0;
}

static size_t scatteri_gl_join(const scatteri_gl_source *source, char *text, size_t room)
{
    size_t used = 0;
    int i;
    for (i = 0; i < source->count; i++) {
        const char *c;
        for (c = source->parts[i]; *c != 0; c++, used++)
            if (used + 1 < room)
                text[used] = *c;
    }
    if (room > 0)
        text[used < room ? used : room - 1] = 0;
    return used;
}

SCATTER_API size_t scatter_gl_shader(const char *version, const char *pass, const char *features,
                                     char *text, size_t room)
{
    const size_t length = strcspn(pass, ":");
    const int vertex = strcmp(pass + length, ":vertex") == 0;
    scatteri_gl_source source;
    scatteri_gl_key key;
    char word[32];
    key.pass = scatteri_gl_find_pass(pass, length);
    key.features = 0;
    key.slices = 1;
    key.count = 0;
    if (key.pass < 0 || (pass[length] != 0 && !vertex))
        return 0;
    while ((features = scatteri_gl_next_word(features, word, sizeof word)) != NULL)
        if (!scatteri_gl_add_word(&key, word))
            return 0;
    key.features &= scatteri_gl_passes[key.pass].knows;
    scatteri_gl_assemble(version, key,
                         vertex ? scatteri_gl_passes[key.pass].vertex
                                : scatteri_gl_passes[key.pass].fragment,
                         &source);
    return scatteri_gl_join(&source, text, room);
}

#endif /* SCATTER_IMPLEMENTATION */
