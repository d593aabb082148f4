#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "alidade/files/descriptor.h"

namespace alidade {

/// Folders created here, from the outermost; on destruction those that are empty are removed.
class MadeFolders {
 public:
  MadeFolders() = default;
  MadeFolders(const MadeFolders&) = delete;
  MadeFolders& operator=(const MadeFolders&) = delete;
  ~MadeFolders();
  /// Creates the missing folders of a path. Throws InputError if one cannot be created.
  void make(const std::filesystem::path& folder);
  /// Removes the created folders that are empty.
  void remove_empty() noexcept;
  /// The folders that contain the created ones.
  [[nodiscard]] std::vector<std::filesystem::path> parents() const;

 private:
  /// False: `errno` gives the reason.
  [[nodiscard]] bool make_once(const std::filesystem::path& folder);

  std::vector<std::filesystem::path> made_;
};

/// Adds new files to a folder and removes old ones, all at once or not at all. New files are kept in a hidden folder
/// inside it (`.alidade-…`, on the same disk: renaming suffices) until commit(). Without commit(), on a full disk or
/// after any exception, the folder is unchanged, or absent if it was. A killed process leaves at most the hidden
/// folder; the next FolderSwap there removes it and undoes, or completes, an interrupted commit(). A power cut does no
/// more: new files are on the disk before an older one is moved, and all when commit() returns.
class FolderSwap {
 public:
  /// Creates the folder if it is missing, and checks that it can be written to: throws InputError if not.
  explicit FolderSwap(std::filesystem::path folder);
  FolderSwap(const FolderSwap&) = delete;
  FolderSwap& operator=(const FolderSwap&) = delete;

  /// Adds a new file, by its name inside the folder; it is written when this returns. If it cannot be written, throws
  /// InputError, and leaves nothing of it.
  void add(const std::filesystem::path& name, std::string_view content);
  /// Removes a file, if it exists and no new file replaces it.
  void remove(const std::filesystem::path& name);
  /// Moves everything into place, the file added first as the last one, with its older version removed first: a file
  /// that describes the others is never next to the wrong ones. Throws InputError after undoing everything.
  void commit();

 private:
  struct Move {
    std::filesystem::path from, to;
  };
  /// Removed with its owner, even if the owner's constructor throws.
  struct HiddenFolder {
    std::string path;
    ~HiddenFolder();
  };

  bool hide();
  void move(const std::filesystem::path& from, const std::filesystem::path& to);
  void set_aside(const std::filesystem::path& name);
  void undo() noexcept;
  void sync_new() const;
  void sync_places() const;

  std::filesystem::path folder_;
  MadeFolders made_;
  std::filesystem::path hidden_;
  std::optional<Descriptor> lock_;  ///< Lock of the hidden folder: its owner is alive.
  HiddenFolder hidden_folder_;
  std::vector<std::filesystem::path> added_, removed_;
  std::vector<Move> moves_;
};

}  // namespace alidade
