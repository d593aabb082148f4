#include "alidade/results/rangefinder_result.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "alidade/formats/beam_file.h"
#include "alidade/formats/camera_file.h"
#include "alidade/results/result_board.h"
#include "alidade/results/result_document.h"

namespace alidade {

using Json = nlohmann::json;

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
    now.sigma_spot_px = std::max(0.02, estimate.at("noise").at("sigma_spot_px").get<double>());
    now.sigma_corner_px = std::max(0.01, estimate.at("noise").at("sigma_corner_px").get<double>());
    now.estimate_scale = json.at("stddev").at("scale").get<double>() > 0.0;
    Board board{.cols = 9, .rows = 6, .square_m = 0.04};
    if (estimate.contains("board")) board = result_board(estimate.at("board").dump());
    now.points_in_board = points_in_board(board);
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
