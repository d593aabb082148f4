#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "alidade/geometry/degree.h"
#include "alidade/turned/parallax.h"
#include "alidade/turned/turned.h"

namespace alidade {
namespace {

using Status = TurnedReport::Status;

constexpr double zoom_is_seen = 5.0, zoom_matters = 0.005;  // σ; relative

/// The first of the names: "a.jpg, b.jpg and 3 more".
std::string list_of(const std::vector<std::string>& names) {
  constexpr std::size_t most = 4;
  std::string text;
  for (std::size_t i = 0; i < std::min(names.size(), most); ++i) text += (i > 0 ? ", " : "") + names[i];
  if (names.size() > most) text += " and " + std::to_string(names.size() - most) + " more";
  return text;
}

std::vector<std::string> left_out(const TurnedReport& report, const MatchedPhotos& photos) {
  std::vector<std::string> names;
  for (std::size_t i = 0; i < report.photos.size(); ++i) {
    if (!report.photos[i].is_used) names.push_back(photos.names[i]);
  }
  return names;
}

struct Refusal {
  std::string what, add;
};

Refusal too_few(const TurnedReport& report, const MatchedPhotos& photos) {
  const std::size_t count = photos.names.size();
  const std::string more = "take three or more from one spot, each overlapping the last by a third or more";
  if (count < 2) return {"one photo does not determine a rotation", more};
  const auto same = std::ranges::count_if(
      report.photos, [](const RotatedPhoto& photo) { return photo.reason.starts_with("is the same image"); });
  if (same + 1 == static_cast<std::ptrdiff_t>(count))
    return {"all photos are one image: the camera did not rotate", "rotate it by 10° or more from photo to photo"};
  const auto alone = std::ranges::count_if(
      report.photos, [](const RotatedPhoto& photo) { return photo.reason == "overlaps no other photo"; });
  if (alone + same == static_cast<std::ptrdiff_t>(count))
    return {"no two of the " + std::to_string(count) + " photos show the same things", more};
  return {"only two photos hang together: one rotation, which nothing confirms", more};
}

Refusal zoomed(const TurnedReport& report, const MatchedPhotos& photos) {
  std::vector<std::string> names;
  for (std::size_t i = 0; i < report.photos.size(); ++i) {
    if (report.photos[i].reason.starts_with("its focal length"))
      names.push_back(photos.names[i] + " (" + text_of(report.photos[i].zoom, 3) + " times)");
  }
  return {"the focal length is not the same in all photos: " + list_of(names),
          "exclude these, or take all at one zoom and focus; a step forward looks alike"};
}

/// Which of the free parameters the photos do not determine.
Refusal weak(const TurnedReport& report, const MatchedPhotos& photos, const TurnedConfig& config) {
  const Eigen::VectorXd sigma = report.cov.diagonal().cwiseSqrt();
  const double f = std::min(report.camera[0], report.camera[1]);
  constexpr double most = 0.05;
  const auto less = std::min(sigma[0], sigma[1]);
  const std::string turn = "rotate the camera farther, by half an image's width and more, up and down as well";
  const double off_square = std::abs(report.free_aspect - 1.0);
  if (config.square_pixels && off_square > 0.02 && off_square > 6.0 * report.sigma_free_aspect) {
    return {
        "the photos put fy / fx at " + text_of(report.free_aspect, 4) + ", far from the square pixels that are fixed",
        "omit --square-pixels, or give the images as the camera took them"};
  }
  if (!(less < most * f)) {
    return {"the focal length is determined to " + text_of(100.0 * less / f, 2) +
                " % only (1σ), by rotations of up to " + text_of(report.largest_turn_rad / degree, 2) + "°",
            turn};
  }
  const bool is_aspect = !(std::max(sigma[0], sigma[1]) < most * f);
  const bool is_centre = !(sigma.segment<2>(2).maxCoeff() < most * photos.width_px);
  std::string what = is_aspect ? "fx / fy" : "", hold;
  if (is_centre) what += is_aspect ? ", cx and cy" : "cx and cy";
  if (is_aspect && !config.square_pixels) hold = " --square-pixels";
  if (is_centre && !config.fixed_centre) hold += " --fix-centre";
  return {"with the rotation unknown these views cannot determine " + what,
          (hold.empty() ? "" : "fix what you know:" + hold + ", or ") + turn};
}

Verdict refused(const Refusal& refusal, ExitCode code) {
  Verdict verdict;
  verdict.state = code == ExitCode::undetermined ? State::refused : State::not_converged;
  verdict.exit_code = code;
  verdict.sentence = refusal.what;
  verdict.to_add = refusal.add;
  return verdict;
}

Check focal_check(const TurnedReport& report) {
  constexpr double fine = 1.0, none = 5.0;
  const double sigma = 100.0 * std::sqrt(report.cov(0, 0)) / report.camera[0];
  Check check{"focal length", State::good, "σ of the focal length is " + text_of(sigma, 2) + " %", sigma, fine, "%",
              "intrinsics"};
  if (sigma > fine) {
    check.state = sigma > none ? State::bad : State::care;
    check.text += ": take more photos, rotated farther, up and down as well";
  }
  return check;
}

Check agreement_check(const TurnedReport& report) {
  constexpr double care = 25.0;
  const double raise = std::sqrt(std::max(report.design_effect, 1.0));
  Check check{"photos agree", State::good, "", report.design_effect, care, "", "photos"};
  check.text = "omitting a photo changes the answer " + text_of(std::sqrt(report.design_effect), 2) +
               " times as much as the noise of single points lets expect";
  if (raise > 1.5) check.text += ": errors are shared within photos (steps of the hand, focus, shutter); counted in σ";
  if (report.design_effect > care) check.state = State::care;
  return check;
}

Check parallax_check(const TurnedReport& report, const MatchedPhotos& photos) {
  constexpr double most = 0.03;
  const ParallaxTest& test = report.parallax;
  Check check{"turns on the spot", State::good, "", test.z, parallax_is_seen, "σ", "residuals"};
  if (test.photo_a < 0 || test.z < parallax_is_seen) {
    check.text = "no pair of photos shows that the camera's centre moved";
    return check;
  }
  check.text = "near points shift against far ones, most between " +
               photos.names[static_cast<std::size_t>(test.photo_a)] + " and " +
               photos.names[static_cast<std::size_t>(test.photo_b)] + ": the camera's centre moved by about " +
               text_of(100.0 * test.relative, 2) + " % of the points' distance a radian of turn";
  const bool matters = test.relative * report.camera[0] > 0.5 * std::sqrt(report.cov(0, 0));
  check.text += matters ? "; counted in σ: rotate it about its lens, or look at things farther away" : "; counted in σ";
  if (matters) check.state = test.relative > most ? State::bad : State::care;
  return check;
}

Check zoom_check(const TurnedReport& report, const MatchedPhotos& photos) {
  Check check{"one focal length",
              State::good,
              "no photo indicates a focal length of its own",
              0.0,
              100.0 * zoom_matters,
              "%",
              "photos"};
  for (std::size_t i = 0; i < report.photos.size(); ++i) {
    const RotatedPhoto& photo = report.photos[i];
    const double off = std::abs(photo.zoom - 1.0);
    if (!photo.is_used || !(off > zoom_is_seen * photo.sigma_zoom) || 100.0 * off <= check.value) continue;
    check.value = 100.0 * off;
    if (off < zoom_matters) continue;
    check.state = State::care;
    check.text = photos.names[i] + " indicates a focal length of its own, " + text_of(photo.zoom, 4) +
                 " times that of the others: zoom, focus, or a step forward";
  }
  return check;
}

Check kept_check(const TurnedReport& report) {
  constexpr double care = 80.0;
  const double share = 100.0 * std::min(1.0, static_cast<double>(report.matches.kept) /
                                                 std::max(1.0, static_cast<double>(report.matches.agreeing)));
  Check check{"matches", State::good, "", share, care, "%", "residuals"};
  check.text = "of " + std::to_string(report.matches.given) + " matches " + std::to_string(report.matches.agreeing) +
               " agree within their pair, " + std::to_string(report.matches.kept) + " with one camera that rotates";
  if (report.matches.burned_in > 0)
    check.text += "; " + std::to_string(report.matches.burned_in) +
                  " more are of what is at one place in the image (a date, a logo, dirt on the lens), and are left out";
  if (share < care) check.state = State::care;
  return check;
}

Check noise_check_of(const TurnedReport& report, const MatchedPhotos& photos) {
  const double most = 2.0 * std::max(1.0, photos.width_px / 1280.0);
  Check check{"noise", State::good, "σ of a pixel is " + text_of(report.sigma_px, 2) + " px", report.sigma_px, most,
              "px",    "residuals"};
  if (report.sigma_px > most) {
    check.state = State::care;
    check.text += ": no finder of points is so unsure, something else moves them";
  }
  return check;
}

Check photos_check(const TurnedReport& report, const MatchedPhotos& photos) {
  const auto out = left_out(report, photos);
  const auto used = photos.names.size() - out.size();
  Check check{"photos", State::good, std::to_string(used) + " photos hang together", static_cast<double>(used), 4.0,
              "photos", "photos"};
  if (!out.empty()) check.text += "; rejected: " + list_of(out);
  if (used < 4) {
    check.state = State::care;
    check.text += "; with three little confirms the answer: add photos between and beyond them";
  } else if (2 * out.size() > used) {
    check.state = State::care;
  }
  return check;
}

Check minimum_check(const TurnedReport& report) {
  constexpr double care = 6.0;
  Check check{"one answer", State::good, "no other focal length explains the photos", report.other_sigmas, care,
              "σ",          "intrinsics"};
  if (!(report.other_focal_px > 0.0)) return check;
  check.text = "a focal length of " + text_of(report.other_focal_px, 4) + " px explains the photos less well by " +
               text_of(report.other_sigmas, 2) + "σ";
  if (report.other_sigmas < care) check.state = State::care;
  return check;
}

Check centre_check(const TurnedReport& report) {
  constexpr double most = 3.0;
  Check check{"fixed centre", State::good, "", 0.0, most, "σ", "intrinsics"};
  const Eigen::Vector2d off = report.camera.segment<2>(2) - report.free_centre_px;
  check.value = off.cwiseAbs().cwiseQuotient(report.sigma_free_centre_px).maxCoeff();
  check.text = "the photos put the centre at (" + text_of(report.free_centre_px.x(), 4) + ", " +
               text_of(report.free_centre_px.y(), 4) + ") px";
  if (check.value > most) {
    check.state = State::care;
    check.text += ", not where it is fixed: omit --fix-centre";
  }
  return check;
}

/// Nearly all cameras have square pixels; a rolling shutter during a tilt imitates other ones.
Check aspect_check(const TurnedReport& report, const TurnedConfig& config) {
  constexpr double most = 3.0, ordinary = 0.005;
  const double off = std::abs(report.free_aspect - 1.0);
  Check check{"square pixels", State::good, "", off / report.sigma_free_aspect, most, "σ", "intrinsics"};
  check.text = "the photos put fy / fx at " + text_of(report.free_aspect, 5) + " ± " +
               text_of(3.0 * report.sigma_free_aspect, 2) + " (3σ)";
  if (config.square_pixels) {
    if (check.value > most) {
      check.state = State::care;
      check.text += ": omit --square-pixels, unless the shutter reads row by row while the camera tilts";
    }
  } else if (off > ordinary && check.value > most) {
    check.state = State::care;
    check.text +=
        ": pixels that are not square, or a shutter that reads row by row while the camera tilts, which makes "
        "fy wrong by as much";
  }
  return check;
}

Check lens_check(const TurnedReport& report) {
  const double percent = 100.0 * std::abs(report.lens_departs);
  Check check{"lens", State::good, "", percent, 0.0, "%", "intrinsics"};
  check.text = "no radial term is needed beyond those that are estimated";
  if (percent > 0.0) {
    check.state = State::care;
    check.text = "the lens departs from its model, k1, k2 and k3 (a fisheye?): one term more changes fx by " +
                 text_of(percent, 2) +
                 " %; counted in σ: calibrate it on a board, with calibrate --model kannala_brandt";
  }
  return check;
}

/// Why there is no estimate, as a verdict; none if there is an estimate.
std::optional<Verdict> refusal_of(const TurnedReport& report, const MatchedPhotos& photos, const TurnedConfig& config) {
  switch (report.status) {
    case Status::too_few_photos:
      return refused(too_few(report, photos), ExitCode::undetermined);
    case Status::no_turn:
      return refused({"the camera does not turn between these photos", "rotate it by 10° or more from photo to photo"},
                     ExitCode::undetermined);
    case Status::zoomed:
      return refused(zoomed(report, photos), ExitCode::undetermined);
    case Status::moved:
      return refused(
          {"the photos agree two by two, but not with one camera that rotates on the spot: " +
               std::to_string(report.matches.kept) + " of " + std::to_string(report.matches.agreeing) + " matches",
           "rotate the camera about its lens instead of walking, or look at things farther away"},
          ExitCode::undetermined);
    case Status::weak:
      return refused(weak(report, photos, config), ExitCode::undetermined);
    case Status::no_convergence:
      return refused(
          {"no camera that rotates explains these matches", "check that the photos are of one camera and spot"},
          ExitCode::no_convergence);
    case Status::ok:
      return std::nullopt;
  }
  return std::nullopt;
}

}  // namespace

Verdict turned_verdict(const TurnedReport& report, const MatchedPhotos& photos, const TurnedConfig& config) {
  if (std::optional<Verdict> refusal = refusal_of(report, photos, config)) return *std::move(refusal);
  Verdict verdict;
  verdict.checks = {focal_check(report),
                    photos_check(report, photos),
                    kept_check(report),
                    agreement_check(report),
                    parallax_check(report, photos),
                    zoom_check(report, photos),
                    noise_check_of(report, photos),
                    lens_check(report),
                    minimum_check(report)};
  verdict.checks.insert(verdict.checks.begin(), aspect_check(report, config));
  if (config.fixed_centre) verdict.checks.insert(verdict.checks.begin(), centre_check(report));
  for (const Check& check : verdict.checks) {
    const bool speaks = check.state == State::care || check.state == State::bad;
    if (!speaks || check.state <= verdict.state) continue;
    verdict.state = check.state;
    verdict.to_add = check.text;
  }
  const Eigen::VectorXd sigma = report.cov.diagonal().cwiseSqrt();
  const auto used = std::ranges::count_if(report.photos, [](const RotatedPhoto& photo) { return photo.is_used; });
  verdict.sentence = "fx " + text_of(report.camera[0], 5) + " ± " + text_of(3.0 * sigma[0], 2) + " px, fy " +
                     text_of(report.camera[1], 5) + " ± " + text_of(3.0 * sigma[1], 2) + " px (3σ) from " +
                     std::to_string(used) + " photos";
  heed_assumptions(report.assumed, verdict);
  return verdict;
}

}  // namespace alidade
