#include "alidade/observe/solve/solve.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "alidade/geometry/so3.h"
#include "alidade/observe/filters/fang_observer.h"
#include "alidade/observe/filters/flow_filter.h"
#include "alidade/observe/filters/frame_variation.h"
#include "alidade/observe/filters/hybrid.h"
#include "alidade/observe/solve/reference_rows.h"
#include "alidade/observe/solve/solve_once.h"
#include "alidade/observe/solve/start_roll.h"

namespace alidade {
namespace {

constexpr std::size_t max_cells = 4000000;

/// One run over one log: frames, scale and initial guess are computed once, then the method and the reference are run.
class Observation {
 public:
  Observation(const RotationLog& log, const ObserveSetup& config, const std::vector<RotationError>& errors,
              const RotationErrors& undone, const Progress& progress)
      : log_(log), config_(config), errors_(errors), progress_(progress) {
    report_.width_px = config.width_px;
    report_.height_px = config.height_px;
    report_.scale = pixel_scale(log, report_.width_px, report_.height_px);
    report_.sigma_is_estimated = !config.sigma_px;
    report_.steps.resize(log.rows.size());
    config_.width_px = report_.width_px;
    config_.height_px = report_.height_px;
    config_.nuisances.errors = static_cast<int>(errors.size());
    start_ = start_camera(config_, report_.scale);
    start_.errors = RotationErrors::Zero(static_cast<Eigen::Index>(errors.size()));
    start_.undone = undone;
    if (!log.rows.empty()) start_.drift_from_s = log.rows.back().t_s;
  }

  ObserveSolution run() {
    make_frames();
    if (!enough_to_begin()) return std::move(report_);
    switch (config_.rotation == RotationKnowledge::known ? config_.method : ObserveMethod::batch) {
      case ObserveMethod::hybrid:
        run_hybrid();
        break;
      case ObserveMethod::window:
        run_window();
        break;
      case ObserveMethod::flow:
        run_flow();
        break;
      case ObserveMethod::fang2011:
        run_fang();
        break;
      case ObserveMethod::batch:
        break;
    }
    solve_reference();
    conclude();
    return std::move(report_);
  }

 private:
  void make_frames() {
    MotionReader reader(log_.source, config_.max_gap_s);
    for (const RotationRow& row : log_.rows) frames_.push_back(reader.next(row));
    Eigen::Quaterniond attitude = Eigen::Quaterniond::Identity();
    for (const RotationFrame& frame : frames_) {
      attitude = exp_so3(-frame.mean_rate_rad_per_s * frame.dt_s) * attitude;
      report_.motion.path_rad += frame.mean_rate_rad_per_s.cwiseAbs() * frame.dt_s;
      report_.motion.span_rad = std::max(report_.motion.span_rad, log_so3(attitude.normalized()).norm());
      const bool is_used = std::any_of(frame.px.begin(), frame.px.end(), is_seen);
      report_.rows_used += is_used ? 1 : 0;
    }
    if (log_.source == RotationSource::none) begin_free();
    if (config_.rotation != RotationKnowledge::known && log_.source != RotationSource::rate)
      take_central_rates(config_.max_gap_s, frames_);
    if (log_.source != RotationSource::none && config_.nuisances.mount)
      start_.cam_from_mount = exp_so3({0.0, 0.0, start_roll(frames_)});
    add_turns(log_, errors_, config_.max_gap_s, frames_);
  }

  void begin_free() {
    const auto start = free_rotation_start(log_, report_.scale);
    if (!start) return;
    if (!config_.start) start_.k.head<2>().setConstant(start->focal);
    for (std::size_t k = 0; k < frames_.size(); ++k) {
      frames_[k].cam_from_start = start->cam_from_start[k];
      frames_[k].starts_segment = k == 0;
      if (k == 0) continue;
      const Eigen::Vector3d turn =
          log_so3((start->cam_from_start[k] * start->cam_from_start[k - 1].conjugate()).normalized());
      report_.motion.path_rad += turn.cwiseAbs();
      report_.motion.span_rad = std::max(report_.motion.span_rad, log_so3(start->cam_from_start[k]).norm());
    }
    free_started_ = true;
  }

  [[nodiscard]] bool enough_to_begin() const {
    return report_.rows_used >= 3 && (log_.source != RotationSource::none || free_started_);
  }

  void note(std::size_t row) {
    const IntrinsicsEstimate& step = report_.steps[row];
    if (step.event != ObserveEvent::none) report_.events.push_back({log_.rows[row].t_s, step.event, step.point});
    if ((row & 255u) == 0) report_progress(progress_, "frames", row, frames_.size());
  }

