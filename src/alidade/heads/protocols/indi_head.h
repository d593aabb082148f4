#pragma once

#include <memory>
#include <string>

#include "alidade/heads/head_device.h"

namespace alidade {

/// indi://HOST:PORT/DEVICE: a telescope mount behind an INDI server (port 7624). Pan is its right ascension, tilt its
/// declination, of date: for a mount that tracks, the sky stands still. It names no limits. Throws InputError.
[[nodiscard]] std::unique_ptr<HeadDevice> open_indi(const std::string& url, const HeadOptions& options);

}  // namespace alidade
