#include "alidade/calibrate/calibrate.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <numeric>
#include <opencv2/calib3d.hpp>

#include "alidade/calibrate/setup.h"
#include "alidade/geometry/decompositions.h"
#include "alidade/simulate/boards/board_photos.h"

namespace alidade {
namespace {

constexpr ImageSize size{800, 600};
const Board board{.cols = 9, .rows = 6, .square_m = 0.03};

Camera example_camera(const std::string& model) {
  Camera camera;
  camera.width_px = size.width_px;
  camera.height_px = size.height_px;
  camera.lens = *make_lens(model);
  Eigen::VectorXd values = params(camera.lens);
  values.head<5>() << 700, 705, 395, 305, 0;
  if (model == "brown") values.tail<5>() << -0.25, 0.1, 8e-4, -6e-4, -0.02;
  if (model == "kannala_brandt") values.tail<4>() << 0.02, -0.01, 2e-3, -5e-4;
  camera.lens = with_params(camera.lens, values);
  return camera;
}

BoardScene example_scene(const std::string& model, int num_photos, BoardSceneConfig config = {}) {
  config.num_photos = num_photos;
  return draw_board_scene(example_camera(model), board, config, 11);
}

/// error² in units of the reported covariance, over the parameters that were free.
double mahalanobis2(const Camera& found, const Camera& truth, const std::vector<int>& free) {
  const auto n = static_cast<Eigen::Index>(free.size());
  Eigen::VectorXd error(n);
  Eigen::MatrixXd cov(n, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    error[i] =
        params(found.lens)[free[static_cast<std::size_t>(i)]] - params(truth.lens)[free[static_cast<std::size_t>(i)]];
    for (Eigen::Index j = 0; j < n; ++j) {
      cov(i, j) = found.cov(free[static_cast<std::size_t>(i)], free[static_cast<std::size_t>(j)]);
    }
  }
  return squared_mahalanobis(error, cov);
}

std::vector<int> all_but_skew(const Camera& camera) {
  std::vector<int> free(static_cast<std::size_t>(params(camera.lens).size()));
  std::iota(free.begin(), free.end(), 0);
  free.erase(free.begin() + 4);
  return free;
}

class CalibrateModel : public ::testing::TestWithParam<std::string> {};

TEST_P(CalibrateModel, IsAsWrongAsItSaysAndNoMore) {
  const BoardScene scene = example_scene(GetParam(), 15);
  const auto report = calibrate(board, simulate_views(scene, 0.1, 5), size, {.model = GetParam()});
  ASSERT_EQ(report.status, CalibrateReport::Status::converged) << report.reason;
  EXPECT_NEAR(report.noise_px, 0.1, 5 * 0.1 / std::sqrt(2.0 * 2 * 54 * 15));               // five σ of an estimated σ
  EXPECT_LT(mahalanobis2(report.camera, scene.camera, all_but_skew(scene.camera)), 42.7);  // χ²(≤ 9) at < 10⁻⁵
}

TEST_P(CalibrateModel, IsExactWithoutNoise) {
  const BoardScene scene = example_scene(GetParam(), 8);
  auto views = simulate_views(scene, 0.1, 5);
  for (std::size_t k = 0; k < views.size(); ++k) {
    const auto truth = true_corners(scene, k);
    for (Corner& corner : views[k].corners) {
      corner.px = truth[static_cast<std::size_t>(corner.index)];
      corner.cov.setIdentity();
    }
  }
  const auto report = calibrate(board, views, size, {.model = GetParam()});
  ASSERT_EQ(report.status, CalibrateReport::Status::converged) << report.reason;
  const Eigen::VectorXd error = params(report.camera.lens) - params(scene.camera.lens);
  EXPECT_LT(error.head<5>().norm(), 1e-5);
  EXPECT_LT(report.rms_px, 1e-7);
}

INSTANTIATE_TEST_SUITE_P(Models, CalibrateModel, ::testing::Values("pinhole", "brown", "kannala_brandt"));

TEST(Calibrate, FindsOpenCvsOptimumOnTheSameCorners) {
  const auto views = simulate_views(example_scene("brown", 12), 0.2, 7);
  std::vector<std::vector<cv::Point3f>> object;
  std::vector<std::vector<cv::Point2f>> image;
  std::vector<BoardView> rounded = views;  // OpenCV takes floats: give both the same
  for (BoardView& view : rounded) {
    object.emplace_back();
    image.emplace_back();
    for (Corner& corner : view.corners) {
      const Eigen::Vector3d point = points_in_board(board)[static_cast<std::size_t>(corner.index)];
      image.back().emplace_back(static_cast<float>(corner.px.x()), static_cast<float>(corner.px.y()));
      // Millimetres are whole numbers: exact as floats.
      object.back().emplace_back(static_cast<float>(std::round(1000 * point.x())),
                                 static_cast<float>(std::round(1000 * point.y())), 0.0f);
      corner.px = Eigen::Vector2d(image.back().back().x, image.back().back().y);
    }
  }
  cv::Mat K, distortion;
  std::vector<cv::Mat> rotations, translations;
  const double rms =
      cv::calibrateCamera(object, image, {size.width_px, size.height_px}, K, distortion, rotations, translations, 0,
                          {cv::TermCriteria::COUNT + cv::TermCriteria::EPS, 200, 1e-14});
  const auto report = calibrate(board, rounded, size, {});
  ASSERT_EQ(report.status, CalibrateReport::Status::converged);
  const Eigen::VectorXd ours = params(report.camera.lens);
  EXPECT_NEAR(ours[0], K.at<double>(0, 0), 1e-3);
  EXPECT_NEAR(ours[1], K.at<double>(1, 1), 1e-3);
  EXPECT_NEAR(ours[2], K.at<double>(0, 2), 1e-3);
  EXPECT_NEAR(ours[3], K.at<double>(1, 2), 1e-3);
  for (int i = 0; i < 5; ++i) EXPECT_NEAR(ours[5 + i], distortion.at<double>(i), 1e-5);
  EXPECT_NEAR(report.rms_px, rms, 1e-6);
}

TEST(Calibrate, CoversTheTruthAsOftenAsItsSigmaSays) {
  const BoardScene scene = example_scene("brown", 8);
  const auto free = all_but_skew(scene.camera);
  constexpr int runs = 200;
  int inside1 = 0, inside2 = 0, cases = 0;
  double sum = 0.0;
  for (int run = 0; run < runs; ++run) {
    const auto report = calibrate(board, simulate_views(scene, 0.1, 1000 + static_cast<std::uint64_t>(run)), size, {});
    ASSERT_EQ(report.status, CalibrateReport::Status::converged);
    sum += mahalanobis2(report.camera, scene.camera, free);
    for (const int at : free) {
      const double z = std::abs(params(report.camera.lens)[at] - params(scene.camera.lens)[at]) /
                       std::sqrt(report.camera.cov(at, at));
      inside1 += z < 1.0;
      inside2 += z < 2.0;
      ++cases;
    }
  }
  ASSERT_EQ(cases, 9 * runs);
  // The nine are correlated: take the runs, not the cases, as the sample when saying how far chance reaches.
  EXPECT_NEAR(static_cast<double>(inside1) / cases, 0.6827, 3 * std::sqrt(0.68 * 0.32 / runs));
  EXPECT_NEAR(static_cast<double>(inside2) / cases, 0.9545, 3 * std::sqrt(0.95 * 0.05 / runs));
  EXPECT_NEAR(sum / runs, 9.0, 4 * std::sqrt(18.0 / runs));  // χ²(9): variance 18
}

TEST(Calibrate, NamesWrongCornersAndLeavesThemOut) {
  const BoardScene scene = example_scene("brown", 12);
  auto views = simulate_views(scene, 0.1, 9);
  for (const std::size_t k : {1u, 4u, 4u, 7u}) views[k].corners[10 + k].px += Eigen::Vector2d(4.0, -3.0);
  const auto report = calibrate(board, views, size, {});
  ASSERT_EQ(report.status, CalibrateReport::Status::converged);
  EXPECT_EQ(report.corners_dropped, 3);
  for (const std::size_t k : {1u, 4u, 7u}) EXPECT_FALSE(report.views[k].corners[10 + k].used);
  EXPECT_LT(mahalanobis2(report.camera, scene.camera, all_but_skew(scene.camera)), 42.7);
}

TEST(Calibrate, OneCornerHoweverFarOffIsNamedAndNothingElse) {
  const BoardScene scene = example_scene("brown", 12);
  for (const BoardShape shape : {BoardShape::flat, BoardShape::free}) {
    for (const double far_px : {1e3, 1e4, 1e5, 1e9}) {
      auto views = simulate_views(scene, 0.1, 9);
      views[1].corners[17].px.x() = far_px;
      CalibrateConfig config;
      config.board_shape = shape;
      const auto report = calibrate(board, views, size, config);
      ASSERT_EQ(report.status, CalibrateReport::Status::converged) << report.reason;
      EXPECT_EQ(report.corners_dropped, 1) << far_px;
      EXPECT_EQ(report.corners_used, 12 * 54 - 1) << far_px;
      EXPECT_FALSE(report.views[1].corners[17].used);
      EXPECT_LT(mahalanobis2(report.camera, scene.camera, all_but_skew(scene.camera)), 42.7);
    }
  }
}

TEST(Calibrate, ACornerFarOffThatIsToBeKeptIsNamedWhereNothingFits) {
  auto views = simulate_views(example_scene("brown", 12), 0.1, 9);
  views[1].corners[17].px.x() = 1e5;
  CalibrateConfig config;
  config.outliers = OutlierRule::keep;
  const auto report = calibrate(board, views, size, config);
  ASSERT_EQ(report.status, CalibrateReport::Status::no_convergence);
  EXPECT_NE(report.to_add.find(views[1].photo + ", corner 17"), std::string::npos) << report.to_add;
}

TEST(Calibrate, AImageGivenTwiceCountsOnce) {
  const BoardScene scene = example_scene("brown", 12);
  const auto views = simulate_views(scene, 0.1, 9);
  auto twice = views;
  for (BoardView view : views) {
    view.photo = "again_" + view.photo;
    twice.push_back(view);
  }
  const auto once = calibrate(board, views, size, {}), report = calibrate(board, twice, size, {});
  ASSERT_EQ(report.status, CalibrateReport::Status::converged);
  EXPECT_EQ(report.corners_used, 12 * 54);
  EXPECT_EQ(report.camera.cov, once.camera.cov);
  EXPECT_EQ(report.views[12].reason, "is the same image as " + views[0].photo);
}

TEST(Calibrate, DropsAPhotoOfAnotherBoardByName) {
  const BoardScene scene = example_scene("brown", 12);
  auto views = simulate_views(scene, 0.1, 9);
  std::reverse(views[5].corners.begin(), views[5].corners.end());
  for (std::size_t i = 0; i < views[5].corners.size(); ++i) {  // numbered down the columns: no rigid board is like it
    views[5].corners[i].index = static_cast<int>((i * 7) % 54);
  }
  const auto report = calibrate(board, views, size, {});
  ASSERT_EQ(report.status, CalibrateReport::Status::converged) << report.reason;
  EXPECT_FALSE(report.views[5].used);
  EXPECT_NE(report.views[5].reason.find("another board"), std::string::npos) << report.views[5].reason;
  EXPECT_LT(mahalanobis2(report.camera, scene.camera, all_but_skew(scene.camera)), 42.7);
}

TEST(Calibrate, TakesPartialBoards) {
  const BoardScene scene = example_scene("brown", 15);
  auto views = simulate_views(scene, 0.1, 9);
  for (std::size_t k = 0; k < views.size(); k += 2) views[k].corners.resize(20);
  const auto report = calibrate(board, views, size, {});
  ASSERT_EQ(report.status, CalibrateReport::Status::converged);
  EXPECT_LT(mahalanobis2(report.camera, scene.camera, all_but_skew(scene.camera)), 42.7);
}

TEST(Calibrate, HoldsWhatIsFixedAndHeedsPriors) {
  const auto views = simulate_views(example_scene("brown", 10), 0.1, 3);
  const auto held = calibrate(board, views, size, {.fixed = {"skew", "k3"}});
  EXPECT_EQ(params(held.camera.lens)[9], 0.0);
  EXPECT_EQ(held.camera.cov(9, 9), 0.0);
  const auto tight = calibrate(board, views, size, {.priors = {{"fx", 650.0, 1e-3}}});
  EXPECT_NEAR(params(tight.camera.lens)[0], 650.0, 0.05);
  const auto loose = calibrate(board, views, size, {.priors = {{"fx", 650.0, 1e6}}});
  const auto none = calibrate(board, views, size, {});
  EXPECT_NEAR(params(loose.camera.lens)[0], params(none.camera.lens)[0], 1e-2);
}

TEST(Calibrate, LearnsTheShapeOfABentBoard) {
  BoardSceneConfig config;
  config.bow_m = 0.003;
  config.shape_sigma_m = 0.00005;
  const BoardScene scene = example_scene("brown", 20, config);
  const auto views = simulate_views(scene, 0.05, 4);
  const auto flat = calibrate(board, views, size, {});
  const auto bow = calibrate(board, views, size, {.board_shape = BoardShape::bow});
  const auto free = calibrate(board, views, size, {.board_shape = BoardShape::free});
  ASSERT_EQ(free.status, CalibrateReport::Status::converged) << free.reason;
  EXPECT_GT(flat.noise_px, 2.0 * bow.noise_px);
  EXPECT_GT(bow.noise_px, 1.2 * free.noise_px);
  EXPECT_NEAR(free.noise_px, 0.05, 0.003);
  EXPECT_LT(mahalanobis2(free.camera, scene.camera, all_but_skew(scene.camera)), 42.7);
  const auto given = calibrate(board, views, size, {.board_shape = BoardShape::given}, free.board_points);
  EXPECT_NEAR(given.rms_px, free.rms_px, 1e-3);
}

TEST(Calibrate, RefusesWhatCannotBeDetermined) {
  const auto status = [](const std::vector<BoardView>& views, const CalibrateConfig& config = {}) {
    return calibrate(board, views, size, config);
  };
  const BoardScene scene = example_scene("brown", 10);
  const auto views = simulate_views(scene, 0.1, 3);
  int refused = 0;
  const auto expect_refused = [&](const CalibrateReport& report, const std::string& word) {
    EXPECT_EQ(report.status, CalibrateReport::Status::degenerate) << word;
    EXPECT_NE(report.reason.find(word), std::string::npos) << report.reason;
    EXPECT_FALSE(report.to_add.empty());
    ++refused;
  };
  expect_refused(status({}), "only 0");
  expect_refused(status({views[0], views[1]}), "only 2");
  expect_refused(status(std::vector<BoardView>(10, views[0])), "the same image");

  BoardScene still = scene;  // one position, but ten images
  for (Rigid3& pose : still.cam_from_board) pose = scene.cam_from_board[0];
  expect_refused(status(simulate_views(still, 0.1, 3)), "parallel");

  BoardScene frontal = scene;  // the same tilt everywhere
  for (Rigid3& pose : frontal.cam_from_board) {
    pose = Rigid3{exp_so3({0.3, 0.1, 0.0}), pose.translation};
  }
  std::vector<BoardView> parallel = simulate_views(frontal, 0.1, 3);
  expect_refused(status(parallel), "parallel");

  auto line = views;  // one row of corners
  for (BoardView& view : line) view.corners.resize(9);
  EXPECT_EQ(status(line).status, CalibrateReport::Status::degenerate);
  auto few = views;
  for (BoardView& view : few) view.corners.resize(4);
  expect_refused(status(few), "only 0");
  EXPECT_EQ(refused, 6);
}

TEST(Calibrate, TwoViewsDoWhereThePrincipalPointIsFixed) {
  BoardScene scene = example_scene("pinhole", 6);
  Eigen::VectorXd values = params(scene.camera.lens);
  values[2] = 0.5 * (size.width_px - 1);
  values[3] = 0.5 * (size.height_px - 1);
  scene.camera.lens = with_params(scene.camera.lens, values);
  const auto views = simulate_views(scene, 0.05, 3);
  const auto report = calibrate(board, {views.data(), 2}, size, {.model = "pinhole", .fixed = {"skew", "cx", "cy"}});
  ASSERT_EQ(report.status, CalibrateReport::Status::converged) << report.reason;
  EXPECT_LT(mahalanobis2(report.camera, scene.camera, {0, 1}), 25.0);
}

TEST(CalibrateConfigFaults, NameTheParameterAndTheKnownOnes) {
  EXPECT_TRUE(faults({}).empty());
  EXPECT_EQ(faults({.model = "fisheye"}).size(), 1u);
  EXPECT_EQ(faults({.fixed = {"k7"}}).front(),
            "'k7' is no parameter of model brown; it has fx, fy, cx, cy, skew, k1, k2, p1, p2, k3");
  EXPECT_FALSE(faults({.fixed = {"fx"}}).empty());
  EXPECT_FALSE(faults({.priors = {{"fx", 1.0, -1.0}}}).empty());
}

}  // namespace
}  // namespace alidade
