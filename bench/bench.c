/* bench.c - speed against error. MIT licence, see LICENSE.

   `make bench` in the project's directory: prints the tables, writes them to docs/report.md, and
   all rows as CSV to build/bench/. References are kept in build/bench/, so the second run is
   shorter. A missed target is reported, it does not fail the run.

   Names of benchmarks as arguments (depth rays eight gaussians cloud promises) run only those, and
   leave docs/report.md alone: the page goes to build/bench/report.md. */
#ifndef _POSIX_C_SOURCE
#define _POSIX_C_SOURCE 200809L
#endif

#define SCATTER_IMPLEMENTATION
#include "../scatter.h"

#include "cloud.h"
#include "depth.h"
#include "eight.h"
#include "gaussians.h"
#include "promises.h"
#include "rays.h"
#include "report.h"
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
} benchmark;

static const benchmark benchmarks[] = {{"depth", depth_run}, {"rays", rays_run},
                                       {"eight", eight_run}, {"gaussians", many_run},
                                       {"cloud", cloud_run}, {"promises", promises_run}};

enum { BENCHMARKS = sizeof benchmarks / sizeof benchmarks[0] };

/* Value of the first line of /proc/cpuinfo that begins with `key`; "unknown" if there is none. */
static void cpu_info(const char *key, char *value, size_t room)
{
    char line[4096];
    FILE *info = fopen("/proc/cpuinfo", "r");
    snprintf(value, room, "unknown");
    while (info && fgets(line, sizeof line, info)) {
        char *colon = strchr(line, ':');
        if (strncmp(line, key, strlen(key)) != 0 || !colon)
            continue;
        snprintf(value, room, "%s", colon + 2);
        value[strcspn(value, "\n")] = '\0';
        break;
    }
    if (info)
        fclose(info);
}

static const char *widest_vectors(void)
{
    char flags[4096];
    cpu_info("flags", flags, sizeof flags);
    return strstr(flags, " avx512f") ? "AVX-512"
           : strstr(flags, " avx2")  ? "AVX2"
                                     : "neither AVX2 nor AVX-512";
}

static void describe_machine(report *r)
{
    char model[256], mhz[64];
    cpu_info("model name", model, sizeof model);
    cpu_info("cpu MHz", mhz, sizeof mhz);
    report_text(r, "# Speed against error");
    report_text(r,
                "Written by `make bench`; do not edit. Times belong to the machine below, "
                "ratios come from interleaved runs in one process. Times are processor time of "
                "the one thread that works, except for the cloud, where they are time on the "
                "wall. `~` marks a median more than 10 %% above the minimum.");
    report_text(r, "Machine: %s, %d processors, %s MHz, %s. Compiler: %s, flags: %s.", model,
                processors(), mhz, widest_vectors(),
#ifdef __clang__
                __VERSION__,
#elif defined(__GNUC__)
                "gcc " __VERSION__,
#else
                "unknown",
#endif
                BENCH_FLAGS);
}

static int is_wanted(const char *name, int count, char **names)
{
    for (int i = 0; i < count; i++)
        if (strcmp(name, names[i]) == 0)
            return 1;
    return count == 0;
}

int main(int argc, char **argv)
{
    report *r = (report *)malloc(sizeof *r);
    double start = wall_ms();
    int ran = 0;
    if (!r)
        return 1;
    check_measures();
    mkdir("build", 0777);
    mkdir("build/bench", 0777);
    report_open(r, argc > 1 ? "build/bench/report.md" : "docs/report.md");
    describe_machine(r);
    for (int i = 0; i < BENCHMARKS; i++)
        if (is_wanted(benchmarks[i].name, argc - 1, argv + 1)) {
            benchmarks[i].run(r);
            ran++;
        }
    report_summary(r);
    report_close(r);
    free(r);
    fprintf(stderr, "%d benchmarks in %.0f s\n", ran, (wall_ms() - start) * 1e-3);
    return ran ? 0 : 2;
}
