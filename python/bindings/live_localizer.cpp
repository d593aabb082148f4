#include "alidade/detect/image_sequence.h"
#include "alidade/localize.h"
#include "alidade/results/localize_outcome.h"
#include "alidade/tables/localize_file.h"
#include "alidade/tables/map_file.h"
#include "python/bindings/bindings.h"
#include "python/bindings/fields.h"
#include "python/bindings/guarded.h"
#include "python/bindings/images.h"
#include "python/bindings/waiting.h"

namespace alidade::python {
namespace {

/// Localizer of frames: all of observations, or all of images.
class LiveLocalizer {
 public:
  LiveLocalizer(const Camera& camera, const std::string& target, bool is_of_images, const std::string& start,
                const std::string& map, const Texts& values) {
    LocalizeConfig config;
    set_fields(fields_of(config), values);
    if (!target.empty()) config.target = is_of_images ? read_image_target(target) : read_target(target);
    if (!start.empty()) config.start = read_start(start);
    if (!map.empty()) config.map = read_map(map);
    localizer_ = std::make_shared<Guarded<Localizer>>(camera, config);
  }

  py::dict push_points(long frame, double t_s, const std::vector<long>& ids, const Array& pixels) {
    const auto px = vectors_of<2>(pixels);
    ObservationFrame seen{.frame = frame, .t_s = t_s, .observations = {}};
    for (std::size_t i = 0; i < ids.size(); ++i) seen.observations.push_back({.id = ids[i], .px = px[i]});
    return step_dict(localizer_->from_python([&](Localizer& localizer) { return PathStep(localizer.push(seen)); }));
  }

  py::dict push_image(long frame, double t_s, const py::array& image) {
    const Photos photos = photos_of({"image"}, {image});
    const cv::Mat grey = photos.load(0);
    return step_dict(
        localizer_->from_python([&](Localizer& localizer) { return PathStep(localizer.push(grey, frame, t_s)); }));
  }

  OutcomePtr finish(const py::object& progress) const {
    return value_of<OutcomePtr>(
        [held = localizer_](const Progress&) {
          return held->from_work([](const Localizer& localizer) {
            return std::make_shared<Outcome>(Outcome{outcome_of(localizer.finish()), {}, {}});
          });
        },
        progress);
  }

 private:
  static py::dict step_dict(const PathStep& step) {
    py::dict made;
    made["frame"] = step.frame;
    made["t_s"] = step.t_s;
    made["event"] = std::string(event_name(step.event));
    made["num_tracked"] = step.num_tracked;
    made["position_m"] = py::none();
    made["quaternion_wxyz"] = py::none();
    made["covariance"] = py::none();
    if (!step.has_pose()) return made;
    const Rigid3& pose = step.world_from_cam;
    made["position_m"] = std::vector<double>(pose.translation.data(), pose.translation.data() + 3);
    made["quaternion_wxyz"] =
        py::make_tuple(pose.rotation.w(), pose.rotation.x(), pose.rotation.y(), pose.rotation.z());
    made["covariance"] = matrix_array(step.cov);
    return made;
  }

  GuardedPtr<Localizer> localizer_;
};

}  // namespace

void bind_localizer(py::module_& module) {
  py::class_<LiveLocalizer>(module, "Localizer", plain_type(), "The path of a camera, frame by frame.")
      .def(py::init<const Camera&, const std::string&, bool, const std::string&, const std::string&, const Texts&>())
      .def("push_points", &LiveLocalizer::push_points)
      .def("push_image", &LiveLocalizer::push_image)
      .def("finish", &LiveLocalizer::finish);
}

}  // namespace alidade::python
