/* chart.h - speed against error as a chart for each scene, drawn by gnuplot. MIT licence.

   Whoever measures something on a scene, here or in another program, writes it as points:

       FILE *csv = chart_open("fog", "peers");        // begins build/bench/fog.peers.csv
       chart_point(csv, "fog", "POV-Ray", "method 2 samples 8", 1170, 0.0054);
       chart_close(csv);

   chart_read takes the points of all these files (fog.points.csv, fog.peers.csv, ...), chart_draw
   makes one picture of them: time to the right, error upwards, a colour and mark for each family,
   and the front as a line. Times of one scene must belong to one size of image. A line "# words" in
   one of the files is the title. */
#ifndef SCATTER_BENCH_CHART_H
#define SCATTER_BENCH_CHART_H

#include "image.h"
#include <glob.h>

enum { CHART_ROWS = 1024, CHART_FAMILIES = 24 };

typedef struct chart_row {
    char family[48], way[80];
    double ms, error; /* error: relative RMSE, 0.01 is 1 % */
    int front;        /* nothing in the chart beats it */
} chart_row;

typedef struct chart {
    char scene[64], title[128];
    const char *across; /* what is to the right, and there is no front; NULL: time */
    chart_row row[CHART_ROWS];
    int count;
    char family[CHART_FAMILIES][48]; /* ours in the order of chart_styles, then the others */
    int families;
} chart;

/* Marks of gnuplot: 1 plus, 2 cross, 4 and 5 square, 6 circle, 7 disc, 9 triangle, 11 triangle upside
   down, 13 lozenge. Joined families are shown by their own fronts, with a line through them. */
typedef struct chart_style {
    const char *family, *title, *color;
    int ours, mark, joined;
} chart_style;

/* Triangles are the papers' own methods: upright by the parts of this library, upside down as
   papers.h has them. */
static const chart_style chart_styles[] = {
    {"default", "default quality", "#000000", 1, 2, 0},
    {"closed/quadrature", NULL, "#0072B2", 1, 7, 0},
    {"closed-volume/quadrature", NULL, "#56B4E9", 1, 7, 0},
    {"polar/quadrature", NULL, "#009E73", 1, 7, 0},
    {"short/quadrature", NULL, "#CC79A7", 1, 7, 0},
    {"upwind/quadrature", NULL, "#E69F00", 1, 7, 0},
    {"eq6/quadrature", NULL, "#D55E00", 1, 7, 0},
    {"march/quadrature", NULL, "#777777", 1, 7, 0},
    {"closed-volume/march", NULL, "#56B4E9", 1, 6, 0},
    {"polar/march", NULL, "#009E73", 1, 6, 0},
    {"short/march", NULL, "#CC79A7", 1, 6, 0},
    {"closed/march", "closed/march (Navarro)", "#0072B2", 1, 9, 1},
    {"upwind/march", "upwind/march (mended G. & B.)", "#E69F00", 1, 9, 1},
    {"eq6/march", "eq6/march (Giroud & Biri)", "#D55E00", 1, 9, 1},
    {"march/march", "march/march (Kajiya & V. H.)", "#333333", 1, 9, 1},
    {"scatter", "search for 1 %", "#0072B2", 0, 1, 0},
    {"shadow rays", NULL, "#56B4E9", 0, 11, 1},
    {"Giroud & Biri", NULL, "#D55E00", 0, 11, 1},
    {"Kajiya & Von Herzen", NULL, "#777777", 0, 11, 1},
    {"kiara_1_dawn_1k, median cut", NULL, "#D55E00", 0, 5, 1},
    {"st_fagans_interior_1k, median cut", NULL, "#009E73", 0, 5, 1},
    {"studio_small_03_1k, median cut", NULL, "#777777", 0, 5, 1},
    {"venice_sunset_1k, median cut", NULL, "#0072B2", 0, 5, 1},
    {"kiara_1_dawn_1k, k-means", NULL, "#D55E00", 0, 6, 1},
    {"st_fagans_interior_1k, k-means", NULL, "#009E73", 0, 6, 1},
    {"studio_small_03_1k, k-means", NULL, "#777777", 0, 6, 1},
    {"venice_sunset_1k, k-means", NULL, "#0072B2", 0, 6, 1}};

enum { CHART_STYLES = sizeof chart_styles / sizeof chart_styles[0] };

/* -------------------------------------------------------------------------------- the files */

