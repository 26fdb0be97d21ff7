#!/usr/bin/env bash
# run.sh [STEP...]: runs the named steps, or all. The last line is "N passed, N failed, N skipped".
#
# A step is a function step_NAME, here, in compile.sh or gpu.sh, with its title in title_NAME. It
# counts one result for each check, and one for each test that a unit test program reports. Planted
# faults go through `refuse`: the command must fail, and for the reason that it is given.
# shellcheck disable=SC2013,SC2030,SC2031,SC2034,SC2048,SC2086
set -u
cd "$(dirname "$0")/.." || exit 1
unset MAKEFLAGS MFLAGS MAKELEVEL
export LC_ALL=C
STEPS="counting unit_gcc unit_clang sanitize m32 accuracy scenes skies scenes_gl compile symbols names"
STEPS="$STEPS vectors tcc mingw glsl glm readme install bench fuzz"
JOBS=$(nproc)
OUT=build/test
PLANTED=$OUT/planted # copies of project files with a fault in them

# setting NAME: what the Makefile sets NAME to.
setting() { sed -n "s/^$1 = //p" Makefile; }
SUITES=$(setting SUITES)
SANITIZE=$(setting SANITIZE)
WARNINGS="$(setting WARNINGS) -Werror"

passed=0 failed=0 skipped=0

# ---------------------------------------------------------------------------------- counting

pass() { passed=$((passed + 1)); }

skip() {
    skipped=$((skipped + 1))
    echo "  skipped: $1"
}

# fail NAME [LOG]: shows the end of the log.
fail() {
    failed=$((failed + 1))
    echo "  FAILED: $1"
    [ -z "${2-}" ] || tail -n 12 "$2" | sed 's/^/    /'
}

# check NAME COMMAND...: the command must succeed.
check() {
    local name=$1 log=$OUT/log.$BASHPID
    shift
    if "$@" >"$log" 2>&1; then pass; else fail "$name" "$log"; fi
}

# refuse NAME PATTERN COMMAND...: the command must fail, and its output match the pattern.
refuse() {
    local name=$1 pattern=$2 log=$OUT/log.$BASHPID
    shift 2
    if "$@" >"$log" 2>&1; then
        fail "$name: the planted fault was not caught"
    elif grep -Eq -- "$pattern" "$log"; then
        pass
    else
        fail "$name: refused, but not because of '$pattern'" "$log"
    fi
}

# later check|refuse ...: the same beside others, as many at once as there are cores; `gather`
# waits for them and counts.
later() {
    while [ "$(jobs -rp | wc -l)" -ge "$JOBS" ]; do wait -n; done
    (
        passed=0 failed=0 skipped=0
        "$@" >"$OUT/later.$BASHPID.out"
        echo "$passed $failed $skipped" >"$OUT/later.$BASHPID.count"
    ) &
}

gather() {
    local a b c
    wait
    cat "$OUT"/later.*.out
    while read -r a b c; do
        passed=$((passed + a)) failed=$((failed + b)) skipped=$((skipped + c))
    done < <(cat "$OUT"/later.*.count)
    rm -f "$OUT"/later.*
}

# -------------------------------------------------------------------------------- unit tests

# suites NAME "SUITE..." VARIABLE=VALUE...: builds the suites with make, runs them and counts.
suites() {
    local build=$OUT/$1 list=$2 log logs
    shift 2
    logs=$(printf "$build/%s.log " $list)
    rm -f $logs
    make -k -j"$JOBS" BUILD="$build" WARNINGS="$WARNINGS" "$@" $logs >"$build.log" 2>&1 ||
        grep -Ei '(error|warning):' "$build.log" | head -n 20 | sed 's/^/    /'
    for log in $logs; do count_log "$log"; done
}

