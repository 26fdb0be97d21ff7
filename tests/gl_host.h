/* gl_host.h - a program that uses OpenGL in its own way: it has objects of every kind, sets every
   setting to something odd but legal, and draws a quad. Include it after gl_state.h. */
#ifndef GL_HOST_H
#define GL_HOST_H

#define GL_HOST_SIZE 24 /* pixels of its picture, to a side */

typedef struct gl_host {
    gl_functions gl;
    gl_objects objects; /* all of them */
    gl_object textures[24], samplers[2], arrays[2], buffers[3], framebuffers[2];
    size_t texture_count;
    GLuint program, renderbuffer[2], query[3], feedback[2], pipeline;
    int running[3], feeding; /* queries that run; a transform feedback that is paused */
} gl_host;

/* -------------------------------------------------------- >>random */

static inline int gl_pick(uint64_t *seed, int count)
{
    return (int)(check_bits(seed) % (uint64_t)count);
}

static inline GLenum gl_pick_enum(uint64_t *seed, const GLenum *list, size_t count)
{
    return list[check_bits(seed) % count];
}

#define GL_PICK(seed, list) gl_pick_enum(seed, list, CHECK_COUNT(list))

static const GLenum gl_compares[] = {GL_NEVER,   GL_LESS,     GL_EQUAL,  GL_LEQUAL,
                                     GL_GREATER, GL_NOTEQUAL, GL_GEQUAL, GL_ALWAYS};

/* ------------------------------------------------------- >>objects */

static inline GLuint gl_host_shader(gl_host *h, GLenum kind, const char *text)
{
    const char *source[2];
    GLuint shader = h->gl.CreateShader(kind);
    source[0] = h->gl.es ? "#version 300 es\nprecision highp float;\n" : "#version 330\n";
    source[1] = text;
    h->gl.ShaderSource(shader, 2, source, NULL);
    h->gl.CompileShader(shader);
    h->gl.AttachShader(h->program, shader);
    return shader;
}

static inline void gl_host_make_program(gl_host *h)
{
    static const char *const varyings[] = {"at"};
    GLuint vertex, fragment;
    GLint linked = 0;
    h->program = h->gl.CreateProgram();
    vertex = gl_host_shader(h, GL_VERTEX_SHADER,
                            "layout(location = 0) in vec2 place;\n"
                            "out vec2 at;\n"
                            "void main() {\n"
                            "    at = 0.5 + 0.5 * place;\n"
                            "    gl_Position = vec4(place, 0.25, 1.0);\n"
                            "}\n");
    fragment =
        gl_host_shader(h, GL_FRAGMENT_SHADER,
                       "uniform sampler2D picture;\n"
                       "uniform vec4 tint;\n"
                       "layout(std140) uniform Shift { vec4 shift; };\n"
                       "in vec2 at;\n"
                       "out vec4 colour;\n"
                       "void main() {\n"
                       "    colour = texture(picture, at) * tint + shift + vec4(at, 0.1, 0.5);\n"
                       "}\n");
    h->gl.TransformFeedbackVaryings(h->program, 1, varyings, GL_INTERLEAVED_ATTRIBS);
    h->gl.LinkProgram(h->program);
    h->gl.GetProgramiv(h->program, GL_LINK_STATUS, &linked);
    assert_true(linked);
    h->gl.DeleteShader(vertex);
    h->gl.DeleteShader(fragment);
    gl_objects_add(&h->objects, GL_PROGRAM, h->program);
}

/* Pixels of a bound texture: 4 x 4 of 8 bits, a second level where there are levels. */
static inline void gl_host_fill_texture(gl_host *h, GLenum target)
{
    static const unsigned char bytes[4 * 4 * 4 * 6 * 2] = {1, 200, 30, 99, 5, 6, 177, 8};
    const gl_functions *gl = &h->gl;
    GLenum face;
    GLint level;
    switch (target) {
    case GL_TEXTURE_1D:
        gl->TexImage1D(target, 0, GL_RGBA8, 4, 0, GL_RGBA, GL_UNSIGNED_BYTE, bytes);
        break;
    case GL_TEXTURE_2D:
        if (gl_has(gl, 42, 30))
            gl->TexStorage2D(target, 2, GL_RGBA8, 4, 4);
        for (level = 0; level < 2; level++) {
            GLsizei size = 4 >> level;
            if (!gl_has(gl, 42, 30))
                gl->TexImage2D(target, level, GL_RGBA8, size, size, 0, GL_RGBA, GL_UNSIGNED_BYTE,
                               NULL);
            gl->TexSubImage2D(target, level, 0, 0, size, size, GL_RGBA, GL_UNSIGNED_BYTE, bytes);
        }
        break;
    case GL_TEXTURE_1D_ARRAY:
    case GL_TEXTURE_RECTANGLE:
        gl->TexImage2D(target, 0, GL_RGBA8, 4, 4, 0, GL_RGBA, GL_UNSIGNED_BYTE, bytes);
        break;
    case GL_TEXTURE_CUBE_MAP:
        for (face = 0; face < 6; face++)
            gl->TexImage2D(GL_TEXTURE_CUBE_MAP_POSITIVE_X + face, 0, GL_RGBA8, 4, 4, 0, GL_RGBA,
                           GL_UNSIGNED_BYTE, bytes);
        break;
    case GL_TEXTURE_2D_MULTISAMPLE:
        if (gl->es)
            gl->TexStorage2DMultisample(target, 4, GL_RGBA8, 4, 4, GL_TRUE);
        else
            gl->TexImage2DMultisample(target, 4, GL_RGBA8, 4, 4, GL_TRUE);
        break;
    case GL_TEXTURE_2D_MULTISAMPLE_ARRAY:
        if (gl->es)
            gl->TexStorage3DMultisample(target, 4, GL_RGBA8, 4, 4, 2, GL_TRUE);
        else
            gl->TexImage3DMultisample(target, 4, GL_RGBA8, 4, 4, 2, GL_TRUE);
        break;
    case GL_TEXTURE_BUFFER: gl->TexBuffer(target, GL_RGBA8, h->buffers[2].name); break;
    default:
        if (gl_has(gl, 42, 30))
            gl->TexStorage3D(target, 1, GL_RGBA8, 4, 4,
                             target == GL_TEXTURE_CUBE_MAP_ARRAY ? 6 : 2);
        else
            gl->TexImage3D(target, 0, GL_RGBA8, 4, 4, target == GL_TEXTURE_CUBE_MAP_ARRAY ? 6 : 2,
                           0, GL_RGBA, GL_UNSIGNED_BYTE, bytes);
    }
}

