#include <gtest/gtest.h>

#include <functional>
#include <sstream>

#include "alidade/tables/events_file.h"
#include "alidade/tables/localize_file.h"
#include "alidade/tables/logs/events_stream.h"
#include "alidade/tables/logs/observations_stream.h"
#include "alidade/tables/pairs_file.h"
#include "alidade/tables/servo_log_file.h"
#include "alidade/tables/shots_file.h"
#include "alidade/tables/views_file.h"
#include "alidade/testing/temporary_folder.h"

namespace alidade {
namespace {

constexpr bool skip_bad = true;

const std::vector<RigHead>& one_head() {
  static const std::vector<RigHead> heads = [] {
    std::vector<RigHead> made(1);
    made[0].head.id = 1;
    return made;
  }();
  return heads;
}

struct Table {
  std::string name, header, good_row, better_row;  ///< Both are right.
  std::function<std::vector<SkippedInput>(const std::filesystem::path&)> skipped;
};

std::vector<SkippedInput> named_by(
    const std::function<void(const std::filesystem::path&, std::vector<SkippedInput>*)>& read,
    const std::filesystem::path& file) {
  std::vector<SkippedInput> named;
  read(file, &named);
  return named;
}

std::vector<Table> tables() {
  using Path = std::filesystem::path;
  return {
      {"events", "t_capture_s,t_arrival_s,head,pan_rad,tilt_rad,u_px,v_px", "0,0.1,1,0,0,5,5", "1,1.1,1.0,0,0,5,5",
       [](const Path& file) { return read_events(file, one_head(), {.skip_bad = true}).skipped; }},
      {"events -", "t_capture_s,t_arrival_s,head,pan_rad,tilt_rad,u_px,v_px", "0,0.1,1,0,0,5,5", "1,1.1,1,0,0,5,5",
       [](const Path& file) {
         std::istringstream text(read_file(file));
         EventsStream stream(text, file.string(), one_head(), {.skip_bad = true});
         while (stream.next()) continue;
         return stream.skipped();
       }},
      {"observations", "frame,t_s,point_id,u_px,v_px", "0,0,1,5,5", "1.0,1,2.0,5,5",
       [](const Path& file) { return read_observations(file, {.skip_bad = true}).skipped; }},
      {"shots", "range_m,u,v", "1,5,5", "2,6,6", [](const Path& file) { return read_shots(file, {true}).skipped; }},
      {"views", "view,board,head,pan_rad,tilt_rad,corner,u,v", "0,0,1,0,0,0,5,5", "0,0,1.0,0,0,1.0,6,5",
       [](const Path& file) { return read_views(file, {.skip_bad = true, .num_points = 4}).skipped; }},
      {"servo log", "t_s,command,angle_rad", "0,0,0", "1,0,0",
       [](const Path& file) { return read_servo_log(file, skip_bad).skipped; }},
      {"pairs", "frame_a,frame_b,ua_px,va_px,ub_px,vb_px", "0,1,5,5,6,6", "0,1,7,7,8,8",
       [](const Path& file) { return read_pairs(file, skip_bad).skipped; }},
      {"depths", "t_s,depth_m", "0,1", "1,1",
       [](const Path& file) {
         return named_by([](const Path& f, auto* named) { (void)read_depth_sensor(f, skip_bad, named); }, file);
       }},
      {"odometry", "t_s,x_m,y_m", "0,1,1", "1,1,1",
       [](const Path& file) {
         return named_by([](const Path& f, auto* named) { (void)read_odometry(f, skip_bad, named); }, file);
       }},
  };
}

TEST(SkipBad, RowsOfAnotherLengthGarbageAndBlankLinesAreNamedInEveryTable) {
  const testing::TemporaryFolder folder;
  const auto file = folder.path() / "table.csv";
  for (const Table& table : tables()) {
    SCOPED_TRACE(table.name);
    write_file(file, table.header + "\n" + table.good_row + "\n1\n\n@!garbage,,,,,,,,,,,,\n" + table.better_row + "\n");
    const std::vector<SkippedInput> skipped = table.skipped(file);
    std::vector<std::size_t> lines;
    for (const SkippedInput& row : skipped) lines.push_back(row.line);
    EXPECT_EQ(lines, (std::vector<std::size_t>{3, 4, 5})) << "the two rows that are right are read";
  }
}

}  // namespace
}  // namespace alidade
