#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "alidade/estimation/counts.h"
#include "alidade/pantilt/head.h"
#include "alidade/public.h"
#include "alidade/track/track_report.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

struct EventsFile {
  std::vector<TargetObservation> observations;  ///< In the order of the file, which is that of arrival.
  std::vector<SkippedInput> skipped;
};

struct EventsOptions {
  bool skip_bad = false;  ///< Rows that are wrong are skipped and listed.
  /// Fixed cameras, each with its own clock: `pan_rad,tilt_rad` may be omitted (zero) but may not change, and times
  /// must increase for each head separately only.
  bool stands_still = false;
};

/// The ids in column `head`, in ascending order.
[[nodiscard]] std::vector<int> heads_in_events(const std::filesystem::path& file, bool skip_bad = false);

/// Reads `t_capture_s,t_arrival_s,head,pan_rad,tilt_rad,u_px,v_px`. `head` is an id of the rig; angles are those at
/// capture (also `pan_rad_at_capture`); `t_arrival_s` may be omitted. Instead of the pixel, `du_px,dv_px` give offsets
/// from the principal point; an optional column `sigma_px` gives each row's own σ. Throws InputError for a missing
/// column, a head that is not in the rig, arrival before capture, arrival times that run backwards, angles in
/// `pan_deg`, or no rows.
[[nodiscard]] EventsFile read_events(const std::filesystem::path& file, std::span<const RigHead> heads,
                                     const EventsOptions& options = {});

/// Text of such a file; it has a column `sigma_px` if an observation has a σ.
[[nodiscard]] std::string events_csv(std::span<const TargetObservation> observations, std::span<const RigHead> heads);

/// Reads `t_s,x_m,y_m,z_m`, in order of time.
[[nodiscard]] TrueTrack read_true_track(const std::filesystem::path& file);
[[nodiscard]] std::string true_track_csv(const TrueTrack& truth);

/// Text of track.csv: `t_s,x_m,y_m,z_m,vx_m_s,vy_m_s,vz_m_s,sigma_x_m,sigma_y_m,sigma_z_m,nis,event`, one row per
/// observation; `ahead` (one per observation, or none) adds rows with the event `predicted`.
[[nodiscard]] std::string track_csv(std::span<const TrackStep> steps, std::span<const PredictedStep> ahead = {});

/// Text of smoothed.csv: `t_s,x_m,y_m,z_m,vx_m_s,vy_m_s,vz_m_s,sigma_x_m,sigma_y_m,sigma_z_m`.
[[nodiscard]] std::string smoothed_csv(std::span<const PredictedStep> smoothed);

ALIDADE_PUBLIC_END
}  // namespace alidade