/* Two textures for every target that there is. */
static inline void gl_host_make_textures(gl_host *h)
{
    static const struct {
        GLenum target;
        int gl, es;
    } kinds[] = {{GL_TEXTURE_1D, 30, GL_ABSENT},
                 {GL_TEXTURE_2D, 30, 30},
                 {GL_TEXTURE_3D, 30, 30},
                 {GL_TEXTURE_1D_ARRAY, 30, GL_ABSENT},
                 {GL_TEXTURE_2D_ARRAY, 30, 30},
                 {GL_TEXTURE_RECTANGLE, 31, GL_ABSENT},
                 {GL_TEXTURE_CUBE_MAP, 30, 30},
                 {GL_TEXTURE_CUBE_MAP_ARRAY, 40, 32},
                 {GL_TEXTURE_2D_MULTISAMPLE, 32, 31},
                 {GL_TEXTURE_2D_MULTISAMPLE_ARRAY, 32, 32},
                 {GL_TEXTURE_BUFFER, 31, 32}};
    size_t i;
    for (i = 0; i < 2 * CHECK_COUNT(kinds); i++)
        if (gl_has(&h->gl, kinds[i / 2].gl, kinds[i / 2].es)) {
            gl_object *texture = &h->textures[h->texture_count++];
            texture->kind = kinds[i / 2].target;
            h->gl.GenTextures(1, &texture->name);
            h->gl.BindTexture(texture->kind, texture->name);
            gl_host_fill_texture(h, texture->kind);
            h->gl.BindTexture(texture->kind, 0);
            gl_objects_add(&h->objects, texture->kind, texture->name);
        }
}

/* The first texture of a kind. */
static inline GLuint gl_host_texture(gl_host *h, GLenum kind)
{
    size_t i = 0;
    while (h->textures[i].kind != kind)
        i++;
    return h->textures[i].name;
}

/* The quad, elements, and room for uniforms. */
static inline void gl_host_make_buffers(gl_host *h)
{
    static const GLfloat quad[] = {-0.9f, -0.8f, 0.7f, -0.6f, -0.5f, 0.9f, 0.8f, 0.7f};
    static const GLfloat data[16384] = {0.1f, 0.05f, 0.2f, 0.0f};
    int i;
    for (i = 0; i < 3; i++) {
        h->gl.GenBuffers(1, &h->buffers[i].name);
        h->gl.BindBuffer(GL_ARRAY_BUFFER, h->buffers[i].name);
        h->gl.BufferData(GL_ARRAY_BUFFER, i ? (GLsizeiptr)sizeof data : (GLsizeiptr)sizeof quad,
                         i ? data : quad, GL_DYNAMIC_DRAW);
        h->buffers[i].kind = GL_BUFFER;
        gl_objects_add(&h->objects, GL_BUFFER, h->buffers[i].name);
    }
    h->gl.BindBuffer(GL_ARRAY_BUFFER, 0);
}

static inline void gl_host_make_framebuffers(gl_host *h)
{
    int i;
    for (i = 0; i < 2; i++) {
        h->gl.GenRenderbuffers(1, &h->renderbuffer[i]);
        h->gl.BindRenderbuffer(GL_RENDERBUFFER, h->renderbuffer[i]);
        h->gl.RenderbufferStorage(GL_RENDERBUFFER, i ? GL_DEPTH24_STENCIL8 : GL_RGBA8, GL_HOST_SIZE,
                                  GL_HOST_SIZE);
        gl_objects_add(&h->objects, GL_RENDERBUFFER, h->renderbuffer[i]);
    }
    for (i = 0; i < 2; i++) {
        h->framebuffers[i].kind = GL_FRAMEBUFFER;
        h->gl.GenFramebuffers(1, &h->framebuffers[i].name);
        h->gl.BindFramebuffer(GL_FRAMEBUFFER, h->framebuffers[i].name);
        h->gl.FramebufferRenderbuffer(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_RENDERBUFFER,
                                      h->renderbuffer[0]);
        h->gl.FramebufferRenderbuffer(GL_FRAMEBUFFER, GL_DEPTH_STENCIL_ATTACHMENT, GL_RENDERBUFFER,
                                      h->renderbuffer[1]);
        assert_int_equal(h->gl.CheckFramebufferStatus(GL_FRAMEBUFFER), GL_FRAMEBUFFER_COMPLETE);
        gl_objects_add(&h->objects, GL_FRAMEBUFFER, h->framebuffers[i].name);
    }
    h->gl.BindFramebuffer(GL_FRAMEBUFFER, 0);
}

/* The first array draws the quad. */
static inline void gl_host_make_arrays(gl_host *h)
{
    int i;
    for (i = 0; i < 2; i++) {
        h->arrays[i].kind = GL_VERTEX_ARRAY;
        h->gl.GenVertexArrays(1, &h->arrays[i].name);
        h->gl.BindVertexArray(h->arrays[i].name);
        h->gl.BindBuffer(GL_ARRAY_BUFFER, h->buffers[0].name);
        h->gl.VertexAttribPointer(0, 2, GL_FLOAT, GL_FALSE, 0, NULL);
        h->gl.EnableVertexAttribArray(0);
        gl_objects_add(&h->objects, GL_VERTEX_ARRAY, h->arrays[i].name);
    }
    h->gl.BindVertexArray(0);
    h->gl.BindBuffer(GL_ARRAY_BUFFER, 0);
}

