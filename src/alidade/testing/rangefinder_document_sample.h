#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "alidade/io/rangefinder_document.h"
#include "alidade/rangefinder/next_shot.h"
#include "alidade/rangefinder/shot_checks.h"
#include "alidade/testing/rangefinder_sample.h"

namespace alidade::testing {

inline RangefinderExtras sample_extras(const RangefinderSample& sample, const RangefinderReport& report,
                                       const RangefinderConfig& config) {
  RangefinderExtras extras;
  extras.board = sample.scene.board;
  if (report.status != RangefinderReport::Status::converged) return extras;
  const auto& shots = sample.simulated.shots;
  extras.by_count = sigma_by_count(shots, report, sample.points, sample.camera, config);
  extras.left_out = leave_one_out(shots, report, sample.points, sample.camera, config);
  BeamNow now{.beam = report.beam, .camera = report.camera, .points_in_board = sample.points};
  now.method = config.method;
  extras.gains = next_shot_gains(now, {});
  return extras;
}

/// What the command writes of a simulated scenario, with two of its 18 readings wrong, by the code that writes it.
inline nlohmann::ordered_json sample_rangefinder_document(std::string_view scenario, RangefinderMethod method) {
  const RangefinderSample sample =
      draw_rangefinder_sample(rangefinder_scenario(scenario).value(), {.outlier_share = 0.1}, 7);
  const RangefinderConfig config = told_config(method);
  const RangefinderReport report = solve_sample(sample, config);
  ResultDocument document;
  document.command = "rangefinder";
  document.argv = {"alidade", "rangefinder", "shots.csv", "--camera", "camera.yaml"};
  document.created_utc = "2026-01-02T03:04:05Z";
  document.seconds = {{"total", 0.21}};
  document.verdict = rangefinder_verdict(report, sample.simulated.shots, config);
  fill_rangefinder(sample.simulated.shots, report, config, sample_extras(sample, report, config), document);
  auto json = nlohmann::ordered_json::parse(result_text(document));
  nlohmann::ordered_json& camera = json["estimate"]["camera"];
  camera = {{"model", model_name(report.camera.lens)},
            {"width", sample.camera.width_px},
            {"height", sample.camera.height_px}};
  const std::vector<std::string> names = param_names(report.camera.lens);
  for (std::size_t i = 0; i < names.size(); ++i)
    camera[names[i]] = params(report.camera.lens)[static_cast<Eigen::Index>(i)];
  return json;
}

}  // namespace alidade::testing
