# compile.sh - the steps of run.sh about compilers, symbols, names and files. Read by run.sh.
# shellcheck shell=bash
# shellcheck disable=SC2034,SC2086,SC2154

HEADERS=$(setting HEADERS)
COMPILERS="gcc:c99 clang:c99 g++:c++11 g++:c++20 clang++:c++11 clang++:c++20"

# --------------------------------------------------------------------------------- compilers

lines() { printf '%s\n' "$@"; }

# Sources for one header: units that share one implementation (user, body), and units with private
# copies of everything (alone, twin). Each program checks one number when it is run.
write_units() {
    local dir=$1 header=$2 implementation='#define SCATTER_IMPLEMENTATION'
    mkdir -p "$dir"
    cat >"$dir/test.h" <<END
#include <$header>
#include <$header>
#include <string.h>
static int is_wrong(void) {
    scatter_scene scene;
    scatter_context *context;
    scatter_ray ray = {{0, 0, 0}, {1, 0, 0}};
    scatter_sample sample;
    float depth;
    memset(&scene, 0, sizeof scene);
    scene.medium.constant = 2.0f; /* along three metres */
    depth = scatter_optical_depth(&scene.medium, scatter_v3(1, 0, 0), scatter_v3(1, 3, 0));
    if (scatter_create(NULL, &context) || scatter_update(context, &scene, NULL) ||
        scatter_radiance(context, &ray, NULL, &sample)) /* with all that renders */
        return 1;
    scatter_destroy(context);
    return !(depth > 5.999f && depth < 6.001f);
}
END
    lines '#include "test.h"' 'int main(void) { return is_wrong(); }' >"$dir/user.c"
    lines "$implementation" "#include <$header>" "#include <$header>" >"$dir/body.c"
    lines '#define SCATTER_STATIC' "$implementation" '#include "test.h"' 'int twin(void);' \
        'int main(void) { return is_wrong() + twin(); }' >"$dir/alone.c"
    lines '#define SCATTER_STATIC' "$implementation" '#include "test.h"' 'int twin(void);' \
        'int twin(void) { return is_wrong(); }' >"$dir/twin.c"
}

# strict COMPILER:STANDARD OPTION...: the strict warnings that this language knows.
strict() {
    local compiler=${1%%:*} standard=${1#*:} warnings=$WARNINGS language=c
    shift
    case $standard in
    c++*) language=c++ warnings=${WARNINGS/-Wstrict-prototypes/} ;;
    esac
    $compiler -std=$standard $warnings -x $language "$@"
}

# build_units DIR HEADERS_DIR COMPILER:STANDARD UNIT UNIT: two units make one program, which runs.
build_units() {
    local dir=$1 headers=$2 how=$3 a=$4 b=$5 object
    object=$dir/$(echo "$how" | tr ':+' '_p')
    strict $how -I"$headers" -c "$dir/$a.c" -o "$object.$a.o" || return
    strict $how -I"$headers" -c "$dir/$b.c" -o "$object.$b.o" || return
    ${how%%:*} "$object.$a.o" "$object.$b.o" -o "$object.$a" -lm || return
    "$object.$a" || { echo "$object.$a: wrong result"; return 1; }
}

# plant NAME LINE [PATTERN]: a copy of the headers in build/test/planted/NAME, with the line added
# to scatter.h after each line that matches.
plant() {
    mkdir -p "$PLANTED/$1"
    cp $HEADERS "$PLANTED/$1"
    sed -i "/${3-^#include <stddef.h>}/a $2" "$PLANTED/$1/scatter.h"
}

