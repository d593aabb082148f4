#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <map>

#include "alidade/formats/camera_formats.h"

namespace alidade::detail {
namespace {

/// A value of a Python literal: a word (string or number as written) or a list of values. Contents of nested tables and
/// of bytes are passed over.
struct Literal {
  std::string word;
  std::vector<Literal> items;
  bool is_list = false;
};

/// Reads the one thing that a .cameramodel is: a table {'key': value, …} written as Python writes it, with comments.
class LiteralReader {
 public:
  LiteralReader(std::string_view text, std::string name) : text_(text), name_(std::move(name)) {}

  std::map<std::string, Literal> table(int depth = 0) {
    std::map<std::string, Literal> entries;
    expect('{');
    while (!take('}')) {
      const std::string key = value(depth + 1).word;
      expect(':');
      if (!entries.emplace(key, value(depth + 1)).second) fail("'" + key + "' appears twice");
      if (!take(',') && peek() != '}') fail("',' or '}' is missing");
    }
    return entries;
  }

 private:
  [[noreturn]] void fail(const std::string& what) const {
    const auto line = 1 + std::count(text_.begin(), text_.begin() + static_cast<std::ptrdiff_t>(at_), '\n');
    throw InputError(fmt::format("{}:{}: {}", name_, line, what));
  }

  void skip_space() {
    while (at_ < text_.size()) {
      if (text_[at_] == '#') {
        at_ = std::min(text_.find('\n', at_), text_.size());
      } else if (std::isspace(static_cast<unsigned char>(text_[at_])) != 0) {
        ++at_;
      } else {
        return;
      }
    }
  }

  char peek() {
    skip_space();
    return at_ < text_.size() ? text_[at_] : '\0';
  }
  bool take(char c) {
    if (peek() != c) return false;
    ++at_;
    return true;
  }
  void expect(char c) {
    if (!take(c)) fail(fmt::format("'{}' is missing", c));
  }

  std::string quoted() {
    const char quote = text_[at_];
    const std::string_view three = text_.substr(at_, 3);
    const std::string end(three.size() == 3 && three[1] == quote && three[2] == quote ? 3 : 1, quote);
    at_ += end.size();
    const std::size_t stop = text_.find(end, at_);
    if (stop == std::string_view::npos) fail("a quotation has no end");
    std::string word(text_.substr(at_, stop - at_));
    at_ = stop + end.size();
    return word;
  }

  Literal value(int depth) {
    if (depth > 20) fail("is nested too deeply");
    const char first = peek();
    Literal out;
    if (first == '{') {
      (void)table(depth);
    } else if (first == '[' || first == '(') {
      const char end = first == '[' ? ']' : ')';
      ++at_;
      out.is_list = true;
      while (!take(end)) {
        out.items.push_back(value(depth + 1));
        if (!take(',') && peek() != end) fail(fmt::format("',' or '{}' is missing", end));
      }
    } else {
      if (first == 'b' && at_ + 1 < text_.size() && (text_[at_ + 1] == '\'' || text_[at_ + 1] == '"')) ++at_;  // bytes
      if (at_ < text_.size() && (text_[at_] == '\'' || text_[at_] == '"')) {
        out.word = quoted();
      } else {
        while (at_ < text_.size() && text_.substr(at_, 1).find_first_of(" \t\r\n,:]})#([{") != 0)
          out.word += text_[at_++];
        if (out.word.empty()) fail("a value is missing");
      }
    }
    return out;
  }

  std::string_view text_;
  std::string name_;
  std::size_t at_ = 0;
};

std::vector<double> numbers(const std::map<std::string, Literal>& table, const std::string& key,
                            const std::string& file) {
  const auto found = table.find(key);
  if (found == table.end()) refuse(file, key, "is missing");
  if (!found->second.is_list) refuse(file, key, "is not a list");
  std::vector<double> values;
  for (const Literal& item : found->second.items) values.push_back(checked_number(item.word, file, key));
  return values;
}

/// True of [0, 0.0, -0]; a list of something else is not zero.
bool is_zero(const Literal& list) {
  return list.is_list && std::all_of(list.items.begin(), list.items.end(), [](const Literal& item) {
           double value = 1.0;
           const auto [end, error] = std::from_chars(item.word.data(), item.word.data() + item.word.size(), value);
           return error == std::errc{} && end == item.word.data() + item.word.size() && value == 0.0;
         });
}

}  // namespace

CameraContent read_mrcal(const CameraText& file) {
  if (!file.choice.empty()) refuse(file.name, "", "holds one camera without a name; leave ':" + file.choice + "' out");
  const std::map<std::string, Literal> table = LiteralReader(file.text, file.name).table();
  const auto lens = table.find("lensmodel");
  if (lens == table.end()) refuse(file.name, "lensmodel", "is missing");
  static const std::map<std::string, std::size_t> num_intrinsics{{"LENSMODEL_PINHOLE", 4},
                                                                 {"LENSMODEL_OPENCV4", 8},
                                                                 {"LENSMODEL_OPENCV5", 9},
                                                                 {"LENSMODEL_OPENCV8", 12},
                                                                 {"LENSMODEL_OPENCV12", 16}};
  const auto known = num_intrinsics.find(lens->second.word);
  if (known == num_intrinsics.end()) {
    refuse(file.name, "lensmodel",
           fmt::format("'{}' is no model of ours; known: LENSMODEL_PINHOLE, LENSMODEL_OPENCV4, 5, 8 (k4…k6 zero)",
                       lens->second.word.substr(0, 80)));
  }
  const std::vector<double> intrinsics = numbers(table, "intrinsics", file.name);
  if (intrinsics.size() != known->second) {
    refuse(file.name, "intrinsics",
           fmt::format("{} numbers; {} has {}", intrinsics.size(), known->first, known->second));
  }
  Camera camera = opencv_camera({intrinsics.begin(), intrinsics.begin() + 4},
                                {intrinsics.begin() + 4, intrinsics.end()}, file.name, "intrinsics");
  const std::vector<double> size = numbers(table, "imagersize", file.name);
  if (size.size() != 2) refuse(file.name, "imagersize", "is not [width, height]");
  camera.width_px = checked_size(size[0], file.name, "imagersize");
  camera.height_px = checked_size(size[1], file.name, "imagersize");
  const auto extrinsics = table.find("extrinsics");
  if (extrinsics == table.end() || is_zero(extrinsics->second)) return {camera, {}};
  return {camera, {"the extrinsics"}};
}

std::string write_mrcal(const Camera& camera) {
  std::vector<double> intrinsics = focal_and_centre(camera);
  const std::vector<double> k = distortion(camera);
  intrinsics.insert(intrinsics.end(), k.begin(), k.end());
  return fmt::format(
      "{{\n    'lensmodel':  '{}',\n\n    # intrinsics are fx,fy,cx,cy,distortion0,distortion1,....\n    'intrinsics': "
      "{},\n\n"
      "    # extrinsics are rt_fromref\n    'extrinsics': {},\n\n    'imagersize': [{}, {}],\n}}\n",
      k.empty() ? "LENSMODEL_PINHOLE" : "LENSMODEL_OPENCV5", number_list(intrinsics), number_list({0, 0, 0, 0, 0, 0}),
      camera.width_px, camera.height_px);
}

}  // namespace alidade::detail
