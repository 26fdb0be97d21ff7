/* test_scene.c - the scene reader, its surfaces, and the files it reads. MIT licence, see LICENSE.

   Each kind of check has a planted fault that the same checker must catch. Files are written to a
   directory of their own under TMPDIR. Run from the root of the project: the scenes and
   ../shared/data are found from there. */
#define _POSIX_C_SOURCE 200809L
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#define SCATTER_IMPLEMENTATION
#include "../scatter.h"
#define FILE_VOXELS_MAX (1u << 22) /* so that a damaged size cannot take long */
#include "../examples/scene.h"

/* Another reader of Radiance pictures, to compare with. */
#if defined(__GNUC__)
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wconversion"
#pragma GCC diagnostic ignored "-Wshadow"
#pragma GCC diagnostic ignored "-Wsign-compare"
#pragma GCC diagnostic ignored "-Wunused-function"
#endif
#define STBI_ONLY_HDR
#define STB_IMAGE_IMPLEMENTATION
#include <stb/stb_image.h>
#if defined(__GNUC__)
#pragma GCC diagnostic pop
#endif

#include <dirent.h>
#include <sys/stat.h>

#define COUNT(array) (sizeof(array) / sizeof((array)[0]))
#define VOLUMES "../shared/data/volumes/"
#define SKIES "../shared/data/hdr/"

/* ----------------------------------------------------------------------------------- >>helpers */

/* Numbers of a fixed sequence, 0 <= x < 1 (the generator of Numerical Recipes, top 24 bits). */
static uint64_t random_state = 1;
static double uniform(void) {
    random_state = random_state * 6364136223846793005u + 1442695040888963407u;
    return (double)(random_state >> 40) / 16777216.0;
}

static double between(double low, double high) {
    return low + (high - low) * uniform();
}

static scatter_vec3 random_point(double size) {
    float x = (float)between(-size, size), y = (float)between(-size, size);
    return scatter_v3(x, y, (float)between(-size, size));
}

static int parse(scene_file *file, const char *text) {
    return scene_parse(file, text, strlen(text), "dir/test.scatter");
}

/* A directory for one test, and paths in it. */
static char directory[200];
static char path_buffer[4][300];
static void make_directory(void) {
    const char *temporary = getenv("TMPDIR");
    snprintf(directory, sizeof directory, "%s/scatter-test-XXXXXX", temporary ? temporary : "/tmp");
    assert_true(mkdtemp(directory) != NULL);
}

static const char *in_directory(int which, const char *name) {
    snprintf(path_buffer[which], sizeof path_buffer[which], "%s/%s", directory, name);
    return path_buffer[which];
}

static void write_file(const char *path, const void *data, size_t bytes) {
    FILE *stream = fopen(path, "wb");
    assert_true(stream != NULL);
    assert_true(fwrite(data, 1, bytes, stream) == bytes);
    assert_int_equal(fclose(stream), 0);
}

/* Removes the directory; that fails if a file was left in it. */
static void remove_directory(void) {
    assert_int_equal(rmdir(directory), 0);
}

/* ----------------------------------------------------------------------------------- >>numbers */

/* Error of the number reader against strtod, relative; 1 if it stops elsewhere. */
static double number_error(const char *text) {
    const char *at = text;
    double value = 0;
    char *end;
    double expected = strtod(text, &end);
    if (file_number(&at, text + strlen(text), &value) || at != end)
        return 1;
    return fabs(value - expected) / (fabs(expected) > 0 ? fabs(expected) : 1);
}

/* Rounding twice and powers of ten beyond 10^22 cost some 1e-15; a float has 6e-8. */
static void numbers_agree_with_strtod(void **state) {
    static const char *const odd[] = {"0",
                                      "-0",
                                      "1",
                                      "+1",
                                      ".5",
                                      "5.",
                                      "1e0",
                                      "1E+2",
                                      "1e-2",
                                      "0.1",
                                      "-.1e1",
                                      "16777217",
                                      "1e-45",
                                      "3.4028234e38",
                                      "1e300",
                                      "00001",
                                      "0.00000000000000000000000000000000000000000001"};
    char text[100];
    (void)state;
    for (size_t i = 0; i < COUNT(odd); i++)
        assert_true(number_error(odd[i]) < 1e-14);
    for (int i = 0; i < 20000; i++) {
        snprintf(text, sizeof text, "%.*e", (int)between(0, 30),
                 between(-1, 1) * pow(10, between(-40, 38)));
        assert_true(number_error(text) < 1e-14);
    }
    assert_true(number_error("0x10") >
                1e-14); /* planted: strtod reads 16, we read 0 and stop at x */
    char many[3000];
    memset(many, '7', sizeof many);
    many[1] = '.';
    many[sizeof many - 1] = 0;
    assert_true(number_error(many) < 1e-14);
}

static void not_numbers_are_refused(void **state) {
    static const char *const bad[] = {"",    "-",    "+",   ".", "e5", "nan",
                                      "inf", "-inf", "--1", "x", "#"};
    double value;
    (void)state;
    for (size_t i = 0; i < COUNT(bad); i++) {
        const char *at = bad[i];
        assert_int_equal(file_number(&at, bad[i] + strlen(bad[i]), &value), 1);
        assert_true(at == bad[i]);
    }
}

/* ------------------------------------------------------------------------------------ >>scenes */

#define PRELUDE "image 64 32\ncamera perspective 0 1 -5 0 1 0 0 1 0 60\nmedium 1 2 3 0.5 0.6 0.7\n"

static const char everything[] = "# a comment\n"
                                 "image 64 32\n"
                                 "camera perspective 0 1 -5 0 1 0 0 1 0 60 # another\n"
                                 "medium 1 2 3 0.5 0.6 0.7\n"
                                 "emission 0.1 0.2 0.3\n"
                                 "phase draine 0.8 2\n"
                                 "bounds -1 -2 -3 4 5 6\n"
                                 "constant 0.25\n"
                                 "constant 0.5\n"
                                 "height 2 1 30\n"
                                 "gaussian 1 2 3 4 5\n"
                                 "gaussian 6 7 8 9 10\n"
                                 "gaussian 0 0 0 1 0\n"
                                 "light point 1 2 3 4 5 6\n"
                                 "light point 1 2 3 4 5 6 0.5\n"
                                 "light spot 1 2 3 0 -1 0 10 20 7 8 9\n"
                                 "light directional 0 -1 0.5 1 1 1\n"
                                 "box -1 -1 -1 1 1 1 0.1 0.2 0.3\n"
                                 "sphere 5 0 0 2 0.4 0.5 0.6\n"
                                 "plane 0 2 0 -2 0.7 0.8 0.9\n"
                                 "background 0.1 0.2 0.4\n";

static int is_vec3(scatter_vec3 v, double x, double y, double z) {
    return fabs((double)v.x - x) < 1e-6 && fabs((double)v.y - y) < 1e-6 &&
           fabs((double)v.z - z) < 1e-6;
}

static void check_medium(const scatter_medium *m) {
    assert_true(is_vec3(m->extinction, 1, 2, 3) && is_vec3(m->albedo, 0.5, 0.6, 0.7));
    assert_true(is_vec3(m->emission, 0.1, 0.2, 0.3));
    assert_int_equal(m->phase.kind, SCATTER_PHASE_DRAINE);
    assert_true(fabs((double)m->phase.g - 0.8) < 1e-6 && fabs((double)m->phase.alpha - 2) < 1e-6);
    assert_true(m->bounded && is_vec3(m->bounds.min, -1, -2, -3) &&
                is_vec3(m->bounds.max, 4, 5, 6));
    assert_true(fabs((double)m->constant - 0.75) < 1e-6);
    assert_int_equal(m->height_count, 1);
    assert_true(fabs((double)m->heights[0].scale - 30) < 1e-6);
    assert_int_equal(m->gaussian_count, 3);
    assert_true(is_vec3(m->gaussians[1].center, 6, 7, 8) &&
                fabs((double)m->gaussians[1].c - 10) < 1e-6);
}

static void check_lights(const scatter_scene *s) {
    assert_int_equal(s->light_count, 4);
    assert_true(fabs((double)s->lights[0].radius - 0.01) < 1e-9); /* the default of the format */
    assert_true(fabs((double)s->lights[1].radius - 0.5) < 1e-9);
    assert_int_equal(s->lights[2].kind, SCATTER_LIGHT_SPOT);
    assert_true(fabs((double)s->lights[2].outer - 20 * 3.14159265358979 / 180) < 1e-6);
    assert_true(is_vec3(s->lights[2].intensity, 7, 8, 9) &&
                is_vec3(s->lights[2].direction, 0, -1, 0));
    assert_int_equal(s->lights[3].kind, SCATTER_LIGHT_DIRECTIONAL);
    assert_true(is_vec3(s->lights[3].direction, 0, -1, 0.5));
}

static void every_directive_arrives(void **state) {
    scene_file f;
    (void)state;
    assert_int_equal(parse(&f, everything), 0);
    assert_true(f.width == 64 && f.height == 32);
    check_medium(&f.scene.medium);
    check_lights(&f.scene);
    assert_true(is_vec3(f.scene.background, 0.1, 0.2, 0.4));
    assert_int_equal(f.shape_count, 3);
    assert_true(f.scene.user == &f && f.scene.surface == scene_surface &&
                f.scene.visible == scene_visible);
    assert_true(is_vec3(f.shapes[2].a, 0, 1, 0) && fabs((double)f.shapes[2].radius + 1) < 1e-6);
    scene_free(&f);
    assert_int_equal(parse(&f, PRELUDE), 0); /* nothing but the necessary lines: an empty world */
    assert_true(f.scene.surface == NULL && f.scene.visible == NULL && f.scene.light_count == 0);
    scene_free(&f);
}

