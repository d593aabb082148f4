// Two pan-tilt heads from views of boards: 07_rig views.csv left.yaml right.yaml rig.yaml
#include <alidade/files.h>
#include <alidade/rig.h>

#include <cmath>
#include <cstdio>

int main(int argc, char** argv) {
  if (argc != 5) return std::puts("usage: 07_rig VIEWS.csv LEFT.yaml RIGHT.yaml RIG.yaml"), 2;
  alidade::RigConfig config;
  config.board = {.cols = 9, .rows = 6, .square_m = 0.025};
  config.sigma_square_m = 1e-6;  // measured
  const auto table = alidade::read_views(argv[1], {.num_points = alidade::num_points(*config.board)});
  const auto cameras = alidade::read_cameras_by_head({argv[2], argv[3]}, alidade::heads_of(table.views), argv[1]);
  const auto result = alidade::rig(table.views, cameras, config);
  std::puts(result.verdict.sentence.c_str());
  if (!result.verdict.ok()) return 1;
  for (std::size_t i = 0; i < result.parameter_names.size(); ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    const double sigma = std::sqrt(result.covariance(k, k));
    if (sigma > 0.0) std::printf("%-24s σ %.2g\n", result.parameter_names[i].c_str(), sigma);
  }
  // The second camera's pose when its head has rotated.
  const alidade::Rigid3 world_from_cam = alidade::world_from_cam(result.rig.heads[1].head, {0.2, -0.1});
  std::printf("camera 2 at (%.4f, %.4f, %.4f) m\n", world_from_cam.translation.x(), world_from_cam.translation.y(),
              world_from_cam.translation.z());
  alidade::write_file(argv[4], alidade::rig_text(result.rig));
}
