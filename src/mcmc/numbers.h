#pragma once
// Points of primary sample space: 32-bit integers on a torus, identified by address, and their mutations, which are exactly
// symmetric. A state consists of the numbers that it reads. A number that a proposal reads, but the present state did not
// read, is drawn anew: given the state, the numbers that were not read are independent and uniform, so their history does
// not matter.

#include <array>
#include <vector>

#include "pathspace/learned_state.h"
#include "sampler/sampler.h"

namespace etendue {

/// The numbers that one state has read.
class NumberTable {
public:
    void clear() { ++epoch_; }
    /// The number at this address, or nullptr if it has not been read.
    const uint32_t* find(Stream stream, uint64_t vertex, uint32_t slot) const;
    void set(Stream stream, uint64_t vertex, uint32_t slot, uint32_t bits);
    void save(LearnedState& to) const {
        to.put(epoch_);
        for (const auto& table : tables_) to.put(table);
    }
    void load(LearnedState& from) {
        from.get(epoch_);
        for (auto& table : tables_) from.get(table);
    }

private:
    static constexpr uint32_t kSlots = 8;  ///< Largest number of slots of a vertex.
    struct Number {
        uint32_t bits = 0, epoch = 0;
    };
    struct Place {
        size_t table, index;
    };
    static Place place(Stream stream, uint64_t vertex, uint32_t slot);

    std::array<std::vector<Number>, 5> tables_;  ///< By stream; they never shrink.
    uint32_t epoch_ = 1;
};

/// Where the numbers of a state come from.
enum class NumberStep : uint8_t {
    Fresh,  ///< All numbers are drawn anew.
    Small,  ///< Each changes by ±2^-13 … 2^-5, with a uniform exponent, except those of Stream::Selection.
    Block,  ///< The numbers of each vertex are drawn anew with probability kBlockProbability, and otherwise kept.
    Same,   ///< All numbers are kept.
};

class NumberSource final : public PrimarySource {
public:
    static constexpr double kBlockProbability = 0.2;

    /// Clears `next` and stores the numbers of the new state there. `present` may be nullptr if all numbers are drawn anew.
    NumberSource(NumberStep step, uint64_t key, const NumberTable* present, NumberTable* next)
        : step_(step), key_(key), present_(present), next_(next) {
        if (next_) next_->clear();
    }
    uint32_t bits(Stream stream, uint64_t vertex, uint32_t slot) override;

private:
    NumberStep step_;
    uint64_t key_;
    const NumberTable* present_;
    NumberTable* next_;
};

}  // namespace etendue
