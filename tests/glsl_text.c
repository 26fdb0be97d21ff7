/* glsl_text.c - writes a shader of tests/glsl_glm.h so that a C++ compiler with GLM takes it.

       glsl_text NAME >FILE

   Numbers with a point get their f, swizzles become calls, parameters that are `out` references; the
   rest is left to the macros of tests/glsl_glm.cpp. A planted fault is put in first. The members of
   the uniform blocks become variables by the same macros; set_block fills them. C99. */
#define SCATTER_IMPLEMENTATION
#include "../scatter_gl.h"
#include "glsl_glm.h"
#include <ctype.h>

static const struct {
    const char *name, *features, *fault, *instead;
} shaders[] = {
#define GLM_ROW(name, features, fault, instead) {#name, features, fault, instead},
    GLM_SHADERS(GLM_ROW)};

static void stop(const char *what, const char *which)
{
    fprintf(stderr, "glsl_text: error: %s: %s\n", what, which);
    exit(1);
}

static char *shader_text(const char *features)
{
    const size_t length = scatter_gl_shader("330 core", "view", features, NULL, 0);
    char *text = (char *)malloc(length + 1);
    if (length == 0 || text == NULL)
        stop("no shader with", features);
    scatter_gl_shader("330 core", "view", features, text, length + 1);
    return text;
}

/* The text with each `fault` replaced. */
static char *with_fault(const char *text, const char *fault, const char *instead)
{
    char *copy = (char *)calloc(2 * strlen(text), 1), *out = copy;
    const char *at, *from = text;
    if (copy == NULL)
        stop("no memory for", fault);
    while ((at = strstr(from, fault)) != NULL) {
        out += sprintf(out, "%.*s%s", (int)(at - from), from, instead);
        from = at + strlen(fault);
    }
    if (from == text)
        stop("no chapter says", fault);
    strcpy(out, from);
    return copy;
}

/* --------------------------------------------------------------------------------- >>translation */

static int is_name(char c)
{
    return isalnum((unsigned char)c) || c == '_';
}

static const char *put_number(const char *at)
{
    int exact = 1;
    for (; is_name(*at) || *at == '.' || ((*at == '-' || *at == '+') && at[-1] == 'e'); at++) {
        exact = exact && *at != '.' && *at != 'e';
        putchar(*at);
    }
    if (!exact && at[-1] != 'f')
        putchar('f');
    return at;
}

/* "out float depth" among parameters is "float &depth", elsewhere a variable. */
static const char *put_out(const char *at, char before)
{
    while (*at == ' ')
        at++;
    if (before != '(' && before != ',')
        return at;
    while (is_name(*at))
        putchar(*at++);
    putchar('&');
    return at;
}

/* before: the last character that is no blank. */
static const char *put_word(const char *word, char before)
{
    const char *at = word;
    while (is_name(*at))
        at++;
    if (at - word == 3 && strncmp(word, "out", 3) == 0)
        return put_out(at, before);
    if (strncmp(word, "layout(location", 15) == 0)
        return strchr(word, ')') + 1;
    printf("%.*s", (int)(at - word), word);
    if (before == '.' && at - word > 1 && strspn(word, "xyzw") == (size_t)(at - word))
        printf("()");
    return at;
}

static const char *put_comment(const char *at)
{
    const char *end = strstr(at, "*/") + 2;
    printf("%.*s", (int)(end - at), at);
    return end;
}

static void put_shader(const char *at)
{
    char before = 0;
    at = strchr(at, '\n'); /* behind #version */
    while (*at != 0) {
        const char *from = at;
        if (at[0] == '/' && at[1] == '*')
            at = put_comment(at);
        else if (isdigit((unsigned char)*at))
            at = put_number(at);
        else if (is_name(*at))
            at = put_word(at, before);
        else
            putchar(*at++);
        if (*from != ' ')
            before = at[-1];
    }
}

/* --------------------------------------------------------------------------------------- >>blocks */

#define PUT_ONE(name) "    from = take(&scatteri_" #name ", 1, from);\n"
#define PUT_ARRAY(name, count) "    from = take(scatteri_" #name ", " #count ", from);\n"

static void put_block(const char *name, const char *members)
{
    printf("static void set_%s(const float *from)\n{\n%s}\n", name, members);
}

int main(int count, char **words)
{
    size_t i;
    for (i = 0; count == 2 && i < sizeof shaders / sizeof *shaders; i++)
        if (strcmp(shaders[i].name, words[1]) == 0) {
            char *text = shader_text(shaders[i].features);
            if (shaders[i].fault[0] != 0)
                text = with_fault(text, shaders[i].fault, shaders[i].instead);
            put_shader(text);
            put_block("medium", SCATTERI_GL_MEDIUM_BLOCK(PUT_ONE, PUT_ARRAY));
            put_block("lights", SCATTERI_GL_LIGHTS_BLOCK(PUT_ONE, PUT_ARRAY));
            put_block("view", SCATTERI_GL_VIEW_BLOCK(PUT_ONE, PUT_ARRAY));
            return ferror(stdout) != 0;
        }
    stop("usage: glsl_text NAME", count == 2 ? words[1] : "");
    return 2;
}