static inline void gl_host_make_others(gl_host *h)
{
    int i;
    for (i = 0; i < 2; i++) {
        h->samplers[i].kind = GL_SAMPLER;
        h->gl.GenSamplers(1, &h->samplers[i].name);
        h->gl.BindSampler(0, h->samplers[i].name);
        gl_objects_add(&h->objects, GL_SAMPLER, h->samplers[i].name);
    }
    h->gl.BindSampler(0, 0);
    h->gl.GenQueries(3, h->query);
    if (gl_has(&h->gl, 40, 30))
        h->gl.GenTransformFeedbacks(2, h->feedback);
    if (gl_has(&h->gl, 41, 31))
        h->gl.GenProgramPipelines(1, &h->pipeline);
}

/* Mesa 22.3 loses the first draw of a context if the scissor test is on, so it is made here. */
static inline void gl_host_draw_first(gl_host *h)
{
    h->gl.BindFramebuffer(GL_FRAMEBUFFER, h->framebuffers[0].name);
    h->gl.UseProgram(h->program);
    h->gl.BindVertexArray(h->arrays[0].name);
    h->gl.BindBufferBase(GL_UNIFORM_BUFFER, 0, h->buffers[1].name);
    h->gl.DrawArrays(GL_TRIANGLE_STRIP, 0, 4);
    h->gl.BindBufferBase(GL_UNIFORM_BUFFER, 0, 0);
    h->gl.BindVertexArray(0);
    h->gl.UseProgram(0);
    h->gl.BindFramebuffer(GL_FRAMEBUFFER, 0);
}

/* In a context whose state is the one that OpenGL begins with. */
static inline void gl_host_open(gl_host *h, void (*(*get)(const char *))(void))
{
    memset(h, 0, sizeof *h);
    gl_load(&h->gl, get);
    gl_host_make_program(h);
    gl_host_make_buffers(h);
    gl_host_make_textures(h);
    gl_host_make_framebuffers(h);
    gl_host_make_arrays(h);
    gl_host_make_others(h);
    gl_host_draw_first(h);
    assert_int_equal(h->gl.GetError(), GL_NO_ERROR);
}

/* ------------------------------------------------- >>random state */

static inline void gl_random_enables(const gl_functions *gl, uint64_t *seed)
{
    size_t n, count;
    const gl_value *v = gl_state_values(&count);
    GLint i, many;
    for (n = 0; n < count; n++) {
        if (!gl_has(gl, v[n].gl, v[n].es) || !strchr("eE+", v[n].how))
            continue;
        many = v[n].many ? gl_get(gl, v[n].many) : 1;
        for (i = 0; i < many; i++) {
            int on = (int)(check_bits(seed) & 1);
            if (v[n].how == 'E')
                (on ? gl->Enablei : gl->Disablei)(v[n].id, (GLuint)i);
            else
                (on ? gl->Enable : gl->Disable)(v[n].id + (GLenum)i);
        }
    }
}

static inline void gl_random_blend(const gl_functions *gl, uint64_t *seed)
{
    static const GLenum factors[] = {GL_ZERO,      GL_ONE,
                                     GL_SRC_COLOR, GL_ONE_MINUS_SRC_COLOR,
                                     GL_DST_COLOR, GL_ONE_MINUS_DST_COLOR,
                                     GL_SRC_ALPHA, GL_ONE_MINUS_SRC_ALPHA,
                                     GL_DST_ALPHA, GL_ONE_MINUS_CONSTANT_ALPHA,
                                     GL_SRC_ALPHA, GL_CONSTANT_COLOR};
    static const GLenum equations[] = {GL_FUNC_ADD, GL_FUNC_SUBTRACT, GL_FUNC_REVERSE_SUBTRACT,
                                       GL_MIN, GL_MAX};
    GLuint i, many = gl_has(gl, 40, 32) ? (GLuint)gl_get(gl, GL_MAX_DRAW_BUFFERS) : 0;
    GLenum f[4], e[2];
    int k;
    gl->BlendColor(check_uniform(seed, 0, 1), check_uniform(seed, 0, 1), check_uniform(seed, 0, 1),
                   check_uniform(seed, 0, 1));
    for (i = 0; i <= many; i++) {
        for (k = 0; k < 4; k++)
            f[k] = GL_PICK(seed, factors);
        e[0] = GL_PICK(seed, equations);
        e[1] = GL_PICK(seed, equations);
        if (many && i < many) {
            gl->BlendFuncSeparatei(i, f[0], f[1], f[2], f[3]);
            gl->BlendEquationSeparatei(i, e[0], e[1]);
        } else if (!many) {
            gl->BlendFuncSeparate(f[0], f[1], f[2], f[3]);
            gl->BlendEquationSeparate(e[0], e[1]);
        }
    }
}

static inline GLboolean gl_random_flag(uint64_t *seed)
{
    return (GLboolean)gl_pick(seed, 2);
}

static inline void gl_random_masks(const gl_functions *gl, uint64_t *seed)
{
    GLuint i, many = gl_has(gl, 30, 32) ? (GLuint)gl_get(gl, GL_MAX_DRAW_BUFFERS) : 1;
    for (i = 0; i < many; i++) {
        GLboolean r = gl_random_flag(seed), g = gl_random_flag(seed), b = gl_random_flag(seed);
        if (many > 1)
            gl->ColorMaski(i, r, g, b, gl_random_flag(seed));
        else
            gl->ColorMask(r, g, b, gl_random_flag(seed));
    }
    gl->DepthMask(gl_random_flag(seed));
    gl->ClearColor(check_uniform(seed, 0, 1), check_uniform(seed, 0, 1), check_uniform(seed, 0, 1),
                   check_uniform(seed, 0, 1));
    if (gl_has(gl, 41, 30))
        gl->ClearDepthf(check_uniform(seed, 0, 1));
    else
        gl->ClearDepth((GLdouble)check_uniform(seed, 0, 1));
    gl->ClearStencil(gl_pick(seed, 256));
    gl->SampleCoverage(check_uniform(seed, 0.5f, 1), gl_random_flag(seed));
    if (gl_has(gl, 32, 31))
        gl->SampleMaski(0, (GLbitfield)check_bits(seed));
    if (gl_has(gl, 40, 32))
        gl->MinSampleShading(check_uniform(seed, 0, 1));
}

