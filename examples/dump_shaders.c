/* dump_shaders.c - writes the shaders of scatter_gl.h as files, for programs with a pipeline of
   their own, and for compilers that check them without a GPU.

       dump_shaders FOLDER         FOLDER/view.017.330core.frag, FOLDER/view.017.330core.vert ...

   Of each pass: without features, with each feature alone, and with so many together that any two
   that may meet do so in some file. The features stand at the top of a file. The folder must exist.
   C99. */
#define SCATTER_IMPLEMENTATION
#include "../scatter_gl.h"

#define COUNT(array) ((int)(sizeof(array) / sizeof((array)[0])))
enum { MOST = 64, TRIES = 64 };

static const char *const versions[] = {"330 core", "410 core", "450 core", "300 es", "310 es"};

/* One of these at a time. Features that are not named here are free. A number: layers at once. */
static const char *const exclusive[][4] = {
    {"ONE_LOBE", "TWO_LOBES"},
    {"CLOSED", "CELLS", "POLAR", "CELLS EYE"},
    {"SHADOW_2D_0", "SHADOW_ARRAY_0", "SHADOW_CUBE_0"},
    {"SHADOW_2D_1", "SHADOW_ARRAY_1", "SHADOW_CUBE_1"},
    {"SHADOW_2D_2", "SHADOW_ARRAY_2", "SHADOW_CUBE_2"},
    {"SHADOW_2D_3", "SHADOW_ARRAY_3", "SHADOW_CUBE_3"},
    {"TRANSMITTANCE", "MORE", "SHOW"},
    {"4", "8"}};

static void stop(const char *what, const char *name)
{
    fprintf(stderr, "dump_shaders: %s %s\n", what, name);
    exit(1);
}

static char *shader(const char *version, const char *pass, const char *features)
{
    size_t length = scatter_gl_shader(version, pass, features, NULL, 0);
    char *text = (char *)malloc(length + 1);
    if (!length || !text)
        stop("no shader of", pass);
    scatter_gl_shader(version, pass, features, text, length + 1);
    return text;
}

/* ----------------------------------------------------- >>choices */

/* Choices in groups, of which a shader takes one each; "" is none of the others. A set of choices is
   one bit each. */
typedef struct choices {
    const char *name[MOST];
    int count, first[MOST], size[MOST], groups;
    uint64_t met[MOST]; /* with which others each has been in one file */
} choices;

static void add(choices *c, const char *name)
{
    if (c->count == MOST)
        stop("too many features at", name);
    c->name[c->count++] = name;
    c->size[c->groups - 1]++;
}

static void begin_group(choices *c)
{
    c->first[c->groups++] = c->count;
    add(c, "");
}

static int is_exclusive(const char *feature)
{
    int i, k;
    for (i = 0; i < COUNT(exclusive); i++)
        for (k = 0; k < 4 && exclusive[i][k]; k++)
            if (strstr(exclusive[i][k], feature))
                return 1;
    return 0;
}

/* The others do not change the pass. */
static int matters(const char *pass, const char *feature)
{
    static const char layers[] = "SCATTERI_SLICES";
    char *text = shader("330 core", pass, ""), *with = shader("330 core", pass, feature);
    int used = strstr(strstr(text, layers) + 1, layers) != NULL;
    int differs = strlen(text) != strlen(with) || (used && strcmp(text, with) != 0);
    free(text);
    free(with);
    return differs;
}

static void find_choices(choices *c, const char *pass)
{
    const char *name;
    int i, k;
    memset(c, 0, sizeof *c);
    for (i = 0; i < COUNT(exclusive); i++) {
        begin_group(c);
        for (k = 0; k < 4 && exclusive[i][k]; k++)
            if (matters(pass, exclusive[i][k]))
                add(c, exclusive[i][k]);
    }
    for (i = 0; (name = scatter_gl_feature_name(i)) != NULL; i++)
        if (!is_exclusive(name) && matters(pass, name)) {
            begin_group(c);
            add(c, name);
        }
}

