#include <algorithm>
#include <memory>

#include "alidade/estimation/config_error.h"
#include "alidade/observe/rotation_frame.h"
#include "alidade/simulate/rotation.h"
#include "alidade/study/studies.h"
#include "alidade/study/trial_random.h"
#include "alidade/study/turning_adjustment.h"
#include "alidade/study/word_field.h"

namespace alidade {
namespace {

constexpr int image_width_px = 780, image_height_px = 582;
const Eigen::Vector4d true_intrinsics(710.0, 700.0, 390.0, 290.0);

/// What the trials of a set of points share: their pixels without noise, and what these allow.
struct RotationSetting {
  RotationLog exact;
  std::vector<Eigen::Vector2d> px;  ///< Row by row.
  Eigen::Vector4d bound = Eigen::Vector4d::Zero();
};

std::vector<Eigen::Quaterniond> rotations_of(const RotationLog& log) {
  MotionReader reader(log.source, 0.25);
  std::vector<Eigen::Quaterniond> rotations;
  for (const RotationRow& row : log.rows) rotations.push_back(reader.next(row).cam_from_start);
  return rotations;
}

RotationSetting rotation_setting(const ObserveStudy& study, std::uint64_t seed, std::uint64_t scene_number) {
  RotationScene scene;
  scene.width_px = image_width_px;
  scene.height_px = image_height_px;
  scene.motion = paper_rate;
  const std::uint64_t scene_seed = TrialRandom(seed, "observe scene", scene_number).seed();
  scene.start_px = draw_points(scene.width_px, scene.height_px, study.points, scene_seed);
  RotationLogConfig config;
  config.rate_hz = study.rate_hz;
  config.duration_s = (study.rows - 1) / study.rate_hz;
  config.sigma_px = 0.0;
  RotationSetting setting{simulate_rotation(scene, config, scene_seed), {}};
  for (const RotationRow& row : setting.exact.rows) setting.px.insert(setting.px.end(), row.px.begin(), row.px.end());
  TurningAdjustment adjustment(rotations_of(setting.exact), scene.start_px.size());
  setting.bound = adjustment.bound(setting.px, true_intrinsics, study.noise_px).diagonal().cwiseSqrt();
  return setting;
}

void add_noise(const ObserveStudy& study, std::uint64_t seed, std::uint64_t trial,
               std::span<const Eigen::Vector2d> exact, std::vector<Eigen::Vector2d>& px) {
  TrialRandom random(seed, ObserveStudy::name, trial);
  px.resize(exact.size());
  for (std::size_t i = 0; i < exact.size(); ++i) {
    const double u = random.normal(), v = random.normal();
    px[i] = exact[i] + study.noise_px * Eigen::Vector2d(u, v);
  }
}

RotationLog noisy_log(const ObserveStudy& study, const RotationSetting& setting, std::uint64_t seed,
                      std::uint64_t trial) {
  RotationLog log = setting.exact;
  std::vector<Eigen::Vector2d> px;
  add_noise(study, seed, trial, setting.px, px);
  const std::size_t n = log.num_points;
  for (std::size_t row = 0; row < log.rows.size(); ++row)
    std::copy_n(px.begin() + static_cast<std::ptrdiff_t>(row * n), n, log.rows[row].px.begin());
  return log;
}

ObserveConfig observe_config(const ObserveStudy& study) {
  ObserveConfig config;
  for (const Field& field : fields_of(config)) {
    if (field.name == "method") (void)set_field(field, study.method);
  }
  config.width_px = image_width_px;
  config.height_px = image_height_px;
  if (config.method != ObserveMethod::flow && config.method != ObserveMethod::fang2011) config.estimate = {"none"};
  return config;
}

void fill(const Eigen::Vector4d& found, const Eigen::Vector4d& sigma, const Eigen::Vector4d& bound,
          TrialResult& result) {
  result.has_estimate = true;
  for (int i = 0; i < 4; ++i) result.values.push_back({found[i] - true_intrinsics[i], sigma[i], bound[i]});
}

using RotationSettings = std::vector<RotationSetting>;

RunTrial lean_worker(const ObserveStudy& study, std::uint64_t seed, std::shared_ptr<const RotationSettings> settings) {
  auto adjustment = std::make_shared<TurningAdjustment>(rotations_of(settings->front().exact),
                                                        static_cast<std::size_t>(study.points));
  return [=, px = std::vector<Eigen::Vector2d>()](std::uint64_t trial, TrialResult& result) mutable {
    const RotationSetting& setting = (*settings)[trial % settings->size()];
    add_noise(study, seed, trial, setting.px, px);
    const Eigen::Vector4d start(image_width_px, image_width_px, 0.5 * image_width_px, 0.5 * image_height_px);
    const auto solution = adjustment->solve(px, start);
    result.state = solution.has_value ? State::good : State::not_converged;
    if (solution.has_value) fill(solution.k, solution.cov.diagonal().cwiseSqrt(), setting.bound, result);
  };
}

RunTrial whole_worker(const ObserveStudy& study, std::uint64_t seed, std::shared_ptr<const RotationSettings> settings) {
  return [=, config = observe_config(study)](std::uint64_t trial, TrialResult& result) {
    const RotationSetting& setting = (*settings)[trial % settings->size()];
    const ObserveReport report = observe(noisy_log(study, setting, seed, trial), config);
    result.state = report.verdict.state;
    if (report.quantities.size() < 4) return;
    Eigen::Vector4d found, sigma;
    for (std::size_t i = 0; i < 4; ++i) {
      found[static_cast<Eigen::Index>(i)] = report.quantities[i].value;
      sigma[static_cast<Eigen::Index>(i)] = report.quantities[i].sigma;
    }
    fill(found, sigma, setting.bound, result);
  };
}

}  // namespace

FieldList fields_of(ObserveStudy& study) {
  static const std::vector<std::string> methods{"batch", "hybrid", "window", "flow", "fang2011"};
  return {
      {.name = "method",
       .value = one_of(study.method, methods),
       .help = "batch: one adjustment of all rows, fast; hybrid, window, flow, fang2011: the whole observe command"},
      {.name = "rows", .value = &study.rows, .help = "Rows per log", .limits = {10, 100000}},
      {.name = "rate_hz", .value = &study.rate_hz, .help = "Rows per second", .limits = {1.0, 10000.0}},
      {.name = "points", .value = &study.points, .help = "Number of static points", .limits = {2, 5000}},
      {.name = "noise_px", .value = &study.noise_px, .help = "σ of a pixel coordinate [px]", .limits = {1e-6, 100.0}},
      {.name = "scenes",
       .value = &study.scenes,
       .help = "Number of point sets, used by the trials in turn",
       .limits = {1, 10000}}};
}

StudySetting setting_of(const ObserveStudy& study, std::uint64_t seed) {
  auto settings = std::make_shared<RotationSettings>();
  for (int scene = 0; scene < study.scenes; ++scene)
    settings->push_back(rotation_setting(study, seed, static_cast<std::uint64_t>(scene)));
  const auto worker = study.method == "batch" ? lean_worker : whole_worker;
  return {
      {{"fx", "px"}, {"fy", "px"}, {"cx", "px"}, {"cy", "px"}}, true, [=] { return worker(study, seed, settings); }};
}

ObserveTrial trial_of(const ObserveStudy& study, std::uint64_t seed, std::uint64_t trial) {
  const auto scene = trial % static_cast<std::uint64_t>(study.scenes);
  return {noisy_log(study, rotation_setting(study, seed, scene), seed, trial), observe_config(study)};
}

}  // namespace alidade
