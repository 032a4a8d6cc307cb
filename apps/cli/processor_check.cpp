// Says what is wrong where the processor lacks instructions of this build, which would end the program. This file alone is
// compiled without them, and runs before the initialisation of the others.

#include <unistd.h>

#include <cstdlib>

namespace {

// Of x86-64-v3, by the names that compilers have for them.
bool has_instructions() {
    __builtin_cpu_init();
    return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") &&
           __builtin_cpu_supports("bmi") && __builtin_cpu_supports("bmi2");
}

[[gnu::constructor(101)]] void check_processor() {
    if (has_instructions()) return;
    constexpr char kMessage[] =
        "etendue: error: this build needs a processor with AVX2, FMA and BMI2 (x86-64-v3); "
        "build it with -DETENDUE_ARCH=x86-64\n";
    const ssize_t written = ::write(STDERR_FILENO, kMessage, sizeof kMessage - 1);
    _exit(written > 0 ? 2 : 1);
}

}  // namespace
