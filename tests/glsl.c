/* glsl.c - copies the shared core of scatter.h into scatter_gl.h, and writes it as a whole shader.

     glsl scatter.h scatter_gl.h            renew the generated region of scatter_gl.h
     glsl scatter.h scatter_gl.h --check    fail if that would change anything
     glsl scatter.h --emit VERSION          print a fragment shader that calls every function of the
                                            core (130 150 330 410 450 300es 310es); its prelude comes
                                            from the scatter_gl.h beside scatter.h

   The core lies between the lines ">>core begin" and ">>core end"; a chapter begins at
   ">>core: name". Comments and empty lines are left out. C99 and no library. */
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define CHAPTER_BYTES 4000 /* C99 promises string literals of 4095 characters */
#define MAX_CHAPTERS 32
#define REGION_BEGIN "/* >>glsl core begin"
#define REGION_END "/* >>glsl core end"

static void stop(const char *format, ...) {
    va_list list;
    va_start(list, format);
    fputs("glsl: ", stderr);
    vfprintf(stderr, format, list);
    fputc('\n', stderr);
    va_end(list);
    exit(1);
}

/* --------------------------------------------------------------------------------------- >>text */

/* A string that grows. */
typedef struct text {
    char *bytes;
    size_t length, room;
} text;

static void append(text *t, const char *bytes, size_t length) {
    if (t->length + length + 1 > t->room) {
        t->room = 2 * (t->length + length) + 64;
        t->bytes = (char *)realloc(t->bytes, t->room);
        if (!t->bytes)
            stop("out of memory");
    }
    memcpy(t->bytes + t->length, bytes, length);
    t->length += length;
    t->bytes[t->length] = 0;
}

static void print(text *t, const char *format, ...) {
    char line[1024];
    va_list list;
    int length;
    va_start(list, format);
    length = vsnprintf(line, sizeof line, format, list);
    va_end(list);
    if (length < 0 || length >= (int)sizeof line)
        stop("a line is too long: %.60s...", line);
    append(t, line, (size_t)length);
}

static text read_file(const char *path) {
    text t = {NULL, 0, 0};
    char block[4096];
    size_t n;
    FILE *file = fopen(path, "rb");
    if (!file)
        stop("cannot read %s", path);
    append(&t, "", 0);
    while ((n = fread(block, 1, sizeof block, file)) > 0)
        append(&t, block, n);
    if (ferror(file))
        stop("cannot read %s", path);
    fclose(file);
    return t;
}

static void write_file(const char *path, const text *t) {
    FILE *file = fopen(path, "wb");
    if (!file || fwrite(t->bytes, 1, t->length, file) != t->length || fclose(file) != 0)
        stop("cannot write %s", path);
}

/* The first character behind the line that holds `mark`. */
static const char *behind(const char *bytes, const char *mark, const char *path) {
    const char *at = strstr(bytes, mark);
    const char *line = at ? strchr(at, '\n') : NULL;
    if (!line)
        stop("%s has no line with %s", path, mark);
    return line + 1;
}

/* The first character of the line that holds `mark`. */
static const char *before(const char *bytes, const char *mark, const char *path) {
    const char *at = strstr(bytes, mark);
    if (!at)
        stop("%s has no line with %s", path, mark);
    while (at > bytes && at[-1] != '\n')
        at--;
    return at;
}

/* ----------------------------------------------------------------------------------- >>chapters */

typedef struct chapter {
    char name[32];
    text code;
} chapter;

typedef struct core {
    chapter chapters[MAX_CHAPTERS];
    int count;
} core;

/* Appends the code from `at` to `end` without comments, trailing spaces and empty lines. */
static void append_code(text *t, const char *at, const char *end) {
    size_t line = t->length; /* where the line begins */
    for (; at < end; at++) {
        if (at[0] == '/' && at[1] == '*') {
            at = strstr(at, "*/");
            if (!at)
                stop("a comment does not end");
            at++;
            continue;
        }
        append(t, at, 1);
        if (*at != '\n')
            continue;
        t->length--;
        while (t->length > line && t->bytes[t->length - 1] == ' ')
            t->length--;
        t->bytes[t->length] = 0;
        if (t->length > line)
            append(t, "\n", 1);
        line = t->length;
    }
}

static void add_chapter(core *c, const char *at, const char *end) {
    chapter *n = &c->chapters[c->count];
    if (c->count++ == MAX_CHAPTERS)
        stop("more than %d chapters", MAX_CHAPTERS);
    memset(n, 0, sizeof *n);
    if (sscanf(at, ">>core: %31[a-z] */", n->name) != 1)
        stop("a chapter needs a name of small letters: %.40s", at);
    append_code(&n->code, strchr(at, '\n') + 1, end);
    if (n->code.length >= CHAPTER_BYTES)
        stop("chapter %s has %lu bytes, not below %d", n->name, (unsigned long)n->code.length,
             CHAPTER_BYTES);
}

static core read_core(const char *path) {
    static core c;
    text file = read_file(path);
    const char *at = behind(file.bytes, ">>core begin", path);
    const char *end = before(at, ">>core end", path);
    for (at = strstr(at, ">>core: "); at && at < end;) {
        const char *next = strstr(at + 1, ">>core: ");
        add_chapter(&c, at, next && next < end ? before(at, next, path) : end);
        at = next;
    }
    if (c.count == 0)
        stop("%s has no chapter between >>core begin and >>core end", path);
    return c;
}

/* ------------------------------------------------------------------------------------- >>region */

