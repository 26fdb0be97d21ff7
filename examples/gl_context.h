/* gl_context.h - OpenGL contexts without a window, for the programs and tests of scatter_gl.h.

       gl_context c;
       if (!gl_context_open(&c, "gl33", NULL))
           puts(c.error);
       c.get_proc_address("glClear") ...
       gl_context_close(&c);

   By name: gl33, gl45 (EGL, OpenGL 3.3 and 4.5 core), es30 (EGL, OpenGL ES 3.0), osmesa (OSMesa,
   OpenGL 3.3 core). A driver may give a later version than the one asked for.

   The libraries are loaded while the program runs: nothing of OpenGL is needed to build, and the
   functions of two libraries in one program stay apart. They remain loaded until it ends, as does
   the connection to the driver. One thread. Prints nothing; what went wrong is a sentence in
   `error`. */
#ifndef GL_CONTEXT_H
#define GL_CONTEXT_H

#include <dlfcn.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define GL_CONTEXT_SIZE 64 /* pixels of the default framebuffer, to a side */

typedef void (*gl_context_proc)(void);

typedef struct gl_context {
    gl_context_proc (*get_proc_address)(const char *name);
    char error[256];
    int es, major, minor;
    void *handle;  /* of the context */
    void *display; /* EGL; NULL: OSMesa */
    void *surface; /* EGL: a pbuffer; OSMesa: the pixels; NULL: no default framebuffer */
} gl_context;

/* A function of a library as the pointer that `function` points to. */
static inline int gl_context_find(void *library, const char *name, void *function)
{
    void *address = library ? dlsym(library, name) : NULL;
    memcpy(function, &address, sizeof address);
    return address != NULL;
}

static inline int gl_context_fail(gl_context *c, const char *what, const char *why)
{
    snprintf(c->error, sizeof c->error, "%s: %s", what, why);
    return 0;
}

/* ----------------------------------------------------------- >>egl */

/* Names and values are those of EGL's own headers. */
typedef struct gl_context_egl {
    void *library;
    gl_context_proc (*GetProcAddress)(const char *name);
    void *(*GetDisplay)(void *native);
    const char *(*QueryString)(void *display, int32_t name);
    unsigned (*Initialize)(void *display, int32_t *major, int32_t *minor);
    unsigned (*BindAPI)(unsigned api);
    unsigned (*ChooseConfig)(void *display, const int32_t *list, void **configs, int32_t room,
                             int32_t *count);
    void *(*CreateContext)(void *display, void *config, void *share, const int32_t *list);
    unsigned (*DestroyContext)(void *display, void *context);
    void *(*CreatePbufferSurface)(void *display, void *config, const int32_t *list);
    unsigned (*DestroySurface)(void *display, void *surface);
    unsigned (*MakeCurrent)(void *display, void *draw, void *read, void *context);
    void *(*GetPlatformDisplayEXT)(unsigned platform, void *native, const int32_t *list);
    unsigned (*QueryDevicesEXT)(int32_t room, void **devices, int32_t *count);
    const char *(*QueryDeviceStringEXT)(void *device, int32_t name);
    void *display; /* of all contexts, once one was opened */
} gl_context_egl;

enum {
    GL_CONTEXT_EGL_NONE = 0x3038,
    GL_CONTEXT_EGL_EXTENSIONS = 0x3055,
    GL_CONTEXT_EGL_ES_API = 0x30A0,
    GL_CONTEXT_EGL_GL_API = 0x30A2,
    GL_CONTEXT_EGL_PLATFORM_SURFACELESS = 0x31DD,
    GL_CONTEXT_EGL_PLATFORM_DEVICE = 0x313F
};

/* Extensions are asked of the library itself, not linked. */
static inline void gl_context_find_extensions(gl_context_egl *egl)
{
    gl_context_proc proc[3];
    proc[0] = egl->GetProcAddress("eglGetPlatformDisplayEXT");
    proc[1] = egl->GetProcAddress("eglQueryDevicesEXT");
    proc[2] = egl->GetProcAddress("eglQueryDeviceStringEXT");
    memcpy(&egl->GetPlatformDisplayEXT, &proc[0], sizeof proc[0]);
    memcpy(&egl->QueryDevicesEXT, &proc[1], sizeof proc[1]);
    memcpy(&egl->QueryDeviceStringEXT, &proc[2], sizeof proc[2]);
}

