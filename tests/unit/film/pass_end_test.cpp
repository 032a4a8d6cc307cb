// Where memory ends at the end of a pass, the film has all of it or nothing.

#include <functional>
#include <new>
#include <random>
#include <string>

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include "film/film.h"
#include "film/thread_arena.h"
#include "no_memory_for_tasks.h"
#include "system/section_file.h"

namespace etendue::test {
namespace {

constexpr FilmGeometry kLarge{200, 150, 0, 0, 200, 150};
const ReconstructionFilter kWide("wide", 1.5f, [](double, double, double) { return 1.0; });

void begin_pass(Film& film, unsigned seed) {
    constexpr uint64_t kLightPaths = 100;
    std::mt19937 random(seed);
    std::exponential_distribution<float> value(1);
    std::uniform_real_distribution<float> point(0, 150);
    film.begin_pass(kLightPaths);
    for (uint64_t i = 0; i < film.sample_count(); ++i) film.add_eye(i, Rgb(value(random)));
    for (uint64_t i = 0; i < kLightPaths; ++i)
        film.add_splat({point(random), point(random)}, Rgb(value(random)));
}
/// A film with these passes, in so many groups.
std::unique_ptr<Film> film_of(unsigned passes, int groups) {
    auto film = std::make_unique<Film>(kLarge, kWide, 1, FilterMode::Spread);
    if (groups > 0) film->set_groups(groups);
    for (unsigned i = 0; i < passes; ++i) {
        begin_pass(*film, i);
        film->end_pass();
    }
    return film;
}
std::string state_of(const Film& film) {
    SectionWriter to;
    film.save(to);
    return to.take();
}

/// In an arena of several threads, where there are tasks.
void end_passes_without_memory_for_tasks() {
    for (const int groups : {0, 2})
        for (const unsigned passes : {1u, 2u}) {
            const std::string before = state_of(*film_of(passes, groups)),
                              after = state_of(*film_of(passes + 1, groups));
            int whole = 0;
            long n = 1;
            for (bool is_reached = true; is_reached; ++n) {
                SCOPED_TRACE(n);
                ASSERT_LT(n, 1000);
                const std::unique_ptr<Film> film = film_of(passes, groups);
                begin_pass(*film, passes);
                bool is_complete = true;
                {
                    const NoMemoryForTask none(n);
                    try {
                        film->end_pass();
                    } catch (const std::bad_alloc&) {
                        is_complete = false;
                        film->drop_pass();
                    }
                    is_reached = none.has_failed();
                }
                // Not EXPECT_EQ, which would print all bytes.
                ASSERT_TRUE(state_of(*film) == (is_complete ? after : before)) << is_complete;
                whole += is_complete && is_reached;
                // The next pass is not affected.
                if (is_complete) continue;
                begin_pass(*film, passes);
                film->end_pass();
                ASSERT_TRUE(state_of(*film) == after);
            }
            EXPECT_GT(whole, 2);
        }
}

TEST(PassEnd, WithoutMemoryForTasksLeavesAllOfThePassOrNothing) {
    const tbb::global_control allowed(tbb::global_control::max_allowed_parallelism, 8);
    ThreadArena(4).execute(end_passes_without_memory_for_tasks);
}

}  // namespace
}  // namespace etendue::test
