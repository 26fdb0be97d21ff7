/* gl_fog.h - a small fog in a host: random media and lights, shadow maps and a depth buffer with
   awkward settings, a target; every call of scatter_gl.h by number. Include it after gl_rig.h. */
#ifndef GL_FOG_H
#define GL_FOG_H

typedef struct gl_fog {
    scatter_gl *fog;
    check_host books;
    scatter_gl_desc desc;
    check_world world;
    scatter_gl_light lights[6];
    scatter_gl_view view;
    scatter_quality quality;
    GLuint target, color, depth, shadow[3]; /* framebuffer, its texture; depth; 2D, array, cube */
    GLuint bright;                          /* a picture of floats */
    GLfloat camera[16], projection[16];
} gl_fog;

/* ---------------------------------------------------------- >>host */

static inline GLuint gl_fog_texture(gl_rig *rig, GLenum kind, GLint format, GLenum of, int size,
                                    const GLfloat *pixels)
{
    const gl_functions *gl = &rig->host.gl;
    GLuint name;
    GLenum face;
    gl->GenTextures(1, &name);
    gl->BindTexture(kind, name);
    if (kind == GL_TEXTURE_2D_ARRAY)
        gl->TexImage3D(kind, 0, format, size, size, 2, 0, of, GL_FLOAT, pixels);
    else if (kind == GL_TEXTURE_2D)
        gl->TexImage2D(kind, 0, format, size, size, 0, of, GL_FLOAT, pixels);
    else
        for (face = 0; face < 6; face++)
            gl->TexImage2D(GL_TEXTURE_CUBE_MAP_POSITIVE_X + face, 0, format, size, size, 0, of,
                           GL_FLOAT, pixels);
    gl->BindTexture(kind, 0);
    gl_objects_add(&rig->host.objects, kind, name);
    return name;
}

/* Pixels of a random depth buffer, some at the clear value, and some not numbers if `nan`. */
static inline const GLfloat *gl_fog_depths(int nan)
{
    static GLfloat pixel[4 * GL_HOST_SIZE * GL_HOST_SIZE];
    uint64_t seed = 5;
    size_t i;
    for (i = 0; i < CHECK_COUNT(pixel); i++) {
        int what = gl_pick(&seed, 4);
        pixel[i] = what == 0 ? 1.0f : check_uniform(&seed, 0.5f, 1);
        if (nan && what == 1)
            pixel[i] = (float)NAN;
    }
    return pixel;
}

/* What the target holds before the fog comes; the state must be the one that OpenGL begins with. */
static inline void gl_fog_fill_target(gl_rig *rig, gl_fog *f)
{
    unsigned char bytes[4 * GL_HOST_SIZE * GL_HOST_SIZE];
    size_t i;
    for (i = 0; i < sizeof bytes; i++)
        bytes[i] = (unsigned char)(i % 97);
    rig->host.gl.BindTexture(GL_TEXTURE_2D, f->color);
    rig->host.gl.TexSubImage2D(GL_TEXTURE_2D, 0, 0, 0, GL_HOST_SIZE, GL_HOST_SIZE, GL_RGBA,
                               GL_UNSIGNED_BYTE, bytes);
    rig->host.gl.BindTexture(GL_TEXTURE_2D, 0);
}

static inline void gl_fog_make_target(gl_rig *rig, gl_fog *f)
{
    const gl_functions *gl = &rig->host.gl;
    gl->GenTextures(1, &f->color);
    gl->BindTexture(GL_TEXTURE_2D, f->color);
    gl->TexImage2D(GL_TEXTURE_2D, 0, GL_RGBA8, GL_HOST_SIZE, GL_HOST_SIZE, 0, GL_RGBA,
                   GL_UNSIGNED_BYTE, NULL);
    gl->BindTexture(GL_TEXTURE_2D, 0);
    gl->GenFramebuffers(1, &f->target);
    gl->BindFramebuffer(GL_FRAMEBUFFER, f->target);
    gl->FramebufferTexture2D(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_TEXTURE_2D, f->color, 0);
    gl->BindFramebuffer(GL_FRAMEBUFFER, 0);
    gl_objects_add(&rig->host.objects, GL_FRAMEBUFFER, f->target);
    gl_fog_fill_target(rig, f);
}

/* Random settings come to depth and shadow maps as to all textures, but no swizzle and no stencil:
   that would be another map. The active unit gets its bindings back. */
