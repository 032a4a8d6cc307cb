#include "pathspace/technique.h"

#include <algorithm>
#include <cmath>

namespace etendue {
namespace {

constexpr double kLevelsPerOctave = 16;

}  // namespace

const std::array<float, 256> kPairShares = [] {
    std::array<float, 256> shares{};
    for (size_t level = 0; level < shares.size(); ++level)
        shares[level] = float(std::exp2(-double(level) / kLevelsPerOctave));
    return shares;
}();

uint8_t pair_level_of_share(double share) {
    return uint8_t(std::min(255.0, std::round(-kLevelsPerOctave * std::log2(share))));
}

}  // namespace etendue
