/* gl_state.h - everything that glGet and its sisters tell about a context, as a list of numbers with
   names, so that a call that must not change anything can be held to it.

   Taken are: all settings, bindings of all texture units, indexed buffers and image units, the
   attributes of the vertex array that is bound, and of the objects that the caller names: whether
   they exist, and their own settings. Not gettable, so not here: conditional rendering. Include it
   after check.h. */
#ifndef GL_STATE_H
#define GL_STATE_H

#include "gl_functions.h"

#define GL_ABSENT 99
#define GL_STATE_ROOM 16384

/* Names that only GLES3/gl32.h has. */
#define GL_GENERATE_MIPMAP_HINT 0x8192
#define GL_PRIMITIVE_BOUNDING_BOX 0x92BE

/* One number, or up to eight, that can be asked for. */
typedef struct gl_value {
    const char *name;
    GLenum id;
    char how;    /* see gl_state_read */
    int count;   /* numbers */
    int gl, es;  /* first version that has it */
    GLenum many; /* 0: one; else there are as many, by index, as glGet says for this */
} gl_value;

typedef struct gl_item {
    const char *name, *detail;
    int index, count;
    double value[8];
} gl_item;

typedef struct gl_state {
    size_t count;
    GLenum error; /* what glGetError said after it was taken */
    gl_item item[GL_STATE_ROOM];
} gl_state;

/* An object of the host, by the target of its kind: GL_TEXTURE_2D and so on, GL_SAMPLER,
   GL_VERTEX_ARRAY, GL_FRAMEBUFFER, GL_RENDERBUFFER, GL_BUFFER, GL_PROGRAM. */
typedef struct gl_object {
    GLenum kind;
    GLuint name;
} gl_object;

typedef struct gl_objects {
    size_t count;
    gl_object object[128];
} gl_objects;

static inline void gl_objects_add(gl_objects *o, GLenum kind, GLuint name) {
    gl_object *last = &o->object[o->count++];
    assert_true(o->count <= CHECK_COUNT(o->object));
    last->kind = kind;
    last->name = name;
}

static inline int gl_has(const gl_functions *gl, int since_gl, int since_es) {
    return gl->version >= (gl->es ? since_es : since_gl);
}

static inline GLint gl_get(const gl_functions *gl, GLenum id) {
    GLint value[8] = {0, 0, 0, 0, 0, 0, 0, 0};
    gl->GetIntegerv(id, value);
    return value[0];
}

/* ------------------------------------------------------- >>reading */

/* clang-format off */
#define GL_ROW(name, how, count, gl, es) {#name, GL_##name, how, count, gl, es, 0}
#define GL_ROWS(name, how, count, gl, es, many) {#name, GL_##name, how, count, gl, es, GL_##many}

