#include "alidade/results/documents/follow_document.h"

#include <array>

#include "alidade/report/thin.h"
#include "alidade/results/thin_tables.h"

namespace alidade {
namespace {

constexpr std::array<const char*, 8> follow_columns{"error_u_px",     "error_v_px",       "asked_pan_rad",
                                                    "asked_tilt_rad", "measured_pan_rad", "measured_tilt_rad",
                                                    "target_pan_rad", "target_tilt_rad"};

std::array<double, follow_columns.size()> follow_cells(const FollowedFrame& frame) {
  const auto if_found = [&](double value) { return frame.is_found ? value : missing_value; };
  const Eigen::Vector2d asked = frame.asked_rad.value_or(Eigen::Vector2d::Constant(missing_value));
  return {if_found(frame.error_px[0]),
          if_found(frame.error_px[1]),
          asked[0],
          asked[1],
          frame.pan_tilt_rad[0],
          frame.pan_tilt_rad[1],
          if_found(frame.target_rad[0]),
          if_found(frame.target_rad[1])};
}

}  // namespace

DataTable follow_table(std::span<const FollowedFrame> frames) {
  std::vector<bool> is_lost;
  for (std::size_t i = 0; i < frames.size(); ++i)
    is_lost.push_back(i > 0 && frames[i].is_found != frames[i - 1].is_found);
  std::vector<double> t;
  std::array<std::vector<double>, follow_columns.size()> cells;
  for (const std::size_t at : report::thinned_rows(frames.size(), {}, is_lost, report::max_step_rows)) {
    t.push_back(frames[at].t_s);
    const auto own = follow_cells(frames[at]);
    for (std::size_t k = 0; k < own.size(); ++k) cells[k].push_back(own[k]);
  }
  DataTable table{"follow", {{"t_s", rounded(std::move(t), 6)}}};
  for (std::size_t k = 0; k < cells.size(); ++k)
    table.columns.emplace_back(follow_columns[k], rounded(std::move(cells[k]), k < 2 ? 4 : 7));
  record_steps_kept(table, frames.size(), "", "follow.csv");
  return table;
}

}  // namespace alidade