title_compile="each header by itself, twice, in two units, static in two units; C99, C++11, C++20"
step_compile() {
    local header how dir
    plant warning 'static float scatteri_planted(double x) { return x; }'
    plant body 'void scatteri_planted(void); void scatteri_planted(void) {}'
    for header in $HEADERS; do
        dir=$OUT/units/$header
        write_units "$dir" $header
        for how in $COMPILERS; do
            later check "$header, $how, shared" build_units "$dir" . $how user body
            later check "$header, $how, static" build_units "$dir" . $how alone twin
        done
    done
    dir=$OUT/units/scatter.h
    later check "g++ -O2 sees no more" strict g++:c++20 -O2 -I. -c "$dir/body.c" -o "$dir/body.o"
    gather
    for how in $COMPILERS; do
        later refuse "$how: a warning" 'W(error=)?.*(conversion|unused)' \
            build_units "$dir" "$PLANTED/warning" $how user body
    done
    gather
    refuse "shared units: a definition in the header" 'multiple definition' \
        build_units "$dir" "$PLANTED/body" gcc:c99 user body
    cp -r "$dir" "$PLANTED/units"
    sed -i '/SCATTER_STATIC/d' "$PLANTED"/units/*.c
    refuse "static units: without SCATTER_STATIC" 'multiple definition' \
        build_units "$PLANTED/units" . gcc:c99 alone twin
    mixed_languages
    own_functions
}

# The gl functions that the host has declared, as OpenGL's headers and those of OpenGL ES declare them.
own_functions() {
    local dir=$OUT/own how
    mkdir -p "$dir"
    printf '#define GL_GLEXT_PROTOTYPES\n#include <GL/glcorearb.h>\n' >"$dir/gl.c"
    printf '#include <GLES3/gl3.h>\n' >"$dir/es.c"
    printf '#include <GL/gl.h>\n' >"$dir/old.c"
    for how in gl es old; do
        cat >>"$dir/$how.c" <<'END'
#define SCATTER_IMPLEMENTATION
#define SCATTER_GL_NO_LOADER
#include "scatter_gl.h"
END
    done
    for how in gcc:c99 g++:c++11; do
        check "own gl functions, $how" strict $how -O1 -I. -c "$dir/gl.c" -o "$dir/gl.o"
        check "own gl functions of ES, $how" strict $how -O1 -I. -c "$dir/es.c" -o "$dir/es.o"
    done
    refuse "own functions that are too old" 'gl(GenSamplers|CreateShader|ActiveTexture|UseProgram)' \
        strict gcc:c99 -O1 -I. -c "$dir/old.c" -o "$dir/old.o"
}

# One implementation in C serves a C++ unit.
mixed_languages() {
    local dir=$OUT/units/scatter.h
    strict gcc:c99 -O1 -I. -c "$dir/body.c" -o "$dir/mixed.body.o"
    strict g++:c++11 -O1 -I. -c "$dir/user.c" -o "$dir/mixed.user.o"
    check "C++ calls C" g++ "$dir/mixed.user.o" "$dir/mixed.body.o" -o "$dir/mixed" -lm
    check "C++ calls C, run" "$dir/mixed"
}

# ----------------------------------------------------------------- other compilers, machines

M32_SUITES="test_core test_environment test_scene test_medium test_depth test_api hard_cases"

# No 32-bit libraries are asked of the machine: tests/tiny stands in for cmocka and for the one rule
# of GSL that pictures need. The linker is told to let the other names be.
title_m32="unit tests, gcc -m32"
step_m32() {
    if ! echo 'int main(void) { return 0; }' | gcc -m32 -x c - -o "$PLANTED/m32" 2>/dev/null; then
        skip "this compiler has no -m32"
        return
    fi
    suites m32 "$M32_SUITES" CC=gcc CFLAGS="-O2 -m32 -fno-pie" CPPFLAGS=-Itests/tiny CMOCKA_LIBS= \
        MPFR_LIBS= REFERENCE_LIBS="tests/tiny/qk21.c -no-pie -Wl,--unresolved-symbols=ignore-all"
    check "they are 32-bit programs" sh -c "readelf -h $OUT/m32/test_api | grep -q ELF32"
}

# picture PROGRAM DIR: runs the minimal example there, and finds the picture that it wrote.
picture() {
    local program
    program=$(realpath "$1")
    mkdir -p "$2"
    (cd "$2" && rm -f ./*.ppm && "$program") && [ -n "$(find "$2" -name '*.ppm' -size +1k)" ]
}

# Bytes of two pictures differ by one at most: other compilers round elsewhere. cmp prints octal.
nearly_equal() {
    cmp -l "$1" "$2" | awk '
        function value(octal) {
            octal = sprintf("%03d", octal)
            return 64 * substr(octal, 1, 1) + 8 * substr(octal, 2, 1) + substr(octal, 3, 1)
        }
        { d = value($2) - value($3) }
        d < -1 || d > 1 { print "byte " $1 " differs by " d; exit 1 }'
}

title_tcc="the minimal example with tcc"
step_tcc() {
    check "tcc compiles it" tcc -Wall -Werror examples/minimal.c -o "$OUT/minimal.tcc" -lm
    check "gcc compiles it" strict gcc:c99 -O3 examples/minimal.c -o "$OUT/minimal.gcc" -lm
    check "tcc's makes a picture" picture "$OUT/minimal.tcc" "$OUT/picture.tcc"
    check "gcc's makes a picture" picture "$OUT/minimal.gcc" "$OUT/picture.gcc"
    check "the same picture" nearly_equal "$OUT"/picture.tcc/*.ppm "$OUT"/picture.gcc/*.ppm
    tr '\200' '\210' <"$(echo "$OUT"/picture.gcc/*.ppm)" >"$PLANTED/picture.ppm"
    refuse "another picture" 'differs by' \
        nearly_equal "$PLANTED/picture.ppm" "$OUT"/picture.gcc/*.ppm
}

WINDOWS=x86_64-w64-mingw32

title_mingw="the minimal example and both headers for Windows, MinGW"
step_mingw() {
    local dir header how
    for header in $HEADERS; do
        dir=$OUT/units/mingw.$header
        write_units "$dir" $header
        for how in gcc:c99 g++:c++11 g++:c++20; do
            later check "$header, $how" link_only "$dir" . $WINDOWS-$how
        done
    done
    gather
    for header in $HEADERS; do
        check "$header behind windows.h" behind_windows $header .
    done
    plant windows 'typedef struct scatter_planted { int near, far; } scatter_planted;'
    refuse "a name that windows.h takes" 'scatter_planted|error' \
        behind_windows scatter.h "$PLANTED/windows"
    check "minimal.exe" strict $WINDOWS-gcc:c99 -O1 examples/minimal.c -o "$OUT/minimal.exe" -lm
    plant warning 'static float scatteri_planted(double x) { return x; }'
    refuse "a warning" 'conversion|unused' link_only "$dir" "$PLANTED/warning" $WINDOWS-gcc:c99
}

# behind_windows HEADER HEADERS_DIR: windows.h defines near, far, min, max and more as macros.
behind_windows() {
    lines '#include <windows.h>' '#define SCATTER_IMPLEMENTATION' "#include <$1>" \
        'int main(void) { return 0; }' >"$OUT/windows.c"
    $WINDOWS-gcc -std=c99 -Wall -Werror -I"$2" -c "$OUT/windows.c" -o "$OUT/windows.o"
}

# link_only DIR HEADERS_DIR COMPILER:STANDARD: both programs of write_units.
link_only() {
    local exe
    exe=$1/$(echo "$3" | tr ':+' '_p').exe
    strict "$3" -I"$2" "$1/user.c" "$1/body.c" -o "$exe" -lm &&
        strict "$3" -I"$2" "$1/alone.c" "$1/twin.c" -o "$exe" -lm
}

# ------------------------------------------------------------------------------- vectorised

# What an image spends its time in. A loop that gcc leaves scalar costs ten times as much and says nothing.
LOOPS="aim map_light set_frame set_points find_foot shadow_foot shadow_whole shadow_quick shadow_exact
    add_some place_row stretch_row scatter add_attenuated one_panel widen_hull add_group rate_gaussians
    rate_shadows rate_fog"

# loops_are_vectors HEADER: gcc reports a vectorised loop in each function of LOOPS.
loops_are_vectors() {
    local name log=$OUT/vectors.log missing=0
    gcc -std=c99 -O3 -ffp-contract=fast -fopt-info-vec -x c -DSCATTER_IMPLEMENTATION -c "$1" \
        -o "$OUT/vectors.o" 2>"$log" || return 1
    for name in $LOOPS; do
        awk -F: -v name="scatteri_$name" '
            FILENAME == ARGV[1] && /optimized: loop vectorized/ { vector[$2] = 1 }
            FILENAME == ARGV[2] && $0 ~ "^SCATTERI_(HOT|FN).*[ *]" name "\\(" { inside = 1 }
            FILENAME == ARGV[2] && inside && vector[FNR] { found = 1 }
            FILENAME == ARGV[2] && /^}/ { inside = 0 }
            END { exit !found }' "$log" "$1" || { echo "scalar: scatteri_$name"; missing=1; }
    done
    return $missing
}

title_vectors="gcc vectorises the hot loops"
step_vectors() {
    if [ "$(uname -m)" != x86_64 ]; then
        skip "not x86-64"
        return
    fi
    check "scatter.h" loops_are_vectors scatter.h
    plant vectors '/* planted below */'
    sed -i '/HOT static void scatteri_set_frame/,/^{/s/SCATTERI_RESTRICT//' "$PLANTED/vectors/scatter.h"
    refuse "a frame whose structs may overlap" 'scalar: scatteri_set_frame' \
        loops_are_vectors "$PLANTED/vectors/scatter.h"
}

