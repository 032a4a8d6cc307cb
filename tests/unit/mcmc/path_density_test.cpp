// Products beyond the range of double.

#include "mcmc/path_density.h"

#include <array>
#include <cmath>
#include <set>

#include <gtest/gtest.h>

namespace etendue::test {
namespace {

TEST(PathDensity, HashesDifferBeyondTheRangeOfDouble) {
    std::set<uint64_t> hashes;
    size_t count = 0;
    for (const PathDensity scale : {0x1p-1300l, 1.0l, 0x1p1300l})
        for (const PathProduct& colour : {PathProduct{1, 2, 3}, PathProduct{3, 2, 1},
                                          PathProduct{2, 4, 6}, PathProduct{1, 2, 0}}) {
            const PathProduct f{scale * colour[0], scale * colour[1], scale * colour[2]};
            EXPECT_EQ(hash_of(f), hash_of(PathProduct(f)));
            hashes.insert(hash_of(f));
            ++count;
        }
    EXPECT_EQ(hashes.size(), count);
    // The last digit.
    const PathDensity next = std::nextafter(PathDensity(1), PathDensity(2));
    EXPECT_NE(hash_of({1, 1, 1}), hash_of({1, 1, next}));
}

}  // namespace
}  // namespace etendue::test
