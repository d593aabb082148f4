#include <gtest/gtest.h>

#include <cmath>

#include "alidade/testing/calibration_sample.h"

// Does the stated σ cover the error, where the model is true and where the corners of a photo share errors?

namespace alidade {
namespace {

constexpr int photos_of_a_set = 13;
const std::vector<int> estimated_lens{0, 1, 2, 3, 5, 6, 7, 8, 9};  // of brown, all but the skew

struct SigmaCoverage {
  double inside_1 = 0.0, inside_2 = 0.0, model_2 = 0.0, count = 0.0, runs = 0.0;
  Eigen::VectorXd mean = Eigen::VectorXd::Zero(9), square = Eigen::VectorXd::Zero(9);

  /// Scatter of the inflation of σ over its mean, in the mean over the parameters.
  [[nodiscard]] double variation() const {
    const Eigen::ArrayXd m = mean.array() / runs;
    return ((square.array() / runs - m * m).max(0.0).sqrt() / m).mean();
  }
};

SigmaCoverage coverage_of_sigma(double shared_px, int runs, int photos = photos_of_a_set,
                                const CalibrateConfig& config = {}) {
  const Camera camera = testing::sample_camera("brown");
  const Eigen::VectorXd truth = params(camera.lens);
  SigmaCoverage found;
  for (int run = 0; run < runs; ++run) {
    const auto seed = static_cast<std::uint64_t>(run + 1);
    const BoardScene scene = testing::sample_scene(camera, photos, seed);
    std::vector<BoardView> views = simulate_views(scene, 0.1, seed + 10000);
    add_shared_errors(scene, shared_px, seed + 20000, views);
    const CalibrateReport report = calibrate(testing::sample_board, views, testing::sample_size, config);
    if (report.status != CalibrateReport::Status::converged) continue;
    found.runs += 1.0;
    const Eigen::VectorXd error = params(report.camera.lens) - truth;
    for (std::size_t i = 0; i < estimated_lens.size(); ++i) {
      const int at = estimated_lens[i];
      const double sigma = std::sqrt(report.camera.cov(at, at)), model = std::sqrt(report.model_cov(at, at));
      found.inside_1 += std::abs(error[at]) < sigma ? 1.0 : 0.0;
      found.inside_2 += std::abs(error[at]) < 2.0 * sigma ? 1.0 : 0.0;
      found.model_2 += std::abs(error[at]) < 2.0 * model ? 1.0 : 0.0;
      found.mean[static_cast<Eigen::Index>(i)] += sigma / model;
      found.square[static_cast<Eigen::Index>(i)] += sigma * sigma / (model * model);
      found.count += 1.0;
    }
  }
  for (double* value : {&found.inside_1, &found.inside_2, &found.model_2}) *value /= found.count;
  return found;
}

// A share of 1500 runs scatters by 1.2 % at 1σ and .5 % at 2σ, of nine correlated parameters by somewhat less.
TEST(HonestSigma, CoversWhereTheModelIsTrue) {
  const SigmaCoverage found = coverage_of_sigma(0.0, 1500);
  ASSERT_EQ(found.runs, 1500.0);
  EXPECT_NEAR(found.inside_1, 0.683, 0.04);
  EXPECT_NEAR(found.inside_2, 0.954, 0.02);
  EXPECT_LT(found.variation(), 0.25);
}

TEST(HonestSigma, CoversErrorsThatThePhotosCornersShare) {
  const SigmaCoverage found = coverage_of_sigma(0.1, 1500);
  ASSERT_EQ(found.runs, 1500.0);
  EXPECT_GT(found.inside_2, 0.90);
  EXPECT_LT(found.inside_2, 0.98);
  EXPECT_LT(found.model_2, 0.75);  // what σ of single corners would cover
  EXPECT_LT(found.variation(), 0.25);
}

TEST(HonestSigma, CoversSharedErrorsOfFewPhotos) {
  const SigmaCoverage found = coverage_of_sigma(0.1, 1000, 7);
  ASSERT_EQ(found.runs, 1000.0);
  EXPECT_GT(found.inside_2, 0.90);
  EXPECT_LT(found.inside_2, 0.98);
}

// A board with all points free adapts to the errors of few photos: their residuals show less of them.
TEST(HonestSigma, CoversSharedErrorsOfFewPhotosWithAFreeBoard) {
  const SigmaCoverage found = coverage_of_sigma(0.1, 300, 7, {.board_shape = BoardShape::free});
  ASSERT_EQ(found.runs, 300.0);
  EXPECT_GT(found.inside_2, 0.90);
  EXPECT_LT(found.inside_2, 0.98);
  EXPECT_LT(found.model_2, 0.75);
}

TEST(HonestSigma, CoversWhereTheModelIsTrueWithAFreeBoard) {
  const SigmaCoverage found = coverage_of_sigma(0.0, 300, 7, {.board_shape = BoardShape::free});
  ASSERT_EQ(found.runs, 300.0);
  EXPECT_NEAR(found.inside_1, 0.683, 0.04);
  EXPECT_NEAR(found.inside_2, 0.954, 0.02);
}

}  // namespace
}  // namespace alidade
