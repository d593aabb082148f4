#include "alidade/pantilt/head_view.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <set>
#include <vector>

namespace alidade {
namespace {

constexpr double turn_rad = 2.0 * std::numbers::pi;

/// The readings above which all are to be a turn less; infinite: none. `sorted`: those of one axis.
double end_of_arc(const std::vector<double>& sorted) {
  constexpr double never = std::numeric_limits<double>::infinity();
  const double span = sorted.back() - sorted.front();
  if (span > 1.001 * turn_rad) return never;
  double widest = 0.0, from = never;
  for (std::size_t i = 1; i < sorted.size(); ++i) {
    const double gap = sorted[i] - sorted[i - 1];
    if (gap > widest) widest = gap, from = 0.5 * (sorted[i] + sorted[i - 1]);
  }
  // A head that stops at both ends of its range, and seldom in between, does not read from 0 to a turn.
  const bool counts_from_zero = sorted.front() > -1e-9 && sorted.back() > 0.5 * turn_rad;
  const bool is_wrapped = widest > 2.0 * (turn_rad - span) && (counts_from_zero || widest > 0.5 * turn_rad);
  return is_wrapped ? from : never;
}

void unwrap_axis(std::span<HeadView> views, int head, int axis) {
  std::vector<double> sorted;
  for (const HeadView& view : views)
    if (view.head == head) sorted.push_back(view.pan_tilt_rad[axis]);
  std::ranges::sort(sorted);
  const double end_rad = end_of_arc(sorted);
  const auto in_arc = [end_rad](double reading) { return reading > end_rad ? reading - turn_rad : reading; };
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (const double reading : sorted) low = std::min(low, in_arc(reading)), high = std::max(high, in_arc(reading));
  const double middle = 0.5 * (low + high), to_zero = angle_near(middle, 0.0) - middle;
  for (HeadView& view : views)
    if (double& reading = view.pan_tilt_rad[axis]; view.head == head) reading = in_arc(reading) + to_zero;
}

}  // namespace

double angle_near(double angle_rad, double near_rad) {
  const double turns = std::round((angle_rad - near_rad) / turn_rad);
  return turns != 0.0 ? angle_rad - turns * turn_rad : angle_rad;
}

double reading_after(double reading_rad, double last_rad) {
  return std::abs(reading_rad) > 1.001 * turn_rad ? reading_rad : angle_near(reading_rad, last_rad);
}

void unwrap_readings(std::span<HeadView> views) {
  std::set<int> heads;
  for (const HeadView& view : views) heads.insert(view.head);
  for (const int head : heads)
    for (const int axis : {0, 1}) unwrap_axis(views, head, axis);
}

}  // namespace alidade