  void run_hybrid() {
    HybridConfig hybrid = hybrid_config(log_, config_, report_.scale);
    hybrid.start = start_;
    HybridObserver observer(hybrid);
    double sum_nis = 0.0, sum_dof = 0.0;
    for (std::size_t k = 0; k < frames_.size(); ++k) {
      report_.steps[k] = observer.step(frames_[k]);
      note(k);
      const IntrinsicsEstimate& step = report_.steps[k];
      if (!(step.nis_dof > 0) || step.event == ObserveEvent::burst || step.event == ObserveEvent::zoom) continue;
      sum_nis += step.nis;
      sum_dof += step.nis_dof;
    }
    report_.nis_per_dof = sum_dof > 0.0 ? sum_nis / sum_dof : 0.0;
    if (!observer.is_running()) return;
    observer.settle();
    report_.sigma_px = observer.sigma_px();
    report_.constant_spans = observer.constant_spans();
    const HybridObserver::ConstantSpan span = observer.longest_constant_span();
    report_.reference_from_s = span.from_s;
    report_.reference_until_s = span.until_s;
    constant_at_end_ = span.is_current;
    final_ = observer.filter().camera();
    const double noise = observer.sigma_px() / report_.scale.scale;
    const double ratio = config_.sigma_px ? 1.0 : std::pow(noise / observer.filter_sigma_px(), 2);
    final_cov_ = ratio * observer.filter().covariance();
    has_final_ = true;
    set_values(report_.steps.back(), final_, frames_.back().t_s);
    report_.steps.back().sigma = report_.scale.scale * final_cov_.diagonal().head<4>().cwiseSqrt();
  }

  void add_frame(FrameBuffer& buffer, std::size_t row) const {
    std::vector<Eigen::Vector2d> px(log_.num_points, Eigen::Vector2d::Constant(not_seen));
    for (std::size_t i = 0; i < frames_[row].px.size(); ++i) px[i] = report_.scale.normalised(frames_[row].px[i]);
    if (frames_[row].starts_segment) buffer.renew_all();
    buffer.add(frames_[row], px);
  }

  void run_window() {
    constexpr double keyframe_s = 0.1;
    FrameBuffer buffer(log_.num_points, std::min<std::size_t>(frames_.size(), 20000));
    AdjustConfig adjust_with = adjust_config_of(log_, config_, start_, report_.scale);
    double next_s = frames_.front().t_s + 1.0;
    for (std::size_t k = 0; k < frames_.size(); ++k) {
      add_frame(buffer, k);
      buffer.erase_before(frames_[k].t_s - config_.window_s);
      if (k > 0) report_.steps[k] = report_.steps[k - 1];
      report_.steps[k].event = ObserveEvent::none;
      if (frames_[k].t_s < next_s - 1e-6) continue;
      next_s = frames_[k].t_s + keyframe_s;
      const Adjustment adjustment = adjust(buffer, adjust_with, progress_);
      if (adjustment.has_value) {
        if (!report_.steps[k].has_value) report_.steps[k].event = ObserveEvent::start;
        fill(report_.steps[k], adjustment, frames_[k].t_s);
        adjust_with.start = adjustment.solution.camera;
        adjust_with.other_starts.clear();
      }
      note(k);
    }
  }

  void fill(IntrinsicsEstimate& step, const Adjustment& adjustment, double t_s) {
    step.has_value = true;
    set_values(step, adjustment.solution.camera, t_s);
    final_ = adjustment.solution.camera;
    final_cov_ = adjustment.solution.covariance();
    has_final_ = true;
    step.sigma = report_.scale.scale * final_cov_.diagonal().head<4>().cwiseSqrt();
    const int dof = std::max(adjustment.solution.dof, 1);
    step.nis = adjustment.solution.sum_squares;
    step.nis_dof = dof;
    report_.sigma_px = adjustment.sigma_px * report_.scale.scale;
    report_.nis_per_dof = adjustment.solution.sum_squares / dof;
  }

  void set_values(IntrinsicsEstimate& step, const RotatingCamera& camera, double t_s) const {
    const Eigen::Vector4d k = report_.scale.intrinsics_px(camera.k_at(t_s));
    step.fx = k[0];
    step.fy = k[1];
    step.cx = k[2];
    step.cy = k[3];
    step.k1 = camera.k1;
  }

  template <typename Observer>
  void run_regression(Observer& observer) {
    for (std::size_t k = 0; k < frames_.size(); ++k) {
      report_.steps[k] = observer.step(frames_[k]);
      note(k);
    }
    const auto last =
        std::find_if(report_.steps.rbegin(), report_.steps.rend(), [](const auto& s) { return s.has_value; });
    if (last == report_.steps.rend()) return;
    const double scale = report_.scale.scale;
    final_ = start_;
    final_.k = report_.scale.normalised_intrinsics(last->values());
    final_cov_ = (last->sigma / scale).cwiseAbs2().asDiagonal();
    has_final_ = true;
  }