static inline void gl_random_tests(const gl_functions *gl, uint64_t *seed)
{
    static const GLenum ops[] = {GL_KEEP, GL_ZERO,   GL_REPLACE,   GL_INCR,
                                 GL_DECR, GL_INVERT, GL_INCR_WRAP, GL_DECR_WRAP};
    static const GLenum faces[] = {GL_FRONT, GL_BACK};
    int i;
    gl->DepthFunc(GL_PICK(seed, gl_compares));
    for (i = 0; i < 2; i++) {
        GLenum a = GL_PICK(seed, ops), b = GL_PICK(seed, ops);
        gl->StencilFuncSeparate(faces[i], GL_PICK(seed, gl_compares), gl_pick(seed, 256),
                                (GLuint)gl_pick(seed, 256));
        gl->StencilOpSeparate(faces[i], a, b, GL_PICK(seed, ops));
        gl->StencilMaskSeparate(faces[i], (GLuint)gl_pick(seed, 256));
    }
    if (gl_has(gl, 41, 30))
        gl->DepthRangef(check_uniform(seed, 0, 0.4f), check_uniform(seed, 0.5f, 1));
    else
        gl->DepthRange((GLdouble)check_uniform(seed, 0, 0.4f),
                       (GLdouble)check_uniform(seed, 0.5f, 1));
}

/* Numbers that a call of OpenGL takes as a coordinate. */
static inline GLint gl_random_place(uint64_t *seed)
{
    return gl_pick(seed, GL_HOST_SIZE / 2);
}

static inline void gl_random_areas(const gl_functions *gl, uint64_t *seed)
{
    GLuint i, many = gl_has(gl, 41, GL_ABSENT) ? (GLuint)gl_get(gl, GL_MAX_VIEWPORTS) : 0;
    gl->Viewport(gl_random_place(seed), gl_random_place(seed), 3 + gl_random_place(seed), 7);
    gl->Scissor(gl_random_place(seed), gl_random_place(seed), 2 + gl_random_place(seed), 5);
    for (i = 1; i < many; i++) {
        gl->ViewportIndexedf(i, check_uniform(seed, 0, 3), check_uniform(seed, 0, 3),
                             check_uniform(seed, 1, 9), check_uniform(seed, 1, 9));
        gl->ScissorIndexed(i, gl_random_place(seed), gl_random_place(seed), 3, 4);
    }
}

static inline void gl_random_shapes(const gl_functions *gl, uint64_t *seed)
{
    static const GLenum culls[] = {GL_FRONT, GL_BACK, GL_FRONT_AND_BACK};
    static const GLenum windings[] = {GL_CW, GL_CCW};
    static const GLenum modes[] = {GL_POINT, GL_LINE, GL_FILL};
    static const GLenum clamps[] = {GL_TRUE, GL_FALSE, GL_FIXED_ONLY};
    gl->CullFace(GL_PICK(seed, culls));
    gl->FrontFace(GL_PICK(seed, windings));
    gl->PolygonOffset(check_uniform(seed, -3, 3), check_uniform(seed, -3, 3));
    gl->LineWidth(check_uniform(seed, 0.25f, 1));
    if (gl->es)
        return;
    gl->PolygonMode(GL_FRONT_AND_BACK, GL_PICK(seed, modes));
    gl->PointSize(check_uniform(seed, 1, 9));
    gl->PointParameterf(GL_POINT_FADE_THRESHOLD_SIZE, check_uniform(seed, 1, 9));
    gl->PointParameteri(GL_POINT_SPRITE_COORD_ORIGIN,
                        gl_pick(seed, 2) ? GL_LOWER_LEFT : GL_UPPER_LEFT);
    gl->ProvokingVertex(gl_pick(seed, 2) ? GL_FIRST_VERTEX_CONVENTION : GL_LAST_VERTEX_CONVENTION);
    gl->LogicOp(GL_CLEAR + (GLenum)gl_pick(seed, 16));
    gl->ClampColor(GL_CLAMP_READ_COLOR, GL_PICK(seed, clamps));
    gl->PrimitiveRestartIndex((GLuint)gl_pick(seed, 99));
    if (gl_has(gl, 45, GL_ABSENT))
        gl->ClipControl(gl_pick(seed, 2) ? GL_LOWER_LEFT : GL_UPPER_LEFT,
                        gl_pick(seed, 2) ? GL_ZERO_TO_ONE : GL_NEGATIVE_ONE_TO_ONE);
}

static inline void gl_random_patches(const gl_functions *gl, uint64_t *seed)
{
    GLfloat levels[4];
    int i;
    for (i = 0; i < 4; i++)
        levels[i] = check_uniform(seed, 1, 9);
    if (gl_has(gl, 40, 32))
        gl->PatchParameteri(GL_PATCH_VERTICES, 1 + gl_pick(seed, 8));
    if (gl_has(gl, 40, GL_ABSENT)) {
        gl->PatchParameterfv(GL_PATCH_DEFAULT_INNER_LEVEL, levels);
        gl->PatchParameterfv(GL_PATCH_DEFAULT_OUTER_LEVEL, levels);
    }
}

static inline void gl_random_hints(const gl_functions *gl, uint64_t *seed)
{
    static const GLenum hints[] = {GL_LINE_SMOOTH_HINT, GL_POLYGON_SMOOTH_HINT,
                                   GL_TEXTURE_COMPRESSION_HINT, GL_FRAGMENT_SHADER_DERIVATIVE_HINT,
                                   GL_GENERATE_MIPMAP_HINT};
    static const GLenum values[] = {GL_FASTEST, GL_NICEST, GL_DONT_CARE};
    size_t i;
    for (i = gl->es ? 3 : 0; i < (gl->es ? 5u : 4u); i++)
        gl->Hint(hints[i], GL_PICK(seed, values));
}

