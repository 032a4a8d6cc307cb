// Processes that mpirun or srun starts, but that do not render together.

#include "system/ranks.h"

#include <cstdlib>
#include <map>
#include <string>

#include <gtest/gtest.h>

namespace etendue::test {
namespace {

class Strangers : public testing::Test {
protected:
    /// With these environment variables, and none of the others.
    std::string warning(const std::map<std::string, std::string>& variables,
                        const Ranks& joined = kAlone) const {
        for (const char* name : {"OMPI_COMM_WORLD_SIZE", "OMPI_COMM_WORLD_RANK", "PMI_SIZE",
                                 "PMI_RANK", "SLURM_STEP_NUM_TASKS", "SLURM_PROCID"})
            ::unsetenv(name);
        for (const auto& [name, value] : variables) ::setenv(name.c_str(), value.c_str(), 1);
        const std::string text = warning_of_strangers(joined);
        for (const auto& [name, value] : variables) ::unsetenv(name.c_str());
        return text;
    }
};

TEST_F(Strangers, AreNoticedByTheFirstOfThem) {
    EXPECT_EQ(warning({}), "");
    for (const auto& [program, count, index] :
         {std::tuple{"mpirun", "OMPI_COMM_WORLD_SIZE", "OMPI_COMM_WORLD_RANK"},
          std::tuple{"mpirun", "PMI_SIZE", "PMI_RANK"},
          std::tuple{"srun", "SLURM_STEP_NUM_TASKS", "SLURM_PROCID"}}) {
        SCOPED_TRACE(count);
        const std::string text = warning({{count, "4"}, {index, "0"}});
        EXPECT_TRUE(text.starts_with(std::string(program) + " has started 4 processes")) << text;
        EXPECT_EQ(warning({{count, "4"}, {index, "1"}}), "");
        EXPECT_EQ(warning({{count, "1"}, {index, "0"}}), "");
    }
}

/// A job of Slurm, outside of a step, has tasks that are still to be started.
TEST_F(Strangers, AreNoneInAJobWithoutSteps) {
    EXPECT_EQ(warning({{"SLURM_NTASKS", "4"}, {"SLURM_PROCID", "0"}}), "");
}

/// Within a step of Slurm, which starts one process for each machine, mpirun has started a single one.
TEST_F(Strangers, AreThoseOfTheLastThatStartsProcesses) {
    EXPECT_EQ(warning({{"OMPI_COMM_WORLD_SIZE", "1"},
                       {"OMPI_COMM_WORLD_RANK", "0"},
                       {"SLURM_STEP_NUM_TASKS", "3"},
                       {"SLURM_PROCID", "0"}}),
              "");
}

TEST_F(Strangers, AreNoneWhereTheyRenderTogether) {
    struct Two : Ranks {
        int count() const override { return 2; }
    };
    EXPECT_EQ(warning({{"PMI_SIZE", "2"}, {"PMI_RANK", "0"}}, Two()), "");
}

}  // namespace
}  // namespace etendue::test
