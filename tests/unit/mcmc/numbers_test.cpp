#include "mcmc/numbers.h"

#include <cmath>
#include <map>

#include <gtest/gtest.h>

#include "math/statistics.h"

namespace etendue {
namespace {

constexpr int kCount = 40000;

/// What a step makes of `bits` at one address, under many keys.
template <class Use>
void for_each_step(NumberStep step, Stream stream, uint32_t bits, const Use& use) {
    NumberTable present, next;
    present.clear();
    present.set(stream, 3, 1, bits);
    for (uint64_t key = 0; key < kCount; ++key) {
        NumberSource source(step, hash_combine(7, key), &present, &next);
        use(source.bits(stream, 3, 1));
    }
}

TEST(Numbers, SmallStepsAreSymmetricOnTheTorus) {
    // Next to where it wraps around.
    for (const uint32_t bits : {0u, 5u, 0x80000000u, 0xfffffff0u}) {
        Moments sign, octave;
        for_each_step(NumberStep::Small, Stream::Eye, bits, [&](uint32_t moved) {
            const auto distance = double(int32_t(moved - bits)) * 0x1p-32;
            EXPECT_GE(std::fabs(distance), 0.999 * 0x1p-13);
            EXPECT_LE(std::fabs(distance), 0x1p-5);
            sign.add(distance > 0 ? 1 : -1);
            octave.add(std::log2(std::fabs(distance)));
        });
        EXPECT_LT(std::fabs(sign.mean()), 4 * std::sqrt(sign.squared_error()));
        EXPECT_NEAR(octave.mean(), -9, 4 * std::sqrt(octave.squared_error()));
        EXPECT_NEAR(octave.variance(), 64.0 / 12, 0.3);
    }
}

TEST(Numbers, ChoicesStayInSmallSteps) {
    for_each_step(NumberStep::Small, Stream::Selection, 77,
                  [&](uint32_t moved) { EXPECT_EQ(moved, 77u); });
}

TEST(Numbers, BlocksAreDrawnAsAWhole) {
    NumberTable present, next;
    for (uint32_t slot = 0; slot < 4; ++slot) present.set(Stream::Light, 2, slot, slot);
    Moments drawn;
    for (uint64_t key = 0; key < kCount; ++key) {
        NumberSource source(NumberStep::Block, hash_combine(9, key), &present, &next);
        int changed = 0;
        for (uint32_t slot = 0; slot < 4; ++slot)
            changed += source.bits(Stream::Light, 2, slot) != slot;
        EXPECT_TRUE(changed == 0 || changed == 4);
        drawn.add(changed / 4);
    }
    EXPECT_NEAR(drawn.mean(), NumberSource::kBlockProbability,
                4 * std::sqrt(drawn.squared_error()));
}

TEST(Numbers, ThoseThatWereNotReadAreDrawnAfresh) {
    for (const NumberStep step : {NumberStep::Small, NumberStep::Block}) {
        NumberTable present, next;
        // It held a number, of a state before the present one.
        present.set(Stream::Eye, 1, 0, 42);
        present.clear();
        Moments u;
        for (uint64_t key = 0; key < kCount; ++key) {
            NumberSource source(step, hash_combine(3, key), &present, &next);
            u.add(double(source.bits(Stream::Eye, 1, 0)) * 0x1p-32);
        }
        EXPECT_NEAR(u.mean(), 0.5, 4 * std::sqrt(u.squared_error()));
        EXPECT_NEAR(u.variance(), 1.0 / 12, 0.003);
    }
}

TEST(Numbers, ReadTwiceAreTheSame) {
    NumberTable present, next;
    NumberSource source(NumberStep::Fresh, 1, nullptr, &next);
    std::map<std::pair<uint64_t, uint32_t>, uint32_t> seen;
    for (uint64_t vertex : {0u, 1u, 0x8000u, 0x8001u, 40u})
        for (uint32_t slot : {0u, 3u, 7u}) {
            const uint32_t bits = source.bits(Stream::Connection, vertex, slot);
            for (const auto& [address, other] : seen) EXPECT_NE(bits, other);
            seen[{vertex, slot}] = bits;
        }
    NumberSource again(NumberStep::Same, 0, &next, nullptr);
    for (const auto& [address, bits] : seen) {
        EXPECT_EQ(source.bits(Stream::Connection, address.first, address.second), bits);
        EXPECT_EQ(again.bits(Stream::Connection, address.first, address.second), bits);
    }
    EXPECT_THROW(source.bits(Stream::Eye, 0, 8), std::logic_error);
}

}  // namespace
}  // namespace etendue
