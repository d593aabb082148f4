#pragma once

#include <string>

#include "alidade/fleet/fleet_camera.h"
#include "alidade/fleet/fleet_model.h"

namespace alidade {

/// A kept row's rotation: pan, tilt, roll [rad] of a head as they came, else the quaternion (wxyz).
[[nodiscard]] FleetRotation kept_rotation(FleetSource source, const float* kept);

/// Notes in `camera.misread` how the rotation of the kept rows, which determine no camera, was misread: signs, axes,
/// units, exchanged pixels, by whichever reading explains the pixels (as observe seeks it); or that none does although
/// the camera turned about both axes.
void seek_misreading(FleetCamera& camera, const FleetConfig& config);
/// Its angles or rates are too large for radians.
void note_degrees(FleetCamera& camera);
/// What is said of a camera that the rows so far do not determine.
[[nodiscard]] std::string undetermined_sentence(const FleetCamera& camera);

/// Notes how far the principal point is from the image centre, where that is beyond 10 % and 5 σ, as in observe.
void note_centre(FleetCamera& camera, const FleetConfig& config);
/// "cx is 50 % of the width from the image centre: …"; empty: it is near.
[[nodiscard]] std::string centre_sentence(const FleetCamera& camera);

}  // namespace alidade
