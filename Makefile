# Scatter. `make demo` shows what it does, `make test` shows that it is right.
#
#   all       the programs, into build/ (the default)
#   demo      set up, render the gallery
#   test      set up, run every check
#   unit      build and run all unit tests
#   test_api  build and run one unit test; so for each of tests/test_*.c
#   sanitize  unit tests under ASan and UBSan
#   fuzz      libFuzzer, FUZZ_SECONDS for each of its targets
#   bench     set up, measure speed against error, write docs/report.md (minutes)
#   bench-quick  the same in short (a minute); writes build/bench/report.md only
#   bench-gl  set up, measure scatter_gl.h on the GPU that is there, write docs/report_gl.md
#   bench-gl-quick  the same in short (a minute); writes build/bench/gl/report.md only
#   bench-peers  set up, measure POV-Ray and vdb_render beside ours
#   glsl      renew the shared region of scatter_gl.h
#   accuracy  renew the table of hard cases in docs/accuracy.md
#   install   headers, pkg-config and CMake files; PREFIX=/usr/local DESTDIR=
#
# `make test STEPS="unit_gcc fuzz"` runs only some steps; tests/run.sh lists them.
# Another compiler, other options, another place: make unit CC=clang CFLAGS=-O2 BUILD=build/clang

BUILD = build
CC = gcc
CFLAGS = -O3 -ffp-contract=fast
WARNINGS = -pedantic -Wall -Wextra -Wconversion -Wshadow -Wundef -Wstrict-prototypes
STRICT = -std=c99 $(WARNINGS) -D_POSIX_C_SOURCE=200809L
COMPILE = $(CC) $(STRICT) $(CPPFLAGS) $(CFLAGS) -MMD -MP -MF $@.d -MT $@
LINK = $(CC) $(CFLAGS)
CXX = g++
STRICT_CXX = -std=c++20 $(filter-out -Wstrict-prototypes,$(WARNINGS))
COMPILE_CXX = $(CXX) $(STRICT_CXX) $(CPPFLAGS) $(CFLAGS) -MMD -MP -MF $@.d -MT $@
LIBS = -lpthread -lm
REFERENCE_LIBS = -lgsl -lgslcblas
MPFR_LIBS = -lmpfr -lgmp
CMOCKA_LIBS = -lcmocka
SETUP = bash tests/setup.sh
FUZZ_SECONDS = 300
PREFIX = /usr/local
VERSION = 0.1.0

PROGRAMS = scatter-render scatter-turntable scatter-minimal scatter-sheet scatter-generate scatter-dump_shaders
SUITES = test_core test_reference test_scene test_medium test_depth test_ray test_api test_plan test_environment test_suns test_skip hard_cases test_host_gl test_gl_state test_gl_passes test_gl_view test_gl_api
FUZZERS = fuzz_scene fuzz_descriptors
HEADERS = scatter.h scatter_gl.h

.DELETE_ON_ERROR:
.SECONDARY:
.PHONY: all clean unit logs sanitize fuzz demo gallery test bench bench-quick bench-peers glsl accuracy
.PHONY: install bench-gl bench-gl-quick $(SUITES) test_glm $(FUZZERS)

all: $(PROGRAMS:%=$(BUILD)/%)

$(BUILD) $(BUILD)/gallery $(BUILD)/scenes $(BUILD)/fuzz:
	mkdir -p $@

clean:
	rm -rf build

# ---------------------------------------------------------------------------------- programs

$(BUILD)/scatter-%: examples/%.c | $(BUILD)
	$(COMPILE) $< -o $@ $(LIBS)

$(BUILD)/scatter-generate: examples/scenes/generate.c | $(BUILD)
	$(COMPILE) $< -o $@ $(LIBS)

$(BUILD)/scatter-host_glm: examples/host_glm.cpp | $(BUILD)
	$(COMPILE_CXX) $< -o $@ -ldl $(LIBS)

$(BUILD)/glsl: tests/glsl.c | $(BUILD)
	$(COMPILE) $< -o $@ $(LIBS)

$(BUILD)/%.o: tests/%.c | $(BUILD)
	$(COMPILE) -c $< -o $@

$(BUILD)/%.o: bench/%.c | $(BUILD)
	$(COMPILE) -DBENCH_FLAGS='"$(CFLAGS)"' $(if $(ISA_OBJECTS),-DBENCH_ISA) -c $< -o $@

