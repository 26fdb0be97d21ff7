/* gl_leaks.h - planted faults: what a careless library may do to its host's OpenGL, one each. Every
   one changes something whatever the state was. Include it after gl_host.h. */
#ifndef GL_LEAKS_H
#define GL_LEAKS_H

typedef struct gl_leak {
    const char *name; /* of the value that changes */
    int gl, es;       /* first version in which it can happen */
    void (*leak)(gl_host *);
} gl_leak;

/* clang-format off */
#define GL_LEAK(name, ...) \
    static inline void gl_leak_##name(gl_host *h) { const gl_functions *gl = &h->gl; __VA_ARGS__; }
/* clang-format on */

static inline void gl_flip(const gl_functions *gl, GLenum what) {
    (gl->IsEnabled(what) ? gl->Disable : gl->Enable)(what);
}

/* The first of two that is not set now. */
static inline GLenum gl_other(const gl_functions *gl, GLenum get, GLenum a, GLenum b) {
    return gl_get(gl, get) == (GLint)a ? b : a;
}

/* Another buffer than the one bound. */
static inline GLuint gl_other_buffer(gl_host *h, GLenum get) {
    return gl_other(&h->gl, get, h->buffers[0].name, h->buffers[1].name);
}

/* Binds a texture of that kind to a unit, or none if it was bound there; the active unit stays. */
static inline void gl_swap_texture(gl_host *h, GLenum kind, GLenum unit) {
    GLint active = gl_get(&h->gl, GL_ACTIVE_TEXTURE);
    h->gl.ActiveTexture(GL_TEXTURE0 + unit);
    h->gl.BindTexture(kind, gl_other(&h->gl, gl_texture_binding(kind), gl_host_texture(h, kind), 0));
    h->gl.ActiveTexture((GLenum)active);
}

static inline void gl_swap_sampler(gl_host *h, GLuint unit) {
    GLint active = gl_get(&h->gl, GL_ACTIVE_TEXTURE);
    h->gl.ActiveTexture(GL_TEXTURE0 + unit);
    h->gl.BindSampler(unit, gl_other(&h->gl, GL_SAMPLER_BINDING, h->samplers[0].name, 0));
    h->gl.ActiveTexture((GLenum)active);
}

/* A setting of a texture of the host, while it stays bound nowhere new. */
static inline void gl_tune_texture(gl_host *h, GLenum name, GLint a, GLint b) {
    GLint x = 0, before = gl_get(&h->gl, GL_TEXTURE_BINDING_2D);
    GLfloat now[4];
    h->gl.BindTexture(GL_TEXTURE_2D, gl_host_texture(h, GL_TEXTURE_2D));
    h->gl.GetTexParameterfv(GL_TEXTURE_2D, name, now);
    x = (GLint)now[0] == a ? b : a;
    h->gl.TexParameteri(GL_TEXTURE_2D, name, x);
    h->gl.BindTexture(GL_TEXTURE_2D, (GLuint)before);
}

/* Something in an array of the host that is not bound afterwards. */
static inline void gl_tune_array(gl_host *h, void (*tune)(gl_host *)) {
    GLint array = gl_get(&h->gl, GL_VERTEX_ARRAY_BINDING);
    GLint buffer = gl_get(&h->gl, GL_ARRAY_BUFFER_BINDING);
    h->gl.BindVertexArray(h->arrays[1].name);
    tune(h);
    h->gl.BindVertexArray((GLuint)array);
    h->gl.BindBuffer(GL_ARRAY_BUFFER, (GLuint)buffer);
}

static inline void gl_tune_enabled(gl_host *h) {
    GLint on = 0;
    h->gl.GetVertexAttribiv(2, GL_VERTEX_ATTRIB_ARRAY_ENABLED, &on);
    (on ? h->gl.DisableVertexAttribArray : h->gl.EnableVertexAttribArray)(2);
}

