// SPDX-License-Identifier: MIT
#pragma once

namespace stiffmap::bench {

/// Calls of malloc and its kin by this process since it started; operator new ends there too.
/// -1 where the C library cannot be watched.
long allocations();

}  // namespace stiffmap::bench