# The library for one instruction set each, to compare them within one program.
ISA_x86_64 = sse2 avx2 avx512
ISA_OBJECTS = $(ISA_$(firstword $(subst -, ,$(shell $(CC) -dumpmachine))):%=$(BUILD)/isa_%.o)
MARCH_sse2 = x86-64
MARCH_avx2 = x86-64-v3
MARCH_avx512 = x86-64-v4
$(BUILD)/isa_%.o: bench/isa.c | $(BUILD)
	$(COMPILE) -march=$(MARCH_$*) -DISA_RENDER=isa_render_$* -c $< -o $@

$(BUILD)/scatter-reference: $(BUILD)/reference_main.o $(BUILD)/reference.o
	$(LINK) $^ -o $@ $(REFERENCE_LIBS) $(LIBS)

# The library with what one class of scenes needs, for comparison with the whole one.
$(BUILD)/specialised_scatter.h: bench/specialise.sh scatter.h | $(BUILD)
	bash $^ >$@

$(BUILD)/specialised.o: bench/specialised.c $(BUILD)/specialised_scatter.h
	$(COMPILE) -Wno-unused -I$(BUILD) -c $< -o $@

$(BUILD)/scatter-bench: $(BUILD)/bench.o $(BUILD)/specialised.o $(BUILD)/reference.o $(ISA_OBJECTS)
	$(LINK) $^ -o $@ $(REFERENCE_LIBS) $(LIBS)

$(BUILD)/scatter-bench-gl: $(BUILD)/bench_gl.o $(BUILD)/reference.o
	$(LINK) $^ -o $@ $(REFERENCE_LIBS) $(LIBS)

# -------------------------------------------------------------------------------- unit tests

$(BUILD)/test_core: $(BUILD)/test_core.o
	$(LINK) $^ -o $@ $(CMOCKA_LIBS) $(MPFR_LIBS) $(LIBS)

$(BUILD)/test_scene $(BUILD)/test_environment: %: %.o
	$(LINK) $^ -o $@ $(CMOCKA_LIBS) $(LIBS)

# Shaders of scatter_gl.h as C++; most of their functions and arguments are not used in each of them.
$(BUILD)/glsl_text: tests/glsl_text.c | $(BUILD)
	$(COMPILE) $< -o $@ $(LIBS)

GLM_SHADERS = $(shell sed -n 's/^ *S.\([a-z_]*\),.*/\1/p' tests/glsl_glm.h)
$(GLM_SHADERS:%=$(BUILD)/glm_%.inc): $(BUILD)/glm_%.inc: $(BUILD)/glsl_text
	$< $* >$@

GLM_WARNINGS = -Wall -Wextra -Wno-unused -Wno-unused-parameter $(filter -Werror,$(WARNINGS))
GLM_NAMES = -DGLM_TEXT='"$(<F)"' -DGLM_NAME=glm_$* -DGLM_TITLE='"$*"'
$(GLM_SHADERS:%=$(BUILD)/glm_%.o): $(BUILD)/glm_%.o: $(BUILD)/glm_%.inc tests/glsl_glm.cpp
	$(CXX) -std=c++20 $(GLM_WARNINGS) $(CFLAGS) -MMD -MP -MF $@.d -MT $@ -I$(BUILD) $(GLM_NAMES) \
	    -c tests/glsl_glm.cpp -o $@

$(BUILD)/test_glm.o: tests/test_glm.cpp | $(BUILD)
	$(COMPILE_CXX) -c $< -o $@

$(BUILD)/test_glm: $(BUILD)/test_glm.o $(GLM_SHADERS:%=$(BUILD)/glm_%.o)
	$(CXX) $(CFLAGS) $^ -o $@ $(CMOCKA_LIBS) $(LIBS)

$(BUILD)/test_gl_state: $(BUILD)/test_gl_state.o
	$(LINK) $^ -o $@ $(CMOCKA_LIBS) $(LIBS) -ldl

$(BUILD)/test_%: $(BUILD)/test_%.o $(BUILD)/reference.o
	$(LINK) $^ -o $@ $(CMOCKA_LIBS) $(REFERENCE_LIBS) $(LIBS)

$(BUILD)/hard_cases: $(BUILD)/hard_cases.o $(BUILD)/reference.o
	$(LINK) $^ -o $@ $(CMOCKA_LIBS) $(REFERENCE_LIBS) $(LIBS)

$(SUITES) test_glm: %: $(BUILD)/%
	$<

unit: $(SUITES)

# What each suite printed and how it ended, for tests/run.sh; failures are counted there.
logs: $(SUITES:%=$(BUILD)/%.log)

$(BUILD)/%.log: $(BUILD)/%
	$< >$@ 2>&1; echo "exit status $$?" >>$@

