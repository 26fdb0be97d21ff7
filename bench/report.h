/* report.h - the benchmark's tables: the same text on standard output and in docs/report.md, all
   rows as CSV in build/bench/. MIT licence, see LICENSE. */
#ifndef SCATTER_BENCH_REPORT_H
#define SCATTER_BENCH_REPORT_H

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum {
    REPORT_COLUMNS = 16,
    REPORT_ROWS = 512,
    REPORT_CELL = 64,
    REPORT_TARGETS = 64,
    REPORT_LINE = 320
};

typedef struct report {
    FILE *page;    /* docs/report.md */
    char csv[128]; /* path of the table's CSV file */
    int columns, rows, column;
    char cell[REPORT_ROWS][REPORT_COLUMNS][REPORT_CELL]; /* row 0 holds the headings */
    int shown[REPORT_ROWS];
    char target[REPORT_TARGETS][REPORT_LINE];
    int targets, missed;
} report;

static void report_die(const char *what, const char *path)
{
    fprintf(stderr, "bench: %s %s (run it in the project's directory)\n", what, path);
    exit(1);
}

static void report_open(report *r, const char *path)
{
    memset(r, 0, sizeof *r);
    r->page = fopen(path, "w");
    if (!r->page)
        report_die("cannot write", path);
}

static void report_close(report *r)
{
    if (fclose(r->page) != 0)
        report_die("cannot write", "docs/report.md");
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
    snprintf(r->csv, sizeof r->csv, "build/bench/%s.csv", csv);
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

/* A requirement, what was found, and whether that is enough. */
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
    report_text(r, "%s", r->target[r->targets++]);
    if (!reached)
        r->missed++;
}

static void report_summary(report *r)
{
    report_text(r, "## All targets");
    report_text(r, "%d targets, %d missed.", r->targets, r->missed);
    for (int i = 0; i < r->targets; i++) {
        printf("- %s\n", r->target[i]);
        fprintf(r->page, "- %s\n", r->target[i]);
    }
}

#endif