static inline const gl_value *gl_state_values(size_t *count) {
    static const gl_value values[] = {
        GL_ROW(BLEND, 'e', 1, 30, 30), GL_ROW(COLOR_LOGIC_OP, 'e', 1, 30, GL_ABSENT),
        GL_ROW(CULL_FACE, 'e', 1, 30, 30), GL_ROW(DEPTH_CLAMP, 'e', 1, 32, GL_ABSENT),
        GL_ROW(DEPTH_TEST, 'e', 1, 30, 30), GL_ROW(DITHER, 'e', 1, 30, 30),
        GL_ROW(FRAMEBUFFER_SRGB, 'e', 1, 30, GL_ABSENT), GL_ROW(LINE_SMOOTH, 'e', 1, 30, GL_ABSENT),
        GL_ROW(MULTISAMPLE, 'e', 1, 30, GL_ABSENT), GL_ROW(POLYGON_OFFSET_FILL, 'e', 1, 30, 30),
        GL_ROW(POLYGON_OFFSET_LINE, 'e', 1, 30, GL_ABSENT),
        GL_ROW(POLYGON_OFFSET_POINT, 'e', 1, 30, GL_ABSENT),
        GL_ROW(POLYGON_SMOOTH, 'e', 1, 30, GL_ABSENT),
        GL_ROW(PRIMITIVE_RESTART, 'e', 1, 31, GL_ABSENT),
        GL_ROW(PRIMITIVE_RESTART_FIXED_INDEX, 'e', 1, 43, 30),
        GL_ROW(RASTERIZER_DISCARD, 'e', 1, 30, 30),
        GL_ROW(SAMPLE_ALPHA_TO_COVERAGE, 'e', 1, 30, 30),
        GL_ROW(SAMPLE_ALPHA_TO_ONE, 'e', 1, 30, GL_ABSENT), GL_ROW(SAMPLE_COVERAGE, 'e', 1, 30, 30),
        GL_ROW(SAMPLE_MASK, 'e', 1, 32, 31), GL_ROW(SAMPLE_SHADING, 'e', 1, 40, 32),
        GL_ROW(SCISSOR_TEST, 'e', 1, 30, 30), GL_ROW(STENCIL_TEST, 'e', 1, 30, 30),
        GL_ROW(TEXTURE_CUBE_MAP_SEAMLESS, 'e', 1, 32, GL_ABSENT),
        GL_ROW(PROGRAM_POINT_SIZE, 'e', 1, 32, GL_ABSENT), GL_ROW(DEBUG_OUTPUT, 'e', 1, 43, 32),
        GL_ROW(DEBUG_OUTPUT_SYNCHRONOUS, 'e', 1, 43, 32),
        GL_ROWS(CLIP_DISTANCE0, '+', 1, 30, GL_ABSENT, MAX_CLIP_DISTANCES),
        GL_ROWS(BLEND, 'E', 1, 30, 32, MAX_DRAW_BUFFERS),
        GL_ROWS(SCISSOR_TEST, 'E', 1, 41, GL_ABSENT, MAX_VIEWPORTS),

        GL_ROW(BLEND_COLOR, 'f', 4, 30, 30), GL_ROW(BLEND_SRC_RGB, 'i', 1, 30, 30),
        GL_ROW(BLEND_SRC_ALPHA, 'i', 1, 30, 30), GL_ROW(BLEND_DST_RGB, 'i', 1, 30, 30),
        GL_ROW(BLEND_DST_ALPHA, 'i', 1, 30, 30), GL_ROW(BLEND_EQUATION_RGB, 'i', 1, 30, 30),
        GL_ROW(BLEND_EQUATION_ALPHA, 'i', 1, 30, 30), GL_ROW(COLOR_WRITEMASK, 'i', 4, 30, 30),
        GL_ROWS(BLEND_SRC_RGB, 'I', 1, 40, 32, MAX_DRAW_BUFFERS),
        GL_ROWS(BLEND_SRC_ALPHA, 'I', 1, 40, 32, MAX_DRAW_BUFFERS),
        GL_ROWS(BLEND_DST_RGB, 'I', 1, 40, 32, MAX_DRAW_BUFFERS),
        GL_ROWS(BLEND_DST_ALPHA, 'I', 1, 40, 32, MAX_DRAW_BUFFERS),
        GL_ROWS(BLEND_EQUATION_RGB, 'I', 1, 40, 32, MAX_DRAW_BUFFERS),
        GL_ROWS(BLEND_EQUATION_ALPHA, 'I', 1, 40, 32, MAX_DRAW_BUFFERS),
        GL_ROWS(COLOR_WRITEMASK, 'I', 4, 30, 32, MAX_DRAW_BUFFERS),
        GL_ROW(COLOR_CLEAR_VALUE, 'f', 4, 30, 30), GL_ROW(DEPTH_CLEAR_VALUE, 'f', 1, 30, 30),
        GL_ROW(STENCIL_CLEAR_VALUE, 'i', 1, 30, 30), GL_ROW(DEPTH_FUNC, 'i', 1, 30, 30),
        GL_ROW(DEPTH_WRITEMASK, 'i', 1, 30, 30), GL_ROW(DEPTH_RANGE, 'f', 2, 30, 30),
        GL_ROWS(DEPTH_RANGE, 'F', 2, 41, GL_ABSENT, MAX_VIEWPORTS),
        GL_ROW(VIEWPORT, 'f', 4, 30, 30), GL_ROWS(VIEWPORT, 'F', 4, 41, GL_ABSENT, MAX_VIEWPORTS),
        GL_ROW(SCISSOR_BOX, 'i', 4, 30, 30),
        GL_ROWS(SCISSOR_BOX, 'I', 4, 41, GL_ABSENT, MAX_VIEWPORTS),

        GL_ROW(STENCIL_FUNC, 'i', 1, 30, 30), GL_ROW(STENCIL_REF, 'i', 1, 30, 30),
        GL_ROW(STENCIL_VALUE_MASK, 'i', 1, 30, 30), GL_ROW(STENCIL_FAIL, 'i', 1, 30, 30),
        GL_ROW(STENCIL_PASS_DEPTH_FAIL, 'i', 1, 30, 30),
        GL_ROW(STENCIL_PASS_DEPTH_PASS, 'i', 1, 30, 30), GL_ROW(STENCIL_WRITEMASK, 'i', 1, 30, 30),
        GL_ROW(STENCIL_BACK_FUNC, 'i', 1, 30, 30), GL_ROW(STENCIL_BACK_REF, 'i', 1, 30, 30),
        GL_ROW(STENCIL_BACK_VALUE_MASK, 'i', 1, 30, 30), GL_ROW(STENCIL_BACK_FAIL, 'i', 1, 30, 30),
        GL_ROW(STENCIL_BACK_PASS_DEPTH_FAIL, 'i', 1, 30, 30),
        GL_ROW(STENCIL_BACK_PASS_DEPTH_PASS, 'i', 1, 30, 30),
        GL_ROW(STENCIL_BACK_WRITEMASK, 'i', 1, 30, 30),

        GL_ROW(CULL_FACE_MODE, 'i', 1, 30, 30), GL_ROW(FRONT_FACE, 'i', 1, 30, 30),
        GL_ROW(POLYGON_MODE, 'i', 1, 30, GL_ABSENT), GL_ROW(POLYGON_OFFSET_FACTOR, 'f', 1, 30, 30),
        GL_ROW(POLYGON_OFFSET_UNITS, 'f', 1, 30, 30),
        GL_ROW(POLYGON_OFFSET_CLAMP, 'f', 1, 46, GL_ABSENT), GL_ROW(LINE_WIDTH, 'f', 1, 30, 30),
        GL_ROW(POINT_SIZE, 'f', 1, 30, GL_ABSENT),
        GL_ROW(POINT_FADE_THRESHOLD_SIZE, 'f', 1, 30, GL_ABSENT),
        GL_ROW(POINT_SPRITE_COORD_ORIGIN, 'i', 1, 30, GL_ABSENT),
        GL_ROW(PROVOKING_VERTEX, 'i', 1, 32, GL_ABSENT), GL_ROW(LOGIC_OP_MODE, 'i', 1, 30, GL_ABSENT),
        GL_ROW(CLAMP_READ_COLOR, 'i', 1, 30, GL_ABSENT),
        GL_ROW(PRIMITIVE_RESTART_INDEX, 'i', 1, 31, GL_ABSENT),
        GL_ROW(SAMPLE_COVERAGE_VALUE, 'f', 1, 30, 30),
        GL_ROW(SAMPLE_COVERAGE_INVERT, 'i', 1, 30, 30),
        GL_ROW(MIN_SAMPLE_SHADING_VALUE, 'f', 1, 40, 32),
        GL_ROWS(SAMPLE_MASK_VALUE, 'I', 1, 32, 31, MAX_SAMPLE_MASK_WORDS),
        GL_ROW(PATCH_VERTICES, 'i', 1, 40, 32),
        GL_ROW(PATCH_DEFAULT_INNER_LEVEL, 'f', 2, 40, GL_ABSENT),
        GL_ROW(PATCH_DEFAULT_OUTER_LEVEL, 'f', 4, 40, GL_ABSENT),
        GL_ROW(PRIMITIVE_BOUNDING_BOX, 'f', 8, GL_ABSENT, 32),
        GL_ROW(CLIP_ORIGIN, 'i', 1, 45, GL_ABSENT), GL_ROW(CLIP_DEPTH_MODE, 'i', 1, 45, GL_ABSENT),
        GL_ROW(LINE_SMOOTH_HINT, 'i', 1, 30, GL_ABSENT),
        GL_ROW(POLYGON_SMOOTH_HINT, 'i', 1, 30, GL_ABSENT),
        GL_ROW(TEXTURE_COMPRESSION_HINT, 'i', 1, 30, GL_ABSENT),
        GL_ROW(FRAGMENT_SHADER_DERIVATIVE_HINT, 'i', 1, 30, 30),
        GL_ROW(GENERATE_MIPMAP_HINT, 'i', 1, GL_ABSENT, 30),
        GL_ROW(DEBUG_GROUP_STACK_DEPTH, 'i', 1, 43, 32),

        GL_ROW(PACK_SWAP_BYTES, 'i', 1, 30, GL_ABSENT), GL_ROW(PACK_LSB_FIRST, 'i', 1, 30, GL_ABSENT),
        GL_ROW(PACK_ROW_LENGTH, 'i', 1, 30, 30), GL_ROW(PACK_SKIP_ROWS, 'i', 1, 30, 30),
        GL_ROW(PACK_SKIP_PIXELS, 'i', 1, 30, 30), GL_ROW(PACK_ALIGNMENT, 'i', 1, 30, 30),
        GL_ROW(PACK_IMAGE_HEIGHT, 'i', 1, 30, GL_ABSENT),
        GL_ROW(PACK_SKIP_IMAGES, 'i', 1, 30, GL_ABSENT),
        GL_ROW(PACK_COMPRESSED_BLOCK_WIDTH, 'i', 1, 42, GL_ABSENT),
        GL_ROW(PACK_COMPRESSED_BLOCK_HEIGHT, 'i', 1, 42, GL_ABSENT),
        GL_ROW(PACK_COMPRESSED_BLOCK_DEPTH, 'i', 1, 42, GL_ABSENT),
        GL_ROW(PACK_COMPRESSED_BLOCK_SIZE, 'i', 1, 42, GL_ABSENT),
        GL_ROW(UNPACK_SWAP_BYTES, 'i', 1, 30, GL_ABSENT),
        GL_ROW(UNPACK_LSB_FIRST, 'i', 1, 30, GL_ABSENT), GL_ROW(UNPACK_ROW_LENGTH, 'i', 1, 30, 30),
        GL_ROW(UNPACK_SKIP_ROWS, 'i', 1, 30, 30), GL_ROW(UNPACK_SKIP_PIXELS, 'i', 1, 30, 30),
        GL_ROW(UNPACK_ALIGNMENT, 'i', 1, 30, 30), GL_ROW(UNPACK_IMAGE_HEIGHT, 'i', 1, 30, 30),
        GL_ROW(UNPACK_SKIP_IMAGES, 'i', 1, 30, 30),
        GL_ROW(UNPACK_COMPRESSED_BLOCK_WIDTH, 'i', 1, 42, GL_ABSENT),
        GL_ROW(UNPACK_COMPRESSED_BLOCK_HEIGHT, 'i', 1, 42, GL_ABSENT),
        GL_ROW(UNPACK_COMPRESSED_BLOCK_DEPTH, 'i', 1, 42, GL_ABSENT),
        GL_ROW(UNPACK_COMPRESSED_BLOCK_SIZE, 'i', 1, 42, GL_ABSENT),

        GL_ROW(CURRENT_PROGRAM, 'i', 1, 30, 30), GL_ROW(PROGRAM_PIPELINE_BINDING, 'i', 1, 41, 31),
        GL_ROW(DRAW_FRAMEBUFFER_BINDING, 'i', 1, 30, 30),
        GL_ROW(READ_FRAMEBUFFER_BINDING, 'i', 1, 30, 30),
        GL_ROW(RENDERBUFFER_BINDING, 'i', 1, 30, 30), GL_ROW(READ_BUFFER, 'i', 1, 30, 30),
        GL_ROWS(DRAW_BUFFER0, 'n', 1, 30, 30, MAX_DRAW_BUFFERS),
        GL_ROW(ARRAY_BUFFER_BINDING, 'i', 1, 30, 30),
        GL_ROW(COPY_READ_BUFFER_BINDING, 'i', 1, 31, 30),
        GL_ROW(COPY_WRITE_BUFFER_BINDING, 'i', 1, 31, 30),
        GL_ROW(PIXEL_PACK_BUFFER_BINDING, 'i', 1, 30, 30),
        GL_ROW(PIXEL_UNPACK_BUFFER_BINDING, 'i', 1, 30, 30),
        GL_ROW(TEXTURE_BUFFER_BINDING, 'i', 1, 31, 32),
        GL_ROW(DRAW_INDIRECT_BUFFER_BINDING, 'i', 1, 40, 31),
        GL_ROW(DISPATCH_INDIRECT_BUFFER_BINDING, 'i', 1, 43, 31),
        GL_ROW(QUERY_BUFFER_BINDING, 'i', 1, 44, GL_ABSENT),
        GL_ROW(PARAMETER_BUFFER_BINDING, 'i', 1, 46, GL_ABSENT),
        GL_ROW(UNIFORM_BUFFER_BINDING, 'i', 1, 31, 30),
        GL_ROWS(UNIFORM_BUFFER_BINDING, 'I', 1, 31, 30, MAX_UNIFORM_BUFFER_BINDINGS),
        GL_ROWS(UNIFORM_BUFFER_START, 'L', 1, 31, 30, MAX_UNIFORM_BUFFER_BINDINGS),
        GL_ROWS(UNIFORM_BUFFER_SIZE, 'L', 1, 31, 30, MAX_UNIFORM_BUFFER_BINDINGS),
        GL_ROW(TRANSFORM_FEEDBACK_BINDING, 'i', 1, 40, 30),
        GL_ROW(TRANSFORM_FEEDBACK_ACTIVE, 'i', 1, 40, 30),
        GL_ROW(TRANSFORM_FEEDBACK_PAUSED, 'i', 1, 40, 30),
        GL_ROW(TRANSFORM_FEEDBACK_BUFFER_BINDING, 'i', 1, 30, 30),
        GL_ROWS(TRANSFORM_FEEDBACK_BUFFER_BINDING, 'I', 1, 30, 30,
                MAX_TRANSFORM_FEEDBACK_SEPARATE_ATTRIBS),
        GL_ROWS(TRANSFORM_FEEDBACK_BUFFER_START, 'L', 1, 30, 30,
                MAX_TRANSFORM_FEEDBACK_SEPARATE_ATTRIBS),
        GL_ROWS(TRANSFORM_FEEDBACK_BUFFER_SIZE, 'L', 1, 30, 30,
                MAX_TRANSFORM_FEEDBACK_SEPARATE_ATTRIBS),
        GL_ROW(SHADER_STORAGE_BUFFER_BINDING, 'i', 1, 43, 31),
        GL_ROWS(SHADER_STORAGE_BUFFER_BINDING, 'I', 1, 43, 31, MAX_SHADER_STORAGE_BUFFER_BINDINGS),
        GL_ROWS(SHADER_STORAGE_BUFFER_START, 'L', 1, 43, 31, MAX_SHADER_STORAGE_BUFFER_BINDINGS),
        GL_ROWS(SHADER_STORAGE_BUFFER_SIZE, 'L', 1, 43, 31, MAX_SHADER_STORAGE_BUFFER_BINDINGS),
        GL_ROW(ATOMIC_COUNTER_BUFFER_BINDING, 'i', 1, 42, 31),
        GL_ROWS(ATOMIC_COUNTER_BUFFER_BINDING, 'I', 1, 42, 31, MAX_ATOMIC_COUNTER_BUFFER_BINDINGS),
        GL_ROWS(ATOMIC_COUNTER_BUFFER_START, 'L', 1, 42, 31, MAX_ATOMIC_COUNTER_BUFFER_BINDINGS),
        GL_ROWS(ATOMIC_COUNTER_BUFFER_SIZE, 'L', 1, 42, 31, MAX_ATOMIC_COUNTER_BUFFER_BINDINGS),
        GL_ROWS(IMAGE_BINDING_NAME, 'I', 1, 42, 31, MAX_IMAGE_UNITS),
        GL_ROWS(IMAGE_BINDING_LEVEL, 'I', 1, 42, 31, MAX_IMAGE_UNITS),
        GL_ROWS(IMAGE_BINDING_LAYERED, 'I', 1, 42, 31, MAX_IMAGE_UNITS),
        GL_ROWS(IMAGE_BINDING_LAYER, 'I', 1, 42, 31, MAX_IMAGE_UNITS),
        GL_ROWS(IMAGE_BINDING_ACCESS, 'I', 1, 42, 31, MAX_IMAGE_UNITS),
        GL_ROWS(IMAGE_BINDING_FORMAT, 'I', 1, 42, 31, MAX_IMAGE_UNITS),

        GL_ROW(ACTIVE_TEXTURE, 'i', 1, 30, 30),
        GL_ROWS(TEXTURE_BINDING_1D, 'u', 1, 30, GL_ABSENT, MAX_COMBINED_TEXTURE_IMAGE_UNITS),
        GL_ROWS(TEXTURE_BINDING_2D, 'u', 1, 30, 30, MAX_COMBINED_TEXTURE_IMAGE_UNITS),
        GL_ROWS(TEXTURE_BINDING_3D, 'u', 1, 30, 30, MAX_COMBINED_TEXTURE_IMAGE_UNITS),
        GL_ROWS(TEXTURE_BINDING_CUBE_MAP, 'u', 1, 30, 30, MAX_COMBINED_TEXTURE_IMAGE_UNITS),
        GL_ROWS(TEXTURE_BINDING_1D_ARRAY, 'u', 1, 30, GL_ABSENT, MAX_COMBINED_TEXTURE_IMAGE_UNITS),
        GL_ROWS(TEXTURE_BINDING_2D_ARRAY, 'u', 1, 30, 30, MAX_COMBINED_TEXTURE_IMAGE_UNITS),
        GL_ROWS(TEXTURE_BINDING_RECTANGLE, 'u', 1, 31, GL_ABSENT, MAX_COMBINED_TEXTURE_IMAGE_UNITS),
        GL_ROWS(TEXTURE_BINDING_BUFFER, 'u', 1, 31, 32, MAX_COMBINED_TEXTURE_IMAGE_UNITS),
        GL_ROWS(TEXTURE_BINDING_CUBE_MAP_ARRAY, 'u', 1, 40, 32, MAX_COMBINED_TEXTURE_IMAGE_UNITS),
        GL_ROWS(TEXTURE_BINDING_2D_MULTISAMPLE, 'u', 1, 32, 31, MAX_COMBINED_TEXTURE_IMAGE_UNITS),
        GL_ROWS(TEXTURE_BINDING_2D_MULTISAMPLE_ARRAY, 'u', 1, 32, 32,
                MAX_COMBINED_TEXTURE_IMAGE_UNITS),
        GL_ROWS(SAMPLER_BINDING, 'u', 1, 33, 30, MAX_COMBINED_TEXTURE_IMAGE_UNITS),

        GL_ROW(SAMPLES_PASSED, 'q', 1, 30, GL_ABSENT), GL_ROW(ANY_SAMPLES_PASSED, 'q', 1, 33, 30),
        GL_ROW(ANY_SAMPLES_PASSED_CONSERVATIVE, 'q', 1, 43, 30),
        GL_ROW(PRIMITIVES_GENERATED, 'q', 1, 30, 32),
        GL_ROW(TRANSFORM_FEEDBACK_PRIMITIVES_WRITTEN, 'q', 1, 30, 30),
        GL_ROW(TIME_ELAPSED, 'q', 1, 33, GL_ABSENT),

        GL_ROW(VERTEX_ARRAY_BINDING, 'i', 1, 30, 30),
        GL_ROWS(CURRENT_VERTEX_ATTRIB, 'A', 4, 30, 30, MAX_VERTEX_ATTRIBS),
    };
    *count = CHECK_COUNT(values);
    return values;
}

