/* report.h - the benchmark's tables: the same text on standard output and in docs/report.md, all
   rows as CSV in build/bench/. MIT licence, see LICENSE. */
#ifndef SCATTER_BENCH_REPORT_H
#define SCATTER_BENCH_REPORT_H

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum {
    REPORT_COLUMNS = 24,
    REPORT_ROWS = 2048,
    REPORT_CELL = 64,
    REPORT_TARGETS = 128,
    REPORT_CLAIMS = 32,
    REPORT_LINE = 320
};

/* The parts of the page in their order; the benchmarks fill them in another. */
typedef enum report_part { REPORT_HEAD, REPORT_FRONTS, REPORT_BODY, REPORT_PARTS } report_part;

/* Main sets them once: where CSV files and points go, where charts go, and how the page, wherever
   it is, links to them. */
static const char *report_folder = "build/bench", *report_charts = "build/bench",
                  *report_link = ".";

typedef struct report {
    const char *path;                /* docs/report.md */
    FILE *part[REPORT_PARTS], *page; /* `page` is the part that is being written */
    char *text[REPORT_PARTS];        /* what is in the parts, once they are closed */
    size_t bytes[REPORT_PARTS];
    char csv[128]; /* path of the table's CSV file */
    int columns, rows, column;
    char cell[REPORT_ROWS][REPORT_COLUMNS][REPORT_CELL]; /* row 0 holds the headings */
    int shown[REPORT_ROWS];
    char target[REPORT_TARGETS][REPORT_LINE];
    int targets, missed;
    char claim[REPORT_CLAIMS][REPORT_LINE]; /* rows of the table in README.md */
    int claims;
} report;

static void report_die(const char *what, const char *path)
{
    fprintf(stderr, "bench: %s %s (run it in the project's directory)\n", what, path);
    exit(1);
}

static void report_turn_to(report *r, report_part part)
{
    r->page = r->part[part];
}

/* Nothing is written to `path` before report_close. */
static void report_open(report *r, const char *path)
{
    memset(r, 0, sizeof *r);
    r->path = path;
    for (int i = 0; i < REPORT_PARTS; i++) {
        r->part[i] = open_memstream(&r->text[i], &r->bytes[i]);
        if (!r->part[i])
            report_die("no memory for", path);
    }
    report_turn_to(r, REPORT_BODY);
}

static void report_close(report *r)
{
    FILE *page = fopen(r->path, "w");
    for (int i = 0; page && i < REPORT_PARTS; i++) {
        if (fclose(r->part[i]) != 0)
            report_die("no memory for", r->path);
        fwrite(r->text[i], 1, r->bytes[i], page);
        free(r->text[i]);
    }
    if (!page || fclose(page) != 0)
        report_die("cannot write", r->path);
}

/* What a part holds so far, as a file of its own. */
static inline void report_copy(report *r, report_part part, const char *path)
{
    FILE *page = fopen(path, "w");
    if (fflush(r->part[part]) != 0)
        report_die("no memory for", path);
    if (!page || fwrite(r->text[part], 1, r->bytes[part], page) != r->bytes[part] ||
        fclose(page) != 0)
        report_die("cannot write", path);
}

/* The whole text of a file; free() it. */
static char *report_file(const char *path)
{
    FILE *file = fopen(path, "rb");
    long bytes = file && fseek(file, 0, SEEK_END) == 0 ? ftell(file) : -1;
    char *text = bytes >= 0 ? (char *)calloc((size_t)bytes + 1, 1) : NULL;
    if (!text || fseek(file, 0, SEEK_SET) != 0 ||
        fread(text, 1, (size_t)bytes, file) != (size_t)bytes || fclose(file) != 0)
        report_die("cannot read", path);
    return text;
}

/* One paragraph or heading on both. */
static void report_text(report *r, const char *format, ...)
{
    va_list list;
    char line[2048];
    va_start(list, format);
    vsnprintf(line, sizeof line, format, list);
    va_end(list);
    printf("%s\n\n", line);
    fprintf(r->page, "%s\n\n", line);
    fflush(stdout);
}

static void report_cell(report *r, const char *format, ...)
{
    va_list list;
    if (r->rows >= REPORT_ROWS || r->column >= REPORT_COLUMNS)
        report_die("table too large:", r->csv);
    va_start(list, format);
    vsnprintf(r->cell[r->rows][r->column++], REPORT_CELL, format, list);
    va_end(list);
}

/* Ends a row. Rows that are not shown are written to the CSV file only. */
static void report_row(report *r, int shown)
{
    while (r->column < r->columns)
        report_cell(r, "%s", "");
    r->shown[r->rows++] = shown;
    r->column = 0;
}

