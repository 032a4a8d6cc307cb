#include "system/memory_limit.h"

#include <algorithm>
#include <atomic>
#include <cctype>
#include <charconv>
#include <cmath>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>

#include <pthread.h>
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
    uint64_t bytes = 0;                ///< Includes the stacks of the `begun` workers.
    int begun = 0;
    int workers = 0;             ///< Most for which there is room.
    int sharers = 1;             ///< Processes that divide what is available.
    std::atomic<int> stacks{0};  ///< Of workers that run now.

    void set(Kind new_kind, uint64_t new_bytes) {
        if (kind == Kind::None) of_system = data_limit().rlim_cur;
        kind = new_kind;
        bytes = new_bytes;
        begun = stacks;
        apply();
    }
    void set_to_available() {
        const auto used = memory_for_data("/proc"), free = available_memory(sharers);
        // Sanitizers reserve many terabytes.
        constexpr uint64_t kMostForItself = uint64_t(1) << 40;
        if (used && free && *used < kMostForItself) set(Kind::Available, *used + *free);
    }
    void renew() {
        if (kind != Kind::Available) return;
        set_limit(of_system);  // What is available is at most what a limit leaves.
        set_to_available();
    }
    void apply() const {
        if (kind == Kind::None) return;
        const int further = kind == Kind::Available ? std::max(0, workers - begun) : 0;
        set_limit(std::min(rlim_t(bytes + uint64_t(further) * kStack), of_system));
    }
    /// Throws std::runtime_error where the limits have no room for those of so many workers that have not begun.
    void check_stacks(int wanted) const {
        const int further = wanted - stacks;
        if (further <= 0) return;
        const uint64_t room = uint64_t(further) * kStack;
        const auto check = [&](const char* what, decltype(RLIMIT_AS) kind_of_limit,
                               std::optional<uint64_t> used) {
            rlimit limit{};
            if (!used || getrlimit(kind_of_limit, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY ||
                *used + room <= limit.rlim_cur)
                return;
            throw std::runtime_error(fmt::format(
                "{} further threads need {} for their stacks, but the {} is limited to {}, of "
                "which {} are used",
                further, format_bytes(room), what, format_bytes(limit.rlim_cur),
                format_bytes(*used)));
        };
        check("memory", RLIMIT_DATA, memory_for_data("/proc"));
        check("address space", RLIMIT_AS, address_space("/proc"));
    }
};

Limit& current_limit() {
    static Limit limit;
    // A forked process has none of its parent's workers.
    [[maybe_unused]] static const int forks =
        pthread_atfork(nullptr, nullptr, [] { limit.stacks = 0; });
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

void unlimit_memory() {
    Limit& limit = current_limit();
    const std::scoped_lock lock(limit.mutex);
    if (limit.kind == Limit::Kind::None) return;
    set_limit(limit.of_system);
    limit.kind = Limit::Kind::None;
}

uint64_t parse_memory_size(const std::string& text, const std::string& option) {
    constexpr double kMost = 0x1p62;
    constexpr std::string_view kPrefixes = "KMGTPE";
    double bytes = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), bytes);
    std::string unit(end, text.data() + text.size());
    unit.erase(0, unit.find_first_not_of(' '));
    for (char& c : unit) c = char(std::toupper(static_cast<unsigned char>(c)));
    if (const size_t n = unit.empty() ? unit.npos : kPrefixes.find(unit[0]); n != unit.npos) {
        bytes = std::ldexp(bytes, 10 * int(n + 1));
        unit.erase(0, unit.starts_with(std::string{unit[0], 'I', 'B'}) ? 2 : 1);
    }
    if (error != std::errc() || !(bytes >= 1 && bytes < kMost) || (unit != "" && unit != "B"))
        throw std::runtime_error(
            fmt::format("{} must be a size such as 4G or 1.5G, but is \"{}\"", option, text));
    return uint64_t(bytes);
}

void limit_memory_to_available() {
    Limit& limit = current_limit();
    const std::scoped_lock lock(limit.mutex);
    if (limit.kind != Limit::Kind::Given) limit.set_to_available();
}

void renew_memory_limit() {
    Limit& limit = current_limit();
    const std::scoped_lock lock(limit.mutex);
    limit.renew();
}

void share_available_memory(int processes) {
    Limit& limit = current_limit();
    const std::scoped_lock lock(limit.mutex);
    limit.sharers = processes;
    limit.renew();
}

void make_room_for_threads(int threads) {
    Limit& limit = current_limit();
    const std::scoped_lock lock(limit.mutex);
    const int before = limit.workers, wanted = threads - 1;
    limit.workers = std::max(before, wanted);
    limit.apply();
    try {
        limit.check_stacks(wanted);
    } catch (const std::runtime_error&) {
        limit.workers = before;
        limit.apply();
        throw;
    }
}

WorkerStack::WorkerStack() {
    ++current_limit().stacks;
}

WorkerStack::~WorkerStack() {
    --current_limit().stacks;
}

UnlimitedMemory::UnlimitedMemory() : limit_(data_limit().rlim_cur) {
    set_limit(RLIM_INFINITY);
}

UnlimitedMemory::~UnlimitedMemory() {
    set_limit(limit_);
}

}  // namespace etendue
