#include "alidade/network/camera_fault.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "alidade/geometry/decompositions.h"
#include "alidade/geometry/degree.h"

namespace alidade {
namespace {

using PlacedStatus = MovingTargetReport::Status;

/// How well cameras agree: how many are located, and what is left at them.
struct Agreement {
  std::size_t num_placed = 0;
  double sigma_px = std::numeric_limits<double>::infinity();  ///< Root mean square of the cameras'.
  double lens_sigmas = 0.0;                                   ///< By which a lens is asked to be another, most.
  double agreeing = 0.0;  ///< Share of the seconds in which two or more watch that their path covers.
  double flatness = 1.0;  ///< The path's thickness over its length: of one in a plane, 0.
};

double flatness_of(std::span<const Eigen::Vector3d> path) {
  if (path.empty()) return 1.0;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& point : path) mean += point / static_cast<double>(path.size());
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  for (const Eigen::Vector3d& point : path) scatter += (point - mean) * (point - mean).transpose();
  const Eigen::Vector3d squares = symmetric_eigen3(scatter).values;
  return squares[2] > 0.0 ? std::sqrt(std::max(0.0, squares[0]) / squares[2]) : 1.0;
}

Agreement agreement_of(const MovingTargetReport& report) {
  Agreement agreement;
  if (report.status != PlacedStatus::placed && report.status != PlacedStatus::no_scale) return agreement;
  double sum2 = 0.0;
  for (const LocatedCamera& camera : report.cameras) {
    if (!camera.placed) continue;
    ++agreement.num_placed;
    sum2 += camera.sigma_px * camera.sigma_px;
  }
  for (const CameraScore& lens : report.scores) agreement.lens_sigmas = std::max(agreement.lens_sigmas, lens.sigmas());
  agreement.agreeing = report.agreeing;
  agreement.flatness = flatness_of(report.path);
  if (agreement.num_placed > 0) agreement.sigma_px = std::sqrt(sum2 / static_cast<double>(agreement.num_placed));
  return agreement;
}

/// The central minute of the observations: enough to tell whether cameras agree.
std::vector<TargetObservation> central_minute(std::span<const TargetObservation> observations) {
  constexpr double enough_s = 60.0;
  const auto [first, last] = std::ranges::minmax_element(observations, {}, &TargetObservation::t_capture_s);
  const double mid_s = 0.5 * (first->t_capture_s + last->t_capture_s);
  std::vector<TargetObservation> kept;
  for (const TargetObservation& observation : observations)
    if (std::abs(observation.t_capture_s - mid_s) <= 0.5 * enough_s) kept.push_back(observation);
  return kept;
}

std::vector<TargetObservation> mirrored(std::vector<TargetObservation> observations, std::size_t head, int width_px) {
  for (TargetObservation& observation : observations)
    if (observation.head == head) observation.px.x() = width_px - 1.0 - observation.px.x();
  return observations;
}

/// By the clock of the rig, where each camera's is known.
std::vector<TargetObservation> by_one_clock(const MovingTargetReport& report, std::span<const TargetObservation> own) {
  std::vector<TargetObservation> observations(own.begin(), own.end());
  for (TargetObservation& observation : observations)
    observation.t_capture_s = report.cameras[observation.head].clock.in_rig(observation.t_capture_s);
  std::ranges::stable_sort(observations, {}, &TargetObservation::t_capture_s);
  return observations;
}

struct Best {
  Agreement agreement;
  std::string words;

  void consider(const Agreement& other, const std::string& of) {
    constexpr double most = 0.8;  // agreement in a few seconds alone may be chance
    if (other.agreeing < most) return;
    if (other.num_placed < agreement.num_placed || other.num_placed < 2) return;
    if (other.num_placed == agreement.num_placed && !(other.sigma_px < agreement.sigma_px)) return;
    agreement = other;
    words = of;
  }
};

/// Images of one size, through lenses that differ by more than such a share of the focal length.
bool may_be_exchanged(const Camera& first, const Camera& second, double share) {
  if (first.width_px != second.width_px || first.height_px != second.height_px) return false;
  if (first.lens.index() != second.lens.index()) return true;
  const Eigen::VectorXd a = params(first.lens), b = params(second.lens);
  return share > 0.0 ? std::abs(a[0] - b[0]) > share * a[0] : a != b;
}

/// Pairs of cameras that may have each other's lens.
std::vector<std::pair<std::size_t, std::size_t>> exchanges_of(std::span<const RigHead> heads, double share) {
  std::vector<std::pair<std::size_t, std::size_t>> pairs;
  for (std::size_t a = 0; a < heads.size(); ++a)
    for (std::size_t b = a + 1; b < heads.size(); ++b)
      if (may_be_exchanged(heads[a].camera, heads[b].camera, share)) pairs.emplace_back(a, b);
  return pairs;
}

std::string name_of(const RigHead& head) { return std::to_string(head.head.id); }

/// What may be wrong, each thing undone: mirrored images, where the cameras do not agree at all, and exchanged lenses.
Best best_undone(const std::vector<TargetObservation>& observations, const std::vector<RigHead>& given,
                 std::span<const std::pair<std::size_t, std::size_t>> exchanges, bool doubtful, double clock_search_s,
                 const PlaceCameras& place) {
  constexpr double flat = 0.05;  // a path in a plane has a mirrored one that fits as well
  Best best;
  for (std::size_t h = 0; doubtful && h < given.size() && (given.size() > 2 || h == 0); ++h) {
    const std::string words = given.size() == 2 ? "one of the two cameras gives mirrored images"
                                                : "the images of head " + name_of(given[h]) + " are mirrored";
    const auto undone = mirrored(observations, h, given[h].camera.width_px);
    const Agreement agreement = agreement_of(place(undone, given, clock_search_s));
    if (agreement.flatness > flat) best.consider(agreement, words);
  }
  for (const auto& [a, b] : exchanges) {
    std::vector<RigHead> exchanged = given;
    std::swap(exchanged[a].camera, exchanged[b].camera);
    const Agreement agreement = agreement_of(place(observations, exchanged, clock_search_s));
    // One wrong file may fit another head better, and is as wrong there.
    if (agreement.lens_sigmas > camera_limit) continue;
    best.consider(agreement, "heads " + name_of(given[a]) + " and " + name_of(given[b]) + " have each other's camera");
  }
  return best;
}

/// Cameras whose clocks differ: of three or more the one that is another, the reference if all others differ from it
/// alike.
void consider_clocks(const std::vector<TargetObservation>& observations, const std::vector<RigHead>& given,
                     const PlaceCameras& place, Best& best) {
  constexpr double search_s = 1.0, min_sigmas = 5.0, same_s = 0.003;
  const MovingTargetReport report = place(observations, given, search_s);
  const Agreement agreement = agreement_of(report);
  std::vector<std::size_t> other;
  const auto [first, last] = std::ranges::minmax_element(observations, {}, &TargetObservation::t_capture_s);
  const double mid_s = 0.5 * (first->t_capture_s + last->t_capture_s);
  std::vector<double> late_s;
  for (const LocatedCamera& camera : report.cameras) late_s.push_back(mid_s - camera.clock.in_rig(mid_s));
  std::vector<double> sorted = late_s;
  std::ranges::sort(sorted);
  const double usual_s = sorted[sorted.size() / 2];
  for (std::size_t h = 0; h < late_s.size(); ++h)
    if (std::abs(late_s[h] - usual_s) > std::max(same_s, min_sigmas * report.cameras[h].sigma_clock_s))
      other.push_back(h);
  if (other.size() != 1) return;
  const double by_s = late_s[other.front()] - usual_s;
  const std::string by = text_of(1e3 * std::abs(by_s), 2) + " ms";
  best.consider(agreement, given.size() == 2 ? "the clocks of the two cameras differ by " + by
                                             : "the clock of head " + name_of(given[other.front()]) + " is " + by +
                                                   (by_s > 0.0 ? " ahead of" : " behind") + " the others'");
}

}  // namespace

