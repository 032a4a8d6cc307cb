// Every fuzz target on its corpus and on fixed mutations of it. An input may take neither much time nor much memory.

#include <sys/resource.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "fuzz_target.h"
#include "mutate.h"

namespace etendue::fuzz {

/// For messages of failed tests.
static void PrintTo(const Target& target, std::ostream* out) {
    *out << target.name;
}

namespace {

namespace fs = std::filesystem;

std::string from_hex(const std::string& text) {
    std::string bytes;
    int digits = 0, value = 0;
    for (const char c : text) {
        if (!std::isxdigit(static_cast<unsigned char>(c))) continue;
        value = value * 16 + (c <= '9' ? c - '0' : (c | 32) - 'a' + 10);
        if (++digits % 2 == 0) bytes += char(std::exchange(value, 0));
    }
    return bytes;
}

std::vector<std::string> corpus(const Target& target) {
    std::vector<fs::path> files;
    const fs::path project = ETENDUE_SOURCE_DIR;
    if (const fs::path own = project / "tests/fuzz/corpus" / target.name; fs::exists(own))
        for (const auto& entry : fs::directory_iterator(own)) files.push_back(entry.path());
    for (const char* folder : target.folders)
        for (const auto& entry : fs::recursive_directory_iterator(project / folder))
            if (entry.path().extension() == target.extension) files.push_back(entry.path());
    std::sort(files.begin(), files.end());
    std::vector<std::string> inputs;
    if (target.seeds) inputs = target.seeds();
    for (const fs::path& file : files) {
        std::ifstream in(file, std::ios::binary);
        const std::string bytes{std::istreambuf_iterator<char>(in), {}};
        inputs.push_back(file.extension() == ".hex" ? from_hex(bytes) : bytes);
    }
    return inputs;
}

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