/* The library; NULL where there is none. */
static inline gl_context_egl *gl_context_load_egl(void)
{
    static gl_context_egl egl;
    void *library;
    if (egl.library)
        return &egl;
    library = dlopen("libEGL.so.1", RTLD_NOW | RTLD_LOCAL);
    if (!gl_context_find(library, "eglGetProcAddress", &egl.GetProcAddress) ||
        !gl_context_find(library, "eglGetDisplay", &egl.GetDisplay) ||
        !gl_context_find(library, "eglQueryString", &egl.QueryString) ||
        !gl_context_find(library, "eglInitialize", &egl.Initialize) ||
        !gl_context_find(library, "eglBindAPI", &egl.BindAPI) ||
        !gl_context_find(library, "eglChooseConfig", &egl.ChooseConfig) ||
        !gl_context_find(library, "eglCreateContext", &egl.CreateContext) ||
        !gl_context_find(library, "eglDestroyContext", &egl.DestroyContext) ||
        !gl_context_find(library, "eglCreatePbufferSurface", &egl.CreatePbufferSurface) ||
        !gl_context_find(library, "eglDestroySurface", &egl.DestroySurface) ||
        !gl_context_find(library, "eglMakeCurrent", &egl.MakeCurrent))
        return NULL;
    gl_context_find_extensions(&egl);
    egl.library = library;
    return &egl;
}

/* Whether a list of names with blanks between them holds the name. */
static inline int gl_context_lists(const char *list, const char *name)
{
    size_t length = strlen(name);
    const char *at = list;
    while (at && (at = strstr(at, name)) != NULL) {
        if ((at == list || at[-1] == ' ') && (at[length] == ' ' || at[length] == '\0'))
            return 1;
        at += length;
    }
    return 0;
}

static inline int gl_context_start(gl_context_egl *egl, unsigned platform, void *native)
{
    int32_t major, minor;
    void *display = egl->GetPlatformDisplayEXT(platform, native, NULL);
    if (!display || !egl->Initialize(display, &major, &minor))
        return 0;
    egl->display = display;
    return 1;
}

/* The first device that works, of those that are software or of those that are not. */
static inline int gl_context_start_device(gl_context_egl *egl, int software)
{
    void *devices[16];
    int32_t i, count = 0;
    if (!egl->QueryDevicesEXT || !egl->QueryDevicesEXT(16, devices, &count))
        return 0;
    for (i = 0; i < count; i++) {
        const char *names = egl->QueryDeviceStringEXT
                                ? egl->QueryDeviceStringEXT(devices[i], GL_CONTEXT_EGL_EXTENSIONS)
                                : NULL;
        if (gl_context_lists(names, "EGL_MESA_device_software") == software &&
            gl_context_start(egl, GL_CONTEXT_EGL_PLATFORM_DEVICE, devices[i]))
            return 1;
    }
    return 0;
}

/* A GPU before software; the default display last, for drivers that know no platforms. */
static inline int gl_context_find_display(gl_context_egl *egl)
{
    const char *names = egl->QueryString(NULL, GL_CONTEXT_EGL_EXTENSIONS);
    int devices = gl_context_lists(names, "EGL_EXT_platform_device");
    int32_t major, minor;
    if (egl->display)
        return 1;
    if (egl->GetPlatformDisplayEXT) {
        if (devices && gl_context_start_device(egl, 0))
            return 1;
        if (gl_context_lists(names, "EGL_MESA_platform_surfaceless") &&
            gl_context_start(egl, GL_CONTEXT_EGL_PLATFORM_SURFACELESS, NULL))
            return 1;
        if (devices && gl_context_start_device(egl, 1))
            return 1;
    }
    egl->display = egl->GetDisplay(NULL);
    if (egl->display && !egl->Initialize(egl->display, &major, &minor))
        egl->display = NULL;
    return egl->display != NULL;
}

