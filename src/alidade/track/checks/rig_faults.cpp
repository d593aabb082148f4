#include "alidade/track/checks/rig_faults.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "alidade/estimation/median.h"
#include "alidade/geometry/decompositions.h"
#include "alidade/track/checks/path_equations.h"

namespace alidade {
namespace {

/// A tested parameter of a head.
struct Tested {
  std::string name;
  Eigen::VectorXd step;  ///< Change of the head's parameters per unit of it.
  double large = 1.0;    ///< Larger than any real error.
};

std::vector<Tested> tested_of(const RigHead& head) {
  constexpr double large_rad = 0.2, large_m = 0.3, large_scale = 0.1, large_px = 100.0, large_s = 0.1;
  const Eigen::VectorXd lens = params(head.camera.lens);
  const Eigen::Index clock = num_head_params + lens.size();
  const std::string prefix = "head" + std::to_string(head.head.id) + ".";
  std::vector<Tested> all;
  const auto add = [&](const std::string& name, Eigen::Index row, double large) {
    all.push_back({prefix + name, Eigen::VectorXd::Unit(clock + 1, row), large});
  };
  const auto add_own = [&](int row, double large) { add(head_param_names[static_cast<std::size_t>(row)], row, large); };
  for (const int axis : {0, 1}) add_own(pan_zero_param + axis, large_rad);
  for (const int axis : {0, 1}) add_own(pan_scale_param + axis, large_scale);
  for (const int axis : {0, 1, 2}) add_own(base_rotation_param + axis, large_rad);
  for (const int axis : {0, 1, 2}) add_own(base_param + axis, large_m);
  add("camera.f", num_head_params, large_scale * lens[0]);
  all.back().step[num_head_params + 1] = lens[1] / lens[0];
  add("camera.cx", num_head_params + 2, large_px);
  add("camera.cy", num_head_params + 3, large_px);
  add("clock_s", clock, large_s);
  return all;
}

/// Distance of each of a head's rays from the line between its neighbours [rad].
std::vector<double> off_line(std::span<const TargetObservation> observations, std::span<const std::size_t> own,
                             std::span<const Eigen::Vector3d> directions) {
  constexpr double max_apart_s = 0.3;
  std::vector<double> off(own.size(), 0.0);
  for (std::size_t k = 1; k + 1 < own.size(); ++k) {
    const double before_s = observations[own[k - 1]].t_capture_s, after_s = observations[own[k + 1]].t_capture_s;
    if (!(after_s > before_s) || after_s - before_s > max_apart_s) continue;
    const double share = (observations[own[k]].t_capture_s - before_s) / (after_s - before_s);
    off[k] = (directions[k] - (1.0 - share) * directions[k - 1] - share * directions[k + 1]).norm();
  }
  return off;
}

/// Removes false observations, judged by each head's own observations only, so that a fault of the rig rejects nothing.
/// Takes eight stretches of a long log.
std::vector<TargetObservation> in_line(std::span<const TargetObservation> observations,
                                       std::span<const RigHead> heads) {
  constexpr double max_sigma = 6.0;
  constexpr std::size_t max_observations = 4000, num_stretches = 8;
  std::vector<std::size_t> kept;
  for (std::size_t h = 0; h < heads.size(); ++h) {
    std::vector<std::size_t> own;
    std::vector<Eigen::Vector3d> directions;
    for (std::size_t i = 0; i < observations.size(); ++i) {
      if (observations[i].head != h) continue;
      const auto ray = ray_in_world(heads[h], observations[i]);
      if (!ray) continue;
      own.push_back(i);
      directions.push_back(ray->direction_in_world);
    }
    const std::vector<double> off = off_line(observations, own, directions);
    const double limit = max_sigma * median_of(off) / rayleigh_median;
    for (std::size_t k = 0; k < own.size(); ++k)
      if (off[k] <= limit) kept.push_back(own[k]);
  }
  std::ranges::sort(kept);
  const std::size_t length = max_observations / num_stretches;
  std::vector<TargetObservation> result;
  for (std::size_t i = 0; i < kept.size(); ++i) {
    const std::size_t stretch = i * num_stretches / kept.size(), begins = stretch * kept.size() / num_stretches;
    if (kept.size() <= max_observations || i < begins + length) result.push_back(observations[kept[i]]);
  }
  return result;
}

/// Variance of the noise over the stated one, from what neither the path nor the tested parameters explain. These are
/// limited to the size of real errors, as a huge scale would explain the noise of the readings itself.
double noise_factor(const PathEquations& given, const Eigen::MatrixXd& large) {
  const Eigen::MatrixXd weight = large.transpose() * given.information * large;
  const Eigen::VectorXd pull = large.transpose() * given.g;
  const Eigen::MatrixXd inverse = inverse_symmetric(weight + Eigen::MatrixXd::Identity(weight.rows(), weight.cols()));
  const double cost = given.cost - pull.dot(inverse * pull);
  const double expected = given.expected_cost - (inverse * weight).trace();
  return expected > 0.0 ? std::max(1.0, cost / expected) : 1.0;
}

/// Eliminates the errors that the rig file allows from the equations.
void eliminate_errors(const RigUncertainty& errors, PathEquations& given) {
  if (errors.num() == 0) return;
  Eigen::MatrixXd factor = Eigen::MatrixXd::Zero(given.g.size(), errors.num());
  Eigen::Index first = 0;
  for (const Eigen::MatrixXd& of_head : errors.factor) {
    factor.middleRows(first, of_head.rows()) = of_head;
    first += of_head.rows();
  }
  const Eigen::MatrixXd across = given.information * factor;
  const Eigen::MatrixXd inverse =
      inverse_symmetric(factor.transpose() * across + Eigen::MatrixXd::Identity(errors.num(), errors.num()));
  const Eigen::VectorXd pull = factor.transpose() * given.g;
  given.cost -= pull.dot(inverse * pull);
  given.g -= across * (inverse * pull);
  given.information -= across * inverse * across.transpose();
}

bool is_of_clock(const RigFault& fault) { return fault.name.ends_with("clock_s"); }

double ln_gain(const RigFault& fault) { return 0.5 * fault.z * fault.z; }
double refit_ln_gain(const RigFault& fault) { return 0.5 * fault.z_refit * fault.z_refit; }
double both_gains(const RigFault& fault) { return ln_gain(fault) + refit_ln_gain(fault); }

/// Of parameters with the same effect, the one that is tested first is named first.
void put_first(std::vector<RigFault>& faults, std::span<const std::string> order) {
  constexpr double same = 0.1;
  std::ranges::stable_sort(faults, std::ranges::greater{}, both_gains);
  if (faults.empty()) return;
  const auto rank = [&](const RigFault& fault) { return std::ranges::find(order, fault.name) - order.begin(); };
  const auto root = [](const RigFault& fault) { return std::sqrt(both_gains(fault)); };
  auto best = faults.begin();
  for (auto fault = faults.begin(); fault != faults.end() && root(faults.front()) - root(*fault) < same; ++fault)
    if (fault->head == faults.front().head && rank(*fault) < rank(*best)) best = fault;
  std::rotate(faults.begin(), best, best + 1);
}

/// All tested parameters, each with a column over all parameters, scaled to the largest real error.
struct AllTested {
  std::vector<RigFault> faults;  ///< `moved` per unit; `off` is the largest real error.
  std::vector<std::string> names;
  Eigen::MatrixXd large;