# ---------------------------------------------------------------------------- symbols, names

exported() { nm -g --defined-only "$1" | awk '{ print $3 }'; }
object() { gcc -std=c99 -O1 -fno-pic -I"$2" -c "$1" -o "$3"; }

exports_nothing() { ! exported "$1" | grep .; }
exports_only_scatter() { ! exported "$1" | grep -v '^scatter_[a-z0-9_]*$'; }
# Sections d and b are writable, C is common.
holds_no_state() { ! nm "$1" | grep -E ' [bBdDC] '; }
# What the library must not do to the program around it.
RUDE='v?f?printf|f?puts|f?putc|putchar|fwrite|stdout|stderr|abort|exit|__assert_fail'
prints_nothing() { ! nm -u "$1" | grep -wE "$RUDE"; }

title_symbols="symbols: static mode exports none, no mutable state, nothing printed"
step_symbols() {
    local header dir
    for header in $HEADERS; do
        dir=$OUT/symbols/$header
        mkdir -p "$dir"
        lines '#define SCATTER_IMPLEMENTATION' "#include <$header>" >"$dir/shared.c"
        lines '#define SCATTER_STATIC' "$(cat "$dir/shared.c")" >"$dir/static.c"
        check "$header compiles" object "$dir/shared.c" . "$dir/shared.o"
        check "$header compiles, static" object "$dir/static.c" . "$dir/static.o"
        check "$header: static mode exports nothing" exports_nothing "$dir/static.o"
        refuse "$header: otherwise it exports" scatter_ exports_nothing "$dir/shared.o"
        check "$header exports only scatter_*" exports_only_scatter "$dir/shared.o"
        check "$header holds no mutable state" holds_no_state "$dir/shared.o"
        check "$header prints nothing and ends nothing" prints_nothing "$dir/shared.o"
    done
    symbol_faults "$OUT/symbols/scatter.h"
}