/* A configuration of 8 bits a channel, depth and stencil, with pbuffers if there is one. */
static inline void *gl_context_config(gl_context_egl *egl, int es, int pbuffer)
{
    int32_t list[] = {
        0x3033 /* surface type */, 0,  0x3040 /* renderable */, 0, 0x3024 /* red */,   8,
        0x3023 /* green */,        8,  0x3022 /* blue */,       8, 0x3021 /* alpha */, 8,
        0x3025 /* depth */,        24, 0x3026 /* stencil */,    8, GL_CONTEXT_EGL_NONE};
    void *config = NULL;
    int32_t count = 0;
    list[1] = pbuffer ? 0x0001 : 0;
    list[3] = es ? 0x0040 : 0x0008;
    return egl->ChooseConfig(egl->display, list, &config, 1, &count) && count > 0 ? config : NULL;
}

static inline int gl_context_open_egl(gl_context *c, const gl_context *share)
{
    const int32_t size[] = {0x3057 /* width */, GL_CONTEXT_SIZE, 0x3056 /* height */,
                            GL_CONTEXT_SIZE, GL_CONTEXT_EGL_NONE};
    int32_t list[] = {0x3098 /* major */,  0, 0x30FB /* minor */, 0,
                      GL_CONTEXT_EGL_NONE, 0, GL_CONTEXT_EGL_NONE};
    gl_context_egl *egl = gl_context_load_egl();
    void *config;
    if (!egl)
        return gl_context_fail(c, "EGL", "there is no libEGL.so.1 with the usual functions");
    if (!gl_context_find_display(egl))
        return gl_context_fail(c, "EGL", "no display without a window system can be opened");
    list[1] = c->major;
    list[3] = c->minor;
    if (!c->es) {
        list[4] = 0x30FD; /* profile */
        list[5] = 1;      /* core */
    }
    egl->BindAPI(c->es ? GL_CONTEXT_EGL_ES_API : GL_CONTEXT_EGL_GL_API);
    if ((config = gl_context_config(egl, c->es, 1)) != NULL)
        c->surface = egl->CreatePbufferSurface(egl->display, config, size);
    else
        config = gl_context_config(egl, c->es, 0);
    c->handle = egl->CreateContext(egl->display, config, share ? share->handle : NULL, list);
    if (!c->handle)
        return gl_context_fail(c, "EGL", "the driver makes no context of that version");
    c->display = egl->display;
    c->get_proc_address = egl->GetProcAddress;
    return 1;
}

/* -------------------------------------------------------- >>osmesa */

typedef struct gl_context_osmesa {
    void *library;
    gl_context_proc (*GetProcAddress)(const char *name);
    void *(*CreateContextAttribs)(const int *list, void *share);
    void (*DestroyContext)(void *context);
    unsigned char (*MakeCurrent)(void *context, void *pixels, unsigned type, int width, int height);
} gl_context_osmesa;

static inline gl_context_osmesa *gl_context_load_osmesa(void)
{
    static gl_context_osmesa os;
    void *library;
    if (os.library)
        return &os;
    library = dlopen("libOSMesa.so.8", RTLD_NOW | RTLD_LOCAL);
    if (!gl_context_find(library, "OSMesaGetProcAddress", &os.GetProcAddress) ||
        !gl_context_find(library, "OSMesaCreateContextAttribs", &os.CreateContextAttribs) ||
        !gl_context_find(library, "OSMesaDestroyContext", &os.DestroyContext) ||
        !gl_context_find(library, "OSMesaMakeCurrent", &os.MakeCurrent))
        return NULL;
    os.library = library;
    return &os;
}

