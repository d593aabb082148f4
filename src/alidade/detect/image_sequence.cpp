#include "alidade/detect/image_sequence.h"

#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cmath>
#include <memory>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "alidade/files/files.h"
#include "alidade/files/yaml_fields.h"
#include "alidade/images/photos.h"
#include "alidade/images/video.h"
#include "alidade/tables/localize_file.h"

namespace alidade {
namespace {

using std::filesystem::path;

/// EuRoC's folder of images and its table, wherever in the layout one points. Empty paths: another layout.
struct AslFolder {
  path images, table;
};

AslFolder asl_folder(const path& given) {
  std::error_code error;
  for (const path& cam :
       {given, given / "cam0", given / "mav0" / "cam0", given.parent_path(), given.parent_path().parent_path()}) {
    if (!std::filesystem::exists(cam / "data.csv", error) || !std::filesystem::is_directory(cam / "data", error))
      continue;
    return {cam / "data", cam / "data.csv"};
  }
  return {};
}

path images_of(const path& given) {
  const AslFolder asl = asl_folder(given);
  return asl.images.empty() ? given : asl.images;
}

/// Of EuRoC's table: the times and names of its images.
struct AslTable {
  std::vector<std::int64_t> times_ns;
  std::vector<std::string> names;
};

/// `timestamp [ns],filename` a row; lines that begin with # are comments.
AslTable read_asl_table(const path& file) {
  const std::string text = read_file(file);
  AslTable table;
  std::size_t line = 0;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = std::min(text.find('\n', at), text.size());
    std::string row = text.substr(at, end - at);
    at = end + 1;
    ++line;
    while (!row.empty() && (row.back() == '\r' || row.back() == ' ')) row.pop_back();
    if (row.empty() || row.front() == '#') continue;
    const auto fail = [&](const std::string& what) {
      throw InputError(fmt::format("{}:{}: {}", file.string(), line, what));
    };
    const std::size_t comma = row.find(',');
    std::int64_t time_ns = -1;
    const char* const end_of_time = row.data() + std::min(comma, row.size());
    const auto read = std::from_chars(row.data(), end_of_time, time_ns);
    if (comma == std::string::npos || read.ec != std::errc{} || read.ptr != end_of_time || time_ns < 0)
      fail("is not 'timestamp [ns],filename'");
    if (!table.times_ns.empty() && time_ns <= table.times_ns.back())
      fail(fmt::format("'{}' is not after the time before it", time_ns));
    table.times_ns.push_back(time_ns);
    table.names.push_back(row.substr(std::min(row.find_first_not_of(' ', comma + 1), row.size())));
  }
  return table;
}

/// Seconds after the first.
std::vector<double> asl_times_s(const path& file, const path& images) {
  const AslTable table = read_asl_table(file);
  std::vector<double> times_s;
  for (const path& image : list_photos({images})) {
    const auto at = std::ranges::find(table.names, image.filename().string());
    if (at == table.names.end()) throw InputError(fmt::format("{}: has no time for {}", file.string(), image.string()));
    const std::int64_t time_ns = table.times_ns[static_cast<std::size_t>(at - table.names.begin())];
    times_s.push_back(1e-9 * static_cast<double>(time_ns - table.times_ns.front()));
    if (times_s.size() > 1 && !(times_s.back() > times_s[times_s.size() - 2]))
      throw InputError(
          fmt::format("{}: the time of {} is not after the image before it", file.string(), image.filename().string()));
  }
  return times_s;
}

/// A rate given beside EuRoC's table has to be the table's.
void require_same_rate(const path& file, const std::vector<double>& times_s, double rate_hz) {
  if (!(rate_hz > 0.0) || times_s.size() < 2) return;
  const double own_hz = static_cast<double>(times_s.size() - 1) / (times_s.back() - times_s.front());
  if (std::abs(own_hz / rate_hz - 1.0) > 0.01)
    throw InputError(
        fmt::format("{}: has times, {:.4g} images a second; leave --rate {:.4g} out", file.string(), own_hz, rate_hz));
}

GreyPatch read_patch(const path& file) {
  cv::Mat image = decode_photo(read_file(file)), grey;
  if (image.channels() > 1)
    cv::cvtColor(image, grey, image.channels() == 4 ? cv::COLOR_BGRA2GRAY : cv::COLOR_BGR2GRAY);
  else
    grey = image;
  if (grey.depth() != CV_8U || std::min(grey.cols, grey.rows) < 5 || std::max(grey.cols, grey.rows) > 201)
    throw InputError(file.string() + ": a patch has 8 bits and 5 to 201 pixels a side");
  return {grey.cols, grey.rows, std::vector<std::uint8_t>(grey.begin<std::uint8_t>(), grey.end<std::uint8_t>())};
}

/// The board of which these are the corners, row by row.
Board board_of(const std::vector<KnownPoint>& points) {
  Board board;
  const double y = points.front().point_in_world.y();
  board.cols = static_cast<int>(
      std::ranges::count_if(points, [&](const KnownPoint& point) { return point.point_in_world.y() == y; }));
  board.rows = static_cast<int>(points.size()) / board.cols;
  board.square_m = (points[1].point_in_world - points[0].point_in_world).norm();
  return board;
}

/// Images one after the other, with their times.
class ImageSequence {
 public:
  ImageSequence(const path& given, double rate_hz, int width_px, int height_px, const MoreImages& more);
  [[nodiscard]] bool next(cv::Mat& grey, long& frame, double& t_s);
  [[nodiscard]] std::size_t num_images() const { return frames_.num_frames(); }
  [[nodiscard]] double own_rate_hz() const;