static inline void gl_random_pixels(const gl_functions *gl, uint64_t *seed)
{
    static const GLenum both[] = {
        GL_PACK_ROW_LENGTH,  GL_PACK_SKIP_ROWS,     GL_PACK_SKIP_PIXELS,    GL_UNPACK_ROW_LENGTH,
        GL_UNPACK_SKIP_ROWS, GL_UNPACK_SKIP_PIXELS, GL_UNPACK_IMAGE_HEIGHT, GL_UNPACK_SKIP_IMAGES};
    static const GLenum desktop[] = {GL_PACK_IMAGE_HEIGHT,
                                     GL_PACK_SKIP_IMAGES,
                                     GL_PACK_COMPRESSED_BLOCK_WIDTH,
                                     GL_PACK_COMPRESSED_BLOCK_HEIGHT,
                                     GL_PACK_COMPRESSED_BLOCK_DEPTH,
                                     GL_PACK_COMPRESSED_BLOCK_SIZE,
                                     GL_UNPACK_COMPRESSED_BLOCK_WIDTH,
                                     GL_UNPACK_COMPRESSED_BLOCK_HEIGHT,
                                     GL_UNPACK_COMPRESSED_BLOCK_DEPTH,
                                     GL_UNPACK_COMPRESSED_BLOCK_SIZE};
    size_t i, more = gl->es ? 0 : gl->version >= 42 ? CHECK_COUNT(desktop) : 2;
    for (i = 0; i < CHECK_COUNT(both); i++)
        gl->PixelStorei(both[i], gl_pick(seed, 9));
    for (i = 0; i < more; i++)
        gl->PixelStorei(desktop[i], gl_pick(seed, 9));
    gl->PixelStorei(GL_PACK_ALIGNMENT, 1 << gl_pick(seed, 4));
    gl->PixelStorei(GL_UNPACK_ALIGNMENT, 1 << gl_pick(seed, 4));
    if (gl->es)
        return;
    gl->PixelStorei(GL_PACK_SWAP_BYTES, gl_pick(seed, 2));
    gl->PixelStorei(GL_PACK_LSB_FIRST, gl_pick(seed, 2));
    gl->PixelStorei(GL_UNPACK_SWAP_BYTES, gl_pick(seed, 2));
    gl->PixelStorei(GL_UNPACK_LSB_FIRST, gl_pick(seed, 2));
}

/* What textures and samplers have in common, by the function that sets it. */
static inline void gl_random_filters(void(APIENTRY *set)(GLuint, GLenum, GLint), GLuint of,
                                     int rectangle, uint64_t *seed)
{
    static const GLenum filters[] = {GL_NEAREST, GL_LINEAR, GL_NEAREST_MIPMAP_NEAREST,
                                     GL_LINEAR_MIPMAP_LINEAR};
    static const GLenum wraps[] = {GL_CLAMP_TO_EDGE, GL_REPEAT, GL_MIRRORED_REPEAT};
    static const GLenum names[] = {GL_TEXTURE_WRAP_S, GL_TEXTURE_WRAP_T, GL_TEXTURE_WRAP_R};
    int i;
    set(of, GL_TEXTURE_MIN_FILTER, (GLint)filters[gl_pick(seed, rectangle ? 2 : 4)]);
    set(of, GL_TEXTURE_MAG_FILTER, (GLint)filters[gl_pick(seed, 2)]);
    for (i = 0; i < 3; i++)
        set(of, names[i], (GLint)wraps[gl_pick(seed, rectangle ? 1 : 3)]);
    set(of, GL_TEXTURE_COMPARE_MODE, gl_pick(seed, 2) ? GL_COMPARE_REF_TO_TEXTURE : GL_NONE);
    set(of, GL_TEXTURE_COMPARE_FUNC, (GLint)GL_PICK(seed, gl_compares));
    set(of, GL_TEXTURE_MIN_LOD, -gl_pick(seed, 9));
    set(of, GL_TEXTURE_MAX_LOD, gl_pick(seed, 9));
}

static inline void gl_random_texture(const gl_functions *gl, gl_object o, uint64_t *seed)
{
    static const GLenum swizzles[] = {GL_RED, GL_GREEN, GL_BLUE, GL_ALPHA, GL_ZERO, GL_ONE};
    static const GLenum names[] = {GL_TEXTURE_SWIZZLE_R, GL_TEXTURE_SWIZZLE_G, GL_TEXTURE_SWIZZLE_B,
                                   GL_TEXTURE_SWIZZLE_A};
    int i;
    if (!gl_texture_binding(o.kind))
        return;
    gl->BindTexture(o.kind, o.name);
    gl_random_filters(gl->TexParameteri, o.kind, o.kind == GL_TEXTURE_RECTANGLE, seed);
    for (i = 0; i < 4; i++)
        gl->TexParameteri(o.kind, names[i], (GLint)GL_PICK(seed, swizzles));
    if (o.kind != GL_TEXTURE_RECTANGLE)
        gl->TexParameteri(o.kind, GL_TEXTURE_MAX_LEVEL, 1 + gl_pick(seed, 5));
    if (gl_has(gl, 43, 31))
        gl->TexParameteri(o.kind, GL_DEPTH_STENCIL_TEXTURE_MODE,
                          gl_pick(seed, 2) ? GL_DEPTH_COMPONENT : GL_STENCIL_INDEX);
    if (!gl->es)
        gl->TexParameterf(o.kind, GL_TEXTURE_LOD_BIAS, check_uniform(seed, -1, 1));
    gl->BindTexture(o.kind, 0);
}

/* Also the textures that a test added to the objects. */
static inline void gl_random_objects(gl_host *h, uint64_t *seed)
{
    size_t i;
    for (i = 0; i < h->objects.count; i++) {
        gl_object o = h->objects.object[i];
        if (o.kind == GL_SAMPLER)
            gl_random_filters(h->gl.SamplerParameteri, o.name, 0, seed);
        else
            gl_random_texture(&h->gl, o, seed);
    }
}