SANITIZE = -fsanitize=address,undefined -fno-sanitize-recover=all
sanitize:
	$(MAKE) unit CC=clang CFLAGS="-O1 -g $(SANITIZE)" BUILD=$(BUILD)/sanitize

# ----------------------------------------------------------------------------------- fuzzing

$(BUILD)/fuzz_%: tests/fuzz_%.c | $(BUILD)
	clang $(STRICT) $(CPPFLAGS) -O1 -g $(SANITIZE) -fsanitize=fuzzer $(INSTRUMENT_$*) \
	    -MMD -MP -MF $@.d -MT $@ $< -o $@ $(LIBS)
# Text has words to find by comparing; numbers have not, and it slows the loops over them.
INSTRUMENT_descriptors = -fno-sanitize-coverage=trace-cmp

# New inputs are kept in build/fuzz between runs, so a later run goes on where the last one ended.
$(FUZZERS): %: $(BUILD)/% | $(BUILD)/fuzz
	mkdir -p $(BUILD)/fuzz/$@
	$< -max_total_time=$(FUZZ_SECONDS) -timeout=120 -rss_limit_mb=2048 -print_final_stats=1 \
	    -artifact_prefix=$(BUILD)/fuzz/ $(OPTIONS_$@) $(BUILD)/fuzz/$@ $(SEEDS_$@)
SEEDS_fuzz_scene = examples/scenes
OPTIONS_fuzz_descriptors = -len_control=0 -max_len=2048

fuzz: $(FUZZERS)

# -------------------------------------------------------------------------------------- demo

