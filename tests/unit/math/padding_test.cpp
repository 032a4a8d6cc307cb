#include "math/padding.h"

#include <cstdint>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "math/vec.h"

namespace etendue {
namespace {

struct Packed {
    Vec3 p;
    uint32_t n = 0;
    std::array<double, 2> sums{};
    bool is_first = false;
    uint8_t rest[7] = {};
};
struct Between {
    uint8_t n = 0;
    float x = 0;

    template <class T, class Use>
    static void for_each_field(T& value, const Use& use) {
        auto& [n, x] = value;
        use(n), use(x);
    }
};
struct AtEnd {
    std::array<Between, 2> parts{};
    double x = 0;
    float y = 0;

    template <class T, class Use>
    static void for_each_field(T& value, const Use& use) {
        auto& [parts, x, y] = value;
        use(parts), use(x), use(y);
    }
};

static_assert(HasNoPadding<int> && HasNoPadding<double> && HasNoPadding<Vec3>);
static_assert(HasNoPadding<Packed> && HasNoPadding<std::array<Packed, 3>>);
static_assert(!HasNoPadding<Between> && !HasNoPadding<AtEnd>);
static_assert(!HasNoPadding<std::array<Between, 2>> && !HasNoPadding<std::pair<double, float>>);
static_assert(!HasNoPadding<std::vector<int>>);

TEST(Padding, PartsAreInTheirOrderAndHaveNone) {
    std::vector<double> values;
    const AtEnd value{{Between{1, 2}, Between{3, 4}}, 5, 6};
    for_each_part(value, [&](const auto& part) { values.push_back(double(part)); });
    EXPECT_EQ(values, (std::vector<double>{1, 2, 3, 4, 5, 6}));
}

TEST(Padding, ThereIsOnePartWhereThereIsNone) {
    std::vector<size_t> sizes;
    const Packed value{};
    for_each_part(value, [&](const auto& part) { sizes.push_back(sizeof part); });
    EXPECT_EQ(sizes, std::vector<size_t>{sizeof(Packed)});
}

}  // namespace
}  // namespace etendue
