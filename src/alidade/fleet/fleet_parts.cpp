#include "alidade/fleet/fleet_parts.h"

#include <cstdint>

namespace alidade {

int fleet_part_of(std::string_view camera) {
  std::uint64_t hash = 14695981039346656037U;  // FNV-1a
  for (const char c : camera) hash = (hash ^ static_cast<unsigned char>(c)) * 1099511628211U;
  hash = (hash ^ (hash >> 30U)) * 0xbf58476d1ce4e5b9U;
  hash = (hash ^ (hash >> 27U)) * 0x94d049bb133111ebU;
  hash ^= hash >> 31U;
  return static_cast<int>(hash % num_fleet_parts);
}

}  // namespace alidade
