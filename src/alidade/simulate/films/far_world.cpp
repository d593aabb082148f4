#include "alidade/simulate/films/far_world.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <opencv2/core.hpp>
#include <set>

namespace alidade {
namespace {

using Painter = std::function<float(const Eigen::Vector3d& direction)>;

/// Gradient noise with corners of a lattice at whole numbers, about −1 to 1, twice differentiable.
/// K. Perlin, "Improving noise", 2002.
class LatticeNoise {
 public:
  explicit LatticeNoise(std::uint64_t seed) : seed_(static_cast<std::uint32_t>(seed ^ (seed >> 32))) {}

  [[nodiscard]] float operator()(const Eigen::Vector3f& at) const {
    const Eigen::Vector3f low = at.array().floor();
    const Eigen::Vector3i cell = low.cast<int>();
    const Eigen::Vector3f f = at - low;
    const Eigen::Array3f t = f.array() * f.array() * f.array() * (f.array() * (f.array() * 6.0f - 15.0f) + 10.0f);
    float sum_z[2];
    for (int z = 0; z < 2; ++z) {
      float sum_y[2];
      for (int y = 0; y < 2; ++y) {
        const float left = slope(cell, 0, y, z, f), right = slope(cell, 1, y, z, f);
        sum_y[y] = left + t.x() * (right - left);
      }
      sum_z[z] = sum_y[0] + t.y() * (sum_y[1] - sum_y[0]);
    }
    return sum_z[0] + t.z() * (sum_z[1] - sum_z[0]);
  }

 private:
  /// One of twelve gradients, towards the midpoints of a cube's edges, times the vector from that corner.
  [[nodiscard]] float slope(const Eigen::Vector3i& cell, int x, int y, int z, const Eigen::Vector3f& f) const {
    std::uint32_t h = seed_ + 0x9e3779b9u * static_cast<std::uint32_t>(cell.x() + x);
    h = (h ^ (h >> 15)) * 0x85ebca6bu + 0xc2b2ae35u * static_cast<std::uint32_t>(cell.y() + y);
    h = (h ^ (h >> 13)) * 0x27d4eb2fu + 0x165667b1u * static_cast<std::uint32_t>(cell.z() + z);
    h = (h ^ (h >> 16)) * 0x7feb352du;
    const std::uint32_t edge = (h >> 20) % 12u;
    const float dx = f.x() - static_cast<float>(x), dy = f.y() - static_cast<float>(y),
                dz = f.z() - static_cast<float>(z);
    const float u = edge < 8u ? dx : dy, v = edge < 4u ? dy : dz;
    return ((edge & 1u) ? -u : u) + ((edge & 2u) ? -v : v);
  }

