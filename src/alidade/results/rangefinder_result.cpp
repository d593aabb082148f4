#include "alidade/results/rangefinder_result.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>

#include "alidade/formats/beam_file.h"
#include "alidade/formats/camera_file.h"
#include "alidade/results/result_board.h"
#include "alidade/results/result_document.h"

namespace alidade {

using Json = nlohmann::json;

namespace {

/// The number of a row, NaN where there is none.
double number_in(const Json& table, const std::string& column, std::size_t row) {
  const Json& value = table.at(column).at(row);
  return value.is_number() ? value.get<double>() : std::nan("");
}

/// Rows of the table of planes by the name of their shot.
std::map<std::string, std::size_t> rows_of(const Json& planes) {
  std::map<std::string, std::size_t> rows;
  for (const Json& name : planes.at("name")) rows.emplace(name.get<std::string>(), rows.size());
  return rows;
}

std::optional<Rigid3> pose_in(const Json& planes, std::size_t row) {
  const auto number = [&](const char* of) { return number_in(planes, std::string("cam_from_board_") + of, row); };
  const Eigen::Quaterniond rotation(number("qw"), number("qx"), number("qy"), number("qz"));
  const Rigid3 pose{rotation.normalized(), {number("x_m"), number("y_m"), number("z_m")}};
  if (!pose.rotation.coeffs().allFinite() || !pose.translation.allFinite()) return std::nullopt;
  return pose;
}

/// What the shots behind the beam show. `have_corners`: boards were seen, not only given.
void put_taken_shots(const Json& data, bool have_corners, BeamNow& now) {
  if (!data.contains("shots") || !data.contains("planes")) return;
  const Json &shots = data.at("shots"), &planes = data.at("planes");
  const std::map<std::string, std::size_t> rows = rows_of(planes);
  bool any = false, spots = false, boards = false;
  for (std::size_t i = 0; i < shots.at("name").size(); ++i) {
    if (!shots.at("used").at(i).get<bool>()) continue;
    const bool has_spot = std::isfinite(number_in(shots, "residual_u_px", i));
    const auto row = rows.find(shots.at("name").at(i).get<std::string>());
    any = true;
    spots = spots || has_spot;
    boards = boards || row != rows.end();
    const auto pose = row != rows.end() && have_corners ? pose_in(planes, row->second) : std::nullopt;
    if (pose) now.taken.push_back({number_in(shots, "range_m", i), *pose, has_spot});
  }
  now.sees_spots = spots || !any;
  now.sees_boards = boards || !any || (now.method == RangefinderMethod::spot && have_corners);
}

CountedSheet sheet_in(const Json& estimate) {
  CountedSheet sheet;
  if (!estimate.contains("sheet")) return sheet;
  const Json& json = estimate.at("sheet");
  sheet.sigma_m = json.at("sigma_m").get<double>();
  sheet.left_m = json.at("left_m").get<double>();
  for (int i = 0; i < num_beam_params; ++i) sheet.moves[i] = json.at("moves").at(static_cast<std::size_t>(i));
  return sheet;
}

}  // namespace

BeamNow read_rangefinder(const std::filesystem::path& result) {
  const std::filesystem::path file = std::filesystem::is_directory(result) ? result / "result.json" : result;
  BeamNow now;
  try {
    const Json json = Json::parse(read_file(file));
    if (json.at("command") != "rangefinder")
      throw InputError("is the result of '" + json.at("command").get<std::string>() + "', not of rangefinder");
    if (!is_estimate(json.at("verdict").at("exit_code").get<int>()))
      throw InputError("this calibration was refused: " + json.at("verdict").value("to_add", ""));
    const Json& estimate = json.at("estimate");
    (void)words_code(now.method, rangefinder_method_words()).read(estimate.at("method"));
    if (estimate.value("refine", "all") == "beam") now.refine = Refine::beam;
    now.sigma_spot_px = std::max(0.02, estimate.at("noise").at("sigma_spot_px").get<double>());
    now.sigma_corner_px = std::max(0.01, estimate.at("noise").at("sigma_corner_px").get<double>());
    now.estimate_scale = json.at("stddev").at("scale").get<double>() > 0.0;
    now.sheet = sheet_in(estimate);
    Board board{.cols = 9, .rows = 6, .square_m = 0.04};
    if (estimate.contains("board")) board = result_board(estimate.at("board").dump());
    now.points_in_board = points_in_board(board);
    if (json.contains("data")) put_taken_shots(json.at("data"), estimate.contains("board"), now);
  } catch (const Json::exception&) {
    throw InputError(file.string() + ": not a result.json of alidade rangefinder");
  } catch (const InputError& error) {
    const std::string what = error.what();
    throw InputError(what.starts_with(file.string()) ? what : file.string() + ": " + what);
  }
  now.beam = read_beam(file.parent_path() / "rangefinder.yaml").beam;
  now.camera = read_camera(file.parent_path() / "camera.yaml");
  return now;
}

}  // namespace alidade