 private:
  VideoFrames frames_;
  [[nodiscard]] double time_in_video(long frame);
  void note_own_time();

  std::vector<double> times_s_;  ///< One per image; empty: number over rate, or without one as the video says.
  std::optional<double> first_s_, last_s_;  ///< In the video.
  std::size_t last_number_ = 0;             ///< Of the frame that is last there, counted from the first.
  double rate_hz_;
  int width_px_, height_px_;
  std::size_t count_ = 0;
};

ImageSequence::ImageSequence(const path& given, double rate_hz, int width_px, int height_px, const MoreImages& more)
    : frames_(images_of(given), FrameColour::grey, more),
      rate_hz_(rate_hz),
      width_px_(width_px),
      height_px_(height_px) {
  const AslFolder asl = asl_folder(given);
  if (more && !asl.table.empty())
    throw InputError(given.string() + ": only a folder of numbered images can be waited for, not one with data.csv");
  if (!asl.table.empty()) {
    times_s_ = asl_times_s(asl.table, asl.images);
    require_same_rate(asl.table, times_s_, rate_hz);
  } else if (std::error_code ignored; !(rate_hz > 0.0) && std::filesystem::is_directory(given, ignored))
    throw InputError(given.string() + ": has no times; give --rate, frames a second");
}

double ImageSequence::own_rate_hz() const {
  if (!(rate_hz_ > 0.0) || last_number_ == 0 || !(*last_s_ > *first_s_)) return 0.0;
  return static_cast<double>(last_number_) / (*last_s_ - *first_s_);
}

/// As the video says, from its first frame on: phones do not film at one rate.
double ImageSequence::time_in_video(long frame) {
  const double t_s = frames_.time_s();
  if (!std::isfinite(t_s)) throw InputError(frames_.name() + ": has no times; give --rate, frames a second");
  if (last_s_ && !(t_s > *last_s_))
    throw InputError(
        fmt::format("{}: the time of frame {} is not after the one before it; give --rate, frames a second",
                    frames_.name(), frame));
  if (!first_s_) first_s_ = t_s;
  last_s_ = t_s;
  return t_s - *first_s_;
}

bool ImageSequence::next(cv::Mat& grey, long& frame, double& t_s) {
  const cv::Mat image = frames_.next();
  if (image.empty()) return false;
  if (image.cols != width_px_ || image.rows != height_px_)
    throw InputError(
        fmt::format("{}: is {}×{}, the camera {}×{}", frames_.name(), image.cols, image.rows, width_px_, height_px_));
  image.convertTo(grey, CV_8U);
  frame = static_cast<long>(frames_.number());
  if (!times_s_.empty())
    t_s = times_s_.at(count_);
  else
    t_s = rate_hz_ > 0.0 ? static_cast<double>(frame) / rate_hz_ : time_in_video(frame);
  if (!times_s_.empty()) frame = static_cast<long>(count_);
  if (rate_hz_ > 0.0 && std::isfinite(frames_.time_s())) note_own_time();
  ++count_;
  return true;
}

void ImageSequence::note_own_time() {
  if (!first_s_) first_s_ = frames_.time_s();
  last_s_ = frames_.time_s();
  last_number_ = count_;
}

}  // namespace