static inline void gl_fog_plain_maps(gl_rig *rig, gl_fog *f)
{
    static const GLenum kinds[] = {GL_TEXTURE_2D, GL_TEXTURE_2D_ARRAY, GL_TEXTURE_CUBE_MAP,
                                   GL_TEXTURE_2D};
    const gl_functions *gl = &rig->host.gl;
    int i;
    for (i = 0; i < 4; i++) {
        GLint before = gl_get(gl, gl_texture_binding(kinds[i]));
        gl->BindTexture(kinds[i], i < 3 ? f->shadow[i] : f->depth);
        gl->TexParameteri(kinds[i], GL_TEXTURE_SWIZZLE_R, GL_RED);
        if (gl_has(gl, 43, 31))
            gl->TexParameteri(kinds[i], GL_DEPTH_STENCIL_TEXTURE_MODE, GL_DEPTH_COMPONENT);
        gl->BindTexture(kinds[i], (GLuint)before);
    }
}

/* --------------------------------------------------------- >>scene */

/* Perspective along -z from (0, 0, 3), 0.5 to 20 m. */
static inline void gl_fog_look(gl_fog *f)
{
    static const GLfloat camera[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, -3, 1};
    const GLfloat near = 0.5f, far = 20;
    memcpy(f->camera, camera, sizeof camera);
    memset(f->projection, 0, sizeof f->projection);
    f->projection[0] = f->projection[5] = 1.5f;
    f->projection[10] = (far + near) / (near - far);
    f->projection[11] = -1;
    f->projection[14] = 2 * far * near / (near - far);
    f->view.view = f->camera;
    f->view.projection = f->projection;
    f->view.framebuffer = f->target;
    f->view.depth_texture = f->depth;
    f->view.width = f->view.height = GL_HOST_SIZE;
}

static inline void gl_fog_light(gl_fog *f, int i, uint64_t *seed)
{
    static const scatter_light_kind kinds[] = {SCATTER_LIGHT_SPOT, SCATTER_LIGHT_DIRECTIONAL,
                                               SCATTER_LIGHT_POINT};
    scatter_gl_light *l = &f->lights[i];
    int k, map = i % 3;
    memset(l, 0, sizeof *l);
    l->light.kind = kinds[map];
    l->light.position = check_point(seed, -2, 2);
    l->light.direction = check_direction(seed);
    l->light.intensity = check_point(seed, 0, 3);
    l->light.radius = 0.05f;
    l->light.inner = 0.4f;
    l->light.outer = 0.8f;
    if (gl_pick(seed, 2)) {
        l->shadow.kind = (scatter_gl_shadow_kind)((int)SCATTER_GL_SHADOW_2D + map);
        l->shadow.texture = f->shadow[map];
        l->shadow.cascades = 1 + map % 2;
        l->shadow.bias = 0.01f;
        l->shadow.z_near = 0.1f;
        l->shadow.z_far = 9;
        for (k = 0; k < 32; k++)
            l->shadow.matrix[k / 16][k % 16] = k % 5 == 0 ? 0.5f : 0.1f;
    }
}

/* Media of every kind, up to six lights, qualities of every kind that the GPU knows. */
static inline void gl_fog_random(gl_fog *f, uint64_t seed)
{
    static const scatter_depth_method depths[] = {SCATTER_DEPTH_AUTO, SCATTER_DEPTH_CLOSED,
                                                  SCATTER_DEPTH_CLOSED_VOLUME, SCATTER_DEPTH_UPWIND,
                                                  SCATTER_DEPTH_POLAR}; /* grids: the last two */
    int i;
    check_world_open(&f->world);
    check_add_gaussians(&f->world, (size_t)gl_pick(&seed, 9), 1, 4, seed);
    if (gl_pick(&seed, 2))
        check_add_height(&f->world, 0.2f, -1, 1);
    if (gl_pick(&seed, 2))
        check_add_grid(&f->world, 5, 4, 3, check_cube(-1, 1), seed);
    f->world.scene.medium.constant = gl_pick(&seed, 2) ? 0.05f : 0.0f;
    for (i = 0; i < 6; i++)
        gl_fog_light(f, i, &seed);
    memset(&f->quality, 0, sizeof f->quality);
    i = f->world.scene.medium.grid_count ? 3 : 0;
    f->quality.depth = depths[i + gl_pick(&seed, 5 - i)];
    f->quality.density = (scatter_density_method)gl_pick(&seed, 3);
    f->quality.ray = (scatter_ray_method)gl_pick(&seed, 2);
    f->quality.grid = 6 + gl_pick(&seed, 3);
    f->quality.nodes = 4;
}

/* One grid through which rays go to the lights and jump. */
static inline void gl_fog_skip(gl_fog *f)
{
    f->world.scene.medium.grid_count = 0;
    check_add_grid(&f->world, 5, 4, 3, check_cube(-1, 1), 3);
    f->quality.depth = SCATTER_DEPTH_CLOSED;
    f->quality.density = SCATTER_DENSITY_EXACT;
    f->quality.ray = SCATTER_RAY_MARCH;
}

/* --------------------------------------------------------- >>calls */

static inline int gl_fog_light_count(const gl_fog *f)
{
    return f->quality.grid % 7;
}