static inline void gl_random_units(gl_host *h, uint64_t *seed)
{
    GLint unit, units = gl_get(&h->gl, GL_MAX_COMBINED_TEXTURE_IMAGE_UNITS);
    size_t i;
    for (unit = 0; unit < units; unit++) {
        h->gl.ActiveTexture(GL_TEXTURE0 + (GLenum)unit);
        for (i = 0; i < h->texture_count; i += 2) {
            int which = gl_pick(seed, 3);
            h->gl.BindTexture(h->textures[i].kind,
                              which < 2 ? h->textures[i + (size_t)which].name : 0);
        }
        i = (size_t)gl_pick(seed, 3);
        h->gl.BindSampler((GLuint)unit, i < 2 ? h->samplers[i].name : 0);
    }
    h->gl.ActiveTexture(GL_TEXTURE0 + (GLenum)gl_pick(seed, units));
}

static inline void gl_random_images(gl_host *h, uint64_t *seed)
{
    static const GLenum access[] = {GL_READ_ONLY, GL_WRITE_ONLY, GL_READ_WRITE};
    GLint i, units = gl_has(&h->gl, 42, 31) ? gl_get(&h->gl, GL_MAX_IMAGE_UNITS) : 0;
    GLuint image[3] = {0, 0, 0};
    image[1] = gl_host_texture(h, GL_TEXTURE_2D);
    image[2] = gl_host_texture(h, GL_TEXTURE_2D_ARRAY);
    for (i = 0; i < units; i++)
        h->gl.BindImageTexture((GLuint)i, image[gl_pick(seed, 3)], 0, gl_random_flag(seed),
                               gl_pick(seed, 2), GL_PICK(seed, access), GL_RGBA8);
}

static inline GLuint gl_random_buffer(gl_host *h, uint64_t *seed)
{
    int which = gl_pick(seed, 4);
    return which < 3 ? h->buffers[which].name : 0;
}

/* Ranges of the indexed bindings; offsets are what every driver's alignment divides. */
static inline void gl_random_ranges(gl_host *h, GLenum target, GLenum many, uint64_t *seed)
{
    GLint i, count = gl_get(&h->gl, many);
    for (i = 0; i < count; i++)
        switch (gl_pick(seed, 3)) {
        case 0: h->gl.BindBufferBase(target, (GLuint)i, 0); break;
        case 1: h->gl.BindBufferBase(target, (GLuint)i, gl_random_buffer(h, seed)); break;
        default:
            h->gl.BindBufferRange(target, (GLuint)i, h->buffers[1 + gl_pick(seed, 2)].name,
                                  256 * gl_pick(seed, 9), 16 * (1 + gl_pick(seed, 9)));
        }
}

static inline void gl_random_buffers(gl_host *h, uint64_t *seed)
{
    static const gl_value targets[] = {GL_ROW(ARRAY_BUFFER, 0, 0, 30, 30),
                                       GL_ROW(COPY_READ_BUFFER, 0, 0, 31, 30),
                                       GL_ROW(COPY_WRITE_BUFFER, 0, 0, 31, 30),
                                       GL_ROW(PIXEL_PACK_BUFFER, 0, 0, 30, 30),
                                       GL_ROW(PIXEL_UNPACK_BUFFER, 0, 0, 30, 30),
                                       GL_ROW(UNIFORM_BUFFER, 0, 0, 31, 30),
                                       GL_ROW(TEXTURE_BUFFER, 0, 0, 31, 32),
                                       GL_ROW(TRANSFORM_FEEDBACK_BUFFER, 0, 0, 30, 30),
                                       GL_ROW(DRAW_INDIRECT_BUFFER, 0, 0, 40, 31),
                                       GL_ROW(DISPATCH_INDIRECT_BUFFER, 0, 0, 43, 31),
                                       GL_ROW(SHADER_STORAGE_BUFFER, 0, 0, 43, 31),
                                       GL_ROW(ATOMIC_COUNTER_BUFFER, 0, 0, 42, 31),
                                       GL_ROW(QUERY_BUFFER, 0, 0, 44, GL_ABSENT),
                                       GL_ROW(PARAMETER_BUFFER, 0, 0, 46, GL_ABSENT)};
    size_t i;
    gl_random_ranges(h, GL_UNIFORM_BUFFER, GL_MAX_UNIFORM_BUFFER_BINDINGS, seed);
    gl_random_ranges(h, GL_TRANSFORM_FEEDBACK_BUFFER, GL_MAX_TRANSFORM_FEEDBACK_SEPARATE_ATTRIBS,
                     seed);
    if (gl_has(&h->gl, 43, 31))
        gl_random_ranges(h, GL_SHADER_STORAGE_BUFFER, GL_MAX_SHADER_STORAGE_BUFFER_BINDINGS, seed);
    if (gl_has(&h->gl, 42, 31))
        gl_random_ranges(h, GL_ATOMIC_COUNTER_BUFFER, GL_MAX_ATOMIC_COUNTER_BUFFER_BINDINGS, seed);
    for (i = 0; i < CHECK_COUNT(targets); i++)
        if (gl_has(&h->gl, targets[i].gl, targets[i].es))
            h->gl.BindBuffer(targets[i].id, gl_random_buffer(h, seed));
}

