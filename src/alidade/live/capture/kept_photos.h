#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace cv {
class Mat;
}

namespace alidade::live {

/// A photo of a capture that stands on disk.
struct KeptPhoto {
  std::string file;       ///< "000001.png", in `photos`.
  double t_s = 0.0;       ///< Since the capture began.
  bool is_exact = false;  ///< Every pixel as the camera gave it.
};

/// The photos of a capture: FOLDER/photos/000001.png, 8-bit grey, and FOLDER/photos.csv (file, t_s, exact). Each is
/// whole on the disk when add() returns; a number is never given to another photo.
class KeptPhotos {
 public:
  /// `goes_on`: those of an earlier capture stay. Throws InputError where the folder cannot be written, where there
  /// are photos and it does not go on, or none and it does.
  KeptPhotos(std::filesystem::path folder, bool goes_on);

  [[nodiscard]] const std::vector<KeptPhoto>& photos() const { return photos_; }
  [[nodiscard]] std::filesystem::path folder() const { return folder_ / "photos"; }
  [[nodiscard]] std::filesystem::path path_of(const KeptPhoto& photo) const { return folder() / photo.file; }
  /// Throws InputError where it cannot be written.
  const KeptPhoto& add(const cv::Mat& grey, double t_s, bool is_exact);
  /// The last one goes. False where there is none.
  bool undo();

 private:
  void write_table() const;
  [[nodiscard]] std::filesystem::path forgotten_file() const { return folder_ / ".last_number"; }

  std::filesystem::path folder_;
  std::vector<KeptPhoto> photos_;
  int last_number_ = 0;
};

}  // namespace alidade::live
