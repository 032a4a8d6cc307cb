// Arenas of threads, and the memory for the stacks of their workers.

#include "film/thread_arena.h"

#include <atomic>
#include <latch>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include <gtest/gtest.h>
#include <tbb/global_control.h>
#include <tbb/info.h>
#include <tbb/parallel_for.h>
#include <tbb/partitioner.h>

#include "limited_memory.h"
#include "system/available_memory.h"
#include "system/memory_limit.h"

namespace etendue {
namespace {

constexpr uint64_t kMebibyte = uint64_t(1) << 20;

class ThreadArenas : public ::testing::Test {
protected:
    void SetUp() override {
        if (!kCanLimitMemory) GTEST_SKIP() << "sanitizers reserve memory";
    }
    void TearDown() override { unlimit_memory(); }
};

void limit_further_memory(uint64_t bytes) {
    limit_memory(memory_for_data("/proc").value() + bytes);
}

/// All threads of the arena work at the same time.
void use_all(ThreadArena& arena, int threads) {
    std::latch all(threads);
    arena.execute([&] {
        tbb::parallel_for(
            0, threads, [&](int) { all.arrive_and_wait(); }, tbb::simple_partitioner());
    });
}

/// The process would be aborted when a worker cannot begin.
TEST_F(ThreadArenas, AreRefusedWhereOtherThreadsLeaveNoMemory) {
    const std::string error = in_limited_memory(1024 * kMebibyte, [] {
        constexpr int kThreads = 64;
        std::atomic<bool> ends{false};
        std::vector<std::jthread> sleeping;
        for (int i = 0; i < kThreads; ++i) sleeping.emplace_back([&] { ends.wait(false); });
        const auto wake = [&] {
            ends = true;
            ends.notify_all();
        };
        limit_further_memory(100 * kMebibyte);
        const tbb::global_control allowed(tbb::global_control::max_allowed_parallelism, kThreads);
        try {
            ThreadArena arena(kThreads);
            use_all(arena, kThreads);
        } catch (...) {
            wake();
            throw;
        }
        wake();
    });
    EXPECT_TRUE(error.starts_with("63 further threads need 504 MiB for their stacks")) << error;
}

TEST_F(ThreadArenas, NeedNoMemoryForWorkersThatHaveBegun) {
    constexpr int kThreads = 16;
    const tbb::global_control allowed(tbb::global_control::max_allowed_parallelism, kThreads);
    ThreadArena arena(kThreads);
    use_all(arena, kThreads);
    limit_further_memory(20 * kMebibyte);
    ThreadArena again(kThreads);
    use_all(again, kThreads);
    EXPECT_THROW(ThreadArena(8 * (kThreads + tbb::info::default_concurrency())),
                 std::runtime_error);
}

/// In whatever number of arenas they work.
TEST_F(ThreadArenas, CountEachWorkerOnce) {
    constexpr int kThreads = 8;
    const tbb::global_control allowed(tbb::global_control::max_allowed_parallelism, kThreads);
    const int others = tbb::info::default_concurrency();  // Workers that earlier tests began.
    for (int i = 0; i < 10 + others; ++i) {
        ThreadArena arena(kThreads);
        use_all(arena, kThreads);
    }
    limit_further_memory(20 * kMebibyte);
    EXPECT_THROW(ThreadArena(64 + others), std::runtime_error);
}

}  // namespace
}  // namespace etendue
