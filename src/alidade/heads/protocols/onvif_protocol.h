#pragma once

#include <mutex>
#include <set>
#include <string>

#include "alidade/heads/simulated_head.h"

namespace alidade {

struct OnvifServerConfig {
  std::string user, password;  ///< Who may ask; no user: everybody.
  std::string address = "127.0.0.1";
  int port = 80;           ///< Of its own, as it announces itself.
  std::string stream_url;  ///< What GetStreamUri answers.
  int width_px = 320, height_px = 240;
};

/// A simulated head as a network camera: the part of ONVIF that clients of PTZ need. x = −1…1 is its azimuth range,
/// right above zero, y its elevation range. From any thread.
class OnvifCamera {
 public:
  OnvifCamera(HeadPlant& plant, OnvifServerConfig config) : plant_(plant), config_(std::move(config)) {}

  struct Answer {
    int status = 200;
    std::string body;
  };
  [[nodiscard]] Answer answer(const std::string& message, double t_s);
  void set_port(int port) { config_.port = port; }

 private:
  struct Call;
  void check_user(const Call& call, double t_s);
  [[nodiscard]] std::string inside_of(const Call& call, double t_s);
  [[nodiscard]] std::string what_it_is(const std::string& command, double t_s) const;
  [[nodiscard]] std::string media_or_ptz(const std::string& command) const;
  [[nodiscard]] std::string profile() const;
  [[nodiscard]] std::string status(double t_s);
  void move(const Call& call, double t_s);
  [[nodiscard]] Eigen::Vector2d counts(const Eigen::Vector2d& pan_tilt_rad) const;
  [[nodiscard]] Eigen::Vector2d angles(const Eigen::Vector2d& xy) const;

  HeadPlant& plant_;
  OnvifServerConfig config_;
  std::mutex mutex_;
  std::set<std::string> nonces_;
};

}  // namespace alidade
