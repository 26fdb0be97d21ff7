/* bench.c - speed against error. MIT licence, see LICENSE.

   `make bench` in the project's directory: prints the tables, writes docs/report.md, the charts in
   docs/charts/ and the table in README.md, and all rows as CSV to build/bench/. References are kept
   in build/bench/, so the second run is shorter. A missed target is reported, it does not fail the
   run.

   scatter-bench [--quick | --test] [NAME...]: with any of these the documents stay as they are, and
   the page goes to build/bench/report.md. NAME: only these benchmarks, see `benchmarks` below;
   peers (`make bench-peers`) has docs/peers.md for itself.
   --quick: within a minute, with fewer scenes, settings and repeats; the rest goes to
   build/bench/quick/. --test: within seconds, to see that everything runs; it writes to
   build/bench/test/ and its figures mean nothing. */
#ifndef _POSIX_C_SOURCE
#define _POSIX_C_SOURCE 200809L
#endif

#define SCATTER_IMPLEMENTATION
#include "../scatter.h"

#include "cloud.h"
#include "depth.h"
#include "eight.h"
#include "fronts.h"
#include "gaussians.h"
#include "isa.h"
#include "papers.h"
#include "peers.h"
#include "plans.h"
#include "promises.h"
#include "rays.h"
#include "report.h"
#include "specialised.h"
#include "tables.h"
#include <sys/stat.h>

/* The Makefile tells its flags with -DBENCH_FLAGS='"$(CFLAGS)"'. */
#if !defined(BENCH_FLAGS) && defined(__OPTIMIZE__)
#define BENCH_FLAGS "not told, optimised"
#elif !defined(BENCH_FLAGS)
#define BENCH_FLAGS "not told, NOT optimised"
#endif

typedef struct benchmark {
    const char *name;
    void (*run)(report *r);
    const char *page;  /* of its own, and then no part of `make bench`; NULL: part of the report */
    bench_level least; /* shorter runs leave it out, unless it is named */
} benchmark;

/* `fronts` comes last: it draws the points that the others have written. */
static const benchmark benchmarks[] = {
    {"rays", rays_run, NULL, LEVEL_TEST},              /* every scene by every method */
    {"depth", depth_run, NULL, LEVEL_TEST},            /* volumes of optical depth */
    {"eight", eight_run, NULL, LEVEL_TEST},            /* the scene that the targets name */
    {"gaussians", many_run, NULL, LEVEL_TEST},         /* up to 27,000 */
    {"cloud", cloud_run, NULL, LEVEL_TEST},            /* voxels, beside vdb_render */
    {"isa", isa_run, NULL, LEVEL_TEST},                /* instruction sets */
    {"promises", promises_run, NULL, LEVEL_TEST},      /* allocations, bits */
    {"specialised", special_run, NULL, LEVEL_FULL},    /* only what a scene needs */
    {"tables", tables_run, NULL, LEVEL_FULL},          /* how Giroud and Biri's tables scale */
    {"plans", plans_run, NULL, LEVEL_FULL},            /* predicted against measured */
    {"papers", papers_run, NULL, LEVEL_FULL},          /* the papers' ways at 1 % */
    {"peers", peers_run, "docs/peers.md", LEVEL_FULL}, /* POV-Ray, vdb_render: bench-peers */
    {"fronts", fronts_run, NULL, LEVEL_TEST}           /* charts */
};

enum { BENCHMARKS = sizeof benchmarks / sizeof benchmarks[0] };

/* Value of the first line of a file in /proc that begins with `key`; "unknown" if there is none. */
static void proc_info(const char *path, const char *key, char *value, size_t room)
{
    char line[4096];
    FILE *info = fopen(path, "r");
    snprintf(value, room, "unknown");
    while (info && fgets(line, sizeof line, info)) {
        char *colon = strchr(line, ':');
        if (strncmp(line, key, strlen(key)) != 0 || !colon)
            continue;
        snprintf(value, room, "%s", colon + 1 + strspn(colon + 1, " \t"));
        value[strcspn(value, "\n")] = '\0';
        break;
    }
    if (info)
        fclose(info);
}

/* "SSE2, AVX2, ..." */
static void instruction_sets(char *list, size_t room)
{
    static const char *const flag[] = {" sse2", " avx2", " fma", " avx512f"};
    static const char *const name[] = {"SSE2", "AVX2", "FMA", "AVX-512"};
    char flags[4096];
    size_t length = 0;
    proc_info("/proc/cpuinfo", "flags", flags, sizeof flags);
    list[0] = '\0';
    for (int i = 0; i < 4; i++)
        if (strstr(flags, flag[i]))
            length +=
                (size_t)snprintf(list + length, room - length, "%s%s", length ? ", " : "", name[i]);
}

