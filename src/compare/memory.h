#pragma once

#include <cstddef>

namespace etendue {

/// Measures the memory of one of several users within a process that run in turns. Linux reports resident memory and
/// its peak only for the whole process. The share of a user is therefore the increase between begin() and end(), and
/// users must not run at the same time. Shared memory that existed before (the scene) is not counted.
class MemoryMeter {
public:
    void begin();
    void end();
    /// Largest sum, in bytes, of the memory kept from earlier turns and that added in a turn; 0 where it cannot be
    /// measured.
    size_t peak_bytes() const { return peak_; }

private:
    size_t resident_at_begin_ = 0, kept_ = 0, peak_ = 0;
};

/// Resident memory of the process; 0 where it cannot be measured.
size_t resident_bytes();

}  // namespace etendue
