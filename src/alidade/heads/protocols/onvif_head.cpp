#include "alidade/heads/protocols/onvif_head.h"

#include <fmt/format.h>

#include <cmath>
#include <cstdlib>

#include "alidade/files/files.h"
#include "alidade/geometry/degree.h"
#include "alidade/heads/protocols/onvif_service.h"

namespace alidade {
namespace {

/// What stands behind the question mark of onvif://…/?profile=0&az=-180:180&el=-90:90.
struct OnvifQuery {
  std::size_t profile = 0;
  std::string profile_token;
  OnvifRange azimuth_deg{-180.0, 180.0}, elevation_deg{-90.0, 90.0};
  bool determines_azimuth = false, determines_elevation = false;
};

/// What stands in az or el of an address, where nobody said it.
Assumption supposed(const char* name, const OnvifRange& degrees) {
  return {.name = name,
          .value = degrees.high - degrees.low,
          .sigma = {},
          .remedy = fmt::format("give {}=LOW:HIGH in the address: its data sheet says how far it goes", name)};
}

bool read_degrees(const std::string& text, OnvifRange& range) {
  char* end = nullptr;
  const double low = std::strtod(text.c_str(), &end);
  if (end == text.c_str() || *end != ':') return false;
  const char* second = end + 1;
  const double high = std::strtod(second, &end);
  if (end == second || *end != '\0' || !(std::abs(low) <= 1e4 && std::abs(high) <= 1e4 && low < high)) return false;
  range = {low, high};
  return true;
}

OnvifQuery onvif_query(const std::string& url) {
  OnvifQuery query;
  const std::size_t begin = url.find('?');
  const std::string text = begin == std::string::npos ? "" : url.substr(begin + 1);
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = std::min(text.find('&', at), text.size());
    const std::string part = text.substr(at, end - at), key = part.substr(0, part.find('='));
    const std::string value = part.size() > key.size() ? part.substr(key.size() + 1) : "";
    at = end + 1;
    bool is_good = false;
    if (key == "profile") {
      char* last = nullptr;
      query.profile = std::strtoul(value.c_str(), &last, 10);
      if (*last != '\0') query.profile_token = value;
      is_good = !value.empty();
    } else if (key == "az" || key == "el") {
      is_good = read_degrees(value, key == "az" ? query.azimuth_deg : query.elevation_deg);
      (key == "az" ? query.determines_azimuth : query.determines_elevation) = true;
    }
    is_good = is_good || ((key == "https" || key == "cert") && onvif_trust(url));  // the connection's own
    if (!is_good)
      throw InputError(
          fmt::format("onvif://…: '{}' is none of profile=0, az=-180:180, el=-90:90, https=1, cert=SHA256", part));
  }
  return query;
}

class OnvifHead final : public HeadDevice {
 public:
  OnvifHead(const std::string& url, const HeadOptions& options)
      : query_(onvif_query(url)), clock_(machine_clock()), service_(url, options) {
    const std::vector<OnvifProfile> all = service_.profiles();
    std::size_t which = query_.profile;
    for (std::size_t i = 0; i < all.size(); ++i)
      if (!query_.profile_token.empty() && all[i].token == query_.profile_token) which = i;
    if (which >= all.size() || (!query_.profile_token.empty() && all[which].token != query_.profile_token))
      throw InputError(fmt::format("{}: has no such profile; it has {}", name(), all.size()));
    profile_ = all[which];
    if (!profile_.has_pan_tilt) throw InputError(name() + ": this profile has no PTZ configuration: it does not turn");
    if (profile_.counts_degrees && !query_.determines_azimuth) {
      query_.azimuth_deg = profile_.x;
      query_.determines_azimuth = true;
    }
    if (profile_.counts_degrees && !query_.determines_elevation) {
      query_.elevation_deg = profile_.y;
      query_.determines_elevation = true;
    }
    const Eigen::Vector2d low = angles(profile_.x.high, profile_.y.low), high = angles(profile_.x.low, profile_.y.high);
    limits_ = {low, high, query_.determines_azimuth && query_.determines_elevation, "ONVIF, " + service_.maker()};
    if (!query_.determines_azimuth) limits_.assumed.push_back(supposed("az", query_.azimuth_deg));
    if (!query_.determines_elevation) limits_.assumed.push_back(supposed("el", query_.elevation_deg));
  }