/* What a vertex array holds. */
static inline const gl_value *gl_state_array_values(size_t *count) {
    static const gl_value values[] = {
        GL_ROW(ELEMENT_ARRAY_BUFFER_BINDING, 'i', 1, 30, 30),
        GL_ROWS(VERTEX_ATTRIB_ARRAY_ENABLED, 'a', 1, 30, 30, MAX_VERTEX_ATTRIBS),
        GL_ROWS(VERTEX_ATTRIB_ARRAY_SIZE, 'a', 1, 30, 30, MAX_VERTEX_ATTRIBS),
        GL_ROWS(VERTEX_ATTRIB_ARRAY_STRIDE, 'a', 1, 30, 30, MAX_VERTEX_ATTRIBS),
        GL_ROWS(VERTEX_ATTRIB_ARRAY_TYPE, 'a', 1, 30, 30, MAX_VERTEX_ATTRIBS),
        GL_ROWS(VERTEX_ATTRIB_ARRAY_NORMALIZED, 'a', 1, 30, 30, MAX_VERTEX_ATTRIBS),
        GL_ROWS(VERTEX_ATTRIB_ARRAY_INTEGER, 'a', 1, 30, 30, MAX_VERTEX_ATTRIBS),
        GL_ROWS(VERTEX_ATTRIB_ARRAY_DIVISOR, 'a', 1, 33, 30, MAX_VERTEX_ATTRIBS),
        GL_ROWS(VERTEX_ATTRIB_ARRAY_BUFFER_BINDING, 'a', 1, 30, 30, MAX_VERTEX_ATTRIBS),
        GL_ROWS(VERTEX_ATTRIB_ARRAY_POINTER, 'p', 1, 30, 30, MAX_VERTEX_ATTRIBS),
        GL_ROWS(VERTEX_ATTRIB_RELATIVE_OFFSET, 'a', 1, 43, 31, MAX_VERTEX_ATTRIBS),
        GL_ROWS(VERTEX_ATTRIB_BINDING, 'a', 1, 43, 31, MAX_VERTEX_ATTRIBS),
        GL_ROWS(VERTEX_BINDING_OFFSET, 'L', 1, 43, 31, MAX_VERTEX_ATTRIBS),
        GL_ROWS(VERTEX_BINDING_STRIDE, 'I', 1, 43, 31, MAX_VERTEX_ATTRIBS),
        GL_ROWS(VERTEX_BINDING_DIVISOR, 'I', 1, 43, 31, MAX_VERTEX_ATTRIBS),
    };
    *count = CHECK_COUNT(values);
    return values;
}