static inline int gl_context_open_osmesa(gl_context *c, const gl_context *share)
{
    int list[] = {0x22 /* format */,
                  0x1908 /* RGBA */,
                  0x30 /* depth */,
                  24,
                  0x31 /* stencil */,
                  8,
                  0x33 /* profile */,
                  0x34 /* core */,
                  0x36 /* major */,
                  0,
                  0x37 /* minor */,
                  0,
                  0};
    gl_context_osmesa *os = gl_context_load_osmesa();
    if (!os)
        return gl_context_fail(c, "OSMesa", "there is no libOSMesa.so.8 with the usual functions");
    list[9] = c->major;
    list[11] = c->minor;
    c->surface = calloc(GL_CONTEXT_SIZE * GL_CONTEXT_SIZE, 4);
    c->handle = c->surface ? os->CreateContextAttribs(list, share ? share->handle : NULL) : NULL;
    if (!c->handle)
        return gl_context_fail(c, "OSMesa", "no context of that version");
    c->get_proc_address = os->GetProcAddress;
    return 1;
}

/* --------------------------------------------------------- >>calls */

/* The one that is current, for the libraries do not know of each other. */
static inline gl_context **gl_context_current(void)
{
    static gl_context *current;
    return &current;
}

static inline void gl_context_release(void)
{
    gl_context *c = *gl_context_current();
    if (c && c->display) {
        gl_context_load_egl()->BindAPI(c->es ? GL_CONTEXT_EGL_ES_API : GL_CONTEXT_EGL_GL_API);
        gl_context_load_egl()->MakeCurrent(c->display, NULL, NULL, NULL);
    } else if (c) {
        gl_context_load_osmesa()->MakeCurrent(NULL, NULL, 0, 0, 0);
    }
    *gl_context_current() = NULL;
}

/* NULL: none is current. 0 and a sentence where the driver refuses. */
static inline int gl_context_make_current(gl_context *c)
{
    int ok;
    gl_context_release();
    if (!c)
        return 1;
    if (c->display) {
        gl_context_egl *egl = gl_context_load_egl();
        egl->BindAPI(c->es ? GL_CONTEXT_EGL_ES_API : GL_CONTEXT_EGL_GL_API);
        ok = egl->MakeCurrent(c->display, c->surface, c->surface, c->handle) != 0;
    } else {
        ok = gl_context_load_osmesa()->MakeCurrent(c->handle, c->surface, 0x1401 /* bytes */,
                                                   GL_CONTEXT_SIZE, GL_CONTEXT_SIZE) != 0;
    }
    if (!ok)
        return gl_context_fail(c, "context", "the driver does not make it current");
    *gl_context_current() = c;
    return 1;
}

/* Objects that the host did not delete are lost with it. */
static inline void gl_context_close(gl_context *c)
{
    if (*gl_context_current() == c)
        gl_context_release();
    if (c->display) {
        if (c->surface)
            gl_context_load_egl()->DestroySurface(c->display, c->surface);
        gl_context_load_egl()->DestroyContext(c->display, c->handle);
    } else {
        if (c->handle)
            gl_context_load_osmesa()->DestroyContext(c->handle);
        free(c->surface);
    }
    c->handle = c->display = c->surface = NULL;
}

/* Opens it and makes it current; share: NULL, or a context of the same library whose textures,
   buffers and programs are seen in both. 0 and a sentence where it cannot. */
static inline int gl_context_open(gl_context *c, const char *api, const gl_context *share)
{
    int osmesa = strcmp(api, "osmesa") == 0, gl45 = strcmp(api, "gl45") == 0;
    memset(c, 0, sizeof *c);
    c->es = strcmp(api, "es30") == 0;
    if (!osmesa && !gl45 && !c->es && strcmp(api, "gl33") != 0)
        return gl_context_fail(c, api, "not one of gl33, gl45, es30, osmesa");
    c->major = gl45 ? 4 : 3;
    c->minor = gl45 ? 5 : c->es ? 0 : 3;
    if (osmesa ? gl_context_open_osmesa(c, share) : gl_context_open_egl(c, share))
        if (gl_context_make_current(c))
            return 1;
    gl_context_close(c);
    return 0;
}

#endif /* GL_CONTEXT_H */
