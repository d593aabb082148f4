#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <optional>

#include "alidade/geometry/degree.h"
#include "alidade/simulate/draws.h"
#include "alidade/simulate/rig.h"
#include "alidade/testing/rig_sample.h"
#include "alidade/testing/rig_trial.h"
#include "alidade/testing/trials.h"

// What may be wrong with a rig, each alone: never a good verdict over an error above 5σ, and what is distinguishable is
// estimated. ALIDADE_TEST_TRIALS=20 draws as many rigs of each kind; bench/study_causes.cpp: from which size each is
// detected.

namespace alidade {
namespace {

using testing::rig_trial;
using testing::RigTrial;
using testing::RigTrialSetup;

int num_rigs() { return std::min(100, testing::trials(3)); }

struct RigFault {
  const char* name;
  std::function<void(RigTrialSetup&)> set;
};

class RigFaults : public ::testing::TestWithParam<RigFault> {};

TEST_P(RigFaults, AreNeverSilent) {
  for (int draw = 1; draw <= num_rigs(); ++draw) {
    RigTrialSetup setup;
    GetParam().set(setup);
    const RigTrial trial = rig_trial(setup, static_cast<std::uint64_t>(300 + draw));
    EXPECT_FALSE(trial.is_silent()) << GetParam().name << " " << draw << ": " << trial.worst_sigmas
                                    << "σ: " << trial.verdict.sentence;
  }
}

// Of each a size that is hardly seen, and one that is plain.
INSTANTIATE_TEST_SUITE_P(
    All, RigFaults,
    ::testing::Values(
        RigFault{"scale_small", [](RigTrialSetup& s) { s.scene.encoder_scale = 1.001; }},
        RigFault{"scale", [](RigTrialSetup& s) { s.scene.encoder_scale = 1.01; }},
        RigFault{"scale_of_one",
                 [](RigTrialSetup& s) { s.scene.encoder_scale = 1.005, s.scene.first_encoder_only = true; }},
        RigFault{"once_small", [](RigTrialSetup& s) { s.scene.once_rad = 0.3 * degree; }},
        RigFault{"once", [](RigTrialSetup& s) { s.scene.once_rad = 3.0 * degree; }},
        RigFault{"twice", [](RigTrialSetup& s) { s.noise.twice_rad = 0.3 * degree; }},
        RigFault{"backlash_small", [](RigTrialSetup& s) { s.noise.backlash_rad = 0.05 * degree; }},
        RigFault{"backlash", [](RigTrialSetup& s) { s.noise.backlash_rad = 0.3 * degree; }},
        RigFault{"focal_small", [](RigTrialSetup& s) { s.mistake.focal = 0.003; }},
        RigFault{"focal", [](RigTrialSetup& s) { s.mistake.focal = 0.02; }},
        RigFault{"focal_stated",
                 [](RigTrialSetup& s) { s.mistake.focal = 0.005, s.sigma_lens_px = 0.3, s.first_lens_only = true; }},
        RigFault{"centre_small", [](RigTrialSetup& s) { s.mistake.centre_px = 2.0; }},
        RigFault{"centre", [](RigTrialSetup& s) { s.mistake.centre_px = 8.0; }},
        RigFault{"swapped_angles", [](RigTrialSetup& s) { s.mistake.swap_angles = true; }},
        RigFault{"flipped_pan", [](RigTrialSetup& s) { s.mistake.flip_pan = true; }},
        RigFault{"mirrored", [](RigTrialSetup& s) { s.mistake.mirror = true; }},
        RigFault{"half_pan", [](RigTrialSetup& s) { s.mistake.pan_read = 0.5; }},
        RigFault{"double_pan", [](RigTrialSetup& s) { s.mistake.pan_read = 2.0; }},
        RigFault{"turned_corners", [](RigTrialSetup& s) { s.mistake.turn_corners = true; }},
        RigFault{"moved_boards_little", [](RigTrialSetup& s) { s.scene.sigma_moved_m = 0.0005; }},
        RigFault{"moved_boards", [](RigTrialSetup& s) { s.scene.sigma_moved_m = 0.002; }},
        RigFault{"shifted_rows", [](RigTrialSetup& s) { s.mistake.shift_rows = true; }}),
    [](const auto& info) { return std::string(info.param.name); });

const RigFreed* freed_named(const RigTrial& trial, const std::string& name) {
  for (const RigFreed& one : trial.report.freed)
    if (one.name == name) return &one;
  return nullptr;
}

TEST(RigByNeed, EstimatesTheEncodersScaleAndSaysSo) {
  RigTrialSetup setup;
  setup.scene.encoder_scale = 1.01;
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    const RigTrial trial = rig_trial(setup, seed);
    const RigFreed* const scale = freed_named(trial, "head1.pan_scale");
    ASSERT_TRUE(scale) << seed;
    EXPECT_NEAR(scale->value, 1.01, 4.0 * scale->sigma);
    EXPECT_LT(scale->sigma, 0.01);
    EXPECT_LT(trial.worst_sigmas, 5.0);
    EXPECT_EQ(trial.verdict.state, State::care);  // the user took it for exact
    EXPECT_TRUE(std::ranges::any_of(trial.verdict.checks, [](const Check& check) {
      return check.name == "estimated" && check.text.find("head1.pan_scale") != std::string::npos;
    }));
  }
}

TEST(RigByNeed, EstimatesBacklashAndCountsHalfOfItAsNoiseOfReadings) {
  RigTrialSetup setup;
  setup.noise.backlash_rad = 0.3 * degree;
  setup.scene.max_views_of_a_board = 6;
  int found = 0;
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    const RigTrial trial = rig_trial(setup, seed);
    const RigFreed* const backlash = freed_named(trial, "head1.pan_backlash_rad");
    if (backlash == nullptr) continue;
    ++found;
    EXPECT_NEAR(backlash->value, 0.3 * degree, 4.0 * backlash->sigma + 0.03 * degree);
    EXPECT_GE(trial.report.rig.heads[0].head.encoder.sigma_rad, 0.4 * backlash->value);
  }
  EXPECT_GE(found, 2);
}

