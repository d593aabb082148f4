#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <atomic>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <future>
#include <memory>

#include "alidade/detect/target_look.h"
#include "alidade/files/files.h"
#include "alidade/files/folder_swap.h"
#include "alidade/formats/rig_file.h"
#include "alidade/geometry/degree.h"
#include "alidade/heads/head_follow.h"
#include "alidade/heads/head_identify.h"
#include "alidade/results/head_outcome.h"
#include "alidade/results/identified_result.h"
#include "alidade/tables/rotation_log_file.h"
#include "cli/app/app.h"
#include "cli/app/board_options.h"
#include "cli/app/live.h"
#include "cli/app/terminal.h"
#include "cli/commands/camera_values.h"
#include "cli/commands/commands.h"
#include "cli/commands/head_live.h"

namespace alidade::cli {
namespace {

struct HeadArgs {
  std::string url;
  bool identify = false, calibrate = false, move = false;
  std::string stream;
  HeadRange range;
  std::optional<double> until;
  double max_s = 85.0;
  std::string rig, resume, password_file, identified;
  std::optional<double> latency_s;
  NamedLook look;
  Board board = no_board();
  HeadFollowConfig follow;
  LiveOptions live;
};

/// "0.5%", or a share.
TextCode share_code(std::optional<double>& share) {
  TextCode code;
  code.read = [&share](const std::string& text) -> std::string {
    char* end = nullptr;
    const double value = std::strtod(text.c_str(), &end);
    const std::string unit = end;
    const double number = unit == "%" ? 0.01 * value : value;
    if (end == text.c_str() || (!unit.empty() && unit != "%") || !(number > 0.0 && number < 1.0))
      return "'" + text + "' is no share: give 0.5%";
    share = number;
    return "";
  };
  code.write = [&share] { return share ? fmt::format("{:g}%", 100.0 * *share) : std::string(); };
  return code;
}

/// "LOW,HIGH" in degrees.
TextCode range_code(HeadRange& range, int axis) {
  return numbers_code(
      2,
      [&range, axis]() -> std::vector<double> {
        if (range.low_rad[axis] < -1e8) return {};
        return {range.low_rad[axis] / degree, range.high_rad[axis] / degree};
      },
      [&range, axis](const std::vector<double>& numbers) {
        range.low_rad[axis] = numbers[0] * degree;
        range.high_rad[axis] = numbers[1] * degree;
      });
}

/// What the target looks like, by the name of what is done with it.
Field follow_field(NamedLook& look) {
  Field field = look_field(look);
  field.name = "follow";
  field.option = "--follow";
  field.help = "Follow a target with this appearance: " + field.help.substr(field.help.find("colour:"));
  field.group.clear();
  field.old_options.clear();
  return field;
}

/// What is done with the head, and from what.
FieldList job_fields(HeadArgs& args) {
  return {
      {.name = "move", .value = &args.move, .help = "Allow the head to move; without this option nothing moves"},
      {.name = "identify",
       .value = &args.identify,
       .help = "Identify its dynamics: rate, acceleration, time constant, latency, backlash, dead band, repeatability"},
      {.name = "calibrate",
       .value = &args.calibrate,
       .help = "Calibrate its camera by planned moves: lens, mounting, delay"},
      {.name = "stream",
       .value = &args.stream,
       .help = "Video of its camera: http://HOST:PORT/PATH (motion JPEG), rtsp://…, v4l2:/dev/video0, onvif://… (asked "
               "for its stream address), indi://HOST:PORT/CAMERA, or sim:// for a simulated head",
       .form = "URL"},
      {.name = "until",
       .value = share_code(args.until),
       .help = "Stop when 3σ of fx and of fy is below this percentage of the value; exit code 4 if not reached "
               "(default: run for the usual time)",
       .form = "SHARE%"},
      {.name = "most_s",
       .value = &args.max_s,
       .help = "Maximum duration of --calibrate or --follow [s]",
       .limits = {5.0, 86400.0}},
      {.name = "resume",
       .value = &args.resume,
       .help = "For --calibrate: also use the measurements of an earlier, possibly interrupted, run in DIR",
       .form = "DIR"},
      {.name = "password_file",
       .value = &args.password_file,
       .help = "File whose first line is the password of the user in the URLs (default: environment variable "
               "ALIDADE_PASSWORD)",
       .form = "FILE"},
  };
}

FieldList follow_fields(HeadArgs& args) {
  return {
      follow_field(args.look),
      {.name = "rig", .value = &args.rig, .help = "For --follow: rig.yaml written by --calibrate", .form = "FILE"},
      {.name = "identified",
       .value = &args.identified,
       .help = "For --follow: result folder of --identify; its rate, time constant, latency and resolution are used",
       .form = "DIR"},
      {.name = "latency_s",
       .value = &args.latency_s,
       .help = "For --follow without --identified: latency from a command to its first effect [s] (default: 0.05)",
       .limits = {0.0, 2.0}},
      {.name = "delay_s",
       .value = &args.follow.delay_s,
       .help = "For --follow: delay of the angles relative to a frame's time, as estimated by --calibrate [s]",
       .limits = {-2.0, 2.0}},
  };
}

FieldList range_fields(HeadArgs& args) {
  return {{.name = "pan_range",
           .value = range_code(args.range, 0),
           .help = "Allowed pan angles, in degrees, positive to the left (default: the head's own limits)",
           .form = "LOW,HIGH"},
          {.name = "tilt_range",
           .value = range_code(args.range, 1),
           .help = "Allowed tilt angles, in degrees, positive upwards (default: the head's own limits)",
           .form = "LOW,HIGH"}};
}

FieldList fields_of(HeadArgs& args) {
  FieldList fields = job_fields(args);
  for (const FieldList& more : {follow_fields(args), range_fields(args)})
    fields.insert(fields.end(), more.begin(), more.end());
  return fields;
}

void check_head(const HeadArgs& args) {
  const bool follows = !args.look.text.empty();
  if (args.identify + args.calibrate + follows > 1)
    throw UsageError("give one of --identify, --calibrate and --follow");
  if (follows && (args.stream.empty() || args.rig.empty()))
    throw UsageError("--follow needs --stream URL and --rig FILE");
  if (follows && !args.move) throw UsageError("--follow moves the head: give --move as well");
  if (!follows && !args.rig.empty()) throw UsageError("--rig is for --follow");
  if (!follows && args.live.is_on) throw UsageError("--live is for --follow");
  if (!follows && !args.identified.empty()) throw UsageError("--identified is for --follow");
  if (args.calibrate && args.stream.empty()) throw UsageError("--calibrate needs the camera: --stream URL");
  if (args.calibrate && !args.move) throw UsageError("--calibrate moves the head: give --move as well");
  if (!args.calibrate && !args.resume.empty()) throw UsageError("--resume is for --calibrate");
  if (!args.calibrate && is_given(args.board)) throw UsageError("--board is for --calibrate");
  if (!args.calibrate && args.until) throw UsageError("--until is for --calibrate");
  if (!args.calibrate && !follows && !args.stream.empty()) throw UsageError("--stream is for --calibrate and --follow");
  if (args.identify && !args.move) throw UsageError("--identify moves the head: give --move as well");
  if (!(args.range.low_rad.array() <= args.range.high_rad.array()).all())
    throw UsageError("--pan-range and --tilt-range are LOW,HIGH with LOW not above HIGH");
}

/// From a file or the environment, where nobody else reads it.
HeadOptions options_of(const HeadArgs& args) {
  HeadOptions options;
  if (!args.password_file.empty()) {
    options.password = read_file(args.password_file);
    options.password = options.password.substr(0, options.password.find_first_of("\r\n"));
    if (options.password.empty()) throw InputError(args.password_file + ": its first line is empty");
  } else if (const char* given = std::getenv("ALIDADE_PASSWORD"); given != nullptr) {
    options.password = given;
  }
  return options;
}

/// What is known so far, in DIR/so-far, whole at any time.
class SoFar {
 public:
  explicit SoFar(std::filesystem::path out) : folder_(std::move(out) / "so-far") {}
  void write(const std::vector<NamedBytes>& files) {
    FolderSwap swap(folder_);
    for (const NamedBytes& file : files) swap.add(file.name, file.bytes);
    swap.commit();
    is_written_ = true;
  }
  /// The same on a thread of its own, for who must not wait for a disk; skipped while the last one is at work.
  void write_beside(std::vector<NamedBytes> files) {
    if (writing_.valid() && writing_.wait_for(std::chrono::seconds(0)) != std::future_status::ready) return;
    if (writing_.valid()) writing_.get();
    writing_ = std::async(std::launch::async, [this, files = std::move(files)] { write(files); });
  }
  [[nodiscard]] bool is_written() const { return is_written_; }
  [[nodiscard]] std::string place() const { return folder_.string(); }
  void remove() {
    if (writing_.valid()) writing_.wait();
    std::error_code error;
    std::filesystem::remove_all(folder_, error);
  }