/* What a texture holds; the first part of it is also in a sampler. */
static inline const gl_value *gl_state_texture_values(int sampler, size_t *count) {
    static const gl_value values[] = {
        GL_ROW(TEXTURE_MIN_FILTER, 't', 1, 30, 30), GL_ROW(TEXTURE_MAG_FILTER, 't', 1, 30, 30),
        GL_ROW(TEXTURE_WRAP_S, 't', 1, 30, 30), GL_ROW(TEXTURE_WRAP_T, 't', 1, 30, 30),
        GL_ROW(TEXTURE_WRAP_R, 't', 1, 30, 30), GL_ROW(TEXTURE_MIN_LOD, 't', 1, 30, 30),
        GL_ROW(TEXTURE_MAX_LOD, 't', 1, 30, 30), GL_ROW(TEXTURE_COMPARE_MODE, 't', 1, 30, 30),
        GL_ROW(TEXTURE_COMPARE_FUNC, 't', 1, 30, 30),
        GL_ROW(TEXTURE_LOD_BIAS, 't', 1, 30, GL_ABSENT),
        GL_ROW(TEXTURE_BORDER_COLOR, 't', 4, 30, 32),
        GL_ROW(TEXTURE_BASE_LEVEL, 't', 1, 30, 30), GL_ROW(TEXTURE_MAX_LEVEL, 't', 1, 30, 30),
        GL_ROW(TEXTURE_SWIZZLE_R, 't', 1, 33, 30), GL_ROW(TEXTURE_SWIZZLE_G, 't', 1, 33, 30),
        GL_ROW(TEXTURE_SWIZZLE_B, 't', 1, 33, 30), GL_ROW(TEXTURE_SWIZZLE_A, 't', 1, 33, 30),
        GL_ROW(DEPTH_STENCIL_TEXTURE_MODE, 't', 1, 43, 31),
    };
    *count = sampler ? 11 : CHECK_COUNT(values);
    return values;
}
/* clang-format on */

