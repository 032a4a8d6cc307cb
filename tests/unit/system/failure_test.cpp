// Failures have a text, whatever was thrown.

#include "system/failure.h"

#include <stdexcept>

#include <gtest/gtest.h>

namespace etendue::test {
namespace {

TEST(Failure, IsNeverEmpty) {
    EXPECT_EQ(failure_of([] { throw std::runtime_error("why"); }), "why");
    EXPECT_EQ(failure_of([] { throw std::bad_alloc(); }), "not enough memory");
    EXPECT_EQ(failure_of([] { throw std::runtime_error(""); }), "a failure without a name");
    EXPECT_EQ(failure_of([] { throw 1; }), "a failure without a name");
    EXPECT_EQ(failure_of([] {}), "");
}

}  // namespace
}  // namespace etendue::test