/* Starts a table; `headings` are separated by '|'. */
static void report_table(report *r, const char *csv, const char *headings)
{
    snprintf(r->csv, sizeof r->csv, "%s/%s.csv", report_folder, csv);
    r->rows = r->column = 0;
    r->columns = 0;
    while (*headings) {
        size_t length = strcspn(headings, "|");
        report_cell(r, "%.*s", (int)length, headings);
        headings += length + (headings[length] == '|');
    }
    r->columns = r->column;
    report_row(r, 1);
}

static int report_width(const report *r, int column)
{
    size_t widest = 3;
    for (int i = 0; i < r->rows; i++) {
        size_t length = strlen(r->cell[i][column]);
        if (r->shown[i] && length > widest)
            widest = length;
    }
    return (int)widest;
}

/* The first column is text, the others are numbers and stand to the right. */
static void report_print_row(const report *r, FILE *out, int row)
{
    for (int c = 0; c < r->columns; c++)
        fprintf(out, c ? "| %*s " : "| %-*s ", report_width(r, c), r->cell[row][c]);
    fputs("|\n", out);
}

static void report_print_rule(const report *r, FILE *out)
{
    for (int c = 0; c < r->columns; c++) {
        fputs("| ", out);
        for (int i = report_width(r, c); i > 1; i--)
            fputc('-', out);
        fputs(c ? ": " : "- ", out);
    }
    fputs("|\n", out);
}

static void report_print(const report *r, FILE *out)
{
    report_print_row(r, out, 0);
    report_print_rule(r, out);
    for (int i = 1; i < r->rows; i++)
        if (r->shown[i])
            report_print_row(r, out, i);
    fputc('\n', out);
    fflush(out);
}

/* Without the marks `~`, which are for readers. */
static void report_write_csv(const report *r)
{
    FILE *csv = fopen(r->csv, "w");
    if (!csv)
        report_die("cannot write", r->csv);
    for (int i = 0; i < r->rows; i++)
        for (int c = 0; c < r->columns; c++)
            fprintf(csv, "\"%.*s\"%s", (int)strcspn(r->cell[i][c], "~"), r->cell[i][c],
                    c + 1 < r->columns ? "," : "\n");
    if (fclose(csv) != 0)
        report_die("cannot write", r->csv);
}

static void report_end(report *r)
{
    report_print(r, stdout);
    report_print(r, r->page);
    report_write_csv(r);
}

/* A requirement, what was found, and whether that is enough: on standard output now, on the page in
   the list of all. */
static void report_target(report *r, int reached, const char *target, const char *format, ...)
{
    char measured[REPORT_LINE / 2];
    va_list list;
    if (r->targets >= REPORT_TARGETS)
        report_die("too many targets:", target);
    va_start(list, format);
    vsnprintf(measured, sizeof measured, format, list);
    va_end(list);
    snprintf(r->target[r->targets], REPORT_LINE, "target: %s  measured: %s  %s", target, measured,
             reached ? "ok" : "MISSED");
    printf("%s\n\n", r->target[r->targets++]);
    if (!reached)
        r->missed++;
}

/* A row of README.md's table: what, what was asked for, what was measured. */
static inline void report_claim(report *r, const char *what, const char *asked, const char *format,
                                ...)
{
    char measured[REPORT_LINE / 2];
    va_list list;
    if (r->claims >= REPORT_CLAIMS)
        report_die("too many claims:", what);
    va_start(list, format);
    vsnprintf(measured, sizeof measured, format, list);
    va_end(list);
    snprintf(r->claim[r->claims++], REPORT_LINE, "| %s | %s | %s |", what, asked, measured);
}

/* Replaces what stands between the two marks in the file by the claims. */
static inline void report_write_claims(const report *r, const char *path)
{
    static const char begin[] = "<!-- make bench begin -->\n", end[] = "<!-- make bench end -->";
    char *text = report_file(path), *from = strstr(text, begin), *to = strstr(text, end);
    if (!from || !to || to < from)
        report_die("no marks for the table in", path);
    FILE *page = fopen(path, "w");
    if (!page)
        report_die("cannot write", path);
    fprintf(page, "%.*s", (int)(from + strlen(begin) - text), text);
    fprintf(page, "| what | asked for | measured |\n| --- | --- | --- |\n");
    for (int i = 0; i < r->claims; i++)
        fprintf(page, "%s\n", r->claim[i]);
    fputs(to, page);
    if (fclose(page) != 0)
        report_die("cannot write", path);
    free(text);
}

static void report_summary(report *r)
{
    report_text(r, "## All targets");
    report_text(r, "%d targets, %d missed.", r->targets, r->missed);
    for (int i = 0; i < r->targets; i++) {
        printf("- %s\n", r->target[i]);
        fprintf(r->page, "- %s\n", r->target[i]);
    }
    fputs("\n", r->page);
}

#endif
