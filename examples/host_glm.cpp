/* host_glm.cpp - fog in a C++ program that computes with GLM: its vectors and matrices pass straight in.

       host_glm [FILE.png]     one picture, without a window */
#define SCATTER_IMPLEMENTATION
#include "../scatter_gl.h"
#include "files.h"
#include "gl_context.h"

#include <glm/glm.hpp>
#include <glm/gtc/matrix_transform.hpp>

#include <vector>

namespace
{

const int SIZE = 256;

/* What this program calls of OpenGL itself: an empty picture of 16-bit floats. */
struct host {
    gl_context context;

    template <class... Arguments> void call(const char *name, Arguments... arguments)
    {
        reinterpret_cast<void (*)(Arguments...)>(context.get_proc_address(name))(arguments...);
    }

    bool open()
    {
        unsigned texture = 0, framebuffer = 0;
        if (!gl_context_open(&context, "gl33", NULL))
            return false;
        call("glGenTextures", 1, &texture);
        call("glBindTexture", 0x0DE1u, texture);
        call("glTexImage2D", 0x0DE1u, 0, 0x881A, SIZE, SIZE, 0, 0x1908u, 0x1406u,
             static_cast<const void *>(NULL));
        call("glGenFramebuffers", 1, &framebuffer);
        call("glBindFramebuffer", 0x8D40u, framebuffer);
        call("glFramebufferTexture2D", 0x8D40u, 0x8CE0u, 0x0DE1u, texture, 0);
        call("glClearColor", 0.02f, 0.03f, 0.05f, 1.0f);
        call("glClear", 0x4000u);
        picture = framebuffer;
        return true;
    }

    std::vector<float> read()
    {
        std::vector<float> rgb(3 * SIZE * SIZE);
        call("glReadPixels", 0, 0, SIZE, SIZE, 0x1907u, 0x1406u, static_cast<void *>(rgb.data()));
        return rgb;
    }

    unsigned picture;
};

/* A ring of puffs, and lights in its middle and above it. */
struct scene {
    std::vector<scatter_gaussian> puffs;
    std::vector<scatter_gl_light> lights;
    scatter_medium medium = {};

    scene() : lights(2)
    {
        for (int i = 0; i < 12; i++) {
            const float angle = glm::radians(30.0f * static_cast<float>(i));
            const glm::vec3 center(glm::cos(angle), 0.2f * glm::sin(3.0f * angle), glm::sin(angle));
            puffs.push_back({scatter_v3(center), 5.0f, 4.0f});
        }
        medium.extinction = scatter_v3(glm::vec3(2.0f, 2.2f, 2.5f));
        medium.albedo = scatter_v3(glm::vec3(0.95f));
        medium.gaussians = puffs.data();
        medium.gaussian_count = puffs.size();
        lights[0].light.position = scatter_v3(glm::vec3(0.0f));
        lights[0].light.intensity = scatter_v3(glm::vec3(9.0f, 5.0f, 2.0f));
        lights[1].light.kind = SCATTER_LIGHT_DIRECTIONAL;
        lights[1].light.direction = scatter_v3(glm::normalize(glm::dvec3(0.2, -1.0, 0.3)));
        lights[1].light.intensity = scatter_v3(glm::vec3(0.5f, 0.8f, 1.5f));
    }
};

bool draw(const scene &s, const host &h)
{
    const glm::mat4 camera =
        glm::lookAt(glm::vec3(0.0f, 1.6f, 3.2f), glm::vec3(0.0f), glm::vec3(0.0f, 1.0f, 0.0f));
    const glm::mat4 projection = glm::perspective(glm::radians(40.0f), 1.0f, 0.1f, 100.0f);
    scatter_gl_desc desc = {};
    scatter_gl_view view = {};
    scatter_gl *fog = NULL;
    desc.get_proc_address = h.context.get_proc_address;
    view.view = &camera[0][0];
    view.projection = &projection[0][0];
    view.framebuffer = h.picture;
    view.width = view.height = SIZE;
    const bool drawn = scatter_gl_create(&desc, &fog) == SCATTER_OK &&
                       scatter_gl_set_medium(fog, &s.medium) == SCATTER_OK &&
                       scatter_gl_set_lights(fog, s.lights.data(), s.lights.size()) == SCATTER_OK &&
                       scatter_gl_update(fog, NULL, NULL) == SCATTER_OK &&
                       scatter_gl_draw(fog, &view) == SCATTER_OK;
    scatter_gl_destroy(fog);
    return drawn;
}

/* GL counts rows from below. */
std::vector<unsigned char> bytes_of(const std::vector<float> &rgb)
{
    std::vector<unsigned char> bytes;
    for (int row = SIZE - 1; row >= 0; row--)
        for (int i = 0; i < 3 * SIZE; i++)
            bytes.push_back(scatter_srgb8(rgb[static_cast<size_t>(3 * SIZE * row + i)]));
    return bytes;
}

} // namespace

int main(int count, char **words)
{
    const char *path = count > 1 ? words[1] : "host_glm.png";
    file_error error;
    host h = {};
    if (!h.open() || !draw(scene(), h)) {
        fprintf(stderr, "host_glm: no fog. %s\n", h.context.error);
        return 1;
    }
    const std::vector<unsigned char> bytes = bytes_of(h.read());
    gl_context_close(&h.context);
    if (file_png_write(path, bytes.data(), SIZE, SIZE, &error) != 0) {
        fprintf(stderr, "host_glm: %s\n", error.text);
        return 1;
    }
    return 0;
}
