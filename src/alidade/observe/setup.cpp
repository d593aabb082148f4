#include "alidade/observe/setup.h"

#include <algorithm>
#include <cmath>

#include "alidade/camera/camera_fault.h"
#include "alidade/estimation/config_error.h"
#include "alidade/observe/solve/solve.h"

namespace alidade {
namespace {

using Faults = std::vector<std::string>;

void take_word(const std::string& word, ObserveSetup& setup, Faults& faults) {
  if (word == "none") return;
  if (word == "auto") {
    setup.estimate_auto = true;
  } else if (const auto nuisance = nuisance_of(word)) {
    setup.nuisances.*nuisance = true;
  } else if (const auto causes = rotation_causes_of(word); !causes.empty()) {
    setup.estimate_errors.insert(setup.estimate_errors.end(), causes.begin(), causes.end());
  } else {
    faults.push_back("--estimate: '" + word +
                     "' is not auto, none, k1, k2, k3, p1, p2, mount, delay, lever, shutter, focal-drift, scale, "
                     "backlash, curve, axes, drift, bias or clock");
  }
}

/// Checks words and vectors in the same way as the command line does.
void check_codes(const FieldList& fields, Faults& faults) {
  for (const Field& field : fields) {
    const auto* code = std::get_if<TextCode>(&field.value);
    if (code == nullptr) continue;
    const std::string text = code->write();
    if (text.empty() && code->words.empty()) continue;
    if (const std::string fault = code->read(text); !fault.empty()) faults.push_back(option_of(field) + ": " + fault);
  }
}

std::string camera_fault(const Camera& camera) {
  return is_central(camera.lens) ? fault(camera) : "the camera has no single viewpoint: give a central one";
}

/// σ of k1 of a lens with covariance; none if not given. A lens without k1 was calibrated with k1 = 0: σ is 0.
std::optional<double> sigma_of_k1(const Camera& camera) {
  if (camera.cov.size() == 0) return std::nullopt;
  const auto names = param_names(camera.lens);
  const auto at = std::find(names.begin(), names.end(), "k1");
  if (at == names.end()) return 0.0;
  const auto i = at - names.begin();
  return std::sqrt(std::max(camera.cov(i, i), 0.0));
}

void take_camera(const Camera& camera, ObserveSetup& setup) {
  const ObserveNuisances& asked = setup.nuisances;
  if (!setup.start) setup.start = params(camera.lens).head<4>();
  setup.lens_is_given = !(asked.k1 || asked.k2 || asked.k3 || asked.tangential);
  setup.sigma_k1 = sigma_of_k1(camera);
}

/// Regressions estimate only fx, fy, cx, cy, from a known rotation.
void take_method(ObserveSetup& setup, Faults& faults) {
  const bool is_regression = setup.method == ObserveMethod::flow || setup.method == ObserveMethod::fang2011;
  const bool asks = CommonLayout(setup.nuisances).size > 4 || setup.estimate_auto || !setup.estimate_errors.empty();
  setup.estimate_auto = setup.estimate_auto || (setup.estimate.empty() && !is_regression);
  if (is_regression && (asks || setup.rotation != RotationKnowledge::known)) {
    faults.push_back(std::string("--method ") + (setup.method == ObserveMethod::flow ? "flow" : "fang2011") +
                     " knows neither --estimate nor a rotation that is not known");
  }
}

void check_numbers(ObserveSetup& setup, Faults& faults) {
  ObserveConfig& config = setup;
  const FieldList fields = fields_of(config);
  faults = faults_of(fields);
  check_codes(fields, faults);
  if (setup.width_px < 0 || setup.height_px < 0 || (setup.width_px == 0) != (setup.height_px == 0)) {
    faults.emplace_back("--size: width and height go together");
  }
  if (!(setup.max_gap_s > 0.0) || !std::isfinite(setup.max_gap_s)) faults.emplace_back("max_gap_s is not above 0");
}

bool is_within_reach(const Eigen::Vector2d& px) {
  constexpr double max_px = 1e6;  // the limit of the file reader
  return !is_seen(px) || px.cwiseAbs().maxCoeff() <= max_px;
}

}  // namespace

ObserveSetup setup_of(const ObserveConfig& config) {
  ObserveSetup setup;
  static_cast<ObserveConfig&>(setup) = config;
  Faults faults;
  check_numbers(setup, faults);
  for (const std::string& word : config.estimate) take_word(word, setup, faults);
  if (config.estimate.size() > 1 && std::ranges::count(config.estimate, "none") > 0) {
    faults.emplace_back("--estimate: none goes with no other word");
  }
  const std::string of_camera = config.camera ? camera_fault(*config.camera) : "";
  if (!of_camera.empty()) faults.push_back(of_camera);
  if (config.camera && of_camera.empty()) take_camera(*config.camera, setup);
  if (setup.start && !(setup.start->head<2>().minCoeff() > 0.0)) {
    faults.emplace_back("--start: the focal lengths must be above zero");
  }
  std::tie(setup.width_px, setup.height_px) = given_size(config);
  take_method(setup, faults);
  std::string sentence;
  for (const std::string& each : faults) sentence += (sentence.empty() ? "" : "; ") + each;
  if (!sentence.empty()) throw ConfigError(sentence);
  return setup;
}

void check_row(const RotationRow& row, std::size_t number, const RotationLog& layout, double not_before_s) {
  const auto refuse = [&](const std::string& what) {
    throw ConfigError("row " + std::to_string(number) + " of the log: " + what);
  };
  constexpr double largest_s = 1e12;
  if (!(std::abs(row.t_s) <= largest_s)) refuse("its time is not a finite number within 1e12 s");
  if (row.t_s < not_before_s) refuse("time must not go back");
  if (row.px.size() != layout.num_points) {
    refuse("has " + std::to_string(row.px.size()) + " pixels, but the log has " + std::to_string(layout.num_points) +
           " points");
  }
  if (!std::ranges::all_of(row.px, is_within_reach)) refuse("a pixel is beyond 1e6");
  const double norm = row.base_from_cam.norm();
  constexpr double max_off = 1e-3;
  const bool is_attitude = norm == 0.0 || std::abs(norm - 1.0) <= max_off;
  if (layout.source == RotationSource::attitude && !is_attitude) refuse("its quaternion is not of length 1");
  if (!row.velocity_m_per_s.allFinite()) refuse("its velocity is not finite");
  const auto is_huge = [](const Eigen::Vector3d& v) {
    return v.array().isInf().any() || (v.array().abs() > 1e6).any();
  };
  if (is_huge(row.rate_rad_per_s) || is_huge(row.pan_tilt_roll_rad)) refuse("its rotation is not a finite number");
}

void check_log(const RotationLog& log) {
  double last_s = -std::numeric_limits<double>::infinity();
  for (std::size_t k = 0; k < log.rows.size(); ++k) {
    check_row(log.rows[k], k, log, last_s);
    last_s = log.rows[k].t_s;
  }
  if (!log.truth.empty() && log.truth.size() != log.rows.size())
    throw ConfigError("the log's truth is not of every row");
  if (!std::ranges::all_of(log.truth, [](const TrueIntrinsics& one) {
        return std::ranges::all_of(one, [](double value) { return std::isfinite(value); });
      }))
    throw ConfigError("the log's truth is not finite");
  if (log.num_points > 0 && log.range_point >= log.num_points) throw ConfigError("the log's range is of no point");
  for (const std::optional<double>& sigma : {log.sigma_scale, log.sigma_parallax}) {
    if (sigma && !(*sigma >= 0.0 && *sigma <= 1.0)) throw ConfigError("a σ that the log states is not within 0 to 1");
  }
}

void check_rotation_words(const ObserveSetup& setup, const RotationLog& log) {
  for (const std::string& word : setup.estimate) {
    ObserveSetup one = setup;
    one.estimate_errors = rotation_causes_of(word);
    if (one.estimate_errors.empty()) continue;
    if (setup.rotation == RotationKnowledge::free) {
      throw ConfigError("--estimate " + word + ": is for a rotation that is measured");
    }
    if (!estimated_errors(log, one).empty()) continue;
    one.sigma_scale = 1.0;
    const bool is_exact = !estimated_errors(log, one).empty();
    throw ConfigError("--estimate " + word +
                      (is_exact ? ": the scale is given as exact: give --sigma-encoder-scale"
                                : ": the rotation of this log has no such error"));
  }
}

}  // namespace alidade
