#pragma once

#include <Eigen/LU>
#include <algorithm>

#include "alidade/reproduce/underwater_protocol.h"

namespace alidade::testing {

using reproduce::paper_filter;
using reproduce::point_error;
using reproduce::PointError;
using reproduce::ProtocolRun;
using reproduce::recommended_filter;
using reproduce::run_protocol;
using reproduce::underwater_sample;
using reproduce::UnderwaterSample;

inline Eigen::MatrixXd covariance_of(const LocalizationFilter& filter) {
  Eigen::MatrixXd P(filter.dim(), filter.dim());
  for (int i = 0; i < filter.dim(); ++i)
    for (int j = 0; j < filter.dim(); ++j) P(i, j) = filter.covariance().at(i, j);
  return P;
}

}  // namespace alidade::testing