SCENES = $(basename $(notdir $(wildcard examples/scenes/*.scatter))) cumulus_27000
SKIES = $(basename $(notdir $(wildcard examples/skies/*.scatter)))
PICTURES = $(SCENES:%=$(BUILD)/gallery/%.png)
SKY_PICTURES = $(SKIES:%=$(BUILD)/gallery/%.png)
TURNING = $(BUILD)/gallery/turning0000.png
RISING = $(BUILD)/gallery/puffs0000.png

demo:
	$(SETUP) demo
	$(MAKE) --no-print-directory gallery

gallery: $(BUILD)/gallery/sheet.png $(BUILD)/gallery/skies.png $(TURNING) $(RISING)
	@echo "pictures: $(BUILD)/gallery, all on two sheets: $(wordlist 1,2,$^)"
	@echo "frame by frame, a turning sky and changing voxels: $(TURNING), $(RISING) and on"

# A scene whose voxels or sky are not there makes no picture.
FILES = s/^ *grid  *\([^ ]*\).*/\1/p; s/^ *light  *environment  *\([^ ]*\).*/\1/p
define RENDER
@for file in $$(sed -n '$(FILES)' $<); do \
    [ -e $(<D)/$$file ] || { echo "$(<F): skipped: no data ($$file)"; exit 0; }; \
done; \
$(1)
endef

# The sky itself is no part of a scene; the first frame of a turntable shows it.
FRAMES = $(BUILD)/scatter-turntable $< --out

$(BUILD)/gallery/%.png: examples/scenes/%.scatter $(BUILD)/scatter-render | $(BUILD)/gallery
	$(call RENDER,$(BUILD)/scatter-render $< --out $@)

$(BUILD)/gallery/%.png: $(BUILD)/scenes/%.scatter $(BUILD)/scatter-render | $(BUILD)/gallery
	$(call RENDER,$(BUILD)/scatter-render $< --out $@)

$(SKY_PICTURES): $(BUILD)/gallery/%.png: examples/skies/%.scatter $(BUILD)/scatter-turntable | $(BUILD)/gallery
	$(call RENDER,$(FRAMES) $(@:.png=) --frames 1 --nodes 32 && mv $(@:.png=)0000.png $@)

$(TURNING): examples/skies/smoke_venice.scatter $(BUILD)/scatter-turntable | $(BUILD)/gallery
	$(call RENDER,$(FRAMES) $(@:0000.png=) --frames 12 --size 180x240)

$(RISING): $(BUILD)/scenes/puffs.scatter $(BUILD)/scatter-turntable | $(BUILD)/gallery
	$(FRAMES) $(@:0000.png=) --frames 12 --size 160x240 --sequence $(<:.scatter=)_*.raw

$(BUILD)/scenes/puffs.scatter: $(BUILD)/scatter-generate | $(BUILD)/scenes
	$< puffs 12 $(@:.scatter=) >$@

$(BUILD)/scenes/cumulus_27000.scatter: $(BUILD)/scatter-generate | $(BUILD)/scenes
	$< 27000 >$@

# docs/gallery.png and docs/gallery_skies.png are copies of these.
BALLS = $(BUILD)/gallery/spheres_studio.png
$(BUILD)/gallery/sheet.png: $(BUILD)/scatter-sheet $(PICTURES) $(BALLS)
$(BUILD)/gallery/skies.png: $(BUILD)/scatter-sheet $(filter-out $(BALLS),$(SKY_PICTURES))
$(BUILD)/gallery/sheet.png $(BUILD)/gallery/skies.png:
	@pictures=$$(ls $(filter %.png,$^) 2>/dev/null); \
	if [ "$$pictures" ]; then $< $@ $$pictures; else echo "$(@F): skipped: no data"; fi

# ----------------------------------------------------------------------- checks, bench, glsl

test:
	$(SETUP) test
	@bash tests/run.sh $(STEPS)

bench bench-quick:
	$(SETUP) bench
	$(MAKE) --no-print-directory $(BUILD)/scatter-bench
	$(BUILD)/scatter-bench $(OPTIONS_$@)
OPTIONS_bench-quick = --quick

bench-gl bench-gl-quick:
	$(SETUP) gl
	$(MAKE) --no-print-directory $(BUILD)/scatter-bench-gl
	$(BUILD)/scatter-bench-gl $(OPTIONS_$@)
OPTIONS_bench-gl-quick = --quick

bench-peers:
	$(SETUP) peers
	$(MAKE) --no-print-directory $(BUILD)/scatter-bench
	$(BUILD)/scatter-bench peers

glsl: $(BUILD)/glsl
	$< scatter.h scatter_gl.h

# The rows that tests/hard_cases.c prints become the table of docs/accuracy.md.
accuracy: $(BUILD)/hard_cases
	$< >$(BUILD)/hard_cases.out
	awk '/^<!-- end of hard cases/ { system("sed -n \"s/^row //p\" $(BUILD)/hard_cases.out"); skip = 0 } \
	    !skip { print; fflush() } /^\| --- \| --- \| --- \| --- \|$$/ { skip = 1 }' \
	    docs/accuracy.md >$(BUILD)/accuracy.md
	mv $(BUILD)/accuracy.md docs/accuracy.md

# ----------------------------------------------------------------------------------- install

# Both files find the headers relative to themselves, so an installed tree may be moved.
define PKG_CONFIG
prefix=$${pcfiledir}/../..
Name: scatter
Description: physically based fog, smoke and clouds in single headers
Version: $(VERSION)
Cflags: -I$${prefix}/include
Libs: -lm
endef

define CMAKE_CONFIG
if(NOT TARGET scatter::scatter)
  add_library(scatter::scatter INTERFACE IMPORTED)
  set_target_properties(scatter::scatter PROPERTIES
    INTERFACE_INCLUDE_DIRECTORIES "$${CMAKE_CURRENT_LIST_DIR}/../../../include"
    INTERFACE_LINK_LIBRARIES "$$<$$<NOT:$$<PLATFORM_ID:Windows>>:m>")
endif()
endef

define CMAKE_VERSION
set(PACKAGE_VERSION $(VERSION))
if(PACKAGE_FIND_VERSION VERSION_GREATER PACKAGE_VERSION)
  set(PACKAGE_VERSION_COMPATIBLE FALSE)
else()
  set(PACKAGE_VERSION_COMPATIBLE TRUE)
  if(PACKAGE_FIND_VERSION VERSION_EQUAL PACKAGE_VERSION)
    set(PACKAGE_VERSION_EXACT TRUE)
  endif()
endif()
endef

export PKG_CONFIG CMAKE_CONFIG CMAKE_VERSION
SHARE = $(DESTDIR)$(PREFIX)/share

install:
	install -d $(DESTDIR)$(PREFIX)/include $(SHARE)/pkgconfig $(SHARE)/cmake/scatter
	install -m 644 $(HEADERS) $(DESTDIR)$(PREFIX)/include
	@printf '%s\n' "$$PKG_CONFIG" >$(SHARE)/pkgconfig/scatter.pc
	@printf '%s\n' "$$CMAKE_CONFIG" >$(SHARE)/cmake/scatter/scatter-config.cmake
	@printf '%s\n' "$$CMAKE_VERSION" >$(SHARE)/cmake/scatter/scatter-config-version.cmake
	@echo "installed scatter $(VERSION) into $(DESTDIR)$(PREFIX)"

-include $(wildcard $(BUILD)/*.d)
