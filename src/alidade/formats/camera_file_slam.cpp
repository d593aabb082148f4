#include <fmt/format.h>

#include <cctype>
#include <cmath>
#include <functional>
#include <map>
#include <sstream>

#include "alidade/formats/camera_formats.h"
#include "alidade/geometry/decompositions.h"

// Cameras of the first monocular SLAM programs and of the calibration before them: A. J. Davison's SceneLib
// (`cam.fku = 195;`), J. Civera's initialize_cam.m (two distortion parameters), J. Heikkilä & O. Silvén's toolbox of
// 1997 (`sys` and `par`), J.-Y. Bouguet's Calib_Results.m. Assignments, one or more a line. Their pixel (0, 0) is the
// centre of the first; of all but Bouguet's that is assumed.

namespace alidade::detail {
namespace {

using Values = std::map<std::string, std::vector<double>>;

std::string without_comment(const std::string& line) { return line.substr(0, line.find_first_of("#%")); }

/// Where the name that ends before an equals sign begins.
std::string name_before(const std::string& text, std::size_t equals) {
  std::size_t end = equals;
  while (end > 0 && std::isspace(static_cast<unsigned char>(text[end - 1])) != 0) --end;
  std::size_t begin = end;
  const auto is_of_name = [](char c) {
    return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_' || c == '.';
  };
  while (begin > 0 && is_of_name(text[begin - 1])) --begin;
  return text.substr(begin, end - begin);
}

/// The numbers of "[1 2, 3]", "195" or "1.7945/d", as far as they are such; what is computed otherwise has none.
std::vector<double> numbers_of(std::string text, const Values& known) {
  for (char& c : text) c = c == '[' || c == ']' || c == ',' ? ' ' : c;
  const std::size_t slash = text.find('/');
  if (slash != std::string::npos) {
    const std::vector<double> above = numbers_of(text.substr(0, slash), known);
    const std::vector<double> below = numbers_of(text.substr(slash + 1), known);
    if (above.size() != 1 || below.size() != 1) return {};
    return {above[0] / below[0]};
  }
  std::vector<double> numbers;
  std::istringstream words(text);
  for (std::string word; words >> word;) {
    char* end = nullptr;
    const double value = std::strtod(word.c_str(), &end);
    const auto at = known.find(word);
    if (end != word.c_str() && *end == '\0')
      numbers.push_back(value);
    else if (at != known.end() && at->second.size() == 1)
      numbers.push_back(at->second[0]);
    else
      return {};
  }
  return numbers;
}

/// Rows of a vector in brackets are separated as statements are; here by spaces.
std::string with_flat_vectors(std::string_view text) {
  std::string flat(text);
  bool is_inside = false;
  for (char& c : flat) {
    is_inside = c == '[' || (is_inside && c != ']' && c != '\n');
    if (is_inside && c == ';') c = ' ';
  }
  return flat;
}

Values assignments(std::string_view text) {
  Values values;
  std::istringstream lines{with_flat_vectors(text)};
  for (std::string line; std::getline(lines, line);) {
    std::istringstream statements(without_comment(line));
    for (std::string each; std::getline(statements, each, ';');) {
      const std::size_t equals = each.find('=');
      if (equals == std::string::npos) continue;
      const std::string name = name_before(each, equals);
      const std::vector<double> numbers = numbers_of(each.substr(equals + 1), values);
      if (!name.empty() && !numbers.empty()) values[name] = numbers;
    }
  }
  return values;
}

double number(const Values& values, const std::string& key, const CameraText& file) {
  const auto at = values.find(key);
  if (at == values.end()) refuse(file.name, key, "is not given as a number");
  if (at->second.size() != 1 || !std::isfinite(at->second[0])) refuse(file.name, key, "is not one finite number");
  return at->second[0];
}

int size(const Values& values, const std::string& key, const CameraText& file) {
  return checked_size(number(values, key, file), file.name, key);
}

/// Where a pixel looks: X/Z, Y/Z. None: beyond what the lens has.
using Inverse = std::function<std::optional<Eigen::Vector2d>(const Eigen::Vector2d& px)>;

struct Sample {
  Eigen::Vector2d px, ray;
};

/// A lens of ours that is the nearest to another over the image, by least squares in its coefficients; and how far off
/// it is at worst.
struct NearestLens {
  Lens lens;
  double worst_px = 0.0;
};

NearestLens nearest(const Eigen::Vector4d& focal_centre, std::span<const Sample> samples, bool is_fisheye) {
  const int num = is_fisheye ? 4 : 3;
  Eigen::MatrixXd A(2 * static_cast<Eigen::Index>(samples.size()), num);
  Eigen::VectorXd b(A.rows());
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const double r = samples[i].ray.norm(), angle = std::atan(r);
    const Eigen::Vector2d direction = r > 0.0 ? (samples[i].ray / r).eval() : Eigen::Vector2d::Zero().eval();
    const double base = is_fisheye ? angle : r;
    for (int axis = 0; axis < 2; ++axis) {
      const auto row = 2 * static_cast<Eigen::Index>(i) + axis;
      const double along = focal_centre[axis] * direction[axis];
      b[row] = samples[i].px[axis] - focal_centre[2 + axis] - along * base;
      for (int k = 0; k < num; ++k) A(row, k) = along * std::pow(base, 2 * k + 3);
    }
  }
  const Eigen::VectorXd k = least_squares(A, b);
  NearestLens found;
  if (is_fisheye) {
    Calibrated<KannalaBrandt> lens;
    lens.params << focal_centre, 0.0, k;
    found.lens = lens;
  } else {
    Calibrated<Brown> lens;
    lens.params << focal_centre, 0.0, k[0], k[1], 0.0, 0.0, k[2];
    found.lens = lens;
  }
  Camera camera;
  camera.lens = found.lens;
  for (const Sample& sample : samples) {
    const auto px = project(camera, Eigen::Vector3d(sample.ray.x(), sample.ray.y(), 1.0));
    found.worst_px = std::max(found.worst_px, px ? (*px - sample.px).norm() : 1e9);
  }
  return found;
}

/// The camera whose pixels look where `inverse` says. Refuses what neither a brown nor a kannala_brandt lens is.
Camera camera_like(int width_px, int height_px, const Eigen::Vector4d& focal_centre, const Inverse& inverse,
                   const std::string& of, const CameraText& file) {
  std::vector<Sample> samples;
  constexpr int steps = 40;
  for (int i = 0; i <= steps; ++i) {
    for (int j = 0; j <= steps; ++j) {
      const Eigen::Vector2d px((width_px - 1.0) * i / steps, (height_px - 1.0) * j / steps);
      if (const auto ray = inverse(px)) samples.push_back({px, *ray});
    }
  }
  constexpr std::size_t enough = 200;
  if (samples.size() < enough) refuse(file.name, "", "hardly a pixel of its image looks anywhere by its distortion");
  const NearestLens brown = nearest(focal_centre, samples, false), fisheye = nearest(focal_centre, samples, true);
  const NearestLens& best = fisheye.worst_px < brown.worst_px ? fisheye : brown;
  constexpr double near_px = 0.25;  // in a corner; a tenth of that elsewhere
  if (!(best.worst_px < near_px))
    refuse(file.name, "",
           fmt::format("no lens of ours is within {} px of its distortion: brown {:.2g} px, kannala_brandt {:.2g} px",
                       near_px, brown.worst_px, fisheye.worst_px));
  Camera camera;
  camera.width_px = width_px;
  camera.height_px = height_px;
  camera.lens = best.lens;
  camera.source = fmt::format("{}, to {:.1g} px", of, best.worst_px);
  return camera;
}

/// u_d − u0 = u_c / √(1 + 2 K₁ r²), r and u_c in pixels without distortion (Davison et al., PAMI 2007, with R.
/// Swaminathan & S. Nayar's model).
Camera scenelib_camera(const Values& values, const CameraText& file) {
  const double kd1 = number(values, "cam.kd1", file);
  const Eigen::Vector4d f(number(values, "cam.fku", file), number(values, "cam.fkv", file),
                          number(values, "cam.u0", file), number(values, "cam.v0", file));
  if (!(f.head<2>().minCoeff() > 0.0)) refuse(file.name, "cam.fku", "or cam.fkv is not above zero");
  const Inverse inverse = [=](const Eigen::Vector2d& px) -> std::optional<Eigen::Vector2d> {
    const Eigen::Vector2d off = px - f.tail<2>();
    const double left = 1.0 - 2.0 * kd1 * off.squaredNorm();
    if (!(left > 0.0)) return std::nullopt;
    return (off / std::sqrt(left)).cwiseQuotient(f.head<2>()).eval();
  };
  return camera_like(size(values, "cam.width", file), size(values, "cam.height", file), f, inverse, "SceneLib", file);
}

/// x_u = x_d (1 + k1 r_d² + k2 r_d⁴) in millimetres on the sensor.
Camera civera_camera(const Values& values, const CameraText& file) {
  const auto either = [&](const std::string& a, const std::string& b) {
    return number(values, values.contains(a) ? a : b, file);
  };
  const double focal_mm = either("cam.f", "f"), k1 = either("cam.k1", "k1"), k2 = either("cam.k2", "k2");
  const Eigen::Vector2d pitch_mm(either("cam.dx", "d"), either("cam.dy", "d"));
  const Eigen::Vector2d centre(either("cam.Cx", "Cx"), either("cam.Cy", "Cy"));
  if (!(focal_mm > 0.0) || !(pitch_mm.minCoeff() > 0.0))
    refuse(file.name, "f", "or the size of a pixel is not above zero");
  const Inverse inverse = [=](const Eigen::Vector2d& px) -> std::optional<Eigen::Vector2d> {
    const Eigen::Vector2d at = (px - centre).cwiseProduct(pitch_mm);
    const double r2 = at.squaredNorm();
    if (!(1.0 + 3.0 * k1 * r2 + 5.0 * k2 * r2 * r2 > 0.0)) return std::nullopt;
    return (at * (1.0 + k1 * r2 + k2 * r2 * r2) / focal_mm).eval();
  };
  const std::string rows = values.contains("cam.nRows") ? "cam.nRows" : "nRows";
  const std::string cols = values.contains("cam.nCols") ? "cam.nCols" : "nCols";
  const Eigen::Vector4d f(focal_mm / pitch_mm.x(), focal_mm / pitch_mm.y(), centre.x(), centre.y());
  return camera_like(size(values, cols, file), size(values, rows, file), f, inverse, "initialize_cam.m", file);
}

/// Exact: radial and tangential distortion of f X/Z in millimetres, k1 f² and so on; `sys` holds pixels and size of the
/// sensor, `par` aspect, focal length, centre, k1, k2, p1, p2. "A Four-step Camera Calibration Procedure", CVPR 1997.
Camera heikkila_camera(const Values& values, const CameraText& file) {
  const std::vector<double>&sys = values.at("sys"), &par = values.at("par");
  if (sys.size() < 4) refuse(file.name, "sys", fmt::format("has {} numbers, not four or more", sys.size()));
  if (par.size() != 8) refuse(file.name, "par", fmt::format("has {} numbers, not eight", par.size()));
  for (std::size_t i = 0; i < 4; ++i)
    if (!(sys[i] > 0.0)) refuse(file.name, "sys", "has a number that is not above zero");
  const double f = par[1];
  if (!(f > 0.0) || !(par[0] > 0.0)) refuse(file.name, "par", "has an aspect or a focal length that is not above zero");
  Camera camera =
      opencv_camera({sys[0] * par[0] * f / sys[2], sys[1] * f / sys[3], par[2], par[3]},
                    {par[4] * f * f, par[5] * std::pow(f, 4), par[6] * f, par[7] * f, 0.0}, file.name, "par");
  camera.width_px = checked_size(sys[0], file.name, "sys");
  camera.height_px = checked_size(sys[1], file.name, "sys");
  camera.source = "the toolbox of Heikkilä and Silvén, 1997";
  return camera;
}

/// Exact: fc, cc, alpha_c, kc (k1 k2 p1 p2 k3), nx, ny. Of its fisheye, four coefficients, the file does not say that
/// it is one.
CameraContent bouguet_camera(const Values& values, const CameraText& file) {
  const auto of_size = [&](const char* key, std::size_t least, std::size_t most) {
    const auto at = values.find(key);
    if (at == values.end()) refuse(file.name, key, "is not given as numbers");
    if (at->second.size() < least || at->second.size() > most)
      refuse(file.name, key, fmt::format("has {} numbers", at->second.size()));
    return at->second;
  };
  const std::vector<double> fc = of_size("fc", 2, 2), cc = of_size("cc", 2, 2), kc = of_size("kc", 4, 5);
  const bool is_open = kc.size() == 4 && kc != std::vector<double>(4, 0.0);
  if (!file.choice.empty() && !(is_open && (file.choice == "brown" || file.choice == "fisheye")))
    refuse(file.name, "", "holds one camera without a name; leave ':" + file.choice + "' out");
  CameraContent read;
  if (is_open && file.choice.empty())
    read.doubt = "the 4 numbers of kc may be k1 k2 p1 p2 (read so: brown) or k1 k2 k3 k4 of the toolbox's fisheye";
  read.camera = file.choice == "fisheye" ? fisheye_camera({fc[0], fc[1], cc[0], cc[1]}, kc, file.name, "kc")
                                         : opencv_camera({fc[0], fc[1], cc[0], cc[1]}, kc, file.name, "kc");
  Eigen::VectorXd lens = params(read.camera.lens);
  lens[4] = fc[0] * (values.contains("alpha_c") ? number(values, "alpha_c", file) : 0.0);
  read.camera.lens = with_params(read.camera.lens, lens);
  read.camera.width_px = size(values, "nx", file);
  read.camera.height_px = size(values, "ny", file);
  read.camera.source = "J.-Y. Bouguet's toolbox";
  if (values.contains("fc_error")) read.unread.emplace_back("its errors, three σ without correlations");
  return read;
}

bool is_bouguet(const Values& values) {
  return values.contains("fc") && values.contains("cc") && values.contains("kc");
}

}  // namespace

bool is_slam_camera(std::string_view text) {
  const Values values = assignments(text);
  return values.contains("cam.fku") || is_bouguet(values) || (values.contains("sys") && values.contains("par")) ||
         text.find("two_distortion_parameters") != std::string_view::npos;
}

namespace {

CameraContent read_assigned(const Values& values, const CameraText& file) {
  if (is_bouguet(values)) return bouguet_camera(values, file);
  if (values.contains("cam.fku")) {
    std::vector<std::string> unread;
    if (values.contains("state.rw_x")) unread.emplace_back("the start and the features of its map");
    return {scenelib_camera(values, file), unread};
  }
  if (values.contains("sys") && values.contains("par")) return {heikkila_camera(values, file), {}};
  return {civera_camera(values, file), {}};
}

}  // namespace

CameraContent read_slam_camera(const CameraText& file) {
  CameraContent read = read_assigned(assignments(file.text), file);
  constexpr double largest = 1e12;
  if (!(params(read.camera.lens).cwiseAbs().maxCoeff() <= largest) || !params(read.camera.lens).allFinite())
    refuse(file.name, "", "has a number that is not finite, or beyond 1e12");
  return read;
}

}  // namespace alidade::detail
