#include "alidade/heads/protocols/indi_head.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "alidade/files/files.h"
#include "alidade/geometry/degree.h"
#include "alidade/heads/protocols/indi_link.h"

namespace alidade {
namespace {

constexpr const char* where_it_is = "EQUATORIAL_EOD_COORD";
constexpr double degrees_an_hour = 15.0;

/// The mount reports its position unasked, as often as it reads it: the last report counts, at its time of arrival.
class IndiMount final : public HeadDevice {
 public:
  IndiMount(const std::string& url, const HeadOptions& options)
      : clock_(machine_clock()), link_(url, std::max(options.timeout_s, 1.0)) {
    begin();
    limits_.info = "INDI, " + link_.device();
    limits_.low_rad[1] = -0.5 * std::numbers::pi;
    limits_.high_rad[1] = 0.5 * std::numbers::pi;
  }

  [[nodiscard]] HeadLimits limits() override { return limits_; }
  [[nodiscard]] const std::string& name() const override { return link_.name(); }
  [[nodiscard]] HeadClock& clock() override { return *clock_; }

  [[nodiscard]] bool answers_questions() const override { return false; }

  [[nodiscard]] HeadPosition position() override {
    link_.take(0.0);
    if (link_.behind_s() > behind_s)
      throw InputError(
          fmt::format("{}: for {:g} s it says more than can be read: where it is now is not known", name(), behind_s));
    const IndiProperty* coordinates = link_.find(where_it_is);
    if (coordinates == nullptr) throw InputError(name() + ": no longer reports its position");
    if (coordinates->state == "Alert") throw InputError(name() + ": the mount reports a fault (Alert)");
    const Eigen::Vector2d at = angles(*coordinates);
    // While it moves it has to say so; at rest nothing new comes, and the old stays true.
    const double old_s = clock_->now_s() - coordinates->t_s, most_s = longest_silence_s(*coordinates);
    if (coordinates->state == "Busy" && old_s > most_s)
      throw InputError(fmt::format("{}: moves and has said nothing for {:.2g} s", name(), most_s));
    return {clock_->now_s(), 0.0, at};
  }
  void count_pan_near(double pan_rad) override {
    last_pan_ = pan_rad;
    has_last_ = true;
  }
  HeadSent command(const Eigen::Vector2d& target) override {
    if (!limits_.hold(target)) throw InputError(name() + ": a command that is no angle within its limits");
    link_.take(0.0);
    const double hours = target[0] / degree / degrees_an_hour;
    const double sent_s = clock_->now_s();
    link_.set_numbers(where_it_is, {{"RA", hours - 24.0 * std::floor(hours / 24.0)}, {"DEC", target[1] / degree}});
    return {sent_s, 0.0};
  }
  HeadSent stop() override {
    for (int attempt = 0;; ++attempt) {
      const double sent_s = clock_->now_s();
      try {
        if (attempt > 0) link_.connect_again();
        link_.set_switch("TELESCOPE_ABORT_MOTION", "ABORT");
        return {sent_s, 0.0};
      } catch (const InputError&) {
        if (attempt == 2) throw;
      }
    }
  }

 private:
  static constexpr double behind_s = 0.3, patience_s = 5.0;

  /// While it moves: half a second, or three times as long as between its reports where these are rarer; a driver that
  /// does not take POLLING_PERIOD reports once a second. Before two reports have come nothing is known of that.
  double longest_silence_s(const IndiProperty& coordinates) {
    constexpr double least_s = 0.5, most_s = 2.5, times = 3.0;
    const bool is_busy = coordinates.state == "Busy";
    if (coordinates.count != count_) {
      if (is_busy && was_busy_) gap_s_ = std::max(gap_s_, coordinates.t_s - reported_s_);
      reported_s_ = coordinates.t_s;
      count_ = coordinates.count;
      was_busy_ = is_busy;
    }
    return gap_s_ > 0.0 ? std::clamp(times * gap_s_, least_s, most_s) : most_s;
  }

  void begin() {
    link_.connect_device(patience_s);
    (void)link_.wait_for(where_it_is, patience_s);
    link_.take(0.3);
    if (link_.find("POLLING_PERIOD") != nullptr) link_.set_numbers("POLLING_PERIOD", {{"PERIOD_MS", 100.0}});
    if (link_.find("ON_COORD_SET") != nullptr) link_.set_switch("ON_COORD_SET", "TRACK");
    const IndiProperty* park = link_.find("TELESCOPE_PARK");
    if (park != nullptr && park->values.contains("PARK") && park->values.at("PARK") == "On")
      throw InputError(name() + ": the mount is parked; unpark it first");
  }
  /// Right ascension counts on beyond 24 h.
  Eigen::Vector2d angles(const IndiProperty& coordinates) {
    const auto value = [&](const char* member) {
      const auto found = coordinates.values.find(member);
      if (found == coordinates.values.end()) throw InputError(name() + ": reports no position in the sky");
      const double number = sexagesimal(found->second);
      if (std::isfinite(number)) return number;
      throw InputError(fmt::format("{}: '{}' is no {}", name(), found->second.substr(0, 40), member));
    };
    Eigen::Vector2d at(value("RA") * degrees_an_hour * degree, value("DEC") * degree);
    constexpr double turn = 2.0 * std::numbers::pi;
    if (has_last_) at[0] += turn * std::round((last_pan_ - at[0]) / turn);
    last_pan_ = at[0];
    has_last_ = true;
    return at;
  }

  std::shared_ptr<HeadClock> clock_;
  IndiLink link_;
  HeadLimits limits_;
  double last_pan_ = 0.0;
  bool has_last_ = false;
  double gap_s_ = 0.0, reported_s_ = 0.0;  ///< The longest between two reports while it moved; when the last came.
  std::size_t count_ = 0;
  bool was_busy_ = false;
};

}  // namespace

std::unique_ptr<HeadDevice> open_indi(const std::string& url, const HeadOptions& options) {
  return std::make_unique<IndiMount>(url, options);
}

}  // namespace alidade
