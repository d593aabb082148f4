#!/bin/sh
# Everything that must hold before a change is done: format, layers, frames, a build with sanitizers, tests, tidy.
set -eu
cd "$(dirname "$0")/.."
tools/setup build test-build test tidy
tools/check_format
python3 tools/check_layers.py src/alidade
python3 tools/check_frames.py src cli
cmake --preset dev -DALIDADE_TESTS=ON >/dev/null
ninja -C build/dev
ctest --test-dir build/dev --output-on-failure --parallel "$(nproc)"
tools/check_tidy
