#include "alidade/spot/spot_signal.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "alidade/estimation/median.h"
#include "alidade/spot/printed_squares.h"
#include "alidade/spot/spot_noise.h"

namespace alidade {
namespace {

constexpr float saturated_grey = 251.0F;  // noise of a clipped pixel stays above it

cv::Mat as_mat(Image& image) {
  return {static_cast<int>(image.rows()), static_cast<int>(image.cols()), CV_32F, image.data()};
}

/// Channels blue, green, red, grey of a part of a photo, 0 to 255; a grey photo has the grey one alone. 16 bits are
/// scaled as in to_grey_photo().
std::vector<Image> channels_of(const cv::Mat& photo, const cv::Rect& part, double scale) {
  cv::Mat wide;
  photo(part).convertTo(wide, CV_MAKETYPE(CV_32F, photo.channels()), scale);
  std::vector<cv::Mat> planes;
  cv::split(wide, planes);
  std::vector<Image> channels;
  for (const cv::Mat& plane : planes) {
    if (channels.size() < 3) channels.emplace_back(Eigen::Map<const Image>(plane.ptr<float>(), plane.rows, plane.cols));
  }
  if (channels.size() < 3) return {channels.front()};
  channels.push_back(0.114F * channels[0] + 0.587F * channels[1] + 0.299F * channels[2]);
  return channels;
}

double scale_of(const cv::Mat& photo) {
  if (photo.depth() == CV_8U) return 1.0;
  double brightest = 0.0;
  cv::minMaxLoc(photo.reshape(1), nullptr, &brightest);
  return brightest > 0.0 ? 255.0 / brightest : 1.0;
}

Image gradient_length(const Image& image, Image* du = nullptr, Image* dv = nullptr) {
  const Eigen::Index rows = image.rows(), cols = image.cols();
  Image x = Image::Zero(rows, cols), y = Image::Zero(rows, cols);
  x.middleCols(1, cols - 2) = 0.5F * (image.rightCols(cols - 2) - image.leftCols(cols - 2));
  y.middleRows(1, rows - 2) = 0.5F * (image.bottomRows(rows - 2) - image.topRows(rows - 2));
  Image length = (x.square() + y.square()).sqrt();
  if (du) *du = std::move(x);
  if (dv) *dv = std::move(y);
  return length;
}

/// Weights of the best sum of some images for another one, by least squares without outliers: of some thousands of
/// pixels, residuals beyond three sigmas rejected. A spot is small beside a photo.
class RobustSum {
 public:
  /// `equal_shares`: weight, per sample, of the prior that the first two terms have 0.5 each.
  RobustSum(const Image& target, std::vector<const Image*> terms, const ImageMask& use, double equal_shares = 0.0)
      : terms_(std::move(terms)), equal_shares_(equal_shares) {
    const Eigen::Index rows = target.rows(), cols = target.cols();
    const Eigen::Index step = stride_of(rows * cols);
    const auto n = static_cast<Eigen::Index>(terms_.size());
    samples_.resize(n + 1, (rows / step + 1) * (cols / step + 1));
    Eigen::Index count = 0;
    for (Eigen::Index v = 1; v + 1 < rows; v += step) {
      for (Eigen::Index u = 1; u + 1 < cols; u += step) {
        if (use(v, u) == 0) continue;
        for (Eigen::Index k = 0; k < n; ++k) samples_(k, count) = (*terms_[static_cast<std::size_t>(k)])(v, u);
        samples_(n, count++) = target(v, u);
      }
    }
    samples_.conservativeResize(n + 1, count);
    solve();
  }

  [[nodiscard]] const Eigen::VectorXf& weights() const { return weights_; }
  [[nodiscard]] bool is_solved() const { return weights_.size() > 0 && weights_.allFinite(); }
  [[nodiscard]] Image sum() const {
    Image sum = weights_[0] * *terms_[0];
    for (std::size_t k = 1; k < terms_.size(); ++k) sum += weights_[static_cast<Eigen::Index>(k)] * *terms_[k];
    return sum;
  }

