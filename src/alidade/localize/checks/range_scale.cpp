#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "alidade/estimation/median.h"
#include "alidade/geometry/decompositions.h"
#include "alidade/localize/checks/beam_scales.h"
#include "alidade/localize/checks/scale_readings.h"

// A rangefinder's scale: where its beam meets the surface of the map's points.

namespace alidade {

namespace {

/// Keeps those on surfaces as smooth as most: at an edge the six nearest points are on two surfaces.
void reject_rough(std::vector<BeamScale>& scales) {
  constexpr double rougher = 3.0, smooth = 0.001;
  std::vector<double> sizes;
  for (const BeamScale& each : scales) sizes.push_back(each.roughness);
  const double limit = rougher * std::max(smooth, median_of(std::move(sizes)));
  std::erase_if(scales, [&](const BeamScale& each) { return each.roughness > limit; });
}

/// Keeps those near their median.
void reject_far(std::vector<BeamScale>& scales) {
  constexpr double far = 4.0;  // of their robust σ
  std::vector<double> logs, sizes;
  for (const BeamScale& each : scales) logs.push_back(each.log_scale);
  const double median = median_of(logs);
  for (const double log : logs) sizes.push_back(std::abs(log - median));
  const double limit = far * normal_from_mad * median_of(std::move(sizes));
  std::erase_if(scales, [&](const BeamScale& each) { return std::abs(each.log_scale - median) > limit; });
}

/// ln of the scale, with σ from the scatter of blocks.
struct MeanScale {
  double log_scale = 0.0, sigma = 0.0;
};

/// The scales in order of the met positions: the surface's shape is the same whenever the beam returns.
std::vector<BeamScale> by_place(std::span<const BeamScale> scales) {
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (const BeamScale& each : scales) middle += each.met_in_world / static_cast<double>(scales.size());
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  for (const BeamScale& each : scales)
    scatter += (each.met_in_world - middle) * (each.met_in_world - middle).transpose();
  const Eigen::Vector3d along = symmetric_eigen3(scatter).vectors.col(2);
  std::vector<BeamScale> ordered(scales.begin(), scales.end());
  std::ranges::stable_sort(ordered, {}, [&](const BeamScale& each) { return along.dot(each.met_in_world); });
  return ordered;
}

MeanScale mean_of_blocks(std::span<const BeamScale> scales) {
  double sum = 0.0, squares = 0.0;
  for (std::size_t i = 0; i < num_blocks; ++i) {
    const std::size_t begin = i * scales.size() / num_blocks, end = (i + 1) * scales.size() / num_blocks;
    double of_block = 0.0;
    for (std::size_t k = begin; k < end; ++k) of_block += scales[k].log_scale / static_cast<double>(end - begin);
    sum += of_block;
    squares += of_block * of_block;
  }
  const double num = static_cast<double>(num_blocks), mean = sum / num;
  return {mean, std::sqrt(std::max(squares / num - mean * mean, 0.0) / (num - 1.0))};
}

constexpr double instrument_m = 0.1;  ///< Offset of readings that are measured from the other end of the instrument.

/// A systematic error of the beam or its readings: scale_i = S + x_i · by, with x proportional to the effect on the
/// scale of a reading.
struct BeamFault {
  Eigen::Index num = 1;  ///< Number of parameters.
  Eigen::VectorXd (*x_of)(const BeamScale&);
  double clear, half_clear;  ///< Of T² with nine degrees of freedom: p as for 3.5σ and 2σ of a normal distribution.
  double ordinary;           ///< σ if present. [m, rad, s]
  bool is_length = false;    ///< As the shape of a surface is, which is the same from near and far.
};
/// All readings are too long by the same length.
const BeamFault offset_fault{1,
                             [](const BeamScale& each) { return Eigen::VectorXd::Constant(1, each.of_offset).eval(); },
                             28.6,
                             5.4,
                             instrument_m,
                             true};
/// The beam points elsewhere.
const BeamFault direction_fault{2, [](const BeamScale& each) -> Eigen::VectorXd { return each.of_direction; }, 52.3,
                                10.5, 0.1};
/// The readings' clock is late.
const BeamFault clock_fault{1, [](const BeamScale& each) { return Eigen::VectorXd::Constant(1, each.of_time).eval(); },
                            28.6, 5.4, 0.1};

struct FaultFit {
  double scale = 1.0, left2 = 0.0;   ///< Sum of squared residuals.
  Eigen::VectorXd by, mean, spread;  ///< Estimate; mean and standard deviation of x.
};

std::optional<FaultFit> fault_fit(const BeamFault& fault, std::span<const BeamScale> scales, std::size_t but_begin,
                                  std::size_t but_end) {
  const Eigen::Index size = fault.num + 1;
  Eigen::MatrixXd H = Eigen::MatrixXd::Zero(size, size);
  Eigen::VectorXd g = Eigen::VectorXd::Zero(size), row = Eigen::VectorXd::Ones(size);
  double squares = 0.0;
  for (std::size_t i = 0; i < scales.size(); ++i) {
    if (i >= but_begin && i < but_end) continue;
    const double y = std::exp(scales[i].log_scale);
    row.tail(fault.num) = fault.x_of(scales[i]);
    H += row * row.transpose();
    g += y * row;
    squares += y * y;
  }
  FaultFit fit;
  fit.mean = H.col(0).tail(fault.num) / H(0, 0);
  const Eigen::VectorXd square = H.diagonal().tail(fault.num) / H(0, 0);
  fit.spread = (square - fit.mean.cwiseAbs2()).cwiseMax(0.0).cwiseSqrt();
  const Ldlt ldlt(H);
  constexpr double hardly = 1e-10;
  if (!(ldlt.min_pivot() > hardly * H(0, 0)) || !(fit.spread.minCoeff() > 0.0)) return std::nullopt;
  const Eigen::VectorXd solution = ldlt.inverse() * g;
  fit.scale = solution[0];
  fit.by = solution.tail(fault.num);
  fit.left2 = std::max(squares - solution.dot(g), 0.0);
  return fit;
}

/// An estimated fault; σ from the jackknife over blocks, the surface's shape and the prior of the beam.
struct FoundFault {
  FaultFit fit;
  double sigma_log_scale = 0.0, T2 = 0.0;
  Eigen::MatrixXd cov_by;
};

/// `of_surface`: relative error of each scale by the surface's shape, which may be correlated with x.
std::optional<FoundFault> found_by_blocks(const BeamFault& fault, std::span<const BeamScale> scales,
                                          const Eigen::MatrixXd& of_beam, double of_surface) {
  const auto fit = fault_fit(fault, scales, 0, 0);
  if (!fit || !(fit->scale > 0.0)) return std::nullopt;
  FoundFault found;
  found.fit = *fit;
  Eigen::MatrixXd cov = Eigen::MatrixXd::Zero(fault.num, fault.num);
  double of_scale = 0.0;
  for (std::size_t i = 0; i < num_blocks; ++i) {
    const auto without = fault_fit(fault, scales, i * scales.size() / num_blocks, (i + 1) * scales.size() / num_blocks);
    if (!without || !(without->scale > 0.0)) return std::nullopt;
    of_scale += std::pow(std::log(without->scale / fit->scale), 2);
    cov += (without->by - fit->by) * (without->by - fit->by).transpose();
  }
  const double share = (static_cast<double>(num_blocks) - 1.0) / static_cast<double>(num_blocks);
  cov = share * cov + of_beam;
  constexpr double both_ways = 2.0;
  const Eigen::VectorXd of_x = fault.is_length ? Eigen::VectorXd(fit->mean / both_ways) : fit->spread;
  cov.diagonal() += (of_surface * fit->scale * of_x.cwiseInverse()).cwiseAbs2();
  found.sigma_log_scale = std::sqrt(share * of_scale);
  found.cov_by = cov;
  found.T2 = fit->by.dot(Ldlt(cov).inverse() * fit->by);
  return found;
}

/// By blocks of time or of position on the surface, whichever scatter more.
std::optional<FoundFault> found_fault(const BeamFault& fault, std::span<const BeamScale> scales,
                                      const Eigen::MatrixXd& of_beam, double of_surface) {
  const auto by_time = found_by_blocks(fault, scales, of_beam, of_surface),
             of_places = found_by_blocks(fault, by_place(scales), of_beam, of_surface);
  if (!by_time || !of_places) return std::nullopt;
  return of_places->T2 < by_time->T2 ? of_places : by_time;
}

/// Relative scale error if the readings had an offset of the length of an instrument, measured from its other end,
/// unless a covariance of the beam or the readings themselves exclude it: the shape of a surface, or a nearly constant
/// distance, hides it. 0: it would be detected.
double hidden_offset(std::span<const BeamScale> scales, const Beam& beam, const std::optional<FoundFault>& offset,
                     double scale) {
  constexpr double sigmas = 3.3;  // an offset of that size exceeds 2σ, in doubt, in five of six cases
  if (beam.cov.diagonal().maxCoeff() > 0.0) return 0.0;
  if (offset && sigmas * std::sqrt(offset->cov_by(0, 0)) < instrument_m) return 0.0;
  double of_offset = 0.0;
  for (const BeamScale& each : scales) of_offset += std::abs(each.of_offset) / static_cast<double>(scales.size());
  return instrument_m * of_offset / scale;
}

/// RMS relative scale error by a fault that the readings neither show nor exclude: a certain share of beams is measured
/// from the other end of the housing, say, or was moved after calibration. Its size is from the readings and the usual
/// σ; the probability of its presence from Bayes' rule.
double possible_share(const BeamFault& fault, const FoundFault& found, const Beam& beam, double scale) {
  constexpr double share_of_calibrated = 0.2, share_of_others = 0.5, surest = 50.0;
  const double share = beam.cov.diagonal().maxCoeff() > 0.0 ? share_of_calibrated : share_of_others;
  const Eigen::VectorXd &by = found.fit.by, slope = found.fit.mean / scale;
  const Eigen::MatrixXd ordinary = fault.ordinary * fault.ordinary * Eigen::MatrixXd::Identity(fault.num, fault.num);
  const Eigen::MatrixXd both = found.cov_by + ordinary, kept = ordinary * Ldlt(both).inverse();
  const double log_ratio = 0.5 * std::log(found.cov_by.determinant() / both.determinant()) +
                           0.5 * (found.T2 - by.dot(Ldlt(both).inverse() * by));
  const double odds = share / (1.0 - share) * std::exp(std::min(log_ratio, surest));
  const double size2 = std::pow(slope.dot(kept * by), 2) + slope.dot(kept * found.cov_by * slope);
  return std::sqrt(odds / (1.0 + odds) * size2);
}

/// The data, corrected for a fault of this size.
struct CorrectedData {
  std::vector<RangeReading> readings;
  Beam beam;
};
CorrectedData without_fault(const RangeData& data, const BeamFault& fault, const Eigen::VectorXd& by) {
  CorrectedData corrected{{data.readings.begin(), data.readings.end()}, data.beam};
  BeamVector step = BeamVector::Zero();
  if (&fault == &direction_fault) step.segment<2>(beam_direction_param) = -by;
  corrected.beam = data.beam.retract(step);
  for (RangeReading& reading : corrected.readings) {
    if (&fault == &offset_fault) reading.range_m -= by[0];
    if (&fault == &clock_fault) reading.t_s -= by[0];
  }
  return corrected;
}

/// A fault that is significant, with its best estimate and its fit.
struct Cause {
  const BeamFault* fault = nullptr;
  FoundFault found;
  Eigen::VectorXd by;
  double misfit = 0.0;  ///< Robust relative σ of the residual scales.
};

/// Iterated, as it is nonlinear: a beam that points elsewhere meets other surfaces.
/// `num_given`: number of readings that have a surface without correction.
std::optional<Cause> cause_of(const RangeData& data, const BeamFault& fault, FoundFault found,
                              const Eigen::MatrixXd& of_beam, std::size_t num_given) {
  constexpr int rounds = 3;
  constexpr double enough = 0.5;
  Cause cause{&fault, std::move(found), {}, 0.0};
  cause.by = cause.found.fit.by;
  for (int round = 0; round < rounds; ++round) {
    const CorrectedData corrected = without_fault(data, fault, cause.by);
    std::vector<BeamScale> scales = scales_of({corrected.readings, corrected.beam, data.path, data.map}).scales;
    if (static_cast<double>(scales.size()) < enough * static_cast<double>(num_given)) return std::nullopt;
    std::vector<double> logs, sizes;
    for (const BeamScale& each : scales) logs.push_back(each.log_scale);
    const double median = median_of(logs);
    for (const double log : logs) sizes.push_back(std::abs(log - median));
    cause.misfit = normal_from_mad * median_of(std::move(sizes));
    reject_rough(scales);
    reject_far(scales);
    if (scales.size() < num_blocks) return std::nullopt;
    auto again = found_fault(fault, scales, of_beam, 0.0);
    if (!again) return std::nullopt;
    cause.by += again->fit.by;
    cause.found = std::move(*again);
  }
  return cause;
}

/// Estimates the fault (offset, clock or direction) that explains most, if one is significant. If one is doubtful, its
/// effect is added to σ; otherwise, its possible effect.
void add_faults(const RangeData& data, std::span<const BeamScale> scales, double of_surface, ReadScale& read) {
  const Beam& beam = data.beam;
  const Eigen::Vector3d along = beam.direction_in_cam;
  const Eigen::MatrixXd along_beam = Eigen::MatrixXd::Constant(1, 1, along.dot(beam.cov.topLeftCorner<3, 3>() * along)),
                        of_direction = beam.cov.block<2, 2>(beam_direction_param, beam_direction_param),
                        of_clock = Eigen::MatrixXd::Zero(1, 1);
  const auto offset = found_fault(offset_fault, scales, along_beam, of_surface),
             direction = found_fault(direction_fault, scales, of_direction, of_surface),
             clock = found_fault(clock_fault, scales, of_clock, of_surface);
  std::optional<Cause> best;
  const auto compare = [&](const BeamFault& fault, const std::optional<FoundFault>& found, const auto& of_beam) {
    if (!found || !(found->T2 > fault.clear)) return;
    auto cause = cause_of(data, fault, *found, of_beam, read.num_used + read.num_rejected);
    if (cause && (!best || cause->misfit < best->misfit)) best = std::move(cause);
  };
  compare(offset_fault, offset, along_beam);
  compare(direction_fault, direction, of_direction);
  compare(clock_fault, clock, of_clock);
  if (best) {
    read.scale = best->found.fit.scale;
    read.sigma_rel = std::hypot(read.sigma_rel, best->found.sigma_log_scale);
    if (best->fault == &offset_fault) read.offset_m = best->by[0];
    if (best->fault == &direction_fault) read.aside_rad = best->by.norm();
    if (best->fault == &clock_fault) read.late_s = best->by[0];
    return;
  }
  const double before = read.scale;
  const auto count = [&](const BeamFault& fault, const std::optional<FoundFault>& found, double believed) {
    if (!found) return;
    const double doubted = believed * std::log(found->fit.scale / before);
    read.sigma_rel = std::hypot(read.sigma_rel,
                                found->T2 > fault.half_clear ? doubted : possible_share(fault, *found, beam, before));
  };
  // If an offset is hardly determined, the usual size for an instrument is the better estimate.
  const double known = offset ? offset->cov_by(0, 0) / (instrument_m * instrument_m) : 0.0;
  count(offset_fault, offset, 1.0 / (1.0 + known));
  count(direction_fault, direction, 1.0);
  count(clock_fault, clock, 1.0);
  read.hidden_offset_rel = hidden_offset(scales, beam, offset, before);
}

}  // namespace

std::optional<ReadScale> scale_by_range(std::span<const RangeReading> readings, const Beam& beam,
                                        std::span<const PathStep> path, std::span<const MapPoint> map) {
  const RangeData data{readings, beam, path, map};
  auto [scales, other_log_scale] = scales_of(data);
  if (scales.empty()) return std::nullopt;
  const std::size_t num_given = scales.size();
  reject_rough(scales);
  reject_far(scales);
  if (scales.size() < num_blocks) return std::nullopt;
  double roughness = 0.0;
  for (const BeamScale& each : scales) roughness += each.roughness / static_cast<double>(scales.size());
  const MeanScale of_time = mean_of_blocks(scales), of_places = mean_of_blocks(by_place(scales));
  const MeanScale mean = of_places.sigma > of_time.sigma ? of_places : of_time;
  ReadScale read{std::exp(mean.log_scale), 0.0, scales.size(), num_given - scales.size()};
  // A curved surface lies on one side of every plane through its points, by about their roughness.
  read.sigma_rel = std::hypot(mean.sigma, sigma_by_beam(data), roughness);
  read.other_log_scale = other_log_scale;
  add_faults(data, scales, roughness, read);
  constexpr double useless = 0.2;
  return read.sigma_rel < useless ? std::optional(read) : std::nullopt;
}

}  // namespace alidade
