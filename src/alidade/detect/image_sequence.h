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

/// Whether a sequence of `localize` is images (a folder, a video), or else a table of observations.
[[nodiscard]] bool is_image_sequence(const std::filesystem::path& path);

/// Images with their times: a folder of numbered images, a video, or a folder in EuRoC's layout (`mav0/cam0/data` with
/// `data.csv`, times in ns; M. Burri et al., IJRR 35(10), 2016), grey and of the camera's size. `rate_hz`: time of a
/// frame is its number over this, the first at 0; not needed where data.csv or the video has times (a video's are then
/// not taken, and data.csv has to agree). Throws InputError: no such thing, no images, no times, times that run
/// backwards, an image that data.csv does not name; and when it comes to it, what is no image, or not of that size.
/// Copies share how far they are. With `more` the folder of numbered images may still be filled by another program, in
/// order, and be empty at first: `more` is asked where there is no further image, or the newest one is not yet whole;
/// true, after a while: look again; false: that was all. How many there will be is then not known. Throws InputError
/// also for a video or EuRoC's layout, and for an image that comes after a later one.
[[nodiscard]] ImageStream images_in(const std::filesystem::path& path, const Camera& camera, double rate_hz = 0.0,
                                    const std::function<bool()>& more = {});

/// The time [ns] that is zero in such a folder of EuRoC's layout, the first in its data.csv: of other files of the same
/// recording, as imu0/data.csv, this has to be subtracted. 0 for any other sequence. Throws InputError.
[[nodiscard]] std::int64_t origin_ns_of(const std::filesystem::path& path);

/// Reads target.yaml for images: `rectangle: {width_m, height_m, sigma_m}`, `board: {corners, square_m}`, or `points`
/// of which each has a `patch`, a small grey image of it, relative to the file.
[[nodiscard]] LocalizeTarget read_image_target(const std::filesystem::path& file);

ALIDADE_PUBLIC_END
}  // namespace alidade
