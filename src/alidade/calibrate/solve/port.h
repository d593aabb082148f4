#pragma once

#include <optional>
#include <string>

#include "alidade/calibrate/config.h"
#include "alidade/camera/port_residual.h"

namespace alidade {

/// `config` for the model flat_port: gap and normal estimated, the rest fixed as `port` says. The fixed parameters and
/// priors of `config` are kept. The air lens must be pinhole or brown.
[[nodiscard]] CalibrateConfig with_port(CalibrateConfig config, const PortKnowledge& port);

/// Largest σ with which a parameter still counts as determined; infinite if any will do (distortion).
[[nodiscard]] double largest_given_sigma(const std::string& name, double value, const Camera& camera);

/// "Brown … errs by 0.29 / 0.12 / 0.00 / 0.08 px at 0.3 / 0.5 / 1 / 3 m: it is enough from 0.5 m on", or is not.
[[nodiscard]] std::string port_sentence(const PortResidual& residual);

}  // namespace alidade
