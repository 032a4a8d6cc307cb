#include "math/hash.h"

#include <gtest/gtest.h>

#include <set>

#include "math/vec.h"

namespace etendue {
namespace {

// Flipping one bit of the input flips every bit of the output with probability 1/2: 2^14 trials
// leave a standard deviation of 0.004, and 64 × 64 of them stay within 6 of those.
TEST(Mix64, EveryInputBitReachesEveryOutputBit) {
    constexpr int kTrials = 1 << 14;
    for (int in = 0; in < 64; ++in) {
        int flips[64] = {};
        for (uint64_t i = 0; i < kTrials; ++i) {
            const uint64_t x = i * 0x9e3779b97f4a7c15ull;
            const uint64_t changed = mix64(x) ^ mix64(x ^ (1ull << in));
            for (int out = 0; out < 64; ++out) flips[out] += int(changed >> out & 1);
        }
        for (const int f : flips) EXPECT_NEAR(f / double(kTrials), 0.5, 6 * 0.004);
    }
}

TEST(Mix64, IsInjectiveOnSmallNumbers) {
    std::set<uint64_t> seen;
    for (uint64_t i = 0; i < 100000; ++i) EXPECT_TRUE(seen.insert(mix64(i)).second);
}

TEST(HashCombine, DependsOnBothAndOnTheirOrder) {
    std::set<uint64_t> seen;
    for (uint64_t a = 0; a < 300; ++a)
        for (uint64_t b = 0; b < 300; ++b) EXPECT_TRUE(seen.insert(hash_combine(a, b)).second);
}

TEST(ToUnitFloat, CoversTheUnitIntervalWithoutItsEnd) {
    EXPECT_EQ(to_unit_float(0), 0);
    EXPECT_EQ(to_unit_float(0xffffffffu), kOneMinusEpsilon);
    EXPECT_EQ(to_unit_float(0x80000000u), 0.5f);
    EXPECT_EQ(to_unit_float(0x100u), 0x1p-24f);
}

}  // namespace
}  // namespace etendue
