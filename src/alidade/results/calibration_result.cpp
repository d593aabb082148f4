#include "alidade/results/calibration_result.h"

#include <nlohmann/json.hpp>

#include "alidade/files/files.h"
#include "alidade/formats/camera_file.h"
#include "alidade/results/result_document.h"
#include "alidade/tables/corner_file.h"

namespace alidade {
namespace {

Board board_of(const nlohmann::json& json) {
  Board board;
  const auto kind = board_kind(json.value("kind", "chessboard"));
  if (!kind) throw InputError("estimate.board.kind is not a kind of board");
  board.kind = *kind;
  board.cols = json.at("cols").get<int>();
  board.rows = json.at("rows").get<int>();
  board.square_m = json.at("square_m").get<double>();
  board.marker_m = json.value("marker_m", 0.0);
  const bool sane =
      board.cols > 0 && board.rows > 0 && board.cols <= 1000 && board.rows <= 1000 && board.square_m > 0.0;
  if (!sane) throw InputError("estimate.board is not a board");
  return board;
}

}  // namespace

CalibratedNow read_calibration(const std::filesystem::path& result) {
  const bool is_folder = std::filesystem::is_directory(result);
  const std::filesystem::path file = is_folder ? result / "result.json" : result;
  const std::filesystem::path folder = file.parent_path();
  CalibratedNow found;
  try {
    const auto json = nlohmann::json::parse(read_file(file));
    if (json.at("command") != "calibrate") {
      throw InputError("is the result of '" + json.at("command").get<std::string>() + "', not of calibrate");
    }
    if (!is_estimate(json.at("verdict").at("exit_code").get<int>()))
      throw InputError("this calibration was refused: there is no camera");
    const auto& estimate = json.at("estimate");
    found.noise_px = estimate.at("noise_px").get<double>();
    if (estimate.contains("sigma")) found.design_effect = estimate["sigma"].value("design_effect", 1.0);
    found.board = board_of(estimate.at("board"));
  } catch (const nlohmann::json::exception&) {
    throw InputError(file.string() + ": not a result.json of alidade calibrate");
  } catch (const InputError& error) {
    const std::string what = error.what();
    throw InputError(what.starts_with(file.string()) ? what : file.string() + ": " + what);
  }
  found.camera = read_camera(folder / "camera.yaml");
  found.board_points = read_board_points(folder / "board_points.csv", num_points(found.board));
  return found;
}

}  // namespace alidade
