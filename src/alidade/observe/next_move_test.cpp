#include "alidade/observe/next_move.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "alidade/estimation/config_error.h"
#include "alidade/observe.h"
#include "alidade/observe/solve/rotation_bundle.h"
#include "alidade/simulate/rotation.h"

namespace alidade {
namespace {

/// σ of fx, fy, cx, cy that the paper's motion leaves after `duration_s`: its Cramér–Rao bound.
Eigen::Vector4d bound_of_paper_motion(const std::vector<Eigen::Vector2d>& points, double duration_s, double sigma_px) {
  RotationScene scene;
  scene.start_px = points;
  scene.motion = paper_rate;
  RotationLogConfig how;
  how.duration_s = duration_s;
  how.sigma_px = 0.0;
  const RotationLog log = simulate_rotation(scene, how, 1);
  RotationBundle bundle;
  bundle.camera.k = {710.0 / 390.0, 700.0 / 390.0, 0.5 / 390.0, -0.5 / 390.0};
  MotionReader reader(log.source, 0.25);
  const PixelScale scale{{389.5, 290.5}, 390.0};
  for (const Eigen::Vector2d& px : points) {
    const auto ray = RotationView(bundle.camera, RotationFrame{}).ray_in_start(scale.normalised(px));
    bundle.points.push_back({rotation_to(*ray), Eigen::Vector2d::Zero(), 0.0});
  }
  for (std::size_t k = 0; k < log.rows.size(); ++k) {
    bundle.frames.push_back(reader.next(log.rows[k]));
    for (std::size_t i = 0; i < points.size(); ++i) {
      bundle.observations.push_back({static_cast<int>(k), static_cast<int>(i), scale.normalised(log.rows[k].px[i])});
    }
  }
  RotationBundleConfig config;
  config.sigma_px = sigma_px / 390.0;
  config.max_iterations = 0;
  config.huber = 0.0;
  return solve_rotation_bundle(bundle, CommonPrior(bundle.camera), config).bound().diagonal().head<4>().cwiseSqrt() *
         390.0;
}

TEST(NextMove, ReachesThePapersAccuracyInAThirdOfTheTime) {
  constexpr double paper_s = 6.0;
  double planned_squares = 0.0, paper_squares = 0.0;
  for (std::uint64_t set = 1; set <= 20; ++set) {
    ObservedNow now{780, 582,  {710.0, 700.0, 390.0, 290.0}, Eigen::Vector4d(4e4, 4e4, 2500.0, 2500.0).asDiagonal(),
                    {},  0.316};
    now.points_px = draw_points(780, 582, 4, set);
    paper_squares += bound_of_paper_motion(now.points_px, paper_s, now.sigma_px).squaredNorm();
    double elapsed_s = 0.0;
    Eigen::Vector4d sigma_px = now.cov_px2.diagonal().cwiseSqrt();
    // A head of 46°/s. One as slow as the paper's motion (7°/s at most) cannot be three times as quick as it.
    for (const NextMove& move : plan_next_moves(now, {.rate_rad_per_s = 0.8, .max_turn_rad = 0.3}, 8)) {
      elapsed_s += move.duration_s;
      if (elapsed_s > paper_s / 3.0) break;
      sigma_px = move.sigma_px;
    }
    planned_squares += sigma_px.squaredNorm();
  }
  // Over the sets together; of single sets of four points two in three are as good.
  EXPECT_LE(planned_squares, paper_squares);
}

/// A head that sways for a while, and then goes where it is told.
class SwaysThenMoves {
 public:
  static constexpr double sway_s = 6.0;

  explicit SwaysThenMoves(std::uint64_t seed) : seed_(seed) {
    how_ = {.source = RotationSource::head, .rate_hz = 10.0, .duration_s = sway_s, .clip_to_image = true};
    // Some come into the image as it moves.
    scene_.start_px = draw_points(1560, 1164, 30, seed);
    for (Eigen::Vector2d& px : scene_.start_px) px -= Eigen::Vector2d(390.0, 291.0);
  }

  void go(const NextMove& move) {
    const Eigen::Vector3d from = legs_.empty() ? at_end_of_sway() : legs_.back().to;
    legs_.push_back({how_.duration_s, from, at_end_of_sway() + move.pan_tilt_roll_rad});
    how_.duration_s += move.duration_s;
  }

  ObserveReport observed() {
    scene_.motion = [this](double t_s) { return angles(t_s); };
    RotationLog log = simulate_rotation(scene_, how_, seed_);
    log.sigma_scale = 0.002;
    log.truth.clear();
    return observe(std::move(log), {.width_px = 780, .height_px = 582});
  }

 private:
  struct Leg {
    double from_s;
    Eigen::Vector3d from, to;
  };

  static Eigen::Vector3d at_end_of_sway() { return paper_pan_tilt(sway_s, 0.0); }