/* All attributes but the first, which draws the quad. */
static inline void gl_random_attributes(gl_host *h, uint64_t *seed)
{
    GLint i, many = gl_get(&h->gl, GL_MAX_VERTEX_ATTRIBS);
    for (i = 1; i < many; i++) {
        GLuint index = (GLuint)i;
        const void *offset = (const void *)(uintptr_t)(4 * gl_pick(seed, 9));
        h->gl.BindBuffer(GL_ARRAY_BUFFER, h->buffers[1].name);
        if (gl_pick(seed, 2))
            h->gl.VertexAttribPointer(index, 1 + gl_pick(seed, 4), GL_SHORT, gl_random_flag(seed),
                                      4 * (1 + gl_pick(seed, 9)), offset);
        else
            h->gl.VertexAttribIPointer(index, 1 + gl_pick(seed, 4), GL_INT, 16, offset);
        h->gl.VertexAttribDivisor(index, (GLuint)gl_pick(seed, 3));
        if (gl_has(&h->gl, 43, 31) && gl_pick(seed, 2)) {
            h->gl.VertexAttribFormat(index, 2, GL_SHORT, GL_FALSE, (GLuint)gl_pick(seed, 99));
            h->gl.VertexAttribBinding(index, (GLuint)(1 + gl_pick(seed, many - 1)));
        }
        (gl_pick(seed, 2) ? h->gl.EnableVertexAttribArray : h->gl.DisableVertexAttribArray)(index);
        h->gl.VertexAttrib4f(index, check_uniform(seed, 0, 1), 2, check_uniform(seed, 0, 1), 4);
    }
}

static inline void gl_random_arrays(gl_host *h, uint64_t *seed)
{
    int i;
    for (i = 0; i < 2; i++) {
        h->gl.BindVertexArray(h->arrays[i].name);
        gl_random_attributes(h, seed);
        h->gl.BindBuffer(GL_ELEMENT_ARRAY_BUFFER, gl_random_buffer(h, seed));
    }
    i = gl_pick(seed, 3);
    h->gl.BindVertexArray(i < 2 ? h->arrays[i].name : 0);
}

static inline void gl_random_framebuffers(gl_host *h, uint64_t *seed)
{
    static const GLenum choices[] = {GL_NONE, GL_COLOR_ATTACHMENT0};
    GLenum buffers[2];
    int i;
    for (i = 0; i < 2; i++) {
        h->gl.BindFramebuffer(GL_FRAMEBUFFER, h->framebuffers[i].name);
        buffers[0] = GL_PICK(seed, choices);
        buffers[1] = GL_NONE;
        h->gl.DrawBuffers(2, buffers);
        h->gl.ReadBuffer(GL_PICK(seed, choices));
    }
    i = gl_pick(seed, 3);
    h->gl.BindFramebuffer(GL_DRAW_FRAMEBUFFER, i < 2 ? h->framebuffers[i].name : 0);
    i = gl_pick(seed, 3);
    h->gl.BindFramebuffer(GL_READ_FRAMEBUFFER, i < 2 ? h->framebuffers[i].name : 0);
    i = gl_pick(seed, 3);
    h->gl.BindRenderbuffer(GL_RENDERBUFFER, i < 2 ? h->renderbuffer[i] : 0);
}

static inline void gl_random_program(gl_host *h, uint64_t *seed)
{
    h->gl.UseProgram(h->program);
    h->gl.Uniform4f(h->gl.GetUniformLocation(h->program, "tint"), check_uniform(seed, 0, 1),
                    check_uniform(seed, 0, 1), check_uniform(seed, 0, 1), 0.5f);
    h->gl.Uniform1i(h->gl.GetUniformLocation(h->program, "picture"), gl_pick(seed, 16));
    h->gl.UniformBlockBinding(h->program, h->gl.GetUniformBlockIndex(h->program, "Shift"),
                              (GLuint)gl_pick(seed, 9));
    if (gl_pick(seed, 2))
        h->gl.UseProgram(0);
    if (h->pipeline)
        h->gl.BindProgramPipeline(gl_pick(seed, 2) ? h->pipeline : 0);
}

/* Ends what runs: queries and transform feedback. Without it no context must be closed: Mesa 22.3
   writes the results of queries that it has freed. */
static inline void gl_host_rest(gl_host *h)
{
    static const GLenum targets[] = {GL_ANY_SAMPLES_PASSED,
                                     GL_TRANSFORM_FEEDBACK_PRIMITIVES_WRITTEN, GL_TIME_ELAPSED};
    int i;
    for (i = 0; i < 3; i++)
        if (h->running[i])
            h->gl.EndQuery(targets[i]);
    memset(h->running, 0, sizeof h->running);
    if (h->feeding) {
        h->gl.BindTransformFeedback(GL_TRANSFORM_FEEDBACK, h->feedback[0]);
        h->gl.EndTransformFeedback();
        h->feeding = 0;
    }
    if (h->feedback[0])
        h->gl.BindTransformFeedback(GL_TRANSFORM_FEEDBACK, 0);
    h->gl.Finish();
}

static inline void gl_random_queries(gl_host *h, uint64_t *seed)
{
    static const GLenum targets[] = {GL_ANY_SAMPLES_PASSED,
                                     GL_TRANSFORM_FEEDBACK_PRIMITIVES_WRITTEN, GL_TIME_ELAPSED};
    int i;
    for (i = 0; i < (h->gl.es ? 2 : 3); i++)
        if ((h->running[i] = gl_pick(seed, 2)) != 0)
            h->gl.BeginQuery(targets[i], h->query[i]);
}

/* A transform feedback that was begun and is paused, as a host has it between its own draws. */
static inline void gl_random_feedback(gl_host *h, uint64_t *seed)
{
    int i;
    if (!h->feedback[0])
        return;
    h->gl.BindTransformFeedback(GL_TRANSFORM_FEEDBACK, h->feedback[0]);
    h->gl.BindBufferRange(GL_TRANSFORM_FEEDBACK_BUFFER, 0, h->buffers[2].name, 4096, 1024);
    if ((h->feeding = gl_pick(seed, 2)) != 0) {
        GLint before = gl_get(&h->gl, GL_CURRENT_PROGRAM);
        h->gl.UseProgram(h->program);
        h->gl.BeginTransformFeedback(GL_TRIANGLES);
        h->gl.PauseTransformFeedback();
        h->gl.UseProgram((GLuint)before);
    }
    i = h->feeding ? 2 : gl_pick(seed, 3);
    if (i < 2)
        h->gl.BindTransformFeedback(GL_TRANSFORM_FEEDBACK, i ? h->feedback[1] : 0);
}

