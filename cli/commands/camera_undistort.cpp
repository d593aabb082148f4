#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <atomic>
#include <mutex>
#include <opencv2/imgproc.hpp>
#include <set>

#include "alidade/camera/undistort.h"
#include "alidade/formats/camera_file.h"
#include "alidade/imaging/image_codecs.h"
#include "cli/app/app.h"
#include "cli/app/option_checks.h"
#include "cli/commands/camera.h"
#include "cli/commands/camera_values.h"

namespace alidade::cli {
namespace {

struct UndistortArgs {
  std::string camera;
  std::vector<std::string> photos;
  double zoom = 1.0;
};

cv::Mat read_photo(const std::string& file, const Camera& camera) {
  const std::string bytes = read_file(file);
  const cv::Mat photo = decode_image(bytes, /*keep_alpha=*/true);  // as the sensor saw it: no EXIF rotation
  if (photo.empty()) throw InputError(file + ": is not a photo that can be read");
  if (photo.cols != camera.width_px || photo.rows != camera.height_px) {
    throw InputError(fmt::format("{}: is {} × {} px, but the camera is {} × {} px", file, photo.cols, photo.rows,
                                 camera.width_px, camera.height_px));
  }
  return photo;
}

/// PNG file names, one per photo. Refuses two photos of one name, and a result that would replace a photo.
std::vector<std::string> result_names(const UndistortArgs& args, const std::filesystem::path& out) {
  std::vector<std::string> names;
  std::set<std::string> seen;
  for (const std::string& photo : args.photos) {
    names.push_back(std::filesystem::path(photo).stem().string() + ".png");
    if (!seen.insert(names.back()).second) {
      throw InputError(
          fmt::format("{}: another photo gives {} too; undistort them into different folders", photo, names.back()));
    }
    std::error_code ignored;
    if (std::filesystem::equivalent(photo, out / names.back(), ignored)) {
      throw InputError(photo + ": would be replaced by its result; give another --out");
    }
  }
  return names;
}

std::string undistorted_png(const cv::Mat& photo, const cv::Mat& u_px, const cv::Mat& v_px, const std::string& file) {
  cv::Mat straight;
  try {
    cv::remap(photo, straight, u_px, v_px, cv::INTER_LANCZOS4, cv::BORDER_REPLICATE);
    straight.setTo(cv::Scalar::all(0.0), u_px == -1.0f);
    return png_bytes(straight);
  } catch (const std::exception&) {
    throw InputError(file + ": has pixels of a kind that PNG cannot hold");
  }
}

/// The photos through the map, to be written at the end of the run like all that it leaves.
void add_straight_photos(const UndistortArgs& args, const Camera& camera, PixelMap& map,
                         const std::vector<std::string>& names, Run& run) {
  const cv::Mat u_px(map.height_px, map.width_px, CV_32F, map.u_px.data());
  const cv::Mat v_px(map.height_px, map.width_px, CV_32F, map.v_px.data());
  std::mutex mutex;
  std::size_t num_done = 0;
  tbb::parallel_for(std::size_t{0}, names.size(), [&](std::size_t i) {
    std::string png = undistorted_png(read_photo(args.photos[i], camera), u_px, v_px, args.photos[i]);
    const std::scoped_lock lock(mutex);
    run.add_file(names[i], std::move(png));
    report_progress(run.progress, "undistorting", ++num_done, names.size());
  });
  run.document.files = names;  // in the order of the photos, not of the threads
}

ExitCode undistort(const UndistortArgs& args, Run& run) {
  const Camera camera = read_camera_input(run, args.camera);
  require_central(camera, args.camera);
  const Camera straight = undistorted_camera(camera, args.zoom);
  const std::filesystem::path& out = run.options.out;
  const std::vector<std::string> names = result_names(args, out);
  std::atomic<std::size_t> num_done = 0;
  const std::size_t count = args.photos.size();
  // All photos are looked at before any result is written: a bad one leaves nothing behind.
  tbb::parallel_for(std::size_t{0}, count, [&](std::size_t i) {
    (void)read_photo(args.photos[i], camera);
    report_progress(run.progress, "reading", ++num_done, count);
  });
  for (const std::string& photo : args.photos) run.add_input("photo", photo);
  run.lap("read");

  PixelMap map = undistortion_map(camera, straight);
  add_straight_photos(args, camera, map, names, run);
  run.lap("undistort");

  const std::ptrdiff_t num_black = std::count(map.u_px.begin(), map.u_px.end(), -1.0f);
  run.document.counts.given = run.document.counts.used = count;
  run.document.estimate["camera"] = camera_values(straight);
  run.document.estimate["black_share"] = static_cast<double>(num_black) / static_cast<double>(map.u_px.size());
  run.add_file("camera.yaml", camera_text(straight, CameraFormat::alidade));
  run.say(
      fmt::format("{} photo{} → {}, as the pinhole of camera.yaml there", count, count == 1 ? "" : "s", out.string()));
  Verdict verdict;
  verdict.sentence = fmt::format("Straight lines are straight; {:.1f} % of each image is black",
                                 100.0 * static_cast<double>(num_black) / static_cast<double>(map.u_px.size()));
  return run.finish(verdict);
}

}  // namespace

void add_camera_undistort(App& app) {
  auto args = std::make_shared<UndistortArgs>();
  CLI::App& command =
      app.add_command({.name = "camera undistort",
                       .summary = "Undistort photos to a pinhole camera; PNG files in DIR",
                       .examples = "  alidade camera undistort camera.yaml photos/*.jpg --out straight\n"
                                   "  alidade camera undistort fisheye.yaml wide.jpg --zoom 0.5"},
                      [args](Run& run) { return undistort(*args, run); });
  command.add_option("camera", args->camera, "Camera file")->required();
  command.add_option("photos", args->photos, "Photos taken with that camera")->required();
  command.add_option("--zoom", args->zoom, "Focal length of the result relative to the camera's; below 1 shows more")
      ->check(positive_number())
      ->capture_default_str();
}

}  // namespace alidade::cli
