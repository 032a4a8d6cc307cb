#include "math/content_hash.h"

#include <gtest/gtest.h>

namespace etendue {
namespace {

TEST(ContentHash, TellsContentsAndTheirOrderApart) {
    const auto hash = [](auto... parts) {
        ContentHash h;
        (h.add(parts), ...);
        return h.value();
    };
    EXPECT_EQ(hash("ab", "c"), hash("ab", "c"));
    EXPECT_NE(hash("ab", "c"), hash("a", "bc"));
    EXPECT_NE(hash("ab", "c"), hash("c", "ab"));
    EXPECT_NE(hash("ab"), hash("ab", ""));
    EXPECT_NE(hash(uint64_t(1)), hash(uint64_t(2)));
    const std::string large(100'000, 'x');
    EXPECT_NE(hash(std::string_view(large)), hash(std::string_view(large).substr(1)));
}

// References and checkpoints outlive a build of this project: the hash of given contents must not change.
TEST(ContentHash, IsXxh3) {
    EXPECT_EQ(ContentHash().value(), 0x2d06800538d394c2ull);
}

}  // namespace
}  // namespace etendue
