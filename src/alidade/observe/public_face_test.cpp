#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <map>

#include "alidade/observe.h"
#include "alidade/observe/solve/solve.h"
#include "alidade/simulate/rotation.h"
#include "alidade/simulate/turned_scene.h"

// The whole job through its public header: the same values as from the parts, rows one by one as all at once, and an
// answer to every misuse.

namespace alidade {
namespace face_of_observe {

constexpr double nan = std::numeric_limits<double>::quiet_NaN(), inf = std::numeric_limits<double>::infinity();

RotationLog any_log(double duration_s = 4.0, RotationSource source = RotationSource::rate) {
  RotationScene scene;
  scene.start_px = draw_points(780, 582, 6, 1);
  scene.motion = paper_rate;
  if (source == RotationSource::head) scene.motion = [](double t_s) { return paper_pan_tilt(t_s, 0.0); };
  RotationLogConfig config;
  config.duration_s = duration_s;
  config.source = source;
  return simulate_rotation(scene, config, 1);
}

ObserveConfig sized() { return {.width_px = 780, .height_px = 582}; }

std::string fault_of(const ObserveConfig& config, RotationLog log = any_log(1.0)) {
  try {
    (void)observe(std::move(log), config);
  } catch (const ConfigError& error) {
    return error.what();
  }
  return "";
}

TEST(ObserveFace, IsTheWholeJob) {
  const RotationLog log = any_log();
  const ObserveReport report = observe(log, sized());
  ASSERT_TRUE(report.verdict.ok()) << report.verdict.sentence;
  const ObserveSetup setup = setup_of(sized());
  EXPECT_TRUE(setup.estimate_auto);
  const ObserveSolution part = solve_intrinsics(log, setup);
  EXPECT_EQ(report.covariance, part.covariance);
  EXPECT_EQ(report.counts.given, log.rows.size());
  EXPECT_EQ(report.counts.used, part.rows_used);
  EXPECT_EQ(report.verdict.sentence, observe_verdict(part, log, setup).sentence);
  EXPECT_EQ(params(report.camera.lens)[0], part.quantities[0].value);
  EXPECT_EQ(report.camera.cov(0, 0), report.covariance(0, 0));
  EXPECT_NEAR(report.quantities[0].value, 710.0, 5.0 * report.quantities[0].sigma);
  EXPECT_FALSE(report.size_is_guessed);
  EXPECT_FALSE(report.residuals.empty());
}

/// Each step of the filter is the one that the report of all rows has, and the reports are the same, to the last digit.
TEST(ObserveFace, RowsOneByOneGiveWhatAllGive) {
  for (const RotationSource source : {RotationSource::rate, RotationSource::head}) {
    const RotationLog log = any_log(4.0, source);
    ObserveConfig config = sized();
    config.estimate = {"none"};
    RotationLog layout = log;
    layout.rows.clear();
    layout.truth.clear();
    Observer observer(layout, config), by_hand({.source = source}, config);
    const ObserveReport all = observe(log, config);
    for (std::size_t k = 0; k < log.rows.size(); ++k) {
      const RotationRow& row = log.rows[k];
      const ObserveStep step = observer.push(row, log.truth[k]);
      const Eigen::Vector3d& rotation = source == RotationSource::head ? row.pan_tilt_roll_rad : row.rate_rad_per_s;
      EXPECT_EQ(by_hand.push(row.t_s, rotation, row.px).estimate.values(), step.estimate.values());
      EXPECT_EQ(step.t_s, row.t_s);
      if (k + 1 == log.rows.size()) break;  // the report's last row is of all rows together
      EXPECT_EQ(step.estimate.has_value, all.steps[k].has_value) << k;
      EXPECT_EQ(step.estimate.values(), all.steps[k].values()) << k;
    }
    const ObserveReport one_by_one = observer.finish();
    EXPECT_EQ(one_by_one.covariance, all.covariance);
    EXPECT_EQ(params(one_by_one.camera.lens), params(all.camera.lens));
    EXPECT_EQ(one_by_one.verdict.sentence, all.verdict.sentence);
    EXPECT_EQ(one_by_one.log.truth, all.log.truth);
  }
}

/// A stream without end keeps its newest rows: the end is what they say by themselves, and it is said.
TEST(ObserveFace, OfALongStreamTheNewestRowsAreKept) {
  const RotationLog log = any_log(8.0, RotationSource::head);
  ObserveConfig config = sized();
  config.estimate = {"none"};
  RotationLog layout = log;
  layout.rows.clear();
  layout.truth.clear();
  Observer whole(layout, config);
  config.keep_rows = 100;
  Observer observer(layout, config);
  ASSERT_GT(log.rows.size(), 200u);
  for (std::size_t k = 0; k < log.rows.size(); ++k) {
    const ObserveStep step = observer.push(log.rows[k], log.truth[k]);
    EXPECT_EQ(step.estimate.values(), whole.push(log.rows[k], log.truth[k]).estimate.values())
        << "the filter forgets nothing";
  }
  EXPECT_EQ(observer.num_rows(), log.rows.size());
  const ObserveReport live = observer.finish();
  ASSERT_GE(live.log.rows.size(), 100u);
  ASSERT_LT(live.log.rows.size(), 200u);
  RotationLog newest = log;
  const auto forgotten = static_cast<long>(log.rows.size() - live.log.rows.size());
  newest.rows.erase(newest.rows.begin(), newest.rows.begin() + forgotten);
  newest.truth.erase(newest.truth.begin(), newest.truth.begin() + forgotten);
  EXPECT_EQ(params(observe(newest, config).camera.lens), params(live.camera.lens));
  EXPECT_EQ(live.verdict.checks.back().name, "newest rows");
}

TEST(ObserveFace, AnswersEveryHostileNumber) {
  const auto refuses = [](const auto& spoil) {
    ObserveConfig config = sized();
    spoil(config);
    EXPECT_NE(fault_of(config), "");
  };
  for (const double bad : {nan, inf, -inf, -1.0}) {
    refuses([bad](ObserveConfig& config) { config.sigma_px = bad; });
    refuses([bad](ObserveConfig& config) { config.sigma_angle_rad = bad; });
    refuses([bad](ObserveConfig& config) { config.sigma_rate_rad_per_s = bad; });
    refuses([bad](ObserveConfig& config) { config.sigma_range_m = bad; });
    refuses([bad](ObserveConfig& config) { config.sigma_scale = bad; });
    refuses([bad](ObserveConfig& config) { config.sigma_parallax = bad; });
    refuses([bad](ObserveConfig& config) { config.window_s = bad; });
    refuses([bad](ObserveConfig& config) { config.max_gap_s = bad; });
    refuses([bad](ObserveConfig& config) { config.start = Eigen::Vector4d(bad, 700.0, 390.0, 290.0); });
    refuses([bad](ObserveConfig& config) {
      config.camera = Camera{780, 582, *make_lens("pinhole"), {}, 0.0, ""};
      config.camera->lens = with_params(config.camera->lens, Eigen::VectorXd::Constant(5, bad));
    });
    if (bad == -1.0) continue;
    refuses([bad](ObserveConfig& config) { config.start = Eigen::Vector4d(700.0, 700.0, bad, 290.0); });
    refuses([bad](ObserveConfig& config) { config.lever_m = Eigen::Vector3d(0.0, bad, 0.0); });
  }
  refuses([](ObserveConfig& config) { config.width_px = -780; });
  refuses([](ObserveConfig& config) { config.height_px = 0; });
  refuses([](ObserveConfig& config) { config.camera = Camera{}; });
  refuses([](ObserveConfig& config) {
    config.camera = Camera{780, 582, *make_lens("pinhole"), {}, 0.0, ""};
    config.camera->lens = with_params(config.camera->lens, Eigen::VectorXd::Constant(5, 600.0));
    config.camera->cov = -Eigen::MatrixXd::Identity(5, 5);
  });
  refuses([](ObserveConfig& config) { config.method = static_cast<ObserveMethod>(77); });
  refuses([](ObserveConfig& config) { config.rotation = static_cast<RotationKnowledge>(77); });
  refuses([](ObserveConfig& config) { config.profile = static_cast<FangProfile>(77); });
}

TEST(ObserveFace, AnswersWordsThatDoNotFit) {
  const auto with_words = [](std::vector<std::string> words) {
    ObserveConfig config = sized();
    config.estimate = std::move(words);
    return config;
  };
  EXPECT_THAT(fault_of(with_words({"k9"})), ::testing::HasSubstr("--estimate: 'k9' is not auto, none, k1,"));
  EXPECT_THAT(fault_of(with_words({"none", "k1"})), ::testing::HasSubstr("none goes with no other word"));
  EXPECT_THAT(fault_of(with_words({"backlash"})), ::testing::HasSubstr("has no such error"));
  ObserveConfig config = with_words({"scale"});
  config.sigma_scale = 0.0;
  EXPECT_THAT(fault_of(config), ::testing::HasSubstr("given as exact"));
  config = with_words({"k1"});
  config.method = ObserveMethod::flow;
  EXPECT_THAT(fault_of(config), ::testing::HasSubstr("--method flow knows neither --estimate"));
  config = with_words({"bias"});
  config.rotation = RotationKnowledge::free;
  EXPECT_THAT(fault_of(config), ::testing::HasSubstr("is for a rotation that is measured"));
}

TEST(ObserveFace, EveryFieldIsWrittenAsItIsRead) {
  const std::map<std::string, std::string> texts{{"method", "batch"},
                                                 {"rotation", "noisy"},
                                                 {"estimate", "k1"},
                                                 {"start", "500,510,400,300"},
                                                 {"size", "640x480"},
                                                 {"profile", "quiet"},
                                                 {"lever_m", "0,0,-1"},
                                                 {"square_pixels", "true"},
                                                 {"no_zoom", "true"},
                                                 {"fixed_centre", "true"},
                                                 {"sigma_px", "0.5"},
                                                 {"sigma_angle_rad", "0.001"},
                                                 {"sigma_range_m", "0.01"},
                                                 {"sigma_scale", "0"},
                                                 {"window_s", "3"},
                                                 {"keep_rows", "5000"},
                                                 {"sigma_rate_rad_per_s", "0.02"},
                                                 {"sigma_parallax", "0.002"}};
  ObserveConfig config;
  const FieldList fields = fields_of(config);
  EXPECT_EQ(fields.size(), texts.size());
  for (const Field& field : fields) {
    ASSERT_TRUE(texts.contains(field.name)) << field.name;
    EXPECT_EQ(set_field(field, texts.at(field.name)), "");
    EXPECT_EQ(value_text(field), texts.at(field.name));
  }
  EXPECT_EQ(config.method, ObserveMethod::batch);
  EXPECT_EQ(config.start, Eigen::Vector4d(500.0, 510.0, 400.0, 300.0));
  EXPECT_NO_THROW(check_config(config));
}

TEST(ObserveFace, AnswersLogsThatCannotBe) {
  const auto refuses = [](const std::string& what, const auto& spoil) {
    RotationLog log = any_log(1.0);
    spoil(log);
    EXPECT_THAT(fault_of(sized(), log), ::testing::HasSubstr(what));
  };
  refuses("not a finite number within 1e12 s", [](RotationLog& log) { log.rows.back().t_s = 1e300; });
  refuses("truth is not finite", [](RotationLog& log) {
    log.truth.assign(log.rows.size(), {500.0, 500.0, 320.0, std::nan("")});
  });
  refuses("row 3 of the log: its time", [](RotationLog& log) { log.rows[3].t_s = nan; });
  refuses("time must not go back", [](RotationLog& log) { log.rows[3].t_s = -1.0; });
  refuses("5 pixels", [](RotationLog& log) { log.rows[3].px.pop_back(); });
  refuses("beyond", [](RotationLog& log) { log.rows[3].px[0].x() = 1e300; });
  refuses("its rotation", [](RotationLog& log) { log.rows[3].rate_rad_per_s.x() = inf; });
  refuses("its velocity", [](RotationLog& log) { log.rows[3].velocity_m_per_s.x() = nan; });
  refuses("truth", [](RotationLog& log) { log.truth.pop_back(); });
  refuses("range", [](RotationLog& log) { log.range_point = 77; });
  refuses("within 0 to 1", [](RotationLog& log) { log.sigma_scale = nan; });
  refuses("no rotation", [](RotationLog& log) { log.source = RotationSource::none; });
  refuses("quaternion", [](RotationLog& log) {
    log.source = RotationSource::attitude;
    for (RotationRow& row : log.rows) row.base_from_cam = Eigen::Quaterniond(5.0, 0.0, 0.0, 0.0);
  });
}

TEST(ObserveFace, AnswersEmptyInput) {
  EXPECT_EQ(observe(RotationLog{}).verdict.exit_code, ExitCode::undetermined);
  EXPECT_EQ(observe(Photos{}).verdict.exit_code, ExitCode::undetermined);
  EXPECT_EQ(observe(MatchedPhotos{}).verdict.exit_code, ExitCode::undetermined);
  EXPECT_THROW((void)observe(Photos{.names = {"a"}, .load = nullptr}), ConfigError);
  RotationLog unseen = any_log(1.0);
  for (RotationRow& row : unseen.rows) row.px.assign(row.px.size(), Eigen::Vector2d::Constant(not_seen));
  EXPECT_EQ(observe(unseen).verdict.exit_code, ExitCode::undetermined);
  unseen.rows.resize(1);
  unseen.truth.clear();
  EXPECT_EQ(observe(unseen).verdict.exit_code, ExitCode::undetermined);
  EXPECT_THROW(Observer(RotationLog{}, {}), ConfigError) << "without a size";
  EXPECT_THROW(Observer(unseen, sized()), ConfigError) << "with rows";
  ObserveConfig errors = sized();
  errors.estimate = {"bias"};
  EXPECT_THROW(Observer(RotationLog{}, errors), ConfigError);
  EXPECT_THROW((void)Observer(RotationLog{}, sized()).push(RotationRow{}), ConfigError) << "no points";
  EXPECT_EQ(Observer(RotationLog{}, sized()).finish().verdict.exit_code, ExitCode::undetermined);
}

TEST(ObserveFace, MatchesOfARotatedCameraTellItAndWrongOnesAreAnswered) {
  TurnedScene scene;
  const MatchedPhotos matches = simulate_turned_photos(scene, 1);
  const ObserveReport report = observe(matches, {.square_pixels = true});
  ASSERT_TRUE(report.verdict.ok()) << report.verdict.sentence;
  EXPECT_NEAR(report.quantities[0].value, scene.fx, 4.0 * report.quantities[0].sigma);
  EXPECT_EQ(report.photos.size(), matches.names.size());
  EXPECT_EQ(report.counts.given, matches.names.size());
  const auto refuses = [&](const ObserveConfig& config, const auto& spoil) {
    MatchedPhotos bad = matches;
    spoil(bad);
    EXPECT_THROW((void)observe(std::move(bad), config), ConfigError);
  };
  refuses({}, [](MatchedPhotos& bad) { bad.names.pop_back(); });
  refuses({}, [](MatchedPhotos& bad) { bad.features[0][0].x() = nan; });
  refuses({}, [](MatchedPhotos& bad) { bad.pairs[0].photo_b = 77; });
  refuses({}, [](MatchedPhotos& bad) { std::swap(bad.pairs[0].photo_a, bad.pairs[0].photo_b); });
  refuses({}, [](MatchedPhotos& bad) { bad.pairs[0].matches[0].a = -1; });
  const auto as_is = [](MatchedPhotos&) {};
  refuses({.rotation = RotationKnowledge::noisy}, as_is);
  refuses({.estimate = {"mount"}}, as_is);
  refuses({.estimate = {"scale"}}, as_is);
  refuses({.lever_m = Eigen::Vector3d::Zero()}, as_is);
}

TEST(ObserveFace, PlansTheNextMovesOfAReport) {
  const ObserveReport report = observe(any_log(), sized());
  const MovePlan plan = plan_moves(observed_now(report), {.moves = 1});
  ASSERT_TRUE(plan.verdict.ok());
  EXPECT_LT(plan.moves[0].sigma_px[0], report.quantities[0].sigma);
  EXPECT_THROW((void)observed_now(observe(RotationLog{})), ConfigError);
  EXPECT_THROW((void)plan_moves(ObservedNow{}), ConfigError);
  EXPECT_THROW((void)plan_moves(observed_now(report), {.moves = 77}), ConfigError);
  EXPECT_THROW((void)plan_moves(observed_now(report), {.rate_deg_s = nan}), ConfigError);
  ObservedNow unseen = observed_now(report);
  unseen.points_px.clear();
  EXPECT_EQ(plan_moves(unseen).verdict.exit_code, ExitCode::undetermined);
}

}  // namespace face_of_observe
}  // namespace alidade