static void quote(text *t, const char *code) {
    const char *end;
    for (; *code; code = end + 1) {
        end = strchr(code, '\n');
        append(t, "    \"", 5);
        for (; code < end; code++) {
            if (*code == '"' || *code == '\\')
                append(t, "\\", 1);
            append(t, code, 1);
        }
        append(t, end[1] ? "\\n\"\n" : "\\n\";\n", end[1] ? 4 : 5);
    }
}

/* scatter_gl.h with the region between its marks made anew. */
static text renewed(const core *c, const text *old, const char *path) {
    text t = {NULL, 0, 0};
    const char *begin = behind(old->bytes, REGION_BEGIN, path);
    const char *end = before(begin, REGION_END, path);
    int i;
    append(&t, old->bytes, (size_t)(begin - old->bytes));
    for (i = 0; i < c->count; i++) {
        print(&t, "\nstatic const char scatteri_gl_%s[] =\n", c->chapters[i].name);
        quote(&t, c->chapters[i].code.bytes);
    }
    print(&t, "\n#define SCATTERI_GL_CORE");
    for (i = 0; i < c->count; i++)
        print(&t, " \\\n    {\"%s\", scatteri_gl_%s},", c->chapters[i].name, c->chapters[i].name);
    print(&t, "\n\n");
    append(&t, end, strlen(end));
    return t;
}

static int renew(const char *from, const char *to, int check) {
    core c = read_core(from);
    text old = read_file(to);
    text now = renewed(&c, &old, to);
    if (strcmp(old.bytes, now.bytes) == 0)
        return 0;
    if (check)
        stop("%s is out of date: run `make glsl`", to);
    write_file(to, &now);
    return 0;
}

/* ------------------------------------------------------------------------------------- >>shader */

/* Appends the text of the quoted lines that follow `mark`, up to the semicolon. */
static void append_quoted(text *t, const char *path, const char *mark) {
    text file = read_file(path);
    const char *at = behind(file.bytes, mark, path);
    int inside = 0;
    for (; *at && (inside || *at != ';'); at++) {
        if (*at == '"')
            inside = !inside;
        else if (inside && at[0] == '\\' && at[1] == 'n')
            append(t, "\n", 1), at++;
        else if (inside)
            append(t, at[0] == '\\' ? ++at : at, 1);
    }
}

/* An expression of the type, made of the float x. */
static const char *argument(const char *type) {
    static const char *const made[][2] = {{"float", "x"},
                                          {"int", "int(x)"},
                                          {"scatteri_real", "SCATTERI_REAL(x)"},
                                          {"scatter_vec3", "scatteri_v3(x, 1.0f, x)"},
                                          {"scatteri_vec2", "scatteri_v2(x, x)"},
                                          {"scatteri_lobes", "scatteri_droplets(x)"}};
    size_t i;
    for (i = 0; i < sizeof made / sizeof made[0]; i++)
        if (strcmp(type, made[i][0]) == 0)
            return made[i][1];
    stop("no argument of type %s is known", type);
    return NULL;
}

/* How a float is got from a value of the type. */
static const char *component(const char *type) {
    if (strcmp(type, "scatteri_lobes") == 0)
        return ".g1";
    return strncmp(type, "scatter", 7) == 0 && strcmp(type, "scatteri_real") != 0 ? ".x" : "";
}

/* Adds a call of the function declared at `at`: "SCATTERI_FN type name(type name, type name...". */
static void append_call(text *t, const char *at) {
    char type[32], name[64];
    int used;
    if (sscanf(at, "SCATTERI_FN %31s %63[a-z0-9_](%n", type, name, &used) != 2)
        stop("not understood: %.60s", at);
    print(t, "    sum += %s(", name);
    for (at += used; at[-1] != ')'; at = strpbrk(at, ",)") + 1) {
        char kind[32];
        if (sscanf(at, " %31[a-z0-9_]", kind) != 1)
            stop("not understood: %.60s", at);
        print(t, "%s%s", at[-1] == '(' ? "" : ", ", argument(kind));
    }
    print(t, ")%s;\n", component(type));
}

static void append_main(text *t, const core *c) {
    const char *at;
    int i;
    print(t,
          "out vec4 color;\nvoid main() {\n    float x = gl_FragCoord.x;\n    float sum = 0.0;\n");
    for (i = 0; i < c->count; i++)
        for (at = c->chapters[i].code.bytes; (at = strstr(at, "SCATTERI_FN ")) != NULL; at++)
            append_call(t, at);
    print(t, "    color = vec4(sum);\n}\n");
}

static int emit(const char *from, const char *version) {
    core c = read_core(from);
    text t = {NULL, 0, 0}, header = {NULL, 0, 0};
    const char *name = strrchr(from, '/');
    int i, number = atoi(version), es = strstr(version, "es") != NULL;
    append(&header, from, name ? (size_t)(name + 1 - from) : 0);
    print(&header, "scatter_gl.h");
    print(&t, "#version %d%s\n", number, es ? " es" : "");
    append_quoted(&t, header.bytes, "scatteri_gl_prelude[] =");
    for (i = 0; i < c.count; i++)
        append(&t, c.chapters[i].code.bytes, c.chapters[i].code.length);
    append_main(&t, &c);
    fputs(t.bytes, stdout);
    return 0;
}

int main(int count, char **words) {
    if (count == 4 && strcmp(words[2], "--emit") == 0 && atoi(words[3]) >= 130)
        return emit(words[1], words[3]);
    if (count == 3 || (count == 4 && strcmp(words[3], "--check") == 0))
        return renew(words[1], words[2], count == 4);
    fprintf(stderr,
            "usage: glsl scatter.h scatter_gl.h [--check]\n       glsl scatter.h --emit VERSION\n");
    return 2;
}
