/* program.h - what the programs of the benchmarks share: how they are called, which benchmarks run,
   where their pages and tables go, what the machine is. MIT licence, see LICENSE.

   PROGRAM [--quick | --test] [NAME...]: with any of these the documents stay as they are, and the
   page goes to the program's folder. NAME: only these benchmarks. */
#ifndef SCATTER_BENCH_PROGRAM_H
#define SCATTER_BENCH_PROGRAM_H

#include "chart.h"
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

typedef struct program {
    const benchmark *benchmarks;
    int count;
    const char *folder, *page;  /* build/bench; of a full run of everything: docs/report.md */
    const char *charts, *link;  /* and its charts: the folder, and where the page finds them */
    void (*describe)(report *); /* begins the page */
    void (*keep)(report *);     /* what else a full run of everything writes */
} program;

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

/* Processor, memory, compiler. */
static void describe_processor(report *r)
{
    char model[256], mhz[64], memory[64], sets[64];
    proc_info("/proc/cpuinfo", "model name", model, sizeof model);
    proc_info("/proc/cpuinfo", "cpu MHz", mhz, sizeof mhz);
    proc_info("/proc/meminfo", "MemTotal", memory, sizeof memory);
    instruction_sets(sets, sizeof sets);
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
static const char *page_of(const program *p, int full, int count, char **names)
{
    static char path[128];
    for (int i = 0; count == 1 && level == LEVEL_FULL && i < p->count; i++)
        if (p->benchmarks[i].page && strcmp(p->benchmarks[i].name, names[0]) == 0)
            return p->benchmarks[i].page;
    snprintf(path, sizeof path, "%s%s/report.md", p->folder, level == LEVEL_TEST ? "/test" : "");
    return full ? p->page : path;
}

/* Nothing of a shorter run may be taken for what a full run has left. */
static void make_folders(const program *p, int full)
{
    static char shorter[128];
    snprintf(shorter, sizeof shorter, "%s/%s", p->folder, level == LEVEL_TEST ? "test" : "quick");
    report_folder = level == LEVEL_FULL ? p->folder : shorter;
    report_charts = full ? p->charts : report_folder;
    report_link = full ? p->link : level == LEVEL_QUICK ? "quick" : ".";
    mkdir("build", 0777);
    mkdir("build/bench", 0777);
    mkdir(p->folder, 0777);
    mkdir(report_folder, 0777);
    mkdir(report_charts, 0777);
}

static int run_all(const program *p, report *r, int count, char **names)
{
    int ran = 0;
    for (int i = 0; i < p->count; i++)
        if (is_wanted(&p->benchmarks[i], count, names)) {
            double start = wall_ms();
            p->benchmarks[i].run(r);
            fprintf(stderr, "%s: %.0f s\n", p->benchmarks[i].name, (wall_ms() - start) * 1e-3);
            ran++;
        }
    return ran;
}

/* Only a full run of everything writes what docs/ shows. */
static int program_run(const program *p, int argc, char **argv)
{
    report *r = (report *)malloc(sizeof *r);
    double start = wall_ms();
    int names = read_level(argc, argv), all = names == argc, full = all && level == LEVEL_FULL;
    if (!r)
        return 1;
    check_measures();
    check_charts();
    make_folders(p, full);
    if (all)
        chart_forget(report_folder, ".points.csv");
    if (full)
        chart_forget(p->charts, ".svg");
    report_open(r, page_of(p, full, argc - names, argv + names));
    report_turn_to(r, REPORT_HEAD);
    p->describe(r);
    describe_level(r);
    report_turn_to(r, REPORT_BODY);
    int ran = run_all(p, r, argc - names, argv + names);
    report_turn_to(r, REPORT_HEAD);
    report_summary(r);
    if (full)
        p->keep(r);
    report_close(r);
    free(r);
    fprintf(stderr, "%d benchmarks in %.0f s\n", ran, (wall_ms() - start) * 1e-3);
    return ran ? 0 : 2;
}

#endif
