// Every fuzz target on its corpus and on fixed mutations of it. An input may take neither much time nor much memory.

#include <sys/resource.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "corpus.h"
#include "fuzz_target.h"
#include "mutate.h"

namespace etendue::fuzz {

/// For messages of failed tests.
static void PrintTo(const Target& target, std::ostream* out) {
    *out << target.name;
}

namespace {

double cpu_seconds() {
    rusage usage{};
    getrusage(RUSAGE_SELF, &usage);
    return double(usage.ru_utime.tv_sec + usage.ru_stime.tv_sec) +
           1e-6 * double(usage.ru_utime.tv_usec + usage.ru_stime.tv_usec);
}
/// Largest memory of the process so far, in MiB.
long peak_memory() {
    rusage usage{};
    getrusage(RUSAGE_SELF, &usage);
    return usage.ru_maxrss >> 10;
}

class Fuzz : public ::testing::TestWithParam<Target> {};

TEST_P(Fuzz, ReplaysItsCorpusAndMutations) {
    constexpr double kMostSeconds = 10;
    constexpr long kMostMiB = 1500;
    const Target& target = GetParam();
    const std::vector<std::string> seeds = corpus(target);
    ASSERT_FALSE(seeds.empty());
    Mutator mutator(1);
    // FUZZ_MUTATIONS: another number of mutations. The last input of a run that crashed is in $FUZZ_LAST.
    const char* wanted = std::getenv("FUZZ_MUTATIONS");
    const char* last = std::getenv("FUZZ_LAST");
    const int mutations = wanted ? std::atoi(wanted) : target.mutations;
    const long memory = peak_memory();
    double slowest = 0;
    for (int i = -int(seeds.size()); i < mutations; ++i) {
        const size_t seed = size_t(i + int(seeds.size())) % seeds.size();
        const std::string input = i < 0 ? seeds[seed] : mutator.mutate(seeds[seed], seeds);
        if (last) std::ofstream(last, std::ios::binary) << input;
        const double before = cpu_seconds();
        target.run(input);
        const double seconds = cpu_seconds() - before;
        slowest = std::max(slowest, seconds);
        ASSERT_LT(seconds, kMostSeconds) << "input " << i;
        ASSERT_LT(peak_memory() - memory, kMostMiB) << "input " << i;
    }
    fmt::print("{}: {} seeds, slowest {:.3f} s, {} MiB\n", target.name, seeds.size(), slowest,
               peak_memory() - memory);
}

INSTANTIATE_TEST_SUITE_P(Targets, Fuzz, ::testing::ValuesIn(targets()),
                         [](const auto& target) { return std::string(target.param.name); });

}  // namespace
}  // namespace etendue::fuzz
