// Suppressions of sanitizer reports that are caused by libraries without instrumentation, for every instrumented
// program.

extern "C" {

const char* __tsan_default_suppressions();
const char* __lsan_default_suppressions();

/// Embree builds its trees by TBB on its own threads, which call back for bounds and memory and use the program's copies
/// of standard functions. The program itself uses only arenas and thread-specific storage of TBB (see
/// tsan/tbb/parallel_for.h).
const char* __tsan_default_suppressions() {
    return "race:libembree3.so\n"
           "called_from_lib:libembree3.so\n"
           "called_from_lib:libtbb.so\n"
           "race_top:/oneapi/tbb/\n";
}

/// Embree frees not everything of a build that runs out of its memory. The name of the library is known without a
/// symbolizer. A worker of TBB keeps the last observer that it has seen until it enters another arena, in memory that the
/// sanitizer does not search.
const char* __lsan_default_suppressions() {
    return "leak:libembree3.so\n"
           "leak:tbb::detail::r1::observe\n";
}
}
