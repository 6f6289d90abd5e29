# Fovea. `make help` lists what can be asked for.
#
#   BUILD=dir      where everything goes (default build)
#   CC= CXX=       compilers (gcc and clang are kept warning-free)
#   V=1            show whole commands
#   TEST_DEBUG=1   link tests with what a debugger needs: 20 MB each, not 3
#   FOVEA_TURN=N   of the tests in C every Nth only, other ones with each commit (tools/turn.sh)
#   SAN=asan|tsan|fuzz  sanitizer build (use with its own BUILD)
#   CROSS=aarch64-linux-gnu-   cross build, tests run by EMULATOR
#   SYSROOT=dir    of a cross build: what it is linked with (default BUILD/sysroot, by tools/make_sysroot.sh)
#   PREFIX= LIBDIR= DESTDIR=   where `make install` puts things
#   WERROR=-Werror warnings end the build, as in CI

BUILD    ?= build
Q        := $(if $(V),,@)
CROSS    ?=
# asan, ubsan and the fuzzers are clang's: so one sanitized build is the other compiler's too.
ifeq ($(origin CC),default)
CC       := $(if $(filter asan fuzz,$(SAN)),clang,$(CROSS)gcc)
endif
ifeq ($(origin CXX),default)
CXX      := $(if $(filter asan fuzz,$(SAN)),clang++,$(CROSS)g++)
endif
AR       := $(CROSS)ar
EMULATOR ?=
JOBS     ?= $(shell nproc)
PREFIX   ?= /usr/local
LIBDIR   ?= $(PREFIX)/lib
VERSION  := $(shell sed -n 's/^\#define FOVEA_VERSION "\(.*\)"/\1/p' include/fovea/fovea.h)
# Programs that are linked with the library ask for this name: before 1.0 a minor version may change the interface (CHANGELOG.md).
SONAME   := libfovea.so.$(if $(filter 0.%,$(VERSION)),$(basename $(VERSION)),$(firstword $(subst ., ,$(VERSION))))
MESSAGES_SONAME := $(subst libfovea,libfovea-messages,$(SONAME))
MACHINE  := $(shell $(CC) -dumpmachine 2>/dev/null)

ifneq (,$(findstring aarch64,$(CROSS)))
SYSROOT  ?= $(BUILD)/sysroot
SYSLIBS  := $(SYSROOT)/usr/lib/aarch64-linux-gnu:$(SYSROOT)/lib/aarch64-linux-gnu
# A root of a whole system (tools/make_sysroot.sh DIR whole) brings its own C library; what make_sysroot.sh unpacks stands beside the compiler's.
ifneq (,$(wildcard $(SYSROOT)/usr/include/stdio.h))
WHOLE    := $(SYSROOT)
SYSFLAGS := --sysroot=$(SYSROOT)
LDFLAGS  += --sysroot=$(SYSROOT) -Wl,-rpath-link=$(SYSLIBS):$(SYSROOT)/usr/lib/aarch64-linux-gnu/blas:$(SYSROOT)/usr/lib/aarch64-linux-gnu/lapack
export PKG_CONFIG_SYSROOT_DIR := $(SYSROOT)
export PKG_CONFIG_LIBDIR := $(SYSROOT)/usr/lib/aarch64-linux-gnu/pkgconfig:$(SYSROOT)/usr/share/pkgconfig
else
SYSFLAGS := -isystem $(SYSROOT)/usr/include/aarch64-linux-gnu -isystem $(SYSROOT)/usr/include
LDFLAGS  += -L$(SYSROOT)/usr/lib/aarch64-linux-gnu -L$(SYSROOT)/lib/aarch64-linux-gnu -Wl,-rpath-link=$(SYSLIBS)
endif
endif

# ---- flags -----------------------------------------------------------------------------------------------------
# One baseline for all float code, no contraction: the same bits from every compiler and processor.
WERROR   ?=
WARN     := -Wall -Wextra -Wshadow -Wundef -Wvla -Wpointer-arith -Wwrite-strings $(WERROR)
FP       := -ffp-contract=off -fno-math-errno -fsigned-char
OPT      := -O3 -g
# What the compiler and the linker put in the way of an attacker; tools/check_hardening.sh finds it in what was built. Sanitizers
# do the same checks and more, and know nothing of the fortified functions. FORTIFY is 3 where compiler and C library have it.
FORTIFY  := $(shell printf '\043include <features.h>\n__USE_FORTIFY_LEVEL\n' | $(CC) -O2 -U_FORTIFY_SOURCE -D_FORTIFY_SOURCE=3 -w -E -P - 2>/dev/null | tail -n 1)
HARDEN   := $(if $(SAN),,-fstack-protector-strong -U_FORTIFY_SOURCE -D_FORTIFY_SOURCE=$(or $(FORTIFY),2))
HARDLINK := -Wl,-z,relro,-z,now,-z,noexecstack
# Sanitized programs keep line numbers only: their reports show no more, and disk is short where CI runs.
ifeq ($(SAN),asan)
OPT      := -O1 -g1 -fno-omit-frame-pointer -fsanitize=address,undefined -fno-sanitize-recover=all -DFOVEA_SANITIZED=1
endif
ifeq ($(SAN),fuzz)
OPT      := -O1 -g1 -fno-omit-frame-pointer -fsanitize=address,undefined,fuzzer-no-link -fno-sanitize-recover=all \
            -DFOVEA_SANITIZED=1 -DFUZZING_BUILD_MODE_UNSAFE_FOR_PRODUCTION
endif
ifeq ($(SAN),tsan)
OPT      := -O1 -g1 -fno-omit-frame-pointer -fsanitize=thread -DFOVEA_SANITIZED=1
endif
INCLUDES := -Iinclude -Isrc -I$(BUILD)/generated $(SYSFLAGS)
COMMON   := $(OPT) $(HARDEN) $(FP) $(WARN) $(INCLUDES) -fPIC -fstack-usage -pthread -MMD -MP -D_GNU_SOURCE
CFLAGS   += -std=c11 $(COMMON) -Wstrict-prototypes -Wmissing-prototypes
# Of C++ the lines alone: what gdb can know of templates makes objects nine times as large and compiling half as fast.
CXXFLAGS += -std=c++17 $(COMMON) -g1
LDFLAGS  += $(if $(SAN),$(filter -fsanitize% -fno-sanitize%,$(OPT)),) $(HARDLINK) -pthread
ifneq (,$(findstring clang,$(CC)))
COMMON   := $(filter-out -fstack-usage,$(COMMON))
endif

