/* test_glm.cpp - the GLSL of scatter_gl.h, compiled as C++ and run on the CPU, against scatter.h: whole
   pixels and single functions. OpenGL is a fake that keeps what is uploaded: blocks, tables and
   keys of programs are those that scatter_gl.h makes itself. The fake samplers are checked first.

   Both sides compute in float, by the same formulas, in another order and with other exp and log. */
#include <csetjmp>
#include <cstdarg>
#include <cstddef>
#include <cstdint>

extern "C" {
#include <cmocka.h>
}

#define SCATTER_STATIC
#define SCATTER_IMPLEMENTATION
#include "../scatter_gl.h"
#include "check.h"
#include "fake_samplers.h"

#include <glm/gtc/matrix_transform.hpp>
#include <map>
#include <string>
#include <vector>

namespace
{

/* -------------------------------------------------------------------------------------- >>fake GL */

struct fake_store {
    fake_texture shape;
    std::vector<float> texels;
};

struct fake_gl {
    unsigned names = 0;
    std::map<unsigned, unsigned> bound; /* by target */
    std::map<unsigned, fake_store> textures;
    bool unpacks = false;        /* a buffer to unpack from is bound */
    std::vector<float> unpacked; /* what it holds */
} gl;

#define FAKE_NOTHING(result, name, arguments)                                                      \
    result SCATTERI_GL_CALL nothing_##name arguments                                               \
    {                                                                                              \
        return (result)0;                                                                          \
    }
#if defined(__GNUC__)
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif
SCATTERI_GL_FUNCTIONS(FAKE_NOTHING)
SCATTERI_GL_OPTIONAL(FAKE_NOTHING)
#if defined(__GNUC__)
#pragma GCC diagnostic pop
#endif

void fake_gen(int count, unsigned *names)
{
    for (int i = 0; i < count; i++)
        names[i] = ++gl.names;
}

unsigned fake_create(unsigned)
{
    return ++gl.names;
}

unsigned fake_create_program()
{
    return ++gl.names;
}

void fake_bind(unsigned target, unsigned texture)
{
    gl.bound[target] = texture;
}

void fake_image(unsigned target, int width, int height, int depth, unsigned format)
{
    const int channels = format == SCATTERI_GL_RED ? 1 : format == SCATTERI_GL_RG ? 2 : 4;
    fake_store &t = gl.textures[gl.bound[target]];
    t.texels.assign((size_t)width * (size_t)height * (size_t)depth * (size_t)channels, 0.0f);
    t.shape = {width, height, depth, width, width * height, channels, false, t.texels.data()};
}

void fake_image_2d(unsigned target, int, int, int width, int height, int, unsigned format, unsigned,
                   const void *)
{
    fake_image(target, width, height, 1, format);
}

void fake_image_3d(unsigned target, int, int, int width, int height, int depth, int,
                   unsigned format, unsigned, const void *)
{
    fake_image(target, width, height, depth, format);
}

void fake_bind_buffer(unsigned target, unsigned name)
{
    gl.unpacks = target == SCATTERI_GL_UNPACK_BUFFER ? name != 0 : gl.unpacks;
}

void fake_buffer_data(unsigned target, ptrdiff_t size, const void *data, unsigned)
{
    const float *values = (const float *)data;
    if (target == SCATTERI_GL_UNPACK_BUFFER && values != nullptr)
        gl.unpacked.assign(values, values + (size_t)size / sizeof(float));
}

/* Whole rows from the first on: what scatter_gl.h uploads. */
void fake_rows(unsigned target, int width, int height, int depth, const void *data)
{
    fake_store &t = gl.textures[gl.bound[target]];
    data = gl.unpacks ? gl.unpacked.data() : data;
    assert_true(width == t.shape.width && height <= t.shape.height && depth <= t.shape.depth);
    memcpy(t.texels.data(), data,
           (size_t)width * (size_t)height * (size_t)depth * (size_t)t.shape.channels *
               sizeof(float));
}

void fake_rows_2d(unsigned target, int, int, int, int width, int height, unsigned, unsigned,
                  const void *data)
{
    fake_rows(target, width, height, 1, data);
}

void fake_rows_3d(unsigned target, int, int, int, int, int width, int height, int depth, unsigned,
                  unsigned, const void *data)
{
    fake_rows(target, width, height, depth, data);
}

void fake_integer(unsigned name, int *value)
{
    *value = name == SCATTERI_GL_NUM_EXTENSIONS     ? 0
             : name == SCATTERI_GL_MAX_DRAW_BUFFERS ? 8
                                                    : 4096;
}

void fake_yes(unsigned, unsigned, int *value)
{
    *value = 1;
}

const unsigned char *fake_string(unsigned)
{
    return (const unsigned char *)"3.3 fake";
}

unsigned fake_complete(unsigned)
{
    return SCATTERI_GL_COMPLETE;
}

struct fake_entry {
    const char *name;
    scatter_gl_proc function;
};

#define FAKE_ENTRY(result, name, arguments) {"gl" #name, (scatter_gl_proc)nothing_##name},
#define FAKE_OWN(name, function)                                                                   \
    {                                                                                              \
        "gl" name, (scatter_gl_proc)function                                                       \
    }

const fake_entry fake_entries[] = {FAKE_OWN("GenTextures", fake_gen),
                                   FAKE_OWN("GenBuffers", fake_gen),
                                   FAKE_OWN("GenSamplers", fake_gen),
                                   FAKE_OWN("GenFramebuffers", fake_gen),
                                   FAKE_OWN("GenVertexArrays", fake_gen),
                                   FAKE_OWN("CreateProgram", fake_create_program),
                                   FAKE_OWN("CreateShader", fake_create),
                                   FAKE_OWN("BindTexture", fake_bind),
                                   FAKE_OWN("TexImage2D", fake_image_2d),
                                   FAKE_OWN("TexImage3D", fake_image_3d),
                                   FAKE_OWN("TexSubImage2D", fake_rows_2d),
                                   FAKE_OWN("TexSubImage3D", fake_rows_3d),
                                   FAKE_OWN("BindBuffer", fake_bind_buffer),
                                   FAKE_OWN("BufferData", fake_buffer_data),
                                   FAKE_OWN("GetIntegerv", fake_integer),
                                   FAKE_OWN("GetShaderiv", fake_yes),
                                   FAKE_OWN("GetProgramiv", fake_yes),
                                   FAKE_OWN("GetString", fake_string),
                                   FAKE_OWN("CheckFramebufferStatus", fake_complete),
                                   SCATTERI_GL_FUNCTIONS(FAKE_ENTRY) SCATTERI_GL_OPTIONAL(FAKE_ENTRY)};

scatter_gl_proc fake_address(const char *name)
{
    for (const fake_entry &e : fake_entries)
        if (strcmp(e.name, name) == 0)
            return e.function;
    return nullptr;
}

/* ----------------------------------------------------------------------------------------- >>stage */

const int WIDTH = 24, HEIGHT = 18;

/* A camera: matrices in double, as a host has them in float. */
struct camera {
    glm::dmat4 view, projection;
    bool reversed, zero_to_one, parallel;
};

/* One fog on both sides. */
struct stage {
    check_world world;
    std::vector<scatter_gl_light> lights;
    scatter_quality quality;
    bool has_eye;
    scatter_gl_show show;
    scatter_gl *fog;
    scatter_context *context;
    camera eye;
    std::vector<float> ends; /* metres along the ray of each pixel; 0: nothing there */
    std::map<std::string, fake_store> maps; /* by sampler: shadow maps and the scene's depth */
};

void add_light(stage *s, scatter_light_kind kind, scatter_vec3 position, scatter_vec3 direction,
               scatter_vec3 intensity)
{
    scatter_light *l = check_add_light(&s->world, kind, position, intensity);
    l->position = position;
    l->direction = direction;
    l->inner = 0.3f;
    l->outer = 0.5f;
}

void use_camera(stage *s)
{
    const glm::dvec3 at(0.3, 0.9, -2.4);
    s->eye.view = glm::lookAt(at, glm::dvec3(0.5, 0.45, 0.5), glm::dvec3(0.0, 1.0, 0.0));
    s->eye.projection = glm::perspective(0.6, (double)WIDTH / HEIGHT, 0.1, 50.0);
}

/* Five puffs, and lights of the given kinds: p, s, d. */
void open_world(stage *s, const char *kinds, size_t gaussians)
{
    check_world_open(&s->world);
    check_add_gaussians(&s->world, gaussians, 1.5f, 4.0f, 7);
    for (const char *k = kinds; *k; k++)
        if (*k == 'p')
            add_light(s, SCATTER_LIGHT_POINT, check_v3(0.2f, 1.3f, 0.3f), check_v3(0, 0, 0),
                      check_v3(5, 4, 3));
        else if (*k == 's')
            add_light(s, SCATTER_LIGHT_SPOT, check_v3(0.8f, 2.1f, 0.4f), check_v3(-0.1f, -1, 0.1f),
                      check_v3(9, 12, 14));
        else
            add_light(s, SCATTER_LIGHT_DIRECTIONAL, check_v3(0, 0, 0), check_v3(0.3f, -1, 0.4f),
                      check_v3(1, 2, 1.5f));
    use_camera(s);
}

scatter_vec3 eye_of(const stage *s)
{
    const glm::dvec4 at = glm::inverse(s->eye.view)[3];
    return check_v3((float)at.x, (float)at.y, (float)at.z);
}

/* What propagation would do: the depth of each source from scatter_depth_update. */
void fill_volume(stage *s)
{
    scatter_gl *f = s->fog;
    fake_store &t = gl.textures[f->volumes[0].name];
    for (int channel = 0; channel < SCATTERI_GL_BATCH; channel++) {
        const scatteri_gl_lamp *lamp = scatteri_gl_source_in(f, 0, channel);
        scatter_depth *depth = NULL;
        if (lamp == NULL)
            break;
        if (scatteri_on_lattice(f->quality.depth, &lamp->layout.source))
            continue; /* see test_parallel_columns */
        const scatter_source source = scatteri_source_of(&lamp->desc.light);
        assert_int_equal(scatter_depth_create(NULL, &depth), SCATTER_OK);
        assert_int_equal(scatter_depth_update(depth, &s->world.scene.medium, &source, &f->quality),
                         SCATTER_OK);
        assert_true(depth->nx == lamp->layout.nx && depth->nz == lamp->layout.nz);
        for (int k = 0; k < depth->nz; k++)
            for (int j = 0; j < depth->ny; j++)
                for (int i = 0; i < depth->nx; i++)
                    t.texels[(size_t)(4 * ((k * t.shape.height + j) * t.shape.width + i) +
                                      channel)] =
                        depth->values[(k * depth->ny + j) * depth->nx + i];
        scatter_depth_destroy(depth);
    }
}

void draw(stage *s)
{
    const glm::mat4 view(s->eye.view), projection(s->eye.projection);
    scatter_gl_view v;
    memset(&v, 0, sizeof v);
    v.view = &view[0][0];
    v.projection = &projection[0][0];
    v.reversed = s->eye.reversed;
    v.zero_to_one = s->eye.zero_to_one;
    v.width = WIDTH;
    v.height = HEIGHT;
    v.show = s->show;
    v.show_light = 0;
    v.depth_texture = s->ends.empty() ? 0u : 1u;
    assert_int_equal(scatter_gl_draw(s->fog, &v), SCATTER_OK);
}

/* Both sides take over the scene; nothing is drawn but the uploads are kept. */
void open_stage(stage *s)
{
    scatter_gl_desc desc;
    const scatter_vec3 eye = eye_of(s);
    memset(&desc, 0, sizeof desc);
    desc.get_proc_address = fake_address;
    s->lights.resize(s->world.scene.light_count);
    for (size_t i = 0; i < s->lights.size(); i++)
        s->lights[i].light = s->world.lights[i];
    s->quality.no_mask = s->quality.no_distance_map = 1; /* passes would have to draw them */
    assert_int_equal(scatter_gl_create(&desc, &s->fog), SCATTER_OK);
    assert_int_equal(scatter_gl_set_medium(s->fog, &s->world.scene.medium), SCATTER_OK);
    assert_int_equal(scatter_gl_set_lights(s->fog, s->lights.data(), s->lights.size()), SCATTER_OK);
    assert_int_equal(scatter_gl_update(s->fog, &s->quality, s->has_eye ? &eye : NULL), SCATTER_OK);
    if (s->fog->quality.depth != SCATTER_DEPTH_CLOSED && s->fog->medium.has_local)
        fill_volume(s);
    s->context = check_open_context(&s->world.scene, &s->fog->quality);
    draw(s);
}

void close_stage(stage *s)
{
    scatter_gl_destroy(s->fog);
    scatter_destroy(s->context);
}

/* --- one shader on the stage --- */

scatteri_gl_features features_of(const char *list)
{
    scatteri_gl_key key = {0, 0, 1, 0};
    char word[32];
    while ((list = scatteri_gl_next_word(list, word, sizeof word)) != NULL)
        assert_true(scatteri_gl_add_word(&key, word));
    return key.features;
}

bool was_drawn(const stage *s, scatteri_gl_features features)
{
    for (int i = 0; i < s->fog->program_count; i++)
        if (s->fog->programs[i].key.features == features)
            return true;
    return false;
}

void bind_texture(const glm_shader *shader, const char *sampler, const scatteri_gl_texture *t,
                  bool smooth)
{
    if (t == NULL || t->name == 0)
        return;
    gl.textures[t->name].shape.smooth = smooth;
    shader->bind(sampler, &gl.textures[t->name].shape);
}

void bind_shader(stage *s, const glm_shader *shader, const char *features)
{
    const scatter_gl *f = s->fog;
    assert_true(was_drawn(s, features_of(features)));
    shader->set_block(0, (const float *)(const void *)&f->medium_block);
    shader->set_block(1, (const float *)(const void *)&f->lights_block);
    shader->set_block(2, (const float *)(const void *)&f->view_block);
    bind_texture(shader, "scatteri_gaussians", &f->gaussians, false);
    bind_texture(shader, "scatteri_rules", &f->rules, false);
    bind_texture(shader, "scatteri_field", f->density, true);
    bind_texture(shader, "scatteri_volume", &f->volumes[0], true);
    for (auto &map : s->maps)
        shader->bind(map.first.c_str(), &map.second.shape);
}

/* The ray through the middle of a pixel, found in double. */
scatter_ray ray_of(const stage *s, int i, int j)
{
    const glm::dmat4 world = glm::inverse(s->eye.projection * s->eye.view);
    const double x = (i + 0.5) / WIDTH * 2.0 - 1.0, y = (j + 0.5) / HEIGHT * 2.0 - 1.0;
    const double low = s->eye.zero_to_one ? 0.0 : -1.0;
    const glm::dvec4 a = world * glm::dvec4(x, y, s->eye.reversed ? 1.0 : low, 1.0);
    const glm::dvec4 b = world * glm::dvec4(x, y, 0.5, 1.0);
    const glm::dvec3 from(a.x / a.w, a.y / a.w, a.z / a.w), to(b.x / b.w, b.y / b.w, b.z / b.w);
    const glm::dvec3 d = glm::normalize(to - from);
    scatter_ray ray;
    ray.origin =
        s->eye.parallel ? check_v3((float)from.x, (float)from.y, (float)from.z) : eye_of(s);
    ray.direction = check_v3((float)d.x, (float)d.y, (float)d.z);
    return ray;
}

scatter_sample look(const stage *s, int i, int j)
{
    const scatter_ray ray = ray_of(s, i, j);
    scatter_surface hit;
    scatter_sample sample;
    memset(&hit, 0, sizeof hit);
    hit.normal = check_v3(0, 1, 0);
    hit.distance = s->ends.empty() ? 0.0f : s->ends[(size_t)(j * WIDTH + i)];
    assert_int_equal(scatter_radiance(s->context, &ray, hit.distance > 0.0f ? &hit : NULL, &sample),
                     SCATTER_OK);
    return sample;
}

struct errors {
    double radiance, coverage;
};

/* Of all pixels: L, and 1 - T where the shader gives it. */
errors compare(stage *s, const glm_shader *shader, const char *features)
{
    check_error radiance = check_no_error(), coverage = check_no_error();
    bind_shader(s, shader, features);
    for (int j = 0; j < HEIGHT; j++)
        for (int i = 0; i < WIDTH; i++) {
            const scatter_sample sample = look(s, i, j);
            const scatter_vec3 l = sample.radiance, t = sample.transmittance;
            float rgba[4];
            shader->pixel((float)i + 0.5f, (float)j + 0.5f, rgba);
            check_add(&radiance, (double)rgba[0], (double)l.x);
            check_add(&radiance, (double)rgba[1], (double)l.y);
            check_add(&radiance, (double)rgba[2], (double)l.z);
            check_add(&coverage, (double)rgba[3],
                      1.0 - ((double)t.x + (double)t.y + (double)t.z) / 3.0);
        }
    const errors e = {check_rms(&radiance), check_rms(&coverage)};
    printf("%s: radiance %.3g, 1 - T %.3g\n", shader->name, e.radiance, e.coverage);
    return e;
}

#define FEATURES(name, features, fault, instead) const char features_##name[] = features;
GLM_SHADERS(FEATURES)

#define COMPARE(s, name) compare(s, &glm_##name, features_##name)

/* ---------------------------------------------------------------------------------------- >>pixels
   The bounds are about four times what was measured, unless something else is said. Where nodes lie at
   the same places only float's rounding is left: 9e-6 of the image at most, 5e-7 of 1 - T. A planted
   fault must go beyond twenty times the bound. */

const double ROUNDING = 4e-5, COVERAGE = 2e-6, FAULT = 20 * ROUNDING;

void expect(const errors &e, double radiance, double coverage)
{
    assert_at_most(e.radiance, radiance);
    assert_at_most(e.coverage, coverage);
}

void make_closed(stage *s)
{
    open_world(s, "psd", 5);
    s->world.scene.medium.extinction = check_v3(1.0f, 1.5f, 2.0f);
    s->world.scene.medium.phase.kind = SCATTER_PHASE_HG;
    s->world.scene.medium.phase.g = 0.6f;
    s->quality.depth = SCATTER_DEPTH_CLOSED;
    open_stage(s);
}

void test_closed(void **)
{
    stage s = {};
    make_closed(&s);
    expect(COMPARE(&s, closed), ROUNDING, COVERAGE);
    assert_at_least(COMPARE(&s, bad_gaussian).radiance, FAULT);
    assert_at_least(COMPARE(&s, bad_cone).radiance, FAULT);
    close_stage(&s);
}

/* A Gaussian that nothing shines through takes the erf that keeps its digits in the tails, and rays list
   the Gaussians that reach them. */
void expect_thick(size_t gaussians)
{
    stage s = {};
    open_world(&s, "psd", gaussians);
    s.world.gaussians[1].c = 200.0f;
    s.quality.depth = SCATTER_DEPTH_CLOSED;
    s.quality.nodes = 64;
    open_stage(&s);
    expect(COMPARE(&s, thick), ROUNDING, COVERAGE);
    close_stage(&s);
}

void test_thick(void **)
{
    expect_thick(3);
    expect_thick(60);
}

/* Nothing cuts the rays: one loop over all nodes. With narrow Gaussians it has many panels, and places
   that are rounded to 4e-7 m are 3e-5 of their exponent. */
double error_of_smooth(float a_high, int nodes)
{
    stage s = {};
    open_world(&s, "pd", 0);
    check_add_gaussians(&s.world, 8, 1.5f, a_high, 9);
    s.world.scene.medium.emission = check_v3(0.1f, 0.2f, 0.3f);
    s.quality.depth = SCATTER_DEPTH_CLOSED;
    s.quality.nodes = nodes;
    open_stage(&s);
    const errors e = COMPARE(&s, smooth);
    assert_at_most(e.coverage, a_high > 10.0f ? 10 * COVERAGE : COVERAGE);
    close_stage(&s);
    return e.radiance;
}

void test_smooth(void **)
{
    assert_at_most(error_of_smooth(4.0f, 16), ROUNDING);
    assert_at_most(error_of_smooth(4.0f, 64), ROUNDING);
    assert_at_most(error_of_smooth(40.0f, 16), ROUNDING);
    assert_at_most(error_of_smooth(40.0f, 64), ROUNDING);
}

void test_transmittance(void **)
{
    stage s = {};
    check_error e = check_no_error();
    make_closed(&s);
    bind_shader(&s, &glm_through, features_through);
    for (int j = 0; j < HEIGHT; j++)
        for (int i = 0; i < WIDTH; i++) {
            const scatter_vec3 t = look(&s, i, j).transmittance;
            float rgba[4];
            glm_through.pixel((float)i + 0.5f, (float)j + 0.5f, rgba);
            check_add(&e, (double)rgba[0], (double)t.x);
            check_add(&e, (double)rgba[1], (double)t.y);
            check_add(&e, (double)rgba[2], (double)t.z);
            check_add(&e, (double)rgba[3], ((double)t.x + (double)t.y + (double)t.z) / 3.0);
        }
    assert_at_most(check_rms(&e), COVERAGE);
    close_stage(&s);
}

/* --- other cameras, and surfaces --- */

/* Something at random distances on half of the rays, sky on the others. */
void place_surfaces(stage *s)
{
    const glm::dmat4 matrix = s->eye.projection * s->eye.view;
    fake_store &map = s->maps["scatteri_scene"];
    uint64_t seed = 5;
    s->ends.assign((size_t)(WIDTH * HEIGHT), 0.0f);
    map.texels.assign((size_t)(WIDTH * HEIGHT), s->eye.reversed ? 0.0f : 1.0f);
    map.texels[0] = NAN; /* is sky, too */
    map.shape = {WIDTH, HEIGHT, 1, WIDTH, WIDTH * HEIGHT, 1, false, map.texels.data()};
    for (int k = 1; k < WIDTH * HEIGHT; k += 2) {
        const scatter_ray ray = ray_of(s, k % WIDTH, k / WIDTH);
        const float t = check_uniform(&seed, 1.0f, 4.0f);
        const scatter_vec3 p = check_along(ray.origin, t, ray.direction);
        const glm::dvec4 clip = matrix * glm::dvec4(p.x, p.y, p.z, 1.0);
        const double z = clip.z / clip.w;
        map.texels[(size_t)k] = (float)(s->eye.zero_to_one ? z : 0.5 * z + 0.5);
        s->ends[(size_t)k] = t;
    }
}

void use_reversed_infinite(stage *s)
{
    glm::dmat4 m(0.0);
    m[1][1] = 1.0 / tan(0.3);
    m[0][0] = m[1][1] * HEIGHT / WIDTH;
    m[2][0] = 0.1; /* off-axis */
    m[2][3] = -1.0;
    m[3][2] = 0.1;
    s->eye.projection = m;
    s->eye.reversed = s->eye.zero_to_one = true;
}

void use_parallel(stage *s)
{
    s->eye.projection = glm::ortho(-1.0, 1.0, -0.75, 0.75, 0.5, 20.0);
    s->eye.reversed = s->eye.zero_to_one = false;
    s->eye.parallel = true;
}

/* Depth buffers hold distances to 1e-5 of themselves here: near 0.1 m, surfaces at 1..4 m. Where
   light is dense this moves a pixel by as much. */
void test_cameras(void **)
{
    stage s = {};
    make_closed(&s);
    place_surfaces(&s);
    draw(&s);
    expect(COMPARE(&s, closed), ROUNDING, 10 * COVERAGE);
    use_reversed_infinite(&s);
    place_surfaces(&s);
    draw(&s);
    expect(COMPARE(&s, closed), ROUNDING, 10 * COVERAGE);
    use_parallel(&s);
    place_surfaces(&s);
    draw(&s);
    expect(COMPARE(&s, closed), ROUNDING, 10 * COVERAGE);
    s.ends[7] *= 1.5f; /* one surface elsewhere than its depth says */
    assert_at_least(COMPARE(&s, closed).coverage, 20 * COVERAGE);
    close_stage(&s);
}

/* --- depth from volumes --- */

void make_cells(stage *s)
{
    open_world(s, "psd", 5);
    s->world.scene.medium.emission = check_v3(0.1f, 0.2f, 0.3f);
    s->world.scene.medium.phase.kind = SCATTER_PHASE_DROPLETS;
    s->world.scene.medium.phase.diameter_um = 8.0f;
    s->quality.depth = SCATTER_DEPTH_CLOSED_VOLUME;
    s->quality.grid = 24;
    s->quality.nodes = 64; /* both sides choose their panels; at 16 nodes that makes 6e-5 */
    open_stage(s);
}

void test_cells(void **)
{
    stage s = {};
    make_cells(&s);
    expect(COMPARE(&s, cells), ROUNDING, COVERAGE);
    assert_at_least(COMPARE(&s, bad_cells).radiance, FAULT);
    gl.textures[s.fog->volumes[0].name].shape.row--; /* a fake texture with a wrong stride */
    assert_at_least(COMPARE(&s, cells).radiance, FAULT);
    close_stage(&s);
}

/* Depth to the eye from cells has their error, of second order: scatter.h has no such method. 1.4 % of
   the image in 32^3 cells. */
double error_of_eye(int grid)
{
    stage s = {};
    open_world(&s, "pd", 5);
    s.quality.depth = SCATTER_DEPTH_CLOSED_VOLUME;
    s.quality.grid = grid;
    s.has_eye = true;
    open_stage(&s);
    const errors e = COMPARE(&s, eye);
    assert_at_most(e.coverage, COVERAGE);
    close_stage(&s);
    return e.radiance;
}

void test_eye(void **)
{
    const double coarse = error_of_eye(16), fine = error_of_eye(32);
    assert_at_least(check_order(coarse, fine), 1.7);
    assert_at_most(fine, 3e-2);
}

void make_polar(stage *s)
{
    open_world(s, "ps", 3);
    check_add_grid(&s->world, 9, 7, 5, check_cube(0.1f, 0.9f), 3);
    check_bound(&s->world, check_cube(-0.3f, 1.2f));
    s->quality.depth = SCATTER_DEPTH_POLAR;
    s->quality.density = SCATTER_DENSITY_EXACT;
    s->quality.grid = 24;
    s->quality.nodes = 64;
    open_stage(s);
}

/* Voxels are sampled at other places than on the CPU: the bound is the sum of both errors against 256
   nodes, 1.1e-4 and 2.1e-4. */
void test_polar(void **)
{
    stage s = {};
    make_polar(&s);
    expect(COMPARE(&s, polar), 3.2e-4, 3.2e-4);
    assert_at_least(COMPARE(&s, bad_polar).radiance, FAULT);
    close_stage(&s);
}

/* --- fog, march --- */

void make_fog(stage *s, bool bounded)
{
    open_world(s, "psd", bounded ? 3 : 0);
    check_add_height(&s->world, 0.3f, 0.1f, 0.4f);
    check_add_height(&s->world, 0.1f, 0.5f, 2.0f);
    s->world.scene.medium.constant = bounded ? 0.05f : 0.0f;
    if (bounded)
        check_bound(&s->world, check_cube(-0.6f, 1.5f));
    else
        s->world.scene.medium.extinction = check_v3(0.5f, 0.4f, 0.3f);
    s->quality.depth = SCATTER_DEPTH_CLOSED;
    open_stage(s);
}

void test_fog(void **)
{
    stage s = {}, open = {};
    make_fog(&s, true);
    expect(COMPARE(&s, fog), ROUNDING, COVERAGE);
    assert_at_least(COMPARE(&s, bad_fog).radiance, FAULT);
    close_stage(&s);
    make_fog(&open, false);
    expect(COMPARE(&open, open_fog), ROUNDING, COVERAGE);
    close_stage(&open);
}

void test_march(void **)
{
    stage s = {};
    open_world(&s, "ps", 3);
    check_add_height(&s.world, 0.3f, 0.1f, 0.4f);
    check_add_grid(&s.world, 9, 7, 5, check_cube(0.1f, 0.9f), 3);
    s.quality.depth = SCATTER_DEPTH_POLAR;
    s.quality.density = SCATTER_DENSITY_EXACT;
    s.quality.ray = SCATTER_RAY_MARCH;
    s.quality.nodes = 64;
    s.quality.grid = 24;
    open_stage(&s);
    expect(COMPARE(&s, march), ROUNDING, COVERAGE);
    close_stage(&s);
}

/* --- shadow maps --- */

/* A sheet of metal at y = 1; its edges lie between texels in all maps. */
const float SHEET_X[2] = {0.25f, 0.75f}, SHEET_Z[2] = {0.25f, 0.625f};

int misses_sheet(void *, scatter_vec3 p, scatter_vec3 q)
{
    const float t = (1.0f - p.y) / (q.y - p.y);
    const float x = p.x + t * (q.x - p.x), z = p.z + t * (q.z - p.z);
    return !(t > 0.0f && t < 1.0f && x > SHEET_X[0] && x < SHEET_X[1] && z > SHEET_Z[0] &&
             z < SHEET_Z[1]);
}

/* Layers of `size` texels a side that all hold `empty`. */
fake_store &open_map(stage *s, const char *sampler, int size, int layers, float empty)
{
    fake_store &map = s->maps[sampler];
    map.texels.assign((size_t)(size * size * layers), empty);
    map.shape = {size, size, layers, size, size * size, 1, false, map.texels.data()};
    return map;
}

/* Puts the sheet, of that depth, where x = x0 + i dx and z = z0 + j dz of a texel's middle meet it. */
void put_sheet(fake_store &map, int layer, float depth, float x0, float dx, float z0, float dz)
{
    for (int j = 0; j < map.shape.height; j++)
        for (int i = 0; i < map.shape.width; i++) {
            const float x = x0 + ((float)i + 0.5f) * dx, z = z0 + ((float)j + 0.5f) * dz;
            if (x > SHEET_X[0] && x < SHEET_X[1] && z > SHEET_Z[0] && z < SHEET_Z[1])
                map.texels[(size_t)(layer * map.shape.slice + j * map.shape.row + i)] = depth;
        }
}

void set_row(float *matrix, int row, float x, float y, float z, float w)
{
    matrix[row] = x;
    matrix[4 + row] = y;
    matrix[8 + row] = z;
    matrix[12 + row] = w;
}

/* Straight down on x, z in -1..2, y in -1..3; larger is nearer. */
void shadow_of_sun(stage *s)
{
    scatter_gl_shadow *d = &s->lights[0].shadow;
    fake_store &map = open_map(s, "scatteri_shadow0", 48, 1, 0.0f);
    s->world.lights[0].direction = check_v3(0, -1, 0);
    d->kind = SCATTER_GL_SHADOW_2D;
    d->texture = 1;
    d->reversed = 1;
    set_row(d->matrix[0], 0, 1.0f / 3, 0, 0, 1.0f / 3);
    set_row(d->matrix[0], 1, 0, 0, 1.0f / 3, 1.0f / 3);
    set_row(d->matrix[0], 2, 0, 0.25f, 0, 0.25f);
    set_row(d->matrix[0], 3, 0, 0, 0, 1);
    put_sheet(map, 0, 0.5f, -1.0f, 3.0f / 48, -1.0f, 3.0f / 48);
}

/* Perspective depth at distance w. */
float deep(float w, float near, float far)
{
    return far * (w - near) / (w * (far - near));
}

/* From y = 2, two squares: layers 1 and 2; nothing reads layer 0. */
void shadow_of_spot(stage *s)
{
    scatter_gl_shadow *d = &s->lights[1].shadow;
    fake_store &map = open_map(s, "scatteri_shadow1", 48, 3, 1.0f);
    s->world.lights[1].position = check_v3(0.5f, 2, 0.5f);
    s->world.lights[1].direction = check_v3(0, -1, 0);
    d->kind = SCATTER_GL_SHADOW_ARRAY;
    d->texture = 1;
    d->layer = 1;
    d->cascades = 2;
    for (int c = 0; c < 2; c++) {
        const float half = c == 0 ? 0.1875f : 0.75f, k = 0.5f / half, a = 5.0f / 4.9f;
        set_row(d->matrix[c], 0, k, -0.5f, 0, 1.0f - 0.5f * k);
        set_row(d->matrix[c], 1, 0, -0.5f, k, 1.0f - 0.5f * k);
        set_row(d->matrix[c], 2, 0, -a, 0, 2.0f * a - 0.1f * a);
        set_row(d->matrix[c], 3, 0, -1, 0, 2);
        put_sheet(map, 1 + c, deep(1.0f, 0.1f, 5.0f), 0.5f - half, 2 * half / 48, 0.5f - half,
                  2 * half / 48);
    }
    for (int i = 0; i < map.shape.slice; i++)
        map.texels[(size_t)i] = 0.0f;
}

/* From half a metre above the sheet: it is on the face -y, whose z runs backwards. */
void shadow_of_lamp(stage *s)
{
    scatter_gl_shadow *d = &s->lights[2].shadow;
    fake_store &map = open_map(s, "scatteri_shadow2", 64, 6, 1.0f);
    s->world.lights[2].position = check_v3(0.5f, 1.5f, 0.5f);
    d->kind = SCATTER_GL_SHADOW_CUBE;
    d->texture = 1;
    d->z_near = 0.1f;
    d->z_far = 5.0f;
    put_sheet(map, 3, deep(0.5f, d->z_near, d->z_far), 0.0f, 1.0f / 64, 1.0f, -1.0f / 64);
}

void make_shadows(stage *s)
{
    open_world(s, "dsp", 5);
    s->lights.resize(3);
    shadow_of_sun(s);
    shadow_of_spot(s);
    shadow_of_lamp(s);
    s->world.scene.visible = misses_sheet;
    s->quality.depth = SCATTER_DEPTH_CLOSED;
    open_stage(s);
}

/* Both sides halve the stretch between two probes 16 times or so: an edge is off by 1e-6 of the ray. */
void test_shadows(void **)
{
    stage s = {};
    make_shadows(&s);
    expect(COMPARE(&s, shadows), ROUNDING, COVERAGE);
    assert_at_least(COMPARE(&s, bad_shadow).radiance, FAULT);
    close_stage(&s);
}

/* Everything at once, and what no two of the scenes above have together. */
void make_all(stage *s)
{
    open_world(s, "dsp", 3);
    check_add_height(&s->world, 0.2f, 0.1f, 0.4f);
    check_add_grid(&s->world, 9, 7, 5, check_cube(0.1f, 0.9f), 3);
    check_bound(&s->world, check_cube(-0.6f, 1.6f));
    s->world.scene.medium.extinction = check_v3(1.0f, 1.5f, 2.0f);
    s->world.scene.medium.emission = check_v3(0.1f, 0.2f, 0.3f);
    s->world.scene.medium.phase.kind = SCATTER_PHASE_DROPLETS;
    s->world.scene.medium.phase.diameter_um = 8.0f;
    s->lights.resize(3);
    shadow_of_sun(s);
    shadow_of_spot(s);
    shadow_of_lamp(s);
    s->world.scene.visible = misses_sheet;
    s->quality.depth = SCATTER_DEPTH_UPWIND;
    s->quality.density = SCATTER_DENSITY_EXACT;
    s->quality.grid = 24;
    s->quality.nodes = 64;
    open_stage(s);
}

void test_all(void **)
{
    stage s = {};
    make_all(&s);
    expect(COMPARE(&s, all), 3.2e-4, 3.2e-4); /* voxels: see test_polar */
    close_stage(&s);
}

/* ------------------------------------------------------------------------------------------ >>show */

/* Integrals of D and of D tau to light 0 along a ray, in 400 steps. */
void integrate(const stage *s, const scatter_ray *ray, double *density, double *depth)
{
    const scatter_medium *m = &s->world.scene.medium;
    const double h = 5.0 / 400;
    *density = *depth = 0.0;
    for (int k = 0; k < 400; k++) {
        const scatter_vec3 x = check_along(ray->origin, (float)((k + 0.5) * h), ray->direction);
        const double d = h * (double)scatter_density(m, x);
        *density += d;
        *depth += d * (double)scatter_optical_depth(m, x, s->world.lights[0].position);
    }
}

/* What a debug view shows of a ray; red and blue, which differ where colours do. */
void expected(const stage *s, int i, int j, double *red, double *blue)
{
    const scatter_ray ray = ray_of(s, i, j);
    const scatter_sample sample = look(s, i, j);
    double density, depth;
    integrate(s, &ray, &density, &depth);
    *red = *blue = s->show == SCATTER_GL_SHOW_DENSITY ? density : depth / density;
    if (s->show == SCATTER_GL_SHOW_TRANSMITTANCE)
        *red = (double)sample.transmittance.x, *blue = (double)sample.transmittance.z;
    if (s->show == SCATTER_GL_SHOW_RADIANCE)
        *red = (double)sample.radiance.x, *blue = (double)sample.radiance.z;
}

double error_of_show(stage *s, scatter_gl_show show)
{
    check_error e = check_no_error();
    s->show = show;
    draw(s);
    bind_shader(s, &glm_show, features_show);
    for (int j = 0; j < HEIGHT; j++)
        for (int i = 0; i < WIDTH; i++) {
            double red, blue;
            float rgba[4];
            glm_show.pixel((float)i + 0.5f, (float)j + 0.5f, rgba);
            expected(s, i, j, &red, &blue);
            check_add(&e, (double)rgba[0], red);
            check_add(&e, (double)rgba[2], blue);
        }
    printf("show %d: %.3g\n", (int)show, check_rms(&e));
    return check_rms(&e);
}

/* Mean over the picture of what a debug view shows. */
double mean_of_show(stage *s, scatter_gl_show show)
{
    double sum = 0;
    s->show = show;
    draw(s);
    bind_shader(s, &glm_show, features_show);
    for (int k = 0; k < WIDTH * HEIGHT; k++) {
        float rgba[4];
        glm_show.pixel((float)(k % WIDTH) + 0.5f, (float)(k / WIDTH) + 0.5f, rgba);
        sum += (double)rgba[0] / (WIDTH * HEIGHT);
    }
    return sum;
}

void test_show(void **)
{
    stage s = {};
    make_closed(&s);
    assert_at_most(error_of_show(&s, SCATTER_GL_SHOW_DENSITY), COVERAGE);
    assert_at_most(error_of_show(&s, SCATTER_GL_SHOW_LIGHT_DEPTH), 1e-4);
    assert_at_most(error_of_show(&s, SCATTER_GL_SHOW_TRANSMITTANCE), COVERAGE);
    assert_at_most(error_of_show(&s, SCATTER_GL_SHOW_RADIANCE), ROUNDING);
    const double nodes = 256 * mean_of_show(&s, SCATTER_GL_SHOW_NODES);
    const double error = mean_of_show(&s, SCATTER_GL_SHOW_ERROR);
    printf("nodes of a ray: %.3g, error shown: %.3g\n", nodes, error);
    assert_at_least(nodes, 3 * 8); /* three lights */
    assert_at_most(nodes, 3 * 256);
    assert_at_least(error, 1e-9);
    assert_at_most(error, 1e-2 * mean_of_show(&s, SCATTER_GL_SHOW_RADIANCE));
    close_stage(&s);
}

/* ------------------------------------------------------------------------------------- >>functions */

/* Random points around the unit cube, as the shader has them. */
struct probe {
    scatter_vec3 world, to;
    float x[3], d[3], distance;
};

probe random_probe(const stage *s, uint64_t *seed)
{
    probe p;
    p.world = check_point(seed, -0.5f, 1.5f);
    p.to = check_direction(seed);
    p.distance = check_uniform(seed, 0.1f, 3.0f);
    const scatter_vec3 x = check_minus(p.world, s->fog->ref);
    p.x[0] = x.x, p.x[1] = x.y, p.x[2] = x.z;
    p.d[0] = p.to.x, p.d[1] = p.to.y, p.d[2] = p.to.z;
    return p;
}

enum { PROBES = 2000 };

void test_density(void **)
{
    stage s = {}, voxels = {};
    uint64_t seed = 11;
    check_error density = check_no_error(), depth = check_no_error(), field = check_no_error();
    make_fog(&s, false);
    bind_shader(&s, &glm_open_fog, features_open_fog);
    make_polar(&voxels);
    bind_shader(&voxels, &glm_polar, features_polar);
    voxels.world.scene.medium.gaussian_count = 0;
    for (int i = 0; i < PROBES; i++) {
        const scatter_medium *m = &s.world.scene.medium;
        probe p = random_probe(&s, &seed);
        check_add(&density, (double)glm_open_fog.fog_density(p.x),
                  (double)scatter_density(m, p.world));
        check_add(
            &depth, (double)glm_open_fog.fog_depth(p.x, p.d, p.distance),
            (double)scatter_optical_depth(m, p.world, check_along(p.world, p.distance, p.to)));
        p = random_probe(&voxels, &seed);
        check_add(&field, (double)glm_polar.field_density(p.x),
                  (double)scatter_density(&voxels.world.scene.medium, p.world));
    }
    assert_at_most(density.worst, 2e-6); /* exp of up to 4, rounded */
    assert_at_most(depth.worst, 1e-5);
    assert_at_most(check_rms(&field), 2e-6);
    close_stage(&s);
    close_stage(&voxels);
}

/* Thin Gaussians are computed by erf to 4e-7 of their whole depth, thick ones relatively. */
void test_closed_depth(void **)
{
    stage s = {};
    uint64_t seed = 12;
    check_error e = check_no_error(), bad = check_no_error();
    make_closed(&s);
    bind_shader(&s, &glm_closed, features_closed);
    for (int i = 0; i < PROBES; i++) {
        const probe p = random_probe(&s, &seed);
        const double depth = (double)scatter_optical_depth(&s.world.scene.medium, p.world,
                                                           check_along(p.world, p.distance, p.to));
        check_add(&e, (double)glm_closed.closed_depth(p.x, p.d, p.distance), depth);
        check_add(&bad, (double)glm_closed.closed_depth(p.x, p.d, 1.01f * p.distance), depth);
    }
    assert_at_most(check_rms(&e), 4e-6);
    assert_at_least(check_rms(&bad), 1e-4);
    close_stage(&s);
}

bool inside(const scatter_box *b, scatter_vec3 x)
{
    return x.x > b->min.x && x.y > b->min.y && x.z > b->min.z && x.x < b->max.x && x.y < b->max.y &&
           x.z < b->max.z;
}

/* Reads of a volume against scatter_depth_at, which reads the same values. */
void compare_depth(stage *s, const glm_shader *shader)
{
    uint64_t seed = 13;
    for (int l = 0; l < s->fog->lamp_count; l++) {
        const scatter_light *light = &s->fog->lamps[l].desc.light;
        const scatter_source source = scatteri_source_of(light);
        check_error e = check_no_error();
        scatter_depth *depth = NULL;
        assert_int_equal(scatter_depth_create(NULL, &depth), SCATTER_OK);
        assert_int_equal(
            scatter_depth_update(depth, &s->world.scene.medium, &source, &s->fog->quality),
            SCATTER_OK);
        for (int i = 0; i < PROBES; i++) {
            const probe p = random_probe(s, &seed);
            const scatter_vec3 to = light->kind == SCATTER_LIGHT_DIRECTIONAL
                                        ? scatteri_scale(light->direction, -1.0f)
                                        : check_minus(light->position, p.world);
            const float r = (float)sqrt(check_dot(to, to));
            const float d[3] = {to.x / r, to.y / r, to.z / r};
            const float distance = light->kind == SCATTER_LIGHT_DIRECTIONAL ? SCATTERI_FAR : r;
            if (s->world.scene.medium.bounded && !inside(&s->world.scene.medium.bounds, p.world))
                continue; /* rays ask inside only */
            check_add(&e, (double)shader->depth_to(l, p.x, d, distance),
                      (double)scatter_depth_at(depth, p.world));
        }
        printf("depth %s %d: %.3g\n", shader->name, l, check_rms(&e));
        assert_at_most(check_rms(&e), 1e-5);
        scatter_depth_destroy(depth);
    }
}

void test_volumes(void **)
{
    stage cells = {}, polar = {};
    make_cells(&cells);
    bind_shader(&cells, &glm_cells, features_cells);
    compare_depth(&cells, &glm_cells);
    close_stage(&cells);
    make_polar(&polar);
    bind_shader(&polar, &glm_polar, features_polar);
    compare_depth(&polar, &glm_polar);
    close_stage(&polar);
}

/* Parallel columns are read as a linear function of the place, where that is what they hold. */
void test_parallel_columns(void **)
{
    const double rate[3] = {0.7, -0.4, 1.3};
    stage s = {};
    uint64_t seed = 12;
    double worst = 0, bad = 0;
    open_world(&s, "d", 3);
    check_add_grid(&s.world, 9, 7, 5, check_cube(-0.5f, 1.5f), 3);
    check_bound(&s.world, check_cube(-0.6f, 1.6f));
    s.quality.depth = SCATTER_DEPTH_POLAR;
    s.quality.density = SCATTER_DENSITY_EXACT;
    s.quality.grid = 24;
    open_stage(&s);
    bind_shader(&s, &glm_parallel, features_parallel);
    bind_shader(&s, &glm_bad_parallel, features_bad_parallel);
    const scatter_depth &d = s.fog->lamps[0].layout;
    fake_store &t = gl.textures[s.fog->volumes[0].name];
    const auto value = [&](double u, double v, double r) {
        return 5.0 + rate[0] * u + rate[1] * v + rate[2] * r;
    };
    for (int k = 0; k < d.nz; k++)
        for (int j = 0; j < d.ny; j++)
            for (int i = 0; i < d.nx; i++)
                t.texels[(size_t)(4 * ((k * t.shape.height + j) * t.shape.width + i))] =
                    (float)value(i * (double)d.step_u, j * (double)d.step_v, k * (double)d.step_r);
    for (int i = 0; i < PROBES; i++) {
        const probe p = random_probe(&s, &seed);
        const scatter_vec3 o = check_minus(p.world, d.box.min);
        const double truth = value(check_dot(o, d.axis_u) - (double)d.low_u,
                                   check_dot(o, d.axis_v) - (double)d.low_v,
                                   check_dot(o, d.axis_w) - (double)d.low_r);
        const scatter_vec3 to = check_minus(check_v3(0, 0, 0), d.axis_w);
        const float way[3] = {to.x, to.y, to.z};
        worst = fmax(worst, fabs((double)glm_parallel.depth_to(0, p.x, way, SCATTERI_FAR) - truth));
        bad = fmax(bad, fabs((double)glm_bad_parallel.depth_to(0, p.x, way, SCATTERI_FAR) - truth));
    }
    printf("  parallel columns: at most %.1e off, planted %.1e\n", worst, bad);
    assert_at_most(worst, 1e-5); /* values below 10 in floats, a dozen roundings */
    assert_at_least(bad, 1e-2);
    close_stage(&s);
}

/* How far the cosine at t is from that of either nappe of the cone; nothing for t < 0. */
double off_cone(const probe *p, const scatter_light *light, float k, float t)
{
    const scatter_vec3 from = check_minus(check_along(p->world, t, p->to), light->position);
    const double cosine =
        check_dot(from, light->direction) /
        sqrt(check_dot(from, from) * check_dot(light->direction, light->direction));
    return t < 0.0f ? 0.0 : fabs(fabs(cosine) - (double)k);
}

void test_cone(void **)
{
    stage s = {};
    uint64_t seed = 14;
    int found = 0;
    double worst = 0, bad = 0;
    make_closed(&s);
    bind_shader(&s, &glm_closed, features_closed);
    bind_shader(&s, &glm_bad_cone, features_bad_cone);
    for (int i = 0; i < PROBES; i++) {
        const probe p = random_probe(&s, &seed);
        const scatter_light *light = &s.world.lights[1];
        const float k = cosf(light->outer);
        float t[2];
        glm_closed.cone_edges(1, p.x, p.d, k, t);
        worst = fmax(worst, fmax(off_cone(&p, light, k, t[0]), off_cone(&p, light, k, t[1])));
        found += t[0] > 0.0f || t[1] > 0.0f;
        glm_bad_cone.cone_edges(1, p.x, p.d, k, t);
        bad = fmax(bad, off_cone(&p, light, k, t[0]));
    }
    assert_at_least(found, PROBES / 4);
    assert_at_most(worst, 2e-4); /* near the tip 1e-7 m are that much of the angle */
    assert_at_least(bad, 0.1);
    close_stage(&s);
}

void test_visible(void **)
{
    stage s = {};
    uint64_t seed = 15;
    int dark = 0, wrong = 0, bad = 0;
    make_shadows(&s);
    bind_shader(&s, &glm_shadows, features_shadows);
    bind_shader(&s, &glm_bad_shadow, features_bad_shadow);
    for (int i = 0; i < 3 * PROBES; i++) {
        const int l = i % 3;
        const probe p = random_probe(&s, &seed);
        const scatter_vec3 q =
            l == 0 ? check_along(p.world, 1e3f, check_v3(0, 1, 0)) : s.world.lights[l].position;
        const bool lit = misses_sheet(NULL, p.world, q) != 0;
        dark += !lit;
        wrong += glm_shadows.visible(l, p.x) != lit;
        bad += glm_bad_shadow.visible(l, p.x) != lit;
    }
    assert_at_least(dark, PROBES / 20);
    assert_int_equal(wrong, 0);
    assert_at_least(bad, dark / 6);
    close_stage(&s);
}

/* ----------------------------------------------------------------------------------------- >>fakes */

/* Multilinear: reads between texels must give it, too. */
float ramp(float x, float y, float z)
{
    return 1.0f + x + 2.5f * y + 7.0f * z + 0.3f * x * y * z;
}

double error_of_sampler(const fake_texture *t)
{
    sampler3D sampler;
    uint64_t seed = 16;
    check_error e = check_no_error();
    sampler.texture = t;
    for (int i = 0; i < 200; i++) {
        const scatter_vec3 p = check_point(&seed, 0.0f, 1.0f);
        const float x = p.x * (float)(t->width - 1), y = p.y * (float)(t->height - 1),
                    z = p.z * (float)(t->depth - 1);
        const glm::vec3 at((x + 0.5f) / (float)t->width, (y + 0.5f) / (float)t->height,
                           (z + 0.5f) / (float)t->depth);
        check_add(&e, (double)textureLod(sampler, at, 0.0f).y, (double)ramp(x, y, z));
    }
    return check_rms(&e);
}

void test_samplers(void **)
{
    std::vector<float> texels;
    for (int k = 0; k < 7; k++)
        for (int j = 0; j < 5; j++)
            for (int i = 0; i < 3; i++) {
                texels.push_back(-1.0f);
                texels.push_back(ramp((float)i, (float)j, (float)k));
            }
    fake_texture t = {3, 5, 7, 3, 15, 2, true, texels.data()};
    assert_at_most(error_of_sampler(&t), 1e-6);
    t.row = 2;
    assert_at_least(error_of_sampler(&t), 1e-2);
    t.row = 3, t.slice = 14;
    assert_at_least(error_of_sampler(&t), 1e-2);
    t.slice = 15, t.smooth = false;
    assert_at_least(error_of_sampler(&t), 1e-2);
    t.smooth = true;
    sampler3D sampler;
    sampler.texture = &t; /* beyond the edge its value goes on */
    assert_true(textureLod(sampler, glm::vec3(-1.0f, 2.0f, 0.5f / 7), 0.0f).y == ramp(0, 4, 0));
}

/* Each face of a cube has its own number in its middle, and one at a corner for its sense. */
void test_cube(void **)
{
    const float corner[6][3] = {{1, 0.9f, 0.9f},   {-1, 0.9f, -0.9f}, {-0.9f, 1, -0.9f},
                                {-0.9f, -1, 0.9f}, {-0.9f, 0.9f, 1},  {0.9f, 0.9f, -1}};
    std::vector<float> texels(6 * 9);
    samplerCube sampler;
    for (int face = 0; face < 6; face++) {
        texels[(size_t)(9 * face + 4)] = 1.0f + (float)face;
        texels[(size_t)(9 * face)] = 10.0f + (float)face;
    }
    const fake_texture t = {3, 3, 6, 3, 9, 1, false, texels.data()};
    sampler.texture = &t;
    for (int face = 0; face < 6; face++) {
        glm::vec3 d(0.1f, 0.1f, 0.1f);
        d[face / 2] = face % 2 == 0 ? 3.0f : -3.0f;
        assert_true(textureLod(sampler, d, 0.0f).x == 1.0f + (float)face);
        d = glm::vec3(corner[face][0], corner[face][1], corner[face][2]);
        assert_true(textureLod(sampler, d, 0.0f).x == 10.0f + (float)face);
    }
}

void test_array(void **)
{
    const float texels[4] = {0.0f, 1.0f, 2.0f, 3.0f};
    const fake_texture t = {1, 1, 4, 1, 1, 1, true, texels};
    sampler2DArray sampler;
    sampler.texture = &t;
    assert_true(textureLod(sampler, glm::vec3(0.5f, 0.5f, 1.4f), 0.0f).x == 1.0f);
    assert_true(textureLod(sampler, glm::vec3(0.5f, 0.5f, 1.6f), 0.0f).x == 2.0f);
    assert_true(textureLod(sampler, glm::vec3(0.5f, 0.5f, 9.0f), 0.0f).x == 3.0f);
}

/* --- shaders as text --- */

void test_text(void **)
{
    const size_t all = scatter_gl_shader("330 core", "view", "SPOT FOG", NULL, 0);
    std::vector<char> text(all + 1);
    char some[10];
    int i = 0;
    assert_true(all > 1000);
    assert_true(scatter_gl_shader("330 core", "view", "SPOT FOG", text.data(), all + 1) == all);
    assert_true(strlen(text.data()) == all);
    assert_true(strncmp(text.data(), "#version 330 core\n", 18) == 0);
    assert_true(strstr(text.data(), "#define SCATTERI_SPOT\n") != NULL);
    assert_true(strstr(text.data(), "#define SCATTERI_POLAR\n") == NULL);
    assert_true(scatter_gl_shader("330 core", "view", "SPOT FOG", some, sizeof some) == all);
    assert_true(strcmp(some, "#version ") == 0);
    assert_true(scatter_gl_shader("300 es", "view:vertex", "", NULL, 0) > 0);
    assert_true(scatter_gl_shader("300 es", "view:fragment", "", NULL, 0) == 0);
    assert_true(scatter_gl_shader("300 es", "vie", "", NULL, 0) == 0);
    assert_true(scatter_gl_shader("300 es", "view", "SPOT PLANTED", NULL, 0) == 0);
    assert_true(scatter_gl_shader("300 es", "view", "9", NULL, 0) == 0);
    while (scatter_gl_pass_name(i) != NULL)
        assert_true(scatter_gl_shader("450 core", scatter_gl_pass_name(i++), "8", NULL, 0) > 0);
    assert_true(i > 0 && scatter_gl_pass_name(-1) == NULL && scatter_gl_feature_name(-1) == NULL);
    for (i = 0; scatter_gl_feature_name(i) != NULL; i++)
        assert_true(scatter_gl_shader("450 core", "view", scatter_gl_feature_name(i), NULL, 0) > 0);
    assert_true(i > 0);
}

} // namespace

int main()
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_samplers),      cmocka_unit_test(test_cube),
        cmocka_unit_test(test_array),         cmocka_unit_test(test_text),
        cmocka_unit_test(test_density),       cmocka_unit_test(test_closed_depth),
        cmocka_unit_test(test_volumes),
        cmocka_unit_test(test_parallel_columns),       cmocka_unit_test(test_cone),
        cmocka_unit_test(test_visible),       cmocka_unit_test(test_closed),
        cmocka_unit_test(test_thick),         cmocka_unit_test(test_smooth),
        cmocka_unit_test(test_transmittance), cmocka_unit_test(test_cameras),
        cmocka_unit_test(test_cells),         cmocka_unit_test(test_eye),
        cmocka_unit_test(test_polar),         cmocka_unit_test(test_fog),
        cmocka_unit_test(test_march),         cmocka_unit_test(test_shadows),
        cmocka_unit_test(test_all),           cmocka_unit_test(test_show)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