  std::uint32_t seed_;
};

Painter noise_painter(double grain_rad, std::uint64_t seed) {
  // Coarse octaves are as strong as fine ones, as in photos: corners then stand at every scale.
  constexpr int num_octaves = 5;
  constexpr float contrast = 1.6f, mean = 125.0f, swing = 90.0f;
  return [=, noise = LatticeNoise(seed)](const Eigen::Vector3d& direction) {
    float sum = 0.0f;
    double cells_per_rad = 1.0 / grain_rad;
    for (int octave = 0; octave < num_octaves; ++octave, cells_per_rad *= 0.5) {
      const Eigen::Vector3d shift = Eigen::Vector3d::Constant(17.3 * octave);  // no common lattice points
      sum += noise((direction * cells_per_rad + shift).cast<float>());
    }
    return mean + swing * std::tanh(contrast * sum);
  };
}

/// Index of a row or column of an image that goes on mirrored beyond its edges.
int mirrored(int i, int size) {
  const int period = 2 * size;
  const int inside = ((i % period) + period) % period;
  return inside < size ? inside : period - 1 - inside;
}

Painter photo_painter(const cv::Mat& photo, double rad_per_px) {
  cv::Mat grey;
  photo.convertTo(grey, CV_32F);
  return [=](const Eigen::Vector3d& d) {
    const double across = std::hypot(d.x(), d.z());
    const double steepest = 4.0 * across;  // 76°: beyond it Mercator's rows run away
    const double u = std::atan2(d.x(), d.z()) / rad_per_px + 0.5 * (grey.cols - 1);
    const double v = std::asinh(std::clamp(d.y(), -steepest, steepest) / across) / rad_per_px + 0.5 * (grey.rows - 1);
    const int u0 = static_cast<int>(std::floor(u)), v0 = static_cast<int>(std::floor(v));
    const auto fu = static_cast<float>(u - u0), fv = static_cast<float>(v - v0);
    const auto at = [&](int du, int dv) {
      return grey.at<float>(mirrored(v0 + dv, grey.rows), mirrored(u0 + du, grey.cols));
    };
    return (1.0f - fv) * ((1.0f - fu) * at(0, 0) + fu * at(1, 0)) + fv * ((1.0f - fu) * at(0, 1) + fu * at(1, 1));
  };
}

}  // namespace

/// Six square images on the planes ±x, ±y, ±z = 1, with bilinear interpolation: what is between the texels is a fixed
/// function of the direction, so that interpolation moves nothing.
class FarWorld::Cube {
 public:
  Cube(double texel_rad, Painter painter)
      : painter_(std::move(painter)),
        tiles_a_side_(static_cast<int>(std::ceil(2.0 / (texel_rad * tile_texels)))),
        texels_per_unit_(0.5f * static_cast<float>(tiles_a_side_ * tile_texels)),
        tiles_(static_cast<std::size_t>(6 * tiles_a_side_ * tiles_a_side_)) {}

  void prepare(const std::vector<Eigen::Vector3f>& directions, double reach_rad) {
    std::set<std::size_t> missing;
    // On a face a step of 1 rad is up to 3 units long, at its corners.
    const int reach = static_cast<int>(std::ceil(3.0 * reach_rad * texels_per_unit_)) + 1;
    for (const Eigen::Vector3f& direction : directions) {
      add(place_of(direction), reach, missing);
      for (const float step : {-3.0f, 3.0f})  // and the faces beside it
        for (int axis = 0; axis < 3; ++axis) {
          const Eigen::Vector3f beside =
              direction + step * static_cast<float>(reach_rad) * direction.norm() * Eigen::Vector3f::Unit(axis);
          add(place_of(beside), 0, missing);
        }
    }
    const std::vector<std::size_t> list(missing.begin(), missing.end());
    tbb::parallel_for(std::size_t{0}, list.size(), [&](std::size_t i) { paint(list[i]); });
  }

  [[nodiscard]] float grey(const Eigen::Vector3f& direction) const {
    const Place place = place_of(direction);
    const int u = std::min(static_cast<int>(place.u), num_texels() - 1);
    const int v = std::min(static_cast<int>(place.v), num_texels() - 1);
    const std::vector<float>& tile = tiles_[tile_of(place.face, u, v)];
    if (tile.empty()) return 0.0f;  // not prepared
    const float* texel =
        tile.data() + (static_cast<unsigned>(v) % tile_texels) * row_texels + static_cast<unsigned>(u) % tile_texels;
    const float fu = place.u - static_cast<float>(u), fv = place.v - static_cast<float>(v);
    return (1.0f - fv) * ((1.0f - fu) * texel[0] + fu * texel[1]) +
           fv * ((1.0f - fu) * texel[row_texels] + fu * texel[row_texels + 1]);
  }

 private:
  static constexpr int tile_texels = 32, row_texels = tile_texels + 1;  // with the first of the next

  struct Place {
    int face;
    float u, v;  ///< In texels, from 0.
  };

  [[nodiscard]] int num_texels() const { return tiles_a_side_ * tile_texels; }