static inline scatter_result gl_fog_froxels(gl_fog *f)
{
    scatter_gl_froxels froxels = {6, 5, 4, 0.5f, 20};
    return scatter_gl_fill_froxels(f->fog, &f->view, &froxels);
}

/* Of most of the bright picture. */
static inline scatter_gl_tone gl_fog_tone(const gl_fog *f)
{
    scatter_gl_tone tone;
    memset(&tone, 0, sizeof tone);
    tone.source = f->bright;
    tone.source_x = tone.y = 1;
    tone.framebuffer = f->target;
    tone.width = tone.height = GL_HOST_SIZE - 2;
    return tone;
}

/* The calls that change nothing of the host's. */
static const char *const gl_fog_calls[] = {
    "scatter_gl_create",    "scatter_gl_set_medium",   "scatter_gl_set_lights",
    "scatter_gl_warm_up",   "scatter_gl_update",       "scatter_gl_update with an eye",
    "scatter_gl_draw",      "scatter_gl_resize",       "scatter_gl_draw, half resolution",
    "scatter_gl_draw, T",   "scatter_gl_fill_froxels", "scatter_gl_surface_glsl",
    "scatter_gl_get_times", "scatter_gl_tone_map",     "scatter_gl_destroy"};

static inline scatter_result gl_fog_draw(gl_fog *f, int divide, scatter_gl_show show)
{
    scatter_gl_view view = f->view;
    view.divide = divide;
    view.show = show;
    return scatter_gl_draw(f->fog, &view);
}

static inline scatter_result gl_fog_call(gl_fog *f, size_t which)
{
    const scatter_gl_tone tone = gl_fog_tone(f);
    scatter_vec3 eye = {0, 0, 3};
    switch (which) {
    case 0: return scatter_gl_create(&f->desc, &f->fog);
    case 1: return scatter_gl_set_medium(f->fog, &f->world.scene.medium);
    case 2: return scatter_gl_set_lights(f->fog, f->lights, (size_t)gl_fog_light_count(f));
    case 3: return scatter_gl_warm_up(f->fog, &f->quality, &f->view);
    case 4: return scatter_gl_update(f->fog, &f->quality, NULL);
    case 5: return scatter_gl_update(f->fog, &f->quality, &eye);
    case 6: return gl_fog_draw(f, 1, SCATTER_GL_SHOW_FOG);
    case 7: return scatter_gl_resize(f->fog, 40, 30);
    case 8: return gl_fog_draw(f, 2, SCATTER_GL_SHOW_FOG);
    case 9: return gl_fog_draw(f, 0, SCATTER_GL_SHOW_TRANSMITTANCE);
    case 10: return gl_fog_froxels(f);
    case 11: return scatter_gl_surface_glsl(f->fog) ? SCATTER_OK : SCATTER_OUT_OF_MEMORY;
    case 12: scatter_gl_get_times(f->fog); return SCATTER_OK;
    case 13: return scatter_gl_tone_map(f->fog, &tone);
    default: scatter_gl_destroy(f->fog); f->fog = NULL;
    }
    return SCATTER_OK;
}

/* The state must be the one that OpenGL begins with. */
static inline void gl_fog_open(gl_rig *rig, gl_fog *f)
{
    static const GLenum kinds[] = {GL_TEXTURE_2D, GL_TEXTURE_2D_ARRAY, GL_TEXTURE_CUBE_MAP};
    int i;
    memset(f, 0, sizeof *f);
    f->desc.host = check_host_open(&f->books, 0);
    f->desc.get_proc_address = rig->context.get_proc_address;
    f->desc.max_lights = 6;
    f->desc.max_gaussians = 64;
    gl_fog_make_target(rig, f);
    f->depth = gl_fog_texture(rig, GL_TEXTURE_2D, GL_DEPTH_COMPONENT32F, GL_DEPTH_COMPONENT,
                              GL_HOST_SIZE, gl_fog_depths(0));
    for (i = 0; i < 3; i++)
        f->shadow[i] = gl_fog_texture(rig, kinds[i], GL_DEPTH_COMPONENT32F, GL_DEPTH_COMPONENT, 8,
                                      gl_fog_depths(0));
    f->bright = gl_fog_texture(rig, GL_TEXTURE_2D, GL_RGBA32F, GL_RGBA, GL_HOST_SIZE,
                               gl_fog_depths(0));
    gl_fog_look(f);
    gl_fog_random(f, 1);
    assert_int_equal(rig->host.gl.GetError(), GL_NO_ERROR);
}

/* Create, set, update, draw: a fog that works. */
static inline scatter_result gl_fog_start(gl_fog *f)
{
    static const size_t calls[] = {0, 1, 2, 4, 6};
    scatter_result result = SCATTER_OK;
    size_t i;
    for (i = 0; i < CHECK_COUNT(calls) && result == SCATTER_OK; i++)
        result = gl_fog_call(f, calls[i]);
    return result;
}

#endif /* GL_FOG_H */
