/// Processor times of calibration: calibrate_bench [PHOTO...] [--benchmark_filter=...]
/// Corners and photos are simulated, except for the photos that are named.
#include <benchmark/benchmark.h>

#include <filesystem>
#include <map>
#include <opencv2/imgcodecs.hpp>

#include "alidade/board_detector/find_board.h"
#include "alidade/calibrate/checks/lens_covariance.h"
#include "alidade/calibrate/setup.h"
#include "alidade/calibrate/solve/normal_equations.h"
#include "alidade/camera/projection_sigma.h"
#include "alidade/simulate/example_camera.h"
#include "bench_scenes.h"

namespace alidade::bench {
namespace {

/// Drawn when first needed, as most runs look at one case.
const Corners& corners_of(const SolveCase& solve_case) {
  static std::map<std::string, Corners> drawn;
  const auto [place, is_new] = drawn.try_emplace(name_of(solve_case));
  if (is_new) place->second = draw_corners(solve_case);
  return place->second;
}

/// The whole solve with every option's default: start, outlier rejection, covariance of lens and poses.
void time_calibrate(benchmark::State& state, const SolveCase& solve_case) {
  const Corners& corners = corners_of(solve_case);
  for (auto _ : state) {
    const CalibrateReport report = calibrate(corners.board, corners.views, corners.size, {});
    if (report.status != CalibrateReport::Status::converged) state.SkipWithError(report.reason.c_str());
    benchmark::DoNotOptimize(report.rms_px);
  }
}

/// A case's problem, and where its solve ends.
struct SolvedCase {
  std::vector<ViewArrays> arrays;
  BundleProblem problem;
  BundleState state;

  explicit SolvedCase(const Corners& corners) {
    const CalibrateReport report = calibrate(corners.board, corners.views, corners.size, {});
    (void)set_up_problem(corners.board, {}, corners.size, problem);
    state = {report.camera.lens, {}, report.board_points};
    for (std::size_t k = 0; k < corners.views.size(); ++k) {
      arrays.push_back(make_arrays(corners.views[k]));
      state.cam_from_board.push_back(report.views[k].cam_from_board);
    }
    problem.views = arrays;
  }
};

/// One step's normal equations.
void time_linearize(benchmark::State& state, const SolveCase& solve_case) {
  const SolvedCase solved(corners_of(solve_case));
  NormalEquations equations;
  for (auto _ : state) {
    if (!linearize(solved.problem, solved.state, equations)) state.SkipWithError("a corner cannot be projected");
    benchmark::DoNotOptimize(equations.cost);
  }
}

/// What clusters add to the model's covariance: photos and corners of the board.
void time_clusters(benchmark::State& state, const SolveCase& solve_case) {
  const SolvedCase solved(corners_of(solve_case));
  const BundleResult result = with_covariance(solve_bundle(solved.problem, solved.state, {}));
  if (result.status != BundleResult::Status::converged) state.SkipWithError("no convergence");
  for (auto _ : state) {
    benchmark::DoNotOptimize(lens_covariance(solved.problem, 1.0, {}, result).stated.data());
  }
}

void time_projection_sigma(benchmark::State& state) {
  const Corners& corners = corners_of({9, 6, 20});
  const Camera camera = calibrate(corners.board, corners.views, corners.size, {}).camera;
  for (auto _ : state) {
    benchmark::DoNotOptimize(projection_sigma(camera, 60, 40, std::numeric_limits<double>::infinity()).values.data());
  }
}

void time_find_board(benchmark::State& state, const cv::Mat& photo, bool has_board) {
  for (auto _ : state) {
    const BoardDetection detection = find_board(photo, Board{});
    if (detection.found() != has_board) state.SkipWithError(has_board ? "not found" : "found where there is none");
    benchmark::DoNotOptimize(detection.view.corners.data());
  }
}

void add(const std::string& name, const std::function<void(benchmark::State&)>& run) {
  benchmark::RegisterBenchmark(name.c_str(), run)->MeasureProcessCPUTime()->Unit(benchmark::kMillisecond);
}

void add_all(const std::vector<std::string>& photos) {
  for (const SolveCase& solve_case : all_cases()) {
    add("calibrate/" + name_of(solve_case), [=](benchmark::State& state) { time_calibrate(state, solve_case); });
    add("linearize/" + name_of(solve_case), [=](benchmark::State& state) { time_linearize(state, solve_case); });
    add("clusters/" + name_of(solve_case), [=](benchmark::State& state) { time_clusters(state, solve_case); });
  }
  add("projection_sigma/60x40", time_projection_sigma);
  for (const unsigned seed : {1u, 2u, 3u, 4u, 5u}) {
    add("find_board/board_" + std::to_string(seed) + ".png",
        [=](benchmark::State& state) { time_find_board(state, vga_photo_with_board(seed), true); });
  }
  add("find_board/no_board.png",
      [](benchmark::State& state) { time_find_board(state, megapixel_photo_without_board(), false); });
  for (const std::filesystem::path path : photos) {
    add("find_board/" + path.filename().string(), [=](benchmark::State& state) {
      const cv::Mat photo = cv::imread(path, cv::IMREAD_GRAYSCALE);
      time_find_board(state, photo, true);
    });
  }
}

}  // namespace
}  // namespace alidade::bench

int main(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  alidade::bench::add_all({argv + 1, argv + argc});
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}
