#include "python/bindings/images.h"

#include "alidade/imaging/image_codecs.h"
#include "python/bindings/ending.h"
#include "python/bindings/waiting.h"

namespace alidade::python {
namespace {

struct HeldImage {
  cv::Mat pixels;
  std::shared_ptr<void> owner;
};

HeldImage held_image(const py::array& image) {
  const bool is_grey = image.ndim() == 2, is_16_bit = image.itemsize() == 2;
  const int type = CV_MAKETYPE(is_16_bit ? CV_16U : CV_8U, is_grey ? 1 : static_cast<int>(image.shape(2)));
  const auto size = [&](py::ssize_t axis) { return static_cast<int>(image.shape(axis)); };
  return {cv::Mat(size(0), size(1), type, const_cast<void*>(image.data())), kept(image)};
}

}  // namespace

Photos photos_of(const std::vector<std::string>& names, const std::vector<py::array>& images) {
  const auto held = std::make_shared<std::vector<HeldImage>>();
  for (const py::array& image : images) held->push_back(held_image(image));
  return {names, [held](std::size_t i) { return held->at(i).pixels; }};
}

void bind_images(py::module_& module) {
  module.def("png", [](const py::array& image) {
    const Photos photos = photos_of({"image"}, {image});
    const cv::Mat pixels = photos.load(0);
    std::string bytes;
    {
      const Released released;
      bytes = png_bytes(pixels);
    }
    return py::bytes(bytes);
  });
}

}  // namespace alidade::python
