#pragma once
// Random numbers by address. Every number is a function of (seed, pass, path, stream, vertex, slot), without hidden
// state. Therefore images do not depend on the number of threads, and a change at vertex 3 of a walk does not affect
// the numbers of vertex 4.

#include <cstdint>

#include "math/hash.h"
#include "math/vec.h"

namespace etendue {

/// The part of a sample that the numbers are used for.
enum class Stream : uint8_t {
    Eye,         ///< Film point, lens point and vertices of the eye sub-path.
    Light,       ///< Emission and vertices of the light sub-path.
    Connection,  ///< Points of next events and lens points of splats; `vertex` is that of the sub-path.
    Roulette,   ///< Russian roulette of joins; `vertex` is join_number().
    Auxiliary,  ///< Loops of unbounded length.
    Selection,  ///< Choice of the light vertices to which an eye vertex is connected; `vertex` is that of the eye path.
};

enum class SamplerKind : uint8_t {
    Independent,  ///< Counter-based pseudo-random numbers.
    Sobol,  ///< Owen-scrambled Sobol' points over the passes, padded in pairs of dimensions [Burley 2020].
    PrimarySample,  ///< Numbers from a PrimarySource.
};

/// Number of the join of y_{s-1} and z_{t-1}; `draw` distinguishes several joins of one vertex. Different arguments
/// with s < 2^16, t < 2^21, draw < 2^21 have different numbers.
constexpr uint64_t join_number(int s, int t, uint32_t draw = 0) {
    return uint64_t(draw) << 37 ^ uint64_t(uint32_t(t) >> 16) << 32 ^ uint64_t(uint32_t(s)) << 16 ^
           (uint32_t(t) & 0xffff);
}

/// The point of a Markov chain in primary sample space, 32 bits per coordinate.
class PrimarySource {
public:
    virtual ~PrimarySource() = default;
    virtual uint32_t bits(Stream stream, uint64_t vertex, uint32_t slot) = 0;
};

class Sampler {
public:
    /// Sobol' points are used for vertices with a smaller number; pseudo-random numbers from there on.
    static constexpr uint32_t kStructuredVertices = 4;

    Sampler(SamplerKind kind, uint64_t seed)
        : seed_(mix64(seed + 0x5851f42d4c957f2dull)), kind_(kind) {}
    explicit Sampler(PrimarySource& source) : source_(&source), kind_(SamplerKind::PrimarySample) {}

    /// Begins the sample `path` of pass `pass`.
    void start(uint32_t pass, uint64_t path) {
        pass_reversed_ = reverse_bits(pass);
        path_key_ = hash_combine(seed_, path);
        key_ = hash_combine(path_key_, pass);
    }
    /// Begins another path of the same pass.
    void start(uint64_t path) { start(reverse_bits(pass_reversed_), path); }
    /// Moves to slot 0 of the block of numbers of `vertex` (see Stream for what it counts).
    void seek(Stream stream, uint64_t vertex) {
        stream_ = stream;
        vertex_ = vertex;
        slot_ = 0;
        block_ = vertex < kManyVertices ? 0 : mix64(vertex / kManyVertices);
        is_structured_ = kind_ != SamplerKind::Independent &&
                         (kind_ == SamplerKind::PrimarySample || vertex < kStructuredVertices);
    }

    float next_1d() {
        return is_structured_ ? to_unit_float(next_bits_structured())
                              : to_unit_float(uint32_t(bits(key_) >> 32));
    }
    Vec2 next_2d() {
        const Vec2Bits b = next_2d_bits();
        return {to_unit_float(b.x), to_unit_float(b.y)};
    }
    /// next_1d() where `is_needed`; otherwise skips the slot and returns 0.
    float next_1d_if(bool is_needed) {
        if (is_needed) return next_1d();
        ++slot_;
        return 0;
    }
    /// next_2d() where `is_needed`; otherwise skips the slots and returns 0.
    Vec2 next_2d_if(bool is_needed) {
        if (is_needed) return next_2d();
        slot_ += kind_ == SamplerKind::PrimarySample ? 2 : 1;
        return {};
    }
    /// A number with 53 bits for decisions that do not benefit from Sobol' points: pseudo-random, or from the
    /// PrimarySource.
    double next_1d_unstructured() {
        return kind_ == SamplerKind::PrimarySample ? next_1d_fine() : to_unit_double(bits(key_));
    }
    /// next_1d() and next_2d() with 53 bits per number: 32 structured bits followed by pseudo-random ones.
    double next_1d_fine() {
        if (!is_structured_) return to_unit_double(bits(key_));
        const uint64_t high = next_bits_structured();
        return to_unit_double(high << 32 | low_bits() >> 32);
    }
    double next_1d_fine_if(bool is_needed) {
        if (is_needed) return next_1d_fine();
        ++slot_;
        return 0;
    }
    FinePoint next_2d_fine() {
        const Vec2Bits high = next_2d_bits();
        const uint64_t low = low_bits();
        return {to_unit_double(uint64_t(high.x) << 32 | low >> 32),
                to_unit_double(uint64_t(high.y) << 32 | uint32_t(low))};
    }
    SamplerKind kind() const { return kind_; }

private:
    /// Larger vertex numbers do not fit into address(); `block_` tells them apart.
    static constexpr uint64_t kManyVertices = uint64_t(1) << 24;

    struct Vec2Bits {
        uint32_t x, y;
    };
    uint64_t address() const {
        return uint64_t(stream_) << 56 ^ (vertex_ & (kManyVertices - 1)) << 32 ^ slot_;
    }
    /// 64 bits for the current address; moves to the next slot.
    uint64_t bits(uint64_t key) {
        const uint64_t b = mix64(key + block_ + 0x9e3779b97f4a7c15ull * (address() + 1));
        ++slot_;
        return b;
    }
    /// Low-order bits for the slot just read. They depend on the address only, so they stay the same while a Markov
    /// chain keeps that number.
    uint64_t low_bits() const {
        return mix64(~(key_ + block_) + 0x9e3779b97f4a7c15ull * address());
    }
    Vec2Bits next_2d_bits() {
        if (is_structured_) return next_2d_structured();
        const uint64_t b = bits(key_);
        return {uint32_t(b >> 32), uint32_t(b)};
    }
    uint32_t next_bits_structured();
    Vec2Bits next_2d_structured();

    uint64_t seed_ = 0;
    uint64_t path_key_ = 0, key_ = 0;  ///< Of the path; of the path in this pass.
    PrimarySource* source_ = nullptr;
    uint64_t vertex_ = 0, block_ = 0;
    uint32_t pass_reversed_ = 0, slot_ = 0;
    Stream stream_ = Stream::Eye;
    SamplerKind kind_;
    bool is_structured_ = false;
};

}  // namespace etendue
