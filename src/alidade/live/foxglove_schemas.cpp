#include <initializer_list>

#include "alidade/live/foxglove.h"

namespace alidade::live {
namespace {

using Members = std::initializer_list<std::pair<const char*, std::string>>;

std::string object(const Members& members) {
  std::string text = R"({"type":"object","properties":{)";
  const char* between = "";
  for (const auto& [name, schema] : members) {
    text += between + ('"' + std::string(name) + "\":" + schema);
    between = ",";
  }
  return text + "}}";
}

std::string list_of(const std::string& item) { return R"({"type":"array","items":)" + item + "}"; }

const std::string number = R"({"type":"number"})", integer = R"({"type":"integer"})", word = R"({"type":"string"})",
                  flag = R"({"type":"boolean"})", bytes = R"({"type":"string","contentEncoding":"base64"})";

std::string time() { return object({{"sec", integer}, {"nsec", integer}}); }
std::string point2() { return object({{"x", number}, {"y", number}}); }
std::string vector3() { return object({{"x", number}, {"y", number}, {"z", number}}); }
std::string quaternion() { return object({{"x", number}, {"y", number}, {"z", number}, {"w", number}}); }
std::string colour() { return object({{"r", number}, {"g", number}, {"b", number}, {"a", number}}); }
std::string pose() { return object({{"position", vector3()}, {"orientation", quaternion()}}); }

std::string transforms() {
  return object({{"transforms", list_of(object({{"timestamp", time()},
                                                {"parent_frame_id", word},
                                                {"child_frame_id", word},
                                                {"translation", vector3()},
                                                {"rotation", quaternion()}}))}});
}

std::string scene() {
  const std::string line = object({{"type", integer},
                                   {"pose", pose()},
                                   {"thickness", number},
                                   {"scale_invariant", flag},
                                   {"points", list_of(vector3())},
                                   {"color", colour()},
                                   {"colors", list_of(colour())},
                                   {"indices", list_of(integer)}});
  const std::string sphere = object({{"pose", pose()}, {"size", vector3()}, {"color", colour()}});
  const std::string text = object({{"pose", pose()},
                                   {"billboard", flag},
                                   {"font_size", number},
                                   {"scale_invariant", flag},
                                   {"color", colour()},
                                   {"text", word}});
  const std::string unused = list_of(object({}));
  const std::string entity = object({{"timestamp", time()},
                                     {"frame_id", word},
                                     {"id", word},
                                     {"lifetime", time()},
                                     {"frame_locked", flag},
                                     {"metadata", list_of(object({{"key", word}, {"value", word}}))},
                                     {"arrows", unused},
                                     {"cubes", unused},
                                     {"spheres", list_of(sphere)},
                                     {"cylinders", unused},
                                     {"lines", list_of(line)},
                                     {"triangles", unused},
                                     {"texts", list_of(text)},
                                     {"models", unused}});
  const std::string deletion = object({{"timestamp", time()}, {"type", integer}, {"id", word}});
  return object({{"deletions", list_of(deletion)}, {"entities", list_of(entity)}});
}

std::string calibration() {
  return object({{"timestamp", time()},
                 {"frame_id", word},
                 {"width", integer},
                 {"height", integer},
                 {"distortion_model", word},
                 {"D", list_of(number)},
                 {"K", list_of(number)},
                 {"R", list_of(number)},
                 {"P", list_of(number)}});
}

std::string annotations() {
  const std::string circle = object({{"timestamp", time()},
                                     {"position", point2()},
                                     {"diameter", number},
                                     {"thickness", number},
                                     {"fill_color", colour()},
                                     {"outline_color", colour()}});
  const std::string points = object({{"timestamp", time()},
                                     {"type", integer},
                                     {"points", list_of(point2())},
                                     {"outline_color", colour()},
                                     {"outline_colors", list_of(colour())},
                                     {"fill_color", colour()},
                                     {"thickness", number}});
  const std::string text = object({{"timestamp", time()},
                                   {"position", point2()},
                                   {"text", word},
                                   {"font_size", number},
                                   {"text_color", colour()},
                                   {"background_color", colour()}});
  return object({{"circles", list_of(circle)}, {"points", list_of(points)}, {"texts", list_of(text)}});
}

}  // namespace

Channel foxglove_channel(std::string topic, FoxgloveType type) {
  switch (type) {
    case FoxgloveType::frame_transforms:
      return {std::move(topic), "foxglove.FrameTransforms", transforms()};
    case FoxgloveType::pose_in_frame:
      return {std::move(topic), "foxglove.PoseInFrame",
              object({{"timestamp", time()}, {"frame_id", word}, {"pose", pose()}})};
    case FoxgloveType::scene_update:
      return {std::move(topic), "foxglove.SceneUpdate", scene()};
    case FoxgloveType::camera_calibration:
      return {std::move(topic), "foxglove.CameraCalibration", calibration()};
    case FoxgloveType::compressed_image:
      return {std::move(topic), "foxglove.CompressedImage",
              object({{"timestamp", time()}, {"frame_id", word}, {"data", bytes}, {"format", word}})};
    case FoxgloveType::image_annotations:
      return {std::move(topic), "foxglove.ImageAnnotations", annotations()};
    case FoxgloveType::log:
      return {std::move(topic), "foxglove.Log",
              object({{"timestamp", time()},
                      {"level", integer},
                      {"message", word},
                      {"name", word},
                      {"file", word},
                      {"line", integer}})};
  }
  return {};
}

}  // namespace alidade::live
