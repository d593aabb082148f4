#pragma once

#include <string>
#include <vector>

#include "alidade/heads/head_calibrate.h"

namespace alidade {

/// A field so narrow that of a lens only the focal length can be determined: its centre and the mounting look alike.
[[nodiscard]] bool is_narrow(const HeadCalibration& result, double focal_px);

/// What `alidade` with the words of `offline` says of result.log_csv, down to the last digit: it is read back from its
/// text.
[[nodiscard]] ObserveReport observed(const HeadCalibration& result);
/// Where the pixels of a frame err together, as if its rotation were read with noise (a head that rounds): estimated
/// with the rest, once more.
void heed_noise_of_readings(HeadCalibration& result);

}  // namespace alidade