/* Removes what an earlier run has written: files of a folder with this ending. */
static void chart_forget(const char *folder, const char *ending)
{
    char pattern[128];
    glob_t files;
    snprintf(pattern, sizeof pattern, "%s/*%s", folder, ending);
    if (glob(pattern, 0, NULL, &files) != 0)
        return;
    for (size_t i = 0; i < files.gl_pathc; i++)
        remove(files.gl_pathv[i]);
    globfree(&files);
}

/* Begins build/bench/SCENE.PART.csv anew. */
static FILE *chart_open(const char *scene, const char *part)
{
    char path[256];
    snprintf(path, sizeof path, "%s/%s.%s.csv", report_folder, scene, part);
    FILE *csv = fopen(path, "w");
    if (!csv)
        report_die("cannot write", path);
    fprintf(csv, "scene,family,setting,ms,error\n");
    return csv;
}

static void chart_point(FILE *csv, const char *scene, const char *family, const char *way,
                        double ms, double error)
{
    fprintf(csv, "%s,\"%s\",\"%s\",%.6g,%.6g\n", scene, family, way, ms, error);
}

/* The same for a setting of ours: its methods are the family. */
static void chart_setting(FILE *csv, const char *scene, const setting *s)
{
    char family[48], way[64];
    const scatter_quality *q = &s->quality;
    snprintf(family, sizeof family, "%s/%s", scene_depth_name(q->depth), scene_ray_name(q->ray));
    if (q->nodes == 0) {
        snprintf(family, sizeof family, "default");
        snprintf(way, sizeof way, "quality");
    } else if (q->depth == SCATTER_DEPTH_CLOSED)
        snprintf(way, sizeof way, "nodes %d", q->nodes);
    else
        snprintf(way, sizeof way, "nodes %d grid %d", q->nodes, q->grid);
    chart_point(csv, scene, family, way, setting_ms(s), s->rmse);
}

static void chart_close(FILE *csv)
{
    if (fclose(csv) != 0)
        report_die("cannot write", "the points of a chart");
}

static void chart_add_family(chart *c, const char *family)
{
    for (int i = 0; i < c->families; i++)
        if (strcmp(c->family[i], family) == 0)
            return;
    if (c->families >= CHART_FAMILIES)
        report_die("too many families:", c->scene);
    snprintf(c->family[c->families++], sizeof c->family[0], "%s", family);
}

/* Copies one field, in quotes or not; returns where the next one begins. */
static const char *chart_field(const char *at, char *field, size_t room)
{
    int quoted = *at == '"';
    size_t length = strcspn(at += quoted, quoted ? "\"\n" : ",\n");
    snprintf(field, room, "%.*s", (int)length, at);
    at += length;
    at += quoted && *at == '"';
    return at + (*at == ',');
}

/* Logarithms need times and errors above 0; the heading is no row either. */
static void chart_read_line(chart *c, const char *line)
{
    chart_row *row = &c->row[c->count];
    if (sscanf(line, "# %127[^\n]", c->title) == 1)
        return;
    line = chart_field(line, row->family, sizeof row->family); /* the scene: it is known */
    line = chart_field(line, row->family, sizeof row->family);
    line = chart_field(line, row->way, sizeof row->way);
    if (sscanf(line, "%lf,%lf", &row->ms, &row->error) != 2 || !(row->ms > 0) ||
        !(row->error > 0) || isinf(row->error))
        return;
    if (++c->count >= CHART_ROWS)
        report_die("too many points:", c->scene);
}

static void chart_read_file(chart *c, const char *path)
{
    char line[512];
    FILE *csv = fopen(path, "r");
    while (csv && fgets(line, sizeof line, csv))
        chart_read_line(c, line);
    if (!csv || fclose(csv) != 0)
        report_die("cannot read", path);
}

static void chart_find_front(chart *c)
{
    for (int i = 0; i < c->count; i++) {
        chart_row *row = &c->row[i];
        row->front = 1;
        for (int k = 0; k < c->count && row->front; k++)
            row->front = !beats(c->row[k].ms, c->row[k].error, row->ms, row->error);
    }
}

/* NULL: is it of this library, by any of its methods? */
static int chart_is_of(const chart_row *row, const char *family)
{
    for (int i = 0; !family && i < CHART_STYLES; i++)
        if (strcmp(row->family, chart_styles[i].family) == 0)
            return chart_styles[i].ours;
    return family && strcmp(row->family, family) == 0;
}

