#include "system/processor.h"

#include <bit>
#include <string_view>
#include <vector>

#if defined(__SSE__)
#include <xmmintrin.h>
#endif

#include "math/content_hash.h"

namespace etendue {

uint64_t hash_of_reciprocals(float (*inverse)(float), float (*inverse_root)(float)) {
    // The results follow the mantissa, and those of the root whether the exponent is even. On Intel processors they are
    // constant in 2^11 equal intervals. Others may interpolate, so that there are places within each interval.
    constexpr uint32_t kIntervals = 1 << 11, kLength = (1 << 23) / kIntervals;
    constexpr auto kOne = std::bit_cast<uint32_t>(1.0f), kTwo = std::bit_cast<uint32_t>(2.0f);
    constexpr uint32_t kPlaces[] = {0, 1234, 2777, kLength - 1};
    std::vector<float> results;
    results.reserve(3 * std::size(kPlaces) * kIntervals);
    for (uint32_t i = 0; i < kIntervals; ++i)
        for (const uint32_t place : kPlaces) {
            const uint32_t mantissa = i * kLength + place;
            const auto one = std::bit_cast<float>(kOne | mantissa),
                       two = std::bit_cast<float>(kTwo | mantissa);
            results.insert(results.end(), {inverse(one), inverse_root(one), inverse_root(two)});
        }
    return ContentHash()
        .add(std::string_view(reinterpret_cast<const char*>(results.data()),
                              results.size() * sizeof results[0]))
        .value();
}

uint64_t reciprocals_of_processor() {
#if defined(__SSE__)
    return hash_of_reciprocals([](float x) { return _mm_cvtss_f32(_mm_rcp_ss(_mm_set_ss(x))); },
                               [](float x) { return _mm_cvtss_f32(_mm_rsqrt_ss(_mm_set_ss(x))); });
#else
    return 0;
#endif
}

}  // namespace etendue
