#include "alidade/track/checks/unseen_errors.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "alidade/estimation/median.h"
#include "alidade/track/checks/rig_faults.h"
#include "alidade/track/checks/track_assumed.h"

namespace alidade {
namespace {

/// A kind of parameter, identified by a part of its name, and a common size of its error.
struct Kind {
  const char* part;
  double error;   ///< In the unit of the parameter,
  bool is_share;  ///< or relative to its value.
  const char* text;
};
constexpr std::array<Kind, 6> kinds{Kind{"_rad", 0.0017453292519943295, false, "0.1°"},
                                    Kind{"camera.f", 0.01, true, "1 %"},
                                    Kind{"camera.c", 2.0, false, "2 px"},
                                    Kind{"_m", 0.001, false, "1 mm"},
                                    Kind{"_scale", 0.005, false, "0.5 %"},
                                    Kind{"clock_s", 0.005, false, "5 ms"}};

const Kind* kind_of(const std::string& name) {
  const auto kind = std::ranges::find_if(
      kinds, [&](const Kind& one) { return name.ends_with(one.part) || name.find(one.part) != std::string::npos; });
  return kind == kinds.end() ? nullptr : kind;
}

/// A position of the track, and its sensitivity to the parameters of the heads.
struct Place {
  const TrackStep* step = nullptr;
  double range_m = 0.0;
  std::vector<Eigen::MatrixXd> by;  ///< See meeting_sensitivity().

