#pragma once
// Memory that is missing.

#include <cstddef>

#include "set_while.h"

namespace etendue::test {

extern std::atomic<size_t> size_without_memory;  ///< 0: none.

/// While it exists, operator new fails in all threads for blocks of exactly this size.
struct NoMemoryFor : SetWhile<size_t> {
    explicit NoMemoryFor(size_t size) : SetWhile(size_without_memory, size) {}
};

}  // namespace etendue::test
