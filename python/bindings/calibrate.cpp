#include "alidade/calibrate.h"

#include <chrono>

#include "alidade/board_detector/find_board.h"
#include "alidade/images/photos.h"
#include "alidade/results/calibration_outcome.h"
#include "alidade/tables/corner_file.h"
#include "python/bindings/bindings.h"
#include "python/bindings/ending.h"
#include "python/bindings/fields.h"
#include "python/bindings/images.h"
#include "python/bindings/waiting.h"

namespace alidade::python {
namespace {

using Clock = std::chrono::steady_clock;

CalibrateConfig config_of(const Texts& values, const std::optional<Camera>& air, const Array& board_points) {
  CalibrateConfig config;
  set_fields(fields_of(config), values);
  config.port.air = air;
  if (board_points.size() == 0) return config;
  config.board_shape = BoardShape::given;
  const auto points = vectors_of<3>(board_points);
  config.board_points.assign(points.begin(), points.end());
  return config;
}

/// The seconds that the command reports, by the same names.
class Laps {
 public:
  void lap(std::string part) { parts_.emplace_back(std::move(part), since(std::exchange(lap_, Clock::now()))); }
  void tell(JobOutcome& outcome) {
    parts_.insert(parts_.begin(), {"total", since(start_)});
    outcome.document.seconds = std::move(parts_);
  }

