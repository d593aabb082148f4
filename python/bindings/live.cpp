#include <algorithm>
#include <array>
#include <cmath>

#include "alidade/formats/camera_file.h"
#include "alidade/formats/rig_file.h"
#include "alidade/observe.h"
#include "alidade/results/observe_outcome.h"
#include "alidade/results/track_outcome.h"
#include "alidade/track.h"
#include "python/bindings/bindings.h"
#include "python/bindings/fields.h"
#include "python/bindings/guarded.h"
#include "python/bindings/waiting.h"

/// Estimators that take their data one by one, from any thread; finish() may take its time.
namespace alidade::python {
namespace {

template <typename Vector>
std::vector<double> list_of(const Vector& vector) {
  return {vector.data(), vector.data() + vector.size()};
}

OutcomePtr outcome_ptr(JobOutcome job) { return std::make_shared<Outcome>(Outcome{std::move(job), {}, {}}); }

/// TargetTracker with the ids of its heads.
class LiveTracker {
 public:
  LiveTracker(const std::string& rig_file, const Texts& values) {
    set_fields(fields_of(config_), values);
    Rig rig = read_rig(rig_file);
    for (const RigHead& head : rig.heads) ids_.push_back(head.head.id);
    tracker_ = std::make_shared<Guarded<TargetTracker>>(std::move(rig), config_);
  }

  py::dict push(int head, std::pair<double, double> pan_tilt_rad, std::pair<double, double> px, double t_capture_s,
                double t_arrival_s, double sigma_px) {
    const auto found = std::find(ids_.begin(), ids_.end(), head);
    if (found == ids_.end()) throw ConfigError("head: the rig has no head " + std::to_string(head));
    TargetObservation observation{.t_capture_s = t_capture_s, .t_arrival_s = t_arrival_s};
    observation.head = static_cast<std::size_t>(found - ids_.begin());
    observation.pan_tilt_rad = {pan_tilt_rad.first, pan_tilt_rad.second};
    observation.px = {px.first, px.second};
    observation.sigma_px = sigma_px;
    const TrackStep step = tracker_->from_python([&](TargetTracker& tracker) { return tracker.push(observation); });
    py::dict made = belief_dict(step.t_s, step.has_belief, step.belief);
    made["event"] = std::string(event_name(step.event));
    made["accepted"] = step.accepted;
    return made;
  }

  py::object at(double t_s) const {
    const std::optional<PredictedStep> step =
        tracker_->from_python([&](const TargetTracker& tracker) { return tracker.at(t_s); });
    if (!step) return py::none();
    return belief_dict(step->t_s, step->has_belief, step->belief);
  }

  OutcomePtr finish(const py::object& progress) const {
    return value_of<OutcomePtr>(
        [held = tracker_](const Progress& report) {
          return held->from_work(
              [&](const TargetTracker& tracker) { return outcome_ptr(outcome_of(tracker.finish({}, report))); });
        },
        progress);
  }

 private:
  static py::dict belief_dict(double t_s, bool has_belief, const Belief<6>& belief) {
    py::dict made;
    made["t_s"] = t_s;
    made["position_m"] = has_belief ? py::cast(list_of(belief.x.head<3>().eval())) : py::none();
    made["velocity_m_s"] = has_belief ? py::cast(list_of(belief.x.tail<3>().eval())) : py::none();
    made["covariance"] = has_belief ? py::cast(list_of(belief.P)) : py::none();
    return made;
  }

  TrackConfig config_;
  std::vector<int> ids_;
  GuardedPtr<TargetTracker> tracker_;
};

/// Observer of rows with so many points and that source of the rotation.
class LiveObserver {
 public:
  LiveObserver(const std::string& source, bool has_roll_rate, std::size_t num_points, const Texts& values,
               const std::optional<Camera>& camera)
      : source_(source == "rate"   ? RotationSource::rate
                : source == "head" ? RotationSource::head
                                   : RotationSource::attitude) {
    ObserveConfig config;
    set_fields(fields_of(config), values);
    config.camera = camera;
    RotationLog layout;
    layout.source = source_;
    layout.has_roll_rate = has_roll_rate;
    layout.num_points = num_points;
    observer_ = std::make_shared<Guarded<Observer>>(layout, config);
  }

  py::dict push(double t_s, const std::vector<double>& rotation, const Array& pixels) {
    const auto px = vectors_of<2>(pixels);
    const std::vector<double>& r = rotation;
    const ObserveStep step = observer_->from_python([&](Observer& observer) {
      return source_ == RotationSource::attitude ? observer.push(t_s, Eigen::Quaterniond(r[0], r[1], r[2], r[3]), px)
                                                 : observer.push(t_s, Eigen::Vector3d(r[0], r[1], r[2]), px);
    });
    const IntrinsicsEstimate& now = step.estimate;
    py::dict made;
    made["t_s"] = step.t_s;
    made["event"] = std::string(event_name(now.event));
    for (int i = 0; i < 4; ++i) {
      const char* const name = std::array{"fx", "fy", "cx", "cy"}[static_cast<std::size_t>(i)];
      const double none = std::nan("");
      made[name] = now.has_value ? now.values()[i] : none;
      made[py::str(std::string("sigma_") + name)] = now.has_value ? now.sigma[i] : none;
    }
    return made;
  }

  OutcomePtr finish(const py::object& progress) const {
    return value_of<OutcomePtr>(
        [held = observer_](const Progress& report) {
          return held->from_work(
              [&](const Observer& observer) { return outcome_ptr(outcome_of(observer.finish(report))); });
        },
        progress);
  }

 private:
  RotationSource source_;
  GuardedPtr<Observer> observer_;
};

}  // namespace

void bind_live(py::module_& module) {
  py::class_<LiveTracker>(module, "Tracker", plain_type(), "A target followed observation by observation.")
      .def(py::init<const std::string&, const Texts&>())
      .def("push", &LiveTracker::push)
      .def("at", &LiveTracker::at)
      .def("finish", &LiveTracker::finish);
  py::class_<LiveObserver>(module, "Observer", plain_type(), "Intrinsics of a camera that rotates, row by row.")
      .def(py::init<const std::string&, bool, std::size_t, const Texts&, const std::optional<Camera>&>())
      .def("push", &LiveObserver::push)
      .def("finish", &LiveObserver::finish);
}

}  // namespace alidade::python