TEST(RigByNeed, LeavesACleanRigAsItIs) {
  int freed = 0;
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    const RigTrial trial = rig_trial({}, seed);
    for (const RigCause& cause : trial.report.causes) freed += cause.sigmas > rig_cause_limit ? 1 : 0;
    for (const RigFreed& one : trial.report.freed)
      EXPECT_LT(std::abs(one.value - one.was), 4.5 * one.sigma) << one.name;
  }
  EXPECT_EQ(freed, 0);
}

TEST(RigByNeed, BoardsMovedBetweenTheHeadsViewsAreNamedAndNothingAbsorbsIt) {
  const int draws = testing::trials(4);
  int num_all = 0;
  for (int draw = 1; draw <= draws; ++draw) {
    RigTrialSetup setup;
    setup.scene.num_boards = 8;
    setup.scene.sigma_moved_m = draw % 2 == 0 ? 0.001 : 0.003;
    const RigTrial trial = rig_trial(setup, static_cast<std::uint64_t>(draw));
    const auto named = std::ranges::find(trial.verdict.checks, "causes", &Check::name);
    const bool is_one_board = trial.verdict.sentence.find("moved between view") != std::string::npos;
    if (is_one_board) continue;  // refused: one of them was moved most
    ++num_all;
    ASSERT_NE(named, trial.verdict.checks.end()) << draw << ": " << trial.verdict.sentence << trial.verdict.to_add;
    EXPECT_EQ(named->state, State::care) << draw;
    EXPECT_NE(named->text.find("boards were moved"), std::string::npos) << draw << ": " << named->text;
    for (const RigFreed& one : trial.report.freed) EXPECT_LT(one.sigmas(), 4.0) << draw << ": " << one.name;
    const auto cause = std::ranges::find_if(trial.report.causes, &RigCause::is_of_boards);
    EXPECT_NEAR(cause->size, std::sqrt(3.0) * setup.scene.sigma_moved_m,
                0.5 * std::sqrt(3.0) * setup.scene.sigma_moved_m);
  }
  EXPECT_GE(2 * num_all, draws);
}

/// Of what the table says of one head alone, or of a board that was moved, the verdict says which.
void expect_named(const std::string& words,
                  const std::function<void(const RigScene&, std::uint64_t, std::vector<HeadView>&)>& change,
                  const RigSceneConfig& config = {}) {
  const auto draws = static_cast<std::uint64_t>(testing::trials(1));
  for (std::uint64_t seed = 1; seed <= draws; ++seed) {
    const RigScene scene = draw_rig_scene(config, seed);
    std::vector<HeadView> views = simulate_head_views(scene, {}, seed).views;
    change(scene, seed, views);
    const RigReport report = calibrate_rig(views, points_in_board(scene.board), testing::cameras_of(scene.rig), {});
    const Verdict verdict = rig_verdict(report, {});
    EXPECT_EQ(verdict.exit_code, ExitCode::undetermined) << seed;
    EXPECT_NE(verdict.sentence.find(words), std::string::npos)
        << seed << ": " << verdict.sentence << report.views_dropped << " rejected, "
        << report.sigma_encoder_rad / degree;
  }
}

