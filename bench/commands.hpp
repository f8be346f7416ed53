// SPDX-License-Identifier: MIT
#pragma once

#include "options.hpp"
#include "report.hpp"

namespace stiffmap::bench {

Report map(const Options&);
Report compare(const Options&);
Report scaling(const Options&);
Report serial_leg(const Options&);
Report passes(const Options&);
Report peak(const Options&);

/// Seconds of one 6x6 congruence J^T C J and inverse in scalar Eigen.
double congruence_and_inverse();

}  // namespace stiffmap::bench
