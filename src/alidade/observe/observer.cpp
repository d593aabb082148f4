#include "alidade/observe/observer.h"

#include <utility>

#include "alidade/estimation/config_error.h"
#include "alidade/observe.h"
#include "alidade/observe/solve/solve.h"
#include "alidade/pantilt/recent_rows.h"

namespace alidade {
namespace {

ObserveSetup stream_setup(const RotationLog& layout, const ObserveConfig& config) {
  if (!layout.rows.empty() || !layout.truth.empty()) throw ConfigError("the layout of rows to come has rows itself");
  ObserveSetup setup = setup_of(config);
  if (!setup.estimate_errors.empty()) {
    throw ConfigError("errors of the rotation are estimated from a whole log: keep the rows in a file");
  }
  if (setup.width_px <= 0) throw ConfigError("say --size WxH or --camera FILE, the first rows do not determine it");
  check_log(layout);
  return setup;
}

}  // namespace

ObserveStep step_of(const RotationFrame& frame, const IntrinsicsEstimate& estimate) {
  return {frame.t_s, estimate, frame.rate_rad_per_s, frame.cam_from_start.conjugate()};
}

struct Observer::State {
  State(RotationLog layout, const ObserveConfig& given)
      : config(given),
        setup(stream_setup(layout, given)),
        log(std::move(layout)),
        reader(log.source, setup.max_gap_s) {}

  void begin(std::size_t num_points) {
    if (log.num_points == 0) log.num_points = num_points;
    if (log.num_points == 0) throw ConfigError("the first row says how many points there are, and has none");
    hybrid.emplace(hybrid_config(log, setup, pixel_scale(log, setup.width_px, setup.height_px)));
  }

  ObserveConfig config;
  ObserveSetup setup;
  RotationLog log;
  std::optional<HybridObserver> hybrid;
  MotionReader reader;
  std::size_t num_forgotten = 0;
};

Observer::Observer(RotationLog layout, const ObserveConfig& config)
    : state_(std::make_unique<State>(std::move(layout), config)) {}
Observer::~Observer() = default;
Observer::Observer(Observer&&) noexcept = default;
Observer& Observer::operator=(Observer&&) noexcept = default;

ObserveStep Observer::push(RotationRow row, const std::optional<TrueIntrinsics>& truth) {
  State& state = *state_;
  RotationLog& log = state.log;
  if (!state.hybrid) state.begin(row.px.size());
  check_row(row, num_rows(), log, log.rows.empty() ? row.t_s : log.rows.back().t_s);
  if (truth.has_value() != !log.truth.empty() && !log.rows.empty()) {
    throw ConfigError("either every row has a truth, or none");
  }
  log.rows.push_back(row);
  if (truth) log.truth.push_back(*truth);
  const auto keep = static_cast<std::size_t>(state.config.keep_rows);
  state.num_forgotten += forget_oldest(log.rows, keep);
  (void)forget_oldest(log.truth, keep);
  if (state.setup.lens_is_given) undistort(*state.config.camera, Eigen::Vector2d::Constant(not_seen), row.px);
  const RotationFrame frame = state.reader.next(row);
  ObserveStep step =
      step_of(frame, log.source == RotationSource::none ? IntrinsicsEstimate{} : state.hybrid->step(frame));
  step.truth = truth;
  return step;
}

ObserveStep Observer::push(double t_s, const Eigen::Vector3d& rotation, std::span<const Eigen::Vector2d> px) {
  RotationRow row;
  row.t_s = t_s;
  if (state_->log.source == RotationSource::attitude) throw ConfigError("rows of this log have a quaternion");
  (state_->log.source == RotationSource::head ? row.pan_tilt_roll_rad : row.rate_rad_per_s) = rotation;
  row.px.assign(px.begin(), px.end());
  return push(std::move(row));
}

ObserveStep Observer::push(double t_s, const Eigen::Quaterniond& base_from_cam, std::span<const Eigen::Vector2d> px) {
  if (state_->log.source != RotationSource::attitude) throw ConfigError("rows of this log have no quaternion");
  RotationRow row;
  row.t_s = t_s;
  row.base_from_cam = base_from_cam;
  row.px.assign(px.begin(), px.end());
  return push(std::move(row));
}

std::size_t Observer::num_rows() const { return state_->num_forgotten + state_->log.rows.size(); }

ObserveReport Observer::finish(const Progress& progress) const {
  ObserveReport report = observe(state_->log, state_->config, progress);
  add_recent_rows(state_->num_forgotten, state_->log.rows.size(), "rows", report.verdict);
  return report;
}

}  // namespace alidade
