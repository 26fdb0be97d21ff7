/* render_gl.h - a scene file through scatter_gl.h, as a program with a renderer of its own would do
   it, without a window. MIT licence, see LICENSE.

       render_gl r;
       if (render_gl_open(&r, &file, 640, 480, &quality, &options) ||
           render_gl_create(&r, &host) || render_gl_update(&r) ||
           render_gl_scene(&r) || render_gl_fog(&r) || host_gl_read(&r.scene, &picture))
           puts(render_gl_why(&r));
       render_gl_close(&r);

   Each call returns 0, or 1 with a sentence in `error` or in the log of the scatter_host, and
   returns when the GPU is done. */
#ifndef SCATTER_EXAMPLES_RENDER_GL_H
#define SCATTER_EXAMPLES_RENDER_GL_H

#include "gl_context.h"
#include "host_gl.h"

/* Zero is the default. */
typedef struct render_gl_options {
    const char *api; /* gl33, gl45, es30, osmesa; NULL: gl33 */
    int shadow_map;  /* see host_gl_options */
    int divide;      /* see scatter_gl_view */
} render_gl_options;

typedef struct render_gl {
    gl_context context;
    host_gl scene;
    scatter_gl *fog;
    scatter_quality quality;
    const scatter_medium *medium;
    scatter_gl_times passes; /* GPU time of the last call of each */
} render_gl;

/* The sentence of what went wrong outside of the library; empty: it is in the library's log. */
static inline const char *render_gl_why(const render_gl *r)
{
    return r->context.error[0] ? r->context.error : r->scene.error;
}

static inline int render_gl_failed(scatter_result result)
{
    return result != SCATTER_OK;
}

static inline void render_gl_finish(render_gl *r)
{
    r->scene.gl.Finish();
    r->passes = scatter_gl_get_times(r->fog);
}

/* A medium that the fog has to work for: density and light depths as after the first call. */
static inline int render_gl_update(render_gl *r)
{
    int failed = render_gl_failed(scatter_gl_set_medium(r->fog, r->medium)) ||
                 render_gl_failed(scatter_gl_update(r->fog, &r->quality, NULL));
    render_gl_finish(r);
    return failed;
}

/* Takes the medium away, so that the next update has everything to do again. */
static inline int render_gl_forget(render_gl *r)
{
    scatter_medium none;
    memset(&none, 0, sizeof none);
    int failed = render_gl_failed(scatter_gl_set_medium(r->fog, &none)) ||
                 render_gl_failed(scatter_gl_update(r->fog, &r->quality, NULL));
    render_gl_finish(r);
    return failed;
}

/* The surfaces, lit through the fog that they will be seen through. */
static inline int render_gl_scene(render_gl *r)
{
    if (render_gl_failed(scatter_gl_bind_surface(r->fog, r->scene.program, 1, 0)))
        return 1;
    host_gl_draw(&r->scene);
    r->scene.gl.Finish();
    return 0;
}

static inline int render_gl_fog(render_gl *r)
{
    int failed = render_gl_failed(scatter_gl_draw(r->fog, &r->scene.fog_view));
    render_gl_finish(r);
    return failed;
}

/* The context, the surfaces and their shadow maps. To close afterwards in any case. The file stays
   with the caller; the struct must not be moved. */
static inline int render_gl_open(render_gl *r, const scene_file *file, int width, int height,
                                 const scatter_quality *quality, const render_gl_options *options)
{
    host_gl_options scene = {options->shadow_map, NULL};
    memset(r, 0, sizeof *r);
    r->quality = *quality;
    r->medium = &file->scene.medium;
    if (!gl_context_open(&r->context, options->api ? options->api : "gl33", NULL) ||
        host_gl_open(&r->scene, r->context.get_proc_address, file, width, height, &scene))
        return 1;
    r->scene.fog_view.divide = options->divide;
    return 0;
}

/* The fog, ready to update. */
static inline int render_gl_create(render_gl *r, const scatter_host *host)
{
    size_t lights = r->scene.file->scene.light_count, gaussians = r->medium->gaussian_count;
    scatter_gl_desc desc;
    memset(&desc, 0, sizeof desc);
    desc.host = *host;
    desc.get_proc_address = r->context.get_proc_address;
    desc.max_lights = lights > 0 ? (int)lights : 1;
    desc.max_gaussians = gaussians > 0 ? (int)gaussians : 1;
    desc.timers = 1;
    return render_gl_failed(scatter_gl_create(&desc, &r->fog)) ||
           render_gl_failed(scatter_gl_set_lights(r->fog, r->scene.lights, lights)) ||
           render_gl_failed(scatter_gl_set_medium(r->fog, r->medium)) ||
           render_gl_failed(scatter_gl_warm_up(r->fog, &r->quality, &r->scene.fog_view)) ||
           host_gl_surface(&r->scene, scatter_gl_surface_glsl(r->fog));
}

static inline void render_gl_close(render_gl *r)
{
    scatter_gl_destroy(r->fog);
    host_gl_close(&r->scene);
    if (r->context.handle)
        gl_context_close(&r->context);
}

#endif
