// Pixels and points of a rangefinder's readings, with their covariance: 09_project rangefinder.yaml
// camera.yaml 2.31
#include <alidade/files.h>
#include <alidade/project.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>

int main(int argc, char** argv) {
  if (argc < 4) return std::puts("usage: 09_project RANGEFINDER.yaml CAMERA.yaml RANGE..."), 2;
  const alidade::Beam beam = alidade::read_beam(argv[1]).beam;
  const alidade::Camera camera = alidade::read_camera(argv[2]);
  std::vector<double> ranges_m;
  for (int i = 3; i < argc; ++i) ranges_m.push_back(std::atof(argv[i]));
  const auto result = alidade::project_readings(beam, camera, ranges_m);
  std::puts(result.verdict.sentence.c_str());
  for (const alidade::ProjectedReading& reading : result.readings) {
    const Eigen::Vector3d& at = reading.point.point_in_cam;
    std::printf("%.3f m is at (%.4f, %.4f, %.4f) m, σ %.2g m", reading.range_m, at.x(), at.y(), at.z(),
                std::sqrt(reading.point.cov.trace()));
    if (reading.pixel) std::printf(", pixel (%.2f, %.2f)", reading.pixel->px.x(), reading.pixel->px.y());
    std::puts(reading.pixel ? "" : ", which the camera does not see");
  }
}
