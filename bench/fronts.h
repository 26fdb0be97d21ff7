/* fronts.h - benchmark: the charts of all scenes and what they say, from the points that the
 * other benchmarks wrote. MIT licence. */
#ifndef SCATTER_BENCH_FRONTS_H
#define SCATTER_BENCH_FRONTS_H

#include "chart.h"

enum { FRONTS_ERRORS = 5 };

static const double fronts_errors[FRONTS_ERRORS] = {0.1, 0.01, 0.005, 0.001, 0.0001};

typedef struct fronts {
    glob_t files; /* SCENE.points.csv */
    chart *chart; /* one for each */
    int scenes;
} fronts;

static void fronts_open(fronts *f)
{
    char pattern[128];
    snprintf(pattern, sizeof pattern, "%s/*.points.csv", report_folder);
    if (glob(pattern, 0, NULL, &f->files) != 0)
        report_die("no points for charts:", "run the benchmark `rays` first");
    f->scenes = (int)f->files.gl_pathc;
    f->chart = (chart *)malloc((size_t)f->scenes * sizeof *f->chart);
    if (!f->chart)
        must(SCATTER_OUT_OF_MEMORY, "malloc");
    for (int i = 0; i < f->scenes; i++) {
        char name[64];
        snprintf(name, sizeof name, "%s", strrchr(f->files.gl_pathv[i], '/') + 1);
        name[strcspn(name, ".")] = '\0';
        chart_read(&f->chart[i], name);
    }
}

static void fronts_close(fronts *f)
{
    globfree(&f->files);
    free(f->chart);
}

/* "3.1 ms closed/quadrature nodes 8", or nothing if no setting is that accurate. */
static void fronts_cell(report *r, const chart *c, double error)
{
    const chart_row *best = chart_fastest(c, NULL, error);
    if (best)
        report_cell(r, "%.3g ms %s %s", best->ms, best->family, best->way);
    else
        report_cell(r, "none");
}

static void fronts_table(report *r, const fronts *f)
{
    report_text(r, "The fastest of our settings that keeps an error (RMSE):");
    report_table(r, "fronts", "scene|10 %|1 %|0.5 %|0.1 %|0.01 %");
    for (int i = 0; i < f->scenes; i++) {
        report_cell(r, "%s", f->chart[i].scene);
        for (int e = 0; e < FRONTS_ERRORS; e++)
            fronts_cell(r, &f->chart[i], fronts_errors[e]);
        report_row(r, 1);
    }
    report_end(r);
}

static void fronts_charts(report *r, fronts *f)
{
    for (int i = 0; i < f->scenes; i++) {
        chart *c = &f->chart[i];
        if (!chart_draw(c, report_charts)) {
            report_text(r, "skipped: no charts (gnuplot does not run)");
            return;
        }
        report_text(r, "![%s](%s/%s.svg)", c->title, report_link, c->scene);
    }
}

static void fronts_run(report *r)
{
    fronts f;
    fronts_open(&f);
    report_turn_to(r, REPORT_FRONTS);
    report_text(r, "## Fronts");
    report_text(r, "A setting is on the front if none is at least as fast (setup + rays) and as "
                   "accurate. The front line in a chart is that of all programs in it. Below the "
                   "table a chart for each scene: discs are quadrature, circles "
                   "uniform steps, triangles the papers' own methods.");
    fronts_table(r, &f);
    fronts_charts(r, &f);
    report_turn_to(r, REPORT_BODY);
    fronts_close(&f);
}

#endif
