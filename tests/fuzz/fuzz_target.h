#pragma once
// Fuzz targets: functions that take any bytes and must return, whatever these are. An error is an exception that the
// target expects; a crash, a sanitizer's report, an unexpected exception, and excessive time or memory are defects.
//
// A target is run in two ways: by libFuzzer (fuzz_main.cpp), and in the tests on its corpus and on fixed mutations of it
// (replay_test.cpp). The corpus, corpus/NAME/*, holds text; files that end with .hex are bytes in hexadecimal. Seeds that
// are no text are made by the target.

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace etendue::fuzz {

struct Target {
    const char* name;
    void (*run)(std::string_view bytes);
    std::vector<std::string> (*seeds)() = nullptr;  ///< More inputs than those of the corpus.
    int mutations = 2000;                           ///< That the tests run.
    /// Files of the project that are inputs, too: an extension, and folders of the project, searched with theirs.
    const char* extension = "";
    std::vector<const char*> folders = {};
};

/// All targets of the program.
inline std::vector<Target>& targets() {
    static std::vector<Target> all;
    return all;
}
struct Register {
    explicit Register(const Target& target) { targets().push_back(target); }
};

/// Ends the process where a property of the result does not hold.
inline void require(bool holds) {
    if (!holds) __builtin_trap();
}

}  // namespace etendue::fuzz
