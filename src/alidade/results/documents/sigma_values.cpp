#include "alidade/results/documents/sigma_values.h"

namespace alidade {

JsonValue sigma_values(std::span<const std::pair<std::string, Eigen::Index>> given, const ClusterCovariance& clusters) {
  JsonValue values = JsonValue::object(), inflation = JsonValue::object(), dof = JsonValue::object();
  for (const auto& [name, at] : given) {
    inflation[name] = clusters.inflation[at];
    dof[name] = clusters.degrees_of_freedom[at];
  }
  values["design_effect"] = clusters.design_effect;
  values["shrinkage"] = clusters.shrinkage;
  values["inflation"] = std::move(inflation);
  values["degrees_of_freedom"] = std::move(dof);
  return values;
}

}  // namespace alidade
