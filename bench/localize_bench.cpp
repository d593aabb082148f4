/// Processor times of the localisation filter by the size of its state: localize_bench [--benchmark_filter=...]
#include <benchmark/benchmark.h>

#include <algorithm>
#include <chrono>
#include <string>

#include "alidade/localize.h"
#include "alidade/testing/localize_sample.h"
#include "alidade/testing/room_video.h"
#include "run_benchmarks.h"

namespace alidade::bench {
namespace {

/// A filter with so many features around a known target, after a second of frames, and the observations of the next
/// one.
struct Ready {
  LocalizationFilter filter;
  std::vector<FeatureObservation> observations;
};

Ready ready(int num_features, FeatureKind kind) {
  UnderwaterScene scene;
  scene.camera = underwater_camera();
  scene.num_points = num_features;
  scene.num_frames = 6;
  scene.dt_s = 1.0 / 30.0;
  const testing::UnderwaterSample sample = testing::underwater_sample(scene, 1);
  LocalizationFilterConfig config;
  // As large as the map, as in a run: a larger one would not be in the cache after it was copied.
  config.state_capacity = motion_dim + 3 * static_cast<int>(sample.config.target.points.size()) + 6 * num_features;
  config.observations_capacity = 320;
  config.linear_below = kind == FeatureKind::xyz ? 1e9 : 0.0;
  Ready made{LocalizationFilter(sample.camera, sample.config.start->motion, sample.config.start->cov, config), {}};
  for (const KnownPoint& point : sample.config.target.points)
    made.filter.add_known(point.id, point.point_in_world, point.sigma_m);
  for (const ObservationFrame& frame : sample.frames) {
    made.filter.predict(scene.dt_s);
    made.observations = frame.observations;
    if (&frame == &sample.frames.back()) break;
    (void)made.filter.update(frame.observations);
    for (const FeatureObservation& observation : frame.observations)
      made.filter.add(observation.id, observation.px, {0.7, 0.1});
    made.filter.convert_linear();
  }
  return made;
}

/// The update, mean and covariance, with the first `max_observations` features measured; what it needs of copies is not
/// timed.
void time_update(benchmark::State& state, int num_features, FeatureKind kind, std::size_t max_observations) {
  Ready at = ready(num_features, kind);
  if (at.observations.size() > max_observations) at.observations.resize(max_observations);
  LocalizationFilter filter = at.filter;
  for (auto _ : state) {
    state.PauseTiming();
    filter = at.filter;
    state.ResumeTiming();
    benchmark::DoNotOptimize(filter.update(at.observations).num_used);
  }
  state.counters["state"] = at.filter.dim();
  state.counters["observations"] = static_cast<double>(at.observations.size());
}

/// Prediction and the expected position of every feature: what a search in images needs before each frame.
void time_expected(benchmark::State& state, int num_features) {
  const Ready at = ready(num_features, FeatureKind::inverse_depth);
  LocalizationFilter filter = at.filter;
  for (auto _ : state) {
    filter.predict(1e-9);
    for (const Feature& feature : filter.features()) benchmark::DoNotOptimize(filter.expected(feature.id));
  }
  state.counters["state"] = filter.dim();
}

/// An image of 640×480, from pixels to pose, with a state of at least 350 and 60 features found in it: the median of
/// two seconds of film of a room, rendered beforehand.
void time_frames(benchmark::State& state) {
  testing::RoomScene scene;
  scene.camera = testing::room_camera();
  scene.camera.width_px = 640;
  scene.camera.height_px = 480;
  Params<KannalaBrandt> lens = Params<KannalaBrandt>::Zero();
  lens.head<4>() << 390.0, 390.0, 319.5, 239.5;
  scene.camera.lens = Calibrated<KannalaBrandt>{lens};
  scene.num_frames = 60;
  std::vector<cv::Mat> film;
  for (const Rigid3& world_from_cam : testing::room_path(scene))
    film.push_back(testing::render_room(scene, world_from_cam, film.size()));
  LocalizeConfig config;
  config.filter.sigma_a_m_s2 = 4.0;
  config.filter.sigma_alpha_rad_s2 = 6.0;
  config.seconds = [] {
    return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
  };
  config.target = rectangle_target(scene.rectangle_width_m, scene.rectangle_height_m);
  config.features.min_found = 100;
  config.features.max_tried = config.features.max_features = 120;
  for (auto _ : state) {
    std::size_t at = 0;
    const NextImage next = [&](cv::Mat& grey, long& frame, double& t_s) {
      if (at == film.size()) return false;
      grey = film[at];
      frame = static_cast<long>(at);
      t_s = static_cast<double>(at++) / scene.rate_hz;
      return true;
    };
    const Localization report = localize(ImageStream{next, film.size()}, scene.camera, config);
    std::vector<double> seconds, found, features;
    for (const PathStep& step : report.path) {
      seconds.push_back(step.seconds);
      found.push_back(static_cast<double>(step.num_tracked));
      features.push_back(static_cast<double>(step.num_features));
    }
    const auto median = [](std::vector<double>& of) {
      std::ranges::nth_element(of, of.begin() + static_cast<std::ptrdiff_t>(of.size() / 2));
      return of[of.size() / 2];
    };
    state.SetIterationTime(median(seconds));
    state.counters["found"] = median(found);
    state.counters["features"] = median(features);
    state.counters["state_at_least"] = 12.0 + 3.0 * median(features);  // were all of them positions
  }
}

void add_all() {
  benchmark::RegisterBenchmark("frame/640x480", time_frames)
      ->UseManualTime()
      ->Iterations(5)
      ->Unit(benchmark::kMillisecond);
  for (const int num_features : {8, 25, 54, 84, 104, 154, 204, 304}) {
    const std::string end = "/" + std::to_string(num_features);
    benchmark::RegisterBenchmark(("update/inverse_depth" + end).c_str(), [=](benchmark::State& state) {
      time_update(state, num_features, FeatureKind::inverse_depth, 1000);
    })->Unit(benchmark::kMillisecond);
    benchmark::RegisterBenchmark(("update/inverse_depth/of_30" + end).c_str(), [=](benchmark::State& state) {
      time_update(state, num_features, FeatureKind::inverse_depth, 30);  // as many as are looked for in an image
    })->Unit(benchmark::kMillisecond);
    benchmark::RegisterBenchmark(("update/xyz" + end).c_str(), [=](benchmark::State& state) {
      time_update(state, num_features, FeatureKind::xyz, 1000);
    })->Unit(benchmark::kMillisecond);
    benchmark::RegisterBenchmark(("expected" + end).c_str(), [=](benchmark::State& state) {
      time_expected(state, num_features);
    })->Unit(benchmark::kMillisecond);
  }
}

}  // namespace
}  // namespace alidade::bench

int main(int argc, char** argv) { return alidade::bench::run_benchmarks(argc, argv, alidade::bench::add_all); }
