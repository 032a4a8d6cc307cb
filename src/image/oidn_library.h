#pragma once
// The functions of Intel Open Image Denoise 2.x that are used here, with the types of its C interface
// (openimagedenoise.org/documentation.html), loaded at run time.

#include <cstddef>
#include <string>

namespace etendue {

class OidnLibrary {
public:
    /// Throws std::runtime_error if the file cannot be loaded or is no such library.
    explicit OidnLibrary(const std::string& file);

    using Device = struct OpaqueDevice*;
    using Filter = struct OpaqueFilter*;
    static constexpr int kCpu = 1;        ///< OIDN_DEVICE_TYPE_CPU
    static constexpr int kFloat3 = 3;     ///< OIDN_FORMAT_FLOAT3
    static constexpr int kNoError = 0;    ///< OIDN_ERROR_NONE
    static constexpr int kCancelled = 6;  ///< OIDN_ERROR_CANCELLED
    /// Called while a filter is executed; false cancels it.
    using Progress = bool (*)(void* data, double done);

    Device (*new_device)(int type);
    void (*release_device)(Device);
    void (*set_device_bool)(Device, const char* name, bool value);
    void (*set_device_int)(Device, const char* name, int value);
    int (*device_int)(Device, const char* name);
    void (*commit_device)(Device);
    /// The first error since the last call, which stays the library's. `Device` may be null.
    int (*device_error)(Device, const char** message);
    Filter (*new_filter)(Device, const char* type);
    void (*release_filter)(Filter);
    /// Strides of 0 bytes: pixels and rows are adjacent.
    void (*set_image)(Filter, const char* name, void* pixels, int format, size_t width,
                      size_t height, size_t offset, size_t pixel_stride, size_t row_stride);
    void (*set_filter_bool)(Filter, const char* name, bool value);
    void (*set_progress)(Filter, Progress, void* data);
    void (*commit_filter)(Filter);
    void (*execute_filter)(Filter);
};

}  // namespace etendue