  [[nodiscard]] HeadLimits limits() override { return limits_; }
  [[nodiscard]] const std::string& name() const override { return service_.name(); }
  [[nodiscard]] HeadClock& clock() override { return *clock_; }

  [[nodiscard]] HeadPosition position() override {
    const double asked_s = clock_->now_s();
    const OnvifStatus status = service_.status(profile_);
    const double answered_s = clock_->now_s();
    if (!status.has_pan_tilt) throw InputError(name() + ": does not report its position (GetStatus has none)");
    return {0.5 * (asked_s + answered_s), answered_s - asked_s, angles(status.x, status.y)};
  }
  HeadSent command(const Eigen::Vector2d& target) override {
    if (!limits_.hold(target)) throw InputError(name() + ": a command that is no angle within its limits");
    const auto [x, y] = counts(target);
    const double sent_s = clock_->now_s();
    service_.move_to(profile_, x, y);
    return {sent_s, clock_->now_s() - sent_s};
  }
  HeadSent stop() override {
    for (int attempt = 0;; ++attempt) {
      const double sent_s = clock_->now_s();
      try {
        service_.stop(profile_);
        return {sent_s, clock_->now_s() - sent_s};
      } catch (const InputError&) {
        if (attempt == 2) throw;
      }
    }
  }
  [[nodiscard]] std::optional<double> zoom() override {
    const OnvifStatus status = service_.status(profile_);
    if (!status.has_zoom || !profile_.has_zoom) return std::nullopt;
    return status.zoom;
  }
  void zoom_to(double share) override { service_.zoom_to(profile_, share); }

 private:
  [[nodiscard]] Eigen::Vector2d angles(double x, double y) const {
    const auto share = [](double value, const OnvifRange& of) { return (value - of.low) / (of.high - of.low); };
    const auto at = [](double share_of, const OnvifRange& deg) { return deg.low + share_of * (deg.high - deg.low); };
    return Eigen::Vector2d(0.0 - at(share(x, profile_.x), query_.azimuth_deg),
                           at(share(y, profile_.y), query_.elevation_deg)) *
           degree;
  }
  [[nodiscard]] std::pair<double, double> counts(const Eigen::Vector2d& target) const {
    const auto count = [](double deg, const OnvifRange& degrees, const OnvifRange& range) {
      const double share = (deg - degrees.low) / (degrees.high - degrees.low);
      return std::clamp(range.low + share * (range.high - range.low), range.low, range.high);
    };
    return {count(-target[0] / degree, query_.azimuth_deg, profile_.x),
            count(target[1] / degree, query_.elevation_deg, profile_.y)};
  }

  OnvifQuery query_;
  std::shared_ptr<HeadClock> clock_;
  OnvifService service_;
  OnvifProfile profile_;
  HeadLimits limits_;
};

}  // namespace

std::unique_ptr<HeadDevice> open_onvif(const std::string& url, const HeadOptions& options) {
  return std::make_unique<OnvifHead>(url, options);
}

std::string onvif_stream_url(const std::string& url, const HeadOptions& options) {
  const OnvifQuery query = onvif_query(url);
  OnvifService service(url, options);
  const std::vector<OnvifProfile> all = service.profiles();
  for (std::size_t i = 0; i < all.size(); ++i) {
    const bool is_it = query.profile_token.empty() ? i == query.profile : all[i].token == query.profile_token;
    if (is_it) return service.stream_uri(all[i]);
  }
  throw InputError(fmt::format("{}: has no such profile; it has {}", service.name(), all.size()));
}

}  // namespace alidade