  void run_flow() {
    FlowFilterConfig flow;
    flow.num_points = log_.num_points;
    flow.scale = report_.scale;
    flow.start = report_.scale.intrinsics_px(start_.k);
    if (config_.sigma_px) flow.sigma_px = *config_.sigma_px;
    FlowFilter observer(flow);
    run_regression(observer);
  }

  void run_fang() {
    FangConfig fang;
    fang.num_points = log_.num_points;
    fang.scale = report_.scale;
    fang.start = report_.scale.intrinsics_px(start_.k);
    fang.profile = config_.profile;
    if (config_.sigma_px) fang.sigma_px = *config_.sigma_px;
    fang.roll_columns = log_.source != RotationSource::rate || log_.has_roll_rate;
    FangObserver observer(fang);
    run_regression(observer);
    report_.gramian_lambda_min = observer.gramian_lambda_min();
  }

  [[nodiscard]] FrameBuffer reference_frames() const {
    const std::vector<bool> is_used =
        reference_rows(frames_, report_.reference_from_s, report_.reference_until_s, log_.num_points,
                       estimated_rotations(config_.rotation, log_.source));
    const auto rows = static_cast<std::size_t>(std::ranges::count(is_used, true));
    const std::size_t room = std::max<std::size_t>(max_cells / std::max<std::size_t>(log_.num_points, 1), 64);
    FrameBuffer buffer(log_.num_points, std::min(rows + 1, room));
    for (std::size_t k = 0; k < frames_.size(); ++k) {
      if (is_used[k])
        add_frame(buffer, k);
      else if (!buffer.frames().empty() && frames_[k].starts_segment)
        buffer.renew_all();
    }
    return buffer;
  }

  /// Adjusts all rows since the last change of the intrinsics together: for the bound, and the answer of `batch`.
  void solve_reference() {
    const FrameBuffer buffer = reference_frames();
    AdjustConfig config = adjust_config_of(log_, config_, start_, report_.scale);
    if (has_final_ && config_.method != ObserveMethod::fang2011) {
      config.start = final_;
      if (const auto k = intrinsics_before(report_.reference_until_s, log_, report_.steps))
        config.start.k = report_.scale.normalised_intrinsics(*k);
      config.start.rotation_error_rad.setZero();
      config.other_starts.clear();
    }
    report_.reference = adjust(buffer, config, progress_);
    if (!report_.reference.has_value) return;
    report_.pixels_rejected = report_.reference.num_rejected;
    if (config_.rotation == RotationKnowledge::known) report_.jitter = rotation_jitter(report_.reference);
    report_.stated = stated_covariance(report_.reference, config.nuisances);
    report_.causes = cause_scores(
        log_, report_.reference,
        {config.nuisances, config_.max_gap_s, report_.height_px / report_.scale.scale, config_.estimate_errors});
    if (config_.method != ObserveMethod::batch && config_.rotation == RotationKnowledge::known) return;
    IntrinsicsEstimate all;
    fill(all, report_.reference, frames_.back().t_s);
    for (std::size_t k = 0; k < frames_.size(); ++k) {
      report_.steps[k] = all;
      set_values(report_.steps[k], final_, frames_[k].t_s);
    }
  }

  /// Whether the rows behind the answer have different focal lengths.
  [[nodiscard]] bool focal_length_varies() const {
    return config_.rotation == RotationKnowledge::known && report_.reference.has_value &&
           focal_variation_of(report_.reference.bundle, report_.reference.solution).is_significant();
  }

  void conclude() {
    if (focal_length_varies()) {
      report_.status = ObserveSolution::Status::focal_length_varies;
      return;
    }
    if (!has_final_ || !report_.reference.has_value) {
      report_.status = ObserveSolution::Status::no_convergence;
      if (!report_.reference.has_value) return;
    }
    const bool regression = config_.method == ObserveMethod::flow || config_.method == ObserveMethod::fang2011;
    ObserveNuisances nuisances = config_.nuisances;
    if (regression && config_.rotation == RotationKnowledge::known) nuisances = {};
    const CommonLayout layout(nuisances);
    if (layout.errors >= 0) {
      const RotatingCamera& camera = has_final_ ? final_ : report_.reference.solution.camera;
      report_.errors = CommonPrior(RotatingCamera{}).offset(layout, camera).segment(layout.errors, layout.num_errors);
    }
    if (report_.sigma_px == 0.0) report_.sigma_px = report_.reference.sigma_px * report_.scale.scale;
    const CommonMatrix bound = report_.reference.solution.bound();
    if (has_final_) {
      model_cov_ = final_cov_;
      state_covariance(layout);
    }
    list_quantities(layout, bound);
    if (!has_final_) return;
    state_steps();
    report_.status =
        is_observable(report_, bound) ? ObserveSolution::Status::ok : ObserveSolution::Status::unobservable;
  }