static void every_phase_arrives(void **state) {
    static const struct {
        const char *text;
        scatter_phase_kind kind;
    } phases[] = {{"phase isotropic", SCATTER_PHASE_ISOTROPIC},
                  {"phase hg -0.5", SCATTER_PHASE_HG},
                  {"phase rayleigh", SCATTER_PHASE_RAYLEIGH},
                  {"phase draine 0.1 0", SCATTER_PHASE_DRAINE},
                  {"phase droplets 20", SCATTER_PHASE_DROPLETS}};
    (void)state;
    for (size_t i = 0; i < COUNT(phases); i++) {
        char text[300];
        scene_file f;
        snprintf(text, sizeof text, "%s%s", PRELUDE, phases[i].text);
        assert_int_equal(parse(&f, text), 0);
        assert_int_equal(f.scene.medium.phase.kind, phases[i].kind);
        scene_free(&f);
    }
}

/* Whether two texts give the same scene. */
static int same_scene(const char *a, size_t a_bytes, const char *b, size_t b_bytes) {
    scene_file f, g;
    int a_failed = scene_parse(&f, a, a_bytes, "a"), b_failed = scene_parse(&g, b, b_bytes, "b");
    size_t gaussians = f.scene.medium.gaussian_count;
    int same = !a_failed && !b_failed && f.scene.light_count == g.scene.light_count &&
               f.shape_count == g.shape_count && gaussians == g.scene.medium.gaussian_count &&
               memcmp(f.gaussians, g.gaussians, gaussians * sizeof(scatter_gaussian)) == 0 &&
               memcmp(&f.view, &g.view, sizeof f.view) == 0;
    scene_free(&f);
    scene_free(&g);
    return same;
}

static void line_ends_and_blanks_do_not_matter(void **state) {
    static char other[1 << 20];
    size_t length = 0, bytes = strlen(everything);
    (void)state;
    for (size_t i = 0; i < bytes; i++) {
        if (everything[i] == '\n')
            other[length++] = '\r';
        other[length++] = everything[i];
    }
    assert_true(same_scene(everything, bytes, other, length));         /* CR LF */
    assert_true(same_scene(everything, bytes, everything, bytes - 1)); /* no newline at the end */
    length = (size_t)snprintf(other, sizeof other, "\xef\xbb\xbf%s", everything);
    assert_true(same_scene(everything, bytes, other, length)); /* byte order mark */
    memset(other, ' ', sizeof other);
    memcpy(other + sizeof other - bytes, everything, bytes);
    assert_true(same_scene(everything, bytes, other, sizeof other)); /* a line of a megabyte */
    length = (size_t)snprintf(other, sizeof other, "%sgaussian 1 1 1 1 1", everything);
    assert_false(same_scene(everything, bytes, other, length)); /* planted: one Gaussian more */
}

/* ------------------------------------------------------------------------------------ >>errors */

/* Whether the text is refused with "dir/test.scatter:LINE:" and a sentence that contains `words`.
   */
static int refused(const char *text, size_t bytes, int line, const char *words) {
    char start[64];
    scene_file f;
    snprintf(start, sizeof start, "dir/test.scatter:%d: ", line);
    if (scene_parse(&f, text, bytes, "dir/test.scatter") == 0) {
        scene_free(&f);
        fprintf(stderr, "accepted: %s\n", text);
        return 0;
    }
    int good = strncmp(f.error, start, strlen(start)) == 0 && strstr(f.error, words) != NULL;
    if (!good)
        fprintf(stderr, "'%s' for %s\n", f.error, text);
    return good;
}

/* One wrong line behind the three necessary ones, with something valid behind it. */
static int line_refused(const char *line, const char *words) {
    char text[2000];
    snprintf(text, sizeof text, "%s%s\nconstant 1\n", PRELUDE, line);
    return refused(text, strlen(text), 4, words);
}

static const char *const bad_lines[][2] = {
    {"gausian 0 0 0 1 1", "directive such as 'gaussian', found 'gausian'"},
    {"0 0 0", "directive"},
    {"Gaussian 0 0 0 1 1", "directive"},
    {"gaussian 0 0 0 1", "C is missing"},
    {"gaussian", "CX is missing"},
    {"gaussian 0 0 0 1 1 1", "nothing behind"},
    {"gaussian 0 0 0 1 x", "expected a number, found 'x'"},
    {"gaussian 0 0 0 1 1x", "expected a number, found '1x'"},
    {"gaussian 0 0 0 1 nan", "expected a number, found 'nan'"},
    {"gaussian 0 0 0 1 inf", "expected a number, found 'inf'"},
    {"gaussian 0 0 0 1 0x1", "expected a number"},
    {"gaussian 0 0 0 1 1,5", "expected a number"},
    {"gaussian 0 0 0 1 1e39", "too large"},
    {"gaussian 0 0 0 1 -1e99999999999", "too large"},
    {"gaussian 0 0 0 0 1", "A above 0"},
    {"gaussian 0 0 0 1e-60 1", "A above 0"},
    {"gaussian 0 0 0 -1 1", "A above 0"},
    {"gaussian 0 0 0 1 -1", "C >= 0"},
    {"height -1 0 1", "density >= 0"},
    {"height 1 0 0", "scale above 0"},
    {"constant -1", "density >= 0"},
    {"constant", "D0 is missing"},
    {"emission 1 1 -1", "emission >= 0"},
    {"background 1 1 -1", "radiance >= 0"},
    {"bounds 0 0 0 1 1 0", "Z0 < Z1"},
    {"bounds 0 0 0 0 1 1", "X0 < X1"},
    {"phase", "phase isotropic"},
    {"phase mie 1", "phase isotropic"},
    {"phase hg 1", "-0.9999 to 0.9999"},
    {"phase hg", "G is missing"},
    {"phase draine 0.5 -1", "ALPHA >= 0"},
    {"phase droplets 51", "diameter"},
    {"phase droplets 0", "diameter"},
    {"phase isotropic 1", "nothing behind"},
    {"light", "light point"},
    {"light sun 1", "light point"},
    {"light environment", "light environment FILE SCALE COUNT"},
    {"light environment a.hdr", "SCALE is missing"},
    {"light environment a.hdr 1", "COUNT is missing"},
    {"light environment a.hdr 1 20 1", "nothing behind"},
    {"light environment a.hdr 0 20", "SCALE above 0"},
    {"light environment a.hdr -1 20", "SCALE above 0"},
    {"light environment a.hdr 1e-60 20", "SCALE above 0"},
    {"light environment a.hdr 1 0", "COUNT of 1 to 256"},
    {"light environment a.hdr 1 257", "COUNT of 1 to 256"},
    {"light environment a.hdr 1 1.5", "COUNT of 1 to 256"},
    {"light environment a.hdr 1 -1", "COUNT of 1 to 256"},
    {"light environment a.hdr x 1", "expected a number, found 'x'"},
    {"light environment a.png 1 20", "a.png: expected a file name ending in .hdr"},
    {"light environment no/such.hdr 1 20", "dir/no/such.hdr: cannot be opened"},
    {"light point 0 0 0 1 1", "B is missing"},
    {"light point 0 0 0 1 1 -1", "intensity >= 0"},
    {"light point 0 0 0 1 1 1 -1", "RADIUS >= 0"},
    {"light point 0 0 0 1 1 1 1 1", "nothing behind"},
    {"light spot 0 0 0 0 0 0 10 20 1 1 1", "not 0 0 0"},
    {"light spot 0 0 0 0 1 0 20 10 1 1 1", "INNER <= OUTER"},
    {"light spot 0 0 0 0 1 0 10 181 1 1 1", "180"},
    {"light spot 0 0 0 0 1 0 -1 10 1 1 1", "0 <= INNER"},
    {"light directional 0 0 0 1 1 1", "not 0 0 0"},
    {"light directional 0 1 0 1 1 1 1", "nothing behind"},
    {"box 0 0 0 -1 1 1 1 1 1", "X0 <= X1"},
    {"box 0 0 0 1 1 1 1 1 2", "albedo"},
    {"box 0 0 0 1 1 1 1 1", "B is missing"},
    {"sphere 0 0 0 0 1 1 1", "RADIUS above 0"},
    {"sphere 0 0 0 1 1 1 -1", "albedo"},
    {"plane 0 0 0 1 1 1 1", "not 0 0 0"},
    {"plane 1e-30 0 0 1e20 1 1 1", "3.4e38"},
    {"image 10 10", "second"},
    {"camera perspective 0 1 -5 0 1 0 0 1 0 60", "second"},
    {"medium 1 1 1 1 1 1", "second"},
    {"grid", "grid FILE"},
    {"grid a.raw 0 0 0 1 1 1", "SCALE is missing"},
    {"grid a.raw 0 0 0 1 1 1 -1", "SCALE >= 0"},
    {"grid a.raw 0 0 0 1 0 1 1", "Y0 < Y1"},
    {"grid no/such_1x1x1_u8.raw 0 0 0 1 1 1 1", "dir/no/such_1x1x1_u8.raw: cannot be opened"},
    {"grid a.txt 0 0 0 1 1 1 1", "ending in"},
    {"\v", "directive"},
};

static void wrong_lines_are_refused_by_number(void **state) {
    (void)state;
    for (size_t i = 0; i < COUNT(bad_lines); i++)
        assert_true(line_refused(bad_lines[i][0], bad_lines[i][1]));
    fprintf(stderr, "planted faults, which must complain here:\n");
    assert_false(line_refused("gaussian 0 0 0 1 1", "C is missing")); /* planted: a right line */
    assert_false(line_refused("gaussian 0 0 0 1", "A is missing")); /* planted: another sentence */
    assert_false(refused(PRELUDE "x\n", strlen(PRELUDE) + 2, 5, "")); /* planted: another line */
}

