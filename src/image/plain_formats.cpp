#include "image/plain_formats.h"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <cstring>

#include <fmt/format.h>

namespace etendue {
namespace {

/// The bytes of a file, read in order.
class Bytes {
public:
    explicit Bytes(const ImageSource& source) : path_(source.name), bytes_(source.bytes) {}
    uint8_t next() {
        if (at_ >= bytes_.size()) fail_read(path_, "the file ends too early");
        return uint8_t(bytes_[at_++]);
    }
    std::string line() {
        const size_t end = bytes_.find('\n', at_);
        if (end == std::string::npos) fail_read(path_, "the header is incomplete");
        std::string text(bytes_.substr(at_, end - at_));
        if (text.ends_with('\r')) text.pop_back();
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

/// One row of Radiance's format, with or without run lengths [Ward 1991].
void read_rgbe_row(Bytes& bytes, const std::string& path, size_t width, std::vector<uint8_t>& row) {
    row.resize(4 * width);
    uint8_t start[4];
    for (uint8_t& b : start) b = bytes.next();
    const bool has_runs =
        width >= 8 && width < 32768 && start[0] == 2 && start[1] == 2 && start[2] < 128;
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

/// Of portable grey maps and pixmaps.
struct PnmHeader {
    int channels, width, height, largest;  ///< The largest number that a value may have.

    size_t value_bytes() const { return largest > 255 ? 2 : 1; }
    size_t values() const { return size_t(width) * size_t(height) * size_t(channels); }
};

/// The next number, after comments.
int pnm_number(Bytes& bytes) {
    for (bytes.skip_blanks(); bytes.left() > 0 && *bytes.here() == '#'; bytes.skip_blanks())
        bytes.line();
    return bytes.number<int>();
}

PnmHeader read_pnm_header(const ImageSource& source, Bytes& bytes) {
    const std::string kind = bytes.word();
    if (kind.size() != 2)  // whoever called has seen the first two characters
        fail_read(source.name, "it does not begin with \"P2\", \"P3\", \"P5\" or \"P6\"");
    PnmHeader h{};
    h.channels = kind == "P2" || kind == "P5" ? 1 : 3;
    h.width = pnm_number(bytes), h.height = pnm_number(bytes), h.largest = pnm_number(bytes);
    if (h.width < 1 || h.height < 1 || h.largest < 1 || h.largest > 65535)
        fail_read(source.name, "its header is invalid");
    check_image_size(source, uint64_t(h.width), uint64_t(h.height),
                     size_t(h.channels) * h.value_bytes());
    return h;
}

/// The image of the values that `next` returns.
template <class Next>
ImageContents pnm_contents(const PnmHeader& h, const Next& next) {
    if (h.largest == 255) {
        std::vector<uint8_t> codes(h.values());
        for (uint8_t& code : codes) code = uint8_t(next());
        return coded(h.width, h.height, h.channels, std::move(codes));
    }
    std::vector<float> values(h.values());
    for (float& v : values) v = std::min(float(next()) / float(h.largest), 1.0f);
    return deeply_coded(h.width, h.height, h.channels, std::move(values));
}

}  // namespace

ImageContents read_rgbe(const ImageSource& source) {
    const std::string& path = source.name;
    Bytes bytes(source);
    if (!bytes.line().starts_with("#?")) fail_read(path, "it does not begin with \"#?\"");
    constexpr std::string_view kFormat = "FORMAT=", kColours = "32-bit_rle_rgbe";
    for (std::string line; !(line = bytes.line()).empty();)
        if (line.starts_with(kFormat) && !line.substr(kFormat.size()).starts_with(kColours))
            fail_read(path, fmt::format("its format is \"{}\", but must be \"{}\"",
                                        line.substr(kFormat.size(), 40), kColours));
    int width = 0, height = 0;
    const std::string size = bytes.line();
    if (std::sscanf(size.c_str(), "-Y %d +X %d", &height, &width) != 2 || width < 1 || height < 1)
        fail_read(path, "expected a size of the form \"-Y HEIGHT +X WIDTH\"");
    check_image_size(source, uint64_t(width), uint64_t(height), 12);
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

ImageContents read_pfm(const ImageSource& source) {
    const std::string& path = source.name;
    Bytes bytes(source);
    const std::string kind = bytes.word();
    if (kind != "PF" && kind != "Pf") fail_read(path, "it does not begin with \"PF\" or \"Pf\"");
    const int channels = kind == "PF" ? 3 : 1;
    const int width = bytes.number<int>(), height = bytes.number<int>();
    const double scale = bytes.number<double>();
    if (width < 1 || height < 1 || !std::isfinite(scale) || scale == 0)
        fail_read(path, "its header is invalid");
    check_image_size(source, uint64_t(width), uint64_t(height), 4 * size_t(channels));
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

ImageContents read_pnm(const ImageSource& source) {
    Bytes bytes(source);
    const PnmHeader h = read_pnm_header(source, bytes);
    if (bytes.left() < h.values() * h.value_bytes())
        fail_read(source.name, "the file ends too early");
    return pnm_contents(h, [&] {
        const int high = h.value_bytes() == 2 ? bytes.next() << 8 : 0;
        return high | bytes.next();
    });
}

ImageContents read_pnm_text(const ImageSource& source) {
    Bytes bytes(source);
    const PnmHeader h = read_pnm_header(source, bytes);
    return pnm_contents(h, [&] {
        const int value = pnm_number(bytes);
        if (value < 0 || value > h.largest)
            fail_read(source.name,
                      fmt::format("the number {} is not in [0, {}]", value, h.largest));
        return value;
    });
}

}  // namespace etendue