 private:
  void solve() {
    const Eigen::Index n = samples_.rows() - 1;
    if (samples_.cols() < 8 * n) return;
    constexpr int rounds = 4;
    double limit = std::numeric_limits<double>::infinity();
    for (int round = 0; round < rounds; ++round) {
      const Eigen::MatrixXd sums = products(limit);
      Eigen::MatrixXd normal = sums.topLeftCorner(n, n).selfadjointView<Eigen::Lower>();
      normal.diagonal().array() *= 1.0 + 1e-9;  // terms that are alike share
      normal.diagonal().array() += 1e-9;
      Eigen::VectorXd right = sums.row(n).head(n).transpose();
      const double prior = equal_shares_ * static_cast<double>(samples_.cols());
      normal.diagonal().head<2>().array() += prior;
      right.head<2>().array() += 0.5 * prior;
      weights_ = normal.ldlt().solve(right).cast<float>();
      std::vector<float> sizes(static_cast<std::size_t>(samples_.cols()));
      for (Eigen::Index i = 0; i < samples_.cols(); ++i)
        sizes[static_cast<std::size_t>(i)] = static_cast<float>(std::abs(residual(i)));
      limit = 3.0 * std::max(0.5, normal_from_mad * median_of(sizes));
    }
  }
  /// Lower triangle of the sums of all products over the samples within the limit.
  [[nodiscard]] Eigen::MatrixXd products(double limit) const {
    const Eigen::Index n = samples_.rows();
    Eigen::MatrixXd sums = Eigen::MatrixXd::Zero(n, n);
    for (Eigen::Index i = 0; i < samples_.cols(); ++i) {
      if (weights_.size() > 0 && !(std::abs(residual(i)) <= limit)) continue;
      const float* sample = samples_.data() + i * n;
      for (Eigen::Index c = 0; c < n; ++c)
        for (Eigen::Index r = c; r < n; ++r)
          sums(r, c) += static_cast<double>(sample[r]) * static_cast<double>(sample[c]);
    }
    return sums;
  }
  [[nodiscard]] double residual(Eigen::Index i) const {
    const Eigen::Index n = samples_.rows() - 1;
    const float* sample = samples_.data() + i * (n + 1);
    float rest = sample[n];
    for (Eigen::Index k = 0; k < n; ++k) rest -= weights_[k] * sample[k];
    return static_cast<double>(rest);
  }

