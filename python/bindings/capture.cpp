#include <cmath>
#include <opencv2/core.hpp>

#include "alidade/capture.h"
#include "python/bindings/bindings.h"
#include "python/bindings/fields.h"
#include "python/bindings/guarded.h"
#include "python/bindings/images.h"

/// Guides: objects that say what to measure next. They work without the GIL, one call at a time.
namespace alidade::python {
namespace {

Array pixel_array(const std::vector<Eigen::Vector2d>& pixels) {
  Array array({static_cast<py::ssize_t>(pixels.size()), py::ssize_t{2}});
  for (std::size_t i = 0; i < pixels.size(); ++i) std::copy_n(pixels[i].data(), 2, array.mutable_data() + 2 * i);
  return array;
}

void put_pose(const Rigid3& cam_from_board, py::dict& made) {
  made["rotation"] = matrix_array(cam_from_board.rotation.toRotationMatrix());
  made["translation_m"] = std::vector<double>(cam_from_board.translation.data(), cam_from_board.translation.data() + 3);
}

/// A copy of an image: (H, W) or (H, W, 3), uint8 or uint16.
py::array image_array(const cv::Mat& image) {
  std::vector<py::ssize_t> shape{image.rows, image.cols};
  if (image.channels() > 1) shape.push_back(image.channels());
  py::array made(image.depth() == CV_16U ? py::dtype::of<std::uint16_t>() : py::dtype::of<std::uint8_t>(), shape);
  const std::size_t row_bytes = static_cast<std::size_t>(image.cols) * image.elemSize();
  for (int row = 0; row < image.rows; ++row) {
    std::copy_n(image.ptr(row), row_bytes,
                static_cast<unsigned char*>(made.mutable_data()) + static_cast<std::size_t>(row) * row_bytes);
  }
  return made;
}

py::dict look_dict(const CaptureLook& look) {
  py::dict made;
  made["earlier_t_s"] = look.earlier ? py::cast(look.earlier->t_s) : py::none();
  const py::object image =
      look.earlier && look.earlier->image ? py::object(image_array(*look.earlier->image)) : py::none();
  made["image"] = image;
  made["picture"] = image;  // these two: former names, for one release
  made["sight"] = std::string(look_status_name(look.status));
  made["status"] = std::string(look_status_name(look.status));
  made["words"] = look.words;
  made["corners"] = pixel_array(look.corners_px);
  made["gain"] = look.gain;
  made["taken"] = look.take();
  return made;
}

py::object pose_dict(const std::optional<NextPose>& next) {
  if (!next) return py::none();
  py::dict made;
  made["words"] = next->words;
  made["outline"] = pixel_array(next->outline_px);
  put_pose(next->cam_from_board, made);
  return made;
}

py::dict state_dict(const CaptureState& state) {
  py::dict made;
  made["photos"] = state.photos;
  made["camera"] = state.has_camera ? py::cast(state.camera) : py::none();
  made["worst_3sigma_px"] = state.worst_3sigma_px;
  made["worst_px"] = std::vector<double>(state.worst_px.data(), state.worst_px.data() + 2);
  made["photos_to_goal"] = state.photos_to_goal ? py::cast(*state.photos_to_goal) : py::none();
  made["next"] = pose_dict(state.next);
  made["warnings"] = state.warnings;
  return made;
}

class LiveCapture {
 public:
  LiveCapture(const Board& board, double until_px, bool is_video, const Texts& values) {
    CaptureConfig config{.until_px = until_px, .is_video = is_video};
    set_fields(fields_of(config.calibrate), values);
    guide_ = std::make_shared<Guarded<CaptureGuide>>(board, config);
    until_px_ = until_px;
  }

  py::dict push(const py::array& image, double t_s) {
    const Photos photos = photos_of({"image"}, {image});
    const cv::Mat pixels = photos.load(0);
    return look_dict(guide_->from_python([&](CaptureGuide& guide) { return guide.push(pixels, t_s); }));
  }

  /// Corners P × 2, NaN: not seen.
  py::dict push_corners(const Array& corners, std::pair<int, int> size, double t_s) {
    const auto px = vectors_of<2>(corners);
    BoardView view;
    for (std::size_t i = 0; i < px.size(); ++i) {
      if (px[i].allFinite()) view.corners.push_back({.index = static_cast<int>(i), .px = px[i]});
    }
    const ImageSize image_size{size.first, size.second};
    return look_dict(guide_->from_python([&](CaptureGuide& guide) { return guide.push(view, image_size, t_s); }));
  }

  void forget(std::size_t photo) {
    guide_->from_python([&](CaptureGuide& guide) { guide.forget(photo); });
  }

  py::dict state() {
    const CaptureState now = guide_->from_python([](const CaptureGuide& guide) { return CaptureState(guide.state()); });
    py::dict made = state_dict(now);
    made["is_at_goal"] = now.is_at(until_px_);
    return made;
  }

 private:
  GuardedPtr<CaptureGuide> guide_;
  double until_px_ = 0.0;
};

/// A number that may not be there.
std::optional<double> known(double value) { return std::isnan(value) ? std::nullopt : std::optional(value); }

class LiveShots {
 public:
  LiveShots(const Camera& camera, const std::optional<Board>& board, const Texts& values, const Texts& where) {
    RangefinderConfig config;
    ShotConfig limits;
    set_fields(fields_of(config), values);
    set_fields(fields_of(limits), where);
    config.board = board;
    guide_ = std::make_shared<Guarded<ShotGuide>>(camera, config, limits);
  }

