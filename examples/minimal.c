/* Three puffs of fog between a warm lamp and a blue spot light, as the picture fog.ppm. */
#define SCATTER_IMPLEMENTATION
#include "../scatter.h"
#include <stdio.h>

enum { SIZE = 512 };
static float rgb[SIZE * SIZE * 3];
static scatter_gaussian puffs[3] = {{{-0.7f, -0.35f, 0}, 2.5f, 2.4f}, /* centre, 1/m, density */
                                    {{0.7f, -0.4f, 0.2f}, 2.6f, 2.6f},
                                    {{0, 0.4f, -0.2f}, 2.3f, 2.2f}};
static scatter_light lights[2];
static scatter_scene scene; /* zero is the default of every field */

int main(void) {
    lights[0].position = scatter_v3(-2.2f, 1.5f, 1.6f);
    lights[0].intensity = scatter_v3(90, 62, 36); /* W/sr */
    lights[1].kind = SCATTER_LIGHT_SPOT;
    lights[1].position = scatter_v3(2.4f, 1.8f, 0.6f);
    lights[1].direction = scatter_v3(-1, -1, -0.2f);
    lights[1].intensity = scatter_v3(12, 36, 110);
    lights[1].outer = 0.5f; /* radians, from full to nothing */
    scene.lights = lights, scene.light_count = 2;
    scene.medium.extinction = scatter_v3(7, 7.5f, 8); /* 1/m where the density is 1 */
    scene.medium.albedo = scatter_v3(0.98f, 0.98f, 0.98f);
    scene.medium.gaussians = puffs, scene.medium.gaussian_count = 3;
    scene.background = scatter_v3(0.008f, 0.012f, 0.03f);
    scatter_context *fog = NULL;
    scatter_vec3 eye = scatter_v3(0, 0, 6), up = scatter_v3(0, 1, 0);
    scatter_view view = scatter_view_perspective(eye, scatter_v3(0, 0, 0), up, 0.6f, 1);
    scatter_image image = {SIZE, SIZE, 0, 0, 0, 0, rgb, NULL, NULL, NULL, NULL};
    FILE *out = fopen("fog.ppm", "wb");
    if (!out || scatter_create(NULL, &fog) || scatter_update(fog, &scene, NULL) ||
        scatter_render(fog, &view, &image))
        return 1;
    scatter_destroy(fog);
    fprintf(out, "P6 %d %d 255\n", SIZE, SIZE);
    for (int i = 0; i < SIZE * SIZE * 3; i++)
        fputc(scatter_srgb8(rgb[i]), out);
    return fclose(out) != 0;
}
