// The limit of this process's memory; each test sets it in a process of its own.

#include "system/memory_limit.h"

#include <new>
#include <vector>

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
                                    expect(data_limit() == before + 512 * kMebibyte, "no room");
                                    make_room_for_threads(16);
                                    expect(data_limit() == before + 512 * kMebibyte, "less room");
                                }),
              "");
}

TEST_F(MemoryLimit, OfTheMachineIsRenewedWhereItIsNotGiven) {
    EXPECT_EQ(in_limited_memory(1024 * kMebibyte,
                                [] {
                                    renew_memory_limit();
                                    expect(data_limit() == RLIM_INFINITY, "there was none");
                                    {
                                        std::vector<char> taken(300 * kMebibyte);
                                        limit_memory_to_available();
                                        expect(taken.back() == 0, "");
                                    }
                                    const uint64_t before = data_limit();
                                    renew_memory_limit();
                                    expect(data_limit() >= before - 10 * kMebibyte, "it is lower");
                                    limit_memory(used() + 100 * kMebibyte);
                                    const uint64_t given = data_limit();
                                    renew_memory_limit();
                                    limit_memory_to_available();
                                    expect(data_limit() == given, "the given one was replaced");
                                }),
              "");
}

TEST_F(MemoryLimit, HasRoomForThreadsOrSaysSo) {
    const std::string error = in_limited_memory(1024 * kMebibyte, [] {
        limit_memory(used() + 100 * kMebibyte);
        make_room_for_threads(4);
        make_room_for_threads(64);
    });
    EXPECT_TRUE(error.starts_with("64 threads need 480 MiB for their stacks, but the memory is "
                                  "limited to "))
        << error;
}

}  // namespace
}  // namespace etendue
