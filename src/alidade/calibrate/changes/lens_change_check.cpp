#include "alidade/calibrate/changes/lens_change.h"

// What the verdict says of a lens that changes.

namespace alidade {
namespace {

using Profile = LensChange::Profile;
constexpr double care_sigmas = 2.0;

std::string sized(const LensChange& change, double value) {
  return change.what == LensChange::focal_length ? text_of(100.0 * value, 2) : text_of(value, 2);
}

std::string course_text(const LensChange& change, std::span<const std::string> photos) {
  const std::string by = sized(change, change.size) + " ± " + sized(change, 3.0 * change.sigma) +
                         (change.what == LensChange::focal_length ? " %" : " px");
  switch (change.profile) {
    case Profile::drift:
      return change.what + " drifts by " + by + " from the first photo to the last: its mean is stated";
    case Profile::jump:
      return change.what + " jumps by " + by + " before " + photos[change.at] + ": its mean is stated";
    default:
      return change.what + " follows the board's distance, by " + by + " from " + text_of(change.farthest_m, 2) +
             " m to " + text_of(change.nearest_m, 2) +
             " m, as where an autofocus is on: that of the photos' mean distance is stated";
  }
}

Check check_of(const LensChangeStudy& study, std::span<const std::string> photos) {
  Check check{.name = "same lens", .limit = care_sigmas, .unit = "σ", .figure = "photos"};
  if (!study.change && !study.seen_from) {
    check.text = "too few photos determine the focal length to see whether it changes over them";
    return check;
  }
  if (!study.change) {
    check.text = "no change over the photos, in their order; the focal length is that of their mean, and a drift by " +
                 text_of(100.0 * *study.seen_from, 2) + " % would be seen";
    if (study.seen_by_distance)
      check.text +=
          ", from the farthest board to the nearest one by " + text_of(100.0 * *study.seen_by_distance, 2) + " %";
    return check;
  }
  const LensChange& change = *study.change;
  check.value = change.moves;
  check.state = change.is_proved && change.moves > care_sigmas ? State::care : State::good;
  check.text = course_text(change, photos) + (change.is_proved ? ", and σ includes the change" : "");
  if (!change.is_proved) check.text = "not proved, but what of it is beyond chance is included in σ: " + check.text;
  return check;
}

}  // namespace

void heed_change(const LensChangeStudy& study, std::span<const std::string> photos, Verdict& verdict) {
  const Check check = check_of(study, photos);
  std::string remedy = "fix lens, focus and zoom, and calibrate the photos before and after it apart";
  if (study.change && study.change->profile == Profile::drift)
    remedy = "fix focus and zoom, let the camera warm up, and take the photos in the state in which it is used";
  if (study.change && study.change->profile == Profile::distance)
    remedy =
        "switch the autofocus off, fix the focus for the distances at which the camera is used, and take the photos "
        "again";
  const bool was_good = verdict.state == State::good;
  heed(check, remedy, verdict);
  const bool explains = study.change && study.change->profile == Profile::distance && verdict.state != State::good;
  if (explains && check.state == State::good) verdict.sentence += "; " + check.text;
  if (check.state != State::care || was_good) return;
  verdict.sentence += "; " + check.text;  // which explains why photos disagree, and more of them would be no help
  verdict.to_add = remedy;
}

}  // namespace alidade
