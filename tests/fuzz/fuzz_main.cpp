// The targets for libFuzzer. FUZZ_TARGET=ply build/fuzz/tests/fuzz/fuzz -max_total_time=60 CORPUS

#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "fuzz_target.h"

namespace {

const etendue::fuzz::Target* chosen = nullptr;

}  // namespace

extern "C" int LLVMFuzzerInitialize(int*, char***) {
    const char* name = std::getenv("FUZZ_TARGET");
    for (const etendue::fuzz::Target& t : etendue::fuzz::targets())
        if (name && std::strcmp(name, t.name) == 0) chosen = &t;
    if (chosen) return 0;
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
