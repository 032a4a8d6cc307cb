// Image files that end early, or claim more than they hold.

#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>

#include <gtest/gtest.h>

#include "error_of.h"
#include "image/image_io.h"
#include "jpeg_of_noise.h"
#include "limited_memory.h"
#include "math/hash.h"
#include "run_program.h"

namespace etendue::test {
namespace {

std::string complaint(const std::string& bytes) {
    return error_of([&] { decode_pixels(bytes, "picture", true); });
}

std::string big_endian(unsigned v) {
    return {char(v >> 8), char(v)};
}
std::string little_endian(uint32_t v, size_t bytes = 4) {
    std::string word;
    for (size_t i = 0; i < bytes; ++i) word += char(v >> 8 * i);
    return word;
}

std::string segment(char marker, const std::string& contents) {
    return std::string{'\xff', marker} + big_endian(unsigned(contents.size()) + 2) + contents;
}

/// A grey progressive JPEG; `data`: of each scan. A bit of 0 is a block.
std::string black_jpeg(unsigned size, int scans, const std::string& data) {
    std::string all = "\xff\xd8";
    all += segment('\xdb', std::string(1, '\0') + std::string(64, '\1'));
    all +=
        segment('\xc2', "\x08" + big_endian(size) + big_endian(size) + std::string{1, 1, 0x11, 0});
    all += segment('\xc4', std::string{0, 1} + std::string(15, '\0') + '\0');
    for (int i = 0; i < scans; ++i) all += segment('\xda', std::string{1, 1, 0, 0, 0, 0}) + data;
    return all + "\xff\xd9";
}

TEST(DamagedImages, EndEarly) {
    const std::string tga = std::string{0, 0, 2, 0, 0, 0, 0, 0, 0, 0, 0, 0} +
                            std::string{64, 0, 64, 0, 24, 0x20},
                      bmp = "BM" + little_endian(54 + 64 * 64 * 3) + little_endian(0) +
                            little_endian(54) + little_endian(40) + little_endian(64) +
                            little_endian(64) + little_endian(1, 2) + little_endian(24, 2) +
                            std::string(24, '\0');
    std::string runs;  // packets of one pixel each
    for (int i = 0; i < 64 * 64; ++i) runs += '\0' + noise(3);
    std::string tga_with_runs = tga;
    tga_with_runs[2] = 10;
    const std::pair<const char*, std::string> files[] = {
        {"TGA", tga + noise(64 * 64 * 3)},
        {"TGA with runs", tga_with_runs + runs},
        {"BMP", bmp + noise(64 * 64 * 3)},
        {"JPEG", jpeg_of_noise(64, 1, false)},
        {"PPM", "P6 64 64 255\n" + noise(64 * 64 * 3)},
    };
    for (const auto& [name, bytes] : files) {
        EXPECT_EQ(complaint(bytes), "") << name;
        for (const size_t less : {size_t(6), bytes.size() / 10, bytes.size() / 2})
            EXPECT_NE(complaint(bytes.substr(0, bytes.size() - less)).find("too early"),
                      std::string::npos)
                << name << " without " << less;
    }
    // What is left of it is a whole image of less detail.
    const std::string progressive = jpeg_of_noise(64, 1, true);
    EXPECT_EQ(complaint(progressive), "");
    EXPECT_EQ(complaint(progressive.substr(0, progressive.size() - 2)), "");
}

/// The largest memory of a process that reads a file, in MiB.
long memory_to_read(const std::string& bytes, std::string& why) {
    int pipes[2];
    if (pipe(pipes) != 0) return -1;
    const pid_t child = fork();
    if (child == 0) {
        const std::string text = complaint(bytes);
        _exit(write(pipes[1], text.data(), text.size()) == ssize_t(text.size()) ? 0 : 1);
    }
    close(pipes[1]);
    char buffer[256];
    for (ssize_t n; (n = read(pipes[0], buffer, sizeof buffer)) > 0;) why.append(buffer, size_t(n));
    close(pipes[0]);
    rusage used{};
    int status = 0;
    wait4(child, &status, 0, &used);
    return used.ru_maxrss / 1024;
}

TEST(DamagedImages, ThatClaimTooManyPixelsTakeNoMemory) {
    std::string why;
    EXPECT_LT(memory_to_read(black_jpeg(24000, 1, ""), why), 400);
    EXPECT_NE(why.find("its header claims 24000 x 24000 pixels"), std::string::npos) << why;
}

/// As bytes, as pixels, or as numbers.
TEST(LargeImages, AreNamedWhereMemoryEnds) {
    const TemporaryFolder folder;
    const std::string file = folder.path() / "large.pfm";
    std::ofstream(file) << "PF\n1024 1024\n-1\n";
    const auto readings = [&] {
        return std::array<std::function<void()>, 3>{
            [&] { read_pixels(file, false); }, [&] { read_image(file); }, [&] { read_rgb(file); }};
    };
    std::filesystem::resize_file(file, uint64_t(1) << 40);
    for (const auto& read : readings())
        EXPECT_EQ(error_of(read), "cannot read \"" + file + "\": it does not fit into memory");
    if (!kCanLimitMemory) return;
    std::filesystem::resize_file(file, 18 + 12 * 1024 * 1024);
    for (const auto& read : readings()) {
        int failures = 0;
        for (uint64_t limit = 1; limit <= 64; limit += 5) {
            const std::string verdict = in_limited_memory(limit << 20, read);
            failures += !verdict.empty();
            EXPECT_TRUE(verdict.empty() || verdict.starts_with("cannot read \"" + file)) << verdict;
        }
        EXPECT_GT(failures, 2);
        EXPECT_LT(failures, 13);
    }
}

TEST(DamagedImages, OfManyScansAreRefused) {
    EXPECT_EQ(complaint(black_jpeg(64, 1, std::string(8, '\0'))), "");
    EXPECT_NE(
        complaint(black_jpeg(64, 5000, std::string(8, '\0'))).find("it has more than 1000 scans"),
        std::string::npos);
}

TEST(DamagedImages, AreOfAFormatThatIsKnown) {
    EXPECT_NE(complaint("#?RADIANCE\nFORMAT=32-bit_rle_xyze\n\n-Y 1 +X 1\nabcd")
                  .find("its format is \"32-bit_rle_xyze\""),
              std::string::npos);
    EXPECT_NE(complaint("P6x 1 1 255 abc")
                  .find("it does not begin with \"P2\", \"P3\", \"P5\" or "
                        "\"P6\""),
              std::string::npos);
}

/// Rows are plain unless they are of 8 to 32767 pixels, whatever their first bytes are.
TEST(Radiance, NarrowRowsHaveNoRuns) {
    const std::string pixels = {2, 2, 1, -128, 4, 2, 1, -128};
    const PixelBuffer read = decode_pixels("#?RADIANCE\n\n-Y 1 +X 2\n" + pixels, "picture", true);
    const auto& values = std::get<std::vector<float>>(read.data);
    EXPECT_EQ(values, (std::vector<float>{2 / 256.0f, 2 / 256.0f, 1 / 256.0f, 4 / 256.0f,
                                          2 / 256.0f, 1 / 256.0f}));
}

/// The mean of many pixels keeps more digits than each of them.
TEST(Radiance, RoundsToTheNearestCode) {
    constexpr int kSize = 256;
    std::vector<Rgb> pixels(kSize * kSize);
    double mean = 0, found = 0;
    for (size_t i = 0; i < pixels.size(); ++i) {
        pixels[i] = Rgb(to_unit_float(uint32_t(mix64(i))) + 0.1f);
        mean += double(pixels[i].g);
    }
    const std::string path = testing::TempDir() + "rounded.hdr";
    write_image(path, rgb_image(kSize, kSize, pixels));
    for (const Rgb& c : read_rgb(path).pixels) found += double(c.g);
    EXPECT_NEAR(found / mean, 1, 2e-4);
    // No float is black because it is large.
    pixels.assign(1, Rgb(3e38f, 1, 0));
    write_image(path, rgb_image(1, 1, pixels));
    EXPECT_GT(read_rgb(path).pixels[0].r, 1.6e38f);
    std::remove(path.c_str());
}

}  // namespace
}  // namespace etendue::test
