// The number of threads follows the affinity of the process and the limits of its control groups.

#include "system/threads.h"

#include <sched.h>

#include <filesystem>
#include <fstream>

#include <gtest/gtest.h>

#include "run_program.h"

namespace etendue::test {
namespace {

namespace fs = std::filesystem;

class Quota : public testing::Test {
protected:
    void put(const fs::path& file, const std::string& text) const {
        fs::create_directories((folder_.path() / file).parent_path());
        std::ofstream(folder_.path() / file) << text << "\n";
    }
    std::optional<double> quota(const std::string& groups) const {
        return processor_quota(groups, folder_.path());
    }
    TemporaryFolder folder_;
};

TEST_F(Quota, OfVersion2) {
    EXPECT_EQ(quota("0::/\n"), std::nullopt);
    put("cpu.max", "max 100000");
    EXPECT_EQ(quota("0::/\n"), std::nullopt);
    put("cpu.max", "250000 100000");
    EXPECT_EQ(quota("0::/\n"), 2.5);
    // The least of all groups around it.
    put("slice/job/cpu.max", "400000 100000");
    EXPECT_EQ(quota("0::/slice/job\n"), 2.5);
    put("slice/cpu.max", "100000 100000");
    EXPECT_EQ(quota("0::/slice/job\n"), 1);
    // A path that does not exist here.
    EXPECT_EQ(quota("0::/../elsewhere\n"), 2.5);
}

TEST_F(Quota, OfVersion1) {
    put("cpu/docker/x/cpu.cfs_quota_us", "-1");
    put("cpu/docker/x/cpu.cfs_period_us", "100000");
    const std::string groups = "5:memory:/docker/x\n4:cpu,cpuacct:/docker/x\n3:cpuset:/docker/x\n";
    EXPECT_EQ(quota(groups), std::nullopt);
    put("cpu/docker/x/cpu.cfs_quota_us", "150000");
    EXPECT_EQ(quota(groups), 1.5);
    EXPECT_EQ(quota("3:cpuset:/docker/x\n"), std::nullopt);
}

TEST_F(Quota, OfNonsenseIsNone) {
    put("cpu.max", "0 0");
    for (const char* groups : {"", "0", "0:", "\n\n", "0::/\n", "::::"})
        EXPECT_EQ(quota(groups), std::nullopt) << groups;
}

TEST(Threads, FollowTheAffinity) {
    cpu_set_t all, one;
    ASSERT_EQ(sched_getaffinity(0, sizeof all, &all), 0);
    CPU_ZERO(&one);
    for (int i = 0; i < CPU_SETSIZE && CPU_COUNT(&one) == 0; ++i)
        if (CPU_ISSET(i, &all)) CPU_SET(i, &one);
    EXPECT_LE(available_threads(), CPU_COUNT(&all));
    ASSERT_EQ(sched_setaffinity(0, sizeof one, &one), 0);
    EXPECT_EQ(available_threads(), 1);
    EXPECT_EQ(thread_count(0), 1);
    EXPECT_EQ(thread_count(3), 3);
    sched_setaffinity(0, sizeof all, &all);
}

}  // namespace
}  // namespace etendue::test
