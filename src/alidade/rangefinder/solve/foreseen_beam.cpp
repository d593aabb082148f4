#include "alidade/rangefinder/solve/foreseen_beam.h"

#include <algorithm>
#include <cmath>

#include "alidade/geometry/decompositions.h"
#include "alidade/rangefinder/rangefinder.h"
#include "alidade/rangefinder/solve/beam_bound.h"
#include "alidade/rangefinder/solve/error_causes.h"
#include "alidade/rangefinder/solve/fixed_distortion.h"

namespace alidade {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

MatrixXd scaled_inverse(const MatrixXd& H) {
  const Eigen::VectorXd scale = H.diagonal().cwiseSqrt().cwiseInverse();
  const Ldlt ldlt(scale.asDiagonal() * H * scale.asDiagonal());
  return scale.asDiagonal() * ldlt.inverse() * scale.asDiagonal();
}

/// Corners of a board at a pose that are `edge_px` inside the image.
BoardView corners_inside(const Camera& camera, const std::vector<Eigen::Vector3d>& points, const Rigid3& cam_from_board,
                         double edge_px) {
  BoardView view;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const auto px = project(camera, cam_from_board * points[i]);
    const bool is_inside = px && px->minCoeff() > edge_px && px->x() < camera.width_px - 1.0 - edge_px &&
                           px->y() < camera.height_px - 1.0 - edge_px;
    if (is_inside) view.corners.push_back({static_cast<int>(i), *px});
  }
  return view;
}

}  // namespace

ForeseenBeam::ForeseenBeam(const BeamNow& now) : now_(now), camera_(with_distortion(now.camera)) {
  problem_.points_in_board = now.points_in_board;
  problem_.model.noise = now.beam.noise;
  problem_.sigma_corner_px = now.sigma_corner_px;
  problem_.estimate_scale = now.estimate_scale;
  prior_ = lens_prior(camera_, true);
  num_ = problem_.num_free() + static_cast<Index>(prior_.free.size());
  information_ = known();
  if (now.refine == Refine::all && !prior_.free.empty()) held_ = fixed_distortion(camera_, prior_.free);
  prior_.free.insert(prior_.free.end(), held_.begin(), held_.end());
  const auto num_lens = static_cast<Index>(prior_.free.size());
  prior_.information.setZero(num_lens, num_lens);  // it is in what is known; a shot must not bring it again
  count_taken_shots();
  put_sheet();
  frees_distortion_ = wants_free_distortion();
}

/// Information of the covariances at hand; a beam that is not known at all is within half a metre and half a radian.
MatrixXd ForeseenBeam::known() const {
  const int p = problem_.num_free();
  const Index k = num_ - p;
  const bool knows_beam = now_.beam.cov.diagonal().head(p).minCoeff() > 0.0 && now_.beam.cov.allFinite();
  MatrixXd cov = MatrixXd::Zero(num_, num_);
  if (knows_beam) {
    cov.topLeftCorner(p, p) = (now_.beam.cov - now_.sheet.counted()).topLeftCorner(p, p);
  } else {
    cov.diagonal().head(p).setConstant(0.25);
  }
  if (k > 0) cov.bottomRightCorner(k, k) = camera_.cov(prior_.free, prior_.free);
  if (k > 0 && knows_beam && now_.beam.cov_with_lens.cols() == params(now_.camera.lens).size()) {
    cov.topRightCorner(p, k) = now_.beam.cov_with_lens(Eigen::seqN(0, p), prior_.free);
    cov.bottomLeftCorner(k, p) = cov.topRightCorner(p, k).transpose();
  }
  if (now_.refine == Refine::all || k == 0) return scaled_inverse(cov);
  // The beam is G lens and what the shots leave of it: cov = H⁻¹ + G C Gᵀ, with the lens G C, where C is the lens'.
  const MatrixXd G = cov.topRightCorner(p, k) * scaled_inverse(cov.bottomRightCorner(k, k));
  MatrixXd information = MatrixXd::Zero(num_, num_);
  information.topLeftCorner(p, p) = scaled_inverse(cov.topLeftCorner(p, p) - G * cov.bottomLeftCorner(k, p));
  information.topRightCorner(p, k) = -information.topLeftCorner(p, p) * G;
  information.bottomLeftCorner(k, p) = information.topRightCorner(p, k).transpose();
  return information;
}