/* A new item; what does not fit is counted, and gl_state_take refuses it. */
static inline gl_item *gl_state_add(gl_state *s, const char *name, const char *detail, int index) {
    gl_item *item = &s->item[s->count < GL_STATE_ROOM ? s->count : GL_STATE_ROOM - 1];
    s->count++;
    memset(item, 0, sizeof *item);
    item->name = name;
    item->detail = detail;
    item->index = index;
    item->count = 1;
    return item;
}

/* Integers: i glGetIntegerv, I indexed, L indexed with 64 bits, n of the i-th enumerator after it,
   a of a vertex attribute, q the query that runs, u of texture unit i. */
static inline int gl_state_read_int(const gl_functions *gl, const gl_value *v, int i, GLint *x) {
    GLuint index = (GLuint)i;
    GLint64 wide = 0;
    switch (v->how) {
    case 'i': gl->GetIntegerv(v->id, x); return 1;
    case 'I': gl->GetIntegeri_v(v->id, index, x); return 1;
    case 'L': gl->GetInteger64i_v(v->id, index, &wide); break;
    case 'n': gl->GetIntegerv(v->id + index, x); return 1;
    case 'a': gl->GetVertexAttribiv(index, v->id, x); return 1;
    case 'q': gl->GetQueryiv(v->id, GL_CURRENT_QUERY, x); return 1;
    case 'e': x[0] = gl->IsEnabled(v->id); return 1;
    case 'E': x[0] = gl->IsEnabledi(v->id, index); return 1;
    case '+': x[0] = gl->IsEnabled(v->id + index); return 1;
    case 'u':
        gl->ActiveTexture(GL_TEXTURE0 + index);
        gl->GetIntegerv(v->id, x);
        return 1;
    default: return 0;
    }
    x[0] = (GLint)wide;
    return 1;
}

