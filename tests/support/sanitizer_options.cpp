// What the sanitizers must not report, in every program that has them: matters of libraries that are not instrumented.

extern "C" {

const char* __tsan_default_suppressions();
const char* __lsan_default_suppressions();
const char* __asan_default_options();

/// Tasks of TBB are handed from thread to thread inside libtbb, whose order the sanitizer cannot see. What precedes and
/// follows a loop it is told (tsan/tbb/parallel_for.h); what is left are accesses by TBB's own inline functions, which call
/// no code of ours (fold_tree) or of which only the innermost frame counts, and atomics of the types that only TBB uses.
/// Embree builds its trees on threads of its own, which call back for bounds and memory and use the program's copies of
/// standard functions.
const char* __tsan_default_suppressions() {
    return "race_top:/oneapi/tbb/\n"
           "race_top:std::__atomic_base<bool>\n"
           "race_top:std::__atomic_base<int>\n"
           "race_top:>::__atomic_base(\n"
           "race:fold_tree\n"
           "race:libembree3.so\n"
           "called_from_lib:libtbb.so\n"
           "called_from_lib:libembree3.so\n";
}

/// Where a file ends too early OpenImageIO 2.4 hands libpng the text of the error, and libpng leaves by longjmp(): the
/// text is never freed.
const char* __lsan_default_suppressions() {
    return "leak:PNGInput::PngReadCallback\n";
}

/// Else the stack of this leak ends in the standard library.
const char* __asan_default_options() {
    return "fast_unwind_on_malloc=0";
}
}