  [[nodiscard]] Eigen::Vector3d angles(double t_s) const {
    if (t_s < sway_s || legs_.empty()) return paper_pan_tilt(t_s, 0.0);
    for (std::size_t i = 0; i < legs_.size(); ++i) {
      const double until_s = i + 1 < legs_.size() ? legs_[i + 1].from_s : how_.duration_s;
      const double share = (t_s - legs_[i].from_s) / (until_s - legs_[i].from_s);
      if (share <= 1.0) return legs_[i].from + share * (legs_[i].to - legs_[i].from);
    }
    return legs_.back().to;
  }

  std::uint64_t seed_;
  RotationScene scene_;
  RotationLogConfig how_;
  std::vector<Leg> legs_;
};

TEST(NextMove, PromisesWhatIsStatedAfterwards) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    SwaysThenMoves head(seed);
    const ObserveReport before = head.observed();
    ASSERT_TRUE(before.verdict.ok()) << before.verdict.sentence;
    const MovePlan plan = plan_moves(observed_now(before), {.moves = 2});
    for (const NextMove& move : plan.moves) head.go(move);
    const ObserveReport after = head.observed();
    ASSERT_TRUE(after.verdict.ok()) << after.verdict.sentence;
    for (std::size_t i = 0; i < 4; ++i) {
      const ObservedQuantity &is = after.quantities[i], &was = before.quantities[i];
      const double promised = plan.moves.back().sigma_px[static_cast<Eigen::Index>(i)];
      const auto who = fmt::format("{} of seed {}, {} before", is.name, seed, was.sigma);
      EXPECT_GT(promised, 0.5 * is.sigma) << who;
      // Of the principal point it may be far less: errors before and during the moves do not add up, as is supposed.
      if (i < 2) EXPECT_LT(promised, 2.0 * is.sigma) << who;
    }
  }
}

TEST(NextMove, PromisesNothingOfRotationsThatAreNotMeasured) {
  ObservedNow now{780, 582, {710.0, 700.0, 390.0, 290.0}, Eigen::Vector4d::Ones().asDiagonal(), {}, 0.3};
  now.points_px = draw_points(780, 582, 4, 1);
  now.source = RotationSource::none;
  EXPECT_THROW((void)plan_moves(now), ConfigError);
}

TEST(NextMove, PromisesNothingOfACameraThatCannotBe) {
  SwaysThenMoves head(1);
  ObservedNow now = observed_now(head.observed());
  for (const double centre_px : {1e12, 1e300}) {
    now.k_px[2] = centre_px;
    EXPECT_EQ(plan_moves(now).verdict.exit_code, ExitCode::undetermined) << centre_px;
  }
}

TEST(NextMove, PromisesNothingOfMovesThatTakeForEverOrGainNothing) {
  SwaysThenMoves head(1);
  ObservedNow now = observed_now(head.observed());
  EXPECT_EQ(plan_moves(now).verdict.state, State::good);
  const Verdict slow = plan_moves(now, {.rate_deg_s = 1e-9}).verdict;
  EXPECT_EQ(slow.exit_code, ExitCode::undetermined) << slow.sentence;
  EXPECT_NE(slow.to_add.find("--rate-deg-s"), std::string::npos);
  now.cov_px2 = 1e-8 * Eigen::Matrix4d::Identity();
  now.sigma_model_px.setConstant(1e-4);
  EXPECT_EQ(plan_moves(now).verdict.state, State::care);
}

TEST(NextMove, PointsAreWhereTheyAreAtTheEnd) {
  std::vector<ObserveResidual> seen;
  for (int row = 0; row < 40; ++row)
    for (int point = 0; point < 6; ++point)
      if (row < 10 || point < 5) seen.push_back({.row = row, .point = point, .px = {10.0 * row, point}});
  EXPECT_EQ(points_at_end(seen, 30.0).size(), 5u);
  EXPECT_EQ(points_at_end(seen, 30.0).front(), Eigen::Vector2d(390.0, 0.0));
  // Of so few all are better than none.
  std::erase_if(seen, [](const ObserveResidual& each) { return each.point >= 2 && each.row >= 10; });
  EXPECT_EQ(points_at_end(seen, 30.0).size(), 6u);
}

TEST(NextMove, AsksForATiltWhereAPanHasSaidAllItCan) {
  ObservedNow now{780, 582, {710.0, 700.0, 390.0, 290.0}, Eigen::Vector4d(0.1, 4e4, 0.1, 2500.0).asDiagonal(), {}, 0.3};
  now.points_px = draw_points(780, 582, 4, 1);
  const auto moves = plan_next_moves(now, {}, 1);
  ASSERT_EQ(moves.size(), 1u);
  EXPECT_GT(std::abs(moves[0].pan_tilt_roll_rad.y()), 0.1);
  EXPECT_LT(moves[0].sigma_px[1], 20.0);
}

TEST(NextMove, HasNoneWithoutPoints) {
  ObservedNow now;
  now.width_px = 780;
  now.height_px = 582;
  EXPECT_TRUE(plan_next_moves(now, {}, 3).empty());
}

}  // namespace
}  // namespace alidade
