#include <fmt/format.h>

#include <array>
#include <cmath>
#include <cstdlib>

#include "alidade/calibrate/calibrate.h"
#include "alidade/simulate/example_camera.h"
#include "shared_causes.h"

// Does σ cover what makes the corners of a photo share errors? One cause at a time, with known truth. Prints Markdown;
// exits 1 where a goal is missed.

namespace {

using namespace alidade;

constexpr ImageSize size{640, 480};
constexpr double noise_px = 0.1;
constexpr int photos = 13;

/// Errors in their stated σ.
struct Covered {
  double sum2 = 0.0, count = 0.0;
  std::array<double, 3> inside{};

  void add(double z) {
    sum2 += z * z;
    count += 1.0;
    for (std::size_t k = 0; k < 3; ++k) inside[k] += std::abs(z) < static_cast<double>(k + 1) ? 1.0 : 0.0;
  }
  [[nodiscard]] double percent(std::size_t k) const { return 100.0 * inside[k] / count; }
};

/// fx, fy, cx, cy; the distortion has another meaning where k3 is fixed.
Covered of_cause(const Cause& cause, int runs) {
  const Camera camera = *example_camera("brown", size.width_px, size.height_px);
  const Board board;
  Covered all;
  for (int run = 0; run < runs; ++run) {
    const auto seed = static_cast<std::uint64_t>(9000000 + run);
    std::mt19937_64 random(seed);
    BoardSceneConfig config;
    config.num_photos = photos;
    const BoardScene scene = draw_board_scene(camera, board, config, seed);
    auto views = simulate_views(scene, noise_px, seed);
    cause.spoil(scene, random, views);
    CalibrateConfig asked;
    asked.fixed = cause.fixed;
    asked.board_shape = BoardShape::flat;
    const auto report = calibrate(board, views, size, asked);
    if (report.status != CalibrateReport::Status::converged) continue;
    const Eigen::VectorXd error = params(report.camera.lens) - params(camera.lens);
    for (int at = 0; at < 4; ++at) all.add(error[at] / std::sqrt(report.camera.cov(at, at)));
  }
  return all;
}

}  // namespace

int main(int argc, char** argv) {
  const int runs = argc > 1 ? std::max(10, std::atoi(argv[1])) : 800;
  fmt::print(
      "# Causes of errors that a photo's corners share\n\n"
      "`study_shared {}` (`make study`): {} photos of a 9×6 board, 640×480, noise of {} px per coordinate, poses "
      "drawn\n"
      "for each calibration; fx, fy, cx and cy together. Goal: 90 to 98 % inside 2σ.\n\n"
      "| cause | size | σ / scatter | inside 1σ, % | 2σ, % | 3σ, % |\n|---|---|---|---|---|---|\n",
      runs, photos, noise_px);
  bool good = true;
  for (const Cause& cause : shared_causes()) {
    const Covered all = of_cause(cause, runs);
    const bool met = all.percent(1) >= 90.0 && all.percent(1) <= 98.0;
    fmt::print("| {} | {} | {:.3f} | {:.1f} | {:.1f}{} | {:.2f} |\n", cause.name, cause.size,
               std::sqrt(all.count / all.sum2), all.percent(0), all.percent(1), met ? "" : " (!)", all.percent(2));
    good = good && met;
  }
  fmt::print("\nGoals {}.\n", good ? "met" : "MISSED");
  return good ? 0 : 1;
}
