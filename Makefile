# Two commands: `make demo` and `make test`. Each target installs what it misses, says what it does, and is quick the
# second time.
.PHONY: help build install deb deb-test demo test bench study fuzz faults sanitize docs format tidy clean
.DEFAULT_GOAL := help

out := build/release
# Ninja's own choice of jobs, unless given: make test JOBS=1
jobs := $(if $(JOBS),-j $(JOBS),)

help:
	@echo "make demo    calibrate a camera from 13 real photos, and write its report"
	@echo "make test    build and run the tests"
	@echo "make build   build build/release/alidade and the Python module, build/release/python"
	@echo "make install PREFIX=/usr/local: the executable, the library with its headers, the Python module, man pages, bash completion"
	@echo "make deb     Debian packages of executable, library, Python module and documentation, in build/deb"
	@echo "make deb-test: install and use them in a fresh Debian 12 root, and remove them"
	@echo "make bench   measure speed, side by side with OpenCV and mrcal"
	@echo "make docs    renew the images in README and docs"
	@echo "make study   is σ what it says? 2400 calibrations, 2000 observations, rangefinders; corners against OpenCV's, with known truth; or one of: $(studies)"
	@echo "make fuzz MINUTES=10   every reader of what others wrote, on bytes that nobody meant; docs/robustness.md"
	@echo "make faults  failing calls, full disks, kill -9, 64 runs at once, under every command that writes (hours: FAULTS=--short, a minute)"
	@echo "make sanitize  the tests under the address, undefined-behaviour and thread sanitizers"
	@echo "make format  format the sources;  make tidy: let clang-tidy read them"
	@echo "make clean   remove build/"
	@echo "Each installs the Debian packages it misses (packages.debian), as root or with sudo."

build:
	@tools/setup build
	@echo "build: $(out)/alidade, and the Python module in $(out)/python"
	@cmake --preset release >/dev/null
	@ninja -C $(out) $(jobs) programs
	@[ build/editor/compile_commands.json -nt CMakeLists.txt ] || cmake --preset editor >/dev/null

# PREFIX=/usr/local, or another place; DESTDIR for packages.
install:
	@tools/setup build
	@cmake --preset release >/dev/null
	@ninja -C $(out) $(jobs) programs alidade_shared
	@cmake --install $(out) $(if $(PREFIX),--prefix $(PREFIX),)

deb:
	@tools/setup build deb
	@JOBS=$(JOBS) tools/make_deb

deb-test:
	@tools/setup deb-test
	@[ -n "$(wildcard build/deb/*.deb)" ] || $(MAKE) deb
	@tools/deb_test build/deb

demo: build
	@tools/demo_photos build/demo/photos
	@echo "demo: $(out)/alidade calibrate build/demo/photos/left*.jpg --board 9x6 --square 0.025 --out build/demo/result"
	@$(out)/alidade calibrate build/demo/photos/left*.jpg --board 9x6 --square 0.025 --out build/demo/result

# What the tests start beside them (a browser, mpirun, INDI) is installed while they compile.
# As cli/main.cpp has it, and of large pages: touching a small one first can cost 17 µs on a virtual machine.
keep_freed_memory := glibc.malloc.hugetlb=1:glibc.malloc.mmap_threshold=33554432:glibc.malloc.trim_threshold=536870912:glibc.malloc.top_pad=4194304
test:
	@tools/setup build test-build
	@echo "test: building the tests in $(out)"
	@cmake --preset release -DALIDADE_TESTS=ON >/dev/null
	@tools/setup test & setup=$$!; ninja -C $(out) $(jobs) || { wait $$setup; exit 1; }; wait $$setup
	@echo "test: running them"
	@# Three more than there are cores: those that drive a browser, a simulated head or a broker wait most of the time.
	@GLIBC_TUNABLES=$(keep_freed_memory) ctest --test-dir $(out) --output-on-failure --parallel $$(($$(nproc) + 3))
	@tools/skipped_tests $(out)

