#include "alidade/live/streams.h"

#include <fmt/format.h>

#include <cmath>

#include "alidade/live/foxglove.h"
#include "alidade/results/documents/observe_document.h"
#include "alidade/results/documents/track_document.h"
#include "alidade/results/localize_outcome.h"
#include "alidade/results/servo_outcome.h"

namespace alidade::live {
namespace {

constexpr std::size_t max_trail = 300;

std::int64_t ns_of(double t_s) {
  return std::isfinite(t_s) && std::abs(t_s) < 9e9 ? static_cast<std::int64_t>(std::llround(t_s * 1e9)) : 0;
}

std::string head_name(const RigHead& head) { return fmt::format("head{}", head.head.id); }

Topic latest(const std::string& topic, FoxgloveType type, double max_hz, std::size_t lanes = 1) {
  return {foxglove_channel(topic, type), TopicKind::latest, max_hz, lanes};
}

/// One value of a column, by whatever it holds.
JsonValue first_of(const JsonValue& column) {
  return std::visit(
      [](const auto& content) -> JsonValue {
        using Content = std::decay_t<decltype(content)>;
        if constexpr (std::is_same_v<Content, JsonValue::List> || std::is_same_v<Content, std::vector<double>> ||
                      std::is_same_v<Content, std::vector<std::int64_t>>) {
          return content.empty() ? JsonValue() : JsonValue(content.front());
        } else {
          return {};
        }
      },
      column.content());
}

std::string schema_of(const JsonValue& value) {
  if (std::holds_alternative<std::string>(value.content())) return R"({"type":"string"})";
  if (std::holds_alternative<bool>(value.content())) return R"({"type":"boolean"})";
  return R"({"type":"number"})";
}

void add_place(Trail& trail, const Eigen::Vector3d& place) {
  trail.push_back(place);
  if (trail.size() > max_trail) trail.pop_front();
}

void draw_trail(Scene& scene, const Trail& trail) {
  const std::vector<Eigen::Vector3d> places(trail.begin(), trail.end());
  scene.line("trail", places, 2.5, sky);
}

std::vector<Topic> head_topics(std::span<const RigHead> heads) {
  std::vector<Topic> topics;
  for (const RigHead& head : heads) {
    const std::string name = "/" + head_name(head);
    topics.push_back(latest(name + "/camera", FoxgloveType::camera_calibration, 10.0));
    topics.push_back({foxglove_channel(name + "/marks", FoxgloveType::image_annotations), TopicKind::images, 30.0, 1});
  }
  return topics;
}

void send_cameras(Server& server, std::span<const RigHead> heads) {
  for (const RigHead& head : heads)
    server.send("/" + head_name(head) + "/camera", 0,
                [camera = head.camera, name = head_name(head)] { return camera_calibration_text(0, name, camera); });
}

/// Where a head's camera is, and the head's own frame.
std::string head_transforms(std::int64_t t_ns, const RigHead& head, const Eigen::Vector2d& pan_tilt_rad) {
  const std::array<FrameTransform, 2> transforms{
      FrameTransform{"world", head_name(head) + "_base", head.head.world_from_base},
      FrameTransform{"world", head_name(head), world_from_cam(head.head, pan_tilt_rad)}};
  return frame_transforms_text(t_ns, transforms);
}

}  // namespace

std::vector<Topic> common_topics() {
  const std::string progress =
      R"({"type":"object","properties":{"what":{"type":"string"},"done":{"type":"integer"},"total":{"type":"integer"}}})";
  const std::string result =
      R"({"type":"object","properties":{"state":{"type":"string"},"exit_code":{"type":"integer"},"sentence":{"type":"string"}}})";
  return {{{"/progress", "alidade.Progress", progress}, TopicKind::latest, 5.0, 1},
          {foxglove_channel("/log", FoxgloveType::log), TopicKind::steps, 60.0, 1},
          {{end_topic, "alidade.Verdict", result}, TopicKind::latest, 10.0, 1}};
}

std::string row_text(const DataTable& table, const JsonValue& more) {
  JsonValue row = more;
  for (const auto& [name, column] : table.columns) row[name] = first_of(column);
  return row.text();
}

Topic row_topic(const std::string& topic, const std::string& schema_name, const DataTable& sample, std::size_t lanes) {
  std::string schema;
  for (const auto& [name, column] : sample.columns)
    schema += (schema.empty() ? "" : ",") + ('"' + name + "\":" + schema_of(first_of(column)));
  return {{topic, schema_name, R"({"type":"object","properties":{)" + schema + "}}"}, TopicKind::steps, 60.0, lanes};
}

std::vector<Topic> TrackStream::topics() const {
  std::vector<Topic> topics = common_topics();
  topics.push_back(row_topic("/track", "alidade.TrackStep", track_row({}, heads_, {}, *truth_), heads_.size()));
  topics.push_back({foxglove_channel("/tf", FoxgloveType::frame_transforms), TopicKind::images, 60.0, heads_.size()});
  topics.push_back(latest("/target", FoxgloveType::pose_in_frame, 30.0));
  topics.push_back(latest("/scene", FoxgloveType::scene_update, 20.0, heads_.size()));
  for (Topic& topic : head_topics(heads_)) topics.push_back(std::move(topic));
  return topics;
}

void TrackStream::begin(Server& server) const { send_cameras(server, heads_); }

namespace {

std::string track_scene(std::int64_t t_ns, std::span<const RigHead> heads, const TargetObservation& observation,
                        const TrackStep& step, Trail& trail) {
  const Eigen::Vector3d target = step.belief.x.head<3>();
  Scene scene(t_ns, "world");
  if (step.has_belief) {
    add_place(trail, target);
    scene.ellipsoid("target", target, step.belief.P.topLeftCorner<3, 3>(), {0.84, 0.37, 0.0, 0.5});
  }
  draw_trail(scene, trail);
  for (std::size_t i = 0; i < heads.size(); ++i) {
    const Eigen::Vector3d place = cam_centre_in_world(heads[i].head, observation.pan_tilt_rad);
    scene.label(head_name(heads[i]), place, fmt::format("head {}", heads[i].head.id));
  }
  const auto ray = ray_in_world(heads[observation.head], observation);
  if (ray) {
    const double length_m = step.has_belief ? 1.15 * (target - ray->origin_in_world).norm() : 2.0;
    const std::array<Eigen::Vector3d, 2> ends{ray->origin_in_world,
                                              ray->origin_in_world + length_m * ray->direction_in_world};
    scene.line("ray of " + head_name(heads[observation.head]), ends, 1.5, purple);
  }
  return scene.text();
}

/// What was seen, and where it was expected within 3σ.
std::string track_marks(std::int64_t t_ns, const TargetObservation& observation, const TrackStep& step) {
  Marks marks(t_ns);
  if (step.has_innovation) marks.ellipse(observation.px - step.innovation.nu, step.innovation.S, sky);
  marks.dot(observation.px, 6.0, step.accepted ? orange : vermilion);
  return marks.text();
}

}  // namespace

void TrackStream::show(Server& server, const TargetObservation& observation, const TrackStep& step,
                       bool is_last) const {
  const std::int64_t t_ns = ns_of(observation.t_capture_s);
  const RigHead& head = heads_[observation.head];
  server.send(
      "/track", t_ns,
      [heads = heads_, truth = truth_, observation, step] {
        return row_text(track_row(observation, heads, step, *truth));
      },
      observation.head, is_last);
  server.send(
      "/tf", t_ns, [t_ns, &head, observation] { return head_transforms(t_ns, head, observation.pan_tilt_rad); },
      observation.head, is_last);
  if (step.has_belief)
    server.send(
        "/target", t_ns,
        [t_ns, step] {
          return pose_text(t_ns, "world", {Eigen::Quaterniond::Identity(), step.belief.x.head<3>()});
        },
        0, is_last);
  server.send(
      "/scene", t_ns,
      [t_ns, heads = heads_, observation, step, trail = trail_] {
        return track_scene(t_ns, heads, observation, step, *trail);
      },
      observation.head);
  server.send("/" + head_name(head) + "/marks", t_ns,
              [t_ns, observation, step] { return track_marks(t_ns, observation, step); });
  if (step.event == TrackEvent::restart || step.event == TrackEvent::start)
    server.send("/log", t_ns, [t_ns, event = step.event] {
      return log_text(t_ns, event == TrackEvent::start ? LogLevel::info : LogLevel::warning, "track",
                      event == TrackEvent::start ? "the track starts" : "the track starts again: it did not fit");
    });
}

std::vector<Topic> ServoStream::topics() const {
  std::vector<Topic> topics = common_topics();
  ServoRow sample;
  sample.command = sample.asked_rad = sample.measured_rad = sample.predicted_rad = sample.rate_rad_s =
      sample.sigma_predicted_px = sample.error_px = Eigen::Vector2d::Zero();
  DataTable table = servo_row(scene_->heads, sample);
  table.columns.insert(table.columns.begin(), {"controller", std::vector<std::string>{"pi"}});
  topics.push_back(row_topic("/servo", "alidade.ServoRow", table, scene_->heads.size()));
  topics.push_back(
      {foxglove_channel("/tf", FoxgloveType::frame_transforms), TopicKind::images, 60.0, scene_->heads.size()});
  topics.push_back(latest("/target", FoxgloveType::pose_in_frame, 30.0));
  topics.push_back(latest("/scene", FoxgloveType::scene_update, 20.0, scene_->heads.size()));
  for (Topic& topic : head_topics(scene_->heads)) topics.push_back(std::move(topic));
  return topics;
}

void ServoStream::begin(Server& server) const { send_cameras(server, scene_->heads); }

namespace {

/// The target's path and, of the head of this row, its view's axis as far as the target.
std::string servo_scene(std::int64_t t_ns, const ServoScene& world, const ServoRow& row, Trail& trail) {
  const Eigen::Vector3d target = world.path.at(row.t_s);
  add_place(trail, target);
  Scene scene(t_ns, "world");
  draw_trail(scene, trail);
  constexpr double drawn_m = 0.01;
  scene.ellipsoid("target", target, Eigen::Matrix3d::Identity() * drawn_m * drawn_m / 9.0, orange);
  for (const RigHead& head : world.heads) {
    const Eigen::Vector3d place = cam_centre_in_world(head.head, row.measured_rad);
    scene.label(head_name(head), place, fmt::format("head {}", head.head.id));
  }
  const Rigid3 world_from_head = world_from_cam(world.heads[row.head].head, row.measured_rad);
  const double length_m = 1.15 * (target - world_from_head.translation).norm();
  const std::array<Eigen::Vector3d, 2> ends{world_from_head.translation,
                                            world_from_head * Eigen::Vector3d(0.0, 0.0, length_m)};
  scene.line("view of " + head_name(world.heads[row.head]), ends, 1.5, purple);
  return scene.text();
}

std::string servo_marks(std::int64_t t_ns, const Camera& camera, const ServoRow& row) {
  const Eigen::Vector2d centre(0.5 * (camera.width_px - 1), 0.5 * (camera.height_px - 1));
  Marks marks(t_ns);
  if (row.has_prediction && row.sigma_predicted_px.allFinite())
    marks.ellipse(centre, row.sigma_predicted_px.cwiseAbs2().asDiagonal().toDenseMatrix(), sky);
  if (row.error_px.allFinite()) marks.dot(centre + row.error_px, 6.0, orange);
  return marks.text();
}

}  // namespace

void ServoStream::show(Server& server, ControllerKind controller, const ServoRow& row, bool is_last) {
  const bool is_new = controller_ != controller;
  if (is_new && controller_) {
    ++trial_;
    trail_ = std::make_shared<Trail>();
  }
  controller_ = controller;
  const std::int64_t t_ns = ns_of(row.t_s + trial_ * (scene_->duration_s + 1.0));
  const RigHead& head = scene_->heads[row.head];
  if (is_new)
    server.send("/log", t_ns, [t_ns, controller] {
      return log_text(t_ns, LogLevel::info, "servo", "controller " + std::string(controller_name(controller)));
    });
  server.send(
      "/servo", t_ns,
      [scene = scene_, controller, row] {
        JsonValue name = JsonValue::object();
        name["controller"] = controller_name(controller);
        return row_text(servo_row(scene->heads, row), name);
      },
      row.head, is_last);
  server.send(
      "/tf", t_ns, [t_ns, &head, row] { return head_transforms(t_ns, head, row.measured_rad); }, row.head, is_last);
  server.send("/target", t_ns, [t_ns, scene = scene_, t_s = row.t_s] {
    return pose_text(t_ns, "world", {Eigen::Quaterniond::Identity(), scene->path.at(t_s)});
  });
  server.send(
      "/scene", t_ns, [t_ns, scene = scene_, row, trail = trail_] { return servo_scene(t_ns, *scene, row, *trail); },
      row.head);
  server.send("/" + head_name(head) + "/marks", t_ns,
              [t_ns, &head, row] { return servo_marks(t_ns, head.camera, row); });
}

std::vector<Topic> LocalizeStream::topics() const {
  std::vector<Topic> topics = common_topics();
  topics.push_back(row_topic("/localize", "alidade.PathStep", localize_row({}, truth_)));
  topics.push_back({foxglove_channel("/tf", FoxgloveType::frame_transforms), TopicKind::images, 60.0, 1});
  topics.push_back(latest("/scene", FoxgloveType::scene_update, 10.0));
  topics.push_back(latest("/head1/camera", FoxgloveType::camera_calibration, 10.0));
  topics.push_back({foxglove_channel("/head1/marks", FoxgloveType::image_annotations), TopicKind::images, 10.0, 1});
  topics.push_back({foxglove_channel("/head1/image", FoxgloveType::compressed_image), TopicKind::images, 10.0, 1});
  return topics;
}

void LocalizeStream::begin(Server& server) const {
  server.send("/head1/camera", 0, [camera = *camera_] { return camera_calibration_text(0, "head1", camera); });
}

void LocalizeStream::show(Server& server, const PathStep& step, bool is_last) const {
  const std::int64_t t_ns = ns_of(step.t_s);
  server.send(
      "/localize", t_ns, [step, truth = truth_] { return row_text(localize_row(step, truth)); }, 0, is_last);
  if (step.event == FrameEvent::started || step.event == FrameEvent::restarted)
    server.send("/log", t_ns, [t_ns, event = step.event] {
      return log_text(t_ns, event == FrameEvent::started ? LogLevel::info : LogLevel::warning, "localize",
                      "the path has " + std::string(event_name(event)));
    });
  if (!step.has_pose()) return;
  server.send(
      "/tf", t_ns,
      [t_ns, step] {
        const FrameTransform transform{"world", "head1", step.world_from_cam};
        return frame_transforms_text(t_ns, {&transform, 1});
      },
      0, is_last);
  server.send("/scene", t_ns, [t_ns, step, trail = trail_] {
    Scene scene(t_ns, "world");
    add_place(*trail, step.world_from_cam.translation);
    draw_trail(scene, *trail);
    const Eigen::Matrix3d rotation = step.world_from_cam.rotation.toRotationMatrix();
    const Eigen::Matrix3d cov_in_world = rotation * step.cov.topLeftCorner<3, 3>() * rotation.transpose();
    scene.ellipsoid("camera", step.world_from_cam.translation, cov_in_world, {0.84, 0.37, 0.0, 0.5});
    return scene.text();
  });
}

std::vector<Topic> ObserveStream::topics() const {
  std::vector<Topic> topics = common_topics();
  ObserveStep row;
  row.truth = TrueIntrinsics{};  // rows have it where the log has
  topics.push_back(row_topic("/observe", "alidade.ObserveStep", observe_row(row)));
  topics.push_back({foxglove_channel("/tf", FoxgloveType::frame_transforms), TopicKind::images, 60.0, 1});
  topics.push_back(latest("/head1/camera", FoxgloveType::camera_calibration, 10.0));
  return topics;
}

void ObserveStream::show(Server& server, const ObserveStep& step, bool is_last) const {
  const std::int64_t t_ns = ns_of(step.t_s);
  const IntrinsicsEstimate& estimate = step.estimate;
  server.send(
      "/observe", t_ns, [step] { return row_text(observe_row(step)); }, 0, is_last);
  server.send(
      "/tf", t_ns,
      [t_ns, start_from_cam = step.start_from_cam] {
        const FrameTransform transform{"world", "head1", {start_from_cam, Eigen::Vector3d::Zero()}};
        return frame_transforms_text(t_ns, {&transform, 1});
      },
      0, is_last);
  if (estimate.has_value)
    server.send("/head1/camera", t_ns, [t_ns, estimate, width = width_px_, height = height_px_] {
      Camera camera{width, height, Calibrated<Pinhole>{}, {}, 0.0, ""};
      Eigen::VectorXd values = params(camera.lens);
      values.head<4>() = estimate.values();
      camera.lens = with_params(camera.lens, values);
      return camera_calibration_text(t_ns, "head1", camera);
    });
  if (estimate.event == ObserveEvent::zoom || estimate.event == ObserveEvent::restart)
    server.send("/log", t_ns, [t_ns, event = estimate.event] {
      return log_text(t_ns, LogLevel::warning, "observe", std::string(event_name(event)));
    });
}

}  // namespace alidade::live
