#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>
#include <vector>

namespace etendue {

/// Numbers distinct keys in the order of first use; open addressing, at most half full. `Hash` makes 64 bits of a key.
template <class Key, class Hash>
class KeyTable {
public:
    uint32_t index_of(const Key& key) {
        if (2 * keys_.size() >= slots_.size()) grow();
        uint32_t& slot = find(key);
        if (slot == kNone) {
            slot = uint32_t(keys_.size());
            keys_.push_back(key);
        }
        return slot;
    }
    const std::vector<Key>& keys() const { return keys_; }

private:
    static constexpr uint32_t kNone = std::numeric_limits<uint32_t>::max();

    uint32_t& find(const Key& key) {
        const size_t mask = slots_.size() - 1;
        for (size_t i = size_t(Hash()(key)) & mask;; i = (i + 1) & mask)
            if (slots_[i] == kNone || keys_[slots_[i]] == key) return slots_[i];
    }
    void grow() {
        slots_.assign(std::max<size_t>(1024, 4 * slots_.size()), kNone);
        for (uint32_t i = 0; i < keys_.size(); ++i) find(keys_[i]) = i;
    }

    std::vector<uint32_t> slots_;
    std::vector<Key> keys_;
};

}  // namespace etendue
