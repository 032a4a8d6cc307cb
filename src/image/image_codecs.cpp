// The file formats of image_io.h: .exr over OpenEXR, .png over libpng, .jpg over libjpeg, .tga and .bmp over stb_image;
// .hdr, .pfm, .pgm and .ppm.

#include "image/image_io.h"

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <climits>
#include <cmath>
#include <csetjmp>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <memory>
#include <stdexcept>
#include <system_error>

#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfDoubleAttribute.h>
#include <OpenEXR/ImfFloatAttribute.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfIO.h>
#include <OpenEXR/ImfInputFile.h>
#include <OpenEXR/ImfIntAttribute.h>
#include <OpenEXR/ImfOutputFile.h>
#include <OpenEXR/ImfStringAttribute.h>
#include <fmt/format.h>
#include <jpeglib.h>
#include <png.h>
#include <stb_image.h>

#include "color/srgb.h"
#include "image/image_codecs.h"
#include "system/available_memory.h"

namespace etendue {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void fail_read(const std::string& path, const std::string& why) {
    throw std::runtime_error(fmt::format("cannot read \"{}\": {}", path, why));
}

/// The bytes of a file, and its name for messages.
struct Source {
    std::string name;
    std::string_view bytes;
};

/// No codec compresses better than this. A header with a larger size is damaged, and would exhaust the memory.
void check_size(const Source& source, uint64_t width, uint64_t height, uint64_t pixel_bytes) {
    constexpr uint64_t kBestRatio = 4096, kAlwaysFine = 256u << 20;
    constexpr uint64_t kLargestSide = 1 << 20;
    if (width < 1 || height < 1) fail_read(source.name, "it has no pixels");
    const uint64_t bytes = width * height * pixel_bytes;
    if (width > kLargestSide || height > kLargestSide || pixel_bytes > kLargestSide ||
        (bytes > kAlwaysFine && bytes / kBestRatio > source.bytes.size()))
        fail_read(source.name,
                  fmt::format("its header claims {} x {} pixels, too many for the file's size",
                              width, height));
    if (const auto free = available_memory(); free && bytes > *free)
        fail_read(source.name,
                  fmt::format("its {} x {} pixels need {} of memory, but only {} are free", width,
                              height, format_bytes(bytes), format_bytes(*free)));
}

/// What a file holds, before any conversion of colours.
struct Contents {
    PixelBuffer pixels;
    std::vector<std::string> channels;
    bool is_linear = true;    ///< Whether the values are linear, or sRGB codes.
    double largest_code = 1;  ///< Of integer formats.
    std::map<std::string, std::variant<std::string, double>> attributes;
};

std::vector<std::string> channel_names(int count) {
    switch (count) {
    case 1: return {"Y"};
    case 2: return {"Y", "A"};
    case 3: return {"R", "G", "B"};
    default: return {"R", "G", "B", "A"};
    }
}

/// sRGB codes of 8 bits.
Contents coded(int width, int height, int channels, std::vector<uint8_t> codes) {
    Contents c;
    PixelBuffer& p = c.pixels;
    p.width = width, p.height = height, p.channels = channels;
    p.data = std::move(codes);
    if (channels == 2 || channels == 4) p.alpha_channel = channels - 1;
    c.channels = channel_names(channels);
    c.is_linear = false;
    c.largest_code = 255;
    return c;
}

/// The same for codes of 16 bits, which become numbers in [0, 1].
Contents deeply_coded(int width, int height, int channels, const uint16_t* codes) {
    Contents c = coded(width, height, channels, {});
    std::vector<float> values(size_t(width) * size_t(height) * size_t(channels));
    for (size_t i = 0; i < values.size(); ++i) values[i] = float(codes[i]) * (1.0f / 65535.0f);
    c.pixels.data = std::move(values);
    c.largest_code = 1;
    return c;
}

// ------------------------------------------------------------------------------------------------------- OpenEXR

/// Within each layer: R, G, B, A, and others after them.
std::vector<std::string> ordered_channels(const Imf::ChannelList& list) {
    std::vector<std::string> names;
    for (auto it = list.begin(); it != list.end(); ++it) names.emplace_back(it.name());
    const auto key = [](const std::string& name) {
        const size_t dot = name.rfind('.');
        const std::string layer = dot == std::string::npos ? "" : name.substr(0, dot);
        const std::string last = name.substr(dot == std::string::npos ? 0 : dot + 1);
        const size_t rank = std::string_view("RGBA").find(last);
        return std::tuple(layer, last.size() == 1 ? std::min<size_t>(rank, 4) : 4, last);
    };
    std::stable_sort(names.begin(), names.end(),
                     [&](const auto& a, const auto& b) { return key(a) < key(b); });
    return names;
}

template <class T>
std::vector<T> read_exr_pixels(Imf::InputFile& file, const std::vector<std::string>& names,
                               Imf::PixelType type) {
    const Imath::Box2i window = file.header().dataWindow();
    const size_t width = size_t(window.max.x - window.min.x + 1);
    const size_t height = size_t(window.max.y - window.min.y + 1);
    std::vector<T> data(width * height * names.size());
    const size_t pixel = names.size() * sizeof(T), row = width * pixel;
    Imf::FrameBuffer buffer;
    for (size_t i = 0; i < names.size(); ++i)
        buffer.insert(names[i], Imf::Slice::Make(type, data.data() + i, window.min, int64_t(width),
                                                 int64_t(height), pixel, row));
    file.setFrameBuffer(buffer);
    file.readPixels(window.min.y, window.max.y);
    return data;
}

/// The bytes of a file, for OpenEXR.
class ExrInput final : public Imf::IStream {
public:
    explicit ExrInput(const Source& source) : IStream(source.name.c_str()), bytes_(source.bytes) {}
    bool read(char to[], int size) override {
        if (size < 0 || uint64_t(size) > bytes_.size() - at_)
            throw Iex::InputExc("the file ends too early");
        std::memcpy(to, bytes_.data() + at_, size_t(size));
        at_ += uint64_t(size);
        return at_ < bytes_.size();
    }
    uint64_t tellg() override { return at_; }
    void seekg(uint64_t position) override {
        if (position > bytes_.size()) throw Iex::InputExc("the file ends too early");
        at_ = position;
    }

private:
    std::string_view bytes_;
    uint64_t at_ = 0;
};

/// An OutputFile for OpenEXR. Errors stay in the file until its commit().
class ExrOutput final : public Imf::OStream {
public:
    explicit ExrOutput(OutputFile& file) : OStream("image.exr"), file_(file) {}
    void write(const char from[], int size) override { file_.write(from, size_t(size)); }
    uint64_t tellp() override { return file_.position(); }
    void seekp(uint64_t position) override { file_.seek(position); }

private:
    OutputFile& file_;
};

/// Whether every file has the attribute, which says nothing about the image.
bool describes_encoding(std::string_view attribute) {
    return attribute == "pixelAspectRatio" || attribute == "screenWindowWidth";
}

Contents read_exr(const Source& source, bool as_floats) {
    const std::string& path = source.name;
    ExrInput input(source);
    Imf::InputFile file(input);
    const Imf::Header& header = file.header();
    const Imath::Box2i window = header.dataWindow();
    Contents c;
    c.channels = ordered_channels(header.channels());
    if (c.channels.empty()) fail_read(path, "it has no channels");
    bool is_half = !as_floats;
    for (auto it = header.channels().begin(); it != header.channels().end(); ++it) {
        is_half = is_half && it.channel().type == Imf::HALF;
        if (it.channel().xSampling != 1 || it.channel().ySampling != 1)
            fail_read(path, "its channels differ in resolution");
    }
    PixelBuffer& p = c.pixels;
    const int64_t width = int64_t(window.max.x) - window.min.x + 1,
                  height = int64_t(window.max.y) - window.min.y + 1;
    check_size(source, uint64_t(width), uint64_t(height), c.channels.size() * 4);
    p.width = int(width), p.height = int(height);
    p.channels = int(c.channels.size());
    const auto alpha = std::find(c.channels.begin(), c.channels.end(), "A");
    if (alpha != c.channels.end()) p.alpha_channel = int(alpha - c.channels.begin());
    if (is_half)
        p.data = read_exr_pixels<Half>(file, c.channels, Imf::HALF);
    else
        p.data = read_exr_pixels<float>(file, c.channels, Imf::FLOAT);
    for (auto it = header.begin(); it != header.end(); ++it) {
        if (describes_encoding(it.name())) continue;
        const Imf::Attribute& a = it.attribute();
        if (const auto* text = dynamic_cast<const Imf::StringAttribute*>(&a))
            c.attributes[it.name()] = text->value();
        else if (const auto* real = dynamic_cast<const Imf::DoubleAttribute*>(&a))
            c.attributes[it.name()] = real->value();
        else if (const auto* single = dynamic_cast<const Imf::FloatAttribute*>(&a))
            c.attributes[it.name()] = double(single->value());
        else if (const auto* integer = dynamic_cast<const Imf::IntAttribute*>(&a))
            c.attributes[it.name()] = double(integer->value());
    }
    return c;
}

// ------------------------------------------------------------------------------------------------------- PNG

/// Where libpng and libjpeg leave after an error, and what they said. No object with a destructor may be made between
/// setjmp() and a call of the library.
struct Escape {
    std::jmp_buf place;
    char message[200] = "";
};

void png_fails(png_structp png, png_const_charp message) {
    auto& escape = *static_cast<Escape*>(png_get_error_ptr(png));
    std::snprintf(escape.message, sizeof escape.message, "%s", message);
    std::longjmp(escape.place, 1);
}
void png_warns(png_structp, png_const_charp) {}

struct PngReader {
    explicit PngReader(Escape& escape)
        : png(png_create_read_struct(PNG_LIBPNG_VER_STRING, &escape, png_fails, png_warns)),
          info(png_create_info_struct(png)) {}
    ~PngReader() { png_destroy_read_struct(&png, &info, nullptr); }
    PngReader(const PngReader&) = delete;
    PngReader& operator=(const PngReader&) = delete;
    png_structp png;
    png_infop info;
};

struct PngHeader {
    uint32_t width, height;
    int channels, depth;
    bool is_linear;
};

void take_bytes(png_structp png, png_bytep to, size_t size) {
    auto& rest = *static_cast<std::string_view*>(png_get_io_ptr(png));
    if (size > rest.size()) png_error(png, "the file ends too early");
    std::memcpy(to, rest.data(), size);
    rest.remove_prefix(size);
}

/// `rest`: the bytes that are not yet read.
bool read_png_header(PngReader& reader, std::string_view& rest, Escape& escape, PngHeader& header) {
    if (setjmp(escape.place)) return false;
    png_structp png = reader.png;
    png_infop info = reader.info;
    png_set_read_fn(png, &rest, take_bytes);
    png_read_info(png, info);
    const int type = png_get_color_type(png, info);
    if (type == PNG_COLOR_TYPE_PALETTE) png_set_palette_to_rgb(png);
    if (type == PNG_COLOR_TYPE_GRAY && png_get_bit_depth(png, info) < 8)
        png_set_expand_gray_1_2_4_to_8(png);
    if (png_get_valid(png, info, PNG_INFO_tRNS)) png_set_tRNS_to_alpha(png);
    double gamma = 0;
    header.is_linear = png_get_gAMA(png, info, &gamma) && std::fabs(gamma - 1) < 1e-3;
    png_set_interlace_handling(png);
    if (png_get_bit_depth(png, info) == 16) png_set_swap(png);
    png_read_update_info(png, info);
    header.width = png_get_image_width(png, info);
    header.height = png_get_image_height(png, info);
    header.channels = png_get_channels(png, info);
    header.depth = png_get_bit_depth(png, info);
    return true;
}

bool read_png_rows(PngReader& reader, Escape& escape, png_bytepp rows) {
    if (setjmp(escape.place)) return false;
    png_read_image(reader.png, rows);
    png_read_end(reader.png, nullptr);
    return true;
}

Contents read_png(const Source& source) {
    const std::string& path = source.name;
    std::string_view rest = source.bytes;
    Escape escape;
    PngReader reader(escape);
    PngHeader header{};
    if (!read_png_header(reader, rest, escape, header)) fail_read(path, escape.message);
    const size_t pixel = size_t(header.channels * header.depth / 8), row = header.width * pixel;
    check_size(source, header.width, header.height, pixel);
    // Codes of 16 bits are read in the order of this machine.
    const bool is_deep = header.depth == 16;
    std::vector<uint8_t> bytes(is_deep ? 0 : row * header.height);
    std::vector<uint16_t> deep(is_deep ? row * header.height / 2 : 0);
    auto* const first = is_deep ? reinterpret_cast<uint8_t*>(deep.data()) : bytes.data();
    std::vector<png_bytep> rows(header.height);
    for (size_t y = 0; y < rows.size(); ++y) rows[y] = first + y * row;
    if (!read_png_rows(reader, escape, rows.data())) fail_read(path, escape.message);
    const int width = int(header.width), height = int(header.height);
    Contents c = is_deep ? deeply_coded(width, height, header.channels, deep.data())
                         : coded(width, height, header.channels, std::move(bytes));
    c.is_linear = header.is_linear;
    return c;
}

void append_bytes(png_structp png, png_bytep data, size_t size) {
    auto& bytes = *static_cast<std::string*>(png_get_io_ptr(png));
    bool is_stored = true;
    try {
        bytes.append(reinterpret_cast<const char*>(data), size);
    } catch (const std::exception&) {
        is_stored = false;
    }
    if (!is_stored) png_error(png, "not enough memory");
}
void flush_nothing(png_structp) {}

bool encode_rows(png_structp png, png_infop info, Escape& escape, std::string& bytes, int width,
                 int height, int channels, const uint8_t* codes) {
    if (setjmp(escape.place)) return false;
    png_set_write_fn(png, &bytes, append_bytes, flush_nothing);
    png_set_IHDR(png, info, png_uint_32(width), png_uint_32(height), 8,
                 channels == 1 ? PNG_COLOR_TYPE_GRAY : PNG_COLOR_TYPE_RGB, PNG_INTERLACE_NONE,
                 PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
    png_set_sRGB(png, info, PNG_sRGB_INTENT_PERCEPTUAL);
    png_write_info(png, info);
    for (int y = 0; y < height; ++y)
        png_write_row(png, codes + size_t(y) * size_t(width * channels));
    png_write_end(png, nullptr);
    return true;
}

// ------------------------------------------------------------------------------------------------------- JPEG

struct JpegErrors {
    jpeg_error_mgr manager;
    Escape escape;
};

void jpeg_fails(j_common_ptr info) {
    auto& errors = *reinterpret_cast<JpegErrors*>(info->err);
    char message[JMSG_LENGTH_MAX];
    info->err->format_message(info, message);
    std::snprintf(errors.escape.message, sizeof errors.escape.message, "%.199s", message);
    std::longjmp(errors.escape.place, 1);
}
void jpeg_warns(j_common_ptr, int) {}

bool read_jpeg_header(jpeg_decompress_struct& jpeg, std::string_view bytes, JpegErrors& errors) {
    if (setjmp(errors.escape.place)) return false;
    jpeg_create_decompress(&jpeg);
    jpeg_mem_src(&jpeg, reinterpret_cast<const unsigned char*>(bytes.data()),
                 static_cast<unsigned long>(bytes.size()));
    jpeg_read_header(&jpeg, TRUE);
    jpeg_start_decompress(&jpeg);
    return true;
}

bool read_jpeg_rows(jpeg_decompress_struct& jpeg, JpegErrors& errors, uint8_t* to, size_t row) {
    if (setjmp(errors.escape.place)) return false;
    while (jpeg.output_scanline < jpeg.output_height) {
        JSAMPROW at = to + size_t(jpeg.output_scanline) * row;
        jpeg_read_scanlines(&jpeg, &at, 1);
    }
    jpeg_finish_decompress(&jpeg);
    return true;
}

/// Adobe's files store how much light the inks let through.
std::vector<uint8_t> rgb_of_cmyk(const std::vector<uint8_t>& inks, bool is_inverted) {
    std::vector<uint8_t> colours;
    colours.reserve(inks.size() / 4 * 3);
    const auto passed = [&](uint8_t code) { return is_inverted ? code : 255 - code; };
    for (size_t i = 0; i < inks.size(); i += 4)
        for (size_t c = 0; c < 3; ++c)
            colours.push_back(uint8_t((passed(inks[i + c]) * passed(inks[i + 3]) + 127) / 255));
    return colours;
}

Contents read_jpeg(const Source& source) {
    const std::string& path = source.name;
    JpegErrors errors;
    jpeg_decompress_struct jpeg{};
    jpeg.err = jpeg_std_error(&errors.manager);
    errors.manager.error_exit = jpeg_fails;
    errors.manager.emit_message = jpeg_warns;
    struct Cleanup {
        jpeg_decompress_struct& of;
        ~Cleanup() { jpeg_destroy_decompress(&of); }
    } cleanup{jpeg};
    if (!read_jpeg_header(jpeg, source.bytes, errors)) fail_read(path, errors.escape.message);
    const int components = jpeg.output_components;
    if (components != 1 && components != 3 && components != 4)
        fail_read(path, "a JPEG must be grey, RGB or CMYK");
    check_size(source, jpeg.output_width, jpeg.output_height, size_t(components));
    const size_t row = size_t(jpeg.output_width) * size_t(components);
    std::vector<uint8_t> bytes(row * jpeg.output_height);
    if (!read_jpeg_rows(jpeg, errors, bytes.data(), row)) fail_read(path, errors.escape.message);
    if (components == 4) bytes = rgb_of_cmyk(bytes, jpeg.saw_Adobe_marker);
    return coded(int(jpeg.output_width), int(jpeg.output_height), components == 1 ? 1 : 3,
                 std::move(bytes));
}

// ------------------------------------------------------------------------------------------------------- HDR, PFM

/// The bytes of a file, read in order.
class Bytes {
public:
    explicit Bytes(const Source& source) : path_(source.name), bytes_(source.bytes) {}
    uint8_t next() {
        if (at_ >= bytes_.size()) fail_read(path_, "the file ends too early");
        return uint8_t(bytes_[at_++]);
    }
    std::string line() {
        const size_t end = bytes_.find('\n', at_);
        if (end == std::string::npos) fail_read(path_, "the header is incomplete");
        std::string text(bytes_.substr(at_, end - at_));
        at_ = end + 1;
        return text;
    }
    void skip_blanks() {
        while (at_ < bytes_.size() && std::isspace(static_cast<unsigned char>(bytes_[at_]))) ++at_;
    }
    /// The next word of a header; exactly one blank follows it.
    std::string word() {
        skip_blanks();
        if (at_ >= bytes_.size()) fail_read(path_, "the file ends too early");
        std::string text;
        while (at_ < bytes_.size() && !std::isspace(next())) text += bytes_[at_ - 1];
        return text;
    }
    size_t left() const { return bytes_.size() - at_; }
    const char* here() const { return bytes_.data() + at_; }

    /// A word that is a number.
    template <class T>
    T number() {
        std::string text = word();
        if (text.starts_with('+')) text.erase(0, 1);
        T value{};
        const char* const end = text.data() + text.size();
        const auto [rest, error] = std::from_chars(text.data(), end, value);
        if (error != std::errc() || rest != end)
            fail_read(path_, fmt::format("\"{}\" in its header is no number", text.substr(0, 40)));
        return value;
    }

private:
    std::string path_;
    std::string_view bytes_;
    size_t at_ = 0;
};

Contents radiance_of(int width, int height, int channels, std::vector<float> values) {
    Contents c;
    c.pixels.width = width, c.pixels.height = height, c.pixels.channels = channels;
    c.channels = channel_names(channels);
    c.pixels.data = std::move(values);
    return c;
}

/// One row of Radiance's format, with or without run lengths [Ward 1991].
void read_rgbe_row(Bytes& bytes, const std::string& path, size_t width, std::vector<uint8_t>& row) {
    row.resize(4 * width);
    uint8_t start[4];
    for (uint8_t& b : start) b = bytes.next();
    const bool has_runs = start[0] == 2 && start[1] == 2 && start[2] < 128;
    if (!has_runs) {
        std::copy(start, start + 4, row.begin());
        for (size_t i = 4; i < row.size(); ++i) row[i] = bytes.next();
        return;
    }
    if (size_t(start[2]) << 8 != width - start[3])
        fail_read(path, "a row has another length than the image");
    for (size_t c = 0; c < 4; ++c)
        for (size_t x = 0; x < width;) {
            const uint8_t count = bytes.next();
            const size_t run = count > 128 ? count - 128u : count;
            if (run == 0 || x + run > width) fail_read(path, "a run is longer than its row");
            uint8_t value = count > 128 ? bytes.next() : uint8_t(0);
            for (size_t i = 0; i < run; ++i, ++x) {
                if (count <= 128) value = bytes.next();
                row[4 * x + c] = value;
            }
        }
}

Contents read_rgbe(const Source& source) {
    const std::string& path = source.name;
    Bytes bytes(source);
    if (!bytes.line().starts_with("#?")) fail_read(path, "it does not begin with \"#?\"");
    while (!bytes.line().empty()) {
    }
    int width = 0, height = 0;
    const std::string size = bytes.line();
    if (std::sscanf(size.c_str(), "-Y %d +X %d", &height, &width) != 2 || width < 1 || height < 1)
        fail_read(path, "expected a size of the form \"-Y HEIGHT +X WIDTH\"");
    check_size(source, uint64_t(width), uint64_t(height), 12);
    std::vector<float> values;
    values.reserve(size_t(width) * size_t(height) * 3);
    std::vector<uint8_t> row;
    for (int y = 0; y < height; ++y) {
        read_rgbe_row(bytes, path, size_t(width), row);
        for (size_t x = 0; x < size_t(width); ++x) {
            const uint8_t* c = &row[4 * x];
            const float scale = c[3] > 0 ? std::ldexp(1.0f, int(c[3]) - 136) : 0.0f;
            for (int i = 0; i < 3; ++i) values.push_back(float(c[i]) * scale);
        }
    }
    return radiance_of(width, height, 3, std::move(values));
}

Contents read_pfm(const Source& source) {
    const std::string& path = source.name;
    Bytes bytes(source);
    const std::string kind = bytes.word();
    if (kind != "PF" && kind != "Pf") fail_read(path, "it does not begin with \"PF\" or \"Pf\"");
    const int channels = kind == "PF" ? 3 : 1;
    const int width = bytes.number<int>(), height = bytes.number<int>();
    const double scale = bytes.number<double>();
    if (width < 1 || height < 1 || !std::isfinite(scale) || scale == 0)
        fail_read(path, "its header is invalid");
    check_size(source, uint64_t(width), uint64_t(height), 4 * size_t(channels));
    const size_t row = size_t(width) * size_t(channels);
    if (bytes.left() < row * size_t(height) * 4) fail_read(path, "the file ends too early");
    std::vector<float> values(row * size_t(height));
    for (size_t y = 0; y < size_t(height); ++y)
        std::memcpy(&values[(size_t(height) - 1 - y) * row], bytes.here() + y * row * 4, row * 4);
    if (scale > 0)  // big-endian
        for (float& v : values) {
            uint32_t b = 0;
            std::memcpy(&b, &v, 4);
            b = __builtin_bswap32(b);
            std::memcpy(&v, &b, 4);
        }
    return radiance_of(width, height, channels, std::move(values));
}

/// Portable grey maps and pixmaps, as text or binary; binary numbers of 16 bits begin with the higher byte.
Contents read_pnm(const Source& source) {
    const std::string& path = source.name;
    Bytes bytes(source);
    const std::string kind = bytes.word();
    const bool is_text = kind == "P2" || kind == "P3";
    const int channels = kind == "P2" || kind == "P5" ? 1 : 3;
    const auto number = [&] {
        for (bytes.skip_blanks(); bytes.left() > 0 && *bytes.here() == '#'; bytes.skip_blanks())
            bytes.line();
        return bytes.number<int>();
    };
    const int width = number(), height = number(), largest = number();
    if (width < 1 || height < 1 || largest < 1 || largest > 65535)
        fail_read(path, "its header is invalid");
    const size_t code_bytes = largest > 255 ? 2 : 1;
    check_size(source, uint64_t(width), uint64_t(height), size_t(channels) * code_bytes);
    const size_t count = size_t(width) * size_t(height) * size_t(channels);
    std::string written;  // the numbers of a text, as a binary file has them
    if (is_text) {
        for (size_t i = 0; i < count; ++i) {
            const int code = number();
            if (code < 0 || code > largest)
                fail_read(path, fmt::format("the number {} is not in [0, {}]", code, largest));
            if (code_bytes == 2) written += char(code >> 8);
            written += char(code & 255);
        }
    } else if (bytes.left() < count * code_bytes) {
        fail_read(path, "the file ends too early");
    }
    const auto* const codes =
        reinterpret_cast<const uint8_t*>(is_text ? written.data() : bytes.here());
    if (largest == 255) return coded(width, height, channels, {codes, codes + count});
    Contents c = coded(width, height, channels, {});
    std::vector<float> values(count);
    for (size_t i = 0; i < count; ++i) {
        const int code = code_bytes == 1 ? codes[i] : codes[2 * i] << 8 | codes[2 * i + 1];
        values[i] = std::min(float(code) / float(largest), 1.0f);
    }
    c.pixels.data = std::move(values);
    c.largest_code = 1;
    return c;
}

// ------------------------------------------------------------------------------------------------------- TGA, BMP

Contents read_by_stb(const Source& source) {
    const std::string& path = source.name;
    const auto* const bytes = reinterpret_cast<const stbi_uc*>(source.bytes.data());
    if (source.bytes.size() > size_t(INT_MAX)) fail_read(path, "the file is too large");
    const int size = int(source.bytes.size());
    int width = 0, height = 0, channels = 0;
    if (!stbi_info_from_memory(bytes, size, &width, &height, &channels))
        fail_read(path, "its format is none of EXR, PNG, JPEG, HDR, PFM, TGA, BMP, PGM and PPM");
    check_size(source, uint64_t(width), uint64_t(height), size_t(channels));
    const std::unique_ptr<stbi_uc, void (*)(void*)> codes(
        stbi_load_from_memory(bytes, size, &width, &height, &channels, 0), stbi_image_free);
    if (!codes)
        fail_read(path, fmt::format("it is damaged or of a rare kind ({})", stbi_failure_reason()));
    const size_t count = size_t(width) * size_t(height) * size_t(channels);
    return coded(width, height, channels, {codes.get(), codes.get() + count});
}

// -------------------------------------------------------------------------------------------------------

std::string bytes_of(const std::string& path) {
    const auto fail = [&] { fail_read(path, std::generic_category().message(errno)); };
    const auto close = [](FILE* f) { std::fclose(f); };
    const std::unique_ptr<FILE, decltype(close)> file(std::fopen(path.c_str(), "rb"), close);
    if (!file) fail();
    std::string bytes(fs::file_size(path), '\0');
    bytes.resize(std::fread(bytes.data(), 1, bytes.size(), file.get()));
    if (std::ferror(file.get())) fail();
    return bytes;
}

/// By the first bytes, as a name may be wrong.
Contents contents_of(const Source& source, bool as_floats) {
    const std::string_view magic = source.bytes;
    try {
        if (magic.starts_with("\x76\x2f\x31\x01")) return read_exr(source, as_floats);
        if (magic.starts_with("\x89PNG")) return read_png(source);
        if (magic.starts_with("\xff\xd8\xff")) return read_jpeg(source);
        if (magic.starts_with("#?")) return read_rgbe(source);
        if (magic.starts_with("PF") || magic.starts_with("Pf")) return read_pfm(source);
        if (magic.size() > 2 && magic[0] == 'P' &&
            std::string_view("2356").find(magic[1]) != std::string_view::npos)
            return read_pnm(source);
        return read_by_stb(source);
    } catch (const std::bad_alloc&) {
        fail_read(source.name, "its pixels do not fit into memory");
    } catch (const Iex::BaseExc& e) {
        fail_read(source.name, e.what());
    }
}

Contents read_contents(const std::string& path, bool as_floats) {
    std::error_code error;
    const fs::file_status status = fs::status(path, error);
    if (!fs::exists(status)) fail_read(path, "there is no such file");
    if (!fs::is_regular_file(status)) fail_read(path, "it is not a regular file");
    const std::string bytes = bytes_of(path);
    return contents_of({path, bytes}, as_floats);
}

/// Codes become numbers in [0, 1], and those of colours linear.
std::vector<float> to_floats(const Contents& c, bool keep_codes) {
    std::vector<float> out;
    std::visit(
        [&](const auto& values) {
            out.reserve(values.size());
            const bool is_code = c.largest_code > 1;
            for (const auto v : values)
                out.push_back(is_code ? float(v) * (1.0f / float(c.largest_code)) : float(v));
        },
        c.pixels.data);
    if (!c.is_linear && !keep_codes)
        for (size_t i = 0; i < out.size(); ++i)
            if (int(i % size_t(c.pixels.channels)) != c.pixels.alpha_channel)
                out[i] = srgb_to_linear(out[i]);
    return out;
}

}  // namespace

Image read_image(const std::string& path) {
    Contents c = read_contents(path, true);
    Image image;
    image.width = c.pixels.width, image.height = c.pixels.height;
    image.data = to_floats(c, false);
    image.channels = std::move(c.channels);
    image.attributes = std::move(c.attributes);
    return image;
}

static PixelBuffer to_pixels(Contents c, bool raw) {
    const bool is_deep = std::holds_alternative<std::vector<float>>(c.pixels.data);
    if (is_deep && !c.is_linear && !raw) c.pixels.data = to_floats(c, false);
    return std::move(c.pixels);
}

PixelBuffer read_pixels(const std::string& path, bool raw) {
    return to_pixels(read_contents(path, false), raw);
}

PixelBuffer decode_pixels(const std::string& bytes, const std::string& name, bool raw) {
    return to_pixels(contents_of({name, bytes}, false), raw);
}

std::string encode_png(int width, int height, std::span<const uint8_t> codes) {
    const int channels = png_channels(width, height, codes.size());
    std::string bytes;
    Escape escape;
    png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, &escape, png_fails, png_warns);
    png_infop info = png_create_info_struct(png);
    const bool is_good =
        encode_rows(png, info, escape, bytes, width, height, channels, codes.data());
    png_destroy_write_struct(&png, &info);
    if (!is_good) throw std::runtime_error(fmt::format("cannot encode a PNG: {}", escape.message));
    return bytes;
}