bench:
	@tools/setup build bench
	@echo "bench: building the benchmarks in $(out)"
	@cmake --preset release -DALIDADE_BENCH=ON >/dev/null
	@ninja -C $(out) $(jobs) benchmarks
	@echo "bench: running them"
	@bench/run $(out)

fuzz: build
	@tools/setup fuzz
	@cmake -S fuzz -B build/fuzz -G Ninja -DCMAKE_CXX_COMPILER=clang++ >/dev/null
	@ninja -C build/fuzz $(jobs)
	@tools/fuzz.py $(out)/alidade build/fuzz --minutes $(or $(MINUTES),10)

faults: build
	@tools/setup fuzz
	@tools/faults.py $(out)/alidade $(FAULTS)
	@tools/load.py $(out)/alidade --seconds $(if $(findstring --short,$(FAULTS)),20,600)

# Tests of one program under the other sanitizers know nothing of each other: one after the other. What Debian's oneTBB
# orders the thread sanitizer does not see; on one processor it starts no threads, all others of the tests remain.
sanitize:
	@tools/setup build test-build test
	@for preset in asan tsan; do \
	  echo "sanitize: $$preset" && cmake --preset $$preset -DALIDADE_TESTS=ON -DALIDADE_WEB=OFF >/dev/null && \
	  ninja -C build/$$preset $(jobs) && on=$$(test $$preset = asan || echo taskset -c 0) && \
	  TSAN_OPTIONS=suppressions=$(CURDIR)/tools/tsan_suppressions \
	  $$on ctest --test-dir build/$$preset --output-on-failure --parallel $$(nproc) \
	    --label-exclude 'lint|docs|package|audit|web|robustness' || exit 1; done

docs: demo
	@tools/setup docs
	@echo "docs: docs/report.png, docs/observe.png and docs/tour/*.png, reports as a browser draws them"
	@$(out)/alidade simulate rotation --source head --zoom ramp --points 12 --seed 3 --out build/demo/turn --quiet
	@$(out)/alidade observe build/demo/turn/log.csv --size 780x582 --out build/demo/observed --quiet
	@chromium --headless --no-sandbox --hide-scrollbars --disable-gpu --virtual-time-budget=4000 --window-size=1500,1310 --force-device-scale-factor=0.7 \
	  --screenshot=docs/observe.png "file://$(CURDIR)/build/demo/observed/report.html" >/dev/null 2>&1
	@chromium --headless --no-sandbox --hide-scrollbars --disable-gpu --virtual-time-budget=4000 --window-size=1500,905 --force-device-scale-factor=0.8 \
	  --screenshot=docs/report.png "file://$(CURDIR)/build/demo/result/report.html" >/dev/null 2>&1
	@$(out)/alidade simulate board --board 9x6 --square 0.025 --photos 15 --size 640x480 --out build/demo/tour --quiet
	@$(out)/alidade calibrate build/demo/tour --board 9x6 --square 0.025 --out build/demo/tour-camera --quiet
	@$(out)/alidade simulate underwater --video --camera build/demo/tour/truth_camera.yaml --rate 30 --frames 30 --out build/demo/dive --quiet
	@$(out)/alidade localize build/demo/dive/frames --rate 30 --camera build/demo/tour-camera/camera.yaml \
	  --target build/demo/dive/target.yaml --truth build/demo/dive/truth.tum --out build/demo/path --quiet
	@node web/test/screenshot.mjs build/demo/tour-camera/report.html docs/tour/camera.png 1500x770 0.6
	@node web/test/screenshot.mjs build/demo/path/report.html docs/tour/path.png 1500x770 0.6
	@echo "docs: docs/rangefinder.png, rig.png, track.png, servo.png"
	@$(out)/alidade simulate rangefinder --photos --shots 12 --out build/demo/shots --quiet
	@$(out)/alidade rangefinder build/demo/shots/shots.csv --camera build/demo/shots/camera.yaml --board 9x6 --square 0.04 \
	  --out build/demo/beam --quiet
	@$(out)/alidade simulate rig --out build/demo/views --quiet
	@$(out)/alidade rig build/demo/views/views.csv --camera build/demo/views/camera_1.yaml --camera build/demo/views/camera_2.yaml \
	  --board 9x6 --square 0.025 --out build/demo/rig --quiet
	@$(out)/alidade simulate track --scenario C --out build/demo/events --quiet
	@$(out)/alidade track build/demo/events/events.csv --rig build/demo/events/rig.yaml --truth build/demo/events/truth.csv \
	  --out build/demo/track --quiet
	@$(out)/alidade simulate servo --out build/demo/loop --quiet
	@$(out)/alidade servo build/demo/loop/scenario.yaml --out build/demo/servo --quiet
	@node web/test/screenshot.mjs build/demo/beam/report.html docs/rangefinder.png 1500x760 0.6
	@node web/test/screenshot.mjs build/demo/rig/report.html docs/rig.png 1500x740 0.6
	@node web/test/screenshot.mjs build/demo/track/report.html docs/track.png 1500x740 0.6
	@node web/test/screenshot.mjs build/demo/servo/report.html docs/servo.png 1500x690 0.6

