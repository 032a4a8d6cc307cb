#pragma once
// Methods with all kinds of state that later passes depend on.

#include <algorithm>
#include <cctype>
#include <cstdint>
#include <cstdlib>
#include <string>
#include <string_view>
#include <vector>

#include <gtest/gtest.h>

#include "math/vec.h"

namespace etendue::test {

inline const std::vector<const char*>& resumable_methods() {
    static const std::vector<const char*> methods{
        "path",
        "path:guide=on,guide_roulette=false,guide_walks=8000",
        "path:specular_connections=on",
        "light",
        "light:guide=on,guide_walks=2000",
        "bdpt",
        "bdpt:eorr=true",
        "bdpt:specular_connections=auto",
        "bdpt:guide=on,guide_walks=2000",
        "vcm:radius=0.3",
        "vcm:exact=true",
        "vcm:eorr=true,radius=0.3",
        "vcm:guide=on,guide_walks=2000",
        "upg",
        "upg:eorr=true",
        "upg:guide=on,guide_walks=2000",
        "upg+bdpt",
        "upg+bdpt:guide=on,guide_walks=8000",
        "sppm",
        "sppm:eorr=true",
        "ppm:eorr=true,eye_paths=3",
        "pcbpt",
        "pcbpt:eorr=true",
        "pcbpt:guide=on,guide_walks=2000",
        "pssmlt:groups=2,chains=16",
        "pssmlt:groups=2,chains=16,guide=on,guide_walks=2000",
        "mmlt:groups=4,chains=48",
        "mmlt:groups=4,chains=48,guide=on,guide_walks=2000",
        "mlt:groups=4,chains=48",
        "mlt:groups=4,chains=48,guide=on,guide_walks=2000",
        "upg+pssmlt:groups=2,chains=16",
        "pm:light_paths=2000",
        "pm:eorr=true,light_paths=2000",
        "pm:light_paths=2000,cache_error=0.3,cache_rays=32",
        "mps:mutations=2000,precision=0.2",
        "mps:eorr=true,mutations=2000,precision=0.2",
        "mps:mutations=500,precision=0.2,retrace=true",
        "mps:target=path,mutations=500,precision=0.2",
        "mps:target=path,mutations=500,precision=0.2,retrace=true",
    };
    return methods;
}

/// Number of the walks that train a method's guide; 0 if it has none.
inline uint32_t guide_walks(std::string_view method) {
    constexpr std::string_view kWalks = "guide_walks=";
    const size_t at = method.find(kWalks);
    return at == std::string_view::npos ? 0 : uint32_t(std::atoi(&method[at + kWalks.size()]));
}

/// Width and height of an image for a test of one of them: with a guide, so many pixels that few passes come before a refit.
inline int image_size(std::string_view method) {
    return guide_walks(method) > 0 ? 36 : 24;
}

/// The first pass of such an image before which a method refits its guide: there are at least eight times as many samples as
/// walks, and integrators learn. 0 if it has no guide.
inline uint32_t refit_pass(std::string_view method) {
    const uint32_t walks = guide_walks(method), pixels = uint32_t(sqr(image_size(method)));
    if (walks == 0) return 0;
    uint32_t pass = 1;
    while (pass * pixels < 8 * walks) pass *= 4;
    return pass;
}

/// Name of a test of one of them.
inline std::string name_of_method(const ::testing::TestParamInfo<const char*>& p) {
    std::string name = p.param;
    std::replace_if(
        name.begin(), name.end(), [](unsigned char c) { return !std::isalnum(c); }, '_');
    return name;
}

}  // namespace etendue::test
