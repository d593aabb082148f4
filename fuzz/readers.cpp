#include "fuzz/readers.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <opencv2/core.hpp>
#include <sstream>
#include <vector>

#include "alidade/board/board_fields.h"
#include "alidade/files/config_file.h"
#include "alidade/files/csv.h"
#include "alidade/files/files.h"
#include "alidade/formats/beam_file.h"
#include "alidade/formats/camera_file.h"
#include "alidade/formats/intrinsics_file.h"
#include "alidade/formats/rig_file.h"
#include "alidade/heads/head_server.h"
#include "alidade/heads/protocols/indi_link.h"
#include "alidade/heads/protocols/onvif_protocol.h"
#include "alidade/heads/streams/frame_stream.h"
#include "alidade/images/exif.h"
#include "alidade/images/photos.h"
#include "alidade/live/protocol.h"
#include "alidade/results/calibration_result.h"
#include "alidade/results/fleet_text.h"
#include "alidade/results/observation_result.h"
#include "alidade/results/rangefinder_result.h"
#include "alidade/tables/corner_file.h"
#include "alidade/tables/events_file.h"
#include "alidade/tables/localize_file.h"
#include "alidade/tables/pairs_file.h"
#include "alidade/tables/rotation_log_file.h"
#include "alidade/tables/scan_file.h"
#include "alidade/tables/servo_log_file.h"
#include "alidade/tables/servo_scenario_file.h"
#include "alidade/tables/shots_file.h"
#include "alidade/tables/views_file.h"
#include "fuzz/memory_file.h"

