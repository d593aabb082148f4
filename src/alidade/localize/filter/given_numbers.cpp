#include "alidade/localize/filter/given_numbers.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "alidade/localize/path/path_system.h"

namespace alidade {
namespace {

constexpr std::array<std::string_view, 6> pose_numbers{"the position across (x)", "the position across (y)",
                                                       "the distance (z)",        "the rotation about x",
                                                       "the rotation about y",    "the rotation about z"};

/// For a change along `direction`: its effect on the path, and its score test.
GivenNumber given_number(std::string_view name, const Eigen::VectorXd& direction, const GivenSystem& system) {
  GivenNumber given{.name = name};
  for (std::size_t k = 0; k < system.J_pose.size(); ++k)
    take_move(system.J_pose[k] * direction, system.pose_cov[k], given);
  const Eigen::VectorXd informed = system.information * direction;
  const double information = direction.dot(informed), score = direction.dot(system.score);
  if (information > 0.0) {
    given.asked = score / information;
    given.z = score / std::sqrt(std::max(information, direction.dot(system.score_cov * direction)) +
                                informed.dot(system.cov * informed));
  }
  return given;
}

/// Parameters of a port that was not calibrated with its lens. In the observations they are nearly indistinguishable
/// from the focal length, which is reported instead. Only with a lens that is not estimated, a smoothed path provides a
/// score of the water's index that neither focal length nor k1 explains alone.
template <class Place, class Add>
void add_port(const GivenSystem& system, const Place& place, const Add& add, std::vector<GivenNumber>& all) {
  const Eigen::Index gap = place("gap_m");
  if (gap < 0 || system.cov(gap, gap) > 0.0) return;
  const bool is_smoothed = system.score.size() >= static_cast<Eigen::Index>(system.lens_params.size()) + num_causes;
  const Eigen::Index water = is_smoothed && place("fx") >= 0 ? place("n_water") : -1;
  for (const auto& [param, name] :
       {std::pair{"n_water", "water's index"}, std::pair{"gap_m", "port's gap"},
        std::pair{"normal_x", "port's normal x"}, std::pair{"normal_y", "port's normal y"}}) {
    const Eigen::Index at = place(param);
    if (at < 0) continue;
    const double variance = system.cov(at, at);
    add(name, Eigen::VectorXd::Unit(system.score.size(), at),
        variance > 0.0 ? std::optional(std::sqrt(variance)) : std::nullopt);
    if (at != water) all.back().asked = all.back().z = 0.0;
  }
}

}  // namespace

void take_move(const Eigen::Vector<double, 6>& move, const Eigen::Matrix<double, 6, 6>& cov, GivenNumber& given) {
  for (int i = 0; i < 6; ++i) {
    const double share = std::abs(move[i]) / std::sqrt(cov(i, i));
    if (!(share > given.moves)) continue;
    given.moves = share;
    given.moved = pose_numbers[static_cast<std::size_t>(i)];
    given.moved_by = std::abs(move[i]);
  }
}

std::vector<GivenNumber> given_numbers(const GivenSystem& system) {
  const std::vector<std::string> names = param_names(system.camera.lens);
  const Eigen::VectorXd values = params(system.camera.lens);
  const auto num = static_cast<Eigen::Index>(system.lens_params.size());
  const auto place = [&](std::string_view name) -> Eigen::Index {
    for (Eigen::Index i = 0; i < num; ++i)
      if (names[static_cast<std::size_t>(system.lens_params[static_cast<std::size_t>(i)])] == name) return i;
    return -1;
  };
  const auto value_of = [&](Eigen::Index i) { return values[system.lens_params[static_cast<std::size_t>(i)]]; };
  const bool has_cov = system.camera.cov.size() > 0;
  std::vector<GivenNumber> all;
  const auto add = [&](std::string_view name, const Eigen::VectorXd& direction, std::optional<double> sigma) {
    all.push_back(given_number(name, direction, system));
    all.back().sigma = sigma;
  };
  const auto direction_of = [&](Eigen::Index at) -> Eigen::VectorXd {
    return Eigen::VectorXd::Unit(system.score.size(), at);
  };
  const Eigen::Index fx = place("fx"), fy = place("fy");
  if (fx >= 0 && fy >= 0)
    add("focal length", value_of(fx) * direction_of(fx) + value_of(fy) * direction_of(fy),
        has_cov ? std::optional(std::sqrt(system.cov(fx, fx)) / value_of(fx)) : std::nullopt);
  for (const auto& [param, name] : {std::pair{"cx", "centre u"}, std::pair{"cy", "centre v"}, std::pair{"k1", "k1"}}) {
    const Eigen::Index at = place(param);
    if (at >= 0) add(name, direction_of(at), has_cov ? std::optional(std::sqrt(system.cov(at, at))) : std::nullopt);
  }
  add_port(system, place, add, all);
  add("scale of the target", direction_of(num), std::sqrt(system.cov(num, num)));
  all.back().asked = all.back().z = 0.0;  // unobservable: all distances may be larger by the same factor
  const auto at_cause = [&](int cause) { return direction_of(num + cause); };
  if (system.score.size() < num + num_causes) return all;
  add("shape of the target", at_cause(shape_cause), std::nullopt);
  for (int axis = 0; axis < 3; ++axis) add("speed of the target", at_cause(speed_cause + axis), std::nullopt);
  add("readout", at_cause(readout_cause), std::nullopt);
  for (int axis = 0; axis < 3; ++axis) add("rotation of the target", at_cause(turn_cause + axis), std::nullopt);
  return all;
}

std::vector<GivenNumber> GivenTally::take_recent(const LocalizationFilter& filter) {
  const GivenEffects& given = filter.given();
  const Said now{given.score(), given.information(), given.score_cov()};
  // A filter that restarted has lost its scores: count from there on.
  const bool goes_on = before_.score.size() == now.score.size() &&
                       (now.information.diagonal().array() >= before_.information.diagonal().array()).all();
  const Said since = std::exchange(before_, now);
  if (!goes_on) return {};
  const Eigen::MatrixXd information = now.information - since.information, score_cov = now.score_cov - since.score_cov;
  const std::vector<Eigen::Matrix<double, 6, Eigen::Dynamic>> J_pose{filter.J_pose_given()};
  const std::vector<Eigen::Matrix<double, 6, 6>> cov{filter.pose_covariance()};
  return given_numbers({filter.camera(), given.lens_params(), given.cov(), now.score - since.score, information,
                        score_cov, J_pose, cov});
}

void GivenTally::add(const LocalizationFilter& filter) {
  const GivenEffects& given = filter.given();
  const std::vector<Eigen::Matrix<double, 6, Eigen::Dynamic>> J_pose{filter.J_pose_given()};
  const std::vector<Eigen::Matrix<double, 6, 6>> cov{filter.pose_covariance()};
  std::vector<GivenNumber> now = given_numbers({filter.camera(), given.lens_params(), given.cov(), given.score(),
                                                given.information(), given.score_cov(), J_pose, cov});
  GivenNumber clock{.name = "clock"};
  Eigen::Vector<double, 6> twist;
  twist << filter.motion().world_from_cam.rotation.conjugate() * filter.motion().velocity_in_world,
      filter.motion().rate_in_cam;
  take_move(twist, cov.front(), clock);
  now.push_back(clock);
  for (std::size_t i = 0; i < now.size() && i < numbers_.size(); ++i) {
    if (now[i].moves > numbers_[i].moves) continue;
    now[i].moves = numbers_[i].moves;
    now[i].moved = numbers_[i].moved;
    now[i].moved_by = numbers_[i].moved_by;
  }
  numbers_ = std::move(now);
}

}  // namespace alidade
