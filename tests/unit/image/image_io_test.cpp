#include "image/image_io.h"

#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmath>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <limits>

#include <gtest/gtest.h>

#include "error_of.h"
#include "math/hash.h"
#include "math/vec.h"
#include "no_memory_for_png.h"
#include "run_program.h"

namespace etendue::test {
namespace {

namespace fs = std::filesystem;

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

class ImageIo : public testing::Test {
protected:
    std::string file(const std::string& name) const { return (folder_ / name).string(); }
    std::string write_bytes(const std::string& name, const std::string& bytes) const {
        std::ofstream(file(name), std::ios::binary) << bytes;
        return file(name);
    }
    size_t file_count() const {
        return size_t(std::distance(fs::directory_iterator(folder_), fs::directory_iterator()));
    }

    const TemporaryFolder temporary_;
    const fs::path folder_ = temporary_.path();
};

/// Values that halves hold exactly.
Image sample_image(std::vector<std::string> channels) {
    Image image(5, 3, std::move(channels));
    for (size_t i = 0; i < image.data.size(); ++i) image.data[i] = float(i) * 0.25f - 3;
    return image;
}

TEST_F(ImageIo, ExrKeepsChannelsAttributesAndEveryBit) {
    Image image = sample_image({"R", "G", "B", "albedo.R", "albedo.G", "albedo.B", "variance.Y"});
    image.at(1, 2, 0) = kNaN;
    image.at(2, 2, 0) = std::numeric_limits<float>::infinity();
    image.at(3, 2, 1) = 1e-42f;
    image.at(4, 2, 1) = 3e38f;
    image.attributes = {{"integrator", std::string("bdpt, \"quoted\"\nline")},
                        {"samples", 1e15 + 1},
                        {"seconds", 0.1}};
    write_image(file("a.exr"), image);
    const Image read = read_image(file("a.exr"));
    ASSERT_EQ(read.width, 5);
    ASSERT_EQ(read.height, 3);
    ASSERT_EQ(read.channels.size(), image.channels.size());
    for (size_t c = 0; c < image.channels.size(); ++c) {
        const int k = read.channel(image.channels[c]);
        ASSERT_GE(k, 0) << image.channels[c];
        for (int y = 0; y < 3; ++y)
            for (int x = 0; x < 5; ++x)
                EXPECT_EQ(std::bit_cast<uint32_t>(read.at(x, y, k)),
                          std::bit_cast<uint32_t>(image.at(x, y, int(c))));
    }
    EXPECT_EQ(read.attributes, image.attributes);
    EXPECT_EQ(file_count(), 1u);
}

TEST_F(ImageIo, ExrIsTheSameFileEachTime) {
    const Image image = sample_image({"R", "G", "B"});
    const auto bytes = [&](const std::string& name) {
        write_image(file(name), image);
        std::ifstream in(file(name), std::ios::binary);
        return std::string(std::istreambuf_iterator<char>(in), {});
    };
    const std::string first = bytes("a.exr");
    EXPECT_EQ(first.find(":2"), std::string::npos) << "a date";
    EXPECT_EQ(first, bytes("b.exr"));
}

TEST_F(ImageIo, ExrIsTheSameFileForAnyNumberOfThreads) {
    // So large that several threads compress it, with a last block of fewer rows.
    Image image(1200, 1205, {"R", "G", "B"});
    for (size_t i = 0; i < image.data.size(); ++i) image.data[i] = float(mix64(i) % 64);
    for (const ExrPrecision precision : {ExrPrecision::Float, ExrPrecision::Half}) {
        const auto bytes = [&](int threads) {
            write_image(file("a.exr"), image, {.precision = precision, .threads = threads});
            std::ifstream in(file("a.exr"), std::ios::binary);
            return std::string(std::istreambuf_iterator<char>(in), {});
        };
        const std::string one = bytes(1);
        EXPECT_EQ(read_image(file("a.exr")).data, image.data);
        for (const int threads : {3, 2, 1}) EXPECT_TRUE(bytes(threads) == one) << threads;
    }
}

TEST_F(ImageIo, HalfExrRoundsAndClamps) {
    Image image = sample_image({"R", "G", "B", "A"});
    image.at(0, 0, 0) = 1e6f;
    image.at(1, 0, 0) = 0.1f;
    write_image(file("a.exr"), image, {.precision = ExrPrecision::Half});
    const Image read = read_image(file("a.exr"));
    EXPECT_EQ(read.at(0, 0, 0), 65504);
    EXPECT_EQ(read.at(1, 0, 0), 0.0999755859375f);
    EXPECT_EQ(read.at(4, 2, 3), image.at(4, 2, 3));
    const PixelBuffer buffer = read_pixels(file("a.exr"), false);
    ASSERT_TRUE(std::holds_alternative<std::vector<Half>>(buffer.data));
    EXPECT_EQ(float(std::get<std::vector<Half>>(buffer.data)[4]), 0.0999755859375f);
    EXPECT_EQ(buffer.alpha_channel, 3);
    EXPECT_EQ(buffer.memory_bytes(), 5u * 3 * 4 * 2);
}

/// An image of one pixel with the values 1, 2, 3, ... in these channels.
Image counted(const std::vector<std::string>& channels) {
    Image image(1, 1, channels);
    for (size_t c = 0; c < channels.size(); ++c) image.data[c] = float(c + 1);
    return image;
}

// The channels of a texture are those of the colours and alpha, whatever others there are and in whatever order.
TEST_F(ImageIo, PixelsOfExrAreChosenByName) {
    struct Case {
        std::vector<std::string> channels;
        std::vector<float> values;
        int alpha;
    };
    const Case cases[] = {
        {{"R", "G", "B"}, {1, 2, 3}, -1},
        {{"A", "B", "G", "R"}, {4, 3, 2, 1}, 3},
        {{"A", "Y"}, {2, 1}, 1},
        {{"Z", "Y"}, {2}, -1},
        {{"density"}, {1}, -1},
        {{"A"}, {1}, 0},
        {{"A", "albedo.R", "albedo.G", "albedo.B", "R", "G", "B", "Z"}, {5, 6, 7, 1}, 3}};
    for (const ExrPrecision precision : {ExrPrecision::Float, ExrPrecision::Half})
        for (const Case& c : cases) {
            SCOPED_TRACE(testing::PrintToString(c.channels));
            write_image(file("a.exr"), counted(c.channels), {.precision = precision});
            const PixelBuffer pixels = read_pixels(file("a.exr"), false);
            EXPECT_EQ(pixels.channels, int(c.values.size()));
            EXPECT_EQ(pixels.alpha_channel, c.alpha);
            std::visit(
                [&](const auto& data) {
                    EXPECT_EQ(std::vector<float>(data.begin(), data.end()), c.values);
                },
                pixels.data);
        }
    for (const auto& channels :
         {std::vector<std::string>{"depth.Z", "image.R", "image.G", "image.B"}, {"r", "g", "b"}}) {
        write_image(file("a.exr"), counted(channels));
        const std::string why = error_of([&] { read_pixels(file("a.exr"), false); });
        EXPECT_NE(why.find("a.exr\": the image has no channels R, G, B (it has: "),
                  std::string::npos)
            << why;
    }
}

TEST_F(ImageIo, PfmRoundTrip) {
    for (const auto& channels :
         {std::vector<std::string>{"R", "G", "B"}, std::vector<std::string>{"Y"}}) {
        const Image image = sample_image(channels);
        write_image(file("a.pfm"), image);
        const Image read = read_image(file("a.pfm"));
        EXPECT_EQ(read.channels.size(), channels.size());
        EXPECT_EQ(read.data, image.data);
    }
}

TEST_F(ImageIo, PfmOfKnownBytes) {
    // Bottom row first; big-endian where the scale is positive.
    const std::string one("\x3f\x80\0\0", 4), two("\x40\0\0\0", 4);
    Image image = read_image(write_bytes("big.pfm", "Pf\n1 2\n1.0\n" + one + two));
    EXPECT_EQ(image.data, (std::vector<float>{2, 1}));
    const std::string one_le("\0\0\x80\x3f", 4), two_le("\0\0\0\x40", 4);
    image = read_image(write_bytes("little.pfm", "Pf\n1 2\n-1.0\n" + one_le + two_le));
    EXPECT_EQ(image.data, (std::vector<float>{2, 1}));
    image = Image(1, 2, {"Y"});
    image.data = {2, 1};
    write_image(file("out.pfm"), image);
    std::ifstream in(file("out.pfm"), std::ios::binary);
    EXPECT_EQ(std::string(std::istreambuf_iterator<char>(in), {}),
              "Pf\n1 2\n-1.0\n" + one_le + two_le);
}

TEST_F(ImageIo, HdrHoldsEightBitsOfMantissa) {
    const Image image = rgb_image(2, 1, std::vector<Rgb>{Rgb(0.001f, 1000, 3), Rgb(0.3f)});
    write_image(file("a.hdr"), image);
    const Image read = read_image(file("a.hdr"));
    EXPECT_NEAR(read.at(0, 0, 1), 1000, 8);
    EXPECT_NEAR(read.at(1, 0, 2), 0.3f, 0.003f);
}

/// Of the other channels there is as much as without them.
TEST_F(ImageIo, HdrHasZeroForNaN) {
    for (int at = 0; at < 3; ++at) {
        Rgb c(1);
        c[at] = kNaN;
        write_image(file("a.hdr"), rgb_image(1, 1, std::vector<Rgb>{c}));
        const Image read = read_image(file("a.hdr"));
        for (int i = 0; i < 3; ++i) EXPECT_NEAR(read.at(0, 0, i), i == at ? 0 : 1, 0.01f) << at;
    }
    write_image(file("a.hdr"), rgb_image(1, 1, std::vector<Rgb>{Rgb(kInf, -kInf, kNaN)}));
    const Image read = read_image(file("a.hdr"));
    EXPECT_GT(read.at(0, 0, 0), 1e37f);
    EXPECT_EQ(read.at(0, 0, 1), 0);
    EXPECT_EQ(read.at(0, 0, 2), 0);
}

/// Without its state, the library does nothing and reports no error.
TEST_F(ImageIo, PngWithoutMemoryIsAnError) {
    const Image image = sample_image({"R", "G", "B"});
    write_image(file("a.png"), image);
    const auto size = fs::file_size(file("a.png"));
    for (const int what : {1, 2}) {
        const NoMemoryForPng none(what);
        EXPECT_THROW(write_image(file("a.png"), image), std::bad_alloc) << what;
        EXPECT_THROW(encode_png(2, 2, std::vector<uint8_t>(12)), std::bad_alloc) << what;
        EXPECT_ANY_THROW(read_image(file("a.png"))) << what;
        EXPECT_EQ(fs::file_size(file("a.png")), size) << what;
    }
    EXPECT_NO_THROW(read_image(file("a.png")));
}

TEST_F(ImageIo, PngIsSrgbAndClamped) {
    const std::vector<Rgb> pixels = {Rgb(-1, 0.5f, 2), Rgb(1, kNaN, 1), Rgb(kInf, 0.0031308f, 1)};
    write_image(file("a.png"), rgb_image(3, 1, pixels));
    const PixelBuffer codes = read_pixels(file("a.png"), true);
    EXPECT_EQ(std::get<std::vector<uint8_t>>(codes.data),
              (std::vector<uint8_t>{0, 188, 255, 255, 0, 255, 255, 10, 255}));
    const Image linear = read_image(file("a.png"));
    EXPECT_NEAR(linear.at(0, 0, 1), 0.502886f, 1e-5);
    EXPECT_EQ(linear.at(0, 0, 2), 1);
}

// 2 × 1 pixels of RGBA: (190, 193, 150, 42), (255, 0, 128, 0).
const unsigned char kRgbaPng[] = {
    0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a, 0x00, 0x00, 0x00, 0x0d, 0x49, 0x48, 0x44,
    0x52, 0x00, 0x00, 0x00, 0x02, 0x00, 0x00, 0x00, 0x01, 0x08, 0x06, 0x00, 0x00, 0x00, 0xf4,
    0x22, 0x7f, 0x8a, 0x00, 0x00, 0x00, 0x11, 0x49, 0x44, 0x41, 0x54, 0x78, 0xda, 0x63, 0xd8,
    0x77, 0x70, 0x9a, 0xd6, 0x7f, 0x86, 0x06, 0x06, 0x00, 0x14, 0x92, 0x03, 0xbf, 0x83, 0xc7,
    0x7f, 0x51, 0x00, 0x00, 0x00, 0x00, 0x49, 0x45, 0x4e, 0x44, 0xae, 0x42, 0x60, 0x82};
// 2 × 1 pixels of 16-bit grey: 0x8000, 0xffff.
const unsigned char kGrey16Png[] = {
    0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a, 0x00, 0x00, 0x00, 0x0d, 0x49, 0x48,
    0x44, 0x52, 0x00, 0x00, 0x00, 0x02, 0x00, 0x00, 0x00, 0x01, 0x10, 0x00, 0x00, 0x00,
    0x00, 0x81, 0xd9, 0xfc, 0x15, 0x00, 0x00, 0x00, 0x0d, 0x49, 0x44, 0x41, 0x54, 0x78,
    0xda, 0x63, 0x68, 0x60, 0xf8, 0xff, 0x1f, 0x00, 0x05, 0x02, 0x02, 0x7f, 0xc9, 0x00,
    0xd6, 0x75, 0x00, 0x00, 0x00, 0x00, 0x49, 0x45, 0x4e, 0x44, 0xae, 0x42, 0x60, 0x82};

template <size_t N>
std::string bytes(const unsigned char (&data)[N]) {
    return std::string(reinterpret_cast<const char*>(data), N);
}

TEST_F(ImageIo, AlphaIsNeitherMultipliedInNorDecoded) {
    const std::string path = write_bytes("rgba.png", bytes(kRgbaPng));
    const PixelBuffer codes = read_pixels(path, false);
    EXPECT_EQ(codes.alpha_channel, 3);
    EXPECT_EQ(std::get<std::vector<uint8_t>>(codes.data),
              (std::vector<uint8_t>{190, 193, 150, 42, 255, 0, 128, 0}));
    const Image image = read_image(path);
    EXPECT_NEAR(image.at(0, 0, 0), 0.51491784f, 1e-6);
    EXPECT_NEAR(image.at(0, 0, 3), 42 / 255.0f, 1e-6);
    EXPECT_EQ(image.at(1, 0, 0), 1);
}

TEST_F(ImageIo, SixteenBitsBecomeFloats) {
    const std::string path = write_bytes("grey.png", bytes(kGrey16Png));
    const auto raw = std::get<std::vector<float>>(read_pixels(path, true).data);
    EXPECT_NEAR(raw[0], 32768 / 65535.0, 1e-7);
    const auto decoded = std::get<std::vector<float>>(read_pixels(path, false).data);
    EXPECT_NEAR(decoded[0], std::pow((32768 / 65535.0 + 0.055) / 1.055, 2.4), 1e-6);
    EXPECT_EQ(decoded[1], 1);
}

/// A PNG with the chunk gAMA for linear codes behind its header.
std::string declared_linear(std::string png) {
    constexpr size_t kAfterHeader = 8 + 25;
    png.insert(kAfterHeader, std::string("\0\0\0\4gAMA\0\1\x86\xa0\x31\xe8\x96\x5f", 16));
    return png;
}

TEST_F(ImageIo, GammaOfPngHasNoEffect) {
    for (const std::string& png : {bytes(kRgbaPng), bytes(kGrey16Png)}) {
        const std::string plain = write_bytes("a.png", png),
                          linear = write_bytes("b.png", declared_linear(png));
        EXPECT_EQ(read_image(linear).data, read_image(plain).data);
        for (const bool raw : {false, true})
            EXPECT_EQ(read_pixels(linear, raw).data, read_pixels(plain, raw).data);
    }
}

/// Two rows of two pixels: red and green above, blue and half grey below.
const std::vector<uint8_t> kFourColours = {255, 0, 0, 0, 255, 0, 0, 0, 255, 128, 128, 128};

TEST_F(ImageIo, ReadsTargaWithAndWithoutRuns) {
    const std::string size = {2, 0, 2, 0, 24, 0x20};  // rows from the top
    const std::string header = {0, 0, 2, 0, 0, 0, 0, 0, 0, 0, 0, 0};
    const std::string bgr = {0, 0, -1, 0, -1, 0, -1, 0, 0, -128, -128, -128};
    const PixelBuffer plain = read_pixels(write_bytes("a.tga", header + size + bgr), false);
    EXPECT_EQ(plain.channels, 3);
    EXPECT_EQ(std::get<std::vector<uint8_t>>(plain.data), kFourColours);
    std::string with_runs = header;
    with_runs[2] = 10;
    // A run of two pixels of one colour, and a packet of two.
    with_runs += size + std::string{-127, 0, 0, -1, 1, -1, 0, 0, -128, -128, -128};
    const PixelBuffer runs = read_pixels(write_bytes("b.tga", with_runs), false);
    EXPECT_EQ(std::get<std::vector<uint8_t>>(runs.data),
              (std::vector<uint8_t>{255, 0, 0, 255, 0, 0, 0, 0, 255, 128, 128, 128}));
}

TEST_F(ImageIo, ReadsBitmaps) {
    const auto word = [](uint32_t v) {
        return std::string{char(v), char(v >> 8), char(v >> 16), char(v >> 24)};
    };
    const std::string size_planes_bits = word(2) + word(2) + std::string{1, 0, 24, 0};
    // Rows from the bottom, each a multiple of four bytes.
    const std::string pixels = {-1, 0, 0, -128, -128, -128, 0, 0, 0, 0, -1, 0, -1, 0, 0, 0};
    const std::string file = "BM" + word(54 + 16) + word(0) + word(54) + word(40) +
                             size_planes_bits + word(0) + word(16) + word(0) + word(0) + word(0) +
                             word(0) + pixels;
    const PixelBuffer buffer = read_pixels(write_bytes("a.bmp", file), false);
    EXPECT_EQ(buffer.width, 2);
    EXPECT_EQ(std::get<std::vector<uint8_t>>(buffer.data), kFourColours);
}

TEST_F(ImageIo, ReadsPortableMaps) {
    const std::string colours(kFourColours.begin(), kFourColours.end());
    const Image image = read_image(write_bytes("a.ppm", "P6\n2 2\n255\n" + colours));
    EXPECT_EQ(image.channels, (std::vector<std::string>{"R", "G", "B"}));
    EXPECT_EQ(image.at(0, 0, 0), 1);
    EXPECT_NEAR(image.at(1, 1, 0), std::pow((128 / 255.0 + 0.055) / 1.055, 2.4), 1e-6);
    const std::string deep = "P5\n2 1\n65535\n" + std::string{-128, 0, -1, -1};
    const auto raw =
        std::get<std::vector<float>>(read_pixels(write_bytes("b.pgm", deep), true).data);
    EXPECT_NEAR(raw[0], 32768 / 65535.0, 1e-7);
    EXPECT_EQ(raw[1], 1);
    const PixelBuffer text = read_pixels(
        write_bytes("c.ppm", "P3 # colours\n2 2\n255\n255 0 0  0 255 0\n0 0 255 128 128 128"),
        false);
    EXPECT_EQ(std::get<std::vector<uint8_t>>(text.data), kFourColours);
    EXPECT_NE(error_of([&] {
                  read_pixels(write_bytes("d.pgm", "P2\n2 1\n15\n3 16\n"), false);
              }).find("the number 16 is not in [0, 15]"),
              std::string::npos);
}

TEST_F(ImageIo, OtherFormatsAreRefusedByName) {
    const std::string why = error_of([&] { read_image(write_bytes("a.tif", "II*\0 and so on")); });
    EXPECT_NE(why.find("its format is none of EXR, PNG, JPEG, HDR, PFM, TGA, BMP, PGM and PPM"),
              std::string::npos)
        << why;
}

TEST_F(ImageIo, ReadErrorsNameTheFile) {
    const std::string missing = file("missing.exr");
    EXPECT_EQ(error_of([&] { read_image(missing); }),
              "cannot read \"" + missing + "\": there is no such file");
    EXPECT_NE(error_of([&] { read_image(folder_.string()); }).find("it is not a regular file"),
              std::string::npos);
    const std::string text = write_bytes("text.exr", "not an image");
    EXPECT_NE(error_of([&] { read_pixels(text, false); }).find(text), std::string::npos);
    EXPECT_NE(error_of([&] { read_image(write_bytes("empty.png", "")); }).find("empty.png"),
              std::string::npos);
    // A header that claims far more pixels than the file can hold.
    EXPECT_NE(error_of([&] {
                  read_image(write_bytes("huge.pfm", "PF\n60000 60000\n-1.0\nxxxx"));
              }).find("60000"),
              std::string::npos);
}

TEST_F(ImageIo, UnreadableFilesAreNamedSo) {
    const std::string path = write_bytes("secret.png", "text");
    fs::permissions(folder_, fs::perms(0755));
    fs::permissions(path, fs::perms(0));
    const pid_t child = fork();
    if (child == 0) {
        // Root may read everything.
        if (geteuid() == 0 && seteuid(65534) != 0) _exit(2);
        _exit(error_of([&] { read_image(path); }) ==
                      "cannot read \"" + path + "\": Permission denied"
                  ? 0
                  : 1);
    }
    int status = 0;
    waitpid(child, &status, 0);
    EXPECT_EQ(WEXITSTATUS(status), 0);
}

TEST_F(ImageIo, ImagesInMemoryNeedNoFiles) {
    write_image(file("a.png"), sample_image({"R", "G", "B"}));
    const PixelBuffer expected = read_pixels(file("a.png"), true);
    std::ifstream in(file("a.png"), std::ios::binary);
    const std::string bytes{std::istreambuf_iterator<char>(in), {}};
    // No place for temporary files, and no room in any file.
    const char* const old = std::getenv("TMPDIR");
    setenv("TMPDIR", "/nonexistent", 1);
    rlimit limit;
    ASSERT_EQ(getrlimit(RLIMIT_FSIZE, &limit), 0);
    const rlimit none = {0, limit.rlim_max};
    const auto handler = std::signal(SIGXFSZ, SIG_IGN);
    ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &none), 0);
    PixelBuffer found;
    const std::string complaint =
        error_of([&] { found = decode_pixels(bytes, "the picture", true); });
    const std::string damaged =
        error_of([&] { decode_pixels(bytes.substr(0, bytes.size() / 2), "the picture", true); });
    setrlimit(RLIMIT_FSIZE, &limit);
    std::signal(SIGXFSZ, handler);
    old ? setenv("TMPDIR", old, 1) : unsetenv("TMPDIR");
    EXPECT_EQ(complaint, "");
    EXPECT_EQ(found.data, expected.data);
    EXPECT_TRUE(damaged.starts_with("cannot read \"the picture\": ")) << damaged;
}

