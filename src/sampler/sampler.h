#pragma once
// Random numbers by address. Every number belongs to (seed, pass, path, stream, vertex, slot); there is no hidden state, so
// an image does not depend on threads, and a walk that changes at vertex 3 leaves the numbers of vertex 4 alone.

#include <cstdint>

#include "math/hash.h"
#include "math/vec.h"

namespace etendue {

/// Which part of a sample the numbers are for.
enum class Stream : uint8_t {
    Eye,         ///< Film point, lens point and the eye sub-path's vertices.
    Light,       ///< Emission and the light sub-path's vertices.
    Connection,  ///< Next event and lens points of splats; vertex = that of the sub-path.
    Roulette,    ///< Whether a join is evaluated; vertex = join_number().
    Auxiliary,   ///< Loops of unbounded length.
    Selection,   ///< Which light vertices an eye vertex is connected to; vertex = its own.
};

enum class SamplerKind : uint8_t {
    Independent,  ///< Counter-based pseudo-random numbers.
    Sobol,  ///< Owen-scrambled Sobol' points over the passes, padded by dimension pairs [Burley 2020].
    PrimarySample,  ///< Numbers from a PrimarySource.
};

/// Number of the join of y_{s-1} and z_{t-1}; `draw` tells apart several of one vertex. Distinct for distinct arguments
/// with s < 2^16, t < 2^21, draw < 2^21.
constexpr uint64_t join_number(int s, int t, uint32_t draw = 0) {
    return uint64_t(draw) << 37 ^ uint64_t(uint32_t(t) >> 16) << 32 ^ uint64_t(uint32_t(s)) << 16 ^
           (uint32_t(t) & 0xffff);
}

/// Where a Markov chain keeps its point of primary sample space: 32 bits a number.
class PrimarySource {
public:
    virtual ~PrimarySource() = default;
    virtual uint32_t bits(Stream stream, uint64_t vertex, uint32_t slot) = 0;
};

class Sampler {
public:
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
    /// Moves to the block of numbers of one vertex, or of whatever else `vertex` counts, at its first slot.
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
    /// As next_1d() where the number matters; otherwise its slot is passed over.
    float next_1d_if(bool is_needed) {
        if (is_needed) return next_1d();
        ++slot_;
        return 0;
    }
    /// With 53 bits, for decisions that gain nothing from structured points: pseudo-random unless a Markov chain drives.
    double next_1d_unstructured() {
        return kind_ == SamplerKind::PrimarySample ? next_1d_fine() : to_unit_double(bits(key_));
    }
    /// As next_1d(), next_2d(), with 53 bits: 32 structured ones over pseudo-random ones.
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
    /// Vertices from here on do not fit into the address.
    static constexpr uint64_t kManyVertices = uint64_t(1) << 24;

    struct Vec2Bits {
        uint32_t x, y;
    };
    uint64_t address() const {
        return uint64_t(stream_) << 56 ^ (vertex_ & (kManyVertices - 1)) << 32 ^ slot_;
    }
    /// 64 bits of the present address; moves on by one slot.
    uint64_t bits(uint64_t key) {
        const uint64_t b = mix64(key + block_ + 0x9e3779b97f4a7c15ull * (address() + 1));
        ++slot_;
        return b;
    }
    /// Bits beyond those of the slot just read, which stay the same where a Markov chain leaves that number alone.
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
