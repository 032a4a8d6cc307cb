#include "math/content_hash.h"

#define XXH_INLINE_ALL
#include <xxhash.h>

namespace etendue {

struct ContentHash::State {
    XXH3_state_t xxh;
};

ContentHash::ContentHash() : state_(std::make_unique<State>()) {
    XXH3_64bits_reset(&state_->xxh);
}
ContentHash::~ContentHash() = default;
ContentHash::ContentHash(ContentHash&&) noexcept = default;
ContentHash& ContentHash::operator=(ContentHash&&) noexcept = default;

ContentHash& ContentHash::add(std::string_view bytes) {
    return add(uint64_t(bytes.size())).add_piece(bytes);
}

ContentHash& ContentHash::add_piece(std::string_view bytes) {
    XXH3_64bits_update(&state_->xxh, bytes.data(), bytes.size());
    return *this;
}

ContentHash& ContentHash::add(uint64_t number) {
    XXH3_64bits_update(&state_->xxh, &number, sizeof number);
    return *this;
}

uint64_t ContentHash::value() const {
    return XXH3_64bits_digest(&state_->xxh);
}

}  // namespace etendue
