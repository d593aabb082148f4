#include "alidade/localize/checks/lens_kind.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <set>

#include "alidade/geometry/decompositions.h"
#include "alidade/localize/observation_localizer.h"
#include "alidade/localize/setup.h"

// Whether the camera file has the wrong kind of lens. No pinhole parameter indicates a fisheye, and a filter that is
// wrong from its first frame leaves no path for a score test: the kinds are tried.

namespace alidade {
namespace {

constexpr std::array<std::string_view, 2> kinds{"brown", "kannala_brandt"};
constexpr double well = 0.8;  ///< Share of the observations that a kind of lens must explain.

/// Fit of observations to a path with its lens: squares over σ², capped at the gate.
struct Explained {
  double cost = 0.0;
  std::size_t num = 0, num_placed = 0, num_fit = 0;  ///< Placed: of a map point visible from there.
  double rms_px = 0.0;                               ///< Of those that fit, per point.
  /// Of placed misfits in consecutive frames: cosine between the two errors of a point.
  double sum_cosines = 0.0;
  std::size_t num_cosines = 0;

  [[nodiscard]] double share() const {
    return static_cast<double>(num_fit) / static_cast<double>(std::max<std::size_t>(num, 1));
  }
};

/// The error of the last misfit of each point.
class Misfits {
 public:
  void add(std::size_t frame, long id, const Eigen::Vector2d& error_px, Explained& sums) {
    const auto [at, is_first] = last_.try_emplace(id, frame, error_px);
    if (is_first) return;
    if (at->second.first + 1 == frame) {
      sums.sum_cosines += error_px.normalized().dot(at->second.second.normalized());
      ++sums.num_cosines;
    }
    at->second = {frame, error_px};
  }

