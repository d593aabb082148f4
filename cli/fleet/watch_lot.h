#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <map>
#include <mutex>
#include <string>
#include <vector>

namespace alidade::fleet {

/// What a camera was estimated to be at one time: of a page's figure, so in single precision, less the first value.
struct WatchedStep {
  float t_s = 0.0F;              ///< Since the first one.
  std::array<float, 3> value{};  ///< Zero of pan, zero of tilt [rad], fx [px], less the first.
  std::array<float, 3> sigma{};  ///< Of these.
};

/// The steps of a camera since it is watched. When they are many every second one is let go, and from then on every
/// second one is not kept: a history reaches back to its beginning whatever its length.
class History {
 public:
  void add(double t_s, const std::array<double, 3>& value, const std::array<double, 3>& sigma);
  [[nodiscard]] const std::vector<WatchedStep>& steps() const { return steps_; }
  [[nodiscard]] double first_t_s() const { return first_t_s_; }
  [[nodiscard]] const std::array<double, 3>& first() const { return first_; }

 private:
  static constexpr std::size_t most = 240;
  std::vector<WatchedStep> steps_;
  std::array<double, 3> first_{};
  double first_t_s_ = 0.0;
  std::uint32_t stride_ = 1, since_ = 0;
};

/// All cameras that states and alarms name. States and alarms come in one thread, questions in another.
class WatchedLot {
 public:
  /// What is no state, or no alarm, of a worker is left alone.
  void take_state(const std::string& payload);
  void take_alarm(const std::string& payload);

  /// {cameras, alarms, verdicts {STATE: count}, map [[camera, state, alarms]…] the worst first, worst [state…]}.
  [[nodiscard]] std::string fleet_text();
  /// {camera, sentence, state, history [{t, pan_zero_rad, …, sigma_…}], alarms [{t, n, kind, sentence}]}; empty: none.
  [[nodiscard]] std::string camera_text(const std::string& id);

 private:
  struct Camera {
    std::string state_text;  ///< As it came: it is read again for the few that are shown.
    std::string state;       ///< good, care, …
    History history;
    std::deque<std::string> alarms;  ///< The last ones, as they came.
    std::size_t num_alarms = 0;
  };

  std::mutex mutex_;
  std::map<std::string, Camera> cameras_;
  std::size_t num_alarms_ = 0;
};

}  // namespace alidade::fleet
