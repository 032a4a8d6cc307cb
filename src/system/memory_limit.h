#pragma once
// A limit of the memory of this process.

#include <cstdint>
#include <string>

namespace etendue {

/// Limits the memory for data (private memory that can be written; each thread has 8 MiB of it for its stack): an allocation
/// beyond `bytes` fails, which is std::bad_alloc, and available_memory() is what is left. A limit of the system that is
/// lower stays. Throws std::runtime_error if the process already has more.
void limit_memory(uint64_t bytes);
/// Ends the limit.
void unlimit_memory();
/// Bytes of a size such as 4G, 1.5 GiB, 800mb or 1000000; all units are powers of 1024. Otherwise throws an error that
/// names the option.
uint64_t parse_memory_size(const std::string& text, const std::string& option);

/// The same with what the system and its control groups have now, so that what does not fit fails here, instead of the
/// process being ended. No limit where that is unknown, or where address space says nothing about memory (sanitizers). A
/// limit of limit_memory() stays.
void limit_memory_to_available();
/// Sets that limit anew, where there is one, since other programs may have ended or begun.
void renew_memory_limit();
/// Does so too. From now on, `processes` of this machine, each of which calls this, divide what is available.
void share_available_memory(int processes);

/// To be called before `threads` threads work together, of which the caller is one. The others are workers, which end the
/// process where there is no memory for their stacks. The limit of limit_memory_to_available() grows by these, since a
/// stack is not memory until it is used. Throws std::runtime_error where that of limit_memory() or one of the system has no
/// room for the stacks of the workers that have not begun yet.
void make_room_for_threads(int threads);

/// Exists in each worker that has begun, until it ends. Other threads do not count, since their stacks are of no use to
/// workers.
class WorkerStack {
public:
    WorkerStack();
    ~WorkerStack();
    WorkerStack(const WorkerStack&) = delete;
    WorkerStack& operator=(const WorkerStack&) = delete;
};

/// Lifts it for a while, such as for writing what there is after an allocation has failed.
class UnlimitedMemory {
public:
    UnlimitedMemory();
    ~UnlimitedMemory();
    UnlimitedMemory(const UnlimitedMemory&) = delete;
    UnlimitedMemory& operator=(const UnlimitedMemory&) = delete;

private:
    uint64_t limit_;
};

}  // namespace etendue