/* Every setting is something odd, and the same for one seed. */
static inline void gl_state_randomize(gl_host *h, uint64_t seed)
{
    const gl_functions *gl = &h->gl;
    gl_host_rest(h);
    gl_random_enables(gl, &seed);
    gl_random_blend(gl, &seed);
    gl_random_masks(gl, &seed);
    gl_random_tests(gl, &seed);
    gl_random_areas(gl, &seed);
    gl_random_shapes(gl, &seed);
    gl_random_patches(gl, &seed);
    gl_random_hints(gl, &seed);
    gl_random_pixels(gl, &seed);
    gl_random_objects(h, &seed);
    gl_random_units(h, &seed);
    gl_random_images(h, &seed);
    gl_random_buffers(h, &seed);
    gl_random_arrays(h, &seed);
    gl_random_framebuffers(h, &seed);
    gl_random_program(h, &seed);
    gl_random_feedback(h, &seed);
    gl_random_queries(h, &seed);
}

static inline void gl_host_close(gl_host *h)
{
    int i;
    gl_host_rest(h);
    h->gl.UseProgram(0);
    h->gl.DeleteProgram(h->program);
    for (i = 0; i < (int)h->texture_count; i++)
        h->gl.DeleteTextures(1, &h->textures[i].name);
    for (i = 0; i < 3; i++)
        h->gl.DeleteBuffers(1, &h->buffers[i].name);
    for (i = 0; i < 2; i++) {
        h->gl.DeleteSamplers(1, &h->samplers[i].name);
        h->gl.DeleteVertexArrays(1, &h->arrays[i].name);
        h->gl.DeleteFramebuffers(1, &h->framebuffers[i].name);
    }
    h->gl.DeleteRenderbuffers(2, h->renderbuffer);
    h->gl.DeleteQueries(3, h->query);
    if (h->feedback[0])
        h->gl.DeleteTransformFeedbacks(2, h->feedback);
    if (h->pipeline)
        h->gl.DeleteProgramPipelines(1, &h->pipeline);
}

/* ------------------------------------------------------- >>picture */

/* Leaves the state random, but such that the quad is seen. */
static inline void gl_host_make_visible(gl_host *h)
{
    static const GLenum off[] = {
        GL_RASTERIZER_DISCARD,       GL_CULL_FACE,      GL_DEPTH_TEST, GL_STENCIL_TEST,
        GL_SAMPLE_ALPHA_TO_COVERAGE, GL_SAMPLE_COVERAGE};
    const gl_functions *gl = &h->gl;
    GLenum buffer = GL_COLOR_ATTACHMENT0;
    size_t i;
    for (i = 0; i < CHECK_COUNT(off); i++)
        gl->Disable(off[i]);
    if (!gl->es)
        gl->Disable(GL_COLOR_LOGIC_OP);
    if (gl_has(gl, 32, 31))
        gl->Disable(GL_SAMPLE_MASK);
    gl->ColorMask(GL_TRUE, GL_TRUE, GL_TRUE, GL_TRUE);
    gl->Viewport(1, 2, GL_HOST_SIZE - 3, GL_HOST_SIZE - 4);
    gl->Scissor(3, 1, GL_HOST_SIZE - 4, GL_HOST_SIZE - 5);
    gl->UseProgram(h->program);
    gl->BindVertexArray(h->arrays[0].name);
    gl->BindFramebuffer(GL_FRAMEBUFFER, h->framebuffers[0].name);
    gl->DrawBuffers(1, &buffer);
    gl->ReadBuffer(buffer);
    gl->BindBufferRange(GL_UNIFORM_BUFFER, 8, h->buffers[1].name, 0, 16);
    gl->UniformBlockBinding(h->program, gl->GetUniformBlockIndex(h->program, "Shift"), 8);
    for (i = 0; i < 8; i++)
        if (!gl->es)
            gl->Disable(GL_CLIP_DISTANCE0 + (GLenum)i);
}

typedef struct gl_picture {
    unsigned char pixel[4 * GL_HOST_SIZE * GL_HOST_SIZE];
} gl_picture;

/* Reads a framebuffer, whatever the state is, and leaves the state as it was. */
static inline void gl_host_read(gl_host *h, GLuint framebuffer, gl_picture *picture)
{
    static const GLenum names[] = {GL_PACK_ALIGNMENT,   GL_PACK_ROW_LENGTH, GL_PACK_SKIP_ROWS,
                                   GL_PACK_SKIP_PIXELS, GL_PACK_SWAP_BYTES, GL_PACK_LSB_FIRST};
    const gl_functions *gl = &h->gl;
    GLint before[6], buffer = gl_get(gl, GL_PIXEL_PACK_BUFFER_BINDING);
    GLint read = gl_get(gl, GL_READ_FRAMEBUFFER_BINDING);
    int i, count = gl->es ? 4 : 6;
    for (i = 0; i < count; i++) {
        before[i] = gl_get(gl, names[i]);
        gl->PixelStorei(names[i], i ? 0 : 1);
    }
    gl->BindBuffer(GL_PIXEL_PACK_BUFFER, 0);
    gl->BindFramebuffer(GL_READ_FRAMEBUFFER, framebuffer);
    gl->ReadPixels(0, 0, GL_HOST_SIZE, GL_HOST_SIZE, GL_RGBA, GL_UNSIGNED_BYTE, picture->pixel);
    gl->BindFramebuffer(GL_READ_FRAMEBUFFER, (GLuint)read);
    gl->BindBuffer(GL_PIXEL_PACK_BUFFER, (GLuint)buffer);
    for (i = 0; i < count; i++)
        gl->PixelStorei(names[i], before[i]);
}

/* Clears and draws with the state as it is; sets nothing. */
static inline void gl_host_draw(gl_host *h, gl_picture *picture)
{
    h->gl.Clear(GL_COLOR_BUFFER_BIT | GL_DEPTH_BUFFER_BIT | GL_STENCIL_BUFFER_BIT);
    h->gl.DrawArrays(GL_TRIANGLE_STRIP, 0, 4);
    gl_host_read(h, h->framebuffers[0].name, picture);
}

#endif /* GL_HOST_H */
