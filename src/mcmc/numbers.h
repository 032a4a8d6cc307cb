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
    static constexpr uint32_t kNever = 0;  ///< Epoch of numbers that no state has read.

public:
    void clear() {
        if (++epoch_ == kNever) forget_all();
    }
    struct Number {
        uint32_t bits = 0, epoch = kNever;
    };
    /// Where the number at an address is, in any table.
    struct Place {
        size_t table, index;
    };
    static Place place(Stream stream, uint64_t vertex, uint32_t slot) {
        if (slot >= kSlots) throw_too_many();
        const bool at_lens = stream == Stream::Connection && vertex >= kLensVertex;
        const size_t v = size_t(at_lens ? vertex - kLensVertex : vertex);
        return {at_lens ? kStreams : size_t(stream), v * kSlots + slot};
    }
    /// The number at this place, or nullptr if it has not been read.
    const uint32_t* find(Place p) const {
        const std::vector<Number>& table = tables_[p.table];
        return p.index < table.size() && table[p.index].epoch == epoch_ ? &table[p.index].bits
                                                                        : nullptr;
    }
    Number& at(Place p) {
        std::vector<Number>& table = tables_[p.table];
        if (p.index >= table.size()) table.resize((p.index / kSlots + 4) * kSlots);
        return table[p.index];
    }
    bool has(const Number& number) const { return number.epoch == epoch_; }
    void set(Number& number, uint32_t bits) { number = {bits, epoch_}; }
    void set(Place p, uint32_t bits) { set(at(p), bits); }
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
    static constexpr size_t kStreams = size_t(Stream::Selection) + 1;
    /// Joins to the lens are numbered from here on in Stream::Connection.
    static constexpr uint64_t kLensVertex = 0x8000;
    [[noreturn]] static void throw_too_many();
    /// Once all epochs were used: numbers of the first ones would be taken for those of the next.
    void forget_all();

    /// By stream, and those of joins to the lens.
    std::array<std::vector<Number>, kStreams + 1> tables_;
    uint32_t epoch_ = 1;
};

/// Where the numbers of a state come from.
enum class NumberStep : uint8_t {
    Fresh,  ///< All numbers are drawn anew.
    /// Each changes by ±2^-16 … 2^-6, those of the film point by ±2^-10 … 2^-6, with about uniform exponents. Those of
    /// Stream::Selection are kept.
    Small,
    Wide,   ///< The same with ±2^-13 … 2^-5 for all numbers.
    Block,  ///< The numbers of each vertex are drawn anew with probability kBlockProbability, and otherwise kept.
    Same,   ///< All numbers are kept.
};

/// All numbers of Stream::Roulette are one coordinate, rotated by a hash of the address: there are too many joins for a
/// coordinate each.
class NumberSource final : public PrimarySource {
public:
    static constexpr double kBlockProbability = 0.2;

    /// Clears `next` and stores the numbers of the new state there. `present` may be nullptr if all numbers are drawn anew.
    NumberSource(NumberStep step, uint64_t key, const NumberTable* present, NumberTable* next)
        : step_(step), key_(key), present_(present), next_(next) {
        if (next_) next_->clear();
    }
    uint32_t bits(Stream stream, uint64_t vertex, uint32_t slot) override;
    uint64_t key() const { return key_; }

private:
    uint32_t draw(Stream stream, uint64_t vertex, uint32_t slot, NumberTable::Place place) const;

    NumberStep step_;
    uint64_t key_;
    const NumberTable* present_;
    NumberTable* next_;
};

}  // namespace etendue
