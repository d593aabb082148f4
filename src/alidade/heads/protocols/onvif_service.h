#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "alidade/heads/head_device.h"
#include "alidade/heads/protocols/tls.h"

namespace alidade {

/// A range of numbers.
struct OnvifRange {
  double low = -1.0, high = 1.0;
};

/// What can be asked of a profile.
struct OnvifProfile {
  std::string token, name, ptz_token;
  OnvifRange x, y;
  bool counts_degrees = false;  ///< x and y are angles: ONVIF's SphericalPositionSpaceDegrees.
  bool has_pan_tilt = false, has_zoom = false;
};

/// Position as the camera counts it.
struct OnvifStatus {
  double x = 0.0, y = 0.0;
  bool has_pan_tilt = false;
  double zoom = 0.0;
  bool has_zoom = false;
};

/// Whom to believe, where the address asks for TLS by https=1, or by cert= for a camera that signs for itself; none: it
/// does not. Throws InputError for a cert that is no SHA-256.
[[nodiscard]] std::optional<TlsTrust> onvif_trust(const std::string& url);

/// ONVIF's services of one camera. Addresses that it announces may belong to another network: of them the path is
/// taken, and host and port are those that were given. Every call ends within the timeout. Throws InputError: nobody
/// answers, a fault, which is quoted.
class OnvifService {
 public:
  OnvifService(const std::string& url, const HeadOptions& options);
  ~OnvifService();
  OnvifService(const OnvifService&) = delete;
  OnvifService& operator=(const OnvifService&) = delete;

  [[nodiscard]] const std::string& name() const;
  [[nodiscard]] std::string maker();  ///< "Manufacturer Model"; empty: it does not say.
  [[nodiscard]] std::vector<OnvifProfile> profiles();
  [[nodiscard]] OnvifStatus status(const OnvifProfile& profile);
  void move_to(const OnvifProfile& profile, double x, double y);
  void zoom_to(const OnvifProfile& profile, double share);
  void stop(const OnvifProfile& profile);
  [[nodiscard]] std::string stream_uri(const OnvifProfile& profile);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace alidade
