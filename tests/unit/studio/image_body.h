#pragma once

#include <cmath>
#include <cstdint>
#include <cstring>
#include <string>

#include "image/image.h"

namespace etendue::test {

/// A field of the head of an image as the page reads it, by its index.
inline uint32_t field_at(const std::string& body, size_t index) {
    uint32_t value = 0;
    std::memcpy(&value, body.data() + 4 + 4 * index, 4);
    return value;
}
/// A value behind the head, not scaled.
inline float half_at(const std::string& body, size_t index) {
    uint16_t bits = 0;
    std::memcpy(&bits, body.data() + 64 + 2 * index, 2);
    return float(Half(Half::FromBits, bits));
}
/// A value of the image, scaled by the exponent in its head.
inline float value_at(const std::string& body, size_t index) {
    return std::ldexp(half_at(body, index), int32_t(field_at(body, 9)));
}

}  // namespace etendue::test