static inline void gl_tune_pointer(gl_host *h) {
    h->gl.BindBuffer(GL_ARRAY_BUFFER, h->buffers[1].name);
    h->gl.VertexAttribPointer(3, 2, GL_FLOAT, GL_FALSE, 12, (const void *)(uintptr_t)444);
}

static inline void gl_tune_divisor(gl_host *h) { h->gl.VertexAttribDivisor(1, 7); }

static inline void gl_tune_elements(gl_host *h) {
    h->gl.BindBuffer(GL_ELEMENT_ARRAY_BUFFER,
                     gl_other_buffer(h, GL_ELEMENT_ARRAY_BUFFER_BINDING));
}

static inline void gl_tune_range(gl_host *h, GLenum target, GLenum binding, GLuint index) {
    GLint generic = gl_get(&h->gl, binding);
    h->gl.BindBufferRange(target, index, h->buffers[1].name, 256 * 13, 16 * 17);
    h->gl.BindBuffer(target, (GLuint)generic);
}

static inline void gl_tune_framebuffer(gl_host *h) {
    GLint draw = gl_get(&h->gl, GL_DRAW_FRAMEBUFFER_BINDING);
    h->gl.BindFramebuffer(GL_DRAW_FRAMEBUFFER, h->framebuffers[1].name);
    h->gl.FramebufferRenderbuffer(GL_DRAW_FRAMEBUFFER, GL_STENCIL_ATTACHMENT, GL_RENDERBUFFER, 0);
    h->gl.BindFramebuffer(GL_DRAW_FRAMEBUFFER, (GLuint)draw);
}

/* The state of a framebuffer of the host that may not be bound. */
static inline void gl_tune_draw_buffer(gl_host *h) {
    GLint draw = gl_get(&h->gl, GL_DRAW_FRAMEBUFFER_BINDING);
    GLenum buffer;
    h->gl.BindFramebuffer(GL_DRAW_FRAMEBUFFER, h->framebuffers[0].name);
    buffer = gl_other(&h->gl, GL_DRAW_BUFFER0, GL_COLOR_ATTACHMENT0, GL_NONE);
    h->gl.DrawBuffers(1, &buffer);
    h->gl.BindFramebuffer(GL_DRAW_FRAMEBUFFER, (GLuint)draw);
}

static inline void gl_tune_read_buffer(gl_host *h) {
    GLint read = gl_get(&h->gl, GL_READ_FRAMEBUFFER_BINDING);
    h->gl.BindFramebuffer(GL_READ_FRAMEBUFFER, h->framebuffers[0].name);
    h->gl.ReadBuffer(gl_other(&h->gl, GL_READ_BUFFER, GL_COLOR_ATTACHMENT0, GL_NONE));
    h->gl.BindFramebuffer(GL_READ_FRAMEBUFFER, (GLuint)read);
}

static inline void gl_tune_contents(gl_host *h) {
    GLint before = gl_get(&h->gl, GL_COPY_WRITE_BUFFER_BINDING);
    const GLfloat x = 77;
    h->gl.BindBuffer(GL_COPY_WRITE_BUFFER, h->buffers[2].name);
    h->gl.BufferSubData(GL_COPY_WRITE_BUFFER, 40000, sizeof x, &x);
    h->gl.BindBuffer(GL_COPY_WRITE_BUFFER, (GLuint)before);
}

static inline void gl_flip_mask(gl_host *h) {
    GLint mask[4] = {0, 0, 0, 0};
    h->gl.GetIntegerv(GL_COLOR_WRITEMASK, mask);
    h->gl.ColorMask(!mask[0], 1, 1, 1);
}

static inline void gl_end_query(gl_host *h) {
    if (h->running[0])
        h->gl.EndQuery(GL_ANY_SAMPLES_PASSED);
    else
        h->gl.BeginQuery(GL_ANY_SAMPLES_PASSED, h->query[0]);
    h->running[0] = !h->running[0];
}