 private:
  std::map<long, std::pair<std::size_t, Eigen::Vector2d>> last_;
};

Explained explained_by(const Localization& path, std::span<const ObservationFrame> frames,
                       const LocalizationFilterConfig& filter) {
  std::map<long, Eigen::Vector3d> points;
  for (const MapPoint& point : path.map) points[point.id] = point.point_in_world;
  Explained sums;
  Misfits misfits;
  double squares = 0.0;
  for (std::size_t k = 0; k < frames.size(); ++k) {
    for (const FeatureObservation& each : frames[k].observations) {
      const double sigma_px = each.sigma_px > 0.0 ? each.sigma_px : filter.sigma_px;
      const auto point = points.find(each.id);
      std::optional<Eigen::Vector2d> px;
      if (point != points.end() && path.path[k].has_pose())
        px = project(path.camera, path.path[k].world_from_cam.inverse() * point->second);
      const double square = px ? (*px - each.px).squaredNorm() : 1e300, chi2 = square / (sigma_px * sigma_px);
      ++sums.num;
      sums.num_placed += px ? 1 : 0;
      sums.cost += std::min(chi2, filter.gate);
      if (px && !(chi2 < filter.gate)) misfits.add(k, each.id, *px - each.px, sums);
      if (!(chi2 < filter.gate)) continue;
      ++sums.num_fit;
      squares += square;
    }
  }
  sums.rms_px = std::sqrt(squares / static_cast<double>(std::max<std::size_t>(sums.num_fit, 1)));
  return sums;
}

/// Config for a table of observations with the lens estimated, using only these frames.
LocalizeConfig with_free_lens(const Camera& camera, std::span<const KnownPoint> target, const LocalizeConfig& config) {
  LocalizeConfig out;
  out.new_points = config.new_points;
  out.depth_m = config.depth_m;
  out.sigma_depth = config.sigma_depth;
  out.start = config.start;
  out.target.points.assign(target.begin(), target.end());
  out.period_s = config.period_s;
  out.max_points = config.max_points;
  out.filter.sigma_px = config.filter.sigma_px;
  out.filter.sigma_a_m_s2 = config.filter.sigma_a_m_s2;
  out.filter.sigma_alpha_rad_s2 = config.filter.sigma_alpha_rad_s2;
  constexpr double of_focal = 0.1, of_width = 0.03, of_radial = 0.15;
  const std::vector<std::string> names = param_names(camera.lens);
  const Eigen::VectorXd lens = params(camera.lens);
  const auto free = [&](std::string_view name, double sigma) {
    const auto at = std::ranges::find(names, name);
    if (at == names.end()) return;
    out.filter.lens_params.push_back(static_cast<int>(at - names.begin()));
    out.filter.sigma_lens_params.push_back(sigma);
  };
  free("fx", of_focal * lens[0]);
  free("fy", of_focal * lens[1]);
  for (const char* centre : {"cx", "cy"}) free(centre, of_width * camera.width_px);
  for (const char* radial : {"k1", "k2"}) free(radial, of_radial);
  return out;
}

struct Solved {
  Camera camera;
  Explained explained;
};

Solved solved_with(const Camera& camera, std::span<const ObservationFrame> frames, std::span<const KnownPoint> target,
                   const LocalizeConfig& config) {
  const LocalizeConfig run = resolved(sized(with_free_lens(camera, target, config), frames), camera, false);
  ObservationLocalizer localizer(camera, run);
  Localization result;
  for (const ObservationFrame& frame : frames) result.path.push_back(localizer.take(frame));
  result.camera = camera;
  localizer.sum_up(result);
  return {result.camera, explained_by(result, frames, run.filter)};
}

Camera without_cov(Camera camera, Lens lens) {
  camera.lens = std::move(lens);
  camera.cov.resize(0, 0);
  return camera;
}

/// A lens of that kind with the focal length and centre of another, without distortion: for a fisheye, the angle is
/// proportional to the distance from the centre.
Camera as_kind(std::string_view kind, const Camera& camera) {
  const Lens plain = *make_lens(kind);
  Eigen::VectorXd values = Eigen::VectorXd::Zero(params(plain).size());
  values.head<4>() = params(camera.lens).head<4>();
  return without_cov(camera, with_params(plain, values));
}

/// The lens of the kind of `given` that best approximates another at the pixels of these frames, by Gauss–Newton.
Camera nearest_of_kind(const Camera& given, const Camera& other, std::span<const ObservationFrame> frames) {
  constexpr int max_steps = 20;
  constexpr std::size_t most = 2000;
  std::size_t num = 0;
  for (const ObservationFrame& frame : frames) num += frame.observations.size();
  const std::size_t stride = num / most + 1;
  std::vector<Eigen::Vector2d> pixels;
  std::size_t count = 0;
  for (const ObservationFrame& frame : frames)
    for (const FeatureObservation& each : frame.observations)
      if (count++ % stride == 0) pixels.push_back(each.px);
  Camera camera = as_kind(model_name(given.lens), other);
  const std::vector<std::optional<Eigen::Vector3d>> rays = unproject(other, pixels);
  for (int step = 0; step < max_steps; ++step) {
    Eigen::VectorXd lens = params(camera.lens);
    Eigen::MatrixXd H = Eigen::MatrixXd::Identity(lens.size(), lens.size()) * 1e-6;
    Eigen::VectorXd g = Eigen::VectorXd::Zero(lens.size());
    for (std::size_t i = 0; i < pixels.size(); ++i) {
      const auto at = rays[i] ? project_with_jacobians(camera, *rays[i]) : std::nullopt;
      if (!at) continue;
      H += at->J_px_params.transpose() * at->J_px_params;
      g += at->J_px_params.transpose() * (pixels[i] - at->px);
    }
    lens += solve_symmetric(H, g);
    if (!lens.allFinite()) break;
    camera.lens = with_params(camera.lens, lens);
  }
  return camera;
}

/// Points of a frame to add: of those that are observed longest from there on, spread from the image centre to the
/// edge, where kinds of lens differ.
std::vector<long> points_to_add(const ObservationFrame& frame, const Eigen::Vector2d& centre_px, std::size_t num,
                                const std::map<long, std::size_t>& num_left, const std::set<long>& chosen) {
  std::vector<std::pair<double, long>> by_radius;
  std::size_t most = 0;
  for (const FeatureObservation& each : frame.observations)
    if (!chosen.contains(each.id)) most = std::max(most, num_left.at(each.id));
  for (const FeatureObservation& each : frame.observations)
    if (!chosen.contains(each.id) && 2 * num_left.at(each.id) >= most)
      by_radius.emplace_back((each.px - centre_px).norm(), each.id);
  std::ranges::sort(by_radius);
  num = std::min(num, by_radius.size());
  std::vector<long> added;
  for (std::size_t i = 0; i < num; ++i) added.push_back(by_radius[i * by_radius.size() / num].second);
  return added;
}

/// The frames with the target's points and a limited number of others at any time: the work of a filter grows at least
/// with the square of their number.
std::vector<ObservationFrame> with_fewer_points(std::span<const ObservationFrame> frames,
                                                std::span<const KnownPoint> target, const Camera& camera) {
  // With 30 points or more and no target, no other speeds are tried (ObservationLocalizer::start).
  const std::size_t enough = target.empty() ? 40 : 20, few = target.empty() ? 30 : 15;
  const Eigen::Vector2d centre_px = params(camera.lens).segment<2>(2);
  std::map<long, std::size_t> num_left;
  for (const ObservationFrame& frame : frames)
    for (const FeatureObservation& each : frame.observations) ++num_left[each.id];
  std::set<long> known, chosen;
  for (const KnownPoint& point : target) known.insert(point.id);
  chosen = known;
  std::vector<ObservationFrame> out(frames.begin(), frames.end());
  for (const ObservationFrame& frame : out) {
    const auto num =
        static_cast<std::size_t>(std::ranges::count_if(frame.observations, [&](const FeatureObservation& each) {
          return chosen.contains(each.id) && !known.contains(each.id);
        }));
    if (num < few)
      for (const long id : points_to_add(frame, centre_px, enough - num, num_left, chosen)) chosen.insert(id);
    for (const FeatureObservation& each : frame.observations) --num_left[each.id];
  }
  for (ObservationFrame& frame : out)
    std::erase_if(frame.observations, [&](const FeatureObservation& each) { return !chosen.contains(each.id); });
  return out;
}

/// Whether the deficiencies of a verdict may be due to the lens.
bool may_be_of_lens(const Verdict& verdict) {
  if (verdict.state == State::not_converged || verdict.state == State::refused) return true;
  const std::set<std::string_view> of_lens{
      "innovations",      "frames lost",           "gated", "target",     "restarts", "camera",
      "radial structure", "position in the image", "σ",     "map's frame"};
  // Innovations smaller than stated are not caused by a lens.
  return std::ranges::any_of(verdict.checks, [&](const Check& check) {
    return check.state != State::good && of_lens.contains(check.name) &&
           (check.name != "innovations" || check.value > check.limit);
  });
}

/// Whether an estimated lens of the given kind leaves nothing for another kind to explain.
bool is_explained(const Localization& result) {
  constexpr double noise_alone = 1.15;
  constexpr std::size_t few = 20;
  return result.given_camera && !result.is_of_images && result.nis_per_dof < noise_alone &&
         few * result.num_gated < result.num_used;
}

/// Whether there are so many mismatches that no kind of lens explains enough: the error of a point by a wrong lens is
/// nearly the same in the next frame, whereas mismatches are unrelated to each other.
bool has_many_mismatches(const Explained& explained) {
  constexpr std::size_t enough = 200;  // standard error of a mean cosine: 0.05
  if (explained.num_cosines < enough) return false;
  const double in_common = std::max(explained.sum_cosines / static_cast<double>(explained.num_cosines), 0.0);
  const auto num_misfits = static_cast<double>(explained.num_placed - explained.num_fit);
  return (1.0 - in_common) * num_misfits > (1.0 - well) * static_cast<double>(explained.num);
}

/// Whether the lens is not the cause: the path uses all that was seen (except points that are in no map, such as points
/// of images that were hardly found again), and no residual depends on the position in the image, as it would with
/// another kind of lens.
bool leaves_no_trace(const Localization& result, const Explained& explained) {
  constexpr double nearly_all = 0.99;
  const std::set<std::string_view> traces{"camera", "radial structure", "position in the image"};
  if (!result.is_smoothed) return false;
  if (std::ranges::any_of(result.verdict.checks, [&](const Check& check) {
        return check.state != State::good && traces.contains(check.name);
      }))
    return false;
  const auto num_placed = static_cast<double>(explained.num_placed);
  return static_cast<double>(explained.num_fit) >= nearly_all * num_placed &&
         num_placed >= well * static_cast<double>(explained.num);
}

std::string text_about(const OtherLensKind& other, const Lens& given) {
  const auto name_of = [](const Lens& lens) -> std::string {
    const std::string_view name = model_name(lens);
    return name == "pinhole" ? "a pinhole" : name == "brown" ? "a Brown lens" : "a fisheye (kannala_brandt)";
  };
  const auto size_of = [](double share, double rms_px) {
    return text_of(100.0 * share, 3) + " % of the observations (" + text_of(rms_px, 2) + " px RMS)";
  };
  return "the lens is not " + name_of(given) + ": " + name_of(other.camera.lens) + " of focal length " +
         text_of(params(other.camera.lens)[0], 3) + " px explains " + size_of(other.explained, other.rms_px) +
         ", the best of the given kind " + size_of(other.explained_by_given, other.rms_by_given_px) +
         "; calibrate with --model " + std::string(model_name(other.camera.lens));
}

}  // namespace

std::optional<OtherLensKind> other_lens_kind(std::span<const ObservationFrame> frames,
                                             std::span<const KnownPoint> target, const LocalizeConfig& config,
                                             const Localization& result) {
  constexpr std::size_t enough = 20, most = 300;
  constexpr double far_better = 0.8, least_gain = 100.0;
  const std::string_view given_kind = model_name(result.camera.lens);
  if (frames.size() < enough || given_kind == "flat_port" || !may_be_of_lens(result.verdict)) return std::nullopt;
  if (std::ranges::none_of(result.path, &PathStep::has_pose) || is_explained(result)) return std::nullopt;
  if (result.path.size() == frames.size()) {
    const Explained explained = explained_by(result, frames, config.filter);
    if (leaves_no_trace(result, explained) || (result.is_smoothed && has_many_mismatches(explained)))
      return std::nullopt;
  }
  const Camera& as_given = result.given_camera ? *result.given_camera : result.camera;
  const Camera given = without_cov(as_given, as_given.lens);
  const std::vector<ObservationFrame> fewer =
      with_fewer_points(frames.first(std::min(frames.size(), most)), target, given);
  frames = fewer;
  const auto solved = [&](const Camera& camera) { return solved_with(camera, frames, target, config); };
  const auto is_better = [](const Explained& a, const Explained& b) {
    return a.cost < far_better * b.cost && a.cost + least_gain < b.cost;
  };
  // The other kinds first: if none explains enough, there is no need to solve with the given one again.
  std::vector<Solved> others;
  for (const std::string_view kind : kinds)
    if (kind != given_kind) others.push_back(solved(as_kind(kind, given)));
  if (std::ranges::none_of(others, [](const Solved& other) { return other.explained.share() >= well; }))
    return std::nullopt;
  Explained of_given = solved(given).explained;
  std::optional<Solved> best;
  for (Solved& other : others)
    if (is_better(other.explained, best ? best->explained : of_given)) best = std::move(other);
  if (!best || best->explained.share() < well) return std::nullopt;
  const Explained nearest = solved(nearest_of_kind(given, best->camera, frames)).explained;
  if (nearest.cost < of_given.cost) of_given = nearest;
  if (!is_better(best->explained, of_given)) return std::nullopt;
  return OtherLensKind{best->camera, best->explained.share(), of_given.share(), best->explained.rms_px,
                       of_given.rms_px};
}

void add_lens_kind(const OtherLensKind& other, Localization& result) {
  Verdict& verdict = result.verdict;
  const std::string text = text_about(other, result.camera.lens);
  verdict.checks.push_back({"lens", State::bad, text, other.explained_by_given, other.explained, "1", "path"});
  if (verdict.state < State::bad) {  // the sentence names only what is in the worst state
    verdict.state = State::bad;
    verdict.sentence = verdict.sentence.substr(0, verdict.sentence.find(';'));
  }
  verdict.sentence += "; " + text;
}

}  // namespace alidade