static void chart_find_families(chart *c)
{
    for (int i = 0; i < CHART_STYLES; i++)
        for (int k = 0; k < c->count; k++)
            if (chart_is_of(&c->row[k], chart_styles[i].family))
                chart_add_family(c, chart_styles[i].family);
    for (int k = 0; k < c->count; k++) {
        char family[48];
        memcpy(family, c->row[k].family, sizeof family);
        chart_add_family(c, family);
    }
}

/* A chart with a wrong front must not be drawn: fields with commas, what is on a known front, and
   what cannot be drawn. */
static void check_charts(void)
{
    static const char *const line[7] = {"scene,family,setting,ms,error",
                                        "s,\"A, 2\",x,1,0.9",
                                        "s,closed/march,\"x, y\",2,0.5",
                                        "s,B,x,3,0.5",
                                        "s,B,x,4,0.1",
                                        "s,B,x,5,nan",
                                        "s,B,x,6,0"};
    chart *c = (chart *)calloc(1, sizeof *c);
    for (int i = 0; c && i < 7; i++)
        chart_read_line(c, line[i]);
    if (c) {
        chart_find_families(c);
        chart_find_front(c);
    }
    if (!c || c->count != 4 || c->families != 3 || strcmp(c->family[0], "closed/march") != 0 ||
        strcmp(c->family[1], "A, 2") != 0 || strcmp(c->row[1].way, "x, y") != 0 ||
        !c->row[0].front || !c->row[1].front || c->row[2].front || !c->row[3].front) {
        fprintf(stderr, "bench: its own charts are wrong\n");
        exit(1);
    }
    free(c);
}

/* All points of a scene, whoever measured them. */
static void chart_read(chart *c, const char *scene)
{
    char pattern[128];
    glob_t files;
    memset(c, 0, sizeof *c);
    snprintf(c->scene, sizeof c->scene, "%s", scene);
    snprintf(pattern, sizeof pattern, "%s/%s.*.csv", report_folder, scene);
    if (glob(pattern, 0, NULL, &files) != 0)
        report_die("no points of", scene);
    for (size_t i = 0; i < files.gl_pathc; i++)
        chart_read_file(c, files.gl_pathv[i]);
    globfree(&files);
    chart_find_families(c);
    chart_find_front(c);
}

/* --------------------------------------------------------------------------------- questions */

/* The fastest row of a family (NULL: of ours) with at most this error; NULL: there is none. */
static const chart_row *chart_fastest(const chart *c, const char *family, double error)
{
    const chart_row *best = NULL;
    for (int i = 0; i < c->count; i++) {
        const chart_row *row = &c->row[i];
        if (chart_is_of(row, family) && row->error <= error && (!best || row->ms < best->ms))
            best = row;
    }
    return best;
}

/* ----------------------------------------------------------------------------------- drawing */

enum { CHART_OTHERS = 6 };

/* For families of other programs, in turn. */
static const char *const chart_other_colors[CHART_OTHERS] = {"#882255", "#AA4499", "#117733",
                                                             "#332288", "#999933", "#661100"};
static const int chart_other_marks[3] = {5, 13, 4};

static chart_style chart_style_of(const char *family, int *others)
{
    for (int i = 0; i < CHART_STYLES; i++)
        if (strcmp(chart_styles[i].family, family) == 0)
            return chart_styles[i];
    chart_style style = {family, NULL, NULL, 0, 0, 1};
    style.color = chart_other_colors[*others % CHART_OTHERS];
    style.mark = chart_other_marks[*others % 3];
    ++*others;
    return style;
}

static int chart_row_order(const void *a, const void *b)
{
    const chart_row *x = (const chart_row *)a, *y = (const chart_row *)b;
    return x->ms != y->ms ? (x->ms > y->ms) - (x->ms < y->ms)
                          : (x->error < y->error) - (x->error > y->error);
}

/* Is it beaten by another one of its family? */
static int chart_is_beaten(const chart *c, const chart_row *row)
{
    for (int i = 0; i < c->count; i++)
        if (chart_is_of(&c->row[i], row->family) &&
            beats(c->row[i].ms, c->row[i].error, row->ms, row->error))
            return 1;
    return 0;
}