 private:
  static double since(Clock::time_point then) { return std::chrono::duration<double>(Clock::now() - then).count(); }
  Clock::time_point start_ = Clock::now(), lap_ = start_;
  std::vector<std::pair<std::string, double>> parts_;
};

OutcomePtr kept_outcome(const Calibration& result, JobOutcome job) {
  std::optional<Camera> camera;
  if (result.status == CalibrateReport::Status::converged) camera = result.camera;
  if (camera) camera->source = "alidade calibrate";
  return std::make_shared<Outcome>(Outcome{std::move(job), std::move(camera), result.model_cov});
}

OutcomePtr from_files(const std::vector<std::string>& files, const Board& board, const Texts& values,
                      const std::optional<Camera>& air, const Array& board_points, const py::object& progress) {
  const CalibrateConfig config = config_of(values, air, board_points);
  return value_of<OutcomePtr>(
      [=](const Progress& report) {
        Laps laps;
        const PhotoSet set(std::vector<std::filesystem::path>(files.begin(), files.end()));
        const Photos photos = set.photos();
        const Calibration result = calibrate(photos, board, config, report);
        laps.lap("solve");
        set.require_readable(result.num_unreadable, result.views.empty() ? "" : result.views.front().reason);
        JobOutcome job = outcome_of(result);
        add_images(result, photos, job);
        laps.lap("pictures");
        add_photos(set, job);
        laps.tell(job);
        return kept_outcome(result, std::move(job));
      },
      progress);
}

OutcomePtr from_images(const std::vector<std::string>& names, const std::vector<py::array>& images, const Board& board,
                       const Texts& values, const std::optional<Camera>& air, const Array& board_points,
                       const py::object& progress) {
  const CalibrateConfig config = config_of(values, air, board_points);
  const Photos photos = photos_of(names, images);
  return value_of<OutcomePtr>(
      [=](const Progress& report) {
        Laps laps;
        const Calibration result = calibrate(photos, board, config, report);
        laps.lap("solve");
        JobOutcome job = outcome_of(result);
        add_images(result, photos, job);
        laps.lap("pictures");
        laps.tell(job);
        return kept_outcome(result, std::move(job));
      },
      progress);
}

/// Corners N × P × 2 and covariances N × P × 2 × 2 (or none) as views; a corner that is NaN was not seen.
std::vector<BoardView> views_of(const std::vector<std::string>& names, const Array& corners, const Array& covariances) {
  const auto num_points = static_cast<std::size_t>(corners.shape(1));
  std::vector<BoardView> views;
  for (std::size_t k = 0; k < names.size(); ++k) {
    BoardView& view = views.emplace_back(BoardView{.photo = names[k], .corners = {}});
    for (std::size_t i = 0; i < num_points; ++i) {
      const double* const px = corners.data() + 2 * (k * num_points + i);
      if (std::isnan(px[0]) || std::isnan(px[1])) continue;
      Corner corner{.index = static_cast<int>(i), .px = {px[0], px[1]}};
      if (covariances.size() > 0) {
        corner.cov = Eigen::Map<const Eigen::Matrix2d>(covariances.data() + 4 * (k * num_points + i));
      }
      view.corners.push_back(corner);
    }
  }
  return views;
}

/// `given`: width and height; 0: the lens' in air, else the least that holds the corners.
OutcomePtr from_views(std::vector<BoardView> views, std::vector<SkippedInput> skipped, std::pair<int, int> given,
                      const Board& board, const CalibrateConfig& config, const py::object& progress) {
  const std::optional<Camera>& air = config.port.air;
  ImageSize size{given.first, given.second};
  if (size.width_px == 0 && air) size = {air->width_px, air->height_px};
  if (size.width_px == 0) size = min_size(views);
  return value_of<OutcomePtr>(
      [=](const Progress& report) {
        Laps laps;
        const Calibration result = calibrate(views, size, board, config, report);
        laps.lap("solve");
        JobOutcome job = outcome_of(result);
        std::vector<SkippedInput>& all = job.document.counts.skipped;
        all.insert(all.begin(), skipped.begin(), skipped.end());
        laps.tell(job);
        return kept_outcome(result, std::move(job));
      },
      progress);
}

OutcomePtr from_corners(const std::vector<std::string>& names, const Array& corners, const Array& covariances,
                        std::pair<int, int> size, const Board& board, const Texts& values,
                        const std::optional<Camera>& air, const Array& board_points, const py::object& progress) {
  std::vector<BoardView> views = views_of(names, corners, covariances);
  return from_views(std::move(views), {}, size, board, config_of(values, air, board_points), progress);
}

OutcomePtr from_corner_file(const std::string& file, bool skip_bad, std::pair<int, int> size, const Board& board,
                            const Texts& values, const std::optional<Camera>& air, const Array& board_points,
                            const py::object& progress) {
  std::vector<SkippedInput> skipped;
  std::vector<BoardView> views = read_corners(file, num_points(board), skip_bad ? &skipped : nullptr);
  return from_views(std::move(views), std::move(skipped), size, board, config_of(values, air, board_points), progress);
}

/// Corners P × 2 (NaN: not seen), covariances P × 2 × 2, and why there are none ("" where there are).
py::tuple found_board(const cv::Mat& pixels, const Board& board) {
  BoardDetection found;
  {
    const Released released;
    found = find_board(pixels, board);
  }
  const py::ssize_t num = num_points(board);
  Array corners({num, py::ssize_t{2}}), covariances({num, py::ssize_t{2}, py::ssize_t{2}});
  std::fill_n(corners.mutable_data(), corners.size(), std::nan(""));
  std::fill_n(covariances.mutable_data(), covariances.size(), std::nan(""));
  for (const Corner& corner : found.view.corners) {
    std::copy_n(corner.px.data(), 2, corners.mutable_data() + 2 * corner.index);
    std::copy_n(corner.cov.data(), 4, covariances.mutable_data() + 4 * corner.index);
  }
  return py::make_tuple(corners, covariances, found.reason);
}

py::tuple find_in_file(const std::string& file, const Board& board) {
  cv::Mat pixels;
  {
    const Released released;
    pixels = decode_photo(read_file(file), file);
  }
  return found_board(pixels, board);
}

py::tuple find_in_image(const py::array& image, const Board& board) {
  return found_board(photos_of({"image"}, {image}).load(0), board);
}

}  // namespace

void bind_calibrate(py::module_& module) {
  module.def("calibrate_files", &from_files);
  module.def("calibrate_images", &from_images);
  module.def("calibrate_corners", &from_corners);
  module.def("calibrate_corner_file", &from_corner_file);
  module.def("find_in_file", &find_in_file);
  module.def("find_in_image", &find_in_image);
}

}  // namespace alidade::python