  /// The last row gets the stated σ, and so do all rows if they are one
  /// answer; a filter's other rows get the increase that the last one got.
  void state_steps() {
    const CommonLayout layout(model_cov_.rows() == 4 ? ObserveNuisances{} : config_.nuisances);
    const bool is_one = config_.method == ObserveMethod::batch || config_.rotation != RotationKnowledge::known;
    if (!is_one) report_.side_checks = state_rows(log_, model_cov_, final_cov_, inflation_, final_.k, report_.steps);
    for (std::size_t k = is_one ? 0 : report_.steps.size() - 1; k < report_.steps.size(); ++k) {
      report_.steps[k].sigma =
          report_.scale.scale * sigma_k_at(final_, layout, CommonMatrix(final_cov_), frames_[k].t_s);
    }
  }

  /// Adds to the model's covariance the errors that pixels share according to the reference, and the given σ.
  void state_covariance(const CommonLayout& layout) {
    const Eigen::VectorXd& inflation = report_.stated.inflation;
    if (inflation.size() >= layout.size) {
      const CommonVector raise = inflation.head(layout.size);
      inflation_ = raise.head<4>();
      final_cov_ =
          CommonMatrix(raise.asDiagonal() * final_cov_.topLeftCorner(layout.size, layout.size) * raise.asDiagonal());
    }
    if (config_.rotation == RotationKnowledge::known) compare_with_reference();
    report_.assumed = taken_as_given(log_, config_, report_, final_cov_);
  }

  /// If both are of one camera, the reference shows whether the answer is as accurate as its σ.
  void compare_with_reference() {
    const bool is_of_end = constant_at_end_ || report_.reference_until_s >= frames_.back().t_s - 1e-6;
    if (!is_of_end || config_.method == ObserveMethod::batch) return;
    const Eigen::Vector4d difference = final_.k - report_.reference.solution.camera.k;
    const Eigen::Vector4d of_reference = CommonMatrix(report_.stated.cov).diagonal().head<4>();
    Eigen::Vector4d own = final_cov_.diagonal().head<4>();
    if (!own.allFinite()) {
      own = difference.cwiseAbs2();  // the method has no σ
      final_cov_ = CommonMatrix((own + of_reference).asDiagonal());
      report_.sigma_is_distance = true;
    }
    report_.from_reference = (difference.array().abs() / (own + of_reference).array().sqrt()).maxCoeff();
  }

  void list_quantities(const CommonLayout& layout, const CommonMatrix& bound) {
    const double s = report_.scale.scale;
    const Eigen::Vector2d& c = report_.scale.centre;
    CommonVector unit = CommonVector::Ones(layout.size), offset = CommonVector::Zero(layout.size);
    unit.head<4>().setConstant(s);
    for (int i = 0; i < layout.num_errors; ++i) unit[layout.errors + i] = errors_[static_cast<std::size_t>(i)].ordinary;
    offset.segment<2>(2) = c;
    const std::vector<std::string> names = quantity_names(layout, errors_);
    const RotatingCamera& camera = has_final_ ? final_ : report_.reference.solution.camera;
    RotatingCamera zero;
    zero.k.setZero();
    const CommonVector value = CommonPrior(zero).offset(layout, camera);
    const CommonMatrix cov =
        has_final_ ? final_cov_ : CommonMatrix(CommonMatrix::Constant(layout.size, layout.size, not_seen));
    report_.covariance =
        Eigen::MatrixXd(unit.asDiagonal()) * cov.topLeftCorner(layout.size, layout.size) * unit.asDiagonal();
    for (int i = 0; i < layout.size; ++i) {
      const double variance = i < bound.rows() ? bound(i, i) : -1.0;
      report_.quantities.push_back({names[static_cast<std::size_t>(i)], unit[i] * value[i] + offset[i],
                                    std::sqrt(report_.covariance(i, i)),
                                    variance > 0.0 ? unit[i] * std::sqrt(variance) : not_seen,
                                    has_final_ ? unit[i] * std::sqrt(model_cov_(i, i)) : not_seen});
    }
  }

  const RotationLog& log_;
  ObserveSetup config_;
  const std::vector<RotationError>& errors_;
  const Progress& progress_;
  ObserveSolution report_;
  std::vector<RotationFrame> frames_;
  bool free_started_ = false, has_final_ = false;
  bool constant_at_end_ = false;  ///< The intrinsics of the reference last to the end of the log.
  RotatingCamera start_, final_;
  CommonMatrix final_cov_, model_cov_;
  Eigen::Array4d inflation_ = Eigen::Array4d::Ones();
};

}  // namespace

ObserveSolution solve_once(const RotationLog& log, const ObserveSetup& config, const std::vector<RotationError>& errors,
                           const RotationErrors& undone, const Progress& progress) {
  return Observation(log, config, errors, undone, progress).run();
}

}  // namespace alidade
