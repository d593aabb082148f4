// The beam of a rangefinder from its shots and their corners: 06_rangefinder shots.csv camera.yaml corners.csv result
#include <alidade/files.h>
#include <alidade/rangefinder.h>

#include <cmath>
#include <cstdio>

int main(int argc, char** argv) {
  if (argc != 5) return std::puts("usage: 06_rangefinder SHOTS.csv CAMERA.yaml CORNERS.csv RESULT"), 2;
  alidade::RangefinderConfig config;
  config.board = {.cols = 9, .rows = 6, .square_m = 0.04};
  auto table = alidade::read_shots(argv[1]);
  const auto corners = alidade::read_corners(argv[3], alidade::num_points(*config.board));
  for (const auto& photo : alidade::add_corners(argv[3], corners, table.shots))
    std::printf("not used: %s: %s\n", photo.file.c_str(), photo.reason.c_str());
  const auto result = alidade::rangefinder(table.shots, alidade::read_camera(argv[2]), config);
  std::puts(result.verdict.sentence.c_str());
  if (!result.verdict.ok()) return 1;
  for (std::size_t i = 0; i < result.parameter_names.size(); ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    std::printf("%-12s σ %.2g\n", result.parameter_names[i].c_str(), std::sqrt(result.covariance(k, k)));
  }
  // The point of a reading of 2 m, with its covariance.
  const alidade::BeamPoint point = alidade::measured_point(result.beam, 2.0);
  std::printf("2 m is at (%.4f, %.4f, %.4f) m, σ %.2g m\n", point.point_in_cam.x(), point.point_in_cam.y(),
              point.point_in_cam.z(), std::sqrt(point.cov.trace()));
  alidade::save(alidade::outcome_of(result), argv[4]);
}