bool is_doubtful(const MovingTargetReport& report) {
  constexpr double usual_rad = 0.2 * degree;
  if (report.status == PlacedStatus::too_few || report.status == PlacedStatus::truth_misfits) return false;
  const bool all_located = std::ranges::all_of(report.cameras, &LocatedCamera::placed);
  const bool is_solved = report.status == PlacedStatus::placed || report.status == PlacedStatus::no_scale;
  return !is_solved || !all_located || report.sigma_relative_rad > usual_rad;
}

bool agrees_better(const MovingTargetReport& report, const MovingTargetReport& other) {
  constexpr double plainly = 0.9;
  const Agreement one = agreement_of(report), two = agreement_of(other);
  if (one.num_placed != two.num_placed) return one.num_placed > two.num_placed;
  return one.sigma_px < plainly * two.sigma_px;
}

std::string camera_fault_of(const MovingTargetReport& report, std::span<const TargetObservation> observations,
                            std::span<const RigHead> heads, double clock_search_s, const PlaceCameras& place) {
  const bool doubtful = is_doubtful(report);
  if (observations.empty() || report.status == PlacedStatus::too_few || report.status == PlacedStatus::truth_misfits)
    return "";
  // Exchanged lenses that differ by a few hundredths locate all cameras, wrongly: a few of those are always tried.
  constexpr double plainly = 0.005;
  constexpr std::size_t few = 6;
  const auto exchanges = exchanges_of(heads, doubtful ? 0.0 : plainly);
  if (!doubtful && (exchanges.empty() || exchanges.size() > few)) return "";
  // All cameras are located, and so are their clocks: they are not searched again.
  const std::vector<TargetObservation> all =
      doubtful ? std::vector<TargetObservation>(observations.begin(), observations.end())
               : by_one_clock(report, observations);
  std::vector<TargetObservation> some = central_minute(all);
  const std::vector<RigHead> given(heads.begin(), heads.end());
  const double search_s = doubtful ? clock_search_s : 0.0;
  Agreement as_given = agreement_of(place(some, given, search_s));
  // A minute may not locate cameras that all observations do: what is exchanged is compared with the same.
  // Nor may the start that was best of all.
  if (const Agreement in_all = agreement_of(report);
      in_all.num_placed > as_given.num_placed ||
      (in_all.num_placed == as_given.num_placed && in_all.sigma_px < 0.9 * as_given.sigma_px)) {
    some = all;
    as_given = in_all;
  }
  Best best = best_undone(some, given, exchanges, doubtful, search_s, place);
  // By as much less is left as no chance would have it: of thousands of observations a hundredth would be.
  // Where one was not located at all, the others may have agreed well: so must all now.
  constexpr double much_less = 0.93, about_as_little = 1.3;
  const bool all_were_placed = as_given.num_placed == given.size();
  const auto explains = [&] {
    return best.agreement.num_placed == given.size() &&
           best.agreement.sigma_px < (all_were_placed ? much_less : about_as_little) * as_given.sigma_px;
  };
  // Clocks that differ are part of what an exchange or a mirror takes, too.
  if (clock_search_s == 0.0 && (doubtful || explains())) consider_clocks(some, given, place, best);
  if (!explains()) return "";
  return best.words + ": undone, all cameras agree to " + text_of(best.agreement.sigma_px, 2) + " px" +
         (as_given.num_placed == given.size() ? ", for " + text_of(as_given.sigma_px, 2) : std::string());
}

}  // namespace alidade
