#include "alidade/results/calibration_result.h"

#include <nlohmann/json.hpp>

#include "alidade/files/files.h"
#include "alidade/formats/camera_file.h"
#include "alidade/results/result_board.h"
#include "alidade/results/result_document.h"
#include "alidade/tables/corner_file.h"

namespace alidade {
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
    found.board = result_board(estimate.at("board").dump());
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