# Counts the tests in the log of a unit test program; a test that never reported has failed.
count_log() {
    local log=$1 all ok left bad
    if [ ! -s "$log" ]; then
        fail "$log: did not build"
        return
    fi
    all=$(sum_log "$log" 's/.*\[==========\] Running \([0-9]*\) test.*/\1/p')
    left=$(sum_log "$log" 's/.*\[  SKIPPED \] \([0-9]*\) test(s).*/\1/p')
    ok=$(grep -c '\[       OK \]' "$log")
    bad=$((all - ok - left))
    if [ "$bad" = 0 ] && { [ "$all" = 0 ] || ! grep -q '^exit status 0$' "$log"; }; then bad=1; fi
    passed=$((passed + ok)) failed=$((failed + bad)) skipped=$((skipped + left))
    [ "$bad" = 0 ] || show_failures "$log"
}

sum_log() { sed -n "$2" "$1" | awk '{ n += $1 } END { print n + 0 }'; }

show_failures() {
    echo "  FAILED in $1:"
    grep -vE '\[ RUN      \]|\[       OK \]' "$1" | tail -n 30 | sed 's/^/    /'
}

title_unit_gcc="unit tests, gcc -O3"
step_unit_gcc() { suites gcc "$SUITES" CC=gcc; }

title_unit_clang="unit tests, clang -O3"
step_unit_clang() { suites clang "$SUITES" CC=clang; }

title_sanitize="unit tests, ASan and UBSan"
step_sanitize() {
    suites sanitize "$SUITES" CC=clang CFLAGS="-O1 -g $SANITIZE"
    echo '#include <stdlib.h>
        int main(int n, char **v) { return v && ((char *)malloc(4))[n + 3]; }' >"$PLANTED/heap.c"
    echo 'int main(int n, char **v) { return v && 2147483647 + n > 0; }' >"$PLANTED/overflow.c"
    clang $SANITIZE "$PLANTED/heap.c" -o "$PLANTED/heap"
    clang $SANITIZE "$PLANTED/overflow.c" -o "$PLANTED/overflow"
    refuse "sanitizer: read past a block" heap-buffer-overflow "$PLANTED/heap"
    refuse "sanitizer: integer overflow" "signed integer overflow" "$PLANTED/overflow"
}

# ---------------------------------------------------------------------------------- accuracy

# has_rows PAGE: the page has each row that the hard cases print, with its bound (some are computed,
# so 10 % may lie between two machines), none but these, and no number above its bound.
has_rows() {
    awk -F' *[|] *' '
        NR == FNR { if (/^row /) bound[$2] = $4; next }
        /^\| --- \| --- \| --- \| --- \|$/ { inside = 1; next }
        /^<!-- end of hard cases/ { inside = 0 }
        !inside { next }
        !($2 in bound) { print "no such case: " $2; bad = 1; next }
        !($5 + 0 <= $4 + 0) { print "above its bound: " $2; bad = 1 }
        $4 + 0 > 1.1 * bound[$2] || $4 + 0 < 0.9 * bound[$2] { print "another bound: " $2; bad = 1 }
        { delete bound[$2]; rows++ }
        END {
            for (name in bound) { print "missing: " name; bad = 1 }
            exit bad || !rows
        }' "$OUT/gcc/hard_cases.log" "$1"
}

title_accuracy="docs/accuracy.md: each hard case has its row, within its bound"
step_accuracy() {
    local bad=$PLANTED/accuracy.md row='orthographic camera, 64 nodes'
    [ -e "$OUT/gcc/hard_cases.log" ] || make BUILD=$OUT/gcc CC=gcc $OUT/gcc/hard_cases.log >/dev/null
    check "the table of hard cases" has_rows docs/accuracy.md
    grep -v "^| $row" docs/accuracy.md >"$bad"
    refuse "a row less" "missing: $row" has_rows "$bad"
    sed "s/^\(| $row .*\)| [^|]* |$/\1| 1 |/" docs/accuracy.md >"$bad"
    refuse "a number above its bound" "above its bound: $row" has_rows "$bad"
    sed "s/^| $row/| planted/" docs/accuracy.md >"$bad"
    refuse "a row that nothing prints" 'no such case: planted' has_rows "$bad"
    sed "s/^\(| $row .*\)| [^|]* | \([^|]*\) |$/\1| 1 | \2 |/" docs/accuracy.md >"$bad"
    refuse "a looser bound" "another bound: $row" has_rows "$bad"
}