# ---- sources ---------------------------------------------------------------------------------------------------
LCMTYPES  := $(wildcard include/lcmtypes/*.lcm)
LCMGEN    := $(patsubst include/lcmtypes/%.lcm,$(BUILD)/generated/%.c,$(LCMTYPES)) $(BUILD)/generated/fovea_fields.h $(BUILD)/generated/fovea_types.h $(BUILD)/generated/fovea_type_texts.h
KERNELS   := $(wildcard src/kernels/*.c src/kernels/c/*.c)
ifneq (,$(findstring x86_64,$(MACHINE)))
# Set by set, so that the pages of those that this processor does not use are never read.
KERNELS   += $(foreach set,sse4 avx2 avxvnni evexvnni avx512 avx512icl avx512vnni,$(wildcard src/kernels/x86/*_$(set).c))
endif
ifneq (,$(findstring aarch64,$(MACHINE)))
KERNELS   += $(wildcard src/kernels/neon/*.c)
endif
# Packages leave SURF out until it is clear which patents hold (docs/operations.md): make SURF=no.
SURF      ?= yes
$(if $(filter yes no,$(SURF)),,$(error SURF: found '$(SURF)', expected yes or no))
ROOMS     := base image features geometry stereo inertial odometry scale map nn detect objects grid message runtime
CORE_C    := $(KERNELS) $(foreach r,$(ROOMS),$(wildcard src/$(r)/*.c))
CORE_C    := $(filter-out $(if $(filter no,$(SURF)),src/features/surf%.c),$(CORE_C))
# What few loops run stands at the end, for the same reason: second cameras, free space, saved maps, features and operations of the commands.
LAST_C    := $(filter src/kernels/%_c.c src/grid/% src/stereo/% src/inertial/% src/%/distances.c src/%/free_space.c src/odometry/surface.c src/map/take.c src/map/archive_% src/%/keep.c $(addprefix src/features/,extract.c harris.c patch.c quadratic.c ranked.c response.c scale_space.c sift%.c strongest.c surf%.c) \
             $(addprefix src/image/,contrast.c edges.c filters.c hysteresis.c preprocess.c region.c segments.c tables.c white_balance.c) \
             $(addprefix src/kernels/x86/,edge_% filter_% response_% bilateral_%),$(CORE_C))
CORE_C    := $(filter-out $(LAST_C),$(CORE_C)) $(LAST_C)
DRIVERS_C := $(wildcard drivers/*.c drivers/*/*.c)
APP_C     := $(wildcard src/app/*.c src/app/*/*.c src/support/*.c)
# Likewise what few runs need: other commands than run, and what is asked for by commands or at the end.
LAST_APP  := $(filter src/app/lab/% src/app/watch/% src/app/man.c $(addprefix src/app/run/,backup.c check_command.c check_memory.c fast_pose.c health.c history.c host.c map_loads.c recordings.c \
             replay_command.c run_health.c self_test.c run_picture.c path_picture.c frame_picture.c objects_picture.c report_picture.c grid_file.c imu_input.c),$(APP_C))
APP_C     := $(filter-out $(LAST_APP),$(APP_C)) $(LAST_APP)

# Parts that need further libraries are built where those are installed: here, or in the root of a cross build.
INSTALLED := $(if $(SAN),,$(if $(CROSS),$(if $(WHOLE),$(WHOLE)/usr),/usr))
INCLUDED  := $(or $(INSTALLED),/usr)/include
installed = $(if $(INSTALLED),$(wildcard $(INSTALLED)/include/$(1)))

# The video plug-in is built where OpenCV's videoio is installed; nothing else here needs it.
VIDEO_PLUGIN := $(if $(call installed,opencv4/opencv2/videoio.hpp),$(BUILD)/fovea-video.so)

# So is the plug-in that draws letters, where FreeType is installed.
TEXT_PLUGIN := $(if $(call installed,freetype2/ft2build.h),$(BUILD)/fovea-text.so)

# So is the program that keeps libcamera in a process of its own, where libcamera is installed.
LIBCAMERA_PLUGIN := $(if $(call installed,libcamera/libcamera/libcamera.h)$(call installed,../local/include/libcamera/libcamera/libcamera.h),$(BUILD)/fovea-libcamera)

# So is the calibration program, where OpenCV and Ceres are installed: nothing of them is in any other program.
CALIBRATE_CXX := $(filter-out src/calibrate/main.cpp,$(wildcard src/calibrate/*.cpp))
CALIBRATE := $(if $(and $(call installed,opencv4/opencv2/aruco.hpp),$(call installed,ceres/ceres.h)),$(BUILD)/fovea-calibrate)

# So is the program that serves the page of a run, where libwebsockets, jansson and the page's libraries are installed; sanitizers see it, too.
WEB_C := $(filter-out src/web/main.c,$(wildcard src/web/*.c))
WEB_LIBS := -lwebsockets -lssl -lcrypto -ljansson
WEB_NEEDS := libwebsockets.h jansson.h
WEB_THERE := $(if $(filter asan,$(SAN)),$(wildcard $(WEB_NEEDS:%=/usr/include/%)),$(foreach header,$(WEB_NEEDS),$(call installed,$(header))))
# What the page takes from Debian's libjs-three and libjs-chart.js: the same files for every processor.
SCRIPTS := /usr/share/javascript
WEB_SCRIPTS := $(addprefix $(SCRIPTS)/,chart.js/chart.min.js three/three.module.js three/examples/jsm/controls/OrbitControls.js \
    $(addprefix three/examples/jsm/lines/,LineMaterial.js LineSegments2.js LineSegmentsGeometry.js))
WEB_THERE += $(wildcard $(WEB_SCRIPTS))
WEB := $(if $(filter fuzz tsan,$(SAN)),,$(if $(filter $(words $(WEB_NEEDS) $(WEB_SCRIPTS)),$(words $(WEB_THERE))),$(BUILD)/fovea-web))

objs = $(patsubst %.c,$(BUILD)/obj/%.o,$(filter %.c,$(1))) $(patsubst %.cpp,$(BUILD)/obj/%.o,$(filter %.cpp,$(1)))
GEN_O     := $(patsubst %.c,%.o,$(filter %.c,$(LCMGEN)))
CORE_O    := $(call objs,$(CORE_C)) $(GEN_O)
DRIVERS_O := $(call objs,$(DRIVERS_C))
APP_O     := $(filter-out $(BUILD)/obj/src/app/main.o,$(call objs,$(APP_C)))
MAIN_O    := $(BUILD)/obj/src/app/main.o
# The application waits and prints: small code, of which fewer pages are read.
$(if $(SAN),,$(APP_O) $(MAIN_O)): CFLAGS += -Os

LIBS_CORE := -llcm
LIBS_APP  := -llcm -lyaml -lpng -ljpeg -lz -ldl -lm

# ---- what can be asked for -------------------------------------------------------------------------------------
.DEFAULT_GOAL := all
.PHONY: all help pictures run test check hil bench fuzz campaign sample cross docs size fmt install clean evaluate
.DELETE_ON_ERROR:
.SECONDARY:

all: $(VIDEO_PLUGIN) $(TEXT_PLUGIN) $(LIBCAMERA_PLUGIN) $(CALIBRATE) $(WEB) $(BUILD)/fovea $(BUILD)/libfovea.a $(BUILD)/libfovea.so $(BUILD)/libfovea-messages.so $(BUILD)/fovea.pc  ## build the program and the libraries

help:  ## this list
	@awk -F':.*## ' '/^[a-z-]+:.*## /{printf "  make %-12s %s\n", $$1, $$2}' $(MAKEFILE_LIST)

run:  ## install what is missing, build, and run the tour on the simulated camera
	@tools/install.sh build
	@$(MAKE) --no-print-directory -j$(JOBS) all
	$(BUILD)/fovea run --model src/detect/shipped.fvm

test:  ## install what is missing, build, and run the tests
	@tools/install.sh build test
	@$(MAKE) --no-print-directory -j$(JOBS) all tests
	@FOVEA_TESTS_WITHOUT="$(JUDGING)" tools/run_tests.sh $(BUILD) $(EMULATOR)

# Tests that judge errors over minutes of simulated frames, or over many pictures of boards: 5 to 40 s of processor time each.
# `make test` runs all others, in under five minutes on two processors; CI runs these beside its other steps.
JUDGING := $(addprefix unit/calibrate/test_,bad_sets camera check guide hand_eye imu inertial inertial_command rig sim_board) \
           $(addprefix unit/runtime/test_,honesty inertial rolling stereo) $(addprefix unit/odometry/test_,agreement odometry usable) \
           unit/scale/test_scale oracle/test_features_opencv
.PHONY: judge
judge:  ## install what is missing, build, and run the tests that judge errors over many frames, which `make test` leaves out
	@tools/install.sh build test
	@$(MAKE) --no-print-directory -j$(JOBS) all $(JUDGING:%=$(BUILD)/tests/%)
	@FOVEA_TESTS="$(JUDGING)" tools/run_tests.sh $(BUILD) $(EMULATOR)

# Everything else that must hold: other compiler, layers, symbols, style, sanitizers. Under tsan, which is some ten times
# slower, run the tests of code with more than one thread: the loop, the readers, live cameras, the recorder, sender and receiver of LCM.
THREADED := unit/base/test_ring unit/runtime/test_sense_offers unit/app/run/test_imu_input unit/app/run/test_loop unit/app/record/test_recorder unit/app/network/test_sender_file \
            unit/app/network/test_sender_link unit/app/network/test_sender_preview unit/drivers/test_recorded \
            unit/drivers/test_wrong_recordings unit/drivers/test_odd_recordings unit/drivers/test_odd_logs unit/drivers/test_rig_recordings unit/drivers/test_recovery \
            unit/drivers/test_v4l2 unit/drivers/test_v4l2_faults unit/drivers/test_v4l2_gain unit/drivers/test_v4l2_unplug unit/drivers/test_source_controls \
            unit/drivers/test_libcamera replay/test_replay replay/test_replay_rig realtime/test_run transport/test_transport transport/test_receiver transport/test_sending transport/test_answers transport/test_feed_run transport/test_service transport/test_parameters
check: export WERROR = -Werror
check:  ## layers, names, format, symbols, stack, hardening, headers, clang build, clang-tidy, tests under asan+ubsan and tsan, a trial installation
	@tools/install.sh build test check
	@$(MAKE) --no-print-directory -j$(JOBS) all
	@tools/check_layers.sh
	@tools/check_names.sh
	@tools/check_format.sh
	@tools/check_symbols.sh $(BUILD)
	@tools/check_stack.sh $(BUILD)
	@tools/check_registers.sh $(BUILD)
	@tools/check_hardening.sh $(BUILD)
	@tools/check_headers.sh
	@$(MAKE) --no-print-directory -j$(JOBS) BUILD=build-clang CC=clang CXX=clang++ all tests
	@tools/check_hardening.sh build-clang
	@tools/run_tests.sh build-clang
	@tools/check_tidy.sh
	@$(MAKE) --no-print-directory -j$(JOBS) BUILD=build-asan SAN=asan all tests
	@tools/run_tests.sh build-asan
	@$(MAKE) --no-print-directory tsan
	@tools/try_install.sh

TSANMAKE = $(MAKE) --no-print-directory -j$(JOBS) BUILD=build-tsan SAN=tsan
.PHONY: tsan
tsan:  ## the tests of code with threads, under tsan
	@$(TSANMAKE) $(THREADED:%=build-tsan/tests/%) build-tsan/fovea build-tsan/subscribe build-tsan/command build-tsan/python/fovea/__init__.py
	@FOVEA_TESTS="$(THREADED)" tools/run_tests.sh build-tsan

# Real kernel drivers in a virtual machine: no camera is needed. Results in build-hil/results; cached between runs.
hil:  ## test the camera drivers on real kernel drivers in a virtual machine
	@tools/install.sh build hil
	@$(MAKE) --no-print-directory -j$(JOBS) all $(BUILD)/hil-tool $(BUILD)/hil-count.so
	@$(MAKE) --no-print-directory -j$(JOBS) BUILD=build-hil/scalar OPT='-O2 -fno-tree-vectorize -fno-tree-slp-vectorize' build-hil/scalar/fovea
	@tools/hil/run.sh

CROSSMAKE = $(MAKE) --no-print-directory -j$(JOBS) BUILD=build-aarch64 CROSS=aarch64-linux-gnu-
cross:  ## build for aarch64 and run the tests under qemu-user
	@tools/install.sh build test cross
	@tools/make_sysroot.sh build-aarch64/sysroot
	@$(CROSSMAKE) all tests
	@tools/check_hardening.sh build-aarch64
	@tools/run_tests.sh build-aarch64 tools/emulate.sh

# What CI runs of them: the runtime's rooms and the simulated camera, whose results must be the same on ARM. The others are tests of
# files, processes, sockets and camera drivers, where an emulator tells nothing new; the program that is made of them is run on ARM by
# tests/replay/everywhere.sh, and the campaign runs all (its part `cross`). These and unit/drivers/test_sim_imu take minutes each
# under an emulator: that runs with two cameras, an IMU and the simulated IMU itself have the same bits on ARM is what everywhere.sh sees.
# The parts of test_kept_grid and test_regained_grid are run there by test_free_space, test_recall and test_archive_grid.
LONG_TESTS = unit/runtime/test_stereo unit/runtime/test_upright_closure unit/runtime/test_inertial unit/runtime/test_held_turns unit/runtime/test_calibration unit/odometry/test_agreement unit/odometry/test_usable unit/runtime/test_kept_grid unit/runtime/test_regained_grid
CORE_TESTS = $(filter-out $(LONG_TESTS) unit/app/% unit/campaign/% unit/web/% unit/drivers/% transport/% realtime/%,$(TESTS_C:tests/%.c=%)) unit/drivers/test_sim unit/drivers/test_fault unit/drivers/test_fault_schedule
.PHONY: cross-core
cross-core:  ## build for aarch64 and run the tests of the runtime's rooms under qemu-user
	@tools/install.sh build test cross
	@tools/make_sysroot.sh build-aarch64/sysroot
	@$(CROSSMAKE) all $(CORE_TESTS:%=build-aarch64/tests/%) build-aarch64/tests/replay/flipped
	@tools/check_hardening.sh build-aarch64
	@FOVEA_TESTS="$(CORE_TESTS)" tools/run_tests.sh build-aarch64 tools/emulate.sh
	@$(CROSSMAKE) build-aarch64/bounds
	@tools/bounds.py --check

bounds:  ## install what is missing, then count under qemu the most work of each stage and unit: the tables of docs/bounds.md
	@tools/install.sh build cross
	@tools/make_sysroot.sh build-aarch64/sysroot
	@$(CROSSMAKE) build-aarch64/bounds
	@tools/bounds.py
.PHONY: bounds

# Every tests/fuzz/fuzz_*.c is a libFuzzer target; its corpus of past findings and seeds is tests/fuzz/corpus/NAME.
FUZZ_SECONDS ?= 60
FUZZERS := $(patsubst tests/fuzz/%.c,build-fuzz/fuzz/%,$(wildcard tests/fuzz/fuzz_*.c))
FUZZMAKE = $(MAKE) --no-print-directory -j$(JOBS) BUILD=build-fuzz SAN=fuzz CC=clang CXX=clang++
fuzz:  ## fuzz every parser of outside input for FUZZ_SECONDS each, under asan+ubsan
	@tools/install.sh build fuzz
	@$(FUZZMAKE) fuzzers
	@tools/run_fuzzers.sh build-fuzz $(FUZZ_SECONDS)
.PHONY: fuzzers
FUZZ_HELP := $(call objs,tests/common/short_run.c tests/common/small_map.c)
fuzzers: $(FUZZERS)
# What strangers say to the page's server, but for what libwebsockets parses.
FUZZ_WEB_O := $(call objs,$(filter-out src/web/server%.c src/web/pages.c src/web/assets.c src/web/certificate.c,$(WEB_C)))
$(BUILD)/fuzz/fuzz_web: $(FUZZ_WEB_O)
$(BUILD)/fuzz/fuzz_web: FUZZ_MORE := $(FUZZ_WEB_O)
$(BUILD)/fuzz/fuzz_web: ORACLE_LIBS := -ljansson
$(BUILD)/fuzz/%: $(BUILD)/obj/tests/fuzz/%.o $(FUZZ_HELP) $(BUILD)/libfovea-app.a $(BUILD)/libfovea.a
	@mkdir -p $(@D)
	@echo "  link $@"
	$(Q)$(CXX) $(LDFLAGS) -pie -fsanitize=fuzzer -o $@ $< $(FUZZ_MORE) $(FUZZ_HELP) -Wl,--start-group $(BUILD)/libfovea-app.a $(BUILD)/libfovea.a -Wl,--end-group $(ORACLE_LIBS) $(LIBS_APP)

bench:  ## install what is missing, then time every stage and kernel beside OpenCV: build/bench.json, the tables of docs/measured.md and src/kernels/MEASURED.md
	@tools/install.sh build bench
	@$(MAKE) --no-print-directory $(BUILD)/bench $(BUILD)/fovea
	$(BUILD)/bench --program $(BUILD)/fovea --json $(BUILD)/bench.json --tables docs/measured.md --kernels src/kernels/MEASURED.md --commit "$$(git describe --always --dirty 2>/dev/null)" \
	    --compiler "$$($(CC) --version | head -n 1)" --flags "$(OPT) $(FP)"
	@tools/bench_networks.sh $(BUILD)

$(BUILD)/venv-sweep/ready:
	@tools/install.sh evaluate
	python3 -m venv $(BUILD)/venv-sweep
	$(BUILD)/venv-sweep/bin/pip install -q --disable-pip-version-check distributed==2026.8.0 pyarrow==26.0.1 duckdb==2.0.0 numpy
	@touch $@
	@touch $@
$(BUILD)/venv-objects/ready:
	python3 -m venv $(BUILD)/venv-objects
	$(BUILD)/venv-objects/bin/pip install -q trackers==2.6.1 trackeval==1.3.0 numpy
	@touch $@
PICTURE := $(BUILD)/run-picture.png
quantiser:  ## install what `tools/import --quantise` needs: 310 MB of Python packages, used without a network
	@tools/quantiser_python.sh $(BUILD)
.PHONY: quantiser
onnx: quantiser  ## install what `tools/import --quantise MODEL.onnx` needs besides: 1.7 GB of Python packages, used without a network
	@tools/onnx_python.sh $(BUILD)
.PHONY: onnx
pictures: all  ## renew the pictures of README.md, a simulated run, and of docs/operations.md
	@tools/install.sh pictures
	$(BUILD)/fovea run --quiet --source sim:tour --frames 900 --set lcm_url= --model src/detect/shipped.fvm --picture $(PICTURE)
	convert $(PICTURE) -strip -filter Lanczos -resize 1280x -dither None -colors 128 -define png:compression-level=9 docs/run.png
	tools/operations_pictures.sh $(BUILD) docs
evaluate: all $(BUILD)/venv-sweep/ready $(BUILD)/venv-objects/ready  ## the recordings with truth over seeds and start frames, objects beside SORT and ByteTrack: rewrites the committed tables
	$(BUILD)/venv-sweep/bin/python tools/evaluate odometry --binary $(BUILD)/fovea
	$(BUILD)/venv-sweep/bin/python tools/evaluate road --binary $(BUILD)/fovea
	$(BUILD)/venv-sweep/bin/python tools/evaluate faults --binary $(BUILD)/fovea
	$(BUILD)/venv-sweep/bin/python tools/evaluate operations --binary $(BUILD)/fovea
	$(BUILD)/venv-sweep/bin/python tools/evaluate features_odometry --binary $(BUILD)/fovea
	$(BUILD)/venv-objects/bin/python tools/evaluate/objects.py --fovea $(BUILD)/fovea --output tools/evaluate/objects.md

# Feature methods over changes of photographs, by OpenCV's image functions.
$(BUILD)/obj/tools/evaluate/features.o: CXXFLAGS += -Itests -isystem $(INCLUDED)/opencv4
$(BUILD)/evaluate-features: $(BUILD)/obj/tools/evaluate/features.o $(BUILD)/libfovea.a
	@echo "  link $@"
	$(Q)$(CXX) $(LDFLAGS) -pie -o $@ $^ $(OPENCV_LIBS) $(LIBS_CORE)
.PHONY: evaluate-features
evaluate-features: $(BUILD)/evaluate-features  ## feature methods over brightness, blur, noise, rotation, scale, viewpoint and JPEG: rewrites the committed table and picture
	$< tools/evaluate/features.md tools/evaluate/features.svg $(wildcard $(or $(FOVEA_DATA),../shared/data)/affine/*/img1.png)