GL_LEAK(blend, gl_flip(gl, GL_BLEND))
GL_LEAK(cull, gl_flip(gl, GL_CULL_FACE))
GL_LEAK(depth_test, gl_flip(gl, GL_DEPTH_TEST))
GL_LEAK(scissor_test, gl_flip(gl, GL_SCISSOR_TEST))
GL_LEAK(stencil_test, gl_flip(gl, GL_STENCIL_TEST))
GL_LEAK(discard, gl_flip(gl, GL_RASTERIZER_DISCARD))
GL_LEAK(dither, gl_flip(gl, GL_DITHER))
GL_LEAK(coverage, gl_flip(gl, GL_SAMPLE_ALPHA_TO_COVERAGE))
GL_LEAK(srgb, gl_flip(gl, GL_FRAMEBUFFER_SRGB))
GL_LEAK(restart, gl_flip(gl, GL_PRIMITIVE_RESTART))
GL_LEAK(clamp, gl_flip(gl, GL_DEPTH_CLAMP))
GL_LEAK(seamless, gl_flip(gl, GL_TEXTURE_CUBE_MAP_SEAMLESS))
GL_LEAK(logic, gl_flip(gl, GL_COLOR_LOGIC_OP))
GL_LEAK(clip, gl_flip(gl, GL_CLIP_DISTANCE0 + 3))
GL_LEAK(blend_one, (gl->IsEnabledi(GL_BLEND, 2) ? gl->Disablei : gl->Enablei)(GL_BLEND, 2))
GL_LEAK(factor, GLenum f = gl_other(gl, GL_BLEND_DST_ALPHA, GL_ONE, GL_SRC_ALPHA);
        gl->BlendFuncSeparate(GL_ONE, GL_ONE, GL_ONE, f))
GL_LEAK(equation, GLenum e = gl_other(gl, GL_BLEND_EQUATION_RGB, GL_MIN, GL_MAX);
        gl->BlendEquationSeparate(e, e))
GL_LEAK(constant, gl->BlendColor(0.125f, 2, 3, 4))
GL_LEAK(color_mask, gl_flip_mask(h); (void)gl)
GL_LEAK(depth_mask, gl->DepthMask((GLboolean)!gl_get(gl, GL_DEPTH_WRITEMASK)))
GL_LEAK(depth_func, gl->DepthFunc(gl_other(gl, GL_DEPTH_FUNC, GL_ALWAYS, GL_LESS)))
GL_LEAK(back_mask, gl->StencilMaskSeparate(GL_BACK, 0x1234567))
GL_LEAK(front_ref, gl->StencilFuncSeparate(GL_FRONT, GL_LESS,
                                           gl_get(gl, GL_STENCIL_REF) ^ 1, 3))
GL_LEAK(viewport, gl->Viewport(0, 0, 640, 480))
GL_LEAK(scissor, gl->Scissor(0, 0, 640, 480))
GL_LEAK(clear_color, gl->ClearColor(2, 0, 0, 0))
GL_LEAK(front_face, gl->FrontFace(gl_other(gl, GL_FRONT_FACE, GL_CW, GL_CCW)))
GL_LEAK(polygon_mode, gl->PolygonMode(GL_FRONT_AND_BACK,
                                      gl_other(gl, GL_POLYGON_MODE, GL_LINE, GL_FILL)))
GL_LEAK(offset, gl->PolygonOffset(5, 7))
GL_LEAK(clip_control, gl->ClipControl(GL_LOWER_LEFT, gl_other(gl, GL_CLIP_DEPTH_MODE,
                                      GL_ZERO_TO_ONE, GL_NEGATIVE_ONE_TO_ONE)))
GL_LEAK(alignment, gl->PixelStorei(GL_UNPACK_ALIGNMENT,
                                   (GLint)gl_other(gl, GL_UNPACK_ALIGNMENT, 1, 4)))