static int size_of(uint64_t set)
{
    int n = 0;
    for (; set; set &= set - 1)
        n++;
    return n;
}

static uint64_t random_set(const choices *c, uint64_t *seed)
{
    uint64_t set = 0;
    int i;
    for (i = 0; i < c->groups; i++) {
        *seed = *seed * 6364136223846793005u + 1442695040888963407u;
        set |= (uint64_t)1 << (c->first[i] + (int)(*seed >> 33) % c->size[i]);
    }
    return set;
}

/* Ordered pairs of choices (also with themselves) that have not met; if `keep`, they have now. */
static int new_pairs(choices *c, uint64_t set, int keep)
{
    int i, n = 0;
    for (i = 0; i < c->count; i++)
        if (set >> i & 1) {
            n += size_of(set & ~c->met[i]);
            c->met[i] |= keep ? set : 0;
        }
    return n;
}

/* ------------------------------------------------------- >>files */

static void write_file(const char *folder, const char *version, const char *pass, int number,
                       const char *kind, const char *text)
{
    char path[512], *blank;
    FILE *file;
    snprintf(path, sizeof path, "%s/%s.%03d.%s.%s", folder, pass, number, version, kind);
    if ((blank = strchr(path + strlen(folder), ' ')) != NULL)
        memmove(blank, blank + 1, strlen(blank));
    file = fopen(path, "wb");
    if (!file || fputs(text, file) < 0 || fclose(file) != 0)
        stop("cannot write", path);
}

/* Both shaders in all versions. */
static void write_shaders(const char *folder, const char *pass, int number, const char *features)
{
    char vertex[64];
    int i;
    snprintf(vertex, sizeof vertex, "%s:vertex", pass);
    for (i = 0; i < COUNT(versions); i++) {
        char *text = shader(versions[i], pass, features);
        write_file(folder, versions[i], pass, number, "frag", text);
        free(text);
        text = shader(versions[i], vertex, features);
        write_file(folder, versions[i], pass, number, "vert", text);
        free(text);
    }
}

static void write_set(const char *folder, const char *pass, int number, const choices *c,
                      uint64_t set)
{
    char features[MOST * 24] = "";
    int i;
    for (i = 0; i < c->count; i++)
        if (set >> i & 1) {
            strcat(features, " ");
            strcat(features, c->name[i]);
        }
    write_shaders(folder, pass, number, features);
}

/* The one of many sets with the most new pairs. */
static uint64_t good_set(choices *c, uint64_t *seed)
{
    uint64_t best = 0;
    int i, n, most = 0;
    for (i = 0; i < TRIES; i++) {
        uint64_t set = random_set(c, seed);
        n = new_pairs(c, set, 0);
        best = n > most ? set : best;
        most = n > most ? n : most;
    }
    return best;
}

static int all_pairs(const choices *c)
{
    int i, n = 0;
    for (i = 0; i < c->groups; i++)
        n += c->size[i] * (c->count - c->size[i] + 1);
    return n;
}

static int write_pass(const char *folder, const char *pass)
{
    choices c;
    uint64_t seed = 1;
    int i, pairs, number = 0;
    find_choices(&c, pass);
    write_shaders(folder, pass, number++, "");
    for (i = 0; i < c.count; i++)
        if (c.name[i][0])
            write_shaders(folder, pass, number++, c.name[i]);
    for (pairs = all_pairs(&c); pairs > 0;) {
        uint64_t set = good_set(&c, &seed);
        if (!set)
            continue;
        pairs -= new_pairs(&c, set, 1);
        write_set(folder, pass, number++, &c, set);
    }
    return number;
}

int main(int count, char **words)
{
    const char *pass;
    int i, n;
    if (count != 2) {
        fprintf(stderr, "usage: dump_shaders FOLDER\n");
        return 2;
    }
    for (i = 0; (pass = scatter_gl_pass_name(i)) != NULL; i++) {
        n = write_pass(words[1], pass);
        printf("%s: %d variants, %d versions each\n", pass, n, COUNT(versions));
    }
    return 0;
}
