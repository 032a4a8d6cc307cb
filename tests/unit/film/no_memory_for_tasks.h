#pragma once

#include "set_while.h"

namespace etendue::test {

extern std::atomic<long> tasks_with_memory;  ///< Up to the one that fails; 0 or less: none fails.

/// While this exists, the n-th allocation of a task of TBB fails, from n = 1.
struct NoMemoryForTask : SetWhile<long> {
    explicit NoMemoryForTask(long n) : SetWhile(tasks_with_memory, n) {}
    /// Whether it has failed.
    bool has_failed() const { return now() <= 0; }
};

}  // namespace etendue::test
