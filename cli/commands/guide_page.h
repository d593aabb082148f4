#pragma once

#include <Eigen/Core>
#include <initializer_list>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "alidade/live/capture/capture_server.h"
#include "alidade/live/capture/kept_photos.h"
#include "cli/app/live.h"
#include "cli/app/run.h"

namespace alidade::live {
struct LiveFrame;
class GrowingFolder;
class NewestFrame;
}  // namespace alidade::live
namespace cv {
class Mat;
}

namespace alidade::cli {

/// Where images come from, if not from the browser: one of the two, or none.
struct ImageSource {
  std::shared_ptr<live::GrowingFolder> folder;
  std::shared_ptr<live::NewestFrame> stream;
};
/// `from`: a folder that fills, or a stream's address; empty: the browser. Throws InputError where nothing is there.
[[nodiscard]] ImageSource opened_source(const std::string& from);

/// A frame's values, in memory of its own.
[[nodiscard]] cv::Mat grey_of(const live::LiveFrame& frame);

/// --live [PORT] and --live-address of a command that guides by a page.
void add_guide_options(CLI::App& command, LiveOptions& live, const std::string& help, const std::string& group);

/// Options that say something only with --live: what of them was given without it. Throws UsageError, which names the
/// first.
void require_no_guide(const LiveOptions& live, std::initializer_list<std::pair<const char*, bool>> given);

class GuidePage;

/// What is measured while a page guides: it gets images, and does what the user asks for.
class GuidedWork {
 public:
  virtual ~GuidedWork() = default;
  /// Of the page: what it shows, as JSON. The source of the images is added.
  [[nodiscard]] virtual std::string about() const = 0;
  [[nodiscard]] virtual double begin_s() const = 0;  ///< Time at which it goes on; 0 for a new one.
  [[nodiscard]] virtual bool has_goal() const = 0;
  /// An image, 8-bit grey, at that time.
  virtual void see(const cv::Mat& grey, double t_s, bool is_exact, GuidePage& page) = 0;
  /// No new image comes, of a folder.
  virtual void wait(double t_s, GuidePage& page) {
    (void)t_s;
    (void)page;
  }
  /// "take", "undo" …; the image is the newest, if there is one.
  virtual void obey(const live::PageCommand& command, const cv::Mat& newest, double t_s, bool is_exact,
                    GuidePage& page) = 0;
  /// To the page: how far it is.
  virtual void tell_state(GuidePage& page) = 0;
};

/// The page of a guided measurement: the browser's camera, a folder or a stream, watched and steered in a browser. In
/// the end it becomes the report.
class GuidePage {
 public:
  /// Listens, and prints the address. Throws InputError where it cannot.
  GuidePage(const LiveOptions& options, ImageSource source, GuidedWork& work, Run& run);
  ~GuidePage();
  GuidePage(const GuidePage&) = delete;
  GuidePage& operator=(const GuidePage&) = delete;

  /// Until the work is at its goal or the user ends it.
  void guide();
  void end();
  /// A message for all who look, as JSON; one of each kind is kept for who comes later.
  void tell(const std::string& json, const std::string& kind = "");
  /// A printed line.
  void note(const std::string& line);
  /// The page becomes the report.
  void show_result(ExitCode code);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// Pixels to a hundredth, u and v alternating: "[1.25,3,…]".
[[nodiscard]] std::string flat_pixels(const std::vector<Eigen::Vector2d>& pixels);

/// Throws Interrupted after a signal that asks the process to end (not after Ctrl-C, which ends the capture): photos
/// that stand on the disk are named.
void throw_if_terminated(const live::KeptPhotos& kept);

}  // namespace alidade::cli
