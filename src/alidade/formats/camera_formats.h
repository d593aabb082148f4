#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "alidade/camera/camera.h"
#include "alidade/files/files.h"
#include "alidade/files/yaml_fields.h"

/// The formats behind read_camera() and camera_text(), one pair of functions each. Readers throw InputError.
namespace alidade::detail {

/// Text of a file, its name in messages, and the name of the requested camera (empty: the only one).
struct CameraText {
  std::string_view text;
  std::string name;
  std::string choice;
};

/// A camera, and what else its file contains; see unread_parts() and lens_doubt().
struct CameraContent {
  Camera camera;
  std::vector<std::string> unread;
  std::string doubt = {};
};

[[nodiscard]] Camera read_alidade(const YAML::Node& root, const CameraText& file);
[[nodiscard]] std::string write_alidade(const Camera& camera);

/// The requested camera is "brown" or "fisheye", for a file that does not name its lens.
[[nodiscard]] CameraContent read_opencv(const YAML::Node& root, const CameraText& file);
[[nodiscard]] CameraContent read_opencv_xml(const CameraText& file);
[[nodiscard]] std::string write_opencv(const Camera& camera);

[[nodiscard]] CameraContent read_ros(const YAML::Node& root, const CameraText& file);
[[nodiscard]] std::string write_ros(const Camera& camera);

[[nodiscard]] CameraContent read_kalibr(const YAML::Node& root, const CameraText& file);
[[nodiscard]] std::string write_kalibr(const Camera& camera);

[[nodiscard]] CameraContent read_mrcal(const CameraText& file);
[[nodiscard]] std::string write_mrcal(const Camera& camera);

[[nodiscard]] CameraContent read_colmap(const CameraText& file);
[[nodiscard]] std::string write_colmap(const Camera& camera);

/// Whether a text is one of the camera files that read_slam_camera() knows.
[[nodiscard]] bool is_slam_camera(std::string_view text);
/// Reads SceneLib's configuration, Civera's initialize_cam.m, Heikkilä & Silvén's `sys` and `par`, and Bouguet's
/// Calib_Results.m. These formats are not written.
[[nodiscard]] CameraContent read_slam_camera(const CameraText& file);

/// The index of the requested camera in a file; throws if the choice is ambiguous, and lists the names.
[[nodiscard]] std::size_t chosen_camera(const std::vector<std::string>& names, const CameraText& file);

/// "that it is cam1 of 2 cameras (cam0, cam1)"; empty for a file with one camera.
[[nodiscard]] std::vector<std::string> place_among(const std::vector<std::string>& names, std::size_t chosen);

/// fx, fy, cx, cy of any lens, and the distortion in the order k1 k2 p1 p2 k3 (brown) or k1 k2 k3 k4.
[[nodiscard]] std::vector<double> focal_and_centre(const Camera& camera);
[[nodiscard]] std::vector<double> distortion(const Camera& camera);

/// A camera from fx, fy, cx, cy and OpenCV's coefficients k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4 τx τy (0, 4, 5, 8, 12 or
/// 14 of them). Throws for non-zero coefficients that a brown lens does not have; all zero is a pinhole.
[[nodiscard]] Camera opencv_camera(const std::vector<double>& focal_centre, const std::vector<double>& coefficients,
                                   const std::string& file, const std::string& key);
/// A fisheye from fx, fy, cx, cy and k1…k4.
[[nodiscard]] Camera fisheye_camera(const std::vector<double>& focal_centre, const std::vector<double>& coefficients,
                                    const std::string& file, const std::string& key);

}  // namespace alidade::detail
