#pragma once
// Hash of the contents of files, parameters and programs, for recognising them again. Equal bytes have equal hashes in
// every run.

#include <cstdint>
#include <memory>
#include <string_view>

namespace etendue {

/// 64-bit XXH3 [Collet 2012] of everything added, in order. Boundaries between the added strings count: "ab", "c" and
/// "a", "bc" have different hashes.
class ContentHash {
public:
    ContentHash();
    ~ContentHash();
    ContentHash(ContentHash&&) noexcept;
    ContentHash& operator=(ContentHash&&) noexcept;

    ContentHash& add(std::string_view bytes);
    ContentHash& add(uint64_t number);
    /// Adds a piece of a string; where the string is cut does not count.
    ContentHash& add_piece(std::string_view bytes);
    uint64_t value() const;

private:
    struct State;
    std::unique_ptr<State> state_;
};

}  // namespace etendue
