#pragma once

#include <benchmark/benchmark.h>

namespace alidade::bench {

/// What each benchmark's `main` does: reads the flags, registers, runs.
inline int run_benchmarks(int argc, char** argv, void (*add_all)()) {
  benchmark::Initialize(&argc, argv);
  add_all();
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}

}  // namespace alidade::bench