/* The same for the lines that come first, in a text of their own. */
static void wrong_files_are_refused(void **state) {
    static const struct {
        const char *text;
        int line;
        const char *words;
    } bad[] = {
        {"", 0, "expected 'image'"},
        {"\n\n", 2, "expected 'image'"},
        {"image 1 1\nmedium 1 1 1 1 1 1", 2, "expected 'camera'"},
        {"image 1 1\ncamera perspective 0 0 0 0 0 1 0 1 0 60\n", 2, "expected 'medium'"},
        {"image 0 1", 1, "1 to 65536"},
        {"image 1 65537", 1, "1 to 65536"},
        {"image 1.5 1", 1, "whole pixels"},
        {"image -1 1", 1, "whole pixels"},
        {"image 1", 1, "H is missing"},
        {"medium -1 1 1 1 1 1", 1, "extinctions >= 0"},
        {"medium 1 1 1 1 1 1.1", 1, "albedos from 0 to 1"},
        {"#\ncamera fisheye 0 0 0 0 0 1 0 1 0 60", 2, "camera perspective"},
        {"camera perspective 0 0 0 0 0 0 0 1 0 60", 1, "away from the eye"},
        {"camera perspective 0 0 0 0 1 0 0 2 0 60", 1, "across the view"},
        {"camera perspective 0 0 0 0 0 1 0 1 0 180", 1, "between 0 and 180"},
        {"camera perspective 0 0 0 0 0 1 0 1 0 0", 1, "between 0 and 180"},
        {"camera orthographic 0 0 0 0 0 1 0 1 0 0", 1, "height above 0"},
        {"camera orthographic 0 0 0 0 0 1 0 1 0", 1, "HEIGHT is missing"},
        {"phase isotropic\nphase isotropic", 2, "second"},
        {"bounds 0 0 0 1 1 1\r\nbounds 0 0 0 1 1 1", 2, "second"},
        {"background 1 1 1\n\n# x\nbackground 1 1 1", 4, "second"},
        {"emission 1 1 1\nemission 1 1 1", 2, "second"},
    };
    (void)state;
    for (size_t i = 0; i < COUNT(bad); i++)
        assert_true(refused(bad[i].text, strlen(bad[i].text), bad[i].line, bad[i].words));
    assert_true(refused("image 1 1\0\n", 11, 1, "byte 0"));
    assert_true(refused("# comment \0\n", 12, 1, "byte 0"));
    assert_true(refused("\0", 1, 1, "byte 0"));
}

/* A scene cut off anywhere is a scene or an error in its last line, never a crash or a leak. */
static void cut_scenes_are_handled(void **state) {
    int lines = 1, accepted = 0;
    (void)state;
    for (size_t bytes = 0; bytes < strlen(everything); bytes++) {
        char *copy =
            (char *)malloc(bytes + 1); /* of its own, so that a sanitizer sees reads beyond it */
        scene_file f;
        memcpy(copy, everything, bytes);
        int failed = scene_parse(&f, copy, bytes, "x");
        accepted += !failed;
        if (failed)
            assert_true(atoi(f.error + 2) >= lines - 1 && atoi(f.error + 2) <= lines);
        scene_free(&f);
        free(copy);
        lines += everything[bytes] == '\n';
    }
    assert_true(accepted > 10 &&
                accepted < 500); /* at least each end of a line behind the camera and medium */
}

static void long_paths_keep_the_reason(void **state) {
    static char name[6000];
    scene_file f;
    (void)state;
    memset(name, 'a', sizeof name - 1);
    assert_int_equal(scene_read(&f, name), 1);
    assert_true(strstr(f.error, "cannot be opened") != NULL);
    assert_int_equal(scene_parse(&f, "what", 4, name), 1);
    assert_true(strstr(f.error, ":1: expected a directive") != NULL);
    assert_int_equal(scene_read(&f, "."), 1); /* a directory */
    assert_true(strstr(f.error, "cannot be read") != NULL);
    assert_int_equal(scene_parse(&f, "grid a.vdb 0 0 0 1 1 1 1", 24, NULL), 1);
    assert_true(strstr(f.error, "from memory") != NULL);
}

/* ----------------------------------------------------------------------------------- >>cameras */

static scatter_vec3 direction_at(const scatter_view *view, float x, float y) {
    scatter_ray ray = scatter_view_ray(view, x, y);
    double d[3], length;
    scene_doubles(ray.direction, d);
    length = sqrt(scene_dot(d, d));
    return scatter_v3((float)(d[0] / length), (float)(d[1] / length), (float)(d[2] / length));
}

/* From z = -5 towards +z with y up, image right is -x; the vertical field of view does not depend
   on the size. */
static void cameras_look_where_they_should(void **state) {
    scene_file f;
    (void)state;
    assert_int_equal(parse(&f, PRELUDE), 0);
    assert_true(is_vec3(direction_at(&f.view, 0.5f, 0.5f), 0, 0, 1));
    assert_true(direction_at(&f.view, 1, 0.5f).x < 0 && direction_at(&f.view, 0.5f, 0).y > 0);
    for (int width = 10; width < 100; width += 30) {
        scatter_view view = scene_view(&f, width, 50);
        assert_true(is_vec3(direction_at(&view, 0.5f, 0), 0, 0.5, sqrt(0.75))); /* 30 degrees up */
        scatter_vec3 right = direction_at(&view, 1, 0.5f);
        double slope = tan(3.14159265358979 / 6) * width / 50;
        assert_true(fabs(-(double)right.x / (double)right.z - slope) < 1e-5);
    }
    scene_free(&f);
    assert_int_equal(
        parse(&f, "image 2 1\ncamera orthographic 0 1 -5 0 1 0 0 1 0 4\nmedium 1 1 1 1 1 1"), 0);
    assert_true(is_vec3(scatter_view_ray(&f.view, 0, 0).origin, 4, 3,
                        -5)); /* half of 8 x 4 m, left is +x */
    assert_true(is_vec3(direction_at(&f.view, 0, 0), 0, 0, 1));
    scene_free(&f);
}

/* ---------------------------------------------------------------------------------- >>surfaces */

static int parse_shapes(scene_file *f, const char *shapes) {
    char text[2000];
    snprintf(text, sizeof text, "%s%s", PRELUDE, shapes);
    return parse(f, text);
}

/* Distance along a ray, or -1. */
static double distance_to(scene_file *f, scatter_vec3 origin, scatter_vec3 direction,
                          scatter_surface *hit) {
    return scene_surface(f, origin, direction, hit) ? (double)hit->distance : -1;
}

static void rays_meet_shapes(void **state) {
    scatter_vec3 eye = scatter_v3(0.25f, 0.25f, -5), ahead = scatter_v3(0, 0, 1),
                 up = scatter_v3(0, 1, 0);
    scatter_surface hit;
    scene_file f;
    (void)state;
    assert_int_equal(parse_shapes(&f, "box -1 -1 -1 1 1 1 0.1 0.2 0.3\n"), 0);
    assert_true(fabs(distance_to(&f, eye, ahead, &hit) - 4) < 1e-6 &&
                is_vec3(hit.normal, 0, 0, -1));
    assert_true(is_vec3(hit.albedo, 0.1, 0.2, 0.3) && is_vec3(hit.specular, 0, 0, 0));
    assert_true(distance_to(&f, eye, up, &hit) < 0 &&
                distance_to(&f, eye, scatter_v3(0, 0, -1), &hit) < 0);
    assert_true(fabs(distance_to(&f, scatter_v3(0, 0, 0), up, &hit) - 1) < 1e-6); /* from inside */
    assert_true(is_vec3(hit.normal, 0, -1, 0));
    scene_free(&f);
    assert_int_equal(parse_shapes(&f, "plane 0 0 -3 -6 1 1 1\nsphere 0.25 0.25 10 3 1 1 1\n"), 0);
    assert_true(fabs(distance_to(&f, eye, ahead, &hit) - 7) < 1e-6 &&
                is_vec3(hit.normal, 0, 0, -1));
    assert_true(
        fabs(distance_to(&f, scatter_v3(0.25f, 0.25f, 10), scatter_v3(0, 0, -1), &hit) - 3) < 1e-6);
    assert_true(
        is_vec3(hit.normal, 0, 0, 1)); /* the sphere from inside, before the plane from behind */
    scene_free(&f);
    assert_int_equal(parse_shapes(&f, "box -1 -1 0 1 1 0 1 1 1\n"), 0); /* no thickness */
    assert_true(fabs(distance_to(&f, eye, ahead, &hit) - 5) < 1e-6 &&
                is_vec3(hit.normal, 0, 0, -1));
    scene_free(&f);
}

/* A sphere of 1 m, a million metres away: floats there are 0.06 m apart, so 0.1 m is what can be
   asked of the distance; a quadratic solved in float would be wrong by many metres or miss. */
static void far_spheres_are_met(void **state) {
    scatter_surface hit;
    scene_file f;
    (void)state;
    assert_int_equal(parse_shapes(&f, "sphere 0 0 1e6 1 1 1 1\n"), 0);
    assert_true(fabs(distance_to(&f, scatter_v3(0, 0, 0), scatter_v3(0, 0, 1), &hit) - 999999) <
                0.1);
    assert_true(fabs(distance_to(&f, scatter_v3(0, 0.5f, 0), scatter_v3(0, 0, 1), &hit) - 999999) <
                0.3);
    assert_true(distance_to(&f, scatter_v3(0, 1.01f, 0), scatter_v3(0, 0, 1), &hit) < 0);
    scene_free(&f);
    assert_int_equal(parse_shapes(&f, "sphere 0 -6360000 0 6360000 1 1 1\n"),
                     0); /* the Earth, eye at 2 m */
    assert_true(fabs(distance_to(&f, scatter_v3(0, 2, 0), scatter_v3(0, -1, 0), &hit) - 2) < 1e-5);
    scene_free(&f);
}

static int sees(scene_file *f, scatter_vec3 p, scatter_vec3 q) {
    int there = scene_visible(f, p, q), back = scene_visible(f, q, p);
    assert_int_equal(there, back);
    return there;
}

