#include <cmath>
#include <memory>

#include "alidade/calibrate.h"
#include "alidade/calibrate/solve/bundle.h"
#include "alidade/estimation/config_error.h"
#include "alidade/simulate/example_camera.h"
#include "alidade/study/sigma_map_trials.h"
#include "alidade/study/studies.h"
#include "alidade/study/trial_random.h"
#include "alidade/study/word_field.h"

namespace alidade {
namespace {

constexpr ImageSize photo_size{640, 480};

Camera true_camera(const CalibrateStudy& study) {
  return *example_camera(study.model, photo_size.width_px, photo_size.height_px);
}

/// All of the lens but the skew, which is not estimated.
std::vector<int> free_parameters(const Camera& camera) {
  std::vector<int> free;
  const auto names = param_names(camera.lens);
  for (std::size_t i = 0; i < names.size(); ++i)
    if (names[i] != "skew") free.push_back(static_cast<int>(i));
  return free;
}

/// Covariance of the free parameters by the Cramér–Rao bound, poses eliminated.
Eigen::MatrixXd bound_of(const BoardScene& scene, const std::vector<int>& free, double noise_px) {
  std::vector<ViewArrays> arrays;
  for (const BoardView& view : simulate_views(scene, 0.0, 1)) arrays.push_back(make_arrays(view));
  BundleProblem problem;
  problem.views = arrays;
  problem.free_lens = free;
  const Eigen::Index num = params(scene.camera.lens).size();
  problem.prior_value = Eigen::VectorXd::Zero(num);
  problem.prior_information = Eigen::VectorXd::Zero(num);
  problem.printed_points = scene.points_in_board;
  const BundleState truth{scene.camera.lens, scene.cam_from_board, scene.points_in_board};
  const BundleResult at_truth = with_covariance(solve_bundle(problem, truth, {.max_iterations = 5}));
  if (at_truth.cov.rows() < static_cast<Eigen::Index>(free.size()))
    throw ConfigError("so few photos do not determine the camera: more --photos");
  const auto size = static_cast<Eigen::Index>(free.size());
  return noise_px * noise_px * at_truth.cov.topLeftCorner(size, size);
}

BoardScene board_scene(const CalibrateStudy& study, std::uint64_t seed, std::uint64_t number) {
  BoardSceneConfig config;
  config.num_photos = study.photos;
  return draw_board_scene(true_camera(study), Board{}, config, TrialRandom(seed, "calibrate scene", number).seed());
}

std::vector<BoardView> noisy_views(const CalibrateStudy& study, const BoardScene& scene, std::uint64_t seed,
                                   std::uint64_t trial) {
  const std::uint64_t own = TrialRandom(seed, CalibrateStudy::name, trial).seed();
  auto views = simulate_views(scene, study.noise_px, own);
  if (study.shared_px > 0.0) add_shared_errors(scene, study.shared_px, own, views);
  return views;
}

/// What the trials of a set of poses share.
struct BoardSetting {
  BoardScene scene;
  Eigen::VectorXd bound;  ///< σ of the free parameters.
  std::optional<SigmaMapTrials> map;
};

BoardSetting board_setting(const CalibrateStudy& study, const std::vector<int>& free, std::uint64_t seed,
                           std::uint64_t number) {
  BoardSetting setting{board_scene(study, seed, number), {}, {}};
  const Eigen::MatrixXd bound = bound_of(setting.scene, free, study.noise_px);
  setting.bound = bound.diagonal().cwiseSqrt();
  if (study.sigma_map) setting.map.emplace(setting.scene.camera, free, bound);
  return setting;
}

CalibrateConfig config_of(const CalibrateStudy& study) {
  CalibrateConfig config;
  config.model = study.model;
  config.board_shape = study.board_shape;
  return config;
}

void fill(const Camera& found, const BoardSetting& own, const std::vector<int>& free, TrialResult& result) {
  const Eigen::VectorXd error = params(found.lens) - params(own.scene.camera.lens);
  for (std::size_t i = 0; i < free.size(); ++i)
    result.values.push_back(
        {error[free[i]], std::sqrt(found.cov(free[i], free[i])), own.bound[static_cast<Eigen::Index>(i)]});
  if (own.map) own.map->add(found, result.values);
}

/// The number of the set of poses that a trial has.
std::uint64_t scene_of(const CalibrateStudy& study, std::uint64_t trial) {
  return study.scenes == 0 ? trial : trial % static_cast<std::uint64_t>(study.scenes);
}

State state_of(CalibrateReport::Status status) {
  if (status == CalibrateReport::Status::converged) return State::good;
  return status == CalibrateReport::Status::degenerate ? State::refused : State::not_converged;
}

}  // namespace

FieldList fields_of(CalibrateStudy& study) {
  static const std::vector<std::string> models{"pinhole", "brown", "kannala_brandt"};
  return {{.name = "photos",
           .value = &study.photos,
           .help = "Number of photos, 640x480, of a 9x6 board",
           .limits = {3, 1000}},
          {.name = "noise_px",
           .value = &study.noise_px,
           .help = "σ of a corner's coordinate [px]",
           .limits = {1e-6, 100.0}},
          {.name = "shared_px",
           .value = &study.shared_px,
           .help = "σ of each term of a smooth error field shared by the corners of a photo [px]",
           .limits = {0.0, 100.0}},
          {.name = "model", .value = one_of(study.model, models), .help = "Lens model"},
          {.name = "board_shape",
           .value = words_code(study.board_shape, shape_words()),
           .help = "Board shape as estimated; the simulated board is flat"},
          {.name = "scenes",
           .value = &study.scenes,
           .help = "Number of pose sets, used by the trials in turn; 0: each trial its own",
           .limits = {0, 10000}},
          {.name = "sigma_map",
           .value = &study.sigma_map,
           .help = "Also the error of the σ map at 5 x 4 pixels, after the implied rotation"},
          {.name = "judge",
           .value = &study.judge,
           .help = "Run the whole command with its verdict, not the solver alone; several times slower"}};
}

StudySetting setting_of(const CalibrateStudy& study, std::uint64_t seed) {
  const Camera truth = true_camera(study);
  const std::vector<int> free = free_parameters(truth);
  auto settings = std::make_shared<std::vector<BoardSetting>>();
  for (int i = 0; i < study.scenes; ++i)
    settings->push_back(board_setting(study, free, seed, static_cast<std::uint64_t>(i)));
  StudySetting setting;
  const auto names = param_names(truth.lens);
  for (const int at : free) setting.quantities.push_back({names[static_cast<std::size_t>(at)], at < 4 ? "px" : "1"});
  if (study.sigma_map)
    for (TrialQuantity& quantity : SigmaMapTrials::quantities()) setting.quantities.push_back(std::move(quantity));
  setting.has_bound = true;
  setting.make_worker = [=]() -> RunTrial {
    return [=](std::uint64_t trial, TrialResult& result) {
      std::optional<BoardSetting> drawn;
      if (study.scenes == 0) drawn = board_setting(study, free, seed, trial);
      const BoardSetting& own = drawn ? *drawn : (*settings)[scene_of(study, trial)];
      const auto views = noisy_views(study, own.scene, seed, trial);
      const CalibrateConfig config = config_of(study);
      const auto take = [&](const CalibrateReport& report) {
        result.has_estimate = report.status == CalibrateReport::Status::converged;
        if (result.has_estimate) fill(report.camera, own, free, result);
      };
      if (study.judge) {
        const Calibration calibration = calibrate(views, photo_size, own.scene.board, config);
        result.state = calibration.verdict.state;
        take(calibration);
      } else {
        const CalibrateReport report = calibrate(own.scene.board, views, photo_size, config);
        result.state = state_of(report.status);
        take(report);
      }
    };
  };
  return setting;
}

CalibrateTrial trial_of(const CalibrateStudy& study, std::uint64_t seed, std::uint64_t trial) {
  const BoardScene scene = board_scene(study, seed, scene_of(study, trial));
  return {noisy_views(study, scene, seed, trial), scene.board, photo_size, scene.camera};
}

}  // namespace alidade
