// What the sanitizers must not report, in every program that has them: matters of libraries that are not instrumented.

extern "C" {

const char* __tsan_default_suppressions();
const char* __lsan_default_suppressions();
const char* __asan_default_options();

/// Tasks of TBB are handed from thread to thread inside libtbb, whose order the sanitizer cannot see; see
/// tsan/tbb/parallel_for.h. Only accesses by TBB's own inline functions are left out, not those by what they call.
const char* __tsan_default_suppressions() {
    return "race_top:tbb::detail\n"
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