static void shapes_throw_shadows(void **state) {
    scatter_vec3 centre = scatter_v3(0, 0, 0), left = scatter_v3(-3, 0.1f, 0.2f),
                 right = scatter_v3(3, 0.1f, 0.2f);
    static const char *const solids[] = {"box -1 -1 -1 1 1 1 1 1 1\n", "sphere 0 0 0 1.2 1 1 1\n"};
    scene_file f;
    (void)state;
    for (size_t i = 0; i < COUNT(solids); i++) {
        assert_int_equal(parse_shapes(&f, solids[i]), 0);
        assert_false(sees(&f, left, right));
        assert_false(sees(&f, left, centre)); /* a light inside a solid is shadowed by it */
        assert_true(sees(&f, scatter_v3(0.1f, 0.2f, 0.3f),
                         centre)); /* an eye inside is lit by a light inside */
        assert_true(sees(&f, left, scatter_v3(-2, 0.1f, 0.2f)) &&
                    sees(&f, left, scatter_v3(-3, 9, 0)));
        assert_false(sees(&f, left, scatter_v3(1e6f, 0, 0))); /* a directional light */
        assert_true(sees(&f, left, scatter_v3(-1e6f, 0, 0)));
        scene_free(&f);
    }
    assert_int_equal(parse_shapes(&f, "plane 1 0 0 0 1 1 1\n"), 0);
    assert_true(!sees(&f, left, right) && sees(&f, left, scatter_v3(-1, 5, 5)));
    assert_true(sees(&f, centre, left) &&
                sees(&f, centre, right)); /* a thin sheet, lit from both sides */
    scene_free(&f);
    assert_int_equal(parse_shapes(&f, "box 0 -1 -1 0 1 1 1 1 1\n"), 0);
    assert_true(!sees(&f, left, right) && sees(&f, centre, left) && sees(&f, centre, right));
    assert_true(sees(&f, left, scatter_v3(3, 5, 0)));
    scene_free(&f);
}

/* Segments between random points off the surfaces, against 4000 probes on each: a probe inside a
   solid that does not hold both ends, or probes on both sides of a plane, mean that the segment is
   blocked. A segment that is blocked for less than 1/4000 of its length may escape the probes, so
   only that way round is asserted exactly; the other way may differ in few cases. */
static int probes_are_blocked(const scene_shape *s, const double *p, const double *q) {
    int inside = 0, outside = 0;
    for (int i = 0; i <= 4000; i++) {
        double x[3], t = i / 4000.0;
        for (int k = 0; k < 3; k++)
            x[k] = p[k] + t * (q[k] - p[k]);
        double depth = s->kind == SCENE_PLANE ? scene_plane_distance(s, x) : scene_depth(s, x);
        inside += depth > 0;
        outside += depth <= 0;
    }
    return inside && outside;
}

static void shadows_agree_with_probes(void **state) {
    scene_file f;
    int unproved = 0, blocked = 0;
    (void)state;
    assert_int_equal(
        parse_shapes(&f,
                     "box -1 -0.5 -2 0.5 1 1 1 1 1\nsphere 1 1 1 0.8 1 1 1\nplane 1 2 3 1 1 1 1"),
        0);
    f.shape_count = 1;
    for (int i = 0; i < 6000; i++) {
        scene_shape shape = f.shapes[0];
        scatter_vec3 a = random_point(2), b = random_point(2);
        double p[3], q[3];
        scene_doubles(a, p);
        scene_doubles(b, q);
        int expected = probes_are_blocked(&shape, p, q), visible = sees(&f, a, b);
        blocked += expected;
        assert_false(expected && visible);
        unproved += !expected && !visible;
        f.shapes[0] = f.shapes[1 + i % 2]; /* all three in turn */
        f.shapes[1 + i % 2] = shape;
    }
    assert_true(blocked > 1000 && unproved < 20);
    f.shape_count = 3;
    scene_free(&f);
}

/* How many of the points where rays from `eye` meet a convex shape do not see the eye's side:
   shadow acne. */
static int acne(scene_file *f, double distance, double push) {
    int wrong = 0;
    for (int i = 0; i < 20000; i++) {
        scatter_vec3 target = random_point(1), eye = random_point(1), light = random_point(3);
        float scale =
            (float)(distance / sqrt((double)(eye.x * eye.x + eye.y * eye.y + eye.z * eye.z)));
        scatter_surface hit;
        f->eye = scatter_v3(eye.x * scale, eye.y * scale, eye.z * scale);
        double d[3] = {(double)(target.x - f->eye.x), (double)(target.y - f->eye.y),
                       (double)(target.z - f->eye.z)};
        double length = sqrt(scene_dot(d, d));
        scatter_vec3 u =
            scatter_v3((float)(d[0] / length), (float)(d[1] / length), (float)(d[2] / length));
        if (!scene_surface(f, f->eye, u, &hit))
            continue;
        float t = hit.distance + (float)push;
        scatter_vec3 p = scatter_v3(f->eye.x + t * u.x, f->eye.y + t * u.y, f->eye.z + t * u.z);
        float side = hit.normal.x * (light.x - p.x) + hit.normal.y * (light.y - p.y) +
                     hit.normal.z * (light.z - p.z);
        wrong += side > 0.01f && !scene_visible(f, p, light);
    }
    return wrong;
}

static void lit_surfaces_do_not_shadow_themselves(void **state) {
    static const char *const shapes[] = {
        "box -1 -0.7 -0.9 0.8 1 1.1 1 1 1\n", "sphere 0.1 0.2 -0.1 0.9 1 1 1\n",
        "plane 1 2 3 0.3 1 1 1\n", "box -1 0.1 -1 1 0.1 1 1 1 1\n"};
    (void)state;
    for (size_t i = 0; i < COUNT(shapes); i++) {
        scene_file f;
        assert_int_equal(parse_shapes(&f, shapes[i]), 0);
        for (double distance = 2; distance < 3e4; distance *= 10)
            assert_int_equal(acne(&f, distance, 0), 0);
        assert_true(acne(&f, 5, 0.01) > 100); /* planted: points a centimetre below the surface */
        scene_free(&f);
    }
}

/* ------------------------------------------------------------------------------------- >>files */

static void pictures_come_back(void **state) {
    float rgb[3 * 2 * 3] = {0, 1, -1, 1e38f, 1e-38f, 0.1f, 3,  4,  5,
                            6, 7, 8,  9,     10,     11,   12, 13, 1e-45f};
    file_picture out = {rgb, 3, 2}, in;
    file_error error;
    (void)state;
    make_directory();
    const char *path = in_directory(0, "a.pfm");
    assert_int_equal(file_pfm_write(path, &out, &error), 0);
    assert_int_equal(file_pfm_read(path, &in, &error), 0);
    assert_true(in.width == 3 && in.height == 2 && memcmp(in.rgb, rgb, sizeof rgb) == 0);
    free(in.rgb);
    unlink(path);
    remove_directory();
    /* one pixel by hand: 1.0f is 3f800000; the bottom row comes first */
    static const char big[] =
        "PF 1\n2\t1.0\n\x3f\x80\0\0\0\0\0\0\0\0\0\0\0\0\0\0\x3f\x80\0\0\0\0\0\0";
    assert_int_equal(file_pfm_parse(big, sizeof big - 1, "big", &in, &error), 0);
    assert_true(is_vec3(scatter_v3(in.rgb[0], in.rgb[1], in.rgb[2]), 0, 1, 0));
    assert_true(is_vec3(scatter_v3(in.rgb[3], in.rgb[4], in.rgb[5]), 1, 0, 0));
    free(in.rgb);
}

/* Whether every shorter text, and one byte more, is refused; each cut has a block of memory of its
   own. */
typedef int (*parser)(const char *data, size_t bytes);
static int cuts_are_refused(const char *data, size_t bytes, parser parse_cut) {
    int refused_all = 1;
    for (size_t cut = 0; cut <= bytes + 1; cut++) {
        char *copy = (char *)calloc(cut + 1, 1);
        memcpy(copy, data, cut < bytes ? cut : bytes);
        char *exact = (char *)realloc(copy, cut ? cut : 1);
        int failed = parse_cut(exact, cut);
        free(exact);
        refused_all &= cut == bytes ? !failed : failed;
    }
    return refused_all;
}

static int parse_pfm(const char *data, size_t bytes) {
    file_picture in;
    file_error error;
    int failed = file_pfm_parse(data, bytes, "cut", &in, &error);
    if (failed && (in.rgb || strncmp(error.text, "cut: expected", 13) != 0))
        return 0;
    free(in.rgb);
    return failed;
}

static int parse_anything(const char *data, size_t bytes) {
    return parse_pfm(data, bytes) && bytes != 20; /* planted: does not mind one of the cuts */
}

static void wrong_pictures_are_refused(void **state) {
    static const char good[] = "PF\n1 2\n-1.0\n123456781234567812345678";
    static const char *const bad[] = {
        "Pf\n1 1\n-1\n1234",           "PF\n0 1\n-1\n",
        "PF\n1 1\n0\n123456781234",    "PF\n1.5 1\n-1\n123456781234",
        "PF\n-1 -1\n-1\n123456781234", "PF\n1e9 1e9\n-1\n123456781234",
        "PF\n1 1\nx\n123456781234",    "P6\n1 1\n255\n123",
        "PF1 1\n-1\n123456781234",     "PF\n1 1\n-1\n\377\377\377\17712345678"};
    (void)state;
    assert_true(cuts_are_refused(good, sizeof good - 1, parse_pfm));
    assert_false(cuts_are_refused(good, sizeof good - 1, parse_anything));
    for (size_t i = 0; i < COUNT(bad); i++)
        assert_int_equal(parse_pfm(bad[i], strlen(bad[i])), 1);
}