GL_LEAK(row_length, gl->PixelStorei(GL_UNPACK_ROW_LENGTH, 10))
GL_LEAK(skip_images, gl->PixelStorei(GL_UNPACK_SKIP_IMAGES, 10))
GL_LEAK(pack_row, gl->PixelStorei(GL_PACK_ROW_LENGTH, 10))
GL_LEAK(program, gl->UseProgram(gl_other(gl, GL_CURRENT_PROGRAM, h->program, 0)))
GL_LEAK(uniform, GLint p = gl_get(gl, GL_CURRENT_PROGRAM); gl->UseProgram(h->program);
        gl->Uniform4f(gl->GetUniformLocation(h->program, "tint"), 9, 9, 9, 9);
        gl->UseProgram((GLuint)p))
GL_LEAK(pipeline, gl->BindProgramPipeline(
                      gl_other(gl, GL_PROGRAM_PIPELINE_BINDING, h->pipeline, 0)))
GL_LEAK(array, gl->BindVertexArray(gl_other(gl, GL_VERTEX_ARRAY_BINDING, h->arrays[1].name, 0)))
GL_LEAK(attribute, gl_tune_array(h, gl_tune_enabled); (void)gl)
GL_LEAK(pointer, gl_tune_array(h, gl_tune_pointer); (void)gl)
GL_LEAK(divisor, gl_tune_array(h, gl_tune_divisor); (void)gl)
GL_LEAK(elements, gl_tune_array(h, gl_tune_elements); (void)gl)
GL_LEAK(current, gl->VertexAttrib4f(1, 5, 5, 5, 5))
GL_LEAK(array_buffer, gl->BindBuffer(GL_ARRAY_BUFFER, gl_other_buffer(h, GL_ARRAY_BUFFER_BINDING)))
GL_LEAK(unpack_buffer, gl->BindBuffer(GL_PIXEL_UNPACK_BUFFER,
                                      gl_other_buffer(h, GL_PIXEL_UNPACK_BUFFER_BINDING)))
GL_LEAK(uniform_buffer, gl->BindBuffer(GL_UNIFORM_BUFFER,
                                       gl_other_buffer(h, GL_UNIFORM_BUFFER_BINDING)))
GL_LEAK(uniform_range, gl_tune_range(h, GL_UNIFORM_BUFFER, GL_UNIFORM_BUFFER_BINDING, 5); (void)gl)
GL_LEAK(storage_range, gl_tune_range(h, GL_SHADER_STORAGE_BUFFER, GL_SHADER_STORAGE_BUFFER_BINDING,
                                     2); (void)gl)
GL_LEAK(contents, gl_tune_contents(h); (void)gl)
GL_LEAK(draw_framebuffer, gl->BindFramebuffer(GL_DRAW_FRAMEBUFFER, gl_other(gl,
        GL_DRAW_FRAMEBUFFER_BINDING, h->framebuffers[0].name, h->framebuffers[1].name)))
GL_LEAK(read_framebuffer, gl->BindFramebuffer(GL_READ_FRAMEBUFFER, gl_other(gl,
        GL_READ_FRAMEBUFFER_BINDING, h->framebuffers[0].name, h->framebuffers[1].name)))
GL_LEAK(renderbuffer, gl->BindRenderbuffer(GL_RENDERBUFFER,
                          gl_other(gl, GL_RENDERBUFFER_BINDING, h->renderbuffer[0], 0)))
