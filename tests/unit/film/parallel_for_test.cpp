// Parallel loops have the threads of an arena, or none but the caller.

#include "film/parallel_for.h"

#include <filesystem>
#include <fstream>
#include <iterator>
#include <set>
#include <stdexcept>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include "film/film.h"
#include "no_memory_for_tasks.h"
#include "system/section_file.h"

namespace etendue::test {
namespace {

/// Calls the body of a loop, which must be called once for each index. Returns whether the loop needed tasks of TBB.
bool has_tasks() {
    const NoMemoryForTask none(1);
    std::vector<int> calls(100);
    try {
        parallel_for(calls.size(), [&](size_t i) { ++calls[i]; });
    } catch (const std::bad_alloc&) {
        return true;
    }
    EXPECT_EQ(calls, std::vector<int>(100, 1));
    return none.has_failed();
}

TEST(ParallelLoops, AreOfTheCallingThreadOutsideOfArenas) {
    const tbb::global_control allowed(tbb::global_control::max_allowed_parallelism, 8);
    EXPECT_EQ(ThreadArena::threads_here(), 1);
    EXPECT_FALSE(has_tasks());
    ThreadArena arena(3), one(1);
    EXPECT_FALSE(has_tasks());
    arena.execute([&] {
        EXPECT_EQ(ThreadArena::threads_here(), 3);
        EXPECT_TRUE(has_tasks());
        one.execute([] { EXPECT_FALSE(has_tasks()); });
        EXPECT_TRUE(has_tasks());
    });
    EXPECT_THROW(arena.execute([] { throw std::runtime_error("fails"); }), std::runtime_error);
    EXPECT_FALSE(has_tasks());
}

/// As for files that are opened beside a rendering: such a loop would begin as many threads as there are processors, whatever
/// number was asked for, and end the process where there is no memory for their stacks.
TEST(ParallelLoops, OfFilmsNeedNoArena) {
    constexpr FilmGeometry kLarge{200, 150, 0, 0, 200, 150};
    constexpr uint64_t kLightPaths = 10;
    const NoMemoryForTask none(1);
    Film film(kLarge, ReconstructionFilter::box());
    film.begin_pass(kLightPaths);
    film.add_splat({100, 75}, Rgb(1));
    film.end_pass();
    film.renew_expected();
    SectionWriter to;
    film.save(to);
    Film read(kLarge, ReconstructionFilter::box());
    SectionReader from(to.take(), "film");
    read.load(from);
    read.merge(film);
    EXPECT_EQ(read.passes(), 2u);
    EXPECT_FALSE(none.has_failed());
}

/// Other files include film/parallel_for.h, so that no loop can forget its arena.
TEST(ParallelLoops, AreAllOfOneKind) {
    namespace fs = std::filesystem;
    const fs::path source = ETENDUE_SOURCE_DIR;
    // Those of the scene and of the guide have an arena wherever they are called: that of build_scene(), and of a pass.
    const std::set<std::string> with_tbb{"src/film/parallel_for.h", "src/scene/preload.cpp",
                                         "src/guide/tree.cpp"};
    for (const char* folder : {"src", "apps", "python/src"})
        for (const auto& entry : fs::recursive_directory_iterator(source / folder)) {
            const std::string name = entry.path().lexically_relative(source).string();
            if (!name.ends_with(".h") && !name.ends_with(".cpp")) continue;
            std::ifstream in(entry.path());
            const std::string text{std::istreambuf_iterator<char>(in), {}};
            for (const char* header :
                 {"<tbb/parallel_", "<tbb/task_group.h>", "<tbb/flow_graph.h>"})
                EXPECT_TRUE(text.find(header) == std::string::npos || with_tbb.count(name))
                    << name << " includes " << header;
        }
}

}  // namespace
}  // namespace etendue::test