  [[nodiscard]] Eigen::Vector3d moved(const RigPower& of) const {
    if (of.head >= by.size() || by[of.head].cols() != of.step.size()) return Eigen::Vector3d::Zero();
    return by[of.head] * of.step;
  }
};

/// Positions sampled over the whole track; the last one has the median range.
std::vector<Place> places_of(std::span<const TargetObservation> observations, std::span<const RigHead> heads,
                             const TrackReport& report) {
  constexpr std::size_t max_places = 41;
  std::vector<Place> places;
  const std::size_t first = report.steps.size() / 10, every = 1 + (report.steps.size() - first) / max_places;
  for (std::size_t i = first; i < report.steps.size(); i += every) {
    const TrackStep& step = report.steps[i];
    if (!step.has_belief || !step.accepted) continue;
    const Eigen::Vector3d position = step.belief.x.head<3>();
    Place place{&step, (position - heads[0].head.world_from_base.translation).norm(),
                meeting_sensitivity(heads, readings_at(observations, heads.size(), step.t_s), position,
                                    step.belief.x.segment<3>(3))};
    if (!place.by.empty() && place.range_m > 0.0) places.push_back(std::move(place));
  }
  if (places.empty()) return places;
  const auto middle = places.begin() + static_cast<std::ptrdiff_t>(places.size() / 2);
  std::ranges::nth_element(places, middle, {}, &Place::range_m);
  std::swap(*middle, places.back());
  return places;
}

double in_sigma(const Eigen::Vector3d& moved, const TrackStep& step) {
  return (moved.array().abs() / step.belief.P.diagonal().head<3>().array().sqrt()).maxCoeff();
}

double rms_share(std::span<const Place> places, const RigPower& of) {
  double sum = 0.0;
  for (const Place& place : places) sum += place.moved(of).squaredNorm() / (place.range_m * place.range_m);
  return std::sqrt(sum / static_cast<double>(places.size()));
}

/// Whether an error may displace the target by 5σ while at most half of such logs reveal it.
bool is_unseen(const RigPower& of, const Place& median, double max_z) {
  constexpr double silent_sigma = 5.0;
  const double shown = of.z_per_unit > 0.0 ? max_z / of.z_per_unit : std::numeric_limits<double>::infinity();
  return std::min(shown, of.largest) * in_sigma(median.moved(of), *median.step) > silent_sigma;
}

/// σ of the displacement at that position by the unseen parameters, according to the rig file.
Eigen::Vector3d sigma_moved(const UnseenErrors& unseen, const Place& at, const RigUncertainty& errors) {
  Eigen::MatrixXd moved = Eigen::MatrixXd::Zero(3, errors.num());
  for (std::size_t h = 0; h < errors.factor.size() && h < at.by.size(); ++h) {
    if (at.by[h].cols() != errors.factor[h].rows()) continue;
    Eigen::VectorXd is_unseen = Eigen::VectorXd::Zero(at.by[h].cols());
    for (const RigPower* one : unseen.params)
      if (one->head == h) is_unseen = is_unseen.cwiseMax(one->step.cwiseAbs().cwiseMin(1.0).array().ceil().matrix());
    moved += at.by[h] * is_unseen.asDiagonal() * errors.factor[h];
  }
  return moved.rowwise().norm();
}

/// "pan_zero_rad and camera.cx of heads 1, 2; camera.f of head 2": names grouped by heads.
std::string names_text(const UnseenErrors& unseen) {
  std::vector<std::pair<std::string, std::string>> of_names;  // name, heads
  for (const RigPower* one : unseen.params) {
    const std::size_t dot = one->name.find('.');
    const std::string name = one->name.substr(dot + 1), head = one->name.substr(4, dot - 4);
    const auto known = std::ranges::find(of_names, name, &std::pair<std::string, std::string>::first);
    if (known == of_names.end())
      of_names.emplace_back(name, head);
    else
      known->second += ", " + head;
  }
  std::string text;
  for (std::size_t k = 0; k < of_names.size(); ++k) {
    const bool goes_on = k + 1 < of_names.size() && of_names[k + 1].second == of_names[k].second;
    text += of_names[k].first +
            (goes_on ? ", "
                     : (of_names[k].second.find(',') == std::string::npos ? " of head " : " of heads ") +
                           of_names[k].second);
    if (!goes_on && k + 1 < of_names.size()) text += "; ";
  }
  return text;
}

}  // namespace

UnseenErrors unseen_errors(std::span<const TargetObservation> observations, std::span<const RigHead> heads,
                           const TrackerConfig& config, bool rig_is_known, const TrackReport& report) {
  UnseenErrors unseen;
  if (report.power.empty()) return unseen;
  const std::vector<Place> places = places_of(observations, heads, report);
  if (places.empty()) return unseen;
  const Place& median = places.back();
  unseen.range_m = median.range_m;
  std::array<TargetMove, kinds.size()> worst;
  for (const RigPower& of : report.power) {
    const Kind* kind = kind_of(of.name);
    if (kind == nullptr || !is_unseen(of, median, max_fault_z(report))) continue;
    unseen.params.push_back(&of);
    const double unit = kind->is_share ? params(heads[of.head].camera.lens)[0] : 1.0;
    const double share = kind->error * unit * rms_share(places, of);
    TargetMove& most = worst[static_cast<std::size_t>(kind - kinds.data())];
    if (share > most.share) most = {of.name, kind->text, share};
  }
  for (TargetMove& one : worst)
    if (one.share > 0.0) unseen.worst.push_back(std::move(one));
  if (!rig_is_known || unseen.params.empty()) return unseen;
  const Eigen::Vector3d sigma_m = sigma_moved(unseen, median, config.errors);
  unseen.sigma_share = sigma_m.norm() / median.range_m;
  unseen.sigma_in_sigma = in_sigma(sigma_m, *median.step);
  return unseen;
}

std::string unseen_text(const UnseenErrors& unseen) {
  std::string text = "errors of " + names_text(unseen) + " would not show: ";
  for (const TargetMove& one : unseen.worst) {
    const bool is_first = &one == &unseen.worst.front();
    text += (is_first ? "" : ", ") + one.error + " of " + one.name + (is_first ? " moves the target by " : " by ") +
            text_of(100.0 * one.share, 2) + " %";
    if (is_first)
      text += " of its range (" + text_of(1e3 * one.share * unseen.range_m, 2) + " mm at " +
              text_of(unseen.range_m, 2) + " m)";
  }
  if (std::ranges::any_of(unseen.params, [](const RigPower* one) { return one->name.ends_with("_zero_rad"); }))
    text +=
        "; an error that an encoder has only at some angles (a ring off its centre, or oval) is there as one of "
        "its zero";
  return text;
}

}  // namespace alidade