namespace alidade::fuzz {
namespace {

/// What holds of every answer; where it does not, the fuzzer is to stop.
void must(bool holds, const char* what) {
  if (holds) return;
  std::fprintf(stderr, "does not hold: %s\n", what);
  std::abort();
}

void read_any_camera(std::string_view bytes) {
  const Camera camera = parse_camera(bytes, "fuzzed");
  const Eigen::VectorXd values = params(camera.lens);
  must(values.allFinite() && camera.width_px > 0 && camera.height_px > 0, "a camera's values are finite");
  const Camera again = parse_camera(camera_text(camera, CameraFormat::alidade), "written");
  must(params(again.lens) == values, "a camera that was read is written and read again as it is");
}

void read_camera_parts(std::string_view bytes) { (void)unread_parts(MemoryFile(bytes).path()); }

void read_any_rig(std::string_view bytes) {
  const Rig rig = read_rig(MemoryFile(bytes).path());
  const Rig again = read_rig(MemoryFile(rig_text(rig)).path());
  must(again.heads.size() == rig.heads.size(), "a rig that was read is written and read again");
}

void read_any_beam(std::string_view bytes) { (void)read_beam(MemoryFile(bytes).path()); }
void read_any_intrinsics_history(std::string_view bytes) { (void)read_intrinsics_history(MemoryFile(bytes).path()); }

void read_any_config(std::string_view bytes) {
  Board board;
  const FieldList fields = fields_of(board);
  (void)read_config(MemoryFile(bytes).path(), fields, [](const Field&) { return false; });
  must(faults_of(fields).empty(), "values of a config file are within their limits");
}

/// The whole file, and row by row as a stream: both refuse it, or both have the same rows.
void read_any_table(std::string_view bytes) {
  std::istringstream in{std::string(bytes)};
  CsvStream stream(in, "fuzzed");
  while (const auto row = stream.next())
    must(row->cells.size() == stream.header().size(), "rows are as long as the header");
}

constexpr int num_board_points = 54;

void read_corner_table(std::string_view bytes) {
  for (const BoardView& view : read_corners(MemoryFile(bytes).path(), num_board_points)) {
    for (const Corner& corner : view.corners) must(corner.px.allFinite(), "corners are finite");
  }
}

void read_board_table(std::string_view bytes) {
  for (const Eigen::Vector3d& point : read_board_points(MemoryFile(bytes).path(), num_board_points))
    must(point.allFinite(), "board points are finite");
}

void read_event_table(std::string_view bytes) {
  std::array<RigHead, 2> heads{};
  heads[0].head.id = 1;
  heads[1].head.id = 2;
  const MemoryFile file(bytes);
  for (const bool skip_bad : {false, true}) {
    for (const TargetObservation& each : read_events(file.path(), heads, {.skip_bad = skip_bad}).observations)
      must(each.px.allFinite(), "pixels of observations are finite");
  }
}

void read_observation_table(std::string_view bytes) {
  const MemoryFile file(bytes);
  for (const bool skip_bad : {false, true}) {
    const ObservationTable table =
        read_observations(file.path(), {.skip_bad = skip_bad, .width_px = 640, .height_px = 480});
    double last_s = -1e300;
    for (const ObservationFrame& frame : table.frames) {
      must(frame.t_s >= last_s, "frames stand in order of time");
      last_s = frame.t_s;
    }
  }
}

void read_any_target(std::string_view bytes) {
  for (const KnownPoint& point : read_target(MemoryFile(bytes).path()).points)
    must(point.point_in_world.allFinite(), "known points are finite");
}

void read_any_start(std::string_view bytes) { (void)read_start(MemoryFile(bytes).path()); }
void read_any_path(std::string_view bytes) { (void)read_tum(MemoryFile(bytes).path()); }
void read_pair_table(std::string_view bytes) { (void)read_pairs(MemoryFile(bytes).path(), true); }

void read_rotation_table(std::string_view bytes) {
  for (const bool skip_bad : {false, true}) {
    const RotationLogFile file = parse_rotation_log(std::string(bytes), "fuzzed", {.skip_bad = skip_bad});
    (void)rotation_log_csv(file.log);
  }
}

void read_scan_table(std::string_view bytes) { (void)read_scan(MemoryFile(bytes).path()); }
void read_servo_table(std::string_view bytes) { (void)read_servo_log(MemoryFile(bytes).path(), true); }
void read_scenario(std::string_view bytes) { (void)read_servo_scenario(MemoryFile(bytes).path()); }
void read_shot_table(std::string_view bytes) { (void)read_shots(MemoryFile(bytes).path(), {.skip_bad = true}); }

void read_view_table(std::string_view bytes) {
  (void)read_views(MemoryFile(bytes).path(), {.skip_bad = true, .num_points = num_board_points});
}

void read_photo(std::string_view bytes) {
  (void)exif_tags(bytes);
  must(!decode_photo(bytes).empty(), "a photo that is decoded has pixels");
}

void read_result(std::string_view bytes) {
  const MemoryFile file(bytes);
  const auto tried = [](const auto& read) {
    try {
      read();
    } catch (const InputError&) {
    }
  };
  tried([&] { (void)read_calibration(file.path()); });
  tried([&] { (void)read_observation(file.path()); });
  tried([&] { (void)read_rangefinder(file.path()); });
}

/// What a page or a program sends to the live server.
void read_live_message(std::string_view bytes) {
  (void)live::client_request(bytes);
  (void)live::chosen_subprotocol(bytes);
  (void)live::is_own_host(bytes, "127.0.0.1", 8765);
  (void)live::path_of(bytes);
  must(!live::has_token(bytes, "0123456789abcdef0123456789abcdef"), "no message guesses the token");
}

/// Commands of rotctl's clients to a simulated head: one answer a line, and angles that stay numbers.
void read_rotctl_commands(std::string_view bytes) {
  HeadPlant plant(SimulatedHeadConfig{}, 0.0);
  std::istringstream in{std::string(bytes)};
  double t_s = 0.0;
  for (std::string line; std::getline(in, line); t_s += 0.1) {
    if (!rotctl_answer(plant, line, t_s)) return;
    const Eigen::Vector2d at = plant.truth(t_s);
    const SimulatedHeadConfig& head = plant.config();
    must((at.array() > head.low_rad.array() - 0.1).all() && (at.array() < head.high_rad.array() + 0.1).all(),
         "a head stays within its limits");
  }
}

/// What ONVIF's clients send to a simulated camera: who is not known moves nothing.
void read_onvif_request(std::string_view bytes) {
  const auto asked = [&](const char* user) {
    HeadPlant plant(SimulatedHeadConfig{}, 0.0);
    OnvifCamera camera(plant, {.user = user, .password = "a password of 20 letters"});
    const OnvifCamera::Answer answer = camera.answer(std::string(bytes), 1.0);
    must(!answer.body.empty(), "every request is answered");
    must(answer.body.find("a password of 20") == std::string::npos, "no answer has the password in it");
    const Eigen::Vector2d at = plant.truth(30.0);
    must(at.allFinite() && (*user == '\0' || at.norm() == 0.0), "who is not known moves nothing");
  };
  asked("");
  asked("somebody");
}

/// An INDI server's messages, in one piece and in two: the same elements, none of them empty.
void read_indi_messages(std::string_view bytes) {
  const auto elements = [](std::initializer_list<std::string_view> parts) {
    XmlElements stream("fuzzed");
    std::vector<std::string> found;
    for (const std::string_view part : parts) {
      stream.push(part);
      for (std::string each = stream.next(); !each.empty(); each = stream.next()) found.push_back(each);
    }
    return found;
  };
  const auto whole = elements({bytes});
  must(elements({bytes.substr(0, bytes.size() / 2), bytes.substr(bytes.size() / 2)}) == whole,
       "elements do not depend on how they come");
  const double angle = sexagesimal(std::string(bytes));
  must(!std::isinf(angle), "an angle is a number, or none");
}

/// URLs of heads and streams: what is quoted of them has no password.
void read_head_url(std::string_view bytes) {
  const std::string url(bytes);
  must(without_password("rotctl://somebody:secret@" + url).find("secret") == std::string::npos,
       "no password is quoted");
  const auto tried = [](const auto& read) {
    try {
      read();
    } catch (const InputError&) {
    }
  };
  tried([&] { must(address_of("rotctl://" + url, "rotctl://", 4533).port != 0, "a port is a number"); });
  tried([&] { (void)simulated_head_config(url, "fuzzed"); });
  tried([&] { must(simulated_camera(url, "fuzzed").width_px > 0, "a camera has pixels"); });
}

/// What a camera of a fleet says, and a checkpoint: taken in, written and read again as it is.
void read_fleet_message(std::string_view bytes) {
  std::string fault;
  const auto row = parse_fleet_row(bytes, fault);
  must(row.has_value() || !fault.empty(), "what is refused has a reason");
  if (row) {
    FleetCamera camera;
    camera.n = row->n - 1;
    (void)advance(camera, *row, {.width_px = 640, .height_px = 480});
    must(camera.n == row->n, "a row is taken in");
    must(parse_checkpoint(checkpoint_text(camera)).has_value(), "a checkpoint is read again");
    (void)fleet_state_text("fuzzed", camera);
  }
  (void)parse_checkpoint(bytes);
}

constexpr std::array all_readers{
    Reader{"camera", read_any_camera},
    Reader{"camera_parts", read_camera_parts},
    Reader{"rig", read_any_rig},
    Reader{"beam", read_any_beam},
    Reader{"intrinsics_history", read_any_intrinsics_history},
    Reader{"config", read_any_config},
    Reader{"table", read_any_table},
    Reader{"corners", read_corner_table},
    Reader{"board_points", read_board_table},
    Reader{"events", read_event_table},
    Reader{"observations", read_observation_table},
    Reader{"target", read_any_target},
    Reader{"start", read_any_start},
    Reader{"path", read_any_path},
    Reader{"pairs", read_pair_table},
    Reader{"rotation_log", read_rotation_table},
    Reader{"scan", read_scan_table},
    Reader{"servo_log", read_servo_table},
    Reader{"scenario", read_scenario},
    Reader{"shots", read_shot_table},
    Reader{"views", read_view_table},
    Reader{"photo", read_photo},
    Reader{"result", read_result},
    Reader{"live_message", read_live_message},
    Reader{"rotctl", read_rotctl_commands},
    Reader{"onvif", read_onvif_request},
    Reader{"indi", read_indi_messages},
    Reader{"head_url", read_head_url},
    Reader{"fleet", read_fleet_message},
};

}  // namespace

std::span<const Reader> readers() { return all_readers; }

const Reader* reader_named(std::string_view name) {
  const auto* const found = std::find_if(all_readers.begin(), all_readers.end(),
                                         [name](const Reader& reader) { return reader.name == name; });
  return found == all_readers.end() ? nullptr : found;
}

void try_reader(const Reader& reader, std::string_view bytes) {
  try {
    reader.read(bytes);
  } catch (const InputError&) {
    // the one line that users get
  }
}

}  // namespace alidade::fuzz
