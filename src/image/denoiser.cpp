#include "image/denoiser.h"

#include <cstdlib>
#include <filesystem>
#include <initializer_list>
#include <stdexcept>
#include <system_error>
#include <type_traits>
#include <vector>

#include <fmt/format.h>

#include "image/oidn_library.h"

namespace etendue {
namespace {

namespace fs = std::filesystem;

constexpr const char* kLibraryName = "libOpenImageDenoise.so.2";
/// Attribute of images that are denoised.
constexpr const char* kMark = "etendue.denoised";

using Pixels = std::vector<Rgb>;

/// A device of the library, on which all threads of a filter run.
class OidnDevice {
public:
    /// `goes_on` must outlive the device; it may be empty.
    OidnDevice(const OidnLibrary& oidn, int threads, const std::function<bool()>& goes_on)
        : oidn_(oidn), goes_on_(goes_on), device_(oidn.new_device(OidnLibrary::kCpu)) {
        check();
        oidn_.set_device_int(device_, "numThreads", threads);
        // Threads of TBB are those of renderings, too.
        oidn_.set_device_bool(device_, "setAffinity", false);
        oidn_.commit_device(device_);
        check();
    }
    OidnDevice(const OidnDevice&) = delete;
    OidnDevice& operator=(const OidnDevice&) = delete;
    ~OidnDevice() {
        if (device_) oidn_.release_device(device_);
    }

    /// Major, minor and patch: 20501.
    int version() const { return oidn_.device_int(device_, "version"); }

    struct Input {
        const char* name;
        Pixels& pixels;
    };
    /// The image "output" of a filter for ray-traced images. The inputs are not changed.
    Pixels filter(int width, int height, std::initializer_list<Input> inputs,
                  std::initializer_list<const char*> flags) const {
        Pixels output(size_t(width) * size_t(height));
        const auto set = [&](OidnLibrary::Filter f, const char* name, Pixels& pixels) {
            oidn_.set_image(f, name, pixels.data(), OidnLibrary::kFloat3, size_t(width),
                            size_t(height), 0, 0, 0);
        };
        const std::unique_ptr<std::remove_pointer_t<OidnLibrary::Filter>,
                              void (*)(OidnLibrary::Filter)>
            filter(oidn_.new_filter(device_, "RT"), oidn_.release_filter);
        check();
        for (const Input& i : inputs)
            if (!i.pixels.empty()) set(filter.get(), i.name, i.pixels);
        set(filter.get(), "output", output);
        for (const char* flag : flags) oidn_.set_filter_bool(filter.get(), flag, true);
        if (goes_on_) {
            oidn_.set_progress(
                filter.get(),
                [](void* data, double) {
                    return (*static_cast<const std::function<bool()>*>(data))();
                },
                const_cast<std::function<bool()>*>(&goes_on_));
            if (!goes_on_()) throw DenoisingCancelled();
        }
        oidn_.commit_filter(filter.get());
        oidn_.execute_filter(filter.get());
        check();
        return output;
    }

private:
    void check() const {
        const char* message = nullptr;
        const int error = oidn_.device_error(device_, &message);
        if (error == OidnLibrary::kCancelled) throw DenoisingCancelled();
        if (error != OidnLibrary::kNoError || !device_)
            throw std::runtime_error(fmt::format("Open Image Denoise failed: {}",
                                                 message ? message : "it has no device"));
    }

    const OidnLibrary& oidn_;
    const std::function<bool()>& goes_on_;
    OidnLibrary::Device device_;
};

/// The file `name`, or the library in the folder `name`.
std::string library_file(const std::string& name) {
    std::error_code error;
    return fs::is_directory(name, error) ? (fs::path(name) / kLibraryName).string() : name;
}

/// That of the package pyoidn, if it is installed in the virtual environment which is active.
std::string library_of_environment() {
    const char* const environment = std::getenv("VIRTUAL_ENV");
    if (!environment) return "";
    std::error_code error;
    for (const fs::directory_entry& python :
         fs::directory_iterator(fs::path(environment) / "lib", error)) {
        const fs::path file = python.path() / "site-packages/pyoidn/oidn/lib" / kLibraryName;
        if (fs::exists(file, error)) return file.string();
    }
    return "";
}

std::string library_to_load(const std::string& wanted) {
    if (!wanted.empty()) return library_file(wanted);
    if (const char* const given = std::getenv("ETENDUE_OIDN"); given && *given)
        return library_file(given);
    const std::string of_environment = library_of_environment();
    return of_environment.empty() ? kLibraryName : of_environment;
}

std::unique_ptr<const OidnLibrary> load(const std::string& wanted) try {
    return std::make_unique<const OidnLibrary>(library_to_load(wanted));
} catch (const std::runtime_error& e) {
    throw std::runtime_error(
        fmt::format("cannot load Open Image Denoise 2 ({}). \"pip install pyoidn\" in an active "
                    "virtual environment installs it; so do the archives of "
                    "https://www.openimagedenoise.org, if ETENDUE_OIDN names {} or its folder",
                    e.what(), kLibraryName));
}

/// The layer of the first of these names, or no pixels.
Pixels layer(const Image& image, std::initializer_list<const char*> names) {
    for (const char* name : names)
        if (image.channel(fmt::format("{}.R", name)) >= 0) return rgb_pixels(image, name);
    return {};
}

}  // namespace

Denoiser::Denoiser(const std::string& library) : library_(load(library)) {
    const int version = OidnDevice(*library_, 1, {}).version();
    name_ = fmt::format("Open Image Denoise {}.{}.{}", version / 10000, version / 100 % 100,
                        version % 100);
}

Denoiser::~Denoiser() = default;

Image Denoiser::denoise(const Image& image, int threads,
                        const std::function<bool()>& goes_on) const {
    if (is_denoised(image)) throw std::runtime_error("the image is denoised already");
    const int w = image.width, h = image.height;
    Pixels color = rgb_pixels(image), albedo = layer(image, {"denoise_albedo", "albedo"}), normal;
    // The library takes normals beside albedos alone.
    if (!albedo.empty()) normal = layer(image, {"denoise_normal", "normal"});
    const OidnDevice device(*library_, threads, goes_on);
    if (!albedo.empty()) albedo = device.filter(w, h, {{"albedo", albedo}}, {});
    if (!normal.empty()) normal = device.filter(w, h, {{"normal", normal}}, {});
    const Pixels output =
        albedo.empty()
            ? device.filter(w, h, {{"color", color}}, {"hdr"})
            : device.filter(w, h, {{"color", color}, {"albedo", albedo}, {"normal", normal}},
                            {"hdr", "cleanAux"});
    Image result = rgb_image(w, h, output);
    result.attributes = image.attributes;
    // Of the image with its noise.
    for (const char* name : {"mean_luminance", "mean_luminance_standard_error"})
        result.attributes.erase(fmt::format("etendue.{}", name));
    result.attributes["etendue.estimator"] = std::string("denoised");
    result.attributes[kMark] = fmt::format("{}, {}", name_,
                                           albedo.empty()   ? "without other layers"
                                           : normal.empty() ? "with albedo"
                                                            : "with albedo and normal");
    return result;
}

bool is_denoised(const Image& image) {
    return image.attributes.contains(kMark);
}

void refuse_denoised_reference(const std::string& file, const Image& image) {
    if (is_denoised(image))
        throw std::runtime_error(fmt::format(
            "{}: the image is denoised, which biases it; references must not be", file));
}

}  // namespace etendue