bool is_image_sequence(const path& given) {
  std::error_code error;
  if (std::filesystem::is_directory(given, error)) return true;
  std::string ending = given.extension().string();
  std::ranges::transform(ending, ending.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  constexpr std::array endings{".mp4", ".avi", ".mkv", ".mov", ".webm", ".m4v", ".mpg"};
  return std::ranges::any_of(endings, [&](const char* video) { return ending == video; });
}

std::int64_t origin_ns_of(const path& given) {
  const AslFolder asl = asl_folder(given);
  if (asl.table.empty()) return 0;
  const AslTable table = read_asl_table(asl.table);
  return table.times_ns.empty() ? 0 : table.times_ns.front();
}

ImageStream images_in(const path& given, const Camera& camera, double rate_hz, const std::function<bool()>& more) {
  const auto images = std::make_shared<ImageSequence>(given, rate_hz, camera.width_px, camera.height_px, more);
  const auto next = [images](cv::Mat& grey, long& frame, double& t_s) { return images->next(grey, frame, t_s); };
  return {next, images->num_images(), [images] { return images->own_rate_hz(); }};
}

LocalizeTarget read_image_target(const path& file) {
  const std::string name = file.string();
  const YAML::Node root = detail::load_yaml(read_file(file), name);
  const detail::Fields fields(root, name);
  if (fields.has("rectangle")) {
    if (fields.has("points") || fields.has("board")) detail::refuse(name, "rectangle", "excludes another target");
    const YAML::Node node = root["rectangle"];
    const detail::Fields rectangle(node, name, "rectangle.");
    detail::refuse_unknown_keys(rectangle, {"width_m", "height_m", "sigma_m"}, "a rectangle");
    const double width_m = rectangle.number("width_m"), height_m = rectangle.number("height_m");
    const double sigma_m = rectangle.has("sigma_m") ? rectangle.number("sigma_m") : 0.0003;
    if (!(width_m > 0.0)) detail::refuse(name, "rectangle.width_m", "is not above zero");
    if (!(height_m > 0.0)) detail::refuse(name, "rectangle.height_m", "is not above zero");
    if (!(sigma_m > 0.0)) detail::refuse(name, "rectangle.sigma_m", "is not above zero");
    return rectangle_target(width_m, height_m, sigma_m);
  }
  LocalizeTarget target;
  target.points = read_target(file).points;
  if (fields.has("board")) {
    target.board = board_of(target.points);
    return target;
  }
  for (std::size_t i = 0; i < target.points.size(); ++i) {
    const YAML::Node entry = root["points"][i];
    const detail::Fields point(entry, name, fmt::format("points[{}].", i));
    if (!point.has("patch"))
      detail::refuse(name, point.full("patch"), "is needed: what the point looks like in an image");
    target.patches.push_back(read_patch(file.parent_path() / point.text("patch")));
  }
  return target;
}

}  // namespace alidade