void write_exr(OutputFile& file, const Image& image, ExrPrecision precision) {
    constexpr float kMaxHalf = 65504;
    const bool is_half = precision == ExrPrecision::Half;
    Imf::Header header(image.width, image.height);
    header.compression() = Imf::ZIP_COMPRESSION;
    for (const std::string& name : image.channels)
        header.channels().insert(name, Imf::Channel(is_half ? Imf::HALF : Imf::FLOAT));
    for (const auto& [name, value] : image.attributes) {
        if (const auto* text = std::get_if<std::string>(&value))
            header.insert(name, Imf::StringAttribute(*text));
        else
            header.insert(name, Imf::DoubleAttribute(std::get<double>(value)));
    }
    std::vector<Half> halves;
    if (is_half)
        for (const float v : image.data)
            halves.emplace_back(std::isfinite(v) ? std::clamp(v, -kMaxHalf, kMaxHalf) : v);
    const size_t size = is_half ? sizeof(Half) : sizeof(float);
    const size_t pixel = size * image.channels.size();
    char* base = is_half ? reinterpret_cast<char*>(halves.data())
                         : reinterpret_cast<char*>(const_cast<float*>(image.data.data()));
    try {
        ExrOutput target(file);
        Imf::OutputFile out(target, header);
        Imf::FrameBuffer buffer;
        for (size_t i = 0; i < image.channels.size(); ++i)
            buffer.insert(image.channels[i],
                          Imf::Slice(is_half ? Imf::HALF : Imf::FLOAT, base + i * size, pixel,
                                     pixel * size_t(image.width)));
        out.setFrameBuffer(buffer);
        out.writePixels(image.height);
    } catch (const Iex::BaseExc& e) {
        file.fail(e.what());
    }
}

}  // namespace etendue
