#include "reuse/merge_kernel.h"

#include <gtest/gtest.h>

namespace etendue {
namespace {

// Midpoint sums over the squared distance.
TEST(MergeKernel, HasTheIntegralAndTheVarianceOfADisc) {
    constexpr float r = 0.3f;
    constexpr int kSteps = 1 << 16;
    const double step = 2 * double(r) * double(r) / kSteps;
    double integral = 0, of_square = 0, distance2 = 0;
    for (int i = 0; i < kSteps; ++i) {
        const double d2 = (i + 0.5) * step, w = double(MergeKernel::weight(float(d2), r));
        integral += w * step;
        of_square += w * w * step;
        distance2 += d2 * w * step;
    }
    const double disc = double(r) * double(r);
    EXPECT_NEAR(integral / disc, 1, 1e-4);
    EXPECT_NEAR(of_square / disc, 1, 1e-4);
    EXPECT_NEAR(distance2 / (disc * disc), 0.461, 1e-3);
}

TEST(MergeKernel, EndsAtItsReach) {
    constexpr float r = 2, reach = MergeKernel::kReach * r;
    EXPECT_GT(MergeKernel::weight(0.999f * reach * reach, r), 0.6f);
    EXPECT_EQ(MergeKernel::weight(1.001f * reach * reach, r), 0.0f);
}

}  // namespace
}  // namespace etendue
