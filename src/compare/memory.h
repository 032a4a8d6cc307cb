#pragma once

#include <cstddef>

namespace etendue {

/// Memory that became resident while one of several users of a process was at work. Linux reports residence, and its
/// peak since the peak was last reset, for the whole process; a user's share is what it added between begin() and end(),
/// so users must not run at the same time. What all share (the scene) was there before and counts for none.
class MemoryMeter {
public:
    void begin();
    void end();
    /// Largest sum of what the user kept from earlier turns and had in use beyond it. 0 where it cannot be told.
    size_t peak_bytes() const { return peak_; }

private:
    size_t resident_at_begin_ = 0, kept_ = 0, peak_ = 0;
};

/// Resident now; 0 where it cannot be told.
size_t resident_bytes();

}  // namespace etendue