static void describe_machine(report *r)
{
    char model[256], mhz[64], memory[64], sets[64];
    proc_info("/proc/cpuinfo", "model name", model, sizeof model);
    proc_info("/proc/cpuinfo", "cpu MHz", mhz, sizeof mhz);
    proc_info("/proc/meminfo", "MemTotal", memory, sizeof memory);
    instruction_sets(sets, sizeof sets);
    report_text(r, "# Speed against error");
    report_text(
        r, "Written by `make bench`; do not edit. Times belong to the machine below, "
           "ratios come from interleaved runs in one process. Times are processor time of "
           "the one thread that works, except where it says \"on the wall\". They are medians of n "
           "repeats; `~` marks one more than 10 %% above the minimum.");
    report_text(
        r, "Machine: %s, %d processors, %s MHz, %.1f GiB of memory, %s. Compiler: %s, flags: %s.",
        model, processors(), mhz, strtod(memory, NULL) / 1048576, sets,
#ifdef __clang__
        __VERSION__,
#elif defined(__GNUC__)
        "gcc " __VERSION__,
#else
        "unknown",
#endif
        BENCH_FLAGS);
}

/* Takes the level away from the front of the arguments. */
static int read_level(int argc, char **argv)
{
    static const char *const names[] = {"--test", "--quick"};
    for (int i = 0; argc > 1 && i < 2; i++)
        if (strcmp(argv[1], names[i]) == 0) {
            level = (bench_level)i;
            return 2;
        }
    return 1;
}

static void describe_level(report *r)
{
    if (level == LEVEL_QUICK)
        report_text(r,
                    "A QUICK run: fewer scenes, smaller images and volumes, fewer repeats than the "
                    "text and the targets say.");
    if (level == LEVEL_TEST)
        report_text(r, "A TEST run: it shows that everything runs; its figures mean nothing.");
}

static int is_wanted(const benchmark *b, int count, char **names)
{
    for (int i = 0; i < count; i++)
        if (strcmp(b->name, names[i]) == 0)
            return 1;
    return count == 0 && !b->page && level >= b->least;
}

/* Where the tables go: only the full report and pages of a benchmark's own are kept. */
static const char *page_of(int full, int count, char **names)
{
    for (int i = 0; count == 1 && level == LEVEL_FULL && i < BENCHMARKS; i++)
        if (benchmarks[i].page && strcmp(benchmarks[i].name, names[0]) == 0)
            return benchmarks[i].page;
    return full                  ? "docs/report.md"
           : level == LEVEL_TEST ? "build/bench/test/report.md"
                                 : "build/bench/report.md";
}

/* Nothing of a shorter run may be taken for what a full run has left. */
static void make_folders(int full)
{
    if (full) {
        report_charts = "docs/charts";
        report_link = "charts";
    } else if (level != LEVEL_FULL) {
        report_folder = level == LEVEL_TEST ? "build/bench/test" : "build/bench/quick";
        report_charts = report_folder;
        report_link = level == LEVEL_TEST ? "." : "quick";
    }
    mkdir("build", 0777);
    mkdir("build/bench", 0777);
    mkdir(report_folder, 0777);
    mkdir(report_charts, 0777);
}

static int run_all(report *r, int count, char **names)
{
    int ran = 0;
    for (int i = 0; i < BENCHMARKS; i++)
        if (is_wanted(&benchmarks[i], count, names)) {
            double start = wall_ms();
            benchmarks[i].run(r);
            fprintf(stderr, "%s: %.0f s\n", benchmarks[i].name, (wall_ms() - start) * 1e-3);
            ran++;
        }
    return ran;
}

/* Only a full run of everything writes what docs/ shows and README.md quotes. */
int main(int argc, char **argv)
{
    report *r = (report *)malloc(sizeof *r);
    double start = wall_ms();
    int names = read_level(argc, argv), all = names == argc, full = all && level == LEVEL_FULL;
    if (!r)
        return 1;
    check_measures();
    check_charts();
    make_folders(full);
    if (all)
        chart_forget(report_folder, ".points.csv");
    if (full)
        chart_forget("docs/charts", ".svg");
    report_open(r, page_of(full, argc - names, argv + names));
    report_turn_to(r, REPORT_HEAD);
    describe_machine(r);
    describe_level(r);
    report_turn_to(r, REPORT_BODY);
    int ran = run_all(r, argc - names, argv + names);
    report_turn_to(r, REPORT_HEAD);
    report_summary(r);
    report_close(r);
    if (full)
        report_write_claims(r, "README.md");
    free(r);
    fprintf(stderr, "%d benchmarks in %.0f s\n", ran, (wall_ms() - start) * 1e-3);
    return ran ? 0 : 2;
}
