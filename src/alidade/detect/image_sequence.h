#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>

#include "alidade/camera/camera.h"
#include "alidade/localize/sequence.h"
#include "alidade/localize/target.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// Whether the input of `localize` is images (a folder, a video); if not, it is a table of observations.
[[nodiscard]] bool is_image_sequence(const std::filesystem::path& path);

/// Images with their times, grey and of the camera's size: a folder of numbered images, a video, or a folder in EuRoC's
/// layout (`mav0/cam0/data` with `data.csv`, times in ns; M. Burri et al., IJRR 35(10), 2016). `rate_hz`: the time of a
/// frame is its number over this rate, the first at 0; not needed if data.csv or the video has times (it then replaces
/// the video's times, and data.csv must agree with it). Throws InputError for a path that does not exist, no images, no
/// times, times that run backwards, or an image that data.csv does not name; while reading, also for a file that is not
/// an image or has another size. Copies share their position. With `more`, another program may still be filling the
/// folder of numbered images, in order, from empty on: `more` is called if there is no further image, or the newest is
/// incomplete; it returns true, after a while, to look again, false at the end. The number of images is then unknown.
/// InputError is also thrown for a video or EuRoC's layout, and for an image that comes after a later one.
[[nodiscard]] ImageStream images_in(const std::filesystem::path& path, const Camera& camera, double rate_hz = 0.0,
                                    const std::function<bool()>& more = {});

/// The time [ns] of t = 0 in a folder of EuRoC's layout, the first in its data.csv; it must be subtracted from the
/// times of other files of the same recording, such as imu0/data.csv. 0 for any other sequence. Throws InputError.
[[nodiscard]] std::int64_t origin_ns_of(const std::filesystem::path& path);

/// Reads target.yaml for images: `rectangle: {width_m, height_m, sigma_m}`, `board: {corners, square_m}`, or `points`,
/// each with a `patch`, a small grey image of the point, relative to the file.
[[nodiscard]] LocalizeTarget read_image_target(const std::filesystem::path& file);

ALIDADE_PUBLIC_END
}  // namespace alidade
