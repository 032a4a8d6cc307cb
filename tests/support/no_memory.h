#pragma once
// Memory that is missing.

#include <cstddef>

#include "set_while.h"

namespace etendue::test {

extern std::atomic<size_t> size_without_memory;  ///< 0: none.
extern std::atomic<long> blocks_with_memory;     ///< Up to the one that fails; 0: none fails.

/// While it exists, operator new fails in all threads for blocks of exactly this size.
struct NoMemoryFor : SetWhile<size_t> {
    explicit NoMemoryFor(size_t size) : SetWhile(size_without_memory, size) {}
};

/// While it exists, the n-th call of operator new fails, from n = 1, whichever thread makes it; 0: none.
struct NoMemoryForBlock : SetWhile<long> {
    explicit NoMemoryForBlock(long n) : SetWhile(blocks_with_memory, n) {}
};

}  // namespace etendue::test
