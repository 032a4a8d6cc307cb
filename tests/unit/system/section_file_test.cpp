// Files of sections: values come back, and whatever is done to a file is noticed.

#include "system/section_file.h"

#include <filesystem>
#include <fstream>
#include <iterator>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "error_of.h"
#include "limited_memory.h"

namespace etendue::test {
namespace {

namespace fs = std::filesystem;

class SectionFileTest : public ::testing::Test {
protected:
    SectionFileTest() : file(fs::path(::testing::TempDir()) / "sections.etd") {
        SectionWriter to(file);
        to.begin("numbers");
        to.put(7);
        to.put(0.25);
        to.put(large);
        to.begin("nothing");
        to.begin("text");
        to.put(std::string("a text"));
        to.commit();
    }
    ~SectionFileTest() override { fs::remove(file); }

    std::string bytes() const {
        std::ifstream in(file, std::ios::binary);
        return {std::istreambuf_iterator<char>(in), {}};
    }
    /// Reads all values, and returns the message of an error.
    std::string read(std::string contents) const {
        try {
            SectionReader from(std::move(contents), "it");
            from.check();
            return read(from);
        } catch (const std::runtime_error& e) {
            EXPECT_TRUE(std::string_view(e.what()).starts_with("it: ")) << e.what();
            return e.what();
        }
    }
    std::string read(SectionReader& from) const {
        from.open("numbers");
        EXPECT_EQ(from.get<int>(), 7);
        EXPECT_EQ(from.get<double>(), 0.25);
        std::vector<float> list;
        from.get(list);
        EXPECT_EQ(list, large);
        from.finish();
        from.open("text");
        std::string text;
        from.get(text);
        EXPECT_EQ(text, "a text");
        from.finish();
        from.open("nothing");
        from.finish();
        return "";
    }

    const std::string file;
    const std::vector<float> large = std::vector<float>(100000, 1.5f);
};

TEST_F(SectionFileTest, ValuesComeBack) {
    SectionReader from(file);
    EXPECT_EQ(read(from), "");
    EXPECT_EQ(from.size("nothing"), 0u);
    EXPECT_FALSE(from.has("other"));
    EXPECT_TRUE(SectionReader::is_one(file));
    EXPECT_THROW(from.open("other"), std::runtime_error);
}

TEST_F(SectionFileTest, InMemoryItIsTheSame) {
    SectionWriter to;
    to.begin("numbers");
    to.put(7);
    to.put(0.25);
    to.put(large);
    to.begin("nothing");
    to.begin("text");
    to.put(std::string("a text"));
    EXPECT_EQ(to.take(), bytes());
}

TEST_F(SectionFileTest, ClosedFilesAreOpenedAgain) {
    SectionReader from(file), in_memory(bytes(), "it");
    for (SectionReader* r : {&from, &in_memory}) {
        for (int i = 0; i < 2; ++i) {
            r->close();
            EXPECT_TRUE(r->has("text"));
            EXPECT_EQ(read(*r), "");
        }
        r->close();
        r->check();
    }
}

TEST_F(SectionFileTest, FilesThatChangeWhileTheyAreClosedAreRefused) {
    SectionReader from(file);
    from.close();
    SectionWriter to(file);
    to.begin("text");
    to.put(std::string("another text"));
    to.commit();
    const std::string message = error_of([&] { from.open("text"); });
    EXPECT_EQ(message, file + ": the file was changed while it was read");
    from.close();
    fs::remove(file);
    EXPECT_NE(error_of([&] { from.check(); }).find("No such file"), std::string::npos);
}

TEST_F(SectionFileTest, EveryChangedByteIsNoticed) {
    const std::string whole = bytes();
    ASSERT_EQ(read(whole), "");
    for (size_t i = 0; i < whole.size(); i += i < 200 || i + 400 > whole.size() ? 1 : 9973)
        for (const int bit : {0, 7}) {
            std::string damaged = whole;
            damaged[i] = char(damaged[i] ^ 1 << bit);
            EXPECT_NE(read(damaged), "") << i << ", " << bit;
        }
}

TEST_F(SectionFileTest, CutAndLongerFilesAreNoticed) {
    const std::string whole = bytes();
    for (size_t size = 0; size < whole.size();
         size += size < 200 || size + 400 > whole.size() ? 1 : 9973)
        EXPECT_NE(read(whole.substr(0, size)), "") << size;
    EXPECT_NE(read(whole + '\0').find("1 bytes follow"), std::string::npos);
}

TEST_F(SectionFileTest, ListsAreNotLongerThanTheirSections) {
    SectionWriter to(file);
    to.begin("list");
    to.put(~uint64_t(0) / 2);
    to.put(1.0f);
    to.commit();
    SectionReader from(file);
    std::vector<double> list;
    from.open("list");
    EXPECT_THROW(from.get(list), std::runtime_error);
    from.open("list");
    std::string text;
    EXPECT_THROW(from.get(text), std::runtime_error);
    from.open("list");
    EXPECT_THROW(from.get(list, 3, "numbers"), std::runtime_error);
    from.open("list");
    from.get<uint64_t>();
    EXPECT_THROW(from.get<double>(), std::runtime_error);
    EXPECT_THROW(from.finish(), std::runtime_error);
}

TEST_F(SectionFileTest, ListsThatDoNotFitIntoMemoryAreNamed) {
    if (!kCanLimitMemory) GTEST_SKIP() << "sanitizers need the address space";
    SectionWriter to(file);
    to.begin("list");
    const std::vector<double> written(size_t(4) << 20);  // not free while it is read
    to.put(written);
    to.commit();
    EXPECT_EQ(in_limited_memory(uint64_t(8) << 20,
                                [&] {
                                    SectionReader from(file);
                                    std::vector<double> list;
                                    from.open("list");
                                    from.get(list);
                                }),
              file + ": section \"list\": it does not fit into memory");
}

TEST_F(SectionFileTest, OfAnotherVersionSaysSo) {
    std::string other = bytes();
    ++other[8];
    EXPECT_NE(read(other).find(fmt::format("version {}", int(other[8]))), std::string::npos);
    EXPECT_NE(read("<scene/>").find("no state of a rendering"), std::string::npos);
}

TEST_F(SectionFileTest, WithoutCommitNothingChanges) {
    const std::string before = bytes();
    {
        SectionWriter to(file);
        to.begin("numbers");
        to.put(8);
    }
    EXPECT_EQ(bytes(), before);
}

}  // namespace
}  // namespace etendue::test