symbol_faults() {
    local dir=$1 bad=$PLANTED/symbols.o
    plant global 'int scatteri_planted;'
    object "$dir/static.c" "$PLANTED/global" "$bad"
    refuse "mutable state" scatteri_planted holds_no_state "$bad"
    refuse "an exported scatteri_ name" scatteri_planted exports_only_scatter "$bad"
    plant printing 'int puts(const char *); int scatter_planted(void) { return puts(""); }'
    object "$dir/static.c" "$PLANTED/printing" "$bad"
    refuse "printing" puts prints_nothing "$bad"
}

# Names of this shape that compilers offer to programs. No program may make new ones.
MACHINE_NAMES='__x86_64__|__i386__|__ELF__|__linux__|__gnu_linux__|__GLIBC__|_WIN32|__stdcall'
COMPILER_NAMES='__cplusplus|__STDC_VERSION__|__GNUC__|__GNUC_MINOR__|__clang__|__clang_major__'
COMPILER_NAMES="$COMPILER_NAMES|__TINYC__|_MSC_VER|__SANITIZE_ADDRESS__|__SANITIZE_THREAD__"
EXTENSION_NAMES='__attribute__|__inline|__inline__|__restrict|__has_attribute|__has_feature'
EXTENSION_NAMES="$EXTENSION_NAMES|__builtin_[a-z_]*"
OFFERED_NAMES="$MACHINE_NAMES|$COMPILER_NAMES|$EXTENSION_NAMES"

