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
#include "environment.h"
#include "fronts.h"
#include "gaussians.h"
#include "isa.h"
#include "papers.h"
#include "peers.h"
#include "plans.h"
#include "program.h"
#include "promises.h"
#include "rays.h"
#include "report.h"
#include "skip.h"
#include "specialised.h"
#include "suns.h"
#include "tables.h"

/* `fronts` comes last: it draws the points that the others have written. */
static const benchmark benchmarks[] = {
    {"rays", rays_run, NULL, LEVEL_TEST},              /* every scene by every method */
    {"depth", depth_run, NULL, LEVEL_TEST},            /* volumes of optical depth */
    {"eight", eight_run, NULL, LEVEL_TEST},            /* the scene that the targets name */
    {"gaussians", many_run, NULL, LEVEL_TEST},         /* up to 27,000 */
    {"cloud", cloud_run, NULL, LEVEL_TEST},            /* voxels, beside vdb_render */
    {"environment", env_run, NULL, LEVEL_TEST},        /* skies as constellations */
    {"suns", suns_run, NULL, LEVEL_TEST},              /* many directional lights */
    {"isa", isa_run, NULL, LEVEL_TEST},                /* instruction sets */
    {"promises", promises_run, NULL, LEVEL_TEST},      /* allocations, bits */
    {"skip", skip_run, NULL, LEVEL_TEST},              /* empty space, as Navarro et al. */
    {"specialised", special_run, NULL, LEVEL_FULL},    /* only what a scene needs */
    {"tables", tables_run, NULL, LEVEL_FULL},          /* how Giroud and Biri's tables scale */
    {"plans", plans_run, NULL, LEVEL_FULL},            /* predicted against measured */
    {"papers", papers_run, NULL, LEVEL_FULL},          /* the papers' ways at 1 % */
    {"peers", peers_run, "docs/peers.md", LEVEL_FULL}, /* POV-Ray, vdb_render: bench-peers */
    {"fronts", fronts_run, NULL, LEVEL_TEST}           /* charts */
};

static void describe_times(report *r)
{
    report_text(r, "# Speed against error");
    report_text(
        r, "Written by `make bench`; do not edit. Times belong to the machine below, "
           "ratios come from interleaved runs in one process. Times are processor time of "
           "the one thread that works, except where it says \"on the wall\". They are medians of n "
           "repeats; `~` marks one more than 10 %% above the minimum.");
    describe_processor(r);
}

static void keep_claims(report *r)
{
    report_write_claims(r, "README.md");
}

int main(int argc, char **argv)
{
    static const program bench = {benchmarks,     sizeof benchmarks / sizeof benchmarks[0],
                                  "build/bench",  "docs/report.md",
                                  "docs/charts",  "charts",
                                  describe_times, keep_claims};
    return program_run(&bench, argc, argv);
}