static void pictures_are_written(void **state) {
    float rgb[3] = {1, 2, 3};
    unsigned char bytes[3] = {1, 2, 3};
    file_picture picture = {rgb, 1, 1};
    file_error error;
    char *data;
    size_t size;
    (void)state;
    make_directory();
    const char *png = in_directory(0, "a.png"), *hdr = in_directory(1, "a.hdr"),
               *no = in_directory(2, "no/a.hdr");
    assert_int_equal(file_png_write(png, bytes, 1, 1, &error), 0);
    assert_int_equal(file_hdr_write(hdr, &picture, &error), 0);
    assert_int_equal(file_read(png, SIZE_MAX, &data, &size, &error), 0);
    assert_true(size > 8 && memcmp(data, "\x89PNG\r\n\x1a\n", 8) == 0);
    free(data);
    assert_int_equal(file_read(hdr, SIZE_MAX, &data, &size, &error), 0);
    assert_true(size > 10 && memcmp(data, "#?RADIANCE", 10) == 0);
    free(data);
    assert_int_equal(file_hdr_write(no, &picture, &error), 1);
    assert_true(strstr(error.text, "cannot be created") != NULL);
    unlink(png);
    unlink(hdr);
    remove_directory();
    if (access("/dev/full", W_OK) == 0) { /* a full disk */
        assert_int_equal(file_pfm_write("/dev/full", &picture, &error), 1);
        assert_int_equal(file_hdr_write("/dev/full", &picture, &error), 1);
        assert_int_equal(file_png_write("/dev/full", bytes, 1, 1, &error), 1);
        assert_true(strstr(error.text, "cannot be written completely") != NULL);
    }
}

/* --------------------------------------------------------------------------------------- >>hdr */

#define HDR_HEAD "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n"

/* 2 x 1 pixel by pixel: 1 0.5 0.25, for 2^(129 - 136) is 1/128; exponent 0 is black. */
static const char hdr_plain[] = HDR_HEAD "-Y 1 +X 2\n\x80\x40\x20\x81\x09\x09\x09\0";
/* 8 x 1 in runs: red 1 and then 7 times 2, green 8 times 3, blue in bytes 0 to 7, exponents 136. */
static const char hdr_runs[] = HDR_HEAD "-Y 1 +X 8\n\x02\x02\0\x08\x01\x01\x87\x02\x88\x03\x08"
                                        "\0\x01\x02\x03\x04\x05\x06\x07\x88\x88";

static int parse_hdr(const char *data, size_t bytes) {
    file_picture in;
    file_error error;
    int failed = file_hdr_parse(data, bytes, "cut", &in, &error);
    if (failed && (in.rgb || strncmp(error.text, "cut: ", 5) != 0))
        return 0;
    free(in.rgb);
    return failed;
}

static void hdr_pixels_arrive(void **state) {
    file_picture in;
    file_error error;
    (void)state;
    assert_int_equal(file_hdr_parse(hdr_plain, sizeof hdr_plain - 1, "x", &in, &error), 0);
    assert_true(in.width == 2 && in.height == 1);
    assert_true(is_vec3(scatter_v3(in.rgb[0], in.rgb[1], in.rgb[2]), 1, 0.5, 0.25));
    assert_true(is_vec3(scatter_v3(in.rgb[3], in.rgb[4], in.rgb[5]), 0, 0, 0));
    free(in.rgb);
    assert_int_equal(file_hdr_parse(hdr_runs, sizeof hdr_runs - 1, "x", &in, &error), 0);
    assert_int_equal(in.width, 8);
    for (int x = 0; x < 8; x++)
        assert_true(is_vec3(scatter_v3(in.rgb[3 * x], in.rgb[3 * x + 1], in.rgb[3 * x + 2]),
                            x ? 2 : 1, 3, x));
    free(in.rgb);
    static const char exposed[] = "#?RGBE\r\n# x\r\nEXPOSURE=2\r\nFORMAT=32-bit_rle_rgbe\r\n"
                                  "EXPOSURE= 4\r\n\r\n-Y 1 +X 1\r\n\x80\x40\x20\x84";
    assert_int_equal(file_hdr_parse(exposed, sizeof exposed - 1, "x", &in, &error), 0);
    assert_true(is_vec3(scatter_v3(in.rgb[0], in.rgb[1], in.rgb[2]), 1, 0.5, 0.25));
    free(in.rgb);
}

/* Every cut is refused; a byte more is not, for other programs do not mind it either. */
static void wrong_hdr_is_refused(void **state) {
    static const char *const bad[] = {
        "#?RADIANCE\n\n-Y 1 +X 1\n1234",
        "#?RADIANCE\nFORMAT=32-bit_rle_xyze\n\n-Y 1 +X 1\n1234",
        "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n-Y 1 +X 1\n1234",
        "RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 1\n1234",
        "#?RADIANCE\nEXPOSURE=0\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 1\n1234",
        "#?RADIANCE\nEXPOSURE=x\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 1\n1234",
        HDR_HEAD "+Y 1 +X 1\n1234",
        HDR_HEAD "-Y 1 -X 1\n1234",
        HDR_HEAD "+X 1 -Y 1\n1234",
        HDR_HEAD "-Y 0 +X 1\n1234",
        HDR_HEAD "-Y 1 +X 0\n1234",
        HDR_HEAD "-Y 1.5 +X 1\n1234",
        HDR_HEAD "-Y -1 +X -1\n1234",
        HDR_HEAD "-Y 1 +X 1 \n1234",
        HDR_HEAD "-Y 1000000 +X 1000000\n1234",
        "#?RADIANCE\nEXPOSURE=0.1\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 1\n\xff\xff\xff\xff",
    };
    (void)state;
    for (size_t i = 0; i < COUNT(bad); i++)
        assert_int_equal(parse_hdr(bad[i], strlen(bad[i])), 1);
    for (size_t cut = 0; cut < sizeof hdr_runs - 1; cut++) {
        char *copy = (char *)malloc(cut ? cut : 1);
        memcpy(copy, hdr_runs, cut);
        assert_int_equal(parse_hdr(copy, cut), 1);
        free(copy);
        if (cut < sizeof hdr_plain - 1)
            assert_int_equal(parse_hdr(hdr_plain, cut), 1);
    }
    assert_int_equal(parse_hdr(hdr_runs, sizeof hdr_runs), 0);
    char damaged[sizeof hdr_runs];
    memcpy(damaged, hdr_runs, sizeof damaged);
    damaged[sizeof HDR_HEAD - 1 + 10 + 3] = 9; /* a row of nine pixels */
    assert_int_equal(parse_hdr(damaged, sizeof damaged), 1);
    memcpy(damaged, hdr_runs, sizeof damaged);
    damaged[sizeof damaged - 3] = (char)0x89; /* nine times, of eight */
    assert_int_equal(parse_hdr(damaged, sizeof damaged), 1);
}

/* Whether stb reads the same numbers from this file. */
static int agrees_with_stb(const char *path) {
    file_picture ours;
    file_error error;
    int width, height, channels;
    assert_int_equal(file_hdr_read(path, &ours, &error), 0);
    float *theirs = stbi_loadf(path, &width, &height, &channels, 3);
    assert_true(theirs != NULL);
    size_t bytes = (size_t)ours.width * (size_t)ours.height * 3 * sizeof(float);
    int same = width == ours.width && height == ours.height &&
               memcmp(theirs, ours.rgb, bytes) == 0;
    ours.rgb[bytes / 8] += 1e-3f;
    assert_true(memcmp(theirs, ours.rgb, bytes) != 0); /* planted: one number differs */
    stbi_image_free(theirs);
    free(ours.rgb);
    return same;
}

static void hdr_agrees_with_stb(void **state) {
    static const char *const maps[] = {SKIES "venice_sunset_1k.hdr", SKIES "kiara_1_dawn_1k.hdr",
                                       SKIES "studio_small_03_1k.hdr",
                                       SKIES "st_fagans_interior_1k.hdr"};
    static float rgb[300 * 7 * 3];
    file_picture picture = {rgb, 300, 7};
    file_error error;
    (void)state;
    make_directory();
    const char *path = in_directory(0, "a.hdr");
    for (size_t i = 0; i < COUNT(rgb); i++)
        rgb[i] = (float)(i / 600 % 2 ? exp(between(-30, 30)) : 1); /* rows of noise, and of runs */
    for (picture.width = 300; picture.width > 4; picture.width -= 59) {
        assert_int_equal(file_hdr_write(path, &picture, &error), 0);
        assert_true(agrees_with_stb(path));
    }
    unlink(path);
    remove_directory();
    for (size_t i = 0; i < COUNT(maps); i++)
        if (access(maps[i], R_OK) == 0)
            assert_true(agrees_with_stb(maps[i]));
        else
            printf("skipped: no data (%s)\n", maps[i]);
}

/* ------------------------------------------------------------------------------------- >>grids */

static void raw_grids_are_read(void **state) {
    static const unsigned char bytes[7] = {0, 51, 102, 153, 204, 255, 1};
    file_grid grid;
    file_error error;
    (void)state;
    make_directory();
    const char *path = in_directory(0, "a_b_3x1x2_u8.raw");
    for (size_t count = 0; count <= 7; count++) {
        write_file(path, bytes, count);
        assert_int_equal(file_grid_read(path, &grid, &error), count != 6);
        if (count == 6) {
            assert_true(grid.nx == 3 && grid.ny == 1 && grid.nz == 2);
            for (int i = 0; i < 6; i++)
                assert_true(fabs((double)grid.density[i] - 0.2 * i) < 1e-7);
            file_grid_free(&grid);
        }
    }
    unlink(path);
    remove_directory();
}

static void wrong_grid_names_are_refused(void **state) {
    static const char *const bad[] = {"a.raw",
                                      "3x1x2_u8.raw",
                                      "_u8.raw",
                                      "_0x1x1_u8.raw",
                                      "_1x1_u8.raw",
                                      "_1x1x1x1_u8.raw",
                                      "_-1x1x1_u8.raw",
                                      "_1x1x1_u16.raw",
                                      "_x1x1_u8.raw",
                                      "_99999999999999999999x1x1_u8.raw",
                                      "_1x1x1_u8.RAW",
                                      "",
                                      "a"};
    file_grid grid;
    file_error error;
    (void)state;
    for (size_t i = 0; i < COUNT(bad); i++) {
        assert_int_equal(file_grid_read(bad[i], &grid, &error), 1);
        assert_true(strstr(error.text, "expected a") != NULL && grid.density == NULL);
    }
    assert_int_equal(file_grid_read("_2147483647x2147483647x2147483647_u8.raw", &grid, &error), 1);
    assert_true(strstr(error.text, "expected at most") !=
                NULL); /* the product, before any memory is asked for */
}

/* Voxels of a scene's grid, relative to the scene file; SCALE 0 is no density, not the default of
   1. */
