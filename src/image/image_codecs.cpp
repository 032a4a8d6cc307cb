// The file formats that need a library: .exr over OpenEXR, .png over libpng, .jpg over libjpeg, .tga and .bmp over
// stb_image; and what is common to the reading of all formats.

#include "image/image_codecs.h"

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <csetjmp>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <memory>
#include <mutex>
#include <new>
#include <numeric>
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
#include <OpenEXR/ImfThreading.h>
#include <fmt/format.h>
#include <jpeglib.h>

#include <jerror.h>
#include <png.h>
#include <stb_image.h>

#include "color/srgb.h"
#include "image/image_contents.h"
#include "image/plain_formats.h"
#include "system/available_memory.h"

namespace etendue {
namespace {

namespace fs = std::filesystem;

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
    explicit ExrInput(const ImageSource& source)
        : IStream(source.name.c_str()), bytes_(source.bytes) {}
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

ImageContents read_exr(const ImageSource& source, bool as_floats) {
    const std::string& path = source.name;
    ExrInput input(source);
    Imf::InputFile file(input);
    const Imf::Header& header = file.header();
    const Imath::Box2i window = header.dataWindow();
    ImageContents c;
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
    check_image_size(source, uint64_t(width), uint64_t(height), c.channels.size() * 4);
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

/// The library's state. Without it, most of its functions do nothing and report no error.
struct PngState {
    using Destroy = void(PngState&);
    /// Throws std::bad_alloc where the library has no memory for it.
    PngState(png_structp made, Destroy& destroy)
        : png(made), info(png ? png_create_info_struct(png) : nullptr), destroy(destroy) {
        if (info) return;
        destroy(*this);
        throw std::bad_alloc();
    }
    ~PngState() { destroy(*this); }
    PngState(const PngState&) = delete;
    PngState& operator=(const PngState&) = delete;

    png_structp png;
    png_infop info;

private:
    Destroy& destroy;
};
struct PngReader : PngState {
    explicit PngReader(Escape& escape)
        : PngState(png_create_read_struct(PNG_LIBPNG_VER_STRING, &escape, png_fails, png_warns),
                   destroy_reader) {}
    static void destroy_reader(PngState& s) { png_destroy_read_struct(&s.png, &s.info, nullptr); }
};

struct PngHeader {
    uint32_t width, height;
    int channels, depth;
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

std::vector<float> fractions_of(const std::vector<uint16_t>& codes) {
    std::vector<float> values(codes.size());
    for (size_t i = 0; i < values.size(); ++i) values[i] = float(codes[i]) * (1.0f / 65535.0f);
    return values;
}

ImageContents read_png(const ImageSource& source) {
    const std::string& path = source.name;
    std::string_view rest = source.bytes;
    Escape escape;
    PngReader reader(escape);
    PngHeader header{};
    if (!read_png_header(reader, rest, escape, header)) fail_read(path, escape.message);
    const size_t pixel = size_t(header.channels * header.depth / 8), row = header.width * pixel;
    check_image_size(source, header.width, header.height, pixel);
    // Codes of 16 bits are read in the order of this machine.
    const bool is_deep = header.depth == 16;
    std::vector<uint8_t> bytes(is_deep ? 0 : row * header.height);
    std::vector<uint16_t> deep(is_deep ? row * header.height / 2 : 0);
    auto* const first = is_deep ? reinterpret_cast<uint8_t*>(deep.data()) : bytes.data();
    std::vector<png_bytep> rows(header.height);
    for (size_t y = 0; y < rows.size(); ++y) rows[y] = first + y * row;
    if (!read_png_rows(reader, escape, rows.data())) fail_read(path, escape.message);
    const int width = int(header.width), height = int(header.height);
    // Whatever gAMA or a profile says: scenes decide whether codes are sRGB, as in Mitsuba, pbrt and glTF.
    return is_deep ? deeply_coded(width, height, header.channels, fractions_of(deep))
                   : coded(width, height, header.channels, std::move(bytes));
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
/// Errors stay in the file until its commit().
void write_bytes(png_structp png, png_bytep data, size_t size) {
    static_cast<OutputFile*>(png_get_io_ptr(png))->write(data, size);
}
void flush_nothing(png_structp) {}

/// A PNG file of 8-bit sRGB codes, row by row. `write` gets its bytes, and `target` by png_get_io_ptr().
class PngWriter {
public:
    PngWriter(png_rw_ptr write, void* target, int width, int height, int channels) {
        if (!begin(write, target, width, height, channels)) fail();
    }

    void add_row(const uint8_t* codes) {
        if (!try_to([&] { png_write_row(state_.png, codes); })) fail();
    }
    void end() {
        if (!try_to([&] { png_write_end(state_.png, nullptr); })) fail();
    }

private:
    bool begin(png_rw_ptr write, void* target, int width, int height, int channels) {
        return try_to([&] {
            png_set_write_fn(state_.png, target, write, flush_nothing);
            png_set_IHDR(state_.png, state_.info, png_uint_32(width), png_uint_32(height), 8,
                         channels == 1 ? PNG_COLOR_TYPE_GRAY : PNG_COLOR_TYPE_RGB,
                         PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
            png_set_sRGB(state_.png, state_.info, PNG_sRGB_INTENT_PERCEPTUAL);
            png_write_info(state_.png, state_.info);
        });
    }
    /// `call` must make no object with a destructor. Returns false after an error.
    template <class Call>
    bool try_to(const Call& call) {
        if (setjmp(escape_.place)) return false;
        call();
        return true;
    }
    [[noreturn]] void fail() const {
        throw std::runtime_error(fmt::format("cannot encode a PNG: {}", escape_.message));
    }

    static void destroy(PngState& s) { png_destroy_write_struct(&s.png, &s.info); }

    Escape escape_;
    PngState state_{png_create_write_struct(PNG_LIBPNG_VER_STRING, &escape_, png_fails, png_warns),
                    destroy};
};

// ------------------------------------------------------------------------------------------------------- JPEG

struct JpegErrors {
    jpeg_error_mgr manager;
    Escape escape;
};

[[noreturn]] void leave_jpeg(j_common_ptr info, const char* message) {
    auto& errors = *reinterpret_cast<JpegErrors*>(info->err);
    std::snprintf(errors.escape.message, sizeof errors.escape.message, "%.199s", message);
    std::longjmp(errors.escape.place, 1);
}
void jpeg_fails(j_common_ptr info) {
    char message[JMSG_LENGTH_MAX];
    info->err->format_message(info, message);
    leave_jpeg(info, message);
}
/// Most damages are small, but where data are missing, a part of the image is grey.
void jpeg_warns(j_common_ptr info, int) {
    if (info->err->msg_code == JWRN_HIT_MARKER) leave_jpeg(info, "its data end too early");
}
/// Every scan passes over all pixels, however short it is in the file.
void jpeg_goes_on(j_common_ptr info) {
    constexpr int kMostScans = 1000;
    if (reinterpret_cast<j_decompress_ptr>(info)->input_scan_number <= kMostScans) return;
    char message[64];
    std::snprintf(message, sizeof message, "it has more than %d scans", kMostScans);
    leave_jpeg(info, message);
}

bool read_jpeg_header(jpeg_decompress_struct& jpeg, std::string_view bytes, JpegErrors& errors) {
    if (setjmp(errors.escape.place)) return false;
    jpeg_create_decompress(&jpeg);
    jpeg_mem_src(&jpeg, reinterpret_cast<const unsigned char*>(bytes.data()),
                 static_cast<unsigned long>(bytes.size()));
    jpeg_read_header(&jpeg, TRUE);
    jpeg_calc_output_dimensions(&jpeg);
    return true;
}

bool read_jpeg_rows(jpeg_decompress_struct& jpeg, JpegErrors& errors, uint8_t* to, size_t row) {
    if (setjmp(errors.escape.place)) return false;
    jpeg_start_decompress(&jpeg);  // allocates memory
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

ImageContents read_jpeg(const ImageSource& source) {
    const std::string& path = source.name;
    JpegErrors errors;
    jpeg_decompress_struct jpeg{};
    jpeg.err = jpeg_std_error(&errors.manager);
    errors.manager.error_exit = jpeg_fails;
    errors.manager.emit_message = jpeg_warns;
    jpeg_progress_mgr progress{};
    progress.progress_monitor = jpeg_goes_on;
    struct Cleanup {
        jpeg_decompress_struct& of;
        ~Cleanup() { jpeg_destroy_decompress(&of); }
    } cleanup{jpeg};
    if (!read_jpeg_header(jpeg, source.bytes, errors)) fail_read(path, errors.escape.message);
    jpeg.progress = &progress;
    const int components = jpeg.output_components;
    if (components != 1 && components != 3 && components != 4)
        fail_read(path, "a JPEG must be grey, RGB or CMYK");
    // Several scans add to coefficients of 16 bits.
    const size_t coefficient_bytes = jpeg_has_multiple_scans(&jpeg) ? sizeof(JCOEF) : 0;
    check_image_size(source, jpeg.output_width, jpeg.output_height,
                     size_t(components) * (1 + coefficient_bytes));
    const size_t row = size_t(jpeg.output_width) * size_t(components);
    std::vector<uint8_t> bytes(row * jpeg.output_height);
    if (!read_jpeg_rows(jpeg, errors, bytes.data(), row)) fail_read(path, errors.escape.message);
    if (components == 4) bytes = rgb_of_cmyk(bytes, jpeg.saw_Adobe_marker);
    return coded(int(jpeg.output_width), int(jpeg.output_height), components == 1 ? 1 : 3,
                 std::move(bytes));
}

// ------------------------------------------------------------------------------------------------------- TGA, BMP

/// The bytes of a file for one call of stb_image, to which what follows the end is zero or undefined.
struct StbInput {
    std::string_view rest;
    /// The place where stb_image reads ahead: that of its first read.
    const char* buffer = nullptr;
    bool is_short = false;  ///< Whether it needed more bytes than there are.
};

int read_for_stb(void* user, char* to, int size) {
    auto& in = *static_cast<StbInput*>(user);
    if (!in.buffer) in.buffer = to;
    const size_t count = std::min(in.rest.size(), size_t(size));
    in.is_short |= count == 0 || (count < size_t(size) && to != in.buffer);
    std::memcpy(to, in.rest.data(), count);
    in.rest.remove_prefix(count);
    return int(count);
}
void skip_for_stb(void* user, int size) {
    auto& in = *static_cast<StbInput*>(user);
    in.rest.remove_prefix(std::min(in.rest.size(), size_t(size)));
}
int is_at_end_for_stb(void* user) {
    return static_cast<const StbInput*>(user)->rest.empty();
}

ImageContents read_by_stb(const ImageSource& source) {
    constexpr stbi_io_callbacks kInput{read_for_stb, skip_for_stb, is_at_end_for_stb};
    const std::string& path = source.name;
    StbInput header{source.bytes}, all{source.bytes};
    int width = 0, height = 0, channels = 0;
    if (!stbi_info_from_callbacks(&kInput, &header, &width, &height, &channels))
        fail_read(path, "its format is none of EXR, PNG, JPEG, HDR, PFM, TGA, BMP, PGM and PPM");
    check_image_size(source, uint64_t(width), uint64_t(height), size_t(channels));
    const std::unique_ptr<stbi_uc, void (*)(void*)> codes(
        stbi_load_from_callbacks(&kInput, &all, &width, &height, &channels, 0), stbi_image_free);
    if (all.is_short) fail_read(path, "the file ends too early");
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
    const auto size = fs::file_size(path);
    if (!MemoryWatch().add(size)) throw std::bad_alloc();
    std::string bytes(size, '\0');
    bytes.resize(std::fread(bytes.data(), 1, bytes.size(), file.get()));
    if (std::ferror(file.get())) fail();
    return bytes;
}

/// By the first bytes, as a name may be wrong.
ImageContents contents_of(const ImageSource& source, bool as_floats) {
    const std::string_view magic = source.bytes;
    try {
        if (magic.starts_with("\x76\x2f\x31\x01")) return read_exr(source, as_floats);
        if (magic.starts_with("\x89PNG")) return read_png(source);
        if (magic.starts_with("\xff\xd8\xff")) return read_jpeg(source);
        if (magic.starts_with("#?")) return read_rgbe(source);
        if (magic.starts_with("PF") || magic.starts_with("Pf")) return read_pfm(source);
        if (magic.starts_with("P2") || magic.starts_with("P3")) return read_pnm_text(source);
        if (magic.starts_with("P5") || magic.starts_with("P6")) return read_pnm(source);
        return read_by_stb(source);
    } catch (const Iex::BaseExc& e) {
        fail_read(source.name, e.what());
    }
}

ImageContents read_contents(const std::string& path, bool as_floats) {
    std::error_code error;
    const fs::file_status status = fs::status(path, error);
    if (!fs::exists(status)) fail_read(path, "there is no such file");
    if (!fs::is_regular_file(status)) fail_read(path, "it is not a regular file");
    const std::string bytes = bytes_of(path);
    return contents_of({path, bytes}, as_floats);
}

/// Codes become numbers in [0, 1], and those of colours linear.
std::vector<float> to_floats(const ImageContents& c, bool keep_codes) {
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

Image to_image(ImageContents c) {
    Image image;
    image.width = c.pixels.width, image.height = c.pixels.height;
    image.data = to_floats(c, false);
    image.channels = std::move(c.channels);
    image.attributes = std::move(c.attributes);
    return image;
}

/// Leaves the colours, or grey, and behind them alpha, whatever other channels there are.
void keep_colours(ImageContents& c, const std::string& name) {
    std::vector<int> kept;
    try {
        const auto& index = rgb_channels(c.channels).index;
        kept.assign(index, index + (index[0] == index[1] ? 1 : 3));
    } catch (const std::runtime_error& e) {
        fail_read(name, e.what());
    }
    PixelBuffer& p = c.pixels;
    if (p.alpha_channel >= 0) {
        auto at = std::find(kept.begin(), kept.end(), p.alpha_channel);
        if (at == kept.end()) at = kept.insert(at, p.alpha_channel);
        p.alpha_channel = int(at - kept.begin());
    }
    std::vector<int> all(size_t(p.channels));
    std::iota(all.begin(), all.end(), 0);
    if (kept == all) return;
    std::visit(
        [&](auto& values) {
            std::remove_reference_t<decltype(values)> some;
            some.reserve(values.size() / all.size() * kept.size());
            for (size_t pixel = 0; pixel < values.size(); pixel += all.size())
                for (const int channel : kept) some.push_back(values[pixel + size_t(channel)]);
            values = std::move(some);
        },
        p.data);
    p.channels = int(kept.size());
}

PixelBuffer to_pixels(ImageContents c, const std::string& name, bool raw) {
    keep_colours(c, name);
    const bool is_deep = std::holds_alternative<std::vector<float>>(c.pixels.data);
    if (is_deep && !c.is_linear && !raw) c.pixels.data = to_floats(c, false);
    return std::move(c.pixels);
}

}  // namespace

Image read_image(const std::string& path) {
    return decode_in_memory(path, [&] { return to_image(read_contents(path, true)); });
}

Image decode_image(const std::string& bytes, const std::string& name) {
    return decode_in_memory(name, [&] { return to_image(contents_of({name, bytes}, true)); });
}

PixelBuffer read_pixels(const std::string& path, bool raw) {
    return decode_in_memory(path, [&] { return to_pixels(read_contents(path, false), path, raw); });
}

PixelBuffer decode_pixels(const std::string& bytes, const std::string& name, bool raw) {
    return decode_in_memory(name, [&] {
        return to_pixels(contents_of({name, bytes}, false), name, raw);
    });
}

std::string encode_png(int width, int height, std::span<const uint8_t> codes) {
    const int channels = png_channels(width, height, codes.size());
    std::string bytes;
    PngWriter png(append_bytes, &bytes, width, height, channels);
    for (int y = 0; y < height; ++y) png.add_row(&codes[size_t(y) * size_t(width * channels)]);
    png.end();
    return bytes;
}

void write_png(OutputFile& file, const ImageRows& image, const WriteOptions&) {
    PngWriter png(write_bytes, &file, image.width, image.height, 3);
    for_each_rgb_row(image,
                     [&](int, std::span<const Rgb> row) { png.add_row(srgb_codes(row).data()); });
    png.end();
}

namespace {

/// Makes sure that OpenEXR has so many threads, and returns how many a file may use: 0 for those that are soon written or
/// if there is no memory for threads. They are never ended, because tasks that other files have begun would get lost.
int exr_threads(int threads, uint64_t values) {
    constexpr uint64_t kLeast = 1 << 22;
    if (threads < 2 || values < kLeast) return 0;
    static std::mutex mutex;
    const std::lock_guard lock(mutex);
    try {
        if (Imf::globalThreadCount() < threads) Imf::setGlobalThreadCount(threads);
    } catch (const std::system_error&) {
        return 0;
    }
    return threads;
}

}  // namespace

void write_exr(OutputFile& file, const ImageRows& image, const WriteOptions& options) {
    constexpr float kMaxHalf = 65504;
    constexpr int kBlock = 16;  // rows, which ZIP_COMPRESSION compresses together
    constexpr size_t kMostValues = 1 << 24;
    const bool is_half = options.precision == ExrPrecision::Half;
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
    const size_t row = size_t(image.width) * image.channels.size();
    const int threads = exr_threads(options.threads, row * size_t(image.height));
    // Two blocks for each thread.
    const int blocks = std::clamp(int(kMostValues / (row * kBlock)), 1, std::max(1, 2 * threads)),
              rows = kBlock * blocks;
    std::vector<float> values(row * size_t(rows));
    std::vector<Half> halves(is_half ? values.size() : 0);
    const size_t size = is_half ? sizeof(Half) : sizeof(float);
    char* const base =
        is_half ? reinterpret_cast<char*>(halves.data()) : reinterpret_cast<char*>(values.data());
    try {
        ExrOutput target(file);
        Imf::OutputFile out(target, header, std::min(threads, blocks));
        for (int begin = 0; begin < image.height; begin += rows) {
            const int end = std::min(begin + rows, image.height);
            for (int y = begin; y < end; ++y)
                image.make(y, std::span(values).subspan(size_t(y - begin) * row, row));
            for (size_t i = 0; i < halves.size(); ++i)
                halves[i] = std::isfinite(values[i]) ? std::clamp(values[i], -kMaxHalf, kMaxHalf)
                                                     : values[i];
            Imf::FrameBuffer buffer;
            for (size_t c = 0; c < image.channels.size(); ++c)
                // OpenEXR counts rows from that of the image.
                buffer.insert(image.channels[c],
                              Imf::Slice(is_half ? Imf::HALF : Imf::FLOAT,
                                         base + c * size - size_t(begin) * row * size,
                                         size * image.channels.size(), row * size));
            out.setFrameBuffer(buffer);
            out.writePixels(end - begin);
        }
    } catch (const Iex::BaseExc& e) {
        file.fail(e.what());
    }
}

}  // namespace etendue
