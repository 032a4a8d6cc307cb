#include "compare/memory.h"

#include <malloc.h>

#include <algorithm>
#include <fstream>
#include <string>

namespace etendue {
namespace {

/// A field of /proc/self/status in bytes (the file has units of 1024 bytes); 0 where it is missing.
size_t status_field(const std::string& name) {
    std::ifstream status("/proc/self/status");
    for (std::string word; status >> word;) {
        size_t kib = 0;
        if (word == name + ":" && status >> kib) return kib * 1024;
    }
    return 0;
}

}  // namespace

size_t resident_bytes() {
    return status_field("VmRSS");
}

void MemoryMeter::begin() {
    malloc_trim(
        0);  // otherwise memory freed by other users could be reused here without being counted
    std::ofstream("/proc/self/clear_refs") << "5";  // resets the peak, VmHWM
    resident_at_begin_ = resident_bytes();
}

void MemoryMeter::end() {
    const size_t resident = resident_bytes(), highest = std::max(status_field("VmHWM"), resident);
    if (highest > resident_at_begin_)
        peak_ = std::max(peak_, kept_ + (highest - resident_at_begin_));
    // Other users' memory may be released during this turn, which must not make the share negative.
    kept_ = resident > resident_at_begin_ ? kept_ + (resident - resident_at_begin_)
                                          : kept_ - std::min(kept_, resident_at_begin_ - resident);
}

}  // namespace etendue