 private:
  std::filesystem::path folder_;
  std::atomic<bool> is_written_ = false;
  std::future<void> writing_;  // last: it uses the others
};

/// Where a run was killed while it replaced these files, they wait in a hidden folder.
void end_killed_exchange(const std::filesystem::path& folder) {
  std::error_code error;
  if (!std::filesystem::is_directory(folder, error)) return;
  try {
    const FolderSwap next(folder);
  } catch (const InputError&) {  // a folder that cannot be written: what stands there is read
  }
}

/// log.csv that an earlier run left, or was on its way to.
std::optional<RotationLog> log_to_resume(const std::string& folder, Run& run) {
  if (folder.empty()) return std::nullopt;
  const std::filesystem::path dir = folder;
  std::error_code error;
  end_killed_exchange(dir / "so-far");
  std::filesystem::path file = dir / "so-far" / "log.csv";  // is there only where the run did not end
  if (!std::filesystem::exists(file, error)) file = dir / "log.csv";
  run.add_input("log", file);
  return read_rotation_log(file).log;
}

/// What counts become angles by, where nobody gave it, goes with every answer: all angles, and focal lengths with them,
/// are in its proportion.
void say_assumed(const HeadLimits& limits, JobOutcome& outcome) {
  if (limits.assumed.empty()) return;
  std::string text;
  for (const Assumption& each : limits.assumed) {
    text += (text.empty() ? "" : " and ") + fmt::format("{} of {:g}°", each.name, each.value);
    outcome.document.assumed.push_back(each);
  }
  text += " are supposed, by which its counts become angles: give az=LOW:HIGH and el=LOW:HIGH in the address";
  Verdict& verdict = outcome.document.verdict;
  verdict.checks.push_back({.name = "angles of the address", .state = State::care, .text = text});
  outcome.lines.push_back(text);
  if (verdict.state == State::good) verdict.state = State::care;
}

ExitCode calibrate_by_head(HeadArgs& args, HeadDevice& device, Run& run) {
  SoFar so_far(run.options.out);
  HeadCalibrationConfig config{.range = args.range, .until = args.until, .max_s = args.max_s};
  if (is_given(args.board)) {
    require_board(args.board);
    config.board = args.board;
  }
  config.before = log_to_resume(args.resume, run);
  config.on_so_far = [&so_far](const HeadCalibration& calibration) { so_far.write(files_so_far(calibration)); };
  const std::unique_ptr<FrameStream> stream = open_stream(args.stream, device, options_of(args));
  try {
    const HeadLimits limits = device.limits();
    JobOutcome outcome = outcome_of(calibrate_head(device, *stream, config, run.progress));
    say_assumed(limits, outcome);
    run.lap("calibrate");
    const bool tells = has_estimate(outcome.document.verdict);
    const ExitCode code = run.finish(std::move(outcome));
    if (tells) so_far.remove();
    return code;
  } catch (const Interrupted&) {
    if (!so_far.is_written()) throw;
    throw Interrupted(fmt::format("interrupted; the head is stopped; what was measured is in {}: --resume {}",
                                  so_far.place(), run.options.out.string()));
  }
}

/// The axes by which a head is followed with.
void take_identified(const HeadArgs& args, HeadFollowConfig& config, Run& run) {
  if (!args.identified.empty()) {
    const std::filesystem::path given = args.identified;
    run.add_input("identified", std::filesystem::is_directory(given) ? given / "result.json" : given);
    const IdentifiedHead head = read_identified_head(args.identified, usual_axis);
    config.axes = head.axes;
    if (head.resolution_rad > 0.0) config.resolution_rad = head.resolution_rad;
  }
  if (!args.latency_s) return;
  for (PositionerParams& axis : config.axes) axis.latency_s = *args.latency_s;
}

ExitCode follow_by_head(HeadArgs& args, HeadDevice& device, Run& run) {
  LiveRun live(args.live, run);
  const Rig rig = read_rig(args.rig);
  add_rig_input(run, args.rig);
  add_rig_doubts(run, rig);
  if (rig.heads.size() != 1) throw InputError(args.rig + ": one head is followed with; this rig has another number");
  load_look(args.look);
  const std::unique_ptr<FrameStream> stream = open_stream(args.stream, device, options_of(args));
  HeadFollowConfig config = args.follow;
  take_identified(args, config, run);
  config.range = args.range;
  config.max_s = args.max_s;
  const HeadLimits limits = device.limits();
  const Camera& camera = rig.heads.front().camera;
  live.open(FollowShow::topics(), "/head");
  FollowShow show;
  if (live.server() != nullptr) {
    FollowShow::begin(*live.server(), camera);
    config.on_frame = [&](const FollowedFrame& frame, const cv::Mat& image) {
      show.show(*live.server(), camera, frame, image);
    };
  }
  SoFar so_far(run.options.out);
  config.on_so_far = [&so_far](const HeadFollowing& following) { so_far.write_beside(files_so_far(following)); };
  const HeadFollowing following = follow_target(device, *stream, rig.heads.front(), args.look.look,
                                                args.look.pattern.get(), config, live.progress());
  const int signal = interrupting_signal();
  forget_interrupt();  // what was followed until then is a result, only a shorter one
  JobOutcome outcome = outcome_of(following);
  say_assumed(limits, outcome);
  run.lap("follow");
  const ExitCode code = live.finish(std::move(outcome));
  so_far.remove();
  if (!following.is_interrupted) return code;
  std::raise(signal);
  throw Interrupted(fmt::format("interrupted; the head is stopped; the {:.1f} s until then are in {}",
                                following.head_time_s, run.options.out.string()));
}

ExitCode work_head(HeadArgs& args, Run& run) {
  const std::unique_ptr<HeadDevice> device = open_head(args.url, options_of(args));
  run.lap("connect");
  if (!args.look.text.empty()) return follow_by_head(args, *device, run);
  if (args.calibrate) return calibrate_by_head(args, *device, run);
  const HeadLimits limits = device->limits();
  JobOutcome outcome = args.identify ? outcome_of(identify_head(*device, args.range, run.progress))
                                     : outcome_of(survey_head(*device, args.move, args.range, run.progress));
  say_assumed(limits, outcome);
  run.lap(args.identify ? "identify" : "ask");
  return run.finish(std::move(outcome));
}

ExitCode run_head(HeadArgs& args, Run& run) {
  check_head(args);
  try {
    return work_head(args, run);
  } catch (const Interrupted& end) {
    if (!args.move || std::string_view(end.what()) != Interrupted().what()) throw;
    throw Interrupted("interrupted; the head is stopped; nothing written");
  } catch (const InputError& error) {  // what fails after Ctrl-C was asked to end
    if (interrupting_signal() == 0) throw;
    throw Interrupted(std::string("interrupted; ") + error.what());
  }
}

}  // namespace

void add_head(App& app) {
  auto args = std::make_shared<HeadArgs>();
  CLI::App& command = app.add_command(
      {.name = "head",
       .summary = "Query, identify and calibrate a connected pan-tilt head and its camera, or follow a target with it",
       .examples =
           "alidade head rotctl://127.0.0.1:4533\n"
           "alidade head rotctl://127.0.0.1:4533 --identify --move --pan-range -60,60 --tilt-range 0,60\n"
           "alidade head 'onvif://admin@192.168.1.64/?az=-180:180&el=-20:90' --password-file secret.txt\n"
           "alidade head 'sim://?seed=3' --identify --move\n"
           "alidade head rotctl://127.0.0.1:4533 --stream http://127.0.0.1:8090/stream.mjpg --calibrate --move\n"
           "alidade head rotctl://127.0.0.1:4533 --stream http://127.0.0.1:8090/stream.mjpg --rig "
           "alidade-out/head/rig.yaml "
           "--follow bright --move\n"},
      [args](Run& run) { return run_head(*args, run); });
  command
      .add_option("url", args->url,
                  "rotctl://HOST:PORT (Hamlib's rotctld), onvif://USER@HOST:PORT (a network camera), "
                  "indi://HOST:PORT/DEVICE (a telescope mount), or sim://?seed=N, a simulated one")
      ->required();
  app.add_fields(command, fields_of(*args));
  add_board_options(command, args->board, false);
  add_live_options(command, args->live, false);
}

}  // namespace alidade::cli
