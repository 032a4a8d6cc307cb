#pragma once
// Hash of contents: files, parameters, programs. The same for the same bytes on every machine.

#include <cstdint>
#include <memory>
#include <string_view>

namespace etendue {

/// XXH3 with 64 bits [Collet 2012], of everything that was added, in order. What is added is told apart: "ab" and "c" are
/// not "a" and "bc".
class ContentHash {
public:
    ContentHash();
    ~ContentHash();

    ContentHash& add(std::string_view bytes);
    ContentHash& add(uint64_t number);
    uint64_t value() const;

private:
    struct State;
    std::unique_ptr<State> state_;
};

}  // namespace etendue
