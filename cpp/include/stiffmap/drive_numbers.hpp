// SPDX-License-Identifier: MIT
// Numbers of a drive, declared once: bindings, chains and mechanism hold them as they stand here.
#pragma once

namespace stiffmap {

struct DriveNumbers {
  double compliance_slope = 0;  ///< relative change of the drive's compliance per unit of travel from home
  double force_limit = 1e300;
};

/// Every one by its name, as Python gives it.
struct DriveNumber {
  const char* name;
  double DriveNumbers::* value;
};
inline constexpr DriveNumber drive_numbers[] = {
    {"compliance_slope", &DriveNumbers::compliance_slope},
    {"force_limit", &DriveNumbers::force_limit},
};

}  // namespace stiffmap