# ------------------------------------------------------------------------------------ scenes

has_data() {
    local file
    for file in $(sed -n "$(setting FILES)" "$1"); do
        [ -e "$(dirname "$1")/$file" ] || return 1
    done
}

# scatter-render fails where a pixel is not finite.
render() { "$OUT/gcc/scatter-render" "$1" --size 48x36 --out "$OUT/scene.$BASHPID.pfm"; }

# agrees SCENE REFERENCE: within the 0.5 % that 16 nodes promise for smooth scenes.
agrees() {
    local error
    error=$("$OUT/gcc/scatter-render" "$1" --size 48x36 --reference "$2" --json |
        sed -n 's/.*"rel_rmse": *\([0-9.e+-]*\),.*/\1/p')
    echo "relative error: $error, above 0.005"
    awk -v e="$error" 'BEGIN { exit !(e != "" && e + 0 <= 0.005) }'
}

refer() {
    "$OUT/gcc/scatter-reference" "$1" --size 48x36 --threads "$JOBS" --out "$2" && agrees "$1" "$2"
}

title_scenes="the scenes: finite; the smooth ones as the reference has them"
step_scenes() {
    local scene name
    make -j"$JOBS" BUILD=$OUT/gcc CC=gcc all $OUT/gcc/scatter-reference >$OUT/programs.log 2>&1
    for scene in examples/scenes/*.scatter examples/skies/*.scatter; do
        name=$(basename "$scene" .scatter)
        if ! has_data "$scene"; then
            skip "$name: no data"
            continue
        fi
        later check "$name" render "$scene"
        # The reference takes minutes for a thousand Gaussians.
        if grep -qi '# smooth' "$scene" && [ "$(grep -c '^gaussian' "$scene")" -lt 100 ]; then
            check "$name, reference" refer "$scene" $OUT/$name.pfm
        fi
    done
    gather
    refuse "another scene" above agrees examples/scenes/two_lights.scatter $OUT/one_gaussian.pfm
}

# -------------------------------------------------------------------------------------- skies

# A scene of a puff under a sky that scatter-render has drawn, and volumes of two sizes.
write_sky() {
    mkdir -p "$1"
    "$OUT/gcc/scatter-render" examples/scenes/spot.scatter --size 32x16 --out "$1/sky.hdr"
    lines 'image 24 16' 'camera perspective 0 0 -4 0 0 0 0 1 0 40' 'medium 2 2 2 0.9 0.9 0.9' \
        'grid a_8x8x8_u8.raw -1 -1 -1 1 1 1 1' 'light environment sky.hdr 2 12' >"$1/puff.scatter"
    head -c 512 /dev/zero | tr '\0' '\200' >"$1/a_8x8x8_u8.raw"
    head -c 512 /dev/zero | tr '\0' '\040' >"$1/b_8x8x8_u8.raw"
    head -c 216 /dev/zero >"$1/c_6x6x6_u8.raw"
}

# frames OPTION...: a turntable of that puff into files called f0000.png and on.
frames() {
    rm -f "$SKY"/f*.png
    "$OUT/gcc/scatter-turntable" "$SKY/puff.scatter" --out "$SKY/f" "$@"
}

same_frames() { cmp "$SKY/f000$1.png" "$SKY/f000$2.png"; }

# turned OPTION...: the puff as .pfm.
turned() { "$OUT/gcc/scatter-render" "$SKY/puff.scatter" --out "$@"; }

# skips_nothing OPTION...: the same picture but for rounding, 1e-6, through other steps.
skips_nothing() {
    local options="--ray march --nodes 64" error
    turned "$SKY/march.pfm" $options || return
    error=$(turned "$SKY/x.pfm" $options "$@" --reference "$SKY/march.pfm" --json |
        sed -n 's/.*"rel_rmse": *\([0-9.e+-]*\),.*/\1/p')
    echo "relative error: $error, above 1e-6"
    awk -v e="$error" 'BEGIN { exit !(e != "" && e + 0 <= 1e-6) }'
}

