// The targets for libFuzzer; scripts/fuzz runs them all.
//     FUZZ_TARGET=ply FUZZ_SEEDS=FOLDER build/fuzz/tests/fuzz/fuzz      writes the inputs from which to start
//     FUZZ_TARGET=ply build/fuzz/tests/fuzz/fuzz -max_total_time=60 FOLDER

#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>

#include "corpus.h"
#include "fuzz_target.h"

namespace {

const etendue::fuzz::Target* chosen = nullptr;

void write_seeds(const std::filesystem::path& folder) {
    std::filesystem::create_directories(folder);
    int number = 0;
    for (const std::string& input : etendue::fuzz::corpus(*chosen))
        std::ofstream(folder / std::to_string(number++), std::ios::binary) << input;
}

}  // namespace

extern "C" int LLVMFuzzerInitialize(int*, char***) {
    const char* name = std::getenv("FUZZ_TARGET");
    for (const etendue::fuzz::Target& t : etendue::fuzz::targets())
        if (name && std::strcmp(name, t.name) == 0) chosen = &t;
    if (chosen) {
        const char* folder = std::getenv("FUZZ_SEEDS");
        if (!folder) return 0;
        write_seeds(folder);
        std::exit(0);
    }
    std::fprintf(stderr, "FUZZ_TARGET must be one of:");
    for (const etendue::fuzz::Target& t : etendue::fuzz::targets())
        std::fprintf(stderr, " %s", t.name);
    std::fprintf(stderr, "\n");
    std::exit(2);
}

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    chosen->run({reinterpret_cast<const char*>(data), size});
    return 0;
}