GL_LEAK(draw_buffer, gl_tune_draw_buffer(h); (void)gl)
GL_LEAK(read_buffer, gl_tune_read_buffer(h); (void)gl)
GL_LEAK(attachment, gl_tune_framebuffer(h); (void)gl)
GL_LEAK(active, gl->ActiveTexture(gl_other(gl, GL_ACTIVE_TEXTURE, GL_TEXTURE3, GL_TEXTURE0)))
GL_LEAK(texture_2d, gl_swap_texture(h, GL_TEXTURE_2D, 3); (void)gl)
GL_LEAK(texture_3d, gl_swap_texture(h, GL_TEXTURE_3D, 1); (void)gl)
GL_LEAK(texture_array, gl_swap_texture(h, GL_TEXTURE_2D_ARRAY, 17); (void)gl)
GL_LEAK(texture_cube, gl_swap_texture(h, GL_TEXTURE_CUBE_MAP, 31); (void)gl)
GL_LEAK(sampler, gl_swap_sampler(h, 4); (void)gl)
GL_LEAK(compare, gl_tune_texture(h, GL_TEXTURE_COMPARE_MODE, GL_NONE, GL_COMPARE_REF_TO_TEXTURE);
        (void)gl)
GL_LEAK(filter, gl_tune_texture(h, GL_TEXTURE_MIN_FILTER, GL_NEAREST, GL_LINEAR); (void)gl)
GL_LEAK(swizzle, gl_tune_texture(h, GL_TEXTURE_SWIZZLE_R, GL_ALPHA, GL_RED); (void)gl)
GL_LEAK(base, gl_tune_texture(h, GL_TEXTURE_BASE_LEVEL, 0, 1); (void)gl)
GL_LEAK(sampler_wrap, gl->SamplerParameteri(h->samplers[1].name, GL_TEXTURE_MIN_LOD, 55))
GL_LEAK(query, gl_end_query(h); (void)gl)
GL_LEAK(deleted, gl->DeleteRenderbuffers(1, &h->renderbuffer[0]))

