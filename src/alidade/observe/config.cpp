#include "alidade/observe/config.h"

#include <algorithm>
#include <cmath>

#include "alidade/estimation/config_error.h"
#include "alidade/observe/setup.h"

namespace alidade {
namespace {

/// Text code of an optional vector.
template <int Size>
TextCode vector_code(std::optional<Eigen::Matrix<double, Size, 1>>& value) {
  return numbers_code(
      Size, [&value] { return value ? std::vector<double>(value->begin(), value->end()) : std::vector<double>(); },
      [&value](const std::vector<double>& numbers) { value.emplace(numbers.data()); });
}

constexpr Limits positive{.min = 0.0, .is_above_min = true}, relative{0.0, 1.0};

FieldList word_fields(ObserveConfig& config) {
  static const WordList<ObserveMethod> methods = {{ObserveMethod::hybrid, "hybrid"},
                                                  {ObserveMethod::window, "window"},
                                                  {ObserveMethod::flow, "flow"},
                                                  {ObserveMethod::fang2011, "fang2011"},
                                                  {ObserveMethod::batch, "batch"}};
  static const WordList<RotationKnowledge> rotations = {
      {RotationKnowledge::known, "known"}, {RotationKnowledge::noisy, "noisy"}, {RotationKnowledge::free, "free"}};
  static const WordList<FangProfile> profiles = {
      {FangProfile::fast, "fast"}, {FangProfile::quiet, "quiet"}, {FangProfile::kalman, "kalman"}};
  return {
      {.name = "method",
       .value = words_code(config.method, methods),
       .help = "hybrid: least-squares adjustment, then a filter that follows zooms; window: adjustment of the last "
               "seconds; "
               "flow: regression on image motion; fang2011: the paper's observer; batch: one adjustment of all rows"},
      {.name = "rotation",
       .value = words_code(config.rotation, rotations),
       .help = "known: exact; noisy: measured with --sigma-angle or --sigma-rate; free: estimated"},
      {.name = "estimate",
       .value = &config.estimate,
       .help = "Estimate as well: auto (default: what the residuals indicate), none, or any of k1, k2, k3, p1, p2, "
               "mount, delay, lever, shutter, focal-drift, and, for the measured rotation, scale, backlash, curve, "
               "axes, drift, bias, clock"},
      {.name = "start",
       .value = vector_code<4>(config.start),
       .help = "Initial guess fx,fy,cx,cy [px] (default: several are tried)",
       .form = "NUMBER"},
      {.name = "size",
       .value = pair_code(config.width_px, config.height_px, 20000,
                          "WIDTHxHEIGHT of 32 to 20000 px, for example 800x600", 32),
       .help = "Image size (default: the camera's, else the smallest that contains the points)",
       .form = "WxH"},
      {.name = "profile", .value = words_code(config.profile, profiles), .help = "Gains of --method fang2011"}};
}

FieldList number_fields(ObserveConfig& config) {
  return {
      {.name = "square_pixels", .value = &config.square_pixels, .help = "fx = fy"},
      {.name = "no_zoom",
       .value = &config.no_zoom,
       .help = "The camera does not zoom; apparent zoom has another cause"},
      {.name = "fixed_centre",
       .value = &config.fixed_centre,
       .help = "Fix cx, cy at the initial guess, or at the image centre",
       .option = "--fix-centre"},
      {.name = "lever_m",
       .value = vector_code<3>(config.lever_m),
       .help =
           "Lever arm: position of the camera centre relative to the centre of rotation, x,y,z in the camera frame [m]",
       .form = "NUMBER"},
  };
}

FieldList sigma_fields(ObserveConfig& config) {
  return {
      {.name = "sigma_px",
       .value = &config.sigma_px,
       .help = "σ of a pixel coordinate [px] (default: estimated from the residuals)",
       .limits = positive,
       .option = "--sigma-px"},
      {.name = "sigma_angle_rad",
       .value = &config.sigma_angle_rad,
       .help = "σ of an encoder or attitude angle [rad]",
       .limits = positive},
      {.name = "sigma_rate_rad_per_s",
       .value = &config.sigma_rate_rad_per_s,
       .help = "σ of an angular rate [rad/s]",
       .limits = positive,
       .option = "--sigma-rate"},
      {.name = "sigma_range_m",
       .value = &config.sigma_range_m,
       .help = "σ of the column range_m [m]",
       .limits = positive,
       .option = "--sigma-range-m"},
      {.name = "sigma_scale",
       .value = &config.sigma_scale,
       .help = "Relative σ of the scale of the measured angles or rates; 0: exact",
       .limits = relative,
       .option = "--sigma-encoder-scale"},
      {.name = "sigma_parallax",
       .value = &config.sigma_parallax,
       .help = "σ of the camera centre's offset from the axes, relative to the distance of the points; 0: exact",
       .limits = relative},
  };
}

FieldList length_fields(ObserveConfig& config) {
  return {{.name = "window_s",
           .value = &config.window_s,
           .help = "Length of the window of --method window [s]",
           .limits = positive,
           .option = "--window-s"},
          {.name = "keep_rows",
           .value = &config.keep_rows,
           .help = "Rows from standard input: minimum number of latest rows that the final result covers; at most "
                   "twice as many",
           .limits = {.min = 100, .max = 1e9}}};
}

}  // namespace

FieldList fields_of(ObserveConfig& config) {
  FieldList fields = word_fields(config);
  for (FieldList more : {number_fields(config), sigma_fields(config), length_fields(config)})
    for (Field& field : more) fields.push_back(std::move(field));
  return fields;
}

void check_config(const ObserveConfig& config) { (void)setup_of(config); }

std::pair<int, int> given_size(const ObserveConfig& config) {
  if (config.width_px > 0) return {config.width_px, config.height_px};
  return config.camera ? std::pair(config.camera->width_px, config.camera->height_px) : std::pair(0, 0);
}

}  // namespace alidade
