#include "alidade/pantilt/rig.h"

namespace alidade {

std::vector<std::string> parameter_names(const Rig& rig) {
  std::vector<std::string> names;
  for (const RigHead& one : rig.heads)
    for (const char* name : head_param_names) names.push_back("head" + std::to_string(one.head.id) + "." + name);
  return names;
}

}  // namespace alidade