  std::vector<const Image*> terms_;
  double equal_shares_;
  Eigen::MatrixXf samples_;  ///< Terms, then the target.
  Eigen::VectorXf weights_;
};

/// Noise of one pixel, from the differences of neighbours.
double noise_of(const Image& image) {
  std::vector<float> differences;
  const Eigen::Index step = stride_of(image.size());
  for (Eigen::Index v = 0; v < image.rows(); v += step)
    for (Eigen::Index u = 1; u < image.cols(); u += step)
      differences.push_back(std::abs(image(v, u) - image(v, u - 1)));
  return std::max(0.4, normal_from_mad / std::sqrt(2.0) * median_of(differences));
}

ImageMask unsaturated(const Image& channel) {
  return (channel < saturated_grey)
      .select(ImageMask::Constant(channel.rows(), channel.cols(), 255),
              ImageMask::Zero(channel.rows(), channel.cols()));
}

/// `off` as `lit` would show it without the laser: exposure, offset and a small displacement are fitted.
Image matched_to(const Image& lit, Image off) {
  const ImageMask use = unsaturated(lit.max(off));
  const Image one = Image::Ones(off.rows(), off.cols());
  Image original = off;
  Eigen::Vector2f moved = Eigen::Vector2f::Zero();
  constexpr int max_rounds = 4;  // each leaves a tenth of a displacement below a pixel
  for (int round = 0;; ++round) {
    Image du, dv;
    gradient_length(off, &du, &dv);
    const RobustSum sum(lit, {&off, &one, &du, &dv}, use);
    if (!sum.is_solved() || !(sum.weights()[0] > 0.2F)) return original;
    const Eigen::Vector2f step = sum.weights().tail<2>() / sum.weights()[0];
    if (round == max_rounds || step.norm() < 0.02F) return sum.sum();
    moved += step.cwiseMax(-1.5F).cwiseMin(1.5F);
    const cv::Matx23f warp(1.0F, 0.0F, moved.x(), 0.0F, 1.0F, moved.y());
    cv::Mat to = as_mat(off);
    cv::warpAffine(as_mat(original), to, warp, to.size(), cv::INTER_CUBIC | cv::WARP_INVERSE_MAP, cv::BORDER_REPLICATE);
  }
}

/// What a chessboard at its pose shows in a channel: two levels with a slope each, blurred as the photo is.
Image board_background(const Image& channel, const SpotSignal& part, const SeenBoard& seen) {
  const auto cols = static_cast<int>(channel.cols()), rows = static_cast<int>(channel.rows());
  const Image sharp = paper_share(seen, part.u_min, part.v_min, cols, rows);
  const Image x = Eigen::RowVectorXf::LinSpaced(cols, -1.0F, 1.0F).replicate(rows, 1).array();
  const Image y = Eigen::VectorXf::LinSpaced(rows, -1.0F, 1.0F).replicate(1, cols).array();
  const ImageMask use = (unsaturated(channel) > 0).select(part.is_in_region, ImageMask::Zero(rows, cols));
  const auto at_blur = [&](double blur_px) {
    Image paper = sharp;
    cv::Mat mat = as_mat(paper);
    cv::GaussianBlur(mat, mat, cv::Size(), blur_px, blur_px, cv::BORDER_REPLICATE);
    const Image ink = 1.0F - paper, paper_x = paper * x, paper_y = paper * y, ink_x = ink * x, ink_y = ink * y;
    const RobustSum sum(channel, {&paper, &paper_x, &paper_y, &ink, &ink_x, &ink_y}, use);
    return sum.is_solved() ? sum.sum() : Image();
  };
  const auto cost = [&](const Image& background) {
    if (background.size() == 0) return std::numeric_limits<double>::infinity();
    return static_cast<double>((use > 0).select((channel - background).abs().min(20.0F).square(), 0.0F).sum());
  };
  double least = std::numeric_limits<double>::infinity(), best_px = 0.65;
  for (const double blur_px : {0.4, 0.6, 0.9, 1.35, 2.0}) {
    const double now = cost(at_blur(blur_px));
    if (now < least) best_px = blur_px;
    least = std::min(least, now);
  }
  // The cost is a parabola of the blur near its best value.
  const double low_px = best_px / 1.2, high_px = best_px * 1.2, low = cost(at_blur(low_px)),
               high = cost(at_blur(high_px));
  const double bend = low - 2.0 * least + high;
  if (bend > 0.0) best_px *= std::pow(1.2, std::clamp(0.5 * (low - high) / bend, -1.0, 1.0));
  return at_blur(best_px);
}

/// Fills the region: the polygon, and the board's print where it is known.
ImageMask region_mask(const LaserSpotAids& aids, const cv::Rect& part) {
  cv::Mat mask(part.size(), CV_8U, cv::Scalar(255));
  const auto cut = [&](const std::vector<Eigen::Vector2d>& polygon) {
    if (polygon.empty()) return;
    cv::Mat inside(part.size(), CV_8U, cv::Scalar(0));
    std::vector<cv::Point> points;
    for (const Eigen::Vector2d& px : polygon)
      points.emplace_back(static_cast<int>(std::lround(px.x())) - part.x,
                          static_cast<int>(std::lround(px.y())) - part.y);
    cv::fillPoly(inside, std::vector<std::vector<cv::Point>>{points}, cv::Scalar(255));
    mask &= inside;
  };
  cut(aids.region);
  if (aids.seen_board) cut(printed_outline(*aids.seen_board));
  return Eigen::Map<const ImageMask>(mask.ptr(), mask.rows, mask.cols);
}

/// The part of the photo around the region, with room for a background.
cv::Rect part_of(const cv::Mat& photo, const LaserSpotAids& aids) {
  const cv::Rect all(0, 0, photo.cols, photo.rows);
  cv::Rect part = all;
  const auto cut = [&](const std::vector<Eigen::Vector2d>& polygon) {
    if (polygon.empty()) return;
    Eigen::AlignedBox2d box;
    for (const Eigen::Vector2d& px : polygon) box.extend(px);
    constexpr double margin_px = 12.0;
    const Eigen::Vector2d low = (box.min().array() - margin_px).max(0.0).min(1e5);
    const Eigen::Vector2d high = (box.max().array() + margin_px).max(0.0).min(1e5);
    part &= cv::Rect(cv::Point(static_cast<int>(low.x()), static_cast<int>(low.y())),
                     cv::Point(static_cast<int>(high.x()) + 1, static_cast<int>(high.y()) + 1));
  };
  cut(aids.region);
  if (aids.seen_board) cut(printed_outline(*aids.seen_board));
  return part;
}

bool is_chessboard(const LaserSpotAids& aids) {
  return aids.seen_board && aids.seen_board->board.kind == BoardKind::chessboard;
}

std::string reason_against(const cv::Mat& photo, const LaserSpotAids& aids) {
  if (photo.empty() || photo.dims != 2) return "there is no image";
  if (aids.photo_off && (aids.photo_off->size() != photo.size() || aids.photo_off->type() != photo.type()))
    return "the photo with the laser off has another size or kind";
  if (photo.channels() < 3 && !aids.photo_off && !is_chessboard(aids))
    return "a grey photo shows no spot without the photo with the laser off or a chessboard's pose";
  return {};
}

/// Background of a colour photo: the combination of its other two channels that fits the main one.
void estimate_from_channels(const std::vector<Image>& channels, std::size_t at, SpotSignal& signal) {
  const Image& main = channels[at];
  const Image one = Image::Ones(main.rows(), main.cols());
  const Image &first = channels[(at + 1) % 3], &second = channels[(at + 2) % 3];
  // Without contrast noise alone would determine the shares, meaninglessly; neutral colours have halves.
  constexpr double prior_noises = 60.0;
  const double noise = noise_of(first), prior = prior_noises * noise * noise;
  const RobustSum sum(main, {&first, &second, &one}, unsaturated(main.max(first).max(second)), prior);
  if (sum.is_solved()) signal.background = sum.sum();
  signal.background_is_lit = signal.is_excess = true;
}

/// Background of a chessboard of known pose: its ink and paper.
void estimate_from_board(const Image& main, const SeenBoard& board, SpotSignal& signal) {
  Image model = board_background(main, signal, board);
  if (model.size() == 0) return;
  signal.background = std::move(model);
  signal.background_is_lit = false;
  const Image over_model = main - signal.background;
  // The excess over other channels fits the print better, but it vanishes where its own channel saturates.
  signal.is_modelled = signal.detected.size() == 0;
  if (signal.is_modelled) signal.detected = signal.light = over_model;
  signal.light = (signal.is_saturated > 0).select(over_model, signal.light);
}

/// Gradient of the background. At the centre of a saddle there is none, but an error as large as beside it.
void find_edges(SpotSignal& signal) {
  Image gradient = gradient_length(signal.background);
  signal.edge.resizeLike(gradient);
  cv::Mat widened = as_mat(signal.edge);
  cv::dilate(as_mat(gradient), widened, cv::Mat());
}

}  // namespace

SpotSignal spot_signal(const cv::Mat& photo, int channel, const LaserSpotAids& aids) {
  SpotSignal signal;
  signal.reason = reason_against(photo, aids);
  if (!signal.reason.empty()) return signal;
  const cv::Rect part = part_of(photo, aids);
  if (part.width < 16 || part.height < 16) {
    signal.reason = "the region lies outside the photo";
    return signal;
  }
  signal.u_min = part.x;
  signal.v_min = part.y;
  signal.photo_cols = photo.cols;
  signal.photo_rows = photo.rows;
  signal.is_in_region = region_mask(aids, part);
  const double scale = scale_of(photo);
  const std::vector<Image> channels = channels_of(photo, part, scale);
  const std::size_t at = channels.size() == 1 ? 0 : static_cast<std::size_t>(channel);
  const Image& main = channels[at];
  signal.is_saturated = 255 - unsaturated(main);
  if (aids.photo_off)
    signal.background = matched_to(main, channels_of(*aids.photo_off, part, scale)[at]);
  else if (channels.size() > 1 && channel < 3)
    estimate_from_channels(channels, at, signal);
  if (signal.background.size() > 0) signal.detected = signal.light = main - signal.background;
  if (!aids.photo_off && is_chessboard(aids)) estimate_from_board(main, *aids.seen_board, signal);
  if (signal.background.size() == 0) {
    signal.reason = "the photo is blown out";
    return signal;
  }
  find_edges(signal);
  measure_noise(signal);
  return signal;
}

}  // namespace alidade