TEST(RigTable, ExchangedAnglesOfOneHeadAreNamed) {
  expect_named("pan and tilt of head 2 are exchanged",
               [](const RigScene&, std::uint64_t, std::vector<HeadView>& views) {
                 for (HeadView& view : views)
                   if (view.head == 2) view.pan_tilt_rad.reverseInPlace();
               });
}

TEST(RigTable, AnglesOfTheViewBeforeOfOneHeadAreNamed) {
  expect_named("the angles of head 2 are those of the view before",
               [](const RigScene&, std::uint64_t, std::vector<HeadView>& views) {
                 std::optional<Eigen::Vector2d> before;
                 for (HeadView& view : views) {
                   if (view.head != 2) continue;
                   const Eigen::Vector2d own = view.pan_tilt_rad;
                   if (before) view.pan_tilt_rad = *before;
                   before = own;
                 }
               });
}

TEST(RigTable, HalfAndDoubleAnglesOfAnAxisAreNamed) {
  const auto scale = [](int head, const Eigen::Vector2d& by) {
    return [head, by](const RigScene&, std::uint64_t, std::vector<HeadView>& views) {
      for (HeadView& view : views)
        if (head == 0 || view.head == head) view.pan_tilt_rad = view.pan_tilt_rad.cwiseProduct(by);
    };
  };
  expect_named("the pan angles of head 2 are half of what the head turns", scale(2, {0.5, 1.0}));
  expect_named("the tilt angles of head 1 are half of what the head turns", scale(1, {1.0, 0.5}));
  expect_named("the pan angles of head 1 are twice what the head turns", scale(1, {2.0, 1.0}));
  expect_named("the angles are half of what the head turns", scale(0, {0.5, 0.5}));
  expect_named("the pan angles of head 2 are half of what the head turns",
               [](const RigScene& scene, std::uint64_t, std::vector<HeadView>& views) {
                 views = mistaken_views(std::move(views), scene, {.pan_read = 0.5});
               });
}

/// How often a solve's rounds were begun.
int num_rounds(const std::vector<HeadView>& views, const RigScene& scene) {
  int rounds = 0;
  const Progress count = [&rounds](std::string_view what, std::size_t, std::size_t) {
    rounds += what == "solve" ? 1 : 0;
    return true;
  };
  (void)calibrate_rig(views, points_in_board(scene.board), testing::cameras_of(scene.rig), {}, count);
  return rounds;
}

/// A view in five has its corners from the other end: no reading of the table, and no move of a board, explains these.
TEST(RigTable, ViewsThatContradictEachOtherAreNotTriedForLong) {
  RigSceneConfig config;
  config.num_boards = 10;
  for (std::uint64_t seed = 1; seed <= 2; ++seed) {
    const RigScene scene = draw_rig_scene(config, seed);
    std::vector<HeadView> views = simulate_head_views(scene, {}, seed).views;
    const int clean = num_rounds(views, scene);
    for (std::size_t v = 0; v < views.size(); v += 5)
      for (Corner& corner : views[v].seen.corners) corner.index = 53 - corner.index;
    EXPECT_LT(num_rounds(views, scene), 10 * clean) << seed << ": " << clean;
  }
}

TEST(RigTable, CornersFromTheOtherEndOfTheBoardAreNamed) {
  const auto turn = [](const RigScene& scene, std::uint64_t, std::vector<HeadView>& views) {
    views = mistaken_views(std::move(views), scene, {.turn_corners = true});
  };
  for (const int num_boards : {3, 5, 8})
    expect_named("the corners of head 2 are numbered from the other end of the board than those of head 1", turn,
                 {.num_boards = num_boards});
}

