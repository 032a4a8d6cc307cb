#include "system/memory_limit.h"

#include <algorithm>
#include <mutex>
#include <stdexcept>
#include <string>

#include <sys/resource.h>

#include <fmt/format.h>

#include "system/available_memory.h"

namespace etendue {
namespace {

rlimit data_limit() {
    rlimit limit{};
    getrlimit(RLIMIT_DATA, &limit);
    return limit;
}

void set_limit(uint64_t bytes) {
    rlimit limit = data_limit();
    limit.rlim_cur = std::min(rlim_t(bytes), limit.rlim_max);
    setrlimit(RLIMIT_DATA, &limit);
}

constexpr uint64_t kStack = uint64_t(8) << 20;

/// The limit of this process.
struct Limit {
    enum class Kind : uint8_t { None, Given, Available };

    std::mutex mutex;
    Kind kind = Kind::None;
    rlim_t of_system = RLIM_INFINITY;  ///< Before there was another.
    uint64_t without_stacks = 0;
    int threads = 0;  ///< Most for which there is room.

    void set(Kind new_kind, uint64_t bytes) {
        if (kind == Kind::None) of_system = data_limit().rlim_cur;
        kind = new_kind;
        without_stacks = bytes;
        apply();
    }
    void set_to_available() {
        const auto used = memory_for_data("/proc"), free = available_memory();
        // Sanitizers reserve many terabytes.
        constexpr uint64_t kMostForItself = uint64_t(1) << 40;
        if (used && free && *used < kMostForItself) set(Kind::Available, *used + *free);
    }
    void apply() const {
        const uint64_t stacks = kind == Kind::Available ? uint64_t(threads) * kStack : 0;
        set_limit(std::min(rlim_t(without_stacks + stacks), of_system));
    }
};

Limit& current_limit() {
    static Limit limit;
    return limit;
}

}  // namespace

void limit_memory(uint64_t bytes) {
    if (const auto used = memory_for_data("/proc"); used && *used >= bytes)
        throw std::runtime_error(
            fmt::format("the memory cannot be limited to {}, since the program needs {} for itself",
                        format_bytes(bytes), format_bytes(*used)));
    Limit& limit = current_limit();
    const std::scoped_lock lock(limit.mutex);
    limit.set(Limit::Kind::Given, bytes);
}

void limit_memory_to_available() {
    Limit& limit = current_limit();
    const std::scoped_lock lock(limit.mutex);
    limit.set_to_available();
}

void renew_memory_limit() {
    Limit& limit = current_limit();
    const std::scoped_lock lock(limit.mutex);
    if (limit.kind != Limit::Kind::Available) return;
    set_limit(limit.of_system);  // What is available is at most what a limit leaves.
    limit.set_to_available();
}

void make_room_for_threads(int threads) {
    Limit& limit = current_limit();
    const std::scoped_lock lock(limit.mutex);
    if (limit.kind == Limit::Kind::None || threads <= limit.threads) return;
    if (limit.kind == Limit::Kind::Given) {
        const uint64_t stacks = uint64_t(threads - limit.threads) * kStack;
        if (const auto used = memory_for_data("/proc");
            used && *used + stacks > limit.without_stacks)
            throw std::runtime_error(fmt::format(
                "{} threads need {} for their stacks, but the memory is limited to {}, of which {} "
                "are used",
                threads, format_bytes(stacks), format_bytes(limit.without_stacks),
                format_bytes(*used)));
    }
    limit.threads = threads;
    limit.apply();
}

UnlimitedMemory::UnlimitedMemory() : limit_(data_limit().rlim_cur) {
    set_limit(RLIM_INFINITY);
}

UnlimitedMemory::~UnlimitedMemory() {
    set_limit(limit_);
}

}  // namespace etendue
