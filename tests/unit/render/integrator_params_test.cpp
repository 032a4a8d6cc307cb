#include "integrator/integrator.h"

#include <gtest/gtest.h>

#include "error_of.h"

namespace etendue {
namespace {

std::string error_of_spec(const std::string& spec) {
    return test::error_of([&] { make_integrator(IntegratorSpec::parse(spec)); });
}

TEST(IntegratorParams, NumbersAreFinite) {
    for (const char* name : {"vcm", "upg", "ppm", "sppm"})
        for (const char* value : {"nan", "inf", "-inf", "1e39", "x"})
            EXPECT_EQ(error_of_spec(std::string(name) + ":radius=" + value),
                      "integrator \"" + std::string(name) +
                          "\": parameter \"radius\" must be a finite number, but is \"" + value +
                          "\"");
    EXPECT_EQ(error_of_spec("vcm:radius=0.1"), "");
}

TEST(IntegratorParams, RouletteMustEndWalks) {
    for (const char* name : {"path", "light", "bdpt", "upg", "pcbpt"}) {
        const std::string spec = std::string(name) + ":rr_depth=1000000";
        EXPECT_EQ(error_of_spec(spec),
                  "rr_depth is 1000000, but must be at most 1000, unless max_depth is: paths in a "
                  "closed room would not end");
        EXPECT_EQ(error_of_spec(spec + ",max_depth=1000"), "");
        EXPECT_EQ(error_of_spec(std::string(name) + ":rr_depth=1000"), "");
    }
}

}  // namespace
}  // namespace etendue