static void scenes_find_their_grids(void **state) {
    static const unsigned char bytes[2] = {255, 0};
    char text[400];
    scene_file f;
    (void)state;
    make_directory();
    const char *grid = in_directory(0, "g_2x1x1_u8.raw"), *scene = in_directory(1, "s.scatter");
    write_file(grid, bytes, 2);
    for (int scale = 0; scale < 4; scale += 3) {
        int length =
            snprintf(text, sizeof text, "%sgrid g_2x1x1_u8.raw 0 0 0 2 1 1 %d", PRELUDE, scale);
        write_file(scene, text, (size_t)length);
        assert_int_equal(scene_read(&f, scene), 0);
        float expected = (float)scale;
        assert_true(fabsf(scatter_density(&f.scene.medium, scatter_v3(0.5f, 0.5f, 0.5f)) -
                          expected) < 1e-5f);
        scene_free(&f);
    }
    int length = snprintf(text, sizeof text, "%sgrid %s 0 0 0 2 1 1 1", PRELUDE,
                          grid); /* an absolute path */
    write_file(scene, text, (size_t)length);
    assert_int_equal(scene_read(&f, scene), 0);
    scene_free(&f);
    unlink(grid);
    assert_int_equal(scene_read(&f, scene), 1);
    assert_true(strstr(f.error, "s.scatter:4: ") != NULL &&
                strstr(f.error, "g_2x1x1_u8.raw: cannot be opened"));
    unlink(scene);
    remove_directory();
}

/* --------------------------------------------------------------------------------------- >>vol */

static int parse_vol(const char *data, size_t bytes) {
    file_grid grid;
    file_error error;
    int failed = file_vol_parse(data, bytes, "cut", &grid, &error);
    if (failed && (grid.density || strncmp(error.text, "cut: expected", 13) != 0))
        return 0;
    file_grid_free(&grid);
    return failed;
}

static void text_grids_are_read(void **state) {
    static const char good[] = " 3\n1 2\n0 1 2\t3\r\n4 5";
    static const char *const bad[] = {"",          "1 1",          "0 1 1 1",      "1.5 1 1 1 1",
                                      "1 1 1 -1",  "1 1 1 x",      "1 1 1 nan",    "1 1 1 1 1",
                                      "1 1 1 1 x", "2 1 1 1    ", "1 1 1 1e300", "1000000 9 9 1"};
    file_grid grid;
    file_error error;
    (void)state;
    assert_int_equal(file_vol_parse(good, sizeof good - 1, "x", &grid, &error), 0);
    assert_true(grid.nx == 3 && grid.ny == 1 && grid.nz == 2);
    for (int i = 0; i < 6; i++)
        assert_true(fabs((double)grid.density[i] - i) < 1e-7);
    file_grid_free(&grid);
    for (size_t i = 0; i < COUNT(bad); i++)
        assert_int_equal(parse_vol(bad[i], strlen(bad[i])), 1);
    assert_true(cuts_are_refused(good, sizeof good - 1, parse_vol));
    if (file_grid_read(VOLUMES "ispc_smoke_48x64x48.vol.txt", &grid, &error)) {
        printf("skipped: no data\n");
        skip();
    }
    assert_true(grid.nx == 48 && grid.ny == 64 && grid.nz == 48);
    file_grid_free(&grid);
}

/* -------------------------------------------------------------------------------------- >>nvdb */

/* A NanoVDB file of one leaf, written by hand: voxels 0..2 x 0..1 x 0..1 hold 1 + x + 10 y + 100 z.
   */
enum {
    NVDB_NAME = 16 + 176,
    NVDB_GRID = NVDB_NAME + 8,
    NVDB_ROOT = PNANOVDB_GRID_SIZE + PNANOVDB_TREE_SIZE,
    NVDB_UPPER = NVDB_ROOT + 64 + 32,
    NVDB_LOWER = NVDB_UPPER + 270400,
    NVDB_LEAF = NVDB_LOWER + 33856,
    NVDB_BYTES = NVDB_LEAF + 2144
};
static char nvdb[NVDB_GRID + NVDB_BYTES];

static void put_u32(size_t at, uint32_t value) {
    for (size_t i = 0; i < 4; i++)
        nvdb[at + i] = (char)(value >> (8 * i) & 255);
}

static void put_u64(size_t at, uint64_t value) {
    put_u32(at, (uint32_t)(value & 0xffffffffu));
    put_u32(at + 4, (uint32_t)(value >> 32));
}

static void put_float(size_t at, float value) {
    uint32_t bits;
    memcpy(&bits, &value, 4);
    put_u32(at, bits);
}

static void build_nvdb_tree(void) {
    put_u64(NVDB_GRID + PNANOVDB_GRID_SIZE + PNANOVDB_TREE_OFF_NODE_OFFSET_ROOT,
            PNANOVDB_TREE_SIZE);
    put_u32(NVDB_GRID + NVDB_ROOT + 12, 2); /* bounding box 0 0 0 ... 2 1 1 */
    put_u32(NVDB_GRID + NVDB_ROOT + 16, 1);
    put_u32(NVDB_GRID + NVDB_ROOT + 20, 1);
    put_u32(NVDB_GRID + NVDB_ROOT + PNANOVDB_ROOT_OFF_TABLE_SIZE, 1);
    put_u64(NVDB_GRID + NVDB_ROOT + 64 + PNANOVDB_ROOT_TILE_OFF_CHILD, NVDB_UPPER - NVDB_ROOT);
    put_u32(NVDB_GRID + NVDB_UPPER + PNANOVDB_UPPER_OFF_CHILD_MASK, 1);
    put_u64(NVDB_GRID + NVDB_UPPER + 8256, NVDB_LOWER - NVDB_UPPER);
    put_u32(NVDB_GRID + NVDB_LOWER + PNANOVDB_LOWER_OFF_CHILD_MASK, 1);
    put_u64(NVDB_GRID + NVDB_LOWER + 1088, NVDB_LEAF - NVDB_LOWER);
    for (uint32_t x = 0; x < 3; x++)
        for (uint32_t y = 0; y < 2; y++)
            for (uint32_t z = 0; z < 2; z++)
                put_float(NVDB_GRID + NVDB_LEAF + 96 + 4 * (64 * x + 8 * y + z),
                          (float)(1 + x + 10 * y + 100 * z));
}

static void build_nvdb(void) {
    memset(nvdb, 0, sizeof nvdb);
    put_u64(0, PNANOVDB_MAGIC_NUMBER);
    put_u32(8, (uint32_t)PNANOVDB_MAJOR_VERSION_NUMBER << 21);
    put_u32(12, 1); /* one grid, not compressed */
    put_u64(16, NVDB_BYTES);
    put_u64(16 + 8, NVDB_BYTES);
    put_u32(16 + 136, 8);
    memcpy(nvdb + NVDB_NAME, "density", 8);
    put_u64(NVDB_GRID, PNANOVDB_MAGIC_NUMBER);
    put_u32(NVDB_GRID + PNANOVDB_GRID_OFF_VERSION, (uint32_t)PNANOVDB_MAJOR_VERSION_NUMBER << 21);
    put_u32(NVDB_GRID + PNANOVDB_GRID_OFF_GRID_TYPE, PNANOVDB_GRID_TYPE_FLOAT);
    build_nvdb_tree();
}

/* 0 and all voxels right, or an error. */
static int parse_nvdb(const char *data, size_t bytes) {
    file_grid grid;
    file_error error;
    if (file_nvdb_parse(data, bytes, "cut", &grid, &error))
        return 1;
    int right = grid.nx == 3 && grid.ny == 2 && grid.nz == 2;
    for (int i = 0; right && i < 12; i++) /* x fastest */
        right =
            fabs((double)grid.density[i] - (1 + i % 3 + 10 * (i / 3 % 2) + 100 * (i / 6))) < 1e-6;
    file_grid_free(&grid);
    return !right;
}

static void nanovdb_grids_are_read(void **state) {
    (void)state;
    build_nvdb();
    assert_int_equal(parse_nvdb(nvdb, sizeof nvdb), 0);
    put_float(NVDB_GRID + NVDB_LEAF + 96, 2);
    assert_int_equal(parse_nvdb(nvdb, sizeof nvdb), 1); /* planted: one voxel is wrong */
    put_float(NVDB_GRID + NVDB_LEAF + 96, -1);
    assert_int_equal(parse_nvdb(nvdb, sizeof nvdb), 1); /* a negative density */
}

static void cut_nanovdb_is_refused(void **state) {
    (void)state;
    build_nvdb();
    for (size_t cut = 0; cut < sizeof nvdb;
         cut += cut < 2000 || cut + 2000 > sizeof nvdb ? 1 : 997) {
        char *copy = (char *)malloc(cut ? cut : 1);
        memcpy(copy, nvdb, cut);
        assert_int_equal(parse_nvdb(copy, cut), 1);
        free(copy);
    }
}

