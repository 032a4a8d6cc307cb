#include "mcmc/numbers.h"

#include <algorithm>
#include <array>
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
    present.set(NumberTable::place(stream, 3, 1), bits);
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
            EXPECT_GE(std::fabs(distance), 0x1p-16);
            EXPECT_LT(std::fabs(distance), 0x1p-6);
            sign.add(distance > 0 ? 1 : -1);
            octave.add(std::floor(std::log2(std::fabs(distance))));
        });
        EXPECT_LT(std::fabs(sign.mean()), 4 * std::sqrt(sign.squared_error()));
        EXPECT_NEAR(octave.mean(), -11.5, 4 * std::sqrt(octave.squared_error()));
        EXPECT_NEAR(octave.variance(), 99.0 / 12, 0.3);
    }
}

TEST(Numbers, WideStepsAreWider) {
    Moments octave;
    for_each_step(NumberStep::Wide, Stream::Light, 77, [&](uint32_t moved) {
        const auto distance = std::fabs(double(int32_t(moved - 77u)) * 0x1p-32);
        EXPECT_GE(distance, 0x1p-13);
        EXPECT_LT(distance, 0x1p-5);
        octave.add(std::floor(std::log2(distance)));
    });
    EXPECT_NEAR(octave.mean(), -9.5, 4 * std::sqrt(octave.squared_error()));
}

TEST(Numbers, FilmPointsMoveFarther) {
    NumberTable present, next;
    for (uint32_t slot = 0; slot < 3; ++slot)
        present.set(NumberTable::place(Stream::Eye, 0, slot), 0x12345678);
    std::array<double, 3> least{1, 1, 1};
    for (uint64_t key = 0; key < kCount; ++key) {
        NumberSource source(NumberStep::Small, hash_combine(4, key), &present, &next);
        for (uint32_t slot = 0; slot < 3; ++slot) {
            const uint32_t moved = source.bits(Stream::Eye, 0, slot);
            least[slot] =
                std::min(least[slot], std::fabs(double(int32_t(moved - 0x12345678)) * 0x1p-32));
        }
    }
    EXPECT_GE(least[0], 0x1p-10);
    EXPECT_GE(least[1], 0x1p-10);
    EXPECT_LT(least[2], 0x1p-15);  // The lens point.
}

TEST(Numbers, RouletteOfAllJoinsIsOneCoordinate) {
    NumberTable present, next;
    NumberSource first(NumberStep::Fresh, 1, nullptr, &present);
    const uint32_t a = first.bits(Stream::Roulette, join_number(2, 3), 0),
                   b = first.bits(Stream::Roulette, join_number(4, 2), 0);
    EXPECT_NE(a, b);
    // A small step moves both by the same small distance.
    NumberSource small(NumberStep::Small, 5, &present, &next);
    const uint32_t moved = small.bits(Stream::Roulette, join_number(4, 2), 0) - b;
    EXPECT_EQ(small.bits(Stream::Roulette, join_number(2, 3), 0) - a, moved);
    EXPECT_LT(std::abs(double(int32_t(moved))) * 0x1p-32, 0x1p-6);
    EXPECT_NE(moved, 0u);
}

TEST(Numbers, ChoicesStayInSmallSteps) {
    for_each_step(NumberStep::Small, Stream::Selection, 77,
                  [&](uint32_t moved) { EXPECT_EQ(moved, 77u); });
}

TEST(Numbers, BlocksAreDrawnAsAWhole) {
    NumberTable present, next;
    for (uint32_t slot = 0; slot < 4; ++slot)
        present.set(NumberTable::place(Stream::Light, 2, slot), slot);
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
    for (const NumberStep step : {NumberStep::Small, NumberStep::Wide, NumberStep::Block}) {
        NumberTable present, next;
        // It held a number, of a state before the present one.
        present.set(NumberTable::place(Stream::Eye, 1, 0), 42);
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

TEST(Numbers, AreForgottenHoweverOftenTheTableWasCleared) {
    const auto read = NumberTable::place(Stream::Eye, 1, 0),
               never_read = NumberTable::place(Stream::Eye, 1, 1);
    NumberTable first;
    first.set(read, 42);
    LearnedState saved;
    first.save(saved);
    std::vector<std::byte> bytes = saved.take();
    std::fill_n(bytes.begin(), sizeof(uint32_t), std::byte{0xff});  // The number of the last state.
    LearnedState of_last(std::move(bytes));
    NumberTable table;
    table.load(of_last);
    for (int i = 0; i < 3; ++i) {
        table.clear();
        EXPECT_EQ(table.find(read), nullptr);
        EXPECT_EQ(table.find(never_read), nullptr);
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
