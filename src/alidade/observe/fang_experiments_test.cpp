#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <ostream>

#include "alidade/observe/filters/fang_observer.h"
#include "alidade/testing/rotation_sample.h"

// The paper's experiments on many sets of points: what of them holds, and what does not.

namespace alidade {
namespace {

using namespace testing;
using reproduce::draw_set;
using reproduce::flow_only_zoom_log;
using reproduce::mean_gramian_of;
using reproduce::paper_config;
using reproduce::zoom_log;

RotationLog clean_log(int set) {
  return simulate_rotation(paper_scene(draw_set(static_cast<std::uint64_t>(set) + 1)), {.sigma_px = 0.0}, 1);
}

RotationLog noisy_log(int set) {
  RotationLog log = clean_log(set);
  add_paper_noise(log, static_cast<std::uint64_t>(set) + 1000);
  return log;
}

/// One figure of every set, by name: its quantiles, and the share of sets within a limit.
struct Figures {
  std::vector<double> values;

  [[nodiscard]] double median() const { return quantile(values, 0.5); }
  [[nodiscard]] double share_within(double limit) const {
    const auto within = std::count_if(values.begin(), values.end(), [&](double value) { return value <= limit; });
    return static_cast<double>(within) / static_cast<double>(values.size());
  }
};

std::ostream& operator<<(std::ostream& out, const Figures& figures) {
  return out << "median " << figures.median() << ", nine in ten " << quantile(figures.values, 0.9);
}

/// Experiment 1, noise: time to 1 % and 5 %, RMS over 14 to 20 s.
struct NoiseFigures {
  Figures settle_1, settle_5;
  std::array<Figures, 4> rms;
};

NoiseFigures experiment_1(FangConfig config, bool planned, int num_sets) {
  NoiseFigures figures;
  for (int set = 0; set < num_sets; ++set) {
    if (planned) config.mean_gramian = mean_gramian_of(clean_log(set));
    const RotationLog log = noisy_log(set);
    FangObserver observer(config);
    const auto estimates = observe_log(observer, log);
    figures.settle_1.values.push_back(settle_s(log, estimates, 0.01, 0.0, 6.0));
    figures.settle_5.values.push_back(settle_s(log, estimates, 0.05, 0.0, 6.0));
    const Eigen::Vector4d rms = rms_px(log, estimates, 14.0, 20.0);
    for (std::size_t i = 0; i < 4; ++i) figures.rms[i].values.push_back(rms[static_cast<Eigen::Index>(i)]);
  }
  return figures;
}

// Limits of an independent Monte Carlo, its p90 rounded up.
TEST(FangExperiment1, NoiseLeavesTheKalmanProfileThreePixels) {
  const NoiseFigures figures = experiment_1(paper_config(FangProfile::kalman), false, 100);
  EXPECT_GE(figures.settle_5.share_within(2.2), 0.9) << figures.settle_5;
  const std::array<double, 4> limit_px{3.5, 5.0, 0.6, 0.6};
  for (std::size_t i = 0; i < 4; ++i) EXPECT_GE(figures.rms[i].share_within(limit_px[i]), 0.9) << figures.rms[i];
}

// That study has medians of 4.4 8.2 1.0 0.6 px with the gain of the motion as planned; half as much again is the
// difference that another draw of points makes.
TEST(FangExperiment1, NoiseLeavesTheQuietProfileEightPixels) {
  const NoiseFigures figures = experiment_1(paper_config(FangProfile::quiet), true, 50);
  const std::array<double, 4> limit_px{6.6, 12.3, 1.5, 0.9};
  for (std::size_t i = 0; i < 4; ++i) EXPECT_LE(figures.rms[i].median(), limit_px[i]) << figures.rms[i];
  EXPECT_GT(figures.settle_1.median(), 5.0);  // it takes twenty seconds
}

// The paper shows both in one section; no one constant gain does both.
TEST(FangExperiment1, NoiseMakesTheFastProfileUseless) {
  const NoiseFigures figures = experiment_1(paper_config(FangProfile::fast), true, 20);
  EXPECT_GT(figures.rms[0].median(), 100.0);  // or no value at all
}

TEST(FangExperiment2, FastSettlesAndSettlesAgainAfterABurst) {
  Figures settle, again;
  for (int set = 0; set < 100; ++set) {
    RotationLog log = clean_log(set);
    FangConfig config = paper_config(FangProfile::fast);
    config.mean_gramian = mean_gramian_of(log);
    reproduce::add_burst(log, 180, static_cast<std::uint64_t>(set) + 2000);
    FangObserver observer(config);
    const auto estimates = observe_log(observer, log);
    settle.values.push_back(settle_s(log, estimates, 0.01, 0.0, 5.99));
    again.values.push_back(settle_s(log, estimates, 0.01, 6.0, 20.0));
  }
  EXPECT_LT(settle.median(), 3.0) << settle;
  EXPECT_LE(again.median(), 2.5) << again;  // nine in ten: the docs say 5 s
}

RotationLog flow_only_log(int set) { return flow_only_zoom_log(draw_set(static_cast<std::uint64_t>(set) + 1)); }
RotationLog physical_zoom_log(int set) { return zoom_log(draw_set(static_cast<std::uint64_t>(set) + 1)); }

/// Experiment 3, clean: RMS on the ramp and after 14 s.
struct ZoomFigures {
  std::array<Figures, 4> ramp, after;
};

template <class MakeLog>
ZoomFigures experiment_3(MakeLog make_log, int num_sets) {
  ZoomFigures figures;
  for (int set = 0; set < num_sets; ++set) {
    const RotationLog log = make_log(set);
    FangConfig config = paper_config(FangProfile::fast);
    config.mean_gramian = mean_gramian_of(clean_log(set));
    FangObserver observer(config);
    const auto estimates = observe_log(observer, log);
    const Eigen::Vector4d ramp = rms_px(log, estimates, 6.0, 10.0), after = rms_px(log, estimates, 14.0, 20.0);
    for (std::size_t i = 0; i < 4; ++i) {
      figures.ramp[i].values.push_back(ramp[static_cast<Eigen::Index>(i)]);
      figures.after[i].values.push_back(after[static_cast<Eigen::Index>(i)]);
    }
  }
  return figures;
}

TEST(FangExperiment3, FastFollowsAZoomThatMovesNothing) {
  const ZoomFigures figures = experiment_3(flow_only_log, 60);
  // About 5 14 2 2 px in an independent study; nine in ten go to 16 35 6 4, so that two medians differ by a fifth.
  const std::array<double, 4> limit_px{6.0, 16.8, 2.4, 2.4};
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_LE(figures.ramp[i].median(), limit_px[i]) << figures.ramp[i];
    EXPECT_LT(figures.after[i].median(), 0.3) << figures.after[i];
  }
}

TEST(FangExperiment3, ButNotOneThatMovesTheImage) {
  const ZoomFigures figures = experiment_3(physical_zoom_log, 30);
  EXPECT_GT(figures.ramp[0].median(), 100.0);  // or no value; 590 px in that study
  for (std::size_t i = 0; i < 4; ++i) EXPECT_LT(figures.after[i].median(), 0.3) << figures.after[i];
}

TEST(FangObserver, OfTheSuppliedPointsIsWithinHalfAPixelAfterSixSeconds) {
  const RotationLog log = simulate_rotation(
      paper_scene({{180.0, 120.0}, {640.0, 90.0}, {560.0, 400.0}, {220.0, 360.0}}), {.sigma_px = 0.0}, 1);
  FangConfig config = paper_config(FangProfile::fast);
  for (const bool rates_at_ends : {false, true}) {
    config.rates_at_ends = rates_at_ends;
    FangObserver observer(config);
    const auto estimates = observe_log(observer, log);
    for (std::size_t r = 180; r < log.rows.size(); ++r)
      EXPECT_LT(error_px(log, estimates, r).cwiseAbs().maxCoeff(), 0.5) << rates_at_ends << " " << log.rows[r].t_s;
  }
}

TEST(FangObserver, NeedsTheColumnsOfRollOnAHead) {
  for (const double tilt_rad : {0.0, 0.35, 0.79}) {
    std::array<Figures, 2> fx;
    for (const bool roll_columns : {false, true}) {
      for (int set = 0; set < 20; ++set) {
        RotationScene scene = paper_scene(draw_set(static_cast<std::uint64_t>(set) + 1));
        scene.motion = [=](double t_s) { return paper_pan_tilt(t_s, tilt_rad); };
        const RotationLogConfig how{.source = RotationSource::head, .duration_s = 10.0, .sigma_px = 0.3};
        const RotationLog log = simulate_rotation(scene, how, static_cast<std::uint64_t>(set));
        FangConfig config = paper_config(FangProfile::kalman);
        config.roll_columns = roll_columns;
        FangObserver observer(config);
        fx[roll_columns].values.push_back(std::abs(error_px(log, observe_log(observer, log), log.rows.size() - 1)[0]));
      }
    }
    // In that study 150 to 480 px without them, and all fail; 2.5 to 4.5 px with, here half as much again for another
    // draw.
    EXPECT_GT(fx[0].median(), 50.0) << tilt_rad << " " << fx[0];
    EXPECT_LT(fx[1].median(), 1.5 * 4.5) << tilt_rad << " " << fx[1];
  }
}

TEST(FangObserver, SaysWhetherTheMotionAndThePointsSuffice) {
  const auto median_of = [](int num_points) {
    Figures lambda;
    for (int set = 0; set < 50; ++set) {
      const auto seed = static_cast<std::uint64_t>(set) + 1;
      FangConfig config = paper_config(FangProfile::fast);
      config.num_points = static_cast<std::size_t>(num_points);
      const RotationScene scene = num_points == 4 ? paper_scene(draw_set(seed)) : random_paper_scene(seed, num_points);
      FangObserver observer(config);
      (void)observe_log(observer, simulate_rotation(scene, {.duration_s = 10.0, .sigma_px = 0.0}, seed));
      lambda.values.push_back(observer.gramian_lambda_min());
    }
    return lambda.median();
  };
  EXPECT_LT(median_of(2), fang_refuse_lambda);  // 1.1·10⁻⁵ in that study
  EXPECT_LT(median_of(3), fang_warn_lambda);    // 2.2·10⁻⁴
  EXPECT_NEAR(median_of(4), 1.1e-3, 0.4e-3);    // of its median, for another draw
  EXPECT_NEAR(median_of(6), 3.0e-3, 1.0e-3);
  RotationScene scene = random_paper_scene(5);
  scene.motion = [](double t_s) { return Eigen::Vector3d(0.0, 0.12 * std::sin(1.6 * t_s), 0.0); };
  FangObserver pan_only(paper_config(FangProfile::fast));
  (void)observe_log(pan_only, simulate_rotation(scene, {.sigma_px = 0.3}, 5));
  EXPECT_LT(pan_only.gramian_lambda_min(), 1e-12);
}

}  // namespace
}  // namespace alidade