memory() { turned "$SKY/x.pfm" --json "$@" | sed -n 's/.*"bytes": \([0-9]*\).*/\1/p'; }

no_allocations() { cat "$1" && grep -q ' 0 allocations behind frame 2$' "$1"; }

# rising_puffs FRAMES: what scatter-generate makes, without an allocation.
rising_puffs() {
    "$OUT/gcc/scatter-generate" puffs "$1" "$SKY/puffs" >"$SKY/puffs.scatter" || return
    "$OUT/gcc/scatter-turntable" "$SKY/puffs.scatter" --size 24x36 --frames "$1" --out "$SKY/f" \
        --sequence "$SKY"/puffs_*.raw >"$SKY/said" || return
    no_allocations "$SKY/said"
}

sequence_checks() {
    local a=$SKY/a_8x8x8_u8.raw b=$SKY/b_8x8x8_u8.raw
    frames --frames 6 --degrees 0 --sequence "$a" "$b" "$b" >"$SKY/said"
    check "a sequence comes again" same_frames 0 3
    check "a volume twice is the same frame" same_frames 1 2
    refuse "other volumes" differ same_frames 0 1
    check "a sequence allocates nothing" no_allocations "$SKY/said"
    sed 's/ 0 alloc/ 1 alloc/' "$SKY/said" >"$PLANTED/said"
    refuse "one allocation" '1 allocations' no_allocations "$PLANTED/said"
    refuse "volumes of two sizes" '6x6x6_u8.raw: expected 8x8x8 voxels' \
        frames --frames 2 --sequence "$a" "$SKY/c_6x6x6_u8.raw"
    refuse "a volume that is not there" 'cannot be opened' frames --frames 2 --sequence "$a" x.vdb
    refuse "no volumes" 'expected volumes' frames --frames 2 --sequence
    check "rising puffs" rising_puffs 5
    refuse "puffs that stand still" differ same_frames 0 4
    refuse "a sequence without a grid" 'expects a scene with one grid' \
        "$OUT/gcc/scatter-turntable" examples/scenes/spot.scatter --out x --frames 1 --sequence "$a"
}

title_skies="skies that turn, media that change: frames, options, allocations"
step_skies() {
    SKY=$OUT/skies
    make -j"$JOBS" BUILD=$OUT/gcc CC=gcc all >$OUT/programs.log 2>&1
    check "a sky of our own" write_sky "$SKY"
    check "frames" frames --frames 4
    refuse "half a turn" differ same_frames 0 2
    check "frames of a full turn" frames --frames 3 --degrees 1080
    check "a full turn" same_frames 0 2
    check "unturned" turned "$SKY/0.pfm"
    check "turned" turned "$SKY/90.pfm" --rotate-env 90
    check "turned thrice" turned "$SKY/-270.pfm" --rotate-env -270
    check "turned wholly" turned "$SKY/360.pfm" --rotate-env 360
    check "--rotate-env 360" cmp "$SKY/0.pfm" "$SKY/360.pfm"
    refuse "--rotate-env 90" differ cmp "$SKY/0.pfm" "$SKY/90.pfm"
    check "tone-mapped" turned "$SKY/tone.pfm" --tonemap
    refuse "--tonemap" differ cmp "$SKY/0.pfm" "$SKY/tone.pfm"
    check "--no-mask" skips_nothing --no-mask
    check "--no-distance-map" skips_nothing --no-distance-map
    check "--no-distance-map needs less memory" \
        test "$(memory --no-distance-map)" -lt "$(memory)"
    refuse "fewer steps" 'above 1e-6' skips_nothing --nodes 32
    refuse "--rotate-env far" 'expected -1000000 to' turned "$SKY/x.pfm" --rotate-env far
    refuse "no frames" 'expected a scene file, --out and --frames' frames
    refuse "0 frames" 'from 1 to 10000' frames --frames 0
    refuse "an option without a value" 'expected a value' frames --frames
    refuse "an unknown option" 'unknown option' frames --frames 1 --speed 2
    refuse "two scenes" 'expected one scene' frames --frames 1 planted
    sequence_checks
}

