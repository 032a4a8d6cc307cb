#pragma once

#include <gtest/gtest.h>

#include <cmath>

#include "color/rgb.h"

namespace etendue {

/// Each component within `tolerance` of the expected one, relative to that one's size.
inline void expect_near_relative(Rgb actual, Rgb expected, float tolerance) {
    for (int i = 0; i < 3; ++i)
        EXPECT_NEAR(actual[i], expected[i], tolerance * std::fabs(expected[i]))
            << "component " << i;
}

}  // namespace etendue
