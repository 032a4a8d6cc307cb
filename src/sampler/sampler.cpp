#include "sampler/sampler.h"

#include <array>

namespace etendue {
namespace {

/// Owen scrambling of an integer in reversed bit order: a hash in which each bit depends on itself and on lower bits
/// only [Laine & Karras 2011; constants of Vegdahl 2021].
constexpr uint32_t scramble_reversed(uint32_t x, uint32_t seed) {
    x ^= x * 0x3d20adeau;
    x += seed;
    x *= (seed >> 16) | 1u;
    x ^= x * 0x05526c56u;
    x ^= x * 0x53a22864u;
    return x;
}

/// Second dimension of the Sobol' sequence in reversed bit order, tabulated by the bytes of the index. Its generator
/// matrix has the columns v, v ^ v >> 1, ... (Pascal's matrix mod 2). The first dimension in reversed bit order is the
/// index itself.
constexpr auto kSecondReversed = [] {
    std::array<std::array<uint32_t, 256>, 4> table{};
    std::array<uint32_t, 32> columns{};
    uint32_t v = 1u << 31;
    for (uint32_t& c : columns) {
        c = reverse_bits(v);
        v ^= v >> 1;
    }
    for (uint32_t byte = 0; byte < 4; ++byte)
        for (uint32_t value = 0; value < 256; ++value)
            for (uint32_t bit = 0; bit < 8; ++bit)
                if (value >> bit & 1) table[byte][value] ^= columns[byte * 8 + bit];
    return table;
}();

constexpr uint32_t second_reversed(uint32_t i) {
    return kSecondReversed[0][i & 255] ^ kSecondReversed[1][i >> 8 & 255] ^
           kSecondReversed[2][i >> 16 & 255] ^ kSecondReversed[3][i >> 24];
}

}  // namespace

uint32_t Sampler::next_bits_structured() {
    if (kind_ == SamplerKind::PrimarySample) return source_->bits(stream_, vertex_, slot_++);
    const uint64_t seed = bits(path_key_);
    const uint32_t index = reverse_bits(scramble_reversed(pass_reversed_, uint32_t(seed)));
    return reverse_bits(scramble_reversed(index, uint32_t(mix64(seed))));
}

Sampler::Vec2Bits Sampler::next_2d_structured() {
    if (kind_ == SamplerKind::PrimarySample) {
        const uint32_t slot = slot_;
        slot_ += 2;
        return {source_->bits(stream_, vertex_, slot), source_->bits(stream_, vertex_, slot + 1)};
    }
    // Every pair of dimensions takes the same two-dimensional sequence over the passes, in its own order and with its
    // own scrambling [Burley 2020].
    const uint64_t seed = bits(path_key_), scramble = mix64(seed);
    const uint32_t index = reverse_bits(scramble_reversed(pass_reversed_, uint32_t(seed)));
    const uint32_t x = scramble_reversed(index, uint32_t(scramble));
    const uint32_t y = scramble_reversed(second_reversed(index), uint32_t(scramble >> 32));
    const uint64_t both = reverse_bits(uint64_t{y} << 32 | x);
    return {uint32_t(both >> 32), uint32_t(both)};
}

}  // namespace etendue