/* One block of data: a family (all of it, or its front), or with NULL the front of all. */
static void chart_block(FILE *plot, const chart *c, const char *name, const char *family,
                        int front_only)
{
    fprintf(plot, "$%s << END\n", name);
    for (int i = 0; i < c->count; i++) {
        const chart_row *row = &c->row[i];
        if (family ? chart_is_of(row, family) && !(front_only && chart_is_beaten(c, row))
                   : row->front)
            fprintf(plot, "%.5g %.5g\n", row->ms, 100 * row->error);
    }
    fprintf(plot, "END\n");
}

/* An axis with room around the outermost points. A short one has numbers at 2 and 5, too. */
static void chart_axis(FILE *plot, char axis, double low, double high)
{
    fprintf(plot, "set %crange [%g:%g]\n", axis, low, high);
    if (high > 60 * low)
        return;
    fprintf(plot, "set %ctics (", axis);
    for (double decade = pow(10, floor(log10(low))); decade < high; decade *= 10)
        fprintf(plot, "%s%g, %g, %g", decade > low ? ", " : "", decade, 2 * decade, 5 * decade);
    fprintf(plot, ")\n");
}

static void chart_ranges(FILE *plot, const chart *c)
{
    double ms[2] = {1e30, 0}, error[2] = {1e30, 0};
    for (int i = 0; i < c->count; i++) {
        ms[0] = fmin(ms[0], c->row[i].ms);
        ms[1] = fmax(ms[1], c->row[i].ms);
        error[0] = fmin(error[0], c->row[i].error);
        error[1] = fmax(error[1], c->row[i].error);
    }
    chart_axis(plot, 'x', 0.7 * ms[0], 1.4 * ms[1]);
    chart_axis(plot, 'y', 60 * error[0], 160 * error[1]); /* in per cent */
}

static void chart_axes(FILE *plot, const chart *c)
{
    fprintf(plot,
            "set title \"%s\"\n"
            "set logscale xy\n"
            "set format \"%%g\"\n"
            "set xlabel \"%s\"\n"
            "set ylabel \"relative RMS error, %%\"\n"
            "set grid xtics ytics back linetype 1 linecolor \"#e4e4e4\" linewidth 1\n"
            "set border linecolor \"#444444\"\n"
            "set key outside right top Left reverse samplen 1.6 spacing 1.2\n"
            "set pointsize 0.8\n",
            c->title, c->across ? c->across : "time: setup + rays, ms");
}

static void chart_curves(FILE *plot, const chart *c)
{
    int others = 0;
    fprintf(plot, c->across ? "plot NaN notitle"
                            : "plot $front with steps lc \"#bbbbbb\" lw 5 title \"front\"");
    for (int i = 0; i < c->families; i++) {
        chart_style s = chart_style_of(c->family[i], &others);
        fprintf(plot, ", \\\n  $f%d with %s pt %d lc \"%s\" title \"%s\"", i,
                s.joined ? "linespoints" : "points", s.mark, s.color, s.title ? s.title : s.family);
    }
    fprintf(plot, "\n");
}

/* `folder` takes SCENE.svg, build/bench/ takes SCENE.png and the script SCENE.gp. 0 if there is no
   gnuplot. */
static int chart_draw(chart *c, const char *folder)
{
    char path[256], command[300];
    snprintf(path, sizeof path, "%s/%s.gp", report_folder, c->scene);
    FILE *plot = fopen(path, "w");
    if (!plot)
        report_die("cannot write", path);
    qsort(c->row, (size_t)c->count, sizeof c->row[0], chart_row_order);
    chart_axes(plot, c);
    chart_ranges(plot, c);
    chart_block(plot, c, "front", NULL, 1);
    for (int i = 0, others = 0; i < c->families; i++) {
        char name[16];
        snprintf(name, sizeof name, "f%d", i);
        chart_block(plot, c, name, c->family[i], chart_style_of(c->family[i], &others).joined);
    }
    fprintf(
        plot,
        "set terminal svg noenhanced size 960,560 font \"sans-serif,14\" background \"white\"\n");
    fprintf(plot, "set output \"%s/%s.svg\"\n", folder, c->scene);
    chart_curves(plot, c);
    fprintf(plot, "set terminal pngcairo noenhanced size 960,560 font \"sans,11\"\n");
    fprintf(plot, "set output \"%s/%s.png\"\nreplot\n", report_folder, c->scene);
    if (fclose(plot) != 0)
        report_die("cannot write", path);
    snprintf(command, sizeof command, "gnuplot %s", path);
    return system(command) == 0;
}

#endif
