// Where memory ends, a log has all numbers of a pass or none of them: a checkpoint with other lists could not be read.

#include <numeric>

#include <gtest/gtest.h>

#include "no_memory.h"
#include "render/statistics_section.h"

namespace etendue::test {
namespace {

/// After passes of a second and a pair each, during which the n-th block of memory was missing. Returns whether it was.
bool add_passes(long n, PassLog& log) {
    bool is_missing = false;
    const NoMemoryForBlock missing(n);
    for (int pass = 1; pass <= 50; ++pass) {
        try {
            log.add(pass, uint64_t(pass));
        } catch (const std::bad_alloc&) {
            is_missing = true;
        }
    }
    return is_missing;
}

TEST(PassLog, HasAllOfAPassOrNothing) {
    int failures = 0;
    for (PassLog log; add_passes(failures + 1, log); log = {}, ++failures) {
        SCOPED_TRACE(failures);
        SectionWriter saved;
        save_log(log, saved);
        SectionReader reader(saved.take(), "log");
        const PassLog read = load_log(reader);
        EXPECT_EQ(read.seconds, log.seconds);
        EXPECT_EQ(read.pairs, log.pairs);
        // The next pass has the numbers of both.
        ASSERT_EQ(log.seconds.size(), 49u);
        ASSERT_EQ(log.pairs.size(), 49u);
        EXPECT_EQ(std::accumulate(log.seconds.begin(), log.seconds.end(), 0.0), 50);
        EXPECT_EQ(std::accumulate(log.pairs.begin(), log.pairs.end(), uint64_t(0)), 50u);
    }
    EXPECT_GE(failures, 4);
}

}  // namespace
}  // namespace etendue::test
