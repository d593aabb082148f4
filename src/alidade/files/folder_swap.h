#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "alidade/files/descriptor.h"

namespace alidade {

/// Folders made here, from the outermost; removed again as long as they are empty.
class MadeFolders {
 public:
  MadeFolders() = default;
  MadeFolders(const MadeFolders&) = delete;
  MadeFolders& operator=(const MadeFolders&) = delete;
  ~MadeFolders();
  /// Makes what is missing of the path. Throws InputError if it cannot be made.
  void make(const std::filesystem::path& folder);
  /// What was made and is empty goes.
  void remove_empty() noexcept;
  /// The folders that list what was made.
  [[nodiscard]] std::vector<std::filesystem::path> parents() const;

 private:
  /// False: `errno` says why not.
  [[nodiscard]] bool make_once(const std::filesystem::path& folder);

  std::vector<std::filesystem::path> made_;
};

/// New files of a folder, and old ones that go: all at once, or nothing at all. What is new waits in a hidden folder
/// inside it (`.alidade-…`: the same disk, so that a rename is enough) until commit(). Without commit(), on a full disk
/// or after any exception, the folder is as it was, and is not there if it was not. A killed process leaves at worst
/// the hidden folder; the next FolderSwap there clears it, and undoes, or ends, a commit() that was cut in two. A power
/// cut does no more: what is new is on the disk before anything older moves, and all of it when commit() returns.
class FolderSwap {
 public:
  /// Makes the folder where it is missing, and finds out that it can be written: throws InputError if not.
  explicit FolderSwap(std::filesystem::path folder);
  FolderSwap(const FolderSwap&) = delete;
  FolderSwap& operator=(const FolderSwap&) = delete;

  /// A new file, by its name inside the folder, written when this returns. Throws InputError, and leaves
  /// nothing of it, if it cannot be written.
  void add(const std::filesystem::path& name, std::string_view content);
  /// A file that goes, if it is there and nothing new takes its place.
  void remove(const std::filesystem::path& name);
  /// Moves everything into place; the file that was added first comes last, and its older version is removed first: a
  /// file that describes the others is never beside the wrong ones. Throws InputError after undoing it all.
  void commit();

 private:
  struct Move {
    std::filesystem::path from, to;
  };
  /// Goes with its owner, also where the owner's constructor throws.
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
  std::optional<Descriptor> lock_;  ///< Of the hidden folder: its owner lives.
  HiddenFolder hidden_folder_;
  std::vector<std::filesystem::path> added_, removed_;
  std::vector<Move> moves_;
};

}  // namespace alidade