# The header without comments and strings.
bare() { gcc -fpreprocessed -dD -E -P "$1" 2>/dev/null | sed 's/"\([^"\\]\|\\.\)*"//g'; }
no_reserved_names() {
    ! bare "$1" | grep -oE '[A-Za-z_][A-Za-z0-9_]*' | sort -u | grep -E '^_|__' |
        grep -vxE "$OFFERED_NAMES"
}
own_macros_only() {
    ! bare "$1" | sed -n 's/^ *# *define *\([A-Za-z0-9_]*\).*/\1/p' | sort -u |
        grep -vE '^(SCATTERI?|scatteri?)_'
}

title_names="names: none reserved, macros only SCATTER_*"
step_names() {
    local header
    for header in $HEADERS; do
        check "$header: no reserved name" no_reserved_names $header
        check "$header: its own macros only" own_macros_only $header
    done
    plant names 'static int _planted; static int also__planted;\n#define PLANTED'
    refuse "_name" '^_planted' no_reserved_names "$PLANTED/names/scatter.h"
    refuse "a__name" also__planted no_reserved_names "$PLANTED/names/scatter.h"
    refuse "a foreign macro" PLANTED own_macros_only "$PLANTED/names/scatter.h"
}

# -------------------------------------------------------------------------------------- GLSL

GLSL_VERSIONS="130 150 330 410 450 300es 310es"

is_current() { "$OUT/gcc/glsl" "$1" scatter_gl.h --check; }
accept_shader() { glslangValidator -S frag "$1"; }

title_glsl="GLSL: the shared region is up to date, it and all shaders are accepted by glslangValidator"
step_glsl() {
    local version shader
    make BUILD=$OUT/gcc CC=gcc $OUT/gcc/glsl >/dev/null
    check "scatter_gl.h is up to date" is_current scatter.h
    plant glsl 'SCATTERI_FN float scatteri_planted(float x) { return x; }' '>>core:'
    refuse "a stale region" 'out of date' is_current "$PLANTED/glsl/scatter.h"
    for version in $GLSL_VERSIONS; do
        shader=$OUT/core.$version.frag
        "$OUT/gcc/glsl" scatter.h --emit $version >"$shader"
        check "GLSL $version" accept_shader "$shader"
        { cat "$shader"; echo 'float planted(float x) { return x + true; }'; } >"$PLANTED/core.frag"
        refuse "GLSL $version: a wrong type" 'wrong operand types' \
            accept_shader "$PLANTED/core.frag"
    done
    check "all shaders, five versions" accept_shaders .
    plant shaders '/* planted below */'
    mkdir -p "$PLANTED/shaders/examples"
    cp examples/dump_shaders.c "$PLANTED/shaders/examples"
    sed -i '/^static const char scatteri_gl_density\[\] =/a "float planted(float x) { return x + true; }\\n"' \
        "$PLANTED/shaders/scatter_gl.h"
    refuse "a wrong type in a chapter" 'wrong operand types' accept_shaders "$PLANTED/shaders"
}