TEST_F(ImageIo, EncodesPngsOfCompletePixelsOnly) {
    const std::vector<uint8_t> codes(12);
    EXPECT_NO_THROW(encode_png(2, 2, codes));
    EXPECT_NO_THROW(encode_png(4, 3, codes));  // grey
    for (const auto& [w, h] : {std::pair{0, 0}, {0, 4}, {4, 0}, {2, 3}, {1, 3}, {-2, -2}, {5, 5}})
        EXPECT_NE(error_of([&, width = w, height = h] { encode_png(width, height, codes); }), "")
            << w << " x " << h;
}

TEST_F(ImageIo, TruncatedFilesAreErrors) {
    Image image(64, 64, {"R", "G", "B"});
    for (size_t i = 0; i < image.data.size(); ++i)
        image.data[i] = to_unit_float(uint32_t(mix64(i)));
    for (const char* name : {"a.exr", "a.pfm", "a.hdr", "a.png"}) {
        write_image(file(name), image);
        fs::resize_file(file(name), fs::file_size(file(name)) / 2);
        EXPECT_NE(error_of([&] { read_image(file(name)); }).find(name), std::string::npos) << name;
    }
}

TEST_F(ImageIo, WritingMakesFolders) {
    write_image(file("new/folder/a.exr"), sample_image({"R", "G", "B"}));
    EXPECT_TRUE(fs::exists(file("new/folder/a.exr")));
}

