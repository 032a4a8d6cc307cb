#pragma once
// Points of primary sample space: 32-bit integers on a torus, by address, and their mutations, which are symmetric to the
// bit. A state is the numbers it reads. A number that a proposal reads and the present state did not is drawn afresh: all
// that were not read are independent and uniform, given the state, so none of their history matters.

#include <array>
#include <vector>

#include "pathspace/learned_state.h"
#include "sampler/sampler.h"

namespace etendue {

/// The numbers that one state has read.
class NumberTable {
public:
    void clear() { ++epoch_; }
    /// The number there, or nullptr where it has not been read.
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
    static constexpr uint32_t kSlots = 8;  ///< At most, of a vertex.
    struct Number {
        uint32_t bits = 0, epoch = 0;
    };
    struct Place {
        size_t table, index;
    };
    static Place place(Stream stream, uint64_t vertex, uint32_t slot);

    std::array<std::vector<Number>, 5> tables_;  ///< By stream; grown and kept.
    uint32_t epoch_ = 1;
};

/// Where the numbers of a state come from.
enum class NumberStep : uint8_t {
    Fresh,  ///< All are drawn.
    Small,  ///< Each moves by ±2^-13 … 2^-3, the exponent uniform; those of Stream::Selection stay.
    Block,  ///< Each vertex's numbers are drawn with probability kBlockProbability, or else stay.
    Same,   ///< All stay.
};

class NumberSource final : public PrimarySource {
public:
    static constexpr double kBlockProbability = 0.2;

    /// Numbers of a new state go to `next`, which is cleared; `present` may be nullptr where all are drawn.
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
