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

}  // namespace
}  // namespace etendue::test
