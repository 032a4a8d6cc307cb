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
    Roulette,    ///< Whether a join is evaluated; vertex = 2^16·s + t.
    Auxiliary,   ///< Loops of unbounded length.
    Selection,   ///< Which light vertices an eye vertex is connected to; vertex = its own.
};

enum class SamplerKind : uint8_t {
    Independent,  ///< Counter-based pseudo-random numbers.
    Sobol,  ///< Owen-scrambled Sobol' points over the passes, padded by dimension pairs [Burley 2020].
    PrimarySample,  ///< Numbers from a PrimarySource.
};

/// Where a Markov chain keeps its point of primary sample space. Values lie in [0, 1).
class PrimarySource {
public:
    virtual ~PrimarySource() = default;
    virtual float value(Stream stream, uint32_t vertex, uint32_t slot) = 0;
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
    /// Moves to the block of numbers of one vertex, at its first slot.
    void seek(Stream stream, uint32_t vertex) {
        stream_ = stream;
        vertex_ = vertex;
        slot_ = 0;
        is_structured_ = kind_ != SamplerKind::Independent &&
                         (kind_ == SamplerKind::PrimarySample || vertex < kStructuredVertices);
    }

    float next_1d() {
        return is_structured_ ? next_1d_structured() : to_unit_float(uint32_t(bits(key_) >> 32));
    }
    Vec2 next_2d() {
        if (is_structured_) return next_2d_structured();
        const uint64_t b = bits(key_);
        return {to_unit_float(uint32_t(b >> 32)), to_unit_float(uint32_t(b))};
    }
    /// As next_1d() where the number matters; otherwise its slot is passed over.
    float next_1d_if(bool is_needed) {
        if (is_needed) return next_1d();
        ++slot_;
        return 0;
    }
    /// As next_1d(), for decisions that gain nothing from structured points: pseudo-random unless a Markov chain drives.
    float next_1d_unstructured() {
        if (kind_ == SamplerKind::PrimarySample) return next_1d_structured();
        return to_unit_float(uint32_t(bits(key_) >> 32));
    }
    /// The same with 48 bits, from two slots.
    double next_1d_fine() {
        const double high = double(next_1d_unstructured());
        return high + 0x1p-24 * double(next_1d_unstructured());
    }
    SamplerKind kind() const { return kind_; }

private:
    /// 64 bits of the present address; moves on by one slot.
    uint64_t bits(uint64_t key) {
        const uint64_t address = uint64_t(stream_) << 56 ^ uint64_t(vertex_) << 32 ^ slot_++;
        return mix64(key + 0x9e3779b97f4a7c15ull * (address + 1));
    }
    float next_1d_structured();
    Vec2 next_2d_structured();

    uint64_t seed_ = 0;
    uint64_t path_key_ = 0, key_ = 0;  ///< Of the path; of the path in this pass.
    PrimarySource* source_ = nullptr;
    uint32_t pass_reversed_ = 0, vertex_ = 0, slot_ = 0;
    Stream stream_ = Stream::Eye;
    SamplerKind kind_;
    bool is_structured_ = false;
};

}  // namespace etendue