/* Others: f glGetFloatv, F indexed, A of a vertex attribute, p its pointer, t of the texture that
   is bound to the target, or of a sampler if the target is GL_SAMPLER. */
static inline void gl_state_read_float(const gl_functions *gl, const gl_value *v, int i,
                                       gl_object of, GLfloat *x) {
    GLuint index = (GLuint)i;
    void *pointer = NULL;
    switch (v->how) {
    case 'f': gl->GetFloatv(v->id, x); break;
    case 'F': gl->GetFloati_v(v->id, index, x); break;
    case 'A': gl->GetVertexAttribfv(index, v->id, x); break;
    case 'p':
        gl->GetVertexAttribPointerv(index, v->id, &pointer);
        x[0] = (float)(uintptr_t)pointer;
        break;
    case 't':
        if (of.kind == GL_SAMPLER)
            gl->GetSamplerParameterfv(of.name, v->id, x);
        else
            gl->GetTexParameterfv(of.kind, v->id, x);
        break;
    default: assert_true(0);
    }
}

static inline void gl_state_read(const gl_functions *gl, gl_state *s, const gl_value *v, int i,
                                 gl_object of) {
    gl_item *item = gl_state_add(s, v->name, of.name ? "object" : "", of.name ? (int)of.name : i);
    GLint integers[8] = {0, 0, 0, 0, 0, 0, 0, 0};
    GLfloat floats[8] = {0, 0, 0, 0, 0, 0, 0, 0};
    int k, whole = gl_state_read_int(gl, v, i, integers);
    if (!whole)
        gl_state_read_float(gl, v, i, of, floats);
    item->count = v->count;
    for (k = 0; k < v->count; k++)
        item->value[k] = whole ? (double)integers[k] : (double)floats[k];
}

static inline void gl_state_read_all(const gl_functions *gl, gl_state *s, const gl_value *values,
                                     size_t count, gl_object of) {
    size_t n;
    for (n = 0; n < count; n++)
        if (gl_has(gl, values[n].gl, values[n].es)) {
            int i, many = values[n].many ? gl_get(gl, values[n].many) : 1;
            for (i = 0; i < many; i++)
                gl_state_read(gl, s, &values[n], i, of);
        }
}

/* ------------------------------------------------------- >>objects */

static inline void gl_state_read_texture(const gl_functions *gl, gl_state *s, gl_object o,
                                         GLenum binding) {
    size_t count;
    const gl_value *values = gl_state_texture_values(0, &count);
    GLint before = gl_get(gl, binding);
    gl->BindTexture(o.kind, o.name);
    gl_state_read_all(gl, s, values, count, o);
    gl->BindTexture(o.kind, (GLuint)before);
}