  AllTested(std::span<const RigHead> heads, Eigen::Index num_params) : large(num_params, 0) {
    Eigen::Index first = 0;
    for (std::size_t h = 0; h < heads.size(); ++h) {
      const std::vector<Tested> tested = tested_of(heads[h]);
      for (const Tested& each : tested) {
        large.conservativeResize(Eigen::NoChange, large.cols() + 1);
        large.rightCols<1>().setZero();
        large.rightCols<1>().middleRows(first, each.step.size()) = each.large * each.step;
        faults.push_back({.name = each.name, .off = each.large, .head = h, .moved = each.step});
        names.push_back(each.name);
      }
      first += tested.front().step.size();
    }
  }
};

/// Options of the equations: motion of the target for smoothing and for testing, and noise.
struct Making {
  TrackerConfig calm;
  double free_m_s2 = 0.0, noise = 1.0;

  explicit Making(const TrackerConfig& config) : calm(config) {
    // A wrong rig makes a target seem to manoeuvre more than any real one.
    constexpr double max_m_s2 = 3.0, freely = 10.0, min_free_m_s2 = 10.0;
    calm.sigma_a_m_s2 = std::min(max_m_s2, config.sigma_a_m_s2);
    free_m_s2 = std::max(min_free_m_s2, freely * calm.sigma_a_m_s2);
  }

  /// For noise as stated; none if the observations do not determine a path.
  [[nodiscard]] std::optional<PathEquations> raw(std::span<const TargetObservation> observations,
                                                 std::span<const RigHead> heads) const {
    const auto path = smooth_path(observations, heads, calm);
    if (!path) return std::nullopt;
    PathEquations given = path_equations(observations, heads, *path, calm, free_m_s2);
    if (!given.information.allFinite() || !given.g.allFinite()) return std::nullopt;
    return given;
  }

