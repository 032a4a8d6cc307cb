#pragma once
// Memory that is missing.

#include <cstddef>

namespace etendue::test {

/// While it exists, operator new fails in all threads for blocks of exactly this size.
class NoMemoryFor {
public:
    explicit NoMemoryFor(size_t size);
    ~NoMemoryFor();
    NoMemoryFor(const NoMemoryFor&) = delete;
    NoMemoryFor& operator=(const NoMemoryFor&) = delete;
};

}  // namespace etendue::test