/* One damaged field at a time, with what must be said. */
static void damaged_nanovdb_is_refused(void **state) {
    static const struct {
        size_t at;
        uint32_t value;
        const char *words;
    } damage[] = {
        {0, 0, "NanoVDB file"},
        {8, 0xffffffffu, "version"},
        {12, 0, "truncated"},
        {12, 2, "truncated"},
        {16 + 136, 0, "truncated"},
        {16 + 136, 0xffffffffu, "truncated"},
        {16 + 8, 0xffffffffu, "truncated"},
        {16 + 12, 0xffffffffu, "truncated"},
        {16 + 8, 600, "version"}, /* a grid shorter than its own header */
        {16 + 168, 1, "compressed"},
        {NVDB_GRID, 0, "version"},
        {NVDB_GRID + PNANOVDB_GRID_OFF_GRID_TYPE, 2, "type float"},
        {NVDB_GRID + PNANOVDB_GRID_OFF_GRID_TYPE, 0xffffffffu, "type float"},
        {NVDB_GRID + PNANOVDB_GRID_SIZE + 24, 0xfffffff0u, "points outside"},
        {NVDB_GRID + NVDB_ROOT + 24, 0xffffffffu, "points outside"},
        {NVDB_GRID + NVDB_ROOT, 3, "active voxels"},
        {NVDB_GRID + NVDB_ROOT + 12, 0x7fffffffu, "at most"},
        {NVDB_GRID + NVDB_ROOT, 0x80000000u, "at most"},
        {NVDB_GRID + NVDB_ROOT + 64 + 8, 0x7ffffff0u, "finite density"},
        {NVDB_GRID + NVDB_UPPER + 8256 + 4, 0x7fffffffu, "finite density"},
        {NVDB_GRID + NVDB_LOWER + 1088, 0xffffff00u, "finite density"},
        {NVDB_GRID + NVDB_LOWER + 1088, 3, "finite density"},
        {NVDB_GRID + NVDB_LEAF + 96, 0x7fc00000u, "finite density"},
    };
    (void)state;
    for (size_t i = 0; i < COUNT(damage); i++) {
        file_grid grid;
        file_error error;
        build_nvdb();
        put_u32(damage[i].at, damage[i].value);
        assert_int_equal(file_nvdb_parse(nvdb, sizeof nvdb, "x", &grid, &error), 1);
        if (!strstr(error.text, damage[i].words))
            fprintf(stderr, "case %d: %s\n", (int)i, error.text);
        assert_true(strstr(error.text, damage[i].words) != NULL);
    }
}

/* A leaf of FpN says itself how many bits its values have: 1 << 4 at most; 1 << 5 would fit into
   the file. */
static void leaves_of_too_many_bits_are_refused(void **state) {
    file_grid grid;
    file_error error;
    (void)state;
    for (uint32_t log2 = 0; log2 < 8; log2++) {
        build_nvdb();
        put_u32(NVDB_GRID + PNANOVDB_GRID_OFF_GRID_TYPE, PNANOVDB_GRID_TYPE_FPN);
        put_u32(NVDB_GRID + NVDB_LEAF + 12, log2 << 29);
        assert_int_equal(file_nvdb_parse(nvdb, sizeof nvdb, "x", &grid, &error), log2 > 4);
        file_grid_free(&grid);
    }
}

/* Random damage, all grid types: whatever is accepted has finite voxels. */
static void noisy_nanovdb_does_no_harm(void **state) {
    (void)state;
    for (int i = 0; i < 3000; i++) {
        build_nvdb();
        put_u32(NVDB_GRID + PNANOVDB_GRID_OFF_GRID_TYPE, i % 5 ? 12 + (uint32_t)(i % 5) : 1);
        for (int k = 0; k < 3; k++) {
            static const size_t places[] = {0,
                                            NVDB_GRID,
                                            NVDB_GRID + NVDB_ROOT,
                                            NVDB_GRID + NVDB_UPPER,
                                            NVDB_GRID + NVDB_LOWER,
                                            NVDB_GRID + NVDB_LEAF};
            size_t at = places[(size_t)between(0, 6)] + (size_t)between(0, 200);
            nvdb[at] = (char)(signed char)between(-128, 128);
        }
        file_grid grid;
        file_error error;
        if (file_nvdb_parse(nvdb, sizeof nvdb, "x", &grid, &error))
            continue;
        for (int v = 0; v < grid.nx * grid.ny * grid.nz; v++)
            assert_true(isfinite(grid.density[v]) && grid.density[v] >= 0);
        file_grid_free(&grid);
    }
}

/* --------------------------------------------------------------------------------------- >>vdb */

/* An OpenVDB file without grids. */
static size_t build_vdb(char *vdb) {
    memset(vdb, 0, 65);
    memcpy(vdb, " BDV", 4);
    vdb[8] = (char)224;
    vdb[20] = 1;
    return 65;
}

/* Reads a .vdb with another PATH and TMPDIR; nothing may be left in TMPDIR. */
static int read_vdb_in(const char *path, const char *search, const char *temporary,
                       file_error *error) {
    char before[4096], place[4096];
    file_grid grid;
    const char *old_path = getenv("PATH"), *old_place = getenv("TMPDIR");
    snprintf(before, sizeof before, "%s", old_path ? old_path : "");
    snprintf(place, sizeof place, "%s", old_place ? old_place : "/tmp");
    assert_int_equal(mkdir(temporary, 0700), 0);
    assert_int_equal(setenv("PATH", search ? search : before, 1), 0);
    assert_int_equal(setenv("TMPDIR", temporary, 1), 0);
    int failed = file_grid_read(path, &grid, error);
    file_grid_free(&grid);
    assert_int_equal(setenv("PATH", before, 1), 0);
    assert_int_equal(setenv("TMPDIR", place, 1), 0);
    assert_int_equal(rmdir(temporary), 0);
    return failed;
}

static void vdb_needs_its_tool(void **state) {
    char vdb[65];
    file_error error;
    (void)state;
    make_directory();
    const char *file = in_directory(0, "a.vdb"), *nothing = in_directory(1, "nothing");
    write_file(file, vdb, build_vdb(vdb));
    assert_int_equal(read_vdb_in(file, nothing, nothing, &error), 1);
    assert_true(strstr(error.text, "libnanovdb-tools") != NULL);
    unlink(file);
    const char *cloud = VOLUMES "wdas_cloud_sixteenth.vdb";
    if (access(cloud, R_OK) == 0)
        assert_int_equal(read_vdb_in(cloud, NULL, nothing, &error), 0);
    remove_directory();
}

static int check_vdb(const char *data, size_t bytes) {
    file_error error;
    return file_vdb_check(data, bytes, "x", &error);
}

static void cut_vdb_is_refused(void **state) {
    char *data, vdb[65];
    size_t bytes;
    file_error error;
    (void)state;
    build_vdb(vdb);
    for (size_t cut = 0; cut < 65; cut++)
        assert_int_equal(check_vdb(vdb, cut), 1);
    assert_int_equal(check_vdb(vdb, 65), 0);
    vdb[20] = 0; /* a stream, which does not say how long it should be */
    assert_int_equal(check_vdb(vdb, 65), 1);
    if (file_read(VOLUMES "wdas_cloud_sixteenth.vdb", SIZE_MAX, &data, &bytes, &error)) {
        printf("skipped: no data\n");
        skip();
    }
    assert_int_equal(check_vdb(data, bytes), 0);
    for (size_t cut = 0; cut < bytes; cut += cut < 2000 || cut + 2000 > bytes ? 1 : 9973)
        assert_int_equal(check_vdb(data, cut), 1);
    free(data);
}

/* Largest difference of two grids of the same size, or -1. */
static double grid_difference(const file_grid *a, const file_grid *b) {
    double largest = 0;
    if (a->nx != b->nx || a->ny != b->ny || a->nz != b->nz)
        return -1;
    for (int i = 0; i < a->nx * a->ny * a->nz; i++)
        largest = fmax(largest, fabs((double)a->density[i] - (double)b->density[i]));
    return largest;
}

/* The cloud as .vdb and, made from it by others, as bytes: the same axes and corner; half of 1/255
   apart, for the bytes are rounded (and a float error more). */
static void vdb_agrees_with_raw(void **state) {
    file_grid vdb, raw;
    file_error error;
    (void)state;
    if (file_grid_read(VOLUMES "wdas_cloud_sixteenth_126x86x154_u8.raw", &raw, &error) ||
        !getenv("PATH")) {
        printf("skipped: no data\n");
        skip();
    }
    int failed = file_grid_read(VOLUMES "wdas_cloud_sixteenth.vdb", &vdb, &error);
    if (failed)
        fprintf(stderr, "%s\n", error.text);
    assert_int_equal(failed, 0);
    double difference = grid_difference(&vdb, &raw);
    assert_true(difference >= 0 && difference < 0.5 / 255 + 1e-6);
    memmove(raw.density, raw.density + 1, (size_t)(raw.nx * raw.ny * raw.nz - 1) * sizeof(float));
    assert_true(grid_difference(&vdb, &raw) > 0.1); /* planted: one voxel aside */
    file_grid_free(&vdb);
    file_grid_free(&raw);
}

/* ------------------------------------------------------------------------------------- >>skies */

enum { SKY_WIDTH = 4, SKY_HEIGHT = 2 }; /* stb writes rows of less than 8 pixels without runs */

/* A scene beside a sky of these pixels; 0 if it could be read. */
static int read_sky(scene_file *f, float *rgb, const char *line) {
    char text[400];
    file_picture sky = {rgb, SKY_WIDTH, SKY_HEIGHT};
    file_error error;
    make_directory();
    const char *map = in_directory(0, "sky.hdr"), *scene = in_directory(1, "s.scatter");
    assert_int_equal(file_hdr_write(map, &sky, &error), 0);
    int length = snprintf(text, sizeof text, "%s%s\n", PRELUDE, line);
    write_file(scene, text, (size_t)length);
    int failed = scene_read(f, scene);
    unlink(map);
    unlink(scene);
    remove_directory();
    return failed;
}

/* How far the sum of the lights is from the integral of the radiance, relative. A row of this sky
   covers half of the sphere. */
static double energy_error(const scene_file *f, const float *rgb, double scale) {
    double texel = 2 * 3.14159265358979 / SKY_WIDTH, error = 0;
    for (int c = 0; c < 3; c++) {
        double expected = 0, sum = 0;
        for (int i = 0; i < SKY_WIDTH * SKY_HEIGHT; i++)
            expected += scale * texel * (double)rgb[3 * i + c];
        for (size_t i = f->skies[0].first; i < f->skies[0].first + f->skies[0].count; i++) {
            const scatter_vec3 *e = &f->lights[i].intensity;
            sum += (double)(c == 0 ? e->x : c == 1 ? e->y : e->z);
        }
        error = fmax(error, fabs(sum / expected - 1));
    }
    return error;
}

