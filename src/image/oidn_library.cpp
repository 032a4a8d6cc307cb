#include "image/oidn_library.h"

#include <dlfcn.h>

#include <stdexcept>
#include <type_traits>

#include <fmt/format.h>

namespace etendue {

OidnLibrary::OidnLibrary(const std::string& file) {
    // It is never unloaded: its threads may outlive the last use.
    void* const library = ::dlopen(file.c_str(), RTLD_NOW | RTLD_LOCAL);
    if (!library) throw std::runtime_error(::dlerror());
    const auto load = [&](auto& function, const char* name) {
        void* const symbol = ::dlsym(library, name);
        if (!symbol)
            throw std::runtime_error(fmt::format(
                "{} is no Open Image Denoise of version 2: it has no function {}", file, name));
        function = reinterpret_cast<std::remove_reference_t<decltype(function)>>(symbol);
    };
    load(new_device, "oidnNewDevice");
    load(release_device, "oidnReleaseDevice");
    load(set_device_bool, "oidnSetDeviceBool");
    load(set_device_int, "oidnSetDeviceInt");
    load(device_int, "oidnGetDeviceInt");
    load(commit_device, "oidnCommitDevice");
    load(device_error, "oidnGetDeviceError");
    load(new_filter, "oidnNewFilter");
    load(release_filter, "oidnReleaseFilter");
    load(set_image, "oidnSetSharedFilterImage");
    load(set_filter_bool, "oidnSetFilterBool");
    load(set_progress, "oidnSetFilterProgressMonitorFunction");
    load(commit_filter, "oidnCommitFilter");
    load(execute_filter, "oidnExecuteFilter");
}

}  // namespace etendue
