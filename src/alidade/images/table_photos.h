#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "alidade/estimation/counts.h"
#include "alidade/imaging/photos.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// The photos that a table names, relative to its folder. Many threads may load them; copies share what was read.
class TablePhotos {
 public:
  /// `table` is the table's file. `roles`: the roles, by name, of photos that are not a "photo".
  explicit TablePhotos(const std::filesystem::path& table, std::map<std::string, std::string> roles = {});

  /// Loads a photo by its name; throws InputError if it cannot be read.
  [[nodiscard]] PhotoByName loader() const;
  /// The photos that were read: role, name, size, checksum.
  [[nodiscard]] std::vector<InputFile> inputs() const;

 private:
  struct Held;
  std::shared_ptr<Held> state_;
};

ALIDADE_PUBLIC_END
}  // namespace alidade