/* Values that RGBE holds exactly; 1e-5 for sums of floats. */
static void skies_become_lights(void **state) {
    static float rgb[SKY_WIDTH * SKY_HEIGHT * 3];
    char line[100];
    scene_file f;
    (void)state;
    for (int i = 0; i < (int)COUNT(rgb); i++)
        rgb[i] = (float)(1 + i * 7 % 5);
    for (int count = 1; count <= 256; count = count * 3 + 1) {
        snprintf(line, sizeof line,
                 "light point 0 9 0 1 1 1\nlight environment sky.hdr 2.5 %d\n"
                 "light point 0 9 0 1 1 1",
                 count);
        assert_int_equal(read_sky(&f, rgb, line), 0);
        assert_true(f.sky_count == 1 && f.skies[0].first == 1);
        assert_int_equal(f.skies[0].count, count);
        assert_int_equal(f.scene.light_count, count + 2);
        for (int i = 1; i <= count; i++)
            assert_int_equal(f.lights[i].kind, SCATTER_LIGHT_DIRECTIONAL);
        assert_true(energy_error(&f, rgb, 2.5) < 1e-5);
        f.skies[0].first = 0;
        assert_true(energy_error(&f, rgb, 2.5) > 1e-5); /* planted: one light is another */
        assert_true(f.skies[0].map.width == SKY_WIDTH && is_vec3(f.scene.background, 0, 0, 0));
        scene_free(&f);
    }
}

/* White around +z and black around -z: what is seen goes with the lights. */
static void check_turned_look(const scene_file *f) {
    for (int degrees = -360; degrees <= 360; degrees += 45) {
        double a = degrees * 3.14159265358979 / 180;
        scatter_vec3 d = scatter_v3((float)sin(a), 0.3f, (float)cos(a));
        assert_true(is_vec3(scene_sky_radiance(f, (float)degrees, d), 1, 1, 1));
        d.x = -d.x, d.z = -d.z;
        assert_true(is_vec3(scene_sky_radiance(f, (float)degrees, d), 0, 0, 0));
    }
}

/* Light from +z, which a turn by 90 degrees brings to +x, and a lamp that stays. */
static void skies_turn(void **state) {
    static float rgb[SKY_WIDTH * SKY_HEIGHT * 3]; /* columns: +z to -x, -x to -z, -z to +x, ... */
    scatter_light turned[2];
    scene_file f;
    (void)state;
    for (int row = 0; row < SKY_HEIGHT; row++)
        for (int c = 0; c < 3; c++) /* the two columns beside +z */
            rgb[row * 12 + c] = rgb[row * 12 + 9 + c] = 1;
    assert_int_equal(read_sky(&f, rgb, "light spot 0 9 0 0 0 -1 1 2 1 1 1\n"
                                       "light environment sky.hdr 1 1"),
                     0);
    scatter_vec3 d = f.lights[1].direction;
    assert_true(is_vec3(scatter_v3(d.x / d.z, d.y / d.z, 1), 0, 0, 1) && d.z < 0);
    memcpy(turned, f.lights, sizeof turned);
    scene_turn_skies(&f, 90, turned);
    scatter_vec3 t = turned[1].direction;
    assert_true(is_vec3(t, (double)d.z, (double)d.y, 0));
    assert_true(memcmp(turned, f.lights, sizeof *turned) == 0);
    assert_false(is_vec3(t, -(double)d.z, (double)d.y, 0)); /* planted: the other way round */
    scene_turn_skies(&f, 90, f.lights);
    assert_true(memcmp(turned, f.lights, sizeof turned) == 0);
    scene_turn_skies(&f, -720, turned);
    assert_true(memcmp(turned, f.lights, sizeof turned) == 0);
    check_turned_look(&f);
    scene_free(&f);
}

static void wrong_skies_are_refused(void **state) {
    static float rgb[SKY_WIDTH * SKY_HEIGHT * 3];
    scene_file f;
    (void)state;
    assert_int_equal(read_sky(&f, rgb, "light environment sky.hdr 1 3\nlight nothing"), 1);
    assert_true(strstr(f.error, "s.scatter:5: expected 'light point'") != NULL);
    assert_int_equal(read_sky(&f, rgb, "light environment s.scatter 1 3"), 1);
    assert_true(strstr(f.error, "s.scatter:4: ") && strstr(f.error, "ending in .hdr"));
    assert_int_equal(read_sky(&f, rgb, "light environment sky.hdr 1e9 3"), 1); /* the library's */
    assert_true(strstr(f.error, "s.scatter:4: ") && strstr(f.error, "scale"));
    static const char line[] = "light environment sky.hdr 1 3";
    assert_int_equal(scene_parse(&f, line, sizeof line - 1, NULL), 1);
    assert_true(strstr(f.error, "scene:1: ") && strstr(f.error, "from memory"));
    make_directory();
    const char *map = in_directory(0, "cut.hdr"), *scene = in_directory(1, "s.scatter");
    write_file(map, hdr_runs, sizeof hdr_runs - 3);
    write_file(scene, "light environment cut.hdr 1 3", 29);
    assert_int_equal(scene_read(&f, scene), 1);
    assert_true(strstr(f.error, "s.scatter:1: ") && strstr(f.error, "cut.hdr: the file is"));
    unlink(map);
    unlink(scene);
    remove_directory();
}

/* ----------------------------------------------------------------------------------- >>gallery */

static int is_smooth(const char *text) {
    return strstr(text, "\n# smooth") != NULL || strncmp(text, "# smooth", 8) == 0;
}

/* Every scene of the gallery can be read (where its data is there), starts with a comment that says
   why it exists, and is smooth if it says so: no surfaces and no voxels. */
static int check_gallery_scene(const char *path) {
    char *text;
    size_t bytes;
    file_error error;
    scene_file f;
    assert_int_equal(file_read(path, SIZE_MAX, &text, &bytes, &error), 0);
    int smooth = is_smooth(text), commented = text[0] == '#';
    free(text);
    assert_true(commented);
    if (scene_read(&f, path)) {
        fprintf(stderr, "%s\n", f.error);
        assert_true(strstr(f.error, "shared/data") != NULL &&
                    strstr(f.error, "cannot be opened") != NULL);
        return 0;
    }
    assert_true(!smooth || (f.shape_count == 0 && f.scene.medium.grid_count == 0));
    scene_free(&f);
    return smooth;
}

/* How many scenes the folder has; the smooth ones are added to *smooth. */
static int check_gallery(const char *folder, int *smooth) {
    DIR *scenes = opendir(folder);
    struct dirent *entry;
    int count = 0;
    assert_true(scenes != NULL);
    while ((entry = readdir(scenes)) != NULL) {
        char path[400];
        if (!file_ends_with(entry->d_name, ".scatter"))
            continue;
        snprintf(path, sizeof path, "%s/%s", folder, entry->d_name);
        *smooth += check_gallery_scene(path);
        count++;
    }
    closedir(scenes);
    return count;
}

static void gallery_can_be_read(void **state) {
    int smooth = 0;
    (void)state;
    assert_true(check_gallery("examples/scenes", &smooth) >= 12 && smooth >= 5);
    assert_true(check_gallery("examples/skies", &smooth) >= 8);
}

static void names_go_both_ways(void **state) {
    scatter_depth_method depth;
    scatter_ray_method ray;
    scatter_density_method density;
    (void)state;
    for (int i = SCATTER_DEPTH_AUTO; i <= SCATTER_DEPTH_MARCH; i++)
        assert_true(scene_depth_method(scene_depth_name((scatter_depth_method)i), &depth) == 0 &&
                    (int)depth == i);
    assert_true(scene_depth_method("closed-volume", &depth) == 0 &&
                depth == SCATTER_DEPTH_CLOSED_VOLUME);
    assert_true(scene_depth_method("closed volume", &depth) == 1);
    assert_true(scene_ray_method("march", &ray) == 0 && ray == SCATTER_RAY_MARCH);
    assert_true(scene_ray_method("", &ray) == 1);
    assert_true(scene_density_method("volume", &density) == 0 && density == SCATTER_DENSITY_VOLUME);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(numbers_agree_with_strtod),
        cmocka_unit_test(not_numbers_are_refused),
        cmocka_unit_test(every_directive_arrives),
        cmocka_unit_test(every_phase_arrives),
        cmocka_unit_test(line_ends_and_blanks_do_not_matter),
        cmocka_unit_test(wrong_lines_are_refused_by_number),
        cmocka_unit_test(wrong_files_are_refused),
        cmocka_unit_test(cut_scenes_are_handled),
        cmocka_unit_test(long_paths_keep_the_reason),
        cmocka_unit_test(cameras_look_where_they_should),
        cmocka_unit_test(rays_meet_shapes),
        cmocka_unit_test(far_spheres_are_met),
        cmocka_unit_test(shapes_throw_shadows),
        cmocka_unit_test(shadows_agree_with_probes),
        cmocka_unit_test(lit_surfaces_do_not_shadow_themselves),
        cmocka_unit_test(pictures_come_back),
        cmocka_unit_test(wrong_pictures_are_refused),
        cmocka_unit_test(pictures_are_written),
        cmocka_unit_test(hdr_pixels_arrive),
        cmocka_unit_test(wrong_hdr_is_refused),
        cmocka_unit_test(hdr_agrees_with_stb),
        cmocka_unit_test(raw_grids_are_read),
        cmocka_unit_test(wrong_grid_names_are_refused),
        cmocka_unit_test(scenes_find_their_grids),
        cmocka_unit_test(text_grids_are_read),
        cmocka_unit_test(nanovdb_grids_are_read),
        cmocka_unit_test(cut_nanovdb_is_refused),
        cmocka_unit_test(damaged_nanovdb_is_refused),
        cmocka_unit_test(leaves_of_too_many_bits_are_refused),
        cmocka_unit_test(noisy_nanovdb_does_no_harm),
        cmocka_unit_test(vdb_needs_its_tool),
        cmocka_unit_test(cut_vdb_is_refused),
        cmocka_unit_test(vdb_agrees_with_raw),
        cmocka_unit_test(skies_become_lights),
        cmocka_unit_test(skies_turn),
        cmocka_unit_test(wrong_skies_are_refused),
        cmocka_unit_test(gallery_can_be_read),
        cmocka_unit_test(names_go_both_ways),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
