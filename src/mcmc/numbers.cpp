#include "mcmc/numbers.h"

#include <cmath>
#include <stdexcept>

namespace etendue {
namespace {

/// Joins to the lens are numbered from here on in Stream::Connection.
constexpr uint64_t kLensVertex = 0x8000;

uint64_t hash_address(uint64_t key, Stream stream, uint64_t vertex, uint32_t slot) {
    return hash_combine(key, uint64_t(stream) << 56 ^ vertex << 8 ^ slot);
}

/// `bits` moved up or down, with the same probability.
uint32_t moved(uint32_t bits, uint64_t random) {
    constexpr double kSmallest = -13, kLargest = -5;
    const double exponent = kSmallest + (kLargest - kSmallest) * to_unit_double(random);
    const auto distance = uint32_t(std::exp2(32 + exponent));
    return random & 1 ? bits + distance : bits - distance;
}

}  // namespace

NumberTable::Place NumberTable::place(Stream stream, uint64_t vertex, uint32_t slot) {
    if (slot >= kSlots) throw std::logic_error("Markov chain: too many numbers at a vertex");
    const bool at_lens = stream == Stream::Connection && vertex >= kLensVertex;
    const uint64_t v = at_lens ? vertex - kLensVertex : vertex;
    const size_t table = stream == Stream::Eye          ? 0
                         : stream == Stream::Light      ? 1
                         : stream != Stream::Connection ? 4
                         : at_lens                      ? 3
                                                        : 2;
    return {table, size_t(v) * kSlots + slot};
}

const uint32_t* NumberTable::find(Stream stream, uint64_t vertex, uint32_t slot) const {
    const Place p = place(stream, vertex, slot);
    const std::vector<Number>& table = tables_[p.table];
    return p.index < table.size() && table[p.index].epoch == epoch_ ? &table[p.index].bits
                                                                    : nullptr;
}

void NumberTable::set(Stream stream, uint64_t vertex, uint32_t slot, uint32_t bits) {
    const Place p = place(stream, vertex, slot);
    std::vector<Number>& table = tables_[p.table];
    if (p.index >= table.size()) table.resize((p.index / kSlots + 4) * kSlots);
    table[p.index] = {bits, epoch_};
}

uint32_t NumberSource::bits(Stream stream, uint64_t vertex, uint32_t slot) {
    if (next_)
        if (const uint32_t* known = next_->find(stream, vertex, slot)) return *known;
    const uint32_t* old =
        step_ == NumberStep::Fresh ? nullptr : present_->find(stream, vertex, slot);
    const auto fresh = [&] { return uint32_t(hash_address(key_, stream, vertex, slot) >> 32); };
    const auto redraws_block = [&] {
        // The decision for the whole block uses a slot that no vertex has.
        return to_unit_double(hash_address(key_, stream, vertex, 0xff)) < kBlockProbability;
    };
    uint32_t bits;
    if (!old)
        bits = fresh();
    else if (step_ == NumberStep::Small && stream != Stream::Selection)
        bits = moved(*old, hash_address(key_, stream, vertex, slot));
    else if (step_ == NumberStep::Block && redraws_block())
        bits = fresh();
    else
        bits = *old;
    if (next_) next_->set(stream, vertex, slot, bits);
    return bits;
}

}  // namespace etendue