  [[nodiscard]] Place place_of(const Eigen::Vector3f& d) const {
    const Eigen::Vector3f size = d.cwiseAbs();
    if (size.x() >= size.y() && size.x() >= size.z()) return on_face(0, d.x(), d.y(), d.z());
    return size.y() >= size.z() ? on_face(1, d.y(), d.z(), d.x()) : on_face(2, d.z(), d.x(), d.y());
  }

  /// By a direction's part along that axis, and those along the next two.
  [[nodiscard]] Place on_face(int axis, float along, float across_u, float across_v) const {
    const float depth = std::abs(along);
    const auto texels = [&](float across) { return std::max(0.0f, (across / depth + 1.0f) * texels_per_unit_); };
    return {2 * axis + (along < 0.0f), texels(across_u), texels(across_v)};
  }

  [[nodiscard]] std::size_t tile_of(int face, int u, int v) const {
    const auto side = static_cast<unsigned>(tiles_a_side_);
    return (static_cast<unsigned>(face) * side + static_cast<unsigned>(v) / tile_texels) * side +
           static_cast<unsigned>(u) / tile_texels;
  }

  void add(const Place& place, int reach, std::set<std::size_t>& missing) const {
    const auto tile_at = [&](float texel, int step) {
      return std::clamp(static_cast<int>(texel) + step, 0, num_texels() - 1) / tile_texels;
    };
    for (int v = tile_at(place.v, -reach); v <= tile_at(place.v, reach); ++v)
      for (int u = tile_at(place.u, -reach); u <= tile_at(place.u, reach); ++u) {
        const std::size_t tile = tile_of(place.face, u * tile_texels, v * tile_texels);
        if (tiles_[tile].empty()) missing.insert(tile);
      }
  }

  void paint(std::size_t index) {
    const int i = static_cast<int>(index), side = tiles_a_side_;
    const int face = i / (side * side), u0 = i % side * tile_texels, v0 = i / side % side * tile_texels;
    const int axis = face / 2;
    Eigen::Vector3d d;
    d[axis] = face % 2 == 0 ? 1.0 : -1.0;
    std::vector<float> tile(row_texels * row_texels);
    for (int v = 0; v < row_texels; ++v) {
      for (int u = 0; u < row_texels; ++u) {
        d[(axis + 1) % 3] = (u0 + u) / static_cast<double>(texels_per_unit_) - 1.0;
        d[(axis + 2) % 3] = (v0 + v) / static_cast<double>(texels_per_unit_) - 1.0;
        tile[static_cast<std::size_t>(v * row_texels + u)] = painter_(d.normalized());
      }
    }
    tiles_[index] = std::move(tile);
  }

  Painter painter_;
  int tiles_a_side_;
  float texels_per_unit_;
  std::vector<std::vector<float>> tiles_;  ///< Empty: not painted yet.
};

FarWorld::FarWorld(std::unique_ptr<Cube> cube) : cube_(std::move(cube)) {}
FarWorld::FarWorld(FarWorld&&) noexcept = default;
FarWorld& FarWorld::operator=(FarWorld&&) noexcept = default;
FarWorld::~FarWorld() = default;

FarWorld FarWorld::of_noise(double grain_rad, std::uint64_t seed) {
  constexpr double texels_a_grain = 5.0;
  return FarWorld(std::make_unique<Cube>(grain_rad / texels_a_grain, noise_painter(grain_rad, seed)));
}

FarWorld FarWorld::of_photo(const cv::Mat& photo, double rad_per_px) {
  return FarWorld(std::make_unique<Cube>(0.5 * rad_per_px, photo_painter(photo, rad_per_px)));
}

void FarWorld::prepare(const std::vector<Eigen::Vector3f>& directions, double reach_rad) {
  cube_->prepare(directions, reach_rad);
}

float FarWorld::grey(const Eigen::Vector3f& direction) const { return cube_->grey(direction); }

}  // namespace alidade