# Every part, and an exit code that says whether all of them reached their goals; `make study-heads` is one of them.
studies = study-pages study-halves study-shared study-localize study-heads study-head-seeds study-long study-corners study-faults study-causes
.PHONY: $(studies) study-build
study:
	@$(MAKE) --no-print-directory --keep-going $(studies)

study-build:
	@tools/setup build
	@echo "study: building $(out)/alidade, study_localize, study_shared, study_causes, study_faults and corner_accuracy"
	@cmake --preset release -DALIDADE_BENCH=ON >/dev/null
	@ninja -C $(out) $(jobs) study_localize study_shared study_causes study_faults corner_accuracy alidade_cli
	@mkdir -p build/study

$(studies): study-build

# COMMAND of a study, NAME: its page goes to docs/studies-NAME.md, reached or not.
study_page = $(1) >build/study/$(2).md; met=$$?; cp build/study/$(2).md docs/studies-$(2).md; exit $$met

study-pages:
	@tools/studies.py $(out)/alidade build/study

study-halves:
	@echo "study: halves of real sets, into docs/studies-halves.md"
	@$(call study_page,bench/study_halves.py $(out)/alidade 40,halves)

study-shared:
	@echo "study: what makes corners share errors, into docs/studies-shared.md"
	@$(call study_page,$(out)/study_shared 800,shared)

study-localize:
	@echo "study: localisation under water, into docs/studies-localize.md"
	@$(call study_page,$(out)/study_localize 200 20,localize)

study-heads:
	@echo "study: 200 runs with a head, broken at random instants, into docs/studies-heads.md"
	@$(call study_page,tools/head_kills.py $(out)/alidade --runs 200,heads)

# What a camera on a head by others sees; tools/head_seeds.py says how it is called.
world = $(ALIDADE_DATA)/peers/heads/world_on_rotctld.py
study-head-seeds:
	@echo "study: 20 heads by others that calibrate themselves, into docs/studies-head-seeds.md"
	@[ -x "$(world)" ] && command -v rotctld >/dev/null || { echo "study: left out: it needs rotctld, and a program that shows its world in ALIDADE_DATA"; exit 0; }; \
	$(call study_page,tools/head_seeds.py $(out)/alidade $(world) --seeds 20 --together 1,head-seeds)

study-long:
	@echo "study: a million rows on standard input"
	@tools/long_runs.py $(out)/alidade

study-corners:
	@$(out)/corner_accuracy

study-faults:
	@echo "study: how large a fault must be to be seen, into docs/studies-faults.md"
	@$(call study_page,$(out)/study_faults 20,faults)

study-causes:
	@echo "study: what is wrong with rigs and rangefinders, and what is seen of it, into docs/studies-causes.md"
	@$(call study_page,$(out)/study_causes 100,causes)

format:
	@tools/setup tidy
	@echo "format: every source file"
	@git ls-files '*.h' '*.cpp' | xargs clang-format-14 -i

tidy:
	@tools/setup build test-build test tidy
	@tools/check_tidy

clean:
	@echo "clean: removing build/"
	@rm -rf build
