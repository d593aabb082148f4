// The path of a moving camera from observations of numbered points: 08_localize sights.csv camera.yaml target.yaml
#include <alidade/files.h>
#include <alidade/localize.h>

#include <cmath>
#include <cstdio>

int main(int argc, char** argv) {
  if (argc != 4) return std::puts("usage: 08_localize SIGHTS.csv CAMERA.yaml TARGET.yaml"), 2;
  const alidade::Camera camera = alidade::read_camera(argv[2]);
  const alidade::ObservationTable seen = alidade::read_observations(argv[1], {});
  alidade::LocalizeConfig config;
  config.target = alidade::read_target(argv[3]);

  // Incrementally, frame by frame …
  alidade::Localizer localizer(camera, config);
  for (const alidade::ObservationFrame& frame : seen.frames) {
    const alidade::PathStep& step = localizer.push(frame);
    if (!step.has_pose()) continue;
    const Eigen::Vector3d& at = step.world_from_cam.translation;
    const double sigma_m = std::sqrt(step.cov.topLeftCorner<3, 3>().trace());
    std::printf("%6.3f s: %.4f %.4f %.4f m ± %.2g\n", step.t_s, at.x(), at.y(), at.z(), 3.0 * sigma_m);
  }
  // … and at the end all together: the path is solved again from all observations.
  const alidade::Localization result = localizer.finish();
  std::puts(result.verdict.sentence.c_str());
  if (!result.verdict.ok()) return 1;
  alidade::save(alidade::outcome_of(result), "localized");
}
