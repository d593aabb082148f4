#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "alidade/camera/camera.h"
#include "alidade/files/files.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// `opencv` is cv::FileStorage (YAML; XML and JSON are read too), `ros` a camera_info YAML, `kalibr` a camchain YAML,
/// `mrcal` a .cameramodel, `colmap` a cameras.txt. Read, but not written, are also the camera files of SceneLib
/// (Davison), of Civera's initialize_cam.m and of the toolboxes of Heikkilä & Silvén and of Bouguet (Calib_Results.m).
/// The traps of each: docs/maths/camera-models.md.
enum class CameraFormat { alidade, opencv, ros, kalibr, mrcal, colmap };

/// Reads a camera file of any known format, recognised by its content. Of a file with several cameras one is chosen by
/// its name in the file: "camchain.yaml:cam1". A file of OpenCV with four coefficients that does not say whose they are
/// is read as brown; "file.yml:fisheye" reads them as those of cv::fisheye, see lens_doubt(). Throws InputError, also
/// for a lens model that is not supported.
[[nodiscard]] Camera read_camera(const std::filesystem::path& file);

/// The same where all rays must meet in one point: throws InputError for a flat_port camera.
[[nodiscard]] Camera read_central_camera(const std::filesystem::path& file);
/// Throws that InputError for a given camera; `name` begins the message.
void require_central(const Camera& camera, const std::string& name);

/// read_camera() of a given text; `name` stands for the file in messages, `choice` is the camera's name in the
/// file (empty: the only one).
[[nodiscard]] Camera parse_camera(std::string_view text, const std::string& name, const std::string& choice = "");

/// What a camera file holds beside the camera, which read_camera() ignores and camera_text() does not write again:
/// its pose relative to others (T_cn_cnm1 of Kalibr, extrinsics of mrcal), its position in a stereo pair (R and P of
/// ROS), which of several it is. In words, empty for most files. Reads and throws as read_camera() does.
[[nodiscard]] std::vector<std::string> unread_parts(const std::filesystem::path& file);

/// Of which lens the coefficients of a file may be as well, in words; empty where the file, or the lens chosen behind
/// its name ("file.yml:brown"), says it. Reads and throws as read_camera() does.
[[nodiscard]] std::string lens_doubt(const std::filesystem::path& file);

/// The file of "camchain.yaml:cam1"; any other as it is.
[[nodiscard]] std::filesystem::path file_of_camera(const std::filesystem::path& named);

/// A lens, and by how much it is off over the image of another.
struct FittedLens {
  Camera camera;
  double rms_px = 0.0, max_px = 0.0;  ///< Infinite where it does not see all that the other sees.
};
/// The lens that a format can hold and that sees most nearly what the camera sees: terms that it cannot hold are zero,
/// all others fitted by least squares over the image. Where nothing is lost, the camera as it is.
[[nodiscard]] FittedLens fitted_lens(const Camera& camera, CameraFormat format);

/// A camera as text of a format. Throws InputError saying what would be lost, unless `lossy`: then fitted_lens(). Also
/// throws if the format has no such lens at all.
[[nodiscard]] std::string camera_text(const Camera& camera, CameraFormat format, bool lossy = false);

/// Writes it, whole. Throws as camera_text() does, and where the file cannot be written.
void write_camera(const std::filesystem::path& file, const Camera& camera, CameraFormat format = CameraFormat::alidade,
                  bool lossy = false);

/// What of the lens the format cannot store, "skew 0.3 px" each; camera_text() refuses these.
[[nodiscard]] std::vector<std::string> lens_losses(const Camera& camera, CameraFormat format);
/// What else a format does not store (covariance, RMS): reported, not refused.
[[nodiscard]] std::vector<std::string> other_losses(const Camera& camera, CameraFormat format);

/// The format of a name (`opencv`, `ros`, …). Throws InputError for an unknown one.
[[nodiscard]] CameraFormat camera_format(std::string_view name);
[[nodiscard]] std::string_view camera_format_name(CameraFormat format);

ALIDADE_PUBLIC_END
}  // namespace alidade
