// Replaces functions of libpng, which return nullptr where there is no memory.

#include "no_memory_for_png.h"

#include <dlfcn.h>
#include <png.h>

std::atomic<int> etendue::test::png_without_memory{0};

namespace {

template <class Function>
Function* original_of(const char* name) {
    return reinterpret_cast<Function*>(::dlsym(RTLD_NEXT, name));
}
using Create = png_struct*(png_const_charp, png_voidp, png_error_ptr, png_error_ptr);

}  // namespace

extern "C" {

png_structp png_create_write_struct(png_const_charp version, png_voidp error, png_error_ptr fails,
                                    png_error_ptr warns) {
    static auto* const next = original_of<Create>("png_create_write_struct");
    return etendue::test::png_without_memory == 1 ? nullptr : next(version, error, fails, warns);
}
png_structp png_create_read_struct(png_const_charp version, png_voidp error, png_error_ptr fails,
                                   png_error_ptr warns) {
    static auto* const next = original_of<Create>("png_create_read_struct");
    return etendue::test::png_without_memory == 1 ? nullptr : next(version, error, fails, warns);
}
png_infop png_create_info_struct(png_const_structrp png) {
    static auto* const next = original_of<png_info*(png_const_structrp)>("png_create_info_struct");
    return etendue::test::png_without_memory == 2 ? nullptr : next(png);
}
}