  /// For the actual noise, with the errors that the rig file allows eliminated.
  [[nodiscard]] PathEquations weighed(PathEquations given) const {
    given.information /= noise;
    given.g /= noise;
    given.cost /= noise;
    eliminate_errors(calm.errors, given);
    return given;
  }
};

/// The gain of the observations without the fault, by one more step from there: the parabola of the
/// score test may be too narrow for one parameter and too wide for another with nearly the same effect.
void refit(RigFault& fault, std::span<const TargetObservation> used, std::span<const RigHead> heads,
           const Making& making, double cost_before) {
  WithoutFault right = without_fault(used, heads, fault);
  std::ranges::stable_sort(right.observations, {}, &TargetObservation::t_capture_s);
  const auto raw = making.raw(right.observations, right.heads);
  if (!raw) return;
  const PathEquations given = making.weighed(*raw);
  Eigen::VectorXd direction = Eigen::VectorXd::Zero(given.g.size());
  Eigen::Index first = 0;
  for (std::size_t h = 0; h < fault.head; ++h) first += num_head_params + params(heads[h].camera.lens).size() + 1;
  direction.segment(first, fault.moved.size()) = fault.moved;
  const double weight = direction.dot(given.information * direction), pull = direction.dot(given.g);
  if (!(weight > 0.0)) return;
  const double more = pull / weight;  // share of `off`
  fault.z_refit = std::sqrt(std::max(0.0, cost_before - given.cost + pull * pull / weight));
  fault.off *= 1.0 + more;
  fault.moved *= 1.0 + more;
}

/// If a fault is significant, and parameters explain all but noise (for mirrored images none does), compares those that
/// explain about as much beyond the score test; not clocks, as their
/// shift changes the probability of the path itself.
void compare(std::vector<RigFault>& faults, std::span<const TargetObservation> used, std::span<const RigHead> heads,
             const Making& making, double cost_before) {
  constexpr double near = 20.0, significant = 3.5, max_noise = 1.5;
  constexpr std::size_t most = 8;
  if (faults.empty() || !(faults.front().z > significant) || !(making.noise < max_noise)) return;
  const double best = ln_gain(faults.front());
  for (std::size_t k = 0; k < std::min(most, faults.size()); ++k)
    if (!is_of_clock(faults[k]) && best - ln_gain(faults[k]) < near) refit(faults[k], used, heads, making, cost_before);
}

}  // namespace

RigTests rig_faults(std::span<const TargetObservation> observations, std::span<const RigHead> heads,
                    const TrackerConfig& config) {
  constexpr std::size_t min_observations = 16;
  constexpr double unobservable = 1e-7;
  const std::vector<TargetObservation> used = in_line(observations, heads);
  if (used.size() < min_observations) return {};
  Making making(config);
  const auto raw = making.raw(used, heads);
  if (!raw) return {};
  AllTested tested(heads, raw->g.size());
  making.noise = noise_factor(*raw, tested.large);
  const PathEquations given = making.weighed(*raw);
  RigTests tests;
  for (std::size_t k = 0; k < tested.faults.size(); ++k) {
    RigFault& fault = tested.faults[k];
    tests.power.push_back({.name = fault.name, .head = fault.head, .step = fault.moved, .largest = fault.off});
    const Eigen::VectorXd direction = tested.large.col(static_cast<Eigen::Index>(k));
    const double weight = direction.dot(given.information * direction), pull = direction.dot(given.g);
    const double share = pull / weight;  // share of the largest error
    const bool is_seen = weight > unobservable * direction.cwiseAbs2().dot(given.seen) / making.noise;
    if (is_seen) tests.power.back().z_per_unit = std::sqrt(weight) / fault.off;
    if (is_seen && std::abs(share) < 1.0) fault.z = std::abs(pull) / std::sqrt(weight);
    fault.z_refit = fault.z;
    fault.off *= share;
    fault.moved *= fault.off;
  }
  std::erase_if(tested.faults, [](const RigFault& fault) { return !(fault.z > 0.0); });
  std::ranges::stable_sort(tested.faults, std::ranges::greater{}, &RigFault::z);
  compare(tested.faults, used, heads, making, given.cost);
  put_first(tested.faults, tested.names);
  tests.faults = std::move(tested.faults);
  return tests;
}

bool is_alike(const RigFault& first, const RigFault& fault) {
  constexpr double clear = 3.0;
  return ln_gain(first) - ln_gain(fault) < clear || refit_ln_gain(first) - refit_ln_gain(fault) < clear;
}

std::vector<RigFault> alike_per_head(const TrackReport& report) {
  std::vector<RigFault> alike;
  if (report.faults.empty() || !(report.faults.front().z > max_fault_z(report))) return alike;
  for (const RigFault& fault : report.faults)
    if (is_alike(report.faults.front(), fault) && std::ranges::count(alike, fault.head, &RigFault::head) == 0)
      alike.push_back(fault);
  return alike;
}

std::vector<RigFault> rivals_of_clocks(const TrackReport& report) {
  constexpr double min_z = 3.0;
  std::vector<RigFault> rivals;
  for (const RigFault& fault : report.faults)
    if (fault.z > min_z && !is_of_clock(fault) && std::ranges::count(rivals, fault.head, &RigFault::head) == 0)
      rivals.push_back(fault);
  return rivals;
}

bool is_explained_by_fault(const TrackReport& report) {
  return report.fits_without_fault && !is_of_clock(report.faults.front());
}

WithoutFault without_fault(std::span<const TargetObservation> observations, std::span<const RigHead> heads,
                           const RigFault& fault) {
  WithoutFault result{{heads.begin(), heads.end()}, {observations.begin(), observations.end()}};
  RigHead& head = result.heads[fault.head];
  const Eigen::Index num_lens = fault.moved.size() - num_head_params - 1;
  head.head = retract(head.head, fault.moved.head<num_head_params>());
  head.camera.lens =
      with_params(head.camera.lens, params(head.camera.lens) + fault.moved.segment(num_head_params, num_lens));
  for (TargetObservation& observation : result.observations)
    if (observation.head == fault.head) observation.t_capture_s += fault.moved[num_head_params + num_lens];
  return result;
}

void heed_faults(std::span<const TargetObservation> observations, std::span<const RigHead> heads,
                 const FollowConfig& config, TrackReport& report) {
  constexpr double min_used = 0.95, max_nis = 1.5;
  FollowConfig plain = config;
  plain.judge = plain.find_sigma_a = false;
  std::vector<TrackReport> others;
  for (const RigFault& fault : alike_per_head(report)) {
    const WithoutFault right = without_fault(observations, heads, fault);
    others.push_back(track_target(right.observations, right.heads, plain));
    const TrackReport& other = others.back();
    if (others.size() == 1)
      report.fits_without_fault =
          static_cast<double>(other.num_used) > min_used * static_cast<double>(other.steps.size()) &&
          other.nis_per_dof < max_nis && other.num_restarts == 0;
  }
  const auto widen = [&others](auto of, Belief<6>& belief, std::size_t i) {
    Eigen::Vector<double, 6> moved = Eigen::Vector<double, 6>::Zero();
    for (const TrackReport& other : others) {
      if (i >= of(other).size() || !of(other)[i].has_belief) continue;
      const Eigen::Vector<double, 6> by = of(other)[i].belief.x - belief.x;
      if (by.head<3>().norm() > moved.head<3>().norm()) moved = by;
    }
    belief.P += moved * moved.transpose();
  };
  for (std::size_t i = 0; i < report.steps.size(); ++i)
    if (report.steps[i].has_belief)
      widen(
          [](const TrackReport& of) -> const auto& { return of.steps; }, report.steps[i].belief, i);
  for (std::size_t i = 0; i < report.ahead.size(); ++i)
    if (report.ahead[i].has_belief)
      widen(
          [](const TrackReport& of) -> const auto& { return of.ahead; }, report.ahead[i].belief, i);
  for (std::size_t i = 0; i < report.smoothed.size(); ++i)
    if (report.smoothed[i].has_belief)
      widen(
          [](const TrackReport& of) -> const auto& { return of.smoothed; }, report.smoothed[i].belief, i);
}

std::string fault_text(const TrackReport& report) {
  constexpr std::size_t max_named = 4;
  const RigFault& first = report.faults.front();
  std::string text = "the observations say that " + first.name + " is off by " + text_of(std::abs(first.off), 2) +
                     " (" + text_of(first.z, 2) + "σ of " +
                     (report.errors_are_counted ? "what the rig file allows)" : "chance)");
  std::size_t num = 0;
  for (std::size_t k = 1; k < report.faults.size(); ++k) {
    if (!is_alike(first, report.faults[k]) || ++num > max_named) continue;
    text += (num == 1 ? ", which cannot be distinguished from " : ", ") + report.faults[k].name;
  }
  if (num > max_named) text += " and " + std::to_string(num - max_named) + " more";
  return text;
}

std::string fault_remedy(const TrackReport& report, std::span<const RigHead> heads) {
  std::string names;
  bool may_be_clock = false;
  for (const RigFault& fault : alike_per_head(report)) {
    names += (names.empty() ? "" : " or ") + std::to_string(heads[fault.head].head.id);
    may_be_clock |= is_of_clock(fault);
  }
  return "calibrate head " + names + " again as it stands now (alidade rig)" +
         (may_be_clock ? ", and check its clock" : "");
}

}  // namespace alidade
