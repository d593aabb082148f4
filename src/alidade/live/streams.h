#pragma once

#include <deque>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "alidade/live/server.h"
#include "alidade/localize/localization.h"
#include "alidade/loop/servo_study.h"
#include "alidade/observe/observer.h"
#include "alidade/results/result_document.h"
#include "alidade/track/track.h"

// What runs publish: each step of an estimator as a row, and as what Foxglove draws. What a stream is made of must live
// longer than the server.

namespace alidade::live {

/// Of every run: `/progress`, `/log`, and `/result`, the verdict at the end.
[[nodiscard]] std::vector<Topic> common_topics();
inline constexpr const char* end_topic = "/result";

/// The first row of a table as a flat object by the names of its columns; `more` stands before them.
[[nodiscard]] std::string row_text(const DataTable& table, const JsonValue& more = JsonValue::object());
/// A topic of such rows, with their schema.
[[nodiscard]] Topic row_topic(const std::string& topic, const std::string& schema_name, const DataTable& sample,
                              std::size_t lanes = 1);

/// A path's last positions, as a line. For the server's thread.
using Trail = std::deque<Eigen::Vector3d>;

class TrackStream {
 public:
  TrackStream(std::span<const RigHead> heads, const TrueTrack& truth) : heads_(heads), truth_(&truth) {}
  [[nodiscard]] std::vector<Topic> topics() const;
  void begin(Server& server) const;
  void show(Server& server, const TargetObservation& observation, const TrackStep& step, bool is_last = false) const;

 private:
  std::span<const RigHead> heads_;
  const TrueTrack* truth_;
  std::shared_ptr<Trail> trail_ = std::make_shared<Trail>();
};

/// Trials follow one another in the time of messages; in rows each has its own.
class ServoStream {
 public:
  explicit ServoStream(const ServoScene& scene) : scene_(&scene) {}
  [[nodiscard]] std::vector<Topic> topics() const;
  void begin(Server& server) const;
  void show(Server& server, ControllerKind controller, const ServoRow& row, bool is_last = false);

 private:
  const ServoScene* scene_;
  std::shared_ptr<Trail> trail_ = std::make_shared<Trail>();
  std::optional<ControllerKind> controller_;
  int trial_ = 0;
};

class LocalizeStream {
 public:
  LocalizeStream(const Camera& camera, std::span<const TimedPose> truth) : camera_(&camera), truth_(truth) {}
  [[nodiscard]] std::vector<Topic> topics() const;
  void begin(Server& server) const;
  void show(Server& server, const PathStep& step, bool is_last = false) const;

 private:
  const Camera* camera_;
  std::span<const TimedPose> truth_;
  std::shared_ptr<Trail> trail_ = std::make_shared<Trail>();
};

class ObserveStream {
 public:
  ObserveStream(int width_px, int height_px) : width_px_(width_px), height_px_(height_px) {}
  [[nodiscard]] std::vector<Topic> topics() const;
  void show(Server& server, const ObserveStep& step, bool is_last = false) const;

 private:
  int width_px_, height_px_;
};

}  // namespace alidade::live
