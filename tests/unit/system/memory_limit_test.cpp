// The limit of this process's memory; each test sets it in a process of its own.

#include "system/memory_limit.h"

#include <atomic>
#include <functional>
#include <latch>
#include <new>
#include <stdexcept>
#include <string>
#include <thread>
#include <variant>
#include <vector>

#include <sys/mman.h>
#include <sys/resource.h>

#include <gtest/gtest.h>

#include "limited_memory.h"
#include "system/available_memory.h"

namespace etendue {
namespace {

constexpr uint64_t kMebibyte = uint64_t(1) << 20;

uint64_t used() {
    return memory_for_data("/proc").value();
}

bool can_allocate(uint64_t bytes) try {
    std::vector<char> block;
    block.reserve(bytes);
    return true;
} catch (const std::bad_alloc&) {
    return false;
}

void expect(bool is_so, const char* what) {
    if (!is_so) throw std::runtime_error(what);
}

class MemoryLimit : public ::testing::Test {
protected:
    void SetUp() override {
        if (!kCanLimitMemory) GTEST_SKIP() << "sanitizers reserve memory";
    }
};

TEST_F(MemoryLimit, FailsAllocationsBeyondIt) {
    EXPECT_EQ(in_limited_memory(
                  1024 * kMebibyte,
                  [] {
                      limit_memory(used() + 100 * kMebibyte);
                      expect(available_memory().value() <= 100 * kMebibyte, "more is available");
                      expect(can_allocate(50 * kMebibyte), "half of it is too much");
                      expect(!can_allocate(200 * kMebibyte), "there is more");
                      {
                          const UnlimitedMemory unlimited;
                          expect(can_allocate(200 * kMebibyte), "it was not lifted");
                      }
                      expect(!can_allocate(200 * kMebibyte), "it was lifted for good");
                  }),
              "");
}

TEST_F(MemoryLimit, IsNoLessThanTheProgramHas) {
    const std::string error =
        in_limited_memory(1024 * kMebibyte, [] { limit_memory(kMebibyte / 4); });
    EXPECT_TRUE(error.starts_with("the memory cannot be limited to 0 MiB, since the program needs"))
        << error;
}

uint64_t data_limit() {
    rlimit limit{};
    getrlimit(RLIMIT_DATA, &limit);
    return limit.rlim_cur;
}

TEST_F(MemoryLimit, OfTheMachineLeavesRoom) {
    EXPECT_EQ(in_limited_memory(1024 * kMebibyte,
                                [] {
                                    const uint64_t room = available_memory().value();
                                    limit_memory_to_available();
                                    expect(can_allocate(100 * kMebibyte), "there is too little");
                                    expect(data_limit() < used() + room + 10 * kMebibyte,
                                           "there is no limit");
                                }),
              "");
}

TEST_F(MemoryLimit, OfTheMachineGrowsByTheStacksOfThreads) {
    EXPECT_EQ(in_limited_memory(1024 * kMebibyte,
                                [] {
                                    limit_memory_to_available();
                                    const uint64_t before = data_limit();
                                    make_room_for_threads(64);
                                    // The caller has a stack.
                                    expect(data_limit() == before + 504 * kMebibyte, "no room");
                                    make_room_for_threads(16);
                                    expect(data_limit() == before + 504 * kMebibyte, "less room");
                                }),
              "");
}

/// Address space that is not memory for data.
class Reserved {
public:
    explicit Reserved(uint64_t bytes)
        : bytes_(bytes), at_(mmap(nullptr, bytes, PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0)) {
        expect(at_ != MAP_FAILED, "no address space");
    }
    ~Reserved() { munmap(at_, bytes_); }
    Reserved(const Reserved&) = delete;
    Reserved& operator=(const Reserved&) = delete;

private:
    uint64_t bytes_;
    void* at_;
};

TEST_F(MemoryLimit, OfTheMachineIsRenewed) {
    EXPECT_EQ(in_limited_memory(1024 * kMebibyte,
                                [] {
                                    renew_memory_limit();
                                    expect(data_limit() == RLIM_INFINITY, "there was none");
                                    uint64_t before = 0;
                                    {
                                        const Reserved reserved(300 * kMebibyte);
                                        limit_memory_to_available();
                                        before = data_limit();
                                    }
                                    renew_memory_limit();
                                    expect(data_limit() >= before + 290 * kMebibyte, "it is old");
                                }),
              "");
}

TEST_F(MemoryLimit, ThatIsGivenStays) {
    const std::string error = in_limited_memory(1024 * kMebibyte, [] {
        limit_memory(used() + 100 * kMebibyte);
        const uint64_t given = data_limit();
        renew_memory_limit();
        expect(data_limit() == given, "it was renewed");
        limit_memory_to_available();
        expect(data_limit() == given, "it was replaced");
        make_room_for_threads(64);  // Does not raise it.
    });
    EXPECT_TRUE(error.starts_with("63 further threads need 504 MiB")) << error;
}

/// Threads that wait until they are destroyed. Each has an `Owned`.
template <class Owned>
class Waiting {
public:
    explicit Waiting(int count) {
        std::latch begun(count + 1);
        for (int i = 0; i < count; ++i)
            threads_.emplace_back([&] {
                [[maybe_unused]] const Owned owned;
                begun.count_down();
                ends_.wait(false);
            });
        begun.arrive_and_wait();
    }
    ~Waiting() {
        ends_ = true;
        ends_.notify_all();
    }

private:
    std::atomic<bool> ends_{false};
    std::vector<std::jthread> threads_;
};
using Workers = Waiting<WorkerStack>;
using OtherThreads = Waiting<std::monostate>;

TEST_F(MemoryLimit, CountsTheStacksOfRunningThreadsOnce) {
    EXPECT_EQ(in_limited_memory(1024 * kMebibyte,
                                [] {
                                    limit_memory_to_available();
                                    make_room_for_threads(64);
                                    const Workers workers(63);
                                    rlimit space{};
                                    getrlimit(RLIMIT_AS, &space);
                                    const uint64_t left =
                                        space.rlim_cur - address_space("/proc").value();
                                    renew_memory_limit();
                                    expect(data_limit() <= used() + left + 10 * kMebibyte,
                                           "room for stacks that there are");
                                    make_room_for_threads(64);
                                    expect(data_limit() <= used() + left + 10 * kMebibyte,
                                           "more room for them");
                                }),
              "");
}

TEST_F(MemoryLimit, OfTheMachineIsSharedByItsProcesses) {
    EXPECT_EQ(in_limited_memory(uint64_t(1) << 50,
                                [] {
                                    limit_memory_to_available();
                                    const uint64_t own = used(), whole = data_limit() - own;
                                    share_available_memory(4);
                                    const uint64_t share = data_limit() - own;
                                    expect(share < whole / 3, "too much");
                                    expect(share > whole / 5, "too little");
                                    renew_memory_limit();
                                    expect(data_limit() - own < whole / 3, "no longer shared");
                                    limit_memory(own + 100 * kMebibyte);
                                    const uint64_t given = data_limit();
                                    share_available_memory(4);
                                    expect(data_limit() == given, "the given one is divided");
                                }),
              "");
}

TEST_F(MemoryLimit, CanBeEnded) {
    EXPECT_EQ(in_limited_memory(1024 * kMebibyte,
                                [] {
                                    const uint64_t before = data_limit();
                                    unlimit_memory();
                                    expect(data_limit() == before, "there was none");
                                    limit_memory(used() + 100 * kMebibyte);
                                    limit_memory(used() + 50 * kMebibyte);
                                    expect(!can_allocate(80 * kMebibyte), "there is more");
                                    unlimit_memory();
                                    expect(data_limit() == before, "it was not ended");
                                    expect(can_allocate(200 * kMebibyte), "it was not ended");
                                }),
              "");
}

TEST_F(MemoryLimit, HasRoomForThreadsOrSaysSo) {
    const std::string error = in_limited_memory(1024 * kMebibyte, [] {
        limit_memory(used() + 100 * kMebibyte);
        make_room_for_threads(4);
        const Workers workers(3);
        make_room_for_threads(64);
    });
    EXPECT_TRUE(error.starts_with(
        "60 further threads need 480 MiB for their stacks, but the memory is limited to "))
        << error;
}

/// Threads that do other things, such as those of a Python program, need their stacks themselves.
TEST_F(MemoryLimit, HasNoRoomInTheStacksOfOtherThreads) {
    const std::string error = in_limited_memory(1024 * kMebibyte, [] {
        const OtherThreads threads(64);
        limit_memory(used() + 100 * kMebibyte);
        make_room_for_threads(64);
    });
    EXPECT_TRUE(error.starts_with(
        "63 further threads need 504 MiB for their stacks, but the memory is limited to "))
        << error;
}

TEST_F(MemoryLimit, HasNoRoomInTheStacksOfWorkersThatEnded) {
    const std::string error = in_limited_memory(1024 * kMebibyte, [] {
        const OtherThreads threads(64);
        limit_memory(used() + 100 * kMebibyte);
        { const Workers workers(3); }
        make_room_for_threads(64);
    });
    EXPECT_TRUE(error.starts_with("63 further threads need 504 MiB")) << error;
}

/// The stacks of its parent's workers are not its own.
TEST_F(MemoryLimit, HasNoRoomInTheStacksOfAnotherProcess) {
    const Workers workers(63);
    const std::string error = in_limited_memory(1024 * kMebibyte, [] {
        limit_memory(used() + 100 * kMebibyte);
        make_room_for_threads(64);
    });
    EXPECT_TRUE(error.starts_with("63 further threads need 504 MiB")) << error;
}

/// One thread needs no further one, whatever the memory.
TEST_F(MemoryLimit, HasRoomForTheCaller) {
    EXPECT_EQ(in_limited_memory(1024 * kMebibyte,
                                [] {
                                    limit_memory(used() + 4 * kMebibyte);
                                    make_room_for_threads(1);
                                }),
              "");
}

TEST_F(MemoryLimit, OfTheSystemHasRoomForThreadsToo) {
    const auto lower_system_limit = [] {
        const rlimit limit{used() + 100 * kMebibyte, used() + 100 * kMebibyte};
        setrlimit(RLIMIT_DATA, &limit);
    };
    const std::vector<std::function<void()>> limits = {[] {}, limit_memory_to_available,
                                                       [] { limit_memory(4096 * kMebibyte); }};
    for (size_t i = 0; i < limits.size(); ++i) {
        SCOPED_TRACE(i);
        const std::string error = in_limited_memory(1024 * kMebibyte, [&] {
            lower_system_limit();
            limits[i]();
            const uint64_t before = data_limit();
            std::string refused;
            try {
                make_room_for_threads(64);
            } catch (const std::runtime_error& e) {
                refused = e.what();
            }
            expect(data_limit() == before, "it changes where threads are refused");
            make_room_for_threads(4);
            throw std::runtime_error(refused);
        });
        EXPECT_TRUE(error.starts_with(
            "63 further threads need 504 MiB for their stacks, but the memory is limited to "))
            << error;
    }
    const std::string error = in_limited_memory(300 * kMebibyte, [] { make_room_for_threads(64); });
    EXPECT_TRUE(error.starts_with(
        "63 further threads need 504 MiB for their stacks, but the address space is limited to "))
        << error;
}

}  // namespace
}  // namespace etendue
