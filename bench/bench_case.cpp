/// What the comparison with the peers needs besides times:
///   bench_case solve 9x6x20 FOLDER   solves the case in this process, prints time, peak memory and solution as JSON,
///                                    and writes corners.f64 (u v of every corner) and poses.f64 (rotation vector and
///                                    translation, camera from board, of every photo) for the peers
///   bench_case photos FOLDER         writes the photos that detection is timed on, and 13 photos to calibrate from
#include <fmt/format.h>

#include <ctime>
#include <filesystem>
#include <fstream>
#include <opencv2/imgcodecs.hpp>

#include "alidade/simulate/example_camera.h"
#include "bench_scenes.h"

namespace alidade::bench {
namespace {

double cpu_s() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

/// Peak memory of this program alone; getrusage would count the parent's before exec. 0 where it cannot be determined.
/// [kB]
long peak_kb() {
  std::ifstream status("/proc/self/status");
  for (std::string word; status >> word;) {
    long kb = 0;
    if (word == "VmHWM:" && status >> kb) return kb;
  }
  return 0;
}

void write_doubles(const std::filesystem::path& path, const std::vector<double>& values) {
  std::ofstream file(path, std::ios::binary);
  file.write(reinterpret_cast<const char*>(values.data()),
             static_cast<std::streamsize>(values.size() * sizeof(double)));
}

void write_for_peers(const Corners& corners, const CalibrateReport& report, const std::filesystem::path& folder) {
  std::vector<double> pixels, poses;
  for (const BoardView& view : corners.views) {
    for (const Corner& corner : view.corners) pixels.insert(pixels.end(), {corner.px.x(), corner.px.y()});
  }
  for (const ViewFit& view : report.views) {
    const Eigen::AngleAxisd turn(view.cam_from_board.rotation);
    const Eigen::Vector3d rotation = turn.angle() * turn.axis(), translation = view.cam_from_board.translation;
    poses.insert(poses.end(), rotation.begin(), rotation.end());
    poses.insert(poses.end(), translation.begin(), translation.end());
  }
  write_doubles(folder / "corners.f64", pixels);
  write_doubles(folder / "poses.f64", poses);
}

int solve(const SolveCase& solve_case, const std::filesystem::path& folder) {
  const Corners corners = draw_corners(solve_case);
  const long before_kb = peak_kb();
  const double start_s = cpu_s();
  const CalibrateReport report = calibrate(corners.board, corners.views, corners.size, {});
  const double seconds = cpu_s() - start_s;
  const long after_kb = peak_kb();
  if (report.status != CalibrateReport::Status::converged) {
    fmt::print(stderr, "bench_case: {}: {}\n", name_of(solve_case), report.reason);
    return 1;
  }
  std::filesystem::create_directories(folder);
  write_for_peers(corners, report, folder);
  const Eigen::VectorXd lens = params(report.camera.lens);
  fmt::print("{{\"cpu_s\": {}, \"peak_kb\": {}, \"peak_before_kb\": {}, \"rms_px\": {}, \"corners_used\": {}, ",
             seconds, after_kb, before_kb, report.rms_px, report.corners_used);
  fmt::print("\"width\": {}, \"height\": {}, \"square_m\": {}, ", corners.size.width_px, corners.size.height_px,
             corners.board.square_m);
  const auto names = param_names(report.camera.lens);
  for (std::size_t i = 0; i < names.size(); ++i) {
    fmt::print("\"{}\": {}{}", names[i], lens[static_cast<Eigen::Index>(i)], i + 1 < names.size() ? ", " : "}\n");
  }
  return 0;
}

int write_photos(const std::filesystem::path& folder) {
  std::filesystem::create_directories(folder);
  for (const unsigned seed : {1u, 2u, 3u, 4u, 5u}) {
    cv::imwrite(folder / fmt::format("board_{}.png", seed), vga_photo_with_board(seed));
  }
  cv::imwrite(folder / "no_board.png", megapixel_photo_without_board());
  BoardSceneConfig config;
  config.num_photos = 13;
  const BoardScene scene = draw_board_scene(*example_camera("brown", 640, 480), Board{}, config, 1);
  for (std::size_t i = 0; i < 13; ++i) {
    cv::imwrite(folder / fmt::format("set_{:02}.png", i + 1), render_board_photo(scene, i, RenderConfig{}, 1));
  }
  return 0;
}

}  // namespace
}  // namespace alidade::bench

int main(int argc, char** argv) {
  using namespace alidade::bench;
  const std::vector<std::string> arguments(argv + 1, argv + argc);
  if (arguments.size() == 3 && arguments[0] == "solve") {
    if (const auto solve_case = parse_case(arguments[1])) return solve(*solve_case, arguments[2]);
  }
  if (arguments.size() == 2 && arguments[0] == "photos") return write_photos(arguments[1]);
  fmt::print(stderr, "usage: bench_case solve COLSxROWSxPHOTOS FOLDER | bench_case photos FOLDER\n");
  return 2;
}