static inline void gl_state_read_array(const gl_functions *gl, gl_state *s, gl_object o) {
    size_t count;
    const gl_value *values = gl_state_array_values(&count);
    GLint before = gl_get(gl, GL_VERTEX_ARRAY_BINDING);
    gl->BindVertexArray(o.name);
    gl_state_read_all(gl, s, values, count, o);
    gl->BindVertexArray((GLuint)before);
}

static inline void gl_state_read_attachment(const gl_functions *gl, gl_state *s, gl_object o,
                                            GLenum attachment) {
    static const GLenum more[] = {GL_FRAMEBUFFER_ATTACHMENT_OBJECT_NAME,
                                  GL_FRAMEBUFFER_ATTACHMENT_TEXTURE_LEVEL,
                                  GL_FRAMEBUFFER_ATTACHMENT_TEXTURE_CUBE_MAP_FACE,
                                  GL_FRAMEBUFFER_ATTACHMENT_TEXTURE_LAYER};
    gl_item *item = gl_state_add(s, "FRAMEBUFFER_ATTACHMENT", "object", (int)o.name);
    GLint x = 0;
    int k, count;
    gl->GetFramebufferAttachmentParameteriv(GL_DRAW_FRAMEBUFFER, attachment,
                                            GL_FRAMEBUFFER_ATTACHMENT_OBJECT_TYPE, &x);
    item->value[0] = (double)attachment;
    item->value[1] = (double)x;
    count = x == GL_NONE ? 0 : x == GL_TEXTURE ? 4 : 1;
    for (k = 0; k < count; k++) {
        gl->GetFramebufferAttachmentParameteriv(GL_DRAW_FRAMEBUFFER, attachment, more[k], &x);
        item->value[2 + k] = (double)x;
    }
    item->count = 6;
}

static inline void gl_state_read_framebuffer(const gl_functions *gl, gl_state *s, gl_object o) {
    static const gl_value buffers[] = {GL_ROWS(DRAW_BUFFER0, 'n', 1, 30, 30, MAX_DRAW_BUFFERS),
                                       GL_ROW(READ_BUFFER, 'i', 1, 30, 30)};
    GLint draw = gl_get(gl, GL_DRAW_FRAMEBUFFER_BINDING);
    GLint read = gl_get(gl, GL_READ_FRAMEBUFFER_BINDING);
    GLint i, colors = gl_get(gl, GL_MAX_COLOR_ATTACHMENTS);
    gl->BindFramebuffer(GL_FRAMEBUFFER, o.name);
    for (i = 0; i < colors; i++)
        gl_state_read_attachment(gl, s, o, GL_COLOR_ATTACHMENT0 + (GLenum)i);
    gl_state_read_attachment(gl, s, o, GL_DEPTH_ATTACHMENT);
    gl_state_read_attachment(gl, s, o, GL_STENCIL_ATTACHMENT);
    gl_state_read_all(gl, s, buffers, CHECK_COUNT(buffers), o);
    gl->BindFramebuffer(GL_DRAW_FRAMEBUFFER, (GLuint)draw);
    gl->BindFramebuffer(GL_READ_FRAMEBUFFER, (GLuint)read);
}

/* Its size, and a sum over its bytes that depends on their order. */
static inline void gl_state_read_buffer(const gl_functions *gl, gl_state *s, gl_object o) {
    gl_item *item = gl_state_add(s, "BUFFER_CONTENTS", "object", (int)o.name);
    GLint i, size = 0, before = gl_get(gl, GL_COPY_READ_BUFFER_BINDING);
    const unsigned char *bytes;
    uint32_t sum = 0;
    gl->BindBuffer(GL_COPY_READ_BUFFER, o.name);
    gl->GetBufferParameteriv(GL_COPY_READ_BUFFER, GL_BUFFER_SIZE, &size);
    bytes = (const unsigned char *)gl->MapBufferRange(GL_COPY_READ_BUFFER, 0, size, GL_MAP_READ_BIT);
    assert_true(bytes != NULL);
    for (i = 0; i < size; i++)
        sum = 31 * sum + bytes[i];
    gl->UnmapBuffer(GL_COPY_READ_BUFFER);
    gl->BindBuffer(GL_COPY_READ_BUFFER, (GLuint)before);
    item->count = 2;
    item->value[0] = (double)size;
    item->value[1] = (double)sum;
}

/* The uniforms that the host's program has. */
static inline void gl_state_read_program(const gl_functions *gl, gl_state *s, gl_object o) {
    GLint tint = gl->GetUniformLocation(o.name, "tint");
    GLint picture = gl->GetUniformLocation(o.name, "picture");
    GLuint block = gl->GetUniformBlockIndex(o.name, "Shift");
    gl_item *item = gl_state_add(s, "UNIFORMS", "program", (int)o.name);
    GLfloat f[4] = {0, 0, 0, 0};
    GLint k, x[2] = {0, 0};
    gl->GetUniformfv(o.name, tint, f);
    gl->GetUniformiv(o.name, picture, &x[0]);
    gl->GetActiveUniformBlockiv(o.name, block, GL_UNIFORM_BLOCK_BINDING, &x[1]);
    item->count = 6;
    for (k = 0; k < 4; k++)
        item->value[k] = (double)f[k];
    item->value[4] = x[0];
    item->value[5] = x[1];
}