TEST_F(ImageIo, WriteErrorsNameTheFileAndLeaveNothing) {
    const Image image = sample_image({"R", "G", "B"});
    EXPECT_NE(error_of([&] { write_image(file("a.jpg"), image); }).find("must end in .exr"),
              std::string::npos);
    EXPECT_NE(error_of([&] { check_image_extension("noextension"); }).find("noextension"),
              std::string::npos);
    EXPECT_NO_THROW(check_image_extension("UPPER.EXR"));
    EXPECT_NE(error_of([&] { write_image(file("a.exr"), Image()); }).find("empty"),
              std::string::npos);
    EXPECT_NE(error_of([&] {
                  write_image(file("a.png"), sample_image({"u", "v"}));
              }).find("a.png"),
              std::string::npos);
    fs::create_directory(file("folder.exr"));
    EXPECT_NE(error_of([&] { write_image(file("folder.exr"), image); }).find("there is a folder"),
              std::string::npos);
    write_bytes("plain", "");
    EXPECT_NE(error_of([&] { write_image(file("plain/a.exr"), image); }).find("plain/a.exr"),
              std::string::npos);
    EXPECT_EQ(file_count(), 2u);
}

TEST_F(ImageIo, FailedWritesKeepTheOldFile) {
    // A limit on the size of files stands for a disk that is full.
    Image big(256, 256, {"R", "G", "B"});
    for (size_t i = 0; i < big.data.size(); ++i) big.data[i] = to_unit_float(uint32_t(mix64(i)));
    const Image old = sample_image({"R", "G", "B"});
    for (const char* name : {"a.exr", "a.pfm", "a.hdr", "a.png"}) {
        write_image(file(name), old);
        const Image before = read_image(file(name));
        rlimit limit;
        ASSERT_EQ(getrlimit(RLIMIT_FSIZE, &limit), 0);
        const rlimit small = {16384, limit.rlim_max};
        const auto handler = std::signal(SIGXFSZ, SIG_IGN);
        ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &small), 0);
        const std::string message = error_of([&] { write_image(file(name), big); });
        setrlimit(RLIMIT_FSIZE, &limit);
        std::signal(SIGXFSZ, handler);
        EXPECT_NE(message.find(file(name)), std::string::npos) << name << ": " << message;
        EXPECT_EQ(read_image(file(name)).data, before.data) << name;
    }
    EXPECT_EQ(file_count(), 4u);
}