# accept_shaders DIR: every shader that examples/dump_shaders.c there writes.
accept_shaders() {
    local shaders=$1/build/test/shaders
    rm -rf "$shaders"
    mkdir -p "$shaders"
    gcc -std=c99 -O1 "$1/examples/dump_shaders.c" -o "$shaders.program" -lm &&
        "$shaders.program" "$shaders" && glslangValidator "$shaders"/*
}

title_glm="GLSL compiled as C++ with GLM and run on the CPU, against scatter.h"
step_glm() {
    suites glm test_glm CC=gcc CFLAGS=-O1
    refuse "a planted fault that no chapter has" 'no chapter says' planted_nowhere
    check "host_glm, clang++" strict clang++:c++20 -fsyntax-only examples/host_glm.cpp
    check "host_glm draws fog" draws_fog examples/host_glm.cpp
    host_faults
}

# draws_fog SOURCE: its picture is not flat, which would be 2 kB of PNG.
draws_fog() {
    strict g++:c++11 "$1" -o "$OUT/host_glm" -ldl -lm && "$OUT/host_glm" "$OUT/host_glm.png" &&
        [ -n "$(find "$OUT/host_glm.png" -size +8k)" ] || { echo "no picture of fog"; return 1; }
}

host_faults() {
    local bad=$PLANTED/examples
    mkdir -p "$bad"
    cp $HEADERS "$PLANTED"
    cp examples/files.h examples/gl_context.h "$bad"
    sed 's/scatter_gl_draw(fog, &view)/SCATTER_OK/' examples/host_glm.cpp >"$bad/empty.cpp"
    refuse "a host that draws no fog" 'no picture of fog' draws_fog "$bad/empty.cpp"
    sed 's/glm::vec3(0.95f)/glm::vec2(0.95f)/' examples/host_glm.cpp >"$bad/flat.cpp"
    refuse "a vector of two numbers" "no member named .*z" \
        strict g++:c++11 -fsyntax-only "$bad/flat.cpp"
}

# The tool that plants faults stops where there is nothing to replace.
planted_nowhere() {
    sed 's/"g.w \* (t - m)"/"g.w * planted"/' tests/glsl_glm.h >"$PLANTED/glsl_glm.h"
    sed "s|\"../scatter_gl.h\"|\"$PWD/scatter_gl.h\"|" tests/glsl_text.c >"$PLANTED/glsl_text.c"
    gcc -std=c99 -O1 "$PLANTED/glsl_text.c" -o "$PLANTED/glsl_text" -lm &&
        "$PLANTED/glsl_text" bad_gaussian
}

# ------------------------------------------------------------------------------------ README

# readme_example FILE [N]: the first, or N-th, block of C.
readme_example() {
    awk -v wanted="${2-1}" \
        '/^```/ { inside = !inside && $0 == "```c" && ++n == wanted; next } inside' "$1"
}
readme_has_minimal() { readme_example "$1" | diff - examples/minimal.c; }

# Files of the project in `code`, and (links) to anything but the web.
promised_files() {
    local ours='(docs|tests|examples|bench|\.ci)/[^ ]*|scatter[a-z_]*\.h|LICENSE|Makefile'
    grep -oE '`[^`]+`' "$1" | tr -d '`' | tr ' ' '\n' | grep -xE "$ours"
    grep -oE '\]\([^)#]+' "$1" | sed 's/^](//' | grep -v '^https*:'
}
readme_files_exist() {
    local file missing=0
    for file in $(promised_files "$1" | sort -u); do
        [ -e "$file" ] || { echo "promised, but not there: $file"; missing=1; }
    done
    for file in $(grep -oE '(^|`)make [a-z_]+' "$1" | cut -d' ' -f2 | sort -u); do
        make -n "$file" >/dev/null 2>&1 || { echo "no make target: $file"; missing=1; }
    done
    return $missing
}

# readme_sky FILE: the second block inside of a function, with what it takes for granted.
readme_sky() {
    lines '#define SCATTER_STATIC' '#define SCATTER_IMPLEMENTATION' '#include "scatter.h"' \
        'int use(const scatter_scene *scene);' 'int sky(const float *pixels, float angle);' \
        'int sky(const float *pixels, float angle) {' 'scatter_scene scene = {0};' \
        "$(readme_example "$1" 2)" 'return use(&scene); }' >"$OUT/readme/sky.c"
    strict gcc:c99 -Wno-missing-field-initializers -I. -c "$OUT/readme/sky.c" -o "$OUT/readme/sky.o"
}

title_readme="README: its example is examples/minimal.c and works, its files exist"
step_readme() {
    local dir=$OUT/readme
    check "the example is examples/minimal.c" readme_has_minimal README.md
    mkdir -p "$dir/examples"
    cp $HEADERS "$dir"
    readme_example README.md >"$dir/examples/fog.c"
    check "compiles" strict gcc:c99 -O2 "$dir/examples/fog.c" -o "$dir/fog" -lm
    check "makes a picture" picture "$dir/fog" "$dir/picture"
    check "the sky compiles" readme_sky README.md
    sed 's/scatter_turn_lights(lights/scatter_turn_lights(sky/' README.md >"$PLANTED/README.md"
    refuse "a sky that is no lights" 'incompatible type' readme_sky "$PLANTED/README.md"
    check "its files and targets exist" readme_files_exist README.md
    sed 's/scatter_render(/scatter_rendered(/' README.md >"$PLANTED/README.md"
    refuse "an example that differs" scatter_render readme_has_minimal "$PLANTED/README.md"
    echo 'See `docs/planted.md` and `make planted`.' >>"$PLANTED/README.md"
    refuse "a missing file" docs/planted.md readme_files_exist "$PLANTED/README.md"
    refuse "a missing target" 'target: planted' readme_files_exist "$PLANTED/README.md"
}

# ----------------------------------------------------------------------------------- install

write_consumer() {
    mkdir -p "$1"
    lines '#define SCATTER_IMPLEMENTATION' '#include <scatter_gl.h>' \
        'int main(void) { return scatter_v3(0.0f, 1.0f, 0.0f).y > 0.0f ? 0 : 1; }' >"$1/main.c"
    cp "$1/main.c" "$1/main.cpp"
    cat >"$1/CMakeLists.txt" <<'END'
cmake_minimum_required(VERSION 3.10)
project(consumer C CXX)
find_package(scatter 0.1 REQUIRED)
add_executable(consumer main.c)
add_executable(consumerxx main.cpp)
target_link_libraries(consumer scatter::scatter)
target_link_libraries(consumerxx scatter::scatter)
END
}

consume_pkg_config() {
    local flags
    flags=$(PKG_CONFIG_PATH=$1/share/pkgconfig pkg-config --cflags --libs scatter) || return
    gcc "$2/main.c" -o "$2/main" $flags && "$2/main"
}

consume_cmake() {
    rm -rf "$2/build"
    cmake -S "$2" -B "$2/build" -DCMAKE_PREFIX_PATH="$1" && cmake --build "$2/build" &&
        "$2/build/consumer" && "$2/build/consumerxx"
}

title_install="make install, then a program by pkg-config and one by CMake"
step_install() {
    local stage=$PWD/$OUT/stage dir=$OUT/consumer
    rm -rf "$stage" "$dir"
    write_consumer "$dir"
    check "make install" make install DESTDIR="$stage" PREFIX=/opt/fog
    refuse "a consumer without the flags" 'scatter_gl.h: No such file' \
        gcc "$dir/main.c" -o "$dir/main"
    check "pkg-config" consume_pkg_config "$stage/opt/fog" "$dir"
    refuse "pkg-config: not installed" 'scatter' consume_pkg_config "$stage" "$dir"
    if command -v cmake >/dev/null; then
        check "CMake" consume_cmake "$stage/opt/fog" "$dir"
        refuse "CMake: not installed" 'scatter' consume_cmake "$stage" "$dir"
    else
        skip "no cmake"
    fi
}

# -------------------------------------------------------------------------------------- fuzz

fuzz() { make BUILD=$OUT FUZZ_SECONDS=$2 "$1"; }

title_fuzz="libFuzzer, 15 s on scene files and 15 s on descriptors"
step_fuzz() {
    later check "scene files" fuzz fuzz_scene 15
    later check "descriptors" fuzz fuzz_descriptors 15
    gather
    refuse "descriptors: an allocator that gives too little" heap-buffer-overflow \
        make BUILD="$PLANTED" FUZZ_SECONDS=15 CPPFLAGS=-DFUZZ_PLANT fuzz_descriptors
}
