#include "alidade/localize/path/path_smoother.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <array>

#include "alidade/localize/path/pose_chain.h"
#include "alidade/testing/hover.h"
#include "alidade/testing/trials.h"

namespace alidade {
namespace {

using testing::Hover;
using testing::HoverLens;
using testing::HoverRun;

/// A chain of seven poses with a border of five, at random: all in one matrix, or pose by pose.
TEST(PoseChain, EliminatedPoseByPoseIsTheWholeMatrixInverted) {
  constexpr int num = 7, border = 5, all = 6 * num + border;
  Draws draws(3);
  Eigen::MatrixXd H = Eigen::MatrixXd::Zero(all, all);
  Eigen::VectorXd g = Eigen::VectorXd::Zero(all);
  PoseChain chain(border);
  for (int k = 0; k < num; ++k) {
    const int window = std::min(18, 6 * (num - k)), rows = 30;
    Eigen::MatrixXd J(rows, window + border);
    Eigen::VectorXd r(rows);
    for (int i = 0; i < rows; ++i) {
      r[i] = draws.normal();
      for (int j = 0; j < window + border; ++j) J(i, j) = draws.normal();
    }
    const Eigen::MatrixXd JJ = J.transpose() * J;
    const Eigen::VectorXd Jr = J.transpose() * r;
    chain.A.topLeftCorner(window, window) += JJ.topLeftCorner(window, window);
    chain.U.topRows(window) += JJ.topRightCorner(window, border);
    chain.B += JJ.bottomRightCorner(border, border);
    chain.a.head(window) += Jr.head(window);
    chain.b += Jr.tail(border);
    Eigen::MatrixXd P = Eigen::MatrixXd::Zero(window + border, all);  // where the window stands in the whole
    P.block(0, 6 * k, window, window).setIdentity();
    P.bottomRightCorner(border, border).setIdentity();
    H += P.transpose() * JJ * P;
    g += P.transpose() * Jr;
    ASSERT_TRUE(chain.eliminate());
  }
  const Eigen::MatrixXd cov = H.inverse();
  const Eigen::VectorXd x = cov * g;
  const Eigen::MatrixXd B = chain.B.selfadjointView<Eigen::Lower>();
  const Eigen::VectorXd x_border = B.llt().solve(chain.b);
  EXPECT_LT((x_border - x.tail(border)).norm(), 1e-9);
  EXPECT_NEAR(chain.gain() + x_border.dot(chain.b), x.dot(g), 1e-9);
  const auto steps = chain.steps(x_border).poses;
  // The last of the border's numbers as one that is given: the others, and the poses, move with it.
  const int solved = border - 1, rest = 6 * num + solved;
  Eigen::MatrixXd J_border(border, 1);
  J_border << -B.topLeftCorner(solved, solved).llt().solve(B.topRightCorner(solved, 1)), 1.0;
  const Eigen::VectorXd J = -H.topLeftCorner(rest, rest).inverse() * H.topRightCorner(rest, 1);
  const auto spread = chain.spread(B.inverse(), J_border);
  for (int k = 0; k < num; ++k) {
    const auto at = static_cast<std::size_t>(k);
    EXPECT_LT((steps[at] - x.segment<6>(6 * k)).norm(), 1e-9);
    EXPECT_LT((spread.cov[at] - cov.block<6, 6>(6 * k, 6 * k)).norm(), 1e-9);
    EXPECT_LT((spread.J[at] - J.segment<6>(6 * k)).norm(), 1e-9);
  }
}

/// Points that enter late and leave early, and take each other's positions, are as in the whole matrix, too.
TEST(PoseChain, PointsThatEnterAndLeaveAreTheWholeMatrixInverted) {
  struct Seen {
    int first, last;
  };
  constexpr std::array<Seen, 5> points{{{0, 2}, {0, 6}, {3, 4}, {3, 5}, {6, 6}}};
  constexpr int num = 7, shared = 4, num_points = 5, points_at = 6 * num, shared_at = points_at + 3 * num_points;
  constexpr int all = shared_at + shared;
  Draws draws(4);
  Eigen::MatrixXd H = Eigen::MatrixXd::Zero(all, all);
  Eigen::VectorXd g = Eigen::VectorXd::Zero(all);
  PoseChain chain(shared, 3);
  for (int k = 0; k < num; ++k) {
    std::vector<int> columns, places;  // in the whole, and in the border
    const int window = std::min(18, 6 * (num - k));
    for (int i = 0; i < shared; ++i) {
      columns.push_back(shared_at + i);
      places.push_back(i);
    }
    for (std::size_t p = 0; p < points.size(); ++p) {
      if (k == points[p].first) (void)chain.enter(p);
      if (k < points[p].first || k > points[p].last) continue;
      for (int i = 0; i < 3; ++i) {
        columns.push_back(points_at + 3 * static_cast<int>(p) + i);
        places.push_back(chain.place_of(p) + i);
      }
    }
    constexpr int rows = 40;
    const int border = static_cast<int>(columns.size());
    Eigen::MatrixXd J(rows, window + border);
    Eigen::VectorXd r(rows);
    for (int i = 0; i < rows; ++i) {
      r[i] = draws.normal();
      for (int j = 0; j < window + border; ++j) J(i, j) = draws.normal();
    }
    const Eigen::MatrixXd JJ = J.transpose() * J;
    const Eigen::VectorXd Jr = J.transpose() * r;
    std::vector<int> whole;
    for (int i = 0; i < window; ++i) whole.push_back(6 * k + i);
    whole.insert(whole.end(), columns.begin(), columns.end());
    for (int i = 0; i < window + border; ++i) {
      g[whole[static_cast<std::size_t>(i)]] += Jr[i];
      for (int j = 0; j < window + border; ++j)
        H(whole[static_cast<std::size_t>(i)], whole[static_cast<std::size_t>(j)]) += JJ(i, j);
    }
    chain.A.topLeftCorner(window, window) += JJ.topLeftCorner(window, window);
    chain.a.head(window) += Jr.head(window);
    for (int i = 0; i < border; ++i) {
      const int at = places[static_cast<std::size_t>(i)];
      chain.U.col(at).head(window) += JJ.col(window + i).head(window);
      chain.b[at] += Jr[window + i];
      for (int j = 0; j < border; ++j) chain.B(at, places[static_cast<std::size_t>(j)]) += JJ(window + i, window + j);
    }
    ASSERT_TRUE(chain.eliminate());
    for (std::size_t p = 0; p < points.size(); ++p)
      if (k == points[p].last) ASSERT_TRUE(chain.leave(p));
  }
  const Eigen::MatrixXd cov = H.inverse(), B = chain.B.topLeftCorner(shared, shared).selfadjointView<Eigen::Lower>();
  const Eigen::VectorXd x = cov * g, x_shared = B.llt().solve(chain.b.head(shared));
  EXPECT_LT((x_shared - x.tail(shared)).norm(), 1e-9);
  EXPECT_NEAR(chain.gain() + x_shared.dot(chain.b.head(shared)), x.dot(g), 1e-9);
  const PoseChain::Steps steps = chain.steps(x_shared);
  const PoseChain::Spread spread = chain.spread(B.inverse(), Eigen::MatrixXd::Identity(shared, shared));
  for (int k = 0; k < num; ++k) {
    const auto at = static_cast<std::size_t>(k);
    EXPECT_LT((steps.poses[at] - x.segment<6>(6 * k)).norm(), 1e-9) << k;
    EXPECT_LT((spread.cov[at] - cov.block<6, 6>(6 * k, 6 * k)).norm(), 1e-9) << k;
  }
  for (std::size_t p = 0; p < points.size(); ++p) {
    const int at = points_at + 3 * static_cast<int>(p);
    EXPECT_LT((steps.points[p] - x.segment<3>(at)).norm(), 1e-9) << p;
    EXPECT_LT((spread.point_cov[p] - cov.block<3, 3>(at, at)).norm(), 1e-9) << p;
  }
}

Localization hover_localized(const HoverRun& run, const Camera& camera, LocalizeConfig config = {}) {
  config.target.points = run.target;
  return localize(run.frames, camera, config, run.truth);
}

double mean_nees(const Localization& report, const HoverRun& run) {
  double sum = 0.0;
  for (std::size_t k = 0; k < report.path.size(); ++k)
    sum += testing::pose_nees(report.path[k], run.truth[k].world_from_cam);
  return sum / static_cast<double>(report.path.size());
}

/// All given right, by a simulator with lenses of its own. A run's error is mostly one draw of six components, that of
/// the frame by the target's points: a mean over 6 scatters by √(2/6/6) = 0.24.
TEST(SimpleCase, ThePoseIsAsGoodAsItsCovarianceSays) {
  const int num_seeds = testing::trials(6);
  for (const HoverLens lens : {HoverLens::brown, HoverLens::fisheye, HoverLens::port}) {
    double nees = 0.0;
    for (int seed = 1; seed <= num_seeds; ++seed) {
      const HoverRun run = testing::hovering({.lens = lens, .num_frames = 80, .num_others = 30},
                                             1000 + static_cast<std::uint64_t>(seed));
      const Localization report = hover_localized(run, run.camera);
      EXPECT_TRUE(report.is_smoothed);
      nees += mean_nees(report, run) / num_seeds;
    }
    RecordProperty("nees_" + std::to_string(static_cast<int>(lens)), std::to_string(nees));
    EXPECT_GT(nees, 0.8) << static_cast<int>(lens);
    EXPECT_LT(nees, 1.3) << static_cast<int>(lens);
  }
}

/// The target alone says how large the world is. Accelerations four times as large as given make the path
/// shorter before its points by 0.3 %; counted in metres they made all of it smaller by 1.7 %.
TEST(SimpleCase, AMotionTellsNothingOfTheWorldsSize) {
  const HoverRun run = testing::hovering({.num_frames = 300, .num_others = 12}, 6);
  std::vector<double> length_m;
  for (const double sigma_a : {0.15, 3.0}) {
    LocalizeConfig config;
    config.filter.sigma_a_m_s2 = sigma_a;
    const Localization report = hover_localized(run, run.camera, config);
    ASSERT_TRUE(report.is_smoothed);
    length_m.push_back(0.0);
    for (std::size_t k = 10; k < report.path.size(); ++k)
      length_m.back() +=
          (report.path[k].world_from_cam.translation - report.path[k - 10].world_from_cam.translation).norm();
  }
  EXPECT_NEAR(length_m[0] / length_m[1], 1.0, 0.006);
}

/// Errors that last from frame to frame, as of tracks that drift: taken for independent the path's σ would be four
/// times too small, and enlarged as if nothing but their sum counted twice too large.
TEST(SimpleCase, ErrorsThatLastAreHeeded) {
  constexpr int num_seeds = 6;
  double nees = 0.0;
  for (std::uint64_t seed = 1; seed <= num_seeds; ++seed) {
    const HoverRun run = testing::hovering({.num_frames = 120, .num_others = 24, .lasting = 0.9}, 4000 + seed);
    const Localization report = hover_localized(run, run.camera);
    EXPECT_TRUE(report.is_smoothed);
    EXPECT_NEAR(report.residuals.autocorrelation, 0.9, 0.06);
    nees += mean_nees(report, run) / num_seeds;
  }
  RecordProperty("nees", std::to_string(nees));
  EXPECT_GT(nees, 0.6);
  EXPECT_LT(nees, 1.4);
}

/// A camera drawn from its file's covariance: counted, the path's σ holds; unknown, it is many times too small.
TEST(SimpleCase, TheLensesCovarianceIsCounted) {
  const int num_seeds = testing::trials(16);
  double counted = 0.0, ignored = 0.0;
  Draws draws(77);
  for (int seed = 1; seed <= num_seeds; ++seed) {
    const HoverRun run =
        testing::hovering({.num_frames = 60, .num_others = 30}, 500 + static_cast<std::uint64_t>(seed));
    Camera given = run.camera;
    Eigen::VectorXd values = params(given.lens), sigma = Eigen::VectorXd::Zero(values.size());
    sigma.head<4>() << 4.0, 4.0, 3.0, 3.0;
    sigma[5] = 0.004;  // k1
    for (Eigen::Index i = 0; i < values.size(); ++i) values[i] += sigma[i] * draws.normal();
    given.lens = with_params(given.lens, values);
    ignored += mean_nees(hover_localized(run, given), run) / num_seeds;
    given.cov = sigma.cwiseAbs2().asDiagonal();
    counted += mean_nees(hover_localized(run, given), run) / num_seeds;
  }
  RecordProperty("counted", std::to_string(counted));
  EXPECT_GT(counted, 0.7);
  EXPECT_LT(counted, 1.3);
  EXPECT_GT(ignored, 2.0 * counted);
}

bool has_state(const Verdict& verdict, State state, const std::string& text) {
  return verdict.state == state && (verdict.sentence + verdict.to_add).find(text) != std::string::npos;
}

TEST(SimpleCase, ACameraWithoutCovarianceIsSaidAndNotGood) {
  const HoverRun run = testing::hovering({.num_frames = 90}, 3);
  const Localization report = hover_localized(run, run.camera);
  EXPECT_TRUE(has_state(report.verdict, State::care, "is given without σ")) << report.verdict.sentence;
  // The check tells the truth: a focal length off by 0.3 % moves the path as much as it says.
  const auto assumed = report.assumed;
  const auto focal = std::ranges::find(assumed, std::string("camera.f (relative)"), &Assumption::name);
  ASSERT_NE(focal, assumed.end());
  Camera longer = run.camera;
  Eigen::VectorXd values = params(longer.lens);
  values.head<2>() *= 1.003;
  longer.lens = with_params(longer.lens, values);
  const Localization moved = hover_localized(run, longer);
  double most = 0.0;
  for (std::size_t k = 0; k < report.path.size(); ++k) {
    const PathStep &is = report.path[k], &was = moved.path[k];
    const Rigid3 step = is.world_from_cam.inverse() * was.world_from_cam;
    Eigen::Vector<double, 6> e;
    e << step.translation, log_so3(step.rotation);
    most = std::max(most, e.cwiseQuotient(is.cov.diagonal().cwiseSqrt()).cwiseAbs().maxCoeff());
  }
  EXPECT_NEAR(focal->moves / most, 1.0, 0.15);  // the target's points give way a little, in second order
  Camera exact = run.camera;
  exact.cov = Eigen::MatrixXd::Zero(10, 10);
  EXPECT_EQ(hover_localized(run, exact).verdict.state, State::good) << hover_localized(run, exact).verdict.sentence;
}

TEST(SimpleCase, AWrongLensIsNamed) {
  const HoverRun run = testing::hovering({.num_frames = 90}, 4);
  Camera wrong = run.camera;
  wrong.cov = Eigen::MatrixXd::Zero(10, 10);
  Eigen::VectorXd values = params(wrong.lens);
  values.head<2>() *= 1.03;
  wrong.lens = with_params(wrong.lens, values);
  const Verdict verdict = hover_localized(run, wrong).verdict;
  EXPECT_NE(verdict.state, State::good);
  EXPECT_NE(verdict.sentence.find("focal length"), std::string::npos) << verdict.sentence;
}

/// As a mirrored target, or a mirrored image, leaves it.
TEST(SimpleCase, ATargetSeenFromBehindIsAskedAbout) {
  HoverRun run = testing::hovering({.num_frames = 60}, 5);
  run.camera.cov = Eigen::MatrixXd::Zero(10, 10);
  for (KnownPoint& point : run.target) point.point_in_world.x() *= -1.0;
  LocalizeConfig config;
  config.target.points = run.target;
  const Localization report = localize(run.frames, run.camera, config);
  EXPECT_TRUE(report.is_behind);
  const Verdict verdict = report.verdict;
  EXPECT_TRUE(has_state(verdict, State::care, "mirrored?")) << verdict.sentence;
  config.target.board = Board{.cols = 3, .rows = 2};
  EXPECT_EQ(localize(run.frames, run.camera, config).verdict.exit_code, ExitCode::undetermined);
  config.target.board.reset();
  config.target.seen_from_plus_z = true;
  EXPECT_FALSE(localize(run.frames, run.camera, config).is_behind);
}

}  // namespace
}  // namespace alidade