TEST(Images, LayersAndColours) {
    Image image;
    add_rgb_layer(image, 2, 1, "", std::vector<Rgb>{Rgb(1, 2, 3), Rgb(4, 5, 6)});
    add_rgb_layer(image, 2, 1, "direct", std::vector<Rgb>{Rgb(7, 8, 9), Rgb(10, 11, 12)});
    EXPECT_EQ(image.channels,
              (std::vector<std::string>{"R", "G", "B", "direct.R", "direct.G", "direct.B"}));
    EXPECT_EQ(image.layers(), (std::vector<std::string>{"", "direct"}));
    EXPECT_EQ(rgb_pixels(image)[1], Rgb(4, 5, 6));
    EXPECT_EQ(rgb_pixels(image, "direct")[0], Rgb(7, 8, 9));
    EXPECT_THROW(rgb_pixels(image, "indirect"), std::runtime_error);
    EXPECT_THROW(add_rgb_layer(image, 3, 1, "wide", std::vector<Rgb>(3)), std::invalid_argument);
    Image depth(1, 1, {"R", "G", "B", "depth.Z"});
    depth.data = {1, 2, 3, 4};
    EXPECT_EQ(rgb_pixels(depth, "depth")[0], Rgb(4));
}

}  // namespace
}  // namespace etendue::test
