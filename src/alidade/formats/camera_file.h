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

/// Formats that are read and written: `opencv` is cv::FileStorage (YAML; XML and JSON are read too), `ros` a
/// camera_info YAML, `kalibr` a camchain YAML, `mrcal` a .cameramodel, `colmap` a cameras.txt. Read only: the camera
/// files of SceneLib (Davison), of Civera's initialize_cam.m, and of the toolboxes of Heikkilä & Silvén and of Bouguet
/// (Calib_Results.m). The pitfalls of each format: docs/maths/camera-models.md.
enum class CameraFormat { alidade, opencv, ros, kalibr, mrcal, colmap };

/// Reads a camera file of any known format, which is recognised by its content. In a file with several cameras one is
/// chosen by its name: "camchain.yaml:cam1". An OpenCV file with four coefficients that does not name their lens model
/// is read as brown; "file.yml:fisheye" reads them as those of cv::fisheye, see lens_doubt(). Throws InputError, also
/// for a lens model that is not supported.
[[nodiscard]] Camera read_camera(const std::filesystem::path& file);

/// The same for uses that need a central camera: throws InputError for a flat_port camera, whose rays do not meet.
[[nodiscard]] Camera read_central_camera(const std::filesystem::path& file);
/// Throws the same InputError for a given camera; `name` begins the message.
void require_central(const Camera& camera, const std::string& name);

/// read_camera() of a given text; `name` is used as the file name in messages, `choice` is the camera's name in the
/// file (empty: the only one).
[[nodiscard]] Camera parse_camera(std::string_view text, const std::string& name, const std::string& choice = "");

/// What a camera file contains besides the camera, which read_camera() ignores and camera_text() does not write: its
/// pose relative to others (T_cn_cnm1 of Kalibr, extrinsics of mrcal), its position in a stereo pair (R and P of ROS),
/// which of several cameras it is. In words; empty for most files. Reads and throws as read_camera() does.
[[nodiscard]] std::vector<std::string> unread_parts(const std::filesystem::path& file);

/// The other lens model to which a file's coefficients may belong, in words; empty if the file, or the model chosen
/// after its name ("file.yml:brown"), states it. Reads and throws as read_camera() does.
[[nodiscard]] std::string lens_doubt(const std::filesystem::path& file);

/// The file in "camchain.yaml:cam1"; any other path is returned unchanged.
[[nodiscard]] std::filesystem::path file_of_camera(const std::filesystem::path& named);

/// A lens fitted to another, and its error over the other's image.
struct FittedLens {
  Camera camera;
  double rms_px = 0.0, max_px = 0.0;  ///< Infinite if its view does not cover that of the other.
};
/// The lens that a format can hold and that is closest to the camera's: terms that the format does not have are zero,
/// all others are fitted by least squares over the image. If nothing is lost, the camera unchanged.
[[nodiscard]] FittedLens fitted_lens(const Camera& camera, CameraFormat format);

/// Text of a camera in a format. Throws InputError that says what would be lost, unless `lossy`: then fitted_lens() is
/// used. Also throws if the format has no such lens at all.
[[nodiscard]] std::string camera_text(const Camera& camera, CameraFormat format, bool lossy = false);

/// Writes the camera to a file, as write_file() does. Throws as camera_text() does, and if the file cannot be written.
void write_camera(const std::filesystem::path& file, const Camera& camera, CameraFormat format = CameraFormat::alidade,
                  bool lossy = false);

/// What of the lens the format cannot store, for example "skew 0.3 px"; camera_text() refuses to lose these.
[[nodiscard]] std::vector<std::string> lens_losses(const Camera& camera, CameraFormat format);
/// What else the format cannot store (covariance, RMS): this is reported, not refused.
[[nodiscard]] std::vector<std::string> other_losses(const Camera& camera, CameraFormat format);

/// The format with that name (`opencv`, `ros`, …). Throws InputError for an unknown name.
[[nodiscard]] CameraFormat camera_format(std::string_view name);
[[nodiscard]] std::string_view camera_format_name(CameraFormat format);

ALIDADE_PUBLIC_END
}  // namespace alidade
