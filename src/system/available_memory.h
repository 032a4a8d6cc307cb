#pragma once
// How much memory is free, so that what does not fit is refused before it is allocated. Systems that promise more memory
// than they have would otherwise end the process.

#include <cstdint>
#include <new>
#include <optional>
#include <string>

namespace etendue {

/// Bytes that this process can still use: the least of what the system has, what its control groups allow, and what its
/// limits of address space and of memory for data leave. Empty where the system does not tell. What others can use, too, is
/// divided by `sharers`, the number of processes that ask for it at the same time.
std::optional<uint64_t> available_memory(int sharers = 1);

/// The same from other files: `proc` stands for /proc, `cgroup` for /sys/fs/cgroup.
std::optional<uint64_t> available_memory(const std::string& proc, const std::string& cgroup,
                                         int sharers = 1);

/// Bytes of private memory that this process can write, used or not.
std::optional<uint64_t> memory_for_data(const std::string& proc);
/// Bytes of address space that this process has.
std::optional<uint64_t> address_space(const std::string& proc);

/// "1.5 GiB", "12 MiB", ...
std::string format_bytes(uint64_t bytes);

/// Throws std::runtime_error where `bytes` are not available: "WHAT needs 99 GiB of memory, but only 3 GiB are free".
/// `advice` is appended to the message.
void require_memory(uint64_t bytes, const std::string& what, const std::string& advice = "");

/// Calls read(), which allocates as much as a file asks for. Where memory ends, calls fail() with the reason.
template <class Read, class Fail>
auto in_memory(const Read& read, const Fail& fail) {
    try {
        return read();
    } catch (const std::bad_alloc&) {
        fail("it does not fit into memory");
        throw;
    }
}

/// Watches the growth of something whose size is not known before it is made.
class MemoryWatch {
public:
    /// Counts `bytes` about to be allocated. Returns false where they, or the next ones, no longer fit.
    bool add(uint64_t bytes);

private:
    static constexpr uint64_t kStep = uint64_t(64) << 20;
    uint64_t unchecked_ = 0;
};

}  // namespace etendue
