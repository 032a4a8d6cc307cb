// Parts of the report: embedded images, plots, memory.

#include "compare/report.h"

#include <sys/mman.h>

#include <cmath>
#include <cstring>
#include <fstream>
#include <limits>
#include <vector>

#include <gtest/gtest.h>

#include "compare/embedded_image.h"
#include "compare/memory.h"
#include "compare/plot.h"
#include "image/image.h"
#include "run_program.h"

namespace etendue::test {
namespace {

TEST(Base64, EncodesTheExamplesOfTheStandard) {
    // [RFC 4648, §10]
    EXPECT_EQ(base64(""), "");
    EXPECT_EQ(base64("f"), "Zg==");
    EXPECT_EQ(base64("fo"), "Zm8=");
    EXPECT_EQ(base64("foo"), "Zm9v");
    EXPECT_EQ(base64("foobar"), "Zm9vYmFy");
    EXPECT_EQ(base64("\xff\xfe\x00"), "//4=");
}

/// The bytes that a data URI stands for.
std::string decoded(const std::string& uri) {
    const std::string digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    std::string out;
    uint32_t group = 0;
    int count = 0;
    for (char c : uri.substr(uri.find(',') + 1)) {
        if (c == '=') break;
        group = group << 6 | uint32_t(digits.find(c));
        if (++count % 4 == 0)
            for (int shift : {16, 8, 0}) out += char(group >> shift & 255);
    }
    if (count % 4 == 3) out += {char(group >> 10 & 255), char(group >> 2 & 255)};
    if (count % 4 == 2) out += char(group >> 4 & 255);
    return out;
}

TEST(EmbeddedImage, HoldsRadianceToOnePartIn512) {
    constexpr float kInfinity = std::numeric_limits<float>::infinity();
    const std::vector<Rgb> pixels = {Rgb(0.1f, 1, 3.14159f), Rgb(1e-4f, 60000, 65504),
                                     Rgb(-2, 0, 1e30f), Rgb(kInfinity, std::nanf(""), 0.333f)};
    const std::string uri = radiance_data_uri(2, 2, pixels);
    ASSERT_TRUE(uri.starts_with("data:image/png;base64,"));
    const TemporaryFolder folder;
    const std::string file = (folder.path() / "a.png").string();
    std::ofstream(file, std::ios::binary) << decoded(uri);
    const PixelBuffer png = read_pixels(file, true);
    ASSERT_EQ(png.width, 2);
    ASSERT_EQ(png.height, 4);
    ASSERT_EQ(png.channels, 3);
    const auto& codes = std::get<std::vector<uint8_t>>(png.data);
    for (size_t i = 0; i < 4; ++i)
        for (int c = 0; c < 3; ++c) {
            const size_t at = 3 * i + size_t(c);
            const float v = float(Half(Half::FromBits, uint16_t(codes[at] << 8 | codes[12 + at])));
            const float expected = pixels[i][c];
            if (std::isnan(expected))
                EXPECT_TRUE(std::isnan(v));
            else if (std::isinf(expected))
                EXPECT_EQ(v, expected);
            else
                EXPECT_NEAR(v, std::min(expected, 65504.0f), std::fabs(v) / 512) << expected;
        }
}

TEST(EmbeddedImage, ReducesByAverages) {
    const std::vector<Rgb> pixels = {Rgb(1), Rgb(3), Rgb(5), Rgb(7)};
    const RgbImage half = reduced(4, 1, pixels, 2);
    ASSERT_EQ(half.pixels.size(), 2u);
    EXPECT_EQ(half.pixels[0], Rgb(2));
    EXPECT_EQ(half.pixels[1], Rgb(6));
    EXPECT_EQ(reduced(4, 1, pixels, 100).pixels.size(), 4u);
}

TEST(Plot, DrawsPositiveValuesOnly) {
    LogLogPlot plot{"a < b", "time", "error", {}};
    EXPECT_NE(plot.svg().find("</svg>"), std::string::npos) << "without curves";
    plot.curves.push_back({"m & n", {{1, 1}, {10, 0.1}, {100, -1}, {0, 1}}, PowerLaw{-1, 1, 2}});
    const std::string svg = plot.svg();
    EXPECT_NE(svg.find("a &lt; b"), std::string::npos);
    EXPECT_NE(svg.find("m &amp; n, slope -1.00"), std::string::npos);
    EXPECT_EQ(svg.find("nan"), std::string::npos);
    EXPECT_EQ(svg.find("inf"), std::string::npos);
    size_t circles = 0;
    for (size_t at = 0; (at = svg.find("<circle", at)) != std::string::npos; ++at) ++circles;
    EXPECT_EQ(circles, 2u);
}

/// Memory from the system, which becomes resident and is returned at once, unlike that of an allocator.
class Pages {
public:
    explicit Pages(size_t bytes)
        : bytes_(bytes), begin_(mmap(nullptr, bytes, PROT_READ | PROT_WRITE,
                                     MAP_PRIVATE | MAP_ANONYMOUS | MAP_POPULATE, -1, 0)) {
        EXPECT_NE(begin_, MAP_FAILED);
    }
    ~Pages() { munmap(begin_, bytes_); }
    Pages(const Pages&) = delete;
    Pages& operator=(const Pages&) = delete;

private:
    size_t bytes_;
    void* begin_;
};

TEST(MemoryMeter, CountsWhatBecomesResidentInItsTurns) {
    constexpr size_t kMiB = 1 << 20;
    if (resident_bytes() == 0) GTEST_SKIP() << "this system does not tell";
    MemoryMeter one, other;
    one.begin();
    const Pages kept(32 * kMiB);
    { const Pages passing(64 * kMiB); }
    one.end();
    other.begin();
    const Pages more(16 * kMiB);
    other.end();
    one.begin();
    { const Pages passing(80 * kMiB); }
    one.end();
    EXPECT_NEAR(double(one.peak_bytes()) / kMiB, 32 + 80, 4);
    EXPECT_NEAR(double(other.peak_bytes()) / kMiB, 16, 4);
}

TEST(FileStem, KeepsWhatFileNamesMayHave) {
    EXPECT_EQ(file_stem("bdpt:max_depth=8,rr_depth=5"), "bdpt_max_depth=8_rr_depth=5");
    EXPECT_EQ(file_stem("../a b"), ".._a_b");
}

}  // namespace
}  // namespace etendue::test
