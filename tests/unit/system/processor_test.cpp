// The hash by which processors are told apart shows small differences of their approximations.

#include "system/processor.h"

#include <bit>
#include <cmath>

#include <gtest/gtest.h>

namespace etendue::test {
namespace {

float inverse(float x) {
    return 1 / x;
}
float inverse_root(float x) {
    return 1 / std::sqrt(x);
}
/// The neighbouring float.
float other(float y) {
    return std::bit_cast<float>(std::bit_cast<uint32_t>(y) + 1);
}

TEST(Reciprocals, AreThoseOfThisProcessor) {
    const uint64_t own = reciprocals_of_processor();
    EXPECT_EQ(own, reciprocals_of_processor());
#if defined(__SSE__)
    // They are no exact ones.
    EXPECT_NE(own, 0u);
    EXPECT_NE(own, hash_of_reciprocals(inverse, inverse_root));
#endif
}

TEST(Reciprocals, OfProcessorsThatDifferInOneIntervalHaveAnotherHash) {
    const uint64_t exact = hash_of_reciprocals(inverse, inverse_root);
    // The first and the last of 2048 intervals, and slopes within an interval.
    EXPECT_NE(exact,
              hash_of_reciprocals([](float x) { return x < 1.00048f ? other(1 / x) : 1 / x; },
                                  inverse_root));
    EXPECT_NE(exact,
              hash_of_reciprocals([](float x) { return x > 1.99952f ? other(1 / x) : 1 / x; },
                                  inverse_root));
    EXPECT_NE(exact, hash_of_reciprocals(inverse, [](float x) {
                  const float y = inverse_root(x);
                  return x > 3.9991f ? other(y) : y;
              }));
    EXPECT_NE(exact, hash_of_reciprocals(inverse, [](float x) {
                  const float y = inverse_root(x), in_interval = x * 2048 - std::floor(x * 2048);
                  return x < 1.5f && in_interval > 0.25f && in_interval < 0.75f ? other(y) : y;
              }));
}

}  // namespace
}  // namespace etendue::test
