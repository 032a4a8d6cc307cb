#pragma once
// Removal of noise by Intel Open Image Denoise 2, a neural network [Áfra 2024]. The library is loaded at run time, so that
// nothing else depends on it. Denoised images are biased; their metadata say that they are denoised.

#include <functional>
#include <memory>
#include <stdexcept>
#include <string>

#include "image/image.h"

namespace etendue {

class OidnLibrary;

struct DenoisingCancelled : std::runtime_error {
    DenoisingCancelled() : std::runtime_error("the denoising was cancelled") {}
};

class Denoiser {
public:
    /// Loads the library: the file `library`, or the one in this folder; if `library` is empty, the one that the environment
    /// variable ETENDUE_OIDN names in the same way; without it, the one of the package pyoidn in the virtual environment
    /// VIRTUAL_ENV, or that of the system. Throws std::runtime_error, which says how to get it, if there is none.
    explicit Denoiser(const std::string& library = "");
    Denoiser(const Denoiser&) = delete;
    Denoiser& operator=(const Denoiser&) = delete;
    ~Denoiser();

    /// "Open Image Denoise 2.5.1"
    const std::string& name() const { return name_; }

    /// The colours of `image` without their noise, and its metadata, of which those that no longer hold are replaced. The
    /// layers "denoise_albedo" and "denoise_normal", or else "albedo" and "normal", guide it if they are there; their own
    /// noise is removed first. Colours are radiance. `threads`: 0 for one per core. Throws std::runtime_error for what is
    /// denoised already, and DenoisingCancelled soon after `goes_on`, which must not throw, is false.
    Image denoise(const Image& image, int threads = 0,
                  const std::function<bool()>& goes_on = {}) const;

private:
    std::unique_ptr<const OidnLibrary> library_;
    std::string name_;
};

/// Whether the metadata say that the image is denoised.
bool is_denoised(const Image& image);

/// Throws std::runtime_error if `image`, which was read from `file`, is denoised: it is no reference. What is measured
/// against it would have the bias of the denoiser in its errors.
void refuse_denoised_reference(const std::string& file, const Image& image);

}  // namespace etendue
