// Free memory: what the system has, and what control groups and limits leave of it.

#include "system/available_memory.h"

#include <filesystem>
#include <fstream>

#include <gtest/gtest.h>

#include "limited_memory.h"

namespace etendue {
namespace {

namespace fs = std::filesystem;

/// Files in a folder that is removed at the end.
class SystemFiles {
public:
    SystemFiles() {
        static int number = 0;
        folder_ = fs::path(::testing::TempDir()) /
                  ("memory-" + std::to_string(getpid()) + "-" + std::to_string(number++));
        write("proc/meminfo", "MemTotal:       1000 kB\nMemFree:  1 kB\nMemAvailable:    800 kB\n");
    }
    ~SystemFiles() { fs::remove_all(folder_); }
    SystemFiles(const SystemFiles&) = delete;
    SystemFiles& operator=(const SystemFiles&) = delete;

    void write(const std::string& name, const std::string& text) {
        fs::create_directories((folder_ / name).parent_path());
        std::ofstream(folder_ / name) << text;
    }
    std::optional<uint64_t> available(int sharers = 1) const {
        return available_memory((folder_ / "proc").string(), (folder_ / "cgroup").string(),
                                sharers);
    }

private:
    fs::path folder_;
};

TEST(AvailableMemory, IsThatOfTheSystem) {
    SystemFiles files;
    EXPECT_EQ(files.available(), 800u * 1024);
    files.write("proc/meminfo", "MemTotal: 1000 kB\n");
    EXPECT_EQ(files.available(), std::nullopt);
    ASSERT_TRUE(available_memory());
    EXPECT_GT(*available_memory(), 1u << 20);
}

TEST(AvailableMemory, IsLimitedByControlGroupsAndThoseAroundThem) {
    SystemFiles files;
    files.write("proc/self/cgroup", "0::/job/step\n");
    files.write("cgroup/job/step/memory.max", "max\n");
    files.write("cgroup/job/step/memory.current", "5000\n");
    EXPECT_EQ(files.available(), 800u * 1024);
    files.write("cgroup/job/memory.max", "100000\n");
    files.write("cgroup/job/memory.current", "30000\n");
    files.write("cgroup/job/memory.stat", "anon 10000\nfile 20000\nfile_mapped 7\n");
    EXPECT_EQ(files.available(), 90000u);  // files that are cached can be dropped
    files.write("cgroup/job/memory.stat", "anon 10000\nfile 20000\nshmem 15000\nfile_mapped 7\n");
    EXPECT_EQ(files.available(), 75000u);  // but not those in memory
    files.write("cgroup/job/memory.stat", "anon 10000\nfile 20000\n");
    files.write("cgroup/job/step/memory.max", "6000\n");
    EXPECT_EQ(files.available(), 1000u);
    files.write("cgroup/job/step/memory.current", "7000\n");
    EXPECT_EQ(files.available(), 0u);
}

TEST(AvailableMemory, IsLimitedByOldControlGroups) {
    SystemFiles files;
    files.write("proc/self/cgroup", "3:cpu:/x\n2:memory:/job\n");
    files.write("cgroup/memory/job/memory.limit_in_bytes", "9000\n");
    files.write("cgroup/memory/job/memory.usage_in_bytes", "8000\n");
    files.write("cgroup/memory/job/memory.stat", "cache 1\ntotal_cache 500\n");
    EXPECT_EQ(files.available(), 1500u);
    files.write("cgroup/memory/job/memory.stat", "cache 1\ntotal_cache 500\ntotal_shmem 200\n");
    EXPECT_EQ(files.available(), 1300u);
}

TEST(AvailableMemory, OfTheMachineIsDivided) {
    SystemFiles files;
    EXPECT_EQ(files.available(4), 200u * 1024);
    files.write("proc/self/cgroup", "0::/job\n");
    files.write("cgroup/job/memory.max", "100000\n");
    files.write("cgroup/job/memory.current", "30000\n");
    EXPECT_EQ(files.available(4), 17500u);
}

TEST(AvailableMemory, OfTheProcessIsNotDivided) {
    if (!kCanLimitMemory) GTEST_SKIP() << "sanitizers reserve memory";
    const std::string error = in_limited_memory(uint64_t(64) << 20, [] {
        // Far more than what the process may have.
        const uint64_t alone = available_memory(1).value(), shared = available_memory(2).value();
        if (shared + (4 << 20) < alone) throw std::runtime_error("it was divided");
    });
    EXPECT_EQ(error, "");
}

TEST(AvailableMemory, MessagesNameNeedAndWhatIsFree) {
    EXPECT_EQ(format_bytes(12 << 20), "12 MiB");
    EXPECT_EQ(format_bytes(uint64_t(3) << 29), "1.5 GiB");
    EXPECT_EQ(format_bytes(uint64_t(99) << 30), "99 GiB");
    EXPECT_NO_THROW(require_memory(1 << 20, "it"));
    try {
        require_memory(uint64_t(1) << 60, "the whole thing", "; do less");
        ADD_FAILURE();
    } catch (const std::runtime_error& e) {
        const std::string text = e.what();
        EXPECT_TRUE(text.starts_with("the whole thing needs 1073741824 GiB of memory, but only "))
            << text;
        EXPECT_TRUE(text.ends_with("iB are free; do less")) << text;
    }
}

TEST(AvailableMemory, IsWatchedInSteps) {
    if (!kCanLimitMemory) GTEST_SKIP() << "sanitizers need the address space";
    const std::string verdict = in_limited_memory(uint64_t(300) << 20, [] {
        MemoryWatch watch;
        std::vector<std::string> blocks;
        for (int i = 0; i < 1000; ++i) {
            if (!watch.add(4 << 20)) throw std::runtime_error("refused");
            blocks.emplace_back(4 << 20, 'x');
        }
    });
    EXPECT_EQ(verdict, "refused");
}

}  // namespace
}  // namespace etendue