CAMPAIGN := $(patsubst tests/%.c,$(BUILD)/tests/%,$(wildcard tests/campaign/*.c)) $(BUILD)/tests/replay/flipped
campaign: all $(CAMPAIGN)  ## the long proofs, resumable: hours
	@tools/campaign.sh

# So that several of its targets may then be made beside each other.
.PHONY: programs
programs: all tests $(CAMPAIGN) $(BUILD)/bounds $(BUILD)/hil-tool $(BUILD)/hil-count.so  ## build all that tests, samples, bounds and the virtual machine run

sample: all $(CAMPAIGN)  ## five minutes of the campaign: real time at 60 Hz, a long run in fixed memory, every fuzz target, replays everywhere; PARTS="..." only these
	@tools/campaign.sh --sample $(PARTS)

clean:  ## remove everything that was built
	rm -rf $(BUILD) build-*

fmt:  ## install what is missing and format the sources
	@tools/install.sh fmt
	clang-format -i $$(git ls-files '*.c' '*.h' '*.cpp')

docs: $(BUILD)/fovea  ## write docs/configuration.md from the table of keys, and the types of docs/messages.md
	$(BUILD)/fovea config --markdown >$(BUILD)/configuration.md
	@cmp -s $(BUILD)/configuration.md docs/configuration.md || cp $(BUILD)/configuration.md docs/configuration.md
	tools/messages_md.sh >$(BUILD)/messages.md
	@cmp -s $(BUILD)/messages.md docs/messages.md || cp $(BUILD)/messages.md docs/messages.md

size: all  ## memory of the block by stage, and code size
	@$(BUILD)/fovea check --memory-only
	@size $(BUILD)/fovea $(BUILD)/libfovea.so

# ---- message types for other languages, and examples of their use ------------------------------------------------
# docs/messages.md says how lcm-spy shows messages with it.
jar:  ## install what is missing and build the jar of message types for lcm-spy and Java
	@tools/install.sh build jar
	@$(MAKE) --no-print-directory $(BUILD)/fovea-types.jar
$(BUILD)/fovea-types.jar: $(LCMTYPES)
	@rm -rf $(BUILD)/java && mkdir -p $(BUILD)/java/classes
	lcm-gen -j --jpath $(BUILD)/java $(LCMTYPES)
	javac -nowarn -cp /usr/share/java/lcm.jar -d $(BUILD)/java/classes $(BUILD)/java/*/*.java
	jar cf $@ -C $(BUILD)/java/classes .
python-types: $(BUILD)/python/fovea/__init__.py  ## make the message types for Python
$(BUILD)/python/fovea/__init__.py: $(LCMTYPES)
	@rm -rf $(BUILD)/python && mkdir -p $(BUILD)/python
	$(Q)lcm-gen -p --ppath $(BUILD)/python $(LCMTYPES)
$(BUILD)/cpp/fovea/pose_t.hpp: $(LCMTYPES)
	@rm -rf $(BUILD)/cpp && mkdir -p $(BUILD)/cpp
	$(Q)lcm-gen -x --cpp-hpath $(BUILD)/cpp $(LCMTYPES)
$(BUILD)/subscribe-cpp: tools/subscribers/subscribe.cpp $(BUILD)/cpp/fovea/pose_t.hpp
	@echo "  $(notdir $(CXX)) $<"
	$(Q)$(CXX) $(filter-out -fstack-usage,$(CXXFLAGS)) -isystem $(BUILD)/cpp $(LDFLAGS) -pie -o $@ $< -llcm
$(BUILD)/subscribe: $(BUILD)/obj/tools/subscribers/subscribe.o $(GEN_O)
	@echo "  link $@"
	$(Q)$(CC) $(LDFLAGS) -pie -o $@ $^ -llcm
$(BUILD)/command: $(BUILD)/obj/tools/subscribers/command.o $(BUILD)/libfovea-app.a $(BUILD)/libfovea.a
	@echo "  link $@"
	$(Q)$(CC) $(LDFLAGS) -pie -o $@ $^ $(LIBS_APP)
.PHONY: jar python-types

# ---- programs to start from: built as strangers build them, against the library and the headers ------------------
EXAMPLES := $(patsubst tools/examples/%.c,$(BUILD)/examples/%,$(wildcard tools/examples/*.c)) \
            $(BUILD)/examples/navigate \
            $(if $(SAN)$(CROSS),,$(if $(wildcard /usr/include/eigen3/Eigen/Geometry),$(BUILD)/examples/loop_eigen))
.PHONY: examples
examples: $(EXAMPLES)  ## build the programs of tools/examples
$(BUILD)/examples/loop: $(BUILD)/obj/tools/examples/loop.o $(BUILD)/libfovea.a
	@mkdir -p $(@D)
	@echo "  link $@"
	$(Q)$(CC) $(LDFLAGS) -pie -o $@ $^ $(LIBS_CORE)
$(BUILD)/obj/tools/examples/loop_eigen.o: CXXFLAGS += -isystem $(INCLUDED)/eigen3
$(BUILD)/examples/loop_eigen: $(BUILD)/obj/tools/examples/loop_eigen.o $(BUILD)/libfovea.a
	@mkdir -p $(@D)
	@echo "  link $@"
	$(Q)$(CXX) $(LDFLAGS) -pie -o $@ $^ $(LIBS_CORE)
NAVIGATE_O := $(call objs,$(wildcard tools/examples/navigate/*.c))
$(BUILD)/examples/navigate: $(NAVIGATE_O) $(BUILD)/libfovea-app.a $(BUILD)/libfovea.a
	@mkdir -p $(@D)
	@echo "  link $@"
	$(Q)$(CC) $(LDFLAGS) -pie -o $@ $^ -llcm $(LIBS_CORE) -lm
$(BUILD)/examples/subscriber: $(BUILD)/obj/tools/examples/subscriber.o $(GEN_O)
	@mkdir -p $(@D)
	@echo "  link $@"
	$(Q)$(CC) $(LDFLAGS) -pie -o $@ $^ -llcm

# ---- the visual vocabulary: trained once, committed; tools/vocabulary/train.sh trains it again --------------------
$(BUILD)/obj/src/map/vocabulary.o: src/map/vocabulary.bin
$(BUILD)/train-vocabulary: $(BUILD)/obj/tools/vocabulary/train.o $(BUILD)/libfovea-app.a $(BUILD)/libfovea.a
	@echo "  link $@"
	$(Q)$(CXX) $(LDFLAGS) -pie -o $@ $< -Wl,--start-group $(BUILD)/libfovea-app.a $(BUILD)/libfovea.a -Wl,--end-group $(LIBS_APP)

# Manual pages: one of each program and one of each command, from the tables that --help prints.
MAN := $(BUILD)/man/fovea.1 $(patsubst %,$(BUILD)/man/fovea-%.1,$(shell sed -n 's/^    {"\([a-z]*\)", .*/\1/p' src/app/commands.c))
EMULATED = $(if $(CROSS),$(or $(EMULATOR),tools/emulate.sh))
RUN_HERE = $(EMULATED) $(BUILD)/fovea
CALIBRATE_MAN := $(if $(CALIBRATE),$(BUILD)/man/fovea-calibrate.1 $(patsubst %,$(BUILD)/man/fovea-calibrate-%.1,$(shell sed -n 's/^    {"\([a-z-]*\)", .*/\1/p' src/calibrate/commands.cpp)))
WEB_MAN := $(if $(WEB),$(BUILD)/man/fovea-web.1)
.PHONY: man
man: $(MAN) $(CALIBRATE_MAN) $(WEB_MAN)  ## make the manual pages: man -l build/man/fovea.1
$(BUILD)/man/fovea.1: $(BUILD)/fovea
	@mkdir -p $(@D)
	$(Q)$(RUN_HERE) --man >$@
$(BUILD)/man/fovea-web.1: $(WEB)
	@mkdir -p $(@D)
	$(Q)$(EMULATED) $(WEB) --man >$@
$(BUILD)/man/fovea-calibrate.1: $(CALIBRATE)
	@mkdir -p $(@D)
	$(Q)$(EMULATED) $(CALIBRATE) --man >$@
$(BUILD)/man/fovea-calibrate-%.1: $(CALIBRATE)
	@mkdir -p $(@D)
	$(Q)$(EMULATED) $(CALIBRATE) $* --man >$@
$(BUILD)/man/fovea-%.1: $(BUILD)/fovea
	@mkdir -p $(@D)
	$(Q)$(RUN_HERE) $* --man >$@

$(BUILD)/example.yaml: $(BUILD)/fovea
	$(Q)$(RUN_HERE) config >$@

UNITS = fovea@.service $(if $(WEB),fovea-web@.service) $(if $(CALIBRATE),fovea-calibrate@.service)
install: all man  ## install program, manual pages, libraries, headers, message types and services under PREFIX
	install -d $(DESTDIR)$(PREFIX)/bin $(DESTDIR)$(LIBDIR)/pkgconfig $(DESTDIR)$(PREFIX)/include/fovea \
	           $(DESTDIR)$(PREFIX)/share/fovea/lcmtypes $(DESTDIR)$(PREFIX)/share/man/man1
	install -m 755 $(BUILD)/fovea $(DESTDIR)$(PREFIX)/bin/
	$(if $(CALIBRATE),install -m 755 $(CALIBRATE) $(DESTDIR)$(PREFIX)/bin/)
	$(if $(WEB),install -m 755 $(WEB) $(DESTDIR)$(PREFIX)/bin/)
	install -m 644 $(BUILD)/libfovea.a $(DESTDIR)$(LIBDIR)/
	$(if $(LIBCAMERA_PLUGIN),install -D -m 755 $(LIBCAMERA_PLUGIN) $(DESTDIR)$(PREFIX)/lib/fovea/fovea-libcamera)
	$(if $(VIDEO_PLUGIN),install -D -m 755 $(VIDEO_PLUGIN) $(DESTDIR)$(PREFIX)/lib/fovea/fovea-video.so)
	$(if $(TEXT_PLUGIN),install -D -m 755 $(TEXT_PLUGIN) $(DESTDIR)$(PREFIX)/lib/fovea/fovea-text.so)
	install -m 755 $(BUILD)/libfovea.so.$(VERSION) $(DESTDIR)$(LIBDIR)/
	ln -sf libfovea.so.$(VERSION) $(DESTDIR)$(LIBDIR)/$(SONAME)
	ln -sf $(SONAME) $(DESTDIR)$(LIBDIR)/libfovea.so
	install -m 755 $(BUILD)/libfovea-messages.so.$(VERSION) $(DESTDIR)$(LIBDIR)/
	ln -sf libfovea-messages.so.$(VERSION) $(DESTDIR)$(LIBDIR)/$(MESSAGES_SONAME)
	ln -sf $(MESSAGES_SONAME) $(DESTDIR)$(LIBDIR)/libfovea-messages.so
	install -m 644 include/fovea/*.h $(DESTDIR)$(PREFIX)/include/fovea/
	install -m 644 $(MAN) $(CALIBRATE_MAN) $(WEB_MAN) $(DESTDIR)$(PREFIX)/share/man/man1/
	install -m 644 src/detect/shipped.fvm src/detect/segmenter.fvm $(DESTDIR)$(PREFIX)/share/fovea/
	install -m 644 include/lcmtypes/*.lcm $(DESTDIR)$(PREFIX)/share/fovea/lcmtypes/
	install -d $(DESTDIR)$(PREFIX)/lib/systemd/system
	for unit in $(UNITS); do sed 's|/usr/local/bin|$(PREFIX)/bin|' "tools/service/$$unit" >"$(DESTDIR)$(PREFIX)/lib/systemd/system/$$unit"; done
	$(if $(WEB),install -D -m 644 tools/service/fovea-web.avahi $(DESTDIR)$(PREFIX)/share/fovea/avahi/fovea-web.service)
	install -D -m 644 tools/service/fovea.sysusers $(DESTDIR)$(PREFIX)/lib/sysusers.d/fovea.conf
	install -D -m 644 tools/service/71-fovea.rules $(DESTDIR)$(PREFIX)/lib/udev/rules.d/71-fovea.rules
	for name in fovea fovea-messages; do sed 's|@PREFIX@|$(PREFIX)|; s|@LIBDIR@|$(LIBDIR)|; s|@VERSION@|$(VERSION)|' tools/$$name.pc.in >$(DESTDIR)$(LIBDIR)/pkgconfig/$$name.pc; done
	@# Programs find the shared library at once, where it lies in a folder that the system's linker looks through.
	@[ -n "$(DESTDIR)" ] || [ "$$(id -u)" != 0 ] || ! /sbin/ldconfig -N -v 2>/dev/null | grep -q '^$(LIBDIR):' || /sbin/ldconfig

deb:  ## install what is missing and build the Debian packages in build/packages; ARCH=arm64: for ARM
	@tools/package/build.sh $(ARCH)
.PHONY: deb

# ---- building --------------------------------------------------------------------------------------------------
$(BUILD)/generated/%.c: include/lcmtypes/%.lcm
	@mkdir -p $(@D)
	$(Q)lcm-gen -c --c-cpath $(@D) --c-hpath $(@D) $<
$(BUILD)/generated/%.h: $(BUILD)/generated/%.c ;
$(BUILD)/generated/fovea_fields.h: tools/lcm_fields.awk $(LCMTYPES)
	@mkdir -p $(@D)
	$(Q)awk -f $< $(LCMTYPES) >$@
# All types at once, and a list of them: fovea_pose_t and so on.
$(BUILD)/generated/fovea_types.h: $(LCMTYPES) Makefile
	@mkdir -p $(@D)
	@printf '#include "%s.h"\n' $(notdir $(LCMTYPES:.lcm=)) >$@
	@printf '#define FV_EVERY_TYPE(ROW)' >>$@
	@printf ' ROW(%s)' $(notdir $(LCMTYPES:.lcm=)) >>$@
	@echo >>$@
$(BUILD)/generated/fovea_type_texts.h: tools/lcm_text.awk $(LCMTYPES)
	@mkdir -p $(@D)
	$(Q)awk -f $< $(LCMTYPES) >$@
# What recordings name beside the version: a hash of all sources, so that builds of two commits differ in it where results may.
HASHED := $(sort $(shell find src include drivers -type f -name '*.[ch]' -o -name '*.cpp' -o -name '*.def' -o -name '*.lcm'))
$(BUILD)/generated/source_hash.h: always
	@mkdir -p $(@D)
	@hash=$$(cat $(HASHED) | sha256sum | cut -c 1-12); echo "#define FV_SOURCE_HASH \"$$hash\"" >$@.new
	@if cmp -s $@.new $@; then rm $@.new; else mv $@.new $@; fi
$(BUILD)/obj/src/app/record/recording_header.o: $(BUILD)/generated/source_hash.h
$(GEN_O): %.o: %.c | $(LCMGEN)
	@echo "  $(notdir $(CC)) $<"
	$(Q)$(CC) $(filter-out $(WARN),$(CFLAGS)) -fno-strict-aliasing $(if $(filter asan,$(SAN)),-fno-sanitize=undefined) \
	    -c $< -o $@

# Instruction sets by file name: everything else is the architecture's baseline.
isa_flags = $(if $(findstring _sse4.c,$(1)),-msse4.2 -mpopcnt)\
            $(if $(findstring _avx2.c,$(1)),-mavx2 -mfma -mbmi -mbmi2 -mpopcnt)\
            $(if $(findstring _avxvnni.c,$(1)),-mavx2 -mfma -mavxvnni -mbmi -mbmi2 -mpopcnt)\
            $(if $(findstring _evexvnni.c,$(1)),-mfma -mavx512f -mavx512bw -mavx512dq -mavx512vl -mavx512cd -mavx512vnni -mbmi -mbmi2 -mpopcnt -mprefer-vector-width=256)\
            $(if $(findstring _avx512.c,$(1)),-mavx512f -mavx512bw -mavx512dq -mavx512vl -mavx512cd -mbmi -mbmi2 -mpopcnt)\
            $(if $(findstring _avx512vnni.c,$(1)),-mavx512f -mavx512bw -mavx512dq -mavx512vl -mavx512cd -mavx512vnni -mbmi -mbmi2 -mpopcnt)\
            $(if $(findstring _avx512icl.c,$(1)),-mavx512f -mavx512bw -mavx512dq -mavx512vl -mavx512cd -mavx512vnni -mavx512vbmi -mavx512vbmi2 -mavx512bitalg -mavx512vpopcntdq -mbmi -mbmi2 -mpopcnt)\
            $(if $(findstring _dotprod.c,$(1)),-march=armv8.2-a+dotprod)\
            $(if $(findstring _i8mm.c,$(1)),-march=armv8.2-a+dotprod+i8mm)

# Loops that the compiler vectorises take whole registers.
$(BUILD)/obj/src/kernels/x86/filter_avx512.o $(BUILD)/obj/src/kernels/x86/edge_avx512.o: CFLAGS += -mprefer-vector-width=512

# clang takes up to a minute for each file of unrolled products under sanitizers, unless each check of an address is a call. The three
# checks of pointers that are left out make a third of it; asan still finds accesses outside of memory there.
ifneq (,$(filter asan fuzz,$(SAN)))
$(BUILD)/obj/src/kernels/x86/nn_gemm_%.o: CFLAGS += -mllvm -asan-instrumentation-with-call-threshold=0 -fno-sanitize=alignment,null,pointer-overflow
endif

# Only programs and tests may see the drivers' own headers.
$(BUILD)/obj/src/app/%.o $(BUILD)/obj/src/web/%.o $(BUILD)/obj/tests/%.o $(BUILD)/obj/tools/%.o: CFLAGS += -I.
$(BUILD)/obj/src/calibrate/%.o $(BUILD)/obj/tests/%.o: CXXFLAGS += -I.

$(BUILD)/obj/%.o: %.c | $(LCMGEN)
	@mkdir -p $(@D)
	@echo "  $(notdir $(CC)) $<"
	$(Q)$(CC) $(CFLAGS) $(call isa_flags,$<) -c $< -o $@
$(BUILD)/obj/%.o: %.cpp | $(LCMGEN)
	@mkdir -p $(@D)
	@echo "  $(notdir $(CXX)) $<"
	$(Q)$(CXX) $(CXXFLAGS) -c $< -o $@

$(BUILD)/libfovea.a: $(CORE_O)
	@rm -f $@
	$(Q)$(AR) rcs $@ $^
# Library and program by the C compiler: nothing of C++ is in them, and the C++ runtime would take a megabyte.
$(BUILD)/libfovea.so.$(VERSION): $(CORE_O) $(BUILD)/libfovea.map
	@echo "  link $@"
	$(Q)$(CC) $(LDFLAGS) -shared -Wl,-soname,$(SONAME) -Wl,--version-script=$(BUILD)/libfovea.map -o $@ $(CORE_O) $(LIBS_CORE)
$(BUILD)/libfovea.so: $(BUILD)/libfovea.so.$(VERSION)
	@ln -sf $(<F) $(BUILD)/$(SONAME)
	@ln -sf $(SONAME) $@
# Messages as JSON, for programs that have no use for the runtime.
MESSAGES_O := $(call objs,src/message/json.c src/message/fields.c src/base/status.c) $(GEN_O)
$(BUILD)/libfovea-messages.so.$(VERSION): $(MESSAGES_O) $(BUILD)/libfovea-messages.map
	@echo "  link $@"
	$(Q)$(CC) $(LDFLAGS) -shared -Wl,-soname,$(MESSAGES_SONAME) -Wl,--version-script=$(BUILD)/libfovea-messages.map -o $@ $(MESSAGES_O) $(LIBS_CORE)
$(BUILD)/libfovea-messages.so: $(BUILD)/libfovea-messages.so.$(VERSION)
	@ln -sf $(<F) $(BUILD)/$(MESSAGES_SONAME)
	@ln -sf $(MESSAGES_SONAME) $@
# They offer the functions of the public headers alone: tools/*.symbols, which tools/check_symbols.sh holds against both.
$(BUILD)/lib%.map: tools/lib%.symbols
	@mkdir -p $(@D)
	@{ echo '{ global:'; sed 's/$$/;/' $<; echo 'local: *; };'; } >$@
$(BUILD)/libfovea-app.a: $(APP_O) $(DRIVERS_O)
	@rm -f $@
	$(Q)$(AR) rcs $@ $^
$(BUILD)/obj/src/features/extract.o: CFLAGS += $(if $(filter no,$(SURF)),-DFV_WITHOUT_SURF)
$(BUILD)/obj/src/features/extract.o: $(BUILD)/surf
# It is looked at each time: a stamp of another name that is not there would not be made, as all files are .SECONDARY.
.PHONY: always
$(BUILD)/surf: always
	@mkdir -p $(@D) && echo $(SURF) | cmp -s - $@ || echo $(SURF) >$@
$(BUILD)/fovea: $(MAIN_O) $(BUILD)/libfovea-app.a $(BUILD)/libfovea.a
	@echo "  link $@"
	$(Q)$(CC) $(LDFLAGS) -pie -o $@ $(MAIN_O) -Wl,--start-group $(BUILD)/libfovea-app.a $(BUILD)/libfovea.a -Wl,--end-group $(LIBS_APP)
$(BUILD)/fovea-video.so: drivers/video.cpp drivers/recorded/video_plugin.h $(BUILD)/obj/src/base/status.o Makefile
	$(Q)$(CXX) $(filter-out -fstack-usage,$(CXXFLAGS)) -isystem $(INCLUDED)/opencv4 $(HARDLINK) -fvisibility=hidden -shared -Wl,-Bsymbolic \
	    -o $@ $< $(BUILD)/obj/src/base/status.o -lopencv_videoio -lopencv_core
$(BUILD)/fovea-text.so: src/support/plugin/freetype.c src/support/lettering.h Makefile
	$(Q)$(CC) $(filter-out -fstack-usage,$(CFLAGS)) -isystem $(INCLUDED)/freetype2 $(HARDLINK) -fvisibility=hidden -shared -Wl,-Bsymbolic -o $@ $< -lfreetype
LIBCAMERA_O := $(call objs,drivers/libcamera.cpp $(wildcard drivers/libcamera/*.cpp))
$(LIBCAMERA_O): CXXFLAGS += $(patsubst -I%,-isystem %,$(shell pkg-config --cflags-only-I libcamera))
$(BUILD)/fovea-libcamera: $(LIBCAMERA_O) $(BUILD)/obj/src/base/status.o $(BUILD)/obj/src/image/image.o Makefile
	@echo "  link $@"
	$(Q)$(CXX) $(LDFLAGS) -pie -o $@ $(filter %.o,$^) $(shell pkg-config --libs libcamera)
CALIBRATE_O := $(call objs,$(CALIBRATE_CXX))
# Markers are in aruco up to OpenCV 4.6, and in objdetect from 4.7 on.
MARKER_LIBS := -lopencv_aruco -Wl,--push-state,--as-needed -lopencv_objdetect -Wl,--pop-state
CALIBRATE_LIBS := $(MARKER_LIBS) -lopencv_calib3d -lopencv_features2d -lopencv_imgproc -lopencv_core -lceres -lglog
$(BUILD)/obj/src/calibrate/%.o: CXXFLAGS += -isystem $(INCLUDED)/eigen3 -isystem $(INCLUDED)/opencv4
# It serves its page by the server of fovea-web, where that is built.
WEB_O := $(call objs,$(WEB_C))
CALIBRATE_WEB_O := $(if $(WEB),$(WEB_O))
CALIBRATE_LIBS += $(if $(WEB),$(WEB_LIBS))
$(BUILD)/obj/src/calibrate/live_page.o: CXXFLAGS += $(if $(WEB),-DFV_CALIBRATE_PAGE)
$(BUILD)/obj/src/calibrate/live_page.o: $(BUILD)/calibrate-page
$(BUILD)/calibrate-page: always
	@mkdir -p $(@D) && echo $(if $(WEB),yes,no) | cmp -s - $@ || echo $(if $(WEB),yes,no) >$@
$(BUILD)/fovea-calibrate: $(BUILD)/obj/src/calibrate/main.o $(CALIBRATE_O) $(CALIBRATE_WEB_O) $(BUILD)/libfovea-app.a $(BUILD)/libfovea.a
	@echo "  link $@"
	$(Q)$(CXX) $(LDFLAGS) -pie -o $@ $(filter %.o,$^) -Wl,--start-group $(BUILD)/libfovea-app.a $(BUILD)/libfovea.a -Wl,--end-group \
	    $(CALIBRATE_LIBS) $(LIBS_APP)
WEB_PAGE := $(patsubst src/web/page/%,$(BUILD)/page/%.gz,$(wildcard src/web/page/*)) $(WEB_SCRIPTS:$(SCRIPTS)/%=$(BUILD)/page/library/%.gz) $(BUILD)/page/types.txt.gz
$(BUILD)/page/%.gz: src/web/page/%
	@mkdir -p $(@D)
	$(Q)gzip -9nc $< >$@
$(BUILD)/page/library/%.gz: $(SCRIPTS)/%
	@mkdir -p $(@D)
	$(Q)gzip -9nc $< >$@
# The definitions of all messages, by which the page decodes them.
$(BUILD)/page/types.txt.gz: $(LCMTYPES) Makefile
	@mkdir -p $(@D)
	$(Q)for file in $(LCMTYPES); do name=$$(basename $$file .lcm); case $$name in bot_core_*) package=bot_core ;; *) package=fovea ;; esac; \
	    echo "//! type $$package.$${name#$${package}_}"; sed 's|//.*||; s|^ *\*.*||; s|^/\*.*||' $$file; done | grep -v '^ *$$' | gzip -9nc >$@
$(BUILD)/obj/src/web/assets.o: $(WEB_PAGE)
$(BUILD)/obj/src/web/assets.o: CFLAGS += -DFV_WEB_PAGE='"$(BUILD)/page"'
$(BUILD)/fovea-web: $(BUILD)/obj/src/web/main.o $(WEB_O) $(BUILD)/libfovea-app.a $(BUILD)/libfovea.a
	@echo "  link $@"
	$(Q)$(CC) $(LDFLAGS) -pie -o $@ $(filter %.o,$^) -Wl,--start-group $(BUILD)/libfovea-app.a $(BUILD)/libfovea.a -Wl,--end-group $(WEB_LIBS) $(LIBS_APP)
$(BUILD)/fovea.pc: tools/fovea.pc.in include/fovea/fovea.h
	$(Q)sed 's|@PREFIX@|$(PREFIX)|; s|@LIBDIR@|$(LIBDIR)|; s|@VERSION@|$(VERSION)|' $< >$@

# ---- tests: every tests/**/test_*.c(pp) is one program ------------------------------------------------------------
TESTS_C   := $(shell find tests -name 'test_*.c' 2>/dev/null | sort $(if $(FOVEA_TURN),| tools/turn.sh $(FOVEA_TURN)))
TESTS_CXX := $(if $(CROSS)$(SAN),,$(shell find tests -name 'test_*.cpp' 2>/dev/null | sort))  # need OpenCV
TESTS     := $(patsubst tests/%.c,$(BUILD)/tests/%,$(TESTS_C)) $(patsubst tests/%.cpp,$(BUILD)/tests/%,$(TESTS_CXX))
# Of the page, where its program is built.
TESTS     := $(if $(WEB),$(TESTS),$(filter-out $(BUILD)/tests/unit/web/% $(BUILD)/tests/transport/test_web%,$(TESTS)))
TEST_HELP := $(call objs,$(filter-out tests/common/wrong_case.c tests/common/program.c,$(wildcard tests/common/*.c)))
# The jar is tested where there is a Java to build it: 200 MB that no other test needs.
JAR       := $(if $(and $(wildcard /usr/share/java/lcm.jar),$(shell command -v javac)),$(BUILD)/fovea-types.jar)
.PHONY: tests
tests: $(TESTS) $(EXAMPLES) $(BUILD)/tests/replay/flipped $(if $(WEB),$(BUILD)/tests/campaign/blinks) $(BUILD)/subscribe $(BUILD)/command $(BUILD)/python/fovea/__init__.py $(if $(CROSS)$(SAN),,$(BUILD)/subscribe-cpp $(BUILD)/venv-lcm/ready $(BUILD)/venv-import/ready $(BUILD)/venv-mahotas/ready $(BUILD)/mcap-venv/ready $(BUILD)/mavlink-venv/ready $(if $(WEB),$(BUILD)/browser-venv/ready $(BUILD)/foxglove-venv/ready) $(JAR))

# LCM for the Python subscriber comes from PyPI; where that cannot be reached its test says so and is skipped.
$(BUILD)/venv-lcm/ready:
	@{ python3 -m venv $(BUILD)/venv-lcm && timeout 120 $(BUILD)/venv-lcm/bin/pip install -q --disable-pip-version-check lcm \
	    && touch $@; } || echo "found no Python package lcm: its subscriber will not be tested"

# What tools/mcap.py needs.
$(BUILD)/mcap-venv/ready:
	@tools/mcap_python.sh $(BUILD) >/dev/null || echo "found no Python package mcap: tools/mcap.py will not be tested"

# What tools/examples/obstacle_distance.py needs.
$(BUILD)/mavlink-venv/ready:
	@tools/mavlink_python.sh $(BUILD) >/dev/null || echo "found no Python packages lcm and pymavlink: obstacle_distance.py will not be tested"

# What drives a browser through the page.
$(BUILD)/browser-venv/ready:
	@tools/browser_python.sh $(BUILD) >/dev/null || echo "found no Python package selenium: the page will not be tested in a browser"

# Clients of Foxglove's protocol.
$(BUILD)/foxglove-venv/ready:
	@tools/foxglove_python.sh $(BUILD) >/dev/null || echo "found no Python packages foxglove-sdk and websockets: no client of theirs will be tested"

# SURF to compare ours with: OpenCV's packages have none.
$(BUILD)/venv-mahotas/ready:
	@{ python3 -m venv $(BUILD)/venv-mahotas && timeout 180 $(BUILD)/venv-mahotas/bin/pip install -q --disable-pip-version-check mahotas==1.4.19 numpy \
	    && touch $@; } || echo "found no Python package mahotas: SURF will not be compared"

# What tools/import needs, for the test that imports a real network.
$(BUILD)/venv-import/ready:
	@{ python3 -m venv $(BUILD)/venv-import && timeout 180 $(BUILD)/venv-import/bin/pip install -q --disable-pip-version-check tflite numpy flatbuffers \
	    && touch $@; } || echo "found no Python packages tflite and numpy: no network will be imported in tests"

# Tests are many, and each holds the whole library: what a debugger needs is left out of them, unless TEST_DEBUG is set.
$(BUILD)/tests/%: $(BUILD)/obj/tests/%.o $(TEST_HELP) $(BUILD)/libfovea-app.a $(BUILD)/libfovea.a
	@mkdir -p $(@D)
	@echo "  link $@"
	$(Q)$(CXX) $(LDFLAGS) $(if $(SAN)$(TEST_DEBUG),,-Wl,--strip-debug) -pie -o $@ $< $(TEST_MORE) $(TEST_HELP) -Wl,--start-group $(BUILD)/libfovea-app.a $(BUILD)/libfovea.a -Wl,--end-group \
	    -lcmocka $(LIBS_APP) $(if $(filter tests/%.cpp,$(wildcard tests/$*.cpp)),$(OPENCV_LIBS)) $(ORACLE_LIBS) -lm
# What bounds are made of and checked with, in one program that runs under qemu with a counting plug-in (tools/bounds.py). It includes
# sources of the library, whose own objects are then not linked.
BOUNDS_O := $(call objs,$(wildcard tests/bounds/*.c))
BOUNDS_WRAPPED := fv_inertial_stage_predict fv_inertial_stage_rate fv_inertial_stage_step fv_odometry_place
$(BUILD)/bounds: $(BOUNDS_O) $(TEST_HELP) $(BUILD)/libfovea-app.a $(BUILD)/libfovea.a
	@echo "  link $@"
	$(Q)$(CXX) $(LDFLAGS) -pie $(BOUNDS_WRAPPED:%=-Wl,--wrap=%) -o $@ $(BOUNDS_O) $(TEST_HELP) -Wl,--start-group $(BUILD)/libfovea-app.a $(BUILD)/libfovea.a -Wl,--end-group -lcmocka $(LIBS_APP)
# The checks and benchmarks of kernels, one file per family, make up one program.
KERNEL_CHECKS := $(call objs,$(filter-out tests/kernels/test_%,$(wildcard tests/kernels/*.c)))
$(BUILD)/tests/kernels/test_kernels: $(KERNEL_CHECKS)
$(BUILD)/tests/kernels/test_kernels: TEST_MORE := $(KERNEL_CHECKS)

# These run the whole command, which replaces malloc: tests that watch the heap themselves cannot be linked with it.
WRONG_TESTS := $(BUILD)/tests/unit/app/config/test_wrong_values $(BUILD)/tests/unit/app/run/test_wrong $(BUILD)/tests/unit/app/run/test_kept
$(WRONG_TESTS): $(call objs,tests/common/wrong_case.c)
$(WRONG_TESTS): TEST_MORE := $(call objs,tests/common/wrong_case.c)
PROGRAM_TESTS := $(BUILD)/tests/realtime/test_ends $(BUILD)/tests/realtime/test_host $(BUILD)/tests/realtime/test_reclaim
$(PROGRAM_TESTS): $(call objs,tests/common/program.c)
$(PROGRAM_TESTS): TEST_MORE := $(call objs,tests/common/program.c)
# The planner of an example, and a campaign that drives by it.
PLANNER_TESTS := $(BUILD)/tests/campaign/drive $(BUILD)/tests/unit/campaign/test_navigate $(BUILD)/tests/unit/campaign/test_dstar_lite
PLANNER_O := $(call objs,$(addprefix tools/examples/navigate/,dstar_lite.c map.c pieces.c plan.c steer.c ways.c))
$(PLANNER_TESTS): $(PLANNER_O)
$(PLANNER_TESTS): TEST_MORE := $(PLANNER_O)
# The campaign of fault schedules, one file per part, is one program; a test judges its judging.
FAULTS_O := $(call objs,$(wildcard tests/campaign/faults/*.c))
FAULTS := $(BUILD)/tests/campaign/faults $(BUILD)/tests/unit/campaign/test_faults
$(FAULTS): $(FAULTS_O)
$(FAULTS): TEST_MORE := $(FAULTS_O)
# The benchmarks beside OpenCV, one file per room, make up one program.
BENCH_O := $(call objs,$(wildcard tests/bench/*.cpp)) $(KERNEL_CHECKS)
$(BUILD)/bench: $(BENCH_O) $(BUILD)/libfovea-app.a $(BUILD)/libfovea.a
	@echo "  link $@"
	$(Q)$(CXX) $(LDFLAGS) -pie -o $@ $(BENCH_O) -Wl,--start-group $(BUILD)/libfovea-app.a $(BUILD)/libfovea.a -Wl,--end-group \
	    $(OPENCV_LIBS) $(LIBS_APP) -lm
# The armed proof brings its own malloc, so of the rest it takes the simulated camera only.
$(BUILD)/tests/realtime/test_armed: $(BUILD)/obj/tests/realtime/test_armed.o $(BUILD)/libfovea-app.a $(BUILD)/libfovea.a
	@mkdir -p $(@D)
	@echo "  link $@"
	$(Q)$(CXX) $(LDFLAGS) -pie -o $@ $< -Wl,--start-group $(BUILD)/libfovea-app.a $(BUILD)/libfovea.a -Wl,--end-group -lcmocka $(LIBS_APP) -lm
# What the tests on kernel drivers run inside the virtual machine.
$(BUILD)/hil-tool: $(call objs,$(wildcard tests/hil/tool*.c)) $(BUILD)/libfovea-app.a $(BUILD)/libfovea.a
	@echo "  link $@"
	$(Q)$(CXX) $(LDFLAGS) -pie -rdynamic -o $@ $(filter %.o,$^) -Wl,--start-group $(BUILD)/libfovea-app.a $(BUILD)/libfovea.a -Wl,--end-group $(LIBS_APP)
# It is preloaded into the process of libcamera there.
$(BUILD)/hil-count.so: tests/hil/count_heap.c tests/common/heap_calls.h
	@echo "  link $@"
	$(Q)$(CC) $(CFLAGS) -Itests -shared -o $@ $<
OPENCV_LIBS = -lopencv_calib3d -lopencv_features2d -lopencv_flann -lopencv_imgcodecs -lopencv_imgproc -lopencv_core
# Optimisers are held against Ceres.
BESIDE_CERES := map/test_pose_graph map/test_window_ceres
$(BESIDE_CERES:%=$(BUILD)/tests/unit/%): ORACLE_LIBS := $(MARKER_LIBS) -lceres -lglog
$(BESIDE_CERES:%=$(BUILD)/obj/tests/unit/%.o) $(BUILD)/obj/tests/unit/geometry/test_normal_equations.o $(BUILD)/obj/tests/unit/calibrate/%.o: CXXFLAGS += -isystem $(INCLUDED)/eigen3
# Parts of the page's server that know no socket are tested by their functions, the others by the program.
WEB_TESTS := $(filter $(BUILD)/tests/unit/web/%,$(TESTS))
WEB_ROOM := $(filter-out %/server.o %/server_access.o %/server_link.o %/server_http.o %/server_foxglove.o %/pages.o %/main.o,$(WEB_O))
$(WEB_TESTS): $(WEB_ROOM)
$(WEB_TESTS): TEST_MORE := $(WEB_ROOM)
$(filter $(BUILD)/tests/transport/test_web%,$(TESTS)): | $(WEB)
$(filter %/test_web_calibrate,$(TESTS)): | $(CALIBRATE)
$(filter %/transport/test_web_pages,$(TESTS)): $(WEB_O)
$(filter %/transport/test_web_pages,$(TESTS)): TEST_MORE := $(WEB_O)
$(filter %/transport/test_web_pages,$(TESTS)): ORACLE_LIBS := $(WEB_LIBS)
$(WEB_TESTS) $(filter %/transport/test_web_encrypted,$(TESTS)): ORACLE_LIBS := -lssl -lcrypto -ljansson
# Calibration is tested by its functions.
CALIBRATE_TESTS := $(patsubst tests/%.cpp,$(BUILD)/tests/%,$(wildcard tests/unit/calibrate/*.cpp))
$(CALIBRATE_TESTS): $(CALIBRATE_O) $(CALIBRATE_WEB_O)
$(CALIBRATE_TESTS): TEST_MORE := $(CALIBRATE_O) $(CALIBRATE_WEB_O)
$(CALIBRATE_TESTS): ORACLE_LIBS := $(MARKER_LIBS) -lceres -lglog $(if $(WEB),$(WEB_LIBS))
$(BUILD)/obj/tests/%.o: CFLAGS += -Itests
$(BUILD)/obj/tests/%.o: CXXFLAGS += -Itests -isystem $(INCLUDED)/opencv4

-include $(shell find $(BUILD) -name '*.d' -type f 2>/dev/null)
