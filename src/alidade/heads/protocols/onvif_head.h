#pragma once

#include <memory>
#include <string>

#include "alidade/heads/head_device.h"

namespace alidade {

/// onvif://[USER@]HOST:PORT[/?profile=0&az=-180:180&el=-90:90]: a network camera that pans and tilts, by ONVIF's PTZ
/// service. Pan = −azimuth, tilt = elevation. A camera that counts in −1…1 does not say what that is in degrees: `az`
/// and `el` do, of x and y (without: ±180° and ±90°, and the limits count as not named). Throws InputError.
[[nodiscard]] std::unique_ptr<HeadDevice> open_onvif(const std::string& url, const HeadOptions& options);

/// Where the camera of such a URL says that its images are: rtsp://…, at the host that was given.
[[nodiscard]] std::string onvif_stream_url(const std::string& url, const HeadOptions& options);

}  // namespace alidade