/// What the shots behind the covariances say of distortion that was held there.
void ForeseenBeam::count_taken_shots() {
  const auto m = static_cast<Index>(held_.size());
  MatrixXd all = MatrixXd::Zero(num_ + m + 1, num_ + m + 1);
  for (const TakenShot& shot : now_.taken) {
    if (m == 0) break;
    const BoardView view = corners_inside(camera_, now_.points_in_board, shot.cam_from_board, 0.0);
    if (const auto added = information_of(shot.range_m, shot.cam_from_board, view, shot.has_spot)) all += *added;
  }
  all.topLeftCorner(num_, num_) = information_;
  information_ = std::move(all);
}

/// Of a sheet before the print what the shots behind the covariances say, as it was stated with them.
void ForeseenBeam::put_sheet() {
  const CountedSheet& sheet = now_.sheet;
  const Index last = information_.rows() - 1, p = problem_.num_free();
  if (!(sheet.left_m > 0.0)) return;
  const Index num = now_.refine == Refine::beam ? p : num_;
  Eigen::VectorXd moves = Eigen::VectorXd::Zero(num);
  moves.head(p) = sheet.moves.head(p) / sheet.left_m;
  const Eigen::VectorXd column = -information_.topLeftCorner(num, num) * moves;
  information_.col(last).head(num_).setZero();
  information_.col(last).head(num) = column;
  information_.row(last) = information_.col(last).transpose();
  const double known = std::max(0.0, std::pow(sheet.left_m, -2) - std::pow(sheet.sigma_m, -2));
  information_(last, last) = known - column.dot(moves);
}

std::optional<BoardView> ForeseenBeam::board_at(const Rigid3& cam_from_board) const {
  constexpr double edge_px = 5.0;
  BoardView view = corners_inside(camera_, now_.points_in_board, cam_from_board, edge_px);
  if (view.corners.size() < now_.points_in_board.size()) return std::nullopt;
  return view;
}

std::optional<MatrixXd> ForeseenBeam::information_of(double range_m, const Rigid3& cam_from_board,
                                                     const BoardView& board, bool has_spot) const {
  PreparedShot shot;
  shot.range_m = range_m;
  shot.sigma_spot_px = now_.sigma_spot_px;
  if (now_.method != RangefinderMethod::plane && has_spot) {
    shot.spot_px = project(camera_, point_at(now_.beam, range_m));
    if (!shot.spot_px) return std::nullopt;
  }
  CommonState state{now_.beam, camera_, {std::nullopt}};
  if (now_.sees_boards) {
    if (now_.method != RangefinderMethod::spot) shot.plane = plane_of(cam_from_board);
    shot.board = &board;
    state.cam_from_board.front() = cam_from_board;
  }
  BeamProblem one = problem_;
  one.shots = {shot};
  const ReducedSystem system = reduced_system(one, prior_, state);
  if (system.shots.empty()) return std::nullopt;
  const ReducedShot& seen = system.shots.front();
  const auto places = system.places(problem_.num_free(), prior_.free);
  const auto num = static_cast<Index>(places.size());
  MatrixXd information = MatrixXd::Zero(num + 1, num + 1);
  information.topLeftCorner(num, num) = seen.A(places, places);
  const Eigen::Vector3d sheet = sheet_share(shot, now_.beam, camera_, one.model);
  information.col(num).head(num) = seen.errors.by_common(Eigen::all, places).transpose() * sheet;
  information.row(num).head(num) = information.col(num).head(num).transpose();
  information(num, num) = sheet.dot(seen.errors.I * sheet);
  return information;
}

