/* turntable.c - scatter-turntable: a scene under a turning sky, frame by frame. MIT licence, see
   LICENSE.

   What an animation adds to a single picture:
   - The sky is cut into lights once, when the scene file is read. Turning the lights is a rotation
     each (scatter_turn_lights); scatter_update sees that only they have changed.
   - The lights are in the scene, the sky itself is not. It is looked up along each pixel's ray
     (scatter_environment_radiance) and added behind the medium, as far as that lets it through.
   - All frames are tone-mapped with the exposure of the first: nothing flickers.
   - With --sequence the medium changes as well. Each frame reads a volume into the memory that the
     library does not look at, and then swaps: the grid gets other voxels and another version.

   Sections: options, volumes, frames, main. */
#define _POSIX_C_SOURCE 200809L
#define SCATTER_IMPLEMENTATION
#define PROGRAM_NAME "scatter-turntable"
#include "program.h"
#include "scene.h"

static const char usage[] =
    "usage: scatter-turntable SCENE --out PREFIX --frames N [options]\n"
    "  writes PREFIX0000.png and on, tone-mapped with the exposure of the first\n"
    "  --degrees A        how far the sky turns about +y in N frames: +z goes to +x (360)\n"
    "  --size WxH         pixels instead of the scene's; the field of view stays\n"
    "  --nodes N          of the quadrature along each pixel's ray (16)\n"
    "  --sequence FILE... frame i shows the voxels of file i instead of those of the scene's "
    "grid;\n"
    "                     behind the last file the first comes again\n";

/* ----------------------------------------------------------------------------------- >>options */

typedef struct options {
    const char *scene, *out;
    int frames, width, height;
    float degrees; /* of all frames together */
    scatter_quality quality;
    char **volumes;
    int volume_count;
} options;

static int option_with_value(options *o, const char *name, const char *value)
{
    if (strcmp(name, "--out") == 0)
        return (o->out = value) == NULL;
    if (strcmp(name, "--frames") == 0)
        return number_option(name, value, 1, 10000, &o->frames);
    if (strcmp(name, "--degrees") == 0)
        return degrees_option(name, value, &o->degrees);
    if (strcmp(name, "--size") == 0)
        return size_option(value, &o->width, &o->height);
    if (strcmp(name, "--nodes") == 0)
        return number_option(name, value, 1, 256, &o->quality.nodes);
    return complain(2, "unknown option '%s'; --help lists the options", name);
}

/* All arguments up to the next option; how many they are. */
static int sequence_option(options *o, char **files)
{
    o->volumes = files;
    while (files[o->volume_count] && files[o->volume_count][0] != '-')
        o->volume_count++;
    return o->volume_count;
}

static int parse_options(int count, char **arguments, options *o)
{
    for (int i = 1; i < count; i++) {
        const char *name = arguments[i];
        if (strcmp(name, "--sequence") == 0)
            i += sequence_option(o, arguments + i + 1);
        else if (name[0] == '-' && i + 1 == count)
            return complain(2, "%s: expected a value behind it", name);
        else if (name[0] == '-') {
            if (option_with_value(o, name, arguments[++i]))
                return 2;
        } else if (o->scene)
            return complain(2, "expected one scene, found '%s' and '%s'", o->scene, name);
        else
            o->scene = name;
    }
    if (o->volumes && !o->volume_count)
        return complain(2, "--sequence: expected volumes behind it");
    if (!o->scene || !o->out || !o->frames)
        return complain(2, "expected a scene file, --out and --frames; --help lists the options");
    return 0;
}

/* ----------------------------------------------------------------------------------- >>volumes */

/* What changes from frame to frame, and where it goes. */
typedef struct turntable {
    const options *options;
    const scene_file *file;
    scatter_scene scene;   /* the file's, with the lights and the grid of this frame */
    scatter_light *lights; /* turned */
    scatter_grid grid;
    file_grid voxels[2]; /* of this frame and of the one before */
    scatter_view view;
    file_picture picture, transmittance;
    scatter_tone tone; /* of the first frame */
    host_state host;
    scatter_context *context;
} turntable;

/* Reads the frame's volume over that of the frame before last. */
static int next_volume(turntable *t, int frame)
{
    file_grid *voxels = &t->voxels[frame % 2], *before = &t->voxels[(frame + 1) % 2];
    const char *path = t->options->volumes[frame % t->options->volume_count];
    file_error error;
    file_grid_free(voxels);
    if (file_grid_read(path, voxels, &error))
        return complain(1, "%s", error.text);
    if (frame && (voxels->nx != before->nx || voxels->ny != before->ny || voxels->nz != before->nz))
        return complain(1, "%s: expected %dx%dx%d voxels as in the file before", path, before->nx,
                        before->ny, before->nz);
    t->grid.density = voxels->density;
    t->grid.nx = voxels->nx, t->grid.ny = voxels->ny, t->grid.nz = voxels->nz;
    t->grid.version++; /* so that the library looks at the voxels again */
    return 0;
}

/* ------------------------------------------------------------------------------------ >>frames */