# ------------------------------------------------------------------------------------- bench

# The benchmark's own check of its measures, as a program. With an edit: of a copy that has it.
measures_work() {
    local dir=$PLANTED/measures
    mkdir -p "$dir"
    sed "${1-}" bench/measure.h >"$dir/measure.h"
    echo '#include "measure.h"
        int main(void) { check_measures(); return 0; }' >"$dir/main.c"
    gcc -std=c99 -D_POSIX_C_SOURCE=200809L -I"$dir" -Ibench "$dir/main.c" -o "$dir/main" -lm &&
        "$dir/main"
}

title_bench="the benchmark: all of it in its shortest form; wrong measures stop it"
step_bench() {
    local program=$OUT/bench/scatter-bench wrong="its own measures are wrong"
    check "compiles" make -j"$JOBS" BUILD=$OUT/bench CFLAGS=-O1 WARNINGS="$WARNINGS" "$program"
    check "runs" "$program" --test
    check "writes its report" grep -q '^## All targets' build/bench/test/report.md
    check "compiles, OpenGL" make BUILD=$OUT/bench CFLAGS=-O1 WARNINGS="$WARNINGS" "$program-gl"
    check "runs, OpenGL" "$program-gl" --test
    check "writes its report, OpenGL" grep -q '^## All targets' build/bench/gl/test/report.md
    check "README has a place for its table" grep -q '^<!-- make bench begin -->$' README.md
    check "measures" measures_work
    refuse "median" "$wrong" measures_work 's/0\.5 \* (t->ms/0.6 * (t->ms/'
    refuse "percentile" "$wrong" measures_work 's/value\[rank > 0 ? rank - 1 : 0\]/value[n - 1]/'
    refuse "bias" "$wrong" measures_work 's/(mean_of(value, n) - mean)/fabs(&)/'
    refuse "front" "$wrong" measures_work 's/&& (ms < other_ms || error < other_error)//'
}

# --------------------------------------------------------------------------------- self-test

# The steps above count on what a log says, so that is tested too.
title_counting="a crash, an early exit and an empty run count as failures"
step_counting() {
    local log=$PLANTED/x.log
    printf '[==========] Running 3 test(s).\n[       OK ] a\nexit status 139\n' >"$log"
    check "crash" expect_count "$log" "1 2 0"
    printf '[==========] Running 1 test(s).\n[       OK ] a\nexit status 1\n' >"$log"
    check "exit status" expect_count "$log" "1 1 0"
    printf 'exit status 0\n' >"$log"
    check "no tests" expect_count "$log" "0 1 0"
    check "no log" expect_count "$PLANTED/none.log" "0 1 0"
    refuse "planted command" "xyz" sh -c 'echo xyz; exit 1'
}

expect_count() {
    (
        passed=0 failed=0 skipped=0
        count_log "$1"
        [ "$passed $failed $skipped" = "$2" ]
    )
}

# ----------------------------------------------------------------------------------- running

# shellcheck source=tests/compile.sh
. tests/compile.sh
# shellcheck source=tests/gpu.sh
. tests/gpu.sh

run_step() {
    local title="title_$1" before="$passed $failed $skipped" start=$SECONDS
    echo "== ${!title} [$1]"
    "step_$1"
    set -- $before
    echo "   $((passed - $1)) passed, $((failed - $2)) failed, $((skipped - $3)) skipped," \
        "$((SECONDS - start)) s"
}

rm -rf "$PLANTED" "$OUT/summary" "$OUT"/later.* "$OUT"/log.*
mkdir -p "$PLANTED"
for step in ${*:-$STEPS}; do
    if declare -F "step_$step" >/dev/null; then
        run_step "$step"
    else
        fail "there is no step $step"
    fi
done
echo "$passed passed, $failed failed, $skipped skipped" | tee "$OUT/summary"
[ "$failed" = 0 ]
