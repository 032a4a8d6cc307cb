#include "image/image_io.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <bit>
#include <cerrno>
#include <filesystem>
#include <new>
#include <stdexcept>

#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>
#include <fmt/format.h>

#include "color/srgb.h"
#include "image/image_codecs.h"
#include "system/available_memory.h"

namespace etendue {
namespace {

namespace fs = std::filesystem;

constexpr float kMaxHalf = 65504;

[[noreturn]] void fail_read(const std::string& path, const std::string& why) {
    throw std::runtime_error(fmt::format("cannot read \"{}\": {}", path, why));
}
// OpenImageIO's reports may have several lines and end in a newline.
std::string one_line(std::string s) {
    while (!s.empty() && std::isspace(static_cast<unsigned char>(s.back()))) s.pop_back();
    std::replace(s.begin(), s.end(), '\n', ' ');
    return s.empty() ? "unknown error" : s;
}

// ------------------------------------------------------------------------------------------------------- reading

/// A file, or its bytes in memory.
struct Source {
    std::string name;  ///< In messages.
    std::string file;  ///< For OpenImageIO, which selects the format by its extension.
    uint64_t bytes;
    OIIO::Filesystem::IOProxy* memory = nullptr;
};

Source source_of(const std::string& path) {
    std::error_code error;
    const fs::file_status status = fs::status(path, error);
    if (!fs::exists(status)) fail_read(path, "there is no such file");
    if (!fs::is_regular_file(status)) fail_read(path, "it is not a regular file");
    if (::faccessat(AT_FDCWD, path.c_str(), R_OK, AT_EACCESS) != 0)
        fail_read(path, std::generic_category().message(errno));
    const uint64_t bytes = fs::file_size(path, error);
    if (error) fail_read(path, error.message());
    return {path, path, bytes};
}

std::unique_ptr<OIIO::ImageInput> open_input(const Source& source) {
    OIIO::ImageSpec config;
    config["oiio:UnassociatedAlpha"] = 1;  // the file's own colours, not premultiplied
    // As a parameter of open(), the readers of PNG and JPEG would not see it.
    if (source.memory)
        config.attribute("oiio:ioproxy", OIIO::TypeDesc::PTR,
                         static_cast<const void*>(&source.memory));
    auto input = OIIO::ImageInput::open(source.file, &config);
    if (!input) fail_read(source.name, one_line(OIIO::geterror()));
    const OIIO::ImageSpec& spec = input->spec();
    if (spec.width < 1 || spec.height < 1 || spec.nchannels < 1 || spec.depth > 1 || spec.deep)
        fail_read(source.name, "it is not a flat image with at least one pixel and one channel");
    // No codec compresses better than this. A header with a larger size is damaged, and would exhaust the memory.
    constexpr uint64_t kBestRatio = 4096, kAlwaysFine = 256u << 20;
    const uint64_t bytes = spec.image_bytes();
    if (bytes > kAlwaysFine && bytes / kBestRatio > source.bytes)
        fail_read(source.name,
                  fmt::format("its header claims {} x {} pixels, too many for the file's size",
                              spec.width, spec.height));
    if (const auto free = available_memory(); free && bytes > *free)
        fail_read(source.name,
                  fmt::format("its {} x {} pixels need {} of memory, but only {} are free",
                              spec.width, spec.height, format_bytes(bytes), format_bytes(*free)));
    return input;
}

template <class T>
std::vector<T> read_all(OIIO::ImageInput& input, const std::string& path, OIIO::TypeDesc type) {
    const OIIO::ImageSpec& spec = input.spec();
    try {
        std::vector<T> data(size_t(spec.width) * spec.height * spec.nchannels);
        if (!input.read_image(0, 0, 0, spec.nchannels, type, data.data()))
            fail_read(path, one_line(input.geterror()));
        return data;
    } catch (const std::bad_alloc&) {
        fail_read(path,
                  fmt::format("{} x {} pixels do not fit into memory", spec.width, spec.height));
    }
}

// Integer formats contain sRGB codes unless the file declares them linear.
bool holds_srgb(const OIIO::ImageSpec& spec) {
    return !spec.format.is_floating_point() &&
           spec.get_string_attribute("oiio:ColorSpace") != "Linear";
}

void linearize(std::vector<float>& data, const OIIO::ImageSpec& spec) {
    for (size_t i = 0; i < data.size(); ++i)
        if (int(i % spec.nchannels) != spec.alpha_channel) data[i] = srgb_to_linear(data[i]);
}

// Text and numbers, except those that describe the encoding of the file.
void read_attributes(Image& image, const OIIO::ImageSpec& spec) {
    for (const OIIO::ParamValue& a : spec.extra_attribs) {
        const std::string name = a.name().string();
        if (name.find(':') != std::string::npos || name == "compression" ||
            name == "PixelAspectRatio" || name == "DateTime" || name.starts_with("screenWindow"))
            continue;
        if (a.type() == OIIO::TypeString)
            image.attributes[name] = a.get_string();
        else if (a.type() == OIIO::TypeFloat)
            image.attributes[name] = double(a.get_float());
        else if (a.type() == OIIO::TypeDesc(OIIO::TypeDesc::DOUBLE))
            image.attributes[name] = *static_cast<const double*>(a.data());
        else if (a.type() == OIIO::TypeInt)
            image.attributes[name] = double(a.get_int());
    }
}

// ------------------------------------------------------------------------------------------------------- writing

/// An OutputFile as a file of OpenImageIO. Errors stay in the file until its commit().
class FileProxy final : public OIIO::Filesystem::IOProxy {
public:
    explicit FileProxy(OutputFile& file) : IOProxy("", Write), file_(file) {}
    const char* proxytype() const override { return "output"; }
    int64_t tell() override { return int64_t(file_.position()); }
    bool seek(int64_t offset) override { return file_.seek(uint64_t(offset)); }
    size_t write(const void* data, size_t size) override {
        return file_.write(data, size) ? size : 0;
    }
    void flush() const override {}

private:
    OutputFile& file_;
};

}  // namespace

void write_exr(OutputFile& file, const Image& image, ExrPrecision precision) {
    const bool half = precision == ExrPrecision::Half;
    OIIO::ImageSpec spec(image.width, image.height, int(image.channels.size()),
                         half ? OIIO::TypeHalf : OIIO::TypeFloat);
    spec.channelnames = image.channels;
    spec.alpha_channel = image.channel("A");
    spec["compression"] = "zip";
    spec["DateTime"] =
        "";  // otherwise the current time is written and equal images give different files
    for (const auto& [name, value] : image.attributes) {
        if (const auto* text = std::get_if<std::string>(&value))
            spec.attribute(name, *text);
        else
            spec.attribute(name, OIIO::TypeDesc(OIIO::TypeDesc::DOUBLE), &std::get<double>(value));
    }
    std::vector<float> clamped;
    if (half) {
        clamped = image.data;
        for (float& v : clamped)
            if (std::isfinite(v)) v = std::clamp(v, -kMaxHalf, kMaxHalf);
    }
    FileProxy target(file);
    const auto output = OIIO::ImageOutput::create("openexr", &target);
    if (!output) file.fail(one_line(OIIO::geterror()));
    const bool written =
        output->open("image.exr", spec) &&
        output->write_image(OIIO::TypeFloat, half ? clamped.data() : image.data.data());
    std::string why = written ? "" : one_line(output->geterror());
    const bool closed = output->close();
    if (written && !closed) why = one_line(output->geterror());
    // Where the file has the reason, its commit() says it better.
    if (!why.empty() && file.is_good()) file.fail(why);
}

Image read_image(const std::string& path) {
    const auto input = open_input(source_of(path));
    const OIIO::ImageSpec& spec = input->spec();
    Image image;
    image.width = spec.width;
    image.height = spec.height;
    image.channels = spec.channelnames;
    image.data = read_all<float>(*input, path, OIIO::TypeFloat);
    if (holds_srgb(spec)) linearize(image.data, spec);
    read_attributes(image, spec);
    return image;
}

static PixelBuffer pixels_of(const Source& source, bool raw) {
    const auto input = open_input(source);
    const std::string& path = source.name;
    const OIIO::ImageSpec& spec = input->spec();
    PixelBuffer buffer{.width = spec.width,
                       .height = spec.height,
                       .channels = spec.nchannels,
                       .data = {},
                       .alpha_channel = spec.alpha_channel};
    if (spec.format == OIIO::TypeUInt8) {
        buffer.data = read_all<uint8_t>(*input, path, OIIO::TypeUInt8);
    } else if (spec.format == OIIO::TypeHalf) {
        buffer.data = read_all<Half>(*input, path, OIIO::TypeHalf);
    } else {
        auto data = read_all<float>(*input, path, OIIO::TypeFloat);
        if (!raw && holds_srgb(spec)) linearize(data, spec);
        buffer.data = std::move(data);
    }
    return buffer;
}

PixelBuffer read_pixels(const std::string& path, bool raw) {
    return pixels_of(source_of(path), raw);
}

PixelBuffer decode_pixels(const std::string& bytes, const std::string& name, bool raw) {
    OIIO::Filesystem::IOMemReader memory(const_cast<char*>(bytes.data()), bytes.size());
    const bool is_jpeg = bytes.starts_with("\xff\xd8");
    return pixels_of({name, is_jpeg ? "image.jpg" : "image.png", bytes.size(), &memory}, raw);
}

std::string encode_png(int width, int height, std::span<const uint8_t> codes) {
    const int channels = png_channels(width, height, codes.size());
    OIIO::ImageSpec spec(width, height, channels, OIIO::TypeUInt8);
    spec["oiio:ColorSpace"] = "sRGB";
    std::vector<unsigned char> bytes;
    OIIO::Filesystem::IOVecOutput memory(bytes);
    const auto output = OIIO::ImageOutput::create("png", &memory);
    if (!output || !output->open("memory.png", spec) ||
        !output->write_image(OIIO::TypeUInt8, codes.data()) || !output->close())
        throw std::runtime_error("cannot encode a PNG: " +
                                 one_line(output ? output->geterror() : OIIO::geterror()));
    return {bytes.begin(), bytes.end()};
}

}  // namespace etendue
