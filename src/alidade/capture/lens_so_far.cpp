#include "alidade/capture/lens_so_far.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "alidade/board/board_pose.h"
#include "alidade/calibrate/pose_information.h"
#include "alidade/calibrate/solve/normal_equations.h"
#include "alidade/geometry/decompositions.h"

namespace alidade {
namespace {

/// σ of a parameter of any camera about that of a guess.
double usual_sigma(const std::string& name, const Camera& camera) {
  if (name == "fx" || name == "fy") return 0.4 * camera.width_px;
  if (name == "cx" || name == "cy") return 0.05 * camera.width_px;
  if (name == "p1" || name == "p2") return 0.005;
  return name == "k3" ? 0.3 : 0.2;
}

bool is_fixed(const CalibrateConfig& config, const std::string& name) {
  return std::ranges::find(config.fixed, name) != config.fixed.end();
}

/// A camera of its size as most are; behind a port, as if there were none.
Camera guess(const ImageSize& size, const CalibrateConfig& config) {
  Camera camera{.width_px = size.width_px, .height_px = size.height_px, .lens = {}, .cov = {}, .source = ""};
  const bool is_port = config.model == FlatPort::name;
  camera.lens = *make_lens(is_port ? "brown" : config.model);
  const std::vector<std::string> names = param_names(camera.lens);
  Eigen::VectorXd values = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(names.size()));
  values[0] = values[1] = 0.9 * std::max(size.width_px, size.height_px);
  values[2] = 0.5 * (size.width_px - 1);
  values[3] = 0.5 * (size.height_px - 1);
  for (const Prior& prior : config.priors) {
    const auto at = std::ranges::find(names, prior.name);
    if (at != names.end() && at - names.begin() < 4) values[at - names.begin()] = prior.value;
  }
  camera.lens = with_params(camera.lens, values);
  camera.cov = Eigen::MatrixXd::Zero(values.size(), values.size());
  for (std::size_t i = 0; i < names.size(); ++i) {
    const auto at = static_cast<Eigen::Index>(i);
    if (!is_fixed(config, names[i])) camera.cov(at, at) = std::pow(usual_sigma(names[i], camera), 2);
  }
  return camera;
}

/// What the views add to what is known of the guess.
void learn(const std::vector<BoardView>& views, LensSoFar& lens) {
  const std::vector<int> free = free_parameters(lens.camera);
  if (free.empty()) return;
  Eigen::MatrixXd information = submatrix(lens.camera.cov, free).diagonal().cwiseInverse().asDiagonal();
  for (const BoardView& view : views) {
    const auto pose = fit_board_pose(lens.camera, view, lens.board_points, 1.0);
    const auto gained =
        pose ? lens_information(lens.camera, lens.board_points, view, pose->pose.cam_from_board, free) : std::nullopt;
    if (gained) information += *gained / (lens.noise_px * lens.noise_px);
  }
  const Eigen::VectorXd scale = information.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::MatrixXd cov = scaled_by(scale, Llt(scaled_by(scale, information)).inverse());
  lens.camera.cov = full_matrix(cov, free, lens.camera.cov.rows());
}

}  // namespace

LensSoFar lens_so_far(const Board& board, const std::vector<BoardView>& views, const ImageSize& size,
                      const CalibrateConfig& config) {
  LensSoFar lens;
  CalibrateConfig flat = config;
  if (flat.board_shape != BoardShape::given) flat.board_shape = BoardShape::flat;
  lens.report = calibrate(board, views, size, flat, flat.board_points);
  lens.board_points = lens.report.board_points;
  lens.is_solved = lens.report.status == CalibrateReport::Status::converged;
  if (lens.is_solved) {
    lens.camera = lens.report.camera;
    lens.noise_px = std::max(1e-3, shared_noise_px(lens.report));
    return lens;
  }
  lens.camera = guess(size, config);
  learn(views, lens);
  return lens;
}

namespace {

/// A photo's own focal length beside that of all.
struct OwnFocal {
  double change = 0.0, sigma = 0.0;  ///< Relative.
};

/// One Gauss–Newton step of each photo's focal length and pose, the rest of the lens fixed.
std::vector<OwnFocal> own_focals(const LensSoFar& lens, const std::vector<BoardView>& views) {
  const double focal_px = params(lens.camera.lens)[0];
  std::vector<OwnFocal> own;
  for (std::size_t k = 0; k < views.size(); ++k) {
    const ViewFit& fit = lens.report.views[k];
    if (!fit.used) continue;
    const ViewArrays arrays = make_arrays(views[k]);
    BundleProblem problem;
    problem.views = {&arrays, 1};
    problem.free_lens = {0, 1};
    problem.prior_value = params(lens.camera.lens);
    problem.prior_information = Eigen::VectorXd::Zero(problem.prior_value.size());
    NormalEquations eq;
    if (!linearize(problem, {lens.camera.lens, {fit.cam_from_board}, lens.board_points}, eq)) continue;
    const Llt V(eq.V.front());
    const Eigen::Matrix2d H = eq.H.selfadjointView<Eigen::Lower>();
    const Eigen::Matrix2d S = H - eq.coupling(0) * V.solve_each(eq.coupling(0).transpose());
    const Eigen::Vector2d g = eq.gradient - eq.coupling(0) * V.solve(eq.pose_gradient.front());
    const double information = S.sum();  // both focal lengths move together
    if (!(information > 0.0)) continue;
    own.push_back({-g.sum() / information / focal_px, lens.report.noise_px / std::sqrt(information) / focal_px});
  }
  return own;
}

}  // namespace

std::string focal_walk(const LensSoFar& lens, const std::vector<BoardView>& views) {
  constexpr std::size_t enough = 6;
  constexpr double min_walk = 0.004, max_z = 6.0;  // of the focal length; standard deviations
  if (!lens.is_solved || views.size() < enough) return "";
  std::vector<OwnFocal> own = own_focals(lens, views);
  // Informative photos only: those taken head on do not separate focal length and distance.
  std::erase_if(own, [](const OwnFocal& each) { return !(each.sigma < 0.25 * min_walk); });
  if (own.size() < enough) return "";
  const auto [least, most] = std::ranges::minmax_element(own, {}, &OwnFocal::change);
  const double walk = most->change - least->change, sigma = std::hypot(most->sigma, least->sigma);
  double chi2 = 0.0;
  for (const OwnFocal& each : own) chi2 += std::pow(each.change / each.sigma, 2);
  const double focal_px = params(lens.camera.lens)[0];
  const double per_photo = chi2 / static_cast<double>(own.size());
  if (walk < min_walk || walk < max_z * sigma || per_photo < 9.0) return "";
  return fmt::format(
      "the focal length varies between photos, by {:.1f} % ({:.0f} to {:.0f} px): switch the camera's autofocus off",
      100.0 * walk, focal_px * (1.0 + least->change), focal_px * (1.0 + most->change));
}

}  // namespace alidade
