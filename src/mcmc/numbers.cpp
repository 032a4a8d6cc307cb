#include "mcmc/numbers.h"

#include <stdexcept>

namespace etendue {
namespace {

uint64_t hash_address(uint64_t key, Stream stream, uint64_t vertex, uint32_t slot) {
    return hash_combine(key, uint64_t(stream) << 56 ^ vertex << 8 ^ slot);
}

/// `bits` moved up or down, with the same probability, by a distance from 2^smallest to 2^end. All powers of two in between
/// are equally likely, and the distance is uniform between two of them.
uint32_t moved(uint32_t bits, uint64_t random, uint32_t smallest, uint32_t end) {
    const uint32_t octave = smallest + uint32_t((random >> 32) * (end - smallest) >> 32);
    const uint32_t distance = 1u << octave | (uint32_t(random) >> (32 - octave));
    return random & 1 ? bits + distance : bits - distance;
}

bool is_film_point(Stream stream, uint64_t vertex, uint32_t slot) {
    return stream == Stream::Eye && vertex == 0 && slot < 2;
}

}  // namespace

void NumberTable::throw_too_many() {
    throw std::logic_error("Markov chain: too many numbers at a vertex");
}

void NumberTable::forget_all() {
    for (auto& table : tables_) table.clear();
    ++epoch_;
}

inline uint32_t NumberSource::draw(Stream stream, uint64_t vertex, uint32_t slot,
                                   NumberTable::Place place) const {
    const uint64_t random = hash_address(key_, stream, vertex, slot);
    const auto fresh = uint32_t(random >> 32);
    if (step_ == NumberStep::Fresh) return fresh;
    const uint32_t* old = present_->find(place);
    if (!old) return fresh;
    if (stream != Stream::Selection) {
        if (step_ == NumberStep::Small)
            return moved(*old, random, is_film_point(stream, vertex, slot) ? 22 : 16, 26);
        if (step_ == NumberStep::Wide) return moved(*old, random, 19, 27);
    }
    if (step_ == NumberStep::Block) {
        // The decision for the whole block uses a slot that no vertex has.
        const uint64_t decision = hash_address(key_, stream, vertex, 0xff);
        if (to_unit_double(decision) < kBlockProbability) return fresh;
    }
    return *old;
}

uint32_t NumberSource::bits(Stream stream, uint64_t vertex, uint32_t slot) {
    if (stream == Stream::Roulette && (vertex != 0 || slot != 0))
        return bits(Stream::Roulette, 0, 0) + uint32_t(hash_address(0, stream, vertex, slot) >> 32);
    const NumberTable::Place place = NumberTable::place(stream, vertex, slot);
    if (!next_) return draw(stream, vertex, slot, place);
    NumberTable::Number& number = next_->at(place);
    if (!next_->has(number)) next_->set(number, draw(stream, vertex, slot, place));
    return number.bits;
}

}  // namespace etendue
