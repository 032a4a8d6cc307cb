// What users ask for by name.

#include "render/render_request.h"

#include <gtest/gtest.h>

#include "error_of.h"

namespace etendue::test {
namespace {

TEST(RenderRequest, NamesAreReadAsTheyAreWritten) {
    for (const SamplerKind kind : {SamplerKind::Independent, SamplerKind::Sobol})
        EXPECT_EQ(sampler_named(to_string(kind), "sampler"), kind);
    for (const FilterMode mode : {FilterMode::Spread, FilterMode::Sample})
        EXPECT_EQ(filter_mode_named(to_string(mode), "filter_mode"), mode);
}

TEST(RenderRequest, OtherNamesAreRefusedWithTheNearest) {
    EXPECT_EQ(error_of<std::invalid_argument>([] { sampler_named("sobl", "--sampler"); }),
              "--sampler must be independent or sobol, but is \"sobl\"; did you mean \"sobol\"?");
    EXPECT_EQ(error_of<std::invalid_argument>([] { sampler_named("halton", "sampler"); }),
              "sampler must be independent or sobol, but is \"halton\"");
    EXPECT_EQ(error_of<std::invalid_argument>([] { filter_mode_named("Spread", "filter_mode"); }),
              "filter_mode must be spread or sample, but is \"Spread\"; did you mean \"spread\"?");
}

/// A new option that is not passed on is a difference here.
TEST(RenderRequest, AllOfItIsInTheSettings) {
    RenderRequest request;
    request.spp = 3;
    request.seconds = 4;
    request.error = 0.5;
    request.sampler = SamplerKind::Independent;
    request.filter_mode = FilterMode::Sample;
    request.seed = 5;
    request.first_pass = 6;
    request.threads = 7;
    request.technique_depth = 8;
    const RenderSettings s = settings_of(request, IntegratorSpec::parse("bdpt:max_depth=9"));
    EXPECT_EQ(s.spp, 3u);
    EXPECT_EQ(s.seconds, 4);
    EXPECT_EQ(s.error, 0.5);
    EXPECT_EQ(s.integrator.to_string(), "bdpt:max_depth=9");
    EXPECT_EQ(s.sampler, SamplerKind::Independent);
    EXPECT_EQ(s.filter_mode, FilterMode::Sample);
    EXPECT_EQ(s.seed, 5u);
    EXPECT_EQ(s.first_pass, 6u);
    EXPECT_EQ(s.threads, 7);
    EXPECT_EQ(s.technique_depth, 8);
}

}  // namespace
}  // namespace etendue::test
