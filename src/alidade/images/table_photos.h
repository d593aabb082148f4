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

/// The photos that a table names, relative to its folder. May be loaded from many threads; copies share what was read.
class TablePhotos {
 public:
  /// Of the table of that name. `roles`: what photos are, by name, that are no "photo".
  explicit TablePhotos(const std::filesystem::path& table, std::map<std::string, std::string> roles = {});

  /// What it gives throws InputError where a photo cannot be read.
  [[nodiscard]] PhotoByName loader() const;
  /// Those that were read: role, name, size, checksum.
  [[nodiscard]] std::vector<InputFile> inputs() const;

 private:
  struct Held;
  std::shared_ptr<Held> state_;
};

ALIDADE_PUBLIC_END
}  // namespace alidade
