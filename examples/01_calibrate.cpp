// A camera from photos of a board, in a file that OpenCV reads: 01_calibrate photos camera.yml
#include <alidade/calibrate.h>
#include <alidade/files.h>

#include <cmath>
#include <cstdio>

int main(int argc, char** argv) {
  if (argc != 3) return std::puts("usage: 01_calibrate PHOTOS CAMERA.yml"), 2;
  const auto result = alidade::calibrate(alidade::photos_in(argv[1]), {.cols = 9, .rows = 6, .square_m = 0.025});
  std::puts(result.verdict.sentence.c_str());
  if (!result.verdict.ok()) return 1;
  const auto names = alidade::param_names(result.camera.lens);
  const Eigen::VectorXd values = alidade::params(result.camera.lens);
  for (Eigen::Index i = 0; i < values.size(); ++i) {
    const double sigma = std::sqrt(result.camera.cov(i, i));
    std::printf("%-4s %12.6g ± %.2g\n", names[static_cast<std::size_t>(i)].c_str(), values[i], 3.0 * sigma);
  }
  for (const auto& photo : result.counts.skipped)
    std::printf("not used: %s: %s\n", photo.file.c_str(), photo.reason.c_str());
  alidade::write_camera(argv[2], result.camera, alidade::CameraFormat::opencv, /*lossy=*/true);
}