  /// `spot`: 0 or 2 numbers; `plane`: 0 or 4, n and d; corners P × 2, NaN: not seen, or none.
  void push(double range_m, double sigma_range_m, const std::vector<double>& spot, const std::vector<double>& plane,
            const Array& corners) {
    Shot shot{.range_m = range_m, .sigma_range_m = known(sigma_range_m)};
    if (!spot.empty()) shot.spot = Spot{.px = {spot[0], spot[1]}};
    if (!plane.empty()) shot.plane = Plane{.normal_in_cam = {plane[0], plane[1], plane[2]}, .d_m = plane[3]};
    if (const auto px = vectors_of<2>(corners); !px.empty()) {
      shot.board.emplace();
      for (std::size_t i = 0; i < px.size(); ++i) {
        if (px[i].allFinite()) shot.board->corners.push_back({.index = static_cast<int>(i), .px = px[i]});
      }
    }
    guide_->from_python([&](ShotGuide& guide) { static_cast<void>(guide.push(shot)); });
  }

  void undo() {
    guide_->from_python([](ShotGuide& guide) { guide.undo(); });
  }

  py::dict state() {
    const ShotGuideState now = guide_->from_python([](const ShotGuide& guide) { return guide.state(); });
    py::dict made;
    made["shots"] = now.shots;
    made["has_beam"] = now.has_beam;
    made["words"] = now.words;
    made["sentence"] = now.verdict.sentence;
    made["sigma_origin_m"] = now.sigma_origin_m;
    made["origin_m"] = std::vector<double>(now.beam.origin_in_cam.data(), now.beam.origin_in_cam.data() + 3);
    made["direction"] = std::vector<double>(now.beam.direction_in_cam.data(), now.beam.direction_in_cam.data() + 3);
    made["next"] = py::none();
    if (!now.next) return made;
    py::dict next;
    next["distance_m"] = now.next->distance_m;
    next["tilt_rad"] = now.next->tilt_rad;
    next["azimuth_rad"] = now.next->azimuth_rad;
    put_pose(now.next->cam_from_board, next);
    made["next"] = next;
    return made;
  }

 private:
  GuardedPtr<ShotGuide> guide_;
};

class LiveViews {
 public:
  LiveViews(const std::map<int, Camera>& cameras, const Board& board, const Texts& values, const Texts& where) {
    RigConfig config;
    ViewConfig limits;
    set_fields(fields_of(config), values);
    set_fields(fields_of(limits), where);
    config.board = board;
    guide_ = std::make_shared<Guarded<ViewGuide>>(cameras, config, limits);
  }

  /// Corners P × 2, NaN: not seen.
  void push(int head, std::pair<double, double> pan_tilt_rad, int board, const Array& corners) {
    HeadView view{.board = board, .head = head, .pan_tilt_rad = {pan_tilt_rad.first, pan_tilt_rad.second}};
    const auto px = vectors_of<2>(corners);
    for (std::size_t i = 0; i < px.size(); ++i) {
      if (px[i].allFinite()) view.seen.corners.push_back({.index = static_cast<int>(i), .px = px[i]});
    }
    guide_->from_python([&](ViewGuide& guide) {
      view.seen.photo = "view " + std::to_string(guide.state().views + 1);
      static_cast<void>(guide.push(view));
    });
  }

  void undo() {
    guide_->from_python([](ViewGuide& guide) { guide.undo(); });
  }

  py::dict state() {
    const ViewGuideState now = guide_->from_python([](const ViewGuide& guide) { return guide.state(); });
    py::dict made;
    made["views"] = now.views;
    made["has_rig"] = now.has_rig;
    made["words"] = now.words;
    made["sentence"] = now.verdict.sentence;
    made["sigma_rad"] = now.sigma.angle_rad;
    made["sigma_m"] = now.sigma.length_m;
    made["next"] = py::none();
    if (!now.next) return made;
    py::dict next;
    next["head"] = now.next->head;
    next["pan_tilt_rad"] = std::vector<double>(now.next->pan_tilt_rad.data(), now.next->pan_tilt_rad.data() + 2);
    next["board"] = now.next->board;
    next["is_new_position"] = now.next->is_new_position;
    next["is_new_place"] = now.next->is_new_position;
    next["gain"] = now.next->gain;
    next["outline"] = pixel_array(now.outline_px);
    put_pose(now.next->cam_from_board, next);
    made["next"] = next;
    return made;
  }

 private:
  GuardedPtr<ViewGuide> guide_;
};

}  // namespace

void bind_capture(py::module_& module) {
  py::class_<LiveCapture>(module, "CaptureGuide", plain_type(), "Photos of a board, chosen while they are taken.")
      .def(py::init<const Board&, double, bool, const Texts&>())
      .def("push", &LiveCapture::push)
      .def("push_corners", &LiveCapture::push_corners)
      .def("forget", &LiveCapture::forget)
      .def("state", &LiveCapture::state);
  py::class_<LiveShots>(module, "ShotGuide", plain_type(), "Shots of a rangefinder, chosen one by one.")
      .def(py::init<const Camera&, const std::optional<Board>&, const Texts&, const Texts&>())
      .def("push", &LiveShots::push)
      .def("undo", &LiveShots::undo)
      .def("state", &LiveShots::state);
  py::class_<LiveViews>(module, "ViewGuide", plain_type(), "Views of boards by heads that turn, chosen one by one.")
      .def(py::init<const std::map<int, Camera>&, const Board&, const Texts&, const Texts&>())
      .def("push", &LiveViews::push)
      .def("undo", &LiveViews::undo)
      .def("state", &LiveViews::state);
}

}  // namespace alidade::python