/* clang-format off */
static const gl_leak gl_leaks[] = {
    {"BLEND", 30, 30, gl_leak_blend}, {"CULL_FACE", 30, 30, gl_leak_cull},
    {"DEPTH_TEST", 30, 30, gl_leak_depth_test}, {"SCISSOR_TEST", 30, 30, gl_leak_scissor_test},
    {"STENCIL_TEST", 30, 30, gl_leak_stencil_test},
    {"RASTERIZER_DISCARD", 30, 30, gl_leak_discard}, {"DITHER", 30, 30, gl_leak_dither},
    {"SAMPLE_ALPHA_TO_COVERAGE", 30, 30, gl_leak_coverage},
    {"FRAMEBUFFER_SRGB", 30, GL_ABSENT, gl_leak_srgb},
    {"PRIMITIVE_RESTART", 31, GL_ABSENT, gl_leak_restart},
    {"DEPTH_CLAMP", 32, GL_ABSENT, gl_leak_clamp},
    {"TEXTURE_CUBE_MAP_SEAMLESS", 32, GL_ABSENT, gl_leak_seamless},
    {"COLOR_LOGIC_OP", 30, GL_ABSENT, gl_leak_logic},
    {"CLIP_DISTANCE0", 30, GL_ABSENT, gl_leak_clip}, {"BLEND", 30, 32, gl_leak_blend_one},
    {"BLEND_DST_ALPHA", 30, 30, gl_leak_factor}, {"BLEND_EQUATION_RGB", 30, 30, gl_leak_equation},
    {"BLEND_COLOR", 30, 30, gl_leak_constant}, {"COLOR_WRITEMASK", 30, 30, gl_leak_color_mask},
    {"DEPTH_WRITEMASK", 30, 30, gl_leak_depth_mask}, {"DEPTH_FUNC", 30, 30, gl_leak_depth_func},
    {"STENCIL_BACK_WRITEMASK", 30, 30, gl_leak_back_mask},
    {"STENCIL_REF", 30, 30, gl_leak_front_ref}, {"VIEWPORT", 30, 30, gl_leak_viewport},
    {"SCISSOR_BOX", 30, 30, gl_leak_scissor}, {"COLOR_CLEAR_VALUE", 30, 30, gl_leak_clear_color},
    {"FRONT_FACE", 30, 30, gl_leak_front_face},
    {"POLYGON_MODE", 30, GL_ABSENT, gl_leak_polygon_mode},
    {"POLYGON_OFFSET_UNITS", 30, 30, gl_leak_offset},
    {"CLIP_DEPTH_MODE", 45, GL_ABSENT, gl_leak_clip_control},
    {"UNPACK_ALIGNMENT", 30, 30, gl_leak_alignment},
    {"UNPACK_ROW_LENGTH", 30, 30, gl_leak_row_length},
    {"UNPACK_SKIP_IMAGES", 30, 30, gl_leak_skip_images},
    {"PACK_ROW_LENGTH", 30, 30, gl_leak_pack_row}, {"CURRENT_PROGRAM", 30, 30, gl_leak_program},
    {"UNIFORMS", 30, 30, gl_leak_uniform}, {"PROGRAM_PIPELINE_BINDING", 41, 31, gl_leak_pipeline},
    {"VERTEX_ARRAY_BINDING", 30, 30, gl_leak_array},
    {"VERTEX_ATTRIB_ARRAY_ENABLED", 30, 30, gl_leak_attribute},
    {"VERTEX_ATTRIB_ARRAY_POINTER", 30, 30, gl_leak_pointer},
    {"VERTEX_ATTRIB_ARRAY_DIVISOR", 33, 30, gl_leak_divisor},
    {"ELEMENT_ARRAY_BUFFER_BINDING", 30, 30, gl_leak_elements},
    {"CURRENT_VERTEX_ATTRIB", 30, 30, gl_leak_current},
    {"ARRAY_BUFFER_BINDING", 30, 30, gl_leak_array_buffer},
    {"PIXEL_UNPACK_BUFFER_BINDING", 30, 30, gl_leak_unpack_buffer},
    {"UNIFORM_BUFFER_BINDING", 31, 30, gl_leak_uniform_buffer},
    {"UNIFORM_BUFFER_START", 31, 30, gl_leak_uniform_range},
    {"SHADER_STORAGE_BUFFER_SIZE", 43, 31, gl_leak_storage_range},
    {"BUFFER_CONTENTS", 30, 30, gl_leak_contents},
    {"DRAW_FRAMEBUFFER_BINDING", 30, 30, gl_leak_draw_framebuffer},
    {"READ_FRAMEBUFFER_BINDING", 30, 30, gl_leak_read_framebuffer},
    {"RENDERBUFFER_BINDING", 30, 30, gl_leak_renderbuffer},
    {"DRAW_BUFFER0", 30, 30, gl_leak_draw_buffer}, {"READ_BUFFER", 30, 30, gl_leak_read_buffer},
    {"FRAMEBUFFER_ATTACHMENT", 30, 30, gl_leak_attachment},
    {"ACTIVE_TEXTURE", 30, 30, gl_leak_active},
    {"TEXTURE_BINDING_2D", 30, 30, gl_leak_texture_2d},
    {"TEXTURE_BINDING_3D", 30, 30, gl_leak_texture_3d},
    {"TEXTURE_BINDING_2D_ARRAY", 30, 30, gl_leak_texture_array},
    {"TEXTURE_BINDING_CUBE_MAP", 30, 30, gl_leak_texture_cube},
    {"SAMPLER_BINDING", 33, 30, gl_leak_sampler},
    {"TEXTURE_COMPARE_MODE", 30, 30, gl_leak_compare},
    {"TEXTURE_MIN_FILTER", 30, 30, gl_leak_filter}, {"TEXTURE_SWIZZLE_R", 33, 30, gl_leak_swizzle},
    {"TEXTURE_BASE_LEVEL", 30, 30, gl_leak_base},
    {"TEXTURE_MIN_LOD", 33, 30, gl_leak_sampler_wrap},
    {"ANY_SAMPLES_PASSED", 33, 30, gl_leak_query},
    {"EXISTS", 30, 30, gl_leak_deleted},
};
/* clang-format on */

#endif /* GL_LEAKS_H */
