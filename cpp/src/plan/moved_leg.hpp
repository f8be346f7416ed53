// SPDX-License-Identifier: MIT
// Which leg alone tells a variant from its base: the kernels then evaluate only that one (docs/fast_path.md F10).
#pragma once

#include "../../kernels/program.hpp"

namespace stiffmap {

/// Index of the only leg in which two programs of the same operations differ; -1 where they differ elsewhere or in
/// several. Only for machines whose base has no operation before the legs.
std::int32_t moved_leg(const Program& base, const Program& variant);

}  // namespace stiffmap
