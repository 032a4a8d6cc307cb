#pragma once

#include <cstddef>

namespace etendue::test {

/// While this exists, the n-th allocation of a task of TBB fails, from n = 1.
class NoMemoryForTask {
public:
    explicit NoMemoryForTask(long n);
    ~NoMemoryForTask();
    NoMemoryForTask(const NoMemoryForTask&) = delete;
    NoMemoryForTask& operator=(const NoMemoryForTask&) = delete;
    /// Whether it has failed.
    bool has_failed() const;
};

}  // namespace etendue::test
