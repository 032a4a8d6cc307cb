#include "integrator/integrator.h"

#include <fmt/format.h>
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

/// Otherwise areas of discs would be 0 or infinite.
TEST(IntegratorParams, RadiiHaveSquares) {
    for (const char* name : {"vcm", "sppm", "ppm", "upg", "upg+bdpt", "upg+pssmlt", "pm"})
        for (const char* value : {"-1", "1e-16", "1e16", "1e-40"})
            EXPECT_EQ(error_of_spec(std::string(name) + ":radius=" + value),
                      std::string(name) + ": radius must be 0 or lie in [1e-15, 1e+15], but is " +
                          fmt::format("{:g}", float(std::stod(value))));
    for (const char* value : {"0", "1e-15", "1e15"})
        EXPECT_EQ(error_of_spec(std::string("upg+bdpt:radius=") + value), "");
}

/// Methods without the parameter rr_depth have no roulette.
TEST(IntegratorParams, DepthsAreThoseOfTheMethod) {
    const auto depth = [](const char* spec) {
        const IntegratorSpec s = IntegratorSpec::parse(spec);
        return DepthOptions::from(IntegratorParams(s, integrator_entry(s.name).info));
    };
    for (const char* spec : {"mmlt:max_depth=7", "mlt:max_depth=7"}) {
        EXPECT_EQ(depth(spec).max_depth, 7);
        EXPECT_EQ(depth(spec).rr_depth, DepthOptions::kUnlimited);
        EXPECT_FALSE(depth(spec).has_roulette);
        EXPECT_FALSE(depth(spec).walk().has_roulette);
    }
    EXPECT_EQ(depth("pssmlt:rr_depth=4").rr_depth, 4);
    EXPECT_TRUE(depth("pssmlt").walk().has_roulette);
    EXPECT_EQ(depth("path").max_depth, DepthOptions::kUnlimited);
}

/// No samples are made that a guide could lead.
TEST(IntegratorParams, UserPathsAndAGuideExcludeEachOther) {
    for (const char* guide : {"on", "auto"})
        EXPECT_EQ(error_of_spec(std::string("mlt:user_paths=a.json,guide=") + guide),
                  "mlt: with user_paths no samples are made that a guide could lead; leave out "
                  "user_paths or guide");
    EXPECT_EQ(error_of_spec("mlt:user_paths=a.json,guide=off"), "");
}

/// Files may have any name.
TEST(IntegratorSpec, TextsHaveAnyValues) {
    for (const char* value : {"", "a,b.json", ",", "a\\,b", "\\", "a\\\\", "a=b,max_depth=3"}) {
        const IntegratorSpec spec{"mlt", {{"max_depth", "5"}, {"user_paths", value}, {"z", "1"}}};
        const IntegratorSpec read = IntegratorSpec::parse(spec.to_string());
        EXPECT_EQ(read.params, spec.params) << spec.to_string();
    }
    EXPECT_EQ(IntegratorSpec::parse("mlt:user_paths=a\\b").params.at("user_paths"), "a\\b");
    EXPECT_EQ(IntegratorSpec::parse("mlt:").params.size(), 0u);
    EXPECT_EQ(IntegratorSpec::parse("mlt:max_depth=3,").params.size(), 1u);
    EXPECT_NE(error_of_spec("mlt:max_depth=").find("\"max_depth\" must be"), std::string::npos);
    EXPECT_NE(error_of_spec("mlt:,max_depth=3").find("expected name=value"), std::string::npos);
    EXPECT_NE(error_of_spec("mlt:=3").find("expected name=value"), std::string::npos);
    EXPECT_NE(error_of_spec("mlt:max_depth").find("expected name=value"), std::string::npos);
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