TEST(RigTable, AHeadMostOfWhoseViewsAreRejectedIsNoResult) {
  const RigScene scene = draw_rig_scene({}, 1);
  RigReport report = calibrate_rig(simulate_head_views(scene, {}, 1).views, points_in_board(scene.board),
                                   testing::cameras_of(scene.rig), {});
  ASSERT_EQ(report.status, RigReport::Status::converged);
  ASSERT_EQ(report.covers[1].num_used, report.covers[1].num_views);
  // As if most of the second head's: fewer than 40 % of all.
  int left = report.covers[1].num_views * 6 / 10;
  for (auto view = report.views.rbegin(); left > 0; ++view, --left) view->used = false;
  report.covers[1].num_used -= report.covers[1].num_views * 6 / 10;
  const Verdict verdict = rig_verdict(report, {});
  EXPECT_EQ(verdict.exit_code, ExitCode::no_convergence);
  EXPECT_NE(verdict.sentence.find("of head 2"), std::string::npos) << verdict.sentence;
}

/// A single view so is named.
TEST(RigTable, AViewWithItsCornersFromTheOtherEndIsNamed) {
  const RigScene scene = draw_rig_scene({}, 1);
  std::vector<HeadView> views = simulate_head_views(scene, {}, 1).views;
  for (Corner& corner : views[7].seen.corners) corner.index = 53 - corner.index;
  const RigReport report = calibrate_rig(views, points_in_board(scene.board), testing::cameras_of(scene.rig), {});
  ASSERT_EQ(report.status, RigReport::Status::converged);
  EXPECT_EQ(report.views[7].reason, "outlier: its corners are numbered from the other end of the board");
}

/// Lenses bend by a k1 of −0.015 that their files, a pinhole's, do not have: a pixel at the image's corners.
TEST(RigTable, DistortionThatALensDoesNotHaveIsNamed) {
  RigSceneConfig config;
  config.max_views_of_a_board = 6;
  int named = 0;
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    const RigScene scene = draw_rig_scene(config, seed);
    std::vector<HeadView> views = simulate_head_views(scene, {}, seed).views;
    const Eigen::VectorXd lens = params(scene.rig.heads[0].camera.lens);
    for (HeadView& view : views) {
      for (Corner& corner : view.seen.corners) {
        const Eigen::Vector2d out = corner.px - lens.segment<2>(2);
        corner.px -= 0.015 * (out / lens[0]).squaredNorm() * out;
      }
    }
    RigConfig exact;
    exact.sigma_square_m = exact.sigma_scale = 1e-9;
    const RigReport report =
        calibrate_rig_by_need(views, points_in_board(scene.board), testing::cameras_of(scene.rig), exact, {});
    const Verdict verdict = rig_verdict(report, exact);
    EXPECT_NE(verdict.state, State::good) << seed << ": " << verdict.sentence;
    named += verdict.to_add.find("camera.k1") != std::string::npos ? 1 : 0;
  }
  EXPECT_GE(named, 3);
}

/// A lens file that is off by what it says, in k1 and k2 that are known together better than alone: no cause, neither
/// of the distortion nor of what it looks like, a focal length or an error of an encoder.
TEST(RigTable, DistortionWithinTheSigmaOfItsFileIsNoCause) {
  RigSceneConfig config;
  config.max_views_of_a_board = 6;
  config.num_boards = 8;
  constexpr double sigma_k1 = 0.03, sigma_k2 = 0.12, rho = -0.85;
  int named = 0, named_by_exact = 0, others = 0;
  for (std::uint64_t seed = 1; seed <= 8; ++seed) {
    const RigScene scene = draw_rig_scene(config, seed);
    Draws draws(seed + 5);
    std::map<int, Camera> cameras = testing::cameras_of(scene.rig), exact;
    for (auto& [id, camera] : cameras) {
      const Eigen::VectorXd pinhole = params(camera.lens);
      const double a = draws.normal(), b = draws.normal();
      const double k1 = sigma_k1 * a, k2 = sigma_k2 * (rho * a + std::sqrt(1.0 - rho * rho) * b);
      camera.lens =
          Calibrated<Brown>{Params<Brown>{pinhole[0], pinhole[1], pinhole[2], pinhole[3], 0, k1, k2, 0, 0, 0}};
      camera.cov.setZero(10, 10);
      exact[id] = camera;
      camera.cov(5, 5) = sigma_k1 * sigma_k1;
      camera.cov(6, 6) = sigma_k2 * sigma_k2;
      camera.cov(5, 6) = camera.cov(6, 5) = rho * sigma_k1 * sigma_k2;
    }
    const std::vector<HeadView> views = simulate_head_views(scene, {}, seed).views;
    const auto num_named = [&](const std::map<int, Camera>& given, bool of_distortion) {
      const RigReport report = calibrate_rig(views, points_in_board(scene.board), given, {});
      return std::ranges::count_if(report.causes, [&](const RigCause& cause) {
        return cause.is_distortion() == of_distortion && cause.sigmas > rig_cause_limit;
      });
    };
    named += num_named(cameras, true) > 0 ? 1 : 0;
    others += num_named(cameras, false) > 0 ? 1 : 0;
    named_by_exact += num_named(exact, true) > 0 ? 1 : 0;
  }
  EXPECT_EQ(named, 0);
  EXPECT_EQ(others, 0);
  EXPECT_GE(named_by_exact, 3);
}