MatrixXd ForeseenBeam::joint_cov(const MatrixXd& information, bool frees_distortion) const {
  if (now_.refine == Refine::beam && num_ > problem_.num_free()) {
    const int p = problem_.num_free();
    const Index k = num_ - p;
    const MatrixXd C = camera_.cov(prior_.free, prior_.free);
    MatrixXd cov = MatrixXd::Zero(num_, num_);
    const MatrixXd of_shots = scaled_inverse(information.topLeftCorner(p, p));
    const MatrixXd G = -of_shots * information.block(0, p, p, k);
    cov.topLeftCorner(p, p) = of_shots + G * C * G.transpose();
    cov.topRightCorner(p, k) = G * C;
    cov.bottomRightCorner(k, k) = C;
    return cov;
  }
  if (!frees_distortion) return scaled_inverse(information.topLeftCorner(num_, num_));
  const Index num = information.rows() - 1;
  MatrixXd with_prior = information.topLeftCorner(num, num);
  const Camera open = with_open_distortion(camera_);
  for (std::size_t i = 0; i < held_.size(); ++i) {
    const Index at = num_ + static_cast<Index>(i);
    with_prior(at, at) += 1.0 / open.cov(held_[i], held_[i]);
  }
  return scaled_inverse(with_prior);
}

/// What a sheet adds to the beam's covariance, with the information of all and the covariance of what is estimated.
BeamMatrix ForeseenBeam::counted_sheet(const MatrixXd& information, const MatrixXd& cov) const {
  CountedSheet sheet = now_.sheet;
  if (!(sheet.left_m > 0.0)) return BeamMatrix::Zero();
  const Index p = problem_.num_free();
  const bool alone = now_.refine == Refine::beam && num_ > p;  // the lens does not follow it
  const MatrixXd inverse = alone ? scaled_inverse(information.topLeftCorner(p, p)) : cov;
  const Eigen::VectorXd column = information.col(information.rows() - 1).head(inverse.rows());
  const Eigen::VectorXd moves = -inverse * column;
  sheet.left_m = left_of(sheet.sigma_m, information.diagonal().tail<1>()[0] + column.dot(moves));
  sheet.moves.setZero();
  sheet.moves.head(p) = sheet.left_m * moves.head(p);
  return sheet.counted();
}

bool ForeseenBeam::wants_free_distortion() const {
  if (held_.empty() || !now_.sees_boards) return false;
  const int p = problem_.num_free();
  const MatrixXd cov = joint_cov(information_, false);
  if (!cov.allFinite()) return false;
  RangefinderReport report;
  report.beam = now_.beam;
  report.beam.cov.setZero();
  report.beam.cov.topLeftCorner(p, p) = cov.topLeftCorner(p, p);
  report.scale_by_need = true;
  report.shots.resize(1);
  report.shots.front().pose.emplace();
  const std::vector<std::string> names = param_names(camera_.lens);
  for (std::size_t i = 0; i < held_.size(); ++i) {
    FixedQuantity thing{.name = "camera." + names[static_cast<std::size_t>(held_[i])]};
    thing.moves.head(p) = -(cov * information_.col(num_ + static_cast<Index>(i)).head(num_)).head(p);
    report.fixed.push_back(thing);
  }
  return wants_distortion(report, camera_, {});
}

MatrixXd ForeseenBeam::cov_with(const MatrixXd& added) const {
  const int p = problem_.num_free();
  const MatrixXd all = information_ + added, cov = joint_cov(all, frees_distortion_);
  return cov.topLeftCorner(p, p) + counted_sheet(all, cov).topLeftCorner(p, p);
}

void ForeseenBeam::add(const MatrixXd& added) {
  information_ += added;
  frees_distortion_ = wants_free_distortion();
}

BeamBound ForeseenBeam::bound() const {
  const int p = problem_.num_free();
  const MatrixXd cov = joint_cov(information_, frees_distortion_);
  const Index k = cov.rows() - p;
  Beam beam = now_.beam;
  Camera camera = camera_;
  beam.cov.setZero();
  beam.cov.topLeftCorner(p, p) = cov.topLeftCorner(p, p);
  beam.cov += counted_sheet(information_, cov);
  if (k > 0) {
    const std::vector<int> lens(prior_.free.begin(), prior_.free.begin() + k);
    camera.cov(lens, lens) = cov.bottomRightCorner(k, k);
    beam.cov_with_lens.setZero(num_beam_params, prior_.mean.size());
    beam.cov_with_lens(Eigen::seqN(0, p), lens) = cov.topRightCorner(p, k);
  } else {
    beam.cov_with_lens.resize(0, 0);
  }
  return judge_beam(problem_, beam, camera);
}

}  // namespace alidade