static inline GLenum gl_texture_binding(GLenum target) {
    switch (target) {
    case GL_TEXTURE_1D: return GL_TEXTURE_BINDING_1D;
    case GL_TEXTURE_2D: return GL_TEXTURE_BINDING_2D;
    case GL_TEXTURE_3D: return GL_TEXTURE_BINDING_3D;
    case GL_TEXTURE_1D_ARRAY: return GL_TEXTURE_BINDING_1D_ARRAY;
    case GL_TEXTURE_2D_ARRAY: return GL_TEXTURE_BINDING_2D_ARRAY;
    case GL_TEXTURE_CUBE_MAP: return GL_TEXTURE_BINDING_CUBE_MAP;
    case GL_TEXTURE_CUBE_MAP_ARRAY: return GL_TEXTURE_BINDING_CUBE_MAP_ARRAY;
    case GL_TEXTURE_RECTANGLE: return GL_TEXTURE_BINDING_RECTANGLE;
    default: return 0; /* multisampled and buffer textures have no settings */
    }
}

static inline int gl_object_exists(const gl_functions *gl, gl_object o) {
    switch (o.kind) {
    case GL_SAMPLER: return gl->IsSampler(o.name);
    case GL_VERTEX_ARRAY: return gl->IsVertexArray(o.name);
    case GL_FRAMEBUFFER: return gl->IsFramebuffer(o.name);
    case GL_RENDERBUFFER: return gl->IsRenderbuffer(o.name);
    case GL_BUFFER: return gl->IsBuffer(o.name);
    case GL_PROGRAM: return gl->IsProgram(o.name);
    default: return gl->IsTexture(o.name);
    }
}

static inline void gl_state_read_object(const gl_functions *gl, gl_state *s, gl_object o) {
    size_t count;
    const gl_value *values = gl_state_texture_values(1, &count);
    int exists = gl_object_exists(gl, o);
    gl_state_add(s, "EXISTS", "object", (int)o.name)->value[0] = exists;
    if (!exists)
        return;
    switch (o.kind) {
    case GL_SAMPLER: gl_state_read_all(gl, s, values, count, o); break;
    case GL_VERTEX_ARRAY: gl_state_read_array(gl, s, o); break;
    case GL_FRAMEBUFFER: gl_state_read_framebuffer(gl, s, o); break;
    case GL_BUFFER: gl_state_read_buffer(gl, s, o); break;
    case GL_PROGRAM: gl_state_read_program(gl, s, o); break;
    default:
        if (gl_texture_binding(o.kind))
            gl_state_read_texture(gl, s, o, gl_texture_binding(o.kind));
    }
}

/* --------------------------------------------------------- >>calls */

/* Fills s; the context is as before. */
static inline void gl_state_take(const gl_functions *gl, const gl_objects *objects, gl_state *s) {
    static const gl_object none = {0, 0};
    size_t i, count;
    const gl_value *values = gl_state_values(&count);
    GLint unit = gl_get(gl, GL_ACTIVE_TEXTURE);
    s->count = 0;
    gl_state_read_all(gl, s, values, count, none);
    gl->ActiveTexture((GLenum)unit);
    for (i = 0; i < objects->count; i++)
        gl_state_read_object(gl, s, objects->object[i]);
    s->error = gl->GetError();
    assert_true(s->count <= GL_STATE_ROOM);
}

static inline int gl_item_differs(const gl_item *a, const gl_item *b) {
    return a->name != b->name || a->index != b->index ||
           memcmp(a->value, b->value, sizeof a->value) != 0;
}

/* The index of the next item from `from` on that differs, or -1. */
static inline int gl_state_difference(const gl_state *a, const gl_state *b, size_t from) {
    size_t i, count = a->count > b->count ? a->count : b->count;
    for (i = from; i < count; i++)
        if (i >= a->count || i >= b->count || gl_item_differs(&a->item[i], &b->item[i]))
            return (int)i;
    return -1;
}

static inline void gl_item_print(const gl_item *item, const char *when) {
    int k;
    fprintf(stderr, "  %s: %s %s %d:", when, item->name, item->detail, item->index);
    for (k = 0; k < item->count; k++)
        fprintf(stderr, " %.9g", item->value[k]);
    fprintf(stderr, "\n");
}

/* 1 where both are the same and no error was pending; else says what differs. */
static inline int gl_state_same(const gl_state *a, const gl_state *b, const char *what) {
    int i, shown = 0;
    for (i = gl_state_difference(a, b, 0); i >= 0 && shown < 20; shown++) {
        fprintf(stderr, "%s changed the state of OpenGL:\n", what);
        gl_item_print(&a->item[i], "before");
        gl_item_print(&b->item[i], " after");
        i = gl_state_difference(a, b, (size_t)i + 1);
    }
    if (a->error || b->error)
        fprintf(stderr, "%s: errors of OpenGL 0x%x, 0x%x\n", what, a->error, b->error);
    return shown == 0 && !a->error && !b->error;
}

/* How many objects of each kind live, among the first thousand names: textures, buffers,
   framebuffers, renderbuffers, vertex arrays, samplers, programs and shaders, queries. */
typedef struct gl_census {
    int count[8];
} gl_census;

static inline gl_census gl_count_objects(const gl_functions *gl) {
    gl_census c;
    GLuint i;
    memset(&c, 0, sizeof c);
    for (i = 1; i < 1000; i++) {
        c.count[0] += gl->IsTexture(i);
        c.count[1] += gl->IsBuffer(i);
        c.count[2] += gl->IsFramebuffer(i);
        c.count[3] += gl->IsRenderbuffer(i);
        c.count[4] += gl->IsVertexArray(i);
        c.count[5] += gl->IsSampler(i);
        c.count[6] += gl->IsProgram(i) + gl->IsShader(i);
        c.count[7] += gl->IsQuery(i);
    }
    return c;
}

#endif /* GL_STATE_H */
