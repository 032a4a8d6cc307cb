// Suppressions of sanitizer reports that are caused by libraries without instrumentation, for every instrumented
// program.

extern "C" {

const char* __tsan_default_suppressions();
const char* __lsan_default_suppressions();
const char* __asan_default_options();

/// libtbb passes tasks between threads, and the sanitizer does not see their order. tsan/tbb/parallel_for.h declares
/// the order before and after a loop. The remaining reports are accesses by TBB's inline functions, which call none of
/// our code (fold_tree) or of which only the innermost frame counts, and atomics of types used by TBB only. Embree
/// builds its trees on its own threads, which call back for bounds and memory and use the program's copies of standard
/// functions.
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

/// For a truncated file OpenImageIO 2.4 passes the error text to libpng, which leaves by longjmp(), so that the text is
/// never freed.
const char* __lsan_default_suppressions() {
    return "leak:PNGInput::PngReadCallback\n";
}

/// Otherwise the stack of this leak ends in the standard library.
const char* __asan_default_options() {
    return "fast_unwind_on_malloc=0";
}
}
