// The limit of this process's memory; each test sets it in a process of its own.

#include "system/memory_limit.h"

#include <new>
#include <vector>

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

TEST_F(MemoryLimit, OfTheMachineLeavesRoom) {
    EXPECT_EQ(in_limited_memory(1024 * kMebibyte,
                                [] {
                                    limit_memory_to_available();
                                    expect(can_allocate(100 * kMebibyte), "there is too little");
                                    const uint64_t most = memory_for_data("/proc").value() +
                                                          available_memory().value();
                                    expect(!can_allocate(2 * most), "there is no limit");
                                }),
              "");
}

}  // namespace
}  // namespace etendue
