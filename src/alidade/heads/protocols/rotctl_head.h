#pragma once

#include <memory>
#include <string>

#include "alidade/heads/head_device.h"

namespace alidade {

/// Hamlib's rotctld by its text protocol, rotctl://HOST:PORT: pan = −azimuth, tilt = elevation. Its commands are `p`,
/// `P`, `S` and `\dump_state`; https://hamlib.sourceforge.net/html/rotctld.1.html.
[[nodiscard]] std::unique_ptr<HeadDevice> open_rotctl(const std::string& url, const HeadOptions& options);

}  // namespace alidade