/* Adds to a pixel what the skies send through the medium, unless a surface is in front of them. */
static void add_sky(const turntable *t, float degrees, int x, int y)
{
    const scatter_scene *scene = &t->file->scene;
    size_t at = 3 * ((size_t)y * (size_t)t->picture.width + (size_t)x);
    float *rgb = t->picture.rgb + at, *through = t->transmittance.rgb + at;
    scatter_surface hit;
    scatter_ray ray = scatter_view_ray(&t->view, ((float)x + 0.5f) / (float)t->picture.width,
                                       ((float)y + 0.5f) / (float)t->picture.height);
    if (scene->surface && scene->surface(scene->user, ray.origin, ray.direction, &hit))
        return;
    scatter_vec3 sky = scene_sky_radiance(t->file, degrees, ray.direction);
    const float seen[3] = {sky.x, sky.y, sky.z};
    for (int c = 0; c < 3; c++)
        rgb[c] += through[c] * seen[c];
}

/* The medium and the surfaces under the turned lights, then the sky behind them. */
static int render(turntable *t, float degrees)
{
    scatter_image image;
    memset(&image, 0, sizeof image);
    image.width = t->picture.width;
    image.height = t->picture.height;
    image.rgb = t->picture.rgb;
    image.transmittance = t->transmittance.rgb;
    scene_turn_skies(t->file, degrees, t->lights);
    t->host.start = now_ms();
    if (scatter_update(t->context, &t->scene, &t->options->quality) ||
        scatter_render(t->context, &t->view, &image))
        return complain(1, "%s: %s", t->options->scene, t->host.sentence);
    for (int y = 0; y < image.height; y++)
        for (int x = 0; x < image.width; x++)
            add_sky(t, degrees, x, y);
    return 0;
}

static int save(turntable *t, int frame)
{
    char path[PATH_MAX];
    file_error error;
    if (frame == 0)
        t->tone = choose_tone(&t->picture);
    scatter_tone_map(&t->tone, t->picture.rgb, (size_t)t->picture.width * (size_t)t->picture.height,
                     t->picture.rgb);
    int length = snprintf(path, sizeof path, "%s%04d.png", t->options->out, frame);
    if (length < 0 || (size_t)length >= sizeof path)
        return complain(1, "--out: expected a shorter prefix");
    return write_png(path, &t->picture, &error) ? complain(1, "%s", error.text) : 0;
}

/* The first two frames may need more memory than those before, later ones must not. */
static int run(turntable *t)
{
    const options *o = t->options;
    size_t settled = 0;
    double start = now_ms();
    for (int frame = 0; frame < o->frames; frame++) {
        if ((o->volumes && next_volume(t, frame)) ||
            render(t, o->degrees * (float)frame / (float)o->frames) || save(t, frame))
            return 1;
        if (frame < 2)
            settled = t->host.allocations;
    }
    printf("%s: %d frames, %.0f ms each, %.1f MB, %.0f allocations behind frame 2\n", o->scene,
           o->frames, (now_ms() - start) / o->frames, (double)t->host.bytes * 1e-6,
           (double)(t->host.allocations - settled));
    return 0;
}

/* -------------------------------------------------------------------------------------- >>main */

/* Everything that the frames share. */
static int prepare(turntable *t)
{
    const options *o = t->options;
    const scene_file *file = t->file;
    int width = o->width ? o->width : file->width, height = o->height ? o->height : file->height;
    if (o->volumes && file->scene.medium.grid_count != 1)
        return complain(1, "%s: --sequence expects a scene with one grid", o->scene);
    t->lights = (scatter_light *)calloc(file->scene.light_count + 1, sizeof *t->lights);
    if (new_picture(&t->picture, width, height) || new_picture(&t->transmittance, width, height) ||
        !t->lights)
        return complain(1, "%s: out of memory", o->scene);
    for (size_t i = 0; i < file->scene.light_count; i++)
        t->lights[i] = file->lights[i];
    t->scene = file->scene;
    t->scene.lights = t->lights;
    if (file->sky_count) /* a scene without a sky keeps its background */
        t->scene.background = scatter_v3(0, 0, 0);
    if (o->volumes) {
        t->grid = file->grids[0];
        t->scene.medium.grids = &t->grid;
    }
    t->view = scene_view(file, width, height);
    t->host.threads = all_processors();
    t->host.scene = o->scene;
    pthread_mutex_init(&t->host.lock, NULL);
    scatter_host host = make_host(&t->host);
    return scatter_create(&host, &t->context) ? complain(1, "%s", t->host.sentence) : 0;
}

int main(int count, char **arguments)
{
    options o;
    scene_file file;
    turntable t;
    memset(&o, 0, sizeof o);
    memset(&t, 0, sizeof t);
    o.degrees = 360;
    if (count == 2 && strcmp(arguments[1], "--help") == 0)
        return fputs(usage, stdout) < 0;
    if (parse_options(count, arguments, &o))
        return 2;
    if (scene_read(&file, o.scene))
        return complain(1, "%s", file.error);
    t.options = &o;
    t.file = &file;
    int status = prepare(&t) || run(&t);
    scatter_destroy(t.context);
    file_grid_free(&t.voxels[0]);
    file_grid_free(&t.voxels[1]);
    free(t.lights);
    free(t.picture.rgb);
    free(t.transmittance.rgb);
    scene_free(&file);
    return status;
}