/// What happens to a head while its views are taken is named: never a good verdict over an error above 5σ.
void expect_drift_named(const std::function<void(const RigScene&, double, HeadView&)>& change) {
  RigSceneConfig config;
  config.max_views_of_a_board = 6;
  constexpr std::uint64_t draws = 6;
  int named = 0;
  for (std::uint64_t seed = 1; seed <= draws; ++seed) {
    const RigScene scene = draw_rig_scene(config, seed);
    std::vector<HeadView> views = simulate_head_views(scene, {}, seed).views;
    for (std::size_t v = 0; v < views.size(); ++v)
      if (views[v].head == 1) change(scene, static_cast<double>(v) / static_cast<double>(views.size()), views[v]);
    RigConfig exact;
    exact.sigma_square_m = exact.sigma_scale = 1e-9;
    const RigReport report =
        calibrate_rig_by_need(views, points_in_board(scene.board), testing::cameras_of(scene.rig), exact, {});
    const Verdict verdict = rig_verdict(report, exact);
    EXPECT_NE(verdict.state, State::good) << seed << ": " << verdict.sentence;
    named += verdict.to_add.find(" drift from the first view to the last") != std::string::npos ? 1 : 0;
  }
  EXPECT_GE(named, 5);
}

TEST(RigTable, AZeroThatCreepsIsNamed) {
  expect_drift_named([](const RigScene&, double time, HeadView& view) {
    view.pan_tilt_rad += Eigen::Vector2d(0.5, 0.2) * time * degree;
  });
}

/// Its tripod was knocked in the middle.
TEST(RigTable, AHeadThatMovedIsNamed) {
  expect_drift_named([](const RigScene& scene, double time, HeadView& view) {
    if (time < 0.5) return;
    RigHead moved = scene.rig.heads[0];
    moved.head.world_from_base =
        moved.head.world_from_base.retract(Eigen::Vector<double, 6>(0.003, 0.001, 0.003, 0.001, 0.005, 0.002));
    const std::vector<Eigen::Vector3d> points = points_in_board(scene.board);
    for (Corner& corner : view.seen.corners) {
      const Eigen::Vector3d at =
          scene.world_from_board[static_cast<std::size_t>(view.board)] * points[static_cast<std::size_t>(corner.index)];
      const auto before = project(scene.rig.heads[0], view.pan_tilt_rad, at);
      const auto after = project(moved, view.pan_tilt_rad, at);
      ASSERT_TRUE(before && after);
      corner.px += after->px - before->px;
    }
  });
}

/// Between the views of the first head and those of the second it was moved by 3 cm.
TEST(RigTable, ABoardThatMovedIsNamed) {
  RigSceneConfig config;
  config.max_views_of_a_board = 6;
  config.num_boards = 8;
  const auto move = [](const RigScene& scene, std::uint64_t, std::vector<HeadView>& views) {
    constexpr int board = 2;
    const std::vector<Eigen::Vector3d> points = points_in_board(scene.board);
    for (HeadView& view : views) {
      if (view.board != board || view.head != 2) continue;
      for (Corner& corner : view.seen.corners) {
        const Eigen::Vector3d at = scene.world_from_board[board] * points[static_cast<std::size_t>(corner.index)];
        const auto before = project(scene.rig.heads[1], view.pan_tilt_rad, at);
        const auto after = project(scene.rig.heads[1], view.pan_tilt_rad, at + Eigen::Vector3d(0.03, 0.0, 0.01));
        ASSERT_TRUE(before && after);
        corner.px += after->px - before->px;
      }
    }
  };
  expect_named("board 2 moved between", move, config);
}

}  // namespace
}  // namespace alidade
