#pragma once
// Gloss of a vertex, in six bits for cached vertices: of the two end points of a gathered pair, the one sampled from
// the glossier vertex is kept [Qin et al. 2015, appendix B].

#include <cstdint>

#include "pathspace/technique.h"

namespace etendue {

inline constexpr uint8_t kSharpestGloss = 59;  ///< Of a smooth lobe.
inline constexpr uint8_t kPointGloss = 60;     ///< A point emitter, or one at infinity.
inline constexpr uint8_t kDeltaGloss = 61;     ///< A delta event: it cannot be sampled again.
inline constexpr uint8_t kLensGloss = 62;

inline uint8_t gloss_of_roughness(float roughness) {
    const float gloss = 1 - roughness;
    return gloss > 0 ? uint8_t(gloss * kSharpestGloss) : uint8_t(0);
}
/// An area emitter is like a diffuse surface.
inline uint8_t gloss_of_emitter(bool is_area) {
    return is_area ? uint8_t(0) : kPointGloss;
}

/// Whether z_{t-1} (`eye`) or y_{s-1} of a pair at x_m is dropped, from the gloss of x_{m-1} and x_{m+1}.
inline bool drops(PairRule rule, bool eye, uint8_t before, uint8_t after) {
    if ((eye ? after : before) >= kDeltaGloss) return false;
    if ((eye ? before : after) >= kDeltaGloss) return true;
    switch (rule) {
    case PairRule::Gloss: return eye == (after <= before);
    case PairRule::Eye: return eye;
    case PairRule::Light: return !eye;
    case PairRule::Both: break;
    }
    return true;
}

}  // namespace etendue
