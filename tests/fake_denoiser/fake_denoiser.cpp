// A library in the place of Open Image Denoise 2, for tests of what is around it: a colour becomes the mean of the image,
// layers stay as they are. With FAKE_DENOISER_SECONDS, an image takes so long unless it is cancelled.

#include <chrono>
#include <cstdlib>
#include <cstring>
#include <string>
#include <thread>

namespace {

struct Device {
    int error = 0;
    std::string message;
};

struct Filter {
    Device* device = nullptr;
    float *input = nullptr, *output = nullptr;
    size_t width = 0, height = 0;
    bool is_color = false;
    bool (*progress)(void*, double) = nullptr;
    void* data = nullptr;
};

bool is_cancelled(const Filter& f) {
    const char* seconds = std::getenv("FAKE_DENOISER_SECONDS");
    const auto end = std::chrono::steady_clock::now() +
                     std::chrono::duration<double>(seconds ? std::atof(seconds) : 0);
    do {
        if (f.progress && !f.progress(f.data, 0.5)) return true;
        if (std::chrono::steady_clock::now() < end)
            std::this_thread::sleep_for(std::chrono::milliseconds(2));
    } while (std::chrono::steady_clock::now() < end);
    return false;
}

}  // namespace

extern "C" {

Device* oidnNewDevice(int) {
    return new Device;
}
void oidnReleaseDevice(Device* d) {
    delete d;
}
void oidnSetDeviceBool(Device*, const char*, bool) {}
void oidnSetDeviceInt(Device*, const char*, int) {}
int oidnGetDeviceInt(Device*, const char*) {
    return 29900;
}
void oidnCommitDevice(Device*) {}
int oidnGetDeviceError(Device* d, const char** message) {
    *message = d->message.c_str();
    const int error = d->error;
    d->error = 0;
    return error;
}
Filter* oidnNewFilter(Device* d, const char*) {
    auto* f = new Filter;
    f->device = d;
    return f;
}
void oidnReleaseFilter(Filter* f) {
    delete f;
}
void oidnSetSharedFilterImage(Filter* f, const char* name, void* pixels, int, size_t width,
                              size_t height, size_t, size_t, size_t) {
    if (std::strcmp(name, "output") == 0)
        f->output = static_cast<float*>(pixels);
    else if (!f->input || std::strcmp(name, "color") == 0)
        f->input = static_cast<float*>(pixels);
    f->is_color = f->is_color || std::strcmp(name, "color") == 0;
    f->width = width;
    f->height = height;
}
void oidnSetFilterBool(Filter*, const char*, bool) {}
void oidnSetFilterProgressMonitorFunction(Filter* f, bool (*progress)(void*, double), void* data) {
    f->progress = progress;
    f->data = data;
}
void oidnCommitFilter(Filter*) {}
void oidnExecuteFilter(Filter* f) {
    if (is_cancelled(*f)) {
        f->device->error = 6;
        f->device->message = "cancelled";
        return;
    }
    const size_t pixels = f->width * f->height;
    for (size_t c = 0; c < 3; ++c) {
        double sum = 0;
        for (size_t i = 0; i < pixels; ++i) sum += double(f->input[3 * i + c]);
        for (size_t i = 0; i < pixels; ++i)
            f->output[3 * i + c] = f->is_color ? float(sum / double(pixels)) : f->input[3 * i + c];
    }
}

}  // extern "C"
